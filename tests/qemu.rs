//! The firmware image in QEMU against the run in this process: the same reports, bit for bit.
//!
//! Needs `qemu-system-arm` and the target `thumbv7em-none-eabihf`, as `make setup` brings them.

use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use crate::carried::{held, short_walk};
use crate::common::{run, setup};
use crate::self_test::Asker;
use north::engine::qemu::{self, Pace};
use north::engine::{End, Outcome, Setup, host, world};
use north_finder::event::{Event, Report};
use north_finder::health::{Fault, Flag, Item, TestVerdict};
use north_finder::link::Ask;

/// The image, built once.
fn image() -> &'static Path {
    static IMAGE: OnceLock<std::path::PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| qemu::image::build(qemu::image::Board::Mps2).unwrap())
}

fn run_in_qemu(setup: &Setup) -> (Outcome, Vec<Report>) {
    let mut reports = Vec::new();
    let (outcome, _) =
        qemu::run(Pace::LockStep, image(), setup, &AtomicBool::new(false), &mut |report| reports.push(*report))
            .unwrap();
    (outcome, reports)
}

/// Runs both ways, compares every report, gives the end. With dwells of ten seconds, which pass through the same states as long ones.
fn same_both_ways(name: &str, seed: u64) -> End {
    let mut setup = setup(name, seed);
    setup.settings.as_mut().unwrap().sequence.dwell_s = 10;
    same(&setup).end
}

fn same(setup: &Setup) -> Outcome {
    let name = &setup.scenario.name;
    let (found, mut reports) = run_in_qemu(setup);
    let (outcome, mut expected) = run(setup);
    reports.retain(|report| !report.event.is_of_board());
    expected.retain(|report| !report.event.is_of_board());
    for (report, expected) in reports.iter().zip(&expected) {
        // Printed with all their digits, equal numbers are equal bits (and not-a-number equals itself).
        assert_eq!(format!("{report:?}"), format!("{expected:?}"), "{name}");
    }
    assert_eq!(reports.len(), expected.len(), "{name}");
    assert_eq!(format!("{found:?}"), format!("{outcome:?}"), "{name}");
    found
}

#[test]
fn calm() {
    let End::Fix(fix) = same(&setup("calm-bench", 1)).end else { panic!() };
    assert!(fix.sigma_deg > 0.0 && fix.closure_deg_h.is_some());
}

#[test]
fn disturbed() {
    let End::Fix(fix) = same_both_ways("disturbed-start", 2) else { panic!() };
    assert!(fix.flags.contains(Flag::Disturbed));
}

#[test]
fn jitter() {
    let End::Fix(fix) = same_both_ways("jittery-drive", 3) else { panic!() };
    assert!(fix.flags.contains(Flag::Jitter));
}

#[test]
fn lossy_link() {
    let End::Fix(fix) = same_both_ways("lossy-link", 4) else { panic!() };
    assert!(fix.flags.contains(Flag::FramesLost));
}

#[test]
fn motor_stall() {
    assert!(matches!(same_both_ways("stalled-motor", 5), End::Fault { fault: Fault::MotorStall, .. }));
}

/// At 200°, where the first turn to 270° takes the index.
#[test]
fn limit_switch() {
    let mut setup = setup("calm-bench", 1);
    setup.scenario.motor.limit_deg = Some(200.0);
    setup.settings.as_mut().unwrap().index.limit_switch = true;
    let end = same(&setup).end;
    assert!(matches!(end, End::Fault { fault: Fault::IndexLimit, .. }), "{end:?}");
}

#[test]
fn another_gyro() {
    assert!(matches!(same_both_ways("kvh-gyro", 6), End::Fix(_)));
}

#[test]
fn carried() {
    let (heading, error_deg) = held(&same(&short_walk(7)));
    assert!(error_deg.abs() < 4.0 * heading.sigma_deg, "{error_deg} {heading:?}");
}

#[test]
fn settings_missing() {
    let missing = Setup { settings: None, ..setup("calm-bench", 7) };
    assert!(matches!(run_in_qemu(&missing).0.end, End::Fault { fault: Fault::SettingsMissing, .. }));
}

/// The self-test at the start and on request, with its move: what it finds of the board is the board's, all else is the same.
#[test]
fn the_self_test() {
    let setup = setup("calm-bench", 9);
    let requests = [(4.0, Ask::SelfTest)];
    let (mut board, mut process) = (Asker::new(&requests), Asker::new(&requests));
    let never = AtomicBool::new(false);
    qemu::serve(Pace::LockStep, image(), &world(&setup).unwrap(), 4800, &mut board, &never).unwrap();
    host::serve(&world(&setup).unwrap(), 4800, &mut process, &never, &mut |_, _| ()).unwrap();
    let items = board.reports.iter().filter_map(|report| match report.event {
        Event::SelfTest(finding) if finding.item.is_of_board() => Some((finding.item, finding.verdict)),
        _ => None,
    });
    let once = [
        (Item::Memory, TestVerdict::Passed),
        (Item::Reset, TestVerdict::Passed),
        // This board has no crystal.
        (Item::Clock, TestVerdict::Absent),
    ];
    assert_eq!(items.collect::<Vec<_>>(), [once, once].concat());
    let others = |asker: &Asker| {
        let others = asker.reports.iter().filter(|report| !report.event.is_of_board());
        others.map(|report| format!("{report:?}")).collect::<Vec<_>>()
    };
    assert_eq!(others(&board), others(&process));
    assert!(
        board.reports.iter().any(
            |report| matches!(report.event, Event::SelfTest(found) if found.item == Item::Drive && found.passed())
        )
    );
}

#[test]
fn two_runs_are_identical() {
    let setup = setup("stalled-motor", 8);
    assert_eq!(format!("{:?}", run_in_qemu(&setup)), format!("{:?}", run_in_qemu(&setup)));
}
