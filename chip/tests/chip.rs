//! The image on the emulated chip, against the instrument in this process: the same gyro, sensors, motor and requests, and every event the
//! same, bit for bit.

use std::env;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use hal_sim::{Scenario, World};
use north_chip::image::{self, Sectors};
use north_chip::{Line, Ran, Setup, run};
use north_finder::event::restart::{Cause, Crash, Provocation};
use north_finder::event::service::record::Logged;
use north_finder::event::{Event, Report, State};
use north_finder::health::{Counters, Fault, Finding, Item, Refusal, TestVerdict};
use north_finder::link::{Ask, ReportDecoder, Request};
use north_finder::sequence::Command;
use north_finder::sequence::order::Order;
use north_finder::settings::Settings;
use north_finder::settings::pieces::Outgoing;
use north_finder::settings::store::{self, Loaded};
use simulated::{RequestLine, Wired};

/// The image, built once; or the one that the environment names.
fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| env::var_os("NORTH_CHIP_IMAGE").map_or_else(|| image::build().unwrap(), PathBuf::from))
}

/// A request at the end of a tick.
type At = (u64, Ask);

/// A host that asks at certain ticks, for so many ticks.
struct Host {
    asks: Vec<At>,
    line: RequestLine,
    ticks: u64,
    decoder: ReportDecoder,
    reports: Vec<Report>,
    /// All that came.
    bytes: Vec<u8>,
}

impl Host {
    fn new(ticks: u64, asks: &[At]) -> Self {
        let (line, decoder) = (RequestLine::default(), ReportDecoder::new());
        Self { asks: asks.to_vec(), line, ticks, decoder, reports: Vec::new(), bytes: Vec::new() }
    }

    /// What it sends from this tick's end on.
    fn sends(&mut self, tick: u64) -> Vec<u8> {
        for (_, ask) in self.asks.iter().filter(|(at, _)| *at == tick) {
            self.line.send(&Request { number: 1, ask: *ask }).unwrap();
        }
        self.line.tick()
    }

    /// As they were told last: every ten seconds.
    fn counters(&self) -> Counters {
        let told = |report: &Report| if let Event::Health(counters) = &report.event { Some(*counters) } else { None };
        self.reports.iter().rev().find_map(told).expect("ten seconds")
    }

    fn crashes(&self) -> Vec<Crash> {
        let told = |report: &Report| if let Event::Crash(crash) = &report.event { Some(*crash) } else { None };
        self.reports.iter().filter_map(told).collect()
    }
}

impl Line for Host {
    fn tick(&mut self, tick: u64, sent: &[u8]) -> Option<Vec<u8>> {
        self.bytes.extend(sent);
        for &byte in sent {
            if let Some(report) = self.decoder.feed(byte) {
                self.reports.push(report.expect("a good frame"));
            }
        }
        (tick < self.ticks).then(|| self.sends(tick))
    }
}

/// Periods of the pulses that tell gyro and block to sample, ns.
const PULSES: [Option<u64>; 2] = [Some(2_500_000), Some(10_000_000)];

const START: Ask = Ask::Command(Command::Start);

fn calm() -> World {
    World::new(&Scenario::named("calm-bench").unwrap(), 1)
}

/// On a chip with something wrong about it. Nothing that the reference manual forbids is ever done.
fn on(setup: &Setup<'_>, world: &World, host: Host) -> Ran<Host> {
    let ran = run(setup, world, host).unwrap();
    assert!(ran.complaints.is_empty(), "{:#?}", ran.complaints);
    assert!(ran.violations.is_empty(), "{:#?}", ran.violations);
    ran
}

/// On the chip.
fn on_chip(world: &World, settings: &[u8], ticks: u64, asks: &[At]) -> Ran<Host> {
    on(&Setup { settings, ..Setup::new(image()) }, world, Host::new(ticks, asks))
}

/// The same in this process.
fn in_process(world: &World, ticks: u64, asks: &[At]) -> Vec<Report> {
    let mut wired = Wired::power_up(world);
    let mut host = Host::new(ticks, asks);
    let (mut reports, mut bytes) = (Vec::new(), Vec::new());
    for tick in 0..=ticks {
        wired.tick(&bytes, &mut |_, _| {}, &mut |report| reports.push(report));
        bytes = host.sends(tick);
    }
    reports
}

/// All that is not of the board itself.
fn of_instrument(reports: &[Report]) -> Vec<String> {
    reports.iter().filter(|report| !report.event.is_of_board()).map(|report| format!("{report:?}")).collect()
}

/// Runs a scenario with these settings on both; gives the chip's run, after the comparison.
fn both(scenario: &str, settings: Option<&Settings>, ticks: u64, asks: &[At]) -> Ran<Host> {
    both_of(&Scenario::named(scenario).unwrap(), settings, ticks, asks)
}

fn both_of(scenario: &Scenario, settings: Option<&Settings>, ticks: u64, asks: &[At]) -> Ran<Host> {
    let [own, other] = [(); 2].map(|()| World::new(scenario, 1));
    if let Some(settings) = settings {
        store::save(&mut other.flash(), settings).unwrap();
    }
    let stored = settings.map(|settings| image::stored(settings).unwrap()).unwrap_or_default();
    let ran = on_chip(&own, &stored, ticks, asks);
    let (chip, host) = (of_instrument(&ran.line.reports), of_instrument(&in_process(&other, ticks, asks)));
    for (chip, host) in chip.iter().zip(&host) {
        assert_eq!(chip, host);
    }
    // The last of them may still be on the line.
    let name = &scenario.name;
    assert!(!chip.is_empty() && chip.len() + 3 > host.len(), "{name}: {} of {} events", chip.len(), host.len());
    assert!(ran.resets.is_empty(), "{name}: {:?}", ran.resets);
    ran
}

fn settings_of(scenario: &str) -> Settings {
    simulated::settings(&Scenario::named(scenario).unwrap()).unwrap()
}

#[test]
fn a_fix_is_that_of_the_host_process() {
    let ran = both("calm-bench", Some(&settings_of("calm-bench")), 90_000, &[(40, START)]);
    let fix = |report: &Report| if let Event::Fix(fix) = &report.event { Some(fix.azimuth_deg) } else { None };
    let azimuths: Vec<f64> = ran.line.reports.iter().filter_map(fix).collect();
    assert_eq!(azimuths.len(), 1, "{:?}", ran.line.reports.last());
    assert_eq!(ran.pulse_periods_ns, PULSES);
    assert_eq!(ran.brown_out_level, 3);
    let vitals = ran.line.reports.iter().rev().find_map(|report| match report.event {
        Event::Vitals { stack_bytes, load_permille, .. } => Some((stack_bytes, load_permille)),
        _ => None,
    });
    // The limits of the board: half of a tick's time, where an instruction takes a cycle, and all but 8 KiB of its 56 KiB of stack.
    // An overflow is a fault.
    let (stack_bytes, load_permille) = vitals.expect("the state of the board");
    assert!(
        (1..=49_152).contains(&stack_bytes) && (1..=500).contains(&load_permille),
        "{stack_bytes}, {load_permille}"
    );
}

#[test]
#[ignore = "long runs of the chip: make proofs"]
fn sensors_and_gyros_of_other_kinds_are_heard_as_in_the_host_process() {
    for scenario in ["kvh-gyro", "kvh-by-command", "broken-bus", "carried"] {
        both(scenario, Some(&settings_of(scenario)), 1300, &[(40, START)]);
    }
}

/// Sentences stand between the frames of the link, which are all good; their check sums are right.
#[test]
fn sentences_go_between_the_frames() {
    let mut settings = settings_of("calm-bench");
    settings.link.nmea = true;
    let settings = image::stored(&settings).unwrap();
    let ran = on_chip(&calm(), &settings, 1300, &[]);
    let seconds = ran.line.reports.iter().filter(|report| matches!(report.event, Event::Second(_))).count();
    let text = String::from_utf8_lossy(&ran.line.bytes);
    let sentences: Vec<&str> =
        text.split('$').skip(1).filter_map(|rest| rest.split_once("\r\n").map(|(line, _)| line)).collect();
    // THS without a heading: its check sum by hand is that of the link's own test.
    let told = sentences.iter().filter(|line| **line == "HETHS,,V*14").count();
    assert!(seconds >= 3 && told.abs_diff(seconds) <= 1, "{told} of {seconds}: {sentences:?}");
}

/// The loader starts the image of the first slot, as a probe brought it: it runs from there, and knows that the other slot is free.
#[test]
#[ignore = "two more images: make proofs"]
fn the_loader_starts_the_image_of_a_slot() {
    let [loader, slot] = image::build_slot().unwrap();
    let ran =
        on(&Setup { loader: Some(&loader), ..Setup::new(&slot) }, &calm(), Host::new(900, &[(400, Ask::Identify)]));
    let identity = ran.line.reports.iter().find_map(|report| match &report.event {
        Event::Identity(identity) => Some(*identity),
        _ => None,
    });
    assert_eq!(identity.map(|identity| identity.free_slot), Some(0x0808_0000));
    assert!(ran.resets.is_empty() && ran.line.reports.iter().any(|report| matches!(report.event, Event::Second(_))));
}

/// Item by item, the accelerometer's own test and a short move of the index among them.
#[test]
fn the_self_test_passes() {
    let ran = both("calm-bench", Some(&settings_of("calm-bench")), 4500, &[(1300, Ask::SelfTest)]);
    let told = |report: &Report| if let Event::SelfTest(finding) = &report.event { Some(*finding) } else { None };
    let mut told: Vec<Finding> = ran.line.reports.iter().filter_map(told).collect();
    let first =
        told.drain(..told.len() / 2).filter(|found| found.verdict != TestVerdict::Passed).map(|found| found.item);
    assert_eq!(first.collect::<Vec<_>>(), [Item::Block, Item::Response, Item::Drive, Item::Limit]);
    let second = told.iter().filter(|found| found.verdict != TestVerdict::Passed).map(|found| found.item);
    assert_eq!(second.collect::<Vec<_>>(), [Item::Block, Item::Limit], "{told:?}");
}

/// Seven seconds in which all that is wired is used: nothing is done that a data sheet does not allow, nothing that the reference manual
/// forbids, and every event is that of the host process.
#[test]
fn the_wires_are_as_the_parts_want_them() {
    let mut settings = settings_of("carried");
    settings.level.seconds = 1;
    settings.sequence.order = Order::Adaptive { accuracy_deg: 0.5 };
    let ran = both("carried", Some(&settings), 2800, &[(40, START)]);
    assert_eq!((ran.pulse_periods_ns, ran.brown_out_level), (PULSES, 3));
    assert!(ran.watchdog_frozen_in_debug && ran.steps > 100, "{} steps", ran.steps);
    // The supply of 12 V behind its divider, and the chip 10 K above the air's 20 °C: to a code of the converter, 9 mV and 0.4 K with the emulator's steps.
    let last = ran.line.reports.iter().rev().find_map(|report| match &report.event {
        Event::Second(second) => Some(second.auxiliary),
        _ => None,
    });
    let [.., supply_v, chip_c] = last.expect("a second");
    let near = |read: Option<f32>, expected: f32, within: f32| (read.expect("a reading") - expected).abs() < within;
    assert!(near(supply_v, 12.0, 0.02) && near(chip_c, 30.0, 0.8), "{supply_v:?} {chip_c:?}");
}

/// The block's burst takes 0.42 ms of its bus, longer than an eighth of a tick: no step of the motor waits for it.
#[test]
fn no_step_waits_for_a_sensor() {
    let mut settings = settings_of("carried");
    settings.level.seconds = 1;
    // For half a degree three seconds are enough where it stands: it turns early.
    settings.sequence.order = Order::Adaptive { accuracy_deg: 0.5 };
    let ran = both("carried", Some(&settings), 5000, &[(40, START)]);
    let [first, last] = ran.step_window_ns;
    assert!(ran.steps > 100, "{}", ran.steps);
    assert!(last - first < 10_000, "steps begin between {first} and {last} ns of an eighth");
}

/// After the fix the block holds the heading by its increments, whose lower words come first: every heading is that of the host process.
#[test]
#[ignore = "long runs of the chip: make proofs"]
fn the_block_holds_the_heading() {
    let mut settings = settings_of("carried");
    settings.level.seconds = 1;
    settings.sequence.order = Order::Adaptive { accuracy_deg: 2.0 };
    let ran = both("carried", Some(&settings), 16_800, &[(40, START)]);
    let held = ran.line.reports.iter().filter(|report| matches!(report.event, Event::Heading(_))).count();
    assert!(held >= 2, "{held}: {:?}", ran.line.reports.last());
}

/// A limit switch that opens in the first turn: the motor makes no step more, and there is no azimuth.
#[test]
fn an_open_limit_switch_stops_the_motor() {
    let mut settings = settings_of("calm-bench");
    settings.level.seconds = 1;
    // For half a degree three seconds are enough where it stands: it turns by 90°, early.
    settings.sequence.order = Order::Adaptive { accuracy_deg: 0.5 };
    settings.index.limit_switch = true;
    let mut scenario = Scenario::named("calm-bench").unwrap();
    scenario.motor.limit_deg = Some(30.0);
    let ran = both_of(&scenario, Some(&settings), 3200, &[(40, START)]);
    let fault = Event::Fault { fault: Fault::IndexLimit, state: State::Indexing };
    assert!(ran.line.reports.iter().any(|report| report.event == fault));
    // 30° are 3000 steps; 7 more are less than what a tick takes at the greatest speed, 8.
    assert!((2990..=3010).contains(&ran.steps), "{} steps", ran.steps);
}

/// The work of a tick takes ten ticks: no event differs.
#[test]
fn a_solution_that_lags_shifts_nothing() {
    both(
        "calm-bench",
        Some(&settings_of("calm-bench")),
        2000,
        &[(40, START), (900, Ask::Provoke(Provocation::Lag { ticks: 10 }))],
    );
}

/// What the receiver finds wrong is counted by its kind, and costs no more than its frames.
#[test]
fn damaged_bytes_are_counted_by_their_kind() {
    let setup = Setup { damaged_per_million: 1000, ..Setup::new(image()) };
    let ran = on(&setup, &calm(), Host::new(4500, &[]));
    let told = ran.line.counters();
    // Of some 56,000 bytes one in a thousand, of each kind: 56, and six times their standard deviation.
    let kinds = [told.gyro_noise_errors, told.gyro_framing_errors];
    assert!(kinds.iter().all(|count| (11..=101).contains(count)), "{kinds:?}");
    assert_eq!(told.gyro_overruns, 0);
    let bad = u64::from(told.frames_bad_crc) + u64::from(told.frames_lost);
    assert!(bad > 0 && bad <= 2 * u64::from(kinds[0] + kinds[1]), "{told:?}");
}

/// A timer that goes on and is not heard for 29 ticks: their number comes from the processor's cycle counter. The gyro's frames wait in the
/// ring and none is lost; late are those that waited for more than six ticks, 23.
#[test]
fn ticks_that_nobody_saw_are_counted_and_their_frames_kept() {
    let ran = on(&Setup { unseen_ticks: 1001..1030, ..Setup::new(image()) }, &calm(), Host::new(4500, &[]));
    let told = ran.line.counters();
    assert_eq!((told.ticks_lost, told.frames_lost, told.frames_late, told.bytes_refused), (29, 0, 23, 0), "{told:?}");
    assert_eq!((told.seconds_repaired, told.seconds_left_out), (0, 0), "{told:?}");
}

#[test]
fn without_settings_seconds_come_out_and_a_fix_is_refused() {
    let ran = both("calm-bench", None, 500, &[(40, START)]);
    let is = |wanted: fn(&Event) -> bool| ran.line.reports.iter().any(|report| wanted(&report.event));
    assert!(is(|event| matches!(event, Event::Second(_))));
    assert!(is(|event| *event == Event::Fault { fault: Fault::SettingsMissing, state: State::Idle }));
}

/// Each crash is kept over the chip's reset, and told when it starts anew; a task that hangs is found by the others.
#[test]
fn crashes_are_told_after_the_restart() {
    let causes = [
        (Provocation::Panic, Cause::Panic),
        (Provocation::HardFault, Cause::HardFault),
        (Provocation::StackOverflow, Cause::StackOverflow),
        (Provocation::Hang, Cause::LateTask),
        (Provocation::HangReport, Cause::LateTask),
    ];
    for (how, cause) in causes {
        // What is not there is touched on purpose: nothing is said of that here.
        let ran = run(&Setup::new(image()), &calm(), Host::new(1000, &[(40, Ask::Provoke(how))])).unwrap();
        let crashes = ran.line.crashes();
        let [crash] = &crashes[..] else { panic!("{how:?}: {crashes:?}") };
        assert_eq!((crash.cause, ran.resets.len()), (cause, 1), "{crash:?}");
        match cause {
            Cause::Panic => {
                assert_eq!((crash.file.as_str(), crash.message.as_str()), ("src/board/crash.rs", "provoked"));
            }
            Cause::LateTask => {
                assert_eq!(crash.message.as_str(), if how == Provocation::Hang { "solve" } else { "report" });
            }
            _ => assert!(crash.stack_pointer != 0, "{crash:?}"),
        }
        assert!(crash.program != 0);
    }
}

/// Before a start the motor has no current, in the middle of a turn it has some, and after the crash none, before the restart takes it off.
#[test]
fn a_crash_in_a_turn_leaves_the_motor_without_current() {
    let mut settings = settings_of("calm-bench");
    // For half a degree three seconds are enough where it stands: it turns from 6 s on.
    settings.sequence.order = Order::Adaptive { accuracy_deg: 0.5 };
    let settings = image::stored(&settings).unwrap();
    let has_current = |ticks: u64, asks: &[At]| {
        let world = calm();
        let ran = on_chip(&world, &settings, ticks, asks);
        assert!(!ran.current_at_reset);
        world.motor_has_current()
    };
    let (start, crash) = ((40, START), (2600, Ask::Provoke(Provocation::Panic)));
    let idle = has_current(600, &[]);
    assert_eq!([idle, has_current(2600, &[start]), has_current(2700, &[start, crash])], [false, true, false]);
}

/// An interrupt that comes no more: nobody feeds the independent watchdog, which counts on a clock of its own.
#[test]
fn a_timer_that_stops_ends_in_the_watchdogs_restart() {
    let setup = Setup { timer_stops: Some(400), ..Setup::new(image()) };
    let ran = on(&setup, &calm(), Host::new(3000, &[]));
    let crashes = ran.line.crashes();
    assert_eq!(crashes.iter().map(|crash| crash.cause).collect::<Vec<_>>(), [Cause::Watchdog], "{:?}", ran.resets);
}

/// What the self-test finds of the board itself.
fn verdict(setup: &Setup<'_>, item: Item) -> (TestVerdict, Ran<Host>) {
    let ran = on(setup, &calm(), Host::new(1400, &[]));
    let found = ran.line.reports.iter().find_map(|report| match &report.event {
        Event::SelfTest(finding) if finding.item == item => Some(finding.verdict),
        _ => None,
    });
    (found.expect("an item of the self-test"), ran)
}

/// With the crystals that boards have it runs from them; with none that starts, or one of another frequency, from its own oscillator, and
/// its first reports say so: all within a second.
#[test]
#[ignore = "long runs of the chip: make proofs"]
fn the_crystal_is_measured_before_it_is_used() {
    for (crystal_mhz, known) in [(8, true), (12, true), (16, true), (25, true), (0, false), (20, false)] {
        let (verdict, ran) = verdict(&Setup { crystal_mhz, ..Setup::new(image()) }, Item::Clock);
        let seconds = ran.line.reports.iter().filter(|report| matches!(report.event, Event::Second(_))).count();
        assert_eq!((seconds, ran.pulse_periods_ns), (3, PULSES), "{crystal_mhz} MHz");
        assert_eq!(verdict == TestVerdict::Passed, known, "{crystal_mhz} MHz");
        let told_s = ran.line.reports.iter().find_map(|report| match &report.event {
            Event::SelfTest(Finding { item: Item::Clock, .. }) => Some(report.t_s),
            _ => None,
        });
        let started_s = ran.start_ns as f64 * 1e-9;
        assert!(
            started_s < 0.9 && (known || told_s.is_some_and(|told_s| started_s + told_s < 1.0)),
            "{crystal_mhz} MHz"
        );
        assert!(ran.watchdog_frozen_in_debug);
    }
}

/// A bit that is always 0, of a word that nothing uses: below what the stack reaches.
#[test]
fn bad_memory_is_told() {
    let memory = |bad_word| verdict(&Setup { bad_word, ..Setup::new(image()) }, Item::Memory).0;
    assert_eq!([memory(None), memory(Some(0x2000_0400))], [TestVerdict::Passed, TestVerdict::Failed]);
}

/// Settings in pieces, from tick 40 on.
fn storing(settings: &Settings) -> Vec<At> {
    (40..).step_by(8).zip(Outgoing::new(settings).unwrap().map(Ask::WriteSettings)).collect()
}

/// What these sectors say that the settings are.
fn loaded(sectors: &[u8]) -> Option<Settings> {
    match store::load(&mut Sectors(sectors.to_vec())) {
        Ok(Loaded::Valid(settings)) => Some(settings),
        _ => None,
    }
}

/// What the controller's registers make of it is what was to be stored: it is read back, and loaded at the next start.
#[test]
fn settings_are_stored() {
    let settings = settings_of("calm-bench");
    let asks = storing(&settings);
    let ran = on_chip(&calm(), &[], 600, &asks);
    let answers = ran.line.reports.iter().filter_map(|report| match &report.event {
        Event::Answer { refusal, .. } => Some(*refusal),
        _ => None,
    });
    let answers: Vec<Option<Refusal>> = answers.collect();
    assert_eq!((answers.len(), answers.last()), (asks.len(), Some(&None)));
    assert_eq!(loaded(&ran.settings), Some(settings));
}

/// Power fails at any byte of storing other settings: afterwards the chip has the ones or the others.
#[test]
fn power_that_fails_while_settings_are_stored_loses_none() {
    let before = settings_of("calm-bench");
    let after = Settings { time_limit_s: before.time_limit_s + 100.0, ..before.clone() };
    let stored = image::stored(&before).unwrap();
    let asks = storing(&after);
    let mut seen = [0; 2];
    for bytes in (0..).step_by(29) {
        let setup = Setup { settings: &stored, power_fails_after: Some(bytes), ..Setup::new(image()) };
        let ran = on(&setup, &calm(), Host::new(600, &asks));
        let found = loaded(&ran.settings);
        assert!(found.as_ref() == Some(&before) || found.as_ref() == Some(&after), "after {bytes} bytes: {found:?}");
        seen[usize::from(found.as_ref() == Some(&after))] += 1;
        if seen[1] > 0 {
            break;
        }
    }
    assert!(seen[0] > 5, "{seen:?}");
}

/// The sectors where the one in use has no room left, and after the other one was erased: the first one, then the second.
fn full() -> [[Vec<u8>; 2]; 2] {
    let mut sectors = Sectors::default();
    let mut next = || loop {
        store::save(&mut sectors, &settings_of("calm-bench")).unwrap();
        let before = sectors.clone();
        store::prepare(&mut sectors).unwrap();
        if before != sectors {
            return [before.0, sectors.0.clone()];
        }
    };
    [next(), next()]
}

/// Where the sector in use is full the other one is erased, before the first tick, and the watchdog fed around that; power that fails meanwhile costs nothing.
#[test]
fn a_full_sector_is_followed_by_an_erased_one() {
    let settings = Some(settings_of("calm-bench"));
    for [before, after] in full() {
        let ran = on_chip(&calm(), &before, 20, &[]);
        assert!(ran.settings == after && loaded(&ran.settings) == settings);
        let cut = Setup { settings: &before, power_fails_after: Some(10), ..Setup::new(image()) };
        let ran = on(&cut, &calm(), Host::new(20, &[]));
        assert!(ran.settings != after && loaded(&ran.settings) == settings);
    }
}

/// A full log is read, and its fixes watched, before the first tick: that takes longer than the watchdog waits, which is fed meanwhile. 6,100 fixes fill
/// both sectors of 32 bytes a place; their bias, amplitude and misfit scatter, so that no change is seen.
#[test]
fn a_full_log_is_read_at_the_start() {
    let scatter = |number: u32, root: f32| (f64::from(number) * f64::from(root.sqrt())).fract() as f32 - 0.5;
    let fix = |number: u32| Logged {
        azimuth_deg: 40.0,
        sigma_deg: 0.04,
        chi_square: 7.0 + 6.0 * scatter(number, 2.0),
        degrees_of_freedom: 7,
        bias_deg_h: 0.3 + 0.02 * scatter(number, 3.0),
        amplitude_deg_h: 12.3 + 0.01 * scatter(number, 5.0),
        ..Logged::default()
    };
    let log = image::logged((1..6100).map(fix), 1).unwrap();
    let settings = image::stored(&Settings { model: None, ..settings_of("calm-bench") }).unwrap();
    let setup = Setup { settings: &settings, log: [&log[0], &log[1]], ..Setup::new(image()) };
    let ran = on(&setup, &calm(), Host::new(400, &[]));
    assert!(
        ran.resets.is_empty() && (1..12).contains(&(ran.start_ns / 1_000_000_000)),
        "{:?} {}",
        ran.resets,
        ran.start_ns
    );
}

/// A part that is not there, or that comes two seconds late, costs its own readings and nothing else; it is heard as soon as it is there.
#[test]
fn parts_that_are_absent_or_late_are_waited_for() {
    let readings = |parts_from_ns: [u64; 3]| {
        let settings = image::stored(&settings_of("carried")).unwrap();
        let setup = Setup { settings: &settings, parts_from_ns, ..Setup::new(image()) };
        let world = World::new(&Scenario::named("carried").unwrap(), 1);
        let ran = on(&setup, &world, Host::new(2300, &[]));
        assert!(ran.resets.is_empty());
        // The last of five seconds.
        let last = ran.line.reports.iter().rev().find_map(|report| match &report.event {
            Event::Second(second) => {
                Some([second.level.is_some(), second.index_deg.is_some(), second.block_temp_c.is_some()])
            }
            _ => None,
        });
        last.expect("a second")
    };
    const NEVER: u64 = u64::MAX;
    const LATE: u64 = 2_000_000_000;
    assert_eq!(readings([0; 3]), [true; 3]);
    assert_eq!(readings([LATE; 3]), [true; 3]);
    assert_eq!(readings([NEVER, 0, 0]), [false, true, true]);
    assert_eq!(readings([0, NEVER, 0]), [true, false, true]);
    assert_eq!(readings([0, 0, NEVER]), [true, true, false]);
}

/// An accelerometer that measures no more has its last measurement still: it is not taken for another one.
#[test]
fn a_measurement_is_taken_once() {
    let settings = image::stored(&settings_of("calm-bench")).unwrap();
    let levels = |accelerometer_stops_ns: u64| {
        let setup = Setup { settings: &settings, accelerometer_stops_ns, ..Setup::new(image()) };
        let ran = on(&setup, &calm(), Host::new(1300, &[]));
        let levels = ran.line.reports.iter().filter_map(|report| match &report.event {
            Event::Second(second) => Some(second.level.is_some()),
            _ => None,
        });
        levels.collect::<Vec<_>>()
    };
    assert_eq!(levels(u64::MAX).last(), Some(&true));
    assert_eq!(levels(1_200_000_000).last(), Some(&false));
}

/// An error flag of the block stays until it is read: it costs a few samples, and no more.
#[test]
fn an_error_flag_of_the_block_costs_a_few_samples() {
    let settings = image::stored(&settings_of("carried")).unwrap();
    let setup = Setup { settings: &settings, block_flag: Some((2_000_000_000, 1 << 3)), ..Setup::new(image()) };
    let world = World::new(&Scenario::named("carried").unwrap(), 1);
    let ran = on(&setup, &world, Host::new(2300, &[]));
    let found = ran.line.reports.iter().find_map(|report| match &report.event {
        Event::SelfTest(finding) if finding.item == Item::Block => Some(*finding),
        _ => None,
    });
    let found = found.expect("an item of the self-test");
    assert_eq!(found.verdict, TestVerdict::Passed, "{found:?}");
    assert!(found.measured < 100.0, "the flag was raised within the test: {found:?}");
    let last = ran.line.reports.iter().rev().find_map(|report| match &report.event {
        Event::Second(second) => Some(second.block_temp_c),
        _ => None,
    });
    assert!(last.flatten().is_some());
}

/// The encoder says that its magnet is weak: its angle is valid nevertheless.
#[test]
fn a_weak_magnet_leaves_the_angle_valid() {
    let weak_magnet = Setup { weak_magnet: true, ..Setup::new(image()) };
    assert_eq!(verdict(&weak_magnet, Item::Encoder).0, TestVerdict::Passed);
}
