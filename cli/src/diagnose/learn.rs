//! Selection: which candidates the residual asks for, paid for by the search; their parameters with sigmas.

use north_finder::model::ErrorModel;
use rayon::prelude::*;

use super::candidate::{Candidate, Columns, Shape};
use super::problem::Block;
use super::statistics::{chi_square_tail, dot, f_tail, least_squares, orthonormalise, subtract};

/// A candidate is taken when chance alone would do as well in fewer campaigns than this share, after paying for the search.
pub const ACCEPT: f64 = 0.01;
/// Most effects that are taken.
const MOST_EFFECTS: usize = 6;
/// Folds of the cross-validation inside the selection.
const FOLDS: usize = 4;
/// Candidates whose score (in noise variances) is within this of the chosen one's explain the campaign as well: odds of
/// e^(9.2/2) = 100 to 1.
pub const AS_GOOD: f64 = 9.2;
/// Seconds that are averaged for the test whether what is left is white.
const BLOCK_CELLS: usize = 12;

/// An effect with its constant and coefficients.
#[derive(Clone, Debug)]
pub struct Taken {
    pub candidate: Candidate,
    pub constant: f64,
    pub coefficients: Vec<f64>,
    pub sigmas: Vec<f64>,
    pub constant_sigma: f64,
    pub improvement: f64,
    pub p_value: f64,
    /// Candidates that explain as much in its place, with their constants.
    pub rivals: Vec<(Candidate, f64)>,
    /// Share of the evidence that lies in the surveyed headings.
    pub by_references: f64,
}

/// A candidate's merit at one stage.
#[derive(Clone, Debug)]
pub struct Merit {
    pub index: usize,
    pub constant: f64,
    /// Fall of the weighted sum of squares.
    pub improvement: f64,
    pub score: f64,
}

/// What was learned.
#[derive(Clone, Debug, Default)]
pub struct Learned {
    pub taken: Vec<Taken>,
    /// Covariance of all coefficients, in the order of the effects.
    pub covariance: Vec<Vec<f64>>,
    /// Each candidate's merit before anything was taken.
    pub first: Vec<Merit>,
    /// The best that was left at the end, with its p-value.
    pub runner_up: Option<(String, f64)>,
    /// Variance of what is left over blocks of seconds, in units of white noise.
    pub left: f64,
    pub left_freedom: f64,
}

impl Learned {
    /// The error model with the effects in it, over `base`.
    pub fn model(&self, base: &ErrorModel) -> ErrorModel {
        self.model_with(base, &self.taken.iter().flat_map(|each| each.coefficients.clone()).collect::<Vec<_>>())
    }

    /// The same with other coefficients.
    pub fn model_with(&self, base: &ErrorModel, coefficients: &[f64]) -> ErrorModel {
        let mut model = base.clone();
        let mut rest = coefficients;
        for each in &self.taken {
            let (own, others) = rest.split_at(each.coefficients.len());
            rest = others;
            match (&each.candidate.shape, each.candidate.term(each.constant, own)) {
                // The solver takes the accelerometers' measure of a slow creep out by itself.
                (Shape::BaseMotion, _) => {}
                (_, Some(term)) => {
                    let _ = model.terms.push(term);
                }
                (_, None) => model.scale_error += own.first().copied().unwrap_or(0.0),
            }
        }
        model
    }
}

/// Runs side by side: the global residual and columns.
pub struct Problem<'a, 'b> {
    pub blocks: &'b [Block<'a>],
    y: Vec<f64>,
}

impl<'a, 'b> Problem<'a, 'b> {
    pub fn new(blocks: &'b [Block<'a>]) -> Self {
        let y = blocks.iter().flat_map(|block| block.project(&block.y)).collect();
        Self { blocks, y }
    }

    /// Weighted columns of a candidate over all runs.
    pub fn weighted(&self, candidate: &Candidate, constant: f64) -> Columns {
        self.gather(candidate, constant, |_, column| column)
    }

    /// The same beside every run's own azimuth and bias.
    pub fn projected(&self, candidate: &Candidate, constant: f64) -> Columns {
        self.gather(candidate, constant, |block, column| block.project(&column))
    }

    fn gather(&self, candidate: &Candidate, constant: f64, map: impl Fn(&Block, Vec<f64>) -> Vec<f64>) -> Columns {
        let mut all: Columns = vec![Vec::with_capacity(self.y.len()); candidate.coefficients()];
        for block in self.blocks {
            let columns = candidate.columns(block.run, constant, &block.smooth_deg_h, block.azimuth_deg);
            for (whole, column) in all.iter_mut().zip(block.weighted(&columns)) {
                whole.extend(map(block, column));
            }
        }
        all
    }

    fn residual(&self, basis: &[Vec<f64>]) -> Vec<f64> {
        let mut left = self.y.clone();
        for each in basis {
            let along = dot(&left, each);
            subtract(&mut left, along, each);
        }
        left
    }

    /// Sum of squares of means over blocks of seconds inside stays, over its degrees of freedom: 1 for white noise.
    pub fn overdispersion(&self, left: &[f64], taken: usize) -> (f64, f64) {
        let (mut sum, mut count) = (0.0, 0.0);
        let mut start = 0;
        for block in self.blocks {
            let cells = &block.run.cells;
            let (mut total, mut number, mut stay) = (0.0, 0.0, usize::MAX);
            let mut flush = |total: &mut f64, number: &mut f64| {
                if *number > 0.0 {
                    sum += *total * *total / *number;
                    count += 1.0;
                }
                (*total, *number) = (0.0, 0.0);
            };
            for (i, cell) in cells.iter().enumerate() {
                if cell.stay != stay || number >= BLOCK_CELLS as f64 {
                    flush(&mut total, &mut number);
                    stay = cell.stay;
                }
                if block.root_weight[i] > 0.0 {
                    total += left[start + i];
                    number += 1.0;
                }
            }
            flush(&mut total, &mut number);
            count -= if block.tied { 1.0 } else { 3.0 };
            start += cells.len() + 2;
        }
        let freedom = count - taken as f64;
        if freedom >= 3.0 { (sum / freedom, freedom) } else { (1.0, 0.0) }
    }

    /// Errors of the runs' own azimuths against their references when these effects are taken out: errors and sigmas.
    pub fn azimuth_errors(&self, effects: &[f64]) -> Vec<Option<(f64, f64)>> {
        let mut start = 0;
        self.blocks
            .iter()
            .map(|block| {
                let end = start + block.y.len();
                let own = &effects[start..end];
                start = end;
                if block.tied { block.azimuth_error_deg(own) } else { None }
            })
            .collect()
    }

    /// Weighted sum of effects in the layout of the residual.
    pub fn effects(&self, taken: &[Taken]) -> Vec<f64> {
        let mut sum = vec![0.0; self.y.len()];
        for each in taken {
            for (column, coefficient) in self.weighted(&each.candidate, each.constant).iter().zip(&each.coefficients) {
                subtract(&mut sum, -coefficient, column);
            }
        }
        sum
    }

    pub fn rows(&self) -> usize {
        self.y.len()
    }
}

/// Learns from runs. `candidates` are tried one after the other until none is worth its price.
pub fn learn(blocks: &[Block<'_>], candidates: &[Candidate]) -> Learned {
    let problem = Problem::new(blocks);
    let cache: Vec<Vec<(f64, Columns)>> = candidates
        .par_iter()
        .map(|candidate| constants(candidate).iter().map(|&each| (each, problem.projected(candidate, each))).collect())
        .collect();
    let mut learned = Learned::default();
    let mut chosen: Vec<(usize, f64)> = Vec::new();
    loop {
        let basis = basis_of(&problem, candidates, &chosen);
        let left = problem.residual(&basis);
        let merits = merits(candidates, &cache, &basis, &left, problem.rows(), &chosen);
        if learned.first.is_empty() {
            learned.first = merits.clone();
        }
        let Some(best) = merits.iter().max_by(|a, b| a.score.total_cmp(&b.score)) else { break };
        let best = refined(&problem, candidates, &basis, &left, best.clone());
        let candidate = &candidates[best.index];
        let trial = [chosen.as_slice(), &[(best.index, best.constant)]].concat();
        let p_value =
            p_value(&problem, candidates, &trial, best.improvement, candidate) * searched(candidate, candidates.len());
        let convinces = p_value < ACCEPT && chosen.len() < MOST_EFFECTS && foretells(&problem, candidates, &trial);
        if !convinces {
            learned.runner_up = Some((candidate.name.clone(), p_value.min(1.0)));
            break;
        }
        chosen = trial;
        if chosen.len() > 1 {
            reconsider(&problem, candidates, &mut chosen);
        }
    }
    prune(&problem, candidates, &mut chosen);
    finish(&problem, candidates, &cache, &chosen, &mut learned);
    learned
}

/// Whether the last of the chosen effects foretells runs that its coefficients were not fitted to: cross-validation in
/// blocks of whole runs.
fn foretells(problem: &Problem, candidates: &[Candidate], trial: &[(usize, f64)]) -> bool {
    let folds = FOLDS.min(problem.blocks.len());
    if folds < 2 {
        return true;
    }
    let columns: Columns =
        trial.iter().flat_map(|&(index, constant)| problem.projected(&candidates[index], constant)).collect();
    let last = trial.last().map_or(0, |&(index, _)| candidates[index].coefficients());
    let without = &columns[..columns.len() - last];
    let mut fall = 0.0;
    for fold in 0..folds {
        let mut inside = Vec::with_capacity(problem.y.len());
        for (i, block) in problem.blocks.iter().enumerate() {
            inside.extend(std::iter::repeat_n(i % folds == fold, block.y.len()));
        }
        let taught = |values: &[f64]| -> Vec<f64> {
            values.iter().zip(&inside).map(|(value, inside)| if *inside { 0.0 } else { *value }).collect()
        };
        let missed = |columns: &[Vec<f64>]| -> Option<f64> {
            let kept: Columns = columns.iter().map(|column| taught(column)).collect();
            let kept: Vec<&[f64]> = kept.iter().map(Vec::as_slice).collect();
            let (found, _) =
                if kept.is_empty() { (vec![], vec![]) } else { least_squares(&kept, &taught(&problem.y))? };
            let mut left = problem.y.clone();
            for (column, coefficient) in columns.iter().zip(&found) {
                subtract(&mut left, *coefficient, column);
            }
            Some(left.iter().zip(&inside).filter(|(_, inside)| **inside).map(|(value, _)| value * value).sum())
        };
        match (missed(without), missed(&columns)) {
            (Some(before), Some(after)) => fall += before - after,
            _ => return true,
        }
    }
    fall > 0.0
}

fn constants(candidate: &Candidate) -> Vec<f64> {
    if candidate.grid.is_empty() { vec![0.0] } else { candidate.grid.clone() }
}

/// How many trials a candidate's p-value pays for.
pub fn searched(candidate: &Candidate, candidates: usize) -> f64 {
    (candidate.grid.len().max(1) * candidates) as f64
}

fn basis_of(problem: &Problem, candidates: &[Candidate], chosen: &[(usize, f64)]) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for &(index, constant) in chosen {
        let new = orthonormalise(&basis, problem.projected(&candidates[index], constant));
        basis.extend(new);
    }
    basis
}

fn improvement(basis: &[Vec<f64>], left: &[f64], columns: Columns) -> f64 {
    orthonormalise(basis, columns).iter().map(|each| dot(each, left).powi(2)).sum()
}

fn score(candidate: &Candidate, improvement: f64, rows: usize) -> f64 {
    // Among harmonics that the angles cannot tell apart the lowest is the likeliest.
    let order = match candidate.shape {
        Shape::Harmonic(order) => f64::from(order - 1),
        Shape::LevelBias(_) => 0.5,
        _ => 0.0,
    };
    let search = 2.0 * (candidate.grid.len().max(1) as f64).ln();
    improvement - candidate.freedom() as f64 * (rows as f64).ln() - search - order
}

fn merits(
    candidates: &[Candidate],
    cache: &[Vec<(f64, Columns)>],
    basis: &[Vec<f64>],
    left: &[f64],
    rows: usize,
    chosen: &[(usize, f64)],
) -> Vec<Merit> {
    candidates
        .par_iter()
        .zip(cache)
        .enumerate()
        .filter(|(index, _)| chosen.iter().all(|(taken, _)| taken != index))
        .filter_map(|(index, (candidate, columns))| {
            columns
                .iter()
                .map(|(constant, columns)| (*constant, improvement(basis, left, columns.clone())))
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .map(|(constant, improvement)| Merit {
                    index,
                    constant,
                    improvement,
                    score: score(candidate, improvement, rows),
                })
        })
        .collect()
}

/// The non-linear constant by golden section between the neighbours on the grid.
fn refined(problem: &Problem, candidates: &[Candidate], basis: &[Vec<f64>], left: &[f64], mut merit: Merit) -> Merit {
    let candidate = &candidates[merit.index];
    let of = |constant: f64| improvement(basis, left, problem.projected(candidate, constant));
    let (constant, improvement) = golden(candidate, merit.constant, of);
    if improvement > merit.improvement {
        merit.score += improvement - merit.improvement;
        (merit.constant, merit.improvement) = (constant, improvement);
    }
    merit
}

fn golden(candidate: &Candidate, about: f64, of: impl Fn(f64) -> f64) -> (f64, f64) {
    let mut sorted = candidate.grid.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    if sorted.is_empty() {
        return (about, of(about));
    }
    let place = sorted.partition_point(|&each| each < about * (1.0 - 1e-9));
    let at = |i: usize| sorted[i.min(sorted.len() - 1)];
    let below = if at(place) < about * (1.0 - 1e-9) { at(place) } else { at(place.saturating_sub(1)) };
    let above = sorted.iter().copied().find(|&each| each > about * (1.0 + 1e-9)).unwrap_or(about);
    let (mut low, mut high) = (below.min(about).ln(), above.max(about).ln());
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut fa, mut fb) = (of(a.exp()), of(b.exp()));
    for _ in 0..12 {
        if fa > fb {
            (high, b, fb) = (b, a, fa);
            a = high - ratio * (high - low);
            fa = of(a.exp());
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + ratio * (high - low);
            fb = of(b.exp());
        }
    }
    if fa > fb { (a.exp(), fa) } else { (b.exp(), fb) }
}

/// Earlier constants again, now that the others are there.
fn reconsider(problem: &Problem, candidates: &[Candidate], chosen: &mut [(usize, f64)]) {
    for i in 0..chosen.len() {
        let (index, constant) = chosen[i];
        if candidates[index].grid.is_empty() {
            continue;
        }
        let others: Vec<_> = chosen.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, each)| *each).collect();
        let basis = basis_of(problem, candidates, &others);
        let left = problem.residual(&basis);
        let of = |constant: f64| improvement(&basis, &left, problem.projected(&candidates[index], constant));
        let (better, found) = golden(&candidates[index], constant, of);
        if found > of(constant) {
            chosen[i].1 = better;
        }
    }
}

/// Effects that later ones made superfluous go.
fn prune(problem: &Problem, candidates: &[Candidate], chosen: &mut Vec<(usize, f64)>) {
    loop {
        let worst =
            (0..chosen.len()).map(|i| (i, alone(problem, candidates, chosen, i).1)).max_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            Some((i, p_value)) if p_value >= ACCEPT => {
                chosen.remove(i);
            }
            _ => return,
        }
    }
}

/// Improvement and p-value of one effect beside all the others.
fn alone(problem: &Problem, candidates: &[Candidate], chosen: &[(usize, f64)], i: usize) -> (f64, f64) {
    let (index, constant) = chosen[i];
    let others: Vec<_> = chosen.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, each)| *each).collect();
    let basis = basis_of(problem, candidates, &others);
    let left = problem.residual(&basis);
    let candidate = &candidates[index];
    let found = improvement(&basis, &left, problem.projected(candidate, constant));
    (found, p_value(problem, candidates, chosen, found, candidate) * searched(candidate, candidates.len()))
}

/// Probability that chance alone improves as much: F where what is left is not white, chi-square where it is; by the
/// scatter of the surveyed headings where the evidence lies in these.
fn p_value(
    problem: &Problem,
    candidates: &[Candidate],
    trial: &[(usize, f64)],
    improvement: f64,
    candidate: &Candidate,
) -> f64 {
    let basis = basis_of(problem, candidates, trial);
    let left = problem.residual(&basis);
    let freedom = candidate.freedom() as f64;
    let by_cells = dispersed_tail(improvement, freedom, problem.overdispersion(&left, basis.len()));
    if by_references(problem, candidate, trial.last().map_or(0.0, |last| last.1)) < 0.5 {
        return by_cells;
    }
    let Some(taken) = coefficients(problem, candidates, trial) else { return 1.0 };
    let errors: Vec<_> = problem.azimuth_errors(&problem.effects(&taken.0)).into_iter().flatten().collect();
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

/// Share of a candidate's weight that only the surveyed headings give.
fn by_references(problem: &Problem, candidate: &Candidate, constant: f64) -> f64 {
    let (mut tied, mut free) = (0.0, 0.0);
    for block in problem.blocks {
        let columns = candidate.columns(block.run, constant, &block.smooth_deg_h, block.azimuth_deg);
        for column in block.weighted(&columns) {
            let left = block.project(&column);
            tied += dot(&left, &left);
            let left = block.project_free(&column);
            free += dot(&left, &left);
        }
    }
    if tied > 0.0 { 1.0 - free / tied } else { 0.0 }
}

/// Joint least squares of the chosen effects.
fn coefficients(
    problem: &Problem,
    candidates: &[Candidate],
    chosen: &[(usize, f64)],
) -> Option<(Vec<Taken>, Vec<Vec<f64>>)> {
    let columns: Vec<Columns> =
        chosen.iter().map(|&(index, constant)| problem.projected(&candidates[index], constant)).collect();
    let flat: Vec<&[f64]> = columns.iter().flatten().map(Vec::as_slice).collect();
    let (found, covariance) = if flat.is_empty() { (vec![], vec![]) } else { least_squares(&flat, &problem.y)? };
    let mut at = 0;
    let taken = chosen
        .iter()
        .map(|&(index, constant)| {
            let candidate = candidates[index].clone();
            let range = at..at + candidate.coefficients();
            at = range.end;
            Taken {
                constant,
                coefficients: found[range.clone()].to_vec(),
                sigmas: range.map(|i| covariance[i][i].sqrt()).collect(),
                constant_sigma: 0.0,
                improvement: 0.0,
                p_value: 0.0,
                rivals: Vec::new(),
                by_references: by_references(problem, &candidate, constant),
                candidate,
            }
        })
        .collect();
    Some((taken, covariance))
}

fn finish(
    problem: &Problem,
    candidates: &[Candidate],
    cache: &[Vec<(f64, Columns)>],
    chosen: &[(usize, f64)],
    learned: &mut Learned,
) {
    let basis = basis_of(problem, candidates, chosen);
    let left = problem.residual(&basis);
    (learned.left, learned.left_freedom) = problem.overdispersion(&left, basis.len());
    let Some((mut taken, mut covariance)) = coefficients(problem, candidates, chosen) else { return };
    // Where more than white noise is left, the parameters are as much less certain.
    let inflation = learned.left.max(1.0);
    covariance.iter_mut().flatten().for_each(|value| *value *= inflation);
    for (i, each) in taken.iter_mut().enumerate() {
        each.sigmas.iter_mut().for_each(|sigma| *sigma *= inflation.sqrt());
        (each.improvement, each.p_value) = alone(problem, candidates, chosen, i);
        each.constant_sigma = constant_sigma(problem, candidates, chosen, i) * inflation.sqrt();
        each.rivals = rivals(problem, candidates, cache, chosen, i);
    }
    learned.taken = taken;
    learned.covariance = covariance;
}

/// Sigma of a non-linear constant from the curvature of the sum of squares at it.
fn constant_sigma(problem: &Problem, candidates: &[Candidate], chosen: &[(usize, f64)], i: usize) -> f64 {
    let (index, constant) = chosen[i];
    let candidate = &candidates[index];
    if candidate.grid.is_empty() {
        return 0.0;
    }
    let others: Vec<_> = chosen.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, each)| *each).collect();
    let basis = basis_of(problem, candidates, &others);
    let left = problem.residual(&basis);
    let of = |constant: f64| improvement(&basis, &left, problem.projected(candidate, constant));
    let step = 0.02 * constant;
    let curvature = (2.0 * of(constant) - of(constant - step) - of(constant + step)) / (step * step);
    if curvature > 0.0 { (2.0 / curvature).sqrt() } else { constant }
}

/// Candidates that would explain as much in the place of effect `i`.
fn rivals(
    problem: &Problem,
    candidates: &[Candidate],
    cache: &[Vec<(f64, Columns)>],
    chosen: &[(usize, f64)],
    i: usize,
) -> Vec<(Candidate, f64)> {
    let (index, constant) = chosen[i];
    let others: Vec<_> = chosen.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, each)| *each).collect();
    let basis = basis_of(problem, candidates, &others);
    let left = problem.residual(&basis);
    let own = improvement(&basis, &left, problem.projected(&candidates[index], constant));
    let own_score = score(&candidates[index], own, problem.rows());
    let mut found: Vec<Merit> = merits(candidates, cache, &basis, &left, problem.rows(), &others)
        .into_iter()
        .filter(|merit| merit.index != index && !candidates[merit.index].is_kin(&candidates[index]))
        .filter(|merit| merit.score > own_score - 4.0 * AS_GOOD)
        .map(|merit| refined(problem, candidates, &basis, &left, merit))
        .filter(|merit| merit.score > own_score - AS_GOOD)
        .collect();
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found.into_iter().map(|merit| (candidates[merit.index].clone(), merit.constant)).collect()
}
