//! The one way from bytes and time to an azimuth: firmware, simulation and replay of raw input all enter here.

use heapless::{Deque, Vec};
use serde::{Deserialize, Serialize};

use crate::calibration::field::{self, Session};
use crate::codes::{IndexCode, TriadCode};
use crate::event::{self, Event, Report, State};
use crate::fix::accumulator::Accumulator;
use crate::frame::FrameReader;
use crate::gather::Gatherer;
use crate::health::{Counters, Fault, Refused};
use crate::index::MotorCommand;
use crate::level::LevelMoments;
use crate::sample::{RateSecond, SAMPLE_S, SAMPLES_PER_SECOND};
use crate::sequence::{Command, Seen, Sequencer};
use crate::settings::{Settings, store::Loaded};
use crate::watch::GyroWatch;

/// Seconds between two reports of the counters, if they changed.
const HEALTH_SECONDS: u32 = 10;
/// Encoder readings in a row that may fail: 0.25 s of them.
const ENCODER_PATIENCE: u16 = 25;

/// What the sensors gave at one tick (every 2.5 ms).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Readings {
    /// Number of the tick, from 0; its time is `tick · 2.5 ms`.
    pub tick: u64,
    /// Specific force where the accelerometer was due; `Some(None)`: due and failed.
    pub acceleration: Option<Option<TriadCode>>,
    /// Index angle where the encoder was due; `Some(None)`: due and failed.
    pub index: Option<Option<IndexCode>>,
    /// Whether the step generator is running.
    pub turning: bool,
    /// What the board's queues had no room for, since the start.
    pub refused: Refused,
}

impl Readings {
    /// Time of the tick, seconds since the first.
    pub fn t_s(&self) -> f64 {
        self.tick as f64 * SAMPLE_S
    }
}

/// Takes reports out of the pipeline.
pub type Sink<'a> = &'a mut dyn FnMut(Report);

/// Composes the modules in the order in which a sample meets them.
pub struct Pipeline {
    reader: FrameReader,
    gatherer: Gatherer,
    watch: GyroWatch,
    /// Or the reason why no fix can be started.
    sequencer: Result<Sequencer, Fault>,
    /// The calibration of the accelerometers: its problems and results go past the pipeline's ticks.
    pub field: Session,
    counters: Counters,
    reported: Counters,
    seconds: u32,
    /// Seconds that ended since the last tick.
    finished: Deque<RateSecond, 4>,
    command: Option<Command>,
    tick: u64,
    encoder_failures: u16,
}

impl Pipeline {
    /// With what the flash held. Without valid settings the pipeline still samples and reports, but starts no fix.
    // Inlined, so that it is made where it stays: copies of it would take tens of kilobytes of a board's stack.
    #[inline(always)]
    pub fn new(loaded: Loaded) -> Self {
        let (settings, sequencer) = match loaded {
            // What no board measures cannot be compensated: such a model is for recordings.
            Loaded::Valid(settings) if settings.model.as_ref().is_some_and(|model| model.off_board().is_some()) => {
                (settings, Err(Fault::SettingsInvalid))
            }
            Loaded::Valid(settings) => {
                let sequencer = sequencer(&settings);
                (settings, sequencer)
            }
            Loaded::Missing => (Settings::default(), Err(Fault::SettingsMissing)),
            Loaded::Corrupt => (Settings::default(), Err(Fault::SettingsCorrupt)),
        };
        Self {
            reader: FrameReader::new(settings.gyro.format),
            gatherer: Gatherer::new(settings.gyro, settings.triad()),
            watch: GyroWatch::default(),
            sequencer,
            field: Session::default(),
            counters: Counters::default(),
            reported: Counters::default(),
            seconds: 0,
            finished: Deque::new(),
            command: None,
            tick: 0,
            encoder_failures: 0,
        }
    }

    /// Bytes from the gyro, in the order of their coming.
    pub fn gyro_bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if let Some(frame) = self.reader.push(byte) {
                self.watch.heard(self.tick);
                let second = self.gatherer.frame(&frame, &mut self.counters);
                self.keep(second);
            }
        }
    }

    /// A command; it is carried out at the next tick.
    pub fn command(&mut self, command: Command) {
        self.command = Some(command);
    }

    /// A command that could not be understood.
    pub fn bad_command(&mut self) {
        self.counters.commands_bad = self.counters.commands_bad.saturating_add(1);
    }

    /// A tick of 2.5 ms with what the sensors gave.
    pub fn tick(&mut self, readings: &Readings, report: Sink) -> Option<MotorCommand> {
        self.tick = readings.tick;
        let t_s = readings.t_s();
        let mut sink = |event| report(Report { t_s, event });

        let mut motor = self.obey(t_s, &mut sink);
        self.read(readings);
        if let Some(calibration) =
            self.field.tick(readings.acceleration, &mut |event| calibration_events(event, &mut sink))
        {
            self.gatherer.set_triad(calibration.correction());
        }
        let given_up = self.gatherer.tick(&mut self.counters);
        self.keep(given_up);

        let watched = self.watch.tick(readings.tick);
        let encoder = (self.encoder_failures >= ENCODER_PATIENCE).then_some(Fault::EncoderFailed);
        if let Ok(sequencer) = &mut self.sequencer {
            let moved = sequencer.tick(t_s, readings.index.flatten(), readings.turning, &mut sink);
            motor = moved.or(motor);
            if let Some(fault) = watched.or(encoder) {
                motor = sequencer.fail(fault, t_s, &mut sink).or(motor);
            }
        }
        while let Some(rate) = self.finished.pop_front() {
            motor = self.second(&rate, t_s, &mut sink).or(motor);
        }
        motor
    }

    fn keep(&mut self, second: Option<RateSecond>) {
        if let Some(second) = second {
            // Four seconds between two ticks cannot be: a second has 400 frames and the queue is emptied at every tick.
            let _ = self.finished.push_back(second);
        }
    }

    fn obey(&mut self, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        let command = self.command.take()?;
        match (&mut self.sequencer, command) {
            (Ok(sequencer), Command::Start) => {
                self.field.abort(&mut |event| calibration_events(event, sink));
                self.watch.restart(self.tick);
                self.encoder_failures = 0;
                sequencer.start(t_s, sink)
            }
            (Ok(sequencer), Command::CalibrateAccelerometers) => {
                let stop = sequencer.fail(Fault::Aborted, t_s, sink);
                self.field.start(*self.gatherer.triad(), &mut |event| calibration_events(event, sink));
                stop
            }
            (Ok(sequencer), Command::Abort) => {
                self.field.abort(&mut |event| calibration_events(event, sink));
                sequencer.fail(Fault::Aborted, t_s, sink)
            }
            (Err(fault), Command::Start | Command::CalibrateAccelerometers) => {
                sink(Event::Fault { fault: *fault, state: State::Idle });
                sink(Event::State(State::Failed));
                None
            }
            (Err(_), Command::Abort) => None,
        }
    }

    fn read(&mut self, readings: &Readings) {
        let counters = &mut self.counters;
        counters.bytes_refused = readings.refused.gyro_bytes;
        counters.readings_refused = readings.refused.readings;
        counters.reports_refused = readings.refused.reports;
        counters.bytes_skipped = self.reader.bytes_skipped();
        counters.frames_bad_crc = self.reader.bad_crc();
        match readings.acceleration {
            Some(Some(reading)) => self.gatherer.acceleration(reading),
            Some(None) => counters.accelerometer_errors = counters.accelerometer_errors.saturating_add(1),
            None => {}
        }
        match readings.index {
            Some(Some(index)) => {
                self.gatherer.index(index);
                self.encoder_failures = 0;
            }
            Some(None) => {
                counters.encoder_errors = counters.encoder_errors.saturating_add(1);
                self.encoder_failures = self.encoder_failures.saturating_add(1);
            }
            None => {}
        }
    }

    fn second(&mut self, rate: &RateSecond, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        let counters = &mut self.counters;
        if !rate.usable {
            counters.seconds_left_out = counters.seconds_left_out.saturating_add(1);
        } else if rate.missing > 0 {
            counters.seconds_repaired = counters.seconds_repaired.saturating_add(1);
        }
        let fault = self.watch.second(rate, self.gatherer.sampler().behind());
        let (second, index_deg) = self.gatherer.finish(rate, t_s);
        let mut seen = Seen { rate_deg_h: rate.fog_arcsec, ..Seen::default() };
        let mut motor = None;
        // The second is reported before what it led to: a recording that ends with the azimuth holds all of its seconds.
        let mut consequences: Vec<Event, 8> = Vec::new();
        let mut hold = |event| {
            let _ = consequences.push(event);
        };
        if let Ok(sequencer) = &mut self.sequencer {
            (seen, motor) = sequencer.second(&second, counters, &mut hold);
            if let Some(fault) = fault {
                motor = sequencer.fail(fault, t_s, &mut hold).or(motor);
            }
        }
        let conditions = &second.conditions;
        sink(Event::Second(event::Second {
            t_s: second.end_s(),
            index_deg,
            fog_arcsec: rate.fog_arcsec,
            moment_arcsec_s: second.moment_arcsec_s,
            rate_deg_h: seen.rate_deg_h,
            temp_c: conditions.temp_c,
            level: conditions.level.map(|mean| LevelMoments { mean, first: second.level_moment }),
            lost_frames: second.lost_frames,
            dwell: seen.dwell,
            collected: seen.collected,
            waited_at: seen.waited_at,
        }));
        consequences.into_iter().for_each(&mut *sink);
        self.seconds = self.seconds.wrapping_add(1);
        if self.seconds.is_multiple_of(HEALTH_SECONDS) && self.reported != self.counters {
            self.reported = self.counters;
            sink(Event::Health(self.counters));
        }
        motor
    }
}

#[inline(always)]
fn sequencer(settings: &Settings) -> Result<Sequencer, Fault> {
    let model = settings.model.clone().unwrap_or_default();
    Ok(Sequencer::new(settings.rules(), Accumulator::new(settings.declared()?, model, Vec::new())))
}

/// What the calibration tells, as events of the instrument.
fn calibration_events(event: field::Event, sink: &mut dyn FnMut(Event)) {
    match event {
        field::Event::Started => sink(Event::State(State::Calibrating)),
        field::Event::Guidance(guidance) => sink(Event::Guidance(guidance)),
        field::Event::Solved(solved) => sink(Event::Calibration(solved)),
        field::Event::Stored => {
            sink(Event::CalibrationStored);
            sink(Event::State(State::Finished));
        }
        field::Event::Failed(reason) => {
            sink(Event::NoCalibration(reason));
            sink(Event::State(State::Failed));
        }
    }
}

const _: () = assert!(SAMPLES_PER_SECOND as f64 * SAMPLE_S == 1.0);
