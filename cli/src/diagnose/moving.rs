//! A base that moves: how the accelerometers show it, how it is taken out best, and the dwells that are free of it.

use north_finder::effects::{BaseMotion, ErrorModel};
use north_finder::fix::DesignRow;
use north_finder::units::ARCSEC_PER_RAD;
use rayon::prelude::*;

use crate::learn::{self, Run};
use crate::run_data::{RunData, Sample};

/// Windows of the accelerometers' slopes, seconds.
const WINDOWS_S: [f64; 4] = [2.0, 8.0, 30.0, 80.0];
/// A base that stands still is said to move in at most this share of campaigns (Markov's inequality, as for an effect).
const FALSE_MOTIONS: f64 = 1.0 / 200.0;
/// Lags of the accelerometers that are tried, seconds.
const LAGS_S: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Share of the variance that a lag must leave at most to be believed.
const WORTH: f64 = 0.95;

/// The base's motion in some runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Window of the slopes that shows it best, seconds.
    pub window_s: f64,
    /// What the gyro feels of the turning that the accelerometers show, 1 for a rigid base; and its sigma.
    pub gain: f64,
    pub gain_sigma: f64,
    /// Log odds of a moving base over one that stands still, nats.
    pub log_odds: f64,
    /// How it is taken out; `None`: as the solver does by itself.
    pub way: Option<BaseMotion>,
}

impl Motion {
    /// Whether the rates of these runs (as the search sees them: `of_search`) show that the base moves.
    pub fn find(runs: &[&RunData], of_search: &[Run], base: &ErrorModel) -> Option<Self> {
        if !of_search.iter().all(Run::has_level) {
            return None;
        }
        let shown = |window_s: f64| {
            let of_run = |run: &Run| {
                let data = runs.iter().find(|data| data.file == run.file)?;
                Some(run.by_row(&turning_deg_h(data, window_s)))
            };
            let column: Option<Vec<Vec<f64>>> = of_search.iter().map(of_run).collect();
            let found = learn::gain_of(of_search, column?.concat())?;
            Some((window_s, found))
        };
        let best = WINDOWS_S.into_par_iter().filter_map(shown).max_by(|a, b| a.1.log_odds.total_cmp(&b.1.log_odds))?;
        let log_odds = best.1.log_odds - (WINDOWS_S.len() as f64).ln();
        (log_odds > -FALSE_MOTIONS.ln()).then(|| Self {
            window_s: best.0,
            gain: best.1.weight,
            gain_sigma: best.1.sigma,
            log_odds,
            way: way(runs, base),
        })
    }

    /// The model with it.
    pub fn model(&self, base: &ErrorModel) -> ErrorModel {
        ErrorModel { base_motion: self.way.or(base.base_motion), ..base.clone() }
    }
}

/// Turning of the base about the sensitive axis by the accelerometers, °/h: slopes of pitch and roll over `window_s` about
/// each sample, inside its dwell.
fn turning_deg_h(run: &RunData, window_s: f64) -> Vec<f64> {
    let samples = &run.samples;
    let slope = |i: usize| {
        let here = &samples[i];
        let near = |j: &usize| {
            let sample = &samples[*j];
            sample.dwell == here.dwell && !sample.moving && (sample.t_s - here.t_s).abs() <= 0.5 * window_s + 0.01
        };
        let first = (0..i).rev().take_while(near).last().unwrap_or(i);
        let last = (i..samples.len()).take_while(near).last().unwrap_or(i);
        let inside = samples.get(first..=last)?;
        let mean_s = inside.iter().map(|sample| sample.t_s).sum::<f64>() / inside.len() as f64;
        let (mut along, mut squares) = (0.0, 0.0);
        for sample in inside {
            let level = sample.level?;
            let t_s = sample.t_s - mean_s;
            along += t_s * (here.cos * level.left - here.sin * level.forward);
            squares += t_s * t_s;
        }
        (squares > 0.0).then(|| along / squares * ARCSEC_PER_RAD)
    };
    (0..samples.len()).map(|i| if samples[i].moving { 0.0 } else { slope(i).unwrap_or(0.0) }).collect()
}

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
        let level = first.level.map(|_| north_finder::sensing::level::Specific {
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
fn way(runs: &[&RunData], base: &ErrorModel) -> Option<BaseMotion> {
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
