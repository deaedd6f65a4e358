//! Products of three bare signals, all with all: which are worth an exact look.
//!
//! Two factors of such a product alone may explain nothing, so that no pair leads to it. As for pairs the scores of all products of three functions are
//! products of matrices: for every function f of the first Fᵀ diag(w f) F.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::effect::{Effect, Port};
use rayon::prelude::*;

use super::bank::{Bank, BestOfEach, Left};
use super::grammar::Grammar;
use super::pairs::{Gate, Half, bare_forms, gates, information, ratio, weighed};
use super::rows::Run;

/// Functions of every signal: a straight line, a curve with one extremum.
const FUNCTIONS: usize = 2;
/// Products whose gain is looked at in coarse rows.
const PROMISING: usize = 64;

/// What products are worth at one port.
struct OfPort {
    port: Port,
    /// What the rate of a coarse row changes by.
    gains: DVector<f32>,
    /// For every function, the information that its products with two functions of later gates have of their weights.
    information: Vec<DMatrix<f32>>,
}

/// The products of three bare signals.
pub struct Triples {
    gates: Vec<Gate>,
    /// Functions of the gates, by coarse row.
    functions: DMatrix<f32>,
    ports: Vec<OfPort>,
}

impl Triples {
    pub fn new(runs: &[Run], grammar: &Grammar, bank: &Bank) -> Self {
        let few = bare_forms(runs, grammar).into_iter().map(|(forms, most)| (forms, most.min(FUNCTIONS))).collect();
        let (gates, functions) = gates(runs, grammar, bank, few);
        let of_port = |port: &Port| {
            let gains = DVector::from_column_slice(bank.coarse_gains(*port));
            let of_function = |gate: &Gate, f: usize| {
                let later = functions.columns_range(gate.functions.end..).into_owned();
                information(&later, &gains.component_mul(&functions.column(f)), &bank.coarse, Half::Above)
            };
            let each = gates.iter().flat_map(|gate| gate.functions.clone().map(move |f| (gate, f)));
            let each: Vec<(&Gate, usize)> = each.collect();
            let information = each.into_par_iter().map(|(gate, f)| of_function(gate, f)).collect();
            OfPort { port: *port, gains, information }
        };
        let ports = grammar.ports.par_iter().map(of_port).collect();
        Self { gates, functions, ports }
    }

    /// The products that promise most, each of other signals and in the form of its factors that does.
    pub fn shortlist(&self, left: &Left, grammar: &Grammar, bank: &Bank, runs: &[Run], most: usize) -> Vec<Effect> {
        let of_port = |of_port: &OfPort| {
            let weights = left.sums.component_mul(&of_port.gains);
            let all = promises(&self.gates, &self.functions, &weights, &of_port.information);
            let port = of_port.port;
            all.into_iter().map(move |(promise, gates)| (promise, port, gates))
        };
        let each_port: Vec<(f64, Port, [usize; 3])> = self.ports.par_iter().flat_map_iter(of_port).collect();
        let mut best = BestOfEach::new(1);
        for each in each_port {
            let mut signals = each.2.map(|gate| self.gates[gate].signal);
            signals.sort_unstable();
            best.push(signals, each.0, each);
        }
        let mut all = best.into_all();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        all.truncate(PROMISING);
        let best_form = |(_, port, gates): (f64, Port, [usize; 3])| {
            let [a, b, c] = gates.map(|gate| &self.gates[gate].forms);
            let of_two = a.iter().flat_map(|a| b.iter().map(move |b| (a, b)));
            let factors = of_two.flat_map(|(a, b)| c.iter().map(move |c| [a.clone(), b.clone(), c.clone()]));
            let effects = factors.map(|factors| Effect::new(port, &factors)).filter(|each| each.validate().is_ok());
            let promise = |each: Effect| (bank.promise(runs, &each, left) - grammar.cost(&each), each);
            effects.map(promise).max_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut promising: Vec<(f64, Effect)> = all.into_par_iter().filter_map(best_form).collect();
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        promising.into_iter().take(most).map(|(_, effect)| effect).collect()
    }
}

/// The gates of every product of three, and the sum of the ratios of its functions. `information`: as of [`OfPort`].
fn promises(
    gates: &[Gate],
    functions: &DMatrix<f32>,
    weights: &DVector<f32>,
    information: &[DMatrix<f32>],
) -> Vec<(f64, [usize; 3])> {
    let of_first = |a: usize| {
        let end = gates[a].functions.end;
        let later = functions.columns_range(end..).into_owned();
        let mut sums = DMatrix::<f32>::zeros(later.ncols(), later.ncols());
        for f in gates[a].functions.clone() {
            let scores = weighed(&later, &weights.component_mul(&functions.column(f))).transpose() * &later;
            let each = sums.iter_mut().zip(scores.iter().zip(&information[f]));
            each.for_each(|(sum, (&score, &information))| *sum += ratio(score, information) as f32);
        }
        let of_two = move |b: usize, c: usize| {
            let [b_functions, c_functions] = [b, c].map(|gate| gates[gate].functions.clone());
            let all = b_functions.flat_map(|g| c_functions.clone().map(move |h| (g - end, h - end)));
            (all.map(|at| f64::from(sums[at])).sum::<f64>(), [a, b, c])
        };
        let later_gates = (a + 1..gates.len()).flat_map(move |b| (b + 1..gates.len()).map(move |c| (b, c)));
        later_gates.map(|(b, c)| of_two(b, c)).collect::<Vec<_>>()
    };
    (0..gates.len()).flat_map(of_first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of five gates of two functions each the product of the first function of the second, the second of the third and the first of the fifth is what is left.
    #[test]
    fn the_product_that_is_left_promises_most() {
        let wave = |row: usize, function: usize| ((row * (2 * function + 3)) as f32 * 0.37 + function as f32).sin();
        let functions = DMatrix::from_fn(400, 10, wave);
        let gate = |i: usize| Gate { forms: Vec::new(), signal: i, functions: 2 * i..2 * i + 2 };
        let gates: Vec<Gate> = (0..5).map(gate).collect();
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
