//! The index drive: follows, rings, slips, sticks.

use crate::common::{drive, drive_to, quiet, tick};
use embedded_hal::digital::OutputPin;
use hal_sim::World;
use hal_sim::scenario::{Motor, Scenario};

fn with(motor: Motor) -> World {
    World::new(&Scenario { motor: Motor { base_reaction_arcsec_per_deg: [0.0; 3], ..motor }, ..quiet() }, 1)
}

#[track_caller]
fn assert_index(world: &World, expected_deg: f64, tolerance_deg: f64) {
    let index_deg = world.truth().index_deg;
    assert!((index_deg - expected_deg).abs() <= tolerance_deg, "{index_deg}°, expected {expected_deg}°");
}

#[test]
fn a_turn_is_36000_microsteps() {
    let world = with(Motor::default());
    drive_to(&world, 36_000, 1.0);
    assert_index(&world, 360.0, 1e-6);
    assert_eq!(world.truth().lost_steps, 0);
}

#[test]
fn it_follows_the_fastest_pulses() {
    let world = with(Motor::default());
    drive(&world, 9000, 1, 1.0);
    assert_index(&world, 90.0, 1e-6);
}

#[test]
fn steps_without_current_do_nothing() {
    let world = with(Motor::default());
    let mut step = world.step_pin();
    for _ in 0..100 {
        step.set_high().expect("pins do not fail");
        step.set_low().expect("pins do not fail");
        world.advance_slot();
    }
    assert_index(&world, 0.0, 0.0);
}

#[test]
fn only_a_rising_edge_is_a_step() {
    let world = with(Motor::default());
    world.enable_pin().set_high().expect("pins do not fail");
    let mut step = world.step_pin();
    for _ in 0..5 {
        step.set_high().expect("pins do not fail");
    }
    for _ in 0..400 {
        tick(&world);
    }
    assert_index(&world, 0.01, 1e-6);
}

#[test]
fn after_the_stop_it_rings_at_its_frequency_and_dies_out() {
    let world = with(Motor { ringing_hz: 8.0, damping: 0.02, kick_deg_s: 1.0, ..Motor::default() });
    drive_to(&world, 100, 0.1);
    let samples: Vec<f64> = (0..800)
        .map(|_| {
            tick(&world);
            world.truth().index_deg - 1.0
        })
        .collect();
    let crossings = samples[..400].windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    assert!((15..=17).contains(&crossings), "8 Hz crosses zero 16 times a second, not {crossings}");
    let peak = |part: &[f64]| part.iter().fold(0.0_f64, |most, sample| most.max(sample.abs()));
    // Over one second the amplitude falls by exp(−0.02 · 2π · 8) = 0.366.
    let ratio = peak(&samples[400..500]) / peak(&samples[..100]);
    assert!((ratio / 0.366 - 1.0).abs() < 0.05, "{ratio}");
}

#[test]
fn a_start_beyond_its_torque_loses_steps() {
    let weak = Motor { max_acceleration_deg_s2: 300.0, ..Motor::default() };
    let world = with(weak.clone());
    drive(&world, 9000, 1, 2.0);
    assert!(world.truth().index_deg < 80.0, "{}", world.truth().index_deg);
    // Slowly it comes along.
    let world = with(weak);
    drive(&world, 1000, 40, 2.0);
    assert_index(&world, 10.0, 1e-6);
}

#[test]
fn a_hard_stop_is_not_passed() {
    let world = with(Motor { hard_stop_deg: Some(20.0), ..Motor::default() });
    drive_to(&world, 3000, 1.0);
    assert!(world.truth().index_deg <= 20.0);
    assert!(world.truth().index_deg > 18.0);
}

#[test]
fn play_is_used_up_before_the_gyro_follows() {
    let world = with(Motor { backlash_deg: 0.5, ..Motor::default() });
    drive_to(&world, 1000, 1.0);
    assert_index(&world, 9.75, 0.03);
    drive_to(&world, -1000, 1.0);
    assert_index(&world, 0.25, 0.03);
}

#[test]
fn lost_steps_are_counted() {
    let world = with(Motor { lose_every: 20, ..Motor::default() });
    drive_to(&world, 9000, 1.0);
    assert_index(&world, 85.5, 1e-6);
    assert_eq!(world.truth().lost_steps, 450);
}

#[test]
fn a_stall_lasts_from_then_to_then() {
    let world = with(Motor { stall_from_s: Some(1.0), stall_to_s: Some(2.0), ..Motor::default() });
    // One step in 2.5 ms: 400 before the stall, 400 in it, 400 after it.
    drive(&world, 1200, 8, 1.0);
    assert_index(&world, 8.0, 0.011);
}

#[test]
fn friction_ends_the_ringing_and_leaves_a_small_error() {
    let world = with(Motor { friction_deg_s2: 200.0, damping: 0.0, ..Motor::default() });
    drive_to(&world, 1000, 2.0);
    let index_deg = world.truth().index_deg;
    tick(&world);
    assert_eq!(world.truth().index_deg, index_deg);
    // It holds where the pull of the field, (2π · 27)² per degree, is below 200 °/s²: within 0.007°.
    assert_index(&world, 10.0, 0.0071);
}

#[test]
fn a_hunting_drive_never_rests() {
    let world = with(Motor { hunting_deg: 0.05, hunting_hz: 1.37, ..Motor::default() });
    tick(&world);
    assert_index(&world, 0.0, 0.0);
    drive_to(&world, 1000, 60.0);
    let (mut least, mut most) = (f64::MAX, f64::MIN);
    for _ in 0..400 {
        tick(&world);
        least = least.min(world.truth().index_deg);
        most = most.max(world.truth().index_deg);
    }
    assert!((most - least - 0.1).abs() < 0.002, "{least} {most}");
}

#[test]
fn the_torque_tilts_the_base_and_lets_it_go() {
    let mut scenario = quiet();
    scenario.motor.base_reaction_arcsec_per_deg = [1000.0, 0.0, 0.0];
    let world = World::new(&scenario, 1);
    drive(&world, 100, 2, 0.0);
    assert!(world.truth().pitch_deg.abs() > 1.0 / 3600.0);
    for _ in 0..800 {
        tick(&world);
    }
    assert_eq!(world.truth().pitch_deg, 0.0);
}

/// 22.5 s at 16 °/s: with a memory of 0.05 s some 225 independent angles, whose rms is known to 1/√450 = 4.7 %; four of that. Then it rests where it is.
#[test]
fn an_uneven_drive_wanders_about_its_steps_while_it_turns() {
    let worlds = [0.02, 0.0].map(|unevenness_deg| with(Motor { unevenness_deg, ..Motor::default() }));
    let off_deg = || worlds[0].truth().index_deg - worlds[1].truth().index_deg;
    let mut pins = worlds.each_ref().map(World::step_pin);
    worlds.iter().for_each(|world| world.enable_pin().set_high().expect("pins do not fail"));
    let mut squares = Vec::new();
    for slot in 0..72_000 {
        for (world, step) in worlds.iter().zip(&mut pins) {
            if slot % 2 == 0 { step.set_high() } else { step.set_low() }.expect("pins do not fail");
            world.advance_slot();
        }
        squares.push(off_deg().powi(2));
    }
    let rms_deg = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((rms_deg / 0.02 - 1.0).abs() < 4.0 * 0.047, "{rms_deg}");
    let wait = || {
        (0..9600).for_each(|_| worlds.iter().for_each(World::advance_slot));
        off_deg()
    };
    let rests_deg = wait();
    assert!(rests_deg != 0.0 && wait() == rests_deg, "{rests_deg}");
}
