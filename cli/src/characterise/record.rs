//! A still recording: angle against time at an even interval.

use std::path::Path;

use north_finder::units::wrap_180_deg;
use serde::Serialize;

use crate::block_gate::{self, MOST_DEG_S};
use crate::campaign::RunReader;
use crate::file_error::{FileError, Place, Problem};

/// The index may show this much of the encoder's noise, degrees.
const REST_DEG: f64 = 0.5;
/// Rows may differ from the usual interval by this share of it: time stamps are rounded.
const UNEVEN: f64 = 0.25;
/// Fewer one-second rates say nothing of a gyro.
const LEAST_SECONDS: f64 = 60.0;
/// Increments are counts if each is a multiple of the smallest step within this share of the step.
const MULTIPLE: f64 = 1e-3;
/// With fewer increments on each count, a common divisor may be chance.
const LEAST_PER_COUNT: usize = 3;

/// What is left is no gyro's reading where it scatters by less, arcsec a row: the quietest ring lasers have 1e-8 in a millisecond …
const LEAST_SPAN_ARCSEC: f64 = 1e-12;
/// … or by less than this share of itself, the rounding of single precision.
const LEAST_SPAN: f64 = 1e-7;
/// More outliers than one row in so many are the gyro's own noise, and remain.
const ROWS_BY_OUTLIER: usize = 50;
/// So many lines of outliers are named.
const NAMED: usize = 10;

/// Angle at even steps, from 0 at the start: one more than there are rows.
#[derive(Clone, Debug)]
pub struct Record {
    pub interval_s: f64,
    pub angle_arcsec: Vec<f64>,
    pub outliers: Vec<Outlier>,
}

/// A row whose increment was replaced by the median of those around.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Outlier {
    pub line: u64,
    pub fog_arcsec: f64,
}

/// How many outliers were replaced, and where.
pub fn told(outliers: &[Outlier]) -> Option<String> {
    let rows = match outliers.len() {
        0 => return None,
        1 => "1 row is an outlier, replaced by the median of the rows around: ".to_owned(),
        rows => format!("{rows} rows are outliers, replaced by the median of the rows around: "),
    };
    let line = |Outlier { line, fog_arcsec }: &Outlier| format!("line {line}, fog_arcsec = {fog_arcsec:e}");
    let lines: Vec<String> = outliers.iter().take(NAMED).map(line).collect();
    let more = if outliers.len() > NAMED { "; ..." } else { "" };
    Some(format!("{rows}{}{more}", lines.join("; ")))
}

/// Reads a run whose index never moves.
///
/// Errors: as [`RunReader`]; the index moves; a gap or uneven rows; less than a minute; readings that no gyro gives, and are no outliers, or that
/// are all the same.
pub fn read(path: &Path) -> Result<Record, FileError> {
    let (mut increments, mut lines) = (Vec::new(), Vec::new());
    let (mut first, mut end_s, mut start_s) = (None, 0.0, 0.0);
    let mut reader = RunReader::open(path)?;
    while let Some(row) = reader.next() {
        let (row, line) = (row?, reader.line());
        let &mut (interval_s, index_deg) = first.get_or_insert_with(|| {
            start_s = row.t_s - row.interval_s;
            (row.interval_s, row.index_deg)
        });
        let refuse = |value: String, allowed: &str| {
            Err(FileError::new(path, Place::Line(line), Problem::not_allowed(value, allowed)))
        };
        let moved_deg = wrap_180_deg(row.index_deg - index_deg);
        if moved_deg.abs() > REST_DEG {
            return refuse(format!("index_deg = {}", row.index_deg), "a recording in which the index never moves");
        }
        if (row.interval_s - interval_s).abs() > UNEVEN * interval_s {
            let value = format!("an interval of {} s", row.interval_s);
            return refuse(value, &format!("rows without a gap, every {interval_s} s as the first"));
        }
        increments.push(row.fog_arcsec);
        lines.push(line);
        end_s = row.t_s;
    }
    let interval_s = (end_s - start_s) / increments.len() as f64;
    if end_s - start_s < LEAST_SECONDS {
        let value = format!("a recording of {} s", end_s - start_s);
        return Err(FileError::whole(path, Problem::not_allowed(value, format!("{LEAST_SECONDS} s and longer"))));
    }
    let outliers = gate(&mut increments, &lines);
    refuse_impossible(path, &increments, &lines, interval_s)?;
    refuse_same(path, &increments, &outliers)?;
    let mut angle_arcsec = vec![0.0];
    angle_arcsec.extend(increments.iter().scan(0.0, |angle, increment| {
        *angle += increment;
        Some(*angle)
    }));
    Ok(Record { interval_s, angle_arcsec, outliers })
}

/// Replaces outliers by the median of the rows around, as in a recording of a block.
fn gate(increments: &mut [f64], lines: &[u64]) -> Vec<Outlier> {
    let found = block_gate::outliers(increments);
    if found.len() * ROWS_BY_OUTLIER > increments.len() {
        return Vec::new();
    }
    let replace = |(row, median): (usize, f64)| Outlier {
        line: lines[row],
        fog_arcsec: std::mem::replace(&mut increments[row], median),
    };
    found.into_iter().map(replace).collect()
}

fn refuse_impossible(path: &Path, increments: &[f64], lines: &[u64], interval_s: f64) -> Result<(), FileError> {
    let most = MOST_DEG_S * 3600.0 * interval_s;
    let Some((value, line)) = increments.iter().zip(lines).find(|(value, _)| value.abs() > most) else { return Ok(()) };
    let allowed = format!(
        "-{most:e} to {most:e} in a row of {interval_s} s, for no gyro reads more than {MOST_DEG_S} deg/s; it is no outlier, as too many rows \
         are like it: the column is no gyro's, or not in arcsec"
    );
    Err(FileError::new(path, Place::Line(*line), Problem::not_allowed(format!("fog_arcsec = {value:e}"), allowed)))
}

fn refuse_same(path: &Path, increments: &[f64], outliers: &[Outlier]) -> Result<(), FileError> {
    let (least, most) = increments
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), &value| (least.min(value), most.max(value)));
    if most - least > LEAST_SPAN_ARCSEC.max(LEAST_SPAN * most.abs().max(least.abs())) {
        return Ok(());
    }
    let what = match most == least {
        true => format!("each fog_arcsec is {least}"),
        false => format!("all fog_arcsec are alike, from {least:e} to {most:e}, closer than any gyro's noise"),
    };
    let but = told(outliers).map(|told| format!(" ({told})")).unwrap_or_default();
    let problem = format!("{what}{but}: the gyro is stuck or not connected, or the column is not its reading");
    Err(FileError::whole(path, Problem::Syntax(problem)))
}

impl Record {
    pub fn seconds(&self) -> f64 {
        (self.angle_arcsec.len() - 1) as f64 * self.interval_s
    }

    /// Mean rates over one second (over a row, where rows are longer), °/h.
    pub fn one_second_rates_deg_h(&self) -> Vec<f64> {
        let rows = ((1.0 / self.interval_s).round() as usize).max(1);
        let ends: Vec<f64> = self.angle_arcsec.iter().step_by(rows).copied().collect();
        ends.windows(2).map(|pair| (pair[1] - pair[0]) / (rows as f64 * self.interval_s)).collect()
    }

    /// Smallest step between two increments, if all are multiples of it.
    pub fn quantum_arcsec(&self) -> Option<f64> {
        let mut increments: Vec<f64> = self.angle_arcsec.windows(2).map(|pair| pair[1] - pair[0]).collect();
        increments.sort_unstable_by(f64::total_cmp);
        let span = increments.last()? - increments.first()?;
        // Below this, two increments differ by the rounding of their sum.
        let rounding = 1e-9 * span.max(increments.last()?.abs());
        let steps = || increments.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > rounding);
        let quantum = steps().fold(f64::INFINITY, f64::min);
        let counts = steps().count() + 1;
        let multiples =
            steps().all(|step| (step / quantum - (step / quantum).round()).abs() < MULTIPLE * step / quantum);
        (quantum.is_finite() && multiples && increments.len() >= LEAST_PER_COUNT * counts).then_some(quantum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A still recording with these increments, a row a second. An empty line is none of data, but counts.
    fn recording(increments: impl Iterator<Item = f64>) -> Result<Record, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("still.csv");
        let rows: String = (1..).zip(increments).map(|(t_s, value)| format!("{t_s},0,{value:e}\n")).collect();
        std::fs::write(&path, format!("t_s,index_deg,fog_arcsec\n\n{rows}")).unwrap();
        read(&path).map_err(|error| error.to_string())
    }

    /// Noise of one arcsec, uniform, from the golden ratio.
    fn noise(row: u32) -> f64 {
        (f64::from(row) * 0.618_033_988_75).fract() - 0.5
    }

    #[test]
    fn a_stuck_gyro_is_refused_by_name_whatever_it_reads() {
        for (scale, says) in [(0.0, "each fog_arcsec is -3.1:"), (1e-8, "all fog_arcsec are alike")] {
            let error = recording((0..100).map(|row| -3.1 + scale * noise(row))).unwrap_err();
            assert!(error.contains("still.csv") && error.contains(says), "{error}");
            assert!(error.contains("the gyro is stuck"), "{error}");
        }
        let tiny = recording((0..100).map(|row| 1e-300 * noise(row))).unwrap_err();
        assert!(tiny.contains("closer than any gyro's noise"), "{tiny}");
        // One count in a recording is no noise of a gyro either.
        let count = recording((0..100).map(|row| f64::from(u8::from(row == 50)))).unwrap_err();
        assert!(count.contains("each fog_arcsec is 0 (1 row is an outlier") && count.contains("line 53"), "{count}");
    }

    #[test]
    fn values_beyond_every_gyro_are_refused_by_their_line() {
        // 10,000 deg/s is 3.6e7 arcsec in a second. The first row stands on line 3.
        let error = recording((0..100).map(|row| 1e300 * noise(row))).unwrap_err();
        assert!(error.contains("line 3:") && error.contains("3.6e7"), "{error}");
        assert!(recording((0..100).map(|row| 6e7 * noise(row))).is_ok());
        assert!(recording((0..100).map(|row| 8e7 * noise(row))).unwrap_err().contains("is not allowed"));
    }

    #[test]
    fn an_outlier_is_replaced_and_named() {
        let clean = recording((0..300).map(noise)).unwrap();
        assert!(clean.outliers.is_empty());
        let with = recording((0..300).map(|row| if row == 150 { 1e20 } else { noise(row) })).unwrap();
        assert_eq!(with.outliers, [Outlier { line: 153, fog_arcsec: 1e20 }]);
        let told = told(&with.outliers).unwrap();
        assert!(told.contains("1 row is an outlier") && told.contains("line 153, fog_arcsec = 1e20"), "{told}");
        // The replaced row is within the noise, 0.5 arcsec; so is the sum of all.
        assert!((with.angle_arcsec[300] - clean.angle_arcsec[300]).abs() <= 1.0);
        // One row in fifty is the gyro's own: 7 of 300 remain.
        let own = recording((0..300).map(|row| if row % 43 == 20 { 100.0 } else { noise(row) })).unwrap();
        assert!(own.outliers.is_empty() && own.angle_arcsec[300] > 600.0);
    }
}
