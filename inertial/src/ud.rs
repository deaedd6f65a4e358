//! A covariance kept as U·D·Uᵀ: unit upper triangular U, diagonal D.
//!
//! D stays positive whatever the rounding does, so the covariance does too. Measurements by Bierman's update, process noise by
//! Thornton's modified weighted Gram-Schmidt for the leading states and by a rank-one update for single ones.
//! G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapters V and VII;
//! M. S. Grewal, A. P. Andrews, Kalman Filtering, 4th edition 2015, chapter 7.

use nalgebra::{SMatrix, SVector};

/// Factors of the covariance of `N` states in one array: column j of U from `j(j + 1)/2`, with D(j) in the place of its 1.
/// `PACKED` is `N(N + 1)/2`.
#[derive(Clone, Debug)]
pub struct Ud<const N: usize, const PACKED: usize> {
    packed: [f64; PACKED],
    used: usize,
}

/// What a scalar measurement says before it is taken in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured less predicted, in the measurement's unit.
    pub value: f64,
    /// Its variance h·P·hᵀ + r.
    pub variance: f64,
}

impl Innovation {
    /// Square of the normalised innovation: chi-square with one degree of freedom where the filter is consistent.
    pub fn normalised_squared(&self) -> f64 {
        self.value * self.value / self.variance
    }
}

/// The component `i` of a vector, 0 outside of it.
pub fn at<const N: usize>(vector: &SVector<f64, N>, i: usize) -> f64 {
    vector.get(i).copied().unwrap_or(0.0)
}

/// Sets the component `i` of a vector; outside of it nothing happens.
pub fn put<const N: usize>(vector: &mut SVector<f64, N>, i: usize, value: f64) {
    if let Some(place) = vector.get_mut(i) {
        *place = value;
    }
}

/// The vector that is 1 in the component `i` and 0 elsewhere.
pub fn unit<const N: usize>(i: usize) -> SVector<f64, N> {
    SVector::from_fn(|place, _| if place == i { 1.0 } else { 0.0 })
}

const fn start(column: usize) -> usize {
    column * (column + 1) / 2
}

impl<const N: usize, const PACKED: usize> Ud<N, PACKED> {
    const SIZE_FITS: () = assert!(PACKED == N * (N + 1) / 2, "packed size of a triangle");

    /// Independent states with the given standard deviations.
    pub fn diagonal(sigmas: &SVector<f64, N>) -> Self {
        let () = Self::SIZE_FITS;
        let mut ud = Self { packed: [0.0; PACKED], used: N };
        for (state, sigma) in sigmas.iter().enumerate() {
            ud.set_variance_factor(state, sigma * sigma);
        }
        ud
    }

    /// Only the first `used` states are reckoned with; the others have no variance.
    pub fn use_first(&mut self, used: usize) {
        self.used = used.min(N);
    }

    /// Rows 0 … j of column j; the last is D(j).
    fn column(&self, j: usize) -> &[f64] {
        self.packed.get(start(j)..=start(j) + j).unwrap_or(&[])
    }

    fn column_mut(&mut self, j: usize) -> &mut [f64] {
        self.packed.get_mut(start(j)..=start(j) + j).unwrap_or(&mut [])
    }

    fn d(&self, j: usize) -> f64 {
        self.column(j).last().copied().unwrap_or(0.0)
    }

    fn set_variance_factor(&mut self, j: usize, d: f64) {
        if let Some(place) = self.column_mut(j).last_mut() {
            *place = d;
        }
    }

    /// Uᵀ·h.
    fn against(&self, h: &SVector<f64, N>) -> SVector<f64, N> {
        SVector::from_fn(|j, _| {
            if j >= self.used {
                return 0.0;
            }
            let column = self.column(j).iter().take(j).zip(h.iter());
            column.map(|(u, h)| u * h).sum::<f64>() + at(h, j)
        })
    }

    /// Variance of h·x.
    pub fn variance_of(&self, h: &SVector<f64, N>) -> f64 {
        self.against(h).iter().take(self.used).enumerate().map(|(j, f)| f * f * self.d(j)).sum()
    }

    /// Variance of one state.
    pub fn variance(&self, state: usize) -> f64 {
        (state..self.used).fold(0.0, |sum, j| {
            let u = if j == state { 1.0 } else { self.column(j).get(state).copied().unwrap_or(0.0) };
            sum + u * u * self.d(j)
        })
    }

    /// Covariance of two states.
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        let factor = |state: usize, j: usize| match state.cmp(&j) {
            core::cmp::Ordering::Equal => 1.0,
            core::cmp::Ordering::Less => self.column(j).get(state).copied().unwrap_or(0.0),
            core::cmp::Ordering::Greater => 0.0,
        };
        (a.max(b)..self.used).map(|j| factor(a, j) * factor(b, j) * self.d(j)).sum()
    }

    /// What the measurement `value` of h·x with variance `r` would bring, at the estimate `x`; nothing changes.
    pub fn innovation(&self, x: &SVector<f64, N>, h: &SVector<f64, N>, value: f64, r: f64) -> Innovation {
        Innovation { value: value - h.dot(x), variance: self.variance_of(h) + r }
    }

    /// Takes the measurement `value` of h·x with variance `r` > 0 into the estimate `x` and the covariance (Bierman).
    pub fn update(&mut self, x: &mut SVector<f64, N>, h: &SVector<f64, N>, value: f64, r: f64) {
        let f = self.against(h);
        let residual = value - h.dot(x);
        let mut alpha = r;
        let mut gain = SVector::<f64, N>::zeros();
        for (j, f) in f.iter().enumerate().take(self.used) {
            let column = self.column_mut(j);
            let Some((d, above)) = column.split_last_mut() else { continue };
            let v = *d * f;
            let before = alpha;
            alpha += f * v;
            *d *= before / alpha;
            let lambda = -f / before;
            for (u, k) in above.iter_mut().zip(gain.iter_mut()) {
                let old = *u;
                *u += lambda * *k;
                *k += v * old;
            }
            put(&mut gain, j, v);
        }
        x.axpy(residual / alpha, &gain, 1.0);
    }

    /// Adds the variance `q` to one state (Agee and Turner's rank-one update).
    pub fn add_noise(&mut self, state: usize, q: f64) {
        let mut a = unit::<N>(state);
        let mut c = q;
        for j in (0..=state).rev() {
            let s = at(&a, j);
            let Some((d, above)) = self.column_mut(j).split_last_mut() else { continue };
            let sum = *d + c * s * s;
            if !(sum > 0.0) {
                continue;
            }
            let beta = c * s / sum;
            c *= *d / sum;
            *d = sum;
            for (u, a) in above.iter_mut().zip(a.iter_mut()) {
                *a -= s * *u;
                *u += beta * *a;
            }
        }
    }

    /// One state is multiplied by `kept` > 0, as a Gauss-Markov process is over a step.
    pub fn decay(&mut self, state: usize, kept: f64) {
        if let Some((d, above)) = self.column_mut(state).split_last_mut() {
            *d *= kept * kept;
            above.iter_mut().for_each(|u| *u /= kept);
        }
        for j in state + 1..self.used {
            if let Some(u) = self.column_mut(j).get_mut(state) {
                *u *= kept;
            }
        }
    }

    /// The state `i` becomes itself plus `share` of the state `j` after it: U stays triangular.
    pub fn shear(&mut self, i: usize, j: usize, share: f64) {
        for column in j..self.used {
            let own = if column == j { 1.0 } else { self.column(column).get(j).copied().unwrap_or(0.0) };
            if let Some(u) = self.column_mut(column).get_mut(i).filter(|_| i < j) {
                *u += share * own;
            }
        }
    }

    /// What is known of a state, and of its relation to others, is forgotten; it is now known to `sigma`.
    pub fn renew(&mut self, state: usize, sigma: f64) {
        // Much more than is possible, so that nothing is left; then a measurement that says how large it can be.
        let wide = 1e3 * sigma;
        self.add_noise(state, wide * wide);
        self.update(&mut SVector::zeros(), &unit(state), 0.0, sigma * sigma);
    }

    /// The first `LEAD` states go to `phi`·lead + `coupling`·others + noise with the variances `q`; the others stay.
    ///
    /// `STACK` is `2·LEAD`. Only the leading triangle has to be made triangular again: the other columns keep their form.
    pub fn lead<const LEAD: usize, const OTHERS: usize, const STACK: usize>(
        &mut self,
        phi: &SMatrix<f64, LEAD, LEAD>,
        coupling: &SMatrix<f64, LEAD, OTHERS>,
        q: &SVector<f64, LEAD>,
    ) {
        for j in LEAD..self.used {
            let column = self.column_mut(j);
            let mut lead = SVector::<f64, LEAD>::zeros();
            lead.iter_mut().zip(column.iter()).for_each(|(lead, u)| *lead = *u);
            let mut moved = phi * lead;
            for (other, u) in column.iter().skip(LEAD).enumerate() {
                let weight = if other + LEAD == j { 1.0 } else { *u };
                moved.axpy(weight, &coupling.column(other), 1.0);
            }
            column.iter_mut().zip(moved.iter()).for_each(|(u, moved)| *u = *moved);
        }
        self.orthogonalise::<LEAD, STACK>(phi, q);
    }

    /// Thornton: rows of [Φ·U, 1] made orthogonal in the weights [D, q] from the last to the first.
    fn orthogonalise<const LEAD: usize, const STACK: usize>(
        &mut self,
        phi: &SMatrix<f64, LEAD, LEAD>,
        q: &SVector<f64, LEAD>,
    ) {
        let mut rows = [SVector::<f64, STACK>::zeros(); LEAD];
        let mut weights = SVector::<f64, STACK>::zeros();
        for (i, row) in rows.iter_mut().enumerate() {
            for j in 0..LEAD {
                let column = self.column(j).iter().take(j).enumerate();
                put(row, j, column.map(|(k, u)| phi[(i, k)] * u).sum::<f64>() + phi[(i, j)]);
            }
            put(row, LEAD + i, 1.0);
            put(&mut weights, i, self.d(i));
            put(&mut weights, LEAD + i, at(q, i));
        }
        for j in (0..LEAD).rev() {
            let Some((row, above)) = rows.get_mut(..=j).and_then(|rows| rows.split_last_mut()) else { continue };
            let weighted = weights.component_mul(row);
            let d = weighted.dot(row);
            let column = self.column_mut(j);
            let Some((place, triangle)) = column.split_last_mut() else { continue };
            *place = d;
            for (other, u) in above.iter_mut().zip(triangle) {
                *u = if d > 0.0 { other.dot(&weighted) / d } else { 0.0 };
                other.axpy(-*u, row, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Four = Ud<4, 10>;

    fn full(ud: &Four) -> SMatrix<f64, 4, 4> {
        SMatrix::from_fn(|i, j| ud.covariance(i, j))
    }

    /// The same steps by the plain formulas of the covariance.
    #[test]
    fn every_step_is_that_of_the_full_covariance() {
        let mut ud = Four::diagonal(&SVector::from([1.0, 2.0, 0.5, 3.0]));
        let mut plain = SMatrix::<f64, 4, 4>::from_diagonal(&SVector::from([1.0, 4.0, 0.25, 9.0]));
        let mut x = SVector::<f64, 4>::zeros();
        let mut plain_x = x;
        let phi = SMatrix::<f64, 2, 2>::new(1.0, 0.3, -0.2, 0.9);
        let coupling = SMatrix::<f64, 2, 2>::new(0.5, 0.0, 0.1, -0.7);
        let mut whole = SMatrix::<f64, 4, 4>::identity();
        whole.fixed_view_mut::<2, 2>(0, 0).copy_from(&phi);
        whole.fixed_view_mut::<2, 2>(0, 2).copy_from(&coupling);
        for step in 0..20 {
            ud.lead::<2, 2, 4>(&phi, &coupling, &SVector::from([0.01, 0.04]));
            plain = whole * plain * whole.transpose()
                + SMatrix::<f64, 4, 4>::from_diagonal(&SVector::from([0.01, 0.04, 0.0, 0.0]));
            ud.decay(2, 0.9);
            let decay = SMatrix::<f64, 4, 4>::from_diagonal(&SVector::from([1.0, 1.0, 0.9, 1.0]));
            plain = decay * plain * decay;
            ud.add_noise(2, 0.02);
            plain[(2, 2)] += 0.02;
            ud.shear(1, 3, 0.2);
            let mut shear = SMatrix::<f64, 4, 4>::identity();
            shear[(1, 3)] = 0.2;
            plain = shear * plain * shear.transpose();
            let h = SVector::from([1.0, 0.0, f64::from(step) * 0.1, -0.4]);
            let (value, r) = (0.3, 0.7);
            let innovation = ud.innovation(&x, &h, value, r);
            ud.update(&mut x, &h, value, r);
            let gain = plain * h / (h.dot(&(plain * h)) + r);
            assert!((innovation.variance - (h.dot(&(plain * h)) + r)).abs() < 1e-12);
            plain_x += gain * (value - h.dot(&plain_x));
            plain -= gain * (h.transpose() * plain);
            assert!((full(&ud) - plain).norm() < 1e-11, "step {step}");
            assert!((x - plain_x).norm() < 1e-12);
            assert!((ud.variance(1) - plain[(1, 1)]).abs() < 1e-12);
        }
    }

    /// A measurement 1e9 times better than what is known: the plain formula loses its positive covariance, this does not.
    #[test]
    fn variances_stay_positive_where_the_plain_formula_fails() {
        let mut ud = Four::diagonal(&SVector::from([1e6, 1e6, 1e6, 1e6]));
        let mut plain = SMatrix::<f64, 4, 4>::identity() * 1e12;
        let mut x = SVector::<f64, 4>::zeros();
        let mut failed = false;
        for i in 0..200 {
            let t = f64::from(i) * 0.01;
            let h = SVector::from([1.0, t, t * t, 1.0 + 1e-7 * t]);
            ud.update(&mut x, &h, 0.0, 1e-12);
            let gain = plain * h / (h.dot(&(plain * h)) + 1e-12);
            plain -= gain * (h.transpose() * plain);
            failed |= (0..4).any(|i| plain[(i, i)] < 0.0);
            assert!((0..4).all(|i| ud.variance(i) > 0.0));
        }
        assert!(failed);
    }
}
