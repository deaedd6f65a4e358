//! Polynomials through a vector by least squares, in constant memory.

use nalgebra::{SMatrix, Vector3};

/// Coefficients: degree six.
pub(super) const COEFFICIENTS: usize = 7;
/// Unit of time of the powers, s: keeps them near one.
const UNIT_S: f64 = 100.0;

/// Sums over the samples of a vector in time.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    /// Σ tᵏ.
    powers: [f64; 2 * COEFFICIENTS - 1],
    /// Σ tᵏ y.
    sums: [Vector3<f64>; COEFFICIENTS],
    squares: f64,
    count: u32,
    end_s: f64,
}

impl Default for Moments {
    fn default() -> Self {
        Self {
            powers: [0.0; 2 * COEFFICIENTS - 1],
            sums: [Vector3::zeros(); COEFFICIENTS],
            squares: 0.0,
            count: 0,
            end_s: 0.0,
        }
    }
}

/// A polynomial in orthonormal form: Σ tᵏ tʲ = L Lᵀ, coefficients L⁻¹ Σ tᵏ y.
pub(super) struct Fit {
    factor: SMatrix<f64, COEFFICIENTS, COEFFICIENTS>,
    orthonormal: [Vector3<f64>; COEFFICIENTS],
    /// Variance of a sample in one axis that is left.
    pub(super) variance: f64,
    /// Time between samples, s.
    step_s: f64,
    length_s: f64,
    /// How many times the rate has been integrated in what is fitted: 1 force, 2 velocity.
    integrations: usize,
}

impl Moments {
    pub(super) fn push(&mut self, t_s: f64, y: Vector3<f64>) {
        let t = t_s / UNIT_S;
        let mut power = 1.0;
        for (k, sum) in self.powers.iter_mut().enumerate() {
            *sum += power;
            if let Some(weighted) = self.sums.get_mut(k) {
                *weighted += y * power;
            }
            power *= t;
        }
        self.squares += y.norm_squared();
        self.count = self.count.saturating_add(1);
        self.end_s = t_s;
    }

    pub(super) fn count(&self) -> u32 {
        self.count
    }

    /// `None` where the samples cannot carry the degree.
    pub(super) fn fit(&self, integrations: usize) -> Option<Fit> {
        let gram = SMatrix::<f64, COEFFICIENTS, COEFFICIENTS>::from_fn(|row, column| {
            self.powers.get(row + column).copied().unwrap_or(0.0)
        });
        let factor = gram.cholesky()?.unpack();
        let sums = SMatrix::<f64, COEFFICIENTS, 3>::from_fn(|row, axis| {
            self.sums.get(row).and_then(|sum| sum.get(axis)).copied().unwrap_or(0.0)
        });
        let solved = factor.solve_lower_triangular(&sums)?;
        let orthonormal = core::array::from_fn(|k| solved.fixed_view::<1, 3>(k, 0).transpose());
        let explained: f64 = orthonormal.iter().map(|y| y.norm_squared()).sum();
        let degrees_of_freedom = 3.0 * (f64::from(self.count) - COEFFICIENTS as f64);
        let step_s = self.end_s / (f64::from(self.count) - 0.5);
        Some(Fit {
            factor,
            orthonormal,
            variance: ((self.squares - explained) / degrees_of_freedom).max(0.0),
            step_s,
            length_s: step_s * f64::from(self.count),
            integrations,
        })
    }
}

impl Fit {
    /// Orthonormal coefficient `k` less that of the terms `beyond` (coefficients of the powers of t in seconds).
    pub(super) fn without(&self, k: usize, beyond: &[Vector3<f64>; COEFFICIENTS]) -> Vector3<f64> {
        let mut rest = self.orthonormal.get(k).copied().unwrap_or_default();
        let mut unit = 1.0;
        for (j, coefficient) in beyond.iter().enumerate() {
            if j >= k {
                rest -= coefficient * (unit * self.element(j, k));
            }
            unit *= UNIT_S;
        }
        rest
    }

    /// The coefficient of specific force itself (t of velocity), and of the power after it, by the polynomial that ends with
    /// it. The terms `beyond` are known.
    pub(super) fn constant_and_slope(&self, beyond: &[Vector3<f64>; COEFFICIENTS]) -> (Vector3<f64>, Vector3<f64>) {
        let (of_force, of_slope) = (self.integrations - 1, self.integrations);
        let slope = self.without(of_slope, beyond) / self.element(of_slope, of_slope);
        let constant = (self.without(of_force, beyond) - slope * self.element(of_slope, of_force))
            / self.element(of_force, of_force);
        (constant / unit(of_force), slope / unit(of_slope))
    }

    /// Variance of a horizontal rate, (rad/s)², with the noise density `n2` of the rate, (rad/s)²/Hz: the power that carries
    /// the heading is t of the force or t²/2 of the velocity.
    pub(super) fn slope_variance(&self, n2: f64, gravity: f64) -> f64 {
        let order = self.integrations;
        let per_unit = self.element(order, order) * unit(order) / self.integrations as f64;
        let g2 = gravity * gravity;
        (self.variance + g2 * n2 * self.growth(order)) / (per_unit * per_unit * g2)
    }

    /// Variance of the force, (m/s²)², from what is left alone.
    pub(super) fn offset_variance(&self) -> f64 {
        let order = self.integrations - 1;
        let per_unit = self.element(order, order) * unit(order);
        self.variance / (per_unit * per_unit)
    }

    /// Variance of the orthonormal coefficient `k` for a noise of the rate of unit density and unit gravity: the square of the
    /// first or second antiderivative of the orthonormal Legendre polynomial, both of which vanish at the ends.
    pub(super) fn growth(&self, k: usize) -> f64 {
        let k2 = 2.0 * k as f64;
        let half_s = 0.5 * self.length_s;
        let (before, after) = (1.0 / (k2 - 1.0), 1.0 / (k2 + 3.0));
        let of_unit = if self.integrations == 1 {
            (before + after) * half_s * half_s
        } else {
            let middle = (before + after) * (before + after) / (k2 + 1.0);
            (after * after / (k2 + 5.0) + middle + before * before / (k2 - 3.0)) * half_s * half_s * half_s * half_s
        };
        of_unit / (k2 + 1.0) / self.step_s
    }

    fn element(&self, row: usize, column: usize) -> f64 {
        self.factor.get((row, column)).copied().unwrap_or(0.0)
    }
}

/// Unit of a power of time, s to that power.
fn unit(power: usize) -> f64 {
    (0..power).fold(1.0, |unit, _| unit * UNIT_S)
}
