//! Calibrations of simulated triads: unbiased, honest, no worse than the published formulas, at the bound. And of a real
//! recording, where there is one.

use std::path::PathBuf;

use north::calibrate::ellipsoid::calibrate;
use north::calibrate::trials::{Parameter, Tally, ellipsoid, six_position, voyage};
use north_finder::calibration::ellipsoid::{Correction, Role, norm_rms};

const TRIALS: u64 = 1500;

fn summaries<T, const N: usize>(names: [&str; N], trials: &[T], of: impl Fn(&T, usize) -> [f64; 3]) -> Vec<Parameter> {
    let summary = |i: usize| {
        let mut tally = Tally::default();
        trials.iter().map(|trial| of(trial, i)).for_each(|[error, sigma, other]| tally.push(error, sigma, other));
        tally.summary(names[i].into())
    };
    (0..N).map(summary).collect()
}

/// The mean of 1500 errors in sigmas is known to 1/√1500 = 0.026; the share that a 95 % interval holds to 0.56 %. Of 21
/// parameters none is further off than four of these.
fn assert_honest(parameters: &[Parameter]) {
    for parameter in parameters {
        assert!(parameter.mean_in_sigmas.abs() < 4.0 / (TRIALS as f64).sqrt(), "{parameter:?}");
        assert!((0.95 - 4.0 * 0.0056..=0.95 + 4.0 * 0.0056).contains(&parameter.coverage), "{parameter:?}");
    }
}

#[test]
fn six_positions_are_unbiased_honest_and_better_than_the_differences() {
    let case = six_position::Case::NOMINAL;
    let trials: Vec<_> = (0..TRIALS).filter_map(|number| six_position::run(&case, 11, number)).collect();
    // One in a thousand is refused, because its closure is as improbable as that.
    assert!(trials.len() as u64 >= TRIALS - 10, "{}", trials.len());
    let parameters = summaries(six_position::NAMES, &trials, |trial, i| {
        [trial.solved[i] - trial.truth[i], trial.sigmas[i], trial.published[i] - trial.truth[i]]
    });
    assert_honest(&parameters);
    // By hand: biases √(3/16) against √(1/2), 0.61; responses about x and y √(3/8) against √(1/2), 0.87; about z 0.61. The
    // ratio of two rms of 1500 is known to better than 3 %.
    for (i, parameter) in parameters.iter().enumerate() {
        let expected = if i < 3 || (i - 3) % 3 == 2 { 0.612 } else { 0.866 };
        let ratio = parameter.rms / parameter.reference_rms;
        assert!((ratio / expected - 1.0).abs() < 0.1, "{ratio} {parameter:?}");
    }
}

#[test]
fn the_ellipsoid_is_unbiased_honest_and_at_the_bound() {
    let case = ellipsoid::Case::NOMINAL;
    let trials: Vec<_> = (0..TRIALS).filter_map(|number| ellipsoid::run(&case, 12, number)).collect();
    assert_eq!(trials.len() as u64, TRIALS);
    let parameters =
        summaries(ellipsoid::NAMES, &trials, |trial, i| [trial.errors[i], trial.sigmas[i], trial.bounds[i]]);
    assert_honest(&parameters);
    for parameter in parameters {
        // An rms of 1500 is known to 1.8 %.
        assert!((0.93..1.1).contains(&parameter.ratio), "{parameter:?}");
    }
}

#[test]
fn a_calibration_shortens_the_error_of_a_voyage() {
    let voyages: Vec<_> = (0..12).filter_map(|number| voyage::run(34.75, 15.0, 13, number)).collect();
    assert_eq!(voyages.len(), 12);
    let rms = |value: fn(&voyage::Trial) -> f64| {
        (voyages.iter().map(|trial| value(trial).powi(2)).sum::<f64>() / 12.0).sqrt()
    };
    let (before, after) = (rms(|trial| trial.uncalibrated_nmi), rms(|trial| trial.solved_nmi));
    // The source's gain is 62.6 %.
    assert!(after < (1.0 - 0.5) * before, "{before} {after}");
    assert!(after <= 1.1 * rms(|trial| trial.published_nmi));
}

/// The folder with measured data, which the project does not contain.
fn data() -> PathBuf {
    std::env::var_os("NORTH_FINDER_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from)
}

/// What imu_tk itself prints for this recording (test_imu_calib, all 38 intervals: misalignments and inverse scale factors,
/// m/s² per count, at 9.81744 m/s²): T · K and the biases.
const IMU_TK: Correction = Correction {
    bias: [33_124.2, 33_275.2, 32_364.4],
    matrix: [
        [0.00241278, -0.003_359_3 * 0.00242712, -0.008_906_39 * 0.00241168],
        [0.0, 0.00242712, -0.021_334_1 * 0.00241168],
        [0.0, 0.0, 0.00241168],
    ],
};

#[test]
fn a_real_recording_of_a_mems_triad() {
    let path = data().join("mems-multi-position/counts_100hz.csv");
    if !path.exists() {
        println!("skipped: no measured data (set NORTH_FINDER_DATA)");
        return;
    }
    const GRAVITY: f64 = 9.81744;
    let outcome = calibrate(&path, GRAVITY).unwrap();
    let found = &outcome.calibration;
    let published = |role| norm_rms(outcome.means(role), &IMU_TK, GRAVITY).unwrap();
    let checked = found.check_norm_rms.unwrap();
    println!("{} attitudes, {} of them only judged", outcome.stays.len(), outcome.count(Role::Check));
    println!(
        "norm rms of those only judged: {checked:.6} m/s2; by imu_tk, which learned from them: {:.6}",
        published(Role::Check)
    );
    println!("norm rms of those learned from: {:.6} m/s2; by imu_tk: {:.6}", found.norm_rms, published(Role::Fit));
    let all = |correction: &Correction| {
        norm_rms(outcome.means(Role::Fit).chain(outcome.means(Role::Check)), correction, GRAVITY)
    };
    println!("norm rms of all: {:.6} m/s2; by imu_tk: {:.6}", all(&found.correction).unwrap(), all(&IMU_TK).unwrap());
    assert!(outcome.stays.len() >= 37);
    assert!(checked < 2e-4 * GRAVITY, "{checked}");
    // Two solvers, the same triad.
    for (ours, theirs) in found.correction.bias.into_iter().zip(IMU_TK.bias) {
        assert!((ours - theirs).abs() < 2.0, "{ours} {theirs}");
    }
    for (ours, theirs) in found.correction.matrix.iter().flatten().zip(IMU_TK.matrix.iter().flatten()) {
        assert!((ours - theirs).abs() < 2e-3 * 0.0024, "{ours} {theirs}");
    }
}
