//! What a calibration is worth: dead reckoning of a ship with a triad as it comes, and calibrated.

use hal_sim::triad::{GyroTriad, ShipVoyage, Table, TriadErrors, distance_nmi, drawn};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::navigation::Navigator;
use super::six_position::{Case, solve, visit_six};

/// Length of a navigation step, s.
const STEP_S: f64 = 0.5;

/// Largest distances from the truth during a voyage, nautical miles.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    pub uncalibrated_nmi: f64,
    pub published_nmi: f64,
    pub solved_nmi: f64,
    /// Least squares, the gyros without noise on the table: what the table's angles leave.
    pub table_nmi: f64,
    /// With the true parameters: what no calibration takes out.
    pub perfect_nmi: f64,
}

/// True rate = inverse · (output − bias).
struct Inverse {
    bias_deg_h: [f64; 3],
    inverse: [[f64; 3]; 3],
}

/// Calibrates a random triad on the table and then sails with it; `None` if the calibration was refused.
pub fn run(latitude_deg: f64, hours: f64, seed: u64, number: u64) -> Option<Trial> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let errors = drawn::gyros_of_a_ship(&mut random);
    let case = Case {
        latitude_deg,
        arw_deg_per_sqrt_h: errors.arw_deg_per_sqrt_h,
        bias_instability_deg_h: errors.bias_instability_deg_h,
        ..Case::NOMINAL
    };
    let mut on_table = |errors: &TriadErrors| {
        let mut table = Table::new(latitude_deg, errors, random.random());
        solve(&visit_six(&mut table, &case, &mut random)?, &case)
    };
    let (solved, published) = on_table(&errors)?;
    let quiet = TriadErrors { arw_deg_per_sqrt_h: 0.0, bias_instability_deg_h: 0.0, ..errors.clone() };
    let (by_table, _) = on_table(&quiet)?;
    let mut triad = GyroTriad::new(&errors, random.random());
    let calibrations = [
        Inverse::UNIT,
        Inverse::new(published.bias_deg_h, published.matrix),
        Inverse::new(solved.bias_deg_h, solved.matrix),
        Inverse::new(by_table.bias_deg_h, by_table.matrix),
        Inverse::new(errors.bias_deg_h, triad.matrix()),
    ];
    let course_deg = random.random_range(0.0..360.0);
    let voyage = ShipVoyage { start_deg: [latitude_deg, 0.0], course_deg, knots: 10.0 };
    let (position_m, velocity_m_s, attitude) = voyage.start();
    let mut navigators = [Navigator::new(position_m, velocity_m_s, attitude); 5];
    let mut greatest_nmi = [0.0; 5];
    for step in voyage.steps(STEP_S, hours) {
        let arcsec = triad.measure(step.turned_arcsec, STEP_S);
        for ((navigator, calibration), greatest) in navigators.iter_mut().zip(&calibrations).zip(&mut greatest_nmi) {
            navigator.step(calibration.apply(arcsec, STEP_S), step.velocity_m_s, STEP_S);
            *greatest = f64::max(*greatest, distance_nmi(navigator.position_m, step.position_m));
        }
    }
    let [uncalibrated_nmi, published_nmi, solved_nmi, table_nmi, perfect_nmi] = greatest_nmi;
    Some(Trial { uncalibrated_nmi, published_nmi, solved_nmi, table_nmi, perfect_nmi })
}

impl Inverse {
    const UNIT: Self = Self { bias_deg_h: [0.0; 3], inverse: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    fn new(bias_deg_h: [f64; 3], matrix: [[f64; 3]; 3]) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = matrix;
        let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
        let adjugate = [
            [e * i - f * h, c * h - b * i, b * f - c * e],
            [f * g - d * i, a * i - c * g, c * d - a * f],
            [d * h - e * g, b * g - a * h, a * e - b * d],
        ];
        Self { bias_deg_h, inverse: adjugate.map(|row| row.map(|part| part / determinant)) }
    }

    fn apply(&self, arcsec: [f64; 3], dt_s: f64) -> [f64; 3] {
        let [x, y, z] = [0, 1, 2].map(|axis| arcsec[axis] - self.bias_deg_h[axis] * dt_s);
        self.inverse.map(|[a, b, c]| a * x + b * y + c * z)
    }
}
