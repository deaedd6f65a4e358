//! Weights of an effect over one interval, or about one reference, as weights of the same effect over another.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::effect::Effect;
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Linear, Shape, Sharp, Smooth};

/// Places at which two functions are compared, over the interval of the first.
const PLACES: usize = 64;
/// A linear shape is compared over so many of its scales to either side.
const SCALES: f32 = 3.0;

/// The matrix by which weights of `from` become those of `to`: of the same form, so that only references, scales and intervals differ.
pub fn projection(from: &Effect, to: &Effect) -> Option<DMatrix<f64>> {
    let mut whole = DMatrix::identity(1, 1);
    for (from, to) in from.factors.iter().zip(&to.factors) {
        whole = whole.kronecker(&of_factor(from, to)?);
    }
    Some(whole)
}

fn of_factor(from: &Factor, to: &Factor) -> Option<DMatrix<f64>> {
    let Some((low, high)) = interval(&from.shape).filter(|_| from.shape != to.shape) else {
        return Some(DMatrix::identity(to.count(), from.count()));
    };
    let place = |i: usize| f64::from(low) + f64::from(high - low) * (i as f64 + 0.5) / PLACES as f64;
    let functions = |factor: &Factor| {
        DMatrix::from_fn(PLACES, factor.count(), |row, column| {
            factor.values(place(row)).get(column).copied().unwrap_or(0.0)
        })
    };
    // A constant that neither has is part of the bias.
    let constant = usize::from(!to.constant);
    let target = functions(to);
    let mut columns = DMatrix::from_element(PLACES, to.count() + constant, 1.0);
    columns.columns_mut(constant, to.count()).copy_from(&target);
    let solved = columns.svd(true, true).solve(&functions(from), 1e-9).ok()?;
    Some(solved.rows(constant, to.count()).into_owned())
}

fn interval(shape: &Shape) -> Option<(f32, f32)> {
    match shape {
        Shape::Linear(Linear { reference, scale }) => Some((reference - SCALES * scale, reference + SCALES * scale)),
        Shape::Smooth(Smooth { low, high, .. }) | Shape::Sharp(Sharp { low, high }) => Some((*low, *high)),
        _ => None,
    }
}

/// Weights and their covariance in units of the weights' priors.
pub fn scaled(priors: &[f64], mean: DVector<f64>, covariance: DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let turn = DMatrix::from_diagonal(&DVector::from_iterator(priors.len(), priors.iter().map(|prior| 1.0 / prior)));
    (&turn * mean, &turn * covariance * &turn)
}

#[cfg(test)]
mod tests {
    use north_finder::effects::effect::Port;
    use north_finder::effects::signal::Time;

    use super::*;

    /// 0.6 for (t − 100)/20 is 0.03 for each second: 1.2 for (t − 50)/40, and a bias.
    #[test]
    fn a_line_about_another_reference() {
        let line = |reference: f32, scale: f32| Factor::new(Time.into(), &[], Linear { reference, scale }.into());
        let [from, to] = [line(100.0, 20.0), line(50.0, 40.0)].map(|factor| Effect::new(Port::Rate, &[factor]));
        let matrix = projection(&from, &to).unwrap();
        assert!((0.6 * matrix[(0, 0)] - 1.2).abs() < 1e-9, "{matrix}");
        // A curve on a wider interval is the same curve where the first knows it, to a few parts in a hundred.
        let curve = |low: f32, high: f32| Factor::new(Time.into(), &[], Smooth { low, high, count: 6 }.into());
        let [from, to] = [curve(10.0, 20.0), curve(8.0, 22.0)].map(|factor| Effect::new(Port::Rate, &[factor]));
        let weights = projection(&from, &to).unwrap() * DVector::from_vec(vec![1.0, 0.3, 0.0, 0.0, 0.0, 0.0]);
        let value = |effect: &Effect, weights: &[f64], x: f64| -> f64 {
            effect.factors[0].values(x).iter().zip(weights).map(|(value, weight)| value * weight).sum()
        };
        let difference = |x: f64| value(&to, weights.as_slice(), x) - value(&from, &[1.0, 0.3], x);
        let spread = [11.0, 13.0, 15.0, 17.0, 19.0].map(|x| difference(x) - difference(15.0));
        assert!(spread.iter().all(|each| each.abs() < 0.05), "{spread:?}");
    }
}
