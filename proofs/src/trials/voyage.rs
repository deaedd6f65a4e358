//! What a calibration is worth: one recorded voyage of a ship, navigated with every calibration of its triad.

use hal_sim::triad::{GyroTriad, ShipVoyage, Table, distance_nmi, drawn};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::navigation::Navigator;
use super::six_position::{Case, Parameters, solve, visit_six};
use super::traditional;

/// Length of a navigation step, s.
const STEP_S: f64 = 0.5;
/// Steps from one error that is kept to the next: ten minutes.
const STEPS_KEPT: u64 = 1200;

/// Accuracy of the angles of the tables that the triad is calibrated on, ± arcsec: what is meant for the source's class, and
/// what it prints (3′).
pub const TABLES_ARCSEC: [f64; 2] = [3.0, 180.0];
/// Calibrations on each table, in the order of a trial.
pub const METHODS: [&str; 3] = ["traditional", "six positions, differences", "six positions, least squares"];

/// A triad with its calibrations, and its voyage.
#[derive(Clone, Debug)]
pub struct Trial {
    pub truth: Parameters,
    /// By table and method.
    pub calibrations: [[Parameters; METHODS.len()]; TABLES_ARCSEC.len()],
    /// Navigated with no calibration, with each of each table, and with the true parameters.
    pub navigated: Vec<Navigated>,
}

/// Distances from the truth with one calibration, nautical miles.
#[derive(Clone, Debug, Default)]
pub struct Navigated {
    pub greatest_nmi: f64,
    /// Every ten minutes.
    pub errors_nmi: Vec<f64>,
}

/// True rate = inverse · (output − bias).
struct Inverse {
    bias_deg_h: [f64; 3],
    inverse: [[f64; 3]; 3],
}

/// Calibrates a random triad on the tables and then sails with it; `None` if a calibration was refused.
pub fn run(latitude_deg: f64, hours: f64, seed: u64, number: u64) -> Option<Trial> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let errors = drawn::gyros_of_a_ship(&mut random);
    let mut on_table = |table_arcsec| {
        let case = Case {
            latitude_deg,
            arw_deg_per_sqrt_h: errors.arw_deg_per_sqrt_h,
            bias_instability_deg_h: errors.bias_instability_deg_h,
            table_arcsec,
            ..Case::NOMINAL
        };
        let mut table = Table::new(latitude_deg, &errors, random.random());
        let traditional = traditional::calibrate(&mut table, &case, &mut random)?;
        let mut table = Table::new(latitude_deg, &errors, random.random());
        let (solved, published) = solve(&visit_six(&mut table, &case, &mut random)?, &case)?;
        Some([traditional, published.into(), solved.into()])
    };
    let [fine, coarse] = TABLES_ARCSEC;
    let calibrations = [on_table(fine)?, on_table(coarse)?];
    let mut triad = GyroTriad::new(&errors, random.random());
    let truth = Parameters::exact(errors.bias_deg_h, triad.matrix());
    let course_deg = random.random_range(0.0..360.0);
    let voyage = ShipVoyage { start_deg: [latitude_deg, 0.0], course_deg, knots: 10.0 };
    let (position_m, velocity_m_s, attitude) = voyage.start();
    let start = Navigator::new(position_m, velocity_m_s, attitude);
    let used = calibrations.as_flattened().iter().chain([&truth]);
    let inverses = std::iter::once(Inverse::UNIT).chain(used.map(Inverse::new));
    let mut navigators: Vec<_> = inverses.map(|inverse| (inverse, start, Navigated::default())).collect();
    for (number, step) in (1..).zip(voyage.steps(STEP_S, hours)) {
        let arcsec = triad.measure(step.turned_arcsec, STEP_S);
        for (calibration, navigator, navigated) in &mut navigators {
            navigator.step(calibration.apply(arcsec, STEP_S), step.velocity_m_s, STEP_S);
            let error_nmi = distance_nmi(navigator.position_m, step.position_m);
            navigated.greatest_nmi = navigated.greatest_nmi.max(error_nmi);
            if number % STEPS_KEPT == 0 {
                navigated.errors_nmi.push(error_nmi);
            }
        }
    }
    let navigated = navigators.into_iter().map(|(_, _, navigated)| navigated).collect();
    Some(Trial { truth, calibrations, navigated })
}

/// Hours of the error with an index.
pub fn hours(index: usize) -> f64 {
    (index + 1) as f64 * STEPS_KEPT as f64 * STEP_S / 3600.0
}

impl Inverse {
    const UNIT: Self = Self { bias_deg_h: [0.0; 3], inverse: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    fn new(of: &Parameters) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = of.matrix;
        let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
        let adjugate = [
            [e * i - f * h, c * h - b * i, b * f - c * e],
            [f * g - d * i, a * i - c * g, c * d - a * f],
            [d * h - e * g, b * g - a * h, a * e - b * d],
        ];
        Self { bias_deg_h: of.bias_deg_h, inverse: adjugate.map(|row| row.map(|part| part / determinant)) }
    }

    fn apply(&self, arcsec: [f64; 3], dt_s: f64) -> [f64; 3] {
        let [x, y, z] = [0, 1, 2].map(|axis| arcsec[axis] - self.bias_deg_h[axis] * dt_s);
        self.inverse.map(|[a, b, c]| a * x + b * y + c * z)
    }
}
