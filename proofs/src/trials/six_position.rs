//! Trials of the six-position calibration, from the rows of the table to the parameters.

use calibration::six_position::axes::Axes;
use calibration::six_position::dwell::Dwell;
use calibration::six_position::published::Published;
use calibration::six_position::{self, Calibration, Knowledge, Position};
use hal_sim::triad::{SIX_POSITIONS, Table, TriadErrors, Visit, drawn};
use north::calibrate::six_position::by_formulas;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    pub latitude_deg: f64,
    /// Time in each position, s, in rows of one second.
    pub dwell_s: f64,
    pub arw_deg_per_sqrt_h: f64,
    /// Bias instability; declared.
    pub bias_instability_deg_h: f64,
    /// Every angle of the table is off by up to ± this in every position, arcsec; declared.
    pub table_arcsec: f64,
}

impl Case {
    /// As the source has it: ten minutes in each position, a table good to ±3″.
    pub const NOMINAL: Self = Self {
        latitude_deg: 34.75,
        dwell_s: 600.0,
        arw_deg_per_sqrt_h: 0.0015,
        bias_instability_deg_h: 0.0,
        table_arcsec: 3.0,
    };

    /// Errors of the table's three angles in one position.
    pub fn angle_errors_arcsec(&self, random: &mut ChaCha8Rng) -> [f64; 3] {
        let off = self.table_arcsec;
        [(); 3].map(|()| if off > 0.0 { random.random_range(-off..off) } else { 0.0 })
    }
}

impl Parameters {
    /// Without standard deviations.
    pub fn exact(bias_deg_h: [f64; 3], matrix: [[f64; 3]; 3]) -> Self {
        Self { bias_deg_h, matrix, sigma_bias_deg_h: [f64::NAN; 3], sigma_matrix: [[f64::NAN; 3]; 3] }
    }

    /// Biases, °/h, and then the matrix, rows; in the order of [`NAMES`].
    pub fn flat(&self) -> [f64; 12] {
        flat(self.bias_deg_h, self.matrix)
    }

    /// Their standard deviations.
    pub fn sigmas(&self) -> [f64; 12] {
        flat(self.sigma_bias_deg_h, self.sigma_matrix)
    }
}

impl From<Calibration> for Parameters {
    fn from(solved: Calibration) -> Self {
        let Calibration { bias_deg_h, matrix, sigma_bias_deg_h, sigma_matrix, .. } = solved;
        Self { bias_deg_h, matrix, sigma_bias_deg_h, sigma_matrix }
    }
}

impl From<Published> for Parameters {
    fn from(published: Published) -> Self {
        Self::exact(published.bias_deg_h, published.matrix)
    }
}

/// Parameters of a triad, whatever method they come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    pub bias_deg_h: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    /// Not a number where the method gives none.
    pub sigma_bias_deg_h: [f64; 3],
    pub sigma_matrix: [[f64; 3]; 3],
}

/// How a trial came out.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Biases, °/h, and then the matrix, rows.
    pub truth: [f64; 12],
    pub solved: [f64; 12],
    pub sigmas: [f64; 12],
    pub published: [f64; 12],
}

/// Names of the parameters in the order of a trial.
pub const NAMES: [&str; 12] = ["x0", "y0", "z0", "A1", "A2", "A3", "B1", "B2", "B3", "C1", "C2", "C3"];

/// Runs a trial; `None` if the set was refused.
pub fn run(case: &Case, seed: u64, number: u64) -> Option<Trial> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let errors = TriadErrors {
        arw_deg_per_sqrt_h: case.arw_deg_per_sqrt_h,
        bias_instability_deg_h: case.bias_instability_deg_h,
        ..drawn::gyros(&mut random)
    };
    let mut table = Table::new(case.latitude_deg, &errors, random.random());
    let positions = visit_six(&mut table, case, &mut random)?;
    let (solved, published) = solve(&positions, case)?;
    Some(Trial {
        truth: flat(errors.bias_deg_h, table.triad().matrix()),
        solved: flat(solved.bias_deg_h, solved.matrix),
        sigmas: flat(solved.sigma_bias_deg_h, solved.sigma_matrix),
        published: flat(published.bias_deg_h, published.matrix),
    })
}

/// Visits the six positions, the table's errors drawn anew for each.
pub fn visit_six(table: &mut Table, case: &Case, random: &mut ChaCha8Rng) -> Option<Vec<Position>> {
    let visit = |position: hal_sim::triad::PositionOfTable| {
        table.set_error(case.angle_errors_arcsec(random));
        let rows = table.visit(&Visit::at_rest(position.angles_deg, case.dwell_s));
        let rates: Vec<_> = rows.iter().map(|row| row.arcsec).collect();
        let dwell = Dwell::of(&rates, 1.0, &mut vec![0.0; rates.len()]).ok()?;
        Some(Position { axes: Axes::parse(position.axes).ok()?, dwell })
    };
    SIX_POSITIONS.into_iter().map(visit).collect()
}

/// Least squares and differences.
pub fn solve(positions: &[Position], case: &Case) -> Option<(Calibration, Published)> {
    let knowledge = Knowledge {
        latitude_deg: case.latitude_deg,
        table_arcsec: case.table_arcsec,
        bias_instability_deg_h: case.bias_instability_deg_h,
    };
    let solved = six_position::solve(positions, &knowledge).ok()?;
    Some((solved, by_formulas(positions, case.latitude_deg)?))
}

fn flat(bias: [f64; 3], matrix: [[f64; 3]; 3]) -> [f64; 12] {
    let mut all = [0.0; 12];
    for (place, value) in all.iter_mut().zip(bias.into_iter().chain(matrix.into_iter().flatten())) {
        *place = value;
    }
    all
}
