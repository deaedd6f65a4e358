//! The least error that is possible: the Cramér-Rao bound of the ellipsoid's parameters, by derivatives of the simulated
//! triad itself.

use hal_sim::triad::AccelerometerTriad;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Step of the derivatives.
const STEP: f64 = 1e-5;

/// What the triad really is: bias and M of f = M (raw − bias), M upper triangular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    pub bias: [f64; 3],
    pub matrix: [[f64; 3]; 3],
}

impl Truth {
    /// Asks the triad.
    pub fn of(triad: &AccelerometerTriad) -> Self {
        let (bias, matrix) = triad.correction();
        Self { bias, matrix }
    }

    /// Biases and m11, m12, m13, m22, m23, m33.
    pub fn parameters(&self) -> [f64; 9] {
        let ([x, y, z], [[m11, m12, m13], [_, m22, m23], [_, _, m33]]) = (self.bias, self.matrix);
        [x, y, z, m11, m12, m13, m22, m23, m33]
    }

    /// Bounds of the standard deviations of the parameters, for attitudes known only by their mean readings, each with this
    /// standard deviation of every axis; the directions of gravity are unknowns too. `None` if they do not determine all.
    pub fn bound(&self, means: &[[f64; 3]], sigma: f64) -> Option<[f64; 9]> {
        let parameters = SVector::from(self.parameters());
        let mut information = SMatrix::<f64, 9, 9>::zeros();
        for mean in means {
            let up = self.direction(*mean);
            // What a change of direction can imitate is not seen: only the part normal to both ways it can change.
            let [one, two] = across(up).map(|across| {
                let moved = |by: f64| reading(&parameters, (up + by * across).normalize());
                Some((moved(STEP)? - moved(-STEP)?) / (2.0 * STEP))
            });
            let normal = one?.cross(&two?).normalize();
            let mut seen = SVector::<f64, 9>::zeros();
            for (number, place) in seen.iter_mut().enumerate() {
                let mut step = SVector::<f64, 9>::zeros();
                step[number] = STEP;
                let difference = reading(&(parameters + step), up)? - reading(&(parameters - step), up)?;
                *place = normal.dot(&difference) / (2.0 * STEP);
            }
            information += seen * seen.transpose() / (sigma * sigma);
        }
        Some(information.cholesky()?.inverse().diagonal().map(f64::sqrt).into())
    }

    /// Direction of the specific force in an attitude.
    fn direction(&self, mean: [f64; 3]) -> Vector3<f64> {
        let matrix = Matrix3::from(self.matrix).transpose();
        (matrix * (Vector3::from(mean) - Vector3::from(self.bias))).normalize()
    }
}

/// Reading of a specific force of 1 in this direction, given in the frame that M belongs to.
fn reading(parameters: &SVector<f64, 9>, force: Vector3<f64>) -> Option<Vector3<f64>> {
    let [x, y, z, m11, m12, m13, m22, m23, m33] = (*parameters).into();
    let matrix = Matrix3::new(m11, m12, m13, 0.0, m22, m23, 0.0, 0.0, m33);
    Some(Vector3::new(x, y, z) + matrix.solve_upper_triangular(&force)?)
}

/// Two unit vectors at right angles to a unit vector and to each other.
fn across(up: Vector3<f64>) -> [Vector3<f64>; 2] {
    let other = if up.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let one = up.cross(&other).normalize();
    [one, up.cross(&one)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truth_of_a_triad_by_hand() {
        // x reads 1.02 fx + 0.01; z reads 2 fz.
        let triad = AccelerometerTriad { zero: [0.01, 0.0, 0.0], per_g: [1.02, 1.0, 2.0], ..Default::default() };
        let truth = Truth::of(&triad);
        let expected = [0.01, 0.0, 0.0, 1.0 / 1.02, 0.0, 0.0, 1.0, 0.0, 0.5];
        for (found, expected) in truth.parameters().into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn the_bound_of_an_even_cover_by_hand() {
        // Both ways along each axis and each diagonal of a face: Σ u uᵀ = (2 + 4) · 1 = 6 for each axis: σ/√6 for a bias.
        let mut means = Vec::new();
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let mut mean = Vector3::zeros();
                (mean[i], mean[j]) = (a, b);
                means.push(mean.normalize().into());
            }
        }
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut mean = [0.0; 3];
                mean[axis] = sign;
                means.push(mean);
            }
        }
        let bound = Truth::of(&AccelerometerTriad::default()).bound(&means, 0.1).unwrap();
        assert!((bound[0] - 0.1 / 6f64.sqrt()).abs() < 1e-6, "{bound:?}");
    }
}
