//! Does an instrument go on as it did, and what changed where it does not? The test is the core's ([`north_finder::service::change`]), which a board runs too.

use north_finder::health::Signal;
use north_finder::service::change::{ALARM, BASELINE};
use north_finder::service::level::Followed;
use north_finder::service::watch::{SIGNALS, Values, Watch as Test, test};
use serde::Serialize;

/// A ramp of fewer fixes has no course that tells it from a step.
const LEAST_RAMP: usize = 5;

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
    pub signal: Signal,
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

/// Watches the fixes of a log.
///
/// `switched`: the instrument was switched on between the fix and the one before. `temperatures_c`: of the gyro, where there are all.
pub fn watch(fixes: &[Values], switched: &[bool], temperatures_c: Option<&[f64]>) -> Watch {
    let mut test = Test::default();
    let mut result = Watch { watched: 0, statistic: Vec::new(), alarm: None, changes: Vec::new() };
    for (place, (values, &switched)) in fixes.iter().zip(switched).enumerate() {
        test.next(values, switched);
        let Some(mean) = test.statistic() else { continue };
        result.watched += 1;
        result.statistic.push(mean);
        if mean >= ALARM {
            result.alarm = Some(place);
            break;
        }
    }
    if let Some(alarm) = result.alarm {
        let statistics = test.statistics();
        let total: f64 = statistics.iter().sum();
        for (at, &statistic) in statistics.iter().enumerate().filter(|(_, statistic)| **statistic >= ALARM) {
            // A signal that alone would have been enough.
            let series = Series::new(at, &fixes[..=alarm], switched);
            result.changes.extend(series.explain(temperatures_c, statistic / total));
        }
        result.changes.sort_by(|a, b| b.share.total_cmp(&a.share));
    }
    result
}

/// The values of one signal.
struct Series {
    signal: Signal,
    values: Vec<f64>,
    /// Places of their fixes in the log, and whether there was a switch-on since the value before.
    places: Vec<usize>,
    switched: Vec<bool>,
}

impl Series {
    fn new(at: usize, fixes: &[Values], switched: &[bool]) -> Self {
        let mut series = Self { signal: SIGNALS[at], values: Vec::new(), places: Vec::new(), switched: Vec::new() };
        let mut pending = false;
        for (place, values) in fixes.iter().enumerate() {
            pending |= switched[place];
            if let Some(value) = values[at] {
                series.values.push(value);
                series.places.push(place);
                series.switched.push(std::mem::take(&mut pending));
            }
        }
        series
    }

    /// What changed, by least squares along the level that fits the baseline best.
    fn explain(&self, temperatures_c: Option<&[f64]>, share: f64) -> Option<Change> {
        let mut level_test = test(self.signal);
        let mut baseline = 0;
        while level_test.foremost().is_none() {
            level_test.next(*self.values.get(baseline)?, self.switched[baseline]);
            baseline += 1;
        }
        let (level, scale) = level_test.foremost()?;
        let values = &self.values[baseline..];
        let log_count = (values.len() as f64).ln();
        let fit = |cause: Cause, from: usize, constants: f64, course: &dyn Fn(usize) -> f64| {
            let (mut level, mut followed, mut along, mut information) = (level.clone(), Followed::default(), 0.0, 0.0);
            for (at, &value) in values.iter().enumerate() {
                let innovation = level.next(value, self.switched[baseline + at]);
                let seen = followed.seen(course(at), innovation.gain);
                let variance = innovation.variance * scale;
                along += seen * innovation.value / variance;
                information += seen * seen / variance;
            }
            (information > 0.0).then(|| Fit {
                cause,
                from: self.places[baseline + from],
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
        let after_c: Option<Vec<f64>> =
            temperatures_c.map(|all_c| self.places[baseline..].iter().map(|&place| all_c[place]).collect());
        if let Some((all_c, after_c)) = temperatures_c.zip(after_c.as_ref()) {
            let normal = &all_c[..all_c.len().min(BASELINE)];
            let normal_c = normal.iter().sum::<f64>() / normal.len() as f64;
            fits.extend(fit(Cause::Temperature, 0, 1.0, &|at| after_c[at] - normal_c));
        }
        let best = fits.iter().copied().max_by(|a, b| a.score.total_cmp(&b.score))?;
        let other = fits.iter().filter(|fit| fit.cause != best.cause).max_by(|a, b| a.score.total_cmp(&b.score));
        let range = match (best.cause, &after_c) {
            (Cause::Temperature, Some(after_c)) => {
                after_c.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b))
                    - after_c.iter().fold(f64::INFINITY, |a, &b| a.min(b))
            }
            _ => 1.0,
        };
        Some(Change {
            signal: self.signal,
            unit: self.signal.unit(),
            from: best.from,
            cause: best.cause,
            size: best.size,
            sigma: best.sigma,
            sigmas_of_fix: best.size * range / scale.sqrt(),
            instead: other.map(|other| (other.cause, (best.score - other.score).exp())),
            share,
        })
    }
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
    fn log(
        seed: u64,
        count: usize,
        wander: f64,
        switch: f64,
        change: impl Fn(usize) -> f64,
    ) -> (Vec<Values>, Vec<bool>) {
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
                [Some(bias + offset + normal(&mut rng) + change(fix)), None, None, None]
            })
            .collect();
        (values, switched)
    }

    fn run(seed: u64, count: usize, wander: f64, switch: f64, change: impl Fn(usize) -> f64) -> Watch {
        let (fixes, switched) = log(seed, count, wander, switch, change);
        watch(&fixes, &switched, None)
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
        let (fixes, switched) = log(5, 300, 0.0, 0.0, |fix| 0.5 * warm(fix));
        let temperatures_c: Vec<f64> = (0..300).map(|fix| 20.0 + warm(fix)).collect();
        let watch = watch(&fixes, &switched, Some(&temperatures_c));
        let change = &watch.changes[0];
        assert!(change.cause == Cause::Temperature && (change.size - 0.5).abs() < 4.0 * change.sigma, "{change:?}");
    }
}
