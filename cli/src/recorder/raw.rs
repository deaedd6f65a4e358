//! A fix as raw rows: one for each frame of the gyro, 400 a second.

use std::collections::VecDeque;
use std::mem;

use north_finder::drivers::sensors::Due;
use north_finder::event::raw::Item;
use north_finder::event::{Event, Report, State};
use north_finder::health::Counters;
use north_finder::instrument::Readings;
use north_finder::sensing::frame::setup::{Progress, Setup};
use north_finder::sensing::frame::{self, FrameReader, GyroFormat};
use north_finder::sensing::level::Specific;
use north_finder::sensing::sample::{GyroSettings, SAMPLE_S, SAMPLES_PER_SECOND, Sampler};

use crate::campaign::{ACCELEROMETERS, INDEX, Own, Row, TEMPERATURE};

/// Frames of a second.
const FRAMES: usize = SAMPLES_PER_SECOND as usize;

/// Collects what the gyro and the sensors say, tick by tick, and at the end of a second what the instrument did with it.
///
/// Accelerometers and encoder are read less often than the gyro; every reading stands in one row of the second that it was
/// used in, spread over it. A frame that never came or was not valid has a row, marked lost, that repeats the one before.
#[derive(Clone, Debug)]
pub struct RawRecorder {
    format: GyroFormat,
    /// While the gyro is told what to send nothing of it is a frame, as for the instrument.
    setup: Option<Setup>,
    reader: FrameReader,
    sampler: Sampler,
    /// Seconds that the instrument has not reported yet.
    seconds: VecDeque<Pending>,
    /// As many of them have ended: readings go to the one after them.
    ended: usize,
    /// A second of the stream was reported: those before began without it.
    begun: bool,
    rows: Vec<Row>,
}

/// What came of a second.
#[derive(Clone, Debug, Default)]
struct Pending {
    frames: Vec<Frame>,
    accelerations_g: Vec<[f64; 3]>,
    indices_deg: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    increment_arcsec: Option<f64>,
    temp_c: Option<f64>,
}

impl RawRecorder {
    /// For the frames of a gyro.
    pub fn new(gyro: GyroSettings) -> Self {
        Self {
            format: gyro.format,
            setup: gyro.configure.then(Setup::default),
            reader: FrameReader::new(gyro.format),
            sampler: Sampler::new(gyro),
            seconds: VecDeque::from([Pending::default()]),
            ended: 0,
            begun: false,
            rows: Vec::new(),
        }
    }

    /// Takes what one tick brought.
    pub fn tick(&mut self, readings: &Readings, gyro_bytes: &[u8]) {
        match &mut self.setup {
            Some(setup) => {
                gyro_bytes.iter().for_each(|&byte| setup.hear(byte));
                self.setup.take_if(|setup| !matches!(setup.tick(), Progress::UnderWay(_)));
            }
            None => {
                for &byte in gyro_bytes {
                    if let Some(frame) = self.reader.push(byte) {
                        self.item(&Item::Frame(frame));
                    }
                }
            }
        }
        match readings.sensors {
            Due::Acceleration(Some(reading)) => self.item(&Item::Acceleration(reading.acceleration)),
            Due::Index(Some(index)) => self.item(&Item::Index(index)),
            _ => {}
        }
        self.item(&Item::Tick);
    }

    /// Takes what entered the instrument, in the order in which it did; what comes first is the beginning of a second.
    pub fn item(&mut self, item: &Item) {
        // A second whose last frame has come ends with the tick, after the readings.
        match *item {
            Item::Frame(frame) => self.frame(&frame),
            Item::Acceleration(reading) => self.under_way().accelerations_g.push(reading.g()),
            Item::Index(index) => self.under_way().indices_deg.push(index.deg()),
            Item::Tick => {
                let given_up = self.slots(|sampler| {
                    sampler.tick(&mut Counters::default());
                });
                self.frames(given_up, Frame::default());
                self.ended = self.seconds.iter().filter(|second| second.frames.len() == FRAMES).count();
            }
        }
    }

    /// The second that gets the readings.
    fn under_way(&mut self) -> &mut Pending {
        if self.seconds.len() <= self.ended {
            self.seconds.resize(self.ended + 1, Pending::default());
        }
        &mut self.seconds[self.ended]
    }

    fn frame(&mut self, frame: &frame::Frame) {
        let before = self.sampler.good();
        let missing = self.slots(|sampler| {
            sampler.frame(frame, &mut Counters::default());
        });
        let valid = self.sampler.good() != before;
        let increment_arcsec = valid.then(|| frame.increment as f64 * self.format.arcsec_per_count());
        let temp_c = frame.temperature.map(|count| f64::from(count) * self.format.c_per_count());
        self.frames(missing, Frame { increment_arcsec, temp_c });
    }

    /// Takes a report of the instrument.
    pub fn report(&mut self, report: &Report) {
        match &report.event {
            Event::State(State::Levelling) => super::start_again(&mut self.rows),
            Event::Second(second) => {
                // A second is reported a while after its end: the first report may be of one before the stream.
                self.begun |= self.seconds.front().is_some_and(|pending| pending.frames.len() == FRAMES);
                if !self.begun {
                    return;
                }
                let pending = self.seconds.pop_front().unwrap_or_default();
                self.ended = self.ended.saturating_sub(1);
                if self.seconds.is_empty() {
                    self.seconds.push_back(Pending::default());
                }
                self.rows.extend(pending.rows(second));
            }
            _ => {}
        }
    }

    /// A second of the stream was reported.
    pub fn has_begun(&self) -> bool {
        self.begun
    }

    /// The rows, which the recorder then no longer has.
    pub fn take_rows(&mut self) -> Vec<Row> {
        mem::take(&mut self.rows)
    }

    /// How many frames of the gyro a step of the sampler accounts for.
    fn slots(&mut self, step: impl FnOnce(&mut Sampler)) -> usize {
        let before = self.sampler.slots();
        step(&mut self.sampler);
        usize::from((self.sampler.slots() + SAMPLES_PER_SECOND - before) % SAMPLES_PER_SECOND)
    }

    /// That many frames, all lost but the last.
    fn frames(&mut self, number: usize, last: Frame) {
        for left in (0..number).rev() {
            if self.seconds.back().is_none_or(|second| second.frames.len() == FRAMES) {
                self.seconds.push_back(Pending::default());
            }
            if let Some(second) = self.seconds.back_mut() {
                second.frames.push(if left == 0 { last } else { Frame::default() });
            }
        }
    }
}

impl Pending {
    fn rows(self, second: &north_finder::event::Second) -> Vec<Row> {
        let mark = super::mark(second);
        let mut rows: Vec<Row> = Vec::with_capacity(FRAMES);
        for (number, frame) in self.frames.iter().enumerate() {
            let acceleration_g = spread(&self.accelerations_g, number);
            let index_deg = spread(&self.indices_deg, number);
            let read = u8::from(frame.temp_c.is_some()) * TEMPERATURE
                + u8::from(acceleration_g.is_some()) * ACCELEROMETERS
                + u8::from(index_deg.is_some()) * INDEX;
            let repeated = rows.last().map_or(0.0, |row| row.fog_arcsec);
            let up = rows.last().and_then(|row| row.own).map_or(0.0, |own| own.az_g().unwrap_or(0.0));
            rows.push(Row {
                t_s: second.t_s - SAMPLE_S * (FRAMES - 1 - number) as f64,
                interval_s: SAMPLE_S,
                index_deg: index_deg.unwrap_or(f64::NAN),
                fog_arcsec: frame.increment_arcsec.unwrap_or(repeated),
                temp_c: frame.temp_c,
                level: acceleration_g.map(|[forward, left, _]| Specific { forward, left }),
                level_temp_c: second.level_temp_c,
                lost_frames: u16::from(frame.increment_arcsec.is_none()),
                own: Some(Own::Raw { read, mark, az_g: acceleration_g.map_or(up, |[_, _, z]| z) }),
                extra: super::extra(second),
            });
        }
        rows
    }
}

/// The reading that stands in row `number`, the readings spread evenly over the second's rows.
fn spread<T: Copy>(readings: &[T], number: usize) -> Option<T> {
    let count = readings.len().min(FRAMES);
    let place = (number * count).div_ceil(FRAMES);
    (place < count && place * FRAMES / count.max(1) == number).then(|| readings.get(place).copied())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reading_stands_in_one_row() {
        for count in [0, 1, 3, 99, 100, 101, 115, 400] {
            let readings: Vec<usize> = (0..count).collect();
            let placed: Vec<usize> = (0..FRAMES).filter_map(|number| spread(&readings, number)).collect();
            assert_eq!(placed, readings);
        }
    }
}
