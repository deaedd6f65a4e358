//! What is supposed to have happened to the index while the instrument measured.

use super::dwell::DwellSummary;

/// A turn between two dwells, or within one, which then says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// End of the last dwell before it, and start of the first after it, seconds.
    pub before_s: f64,
    pub after_s: f64,
    /// By how much the azimuth grew, degrees.
    pub deg: f64,
}

impl Turn {
    /// This dwell was over when the turn came.
    pub fn is_after(&self, dwell: &DwellSummary) -> bool {
        dwell.end_s <= self.before_s
    }

    /// The turn was within this dwell.
    fn is_within(&self, dwell: &DwellSummary) -> bool {
        dwell.end_s > self.before_s && dwell.start_s < self.after_s
    }
}

/// What is supposed to have happened to the index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cause {
    /// Nothing, or the spindle moved, as it was read.
    Spindle,
    /// The encoder slipped on the spindle where its reading jumped while the motor stood: the gyro stayed where it was.
    Encoder,
    /// The instrument was turned on its base.
    Turned(Turn),
    /// The encoder slipped on the spindle in a move, by as much as the azimuth seems to have grown since.
    SlippedInMove(Turn),
}

impl Cause {
    /// What the index reading of a dwell is to be turned by, degrees.
    pub fn index_deg(&self, dwell: &DwellSummary) -> f64 {
        match self {
            Self::Encoder => -f64::from(dwell.slip_deg),
            // Reading θ, the axis is at θ − δ.
            Self::SlippedInMove(turn) if !turn.is_after(dwell) => -turn.deg,
            _ => 0.0,
        }
    }

    /// How much greater the azimuth is after what happened than it was at this dwell, degrees.
    pub fn azimuth_deg(&self, dwell: &DwellSummary) -> f64 {
        match self {
            Self::Turned(turn) if turn.is_after(dwell) => turn.deg,
            _ => 0.0,
        }
    }

    /// Whether it happened within this dwell, which then says nothing.
    pub fn spoils(&self, dwell: &DwellSummary) -> bool {
        matches!(self, Self::Turned(turn) if turn.is_within(dwell))
    }
}
