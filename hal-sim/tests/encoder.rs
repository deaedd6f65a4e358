//! The encoder at register level, against the AS5048A data sheet.

use crate::common::{quiet, tick};
use embedded_hal::spi::SpiDevice;
use hal_sim::World;
use hal_sim::scenario::{Encoder, Scenario, SensorFault, SensorFaultKind};

const READ_ANGLE: u16 = 0xFFFF;
const READ_MAGNITUDE: u16 = 0x7FFE;
const READ_DIAGNOSTICS: u16 = 0x7FFD;
const CLEAR_ERROR: u16 = 0x4001;
const NOP: u16 = 0x0000;
const ERROR: u16 = 0x4000;

/// One frame; checks the parity of the answer.
fn frame(world: &World, command: u16) -> u16 {
    let mut bytes = command.to_be_bytes();
    world.encoder().transfer_in_place(&mut bytes).expect("never fails");
    let answer = u16::from_be_bytes(bytes);
    assert_eq!(answer.count_ones() % 2, 0, "{answer:04X} has odd parity");
    answer & 0x7FFF
}

fn at(index_deg: f64) -> Scenario {
    let mut scenario = quiet();
    scenario.motor.start_deg = index_deg;
    scenario
}

fn angle_deg(world: &World) -> f64 {
    frame(world, READ_ANGLE);
    f64::from(frame(world, NOP)) * 360.0 / 16_384.0
}

#[test]
fn the_answer_comes_in_the_next_frame() {
    let world = World::new(&at(90.0), 1);
    assert_eq!(frame(&world, READ_ANGLE), 0);
    assert_eq!(frame(&world, READ_MAGNITUDE), 4096);
    assert_eq!(frame(&world, READ_DIAGNOSTICS), 0x1000);
    assert_eq!(frame(&world, NOP), 0x017F);
    assert_eq!(frame(&world, NOP), 0);
}

#[test]
fn angles_count_counter_clockwise_and_wrap() {
    for (index_deg, counts) in [(0.0, 0), (90.0, 4096), (-90.0, 12_288), (359.995, 0), (450.0, 4096), (0.022, 1)] {
        let world = World::new(&at(index_deg), 1);
        frame(&world, READ_ANGLE);
        assert_eq!(frame(&world, NOP), counts, "{index_deg}°");
    }
}

#[test]
fn a_frame_with_odd_parity_raises_the_error_flag_until_it_is_cleared() {
    let world = World::new(&at(90.0), 1);
    frame(&world, READ_ANGLE ^ 0x8000);
    assert_eq!(frame(&world, READ_ANGLE), ERROR);
    assert_eq!(frame(&world, CLEAR_ERROR), ERROR | 4096);
    // The error register: bit 2, parity. Reading it clears it.
    assert_eq!(frame(&world, READ_ANGLE), 0b100);
    assert_eq!(frame(&world, NOP), 4096);
}

#[test]
fn unknown_registers_and_wrong_lengths_are_errors() {
    let world = World::new(&at(0.0), 1);
    frame(&world, 0x4005 | 0x8000);
    frame(&world, CLEAR_ERROR);
    assert_eq!(frame(&world, NOP), 0b010);
    world.encoder().write(&[0xFF, 0xFF, 0x00]).expect("never fails");
    frame(&world, CLEAR_ERROR);
    assert_eq!(frame(&world, NOP), 0b001);
}

#[test]
fn the_zero_position_can_be_written() {
    let world = World::new(&at(90.0), 1);
    // 1000 counts = 15 · 64 + 40. The data frames need even parity too.
    for (register, data) in [(0x0016, 15), (0x0017, 40)] {
        frame(&world, register | if u16::count_ones(register) % 2 == 1 { 0x8000 } else { 0 });
        frame(&world, data);
    }
    frame(&world, READ_ANGLE);
    assert_eq!(frame(&world, NOP), 4096 - 1000);
}

fn reading(errors: Encoder, index_deg: f64) -> f64 {
    let mut scenario = at(index_deg);
    scenario.encoder = errors;
    angle_deg(&World::new(&scenario, 1))
}

#[test]
fn errors_have_their_signs() {
    let none = Encoder { noise_deg: 0.0, eccentricity_deg: 0.0, ..Encoder::default() };
    let half_step = 0.5 * 360.0 / 16_384.0;
    let near = |found: f64, expected: f64| assert!((found - expected).abs() <= half_step, "{found} {expected}");
    near(reading(Encoder { zero_deg: 5.0, ..none.clone() }, 90.0), 95.0);
    let eccentric = Encoder { eccentricity_deg: 2.0, eccentricity_at_deg: 30.0, ..none.clone() };
    near(reading(eccentric.clone(), 30.0), 32.0);
    near(reading(eccentric.clone(), 90.0), 91.0);
    near(reading(eccentric, 210.0), 208.0);
    near(reading(Encoder { slip_deg: 3.0, ..none }, 10.0), 13.0);
}

#[test]
fn a_weak_magnet_shows_in_the_diagnostics() {
    let mut scenario = at(0.0);
    scenario.encoder.weak_magnet = true;
    let world = World::new(&scenario, 1);
    frame(&world, READ_DIAGNOSTICS);
    assert_eq!(frame(&world, NOP), 1 << 11 | 1 << 8 | 0xFF);
}

#[test]
fn noise_has_its_size() {
    let mut scenario = at(100.0);
    scenario.encoder.noise_deg = 0.5;
    let world = World::new(&scenario, 1);
    let count = 4000;
    let variance = (0..count).map(|_| (angle_deg(&world) - 100.0).powi(2)).sum::<f64>() / f64::from(count);
    let ratio = variance / 0.25;
    assert!((ratio - 1.0).abs() < 5.0 * (2.0 / f64::from(count)).sqrt(), "{ratio}");
}

#[test]
fn a_stuck_encoder_keeps_its_angle_and_a_broken_bus_reads_its_level() {
    let mut scenario = at(90.0);
    scenario.encoder.noise_deg = 0.5;
    scenario.encoder.faults = vec![SensorFault { kind: SensorFaultKind::Stuck, from_s: 0.01, to_s: None }];
    let world = World::new(&scenario, 1);
    let before = angle_deg(&world);
    for _ in 0..4 {
        tick(&world);
    }
    assert_eq!(angle_deg(&world), before);
    scenario.encoder.faults[0].kind = SensorFaultKind::BusHigh;
    scenario.encoder.faults[0].from_s = 0.0;
    assert_eq!(World::new(&scenario, 1).encoder().exchange(&[0xFF, 0xFF]), [0xFF, 0xFF]);
}
