//! What is not certain of the error model, in a fix: errors of the dwells' mean rates that go together.
//!
//! The mean rates have the covariance C = white noise + P + D Dᵀ + M: M what is uncertain of a path of the base that was taken out, P that of the model's
//! process of the run's own (mean over each dwell against mean over each other), D the columns of what one sigma along each uncertain direction of the model's
//! coefficients adds to each dwell. The fix is generalised least squares with C: by its Cholesky factor L, rows and rates
//! become L⁻¹ times themselves, and have independent errors of one. Slopes are left out, because the process makes slopes of its own; the dwells stand
//! here in parts ([`super::accumulator`]), whose means show a slope.
//!
//! A fix of more intervals than there is room for (a continuous rotation) is weighed as without doubt, and its covariance
//! is that of these weights, with intervals taken together in groups; what moves leave behind goes together by rests.

use heapless::Vec;
use nalgebra::{ArrayStorage, Matrix4, SMatrix, Vector4};

use super::base_motion::levels::Path;
use super::dwell::DwellSummary;
use super::observation::Observation;
use crate::effects::Doubt;
use crate::effects::doubt::{Interval, Kernel, MAX_DIRECTIONS};

/// Most dwells whose covariance is kept.
pub const MOST: usize = 24;

/// What is not certain of the model, in a dwell's mean.
pub struct Doubts {
    /// What one sigma along each uncertain direction adds to it, °/h.
    pub directions_deg_h: [f64; MAX_DIRECTIONS],
    /// What 1 °/h of the process adds to it, °/h.
    pub of_process: f64,
}

/// The observation of a dwell's mean, and its doubts.
type Observed = (Observation, Doubts);
/// Gives them.
type Observe<'a> = &'a dyn Fn(&DwellSummary) -> Observed;

/// The dwells' covariance C, in units of the variance of a one-second rate.
pub(super) struct Correlated {
    /// Its Cholesky factor, in the lower triangle; that of the unit matrix for dwells that there are not.
    factor: SMatrix<f64, MOST, MOST>,
    /// C⁻¹ times the rows of the equations: what an error of a dwell adds to the right-hand side of the normal equations.
    gains: SMatrix<f64, MOST, 4>,
}

impl Correlated {
    /// Room for it in `place`; none where nothing is uncertain, or where there are too many dwells.
    ///
    /// It is filled in its place, and begins as a constant: what makes a value of it has copies of the matrix on a board's stack, 4.6 KB each.
    pub fn begin(place: &mut Option<Self>, doubt: &Doubt, path: Option<&Path>, dwells: &[DwellSummary]) {
        const ZEROS: Option<Correlated> = Some(Correlated {
            factor: SMatrix::from_array_storage(ArrayStorage([[0.0; MOST]; MOST])),
            gains: SMatrix::from_array_storage(ArrayStorage([[0.0; MOST]; 4])),
        });
        *place = if (is_any(doubt) || path.is_some()) && dwells.len() <= MOST { ZEROS } else { None };
    }

    /// Of these dwells, by the observations of their means and their doubts. `None`, and it is of no use, where one has no weight. `variance`: of a
    /// one-second rate, (°/h)².
    pub fn fill(
        &mut self,
        doubt: &Doubt,
        path: Option<&Path>,
        dwells: &[DwellSummary],
        observed: &[Observed],
        variance: f64,
    ) -> Option<()> {
        self.factor.fill_with_identity();
        let mut times: Vec<Interval, MOST> = Vec::new();
        for interval in intervals(dwells, doubt) {
            // There are no more of them than places.
            let _ = times.push(interval);
        }
        let all = || dwells.iter().zip(&times).zip(observed);
        for (i, ((dwell, interval), (observation, own))) in all().enumerate() {
            for (j, ((other, of_other), (_, other_own))) in all().enumerate() {
                let of_path = path.map_or(0.0, |path| path.covariance_of(dwell, other));
                let of_directions: f64 =
                    own.directions_deg_h.iter().zip(other_own.directions_deg_h).map(|(a, b)| a * b).sum();
                let of_process = own.of_process * other_own.of_process * of_process(doubt, interval, of_other);
                let shared = of_process + of_directions;
                *self.factor.get_mut((i, j))? = (shared + of_path) / variance;
            }
            *self.factor.get_mut((i, i))? += 1.0 / observation.weight;
            self.gains.row_mut(i).copy_from(&observation.row.transpose());
        }
        if !self.factor.iter().all(|entry| entry.is_finite()) {
            return None;
        }
        factorise(&mut self.factor)?;
        self.factor.solve_lower_triangular_unchecked_mut(&mut self.gains);
        self.factor.ad_solve_lower_triangular_unchecked_mut(&mut self.gains);
        Some(())
    }

    /// Gives `take` the observations with errors that are independent, of weight 1: rows and rates times L⁻¹.
    pub fn for_each(&self, dwells: &[DwellSummary], observe: Observe<'_>, take: &mut dyn FnMut(Observation)) {
        let mut equations = SMatrix::<f64, MOST, 6>::zeros();
        for (dwell, mut equation) in dwells.iter().zip(equations.row_iter_mut()) {
            let (Observation { row, cos_2theta, rate_deg_h, .. }, _) = observe(dwell);
            equation.copy_from_slice(&[row.x, row.y, row.z, row.w, cos_2theta, rate_deg_h]);
        }
        // The factor has no pivot that is nothing.
        let _ = self.factor.solve_lower_triangular_mut(&mut equations);
        for equation in equations.row_iter().take(dwells.len()) {
            if let [x, y, z, w, cos_2theta, rate_deg_h] = *equation.transpose().as_slice() {
                take(Observation { weight: 1.0, row: Vector4::new(x, y, z, w), cos_2theta, rate_deg_h });
            }
        }
    }

    /// Logarithm of the determinant of C.
    pub fn log_determinant(&self) -> f64 {
        self.factor.diagonal().iter().map(|pivot| 2.0 * libm::log(*pivot)).sum()
    }

    /// What an error of the `i`-th dwell's rate adds to the right-hand side of the normal equations; `None` of a dwell that there is not.
    pub fn gain(&self, i: usize) -> Option<Vector4<f64>> {
        (i < MOST).then(|| self.gains.row(i).transpose())
    }
}

/// Puts the Cholesky factor of a symmetric matrix into its lower triangle, where the matrix stands; nothing where it is not positive. Its steps are
/// nalgebra's, to the last digit.
fn factorise(matrix: &mut SMatrix<f64, MOST, MOST>) -> Option<()> {
    for j in 0..MOST {
        for k in 0..j {
            let factor = -*matrix.get((j, k))?;
            for i in j..MOST {
                let taken = factor * matrix.get((i, k))?;
                *matrix.get_mut((i, j))? += taken;
            }
        }
        let pivot = libm::sqrt(*matrix.get((j, j)).filter(|square| **square > 0.0)?);
        *matrix.get_mut((j, j))? = pivot;
        for i in j + 1..MOST {
            *matrix.get_mut((i, j))? /= pivot;
        }
    }
    Some(())
}

/// Whether rates are uncertain by the model.
pub fn is_any(doubt: &Doubt) -> bool {
    doubt.process.is_some() || !doubt.directions.is_empty()
}

/// The dwells' times, and since when there is something in them that decays. The index came to rest when the first of those that follow each other at its
/// position began.
fn intervals<'a>(dwells: &'a [DwellSummary], doubt: &Doubt) -> impl Iterator<Item = Interval> + use<'a> {
    let of_start = doubt.process.is_some_and(|process| process.kernel == Kernel::Start);
    let begun_s = dwells.first().filter(|_| of_start).map(|dwell| dwell.start_s);
    dwells.iter().scan(None, move |last: &mut Option<(&DwellSummary, f64)>, dwell| {
        let rest_s =
            last.filter(|(before, _)| dwell.is_at_position_of(before)).map_or(dwell.start_s, |(_, rest_s)| rest_s);
        *last = Some((dwell, rest_s));
        let DwellSummary { start_s, end_s, moving, .. } = *dwell;
        Some(Interval { start_s, end_s, since_s: begun_s.or((!moving).then_some(rest_s)) })
    })
}

/// Covariance of the process' means over two intervals, (°/h)², where it is in the rate.
fn of_process(doubt: &Doubt, a: &Interval, b: &Interval) -> f64 {
    doubt.process.map_or(0.0, |process| process.covariance(a, b))
}

/// Covariance of the right-hand side by the doubt, where the fix is weighed without it. In a group the process is its mean
/// and deviations from it, which are alike but for adding up to nothing.
pub(super) fn of_right_hand_side(doubt: &Doubt, dwells: &[DwellSummary], observe: Observe<'_>) -> Matrix4<f64> {
    let mut of_directions = [Vector4::zeros(); MAX_DIRECTIONS];
    let size = dwells.len().div_ceil(MOST).max(1);
    let mut covariance = Matrix4::zeros();
    // The time of each group and the sum of its gains.
    let mut groups: Vec<(Interval, Vector4<f64>), MOST> = Vec::new();
    let lasting = |start_s, end_s| Interval { start_s, end_s, since_s: None };
    for few in dwells.chunks(size) {
        let start_s = few.first().map_or(0.0, |dwell| dwell.start_s);
        let whole = lasting(start_s, few.last().map_or(start_s, |dwell| dwell.end_s));
        // Sums of the gains, of these times themselves, and of the variances of the process' means over each interval.
        let (mut group, mut squares, mut variances) = (Vector4::zeros(), Matrix4::zeros(), 0.0);
        for dwell in few {
            let (observation, doubts) = observe(dwell);
            let of_rate = observation.weight * observation.row;
            for (sum, doubt_deg_h) in of_directions.iter_mut().zip(doubts.directions_deg_h) {
                *sum += of_rate * doubt_deg_h;
            }
            let gain = of_rate * doubts.of_process;
            group += gain;
            squares += gain * gain.transpose();
            let own = lasting(dwell.start_s, dwell.end_s);
            variances += of_process(doubt, &own, &own);
        }
        let intervals = few.len() as f64;
        if intervals > 1.0 {
            let shared = of_process(doubt, &whole, &whole);
            let deviations = (variances / intervals - shared).max(0.0) * intervals / (intervals - 1.0);
            covariance += deviations * (squares - group * group.transpose() / intervals);
        }
        // There are no more of them than places.
        let _ = groups.push((whole, group));
    }
    for sum in of_directions {
        covariance += sum * sum.transpose();
    }
    if doubt.process.is_some() {
        for (of_a, a) in &groups {
            for (of_b, b) in &groups {
                covariance += of_process(doubt, of_a, of_b) * a * b.transpose();
            }
        }
    }
    covariance + of_what_decays(doubt, dwells, observe)
}

/// What moves or a start left behind, in such a covariance: since one of them it is one number times what is left of it in each of the dwells.
fn of_what_decays(doubt: &Doubt, dwells: &[DwellSummary], observe: Observe<'_>) -> Matrix4<f64> {
    let mut covariance = Matrix4::zeros();
    let Some(process) = doubt.process.filter(|process| process.kernel.decays()) else { return covariance };
    let (mut last_s, mut left) = (None, Vector4::zeros());
    for (dwell, interval) in dwells.iter().zip(intervals(dwells, doubt)) {
        if last_s != interval.since_s {
            covariance += left * left.transpose();
            (last_s, left) = (interval.since_s, Vector4::zeros());
        }
        let (observation, doubts) = observe(dwell);
        left += process.left_deg_h(&interval) * doubts.of_process * observation.weight * observation.row;
    }
    covariance + left * left.transpose()
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::{MOST, factorise};
    use nalgebra::SMatrix;

    use crate::effects::ErrorModel;
    use crate::effects::doubt::{Kernel, Process};
    use crate::effects::effect::Port;
    use crate::fix::Fix;
    use crate::fix::dwell::DwellSummary;
    use crate::fix::solve;
    use crate::fix::tests::{declared, dwell, normal};
    use crate::units::{DEG_PER_RAD, wrap_180_deg};

    /// Bit for bit, and none where nalgebra finds none.
    #[test]
    fn the_factor_is_that_of_nalgebra() {
        let mut number = 0.3_f64;
        let mut random = || {
            number = (number * 997.0 + 0.1).fract();
            number - 0.5
        };
        for shift in [0.0, 1e-3, 3.0] {
            let half = SMatrix::<f64, MOST, MOST>::from_fn(|_, _| random());
            let matrix = half * half.transpose() + shift * SMatrix::identity();
            let mut factor = matrix;
            factorise(&mut factor).unwrap();
            assert_eq!(factor.lower_triangle(), matrix.cholesky().unwrap().l());
        }
        let mut none = -SMatrix::<f64, MOST, MOST>::identity();
        assert!(none.cholesky().is_none() && factorise(&mut none).is_none());
    }

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
        model.doubt.process = Some(Process { port: Port::Rate, kernel: Kernel::Exponential, sigma_deg_h, time_s });
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
        dwells[0].carried.set_doubt(Port::Rate, 0, 0.05);
        dwells[2].carried.set_doubt(Port::Rate, 0, -0.05);
        let with = fix(&dwells, &model);
        assert!((added_deg(&with, &without) - 0.38092).abs() < 2e-3, "{}", added_deg(&with, &without));
        assert!(wrap_180_deg(with.azimuth_deg - 90.0).abs() < 1e-4);
        dwells.iter_mut().for_each(|dwell| dwell.carried.set_doubt(Port::Rate, 0, 0.05));
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

    /// The same at other ports, where 1 °/h is 1/15.041 of the Earth's rate. At ψ = 90° an index that is wrong by ε at 0° and by ε′ at 180° turns the azimuth by
    /// their mean: 1/15.041 rad times the root of half of 0.016528. An error of the scale factor turns nothing there: at 0° and 180° there is no rate.
    #[test]
    fn a_quick_process_at_other_ports() {
        let dwells = dwells(&ORDER);
        let without = fix(&dwells, &ErrorModel::default());
        let at = |port: Port| {
            let mut model = process(1.0, 0.5);
            model.doubt.process = model.doubt.process.map(|process| Process { port, ..process });
            added_deg(&fix(&dwells, &model), &without)
        };
        let expected_deg = libm::sqrt(0.016528 / 2.0) / 15.041067 * DEG_PER_RAD;
        assert!((at(Port::Index) / expected_deg - 1.0).abs() < 0.02, "{} {expected_deg}", at(Port::Index));
        assert!(at(Port::Scale) < 0.02 * expected_deg, "{}", at(Port::Scale));
    }

    /// What decays.
    fn left(kernel: Kernel, sigma_deg_h: f64, time_s: f64) -> ErrorModel {
        let mut model = process(sigma_deg_h, time_s);
        model.doubt.process = model.doubt.process.map(|process| Process { kernel, ..process });
        model
    }

    /// What moves of 1 °/h leave behind for 6 s is 0.1 °/h in the mean over 60 s, another one in each dwell: 0.1/√2 h at ψ = 90°. Over twelve turns,
    /// more than are weighed one by one, it is a root of twelve less.
    #[test]
    fn what_moves_leave_behind_widens_sigma() {
        for turns in [1, 12] {
            let order: Vec<f64> = ORDER.into_iter().cycle().take(4 * turns).collect();
            let dwells = dwells(&order);
            let added =
                added_deg(&fix(&dwells, &left(Kernel::Transient, 1.0, 6.0)), &fix(&dwells, &ErrorModel::default()));
            let expected_deg = 0.1 / libm::sqrt(2.0 * turns as f64) / NORTH_DEG_H * DEG_PER_RAD;
            assert!((added / expected_deg - 1.0).abs() < 0.02, "{turns}: {added} {expected_deg}");
        }
    }

    /// A bias that is 2 °/h too great when the first rest begins and decays within 3 s: in a first part of 10 s it is 2 · 0.3 (1 − e^(−10/3)) = 0.57860 °/h, in
    /// the 50 s behind it 2 · 0.06 · e^(−10/3) = 0.00428 °/h. As a mean of 60 s that turns the azimuth by 0.1/2h, 0.381°, and by about a third of that
    /// where a drift is solved for beside it; of the later part alone by 0.016°.
    #[test]
    fn what_decays_is_left_out() {
        let mut parts: Vec<DwellSummary> = Vec::new();
        for dwell in dwells(&ORDER) {
            for (from_s, to_s, left_deg_h) in [(0.0, 10.0, 0.57860), (10.0, 60.0, 0.00428)] {
                let mut part = DwellSummary { seconds: to_s - from_s, ..dwell };
                (part.start_s, part.end_s) = (dwell.start_s + from_s, dwell.start_s + to_s);
                part.t_s = 0.5 * (part.start_s + part.end_s);
                part.time_spread = (part.seconds.powi(3) / 12.0) as f32;
                part.degrees_of_freedom = part.seconds as u16 - 2;
                let squares = f64::from(part.degrees_of_freedom) * 0.0081;
                (part.rate.residual_squares, part.rate.successive_squares) = (squares as f32, squares as f32);
                part.rate.mean += if dwell.start_s == 0.0 { left_deg_h } else { 0.0 };
                parts.push(part);
            }
        }
        let off_deg = |model: &ErrorModel| wrap_180_deg(fix(&parts, model).azimuth_deg - 90.0).abs();
        let without = off_deg(&ErrorModel::default());
        for kernel in [Kernel::Transient, Kernel::Start] {
            let with = off_deg(&left(kernel, 2.0, 3.0));
            assert!(without > 0.1 && with < 0.016, "{kernel:?}: {without} {with}");
        }
    }

    /// What a start of 10 °/h leaves for 6 s is 1 °/h in the first mean of 60 s, far above its noise, and nothing in those behind it. At ψ = 90° the rates
    /// are x + b, y + b, b − x and b − y with x = 0: x is half of the first less the third, of half a dwell's variance, and without the first half of the
    /// second and fourth less the third, of 3/2 of it: sigma grows by a dwell's noise. Over twelve turns, more than are weighed one by one, x has the column
    /// 1, 0, −1, 0 …, of a square of 24, and a drift 48 steps about their middle, of a square of 9212, with a product of −24: of the first dwell x takes (1 − 24 · 23.5/9212)/(24 − 24²/9212) = 0.03922.
    #[test]
    fn what_a_start_leaves_behind_widens_sigma() {
        let sigmas = |turns: usize| {
            let order: Vec<f64> = ORDER.into_iter().cycle().take(4 * turns).collect();
            let dwells = dwells(&order);
            (fix(&dwells, &left(Kernel::Start, 10.0, 6.0)), fix(&dwells, &ErrorModel::default()))
        };
        // A second's noise is 0.09 °/h in the made-up dwells.
        let (with, without) = sigmas(1);
        let (added, expected_deg) = (added_deg(&with, &without), 0.09 / libm::sqrt(60.0) / NORTH_DEG_H * DEG_PER_RAD);
        assert!((added / expected_deg - 1.0).abs() < 0.05, "{added} {expected_deg}");
        let (with, without) = sigmas(12);
        let (added, expected_deg) = (added_deg(&with, &without), 0.03922 / NORTH_DEG_H * DEG_PER_RAD);
        assert!((added / expected_deg - 1.0).abs() < 0.02, "{added} {expected_deg}");
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
