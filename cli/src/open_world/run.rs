//! One run in the engine's algebra: its samples, its own unknowns (h cos ψ, h sin ψ, bias), its whitening under every kernel.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::basis::Sheet;
use super::process::Kernel;
use super::recording::Reference;

/// One sigma of a surveyed heading that says none, and of the index on top of it, degrees.
const REFERENCE_SIGMA_DEG: f64 = 0.005;
const INDEX_SIGMA_DEG: f64 = 0.01;
/// One sigma of the amplitude about Ω cos φ, relative, where a surveyed heading ties the rates down.
const AMPLITUDE_SIGMA: f64 = 0.002;

/// Inverse Cholesky factors of the covariances white + kernel of samples with the same spans and weights.
#[derive(Debug)]
pub struct Whitening {
    spans: Vec<[f64; 2]>,
    weights: Vec<f64>,
    /// The inverse factors of all kernels, one below the other.
    pub halves: DMatrix<f64>,
    pub log_determinants: Vec<f64>,
    /// Correlations by shape and time, in the order of the kernels; `None` for no process.
    correlations: Vec<Option<Arc<DMatrix<f64>>>>,
}

impl Whitening {
    /// `unit_deg_h` is what the kernels' sizes are multiples of.
    pub fn new(spans: &[[f64; 2]], weights: &[f64], kernels: &[Kernel], unit_deg_h: f64) -> Self {
        let n = spans.len();
        let mut correlations: Vec<Option<Arc<DMatrix<f64>>>> = Vec::new();
        for (number, kernel) in kernels.iter().enumerate() {
            let same = number
                .checked_sub(1)
                .map(|before| &kernels[before])
                .is_some_and(|before| before.shape == kernel.shape && before.time_s == kernel.time_s);
            let of = |shape: super::process::Shape| Arc::new(shape.covariance(kernel.time_s, spans));
            correlations.push(if same { correlations[number - 1].clone() } else { kernel.shape.map(of) });
        }
        let mut whitening = Self {
            spans: spans.to_vec(),
            weights: weights.to_vec(),
            halves: DMatrix::zeros(kernels.len() * n, n),
            log_determinants: Vec::new(),
            correlations,
        };
        for (number, kernel) in kernels.iter().enumerate() {
            let (half, log_determinant) = half_of(&whitening.covariance(number, kernel.size * unit_deg_h));
            whitening.halves.rows_mut(number * n, n).copy_from(&half);
            whitening.log_determinants.push(log_determinant);
        }
        whitening
    }

    pub fn is_of(&self, spans: &[[f64; 2]], weights: &[f64]) -> bool {
        self.spans == spans && self.weights == weights
    }

    /// White noise and a process with this standard deviation.
    pub fn covariance(&self, kernel: usize, size_deg_h: f64) -> DMatrix<f64> {
        let mut covariance = match &self.correlations[kernel] {
            Some(correlation) => correlation.as_ref() * (size_deg_h * size_deg_h),
            None => DMatrix::zeros(self.weights.len(), self.weights.len()),
        };
        for (i, weight) in self.weights.iter().enumerate() {
            covariance[(i, i)] += 1.0 / weight;
        }
        covariance
    }

    fn half(&self, kernel: usize) -> DMatrix<f64> {
        let n = self.spans.len();
        self.halves.rows(kernel * n, n).into_owned()
    }
}

/// Inverse of the lower Cholesky factor, and the logarithm of the determinant. A covariance that has lost its definiteness to
/// rounding gets a little of its own diagonal; one that has none left tells nothing: zero.
pub fn half_of(covariance: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    let n = covariance.nrows();
    let mut share = 0.0;
    loop {
        let mut raised = covariance.clone();
        for i in 0..n {
            raised[(i, i)] *= 1.0 + share;
        }
        if let Some(factor) = raised.cholesky() {
            let lower = factor.l();
            let log_determinant = 2.0 * lower.diagonal().iter().map(|value| value.ln()).sum::<f64>();
            return (lower_inverse(&lower), log_determinant);
        }
        share = if share == 0.0 { 1e-9 } else { share * 10.0 };
        if share > MOST_RAISED {
            return (DMatrix::zeros(n, n), f64::INFINITY);
        }
    }
}

/// Share of its diagonal that a covariance gets at most.
const MOST_RAISED: f64 = 1.0;

/// Inverse of a lower triangle, column by column by substitution from its diagonal down: a third of the work of a full one.
fn lower_inverse(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let n = lower.nrows();
    let mut inverse = DMatrix::zeros(n, n);
    for (j, column) in inverse.as_mut_slice().chunks_exact_mut(n.max(1)).enumerate() {
        column[j] = 1.0;
        for (k, of_lower) in lower.as_slice().chunks_exact(n.max(1)).enumerate().skip(j) {
            let found = column[k] / of_lower[k];
            column[k] = found;
            column[k + 1..].iter_mut().zip(&of_lower[k + 1..]).for_each(|(rest, each)| *rest -= found * each);
        }
    }
    inverse
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
    pub whitening: Arc<Whitening>,
    /// V⁻¹ A under every kernel, AᵀV⁻¹A.
    weighted_design: Vec<DMatrix<f64>>,
    normal: Vec<Matrix3<f64>>,
}

/// What a run says of columns that stand beside its own unknowns: products of whitened projections.
#[derive(Debug)]
pub struct Projection {
    matrix: DMatrix<f64>,
    pub rate: DVector<f64>,
    pub log_determinant: f64,
}

impl Projection {
    /// Columns whitened, without what the run's own unknowns can imitate.
    pub fn of(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        &self.matrix * columns
    }
}

impl<'a> Run<'a> {
    pub fn new(sheet: Sheet<'a>, reference: Option<Reference>, whitening: Arc<Whitening>, kernels: usize) -> Self {
        let n = sheet.samples.len();
        let design = DMatrix::from_fn(n, 3, |i, j| match j {
            0 => sheet.cos[i],
            1 => sheet.sin[i],
            _ => 1.0,
        });
        let rate = DVector::from_vec(sheet.samples.means(sheet.recording.rate_deg_h.iter().copied()));
        let (mut weighted_design, mut normal) = (Vec::new(), Vec::new());
        for kernel in 0..kernels {
            let half = whitening.halves.rows(kernel * n, n);
            let whitened = half * &design;
            weighted_design.push(half.transpose() * &whitened);
            normal.push((whitened.transpose() * &whitened).fixed_view::<3, 3>(0, 0).into_owned());
        }
        let north_deg_h = sheet.recording.north_deg_h;
        let mut run =
            Self { sheet, rate, design, north_deg_h, reference, azimuth_rad: 0.0, whitening, weighted_design, normal };
        run.azimuth_rad = match reference {
            Some(reference) => reference.azimuth_rad,
            None => run.plain_azimuth_rad(),
        };
        run
    }

    /// Azimuth by white noise alone.
    pub fn plain_azimuth_rad(&self) -> f64 {
        let right = self.weighted_design[0].transpose() * &self.rate;
        let found = self.normal[0].try_inverse().unwrap_or_default() * Vector3::new(right[0], right[1], right[2]);
        found[1].atan2(found[0])
    }

    /// Two rows that tie direction and amplitude of the horizontal rate to the surveyed heading, and their right side.
    pub fn tie(&self) -> Option<(DMatrix<f64>, [f64; 2])> {
        let reference = self.reference?;
        let sigma_rad = reference.sigma_rad.max(REFERENCE_SIGMA_DEG.to_radians()).hypot(INDEX_SIGMA_DEG.to_radians());
        let (sin, cos) = reference.azimuth_rad.sin_cos();
        let across = 1.0 / (self.north_deg_h * sigma_rad);
        let along = 1.0 / (self.north_deg_h * AMPLITUDE_SIGMA);
        let rows = DMatrix::from_row_slice(2, 3, &[-sin * across, cos * across, 0.0, cos * along, sin * along, 0.0]);
        Some((rows, [0.0, self.north_deg_h * along]))
    }

    /// Whitening and projection under a kernel whose process has this share of its size.
    pub fn projection(&self, kernel: usize, size_deg_h: f64, share: f64) -> Projection {
        let (half, mut log_determinant) = if share == 1.0 {
            (self.whitening.half(kernel), self.whitening.log_determinants[kernel])
        } else {
            half_of(&self.whitening.covariance(kernel, share * size_deg_h))
        };
        let n = half.nrows();
        let tie = self.tie();
        let rows = n + if tie.is_some() { 2 } else { 0 };
        let mut design = DMatrix::zeros(rows, 3);
        design.rows_mut(0, n).copy_from(&(&half * &self.design));
        let mut rate = DVector::zeros(rows);
        rate.rows_mut(0, n).copy_from(&(&half * &self.rate));
        if let Some((tie, right)) = tie {
            design.rows_mut(n, 2).copy_from(&tie);
            rate.rows_mut(n, 2).copy_from_slice(&right);
        }
        let factors = design.qr();
        let (q, r) = (factors.q(), factors.r());
        log_determinant += 2.0 * r.diagonal().iter().map(|value| value.abs().max(1e-300).ln()).sum::<f64>();
        let along = q.rows(0, n).transpose() * &half;
        let mut matrix = -(&q * along);
        let mut above = matrix.rows_mut(0, n);
        above += &half;
        let rate = &rate - &q * (q.transpose() * &rate);
        Projection { matrix, rate, log_determinant }
    }

    /// Log-likelihood under every kernel, own unknowns integrated out, from the whitened residual (all kernels, one below the
    /// other) and the residual itself.
    pub fn log_likelihood(&self, residual: &DVector<f64>, whitened: &[f64], tied: bool) -> Vec<f64> {
        let n = residual.len();
        let tie = if tied { self.tie() } else { None };
        (0..self.normal.len())
            .map(|kernel| {
                let mut square: f64 = whitened[kernel * n..(kernel + 1) * n].iter().map(|z| z * z).sum();
                let right = self.weighted_design[kernel].transpose() * residual;
                let mut right = Vector3::new(right[0], right[1], right[2]);
                let mut normal = self.normal[kernel];
                if let Some((rows, values)) = &tie {
                    for (row, value) in rows.row_iter().zip(values) {
                        let row = Vector3::new(row[0], row[1], row[2]);
                        normal += row * row.transpose();
                        right += row * *value;
                        square += value * value;
                    }
                }
                match normal.cholesky() {
                    Some(factor) => {
                        let determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|value| value.ln()).sum::<f64>();
                        let explained = right.dot(&factor.solve(&right));
                        -0.5 * (self.whitening.log_determinants[kernel] + determinant + square - explained)
                    }
                    None => f64::NEG_INFINITY,
                }
            })
            .collect()
    }
}
