//! The evidence of a model: every run's azimuth, amplitude and bias, and the weights of all effects, are integrated out.
//!
//! Of all runs together y = Φ w + N u + e: Φ the columns of the effects with weights w ~ N(0, s² diag p²), a size s for every effect, N those
//! of the runs' own unknowns, e white noise and a process of every run's own. Linear and Gaussian, so that the marginal likelihood is exact
//! (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 2.7).

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn, Matrix2, Matrix3, RealField, Vector2, Vector3};
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};

use super::family::Known;
use super::functions::{Library, Values};
use super::process::Whitener;
use super::rows::{self, Run, UNKNOWNS};

/// A column of all runs with independent errors of variance 1, without what the runs' own unknowns explain: the inner product of two is that of
/// `rows` less that of `explained`.
#[derive(Clone, Debug)]
pub struct Column {
    rows: Vec<f64>,
    explained: Vec<f64>,
}

impl Column {
    /// Inner product under the inverse of the runs' covariance.
    pub fn dot(&self, other: &Self) -> f64 {
        dot(&self.rows, &other.rows) - dot(&self.explained, &other.explained)
    }

    /// What one run adds to it: its rows, and the numbers of its unknowns.
    fn dot_of_run(&self, other: &Self, rows: Range<usize>, unknowns: Range<usize>) -> f64 {
        dot(&self.rows[rows.clone()], &other.rows[rows])
            - dot(&self.explained[unknowns.clone()], &other.explained[unknowns])
    }

    fn add(&mut self, factor: f64, other: &Self) {
        self.rows.iter_mut().zip(&other.rows).for_each(|(sum, value)| *sum += factor * value);
        self.explained.iter_mut().zip(&other.explained).for_each(|(sum, value)| *sum += factor * value);
    }
}

/// The heading that the runs of one station share and nobody knows: one more unknown, of which the runs' own know nothing.
struct Station {
    /// What one sigma of it adds to the rows.
    column: Column,
    /// Root of one more than its information.
    root: f64,
    weighed: Vec<f64>,
}

/// Columns beside each other: their rows, and what the runs' own unknowns explain.
fn beside(columns: &[&Column]) -> [DMatrix<f64>; 2] {
    let parts: [fn(&Column) -> &[f64]; 2] = [|column| &column.rows, |column| &column.explained];
    parts.map(|part| {
        let rows = columns.first().map_or(0, |column| part(column).len());
        DMatrix::from_iterator(rows, columns.len(), columns.iter().flat_map(|column| part(column).iter().copied()))
    })
}

/// Inner products of columns with each other: as a product of matrices several times as quick as one by one.
pub fn dots(columns: &[&Column]) -> DMatrix<f64> {
    dots_of(&beside(columns))
}

fn dots_of([rows, explained]: &[DMatrix<f64>; 2]) -> DMatrix<f64> {
    rows.transpose() * rows - explained.transpose() * explained
}

struct OfRun {
    whitener: Whitener,
    /// The unknowns' columns, independent.
    unknowns: [Vec<f64>; UNKNOWNS],
    /// Factor of the unknowns' precision.
    factor: Cholesky<f64, nalgebra::Const<UNKNOWNS>>,
}

/// The runs with one process of their own.
pub struct Problem<'a> {
    pub runs: &'a [Run],
    of_runs: Vec<OfRun>,
    stations: Vec<Station>,
    /// What is to be explained.
    pub residual: Column,
    /// The evidence without any effect.
    pub without: f64,
}

impl<'a> Problem<'a> {
    pub fn new(runs: &'a [Run], process: Option<&Process>) -> Self {
        let of_runs: Vec<OfRun> = runs.iter().filter_map(|run| OfRun::new(run, process)).collect();
        let residuals: Vec<f64> = runs.iter().flat_map(Run::residual_deg_h).collect();
        let mut problem = Self {
            runs,
            of_runs,
            stations: Vec::new(),
            residual: Column { rows: Vec::new(), explained: Vec::new() },
            without: 0.0,
        };
        problem.stations = rows::stations(runs).iter().map(|values| problem.station(values)).collect();
        problem.residual = problem.column(&residuals);
        let determinants: f64 = problem
            .of_runs
            .iter()
            .map(|run| run.whitener.log_determinant + 2.0 * run.factor.l().diagonal().map(f64::ln).sum())
            .sum::<f64>()
            + problem.stations.iter().map(|station| 2.0 * station.root.ln()).sum::<f64>();
        problem.without = -0.5 * (problem.residual.dot(&problem.residual) + determinants);
        problem
    }

    /// Takes out what is known beforehand, °/h, by the row: what effects add on average.
    pub fn take_out(&mut self, offset: &[f64]) {
        let offset = self.column(offset);
        let before = self.residual.dot(&self.residual);
        self.residual.add(-1.0, &offset);
        self.without += 0.5 * (before - self.residual.dot(&self.residual));
    }

    /// The runs with one process of their own, and what these terms are known to add on average taken out.
    pub fn with_known(runs: &'a [Run], process: Option<&Process>, terms: &[Term]) -> Self {
        let mut problem = Self::new(runs, process);
        terms.iter().filter_map(|term| term.known.as_ref()).for_each(|(_, offset)| problem.take_out(offset));
        problem
    }

    /// Logarithm of the probability of every run by what all the others teach, with the sizes of these terms as they are, nats: p(y)/p(y without it).
    pub fn predictive(&self, terms: &[Term]) -> f64 {
        let columns: Vec<(&Column, f64)> =
            terms.iter().flat_map(|term| term.columns.iter().map(|column| (column, term.size2.sqrt()))).collect();
        let count = columns.len();
        let mut first = 0;
        let of_run = |(i, run): (usize, &OfRun)| {
            let rows = first..first + self.runs[i].rows();
            first = rows.end;
            let unknowns = UNKNOWNS * i..UNKNOWNS * (i + 1);
            let dot = |a: &Column, b: &Column| a.dot_of_run(b, rows.clone(), unknowns.clone());
            let mut gram = DMatrix::from_fn(count, count, |i, j| {
                if j <= i { columns[i].1 * columns[j].1 * dot(columns[i].0, columns[j].0) } else { 0.0 }
            });
            gram.fill_upper_triangle_with_lower_triangle();
            let right = DVector::from_iterator(count, columns.iter().map(|(c, size)| size * dot(c, &self.residual)));
            let determinant = run.whitener.log_determinant + 2.0 * run.factor.l().diagonal().map(f64::ln).sum();
            (gram, right, -0.5 * (dot(&self.residual, &self.residual) + determinant))
        };
        let of_runs: Vec<_> = self.of_runs.iter().enumerate().map(of_run).collect();
        let whole = of_runs.iter().fold(DMatrix::identity(count, count), |sum, (gram, ..)| sum + gram);
        let right = of_runs.iter().fold(DVector::zeros(count), |sum, (_, right, _)| sum + right);
        let taught = |matrix: DMatrix<f64>, right: DVector<f64>| -> Option<f64> {
            let factor = matrix.cholesky()?;
            let half = factor.l_dirty().solve_lower_triangular(&right)?;
            Some(0.5 * half.norm_squared() - factor.l_dirty().diagonal().map(f64::ln).sum())
        };
        let Some(by_all) = taught(whole.clone(), right.clone()) else { return f64::NEG_INFINITY };
        let alone = |(gram, own, without): &(DMatrix<f64>, DVector<f64>, f64)| {
            taught(&whole - gram, &right - own).map_or(f64::NEG_INFINITY, |others| without + by_all - others)
        };
        of_runs.iter().map(alone).sum()
    }

    /// Information that a run has of its azimuth beside its amplitude, its bias and the process, for one sigma of what is known of it beforehand.
    pub fn information(&self, run: usize) -> f64 {
        let Some(of_run) = self.of_runs.get(run) else { return 0.0 };
        let product = |i: usize, j: usize| dot(&of_run.unknowns[i], &of_run.unknowns[j]);
        let others = Matrix2::new(product(1, 1) + 1.0, product(1, 2), product(2, 1), product(2, 2) + 1.0);
        let across = Vector2::new(product(0, 1), product(0, 2));
        others.try_inverse().map_or(0.0, |inverse| product(0, 0) - across.dot(&(inverse * across)))
    }

    /// A column from its values by the row, all runs one after the other.
    pub fn column(&self, values: &[f64]) -> Column {
        let mut column = Column { rows: values.to_vec(), explained: Vec::with_capacity(UNKNOWNS * self.of_runs.len()) };
        let mut rest = column.rows.as_mut_slice();
        for (of_run, run) in self.of_runs.iter().zip(self.runs) {
            let (rows, after) = rest.split_at_mut(run.rows());
            of_run.whitener.apply(rows);
            column.explained.extend(of_run.explained(rows).iter());
            rest = after;
        }
        let of_stations: Vec<f64> = self.stations.iter().map(|each| each.column.dot(&column) / each.root).collect();
        column.explained.extend(of_stations);
        column
    }

    /// From what one sigma of its heading adds to the rates of all runs, before there are stations.
    fn station(&self, values: &[f64]) -> Station {
        let column = self.column(values);
        Station { root: (1.0 + column.dot(&column)).sqrt(), weighed: self.weighed(&column), column }
    }

    /// Columns from the values of an effect.
    pub fn columns(&self, values: &Values) -> Vec<Column> {
        values.iter().map(|values| self.column(values)).collect()
    }

    /// V⁻¹ times a column, by the row, all runs one after the other: what the values of any other column are multiplied with for their inner product.
    pub fn weighed(&self, column: &Column) -> Vec<f64> {
        let mut first = 0;
        let weigh = |(i, run): (usize, &OfRun)| {
            let rows = self.runs[i].rows();
            let mut values = column.rows[first..first + rows].to_vec();
            first += rows;
            let explained = Vector3::from_column_slice(&column.explained[UNKNOWNS * i..UNKNOWNS * (i + 1)]);
            // explained = L⁻¹ Nᵀ x, so that Nᵀ-ward it enters by L⁻ᵀ.
            let shares = run.factor.l().transpose().solve_upper_triangular(&explained).unwrap_or_default();
            for (k, unknown) in run.unknowns.iter().enumerate() {
                values.iter_mut().zip(unknown).for_each(|(value, unknown)| *value -= shares[k] * unknown);
            }
            run.whitener.apply_transposed(&mut values);
            values
        };
        let mut weighed: Vec<f64> = self.of_runs.iter().enumerate().flat_map(weigh).collect();
        for (station, share) in self.stations.iter().zip(column.explained.iter().skip(UNKNOWNS * self.of_runs.len())) {
            let factor = share / station.root;
            weighed.iter_mut().zip(&station.weighed).for_each(|(value, of_station)| *value -= factor * of_station);
        }
        weighed
    }

    /// What is left of the residual with these effects, as a column: the residual less the mean of what they explain.
    pub fn left(&self, terms: &[Term], fit: &Fit) -> Column {
        let mut left = self.residual.clone();
        for (column, mean) in terms.iter().flat_map(|term| &term.columns).zip(fit.scaled_means()) {
            left.add(-mean, column);
        }
        left
    }
}

impl OfRun {
    fn new(run: &Run, process: Option<&Process>) -> Option<Self> {
        let whitener = Whitener::new(run.for_whitening(), process);
        let mut unknowns = run.unknowns();
        unknowns.iter_mut().for_each(|column| whitener.apply(column));
        let precision = Matrix3::from_fn(|i, j| dot(&unknowns[i], &unknowns[j]) + if i == j { 1.0 } else { 0.0 });
        Some(Self { factor: precision.cholesky()?, whitener, unknowns })
    }

    fn explained(&self, rows: &[f64]) -> Vector3<f64> {
        let shares = Vector3::from_fn(|i, _| dot(&self.unknowns[i], rows));
        self.factor.l().solve_lower_triangular(&shares).unwrap_or_default()
    }
}

/// Inner product, several sums side by side.
pub fn dot<T: RealField + Copy>(a: &[T], b: &[T]) -> T {
    DVectorView::from_slice(a, a.len()).dot(&DVectorView::from_slice(b, a.len()))
}

/// An effect in a model.
#[derive(Clone, Debug)]
pub struct Term {
    pub effect: Effect,
    /// Its columns as they are, for one unit of the weights' priors; of an effect that is known beforehand along the root of its prior.
    pub values: Arc<Values>,
    /// The products of its functions by themselves, for one unit of the weights' priors: what they add at its port, in the port's unit.
    pub functions: Arc<Values>,
    pub columns: Vec<Column>,
    /// Square of its size, in units of its weights' priors.
    pub size2: f64,
    /// What is known of it beforehand, and what it then adds to the rates on average, by the row.
    pub known: Option<(Known, Arc<Vec<f64>>)>,
}

impl Term {
    /// Of an effect that adds to the rates and has these columns, of this size.
    pub fn of_rates(effect: Effect, values: Values, size2: f64) -> Self {
        let values = Arc::new(values);
        Self { effect, functions: values.clone(), values, columns: Vec::new(), size2, known: None }
    }

    /// Of an effect in some runs, of this size.
    pub fn new(library: &Library, runs: &[Run], effect: &Effect, size2: f64) -> Self {
        let of_rates = Self::of_rates(effect.clone(), library.values(runs, effect), size2);
        if effect.port == Port::Rate {
            return of_rates;
        }
        let functions = library.values(runs, &Effect::new(Port::Rate, &effect.factors));
        Self { functions: Arc::new(functions), ..of_rates }
    }

    /// Of an effect whose weights are known beforehand: they are mean + root · z with z ~ N(0, I).
    pub fn known(library: &Library, runs: &[Run], effect: &Effect, known: Known) -> Self {
        let own = Self::new(library, runs, effect, 1.0);
        let values = &own.values;
        let rows = values.first().map_or(0, Vec::len);
        let combined = |weights: &[f64]| -> Vec<f64> {
            let mut sum = vec![0.0; rows];
            for (column, weight) in values.iter().zip(weights) {
                sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
            }
            sum
        };
        let offset = combined(known.prior.mean.as_slice());
        let along: Values = known.prior.root.column_iter().map(|column| combined(column.as_slice())).collect();
        Self { known: Some((known, Arc::new(offset))), values: Arc::new(along), ..own }
    }

    /// The same in other runs.
    pub fn in_runs(&self, library: &Library, runs: &[Run]) -> Self {
        match &self.known {
            Some((known, _)) => Self::known(library, runs, &self.effect, known.clone()),
            None => Self::new(library, runs, &self.effect, self.size2),
        }
    }
}

/// Inner products of the columns of terms with each other and with the residual.
#[derive(Clone, Debug)]
pub struct Gram {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    /// Number of the term of each column.
    owner: Vec<usize>,
}

impl Gram {
    pub fn new(problem: &Problem<'_>, terms: &[Term]) -> Self {
        let columns: Vec<&Column> = terms.iter().flat_map(|term| &term.columns).collect();
        let matrix = dots(&columns);
        let right = DVector::from_iterator(columns.len(), columns.iter().map(|column| column.dot(&problem.residual)));
        let owner = terms.iter().enumerate().flat_map(|(i, term)| std::iter::repeat_n(i, term.columns.len())).collect();
        Self { matrix, right, owner }
    }
}

/// A model's weights and its evidence, for given sizes.
pub struct Fit {
    pub evidence: f64,
    scales: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// L⁻¹ S right.
    half: DVector<f64>,
    owner: Vec<usize>,
    /// L⁻¹ S times the terms' columns, in rows and in what the unknowns explain: for what further columns have in common with them.
    along: OnceLock<[DMatrix<f64>; 2]>,
}

impl Fit {
    /// `None` where a size is no number.
    pub fn new(problem: &Problem<'_>, gram: &Gram, sizes2: &[f64]) -> Option<Self> {
        let scales = DVector::from_iterator(gram.owner.len(), gram.owner.iter().map(|&term| sizes2[term].sqrt()));
        let matrix = DMatrix::from_fn(scales.len(), scales.len(), |i, j| {
            scales[i] * gram.matrix[(i, j)] * scales[j] + if i == j { 1.0 } else { 0.0 }
        });
        let factor = matrix.cholesky()?;
        let half = factor.l_dirty().solve_lower_triangular(&gram.right.component_mul(&scales))?;
        let log_determinant = factor.l_dirty().diagonal().map(f64::ln).sum();
        let evidence = problem.without + 0.5 * half.norm_squared() - log_determinant;
        Some(Self { evidence, scales, factor, half, owner: gram.owner.clone(), along: OnceLock::new() })
    }

    /// Means of the weights, in units of their priors.
    pub fn scaled_means(&self) -> Vec<f64> {
        let inner = self
            .factor
            .l_dirty()
            .transpose()
            .solve_upper_triangular(&self.half)
            .unwrap_or_else(|| DVector::zeros(self.scales.len()));
        inner.component_mul(&self.scales).iter().copied().collect()
    }

    /// Covariance of the weights, in units of their priors.
    pub fn scaled_covariance(&self) -> DMatrix<f64> {
        let inverse = self.factor.inverse();
        DMatrix::from_fn(self.scales.len(), self.scales.len(), |i, j| self.scales[i] * inverse[(i, j)] * self.scales[j])
    }

    /// Sizes that raise the evidence (MacKay, Neural Computation 4, 1992, p. 448): squares of the means by the degrees of freedom that the data
    /// determine.
    fn next_sizes2(&self, sizes2: &[f64]) -> Vec<f64> {
        let means = self.scaled_means();
        let inverse = self.factor.inverse();
        let mut determined = vec![0.0; sizes2.len()];
        let mut squares = vec![0.0; sizes2.len()];
        for (i, &term) in self.owner.iter().enumerate() {
            determined[term] += 1.0 - inverse[(i, i)];
            squares[term] += means[i] * means[i];
        }
        determined
            .iter()
            .zip(squares)
            .zip(sizes2)
            .map(|((determined, squares), &size2)| if *determined > 1e-9 { squares / determined } else { size2 })
            .collect()
    }

    /// What more the evidence would be with further columns of one effect, at its best size: (gain, size²). `terms` are those of the fit.
    pub fn gain_of(&self, problem: &Problem<'_>, terms: &[Term], columns: &[Column]) -> (f64, f64) {
        let columns: Vec<&Column> = columns.iter().collect();
        let further = beside(&columns);
        let mut own = dots_of(&further);
        let residual = columns.iter().map(|column| column.dot(&problem.residual));
        let mut right = DVector::from_iterator(columns.len(), residual);
        if !self.scales.is_empty() {
            let [rows, explained] = self.along.get_or_init(|| self.along(terms));
            let half = rows * &further[0] - explained * &further[1];
            own -= half.tr_mul(&half);
            right -= half.tr_mul(&self.half);
        }
        best_size(own, &right)
    }

    fn along(&self, terms: &[Term]) -> [DMatrix<f64>; 2] {
        let columns: Vec<&Column> = terms.iter().flat_map(|term| &term.columns).collect();
        beside(&columns).map(|part| {
            let mut along = part.transpose();
            along.column_iter_mut().for_each(|mut column| column.component_mul_assign(&self.scales));
            // The factor of a positive matrix has no 0 on its diagonal.
            self.factor.l_dirty().solve_lower_triangular_mut(&mut along);
            along
        })
    }
}

/// The size at which a group of columns has the greatest evidence: (gain, size²). In the columns' principal directions with information λ and
/// score y it is Σ ½ s²y²/(1 + s²λ) − ½ ln(1 + s²λ).
fn best_size(own: DMatrix<f64>, right: &DVector<f64>) -> (f64, f64) {
    let eigen = own.symmetric_eigen();
    let scores = eigen.eigenvectors.tr_mul(right);
    let gain = |size2: f64| -> f64 {
        let of = |(lambda, score): (&f64, &f64)| {
            let spread = 1.0 + size2 * lambda.max(0.0);
            0.5 * (size2 * score * score / spread - spread.ln())
        };
        eigen.eigenvalues.iter().zip(scores.iter()).map(of).sum()
    };
    let information = eigen.eigenvalues.max();
    if !(information > 0.0 && information.is_finite()) {
        return (0.0, 0.0);
    }
    // From what moves the strongest direction by a tenth of its error to ten thousand errors; the gain is smooth in the logarithm.
    let size2 = |i: i32| 10f64.powf(-2.0 + 0.5 * f64::from(i)) / information;
    let best = (0..=20).max_by(|&a, &b| gain(size2(a)).total_cmp(&gain(size2(b)))).unwrap_or(0);
    let (mut low, mut high) = (size2(best - 1).ln(), size2(best + 1).ln());
    for _ in 0..8 {
        let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
        if gain(a.exp()) < gain(b.exp()) { low = a } else { high = b }
    }
    let found = (0.5 * (low + high)).exp();
    (gain(found), found)
}

/// About the same gain from some sizes alone, without principal directions, and the weights then: what is quick enough for thousands of proposals.
pub fn quick_gain(own: &DMatrix<f32>, right: &DVector<f32>) -> (f64, DVector<f32>) {
    let none = (0.0, DVector::zeros(right.len()));
    let information = own.diagonal().max();
    if !(information > 0.0 && information.is_finite()) {
        return none;
    }
    let at = |power: f32| {
        let size2 = 10f32.powf(power) / information;
        let factor = (DMatrix::identity(own.nrows(), own.ncols()) + own * size2).cholesky()?;
        let half = factor.l_dirty().solve_lower_triangular(right)?;
        let log_determinant: f32 = factor.l_dirty().diagonal().map(f32::ln).sum();
        Some((f64::from(0.5 * size2 * half.norm_squared() - log_determinant), size2, factor))
    };
    let best = [-1.0, 0.5, 2.0, 3.5].into_iter().filter_map(at).max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or(none, |(gain, size2, factor)| (gain.max(0.0), factor.solve(right) * size2))
}

/// Fits the sizes of terms by turns, from those that they have.
pub fn fit_sizes(problem: &Problem<'_>, gram: &Gram, terms: &mut [Term], turns: usize) -> Option<Fit> {
    let mut sizes2: Vec<f64> = terms.iter().map(|term| term.size2).collect();
    let mut fit = Fit::new(problem, gram, &sizes2)?;
    for _ in 0..turns {
        let mut next = fit.next_sizes2(&sizes2);
        // What is known beforehand has the size that it has.
        let known = terms.iter().zip(&mut next).filter(|(term, _)| term.known.is_some());
        known.for_each(|(term, next)| *next = term.size2);
        // Geometric damping keeps a first step from overshooting.
        let next: Vec<f64> = next.iter().zip(&sizes2).map(|(next, last)| (next.max(1e-30) * last).sqrt()).collect();
        let Some(better) = Fit::new(problem, gram, &next) else { break };
        let change = next.iter().zip(&sizes2).map(|(a, b)| (a / b).ln().abs()).fold(0.0, f64::max);
        sizes2 = next;
        fit = better;
        if change < 0.02 {
            break;
        }
    }
    terms.iter_mut().zip(&sizes2).for_each(|(term, &size2)| term.size2 = size2);
    Some(fit)
}

#[cfg(test)]
mod tests {
    use north_finder::effects::doubt::Kernel;

    use super::*;

    /// The probability of a run by all the others is the evidence of all runs less that of the others.
    #[test]
    fn every_run_is_predicted_by_the_others() {
        let rates = |shift: f64| -> Vec<f64> { (0..12).map(|i| (1.7 * f64::from(i) + shift).sin() * 9.0).collect() };
        let runs: Vec<Run> = [0.0, 0.4, 1.1].map(|shift| Run::of_rates(&rates(shift))).into();
        let function = |n: usize| -> Vec<f64> { (0..36).map(|i| (0.3 * (i * n) as f64).cos()).collect() };
        let values = [function(1), function(2)];
        let process = Process { kernel: Kernel::Exponential, sigma_deg_h: 0.8, time_s: 4.0 };
        let with = |chosen: &[usize]| {
            let runs: Vec<Run> = chosen.iter().map(|&i| runs[i].clone()).collect();
            let own = |all: &Vec<f64>| chosen.iter().flat_map(|i| all[12 * i..12 * (i + 1)].to_vec()).collect();
            let values: Values = values.iter().map(own).collect();
            let problem = Problem::new(&runs, Some(&process));
            let effect = Effect::new(north_finder::effects::effect::Port::Rate, &[]);
            let columns = problem.columns(&values);
            let terms = [Term { columns, ..Term::of_rates(effect, values, 0.7) }];
            let evidence = Fit::new(&problem, &Gram::new(&problem, &terms), &[0.7]).unwrap().evidence;
            (evidence, problem.predictive(&terms))
        };
        let (of_all, predictive) = with(&[0, 1, 2]);
        let expected: f64 = [[1, 2], [0, 2], [0, 1]].map(|others| of_all - with(&others).0).into_iter().sum();
        assert!((predictive - expected).abs() < 1e-8, "{predictive} {expected}");
    }
}
