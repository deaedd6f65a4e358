//! Whole fixes of the firmware's state machine in this process, for the benches that need them.

use hal_sim::Scenario;
use north::engine::{End, Setup, host};
use north::failure::Failure;
use north::interrupt;
use north_finder::event::{Event, Fix};
use north_finder::health::Fault;
use north_finder::settings::Settings;

use crate::statistics::azimuth_error_deg;

/// How a fix ended.
pub struct Ended {
    /// From power-up to the end, s.
    pub elapsed_s: f64,
    /// First promise of a time to go, when it was made and how long, s.
    pub promised: Option<[f64; 2]>,
    pub end: Result<Found, Option<Fault>>,
}

/// An azimuth and what it was off by.
pub struct Found {
    pub fix: Fix,
    pub error_deg: f64,
}

/// Runs a fix; its end is an azimuth, a fault, or nothing within the scenario's time limit.
pub fn fix(scenario: Scenario, seed: u64, settings: Settings) -> Result<Ended, Failure> {
    let setup = Setup { scenario, seed, settings: Some(settings) };
    let (mut elapsed_s, mut promised) = (0.0, None);
    let outcome = host::run(&setup, interrupt::flag(), &mut |report| match report.event {
        Event::Fix(_) | Event::Fault { .. } => elapsed_s = report.t_s,
        Event::ToGo { seconds } => promised = promised.or(Some([report.t_s, seconds])),
        _ => {}
    })?;
    let end = match outcome.end {
        End::Fix(fix) => Ok(Found { fix, error_deg: azimuth_error_deg(fix.azimuth_deg, outcome.truth.azimuth_deg) }),
        End::Fault { fault, .. } => Err(Some(fault)),
        End::TimeLimit => Err(None),
        End::Interrupted => return Err(Failure::Interrupted),
    };
    Ok(Ended { elapsed_s, promised, end })
}

impl Ended {
    /// How long it took from the first promise on, over what was promised.
    pub fn real_over_promised(&self) -> Option<f64> {
        self.promised.map(|[at_s, promised_s]| (self.elapsed_s - at_s) / promised_s)
    }
}
