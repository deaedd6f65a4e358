//! The accelerometers calibrated in the field: the simulated operator does what the instrument asks.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use calibration::field::guidance::{Guidance, Step};
use calibration::field::problem::Solved;
use calibration::field::refusal::NoCalibration;
use hal_sim::{Operator, World};
use north_finder::event::{Event, Report, State};
use north_finder::health::Fault;
use north_finder::link::{Ask, Request};
use north_finder::sequence::Command;

use crate::engine::{self, Engine, EngineError, FixWanted, Observer, Person, PowerOff, Setup};

/// How a calibration ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The result is in the instrument's flash.
    Stored,
    Refused(NoCalibration),
    /// It could not even begin.
    Fault(Fault),
    /// The scenario's `duration_limit_s` passed.
    TimeLimit,
    Interrupted,
}

/// What a calibration came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    pub end: End,
    /// What was found, also if it was not stored.
    pub solved: Option<Solved>,
}

/// The scenario's operator at the instrument: wants a calibration as soon as there is power, and turns the instrument as it
/// is told.
pub struct Obedient<'a, 'b> {
    world: World,
    operator: Operator,
    observe: &'a mut Observer<'b>,
    solved: Option<Solved>,
    end: Option<End>,
}

impl<'a, 'b> Obedient<'a, 'b> {
    /// `observe` sees every report.
    pub fn new(world: &World, setup: &Setup, observe: &'a mut Observer<'b>) -> Self {
        let operator = Operator::new(&setup.scenario, setup.seed);
        Self { world: world.clone(), operator, observe, solved: None, end: None }
    }

    /// How it ended.
    pub fn outcome(&self, off: PowerOff) -> Outcome {
        let end = match (off, self.end) {
            (PowerOff::Received, Some(end)) => end,
            (PowerOff::Received | PowerOff::TimeLimit, _) => End::TimeLimit,
            (PowerOff::Interrupted, _) => End::Interrupted,
        };
        Outcome { end, solved: self.solved }
    }
}

impl Person for Obedient<'_, '_> {
    fn request(&mut self, tick: u64) -> Option<Request> {
        (tick == 0).then(|| Ask::Command(Command::CalibrateAccelerometers).into())
    }

    fn hear(&mut self, report: &Report) -> bool {
        (self.observe)(report);
        match report.event {
            Event::Guidance(guidance) => follow(&mut self.operator, &self.world, &guidance),
            Event::Calibration(solved) => self.solved = Some(solved),
            Event::CalibrationStored => self.end = Some(End::Stored),
            Event::NoCalibration(reason) => self.end = Some(End::Refused(reason)),
            Event::Fault { fault, .. } => self.end = Some(End::Fault(fault)),
            _ => {}
        }
        matches!(report.event, Event::State(State::Finished | State::Failed))
    }
}

/// The operator does what the instrument asks for.
pub fn follow(operator: &mut Operator, world: &World, guidance: &Guidance) {
    match guidance.step {
        Step::Turn | Step::Known | Step::NotGravity => operator.turn(world, guidance.next.unit()),
        Step::Hold | Step::Accepted | Step::Moved | Step::Solving => {}
    }
}

/// Calibrates the accelerometers of the instrument in this world, which the setup made.
pub fn calibrate(
    engine: Engine,
    image: Option<&Path>,
    world: &World,
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
) -> Result<Outcome, EngineError> {
    let mut person = Obedient::new(world, setup, observe);
    let off = engine::serve(engine, image, world, engine::limit_ticks(setup), &mut person, stop)?;
    Ok(person.outcome(off))
}

/// Power on with this content of the flash, in the place and at the seed of the setup: north.
///
/// Errors: the engine cannot begin or breaks off.
pub fn find(
    engine: Engine,
    image: Option<&Path>,
    setup: &Setup,
    flash: &[u8],
    stop: &AtomicBool,
) -> Result<engine::Outcome, EngineError> {
    let world = World::new(&setup.scenario, setup.seed).with_flash(flash);
    let mut silent = |_: &_| ();
    let mut wanted = FixWanted::new(&world, &mut silent);
    let off = engine::serve(engine, image, &world, engine::limit_ticks(setup), &mut wanted, stop)?;
    Ok(wanted.outcome(off))
}
