//! The closure: the part of the rates with cos 2θ, which neither azimuth nor bias nor drift makes.
//!
//! It is what a fifth unknown beside those of the fix would be, by its residuals r and weights W (R. Frisch and F. V. Waugh,
//! Econometrica 1, 1933, p. 387): with c the cosines of twice the index angles, X the rows of the fix and N their normal matrix, the
//! part of c that the rows leave unexplained is D = cᵀWc − cᵀWX N⁻¹ XᵀWc, and the closure is cᵀWr/D. For four positions of equal length
//! it is (ω0 + ω180 − ω90 − ω270)/4.

use nalgebra::Vector4;

use super::Declared;
use super::estimate::Estimate;
use super::observation::Observation;
use super::problem::Problem;
use crate::units::RAD_PER_DEG;

/// Least unexplained part of cos 2θ, as a share of all weights, with which the closure is determined: with less its sigma is more than
/// five times that of a rate that is measured all the time, and errors of the index and of the base enter as much enlarged.
const LEAST_SHARE: f64 = 0.04;

/// A closure and its standard deviation, °/h.
pub(super) struct Closure {
    pub deg_h: f64,
    pub sigma_deg_h: f64,
}

impl Closure {
    /// Of an estimate; `variance` is that of a one-second rate, with what makes neighbouring seconds alike. `None` where the angles do not
    /// determine it.
    pub fn new(problem: &Problem<'_>, estimate: &Estimate, variance: f64, declared: &Declared) -> Option<Self> {
        let (mut weights, mut whole, mut of_residuals) = (0.0, 0.0, 0.0);
        let mut with_rows = Vector4::zeros();
        problem.for_each(&mut |observation| {
            let Observation { weight, row, cos_2theta, rate_deg_h } = observation;
            weights += weight * row.z * row.z;
            whole += weight * cos_2theta * cos_2theta;
            with_rows += weight * cos_2theta * row;
            of_residuals += weight * cos_2theta * (rate_deg_h - row.dot(&estimate.parameters));
        });
        let explained = estimate.inverse * with_rows;
        let unexplained = whole - with_rows.dot(&explained);
        if unexplained.partial_cmp(&(LEAST_SHARE * weights)) != Some(core::cmp::Ordering::Greater) {
            return None;
        }
        let instability = declared.gyro.bias_instability_deg_h;
        let mut of_dwells = 0.0;
        for (i, dwell) in problem.dwells.iter().enumerate() {
            let observation = problem.mean(dwell);
            let Observation { row, cos_2theta, .. } = observation;
            let gain = problem.gain(i, &observation).z * (cos_2theta - row.dot(&explained)) / unexplained;
            // What an error of the index makes of the rate: h sin(ψ − θ) by radian.
            let of_index = (estimate.parameters.y * dwell.cos - estimate.parameters.x * dwell.sin)
                * declared.index_sigma_deg
                * RAD_PER_DEG;
            of_dwells += gain * gain * (instability * instability + of_index * of_index);
        }
        Some(Self { deg_h: of_residuals / unexplained, sigma_deg_h: libm::sqrt(variance / unexplained + of_dwells) })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use crate::effects::ErrorModel;
    use crate::fix::dwell::DwellSummary;
    use crate::fix::tests::{declared, dwell, normal};
    use crate::fix::{Fix, solve};

    /// Ω cos 60°, °/h.
    const NORTH_DEG_H: f64 = 7.5205335;

    /// At azimuth 30°, with a second harmonic of `second_deg_h`, dwells of 60 s with white noise of 0.09 °/h in a second.
    fn fix(indices_deg: &[f64], second_deg_h: f64, state: &mut u64) -> Fix {
        let mut rate = |index_deg: f64| {
            NORTH_DEG_H * libm::cos((30.0 - index_deg).to_radians())
                + second_deg_h * libm::cos((2.0 * index_deg).to_radians())
                + 0.09 / libm::sqrt(60.0) * normal(state)
        };
        let dwells: Vec<DwellSummary> =
            (0..).zip(indices_deg).map(|(i, &at_deg)| dwell(65.0 * f64::from(i), at_deg, rate(at_deg))).collect();
        let mut declared = declared(60.0);
        declared.gyro.bias_instability_deg_h = 0.0;
        declared.index_sigma_deg = 0.0;
        solve(&dwells, &declared, &ErrorModel::default()).unwrap()
    }

    /// Four positions of 60 s: a quarter of the sum of four means, √4/4 · 0.09/√60 = 0.00581 °/h.
    #[test]
    fn sigma_by_hand() {
        let found = fix(&[0.0, 90.0, 180.0, 270.0], 0.0, &mut 1);
        assert!((found.closure_sigma_deg_h.unwrap() - 0.00581).abs() < 1e-4, "{found:?}");
    }

    /// Two thousand fixes of each set of angles: the rms of closure over sigma is 1 within 3.5/√(2 · 2000) = 0.055.
    #[test]
    fn closures_scatter_by_their_sigmas() {
        let sets: [&[f64]; 3] = [
            &[0.0, 90.0, 180.0, 270.0],
            &[0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0],
            &[10.0, 100.0, 300.0, 120.0, 300.0],
        ];
        for indices_deg in sets {
            let mut state = 9;
            let squares: f64 = (0..2000)
                .map(|_| fix(indices_deg, 0.0, &mut state))
                .map(|fix| (fix.closure_deg_h.unwrap() / fix.closure_sigma_deg_h.unwrap()).powi(2))
                .sum();
            assert!((libm::sqrt(squares / 2000.0) - 1.0).abs() < 0.055, "{indices_deg:?}: {squares}");
        }
    }

    #[test]
    fn a_second_harmonic_is_the_closure() {
        let found = fix(&[10.0, 100.0, 300.0, 120.0, 300.0], 0.5, &mut 4);
        let error_deg_h = found.closure_deg_h.unwrap() - 0.5;
        assert!(error_deg_h.abs() < 4.0 * found.closure_sigma_deg_h.unwrap(), "{found:?}");
    }

    /// East, west and a third angle 90° from them: three angles, and four unknowns.
    #[test]
    fn three_angles_do_not_determine_it() {
        assert_eq!(fix(&[30.0, 300.0, 120.0, 300.0], 0.0, &mut 2).closure_deg_h, None);
    }
}
