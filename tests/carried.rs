//! A fix that is carried to another place: heading and sigma against the truth.

use hal_sim::Scenario;
use hal_sim::scenario::{Carry, SensorFault, SensorFaultKind};
use inertial::Motion;
use north::engine::{Outcome, Setup};
use north_finder::event::{Event, Heading, Report};
use north_finder::fix::heading::settings::{BlockSettings, Class};
use north_finder::units::wrap_180_deg;

use crate::common::{fix, of_scenario, run};

/// Short dwells and a short walk, another turn with every seed.
pub fn short_walk(seed: u64) -> Setup {
    let mut scenario = Scenario::named("carried").unwrap();
    scenario.site.azimuth_deg = 100.0 * seed as f64 % 360.0;
    let turn_deg = 70.0 * seed as f64 - 200.0;
    scenario.carry = Some(Carry { wait_s: 20.0, walk_s: 15.0, stand_s: 5.0, turn_deg, ..Carry::default() });
    let mut setup = of_scenario(scenario, seed);
    setup.settings.as_mut().unwrap().sequence.dwell_s = 6;
    setup
}

fn headings(reports: &[Report]) -> Vec<Heading> {
    reports
        .iter()
        .filter_map(|report| if let Event::Heading(heading) = report.event { Some(heading) } else { None })
        .collect()
}

/// The heading at the end, and its error in degrees.
pub fn held(outcome: &Outcome) -> (Heading, f64) {
    let held = outcome.held.expect("the scenario has a block");
    (held.heading, wrap_180_deg(held.heading.heading_deg - held.truth.azimuth_deg))
}

#[test]
fn a_fix_is_held_to_another_place() {
    for seed in 1..=5 {
        let (outcome, reports) = run(&short_walk(seed));
        let ((fix, fix_error_deg), (heading, error_deg)) = (fix(&outcome), held(&outcome));
        // Beyond four sigmas once in 16 000 (Gaussian).
        assert!(error_deg.abs() < 4.0 * heading.sigma_deg, "seed {seed}: {error_deg} {heading:?}");
        // What the walk brings, of a modern block: 0.15 °/√h for 15 s are 0.01°, its scale and axes 0.1 % of the turn.
        let turn_deg = 70.0 * seed as f64 - 200.0;
        let of_walk_deg = error_deg - fix_error_deg;
        assert!(of_walk_deg.abs() < 0.1 + 0.004 * turn_deg.abs(), "seed {seed}: {of_walk_deg}");
        assert!(heading.sigma_deg > fix.sigma_deg && heading.motion == Motion::Standing, "{heading:?}");
        let headings = headings(&reports);
        assert!(headings.len() >= 39, "{}", headings.len());
        assert!(headings.iter().filter(|heading| heading.motion == Motion::Moving).count() >= 14);
        let level_deg = [
            heading.pitch_deg - outcome.held.unwrap().truth.pitch_deg,
            heading.roll_deg - outcome.held.unwrap().truth.roll_deg,
        ];
        assert!(level_deg.iter().all(|deg| deg.abs() < 4.0 * heading.sigma_level_deg), "{level_deg:?} {heading:?}");
    }
}

#[test]
fn the_published_block_asks_for_a_new_fix() {
    // 4.2 °/√h for 15 s are 0.27°, and the bias that 20 s of standing leave, 3600 · 4.2/60/√20 = 56 °/h, is 0.23° more.
    let mut setup = short_walk(3);
    setup.scenario.block = Some(proofs::trials::carried::simulated(&inertial::BlockClass::SOURCE_MEMS));
    setup.settings.as_mut().unwrap().block =
        Some(BlockSettings { class: Class::SourceMems, refix_sigma_deg: 0.25, ..BlockSettings::default() });
    let (outcome, reports) = run(&setup);
    let (heading, error_deg) = held(&outcome);
    assert!(heading.refix && error_deg.abs() < 4.0 * heading.sigma_deg, "{error_deg} {heading:?}");
    assert!(headings(&reports).first().is_some_and(|heading| !heading.refix));
}

#[test]
fn a_block_that_falls_silent_on_the_way_widens_sigma() {
    let mut setup = short_walk(2);
    let (lifted, _) = run(&setup);
    let fixed_s = lifted.truth.t_s;
    let fault = SensorFault { kind: SensorFaultKind::BusHigh, from_s: fixed_s + 25.0, to_s: Some(fixed_s + 26.5) };
    setup.scenario.block.as_mut().unwrap().faults.push(fault);
    let (outcome, reports) = run(&setup);
    let (heading, error_deg) = held(&outcome);
    assert!(headings(&reports).iter().any(|heading| heading.motion == Motion::Bridged));
    assert!(heading.refix && error_deg.abs() < 2.0 * heading.sigma_deg, "{error_deg} {heading:?}");
    let health = reports.iter().rev().find_map(|report| match report.event {
        Event::Health(counters) => Some(counters),
        _ => None,
    });
    assert!(health.is_some_and(|counters| counters.block_errors >= 150), "{health:?}");
}

#[test]
fn an_instrument_without_a_block_holds_nothing() {
    let mut setup = short_walk(1);
    setup.settings.as_mut().unwrap().block = None;
    let (outcome, reports) = run(&setup);
    assert!(outcome.held.is_none() && headings(&reports).is_empty());
}
