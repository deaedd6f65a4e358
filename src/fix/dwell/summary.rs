//! What a dwell says.

use super::line::{Apart, LevelLine, Line, Trend};
use super::row::{GAP_S, Row};
use super::temperature::Temperature;
use crate::effects::Carried;
use crate::fix::robust::Blocks;
use crate::sensing::level::Specific;

/// Cosine of the least index between two positions, 5°: the parts of a dwell, and dwells that follow each other at one index, are at one.
const SAME_POSITION: f64 = 0.996_194_698;

/// The robust mean of a dwell: the line of the values that stand for its rows, and how block means scatter, of the rates and of these values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Robust {
    pub line: Line,
    pub plain_blocks: Blocks,
    pub blocks: Blocks,
    /// Logarithm of the likelihood of heavy tails over that of normal ones.
    pub evidence: f32,
}

impl Robust {
    fn joined(&self, next: &Self, apart: &Apart) -> Self {
        Self {
            line: self.line.joined(&next.line, apart),
            plain_blocks: self.plain_blocks.joined(next.plain_blocks),
            blocks: self.blocks.joined(next.blocks),
            evidence: self.evidence + next.evidence,
        }
    }
}

/// A dwell whose first row is weighted by a ramp from nothing to one. The gyro of a drive that rings from its turn on stands off by an angle where the
/// dwell begins, and back at its middle where it ends: the plain mean rate has all of that angle. The ramp takes the mean angle of the first row
/// in the place of that at its beginning, which averages the ringing out, for half a row's measuring time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Eased {
    pub line: Line,
    /// How unevenly the gyro turned within the first row, and within all others together, (°/h)²: of each row 12 m²/T³ with m the first moment of its
    /// angle, the variance of a one-second rate where the noise is white.
    pub first: f32,
    pub others: f32,
}

impl Eased {
    /// With the part of the dwell that follows, of this rate.
    fn joined(&self, next: &DwellSummary, apart: &Apart) -> Self {
        let of_next = next.eased.map_or(0.0, |next| next.first + next.others);
        Self { line: self.line.joined(&next.rate, apart), others: self.others + of_next, ..*self }
    }
}

/// What a dwell says, or one interval of a continuous rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DwellSummary {
    /// Measuring time that counts, seconds.
    pub seconds: f64,
    /// Its weighted mean time, and its first and last moment, seconds.
    pub t_s: f64,
    pub start_s: f64,
    pub end_s: f64,
    /// Weighted sum of squared times about the mean, s³: the weight of a slope, to which a float's rounding is nothing.
    pub time_spread: f32,
    /// Mean cosine and sine of the index angle.
    pub cos: f64,
    pub sin: f64,
    /// By how much the index reading had jumped since the fix began while the motor stood, degrees. A float's rounding is below
    /// 1e-5° of any jump; a count of the encoder is 0.02°.
    pub slip_deg: f32,
    /// The move before it did not follow its steps: the encoder may have slipped in it.
    pub doubted: bool,
    /// Rate, °/h; its squares in (°/h)² · s.
    pub rate: Line,
    /// The same of a mean in which seconds far from the others weigh less; `None` where the rows cannot tell it.
    pub robust: Option<Robust>,
    /// The same of a mean into which the first row enters gradually; `None` of fewer than four rows.
    pub eased: Option<Eased>,
    /// Angle that the gyro turned, arcsec, from the mean angles of the rows: its slope is the mean rate for noise that is
    /// white in the angle. `None` where a gap or an outlier breaks it.
    pub angle: Option<Trend>,
    /// Forward and left accelerometer, g.
    pub level: Option<[LevelLine; 2]>,
    pub temperature: Temperature,
    /// Rows that count, less the two that a line takes; 0 for fewer than three.
    pub degrees_of_freedom: u16,
    /// Rows left out as outliers.
    pub outliers: u16,
    /// The index moved: not a dwell, but an interval of a continuous rotation.
    pub moving: bool,
    /// The base's motion is already taken out of the rate.
    pub base_taken_out: bool,
    /// What the error model leaves to the solution.
    pub carried: Carried,
}

impl DwellSummary {
    /// Whether the index stands where it stood in another dwell, or in another part of one.
    pub fn is_at_position_of(&self, other: &Self) -> bool {
        self.cos * other.cos + self.sin * other.sin >= SAME_POSITION
    }

    /// One interval in which the index moved.
    pub fn moving(row: &Row) -> Self {
        Self {
            seconds: row.seconds,
            t_s: row.t_s,
            start_s: row.start_s(),
            end_s: row.end_s(),
            cos: row.cos,
            sin: row.sin,
            rate: Line { mean: row.rate_deg_h, ..Line::default() },
            level: row.level.map(|level| [level.mean.forward, level.mean.left].map(LevelLine::still)),
            moving: true,
            ..Self::default()
        }
    }

    /// This part of a dwell and the one after it as one. The angle's line is lost, which would need the angle turned between them.
    pub fn joined(&self, next: &Self) -> Self {
        let seconds = self.seconds + next.seconds;
        let share = next.seconds / seconds;
        let apart = Apart {
            share,
            weight: self.seconds * share,
            time_s: next.t_s - self.t_s,
            spreads: [self.time_spread.into(), next.time_spread.into()],
        };
        let mix = |own: f64, other: f64| own + share * (other - own);
        let level = |own: LevelLine, other: LevelLine| Line::from(own).joined(&other.into(), &apart).into();
        let mut carried = self.carried;
        carried.mix(&next.carried, share as f32);
        Self {
            seconds,
            t_s: mix(self.t_s, next.t_s),
            end_s: next.end_s,
            time_spread: apart.spread() as f32,
            cos: mix(self.cos, next.cos),
            sin: mix(self.sin, next.sin),
            rate: self.rate.joined(&next.rate, &apart),
            robust: self.robust.zip(next.robust).map(|(own, other)| own.joined(&other, &apart)),
            eased: self.eased.map(|eased| eased.joined(next, &apart)),
            angle: None,
            level: self.level.zip(next.level).map(|([a, b], [c, d])| [level(a, c), level(b, d)]),
            temperature: self.temperature.joined(next.temperature, &apart),
            // Two lines take four rows' worth, one takes two.
            degrees_of_freedom: self.degrees_of_freedom.saturating_add(next.degrees_of_freedom).saturating_add(2),
            outliers: self.outliers.saturating_add(next.outliers),
            carried,
            ..*self
        }
    }

    /// Whether `next` is a further part of the same dwell: it begins where this one ends, and the index did not slip in between.
    pub fn goes_on_in(&self, next: &Self) -> bool {
        !self.moving && !next.moving && (next.start_s - self.end_s).abs() < GAP_S && self.slip_deg == next.slip_deg
    }

    /// Takes another interval of a continuous rotation in, of the same sector.
    pub(in crate::fix) fn merge(&mut self, other: &Self) {
        self.seconds += other.seconds;
        let share = other.seconds / self.seconds;
        let mix = |mean: &mut f64, value: f64| *mean += share * (value - *mean);
        mix(&mut self.t_s, other.t_s);
        mix(&mut self.cos, other.cos);
        mix(&mut self.sin, other.sin);
        mix(&mut self.rate.mean, other.rate.mean);
        (self.start_s, self.end_s) = (self.start_s.min(other.start_s), self.end_s.max(other.end_s));
        if let (Some(own), Some(others)) = (&mut self.level, &other.level) {
            for (own, other) in own.iter_mut().zip(others) {
                own.mean += share as f32 * (other.mean - own.mean);
            }
        }
        self.carried.mix(&other.carried, share as f32);
    }

    /// Standard deviation of the mean rate, °/h, from the scatter of the rows.
    pub fn sigma_deg_h(&self) -> f64 {
        if self.degrees_of_freedom == 0 {
            return f64::NAN;
        }
        libm::sqrt(f64::from(self.rate.residual_squares) / f64::from(self.degrees_of_freedom) / self.seconds)
    }

    /// Upward components of the instrument's axes; `None` without level accelerometers.
    pub fn specific(&self) -> Option<Specific> {
        self.level.map(|[forward, left]| Specific { forward: forward.mean.into(), left: left.mean.into() })
    }

    /// Mean index angle, degrees in [0°, 360°).
    pub fn index_deg(&self) -> f64 {
        crate::units::wrap_360_deg(libm::atan2(self.sin, self.cos) * crate::units::DEG_PER_RAD)
    }
}
