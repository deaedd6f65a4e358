//! What was found and what was left, as the diagnosis reports it.

use super::experiment::{self, Expectation, Proposal};
use super::found::{Found, alike, chance, exactly_confounded};
use super::names::{self, EARTH_FIELD, INDEX_OFFSET, Named};
use super::turn::Turn;
use super::{Candidate, Effect, Rejected};
use crate::campaign::Role;
use crate::run_data::RunData;
use learn::Tried;
use north_finder::effects::effect;

/// Most alternatives that runs are to tell an effect from, the likeliest first.
const MOST_ALTERNATIVES: usize = 6;

/// An index error that was taken out beforehand: with what was found on top of it, or alone.
pub fn add_turn(effects: &mut Vec<Effect>, turn: Turn) {
    if let Some(offset_deg) = effects.iter_mut().find_map(|effect| effect.parameters.get_mut("offset_deg")) {
        *offset_deg += turn.deg;
        return;
    }
    let evidence = format!(
        "every training run's azimuth is off by about {:+.2}°: the index zero, or all references, are turned",
        turn.deg
    );
    let turn = Effect {
        name: INDEX_OFFSET.into(),
        kind: "index",
        channel: None,
        channels: Vec::new(),
        parameters: [("offset_deg".to_owned(), turn.deg)].into(),
        sigma: [("offset_deg".to_owned(), turn.sigma_deg)].into(),
        p_value: 0.0,
        ambiguous_with: vec![EARTH_FIELD.into()],
        evidence,
        board: true,
    };
    effects.insert(0, turn);
}

/// The effects that were tried, with what each was worth before anything was taken.
pub fn candidates(found: &Found) -> Vec<Candidate> {
    let taken = found.named();
    let of_tried = |tried: &Tried| {
        let named = Named::new(&tried.effect);
        let is_taken = taken.iter().any(|each| names::full_name(each) == names::full_name(&tried.effect));
        let channels: Vec<&str> = tried.effect.channels().map(|name| name.as_str()).collect();
        Candidate {
            name: named.name,
            kind: match tried.effect.port {
                effect::Port::Rate => "bias",
                effect::Port::Scale => "scale",
                effect::Port::Index => "index",
                effect::Port::Forward | effect::Port::Left => "level",
            },
            channel: (!channels.is_empty()).then(|| channels.join(" and ")),
            freedom: tried.effect.count()
                + tried.effect.factors.iter().map(|factor| factor.constants().len()).sum::<usize>(),
            improvement: 2.0 * tried.gain,
            p_value: chance(tried.gain),
            p_value_searched: chance(tried.gain - tried.cost),
            taken: is_taken,
            why: why(found, tried, is_taken, !taken.is_empty()),
        }
    };
    let mut list: Vec<Candidate> = learn::tried(&found.learned.runs).iter().map(of_tried).collect();
    list.sort_by(|a, b| b.taken.cmp(&a.taken).then(b.improvement.total_cmp(&a.improvement)));
    list
}

fn why(found: &Found, tried: &Tried, is_taken: bool, any_taken: bool) -> String {
    if is_taken {
        return "taken: the runs predict each other best with it".into();
    }
    let in_place = |own: &&effect::Effect| found.in_its_place(own).iter().any(|other| alike(other, &tried.effect));
    match found.named().into_iter().find(in_place) {
        Some(own) => format!("this campaign cannot tell it from {}", names::full_name(own)),
        None if tried.gain > tried.cost && any_taken => {
            "alone it explains something, beside the taken effects too little".into()
        }
        None if tried.gain > tried.cost => "it explains something, but the runs do not predict each other by it".into(),
        None => format!("its form costs odds of {:.1}, and it gains {:.1} (nats)", tried.cost, tried.gain),
    }
}

/// Those that were left.
pub fn rejected(candidates: &[Candidate]) -> Vec<Rejected> {
    let left = candidates.iter().filter(|each| !each.taken);
    left.map(|each| Rejected { name: each.name.clone(), channel: each.channel.clone(), why: each.why.clone() })
        .collect()
}

/// What would tell apart what this campaign cannot, for the first of the effects of which anything can be told; `sigma_now_deg` is what
/// a usual azimuth is known to.
pub fn next_experiment(found: &Found, runs: &[RunData], sigma_now_deg: f64) -> Proposal {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let up_deg_h = fit.first().map_or(0.0, |run| run.earth.up_deg_h);
    let mut inseparable = Vec::new();
    for effect in found.named() {
        let proposal = experiment_for(found, effect, &fit, sigma_now_deg);
        inseparable.extend(proposal.inseparable);
        inseparable.extend(exactly_confounded(effect, up_deg_h));
        if proposal.experiment.is_some() {
            return Proposal { experiment: proposal.experiment, inseparable };
        }
    }
    Proposal { experiment: None, inseparable }
}

fn experiment_for(found: &Found, effect: &effect::Effect, fit: &[&RunData], sigma_now_deg: f64) -> Proposal {
    let mut alternatives = found.in_its_place(effect);
    alternatives.truncate(MOST_ALTERNATIVES);
    let of_search = &found.learned.runs;
    let shown = |data: &RunData| {
        let own = of_search.iter().filter(|run| run.file == data.file);
        own.flat_map(|run| run.columns_of(effect)).flatten().map(|value| value * value).sum::<f64>()
    };
    let like = fit.iter().max_by(|a, b| shown(a).total_cmp(&shown(b)));
    let Some(like) = like.filter(|_| !alternatives.is_empty()) else { return Proposal::default() };
    let process = found.process();
    let mut possible = vec![effect.clone()];
    possible.extend(alternatives);
    let names: Vec<String> = possible.iter().map(names::full_name).collect();
    let without = learn::imitated(of_search, process.as_ref(), &possible);
    // Every alternative with the weights that imitate the effect best.
    possible.iter_mut().zip(&without[0]).skip(1).for_each(|(own, imitated)| *own = imitated.by.clone());
    let without = learn::imitated(of_search, process.as_ref(), &possible);
    let follow_channels = possible.iter().any(|effect| effect.channels().next().is_some());
    experiment::propose(like, &names, follow_channels, sigma_now_deg, |proposed| {
        let more = proposed.iter().filter_map(|run| learn::Run::new(run.recording(), proposed.len()));
        let together: Vec<learn::Run> = of_search.iter().cloned().chain(more).collect();
        let with = learn::imitated(&together, process.as_ref(), &possible);
        let added = |(with, without): (&learn::Imitated, &learn::Imitated)| 0.5 * (with.left - without.left).max(0.0);
        let log_odds = with.iter().zip(&without).map(|(with, without)| with.iter().zip(without).map(added).collect());
        // The scatter of the weights falls with the number of runs.
        let share = of_search.len() as f64 / together.len() as f64;
        Some(Expectation { log_odds: log_odds.collect(), sigma_deg: sigma_now_deg * (0.5 * (1.0 + share)).sqrt() })
    })
}
