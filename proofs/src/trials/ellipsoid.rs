//! Trials of the ellipsoid calibration, from readings to parameters.

use calibration::ellipsoid::attitude::Attitude;
use calibration::ellipsoid::{self, Entry, Role};
use hal_sim::triad::{Placement, drawn, even_directions, place_by_hand};
use north::calibrate::attitudes::granted_noise;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::bound::Truth;

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Attitudes, evenly spread and turned at random; a quarter of them is only judged.
    pub attitudes: usize,
    /// Readings in each.
    pub readings: u32,
}

impl Case {
    /// As the source has it: 10 readings in each of 23 attitudes.
    pub const NOMINAL: Self = Self { attitudes: 23, readings: 10 };
}

/// How a trial came out.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Errors of biases and of m11, m12, m13, m22, m23, m33.
    pub errors: [f64; 9],
    pub sigmas: [f64; 9],
    /// Cramér-Rao bounds for the attitudes that were learned from.
    pub bounds: [f64; 9],
    pub coverage: f64,
    /// Norm less 1, rms: before, and of the attitudes only judged after.
    pub norm_rms_before: f64,
    pub check_norm_rms: f64,
}

/// Names of the parameters in the order of a trial.
pub const NAMES: [&str; 9] = ["bx", "by", "bz", "m11", "m12", "m13", "m22", "m23", "m33"];

/// Runs a trial; `None` if the set was refused.
pub fn run(case: &Case, seed: u64, number: u64) -> Option<Trial> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let triad = drawn::accelerometers(&mut random);
    let placement = Placement {
        up: even_directions(case.attitudes, random.random()),
        rest_s: f64::from(case.readings),
        move_s: 0.0,
        rate_hz: 1.0,
        shake_g: 0.0,
        rest_shake_g: 0.0,
    };
    let readings: Vec<_> =
        place_by_hand(&triad, &placement, random.random()).iter().map(|reading| reading.raw).collect();
    let granted = granted_noise(readings.chunks(case.readings as usize));
    let entry = |readings: &[[f64; 3]]| {
        let attitude = Attitude::of(readings, granted, &mut vec![0.0; readings.len()])?;
        Some(Entry { attitude, role: Role::Fit })
    };
    let mut entries: Vec<_> = readings.chunks(case.readings as usize).map(entry).collect::<Option<_>>()?;
    ellipsoid::split(&mut entries, 1.0);
    let means = |role| {
        let entries = entries.iter().filter(move |entry: &&Entry| entry.role == role);
        entries.map(|entry| entry.attitude.mean).collect::<Vec<_>>()
    };
    let (learned, all) = (means(Role::Fit), entries.iter().map(|entry| entry.attitude.mean).collect::<Vec<_>>());
    let truth = Truth::of(&triad);
    let bounds = truth.bound(&learned, triad.noise / f64::from(case.readings).sqrt())?;
    let found = ellipsoid::fit(&mut entries, 1.0).ok()?;
    let values = Truth { bias: found.correction.bias, matrix: found.correction.matrix }.parameters();
    let sigmas = Truth { bias: found.sigma_bias, matrix: found.sigma_matrix }.parameters();
    let expected = truth.parameters();
    let mut errors = values;
    errors.iter_mut().zip(expected).for_each(|(value, expected)| *value -= expected);
    let nominal = ellipsoid::nominal(all.iter().copied(), 1.0);
    Some(Trial {
        errors,
        sigmas,
        bounds,
        coverage: found.coverage,
        norm_rms_before: ellipsoid::norm_rms(all.into_iter(), &nominal, 1.0)?,
        check_norm_rms: found.check_norm_rms?,
    })
}
