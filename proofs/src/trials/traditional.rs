//! The traditional calibration of a gyro triad, for comparison: a rate test for the responses, then a zero test for the biases.

use calibration::six_position::axes::Axes;
use calibration::six_position::dwell::Dwell;
use hal_sim::triad::{SIX_POSITIONS, Spin, Table, Visit};
use north_finder::earth::earth_rate;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::six_position::{Case, Parameters};

const ARCSEC_PER_RAD: f64 = 3600.0 * 180.0 / std::f64::consts::PI;

/// A rate of the rate test, run in both directions.
struct Rate {
    deg_s: f64,
    /// The table's rate is good to ± this part of itself.
    accuracy: f64,
    turns: u32,
}

/// One rate below 1 °/s, one below 10 °/s and two above: the accuracies are those of the source's table.
const RATES: [Rate; 4] = [
    Rate { deg_s: 0.5, accuracy: 1e-3, turns: 1 },
    Rate { deg_s: 5.0, accuracy: 1e-4, turns: 1 },
    Rate { deg_s: 20.0, accuracy: 1e-5, turns: 2 },
    Rate { deg_s: 100.0, accuracy: 1e-5, turns: 10 },
];

/// Angles of the table (inner, middle, outer) with x, y, z up, degrees.
const UP_DEG: [[f64; 3]; 3] = [[270.0, 0.0, 0.0], [0.0, 90.0, 0.0], [0.0, 0.0, 0.0]];

/// Rate test and zero test; the zero test takes as long as the six positions together.
///
/// Responses: half the difference of both directions over twice the rate, so that bias and Earth rate drop out; the rates
/// weighted by their accuracies. Biases: the mean output in the first position (east, north, up) less what the responses
/// make of the Earth rate there. Standard deviations: the table's rate (uniform) for the scale factors, its angles (uniform)
/// for the misalignments; for the biases noise, angles, responses and the declared instability.
pub fn calibrate(table: &mut Table, case: &Case, random: &mut ChaCha8Rng) -> Option<Parameters> {
    let mut matrix = [[0.0; 3]; 3];
    for (axis, angles_deg) in UP_DEG.into_iter().enumerate() {
        table.set_error(case.angle_errors_arcsec(random));
        let mut weights = 0.0;
        for rate in &RATES {
            let mut spin = |rate_deg_s: f64| {
                let rate_error = random.random_range(-rate.accuracy..rate.accuracy);
                table.spin(&Spin { angles_deg, rate_deg_s, rate_error, turns: rate.turns })
            };
            let (ahead, back) = (spin(rate.deg_s), spin(-rate.deg_s));
            let weight = rate.accuracy.powi(-2);
            weights += weight;
            for (row, (ahead, back)) in matrix.iter_mut().zip(ahead.into_iter().zip(back)) {
                row[axis] += weight * (ahead - back) / (2.0 * 3600.0 * rate.deg_s);
            }
        }
        matrix.iter_mut().for_each(|row| row[axis] /= weights);
    }
    // Uniform in ± a: variance a²/3; two directions halve it.
    let precision: f64 = RATES.iter().map(|rate| 6.0 / rate.accuracy.powi(2)).sum();
    let angle = case.table_arcsec / ARCSEC_PER_RAD / 3.0_f64.sqrt();
    let mut sigma_matrix = [[angle; 3]; 3];
    (0..3).for_each(|axis| sigma_matrix[axis][axis] = precision.recip().sqrt());

    let [position, ..] = SIX_POSITIONS;
    table.set_error(case.angle_errors_arcsec(random));
    let rows = table.visit(&Visit::at_rest(position.angles_deg, SIX_POSITIONS.len() as f64 * case.dwell_s));
    let rates: Vec<_> = rows.iter().map(|row| row.arcsec).collect();
    let dwell = Dwell::of(&rates, 1.0, &mut vec![0.0; rates.len()]).ok()?;
    let input_deg_h = Axes::parse(position.axes).ok()?.input_deg_h(&earth_rate(case.latitude_deg).ok()?);
    let squared: f64 = input_deg_h.iter().map(|rate| rate * rate).sum();
    let (mut bias_deg_h, mut sigma_bias_deg_h) = ([0.0; 3], [0.0; 3]);
    for axis in 0..3 {
        let felt: f64 = matrix[axis].iter().zip(input_deg_h).map(|(response, rate)| response * rate).sum();
        bias_deg_h[axis] = dwell.rate_deg_h[axis] - felt;
        let by_responses: f64 =
            sigma_matrix[axis].iter().zip(input_deg_h).map(|(sigma, rate)| (sigma * rate).powi(2)).sum();
        let by_angles = angle * angle * (squared - input_deg_h[axis].powi(2));
        sigma_bias_deg_h[axis] =
            (dwell.variance[axis] + by_angles + by_responses + case.bias_instability_deg_h.powi(2)).sqrt();
    }
    Some(Parameters { bias_deg_h, matrix, sigma_bias_deg_h, sigma_matrix })
}

#[cfg(test)]
mod tests {
    use hal_sim::triad::TriadErrors;
    use rand::SeedableRng;

    use super::*;

    const CASE: Case = Case { table_arcsec: 0.0, arw_deg_per_sqrt_h: 1e-9, ..Case::NOMINAL };

    fn calibrated(errors: &TriadErrors, case: &Case) -> Parameters {
        let mut table = Table::new(case.latitude_deg, errors, 1);
        calibrate(&mut table, case, &mut ChaCha8Rng::seed_from_u64(1)).unwrap()
    }

    #[test]
    fn a_triad_made_by_hand_is_found() {
        // Scale of x 1000 ppm high: its response to x is 1.001, and no other changes. y tilted by 206.265″ towards z: it
        // feels 0.001 of a rotation about z. Biases as they are. The rates leave 1e-5/√(6 + 6) = 2.9 ppm, one sigma.
        let errors = TriadErrors {
            bias_deg_h: [0.3, -0.2, 0.1],
            scale_ppm: [1000.0, 0.0, 0.0],
            tilt_arcsec: [[0.0; 2], [0.0, 206.265], [0.0; 2]],
            arw_deg_per_sqrt_h: 1e-9,
            ..TriadErrors::default()
        };
        let found = calibrated(&errors, &CASE);
        let expected = [[1.001, 0.0, 0.0], [0.0, 1.0, 0.001], [0.0, 0.0, 1.0]];
        for (found, expected) in found.matrix.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 4.0 * 2.9e-6, "{found} {expected}");
        }
        for (found, expected) in found.bias_deg_h.iter().zip(errors.bias_deg_h) {
            // 15 °/h times what the scale factors are off.
            assert!((found - expected).abs() < 15.0 * 4.0 * 2.9e-6, "{found} {expected}");
        }
        assert!((found.sigma_matrix[0][0] - 2.9e-6).abs() < 0.1e-6, "{:?}", found.sigma_matrix);
    }

    #[test]
    fn the_tables_angles_become_misalignments() {
        // ±3′ is 873 ppm, uniform: 504 ppm, one sigma; over 40 triads the rms of the six misalignments (y's gimbal cannot
        // tilt it towards x, see UP_DEG: five of six feel an angle) is 504 · √(5/6) = 460 ppm, known to about a tenth.
        let case = Case { table_arcsec: 180.0, ..CASE };
        let errors = TriadErrors { arw_deg_per_sqrt_h: 1e-9, ..TriadErrors::default() };
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut squares = 0.0;
        for seed in 0..40 {
            let found = calibrate(&mut Table::new(case.latitude_deg, &errors, seed), &case, &mut random).unwrap();
            let off = |row: usize, column: usize| if row == column { 0.0 } else { found.matrix[row][column] };
            squares += (0..9).map(|i| off(i / 3, i % 3).powi(2)).sum::<f64>();
            assert!((found.sigma_matrix[0][1] - 504e-6).abs() < 1e-6);
        }
        let rms_ppm = 1e6 * (squares / 240.0).sqrt();
        assert!((rms_ppm / 460.0 - 1.0).abs() < 0.3, "{rms_ppm}");
    }
}
