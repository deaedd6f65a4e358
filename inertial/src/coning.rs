//! Rotation vector and velocity increment of an interval from the sums that the sensors give ("quasi-coordinates").
//!
//! The sum of angle increments is not the rotation vector where the axis of rotation moves (coning), and the sum of velocity
//! increments is not the change of velocity where the block turns meanwhile (sculling). What is missing is ½ ∫ α × dα and
//! ½ ∫ (α × dv + v × dα), with α and v summed since the interval's start; the second is the polarised form of the first, so
//! that one set of coefficients serves both (Roscoe, 2001). Six sets are to choose from.

use nalgebra::Vector3;

/// How the missing part is estimated. On coning of the small half-angle a at the angular frequency ω the drift that
/// remains, with T the interval, is a²ω(ωT)ⁿ/k.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Algorithm {
    /// Not at all: n = 2, k = 12.
    Sum,
    /// 1/12 θ' × θ with the sum θ' of the interval before: n = 4, k = 60.
    PreviousInterval,
    /// 2/3 α1 × α2: n = 4, k = 960.
    TwoSample,
    /// 33/80 α1 × α3 + 57/80 α2 × (α3 − α1), exact for rates that are cubic in time: n = 4, k = 6480.
    ThreeSampleCubic,
    /// The same with 0.413 and 0.713, as the source prints it: n = 2, later 4.
    ThreeSamplePrinted,
    /// 9/20 α1 × α3 + 27/40 α2 × (α3 − α1), optimal for coning (Miller, 1983): n = 6, k = 204120.
    ThreeSampleConing,
}

impl Algorithm {
    /// All of them, from the coarsest to the finest.
    pub const ALL: [Self; 6] = [
        Self::Sum,
        Self::PreviousInterval,
        Self::TwoSample,
        Self::ThreeSampleCubic,
        Self::ThreeSamplePrinted,
        Self::ThreeSampleConing,
    ];

    /// Its name, in lower case with hyphens.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sum => "none",
            Self::PreviousInterval => "previous-interval",
            Self::TwoSample => "two-sample",
            Self::ThreeSampleCubic => "three-sample-cubic",
            Self::ThreeSamplePrinted => "three-sample-printed",
            Self::ThreeSampleConing => "three-sample-coning",
        }
    }

    /// Samples that make an interval.
    pub fn samples(self) -> usize {
        match self {
            Self::Sum | Self::PreviousInterval => 1,
            Self::TwoSample => 2,
            Self::ThreeSampleCubic | Self::ThreeSamplePrinted | Self::ThreeSampleConing => 3,
        }
    }
}

/// Longest sample of a block that is taken, s: of one row a second, up to half as long again as usual; what is longer is a gap.
pub const LONGEST_SAMPLE_S: f64 = 1.5 + 1e-6;

/// What the block summed up over a sample or an interval, in block axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Integral of the rate against the stars, rad; after integration the rotation vector.
    pub angle_rad: Vector3<f64>,
    /// Integral of specific force, m/s; after integration in the axes of the interval's start.
    pub velocity_m_s: Vector3<f64>,
}

impl Increment {
    /// Sum of both parts.
    fn plus(&self, other: &Self) -> Self {
        Self { angle_rad: self.angle_rad + other.angle_rad, velocity_m_s: self.velocity_m_s + other.velocity_m_s }
    }

    fn minus(&self, other: &Self) -> Self {
        Self { angle_rad: self.angle_rad - other.angle_rad, velocity_m_s: self.velocity_m_s - other.velocity_m_s }
    }

    /// `share` of α × α' for the angle and of α × v' + v × α' for the velocity.
    fn cross(&self, other: &Self, share: f64) -> Self {
        Self {
            angle_rad: self.angle_rad.cross(&other.angle_rad) * share,
            velocity_m_s: (self.angle_rad.cross(&other.velocity_m_s) + self.velocity_m_s.cross(&other.angle_rad))
                * share,
        }
    }
}

/// Gathers samples to intervals.
#[derive(Clone, Debug)]
pub struct Integrator {
    algorithm: Algorithm,
    first: Option<Increment>,
    second: Option<Increment>,
    /// Sums of the interval before.
    previous: Increment,
}

impl Integrator {
    /// At the start of an interval; nothing is known of the one before.
    pub fn new(algorithm: Algorithm) -> Self {
        Self { algorithm, first: None, second: None, previous: Increment::default() }
    }

    /// A sample. Completes an interval: its rotation vector, and its velocity increment in the axes of its start.
    pub fn push(&mut self, sample: Increment) -> Option<Increment> {
        let (sum, missing) = match (self.algorithm, self.first, self.second) {
            (Algorithm::Sum, ..) => (sample, Increment::default()),
            (Algorithm::PreviousInterval, ..) => (sample, self.previous.cross(&sample, 1.0 / 12.0)),
            (_, None, _) => {
                self.first = Some(sample);
                return None;
            }
            (Algorithm::TwoSample, Some(first), _) => (first.plus(&sample), first.cross(&sample, 2.0 / 3.0)),
            (_, Some(_), None) => {
                self.second = Some(sample);
                return None;
            }
            (Algorithm::ThreeSampleCubic, Some(first), Some(second)) => {
                three_samples(&first, &second, &sample, 33.0 / 80.0, 57.0 / 80.0)
            }
            (Algorithm::ThreeSamplePrinted, Some(first), Some(second)) => {
                three_samples(&first, &second, &sample, 0.413, 0.713)
            }
            (Algorithm::ThreeSampleConing, Some(first), Some(second)) => {
                three_samples(&first, &second, &sample, 9.0 / 20.0, 27.0 / 40.0)
            }
        };
        (self.first, self.second, self.previous) = (None, None, sum);
        Some(Increment {
            angle_rad: sum.angle_rad + missing.angle_rad,
            velocity_m_s: turned_while_moving(&sum) + missing.velocity_m_s,
        })
    }
}

/// Sum of three samples, and the missing part with these coefficients.
fn three_samples(
    first: &Increment,
    second: &Increment,
    third: &Increment,
    outer: f64,
    inner: f64,
) -> (Increment, Increment) {
    let sum = first.plus(second).plus(third);
    (sum, first.cross(third, outer).plus(&second.cross(&third.minus(first), inner)))
}

/// Velocity increment in the axes of the interval's start where rate and specific force are constant over it (Savage,
/// 1998): V + (1 − cos θ)/θ² θ × V + (1 − sin θ / θ)/θ² θ × (θ × V).
fn turned_while_moving(sum: &Increment) -> Vector3<f64> {
    let theta = &sum.angle_rad;
    let squared = theta.norm_squared();
    let (first, second) = if squared < 0.04 {
        let first = 0.5 - squared / 24.0 * (1.0 - squared / 30.0 * (1.0 - squared / 56.0 * (1.0 - squared / 90.0)));
        let second =
            1.0 / 6.0 - squared / 120.0 * (1.0 - squared / 42.0 * (1.0 - squared / 72.0 * (1.0 - squared / 110.0)));
        (first, second)
    } else {
        let angle = libm::sqrt(squared);
        ((1.0 - libm::cos(angle)) / squared, (1.0 - libm::sin(angle) / angle) / squared)
    };
    let across = theta.cross(&sum.velocity_m_s);
    sum.velocity_m_s + across * first + theta.cross(&across) * second
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quaternion;
    use quantities::units::{DEG_PER_RAD, RAD_PER_DEG};

    const TWO_PI: f64 = 2.0 * core::f64::consts::PI;

    /// Drift about the cone's axis, °/h, of full quaternions on coning of 1° half-angle, updated every 10 ms.
    ///
    /// The block turns by the half-angle a about an axis that circulates in its x-y plane: q(t) = (cos a/2, sin a/2 (cos ωt,
    /// sin ωt, 0)). Its rate is (−ω sin a sin ωt, ω sin a cos ωt, −2ω sin² a/2), whose integral is known.
    fn drift_deg_h(algorithm: Algorithm, frequency_hz: f64) -> f64 {
        let (half_rad, omega) = (RAD_PER_DEG, TWO_PI * frequency_hz);
        let interval_s = 0.01 / algorithm.samples() as f64;
        let (sine, z_rate) = (libm::sin(half_rad), -2.0 * omega * libm::sin(0.5 * half_rad).powi(2));
        let sum_to = |t_s: f64| {
            let phase = omega * t_s;
            Vector3::new(sine * libm::cos(phase), sine * libm::sin(phase), z_rate * t_s)
        };
        let attitude = |t_s: f64| {
            let phase = omega * t_s;
            Quaternion::from_rotation_vector(&(Vector3::new(libm::cos(phase), libm::sin(phase), 0.0) * half_rad))
        };
        let mut integrator = Integrator::new(algorithm);
        // The sample before the start is known, or the first interval would weigh on the short test.
        integrator.previous.angle_rad = sum_to(0.0) - sum_to(-interval_s);
        let (mut orientation, samples) = (attitude(0.0), 100 * algorithm.samples());
        for sample in 1..=samples {
            let t_s = sample as f64 * interval_s;
            let angle_rad = sum_to(t_s) - sum_to(t_s - interval_s);
            if let Some(interval) = integrator.push(Increment { angle_rad, ..Increment::default() }) {
                orientation = orientation.advance(&interval.angle_rad, &Vector3::zeros());
            }
        }
        let error = orientation.after(&attitude(1.0).inverse()).rotation_vector();
        error.norm() * DEG_PER_RAD * 3600.0
    }

    #[test]
    fn drift_on_coning_is_that_of_the_table() {
        // the published system: 1, 5, 10 Hz; two printed digits, hence 6 %.
        let table = [
            (Algorithm::Sum, [0.13, 16.2, 127.0]),
            (Algorithm::PreviousInterval, [1.0e-4, 0.32, 9.8]),
            (Algorithm::TwoSample, [6.4e-6, 0.020, 0.63]),
            (Algorithm::ThreeSampleCubic, [9.5e-7, 0.0029, 0.092]),
            (Algorithm::ThreeSamplePrinted, [1.2e-4, 0.017, 0.21]),
        ];
        for (algorithm, drifts) in table {
            for (frequency_hz, expected) in [1.0, 5.0, 10.0].into_iter().zip(drifts) {
                let drift = drift_deg_h(algorithm, frequency_hz);
                assert!((drift / expected - 1.0).abs() < 0.06, "{algorithm:?} {frequency_hz} Hz: {drift} {expected}");
            }
        }
        // The optimal one: at 1 and 5 Hz below what a second of doubles can show.
        let drift = drift_deg_h(Algorithm::ThreeSampleConing, 10.0);
        assert!((drift / 0.0012 - 1.0).abs() < 0.06, "{drift}");
        assert!(drift_deg_h(Algorithm::ThreeSampleConing, 5.0) < 1.2e-5);
    }

    #[test]
    fn a_constant_rotation_is_its_sum() {
        let sample = Increment { angle_rad: Vector3::new(0.01, -0.02, 0.03), velocity_m_s: Vector3::zeros() };
        for algorithm in Algorithm::ALL {
            let mut integrator = Integrator::new(algorithm);
            for _ in 1..algorithm.samples() {
                assert_eq!(integrator.push(sample), None, "{algorithm:?}");
            }
            let interval = integrator.push(sample).unwrap();
            let sum = sample.angle_rad * algorithm.samples() as f64;
            assert!((interval.angle_rad - sum).norm() < 1e-17, "{algorithm:?}");
        }
    }

    #[test]
    fn velocity_is_given_in_the_axes_of_the_start() {
        // A quarter turn about z within the interval while 1 m/s² acts along the turning x axis for 1 s: in the axes of the
        // start ∫ (cos, sin) = (2/π, 2/π).
        let quarter = 90.0 * RAD_PER_DEG;
        let sample = Increment { angle_rad: Vector3::new(0.0, 0.0, quarter), velocity_m_s: Vector3::x() };
        let velocity = Integrator::new(Algorithm::Sum).push(sample).unwrap().velocity_m_s;
        let expected = 2.0 / core::f64::consts::PI;
        assert!((velocity - Vector3::new(expected, expected, 0.0)).norm() < 1e-15, "{velocity:?}");
        // And of a small one the same by the series: sin φ / φ and (1 − cos φ) / φ.
        let small = Increment { angle_rad: Vector3::new(0.0, 0.0, 0.1), velocity_m_s: Vector3::x() };
        let velocity = Integrator::new(Algorithm::Sum).push(small).unwrap().velocity_m_s;
        let expected = Vector3::new(libm::sin(0.1) / 0.1, (1.0 - libm::cos(0.1)) / 0.1, 0.0);
        assert!((velocity - expected).norm() < 1e-15, "{velocity:?}");
    }

    #[test]
    fn sculling_is_rectified_with_its_sign() {
        // Angle a sin ωt about x and force b sin ωt along y are in phase: the mean force along z is ½ a b, up. By hand with
        // a = 1 mrad, b = 1 m/s²: 5e-4 m/s². Coning turns by a²ω/2 and misses (or has too much) a²ω(ωT)ⁿ/k of it, the share 2 (ωT)ⁿ/k; sculling
        // is its polarised form and misses the same. At 5 Hz and 10 ms ωT = 0.31416: (ωT)² = 0.098696, (ωT)⁴ = 0.0097409.
        let (a, b, omega) = (1e-3, 1.0, TWO_PI * 5.0);
        let mean = |algorithm: Algorithm| {
            let interval_s = 0.01 / algorithm.samples() as f64;
            let sum_to = |t_s: f64| Increment {
                angle_rad: Vector3::new(a * libm::sin(omega * t_s), 0.0, 0.0),
                velocity_m_s: Vector3::new(0.0, -b / omega * libm::cos(omega * t_s), 0.0),
            };
            let mut integrator = Integrator::new(algorithm);
            integrator.previous = sum_to(0.0).minus(&sum_to(-interval_s));
            let (mut orientation, mut velocity) = (Quaternion::IDENTITY, Vector3::zeros());
            for sample in 1..=100 * algorithm.samples() {
                let t_s = sample as f64 * interval_s;
                if let Some(interval) = integrator.push(sum_to(t_s).minus(&sum_to(t_s - interval_s))) {
                    velocity += orientation.rotate(&interval.velocity_m_s);
                    orientation = orientation.advance(&interval.angle_rad, &Vector3::zeros());
                }
            }
            velocity.z
        };
        let lost = [
            (Algorithm::Sum, 2.0 * 0.098696 / 12.0),
            (Algorithm::PreviousInterval, 2.0 * 0.0097409 / 60.0),
            (Algorithm::TwoSample, 2.0 * 0.0097409 / 960.0),
            (Algorithm::ThreeSampleCubic, 2.0 * 0.0097409 / 6480.0),
        ];
        for (algorithm, lost) in lost {
            let share = (1.0 - mean(algorithm) / 5e-4).abs();
            assert!((share / lost - 1.0).abs() < 0.05, "{algorithm:?}: {share} {lost}");
        }
        // What is left of the optimal one is the sine of the angle itself: ½ a b (1 − a²/8), 1.25e-7 less.
        assert!((mean(Algorithm::ThreeSampleConing) / 5e-4 - 1.0 + 1.25e-7).abs() < 2e-8);
    }
}
