//! The way of an instrument that is carried from one place to another.

use crate::geometry::BaseAngles;
use crate::scenario::Carry;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Longest time of lifting and of setting down, s.
const LIFT_S: f64 = 2.0;
/// Step of the second difference that makes the acceleration, s.
const DIFFERENCE_S: f64 = 1e-3;

/// The way.
#[derive(Debug, Clone)]
pub struct Way {
    carry: Carry,
    lifted_s: f64,
}

impl Way {
    /// It is lifted at this time.
    pub fn new(carry: &Carry, lifted_s: f64) -> Self {
        Self { carry: carry.clone(), lifted_s }
    }

    /// By how much it is turned beyond how it stood.
    pub fn turned(&self, t_s: f64) -> BaseAngles {
        let Carry { turn_deg, set_down_deg, sway_deg, steps_hz, .. } = self.carry;
        let (way, held) = self.progress(t_s);
        let sway =
            |axis: usize, hz: f64, phase: f64| held * sway_deg[axis] * (TAU * hz * (t_s - self.lifted_s) + phase).sin();
        BaseAngles {
            pitch_rad: (way * set_down_deg[0] + sway(0, steps_hz, 0.3)).to_radians(),
            roll_rad: (way * set_down_deg[1] + sway(1, 0.5 * steps_hz, 1.1)).to_radians(),
            azimuth_rad: (way * turn_deg + sway(2, 0.25 * steps_hz, 2.0)).to_radians(),
        }
    }

    /// Acceleration of the place, east, north, up, m/s².
    pub fn acceleration_m_s2(&self, t_s: f64) -> Vector3<f64> {
        let place = |offset_s: f64| self.place_m(t_s + offset_s);
        (place(DIFFERENCE_S) - place(0.0) * 2.0 + place(-DIFFERENCE_S)) / (DIFFERENCE_S * DIFFERENCE_S)
    }

    /// Place, east, north, up, m: it goes to the east.
    fn place_m(&self, t_s: f64) -> Vector3<f64> {
        let Carry { distance_m, lift_m, bob_m, steps_hz, .. } = self.carry;
        let (way, held) = self.progress(t_s);
        let bob_m = bob_m * (TAU * steps_hz * (t_s - self.lifted_s)).sin();
        Vector3::new(distance_m * way, 0.0, held * (lift_m + bob_m))
    }

    /// How far it has come, 0 to 1, and how far it is in the hands, 0 to 1; both without a jump in the acceleration.
    fn progress(&self, t_s: f64) -> (f64, f64) {
        let smooth = |x: f64| {
            let x = x.clamp(0.0, 1.0);
            x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        };
        let walk_s = self.carry.walk_s;
        let since_s = t_s - self.lifted_s;
        let lift_s = LIFT_S.min(0.25 * walk_s);
        (smooth(since_s / walk_s), smooth(since_s / lift_s) * smooth((walk_s - since_s) / lift_s))
    }
}
