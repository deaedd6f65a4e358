//! Every state of a fix and every way out of it, by name, on the simulated instrument.

use crate::common::{fix, names, of_scenario, run, setup};
use hal_sim::Scenario;
use north::engine::{End, Setup};
use north_finder::event::{Event, State};
use north_finder::health::{Fault, Flag};
use north_finder::sequence::order::Order;

fn ends_with(setup: &Setup, fault: Fault, state: State) {
    let (outcome, reports) = run(setup);
    assert_eq!(outcome.end, End::Fault { fault, state });
    assert_eq!(names(&reports).last(), Some(&"failed"));
    assert!(!reports.iter().any(|report| matches!(report.event, Event::Fix(_))), "a failed fix gives no azimuth");
}

#[test]
fn a_calm_fix_passes_through_every_state_in_order() {
    let (outcome, reports) = run(&setup("calm-bench", 1));
    fix(&outcome);
    let mut expected = vec!["levelling", "level", "level", "watching", "undisturbed", "collecting", "dwell"];
    let turn = ["moving", "indexing", "arrived", "settling", "settled", "collecting", "dwell"];
    // 0, 90, 180, 270, then 270 again without a move, and back.
    expected.extend([turn; 3].concat());
    expected.extend(["collecting", "dwell"]);
    expected.extend([turn; 3].concat());
    expected.extend(["fix", "finished"]);
    assert_eq!(names(&reports), expected);
}

#[test]
fn the_source_order_turns_before_it_measures() {
    let mut setup = setup("calm-bench", 2);
    setup.settings.as_mut().unwrap().sequence.order = Order::Source;
    let (outcome, reports) = run(&setup);
    fix(&outcome);
    let targets: Vec<f64> = reports
        .iter()
        .filter_map(|report| match report.event {
            Event::Moving { target_deg, .. } => Some(target_deg),
            _ => None,
        })
        .collect();
    // 360° lies beyond the one turn of the spindle: it is the mark.
    assert_eq!(targets, [90.0, 180.0, 270.0, 0.0]);
}

#[test]
fn the_east_west_order_turns_to_where_the_axis_points_east_and_west() {
    let mut setup = setup("calm-bench", 3);
    setup.settings.as_mut().unwrap().sequence.order = Order::EastWest;
    let (outcome, reports) = run(&setup);
    fix(&outcome);
    assert!(names(&reports).contains(&"coarse"));
    // Azimuth 40°: the axis points to 40° − θ, east at θ = 310°, west at 130°. The coarse azimuth is good to 0.3°.
    let refined: Vec<f64> = reports
        .iter()
        .filter_map(|report| match report.event {
            Event::Moving { position: 4.., target_deg } => Some(target_deg),
            _ => None,
        })
        .collect();
    assert_eq!(refined.len(), 3, "east, west, (west,) east");
    for (target_deg, expected_deg) in refined.iter().zip([310.0, 130.0, 310.0]) {
        assert!((target_deg - expected_deg).abs() < 1.0, "{refined:?}");
    }
}

#[test]
fn disturbance_is_reported_and_waited_for() {
    let (outcome, reports) = run(&setup("disturbed-start", 1));
    let names = names(&reports);
    let at = |name| names.iter().position(|&other| other == name).unwrap();
    assert!(at("disturbed") < at("undisturbed"));
    assert!(fix(&outcome).0.flags.contains(Flag::Disturbed));
}

#[test]
fn jitter_is_reported_and_waited_for() {
    let (outcome, reports) = run(&setup("jittery-drive", 1));
    assert!(names(&reports).contains(&"jitter"));
    assert!(fix(&outcome).0.flags.contains(Flag::Jitter));
}

#[test]
fn shocks_are_left_out_and_the_dwell_lasts_longer() {
    let (outcome, reports) = run(&setup("shocks-during-dwell", 1));
    let (fix, _) = fix(&outcome);
    assert!(fix.flags.contains(Flag::Shock));
    assert!(
        reports.iter().any(|report| matches!(report.event, Event::Health(counters) if counters.seconds_outlying > 0))
    );
}

#[test]
fn levelling_waits_for_the_operator() {
    let (outcome, reports) = run(&setup("levelled-late", 1));
    fix(&outcome);
    let names = names(&reports);
    assert_eq!(names[..2], ["levelling", "not-level"]);
    assert!(names.contains(&"level"));
}

#[test]
fn not_level() {
    ends_with(&setup("not-level", 1), Fault::NotLevel, State::Levelling);
}

#[test]
fn disturbed_for_ever() {
    ends_with(&setup("always-disturbed", 1), Fault::Disturbed, State::Watching);
}

#[test]
fn jitter_for_ever() {
    ends_with(&setup("endless-jitter", 1), Fault::Jitter, State::Settling);
}

#[test]
fn motor_stall() {
    ends_with(&setup("stalled-motor", 1), Fault::MotorStall, State::Indexing);
}

#[test]
fn a_stuck_encoder_looks_like_a_stall() {
    ends_with(&setup("stuck-encoder", 1), Fault::MotorStall, State::Indexing);
}

#[test]
fn wrong_angle() {
    ends_with(&setup("wrong-angle", 1), Fault::WrongAngle, State::Indexing);
}

#[test]
fn lost_steps_are_made_good() {
    let (outcome, reports) = run(&setup("lost-steps", 1));
    fix(&outcome);
    for report in reports {
        if let Event::Arrived { index_deg, .. } = report.event {
            let off_deg = (index_deg + 45.0) % 90.0 - 45.0;
            assert!(off_deg.abs() <= 0.5, "{index_deg}");
        }
    }
}

#[test]
fn gyro_silent() {
    let (outcome, _) = run(&setup("gyro-silent", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::GyroSilent, .. }));
}

/// A switch at 200°, where the first turn to 270° takes the index. The motor turns on by less than the 2.5 ms between two looks at 30 °/s,
/// 0.075°, and the rotor rings about where it stopped. A fix that is begun there does not begin to turn; where no switch is declared its pin means nothing.
#[test]
fn a_limit_switch_ends_the_turn_on_the_spot() {
    let mut with_switch = setup("calm-bench", 1);
    with_switch.scenario.motor.limit_deg = Some(200.0);
    fix(&run(&with_switch).0);
    with_switch.settings.as_mut().unwrap().index.limit_switch = true;
    ends_with(&with_switch, Fault::IndexLimit, State::Indexing);
    let (_, reports) = run(&with_switch);
    let last = reports.iter().rev().find_map(|report| match report.event {
        Event::Second(second) => second.index_deg,
        _ => None,
    });
    let last = last.expect("a second");
    assert!(last > 100.0 && last < 201.0, "{last}");
    with_switch.scenario.motor.start_deg = 250.0;
    ends_with(&with_switch, Fault::IndexLimit, State::Levelling);
}

#[test]
fn gyro_invalid() {
    let (outcome, _) = run(&setup("gyro-invalid", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::GyroInvalid, .. }));
}

#[test]
fn gyro_saturated() {
    let (outcome, _) = run(&setup("gyro-saturated", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::GyroSaturated, .. }));
}

#[test]
fn gyro_stuck() {
    let (outcome, _) = run(&setup("gyro-stuck", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::GyroStuck, .. }));
}

#[test]
fn gyro_clock() {
    let (outcome, _) = run(&setup("gyro-clock", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::GyroClock, .. }));
}

#[test]
fn a_gyro_that_was_set_otherwise_is_told_what_to_send() {
    let (outcome, _) = run(&setup("kvh-by-command", 1));
    let (fix, error_deg) = fix(&outcome);
    assert!(error_deg.abs() < 4.0 * fix.sigma_deg, "{error_deg}");
}

/// Rates in the place of increments are 400 times too much; degrees in that of radians 57 times. A gyro that is told and does not answer is not believed.
#[test]
fn a_gyro_that_sends_anything_else_gives_no_azimuth() {
    ends_with(&setup("kvh-rates", 1), Fault::GyroUnits, State::Watching);
    let mut scenario = Scenario::named("kvh-rates").unwrap();
    (scenario.gyro.rates, scenario.gyro.degrees) = (false, true);
    ends_with(&of_scenario(scenario, 1), Fault::GyroUnits, State::Watching);
    let (outcome, _) = run(&setup("kvh-deaf", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::GyroUnanswered, .. }), "{:?}", outcome.end);
}

#[test]
fn a_line_that_lets_too_little_through() {
    let (outcome, _) = run(&setup("noisy-link", 1));
    assert!(matches!(outcome.end, End::Fault { fault: Fault::LinkPoor | Fault::GyroSilent, .. }), "{:?}", outcome.end);
}

#[test]
fn accelerometer_stuck_or_cut_off() {
    for name in ["stuck-accelerometer", "broken-bus"] {
        let (outcome, _) = run(&setup(name, 1));
        assert!(matches!(outcome.end, End::Fault { fault: Fault::AccelerometerFailed, .. }), "{name}");
    }
}

#[test]
fn near_a_pole_nothing_is_started() {
    ends_with(&setup("near-pole", 1), Fault::NearPole, State::Idle);
}

#[test]
fn settings_missing() {
    let missing = Setup { settings: None, ..setup("calm-bench", 1) };
    ends_with(&missing, Fault::SettingsMissing, State::Idle);
}

#[test]
fn out_of_time() {
    let mut setup = setup("calm-bench", 1);
    // Eight dwells of 30 s fit, the moves between them do not.
    setup.settings.as_mut().unwrap().time_limit_s = 250.0;
    ends_with(&setup, Fault::OutOfTime, State::Collecting);
}

#[test]
fn a_gyro_may_wake_slowly() {
    let (outcome, _) = run(&setup("slow-start", 1));
    fix(&outcome);
}

#[test]
fn frames_lost_are_repaired_and_said() {
    let (outcome, reports) = run(&setup("lossy-link", 1));
    assert!(fix(&outcome).0.flags.contains(Flag::FramesLost));
    let counters = reports.iter().rev().find_map(|report| match report.event {
        Event::Health(counters) => Some(counters),
        _ => None,
    });
    let counters = counters.unwrap();
    assert!(counters.frames_lost > 0 && counters.frames_bad_crc > 0 && counters.seconds_repaired > 0, "{counters:?}");
}

#[test]
fn the_southern_hemisphere_finds_north() {
    let (outcome, _) = run(&setup("southern-site", 1));
    let (fix, error_deg) = fix(&outcome);
    assert!(error_deg.abs() < 4.0 * fix.sigma_deg);
}

#[test]
fn every_quadrant() {
    for azimuth_deg in [3.0, 100.0, 190.0, 281.0, 359.9] {
        let mut scenario = Scenario::named("calm-bench").unwrap();
        scenario.site.azimuth_deg = azimuth_deg;
        let (outcome, _) = run(&of_scenario(scenario, 9));
        let (fix, error_deg) = fix(&outcome);
        assert!(error_deg.abs() < 4.0 * fix.sigma_deg, "{azimuth_deg}: {error_deg}");
    }
}
