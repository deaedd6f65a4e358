//! Samples to the rows of one run.

use north_finder::sensing::level::Specific;
use north_finder::units::{sin_cos_deg, wrap_180_deg};

use super::map::{Index, Map};
use super::sample::Sample;
use super::windows::Window;
use crate::campaign::{Layout, Row, RunWriter};
use crate::file_error::FileError;

/// Significant digits that are written, and decimals (of seconds, degrees, arcsec, g): no sensor has so many, and what lies
/// beyond comes from the arithmetic.
const DIGITS: i32 = 12;
/// Decimals of a channel, whose unit is not known: up to this one, powers of ten are exact.
const CHANNEL_DECIMALS: i32 = 22;

/// Writes a run, gathering samples to rows.
pub struct Rows<'a> {
    map: &'a Map,
    start_s: f64,
    writer: RunWriter,
    gathered: Gathered,
    rows: u64,
    end_s: f64,
}

/// Samples on their way to a row.
#[derive(Clone, Debug, Default)]
struct Gathered {
    good: u64,
    lost: u64,
    end_s: f64,
    /// Which of the virtual index's angles.
    place: usize,
    arcsec: f64,
    first_deg: f64,
    /// Sum of the ways from the first angle.
    way_deg: f64,
    level: Specific,
    temp_c: f64,
    channels: Vec<f64>,
}

impl<'a> Rows<'a> {
    pub fn new(map: &'a Map, window: &Window, writer: RunWriter) -> Self {
        Self { map, start_s: window.start_s, writer, gathered: Gathered::default(), rows: 0, end_s: 0.0 }
    }

    /// The columns of every run.
    pub fn layout(map: &Map, counts_losses: bool) -> Layout {
        Layout {
            temperature: map.temperature.is_some(),
            level: map.accelerometer.is_some(),
            level_temperature: false,
            lost_frames: counts_losses,
            own: None,
            extra: map.channels.iter().map(|channel| channel.name.get_ref().clone()).collect(),
        }
    }

    /// Takes a sample of this run.
    pub fn push(&mut self, sample: &Sample) -> Result<(), FileError> {
        let into_s = sample.end_s - 0.5 * sample.interval_s - self.start_s;
        let (place, arcsec) = match &self.map.index {
            Index::Measured { .. } | Index::Placed => (0, sample.gyro_arcsec[0]),
            Index::Virtual { angles_deg, dwell_s } => {
                let place = ((into_s / dwell_s).max(0.0) as usize).min(angles_deg.len() - 1);
                let (sin, cos) = sin_cos(angles_deg[place]);
                let [forward, left, _] = sample.gyro_arcsec;
                (place, cos * forward + sin * left)
            }
        };
        if self.gathered.good > 0 && place != self.gathered.place {
            self.end_row()?;
        }
        let lost = self.lost_in_run(sample);
        self.gathered.push(sample, lost, place, arcsec);
        self.gathered.end_s = sample.end_s - self.start_s;
        if self.gathered.good.saturating_add(self.gathered.lost) >= self.map.samples_per_row.into() {
            self.end_row()?;
        }
        Ok(())
    }

    /// Samples that are missing before this one: no more than there is room for since the run's last sample, or its beginning.
    fn lost_in_run(&self, sample: &Sample) -> u64 {
        let since_s = sample.end_s - self.start_s - self.gathered.end_s.max(self.end_s);
        let room = (since_s / sample.interval_s).round() - 1.0;
        sample.lost.min(room.max(0.0) as u64)
    }

    /// Brings everything to the disk: how many rows there are, and when the last one ends.
    pub fn finish(mut self) -> Result<(u64, f64), FileError> {
        self.end_position()?;
        self.writer.finish()?;
        Ok((self.rows, self.end_s))
    }

    /// Ends the row that is being gathered: what comes next was recorded at another angle.
    pub fn end_position(&mut self) -> Result<(), FileError> {
        if self.gathered.good > 0 { self.end_row() } else { Ok(()) }
    }

    fn end_row(&mut self) -> Result<(), FileError> {
        let gathered = std::mem::take(&mut self.gathered);
        let good = gathered.good as f64;
        let index_deg = match &self.map.index {
            Index::Measured { .. } | Index::Placed => gathered.first_deg + gathered.way_deg / good,
            Index::Virtual { angles_deg, .. } => angles_deg.get(gathered.place).copied().unwrap_or_default(),
        };
        let t_s = to_digits(gathered.end_s);
        // Missing increments are taken for the mean of those that came; the count says so to whoever reads the row.
        let arcsec = gathered.arcsec * (good + gathered.lost as f64) / good;
        self.writer.write(&Row {
            t_s,
            interval_s: t_s - self.end_s,
            index_deg: to_digits(index_deg),
            fog_arcsec: to_digits(arcsec),
            temp_c: self.map.temperature.as_ref().map(|_| to_digits(gathered.temp_c / good)),
            level: self.map.accelerometer.as_ref().map(|_| Specific {
                forward: to_digits(gathered.level.forward / good),
                left: to_digits(gathered.level.left / good),
            }),
            level_temp_c: None,
            lost_frames: u16::try_from(gathered.lost).unwrap_or(u16::MAX),
            own: None,
            extra: gathered.channels.iter().map(|sum| round(sum / good, CHANNEL_DECIMALS)).collect(),
        })?;
        self.rows += 1;
        self.end_s = t_s;
        Ok(())
    }
}

impl Gathered {
    fn push(&mut self, sample: &Sample, lost: u64, place: usize, arcsec: f64) {
        if self.good == 0 {
            self.first_deg = sample.index_deg;
            self.channels.resize(sample.channels.len(), 0.0);
        }
        self.good += 1;
        self.lost = self.lost.saturating_add(lost);
        self.place = place;
        self.arcsec += arcsec;
        self.way_deg += wrap_180_deg(sample.index_deg - self.first_deg);
        if let Some([forward, left, _]) = sample.acceleration_g {
            self.level.forward += forward;
            self.level.left += left;
        }
        self.temp_c += sample.temp_c.unwrap_or_default();
        for (sum, value) in self.channels.iter_mut().zip(&sample.channels) {
            *sum += value;
        }
    }
}

/// Sine and cosine, exact at the quarters of a turn.
fn sin_cos(angle_deg: f64) -> (f64, f64) {
    let (sin, cos) = sin_cos_deg(angle_deg);
    if angle_deg % 90.0 == 0.0 { (sin.round(), cos.round()) } else { (sin, cos) }
}

/// The value as it is written.
fn to_digits(value: f64) -> f64 {
    round(value, DIGITS)
}

/// The value with [`DIGITS`] significant digits, so that 18 counts of 0.1 are written 1.8; and no negative zero.
fn round(value: f64, most_decimals: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value + 0.0;
    }
    let decimals = (DIGITS - 1 - value.abs().log10().floor() as i32).min(most_decimals);
    if decimals < 0 {
        return value;
    }
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_of_the_arithmetic_are_not_written() {
        assert_eq!(to_digits(18.0 * 0.1).to_string(), "1.8");
        assert_eq!(to_digits(0.1 + 0.2).to_string(), "0.3");
        assert_eq!(to_digits(-0.0).to_string(), "0");
        assert_eq!(to_digits(123_456_789_012_345.0), 123_456_789_012_345.0);
        assert_eq!(round(-1.234_567_890_123_456e-9, CHANNEL_DECIMALS), -1.234_567_890_12e-9);
        assert_eq!(to_digits(0.1 + 0.2 - 0.3).to_string(), "0");
        assert!(to_digits(f64::NAN).is_nan());
    }

    #[test]
    fn quarters_are_exact() {
        assert_eq!(
            [-90.0, 0.0, 90.0, 180.0, 270.0, 720.0].map(sin_cos).map(|(sin, cos)| (sin as i8, cos as i8)),
            [(-1, 0), (0, 1), (1, 0), (0, -1), (-1, 0), (0, 1)]
        );
    }
}
