//! The watch over a log: the firmware's own test of every signal ([`ChangeTest`]), and what changed where a signal does not go on as it did.

use north_finder::event::service::change::ChangeTest;
use north_finder::event::service::level::Followed;
use serde::Serialize;

pub use north_finder::event::service::change::{ALARM, BASELINE};

use super::{Kind, Signal};

/// A size of fewer sigmas is not shown: the greatest of hundreds of beginnings is one of 4 by chance in 2 % of the logs.
const SHOWN: f64 = 4.0;
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
    pub signal: Kind,
    pub unit: &'static str,
    /// Place of the first changed fix in the log, from 0; for a temperature the first after the baseline.
    pub from: usize,
    pub cause: Cause,
    /// Size and one sigma in units of the signal, from all fixes of the log, where these still show it: of a step, of a ramp at the end, for each kelvin.
    pub size: f64,
    pub sigma: f64,
    /// Size in sigmas of one fix (of a temperature: over the range of the fixes after the baseline).
    pub sigmas_of_fix: f64,
    /// The next best cause, and by how many times it is less likely.
    pub instead: Option<(Cause, f64)>,
    /// Share of the statistics of all signals at the alarm that this one has.
    pub share: f64,
    /// The fixes after the alarm do not show it any more: size and sigma are those of the fixes up to it.
    pub passed: bool,
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

/// Watches signals of a log, all of equal length: the first [`BASELINE`] fixes say what is normal.
///
/// `switched`: the instrument was switched on between the fix and the one before. `temperatures_c`: of the gyro, where there are all.
pub fn watch(signals: &[Signal], switched: &[bool], temperatures_c: Option<&[f64]>) -> Watch {
    let count = switched.len();
    let mut tests: Vec<(&Signal, ChangeTest)> = signals
        .iter()
        .filter_map(|signal| {
            let mut test = ChangeTest::default();
            for (&value, &switched) in signal.values.get(..BASELINE)?.iter().zip(switched) {
                test.next(value, switched);
            }
            test.foremost()?;
            Some((signal, test))
        })
        .collect();
    let normal = tests.clone();
    let mut result = Watch { watched: 0, statistic: Vec::new(), alarm: None, changes: Vec::new() };
    for fix in BASELINE..count {
        if tests.is_empty() {
            break;
        }
        let next = |(signal, test): &mut (&Signal, ChangeTest)| test.next(signal.values[fix], switched[fix]);
        let each: Vec<f64> = tests.iter_mut().map(|test| next(test).unwrap_or_default()).collect();
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
                    let change = |fixes: usize| explain(signal, test, &switched[..fixes], temperatures_c, fix);
                    let is_shown = |change: &Change| !change.passed && change.size.abs() > SHOWN * change.sigma;
                    let shown = change(count).filter(is_shown);
                    let seen = || change(fix + 1).map(|change| Change { passed: true, ..change });
                    result.changes.extend(shown.or_else(seen).map(|change| Change { share, ..change }));
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

/// What changed in a signal, by least squares along the level that fits the baseline best, of so many fixes as `switched` has; it began with that of
/// the alarm at the latest. It has passed where the fixes after the alarm, if there are any, have less than half of it left.
fn explain(
    signal: &Signal,
    normal: &ChangeTest,
    switched: &[bool],
    temperatures_c: Option<&[f64]>,
    alarm: usize,
) -> Option<Change> {
    let (level, scale) = normal.foremost()?;
    let values = &signal.values[BASELINE..switched.len()];
    let log_count = (values.len() as f64).ln();
    // By the fixes from `first` on.
    let fit_from = |first: usize, cause: Cause, from: usize, constants: f64, course: &dyn Fn(usize) -> f64| {
        let (mut level, mut followed, mut along, mut information) = (level.clone(), Followed::default(), 0.0, 0.0);
        for (at, &value) in values.iter().enumerate() {
            let innovation = level.next(value, switched[BASELINE + at]);
            let seen = f64::from(followed.seen(course(at) as f32, innovation.gain));
            let variance = innovation.variance * scale;
            if at >= first {
                along += seen * innovation.value / variance;
                information += seen * seen / variance;
            }
        }
        (information > 0.0).then(|| Fit {
            cause,
            from: BASELINE + from,
            size: along / information,
            sigma: information.sqrt().recip(),
            score: 0.5 * along * along / information - 0.5 * constants * log_count,
        })
    };
    let fit = |cause, from, constants, course: &dyn Fn(usize) -> f64| fit_from(0, cause, from, constants, course);
    let ended = values.len();
    let step = |from: usize| move |at: usize| f64::from(u8::from(at >= from));
    // In units of what it has reached at the end.
    let ramp = |from: usize| move |at: usize| (at + 1).saturating_sub(from) as f64 / (ended - from) as f64;
    let mut fits: Vec<Fit> = Vec::new();
    for from in 0..=alarm - BASELINE {
        fits.extend(fit(Cause::Step, from, 2.0, &step(from)));
        if ended - from >= LEAST_RAMP {
            fits.extend(fit(Cause::Ramp, from, 2.0, &ramp(from)));
        }
    }
    let normal_c = temperatures_c.map_or(0.0, |all_c| all_c[..BASELINE].iter().sum::<f64>() / BASELINE as f64);
    let warmth = |at: usize| temperatures_c.map_or(0.0, |all_c| all_c[BASELINE + at] - normal_c);
    if temperatures_c.is_some() {
        fits.extend(fit(Cause::Temperature, 0, 1.0, &warmth));
    }
    let best = fits.iter().copied().max_by(|a, b| a.score.total_cmp(&b.score))?;
    let other = fits.iter().filter(|fit| fit.cause != best.cause).max_by(|a, b| a.score.total_cmp(&b.score));
    // One fix that is far off is a step of all fixes since then in their mean, and yet none of them shows it.
    let from = best.from - BASELINE;
    let course: &dyn Fn(usize) -> f64 = match best.cause {
        Cause::Step => &step(from),
        Cause::Ramp => &ramp(from),
        Cause::Temperature => &warmth,
    };
    let after = fit_from(alarm - BASELINE + 1, best.cause, from, 0.0, course);
    let left = |after: Fit| after.size * best.size.signum() + SHOWN * after.sigma;
    let passed = after.is_some_and(|after| left(after) < 0.5 * best.size.abs());
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
        sigmas_of_fix: best.size * range / scale.sqrt(),
        instead: other.map(|other| (other.cause, (best.score - other.score).exp())),
        share: 0.0,
        passed,
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
    fn a_change_began_before_it_was_seen_even_where_a_greater_one_follows() {
        let watch = run(3, 500, 0.0, 0.0, |fix| match fix {
            0..200 => 0.0,
            200..300 => 2.0,
            _ => 20.0,
        });
        let (alarm, change) = (watch.alarm.unwrap(), &watch.changes[0]);
        assert!((200..230).contains(&alarm) && change.from <= alarm, "{alarm} {change:?}");
    }

    #[test]
    fn a_change_that_goes_back_is_told_as_it_was_seen() {
        let watch = run(3, 400, 0.0, 0.0, |fix| if (200..215).contains(&fix) { 4.0 } else { 0.0 });
        let change = &watch.changes[0];
        assert!(change.passed && change.from.abs_diff(200) <= 1 && change.size > 2.0, "{change:?}");
        assert!(!run(3, 400, 0.0, 0.0, |fix| if fix >= 200 { 4.0 } else { 0.0 }).changes[0].passed);
    }

    /// A blunder of one fix is no step, however great it is.
    #[test]
    fn one_fix_that_is_far_off_has_passed() {
        for size in [10.0, 50.0, 1e6] {
            let watch = run(3, 300, 0.0, 0.0, |fix| if fix == 150 { size } else { 0.0 });
            let change = &watch.changes[0];
            assert!(watch.alarm == Some(150) && change.passed && change.from == 150, "{change:?}");
            assert!((change.size / size - 1.0).abs() < 0.5, "{change:?}");
        }
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
