extern crate std;

use std::boxed::Box;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::vec::Vec;

use embedded_storage::nor_flash::{ErrorType, NorFlashErrorKind, ReadNorFlash};

use north_boot::manifest::{public, sign};

use super::session::{CHALLENGE, message};
use super::*;
use crate::drivers::sensors::Due;
use crate::event::Dwell;
use crate::event::bytes::Bytes;
use crate::health::Refusal;
use crate::link::{Ask, encode_request};
use crate::settings::access::PublicKey;

/// A flash that nothing was ever written to, and cannot be.
struct Erased;

impl ErrorType for Erased {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Erased {
    const READ_SIZE: usize = 1;

    fn read(&mut self, _offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        bytes.fill(0xFF);
        Ok(())
    }

    fn capacity(&self) -> usize {
        8192
    }
}

impl NorFlash for Erased {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, _from: u32, _to: u32) -> Result<(), NorFlashErrorKind> {
        Err(NorFlashErrorKind::Other)
    }

    fn write(&mut self, _offset: u32, _bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        Err(NorFlashErrorKind::Other)
    }
}

/// A valid frame of the compact format with an increment of 0.03 arcsec; its check sum bit by bit.
fn frame(number: u64) -> [u8; 14] {
    let mut frame = [0xA5, 0x5A, number as u8, 1, 0x30, 0x75, 0, 0, 0, 0, 0, 0, 0, 0];
    let mut crc = u32::MAX;
    for byte in &frame[..10] {
        crc ^= u32::from(*byte) << 24;
        for _ in 0..8 {
            crc = if crc >> 31 == 1 { crc << 1 ^ 0x04C1_1DB7 } else { crc << 1 };
        }
    }
    frame[10..].copy_from_slice(&crc.to_le_bytes());
    frame
}

/// A tick at which nothing is read, and the bytes that have come.
fn at_rest(tick: u64, intake: &Intake) -> Readings {
    let (turning, limit_open) = (false, false);
    Readings { tick, sensors: Due::Nothing, analogue: None, turning, limit_open, heard: intake.heard() }
}

/// A processor that stands still for 2.5 s, with a gyro that goes on: its frames of that time are lost, none of those that follow is
/// late or comes twice, and the seconds end when they should.
#[test]
fn a_thousand_ticks_that_nobody_saw_are_a_thousand_lost_frames() {
    let (work, workspace) = (Box::new(SecondWork::empty()), Box::new(Workspace::default()));
    let mut instrument = Instrument::power_up(&mut Erased, Identity::host(), work, workspace);
    let intake = Intake::new();
    let mut reports = Vec::new();
    for tick in (0..900).chain(1900..2441) {
        intake.gyro.put(&frame(tick));
        if tick == 2400 {
            intake.host.put(&encode_request(&Ask::Status.into()).unwrap());
        }
        let readings = at_rest(tick, &intake);
        let mut report = |report| reports.push(report);
        instrument.step(&readings, &intake, &mut Erased, &mut report);
        if let Some(mut work) = instrument.second_to_work_on() {
            work.run();
            instrument.worked_on(work);
        }
    }
    let seconds = reports.iter().filter_map(|report| match report.event {
        Event::Second(second) => Some((report.t_s, second.lost_frames)),
        _ => None,
    });
    // The second that began with frame 800 lacks 300, the next one all, the one after that again 300.
    let seconds: Vec<_> = seconds.collect();
    assert_eq!(seconds.iter().map(|(_, lost)| *lost).collect::<Vec<_>>(), [0, 0, 300, 400, 300, 0]);
    assert_eq!(seconds.last().unwrap().0, 2399.0 * SAMPLE_S);
    let counters = reports.iter().find_map(|report| match report.event {
        Event::Health(counters) => Some(counters),
        _ => None,
    });
    let Counters { frames_good, frames_lost, frames_duplicate, frames_late, ticks_lost, .. } = counters.unwrap();
    assert_eq!((frames_good, frames_lost, frames_duplicate, frames_late, ticks_lost), (1400, 1000, 0, 0, 1000));
}

/// What became of requests, one a tick, and the challenge that was given.
fn answers(
    instrument: &mut Instrument<Box<SecondWork>, Box<Workspace>>,
    from_tick: u64,
    asks: &[Ask],
) -> (Vec<Option<Refusal>>, Option<[u8; CHALLENGE]>) {
    let intake = Intake::new();
    let (mut refusals, mut challenge) = (Vec::new(), None);
    for (tick, ask) in (from_tick..).zip(asks) {
        intake.host.put(&encode_request(&(*ask).into()).unwrap());
        let readings = at_rest(tick, &intake);
        instrument.step(&readings, &intake, &mut Erased, &mut |report| match report.event {
            Event::Answer { refusal, .. } => refusals.push(refusal),
            Event::Challenge { bytes } => challenge = Some(bytes),
            _ => {}
        });
    }
    (refusals, challenge)
}

#[test]
fn a_key_locks_what_is_dangerous_until_its_holder_unlocks_it() {
    let secret = [3; 32];
    let (work, workspace) = (Box::new(SecondWork::empty()), Box::new(Workspace::default()));
    let mut instrument = Instrument::power_up(&mut Erased, Identity::host(), work, workspace);
    instrument.session.set_key(Some(PublicKey(public(&secret))));
    let asks =
        [Ask::SelfTest, Ask::Status, Ask::Command(Command::Abort), Ask::EraseImage { sector: 2 }, Ask::Challenge];
    let (refusals, challenge) = answers(&mut instrument, 0, &asks);
    assert_eq!(refusals, [Some(Refusal::Locked), None, None, Some(Refusal::Locked), None]);
    let signature = sign(&message([0; 3], &challenge.unwrap()), &secret);
    let asks = [Ask::Unlock(Bytes::start_of(&signature)), Ask::SelfTest, Ask::Lock, Ask::SelfTest];
    let (refusals, _) = answers(&mut instrument, 5, &asks);
    assert_eq!(refusals, [None, None, None, Some(Refusal::Locked)]);
}

/// What the dwells of a fix scattered, the next fix does not remember; one that is ended keeps it.
#[test]
fn every_fix_begins_its_scatter_anew() {
    let (work, workspace) = (Box::new(SecondWork::empty()), Box::new(Workspace::default()));
    let mut instrument = Instrument::power_up(&mut Erased, Identity::host(), work, workspace);
    let dwell = Dwell { position: 0, index_deg: 0.0, seconds: 4.0, rate_deg_h: 12.0, sigma_deg_h: 0.1 };
    instrument.scatter.hear(&Event::Dwell(dwell));
    instrument.command(Command::Abort, 1.0, &mut |_| ());
    assert!((instrument.scatter.rms_deg_h() - 0.2).abs() < 1e-12);
    instrument.command(Command::Start, 2.0, &mut |_| ());
    assert_eq!(instrument.scatter.rms_deg_h(), 0.0);
}

/// Slots whose flash takes a confirmation at the third try.
struct Reluctant {
    tries: Arc<AtomicU32>,
}

impl Slots for Reluctant {
    fn free_origin(&self) -> u32 {
        0
    }

    fn erase(&mut self, _sector: u32) -> Result<(), Refusal> {
        Err(Refusal::NotStored)
    }

    fn take(&mut self, _offset: u32, _bytes: &[u8]) -> Result<bool, Refusal> {
        Err(Refusal::NotStored)
    }

    fn confirm(&mut self) -> bool {
        self.tries.fetch_add(1, Ordering::Relaxed) + 1 >= 3
    }
}

/// After ten seconds, then every second until the flash has it, and never again.
#[test]
fn a_confirmation_is_tried_until_it_holds() {
    let (work, workspace) = (Box::new(SecondWork::empty()), Box::new(Workspace::default()));
    let mut instrument = Instrument::power_up(&mut Erased, Identity::host(), work, workspace);
    let tries = Arc::new(AtomicU32::new(0));
    let slots: &'static mut Reluctant = Box::leak(Box::new(Reluctant { tries: Arc::clone(&tries) }));
    instrument.updates_go_to(Some(slots));
    let intake = Intake::new();
    let mut tried = Vec::new();
    for tick in 0..6000 {
        let before = tries.load(Ordering::Relaxed);
        instrument.step(&at_rest(tick, &intake), &intake, &mut Erased, &mut |_| ());
        if tries.load(Ordering::Relaxed) > before {
            tried.push(tick);
        }
    }
    assert_eq!(tried, [4000, 4400, 4800]);
}
