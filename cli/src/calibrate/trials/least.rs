//! The least error that is possible: the Cramér-Rao bound of the ellipsoid's parameters, by derivatives of the simulated
//! triad itself.

use hal_sim::triad::AccelerometerTriad;

/// Step of the derivatives.
const STEP: f64 = 1e-5;

/// What the triad really is: bias and M of f = M (raw − bias), M upper triangular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    pub bias: [f64; 3],
    pub matrix: [[f64; 3]; 3],
}

impl Truth {
    /// Asks the triad. With raw = b + A f the turned case R f with M⁻¹ = A Rᵀ upper triangular reads the same: M⁻¹ M⁻ᵀ = A Aᵀ,
    /// solved from the last row upwards.
    pub fn of(triad: &AccelerometerTriad) -> Self {
        let bias = triad.ideal([0.0; 3]);
        let column = |force| {
            let reading = triad.ideal(force);
            [reading[0] - bias[0], reading[1] - bias[1], reading[2] - bias[2]]
        };
        let columns = [column([1.0, 0.0, 0.0]), column([0.0, 1.0, 0.0]), column([0.0, 0.0, 1.0])];
        let gram = |i: usize, j: usize| columns.iter().map(|column| column[i] * column[j]).sum::<f64>();
        let u33 = gram(2, 2).sqrt();
        let (u13, u23) = (gram(0, 2) / u33, gram(1, 2) / u33);
        let u22 = (gram(1, 1) - u23 * u23).sqrt();
        let u12 = (gram(0, 1) - u13 * u23) / u22;
        let u11 = (gram(0, 0) - u12 * u12 - u13 * u13).sqrt();
        Self { bias, matrix: inverse_upper([[u11, u12, u13], [0.0, u22, u23], [0.0, 0.0, u33]]) }
    }

    /// Biases and m11, m12, m13, m22, m23, m33.
    pub fn parameters(&self) -> [f64; 9] {
        let ([x, y, z], [[m11, m12, m13], [_, m22, m23], [_, _, m33]]) = (self.bias, self.matrix);
        [x, y, z, m11, m12, m13, m22, m23, m33]
    }

    /// Reading of a specific force, given for the case that M belongs to.
    fn reading(parameters: &[f64; 9], force: [f64; 3]) -> [f64; 3] {
        let [x, y, z, m11, m12, m13, m22, m23, m33] = *parameters;
        let inverse = inverse_upper([[m11, m12, m13], [0.0, m22, m23], [0.0, 0.0, m33]]);
        let felt = inverse.map(|row| row.iter().zip(force).map(|(a, b)| a * b).sum::<f64>());
        [x + felt[0], y + felt[1], z + felt[2]]
    }

    /// Bounds of the standard deviations of the parameters, for attitudes known only by their mean readings, each with this
    /// standard deviation of every axis; the directions of gravity are unknowns too.
    pub fn bound(&self, means: &[[f64; 3]], sigma: f64) -> Option<[f64; 9]> {
        let parameters = self.parameters();
        let mut information = [[0.0; 9]; 9];
        for mean in means {
            let up = self.direction(*mean);
            let by_parameter = (0..9).map(|number| {
                let (mut more, mut less) = (parameters, parameters);
                more[number] += STEP;
                less[number] -= STEP;
                difference(Self::reading(&more, up), Self::reading(&less, up))
            });
            let by_parameter: Vec<_> = by_parameter.collect();
            let [one, two] = across(up).map(|across| {
                let moved = |by: f64| normalized([0, 1, 2].map(|axis| up[axis] + by * across[axis]));
                difference(Self::reading(&parameters, moved(STEP)), Self::reading(&parameters, moved(-STEP)))
            });
            // What a change of direction can imitate is not seen: only the part normal to both.
            let normal = normalized(cross(one, two));
            let seen: Vec<_> = by_parameter.iter().map(|column| dot(*column, normal)).collect();
            for (row, a) in information.iter_mut().zip(&seen) {
                for (place, b) in row.iter_mut().zip(&seen) {
                    *place += a * b / (sigma * sigma);
                }
            }
        }
        let inverse = inverse_9(information)?;
        Some([0, 1, 2, 3, 4, 5, 6, 7, 8].map(|i| inverse[i][i].sqrt()))
    }

    fn direction(&self, mean: [f64; 3]) -> [f64; 3] {
        let from = [0, 1, 2].map(|axis| mean[axis] - self.bias[axis]);
        normalized(self.matrix.map(|row| dot(row, from)))
    }
}

fn difference(more: [f64; 3], less: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| (more[axis] - less[axis]) / (2.0 * STEP))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn normalized(a: [f64; 3]) -> [f64; 3] {
    let norm = dot(a, a).sqrt();
    a.map(|part| part / norm)
}

/// Two unit vectors at right angles to a unit vector and to each other.
fn across(up: [f64; 3]) -> [[f64; 3]; 2] {
    let other = if up[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let one = normalized(cross(up, other));
    [one, cross(up, one)]
}

fn inverse_upper(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let [[a, b, c], [_, d, e], [_, _, f]] = m;
    [[1.0 / a, -b / (a * d), (b * e - c * d) / (a * d * f)], [0.0, 1.0 / d, -e / (d * f)], [0.0, 0.0, 1.0 / f]]
}

/// Gauss-Jordan with pivots; `None` if singular.
fn inverse_9(mut a: [[f64; 9]; 9]) -> Option<[[f64; 9]; 9]> {
    let mut inverse = [[0.0; 9]; 9];
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for column in 0..9 {
        let pivot = (column..9).max_by(|i, j| a[*i][column].abs().total_cmp(&a[*j][column].abs()))?;
        a.swap(column, pivot);
        inverse.swap(column, pivot);
        let by = a[column][column];
        if by == 0.0 {
            return None;
        }
        for k in 0..9 {
            a[column][k] /= by;
            inverse[column][k] /= by;
        }
        for row in (0..9).filter(|row| *row != column) {
            let factor = a[row][column];
            for k in 0..9 {
                a[row][k] -= factor * a[column][k];
                inverse[row][k] -= factor * inverse[column][k];
            }
        }
    }
    Some(inverse)
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
                let mut mean = [0.0; 3];
                (mean[i], mean[j]) = (a, b);
                means.push(normalized(mean));
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
