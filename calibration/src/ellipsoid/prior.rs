//! Misalignments known from an earlier calibration, combined with what attitudes in the field tell.
//!
//! Biases and scale factors age, misalignments hardly do: a turntable's misalignments may be better than those of a field
//! calibration, or all that there are where attitudes are few.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::Correction;
use super::refine::State;

/// Steps of the linearised combination; misalignments are small, so that the second step changes little.
const ITERATIONS: usize = 3;

/// Directions of the sensitive axes: parts of x's along y and z and of y's along z, over its part along itself.
///
/// In the frame of an upper triangular M: z keeps its direction, y stays in the plane of y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misalignments {
    pub parts: [f64; 3],
    /// Their standard deviations; 0 where they are taken for exact.
    pub sigmas: [f64; 3],
}

impl Misalignments {
    /// Axes at right angles, exactly.
    pub const NONE: Self = Self { parts: [0.0; 3], sigmas: [0.0; 3] };

    /// Of an earlier correction and the standard deviations of its matrix (0 where they are not known). A matrix that is
    /// not upper triangular, as a turntable gives it, is turned into that frame. Terms of the second order in the
    /// misalignments are left out of the standard deviations.
    ///
    /// `None` for a matrix that no triad has.
    pub fn of(correction: &Correction, sigma_matrix: &[[f64; 3]; 3]) -> Option<Self> {
        let upper = Matrix3::from(correction.of_sensors()?.matrix).transpose();
        let [m12, m13, m23] = [(0, 1), (0, 2), (1, 2)].map(|(row, column)| {
            // The frame turns by what stands below the diagonal: it is as uncertain.
            let of = |row: usize, column: usize| {
                sigma_matrix.get(row).and_then(|row| row.get(column)).copied().unwrap_or(0.0)
            };
            libm::hypot(of(row, column), of(column, row))
        });
        let sigmas = [m12 / upper.m22, m13 / upper.m33, m23 / upper.m33];
        Some(Self { parts: *parts(&upper).as_ref(), sigmas })
    }

    /// Combines: the parameters move by as much as their covariance allows, weighted with that of the misalignments.
    ///
    /// A measurement update of least squares: gain K = P Hᵀ (H P Hᵀ + R)⁻¹. `None` where it cannot be solved.
    pub(super) fn combine(
        &self,
        state: &State,
        covariance: &SMatrix<f64, 9, 9>,
    ) -> Option<(State, SMatrix<f64, 9, 9>)> {
        let variance = Matrix3::from_diagonal(&Vector3::from(self.sigmas.map(|sigma| sigma * sigma)));
        let mut moved = *state;
        let mut updated = *covariance;
        for _ in 0..ITERATIONS {
            let rows = by_parameters(&moved.matrix);
            let across = covariance * rows.transpose();
            let gain = across * (rows * across + variance).try_inverse()?;
            let away: SVector<f64, 9> = moved.less(state);
            let innovation = Vector3::from(self.parts) - parts(&moved.matrix) + rows * away;
            moved = state.moved(&(gain * innovation));
            updated = covariance - gain * across.transpose();
        }
        Some((moved, updated))
    }
}

/// Rows of M⁻¹, each over its diagonal: −m12/m22, (m12 m23 − m13 m22)/(m22 m33), −m23/m33.
fn parts(matrix: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(
        -matrix.m12 / matrix.m22,
        (matrix.m12 * matrix.m23 - matrix.m13 * matrix.m22) / (matrix.m22 * matrix.m33),
        -matrix.m23 / matrix.m33,
    )
}

/// Derivatives of [`parts`] by the centre and by m11, m12, m13, m22, m23, m33.
fn by_parameters(matrix: &Matrix3<f64>) -> SMatrix<f64, 3, 9> {
    let (m12, m13, m22, m23, m33) = (matrix.m12, matrix.m13, matrix.m22, matrix.m23, matrix.m33);
    let second = (m12 * m23 - m13 * m22) / (m22 * m33);
    let row = |of_m: [f64; 5]| {
        let [by_12, by_13, by_22, by_23, by_33] = of_m;
        [0.0, 0.0, 0.0, 0.0, by_12, by_13, by_22, by_23, by_33]
    };
    let rows = [
        row([-1.0 / m22, 0.0, m12 / (m22 * m22), 0.0, 0.0]),
        row([m23 / (m22 * m33), -1.0 / m33, -m12 * m23 / (m22 * m22 * m33), m12 / (m22 * m33), -second / m33]),
        row([0.0, 0.0, 0.0, -1.0 / m33, m23 / (m33 * m33)]),
    ];
    SMatrix::<f64, 9, 3>::from(rows).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATE: State = State {
        centre: Vector3::new(0.01, 0.0, -0.02),
        matrix: Matrix3::new(1.01, 0.02, -0.01, 0.0, 0.99, 0.015, 0.0, 0.0, 1.005),
    };

    fn covariance() -> SMatrix<f64, 9, 9> {
        SMatrix::from_diagonal(&SVector::from([1e-8, 1e-8, 1e-8, 4e-8, 9e-8, 9e-8, 4e-8, 9e-8, 4e-8]))
    }

    #[test]
    fn derivatives_are_those_of_the_parts() {
        let rows = by_parameters(&STATE.matrix);
        for parameter in 3..9 {
            let mut step = SVector::<f64, 9>::zeros();
            step[parameter] = 1e-6;
            let slope = (parts(&STATE.moved(&step).matrix) - parts(&STATE.moved(&-step).matrix)) / 2e-6;
            assert!((slope - rows.column(parameter)).amax() < 1e-9, "{parameter}");
        }
    }

    #[test]
    fn exact_misalignments_are_taken_over_vague_ones_left() {
        let prior = Misalignments { parts: [-0.019, 0.011, -0.0155], sigmas: [0.0; 3] };
        let (moved, updated) = prior.combine(&STATE, &covariance()).unwrap();
        assert!((parts(&moved.matrix) - Vector3::from(prior.parts)).amax() < 1e-9);
        assert!(updated[(4, 4)] < 1e-3 * covariance()[(4, 4)]);
        let (moved, updated) = Misalignments { sigmas: [1.0; 3], ..prior }.combine(&STATE, &covariance()).unwrap();
        assert!((moved.matrix - STATE.matrix).amax() < 1e-8 && (updated - covariance()).amax() < 1e-12);
        // As sure as the field's: halfway, and the variance halved. Part of y's axis along z: −m23/m33, σ 3e-4/1.005.
        let even = Misalignments { sigmas: [1.0, 1.0, 3e-4 / 1.005], ..prior };
        let (moved, updated) = even.combine(&STATE, &covariance()).unwrap();
        let halfway = 0.5 * (-0.0155 - 0.015 / 1.005);
        assert!((parts(&moved.matrix).z - halfway).abs() < 1e-6, "{}", parts(&moved.matrix).z);
        assert!((updated[(7, 7)] / 4.5e-8 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_full_matrix_is_turned_into_the_frame_of_the_triads_z_axis() {
        // A small turn about x of a triad without misalignments: none appear.
        let (s, c) = libm::sincos(0.01);
        let turned = Correction { bias: [0.0; 3], matrix: [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]] };
        let of = Misalignments::of(&turned, &[[0.0; 3]; 3]).unwrap();
        assert!(of.parts.iter().all(|part| part.abs() < 1e-15), "{of:?}");
        // By hand: M = [[1, 0.01, 0], [0, 1, 0], [0, 0, 2]]: x's axis has −0.01 of y, and 0.03 of M12 is 0.03 of it.
        let sheared = Correction { bias: [0.0; 3], matrix: [[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]] };
        let of = Misalignments::of(&sheared, &[[0.0, 0.03, 0.0], [0.0; 3], [0.0; 3]]).unwrap();
        assert!((of.parts[0] + 0.01).abs() < 1e-15 && of.parts[1].abs() < 1e-15);
        assert_eq!(of.sigmas, [0.03, 0.0, 0.0]);
        let none = Correction { bias: [0.0; 3], matrix: [[0.0; 3]; 3] };
        assert_eq!(Misalignments::of(&none, &[[0.0; 3]; 3]), None);
    }
}
