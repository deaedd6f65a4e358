//! The evidence of a model: every run's azimuth, amplitude and bias, and the weights of all effects, are integrated out.
//!
//! Of all runs together y = Φ w + N u + e: Φ the columns of the effects with weights w ~ N(0, s² diag p²), a size s for every effect, N those
//! of the runs' own unknowns, e white noise and a process of every run's own. Linear and Gaussian, so that the marginal likelihood is exact
//! (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 2.7).

use std::sync::Arc;

use nalgebra::{Cholesky, Const, DMatrix, DVector, Dyn, Matrix2, Matrix3, RealField, Vector2, Vector3};
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};

use super::family::Known;
use super::functions::{Library, Values};
use super::process::{LANES, Whitener};
use super::rows::{self, Run, UNKNOWNS};

/// Up to so many columns inner products are quicker one by one than as a product of matrices, and principal directions than a search without them.
const FEW: usize = 12;

/// A column of all runs with independent errors of variance 1, without what the runs' own unknowns explain: the inner product of two is that of
/// `rows` less that of `explained`.
#[derive(Clone, Debug)]
pub struct Column {
    rows: DVector<f64>,
    explained: DVector<f64>,
}

impl Column {
    /// Inner product under the inverse of the runs' covariance.
    pub fn dot(&self, other: &Self) -> f64 {
        self.rows.dot(&other.rows) - self.explained.dot(&other.explained)
    }
}

/// Columns beside each other.
#[derive(Clone, Debug)]
pub struct Columns {
    rows: DMatrix<f64>,
    explained: DMatrix<f64>,
}

impl Columns {
    /// Inner products with each other.
    pub fn squares(&self) -> DMatrix<f64> {
        squares(&self.rows) - squares(&self.explained)
    }

    /// Inner products with others, which are the columns of the result.
    fn products(&self, others: &Self) -> DMatrix<f64> {
        products(&self.rows, &others.rows) - products(&self.explained, &others.explained)
    }

    /// Inner products with one column.
    pub fn scores(&self, column: &Column) -> DVector<f64> {
        self.rows.tr_mul(&column.rows) - self.explained.tr_mul(&column.explained)
    }

    /// Sum of the columns with these weights.
    fn sum(&self, weights: &DVector<f64>) -> Column {
        Column { rows: &self.rows * weights, explained: &self.explained * weights }
    }

    /// Rows of each, and what the unknowns explain.
    fn each(&self) -> impl Iterator<Item = [&[f64]; 2]> {
        let [rows, explained] = [&self.rows, &self.explained].map(|all| all.as_slice().chunks(all.nrows().max(1)));
        rows.zip(explained).map(|(rows, explained)| [rows, explained])
    }
}

/// Inner products of columns with each other.
pub fn squares<T: RealField + Copy>(columns: &DMatrix<T>) -> DMatrix<T> {
    let count = columns.ncols();
    if count > FEW {
        // A transposed copy: products of matrices that are read by the row write beyond their end (matrixmultiply 0.3.11, AVX-512).
        return columns.transpose() * columns;
    }
    let mut squares = DMatrix::zeros(count, count);
    for i in 0..count {
        for j in 0..=i {
            let product = dot(columns.column(i).as_slice(), columns.column(j).as_slice());
            squares[(i, j)] = product;
            squares[(j, i)] = product;
        }
    }
    squares
}

/// Inner products of columns with others.
fn products(columns: &DMatrix<f64>, others: &DMatrix<f64>) -> DMatrix<f64> {
    if columns.ncols().min(others.ncols()) > FEW { columns.transpose() * others } else { columns.tr_mul(others) }
}

/// The heading that the runs of one station share and nobody knows: one more unknown, of which the runs' own know nothing.
struct Station {
    /// What one sigma of it adds to the rows.
    column: Column,
    /// Root of one more than its information.
    root: f64,
    weighed: Vec<f64>,
}

struct OfRun {
    whitener: Whitener,
    /// The unknowns' columns, independent.
    unknowns: DMatrix<f64>,
    /// Factor of the unknowns' precision.
    factor: Cholesky<f64, Const<UNKNOWNS>>,
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
            residual: Column { rows: DVector::zeros(0), explained: DVector::zeros(0) },
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
        self.residual.rows -= offset.rows;
        self.residual.explained -= offset.explained;
        self.without += 0.5 * (before - self.residual.dot(&self.residual));
    }

    /// The runs with one process of their own, and what these terms are known to add on average taken out.
    pub fn with_known(runs: &'a [Run], process: Option<&Process>, terms: &[Term]) -> Self {
        let mut problem = Self::new(runs, process);
        terms.iter().filter_map(|term| term.known.as_ref()).for_each(|(_, offset)| problem.take_out(offset));
        problem
    }

    /// Logarithm of the probability of every run by what all the others teach, with the sizes of a fit as they are, nats: p(y)/p(y without it).
    pub fn predictive(&self, fit: &Fit) -> f64 {
        let columns: Vec<[&[f64]; 2]> = fit.columns.each().collect();
        let residual = [self.residual.rows.as_slice(), self.residual.explained.as_slice()];
        let (count, sizes) = (columns.len(), &fit.scales);
        let mut first = 0;
        let of_run = |(i, run): (usize, &OfRun)| {
            let rows = first..first + self.runs[i].rows();
            first = rows.end;
            let unknowns = UNKNOWNS * i..UNKNOWNS * (i + 1);
            let dot = |a: [&[f64]; 2], b: [&[f64]; 2]| {
                dot(&a[0][rows.clone()], &b[0][rows.clone()]) - dot(&a[1][unknowns.clone()], &b[1][unknowns.clone()])
            };
            let mut gram = DMatrix::from_fn(count, count, |i, j| {
                if j <= i { sizes[i] * sizes[j] * dot(columns[i], columns[j]) } else { 0.0 }
            });
            gram.fill_upper_triangle_with_lower_triangle();
            let right = DVector::from_fn(count, |i, _| sizes[i] * dot(columns[i], residual));
            let determinant = run.whitener.log_determinant + 2.0 * run.factor.l().diagonal().map(f64::ln).sum();
            (gram, right, -0.5 * (dot(residual, residual) + determinant))
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
        let product = |i: usize, j: usize| of_run.unknowns.column(i).dot(&of_run.unknowns.column(j));
        let others = Matrix2::new(product(1, 1) + 1.0, product(1, 2), product(2, 1), product(2, 2) + 1.0);
        let across = Vector2::new(product(0, 1), product(0, 2));
        others.try_inverse().map_or(0.0, |inverse| product(0, 0) - across.dot(&(inverse * across)))
    }

    /// A column from its values by the row, all runs one after the other.
    pub fn column(&self, values: &[f64]) -> Column {
        let Columns { rows, explained } = self.columns(&[values]);
        let [rows, explained] = [rows, explained].map(|all| DVector::from_column_slice(all.as_slice()));
        Column { rows, explained }
    }

    /// The same of several, such as the values of an effect.
    pub fn columns<V: AsRef<[f64]>>(&self, values: &[V]) -> Columns {
        let length: usize = self.runs.iter().map(Run::rows).sum();
        let mut all: Vec<f64> = Vec::with_capacity(length * values.len());
        values.iter().for_each(|values| all.extend_from_slice(values.as_ref()));
        let unknowns = UNKNOWNS * self.of_runs.len();
        let mut explained = DMatrix::zeros(unknowns + self.stations.len(), values.len());
        let (mut first, mut lanes) = (0, Vec::new());
        for (i, (of_run, run)) in self.of_runs.iter().zip(self.runs).enumerate() {
            let own = first..first + run.rows();
            of_run.whitener.apply_all(&mut all, length, first, &mut lanes, |value| value);
            for (column, mut explained) in all.chunks(length.max(1)).zip(explained.column_iter_mut()) {
                let of_rows = of_run.explained(&column[own.clone()]);
                explained.fixed_rows_mut::<UNKNOWNS>(UNKNOWNS * i).copy_from(&of_rows);
            }
            first = own.end;
        }
        for (s, station) in self.stations.iter().enumerate() {
            let (heading, known) = (&station.column.rows, &station.column.explained);
            for (column, mut explained) in all.chunks(length.max(1)).zip(explained.column_iter_mut()) {
                let of_runs = known.dot(&explained.rows(0, unknowns));
                explained[unknowns + s] = (dot(heading.as_slice(), column) - of_runs) / station.root;
            }
        }
        Columns { rows: DMatrix::from_vec(length, values.len(), all), explained }
    }

    /// From what one sigma of its heading adds to the rates of all runs, before there are stations.
    fn station(&self, values: &[f64]) -> Station {
        let column = self.column(values);
        Station { root: (1.0 + column.dot(&column)).sqrt(), weighed: self.weighed(&column), column }
    }

    /// V⁻¹ times a column, by the row, all runs one after the other: what the values of any other column are multiplied with for their inner product.
    pub fn weighed(&self, column: &Column) -> Vec<f64> {
        let mut weighed = column.rows.as_slice().to_vec();
        let mut rest = weighed.as_mut_slice();
        for (i, (of_run, run)) in self.of_runs.iter().zip(self.runs).enumerate() {
            let (values, after) = rest.split_at_mut(run.rows());
            let explained = column.explained.fixed_rows::<UNKNOWNS>(UNKNOWNS * i);
            // explained = L⁻¹ Nᵀ x, so that Nᵀ-ward it enters by L⁻ᵀ.
            let shares = of_run.factor.l_dirty().tr_solve_lower_triangular(&explained).unwrap_or_default();
            for (share, unknown) in shares.iter().zip(of_run.unknowns.column_iter()) {
                values.iter_mut().zip(unknown.iter()).for_each(|(value, unknown)| *value -= share * unknown);
            }
            of_run.whitener.apply_transposed(values);
            rest = after;
        }
        for (station, share) in self.stations.iter().zip(column.explained.iter().skip(UNKNOWNS * self.of_runs.len())) {
            let factor = share / station.root;
            weighed.iter_mut().zip(&station.weighed).for_each(|(value, of_station)| *value -= factor * of_station);
        }
        weighed
    }

    /// What a fit leaves of the residual, as a column: the residual less the mean of what its effects explain.
    pub fn left(&self, fit: &Fit) -> Column {
        let mean = fit.columns.sum(&DVector::from_vec(fit.scaled_means()));
        Column { rows: &self.residual.rows - mean.rows, explained: &self.residual.explained - mean.explained }
    }
}

impl OfRun {
    fn new(run: &Run, process: Option<&Process>) -> Option<Self> {
        let whitener = run.whitener(process);
        let mut unknowns = DMatrix::from_vec(run.rows(), UNKNOWNS, run.unknowns().concat());
        whitener.apply_all(unknowns.as_mut_slice(), run.rows(), 0, &mut Vec::new(), |value| value);
        let product = |i: usize, j: usize| unknowns.column(i).dot(&unknowns.column(j));
        let precision = Matrix3::from_fn(|i, j| product(i, j) + if i == j { 1.0 } else { 0.0 });
        Some(Self { factor: precision.cholesky()?, whitener, unknowns })
    }

    fn explained(&self, rows: &[f64]) -> Vector3<f64> {
        let shares = Vector3::from_fn(|i, _| dot(self.unknowns.column(i).as_slice(), rows));
        self.factor.l_dirty().solve_lower_triangular(&shares).unwrap_or_default()
    }
}

/// Inner product, several sums side by side, as a processor computes with several numbers at once.
pub fn dot<T: RealField + Copy>(a: &[T], b: &[T]) -> T {
    let (lanes, rest) = a.as_chunks::<LANES>();
    let (other_lanes, other_rest) = b[..a.len()].as_chunks::<LANES>();
    let mut sums = [T::zero(); LANES];
    for (a, b) in lanes.iter().zip(other_lanes) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += *a * *b);
    }
    let of_rest = rest.iter().zip(other_rest).fold(T::zero(), |sum, (a, b)| sum + *a * *b);
    sums.into_iter().fold(of_rest, |sum, each| sum + each)
}

/// An effect in a model.
#[derive(Clone, Debug)]
pub struct Term {
    pub effect: Effect,
    /// Its columns as they are, for one unit of the weights' priors; of an effect that is known beforehand along the root of its prior.
    pub values: Arc<Values>,
    /// The products of its functions by themselves, for one unit of the weights' priors: what they add at its port, in the port's unit.
    pub functions: Arc<Values>,
    /// Square of its size, in units of its weights' priors.
    pub size2: f64,
    /// What is known of it beforehand, and what it then adds to the rates on average, by the row.
    pub known: Option<(Known, Arc<Vec<f64>>)>,
}

impl Term {
    /// Of an effect that adds to the rates and has these columns, of this size.
    pub fn of_rates(effect: Effect, values: Values, size2: f64) -> Self {
        let values = Arc::new(values);
        Self { effect, functions: values.clone(), values, size2, known: None }
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
    columns: Arc<Columns>,
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    /// Number of the term of each column.
    owner: Vec<usize>,
}

impl Gram {
    pub fn new(problem: &Problem<'_>, terms: &[Term]) -> Self {
        let values: Vec<&Vec<f64>> = terms.iter().flat_map(|term| term.values.iter()).collect();
        let columns = problem.columns(&values);
        let owner = terms.iter().enumerate().flat_map(|(i, term)| std::iter::repeat_n(i, term.values.len())).collect();
        let (matrix, right) = (columns.squares(), columns.scores(&problem.residual));
        Self { columns: Arc::new(columns), matrix, right, owner }
    }

    /// The same with another residual.
    pub fn with_residual(self, residual: &Column) -> Self {
        Self { right: self.columns.scores(residual), ..self }
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
    /// The terms' columns: for what further ones have in common with them.
    columns: Arc<Columns>,
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
        Some(Self { evidence, scales, factor, half, owner: gram.owner.clone(), columns: gram.columns.clone() })
    }

    /// Means of the weights, in units of their priors.
    pub fn scaled_means(&self) -> Vec<f64> {
        let inner = self.factor.l_dirty().tr_solve_lower_triangular(&self.half);
        let inner = inner.unwrap_or_else(|| DVector::zeros(self.scales.len()));
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
        let mut determined = vec![0.0; sizes2.len()];
        let mut squares = vec![0.0; sizes2.len()];
        for (i, &term) in self.owner.iter().enumerate() {
            determined[term] += 1.0 - self.variance(i);
            squares[term] += means[i] * means[i];
        }
        determined
            .iter()
            .zip(squares)
            .zip(sizes2)
            .map(|((determined, squares), &size2)| if *determined > 1e-9 { squares / determined } else { size2 })
            .collect()
    }

    /// Diagonal of (L Lᵀ)⁻¹: squares of the columns of L⁻¹, which is triangular as well.
    fn variance(&self, i: usize) -> f64 {
        let count = self.scales.len() - i;
        let mut column = DVector::zeros(count);
        column[0] = 1.0;
        self.factor.l_dirty().view((i, i), (count, count)).solve_lower_triangular_mut(&mut column);
        column.norm_squared()
    }

    /// What more the evidence would be with further columns of one effect, at its best size: (gain, size²).
    pub fn gain_of(&self, problem: &Problem<'_>, columns: &Columns) -> (f64, f64) {
        let mut own = columns.squares();
        let mut right = columns.scores(&problem.residual);
        if !self.scales.is_empty() {
            let mut half = self.columns.products(columns);
            half.column_iter_mut().for_each(|mut column| column.component_mul_assign(&self.scales));
            // The factor of a positive matrix has no 0 on its diagonal.
            self.factor.l_dirty().solve_lower_triangular_mut(&mut half);
            own -= squares(&half);
            right -= half.tr_mul(&self.half);
        }
        best_size(own, &right)
    }
}

/// The size at which a group of columns has the greatest evidence: (gain, size²).
fn best_size(own: DMatrix<f64>, right: &DVector<f64>) -> (f64, f64) {
    let by_pivots = if right.len() > FEW { best_size_by_pivots(own.clone(), right) } else { None };
    by_pivots.unwrap_or_else(|| best_size_by_directions(own, right))
}

/// In the columns' principal directions with information λ and score y the evidence is Σ ½ s²y²/(1 + s²λ) − ½ ln(1 + s²λ).
fn best_size_by_directions(own: DMatrix<f64>, right: &DVector<f64>) -> (f64, f64) {
    let eigen = own.symmetric_eigen();
    let scores = eigen.eigenvectors.tr_mul(right);
    let gain = |size2: f64| -> f64 {
        let of = |(lambda, score): (&f64, &f64)| {
            let spread = 1.0 + size2 * lambda.max(0.0);
            0.5 * (size2 * score * score / spread - spread.ln())
        };
        eigen.eigenvalues.iter().zip(scores.iter()).map(of).sum()
    };
    best_of_sizes(eigen.eigenvalues.max(), gain)
}

/// The same in directions in which the information is tridiagonal (Householder), which are found several times as quickly. `None` where rounding
/// leaves a direction with negative information: principal ones tell that it is none.
fn best_size_by_pivots(own: DMatrix<f64>, right: &DVector<f64>) -> Option<(f64, f64)> {
    let (turn, diagonal, beside) = own.symmetric_tridiagonalize().unpack();
    let scores = turn.tr_mul(right);
    // Elimination in `shift` I + `factor` T: the pivots, and what is left of the scores.
    let eliminated = |shift: f64, factor: f64| {
        let (mut pivot, mut left) = (1.0, 0.0);
        let (scores, diagonal, beside) = (&scores, &diagonal, &beside);
        (0..scores.len()).map(move |i| {
            let across = if i > 0 { factor * beside[i - 1] } else { 0.0 };
            let share = across / pivot;
            left = scores[i] - share * left;
            pivot = shift + factor * diagonal[i] - share * across;
            (pivot, left)
        })
    };
    // Its greatest eigenvalue, by bisection: above it all pivots are positive.
    let (mut low, mut information) = (diagonal.max(), diagonal.max() + 2.0 * beside.max());
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (low + information);
        let is_above = eliminated(middle, -1.0).all(|(pivot, _)| pivot > 0.0);
        if is_above { information = middle } else { low = middle }
    }
    // But for rounding no pivot is less than 1.
    let is_positive = eliminated(1.0, tried_size2(21, information)).all(|(pivot, _)| pivot > 0.9);
    let gain = |size2: f64| -> f64 {
        eliminated(1.0, size2).map(|(pivot, left)| 0.5 * (size2 * left * left / pivot - pivot.ln())).sum()
    };
    is_positive.then(|| best_of_sizes(information, gain))
}

/// Square of a size that is tried: of number 0 what moves the strongest direction, which has this information, by a tenth of its error; of number 20 by
/// ten thousand errors. The gain is smooth in the logarithm.
fn tried_size2(number: i32, information: f64) -> f64 {
    10f64.powf(-2.0 + 0.5 * f64::from(number)) / information
}

/// The size with the greatest gain: (gain, size²).
fn best_of_sizes(information: f64, gain: impl Fn(f64) -> f64) -> (f64, f64) {
    if !(information > 0.0 && information.is_finite()) {
        return (0.0, 0.0);
    }
    let size2 = |number: i32| tried_size2(number, information);
    let tried = (0..=20).map(|number| (gain(size2(number)), number));
    let best = tried.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, number)| number);
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
        let process = Process { port: Port::Rate, kernel: Kernel::Exponential, sigma_deg_h: 0.8, time_s: 4.0 };
        let with = |chosen: &[usize]| {
            let runs: Vec<Run> = chosen.iter().map(|&i| runs[i].clone()).collect();
            let own = |all: &Vec<f64>| chosen.iter().flat_map(|i| all[12 * i..12 * (i + 1)].to_vec()).collect();
            let values: Values = values.iter().map(own).collect();
            let problem = Problem::new(&runs, Some(&process));
            let effect = Effect::new(north_finder::effects::effect::Port::Rate, &[]);
            let fit = Fit::new(&problem, &Gram::new(&problem, &[Term::of_rates(effect, values, 0.7)]), &[0.7]).unwrap();
            (fit.evidence, problem.predictive(&fit))
        };
        let (of_all, predictive) = with(&[0, 1, 2]);
        let expected: f64 = [[1, 2], [0, 2], [0, 1]].map(|others| of_all - with(&others).0).into_iter().sum();
        assert!((predictive - expected).abs() < 1e-8, "{predictive} {expected}");
    }

    /// Twenty columns of thirty numbers without order: a product of matrices holds their inner products one by one, and by pivots the best size is that
    /// by principal directions.
    #[test]
    fn the_best_size_needs_no_principal_directions() {
        let number = |i: usize, j: usize| (12.9898 * i as f64 + 78.233 * j as f64).sin() * 43758.5453 % 1.0;
        let columns = DMatrix::from_fn(30, 20, number);
        let own = squares(&columns);
        assert!(
            (&own - columns.tr_mul(&columns)).amax() < 1e-12 && (&own - products(&columns, &columns)).amax() < 1e-12
        );
        for strength in [0.1, 1.0, 10.0] {
            let right = DVector::from_fn(20, |i, _| strength * number(i, 50));
            let (gain, size2) = best_size_by_pivots(own.clone(), &right).unwrap();
            let expected = best_size_by_directions(own.clone(), &right);
            assert!((gain - expected.0).abs() < 1e-9 && (size2 / expected.1 - 1.0).abs() < 1e-9, "{gain} {expected:?}");
        }
    }
}
