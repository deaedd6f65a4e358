//! Campaigns with hidden effects that nobody listed: each is composed at random, of more than a diagnosis can compose.
//!
//! An effect is a product of factors at a port of the instrument; a factor is the shape of a signal behind a dynamics.
//! Half of the draws hold something outside that grammar. Only campaigns in which the effect matters count: those whose
//! plain azimuths are at least three times as wrong as those of an oracle, who knows the form of what is hidden. The same
//! seed, number and kind give the same campaign, always. `docs/composed-effects.md` says what is drawn.

pub(crate) mod board;
mod channel;
mod compose;
mod dynamics;
mod effect;
mod files;
mod fleet;
mod fresh;
pub mod judge;
mod oracle;
mod plain;
mod plan;
mod process;
mod record;
mod shape;
mod signal;
#[cfg(test)]
mod tests;

pub use dynamics::Dynamics;
pub use effect::{Drift, Effect, Factor, Input, Port};
pub use files::{RunTruth, Truth};
pub use fleet::{Fleet, Kind as UnitKind};
pub use oracle::Reported;
pub use process::Process;
pub use record::Row;
pub use shape::Shape;
pub use signal::Signal;

use crate::hidden::draw::Draw;
use plan::Plan;

/// What a campaign is to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Effects that the grammar can compose.
    Inside,
    /// At least one effect with something outside it.
    Outside,
    /// Nothing.
    Empty,
}

/// A campaign and its truth.
#[derive(Debug, Clone)]
pub struct Campaign {
    pub kind: Kind,
    pub effects: Vec<Effect>,
    /// Draws until one counted.
    pub draws: u64,
    /// Rows of every run.
    pub rows: Vec<Vec<Row>>,
    /// Plain azimuth of every run, degrees.
    pub plain_deg: Vec<f64>,
    /// What the oracle says of the check runs; `None` for fit runs.
    pub oracle: Vec<Option<Reported>>,
    plan: Plan,
}

/// Errors before at least this many times the oracle's: less does not count.
pub(crate) const LEAST_RATIO: f64 = 3.0;
/// Plain error that the effects alone make, rms in standard deviations of the azimuth's white noise.
const STRENGTH: [f64; 2] = [4.0, 60.0];
/// … and at most this, degrees.
const MOST_ERROR_DEG: f64 = 5.0;
/// Share of campaigns with two or three effects.
const SEVERAL: f64 = 1.0 / 3.0;
/// Stream numbers that a campaign has for its draws.
const MOST_DRAWS: u64 = 1 << 20;

impl Campaign {
    /// Draws campaign number `number` of this kind.
    pub fn draw(seed: u64, number: u64, kind: Kind) -> Self {
        let tag = (kind as u64) << 60;
        let first = tag + number * MOST_DRAWS;
        // Once for all draws: several effects are refused more often than one.
        let mut draw = Draw::new(seed, first);
        let count = match kind {
            Kind::Empty => 0,
            _ if draw.chance(SEVERAL) => draw.whole(2, 3),
            _ => 1,
        };
        (1..MOST_DRAWS)
            .find_map(|draws| Self::attempt(&mut Draw::new(seed, first + draws), kind, count, draws))
            .expect("one of a million draws counts")
    }

    fn attempt(draw: &mut Draw, kind: Kind, count: usize, draws: u64) -> Option<Self> {
        let plan = Plan::new(draw);
        let strange = if kind == Kind::Outside { draw.whole(0, count - 1) } else { count };
        let mut effects =
            (0..count).map(|place| compose::effect(draw, &plan, place == strange)).collect::<Option<Vec<_>>>()?;
        let spreads = record::spreads(&plan);
        size(draw, &plan, &mut effects, &spreads)?;
        let rows: Vec<Vec<Row>> =
            (0..plan.runs.len()).map(|run| record::rows(&plan, run, &effects, &spreads, 1.0)).collect();
        let plain_deg: Vec<f64> =
            rows.iter().enumerate().map(|(run, rows)| plain::azimuth_deg(&plan, run, rows)).collect();
        let (oracle, _) = oracle::consult(&plan, &effects, &spreads, &rows)?;
        let campaign = Self { kind, effects, draws, rows, plain_deg, oracle, plan };
        let counts = campaign.before_deg() >= LEAST_RATIO * campaign.oracle_deg();
        (kind == Kind::Empty || counts).then_some(campaign)
    }

    /// Root mean square of the plain errors of the check runs, degrees.
    pub fn before_deg(&self) -> f64 {
        self.rms_deg(|run| self.plain_deg[run])
    }

    /// … of the oracle's.
    pub fn oracle_deg(&self) -> f64 {
        self.rms_deg(|run| self.oracle[run].map_or(f64::NAN, |told| told.azimuth_deg))
    }

    fn rms_deg(&self, azimuth_deg: impl Fn(usize) -> f64) -> f64 {
        let checks: Vec<usize> = (0..self.plan.runs.len()).filter(|&run| !self.plan.runs[run].is_fit).collect();
        let squares = checks.iter().map(|&run| apart_deg(azimuth_deg(run), self.plan.runs[run].azimuth_deg).powi(2));
        (squares.sum::<f64>() / checks.len() as f64).sqrt()
    }

    /// What is hidden, in words with all constants.
    pub fn describe(&self) -> Vec<String> {
        self.effects.iter().map(|effect| effect.describe(&self.plan)).collect()
    }

    pub fn arw_deg_per_sqrt_h(&self) -> f64 {
        self.plan.arw_deg_per_sqrt_h
    }
}

/// Gives every effect a weight such that it makes errors of some strength; `None` where that would take more than any
/// instrument has.
fn size(draw: &mut Draw, plan: &Plan, effects: &mut [Effect], spreads: &[[f64; 2]]) -> Option<()> {
    let north_deg_h = plan::EARTH_DEG_H * plan.latitude_deg.to_radians().cos();
    let rests = |run: &plan::RunPlan| run.rests.iter().filter(|&&rests| rests).count() as f64;
    let seconds = plan.runs.iter().map(rests).sum::<f64>() / plan.runs.len() as f64;
    // √2 σ / (h √T) with σ for one second.
    let noise_deg = (2.0_f64.sqrt() * 60.0 * plan.arw_deg_per_sqrt_h / (north_deg_h * seconds.sqrt())).to_degrees();
    for effect in effects.iter_mut() {
        let target_deg = noise_deg * draw.log_uniform(STRENGTH[0], STRENGTH[1]);
        let error_deg = |effect: &Effect| {
            let squares = (0..plan.runs.len()).map(|run| {
                let rows = record::rows(plan, run, std::slice::from_ref(effect), spreads, 0.0);
                apart_deg(plain::azimuth_deg(plan, run, &rows), plan.runs[run].azimuth_deg).powi(2)
            });
            (squares.sum::<f64>() / plan.runs.len() as f64).sqrt()
        };
        // Small: the error is proportional to it.
        effect.weight = 0.01 * effect.port.most();
        let weight = effect.weight * target_deg.min(MOST_ERROR_DEG) / error_deg(effect);
        if !(weight <= effect.port.most()) {
            return None;
        }
        effect.weight = weight * draw.sign();
    }
    Some(())
}

/// The first less the other, in −180 … 180°.
fn apart_deg(first_deg: f64, other_deg: f64) -> f64 {
    (first_deg - other_deg + 180.0).rem_euclid(360.0) - 180.0
}
