//! Every sign of the plant against a calculation by hand.

use crate::common::{drive_to, increments, quiet, rate_deg_h, read_encoder_deg, read_g, tick};
use hal_sim::World;
use hal_sim::scenario::{Scenario, Shock, Sway};

/// Earth rate, °/h: one turn against the stars in 86164.0989 s.
const EARTH_DEG_H: f64 = 360.0 / 86_164.098_9 * 3600.0;
/// One second of the noiseless gyro is quantised to 1e-6 arcsec in each of 400 frames, the residue kept.
const QUANTUM_DEG_H: f64 = 3e-6;

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "found {found}, by hand {expected} ± {tolerance}");
}

#[track_caller]
fn assert_rate(scenario: &Scenario, expected_deg_h: f64) {
    assert_near(rate_deg_h(&World::new(scenario, 1), 1.0), expected_deg_h, QUANTUM_DEG_H);
}

fn at(latitude_deg: f64, azimuth_deg: f64, index_deg: f64) -> Scenario {
    let mut scenario = quiet();
    scenario.site.latitude_deg = latitude_deg;
    scenario.site.azimuth_deg = azimuth_deg;
    scenario.motor.start_deg = index_deg;
    scenario
}

#[test]
fn at_the_equator_an_axis_to_the_north_reads_the_whole_earth_rate() {
    assert_rate(&at(0.0, 0.0, 0.0), EARTH_DEG_H);
    assert_rate(&at(0.0, 180.0, 0.0), -EARTH_DEG_H);
}

#[test]
fn with_the_mark_to_the_east_a_quarter_turn_counter_clockwise_points_north() {
    assert_rate(&at(0.0, 90.0, 90.0), EARTH_DEG_H);
    assert_rate(&at(0.0, 90.0, 0.0), 0.0);
    assert_rate(&at(0.0, 90.0, 270.0), -EARTH_DEG_H);
}

#[test]
fn latitude_takes_its_part_of_the_earth_rate() {
    // 60° north, the axis 60° west of north: 15.041067 · 1/2 · 1/2.
    assert_rate(&at(60.0, 0.0, 60.0), 0.25 * EARTH_DEG_H);
    assert_rate(&at(-60.0, 0.0, 60.0), 0.25 * EARTH_DEG_H);
    assert_rate(&at(90.0, 123.0, 45.0), 0.0);
}

#[test]
fn nose_up_lets_an_eastward_axis_see_the_vertical_earth_rate() {
    // 30° north, the axis east and 2° up: Ω · sin 30° · sin 2°.
    let mut scenario = at(30.0, 90.0, 0.0);
    scenario.base.pitch_deg = 2.0;
    assert_rate(&scenario, EARTH_DEG_H * 0.5 * 0.034_899_497);
    // In the south the vertical Earth rate points down.
    scenario.site.latitude_deg = -30.0;
    assert_rate(&scenario, -EARTH_DEG_H * 0.5 * 0.034_899_497);
}

#[test]
fn left_side_up_lifts_an_axis_that_points_left() {
    // The mark south, so that left is east; 2° up.
    let mut scenario = at(30.0, 180.0, 90.0);
    scenario.base.roll_deg = 2.0;
    assert_rate(&scenario, EARTH_DEG_H * 0.5 * 0.034_899_497);
    // An axis along the mark stays level under roll.
    scenario.motor.start_deg = 0.0;
    assert_rate(&scenario, -EARTH_DEG_H * 0.866_025_404);
}

#[test]
fn a_base_that_goes_nose_up_reads_minus_on_an_axis_to_the_left() {
    // Nose up is a rotation about the right-hand side: 1 arcsec/s is −1 °/h on the left. The Earth adds nothing in the west.
    let mut scenario = at(0.0, 0.0, 90.0);
    scenario.base.creep_arcsec_s = [1.0, 0.0, 0.0];
    assert_rate(&scenario, -1.0);
    // And nothing on an axis along the mark, east.
    let mut scenario = at(0.0, 90.0, 0.0);
    scenario.base.creep_arcsec_s = [1.0, 0.0, 0.0];
    assert_rate(&scenario, 0.0);
}

#[test]
fn a_base_whose_left_side_goes_up_reads_plus_on_an_axis_along_the_mark() {
    let mut scenario = at(0.0, 90.0, 0.0);
    scenario.base.creep_arcsec_s = [0.0, 1.0, 0.0];
    assert_rate(&scenario, 1.0);
}

#[test]
fn between_the_axes_tilt_rates_add_with_cosine_and_sine_of_the_index() {
    // cos 30° · dr/dt − sin 30° · dp/dt with dr/dt = 2, dp/dt = 3, and the axis east by an azimuth of 120°.
    let mut scenario = at(0.0, 120.0, 30.0);
    scenario.base.creep_arcsec_s = [3.0, 2.0, 0.0];
    assert_near(rate_deg_h(&World::new(&scenario, 1), 1.0), 0.866_025_404 * 2.0 - 0.5 * 3.0, 1e-4);
}

#[test]
fn an_axis_that_stands_up_feels_the_base_twist_and_the_spindle_turn() {
    // Clockwise twist of 100 arcsec/s is −100 about up; the axis is 1° above the horizon, pointing east at the pole.
    let mut scenario = at(90.0, 90.0, 0.0);
    scenario.gyro.axis_elevation_arcsec = 3600.0;
    scenario.base.creep_arcsec_s = [0.0, 0.0, 100.0];
    let sine = 0.017_452_406;
    assert_near(rate_deg_h(&World::new(&scenario, 1), 1.0), (EARTH_DEG_H - 100.0) * sine, 1e-4);

    scenario.base.creep_arcsec_s = [0.0; 3];
    let world = World::new(&scenario, 1);
    let before: f64 = increments(&world, 2).iter().sum();
    assert_near(before, EARTH_DEG_H * sine * 0.0025, 1e-5);
    let turned = turn_and_sum(&world, 9000);
    let seconds = world.truth().t_s - 0.0025 * 2.0;
    // A quarter turn counter-clockwise, 324000 arcsec.
    assert_near(turned - EARTH_DEG_H * sine * seconds, 324_000.0 * sine, 0.01);
}

/// Turns counter-clockwise, one microstep for each tick, waits, and adds up what the gyro reads.
fn turn_and_sum(world: &World, microsteps: u32) -> f64 {
    use embedded_hal::digital::OutputPin;
    world.enable_pin().set_high().expect("pins do not fail");
    world.dir_pin().set_high().expect("pins do not fail");
    let mut step = world.step_pin();
    let mut sum = 0.0;
    for _ in 0..microsteps {
        step.set_high().expect("pins do not fail");
        step.set_low().expect("pins do not fail");
        sum += increments(world, 1).iter().sum::<f64>();
    }
    sum + increments(world, 800).iter().sum::<f64>()
}

#[test]
fn a_spindle_that_leans_forward_dips_an_axis_along_the_mark() {
    // Leaning by 1° towards x: the axis at index 0 points 1° down, at 180° up, at 90° level.
    for (index_deg, expected) in [(0.0, -0.017_452_406), (90.0, 0.0), (180.0, 0.017_452_406)] {
        let mut scenario = at(90.0, 0.0, index_deg);
        scenario.gyro.spindle_tilt_arcsec = [3600.0, 0.0];
        assert_rate(&scenario, EARTH_DEG_H * expected);
    }
    // Leaning to the left dips an axis that points left.
    let mut scenario = at(90.0, 0.0, 90.0);
    scenario.gyro.spindle_tilt_arcsec = [0.0, 3600.0];
    assert_rate(&scenario, -EARTH_DEG_H * 0.017_452_406);
}

#[test]
fn level_accelerometers_read_the_push_of_the_ground() {
    let mut scenario = quiet();
    let lsb = 0.5 / 256_000.0;
    for (axis, expected) in [0.0, 0.0, 1.0].into_iter().enumerate() {
        assert_near(read_g(&World::new(&scenario, 1))[axis], expected, lsb);
    }
    // Nose up 5°, left side up 3°: sin 5°; sin 3° · cos 5°; cos 3° · cos 5°.
    scenario.base.pitch_deg = 5.0;
    scenario.base.roll_deg = 3.0;
    let by_hand = [0.087_155_743, 0.052_335_956 * 0.996_194_698, 0.998_629_535 * 0.996_194_698];
    for (axis, expected) in by_hand.into_iter().enumerate() {
        assert_near(read_g(&World::new(&scenario, 1))[axis], expected, 1.01 * lsb);
    }
}

#[test]
fn direction_high_turns_counter_clockwise_and_the_encoder_counts_up() {
    let world = World::new(&at(0.0, 90.0, 0.0), 1);
    assert_near(read_encoder_deg(&world), 0.0, 0.0);
    drive_to(&world, 3000, 1.0);
    assert_near(world.truth().index_deg, 30.0, 1e-6);
    assert_near(read_encoder_deg(&world), 30.0, 0.5 * 360.0 / 16_384.0);
    // The axis went from east by 30° towards north.
    assert_near(rate_deg_h(&world, 1.0), 0.5 * EARTH_DEG_H, 1e-5);
    drive_to(&world, -4000, 1.0);
    assert_near(world.truth().index_deg, -10.0, 1e-6);
    assert_near(read_encoder_deg(&world), 350.0, 0.5 * 360.0 / 16_384.0);
}

#[test]
fn the_true_azimuth_is_that_of_the_mark_however_the_base_stands() {
    let mut scenario = at(34.75, 222.5, 0.0);
    scenario.base.pitch_deg = 4.0;
    scenario.base.roll_deg = -7.0;
    assert_near(World::new(&scenario, 1).truth().azimuth_deg, 222.5, 1e-10);
    scenario.base.creep_arcsec_s = [0.0, 0.0, 3.6];
    let world = World::new(&scenario, 1);
    increments(&world, 4000);
    assert_near(world.truth().azimuth_deg, 222.51, 1e-9);
}

#[test]
fn no_angle_is_lost_in_a_shock() {
    // The base ends 50 arcsec higher on its left; the axis points east along the mark.
    let mut scenario = at(0.0, 90.0, 0.0);
    scenario.base.shocks = vec![Shock {
        at_s: 0.5,
        swing_arcsec: [300.0, 200.0, 100.0],
        permanent_arcsec: [0.0, 50.0, 0.0],
        decay_s: 0.1,
        ..Shock::default()
    }];
    let world = World::new(&scenario, 1);
    tick(&world);
    assert_near(increments(&world, 1600).iter().sum(), 50.0, 1e-3);
}

#[test]
fn a_sway_that_comes_back_leaves_nothing() {
    let mut scenario = at(0.0, 90.0, 0.0);
    scenario.base.sway = vec![Sway { amplitude_arcsec: 500.0, frequency_hz: 2.0, to_s: Some(3.0), ..Sway::default() }];
    scenario.base.sway[0].angle = hal_sim::scenario::BaseAngle::Roll;
    let world = World::new(&scenario, 1);
    let all = increments(&world, 1400);
    assert!(all.iter().any(|arcsec| arcsec.abs() > 10.0), "it swayed");
    assert_near(all.iter().sum(), 0.0, 1e-3);
}
