//! Every sign of the plant against a calculation by hand.

mod common;

use common::{quiet, rate_deg_h};
use hal_sim::World;
use hal_sim::scenario::Scenario;

/// Earth rate, °/h: one turn in a sidereal day of 86164.0905 s.
const EARTH_DEG_H: f64 = 360.0 / 86_164.090_5 * 3600.0;
/// One second of the noiseless gyro is quantised to 1e-6 arcsec in each of 400 frames, the residue kept.
const QUANTUM_DEG_H: f64 = 3e-6;

#[track_caller]
fn assert_rate(world: &World, expected_deg_h: f64) {
    let rate = rate_deg_h(world, 1.0);
    assert!((rate - expected_deg_h).abs() < QUANTUM_DEG_H, "read {rate} °/h, by hand {expected_deg_h} °/h");
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
    assert_rate(&World::new(&at(0.0, 0.0, 0.0), 1), EARTH_DEG_H);
}

#[test]
fn with_the_mark_to_the_east_a_quarter_turn_counter_clockwise_points_north() {
    assert_rate(&World::new(&at(0.0, 90.0, 90.0), 1), EARTH_DEG_H);
    assert_rate(&World::new(&at(0.0, 90.0, 0.0), 1), 0.0);
    assert_rate(&World::new(&at(0.0, 90.0, 270.0), 1), -EARTH_DEG_H);
}

#[test]
fn a_positive_gyro_scale_error_reads_too_much() {
    let mut scenario = at(0.0, 0.0, 0.0);
    scenario.gyro.scale_ppm = 1000.0;
    assert_rate(&World::new(&scenario, 1), EARTH_DEG_H * 1.001);
}
