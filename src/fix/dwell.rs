//! A dwell at one index angle, boiled down to what the solution needs of it, in bounded memory.
//!
//! Every row enters sums from which mean, slope, residual sum of squares and autocorrelation follow at the end. Rows are
//! kept as well, for what needs them in their order ([`super::moving_base`]): as many as there is room for, then merged
//! with their neighbours in pairs, which is exact for means and first moments. So a dwell may last for hours.

use core::ops::Range;

use heapless::Vec;

use super::robust::{BlockSums, Blocks, Tails};
use crate::bounded::bounded;
use crate::effects::Carried;
use crate::sensing::level::{LevelMoments, Specific};

/// Rows that are kept.
pub const MAX_ROWS: usize = 128;
/// Fewest places that merging must free; else longer rows are made.
const LEAST_FREE: usize = 16;
/// Times of outliers that are kept; of more it is known how many there were.
const MAX_OUTLIERS: usize = 16;
/// Rows belong together when the gap between them is below this, seconds.
const GAP_S: f64 = 0.01;
/// A row is an outlier beyond this many standard deviations: in white noise one in 5·10⁸.
const OUTLIER_SIGMAS: f64 = 6.0;
/// So many rows in a row show that nothing rings: of a ringing that is a second time in phase after one second or three, two may be near by chance.
const QUIET_ROWS: usize = 3;
/// Where rows are alike to this share of the declared noise, they are counts coarser than the noise.
const COARSE: f64 = 0.25;

/// Middles of rows that were left out as outliers, seconds: the first ones of a dwell.
pub type Outliers = Vec<f64, MAX_OUTLIERS>;

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
    fn start_s(&self) -> f64 {
        self.t_s - 0.5 * self.seconds
    }

    fn end_s(&self) -> f64 {
        self.t_s + 0.5 * self.seconds
    }

    /// How unevenly the gyro turned within it, (°/h)²: in white noise of the rate the variance of a one-second rate, which gives the first moment one of T³/12.
    fn unevenness(&self) -> f64 {
        12.0 * self.moment_arcsec_s * self.moment_arcsec_s / (self.seconds * self.seconds * self.seconds)
    }

    /// Mean rate from the mean angle of this row to that of the one that follows it, °/h.
    fn rate_to(&self, next: &Self) -> f64 {
        let to_end_arcsec = 0.5 * self.rate_deg_h * self.seconds + self.moment_arcsec_s / self.seconds;
        let from_start_arcsec = 0.5 * next.rate_deg_h * next.seconds - next.moment_arcsec_s / next.seconds;
        2.0 * (to_end_arcsec + from_start_arcsec) / (self.seconds + next.seconds)
    }

    /// Whether `next` begins where this one ends.
    pub(super) fn joins(&self, next: &Self) -> bool {
        next.start_s() - self.end_s() < GAP_S
    }

    /// This row and the one that follows it without a gap as one: exact for means and first moments.
    fn merged(&self, next: &Self) -> Self {
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

/// Mean and linear trend of something over a dwell, and how it scatters about the line. Sums of squares scatter by far more than a
/// float's rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    pub mean: f64,
    pub slope_per_s: f64,
    /// Weighted residual sum of squares about the line.
    pub residual_squares: f32,
    /// Half the weighted sum of squared differences of successive residuals: in white noise as large as
    /// `residual_squares`, smaller where successive rows are alike, larger where they alternate (von Neumann, Ann. Math.
    /// Stat. 12, 1941, p. 367).
    pub successive_squares: f32,
}

impl Line {
    /// The line through what two lines in a row stand for, but for the step between them. `apart`: how the two lie to each other.
    fn joined(&self, next: &Self, apart: &Apart) -> Self {
        let Apart { share, weight, time_s, spreads: [first, second] } = *apart;
        let step = next.mean - self.mean;
        let with_time = self.slope_per_s * first + next.slope_per_s * second + weight * time_s * step;
        let inside =
            |line: &Self, spread: f64| f64::from(line.residual_squares) + line.slope_per_s * line.slope_per_s * spread;
        let squares = inside(self, first) + inside(next, second) + weight * step * step;
        let spread = apart.spread();
        let slope_per_s = if spread > 0.0 { with_time / spread } else { 0.0 };
        Self {
            mean: self.mean + share * step,
            slope_per_s,
            residual_squares: (squares - slope_per_s * with_time).max(0.0) as f32,
            successive_squares: self.successive_squares + next.successive_squares,
        }
    }
}

/// How two parts of a dwell lie to each other in time.
struct Apart {
    /// Share of the second one in their seconds.
    share: f64,
    /// Product of their seconds by the sum.
    weight: f64,
    /// From the mean time of the first to that of the second, seconds.
    time_s: f64,
    /// Weighted sums of squared times about the mean of each, s³.
    spreads: [f64; 2],
}

impl Apart {
    /// The same sum of both together.
    fn spread(&self) -> f64 {
        self.spreads[0] + self.spreads[1] + self.weight * self.time_s * self.time_s
    }
}

/// A line without its mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trend {
    pub slope_per_s: f64,
    /// As those of a [`Line`].
    pub residual_squares: f32,
    pub successive_squares: f32,
}

impl From<Line> for Trend {
    fn from(Line { slope_per_s, residual_squares, successive_squares, .. }: Line) -> Self {
        Self { slope_per_s, residual_squares, successive_squares }
    }
}

/// A [`Line`] of a level accelerometer, all of it in floats. Their rounding, a share of 2⁻²⁵, is 0.001 arcsec of a tilt of 5°; the
/// accelerometer's noise is 5 arcsec in a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelLine {
    pub mean: f32,
    pub slope_per_s: f32,
    pub residual_squares: f32,
    pub successive_squares: f32,
}

impl LevelLine {
    /// Of one interval in which nothing but the mean is known.
    pub fn still(mean: f64) -> Self {
        Self { mean: mean as f32, ..Self::default() }
    }
}

impl From<LevelLine> for Line {
    fn from(LevelLine { mean, slope_per_s, residual_squares, successive_squares }: LevelLine) -> Self {
        Self { mean: mean.into(), slope_per_s: slope_per_s.into(), residual_squares, successive_squares }
    }
}

impl From<Line> for LevelLine {
    fn from(Line { mean, slope_per_s, residual_squares, successive_squares }: Line) -> Self {
        Self { mean: mean as f32, slope_per_s: slope_per_s as f32, residual_squares, successive_squares }
    }
}

/// The level accelerometers' temperature over a dwell, the gyro's where they have no thermometer, in floats: their rounding is 0.00003 K.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Temperature {
    /// Its mean; 0 where none was measured.
    pub kelvin: f32,
    pub kelvin_per_s: f32,
}

impl Temperature {
    fn joined(self, next: Self, apart: &Apart) -> Self {
        let line = |Self { kelvin, kelvin_per_s }| Line {
            mean: f64::from(kelvin),
            slope_per_s: f64::from(kelvin_per_s),
            ..Line::default()
        };
        let joined = line(self).joined(&line(next), apart);
        Self { kelvin: joined.mean as f32, kelvin_per_s: joined.slope_per_s as f32 }
    }
}

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

/// Gathers the rows of a dwell.
#[derive(Clone, Debug, Default)]
pub struct DwellRows {
    rows: Vec<Row, MAX_ROWS>,
    /// As many of the first rows are in the sums; the others wait to be judged.
    judged: usize,
    /// Rows are merged up to this length, seconds; 0 before there was a need.
    merged_s: f64,
    sums: Sums,
    temperature: TemperatureSums,
}

impl DwellRows {
    /// Takes the next row.
    pub fn push(&mut self, row: Row, noise_deg_h: f64) {
        if self.rows.is_full() {
            self.judge(noise_deg_h);
            self.make_room();
        }
        let _ = self.rows.push(row);
    }

    /// Takes the temperature of a second that has levels.
    pub fn push_temperature(&mut self, t_s: f64, temp_c: f64) {
        self.temperature.push(t_s, temp_c);
    }

    /// The rows, in the order of time, of a long dwell merged.
    pub fn as_slice(&self) -> &[Row] {
        &self.rows
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        // In place: another of its kind would take kilobytes of stack.
        self.rows.clear();
        self.sums = Sums::default();
        self.temperature = TemperatureSums::default();
        (self.judged, self.merged_s) = (0, 0.0);
    }

    /// Leaves out all rows but these.
    fn keep(&mut self, kept: Range<usize>) {
        for (to, from) in kept.clone().enumerate() {
            if let Some(&row) = self.rows.get(from)
                && let Some(place) = self.rows.get_mut(to)
            {
                *place = row;
            }
        }
        self.rows.truncate(kept.len());
    }

    /// Leaves out the first rows, up to where the rate begins to be quiet by the measure of the jitter gate: `seconds`
    /// changes in a row below `threshold_deg_h`. Where it never is, nothing is left out. For rows that
    /// are not merged. Gives how many were.
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
        self.keep(first..self.rows.len());
        Some(first)
    }

    /// Boils the rows down. `noise_deg_h`, the declared noise of a one-second rate, is the least scale by which outliers are
    /// judged. `None` without rows.
    pub fn summary(&mut self, noise_deg_h: f64) -> Option<DwellSummary> {
        self.judge(noise_deg_h);
        let summary = self.sums.summary()?;
        Some(DwellSummary { temperature: self.temperature.line(summary.t_s), ..summary })
    }

    /// Middles of the rows that were left out so far, seconds.
    pub fn outliers_s(&self) -> &Outliers {
        &self.sums.outliers_s
    }

    /// Takes the rows that wait into the sums, less the outliers.
    fn judge(&mut self, noise_deg_h: f64) {
        self.sums.add(self.rows.get(self.judged..).unwrap_or_default(), noise_deg_h);
        self.judged = self.rows.len();
    }

    /// Merges neighbours, to longer rows where that frees too little; if gaps are in the way of that, keeps the longest
    /// piece without one.
    fn make_room(&mut self) {
        let shortest_s = self.rows.iter().map(|row| row.seconds).fold(f64::INFINITY, f64::min);
        self.merged_s = self.merged_s.max(shortest_s);
        self.merge();
        for _ in 0..2 {
            if self.rows.len() + LEAST_FREE > MAX_ROWS {
                self.merged_s *= 2.0;
                self.merge();
            }
        }
        if self.rows.len() + LEAST_FREE > MAX_ROWS {
            let Range { start, end } = longest_run(&self.rows);
            self.keep(start..end.min(start + MAX_ROWS - LEAST_FREE));
        }
        self.judged = self.rows.len();
    }

    fn merge(&mut self) {
        let longest_s = 1.001 * self.merged_s;
        let mut merged: usize = 0;
        for i in 1..self.rows.len() {
            let Some(&row) = self.rows.get(i) else { break };
            let Some(place) = self.rows.get_mut(merged) else { break };
            if place.joins(&row) && place.seconds + row.seconds <= longest_s {
                *place = place.merged(&row);
                continue;
            }
            merged += 1;
            if let Some(place) = self.rows.get_mut(merged) {
                *place = row;
            }
        }
        self.rows.truncate(merged + 1);
    }
}

/// The longest run of rows without a gap.
pub fn longest_piece(rows: &[Row]) -> &[Row] {
    rows.get(longest_run(rows)).unwrap_or_default()
}

/// Where it is.
fn longest_run(rows: &[Row]) -> Range<usize> {
    let mut start = 0;
    let pieces = rows.chunk_by(|a, b| a.joins(b)).map(|piece| {
        let from = start;
        start += piece.len();
        (piece.iter().map(|row| row.seconds).sum::<f64>(), from..start)
    });
    pieces.max_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, run)| run).unwrap_or_default()
}

/// Sums over the rows of a dwell; times from the first row's middle, rates and levels from the first row's, so that no
/// digits are lost.
#[derive(Clone, Debug, Default)]
struct Sums {
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
    outliers_s: Outliers,
}

/// 0 °C, kelvin.
const FREEZING_K: f64 = 273.15;

/// Sums over the seconds of a dwell for the straight line of its temperature; times and temperatures from the first second's.
#[derive(Clone, Copy, Debug, Default)]
struct TemperatureSums {
    first_s: f64,
    first_c: f64,
    seconds: u16,
    time: f64,
    time_squares: f64,
    temperature: f64,
    with_time: f64,
}

impl TemperatureSums {
    fn push(&mut self, t_s: f64, temp_c: f64) {
        if self.seconds == 0 {
            (self.first_s, self.first_c) = (t_s, temp_c);
        }
        let (time_s, change_k) = (t_s - self.first_s, temp_c - self.first_c);
        self.seconds = self.seconds.saturating_add(1);
        self.time += time_s;
        self.time_squares += time_s * time_s;
        self.temperature += change_k;
        self.with_time += time_s * change_k;
    }

    /// The line at a time.
    fn line(&self, t_s: f64) -> Temperature {
        if self.seconds == 0 {
            return Temperature::default();
        }
        let seconds = f64::from(self.seconds);
        let (middle_s, mean_k) = (self.time / seconds, self.temperature / seconds);
        let spread = self.time_squares - self.time * middle_s;
        let kelvin_per_s = if spread > 0.0 { (self.with_time - self.time * mean_k) / spread } else { 0.0 };
        let kelvin = FREEZING_K + self.first_c + mean_k + kelvin_per_s * (t_s - self.first_s - middle_s);
        Temperature { kelvin: kelvin as f32, kelvin_per_s: kelvin_per_s as f32 }
    }
}

/// Rows, sum of their weights, weighted sums of t and t², and of the squared steps of t from row to row.
#[derive(Clone, Copy, Debug, Default)]
struct TimeSums {
    rows: u16,
    seconds: f64,
    time: f64,
    squares: f64,
    steps: f64,
}

impl TimeSums {
    fn add(&mut self, weight: f64, t_s: f64, step_weight: f64, step_s: f64) {
        self.rows = self.rows.saturating_add(1);
        self.seconds += weight;
        self.time += weight * t_s;
        self.squares += weight * t_s * t_s;
        self.steps += step_weight * step_s * step_s;
    }

    /// Weighted sum of squared times about their mean; 0 of fewer than three rows.
    fn spread(&self) -> f64 {
        if self.rows < 3 { 0.0 } else { (self.squares - self.time * self.time / self.seconds).max(0.0) }
    }

    /// The line of a quantity that these times belong to.
    fn line(&self, sums: &LineSums) -> Line {
        let mean = sums.x / self.seconds;
        let with_time = sums.with_time - self.time * mean;
        let spread = self.spread();
        let slope_per_s = if spread > 0.0 { with_time / spread } else { 0.0 };
        let residual_squares = sums.squares - sums.x * mean - slope_per_s * with_time;
        let successive_squares = sums.steps - slope_per_s * (2.0 * sums.steps_with_time - slope_per_s * self.steps);
        Line {
            mean,
            slope_per_s,
            residual_squares: residual_squares.max(0.0) as f32,
            successive_squares: successive_squares.max(0.0) as f32,
        }
    }
}

/// Weighted sums of a quantity x.
#[derive(Clone, Copy, Debug, Default)]
struct LineSums {
    x: f64,
    with_time: f64,
    squares: f64,
    /// Squared steps from row to row, and steps times those of t; a step weighs w1 w2/(w1 + w2).
    steps: f64,
    steps_with_time: f64,
    last: f64,
}

impl LineSums {
    fn add(&mut self, weight: f64, t_s: f64, step_weight: f64, step_s: f64, x: f64) {
        self.x += weight * x;
        self.with_time += weight * t_s * x;
        self.squares += weight * x * x;
        let step = x - self.last;
        self.steps += step_weight * step * step;
        self.steps_with_time += step_weight * step * step_s;
        self.last = x;
    }
}

impl Sums {
    /// Adds rows that were not judged yet, less those that are outliers: further from their median than [`OUTLIER_SIGMAS`] (before the first
    /// [`QUIET_ROWS`] that are not, by their mean angles as well) by the dwell's own scatter, 1.4826 times the median absolute deviation, never below
    /// the declared noise nor the scatter of the rows before. A gyro that counts more coarsely than its noise repeats itself, and the
    /// median deviation is nothing: then the least deviation that is more than noise, its count, is the scale. A second on
    /// the next count is no outlier.
    fn add(&mut self, rows: &[Row], noise_deg_h: f64) {
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

    fn summary(&self) -> Option<DwellSummary> {
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

/// Cosine of the least index between two positions, 5°: the parts of a dwell, and dwells that follow each other at one index, are at one.
const SAME_POSITION: f64 = 0.996_194_698;

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
    pub(super) fn merge(&mut self, other: &Self) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fix::tests::normal;

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
            rows.push(row(second, rate), 0.1);
        }
        rows
    }

    #[test]
    fn mean_slope_and_scatter_by_hand() {
        // 1, 2, 3, 6 at 0.5, 1.5, 2.5, 3.5: mean 3, slope (−1.5·−2 − 0.5·−1 + 0.5·0 + 1.5·3)/5 = 1.6; residuals
        // 0.4, −0.2, −0.8, 0.6 with sum of squares 1.2; differences −0.6, −0.6, 1.4, half their squares 1.34. The mean
        // angles of the seconds are 0.5, 2, 4.5, 9: their slope is (−1.5·0.5 − 0.5·2 + 0.5·4.5 + 1.5·9)/5 = 2.8.
        let summary = rows(&[1.0, 2.0, 3.0, 6.0]).summary(1.0).unwrap();
        assert!((summary.rate.mean - 3.0).abs() < 1e-12);
        assert!((summary.rate.slope_per_s - 1.6).abs() < 1e-12);
        assert!((summary.rate.residual_squares - 1.2).abs() < 1e-6);
        assert!((summary.rate.successive_squares - 1.34).abs() < 1e-6);
        assert!((summary.angle.unwrap().slope_per_s - 2.8).abs() < 1e-12);
        assert_eq!((summary.degrees_of_freedom, summary.outliers, summary.seconds), (2, 0, 4.0));
        assert!((summary.sigma_deg_h() - libm::sqrt(1.2 / 2.0 / 4.0)).abs() < 1e-7);
        assert_eq!(summary.index_deg(), 90.0);
    }

    #[test]
    fn a_shock_is_left_out() {
        let summary = rows(&[1.0, 1.1, 0.9, 50.0, 1.0, 1.1, 0.9]).summary(0.1).unwrap();
        assert_eq!((summary.outliers, summary.angle), (1, None));
        assert!((summary.rate.mean - 1.0).abs() < 1e-12);
    }

    /// 0.6 of 1 ± 0.1 in a second is off by four sigmas, as a mean of nine seconds by twelve.
    #[test]
    fn a_long_row_errs_less_than_a_second() {
        for (seconds, outliers) in [(1.0, 0), (9.0, 1)] {
            let mut dwell = rows(&[1.0, 1.1, 0.9, 1.0, 1.1, 0.9]);
            dwell.push(Row { t_s: 6.0 + 0.5 * seconds, seconds, ..row(6, 0.6) }, 0.1);
            assert_eq!(dwell.summary(0.1).unwrap().outliers, outliers, "{seconds}");
        }
    }

    /// A gyro of 0.09 °/h of noise in a second whose angle is counted in steps of 0.72 arcsec, and an Earth rate of a tenth
    /// of a count above a count: nine seconds in ten read the same. Not one is left out, and the mean is the rate to a
    /// count in the dwell's length; a true shock of twenty counts is still left out.
    #[test]
    fn a_second_on_the_next_count_is_no_shock() {
        let (count, rate_deg_h) = (0.72, 7.272);
        for shock in [0.0, 20.0 * count] {
            let (mut state, mut angle, mut counted) = (7, 0.0, 0.0);
            let mut rows = DwellRows::default();
            for second in 0..100 {
                angle += rate_deg_h + 0.09 * normal(&mut state);
                let reading = count * libm::round(angle / count);
                let shock = if second == 50 { shock } else { 0.0 };
                rows.push(row(second, reading - counted + shock), 0.09);
                counted = reading;
            }
            let summary = rows.summary(0.09).unwrap();
            assert_eq!(summary.outliers, u16::from(shock > 0.0));
            assert!((summary.rate.mean - rate_deg_h).abs() < 0.04, "{}", summary.rate.mean);
        }
    }

    /// A dwell of an hour and one of three, in their sums against the same by two passes over all rows, and its merged rows
    /// against the first moment of all.
    #[test]
    fn the_length_of_a_dwell_changes_nothing() {
        for length in [129_u16, 135, 3600, 10_800] {
            let mut state = 1;
            let mut dwell = DwellRows::default();
            let all: std::vec::Vec<Row> = (0..length)
                .map(|second| {
                    let x = normal(&mut state);
                    Row {
                        moment_arcsec_s: 0.1 * x,
                        level: LevelMoments::constant(1e-4 * x, -2e-4 * x),
                        ..row(second, 5.0 + 1e-4 * f64::from(second) + x)
                    }
                })
                .collect();
            all.iter().for_each(|row| dwell.push(*row, 1.0));
            let (number, middle_s) = (f64::from(length), 0.5 * f64::from(length));
            let mean = all.iter().map(|row| row.rate_deg_h).sum::<f64>() / number;
            let with_time: f64 = all.iter().map(|row| (row.t_s - middle_s) * row.rate_deg_h).sum();
            let spread: f64 = all.iter().map(|row| (row.t_s - middle_s) * (row.t_s - middle_s)).sum();
            let slope = with_time / spread;
            let residual = |row: &Row| row.rate_deg_h - mean - slope * (row.t_s - middle_s);
            let squares: f64 = all.iter().map(|row| residual(row) * residual(row)).sum();
            let steps: f64 = all.windows(2).map(|pair| 0.5 * (residual(&pair[1]) - residual(&pair[0])).powi(2)).sum();
            let summary = dwell.summary(1.0).unwrap();
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{length}: {a} {b}");
            close(summary.rate.mean, mean);
            close(1e3 * summary.rate.slope_per_s, 1e3 * slope);
            let rounded = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 1e-7 * b, "{length}: {a} {b}");
            rounded(summary.rate.residual_squares, squares);
            rounded(summary.rate.successive_squares, steps);
            assert_eq!((summary.degrees_of_freedom, summary.outliers, summary.seconds), (length - 2, 0, number));
            // First moments are kept as floats: every merging rounds them and their means once, by a share of 2⁻²⁴ at most, and rows of
            // three hours are merged eight times.
            let kept: std::vec::Vec<Row> = dwell.as_slice().to_vec();
            let rounding = |rows: &[Row], of: &dyn Fn(&Row) -> f64| {
                9.0 * 2.0_f64.powi(-24) * rows.iter().map(|row| of(row).abs()).sum::<f64>()
            };
            let compare = |of: &dyn Fn(&Row) -> f64, parts: [&dyn Fn(&Row) -> f64; 2]| {
                let sum = |rows: &[Row]| rows.iter().map(of).sum::<f64>();
                let allowed: f64 = parts.iter().map(|part| rounding(&kept, part)).sum();
                assert!((sum(&kept) - sum(&all)).abs() <= allowed, "{length}: {} {} {allowed}", sum(&kept), sum(&all));
            };
            let of_mean = |row: &Row, mean: f64| row.seconds * (row.t_s - middle_s) * mean;
            let left = |row: &Row| row.level.unwrap();
            compare(
                &|row| row.moment_arcsec_s + of_mean(row, row.rate_deg_h),
                [&|row| row.moment_arcsec_s, &|row| of_mean(row, row.rate_deg_h)],
            );
            compare(
                &|row| left(row).first.left + of_mean(row, left(row).mean.left),
                [&|row| left(row).first.left, &|row| of_mean(row, left(row).mean.left)],
            );
            assert!(longest_piece(dwell.as_slice()).len() == dwell.len() && dwell.len() > 48);
        }
    }

    #[test]
    fn gaps_everywhere_are_no_limit_either() {
        let mut dwell = DwellRows::default();
        (0..2000).for_each(|i| dwell.push(row(2 * i, f64::from(i % 3)), 1.0));
        let summary = dwell.summary(1.0).unwrap();
        assert_eq!((summary.seconds, summary.angle), (2000.0, None));
        assert!((summary.rate.mean - 1.0).abs() < 1e-3);
    }

    #[test]
    fn jitter_at_the_beginning_is_skipped() {
        let mut shaken = rows(&[9.0, 1.0, 9.0, 1.0, 1.1, 1.0, 1.1]);
        assert_eq!(shaken.skip_jitter(3.0, 3), Some(3));
        assert_eq!(shaken.len(), 4);
        assert_eq!(rows(&[9.0, 1.0, 9.0, 1.0]).skip_jitter(3.0, 3), None);
    }

    /// A dwell of forty seconds, and its parts of fifteen and twenty-five joined: what a line says is the same, but for the step between them.
    #[test]
    fn parts_joined_are_the_whole() {
        let mut state = 1;
        let all: std::vec::Vec<Row> = (0..40)
            .map(|second| {
                let x = normal(&mut state);
                let level = LevelMoments::constant(1e-3 * x, 2e-3 * f64::from(second));
                Row { level, moment_arcsec_s: 0.3 * x, ..row(second, 5.0 + 0.1 * f64::from(second) + x) }
            })
            .collect();
        let summary = |rows: &[Row]| {
            let mut dwell = DwellRows::default();
            for row in rows {
                dwell.push(*row, 1.0);
                dwell.push_temperature(row.t_s, 20.0 + 0.01 * row.t_s * row.t_s);
            }
            dwell.summary(1.0).unwrap()
        };
        let (whole, first, second) = (summary(&all), summary(&all[..15]), summary(&all[15..]));
        assert!(first.goes_on_in(&second) && !second.goes_on_in(&first));
        let joined = first.joined(&second);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-5 * b.abs().max(1e-3), "{a} {b}");
        close(joined.seconds, 40.0);
        close(joined.t_s, whole.t_s);
        close(joined.end_s, 40.0);
        close(joined.time_spread.into(), whole.time_spread.into());
        close(joined.rate.mean, whole.rate.mean);
        close(joined.rate.slope_per_s, whole.rate.slope_per_s);
        close(joined.rate.residual_squares.into(), whole.rate.residual_squares.into());
        let [of_joined, of_whole] = [joined, whole].map(|dwell| dwell.eased.unwrap());
        assert!((of_joined.line.mean - of_whole.line.mean).abs() < 0.02, "{of_joined:?} {of_whole:?}");
        close(of_joined.others.into(), of_whole.others.into());
        let [levels, of_whole] = [joined, whole].map(|dwell| dwell.level.unwrap()[1]);
        close(levels.mean.into(), of_whole.mean.into());
        close(levels.slope_per_s.into(), of_whole.slope_per_s.into());
        close(joined.temperature.kelvin.into(), whole.temperature.kelvin.into());
        close(joined.temperature.kelvin_per_s.into(), whole.temperature.kelvin_per_s.into());
        assert_eq!(joined.degrees_of_freedom, whole.degrees_of_freedom);
    }

    /// The rows of a gyro whose angle, arcsec, is this function of the time in seconds, read 400 times a second.
    fn rows_of_angle(seconds: u16, angle: impl Fn(f64) -> f64) -> DwellRows {
        let mut dwell = DwellRows::default();
        for second in 0..seconds {
            let turned = |i: i32| {
                let [from, to] = [i, i + 1].map(|i| angle(f64::from(second) + f64::from(i) / 400.0));
                (to - from, (f64::from(i) + 0.5) / 400.0 - 0.5)
            };
            let rate_deg_h = (0..400).map(|i| turned(i).0).sum();
            let moment_arcsec_s = (0..400).map(turned).map(|(turned, t_s)| turned * t_s).sum();
            dwell.push(Row { moment_arcsec_s, ..row(second, rate_deg_h) }, 1.0);
        }
        dwell
    }

    /// A gyro that turns by 3 °/h and 0.01 °/h more in every second, and a drive that rings by 1.7 arcsec at 5 Hz and forgets it in 5 s: it begins 1.7 arcsec
    /// off and ends at 1.7 e⁻⁶. The plain mean of 30 s has −1.7 (1 − e⁻⁶)/30 = −0.0565 °/h of that. The first row's mean angle has
    /// 1.7 · (1 − e⁻⁰·²)/(5 · ((10π)² + 0.04)) ≈ 6e-5 arcsec, and the end 0.004. The rows' slope has, by parts, 14.5 · 1.7 of the beginning less the sum
    /// of 1.7 e^(−k/5) at the ends of all seconds, 7.66: 17.0 over its weight 30³/12, 0.0076 °/h/s.
    #[test]
    fn a_ringing_at_the_beginning_is_eased() {
        let even = |t_s: f64| 3.0 * t_s + 0.005 * t_s * t_s;
        let ringing = |t_s: f64| 1.7 * libm::exp(-t_s / 5.0) * libm::cos(core::f64::consts::TAU * 5.0 * t_s);
        let rung = rows_of_angle(30, |t_s| even(t_s) + ringing(t_s)).summary(1.0).unwrap();
        let quiet = rows_of_angle(30, even).summary(1.0).unwrap();
        assert!((rung.rate.mean - quiet.rate.mean + 0.0565).abs() < 1e-4, "{:?}", rung.rate);
        assert!((rung.rate.slope_per_s - 0.01 - 0.0076).abs() < 1e-4, "{:?}", rung.rate);
        let eased = rung.eased.unwrap();
        // Half of the first second counts, and the mean time is (0.5 · 0.67 + 29 · 15.5)/29.5 = 15.25 s: 0.25 s of a slope of 0.01 are in the mean.
        assert!((eased.line.mean - quiet.eased.unwrap().line.mean).abs() < 2e-4, "{eased:?}");
        assert!((quiet.eased.unwrap().line.mean - quiet.rate.mean - 0.0025).abs() < 1e-4, "{:?}", quiet.eased);
        assert!((eased.line.slope_per_s - 0.01).abs() < 4e-4, "{eased:?}");
        assert!(eased.first > 10.0 * eased.others / 29.0, "{eased:?}");
        // Of nothing but an even rate all of it is what the plain line is.
        let still = rows_of_angle(30, |t_s| 3.0 * t_s).summary(1.0).unwrap().eased.unwrap();
        assert!((still.line.mean - 3.0).abs() < 1e-9 && still.line.slope_per_s.abs() < 1e-9, "{still:?}");
    }

    /// A ringing of 1.7 arcsec at 7.37 Hz makes seconds of up to ± 3 °/h, far beyond 6 · 0.09, and moves the mean angle of a second by 1.7/(π · 7.37) = 0.07
    /// arcsec at most: none is left out. A jump of 2 arcsec is left out wherever it is: in the middle of a second it moves the mean angle by half of it there.
    #[test]
    fn what_rings_at_the_beginning_is_no_shock() {
        let ringing = |t_s: f64| 1.7 * libm::exp(-t_s / 5.0) * libm::cos(core::f64::consts::TAU * 7.37 * t_s);
        // Without any noise the jump would be taken for a count of the gyro.
        let noise = |t_s: f64| 0.05 * libm::sin(1.3 * t_s * t_s);
        let outliers = |angle: &dyn Fn(f64) -> f64| {
            rows_of_angle(30, |t_s| angle(t_s) + noise(t_s)).summary(0.09).unwrap().outliers
        };
        assert_eq!(outliers(&|t_s| 3.0 * t_s + ringing(t_s)), 0);
        for jump_s in [0.5, 12.1, 20.9, 29.5] {
            assert_eq!(outliers(&|t_s| 3.0 * t_s + if t_s > jump_s { 2.0 } else { 0.0 }), 1, "{jump_s}");
        }
        assert_eq!(outliers(&|t_s| ringing(t_s) + if t_s > 20.5 { 2.0 } else { 0.0 }), 1);
        let mut of_nothing = rows(&[9.0, f64::NAN, 9.0, 1.0, 1.1, 0.9, 1.0, 1.1]);
        assert!(of_nothing.summary(0.09).unwrap().rate.mean < 1.1);
    }

    #[test]
    fn nothing_gives_nothing() {
        assert!(DwellRows::default().summary(1.0).is_none());
        assert!(rows(&[f64::NAN]).summary(1.0).is_none());
    }
}
