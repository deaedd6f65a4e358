//! Calibrations of simulated triads: unbiased, honest, no worse than the published formulas, at the bound. And of a real
//! recording, where there is one.

use std::path::Path;

use calibration::ellipsoid::attitude::Attitude;
use calibration::ellipsoid::{Correction, Entry, Role, fit, norm_rms};
use north::calibrate::attitudes::Dwell;
use north::calibrate::ellipsoid::calibrate;
use proofs::trials::{Parameter, Tally, ellipsoid, six_position, voyage};

use crate::common::measured_data;

const TRIALS: u64 = 1500;
/// Calibrations of a kind in `make test`; the 1500 run in `make proofs`.
const FEW: u64 = 100;

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

/// The mean of 100 errors in sigmas is known to 0.1, of which five are allowed; 17 or more of 100 honest 95 % intervals miss with the probability
/// 10⁻⁵ (binomial).
#[test]
fn a_few_calibrations_of_either_kind_are_honest() {
    let six = (0..FEW).filter_map(|number| six_position::run(&six_position::Case::NOMINAL, 11, number));
    let six = summaries(six_position::NAMES, &six.collect::<Vec<_>>(), |trial, i| {
        [trial.solved[i] - trial.truth[i], trial.sigmas[i], trial.published[i] - trial.truth[i]]
    });
    let ellipsoids = (0..FEW).filter_map(|number| ellipsoid::run(&ellipsoid::Case::NOMINAL, 12, number));
    let ellipsoids = summaries(ellipsoid::NAMES, &ellipsoids.collect::<Vec<_>>(), |trial, i| {
        [trial.errors[i], trial.sigmas[i], trial.bounds[i]]
    });
    for parameter in six.iter().chain(&ellipsoids) {
        assert!(parameter.mean_in_sigmas.abs() < 0.5 && parameter.coverage > 0.835, "{parameter:?}");
    }
}

/// The first of the voyages below.
#[test]
fn six_positions_shorten_the_error_of_one_voyage() {
    let voyage = voyage::run(34.75, 15.0, 13, 0).unwrap();
    let greatest_nmi = |column: usize| voyage.navigated[column].greatest_nmi;
    assert!(greatest_nmi(3) < 0.2 * greatest_nmi(0) && greatest_nmi(7) < greatest_nmi(0));
}

#[test]
#[ignore = "1500 trials: make proofs"]
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
#[ignore = "1500 trials: make proofs"]
fn sigmas_hold_the_truth_far_south_with_a_rough_table_and_a_bias_that_wanders() {
    let case = six_position::Case {
        latitude_deg: -58.0,
        dwell_s: 200.0,
        arw_deg_per_sqrt_h: 0.003,
        bias_instability_deg_h: 0.005,
        table_arcsec: 60.0,
    };
    let trials: Vec<_> = (0..TRIALS).filter_map(|number| six_position::run(&case, 14, number)).collect();
    assert!(trials.len() as u64 >= TRIALS - 15, "{}", trials.len());
    let parameters = summaries(six_position::NAMES, &trials, |trial, i| {
        [trial.solved[i] - trial.truth[i], trial.sigmas[i], trial.published[i] - trial.truth[i]]
    });
    for parameter in &parameters {
        assert!(parameter.mean_in_sigmas.abs() < 4.0 / (TRIALS as f64).sqrt(), "{parameter:?}");
        assert!(parameter.coverage > 0.93 - 2.0 * 0.0056, "{parameter:?}");
        assert!(parameter.rms < parameter.reference_rms, "{parameter:?}");
    }
}

#[test]
#[ignore = "1500 trials: make proofs"]
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
#[ignore = "twelve voyages: make proofs"]
fn six_positions_shorten_the_error_of_a_voyage_where_the_table_is_coarse() {
    // Navigated: none; traditional, differences, least squares on ±3″; the same on ±3′; the true parameters.
    let voyages: Vec<_> = (0..12).filter_map(|number| voyage::run(34.75, 15.0, 13, number)).collect();
    assert_eq!(voyages.len(), 12);
    let rms = |column: usize| {
        let squares = voyages.iter().map(|trial| trial.navigated[column].greatest_nmi.powi(2));
        (squares.sum::<f64>() / 12.0).sqrt()
    };
    let [none, .., coarse_traditional, _, coarse_solved, perfect] = [0, 1, 2, 3, 4, 5, 6, 7].map(rms);
    let fine_solved = rms(3);
    assert!(fine_solved < 0.2 * none && perfect < fine_solved, "{none} {fine_solved} {perfect}");
    assert!(coarse_solved < coarse_traditional, "{coarse_traditional} {coarse_solved}");
}

/// What imu_tk itself prints for this recording (its test_imu_calib: misalignments T and inverse scale factors K, m/s² per
/// count, at 9.81744 m/s²): T · K and the biases. The "residual 0.120131" beside it is half the sum of squares over 100
/// readings of each of 38 rests, all of which it learned from: 0.00795 m/s² rms of a single reading.
const IMU_TK: Correction = Correction {
    bias: [33_124.2, 33_275.2, 32_364.4],
    matrix: [
        [0.00241278, -0.003_359_3 * 0.00242712, -0.008_906_39 * 0.00241168],
        [0.0, 0.00242712, -0.021_334_1 * 0.00241168],
        [0.0, 0.0, 0.00241168],
    ],
};
const IMU_TK_READING_RMS: f64 = 0.00795;
/// The gravity that it assumes, m/s².
const GRAVITY: f64 = 9.81744;

#[test]
fn a_real_recording_of_a_mems_triad() {
    let path = measured_data().join("mems-multi-position/counts_100hz.csv");
    if !path.exists() {
        println!("skipped: no measured data (set NORTH_FINDER_DATA)");
        return;
    }
    let outcome = calibrate(&path, GRAVITY, None).unwrap();
    let found = &outcome.calibration;
    let rms = |role, correction| norm_rms(outcome.means(role), correction, GRAVITY).unwrap();
    let checked = found.check_norm_rms.unwrap();
    let rests = rests(&path, &outcome.dwells);
    let of_readings =
        |correction| norm_rms(rests.iter().flat_map(|rest| middle(rest)).copied(), correction, GRAVITY).unwrap();
    let (differ, white) = halves(&rests, &found.correction);
    let means: Vec<_> = outcome.dwells.iter().map(|dwell| dwell.attitude.mean).collect();
    let whole: Vec<_> = outcome.dwells.iter().map(|dwell| dwell.attitude).collect();
    let hundred = rests.iter().map(|rest| Attitude::of(middle(rest), 3.0, &mut [0.0; 100]).unwrap());
    let one_by_one = each_judged_by_the_others(&means, &whole);
    let by_hundred = each_judged_by_the_others(&means, &hundred.collect::<Vec<_>>());
    println!("norm at rest, rms, m/s2: {} attitudes, {} only judged", outcome.dwells.len(), outcome.count(Role::Check));
    println!("                                            here  imu_tk (learned from all)");
    println!("  attitudes only judged                  {checked:.6}  {:.6}", rms(Role::Check, &IMU_TK));
    println!("  attitudes learned from                 {:.6}  {:.6}", found.norm_rms, rms(Role::Fit, &IMU_TK));
    println!(
        "  each judged by a fit to all others     {one_by_one:.6}  {by_hundred:.6} (100 readings of each, as it does)"
    );
    println!(
        "  single readings, noise and all         {:.6}  {:.6}",
        of_readings(&found.correction),
        of_readings(&IMU_TK)
    );
    println!("  the same as imu_tk prints it                     {IMU_TK_READING_RMS:.6}");
    println!("  two halves of one rest differ by       {differ:.6}; white noise alone: {white:.6}");
    assert!(outcome.dwells.len() >= 37);
    assert!(checked < 1.3e-3 && one_by_one < 1.5e-3, "{checked} {one_by_one}");
    assert!(of_readings(&found.correction) < 1.03 * IMU_TK_READING_RMS);
    // Two solvers, the same triad.
    for (ours, theirs) in found.correction.bias.into_iter().zip(IMU_TK.bias) {
        assert!((ours - theirs).abs() < 1.0, "{ours} {theirs}");
    }
    for (ours, theirs) in found.correction.matrix.iter().flatten().zip(IMU_TK.matrix.iter().flatten()) {
        assert!((ours - theirs).abs() < 5e-4 * 0.0024, "{ours} {theirs}");
    }
}

/// Root mean square of the norm less gravity of every attitude's mean by a fit to the others, or to what was taken of them.
fn each_judged_by_the_others(means: &[[f64; 3]], taken: &[Attitude]) -> f64 {
    let squares = means.iter().enumerate().map(|(judged, mean)| {
        let others = taken.iter().enumerate().filter(|(i, _)| *i != judged);
        let mut entries: Vec<_> = others.map(|(_, attitude)| Entry { attitude: *attitude, role: Role::Fit }).collect();
        let correction = fit(&mut entries, GRAVITY).unwrap().correction;
        (correction.norm(*mean) - GRAVITY).powi(2)
    });
    (squares.sum::<f64>() / means.len() as f64).sqrt()
}

/// The readings of every rest, counts.
fn rests(path: &Path, dwells: &[Dwell]) -> Vec<Vec<[f64; 3]>> {
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    let rest = |[from_s, to_s]: [f64; 2]| {
        let rest = rows.iter().filter(|row| row[0] > from_s && row[0] <= to_s);
        rest.map(|row| [row[1], row[2], row[3]]).collect()
    };
    dwells.iter().filter_map(|dwell| dwell.t_s).map(rest).collect()
}

/// The hundred readings in the middle.
fn middle(rest: &[[f64; 3]]) -> &[[f64; 3]] {
    let start = (rest.len() / 2).saturating_sub(50);
    &rest[start..(start + 100).min(rest.len())]
}

/// By how much the mean norms of the two halves of a rest differ, rms over all rests; and what white noise with the scatter of
/// the readings would make of it.
fn halves(rests: &[Vec<[f64; 3]>], correction: &Correction) -> (f64, f64) {
    let (mut differ, mut white) = (0.0, 0.0);
    for rest in rests {
        let norms: Vec<_> = rest.iter().map(|reading| correction.norm(*reading)).collect();
        let mean = |norms: &[f64]| norms.iter().sum::<f64>() / norms.len() as f64;
        let (early, late) = norms.split_at(norms.len() / 2);
        differ += (mean(early) - mean(late)).powi(2);
        let middle = mean(&norms);
        let variance = norms.iter().map(|norm| (norm - middle).powi(2)).sum::<f64>() / norms.len() as f64;
        white += 4.0 * variance / norms.len() as f64;
    }
    let count = rests.len() as f64;
    ((differ / count).sqrt(), (white / count).sqrt())
}
