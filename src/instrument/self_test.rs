//! The instrument's test of itself, item by item.
//!
//! At the start, without being asked and without moving anything, it tells of settings, memory, reset and clock, and counts for three
//! seconds what comes from gyro, accelerometer, encoder and block. On request it does so again; then the accelerometer applies its
//! own test force, and the motor makes a short move out and back, which the encoder must see. Nothing depends on the verdicts: they are told.

use quantities::codes::TriadCode;

use crate::drivers::sensors::Due;
use crate::event::restart::Cause;
use crate::health::{Fault, Finding, Item, TestVerdict};
use crate::instrument::analogue::Calibration;
use crate::sensing::frame::{Frame, GyroFormat};
use crate::sensing::index::{IndexSettings, MotorCommand};
use crate::sequence::turn::{Progress, Turn};

/// What is counted: three seconds from the gyro's first frame on.
const WINDOW_TICKS: u16 = 1200;
/// Of these the first second is not counted of the sensors: a part that is starting gets its time (the block takes a third of a second).
const STARTING_TICKS: u16 = 400;
/// A gyro that was just switched on may take this long to its first frame: 30 s, as for [`crate::instrument::watch::GyroWatch`].
const WAKING_TICKS: u16 = 12_000;
/// Frames a second that are allowed. A late link delays up to twelve frames, 1 % of the window; a clock that is wrong by less than this
/// is found by [`crate::instrument::watch::GyroWatch`], which looks longer.
const FRAMES_S: [f32; 2] = [394.0, 406.0];
/// Least share of frames that the gyro vouches for, and of readings that are valid, per cent.
const VOUCHED: f32 = 99.0;
const VALID: f32 = 90.0;
/// The accelerometer's response to its test force along x and y, and along z, g: ADXL355, data sheet revision B, table 1.
const RESPONSE_XY_G: [f32; 2] = [0.1, 0.6];
const RESPONSE_Z_G: [f32; 2] = [0.5, 3.0];
/// The response comes after half a second; then it is waited for no more: 1 s.
const RESPONSE_TICKS: u16 = 400;
/// The index moves by so much and back, degrees …
const MOVE_DEG: f64 = 5.0;
/// … and must come within this, or within the tolerance of the settings where that is less.
const TOLERANCE_DEG: f64 = 0.5;

/// What a board found of itself at its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardFacts {
    /// Words of unused memory that do not hold what is written to them.
    pub wrong_words: u32,
    /// What ended the run before, where that was a fault.
    pub crash: Option<Cause>,
    /// Whether the clock runs from the crystal, where there is one.
    pub crystal: Option<bool>,
    /// What the chip's maker converted.
    pub analogue: Calibration,
    /// What no other start has.
    pub entropy: [u32; 4],
}

/// A share of all that was seen.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    good: u16,
    all: u16,
}

impl Share {
    fn push(&mut self, good: bool) {
        self.good = self.good.saturating_add(good.into());
        self.all = self.all.saturating_add(1);
    }

    fn finding(self, item: Item, least: f32) -> Finding {
        let measured = 100.0 * f32::from(self.good) / f32::from(self.all.max(1));
        Finding::judged(item, measured, [least, 100.0])
    }
}

/// What is counted in the window.
#[derive(Clone, Debug, Default)]
struct Counts {
    /// Ticks from the start, and those from the first frame on.
    ticks: u16,
    window: u16,
    gyro: Share,
    /// The gyro's last frame, and how many it has sent since the first by its own numbers: what the line lost counts.
    last_frame: Option<u8>,
    sent: u16,
    accelerometer: Share,
    last_acceleration: Option<TriadCode>,
    encoder: Share,
    block: Share,
}

/// One of the two ways of the move.
#[derive(Clone, Debug)]
struct Leg {
    turn: Turn,
    start_deg: f64,
    target_deg: f64,
    back: bool,
    /// Largest deviation at the end of a way, degrees.
    worst_deg: f64,
}

#[derive(Clone, Debug)]
enum Stage {
    Off,
    Counting,
    /// The accelerometer's own test is under way for so many ticks.
    Responding(u16),
    /// The move begins at the next tick.
    Ready,
    Turning(Leg),
    /// The item of this place is told next.
    Telling(u8),
}

/// The test under way, and what came of it.
#[derive(Clone, Debug)]
pub struct SelfTest {
    board: Option<BoardFacts>,
    /// What is told before all else, without waiting for the gyro: a clock that is not the crystal's makes every second wrong.
    urgent: Option<Finding>,
    format: GyroFormat,
    /// With what is done on request only.
    asked: bool,
    stage: Stage,
    counts: Counts,
    response: Finding,
    drive: Finding,
}

impl SelfTest {
    /// That of the start, under way.
    #[inline(always)]
    pub fn at_start() -> Self {
        Self {
            board: None,
            urgent: None,
            format: GyroFormat::Compact,
            asked: false,
            stage: Stage::Counting,
            counts: Counts::default(),
            response: Finding::untested(Item::Response, TestVerdict::NotAsked),
            drive: Finding::untested(Item::Drive, TestVerdict::NotAsked),
        }
    }

    /// What the board found. Without it, in a process, there is none.
    pub fn board_is(&mut self, facts: BoardFacts) {
        self.board = Some(facts);
        self.urgent = facts.crystal.map(clock).filter(|finding| !finding.passed());
    }

    /// Which frames the gyro sends.
    pub fn set_up(&mut self, format: GyroFormat) {
        self.format = format;
    }

    /// Begins anew, with what is done on request only.
    pub fn begin(&mut self) {
        *self = Self {
            asked: true,
            board: self.board,
            format: self.format,
            response: Finding::untested(Item::Response, TestVerdict::Unmet),
            drive: Finding::untested(Item::Drive, TestVerdict::Unmet),
            ..Self::at_start()
        };
    }

    /// A command came: what is only done on request is given up. Gives whether the motor is to be stopped.
    pub fn interrupt(&mut self) -> bool {
        let turning = matches!(self.stage, Stage::Turning(_));
        if core::mem::take(&mut self.asked) {
            if matches!(self.stage, Stage::Counting | Stage::Responding(_)) {
                self.response = Finding::untested(Item::Response, TestVerdict::Interrupted);
            }
            if !matches!(self.stage, Stage::Telling(_)) {
                self.drive = Finding::untested(Item::Drive, TestVerdict::Interrupted);
            }
            if !matches!(self.stage, Stage::Counting | Stage::Telling(_)) {
                self.stage = Stage::Telling(0);
            }
        }
        turning
    }

    /// Whether there is anything to be done at all.
    pub fn is_under_way(&self) -> bool {
        !matches!(self.stage, Stage::Off)
    }

    /// A good frame of the gyro.
    pub fn frame(&mut self, frame: &Frame) {
        if !matches!(self.stage, Stage::Counting) {
            return;
        }
        let counts = &mut self.counts;
        counts.gyro.push(frame.valid && !frame.saturated);
        let modulus = self.format.sequence_modulus();
        let last = counts.last_frame.get_or_insert(frame.sequence);
        // Both moduli are powers of two. What lies behind comes twice, or late.
        let ahead = u16::from(frame.sequence.wrapping_sub(*last)) & (modulus - 1);
        if ahead < modulus / 2 {
            *last = frame.sequence;
            counts.sent = counts.sent.saturating_add(ahead);
        }
    }

    /// A tick with its readings, after its frames. Gives whether the accelerometer shall do its own test, once.
    pub fn tick(&mut self, sensors: &Due) -> bool {
        match &mut self.stage {
            Stage::Counting => return self.count(sensors),
            Stage::Responding(ticks) => {
                *ticks += 1;
                match sensors {
                    Due::Response(code) => {
                        self.response = responded(*code);
                        self.stage = Stage::Ready;
                    }
                    _ if *ticks > RESPONSE_TICKS => self.stage = Stage::Ready,
                    _ => {}
                }
            }
            Stage::Off | Stage::Ready | Stage::Turning(_) | Stage::Telling(_) => {}
        }
        false
    }

    fn count(&mut self, sensors: &Due) -> bool {
        let counts = &mut self.counts;
        counts.ticks += 1;
        let awake = counts.ticks > STARTING_TICKS;
        match sensors {
            Due::Acceleration(reading) if awake => {
                let acceleration = reading.map(|reading| reading.acceleration);
                let before = core::mem::replace(&mut counts.last_acceleration, acceleration);
                counts.accelerometer.push(acceleration.is_some() && acceleration != before);
            }
            Due::Index(reading) if awake => counts.encoder.push(reading.is_some()),
            Due::Block(reading) if awake => counts.block.push(reading.is_some()),
            _ => {}
        }
        let patience = if self.asked { WINDOW_TICKS } else { WAKING_TICKS };
        match counts.last_frame {
            None if counts.ticks < patience => return false,
            Some(_) if counts.window < WINDOW_TICKS => {
                counts.window += 1;
                return false;
            }
            _ => {}
        }
        // A part that does not answer has no test of its own.
        let responds = self.asked && counts.accelerometer.finding(Item::Accelerometer, VALID).passed();
        self.stage = match (self.asked, responds) {
            (true, true) => Stage::Responding(0),
            (true, false) => Stage::Ready,
            (false, _) => Stage::Telling(0),
        };
        responds
    }

    /// Whether the motor moves, or is to.
    pub fn moves(&self) -> bool {
        matches!(self.stage, Stage::Ready | Stage::Turning(_))
    }

    /// A tick while that is so: the unwrapped index angle, whether the encoder was read at this tick, and whether the motor is turning.
    /// `settings`: none where none are valid, and nothing is moved.
    pub fn turn(
        &mut self,
        index_deg: Option<f64>,
        fresh: bool,
        turning: bool,
        settings: Option<IndexSettings>,
    ) -> Option<MotorCommand> {
        let (Some(index_deg), Some(settings), true) = (index_deg, settings, self.encoder().passed()) else {
            self.stage = Stage::Telling(0);
            return None;
        };
        let tolerance_deg = settings.tolerance_deg.min(TOLERANCE_DEG);
        let settings = IndexSettings { retries: 0, tolerance_deg, ..settings };
        let leg = match &mut self.stage {
            Stage::Turning(leg) => leg,
            _ => {
                let forth_deg = index_deg + MOVE_DEG;
                let within = settings.target_deg(index_deg, forth_deg) == forth_deg;
                let target_deg = if within { forth_deg } else { index_deg - MOVE_DEG };
                let (turn, command) = Turn::new(settings, index_deg, target_deg);
                let leg = Leg { turn, start_deg: index_deg, target_deg, back: false, worst_deg: 0.0 };
                self.stage = Stage::Turning(leg);
                return Some(command);
            }
        };
        let (end_deg, failed) = match leg.turn.tick(index_deg, fresh, turning) {
            Progress::Turning => return None,
            Progress::Arrived { index_deg, .. } => (index_deg, false),
            // There are no other attempts.
            Progress::Failed(_) | Progress::Again(_) => (index_deg, true),
        };
        leg.worst_deg = leg.worst_deg.max((end_deg - leg.target_deg).abs());
        if !failed && !leg.back {
            let (turn, command) = Turn::new(settings, end_deg, leg.start_deg);
            (leg.turn, leg.target_deg, leg.back) = (turn, leg.start_deg, true);
            return Some(command);
        }
        self.drive = Finding::judged(Item::Drive, leg.worst_deg as f32, [0.0, tolerance_deg as f32]);
        self.stage = Stage::Telling(0);
        Some(MotorCommand::Stop)
    }

    fn encoder(&self) -> Finding {
        self.counts.encoder.finding(Item::Encoder, VALID)
    }

    /// The next item, if the test is done. `refusal`: why no fix can be started; `block`: whether there is one; `limit_open`: whether the
    /// limit switch is open, where there is one.
    pub fn next(&mut self, refusal: Option<Fault>, block: bool, limit_open: Option<bool>) -> Option<Finding> {
        if let Some(finding) = self.urgent.take() {
            return Some(finding);
        }
        let Stage::Telling(place) = &mut self.stage else { return None };
        let item = Item::ALL.get(usize::from(*place)).copied();
        *place += 1;
        if item.is_none() {
            self.stage = Stage::Off;
        }
        item.map(|item| self.finding(item, refusal, block, limit_open))
    }

    fn finding(&self, item: Item, refusal: Option<Fault>, block: bool, limit_open: Option<bool>) -> Finding {
        let Counts { gyro, sent, accelerometer, block: block_readings, .. } = self.counts;
        // Codes and counts of what must not be.
        let none = |measured: u32| Finding::judged(item, measured as f32, [0.0, 0.0]);
        let crash = |cause: Option<Cause>| cause.map_or(0, |cause| u32::from(cause.code()));
        let absent = Finding::untested(item, TestVerdict::Absent);
        match item {
            Item::Settings => none(refusal.map_or(0, |fault| fault.code().into())),
            Item::Memory => self.board.map_or(absent, |board| none(board.wrong_words)),
            Item::Reset => self.board.map_or(absent, |board| none(crash(board.crash))),
            Item::Clock => self.board.and_then(|board| board.crystal).map_or(absent, clock),
            Item::Gyro => gyro.finding(item, VOUCHED),
            Item::GyroRate if gyro.all == 0 => Finding::untested(item, TestVerdict::Unmet),
            Item::GyroRate => {
                let measured = 400.0 * f32::from(sent) / f32::from(WINDOW_TICKS);
                Finding::judged(item, measured, FRAMES_S)
            }
            Item::Accelerometer => accelerometer.finding(item, VALID),
            Item::Encoder => self.encoder(),
            Item::Block if block => block_readings.finding(item, VALID),
            Item::Block => absent,
            Item::Response => self.response,
            Item::Drive => self.drive,
            Item::Limit => limit_open.map_or(absent, |open| none(open.into())),
        }
    }
}

/// Whether the clock runs from the crystal.
fn clock(crystal: bool) -> Finding {
    Finding::judged(Item::Clock, f32::from(u8::from(crystal)), [1.0, 1.0])
}

/// Of the axes that are off the first, else z.
fn responded(code: TriadCode) -> Finding {
    let [x, y, z] = code.0.map(|counts| counts as f32 / TriadCode::RESPONSE_COUNTS_PER_G);
    let finding = |measured: f32, allowed| Finding::judged(Item::Response, measured, allowed);
    let [x, y, z] = [finding(x, RESPONSE_XY_G), finding(y, RESPONSE_XY_G), finding(z, RESPONSE_Z_G)];
    [x, y].into_iter().find(|axis| !axis.passed()).unwrap_or(z)
}
