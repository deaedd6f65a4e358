//! Columns of effects in the rows of runs: the firmware's own factors, evaluated by the second and averaged to rows.

use std::ops::{Deref, Range};
use std::sync::Arc;

use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::part::Span;
use north_finder::effects::shape::{Shape, Smooth};

use super::evaluation_cache::EvaluationCache;
use super::rows::{Run, depends_on_azimuth, functions_of_rows};
use super::spans::{IDENTITY, span};

/// Columns of an effect for one unit of its weights' priors, °/h: by weight and row, all runs one after the other.
pub type Values = Vec<Vec<f64>>;
/// Functions of a factor by the row, all runs one after the other, each for one unit of its prior: some of those that were evaluated together.
#[derive(Clone)]
pub struct Functions {
    all: Arc<[Vec<f32>]>,
    own: Range<usize>,
}
/// What a factor's shape gets: what comes out of the dynamics, by the row or by the second of all rows, all runs one after the other; not-a-number where
/// nothing does.
pub type Inputs = Arc<[f64]>;

impl Deref for Functions {
    type Target = [Vec<f32>];

    fn deref(&self) -> &[Vec<f32>] {
        &self.all[self.own.clone()]
    }
}

impl FromIterator<Vec<f32>> for Functions {
    fn from_iter<I: IntoIterator<Item = Vec<f32>>>(functions: I) -> Self {
        let all: Arc<[Vec<f32>]> = functions.into_iter().collect();
        Self { own: 0..all.len(), all }
    }
}

/// Least value of a function in some row for which the rows say anything of its weight: of a bump the flank at 2.6 of its widths. The weight of one
/// that is smaller everywhere is fitted to the residual of its flank, and is wrong where another run goes to its middle.
const OBSERVED: f32 = 0.03;

/// What was evaluated of factors in some runs, kept for a while: functions, what shapes get by the second of the rows, and how that is spread.
struct Evaluated {
    functions: EvaluationCache<Functions>,
    inputs: EvaluationCache<Inputs>,
    spans: EvaluationCache<Option<Span>>,
}

impl Evaluated {
    fn new() -> Self {
        Self {
            functions: EvaluationCache::new(size),
            inputs: EvaluationCache::new(|inputs: &Inputs| 2 * inputs.len()),
            spans: EvaluationCache::new(|_| size_of::<Option<Span>>() / size_of::<f32>()),
        }
    }
}

/// Functions of factors in some runs.
pub struct Library {
    /// Of signals that are the same wherever the runs are linearised, and of the others.
    lasting: Arc<Evaluated>,
    of_azimuths: Evaluated,
    gains: Vec<(Port, Vec<f64>)>,
}

/// How many values these are.
pub fn size(functions: &Functions) -> usize {
    functions.iter().map(Vec::len).sum()
}

impl Library {
    pub fn new(runs: &[Run]) -> Self {
        Self::with(runs, Arc::new(Evaluated::new()))
    }

    /// Of the same recordings with other references, or linearised elsewhere: what does not depend on the azimuths is what it was.
    pub fn in_runs(&self, runs: &[Run]) -> Self {
        Self::with(runs, self.lasting.clone())
    }

    fn with(runs: &[Run], lasting: Arc<Evaluated>) -> Self {
        let gains =
            Port::ALL.into_iter().map(|port| (port, runs.iter().flat_map(|run| run.gains(port)).collect())).collect();
        Self { lasting, of_azimuths: Evaluated::new(), gains }
    }

    fn of(&self, factor: &Factor) -> &Evaluated {
        if depends_on_azimuth(&factor.signal) { &self.of_azimuths } else { &self.lasting }
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
        for (number, column) in columns.iter_mut().enumerate() {
            let share = effect.of_surface(number);
            column.iter_mut().for_each(|value| *value *= share);
        }
        columns
    }

    /// The functions of a factor: means over the seconds of each row.
    pub fn functions(&self, runs: &[Run], factor: &Factor) -> Functions {
        let (whole, own) = whole(factor);
        Functions { own, ..self.of(factor).functions.of(&whole, || self.evaluated(runs, &whole)) }
    }

    /// Holds the functions of a factor that is proposed as long as there is a search.
    pub fn hold(&self, factor: &Factor, functions: &Functions) {
        let own = 0..functions.all.len();
        self.of(factor).functions.hold(&whole(factor).0, Functions { own, all: functions.all.clone() });
    }

    /// How what a factor's shape gets is spread; `None` where it says nothing or does not vary.
    pub fn span(&self, runs: &[Run], factor: &Factor) -> Option<Span> {
        let input = input_of(factor);
        self.of(factor).spans.of(&input, || span(runs, &input, &self.inputs_by_second(runs, &input)))
    }

    /// What the shape of a factor gets, means over the seconds of each row.
    pub fn inputs(&self, runs: &[Run], factor: &Factor) -> Inputs {
        let by_second = self.inputs_by_second(runs, factor);
        let mut rest = &by_second[..];
        let mean = |length: usize| {
            let (row, after) = rest.split_at(length);
            rest = after;
            row.iter().sum::<f64>() / length as f64
        };
        runs.iter().flat_map(Run::row_lengths).map(mean).collect()
    }

    /// The same in every second of the rows: all shapes behind the same dynamics get it.
    fn inputs_by_second(&self, runs: &[Run], factor: &Factor) -> Inputs {
        let input = input_of(factor);
        self.of(factor)
            .inputs
            .of(&input, || runs.iter().map(|run| run.inputs(&input)).collect::<Vec<_>>().concat().into())
    }

    fn evaluated(&self, runs: &[Run], factor: &Factor) -> Functions {
        let inputs = self.inputs_by_second(runs, factor);
        let means = functions_of_rows(factor, &inputs, runs.iter().flat_map(Run::row_lengths));
        let for_prior = |(k, means): (usize, Vec<f64>)| {
            let prior = factor.prior(k);
            let mut function: Vec<f32> = means.into_iter().map(|mean| (prior * mean) as f32).collect();
            drop_unobserved(&mut function, prior as f32);
            function
        };
        means.into_iter().enumerate().map(for_prior).collect()
    }
}

/// A factor that gives what the shape of one gets.
fn input_of(factor: &Factor) -> Factor {
    Factor { shape: IDENTITY, constant: false, ..factor.clone() }
}

/// The factor that is evaluated for another one, and which of its functions are the other one's: it has a constant, and is of most functions where it is a
/// smooth curve.
fn whole(factor: &Factor) -> (Factor, Range<usize>) {
    let shape = match factor.shape {
        Shape::Smooth(Smooth { low, high, .. }) => Smooth::of_most(low, high).into(),
        shape => shape,
    };
    let first = usize::from(!factor.constant);
    (Factor { shape, constant: true, ..factor.clone() }, first..first + factor.count())
}

/// Sets a function that no row observes to zero, so that its weight keeps its prior. Its values are for one unit of its prior.
fn drop_unobserved(function: &mut [f32], prior: f32) {
    if function.iter().all(|value| value.abs() < OBSERVED * prior) {
        function.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use north_finder::effects::signal::Signal;

    use super::*;

    /// Of a smooth curve of three functions, with a constant and without, the values are the first of those of one of six: digit by digit.
    #[test]
    fn functions_are_among_those_that_are_evaluated() {
        let few = Factor::new(Signal::Since, &[], Smooth::of_few(-1.0, 4.0).into());
        for factor in [few.clone(), few.with_constant()] {
            let (whole, own) = whole(&factor);
            for x in [-2.0, 0.3, 1.7, 3.9] {
                assert_eq!(whole.values(x)[own.clone()], factor.values(x)[..]);
            }
            assert!(own.clone().map(|k| whole.prior(k)).eq((0..factor.count()).map(|k| factor.prior(k))));
        }
    }

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
