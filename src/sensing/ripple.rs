//! What oscillates within a second: how far the gyro's angle departs from a straight line.
//!
//! The mean rate of a second does not show a ringing whose period divides the second; the path of the angle within it does.

/// Points of a path below which its scatter about a line says nothing.
const FEWEST: f64 = 5.0;

/// Sums over the points of an angle's path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ripple {
    points: f64,
    time: f64,
    time_squared: f64,
    angle: f64,
    angle_time: f64,
    angle_squared: f64,
}

impl Ripple {
    /// The angle at a time, both counted from the beginning of the second, in any units: the sums lose nothing that counts.
    pub fn push(&mut self, time: f64, angle: f64) {
        self.points += 1.0;
        self.time += time;
        self.time_squared += time * time;
        self.angle += angle;
        self.angle_time += angle * time;
        self.angle_squared += angle * angle;
    }

    /// Root mean square distance of the angle from its least-squares line, in the unit of the angle; 0 for fewer than five points.
    pub fn rms(&self) -> f64 {
        if self.points < FEWEST {
            return 0.0;
        }
        let share = 1.0 / self.points;
        let times = self.time_squared - share * self.time * self.time;
        let slope = self.angle_time - share * self.time * self.angle;
        let squares = self.angle_squared - share * self.angle * self.angle - slope * slope / times;
        libm::sqrt((share * squares).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rms(angle: impl Fn(f64) -> f64) -> f64 {
        let mut ripple = Ripple::default();
        (1..=400).map(|i| f64::from(i) / 400.0).for_each(|time_s| ripple.push(time_s, angle(time_s)));
        ripple.rms()
    }

    #[test]
    fn a_constant_rate_has_none_and_a_sinusoid_its_own() {
        assert!(rms(|time_s| 12.0 * time_s) < 1e-6);
        // 0.3 arcsec at 5 Hz, five whole periods: 0.3/√2 = 0.2121; the line takes 6/(25π²), 2.4 %, of the square.
        let found = rms(|time_s| 12.0 * time_s + 0.3 * (core::f64::consts::TAU * 5.0 * time_s).sin());
        assert!((found - 0.2121 * 0.9878).abs() < 1e-3, "{found}");
    }

    /// The integral of white noise of 1 arcsec in a second, here of ± 1/20 arcsec in each of 400 steps: the mean square of a random walk
    /// about its line is 1/15.
    #[test]
    fn white_noise_in_the_rate() {
        let mut state: u64 = 7;
        let squares: f64 = (0..400)
            .map(|_| {
                let (mut ripple, mut angle) = (Ripple::default(), 0.0);
                for i in 1..=400 {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    angle += if state >> 63 == 0 { 0.05 } else { -0.05 };
                    ripple.push(f64::from(i), angle);
                }
                ripple.rms().powi(2)
            })
            .sum();
        // The square scatters by about its own size from second to second: four sigma of the mean of 400 are 0.2 of it.
        assert!((squares / 400.0 * 15.0 - 1.0).abs() < 0.2, "{}", squares / 400.0);
    }
}
