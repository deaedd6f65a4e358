//! What the instruments of one type have in common: which effects they share, and how the weights of these differ from one to the next.
//!
//! A member of the family has an effect with probability π and weights w ~ N(m, S). The prior is a mixture, so that a unit of its own kind is not
//! pulled towards the others: with a small probability it has the effect or not as it comes, with weights of any sign and several times the usual size.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use north_finder::effects::effect::Effect;
use north_finder::effects::part::Constant;

/// Share of units that do not follow their family in an effect, before anything is seen: one in fifty, about what leaves a production by mistake and
/// is found in service (a figure of experience; the posterior depends on its logarithm only).
pub const OUTSIDE: f64 = 0.02;
/// Standard deviation of the weights of such a unit, in root mean squares of the family's: it may have either sign, and three times the size is nothing
/// unusual for it.
const WIDER: f64 = 3.0;

/// The effects of one type of instrument.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Family {
    pub members: Vec<Common>,
}

/// An effect that instruments of the type have.
#[derive(Clone, Debug, PartialEq)]
pub struct Common {
    /// Its form with the usual constants, and the mean of its weights.
    pub effect: Effect,
    /// Share of the units that have it.
    pub share: f64,
    /// How many units that have it this rests on.
    pub units: f64,
    /// Covariance of the weights from unit to unit.
    pub covariance: DMatrix<f64>,
    /// Standard deviation of each constant from unit to unit: of its logarithm where it is a scale. In the order of factors and their constants.
    pub spreads: Vec<f64>,
}

/// How a unit has an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// As the others have it.
    Family,
    /// Of its own kind.
    Own,
}

/// What is known of the weights of an effect beforehand.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Mean and a root of the covariance, in units of the weights' own priors.
    pub mean: DVector<f64>,
    pub root: DMatrix<f64>,
    /// Minus the logarithm of the odds that the effect is there in this way, over its absence; nats.
    pub cost: f64,
}

/// The prior of an effect of a family in a model.
#[derive(Clone, Debug)]
pub struct Known {
    /// Number of the effect in the family.
    pub member: usize,
    pub way: Way,
    pub prior: Arc<Prior>,
}

impl Common {
    /// The prior of one way.
    pub fn prior(&self, way: Way) -> Prior {
        let share = self.share.clamp(1e-6, 1.0 - 1e-6);
        let absent = (1.0 - OUTSIDE) * (1.0 - share) + 0.5 * OUTSIDE;
        let priors: Vec<f64> = (0..self.effect.count()).map(|number| self.effect.prior(number)).collect();
        let mean = DVector::from_iterator(
            priors.len(),
            self.effect.weights.iter().zip(&priors).map(|(weight, prior)| f64::from(*weight) / prior),
        );
        let covariance =
            DMatrix::from_fn(priors.len(), priors.len(), |i, j| self.covariance[(i, j)] / (priors[i] * priors[j]));
        match way {
            Way::Family => Prior { mean, root: root(covariance), cost: absent.ln() - ((1.0 - OUTSIDE) * share).ln() },
            Way::Own => {
                let sizes =
                    DVector::from_fn(mean.len(), |i, _| WIDER * (mean[i] * mean[i] + covariance[(i, i)]).sqrt());
                Prior {
                    mean: DVector::zeros(sizes.len()),
                    root: DMatrix::from_diagonal(&sizes),
                    cost: absent.ln() - (0.5 * OUTSIDE).ln(),
                }
            }
        }
    }

    /// Minus the logarithm of the density of an effect's constants over that of the usual ones, nats: independent normal distributions.
    pub fn cost_of_constants(&self, effect: &Effect) -> f64 {
        let constants = |effect: &Effect| -> Vec<Constant> {
            effect.factors.iter().flat_map(|factor| factor.constants()).collect()
        };
        let (own, usual) = (constants(effect), constants(&self.effect));
        let off = |place: usize| {
            let (own, usual, spread) = (own[place], usual[place], self.spreads[place]);
            let off = if own.is_scale { (own.value / usual.value).ln() } else { own.value - usual.value };
            if spread > 0.0 { 0.5 * (off / spread).powi(2) } else { 0.0 }
        };
        (0..own.len().min(usual.len()).min(self.spreads.len())).map(off).sum()
    }
}

/// A root of a covariance: R Rᵀ.
fn root(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = SymmetricEigen::new(covariance);
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}

#[cfg(test)]
mod tests {
    use north_finder::effects::effect::Port;

    use super::*;

    /// A scale factor of 0.004 ± 0.001 in nine of ten units. As the family: 0.98 · 0.9 = 0.882 to 0.98 · 0.1 + 0.01 = 0.108; of its own 0.01 to that,
    /// with 3 · √(0.004² + 0.001²) = 0.01237.
    #[test]
    fn the_two_ways_by_hand() {
        let mut effect = Effect::new(Port::Scale, &[]);
        effect.weights.copy_from_slice(&[0.004]);
        let covariance = DMatrix::from_element(1, 1, 1e-6);
        let common = Common { effect, share: 0.9, units: 45.0, covariance, spreads: Vec::new() };
        let [family, own] = [Way::Family, Way::Own].map(|way| common.prior(way));
        assert!((family.mean[0] - 0.004).abs() < 1e-9 && (family.root[(0, 0)].abs() - 0.001).abs() < 1e-12);
        assert!((family.cost + (0.882f64 / 0.108).ln()).abs() < 1e-12);
        assert!(own.mean[0] == 0.0 && (own.root[(0, 0)] - 0.01237).abs() < 1e-5);
        assert!((own.cost + (0.01f64 / 0.108).ln()).abs() < 1e-12);
    }
}
