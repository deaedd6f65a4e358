//! Maximum likelihood for the ellipsoid: Gauss-Newton on the norms of corrected readings.

use core::f64::consts::FRAC_PI_3;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use quantities::outer;

/// Steps after which the solution has converged or never will.
const ITERATIONS: usize = 50;

/// Longest step of a parameter: far from the solution the linear approximation reaches no further.
const LONGEST_STEP: f64 = 0.3;

/// The mean of an attitude, scaled to about the unit sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub at: Vector3<f64>,
    /// Variances of x, y, z.
    pub variance: Vector3<f64>,
}

/// Parameters: u = M · (p − centre) has the norm 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub centre: Vector3<f64>,
    /// Upper triangular.
    pub matrix: Matrix3<f64>,
}

/// Covariance of the centre and of m11, m12, m13, m22, m23, m33.
pub(super) type Covariance = SMatrix<f64, 9, 9>;

/// A converged solution.
#[derive(Clone, Copy)]
pub(super) struct Refined {
    pub state: State,
    /// Sum of squared residuals over their variances.
    pub chi_square: f64,
}

/// How a point's norm differs from 1, and what that depends on.
pub(super) struct Residual {
    pub value: f64,
    /// Variance that the noise of the readings gives it. To first order the deviation along the radius is all that the
    /// unknown direction of gravity leaves, so that nothing is lost by looking at the norm only.
    pub variance: f64,
    /// Unit vector of the corrected point.
    pub unit: Vector3<f64>,
    /// By the centre and by m11, m12, m13, m22, m23, m33.
    pub jacobian: SVector<f64, 9>,
}

impl State {
    /// `None` for a point in the centre.
    pub fn residual(&self, point: &Point) -> Option<Residual> {
        let from_centre = point.at - self.centre;
        let corrected = self.matrix * from_centre;
        let norm = corrected.norm();
        let unit = corrected / norm;
        let by_reading = self.matrix.transpose() * unit;
        let &[x, y, z] = from_centre.as_ref();
        let &[ux, uy, uz] = unit.as_ref();
        let &[bx, by, bz] = by_reading.as_ref();
        let jacobian = SVector::from([-bx, -by, -bz, ux * x, ux * y, ux * z, uy * y, uy * z, uz * z]);
        let variance = by_reading.component_mul(&by_reading).dot(&point.variance);
        (norm > 0.0 && norm.is_finite()).then_some(Residual { value: norm - 1.0, variance, unit, jacobian })
    }

    /// Half axes of the ellipsoid, in the unit of the points, from the greatest to the least: 1/√eigenvalue of Q = MᵀM.
    ///
    /// Eigenvalues of a symmetric 3×3 matrix by the cosine of a third of an angle: O. K. Smith, Communications of the ACM 4, 1961,
    /// p. 168.
    pub fn half_axes(&self) -> [f64; 3] {
        let shape = self.matrix.transpose() * self.matrix;
        let mean = shape.trace() / 3.0;
        let deviation = shape - Matrix3::identity() * mean;
        let spread = libm::sqrt(deviation.dot(&deviation) / 6.0);
        let cosine = deviation.determinant() / (2.0 * spread * spread * spread);
        let cosine = cosine.clamp(-1.0, 1.0);
        let sine = libm::sqrt(1.0 - cosine * cosine);
        let third = if spread > 0.0 { libm::atan2(sine, cosine) / 3.0 } else { 0.0 };
        let least = mean + 2.0 * spread * libm::cos(third + 2.0 * FRAC_PI_3);
        let greatest = mean + 2.0 * spread * libm::cos(third);
        [least, 3.0 * mean - least - greatest, greatest].map(|eigenvalue| 1.0 / libm::sqrt(eigenvalue))
    }

    /// By how much its parameters differ from another's.
    pub(super) fn less(&self, other: &Self) -> SVector<f64, 9> {
        let &[x, y, z] = (self.centre - other.centre).as_ref();
        let matrix = self.matrix - other.matrix;
        SVector::from([x, y, z, matrix.m11, matrix.m12, matrix.m13, matrix.m22, matrix.m23, matrix.m33])
    }

    pub(super) fn moved(&self, by: &SVector<f64, 9>) -> Self {
        let &[x, y, z, m11, m12, m13, m22, m23, m33] = by.as_ref();
        Self {
            centre: self.centre + Vector3::new(x, y, z),
            matrix: self.matrix + Matrix3::new(m11, m12, m13, 0.0, m22, m23, 0.0, 0.0, m33),
        }
    }

    /// Refines the parameters. `excess` is a variance of the norm beyond the noise of the readings.
    ///
    /// `None` where the points do not determine them or the steps do not end.
    ///
    /// Never inlined, as the next one: matrices of nine by nine shall take the stack only here.
    #[inline(never)]
    pub fn refine<P: Iterator<Item = Point>>(mut self, points: &impl Fn() -> P, excess: f64) -> Option<Refined> {
        for _ in 0..ITERATIONS {
            let mut normal = Covariance::zeros();
            let mut right = SVector::<f64, 9>::zeros();
            let chi_square = self.equations(points(), excess, &mut normal, &mut right)?;
            let step = normal.cholesky()?.solve(&right);
            if !step.iter().all(|part| part.is_finite()) {
                return None;
            }
            // The normal matrix times the step is the right-hand side.
            if step.amax() < 1e-12 || step.dot(&right) < 1e-12 {
                return Some(Refined { state: self, chi_square });
            }
            self = self.moved(&(step * (LONGEST_STEP / step.amax()).min(1.0)));
        }
        None
    }

    /// The covariance of refined parameters. `None` where the points do not determine them.
    #[inline(never)]
    pub fn covariance<P: Iterator<Item = Point>>(&self, points: &impl Fn() -> P, excess: f64) -> Option<Covariance> {
        let mut normal = Covariance::zeros();
        self.equations(points(), excess, &mut normal, &mut SVector::zeros())?;
        Some(normal.cholesky()?.inverse())
    }

    /// Adds the normal equations of the next step; gives the sum of squared residuals over their variances.
    fn equations(
        &self,
        points: impl Iterator<Item = Point>,
        excess: f64,
        normal: &mut Covariance,
        right: &mut SVector<f64, 9>,
    ) -> Option<f64> {
        let mut chi_square = 0.0;
        for point in points {
            let residual = self.residual(&point)?;
            let weight = 1.0 / (residual.variance + excess);
            outer::add(normal, &residual.jacobian, &(residual.jacobian * weight));
            for (sum, part) in right.iter_mut().zip(residual.jacobian.iter()) {
                *sum -= weight * residual.value * part;
            }
            chi_square += weight * residual.value * residual.value;
        }
        Some(chi_square)
    }
}
