//! What was found and what was left, as the diagnosis reports it.

use north_finder::effects::ErrorModel;

use super::block::Block;
use super::candidate::{self, Part};
use super::evidence::searched;
use super::experiment::{Expectation, Possible, Proposal};
use super::learn::ACCEPT;
use super::learned::{Learned, Taken};
use super::statistics::{chi_square_tail, p_value_in_words};
use super::{Candidate, Effect, Fitted, Rejected, effects, experiment};
use crate::campaign::Role;
use crate::run_data::RunData;

/// The effects that were found, the strongest first.
pub fn found(fitted: &Fitted, up_deg_h: f64) -> Vec<Effect> {
    let mut effects: Vec<Effect> = Vec::new();
    if fitted.by_dwell.is_some() {
        let base = fitted.by_second.taken.iter().find(|each| each.candidate.name == "base-motion");
        effects.extend(base.map(|base| effect(base, up_deg_h)));
    }
    let mut taken: Vec<&Taken> = fitted.learned().taken.iter().collect();
    taken.sort_by(|a, b| b.improvement.total_cmp(&a.improvement));
    effects.extend(taken.into_iter().map(|taken| effect(taken, up_deg_h)));
    effects.extend(fitted.sinusoid.map(|sinusoid| sinusoid.effect()));
    if let Some(turned_deg) = fitted.turned_deg {
        add_turn(&mut effects, turned_deg);
    }
    effects
}

/// An index error that was taken out beforehand: with what was found on top of it, or alone.
fn add_turn(effects: &mut Vec<Effect>, turned_deg: f64) {
    if let Some(offset_deg) = effects.iter_mut().find_map(|effect| effect.parameters.get_mut("offset_deg")) {
        *offset_deg += turned_deg;
        return;
    }
    let evidence = format!(
        "every training run's azimuth is off by about {turned_deg:+.2}°: the index zero, or all references, are turned"
    );
    let turn = Effect {
        name: INDEX_OFFSET.into(),
        kind: "index",
        channel: None,
        channels: Vec::new(),
        parameters: [("offset_deg".to_owned(), turned_deg)].into(),
        sigma: [("offset_deg".to_owned(), TURN_SIGMA_DEG)].into(),
        p_value: 0.0,
        ambiguous_with: vec![EARTH_FIELD.into()],
        evidence,
        board: true,
    };
    effects.insert(0, turn);
}

/// Both turn every azimuth by the same angle, whatever its size: only another latitude tells them apart.
const INDEX_OFFSET: &str = "index-offset";
const EARTH_FIELD: &str = "earth-field";
/// How well a large turn is known: below that an index offset is found on top of it, degrees.
const TURN_SIGMA_DEG: f64 = 0.1;
/// Relative error up to which sensitivity to gravity is what the other sign of the latitude would do.
const OTHER_LATITUDE: f64 = 0.2;

/// Names of what would explain an effect as well: other candidates, and what no candidate is.
fn confounded(taken: &Taken, up_deg_h: f64) -> Vec<String> {
    let mut names: Vec<String> = taken.alternatives.iter().map(|(alternative, _)| alternative.full_name()).collect();
    names.extend(exactly_confounded(taken, up_deg_h));
    let mut unlike: Vec<String> = Vec::new();
    names.into_iter().for_each(|name| {
        if !unlike.contains(&name) {
            unlike.push(name);
        }
    });
    unlike
}

/// What has the same equations at this latitude, so that no run tells it from the effect.
fn exactly_confounded(taken: &Taken, up_deg_h: f64) -> Option<String> {
    match (taken.candidate.name.as_str(), &taken.candidate.part) {
        (INDEX_OFFSET, _) => Some(EARTH_FIELD.into()),
        (EARTH_FIELD, _) => Some(INDEX_OFFSET.into()),
        (_, Part::AxisTilt) => {
            let size_deg_h = taken.coefficients.first().copied().unwrap_or(0.0);
            is_other_latitude(size_deg_h, up_deg_h).then(|| LATITUDE.to_owned())
        }
        _ => None,
    }
}

/// Not an effect of the gyro: the campaign says another latitude than that of the place.
pub const LATITUDE: &str = "latitude";

/// Whether a rate in proportion to the specific force along the axis, °/h at 1 g, is what a latitude of the wrong sign leaves:
/// the solution takes Ω sin φ times the tilt out with the wrong sign, so that twice that remains.
pub fn is_other_latitude(size_deg_h: f64, up_deg_h: f64) -> bool {
    (size_deg_h + 2.0 * up_deg_h).abs() < OTHER_LATITUDE * 2.0 * up_deg_h.abs()
}

fn effect(taken: &Taken, up_deg_h: f64) -> Effect {
    let candidate = &taken.candidate;
    let mut alone = ErrorModel::default();
    let board =
        candidate.put(taken.constant, &taken.coefficients, &mut alone).is_ok() && alone.off_board(true).is_none();
    let found = if taken.by_references > 0.5 { "surveyed headings" } else { "seconds of the runs" };
    Effect {
        name: candidate.name.clone(),
        kind: candidate.kind,
        channel: candidate.channel.clone(),
        channels: candidate.channels(),
        parameters: candidate.named(taken.constant, &taken.coefficients),
        sigma: candidate.named(taken.constant_sigma, &taken.sigmas),
        p_value: taken.p_value.min(1.0),
        ambiguous_with: confounded(taken, up_deg_h),
        evidence: format!(
            "the weighted sum of squares falls by {:.0} noise variances for {} fitted numbers, mostly by the {found}",
            taken.improvement,
            candidate.freedom()
        ),
        board,
    }
}

/// The candidates of the fit runs with what they were worth before anything was taken.
pub fn candidates(fitted: &Fitted, runs: &[RunData], constant: &[String]) -> Vec<Candidate> {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let all = effects::all(&fit, constant);
    let is_taken = |each: &candidate::Candidate| {
        let same = |taken: &Taken| taken.candidate.full_name() == each.full_name();
        fitted.learned().taken.iter().any(same) || (fitted.by_dwell.is_some() && each.name == "base-motion")
    };
    let mut list: Vec<Candidate> = fitted
        .by_second
        .first
        .iter()
        .filter_map(|scored| Some((scored, all.get(scored.index)?)))
        .map(|(scored, each)| {
            let p_value = chi_square_tail(scored.improvement, each.freedom() as f64);
            let p_value_searched = (p_value * searched(each, all.len())).min(1.0);
            let taken = is_taken(each);
            Candidate {
                name: each.name.clone(),
                kind: each.kind,
                channel: each.channel.clone(),
                freedom: each.freedom(),
                improvement: scored.improvement,
                p_value,
                p_value_searched,
                taken,
                why: why(fitted.learned(), each, taken, p_value_searched),
            }
        })
        .collect();
    list.sort_by(|a, b| b.taken.cmp(&a.taken).then(b.improvement.total_cmp(&a.improvement)));
    list
}

fn why(learned: &Learned, each: &candidate::Candidate, taken: bool, p_value_searched: f64) -> String {
    if taken {
        return "taken: explains most for its penalty".into();
    }
    let alternative_of = learned
        .taken
        .iter()
        .find(|taken| taken.alternatives.iter().any(|(alternative, _)| alternative.full_name() == each.full_name()));
    match alternative_of {
        Some(taken) => format!("this campaign cannot tell it from {}", taken.candidate.full_name()),
        None if learned.spurious.contains(&each.full_name()) => {
            "more stays unexplained than it explains: it may be a spurious term in place of something else".into()
        }
        None if p_value_searched < ACCEPT && learned.taken.is_empty() => {
            let p_value = p_value_in_words(p_value_searched);
            format!("it explains something ({p_value}), but the runs do not predict each other by it")
        }
        None if p_value_searched < ACCEPT => "alone it explains something, beside the taken effects nothing".into(),
        None => format!("chance would do as well (p = {p_value_searched:.2} after the search)"),
    }
}

/// Those that were left.
pub fn rejected(fitted: &Fitted, runs: &[RunData], constant: &[String]) -> Vec<Rejected> {
    candidates(fitted, runs, constant)
        .into_iter()
        .filter(|each| !each.taken)
        .map(|each| Rejected { name: each.name, channel: each.channel, why: each.why })
        .collect()
}

/// Most alternatives that runs are to tell an effect from, the likeliest first.
const MOST_ALTERNATIVES: usize = 6;

/// What would tell apart what this campaign cannot, for the first of the effects of which anything can be told; `sigma_now_deg` is what
/// a usual azimuth is known to.
pub fn next_experiment(fitted: &Fitted, runs: &[RunData], sigma_now_deg: f64) -> Proposal {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let mut inseparable = Vec::new();
    for taken in &fitted.learned().taken {
        let proposal = experiment_for(taken, &fit, sigma_now_deg);
        inseparable.extend(proposal.inseparable);
        inseparable.extend(exactly_confounded(taken, fit.first().map_or(0.0, |run| run.earth.up_deg_h)));
        if proposal.experiment.is_some() {
            return Proposal { experiment: proposal.experiment, inseparable };
        }
    }
    Proposal { experiment: None, inseparable }
}

fn experiment_for(taken: &Taken, fit: &[&RunData], sigma_now_deg: f64) -> Proposal {
    let alternatives = taken.alternatives.iter().take(MOST_ALTERNATIVES);
    let like = fit.iter().max_by(|a, b| shown(a, taken).total_cmp(&shown(b, taken)));
    let Some(like) = like.filter(|_| !taken.alternatives.is_empty()) else { return Proposal::default() };
    let mut names = vec![taken.candidate.full_name()];
    names.extend(alternatives.clone().map(|(alternative, _)| alternative.full_name()));
    let known =
        Possible { candidate: &taken.candidate, constant: taken.constant, coefficients: taken.coefficients.clone() };
    let imitations = alternatives.map(|(alternative, c)| Possible::imitating(alternative, *c, &known, fit));
    let imitations: Vec<Possible> = imitations.collect();
    let effects: Vec<Possible> = std::iter::once(known).chain(imitations).collect();
    let without = experiment::not_imitated(fit.iter().copied(), &effects);
    let follow_channels = effects.iter().any(|effect| !effect.candidate.channels().is_empty());
    experiment::propose(like, &names, follow_channels, sigma_now_deg, |proposed| {
        // The scatter of the coefficients falls with the number of runs.
        let share = fit.len() as f64 / (fit.len() + proposed.len()) as f64;
        let with = experiment::not_imitated(fit.iter().copied().chain(proposed), &effects);
        let added = |(with, without): (&f64, &f64)| 0.5 * (with - without).max(0.0);
        let log_odds = with.iter().zip(&without).map(|(with, without)| with.iter().zip(without).map(added).collect());
        let log_odds = log_odds.collect();
        Some(Expectation { log_odds, sigma_deg: sigma_now_deg * (0.5 * (1.0 + share)).sqrt() })
    })
}

/// How much of an effect a run shows, the sum of its squares.
fn shown(run: &RunData, taken: &Taken) -> f64 {
    let Some(block) = Block::new(run, true, None) else { return 0.0 };
    let columns = taken.candidate.columns(run, taken.constant, &block.smooth_deg_h, block.azimuth_deg);
    let mut whole = vec![0.0; run.samples.len()];
    for (column, size) in columns.iter().zip(&taken.coefficients) {
        whole.iter_mut().zip(column).for_each(|(sum, value)| *sum += size * value);
    }
    whole.iter().map(|value| value * value).sum()
}
