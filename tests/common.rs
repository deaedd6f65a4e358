//! What several tests need: runs of the simulated instrument.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use hal_sim::Scenario;
use north::engine::{End, Outcome, Setup, host};
use north::settings_file::scenario_settings;
use north_finder::event::{Event, Fix, Report};
use north_finder::sequence::order::Order;
use north_finder::units::wrap_180_deg;

/// A built-in scenario, its settings stored in the instrument.
pub fn setup(name: &str, seed: u64) -> Setup {
    of_scenario(Scenario::named(name).unwrap(), seed)
}

/// A scenario, its settings stored in the instrument, with the order whose dwells are known before: the mirrored one.
pub fn of_scenario(scenario: Scenario, seed: u64) -> Setup {
    let mut settings = scenario_settings(&scenario, None).unwrap();
    settings.sequence.order = Order::Mirrored;
    Setup { scenario, seed, settings: Some(settings) }
}

/// Runs in this process; the outcome and all reports.
pub fn run(setup: &Setup) -> (Outcome, Vec<Report>) {
    let mut reports = Vec::new();
    let outcome = host::run(setup, &AtomicBool::new(false), &mut |report| reports.push(*report)).unwrap();
    (outcome, reports)
}

/// The azimuth of a run that must have one, and its error in degrees.
pub fn fix(outcome: &Outcome) -> (Fix, f64) {
    let End::Fix(fix) = outcome.end else { panic!("no azimuth: {:?}", outcome.end) };
    (fix, wrap_180_deg(fix.azimuth_deg - outcome.truth.azimuth_deg))
}

/// Names of the events without the seconds, the counters, the answers to requests and the self-test, one after the other.
pub fn names(reports: &[Report]) -> Vec<&'static str> {
    let quiet = |event: &Event| {
        matches!(event, Event::Second(_) | Event::Health(_) | Event::Answer { .. } | Event::SelfTest(_))
    };
    reports.iter().filter(|report| !quiet(&report.event)).map(|report| report.event.name()).collect()
}

/// The folder with measured data, which the project does not contain.
pub fn measured_data() -> PathBuf {
    std::env::var_os("NORTH_FINDER_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from)
}
