//! Whole worlds: repeatability, and that the named scenarios do what their descriptions say.

use crate::common::{TICKS_PER_S, arrived, compact, drive_to, increments, read_encoder_deg, read_g, tick};
use hal_sim::{Scenario, World};

fn named(name: &str) -> World {
    World::new(&Scenario::named(name).unwrap_or_else(|error| panic!("{error}")), 1)
}

/// Everything that the devices say in a short life with a move in it.
fn life(scenario: &Scenario, seed: u64) -> Vec<u8> {
    let world = World::new(scenario, seed);
    let mut bytes = Vec::new();
    for number in 0..800 {
        if number == 400 {
            drive_to(&world, 200, 0.5);
        }
        bytes.extend(tick(&world));
        bytes.extend(read_g(&world).iter().flat_map(|g| g.to_bits().to_le_bytes()));
        bytes.extend(read_encoder_deg(&world).to_bits().to_le_bytes());
    }
    bytes
}

#[test]
fn the_same_scenario_and_seed_give_the_same_bytes() {
    for (name, _) in Scenario::names() {
        let scenario = Scenario::named(name).expect("it is built in");
        assert_eq!(life(&scenario, 11), life(&scenario, 11), "{name}");
        assert_ne!(life(&scenario, 11), life(&scenario, 12), "{name}");
    }
}

#[test]
fn reading_a_sensor_does_not_change_the_gyro() {
    let (quiet, busy) = (named("calm-bench"), named("calm-bench"));
    for _ in 0..800 {
        read_g(&busy);
        read_encoder_deg(&busy);
        assert_eq!(tick(&quiet), tick(&busy));
    }
}

#[test]
fn clones_and_devices_share_one_world() {
    let world = named("calm-bench");
    let other = world.clone();
    tick(&world);
    other.advance_slot();
    assert_eq!(arrived(&world).len(), 14);
    assert_eq!(world.truth(), other.truth());
}

/// 1 s rates, °/h.
fn seconds(world: &World, count: u32) -> Vec<f64> {
    (0..count).map(|_| increments(world, TICKS_PER_S).iter().sum()).collect()
}

/// Longest run of true.
fn longest(flags: impl Iterator<Item = bool>) -> usize {
    flags.fold((0, 0), |(run, most), flag| if flag { (run + 1, most.max(run + 1)) } else { (0, most) }).1
}

/// Differences of the moduli of successive rates beyond the 3 °/h of the jitter gate.
fn jitters(rates: &[f64]) -> Vec<bool> {
    rates.windows(2).map(|pair| (pair[1].abs() - pair[0].abs()).abs() > 3.0).collect()
}

/// Ω cos 34.75°, °/h.
const HORIZONTAL_DEG_H: f64 = 12.358;

#[test]
fn a_calm_bench_is_calm() {
    let world = named("calm-bench");
    tick(&world);
    let rates = seconds(&world, 100);
    assert!(rates.iter().all(|rate| (rate - rates[0]).abs() < 1.0));
}

#[test]
fn disturbances_are_stronger_than_the_earth_and_end_when_they_should() {
    for name in ["disturbed-start", "always-disturbed"] {
        let world = named(name);
        tick(&world);
        let rates = seconds(&world, 40);
        let strong: Vec<bool> = rates.iter().map(|rate| rate.abs() > HORIZONTAL_DEG_H + 2.0).collect();
        assert!(longest(strong[..18].iter().copied()) >= 3, "{name}: {rates:?}");
        let later = longest(strong[22..].iter().copied());
        assert!(if name == "disturbed-start" { later == 0 } else { later >= 3 }, "{name}: {rates:?}");
    }
}

#[test]
fn a_jittery_drive_rings_for_many_seconds_and_then_rests() {
    let world = named("jittery-drive");
    drive_to(&world, 9000, 0.0);
    tick(&world);
    let jitters = jitters(&seconds(&world, 60));
    assert!(longest(jitters[..15].iter().copied()) >= 5, "{jitters:?}");
    assert_eq!(longest(jitters[30..].iter().copied()), 0, "{jitters:?}");
}

#[test]
fn an_endless_jitter_does_not_rest() {
    let world = named("endless-jitter");
    drive_to(&world, 9000, 0.0);
    tick(&world);
    let jitters = jitters(&seconds(&world, 300));
    assert!(longest(jitters.iter().map(|jitter| !jitter)) < 5, "{jitters:?}");
}

#[test]
fn gusts_and_shocks_pass_the_jitter_gate() {
    for name in ["windy-tripod", "shocks-during-dwell", "creep", "warm-up", "drift"] {
        let world = named(name);
        tick(&world);
        let jitters = jitters(&seconds(&world, 240));
        assert!(longest(jitters.iter().copied()) < 5, "{name}");
        assert!(longest(jitters.iter().map(|jitter| !jitter)) > 20, "{name}");
    }
}

#[test]
fn lossy_and_noisy_lines_differ() {
    let good = |world: &World| {
        let bytes: Vec<u8> = (0..4000).flat_map(|_| tick(world)).collect();
        bytes
            .windows(14)
            .filter(|frame| frame[..2] == [0xA5, 0x5A])
            .filter(|frame| hal_sim::frames::crc32(&frame[..10]).to_le_bytes() == frame[10..])
            .count()
    };
    let lossy = good(&named("lossy-link"));
    assert!((3900..3999).contains(&lossy), "{lossy}");
    let noisy = good(&named("noisy-link"));
    assert!(noisy < 1500, "{noisy}");
}

#[test]
fn drives_fail_as_they_should() {
    for (name, expected_deg) in
        [("stalled-motor", 0.0), ("wrong-angle", 60.0), ("lost-steps", 85.5), ("calm-bench", 90.0)]
    {
        let world = named(name);
        drive_to(&world, 9000, 1.0);
        assert!((world.truth().index_deg - expected_deg).abs() < 1e-3, "{name}");
        // Noise, eccentricity and rounding of the encoder.
        assert!((read_encoder_deg(&world) - expected_deg + 180.0).rem_euclid(360.0) - 180.0 < 0.15, "{name}");
    }
}

#[test]
fn levelling_ends_level() {
    let world = named("levelled-late");
    assert!(world.truth().pitch_deg > 2.9);
    (0..22 * TICKS_PER_S).for_each(|_| drop(tick(&world)));
    assert!((world.truth().pitch_deg - 0.04).abs() < 1e-9);
    assert!((world.truth().roll_deg - 0.06).abs() < 1e-9);
}

#[test]
fn the_kvh_scenario_sends_kvh_frames() {
    let world = named("kvh-gyro");
    tick(&world);
    let bytes = tick(&world);
    assert_eq!((bytes.len(), &bytes[..4]), (36, &[0xFE, 0x81, 0xFF, 0x55][..]));
    let compact_world = named("calm-bench");
    tick(&compact_world);
    let (_, _, arcsec, _) = compact(&tick(&compact_world));
    let radians = f64::from(f32::from_be_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]));
    assert!((radians.to_degrees() * 3600.0 - arcsec).abs() < 1e-8, "the same gyro in another format");
}
