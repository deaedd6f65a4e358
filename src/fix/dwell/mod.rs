//! A dwell at one index angle, boiled down to what the solution needs of it, in bounded memory.
//!
//! Every row enters sums from which mean, slope, residual sum of squares and autocorrelation follow at the end. Rows are
//! kept as well, for what needs them in their order ([`super::moving_base`]): as many as there is room for, then merged
//! with their neighbours in pairs, which is exact for means and first moments. So a dwell may last for hours.

mod line;
mod row;
mod summary;
mod sums;
mod temperature;
#[cfg(test)]
mod tests;

use core::ops::Range;

use heapless::Vec;

pub use line::{LevelLine, Line, Trend};
use row::longest_run;
pub use row::{MAX_ROWS, Row, longest_piece};
pub use summary::{DwellSummary, Eased, Robust};
pub use sums::Outliers;
use sums::Sums;
pub use temperature::Temperature;
use temperature::TemperatureSums;

/// Fewest places that merging must free; else longer rows are made.
const LEAST_FREE: usize = 16;

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
