//! The serial line: time on the wire and everything that can happen to a byte.

use crate::common::{arrived, compact, quiet, tick};
use embedded_io::{Read, ReadReady};
use hal_sim::World;
use hal_sim::scenario::{LinkFault, LinkFaultKind, Scenario};

fn with(fault: LinkFault) -> World {
    let mut scenario = quiet();
    scenario.link.faults = vec![fault];
    World::new(&scenario, 7)
}

/// All bytes of some ticks.
fn bytes_of(world: &World, ticks: u32) -> Vec<u8> {
    (0..ticks).flat_map(|_| tick(world)).collect()
}

#[test]
fn a_frame_takes_its_time_on_the_wire() {
    let world = World::new(&quiet(), 1);
    assert_eq!(tick(&world), []);
    assert!(!world.gyro().read_ready().expect("never fails"));
    // 14 bytes of 10 bits at 921600 baud take 152 µs: they are there one slot later.
    world.advance_slot();
    assert!(world.gyro().read_ready().expect("never fails"));
    assert_eq!(arrived(&world).len(), 14);

    let mut slow = quiet();
    slow.link.baud = 57_600;
    let world = World::new(&slow, 1);
    tick(&world);
    world.advance_slot();
    // 312.5 µs at 5760 bytes a second.
    assert_eq!(arrived(&world).len(), 1);
}

#[test]
fn bytes_come_in_order_and_in_pieces() {
    let world = World::new(&quiet(), 1);
    tick(&world);
    world.advance_slot();
    let mut frame = Vec::new();
    let mut piece = [0; 5];
    while world.gyro().read_ready().expect("never fails") {
        let count = world.gyro().read(&mut piece).expect("never fails");
        frame.extend_from_slice(&piece[..count]);
    }
    assert_eq!(compact(&frame).0, 0);
}

#[test]
fn a_clean_line_is_clean() {
    let world = World::new(&Scenario::default(), 1);
    let bytes = bytes_of(&world, 1001);
    assert_eq!(bytes.len(), 14 * 1000);
    for (number, frame) in bytes.chunks(14).enumerate() {
        assert_eq!(usize::from(compact(frame).0), number % 256);
    }
}

/// How often a fault of probability p begins in n bytes: mean p·n, five standard deviations of a binomial.
#[track_caller]
fn assert_binomial(hits: usize, bytes: usize, probability: f64) {
    let mean = bytes as f64 * probability;
    let spread = 5.0 * (mean * (1.0 - probability)).sqrt();
    assert!((hits as f64 - mean).abs() < spread, "{hits} hits, expected {mean} ± {spread}");
}

#[test]
fn bytes_are_dropped_as_often_as_said() {
    let world = with(LinkFault { kind: LinkFaultKind::Drop, probability: 0.01, ..LinkFault::default() });
    let sent = 14 * 10_000;
    assert_binomial(sent - bytes_of(&world, 10_001).len(), sent, 0.01);
}

#[test]
fn bytes_are_doubled_as_often_as_said() {
    let world = with(LinkFault { kind: LinkFaultKind::Duplicate, probability: 0.01, ..LinkFault::default() });
    let sent = 14 * 10_000;
    assert_binomial(bytes_of(&world, 10_001).len() - sent, sent, 0.01);
}

#[test]
fn flips_change_one_bit() {
    let clean = bytes_of(&World::new(&quiet(), 7), 10_001);
    let world = with(LinkFault { kind: LinkFaultKind::Flip, probability: 0.01, ..LinkFault::default() });
    let flipped = bytes_of(&world, 10_001);
    assert_eq!(clean.len(), flipped.len());
    let hits = clean.iter().zip(&flipped).filter(|(a, b)| a != b).count();
    assert!(clean.iter().zip(&flipped).all(|(a, b)| (a ^ b).count_ones() <= 1));
    assert_binomial(hits, clean.len(), 0.01);
}

#[test]
fn a_burst_spoils_a_run_of_bytes() {
    let clean = bytes_of(&World::new(&quiet(), 7), 2001);
    let fault = LinkFault { kind: LinkFaultKind::Burst, probability: 1e-4, bytes: 100, ..LinkFault::default() };
    let spoilt = bytes_of(&with(fault), 2001);
    assert_eq!(clean.len(), spoilt.len());
    let first = clean.iter().zip(&spoilt).position(|(a, b)| a != b).expect("there was a burst");
    let changed = (first..first + 100).filter(|at| clean[*at] != spoilt[*at]).count();
    // A random byte is right one time in 256.
    assert!(changed > 90, "{changed}");
}

#[test]
fn a_delay_holds_up_everything_behind_it_and_loses_nothing() {
    let fault = LinkFault {
        kind: LinkFaultKind::Delay,
        probability: 1e-3,
        delay_s: 0.02,
        to_s: Some(0.5),
        ..LinkFault::default()
    };
    let world = with(fault);
    let counts: Vec<usize> = (0..1000).map(|_| tick(&world).len()).collect();
    assert!(counts[1..].contains(&0), "some tick got nothing");
    assert!(counts.iter().any(|count| *count > 14), "some tick got more");
    assert_eq!(counts.iter().sum::<usize>(), 14 * 999);
}

#[test]
fn faults_keep_to_their_window() {
    let fault =
        LinkFault { kind: LinkFaultKind::Drop, probability: 1.0, from_s: 0.5, to_s: Some(1.0), ..LinkFault::default() };
    let world = with(fault);
    let heard: Vec<bool> = (0..600).map(|_| !tick(&world).is_empty()).collect();
    // Frame k is sent at the end of tick k and heard in the next: silence from 0.5 s, tick 200.
    assert_eq!(heard.iter().position(|heard| !heard), Some(0));
    assert_eq!((1..600).find(|tick| !heard[*tick]), Some(200));
    assert_eq!((201..600).find(|tick| heard[*tick]), Some(400));
}
