//! The accelerometers calibrated in the field: the operator of a scenario obeys the instrument, in this process and, report
//! for report the same, as the firmware image in QEMU.

use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use crate::common::{fix, of_scenario};
use calibration::field::guidance::Step;
use calibration::field::refusal::{NoCalibration, Why};
use hal_sim::scenario::{SensorFault, SensorFaultKind};
use hal_sim::{Operator, Scenario, World};
use north::engine::{self, Engine, FixWanted, Outcome, Person, PowerOff, Setup, qemu};
use north::field::{End, Obedient, calibrate};
use north_finder::event::{Event, Report};
use north_finder::health::{Fault, Flag};
use north_finder::link::{Ask, Request};
use north_finder::sensing::level::Tilt;
use north_finder::sequence::Command;
use north_finder::settings::store::{self, Loaded};

const SCENARIO: &str = "worn-accelerometers";

/// The image, built once.
fn image() -> &'static Path {
    static IMAGE: OnceLock<std::path::PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| qemu::image::build(qemu::image::Board::Mps2).unwrap())
}

fn changed(change: impl FnOnce(&mut Scenario)) -> Setup {
    let mut scenario = Scenario::named(SCENARIO).unwrap();
    change(&mut scenario);
    of_scenario(scenario, 1)
}

/// A calibration in this process: how it ended, all reports, and the world it leaves.
fn run(setup: &Setup) -> (north::field::Outcome, Vec<Report>, World) {
    let world = engine::world(setup).unwrap();
    let mut reports = Vec::new();
    let never = AtomicBool::new(false);
    let observe = &mut |report: &Report| reports.push(*report);
    let outcome = calibrate(Engine::Host, None, &world, setup, &never, observe).unwrap();
    (outcome, reports, world)
}

fn why(setup: &Setup) -> Why {
    let (outcome, _, world) = run(setup);
    let End::Refused(NoCalibration { why, .. }) = outcome.end else { panic!("{:?}", outcome.end) };
    assert_eq!(store::load(&mut world.flash()).unwrap(), Loaded::Valid(setup.settings.clone().unwrap()));
    why
}

/// A fix after the power was off, with this content of the flash.
fn find(setup: &Setup, flash: &[u8]) -> Outcome {
    let world = World::new(&setup.scenario, setup.seed).with_flash(flash);
    let mut silent = |_: &Report| ();
    let mut wanted = FixWanted::new(&world, &mut silent);
    let limit_ticks = engine::limit_ticks(setup);
    let off = engine::serve(Engine::Host, None, &world, limit_ticks, &mut wanted, &AtomicBool::new(false)).unwrap();
    wanted.outcome(off)
}

fn steps(reports: &[Report]) -> Vec<Step> {
    let step = |report: &Report| if let Event::Guidance(guidance) = report.event { Some(guidance.step) } else { None };
    reports.iter().filter_map(step).collect()
}

#[test]
fn the_declared_errors_are_found_and_stored() {
    let setup = changed(|_| ());
    let (outcome, reports, world) = run(&setup);
    assert_eq!(outcome.end, End::Stored);
    let solved = outcome.solved.unwrap();
    // The scenario: biases of 6, −4.5 and 8 mg; scale factors 1.004, 0.997, 1.0025; x sees 0.0015 of y.
    for (found, declared) in solved.calibration.bias_g.into_iter().zip([0.006, -0.0045, 0.008]) {
        assert!((found - declared).abs() < 5e-5, "{solved:?}");
    }
    let [m11, m12, _, m22, _, m33] = solved.calibration.matrix;
    for (found, declared) in [(m11, 1.0 / 1.004), (m22, 1.0 / 0.997), (m33, 1.0 / 1.0025), (m12, -0.0015)] {
        assert!((found - declared).abs() < 1e-4, "{found} {declared}");
    }
    assert!(solved.judged_before_g > 0.003 && solved.judged_after_g < 5e-5, "{solved:?}");
    let Loaded::Valid(settings) = store::load(&mut world.flash()).unwrap() else { panic!() };
    assert_eq!(settings.accelerometer, Some(solved.calibration));
    assert_eq!(settings.model, setup.settings.unwrap().model);
    // The shock was seen: an attitude moved before it was measured.
    assert!(steps(&reports).contains(&Step::Moved));
}

#[test]
fn after_the_power_was_off_level_and_north_are_better() {
    let setup = changed(|_| ());
    let before = find(&setup, &engine::world(&setup).unwrap().flash_contents());
    let after = find(&setup, &run(&setup).2.flash_contents());
    let level_error_deg = |outcome: &Outcome| {
        let Tilt { pitch_deg, roll_deg } = fix(outcome).0.tilt.unwrap();
        (pitch_deg - outcome.truth.pitch_deg).hypot(roll_deg - outcome.truth.roll_deg)
    };
    assert!(level_error_deg(&before) > 0.2 && level_error_deg(&after) < 0.005);
    let (fix_after, error_deg) = fix(&after);
    assert!(fix(&before).1.abs() > 0.2 && error_deg.abs() < 3.0 * fix_after.sigma_deg);
    assert_eq!([fix(&before).0, fix_after].map(|fix| fix.flags.contains(Flag::LevelUncalibrated)), [true, false]);
}

/// Who sets the instrument upright when its accelerometers are calibrated, and wants north.
struct Northward<'a, 'b> {
    obedient: Obedient<'a, 'b>,
    operator: Operator,
    world: World,
    stored: bool,
    /// When it has come to rest upright, 2.5 ms ticks.
    upright: Option<u64>,
    flagged: Option<bool>,
}

impl Person for Northward<'_, '_> {
    fn request(&mut self, tick: u64) -> Option<Request> {
        if std::mem::take(&mut self.stored) {
            self.operator.turn(&self.world, [0.0, 0.0, 1.0]);
            self.upright = Some(tick + 4000);
        }
        match self.upright {
            None => self.obedient.request(tick),
            Some(upright) => (tick == upright).then(|| Ask::Command(Command::Start).into()),
        }
    }

    fn hear(&mut self, report: &Report) -> bool {
        self.obedient.hear(report);
        self.stored |= matches!(report.event, Event::CalibrationStored);
        if let Event::Fix(fix) = report.event {
            self.flagged = Some(fix.flags.contains(Flag::LevelUncalibrated));
        }
        self.flagged.is_some()
    }
}

/// A calibration is in effect, and said to be, in the next fix, without a start of the instrument in between.
#[test]
fn the_next_fix_is_calibrated() {
    let setup = changed(|scenario| scenario.operator.aim_deg = 0.0);
    let world = engine::world(&setup).unwrap();
    let observe = &mut |_: &Report| ();
    let obedient = Obedient::new(&world, &setup, observe);
    let operator = Operator::new(&setup.scenario, setup.seed);
    let mut person =
        Northward { obedient, operator, world: world.clone(), stored: false, upright: None, flagged: None };
    let ticks = 2 * engine::limit_ticks(&setup);
    let off = engine::serve(Engine::Host, None, &world, ticks, &mut person, &AtomicBool::new(false)).unwrap();
    assert_eq!((off, person.flagged), (PowerOff::Received, Some(false)));
}

#[test]
fn a_triad_without_errors_stays_as_it_is() {
    let setup = changed(|scenario| {
        scenario.accelerometer.bias_mg = [0.0; 3];
        scenario.accelerometer.scale_ppm = [0.0; 3];
        scenario.accelerometer.skew_ppm = [0.0; 3];
    });
    assert_eq!(why(&setup), Why::NotBetter);
}

#[test]
fn a_place_that_shakes_gives_no_attitude() {
    assert_eq!(why(&changed(|scenario| scenario.base.vibration_g = 0.05)), Why::MovingThroughout);
}

#[test]
fn a_slow_and_sloppy_operator_still_gets_there() {
    let setup = changed(|scenario| {
        scenario.operator.aim_deg = 8.0;
        scenario.operator.turn_s = 6.0;
        scenario.operator.shocks = vec![2, 3, 8];
    });
    assert_eq!(run(&setup).0.end, End::Stored);
}

#[test]
fn a_broken_bus_is_told() {
    let setup = changed(|scenario| {
        scenario.accelerometer.faults = vec![SensorFault { kind: SensorFaultKind::BusHigh, from_s: 20.0, to_s: None }];
    });
    assert_eq!(why(&setup), Why::AccelerometerFailed);
}

#[test]
fn without_settings_there_is_no_calibration() {
    let setup = Setup { settings: None, ..changed(|_| ()) };
    let (outcome, _, world) = run(&setup);
    assert_eq!(outcome.end, End::Fault(Fault::SettingsMissing));
    assert_eq!(store::load(&mut world.flash()).unwrap(), Loaded::Missing);
}

#[test]
fn a_power_cut_while_storing_leaves_the_former_settings() {
    let setup = changed(|_| ());
    for bytes in [1, 10, 50, 200] {
        let world = engine::world(&setup).unwrap();
        world.flash().cut_power_after(bytes);
        let observe = &mut |_: &Report| ();
        let outcome = calibrate(Engine::Host, None, &world, &setup, &AtomicBool::new(false), observe).unwrap();
        assert_eq!(outcome.end, End::Refused(Why::NotStored.into()));
        world.flash().restore_power();
        assert_eq!(store::load(&mut world.flash()).unwrap(), Loaded::Valid(setup.settings.clone().unwrap()));
    }
}

/// An operator who wants something else at certain ticks.
struct Impatient<'a, 'b> {
    obedient: Obedient<'a, 'b>,
    commands: [(u64, Command); 2],
}

impl Person for Impatient<'_, '_> {
    fn request(&mut self, tick: u64) -> Option<Request> {
        match self.commands.iter().find(|(at, _)| *at == tick) {
            Some((_, command)) => Some(Ask::Command(*command).into()),
            None => self.obedient.request(tick),
        }
    }

    fn hear(&mut self, report: &Report) -> bool {
        self.obedient.hear(report);
        false
    }
}

/// Who has enough after ten seconds, and then wants north.
fn impatient(engine: Engine) -> Vec<Report> {
    with_commands(engine, [(4000, Command::Abort), (4400, Command::Start)])
}

fn with_commands(engine: Engine, commands: [(u64, Command); 2]) -> Vec<Report> {
    let setup = changed(|_| ());
    let world = engine::world(&setup).unwrap();
    let mut reports = Vec::new();
    let observe = &mut |report: &Report| reports.push(*report);
    let mut person = Impatient { obedient: Obedient::new(&world, &setup, observe), commands };
    let image = (engine == Engine::Qemu).then(image);
    let off = engine::serve(engine, image, &world, 6000, &mut person, &AtomicBool::new(false)).unwrap();
    assert_eq!(off, PowerOff::TimeLimit);
    reports
}

#[test]
fn an_abort_ends_it_and_a_fix_can_begin() {
    let reports = impatient(Engine::Host);
    let names = crate::common::names(&reports);
    let aborted = names.iter().position(|name| *name == "aborted").unwrap();
    assert_eq!(names[aborted + 1], "failed");
    assert_eq!(names[aborted + 2], "levelling");
}

/// A fix is under way: the calibration ends it, and then guides its operator.
#[test]
fn a_calibration_ends_the_fix_under_way() {
    let reports = with_commands(Engine::Host, [(0, Command::Start), (2400, Command::CalibrateAccelerometers)]);
    let names = crate::common::names(&reports);
    let aborted = names.iter().position(|name| *name == "aborted").unwrap();
    assert_eq!((&names[0], &names[aborted + 1]), (&"levelling", &"failed"));
    assert!(reports.iter().all(|report| !matches!(report.event, Event::Fix(_))));
    let guided = reports.iter().find(|report| matches!(report.event, Event::Guidance(_))).unwrap();
    assert!(guided.t_s >= 2400.0 * 0.0025, "{guided:?}");
}

/// The same but for what a board says of itself.
fn assert_same(qemu: &[Report], host: &[Report]) {
    let [qemu, host] = [qemu, host].map(|reports| reports.iter().filter(|report| !report.event.is_of_board()));
    let [qemu, host]: [Vec<String>; 2] =
        [qemu, host].map(|reports| reports.map(|report| format!("{report:?}")).collect());
    assert_eq!(qemu, host);
}

#[test]
fn the_image_in_qemu_reports_the_same() {
    let setup = changed(|_| ());
    let world = engine::world(&setup).unwrap();
    let mut reports = Vec::new();
    let observe = &mut |report: &Report| reports.push(*report);
    let outcome = calibrate(Engine::Qemu, Some(image()), &world, &setup, &AtomicBool::new(false), observe).unwrap();
    let (expected, expected_reports, expected_world) = run(&setup);
    assert_same(&reports, &expected_reports);
    assert_eq!(outcome, expected);
    assert_eq!(world.flash_contents(), expected_world.flash_contents());
}

#[test]
#[ignore = "a long run in QEMU: make proofs"]
fn an_abort_in_qemu_too() {
    assert_same(&impatient(Engine::Qemu), &impatient(Engine::Host));
}
