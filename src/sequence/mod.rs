//! The state machine of a fix: level → still? → index → settle → collect → … → solve.
//!
//! Every state has its way on, its time-out, and the way out by a fault or by the operator. Seconds and ticks come in,
//! reports and motor commands go out; nothing here reads a clock or a bus.

pub mod order;
pub mod turn;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::event::{Dwell, Event, Fix, State};
use crate::fix::dwell::{DwellRows, DwellSummary, Row};
use crate::fix::{self, Declared, Solution, moving_base};
use crate::gates::{DisturbanceGate, JitterGate, Verdict};
use crate::health::{Counters, Fault, Flag, Flags};
use crate::index::{Direction, IndexAngle, MotorCommand};
use crate::level::{LevelSecond, Tilt};
use crate::sample::RateSecond;
use crate::settings::Settings;
use order::Position;
use turn::{Progress, Turn};

/// Most dwells that a fix can have.
pub const MAX_DWELLS: usize = 64;
/// Seconds in a row without the accelerometers, or out of level while measuring, that end a fix.
const PATIENCE_SECONDS: u16 = 3;
/// Temperature change during a fix that an error model must cover, K.
const TEMPERATURE_CHANGE_K: f64 = 0.5;
/// While measuring, the level limit is this much wider than before: a tripod may settle a little.
const LEVEL_HYSTERESIS: f64 = 1.5;

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

/// All that a second brings to the sequencer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondInput {
    /// End of the second.
    pub t_s: f64,
    pub rate: RateSecond,
    /// `None`: no valid encoder reading.
    pub index: Option<Direction>,
    pub level: LevelSecond,
}

/// Takes events out of the sequencer.
pub type Sink<'a> = &'a mut dyn FnMut(Event);

/// Runs a fix.
pub struct Sequencer {
    settings: Settings,
    declared: Declared,
    state: State,
    /// When the fix began, and the state.
    started_s: f64,
    since_s: f64,
    position: usize,
    index: IndexAngle,
    level_run: u16,
    level_lost: u16,
    level_failed: u16,
    disturbance: DisturbanceGate,
    jitter: JitterGate,
    turn: Option<Turn>,
    rows: DwellRows,
    collected: u16,
    knock_run: u16,
    last_collected_deg_h: Option<f64>,
    dwells: Vec<DwellSummary, MAX_DWELLS>,
    coarse_azimuth_deg: Option<f64>,
    temperature_c: Option<(f64, f64)>,
    flags: Flags,
}

impl Sequencer {
    /// Ready to start; a latitude at which no fix is possible is the fault to report.
    pub fn new(settings: Settings) -> Result<Self, Fault> {
        let declared = settings.declared()?;
        Ok(Self {
            declared,
            state: State::Idle,
            started_s: 0.0,
            since_s: 0.0,
            position: 0,
            index: IndexAngle::default(),
            level_run: 0,
            level_lost: 0,
            level_failed: 0,
            disturbance: DisturbanceGate::new(settings.disturbance, declared.earth.north_deg_h),
            jitter: JitterGate::new(settings.jitter),
            turn: None,
            rows: DwellRows::default(),
            collected: 0,
            knock_run: 0,
            last_collected_deg_h: None,
            dwells: Vec::new(),
            coarse_azimuth_deg: None,
            temperature_c: None,
            flags: Flags::default(),
            settings,
        })
    }

    pub fn state(&self) -> State {
        self.state
    }

    /// Position number for the telemetry: while settling or collecting.
    pub fn position(&self) -> Option<u8> {
        matches!(self.state, State::Settling | State::Collecting).then_some(self.position as u8)
    }

    /// A fix is under way.
    pub fn is_active(&self) -> bool {
        !matches!(self.state, State::Idle | State::Finished | State::Failed)
    }

    /// Begins a fix, whatever was before; a motor that may be turning is stopped.
    pub fn start(&mut self, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        let stop = self.turn.take().map(|_| MotorCommand::Stop);
        self.started_s = t_s;
        self.position = 0;
        self.level_run = 0;
        self.level_lost = 0;
        self.level_failed = 0;
        self.dwells.clear();
        self.clear_dwell();
        self.coarse_azimuth_deg = None;
        self.temperature_c = None;
        self.flags = Flags::default();
        if self.settings.model.is_none() {
            self.flags.insert(Flag::Uncalibrated);
        }
        self.enter(State::Levelling, t_s, sink);
        stop
    }

    /// Ends a fix with a fault; the motor stops. Nothing happens when none is under way.
    pub fn fail(&mut self, fault: Fault, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        if !self.is_active() {
            return None;
        }
        let state = self.state;
        sink(Event::Fault { fault, state });
        self.enter(State::Failed, t_s, sink);
        self.turn.take().map(|_| MotorCommand::Stop)
    }

    /// A tick: the encoder's angle in degrees, if it was read at this tick, and whether the motor is turning.
    pub fn tick(&mut self, t_s: f64, index_deg: Option<f64>, turning: bool, sink: Sink) -> Option<MotorCommand> {
        if let Some(index_deg) = index_deg {
            self.index.push(index_deg);
        }
        let (turn, angle_deg) = (self.turn.as_mut()?, self.index.deg()?);
        match turn.tick(angle_deg, index_deg.is_some(), turning) {
            Progress::Turning => None,
            Progress::Again(command) => Some(command),
            Progress::Failed(fault) => self.fail(fault, t_s, sink),
            Progress::Arrived { index_deg } => {
                self.turn = None;
                sink(Event::Arrived {
                    position: self.position as u8,
                    index_deg: crate::units::wrap_360_deg(index_deg),
                });
                self.jitter = JitterGate::new(self.settings.jitter);
                self.enter(State::Settling, t_s, sink);
                None
            }
        }
    }

    /// A second has ended. Gives the motor's command and whether the second entered the solution.
    pub fn second(&mut self, input: &SecondInput, counters: &mut Counters, sink: Sink) -> (Option<MotorCommand>, bool) {
        if !self.is_active() {
            return (None, false);
        }
        if input.t_s - self.started_s > self.settings.time_limit_s {
            return (self.fail(Fault::OutOfTime, input.t_s, sink), false);
        }
        if let Some(fault) = self.watch_level(&input.level) {
            return (self.fail(fault, input.t_s, sink), false);
        }
        match self.state {
            State::Levelling => (self.levelling(input, sink), false),
            State::Watching => (self.watching(input, sink), false),
            State::Settling => (self.settling(input, sink), false),
            State::Collecting => self.collecting(input, counters, sink),
            State::Idle | State::Indexing | State::Finished | State::Failed | State::Calibrating => (None, false),
        }
    }

    fn enter(&mut self, state: State, t_s: f64, sink: Sink) {
        self.state = state;
        self.since_s = t_s;
        sink(Event::State(state));
    }

    fn waited_s(&self, t_s: f64) -> f64 {
        t_s - self.since_s
    }

    /// A failed sensor, or an instrument that left the level limit after it was levelled.
    fn watch_level(&mut self, level: &LevelSecond) -> Option<Fault> {
        let run = |count: &mut u16, bad: bool| {
            *count = if bad { count.saturating_add(1) } else { 0 };
            *count >= PATIENCE_SECONDS
        };
        let (failed, tilted) = match level {
            LevelSecond::Failed => (true, false),
            LevelSecond::Good(level) => {
                (false, !level.mean.tilt().is_level(self.settings.level.limit_deg * LEVEL_HYSTERESIS))
            }
        };
        if run(&mut self.level_failed, failed) {
            return Some(Fault::AccelerometerFailed);
        }
        (run(&mut self.level_lost, tilted && self.state != State::Levelling)).then_some(Fault::LevelLost)
    }

    fn levelling(&mut self, input: &SecondInput, sink: Sink) -> Option<MotorCommand> {
        if let LevelSecond::Good(level) = input.level {
            let tilt = level.mean.tilt();
            let level = tilt.is_level(self.settings.level.limit_deg);
            let Tilt { pitch_deg, roll_deg } = tilt;
            sink(Event::Level { pitch_deg, roll_deg, level });
            self.level_run = if level { self.level_run.saturating_add(1) } else { 0 };
            if self.level_run >= self.settings.level.seconds {
                self.disturbance = DisturbanceGate::new(self.settings.disturbance, self.declared.earth.north_deg_h);
                self.enter(State::Watching, input.t_s, sink);
                return None;
            }
        }
        if self.waited_s(input.t_s) >= self.settings.level.timeout_s {
            return self.fail(Fault::NotLevel, input.t_s, sink);
        }
        None
    }

    fn watching(&mut self, input: &SecondInput, sink: Sink) -> Option<MotorCommand> {
        if input.rate.usable {
            match self.disturbance.push(input.rate.rate_deg_h) {
                (excess_deg_h, Verdict::Passed) => {
                    sink(Event::Undisturbed { excess_deg_h });
                    return self.go_to_position(input.t_s, sink);
                }
                (excess_deg_h, Verdict::Refused) => {
                    self.flags.insert(Flag::Disturbed);
                    sink(Event::Disturbed { excess_deg_h });
                }
                (_, Verdict::Watching) => {}
            }
        } else {
            self.disturbance.interrupt();
        }
        if self.waited_s(input.t_s) >= self.settings.disturbance.timeout_s {
            return self.fail(Fault::Disturbed, input.t_s, sink);
        }
        None
    }

    /// Turns to the current position, or begins to collect there if the gyro is at it already.
    fn go_to_position(&mut self, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        let Some(angle_deg) = self.index.deg() else {
            return self.fail(Fault::EncoderFailed, t_s, sink);
        };
        let Some(target_deg) = self.target_deg() else {
            return self.fail(Fault::Unsolvable, t_s, sink);
        };
        if (target_deg - angle_deg).abs() <= self.settings.index.tolerance_deg {
            self.enter(State::Collecting, t_s, sink);
            return None;
        }
        sink(Event::Moving { position: self.position as u8, target_deg });
        let (turn, command) = Turn::new(self.settings.index, angle_deg, target_deg);
        self.turn = Some(turn);
        self.enter(State::Indexing, t_s, sink);
        Some(command)
    }

    /// Index angle of the current position; `None` past the last, or before the coarse azimuth is known.
    fn target_deg(&self) -> Option<f64> {
        match self.settings.sequence.order.position(self.position)? {
            Position::At { index_deg, .. } => Some(index_deg),
            Position::East => self.coarse_azimuth_deg.map(fix::east_index_deg),
            Position::West => self.coarse_azimuth_deg.map(fix::west_index_deg),
        }
    }

    fn settling(&mut self, input: &SecondInput, sink: Sink) -> Option<MotorCommand> {
        let position = self.position as u8;
        if input.rate.usable {
            match self.jitter.push(input.rate.rate_deg_h) {
                (_, Verdict::Passed) => {
                    sink(Event::Settled { position });
                    self.enter(State::Collecting, input.t_s, sink);
                    return None;
                }
                (change_deg_h, Verdict::Refused) => {
                    self.flags.insert(Flag::Jitter);
                    sink(Event::Jitter { position, change_deg_h });
                }
                (_, Verdict::Watching) => {}
            }
        } else {
            self.jitter.interrupt();
        }
        if self.waited_s(input.t_s) >= self.settings.jitter.timeout_s {
            return self.fail(Fault::Jitter, input.t_s, sink);
        }
        None
    }

    fn collecting(&mut self, input: &SecondInput, counters: &mut Counters, sink: Sink) -> (Option<MotorCommand>, bool) {
        let RateSecond { rate_deg_h, moment_arcsec_s, usable, missing, .. } = input.rate;
        if missing > 0 {
            self.flags.insert(Flag::FramesLost);
        }
        let Some(Direction { cos, sin }) = input.index.filter(|_| usable) else { return (None, false) };
        let threshold_deg_h = self.settings.jitter.threshold_deg_h;
        let jumped = self.last_collected_deg_h.is_some_and(|last| (rate_deg_h - last).abs() > threshold_deg_h);
        if jumped {
            return (self.knocked(rate_deg_h, input.t_s, counters, sink), false);
        }
        self.knock_run = 0;
        self.last_collected_deg_h = Some(rate_deg_h);
        if let Some(temp_c) = input.rate.conditions.temp_c {
            self.watch_temperature(temp_c);
        }
        let level = match input.level {
            LevelSecond::Good(level) => Some(level),
            LevelSecond::Failed => None,
        };
        let row = Row { t_s: input.t_s - 0.5, seconds: 1.0, cos, sin, rate_deg_h, moment_arcsec_s, level };
        self.rows.push(row, self.settings.gyro.noise_deg_h());
        self.collected += 1;
        if self.collected < self.dwell_s() {
            return (None, true);
        }
        self.summarise(counters, sink);
        self.clear_dwell();
        self.position += 1;
        let command = match self.settings.sequence.order.position(self.position) {
            None => self.finish(input.t_s, counters, sink),
            Some(Position::East | Position::West) if self.coarse_azimuth_deg.is_none() => {
                self.steer_east_west(input.t_s, sink)
            }
            Some(_) => self.go_to_position(input.t_s, sink),
        };
        (command, true)
    }

    /// A second in which the rate jumped is left out; as many in a row as make jitter send the state back to settling.
    fn knocked(&mut self, rate_deg_h: f64, t_s: f64, counters: &mut Counters, sink: Sink) -> Option<MotorCommand> {
        counters.seconds_knocked = counters.seconds_knocked.saturating_add(1);
        self.flags.insert(Flag::Shock);
        self.knock_run += 1;
        if self.knock_run >= self.settings.jitter.seconds {
            let change_deg_h = rate_deg_h - self.last_collected_deg_h.unwrap_or(0.0);
            self.flags.insert(Flag::Jitter);
            sink(Event::Jitter { position: self.position as u8, change_deg_h });
            self.knock_run = 0;
            self.last_collected_deg_h = None;
            self.jitter = JitterGate::new(self.settings.jitter);
            self.enter(State::Settling, t_s, sink);
        }
        None
    }

    fn watch_temperature(&mut self, temp_c: f64) {
        let (low_c, high_c) = self.temperature_c.unwrap_or((temp_c, temp_c));
        let (low_c, high_c) = (low_c.min(temp_c), high_c.max(temp_c));
        self.temperature_c = Some((low_c, high_c));
        let covered = self.settings.model.as_ref().is_some_and(|model| model.covers_temperature());
        if high_c - low_c > TEMPERATURE_CHANGE_K && !covered {
            self.flags.insert(Flag::Temperature);
        }
    }

    fn dwell_s(&self) -> u16 {
        match self.settings.sequence.order.position(self.position) {
            Some(Position::At { coarse: true, .. }) => self.settings.sequence.coarse_dwell_s,
            _ => self.settings.sequence.dwell_s,
        }
    }

    fn clear_dwell(&mut self) {
        self.rows.clear();
        self.collected = 0;
        self.knock_run = 0;
        self.last_collected_deg_h = None;
    }

    /// Boils the collected rows down to a stay.
    fn summarise(&mut self, counters: &mut Counters, sink: Sink) {
        let noise_deg_h = 60.0 * self.settings.gyro.arw_deg_per_sqrt_h;
        let base_motion = self.settings.model.as_ref().and_then(|model| model.base_motion);
        let summary = match base_motion {
            Some(sensing) => moving_base::summary(self.rows.as_slice(), sensing, noise_deg_h),
            None => self.rows.summary(noise_deg_h),
        };
        if let Some(summary) = summary {
            counters.seconds_knocked = counters.seconds_knocked.saturating_add(summary.outliers.into());
            sink(Event::Dwell(Dwell {
                position: self.position as u8,
                index_deg: summary.index_deg(),
                seconds: summary.seconds,
                rate_deg_h: summary.rate.mean,
                sigma_deg_h: summary.sigma_deg_h(),
            }));
            // Settings are refused when they ask for more stays than there is room for.
            let _ = self.dwells.push(summary);
        }
        self.rows.clear();
    }

    fn steer_east_west(&mut self, t_s: f64, sink: Sink) -> Option<MotorCommand> {
        match fix::solve(&self.dwells, &self.declared, &self.settings.model.clone().unwrap_or_default()) {
            Ok(Solution { azimuth_deg, sigma_deg, .. }) => {
                sink(Event::Coarse { azimuth_deg, sigma_deg });
                self.coarse_azimuth_deg = Some(azimuth_deg);
                self.go_to_position(t_s, sink)
            }
            Err(_) => self.fail(Fault::Unsolvable, t_s, sink),
        }
    }

    fn finish(&mut self, t_s: f64, counters: &Counters, sink: Sink) -> Option<MotorCommand> {
        match fix::solve(&self.dwells, &self.declared, &self.settings.model.clone().unwrap_or_default()) {
            Ok(solution) => {
                sink(Event::Health(*counters));
                sink(Event::Fix(Fix::new(&solution, self.flags)));
                self.enter(State::Finished, t_s, sink);
                None
            }
            Err(_) => self.fail(Fault::Unsolvable, t_s, sink),
        }
    }
}

impl Fix {
    /// The solution with the flags that the sequence adds.
    pub fn new(solution: &Solution, flags: Flags) -> Self {
        Self {
            azimuth_deg: solution.azimuth_deg,
            sigma_deg: solution.sigma_deg,
            closure_deg_h: solution.closure_deg_h,
            bias_deg_h: solution.bias_deg_h,
            amplitude_deg_h: solution.amplitude_deg_h,
            drift_deg_h_per_h: solution.drift_deg_h_per_h,
            tilt_deg: solution.tilt.map(|Tilt { pitch_deg, roll_deg }| [pitch_deg, roll_deg]),
            seconds: solution.seconds,
            flags: solution.flags.union(flags),
        }
    }
}
