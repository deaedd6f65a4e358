//! A base that moves: how the accelerometers show it, how it is taken out best, and the dwells that are free of it. And one that stands while the
//! accelerometers show that it moves.

use std::ops::Range;

use learn::Run;
use north_finder::effects::{BaseMotion, ErrorModel};
use north_finder::event::{Dwell, Fix};
use north_finder::fix::accumulator::Dwells as _;
use north_finder::fix::{DesignRow, base_motion};
use north_finder::sensing::level::Specific;
use north_finder::units::ARCSEC_PER_RAD;
use rayon::prelude::*;

use crate::run_data::{RunData, Sample};
use crate::solve::AllDwells;

/// Windows of the accelerometers' slopes, seconds.
const WINDOWS_S: [f64; 4] = [2.0, 8.0, 30.0, 80.0];
/// Window over which gyro and accelerometers are compared, seconds. Accelerometers at an arm r from the axis of rocking read φ − (r/g) φ″: at a period of
/// 2 s and 0.75 m (the published recording of a parked vehicle, by its cross spectrum) their tilt is 1.7 times the true one, at 12 s 1.02 times.
const GAIN_WINDOW_S: f64 = 12.0;
/// A base that stands still is said to move in at most this share of campaigns (Markov's inequality, as for an effect).
const FALSE_MOTIONS: f64 = 1.0 / 200.0;
/// A gyro on a rigid base feels all of the turning that its accelerometers show; where noise makes up half of what they show, half of it. Of what is felt
/// to less than this share the base does not turn: the level drifts. Nor does it where twice as much is felt, or the other way round: another effect
/// looks a little like the tilt.
const GAIN_RANGE: [f64; 2] = [0.2, 2.0];
/// Lags of the accelerometers that are tried, seconds.
const LAGS_S: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Share of the variance that a lag must leave at most to be believed.
const MOST_VARIANCE_RATIO: f64 = 0.95;

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
            Some(column?.concat())
        };
        let columns: Option<Vec<Vec<f64>>> = WINDOWS_S.into_par_iter().map(shown).collect();
        let found = WINDOWS_S.into_iter().zip(learn::gains_of(of_search, columns?)?);
        let found = found.filter_map(|(window_s, worth)| Some((window_s, worth?)));
        let best = found.max_by(|a, b| a.1.log_odds.total_cmp(&b.1.log_odds))?;
        let log_odds = best.1.log_odds - (WINDOWS_S.len() as f64).ln();
        let (weight, doubt) = (best.1.weight, 3.0 * best.1.sigma);
        let is_felt = weight + doubt >= GAIN_RANGE[0] && weight - doubt <= GAIN_RANGE[1];
        if log_odds <= -FALSE_MOTIONS.ln() || !is_felt {
            return None;
        }
        let (gain, gain_sigma) = gain(runs).unwrap_or((best.1.weight, best.1.sigma));
        // What shows best in the slopes of whole dwells is slow, and the solver takes it out.
        let is_slow = best.0 >= WINDOWS_S[WINDOWS_S.len() - 1];
        let way = if is_slow { None } else { way(runs, base) };
        Some(Self { window_s: best.0, gain, gain_sigma, log_odds, way })
    }

    /// The model with it.
    pub fn model(&self, base: &ErrorModel) -> ErrorModel {
        ErrorModel { base_motion: self.way.or(base.base_motion), ..base.clone() }
    }
}

/// Level accelerometers that change while the base stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelDrift {
    /// Greatest range of a level in a run, arcsec.
    pub range_arcsec: f64,
    /// Log odds of a base that stands over one that moves as the accelerometers show it, nats.
    pub log_odds: f64,
}

impl LevelDrift {
    /// The model with it.
    pub fn model(&self, base: &ErrorModel) -> ErrorModel {
        ErrorModel { level_drift_arcsec: self.range_arcsec.max(base.level_drift_arcsec), ..base.clone() }
    }
}

/// What the solution takes out of the dwells of a run for the motion of the base.
struct SolvedMotion {
    dwells: AllDwells,
    motion: base_motion::BaseMotion,
}

impl SolvedMotion {
    /// `None` without an azimuth, and of a continuous rotation, whose sectors are of no time of their own.
    fn new(run: &RunData, model: &ErrorModel) -> Option<Self> {
        if run.rotation {
            return None;
        }
        let dwells = run.dwells(model)?;
        let motion = base_motion::detect(dwells.as_slice());
        Some(Self { dwells, motion })
    }

    /// Of the dwell that a sample lies in, °/h.
    fn rate_deg_h(&self, sample: &Sample) -> f64 {
        let dwells = self.dwells.as_slice();
        let dwell = dwells.get(dwells.partition_point(|dwell| dwell.end_s < sample.t_s));
        dwell.filter(|dwell| dwell.start_s <= sample.t_s).map_or(0.0, |dwell| self.motion.rate_deg_h(dwell))
    }

    /// Range of the levels, arcsec; `None` where they do not change by more than their noise.
    fn range_arcsec(&self) -> Option<f64> {
        self.motion.is_moving().then(|| base_motion::range_arcsec(self.dwells.as_slice())).flatten()
    }
}

/// Some runs less what the solution takes out of their rates where the levels change: what the base turned the gyro by, if it moved.
pub struct Moved {
    pub runs: Vec<Run>,
    /// Greatest range of a level in a run in which they change, arcsec.
    range_arcsec: f64,
    /// Log odds of a base that moves so over one that stands, by the rates of all runs, nats.
    log_odds: f64,
}

impl Moved {
    /// `None` where the levels do not change by more than their noise. `of_search`: the runs as the search sees them.
    pub fn new(runs: &[&RunData], of_search: &[Run], base: &ErrorModel) -> Option<Self> {
        let moved = |own: &Run| {
            let data = runs.iter().find(|data| data.file == own.file)?;
            let motion = SolvedMotion::new(data, base)?;
            let range_arcsec = motion.range_arcsec()?;
            let turning_deg_h: Vec<f64> = data.samples.iter().map(|sample| motion.rate_deg_h(sample)).collect();
            Some((own.clone().less(&own.by_row(&turning_deg_h)), range_arcsec))
        };
        let moved: Vec<Option<(Run, f64)>> = of_search.par_iter().map(moved).collect();
        let range_arcsec = moved.iter().flatten().map(|(_, range_arcsec)| *range_arcsec).reduce(f64::max)?;
        let or_own = |(moved, own): (Option<(Run, f64)>, &Run)| moved.map_or_else(|| own.clone(), |(run, _)| run);
        let runs: Vec<Run> = moved.into_iter().zip(of_search).map(or_own).collect();
        let log_odds = learn::evidence(&runs)? - learn::evidence(of_search)?;
        Some(Self { runs, range_arcsec, log_odds })
    }

    /// Whether the rates tell that the base moved.
    pub fn is_felt(&self) -> bool {
        self.log_odds > -FALSE_MOTIONS.ln()
    }

    /// The accelerometers' drift, where the rates tell that the base stood.
    pub fn level_drift(&self) -> Option<LevelDrift> {
        let log_odds = -self.log_odds;
        (log_odds > -FALSE_MOTIONS.ln()).then_some(LevelDrift { range_arcsec: self.range_arcsec, log_odds })
    }
}

/// What the gyro feels of the turning that the accelerometers show, and its sigma: the ratio of both slopes over windows of [`GAIN_WINDOW_S`], of the
/// gyro's angle and of the tilt, each dwell less its mean. Both have errors, so that neither is the regressor: their root mean squares are compared.
/// Windows that do not overlap count as one each.
fn gain(runs: &[&RunData]) -> Option<(f64, f64)> {
    let (mut gyro2, mut tilt2, mut both, mut seconds) = (0.0, 0.0, 0.0, 0.0);
    for run in runs {
        let tilt = turning_deg_h(run, GAIN_WINDOW_S);
        let gyro = turned_deg_h(run, GAIN_WINDOW_S);
        let places: Vec<usize> = (0..run.samples.len()).filter(|&i| !run.samples[i].moving).collect();
        for dwell in places.chunk_by(|&a, &b| run.samples[a].dwell == run.samples[b].dwell) {
            let (Some(&first), Some(&last)) = (dwell.first(), dwell.last()) else { continue };
            let (begin_s, end_s) =
                (run.samples[first].t_s + 0.5 * GAIN_WINDOW_S, run.samples[last].t_s - 0.5 * GAIN_WINDOW_S);
            let whole: Vec<usize> =
                dwell.iter().copied().filter(|&i| (begin_s..=end_s).contains(&run.samples[i].t_s)).collect();
            let mean = |of: &[f64]| whole.iter().map(|&i| of[i]).sum::<f64>() / whole.len() as f64;
            let (of_gyro, of_tilt) = (mean(&gyro), mean(&tilt));
            for &i in &whole {
                let (g, t) = (gyro[i] - of_gyro, tilt[i] - of_tilt);
                (gyro2, tilt2, both) = (gyro2 + g * g, tilt2 + t * t, both + g * t);
                seconds += run.samples[i].seconds;
            }
        }
    }
    let gain = (gyro2 / tilt2).sqrt().copysign(both);
    let coherence = (both * both / (gyro2 * tilt2)).min(1.0);
    let windows = seconds / GAIN_WINDOW_S;
    let sigma = gain.abs() * ((1.0 - coherence) / coherence / windows).sqrt();
    (windows > 2.0 && gain.is_finite() && sigma.is_finite()).then_some((gain, sigma))
}

/// The gyro's rate as [`turning_deg_h`] sees the tilt: slopes of its angle over the same windows.
fn turned_deg_h(run: &RunData, window_s: f64) -> Vec<f64> {
    let mut angle_arcsec = 0.0;
    let mut of_angle = run.clone();
    for (sample, source) in of_angle.samples.iter_mut().zip(&run.samples) {
        let half_arcsec = 0.5 * source.rate_deg_h * source.seconds;
        let middle_rad = (angle_arcsec + half_arcsec) / ARCSEC_PER_RAD;
        angle_arcsec += 2.0 * half_arcsec;
        // Along the sensitive axis, as a tilt is.
        sample.level = Some(Specific { forward: -source.sin * middle_rad, left: source.cos * middle_rad });
    }
    turning_deg_h(&of_angle, window_s)
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

/// The dwells of a run, the base's motion taken out of their rates.
struct Dwells {
    fix: Fix,
    /// The samples of each, and its rate, °/h.
    each: Vec<(Range<usize>, f64)>,
    /// Noise of a second, °/h, root mean square over the dwells.
    noise_deg_h: f64,
}

impl Dwells {
    fn new(run: &RunData, model: &ErrorModel) -> Option<Self> {
        let (fix, dwells) = run.solve(model)?;
        let until = |t_s: f64| run.samples.partition_point(|sample| sample.t_s < t_s);
        let of_dwell =
            |(end_s, dwell): &(f64, Dwell)| (until(end_s - dwell.seconds - 1e-6)..until(*end_s), dwell.rate_deg_h);
        let variance = |(_, dwell): &(f64, Dwell)| dwell.sigma_deg_h.powi(2) * dwell.seconds;
        let noise_deg_h = (dwells.iter().map(variance).sum::<f64>() / dwells.len() as f64).sqrt();
        let each: Vec<(Range<usize>, f64)> = dwells.iter().map(of_dwell).collect();
        each.iter().all(|(samples, _)| !samples.is_empty()).then_some(Self { fix, each, noise_deg_h })
    }

    /// The run with the azimuth and the noise that its dwells give.
    fn applied_to(&self, run: &RunData) -> RunData {
        let mut run = run.clone();
        run.noise_deg_h = Some(self.noise_deg_h);
        run.before = Some(self.fix);
        run
    }

    /// Each as a sample of its own.
    fn into_samples(self, run: &RunData) -> Option<RunData> {
        let mut by_dwell = self.applied_to(run);
        by_dwell.samples.clear();
        by_dwell.channels.iter_mut().for_each(Vec::clear);
        for (number, (inside, rate_deg_h)) in self.each.into_iter().enumerate() {
            let samples = &run.samples[inside.clone()];
            let mean = |value: &dyn Fn(&Sample) -> f64| samples.iter().map(value).sum::<f64>() / samples.len() as f64;
            let first = samples.first()?;
            let level = first.level.map(|_| Specific {
                forward: mean(&|sample| sample.level.map_or(0.0, |level| level.forward)),
                left: mean(&|sample| sample.level.map_or(0.0, |level| level.left)),
            });
            by_dwell.samples.push(Sample {
                t_s: mean(&|sample| sample.t_s),
                seconds: samples.iter().map(|sample| sample.seconds).sum(),
                rate_deg_h,
                design: DesignRow {
                    cos: mean(&|sample| sample.design.cos),
                    sin: mean(&|sample| sample.design.sin),
                    vertical_deg_h: mean(&|sample| sample.design.vertical_deg_h),
                },
                cos: mean(&|sample| sample.cos),
                sin: mean(&|sample| sample.sin),
                temp_c: first.temp_c.map(|_| mean(&|sample| sample.temp_c.unwrap_or(0.0))),
                level,
                moving: false,
                left_out: false,
                dwell: number,
                line: first.line,
            });
            for (channel, values) in by_dwell.channels.iter_mut().zip(&run.channels) {
                channel.push(values[inside.clone()].iter().sum::<f64>() / inside.len() as f64);
            }
        }
        Some(by_dwell)
    }
}

/// A run as the search sees it where the base moves: a row for every dwell, in which effects are followed by the second.
pub fn by_dwell(run: &RunData, model: &ErrorModel) -> Option<Run> {
    let dwells = Dwells::new(run, model)?;
    Run::of_dwells(dwells.applied_to(run).recording(), &dwells.each)
}

/// The dwells of a run as samples of their own.
pub fn dwells_of(run: &RunData, model: &ErrorModel) -> Option<RunData> {
    Dwells::new(run, model)?.into_samples(run)
}

/// The same, the base's motion taken out: what is left of them is judged.
pub fn dwells_at_rest(run: &RunData, model: &ErrorModel) -> Option<RunData> {
    let mut dwells = Dwells::new(run, model)?;
    // By the second it is taken out already, and there is none any more.
    if let Some(motion) = SolvedMotion::new(run, model) {
        for (samples, rate_deg_h) in &mut dwells.each {
            *rate_deg_h -= motion.rate_deg_h(&run.samples[samples.start]);
        }
    }
    dwells.into_samples(run)
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
    let found = if best < without + MOST_VARIANCE_RATIO.ln() { lagged } else { plain };
    let promised = |way: Option<BaseMotion>| {
        let sigma = |run: &&RunData| solved(run, way).map_or(100.0, |(fix, _)| fix.sigma_deg);
        runs.par_iter().map(|run| sigma(run).powi(2)).sum::<f64>()
    };
    (promised(Some(found)) < promised(None)).then_some(found)
}
