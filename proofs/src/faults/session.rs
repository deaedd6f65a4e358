//! An instrument with its faults from power-up to the end of its fix, through power cuts and commands.

use std::collections::VecDeque;
use std::path::Path;

use hal_sim::World;
use north::engine::{self, Engine, EngineError, Person, PowerOff, Setup, to_store};
use north::failure::Failure;
use north::interrupt;
use north_finder::event::{Event, Fix, Report, State};
use north_finder::health::Fault;
use north_finder::link::{Ask, Request};
use north_finder::sensing::sample::SAMPLE_S;
use north_finder::sequence::Command;
use north_finder::settings::Settings;
use north_finder::settings::store::{self, Loaded};

use super::{Act, Trial};
use crate::statistics::azimuth_error_deg;

/// How a trial ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// An azimuth with the least error against where the mark pointed from beginning to end, degrees.
    Azimuth {
        fix: Fix,
        error_deg: f64,
    },
    Refused(Fault),
    /// Neither azimuth nor fault in twice the time limit.
    Hang,
    Panic,
}

/// How a trial ended, and what is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    pub ending: Ending,
    /// The fix had to be begun again: after a command, new settings or a power cut.
    pub restarted: bool,
    /// The flash holds settings that nobody stored, or none although some were stored.
    pub settings_lost: bool,
}

impl Outcome {
    pub(super) const PANIC: Self = Self { ending: Ending::Panic, restarted: false, settings_lost: false };
}

/// Time after which a person starts the fix again when it was interrupted, s.
const PATIENCE_S: f64 = 5.0;

/// Runs the trial, in QEMU where there is an image.
pub(super) fn run(trial: &Trial, image: Option<&Path>) -> Result<Outcome, Failure> {
    let engine = if image.is_some() { Engine::Qemu } else { Engine::Host };
    let setup = Setup { scenario: trial.scenario.clone(), seed: trial.seed, settings: trial.settings.clone() };
    let world = with_flipped_bits(engine::world(&setup)?, &trial.flipped_bits);
    let first_deg = world.truth().azimuth_deg;
    let limit_ticks = engine::limit_ticks(&setup);
    let mut operator = Operator::new(trial);
    loop {
        let left = limit_ticks.saturating_sub(operator.session_tick);
        let until = operator.next_cut().map_or(left, |cut| cut.saturating_sub(operator.session_tick).min(left));
        match engine::serve(engine, image, &world, until, &mut operator, interrupt::flag())? {
            PowerOff::Interrupted => return Err(Failure::Interrupted),
            PowerOff::TimeLimit if until < left => operator.cut_power(&world),
            PowerOff::Received | PowerOff::TimeLimit => break,
        }
    }
    let ending = match operator.verdict {
        None => Ending::Hang,
        Some(Event::Fault { fault, .. }) => Ending::Refused(fault),
        Some(Event::Fix(fix)) => {
            Ending::Azimuth { fix, error_deg: least_error_deg(fix.azimuth_deg, first_deg, world.truth().azimuth_deg) }
        }
        Some(_) => Ending::Hang,
    };
    let loaded = store::load(&mut world.flash()).map_err(|error| EngineError::Flash(format!("{error:?}")))?;
    let settings_lost = match loaded {
        Loaded::Valid(settings) => !operator.may_be_stored.contains(&settings),
        // Inverted bits are found out, and are nobody's fault but the flash's.
        Loaded::Missing | Loaded::Corrupt => !operator.may_be_stored.is_empty() && trial.flipped_bits.is_empty(),
    };
    Ok(Outcome { ending, restarted: operator.restarted, settings_lost })
}

fn with_flipped_bits(world: World, bits: &[usize]) -> World {
    if bits.is_empty() {
        return world;
    }
    let mut image = world.flash_contents();
    for bit in bits {
        if let Some(byte) = image.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }
    world.with_flash(&image)
}

/// The mark may have turned: nothing, if the azimuth is one that it passed.
fn least_error_deg(found_deg: f64, first_deg: f64, last_deg: f64) -> f64 {
    let (from_first, from_last) = (azimuth_error_deg(found_deg, first_deg), azimuth_error_deg(found_deg, last_deg));
    let turned_deg = azimuth_error_deg(last_deg, first_deg);
    if from_first * from_last < 0.0 && turned_deg.abs() < 90.0 {
        0.0
    } else if from_first.abs() < from_last.abs() {
        from_first
    } else {
        from_last
    }
}

/// Somebody who wants a fix, does what the trial says, and begins again where that interrupted the fix.
struct Operator {
    acts: std::vec::IntoIter<(f64, Act)>,
    next: Option<(f64, Act)>,
    /// Ticks before this session, and the session's own last one.
    session_tick: u64,
    tick: u64,
    start_at: Option<u64>,
    /// Settings on their way.
    upload: VecDeque<Request>,
    restarted: bool,
    verdict: Option<Event>,
    may_be_stored: Vec<Settings>,
}

impl Operator {
    fn new(trial: &Trial) -> Self {
        let mut acts = trial.acts.clone().into_iter();
        Self {
            next: acts.next(),
            acts,
            session_tick: 0,
            tick: 0,
            start_at: Some(0),
            upload: VecDeque::new(),
            restarted: false,
            verdict: None,
            may_be_stored: trial.settings.iter().cloned().collect(),
        }
    }

    fn next_cut(&self) -> Option<u64> {
        let cut = |act: &Act| matches!(act, Act::PowerCut | Act::StoreAndFail(..));
        self.next.as_ref().filter(|(_, act)| cut(act)).map(|(at_s, _)| (at_s / SAMPLE_S) as u64)
    }

    /// Power goes off, perhaps while settings are stored, and comes back.
    fn cut_power(&mut self, world: &World) {
        self.upload.clear();
        if let Some((_, Act::StoreAndFail(settings, bytes))) = self.next.take() {
            let mut flash = world.flash();
            flash.cut_power_after(bytes);
            // Whether it failed is seen when the settings are loaded.
            let _ = store::save(&mut flash, &settings);
            flash.restore_power();
            self.may_be_stored.push(*settings);
        }
        self.next = self.acts.next();
        self.session_tick = self.tick;
        self.begin_again();
    }

    fn begin_again(&mut self) {
        self.verdict = None;
        self.restarted = true;
        self.start_at = Some(self.tick + (PATIENCE_S / SAMPLE_S) as u64);
    }
}

impl Person for Operator {
    fn request(&mut self, tick: u64) -> Option<Request> {
        self.tick = self.session_tick + tick;
        if let Some(request) = self.upload.pop_front() {
            return Some(request);
        }
        if self.start_at.is_some_and(|at| self.tick >= at) {
            self.start_at = None;
            return Some(Ask::Command(Command::Start).into());
        }
        let due = |(at_s, act): &(f64, Act)| {
            !matches!(act, Act::PowerCut | Act::StoreAndFail(..)) && *at_s <= self.tick as f64 * SAMPLE_S
        };
        let act = self.next.take_if(|next| due(next))?;
        self.next = self.acts.next();
        self.begin_again();
        match act.1 {
            Act::Command(command) => Some(Ask::Command(command).into()),
            Act::Store(settings) => {
                if settings.validate().is_ok() {
                    self.may_be_stored.push((*settings).clone());
                }
                self.upload = to_store(&settings);
                self.upload.pop_front()
            }
            Act::StoreAndFail(..) | Act::PowerCut => None,
        }
    }

    /// The end, unless the fix is to be begun again.
    fn hear(&mut self, report: &Report) -> bool {
        if matches!(report.event, Event::Fix(_) | Event::Fault { .. }) {
            self.verdict = Some(report.event);
        }
        let settled = matches!(report.event, Event::State(State::Finished | State::Failed | State::Idle));
        // Missing settings are reported without any state.
        let refused_at_once = matches!(report.event, Event::Fault { state: State::Idle, .. });
        self.start_at.is_none() && self.verdict.is_some() && (settled || refused_at_once)
    }
}
