//! No azimuth comes out silently wrong: in every scenario whose effect a single fix can see, an azimuth that is off by
//! more than four of its sigmas carries a flag.

use std::ops::RangeInclusive;

use crate::common::{fix, of_scenario, run};
use hal_sim::Scenario;
use north::engine::{End, Setup};
use north_finder::health::{Flag, Flags};
use north_finder::sequence::order::Order;

/// Effects that turn with the index, or with the rate, just as the Earth's rate does: no single fix can see them; only
/// runs at surveyed headings can. And biases of the accelerometers: only other attitudes show those.
const INVISIBLE: [&str; 3] = ["magnet-in-base", "unshielded-coil", "dead-zone"];

/// A scenario with the instrument turned to a heading that goes round with the seed; every second one in the adaptive order.
fn turned(name: &str, seed: u64) -> Setup {
    let mut scenario = Scenario::named(name).unwrap();
    scenario.site.azimuth_deg = 47.0 * seed as f64 % 360.0;
    let mut setup = of_scenario(scenario, seed);
    if let Some(settings) = setup.settings.as_mut().filter(|_| seed.is_multiple_of(2)) {
        settings.sequence.order = Order::ADAPTIVE;
    }
    setup
}

#[test]
fn an_azimuth_off_by_more_than_four_sigma_is_flagged() {
    silent_is_right(1..=2);
}

#[test]
#[ignore = "many seeds: make proofs"]
fn an_azimuth_off_by_more_than_four_sigma_is_flagged_in_many_worlds() {
    silent_is_right(3..=12);
}

/// In these worlds of every scenario an azimuth without a flag is right to four sigma.
fn silent_is_right(seeds: RangeInclusive<u64>) {
    for (name, _) in Scenario::names() {
        for seed in seeds.clone() {
            let (outcome, _) = run(&turned(name, seed));
            if !matches!(outcome.end, End::Fix(_)) {
                continue;
            }
            let (fix, error_deg) = fix(&outcome);
            let sigmas = error_deg.abs() / fix.sigma_deg;
            let silent = fix.flags == Flags::default();
            assert!(
                sigmas <= 4.0 || !silent || INVISIBLE.contains(&name),
                "{name}, seed {seed}: {error_deg:.3}° is {sigmas:.1} sigma, and nothing says so"
            );
        }
    }
}

/// A drive that rings at 5 Hz, as often in every second, lets the gate pass with 1.2 arcsec of it: up to three times the sigma of a dwell of 30 s. In the source's
/// four positions the squares of sixteen errors in sigmas have the mean 16 and the standard deviation √32: 44 is five of them above it (an instrument
/// whose dwells keep the ringing at their beginning has 69, and 22 since they are eased).
#[test]
fn a_ringing_whose_period_divides_the_second_is_within_sigma() {
    let mut squares = 0.0;
    for seed in 1..=16 {
        let mut setup = turned("jittery-drive", seed);
        let motor = &mut setup.scenario.motor;
        (motor.ringing_hz, motor.damping) = (5.0, motor.damping * motor.ringing_hz / 5.0);
        setup.settings.as_mut().unwrap().sequence.order = Order::Source;
        let (fix, error_deg) = fix(&run(&setup).0);
        assert!(!fix.flags.contains(Flag::Misfit), "seed {seed}: {fix:?}");
        squares += (error_deg / fix.sigma_deg).powi(2);
    }
    assert!(squares < 44.0, "{squares}");
}

#[test]
fn what_is_called_invisible_is_so() {
    // Otherwise the list above would excuse more than it must.
    for name in INVISIBLE {
        let silently_wrong = (1..=24).any(|seed| {
            let (fix, error_deg) = fix(&run(&turned(name, seed)).0);
            error_deg.abs() > 4.0 * fix.sigma_deg && fix.flags == Flags::default()
        });
        assert!(silently_wrong, "{name}");
    }
}
