//! What is not certain of the error model, in a fix: errors of the dwells' mean rates that go together.
//!
//! The mean rates have the covariance C = white noise + P + D Dᵀ: P that of the model's process of the run's own (mean over
//! each dwell against mean over each other), D the columns of what one sigma along each uncertain direction of the model's
//! coefficients adds to each dwell. The fix is generalised least squares with C: by its Cholesky factor L, rows and rates
//! become L⁻¹ times themselves, and have independent errors of one. Slopes inside the dwells say nothing then: the process
//! makes slopes of its own.
//!
//! A fix of more intervals than there is room for (a continuous rotation) is weighed as without doubt, and its covariance
//! is that of these weights, with intervals taken together in groups.

use nalgebra::{Matrix4, Vector4};

use super::dwell::DwellSummary;
use super::room::Room;
use super::{FEW, Observation, Problem};
use crate::effects::Doubt;
use crate::effects::doubt::MAX_DIRECTIONS;
use crate::slices::pause;

/// Most dwells whose covariance is kept.
const MOST: usize = 24;
/// Entries of its factor's lower triangle.
const ENTRIES: usize = MOST * (MOST + 1) / 2;
/// In the room: rows of L, one after the other; columns of C⁻¹ times the rows of the equations, which is what the error of a dwell
/// adds to the right-hand side; whitened observations, row and rate.
const GAINS: usize = ENTRIES;
const GAIN: usize = 4;
const WHITENED: usize = GAINS + MOST * GAIN;
const OBSERVATION: usize = 5;
/// In the room, where there is no such covariance: intervals that are taken together, from when to when, and the sum of their gains.
const GROUP: usize = 6;
/// Numbers that a solution needs room for.
pub const ROOM: usize = WHITENED + MOST * OBSERVATION;
const _: () = assert!(MOST * GROUP <= ROOM);

/// The dwells' covariance, in units of the variance of a one-second rate, by its factor.
#[derive(Clone, Copy)]
pub struct Correlated<'a> {
    room: Room<'a>,
    dwells: usize,
}

impl<'a> Correlated<'a> {
    /// Of these dwells. `None` where nothing is uncertain, or where there are too many dwells. `variance`: of a one-second rate, (°/h)².
    pub(super) async fn new(doubt: &Doubt, problem: &Problem<'a>, variance: f64) -> Option<Self> {
        let dwells = problem.dwells;
        if !is_any(doubt) || dwells.len() > MOST {
            return None;
        }
        let correlated = Self { room: problem.room, dwells: dwells.len() };
        for (i, dwell) in dwells.iter().enumerate() {
            let mut squares = 0.0;
            for (j, other) in dwells.iter().take(i).enumerate() {
                let product: f64 = (0..j).map(|k| correlated.at(i, k) * correlated.at(j, k)).sum();
                pause().await;
                let entry = (shared(doubt, dwell, other) / variance - product) / correlated.at(j, j);
                squares += entry * entry;
                correlated.room.set(place(i, j), entry)?;
                pause().await;
            }
            let observation = problem.mean(dwell).await;
            pause().await;
            let pivot = 1.0 / observation.weight + shared(doubt, dwell, dwell) / variance - squares;
            if !(pivot > 0.0 && pivot.is_finite()) {
                return None;
            }
            correlated.room.set(place(i, i), libm::sqrt(pivot))?;
            let whitened = correlated.whitened(i, observation.row, |k| correlated.gain(k)).await;
            correlated.set_gain(i, whitened)?;
        }
        for i in (0..correlated.dwells).rev() {
            let mut later = Vector4::zeros();
            for j in i + 1..correlated.dwells {
                later += correlated.gain(j) * correlated.at(j, i);
                if j % FEW == 0 {
                    pause().await;
                }
            }
            correlated.set_gain(i, (correlated.gain(i) - later) / correlated.at(i, i))?;
            pause().await;
        }
        Some(correlated)
    }

    /// L's entry.
    fn at(&self, row: usize, column: usize) -> f64 {
        self.room.get(place(row, column))
    }

    /// L⁻¹ times the rows, the `i`-th of it, with those before it.
    async fn whitened(&self, i: usize, row: Vector4<f64>, before: impl Fn(usize) -> Vector4<f64>) -> Vector4<f64> {
        let mut known = Vector4::zeros();
        for k in 0..i {
            known += before(k) * self.at(i, k);
            if k % FEW == FEW - 1 {
                pause().await;
            }
        }
        (row - known) / self.at(i, i)
    }

    /// Gives `take` the observations with errors that are independent, of weight 1.
    pub(super) async fn for_each(&self, problem: &Problem<'_>, take: &mut dyn FnMut(Observation)) {
        for (i, dwell) in problem.dwells.iter().enumerate() {
            let observation = problem.mean(dwell).await;
            let before = |k: usize| {
                let [x, y, z, w, rate_deg_h] = self.room.get_some(WHITENED + k * OBSERVATION);
                (Vector4::new(x, y, z, w), rate_deg_h)
            };
            let row = self.whitened(i, observation.row, |k| before(k).0).await;
            pause().await;
            let known: f64 = (0..i).map(|k| self.at(i, k) * before(k).1).sum();
            let rate_deg_h = (observation.rate_deg_h - known) / self.at(i, i);
            // There are no more dwells than places.
            let _ = self.room.set_some(WHITENED + i * OBSERVATION, [row.x, row.y, row.z, row.w, rate_deg_h]);
            take(Observation { weight: 1.0, row, rate_deg_h, ..observation });
            pause().await;
        }
    }

    /// What an error of the `i`-th dwell's rate adds to the right-hand side of the normal equations.
    pub fn gain(&self, i: usize) -> Vector4<f64> {
        self.room.get_some(GAINS + i * GAIN).into()
    }

    fn set_gain(&self, i: usize, gain: Vector4<f64>) -> Option<()> {
        self.room.set_some(GAINS + i * GAIN, gain.into())
    }
}

/// Place of an entry of L, below the diagonal or on it.
fn place(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Whether rates are uncertain by the model.
pub fn is_any(doubt: &Doubt) -> bool {
    doubt.process.is_some() || !doubt.directions.is_empty()
}

/// Covariance of the errors of two dwells, (°/h)².
fn shared(doubt: &Doubt, a: &DwellSummary, b: &DwellSummary) -> f64 {
    let of_process = of_process(doubt, [a.start_s, a.end_s], [b.start_s, b.end_s]);
    let of_directions: f64 = a.doubt_deg_h.iter().zip(b.doubt_deg_h).map(|(a, b)| f64::from(*a) * f64::from(b)).sum();
    of_process + of_directions
}

/// Covariance of the process' means over two intervals, (°/h)².
fn of_process(doubt: &Doubt, a_s: [f64; 2], b_s: [f64; 2]) -> f64 {
    doubt.process.map_or(0.0, |process| process.covariance(a_s, b_s))
}

/// Covariance of the right-hand side by the doubt, where the fix is weighed without it. In a group the process is its mean
/// and deviations from it, which are alike but for adding up to nothing.
pub(super) async fn of_right_hand_side(doubt: &Doubt, problem: &Problem<'_>) -> Matrix4<f64> {
    let mut of_directions = [Vector4::zeros(); MAX_DIRECTIONS];
    let size = problem.dwells.len().div_ceil(MOST).max(1);
    let mut covariance = Matrix4::zeros();
    let mut groups = 0;
    for few in problem.dwells.chunks(size) {
        let start_s = few.first().map_or(0.0, |dwell| dwell.start_s);
        let end_s = few.last().map_or(0.0, |dwell| dwell.end_s);
        // Sums of the gains, of these times themselves, and of the variances of the process' means over each interval.
        let (mut group, mut squares, mut variances) = (Vector4::zeros(), Matrix4::zeros(), 0.0);
        for dwell in few {
            let observation = problem.mean(dwell).await;
            pause().await;
            let gain = observation.weight * observation.row;
            for (sum, doubt_deg_h) in of_directions.iter_mut().zip(dwell.doubt_deg_h) {
                *sum += gain * f64::from(doubt_deg_h);
            }
            pause().await;
            group += gain;
            squares += gain * gain.transpose();
            pause().await;
            variances += of_process(doubt, [dwell.start_s, dwell.end_s], [dwell.start_s, dwell.end_s]);
        }
        let intervals = few.len() as f64;
        if intervals > 1.0 {
            let shared = of_process(doubt, [start_s, end_s], [start_s, end_s]);
            let deviations = (variances / intervals - shared).max(0.0) * intervals / (intervals - 1.0);
            pause().await;
            covariance += deviations * (squares - group * group.transpose() / intervals);
        }
        // There are no more of them than places.
        let [x, y, z, w] = group.into();
        let _ = problem.room.set_some(GROUP * groups, [start_s, end_s, x, y, z, w]);
        groups += 1;
        pause().await;
    }
    for sum in of_directions {
        covariance += sum * sum.transpose();
        pause().await;
    }
    let groups = if doubt.process.is_some() { groups } else { 0 };
    let group = |number: usize| {
        let [start_s, end_s, x, y, z, w] = problem.room.get_some(GROUP * number);
        ([start_s, end_s], Vector4::new(x, y, z, w))
    };
    for (a_s, a) in (0..groups).map(group) {
        for (b_s, b) in (0..groups).map(group) {
            let shared = of_process(doubt, a_s, b_s);
            pause().await;
            covariance += shared * a * b.transpose();
            pause().await;
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use crate::effects::ErrorModel;
    use crate::effects::doubt::{Kernel, Process};
    use crate::fix::Fix;
    use crate::fix::dwell::DwellSummary;
    use crate::fix::tests::{declared, dwell, normal, solve};
    use crate::units::{DEG_PER_RAD, wrap_180_deg};

    /// Ω cos 60°, °/h.
    const NORTH_DEG_H: f64 = 7.5205335;

    fn rate_deg_h(index_deg: f64) -> f64 {
        NORTH_DEG_H * libm::cos((90.0 - index_deg).to_radians())
    }

    /// Four positions, or the same and back, at azimuth 90°.
    fn dwells(order: &[f64]) -> Vec<DwellSummary> {
        (0..).zip(order).map(|(i, &index_deg)| dwell(65.0 * f64::from(i), index_deg, rate_deg_h(index_deg))).collect()
    }

    const ORDER: [f64; 4] = [0.0, 90.0, 180.0, 270.0];

    fn fix(dwells: &[DwellSummary], model: &ErrorModel) -> Fix {
        solve(dwells, &declared(60.0), model).unwrap()
    }

    fn process(sigma_deg_h: f64, time_s: f64) -> ErrorModel {
        let mut model = ErrorModel::default();
        model.doubt.process = Some(Process { kernel: Kernel::Exponential, sigma_deg_h, time_s });
        model
    }

    /// What the model adds to a sigma, degrees.
    fn added_deg(with: &Fix, without: &Fix) -> f64 {
        libm::sqrt(with.sigma_deg * with.sigma_deg - without.sigma_deg * without.sigma_deg)
    }

    #[test]
    fn misses_beyond_sigma_are_added() {
        let mut model = ErrorModel::default();
        model.doubt.azimuth_sigma_deg = 0.3;
        let dwells = dwells(&ORDER);
        assert!((added_deg(&fix(&dwells, &model), &fix(&dwells, &ErrorModel::default())) - 0.3).abs() < 1e-9);
    }

    /// A direction that adds 0.05 °/h at 0° and takes as much away at 180°: h cos ψ is uncertain by 0.05 °/h, and at ψ = 90°
    /// the azimuth by 0.05/7.5205 rad = 0.38092°. As a bias of 0.05 °/h everywhere it is nothing to the azimuth.
    #[test]
    fn an_uncertain_direction_of_the_coefficients() {
        let mut model = ErrorModel::default();
        model.doubt.directions.push(heapless::Vec::new()).unwrap();
        let mut dwells = dwells(&ORDER);
        let without = fix(&dwells, &ErrorModel::default());
        dwells[0].doubt_deg_h[0] = 0.05;
        dwells[2].doubt_deg_h[0] = -0.05;
        let with = fix(&dwells, &model);
        assert!((added_deg(&with, &without) - 0.38092).abs() < 2e-3, "{}", added_deg(&with, &without));
        assert!(wrap_180_deg(with.azimuth_deg - 90.0).abs() < 1e-4);
        dwells.iter_mut().for_each(|dwell| dwell.doubt_deg_h[0] = 0.05);
        assert!((fix(&dwells, &model).sigma_deg - without.sigma_deg).abs() < 1e-3 * without.sigma_deg);
    }

    /// A process that changes within half a second is white noise: a mean over 60 s has a variance of 2σ² (x − x²) with x =
    /// 0.5/60, 0.016528 σ². At ψ = 90° the azimuth is (ω0 − ω180)/2h: half of that variance over h². One that lasts a hundred
    /// times as long as the fix is a bias and next to nothing.
    #[test]
    fn a_quick_process_is_noise_and_a_lasting_one_a_bias() {
        let dwells = dwells(&ORDER);
        let without = fix(&dwells, &ErrorModel::default());
        let quick = added_deg(&fix(&dwells, &process(1.0, 0.5)), &without);
        let expected_deg = libm::sqrt(0.016528 / 2.0) / NORTH_DEG_H * DEG_PER_RAD;
        assert!((quick / expected_deg - 1.0).abs() < 0.02, "{quick} {expected_deg}");
        let lasting = added_deg(&fix(&dwells, &process(0.1, 26_000.0)), &without);
        // Over half a fix it changes by 0.1 · √(2 · 130/26000) = 0.01 °/h, a tenth of σ.
        assert!(lasting < 0.1 * 0.1 / NORTH_DEG_H * DEG_PER_RAD, "{lasting}");
    }

    /// The same quick process over more intervals than are weighed one by one, two of them in each group.
    #[test]
    fn many_intervals_are_taken_in_groups() {
        let order: Vec<f64> = (0..48).map(|i| 90.0 * f64::from(i % 4)).collect();
        let dwells = dwells(&order);
        let added = added_deg(&fix(&dwells, &process(1.0, 0.5)), &fix(&dwells, &ErrorModel::default()));
        let expected_deg = libm::sqrt(0.016528 / 2.0 / 12.0) / NORTH_DEG_H * DEG_PER_RAD;
        assert!((added / expected_deg - 1.0).abs() < 0.05, "{added} {expected_deg}");
    }

    /// A process of 0.1 °/h and 100 s in the mirrored order. Its means over 65 s are those of an autoregressive sequence of
    /// small steps. The mean square of 300 errors in sigmas has a standard deviation of √(2/300) = 0.08: four of them, and
    /// half as much for the gaps between the dwells. The weights make no more of the error than equal ones, but for chance.
    #[test]
    fn sigma_covers_a_process_of_the_run() {
        let order = [0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0];
        let (mut state, mut ratio, mut weighed, mut plain) = (3, 0.0, 0.0, 0.0);
        let step = libm::exp(-5.0 / 100.0);
        for _ in 0..300 {
            let mut u = 0.1 * normal(&mut state);
            let mut next = || {
                let before = u;
                u = step * u + 0.1 * libm::sqrt(1.0 - step * step) * normal(&mut state);
                0.5 * (before + u)
            };
            let mut dwells = dwells(&order);
            for dwell in &mut dwells {
                dwell.rate.mean += (0..12).map(|_| next()).sum::<f64>() / 12.0;
                next();
            }
            let miss = |fix: &Fix| wrap_180_deg(fix.azimuth_deg - 90.0);
            let with = fix(&dwells, &process(0.1, 100.0));
            ratio += miss(&with) * miss(&with) / (with.sigma_deg * with.sigma_deg) / 300.0;
            weighed += miss(&with) * miss(&with);
            plain += miss(&fix(&dwells, &ErrorModel::default())).powi(2);
        }
        std::println!("{ratio:.3}, {:.4}° against {:.4}°", libm::sqrt(weighed / 300.0), libm::sqrt(plain / 300.0));
        // The scatter of the made-up dwells is declared and not made: their share of the sigma is not in the errors.
        assert!((0.4..1.0 + 4.0 * 0.08 + 0.15).contains(&ratio), "{ratio}");
        assert!(weighed < 1.05 * plain, "{weighed} {plain}");
    }
}
