//! Recordings to azimuths: rows of any interval, any number and order of positions, or a continuous rotation.
//!
//! A recording has no gates and no commanded positions, so the stays are found in the index angle itself. Rows are
//! gathered into seconds; a second in which the index moved belongs to no stay; a stay's beginning is left out as far as
//! the jitter gate would have waited. If the index moved most of the time, the recording is a continuous rotation, and
//! every second counts at its own angle. The error model and the solution are those of the live instrument.

use crate::effects::{Conditions, Correction, Evaluator, MAX_CHANNELS};
use crate::event::{Dwell, Event, Fix, Report};
use crate::fix::dwell::{DwellRows, DwellSummary, Row as DwellRow};
use crate::fix::{self, Declared, Unsolvable, moving_base};
use crate::gates::{DisturbanceGate, Verdict};
use crate::health::{Fault, Flag, Flags};
use crate::index::Direction;
use crate::level::{LevelMoments, Specific};
use crate::pipeline::Sink;
use crate::settings::Settings;
use crate::units::{RAD_PER_DEG, sin_cos_deg, wrap_180_deg};

/// The index is at rest while it stays within this, degrees.
const REST_DEG: f64 = 0.5;
/// Rows are gathered until they cover this, seconds. (A little less than one, for time stamps that are rounded.)
const GATHER_S: f64 = 0.9995;
/// Share of the time at rest below which a recording is a continuous rotation.
const ROTATION_SHARE: f64 = 0.25;
/// Temperature change that an error model must cover, K.
const TEMPERATURE_CHANGE_K: f64 = 0.5;
/// Most seconds that wait for the first rate of change; a rate is known after ten.
const HELD: usize = 16;

/// One row of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// End of the interval, seconds.
    pub t_s: f64,
    /// Its length, seconds, above 0.
    pub interval_s: f64,
    /// Mean index angle over the interval, degrees counter-clockwise from above; may pass 360 or be negative.
    pub index_deg: f64,
    /// Gyro angle over the interval, arcsec.
    pub fog_arcsec: f64,
    /// Gyro temperature, °C.
    pub temp_c: Option<f64>,
    /// Level accelerometers, forward and left, g.
    pub level_g: Option<[f64; 2]>,
    /// Frames of the interval that were lost; more than the settings call repairable and the row is left out.
    pub lost_frames: u16,
}

/// Why a recording gives no azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Settings that allow no fix: invalid ones, or a latitude next to a pole.
    Settings(Fault),
    /// More stays or seconds than there are slots for.
    Full,
    Unsolvable(Unsolvable),
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Settings(fault) => f.write_str(fault.meaning()),
            Self::Full => f.write_str("the recording has more stays than there is room for"),
            Self::Unsolvable(reason) => reason.fmt(f),
        }
    }
}

/// Replays one recording.
pub struct Replay<'a> {
    settings: Settings,
    declared: Declared,
    evaluator: Evaluator,
    /// Seconds that wait for the first rate of change.
    held: heapless::Vec<(Gathering, Correction), HELD>,
    slots: &'a mut [DwellSummary],
    used: usize,
    gathering: Gathering,
    last_deg: Option<f64>,
    disturbance: DisturbanceGate,
    rows: DwellRows,
    stay_deg: Option<f64>,
    stays: u8,
    rest_s: f64,
    moving_s: f64,
    temperature_c: Option<(f64, f64)>,
    flags: Flags,
}

/// Rows being gathered into a second.
#[derive(Clone, Copy, Debug, Default)]
struct Gathering {
    rows: u32,
    seconds: f64,
    end_s: f64,
    cos: f64,
    sin: f64,
    raw_arcsec: f64,
    /// Sum of the angles times their time.
    timed_arcsec_s: f64,
    level: [f64; 2],
    /// Sum of the readings times their time and weight.
    timed_level: [f64; 2],
    level_seconds: f64,
    temp_c: f64,
    temp_seconds: f64,
    channels: [f64; MAX_CHANNELS],
    first_deg: f64,
    turned_deg: f64,
}

impl<'a> Replay<'a> {
    /// One slot is used for each stay, or for each second (or longer row) of a continuous rotation; one for each row is
    /// always enough.
    pub fn new(settings: &Settings, slots: &'a mut [DwellSummary]) -> Result<Self, Refusal> {
        let declared = settings.declared().map_err(Refusal::Settings)?;
        let model = settings.model.clone().unwrap_or_default();
        let mut flags = Flags::default();
        if settings.model.is_none() {
            flags.insert(Flag::Uncalibrated);
        }
        Ok(Self {
            declared,
            slots,
            used: 0,
            gathering: Gathering::default(),
            last_deg: None,
            disturbance: DisturbanceGate::new(settings.disturbance, declared.earth.north_deg_h),
            rows: DwellRows::default(),
            stay_deg: None,
            stays: 0,
            rest_s: 0.0,
            moving_s: 0.0,
            temperature_c: None,
            flags,
            evaluator: Evaluator::new(model),
            held: heapless::Vec::new(),
            settings: settings.clone(),
        })
    }

    /// Takes the next row of a recording without further channels.
    pub fn push(&mut self, row: &Row, report: Sink) -> Result<(), Refusal> {
        self.push_with_channels(row, [f64::NAN; MAX_CHANNELS], report)
    }

    /// Takes the next row and further channels, in the order of [`crate::effects::ErrorModel::channels`]; not-a-number where
    /// one is absent.
    pub fn push_with_channels(
        &mut self,
        row: &Row,
        channels: [f64; MAX_CHANNELS],
        report: Sink,
    ) -> Result<(), Refusal> {
        let way_deg =
            self.last_deg.replace(row.index_deg).map_or(0.0, |last_deg| wrap_180_deg(row.index_deg - last_deg));
        if row.lost_frames > 0 {
            self.flags.insert(Flag::FramesLost);
        }
        if row.lost_frames > self.settings.gyro.repairable_frames {
            return Ok(());
        }
        // A row within which the index moved is not gathered with others.
        let moved = way_deg.abs() > REST_DEG;
        if moved {
            self.end_second(report)?;
        }
        self.gathering.push(row, channels, way_deg);
        if moved || self.gathering.seconds >= GATHER_S {
            self.end_second(report)?;
        }
        Ok(())
    }

    /// The azimuth of the whole recording.
    pub fn finish(mut self, report: Sink) -> Result<Fix, Refusal> {
        self.end_second(report)?;
        self.release(report)?;
        self.end_stay(report)?;
        let rotation = self.rest_s < ROTATION_SHARE * (self.rest_s + self.moving_s);
        let mut chosen: usize = 0;
        for i in 0..self.used {
            let Some(&summary) = self.slots.get(i) else { break };
            if rotation || !summary.moving {
                if let Some(place) = self.slots.get_mut(chosen) {
                    *place = summary;
                }
                chosen += 1;
            }
        }
        let summaries = self.slots.get(..chosen).unwrap_or_default();
        let solution = fix::solve(summaries, &self.declared, self.evaluator.model()).map_err(Refusal::Unsolvable)?;
        let fix = Fix::new(&solution, self.flags);
        report(Report { t_s: self.gathering.end_s, event: Event::Fix(fix) });
        Ok(fix)
    }

    fn end_second(&mut self, report: Sink) -> Result<(), Refusal> {
        let next = Gathering { end_s: self.gathering.end_s, ..Default::default() };
        let second = core::mem::replace(&mut self.gathering, next);
        if second.seconds <= 0.0 {
            return Ok(());
        }
        let correction = self.evaluate(&second);
        if correction.waiting && self.held.push((second, correction)).is_ok() {
            return Ok(());
        }
        self.release(report)?;
        self.take(&second, &correction, report)
    }

    /// Takes the seconds that waited, corrected by the rates of change as they are now.
    fn release(&mut self, report: Sink) -> Result<(), Refusal> {
        let rates_deg_h = self.evaluator.rates_deg_h();
        for (second, mut correction) in core::mem::take(&mut self.held) {
            correction.bias_deg_h += rates_deg_h;
            self.take(&second, &correction, report)?;
        }
        Ok(())
    }

    fn take(&mut self, second: &Gathering, correction: &Correction, report: Sink) -> Result<(), Refusal> {
        let Direction { cos, sin } = self.evaluator.model().true_index(second.index());
        let row = DwellRow {
            t_s: second.end_s - 0.5 * second.seconds,
            seconds: second.seconds,
            cos,
            sin,
            rate_deg_h: correction.apply(second.raw_arcsec, second.seconds) / second.seconds,
            moment_arcsec_s: second.timed_arcsec_s - (second.end_s - 0.5 * second.seconds) * second.raw_arcsec,
            level: second.level(),
        };
        if second.turned_deg.abs() > REST_DEG {
            self.begin_within_a_move()?;
            self.end_stay(report)?;
            self.moving_s += second.seconds;
            return self.store(DwellSummary::moving(&row));
        }
        self.rest_s += second.seconds;
        if let (excess_deg_h, Verdict::Refused) = self.disturbance.push(row.rate_deg_h) {
            self.flags.insert(Flag::Disturbed);
            report(Report { t_s: second.end_s, event: Event::Disturbed { excess_deg_h } });
        }
        if self.stay_deg.is_some_and(|stay_deg| wrap_180_deg(second.first_deg - stay_deg).abs() > REST_DEG) {
            self.end_stay(report)?;
        }
        self.stay_deg.get_or_insert(second.first_deg);
        if self.rows.is_full() {
            self.skip_jitter();
        }
        self.rows.push(row, self.settings.gyro.noise_deg_h());
        Ok(())
    }

    /// Of a recording's first row nobody knows whether the index moved; where it moved in the next one, it did.
    fn begin_within_a_move(&mut self) -> Result<(), Refusal> {
        let Some(row) = self.rows.only().copied().filter(|_| self.stays == 0 && self.used == 0) else { return Ok(()) };
        self.rows.clear();
        self.rest_s -= row.seconds;
        self.moving_s += row.seconds;
        self.store(DwellSummary::moving(&row))
    }

    fn evaluate(&mut self, second: &Gathering) -> Correction {
        let conditions = second.conditions();
        let temp_c = conditions.temp_c;
        if let Some(temp_c) = temp_c {
            let (low_c, high_c) = self.temperature_c.unwrap_or((temp_c, temp_c));
            let (low_c, high_c) = (low_c.min(temp_c), high_c.max(temp_c));
            self.temperature_c = Some((low_c, high_c));
            if high_c - low_c > TEMPERATURE_CHANGE_K && !self.evaluator.model().covers_temperature() {
                self.flags.insert(Flag::Temperature);
            }
        }
        self.evaluator.second(&conditions)
    }

    fn end_stay(&mut self, report: Sink) -> Result<(), Refusal> {
        self.stay_deg = None;
        self.skip_jitter();
        let noise_deg_h = self.settings.gyro.noise_deg_h();
        let summary = match self.evaluator.model().base_motion {
            Some(sensing) => moving_base::summary(self.rows.as_slice(), sensing, noise_deg_h),
            None => self.rows.summary(noise_deg_h),
        };
        self.rows.clear();
        let Some(summary) = summary else { return Ok(()) };
        report(Report {
            t_s: summary.end_s,
            event: Event::Dwell(Dwell {
                position: self.stays,
                index_deg: summary.index_deg(),
                seconds: summary.seconds,
                rate_deg_h: summary.rate.mean,
                sigma_deg_h: summary.sigma_deg_h(),
            }),
        });
        self.stays = self.stays.saturating_add(1);
        self.store(summary)
    }

    /// Leaves out the beginning of a dwell that came after a move, as far as the jitter gate would have waited. On a base
    /// that rocks the rate is never quiet, and need not be.
    fn skip_jitter(&mut self) {
        let jitter = self.settings.jitter;
        let seconds = usize::from(jitter.seconds);
        let skips = self.stays > 0 && self.evaluator.model().base_motion.is_none() && !self.rows.is_merged();
        if skips && self.rows.len() > seconds && self.rows.skip_jitter(jitter.threshold_deg_h, seconds) != Some(0) {
            self.flags.insert(Flag::Jitter);
        }
    }

    fn store(&mut self, summary: DwellSummary) -> Result<(), Refusal> {
        *self.slots.get_mut(self.used).ok_or(Refusal::Full)? = summary;
        self.used += 1;
        Ok(())
    }
}

impl Gathering {
    fn push(&mut self, row: &Row, channels: [f64; MAX_CHANNELS], way_deg: f64) {
        let (sin, cos) = sin_cos_deg(row.index_deg);
        // The mean of a cosine over an arc is shorter than the cosine of its middle.
        let half_rad = 0.5 * way_deg * RAD_PER_DEG;
        let shorter = if half_rad.abs() > 1e-9 { libm::sin(half_rad) / half_rad } else { 1.0 };
        let weight = row.interval_s;
        if self.rows == 0 {
            self.first_deg = row.index_deg;
        }
        // Way within a second, or to a row that stands alone because of it.
        if self.rows > 0 || way_deg.abs() > REST_DEG {
            self.turned_deg += way_deg;
        }
        self.rows += 1;
        self.seconds += weight;
        self.end_s = row.t_s;
        self.cos += weight * cos * shorter;
        self.sin += weight * sin * shorter;
        self.raw_arcsec += row.fog_arcsec;
        self.timed_arcsec_s += row.fog_arcsec * (row.t_s - 0.5 * row.interval_s);
        if let Some([forward, left]) = row.level_g {
            let middle_s = row.t_s - 0.5 * weight;
            for ((sum, timed), reading) in self.level.iter_mut().zip(&mut self.timed_level).zip([forward, left]) {
                *sum += weight * reading;
                *timed += weight * middle_s * reading;
            }
            self.level_seconds += weight;
        }
        if let Some(temp_c) = row.temp_c {
            self.temp_c += weight * temp_c;
            self.temp_seconds += weight;
        }
        for (sum, value) in self.channels.iter_mut().zip(channels) {
            *sum += weight * value;
        }
    }

    fn index(&self) -> Direction {
        Direction { cos: self.cos / self.seconds, sin: self.sin / self.seconds }
    }

    fn conditions(&self) -> Conditions {
        Conditions {
            t_s: self.end_s - 0.5 * self.seconds,
            seconds: self.seconds,
            raw_rate_deg_h: self.raw_arcsec / self.seconds,
            index: Some(self.index()),
            temp_c: (self.temp_seconds > 0.0).then(|| self.temp_c / self.temp_seconds),
            level: self.level().map(|level| level.mean),
            channels: self.channels.map(|sum| sum / self.seconds),
        }
    }

    /// Mean and first moment of the level accelerometers, the latter as finely as the rows are: like the gyro's, so that what
    /// both miss of a base's turning is the same.
    fn level(&self) -> Option<LevelMoments> {
        let [forward, left] = self.level;
        if self.level_seconds <= 0.0 {
            return None;
        }
        let mean = Specific::new(forward / self.level_seconds, left / self.level_seconds)?;
        let middle_s = self.end_s - 0.5 * self.seconds;
        let [forward, left] = self.timed_level;
        let first = Specific {
            forward: forward - middle_s * self.level_seconds * mean.forward,
            left: left - middle_s * self.level_seconds * mean.left,
        };
        Some(LevelMoments { mean, first })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Rate of a level gyro of an instrument that points north at 60° north: 7.5205335 °/h · cos θ, and a bias of 1 °/h.
    fn rate_deg_h(index_deg: f64) -> f64 {
        7.5205335 * index_deg.to_radians().cos() + 1.0
    }

    fn row(t_s: f64, interval_s: f64, index_deg: f64) -> Row {
        Row {
            t_s,
            interval_s,
            index_deg,
            fog_arcsec: rate_deg_h(index_deg) * interval_s,
            temp_c: None,
            level_g: Some([0.0; 2]),
            lost_frames: 0,
        }
    }

    fn replay(rows: &[Row]) -> (Result<Fix, Refusal>, Vec<Dwell>) {
        let settings = Settings { latitude_deg: 60.0, ..Default::default() };
        let mut slots = std::vec![DwellSummary::default(); rows.len()];
        let mut replay = Replay::new(&settings, &mut slots).unwrap();
        let mut dwells = Vec::new();
        let mut report = |report: Report| {
            if let Event::Dwell(dwell) = report.event {
                dwells.push(dwell);
            }
        };
        for row in rows {
            replay.push(row, &mut report).unwrap();
        }
        let fix = replay.finish(&mut report);
        (fix, dwells)
    }

    /// Four stays of 20 s with moves of 3 s between them, in rows of `interval_s`.
    fn four_positions(interval_s: f64) -> Vec<Row> {
        let rows = (92.0 / interval_s).round() as u32;
        (1..=rows)
            .map(|i| {
                let t_s = f64::from(i) * interval_s;
                let (stay, into_s) = ((t_s / 23.0).floor(), t_s % 23.0);
                row(t_s, interval_s, 90.0 * stay + 30.0 * (into_s - 20.0).clamp(0.0, 3.0))
            })
            .collect()
    }

    fn assert_azimuth(fix: Result<Fix, Refusal>, azimuth_deg: f64) {
        let fix = fix.unwrap();
        assert!(wrap_180_deg(fix.azimuth_deg - azimuth_deg).abs() < 1e-6, "{}", fix.azimuth_deg);
        assert!((fix.bias_deg_h - 1.0).abs() < 1e-6);
    }

    #[test]
    fn stays_are_found_in_raw_rows_and_in_seconds() {
        for interval_s in [0.0025, 0.2, 1.0] {
            let (fix, dwells) = replay(&four_positions(interval_s));
            assert_azimuth(fix, 0.0);
            assert_eq!(dwells.len(), 4, "{interval_s}");
            assert!(dwells.iter().all(|dwell| (17.9..=21.1).contains(&dwell.seconds)), "{dwells:?}");
        }
    }

    #[test]
    fn positions_without_turning_rows() {
        let rows: Vec<Row> = (0..400).map(|i| row(f64::from(i + 1) * 0.2, 0.2, 90.0 * f64::from(i / 100))).collect();
        let (fix, dwells) = replay(&rows);
        assert_azimuth(fix, 0.0);
        assert_eq!(dwells.len(), 4);
    }

    #[test]
    fn a_continuous_rotation_uses_every_row() {
        for (interval_s, speed_deg_s) in [(1.0, 6.0), (0.2, -20.0), (0.0025, 3.0), (1.0, 0.2)] {
            let rows: Vec<Row> = (1..=(240.0 / interval_s) as u32)
                .map(|i| {
                    let t_s = f64::from(i) * interval_s;
                    let (start, end) = ((t_s - interval_s) * speed_deg_s, t_s * speed_deg_s);
                    // The angle over the interval is the integral of the rate: h (sin θ2 − sin θ1) / θ̇ + 1 · interval.
                    let turned = end.to_radians().sin() - start.to_radians().sin();
                    let fog_arcsec = 7.5205335 * turned / speed_deg_s.to_radians() + interval_s;
                    Row { fog_arcsec, ..row(t_s, interval_s, 0.5 * (start + end)) }
                })
                .collect();
            let (fix, _) = replay(&rows);
            let seconds = fix.unwrap().seconds;
            // The settings declare no angle error, so a slow rotation may be taken for many short stays.
            assert!(seconds > 235.0, "{speed_deg_s} °/s: {seconds}");
            assert!(wrap_180_deg(fix.unwrap().azimuth_deg).abs() < 1e-3, "{}", fix.unwrap().azimuth_deg);
        }
    }

    /// From 30° counter-clockwise at 25 °/s into the first stay, at 90°: the first row's mean rate, 7.5 °/h · 0.976 · 0.87,
    /// is not that of its mean angle.
    #[test]
    fn a_recording_may_begin_within_a_move() {
        let turning = (1..=2).map(|i| {
            let middle_deg = 17.5 + 25.0 * f64::from(i);
            let half_rad = 12.5_f64.to_radians();
            let fog_arcsec = 7.5205335 * middle_deg.to_radians().cos() * half_rad.sin() / half_rad + 1.0;
            Row { fog_arcsec, ..row(f64::from(i), 1.0, middle_deg) }
        });
        let stays = (0..80).map(|i| row(f64::from(i + 3), 1.0, 90.0 * f64::from(1 + i / 20)));
        let rows: Vec<Row> = turning.chain(stays).collect();
        let (fix, dwells) = replay(&rows);
        assert_azimuth(fix, 0.0);
        assert_eq!(dwells.len(), 4);
    }

    #[test]
    fn two_directions_are_refused() {
        let rows: Vec<Row> = (0..40).map(|i| row(f64::from(i + 1), 1.0, 180.0 * f64::from(i / 20))).collect();
        assert_eq!(replay(&rows).0, Err(Refusal::Unsolvable(Unsolvable::TooFewDirections)));
        assert_eq!(replay(&[]).0, Err(Refusal::Unsolvable(Unsolvable::TooFewDirections)));
    }

    #[test]
    fn a_pole_and_a_lack_of_slots_are_refused() {
        let settings = Settings { latitude_deg: 89.5, ..Default::default() };
        assert!(matches!(Replay::new(&settings, &mut []), Err(Refusal::Settings(Fault::NearPole))));
        let settings = Settings { latitude_deg: 60.0, ..Default::default() };
        let replay = Replay::new(&settings, &mut []).unwrap();
        let mut replay = replay;
        replay.push(&row(1.0, 1.0, 0.0), &mut |_| {}).unwrap();
        assert_eq!(replay.finish(&mut |_| {}), Err(Refusal::Full));
    }
}
