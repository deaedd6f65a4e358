//! An operator who turns the instrument as the instrument asks: late, shaking, and not quite to where it should be.

use crate::hand::Turn;
use crate::noise::{Source, Stream};
use crate::scenario::{self, Scenario};
use crate::world::World;
use nalgebra::{UnitQuaternion, UnitVector3, Vector3};

/// A shock comes this long after the instrument was put down, takes this long and turns it by this much.
const SHOCK_AFTER_S: f64 = 1.5;
const SHOCK_S: f64 = 0.3;
const SHOCK_DEG: f64 = 12.0;
/// Shake of a shock, g rms.
const SHOCK_G: f64 = 0.3;

/// The operator.
#[derive(Debug, Clone)]
pub struct Operator {
    habits: scenario::Operator,
    stream: Stream,
    /// Turns so far.
    turns: u32,
}

impl Operator {
    /// The scenario's operator. The same scenario and seed give the same turns, always.
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        Self { habits: scenario.operator.clone(), stream: Stream::new(seed, Source::Operator), turns: 0 }
    }

    /// Is asked to turn the instrument until this direction of it (x, y, z, any length but zero) points up.
    ///
    /// Does nothing for a direction of no length.
    pub fn turn(&mut self, world: &World, up: [f64; 3]) {
        let Some(asked) = UnitVector3::try_new(Vector3::from(up), 1e-6) else { return };
        self.turns += 1;
        let seconds = if self.habits.slow.contains(&self.turns) { self.habits.slow_s } else { self.habits.turn_s };
        let aim_rad = self.habits.aim_deg.to_radians();
        let up = self.missed(&asked, aim_rad);
        let at_s = world.truth().t_s + self.habits.reaction_s;
        world.turn_by_hand(Turn { at_s, seconds, up, shake_g: self.habits.shake_g });
        if self.habits.shocks.contains(&self.turns) {
            let up = self.thrown(&up);
            let at_s = at_s + seconds + SHOCK_AFTER_S;
            world.turn_by_hand(Turn { at_s, seconds: SHOCK_S, up, shake_g: SHOCK_G });
        }
    }

    /// A direction with an error of this rms about each of the two axes across it.
    fn missed(&mut self, aim: &UnitVector3<f64>, rms_rad: f64) -> UnitVector3<f64> {
        let error = Vector3::from_fn(|_, _| rms_rad * self.stream.normal());
        UnitQuaternion::from_scaled_axis(error - aim.scale(aim.dot(&error))) * aim
    }

    /// Where a shock from any side leaves it.
    fn thrown(&mut self, up: &UnitVector3<f64>) -> UnitVector3<f64> {
        let side = Vector3::from_fn(|_, _| self.stream.normal());
        let axis = UnitVector3::new_normalize(up.cross(&side));
        UnitQuaternion::from_axis_angle(&axis, SHOCK_DEG.to_radians()) * up
    }
}
