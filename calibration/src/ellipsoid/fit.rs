//! From attitudes to a calibration, or to the reason why there is none.

use nalgebra::{Matrix3, Vector3};

use super::attitude::Attitude;
use super::coverage::{Coverage, Direction, LEAST_COVERAGE};
use super::prior::Misalignments;
use super::quadric::{Ellipsoid, Scatter};
use super::refine::{Covariance, Point, Refined, Residual, State};
use super::refusal::{LEAST_ATTITUDES, MOST_ELONGATED, MOST_RESIDUAL};
use super::{Correction, Refusal, nominal, norm_rms};
use crate::statistics::chi_square_p;

/// Largest standard deviation of |f|/G, in the direction known worst, that is an answer.
const MOST_SIGMA: f64 = 0.02;
/// An attitude whose norm is further from G than this, in standard deviations of what the others leave, is invalid.
const INVALID_SIGMAS: f64 = 8.0;
/// Fewest attitudes beyond the parameters that can say so.
const LEAST_OTHERS: usize = 5;
/// Noise explains residuals that are at least as probable as this.
const LEAST_NOISE_P: f64 = 0.01;

/// Readings without scatter whose norms, squared, are left with less than this lie on an ellipsoid but for rounding.
const EXACT: f64 = 1e-20;

/// What an attitude is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Learned from.
    Fit,
    /// Only judged.
    Check,
    /// Left out: it contradicts the others.
    Invalid,
}

/// An attitude with its role.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    pub attitude: Attitude,
    pub role: Role,
}

/// Where the standard deviations come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weights {
    /// The scatter of the readings explains the residuals.
    Noise,
    /// It does not: attitudes differ by this rms of |f|/G as well (non-linearity, motion, temperature).
    Excess(f64),
}

/// A calibration with its standard deviations and what says how good it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    pub correction: Correction,
    /// In the unit of the readings.
    pub sigma_bias: [f64; 3],
    /// Of the upper triangle of M, rows; 0 below.
    pub sigma_matrix: [[f64; 3]; 3],
    /// Half axes of the ellipsoid in the unit of the readings, from the greatest to the least.
    pub half_axes: [f64; 3],
    /// Coverage of the sphere by the attitudes that were learned from, 0 … 1.
    pub coverage: f64,
    pub weights: Weights,
    /// Root mean square of |f| − G over the attitudes learned from.
    pub norm_rms: f64,
    /// The same over those only judged; `None` without any.
    pub check_norm_rms: Option<f64>,
}

/// Fits an ellipsoid to the entries with the role [`Role::Fit`]; `gravity` is G in the unit that is wanted, positive.
///
/// The start is the constrained algebraic fit; from there maximum likelihood: the deviation of every corrected norm from G,
/// weighted with the noise of its mean. Attitudes that contradict the others become [`Role::Invalid`], at most a fifth.
pub fn fit(entries: &mut [Entry], gravity: f64) -> Result<Calibration, Refusal> {
    fit_with(entries, gravity, None)
}

/// The same with misalignments known from before, as sure as they are: the attitudes then tell biases and scale factors.
pub fn fit_with(entries: &mut [Entry], gravity: f64, prior: Option<&Misalignments>) -> Result<Calibration, Refusal> {
    fit_from(algebraic, entries, gravity, prior)
}

/// The same from a sphere about the readings, for a board: without the eigen-solver of the algebraic fit, which would take tens
/// of kilobytes of its flash. For readings that determine an ellipsoid the result is the same: maximum likelihood has no
/// memory of its start.
pub fn fit_from_sphere(entries: &mut [Entry], gravity: f64) -> Result<Calibration, Refusal> {
    fit_from(|_, _| Ok(State::UNIT_SPHERE), entries, gravity, None)
}

/// Where the solution starts.
type Start = fn(&[Entry], &Scale) -> Result<State, Refusal>;

fn algebraic(entries: &[Entry], scale: &Scale) -> Result<State, Refusal> {
    let points = learned(entries).map(|attitude| scale.point(attitude).at);
    let ellipsoid = Scatter::of(points).ellipsoid().ok_or_else(|| no_ellipsoid(entries))?;
    State::of(&ellipsoid).ok_or(Refusal::NoEllipsoid)
}

#[inline(never)]
fn fit_from(
    start: Start,
    entries: &mut [Entry],
    gravity: f64,
    prior: Option<&Misalignments>,
) -> Result<Calibration, Refusal> {
    let attitudes = learned(entries).count();
    let mut may_drop = (attitudes / 5).min(attitudes.saturating_sub(LEAST_ATTITUDES + 1));
    loop {
        let scale = Scale::of(learned(entries));
        let solved = Solved::new(start, entries, &scale)?;
        if may_drop > 0
            && let Some(entry) = solved.most_invalid(entries, &scale).and_then(|worst| entries.get_mut(worst))
        {
            entry.role = Role::Invalid;
            may_drop -= 1;
            continue;
        }
        return solved.combined(prior)?.calibration(entries, &scale, gravity);
    }
}

fn with_role(entries: &[Entry], role: Role) -> impl Iterator<Item = &Attitude> + Clone {
    entries.iter().filter(move |entry| entry.role == role).map(|entry| &entry.attitude)
}

fn learned(entries: &[Entry]) -> impl Iterator<Item = &Attitude> + Clone {
    with_role(entries, Role::Fit)
}

/// The readings' offset and factor to about the unit sphere, and their noise.
struct Scale {
    offset: Vector3<f64>,
    factor: f64,
    /// Variance of a reading of x, y, z, over all attitudes.
    variance: Vector3<f64>,
}

impl Scale {
    fn of<'a>(attitudes: impl Iterator<Item = &'a Attitude> + Clone) -> Self {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        let (mut squares, mut freedom) = (Vector3::zeros(), 0.0);
        for attitude in attitudes {
            let mean = Vector3::from(attitude.mean);
            low = low.inf(&mean);
            high = high.sup(&mean);
            squares += Vector3::from(attitude.squares.map(f64::from));
            freedom += f64::from(attitude.readings.saturating_sub(1));
        }
        let factor = 2.0 / (high - low).amax();
        Self {
            offset: 0.5 * (low + high),
            factor: if factor.is_finite() { factor } else { 1.0 },
            variance: squares / f64::max(freedom, 1.0),
        }
    }

    fn point(&self, attitude: &Attitude) -> Point {
        let readings = f64::from(attitude.readings.max(1));
        Point {
            at: (Vector3::from(attitude.mean) - self.offset) * self.factor,
            variance: self.variance * (self.factor * self.factor / readings),
        }
    }
}

/// A solution about the unit sphere.
struct Solved {
    refined: Refined,
    covariance: Covariance,
    attitudes: usize,
    /// Variance of the norm beyond the noise of the readings.
    excess: f64,
}

impl Solved {
    /// Never inlined, as others below: matrices of the one shall not take the stack of the other.
    #[inline(never)]
    fn new(start: Start, entries: &[Entry], scale: &Scale) -> Result<Self, Refusal> {
        let points = || learned(entries).map(|attitude| scale.point(attitude));
        let attitudes = points().count();
        if attitudes < LEAST_ATTITUDES {
            return Err(Refusal::TooFew { attitudes });
        }
        let around = || no_ellipsoid(entries);
        // The first pass with equal weights needs no noise; the second has it.
        let equal = start(entries, scale)?.refine(&points, 1.0).ok_or_else(around)?;
        let freedom = attitudes - LEAST_ATTITUDES;
        let left = equal.chi_square / f64::max(freedom as f64, 1.0);
        let (refined, covariance, excess) = weigh(equal, left, freedom, &points).ok_or_else(around)?;
        Ok(Self { refined, covariance, attitudes, excess })
    }

    /// The entry that contradicts the others most, if it is invalid: by what the others leave, its own part taken out
    /// (externally studentised residuals: R. D. Cook and S. Weisberg, Residuals and Influence in Regression, 1982,
    /// section 2.2.2). Noise of the readings alone makes nothing invalid.
    #[inline(never)]
    fn most_invalid(&self, entries: &[Entry], scale: &Scale) -> Option<usize> {
        let freedom = self.attitudes.checked_sub(LEAST_ATTITUDES + LEAST_OTHERS)? as f64 + LEAST_OTHERS as f64 - 1.0;
        let mut worst = (INVALID_SIGMAS, None);
        for (i, entry) in entries.iter().enumerate().filter(|(_, entry)| entry.role == Role::Fit) {
            let Residual { value, variance, jacobian, .. } =
                self.refined.state.residual(&scale.point(&entry.attitude))?;
            let weight = 1.0 / (variance + self.excess);
            let leverage = weight * (jacobian.transpose() * self.covariance * jacobian).x;
            let square = weight * value * value / (1.0 - leverage);
            let of_others = (self.refined.chi_square - square) / freedom;
            let sigmas = libm::sqrt(square / of_others.max(weight * variance).max(f64::MIN_POSITIVE));
            if sigmas > worst.0 {
                worst = (sigmas, Some(i));
            }
        }
        worst.1
    }

    fn combined(self, prior: Option<&Misalignments>) -> Result<Self, Refusal> {
        let Some(prior) = prior else { return Ok(self) };
        let (state, covariance) = prior.combine(&self.refined.state, &self.covariance).ok_or(Refusal::NoEllipsoid)?;
        Ok(Self { refined: Refined { state, ..self.refined }, covariance, ..self })
    }

    #[inline(never)]
    fn calibration(self, entries: &[Entry], scale: &Scale, gravity: f64) -> Result<Calibration, Refusal> {
        let state = &self.refined.state;
        let half_axes = state.half_axes().map(|half_axis| half_axis / scale.factor);
        let [greatest, _, least] = half_axes;
        let units = || learned(entries).filter_map(|attitude| state.residual(&scale.point(attitude)));
        let coverage = Coverage::of(units().map(|residual| *residual.unit.as_ref()));
        refuse(&coverage)?;
        if !(greatest <= MOST_ELONGATED * least) {
            return Err(Refusal::Elongated { ratio: greatest / least });
        }
        let left: f64 = units().map(|residual| residual.value * residual.value).sum();
        let rms = libm::sqrt(left / self.attitudes as f64);
        if rms > MOST_RESIDUAL {
            return Err(Refusal::Residual { rms });
        }
        let sigma = worst_sigma(state, &self.covariance);
        if sigma.is_nan() || sigma > MOST_SIGMA {
            return Err(Refusal::TooNoisy { sigma });
        }
        let correction =
            Correction::new(&(scale.offset + state.centre / scale.factor), &(state.matrix * (gravity * scale.factor)));
        let &[bx, by, bz, m11, m12, m13, m22, m23, m33] = self.covariance.diagonal().map(libm::sqrt).as_ref();
        let of_matrix = |sigma: f64| sigma * gravity * scale.factor;
        let rms_of = |role| norm_rms(with_role(entries, role).map(|attitude| attitude.mean), &correction, gravity);
        Ok(Calibration {
            correction,
            sigma_bias: [bx, by, bz].map(|sigma| sigma / scale.factor),
            sigma_matrix: [[m11, m12, m13], [0.0, m22, m23], [0.0, 0.0, m33]].map(|row| row.map(of_matrix)),
            half_axes,
            coverage: coverage.least(),
            weights: if self.excess > 0.0 { Weights::Excess(libm::sqrt(self.excess)) } else { Weights::Noise },
            norm_rms: rms_of(Role::Fit).unwrap_or(rms * gravity),
            check_norm_rms: rms_of(Role::Check),
        })
    }
}

/// Weighs with the noise of the readings, or, if that does not explain what is left, with as much more as does. Gives the covariance and
/// that excess beside the solution.
#[inline(never)]
fn weigh<P: Iterator<Item = Point>>(
    equal: Refined,
    left: f64,
    freedom: usize,
    points: &impl Fn() -> P,
) -> Option<(Refined, Covariance, f64)> {
    let noise: f64 = points().map(|point| point.variance.sum()).sum();
    if noise > 0.0 {
        let refined = equal.state.refine(points, 0.0)?;
        if chi_square_p(refined.chi_square, u32::try_from(freedom).unwrap_or(u32::MAX)) >= LEAST_NOISE_P {
            return Some((refined, refined.state.covariance(points, 0.0)?, 0.0));
        }
    } else if left < EXACT {
        // Nothing but rounding: all alike, by what is left.
        return Some((equal, equal.state.covariance(points, 1.0)? * left, 0.0));
    }
    let mut excess = left;
    let mut refined = equal;
    for _ in 0..8 {
        refined = refined.state.refine(points, excess)?;
        excess *= refined.chi_square / f64::max(freedom as f64, 1.0);
    }
    Some((refined, refined.state.covariance(points, excess)?, excess))
}

impl State {
    /// Of points scaled to about the unit sphere.
    const UNIT_SPHERE: Self =
        Self { centre: Vector3::new(0.0, 0.0, 0.0), matrix: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) };

    /// M with MᵀM = Q: Cholesky.
    fn of(ellipsoid: &Ellipsoid) -> Option<Self> {
        Some(Self { centre: ellipsoid.centre, matrix: ellipsoid.shape.cholesky()?.l().transpose() })
    }
}

/// Standard deviation of |f|/G in the direction known worst.
#[inline(never)]
fn worst_sigma(state: &State, covariance: &Covariance) -> f64 {
    let Some(inverse) = state.matrix.try_inverse() else { return f64::NAN };
    let mut worst = 0.0;
    for direction in Direction::all() {
        let at = state.centre + inverse * Vector3::from(direction.unit());
        let Some(residual) = state.residual(&Point { at, variance: Vector3::zeros() }) else { return f64::NAN };
        worst = f64::max(worst, (residual.jacobian.transpose() * covariance * residual.jacobian).x);
    }
    libm::sqrt(worst)
}

#[inline(never)]
fn refuse(coverage: &Coverage) -> Result<(), Refusal> {
    let least = coverage.least();
    if least >= LEAST_COVERAGE {
        return Ok(());
    }
    let mut missing = [None; 4];
    for place in 0..missing.len() {
        let worst = Direction::all()
            .filter(|direction| coverage.is_missing(*direction) && !missing.contains(&Some(*direction)))
            .map(|direction| (coverage.towards(direction.unit()), direction))
            .min_by(|(a, _), (b, _)| a.total_cmp(b));
        if let (Some(place), Some((_, direction))) = (missing.get_mut(place), worst) {
            *place = Some(direction);
        }
    }
    Err(Refusal::Coverage { coverage: least, missing })
}

/// Why no ellipsoid can be found: by the directions of the readings themselves, they do not cover the sphere, or there is none.
fn no_ellipsoid(entries: &[Entry]) -> Refusal {
    let nominal = nominal(learned(entries).map(|attitude| attitude.mean), 1.0);
    let directions = learned(entries).map(|attitude| {
        let norm = nominal.norm(attitude.mean);
        nominal.apply(attitude.mean).map(|part| part / norm)
    });
    refuse(&Coverage::of(directions)).err().unwrap_or(Refusal::NoEllipsoid)
}
