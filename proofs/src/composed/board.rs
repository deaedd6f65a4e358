//! Effects of what a board measures by itself, hidden in runs that the firmware records: for the loop with the firmware.

use super::channel::{Channel, Course};
use super::effect::{Effect, Port};
use super::oracle::{self, Reported};
use super::plan::{Move, Plan, RunPlan};
use super::record::{Row, spreads};
use super::{compose, record, size};
use crate::hidden::draw::Draw;

/// The index turns in a second in which it changes by more than this, degrees.
const TURNING_DEG: f64 = 0.1;
/// Encoders of runs that took the same course agree to this, degrees.
const SAME_INDEX_DEG: f64 = 0.1;

/// A run of an instrument, as its firmware records it.
pub struct Recorded {
    pub is_fit: bool,
    pub azimuth_deg: f64,
    /// Pitch and roll, rad.
    pub tilt_rad: [f64; 2],
    /// Standard deviation of what the survey says, degrees; it is exact here.
    pub survey_sigma_deg: f64,
    pub seconds: Vec<Second>,
}

/// A second that was recorded: the row, with the gyro's temperature as its channel, and whether it belongs to a dwell.
#[derive(Clone)]
pub struct Second {
    pub row: Row,
    pub is_of_dwell: bool,
}

/// An instrument of which these are the runs.
#[derive(Clone)]
pub struct Instrument {
    plan: Plan,
    spreads: Vec<[f64; 2]>,
}

impl Instrument {
    /// Of an instrument at this latitude, with this angle random walk of its gyro, °/√h.
    pub fn new(draw: &mut Draw, latitude_deg: f64, arw_deg_per_sqrt_h: f64, runs: &[Recorded]) -> Self {
        let plan = Plan {
            latitude_deg,
            arw_deg_per_sqrt_h,
            scale_ppm: 0.0,
            encoder_noise_deg: 0.0,
            level_noise_g: Some(level_noise_g(runs)),
            has_temperature: true,
            has_started: false,
            channels: Channel::several(draw, true, 1),
            runs: runs.iter().map(planned).collect(),
        };
        Self { spreads: spreads(&plan), plan }
    }

    /// So many effects, composed at random; `None` where this draw makes none of a strength that anyone would look at.
    pub fn compose(&self, draw: &mut Draw, count: usize) -> Option<Vec<Effect>> {
        let effects = (0..count).map(|_| compose::effect(draw, &self.plan, false));
        let mut effects = effects.collect::<Option<Vec<_>>>()?;
        size(draw, &self.plan, &mut effects, &self.spreads)?;
        Some(effects)
    }

    /// What the effects do at their ports in a run, in their units, by the second.
    pub fn courses(&self, effects: &[Effect], run: usize) -> Vec<(Port, Vec<f64>)> {
        record::courses(&self.plan, run, effects, &self.spreads)
    }

    /// The same with this run in the course that it took.
    pub fn in_course(mut self, run: usize, recorded: &Recorded) -> Self {
        self.plan.runs[run] = planned(recorded);
        self
    }

    /// Whether a run has the same course as by another one: the same seconds in the same dwells, at the same index angles.
    pub fn has_course_of(&self, other: &Self, run: usize) -> bool {
        let [own, other] = [self, other].map(|instrument| &instrument.plan.runs[run]);
        let mut apart = own.index_deg.iter().zip(&other.index_deg).zip(&own.rests);
        let is_same = |((own_deg, other_deg), rests): ((&f64, &f64), &bool)| {
            !rests || (own_deg - other_deg).abs() < SAME_INDEX_DEG
        };
        own.rests == other.rests && apart.all(is_same)
    }

    /// What the oracle says of the runs that are not learned from, by the rows with the effects in them.
    pub fn oracle(&self, effects: &[Effect], rows: &[Vec<Row>]) -> Option<Vec<Option<Reported>>> {
        Some(oracle::consult(&self.plan, effects, &self.spreads, rows)?.0)
    }

    /// The effects in words with all constants.
    pub fn describe(&self, effects: &[Effect]) -> Vec<String> {
        effects.iter().map(|effect| effect.describe(&self.plan)).collect()
    }
}

/// The course of a run, as it was recorded.
fn planned(run: &Recorded) -> RunPlan {
    let index_deg: Vec<f64> = run.seconds.iter().map(|second| second.row.index_deg).collect();
    let channel: Vec<f64> = run.seconds.iter().map(|second| second.row.channels[0]).collect();
    RunPlan {
        seed: 0,
        is_fit: run.is_fit,
        azimuth_deg: run.azimuth_deg,
        reference_deg: Some((run.azimuth_deg, run.survey_sigma_deg)),
        bias_deg_h: 0.0,
        tilt_rad: run.tilt_rad,
        started_s: 0,
        rest_s: 0.0,
        moves: moves(&index_deg),
        index_deg,
        rests: run.seconds.iter().map(|second| second.is_of_dwell).collect(),
        courses: vec![Course { truth: channel.clone(), reading: channel }],
    }
}

/// The moves by the index angle of every second.
fn moves(index_deg: &[f64]) -> Vec<Move> {
    let turns = |second: usize| (index_deg[second] - index_deg[second - 1]).abs() > TURNING_DEG;
    let mut moves = Vec::new();
    let mut second = 1;
    while second < index_deg.len() {
        let end = (second..index_deg.len()).find(|&at| !turns(at)).unwrap_or(index_deg.len());
        if end > second {
            // The last second that differs from the one before may have come to rest within itself.
            moves.push(Move { end_s: end, travel_deg: index_deg[end - 1] - index_deg[second - 1] });
        }
        second = end + 1;
    }
    moves
}

/// Standard deviation of a second's level reading, g, by what neighbours in dwells differ by.
fn level_noise_g(runs: &[Recorded]) -> f64 {
    let of = |run: &Recorded| {
        let pairs = run.seconds.windows(2).filter(|pair| pair.iter().all(|second| second.is_of_dwell));
        pairs.map(|pair| (pair[1].row.level_g[0] - pair[0].row.level_g[0]).powi(2)).collect::<Vec<_>>()
    };
    let squares: Vec<f64> = runs.iter().flat_map(of).collect();
    (squares.iter().sum::<f64>() / (2.0 * squares.len().max(1) as f64)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At rest for two seconds, 90° within three, of which the last ends at rest, and 45° back within one.
    #[test]
    fn moves_by_hand() {
        let index_deg = [0.0, 0.001, 20.0, 70.0, 90.0, 90.001, 90.0, 45.0, 45.0];
        let found: Vec<(usize, f64)> =
            moves(&index_deg).iter().map(|one| (one.end_s, one.travel_deg.round())).collect();
        assert_eq!(found, [(5, 90.0), (8, -45.0)]);
    }
}
