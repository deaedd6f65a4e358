//! The way of the axis: what depends on the rate behind dynamics depends on the rates that the axis met.

use super::dwell::DwellSummary;
use crate::effects::factor::{Factor, Functions, Memory};
use crate::effects::track::REST_DEG;
use crate::sensing::index::Direction;

/// Most places of a turn that count: of a whole one every ten degrees.
const MOST_PLACES: f64 = 36.0;
/// Length of a row of a turn, seconds.
const ROW_S: f64 = 1.0;
/// Most steps in which a dwell is gone again.
const MOST_STEPS: f64 = 32.0;

/// The dwells of a fix, gone again at a supposed azimuth.
pub(super) struct Way<'a> {
    /// In the order of time.
    pub dwells: &'a [DwellSummary],
    pub azimuth_deg: f64,
    /// The Earth's rate about the axis at an index, with the levels of a dwell, °/h.
    pub rate_deg_h: &'a dyn Fn(Direction, &DwellSummary) -> f64,
}

impl Way<'_> {
    /// The functions of a factor of the rate behind dynamics, means over a dwell, where the rate is this; none where nothing comes out of the dynamics. The axis met the rates of where the run began, of the
    /// dwells, and of the turns before them, which take no time where their rows were left out; what is left of the time between two dwells it was at the place
    /// of the second.
    pub fn replay(&self, factor: &Factor, dwell: &DwellSummary, rate_deg_h: f64) -> Functions {
        let mut memory = Memory::default();
        let mut meet = |rate_deg_h: f64, step_s: f64| factor.pass(Some(rate_deg_h), step_s, &mut memory);
        let before = || self.dwells.iter().take_while(|each| each.t_s < dwell.t_s);
        let first = before().next().unwrap_or(dwell);
        let (mut last_deg, mut last_s) = (first.carried.begun_deg(), first.start_s - ROW_S * first.carried.turn_rows());
        meet((self.rate_deg_h)(Direction::of_deg(last_deg), first), 0.0);
        let mut go_to = |each: &DwellSummary, rate_deg_h: f64, take: &mut dyn FnMut(f64)| {
            let from_deg = core::mem::replace(&mut last_deg, each.carried.winding_deg());
            let turn = Turn { from_deg, to_deg: last_deg, rows: each.carried.turn_rows() };
            let places_deg = turn.places_deg(self.azimuth_deg);
            let between_s = (each.start_s - core::mem::replace(&mut last_s, each.end_s)).max(0.0);
            let row_s = if turn.rows > 0.0 { ROW_S.min(between_s / turn.rows) } else { 0.0 };
            let rest_s = between_s - row_s * places_deg.len() as f64;
            for index_deg in places_deg {
                meet((self.rate_deg_h)(Direction::of_deg(index_deg), each), row_s);
            }
            if rest_s > 0.5 * ROW_S {
                meet(rate_deg_h, rest_s);
            }
            let steps_s = steps_s(factor, each.end_s - each.start_s);
            steps_s.filter_map(|step_s| meet(rate_deg_h, step_s)).for_each(take);
        };
        for each in before() {
            go_to(each, (self.rate_deg_h)(Direction { cos: each.cos, sin: each.sin }, each), &mut |_| ());
        }
        let (mut means, mut count) = (Functions::new(), 0.0);
        go_to(dwell, rate_deg_h, &mut |output| {
            let values = factor.values(output);
            count += 1.0;
            if means.is_empty() {
                means = values;
            } else {
                means.iter_mut().zip(&values).for_each(|(mean, value)| *mean += (value - *mean) / count);
            }
        });
        means
    }
}

/// The steps in which a factor goes through a dwell of that length, seconds; one where it takes no time. Their middles have the mean time of rows, each of which
/// ends a step of its own length.
fn steps_s(factor: &Factor, length_s: f64) -> impl Iterator<Item = f64> + use<> {
    let count = if factor.takes_time() { libm::ceil(length_s / ROW_S).clamp(1.0, MOST_STEPS) } else { 1.0 };
    let step_s = length_s / count;
    let first_s = 0.5 * (step_s + ROW_S.min(step_s));
    (0..count as u32).map(move |step| if step == 0 { first_s } else { step_s })
}

/// A turn from rest to rest.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Index angles with turns counted, degrees.
    pub from_deg: f64,
    pub to_deg: f64,
    /// Rows that were measured in between; 0: they were left out.
    pub rows: f64,
}

impl Turn {
    /// The index angles, degrees with turns counted, whose rates it met at an azimuth, in their order: the middles of its rows, which divide it evenly; without
    /// rows where the Earth's rate about the axis was greatest or least, which is where the axis pointed north or south: at an index of the azimuth, or half a
    /// turn from it.
    pub fn places_deg(&self, azimuth_deg: f64) -> impl ExactSizeIterator<Item = f64> + use<> {
        let way_deg = self.to_deg - self.from_deg;
        let rows = libm::rint(self.rows).min(MOST_PLACES);
        let (first_deg, step_deg, count) = if way_deg.abs() < REST_DEG {
            (0.0, 0.0, 0.0)
        } else if rows > 0.0 {
            (self.from_deg + 0.5 * way_deg / rows, way_deg / rows, rows)
        } else {
            let half_turns = |deg: f64| (deg - azimuth_deg) / 180.0;
            let first = libm::ceil(half_turns(self.from_deg.min(self.to_deg)));
            let last = libm::floor(half_turns(self.from_deg.max(self.to_deg)));
            let (begun, step) = if way_deg > 0.0 { (first, 180.0) } else { (last, -180.0) };
            (azimuth_deg + 180.0 * begun, step, (last - first + 1.0).max(0.0))
        };
        (0..count as u32).map(move |place| first_deg + step_deg * f64::from(place))
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    fn places(from_deg: f64, to_deg: f64, rows: f64) -> Vec<f64> {
        Turn { from_deg, to_deg, rows }.places_deg(70.0).collect()
    }

    /// At an azimuth of 70° the axis points north at an index of 70°, 430° … and south at 250°, −110° …
    #[test]
    fn north_and_south_are_passed_in_order() {
        assert_eq!(places(0.0, 90.0, 0.0), [70.0]);
        assert_eq!(places(300.0, 0.0, 0.0), [250.0, 70.0]);
        assert_eq!(places(-120.0, 260.0, 0.0), [-110.0, 70.0, 250.0]);
        assert!(places(80.0, 240.0, 0.0).is_empty() && places(90.0, 90.0, 0.0).is_empty());
    }

    /// Three rows of a turn by −90° have their middles 15°, 45° and 75° behind its beginning.
    #[test]
    fn rows_divide_a_turn_evenly() {
        assert_eq!(places(90.0, 0.0, 3.0), [75.0, 45.0, 15.0]);
        assert!(places(90.0, 90.1, 3.0).is_empty());
        assert_eq!(places(0.0, 360.0, 72.0).len(), 36);
    }
}
