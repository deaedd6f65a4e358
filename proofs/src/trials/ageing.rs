//! Trials of the source's experiment with the ellipsoid: a turntable, a month of ageing, the field, the turntable again.

use calibration::ellipsoid::attitude::Attitude;
use calibration::ellipsoid::{self, Correction, Entry, Misalignments, Role};
use calibration::known_attitudes::{self, Attitudes, Position};
use hal_sim::triad::{AccelerometerTriad, Placement, drawn, even_directions, place_by_hand};
use north::calibrate::attitudes::granted_noise;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Attitudes in the field, and readings in every attitude; as the source has them.
const ATTITUDES: usize = 23;
const READINGS: usize = 10;
/// How often the turntable visits each of the six faces.
const VISITS: usize = 2;
/// Ageing in 30 days, standard deviations: biases, g, and scale factors, parts of one.
const AGED_BIAS_G: f64 = 0.01;
const AGED_SCALE: f64 = 0.002;

/// The calibrations that are compared, in the order of a trial.
pub const CALIBRATIONS: [&str; 5] = [
    "turntable on day 0",
    "field, with the misalignments of day 0",
    "field, misalignments ignored",
    "field, all nine parameters",
    "turntable on day 30",
];

/// What a calibration is off by on day 30.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    pub bias_g: [f64; 3],
    /// Parts of one.
    pub scale: [f64; 3],
    /// Specific force that it makes of the triad at rest with the sensor z up, less (0, 0, 1).
    pub z_up_g: [f64; 3],
}

/// One triad; `None` if a calibration was refused.
pub fn run(seed: u64, number: u64) -> Option<[Errors; CALIBRATIONS.len()]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let new = drawn::accelerometers(&mut random);
    let (day_0, sigma_matrix) = turntable(&new, &mut random)?;
    let mut gaussian = || -> f64 { StandardNormal.sample(&mut random) };
    let aged = AccelerometerTriad {
        zero: new.zero.map(|zero| zero + AGED_BIAS_G * gaussian()),
        per_g: new.per_g.map(|per_g| per_g * (1.0 + AGED_SCALE * gaussian())),
        ..new
    };
    let up = even_directions(ATTITUDES, random.random());
    let entries: Vec<_> =
        attitudes(&aged, up, &mut random)?.into_iter().map(|attitude| Entry { attitude, role: Role::Fit }).collect();
    let old = Misalignments::of(&day_0, &sigma_matrix)?;
    let field =
        |prior: Option<&Misalignments>| Some(ellipsoid::fit_with(&mut entries.clone(), 1.0, prior).ok()?.correction);
    let (day_30, _) = turntable(&aged, &mut random)?;
    let (bias, matrix) = aged.correction();
    let truth = Correction { bias, matrix };
    let found = [day_0, field(Some(&old))?, field(Some(&Misalignments::NONE))?, field(None)?, day_30];
    let mut errors = Vec::with_capacity(found.len());
    for correction in found {
        errors.push(Errors::of(&correction.of_sensors()?, &truth));
    }
    errors.try_into().ok()
}

impl Errors {
    fn of(found: &Correction, truth: &Correction) -> Self {
        // Undone from below: what the triad reads at rest with its z up.
        let [[m11, m12, m13], [_, m22, m23], [_, _, m33]] = truth.matrix;
        let z = 1.0 / m33;
        let y = -m23 * z / m22;
        let x = -(m12 * y + m13 * z) / m11;
        let [bx, by, bz] = truth.bias;
        let [fx, fy, fz] = found.apply([bx + x, by + y, bz + z]);
        let (scales, true_scales) = (found.scale_factors(), truth.scale_factors());
        Self {
            bias_g: [0, 1, 2].map(|axis| found.bias[axis] - truth.bias[axis]),
            scale: [0, 1, 2].map(|axis| scales[axis] / true_scales[axis] - 1.0),
            z_up_g: [fx, fy, fz - 1.0],
        }
    }
}

/// Ten readings in every attitude, boiled down.
fn attitudes(triad: &AccelerometerTriad, up: Vec<[f64; 3]>, random: &mut ChaCha8Rng) -> Option<Vec<Attitude>> {
    let placement =
        Placement { up, rest_s: READINGS as f64, move_s: 0.0, rate_hz: 1.0, shake_g: 0.0, rest_shake_g: 0.0 };
    let readings = place_by_hand(triad, &placement, random.random());
    let readings: Vec<_> = readings.iter().map(|reading| reading.raw).collect();
    let granted = granted_noise(readings.chunks(READINGS));
    readings.chunks(READINGS).map(|each| Attitude::of(each, granted, &mut vec![0.0; each.len()])).collect()
}

/// The calibration of a turntable, and the standard deviations of its matrix.
fn turntable(triad: &AccelerometerTriad, random: &mut ChaCha8Rng) -> Option<(Correction, [[f64; 3]; 3])> {
    let mut up = Vec::new();
    for axis in 0..3 {
        for way in [1.0, -1.0] {
            let mut face = [0.0; 3];
            face[axis] = way;
            up.extend([face; VISITS]);
        }
    }
    let attitudes = attitudes(triad, up.clone(), random)?;
    let positions: Vec<_> = up.into_iter().zip(attitudes).map(|(up, attitude)| Position { up, attitude }).collect();
    known_attitudes::solve(&positions, 1.0, Attitudes::Square { arcsec: 0.0 }).ok()?.correction()
}
