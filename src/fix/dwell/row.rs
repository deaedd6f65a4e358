//! One measuring interval of a dwell.

use core::ops::Range;

use crate::sensing::level::{LevelMoments, Specific};

/// Rows that are kept.
pub const MAX_ROWS: usize = 128;

/// Rows belong together when the gap between them is below this, seconds.
pub const GAP_S: f64 = 0.01;

/// One measuring interval with the gyro at rest on its spindle, usually a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Middle of the interval, seconds.
    pub t_s: f64,
    /// Length of the interval.
    pub seconds: f64,
    /// Mean cosine and sine of the index angle over the interval.
    pub cos: f64,
    pub sin: f64,
    /// Mean compensated rate, °/h.
    pub rate_deg_h: f64,
    /// First moment of the angle about the middle of the interval, ∫ (t − middle) · rate dt, arcsec · s: where in the
    /// interval the gyro turned.
    pub moment_arcsec_s: f64,
    /// Level accelerometers, if there are any.
    pub level: Option<LevelMoments>,
}

impl Row {
    pub(in crate::fix) fn start_s(&self) -> f64 {
        self.t_s - 0.5 * self.seconds
    }

    pub(in crate::fix) fn end_s(&self) -> f64 {
        self.t_s + 0.5 * self.seconds
    }

    /// How unevenly the gyro turned within it, (°/h)²: in white noise of the rate the variance of a one-second rate, which gives the first moment one of T³/12.
    pub(in crate::fix) fn unevenness(&self) -> f64 {
        12.0 * self.moment_arcsec_s * self.moment_arcsec_s / (self.seconds * self.seconds * self.seconds)
    }

    /// Mean rate from the mean angle of this row to that of the one that follows it, °/h.
    pub(in crate::fix) fn rate_to(&self, next: &Self) -> f64 {
        let to_end_arcsec = 0.5 * self.rate_deg_h * self.seconds + self.moment_arcsec_s / self.seconds;
        let from_start_arcsec = 0.5 * next.rate_deg_h * next.seconds - next.moment_arcsec_s / next.seconds;
        2.0 * (to_end_arcsec + from_start_arcsec) / (self.seconds + next.seconds)
    }

    /// Whether `next` begins where this one ends.
    pub(in crate::fix) fn joins(&self, next: &Self) -> bool {
        next.start_s() - self.end_s() < GAP_S
    }

    /// This row and the one that follows it without a gap as one: exact for means and first moments.
    pub(in crate::fix) fn merged(&self, next: &Self) -> Self {
        let seconds = self.seconds + next.seconds;
        let (first, second) = (self.seconds / seconds, next.seconds / seconds);
        let mean = |a: f64, b: f64| first * a + second * b;
        // About the common middle the halves' own middles lie half the other's length away.
        let apart = 0.5 * first * second * seconds * seconds;
        let moment = |own: f64, other: f64, a: f64, b: f64| own + other + apart * (b - a);
        let level = self.level.zip(next.level).map(|(a, b)| LevelMoments {
            mean: Specific { forward: mean(a.mean.forward, b.mean.forward), left: mean(a.mean.left, b.mean.left) },
            first: Specific {
                forward: moment(a.first.forward, b.first.forward, a.mean.forward, b.mean.forward),
                left: moment(a.first.left, b.first.left, a.mean.left, b.mean.left),
            },
        });
        Self {
            t_s: self.start_s() + 0.5 * seconds,
            seconds,
            cos: mean(self.cos, next.cos),
            sin: mean(self.sin, next.sin),
            rate_deg_h: mean(self.rate_deg_h, next.rate_deg_h),
            moment_arcsec_s: moment(self.moment_arcsec_s, next.moment_arcsec_s, self.rate_deg_h, next.rate_deg_h),
            level,
        }
    }
}

/// The longest run of rows without a gap.
pub fn longest_piece(rows: &[Row]) -> &[Row] {
    rows.get(longest_run(rows)).unwrap_or_default()
}

/// Where it is.
pub fn longest_run(rows: &[Row]) -> Range<usize> {
    let mut start = 0;
    let pieces = rows.chunk_by(|a, b| a.joins(b)).map(|piece| {
        let from = start;
        start += piece.len();
        (piece.iter().map(|row| row.seconds).sum::<f64>(), from..start)
    });
    pieces.max_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, run)| run).unwrap_or_default()
}
