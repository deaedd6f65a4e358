//! The instrument in somebody's hands: lifted off its base, turned, put down.

use nalgebra::{UnitQuaternion, UnitVector3, Vector3};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Frequencies of the hands' shake along x, y and z, Hz: physiological tremor lies between 8 and 12 Hz.
const TREMOR_HZ: [f64; 3] = [8.3, 9.7, 11.1];

/// A turn by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// When it begins, s.
    pub at_s: f64,
    /// How long it takes, s; more than 0.
    pub seconds: f64,
    /// Which way of the instrument points up at its end.
    pub up: UnitVector3<f64>,
    /// Shake in its middle, g rms on each axis; it rises from 0 and falls to 0.
    pub shake_g: f64,
}

/// How the instrument is held.
#[derive(Debug, Clone)]
pub struct Hand {
    turns: VecDeque<Turn>,
    /// Rotation at the end of the last turn that has ended.
    rest: UnitQuaternion<f64>,
    rotation: UnitQuaternion<f64>,
    shake_g: Vector3<f64>,
}

impl Hand {
    /// As it stands on its base.
    pub fn off() -> Self {
        Self {
            turns: VecDeque::new(),
            rest: UnitQuaternion::identity(),
            rotation: UnitQuaternion::identity(),
            shake_g: Vector3::zeros(),
        }
    }

    /// Adds a turn; it begins when the one before has ended, if that is later than its own time.
    pub fn turn(&mut self, turn: Turn) {
        let free_s = self.turns.back().map_or(turn.at_s, |last| last.at_s + last.seconds);
        self.turns.push_back(Turn { at_s: turn.at_s.max(free_s), ..turn });
    }

    /// Moves on to `t_s`.
    pub fn advance_to(&mut self, t_s: f64) {
        self.shake_g = Vector3::zeros();
        while let Some(turn) = self.turns.front().filter(|turn| turn.at_s <= t_s) {
            // About the shortest way; the instrument's own direction `up` goes to where up was.
            let path = shortest(&turn.up, &UnitVector3::new_normalize(self.rest.inverse() * Vector3::z()));
            let done = (t_s - turn.at_s) / turn.seconds;
            if done < 1.0 {
                self.rotation = self.rest * path.powf(0.5 * (1.0 - (PI * done).cos()));
                let strength = 2_f64.sqrt() * turn.shake_g * (PI * done).sin();
                self.shake_g = Vector3::from(TREMOR_HZ.map(|hz| strength * (TAU * hz * t_s).sin()));
                return;
            }
            self.rest *= path;
            self.rotation = self.rest;
            self.turns.pop_front();
        }
    }

    /// Takes instrument coordinates to those of the base.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        self.rotation
    }

    /// Acceleration that the hands add, in the instrument's axes, g.
    pub fn shake_g(&self) -> Vector3<f64> {
        self.shake_g
    }
}

/// The rotation that takes one direction to another; opposite ones by way of any side.
fn shortest(from: &UnitVector3<f64>, to: &UnitVector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between_axis(from, to).unwrap_or_else(|| {
        let across = if from.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        UnitQuaternion::from_axis_angle(&UnitVector3::new_normalize(from.cross(&across)), PI)
    })
}
