//! Recordings to azimuths: rows of any interval, any number and order of positions, or a continuous rotation.
//!
//! A recording of the instrument says which of its seconds belonged to which dwell, and its replay is the fix again. A foreign
//! one does not: its dwells are found in the index angle itself. Rows are gathered into seconds; a second in which the index
//! moved belongs to no dwell; a dwell's beginning is left out as far as the jitter gate would have waited. If the index moved
//! most of the time, the recording is a continuous rotation, and every second counts at its own angle. Either way the
//! [`Accumulator`] is that of the live instrument, and only where a dwell begins and ends is decided here.

mod gathering;

pub use gathering::{Belonging, REST_DEG, RecordedSecond, Seconds};

use crate::effects::MAX_CHANNELS;
use crate::effects::now::RunFacts;
use crate::event::{Dwell, Fix};
use crate::fix::Unsolvable;
use crate::fix::accumulator::{Accumulator, Corrected, Dwells, Outliers, Second, Slip, Taken};
use crate::fix::dwell::DwellSummary;
use crate::fix::rotation::FIRST_PASS;
use crate::health::Fault;
use crate::sensing::gates::{DisturbanceGate, Gate, GateSettings, JitterGate, Verdict};
use crate::sensing::level::Specific;
use crate::sensing::sample::SAMPLES_PER_SECOND;
use crate::settings::Settings;
use crate::units::wrap_180_deg;

/// Most seconds that wait for the jitter gate; it may be set to 600.
const WAITING: usize = 640;

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
    /// Level accelerometers.
    pub level: Option<Specific>,
    /// Their temperature, °C, if they have a thermometer.
    pub level_temp_c: Option<f64>,
    /// Frames of the interval that were lost; with more in a second than the settings call repairable it is left out.
    pub lost_frames: u16,
    /// Further channels, in the order of [`crate::effects::ErrorModel::channels`]; not-a-number where one is absent.
    pub channels: [f64; MAX_CHANNELS],
}

impl Default for Row {
    /// A row without anything, a second long.
    fn default() -> Self {
        Self {
            t_s: 0.0,
            interval_s: 1.0,
            index_deg: 0.0,
            fog_arcsec: 0.0,
            temp_c: None,
            level: None,
            level_temp_c: None,
            lost_frames: 0,
            channels: [f64::NAN; MAX_CHANNELS],
        }
    }
}

/// What the instrument did with a second, as it recorded it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mark {
    /// Number of the dwell, from 0, that was under way; from 128 on those of the passes of a continuous rotation.
    pub dwell: Option<u8>,
    /// The gate that refused at its end.
    pub waited_at: Option<Gate>,
}

/// One frame of the instrument's gyro, and what else was read with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawRow {
    /// End of the frame's interval, seconds.
    pub t_s: f64,
    /// Its increment, arcsec; `None`: it never came or was not valid.
    pub fog_arcsec: Option<f64>,
    /// Readings of the gyro's thermometer, °C, of the accelerometers as they gave them, g, and of the encoder, degrees.
    pub temp_c: Option<f64>,
    pub acceleration_g: Option<[f64; 3]>,
    pub index_deg: Option<f64>,
    /// Mean temperature of the accelerometers over the second that it belongs to, °C.
    pub level_temp_c: Option<f64>,
    /// Further channels, in the order of [`crate::effects::ErrorModel::channels`], over the second that it belongs to.
    pub channels: [f64; MAX_CHANNELS],
    /// Of the second that it belongs to.
    pub mark: Mark,
}

/// What a recording holds.
#[allow(clippy::large_enum_variant)] // passed by reference
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Recorded {
    /// A row of a foreign recording.
    Row(Row),
    /// A second of the instrument.
    Second(Second, Mark),
    /// A frame of the instrument.
    Raw(RawRow),
}

/// What became of a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It was collected in the dwell of this number, from 0.
    Dwell(u16),
    /// The index moved within it.
    Moving,
    /// It cannot be used, or lies before or after the dwells.
    LeftOut,
}

/// What a replay tells: every second once, in the order of time, and the dwells after their last second.
#[allow(clippy::large_enum_variant)] // passed on at once
#[derive(Clone, Debug, PartialEq)]
pub enum Reported {
    Second(Corrected, Place),
    Dwell {
        dwell: Dwell,
        /// Its end, seconds.
        end_s: f64,
        /// Middles of the seconds that were left out of it as outliers, seconds.
        outliers_s: Outliers,
    },
}

/// Takes what a replay tells.
pub type Sink<'a> = &'a mut dyn FnMut(Reported);

/// Why a recording gives no azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Settings that allow no fix: invalid ones, or a latitude next to a pole.
    Settings(Fault),
    Unsolvable(Unsolvable),
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Settings(fault) => f.write_str(fault.meaning()),
            Self::Unsolvable(reason) => reason.fmt(f),
        }
    }
}

/// Whether a dwell has begun.
#[allow(clippy::large_enum_variant)] // without a heap there is no smaller place
#[derive(Clone, Debug)]
enum Opening {
    /// The recording's first second: nobody knows whether the index moved in it. Where it moves in the next one, it did.
    First,
    /// After a move: the gyro comes to rest.
    Settling(JitterGate),
    Open,
}

/// Where the seconds wait of which is not decided yet whether the dwell begins with them: on a host, where there is room.
pub trait Waiting {
    /// At most 640 wait at a time.
    fn push(&mut self, second: Corrected);
    fn as_slice(&self) -> &[Corrected];
    fn clear(&mut self);
}

/// Replays one recording.
pub struct Replay<D, W> {
    accumulator: Accumulator<D>,
    jitter: GateSettings,
    /// What the order asks for, degrees, which holds where the instrument recorded the fix itself.
    accuracy_deg: Option<f64>,
    own: bool,
    /// What the instrument called its last dwell.
    number: u8,
    seconds: Seconds,
    disturbance: DisturbanceGate,
    opening: Opening,
    /// Seconds at rest of which is not decided yet whether the dwell begins with them.
    waiting: W,
    dwell_deg: Option<f64>,
    /// Number of the dwell under way, or of the next one.
    dwell: u16,
    /// The last dwell that a mark named.
    marked: Option<u8>,
}

impl<D: Dwells, W: Waiting> Replay<D, W> {
    /// With empty places for the dwells (one for each, or one for each second or longer row of a continuous rotation) and for seconds that wait.
    pub fn new(settings: &Settings, dwells: D, waiting: W) -> Result<Self, Refusal> {
        let declared = settings.declared().map_err(Refusal::Settings)?;
        Ok(Self {
            accumulator: Accumulator::new(declared, settings.model.clone().unwrap_or_default(), dwells),
            jitter: settings.jitter,
            accuracy_deg: settings.sequence.order.accuracy_deg(),
            own: false,
            number: 0,
            seconds: Seconds::new(settings),
            disturbance: DisturbanceGate::new(settings.disturbance, declared.earth.north_deg_h),
            opening: Opening::First,
            waiting,
            dwell_deg: None,
            dwell: 0,
            marked: None,
        })
    }

    /// Takes the next of a recording.
    pub fn push(&mut self, recorded: &Recorded, sink: Sink) {
        self.seconds.push(recorded).iter().flatten().for_each(|second| self.take(second, sink));
    }

    /// Takes the next second of a recording that was gathered before.
    pub fn take(&mut self, recorded: &RecordedSecond, sink: Sink) {
        let RecordedSecond { second, belonging } = recorded;
        match *belonging {
            Belonging::Marked(mark) => self.marked(second, mark, sink),
            Belonging::Angle { first_deg, moved } => self.find(second, first_deg, moved, sink),
        }
    }

    /// The azimuth of the whole recording.
    pub fn finish(&mut self, sink: Sink) -> Result<Fix, Refusal> {
        if let Some(second) = self.seconds.finish() {
            self.take(&second, sink);
        }
        self.end_dwell(sink);
        let mut fix = self.accumulator.solve().map_err(Refusal::Unsolvable)?;
        if self.own {
            fix.judge(self.accuracy_deg);
        }
        Ok(fix)
    }

    /// The dwells of the recording, as far as it was taken.
    pub fn into_dwells(self) -> D {
        self.accumulator.into_dwells()
    }

    /// What is known of the run as a whole.
    pub fn set_run(&mut self, run: RunFacts) {
        self.accumulator.set_run(run);
    }

    /// A second of the instrument, which says itself where it belongs.
    fn marked(&mut self, second: &Second, mark: Mark, sink: Sink) {
        self.own = true;
        let corrected = self.accumulator.correct(second);
        if let Some(gate) = mark.waited_at {
            self.accumulator.waited_at(gate);
        }
        if self.marked.is_some() && mark.dwell != self.marked {
            self.summarise(sink);
            if mark.dwell.is_none() {
                self.accumulator.index_turns();
            }
        }
        self.marked = mark.dwell;
        let Some(dwell) = mark.dwell else { return self.leave_out(corrected, sink) };
        // The numbers begin anew where an adaptive fix fell back to four positions.
        if dwell < core::mem::replace(&mut self.number, dwell) {
            self.accumulator.begin_anew();
        }
        if dwell >= FIRST_PASS {
            self.accumulator.collect_rotating(&corrected);
            return sink(Reported::Second(corrected, Place::Moving));
        }
        self.dwell = dwell.into();
        self.collect(corrected, sink);
    }

    /// A second of a foreign recording: to which dwell does it belong?
    fn find(&mut self, second: &Second, first_deg: f64, moved: bool, sink: Sink) {
        let corrected = self.accumulator.correct(second);
        if moved {
            if matches!(self.opening, Opening::First) {
                for i in 0..self.waiting.as_slice().len() {
                    if let Some(&second) = self.waiting.as_slice().get(i) {
                        self.moving(second, sink);
                    }
                }
                self.waiting.clear();
            }
            self.end_dwell(sink);
            self.moving(corrected, sink);
            return;
        }
        if !self.accumulator.is_usable(second) {
            // It says what is to be said of it: frames were lost.
            self.collect(corrected, sink);
            return;
        }
        if let (_, Verdict::Refused) = self.disturbance.push(corrected.rate_deg_h) {
            self.accumulator.waited_at(Gate::Disturbance);
        }
        if self.dwell_deg.is_some_and(|dwell_deg| wrap_180_deg(first_deg - dwell_deg).abs() > REST_DEG) {
            self.end_dwell(sink);
        }
        self.dwell_deg.get_or_insert(first_deg);
        self.waiting.push(corrected);
        match &mut self.opening {
            Opening::First if self.waiting.as_slice().len() > 1 => self.open(sink),
            Opening::First => {}
            Opening::Settling(gate) => {
                if let (_, Verdict::Passed) = gate.push(corrected.rate_deg_h, second.ripple_arcsec) {
                    self.begin_quiet(sink);
                } else if self.waiting.as_slice().len() >= WAITING {
                    self.accumulator.waited_at(Gate::Jitter);
                    self.open(sink);
                }
            }
            Opening::Open => self.open(sink),
        }
    }

    /// The dwell begins with the first of the quiet seconds.
    fn begin_quiet(&mut self, sink: Sink) {
        let before = self.waiting.as_slice().len().saturating_sub(usize::from(self.jitter.seconds) + 1);
        if before > 0 {
            self.accumulator.waited_at(Gate::Jitter);
        }
        for i in 0..before {
            if let Some(&second) = self.waiting.as_slice().get(i) {
                self.leave_out(second, sink);
            }
        }
        self.collect_waiting(before, sink);
        self.opening = Opening::Open;
    }

    /// The dwell begins with all that waits.
    fn open(&mut self, sink: Sink) {
        self.collect_waiting(0, sink);
        self.opening = Opening::Open;
    }

    fn collect_waiting(&mut self, first: usize, sink: Sink) {
        for i in first..self.waiting.as_slice().len() {
            if let Some(&second) = self.waiting.as_slice().get(i) {
                self.collect(second, sink);
            }
        }
        self.waiting.clear();
    }

    fn collect(&mut self, second: Corrected, sink: Sink) {
        let taken = self.accumulator.collect(&second);
        sink(Reported::Second(
            second,
            if taken == Taken::Collected { Place::Dwell(self.dwell) } else { Place::LeftOut },
        ));
        if let Taken::Slipped(slip) = taken {
            self.tell(slip.ended, sink);
        }
    }

    fn leave_out(&mut self, second: Corrected, sink: Sink) {
        let slip = self.accumulator.between_dwells(&second);
        sink(Reported::Second(second, Place::LeftOut));
        self.tell(slip.and_then(|slip: Slip| slip.ended), sink);
    }

    fn moving(&mut self, second: Corrected, sink: Sink) {
        self.accumulator.collect_moving(&second);
        sink(Reported::Second(second, Place::Moving));
    }

    fn end_dwell(&mut self, sink: Sink) {
        if matches!(self.opening, Opening::Settling(_))
            && self.waiting.as_slice().len() > usize::from(self.jitter.seconds)
        {
            // It never came to rest: all is taken as it is.
            self.accumulator.waited_at(Gate::Jitter);
        }
        self.open(sink);
        self.dwell_deg = None;
        self.summarise(sink);
        self.accumulator.index_turns();
        // On a base that rocks the rate is never quiet, and need not be.
        let settles = self.accumulator.model().base_motion.is_none() && self.dwell > 0;
        self.opening = if settles { Opening::Settling(JitterGate::new(self.jitter)) } else { Opening::Open };
    }

    fn summarise(&mut self, sink: Sink) {
        let ended = self.accumulator.end_dwell();
        self.tell(ended, sink);
    }

    fn tell(&mut self, ended: Option<DwellSummary>, sink: Sink) {
        if let Some(summary) = ended {
            let dwell = Dwell::new(self.dwell.min(255) as u8, &summary);
            let outliers_s = self.accumulator.outliers_s().clone();
            sink(Reported::Dwell { dwell, end_s: summary.end_s, outliers_s });
            self.dwell = self.dwell.saturating_add(1);
        }
    }
}

const _: () = assert!(SAMPLES_PER_SECOND == 400);

#[cfg(test)]
impl Waiting for std::vec::Vec<Corrected> {
    fn push(&mut self, second: Corrected) {
        std::vec::Vec::push(self, second);
    }

    fn as_slice(&self) -> &[Corrected] {
        self
    }

    fn clear(&mut self) {
        std::vec::Vec::clear(self);
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
            level: Specific::new(0.0, 0.0),
            ..Row::default()
        }
    }

    fn replay(rows: &[Row]) -> (Result<Fix, Refusal>, Vec<Dwell>) {
        let settings = Settings { latitude_deg: 60.0, ..Default::default() };
        let mut replay = Replay::new(&settings, Vec::new(), Vec::new()).unwrap();
        let mut dwells = Vec::new();
        let mut told = |told: Reported| {
            if let Reported::Dwell { dwell, .. } = told {
                dwells.push(dwell);
            }
        };
        for row in rows {
            replay.push(&Recorded::Row(*row), &mut told);
        }
        let fix = replay.finish(&mut told);
        (fix, dwells)
    }

    /// Four dwells of 20 s with moves of 3 s between them, in rows of `interval_s`.
    fn four_positions(interval_s: f64) -> Vec<Row> {
        let rows = (92.0 / interval_s).round() as u32;
        (1..=rows)
            .map(|i| {
                let t_s = f64::from(i) * interval_s;
                let (dwell, into_s) = ((t_s / 23.0).floor(), t_s % 23.0);
                row(t_s, interval_s, 90.0 * dwell + 30.0 * (into_s - 20.0).clamp(0.0, 3.0))
            })
            .collect()
    }

    fn assert_azimuth(fix: Result<Fix, Refusal>, azimuth_deg: f64) {
        let fix = fix.unwrap();
        assert!(wrap_180_deg(fix.azimuth_deg - azimuth_deg).abs() < 1e-6, "{}", fix.azimuth_deg);
        assert!((fix.bias_deg_h - 1.0).abs() < 1e-6);
    }

    #[test]
    fn dwells_are_found_in_raw_rows_and_in_seconds() {
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
            // The settings declare no angle error, so a slow rotation may be taken for many short dwells.
            assert!(seconds > 235.0, "{speed_deg_s} °/s: {seconds}");
            assert!(wrap_180_deg(fix.unwrap().azimuth_deg).abs() < 1e-3, "{}", fix.unwrap().azimuth_deg);
        }
    }

    /// From 30° counter-clockwise at 25 °/s into the first dwell, at 90°: the first row's mean rate, 7.5 °/h · 0.976 · 0.87,
    /// is not that of its mean angle.
    #[test]
    fn a_recording_may_begin_within_a_move() {
        let turning = (1..=2).map(|i| {
            let middle_deg = 17.5 + 25.0 * f64::from(i);
            let half_rad = 12.5_f64.to_radians();
            let fog_arcsec = 7.5205335 * middle_deg.to_radians().cos() * half_rad.sin() / half_rad + 1.0;
            Row { fog_arcsec, ..row(f64::from(i), 1.0, middle_deg) }
        });
        let dwells = (0..80).map(|i| row(f64::from(i + 3), 1.0, 90.0 * f64::from(1 + i / 20)));
        let rows: Vec<Row> = turning.chain(dwells).collect();
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
    fn a_pole_and_a_lack_of_room_are_refused() {
        let settings = Settings { latitude_deg: 89.5, ..Default::default() };
        assert!(matches!(
            Replay::new(&settings, std::vec::Vec::new(), std::vec::Vec::new()),
            Err(Refusal::Settings(Fault::NearPole))
        ));
        let settings = Settings { latitude_deg: 60.0, ..Default::default() };
        let mut replay = Replay::new(&settings, heapless::Vec::<DwellSummary, 3>::new(), std::vec::Vec::new()).unwrap();
        four_positions(1.0).into_iter().for_each(|row| replay.push(&Recorded::Row(row), &mut |_| {}));
        assert_eq!(replay.finish(&mut |_| {}), Err(Refusal::Unsolvable(Unsolvable::TooManyDwells)));
    }
}
