//! The base tilted, or its accelerometers drifted: several laws are supposed, and weighed by how probable they make levels and rates.
//!
//! Levels that change over a fix are a base that tilts, which turns the gyro too, or accelerometers that drift, of which the gyro knows nothing.
//! A constant share of it cannot be told apart within a fix, because a steady tilt rate is a first harmonic of the index angle as the azimuth is.
//! So it is generalised least squares: the declared drift stands beside the path of the base in the levels, what stays uncertain of the
//! path stands in the weights of the rates, and the azimuth is the mean of what each supposition gives, its sigma with what lies between
//! them.

use crate::effects::ErrorModel;
use crate::fix::base_motion::{self, BaseMotion, Method, Supposed};
use crate::fix::cause::Cause;
use crate::fix::doubt::MOST;
use crate::fix::dwell::DwellSummary;
use crate::fix::solution::{Solved, solved_for};
use crate::fix::{Declared, Fix, Unsolvable};
use crate::health::Flag;
use crate::units::{wrap_180_deg, wrap_360_deg};

/// Logarithm of a ratio of likelihoods that decides: three standard deviations, 3²/2.
const DECIDED: f64 = 4.5;

/// An accelerometer that drifts by more than is declared, whatever the reason, in one fix of 10⁵: the logarithm. However much likelier the levels
/// alone make a base that moved, it is no likelier than that they are wrong.
const FAULTY: f64 = 11.5;

/// For sigma a base that stands is less probable by this factor, as a logarithm: 400. A creep with the time constant of the warming looks as the drift
/// does, and in half of all fixes nothing but the supposition that a base rather stands decides; where it crept, the azimuth is off by what was not
/// taken out. Experiment, 1000 fixes each (`fix::motion::tests`, with a creep of 25 and of 60 arcsec and 0.05 mg/K): inside 95 % are with a factor of
/// 1, 8 and 400: 80, 88 and 96 %, and 83, 89 and 93 %. A base that stands pays for it: with its accelerometers warming up, sigma is 0.07°, 0.11° and 0.20°.
const STANDS_LESS: f64 = 6.0;

/// The solution where the levels changed; `None` where dwells or levels are not such that both can be weighed. Never inlined: the paths would stand on the
/// stack of every fix.
#[inline(never)]
pub(super) fn solve(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    cause: Cause,
) -> Option<Result<Fix, Unsolvable>> {
    if dwells.len() > MOST {
        return None;
    }
    let paths = base_motion::beside_drift(dwells, declared.level_drift);
    let suppose = |path| solved_for(dwells, declared, model, BaseMotion::Moving(Method::Path(path)), cause);
    let standing = suppose(paths.first()?.path.standing());
    // By how much more probable the levels alone make it that the base moved.
    let of_levels = log_sum(paths.iter().map(|supposed| supposed.log_likelihood));
    let beyond = (of_levels - FAULTY).max(0.0);
    let (mut all, mut doubting) = (Weighed::default(), Weighed::default());
    if let Ok(Solved { mut fix, log_likelihood }) = standing {
        if of_levels > DECIDED {
            fix.flags.insert(Flag::LevelDrift);
        }
        all.add(&fix, log_likelihood);
        doubting.add(&fix, log_likelihood - STANDS_LESS);
    }
    for Supposed { path, log_likelihood: of_levels } in &paths {
        if let Ok(Solved { mut fix, log_likelihood }) = suppose(*path) {
            // Rates that do not fit a base that moved so, nor any that stood.
            if fix.flags.contains(Flag::Misfit) {
                fix.flags.insert(Flag::LevelDrift);
            }
            all.add(&fix, log_likelihood + of_levels - beyond);
            doubting.add(&fix, log_likelihood + of_levels - beyond);
        }
    }
    let found = all.mean().zip(doubting.mean()).map(|(found, doubted)| {
        let apart_deg = wrap_180_deg(doubted.azimuth_deg - found.azimuth_deg);
        Fix { sigma_deg: libm::hypot(doubted.sigma_deg, apart_deg), ..found }
    });
    Some(found.ok_or_else(|| standing.err().unwrap_or(Unsolvable::NoSignal)))
}

/// Logarithm of the sum of what these are the logarithms of.
fn log_sum(logarithms: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = logarithms.clone().fold(f64::NEG_INFINITY, f64::max);
    most + libm::log(logarithms.map(|each| libm::exp(each - most)).sum())
}

/// Fixes, each weighed by its likelihood.
#[derive(Default)]
struct Weighed {
    /// The likeliest, and the logarithm of its likelihood.
    best: Option<(Fix, f64)>,
    /// Sums of the weights by the best one's, of their azimuths from it, and of the squares of these and of their sigmas, in degrees.
    weights: f64,
    apart_deg: f64,
    squares: f64,
    variances: f64,
}

impl Weighed {
    fn add(&mut self, fix: &Fix, log_likelihood: f64) {
        if let Some((best, highest)) = self.best {
            let rescaled = libm::exp((highest - log_likelihood).min(0.0));
            if log_likelihood > highest {
                // From the new best one on.
                let moved_deg = wrap_180_deg(best.azimuth_deg - fix.azimuth_deg);
                self.squares += moved_deg * (2.0 * self.apart_deg + moved_deg * self.weights);
                self.apart_deg += moved_deg * self.weights;
                self.best = Some((*fix, log_likelihood));
            }
            for sum in [&mut self.weights, &mut self.apart_deg, &mut self.squares, &mut self.variances] {
                *sum *= rescaled;
            }
        } else {
            self.best = Some((*fix, log_likelihood));
        }
        let Some((best, highest)) = self.best else { return };
        let (weight, apart_deg) =
            (libm::exp(log_likelihood - highest), wrap_180_deg(fix.azimuth_deg - best.azimuth_deg));
        self.weights += weight;
        self.apart_deg += weight * apart_deg;
        self.squares += weight * apart_deg * apart_deg;
        self.variances += weight * fix.sigma_deg * fix.sigma_deg;
    }

    /// The likeliest, with the mean of all azimuths, and what lies between them in its sigma.
    fn mean(&self) -> Option<Fix> {
        let (best, _) = self.best?;
        let apart_deg = self.apart_deg / self.weights;
        let between = (self.squares / self.weights - apart_deg * apart_deg).max(0.0);
        let sigma_deg = libm::sqrt(self.variances / self.weights + between);
        Some(Fix { azimuth_deg: wrap_360_deg(best.azimuth_deg + apart_deg), sigma_deg, ..best })
    }
}

#[cfg(test)]
mod tests;
