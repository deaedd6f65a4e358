//! A stay at one index angle, boiled down to what the solution needs of it.

use heapless::Vec;

use crate::effects::BaseMotion;
use crate::level::LevelMoments;

/// Most rows that are boiled down at once; a longer stay gives several summaries.
pub const MAX_ROWS: usize = 128;

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

/// Mean and linear trend of something over a stay, and the scatter about the line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    pub mean: f64,
    pub slope_per_s: f64,
    /// Weighted sum of squares about the line.
    pub scatter: f64,
    /// Half the weighted sum of squared differences of neighbours: in white noise as large as `scatter`, in noise that
    /// wanders smaller (von Neumann, Ann. Math. Stat. 12, 1941, p. 367).
    pub neighbours: f64,
}

/// What a stay says, or one interval of a continuous rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DwellSummary {
    /// Measuring time that counts, seconds.
    pub seconds: f64,
    /// Its weighted mean time, and its first and last moment, seconds.
    pub t_s: f64,
    pub start_s: f64,
    pub end_s: f64,
    /// Weighted sum of squared times about the mean, s³: the weight of a slope.
    pub time_spread: f64,
    /// Mean cosine and sine of the index angle.
    pub cos: f64,
    pub sin: f64,
    /// Rate, °/h; its scatter in (°/h)² · s.
    pub rate: Line,
    /// Forward and left accelerometer, g.
    pub level: Option<[Line; 2]>,
    /// Rows that count, less the two that a line takes; 0 for fewer than three.
    pub freedom: u16,
    /// Rows left out because the rate jumped.
    pub knocked: u16,
    /// The index moved: not a stay, but an interval of a continuous rotation.
    pub moving: bool,
    /// The base's motion is already taken out of the rate.
    pub base_taken_out: bool,
}

/// Collects the rows of a stay.
#[derive(Clone, Debug, Default)]
pub struct DwellRows {
    rows: Vec<Row, MAX_ROWS>,
}

impl DwellRows {
    /// Takes a row; gives it back if there is no room.
    pub fn push(&mut self, row: Row) -> Result<(), Row> {
        self.rows.push(row)
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The row, if there is just one.
    pub fn only(&self) -> Option<&Row> {
        self.rows.first().filter(|_| self.rows.len() == 1)
    }

    pub fn clear(&mut self) {
        self.rows.clear();
    }

    /// Leaves out the first rows, up to where the rate begins to be quiet by the measure of the jitter gate: `seconds`
    /// changes in a row below `threshold_deg_h`. Where it never is, nothing is left out. Gives how many were.
    pub fn skip_jitter(&mut self, threshold_deg_h: f64, seconds: usize) -> Option<usize> {
        let changes = self.rows.windows(2).map(|pair| match pair {
            [a, b] => (b.rate_deg_h.abs() - a.rate_deg_h.abs()).abs() < threshold_deg_h,
            _ => false,
        });
        let mut quiet = 0;
        let mut first = None;
        for (i, still) in changes.enumerate() {
            quiet = if still { quiet + 1 } else { 0 };
            if quiet >= seconds {
                first = Some(i + 1 - quiet);
                break;
            }
        }
        let first = first?;
        self.rows = self.rows.iter().skip(first).copied().collect();
        Some(first)
    }

    /// Boils the rows down. Rows that lie further than six robust sigma from the median are left out as knocks; sigma is
    /// 1.4826 times the median absolute deviation, at least `noise_deg_h`, the declared noise of a one-second rate. In
    /// white noise one row in 5·10⁸ goes that way. `None` without rows.
    pub fn summary(&self, noise_deg_h: f64) -> Option<DwellSummary> {
        let median = median(self.rows.iter().map(|row| row.rate_deg_h))?;
        let deviation = median_deviation(&self.rows, median);
        let limit = 6.0 * (1.4826 * deviation).max(noise_deg_h).max(f64::MIN_POSITIVE);
        let kept = |row: &&Row| (row.rate_deg_h - median).abs() * libm::sqrt(row.seconds.min(1.0)) <= limit;

        let (mut seconds, mut t_s, mut cos, mut sin) = (0.0, 0.0, 0.0, 0.0);
        let (mut count, mut levels) = (0_u16, 0_u16);
        let (mut start_s, mut end_s) = (f64::INFINITY, f64::NEG_INFINITY);
        for row in self.rows.iter().filter(kept) {
            seconds += row.seconds;
            t_s += row.seconds * row.t_s;
            cos += row.seconds * row.cos;
            sin += row.seconds * row.sin;
            count += 1;
            levels += u16::from(row.level.is_some());
            start_s = start_s.min(row.t_s - 0.5 * row.seconds);
            end_s = end_s.max(row.t_s + 0.5 * row.seconds);
        }
        if count == 0 || seconds <= 0.0 {
            return None;
        }
        let t_s = t_s / seconds;
        let time_spread: f64 =
            self.rows.iter().filter(kept).map(|row| row.seconds * (row.t_s - t_s) * (row.t_s - t_s)).sum();
        let line = |value: fn(&Row) -> f64| {
            let weighted = || self.rows.iter().filter(kept).map(|row| (row.seconds, row.t_s - t_s, value(row)));
            let mean = weighted().map(|(weight, _, value)| weight * value).sum::<f64>() / seconds;
            let with_time: f64 = weighted().map(|(weight, t, value)| weight * t * (value - mean)).sum();
            let slope_per_s = if count >= 3 && time_spread > 0.0 { with_time / time_spread } else { 0.0 };
            let (mut scatter, mut neighbours, mut last) = (0.0, 0.0, None);
            for (weight, t, value) in weighted() {
                let residual = value - mean - slope_per_s * t;
                scatter += weight * residual * residual;
                if let Some((last_weight, last_residual)) = last.replace((weight, residual)) {
                    let difference: f64 = residual - last_residual;
                    neighbours += difference * difference * weight * last_weight / (weight + last_weight);
                }
            }
            Line { mean, slope_per_s, scatter, neighbours }
        };
        Some(DwellSummary {
            seconds,
            t_s,
            start_s,
            end_s,
            time_spread: if count >= 3 { time_spread } else { 0.0 },
            cos: cos / seconds,
            sin: sin / seconds,
            rate: line(|row| row.rate_deg_h),
            level: (levels == count).then(|| {
                [
                    line(|row| row.level.map_or(0.0, |level| level.mean.forward)),
                    line(|row| row.level.map_or(0.0, |level| level.mean.left)),
                ]
            }),
            freedom: count.saturating_sub(2),
            knocked: self.rows.len() as u16 - count,
            moving: false,
            base_taken_out: false,
        })
    }
}

impl DwellRows {
    /// Boils the rows of a stay on a base that rocks down to a rate without its motion; see [`super::moving_base`].
    pub fn summary_on_moving_base(&self, sensing: BaseMotion, noise_deg_h: f64) -> Option<DwellSummary> {
        super::moving_base::summary(&self.rows, sensing, noise_deg_h)
    }
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64, MAX_ROWS> = Vec::new();
    for value in values.filter(|value| value.is_finite()) {
        let _ = sorted.push(value);
    }
    sorted.sort_unstable_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    let lower = *sorted.get((sorted.len() - 1) / 2)?;
    Some(0.5 * (lower + upper))
}

fn median_deviation(rows: &[Row], centre: f64) -> f64 {
    median(rows.iter().map(|row| (row.rate_deg_h - centre).abs())).unwrap_or(0.0)
}

impl DwellSummary {
    /// One interval in which the index moved.
    pub fn moving(row: &Row) -> Self {
        let half_s = 0.5 * row.seconds;
        let still = |mean| Line { mean, ..Line::default() };
        Self {
            seconds: row.seconds,
            t_s: row.t_s,
            start_s: row.t_s - half_s,
            end_s: row.t_s + half_s,
            cos: row.cos,
            sin: row.sin,
            rate: still(row.rate_deg_h),
            level: row.level.map(|level| [still(level.mean.forward), still(level.mean.left)]),
            moving: true,
            ..Self::default()
        }
    }

    /// Standard deviation of the mean rate, °/h, from the scatter of the rows.
    pub fn sigma_deg_h(&self) -> f64 {
        if self.freedom == 0 {
            return f64::NAN;
        }
        libm::sqrt(self.rate.scatter / f64::from(self.freedom) / self.seconds)
    }

    /// Mean index angle, degrees in [0°, 360°).
    pub fn index_deg(&self) -> f64 {
        crate::units::wrap_360_deg(libm::atan2(self.sin, self.cos) * crate::units::DEG_PER_RAD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(second: u16, rate_deg_h: f64) -> Row {
        Row {
            t_s: f64::from(second) + 0.5,
            seconds: 1.0,
            cos: 0.0,
            sin: 1.0,
            rate_deg_h,
            moment_arcsec_s: 0.0,
            level: None,
        }
    }

    fn rows(rates: &[f64]) -> DwellRows {
        let mut rows = DwellRows::default();
        for (second, &rate) in (0..).zip(rates) {
            rows.push(row(second, rate)).unwrap();
        }
        rows
    }

    #[test]
    fn mean_slope_and_scatter_by_hand() {
        // 1, 2, 3, 6 at 0.5, 1.5, 2.5, 3.5: mean 3, slope (−1.5·−2 − 0.5·−1 + 0.5·0 + 1.5·3)/5 = 1.6; residuals
        // 0.4, −0.2, −0.8, 0.6 with sum of squares 1.2; differences −0.6, −0.6, 1.4, half their squares 1.34.
        let summary = rows(&[1.0, 2.0, 3.0, 6.0]).summary(1.0).unwrap();
        assert!((summary.rate.mean - 3.0).abs() < 1e-12);
        assert!((summary.rate.slope_per_s - 1.6).abs() < 1e-12);
        assert!((summary.rate.scatter - 1.2).abs() < 1e-12);
        assert!((summary.rate.neighbours - 1.34).abs() < 1e-12);
        assert_eq!((summary.freedom, summary.knocked, summary.seconds), (2, 0, 4.0));
        assert!((summary.sigma_deg_h() - libm::sqrt(1.2 / 2.0 / 4.0)).abs() < 1e-12);
        assert_eq!(summary.index_deg(), 90.0);
    }

    #[test]
    fn a_knock_is_left_out() {
        let summary = rows(&[1.0, 1.1, 0.9, 50.0, 1.0, 1.1, 0.9]).summary(0.1).unwrap();
        assert_eq!(summary.knocked, 1);
        assert!((summary.rate.mean - 1.0).abs() < 1e-12);
    }

    #[test]
    fn jitter_at_the_beginning_is_skipped() {
        let mut shaken = rows(&[9.0, 1.0, 9.0, 1.0, 1.1, 1.0, 1.1]);
        assert_eq!(shaken.skip_jitter(3.0, 3), Some(3));
        assert_eq!(shaken.len(), 4);
        assert_eq!(rows(&[9.0, 1.0, 9.0, 1.0]).skip_jitter(3.0, 3), None);
    }

    #[test]
    fn nothing_gives_nothing() {
        assert!(DwellRows::default().summary(1.0).is_none());
        assert!(rows(&[f64::NAN]).summary(1.0).is_none());
    }
}
