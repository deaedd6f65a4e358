//! What of the effects a second leaves to the solution, which alone knows the azimuth: a dwell keeps the means of it.

use super::doubt::MAX_DIRECTIONS;
use super::effect::Port;
use super::track::Track;

/// Most products of factors that are kept for effects which depend on the azimuth.
pub const MAX_GATES: usize = 16;
/// Ports whose uncertainty is kept: that of the scale factor is one of the rate.
const PORTS: usize = 4;
/// Numbers that are kept.
const NUMBERS: usize = PORTS * MAX_DIRECTIONS + MAX_GATES + 4;
/// Place of what a change of the scale factor makes of the bias.
const OF_BIAS: usize = NUMBERS - 4;
/// Places of the winding now and when the run began, and of the rows of the last move.
const WINDING: usize = NUMBERS - 3;
const BEGUN: usize = NUMBERS - 2;
const TURN_ROWS: usize = NUMBERS - 1;

/// Numbers that a dwell keeps for its solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    numbers: [f32; NUMBERS],
}

impl Default for Carried {
    fn default() -> Self {
        Self { numbers: [0.0; NUMBERS] }
    }
}

impl Carried {
    fn place(port: Port, direction: usize) -> Option<usize> {
        let port = match port {
            Port::Rate => 0,
            Port::Index => 1,
            Port::Forward => 2,
            Port::Left => 3,
            Port::Scale => return None,
        };
        (direction < MAX_DIRECTIONS).then_some(port * MAX_DIRECTIONS + direction)
    }

    fn place_of_gate(number: usize) -> Option<usize> {
        (number < MAX_GATES).then_some(PORTS * MAX_DIRECTIONS + number)
    }

    /// Takes a share of another one's numbers, and as much less of its own.
    pub fn mix(&mut self, other: &Self, share: f32) {
        for (number, other) in self.numbers.iter_mut().zip(other.numbers) {
            *number += share * (other - *number);
        }
    }

    /// What one sigma along an uncertain direction of the model adds at a port, in the port's unit; the scale factor's is in the rate's.
    pub fn doubt(&self, port: Port, direction: usize) -> f64 {
        Self::place(port, direction).and_then(|place| self.numbers.get(place)).copied().unwrap_or(0.0).into()
    }

    pub fn set_doubt(&mut self, port: Port, direction: usize, value: f64) {
        if let Some(number) = Self::place(port, direction).and_then(|place| self.numbers.get_mut(place)) {
            *number = value as f32;
        }
    }

    /// By what share more of a bias is left, where the scale factor is not that of the model as a whole: the rate is divided by the scale factor, and a
    /// bias that nobody knows yet with it.
    pub fn of_bias(&self) -> f64 {
        self.numbers[OF_BIAS].into()
    }

    pub fn set_of_bias(&mut self, share: f64) {
        self.numbers[OF_BIAS] = share as f32;
    }

    /// Index angle with turns counted, degrees.
    pub fn winding_deg(&self) -> f64 {
        self.numbers[WINDING].into()
    }

    /// The same in the first second of the run.
    pub fn begun_deg(&self) -> f64 {
        self.numbers[BEGUN].into()
    }

    /// Rows within the move before; 0 where the recording leaves them out.
    pub fn turn_rows(&self) -> f64 {
        self.numbers[TURN_ROWS].into()
    }

    pub fn set_way(&mut self, track: &Track) {
        self.numbers[BEGUN] = track.begun_deg as f32;
        self.numbers[WINDING] = track.winding_deg as f32;
        self.numbers[TURN_ROWS] = track.turn_rows as f32;
    }

    /// Product of the factors of an effect that do not depend on the azimuth, where others do; by its number among all of these.
    pub fn gate(&self, number: usize) -> f64 {
        Self::place_of_gate(number).and_then(|place| self.numbers.get(place)).copied().unwrap_or(0.0).into()
    }

    pub fn set_gate(&mut self, number: usize, value: f64) {
        if let Some(gate) = Self::place_of_gate(number).and_then(|place| self.numbers.get_mut(place)) {
            *gate = value as f32;
        }
    }
}

/// Sums by the time, for the means of a dwell.
#[derive(Clone, Debug)]
pub struct CarriedSums {
    sums: [f64; NUMBERS],
    seconds: f64,
}

impl Default for CarriedSums {
    fn default() -> Self {
        Self { sums: [0.0; NUMBERS], seconds: 0.0 }
    }
}

impl CarriedSums {
    pub fn add(&mut self, carried: &Carried, seconds: f64) {
        for (sum, number) in self.sums.iter_mut().zip(carried.numbers) {
            *sum += seconds * f64::from(number);
        }
        self.seconds += seconds;
    }

    /// The means, and begins anew.
    pub fn take(&mut self) -> Carried {
        let seconds = self.seconds.max(f64::MIN_POSITIVE);
        let mut carried = Carried::default();
        for (number, sum) in carried.numbers.iter_mut().zip(self.sums) {
            *number = (sum / seconds) as f32;
        }
        self.clear();
        carried
    }

    pub fn clear(&mut self) {
        self.sums.fill(0.0);
        self.seconds = 0.0;
    }
}
