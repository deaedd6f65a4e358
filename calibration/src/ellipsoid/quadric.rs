//! The quadric through points, under the ellipsoid constraint, by least squares.
//!
//! ax² + by² + cz² + 2dxy + 2exz + 2fyz + 2px + 2qy + 2rz + l = 0 with 4J − I² = 1, where I = a + b + c and
//! J = ab + bc + ac − d² − e² − f²: whatever fulfils it is an ellipsoid (Q. Li and J. G. Griffiths, Least squares ellipsoid
//! specific fitting, Geometric Modeling and Processing 2004, p. 335).

use nalgebra::{Matrix3, Matrix4, SMatrix, SymmetricEigen, Vector3, Vector4};

type Matrix6 = SMatrix<f64, 6, 6>;
type Matrix6x4 = SMatrix<f64, 6, 4>;

/// An ellipsoid (p − centre)ᵀ Q (p − centre) = 1 about the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipsoid {
    pub centre: Vector3<f64>,
    /// Symmetric, positive definite.
    pub shape: Matrix3<f64>,
}

/// Sums over points of products of the ten terms of the quadric.
pub(super) struct Scatter {
    quadratic: Matrix6,
    mixed: Matrix6x4,
    linear: Matrix4<f64>,
}

impl Scatter {
    /// Of points near the unit sphere: other points lose digits.
    pub fn of(points: impl Iterator<Item = Vector3<f64>>) -> Self {
        let (mut quadratic, mut mixed, mut linear) = (Matrix6::zeros(), Matrix6x4::zeros(), Matrix4::zeros());
        for point in points {
            let &[x, y, z] = point.as_ref();
            let second = SMatrix::<f64, 6, 1>::from([x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z]);
            let first = Vector4::new(2.0 * x, 2.0 * y, 2.0 * z, 1.0);
            quadratic += second * second.transpose();
            mixed += second * first.transpose();
            linear += first * first.transpose();
        }
        Self { quadratic, mixed, linear }
    }

    /// The ellipsoid of least algebraic distance; `None` where the points determine none.
    ///
    /// With the linear terms eliminated, vᵀ S v is least under vᵀ C v = 1 for the only eigenvector of S⁻¹ C with a positive
    /// eigenvalue. S is made slightly larger, so that points exactly on an ellipsoid do no harm.
    pub fn ellipsoid(&self) -> Option<Ellipsoid> {
        let eliminate = self.linear.cholesky()?.inverse();
        let reduced = self.quadratic - self.mixed * eliminate * self.mixed.transpose();
        let reduced = 0.5 * (reduced + reduced.transpose()) + Matrix6::identity() * (1e-13 * self.quadratic.trace());
        let lower = reduced.cholesky()?.l();
        let inverse = lower.solve_lower_triangular(&Matrix6::identity())?;
        let constrained = inverse * constraint() * inverse.transpose();
        let eigen = SymmetricEigen::try_new(0.5 * (constrained + constrained.transpose()), f64::EPSILON, 1000)?;
        let (_, vector) = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
            .filter(|(value, _)| **value > 0.0)
            .max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        let second = inverse.transpose() * vector;
        let first = -eliminate * self.mixed.transpose() * second;
        let &[a, b, c, d, e, f] = second.as_ref();
        let &[p, q, r, l] = first.as_ref();
        let shape = Matrix3::new(a, d, e, d, b, f, e, f, c);
        let centre = -(shape.try_inverse()? * Vector3::new(p, q, r));
        let level = (centre.transpose() * shape * centre).x - l;
        let shape = shape / level;
        is_positive(&shape).then_some(Ellipsoid { centre, shape })
    }
}

/// 4J − I² as a quadratic form of a, b, c, d, e, f.
fn constraint() -> Matrix6 {
    let mut form = Matrix6::from_diagonal(&SMatrix::from([-1.0, -1.0, -1.0, -4.0, -4.0, -4.0]));
    form.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::new(-1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0));
    form
}

fn is_positive(shape: &Matrix3<f64>) -> bool {
    shape.iter().all(|part| part.is_finite()) && shape.cholesky().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ellipsoid::coverage::Direction;

    /// Points on an ellipsoid with half axes 1.1, 0.9, 1.0 along x, y, z, centred at (0.1, −0.2, 0.05), which noise of
    /// ± `rough` moves along its radius.
    fn points(rough: f64) -> impl Iterator<Item = Vector3<f64>> {
        Direction::all().enumerate().map(move |(i, direction)| {
            let [x, y, z] = direction.unit();
            let away = 1.0 + if i % 2 == 0 { rough } else { -rough };
            Vector3::new(0.1 + 1.1 * x * away, -0.2 + 0.9 * y * away, 0.05 + z * away)
        })
    }

    #[test]
    fn an_exact_ellipsoid_is_found() {
        let found = Scatter::of(points(0.0)).ellipsoid().unwrap();
        assert!((found.centre - Vector3::new(0.1, -0.2, 0.05)).norm() < 1e-6, "{found:?}");
        let expected = Matrix3::from_diagonal(&Vector3::new(1.0 / 1.21, 1.0 / 0.81, 1.0));
        assert!((found.shape - expected).norm() < 1e-6, "{found:?}");
    }

    #[test]
    fn a_rough_one_nearly() {
        let found = Scatter::of(points(0.01)).ellipsoid().unwrap();
        assert!((found.centre - Vector3::new(0.1, -0.2, 0.05)).norm() < 0.02, "{found:?}");
    }

    #[test]
    fn a_tilted_axis_has_its_sign() {
        // x reads 0.1 of y too: x' = x + 0.1 y. Then p = A u with A⁻ᵀA⁻¹ = [[1, −0.1], [−0.1, 1.01]].
        let sheared = Direction::all().map(|direction| {
            let [x, y, z] = direction.unit();
            Vector3::new(x + 0.1 * y, y, z)
        });
        let found = Scatter::of(sheared).ellipsoid().unwrap();
        assert!((found.shape.m12 + 0.1).abs() < 1e-6 && (found.shape.m22 - 1.01).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn a_plane_is_none() {
        let flat = Direction::all().map(|direction| {
            let [x, y, _] = direction.unit();
            Vector3::new(x, y, 0.0)
        });
        assert_eq!(Scatter::of(flat).ellipsoid(), None);
    }
}
