//! Columns of effects in the rows of runs: the firmware's own factors, evaluated by the second and averaged to rows.

use std::collections::HashMap;

use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;

use super::rows::Run;

/// Columns of an effect for one unit of its weights' priors, °/h: by weight and row, all runs one after the other.
pub type Values = Vec<Vec<f64>>;
/// Functions of a factor by the row, all runs one after the other, each for one unit of its prior.
pub type Functions = Vec<Vec<f32>>;

/// What is known of the functions of factors in some runs.
#[derive(Default)]
pub struct Library {
    known: HashMap<String, Functions>,
    gains: Vec<(Port, Vec<f64>)>,
}

impl Library {
    pub fn new(runs: &[Run], known: HashMap<String, Functions>) -> Self {
        let gains =
            Port::ALL.into_iter().map(|port| (port, runs.iter().flat_map(|run| run.gains(port)).collect())).collect();
        Self { known, gains }
    }

    /// Columns of an effect.
    pub fn values(&self, runs: &[Run], effect: &Effect) -> Values {
        let found: Vec<std::borrow::Cow<'_, Functions>> =
            effect.factors.iter().map(|factor| self.functions(runs, factor)).collect();
        let gains = self.gains.iter().find(|(port, _)| *port == effect.port).map_or(&[][..], |(_, gains)| gains);
        let mut columns: Values = vec![gains.to_vec()];
        for functions in &found {
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
    pub fn functions(&self, runs: &[Run], factor: &Factor) -> std::borrow::Cow<'_, Functions> {
        match self.known.get(&key(factor)) {
            Some(known) => std::borrow::Cow::Borrowed(known),
            None => std::borrow::Cow::Owned(functions(runs, factor)),
        }
    }
}

/// The key of a factor in a library.
pub fn key(factor: &Factor) -> String {
    format!("{factor:?}")
}

/// Evaluates a factor.
pub fn functions(runs: &[Run], factor: &Factor) -> Functions {
    let mut all: Functions = vec![Vec::new(); factor.count()];
    for run in runs {
        for (k, (function, values)) in all.iter_mut().zip(run.functions_by_row(factor)).enumerate() {
            let prior = factor.shape.prior(k);
            function.extend(values.into_iter().map(|value| (prior * value) as f32));
        }
    }
    all
}
