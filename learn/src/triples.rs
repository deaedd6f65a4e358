//! Products of three factors, of all signals with all: which are worth an exact look.
//!
//! Two factors of such a product alone may explain nothing, so that no pair leads to it. Of every signal a few functions stand for all that its factors can be;
//! as for pairs the scores of all products of three functions are products of matrices: for every function f of the first Fᵀ diag(w f) F. Of the most promising
//! signals every factor in turn is then chosen beside the two others.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use north_finder::effects::effect::{Effect, Port};
use rayon::prelude::*;

use super::bank::{Bank, Left, best_of_each, most_promising};
use super::further::{Further, Gate};
use super::grammar::Grammar;
use super::pairs::{Half, independent, information, ratio, weighed};
use super::rows::Run;

/// Functions of every signal: principal components of all that its factors can be.
const FUNCTIONS: usize = 4;
/// How often each factor is chosen beside the two others.
const SWEEPS: usize = 2;
/// Forms of a factor that are tried: a line and a curve.
const FORMS: usize = 2;

/// What products of three are judged by: what a model leaves, of these runs.
pub struct Judges<'a> {
    pub left: &'a Left,
    pub runs: &'a [Run],
    pub grammar: &'a Grammar,
    pub bank: &'a Bank,
    pub further: &'a Further,
}

/// What products are worth at one port.
struct OfPort {
    port: Port,
    /// What the rate of a coarse row changes by.
    gains: DVector<f32>,
    /// For every function, the information that its products with two functions of later signals have of their weights.
    information: Vec<DMatrix<f32>>,
}

/// The products of three factors.
pub struct Triples {
    /// Numbers of every signal's functions.
    signals: Vec<Range<usize>>,
    /// Functions by coarse row.
    functions: DMatrix<f32>,
    ports: Vec<OfPort>,
}

impl Triples {
    pub fn new(grammar: &Grammar, bank: &Bank, further: &Further) -> Self {
        let precision = DVector::from_column_slice(&bank.coarse.precision);
        let of_signal = |signal: usize| {
            let principal = further.principal(signal, &precision, FUNCTIONS);
            independent(&principal, &precision, FUNCTIONS)
        };
        let columns: Vec<Vec<DVector<f32>>> = (0..grammar.signals.len()).into_par_iter().map(of_signal).collect();
        let mut end = 0;
        let next = |own: &Vec<DVector<f32>>| {
            end += own.len();
            end - own.len()..end
        };
        let signals: Vec<Range<usize>> = columns.iter().map(next).collect();
        let columns = columns.concat();
        let functions =
            if columns.is_empty() { DMatrix::zeros(precision.len(), 0) } else { DMatrix::from_columns(&columns) };
        let of_port = |port: &Port| {
            let gains = DVector::from_column_slice(bank.coarse_gains(*port));
            let of_function = |end: usize, f: usize| {
                let later = functions.columns_range(end..).into_owned();
                information(&later, &gains.component_mul(&functions.column(f)), &bank.coarse, Half::Above)
            };
            let each: Vec<(usize, usize)> = signals.iter().flat_map(|own| own.clone().map(|f| (own.end, f))).collect();
            let information = each.into_par_iter().map(|(end, f)| of_function(end, f)).collect();
            OfPort { port: *port, gains, information }
        };
        let ports = grammar.ports.par_iter().map(of_port).collect();
        Self { signals, functions, ports }
    }

    /// The products that promise most, each in the form of its factors that does. `promising`: of how many the factors are chosen.
    pub fn shortlist(&self, judges: &Judges<'_>, promising: usize, most: usize) -> Vec<Effect> {
        let of_port = |number: usize| {
            let OfPort { gains, information, .. } = &self.ports[number];
            let all = promises(&self.signals, &self.functions, &judges.left.sums.component_mul(gains), information);
            let promising = all.into_iter().filter(|(promise, _)| *promise > 0.0);
            promising.map(move |(promise, signals)| (signals, promise, (number, signals)))
        };
        let all: Vec<_> = (0..self.ports.len()).into_par_iter().flat_map_iter(of_port).collect();
        let best = most_promising(best_of_each(1, all), promising);
        let chosen = |(_, (port, signals)): (f64, (usize, [usize; 3]))| self.chosen(judges, port, signals);
        let chosen = most_promising(best.into_par_iter().filter_map(chosen).collect(), most);
        let best_form = |(_, (port, gates)): (f64, (Port, [&Gate; 3]))| {
            let [a, b, c] = gates.map(|gate| &gate.forms[..FORMS.min(gate.forms.len())]);
            let of_two = a.iter().flat_map(|a| b.iter().map(move |b| (a, b)));
            let factors = of_two.flat_map(|(a, b)| c.iter().map(move |c| [a.clone(), b.clone(), c.clone()]));
            let effects = factors.map(|factors| Effect::new(port, &factors)).filter(|each| each.validate().is_ok());
            let promise = |each: Effect| {
                (judges.bank.promise(judges.runs, &each, judges.left) - judges.grammar.cost(&each), each)
            };
            effects.map(promise).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, effect)| effect)
        };
        chosen.into_par_iter().filter_map(best_form).collect()
    }

    /// Factors of three signals, each chosen in turn beside the functions of the two others that fit, and about what they gain less their cost, nats.
    fn chosen<'a>(
        &self,
        judges: &Judges<'a>,
        port: usize,
        signals: [usize; 3],
    ) -> Option<(f64, (Port, [&'a Gate; 3]))> {
        let OfPort { port, gains, .. } = &self.ports[port];
        let mut functions = self.nearest_product(judges.left, gains, signals);
        let mut chosen: [Option<&Gate>; 3] = [None; 3];
        let mut gain = 0.0;
        for slot in (0..SWEEPS).flat_map(|_| 0..3) {
            let beside = functions.iter().enumerate().filter(|(other, _)| *other != slot);
            let others = beside.fold(gains.clone(), |product, (_, function)| product.component_mul(function));
            let (above, gate, function) =
                judges.further.best_of(&judges.bank.coarse, judges.left, &others, signals[slot])?;
            (gain, functions[slot], chosen[slot]) = (above, function, Some(gate));
        }
        let [Some(a), Some(b), Some(c)] = chosen else { return None };
        Some((gain - a.cost - b.cost - c.cost, (*port, [a, b, c])))
    }

    /// One function of each of three signals, whose product is about what all products of their functions make of what is left: along the principal direction of
    /// the weights of each signal's functions.
    fn nearest_product(&self, left: &Left, gains: &DVector<f32>, signals: [usize; 3]) -> [DVector<f32>; 3] {
        let own = signals.map(|signal| self.signals[signal].clone());
        let mut products = vec![gains.clone()];
        for functions in &own {
            let times = |product: &DVector<f32>, f: usize| product.component_mul(&self.functions.column(f));
            products = products.iter().flat_map(|product| functions.clone().map(move |f| times(product, f))).collect();
        }
        let (_, weights) = left.gain(&products);
        let strides = [own[1].len() * own[2].len(), own[2].len(), 1];
        std::array::from_fn(|slot| {
            let (stride, count) = (strides[slot], own[slot].len());
            let mut by_function = DMatrix::<f32>::zeros(count, weights.len());
            for (number, weight) in weights.iter().enumerate() {
                let function = number / stride % count;
                by_function[(function, number - function * stride)] = *weight;
            }
            let eigen = (&by_function * by_function.transpose()).symmetric_eigen();
            let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax());
            self.functions.columns_range(own[slot].clone()) * direction
        })
    }
}

/// The signals of every product of three, and the sum of the ratios of its functions. `information`: as of [`OfPort`].
fn promises(
    signals: &[Range<usize>],
    functions: &DMatrix<f32>,
    weights: &DVector<f32>,
    information: &[DMatrix<f32>],
) -> Vec<(f64, [usize; 3])> {
    let of_first = |a: usize| {
        let end = signals[a].end;
        let later = functions.columns_range(end..).into_owned();
        let mut sums = DMatrix::<f32>::zeros(later.ncols(), later.ncols());
        for f in signals[a].clone() {
            let scores = weighed(&later, &weights.component_mul(&functions.column(f))).transpose() * &later;
            let each = sums.iter_mut().zip(scores.iter().zip(&information[f]));
            each.for_each(|(sum, (&score, &information))| *sum += ratio(score, information) as f32);
        }
        let of_two = move |b: usize, c: usize| {
            let products = signals[b].clone().flat_map(|g| signals[c].clone().map(move |h| (g - end, h - end)));
            (products.map(|at| f64::from(sums[at])).sum::<f64>(), [a, b, c])
        };
        let later_signals = (a + 1..signals.len()).flat_map(move |b| (b + 1..signals.len()).map(move |c| (b, c)));
        later_signals.map(|(b, c)| of_two(b, c)).collect::<Vec<_>>()
    };
    (0..signals.len()).flat_map(of_first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of five signals of two functions each the product of the first function of the second, the second of the third and the first of the fifth is what is left.
    #[test]
    fn the_product_that_is_left_promises_most() {
        let wave = |row: usize, function: usize| ((row * (2 * function + 3)) as f32 * 0.37 + function as f32).sin();
        let functions = DMatrix::from_fn(400, 10, wave);
        let gates: Vec<Range<usize>> = (0..5).map(|i| 2 * i..2 * i + 2).collect();
        let left = functions.column(2).component_mul(&functions.column(5)).component_mul(&functions.column(8));
        let flat = |f: usize| {
            let later = 10 - (f / 2 + 1) * 2;
            DMatrix::from_element(later, later, 1.0)
        };
        let information: Vec<DMatrix<f32>> = (0..10).map(flat).collect();
        let all = promises(&gates, &functions, &left, &information);
        assert_eq!(all.len(), 10, "three of five");
        let best = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        assert_eq!(best.1, [1, 2, 4]);
    }
}
