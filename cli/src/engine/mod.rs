//! What runs a fix: the simulated devices with the firmware around them, in process ([`host`]) or as the
//! real image in QEMU ([`qemu`]). Both do the same things in the same order and give the same reports, bit for bit.

pub mod host;
pub mod qemu;

use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use hal_sim::{Scenario, Truth, World};
use north_finder::event::{Event, Fix, Heading, Report, State};
use north_finder::health::Fault;
use north_finder::link::{Ask, Request, TooLong};
use north_finder::sensing::sample::SAMPLE_S;
use north_finder::sequence::Command;
use north_finder::settings::pieces::Outgoing;
use north_finder::settings::{Settings, store};

/// What to run.
#[derive(Clone, Debug)]
pub struct Setup {
    pub scenario: Scenario,
    /// The same scenario and seed give the same run, always.
    pub seed: u64,
    /// What is stored in the instrument's flash before power-up; `None`: nothing.
    pub settings: Option<Settings>,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    pub end: End,
    /// What is really so at that moment.
    pub truth: Truth,
    /// The heading after the instrument was carried, where the scenario says so.
    pub held: Option<Held>,
}

/// A heading that was held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    pub heading: Heading,
    /// What is really so at that moment.
    pub truth: Truth,
}

/// The ways in which a run ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    Fix(Fix),
    Fault {
        fault: Fault,
        state: State,
    },
    /// The scenario's `duration_limit_s` passed without a fix or a fault.
    TimeLimit,
    /// The caller asked to stop.
    Interrupted,
}

/// What runs the fix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Engine {
    /// The firmware's instrument in this process.
    Host,
    /// The firmware image in QEMU.
    Qemu,
}

impl Engine {
    /// Name, stable: files depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Qemu => "qemu",
        }
    }

    /// For people.
    pub fn description(self) -> &'static str {
        match self {
            Self::Host => "in this process",
            Self::Qemu => "firmware image in QEMU",
        }
    }
}

/// Sees every report as it comes.
pub type Observer<'a> = dyn FnMut(&Report) + 'a;

/// Who is at the instrument: hears what it reports, sends it requests.
pub trait Person {
    /// What is sent at the tick of this number.
    fn request(&mut self, tick: u64) -> Option<Request>;
    /// Hears a report; `true` if that was all, and the power goes off.
    fn hear(&mut self, report: &Report) -> bool;
}

/// Why the power went off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerOff {
    /// The person had heard all.
    Received,
    /// The time limit passed.
    TimeLimit,
    /// The caller asked to stop.
    Interrupted,
}

/// Why a run could not be done at all.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error("the settings cannot be stored in the simulated flash: {0}")]
    Flash(String),
    #[error("a request is too long for the link")]
    Request,
    #[error(transparent)]
    Qemu(#[from] qemu::QemuError),
}

impl From<TooLong> for EngineError {
    fn from(_: TooLong) -> Self {
        Self::Request
    }
}

/// The requests that bring settings to an instrument; none where they are longer than any that are valid.
pub fn to_store(settings: &Settings) -> VecDeque<Request> {
    let numbers = (1..=u8::MAX).cycle();
    let pieces = Outgoing::new(settings).into_iter().flatten();
    pieces.zip(numbers).map(|(piece, number)| Request { number, ask: Ask::WriteSettings(piece) }).collect()
}

/// Runs a fix on the chosen engine. `image` is the firmware for QEMU; without one it is built.
pub fn run(
    engine: Engine,
    image: Option<&Path>,
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
) -> Result<Outcome, EngineError> {
    run_in(engine, image, &world(setup)?, limit_ticks(setup), stop, observe)
}

/// Runs a fix in a world at power-up, for at most that many ticks.
pub fn run_in(
    engine: Engine,
    image: Option<&Path>,
    world: &World,
    limit_ticks: u64,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
) -> Result<Outcome, EngineError> {
    let mut wanted = FixWanted::new(world, observe);
    let off = serve(engine, image, world, limit_ticks, &mut wanted, stop)?;
    Ok(wanted.outcome(off))
}

/// Powers the instrument of a world up on the chosen engine, and lets a person work with it for at most that many ticks.
pub fn serve(
    engine: Engine,
    image: Option<&Path>,
    world: &World,
    limit_ticks: u64,
    person: &mut dyn Person,
    stop: &AtomicBool,
) -> Result<PowerOff, EngineError> {
    match engine {
        Engine::Host => host::serve(world, limit_ticks, person, stop, &mut |_, _| ()),
        Engine::Qemu => {
            let image = match image {
                Some(image) => qemu::image::Image::named(image),
                None => qemu::image::Image::emulated().map_err(qemu::QemuError::from)?,
            };
            Ok(qemu::serve(qemu::Pace::LockStep, image.path(), world, limit_ticks, person, stop)?.0)
        }
    }
}

/// The world at power-up, the settings in its flash.
pub fn world(setup: &Setup) -> Result<World, EngineError> {
    let world = World::new(&setup.scenario, setup.seed);
    if let Some(settings) = &setup.settings {
        store::save(&mut world.flash(), settings).map_err(|error| EngineError::Flash(format!("{error:?}")))?;
    }
    Ok(world)
}

/// The tick at which a fix that has not ended is given up, with the time in which the instrument is carried after it.
pub fn limit_ticks(setup: &Setup) -> u64 {
    let carry_s = setup.scenario.carry.as_ref().map_or(0.0, |carry| carry.wait_s + carry.walk_s + carry.stand_s);
    ((setup.scenario.duration_limit_s + carry_s) / SAMPLE_S) as u64
}

/// Somebody who wants a fix as soon as there is power, and then carries the instrument where the scenario says so.
pub struct FixWanted<'a, 'b> {
    world: World,
    observe: &'a mut Observer<'b>,
    verdict: Option<(End, Truth)>,
    /// When the instrument has been carried and stood, s.
    carried_s: Option<f64>,
    held: Option<Held>,
}

impl<'a, 'b> FixWanted<'a, 'b> {
    /// `observe` sees every report.
    pub fn new(world: &World, observe: &'a mut Observer<'b>) -> Self {
        Self { world: world.clone(), observe, verdict: None, carried_s: None, held: None }
    }

    /// How it ended.
    pub fn outcome(&self, off: PowerOff) -> Outcome {
        let (end, truth) = match (off, self.verdict) {
            (PowerOff::Received, Some(verdict)) => verdict,
            (PowerOff::Received | PowerOff::TimeLimit, _) => (End::TimeLimit, self.world.truth()),
            (PowerOff::Interrupted, _) => (End::Interrupted, self.world.truth()),
        };
        Outcome { end, truth, held: self.held }
    }
}

impl Person for FixWanted<'_, '_> {
    fn request(&mut self, tick: u64) -> Option<Request> {
        (tick == 0).then(|| Ask::Command(Command::Start).into())
    }

    /// The fix or the fault comes first, the final state after it.
    fn hear(&mut self, report: &Report) -> bool {
        (self.observe)(report);
        let truth = || self.world.truth();
        match report.event {
            Event::Fix(fix) => self.verdict = Some((End::Fix(fix), truth())),
            Event::Fault { fault, state } => self.verdict = Some((End::Fault { fault, state }, truth())),
            Event::Heading(heading) => self.held = Some(Held { heading, truth: truth() }),
            Event::State(State::Finished) if self.verdict.is_some() => self.carried_s = self.world.carry(),
            _ => {}
        }
        match self.carried_s {
            Some(carried_s) => report.t_s >= carried_s,
            None => matches!(report.event, Event::State(State::Finished | State::Failed)) && self.verdict.is_some(),
        }
    }
}
