//! Columns of effects in the rows of runs: the firmware's own factors, evaluated by the second and averaged to rows.

use std::sync::{Arc, Mutex};

use lru::LruCache;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;

use super::rows::Run;

/// Columns of an effect for one unit of its weights' priors, °/h: by weight and row, all runs one after the other.
pub type Values = Vec<Vec<f64>>;
/// Functions of a factor by the row, all runs one after the other, each for one unit of its prior.
pub type Functions = Arc<[Vec<f32>]>;

/// Most values that are kept of what was evaluated last, 64 MB: while the constants of one factor are tuned, those of the others are asked for again and again.
const MOST_KEPT: usize = 16 << 20;
/// Least value of a function in some row for which the rows say anything of its weight: of a bump the flank at 2.6 of its widths. The weight of one
/// that is smaller everywhere is fitted to the residual of its flank, and is wrong where another run goes to its middle.
const OBSERVED: f32 = 0.03;

/// Functions of factors in some runs, kept for a while once they were evaluated.
pub struct Library {
    last: Mutex<Last>,
    gains: Vec<(Port, Vec<f64>)>,
}

/// What was evaluated last, and how many values that is.
struct Last {
    functions: LruCache<String, Functions>,
    values: usize,
}

impl Last {
    fn keep(&mut self, key: String, functions: Functions) {
        self.values += size(&functions);
        self.values -= self.functions.put(key, functions).map_or(0, |replaced| size(&replaced));
        while self.values > MOST_KEPT
            && let Some((_, oldest)) = self.functions.pop_lru()
        {
            self.values -= size(&oldest);
        }
    }
}

fn size(functions: &[Vec<f32>]) -> usize {
    functions.iter().map(Vec::len).sum()
}

impl Library {
    pub fn new(runs: &[Run]) -> Self {
        let gains =
            Port::ALL.into_iter().map(|port| (port, runs.iter().flat_map(|run| run.gains(port)).collect())).collect();
        Self { last: Mutex::new(Last { functions: LruCache::unbounded(), values: 0 }), gains }
    }

    /// Columns of an effect.
    pub fn values(&self, runs: &[Run], effect: &Effect) -> Values {
        let gains = self.gains.iter().find(|(port, _)| *port == effect.port).map_or(&[][..], |(_, gains)| gains);
        let mut columns: Values = vec![gains.to_vec()];
        for factor in &effect.factors {
            let functions = self.functions(runs, factor);
            let times = |column: &Vec<f64>, function: &Vec<f32>| -> Vec<f64> {
                column.iter().zip(function).map(|(a, b)| a * f64::from(*b)).collect()
            };
            columns = columns
                .iter()
                .flat_map(|column| functions.iter().map(move |function| times(column, function)))
                .collect();
        }
        columns
    }

    /// The functions of a factor.
    pub fn functions(&self, runs: &[Run], factor: &Factor) -> Functions {
        let key = key(factor);
        if let Some(known) = self.last.lock().ok().and_then(|mut last| last.functions.get(&key).cloned()) {
            return known;
        }
        let functions = evaluated(runs, factor);
        if let Ok(mut last) = self.last.lock() {
            last.keep(key, functions.clone());
        }
        functions
    }
}

fn key(factor: &Factor) -> String {
    format!("{factor:?}")
}

fn evaluated(runs: &[Run], factor: &Factor) -> Functions {
    let mut all: Vec<Vec<f32>> = vec![Vec::new(); factor.count()];
    for run in runs {
        for (k, (function, values)) in all.iter_mut().zip(run.functions_by_row(factor)).enumerate() {
            let prior = factor.prior(k);
            function.extend(values.into_iter().map(|value| (prior * value) as f32));
        }
    }
    all.iter_mut().enumerate().for_each(|(k, function)| drop_unobserved(function, factor.prior(k) as f32));
    all.into()
}

/// Sets a function that no row observes to zero, so that its weight keeps its prior. Its values are for one unit of its prior.
fn drop_unobserved(function: &mut [f32], prior: f32) {
    if function.iter().all(|value| value.abs() < OBSERVED * prior) {
        function.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// exp(−2.7²/2) = 0.026 is less than three hundredths, and 0.034 at 2.6 widths is more; both times the prior.
    #[test]
    fn a_function_that_no_row_observes_has_no_weight() {
        let flank = |widths: f32| 0.25 * (-0.5 * widths * widths).exp();
        let mut unobserved = [flank(3.0), flank(2.7)];
        drop_unobserved(&mut unobserved, 0.25);
        assert_eq!(unobserved, [0.0; 2]);
        let mut at_its_edge = [flank(3.0), flank(2.6)];
        drop_unobserved(&mut at_its_edge, 0.25);
        assert_eq!(at_its_edge, [flank(3.0), flank(2.6)]);
    }
}
