//! What the terms depend on, second by second.

use heapless::Deque;

use super::channel::{ChannelName, FORWARD, LEFT, MAX_CHANNELS, TEMPERATURE};
use crate::index::Direction;
use crate::level::Specific;
use crate::units::wrap_180_deg;

/// The index is at rest while it stays within this, degrees.
const REST_DEG: f64 = 0.5;
/// Samples that a channel's past is kept for.
const PAST: usize = 32;
/// Samples that a rate of change is taken over, and the fewest that give one.
pub const RATE_SAMPLES: usize = 30;
const LEAST_RATE_SAMPLES: usize = 10;
/// Moves that are remembered.
const MOVES: usize = 8;

/// What a second (or a longer row) was like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Middle of the second since switch-on, and its length, seconds.
    pub t_s: f64,
    pub seconds: f64,
    /// Mean rate as the gyro gave it, °/h.
    pub raw_rate_deg_h: f64,
    /// Mean direction of the index.
    pub index: Option<Direction>,
    /// Gyro temperature, °C.
    pub temp_c: Option<f64>,
    /// Level accelerometers.
    pub level: Option<Specific>,
    /// Channels beyond these, in the order of [`super::ErrorModel::channels`]; not-a-number where absent.
    pub channels: [f64; MAX_CHANNELS],
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            t_s: 0.0,
            seconds: 1.0,
            raw_rate_deg_h: 0.0,
            index: None,
            temp_c: None,
            level: None,
            channels: [f64::NAN; MAX_CHANNELS],
        }
    }
}

impl Conditions {
    /// The value of a channel; `extra` are the names of [`Self::channels`].
    pub fn value(&self, name: &ChannelName, extra: &[ChannelName]) -> Option<f64> {
        let value = match name.as_str() {
            TEMPERATURE => self.temp_c,
            FORWARD => self.level.map(|level| level.forward),
            LEFT => self.level.map(|level| level.left),
            _ => extra.iter().zip(self.channels).find_map(|(each, value)| (each == name).then_some(value)),
        };
        value.filter(|value| value.is_finite())
    }
}

/// A channel's past: rate of change, earlier values, low-pass.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Time and value, oldest first.
    past: Deque<(f64, f64), PAST>,
    low: Option<f64>,
}

impl History {
    /// Takes a value at `t_s`, the middle of a second. The low-pass of time constant `low_pass_s` (0: none) starts at the
    /// first value. A missing value starts everything again.
    pub fn push(&mut self, t_s: f64, value: Option<f64>, low_pass_s: f64) {
        let Some(value) = value else {
            *self = Self::default();
            return;
        };
        let passed = match (self.low, self.past.back()) {
            (Some(low), Some(&(last_s, _))) if low_pass_s > 0.0 => {
                low + (value - low) * (1.0 - libm::exp(-(t_s - last_s).max(0.0) / low_pass_s))
            }
            _ => value,
        };
        self.low = Some(passed);
        if self.past.is_full() {
            self.past.pop_front();
        }
        let _ = self.past.push_back((t_s, passed));
    }

    /// The latest value, low-passed.
    pub fn latest(&self) -> Option<f64> {
        self.low
    }

    /// The value of `lag_s` ago, between samples by a straight line; the oldest if nothing is that old.
    pub fn lagged(&self, lag_s: f64) -> Option<f64> {
        let &(now_s, latest) = self.past.back()?;
        let wanted_s = now_s - lag_s;
        let mut after = (now_s, latest);
        for &(t_s, value) in self.past.iter().rev() {
            if t_s <= wanted_s {
                let share = if after.0 > t_s { (wanted_s - t_s) / (after.0 - t_s) } else { 0.0 };
                return Some(value + share * (after.1 - value));
            }
            after = (t_s, value);
        }
        Some(after.1)
    }

    /// Rate of change per second: least-squares slope over the last `samples` values (3 … 30), which is that of their middle;
    /// or, `curved`, that of a parabola at its end, which does not come late but is noisier. Half a minute of a sensor
    /// that resolves 0.01 K still gives 1e-4 K/s. `None` before ten values are there, or `samples` if these are fewer.
    pub fn rate(&self, samples: usize, curved: bool) -> Option<f64> {
        let count = self.past.len().min(samples.clamp(3, RATE_SAMPLES));
        if count < LEAST_RATE_SAMPLES.min(samples) {
            return None;
        }
        let last = || self.past.iter().skip(self.past.len() - count);
        let number = count as f64;
        let mean_s = last().map(|(t_s, _)| t_s).sum::<f64>() / number;
        let (mut with_time, mut time_squared, mut time_cubed) = (0.0, 0.0, 0.0);
        for (t_s, value) in last() {
            let t_s = t_s - mean_s;
            with_time += t_s * value;
            time_squared += t_s * t_s;
            time_cubed += t_s * t_s * t_s;
        }
        if time_squared <= 0.0 {
            return None;
        }
        let slope = with_time / time_squared;
        if !curved {
            return Some(slope);
        }
        // The part of t² that neither a constant nor t imitates.
        let (skew, spread) = (time_cubed / time_squared, time_squared / number);
        let (mut with_bend, mut bend_squared) = (0.0, 0.0);
        for (t_s, value) in last() {
            let t_s = t_s - mean_s;
            let bend = t_s * t_s - skew * t_s - spread;
            with_bend += bend * value;
            bend_squared += bend * bend;
        }
        let end_s = self.past.back()?.0 - mean_s;
        (bend_squared > 0.0).then(|| slope + with_bend / bend_squared * (2.0 * end_s - skew))
    }
}

/// A move of the index, or switching on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// When rest began, seconds.
    pub ended_s: f64,
    /// Its way, degrees, counter-clockwise positive.
    pub travel_deg: f64,
    /// The index that it led to.
    pub index: Direction,
    /// No move at all: the recording began.
    pub switch_on: bool,
}

/// The index' last moves.
#[derive(Clone, Debug, Default)]
pub struct Travel {
    last_deg: Option<f64>,
    moving: bool,
    /// Oldest first.
    moves: Deque<Move, MOVES>,
}

impl Travel {
    pub fn push(&mut self, conditions: &Conditions) {
        let Some(index) = conditions.index else { return };
        let index_deg = index.deg();
        let start_s = conditions.t_s - 0.5 * conditions.seconds;
        let Some(last_deg) = self.last_deg.replace(index_deg) else {
            self.begin(Move { ended_s: start_s, travel_deg: 0.0, index, switch_on: true });
            return;
        };
        let way_deg = wrap_180_deg(index_deg - last_deg);
        let moving = way_deg.abs() > REST_DEG;
        if moving && !self.moving {
            self.begin(Move { ended_s: start_s, travel_deg: 0.0, index, switch_on: false });
        }
        if let Some(last) = self.moves.back_mut() {
            last.index = index;
            if moving {
                last.travel_deg += way_deg;
                // Where rows leave the move out, rest begins with this very row.
                last.ended_s = start_s;
            }
        }
        self.moving = moving;
    }

    fn begin(&mut self, each: Move) {
        if self.moves.is_full() {
            self.moves.pop_front();
        }
        let _ = self.moves.push_back(each);
    }

    /// The last moves, oldest first; until eight were made, switching on stands before them.
    pub fn moves(&self) -> impl Iterator<Item = &Move> {
        self.moves.iter()
    }
}
