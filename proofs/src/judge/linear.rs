//! Normal equations of dense least squares, for the oracle only: a yardstick of its own, not the product's solution.

use nalgebra::{DMatrix, DVector};

/// A symmetric system of normal equations, N · x = r.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// Eigenvalues of the scaled system below this share of the largest are rounding.
const ROUNDING: f64 = 1e-10;

impl Normal {
    pub(super) fn new(size: usize) -> Self {
        Self { matrix: DMatrix::zeros(size, size), right: DVector::zeros(size) }
    }

    /// Adds an observation: `row` · x = `value` with this weight.
    pub(super) fn observe(&mut self, row: &[f64], value: f64, weight: f64) {
        let row = DVector::from_column_slice(row);
        self.right.axpy(weight * value, &row, 1.0);
        self.matrix.ger(weight, &row, &row, 1.0);
    }

    /// Takes the unknowns from `first` on out of the system (Schur complement): what is left is known of the others when
    /// those are free. An unknown that nothing determines takes nothing with it.
    pub(super) fn without_last(self, first: usize) -> Self {
        let out = self.matrix.nrows() - first;
        let coupling = self.matrix.view((0, first), (first, out));
        let gain = coupling * pseudo_inverse(self.matrix.view((first, first), (out, out)).into_owned());
        Self {
            matrix: self.matrix.view((0, 0), (first, first)) - &gain * coupling.transpose(),
            right: self.right.rows(0, first) - gain * self.right.rows(first, out),
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.matrix += &other.matrix;
        self.right += &other.right;
    }

    /// xᵀ · N · x.
    pub(super) fn form(&self, x: &[f64]) -> f64 {
        let x = DVector::from_column_slice(x);
        (x.transpose() * &self.matrix * &x).sum()
    }

    /// The solution; what the data do not determine is 0.
    pub(super) fn solve(self) -> Vec<f64> {
        (pseudo_inverse(self.matrix) * self.right).iter().copied().collect()
    }
}

/// Of a symmetric matrix whose unknowns may have very different units: scaled to a diagonal of 1, then by eigenvalues.
fn pseudo_inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    if matrix.is_empty() {
        return matrix;
    }
    let scale = matrix.diagonal().map(|entry| if entry > 0.0 { entry.sqrt().recip() } else { 0.0 });
    let scale = DMatrix::from_diagonal(&scale);
    let eigen = (&scale * matrix * &scale).symmetric_eigen();
    let least = ROUNDING * eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|value| if value > least { value.recip() } else { 0.0 });
    let vectors = eigen.eigenvectors;
    &scale * (&vectors * DMatrix::from_diagonal(&inverse) * vectors.transpose()) * &scale
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 2a − b + 3c, and d that nothing determines.
    fn system() -> Normal {
        let mut normal = Normal::new(4);
        for i in 0..9 {
            let (a, b, c) = (f64::from(i), f64::from(i * i), f64::from(i % 3));
            normal.observe(&[a, b, c, 0.0], 2.0 * a - b + 3.0 * c, 0.5);
        }
        normal
    }

    #[test]
    fn a_system_by_hand() {
        let solution = system().solve();
        for (found, expected) in solution.iter().zip([2.0, -1.0, 3.0, 0.0]) {
            assert!((found - expected).abs() < 1e-9, "{solution:?}");
        }
    }

    #[test]
    fn unknowns_taken_out_leave_the_same_solution() {
        let solution = system().without_last(1).solve();
        assert!((solution[0] - 2.0).abs() < 1e-9);
    }

    #[test]
    fn the_form_is_the_loss_when_they_are_left_out() {
        // y = 2a alone, weights 0.5: ½ Σ (2a)² = 2 Σ a².
        let mut normal = Normal::new(1);
        [1.0, 2.0, 3.0].into_iter().for_each(|a| normal.observe(&[a], 2.0 * a, 0.5));
        assert!((normal.form(&[2.0]) - 28.0).abs() < 1e-12);
    }
}
