//! Columns of effects in the rows of runs: the firmware's own factors, evaluated by the second and averaged to rows.

use std::sync::Arc;

use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;

use super::evaluation_cache::EvaluationCache;
use super::grammar::IDENTITY;
use super::rows::Run;

/// Columns of an effect for one unit of its weights' priors, °/h: by weight and row, all runs one after the other.
pub type Values = Vec<Vec<f64>>;
/// Functions of a factor by the row, all runs one after the other, each for one unit of its prior.
pub type Functions = Arc<[Vec<f32>]>;
/// What a factor's shape gets: the mean of what comes out of the dynamics, by the row and all runs one after the other; not-a-number where nothing does.
pub type Inputs = Arc<[f64]>;

/// Least value of a function in some row for which the rows say anything of its weight: of a bump the flank at 2.6 of its widths. The weight of one
/// that is smaller everywhere is fitted to the residual of its flank, and is wrong where another run goes to its middle.
const OBSERVED: f32 = 0.03;

/// Functions of factors in some runs, kept for a while once they were evaluated.
pub struct Library {
    functions: EvaluationCache<Functions>,
    inputs: EvaluationCache<Inputs>,
    gains: Vec<(Port, Vec<f64>)>,
}

/// How many values these are.
pub fn size(functions: &Functions) -> usize {
    functions.iter().map(Vec::len).sum()
}

impl Library {
    pub fn new(runs: &[Run]) -> Self {
        let gains =
            Port::ALL.into_iter().map(|port| (port, runs.iter().flat_map(|run| run.gains(port)).collect())).collect();
        Self {
            functions: EvaluationCache::new(size),
            inputs: EvaluationCache::new(|inputs: &Inputs| 2 * inputs.len()),
            gains,
        }
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

    /// The functions of a factor: means over the seconds of each row.
    pub fn functions(&self, runs: &[Run], factor: &Factor) -> Functions {
        self.functions.of(factor, || evaluated(runs, factor))
    }

    /// What the shape of a factor gets.
    pub fn inputs(&self, runs: &[Run], factor: &Factor) -> Inputs {
        let input = Factor { shape: IDENTITY, constant: false, ..factor.clone() };
        self.inputs.of(&input, || runs.iter().flat_map(|run| run.inputs_by_row(&input)).collect())
    }
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
