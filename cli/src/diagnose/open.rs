//! What no named effect explains: the engine of the open world on the runs, beside the named effects or in their place.

use std::collections::BTreeMap;

use north_finder::units::{RAD_PER_DEG, wrap_180_deg};

use super::Effect;
use super::block::Block;
use super::data::RunData;
use super::learned::Taken;
use super::problem::Problem;
use crate::campaign::Role;
use crate::open_world::{self, Found, Learned, Prediction, Recording, Reference};

/// Share of the mean square error of what it replaces that a model must fall below.
const BETTER: f64 = 0.95;
/// Log-likelihood that processes of the runs' own must gain over white noise to count.
const PROCESS: f64 = 10.0;
/// Log evidence that every fitted number of a named effect must be worth.
const OF_NUMBER: f64 = 4.0;

/// A model of the open world over the runs of a campaign.
pub struct Open {
    learned: Learned,
    /// Names of the channels that its groups count.
    names: Vec<String>,
    /// Of every run; of those that were learned from by models without them.
    pub azimuths: Vec<Option<Prediction>>,
    /// It stands in the place of the named effects, not beside them.
    pub replaces: bool,
}

impl Open {
    /// Beside the named effects or, where the evidence is for that, in their place.
    pub fn choose(runs: &[RunData], taken: &[Taken], bad_references: &[String]) -> Option<Self> {
        let beside = Self::learn(runs, taken, bad_references)?;
        if taken.is_empty() {
            return Some(beside);
        }
        let alone = Self::learn(runs, &[], bad_references)?;
        let numbers: usize = taken.iter().map(|each| each.candidate.freedom()).sum();
        let named = beside.learned.evidence - OF_NUMBER * numbers as f64;
        Some(if alone.learned.evidence > named { Self { replaces: true, ..alone } } else { beside })
    }

    /// Learns from the fit runs, whose named effects are taken out.
    fn learn(runs: &[RunData], taken: &[Taken], bad_references: &[String]) -> Option<Self> {
        let names = shared_channels(runs);
        let recordings = recordings(runs, taken, &names, bad_references);
        let fit: Vec<usize> =
            (0..runs.len()).filter(|&i| runs[i].role == Role::Fit && !recordings[i].is_empty()).collect();
        let training: Vec<&Recording> = fit.iter().map(|&i| &recordings[i]).collect();
        let learned = open_world::learn(&training)?;
        let all: Vec<&Recording> = recordings.iter().collect();
        let mut azimuths = learned.azimuths(&all);
        if learned.left_out.len() == fit.len() {
            for (&i, &left_out) in fit.iter().zip(&learned.left_out) {
                azimuths[i] = Some(left_out);
            }
        }
        Some(Self { learned, names, azimuths, replaces: false })
    }

    /// Whether it replaces azimuths of these errors (fit runs with a reference, degrees) by better ones.
    pub fn is_better(&self, runs: &[RunData], azimuths_deg: &[Option<f64>], bad_references: &[String]) -> bool {
        let (mut before, mut after, mut number) = (0.0, 0.0, 0);
        for ((run, azimuth_deg), own) in runs.iter().zip(azimuths_deg).zip(&self.azimuths) {
            let trusted = run.role == Role::Fit && !bad_references.contains(&run.file);
            if let (Some(reference), Some(azimuth), Some(own)) =
                (run.reference_deg.filter(|_| trusted), azimuth_deg, own)
            {
                before += wrap_180_deg(azimuth - reference).powi(2);
                after += wrap_180_deg(own.azimuth_rad / RAD_PER_DEG - reference).powi(2);
                number += 1;
            }
        }
        let structure = !self.groups().is_empty() || self.has_process();
        structure && (number == 0 || after < BETTER * before)
    }

    /// Whether runs have processes of their own.
    fn has_process(&self) -> bool {
        self.learned.process_gain > PROCESS
    }

    fn groups(&self) -> &[Found] {
        self.learned.models.first().map_or(&[], |model| &model.groups)
    }

    /// What it learned, in words.
    pub fn effects(&self) -> Vec<Effect> {
        let weight = self.learned.models.first().map_or(1.0, |model| model.weight);
        let effect = |(place, found): (usize, &Found)| {
            let name = found.group.name();
            let mut ambiguous_with: Vec<String> = Vec::new();
            for model in self.learned.models.iter().skip(1) {
                let other = model.groups.get(place).map(|other| other.group.name());
                ambiguous_with.extend(other.filter(|other| *other != name && !ambiguous_with.contains(other)));
            }
            Effect {
                kind: "bias",
                channel: match found.group.channels().as_slice() {
                    [one] => Some(self.names[*one].clone()),
                    _ => None,
                },
                parameters: BTreeMap::from([("rms_deg_h".to_owned(), found.size_deg_h)]),
                sigma: BTreeMap::new(),
                p_value: 1.0 / (1.0 + found.log_odds.exp()),
                ambiguous_with,
                evidence: format!(
                    "{}: log odds {:.0} over the model without it; weight of this model among those that are possible \
                     {weight:.2}",
                    found.group.words(&self.names),
                    found.log_odds
                ),
                board: false,
                name,
            }
        };
        self.groups().iter().enumerate().map(effect).collect()
    }

    /// What remains: processes of the runs' own, in words.
    pub fn unexplained(&self) -> Vec<String> {
        let likeliest = (1..self.learned.kernels.len())
            .max_by(|&a, &b| self.learned.shares[a].total_cmp(&self.learned.shares[b]))
            .map(|kernel| self.learned.kernels[kernel]);
        match likeliest.filter(|_| self.has_process()) {
            Some(kernel) => vec![format!(
                "a process of every run's own that no channel tells, typically {:.4} deg/h over {:.0} s; sigma covers it",
                kernel.size * self.learned.unit_deg_h,
                kernel.time_s
            )],
            None => Vec::new(),
        }
    }
}

/// Channels that all runs have and that take more than one value; the level accelerometers are no channels of the gyro's
/// environment here, but enter through the tilt.
fn shared_channels(runs: &[RunData]) -> Vec<String> {
    let Some(first) = runs.first() else { return Vec::new() };
    let varies = |name: &String| {
        runs.iter()
            .any(|run| run.channel(name).is_some_and(|values| values.iter().any(|value| Some(value) != values.first())))
    };
    first
        .channel_names()
        .into_iter()
        .filter(|name| !matches!(name.as_str(), "ax_g" | "ay_g"))
        .filter(|name| {
            runs.iter().all(|run| run.channel(name).is_some_and(|values| values.iter().all(|v| v.is_finite())))
        })
        .filter(varies)
        .collect()
}

/// The runs as the engine takes them, without what the named effects do; empty where a run has too little in it.
fn recordings(runs: &[RunData], taken: &[Taken], names: &[String], bad_references: &[String]) -> Vec<Recording> {
    let blocks: Vec<Option<Block>> = runs.iter().map(|run| Block::new(run, run.role == Role::Fit, None)).collect();
    let present: Vec<bool> = blocks.iter().map(Option::is_some).collect();
    let mut problem = Problem::new(blocks.into_iter().flatten().collect());
    problem.linearise(taken);
    let effects = problem.effects(taken);
    let mut rates = problem.blocks.iter().zip(problem.ranges()).map(|(block, range)| {
        let weighted = block.y.iter().zip(&effects[range]).zip(&block.root_weight);
        weighted.map(|((y, effect), weight)| if *weight > 0.0 { (y - effect) / weight } else { 0.0 }).collect()
    });
    let mut found = Vec::new();
    for (run, present) in runs.iter().zip(present) {
        let rate: Option<Vec<f64>> = if present { rates.next() } else { None };
        found.push(rate.map_or_else(Recording::default, |rate| recording(run, rate, names, bad_references)));
    }
    found
}

fn recording(run: &RunData, rate_deg_h: Vec<f64>, names: &[String], bad_references: &[String]) -> Recording {
    let reference_deg = run.reference_deg.filter(|_| !bad_references.contains(&run.file));
    Recording {
        north_deg_h: run.earth.north_deg_h,
        t_s: run.cells.iter().map(|cell| cell.t_s).collect(),
        interval_s: run.cells.iter().map(|cell| cell.seconds).collect(),
        dwell: run.cells.iter().map(|cell| cell.stay).collect(),
        moving: run.cells.iter().map(|cell| cell.moving).collect(),
        enters: run.cells.iter().map(|cell| run.enters(cell)).collect(),
        design: run.cells.iter().map(|cell| [cell.cos, cell.sin]).collect(),
        rate_deg_h,
        tilt_g: run.cells.iter().map(|cell| cell.level.map(|level| [level.forward, level.left])).collect(),
        channels: names.iter().map(|name| run.channel(name).unwrap_or_default()).collect(),
        reference: reference_deg
            .map(|deg| Reference { azimuth_rad: deg * RAD_PER_DEG, sigma_rad: run.reference_sigma_deg * RAD_PER_DEG }),
        rotation: run.rotation,
    }
}
