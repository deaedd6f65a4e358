//! What may disturb a window, and how likely each is: white velocity, white force, white rate; all the time, or in loud seconds.

use crate::units::RAD_PER_DEG;

/// Densities of the rate's noise that are tried, from the least up, °/√h, each twice the one before.
const LEAST_DEG_SQRT_H: f64 = 2e-5;
pub(super) const DENSITIES: usize = 20;
/// Variances of the velocity that the force's noise adds in a block, in those of the block's own velocity.
const SHARES: [f64; 5] = [0.0, 0.1, 0.3, 1.0, 3.0];
/// … and where there is no other: third differences of block means of a sum of white noise have 8/3 of the variance that it adds
/// in a block (means of neighbours are correlated by a quarter), not 20.
const FORCE_ALONE: f64 = 7.5;
/// What then stands for the velocity's own noise, in its variance.
const NEXT_TO_NOTHING: f64 = 1e-3;
/// Mixtures of velocity and force, each for all blocks as loud and for each with a loudness of its own …
const MIXTURES: usize = SHARES.len() + 1;
/// … and so many times as loud as the third differences say: thirty of them tell a variance to a quarter.
const LOUDNESSES: [f64; 3] = [0.6, 1.0, 1.6];

/// Candidates for each density.
pub(super) const CANDIDATES: usize = 2 * MIXTURES * LOUDNESSES.len();

/// Noise of a window. The first two are in variances of a block's velocity as its third differences tell them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    /// Velocity of the base, white.
    pub(super) velocity: f64,
    /// Specific force, white: what it adds to the velocity in a block.
    pub(super) force: f64,
    /// Density of the rate's noise, (rad/s)²/Hz.
    pub(super) rate: f64,
    /// Whether every block has a loudness of its own, or all have the mean.
    pub(super) local: bool,
}

impl Noise {
    /// A base that comes back to where it was.
    pub(super) const OF_VELOCITY: Self = Self { velocity: 1.0, force: 0.0, rate: 0.0, local: true };
    /// A base that stands, with noise of the accelerometers.
    pub(super) const OF_FORCE: Self = Self { velocity: NEXT_TO_NOTHING, force: FORCE_ALONE, ..Self::OF_VELOCITY };
    /// Between both.
    pub(super) const OF_BOTH: Self = Self { force: 0.3, ..Self::OF_VELOCITY };

    /// The candidates with a density.
    pub(super) fn candidates(rate: f64) -> impl Iterator<Item = Self> {
        (0..CANDIDATES).map(move |number| {
            let share = SHARES.get(number % MIXTURES);
            let mixture = share.map_or(Self::OF_FORCE, |share| Self { force: *share, ..Self::OF_VELOCITY });
            let loud = LOUDNESSES.get(number / MIXTURES % LOUDNESSES.len()).copied().unwrap_or(1.0);
            let local = number < CANDIDATES / 2;
            Self { velocity: mixture.velocity * loud, force: mixture.force * loud, rate, local }
        })
    }
}

/// What is known of the gyros' noise: it is the same in all windows of a recording, that of the base is not.
#[derive(Clone, Debug, PartialEq)]
pub enum NoiseOfRate {
    /// Exactly this, °/√h: from a data sheet.
    Declared(f64),
    /// Log likelihood of each density that is tried.
    Learned([f64; DENSITIES]),
}

impl NoiseOfRate {
    /// With that of another window of the recording; what is declared stays.
    pub fn with(mut self, other: &Self) -> Self {
        if let (Self::Learned(mine), Self::Learned(others)) = (&mut self, other) {
            for (a, b) in mine.iter_mut().zip(others) {
                *a += b;
            }
        }
        self
    }

    /// Densities, (rad/s)²/Hz, with their probabilities; every ratio is as likely beforehand.
    pub(super) fn densities(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let (declared, learned) = match self {
            Self::Declared(deg_per_sqrt_h) => (Some((density(*deg_per_sqrt_h), 1.0)), None),
            Self::Learned(likelihoods) => (None, Some(tried().zip(probabilities(likelihoods)))),
        };
        declared.into_iter().chain(learned.into_iter().flatten())
    }

    /// Mean density, (rad/s)²/Hz.
    pub(super) fn mean_density(&self) -> f64 {
        self.densities().map(|(rate, probability)| rate * probability).sum()
    }

    /// Root of the mean density, °/√h.
    pub fn deg_per_sqrt_h(&self) -> f64 {
        libm::sqrt(self.mean_density()) * 60.0 / RAD_PER_DEG
    }
}

/// Densities that are tried, (rad/s)²/Hz.
pub(super) fn tried() -> impl Iterator<Item = f64> {
    (0..DENSITIES).map(|k| density(LEAST_DEG_SQRT_H * libm::exp2(k as f64)))
}

/// Of log likelihoods, everything as likely beforehand.
pub(super) fn probabilities(log_likelihoods: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let evidence = log_sum(log_likelihoods);
    log_likelihoods.iter().map(move |log| libm::exp(log - evidence))
}

/// Log of the sum of what these are the logs of.
pub(super) fn log_sum(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most + libm::log(logs.iter().map(|log| libm::exp(log - most)).sum())
}

/// (rad/s)²/Hz: 1 °/√h is 1/60 °/√s.
fn density(deg_per_sqrt_h: f64) -> f64 {
    let rad_per_sqrt_s = deg_per_sqrt_h * RAD_PER_DEG / 60.0;
    rad_per_sqrt_s * rad_per_sqrt_s
}
