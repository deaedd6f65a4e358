//! Units of one type: the same effects in all of them, with weights that differ from one to the next.

use super::{Campaign, compose, plain, record, size};
use crate::hidden::draw::Draw;

/// A type of instrument.
pub struct Fleet {
    /// The first unit: what the type has, with its usual weights.
    first: Campaign,
    /// Mean and standard deviation of its channels, to which the effects' constants refer.
    spreads: Vec<[f64; 2]>,
    /// Standard deviation of a weight from unit to unit, as a share of the usual one.
    pub spread: f64,
    seed: u64,
}

/// How a unit stands to its type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// As the others.
    Usual,
    /// One effect is of the other sign, or two to four times as large.
    OwnWeight,
    /// It has one effect more.
    OwnEffect,
}

/// Smallest and greatest spread of a type.
const SPREADS: [f64; 2] = [0.1, 1.0 / 3.0];
/// Units of a type have streams of their own in the generator, which those of single campaigns do not reach.
const STREAM: u64 = 1 << 58;

impl Fleet {
    /// Draws a type of this kind.
    pub fn draw(seed: u64, number: u64, kind: super::Kind) -> Self {
        let first = Campaign::draw(seed, number, kind);
        let spread = Draw::new(seed, STREAM + number).uniform(SPREADS[0], SPREADS[1]);
        Self { spreads: record::spreads(&first.plan), first, spread, seed: seed.wrapping_add(number << 20) }
    }

    /// What the type has, in words.
    pub fn names(&self) -> Vec<String> {
        self.first.effects.iter().map(super::Effect::name).collect()
    }

    /// Draws a unit with so many runs that may be learned from, and such that are only judged.
    pub fn unit(&self, number: u64, fits: usize, checks: usize, kind: Kind) -> Campaign {
        (0..64)
            .find_map(|attempt| {
                self.attempt(&mut Draw::new(self.seed, STREAM + (number << 8) + attempt + 1), fits, checks, kind)
            })
            .expect("one of sixty-four draws can be sized")
    }

    fn attempt(&self, draw: &mut Draw, fits: usize, checks: usize, kind: Kind) -> Option<Campaign> {
        let mut plan = self.first.plan.clone();
        plan.scale_ppm = 300.0 * draw.normal();
        plan.runs.clear();
        plan.add_runs(draw, fits, checks);
        let mut effects = self.first.effects.clone();
        effects.iter_mut().for_each(|effect| effect.weight *= 1.0 + self.spread * draw.normal());
        match kind {
            Kind::Usual => {}
            Kind::OwnWeight => {
                let odd = draw.whole(0, effects.len().max(1) - 1);
                let factor = if draw.chance(0.5) { -draw.uniform(0.5, 2.0) } else { draw.uniform(2.0, 4.0) };
                effects.get_mut(odd)?.weight *= factor;
            }
            Kind::OwnEffect => {
                let mut own = vec![compose::effect(draw, &plan, false)?];
                size(draw, &plan, &mut own, &self.spreads)?;
                effects.extend(own);
            }
        }
        let rows: Vec<_> =
            (0..plan.runs.len()).map(|run| record::rows(&plan, run, &effects, &self.spreads, 1.0)).collect();
        let plain_deg = rows.iter().enumerate().map(|(run, rows)| plain::azimuth_deg(&plan, run, rows)).collect();
        let oracle = vec![None; rows.len()];
        Some(Campaign { kind: self.first.kind, effects, draws: 1, rows, plain_deg, oracle, plan })
    }
}
