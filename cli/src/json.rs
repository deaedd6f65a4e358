//! The machine-readable results. Field names are stable: other programs depend on them.

use std::collections::BTreeMap;

use inertial::Motion;
use north_finder::event::{Dwell, Event, Fix, Heading, Report};
use north_finder::health::{Counters, Finding, Flags};
use north_finder::units::wrap_180_deg;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::present::{Asked, Directions};

/// Result of `north solve`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Solved {
    pub runs: Vec<Run>,
}

/// Result of `north find`: the same with its one run, and what only the simulator knows.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Found {
    pub runs: Vec<Run>,
    pub true_azimuth_deg: f64,
    /// "qemu" or "host".
    pub engine: &'static str,
    pub events: Vec<EventRecord>,
    /// The heading after the instrument was carried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held: Option<Held>,
    /// Everything discarded or repaired, by cause, as last reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<BTreeMap<String, u32>>")]
    pub health: Option<Counters>,
}

/// A heading that was held, and what is true.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Held {
    pub heading_deg: f64,
    pub pitch_deg: f64,
    pub roll_deg: f64,
    pub sigma_deg: f64,
    pub sigma_level_deg: f64,
    /// "standing", "moving" or "bridged".
    #[schemars(with = "String")]
    pub motion: Motion,
    pub refix: bool,
    pub true_heading_deg: f64,
    /// Heading minus truth, in (−180°, 180°].
    pub error_deg: f64,
}

impl Held {
    pub fn new(heading: Heading, true_heading_deg: f64) -> Self {
        let Heading { heading_deg, pitch_deg, roll_deg, sigma_deg, sigma_level_deg, motion, refix } = heading;
        let error_deg = wrap_180_deg(heading_deg - true_heading_deg);
        Self {
            heading_deg,
            pitch_deg,
            roll_deg,
            sigma_deg,
            sigma_level_deg,
            motion,
            refix,
            true_heading_deg,
            error_deg,
        }
    }
}

/// One run: an azimuth, or the reason why there is none.
#[derive(Debug, Default, Serialize, JsonSchema)]
pub struct Run {
    /// The recording; empty when there is none.
    pub file: String,
    pub azimuth_deg: Option<f64>,
    pub sigma_deg: Option<f64>,
    pub closure_deg_h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closure_sigma_deg_h: Option<f64>,
    /// How the dwells fit together, and as many as it is on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chi_square: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<u16>,
    pub dwells: Vec<DwellRecord>,
    pub flags: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_deg_h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude_deg_h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift_deg_h_per_h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_azimuth_deg: Option<f64>,
    /// Azimuth minus reference, in (−180°, 180°].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_deg: Option<f64>,
    /// The azimuth in the unit, from the grid, to the target that were asked for.
    #[serde(flatten)]
    pub asked: Option<Asked>,
    /// Name of the fault that ended the fix.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<&'static str>,
    /// Why there is no azimuth, for a person.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A dwell at one position.
#[derive(Debug, Serialize, JsonSchema)]
pub struct DwellRecord {
    pub index_deg: f64,
    pub seconds: f64,
    pub rate_deg_h: f64,
    /// Not known of a dwell of fewer than three seconds.
    pub sigma_deg_h: Option<f64>,
}

/// An event and when it happened.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EventRecord {
    pub t_s: f64,
    pub event: &'static str,
    #[serde(flatten)]
    pub details: Map<String, Value>,
}

impl Run {
    /// What a fix says.
    pub fn of_fix(file: String, fix: &Fix, dwells: &[Dwell]) -> Self {
        Self {
            azimuth_deg: Some(fix.azimuth_deg),
            sigma_deg: Some(fix.sigma_deg),
            closure_deg_h: fix.closure_deg_h,
            closure_sigma_deg_h: fix.closure_sigma_deg_h,
            chi_square: Some(fix.chi_square),
            degrees_of_freedom: Some(fix.degrees_of_freedom),
            flags: flag_names(fix.flags),
            bias_deg_h: Some(fix.bias_deg_h),
            amplitude_deg_h: Some(fix.amplitude_deg_h),
            drift_deg_h_per_h: Some(fix.drift_deg_h_per_h),
            seconds: Some(fix.seconds),
            ..Self::without_azimuth(file, dwells, None, None)
        }
    }

    /// A run that gave no azimuth: the dwells it got through, and why.
    pub fn without_azimuth(
        file: String,
        dwells: &[Dwell],
        fault: Option<&'static str>,
        reason: Option<String>,
    ) -> Self {
        Self { file, dwells: dwells.iter().map(DwellRecord::from).collect(), fault, reason, ..Self::default() }
    }

    /// Adds the azimuth as it was asked for.
    pub fn ask(&mut self, directions: &Directions) {
        self.asked = self.azimuth_deg.zip(self.sigma_deg).and_then(|(azimuth, sigma)| directions.asked(azimuth, sigma));
    }

    /// Adds what is known to be true, and the error against it.
    pub fn compare(&mut self, reference_azimuth_deg: f64) {
        self.reference_azimuth_deg = Some(reference_azimuth_deg);
        self.error_deg = self.azimuth_deg.map(|azimuth_deg| wrap_180_deg(azimuth_deg - reference_azimuth_deg));
    }
}

impl From<&Dwell> for DwellRecord {
    fn from(dwell: &Dwell) -> Self {
        Self {
            index_deg: dwell.index_deg,
            seconds: dwell.seconds,
            rate_deg_h: dwell.rate_deg_h,
            sigma_deg_h: Some(dwell.sigma_deg_h).filter(|sigma| sigma.is_finite()),
        }
    }
}

impl EventRecord {
    /// The record of a report; `None` for the seconds and the counters, which are not events of the fix.
    pub fn of(report: &Report) -> Option<Self> {
        let details = match report.event {
            Event::Second(_) | Event::Health(_) | Event::Vitals { .. } => return None,
            // The azimuth stands with its run; the names of states and faults are the event's own.
            Event::Fix(_) | Event::State(_) => Map::new(),
            Event::Fault { state, .. } => Map::from_iter([("state".to_owned(), Value::from(state.name()))]),
            Event::SelfTest(finding) => self_test(&finding),
            other => fields(&other),
        };
        Some(Self { t_s: report.t_s, event: report.event.name(), details })
    }
}

/// An item of a self-test by its names; `null` where nothing was measured.
fn self_test(finding: &Finding) -> Map<String, Value> {
    let measured = |value: f32| Value::from(finding.was_tested().then(|| f64::from(value)));
    let [least, most] = finding.allowed;
    let fields = [
        ("item", Value::from(finding.item.name())),
        ("verdict", Value::from(finding.verdict.name())),
        ("measured", measured(finding.measured)),
        ("least", measured(least)),
        ("most", measured(most)),
        ("unit", Value::from(finding.item.unit())),
    ];
    fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// The fields of an event, by name.
fn fields(event: &Event) -> Map<String, Value> {
    match serde_json::to_value(event) {
        Ok(Value::Object(variant)) => match variant.into_iter().next() {
            Some((_, Value::Object(fields))) => fields,
            _ => Map::new(),
        },
        _ => Map::new(),
    }
}

fn flag_names(flags: Flags) -> Vec<&'static str> {
    flags.iter().map(|flag| flag.name()).collect()
}
