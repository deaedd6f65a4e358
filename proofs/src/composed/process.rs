//! What goes on in a run of its own accord: no channel shows it, and no two runs have it alike.

use std::f64::consts::TAU;

use crate::hidden::draw::Draw;

/// A process of mean 0 and variance 1 (a random walk: variance 1 at the end of the run).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Process {
    /// Two levels, with this mean time between changes.
    Telegraph {
        mean_s: f64,
    },
    /// Sum of exponentially correlated processes with times from 4 s on, each four times the one before.
    Flicker,
    /// Decaying pulses at random times, with random heights.
    Bursts {
        between_s: f64,
        tau_s: f64,
    },
    RandomWalk,
    /// A resonance that random shocks excite.
    Ringing {
        period_s: f64,
        tau_s: f64,
    },
}

const FLICKER_S: [f64; 5] = [4.0, 16.0, 64.0, 256.0, 1024.0];

impl Process {
    pub(super) fn any(draw: &mut Draw) -> Self {
        match draw.whole(0, 4) {
            0 => Self::Telegraph { mean_s: draw.log_uniform(20.0, 400.0) },
            1 => Self::Flicker,
            2 => Self::Bursts { between_s: draw.log_uniform(30.0, 300.0), tau_s: draw.log_uniform(3.0, 80.0) },
            3 => Self::RandomWalk,
            _ => Self::Ringing { period_s: draw.log_uniform(10.0, 300.0), tau_s: draw.log_uniform(30.0, 1000.0) },
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Telegraph { .. } => "telegraph",
            Self::Flicker => "flicker",
            Self::Bursts { .. } => "bursts",
            Self::RandomWalk => "random-walk",
            Self::Ringing { .. } => "ringing",
        }
    }

    /// Covariance of its values at two times of a run of `length_s`.
    pub(super) fn covariance(self, first_s: f64, other_s: f64, length_s: f64) -> f64 {
        let apart_s = (first_s - other_s).abs();
        match self {
            // An even number of changes: (1 + e^(−2λΔ))/2, an odd one: the rest; ±1.
            Self::Telegraph { mean_s } => (-2.0 * apart_s / mean_s).exp(),
            Self::Flicker => {
                FLICKER_S.iter().map(|tau_s| (-apart_s / tau_s).exp()).sum::<f64>() / FLICKER_S.len() as f64
            }
            Self::Bursts { tau_s, .. } => (-apart_s / tau_s).exp(),
            Self::RandomWalk => first_s.min(other_s) / length_s,
            Self::Ringing { period_s, tau_s } => (-apart_s / tau_s).exp() * (TAU * apart_s / period_s).cos(),
        }
    }

    /// A realisation, one value a second.
    pub(super) fn course(self, draw: &mut Draw, seconds: usize) -> Vec<f64> {
        match self {
            Self::Telegraph { mean_s } => {
                let change = 0.5 * (1.0 - (-2.0 / mean_s).exp());
                let mut level = draw.sign();
                let step = |_| {
                    if draw.chance(change) {
                        level = -level;
                    }
                    level
                };
                (0..seconds).map(step).collect()
            }
            Self::Flicker => {
                let mut sum = vec![0.0; seconds];
                for tau_s in FLICKER_S {
                    let one = rotating(draw, tau_s, 0.0, seconds);
                    sum.iter_mut().zip(one).for_each(|(sum, value)| *sum += value / (FLICKER_S.len() as f64).sqrt());
                }
                sum
            }
            Self::Bursts { between_s, tau_s } => {
                // Campbell: pulses a·e^(−t/τ) at a rate λ, a of mean 0 and variance 1, have the variance λτ/2; a second's
                // grid has λ/(1 − e^(−2/τ)).
                let kept = (-1.0 / tau_s).exp();
                let spread = ((1.0 / between_s) / (1.0 - kept * kept)).sqrt();
                let lead_in = (8.0 * tau_s) as usize;
                let mut state = 0.0;
                let step = |_| {
                    state *= kept;
                    if draw.chance(1.0 / between_s) {
                        state += draw.normal();
                    }
                    state / spread
                };
                (0..lead_in + seconds).map(step).skip(lead_in).collect()
            }
            Self::RandomWalk => {
                let mut state = 0.0;
                let step = |_| {
                    state += draw.normal() / (seconds as f64).sqrt();
                    state
                };
                (0..seconds).map(step).collect()
            }
            Self::Ringing { period_s, tau_s } => rotating(draw, tau_s, TAU / period_s, seconds),
        }
    }
}

/// One coordinate of a plane that turns at `omega` while both coordinates decay and are excited alike: stationary, of
/// variance 1, with the covariance e^(−Δ/τ) cos ωΔ.
fn rotating(draw: &mut Draw, tau_s: f64, omega: f64, seconds: usize) -> Vec<f64> {
    let kept = (-1.0 / tau_s).exp();
    let drive = (1.0 - kept * kept).sqrt();
    let (sin, cos) = omega.sin_cos();
    let mut at = [draw.normal(), draw.normal()];
    let step = |_| {
        let [x, y] = at;
        at = [kept * (cos * x - sin * y) + drive * draw.normal(), kept * (sin * x + cos * y) + drive * draw.normal()];
        at[0]
    };
    (0..seconds).map(step).collect()
}
