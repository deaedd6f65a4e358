//! What some runs taught: effects, the base's motion, references that are wrong.

use std::collections::BTreeMap;

use learn::{Allowed, Blunder, Common, Family, Learned, Place, Posterior, Run, Standing, Statistics, Taught, Ways};
use north_finder::effects::doubt::Process;
use north_finder::effects::{ChannelName, ErrorModel, effect};
use rayon::prelude::*;

use super::board;
use super::guard;
use super::moving::{self, LevelDrift, Motion, Moved};
use super::names::{self, EARTH_FIELD, FIRST_HARMONIC, GRAVITY_SENSITIVITY, INDEX_OFFSET, LATITUDE, LEVEL_BIAS, Named};
use super::statistics::rms;
use super::{Effect, FamilyEffect, InFamily};
use crate::run_data::RunData;

/// Fewest runs that anything is learned from, where they have azimuths.
const LEAST_RUNS: usize = 3;
/// Relative error up to which sensitivity to gravity is what the other sign of the latitude would do.
const OTHER_LATITUDE: f64 = 0.2;

/// The motion of the base, among effects, and accelerometers that change while it stands.
const BASE_MOTION: &str = "base-motion";
const LEVEL_DRIFT: &str = "level-drift";
/// A process of the runs' own, among what was found.
pub const PROCESS: &str = "a process of every run's own";

/// What some runs taught.
pub struct Found {
    pub learned: Learned,
    pub motion: Option<Motion>,
    level_drift: Option<LevelDrift>,
    /// The model that they were learned with.
    base: ErrorModel,
    /// Files of the runs that were learned from, in the order of the search.
    files: Vec<String>,
    /// What the firmware runs of each model that was learned ([`Learned::models`]).
    models: Vec<ErrorModel>,
    /// Channels that the board of the runs measures beyond those of every second.
    measured: Vec<ChannelName>,
}

/// What is wrong with a reference, by the files of the runs.
pub struct WrongReference {
    pub file: String,
    pub exchanged_with: Option<String>,
}

impl WrongReference {
    /// The one of these that is about a run.
    pub fn of<'a>(wrong: &'a [Self], file: &str) -> Option<&'a Self> {
        wrong.iter().find(|each| each.file == file)
    }

    /// What is made of it.
    pub fn in_words(&self) -> String {
        match &self.exchanged_with {
            Some(other) => format!("its reference is taken to be that of {other}, and the other way round"),
            None => "its reference does not fit the other runs' and is not used".into(),
        }
    }
}

impl Found {
    /// From runs of any role of an instrument of this family: the caller chooses them. What was found in more runs says where those without a survey are taken
    /// to be at first. `None` where there are too few to learn from, or no model can hold what was found.
    pub fn learn(runs: &[&RunData], base: &ErrorModel, family: &Family, of_more: Option<&Self>) -> Option<Self> {
        let measured = board::measured(runs.iter().copied());
        let Searched { motion, level_drift, base, runs: mut of_search } = searched(runs, base)?;
        for run in of_search.iter_mut().filter(|run| run.reference.is_none()) {
            let mut known = of_more.iter().flat_map(|found| &found.learned.runs);
            if let Some(known) = known.find(|known| known.file == run.file && known.reference.is_none()) {
                run.set_azimuth(known.azimuth_deg);
            }
        }
        let files = of_search.iter().map(|run| run.file.clone()).collect();
        let learned = |allowed: &Allowed<'_>| {
            Some(if of_search.is_empty() { Learned::default() } else { learn::learn(of_search, allowed) })
        };
        let (learned, models) = taught(runs, &base, family, learned)?;
        Some(Self { learned, motion, level_drift, base, files, models, measured })
    }

    /// The same, or what is learned of the same runs when the search begins with what some of them taught, where that is likelier.
    pub fn led_by(self, of_some: &[&[effect::Effect]], runs: &[&RunData], family: &Family) -> Self {
        match taught(runs, &self.base, family, |allowed| learn::learn_again(&self.learned, of_some, allowed)) {
            Some((learned, models)) => Self { learned, models, ..self },
            None => self,
        }
    }

    /// What the firmware runs of the likeliest model.
    pub fn model(&self) -> &ErrorModel {
        &self.models[0]
    }

    /// What the firmware runs of the likeliest model that has at most so many effects.
    pub fn with_at_most(&self, effects: usize) -> &ErrorModel {
        let of_few = self.learned.models().zip(&self.models).find(|(taught, _)| taught.effects() <= effects);
        of_few.map_or(self.model(), |(_, model)| model)
    }

    /// Forgets the effects that are missed least, until there are at most so many.
    pub fn forgetting_all_but(mut self, effects: usize) -> Self {
        while self.effects_found() > effects && self.learned.forget_best() {
            self.models.remove(0);
        }
        self
    }

    /// The effects of the likeliest model.
    pub fn likeliest(&self) -> &[effect::Effect] {
        &self.learned.best.posterior.likeliest
    }

    /// How many effects the likeliest model has.
    pub fn effects_found(&self) -> usize {
        self.learned.best.effects()
    }

    /// How the unit stands to its family, by its runs.
    pub fn in_family(&self, family: &Family) -> InFamily {
        let posterior = &self.learned.best.posterior;
        let best = posterior.alternatives.first();
        let members = family.members.iter().map(|common| {
            // With the constants that it has by itself.
            let own = best
                .and_then(|best| best.effects.iter().find(|effect| learn::form(effect) == learn::form(&common.effect)));
            own.filter(|own| own.count() == common.effect.count()).unwrap_or(&common.effect).clone()
        });
        let mut effects: Vec<effect::Effect> = members.collect();
        let of_family = effects.len();
        effects.extend(
            best.iter()
                .flat_map(|best| &best.effects)
                .filter(|each| !effects.iter().any(|own| alike(own, each)))
                .cloned()
                .collect::<Vec<_>>(),
        );
        let statistics = Statistics::of_runs(&self.learned.runs, self.process().as_ref(), &effects);
        let ways: Vec<Ways> = family.members.iter().enumerate().map(|(i, common)| Ways::new(i, common)).collect();
        let signals = learn::signals(&self.learned.runs);
        let others: Vec<(usize, f64)> =
            (of_family..effects.len()).map(|i| (i, learn::form_cost(&effects[i], signals))).collect();
        let standing = Standing::new(&statistics, &ways, &others);
        let of_effect = |(common, place): (&Common, &Option<Place>)| FamilyEffect {
            name: names::full_name(&common.effect),
            share: common.share,
            family: place.as_ref().map_or(0.0, |place| place.family),
            own: place.as_ref().map_or(0.0, |place| place.own),
        };
        InFamily {
            outside: standing.outside,
            effects: family.members.iter().zip(&standing.places).map(of_effect).collect(),
        }
    }

    /// Nothing was learned that a model could hold.
    pub fn is_nothing(&self) -> bool {
        self.learned.best.posterior.effects.is_empty() && self.beside_effects().is_empty()
    }

    /// What was found, in words.
    pub fn in_words(&self) -> Vec<String> {
        self.named().into_iter().map(names::full_name).chain(self.beside_effects()).collect()
    }

    /// The effects that are not in the likeliest model with at most so many, in words.
    pub fn in_words_beyond(&self, effects: usize) -> Vec<String> {
        let kept = self.learned.models().find(|taught| taught.effects() <= effects);
        let is_kept = |effect: &effect::Effect| {
            kept.is_some_and(|taught| taught.posterior.likeliest.iter().any(|each| alike(each, effect)))
        };
        let beyond = self.named().into_iter().filter(|effect| !is_kept(effect));
        beyond.map(names::full_name).collect()
    }

    /// What was found beside the effects, in words.
    pub fn beside_effects(&self) -> Vec<String> {
        let motion = self.motion.is_some().then(|| BASE_MOTION.to_owned());
        let process = self.learned.without_effects().posterior.process.map(|_| PROCESS.to_owned());
        let level_drift = self.level_drift.is_some().then(|| LEVEL_DRIFT.to_owned());
        motion.into_iter().chain(level_drift).chain(process).collect()
    }

    /// References that are wrong, by what the runs say of each other.
    pub fn wrong_references(&self) -> Vec<WrongReference> {
        let file = |i: usize| self.files[i].clone();
        let of = |blunder: &Blunder| match *blunder {
            Blunder::Wrong(i) => vec![WrongReference { file: file(i), exchanged_with: None }],
            Blunder::Exchanged(i, j) => vec![
                WrongReference { file: file(i), exchanged_with: Some(file(j)) },
                WrongReference { file: file(j), exchanged_with: Some(file(i)) },
            ],
        };
        self.learned.blunders.iter().flat_map(of).collect()
    }

    pub fn process(&self) -> Option<Process> {
        self.learned.best.posterior.process
    }

    /// The effects of the likeliest model, with their weights; the strongest first.
    pub fn named(&self) -> Vec<&effect::Effect> {
        let mut sized: Vec<(f64, &effect::Effect)> =
            self.likeliest().iter().map(|each| (self.size_deg_h(each), each)).collect();
        sized.sort_by(|a, b| b.0.total_cmp(&a.0));
        sized.into_iter().map(|(_, effect)| effect).collect()
    }

    /// What other likely models have in the place of an effect of the likeliest one.
    pub fn in_its_place(&self, effect: &effect::Effect) -> Vec<effect::Effect> {
        let alternatives = &self.learned.best.posterior.alternatives;
        let Some(best) = alternatives.first() else { return Vec::new() };
        let without = alternatives.iter().skip(1).filter(|other| !other.effects.iter().any(|own| alike(own, effect)));
        let others = without.flat_map(|other| &other.effects).filter(|each| !best.effects.contains(each));
        let mut unlike: Vec<effect::Effect> = Vec::new();
        for each in others {
            if !unlike.iter().any(|known| alike(known, each)) {
                unlike.push(each.clone());
            }
        }
        unlike
    }

    /// How much the errors of the index change, degrees, root of the sum of their squared weights: without surveyed headings nobody sees what they have in
    /// common at all angles; it may be as large.
    pub fn index_error_deg(&self) -> f64 {
        let of_index = self.named().into_iter().filter(|effect| effect.port == effect::Port::Index);
        of_index.flat_map(|effect| &effect.weights).map(|weight| f64::from(weight * weight)).sum::<f64>().sqrt()
    }

    /// What was found, in words.
    pub fn effects(&self, up_deg_h: f64) -> Vec<Effect> {
        let of_motion = self.motion.map(of_motion);
        let of_products = self.named().into_iter().map(|effect| self.said(effect, up_deg_h));
        of_motion.into_iter().chain(self.level_drift.map(of_level_drift)).chain(of_products).collect()
    }

    fn said(&self, effect: &effect::Effect, up_deg_h: f64) -> Effect {
        let posterior = &self.learned.best.posterior;
        let with = posterior.alternatives.iter().filter(|each| each.effects.iter().any(|own| alike(own, effect)));
        let probability: f64 = with.map(|each| each.probability).sum();
        let place = posterior.likeliest.iter().position(|own| alike(own, effect));
        let log_odds = place.and_then(|place| self.learned.best.gains.get(place)).copied().unwrap_or_default();
        let of_model = self.learned.best.score - self.learned.without_effects().score;
        let channels: Vec<String> = effect.channels().map(|name| name.as_str().to_owned()).collect();
        let mut ambiguous_with: Vec<String> = Vec::new();
        let others = self.in_its_place(effect).iter().map(names::full_name).collect::<Vec<_>>();
        for name in others.into_iter().chain(exactly_confounded(effect, up_deg_h)) {
            if !ambiguous_with.contains(&name) && name != names::full_name(effect) {
                ambiguous_with.push(name);
            }
        }
        let named = Named::new(effect);
        let before = posterior.effects.iter().take_while(|each| !alike(each, effect));
        let first = before.map(effect::Effect::count).sum();
        let mut parameters = named.parameters();
        parameters.insert("rms_deg_h".to_owned(), self.size_deg_h(effect));
        Effect {
            sigma: named.sigma(&posterior.covariance, first),
            name: named.name,
            kind: match effect.port {
                effect::Port::Rate => "bias",
                effect::Port::Scale => "scale",
                effect::Port::Index => "index",
                effect::Port::Forward | effect::Port::Left => "level",
            },
            channel: match channels.as_slice() {
                [one] => Some(one.clone()),
                _ => None,
            },
            channels,
            parameters,
            p_value: chance(log_odds),
            ambiguous_with,
            evidence: format!(
                "log odds {log_odds:.0} of the model over the one without it, {of_model:.0} over the one without any effect; the models that contain it have the \
                 probability {probability:.2} together"
            ),
            board: effect.channels().all(|name| name.is_on_board(&self.measured)),
        }
    }

    /// Root mean square of what an effect adds to the rates of the runs, each run's mean taken out, °/h.
    fn size_deg_h(&self, effect: &effect::Effect) -> f64 {
        let of_run = |run: &Run| {
            let values = run.added_by(effect);
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.into_iter().map(|value| value - mean).collect::<Vec<f64>>()
        };
        rms(&self.learned.runs.iter().flat_map(of_run).collect::<Vec<f64>>())
    }
}

/// What is learned of runs that have this model already, and what the firmware runs of each model that was learned; `None` where nothing is, or no model
/// can hold it.
fn taught(
    runs: &[&RunData],
    base: &ErrorModel,
    family: &Family,
    learned: impl FnOnce(&Allowed<'_>) -> Option<Learned>,
) -> Option<(Learned, Vec<ErrorModel>)> {
    let may_be_used = |posterior: &Posterior, of_search: &[Run]| {
        let model = posterior.written(base, of_search);
        model.is_some_and(|model| guard::impossible(runs, &model).is_none())
    };
    let azimuths = |posterior: &Posterior, of_search: &[Run]| -> Vec<Option<f64>> {
        let model = posterior.written(base, of_search);
        let with = |run: &RunData| Some(run.replay(model.as_ref()?, &mut |_| ()).ok()?.azimuth_deg);
        let of = |own: &Run| runs.iter().find(|run| run.file == own.file).and_then(|run| with(run));
        of_search.par_iter().map(of).collect()
    };
    let mut learned = learned(&Allowed { family, may_be_used: &may_be_used, azimuths: &azimuths })?;
    let written = |taught: &Taught| taught.posterior.written(base, &learned.runs);
    let mut models: Vec<Option<ErrorModel>> = learned.models().map(written).collect();
    // A model that no file has room for is not learned; simpler ones are.
    while models[0].is_none() && learned.forget_best() {
        models.remove(0);
    }
    Some((learned, models.into_iter().collect::<Option<Vec<ErrorModel>>>()?))
}

/// Some runs as the search sees them.
pub struct Searched {
    motion: Option<Motion>,
    level_drift: Option<LevelDrift>,
    /// The model with either.
    base: ErrorModel,
    pub runs: Vec<Run>,
}

/// The motion of the base, or what the accelerometers show in its place, and the runs as the search sees them then; `None` where there are too few.
pub fn searched(runs: &[&RunData], base: &ErrorModel) -> Option<Searched> {
    let of_search: Vec<Run> = runs.par_iter().filter_map(|run| Run::new(run.recording(), runs.len())).collect();
    let least = if runs.iter().all(|run| run.at_one_position()) { 1 } else { LEAST_RUNS };
    if of_search.len() < least {
        return None;
    }
    let motion = Motion::find(runs, &of_search, base);
    if let Some(base) = motion.filter(|motion| motion.way.is_some()).map(|motion| motion.model(base)) {
        // The rates of a moving base's seconds are mostly its motion: what else there is shows in the dwells.
        let runs = runs.par_iter().filter_map(|run| moving::by_dwell(run, &base)).collect();
        return Some(Searched { motion, level_drift: None, base, runs });
    }
    let level_drift = match Moved::new(runs, &of_search, base) {
        // The search learns what the solution leaves.
        Some(moved) if moved.is_felt() => {
            return Some(Searched { motion, level_drift: None, base: base.clone(), runs: moved.runs });
        }
        moved => moved.and_then(|moved| moved.level_drift()),
    };
    let base = level_drift.map_or_else(|| base.clone(), |level_drift| level_drift.model(base));
    let seen = |run: Run| if level_drift.is_some() { run.with_level_errors() } else { run };
    let runs = of_search.into_iter().map(seen).collect();
    Some(Searched { motion: None, level_drift, base, runs })
}

/// Of the same form.
pub fn alike(a: &effect::Effect, b: &effect::Effect) -> bool {
    a.port == b.port && a.factors == b.factors
}

/// Probability that chance alone gives odds like these, at most (Markov's inequality).
pub fn chance(log_odds: f64) -> f64 {
    (-log_odds).exp().min(1.0)
}

fn of_motion(motion: Motion) -> Effect {
    Effect {
        parameters: [("gain", motion.gain), ("window_s", motion.window_s)].map(said).into(),
        sigma: [("gain", motion.gain_sigma)].map(said).into(),
        evidence: format!(
            "log odds {:.0} that the gyro feels the turning of the base which the accelerometers show",
            motion.log_odds
        ),
        ..beside(BASE_MOTION, motion.log_odds)
    }
}

fn of_level_drift(level_drift: LevelDrift) -> Effect {
    Effect {
        parameters: [("range_arcsec", level_drift.range_arcsec)].map(said).into(),
        evidence: format!(
            "log odds {:.0} that the base stands over that it turns as the accelerometers show it",
            level_drift.log_odds
        ),
        ..beside(LEVEL_DRIFT, level_drift.log_odds)
    }
}

fn said((name, value): (&str, f64)) -> (String, f64) {
    (name.to_owned(), value)
}

/// What is no product.
fn beside(name: &'static str, log_odds: f64) -> Effect {
    Effect {
        name: name.into(),
        kind: name,
        channel: None,
        channels: Vec::new(),
        parameters: BTreeMap::new(),
        sigma: BTreeMap::new(),
        p_value: chance(log_odds),
        ambiguous_with: Vec::new(),
        evidence: String::new(),
        board: true,
    }
}

/// What has the same equations at this latitude, so that no run tells it from the effect.
pub fn exactly_confounded(effect: &effect::Effect, up_deg_h: f64) -> Option<String> {
    let named = Named::new(effect);
    match named.name.as_str() {
        INDEX_OFFSET => Some(EARTH_FIELD.into()),
        EARTH_FIELD => Some(INDEX_OFFSET.into()),
        // A level that reads δ too much leaves −Ω sin φ (cos θ δ_forward + sin θ δ_left).
        FIRST_HARMONIC => Some(LEVEL_BIAS.into()),
        _ if effect.factors.is_empty() && matches!(effect.port, effect::Port::Forward | effect::Port::Left) => {
            Some(FIRST_HARMONIC.into())
        }
        GRAVITY_SENSITIVITY => {
            let size_deg_h = named.parameters().get("deg_h_per_g").copied()?;
            is_other_latitude(size_deg_h, up_deg_h).then(|| LATITUDE.to_owned())
        }
        _ => None,
    }
}

/// Whether a rate in proportion to the specific force along the axis, °/h at 1 g, is what a latitude of the wrong sign leaves:
/// the solution takes Ω sin φ times the tilt out with the wrong sign, so that twice that remains.
fn is_other_latitude(size_deg_h: f64, up_deg_h: f64) -> bool {
    (size_deg_h + 2.0 * up_deg_h).abs() < OTHER_LATITUDE * 2.0 * up_deg_h.abs()
}
