//! The image that is flashed, executed: on QEMU's STM32F405, over its serial lines, against the run in this process.
//!
//! What the machine lacks is said in docs/board.md. Skipped with a line where it is absent.

mod chip;

use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

use chip::Chip;
use embedded_io::Read as _;
use embedded_storage::nor_flash::ReadNorFlash as _;
use hal_sim::{Scenario, World};
use north::engine::qemu::image;
use north::engine::to_store;
use north::settings_file::scenario_settings;
use north_finder::drivers::sensors::Due;
use north_finder::event::{Event, Report, State};
use north_finder::health::{Fault, Finding, Item, Refusal, TestVerdict};
use north_finder::instrument::Readings;
use north_finder::intake::{Heard, Intake};
use north_finder::link::{Ask, ReportDecoder, Request, encode_request};
use north_finder::restart::{Cause, Provocation};
use north_finder::sequence::Command;
use north_finder::settings::Settings;
use north_finder::settings::store;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use simulated::Stepper;

/// The image, built once.
fn image() -> &'static Path {
    static IMAGE: OnceLock<std::path::PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| image::build(image::Board::F405).unwrap())
}

/// What the sensors of a chip give whose SPI buses hold nothing: at their ticks, failures.
fn readings(tick: u64, heard: Heard) -> Readings {
    let sensors = match tick % 4 {
        0 => Due::Acceleration(None),
        2 => Due::Index(None),
        _ => Due::Nothing,
    };
    Readings { tick, sensors, turning: false, heard }
}

/// Chip and instrument with the same gyro and the same requests.
struct Both {
    world: World,
    gyro: hal_sim::GyroLine,
    chip: Chip,
    decoder: ReportDecoder,
    reports: Vec<Report>,
    instrument: Stepper,
    intake: Intake,
    expected: Vec<Report>,
    tick: u64,
    /// Reports of what the board says of itself.
    vitals: usize,
    board_items: Vec<Finding>,
}

impl Both {
    fn start(stored: Option<Settings>) -> Self {
        let world = World::new(&Scenario::named("calm-bench").unwrap(), 1);
        // The erased memory of a chip, and the record that the firmware would have written.
        let mut flash = world.flash();
        if let Some(settings) = &stored {
            store::save(&mut flash, settings).unwrap();
        }
        let mut record = vec![0; flash.capacity() / 2];
        flash.read(0, &mut record).unwrap();
        let instrument = Stepper::power_up(&mut flash);
        // The machine has no flash controller: nothing can be stored any more.
        flash.cut_power_after(0);
        let mut both = Self {
            gyro: world.gyro(),
            chip: Chip::start(image(), &record),
            decoder: ReportDecoder::new(),
            reports: Vec::new(),
            instrument,
            intake: Intake::new(),
            expected: Vec::new(),
            tick: 0,
            vitals: 0,
            board_items: Vec::new(),
            world,
        };
        // The chip's own timer has made tick 0.
        let sent = both.chip.sent();
        both.compare_tick(&sent, &[], &[]);
        both
    }

    /// What the chip sent in a tick, and what the instrument makes of the same.
    fn compare_tick(&mut self, sent: &[u8], from_gyro: &[u8], request: &[u8]) {
        let reports =
            sent.iter().filter_map(|&byte| self.decoder.feed(byte)).map(|report| report.expect("a good frame"));
        for report in reports {
            match report.event {
                // What the board says of itself has no counterpart here.
                Event::Vitals { .. } => self.vitals += 1,
                Event::SelfTest(finding) if finding.item.is_of_board() => self.board_items.push(finding),
                _ => self.reports.push(report),
            }
        }
        let expected = &mut self.expected;
        self.intake.gyro.put(from_gyro);
        self.intake.host.put(request);
        let (readings, mut flash) = (readings(self.tick, self.intake.heard()), self.world.flash());
        let mut report = |report: Report| {
            if !report.event.is_of_board() {
                expected.push(report);
            }
        };
        self.instrument.step(&readings, &self.intake, &mut flash, &mut report);
        self.tick += 1;
    }

    /// Ticks, with a request in the first of them.
    fn run(&mut self, ticks: u64, request: &Request) {
        let request = encode_request(request).unwrap();
        let mut request = &request[..];
        for _ in 0..ticks {
            self.world.advance_slot();
            self.world.sample();
            let mut bytes = [0; 64];
            let count = self.gyro.read(&mut bytes).unwrap();
            let now = core::mem::take(&mut request);
            let sent = self.chip.tick(&bytes[..count], now);
            self.compare_tick(&sent, &bytes[..count], now);
        }
    }

    /// All that was told so far, the same from both.
    fn compare(&self) -> Vec<Event> {
        assert_eq!(format!("{:#?}", self.reports), format!("{:#?}", self.expected));
        assert!(self.vitals > 0, "the board says nothing of itself");
        self.reports.iter().map(|report| report.event).collect()
    }
}

const START: Request = Request { number: 1, ask: Ask::Command(Command::Start) };

#[test]
fn without_settings_seconds_come_out_and_a_fix_is_refused() {
    if !chip::is_there() {
        return;
    }
    let mut both = Both::start(None);
    both.run(450, &START);
    let events = both.compare();
    assert_eq!(events.iter().filter(|event| matches!(event, Event::Second(_))).count(), 1);
    assert!(events.contains(&Event::Fault { fault: Fault::SettingsMissing, state: State::Idle }));
}

/// Of the chip itself: its memory is good, it was not restarted by a crash, and the crystal, which the machine has not, is said not to run.
/// Of the parts: the buses hold nothing, and the gyro is there.
#[test]
fn the_self_test_is_told_item_by_item() {
    if !chip::is_there() {
        return;
    }
    let mut both = Both::start(None);
    both.run(1220, &Request { number: 1, ask: Ask::Status });
    let verdicts = |findings: &[Finding]| findings.iter().map(|found| (found.item, found.verdict)).collect::<Vec<_>>();
    let (passed, failed) = (TestVerdict::Passed, TestVerdict::Failed);
    assert_eq!(verdicts(&both.board_items), [(Item::Memory, passed), (Item::Reset, passed), (Item::Clock, failed)]);
    let told = |event: &Event| if let Event::SelfTest(finding) = event { Some(*finding) } else { None };
    let told: Vec<Finding> = both.compare().iter().filter_map(told).collect();
    let expected = [
        (Item::Settings, failed),
        (Item::Gyro, passed),
        (Item::GyroRate, passed),
        (Item::Accelerometer, failed),
        (Item::Encoder, failed),
        (Item::Block, TestVerdict::Absent),
        (Item::Response, TestVerdict::NotAsked),
        (Item::Drive, TestVerdict::NotAsked),
    ];
    assert_eq!(verdicts(&told), expected);
}

/// The machine has no flash controller: nothing can be stored, and the instrument says so. Then the buses that hold nothing end
/// the fix.
#[test]
fn settings_from_flash_and_a_fix_that_fails() {
    if !chip::is_there() {
        return;
    }
    let settings = scenario_settings(&Scenario::named("calm-bench").unwrap(), None).unwrap();
    let mut both = Both::start(Some(settings.clone()));
    for request in to_store(&settings) {
        both.run(1, &request);
    }
    both.run(450, &START);
    let events = both.compare();
    assert!(
        events.iter().any(|event| matches!(event, Event::Answer { refusal: Some(Refusal::NotStored), .. }))
            && events.contains(&Event::State(State::Levelling))
    );
    assert!(events.iter().any(|event| matches!(event, Event::Fault { .. })), "{events:?}");
}

/// Each crash is kept over the chip's reset, and told when it starts anew; a task that hangs is found by the others.
#[test]
fn crashes_are_told_after_the_restart() {
    if !chip::is_there() {
        return;
    }
    let mut chip = Chip::start(image(), &[]);
    let causes = [
        (Provocation::Panic, Cause::Panic),
        (Provocation::HardFault, Cause::HardFault),
        (Provocation::StackOverflow, Cause::StackOverflow),
        (Provocation::Hang, Cause::LateTask),
        (Provocation::HangReport, Cause::LateTask),
    ];
    for (how, cause) in causes {
        chip.crash(&encode_request(&Ask::Provoke(how).into()).unwrap());
        let mut decoder = ReportDecoder::new();
        let sent = chip.sent();
        let told = sent.iter().filter_map(|&byte| decoder.feed(byte)).map(|report| report.expect("a good frame"));
        // The task that sends answers before it hangs.
        let told = told.skip_while(|report| matches!(report.event, Event::Answer { .. }));
        let told: Vec<Report> = told.collect();
        let [Report { t_s, event: Event::Crash(crash) }, ..] = told[..] else { panic!("{how:?}: {told:?}") };
        assert_eq!((crash.cause, t_s), (cause, 0.0), "{crash:?}");
        match cause {
            Cause::Panic => {
                assert_eq!((crash.file.as_str(), crash.message.as_str()), ("src/board/crash.rs", "provoked"))
            }
            Cause::LateTask => {
                assert_eq!(crash.message.as_str(), if how == Provocation::Hang { "solve" } else { "report" })
            }
            _ => assert!(crash.stack_pointer != 0, "{crash:?}"),
        }
        assert!(crash.program != 0);
    }
}

/// Calls by which the image can panic: most are the compiler's and the executor's, none has a known way there. A new one is a
/// defect; with one less, write it down. (They were 48 in an image that was a fifth larger: optimised for size, the compiler leaves
/// standing some checks of shapes, in nalgebra, that are known beforehand.)
const CALLS_TO_PANIC: usize = 52;

#[test]
fn the_image_has_no_new_way_to_panic() {
    let bytes = std::fs::read(image()).unwrap();
    let file = object::File::parse(bytes.as_slice()).unwrap();
    let panics: HashMap<u64, &str> = file
        .symbols()
        .filter_map(|symbol| Some((symbol.address() & !1, symbol.name().ok()?)))
        .filter(|(_, name)| name.contains("panicking") || name.ends_with("_failed") || name.ends_with("_fail"))
        // Every `async fn` has one for the case that it is polled after its end: what polls them forgets them then.
        .filter(|(_, name)| !name.contains("async_fn_resumed"))
        .collect();
    let text = file.section_by_name(".text").unwrap();
    let halves: Vec<u32> =
        text.data().unwrap().as_chunks().0.iter().map(|&half| u16::from_le_bytes(half).into()).collect();
    let calls = halves.windows(2).zip((text.address()..).step_by(2)).filter_map(|(pair, at)| {
        let target = branch_target(pair[0], pair[1], at)?;
        let own = panics.get(&target)?;
        let (caller, _) = file
            .symbols()
            .filter_map(|symbol| {
                let inside = (symbol.address() & !1..(symbol.address() & !1) + symbol.size()).contains(&at);
                inside.then_some((symbol.name().ok()?, ()))
            })
            .next()?;
        // What panics calls what panics.
        (!panics.values().any(|name| *name == caller)).then(|| format!("{caller} -> {own}"))
    });
    let calls: Vec<String> = calls.collect();
    assert!(calls.len() <= CALLS_TO_PANIC, "{} calls: {calls:#?}", calls.len());
}

/// Where a branch with link, or without, of two halves leads (ARMv7-M A7.7.18 T1 and A7.7.12 T4).
fn branch_target(first: u32, second: u32, at: u64) -> Option<u64> {
    if first & 0xF800 != 0xF000 || !matches!(second & 0xD000, 0xD000 | 0x9000) {
        return None;
    }
    let sign = first >> 10 & 1;
    let [high, low] = [second >> 13 & 1, second >> 11 & 1].map(|bit| !(bit ^ sign) & 1);
    let offset = sign << 24 | high << 23 | low << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    let offset = (offset << 7).cast_signed() >> 7;
    Some(at.wrapping_add_signed((offset + 4).into()))
}
