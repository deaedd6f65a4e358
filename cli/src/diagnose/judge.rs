//! Before and after: azimuths by the firmware's replay with the model, on runs that took no part in learning.

use north_finder::effects::{BaseMotion, ErrorModel};
use north_finder::event::Fix;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::data::RunData;
use super::learned::Learned;
use super::statistics::{chi_square_tail, rms};

/// Lags of the accelerometers that are tried, seconds.
const LAGS_S: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Share of the variance that a lag must leave at most to be believed.
const WORTH: f64 = 0.95;

/// What the parameters' uncertainty does to the azimuth, degrees: by a step of one sigma along each principal direction
/// of their covariance (its Cholesky factor's columns).
pub fn parameter_sigma_deg(run: &RunData, base: &ErrorModel, learned: &Learned, fix: &Fix) -> f64 {
    let nominal: Vec<f64> = learned.taken.iter().flat_map(|each| each.coefficients.clone()).collect();
    let factor = cholesky(&learned.covariance);
    let mut variance = 0.0;
    for direction in 0..nominal.len() {
        let moved: Vec<f64> = nominal.iter().zip(&factor).map(|(value, row)| value + row[direction]).collect();
        if let Ok(model) = learned.model_with(base, &moved)
            && let Some((moved, _)) = run.solve(&model)
        {
            variance += wrap_180_deg(moved.azimuth_deg - fix.azimuth_deg).powi(2);
        }
    }
    variance.sqrt()
}

/// Lower factor of a covariance; directions without variance are zero.
fn cholesky(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = matrix.len();
    let mut factor = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let left = matrix[i][j] - sum;
            factor[i][j] = if i == j {
                left.max(0.0).sqrt()
            } else if factor[j][j] > 0.0 {
                left / factor[j][j]
            } else {
                0.0
            };
        }
    }
    factor
}

/// Root mean square of n errors with its 95 % interval: n rms²/σ² is a chi-square of n degrees of freedom.
pub fn rms_with_interval(errors: &[f64]) -> Option<(f64, [f64; 2])> {
    let (number, found) = (errors.len() as f64, rms(errors));
    let at = |tail: f64| found * (number / chi_square_above(tail, number)).sqrt();
    (!errors.is_empty()).then(|| (found, [at(0.025), at(0.975)]))
}

/// The value that a chi-square exceeds with this probability, by bisection.
fn chi_square_above(tail: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 20.0 * freedom + 100.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if chi_square_tail(middle, freedom) > tail { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The stays of a run, the base's motion taken out, as cells of their own: what further effects are learned from.
pub fn stays_of(run: &RunData, model: &ErrorModel) -> Option<RunData> {
    let (fix, dwells) = run.solve(model)?;
    let mut stays = run.clone();
    stays.cells.clear();
    stays.channels.iter_mut().for_each(Vec::clear);
    let mut variance = 0.0;
    for (number, (end_s, dwell)) in dwells.iter().enumerate() {
        let inside: Vec<usize> = (0..run.cells.len())
            .filter(|&i| run.cells[i].t_s < *end_s && run.cells[i].t_s > end_s - dwell.seconds - 1e-6)
            .collect();
        let mean = |value: &dyn Fn(usize) -> f64| inside.iter().map(|&i| value(i)).sum::<f64>() / inside.len() as f64;
        let first = run.cells.get(*inside.first()?)?;
        let level = first.level.map(|_| north_finder::level::Specific {
            forward: mean(&|i| run.cells[i].level.map_or(0.0, |level| level.forward)),
            left: mean(&|i| run.cells[i].level.map_or(0.0, |level| level.left)),
        });
        variance += dwell.sigma_deg_h.powi(2) * dwell.seconds / dwells.len() as f64;
        stays.cells.push(super::data::Cell {
            t_s: mean(&|i| run.cells[i].t_s),
            seconds: dwell.seconds,
            raw_deg_h: dwell.rate_deg_h,
            cos: mean(&|i| run.cells[i].cos),
            sin: mean(&|i| run.cells[i].sin),
            temp_c: first.temp_c.map(|_| mean(&|i| run.cells[i].temp_c.unwrap_or(0.0))),
            level,
            moving: false,
            after_gap: false,
            stay: number,
            line: first.line,
        });
        for (channel, values) in stays.channels.iter_mut().zip(&run.channels) {
            channel.push(mean(&|i| values[i]));
        }
    }
    stays.noise_deg_h = Some(variance.sqrt());
    stays.before = Some(fix);
    Some(stays)
}

/// How the base's motion is taken out best: row by row, with the accelerometers' noise white in the velocity or in the tilt,
/// and with the lag by which gyro and tilt agree best, both by the variances of the dwells, in the geometric mean so that no
/// single dwell decides; or, `None`, as the solver does by itself, if the azimuths' sigmas are smaller so.
pub fn way_of_base_motion(runs: &[&RunData], base: &ErrorModel) -> Option<BaseMotion> {
    let solved = |run: &RunData, base_motion| run.solve(&ErrorModel { base_motion, ..base.clone() });
    let score = |way: BaseMotion| -> f64 {
        let of_run = |run: &&RunData| {
            let (_, dwells) = solved(run, Some(way))?;
            let logarithms: f64 = dwells.iter().map(|(_, dwell)| 2.0 * dwell.sigma_deg_h.ln()).sum();
            (!dwells.is_empty()).then_some(logarithms / dwells.len() as f64)
        };
        // A run without an azimuth is as good as one that may point anywhere.
        runs.par_iter().map(|run| of_run(run).unwrap_or(10.0)).sum::<f64>() / runs.len() as f64
    };
    let of = |velocity: bool, lag_s: f64| (BaseMotion { velocity, lag_s }, score(BaseMotion { velocity, lag_s }));
    let least = |ways: Vec<(BaseMotion, f64)>| ways.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let coarse = [false, true].into_iter().flat_map(|velocity| LAGS_S.map(|lag_s| of(velocity, lag_s))).collect();
    let (found, _) = least(coarse)?;
    let fine = (-4..=4).map(|i| of(found.velocity, found.lag_s + 0.1 * f64::from(i))).collect();
    let (lagged, best) = least(fine)?;
    // No lag unless it is worth something.
    let (plain, without) = of(lagged.velocity, 0.0);
    let found = if best < without + WORTH.ln() { lagged } else { plain };
    let promised = |way: Option<BaseMotion>| {
        let sigma = |run: &&RunData| solved(run, way).map_or(100.0, |(fix, _)| fix.sigma_deg);
        runs.par_iter().map(|run| sigma(run).powi(2)).sum::<f64>()
    };
    (promised(Some(found)) < promised(None)).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_of_an_rms_by_tables() {
        // χ² of 4 degrees of freedom: 0.4844 at 2.5 %, 11.143 at 97.5 %. Of 1: 0.000982 and 5.024.
        let (found, [low, high]) = rms_with_interval(&[2.0; 4]).unwrap();
        assert!((found - 2.0).abs() < 1e-12);
        assert!((low - 2.0 * (4.0f64 / 11.143).sqrt()).abs() < 1e-3, "{low}");
        assert!((high - 2.0 * (4.0f64 / 0.4844).sqrt()).abs() < 1e-2, "{high}");
        let (_, [low, high]) = rms_with_interval(&[1.0]).unwrap();
        assert!((low - 0.446).abs() < 1e-3 && (high - 31.9).abs() < 0.1, "{low} {high}");
        assert!(rms_with_interval(&[]).is_none());
    }
}
