//! Sums over the rows of a dwell, less the outliers.

use heapless::Vec;

use super::line::{Line, LineSums, TimeSums};
use super::row::{MAX_ROWS, Row};
use super::summary::{DwellSummary, Eased, Robust};
use crate::bounded::bounded;
use crate::fix::robust::{BlockSums, Tails};

/// Times of outliers that are kept; of more it is known how many there were.
const MAX_OUTLIERS: usize = 16;
/// A row is an outlier beyond this many standard deviations: in white noise one in 5·10⁸.
const OUTLIER_SIGMAS: f64 = 6.0;
/// So many rows in a row show that nothing rings: of a ringing that is a second time in phase after one second or three, two may be near by chance.
const QUIET_ROWS: usize = 3;
/// Where rows are alike to this share of the declared noise, they are counts coarser than the noise.
const COARSE: f64 = 0.25;

/// Middles of rows that were left out as outliers, seconds: the first ones of a dwell.
pub type Outliers = Vec<f64, MAX_OUTLIERS>;

/// Sums over the rows of a dwell; times from the first row's middle, rates and levels from the first row's, so that no
/// digits are lost.
#[derive(Clone, Debug, Default)]
pub struct Sums {
    first: Option<Row>,
    last: Option<Row>,
    start_s: f64,
    times: TimeSums,
    cos: f64,
    sin: f64,
    rate: LineSums,
    /// The step from the first row to the second: its weight, of time, of the rate.
    first_step: [f64; 3],
    /// Of all rows but the first how unevenly the gyro turned within them, and the sum of their first moments.
    uneven: f64,
    moments_arcsec_s: f64,
    /// Of the values that stand for the rates in a robust mean; and blocks of both.
    robust: LineSums,
    plain_blocks: BlockSums,
    robust_blocks: BlockSums,
    evidence: f64,
    angle: LineSums,
    /// What the gyro turned since the beginning, less the first row's rate, arcsec; and whether a gap broke it.
    turned_arcsec: f64,
    broken: bool,
    /// So many rows one after the other were no outliers that nothing rings any more.
    quiet: bool,
    level: [LineSums; 2],
    level_rows: u16,
    outliers: u16,
    pub outliers_s: Outliers,
}

impl Sums {
    /// Adds rows that were not judged yet, less those that are outliers: further from their median than [`OUTLIER_SIGMAS`] (before the first
    /// [`QUIET_ROWS`] that are not, by their mean angles as well) by the dwell's own scatter, 1.4826 times the median absolute deviation, never below
    /// the declared noise nor the scatter of the rows before. A gyro that counts more coarsely than its noise repeats itself, and the
    /// median deviation is nothing: then the least deviation that is more than noise, its count, is the scale. A second on
    /// the next count is no outlier.
    pub fn add(&mut self, rows: &[Row], noise_deg_h: f64) {
        let Some(middle) = median(rows, |row| row.rate_deg_h) else { return };
        // A row that is longer than the others errs less: one behind missing rows, whose angle is not that of all its time, is an outlier.
        let usual_s = median(rows, |row| row.seconds).unwrap_or(1.0).max(1.0);
        let deviation = |row: &Row| (row.rate_deg_h - middle).abs() * libm::sqrt(row.seconds / usual_s);
        let of_rows = 1.4826 * median(rows, |row| (row.rate_deg_h - middle).abs()).unwrap_or(0.0);
        let mut scale = of_rows.max(noise_deg_h).max(self.scatter_deg_h());
        if of_rows <= COARSE * noise_deg_h {
            let count = rows.iter().map(deviation).filter(|&each| each > noise_deg_h).fold(f64::INFINITY, f64::min);
            if count.is_finite() {
                scale = scale.max(count);
            }
        }
        let is_near = |row: &Row| deviation(row) <= OUTLIER_SIGMAS * scale;
        // Of a drive that rings when the dwell begins the seconds differ, and their mean angles hardly do; a second in which the angle jumped is off from
        // the one before or the one after it by half of the jump at least.
        let quiet = rows.windows(QUIET_ROWS).position(|few| few.iter().all(is_near)).unwrap_or(rows.len());
        let may_ring = if self.quiet { 0 } else { quiet };
        self.quiet |= quiet < rows.len();
        let is_even = |row: &Row, next: &Row| (row.rate_to(next) - middle).abs() <= 0.5 * OUTLIER_SIGMAS * scale;
        let rings = |i: usize, row: &Row| {
            let last = i.checked_sub(1).and_then(|i| rows.get(i));
            i < may_ring
                && last.is_none_or(|last| is_even(last, row))
                && rows.get(i + 1).is_some_and(|next| is_even(row, next))
        };
        let is_kept = |(i, row): (usize, &Row)| is_near(row) || rings(i, row);
        let kept = || rows.iter().enumerate().filter(|&row| is_kept(row)).map(|(_, row)| (row.seconds, row.rate_deg_h));
        let tails = Tails::fit(kept, middle, of_rows);
        self.evidence += tails.as_ref().map_or(0.0, |tails| tails.evidence);
        for (i, row) in rows.iter().enumerate() {
            if is_kept((i, row)) {
                self.add_row(row, tails.as_ref());
            } else {
                self.outliers = self.outliers.saturating_add(1);
                let _ = self.outliers_s.push(row.t_s);
                self.broken = true;
            }
        }
    }

    /// Standard deviation of a one-second rate so far, °/h.
    fn scatter_deg_h(&self) -> f64 {
        if self.times.rows < 3 {
            0.0
        } else {
            libm::sqrt(f64::from(self.times.line(&self.rate).residual_squares) / f64::from(self.times.rows - 2))
        }
    }

    fn add_row(&mut self, row: &Row, tails: Option<&Tails>) {
        let first = *self.first.get_or_insert(*row);
        let t_s = row.t_s - first.t_s;
        let (step_weight, step_s) = match self.last {
            Some(last) => {
                self.broken |= !last.joins(row);
                (last.seconds * row.seconds / (last.seconds + row.seconds), row.t_s - last.t_s)
            }
            None => {
                self.start_s = row.start_s();
                (0.0, 0.0)
            }
        };
        self.last = Some(*row);
        let weight = row.seconds;
        self.times.add(weight, t_s, step_weight, step_s);
        self.cos += weight * row.cos;
        self.sin += weight * row.sin;
        let rate_deg_h = row.rate_deg_h - first.rate_deg_h;
        if self.times.rows == 2 {
            self.first_step = [step_weight, step_s, rate_deg_h];
        }
        if self.times.rows > 1 {
            self.uneven += row.unevenness();
            self.moments_arcsec_s += row.moment_arcsec_s;
        }
        self.rate.add(weight, t_s, step_weight, step_s, rate_deg_h);
        let robust_deg_h =
            tails.map_or(row.rate_deg_h, |tails| tails.value(row.seconds, row.rate_deg_h)) - first.rate_deg_h;
        self.robust.add(weight, t_s, step_weight, step_s, robust_deg_h);
        self.plain_blocks.add(weight, rate_deg_h);
        self.robust_blocks.add(weight, robust_deg_h);
        let turned_arcsec = rate_deg_h * row.seconds;
        let mean_arcsec = self.turned_arcsec + 0.5 * turned_arcsec - row.moment_arcsec_s / row.seconds;
        self.turned_arcsec += turned_arcsec;
        self.angle.add(weight, t_s, step_weight, step_s, mean_arcsec);
        if let (Some(level), Some(origin)) = (row.level, first.level) {
            let offsets = [level.mean.forward - origin.mean.forward, level.mean.left - origin.mean.left];
            for (sums, offset) in self.level.iter_mut().zip(offsets) {
                sums.add(weight, t_s, step_weight, step_s, offset);
            }
            self.level_rows = self.level_rows.saturating_add(1);
        }
    }

    /// The rate's line with the first row weighted by a ramp: its mean rate then is that from its mean angle to its end, and belongs to two thirds of it. It
    /// scatters as the other rows do.
    fn eased(&self) -> Option<Eased> {
        let first = self.first.filter(|_| self.times.rows > 3)?;
        // Times and rates count from the first row: it is nothing in the sums but its weight and the step to the next row.
        let (mut others, mut rate) = (self.times, self.rate);
        let [step_weight, step_s, step] = self.first_step;
        others.rows -= 1;
        others.seconds -= first.seconds;
        others.steps -= step_weight * step_s * step_s;
        rate.steps -= step_weight * step * step;
        rate.steps_with_time -= step_weight * step * step_s;
        let Line { residual_squares, successive_squares, .. } = others.line(&rate);
        let degrees_of_freedom = f32::from(others.rows - 2);
        let of_all = |squares: f32| squares * (degrees_of_freedom + 1.0) / degrees_of_freedom;

        let off_deg_h = 2.0 * first.moment_arcsec_s / (first.seconds * first.seconds);
        others.add(0.5 * first.seconds, first.seconds / 6.0, 0.0, 0.0);
        rate.add(0.5 * first.seconds, first.seconds / 6.0, 0.0, 0.0, off_deg_h);
        // Rates of whole rows alone have in their slope what rings with a period that divides the row.
        rate.with_time += self.moments_arcsec_s;
        let line = others.line(&rate);
        Some(Eased {
            line: Line {
                mean: line.mean + first.rate_deg_h,
                residual_squares: of_all(residual_squares),
                successive_squares: of_all(successive_squares),
                ..line
            },
            first: first.unevenness() as f32,
            others: self.uneven as f32,
        })
    }

    pub fn summary(&self) -> Option<DwellSummary> {
        let (first, last) = (self.first?, self.last?);
        let line = |sums: &LineSums, origin: f64| {
            let line = self.times.line(sums);
            Line { mean: line.mean + origin, ..line }
        };
        let angle = self.times.line(&self.angle);
        let seconds = self.times.seconds;
        Some(DwellSummary {
            seconds,
            t_s: first.t_s + self.times.time / seconds,
            start_s: self.start_s,
            end_s: last.end_s(),
            time_spread: self.times.spread() as f32,
            cos: self.cos / seconds,
            sin: self.sin / seconds,
            rate: line(&self.rate, first.rate_deg_h),
            robust: Some(Robust {
                line: line(&self.robust, first.rate_deg_h),
                plain_blocks: self.plain_blocks.blocks(),
                blocks: self.robust_blocks.blocks(),
                evidence: self.evidence as f32,
            }),
            eased: self.eased(),
            angle: (!self.broken && self.times.rows >= 3)
                .then_some(Line { slope_per_s: angle.slope_per_s + first.rate_deg_h, ..angle }.into()),
            level: first.level.filter(|_| self.level_rows == self.times.rows).map(|origin| {
                let [forward, left] = &self.level;
                [line(forward, origin.mean.forward).into(), line(left, origin.mean.left).into()]
            }),
            degrees_of_freedom: self.times.rows.saturating_sub(2),
            outliers: self.outliers,
            ..DwellSummary::default()
        })
    }
}

/// Middle of what `value` gives of the rows.
fn median(rows: &[Row], value: impl Fn(&Row) -> f64) -> Option<f64> {
    // A dwell has no more rows than there are places.
    let mut values: Vec<f64, MAX_ROWS> = bounded(rows.iter().map(value).filter(|value| value.is_finite()));
    quantities::median::median(&mut values)
}
