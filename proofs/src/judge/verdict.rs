//! What a diagnosis made of a campaign, against what was hidden in it.

use crate::hidden::{Campaign, Family, Part};
use serde::Serialize;

use super::oracle::Oracle;
use north::diagnose::{Diagnosis, Effect};

/// Evidence below which nobody can be asked to see an effect, not even who knows its shape: it must stand out of a
/// search over some hundred candidates with constants of their own.
const EVIDENCE: f64 = 60.0;

/// How the diagnosis did on the hidden effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Attribution {
    /// Named, and nothing else said to explain the campaign as well.
    Right,
    /// Among those that are said to explain the campaign equally well.
    Ambiguous,
    /// Something else was named.
    Wrong,
    /// Nothing was named.
    Silent,
}

/// A campaign after its diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    pub family: &'static str,
    pub number: u64,
    /// What was hidden, with its constants.
    pub hidden: String,
    /// What was named.
    pub found: Vec<String>,
    pub attribution: Attribution,
    /// Whether an oracle sees the effect plainly in the runs that may be learned from.
    pub visible: bool,
    pub evidence: f64,
    /// Named although it is not there, beside the right one or alone.
    pub false_effects: usize,
    pub unexplained: bool,
    /// Azimuth errors of the check runs in standard deviations that white noise alone would give.
    pub errors: Vec<Errors>,
    /// That standard deviation, degrees.
    pub noise_deg: f64,
    /// Check runs without an azimuth before, or after, or from the oracle.
    pub without_azimuth: usize,
    /// Why there was no diagnosis.
    pub refusal: Option<String>,
}

/// Azimuth errors of one run, and a sigma, in standard deviations of its noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    pub before: f64,
    pub after: f64,
    /// The oracle, who fits the size of what it knows.
    pub oracle: f64,
    /// The campaign in which the effect never was.
    pub without: f64,
    /// The sigma that came with the azimuth after.
    pub sigma_after: f64,
}

/// Judges. Of an effect that nobody has a name for only the channels that are named can be right or wrong.
pub fn judge(campaign: &Campaign, number: u64, diagnosis: &Result<Diagnosis, String>, oracle: &Oracle) -> Verdict {
    let noise_deg = campaign.azimuth_noise_deg();
    let mut verdict = Verdict {
        family: campaign.effect.family.name(),
        number,
        hidden: describe(campaign),
        found: Vec::new(),
        attribution: Attribution::Silent,
        visible: oracle.evidence >= EVIDENCE,
        evidence: oracle.evidence,
        false_effects: 0,
        unexplained: false,
        errors: Vec::new(),
        noise_deg,
        without_azimuth: 0,
        refusal: None,
    };
    let diagnosis = match diagnosis {
        Ok(diagnosis) => diagnosis,
        Err(why) => {
            verdict.refusal = Some(why.clone());
            return verdict;
        }
    };
    verdict.found = diagnosis.effects.iter().map(label).collect();
    verdict.unexplained = diagnosis.unexplained;
    let (own, other): (Vec<_>, Vec<_>) = diagnosis.effects.iter().partition(|effect| is_hidden(campaign, effect));
    let maybe = other.iter().filter(|effect| effect.ambiguous_with.iter().any(|name| is_meant(campaign, name))).count();
    let harmless = other.iter().filter(|effect| is_part_of_it(campaign, &effect.name)).count();
    verdict.false_effects = other.len().saturating_sub(maybe + harmless);
    verdict.attribution = match (own.as_slice(), maybe) {
        ([], 0) if other.is_empty() => Attribution::Silent,
        ([], 0) => Attribution::Wrong,
        ([effect, ..], _) if effect.ambiguous_with.is_empty() => Attribution::Right,
        _ => Attribution::Ambiguous,
    };
    for (place, run) in campaign.runs.iter().enumerate().filter(|(_, run)| !run.may_learn) {
        let error = |azimuth_deg: Option<f64>| {
            azimuth_deg.map(|deg| ((deg - run.azimuth_deg + 180.0).rem_euclid(360.0) - 180.0) / noise_deg)
        };
        let diagnosed = diagnosis.runs.get(place);
        let errors = (
            error(diagnosed.and_then(|run| run.azimuth_before_deg)),
            error(diagnosed.and_then(|run| run.azimuth_after_deg)),
            error(oracle.fitted_deg.get(place).copied().flatten()),
            error(oracle.without_deg.get(place).copied().flatten()),
        );
        match errors {
            (Some(before), Some(after), Some(oracle), Some(without)) => {
                let sigma_deg = diagnosed.and_then(|run| run.sigma_after_deg).unwrap_or(f64::NAN);
                verdict.errors.push(Errors { before, after, oracle, without, sigma_after: sigma_deg / noise_deg });
            }
            _ => verdict.without_azimuth += 1,
        }
    }
    verdict
}

/// Name and channel.
fn label(effect: &Effect) -> String {
    let channel =
        if effect.channels.is_empty() { String::new() } else { format!("({})", effect.channels.join(" and ")) };
    let also = if effect.ambiguous_with.is_empty() {
        String::new()
    } else {
        format!(" or {}", effect.ambiguous_with.join(" or "))
    };
    format!("{}{channel}{also}", effect.name)
}

/// The hidden effect in words; of an effect with parts of each run's own, the first run's.
fn describe(campaign: &Campaign) -> String {
    let parts = &campaign.effect.parts;
    let first = parts.first().and_then(|(_, part)| part.of_run());
    let shown = parts.iter().filter(|(_, part)| part.of_run() == first).filter(|(_, part)| !is_long(part));
    let parts: Vec<_> = shown.map(|(size, part)| format!("{size:.3} × {part:?}")).collect();
    let channels = campaign.causal_channels().join(", ");
    if channels.is_empty() { parts.join(" + ") } else { format!("{} of {channels}", parts.join(" + ")) }
}

fn is_long(part: &Part) -> bool {
    matches!(part, Part::ComesAndGoes { .. })
}

/// Whether this is the hidden effect.
fn is_hidden(campaign: &Campaign, effect: &Effect) -> bool {
    let causal = campaign.causal_channels();
    if campaign.effect.family.is_foreign() {
        // Nobody has a name for it: all that is named must be causes.
        return effect.channels.iter().all(|channel| causal.contains(&channel.as_str()));
    }
    is_name_of(campaign, &effect.name) && is_causal(campaign, effect.channel.as_deref())
}

/// Whether a name in a list of ambiguous ones, "name" or "name:channel", means the hidden effect; what has no physical name is called after its channel.
fn is_meant(campaign: &Campaign, text: &str) -> bool {
    let (name, channel) = text.split_once(':').map_or((text, None), |(name, channel)| (name, Some(channel)));
    let within = campaign.causal_channels().into_iter().find(|channel| name.contains(channel));
    is_name_of(campaign, name) && is_causal(campaign, channel.or(within))
}

/// Whether a name stands for a part of the hidden effect: a field along the axis and the slope of a non-linearity are
/// scale factors.
fn is_part_of_it(campaign: &Campaign, name: &str) -> bool {
    matches!(campaign.effect.family, Family::EarthField | Family::NonLinearity) && name == "scale-factor"
}

fn is_causal(campaign: &Campaign, channel: Option<&str>) -> bool {
    let causal = campaign.causal_channels();
    match channel {
        // The gyro's temperature is understood where an effect is named after it; level by base motion.
        None => causal.is_empty() || causal == ["temp_c"],
        Some(name) => causal.is_empty() || causal.contains(&name),
    }
}

/// What the diagnosis may call the hidden effect: by a physical name, or by the signal that it follows and what stands between the two. Channels are
/// judged by themselves.
fn is_name_of(campaign: &Campaign, name: &str) -> bool {
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let begins = |words: &[&str]| words.iter().any(|word| name.starts_with(word));
    let of_channel = begins(&["temperature", "channel"]) || campaign.causal_channels().iter().any(|own| begins(&[own]));
    match campaign.effect.family {
        Family::ChannelValue | Family::ChannelCurve => of_channel && !has(&["-rate"]),
        Family::ChannelRate => of_channel && has(&["-rate"]),
        Family::ChannelLag | Family::ChannelDelay => of_channel && has(&["-low-pass", "-delay", "-heat", "-memory"]),
        Family::Drift => begins(&["drift", "time"]),
        Family::SinceSwitchOn => begins(&["warm-up", "time"]),
        Family::AfterMove => {
            begins(&["settling", "since", "travel", "distance", "turn", "moves", "winding", "number", "speed", "index"])
        }
        Family::BodyHarmonic => name == harmonic_name(campaign) || begins(&["index"]),
        Family::EarthField => begins(&["earth-field", "axis"]),
        Family::NonLinearity => begins(&["rate", "scale-by-rate", "measured"]),
        Family::BaseMotion => name == "base-motion",
        Family::LevelBias => begins(&["level-"]),
        Family::IndexAngle => begins(&["index-offset"]),
        Family::StepWithin => begins(&["step", "time"]),
        // What is a bias, which every run has, and what has a phase of each run's own, has no name.
        Family::StepBetween
        | Family::Line
        | Family::Nothing
        | Family::Hysteresis
        | Family::TwoChannels
        | Family::ComesAndGoes
        | Family::Outside(_)
        | Family::Several(_) => false,
    }
}

fn harmonic_name(campaign: &Campaign) -> &'static str {
    match campaign.effect.parts.first() {
        Some((_, Part::Harmonic { order: 1, .. })) => "body-harmonic-1",
        Some((_, Part::Harmonic { order: 2, .. })) => "body-harmonic-2",
        _ => "body-harmonic-3",
    }
}
