//! The block that is carried: what it feels where it stands, the signs on its way, and what its bus says.

use crate::common::{quiet, tick};
use hal_sim::World;
use hal_sim::block::{BlockSample, CarriedBlock};
use hal_sim::scenario::{Block, Carry, Scenario, SensorFault, SensorFaultKind};

fn perfect() -> Block {
    Block {
        arw_deg_per_sqrt_h: 0.0,
        run_to_run_deg_h: 0.0,
        markov_deg_h: 0.0,
        scale_ppm: 0.0,
        misalignment_arcsec: 0.0,
        accelerometer_m_s2: 0.0,
        vrw_m_s_per_sqrt_s: 0.0,
        ..Block::default()
    }
}

fn to_the_south() -> Carry {
    Carry { wait_s: 1.0, walk_s: 20.0, stand_s: 1.0, turn_deg: 90.0, set_down_deg: [30.0, 0.0], ..Carry::default() }
}

/// Lifted with its mark east, at 60°.
fn carried(errors: &Block, seed: u64) -> CarriedBlock {
    CarriedBlock::new(60.0, 90.0, &to_the_south(), errors, seed)
}

#[test]
fn a_block_feels_the_earth_and_its_turn() {
    let samples: Vec<BlockSample> = carried(&perfect(), 1).collect();
    assert_eq!(samples.len(), 2200);
    // Mark east at 60°: y points north, 15.0411 cos 60° = 7.5205 arcsec/s; z up, 13.0260.
    let arcsec = samples[50].angle_rad.map(|rad| rad.to_degrees() * 360_000.0);
    assert!(arcsec[0].abs() < 1e-6 && (arcsec[1] - 7.5205).abs() < 1e-3 && (arcsec[2] - 13.0260).abs() < 1e-3);
    assert!((samples[50].velocity_m_s[2] - 0.0980665).abs() < 1e-9);
    // Turned clockwise to south, nose up by 30°: x feels g/2.
    let last = samples[2199];
    assert!((last.heading_deg - 180.0).abs() < 1e-9 && (last.pitch_deg - 30.0).abs() < 1e-9, "{last:?}");
    assert!((last.velocity_m_s[0] - 0.5 * 0.0980665).abs() < 1e-9 && last.velocity_m_s[1].abs() < 1e-9);
    // Clockwise is negative about up: the z gyro sums up to nearly −90°.
    let turned: f64 = samples.iter().map(|sample| sample.angle_rad[2].to_degrees()).sum();
    assert!((-95.0..-70.0).contains(&turned), "{turned}");
}

#[test]
fn a_run_draws_its_errors() {
    let errors = Block { run_to_run_deg_h: 10.0, ..perfect() };
    // Variance of 200 draws of three axes: 600 degrees of freedom, relative sigma of the root 2.9 %.
    let squares: f64 = (0..200)
        .map(|seed| {
            let first = |errors| carried(errors, seed).next().unwrap().angle_rad;
            let (with, without) = (first(&errors), first(&perfect()));
            (0..3).map(|axis| ((with[axis] - without[axis]).to_degrees() * 360_000.0).powi(2)).sum::<f64>()
        })
        .sum();
    assert!(((squares / 600.0).sqrt() / 10.0 - 1.0).abs() < 0.1);
}

/// An instrument with a block, mark east at 60°, that is carried to the south.
fn instrument(block: Block) -> World {
    let mut scenario: Scenario = quiet();
    scenario.site.latitude_deg = 60.0;
    scenario.site.azimuth_deg = 90.0;
    scenario.block = Some(block);
    scenario.carry = Some(to_the_south());
    World::new(&scenario, 1)
}

/// What the next frame answers to a read, after writes of a byte each.
fn registers(world: &World, writes: &[(u8, u8)], read: u8) -> u16 {
    let mut spi = world.block();
    for &(address, value) in writes {
        spi.exchange(&[0x80 | address, value]);
    }
    spi.exchange(&[read, 0]);
    u16::from_be_bytes(spi.exchange(&[0, 0]).try_into().unwrap())
}

/// Increments of 32 bits at 100 Hz, in step with the pulse.
fn configure(world: &World) {
    let writes = [(0x62, 20), (0x63, 0), (0x64, 19), (0x65, 0), (0x60, 0xC9), (0x61, 0x03)];
    assert_eq!(registers(world, &writes, 0x60), 0x03C9);
}

/// A burst: angles in degrees of ±720, velocities in m/s of ±100, the number.
fn burst(world: &World) -> ([f64; 3], [f64; 3], u16) {
    let mut mosi = [0; 34];
    mosi[0] = 0x68;
    let bytes = world.block().exchange(&mosi);
    let words: Vec<u16> = bytes[2..].chunks(2).map(|word| u16::from_be_bytes([word[0], word[1]])).collect();
    let sum: u32 = bytes[2..32].iter().map(|&byte| u32::from(byte)).sum();
    assert_eq!(u32::from(words[15]), sum);
    let value = |at: usize, full: f64| {
        f64::from((u32::from(words[at + 1]) << 16 | u32::from(words[at])).cast_signed()) / 2_f64.powi(31) * full
    };
    ([1, 3, 5].map(|at| value(at, 720.0)), [7, 9, 11].map(|at| value(at, 100.0)), words[14])
}

#[test]
fn the_bus_says_what_the_block_feels_on_its_way() {
    let world = instrument(perfect());
    (0..200).for_each(|_| drop(tick(&world)));
    assert_eq!(registers(&world, &[], 0x72), 16505);
    assert_eq!(registers(&world, &[], 0x5E), 7);
    configure(&world);
    (0..4).for_each(|_| drop(tick(&world)));
    let (_, _, first) = burst(&world);
    (0..4).for_each(|_| drop(tick(&world)));
    // As above: 7.5205 and 13.0260 arcsec/s in 10 ms; one count is 0.0012 arcsec.
    let (angle, velocity, number) = burst(&world);
    let arcsec = angle.map(|deg| deg * 360_000.0);
    assert_eq!(number, first + 1);
    assert!(arcsec[0].abs() < 0.13 && (arcsec[1] - 7.5205).abs() < 0.13 && (arcsec[2] - 13.0260).abs() < 0.13);
    assert!((velocity[2] - 0.0980665).abs() < 1e-7, "{velocity:?}");

    let end_s = world.carry().unwrap();
    assert!((end_s - world.truth().t_s - 22.0).abs() < 1e-9);
    let mut turned = 0.0;
    while world.truth().t_s < end_s {
        (0..4).for_each(|_| drop(tick(&world)));
        turned += burst(&world).0[2];
    }
    let truth = world.truth();
    assert!((truth.azimuth_deg - 180.0).abs() < 1e-9 && (truth.pitch_deg - 30.0).abs() < 1e-9, "{truth:?}");
    assert!((-95.0..-70.0).contains(&turned), "{turned}");
    assert!((burst(&world).1[0] - 0.5 * 0.0980665).abs() < 1e-7);
    let carried = (22.0_f64 / 0.01) as u16;
    assert!(burst(&world).2.abs_diff(number + carried) <= 1);
}

#[test]
fn a_block_that_starts_or_is_cut_off_answers_nothing() {
    let faults = vec![SensorFault { kind: SensorFaultKind::BusLow, from_s: 0.5, to_s: Some(0.6) }];
    let world = instrument(Block { faults, ..perfect() });
    assert_eq!(registers(&world, &[], 0x72), 0xFFFF);
    (0..130).for_each(|_| drop(tick(&world)));
    assert_eq!(registers(&world, &[], 0x72), 16505);
    (0..80).for_each(|_| drop(tick(&world)));
    assert_eq!(registers(&world, &[], 0x72), 0);
    let none = World::new(&quiet(), 1);
    assert_eq!(registers(&none, &[], 0x72), 0xFFFF);
    assert_eq!(none.carry(), None);
}

/// From 0.61 to 0.80 s the number stands still; the sample after that is of its own 10 ms alone, 7.5205 arcsec about y.
#[test]
fn what_a_stuck_block_feels_is_lost() {
    let faults = vec![SensorFault { kind: SensorFaultKind::Stuck, from_s: 0.603, to_s: Some(0.803) }];
    let world = instrument(Block { faults, ..perfect() });
    (0..200).for_each(|_| drop(tick(&world)));
    configure(&world);
    (0..44).for_each(|_| drop(tick(&world)));
    let (_, _, stuck) = burst(&world);
    (0..76).for_each(|_| drop(tick(&world)));
    assert_eq!(burst(&world).2, stuck);
    (0..6).for_each(|_| drop(tick(&world)));
    let (angle, velocity, number) = burst(&world);
    assert_eq!(number, stuck + 1);
    assert!((360_000.0 * angle[1] - 7.5205).abs() < 0.13, "{angle:?}");
    assert!((velocity[2] - 0.0980665).abs() < 1e-7, "{velocity:?}");
}

#[test]
fn a_fast_turn_saturates() {
    // 3600° in 10 s is a mean of 360 °/s; in the middle of the smooth way 1.875 times that.
    let carry = Carry { turn_deg: 3600.0, walk_s: 10.0, wait_s: 0.0, ..Carry::default() };
    let most = CarriedBlock::new(60.0, 0.0, &carry, &perfect(), 1)
        .fold(0.0, |most: f64, sample| most.max(sample.angle_rad[2].abs()));
    assert!((most.to_degrees() - 4.10).abs() < 1e-9, "{most}");
}
