//! Biases and scale factors of a triad by the norm of what it reads at rest, its axes taken as orthogonal: no attitude has to be known, so that a face
//! that leans does no harm. The other way than by known attitudes, to compare with.

use nalgebra::{DMatrix, DVector};

/// Steps of Gauss and Newton: from the start that six faces give, each leaves the square of the error before.
const STEPS: usize = 8;
const PARAMETERS: usize = 6;

/// Bias of each axis in the unit of the readings, and readings per unit of specific force.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct NormFit {
    pub bias: [f64; 3],
    pub scale: [f64; 3],
}

impl NormFit {
    /// Fits |((reading − bias)/scale)| = gravity to the mean readings of attitudes, from a start near the solution. `None`: they do not determine it.
    pub fn of(means: &[[f64; 3]], gravity: f64, start: Self) -> Option<Self> {
        let mut fit = start;
        for _ in 0..STEPS {
            let rows: Vec<([f64; PARAMETERS], f64)> = means.iter().map(|mean| fit.row(mean, gravity)).collect();
            let design = DMatrix::from_fn(rows.len(), PARAMETERS, |row, column| rows[row].0[column]);
            let residual = DVector::from_fn(rows.len(), |row, _| rows[row].1);
            let step = (design.transpose() * &design).cholesky()?.solve(&(design.transpose() * residual));
            for axis in 0..3 {
                fit.bias[axis] += step[axis] * start.scale[axis] * gravity;
                fit.scale[axis] += step[axis + 3] * start.scale[axis];
            }
        }
        fit.bias.iter().chain(&fit.scale).all(|value| value.is_finite()).then_some(fit)
    }

    /// Derivatives of the norm over gravity by the biases (over scale and gravity) and the scale factors (relative), and what is missing to 1.
    fn row(&self, mean: &[f64; 3], gravity: f64) -> ([f64; PARAMETERS], f64) {
        let force = [0, 1, 2].map(|axis| (mean[axis] - self.bias[axis]) / (self.scale[axis] * gravity));
        let norm = force.iter().map(|part| part * part).sum::<f64>().sqrt();
        let [x, y, z] = force.map(|part| part / norm);
        ([-x, -y, -z, -x * force[0], -y * force[1], -z * force[2]], 1.0 - norm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_that_lean_do_no_harm() {
        // Bias 0.1, −0.2, 0.05, scale factors 1.02, 0.99, 1.005 of orthogonal axes; each face leans by up to 2°.
        let truth = NormFit { bias: [0.1, -0.2, 0.05], scale: [1.02, 0.99, 1.005] };
        let faces = [
            [1.0, 0.03, 0.0],
            [-1.0, 0.0, -0.02],
            [0.02, 1.0, 0.02],
            [0.0, -1.0, 0.035],
            [-0.01, 0.0, 1.0],
            [0.0, 0.02, -1.0],
        ];
        let read = |up: [f64; 3]| {
            let length = up.iter().map(|part: &f64| part * part).sum::<f64>().sqrt();
            [0, 1, 2].map(|axis| truth.bias[axis] + truth.scale[axis] * 9.81 * up[axis] / length)
        };
        let means = faces.map(read);
        let pairs = |axis: usize| (means[2 * axis][axis], means[2 * axis + 1][axis]);
        let start = NormFit {
            bias: [0, 1, 2].map(|axis| (pairs(axis).0 + pairs(axis).1) / 2.0),
            scale: [0, 1, 2].map(|axis| (pairs(axis).0 - pairs(axis).1) / (2.0 * 9.81)),
        };
        // By hand: the pair of x leans by 0.03 and 0.02, and gives (0.03² + 0.02²)/4 = 325 ppm too little.
        assert!((start.scale[0] / 1.02 - 1.0 + 325e-6).abs() < 1e-6, "{start:?}");
        let fit = NormFit::of(&means, 9.81, start).unwrap();
        for axis in 0..3 {
            assert!(
                (fit.bias[axis] - truth.bias[axis]).abs() < 1e-9 && (fit.scale[axis] - truth.scale[axis]).abs() < 1e-9,
                "{fit:?}"
            );
        }
        assert_eq!(NormFit::of(&means[..5], 9.81, start), None);
    }
}
