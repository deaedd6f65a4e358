//! What closing the loop found: the documented JSON, and the series that a report draws.

use std::collections::BTreeMap;

use north_finder::effects::ErrorModel;
use schemars::JsonSchema;
use serde::Serialize;

use crate::campaign::Role;
use crate::run_data::Warning;

/// The whole diagnosis of a campaign. Serialised, it is the documented result of `north diagnose --json`; the series
/// for a report are left out of that.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct Diagnosis {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// What made it, and of what.
    pub origin: Origin,
    /// The outcome in a sentence, for a person.
    pub verdict: String,
    pub runs: Vec<RunDiagnosis>,
    /// The effects that the model took up, the strongest first.
    pub effects: Vec<Effect>,
    /// Candidates that were left, with the reason; the most telling first.
    pub rejected: Vec<Rejected>,
    /// Every candidate that was tried, with its statistics.
    pub candidates: Vec<Candidate>,
    /// Root mean square of the one-second residuals, °/h: check runs if there are any, else all runs.
    /// Of what the residual is: "second", or "dwell" where the base moves.
    pub residual_of: &'static str,
    pub residual_rms_before_deg_h: f64,
    pub residual_rms_after_deg_h: f64,
    /// Of still recordings: the rate about its mean in what was not learned from, root mean square of a second, °/h.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_rms_before_deg_h: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_rms_after_deg_h: Option<f64>,
    /// Azimuth error over the runs that are judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_rms_before_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_rms_after_deg: Option<f64>,
    /// The same with what a board can run of the model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_rms_board_deg: Option<f64>,
    /// What of the model a board lacks, and why; empty where it runs all of it.
    pub board_lacks: Vec<BoardLack>,
    /// 95 % intervals of both, by the chi-square of as many degrees of freedom as there are runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_rms_before_interval_deg: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_rms_after_interval_deg: Option<[f64; 2]>,
    /// Runs that are judged and have an azimuth after.
    pub judged_runs: usize,
    /// Every run judged by what was learned from all others, whatever the roles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leave_one_out: Option<LeaveOneOut>,
    /// "check-runs", "cross-validation" or "stations"; absent where neither a reference nor a station with two runs is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged_on: Option<&'static str>,
    /// How far apart the azimuths of one station are that nobody surveyed, root mean square of what a run would miss a survey by, degrees; after:
    /// training runs by models that they took no part in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub station_spread_before_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub station_spread_after_deg: Option<f64>,
    /// Structure remains that no candidate explains.
    pub unexplained: bool,
    /// What remains, in words; empty when nothing does.
    pub unexplained_evidence: Vec<String>,
    pub next_experiment: Option<Experiment>,
    /// Alternatives to what was named that no run at this latitude would tell from it, with any order, heading or duration.
    pub inseparable: Vec<String>,
    /// Why what was found is not used, if it is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub withdrawn: Option<String>,
    /// References that are wrong by what the runs say of each other, and those that an azimuth after misses by degrees and by many sigmas.
    pub missed_references: Vec<MissedReference>,
    /// Tests of the residual for being noise.
    pub noise: NoiseTests,
    /// How the unit stands to its family, where that was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub family: Option<InFamily>,
    /// Doubts about the campaign, with the run and the row.
    pub warnings: Vec<Warning>,
    /// The error model with the effects in it: what `--model-out` writes.
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub model: ErrorModel,
    /// One series a run, in the order of `runs`; for drawing.
    #[serde(skip)]
    pub series: Vec<RunSeries>,
    /// Spectra of the residual of all runs together; for drawing. None where dwells are judged.
    #[serde(skip)]
    pub spectra: Spectra,
}

/// How a unit stands to the instruments of its type.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct InFamily {
    /// Probability that it is out of the family: that it has an effect in a way of its own, lacks one that it should have, or has another one.
    pub outside: f64,
    /// How it has each of the family's effects.
    pub effects: Vec<FamilyEffect>,
}

/// How a unit has an effect of its family.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FamilyEffect {
    pub name: String,
    /// Share of the family's units that have it.
    pub share: f64,
    /// Probability that this unit has it as the others, and that it has it in a way of its own; it lacks it otherwise.
    pub family: f64,
    pub own: f64,
}

/// What of a model a board cannot run.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct BoardLack {
    pub effect: String,
    pub why: String,
}

/// A reference that its run contradicts.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MissedReference {
    pub file: String,
    /// Azimuth less reference, degrees, and the same over the sigma of both.
    pub misses_by_deg: f64,
    pub sigmas: f64,
    /// The run whose reference it seems to have.
    pub exchanged_with: Option<String>,
}

/// What made a diagnosis, and of what.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Origin {
    /// Of the program.
    pub version: &'static str,
    /// Date of the page, if it has one: the diagnosis itself depends on no clock.
    #[serde(skip)]
    pub made: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude_deg: Option<f64>,
}

/// Every run with a reference by what was learned from all others: how well the diagnosis does on this campaign, on all runs
/// that there are. The model that is written takes nothing from it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LeaveOneOut {
    /// Runs with a reference and an azimuth.
    pub runs: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_rms_before_deg: Option<f64>,
    pub azimuth_rms_deg: f64,
    /// 95 % interval for normal errors, by chi-square.
    pub azimuth_rms_interval_deg: [f64; 2],
    /// Errors over their sigmas (with the reference's), root mean square: 1 where sigma covers.
    pub errors_over_sigma_rms: f64,
    /// Errors in the order of the runs.
    pub errors_deg: Vec<Option<f64>>,
}

/// One run before and after.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct RunDiagnosis {
    pub file: String,
    pub role: Role,
    pub azimuth_before_deg: Option<f64>,
    pub sigma_before_deg: Option<f64>,
    pub azimuth_after_deg: Option<f64>,
    /// With the uncertainty of the learned parameters.
    pub sigma_after_deg: Option<f64>,
    /// Of a training run: by what was learned from others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_left_out_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_left_out_deg: Option<f64>,
    /// Azimuth minus reference, in (−180°, 180°]; only for runs that are judged. Where these are training runs, the azimuth is
    /// by what the other runs taught (cross-validation), not `azimuth_after_deg`, which is by the model that is written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_before_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_after_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_azimuth_deg: Option<f64>,
    /// One sigma of it, degrees.
    #[serde(skip)]
    pub reference_sigma_deg: f64,
    pub closure_before_deg_h: Option<f64>,
    pub closure_after_deg_h: Option<f64>,
    pub flags_before: Vec<&'static str>,
    pub flags_after: Vec<&'static str>,
    /// Why there is no azimuth, or why the reference was not used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(default)]
    pub notes: Vec<String>,
}

/// An effect that the model took up.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Effect {
    /// Stable, documented, lower-case words with hyphens.
    pub name: String,
    /// "bias" (adds to the rate), "scale" (multiplies it), "index" (turns the index angle), "azimuth" (turns the
    /// answer), "base-motion", "level-drift".
    pub kind: &'static str,
    /// The column of the recording that carries it, if it is one.
    pub channel: Option<String>,
    /// All columns that it depends on.
    pub channels: Vec<String>,
    pub parameters: BTreeMap<String, f64>,
    pub sigma: BTreeMap<String, f64>,
    /// Paid for by how many candidates were searched.
    pub p_value: f64,
    /// Names of the candidates that explain this campaign as well.
    pub ambiguous_with: Vec<String>,
    pub evidence: String,
    /// Whether a board measures what the effect depends on.
    pub board: bool,
}

impl Diagnosis {
    /// Runs that are judged and had an azimuth before.
    pub fn judged_before(&self) -> usize {
        self.runs.iter().filter(|run| run.error_before_deg.is_some()).count()
    }
}

impl Effect {
    /// Its name, with the columns that it depends on.
    pub fn full_name(&self) -> String {
        if self.channels.is_empty() {
            self.name.clone()
        } else {
            format!("{} ({})", self.name, self.channels.join(" and "))
        }
    }
}

/// A candidate that was left.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Rejected {
    pub name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    pub why: String,
}

/// One candidate with its statistics.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Candidate {
    pub name: String,
    pub kind: &'static str,
    pub channel: Option<String>,
    /// Parameters that were fitted, time constants among them.
    pub freedom: usize,
    /// Fall of the weighted sum of squares when the candidate is the first to be taken, in noise variances.
    pub improvement: f64,
    /// p-value of that by itself, and corrected for the search.
    pub p_value: f64,
    pub p_value_searched: f64,
    pub taken: bool,
    pub why: String,
}

/// What the next experiment asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Ask {
    /// Runs in an order, at headings.
    Runs,
    /// A survey of headings.
    Survey,
    /// Runs at one station, or the name of the station in those that there are.
    Stations,
    /// A channel that is not recorded.
    Channel,
    /// Longer rests at the positions.
    LongerRests,
    /// Runs at another latitude, or another look at the one that is given.
    Latitude,
}

/// What would tell ambiguous effects apart.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Experiment {
    /// What is asked for.
    pub asks: Ask,
    /// At most three sentences of at most 25 words.
    pub description: String,
    /// Index angles in the order of their visits, degrees.
    pub order_deg: Vec<f64>,
    /// Azimuths of the mark, degrees; one run (or more) at each.
    pub headings_deg: Vec<f64>,
    /// Time at each position, seconds.
    pub dwell_s: f64,
    /// Time between switch-on and the first position, seconds.
    pub warm_up_s: f64,
    /// By how much the mount leans more than in a usual run, degrees: nose up, left side up.
    pub pitch_deg: f64,
    pub roll_deg: f64,
    /// The run whose channels it repeats.
    pub like: String,
    /// The likeliest model, and those that it tells from it; none where it is to make the azimuth more certain.
    pub separates: Vec<String>,
    /// Log odds between the likeliest model and the nearest of the others that it adds on average, whichever of the two is true.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected_log_odds: Option<f64>,
    /// Sigma of a usual run's azimuth, degrees, now and once the runs are learned from.
    pub sigma_now_deg: f64,
    pub sigma_then_deg: f64,
}

/// Whether the residual is noise.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct NoiseTests {
    /// Noise of a one-second rate from its fast changes, °/h.
    pub noise_deg_h: f64,
    /// The same as declared by the campaign, if it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub declared_noise_deg_h: Option<f64>,
    pub before: Vec<Test>,
    pub after: Vec<Test>,
}

/// One test of the residual.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Test {
    pub name: String,
    /// What the statistic is, in words.
    pub about: String,
    pub statistic: f64,
    pub p_value: f64,
    pub passed: bool,
    /// Why the test says nothing here; then it is neither passed nor failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_applied: Option<&'static str>,
}

impl Test {
    /// Whether it says that the residual is not noise.
    pub fn failed(&self) -> bool {
        !self.passed && self.not_applied.is_none()
    }
}

/// Series of one run by the second (or by the row where rows are longer), all of the same length.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunSeries {
    pub file: String,
    /// Middle and length of the interval, seconds.
    pub t_s: Vec<f64>,
    pub seconds: Vec<f64>,
    /// Index angle, degrees.
    pub index_deg: Vec<f64>,
    /// Rate less the Earth's, the run's own azimuth and bias and, after, the effects; °/h. Where dwells are judged, what is left of the interval's dwell.
    pub residual_before_deg_h: Vec<f64>,
    pub residual_after_deg_h: Vec<f64>,
    /// Every channel of the recording by its column's name.
    pub channels: BTreeMap<String, Vec<f64>>,
}

/// Spectra of the residual.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Spectra {
    /// Frequencies, Hz, and power of the residual there as a multiple of what white noise has on average.
    pub frequency_hz: Vec<f64>,
    pub power_before: Vec<f64>,
    pub power_after: Vec<f64>,
    /// Averaging times, seconds, and Allan deviations, °/h.
    pub tau_s: Vec<f64>,
    pub allan_before_deg_h: Vec<f64>,
    pub allan_after_deg_h: Vec<f64>,
    /// What the declared (or else measured) white noise alone would give, °/h.
    pub allan_white_deg_h: Vec<f64>,
}
