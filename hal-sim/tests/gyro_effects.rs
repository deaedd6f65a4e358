//! Each effect of the gyro by hand: size, sign, and what it depends on.

use crate::common::{compact, drive_to, increments, quiet, rate_deg_h, tick};
use hal_sim::World;
use hal_sim::scenario::{Gyro, GyroFault, GyroFaultKind, Harmonic, Scenario};

/// An east-pointing, level axis at the equator: no Earth rate.
fn scenario(change: impl FnOnce(&mut Gyro)) -> Scenario {
    let mut scenario = quiet();
    scenario.site.latitude_deg = 0.0;
    scenario.site.azimuth_deg = 90.0;
    change(&mut scenario.gyro);
    scenario
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "found {found}, by hand {expected} ± {tolerance}");
}

#[track_caller]
fn assert_bias(scenario: &Scenario, expected_deg_h: f64) {
    let world = World::new(scenario, 1);
    assert_near(rate_deg_h(&world, 1.0), expected_deg_h, 1e-5);
    assert_near(world.truth().bias_deg_h, expected_deg_h, 1e-4);
}

#[test]
fn bias_and_temperature() {
    assert_bias(&scenario(|gyro| gyro.bias_deg_h = -0.7), -0.7);
    let mut warm = scenario(|gyro| {
        gyro.bias_deg_h_per_k = 0.02;
        gyro.bias_deg_h_per_k2 = -0.001;
    });
    warm.site.ambient_c = 30.0;
    assert_bias(&warm, 0.2 - 0.1);
}

#[test]
fn stress_between_coil_and_housing() {
    let mut stressed = scenario(|gyro| {
        gyro.housing_deg_h_per_k2 = 0.02;
        gyro.start_offset_k = 5.0;
        gyro.thermal_tau_s = 100_000.0;
    });
    // The coil is 2 K above 20 °C, the housing 3 K below: 0.02 · 2 · (−3).
    stressed.site.ambient_c = 17.0;
    assert_bias(&stressed, -0.12);
}

#[test]
fn scale_changes_with_temperature() {
    let mut warm = scenario(|gyro| gyro.scale_ppm_per_k = 100.0);
    warm.site.azimuth_deg = 0.0;
    warm.site.ambient_c = 30.0;
    assert_near(rate_deg_h(&World::new(&warm, 1), 1.0), 15.041_067 * 1.001, 1e-5);
}

#[test]
fn drift_grows_with_time() {
    let world = World::new(&scenario(|gyro| gyro.drift_deg_h_per_h = 36.0), 1);
    increments(&world, 4001);
    // From 10 s to 11 s: 0.1 to 0.11 °/h (two ticks later, by the way of counting).
    assert_near(rate_deg_h(&world, 1.0), 0.105, 1e-4);
}

#[test]
fn warm_up_and_shupe_follow_an_exponential() {
    let world = World::new(
        &scenario(|gyro| {
            gyro.start_offset_k = -10.0;
            gyro.self_heating_k = 5.0;
            gyro.thermal_tau_s = 10.0;
            gyro.shupe_deg_h_per_k_s = 2.0;
            gyro.temperature_error_k = 0.5;
        }),
        1,
    );
    increments(&world, 4000);
    // After one time constant 15 K have become 15/e = 5.518.
    assert_near(world.truth().temp_c, 25.0 - 5.518_192, 1e-4);
    // 15 K / 10 s / e · 2.
    assert_near(world.truth().bias_deg_h, 1.103_638, 1e-3);
    assert_near(compact(&tick(&world)).3, 25.0 - 5.518_192 + 0.5, 0.006);
}

#[test]
fn hysteresis_tells_warming_from_cooling() {
    for (start_k, expected) in [(-20.0, 0.3), (20.0, -0.3), (0.0, 0.0)] {
        let world = World::new(
            &scenario(|gyro| {
                gyro.start_offset_k = start_k;
                gyro.thermal_tau_s = 1.0;
                gyro.hysteresis_deg_h = 0.3;
            }),
            1,
        );
        increments(&world, 4000);
        assert_near(world.truth().bias_deg_h, expected, 1e-6);
    }
}

#[test]
fn the_earths_field_acts_by_direction() {
    // Magnetic north is 30° east of north.
    for (azimuth_deg, expected) in [(30.0, 0.2), (210.0, -0.2), (90.0, 0.1), (300.0, 0.0)] {
        let mut scenario = scenario(|gyro| gyro.magnetic_axial_deg_h = 0.2);
        scenario.site.latitude_deg = 90.0;
        scenario.site.magnetic_declination_deg = 30.0;
        scenario.site.azimuth_deg = azimuth_deg;
        assert_bias(&scenario, expected);
    }
    // Across: the axis points west, the field 90° clockwise from it.
    let mut scenario = scenario(|gyro| gyro.magnetic_transverse_deg_h = 0.2);
    scenario.site.azimuth_deg = 270.0;
    assert_bias(&scenario, 0.2);
}

#[test]
fn a_field_in_the_body_turns_with_the_index() {
    for (order, index_deg, expected) in
        [(1, 60.0, 0.2), (1, 150.0, 0.0), (1, 240.0, -0.2), (2, 105.0, 0.0), (2, 150.0, -0.2)]
    {
        let mut scenario = scenario(|gyro| {
            gyro.harmonics = vec![Harmonic { order, amplitude_deg_h: 0.2, phase_deg: 60.0 }];
        });
        scenario.site.latitude_deg = 90.0;
        scenario.motor.start_deg = index_deg;
        assert_bias(&scenario, expected);
    }
}

#[test]
fn a_move_leaves_a_transient_with_its_sign() {
    for (microsteps, sign) in [(9000, 1.0), (-9000, -1.0)] {
        let mut scenario = scenario(|gyro| {
            gyro.after_move_deg_h = 0.5;
            gyro.after_move_tau_s = 1000.0;
        });
        scenario.site.latitude_deg = 90.0;
        let world = World::new(&scenario, 1);
        drive_to(&world, microsteps, 1.0);
        // The move takes 22.5 s of the 1000 s.
        assert_near(world.truth().bias_deg_h, 0.5 * sign, 0.01);
        let before = world.truth().bias_deg_h;
        increments(&world, 40_000);
        assert_near(world.truth().bias_deg_h / before, (-0.1_f64).exp(), 1e-6);
    }
}

#[test]
fn vibration_gravity_and_supply() {
    let mut shaken = scenario(|gyro| gyro.vibration_deg_h_per_g2 = 50.0);
    shaken.base.vibration_g = 0.1;
    assert_bias(&shaken, 0.5);

    let mut tilted = scenario(|gyro| gyro.g_sensitivity_deg_h_per_g = 2.0);
    tilted.base.pitch_deg = 5.0;
    assert_near(World::new(&tilted, 1).truth().pitch_deg, 5.0, 1e-12);
    assert_bias(&tilted, 2.0 * 0.087_155_743);

    let mut sagging = scenario(|gyro| gyro.supply_deg_h_per_v = 0.4);
    sagging.supply.volts = 11.0;
    assert_bias(&sagging, -0.4);
    sagging.supply.step_v = 0.5;
    assert_bias(&sagging, -0.2);
}

#[test]
fn the_rate_near_zero_is_bent_oddly() {
    // Axis 10 % north: 1.5041 °/h. Depth 0.1 at width 1.5041 takes all of the depth away.
    for (azimuth_deg, sign) in [(90.0 - 5.739_170_5, 1.0), (270.0 - 5.739_170_5, -1.0)] {
        let mut bent = scenario(|gyro| {
            gyro.dead_zone_deg_h = 0.1;
            gyro.dead_zone_width_deg_h = 1.504_106_7;
        });
        bent.site.azimuth_deg = azimuth_deg;
        assert_near(rate_deg_h(&World::new(&bent, 1), 1.0), sign * (1.504_106_7 - 0.1), 1e-5);
        bent.gyro.dead_zone_deg_h = 0.0;
        bent.gyro.cubic_per_deg_h2 = 1e-4;
        assert_near(rate_deg_h(&World::new(&bent, 1), 1.0), sign * (1.504_106_7 + 3.402_78e-4), 1e-5);
    }
}

#[test]
fn interference_is_integrated_over_the_frame() {
    let world = World::new(
        &scenario(|gyro| {
            gyro.interference_deg_h = 100.0;
            gyro.interference_hz = 100.0;
        }),
        1,
    );
    tick(&world);
    // A quarter period: 100/(2π·100) · 1 arcsec, then the same, then twice the negative.
    let quarter = 0.159_155;
    for (found, sign) in increments(&world, 8).into_iter().zip([1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0]) {
        assert_near(found, sign * quarter, 2e-6);
    }
}

#[test]
fn an_intermittent_effect_is_on_as_long_as_said() {
    let world = World::new(
        &scenario(|gyro| {
            gyro.intermittent_deg_h = 2.0;
            gyro.intermittent_off_s = 0.3;
            gyro.intermittent_on_s = 0.1;
        }),
        1,
    );
    // A duty of 1/4. Over 2000 cycles of about 0.4 s the fraction scatters by about 0.25 · 0.75 · √(2/2000) = 0.006.
    let mean = rate_deg_h(&world, 800.0);
    assert_near(mean / 2.0, 0.25, 5.0 * 0.006);
    assert!([0.0, 2.0].contains(&world.truth().bias_deg_h));
}

#[test]
fn quantisation_loses_no_angle() {
    let world = World::new(
        &scenario(|gyro| {
            gyro.bias_deg_h = 1.0;
            gyro.quantum_arcsec = 0.1;
        }),
        1,
    );
    tick(&world);
    // 0.0025 arcsec a frame: mostly nothing, now and then a whole 0.1.
    let all = increments(&world, 4000);
    assert!(all.iter().all(|arcsec| *arcsec == 0.0 || (arcsec - 0.1).abs() < 1e-9));
    assert_near(all.iter().sum(), 10.0, 0.051);
}

#[test]
fn the_internal_clock_makes_frames_longer() {
    let world = World::new(
        &scenario(|gyro| {
            gyro.bias_deg_h = 1.0;
            gyro.frames_per_tick = 0.962;
        }),
        1,
    );
    let all = increments(&world, 100_001);
    assert_near(all.len() as f64, 96_200.0, 1.0);
    // No angle is lost: 1 °/h for 250 s. Each frame holds 2.5 ms / 0.962.
    assert_near(all.iter().sum(), 250.0, 0.01);
    assert_near(all[1000], 0.0025 / 0.962, 2e-6);
    let fast = World::new(&scenario(|gyro| gyro.frames_per_tick = 1.5), 1);
    assert_near(increments(&fast, 2001).len() as f64, 3000.0, 1.0);
}

#[test]
fn beyond_full_scale_the_output_stays_there_and_says_so() {
    let mut scenario = scenario(|gyro| gyro.full_scale_deg_s = 0.01);
    scenario.base.creep_arcsec_s = [0.0, -100.0, 0.0];
    let world = World::new(&scenario, 1);
    tick(&world);
    let (_, status, increment, _) = compact(&tick(&world));
    assert_eq!(status, 0b111);
    assert_near(increment, -36.0 * 0.0025, 1e-6);
}

fn with_fault(kind: GyroFaultKind) -> World {
    World::new(
        &Scenario {
            gyro: Gyro { faults: vec![GyroFault { kind, from_s: 0.5, to_s: Some(1.0) }], ..Gyro::default() },
            ..Scenario::default()
        },
        1,
    )
}

/// The frames of 600 ticks by the number of the tick in which they were made.
fn frames(world: &World) -> Vec<Vec<u8>> {
    tick(world);
    (0..600).map(|_| tick(world)).collect()
}

/// Ticks that end in the fault's window: 0.5 s is the end of tick 199 (from 0).
const WINDOW: std::ops::Range<usize> = 199..399;

#[test]
fn a_silent_gyro_sends_nothing_and_counts_on() {
    let frames = frames(&with_fault(GyroFaultKind::Silent));
    for (tick, frame) in frames.iter().enumerate() {
        assert_eq!(frame.is_empty(), WINDOW.contains(&tick), "{tick}");
    }
    assert_eq!(usize::from(compact(&frames[399]).0), 399 % 256);
}

#[test]
fn status_bits_tell_of_faults() {
    for (kind, status) in [
        (GyroFaultKind::Invalid, 0b100),
        (GyroFaultKind::Saturated, 0b111),
        (GyroFaultKind::TemperatureInvalid, 0b001),
        (GyroFaultKind::Stuck, 0b101),
    ] {
        for (tick, frame) in frames(&with_fault(kind)).iter().enumerate() {
            assert_eq!(compact(frame).1, if WINDOW.contains(&tick) { status } else { 0b101 }, "{kind:?} {tick}");
        }
    }
}

#[test]
fn a_stuck_gyro_repeats_its_increment() {
    let frames = frames(&with_fault(GyroFaultKind::Stuck));
    assert!(frames[WINDOW].iter().all(|frame| compact(frame).2 == compact(&frames[198]).2));
    assert_ne!(compact(&frames[399]).2, compact(&frames[198]).2);
}

#[test]
fn the_first_frame_takes_its_time() {
    let world = World::new(&scenario(|gyro| gyro.startup_s = 0.1), 1);
    let first = (0..100).find(|_| !tick(&world).is_empty());
    // The frame at 0.1 s, the end of tick 39, is heard in tick 40.
    assert_eq!(first, Some(40));
}
