//! What was found and what was left, as the diagnosis reports it.

use north_finder::effects::ErrorModel;

use super::candidate;
use super::data::RunData;
use super::evidence::searched;
use super::learn::ACCEPT;
use super::learned::{Learned, Taken};
use super::statistics::chi_square_tail;
use super::{Candidate, Effect, Lesson, Rejected, effects, experiment};
use crate::campaign::Role;

/// The effects that were found, the strongest first.
pub fn found(lesson: &Lesson) -> Vec<Effect> {
    let mut effects: Vec<Effect> = Vec::new();
    if lesson.by_stay.is_some() {
        let base = lesson.by_second.taken.iter().find(|each| each.candidate.name == "base-motion");
        effects.extend(base.map(effect));
    }
    let mut taken: Vec<&Taken> = lesson.learned().taken.iter().collect();
    taken.sort_by(|a, b| b.improvement.total_cmp(&a.improvement));
    effects.extend(taken.into_iter().map(effect));
    effects.extend(lesson.line.map(|line| line.effect()));
    effects
}

fn effect(taken: &Taken) -> Effect {
    let candidate = &taken.candidate;
    let mut alone = ErrorModel::default();
    let board = candidate.put(taken.constant, &taken.coefficients, &mut alone).is_ok() && alone.off_board().is_none();
    let mut ambiguous_with: Vec<String> = Vec::new();
    for (rival, _) in &taken.rivals {
        if !ambiguous_with.contains(&rival.full_name()) {
            ambiguous_with.push(rival.full_name());
        }
    }
    let found = if taken.by_references > 0.5 { "surveyed headings" } else { "seconds of the runs" };
    Effect {
        name: candidate.name.clone(),
        kind: candidate.kind,
        channel: candidate.channel.clone(),
        parameters: candidate.named(taken.constant, &taken.coefficients),
        sigma: candidate.named(taken.constant_sigma, &taken.sigmas),
        p_value: taken.p_value.min(1.0),
        ambiguous_with,
        evidence: format!(
            "the weighted sum of squares falls by {:.0} noise variances for {} fitted numbers, mostly by the {found}",
            taken.improvement,
            candidate.freedom()
        ),
        board,
    }
}

/// The candidates of the fit runs with what they were worth before anything was taken.
pub fn candidates(lesson: &Lesson, runs: &[RunData], constant: &[String]) -> Vec<Candidate> {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let all = effects::all(&fit, constant);
    let is_taken = |each: &candidate::Candidate| {
        let same = |taken: &Taken| taken.candidate.full_name() == each.full_name();
        lesson.learned().taken.iter().any(same) || (lesson.by_stay.is_some() && each.name == "base-motion")
    };
    let mut list: Vec<Candidate> = lesson
        .by_second
        .first
        .iter()
        .filter_map(|merit| Some((merit, all.get(merit.index)?)))
        .map(|(merit, each)| {
            let p_value = chi_square_tail(merit.improvement, each.freedom() as f64);
            let p_value_searched = (p_value * searched(each, all.len())).min(1.0);
            let taken = is_taken(each);
            Candidate {
                name: each.name.clone(),
                kind: each.kind,
                channel: each.channel.clone(),
                freedom: each.freedom(),
                improvement: merit.improvement,
                p_value,
                p_value_searched,
                taken,
                why: why(lesson.learned(), each, taken, p_value_searched),
            }
        })
        .collect();
    list.sort_by(|a, b| b.taken.cmp(&a.taken).then(b.improvement.total_cmp(&a.improvement)));
    list
}

fn why(learned: &Learned, each: &candidate::Candidate, taken: bool, p_value_searched: f64) -> String {
    if taken {
        return "taken: explains most for its price".into();
    }
    let rival_of =
        learned.taken.iter().find(|taken| taken.rivals.iter().any(|(rival, _)| rival.full_name() == each.full_name()));
    match rival_of {
        Some(taken) => format!("this campaign cannot tell it from {}", taken.candidate.full_name()),
        None if learned.shadows.contains(&each.full_name()) => {
            "more stays unexplained than it explains: it may be the shadow of something else".into()
        }
        None if p_value_searched < ACCEPT => "alone it explains something, beside the taken effects nothing".into(),
        None => format!("chance would do as well (p = {p_value_searched:.2} after the search)"),
    }
}

/// Those that were left.
pub fn rejected(lesson: &Lesson, runs: &[RunData], constant: &[String]) -> Vec<Rejected> {
    candidates(lesson, runs, constant)
        .into_iter()
        .filter(|each| !each.taken)
        .map(|each| Rejected { name: each.name, channel: each.channel, why: each.why })
        .collect()
}

/// What would tell apart what this campaign cannot.
pub fn next_experiment(lesson: &Lesson, runs: &[RunData]) -> Option<super::Experiment> {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let taken = lesson.learned().taken.iter().find(|each| !each.rivals.is_empty())?;
    let rivals: Vec<(&candidate::Candidate, f64)> = taken.rivals.iter().map(|(rival, c)| (rival, *c)).collect();
    experiment::propose(fit.first()?, &fit, (&taken.candidate, taken.constant), &rivals)
}
