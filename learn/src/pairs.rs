//! Products of two factors, all with all: which are worth an exact look.
//!
//! Of every factor a few functions that are independent of each other over the rows; the scores of all products of two functions are then one
//! product of matrices, Pᵀ diag(w) P.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Circular, Shape};
use rayon::prelude::*;

use super::bank::{Bank, Left, Rows, best_of_each, most_promising};
use super::grammar::Grammar;
use super::rows::Run;

/// Functions of a bare signal and of one behind a dynamics: a straight line, a curve with one extremum, one with two.
const FUNCTIONS_OF_A_SIGNAL: usize = 3;
const FUNCTIONS_BEHIND_DYNAMICS: usize = 2;
/// Most functions of all factors: their products are the square of it.
const MOST_FUNCTIONS: usize = 1200;
/// Of a decay's time constants every third: a product is tuned when it is found.
const EVERY: usize = 3;
/// Correlation from which on what comes out of two dynamics counts as the same: one percent of the square, less than tuning a constant by half a step changes.
const ALIKE: f32 = 0.99;
/// Proposals of the same two signals, at whichever ports and behind whichever dynamics.
const OF_THE_SAME_SIGNALS: usize = 2;
/// Rounding of a sum of some hundred products of single precision, as a share of it.
pub const ROUNDING: f32 = 1e-5;
/// Most functions of which products with all others are summed at once, so that the sums stay in a processor's cache.
const TOGETHER: usize = 64;

/// A factor of products in the forms that are tried, the number of its signal, and the numbers of its functions.
pub struct Gate {
    pub forms: Vec<Factor>,
    pub signal: usize,
    pub functions: Range<usize>,
}

/// What products are worth at one port.
struct OfPort {
    port: Port,
    /// What the rate of a coarse row changes by.
    gains: DVector<f32>,
    /// The information that the products of two functions have of their weights, in white noise beside the unknowns of every run.
    information: DMatrix<f32>,
}

/// The products of two factors.
pub struct Pairs {
    gates: Vec<Gate>,
    /// What the plainest form of each gate costs by itself, nats.
    costs: Vec<f64>,
    /// Functions of the gates, by coarse row.
    functions: DMatrix<f32>,
    ports: Vec<OfPort>,
}

impl Pairs {
    pub fn new(runs: &[Run], grammar: &Grammar, bank: &Bank) -> Self {
        let (gates, functions) = gates(runs, grammar, bank, forms(runs, grammar, bank));
        let port = |port: &Port| {
            let gains = DVector::from_column_slice(bank.coarse_gains(*port));
            let information = information(&functions, &gains, &bank.coarse, Half::Below);
            OfPort { port: *port, gains, information }
        };
        let ports = grammar.ports.par_iter().map(port).collect();
        let costs = gates.iter().map(|gate| grammar.cost(&Effect::new(Port::Rate, &gate.forms[..1]))).collect();
        Self { gates, costs, functions, ports }
    }

    /// The products that promise most, each in all forms of its factors, the most flexible last: of every two signals few, so that the variants of one product
    /// leave room for others.
    pub fn shortlist(&self, left: &Left, grammar: &Grammar, most: usize) -> Vec<Vec<Effect>> {
        let of_port = |of_port: &OfPort| {
            let scores =
                weighed(&self.functions, &left.sums.component_mul(&of_port.gains)).transpose() * &self.functions;
            let of_place = grammar.cost(&Effect::new(of_port.port, &[]));
            let promise = |(i, j): (usize, usize)| {
                let cost = of_place + self.costs[i] + self.costs[j];
                (self.signals(i, j), self.coarse_gain(left, of_port, i, j) - cost, (of_port.port, i, j))
            };
            let best = self.best_of_signals(&scores, &of_port.information);
            best.into_par_iter().map(promise).collect::<Vec<_>>()
        };
        let all: Vec<_> = self.ports.par_iter().flat_map_iter(of_port).collect();
        let promising = most_promising(best_of_each(OF_THE_SAME_SIGNALS, all), most);
        let in_all_forms = |(_, (port, i, j)): (f64, (Port, usize, usize))| {
            let (a, b) = (&self.gates[i].forms, &self.gates[j].forms);
            let both = a.iter().flat_map(move |a| b.iter().map(move |b| [a.clone(), b.clone()]));
            both.map(move |factors| Effect::new(port, &factors)).filter(|effect| effect.validate().is_ok()).collect()
        };
        promising.into_iter().map(in_all_forms).collect()
    }

    /// The signals of two gates, in whichever order.
    fn signals(&self, i: usize, j: usize) -> [usize; 2] {
        let mut signals = [i, j].map(|gate| self.gates[gate].signal);
        signals.sort_unstable();
        signals
    }

    /// Of every two signals the gates whose products' functions have the greatest scores for their cost: a sum that is too large where they resemble each
    /// other.
    fn best_of_signals(&self, scores: &DMatrix<f32>, information: &DMatrix<f32>) -> Vec<(usize, usize)> {
        let of_gate = |i: usize| -> Vec<([usize; 2], f64, (usize, usize))> {
            let of_pair = |j: usize| {
                let (a, b) = (&self.gates[i], &self.gates[j]);
                let products = a.functions.clone().flat_map(|f| b.functions.clone().map(move |g| (f, g)));
                let ratios: f64 = products.map(|at| ratio(scores[at], information[at])).sum();
                (self.signals(i, j), 0.5 * ratios - self.costs[i] - self.costs[j], (i, j))
            };
            (0..i).map(of_pair).collect()
        };
        let all: Vec<_> = (0..self.gates.len()).into_par_iter().flat_map_iter(of_gate).collect();
        best_of_each(OF_THE_SAME_SIGNALS, all).into_iter().map(|(_, gates)| gates).collect()
    }

    /// About what the products of two gates gain, in coarse rows.
    fn coarse_gain(&self, left: &Left, of_port: &OfPort, i: usize, j: usize) -> f64 {
        let (a, b) = (self.gates[i].functions.clone(), self.gates[j].functions.clone());
        let product = |f: usize, g: usize| {
            self.functions.column(f).component_mul(&self.functions.column(g)).component_mul(&of_port.gains)
        };
        let columns: Vec<_> = a.flat_map(|f| b.clone().map(move |g| (f, g))).map(|(f, g)| product(f, g)).collect();
        left.gain(&columns).0
    }
}

/// Gates of factors in these forms, each with so many functions of the last of them at most, and the functions of all gates by coarse row.
pub fn gates(
    runs: &[Run],
    grammar: &Grammar,
    bank: &Bank,
    forms: Vec<(Vec<Factor>, usize)>,
) -> (Vec<Gate>, DMatrix<f32>) {
    let precision = DVector::from_column_slice(&bank.coarse.precision);
    let evaluated = |(forms, most): (Vec<Factor>, usize)| {
        let last = forms.last()?;
        let signal = grammar.signals.iter().position(|(signal, _)| *signal == last.signal).unwrap_or_default();
        let functions = independent(&bank.coarse_functions(runs, last), &precision, most);
        Some((forms, signal, functions))
    };
    let evaluated: Vec<(Vec<Factor>, usize, Vec<DVector<f32>>)> = forms.into_par_iter().filter_map(evaluated).collect();
    let mut columns: Vec<DVector<f32>> = Vec::new();
    let mut gates = Vec::new();
    for (forms, signal, functions) in evaluated {
        let first = columns.len();
        columns.extend(functions);
        gates.push(Gate { forms, signal, functions: first..columns.len() });
    }
    gates.retain(|gate| !gate.functions.is_empty());
    let functions =
        if columns.is_empty() { DMatrix::zeros(precision.len(), 0) } else { DMatrix::from_columns(&columns) };
    (gates, functions)
}

/// Square of a score by its information.
pub fn ratio(score: f32, information: f32) -> f64 {
    if information > 0.0 { f64::from(score * score / information) } else { 0.0 }
}

/// The forms of every bare signal, and how many of the last form's functions are looked at.
fn bare_forms(runs: &[Run], grammar: &Grammar) -> Vec<(Vec<Factor>, usize)> {
    let mut bare: Vec<(Vec<Factor>, usize)> = Vec::new();
    for (signal, span) in &grammar.signals {
        let mut decays = Vec::new();
        Shape::starts(span, &mut |shape| {
            let factor = Factor::new(*signal, &[], shape).with_constant();
            match shape {
                Shape::Circular(_) => {
                    let few = Factor { shape: Circular::of_few().into(), ..factor.clone() };
                    bare.push((vec![few, factor], shape.count()));
                }
                Shape::Decay(_) => decays.push((vec![factor], 1)),
                _ => {}
            }
        });
        bare.extend(decays.into_iter().skip(1).step_by(EVERY));
        if !signal.needs_dynamics() {
            let curves = grammar.curves(runs, *signal, &[], true);
            bare.push((curves.into_iter().map(Factor::with_constant).collect(), FUNCTIONS_OF_A_SIGNAL));
        }
    }
    bare
}

/// The forms of every factor, and how many of the last form's functions are looked at. Of the starts of every kind of dynamics there are as many as there is
/// room for, so that none is left out.
fn forms(runs: &[Run], grammar: &Grammar, bank: &Bank) -> Vec<(Vec<Factor>, usize)> {
    let mut all = bare_forms(runs, grammar);
    let kinds = distinct(bank);
    let room = MOST_FUNCTIONS.saturating_sub(all.len() * FUNCTIONS_OF_A_SIGNAL) / FUNCTIONS_BEHIND_DYNAMICS;
    let count = |every: usize| kinds.iter().map(|kind| kind.len().div_ceil(every)).sum::<usize>();
    let longest = kinds.iter().map(Vec::len).max().unwrap_or(1);
    let every = (1..longest).find(|&every| count(every) <= room).unwrap_or(longest);
    for kind in &kinds {
        let first = (kind.len() - 1) % every / 2;
        for factor in kind.iter().skip(first).step_by(every) {
            let forms = grammar.curves(runs, factor.signal, &factor.dynamics, true);
            all.push((forms.into_iter().map(Factor::with_constant).collect(), FUNCTIONS_BEHIND_DYNAMICS));
        }
    }
    all
}

/// Factors behind dynamics, by signal and kind of dynamics, without those whose dynamics give nearly what another one of the signal gives, or the signal itself.
fn distinct(bank: &Bank) -> Vec<Vec<Factor>> {
    let precision = DVector::from_column_slice(&bank.coarse.precision);
    let mut kept: Vec<(&Factor, DVector<f32>)> = Vec::new();
    for (factor, line) in bank.coarse_factors(|factor| matches!(factor.shape, Shape::Linear(_))) {
        let Some(output) = independent(&line, &precision, 1).pop() else { continue };
        let weighed = output.component_mul(&precision) / precision.sum();
        let differs = |(other, column): &(&Factor, DVector<f32>)| {
            other.signal != factor.signal || weighed.dot(column).abs() < ALIKE
        };
        if kept.iter().all(differs) {
            kept.push((factor, output));
        }
    }
    let behind = kept.into_iter().map(|(factor, _)| factor).filter(|factor| !factor.dynamics.is_empty());
    let behind: Vec<Factor> = behind.cloned().collect();
    let kind = |factor: &Factor| (factor.signal, factor.dynamics.first().map(ToString::to_string));
    behind.chunk_by(|a, b| kind(a) == kind(b)).map(<[Factor]>::to_vec).collect()
}

/// The first of some functions, independent of each other and of a constant, of unit size (Gram and Schmidt).
pub fn independent(functions: &[Vec<f32>], precision: &DVector<f32>, most: usize) -> Vec<DVector<f32>> {
    let dot =
        |a: &DVector<f32>, b: &DVector<f32>| a.iter().zip(b).zip(precision).map(|((a, b), p)| a * b * p).sum::<f32>();
    let whole = precision.sum();
    let mut kept = vec![DVector::from_element(precision.len(), 1.0)];
    for function in functions {
        let mut column = DVector::from_column_slice(function);
        let size = dot(&column, &column);
        for each in &kept {
            let share = dot(&column, each) / whole;
            column.axpy(-share, each, 1.0);
        }
        let left = dot(&column, &column);
        // What is left of a function that is a sum of the others is rounding.
        if left > 1e-6 * size && kept.len() <= most {
            kept.push(column * (whole / left).sqrt());
        }
    }
    kept.split_off(1)
}

/// The half of a symmetric matrix that is looked at, without its diagonal.
#[derive(Clone, Copy)]
pub enum Half {
    Below,
    Above,
}

/// The information that the products of two functions have of their weights, in white noise beside the unknowns of every run; only in one half of the matrix.
pub fn information(functions: &DMatrix<f32>, gains: &DVector<f32>, rows: &Rows, half: Half) -> DMatrix<f32> {
    let count = functions.ncols();
    let squares = functions.map(|value| value * value);
    let roots = DVector::from_iterator(rows.precision.len(), rows.precision.iter().map(|precision| precision.sqrt()));
    let heavy = gains.component_mul(&roots);
    let heavy_squares = heavy.component_mul(&heavy);
    // Of every direction of a run's unknowns: the run's first row, and the weights of its rows.
    let mut directions: Vec<(usize, DVector<f32>)> = Vec::new();
    let mut first = 0;
    for (&end, unknowns) in rows.ends.iter().zip(&rows.unknowns) {
        let heavy = heavy.rows(first, end - first);
        for rows in unknowns.diminishing() {
            directions.push((first, heavy.component_mul(&DVector::from_vec(rows))));
        }
        first = end;
    }
    let of_some = |own: Range<usize>| {
        let others = match half {
            Half::Below => 0..own.end,
            Half::Above => own.start..count,
        };
        let sums = |functions: &DMatrix<f32>, first: usize, weights: &DVector<f32>| {
            let of_own = functions.view((first, own.start), (weights.len(), own.len())).into_owned();
            weighed(&of_own, weights).transpose() * functions.view((first, others.start), (weights.len(), others.len()))
        };
        let whole = sums(&squares, 0, &heavy_squares);
        let mut left = whole.clone();
        for (first, weights) in &directions {
            let sums = sums(functions, *first, weights);
            left.iter_mut().zip(&sums).for_each(|(left, sum)| *left -= sum * sum);
        }
        // What is left of what the unknowns take away wholly is rounding.
        let left = left.zip_map(&whole, |left, whole| if left > ROUNDING * whole { left } else { 0.0 });
        ((own.start, others.start), left)
    };
    let parts = count.div_ceil(TOGETHER);
    let some = (0..parts).into_par_iter().map(|part| of_some(part * count / parts..(part + 1) * count / parts));
    let mut information = DMatrix::<f32>::zeros(count, count);
    for (place, left) in some.collect::<Vec<_>>() {
        information.view_mut(place, left.shape()).copy_from(&left);
    }
    information
}

/// Rows multiplied with weights.
pub fn weighed(functions: &DMatrix<f32>, weights: &DVector<f32>) -> DMatrix<f32> {
    let mut weighed = functions.clone();
    weighed.column_iter_mut().for_each(|mut column| column.component_mul_assign(weights));
    weighed
}

#[cfg(test)]
mod tests {
    use super::super::unknowns::Unknowns;
    use super::*;

    /// Of 150 functions in two runs of 12 rows: the information of a product as it is by itself, in either half. A product that is the same in every row of a
    /// run is another bias, which leaves nothing of it.
    #[test]
    fn information_of_all_products_as_of_each() {
        let wave = |row: usize, function: usize| ((row * (2 * function + 3)) as f32 * 0.37 + function as f32).sin();
        let functions = DMatrix::from_fn(24, 150, |row, function| if function < 2 { 1.0 } else { wave(row, function) });
        let gains = DVector::from_fn(24, |row, _| if row < 12 { 1.0 } else { 2.0 });
        let precision: Vec<f32> = (0..24).map(|row| if row < 12 { 1.0 } else { 0.25 }).collect();
        let unknowns = || {
            let sines = |row: usize| (row as f64 * 0.9).sin_cos();
            let both: (Vec<f64>, Vec<f64>) = (0..12).map(sines).unzip();
            Unknowns::new([both.0, both.1, vec![1e3; 12]])
        };
        let rows = Rows { ends: vec![12, 24], precision: precision.clone(), unknowns: vec![unknowns(), unknowns()] };
        let of_each = |i: usize, j: usize| -> f32 {
            let row = |row: usize| functions[(row, i)] * functions[(row, j)] * gains[row] * precision[row].sqrt();
            let mut left: Vec<f32> = (0..24).map(row).collect();
            left.chunks_mut(12).zip(&rows.unknowns).for_each(|(run, unknowns)| unknowns.take_out(run));
            left.iter().map(|value| value * value).sum()
        };
        let below = information(&functions, &gains, &rows, Half::Below);
        let above = information(&functions, &gains, &rows, Half::Above);
        for (i, j) in [(2, 0), (63, 62), (64, 3), (100, 70), (149, 5), (149, 148)] {
            for found in [below[(i, j)], above[(j, i)]] {
                assert!((found - of_each(i, j)).abs() < 1e-3, "{i} {j}: {found} {}", of_each(i, j));
            }
        }
        assert_eq!((below[(1, 0)], above[(0, 1)]), (0.0, 0.0));
    }
}
