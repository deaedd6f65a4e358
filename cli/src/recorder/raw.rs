//! A fix as raw rows: one for each frame of the gyro, 400 a second.

use north_finder::calibration::ellipsoid::Correction;
use north_finder::frame::{Frame, FrameReader};
use north_finder::pipeline::Readings;
use north_finder::settings::GyroFormat;

use crate::campaign::Row;

/// Frames in a second.
const FRAMES_HZ: f64 = 400.0;
/// At the start, frames are put together until encoder and accelerometer have spoken, but not more than this many.
const PATIENCE: u64 = 100;

/// Collects what the gyro and the sensors say, tick by tick.
///
/// Encoder and accelerometer are read at 100 Hz; in between, their last readings stand in the rows. A row after lost or
/// invalid frames covers their time as well: its own increment, stretched, stands in for them, and it says how many.
#[derive(Clone, Debug)]
pub struct RawRecorder {
    reader: FrameReader,
    triad: Correction,
    modulus: u16,
    expected: Option<u8>,
    /// Frames so far, the lost ones as well.
    frames: u64,
    index_deg: Option<f64>,
    level_g: Option<[f64; 2]>,
    temp_c: Option<f64>,
    /// Since the last row: sum of good increments, number of good frames and of others.
    sum_arcsec: f64,
    good: u16,
    missing: u16,
    rows: Vec<Row>,
}

impl RawRecorder {
    /// For a gyro's frames, and with what turns the accelerometers' readings into specific force.
    pub fn new(format: GyroFormat, triad: Correction) -> Self {
        Self {
            reader: FrameReader::new(format),
            triad,
            modulus: format.sequence_modulus(),
            expected: None,
            frames: 0,
            index_deg: None,
            level_g: None,
            temp_c: None,
            sum_arcsec: 0.0,
            good: 0,
            missing: 0,
            rows: Vec::new(),
        }
    }

    /// Takes what one tick brought.
    pub fn see(&mut self, readings: &Readings, gyro_bytes: &[u8]) {
        if let Some(Some(acceleration_g)) = readings.acceleration_g {
            let [forward, left, _] = self.triad.apply(acceleration_g);
            self.level_g = Some([forward, left]);
        }
        if let Some(Some(index_deg)) = readings.index_deg {
            self.index_deg = Some(index_deg);
        }
        for &byte in gyro_bytes {
            if let Some(frame) = self.reader.push(byte) {
                self.frame(&frame);
            }
        }
    }

    /// The rows, the recorder done.
    pub fn into_rows(self) -> Vec<Row> {
        self.rows
    }

    fn frame(&mut self, frame: &Frame) {
        let expected = self.expected.unwrap_or(frame.sequence);
        let ahead = (u16::from(frame.sequence) + self.modulus - u16::from(expected)) % self.modulus;
        if ahead >= self.modulus / 2 {
            // Came twice, or after its successors.
            return;
        }
        self.expected = Some(((u16::from(frame.sequence) + 1) % self.modulus) as u8);
        self.frames += u64::from(ahead) + 1;
        self.missing = self.missing.saturating_add(ahead);
        self.temp_c = frame.temp_c.or(self.temp_c);
        if !frame.valid || frame.saturated {
            self.missing = self.missing.saturating_add(1);
            return;
        }
        self.sum_arcsec += frame.increment_arcsec;
        self.good += 1;
        if let Some(index_deg) = self.index_deg
            && (self.level_g.is_some() || self.frames > PATIENCE)
        {
            self.row(index_deg);
        }
    }

    fn row(&mut self, index_deg: f64) {
        let t_s = self.frames as f64 / FRAMES_HZ;
        let stretch = f64::from(self.good + self.missing) / f64::from(self.good);
        self.rows.push(Row {
            t_s,
            interval_s: t_s - self.rows.last().map_or(0.0, |row| row.t_s),
            index_deg,
            fog_arcsec: self.sum_arcsec * stretch,
            temp_c: self.temp_c,
            level_g: self.level_g,
            lost_frames: self.missing,
            extra: Vec::new(),
        });
        (self.sum_arcsec, self.good, self.missing) = (0.0, 0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorder(frames: &[Frame]) -> RawRecorder {
        let mut recorder = RawRecorder::new(GyroFormat::Compact, Correction::UNIT);
        recorder.index_deg = Some(90.0);
        recorder.level_g = Some([0.0, 0.0]);
        frames.iter().for_each(|frame| recorder.frame(frame));
        recorder
    }

    fn frame(sequence: u8, increment_arcsec: f64) -> Frame {
        Frame { sequence, increment_arcsec, temp_c: Some(20.0), valid: true, saturated: false }
    }

    #[test]
    fn a_lost_frame_is_covered_by_the_next_and_counted() {
        let recorder = recorder(&[frame(254, 1.0), frame(255, 2.0), frame(2, 3.0), frame(2, 9.0), frame(3, 4.0)]);
        let rows: Vec<_> = recorder.rows.iter().map(|row| (row.t_s, row.fog_arcsec, row.lost_frames)).collect();
        // Frames 0 and 1 are lost: the row at the fifth frame covers three.
        assert_eq!(rows, [(0.0025, 1.0, 0), (0.005, 2.0, 0), (0.0125, 9.0, 2), (0.015, 4.0, 0)]);
    }

    #[test]
    fn an_invalid_frame_counts_as_lost() {
        let invalid = Frame { valid: false, ..frame(1, 100.0) };
        let recorder = recorder(&[frame(0, 1.0), invalid, frame(2, 3.0)]);
        assert_eq!((recorder.rows[1].fog_arcsec, recorder.rows[1].lost_frames), (6.0, 1));
    }
}
