//! Straight lines over the time of a dwell, and the sums that they follow from.

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
    pub(in crate::fix) fn joined(&self, next: &Self, apart: &Apart) -> Self {
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
pub struct Apart {
    /// Share of the second one in their seconds.
    pub share: f64,
    /// Product of their seconds by the sum.
    pub weight: f64,
    /// From the mean time of the first to that of the second, seconds.
    pub time_s: f64,
    /// Weighted sums of squared times about the mean of each, s³.
    pub spreads: [f64; 2],
}

impl Apart {
    /// The same sum of both together.
    pub fn spread(&self) -> f64 {
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

/// Rows, sum of their weights, weighted sums of t and t², and of the squared steps of t from row to row.
#[derive(Clone, Copy, Debug, Default)]
pub struct TimeSums {
    pub rows: u16,
    pub seconds: f64,
    pub time: f64,
    pub squares: f64,
    pub steps: f64,
}

impl TimeSums {
    pub fn add(&mut self, weight: f64, t_s: f64, step_weight: f64, step_s: f64) {
        self.rows = self.rows.saturating_add(1);
        self.seconds += weight;
        self.time += weight * t_s;
        self.squares += weight * t_s * t_s;
        self.steps += step_weight * step_s * step_s;
    }

    /// Weighted sum of squared times about their mean; 0 of fewer than three rows.
    pub fn spread(&self) -> f64 {
        if self.rows < 3 { 0.0 } else { (self.squares - self.time * self.time / self.seconds).max(0.0) }
    }

    /// The line of a quantity that these times belong to.
    pub fn line(&self, sums: &LineSums) -> Line {
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
pub struct LineSums {
    pub x: f64,
    pub with_time: f64,
    pub squares: f64,
    /// Squared steps from row to row, and steps times those of t; a step weighs w1 w2/(w1 + w2).
    pub steps: f64,
    pub steps_with_time: f64,
    pub last: f64,
}

impl LineSums {
    pub fn add(&mut self, weight: f64, t_s: f64, step_weight: f64, step_s: f64, x: f64) {
        self.x += weight * x;
        self.with_time += weight * t_s * x;
        self.squares += weight * x * x;
        let step = x - self.last;
        self.steps += step_weight * step * step;
        self.steps_with_time += step_weight * step * step_s;
        self.last = x;
    }
}
