//! Six-position calibration of a gyro triad: bias, scale factors and misalignments, twelve parameters.
//!
//! Output of gyro i in °/h: N = i0 + i1·ωx + i2·ωy + i3·ωz, where (ωx, ωy, ωz) is what the Earth's rotation gives about the
//! directions in which the axes point. The published method takes differences of pairs of positions ([`published`]); here
//! all measurements enter a weighted least-squares solution, and what they have left over are the closures.

pub mod axes;
pub mod dwell;
mod latitude;
pub mod published;
mod refusal;

pub use refusal::{Refusal, Undetermined};

use nalgebra::{Matrix4, SymmetricEigen, Vector4};
use quantities::earth::{EARTH_RATE_DEG_H, earth_rate};
use quantities::units::ARCSEC_PER_RAD;

use super::statistics::chi_square_p;
use axes::Axes;
use dwell::{Dwell, WANDER_FREEDOM};

/// A closure less probable than this is not noise.
pub const LEAST_CLOSURE_P: f64 = 1e-3;
/// A rate that wandered with less probability than this by chance did wander.
const LEAST_WANDER_P: f64 = 0.01;
/// Share of a direction of the parameter space in the measurements below which it is not determined.
const LEAST_SHARE: f64 = 1e-5;
/// Largest standard deviation of a matrix element that is an answer.
const MOST_SIGMA: f64 = 0.05;
/// Most by which a matrix element may differ from the unit matrix.
const MOST_DEVIATION: f64 = 0.2;

/// A position of the table and what the gyros read there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    pub axes: Axes,
    pub dwell: Dwell,
}

/// What is known besides the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knowledge {
    /// Geodetic latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// The table's angles are good to ± this, arcsec (uniformly distributed).
    pub table_arcsec: f64,
    /// Bias instability of the gyros, °/h: what does not average out, neither in a dwell nor over all of them.
    pub bias_instability_deg_h: f64,
}

/// A calibration with its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Output of the gyros x, y, z without rotation, °/h.
    pub bias_deg_h: [f64; 3],
    /// Row: gyro x, y, z; column: its response to rotation about x, y, z. The diagonal holds the scale factors.
    pub matrix: [[f64; 3]; 3],
    pub sigma_bias_deg_h: [f64; 3],
    pub sigma_matrix: [[f64; 3]; 3],
    pub closure: Closure,
}

/// What the measurements have left over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closure {
    /// How many: three for every position beyond the fourth.
    pub count: u32,
    /// Root of the sum of squared residuals over the count, °/h; `None` without closures.
    pub rms_deg_h: Option<f64>,
    /// Probability of a chi-square as large by chance; `None` without closures.
    pub p_value: Option<f64>,
}

/// Solves for the twelve parameters.
///
/// Weights: each mean's own variance, times how much the rates of that gyro wander (if they do), plus the declared bias
/// instability and the table's part: an angle error δ about an axis turns the Earth rate by δ × ω. Standard deviations
/// follow from these; they are not scaled by the closure, which is a test of its own. Those of the biases have the
/// instability once more: its slow part is common to all positions.
///
/// `latitude` in the refusals: the sine and the cosine of the latitude share the scale factors, so that a latitude that is
/// wrong shows as a vertical response that disagrees with the horizontal one. It is taken as wrong when four standard
/// deviations and scale factors that differ by 0.7 per cent, one sigma, cannot explain it.
pub fn solve(positions: &[Position], knowledge: &Knowledge) -> Result<Calibration, Refusal> {
    let measured = Measured::new(positions, knowledge)?;
    measured.refuse_undetermined(None)?;
    let solution = measured.solve(None).ok_or(Refusal::Undetermined(ALL))?;
    solution.refuse_noise()?;
    // Exchanged positions may look like another latitude.
    let exchanged = measured.find_exchange(&solution);
    if exchanged.is_none() {
        measured.refuse_latitude(&solution)?;
    }
    measured.refuse_closure(&solution, exchanged)?;
    solution.refuse_exchanged()?;
    Ok(solution.calibration())
}

const ALL: Undetermined = Undetermined { bias: true, about: [true; 3] };

/// One measurement of one gyro at one position.
#[derive(Clone, Copy)]
struct Observation {
    /// 1, ωx, ωy, ωz; rates in units of the Earth rate.
    row: Vector4<f64>,
    rate_deg_h: f64,
    variance: f64,
}

/// The measurements with what is known of them.
struct Measured<'a> {
    positions: &'a [Position],
    knowledge: &'a Knowledge,
    /// Factor on the variance of each gyro's rows.
    wander: [f64; 3],
    /// Two positions, each of which is taken to have had the other's axes.
    exchanged: Option<(usize, usize)>,
}

/// Parameters of the three gyros, in units of the design's rows, and their covariances.
struct Solution {
    parameters: [Vector4<f64>; 3],
    covariances: [Matrix4<f64>; 3],
    chi_square: f64,
    squares: f64,
    closures: u32,
    instability_deg_h: f64,
}

impl<'a> Measured<'a> {
    fn new(positions: &'a [Position], knowledge: &'a Knowledge) -> Result<Self, Refusal> {
        earth_rate(knowledge.latitude_deg).map_err(Refusal::Latitude)?;
        let mut chi_squares = [0.0; 3];
        let mut freedom = 0;
        for position in positions {
            for (sum, wander) in chi_squares.iter_mut().zip(position.dwell.wander) {
                *sum += wander;
            }
            freedom += WANDER_FREEDOM;
        }
        let wander = chi_squares.map(|chi_square| {
            if chi_square_p(chi_square, freedom) < LEAST_WANDER_P { chi_square / f64::from(freedom) } else { 1.0 }
        });
        let measured = Self { positions, knowledge, wander, exchanged: None };
        let flat = (0..3).find_map(|gyro| {
            let mut observations = measured.observations(gyro, knowledge.latitude_deg);
            observations.position(|observation| observation.variance.is_nan() || observation.variance <= 0.0)
        });
        match flat {
            Some(position) => Err(Refusal::NoScatter { position }),
            None => Ok(measured),
        }
    }

    /// What gyro number `gyro` measured, with the inputs of a latitude; nothing at a latitude that is none.
    fn observations(&self, gyro: usize, latitude_deg: f64) -> impl Iterator<Item = Observation> + '_ {
        let earth = earth_rate(latitude_deg).ok();
        // Uniform in ± t: variance t²/3.
        let table = self.knowledge.table_arcsec / ARCSEC_PER_RAD;
        let table_variance = table * table / 3.0;
        let instability = self.knowledge.bias_instability_deg_h;
        let wander = part(&self.wander, gyro);
        self.positions.iter().enumerate().filter_map(move |(number, position)| {
            let input = self.axes_of(number)?.input_deg_h(&earth?);
            let [x, y, z] = input.map(|rate| rate / EARTH_RATE_DEG_H);
            let along = part(&input, gyro);
            let across = input.iter().map(|rate| rate * rate).sum::<f64>() - along * along;
            Some(Observation {
                row: Vector4::new(1.0, x, y, z),
                rate_deg_h: part(&position.dwell.rate_deg_h, gyro),
                variance: part(&position.dwell.variance, gyro) * wander
                    + instability * instability
                    + table_variance * across,
            })
        })
    }

    /// The axes of a position, or those of the one that it is exchanged with.
    fn axes_of(&self, number: usize) -> Option<Axes> {
        let number = match self.exchanged {
            Some((one, other)) if number == one => other,
            Some((one, other)) if number == other => one,
            _ => number,
        };
        self.positions.get(number).map(|position| position.axes)
    }

    /// The two positions whose exchange explains the readings best, where their closure is not noise: all then agree, with each other and with the
    /// latitude, and each gyro follows its axis.
    fn find_exchange(&self, solution: &Solution) -> Option<(usize, usize)> {
        solution.closure().p_value.filter(|p_value| *p_value < LEAST_CLOSURE_P)?;
        let count = self.positions.len();
        let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| (one, other)));
        let explained = pairs.filter_map(|pair| {
            let measured = Measured { exchanged: Some(pair), ..*self };
            measured.refuse_undetermined(None).ok()?;
            let solution = measured.solve(None)?;
            measured.refuse_latitude(&solution).ok()?;
            solution.refuse_exchanged().ok()?;
            let p_value = solution.closure().p_value.filter(|p_value| *p_value >= LEAST_CLOSURE_P)?;
            Some((p_value, pair))
        });
        explained.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pair)| pair)
    }

    /// A direction of the parameter space that no measurement shows is an eigenvector of the design with the value 0.
    fn refuse_undetermined(&self, without: Option<usize>) -> Result<(), Refusal> {
        let mut design = Matrix4::zeros();
        for observation in skip(self.observations(0, self.knowledge.latitude_deg), without) {
            design += observation.row * observation.row.transpose();
        }
        let count = self.positions.len().max(1) as f64;
        let eigen = SymmetricEigen::try_new(design / count, f64::EPSILON, 200).ok_or(Refusal::Undetermined(ALL))?;
        let mut missing = [false; 4];
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if value.is_nan() || *value < LEAST_SHARE {
                for (missing, part) in missing.iter_mut().zip(vector.iter()) {
                    *missing |= part.abs() > 0.05;
                }
            }
        }
        let [bias, x, y, z] = missing;
        if missing.contains(&true) {
            return Err(Refusal::Undetermined(Undetermined { bias, about: [x, y, z] }));
        }
        Ok(())
    }

    fn solve(&self, without: Option<usize>) -> Option<Solution> {
        self.solve_at(self.knowledge.latitude_deg, without)
    }

    /// The least-squares solution with another latitude, or without one position.
    fn solve_at(&self, latitude_deg: f64, without: Option<usize>) -> Option<Solution> {
        let mut solution = Solution {
            parameters: [Vector4::zeros(); 3],
            covariances: [Matrix4::zeros(); 3],
            chi_square: 0.0,
            squares: 0.0,
            closures: 0,
            instability_deg_h: self.knowledge.bias_instability_deg_h,
        };
        for (gyro, (parameters, covariance)) in
            solution.parameters.iter_mut().zip(&mut solution.covariances).enumerate()
        {
            let observations = || skip(self.observations(gyro, latitude_deg), without);
            let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
            for Observation { row, rate_deg_h, variance } in observations() {
                normal += row * row.transpose() / variance;
                right += row * (rate_deg_h / variance);
            }
            *covariance = normal.cholesky()?.inverse();
            *parameters = *covariance * right;
            for Observation { row, rate_deg_h, variance } in observations() {
                let residual = rate_deg_h - row.dot(parameters);
                solution.squares += residual * residual;
                solution.chi_square += residual * residual / variance;
            }
            solution.closures += (observations().count() as u32).saturating_sub(4);
        }
        Some(solution)
    }

    fn refuse_closure(&self, solution: &Solution, exchanged: Option<(usize, usize)>) -> Result<(), Refusal> {
        let Closure { rms_deg_h: Some(rms_deg_h), p_value: Some(p_value), .. } = solution.closure() else {
            return Ok(());
        };
        if p_value >= LEAST_CLOSURE_P {
            return Ok(());
        }
        let consistent = |without: &usize| {
            self.refuse_undetermined(Some(*without)).is_ok()
                && self
                    .solve(Some(*without))
                    .and_then(|others| others.closure().p_value)
                    .is_some_and(|p_value| p_value >= LEAST_CLOSURE_P)
        };
        let suspects = (0..self.positions.len().min(64)).filter(consistent).fold(0, |bits, k| bits | 1 << k);
        Err(Refusal::Closure { rms_deg_h, p_value, suspects, exchanged })
    }
}

fn skip(observations: impl Iterator<Item = Observation>, without: Option<usize>) -> impl Iterator<Item = Observation> {
    observations.enumerate().filter(move |(i, _)| Some(*i) != without).map(|(_, observation)| observation)
}

/// The part of a vector along an axis; 0 for an axis that is none.
fn part(vector: &[f64; 3], axis: usize) -> f64 {
    vector.get(axis).copied().unwrap_or(0.0)
}

impl Solution {
    fn closure(&self) -> Closure {
        let count = self.closures;
        let some = |value: f64| (count > 0).then_some(value);
        Closure {
            count,
            rms_deg_h: some(libm::sqrt(self.squares / f64::from(count.max(1)))),
            p_value: some(chi_square_p(self.chi_square, count)),
        }
    }

    fn calibration(&self) -> Calibration {
        let split = |parameters: &Vector4<f64>| {
            let &[bias, x, y, z] = parameters.as_ref();
            (bias, [x, y, z].map(|response| response / EARTH_RATE_DEG_H))
        };
        let values = [0, 1, 2].map(|gyro| split(&self.parameters.get(gyro).copied().unwrap_or_default()));
        let sigmas = [0, 1, 2].map(|gyro| {
            let covariance = self.covariances.get(gyro).copied().unwrap_or_default();
            split(&covariance.diagonal().map(libm::sqrt))
        });
        Calibration {
            bias_deg_h: values.map(|(bias, _)| bias),
            matrix: values.map(|(_, responses)| responses),
            sigma_bias_deg_h: sigmas.map(|(bias, _)| libm::hypot(bias, self.instability_deg_h)),
            sigma_matrix: sigmas.map(|(_, responses)| responses),
            closure: self.closure(),
        }
    }

    fn refuse_noise(&self) -> Result<(), Refusal> {
        match find(&self.calibration().sigma_matrix, |_, sigma| sigma.is_nan() || sigma > MOST_SIGMA) {
            Some((gyro, about, sigma)) => Err(Refusal::TooNoisy { gyro, about, sigma }),
            None => Ok(()),
        }
    }

    fn refuse_exchanged(&self) -> Result<(), Refusal> {
        let deviates = |diagonal: bool, element: f64| {
            let unit = if diagonal { 1.0 } else { 0.0 };
            (element - unit).abs() > MOST_DEVIATION
        };
        match find(&self.calibration().matrix, deviates) {
            Some((gyro, about, element)) => Err(Refusal::NotItsAxis { gyro, about, element }),
            None => Ok(()),
        }
    }
}

/// The first element that is `wanted`, by whether it is on the diagonal and its value.
fn find(matrix: &[[f64; 3]; 3], wanted: impl Fn(bool, f64) -> bool) -> Option<(usize, usize, f64)> {
    matrix.iter().enumerate().find_map(|(gyro, row)| {
        let mut elements = row.iter().enumerate();
        elements
            .find(|(about, element)| wanted(gyro == *about, **element))
            .map(|(about, element)| (gyro, about, *element))
    })
}

#[cfg(test)]
mod tests;
