//! Rows of 1 s (or any interval) without simulating 400 frames each: for campaigns of thousands of fixes.
//!
//! Attitude, base motion and gyro errors are those of the full plant, stepped by the row. What there is only within a
//! second (frames, bus, drive, gates) is left out; a move is a gap of some seconds without rows.

use crate::base::BaseMotion;
use crate::geometry;
use crate::gyro::{GyroErrors, Surroundings};
use crate::gyro_output::Quantizer;
use crate::noise::{Source, Stream};
use crate::pose::PoseTracker;
use crate::scenario::{Accelerometer, Base, Encoder, Gyro, Scenario, Site, Supply};

/// Rate at which the firmware reads encoder and accelerometers; a row holds the mean of these readings, Hz.
const READINGS_HZ: f64 = 100.0;

/// The parts of a scenario that rows depend on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SiteAndGyro {
    /// The place.
    pub site: Site,
    /// The base.
    pub base: Base,
    /// The supply voltage.
    pub supply: Supply,
    /// The gyro; its frame format, frame clock, full scale and faults are not used.
    pub gyro: Gyro,
    /// The accelerometer; faults are not used.
    pub accelerometer: Accelerometer,
    /// The encoder; faults and slip are not used.
    pub encoder: Encoder,
    /// While the index turns evenly, its angle is off by this, degrees rms, and forgets it from row to row.
    pub unevenness_deg: f64,
}

impl From<&Scenario> for SiteAndGyro {
    fn from(scenario: &Scenario) -> Self {
        Self {
            site: scenario.site.clone(),
            base: scenario.base.clone(),
            supply: scenario.supply.clone(),
            gyro: scenario.gyro.clone(),
            accelerometer: scenario.accelerometer.clone(),
            encoder: scenario.encoder.clone(),
            unevenness_deg: scenario.motor.unevenness_deg,
        }
    }
}

/// A dwell at an index angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dwell {
    /// Index angle, degrees counter-clockwise; the move to it is the difference from the one before.
    pub index_deg: f64,
    /// Time without rows before it, in which the index turns and settles, s.
    pub gap_s: f64,
    /// Time with rows, s; a part of an interval at the end is left out.
    pub seconds: f64,
}

/// One row of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// End of the interval, s.
    pub t_s: f64,
    /// Index angle by the encoder, mean over the interval, degrees.
    pub index_deg: f64,
    /// Gyro's angle increment over the interval, arcsec.
    pub fog_arcsec: f64,
    /// Gyro's temperature sensor, °C.
    pub temp_c: f64,
    /// Forward accelerometer, mean over the interval, g.
    pub ax_g: f64,
    /// Left accelerometer, mean over the interval, g.
    pub ay_g: f64,
}

/// Makes rows.
#[derive(Debug, Clone)]
pub struct SecondsGenerator {
    accelerometer: Accelerometer,
    encoder: Encoder,
    supply: Supply,
    vibration_g: f64,
    interval_s: f64,
    t_s: f64,
    base: BaseMotion,
    tracker: PoseTracker,
    errors: GyroErrors,
    quantizer: Quantizer,
    accelerometer_stream: Stream,
    encoder_stream: Stream,
    unevenness_deg: f64,
    drive_stream: Stream,
}

impl SecondsGenerator {
    /// An instrument at power-up, index at the mark; rows of 1 s. The same seed gives the same rows.
    pub fn new(world: &SiteAndGyro, seed: u64) -> Self {
        let base = BaseMotion::new(&world.base, world.site.azimuth_deg, seed);
        Self {
            accelerometer: world.accelerometer.clone(),
            encoder: world.encoder.clone(),
            supply: world.supply.clone(),
            vibration_g: world.base.vibration_g,
            interval_s: 1.0,
            t_s: 0.0,
            tracker: PoseTracker::new(world.site.latitude_deg, &world.gyro, base.angles(), 0.0),
            base,
            errors: GyroErrors::new(&world.gyro, &world.site, seed),
            quantizer: Quantizer::new(world.gyro.quantum_arcsec),
            accelerometer_stream: Stream::new(seed, Source::Accelerometer),
            encoder_stream: Stream::new(seed, Source::Encoder),
            unevenness_deg: world.unevenness_deg,
            drive_stream: Stream::new(seed, Source::Drive),
        }
    }

    /// Another interval for the rows, s; not shorter than a tick of 2.5 ms.
    pub fn with_interval_s(mut self, interval_s: f64) -> Self {
        self.interval_s = interval_s.max(0.0025);
        self
    }

    /// The rows of these dwells, one after the other. A later call goes on where this one ended.
    pub fn rows(&mut self, dwells: &[Dwell]) -> impl Iterator<Item = Row> {
        dwells.iter().flat_map(move |dwell| self.dwell(*dwell))
    }

    /// The rows of a turn, even but for the drive's unevenness, to another index angle; a part of an interval at the end is left out. Their index angles
    /// are means over the interval.
    pub fn turn(&mut self, to_deg: f64, seconds: f64) -> Vec<Row> {
        let from_deg = self.tracker.pose().index_deg;
        let rows = (seconds / self.interval_s + 1e-9) as u64;
        let step_deg = (to_deg - from_deg) / rows.max(1) as f64;
        (1..=rows)
            .map(|row| {
                let began_deg = self.tracker.pose().index_deg;
                let even_deg = if row == rows { to_deg } else { from_deg + step_deg * row as f64 };
                let uneven_deg =
                    if self.unevenness_deg > 0.0 { self.unevenness_deg * self.drive_stream.normal() } else { 0.0 };
                let mut row = self.row(even_deg + uneven_deg);
                row.index_deg -= 0.5 * (even_deg + uneven_deg - began_deg);
                row
            })
            .collect()
    }

    /// True azimuth of the mark now, degrees in 0 ..= 360.
    pub fn azimuth_deg(&self) -> f64 {
        let mark = self.tracker.pose().attitude * nalgebra::Vector3::x();
        mark.x.atan2(mark.y).to_degrees().rem_euclid(360.0)
    }

    fn dwell(&mut self, dwell: Dwell) -> Vec<Row> {
        if dwell.gap_s > 0.0 || dwell.index_deg != self.tracker.pose().index_deg {
            self.advance(dwell.gap_s.max(0.0025), dwell.index_deg);
        }
        // A hair more than whole intervals is whole intervals.
        let rows = (dwell.seconds / self.interval_s + 1e-9) as u64;
        (0..rows).map(|_| self.row(dwell.index_deg)).collect()
    }

    /// The gyro's increment over the next `dt_s`, arcsec.
    fn advance(&mut self, dt_s: f64, index_deg: f64) -> f64 {
        self.t_s += dt_s;
        self.base.advance_to(self.t_s);
        let turn = self.tracker.move_to(self.base.angles(), index_deg, dt_s);
        self.errors.measure(&Surroundings {
            t_s: self.t_s,
            dt_s,
            turned_arcsec: turn.turned_arcsec,
            index_rad: index_deg.to_radians(),
            index_change_rad: turn.index_change_rad,
            axis: self.tracker.pose().axis,
            vibration_g: self.vibration_g,
            supply_v: self.supply.volts_at(self.t_s),
        })
    }

    fn row(&mut self, index_deg: f64) -> Row {
        let before_g = geometry::specific_force_g(&self.tracker.pose().attitude);
        let increment_arcsec = self.advance(self.interval_s, index_deg);
        let readings = (READINGS_HZ * self.interval_s).max(1.0);
        let encoder_noise_deg = self.encoder.noise_deg / readings.sqrt() * self.encoder_stream.normal();
        // The mean over the interval of a base that turns evenly in it.
        let force_g = 0.5 * (before_g + geometry::specific_force_g(&self.tracker.pose().attitude));
        // White noise of one-sided density d, averaged over T, has a standard deviation of d/√(2T).
        let noise_g = (1e-6 * self.accelerometer.noise_ug_per_sqrt_hz / (2.0 * self.interval_s).sqrt())
            .hypot(self.vibration_g / readings.sqrt());
        let mut acceleration = |axis| {
            self.accelerometer.reading_g(axis, &force_g, self.errors.temp_c())
                + noise_g * self.accelerometer_stream.normal()
        };
        Row {
            t_s: self.t_s,
            ax_g: acceleration(0),
            ay_g: acceleration(1),
            index_deg: self.encoder.reading_deg(index_deg) + encoder_noise_deg,
            fog_arcsec: self.quantizer.take(increment_arcsec),
            temp_c: self.errors.temp_reading_c(),
        }
    }
}
