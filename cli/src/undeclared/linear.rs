//! Small dense least squares, for the oracle only: a yardstick of its own, not the product's solution.

/// A symmetric system of normal equations, N · x = r.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Normal {
    pub(super) fn new(size: usize) -> Self {
        Self { size, matrix: vec![0.0; size * size], right: vec![0.0; size] }
    }

    /// Adds an observation: `row` · x = `value` with this weight.
    pub(super) fn observe(&mut self, row: &[f64], value: f64, weight: f64) {
        for (i, &a) in row.iter().enumerate() {
            if a == 0.0 {
                continue;
            }
            self.right[i] += weight * a * value;
            for (j, &b) in row.iter().enumerate() {
                self.matrix[i * self.size + j] += weight * a * b;
            }
        }
    }

    /// Takes the unknowns from `first` on out of the system (Schur complement): what is left is known of the others when
    /// those are free. An unknown that nothing determines takes nothing with it.
    pub(super) fn without_last(mut self, first: usize) -> Self {
        for out in (first..self.size).rev() {
            let pivot = self.matrix[out * self.size + out];
            if pivot <= self.least(out) {
                continue;
            }
            for i in 0..out {
                let share = self.matrix[i * self.size + out] / pivot;
                self.right[i] -= share * self.right[out];
                for j in 0..out {
                    self.matrix[i * self.size + j] -= share * self.matrix[out * self.size + j];
                }
            }
        }
        let size = first;
        let matrix = (0..size).flat_map(|i| self.matrix[i * self.size..i * self.size + size].to_vec()).collect();
        Self { size, matrix, right: self.right[..size].to_vec() }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.matrix.iter_mut().zip(&other.matrix).for_each(|(sum, value)| *sum += value);
        self.right.iter_mut().zip(&other.right).for_each(|(sum, value)| *sum += value);
    }

    /// xᵀ · N · x.
    pub(super) fn form(&self, x: &[f64]) -> f64 {
        (0..self.size).map(|i| x[i] * (0..self.size).map(|j| self.matrix[i * self.size + j] * x[j]).sum::<f64>()).sum()
    }

    /// The solution by Gauss–Jordan with diagonal pivots; an unknown that the data do not determine is 0.
    pub(super) fn solve(mut self) -> Vec<f64> {
        let least: Vec<f64> = (0..self.size).map(|i| self.least(i)).collect();
        let mut left: Vec<usize> = (0..self.size).collect();
        let mut done = vec![false; self.size];
        while let Some(place) = (0..left.len())
            .max_by(|&a, &b| self.share(left[a], least[left[a]]).total_cmp(&self.share(left[b], least[left[b]])))
        {
            let pivot_at = left.swap_remove(place);
            let pivot = self.matrix[pivot_at * self.size + pivot_at];
            if pivot <= least[pivot_at] {
                continue;
            }
            done[pivot_at] = true;
            for j in 0..self.size {
                self.matrix[pivot_at * self.size + j] /= pivot;
            }
            self.right[pivot_at] /= pivot;
            for i in (0..self.size).filter(|&i| i != pivot_at) {
                let factor = self.matrix[i * self.size + pivot_at];
                if factor != 0.0 {
                    for j in 0..self.size {
                        self.matrix[i * self.size + j] -= factor * self.matrix[pivot_at * self.size + j];
                    }
                    self.right[i] -= factor * self.right[pivot_at];
                }
            }
        }
        self.right.iter().zip(done).map(|(&value, done)| if done { value } else { 0.0 }).collect()
    }

    /// A pivot below this is rounding.
    fn least(&self, i: usize) -> f64 {
        1e-9 * self.matrix[i * self.size + i].abs()
    }

    fn share(&self, i: usize, least: f64) -> f64 {
        if least > 0.0 { self.matrix[i * self.size + i] / least } else { 0.0 }
    }
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
