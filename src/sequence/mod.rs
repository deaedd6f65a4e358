//! The state machine of a fix: level → still? → index → settle → collect → … → solve.
//!
//! Every stage owns its data and has its way on, its time-out, and the way out by a fault or by the operator. Seconds and
//! ticks come in, reports and motor commands go out; nothing here reads a clock or a bus. What is measured goes to the
//! [`Accumulator`]: here is only said where a dwell begins and ends.

pub mod adaptive;
pub mod order;
pub mod rotation;
mod steps;
pub mod turn;
pub mod work;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::effects::ErrorModel;
use crate::event::{Dwell, Event, State};
use crate::fix::accumulator::{Accumulator, Corrected, Second, Slip, Taken};
use crate::fix::dwell::DwellSummary;
use crate::fix::index_watch::{Angle, IndexWatch};
use crate::fix::{self, Declared, Fix};
use crate::health::Fault;
use crate::sensing::gates::{DisturbanceGate, Gate, GateSettings, JitterGate, Verdict};
use crate::sensing::index::{IndexAngle, IndexSettings, MotorCommand};
use crate::sensing::level::{LevelSettings, Specific};
use crate::sensing::sample::SAMPLE_S;
use crate::units::{DEG_PER_RAD, wrap_180_deg};
use adaptive::{Adaptive, Seen};
use order::{Order, Position, SequenceSettings};
use rotation::Rotation;
use steps::Steps;
use turn::{Progress, Turn};

/// Most dwells that a fix can have: those of the longest order, and half as many again.
pub const MAX_DWELLS: usize = 24;
const _: () = assert!(fix::rotation::PLACES <= MAX_DWELLS);
/// Dwells of an adaptive fix after which eight of the mirrored order find room, and such as a slip divides.
const LAST_TO_KEEP: u8 = 12;
/// Seconds in a row without the accelerometers, or out of level while measuring, that end a fix.
const PATIENCE_SECONDS: u16 = 3;
/// While measuring, the level limit is this much wider than before: a tripod may settle a little.
const LEVEL_HYSTERESIS: f64 = 1.5;

/// Up to this difference the clocks of gyro and instrument are taken to agree: the end of a second is known only when its last frame has come.
const SAME_CLOCK_S: f64 = 2.0;

/// What an operator can ask of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// Begin a fix (again).
    Start,
    /// End the fix or the calibration; the motor stops.
    Abort,
    /// Begin to calibrate the accelerometers (again).
    CalibrateAccelerometers,
}

/// What a sequence goes by.
#[derive(Clone, Debug, PartialEq)]
pub struct Rules {
    pub level: LevelSettings,
    pub disturbance: GateSettings,
    pub jitter: GateSettings,
    pub index: IndexSettings,
    pub sequence: SequenceSettings,
    /// Longest time from the start of a fix to its azimuth, seconds.
    pub time_limit_s: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            level: LevelSettings::default(),
            disturbance: GateSettings::DISTURBANCE,
            jitter: GateSettings::JITTER,
            index: IndexSettings::default(),
            sequence: SequenceSettings::default(),
            time_limit_s: 600.0,
        }
    }
}

/// What became of a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observed {
    /// Mean true rate, °/h.
    pub rate_deg_h: f64,
    /// Number of the dwell, from 0, that was under way.
    pub dwell: Option<u8>,
    /// It entered the solution.
    pub collected: bool,
    /// The gate that refused at its end.
    pub waited_at: Option<Gate>,
    /// Seconds that the dwells which ended with it left out as outliers.
    pub outliers: u16,
}

/// Takes events out of the sequencer.
pub type Sink<'a> = &'a mut dyn FnMut(Event);

/// The stages of a fix with what each of them needs.
#[allow(clippy::large_enum_variant)] // without a heap there is no smaller place
#[derive(Clone, Debug)]
enum Stage {
    Idle,
    /// Seconds in a row that were level.
    Levelling {
        level: u16,
    },
    Watching(DisturbanceGate, JitterGate),
    Indexing(Turn),
    Settling(JitterGate),
    /// Seconds that this dwell has so far.
    Collecting {
        seconds: u16,
    },
    Rotating(Rotation),
    Finished,
    Failed,
}

impl Stage {
    fn state(&self) -> State {
        match self {
            Self::Idle => State::Idle,
            Self::Levelling { .. } => State::Levelling,
            Self::Watching(..) => State::Watching,
            Self::Indexing(_) => State::Indexing,
            Self::Settling(_) => State::Settling,
            Self::Collecting { .. } | Self::Rotating(_) => State::Collecting,
            Self::Finished => State::Finished,
            Self::Failed => State::Failed,
        }
    }
}

/// Counts bad seconds in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Run(u16);

impl Run {
    /// Whether there are too many.
    fn push(&mut self, bad: bool) -> bool {
        self.0 = if bad { self.0.saturating_add(1) } else { 0 };
        self.0 >= PATIENCE_SECONDS
    }
}

/// The mirrored order that an adaptive fix fell back to: seconds of each dwell, and the number of its first one.
#[derive(Clone, Copy, Debug)]
struct FallenBack {
    dwell_s: u16,
    first: u8,
}

/// Runs a fix.
pub struct Sequencer {
    rules: Rules,
    accumulator: Accumulator<Vec<DwellSummary, MAX_DWELLS>>,
    stage: Stage,
    /// When the fix began, and the stage.
    started_s: f64,
    since_s: f64,
    /// How far the gyro's clock, by which seconds are counted, is ahead of the instrument's, by which ticks are.
    ahead_s: f64,
    position: u8,
    index: IndexAngle,
    out_of_level: Run,
    level_failed: Run,
    coarse_azimuth_deg: Option<f64>,
    adaptive: Option<Adaptive>,
    /// The mirrored order that an adaptive fix fell back to.
    fallen_back: Option<FallenBack>,
    /// The index while the motor stands, from power-up on, whether a fix is under way or not.
    rest: IndexWatch,
    /// The steps of its moves.
    steps: Steps,
    /// The index in the last second.
    last_index: Option<Angle>,
    /// The second under way is that of an arrival, with some of the move in it.
    arrives: bool,
    /// In the second under way the motor moved without a fix.
    exercised: bool,
    /// It moved without the motor, or not as its steps, since power-up: the mark may be wrong from there on. This fix says so.
    doubted: bool,
    doubt_told: bool,
}

impl Sequencer {
    /// Of no use before it is set up.
    // Inlined, so that it is made where it stays: copies of it would take tens of kilobytes of a board's stack.
    #[inline(always)]
    pub fn empty() -> Self {
        Self {
            rules: Rules::default(),
            accumulator: Accumulator::empty(Vec::new()),
            stage: Stage::Idle,
            started_s: 0.0,
            since_s: 0.0,
            ahead_s: 0.0,
            position: 0,
            index: IndexAngle::default(),
            out_of_level: Run::default(),
            level_failed: Run::default(),
            coarse_azimuth_deg: None,
            adaptive: None,
            fallen_back: None,
            rest: IndexWatch::new(0.0),
            steps: Steps::default(),
            last_index: None,
            arrives: false,
            exercised: false,
            doubted: false,
            doubt_told: false,
        }
    }

    /// Ready to start. Takes the model, and leaves its own in its place.
    pub fn set_up(&mut self, rules: Rules, declared: Declared, model: &mut ErrorModel) {
        self.rest = IndexWatch::new(declared.index_sigma_deg);
        self.steps.forget();
        self.rules = rules;
        self.accumulator.set_up(declared, model);
    }

    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    pub fn state(&self) -> State {
        self.stage.state()
    }

    /// A fix is under way.
    pub fn is_active(&self) -> bool {
        !matches!(self.stage, Stage::Idle | Stage::Finished | Stage::Failed)
    }

    /// Begins a fix, whatever was before; the motor is stopped and has no current.
    pub fn start(&mut self, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        let t_s = t_s + self.ahead_s;
        self.accumulator.restart();
        self.started_s = t_s;
        self.position = 0;
        (self.out_of_level, self.level_failed) = (Run::default(), Run::default());
        self.coarse_azimuth_deg = None;
        self.doubt_told = false;
        self.adaptive = match self.rules.sequence.order {
            // The last second must end before the limit.
            Order::Adaptive { accuracy_deg } => {
                let floor_deg = self.accumulator.declared().floor_deg(self.accumulator.model());
                let mut adaptive = Adaptive::new(accuracy_deg, floor_deg, t_s + self.rules.time_limit_s - 1.0);
                adaptive.begin_coarse(t_s, self.rates_deg_h());
                Some(adaptive)
            }
            _ => None,
        };
        self.fallen_back = None;
        self.enter(Stage::Levelling { level: 0 }, t_s, sink);
        Some(MotorCommand::Stop)
    }

    /// Ends a fix with a fault; the motor stops. Nothing happens when none is under way.
    pub fn fail(&mut self, fault: Fault, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        if !self.is_active() {
            return None;
        }
        sink(Event::Fault { fault, state: self.state() });
        self.enter(Stage::Failed, t_s, sink);
        Some(MotorCommand::Stop)
    }

    /// From the next fix on the accelerometers are calibrated, or not.
    pub fn level_is_calibrated(&mut self, calibrated: bool) {
        self.accumulator.level_is_calibrated(calibrated);
    }

    /// The motor moves without a fix: what the index does in this second is no slip.
    pub fn exercise(&mut self) {
        self.exercised = true;
        self.steps.forget();
    }

    /// The tick of this number: the index angle, whether the encoder was read at this tick, and whether the motor is turning.
    pub fn tick(
        &mut self,
        tick: u64,
        index: IndexAngle,
        fresh: bool,
        turning: bool,
        sink: Sink,
    ) -> Option<MotorCommand> {
        self.index = index;
        let t_s = tick as f64 * SAMPLE_S + self.ahead_s;
        if !matches!(self.stage, Stage::Indexing(_) | Stage::Rotating(_)) {
            return None;
        }
        let turned_deg = self.turned_deg()?;
        let progress = match &mut self.stage {
            Stage::Indexing(turn) => turn.tick(turned_deg, fresh, turning),
            Stage::Rotating(rotation) => rotation.tick(turned_deg, fresh, turning),
            _ => return None,
        };
        match progress {
            Progress::Turning => None,
            Progress::Again(command) => {
                self.doubted = true;
                self.steps.forget();
                Some(command)
            }
            Progress::Failed(fault) => self.fail(fault, t_s, sink),
            Progress::Arrived { index_deg, beyond } => {
                let slipped = self.steps.ended(index_deg, &self.rules.index);
                self.doubted |= beyond || slipped;
                if let Stage::Rotating(rotation) = &mut self.stage {
                    let command = rotation.turn_back(index_deg, self.started_s + self.rules.time_limit_s - t_s);
                    if let Some(command) = command {
                        self.steps.begin(index_deg, command);
                        self.position = rotation.number();
                        sink(Event::Moving { position: self.position, target_deg: rotation.target_deg() });
                    }
                    return command;
                }
                let index_deg = index_deg + self.error_here_deg();
                let error_deg = self.last_index.map_or(0.0, |last| last.error_deg());
                self.rest.stand(Angle::of_reading(index_deg, error_deg));
                self.arrives = true;
                let index_deg = crate::units::wrap_360_deg(index_deg);
                sink(Event::Arrived { position: self.position, index_deg });
                self.enter(Stage::Settling(JitterGate::new(self.rules.jitter)), t_s, sink);
                (!self.rules.index.hold_current).then_some(MotorCommand::Stop)
            }
        }
    }

    /// By how much the encoder reads too large by the model where it stands now, degrees, as far as that follows the angle alone.
    fn error_here_deg(&self) -> f64 {
        self.index.deg().map_or(0.0, |read_deg| self.accumulator.model().index_error_here_deg(read_deg))
    }

    /// How far the spindle is turned, degrees, unwrapped: what the encoder reads without the error that the model knows of it. The drive closes on this, and
    /// the steps of its moves are held against it.
    fn turned_deg(&self) -> Option<f64> {
        Some(self.index.deg()? - self.error_here_deg())
    }

    /// A second has ended, at this index angle and at `t_s` of the instrument's clock. What it was goes to [`Self::second`].
    pub fn correct(&mut self, second: &Second, index: IndexAngle, t_s: f64) -> Corrected {
        self.index = index;
        let ahead_s = second.end_s() - t_s;
        self.ahead_s = if ahead_s.abs() > SAME_CLOCK_S { ahead_s } else { 0.0 };
        let corrected = self.accumulator.correct(second);
        self.last_index = corrected.angle();
        corrected
    }

    /// The work on a second. Gives what became of it and the motor's command.
    pub fn second(&mut self, corrected: &Corrected, sink: Sink<'_>) -> (Observed, Option<MotorCommand>) {
        let second = &corrected.measured;
        let t_s = second.end_s();
        let mut observed = Observed { rate_deg_h: corrected.rate_deg_h, ..Observed::default() };
        self.watch_rest(corrected.angle());
        if !self.is_active() {
            return (observed, None);
        }
        let late = (t_s - self.started_s > self.rules.time_limit_s).then_some(Fault::OutOfTime);
        if let Some(fault) = late.or_else(|| self.watch_level(second.conditions.level)) {
            return (observed, self.fail(fault, t_s, sink));
        }
        let early = self.adaptive.is_some() && matches!(self.stage, Stage::Watching(..) | Stage::Settling(_));
        let rings_down = matches!(self.stage, Stage::Collecting { .. }) && self.rings_down(second);
        if rings_down || !matches!(self.stage, Stage::Collecting { .. } | Stage::Rotating(_)) && !early {
            self.between_dwells(corrected, &mut observed, sink);
        }
        let rate_deg_h = self.accumulator.is_usable(second).then_some(corrected.rate_deg_h);
        let motor = match &mut self.stage {
            Stage::Levelling { .. } => self.levelling(second.conditions.level, t_s, sink),
            Stage::Watching(gate, jitter) => {
                let verdict = gate.second(rate_deg_h);
                jitter.second(rate_deg_h, second.ripple_arcsec);
                let quiet = gate.is_quiet() && jitter.is_quiet();
                self.collect_early(corrected, quiet, &mut observed, sink);
                self.watching(verdict, corrected, &mut observed, sink)
            }
            Stage::Settling(gate) => {
                let verdict = gate.second(rate_deg_h, second.ripple_arcsec);
                let quiet = gate.is_quiet();
                if let Some(adaptive) = self.adaptive.as_mut().filter(|_| gate.is_ringing()) {
                    adaptive.wait();
                }
                self.collect_early(corrected, quiet, &mut observed, sink);
                self.settling(verdict, corrected, &mut observed, sink)
            }
            Stage::Collecting { .. } if rings_down => None,
            Stage::Collecting { seconds } => {
                let before = *seconds;
                self.collect(corrected, &mut observed, sink);
                let seconds = before.saturating_add(observed.collected.into());
                if let Stage::Collecting { seconds: own } = &mut self.stage {
                    *own = seconds;
                }
                self.collecting(corrected, seconds, &mut observed, sink)
            }
            Stage::Rotating(_) => self.rotating(corrected, &mut observed, sink),
            Stage::Idle | Stage::Indexing(_) | Stage::Finished | Stage::Failed => None,
        };
        let out_of_time = self.adaptive.is_some_and(|adaptive| adaptive.is_out_of_time(t_s));
        let motor = if out_of_time && self.is_active() && self.position > 2 {
            self.end_dwell(&mut observed, sink);
            self.finish(t_s, sink)
        } else {
            motor
        };
        self.tell_doubt(&mut observed);
        (observed, motor)
    }

    /// The index is to be doubted: once in a fix, in a second that waited at no gate.
    fn tell_doubt(&mut self, observed: &mut Observed) {
        if self.doubted && !self.doubt_told && observed.waited_at.is_none() {
            self.doubt_told = true;
            self.wait_at(Gate::Index, observed);
        }
    }

    /// The index must stand while the motor does. (In a fix the accumulator knows it too, and what to make of it.)
    fn watch_rest(&mut self, index: Option<Angle>) {
        let arrived = core::mem::take(&mut self.arrives);
        let exercised = core::mem::take(&mut self.exercised);
        match index {
            _ if exercised || matches!(self.stage, Stage::Indexing(_) | Stage::Rotating(_)) => self.rest.restart(),
            _ if arrived => {}
            Some(index) => self.doubted |= self.rest.push(index).is_some(),
            None => {}
        }
    }

    /// An adaptive fix waits before a dwell until the drive has rung down.
    fn rings_down(&mut self, second: &Second) -> bool {
        let [noise_deg_h, _] = self.rates_deg_h();
        self.adaptive.as_mut().is_some_and(|adaptive| adaptive.rings_down(second.ripple_arcsec, noise_deg_h))
    }

    /// An adaptive fix takes a quiet second before its gate has passed; one that is not quiet ends the dwell that they began.
    fn collect_early(&mut self, second: &Corrected, quiet: bool, observed: &mut Observed, sink: Sink<'_>) {
        let Some(adaptive) = &mut self.adaptive else { return };
        if quiet && adaptive.takes_early() {
            adaptive.early = adaptive.early.saturating_add(1);
            return self.collect(second, observed, sink);
        }
        if adaptive.interrupted() {
            adaptive.wait();
            self.end_dwell(observed, sink);
            self.accumulator.index_turns();
        }
        self.between_dwells(second, observed, sink);
    }

    /// A second of a dwell.
    fn collect(&mut self, second: &Corrected, observed: &mut Observed, sink: Sink<'_>) {
        observed.dwell = Some(self.position);
        let taken = self.accumulator.collect(second);
        observed.collected = taken == Taken::Collected;
        if let Some(adaptive) = self.adaptive.as_mut().filter(|_| observed.collected) {
            adaptive.collected(second.measured.end_s(), second.rate_deg_h, &self.rules.index);
            self.promise(second.measured.end_s(), false, sink);
        }
        if let Taken::Slipped(slip) = taken {
            self.slipped(&slip, observed, sink);
        }
    }

    /// Says how long an adaptive fix will take, where it is time to.
    fn promise(&mut self, t_s: f64, planned: bool, sink: Sink) {
        let promise_s = |adaptive: &mut Adaptive| adaptive.promise_s(t_s, &self.rules.index, planned);
        if let Some(seconds) = self.adaptive.as_mut().and_then(promise_s) {
            sink(Event::ToGo { seconds });
        }
    }

    /// The declared noise of a second and the horizontal Earth rate, °/h.
    fn rates_deg_h(&self) -> [f64; 2] {
        let declared = self.accumulator.declared();
        [declared.gyro.noise_deg_h(), declared.earth.north_deg_h]
    }

    /// What the dwells so far show of noise and base.
    fn seen(&self) -> Seen {
        let north_deg_h = self.accumulator.declared().earth.north_deg_h;
        let (noise_deg_h, base_moves) = self.accumulator.seen();
        Seen { noise_deg_h, north_deg_h, base_moves }
    }

    /// A second of no dwell.
    fn between_dwells(&mut self, second: &Corrected, observed: &mut Observed, sink: Sink<'_>) {
        if let Some(slip) = self.accumulator.between_dwells(second) {
            self.slipped(&slip, observed, sink);
        }
    }

    /// The dwell is over.
    fn end_dwell(&mut self, observed: &mut Observed, sink: Sink<'_>) {
        let ended = self.accumulator.end_dwell();
        self.dwell_ended(ended.as_ref(), observed, sink);
    }

    /// The index slipped: the dwell under way goes on as another one, at the new angle.
    fn slipped(&mut self, slip: &Slip, observed: &mut Observed, sink: Sink) {
        self.dwell_ended(slip.ended.as_ref(), observed, sink);
        if let Some(adaptive) = &mut self.adaptive {
            adaptive.slipped = true;
        }
        sink(Event::IndexSlipped { position: self.position, before_deg: slip.before_deg });
    }

    fn dwell_ended(&self, ended: Option<&DwellSummary>, observed: &mut Observed, sink: Sink) {
        if let Some(summary) = ended {
            observed.outliers = observed.outliers.saturating_add(summary.outliers);
            sink(Event::Dwell(Dwell::new(self.position, summary)));
        }
    }

    fn enter(&mut self, stage: Stage, t_s: f64, sink: Sink) {
        self.stage = stage;
        self.since_s = t_s;
        sink(Event::State(self.state()));
    }

    fn waited_s(&self, t_s: f64) -> f64 {
        t_s - self.since_s
    }

    /// A failed sensor, or an instrument that left the level limit after it was levelled.
    fn watch_level(&mut self, level: Option<Specific>) -> Option<Fault> {
        if self.level_failed.push(level.is_none()) {
            return Some(Fault::AccelerometerFailed);
        }
        let limit_deg = self.rules.level.limit_deg * LEVEL_HYSTERESIS;
        let tilted = level.is_some_and(|specific| !specific.tilt().is_level(limit_deg));
        let watched = !matches!(self.stage, Stage::Levelling { .. });
        self.out_of_level.push(tilted && watched).then_some(Fault::LevelLost)
    }

    fn levelling(&mut self, level: Option<Specific>, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        if let (Some(specific), Stage::Levelling { level: run }) = (level, &mut self.stage) {
            let tilt = specific.tilt();
            let level = tilt.is_level(self.rules.level.limit_deg);
            sink(Event::Level { tilt, level });
            *run = if level { run.saturating_add(1) } else { 0 };
            if *run >= self.rules.level.seconds {
                let north_deg_h = self.accumulator.declared().earth.north_deg_h;
                let gate = DisturbanceGate::new(self.rules.disturbance, north_deg_h);
                self.enter(Stage::Watching(gate, JitterGate::new(self.rules.jitter)), t_s, sink);
                return None;
            }
        }
        if self.waited_s(t_s) >= self.rules.level.timeout_s {
            return self.fail(Fault::NotLevel, t_s, sink);
        }
        None
    }

    fn watching(
        &mut self,
        (excess_deg_h, verdict): (f64, Verdict),
        second: &Corrected,
        observed: &mut Observed,
        sink: Sink<'_>,
    ) -> Option<MotorCommand> {
        let t_s = second.measured.end_s();
        match verdict {
            Verdict::Passed => {
                sink(Event::Undisturbed { excess_deg_h });
                let rates_deg_h = self.rates_deg_h();
                return match self.adaptive {
                    Some(adaptive) if adaptive.coarse_is_over(t_s, rates_deg_h) => {
                        self.end_adaptive_dwell(t_s, observed, sink)
                    }
                    Some(_) => {
                        self.enter(Stage::Collecting { seconds: 0 }, t_s, sink);
                        None
                    }
                    None => self.go_to_position(t_s, sink),
                };
            }
            Verdict::Refused => {
                self.wait_at(Gate::Disturbance, observed);
                sink(Event::Disturbed { excess_deg_h });
            }
            Verdict::Watching => {}
        }
        if self.waited_s(t_s) >= self.rules.disturbance.timeout_s {
            return self.fail(Fault::Disturbed, t_s, sink);
        }
        None
    }

    fn wait_at(&mut self, gate: Gate, observed: &mut Observed) {
        self.accumulator.waited_at(gate);
        observed.waited_at = Some(gate);
    }

    /// Turns to the current position, or begins to collect there if the gyro is at it already.
    fn go_to_position(&mut self, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        let Some(angle_deg) = self.turned_deg() else {
            return self.fail(Fault::EncoderFailed, t_s, sink);
        };
        let Some(wanted_deg) = self.target_deg() else {
            return self.fail(Fault::Unsolvable, t_s, sink);
        };
        let target_deg = self.rules.index.target_deg(angle_deg, wanted_deg);
        if (target_deg - angle_deg).abs() <= self.rules.index.tolerance_deg {
            return self.begin_dwell(t_s, sink);
        }
        sink(Event::Moving { position: self.position, target_deg });
        self.accumulator.index_turns();
        // However soon the move is given up: what the index does in this second is no slip.
        self.rest.restart();
        let (turn, command) = Turn::new(self.rules.index, angle_deg, target_deg);
        self.steps.begin(angle_deg, command);
        self.enter(Stage::Indexing(turn), t_s, sink);
        Some(command)
    }

    /// The gyro is where it shall measure, or where a continuous rotation begins.
    fn begin_dwell(&mut self, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        let Order::Rotation { passes } = self.rules.sequence.order else {
            self.enter(Stage::Collecting { seconds: 0 }, t_s, sink);
            return None;
        };
        let Some(angle_deg) = self.turned_deg() else { return self.fail(Fault::EncoderFailed, t_s, sink) };
        let (rotation, command) = Rotation::new(self.rules.index, angle_deg, passes);
        self.steps.begin(angle_deg, command);
        self.position = rotation.number();
        sink(Event::ToGo { seconds: self.rules.sequence.measuring_s(&self.rules.index) });
        sink(Event::Moving { position: self.position, target_deg: rotation.target_deg() });
        self.rest.restart();
        self.enter(Stage::Rotating(rotation), t_s, sink);
        Some(command)
    }

    /// A second of a continuous rotation counts if the index turned evenly in it; after the last pass the azimuth follows.
    fn rotating(&mut self, second: &Corrected, observed: &mut Observed, sink: Sink<'_>) -> Option<MotorCommand> {
        let turned_deg = self.turned_deg();
        let Stage::Rotating(rotation) = &mut self.stage else { return None };
        let (before, even, is_over) = (rotation.is_even, rotation.second(turned_deg), rotation.is_over);
        if even {
            observed.dwell = Some(self.position);
            observed.collected = self.accumulator.collect_rotating(second);
        } else {
            // As a replay does, to which this second is of no dwell.
            if before {
                self.accumulator.index_turns();
            }
            self.between_dwells(second, observed, sink);
        }
        if !is_over {
            return None;
        }
        // What the last pass showed.
        self.tell_doubt(observed);
        self.finish(second.measured.end_s(), sink)
    }

    fn position(&self) -> Option<Position> {
        let position = usize::from(self.position);
        match self.fallen_back {
            Some(FallenBack { first, .. }) => Order::Mirrored.position(position.checked_sub(first.into())?),
            None => self.rules.sequence.order.position(position),
        }
    }

    /// Index angle of the current position; `None` past the last, or before the coarse azimuth is known.
    fn target_deg(&self) -> Option<f64> {
        if let Some(adaptive) = &self.adaptive {
            return Some(adaptive.target_deg);
        }
        match self.position()? {
            // A rotation begins where the travel does.
            Position::At { .. }
                if matches!(self.rules.sequence.order, Order::Rotation { .. }) && self.fallen_back.is_none() =>
            {
                Some(self.rules.index.travel_from_deg)
            }
            Position::At { index_deg, .. } => Some(index_deg),
            Position::East => self.coarse_azimuth_deg.map(fix::east_index_deg),
            Position::West => self.coarse_azimuth_deg.map(fix::west_index_deg),
        }
    }

    fn settling(
        &mut self,
        (change_deg_h, verdict): (f64, Verdict),
        second: &Corrected,
        observed: &mut Observed,
        sink: Sink<'_>,
    ) -> Option<MotorCommand> {
        let position = self.position;
        let t_s = second.measured.end_s();
        let rates_deg_h = self.rates_deg_h();
        if position == 1 && self.adaptive.is_some_and(|adaptive| adaptive.coarse_is_over(t_s, rates_deg_h)) {
            return self.end_adaptive_dwell(t_s, observed, sink);
        }
        match verdict {
            Verdict::Passed => {
                sink(Event::Settled { position });
                return self.begin_dwell(t_s, sink);
            }
            Verdict::Refused => {
                self.wait_at(Gate::Jitter, observed);
                sink(Event::Jitter { position, change_deg_h });
            }
            Verdict::Watching => {}
        }
        if self.waited_s(t_s) >= self.rules.jitter.timeout_s {
            return self.fail(Fault::Jitter, t_s, sink);
        }
        None
    }

    fn collecting(
        &mut self,
        second: &Corrected,
        seconds: u16,
        observed: &mut Observed,
        sink: Sink<'_>,
    ) -> Option<MotorCommand> {
        if let Some(adaptive) = &self.adaptive {
            let t_s = second.measured.end_s();
            let coarse = self.position <= 1;
            let over =
                if coarse { adaptive.coarse_is_over(t_s, self.rates_deg_h()) } else { adaptive.dwell_is_over(t_s) };
            return if over { self.end_adaptive_dwell(t_s, observed, sink) } else { None };
        }
        if seconds < self.dwell_s() {
            return None;
        }
        self.end_dwell(observed, sink);
        self.position = self.position.saturating_add(1);
        let t_s = second.measured.end_s();
        match self.position() {
            None => self.finish(t_s, sink),
            Some(Position::East | Position::West) if self.coarse_azimuth_deg.is_none() => {
                match self.accumulator.solve() {
                    Ok(Fix { azimuth_deg, sigma_deg, .. }) => {
                        sink(Event::Coarse { azimuth_deg, sigma_deg });
                        self.coarse_azimuth_deg = Some(azimuth_deg);
                        self.go_to_position(t_s, sink)
                    }
                    Err(unsolvable) => self.fail(unsolvable.fault(), t_s, sink),
                }
            }
            Some(_) => self.go_to_position(t_s, sink),
        }
    }

    /// The dwell of an adaptive fix is over: on to the next, or to the azimuth.
    fn end_adaptive_dwell(&mut self, t_s: f64, observed: &mut Observed, sink: Sink<'_>) -> Option<MotorCommand> {
        self.end_dwell(observed, sink);
        self.position = self.position.saturating_add(1);
        let (position, index, rates_deg_h) = (self.position, self.rules.index, self.rates_deg_h());
        let seen = self.seen();
        let Some(angle_deg) = self.turned_deg() else { return self.fail(Fault::EncoderFailed, t_s, sink) };
        let Some(adaptive) = &mut self.adaptive else { return None };
        if position == 1 {
            adaptive.begin_coarse(t_s, rates_deg_h);
            adaptive.target_deg = if angle_deg > 180.0 { angle_deg - 90.0 } else { angle_deg + 90.0 };
            return self.go_to_position(t_s, sink);
        }
        let so_far = if position > 2 { self.accumulator.solve().ok() } else { None };
        let coarse_deg = match self.coarse_azimuth_deg {
            None if adaptive.coarse_is_known(rates_deg_h) => self.accumulator.coarse_azimuth_deg(),
            coarse_deg => coarse_deg,
        };
        // An encoder that slipped and a spindle that did are told apart by many directions, before it and after.
        if core::mem::take(&mut adaptive.slipped) && position <= LAST_TO_KEEP {
            return self.fall_back(true, t_s, sink);
        }
        let Some(coarse_deg) = coarse_deg else { return self.fall_back(false, t_s, sink) };
        if adaptive.is_block_over(position)
            && so_far.is_none_or(|fix| Adaptive::contradicts(coarse_deg, fix.azimuth_deg))
        {
            return self.fall_back(false, t_s, sink);
        }
        let azimuth_deg = so_far.map_or(coarse_deg, |fix| fix.azimuth_deg);
        self.coarse_azimuth_deg = Some(azimuth_deg);
        let sides_deg = [fix::east_index_deg(azimuth_deg), fix::west_index_deg(azimuth_deg)]
            .map(|side_deg| index.target_deg(angle_deg, side_deg));
        let way_deg = |side_deg: &f64| (side_deg - angle_deg).abs();
        let nearest = sides_deg.into_iter().min_by(|a, b| way_deg(a).total_cmp(&way_deg(b)));
        // Whichever side of the mark the two lie on: not a full turn.
        let apart_deg = |side_deg: &f64| wrap_180_deg(side_deg - angle_deg).abs();
        let other = sides_deg.into_iter().max_by(|a, b| apart_deg(a).total_cmp(&apart_deg(b)));
        let target_deg = if position == 2 { nearest } else { other };
        adaptive.target_deg = target_deg.unwrap_or(angle_deg);
        let goes_on = if position == 2 {
            let way_deg = way_deg(&adaptive.target_deg);
            adaptive.begin(position, t_s, way_deg, &index, seen);
            // The bias is not known yet, and is the most of it.
            let [noise_deg_h, north_deg_h] = rates_deg_h;
            let bias_deg_h = self.accumulator.declared().gyro.bias_limit_deg_h;
            let sigma_deg = DEG_PER_RAD * libm::hypot(bias_deg_h, noise_deg_h) / north_deg_h;
            sink(Event::Coarse { azimuth_deg, sigma_deg });
            true
        } else {
            adaptive.next(position, t_s, &index, seen) || {
                // Another block begins where the index stands.
                adaptive.target_deg = angle_deg;
                adaptive.go_on(position, t_s, &index, so_far.map(|fix| fix.sigma_deg), seen)
            }
        };
        if goes_on {
            self.promise(t_s, position > 2, sink);
            return self.go_to_position(t_s, sink);
        }
        self.finish(t_s, sink)
    }

    /// An adaptive fix goes on with the mirrored four positions, if there is time for them, else it ends with what it has. The dwells so
    /// far count (`kept`) or are forgotten; their numbers go on or begin anew.
    fn fall_back(&mut self, kept: bool, t_s: f64, sink: Sink<'_>) -> Option<MotorCommand> {
        let (dwell_s, index) = (self.rules.sequence.dwell_s, &self.rules.index);
        let room = self.adaptive.and_then(|adaptive| adaptive.mirrored_dwell_s(t_s, dwell_s, index));
        let Some(dwell_s) = room else { return self.finish(t_s, sink) };
        if !kept {
            self.accumulator.begin_anew();
            self.position = 0;
        }
        (self.adaptive, self.fallen_back) = (None, Some(FallenBack { dwell_s, first: self.position }));
        sink(Event::FallenBack { dwell_s });
        self.go_to_position(t_s, sink)
    }

    /// The azimuth of all dwells, or why there is none.
    fn finish(&mut self, t_s: f64, sink: Sink<'_>) -> Option<MotorCommand> {
        match self.accumulator.solve() {
            Ok(mut fix) => {
                fix.judge(self.rules.sequence.order.accuracy_deg());
                sink(Event::Fix(fix));
                self.enter(Stage::Finished, t_s, sink);
                Some(MotorCommand::Stop)
            }
            Err(unsolvable) => self.fail(unsolvable.fault(), t_s, sink),
        }
    }

    fn dwell_s(&self) -> u16 {
        if let Some(FallenBack { dwell_s, .. }) = self.fallen_back {
            return dwell_s;
        }
        match self.position() {
            Some(Position::At { coarse: true, .. }) => self.rules.sequence.coarse_dwell_s,
            _ => self.rules.sequence.dwell_s,
        }
    }
}

#[cfg(test)]
mod tests;
