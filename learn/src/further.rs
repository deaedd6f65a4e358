//! A further factor of an effect: all factors of the bank, which is one pass, where the products of two are as many as its square.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Circular, Shape};
use rayon::prelude::*;

use super::bank::{Bank, Left, Rows, best_of_each, gain, most_promising};
use super::functions::Functions;
use super::grammar::Grammar;
use super::pairs::{ROUNDING, independent};
use super::problem::dot;
use super::rows::Run;

/// Factors of one signal whose gain is computed beside the unknowns and the process of every run.
const OF_A_SIGNAL: usize = 2;

/// A factor in the forms that are tried, the number of its signal, what its plainest form costs by itself, nats, and the last form's functions by coarse row.
pub struct Gate {
    pub forms: Vec<Factor>,
    signal: usize,
    pub cost: f64,
    functions: Vec<DVector<f32>>,
}

impl Gate {
    /// About what an effect gains with this factor, which adds so much to the rate without it, by coarse row; and the weights of a constant and its functions.
    fn gain(&self, left: &Left, fitted: &DVector<f32>) -> (f64, DVector<f32>) {
        let products = self.functions.iter().map(|function| function.component_mul(fitted));
        let columns: Vec<DVector<f32>> = std::iter::once(fitted.clone()).chain(products).collect();
        left.gain(&columns)
    }
}

/// All factors that are tried as a further one.
pub struct Further {
    gates: Vec<Gate>,
}

impl Further {
    pub fn new(runs: &[Run], grammar: &Grammar, bank: &Bank) -> Self {
        let precision = DVector::from_column_slice(&bank.coarse.precision);
        let gate = |(factor, functions): (&Factor, Functions)| {
            let plainer = match factor.shape {
                Shape::Smooth(_) => grammar.curves(runs, factor.signal, &factor.dynamics, true),
                Shape::Circular(_) => vec![Factor { shape: Circular::of_few().into(), ..factor.clone() }],
                _ => Vec::new(),
            };
            let forms: Vec<Factor> = plainer.into_iter().chain([factor.clone()]).map(Factor::with_constant).collect();
            let cost = grammar.cost(&Effect::new(Port::Rate, &forms[..1]));
            let signal = grammar.signals.iter().position(|(signal, _)| *signal == factor.signal)?;
            let functions = independent(&functions, &precision, factor.count());
            (!functions.is_empty()).then_some(Gate { forms, signal, cost, functions })
        };
        Self { gates: bank.coarse_factors(is_tried).into_par_iter().filter_map(gate).collect() }
    }

    /// The factors, in all their forms, that promise most as a further one of an effect which adds so much to the rate, by coarse row; one of every signal.
    pub fn beside(&self, rows: &Rows, left: &Left, fitted: &DVector<f32>, most: usize) -> Vec<Factor> {
        let screen = Screen::new(rows, &left.sums, fitted);
        let gates = self.gates.par_iter();
        let promises: Vec<_> = gates.map(|gate| (gate.signal, screen.promise(gate) - gate.cost, gate)).collect();
        let promising = best_of_each(OF_A_SIGNAL, promises).into_par_iter();
        let gain = promising.map(|(_, gate)| (gate.signal, gate.gain(left, fitted).0 - gate.cost, gate));
        let best = best_of_each(1, gain.collect::<Vec<_>>());
        most_promising(best, most).into_iter().flat_map(|(_, gate)| gate.forms.clone()).collect()
    }

    fn of_signal(&self, signal: usize) -> impl Iterator<Item = &Gate> {
        self.gates.iter().filter(move |gate| gate.signal == signal)
    }

    /// The factor of a signal that promises most beside others whose product adds so much to the rate, by coarse row: about what all gain, the factor, and its
    /// function that fits.
    pub fn best_of(
        &self,
        rows: &Rows,
        left: &Left,
        others: &DVector<f32>,
        signal: usize,
    ) -> Option<(f64, &Gate, DVector<f32>)> {
        let screen = Screen::new(rows, &left.sums, others);
        let promises = self.of_signal(signal).map(|gate| (screen.promise(gate) - gate.cost, gate));
        let (_, best) = promises.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (gain, weights) = best.gain(left, others);
        let constant = DVector::from_element(others.len(), weights[0]);
        let functions = best.functions.iter().zip(weights.iter().skip(1));
        Some((gain, best, functions.fold(constant, |sum, (function, weight)| sum + function * *weight)))
    }

    /// The functions that tell most of all functions of a signal's factors, so many at most: their principal components by the precision of the coarse rows,
    /// by subspace iteration.
    pub fn principal(&self, signal: usize, precision: &DVector<f32>, most: usize) -> Vec<Vec<f32>> {
        let roots = precision.map(f32::sqrt);
        // The first function of a curve is as likely as all the others together.
        let weighed = |(k, function): (usize, &DVector<f32>)| function.component_mul(&roots) / (k + 1) as f32;
        let columns: Vec<DVector<f32>> =
            self.of_signal(signal).flat_map(|gate| gate.functions.iter().enumerate().map(weighed)).collect();
        if columns.is_empty() {
            return Vec::new();
        }
        let all = DMatrix::from_columns(&columns);
        let count = most.min(columns.len());
        let mut components = DMatrix::from_fn(all.nrows(), count, |row, i| all[(row, i * columns.len() / count)]);
        for _ in 0..20 {
            components = &all * all.tr_mul(&components.qr().q());
        }
        // What is left where there are fewer is rounding.
        let least = 1e-6 * components.column(0).norm_squared();
        let kept = components.column_iter().filter(|column| column.norm_squared() > least);
        kept.map(|column| column.component_div(&roots).as_slice().to_vec()).collect()
    }
}

/// Curves, which are near to other shapes as long as these are not tuned, and what only angles and times have.
fn is_tried(factor: &Factor) -> bool {
    match factor.shape {
        Shape::Smooth(smooth) => !smooth.is_of_few(),
        Shape::Harmonic(_) => factor.signal.is_angle(),
        Shape::Circular(_) | Shape::Decay(_) => true,
        _ => false,
    }
}

/// What functions are worth as factors of what is fitted, in white noise beside the unknowns of every run, and beside what is fitted itself: products of the
/// functions with a few columns, which are multiplied with what is fitted once.
struct Screen {
    scores: Vec<f32>,
    precision: Vec<f32>,
    /// Rows of a run, a direction of its unknowns, and the share of what is fitted in it.
    unknowns: Vec<(Range<usize>, Vec<f32>, f32)>,
    /// Score and information of what is fitted.
    score: f32,
    information: f32,
}

impl Screen {
    /// `sums`: V⁻¹ times what a model leaves, by coarse row.
    fn new(rows: &Rows, sums: &DVector<f32>, fitted: &DVector<f32>) -> Self {
        let white: Vec<f32> = fitted.iter().zip(&rows.precision).map(|(fitted, p)| fitted * p.sqrt()).collect();
        let mut unknowns = Vec::new();
        let mut first = 0;
        for (&end, of_run) in rows.ends.iter().zip(&rows.unknowns) {
            for direction in of_run.diminishing() {
                let direction: Vec<f32> = direction.iter().zip(&white[first..end]).map(|(a, b)| a * b).collect();
                let share: f32 = direction.iter().sum();
                unknowns.push((first..end, direction, share));
            }
            first = end;
        }
        let scores: Vec<f32> = fitted.iter().zip(sums).map(|(a, b)| a * b).collect();
        let precision: Vec<f32> = white.iter().map(|white| white * white).collect();
        let score = scores.iter().sum();
        let taken: f32 = unknowns.iter().map(|(_, _, share)| share * share).sum();
        let information = precision.iter().sum::<f32>() - taken;
        Self { scores, precision, unknowns, score, information }
    }

    /// Score and information of a function.
    fn of(&self, function: &[f32]) -> (f32, f32) {
        let weighed: Vec<f32> = function.iter().zip(&self.precision).map(|(value, p)| value * p).collect();
        let whole = dot(&weighed, function);
        let (mut information, mut along) = (whole, dot(function, &self.precision));
        for (rows, direction, share) in &self.unknowns {
            let part = dot(&function[rows.clone()], direction);
            information -= part * part;
            along -= part * share;
        }
        let by_fitted = if self.information > 0.0 { along / self.information } else { 0.0 };
        information -= by_fitted * along;
        let score = dot(function, &self.scores) - by_fitted * self.score;
        // What is left of what the others take away wholly is rounding.
        (score, if information > ROUNDING * whole { information } else { 0.0 })
    }

    /// About what a factor gains, nats.
    fn promise(&self, gate: &Gate) -> f64 {
        let of_function = |function: &DVector<f32>| {
            let (score, information) = self.of(function.as_slice());
            gain(score, information)
        };
        gate.functions.iter().map(of_function).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::unknowns::Unknowns;
    use super::*;

    /// Four rows of precision 1 and a bias. What is fitted is 1, −1, 1, −1, and three times that is left beside 2, −2, −2, 2. The function 1, 1, −1, −1 makes 1, −1,
    /// −1, 1 of it: score 8, information 4. A constant added to the function is what is fitted again, and changes neither; by itself it is nothing.
    #[test]
    fn by_hand() {
        let unknowns = vec![Unknowns::new([vec![0.0; 4], vec![0.0; 4], vec![1e3; 4]])];
        let rows = Rows { ends: vec![4], precision: vec![1.0; 4], unknowns };
        let column = |rows: [f32; 4]| DVector::from_column_slice(&rows);
        let screen = Screen::new(&rows, &column([5.0, -5.0, 1.0, -1.0]), &column([1.0, -1.0, 1.0, -1.0]));
        let expected =
            [([1.0, 1.0, -1.0, -1.0], (8.0, 4.0)), ([2.0, 2.0, 0.0, 0.0], (8.0, 4.0)), ([1.0; 4], (0.0, 0.0))];
        for (function, (score, information)) in expected {
            let found = screen.of(&function);
            assert!((found.0 - score).abs() < 1e-4 && (found.1 - information).abs() < 1e-4, "{found:?}");
        }
    }
}
