//! The instrument: bytes, readings and time in; reports, the motor's commands and the flash out.
//!
//! All modules are composed here, in the order in which a sample meets them, and every engine runs it the same way: the board,
//! the same image in QEMU, and the run in this process only wire it to their ports. A tick's own work is [`Instrument::step`]. What a
//! second leads to takes many times as long, the azimuth most: it is done in slices, one a tick, by [`Instrument::slice`], which lends
//! the sequencer to the work. Solving a calibration takes longer still, so its attitudes are lent out ([`Instrument::posed`]) and come
//! back with the answer ([`Instrument::solved`]).

pub mod workroom;

use core::convert::Infallible;
use core::ops::DerefMut;
use core::pin::Pin;

use embedded_storage::nor_flash::NorFlash;
use heapless::Deque;

use crate::calibration::ellipsoid::Correction;
use crate::calibration::field::{self, Session};
use crate::drivers::sensors::Due;
use crate::effects::ErrorModel;
use crate::event::{self, Event, Report, State};
use crate::frame::{Frame, FrameReader};
use crate::gather::{Gathered, Gatherer};
use crate::heading::Keeper;
use crate::health::{Counters, Fault, Refusal};
use crate::identity::Identity;
use crate::index::{IndexAngle, IndexSettings, MotorCommand};
use crate::intake::{Heard, Intake};
use crate::level::LevelMoments;
use crate::link::{Ask, Request, RequestDecoder};
use crate::raw::{Item, Stream};
use crate::restart::{Provocation, Text};
use crate::sample::{GyroSettings, RateSecond, SAMPLE_S, SAMPLES_PER_SECOND};
use crate::self_test::{BoardFacts, SelfTest};
use crate::sequence::desk::Desk;
use crate::sequence::{Command, Seen, Sequencer};
use crate::settings::Settings;
use crate::settings::pieces::Incoming;
use crate::settings::store::{self, Found};
use crate::watch::GyroWatch;
use workroom::Workroom;

/// Seconds between two reports of the counters, if they changed.
const HEALTH_SECONDS: u32 = 10;
/// Most violations of settings that are told.
const VIOLATIONS: usize = 8;
/// Bytes of the host are taken in parts of this many.
const PART: usize = 64;
/// Most lost ticks that are made up for: the watchdog would have ended a longer stand.
const MOST_LOST: u64 = 1200;
/// Encoder readings in a row that may fail: 0.25 s of them.
const ENCODER_PATIENCE: u16 = 25;

/// What a tick (every 2.5 ms) brought, beside bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Number of the tick, from 0; its time is `tick · 2.5 ms`.
    pub tick: u64,
    pub sensors: Due,
    /// Whether the step generator is running.
    pub turning: bool,
    /// Bytes that had come: what came later is of a later tick.
    pub heard: Heard,
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

/// A second that ended, as it is worked on.
#[derive(Clone, Debug)]
struct Ended {
    t_s: f64,
    gathered: Gathered,
    /// What the gyro's stream showed at its end.
    fault: Option<Fault>,
    index: IndexAngle,
}

/// How far the work on the first second that waits is.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// Not begun.
    Waiting,
    /// The sequencer is lent out.
    Reckoning,
    /// It is back.
    Reckoned(Seen),
    /// The second was told; what it led to is being told.
    Telling,
    /// It led to a fix, which is to be told.
    Fixed(event::Fix),
}

impl Stage {
    fn is_waiting(self) -> bool {
        matches!(self, Self::Waiting)
    }
}

/// Everything that has a state, but the flash. `S` is how the sequencer is held, which is lent out while it works on a second, `R` how
/// the room for settings and attitudes is.
pub struct Instrument<S, R> {
    identity: Identity,
    requests: RequestDecoder,
    /// `None`: it is lent out to solve a calibration.
    room: Option<R>,
    streaming: Streaming,
    reader: FrameReader,
    gatherer: Gatherer,
    watch: GyroWatch,
    /// `None`: it is lent out to work on the first of `ended`.
    sequencer: Option<S>,
    /// Its state before it was lent out, and what the motor goes by.
    state: State,
    index_settings: IndexSettings,
    index: IndexAngle,
    /// Seconds that wait to be worked on.
    ended: Deque<Ended, 2>,
    stage: Stage,
    /// What was asked of the sequencer while it worked.
    asked: Option<Command>,
    fault: Option<Fault>,
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
    /// Seconds of the gyro that ended since the last tick.
    finished: Deque<RateSecond, 4>,
    tick: u64,
    next_tick: u64,
    encoder_failures: u16,
    test: SelfTest,
}

impl<S: DerefMut<Target = Sequencer>, R: DerefMut<Target = Workroom>> Instrument<S, R> {
    /// Powered up, with what the flash holds. `sequencer`: an empty one.
    pub fn power_up(flash: &mut impl NorFlash, identity: Identity, sequencer: S, room: R) -> Self {
        let mut instrument = Self::empty(identity, sequencer, room);
        instrument.set_up(flash);
        instrument
    }

    /// Before it is set up.
    // Inlined, so that it is made where it stays: copies of it would take tens of kilobytes of a board's stack.
    #[inline(always)]
    pub fn empty(identity: Identity, sequencer: S, room: R) -> Self {
        let gyro = GyroSettings::default();
        Self {
            identity,
            requests: RequestDecoder::new(),
            room: Some(room),
            streaming: Streaming::Off,
            reader: FrameReader::new(gyro.format),
            gatherer: Gatherer::new(gyro, Correction::UNIT),
            block_temperature: None,
            watch: GyroWatch::default(),
            sequencer: Some(sequencer),
            state: State::Idle,
            index_settings: IndexSettings::default(),
            index: IndexAngle::default(),
            ended: Deque::new(),
            stage: Stage::Waiting,
            asked: None,
            fault: None,
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
            test: SelfTest::at_start(),
        }
    }

    /// What the board found of itself, for the self-test.
    pub fn board_is(&mut self, facts: BoardFacts) {
        self.test.board_is(facts);
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
        let scratch = self.room.as_deref_mut().and_then(Workroom::settings).map(Incoming::scratch).unwrap_or_default();
        self.refusal = match store::load_into(flash, scratch, &mut settings).unwrap_or(Found::Corrupt) {
            Found::Valid => self.take(&mut settings).err(),
            Found::Missing => Some(Fault::SettingsMissing),
            Found::Corrupt => Some(Fault::SettingsCorrupt),
        };
    }

    /// Takes settings that were stored. Errors: why no fix can be started with them.
    fn take(&mut self, settings: &mut Settings) -> Result<(), Fault> {
        self.reader = FrameReader::new(settings.gyro.format);
        self.test.set_up(settings.gyro.format);
        self.gatherer = Gatherer::new(settings.gyro, settings.triad());
        self.block_temperature = settings.model.as_ref().and_then(ErrorModel::block_temperature);
        self.keeper = settings.block.map(|block| Keeper::new(&block, settings.latitude_deg, settings.level.sigma_deg));
        // What no board measures cannot be compensated: such a model is for recordings.
        if settings.model.as_ref().is_some_and(|model| model.off_board(settings.block.is_some()).is_some()) {
            return Err(Fault::SettingsInvalid);
        }
        let declared = settings.declared()?;
        let rules = settings.rules();
        self.index_settings = rules.index;
        if let Some(sequencer) = &mut self.sequencer {
            sequencer.set_up(rules, declared, settings.model.get_or_insert_default());
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

    /// What the motor goes by. (Where no fix can be started, it never turns.)
    pub fn index_settings(&self) -> IndexSettings {
        self.index_settings
    }

    /// A tick of 2.5 ms: what it brought, and what came in on the lines.
    ///
    /// Never inlined, as [`Self::slice`]: a caller's loop would prepare in every tick what only some of them need.
    #[inline(never)]
    pub fn step(&mut self, readings: &Readings, intake: &Intake, flash: &mut impl NorFlash, report: Sink) -> Orders {
        self.tick = readings.tick;
        let sink: &mut dyn FnMut(Event) = &mut |event| report(Report { t_s: readings.t_s(), event });

        let mut orders = Orders::default();
        if readings.tick != self.next_tick {
            self.make_up(readings.tick, sink);
        }
        self.next_tick = readings.tick + 1;
        if !intake.host.is_empty(readings.heard.host) {
            self.hear_host(readings, intake, flash, &mut orders, sink);
        }
        while !intake.gyro.is_empty(readings.heard.gyro)
            && self.reader.fill(|place| intake.gyro.take(readings.heard.gyro, place)) > 0
        {
            self.hear_gyro(sink);
        }
        self.read(&readings.sensors, sink);
        if self.field.is_active() {
            self.calibrate(flash, sink);
        }
        let given_up = self.gatherer.tick(&mut self.counters);
        self.keep(given_up);
        self.stream(|| Item::Tick, sink);

        let fresh = matches!(readings.sensors, Due::Index(Some(_)));
        if let Some(sequencer) = self.sequencer.as_mut().filter(|_| self.stage.is_waiting()) {
            let moved = sequencer.tick(readings.tick, self.index, fresh, readings.turning, sink);
            orders.motor = moved.or(orders.motor);
        }
        if self.test.is_under_way() {
            self.test(readings, &mut orders, sink);
        }
        let encoder = (self.encoder_failures >= ENCODER_PATIENCE).then_some(Fault::EncoderFailed);
        if let Some(fault) = self.watch.tick(readings.tick).or(encoder) {
            orders.motor = self.fail(fault, readings.t_s(), sink).or(orders.motor);
        }
        if !self.finished.is_empty() {
            intake.tell(&mut self.counters);
            self.end_seconds(sink);
        }
        orders
    }

    /// Bytes of the host. Never inlined, as others below: what it takes of the stack is free again for what comes after it.
    #[inline(never)]
    fn hear_host(
        &mut self,
        readings: &Readings,
        intake: &Intake,
        flash: &mut impl NorFlash,
        orders: &mut Orders,
        sink: &mut dyn FnMut(Event),
    ) {
        let mut place = [0; PART];
        loop {
            let length = intake.host.take(readings.heard.host, &mut place);
            if length == 0 {
                break;
            }
            intake.tell(&mut self.counters);
            for &byte in place.iter().take(length) {
                self.request_byte(byte, readings.turning, flash, orders, sink);
            }
        }
    }

    /// Bytes of the gyro.
    #[inline(never)]
    fn hear_gyro(&mut self, sink: &mut dyn FnMut(Event)) {
        while let Some(frame) = self.reader.next() {
            self.frame(&frame, sink);
        }
        self.counters.bytes_skipped = self.reader.bytes_skipped();
        self.counters.frames_bad_crc = self.reader.bad_crc();
    }

    #[inline(never)]
    fn end_seconds(&mut self, sink: &mut dyn FnMut(Event)) {
        self.end_block(sink);
        while let Some(rate) = self.finished.pop_front() {
            self.end_second(&rate);
            if matches!(self.streaming, Streaming::Asked) && self.gatherer.sampler().slots() == 0 {
                self.streaming = Streaming::On(Stream::default());
            }
        }
    }

    /// A slice of the work on seconds that have ended, once after every [`Self::step`]; `work` is that of the desk. Gives the motor's
    /// command.
    ///
    /// A slice tells of one event: encoding all of a second's takes too long for one tick. Everything is told as of the tick at which
    /// the second ended: how long the work took makes no difference.
    #[inline(never)]
    pub fn slice(
        &mut self,
        desk: &Desk<S>,
        work: Pin<&mut (impl Future<Output = Infallible> + ?Sized)>,
        report: Sink,
    ) -> Option<MotorCommand> {
        let t_s = self.ended.front()?.t_s;
        // Ending it was this tick's work.
        if t_s == self.tick as f64 * SAMPLE_S {
            return None;
        }
        match core::mem::replace(&mut self.stage, Stage::Reckoning) {
            Stage::Reckoning => {
                let (sequencer, seen, motor) = desk.slice(work)?;
                self.sequencer = Some(sequencer);
                self.stage = Stage::Reckoned(seen);
                motor
            }
            stage => self.begin_or_tell(stage, desk, t_s, report),
        }
    }

    /// Begins with a second, or tells the next of what it led to. Never inlined: what it takes of the stack is not the reckoning's.
    #[inline(never)]
    fn begin_or_tell(&mut self, stage: Stage, desk: &Desk<S>, t_s: f64, report: Sink) -> Option<MotorCommand> {
        let sink: &mut dyn FnMut(Event) = &mut |event| report(Report { t_s, event });
        self.stage = Stage::Telling;
        match stage {
            Stage::Waiting | Stage::Reckoning => {
                let ended = self.ended.front()?;
                let rate_deg_h = ended.gathered.second.conditions.raw_rate_deg_h;
                self.stage = match self.sequencer.take_if(|_| self.refusal.is_none()) {
                    Some(sequencer) => {
                        self.state = sequencer.state();
                        desk.begin(sequencer, ended.gathered.directed(), ended.index);
                        Stage::Reckoning
                    }
                    // Without settings there is nothing to be done.
                    None => Stage::Reckoned(Seen { rate_deg_h, ..Seen::default() }),
                };
            }
            Stage::Reckoned(seen) => self.tell_second(&seen, sink),
            Stage::Telling => match desk.next_event() {
                // Before the fix, what is to be held against it.
                Some(Event::Fix(fix)) => {
                    self.stage = Stage::Fixed(fix);
                    sink(Event::Health(self.counters));
                }
                Some(event) => sink(event),
                None => {
                    self.stage = Stage::Waiting;
                    return self.finish_second(t_s, sink);
                }
            },
            Stage::Fixed(fix) => {
                if let Some(keeper) = &mut self.keeper {
                    keeper.fixed(&fix);
                }
                sink(Event::Fix(fix));
            }
        }
        None
    }

    /// The second is reported before what it led to: a recording that ends with the azimuth holds all of its seconds.
    #[inline(never)]
    fn tell_second(&mut self, seen: &Seen, sink: &mut dyn FnMut(Event)) {
        let Some(Ended { gathered: Gathered { second, index_deg, block_temp_c }, .. }) = self.ended.front() else {
            return;
        };
        self.counters.seconds_outlying = self.counters.seconds_outlying.saturating_add(seen.outliers.into());
        let conditions = &second.conditions;
        sink(Event::Second(event::Second {
            t_s: second.end_s(),
            index_deg: *index_deg,
            fog_arcsec: conditions.raw_rate_deg_h,
            moment_arcsec_s: second.moment_arcsec_s,
            rate_deg_h: seen.rate_deg_h,
            temp_c: conditions.temp_c,
            block_temp_c: *block_temp_c,
            level: conditions.level.map(|mean| LevelMoments { mean, first: second.level_moment }),
            lost_frames: second.lost_frames,
            dwell: seen.dwell,
            collected: seen.collected,
            waited_at: seen.waited_at,
        }));
    }

    /// What the gyro's stream showed at the second's end, and what was asked of the sequencer meanwhile.
    fn finish_second(&mut self, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        let fault = self.ended.pop_front()?.fault.filter(|_| self.refusal.is_none());
        let mut motor = None;
        for fault in fault.into_iter().chain(self.fault.take()) {
            motor = self.fail(fault, t_s, sink).or(motor);
        }
        if let Some(command) = self.asked.take() {
            motor = self.command(command, t_s, sink).or(motor);
        }
        self.seconds = self.seconds.wrapping_add(1);
        if self.seconds.is_multiple_of(HEALTH_SECONDS) && self.reported != self.counters {
            self.reported = self.counters;
            sink(Event::Health(self.counters));
        }
        motor
    }

    /// Ends a fix with a fault, now or as soon as the sequencer is back.
    fn fail(&mut self, fault: Fault, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        match &mut self.sequencer {
            Some(sequencer) if self.stage.is_waiting() => sequencer.fail(fault, t_s, sink),
            _ => {
                self.fault.get_or_insert(fault);
                None
            }
        }
    }

    /// Asks the sequencer for something, now or as soon as it is back: the last that is asked counts.
    fn command(&mut self, command: Command, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        match (&mut self.sequencer, command) {
            (Some(sequencer), Command::Start) if self.stage.is_waiting() => sequencer.start(t_s, sink),
            (Some(sequencer), _) if self.stage.is_waiting() => sequencer.fail(Fault::Aborted, t_s, sink),
            _ => {
                self.asked = Some(command);
                None
            }
        }
    }

    /// Lends out the room with the attitudes of the accelerometers that are to be solved for, if there are any.
    pub fn posed(&mut self) -> Option<R> {
        self.room.take_if(|_| self.field.is_posed())
    }

    /// That room is lent out.
    pub fn is_solving(&self) -> bool {
        self.room.is_none()
    }

    /// Takes the room back with the answer in it, whenever it comes; one that nobody waits for any more is dropped.
    pub fn solved(&mut self, room: R) {
        if let Some(answer) = room.answer() {
            self.field.solved(answer);
        }
        self.room = Some(room);
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
            && let Some(sequencer) = self.sequencer.as_mut().filter(|_| self.stage.is_waiting())
        {
            sequencer.exercise();
            let fresh = matches!(readings.sensors, Due::Index(Some(_)));
            let settings = self.refusal.is_none().then_some(self.index_settings);
            let moved = self.test.turn(self.index.deg(), fresh, readings.turning, settings);
            orders.motor = moved.or(orders.motor);
        }
        orders.test_accelerometer = self.test.tick(&readings.sensors);
        if let Some(finding) = self.test.next(self.refusal, self.keeper.is_some()) {
            sink(Event::SelfTest(finding));
        }
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
                // By the start that follows them they would end it.
                if self.field.is_active() {
                    return Err(Refusal::Busy);
                }
                let incoming = self.room.as_deref_mut().and_then(Workroom::settings).ok_or(Refusal::Busy)?;
                if incoming.take(&piece)? {
                    // The processor stands still while flash is erased.
                    if turning {
                        return Err(Refusal::MotorTurns);
                    }
                    store(flash, incoming, sink)?;
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
            Ask::SelfTest => {
                if !matches!(self.work(), State::Idle | State::Finished | State::Failed) {
                    return Err(Refusal::Busy);
                }
                if self.test.interrupt() {
                    orders.motor = Some(MotorCommand::Stop);
                }
                self.test.begin();
            }
        }
        Ok(())
    }

    fn state(&self) -> State {
        match self.refusal {
            Some(_) if !self.field.is_active() => State::Failed,
            _ => self.work(),
        }
    }

    /// What is under way, whether a fix can be started or not.
    fn work(&self) -> State {
        if self.field.is_active() {
            return State::Calibrating;
        }
        self.sequencer.as_ref().map_or(self.state, |sequencer| sequencer.state())
    }

    #[inline(never)]
    fn calibrate(&mut self, flash: &mut impl NorFlash, sink: &mut dyn FnMut(Event)) {
        if let Some(calibration) = self.field.tick(&mut |event| calibration_events(event, sink)) {
            self.gatherer.set_triad(calibration.correction());
        }
        if let Some(calibration) = self.field.to_store() {
            let change = |settings: &mut Settings| settings.accelerometer = Some(calibration);
            let scratch = self.room.as_deref_mut().and_then(Workroom::settings).map(Incoming::scratch);
            let stored = scratch.is_some_and(|scratch| store::update(flash, scratch, change).is_ok());
            self.field.stored(stored);
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
        // The attitudes of one that was aborted are still being solved for: a few tenths of a second.
        if matches!(command, Command::CalibrateAccelerometers) && self.room.is_none() {
            return Err(Refusal::Busy);
        }
        let stop = self.test.interrupt().then_some(MotorCommand::Stop);
        let motor = match (self.refusal, command) {
            (None, Command::Start) => {
                self.field.abort(&mut |event| calibration_events(event, sink));
                self.watch.restart(self.tick);
                self.encoder_failures = 0;
                self.command(command, t_s, sink)
            }
            (None, Command::CalibrateAccelerometers) => {
                let stop = self.command(command, t_s, sink);
                if let Some(collection) = self.room.as_deref_mut().and_then(Workroom::begin) {
                    let in_use = *self.gatherer.triad();
                    self.field.start(collection, in_use, &mut |event| calibration_events(event, sink));
                }
                stop
            }
            (None, Command::Abort) => {
                self.field.abort(&mut |event| calibration_events(event, sink));
                self.command(command, t_s, sink)
            }
            (Some(fault), Command::Start | Command::CalibrateAccelerometers) => {
                sink(Event::Fault { fault, state: State::Idle });
                sink(Event::State(State::Failed));
                return Err(Refusal::NoFix);
            }
            (Some(_), Command::Abort) => None,
        };
        Ok(motor.or(stop))
    }

    #[inline(never)]
    fn read(&mut self, due: &Due, sink: &mut dyn FnMut(Event)) {
        let failed = |count: &mut u32| *count = count.saturating_add(1);
        match due {
            Due::Nothing | Due::Response(_) => {}
            Due::Acceleration(reading) => {
                match *reading {
                    Some(reading) => {
                        self.stream(|| Item::Acceleration(reading), sink);
                        self.gatherer.acceleration(reading);
                    }
                    None => failed(&mut self.counters.accelerometer_errors),
                }
                if let Some(collection) = self.room.as_deref_mut().and_then(Workroom::attitudes) {
                    self.field.reading(collection, *reading, &mut |event| calibration_events(event, sink));
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

    #[inline(never)]
    fn end_second(&mut self, rate: &RateSecond) {
        let t_s = self.tick as f64 * SAMPLE_S;
        let counters = &mut self.counters;
        if !rate.usable {
            counters.seconds_left_out = counters.seconds_left_out.saturating_add(1);
        } else if rate.missing > 0 {
            counters.seconds_repaired = counters.seconds_repaired.saturating_add(1);
        }
        let fault = self.watch.second(rate, self.gatherer.sampler().behind());
        let mut gathered = self.gatherer.finish(rate, t_s);
        if let (Some(block_temp_c), Some(place)) = (gathered.block_temp_c, self.block_temperature)
            && let Some(channel) = gathered.second.conditions.channels.get_mut(place)
        {
            *channel = block_temp_c;
        }
        // No second takes longer than the next to be worked on; if one ever did, its successor's successor would be lost, and counted.
        if self.ended.push_back(Ended { t_s, gathered, fault, index: self.index }).is_err() {
            counters.seconds_left_out = counters.seconds_left_out.saturating_add(1);
        }
    }
}

/// Puts something that entered into the stream; tells the block that is full with it.
#[inline(never)]
fn push(stream: &mut Stream, item: &Item, sink: &mut dyn FnMut(Event)) {
    if let Some(block) = stream.push(item) {
        sink(Event::Raw(block));
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
