//! Proposals by the thousand, judged by a score: which are worth an exact look.

use std::collections::BTreeMap;
use std::iter::Sum;
use std::ops::{Div, Range};
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use rayon::prelude::*;

use super::evaluation_cache::EvaluationCache;
use super::functions::{Functions, Library, size};
use super::grammar::Grammar;
use super::problem::{dot, quick_gain, squares};
use super::process::{Instants, Whitener};
use super::rows::{Run, UNKNOWNS};
use super::unknowns::Unknowns;

/// Rows of one run by which products are judged: means over some seconds; what stands alone is judged by every row.
const COARSE_ROWS: usize = 48;
const ALL_COARSE_ROWS: usize = 640;
const LEAST_COARSE_ROWS: usize = 16;
/// Proposals of the same signal at the same port, bare ones and as many behind dynamics.
const OF_THE_SAME_SIGNAL: usize = 4;
/// What the unknowns leave of columns is rounding of single precision where it is no more than this of them, in squares: rounding itself leaves some 10⁻¹⁴.
const ROUNDING: f32 = 1e-9;

/// All rows of all runs, one after the other: where each run ends, the precision of every row, and what the runs' unknowns take away.
pub struct Rows {
    pub ends: Vec<usize>,
    pub precision: Vec<f32>,
    pub unknowns: Vec<Unknowns>,
}

impl Rows {
    /// From the precisions of each run's rows, and what one sigma of its unknowns adds to them.
    fn new(by_run: Vec<(Vec<f32>, [Vec<f64>; UNKNOWNS])>) -> Self {
        let mut all = Self { ends: Vec::new(), precision: Vec::new(), unknowns: Vec::new() };
        for (precision, mut unknowns) in by_run {
            for column in &mut unknowns {
                column.iter_mut().zip(&precision).for_each(|(row, precision)| *row *= f64::from(*precision).sqrt());
            }
            all.precision.extend(precision);
            all.ends.push(all.precision.len());
            all.unknowns.push(Unknowns::new(unknowns));
        }
        all
    }

    /// The information that a column has of its weight in white noise, beside the unknowns of every run.
    fn information(&self, column: &[f32]) -> f32 {
        let mut white: Vec<f32> =
            column.iter().zip(&self.precision).map(|(row, precision)| row * precision.sqrt()).collect();
        let mut rest = white.as_mut_slice();
        let mut first = 0;
        for (end, unknowns) in self.ends.iter().zip(&self.unknowns) {
            let (of_run, after) = rest.split_at_mut(end - first);
            unknowns.take_out(of_run);
            (rest, first) = (after, *end);
        }
        dot(&white, &white)
    }
}

/// What a model leaves of the residual, in coarse rows: what proposals are judged by.
pub struct Left {
    /// V⁻¹ times it, summed by coarse row.
    pub sums: DVector<f32>,
    by_run: Vec<LeftOfRun>,
}

struct LeftOfRun {
    /// Roots of the precisions of the rows: what makes them independent without a process.
    roots: Vec<f32>,
    /// The same beside a process.
    whitener: Option<Whitener>,
    /// What the run's unknowns take away of independent rows.
    unknowns: Unknowns,
}

impl LeftOfRun {
    /// Makes columns of all runs, of `length` rows each, independent in the rows of this run, the first of which is `first`. `lanes` is room to work in.
    fn make_independent(&self, columns: &mut [f32], length: usize, first: usize, lanes: &mut Vec<f64>) {
        if let Some(whitener) = &self.whitener {
            return whitener.apply_all(columns, length, first, lanes, |value| value as f32);
        }
        for column in columns.chunks_mut(length.max(1)) {
            column[first..].iter_mut().zip(&self.roots).for_each(|(value, root)| *value *= root);
        }
    }
}

impl Left {
    /// About what columns of one effect gain beside the model and the unknowns of every run, and their weights; nothing where the unknowns leave nothing.
    pub fn gain(&self, columns: &[DVector<f32>]) -> (f64, DVector<f32>) {
        let right = DVector::from_iterator(
            columns.len(),
            columns.iter().map(|column| dot(column.as_slice(), self.sums.as_slice())),
        );
        let length = self.sums.len();
        let mut white: Vec<f32> = Vec::with_capacity(length * columns.len());
        columns.iter().for_each(|column| white.extend_from_slice(column.as_slice()));
        // Sums of the squares before the unknowns are taken out.
        let mut whole = vec![0.0_f32; columns.len()];
        let (mut first, mut lanes) = (0, Vec::new());
        for run in &self.by_run {
            run.make_independent(&mut white, length, first, &mut lanes);
            let rows = first..first + run.roots.len();
            for (column, whole) in white.chunks_mut(length.max(1)).zip(&mut whole) {
                let own = &mut column[rows.clone()];
                *whole += dot(own, own);
                run.unknowns.take_out(own);
            }
            first = rows.end;
        }
        let squares = squares(&DMatrix::from_vec(length, columns.len(), white));
        if squares.diagonal().max() <= ROUNDING * whole.into_iter().fold(0.0, f32::max) {
            return (0.0, DVector::zeros(columns.len()));
        }
        quick_gain(&squares, &right)
    }
}

/// About what the evidence gains by a column at its best size: half of ratio − 1 − ln ratio, the ratio that of the square of its score to its
/// information.
pub fn gain(score: f32, information: f32) -> f64 {
    let ratio = if information > 0.0 { f64::from(score).powi(2) / f64::from(information) } else { 0.0 };
    if ratio > 1.0 { 0.5 * (ratio - 1.0 - ratio.ln()) } else { 0.0 }
}

/// So many of each kind that promise most, with what they promise, kind by kind.
pub fn best_of_each<Kind: Ord, T>(most: usize, all: impl IntoIterator<Item = (Kind, f64, T)>) -> Vec<(f64, T)> {
    let mut kinds: BTreeMap<Kind, Vec<(f64, T)>> = BTreeMap::new();
    for (kind, promise, each) in all {
        let kept = kinds.entry(kind).or_default();
        let place = kept.iter().take_while(|(above, _)| *above >= promise).count();
        kept.insert(place, (promise, each));
        kept.truncate(most);
    }
    kinds.into_values().flatten().collect()
}

/// So many that promise most, the most promising first.
pub fn most_promising<T>(mut all: Vec<(f64, T)>, most: usize) -> Vec<(f64, T)> {
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.truncate(most);
    all
}

fn product(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// An effect of one factor: its number, what its form costs, the information of each of its columns.
struct Proposal {
    effect: Effect,
    cost: f64,
    factor: Option<usize>,
    information: Vec<f32>,
}

impl Proposal {
    /// Its port and signal, and whether the signal is bare.
    fn kind(&self) -> (Port, Option<(String, bool)>) {
        let factor = self.effect.factors.first();
        (self.effect.port, factor.map(|factor| (factor.signal.to_string(), factor.dynamics.is_empty())))
    }
}

/// All effects of one factor.
pub struct Bank {
    rows: Rows,
    pub coarse: Rows,
    /// By port: what the rate of a row changes by, of rows and of coarse rows.
    gains: Vec<(Port, Vec<f32>, Vec<f32>)>,
    factors: Vec<Factor>,
    /// Functions of the factors in rows.
    functions: Vec<Functions>,
    proposals: Vec<Proposal>,
    /// Rows of every coarse row.
    coarse_rows: Vec<Range<usize>>,
    coarse_functions: EvaluationCache<Functions>,
    library: Arc<Library>,
}

impl Bank {
    pub fn new(runs: &[Run], grammar: &Grammar, factors: &[Factor]) -> Self {
        let library = grammar.library.clone();
        let mut first = 0;
        let mut coarse_rows = Vec::new();
        let mut of_coarse = Vec::new();
        let precision = |run: &Run, rows: Range<usize>| run.variance[rows].iter().map(|v| 1.0 / *v as f32).sum::<f32>();
        let most = (ALL_COARSE_ROWS / runs.len().max(1)).clamp(LEAST_COARSE_ROWS, COARSE_ROWS);
        for run in runs {
            let coarse = run.coarse(most);
            let unknowns = run.unknowns().map(|fine| means(&coarse, &fine));
            of_coarse.push((coarse.iter().map(|rows| precision(run, rows.clone())).collect(), unknowns));
            coarse_rows.extend(coarse.into_iter().map(|rows| rows.start + first..rows.end + first));
            first += run.rows();
        }
        let of_rows = |run: &Run| ((0..run.rows()).map(|i| precision(run, i..i + 1)).collect(), run.unknowns());
        let rows = Rows::new(runs.iter().map(of_rows).collect());
        let coarse = Rows::new(of_coarse);
        let means = |fine: &[f32]| means(&coarse_rows, fine);
        let gains: Vec<(Port, Vec<f32>, Vec<f32>)> = Port::ALL
            .into_iter()
            .map(|port| {
                let fine: Vec<f32> = runs.iter().flat_map(|run| run.gains(port)).map(|gain| gain as f32).collect();
                let coarse = means(&fine);
                (port, fine, coarse)
            })
            .collect();
        let functions: Vec<Functions> = factors.par_iter().map(|factor| library.functions(runs, factor)).collect();
        factors.iter().zip(&functions).for_each(|(factor, functions)| library.hold(factor, functions));
        let coarse_functions = EvaluationCache::new(size);
        let mut bank = Self {
            rows,
            coarse,
            gains,
            factors: factors.to_vec(),
            functions,
            proposals: Vec::new(),
            coarse_rows,
            coarse_functions,
            library,
        };
        let none = grammar.ports_of_constants.iter().filter(|&&port| port != Port::Rate).map(|&port| (port, None));
        let forms = (0..factors.len()).flat_map(|i| grammar.ports.iter().map(move |&port| (port, Some(i))));
        let forms: Vec<(Port, Option<usize>)> = none.chain(forms).collect();
        let proposal = |(port, factor): (Port, Option<usize>)| {
            let chosen: Vec<Factor> = factor.map(|i| factors[i].clone()).into_iter().collect();
            let effect = Effect::new(port, &chosen);
            effect.validate().ok()?;
            let information = bank.columns(port, factor).iter().map(|column| bank.rows.information(column)).collect();
            Some(Proposal { cost: grammar.cost(&effect), effect, factor, information })
        };
        bank.proposals = forms.into_par_iter().filter_map(proposal).collect();
        bank
    }

    /// The columns of a proposal.
    fn columns(&self, port: Port, factor: Option<usize>) -> Vec<Vec<f32>> {
        let (_, fine, _) = self.gains_at(port);
        factor.map_or_else(|| vec![fine.clone()], |i| self.functions[i].iter().map(|f| product(fine, f)).collect())
    }

    fn gains_at(&self, port: Port) -> &(Port, Vec<f32>, Vec<f32>) {
        self.gains.iter().find(|(each, ..)| *each == port).unwrap_or(&self.gains[0])
    }

    /// What the rate of a coarse row changes by, by unit of what an effect adds at a port.
    pub fn coarse_gains(&self, port: Port) -> &[f32] {
        &self.gains_at(port).2
    }

    /// Factors of the bank, each with its functions by coarse row.
    pub fn coarse_factors(&self, is_wanted: impl Fn(&Factor) -> bool + Sync) -> Vec<(&Factor, Functions)> {
        let coarse = |fine: &Functions| fine.iter().map(|f| means(&self.coarse_rows, f)).collect::<Functions>();
        let wanted = self.factors.par_iter().zip(&self.functions).filter(|(factor, _)| is_wanted(factor));
        wanted.map(|(factor, functions)| (factor, coarse(functions))).collect()
    }

    /// The functions of a factor by coarse row.
    pub fn coarse_functions(&self, runs: &[Run], factor: &Factor) -> Functions {
        let coarse = || self.library.functions(runs, factor).iter().map(|f| means(&self.coarse_rows, f)).collect();
        self.coarse_functions.of(factor, coarse)
    }

    /// The effects of one factor that promise most, the first of them first. `weighed`: V⁻¹ times what is left of the residual, by the row.
    pub fn shortlist(&self, runs: &[Run], weighed: &[f64], left: &Left, most: usize) -> Vec<Effect> {
        let fine: Vec<f32> = weighed.iter().map(|value| *value as f32).collect();
        // The rate that a unit at each port is worth.
        let heavy: Vec<(Port, Vec<f32>)> = self.gains.iter().map(|(port, f, _)| (*port, product(f, &fine))).collect();
        let proposals = self.proposals.par_iter();
        let scored: Vec<_> = proposals.map(|each| (each.kind(), self.promise_of(each, &heavy), each)).collect();
        let best = best_of_each(OF_THE_SAME_SIGNAL, scored).into_par_iter();
        let promises = best.map(|(_, each)| (self.promise(runs, &each.effect, left) - each.cost, &each.effect));
        most_promising(promises.collect(), most).into_iter().map(|(_, effect)| effect.clone()).collect()
    }

    fn promise_of(&self, proposal: &Proposal, heavy: &[(Port, Vec<f32>)]) -> f64 {
        let (_, fine) = heavy.iter().find(|(port, _)| *port == proposal.effect.port).unwrap_or(&heavy[0]);
        let scores: Vec<f32> = match proposal.factor {
            None => vec![fine.iter().sum()],
            Some(i) => self.functions[i].iter().map(|f| dot(fine, f)).collect(),
        };
        scores.into_iter().zip(&proposal.information).map(|(score, &information)| gain(score, information)).sum()
    }

    /// About what an effect gains beside a model, in coarse rows.
    pub fn promise(&self, runs: &[Run], effect: &Effect, left: &Left) -> f64 {
        left.gain(&self.coarse_columns(runs, effect)).0
    }

    /// What an effect adds to the rate with the weights that fit what a model leaves, by coarse row.
    pub fn fitted(&self, runs: &[Run], effect: &Effect, left: &Left) -> DVector<f32> {
        let columns = self.coarse_columns(runs, effect);
        let (_, weights) = left.gain(&columns);
        let rows = DVector::zeros(left.sums.len());
        columns.iter().zip(weights.iter()).fold(rows, |sum, (column, weight)| sum + column * *weight)
    }

    fn coarse_columns(&self, runs: &[Run], effect: &Effect) -> Vec<DVector<f32>> {
        as_surface(self.coarse_products(runs, effect), effect)
    }

    /// Products of the functions of an effect's factors, each for one unit of its prior.
    fn coarse_products(&self, runs: &[Run], effect: &Effect) -> Vec<DVector<f32>> {
        let own = vec![DVector::from_column_slice(self.coarse_gains(effect.port))];
        effect
            .factors
            .iter()
            .map(|factor| self.coarse_functions(runs, factor))
            .fold(own, |columns, functions| products(&columns, &functions))
    }

    /// What the shape of a factor gets, by coarse row.
    pub fn input(&self, runs: &[Run], factor: &Factor) -> Input {
        let inputs = self.library.inputs(runs, factor);
        let of_row = |rows: &Range<usize>| {
            let known = inputs[rows.clone()].iter().filter(|input| input.is_finite());
            let (count, sum) = known.fold((0, 0.0), |(count, sum), input| (count + 1, sum + input));
            (sum / count as f64, count as f32 / rows.len() as f32)
        };
        let (mean, share) = self.coarse_rows.iter().map(of_row).unzip();
        Input { mean, share }
    }

    /// What one factor of an effect is multiplied with.
    pub fn beside_factor(&self, runs: &[Run], effect: &Effect, factor: usize) -> Beside {
        let factors = effect.factors.iter().enumerate().filter(|(f, _)| *f != factor);
        let others = Effect::new(effect.port, &factors.map(|(_, each)| each.clone()).collect::<Vec<Factor>>());
        Beside { products: self.coarse_products(runs, &others), factors: others.factors.to_vec() }
    }

    /// What a model leaves, from V⁻¹ times it by the row.
    pub fn left(&self, runs: &[Run], weighed: &[f64], process: Option<&Process>) -> Left {
        let sum = |rows: &Range<usize>| weighed[rows.clone()].iter().sum::<f64>() as f32;
        let sums = DVector::from_iterator(self.coarse_rows.len(), self.coarse_rows.iter().map(sum));
        let mut first = (0, 0);
        let of_run = |(run, &end): (&Run, &usize)| {
            let (coarse, precision) = (&self.coarse_rows[first.1..end], &self.coarse.precision[first.1..end]);
            let own: Vec<Range<usize>> = coarse.iter().map(|rows| rows.start - first.0..rows.end - first.0).collect();
            first = (first.0 + run.rows(), end);
            let t_s = means(&own, &run.t_s);
            let variance: Vec<f64> = precision.iter().map(|precision| 1.0 / f64::from(*precision)).collect();
            let rests_s: Vec<f64> = own.iter().map(|rows| run.rests_s[rows.start]).collect();
            let gains = means(&own, &run.gains_of(process));
            let instants = Instants { t_s: &t_s, rests_s: &rests_s, variance: &variance, gains: &gains };
            let whitener = Whitener::new(instants, process);
            let mut unknowns = run.unknowns().map(|fine| means(&own, &fine));
            unknowns.iter_mut().for_each(|column| whitener.apply(column));
            LeftOfRun {
                roots: precision.iter().map(|precision| precision.sqrt()).collect(),
                whitener: process.is_some().then_some(whitener),
                unknowns: Unknowns::new(unknowns),
            }
        };
        let by_run = runs.iter().zip(&self.coarse.ends).map(of_run).collect();
        Left { sums, by_run }
    }
}

/// What the shape of a factor gets, by coarse row.
pub struct Input {
    mean: Vec<f64>,
    /// Share of the row in which its signal says something.
    share: Vec<f32>,
}

/// What one factor of an effect is multiplied with, by coarse row.
pub struct Beside {
    /// Products of the other factors' functions.
    products: Vec<DVector<f32>>,
    /// The other factors.
    factors: Vec<Factor>,
}

impl Beside {
    /// About the effect's columns with this factor, whose shape gets the mean of a coarse row.
    pub fn columns(&self, factor: &Factor, input: &Input) -> Vec<DVector<f32>> {
        let mut functions = vec![vec![0.0; input.mean.len()]; factor.count()];
        for (row, (&input, &share)) in input.mean.iter().zip(&input.share).enumerate() {
            if input.is_finite() {
                let values = factor.values(input);
                functions
                    .iter_mut()
                    .zip(values)
                    .enumerate()
                    .for_each(|(k, (function, value))| function[row] = share * (factor.prior(k) * value) as f32);
            }
        }
        let factors = [self.factors.as_slice(), std::slice::from_ref(factor)].concat();
        as_surface(products(&self.products, &functions), &Effect::new(Port::Rate, &factors))
    }
}

/// Products of the functions of an effect's factors for one unit of its weights' priors.
fn as_surface(mut products: Vec<DVector<f32>>, effect: &Effect) -> Vec<DVector<f32>> {
    products.iter_mut().enumerate().for_each(|(number, column)| *column *= effect.of_surface(number) as f32);
    products
}

/// Every column by every function.
fn products(columns: &[DVector<f32>], functions: &[Vec<f32>]) -> Vec<DVector<f32>> {
    let times = |column: &DVector<f32>, function: &[f32]| DVector::from_vec(product(column.as_slice(), function));
    columns.iter().flat_map(|column| functions.iter().map(move |function| times(column, function))).collect()
}

/// Means over coarse rows.
fn means<T: Copy + Sum + Div<Output = T> + From<f32>>(coarse_rows: &[Range<usize>], fine: &[T]) -> Vec<T> {
    let mean = |rows: &Range<usize>| fine[rows.clone()].iter().copied().sum::<T>() / T::from(rows.len() as f32);
    coarse_rows.iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use north_finder::effects::shape::Linear;
    use north_finder::effects::signal::Time;

    use super::*;

    /// A column that is the same in every row of its run is another bias: whatever is left, nothing is gained, although a further column of the effect
    /// varies by 10⁻¹⁵. Of 1, −1, 1, −1 the square is 4 and the score 8: more than nothing.
    #[test]
    fn what_the_bias_explains_gains_nothing() {
        let unknowns = Unknowns::new([vec![0.0; 4], vec![0.0; 4], vec![1e3; 4]]);
        let by_run = vec![LeftOfRun { roots: vec![1.0; 4], whitener: None, unknowns }];
        let left = Left { sums: DVector::from_column_slice(&[2.0, -2.0, 2.001, -2.0]), by_run };
        let column = |rows: [f32; 4]| DVector::from_column_slice(&rows);
        assert_eq!(left.gain(&[column([1.0; 4]), column([1e-15, 2e-15, 3e-15, 4e-15])]).0, 0.0);
        assert!(left.gain(&[column([1.0, -1.0, 1.0, -1.0])]).0 > 0.0);
    }

    /// By hand: 2, 2, 2 by a constant, 1, and by a line, 0 at 1 and 1 at 3, of the values 1, none and 3; of the third row half says something.
    #[test]
    fn a_shape_gets_the_mean_of_a_coarse_row() {
        let input = Input { mean: vec![1.0, f64::NAN, 3.0], share: vec![1.0, 0.0, 0.5] };
        let beside = Beside { products: vec![DVector::from_element(3, 2.0)], factors: Vec::new() };
        let line = Factor::new(Time.into(), &[], Linear { reference: 1.0, scale: 2.0 }.into()).with_constant();
        let columns: Vec<Vec<f32>> =
            beside.columns(&line, &input).iter().map(|column| column.as_slice().to_vec()).collect();
        assert_eq!(columns, [[2.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    }
}
