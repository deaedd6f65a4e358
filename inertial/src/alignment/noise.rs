//! What may disturb a window, and how likely each is: white velocity, white force, white rate; all the time, or in loud seconds; and
//! what its base does.

use quantities::units::RAD_PER_DEG;

/// Densities of the rate's noise that are tried, from the least up, °/√h, each √2 times the one before: sigma is right to 19 % at the least.
const LEAST_DEG_SQRT_H: f64 = 2e-5;
pub(super) const DENSITIES: usize = 39;
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
    const OF_VELOCITY: Self = Self { velocity: 1.0, force: 0.0, rate: 0.0, local: true };
    /// A base that stands, with noise of the accelerometers.
    const OF_FORCE: Self = Self { velocity: NEXT_TO_NOTHING, force: FORCE_ALONE, ..Self::OF_VELOCITY };
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

/// How a base turns.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Base {
    /// To and fro, in variances of a block as its third differences tell them.
    pub(super) jitter: f64,
    /// Density of its random walk, rad²/s.
    pub(super) walk_rad2_s: f64,
    /// Of a steady drift, one sigma, rad/s.
    pub(super) drift_rad_s: f64,
}

/// Jitters that are tried. White noise of the rate has third differences too, of a third of its variance in a block.
const JITTERS: [f64; 2] = [0.0, 1.0];
/// Walks that are tried, arcsec/√s: from the least, which turns 0.6″ in an hour, each √10 times the one before, to one that leaves
/// nothing to know.
const LEAST_WALK_ARCSEC: f64 = 1e-2;
const WALKS: usize = 11;
const ROOT_OF_TEN: f64 = 3.1622776601683795;
/// Drifts that are tried, °/h: from the least, 0.01° of heading at the equator, each ten times the one before, to one that accelerometers
/// of 1 mg see in a minute.
const LEAST_DRIFT_DEG_H: f64 = 3e-3;
const DRIFTS: usize = 4;
/// A walk of less than so many times the variance of the gyros' noise cannot be told from it, and is taken for it.
const LEAST_WALK: f64 = 10.0;
/// Bases that are tried.
pub(super) const BASES: usize = JITTERS.len() * (1 + WALKS + DRIFTS);
/// Probabilities before a window is seen, together one: of a base without walk and without drift, of each walk, and of the least drift.
/// A drift is the less likely the greater it is: thermal tilt of a tripod is 10″ in an hour, soft ground some 10″ in a minute, and with
/// equal chances accelerometers that cannot exclude 3 °/h would spoil every short window of a base that stands.
const STANDS: f64 = 0.5;
const EACH_WALK: f64 = 0.04;
const LEAST_DRIFT: f64 = 0.054;

impl Base {
    /// One of which the gyros tell nothing.
    pub(super) const FREE: Self = Self { jitter: 1.0, walk_rad2_s: 1e-3, drift_rad_s: 0.0 };

    /// All beside gyros of that density of noise, each with the log of its probability beforehand.
    pub(super) fn all(rate: f64) -> impl Iterator<Item = (Self, f64)> {
        let walk = |number: usize| LEAST_WALK_ARCSEC * libm::pow(ROOT_OF_TEN, number as f64) * RAD_PER_DEG / 3600.0;
        let drift = |number: usize| LEAST_DRIFT_DEG_H * libm::pow(10.0, number as f64) * RAD_PER_DEG / 3600.0;
        let motions = move |number: usize| match number.checked_sub(1) {
            None => (0.0, 0.0, STANDS),
            Some(walks) if walks < WALKS => (walk(walks) * walk(walks), 0.0, EACH_WALK),
            Some(others) => (0.0, drift(others - WALKS), LEAST_DRIFT * libm::pow(0.1, (others - WALKS) as f64)),
        };
        let all = JITTERS.into_iter().flat_map(move |jitter| {
            (0..BASES / JITTERS.len()).map(move |number| {
                let (walk_rad2_s, drift_rad_s, probability) = motions(number);
                (Self { jitter, walk_rad2_s, drift_rad_s }, libm::log(probability))
            })
        });
        all.filter(move |(base, _)| base.walk_rad2_s == 0.0 || base.walk_rad2_s >= LEAST_WALK * rate)
    }
}

/// What is known of the gyros' noise: it is the same in all windows of a recording, that of the base is not.
#[expect(clippy::large_enum_variant, reason = "there is no heap, and one value for a recording")]
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
    (0..DENSITIES).map(|k| density(LEAST_DEG_SQRT_H * libm::exp2(0.5 * k as f64)))
}

/// Of log likelihoods, everything as likely beforehand.
pub(super) fn probabilities(log_likelihoods: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let evidence = log_sum(log_likelihoods.iter().copied());
    log_likelihoods.iter().map(move |log| libm::exp(log - evidence))
}

/// Log of the sum of what these are the logs of.
pub(super) fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    most + libm::log(logs.map(|log| libm::exp(log - most)).sum())
}

/// (rad/s)²/Hz: 1 °/√h is 1/60 °/√s.
fn density(deg_per_sqrt_h: f64) -> f64 {
    let rad_per_sqrt_s = deg_per_sqrt_h * RAD_PER_DEG / 60.0;
    rad_per_sqrt_s * rad_per_sqrt_s
}
