//! An accelerometer triad in known attitudes, such as each axis up and each axis down: bias, scale factors, misalignments.
//!
//! Reading of axis i: N = b + s1·fx + s2·fy + s3·fz, where (fx, fy, fz) is gravity's reaction along the axes of the box: G
//! times the direction that is up. Six positions on a plate give bias and scale factor of each axis from its own two; the
//! responses to the other axes need a box whose faces are known to be square.

use nalgebra::{Matrix3, Matrix4, Vector4};
use quantities::units::ARCSEC_PER_RAD;

use super::ellipsoid::Correction;
use super::ellipsoid::attitude::Attitude;
use super::statistics::chi_square_p;

/// An axis is taken to point up or down where it lies along the vertical to this: cos 2.6°.
const ALONG: f64 = 0.999;
/// The scatter of the readings explains residuals that are at least as probable as this.
const LEAST_NOISE_P: f64 = 0.01;
/// Largest residual, and largest standard deviation of a response, over the mean response: no calibration beyond.
const MOST_RELATIVE: f64 = 0.02;
/// Largest ratio of the responses of two axes of one triad.
const MOST_UNEQUAL: f64 = 2.0;

/// An attitude of the box and what the triad read in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Unit vector: which way is up, along x, y, z of the box.
    pub up: [f64; 3],
    pub attitude: Attitude,
}

/// What is known of the attitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attitudes {
    /// An axis points up or down, roughly: only its own readings then are used.
    Rough,
    /// Every direction is good to ± this, arcsec (uniformly distributed): all readings are used.
    Square { arcsec: f64 },
}

/// A calibration with its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Readings of x, y, z without specific force.
    pub bias: [f64; 3],
    /// Row: axis x, y, z; column: its readings per unit of specific force along x, y, z of the box.
    pub response: [[f64; 3]; 3],
    pub sigma_bias: [f64; 3],
    /// 0 where the response was not looked for.
    pub sigma_response: [[f64; 3]; 3],
    pub closure: Closure,
    /// How far an axis that should be upright leans at most, by what the other two read then, rad; 0 where the attitudes are known better.
    pub greatest_lean_rad: f64,
}

/// What the readings have left over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closure {
    /// How many readings there are beyond the parameters.
    pub count: u32,
    /// Root of the sum of squared residuals over the count, in the unit of the readings; `None` without closures.
    pub rms: Option<f64>,
    /// Factor by which the standard deviations were widened, because scatter and angles do not explain the closures; 1
    /// where they do.
    pub widened: f64,
}

/// Why attitudes give no calibration. Axes are 0, 1, 2 for x, y, z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// The axis was never up, or never down.
    NotBothWays { axis: usize },
    /// The attitudes do not determine what this axis responds to.
    Undetermined { axis: usize },
    /// Readings per unit of specific force that no axis of a triad with such others has.
    Unequal { axis: usize },
    /// The axis' readings contradict each other: residual, rms over the mean response times G.
    Residual { axis: usize, relative: f64 },
    /// The responses of the axis would be known to this only, relative to its scale factor.
    TooNoisy { axis: usize, relative: f64 },
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let name = |axis: &usize| ["x", "y", "z"].get(*axis).copied().unwrap_or("?");
        match self {
            Self::NotBothWays { axis } => {
                let axis = name(axis);
                write!(
                    f,
                    "the {axis} axis was not both up and down: lay the triad with {axis} up, and with {axis} down"
                )
            }
            Self::Undetermined { axis } => {
                write!(
                    f,
                    "the attitudes do not determine what the {} axis responds to: lay it on other faces too",
                    name(axis)
                )
            }
            Self::Unequal { axis } => write!(
                f,
                "the scale factor of the {} axis differs from the others' by more than a factor of {MOST_UNEQUAL}: it was not \
                 turned over, or it is no accelerometer of this triad",
                name(axis)
            ),
            Self::Residual { axis, relative } => write!(
                f,
                "the readings of the {} axis contradict each other by {:.2} % of gravity (allowed is {} %): an attitude is not \
                 what it is said to be, or the triad did not rest",
                name(axis),
                100.0 * relative,
                100.0 * MOST_RELATIVE
            ),
            Self::TooNoisy { axis, relative } => write!(
                f,
                "the readings are too noisy: the response of the {} axis would be known to {:.2} % only",
                name(axis),
                100.0 * relative
            ),
        }
    }
}

/// Solves for the parameters; `gravity` is G in the unit that is wanted, positive.
///
/// Weights: the scatter of the readings over their number, and the part of the attitudes: a direction that is off by δ
/// changes a level axis by δ·G. Where both do not explain the closures, all standard deviations are widened by as much as
/// does. An axis that should be upright and leans by τ reads τ²/2 of G too little: 150 ppm for 1°. What the other two read
/// across shows τ, but not whether the axis or they are askew: the deficit is part of the reading's variance.
pub fn solve(positions: &[Position], gravity: f64, attitudes: Attitudes) -> Result<Calibration, Refusal> {
    let solved = |response| -> Result<[Solution; 3], Refusal> {
        let [x, y, z] = [0, 1, 2].map(|axis| Axis { axis, positions, gravity, attitudes, response });
        Ok([x.solve()?, y.solve()?, z.solve()?])
    };
    let own = |[x, y, z]: &[Solution; 3]| [x.own(0), y.own(1), z.own(2)];
    let mut all = solved(None)?;
    let mut greatest_lean_rad: f64 = 0.0;
    if matches!(attitudes, Attitudes::Rough) {
        let response = own(&all);
        all = solved(Some(response))?;
        let squares =
            positions.iter().filter_map(|position| Some(leaning(position, upright(position)?, gravity, &response)));
        greatest_lean_rad = libm::sqrt(squares.fold(0.0, f64::max));
    }
    let scales = own(&all).map(|(_, scale)| scale);
    let greatest = scales.into_iter().fold(0.0, f64::max);
    if let Some(axis) = scales.iter().position(|scale| scale.is_nan() || *scale * MOST_UNEQUAL < greatest) {
        return Err(Refusal::Unequal { axis });
    }
    for (axis, (solution, scale)) in all.iter().zip(scales).enumerate() {
        let relative = solution.rms / (scale * gravity);
        if relative.is_nan() || relative > MOST_RELATIVE {
            return Err(Refusal::Residual { axis, relative });
        }
    }
    let count: u32 = all.iter().map(|solution| solution.closures).sum();
    let chi_square: f64 = all.iter().map(|solution| solution.chi_square).sum();
    let squares: f64 = all.iter().map(|solution| solution.rms * solution.rms * f64::from(solution.closures)).sum();
    let explained = count == 0 || chi_square_p(chi_square, count) >= LEAST_NOISE_P;
    let widened = if explained { 1.0 } else { libm::sqrt(chi_square / f64::from(count)) };
    let sigmas = all.map(|solution| solution.sigmas.map(|sigma| sigma * widened));
    for (axis, (&[_, along @ ..], scale)) in sigmas.iter().zip(scales).enumerate() {
        let relative = along.into_iter().fold(0.0, f64::max) / scale;
        if relative.is_nan() || relative > MOST_RELATIVE {
            return Err(Refusal::TooNoisy { axis, relative });
        }
    }
    let split = |[bias, along @ ..]: [f64; 4]| (bias, along);
    let values = all.map(|solution| split(*solution.parameters.as_ref()));
    let sigmas = sigmas.map(split);
    Ok(Calibration {
        bias: values.map(|(bias, _)| bias),
        response: values.map(|(_, along)| along),
        sigma_bias: sigmas.map(|(bias, _)| bias),
        sigma_response: sigmas.map(|(_, along)| along),
        closure: Closure { count, rms: (count > 0).then(|| libm::sqrt(squares / f64::from(count.max(1)))), widened },
        greatest_lean_rad,
    })
}

/// The axis that is upright in an attitude, either way.
fn upright(position: &Position) -> Option<usize> {
    position.up.iter().position(|part| part.abs() >= ALONG)
}

/// Square of the angle, rad, by which an upright axis leans: what the other two read of gravity, by the biases and scale factors of all three.
fn leaning(position: &Position, axis: usize, gravity: f64, response: &[(f64, f64); 3]) -> f64 {
    let across = position.attitude.mean.iter().zip(response).enumerate().filter(|(other, _)| *other != axis);
    across.map(|(_, (reading, (bias, scale)))| (reading - bias) / (scale * gravity)).map(|part| part * part).sum()
}

impl Calibration {
    /// What turns readings into specific force along the axes of the box, and the standard deviations of its matrix.
    ///
    /// `None` for responses that cannot be undone, which [`solve`] never gives.
    pub fn correction(&self) -> Option<(Correction, [[f64; 3]; 3])> {
        let rows = |rows: &[[f64; 3]; 3]| Matrix3::from(*rows).transpose();
        let matrix = rows(&self.response).try_inverse()?;
        // δM = −M δS M, every element of δS on its own.
        let squared = |matrix: Matrix3<f64>| matrix.component_mul(&matrix);
        let variance = squared(matrix) * squared(rows(&self.sigma_response)) * squared(matrix);
        let sigma = variance.map(libm::sqrt);
        Some((Correction { bias: self.bias, matrix: matrix.transpose().into() }, sigma.transpose().into()))
    }
}

/// One axis and the attitudes.
#[derive(Clone, Copy)]
struct Axis<'a> {
    axis: usize,
    positions: &'a [Position],
    gravity: f64,
    attitudes: Attitudes,
    /// Bias and scale factor of each axis, as far as they are known already.
    response: Option<[(f64, f64); 3]>,
}

struct Observation {
    /// 1, fx, fy, fz.
    row: Vector4<f64>,
    reading: f64,
    variance: f64,
}

/// Bias and responses of one axis.
#[derive(Clone, Copy)]
struct Solution {
    parameters: Vector4<f64>,
    sigmas: [f64; 4],
    chi_square: f64,
    closures: u32,
    /// Of the residuals over the closures; 0 without.
    rms: f64,
}

impl Solution {
    fn scale(&self, axis: usize) -> f64 {
        self.parameters.get(axis + 1).copied().unwrap_or(f64::NAN)
    }

    /// Bias and scale factor of the axis itself.
    fn own(&self, axis: usize) -> (f64, f64) {
        (self.parameters.x, self.scale(axis))
    }
}

impl Axis<'_> {
    fn part<T: Copy + Into<f64>>(&self, vector: &[T; 3]) -> f64 {
        vector.get(self.axis).map_or(f64::NAN, |&part| part.into())
    }

    /// Weighted least squares: once with equal weights, for the scale factor that the weights need, then with them.
    fn solve(&self) -> Result<Solution, Refusal> {
        let axis = self.axis;
        let (mut up, mut down) = (false, false);
        for position in self.positions {
            let along = self.part(&position.up);
            up |= along >= ALONG;
            down |= along <= -ALONG;
        }
        if matches!(self.attitudes, Attitudes::Rough) && !(up && down) {
            return Err(Refusal::NotBothWays { axis });
        }
        let equal = self.weighted(None).ok_or(Refusal::Undetermined { axis })?;
        let scale = equal.scale(axis);
        if self.observations(scale).all(|observation| observation.variance > 0.0) {
            return self.weighted(Some(scale)).ok_or(Refusal::Undetermined { axis });
        }
        // Readings without scatter: what is left over says how sure they are.
        Ok(Solution { sigmas: equal.sigmas.map(|sigma| sigma * equal.rms), chi_square: 0.0, ..equal })
    }

    fn observations(&self, scale: f64) -> impl Iterator<Item = Observation> + '_ {
        // Pooled over all attitudes.
        let (mut squares, mut freedom) = (0.0, 0.0);
        for position in self.positions {
            squares += self.part(&position.attitude.squares);
            freedom += f64::from(position.attitude.readings.saturating_sub(1));
        }
        let scatter = squares / f64::max(freedom, 1.0);
        self.positions.iter().filter_map(move |position| {
            let along = self.part(&position.up);
            let noise = scatter / f64::from(position.attitude.readings.max(1));
            let [x, y, z] = position.up.map(|part| part * self.gravity);
            let (row, angles) = match self.attitudes {
                Attitudes::Rough if along.abs() < ALONG => return None,
                Attitudes::Rough => {
                    let square = self.response.map_or(0.0, |known| leaning(position, self.axis, self.gravity, &known));
                    // The deficit τ²/2 of both ways up is of one sign: with twice its square each, the sigma of a scale factor is their mean.
                    let deficit = scale * self.gravity * square / 2.0;
                    (Vector4::new(1.0, 0.0, 0.0, 0.0), 2.0 * deficit * deficit)
                }
                Attitudes::Square { arcsec } => {
                    // Uniform in ± a: variance a²/3.
                    let off = arcsec / ARCSEC_PER_RAD * self.gravity * scale;
                    (Vector4::new(1.0, x, y, z), off * off / 3.0 * (1.0 - along * along).max(0.0))
                }
            };
            let mut observation =
                Observation { row, reading: self.part(&position.attitude.mean), variance: noise + angles };
            if let Some(own) = observation.row.get_mut(self.axis + 1) {
                *own = along * self.gravity;
            }
            Some(observation)
        })
    }

    /// With weights that know this scale factor, or with equal ones.
    fn weighted(&self, scale: Option<f64>) -> Option<Solution> {
        let observations = || {
            self.observations(scale.unwrap_or(0.0))
                .map(|observation| Observation { variance: scale.map_or(1.0, |_| observation.variance), ..observation })
        };
        let (mut normal, mut right, mut count) = (Matrix4::zeros(), Vector4::zeros(), 0);
        for Observation { row, reading, variance } in observations() {
            normal += row * row.transpose() / variance;
            right += row * (reading / variance);
            count += 1;
        }
        // A response that no observation has is not looked for: 0, and surely so.
        let wanted = normal.diagonal().map(|part| part > 0.0);
        for (place, wanted) in wanted.iter().enumerate() {
            if !wanted && let Some(diagonal) = normal.get_mut((place, place)) {
                *diagonal = 1.0;
            }
        }
        let unknowns = wanted.iter().filter(|wanted| **wanted).count() as u32;
        let closures = u32::checked_sub(count, unknowns)?;
        let covariance = normal.cholesky()?.inverse();
        let parameters = covariance * right;
        let (mut squares, mut chi_square) = (0.0, 0.0);
        for Observation { row, reading, variance } in observations() {
            let residual = reading - row.dot(&parameters);
            squares += residual * residual;
            chi_square += residual * residual / variance;
        }
        let mut sigmas: [f64; 4] = *covariance.diagonal().map(libm::sqrt).as_ref();
        for (sigma, wanted) in sigmas.iter_mut().zip(wanted.iter()) {
            *sigma = if *wanted { *sigma } else { 0.0 };
        }
        let rms = libm::sqrt(squares / f64::from(closures.max(1)));
        Some(Solution { parameters, sigmas, chi_square, closures, rms: if closures > 0 { rms } else { 0.0 } })
    }
}

#[cfg(test)]
mod tests;
