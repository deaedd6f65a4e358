//! The accelerometer at register level, against the ADXL355 data sheet.

use crate::common::{quiet, read_g, tick};
use embedded_hal::spi::{Operation, SpiDevice};
use hal_sim::World;
use hal_sim::scenario::{Scenario, SensorFault, SensorFaultKind};

const STATUS: u8 = 0x04;
const TEMP2: u8 = 0x06;
const XDATA3: u8 = 0x08;
const FILTER: u8 = 0x28;
const RANGE: u8 = 0x2C;
const POWER_CTL: u8 = 0x2D;
const RESET: u8 = 0x2F;

fn read(world: &World, address: u8, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    let mut spi = world.accelerometer();
    spi.transaction(&mut [Operation::Write(&[address << 1 | 1]), Operation::Read(&mut bytes)]).expect("never fails");
    bytes
}

fn write(world: &World, address: u8, value: u8) {
    world.accelerometer().write(&[address << 1, value]).expect("never fails");
}

fn x_counts(world: &World) -> i32 {
    let bytes = read(world, XDATA3, 3);
    i32::from_be_bytes([bytes[0], bytes[1], bytes[2], 0]) >> 12
}

fn nose_up(degrees: f64) -> Scenario {
    let mut scenario = quiet();
    scenario.base.pitch_deg = degrees;
    scenario
}

#[test]
fn it_identifies_itself() {
    let world = World::new(&quiet(), 1);
    assert_eq!(read(&world, 0x00, 3), [0xAD, 0x1D, 0xED]);
    assert_eq!(read(&world, RANGE, 2), [0x81, 0x01]);
}

#[test]
fn one_transaction_can_be_written_in_several_ways() {
    let world = World::new(&quiet(), 1);
    let mut spi = world.accelerometer();
    let mut in_place = [0x01, 0, 0];
    spi.transfer_in_place(&mut in_place).expect("never fails");
    assert_eq!(in_place, [0, 0xAD, 0x1D]);
    let mut short = [0; 2];
    spi.transfer(&mut short, &[0x01, 0, 0, 0]).expect("never fails");
    assert_eq!(short, [0, 0xAD]);
    let mut long = [0; 4];
    spi.transfer(&mut long, &[0x01]).expect("never fails");
    assert_eq!(long, [0, 0xAD, 0x1D, 0xED]);
    let (mut first, mut second) = ([0; 1], [0; 2]);
    spi.transaction(&mut [
        Operation::Write(&[0x01]),
        Operation::Read(&mut first),
        Operation::DelayNs(1000),
        Operation::Read(&mut second),
    ])
    .expect("never fails");
    assert_eq!((first, second), ([0xAD], [0x1D, 0xED]));
}

#[test]
fn it_sleeps_until_it_is_told_to_measure() {
    let world = World::new(&nose_up(5.0), 1);
    for _ in 0..10 {
        tick(&world);
    }
    assert_eq!(read(&world, STATUS, 1), [0]);
    assert_eq!(read(&world, XDATA3, 9), [0; 9]);
    write(&world, POWER_CTL, 0x00);
    assert_eq!(read(&world, STATUS, 1), [1]);
    // sin 5° · 256000 = 22311.9.
    assert_eq!(x_counts(&world), 22_312);
}

#[test]
fn data_ready_is_cleared_by_reading_and_set_by_the_next_sample() {
    let world = World::new(&quiet(), 1);
    write(&world, FILTER, 0x05);
    write(&world, POWER_CTL, 0x00);
    read(&world, XDATA3, 9);
    assert_eq!(read(&world, STATUS, 1), [0]);
    // 125 Hz is 8 ms: not after 5 ms, but after 10.
    tick(&world);
    tick(&world);
    assert_eq!(read(&world, STATUS, 1), [0]);
    tick(&world);
    tick(&world);
    assert_eq!(read(&world, STATUS, 1), [1]);
}

#[test]
fn ranges_scale_the_counts_and_clip() {
    for (range, counts) in [(0x81, 128_000), (0x82, 64_000), (0x83, 32_000)] {
        let world = World::new(&nose_up(30.0), 1);
        write(&world, RANGE, range);
        write(&world, POWER_CTL, 0x00);
        assert_eq!(x_counts(&world), counts);
    }
    let mut scenario = nose_up(-30.0);
    scenario.accelerometer.scale_ppm = [100_000.0; 3];
    scenario.accelerometer.bias_mg = [-500.0; 3];
    let world = World::new(&scenario, 1);
    write(&world, POWER_CTL, 0x00);
    assert_eq!(x_counts(&world), ((-0.5 * 1.1 - 0.5) * 256_000.0) as i32);
}

#[test]
fn reset_takes_its_code_only_and_puts_it_to_sleep() {
    let world = World::new(&quiet(), 1);
    write(&world, POWER_CTL, 0x00);
    write(&world, FILTER, 0x05);
    write(&world, RESET, 0x51);
    assert_eq!(read(&world, FILTER, 1), [0x05]);
    write(&world, RESET, 0x52);
    assert_eq!(read(&world, FILTER, 1), [0x00]);
    assert_eq!(read(&world, POWER_CTL, 1), [0x01]);
}

#[test]
fn read_only_registers_stay() {
    let world = World::new(&quiet(), 1);
    write(&world, 0x00, 0x00);
    assert_eq!(read(&world, 0x00, 1), [0xAD]);
    assert_eq!(read(&world, 0x60, 1), [0]);
}

#[test]
fn temperature_is_1885_at_25_degrees_and_falls_9_05_a_kelvin() {
    let mut scenario = quiet();
    scenario.site.ambient_c = 45.0;
    let world = World::new(&scenario, 1);
    write(&world, POWER_CTL, 0x00);
    let bytes = read(&world, TEMP2, 2);
    assert_eq!(u16::from_be_bytes([bytes[0], bytes[1]]), 1885 - 181);
}

#[test]
fn errors_have_their_signs() {
    let mut scenario = nose_up(30.0);
    let errors = &mut scenario.accelerometer;
    errors.bias_mg = [10.0, -20.0, 0.0];
    errors.scale_ppm = [1000.0, 0.0, -1000.0];
    errors.bias_mg_per_k = [1.0, 0.0, 0.0];
    errors.cross_axis_ppm = [0.0, 2000.0, 3000.0];
    scenario.site.ambient_c = 25.0;
    let z = 0.866_025_404;
    let [ax, ay, az] = read_g(&World::new(&scenario, 1));
    assert!((ax - (0.5 * 1.001 + 0.002 * z + 0.010 + 0.005)).abs() < 4e-6, "{ax}");
    assert!((ay - (0.003 * z - 0.020)).abs() < 4e-6, "{ay}");
    assert!((az - (z * 0.999 - 0.002 * 0.5)).abs() < 4e-6, "{az}");
}

#[test]
fn noise_follows_density_and_bandwidth() {
    let mut scenario = quiet();
    scenario.accelerometer.noise_ug_per_sqrt_hz = 22.5;
    let world = World::new(&scenario, 1);
    write(&world, FILTER, 0x05);
    write(&world, POWER_CTL, 0x00);
    let count = 4000;
    let mut sum_of_squares = 0.0;
    for _ in 0..count {
        for _ in 0..4 {
            tick(&world);
        }
        let x_g = f64::from(x_counts(&world)) / 256_000.0;
        sum_of_squares += x_g * x_g;
    }
    // 22.5 µg/√Hz over 31.25 Hz, and the rounding of the counts. A variance from n samples scatters by √(2/n).
    let expected = (22.5e-6_f64).powi(2) * 31.25 + (1.0_f64 / 256_000.0).powi(2) / 12.0;
    let ratio = sum_of_squares / f64::from(count) / expected;
    assert!((ratio - 1.0).abs() < 5.0 * (2.0 / f64::from(count)).sqrt(), "{ratio}");
}

#[test]
fn a_stuck_sensor_repeats_and_a_broken_bus_reads_its_level() {
    for (kind, expected) in [(SensorFaultKind::BusHigh, 0xFF), (SensorFaultKind::BusLow, 0x00)] {
        let mut scenario = quiet();
        scenario.accelerometer.faults = vec![SensorFault { kind, from_s: 0.0, to_s: Some(0.01) }];
        let world = World::new(&scenario, 1);
        assert_eq!(read(&world, 0x00, 3), [expected; 3]);
        for _ in 0..4 {
            tick(&world);
        }
        assert_eq!(read(&world, 0x00, 3), [0xAD, 0x1D, 0xED]);
    }
    let mut scenario = Scenario::default();
    scenario.accelerometer.faults = vec![SensorFault { kind: SensorFaultKind::Stuck, from_s: 0.05, to_s: None }];
    let world = World::new(&scenario, 1);
    let readings: Vec<_> = (0..100)
        .map(|_| {
            (0..4).for_each(|_| drop(tick(&world)));
            read_g(&world)
        })
        .collect();
    assert_ne!(readings[0], readings[1]);
    assert!(readings[5..].iter().all(|reading| *reading == readings[5]));
}

/// ST1 alone does nothing; with ST2 the force acts, in the range that is set: z's 2.5 g are beyond ±2.048 g and within ±8.192 g.
#[test]
fn the_test_force_moves_the_readings() {
    const SELF_TEST: u8 = 0x2E;
    let world = World::new(&quiet(), 1);
    let axes = |range: u8, test: u8| {
        write(&world, POWER_CTL, 1);
        write(&world, RANGE, range);
        write(&world, SELF_TEST, test);
        write(&world, POWER_CTL, 0);
        (0..8).for_each(|_| drop(tick(&world)));
        let bytes = read(&world, XDATA3, 9);
        [0, 3, 6].map(|at| i32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], 0]) >> 12)
    };
    assert_eq!(axes(0x81, 0b01), [0, 0, 256_000]);
    // 0.3 g, 0.3 g, 1 g + 1.5 g: the last is as far as the range goes.
    assert_eq!(axes(0x81, 0b11), [76_800, 76_800, 524_287]);
    assert_eq!(axes(0x83, 0b11), [19_200, 19_200, 160_000]);
    assert_eq!(axes(0x83, 0b00), [0, 0, 64_000]);
}
