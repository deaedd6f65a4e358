//! The instrument's test of itself: faults that are put into the simulated parts, each of which must fail its item and no other.

use std::sync::atomic::AtomicBool;

use embedded_storage::nor_flash::NorFlash;
use hal_sim::scenario::{Block, GyroFault, GyroFaultKind, SensorFault, SensorFaultKind};
use hal_sim::{Scenario, World};
use north::engine::{Person, Setup, host, world};
use north_finder::event::{Event, Report, State};
use north_finder::health::{Fault, Finding, Flag, Item, Refusal, TestVerdict};
use north_finder::link::{Ask, Request};
use north_finder::sequence::Command;
use north_finder::settings::Settings;

use crate::common::setup;
use TestVerdict::{Absent, Failed, Interrupted, NotAsked, Unmet};

/// When the test is asked for, and when its move begins: after three seconds of counting and half a second of the accelerometer's own test.
const ASKED_S: f64 = 4.0;
const MOVE_S: f64 = ASKED_S + 3.52;

/// Sends requests at their times, and hears everything.
pub struct Asker {
    requests: Vec<(u64, Ask)>,
    pub reports: Vec<Report>,
}

impl Asker {
    /// Times in s, in their order.
    pub fn new(requests: &[(f64, Ask)]) -> Self {
        let requests = requests.iter().map(|&(t_s, ask)| ((400.0 * t_s) as u64, ask)).collect();
        Self { requests, reports: Vec::new() }
    }

    /// The items that were told from a time on.
    fn items(&self, from_s: f64) -> Vec<Finding> {
        let told = |report: &Report| match report.event {
            Event::SelfTest(finding) if report.t_s >= from_s => Some(finding),
            _ => None,
        };
        self.reports.iter().filter_map(told).collect()
    }
}

impl Person for Asker {
    fn request(&mut self, tick: u64) -> Option<Request> {
        let due = self.requests.first().filter(|(at, _)| *at == tick)?.1;
        self.requests.remove(0);
        Some(due.into())
    }

    fn hear(&mut self, report: &Report) -> bool {
        self.reports.push(*report);
        false
    }
}

fn run(world: &World, requests: &[(f64, Ask)], seconds: f64) -> Asker {
    let mut asker = Asker::new(requests);
    host::serve(world, (400.0 * seconds) as u64, &mut asker, &AtomicBool::new(false), &mut |_, _| ()).unwrap();
    asker
}

/// A calm bench with a block of three gyros.
fn good() -> Setup {
    let mut setup = setup("calm-bench", 1);
    setup.scenario.block = Some(Block::default());
    setup.settings.as_mut().unwrap().block = Some(Default::default());
    setup
}

/// What is told without being asked, and then on request: all items, each once and in their order.
fn both_tests(world: &World) -> [Vec<Finding>; 2] {
    let asker = run(world, &[(ASKED_S, Ask::SelfTest)], 12.0);
    let asked = asker.items(ASKED_S);
    let unasked = asker.items(0.0)[..Item::ALL.len()].to_vec();
    for told in [&asked, &unasked] {
        assert_eq!(told.iter().map(|found| found.item).collect::<Vec<_>>(), Item::ALL);
    }
    [unasked, asked]
}

/// The items that neither passed nor are of a board, which the process has not, nor of a limit switch that the settings do not know of.
fn not_passed(told: &[Finding]) -> Vec<(Item, TestVerdict)> {
    let no_switch = |found: &Finding| (found.item, found.verdict) == (Item::Limit, Absent);
    let other = told.iter().filter(|found| !found.passed() && !found.item.is_of_board() && !no_switch(found));
    other.map(|found| (found.item, found.verdict)).collect()
}

/// What is not asked for at the start.
const AT_START: [(Item, TestVerdict); 2] = [(Item::Response, NotAsked), (Item::Drive, NotAsked)];

/// The items that fail or cannot be tested, at the start and on request.
fn check(world: &World, at_start: &[(Item, TestVerdict)], asked: &[(Item, TestVerdict)]) -> [Vec<Finding>; 2] {
    let told = both_tests(world);
    assert_eq!(not_passed(&told[0]), [at_start, &AT_START].concat());
    assert_eq!(not_passed(&told[1]), asked);
    told
}

fn of(change: impl FnOnce(&mut Scenario)) -> World {
    let mut setup = good();
    change(&mut setup.scenario);
    world(&setup).unwrap()
}

fn measured(told: &[Finding], item: Item) -> f32 {
    told.iter().find(|found| found.item == item).unwrap().measured
}

fn fault(kind: SensorFaultKind) -> Vec<SensorFault> {
    vec![SensorFault { kind, ..SensorFault::default() }]
}

#[test]
fn a_good_instrument_passes() {
    let [unasked, asked] = check(&of(|_| {}), &[], &[]);
    for told in [&unasked, &asked] {
        assert_eq!(measured(told, Item::GyroRate), 400.0);
        assert_eq!(measured(told, Item::Gyro), 100.0);
        assert!(told.iter().filter(|found| found.item.is_of_board()).all(|found| found.verdict == Absent));
    }
    // The simulated force is 1.5 g on z, read with a noise of some 0.1 mg; the encoder's steps are 0.022°.
    assert!((measured(&asked, Item::Response) - 1.5).abs() < 0.01);
    assert!(measured(&asked, Item::Drive) < 0.1);
}

#[test]
fn a_silent_gyro() {
    let silent = of(|scenario| {
        scenario.gyro.faults = vec![GyroFault { kind: GyroFaultKind::Silent, ..GyroFault::default() }];
    });
    let asker = run(&silent, &[(ASKED_S, Ask::SelfTest)], 12.0);
    assert_eq!(not_passed(&asker.items(0.0)), [(Item::Gyro, Failed), (Item::GyroRate, Unmet)]);
    // Without being asked a gyro is given half a minute to wake.
    let told = run(&silent, &[], 31.0).items(29.9);
    assert_eq!(not_passed(&told), [&[(Item::Gyro, Failed), (Item::GyroRate, Unmet)][..], &AT_START].concat());
}

/// 962 frames where there should be 1000, every status bit good: 1200 · 0.962 in three seconds.
#[test]
fn a_gyro_with_a_slow_clock() {
    let rate = [(Item::GyroRate, Failed)];
    let told = check(&of(|scenario| scenario.gyro.frames_per_tick = 0.962), &rate, &rate);
    assert!((measured(&told[0], Item::GyroRate) - 384.8).abs() < 0.4, "{:?}", told[0]);
}

#[test]
fn an_accelerometer_that_is_stuck() {
    let stuck = of(|scenario| scenario.accelerometer.faults = fault(SensorFaultKind::Stuck));
    check(&stuck, &[(Item::Accelerometer, Failed)], &[(Item::Accelerometer, Failed), (Item::Response, Unmet)]);
}

#[test]
fn an_accelerometer_that_does_not_respond_to_its_test_force() {
    for (self_test_g, seen) in [([0.0; 3], 0.0), ([0.3, 0.3, 0.2], 0.2), ([0.3, 0.7, 1.5], 0.7)] {
        let told =
            check(&of(|scenario| scenario.accelerometer.self_test_g = self_test_g), &[], &[(Item::Response, Failed)]);
        assert!((measured(&told[1], Item::Response) - seen).abs() < 0.01, "{:?}", told[1]);
    }
}

#[test]
fn an_encoder_that_does_not_answer() {
    let silent = of(|scenario| scenario.encoder.faults = fault(SensorFaultKind::BusHigh));
    check(&silent, &[(Item::Encoder, Failed)], &[(Item::Encoder, Failed), (Item::Drive, Unmet)]);
}

#[test]
fn a_block_that_does_not_answer() {
    let block = [(Item::Block, Failed)];
    let silent = of(|scenario| {
        scenario.block = Some(Block { faults: fault(SensorFaultKind::BusLow), ..Block::default() });
    });
    check(&silent, &block, &block);
}

/// A motor without its cable, an encoder whose magnet slips on the shaft by 2° while it turns, one that always says the same.
#[test]
fn a_drive_that_the_encoder_does_not_follow() {
    let slips = |scenario: &mut Scenario| {
        (scenario.encoder.slip_deg, scenario.encoder.slip_at_s) = (2.0, MOVE_S + 0.3);
    };
    let off = |scenario: &mut Scenario| scenario.motor.stall_from_s = Some(0.0);
    let stuck = |scenario: &mut Scenario| scenario.encoder.faults = fault(SensorFaultKind::Stuck);
    for (world, off_deg) in [(of(slips), 2.0), (of(off), 5.0), (of(stuck), 5.0)] {
        let told = check(&world, &[], &[(Item::Drive, Failed)]);
        assert!((measured(&told[1], Item::Drive) - off_deg).abs() < 0.2, "{:?}", told[1]);
        assert!(!world.motor_has_current());
    }
}

/// Within the travel it is closed; where it is open the motor does not turn.
#[test]
fn a_limit_switch_that_is_open() {
    let told = |limit_deg: f64| {
        let mut setup = good();
        setup.settings.as_mut().unwrap().index.limit_switch = true;
        setup.scenario.motor.limit_deg = Some(limit_deg);
        let [unasked, asked] = both_tests(&world(&setup).unwrap());
        assert_eq!(unasked.last().map(|found| found.item), Some(Item::Limit));
        assert_eq!(unasked.last(), asked.last());
        let passed = |item| asked.iter().any(|found| found.item == item && found.passed());
        [passed(Item::Drive), passed(Item::Limit)]
    };
    assert_eq!([told(200.0), told(-1.0)], [[true; 2], [false; 2]]);
}

#[test]
fn settings_that_are_missing_corrupt_or_invalid() {
    let missing = World::new(&good().scenario, 1);
    let corrupt = World::new(&good().scenario, 1);
    corrupt.flash().write(0, &[0; 64]).unwrap();
    let invalid = Settings { latitude_deg: 89.5, ..good().settings.unwrap() };
    let invalid = world(&Setup { settings: Some(invalid), ..good() }).unwrap();
    for (world, fault, block) in [
        (missing, Fault::SettingsMissing, Some((Item::Block, Absent))),
        (corrupt, Fault::SettingsCorrupt, Some((Item::Block, Absent))),
        (invalid, Fault::NearPole, None),
    ] {
        // Without settings nobody knows of a block.
        let at_start: Vec<_> = [(Item::Settings, Failed)].into_iter().chain(block).collect();
        let asked = [&at_start[..], &[(Item::Drive, Unmet)]].concat();
        let told = check(&world, &at_start, &asked);
        assert_eq!(measured(&told[0], Item::Settings), f32::from(fault.code()));
    }
}

/// The move is no slip of the index, and the reading in another range no tilt: the fix after it has no doubts.
#[test]
fn a_fix_after_the_test_is_as_good() {
    let requests = [(ASKED_S, Ask::SelfTest), (10.0, Ask::Command(Command::Start))];
    let asker = run(&world(&good()).unwrap(), &requests, 400.0);
    let fix = asker.reports.iter().find_map(|report| if let Event::Fix(fix) = report.event { Some(fix) } else { None });
    assert!(!fix.expect("a fix").flags.contains(Flag::IndexSlip), "{fix:?}");
    let begun = asker.reports.iter().find(|report| report.event == Event::State(State::Levelling)).unwrap().t_s;
    let slipped = |report: &&Report| matches!(report.event, Event::IndexSlipped { .. });
    assert_eq!((asker.reports.iter().find(slipped), begun >= 10.0), (None, true));
}

#[test]
fn it_is_refused_in_a_fix_and_given_up_for_one() {
    let requests = [(1.0, Ask::Command(Command::Start)), (ASKED_S, Ask::SelfTest)];
    let asker = run(&world(&good()).unwrap(), &requests, 12.0);
    let refused = |report: &&Report| matches!(report.event, Event::Answer { refusal: Some(Refusal::Busy), .. });
    // That of the start goes on in a fix.
    assert_eq!((asker.reports.iter().filter(refused).count(), asker.items(0.0).len()), (1, Item::ALL.len()));

    let (counting, responding, moving) = (1.0, 3.2, 3.8);
    let untold = [(Item::Response, Interrupted), (Item::Drive, Interrupted)];
    for (after_s, expected) in [(counting, &untold[..]), (responding, &untold), (moving, &untold[1..])] {
        let world = world(&good()).unwrap();
        let requests = [(ASKED_S, Ask::SelfTest), (ASKED_S + after_s, Ask::Command(Command::Abort))];
        let asker = run(&world, &requests, 12.0);
        assert_eq!(not_passed(&asker.items(ASKED_S)), expected, "{after_s}");
        assert!(!world.motor_has_current());
    }
}

/// Whenever it is asked for.
#[test]
fn the_move_is_seen_whenever_it_is_asked_for() {
    let asked_s = |tick: u32| f64::from(tick) / 400.0;
    for asked_s in (1..1600).step_by(7).chain((1600..20_000).step_by(997)).map(asked_s) {
        let world = world(&setup("calm-bench", 1)).unwrap();
        let told = run(&world, &[(asked_s, Ask::SelfTest)], asked_s + 8.0).items(asked_s);
        let passed = |found: &Finding| found.item != Item::Drive || found.passed();
        assert!(told.iter().all(passed), "asked at {asked_s} s: {told:?}");
    }
}
