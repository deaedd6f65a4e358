//! The instrument: bytes, readings and time in; reports, the motor's commands and the flash out.
//!
//! All modules are composed here, in the order in which a sample meets them, and every engine runs it the same way: the board,
//! the same image in QEMU, and the run in this process only wire it to their ports. A tick's own work is [`Instrument::step`]. What a
//! second leads to takes many times as long, the azimuth most: the work on it is handed over ([`Instrument::second_to_work_on`]) and
//! comes back when it is done ([`Instrument::worked_on`]); a board gives it to a task of low priority. Solving a calibration takes
//! longer still and goes the same way ([`Instrument::posed`], [`Instrument::solved`]).

pub mod analogue;
mod contradiction;
pub mod gather;
pub mod guard;
pub mod replay;
mod requests;
mod seconds;
pub mod self_test;
pub mod session;
pub mod update;
pub mod watch;
pub mod workspace;

use core::ops::DerefMut;

use calibration::ellipsoid::Correction;
use calibration::field;
use embedded_storage::nor_flash::NorFlash;
use heapless::Deque;
use north_boot::CRC_32;

use crate::drivers::adxl355::Measurement;
use crate::drivers::analogue::Conversion;
use crate::drivers::intake::{Intake, Received};
use crate::drivers::sensors::Due;
use crate::effects::ErrorModel;
use crate::event::identity::Identity;
use crate::event::raw::{Item, Stream};
use crate::event::restart::{Crash, Provocation};
use crate::event::service::flash::LogFlash;
use crate::event::service::log::FixLog;
use crate::event::service::record::Record;
use crate::event::{Event, Report, State};
use crate::fix::heading::Keeper;
use crate::health::{Counters, Fault};
use crate::link::RequestDecoder;
use crate::sensing::frame::setup::{Progress, Setup};
use crate::sensing::frame::{Frame, FrameReader};
use crate::sensing::index::{IndexAngle, IndexSettings, MotorCommand};
use crate::sensing::sample::{GyroSettings, RateSecond, SAMPLE_S, SAMPLES_PER_SECOND};
use crate::sequence::Command;
use crate::sequence::work::SecondWork;
use crate::settings::Settings;
use crate::settings::pieces::Incoming;
use crate::settings::store::{self, Found};
use analogue::Analogue;
use contradiction::Contradiction;
use gather::Gatherer;
pub use seconds::EFFECT_TICKS;
use seconds::{Ended, MOST_WAITING, Scatter};
use self_test::{BoardFacts, SelfTest};
use session::Session;
use update::{CONFIRMED_TICKS, Slots};
use watch::GyroWatch;
use workspace::Workspace;

/// Most lost ticks that are made up for: the watchdog would have ended a longer stand.
const MOST_LOST: u64 = 1200;
/// Encoder readings in a row that may fail: 0.25 s of them.
const ENCODER_PATIENCE: u16 = 25;

/// Bytes of the gyro that are looked at together while it is set up.
const SETUP_BYTES: usize = 64;

/// What a tick (every 2.5 ms) brought, beside bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Number of the tick, from 0; its time is `tick · 2.5 ms`.
    pub tick: u64,
    pub sensors: Due,
    pub analogue: Option<Conversion>,
    /// Whether the step generator is running.
    pub turning: bool,
    /// Whether the limit input is open; it says nothing where no switch is wired to it.
    pub limit_open: bool,
    /// Bytes that had come: what came later is of a later tick.
    pub heard: Received,
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
    /// The accelerometer shall do its own test.
    pub test_accelerometer: bool,
    /// Other settings are in flash: power up again, after the reports of this step are out.
    pub restart: bool,
    /// A byte for the gyro.
    pub gyro: Option<u8>,
    /// Crash, to see that it is survived.
    pub provoke: Option<Provocation>,
}

/// What is told of all that enters.
enum Streaming {
    Off,
    /// From the beginning of the next second.
    Requested,
    On(Stream),
}

/// Everything that has a state, but the flash. `S` is how the sequencer is held, which is lent out while it works on a second, `R` how
/// the room for settings and attitudes is.
pub struct Instrument<S, R> {
    identity: Identity,
    requests: RequestDecoder,
    /// `None`: it is lent out to solve a calibration.
    workspace: Option<R>,
    streaming: Streaming,
    reader: FrameReader,
    gatherer: Gatherer,
    watch: GyroWatch,
    /// While the gyro is told what it shall send: what comes from it are no frames.
    setup: Option<Setup>,
    contradiction: Contradiction,
    /// Largest bias that is declared, °/h.
    bias_limit_deg_h: f64,
    /// The sequencer; `None`: it is handed over with the first of `ended`.
    work: Option<S>,
    /// Its state before it was handed over, and what the motor goes by.
    state: State,
    index_settings: IndexSettings,
    index: IndexAngle,
    /// Whether the limit switch is open, where there is one.
    limit_open: Option<bool>,
    /// Seconds that wait to be worked on.
    ended: Deque<Ended, MOST_WAITING>,
    /// The first of them is worked on, or its effect is to come.
    working: bool,
    /// What was requested of the sequencer meanwhile.
    requested: Option<Command>,
    fault: Option<Fault>,
    /// The reason why no fix can be started, if none can.
    refusal: Option<Fault>,
    /// The slots of an update, on a board that has them, and the tick at which the image that runs is to confirm itself, if it has not yet.
    slots: Option<&'static mut dyn Slots>,
    confirm_at: Option<u64>,
    session: Session,
    /// A calibration of the accelerometers is in effect.
    level_is_calibrated: bool,
    /// The calibration of the accelerometers.
    field: field::Session,
    /// Holds the heading of a fix, where there is a block of three gyros.
    keeper: Option<Keeper>,
    nmea: bool,
    analogue: Analogue,
    /// Where the error model wants the block's temperature, if it does.
    block_temperature: Option<usize>,
    counters: Counters,
    reported: Counters,
    seconds: u32,
    /// Seconds of the gyro that ended since the last tick.
    finished: Deque<RateSecond, 4>,
    tick: u64,
    next_tick: u64,
    encoder_failures: u16,
    test: SelfTest,
    log: FixLog,
    /// The last fix is in the log, so that a check may follow it.
    last_logged: bool,
    scatter: Scatter,
    /// Identity of the error model in use; 0: there is none.
    model: u32,
    /// Time of day of tick 0, seconds since 1970, where a host has told it.
    clock_utc_s: Option<f64>,
}

impl<S: DerefMut<Target = SecondWork>, R: DerefMut<Target = Workspace>> Instrument<S, R> {
    /// Powered up, with what the flash holds. `work`: with an empty sequencer.
    pub fn power_up(flash: &mut impl NorFlash, identity: Identity, work: S, workspace: R) -> Self {
        let mut instrument = Self::empty(identity, work, workspace);
        instrument.set_up(flash, &mut || ());
        instrument
    }

    /// Before it is set up.
    // Inlined, so that it is made where it stays: copies of it would take tens of kilobytes of a board's stack.
    #[inline(always)]
    pub fn empty(identity: Identity, work: S, workspace: R) -> Self {
        let gyro = GyroSettings::default();
        Self {
            identity,
            requests: RequestDecoder::new(),
            workspace: Some(workspace),
            streaming: Streaming::Off,
            reader: FrameReader::new(gyro.format),
            gatherer: Gatherer::new(gyro, Correction::UNIT),
            analogue: Analogue::default(),
            block_temperature: None,
            watch: GyroWatch::new(&gyro),
            setup: None,
            contradiction: Contradiction::default(),
            bias_limit_deg_h: gyro.bias_limit_deg_h,
            work: Some(work),
            state: State::Idle,
            index_settings: IndexSettings::default(),
            index: IndexAngle::default(),
            limit_open: None,
            ended: Deque::new(),
            working: false,
            requested: None,
            fault: None,
            refusal: Some(Fault::SettingsMissing),
            slots: None,
            confirm_at: None,
            session: Session::default(),
            level_is_calibrated: false,
            field: field::Session::default(),
            keeper: None,
            nmea: false,
            counters: Counters::default(),
            reported: Counters::default(),
            seconds: 0,
            finished: Deque::new(),
            tick: 0,
            next_tick: 0,
            encoder_failures: 0,
            test: SelfTest::at_start(),
            log: FixLog::default(),
            last_logged: true,
            scatter: Scatter::default(),
            model: 0,
            clock_utc_s: None,
        }
    }

    /// What the board found of itself, for the self-test.
    pub fn board_is(&mut self, facts: BoardFacts) {
        self.session.set_entropy(facts.entropy);
        self.analogue.calibrate(facts.analogue.of_chip());
        self.test.board_is(facts);
    }

    /// Where images of updates come; without, they are refused.
    pub fn updates_go_to(&mut self, slots: Option<&'static mut dyn Slots>) {
        self.identity.free_slot = slots.as_ref().map_or(0, |slots| slots.free_origin());
        self.confirm_at = slots.is_some().then_some(CONFIRMED_TICKS);
        self.slots = slots;
    }

    /// Takes what the flash holds. Without valid settings the instrument still samples and reports, but starts no fix.
    ///
    /// Never inlined: the settings shall take the caller's stack only here.
    ///
    /// A full log takes seconds to read: `alive` is called after each of its records.
    #[inline(never)]
    pub fn set_up(&mut self, flash: &mut impl NorFlash, alive: &mut dyn FnMut()) {
        // A flash that cannot be prepared will say so when settings are stored.
        let _ = store::prepare(flash);
        let mut settings = Settings::default();
        // A flash that cannot be read is as good as corrupt.
        let scratch =
            self.workspace.as_deref_mut().and_then(Workspace::settings).map(Incoming::scratch).unwrap_or_default();
        self.refusal = match store::load_into(flash, scratch, &mut settings).unwrap_or(Found::Corrupt) {
            Found::Valid => {
                self.model = settings.model.as_ref().map_or(0, |model| model_identity(model, scratch));
                self.take(&mut settings).err()
            }
            Found::Missing => Some(Fault::SettingsMissing),
            Found::Corrupt => Some(Fault::SettingsCorrupt),
        };
        self.open_log(flash, alive);
    }

    /// Reads the log: the watch goes on where it was, if the error model is the same.
    #[inline(never)]
    fn open_log(&mut self, flash: &mut impl NorFlash, alive: &mut dyn FnMut()) {
        let mut service = self.work.as_deref_mut().map(|work| &mut work.service);
        let model = self.model;
        let mut told = |record: &Record| {
            alive();
            if let Some(service) = &mut service {
                service.replay(record, model);
            }
        };
        // A flash that cannot be read has no log; that it takes no fix either is counted.
        self.log = FixLog::open(&mut LogFlash(flash), &mut told).unwrap_or_default();
        let _ = self.log.prepare(&mut LogFlash(flash));
        if let Some(service) = service {
            service.switched_on(model);
        }
    }

    /// Keeps in the log what a crash left behind, for whoever looks when all else is forgotten.
    #[inline(never)]
    pub fn log_crash(&mut self, crash: &Crash, flash: &mut impl NorFlash) {
        // It is told over the link as well.
        let _ = self.log.crash(&mut LogFlash(flash), crash);
    }

    /// Takes settings that were stored. Errors: why no fix can be started with them.
    fn take(&mut self, settings: &mut Settings) -> Result<(), Fault> {
        self.reader = FrameReader::new(settings.gyro.format);
        self.test.set_up(settings.gyro.format);
        self.nmea = settings.link.nmea;
        self.session.set_key(settings.link.key);
        self.setup = settings.gyro.configure.then(Setup::default);
        self.bias_limit_deg_h = settings.gyro.bias_limit_deg_h;
        self.watch = GyroWatch::new(&settings.gyro);
        self.gatherer = Gatherer::new(settings.gyro, settings.triad());
        self.level_is_calibrated = settings.accelerometer.is_some();
        self.block_temperature = settings.model.as_ref().and_then(ErrorModel::block_temperature);
        self.analogue.set_up(settings.analogue, settings.model.as_ref());
        self.keeper = settings.block.map(|block| Keeper::new(&block, settings.latitude_deg, settings.level.sigma_deg));
        // What no board measures cannot be compensated: such a model is for recordings.
        if settings.model.as_ref().is_some_and(|model| model.off_board(&settings.channels()).is_some()) {
            return Err(Fault::SettingsInvalid);
        }
        let declared = settings.declared()?;
        let rules = settings.rules();
        self.index_settings = rules.index;
        self.index = IndexAngle::new(rules.index.travel_from_deg);
        if let Some(work) = &mut self.work {
            work.sequencer.set_up(rules, declared, settings.model.get_or_insert_default());
        }
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

    /// Whether NMEA sentences go over the host's line.
    pub fn speaks_nmea(&self) -> bool {
        self.nmea
    }

    /// What the motor goes by. (Where no fix can be started, it never turns.)
    pub fn index_settings(&self) -> IndexSettings {
        self.index_settings
    }

    /// A tick of 2.5 ms: what it brought, and what came in on the lines.
    ///
    /// Never inlined, as [`Self::second_to_work_on`]: a caller's loop would prepare in every tick what only some of them need.
    #[inline(never)]
    pub fn step(&mut self, readings: &Readings, intake: &Intake, flash: &mut impl NorFlash, report: Sink) -> Orders {
        self.tick = readings.tick;
        let sink: &mut dyn FnMut(Event) = &mut |event| report(Report { t_s: readings.t_s(), event });

        let mut orders = Orders::default();
        if self.confirm_at.is_some_and(|at| readings.tick >= at) {
            self.confirm();
        }
        if readings.tick != self.next_tick {
            self.make_up(readings.tick, sink);
        }
        self.next_tick = readings.tick + 1;
        self.limit_open = self.index_settings.limit_switch.then_some(readings.limit_open);
        if !intake.host.is_empty(readings.heard.host) {
            self.receive_requests(readings, intake, flash, &mut orders, sink);
        }
        if self.setup.is_some() {
            self.set_up_gyro(readings, intake, &mut orders, sink);
        } else {
            while !intake.gyro.is_empty(readings.heard.gyro)
                && self.reader.fill(|place| intake.gyro.take(readings.heard.gyro, place)) > 0
            {
                self.receive_frames(sink);
            }
        }
        self.read(&readings.sensors, sink);
        readings.analogue.into_iter().for_each(|conversion| self.analogue.push(conversion));
        if self.field.is_active() {
            self.calibrate(flash, sink);
        }
        let given_up = self.gatherer.tick(&mut self.counters);
        self.keep(given_up);
        self.stream(|| Item::Tick, sink);

        let fresh = matches!(readings.sensors, Due::Index(Some(_)));
        let index = self.index;
        if let Some(work) = self.idle_work() {
            let moved = work.sequencer.tick(readings.tick, index, fresh, readings.turning, sink);
            orders.motor = moved.or(orders.motor);
        }
        if self.test.is_under_way() {
            self.test(readings, &mut orders, sink);
        }
        let encoder = (self.encoder_failures >= ENCODER_PATIENCE).then_some(Fault::EncoderFailed);
        let limit = (self.limit_open == Some(true)).then_some(Fault::IndexLimit);
        if let Some(fault) = self.watch.tick(readings.tick).or(encoder).or(limit) {
            orders.motor = self.fail(fault, readings.t_s(), sink).or(orders.motor);
        }
        if !self.finished.is_empty() {
            intake.tell(&mut self.counters);
            self.end_seconds(sink);
        }
        let effect = self.take_effect(flash, &mut |t_s, event| report(Report { t_s, event }));
        orders.motor = effect.or(orders.motor);
        orders
    }

    /// The image that runs confirms itself; where that does not hold, it tries again after a second.
    #[inline(never)]
    fn confirm(&mut self) {
        let confirmed = self.slots.as_mut().is_none_or(|slots| slots.confirm());
        self.confirm_at = (!confirmed).then_some(self.tick + u64::from(SAMPLES_PER_SECOND));
    }

    /// A tick in which the gyro is told what to send.
    #[inline(never)]
    fn set_up_gyro(&mut self, readings: &Readings, intake: &Intake, orders: &mut Orders, sink: &mut dyn FnMut(Event)) {
        let mut place = [0; SETUP_BYTES];
        let Some(mut setup) = self.setup.take() else { return };
        loop {
            let length = intake.gyro.take(readings.heard.gyro, &mut place);
            if length == 0 {
                break;
            }
            place.iter().take(length).for_each(|&byte| setup.hear(byte));
        }
        match setup.tick() {
            Progress::UnderWay(byte) => {
                self.setup = Some(setup);
                orders.gyro = byte;
            }
            Progress::Done => {}
            Progress::Unanswered => {
                let fault = Fault::GyroUnanswered;
                match self.fail(fault, readings.t_s(), sink) {
                    Some(stop) => orders.motor = Some(stop),
                    None => sink(Event::Fault { fault, state: State::Idle }),
                }
                self.refusal.get_or_insert(fault);
            }
        }
    }

    /// Bytes of the gyro.
    #[inline(never)]
    fn receive_frames(&mut self, sink: &mut dyn FnMut(Event)) {
        while let Some(frame) = self.reader.next() {
            self.frame(&frame, sink);
        }
        self.counters.bytes_skipped = self.reader.bytes_skipped();
        self.counters.frames_bad_crc = self.reader.bad_crc();
    }

    /// Lends out the room with the attitudes of the accelerometers that are to be solved for, if there are any.
    pub fn posed(&mut self) -> Option<R> {
        self.workspace.take_if(|_| self.field.is_posed())
    }

    /// That room is lent out.
    pub fn is_solving(&self) -> bool {
        self.workspace.is_none()
    }

    /// Takes the room back with the answer in it, whenever it comes; one that nobody waits for any more is dropped.
    pub fn solved(&mut self, room: R) {
        if let Some(answer) = room.answer() {
            self.field.solved(answer);
        }
        self.workspace = Some(room);
    }

    /// Tells of something that entered, if that is wanted.
    #[inline(always)]
    fn stream(&mut self, item: impl FnOnce() -> Item, sink: &mut dyn FnMut(Event)) {
        if let Streaming::On(stream) = &mut self.streaming {
            push(stream, &item(), sink);
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
    #[inline(never)]
    fn make_up(&mut self, tick: u64, sink: &mut dyn FnMut(Event)) {
        let lost = tick.saturating_sub(self.next_tick).min(MOST_LOST);
        self.counters.ticks_lost = self.counters.ticks_lost.saturating_add(lost as u32);
        for _ in 0..lost {
            let given_up = self.gatherer.tick(&mut self.counters);
            self.keep(given_up);
            self.stream(|| Item::Tick, sink);
        }
    }

    fn frame(&mut self, frame: &Frame, sink: &mut dyn FnMut(Event)) {
        self.stream(|| Item::Frame(*frame), sink);
        self.watch.heard(self.tick);
        if self.test.is_under_way() {
            self.test.frame(frame);
        }
        let second = self.gatherer.frame(frame, &mut self.counters);
        self.keep(second);
    }

    /// A tick of the self-test. Its move waits while the sequencer is lent out, which watches the index.
    #[inline(never)]
    fn test(&mut self, readings: &Readings, orders: &mut Orders, sink: &mut dyn FnMut(Event)) {
        if self.test.moves()
            && let Some(work) = self.idle_work()
        {
            work.sequencer.exercise();
            let fresh = matches!(readings.sensors, Due::Index(Some(_)));
            let settings = self.refusal.is_none().then_some(self.index_settings);
            let moved = self.test.turn(self.index.deg(), fresh, readings.turning, settings);
            orders.motor = moved.or(orders.motor);
        }
        orders.test_accelerometer = self.test.tick(&readings.sensors);
        if let Some(finding) = self.test.next(self.refusal, self.keeper.is_some(), self.limit_open) {
            sink(Event::SelfTest(finding));
        }
    }

    fn state(&self) -> State {
        match self.refusal {
            Some(_) if !self.field.is_active() => State::Failed,
            _ => self.activity(),
        }
    }

    /// What is under way, whether a fix can be started or not.
    fn activity(&self) -> State {
        if self.field.is_active() {
            return State::Calibrating;
        }
        self.work.as_ref().filter(|_| !self.working).map_or(self.state, |work| work.sequencer.state())
    }

    /// A fix or a calibration is under way.
    fn is_busy(&self) -> bool {
        !matches!(self.activity(), State::Idle | State::Finished | State::Failed)
    }

    #[inline(never)]
    fn calibrate(&mut self, flash: &mut impl NorFlash, sink: &mut dyn FnMut(Event)) {
        if let Some(calibration) = self.field.tick(&mut |event| calibration_events(event, sink)) {
            self.gatherer.set_triad(calibration.correction());
            self.level_is_calibrated = true;
        }
        if let Some(calibration) = self.field.to_store() {
            let change = |settings: &mut Settings| settings.accelerometer = Some(calibration);
            let scratch = self.workspace.as_deref_mut().and_then(Workspace::settings).map(Incoming::scratch);
            let stored = scratch.is_some_and(|scratch| store::update(flash, scratch, change).is_ok());
            self.field.stored(stored);
        }
    }

    #[inline(never)]
    fn read(&mut self, due: &Due, sink: &mut dyn FnMut(Event)) {
        let failed = |count: &mut u32| *count = count.saturating_add(1);
        match due {
            Due::Nothing | Due::Response(_) => {}
            Due::Acceleration(reading) => {
                match reading {
                    Some(Measurement { acceleration, temperature }) => {
                        self.stream(|| Item::Acceleration(*acceleration), sink);
                        self.gatherer.acceleration(*acceleration);
                        self.gatherer.level_temperature(*temperature);
                    }
                    None => failed(&mut self.counters.accelerometer_errors),
                }
                if let Some(collection) = self.workspace.as_deref_mut().and_then(Workspace::attitudes) {
                    let acceleration = reading.map(|reading| reading.acceleration);
                    self.field.reading(collection, acceleration, &mut |event| calibration_events(event, sink));
                }
            }
            &Due::Index(Some(index)) => {
                self.stream(|| Item::Index(index), sink);
                self.gatherer.index(index);
                self.index.push(index);
                self.encoder_failures = 0;
            }
            Due::Index(None) => {
                failed(&mut self.counters.encoder_errors);
                self.encoder_failures = self.encoder_failures.saturating_add(1);
            }
            Due::Block(sample) => {
                if let Some(sample) = sample {
                    self.gatherer.block_temperature(sample.temperature);
                }
                if let Some(keeper) = &mut self.keeper
                    && let Some(heading) = keeper.push(sample.as_ref(), &mut self.counters)
                {
                    sink(Event::Heading(heading));
                }
            }
        }
    }
}

/// CRC-32 of an error model as it is stored.
fn model_identity(model: &ErrorModel, scratch: &mut [u8]) -> u32 {
    postcard::to_slice(model, scratch).map_or(0, |content| CRC_32.checksum(content))
}

/// Puts something that entered into the stream; tells the block that is full with it.
#[inline(never)]
fn push(stream: &mut Stream, item: &Item, sink: &mut dyn FnMut(Event)) {
    if let Some(block) = stream.push(item) {
        sink(Event::Raw(block));
    }
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
