//! What the host asks, and what becomes of it.

use core::ops::DerefMut;

use embedded_storage::nor_flash::NorFlash;

use super::seconds::Scatter;
use super::update::Slots;
use super::workspace::Workspace;
use super::{Instrument, Orders, Readings, Streaming, calibration_events};
use crate::drivers::intake::Intake;
use crate::event::bytes::{Bytes, CAPACITY};
use crate::event::restart::Text;
use crate::event::service::flash::LogFlash;
use crate::event::service::log;
use crate::event::service::record::LENGTH;
use crate::event::{Event, State};
use crate::health::{Fault, Refusal};
use crate::link::{Ask, Request};
use crate::sensing::index::MotorCommand;
use crate::sensing::sample::SAMPLE_S;
use crate::sequence::Command;
use crate::sequence::work::SecondWork;
use crate::settings::Settings;
use crate::settings::pieces::Incoming;
use crate::settings::store;

/// Most violations of settings that are reported.
const VIOLATIONS: usize = 8;
/// Records of the log in a report.
const RECORDS: usize = CAPACITY / LENGTH;
/// Bytes of the host are taken in parts of this many.
const PART: usize = 64;

impl<S: DerefMut<Target = SecondWork>, R: DerefMut<Target = Workspace>> Instrument<S, R> {
    /// Bytes of the host.
    #[inline(never)]
    pub(super) fn receive_requests(
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
        let request = self.requests.feed(byte);
        let (number, refusal) = match request {
            None => return,
            Some(Ok(Request { number, ask })) => (number, self.handle(ask, turning, flash, orders, sink).err()),
            Some(Err(bad)) => (0, Some(bad.into())),
        };
        if refusal.is_some() {
            self.counters.commands_bad = self.counters.commands_bad.saturating_add(1);
        }
        sink(Event::Answer { number, refusal });
        if orders.restart && matches!(request, Some(Ok(Request { ask: Ask::WriteSettings(_), .. }))) {
            sink(Event::SettingsStored);
        }
    }

    fn handle(
        &mut self,
        ask: Ask,
        turning: bool,
        flash: &mut impl NorFlash,
        orders: &mut Orders,
        sink: &mut dyn FnMut(Event),
    ) -> Result<(), Refusal> {
        if !self.session.admits(&ask, self.tick) {
            return Err(Refusal::Locked);
        }
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
                let incoming = self.workspace.as_deref_mut().and_then(Workspace::settings).ok_or(Refusal::Busy)?;
                if incoming.take(&piece)? {
                    // The processor stands still while flash is erased.
                    if turning {
                        return Err(Refusal::MotorTurns);
                    }
                    store(flash, incoming, sink)?;
                    orders.restart = true;
                }
            }
            Ask::Stream(true) if matches!(self.streaming, Streaming::Off) => self.streaming = Streaming::Requested,
            Ask::Stream(true) => {}
            Ask::Stream(false) => {
                self.end_block(sink);
                self.streaming = Streaming::Off;
            }
            Ask::Provoke(how) => orders.provoke = Some(how),
            Ask::WriteImage { offset, bytes } => {
                orders.restart |= self.free_slots(turning)?.take(offset, bytes.as_slice())?;
            }
            Ask::EraseImage { sector } => self.free_slots(turning)?.erase(sector.into())?,
            Ask::SelfTest => {
                if self.is_busy() {
                    return Err(Refusal::Busy);
                }
                if self.test.interrupt() {
                    orders.motor = Some(MotorCommand::Stop);
                }
                self.test.begin();
            }
            Ask::SetClock { utc_s } => self.clock_utc_s = Some(utc_s - self.tick as f64 * SAMPLE_S),
            Ask::ReadLog { from } => {
                let (next, bytes) = read_log(flash, from).ok_or(Refusal::LogUnreadable)?;
                sink(Event::Log { next, bytes });
            }
            Ask::CheckFix { azimuth_deg } => self.check_fix(azimuth_deg, turning, flash)?,
            Ask::Challenge => sink(Event::Challenge { bytes: self.session.challenge(self.tick) }),
            Ask::Unlock(signature) => {
                if self.is_busy() {
                    return Err(Refusal::Busy);
                }
                self.session.unlock(self.tick, self.identity.serial, signature.as_slice())?;
            }
            Ask::Lock => self.session.lock(),
        }
        Ok(())
    }

    /// The slots of an update, while nothing is under way that a processor that stands still would spoil.
    fn free_slots(&mut self, turning: bool) -> Result<&mut dyn Slots, Refusal> {
        if turning {
            return Err(Refusal::MotorTurns);
        }
        if self.is_busy() {
            return Err(Refusal::Busy);
        }
        match &mut self.slots {
            Some(slots) => Ok(&mut **slots),
            None => Err(Refusal::NoSlots),
        }
    }

    /// The last fix was made at a surveyed azimuth.
    fn check_fix(&mut self, azimuth_deg: f64, turning: bool, flash: &mut impl NorFlash) -> Result<(), Refusal> {
        if turning {
            return Err(Refusal::MotorTurns);
        }
        if !azimuth_deg.is_finite() {
            return Err(Refusal::NotUnderstood);
        }
        let work = self.work.as_deref_mut().ok_or(Refusal::Busy)?;
        // A fix that waits for its effect is neither told nor in the log: the check would be of the one before it.
        if self.working && work.outcome().events.iter().any(|event| matches!(event, Event::Fix(_))) {
            return Err(Refusal::Busy);
        }
        let service = &mut work.service;
        if !service.has_fix() {
            return Err(Refusal::NoFixYet);
        }
        // A check counts for the fix before it in the log, which would be another one.
        if !self.last_logged {
            return Err(Refusal::NotStored);
        }
        // What is not stored is not watched either: it will be sent again.
        self.log.check(&mut LogFlash(flash), azimuth_deg).map_err(|_| Refusal::NotStored)?;
        service.check(azimuth_deg);
        Ok(())
    }

    #[inline(never)]
    fn obey(&mut self, command: Command, sink: &mut dyn FnMut(Event)) -> Result<Option<MotorCommand>, Refusal> {
        let t_s = self.tick as f64 * SAMPLE_S;
        // The attitudes of one that was aborted are still being solved for: a few tenths of a second.
        if matches!(command, Command::CalibrateAccelerometers) && self.workspace.is_none() {
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
                if let Some(collection) = self.workspace.as_deref_mut().and_then(Workspace::begin) {
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

    /// Ends a fix with a fault, now or as soon as the sequencer is back.
    pub(super) fn fail(&mut self, fault: Fault, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        match self.idle_work() {
            Some(work) => work.sequencer.fail(fault, t_s, sink),
            None => {
                self.fault.get_or_insert(fault);
                None
            }
        }
    }

    /// Requests something of the sequencer, now or as soon as it is back: the last request counts.
    pub(super) fn command(&mut self, command: Command, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        if matches!(command, Command::Start) {
            self.scatter = Scatter::default();
        }
        let level_is_calibrated = self.level_is_calibrated;
        match (self.idle_work(), command) {
            (Some(work), Command::Start) => {
                work.sequencer.level_is_calibrated(level_is_calibrated);
                work.sequencer.start(t_s, sink)
            }
            (Some(work), _) => work.sequencer.fail(Fault::Aborted, t_s, sink),
            (None, _) => {
                self.requested = Some(command);
                None
            }
        }
    }
}

/// Records of the log from a place on, as many as a report holds, and the place of the next.
#[inline(never)]
fn read_log(flash: &mut impl NorFlash, from: u32) -> Option<(u32, Bytes)> {
    let mut records = [[0; LENGTH]; RECORDS];
    let (count, next) = log::read_places(&mut LogFlash(flash), from, &mut records).ok()?;
    Some((next, Bytes::start_of(records.as_flattened().get(..count * LENGTH)?)))
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
