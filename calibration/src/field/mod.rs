//! Calibration of the instrument's own accelerometers in the field: an operator puts the instrument down in one attitude
//! after the other, and is told where the next one is most needed.
//!
//! [`collection`] finds the rests, averages them and guides the operator; [`problem`] solves the ellipsoid when the sphere
//! is covered, and judges it by attitudes that it did not learn from; [`Session`] is the way from the command to the stored
//! result, or to the reason why there is none.
//!
//! Solving takes as long as many ticks, and storing belongs to whoever has the flash. So both are done outside: between two
//! ticks, [`Session::is_posed`] and [`Session::to_store`] say that there is work, and [`Session::solved`] and [`Session::stored`]
//! take the result, whenever it comes.

pub mod collection;
pub mod guidance;
pub mod problem;
pub mod refusal;

use quantities::codes::TriadCode;

use self::collection::{Collection, Progress};
use self::guidance::{Guidance, Step};
use self::problem::Solved;
use self::refusal::{NoCalibration, Why};
use super::accelerometer::AccelerometerCalibration;
use super::ellipsoid::Correction;

/// A calibration from the command to its end. Its attitudes are kept elsewhere, so that their room can be lent to who solves for them.
#[derive(Clone, Debug, Default)]
pub struct Session {
    stage: Stage,
}

#[derive(Clone, Debug, Default)]
enum Stage {
    #[default]
    Off,
    Collecting,
    /// The attitudes wait to be solved for.
    Posed,
    Solving,
    Answered(Result<Solved, NoCalibration>),
    /// The calibration waits to be taken.
    Offered(AccelerometerCalibration),
    Storing(AccelerometerCalibration),
    Stored(AccelerometerCalibration),
    NotStored,
}

/// What a session tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    Started,
    Guidance(Guidance),
    /// What was found, before and after.
    Solved(Solved),
    /// The calibration is in flash and in effect; the session is over.
    Stored,
    /// It came to nothing; the session is over.
    Failed(NoCalibration),
}

type Sink<'a> = &'a mut dyn FnMut(Event);

impl Session {
    /// Begins, whatever was before; the calibration in use is what a new one must beat.
    pub fn start(&mut self, collection: &mut Collection, in_use: Correction, sink: Sink) {
        self.abort(sink);
        sink(Event::Started);
        collection.begin(in_use);
        sink(Event::Guidance(collection.guidance(Step::Turn)));
        self.stage = Stage::Collecting;
    }

    /// One is under way.
    pub fn is_active(&self) -> bool {
        !matches!(self.stage, Stage::Off)
    }

    /// Attitudes are being collected.
    pub fn is_collecting(&self) -> bool {
        matches!(self.stage, Stage::Collecting)
    }

    /// Ends it without a result. Nothing happens when none is under way. What is being stored may still arrive in flash.
    pub fn abort(&mut self, sink: Sink) {
        if self.is_active() {
            self.end(Why::Aborted.into(), sink);
        }
    }

    /// A reading of the accelerometers; `None`: it failed.
    pub fn reading(&mut self, collection: &mut Collection, reading: Option<TriadCode>, sink: Sink) {
        if !self.is_collecting() {
            return;
        }
        match collection.push(reading.map(TriadCode::g), &mut |guidance| sink(Event::Guidance(guidance))) {
            Progress::GoOn => {}
            Progress::Enough => self.stage = Stage::Posed,
            Progress::Hopeless(reason) => self.end(reason, sink),
        }
    }

    /// A tick: tells what has come of the solution and of the flash. Gives a calibration that is stored, at the moment from which it
    /// is in effect.
    pub fn tick(&mut self, sink: Sink) -> Option<AccelerometerCalibration> {
        match &mut self.stage {
            Stage::Answered(Ok(solved)) => {
                let solved = *solved;
                sink(Event::Solved(solved));
                if solved.is_better() {
                    self.stage = Stage::Offered(solved.calibration);
                } else {
                    self.end(Why::NotBetter.into(), sink);
                }
            }
            Stage::Answered(Err(reason)) => {
                let reason = *reason;
                self.end(reason, sink);
            }
            Stage::Stored(calibration) => {
                let calibration = *calibration;
                self.stage = Stage::Off;
                sink(Event::Stored);
                return Some(calibration);
            }
            Stage::NotStored => self.end(Why::NotStored.into(), sink),
            Stage::Off | Stage::Collecting | Stage::Posed | Stage::Solving | Stage::Offered(_) | Stage::Storing(_) => {}
        }
        None
    }

    /// Whether the attitudes are to be solved for now; says so once. The answer goes to [`Self::solved`].
    pub fn is_posed(&mut self) -> bool {
        let posed = matches!(self.stage, Stage::Posed);
        if posed {
            self.stage = Stage::Solving;
        }
        posed
    }

    /// The answer to the problem; it is told at the next tick. One that nobody waits for any more is dropped.
    pub fn solved(&mut self, answer: Result<Solved, NoCalibration>) {
        if matches!(self.stage, Stage::Solving) {
            self.stage = Stage::Answered(answer);
        }
    }

    /// A calibration to be stored, once; whether that succeeded goes to [`Self::stored`].
    pub fn to_store(&mut self) -> Option<AccelerometerCalibration> {
        let Stage::Offered(calibration) = self.stage else { return None };
        self.stage = Stage::Storing(calibration);
        Some(calibration)
    }

    /// Whether the calibration is in flash; it is told at the next tick.
    pub fn stored(&mut self, stored: bool) {
        if let Stage::Storing(calibration) = self.stage {
            self.stage = if stored { Stage::Stored(calibration) } else { Stage::NotStored };
        }
    }

    fn end(&mut self, reason: NoCalibration, sink: Sink) {
        self.stage = Stage::Off;
        sink(Event::Failed(reason));
    }
}

#[cfg(test)]
mod tests;
