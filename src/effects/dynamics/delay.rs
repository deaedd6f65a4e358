//! A delay.

use serde::{Deserialize, Serialize};
use quantities::limits::{Invalid, within};

use super::{Dynamics, DynamicsPart, STATES, State};
use crate::effects::part::{Constant, Constants, Span, constants};

/// The signal as it was `tau_s` ago: means over sixths of that time are kept, and the two about the time in question interpolated. A second is
/// spread by a twelfth of `tau_s`, root mean square. What was before the first value is that value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Delay {
    /// Time constant, seconds.
    pub tau_s: f32,
}

/// Means that are kept, the latest first: two more than there are in the delay, for the one that is not complete and for the middle of a second.
const KEPT: usize = STATES - 2;
/// Places in the state behind them: sum over the mean that is not complete, times its time so far; and that time, seconds.
const SUM: usize = KEPT;
const TIME_S: usize = KEPT + 1;
/// Share of its time from which on a mean is complete: what lacks is rounding.
const COMPLETE: f64 = 1.0 - 1e-9;

impl Delay {
    /// What the search begins with.
    pub fn starts(span: &Span, each: &mut dyn FnMut(Dynamics)) {
        span.time_constants_s().for_each(|tau_s| each(Self { tau_s: tau_s as f32 }.into()));
    }
}

impl DynamicsPart for Delay {
    fn step(&self, state: &mut State, value: f64, step_s: f64) -> f64 {
        let length_s = f64::from(self.tau_s) / (KEPT - 2) as f64;
        let mut next = state.unwrap_or_else(|| {
            let mut first = [value; STATES];
            (first[SUM], first[TIME_S]) = (0.0, 0.0);
            first
        });
        // Of a step longer than all that is kept the rest matters.
        let mut rest_s = step_s.min(length_s * STATES as f64);
        while rest_s > 0.0 {
            let part_s = rest_s.min(length_s - next[TIME_S]);
            rest_s -= part_s;
            next[SUM] += value * part_s;
            next[TIME_S] += part_s;
            if next[TIME_S] >= length_s * COMPLETE {
                let [a, b, c, d, e, f, g, _, sum, time_s] = next;
                next = [sum / time_s, a, b, c, d, e, f, g, 0.0, 0.0];
            }
        }
        *state = Some(next);
        // From the middle of the last complete mean back to `tau_s` before the middle of this step.
        let back_s = f64::from(self.tau_s) + 0.5 * step_s - next[TIME_S] - 0.5 * length_s;
        let place = (back_s / length_s).clamp(0.0, (KEPT - 1) as f64);
        let (whole, part) = (libm::floor(place), place - libm::floor(place));
        let kept = |number: usize| next.get(number.min(KEPT - 1)).copied().unwrap_or(value);
        kept(whole as usize) * (1.0 - part) + kept(whole as usize + 1) * part
    }

    fn name(&self) -> &'static str {
        "delay"
    }

    fn constants(&self) -> Constants {
        constants([Constant::scale("tau_s", self.tau_s)])
    }

    fn set(&mut self, _: usize, value: f64) {
        self.tau_s = value as f32;
    }

    fn validate(&self) -> Result<(), Invalid> {
        within("model.effects.factors.dynamics.delay.tau_s", self.tau_s.into(), 0.01, 1e6, "0.01 to 1000000")
    }

    fn is_linear(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delayed(tau_s: f32, signal: impl Fn(f64) -> f64, seconds: u32) -> std::vec::Vec<f64> {
        let (mut state, delay) = (None, Delay { tau_s });
        (0..seconds).map(|i| delay.step(&mut state, signal(i.into()), if i == 0 { 0.0 } else { 1.0 })).collect()
    }

    /// A ramp comes out as late as it should, to the rounding: means of a straight line lie on it.
    #[test]
    fn a_ramp_comes_late() {
        for tau_s in [3.0, 12.0, 40.0] {
            let found = delayed(tau_s, |t_s| 2.0 * t_s, 200);
            for (t_s, value) in found.iter().enumerate().skip(80) {
                assert!((value - 2.0 * (t_s as f64 - f64::from(tau_s))).abs() < 0.51, "{tau_s} {t_s}: {value}");
            }
        }
        // Of a whole number of seconds a mean the ramp is exact.
        let found = delayed(12.0, |t_s| 2.0 * t_s, 100);
        assert!((found[90] - 2.0 * 78.0).abs() < 1e-9, "{}", found[90]);
    }

    /// A step comes out whole, after the delay, spread by no more than a third of it; before it there is nothing of it.
    #[test]
    fn a_step_comes_late() {
        let found = delayed(60.0, |t_s| if t_s >= 100.0 { 1.0 } else { 0.0 }, 300);
        assert!(found[..140].iter().all(|value| value.abs() < 1e-12));
        assert!(found[181..].iter().all(|value| (value - 1.0).abs() < 1e-12));
        let middle = found.iter().position(|value| *value >= 0.5);
        assert!(middle.is_some_and(|middle| middle.abs_diff(160) <= 1), "{middle:?}");
    }
}
