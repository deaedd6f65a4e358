//! What stands between a signal and its shape: nothing, or a system with a memory.

/// A dynamics; widths and thresholds in standard deviations of the signal, times in s.
#[derive(Debug, Clone, PartialEq)]
pub enum Dynamics {
    None,
    LowPass {
        tau_s: f64,
    },
    /// Rate of change behind a low-pass.
    Rate {
        tau_s: f64,
    },
    Delay {
        seconds: usize,
    },
    /// Backlash of this whole width.
    Play {
        width: f64,
    },
    /// −1 or +1: +1 above `centre + width/2`, −1 below `centre − width/2`, as before in between.
    Relay {
        centre: f64,
        width: f64,
    },
    GreatestSoFar,
    /// Value less its low-pass.
    Memory {
        tau_s: f64,
    },
    /// Low-pass of the square.
    Heat {
        tau_s: f64,
    },
    /// Outside the grammar from here. Second order with this period and damping.
    SecondOrder {
        period_s: f64,
        damping: f64,
    },
    /// Relays with random thresholds together.
    Preisach {
        relays: Vec<[f64; 3]>,
    },
    /// A bristle (Dahl): it follows the motion and gives way at ±1, with an exponent.
    Bristle {
        stiffness: f64,
        exponent: f64,
    },
    /// A low-pass that rises and falls with different times.
    TwoTimes {
        rise_s: f64,
        fall_s: f64,
    },
    /// A low-pass whose time constant grows with its own value: τ · exp(gain · value).
    VaryingLag {
        tau_s: f64,
        gain: f64,
    },
    /// Power-law memory: low-passes of many times with weights τ^(−exponent), between two times.
    PowerLaw {
        exponent: f64,
        shortest_s: f64,
        longest_s: f64,
    },
    /// An oscillation whose frequency follows the value: sin ∫ 2π/period · (1 + gain · value).
    Oscillator {
        period_s: f64,
        gain: f64,
    },
    /// A low-pass that goes on from run to run; between them it decays to `rest` with the same time.
    Across {
        tau_s: f64,
    },
}

/// Low-passes that stand for a power law.
const DECADE_PARTS: usize = 12;

impl Dynamics {
    pub(super) fn is_outside(&self) -> bool {
        matches!(
            self,
            Self::SecondOrder { .. }
                | Self::Preisach { .. }
                | Self::Bristle { .. }
                | Self::TwoTimes { .. }
                | Self::VaryingLag { .. }
                | Self::PowerLaw { .. }
                | Self::Oscillator { .. }
                | Self::Across { .. }
        )
    }

    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::None => "none",
            Self::LowPass { .. } => "low-pass",
            Self::Rate { .. } => "rate-low-pass",
            Self::Delay { .. } => "delay",
            Self::Play { .. } => "play",
            Self::Relay { .. } => "relay",
            Self::GreatestSoFar => "greatest",
            Self::Memory { .. } => "memory",
            Self::Heat { .. } => "heat",
            Self::SecondOrder { .. } => "second-order",
            Self::Preisach { .. } => "preisach",
            Self::Bristle { .. } => "friction",
            Self::TwoTimes { .. } => "two-times",
            Self::VaryingLag { .. } => "varying-lag",
            Self::PowerLaw { .. } => "power-law",
            Self::Oscillator { .. } => "oscillator",
            Self::Across { .. } => "across-runs",
        }
    }

    /// What comes out, one value a second, of a standardised course. Every state begins settled at the first value, but
    /// that of [`Self::Across`], which begins at `before` (the value of its state at the end of the run before, decayed).
    pub(super) fn apply(&self, course: &[f64], before: f64) -> Vec<f64> {
        let first = course.first().copied().unwrap_or_default();
        let low_pass = |tau_s: f64, from: f64, of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let gain = 1.0 - (-1.0 / tau_s).exp();
            let mut state = from;
            let step = |value: &f64| {
                state += gain * (of(*value) - state);
                state
            };
            course.iter().map(step).collect()
        };
        let same = |value: f64| value;
        match self {
            Self::None => course.to_vec(),
            Self::LowPass { tau_s } => low_pass(*tau_s, first, &same),
            Self::Across { tau_s } => low_pass(*tau_s, before, &same),
            Self::Rate { tau_s } => {
                let slow = low_pass(*tau_s, first, &same);
                course.iter().zip(slow).map(|(value, slow)| (value - slow) / tau_s).collect()
            }
            Self::Memory { tau_s } => {
                let slow = low_pass(*tau_s, first, &same);
                course.iter().zip(slow).map(|(value, slow)| value - slow).collect()
            }
            Self::Heat { tau_s } => low_pass(*tau_s, first * first, &|value| value * value),
            Self::Delay { seconds } => {
                (0..course.len()).map(|second| course[second.saturating_sub(*seconds)]).collect()
            }
            Self::Play { width } => {
                running(course, first, |state, value| state.clamp(value - 0.5 * width, value + 0.5 * width))
            }
            Self::Relay { centre, width } => {
                let from = if first > *centre { 1.0 } else { -1.0 };
                running(course, from, |state, value| relay(state, value, centre - 0.5 * width, centre + 0.5 * width))
            }
            Self::GreatestSoFar => running(course, first, f64::max),
            Self::SecondOrder { period_s, damping } => second_order(course, *period_s, *damping),
            Self::Preisach { relays } => {
                let mut sum = vec![0.0; course.len()];
                for &[low, high, weight] in relays {
                    let from = if first > 0.5 * (low + high) { 1.0 } else { -1.0 };
                    let one = running(course, from, |state, value| relay(state, value, low, high));
                    sum.iter_mut().zip(one).for_each(|(sum, value)| *sum += weight * value);
                }
                sum
            }
            Self::Bristle { stiffness, exponent } => {
                let mut last = first;
                running(course, 0.0, |state, value| {
                    bristle(state, value - std::mem::replace(&mut last, value), *stiffness, *exponent)
                })
            }
            Self::TwoTimes { rise_s, fall_s } => running(course, first, |state, value| {
                let tau_s = if value > state { rise_s } else { fall_s };
                state + (1.0 - (-1.0 / tau_s).exp()) * (value - state)
            }),
            Self::VaryingLag { tau_s, gain } => running(course, first, |state, value| {
                let tau_s = tau_s * (gain * state).clamp(-3.0, 3.0).exp();
                state + (1.0 - (-1.0 / tau_s).exp()) * (value - state)
            }),
            Self::PowerLaw { exponent, shortest_s, longest_s } => {
                let mut sum = vec![0.0; course.len()];
                for part in 0..DECADE_PARTS {
                    let place = part as f64 / (DECADE_PARTS - 1) as f64;
                    let tau_s = shortest_s * (longest_s / shortest_s).powf(place);
                    let weight = (tau_s / shortest_s).powf(-exponent);
                    let one = low_pass(tau_s, first, &same);
                    sum.iter_mut().zip(one).for_each(|(sum, value)| *sum += weight * value);
                }
                course.iter().zip(sum).map(|(value, sum)| value * DECADE_PARTS as f64 - sum).collect()
            }
            Self::Oscillator { period_s, gain } => {
                let mut phase = 0.0;
                let step = |value: &f64| {
                    phase += std::f64::consts::TAU / period_s * (1.0 + gain * value);
                    phase.sin()
                };
                course.iter().map(step).collect()
            }
        }
    }
}

fn running(course: &[f64], from: f64, mut next: impl FnMut(f64, f64) -> f64) -> Vec<f64> {
    let mut state = from;
    let step = |value: &f64| {
        state = next(state, *value);
        state
    };
    course.iter().map(step).collect()
}

fn relay(state: f64, value: f64, low: f64, high: f64) -> f64 {
    match value {
        _ if value > high => 1.0,
        _ if value < low => -1.0,
        _ => state,
    }
}

/// Dahl's friction: dz = σ · |1 − z · sgn v|ⁿ · sgn(1 − z · sgn v) dx, in steps that no motion can overrun.
fn bristle(state: f64, motion: f64, stiffness: f64, exponent: f64) -> f64 {
    const STEPS: usize = 8;
    let part = stiffness * motion / STEPS as f64;
    (0..STEPS).fold(state, |state, _| {
        let slack = 1.0 - state * motion.signum();
        (state + part * slack.abs().powf(exponent) * slack.signum()).clamp(-1.0, 1.0)
    })
}

/// ẍ = ω²(u − x) − 2 ζ ω ẋ, settled at the beginning, in ten steps a second (semi-implicit Euler).
fn second_order(course: &[f64], period_s: f64, damping: f64) -> Vec<f64> {
    const STEPS: usize = 10;
    let omega = std::f64::consts::TAU / period_s;
    let step_s = 1.0 / STEPS as f64;
    let (mut place, mut speed) = (course.first().copied().unwrap_or_default(), 0.0);
    let step = |value: &f64| {
        for _ in 0..STEPS {
            speed += step_s * (omega * omega * (value - place) - 2.0 * damping * omega * speed);
            place += step_s * speed;
        }
        place
    };
    course.iter().map(step).collect()
}
