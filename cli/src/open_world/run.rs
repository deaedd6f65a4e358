//! One run in the engine's algebra: its samples, its own unknowns (h cos ψ, h sin ψ, bias), its whitening under every kernel.

use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::course::Course;
use super::dictionary::Dictionary;
use super::process::{Kernel, Shape};
use super::recording::Reference;
use super::seen::Seen;
use super::sheet::Sheet;
use super::tie::{Tie, tie_down};

/// One sigma of a surveyed heading that says none, and of the index on top of it, degrees.
const REFERENCE_SIGMA_DEG: f64 = 0.005;
const INDEX_SIGMA_DEG: f64 = 0.01;

/// The covariances white + kernel of samples with the same spans and weights, in a basis in which all of a shape and time are
/// diagonal, whatever their size: W^½ K W^½ = Q Λ Qᵀ, so that white + s² K = W^-½ Q (1 + s² Λ) Qᵀ W^-½.
#[derive(Debug)]
pub struct Whitening {
    spans: Vec<[f64; 2]>,
    weights: Vec<f64>,
    bases: Vec<Basis>,
    /// Basis of every kernel; the first is that of white noise.
    of_kernel: Vec<usize>,
    log_weights: f64,
    /// What courses of such runs are made of.
    dictionary: OnceLock<Dictionary>,
}

/// Kernels of one shape and time.
#[derive(Debug)]
struct Basis {
    /// Qᵀ W^½.
    turn: DMatrix<f64>,
    /// Λ.
    values: Vec<f64>,
}

impl Basis {
    /// Factors that whiten what was turned into the basis, of a process with this standard deviation.
    fn factors(&self, size_deg_h: f64) -> impl Iterator<Item = f64> {
        self.values.iter().map(move |value| (1.0 + size_deg_h * size_deg_h * value).powf(-0.5))
    }
}

impl Whitening {
    pub fn new(spans: &[[f64; 2]], weights: &[f64], kernels: &[Kernel]) -> Self {
        let n = spans.len();
        let roots = DVector::from_iterator(n, weights.iter().map(|weight| weight.sqrt()));
        let white = Basis { turn: DMatrix::from_diagonal(&roots), values: vec![0.0; n] };
        let (mut bases, mut of_kernel) = (vec![white], Vec::with_capacity(kernels.len()));
        for (number, kernel) in kernels.iter().enumerate() {
            let Some(shape) = kernel.shape.filter(|shape| *shape != Shape::Course) else {
                of_kernel.push(0);
                continue;
            };
            let before = number.checked_sub(1).map(|before| &kernels[before]);
            if !before.is_some_and(|before| before.shape == kernel.shape && before.time_s == kernel.time_s) {
                let correlation = shape.covariance(kernel.time_s, spans);
                let eigen = DMatrix::from_fn(n, n, |i, j| roots[i] * correlation[(i, j)] * roots[j]).symmetric_eigen();
                let turn = DMatrix::from_fn(n, n, |i, j| eigen.eigenvectors[(j, i)] * roots[j]);
                bases.push(Basis { turn, values: eigen.eigenvalues.iter().map(|value| value.max(0.0)).collect() });
            }
            of_kernel.push(bases.len() - 1);
        }
        let log_weights = weights.iter().map(|weight| weight.ln()).sum();
        let dictionary = OnceLock::new();
        Self { spans: spans.to_vec(), weights: weights.to_vec(), bases, of_kernel, log_weights, dictionary }
    }

    pub fn is_of(&self, spans: &[[f64; 2]], weights: &[f64]) -> bool {
        self.spans == spans && self.weights == weights
    }

    /// Roots of the samples' weights.
    pub fn roots(&self) -> DVector<f64> {
        DVector::from_iterator(self.weights.len(), self.weights.iter().map(|weight| weight.sqrt()))
    }

    /// What courses of such a run are made of.
    pub fn dictionary(&self, sheet: &Sheet) -> &Dictionary {
        self.dictionary.get_or_init(|| Dictionary::new(sheet, &self.roots()))
    }

    /// Covariance of white noise.
    pub fn white(&self) -> DMatrix<f64> {
        DMatrix::from_diagonal(&DVector::from_iterator(self.weights.len(), self.weights.iter().map(|each| 1.0 / each)))
    }

    /// Columns whitened under a kernel whose process has this standard deviation.
    pub fn whiten(&self, kernel: usize, size_deg_h: f64, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let basis = &self.bases[self.of_kernel[kernel]];
        let mut turned = &basis.turn * columns;
        scale_rows(&mut turned, basis.factors(size_deg_h));
        turned
    }

    /// The transposed operation.
    fn whiten_back(&self, kernel: usize, size_deg_h: f64, mut rows: DMatrix<f64>) -> DMatrix<f64> {
        let basis = &self.bases[self.of_kernel[kernel]];
        scale_rows(&mut rows, basis.factors(size_deg_h));
        basis.turn.tr_mul(&rows)
    }

    /// Logarithm of the determinant of the covariance.
    pub fn log_determinant(&self, kernel: usize, size_deg_h: f64) -> f64 {
        let of_basis = |value: &f64| (size_deg_h * size_deg_h * value).ln_1p();
        self.bases[self.of_kernel[kernel]].values.iter().map(of_basis).sum::<f64>() - self.log_weights
    }
}

fn scale_rows(matrix: &mut DMatrix<f64>, factors: impl Iterator<Item = f64>) {
    let factors: Vec<f64> = factors.collect();
    for mut column in matrix.column_iter_mut() {
        column.iter_mut().zip(&factors).for_each(|(value, factor)| *value *= factor);
    }
}

/// A run.
#[derive(Debug)]
pub struct Run<'a> {
    pub sheet: Sheet<'a>,
    /// Means of the rate over the samples, °/h.
    pub rate: DVector<f64>,
    /// Rows of the run's own unknowns.
    pub design: DMatrix<f64>,
    pub north_deg_h: f64,
    pub reference: Option<Reference>,
    /// Azimuth that columns are built at.
    pub azimuth_rad: f64,
    /// Azimuth by white noise alone.
    pub plain_azimuth_rad: f64,
    pub whitening: Arc<Whitening>,
    /// What happens in it by itself, under the kernel of that name.
    pub course: Option<Arc<Course>>,
    /// Sizes of the kernels' processes, °/h.
    sizes_deg_h: Arc<Vec<f64>>,
    /// The design turned into every basis; AᵀV⁻¹A under every kernel.
    turned: Vec<DMatrix<f64>>,
    normal: Vec<Matrix3<f64>>,
    log_determinants: Vec<f64>,
}

/// Sums of products of columns that stand beside a run's own unknowns: XᵀV⁻¹Y − (XᵀV⁻¹A)(AᵀV⁻¹A)⁻¹(AᵀV⁻¹Y), the surveyed
/// heading among the rows of A and of the rate.
#[derive(Debug)]
pub struct Beside<'a> {
    run: &'a Run<'a>,
    kernel: usize,
    size_deg_h: f64,
    course: Option<&'a Course>,
    /// Whitened design and rate; what of the rate the own unknowns explain, in the factor's coordinates.
    design: DMatrix<f64>,
    rate: DVector<f64>,
    along: Vector3<f64>,
    /// Inverse of the lower factor of AᵀV⁻¹A.
    inverse: Matrix3<f64>,
    /// −½ (ln det V + ln det AᵀV⁻¹A + what is left of the rate's square).
    pub constant: f64,
}

impl Beside<'_> {
    fn whitened(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        self.run.whiten(self.kernel, self.size_deg_h, self.course, columns)
    }

    /// What of whitened columns the own unknowns can imitate.
    fn imitated(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_column_slice(3, 3, self.inverse.as_slice()) * self.design.tr_mul(whitened)
    }

    /// Gram matrix and right side.
    pub fn sums(&self, columns: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let whitened = self.whitened(columns);
        let imitated = self.imitated(&whitened);
        let gram = whitened.transpose() * &whitened - imitated.transpose() * &imitated;
        (gram, whitened.tr_mul(&self.rate) - imitated.tr_mul(&self.along))
    }

    /// Gram matrices of parts of the columns, given by their widths, added to sums.
    pub fn add_grams(&self, columns: &DMatrix<f64>, widths: &[usize], sign: f64, sums: &mut [DMatrix<f64>]) {
        let whitened = self.whitened(columns);
        let imitated = self.imitated(&whitened);
        let mut start = 0;
        for (&width, sum) in widths.iter().zip(sums) {
            let part = whitened.columns(start, width);
            let away = imitated.columns(start, width);
            sum.gemm(sign, &part.transpose(), &part, 1.0);
            sum.gemm(-sign, &away.transpose(), &away, 1.0);
            start += width;
        }
    }

    /// What any columns are multiplied by for their products with these ones and, last, with the rate.
    pub fn toward(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, width) = (columns.nrows(), columns.ncols());
        let whitened = self.whitened(columns);
        let mut all = DMatrix::zeros(n, width + 1);
        let design = &self.design * self.inverse.transpose();
        all.columns_mut(0, width).copy_from(&(&whitened - &design * self.imitated(&whitened)));
        all.set_column(width, &(&self.rate - &design * self.along));
        match self.course {
            Some(course) => course.half.tr_mul(&all),
            None => self.run.whitening.whiten_back(self.kernel, self.size_deg_h, all),
        }
    }
}

impl<'a> Run<'a> {
    pub fn new(
        sheet: Sheet<'a>,
        reference: Option<Reference>,
        whitening: Arc<Whitening>,
        sizes_deg_h: &Arc<Vec<f64>>,
    ) -> Self {
        let n = sheet.samples.len();
        let design = DMatrix::from_fn(n, 3, |i, j| match j {
            0 => sheet.cos[i],
            1 => sheet.sin[i],
            _ => 1.0,
        });
        let rate = DVector::from_vec(sheet.samples.means(sheet.recording.rate_deg_h.iter().copied()));
        let turned: Vec<DMatrix<f64>> = whitening.bases.iter().map(|basis| &basis.turn * &design).collect();
        let normal = sizes_deg_h.iter().zip(&whitening.of_kernel).map(|(&size_deg_h, &basis)| {
            let mut whitened = turned[basis].clone();
            scale_rows(&mut whitened, whitening.bases[basis].factors(size_deg_h));
            whitened.tr_mul(&whitened).fixed_view::<3, 3>(0, 0).into_owned()
        });
        let normal = normal.collect();
        let of_kernel = |(kernel, &size_deg_h): (usize, &f64)| whitening.log_determinant(kernel, size_deg_h);
        let log_determinants = sizes_deg_h.iter().enumerate().map(of_kernel).collect();
        let north_deg_h = sheet.recording.north_deg_h;
        let sizes_deg_h = sizes_deg_h.clone();
        let mut run = Self {
            sheet,
            rate,
            design,
            north_deg_h,
            reference,
            azimuth_rad: 0.0,
            plain_azimuth_rad: 0.0,
            whitening,
            course: None,
            sizes_deg_h,
            turned,
            normal,
            log_determinants,
        };
        run.plain_azimuth_rad = run.by_white_noise_rad();
        run.azimuth_rad = reference.map_or(run.plain_azimuth_rad, |reference| reference.azimuth_rad);
        run
    }

    fn by_white_noise_rad(&self) -> f64 {
        let turned = &self.whitening.bases[0].turn * &self.rate;
        let right = self.turned[0].tr_mul(&turned);
        let found = self.normal[0].try_inverse().unwrap_or_default() * Vector3::new(right[0], right[1], right[2]);
        found[1].atan2(found[0])
    }

    /// What a course is sought in, by the surveyed heading as well or without it.
    pub fn seen(&self, tied: bool) -> Seen<'_> {
        Seen {
            sheet: &self.sheet,
            roots: self.whitening.roots(),
            white: self.whitening.white(),
            design: &self.design,
            ties: self.ties(tied),
            dictionary: self.whitening.dictionary(&self.sheet),
        }
    }

    /// What is known of the horizontal rate: its amplitude, about the azimuth by white noise and, of a run with a surveyed heading that
    /// may be asked, its direction.
    pub fn ties(&self, surveyed: bool) -> Vec<Tie> {
        let Some(reference) = self.reference.filter(|_| surveyed) else {
            return vec![Tie::amplitude(self.plain_azimuth_rad, self.north_deg_h)];
        };
        let sigma_rad = reference.sigma_rad.max(REFERENCE_SIGMA_DEG.to_radians()).hypot(INDEX_SIGMA_DEG.to_radians());
        let (sin, cos) = reference.azimuth_rad.sin_cos();
        let across = 1.0 / (self.north_deg_h * sigma_rad);
        let direction = Tie { row: Vector3::new(-sin * across, cos * across, 0.0), value: 0.0 };
        vec![direction, Tie::amplitude(reference.azimuth_rad, self.north_deg_h)]
    }

    /// The run's course, if this is its kernel.
    fn course_of(&self, kernel: usize) -> Option<&Course> {
        self.course.as_deref().filter(|_| kernel + 1 == self.sizes_deg_h.len())
    }

    fn whiten(&self, kernel: usize, size_deg_h: f64, course: Option<&Course>, columns: &DMatrix<f64>) -> DMatrix<f64> {
        match course {
            Some(course) => &course.half * columns,
            None => self.whitening.whiten(kernel, size_deg_h, columns),
        }
    }

    /// The run under a kernel whose process has this share of its size; a course is there or is not.
    pub fn beside(&self, kernel: usize, share: f64) -> Beside<'_> {
        let kernel = if share < 1.0 && self.course_of(kernel).is_some() { 0 } else { kernel };
        self.beside_either(kernel, share * self.sizes_deg_h[kernel], self.course_of(kernel))
    }

    /// The run with a course that is given.
    pub fn beside_course<'b>(&'b self, course: &'b Course) -> Beside<'b> {
        self.beside_either(0, 0.0, Some(course))
    }

    fn beside_either<'b>(&'b self, kernel: usize, size_deg_h: f64, course: Option<&'b Course>) -> Beside<'b> {
        let design = self.whiten(kernel, size_deg_h, course, &self.design);
        let rate = course.map_or_else(|| self.rate.clone(), |course| &self.rate - &course.mean);
        let rate = self.whiten(kernel, size_deg_h, course, &DMatrix::from_columns(&[rate]));
        let rate = rate.column(0).into_owned();
        let mut normal: Matrix3<f64> = design.tr_mul(&design).fixed_view::<3, 3>(0, 0).into_owned();
        let right = design.tr_mul(&rate);
        let mut right = Vector3::new(right[0], right[1], right[2]);
        let mut square = rate.norm_squared();
        tie_down(&self.ties(true), &mut normal, &mut right, &mut square);
        let lower = lower_of(normal);
        let inverse = lower.try_inverse().unwrap_or_default();
        let along = inverse * right;
        let determinant = 2.0 * lower.diagonal().iter().map(|value| value.ln()).sum::<f64>();
        let (of_process, log_prior) = match course {
            Some(course) => (course.log_determinant, course.log_prior),
            None => (self.whitening.log_determinant(kernel, size_deg_h), 0.0),
        };
        let constant = log_prior - 0.5 * (of_process + determinant + square - along.norm_squared());
        Beside { run: self, kernel, size_deg_h, course, design, rate, along, inverse, constant }
    }

    /// Log-likelihood under every kernel of what effects leave of the rate, own unknowns integrated out.
    pub fn log_likelihood(&self, residual: &DVector<f64>, tied: bool, course: Option<&Course>) -> Vec<f64> {
        let turned: Vec<DVector<f64>> = self.whitening.bases.iter().map(|basis| &basis.turn * residual).collect();
        let ties = self.ties(tied);
        let likelihood = |mut normal: Matrix3<f64>, mut right: Vector3<f64>, mut square: f64, log_determinant: f64| {
            tie_down(&ties, &mut normal, &mut right, &mut square);
            let lower = lower_of(normal);
            let determinant = 2.0 * lower.diagonal().iter().map(|value| value.ln()).sum::<f64>();
            let explained = lower.solve_lower_triangular(&right).map_or(0.0, |along| along.norm_squared());
            -0.5 * (log_determinant + determinant + square - explained)
        };
        let of_course = course.map_or(f64::NEG_INFINITY, |course| {
            let (design, rate) = (&course.half * &self.design, &course.half * (residual - &course.mean));
            let normal = design.tr_mul(&design).fixed_view::<3, 3>(0, 0).into_owned();
            let right = design.tr_mul(&rate);
            let right = Vector3::new(right[0], right[1], right[2]);
            course.log_prior + likelihood(normal, right, rate.norm_squared(), course.log_determinant)
        });
        // The last kernel is the course.
        (0..self.normal.len() - 1)
            .map(|kernel| {
                let (size_deg_h, place) = (self.sizes_deg_h[kernel], self.whitening.of_kernel[kernel]);
                let (of_residual, design) = (&turned[place], &self.turned[place]);
                let (mut square, mut right) = (0.0, Vector3::zeros());
                for (i, value) in self.whitening.bases[place].values.iter().enumerate() {
                    let share = of_residual[i] / (1.0 + size_deg_h * size_deg_h * value);
                    square += share * of_residual[i];
                    right += Vector3::new(design[(i, 0)], design[(i, 1)], design[(i, 2)]) * share;
                }
                likelihood(self.normal[kernel], right, square, self.log_determinants[kernel])
            })
            .chain([of_course])
            .collect()
    }
}

/// Lower Cholesky factor of what own unknowns are known to; of a run at one position only, with a little of its trace added.
fn lower_of(mut normal: Matrix3<f64>) -> Matrix3<f64> {
    let little = 1e-12 * normal.trace();
    for i in 0..3 {
        normal[(i, i)] += little;
    }
    normal.cholesky().map_or_else(|| Matrix3::identity() * normal.trace().max(1e-300).sqrt(), |factor| factor.l())
}
