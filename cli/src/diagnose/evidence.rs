//! How much a candidate explains, whether chance would do as well, and whether it predictive_gain.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use north_finder::effects::Basis;

use super::candidate::{Candidate, Columns, Part};
use super::estimate::coefficients;
use super::problem::{Chosen, Problem};
use super::statistics::{chi_square_tail, dot, f_tail, median, orthonormalise};

/// Most that a run can say against a curve.
const AGAINST_A_CURVE: f64 = 50.0;
/// Share of a column that other runs and other columns must leave for its coefficient to be told without a run.
const TOLD: f64 = 1e-6;
/// Fewest runs of which one need not be heard.
const HEARD: usize = 6;

/// Fall of the weighted sum of squares by columns beside a basis.
pub fn improvement(basis: &[Vec<f64>], left: &[f64], columns: Columns) -> f64 {
    orthonormalise(basis, columns).iter().map(|each| dot(each, left).powi(2)).sum()
}

/// Scored of an improvement: Schwarz' criterion with the price of the search for the constant.
pub fn score(candidate: &Candidate, improvement: f64, rows: usize) -> f64 {
    // Among harmonics that the angles cannot tell apart the lowest is the likeliest; what happens in every run at the same
    // second is rare.
    let rare = match (candidate.basis(), &candidate.part) {
        (Some(Basis::BodyHarmonic(harmonic)), _) => f64::from(harmonic.order) - 1.0,
        (Some(Basis::Step(_) | Basis::Line(_)), _) => 5.0,
        (_, Part::LevelBias { .. }) => 0.5,
        _ => 0.0,
    };
    let search = 2.0 * (candidate.grid.len().max(1) as f64).ln();
    improvement - candidate.freedom() as f64 * (rows as f64).ln() - search - rare
}

/// How many trials a candidate's p-value pays for.
pub fn searched(candidate: &Candidate, candidates: usize) -> f64 {
    (candidate.grid.len().max(1) * candidates) as f64
}

/// Probability that chance alone improves as much as the last of the chosen did: F where what is left is not white,
/// chi-square where it is; by the scatter of the surveyed headings where the evidence lies in these.
pub fn p_value(problem: &Problem, candidates: &[Candidate], trial: &[Chosen], improvement: f64) -> f64 {
    let Some(&(index, constant)) = trial.last() else { return 1.0 };
    let candidate = &candidates[index];
    let basis = problem.basis(candidates, trial);
    let left = problem.left(&basis);
    let freedom = candidate.freedom() as f64;
    let by_cells = dispersed_tail(improvement, freedom, problem.overdispersion(&left, basis.len()));
    if problem.by_references(candidate, constant) < 0.5 {
        return by_cells;
    }
    let Some((taken, _)) = coefficients(problem, candidates, trial) else { return 1.0 };
    let errors: Vec<_> = problem.azimuth_errors(&problem.effects(&taken)).into_iter().flatten().collect();
    let among = errors.len() as f64 - freedom;
    if among < 1.0 {
        return 1.0;
    }
    let chi_square: f64 = errors.iter().map(|(error, sigma)| (error / sigma).powi(2)).sum();
    by_cells.max(dispersed_tail(improvement, freedom, (chi_square / among, among)))
}

fn dispersed_tail(improvement: f64, freedom: f64, (ratio, among): (f64, f64)) -> f64 {
    if among < 1.0 {
        return chi_square_tail(improvement, freedom);
    }
    // Two sigma of a chi-square over its degrees of freedom.
    if ratio <= 1.0 + 2.0 * (2.0 / among).sqrt() {
        return chi_square_tail(improvement / ratio.max(1.0), freedom);
    }
    f_tail(improvement / (freedom * ratio), freedom, among)
}

/// Whether the chosen effects are the same in every run: by how much the sum of squares would fall if every run had
/// coefficients of its own, over the dispersion, and the number of these.
pub fn homogeneity(problem: &Problem, candidates: &[Candidate], chosen: &[Chosen]) -> (f64, f64) {
    let Some((taken, _)) = coefficients(problem, candidates, chosen) else { return (0.0, 0.0) };
    let basis = problem.basis(candidates, chosen);
    let left = problem.left(&basis);
    let dispersion = problem.overdispersion(&left, basis.len()).0.max(1.0);
    let columns: Columns =
        chosen.iter().flat_map(|&(index, constant)| problem.projected(&candidates[index], constant)).collect();
    let number = taken.iter().map(|each| each.coefficients.len()).sum::<usize>() as f64;
    let (mut fall, mut free) = (0.0, -number);
    for range in problem.ranges() {
        let own: Columns = columns.iter().map(|column| column[range.clone()].to_vec()).collect();
        let span = orthonormalise(&[], own);
        fall += span.iter().map(|each| dot(each, &left[range.clone()]).powi(2)).sum::<f64>();
        free += span.len() as f64;
    }
    (fall / dispersion, free.max(0.0))
}

/// How much better the chosen effects predict a run from the others than the same without the last: twice the logarithm
/// of the ratio of the predictive densities, summed over the runs. A run that the others know nothing about, because its
/// channels went elsewhere, says next to nothing. Of six runs or more the one that speaks against it most is not heard: its
/// reference may be wrong. And against a curve in a channel no run speaks louder than by a bound: it may be the only one
/// whose channel went through a bend.
pub fn predictive_gain(problem: &Problem, candidates: &[Candidate], trial: &[Chosen]) -> Predictive {
    let columns: Columns =
        trial.iter().flat_map(|&(index, constant)| problem.projected(&candidates[index], constant)).collect();
    let last = trial.last().map_or(0, |&(index, _)| candidates[index].coefficients());
    let basis = problem.basis(candidates, trial);
    let of_cells = problem.overdispersion(&problem.left(&basis), basis.len()).0;
    // On a base that moves the azimuths of the seconds are no measure: they become right by the dwell only.
    let moves = trial.iter().any(|&(index, _)| candidates[index].is_base_motion());
    let of_references = if moves { 1.0 } else { reference_dispersion(problem, candidates, trial) };
    let dispersion = of_cells.max(of_references).max(1.0);
    let without = predictive(problem, &columns[..columns.len() - last], dispersion);
    let with = predictive(problem, &columns, dispersion);
    let is_curve = trial.last().is_some_and(|&(index, _)| candidates[index].is_spline());
    let least = if is_curve { -AGAINST_A_CURVE } else { f64::NEG_INFINITY };
    let gains: Vec<f64> = with.iter().zip(&without).map(|(with, without)| (with - without).max(least)).collect();
    let worst = if gains.len() < HEARD { 0.0 } else { gains.iter().copied().fold(0.0, f64::min) };
    let gain = gains.iter().sum::<f64>() - worst;
    Predictive { gain, steady: gain - gains.iter().copied().fold(0.0, f64::max) }
}

/// Predictive power, twice the logarithm of odds.
#[derive(Clone, Copy, Debug)]
pub struct Predictive {
    pub gain: f64,
    /// Without the run that gains most.
    pub steady: f64,
}

impl Predictive {
    /// Odds that it is chance, for a candidate among so many that were searched; one lucky run is not enough.
    pub fn p_value(&self, searched: f64) -> f64 {
        (searched * (-0.5 * self.steady).exp()).min(1.0)
    }
}

/// By how much the runs' azimuths miss their references more than their sigmas say, a variance; from their median, which a
/// wrong reference does not move (that of a squared normal is 0.4549).
fn reference_dispersion(problem: &Problem, candidates: &[Candidate], trial: &[Chosen]) -> f64 {
    let Some((taken, _)) = coefficients(problem, candidates, trial) else { return 1.0 };
    let errors = problem.azimuth_errors(&problem.effects(&taken));
    median(errors.into_iter().flatten().map(|(error, sigma)| (error / sigma).powi(2)).collect()) / 0.4549
}

/// Twice the logarithm of the predictive density of every run from the others, but for what does not depend on the
/// columns; 0 where the others cannot say anything.
fn predictive(problem: &Problem, columns: &[Vec<f64>], dispersion: f64) -> Vec<f64> {
    let number = columns.len();
    if number == 0 {
        return vec![0.0; problem.blocks.len()];
    }
    let Sums { runs, all, .. } = Sums::new(problem, columns);
    // Of a run with columns X and residual y, the others having (XᵀX)⁻¹ = C and coefficients b: the residual y − Xb has the
    // covariance I + X C Xᵀ, whose inverse is I − X (C⁻¹ + XᵀX)⁻¹ Xᵀ and whose determinant |I + C XᵀX|.
    let density = |(gram, right): &(DMatrix<f64>, DVector<f64>)| -> Option<f64> {
        let others = (&all.0 - gram).cholesky()?;
        let whole = all.0.clone().cholesky()?;
        let b = others.solve(&(&all.1 - right));
        let missed = right - gram * &b;
        let squares = b.dot(&(gram * &b)) - 2.0 * b.dot(right) - missed.dot(&whole.solve(&missed));
        let spread = 2.0 * (whole.l().diagonal().map(f64::ln).sum() - others.l().diagonal().map(f64::ln).sum());
        Some(-squares / dispersion - spread)
    };
    runs.iter().map(|run| density(run).unwrap_or(0.0)).collect()
}

/// Gram matrices and right sides of columns, run by run and of all runs.
struct Sums {
    runs: Vec<(DMatrix<f64>, DVector<f64>)>,
    all: (DMatrix<f64>, DVector<f64>),
    /// What every column was divided by.
    scale: Vec<f64>,
}

impl Sums {
    fn new(problem: &Problem, columns: &[Vec<f64>]) -> Self {
        let number = columns.len();
        let scale: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt().max(f64::MIN_POSITIVE)).collect();
        let of_run = |range: &std::ops::Range<usize>| {
            let part = |i: usize| &columns[i][range.clone()];
            let gram = DMatrix::from_fn(number, number, |i, j| dot(part(i), part(j)) / (scale[i] * scale[j]));
            let right = DVector::from_fn(number, |i, _| dot(part(i), &problem.y()[range.clone()]) / scale[i]);
            (gram, right)
        };
        let runs: Vec<_> = problem.ranges().map(|range| of_run(&range)).collect();
        let mut all = (DMatrix::identity(number, number) * 1e-9, DVector::zeros(number));
        for (gram, right) in &runs {
            all.0 += gram;
            all.1 += right;
        }
        Self { runs, all, scale }
    }
}

/// Coefficients of the chosen effects as the runs without one give them, by the file of that one.
pub fn left_out(problem: &Problem, candidates: &[Candidate], chosen: &[Chosen]) -> BTreeMap<String, Vec<f64>> {
    let columns: Columns =
        chosen.iter().flat_map(|&(index, constant)| problem.projected(&candidates[index], constant)).collect();
    let Sums { runs, all, scale } = Sums::new(problem, &columns);
    let without = |(gram, right): &(DMatrix<f64>, DVector<f64>)| {
        let others = (&all.0 - gram).cholesky()?;
        // What the other runs say nothing about cannot be told.
        let told = others.l_dirty().diagonal().iter().all(|pivot| pivot * pivot > TOLD);
        let found = others.solve(&(&all.1 - right));
        told.then(|| found.iter().zip(&scale).map(|(value, scale)| value / scale).collect::<Vec<f64>>())
    };
    problem.blocks.iter().zip(&runs).filter_map(|(block, run)| Some((block.run.file.clone(), without(run)?))).collect()
}
