//! From attitudes to a calibration, and whether it is better than the one in use.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::refusal::{NoCalibration, Why};
use crate::accelerometer::AccelerometerCalibration;
use crate::ellipsoid::{Calibration, Correction, Entry, Role, Weights, fit_from_sphere, norm_rms, split};

/// Most attitudes; about the 23 of the source.
pub const MOST_ATTITUDES: usize = 24;
/// Gravity in the unit of the readings: the local one.
pub(super) const GRAVITY_G: f64 = 1.0;
/// Evidence at which a calibration counts as better, in standard deviations: see [`Solved::evidence`].
const BETTER_SIGMAS: f64 = 3.0;

/// Attitudes to be solved for.
#[derive(Clone, Debug, Default)]
pub struct Problem {
    /// The calibration in use.
    pub in_use: Correction,
    pub entries: Vec<Entry, MOST_ATTITUDES>,
}

/// A calibration that was solved on board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Solved {
    /// Attitudes learned from, only judged, and left out because they contradict the others.
    pub attitudes: u8,
    pub judged: u8,
    pub left_out: u8,
    /// Coverage of the sphere by those learned from, 0 … 1.
    pub coverage: f64,
    /// Root mean square of |f| − 1 g over the attitudes learned from, g: by the calibration in use, and by this one.
    pub before_g: f64,
    pub after_g: f64,
    /// The same over the attitudes only judged.
    pub judged_before_g: f64,
    pub judged_after_g: f64,
    /// How much better it is on the attitudes only judged, in standard deviations of what noise can make of that.
    ///
    /// With the errors of the norm before, bᵢ, and after, aᵢ, and the noise eᵢ of an attitude's mean, which is the same in both,
    /// what is seen is D = Σ (bᵢ + eᵢ)² − Σ (aᵢ + eᵢ)² = Σ (bᵢ² − aᵢ²) + 2 Σ (bᵢ − aᵢ) eᵢ. The second sum is Gaussian with the
    /// standard deviation s = 2 √(Σ (bᵢ − aᵢ)² σᵢ²), and bᵢ − aᵢ is the difference of the two norms seen, in which the noise
    /// cancels to first order. So a calibration that is in truth no better gives D / s > 3 with a probability of 0.135 % at most:
    /// whatever it is, and although the attitudes are few.
    pub evidence: f64,
    pub calibration: AccelerometerCalibration,
}

impl Solved {
    /// Whether it is better than the calibration in use, by the attitudes that it did not learn from.
    pub fn is_better(&self) -> bool {
        self.evidence > BETTER_SIGMAS
    }
}

impl Problem {
    /// Fits the ellipsoid with a quarter of the attitudes held out, and judges it by those.
    pub fn solve(&mut self) -> Result<Solved, NoCalibration> {
        split(&mut self.entries, GRAVITY_G);
        let found = fit_from_sphere(&mut self.entries, GRAVITY_G)?;
        let calibration = AccelerometerCalibration::new(&found.correction);
        calibration.validate().map_err(|_| Why::Implausible)?;
        let rms = |role, correction| {
            let means = self.with(role).map(|entry| entry.attitude.mean);
            norm_rms(means, correction, GRAVITY_G).ok_or(Why::TooFew)
        };
        let count = |role| u8::try_from(self.with(role).count()).unwrap_or(u8::MAX);
        Ok(Solved {
            attitudes: count(Role::Fit),
            judged: count(Role::Check),
            left_out: count(Role::Invalid),
            coverage: found.coverage,
            before_g: rms(Role::Fit, &self.in_use)?,
            after_g: rms(Role::Fit, &found.correction)?,
            judged_before_g: rms(Role::Check, &self.in_use)?,
            judged_after_g: rms(Role::Check, &found.correction)?,
            evidence: self.evidence(&found),
            calibration,
        })
    }

    fn with(&self, role: Role) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(move |entry| entry.role == role)
    }

    /// See [`Solved::evidence`]. The noise of an attitude is that of its readings and, where the fit found more, that too.
    fn evidence(&self, found: &Calibration) -> f64 {
        let excess = match found.weights {
            Weights::Noise => 0.0,
            Weights::Excess(rms) => rms,
        };
        let (mut gain, mut variance) = (0.0, 0.0);
        for Entry { attitude, .. } in self.with(Role::Check) {
            let before = self.in_use.norm(attitude.mean) - GRAVITY_G;
            let after = found.correction.norm(attitude.mean) - GRAVITY_G;
            let spread = attitude.spread();
            let noise = spread * spread / f64::from(attitude.readings.max(1)) + excess * excess;
            gain += before * before - after * after;
            variance += 4.0 * (before - after) * (before - after) * noise;
        }
        gain / libm::sqrt(variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ellipsoid::attitude::Attitude;
    use crate::ellipsoid::coverage::Direction;

    /// Normal enough: twelve uniform numbers.
    fn normal(state: &mut u64) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (*state >> 32) as f64 / f64::from(u32::MAX);
        }
        sum
    }

    /// Twenty attitudes of a triad with these zeros (g), read with noise of 0.1 mg.
    fn problem(zero: [f64; 3], in_use: Correction, seed: u64) -> Problem {
        let mut state = seed;
        let mut entries = Vec::new();
        for direction in Direction::all().step_by(5).chain(Direction::all().skip(2).step_by(5)).chain(Direction::all())
        {
            let mut readings = [direction.unit(); 10];
            for (part, zero) in readings.iter_mut().flat_map(|reading| reading.iter_mut().zip(zero)) {
                *part += zero + 1e-4 * normal(&mut state);
            }
            let attitude = Attitude::of(&readings, 0.0, &mut [0.0; 10]).unwrap();
            if entries.len() < 20 {
                entries.push(Entry { attitude, role: Role::Fit }).unwrap();
            }
        }
        Problem { in_use, entries }
    }

    #[test]
    fn an_exact_calibration_is_hardly_ever_replaced() {
        let accepted = (0..2000).filter(|&seed| problem([0.0; 3], Correction::UNIT, seed).solve().unwrap().is_better());
        // 0.135 % at most are 2.7; more than 8 have a probability of 0.2 %.
        assert!(accepted.count() <= 8);
    }

    #[test]
    fn one_that_is_off_by_five_times_the_noise_is_replaced() {
        // 0.5 mg on each axis; the mean of ten readings has a noise of 0.03 mg.
        let accepted = (0..200).filter(|&seed| problem([5e-4; 3], Correction::UNIT, seed).solve().unwrap().is_better());
        assert!(accepted.count() >= 195);
    }

    #[test]
    fn what_was_before_and_after_is_in_g() {
        // A zero of 0.1 g on z, seen by attitudes along −z and +z as norms of 0.9 and 1.1 g.
        let solved = problem([0.0, 0.0, 0.1], Correction::UNIT, 1).solve().unwrap();
        assert!((0.03..0.1).contains(&solved.judged_before_g) && (0.03..0.1).contains(&solved.before_g), "{solved:?}");
        assert!(solved.after_g < 1e-4 && solved.judged_after_g < 2e-4, "{solved:?}");
        assert!((solved.calibration.bias_g[2] - 0.1).abs() < 2e-4);
    }

    #[test]
    fn what_no_triad_has_is_implausible() {
        // Off by 0.6 g: an ellipsoid, but not of this instrument.
        let found = problem([0.6, 0.0, 0.0], Correction::UNIT, 1).solve();
        assert_eq!(found.map_err(|reason| reason.why), Err(Why::Implausible));
    }

    #[test]
    fn too_few_are_refused() {
        let mut few = problem([0.0; 3], Correction::UNIT, 1);
        few.entries.truncate(8);
        assert_eq!(few.solve().map_err(|reason| reason.why), Err(Why::TooFew));
    }
}
