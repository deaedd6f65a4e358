//! Families drawn apart from what any diagnosis has in its lists: written from what instruments and their surroundings do,
//! not from what a diagnosis can find.

mod angle;
mod channel;
mod noise;
mod time;

use std::fmt;

use super::draw::Draw;
use super::plan::{Measure, Needs, Plan};
use super::run_view::RunView;
use super::shape::Shape;

/// A family outside the lists.
pub struct Outside {
    /// Name, stable: lower-case words with hyphens.
    pub(super) name: &'static str,
    /// In a few words, for tables.
    pub(super) describe: &'static str,
    pub(super) needs: Needs,
    pub(super) measure: Measure,
    draw: fn(&mut Sketch<'_>) -> Shape,
}

impl Outside {
    /// All of them.
    pub(super) fn all() -> impl Iterator<Item = &'static Self> {
        [channel::FAMILIES, angle::FAMILIES, time::FAMILIES, noise::FAMILIES].into_iter().flatten()
    }

    /// An effect of this family.
    pub(super) fn shape(&self, plan: &Plan, draw: &mut Draw) -> Shape {
        let mut channels: Vec<usize> = (0..plan.channels.len()).collect();
        draw.shuffle(&mut channels);
        (self.draw)(&mut Sketch { draw, channels })
    }
}

impl fmt::Debug for Outside {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name)
    }
}

impl PartialEq for Outside {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Outside {}

/// What an effect is drawn from: chance, and the campaign's channels in a random order.
struct Sketch<'a> {
    draw: &'a mut Draw,
    channels: Vec<usize>,
}

/// Nothing but the rate is needed.
const ANY: Needs = Needs { outside: true, ..Needs::NONE };

/// Some channels are needed.
const fn channels(count: usize) -> Needs {
    Needs { channels: count, ..ANY }
}

/// A family that is measured by the means of its dwells.
const fn family(
    name: &'static str,
    describe: &'static str,
    needs: Needs,
    draw: fn(&mut Sketch<'_>) -> Shape,
) -> Outside {
    Outside { name, describe, needs, measure: Measure::Dwells, draw }
}

/// Numbers from chance of each run's own.
fn of_run(seed: u64, view: &RunView<'_>) -> Draw {
    Draw::new(seed, view.run as u64)
}

/// Behind a low-pass that has settled to the first value.
fn low_passed(values: &[f64], tau_s: f64) -> Vec<f64> {
    let kept = (-1.0 / tau_s).exp();
    let mut state = values.first().copied().unwrap_or_default();
    values
        .iter()
        .map(|value| {
            state = kept * state + (1.0 - kept) * value;
            state
        })
        .collect()
}
