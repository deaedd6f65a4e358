//! Does a signal go on as it did? A sequential test with a false-alarm rate that is derived, and what changed where it does not.
//!
//! **What is expected.** A signal is a level that wanders, plus what a switch-on adds until the next, plus the noise of a fix: yₜ = bₜ + oₜ + vₜ with
//! vₜ ~ N(0, r), bₜ = bₜ₋₁ + wₜ, wₜ ~ N(0, q), and oₜ drawn anew from N(0, s) at every switch-on. The ratios q/r and s/r are not known: the
//! expectation is the mixture of [`Level`]s over a grid of both (half of the prior on none, the other half shared by the rest), weighted by how
//! well each predicts the baseline; the scale of each comes from the baseline, and its predictions are Student-t with the baseline's degrees of freedom.
//!
//! **The test.** For every fix j after the baseline and every change δ of a fixed set (steps of 1, 2 and 4 sigma of a fix, ramps of 3, 6 and 12
//! sigma over 100 fixes, of either sign) let Λ(j, δ, t) be the likelihood of the fixes up to t with that change from j on, over their likelihood
//! without. Λ is a martingale of mean 1 where nothing changed, so that R(t) = Σⱼ mean over δ of Λ(j, δ, t), the statistic of Shiryaev and Roberts,
//! has R(t) − t as a martingale of mean 0. Stopped when R first reaches A, the mean number of fixes until a false alarm is E\[T\] = E\[R(T)\] ≥ A
//! (Pollak 1985; Shin, Ramdas and Rinaldo 2023 call it an e-detector). The mean of R over several signals is such a statistic, too. Starts that lie
//! further back than [`STARTS`] fixes are forgotten, which makes R smaller and false alarms rarer.

use std::collections::VecDeque;

use serde::Serialize;
use statrs::function::gamma::ln_gamma;

use super::{Kind, Signal};

/// Fixes that say what is normal.
pub const BASELINE: usize = 100;
/// The statistic at which the model no longer holds; also the least mean number of fixes between false alarms.
pub const ALARM: f64 = 1000.0;
/// Changes are looked for that began so many fixes ago. A ramp of three sigma in a hundred fixes is found within fifty.
const STARTS: usize = 150;
/// Steps in sigmas of a fix: half and twice the two sigmas that are to be found within eight fixes, and these.
const STEPS: [f64; 3] = [1.0, 2.0, 4.0];
/// Ramps in sigmas of a fix over a hundred fixes: three are to be found within fifty, and twice and four times as much.
const RAMPS: [f64; 3] = [3.0, 6.0, 12.0];
/// Fixes over which a ramp gains its size.
const RAMP_FIXES: f64 = 100.0;
/// A ramp of fewer fixes has no course that tells it from a step.
const LEAST_RAMP: usize = 5;
/// Variances of the wander from fix to fix and of a switch-on, in those of a fix: from nothing to what hides every change, by half decades.
const WANDERS: [f64; 8] = [0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0];
const SWITCHES: [f64; 7] = [0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0];
/// Levels of the mixture with less of its weight than this are left out: together they hold less than a twentieth.
const LEAST_WEIGHT: f64 = 3e-3;

/// What a change follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// Another level from one fix on: a shock, a repair, another place.
    Step,
    /// A level that moves steadily with time.
    Ramp,
    /// A level that follows the gyro's temperature.
    Temperature,
}

/// What changed in a signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    pub signal: Kind,
    pub unit: &'static str,
    /// Place of the first changed fix in the log, from 0; for a temperature the first after the baseline.
    pub from: usize,
    pub cause: Cause,
    /// Size and one sigma in units of the signal, from all fixes of the log: of a step, of a ramp at the end, for each kelvin.
    pub size: f64,
    pub sigma: f64,
    /// Size in sigmas of one fix (of a temperature: over the range of the fixes after the baseline).
    pub sigmas_of_fix: f64,
    /// The next best cause, and by how many times it is less likely.
    pub instead: Option<(Cause, f64)>,
    /// Share of the statistics of all signals at the alarm that this one has.
    pub share: f64,
}

/// What the test says of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Watch {
    /// Fixes that were looked at after the baseline.
    pub watched: usize,
    /// The mean statistic after each of them.
    pub statistic: Vec<f64>,
    /// Place in the log of the fix with which the statistic reached [`ALARM`].
    pub alarm: Option<usize>,
    /// The signals that changed, the most telling first; empty without an alarm.
    pub changes: Vec<Change>,
}

/// A level with its ratios, filtered along a signal. Variances are in those of a fix.
#[derive(Clone, Debug)]
struct Level {
    wander: f64,
    switch: f64,
    /// Level and what the last switch-on added to it; their variances and covariance.
    mean: [f64; 2],
    variances: [f64; 2],
    covariance: f64,
    /// The variance of a fix once the baseline is over.
    scale: f64,
    /// Sum of the squares of standardised innovations, and of the logarithms of their variances.
    squares: f64,
    logs: f64,
    count: usize,
}

/// What a fix was off by from what was expected.
#[derive(Clone, Copy, Debug)]
struct Innovation {
    value: f64,
    /// Its variance in those of a fix.
    variance: f64,
    gain: Gain,
}

/// Shares of an innovation by which the estimates of level and of the switch-on's part move, the latter beginning anew or not.
#[derive(Clone, Copy, Debug)]
struct Gain {
    shares: [f64; 2],
    anew: bool,
}

/// What the estimates have of a change so far.
#[derive(Clone, Copy, Debug, Default)]
struct Followed([f64; 2]);

impl Followed {
    /// What an innovation shows of a change that has reached `now`.
    fn seen(&mut self, now: f64, gain: Gain) -> f64 {
        if gain.anew {
            self.0[1] = 0.0;
        }
        let seen = now - self.0[0] - self.0[1];
        for (followed, share) in self.0.iter_mut().zip(gain.shares) {
            *followed += share * seen;
        }
        seen
    }
}

impl Level {
    /// After a first fix, before which nothing was known of the level.
    fn new(wander: f64, switch: f64, first: f64) -> Self {
        let (variances, covariance) = ([1.0 + switch, switch], -switch);
        Self {
            wander,
            switch,
            mean: [first, 0.0],
            variances,
            covariance,
            scale: 1.0,
            squares: 0.0,
            logs: 0.0,
            count: 0,
        }
    }

    fn next(&mut self, value: f64, switched: bool) -> Innovation {
        self.variances[0] += self.wander;
        if switched {
            (self.mean[1], self.variances[1], self.covariance) = (0.0, self.switch, 0.0);
        }
        let along = self.variances.map(|variance| variance + self.covariance);
        let variance = along[0] + along[1] + 1.0;
        let shares = along.map(|along| along / variance);
        let innovation = value - self.mean[0] - self.mean[1];
        for part in 0..2 {
            self.mean[part] += shares[part] * innovation;
            self.variances[part] -= shares[part] * along[part];
        }
        self.covariance -= shares[0] * along[1];
        Innovation { value: innovation, variance, gain: Gain { shares, anew: switched } }
    }

    fn learn(&mut self, value: f64, switched: bool) {
        let innovation = self.next(value, switched);
        self.squares += innovation.value * innovation.value / innovation.variance;
        self.logs += innovation.variance.ln();
        self.count += 1;
    }

    /// Logarithm of the likelihood of the baseline, the scale being free, times the prior.
    fn log_weight(&self) -> f64 {
        let prior = |ratio: f64, others: usize| if ratio > 0.0 { 0.5 / others as f64 } else { 0.5 };
        let prior = prior(self.wander, WANDERS.len() - 1) * prior(self.switch, SWITCHES.len() - 1);
        prior.ln() - 0.5 * self.logs - 0.5 * self.count as f64 * self.squares.ln()
    }
}

/// Student's t distribution with the baseline's degrees of freedom.
#[derive(Clone, Copy, Debug)]
struct Student {
    freedom: f64,
    constant: f64,
}

impl Student {
    fn new(freedom: f64) -> Self {
        let constant =
            ln_gamma(0.5 * (freedom + 1.0)) - ln_gamma(0.5 * freedom) - 0.5 * (freedom * std::f64::consts::PI).ln();
        Self { freedom, constant }
    }

    fn log_density(self, value: f64, variance: f64) -> f64 {
        let square = value * value / variance;
        self.constant - 0.5 * variance.ln() - 0.5 * (self.freedom + 1.0) * (square / self.freedom).ln_1p()
    }
}

/// What one level makes of changes that began at a fix.
#[derive(Clone, Debug)]
struct Start {
    /// Of a unit change: step, ramp.
    followed: [Followed; 2],
    age: f64,
    /// Logarithms of the likelihoods with each change since the start, without the fixes before.
    changed: [f64; CHANGES],
    /// Logarithm of the likelihood without a change of the fixes before.
    before: f64,
}

const CHANGES: usize = 2 * (STEPS.len() + RAMPS.len());

/// Shape (0: step, 1: ramp) and size of every change.
fn changes() -> impl Iterator<Item = (usize, f64)> {
    let of = |shape: usize, sizes: [f64; 3]| sizes.into_iter().flat_map(move |size| [(shape, size), (shape, -size)]);
    of(0, STEPS).chain(of(1, RAMPS))
}

/// A level of the mixture with its weight and the starts that it remembers.
#[derive(Clone, Debug)]
struct Member {
    level: Level,
    log_weight: f64,
    /// Logarithm of the likelihood of what came after the baseline, without a change.
    unchanged: f64,
    starts: VecDeque<Start>,
}

impl Member {
    fn next(&mut self, value: f64, switched: bool, student: Student) {
        if self.starts.len() == STARTS {
            self.starts.pop_front();
        }
        self.starts.push_back(Start {
            followed: Default::default(),
            age: 0.0,
            changed: [0.0; CHANGES],
            before: self.unchanged,
        });
        let scale = self.level.scale;
        let innovation = self.level.next(value, switched);
        let variance = innovation.variance * scale;
        for start in &mut self.starts {
            start.age += 1.0;
            let [step, ramp] = &mut start.followed;
            let seen = [step.seen(1.0, innovation.gain), ramp.seen(start.age / RAMP_FIXES, innovation.gain)];
            for (log, (shape, size)) in start.changed.iter_mut().zip(changes()) {
                *log += student.log_density(innovation.value - size * scale.sqrt() * seen[shape], variance);
            }
        }
        self.unchanged += student.log_density(innovation.value, variance);
    }
}

/// The test of one signal.
#[derive(Clone, Debug)]
struct Test {
    members: Vec<Member>,
    student: Student,
}

impl Test {
    /// Learns what is normal. `None` where the signal does not move at all.
    fn new(baseline: &[f64], switched: &[bool]) -> Option<Self> {
        let (&first, rest) = baseline.split_first()?;
        let mut levels: Vec<Level> = WANDERS
            .iter()
            .flat_map(|&wander| SWITCHES.iter().map(move |&switch| Level::new(wander, switch, first)))
            .collect();
        for level in &mut levels {
            for (&value, &switched) in rest.iter().zip(&switched[1..]) {
                level.learn(value, switched);
            }
            level.scale = level.squares / rest.len() as f64;
        }
        if levels.iter().any(|level| level.scale <= 0.0) {
            return None;
        }
        let best = levels.iter().map(Level::log_weight).fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = levels.iter().map(|level| (level.log_weight() - best).exp()).sum();
        let members = levels
            .into_iter()
            .map(|level| Member {
                log_weight: level.log_weight() - best - total.ln(),
                level,
                unchanged: 0.0,
                starts: VecDeque::new(),
            })
            .filter(|member| member.log_weight > LEAST_WEIGHT.ln())
            .collect();
        Some(Self { members, student: Student::new(rest.len() as f64) })
    }

    /// The statistic of Shiryaev and Roberts after the next fix.
    fn next(&mut self, value: f64, switched: bool) -> f64 {
        for member in &mut self.members {
            member.next(value, switched, self.student);
        }
        let unchanged = log_sum(self.members.iter().map(|member| member.log_weight + member.unchanged));
        let starts = self.members.first().map_or(0, |member| member.starts.len());
        let each = (0..starts).flat_map(|start| {
            self.members.iter().flat_map(move |member| {
                let Start { before, changed, .. } = &member.starts[start];
                changed.iter().map(move |log| member.log_weight + before + log)
            })
        });
        (log_sum(each) - (CHANGES as f64).ln() - unchanged).exp()
    }

    /// The level that counts most.
    fn foremost(&self) -> Option<&Level> {
        let weight = |member: &&Member| member.log_weight;
        self.members.iter().max_by(|a, b| weight(a).total_cmp(&weight(b))).map(|member| &member.level)
    }
}

fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    most + logs.map(|log| (log - most).exp()).sum::<f64>().ln()
}

/// Watches signals of a log, all of equal length: the first [`BASELINE`] fixes say what is normal.
///
/// `switched`: the instrument was switched on between the fix and the one before. `temperatures_c`: of the gyro, where there are all.
pub fn watch(signals: &[Signal], switched: &[bool], temperatures_c: Option<&[f64]>) -> Watch {
    let count = switched.len();
    let mut tests: Vec<(&Signal, Test)> = signals
        .iter()
        .filter_map(|signal| Some((signal, Test::new(signal.values.get(..BASELINE)?, switched)?)))
        .collect();
    let normal = tests.clone();
    let mut result = Watch { watched: 0, statistic: Vec::new(), alarm: None, changes: Vec::new() };
    for fix in BASELINE..count {
        if tests.is_empty() {
            break;
        }
        let each: Vec<f64> =
            tests.iter_mut().map(|(signal, test)| test.next(signal.values[fix], switched[fix])).collect();
        let mean = each.iter().sum::<f64>() / each.len() as f64;
        result.watched += 1;
        result.statistic.push(mean);
        if mean >= ALARM {
            result.alarm = Some(fix);
            let total: f64 = each.iter().sum();
            for ((signal, test), statistic) in normal.iter().zip(&each) {
                // A signal that alone would have been enough.
                if *statistic >= ALARM {
                    let share = statistic / total;
                    result.changes.extend(explain(signal, test, switched, temperatures_c, share));
                }
            }
            result.changes.sort_by(|a, b| b.share.total_cmp(&a.share));
            break;
        }
    }
    result
}

/// A course that the level may have taken, and what the fixes make of its size.
#[derive(Clone, Copy)]
struct Fit {
    cause: Cause,
    from: usize,
    size: f64,
    sigma: f64,
    /// Gain of the logarithm of the likelihood, less half the logarithm of the number of fixes for each constant (Schwarz 1978).
    score: f64,
}

/// What changed in a signal, by least squares along the level that fits the baseline best.
fn explain(
    signal: &Signal,
    test: &Test,
    switched: &[bool],
    temperatures_c: Option<&[f64]>,
    share: f64,
) -> Option<Change> {
    let level = test.foremost()?;
    let values = &signal.values[BASELINE..switched.len()];
    let log_count = (values.len() as f64).ln();
    let fit = |cause: Cause, from: usize, constants: f64, course: &dyn Fn(usize) -> f64| {
        let (mut level, mut followed, mut along, mut information) = (level.clone(), Followed::default(), 0.0, 0.0);
        for (at, &value) in values.iter().enumerate() {
            let innovation = level.next(value, switched[BASELINE + at]);
            let seen = followed.seen(course(at), innovation.gain);
            let variance = innovation.variance * level.scale;
            along += seen * innovation.value / variance;
            information += seen * seen / variance;
        }
        (information > 0.0).then(|| Fit {
            cause,
            from: BASELINE + from,
            size: along / information,
            sigma: information.sqrt().recip(),
            score: 0.5 * along * along / information - 0.5 * constants * log_count,
        })
    };
    let since = |at: usize, from: usize| (at + 1).saturating_sub(from) as f64;
    let ended = values.len();
    let mut fits: Vec<Fit> = Vec::new();
    for from in 0..ended {
        fits.extend(fit(Cause::Step, from, 2.0, &|at| f64::from(u8::from(at >= from))));
        // In units of what it has reached at the end.
        if ended - from >= LEAST_RAMP {
            fits.extend(fit(Cause::Ramp, from, 2.0, &|at| since(at, from) / (ended - from) as f64));
        }
    }
    if let Some(all_c) = temperatures_c {
        let normal_c = all_c[..BASELINE].iter().sum::<f64>() / BASELINE as f64;
        fits.extend(fit(Cause::Temperature, 0, 1.0, &|at| all_c[BASELINE + at] - normal_c));
    }
    let best = fits.iter().copied().max_by(|a, b| a.score.total_cmp(&b.score))?;
    let other = fits.iter().filter(|fit| fit.cause != best.cause).max_by(|a, b| a.score.total_cmp(&b.score));
    let range = match (best.cause, temperatures_c) {
        (Cause::Temperature, Some(all_c)) => {
            let after = &all_c[BASELINE..switched.len()];
            after.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b)) - after.iter().fold(f64::INFINITY, |a, &b| a.min(b))
        }
        _ => 1.0,
    };
    Some(Change {
        signal: signal.kind,
        unit: signal.kind.unit(),
        from: best.from,
        cause: best.cause,
        size: best.size,
        sigma: best.sigma,
        sigmas_of_fix: best.size * range / level.scale.sqrt(),
        instead: other.map(|other| (other.cause, (best.score - other.score).exp())),
        share,
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        let (u, v): (f64, f64) = (rng.random(), rng.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    /// Fixes of noise 1 with a bias that wanders and changes at every fifth fix's switch-on, and a change.
    fn log(seed: u64, count: usize, wander: f64, switch: f64, change: impl Fn(usize) -> f64) -> (Signal, Vec<bool>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut bias, mut offset) = (0.0, 0.0);
        let switched: Vec<bool> = (0..count).map(|fix| fix % 5 == 0).collect();
        let values = switched
            .iter()
            .enumerate()
            .map(|(fix, &switched)| {
                bias += wander * normal(&mut rng);
                if switched {
                    offset = switch * normal(&mut rng);
                }
                bias + offset + normal(&mut rng) + change(fix)
            })
            .collect();
        (Signal { kind: Kind::Bias, values }, switched)
    }

    fn run(seed: u64, count: usize, wander: f64, switch: f64, change: impl Fn(usize) -> f64) -> Watch {
        let (signal, switched) = log(seed, count, wander, switch, change);
        watch(&[signal], &switched, None)
    }

    /// By hand: a level that does not wander, first 1, then 3: its variance is 1, innovation 2 with variance 2, gain 1/2, and 1/2 is left.
    #[test]
    fn a_level_follows_by_its_gain() {
        let mut level = Level::new(0.0, 0.0, 1.0);
        let innovation = level.next(3.0, false);
        assert_eq!((innovation.value, innovation.variance, innovation.gain.shares), (2.0, 2.0, [0.5, 0.0]));
        assert_eq!((level.mean, level.variances), ([2.0, 0.0], [0.5, 0.0]));
        // Switched on, and an offset of variance 2.5 with it: 0.5 + 2.5 + 1 = 4, of which level and offset take 1/8 and 5/8.
        let mut level = Level { switch: 2.5, ..level };
        let innovation = level.next(6.0, true);
        assert_eq!((innovation.value, innovation.variance, innovation.gain.shares), (4.0, 4.0, [0.125, 0.625]));
        assert_eq!((level.mean, level.variances, level.covariance), ([2.5, 2.5], [0.4375, 0.9375], -0.3125));
    }

    #[test]
    fn a_step_of_two_sigma_is_found_and_named() {
        let mut delays: Vec<usize> = (0..41)
            .map(|seed| {
                let watch = run(seed, 400, 0.0, 0.0, |fix| if fix >= 200 { 2.0 } else { 0.0 });
                watch.alarm.map_or(usize::MAX, |at| at.saturating_sub(199))
            })
            .collect();
        delays.sort_unstable();
        assert!(delays[20] <= 8, "{delays:?}");
        let watch = run(3, 400, 0.0, 0.0, |fix| if fix >= 200 { 4.0 } else { 0.0 });
        let change = &watch.changes[0];
        assert!(change.cause == Cause::Step && (change.size - 4.0).abs() < 4.0 * change.sigma, "{change:?}");
        assert!(change.from.abs_diff(200) <= 1, "{change:?}");
    }

    #[test]
    fn a_temperature_is_told_from_time() {
        let warm = |fix: usize| if fix >= 150 { 8.0 * (fix as f64 / 7.0).sin() } else { 0.0 };
        let (signal, switched) = log(5, 300, 0.0, 0.0, |fix| 0.5 * warm(fix));
        let temperatures_c: Vec<f64> = (0..300).map(|fix| 20.0 + warm(fix)).collect();
        let watch = watch(&[signal], &switched, Some(&temperatures_c));
        let change = &watch.changes[0];
        assert!(change.cause == Cause::Temperature && (change.size - 0.5).abs() < 4.0 * change.sigma, "{change:?}");
    }

    #[test]
    fn what_never_moves_is_not_watched() {
        let signal = Signal { kind: Kind::Bias, values: vec![1.0; 300] };
        assert_eq!(watch(&[signal], &[false; 300], None).watched, 0);
    }
}
