//! `north bench watch`: how rarely the test of an instrument in service is wrong, and how soon it is right.

use std::f64::consts::TAU;
use std::io::Write;

use clap::Args;
use north::failure::Failure;
use north::progress;
use north::service::{ALARM, BASELINE, Kind, Signal, watch};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::{Bench, trials};
use crate::statistics::median;

/// The test of an instrument in service: fixes between false alarms, and fixes until a change is seen
///
/// Logs are drawn from a bias that wanders from fix to fix and is another at every switch-on, every fifth fix, plus the noise of a fix, of which all sizes are
/// multiples. The test is the firmware's, which `north watch` runs, too. A baseline of 100 fixes, then up to --fixes without a change; or a change after
/// another hundred. Beside it the test that knows everything but when: the statistic of Shiryaev and Roberts with the true sizes of noise, wander, switch-on
/// and change.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench watch --logs 200")]
pub struct WatchBench {
    /// Logs of each kind
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u64).range(10..=100_000))]
    logs: u64,
    /// Fixes without a change after the baseline, at most
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u64).range(100..=100_000))]
    fixes: u64,
    /// Seed of the first log
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// An instrument whose bias wanders, in sigmas of a fix.
const INSTRUMENTS: [(&str, f64, f64); 4] = [
    ("still", 0.0, 0.0),
    ("changes at switch-on by 0.5 sigma", 0.0, 0.5),
    ("wanders by 0.1 sigma a fix", 0.1, 0.0),
    ("wanders by 0.1, changes by 0.5 sigma", 0.1, 0.5),
];
/// Fixes between the baseline and a change.
const CALM: usize = 100;
/// Fixes after it.
const AFTER: usize = 200;

/// An instrument.
#[derive(Serialize)]
pub struct Row {
    instrument: &'static str,
    logs: u64,
    /// Fixes watched without a change, alarms among them; the former over the latter, a bound where there are none.
    fixes_watched: usize,
    false_alarms: usize,
    fixes_between_false_alarms: f64,
    /// Median of the fixes until a step of two sigma is seen, a ramp of three sigma in a hundred fixes; of the test that knows everything.
    step_fixes: f64,
    ramp_fixes: f64,
    step_fixes_known: f64,
    ramp_fixes_known: f64,
    /// Of the logs with a step those with an alarm before it.
    early: usize,
}

fn step(after: usize) -> f64 {
    if after > 0 { 2.0 } else { 0.0 }
}

fn ramp(after: usize) -> f64 {
    0.03 * after as f64
}

impl Bench for WatchBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(3 * self.logs * INSTRUMENTS.len() as u64, "logs");
        let mut rows = Vec::new();
        for (instrument, wander, switch) in INSTRUMENTS {
            let seeds = self.seed..self.seed + self.logs;
            let calm = trials(seeds.clone(), &bar, |seed| {
                let log = Drawn::new(seed, BASELINE + self.fixes as usize, wander, switch, |_| 0.0);
                let watched = log.watch();
                (watched.0, watched.1.is_some())
            })?;
            let delays = |change: fn(usize) -> f64| {
                trials(seeds.clone(), &bar, |seed| {
                    let course = |fix: usize| change((fix + 1).saturating_sub(BASELINE + CALM));
                    let log = Drawn::new(1_000_000 + seed, BASELINE + CALM + AFTER, wander, switch, course);
                    let until = |at: Option<usize>| match at {
                        Some(at) if at < BASELINE + CALM => None,
                        Some(at) => Some((at + 1 - BASELINE - CALM) as f64),
                        None => Some(AFTER as f64),
                    };
                    (until(log.watch().1), until(log.known(wander, switch, change)))
                })
            };
            let (steps, ramps) = (delays(step)?, delays(ramp)?);
            let middle = |each: Vec<Option<f64>>| median(each.into_iter().flatten().collect());
            let known = |all: &[(Option<f64>, Option<f64>)]| middle(all.iter().map(|each| each.1).collect());
            let (fixes_watched, false_alarms) =
                calm.iter().fold((0, 0), |(fixes, alarms), each| (fixes + each.0, alarms + usize::from(each.1)));
            rows.push(Row {
                instrument,
                logs: self.logs,
                fixes_watched,
                false_alarms,
                fixes_between_false_alarms: fixes_watched as f64 / false_alarms.max(1) as f64,
                step_fixes: middle(steps.iter().map(|each| each.0).collect()),
                ramp_fixes: middle(ramps.iter().map(|each| each.0).collect()),
                step_fixes_known: known(&steps),
                ramp_fixes_known: known(&ramps),
                early: steps.iter().filter(|each| each.0.is_none()).count(),
            });
        }
        bar.finish_and_clear();
        writeln!(
            out,
            "| the bias of an instrument | fixes without a change | false alarms | fixes between them | step of 2 sigma: fixes, median (knowing it) | \
             ramp of 3 sigma in 100 fixes (knowing it) | alarms before the step |\n|---|---|---|---|---|---|---|"
        )?;
        for row in &rows {
            let Row {
                instrument,
                fixes_watched,
                false_alarms,
                fixes_between_false_alarms,
                step_fixes,
                ramp_fixes,
                step_fixes_known,
                ramp_fixes_known,
                early,
                logs,
            } = row;
            let sign = if *false_alarms == 0 { "> " } else { "" };
            writeln!(
                out,
                "| {instrument} | {fixes_watched} | {false_alarms} | {sign}{fixes_between_false_alarms:.0} | {step_fixes:.0} ({step_fixes_known:.0}) | \
                 {ramp_fixes:.0} ({ramp_fixes_known:.0}) | {early} of {logs} |"
            )?;
        }
        Ok(rows)
    }

    /// At least a thousand fixes between false alarms; of the still instrument a step of two sigma within 8 fixes, a ramp of three within 50.
    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let missed = rows.iter().find(|row| row.fixes_between_false_alarms < ALARM);
        let late = rows.first().filter(|row| !(row.step_fixes <= 8.0 && row.ramp_fixes <= 50.0));
        match missed.or(late) {
            Some(row) => Err(Failure::Refused(format!("beyond its limits: {}", row.instrument))),
            None => Ok(()),
        }
    }
}

/// A log of one signal.
struct Drawn {
    signal: Signal,
    switched: Vec<bool>,
}

impl Drawn {
    fn new(seed: u64, count: usize, wander: f64, switch: f64, change: impl Fn(usize) -> f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || {
            let (u, v): (f64, f64) = (rng.random(), rng.random());
            (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos()
        };
        let switched: Vec<bool> = (0..count).map(|fix| fix > 0 && fix % 5 == 0).collect();
        let (mut bias, mut offset) = (0.0, 0.0);
        let values = (0..count)
            .map(|fix| {
                bias += wander * normal();
                if fix == 0 || switched[fix] {
                    offset = switch * normal();
                }
                bias + offset + normal() + change(fix)
            })
            .collect();
        Self { signal: Signal { kind: Kind::Bias, values }, switched }
    }

    /// Fixes that were watched, and the place of the alarm.
    fn watch(&self) -> (usize, Option<usize>) {
        let watch = watch(std::slice::from_ref(&self.signal), &self.switched, None);
        (watch.watched, watch.alarm)
    }

    /// The alarm of the test that knows the sizes of noise, wander, switch-on and change, but not when it comes.
    fn known(&self, wander: f64, switch: f64, change: fn(usize) -> f64) -> Option<usize> {
        let filter = Filter::new(&self.switched, wander, switch);
        let mut own = [0.0; 2];
        let mut starts: Vec<([f64; 2], f64)> = Vec::new();
        self.signal.values.iter().enumerate().find_map(|(at, &value)| {
            let innovation = filter.innovation(at, &mut own, value);
            if at < BASELINE {
                return None;
            }
            starts.push(([0.0; 2], 0.0));
            let count = starts.len();
            let mut sum = 0.0;
            for (start, (state, log)) in starts.iter_mut().enumerate() {
                // What the change makes of the innovation.
                let mean = filter.innovation(at, state, change(count - start));
                *log += mean * innovation - 0.5 * mean * mean;
                sum += log.exp();
            }
            (sum >= ALARM).then_some(at)
        })
    }
}

/// A Kalman filter of a bias that wanders and an offset that every switch-on draws anew, below noise of variance 1; both begin at zero, the offset with its spread.
struct Filter {
    fixes: Vec<OfFix>,
}

struct OfFix {
    is_switched_on: bool,
    gain: [f64; 2],
    /// One over the standard deviation of the innovation.
    inverse: f64,
}

impl Filter {
    fn new(switched: &[bool], wander: f64, switch: f64) -> Self {
        // Variances of bias and offset, and their covariance.
        let (mut bias, mut offset, mut both) = (0.0, 0.0, 0.0);
        let of_fix = |(fix, &switched): (usize, &bool)| {
            let is_switched_on = switched || fix == 0;
            bias += wander * wander;
            if is_switched_on {
                (offset, both) = (switch * switch, 0.0);
            }
            let [of_bias, of_offset] = [bias + both, both + offset];
            let variance = of_bias + of_offset + 1.0;
            bias -= of_bias * of_bias / variance;
            offset -= of_offset * of_offset / variance;
            both -= of_bias * of_offset / variance;
            OfFix { is_switched_on, gain: [of_bias / variance, of_offset / variance], inverse: 1.0 / variance.sqrt() }
        };
        Self { fixes: switched.iter().enumerate().map(of_fix).collect() }
    }

    /// What is new in the value of a fix, in its standard deviations; `state` is what is known of bias and offset, and is after it.
    fn innovation(&self, fix: usize, state: &mut [f64; 2], value: f64) -> f64 {
        let of_fix = &self.fixes[fix];
        if of_fix.is_switched_on {
            state[1] = 0.0;
        }
        let innovation = value - state[0] - state[1];
        state.iter_mut().zip(of_fix.gain).for_each(|(state, gain)| *state += gain * innovation);
        innovation * of_fix.inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, without wander and with offsets of variance 3: the first fix has the variance 4, a value of 2 is one standard deviation, and the offset is then 3/4
    /// of it, 1.5, with a variance of 3 − 9/4 = 3/4. The second, 1.5 + √1.75, is one of √(3/4 + 1) beyond it. The third is switched on anew: 2 is one of 4 again.
    #[test]
    fn innovations_by_hand() {
        let filter = Filter::new(&[false, false, true], 0.0, 3f64.sqrt());
        let mut state = [0.0; 2];
        for (fix, value) in [2.0, 1.5 + 1.75f64.sqrt(), 2.0].into_iter().enumerate() {
            let innovation = filter.innovation(fix, &mut state, value);
            assert!((innovation - 1.0).abs() < 1e-12, "{fix}: {innovation}");
        }
        // A bias that wanders by 1 has the variance 1 in the first fix and the gain 1/2: 1/2 is left, and 3/2 before the second, whose variance is 5/2.
        let filter = Filter::new(&[false, false], 1.0, 0.0);
        assert!((filter.fixes[1].gain[0] - 0.6).abs() < 1e-12 && filter.fixes[1].gain[1] == 0.0);
    }
}
