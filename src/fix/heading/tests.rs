extern crate std;
use std::vec::Vec;

use super::*;
use crate::drivers::adis16505::Range;
use crate::health::Flags;

/// At 60°: level, mark north, sigma 0.04°.
fn keeper() -> Keeper {
    let mut keeper = Keeper::new(&BlockSettings::default(), 60.0, 0.01);
    keeper.fixed(&Fix {
        azimuth_deg: 0.0,
        sigma_deg: 0.04,
        closure_deg_h: None,
        closure_sigma_deg_h: None,
        chi_square: 0.0,
        degrees_of_freedom: 0,
        bias_deg_h: 0.0,
        amplitude_deg_h: 7.5205,
        drift_deg_h_per_h: 0.0,
        tilt: Some(Tilt { pitch_deg: 0.0, roll_deg: 0.0 }),
        seconds: 240.0,
        flags: Flags::default(),
    });
    keeper
}

/// What the block for ±125 °/s reads in 10 ms: x north feels 7.5205 arcsec/s, z 13.0260; it turns counter-clockwise at `turn_deg_s`.
fn sample(turn_deg_s: f64, missed: u16) -> Increments {
    // 2³¹ counts are 360° and 100 m/s.
    let counts = |arcsec_s: f64| (arcsec_s * 0.01 / 1_296_000.0 * 2_147_483_648.0).round() as i32;
    Increments {
        angle: [counts(7.5205), 0, counts(13.0260 + 3600.0 * turn_deg_s)],
        velocity: [0, 0, 2_104_534],
        range: Range::Low,
        temperature: 250,
        missed,
    }
}

#[test]
fn once_a_second_the_heading_comes_with_its_sigma() {
    let (mut keeper, mut counters) = (keeper(), Counters::default());
    let headings: Vec<Heading> = (0..250).filter_map(|_| keeper.push(Some(&sample(0.0, 0)), &mut counters)).collect();
    assert_eq!(headings.len(), 2);
    assert!(headings.iter().all(|heading| heading.motion == Motion::Standing && !heading.refix));
    assert!((headings[1].sigma_deg - 0.04).abs() < 1e-3 && headings[1].sigma_level_deg > 0.0, "{headings:?}");
    assert_eq!(counters, Counters::default());
}

#[test]
fn without_a_fix_there_is_no_heading() {
    let mut keeper = Keeper::new(&BlockSettings::default(), 60.0, 0.01);
    assert!((0..200).all(|_| keeper.push(Some(&sample(0.0, 0)), &mut Counters::default()).is_none()));
}

#[test]
fn a_sample_that_is_missing_widens_sigma_by_what_a_hand_can_do() {
    // It turned at 2 °/s; in 10 ms it turns 0.02°, and by 500 °/s² half of 0.05° more: 0.045° beside 0.04°.
    let (mut keeper, mut counters) = (keeper(), Counters::default());
    let before = (0..50).filter_map(|_| keeper.push(Some(&sample(2.0, 0)), &mut counters)).count();
    assert_eq!(before, 0);
    let headings: Vec<Heading> =
        (0..100).filter_map(|number| keeper.push(Some(&sample(2.0, u16::from(number == 10))), &mut counters)).collect();
    assert_eq!(counters.block_missed, 1);
    assert!((headings[0].sigma_deg - 0.04_f64.hypot(0.045)).abs() < 2e-3, "{headings:?}");
}

#[test]
fn a_block_that_fails_widens_sigma_until_a_fix_is_asked_for() {
    let (mut keeper, mut counters) = (keeper(), Counters::default());
    let headings: Vec<Heading> = (0..400).filter_map(|_| keeper.push(None, &mut counters)).collect();
    assert_eq!(counters.block_errors, 400);
    assert_eq!(headings.len(), 4);
    assert!(headings.windows(2).all(|pair| pair[0].sigma_deg < pair[1].sigma_deg || pair[1].sigma_deg == 180.0));
    assert!(headings.iter().all(|heading| heading.motion == Motion::Bridged && heading.refix), "{headings:?}");
}

#[test]
fn saturated_samples_are_counted() {
    let (mut keeper, mut counters) = (keeper(), Counters::default());
    let headings: Vec<Heading> = (0..100).filter_map(|_| keeper.push(Some(&sample(400.0, 0)), &mut counters)).collect();
    assert_eq!(counters.block_saturated, 100);
    assert!(headings[0].refix);
}
