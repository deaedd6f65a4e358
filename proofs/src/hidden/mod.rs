//! Campaigns with a hidden effect in them, drawn at random: the touchstone of a diagnosis.
//!
//! A campaign is drawn from a seed and a number: place, instrument, runs with their orders and headings, channels that
//! cause something and channels that do nothing. One effect of a family is hidden in it, with random constants and size.
//! Its truth is known to whoever asks for it, and so is the campaign without it. The same seed, number and family give
//! the same campaign, always; without the effect all noise is the same.

pub(crate) mod draw;
mod family;
mod instrument;
mod outside;
mod part;
mod plan;
mod record;
mod run_view;
mod shape;
mod signal;

pub use family::{Family, Group};
pub use instrument::{Hidden, Instrument};
pub use part::{MoveLaw, Part};
pub use plan::Proposed;
pub use record::Row;
pub use shape::Shape;

use draw::Draw;
use plan::{Measure, Plan};

/// What is hidden in a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    pub family: Family,
    /// Coefficients and shapes; the effect is their sum.
    pub parts: Vec<(f64, Part)>,
}

/// One run of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// One row a second, the turning ones too.
    pub rows: Vec<Row>,
    /// True azimuth of the mark, degrees clockwise from north.
    pub azimuth_deg: f64,
    /// What the surveyor says of it, degrees, if there was one.
    pub reference_deg: Option<f64>,
    /// One sigma of the survey, degrees.
    pub reference_sigma_deg: f64,
    /// Whether a diagnosis may learn from it; else it is only judged.
    pub may_learn: bool,
}

/// A campaign and its truth.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Geodetic latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Angle random walk of the gyro, °/√h.
    pub arw_deg_per_sqrt_h: f64,
    /// Whether there is a column for the gyro's temperature: then it is the first channel.
    pub has_temperature: bool,
    /// Whether there are level accelerometers.
    pub has_level: bool,
    /// Their noise density, µg/√Hz.
    pub level_noise: f64,
    /// Names of all channels, the temperature first.
    pub channels: Vec<String>,
    /// The recordings.
    pub runs: Vec<Run>,
    /// What is hidden in them.
    pub effect: Effect,
    plan: Plan,
}

/// Strength of effects against noise: least and most, by the family's measure.
const STRENGTH: [f64; 2] = [3.0, 15.0];
/// Least spread of an effect's dwells within a run, as a share of the effect itself.
const LEAST_SPREAD: f64 = 0.05;
/// Draws after which an effect that hardly shows is taken as it is.
const MOST_DRAWS: usize = 50;
/// Rate of the Earth, °/h, for the strength of effects that turn the azimuth.
const EARTH_DEG_H: f64 = 15.041_067;

impl Campaign {
    /// Draws campaign number `number` with an effect of `family`.
    pub fn draw(family: Family, seed: u64, number: u64) -> Self {
        let mut draw = Draw::new(seed, number);
        let plan = Plan::new(&mut draw, family.needs());
        let parts = family
            .members(&mut draw)
            .into_iter()
            .flat_map(|family| sized(family, &plan, &mut draw))
            .collect::<Vec<_>>();
        let runs = record::runs(&plan, &parts);
        Self {
            latitude_deg: plan.latitude_deg,
            arw_deg_per_sqrt_h: plan.arw_deg_per_sqrt_h,
            has_temperature: plan.has_temperature,
            has_level: plan.has_level,
            level_noise: plan.level_noise,
            channels: plan.channels.iter().map(|channel| channel.name.clone()).collect(),
            runs,
            effect: Effect { family, parts },
            plan,
        }
    }

    /// The same instrument with the same effect in it, and runs more.
    pub fn followed_by(&self, proposed: &Proposed, seed: u64) -> Self {
        let mut plan = self.plan.clone();
        plan.add_proposed(&mut Draw::new(seed, u64::MAX), proposed);
        Self { runs: record::runs(&plan, &self.effect.parts), plan, ..self.clone() }
    }

    /// A run of the same campaign, with the same noise, with these parts in place of the hidden effect; `None` if there is
    /// no such run.
    pub fn run_with(&self, number: usize, parts: &[(f64, Part)]) -> Option<Run> {
        (number < self.runs.len()).then(|| record::run(&self.plan, number, parts))
    }

    /// About the standard deviation of one azimuth from the gyro's white noise, degrees.
    pub fn azimuth_noise_deg(&self) -> f64 {
        self.plan.azimuth_noise_deg(EARTH_DEG_H)
    }

    /// Names of the channels that the effect depends on.
    pub fn causal_channels(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for (_, part) in &self.effect.parts {
            for channel in part.channels() {
                let name = self.channels.get(channel).map_or("", String::as_str);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        names
    }
}

/// An effect of one family with a random size.
fn sized(family: Family, plan: &Plan, draw: &mut Draw) -> Vec<(f64, Part)> {
    let mut parts = family.parts(plan, draw);
    for _ in 0..MOST_DRAWS {
        if shows(plan, family.measure(), &parts) {
            break;
        }
        parts = family.parts(plan, draw);
    }
    let strength = draw.sign() * draw.log_uniform(STRENGTH[0], STRENGTH[1]);
    let size = strength * unit(plan, family.measure(), &parts);
    for (coefficient, _) in &mut parts {
        *coefficient *= size;
    }
    parts
}

/// Whether the parts do something that differs within a run: a bend far from all values, or a channel that only differs
/// between runs, would have to be made enormous.
fn shows(plan: &Plan, measure: Measure, parts: &[(f64, Part)]) -> bool {
    measure != Measure::Dwells
        || parts.is_empty()
        || record::spread_of_dwells(plan, parts) > LEAST_SPREAD * record::spread_of_rows(plan, parts)
}

/// The factor that gives the parts a strength of 1 against the noise.
fn unit(plan: &Plan, measure: Measure, parts: &[(f64, Part)]) -> f64 {
    let spread = match measure {
        Measure::Azimuth => return plan.azimuth_noise_deg(EARTH_DEG_H),
        _ if parts.is_empty() => return 0.0,
        Measure::Dwells => record::spread_of_dwells(plan, parts),
        Measure::Rows => record::spread_of_rows(plan, parts) * 8.0 / (plan.runs[0].seconds() as f64).sqrt(),
        Measure::Runs => record::spread_of_runs(plan, parts),
    };
    if spread > 0.0 { plan.dwell_noise_deg_h() / spread } else { 0.0 }
}
