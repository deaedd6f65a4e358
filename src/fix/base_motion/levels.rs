//! What the level accelerometers read over a fix, as a linear model: what they do of themselves, and a path of the base.
//!
//! A(t) = constant + c (T(t) − T₀) + wander + jumps + path. The path is a polynomial in time, or what tripods do: a creep that dies away, with a
//! straight line beside it. c and the wander have the declared spread about zero, the coefficients of the path a
//! spread of their own; the wander, a random walk, stands as the first two functions of its Karhunen-Loève expansion on the fix,
//! √2 sin((k − ½) π s) / ((k − ½) π) of the share s of the fix. The normal equations are factored once for all columns in this order, the
//! path's functions last: the leading part of the factor is that of every lower degree, the squares of the right-hand sides through it are what
//! each column takes off the sum of squares, and its pivots say what a column costs in likelihood.

use nalgebra::{SMatrix, SVector};

use super::jumps::{Jumps, MOST_JUMPS};
use super::tilt::tilt_arcsec;
use crate::fix::dwell::{DwellSummary, Line};
use crate::sensing::level::LevelDrift;

/// A degree is taken when it lowers the sum of squares of both axes (two degrees of freedom) by this many variances:
/// by chance that happens once in e^(20/2) = 22 000 times.
pub const SIGNIFICANT: f64 = 20.0;
/// Functions of time in a path, with the constant.
pub const FUNCTIONS: usize = 5;
/// Functions of the wander.
const OF_WANDER: usize = 2;
/// Columns of the accelerometers' own: temperature and wander.
const OF_SENSOR: usize = 1 + OF_WANDER;
/// Columns before those of the path: no rate knows of the jumps, either.
const BEFORE_PATH: usize = OF_SENSOR + MOST_JUMPS;
const COLUMNS: usize = BEFORE_PATH + FUNCTIONS;

type Column = SVector<f64, COLUMNS>;
type Square = SMatrix<f64, COLUMNS, COLUMNS>;

/// Least share of a column that those before it must not explain.
const LEAST_SHARE: f64 = 1e-12;

/// What is supposed of the readings before they are looked at: one sigma of each.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    pub drift: LevelDrift,
    /// Of a power of the path, arcsec at either end of the fix; infinite: nothing is supposed.
    pub path_arcsec: f64,
}

impl Prior {
    /// Of accelerometers that do not drift, and a path of which nothing is supposed.
    pub const FREE: Self =
        Self { drift: LevelDrift { arcsec_per_k: 0.0, arcsec_per_sqrt_s: 0.0 }, path_arcsec: f64::INFINITY };
}

/// What a path is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Powers of time.
    Powers,
    /// An exponential that is 1 when the fix begins and falls with this share of half the fix as its time constant; then time itself.
    Creep(f64),
}

impl Law {
    /// Most of its functions that a path has, beside the constant.
    pub fn most(self) -> usize {
        match self {
            Self::Powers => FUNCTIONS - 1,
            Self::Creep(_) => 2,
        }
    }

    /// Its functions at a time, −1 when the fix begins and 1 when it ends.
    fn at(self, t: f64) -> SVector<f64, FUNCTIONS> {
        match self {
            Self::Powers => SVector::from([1.0, t, t * t, t * t * t, t * t * t * t]),
            Self::Creep(tau) => SVector::from([1.0, libm::exp(-(t + 1.0) / tau), t, 0.0, 0.0]),
        }
    }

    /// The mean of each over ± half about a time. The mean of a curved path differs from its value at the middle by the second moment.
    fn mean(self, t: f64, half: f64) -> SVector<f64, FUNCTIONS> {
        let h2 = half * half;
        match self {
            // Means of (t + u)^k over u in ± half: 1, t, t² + h²/3, t³ + t·h², t⁴ + 2t²h² + h⁴/5.
            Self::Powers => {
                let (square, cube) = (t * t + h2 / 3.0, t * t * t + t * h2);
                SVector::from([1.0, t, square, cube, t * t * t * t + 2.0 * t * t * h2 + h2 * h2 / 5.0])
            }
            // Of e^(−u/τ): sinh x / x with x = h/τ.
            Self::Creep(tau) => {
                let x = half / tau;
                let mean = if x > 0.0 { libm::sinh(x) / x } else { 1.0 };
                SVector::from([1.0, libm::exp(-(t + 1.0) / tau) * mean, t, 0.0, 0.0])
            }
        }
    }

    /// The least-squares slope of each over ± half about a time, 3/(2h³) ∫ u f(t + u) du.
    fn slope(self, t: f64, half: f64) -> SVector<f64, FUNCTIONS> {
        let h2 = half * half;
        match self {
            Self::Powers => SVector::from([0.0, 1.0, 2.0 * t, 3.0 * t * t + 0.6 * h2, 4.0 * t * t * t + 2.4 * t * h2]),
            // Of e^(−u/τ): −3/(h x²) (x cosh x − sinh x) with x = h/τ, which goes to −1/τ.
            Self::Creep(tau) => {
                let x = half / tau;
                let slope =
                    if x > 1e-3 { -3.0 * (x * libm::cosh(x) - libm::sinh(x)) / (half * x * x) } else { -1.0 / tau };
                SVector::from([0.0, self.at(t).y * slope, 1.0, 0.0, 0.0])
            }
        }
    }
}

/// Paths of pitch and roll in time, arcsec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    law: Law,
    /// Middle and half the length of the fix, seconds: times lie within ± 1, to keep the normal equations well conditioned.
    middle_s: f64,
    half_s: f64,
    coefficients: [SVector<f64, FUNCTIONS>; 2],
    /// Covariance of the coefficients of each axis.
    covariance: [SMatrix<f64, FUNCTIONS, FUNCTIONS>; 2],
}

impl Path {
    /// Mean derivative of its functions over a dwell, 1/s.
    pub fn rates(&self, dwell: &DwellSummary) -> SVector<f64, FUNCTIONS> {
        let at = |t_s: f64| self.law.at((t_s - self.middle_s) / self.half_s);
        (at(dwell.end_s) - at(dwell.start_s)) / (dwell.end_s - dwell.start_s)
    }

    pub fn coefficients(&self) -> &[SVector<f64, FUNCTIONS>; 2] {
        &self.coefficients
    }

    pub fn covariance(&self) -> &[SMatrix<f64, FUNCTIONS, FUNCTIONS>; 2] {
        &self.covariance
    }
}

/// The readings of both axes against the model.
pub struct Levels {
    law: Law,
    middle_s: f64,
    half_s: f64,
    axes: [Axis; 2],
}

/// An axis, in units of the variance of its readings.
struct Axis {
    /// Lower Cholesky factor L of the normal matrix.
    factor: Square,
    inverse: Square,
    /// L⁻¹ times the right-hand side.
    reduced: Column,
    /// Sum of squares of the readings.
    squares: f64,
    /// Half the logarithm of what is supposed of each column, one over its variance; of nothing where nothing is.
    log_priors: Column,
}

impl Levels {
    /// `variance`: of a one-second tilt, arcsec², pitch and roll. `None` where the dwells do not determine a path of all functions of the law.
    pub fn new(dwells: &[DwellSummary], law: Law, variance: [f64; 2], prior: &Prior, jumps: &Jumps) -> Option<Self> {
        let (first, last) = (dwells.first()?, dwells.last()?);
        let half_s = 0.5 * (last.end_s - first.start_s);
        let (middle_s, from_k) = (first.start_s + half_s, known_from_k(dwells));
        let span = Span { law, middle_s, half_s, from_k, drift: prior.drift, jumps };
        let [pitch, roll] = variance;
        let axes = [Axis::new(dwells, &span, 0, pitch, prior)?, Axis::new(dwells, &span, 1, roll, prior)?];
        Some(Self { law, middle_s: span.middle_s, half_s, axes })
    }

    /// Sums of squares of both axes about zero, less what the accelerometers do of themselves and a path of this degree explain, in variances.
    pub fn chi_square(&self, degree: usize) -> f64 {
        let left = |axis: &Axis| axis.squares - axis.leading(degree).map(|i| axis.explained(i)).sum::<f64>();
        self.axes.iter().map(left).sum()
    }

    /// What this power takes off the sums of squares of both axes, in variances.
    pub fn explained(&self, degree: usize) -> f64 {
        self.axes.iter().map(|axis| axis.explained(BEFORE_PATH + degree)).sum()
    }

    /// By how much the logarithm of the likelihood of a path of this degree exceeds that of a base that stands.
    pub fn log_likelihood_of(&self, degree: usize) -> f64 {
        let of_column = |axis: &Axis, i: usize| {
            let [pivot, prior] =
                [axis.factor.get((i, i)), axis.log_priors.get(i)].map(|each| each.map_or(0.0, |&each| each));
            0.5 * axis.explained(i) - libm::log(pivot) + prior
        };
        let of_axis = |axis| axis_columns(degree).map(|i| of_column(axis, i)).sum::<f64>();
        self.axes.iter().map(of_axis).sum()
    }

    /// The path of a degree, with what else the readings may show left uncertain.
    pub fn path(&self, degree: usize) -> Path {
        let mut path = Path {
            law: self.law,
            middle_s: self.middle_s,
            half_s: self.half_s,
            coefficients: [SVector::zeros(); 2],
            covariance: [SMatrix::zeros(); 2],
        };
        for ((axis, coefficients), covariance) in self.axes.iter().zip(&mut path.coefficients).zip(&mut path.covariance)
        {
            // The inverse of the leading part of L, which is the leading part of its inverse, with nothing beyond it.
            let size = BEFORE_PATH + degree + 1;
            let inverse =
                Square::from_fn(
                    |i, j| {
                        if i < size { axis.inverse.get((i, j)).copied().unwrap_or_default() } else { 0.0 }
                    },
                );
            let of_path = inverse.fixed_columns::<FUNCTIONS>(BEFORE_PATH);
            *coefficients = of_path.tr_mul(&axis.reduced);
            *covariance = of_path.tr_mul(&of_path);
        }
        path
    }
}

impl Path {
    /// Covariance of what the tilting adds to the gyro's mean rates at two dwells, cos θ · dr/dt − sin θ · dp/dt, (°/h)².
    pub fn covariance_of(&self, a: &DwellSummary, b: &DwellSummary) -> f64 {
        let [of_a, of_b] = [a, b].map(|dwell| self.rates(dwell));
        let [pitch, roll] = self.covariance.map(|covariance| of_a.dot(&(covariance * of_b)));
        a.sin * b.sin * pitch + a.cos * b.cos * roll
    }

    /// Nothing is taken out by it.
    pub fn stands(&self) -> bool {
        self.coefficients.iter().all(|coefficients| coefficients.iter().all(|&each| each == 0.0))
    }

    /// Of a base that stands, over the same time.
    pub fn standing(&self) -> Self {
        Self { coefficients: [SVector::zeros(); 2], covariance: [SMatrix::zeros(); 2], ..*self }
    }
}

/// The columns of the powers of a path, but the constant.
fn axis_columns(degree: usize) -> core::ops::RangeInclusive<usize> {
    BEFORE_PATH + 1..=BEFORE_PATH + degree
}

impl Axis {
    fn new(dwells: &[DwellSummary], span: &Span<'_>, axis: usize, variance: f64, prior: &Prior) -> Option<Self> {
        // One over the variance that is supposed of each column: one of the accelerometers' own, in units of their sigmas.
        let of_path = 1.0 / (prior.path_arcsec * prior.path_arcsec);
        let mut supposed = Column::repeat(of_path);
        supposed.fixed_rows_mut::<BEFORE_PATH>(0).fill(1.0);
        // Nothing is supposed of a jump's size, nor of the constant.
        supposed.iter_mut().skip(OF_SENSOR).take(span.jumps.count()).for_each(|each| *each = 0.0);
        *supposed.get_mut(BEFORE_PATH)? = 0.0;
        // Functions that the law does not have.
        supposed.iter_mut().skip(BEFORE_PATH + 1 + span.law.most()).for_each(|each| *each = 1.0);
        let mut normal = Square::from_diagonal(&supposed);
        let (mut right, mut squares) = (Column::zeros(), 0.0);
        for dwell in dwells.iter().filter(|dwell| span.jumps.spare(dwell)) {
            let line = tilt_arcsec(dwell)?;
            let &Line { mean, slope_per_s, .. } = line.get(axis)?;
            let spread = f64::from(dwell.time_spread);
            for (weight, row, value) in
                [(dwell.seconds, span.mean(dwell), mean), (spread, span.slope(dwell), slope_per_s)]
            {
                let weight = weight / variance;
                normal += weight * row * row.transpose();
                right += weight * value * row;
                squares += weight * value * value;
            }
        }
        let factor = normal.cholesky()?.l();
        // The square of a pivot is what of a column those before it do not explain.
        let pivots = factor.diagonal();
        if !pivots.iter().zip(normal.diagonal().iter()).all(|(pivot, whole)| pivot * pivot > LEAST_SHARE * whole) {
            return None;
        }
        let inverse = factor.solve_lower_triangular(&Square::identity())?;
        let log_priors = supposed.map(|supposed| if supposed > 0.0 { 0.5 * libm::log(supposed) } else { 0.0 });
        Some(Self { factor, inverse, reduced: inverse * right, squares, log_priors })
    }

    /// The columns up to a degree.
    fn leading(&self, degree: usize) -> core::ops::RangeInclusive<usize> {
        0..=BEFORE_PATH + degree
    }

    fn explained(&self, column: usize) -> f64 {
        self.reduced.get(column).map_or(0.0, |entry| entry * entry)
    }
}

/// The time of a fix, and how its dwells stand in the columns.
struct Span<'a> {
    law: Law,
    middle_s: f64,
    half_s: f64,
    /// Temperature of the first dwell, kelvin; `None` where one was not measured.
    from_k: Option<f64>,
    drift: LevelDrift,
    jumps: &'a Jumps,
}

impl Span<'_> {
    /// Middle and half the length of a dwell, in half fixes.
    fn of(&self, dwell: &DwellSummary) -> (f64, f64) {
        ((dwell.t_s - self.middle_s) / self.half_s, 0.5 * (dwell.end_s - dwell.start_s) / self.half_s)
    }

    /// The mean of each column over a dwell.
    fn mean(&self, dwell: &DwellSummary) -> Column {
        let (t, half) = self.of(dwell);
        let [p0, p1, p2, p3, p4] = *self.law.mean(t, half).as_ref();
        let warmer_k = self.from_k.map_or(0.0, |from_k| f64::from(dwell.temperature.kelvin) - from_k);
        let [w1, w2] = self.wander(t, libm::sin, |frequency| 1.0 / frequency);
        let [j1, j2, j3] = self.jumps.before(dwell);
        Column::from([self.drift.arcsec_per_k * warmer_k, w1, w2, j1, j2, j3, p0, p1, p2, p3, p4])
    }

    /// The slope of each column in a dwell, 1/s.
    fn slope(&self, dwell: &DwellSummary) -> Column {
        let (t, half) = self.of(dwell);
        let [p0, p1, p2, p3, p4] = *(self.law.slope(t, half) / self.half_s).as_ref();
        let warming = self.from_k.map_or(0.0, |_| f64::from(dwell.temperature.kelvin_per_s));
        let [w1, w2] = self.wander(t, libm::cos, |_| 0.5 / self.half_s);
        Column::from([self.drift.arcsec_per_k * warming, w1, w2, 0.0, 0.0, 0.0, p0, p1, p2, p3, p4])
    }

    /// σ √(2 length) f((k − ½) π s) times a factor of (k − ½) π, for k = 1 and 2.
    fn wander(&self, t: f64, of: fn(f64) -> f64, factor: impl Fn(f64) -> f64) -> [f64; OF_WANDER] {
        let size = self.drift.arcsec_per_sqrt_s * libm::sqrt(4.0 * self.half_s);
        [0.5, 1.5].map(|number| {
            let frequency = number * core::f64::consts::PI;
            size * of(frequency * 0.5 * (t + 1.0)) * factor(frequency)
        })
    }
}

/// Temperature of the first dwell, if that of every dwell was measured.
fn known_from_k(dwells: &[DwellSummary]) -> Option<f64> {
    let all = dwells.iter().all(|dwell| dwell.temperature.kelvin > 0.0);
    dwells.first().filter(|_| all).map(|dwell| f64::from(dwell.temperature.kelvin))
}
