//! The instrument: bytes, readings and time in; reports, the motor's commands and the flash out.
//!
//! All modules are composed here, in the order in which a sample meets them, and every engine runs it the same way: the board,
//! the same image in QEMU, and the run in this process only wire it to their ports. Solving a calibration takes as long as many
//! ticks, so the problem is handed out ([`Instrument::problem`]) and its answer comes back ([`Instrument::solved`]).

use embedded_storage::nor_flash::NorFlash;
use heapless::{Deque, Vec};
use serde::{Deserialize, Serialize};

use crate::calibration::ellipsoid::Correction;
use crate::calibration::field::problem::{Problem, Solved};
use crate::calibration::field::refusal::NoCalibration;
use crate::calibration::field::{self, Session};
use crate::drivers::sensors::Due;
use crate::effects::ErrorModel;
use crate::event::{self, Event, Report, State};
use crate::frame::{Frame, FrameReader};
use crate::gather::{Gathered, Gatherer};
use crate::heading::Keeper;
use crate::health::{Counters, Fault, Refusal};
use crate::identity::Identity;
use crate::index::{IndexSettings, MotorCommand};
use crate::intake::Intake;
use crate::level::LevelMoments;
use crate::link::{Ask, Request, RequestDecoder};
use crate::raw::{Item, Stream};
use crate::reading::Reading;
use crate::restart::{Provocation, Text};
use crate::sample::{GyroSettings, RateSecond, SAMPLE_S, SAMPLES_PER_SECOND};
use crate::sequence::{Command, Seen, Sequencer};
use crate::settings::Settings;
use crate::settings::pieces::Incoming;
use crate::settings::store::{self, Found};
use crate::watch::GyroWatch;

/// Seconds between two reports of the counters, if they changed.
const HEALTH_SECONDS: u32 = 10;
/// Most violations of settings that are told.
const VIOLATIONS: usize = 8;
/// Bytes are taken from the lines in parts of this many.
const PART: usize = 64;
/// Most lost ticks that are made up for: the watchdog would have ended a longer stand.
const MOST_LOST: u64 = 1200;
/// Encoder readings in a row that may fail: 0.25 s of them.
const ENCODER_PATIENCE: u16 = 25;

/// What a tick (every 2.5 ms) brought, beside bytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Readings {
    /// Number of the tick, from 0; its time is `tick · 2.5 ms`.
    pub tick: u64,
    pub sensors: Due,
    /// Whether the step generator is running.
    pub turning: bool,
}

impl Readings {
    /// Time of the tick, seconds since the first.
    pub fn t_s(&self) -> f64 {
        self.tick as f64 * SAMPLE_S
    }
}

/// Takes reports out of the instrument.
pub type Sink<'a> = &'a mut dyn FnMut(Report);

/// What a step asks of its surroundings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Orders {
    pub motor: Option<MotorCommand>,
    /// Other settings are in flash: power up again, after the reports of this step are out.
    pub restart: bool,
    /// Crash, to see that it is survived.
    pub provoke: Option<Provocation>,
}

/// What is told of all that enters.
enum Streaming {
    Off,
    /// From the beginning of the next second.
    Asked,
    On(Stream),
}

/// Everything that has a state, but the flash.
pub struct Instrument {
    identity: Identity,
    requests: RequestDecoder,
    incoming: Incoming,
    streaming: Streaming,
    reader: FrameReader,
    gatherer: Gatherer,
    watch: GyroWatch,
    sequencer: Sequencer,
    /// The reason why no fix can be started, if none can.
    refusal: Option<Fault>,
    /// The calibration of the accelerometers.
    field: Session,
    /// Holds the heading of a fix, where there is a block of three gyros.
    keeper: Option<Keeper>,
    /// Where the error model wants the block's temperature, if it does.
    block_temperature: Option<usize>,
    counters: Counters,
    reported: Counters,
    seconds: u32,
    /// Seconds that ended since the last tick.
    finished: Deque<RateSecond, 4>,
    tick: u64,
    next_tick: u64,
    encoder_failures: u16,
}

impl Instrument {
    /// Powered up, with what the flash holds.
    pub fn power_up(flash: &mut impl NorFlash, identity: Identity) -> Self {
        let mut instrument = Self::empty(identity);
        instrument.set_up(flash);
        instrument
    }

    /// Before it is set up.
    // Inlined, so that it is made where it stays: copies of it would take tens of kilobytes of a board's stack.
    #[inline(always)]
    pub fn empty(identity: Identity) -> Self {
        let gyro = GyroSettings::default();
        Self {
            identity,
            requests: RequestDecoder::new(),
            incoming: Incoming::default(),
            streaming: Streaming::Off,
            reader: FrameReader::new(gyro.format),
            gatherer: Gatherer::new(gyro, Correction::UNIT),
            block_temperature: None,
            watch: GyroWatch::default(),
            sequencer: Sequencer::empty(),
            refusal: Some(Fault::SettingsMissing),
            field: Session::default(),
            keeper: None,
            counters: Counters::default(),
            reported: Counters::default(),
            seconds: 0,
            finished: Deque::new(),
            tick: 0,
            next_tick: 0,
            encoder_failures: 0,
        }
    }

    /// Takes what the flash holds. Without valid settings the instrument still samples and reports, but starts no fix.
    ///
    /// Never inlined: the settings shall take the caller's stack only here.
    #[inline(never)]
    pub fn set_up(&mut self, flash: &mut impl NorFlash) {
        // A flash that cannot be prepared will say so when settings are stored.
        let _ = store::prepare(flash);
        let mut settings = Settings::default();
        // A flash that cannot be read is as good as corrupt.
        self.refusal = match store::load_into(flash, &mut settings).unwrap_or(Found::Corrupt) {
            Found::Valid => self.take(&mut settings).err(),
            Found::Missing => Some(Fault::SettingsMissing),
            Found::Corrupt => Some(Fault::SettingsCorrupt),
        };
    }

    /// Takes settings that were stored. Errors: why no fix can be started with them.
    fn take(&mut self, settings: &mut Settings) -> Result<(), Fault> {
        self.reader = FrameReader::new(settings.gyro.format);
        self.gatherer = Gatherer::new(settings.gyro, settings.triad());
        self.block_temperature = settings.model.as_ref().and_then(ErrorModel::block_temperature);
        self.keeper = settings.block.map(|block| Keeper::new(&block, settings.latitude_deg, settings.level.sigma_deg));
        // What no board measures cannot be compensated: such a model is for recordings.
        if settings.model.as_ref().is_some_and(|model| model.off_board(settings.block.is_some()).is_some()) {
            return Err(Fault::SettingsInvalid);
        }
        let declared = settings.declared()?;
        self.sequencer.set_up(settings.rules(), declared, settings.model.get_or_insert_default());
        Ok(())
    }

    /// Why no fix can be started, if none can.
    pub fn refusal(&self) -> Option<Fault> {
        self.refusal
    }

    /// Whether there is a block of three gyros to be read.
    pub fn has_block(&self) -> bool {
        self.keeper.is_some()
    }

    /// What the motor goes by. (Where no fix can be started, it never turns.)
    pub fn index_settings(&self) -> IndexSettings {
        self.sequencer.rules().index
    }

    /// A tick of 2.5 ms: what it brought, and what came in on the lines.
    pub fn step(&mut self, readings: &Readings, intake: &Intake, flash: &mut impl NorFlash, report: Sink) -> Orders {
        self.tick = readings.tick;
        let t_s = readings.t_s();
        let mut sink = |event| report(Report { t_s, event });

        let mut orders = Orders::default();
        intake.tell(&mut self.counters);
        self.make_up(readings.tick, &mut sink);
        let mut place = [0; PART];
        loop {
            let bytes = intake.host.take(&mut place);
            if bytes.is_empty() {
                break;
            }
            for &byte in bytes {
                self.request_byte(byte, readings.turning, flash, &mut orders, &mut sink);
            }
        }
        loop {
            let mut bytes = intake.gyro.take(&mut place);
            if bytes.is_empty() {
                break;
            }
            while let Some(frame) = self.reader.next(&mut bytes) {
                self.frame(&frame, &mut sink);
            }
        }
        self.read(readings, &mut sink);
        self.calibrate(readings, flash, &mut sink);
        if let Reading::Value(sample) = &readings.sensors.block {
            self.gatherer.block_temperature(sample.temperature);
        }
        if let Some(keeper) = &mut self.keeper
            && let Some(heading) = keeper.tick(readings.sensors.block, &mut self.counters)
        {
            sink(Event::Heading(heading));
        }
        let given_up = self.gatherer.tick(&mut self.counters);
        self.keep(given_up);
        self.stream(&Item::Tick, &mut sink);

        let watched = self.watch.tick(readings.tick);
        let encoder = (self.encoder_failures >= ENCODER_PATIENCE).then_some(Fault::EncoderFailed);
        let moved = self.sequencer.tick(t_s, readings.sensors.index.value(), readings.turning, &mut sink);
        orders.motor = moved.or(orders.motor);
        if let Some(fault) = watched.or(encoder) {
            orders.motor = self.sequencer.fail(fault, t_s, &mut sink).or(orders.motor);
        }
        if !self.finished.is_empty() {
            self.end_block(&mut sink);
        }
        while let Some(rate) = self.finished.pop_front() {
            orders.motor = self.second(&rate, t_s, &mut sink).or(orders.motor);
            if matches!(self.streaming, Streaming::Asked) && self.gatherer.sampler().slots() == 0 {
                self.streaming = Streaming::On(Stream::default());
            }
        }
        orders
    }

    /// Puts attitudes of the accelerometers to be solved for into `place`, once; `false`: there are none. The answer goes to
    /// [`Self::solved`].
    pub fn problem(&mut self, place: &mut Problem) -> bool {
        self.field.problem(place)
    }

    /// The answer to the problem, whenever it comes; one that nobody waits for any more is dropped.
    pub fn solved(&mut self, answer: Result<Solved, NoCalibration>) {
        self.field.solved(answer);
    }

    /// Tells of something that entered, if that is wanted.
    fn stream(&mut self, item: &Item, sink: &mut dyn FnMut(Event)) {
        if let Streaming::On(stream) = &mut self.streaming
            && let Some(block) = stream.push(item)
        {
            sink(Event::Raw(block));
        }
    }

    fn end_block(&mut self, sink: &mut dyn FnMut(Event)) {
        if let Streaming::On(stream) = &mut self.streaming
            && let Some(block) = stream.flush()
        {
            sink(Event::Raw(block));
        }
    }

    /// Ticks that nobody saw pass for the gyro too: its frames of that time are lost, or late.
    fn make_up(&mut self, tick: u64, sink: &mut dyn FnMut(Event)) {
        let lost = tick.saturating_sub(self.next_tick).min(MOST_LOST);
        self.next_tick = tick + 1;
        self.counters.ticks_lost = self.counters.ticks_lost.saturating_add(lost as u32);
        for _ in 0..lost {
            let given_up = self.gatherer.tick(&mut self.counters);
            self.keep(given_up);
            self.stream(&Item::Tick, sink);
        }
    }

    fn frame(&mut self, frame: &Frame, sink: &mut dyn FnMut(Event)) {
        self.stream(&Item::Frame(*frame), sink);
        self.watch.heard(self.tick);
        let second = self.gatherer.frame(frame, &mut self.counters);
        self.keep(second);
    }

    /// Never inlined, as others below: what it takes of the stack is free again for what comes after it.
    #[inline(never)]
    fn request_byte(
        &mut self,
        byte: u8,
        turning: bool,
        flash: &mut impl NorFlash,
        orders: &mut Orders,
        sink: &mut dyn FnMut(Event),
    ) {
        let (number, refusal) = match self.requests.feed(byte) {
            None => return,
            Some(Ok(Request { number, ask })) => (number, self.asked(ask, turning, flash, orders, sink).err()),
            Some(Err(bad)) => (0, Some(bad.into())),
        };
        if refusal.is_some() {
            self.counters.commands_bad = self.counters.commands_bad.saturating_add(1);
        }
        sink(Event::Answer { number, refusal });
        if orders.restart {
            sink(Event::SettingsStored);
        }
    }

    fn asked(
        &mut self,
        ask: Ask,
        turning: bool,
        flash: &mut impl NorFlash,
        orders: &mut Orders,
        sink: &mut dyn FnMut(Event),
    ) -> Result<(), Refusal> {
        match ask {
            Ask::Command(command) => {
                let motor = self.obey(command, sink)?;
                orders.motor = motor.or(orders.motor);
            }
            Ask::Identify => sink(Event::Identity(self.identity)),
            Ask::Status => {
                sink(Event::State(self.state()));
                sink(Event::Health(self.counters));
            }
            Ask::ReadSettings { offset } => sink(Event::Settings(store::read_piece(flash, offset)?)),
            Ask::WriteSettings(piece) => {
                if self.incoming.take(&piece)? {
                    // The processor stands still while flash is erased.
                    if turning {
                        return Err(Refusal::MotorTurns);
                    }
                    store(flash, &self.incoming, sink)?;
                    orders.restart = true;
                }
            }
            Ask::Stream(true) if matches!(self.streaming, Streaming::Off) => self.streaming = Streaming::Asked,
            Ask::Stream(true) => {}
            Ask::Stream(false) => {
                self.end_block(sink);
                self.streaming = Streaming::Off;
            }
            Ask::Provoke(how) => orders.provoke = Some(how),
        }
        Ok(())
    }

    fn state(&self) -> State {
        if self.field.is_active() {
            return State::Calibrating;
        }
        self.refusal.map_or(self.sequencer.state(), |_| State::Failed)
    }

    #[inline(never)]
    fn calibrate(&mut self, readings: &Readings, flash: &mut impl NorFlash, sink: &mut dyn FnMut(Event)) {
        let reading = readings.sensors.acceleration;
        if let Some(calibration) = self.field.tick(reading, &mut |event| calibration_events(event, sink)) {
            self.gatherer.set_triad(calibration.correction());
        }
        if let Some(calibration) = self.field.to_store() {
            let stored = store::update(flash, |settings| settings.accelerometer = Some(calibration));
            self.field.stored(stored.is_ok());
        }
    }

    fn keep(&mut self, second: Option<RateSecond>) {
        if let Some(second) = second {
            // Five seconds between two ticks cannot be: a second has 400 frames, and no more than three are made up for.
            let _ = self.finished.push_back(second);
        }
    }

    #[inline(never)]
    fn obey(&mut self, command: Command, sink: &mut dyn FnMut(Event)) -> Result<Option<MotorCommand>, Refusal> {
        let t_s = self.tick as f64 * SAMPLE_S;
        Ok(match (self.refusal, command) {
            (None, Command::Start) => {
                self.field.abort(&mut |event| calibration_events(event, sink));
                self.watch.restart(self.tick);
                self.encoder_failures = 0;
                self.sequencer.start(t_s, sink)
            }
            (None, Command::CalibrateAccelerometers) => {
                let stop = self.sequencer.fail(Fault::Aborted, t_s, sink);
                self.field.start(*self.gatherer.triad(), &mut |event| calibration_events(event, sink));
                stop
            }
            (None, Command::Abort) => {
                self.field.abort(&mut |event| calibration_events(event, sink));
                self.sequencer.fail(Fault::Aborted, t_s, sink)
            }
            (Some(fault), Command::Start | Command::CalibrateAccelerometers) => {
                sink(Event::Fault { fault, state: State::Idle });
                sink(Event::State(State::Failed));
                return Err(Refusal::NoFix);
            }
            (Some(_), Command::Abort) => None,
        })
    }

    fn read(&mut self, readings: &Readings, sink: &mut dyn FnMut(Event)) {
        if let Reading::Value(reading) = readings.sensors.acceleration {
            self.stream(&Item::Acceleration(reading), sink);
        }
        if let Reading::Value(index) = readings.sensors.index {
            self.stream(&Item::Index(index), sink);
        }
        let counters = &mut self.counters;
        counters.bytes_skipped = self.reader.bytes_skipped();
        counters.frames_bad_crc = self.reader.bad_crc();
        match readings.sensors.acceleration {
            Reading::Value(reading) => self.gatherer.acceleration(reading),
            Reading::Failed => counters.accelerometer_errors = counters.accelerometer_errors.saturating_add(1),
            Reading::NotDue => {}
        }
        match readings.sensors.index {
            Reading::Value(index) => {
                self.gatherer.index(index);
                self.encoder_failures = 0;
            }
            Reading::Failed => {
                counters.encoder_errors = counters.encoder_errors.saturating_add(1);
                self.encoder_failures = self.encoder_failures.saturating_add(1);
            }
            Reading::NotDue => {}
        }
    }

    #[inline(never)]
    fn second(&mut self, rate: &RateSecond, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        let counters = &mut self.counters;
        if !rate.usable {
            counters.seconds_left_out = counters.seconds_left_out.saturating_add(1);
        } else if rate.missing > 0 {
            counters.seconds_repaired = counters.seconds_repaired.saturating_add(1);
        }
        let fault = self.watch.second(rate, self.gatherer.sampler().behind());
        let Gathered { mut second, index_deg, block_temp_c } = self.gatherer.finish(rate, t_s);
        if let (Some(block_temp_c), Some(place)) = (block_temp_c, self.block_temperature)
            && let Some(channel) = second.conditions.channels.get_mut(place)
        {
            *channel = block_temp_c;
        }
        let mut seen = Seen { rate_deg_h: rate.fog_arcsec, ..Seen::default() };
        let mut motor = None;
        // The second is reported before what it led to: a recording that ends with the azimuth holds all of its seconds.
        let mut consequences: Vec<Event, 8> = Vec::new();
        let mut hold = |event| {
            let _ = consequences.push(event);
        };
        if self.refusal.is_none() {
            (seen, motor) = self.sequencer.second(&second, counters, &mut hold);
            if let Some(fault) = fault {
                motor = self.sequencer.fail(fault, t_s, &mut hold).or(motor);
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
            block_temp_c,
            level: conditions.level.map(|mean| LevelMoments { mean, first: second.level_moment }),
            lost_frames: second.lost_frames,
            dwell: seen.dwell,
            collected: seen.collected,
            waited_at: seen.waited_at,
        }));
        for event in consequences {
            if let (Event::Fix(fix), Some(keeper)) = (&event, &mut self.keeper) {
                keeper.fixed(fix);
            }
            sink(event);
        }
        self.seconds = self.seconds.wrapping_add(1);
        if self.seconds.is_multiple_of(HEALTH_SECONDS) && self.reported != self.counters {
            self.reported = self.counters;
            sink(Event::Health(self.counters));
        }
        motor
    }
}

/// Brings settings that came to flash, if they make sense.
fn store(flash: &mut impl NorFlash, incoming: &Incoming, sink: &mut dyn FnMut(Event)) -> Result<(), Refusal> {
    check(incoming, sink)?;
    incoming.save(flash).map_err(|_| Refusal::NotStored)
}

/// Whether settings that came make sense.
///
/// Never inlined: the settings are on the stack only here.
#[inline(never)]
fn check(incoming: &Incoming, sink: &mut dyn FnMut(Event)) -> Result<(), Refusal> {
    let mut settings = Settings::default();
    incoming.read(&mut settings)?;
    let mut result = Ok(());
    for invalid in settings.violations().take(VIOLATIONS) {
        result = Err(Refusal::SettingsInvalid);
        sink(Event::Violation { field: Text::start_of(invalid.field), value: invalid.value });
    }
    result
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

#[cfg(test)]
mod tests;
