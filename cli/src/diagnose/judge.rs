//! Before and after: azimuths by the firmware's replay with the model, on runs that took no part in learning.

use north_finder::effects::{BaseMotion, ErrorModel};
use north_finder::fix::DesignRow;
use rayon::prelude::*;

use crate::run_data::{RunData, Sample};

/// Lags of the accelerometers that are tried, seconds.
const LAGS_S: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Share of the variance that a lag must leave at most to be believed.
const WORTH: f64 = 0.95;

/// The dwells of a run, the base's motion taken out, as samples of their own: what further effects are learned from.
pub fn dwells_of(run: &RunData, model: &ErrorModel) -> Option<RunData> {
    let (fix, dwells) = run.solve(model)?;
    let mut by_dwell = run.clone();
    by_dwell.samples.clear();
    by_dwell.channels.iter_mut().for_each(Vec::clear);
    let mut variance = 0.0;
    for (number, (end_s, dwell)) in dwells.iter().enumerate() {
        let until = |t_s: f64| run.samples.partition_point(|sample| sample.t_s < t_s);
        let inside = until(end_s - dwell.seconds - 1e-6)..until(*end_s);
        let number_of_samples = inside.len() as f64;
        let mean = |value: &dyn Fn(usize) -> f64| inside.clone().map(value).sum::<f64>() / number_of_samples;
        let first = run.samples[inside.clone()].first()?;
        let level = first.level.map(|_| north_finder::level::Specific {
            forward: mean(&|i| run.samples[i].level.map_or(0.0, |level| level.forward)),
            left: mean(&|i| run.samples[i].level.map_or(0.0, |level| level.left)),
        });
        variance += dwell.sigma_deg_h.powi(2) * dwell.seconds / dwells.len() as f64;
        by_dwell.samples.push(Sample {
            t_s: mean(&|i| run.samples[i].t_s),
            seconds: dwell.seconds,
            rate_deg_h: dwell.rate_deg_h,
            design: DesignRow {
                cos: mean(&|i| run.samples[i].design.cos),
                sin: mean(&|i| run.samples[i].design.sin),
                vertical_deg_h: mean(&|i| run.samples[i].design.vertical_deg_h),
            },
            cos: mean(&|i| run.samples[i].cos),
            sin: mean(&|i| run.samples[i].sin),
            temp_c: first.temp_c.map(|_| mean(&|i| run.samples[i].temp_c.unwrap_or(0.0))),
            level,
            moving: false,
            left_out: false,
            dwell: number,
            line: first.line,
        });
        for (channel, values) in by_dwell.channels.iter_mut().zip(&run.channels) {
            channel.push(mean(&|i| values[i]));
        }
    }
    by_dwell.noise_deg_h = Some(variance.sqrt());
    by_dwell.before = Some(fix);
    Some(by_dwell)
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
