//! What some runs taught: effects, the base's motion, references that are wrong.

use north_finder::effects::doubt::Process;
use north_finder::effects::{ErrorModel, effect};
use rayon::prelude::*;

use super::Effect;
use super::moving::{self, Motion};
use super::names::{self, EARTH_FIELD, FIRST_HARMONIC, GRAVITY_SENSITIVITY, INDEX_OFFSET, LATITUDE, LEVEL_BIAS, Named};
use super::statistics::rms;
use crate::learn::{self, Blunder, Learned, Run};
use crate::run_data::RunData;

/// Fewest runs that anything is learned from, where they have azimuths.
const LEAST_RUNS: usize = 3;
/// Relative error up to which sensitivity to gravity is what the other sign of the latitude would do.
const OTHER_LATITUDE: f64 = 0.2;

/// What some runs taught.
pub struct Found {
    pub learned: Learned,
    pub motion: Option<Motion>,
    /// Files of the runs that were learned from, in the order of the search.
    files: Vec<String>,
    /// What the firmware runs.
    pub model: ErrorModel,
}

/// What is wrong with a reference, by the files of the runs.
pub struct WrongReference {
    pub file: String,
    pub exchanged_with: Option<String>,
}

impl Found {
    /// From runs of any role: the caller chooses them. `None` where there are too few to learn from, or no model can hold what was found.
    pub fn learn(runs: &[&RunData], base: &ErrorModel) -> Option<Self> {
        let of_search: Vec<Run> = runs.par_iter().filter_map(|run| Run::new(run, runs.len())).collect();
        let least = if runs.iter().all(|run| run.at_one_position()) { 1 } else { LEAST_RUNS };
        if of_search.len() < least {
            return None;
        }
        let motion = Motion::find(runs, &of_search, base);
        let base = motion.map_or_else(|| base.clone(), |motion| motion.model(base));
        let of_search = match motion {
            None => of_search,
            // The rates of a moving base's seconds are mostly its motion: what else there is shows in the dwells.
            Some(_) => {
                let dwells: Vec<RunData> = runs.par_iter().filter_map(|run| moving::dwells_of(run, &base)).collect();
                dwells.par_iter().filter_map(|run| Run::new(run, dwells.len())).collect()
            }
        };
        let files = of_search.iter().map(|run| run.file.clone()).collect();
        let learned = if of_search.is_empty() { Learned::default() } else { learn::learn(of_search) };
        let model = learned.posterior.written(&base, &learned.runs)?;
        Some(Self { learned, motion, files, model })
    }

    /// Nothing was learned that a model could hold.
    pub fn is_nothing(&self) -> bool {
        self.learned.posterior.effects.is_empty() && self.motion.is_none() && self.process().is_none()
    }

    /// The model over `base` without the effects, with the process that suits the runs then.
    pub fn without_effects(&self, base: &ErrorModel) -> ErrorModel {
        let mut model = self.motion.map_or_else(|| base.clone(), |motion| motion.model(base));
        model.doubt.process = self.learned.process_without.or(model.doubt.process);
        model
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
        self.learned.posterior.process
    }

    /// The effects of the likeliest model, with their weights; the strongest first.
    pub fn named(&self) -> Vec<&effect::Effect> {
        let posterior = &self.learned.posterior;
        let best = posterior.alternatives.first().map_or(&[][..], |best| &best.effects);
        let mut sized: Vec<(f64, &effect::Effect)> =
            best.iter().map(|each| posterior.with_weights(each)).map(|each| (self.size_deg_h(each), each)).collect();
        sized.sort_by(|a, b| b.0.total_cmp(&a.0));
        sized.into_iter().map(|(_, effect)| effect).collect()
    }

    /// What other likely models have in the place of an effect of the likeliest one.
    pub fn in_its_place(&self, effect: &effect::Effect) -> Vec<effect::Effect> {
        let alternatives = &self.learned.posterior.alternatives;
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

    /// What was found, in words.
    pub fn effects(&self, up_deg_h: f64) -> Vec<Effect> {
        let of_motion = self.motion.map(|motion| of_motion(&motion));
        let of_products = self.named().into_iter().map(|effect| self.said(effect, up_deg_h));
        of_motion.into_iter().chain(of_products).collect()
    }

    fn said(&self, effect: &effect::Effect, up_deg_h: f64) -> Effect {
        let posterior = &self.learned.posterior;
        let with = posterior.alternatives.iter().filter(|each| each.effects.iter().any(|own| alike(own, effect)));
        let probability: f64 = with.map(|each| each.probability).sum();
        let log_odds = self.learned.score - self.learned.score_without;
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
                "log odds {log_odds:.0} of the model over none; it is in models of together {probability:.2} of the probability"
            ),
            board: effect.channels().all(|name| name.is_on_board(true)),
        }
    }

    /// Root mean square of what an effect adds to the rates of the runs, each run's mean taken out, °/h.
    fn size_deg_h(&self, effect: &effect::Effect) -> f64 {
        let of_run = |run: &Run| {
            let columns = run.columns_of(effect);
            let sum =
                |row: usize| columns.iter().zip(&effect.weights).map(|(c, w)| c[row] * f64::from(*w)).sum::<f64>();
            let values: Vec<f64> = (0..run.rows()).map(sum).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.into_iter().map(|value| value - mean).collect::<Vec<f64>>()
        };
        rms(&self.learned.runs.iter().flat_map(of_run).collect::<Vec<f64>>())
    }
}

/// Of the same form.
pub fn alike(a: &effect::Effect, b: &effect::Effect) -> bool {
    a.port == b.port && a.factors == b.factors
}

/// Probability that chance alone gives odds like these, at most (Markov's inequality).
pub fn chance(log_odds: f64) -> f64 {
    (-log_odds).exp().min(1.0)
}

fn of_motion(motion: &Motion) -> Effect {
    let [parameters, sigma] = [("gain", motion.gain), ("gain", motion.gain_sigma)]
        .map(|(name, value)| (name.to_owned(), value))
        .map(|each| [each].into());
    let mut parameters: std::collections::BTreeMap<String, f64> = parameters;
    parameters.insert("window_s".to_owned(), motion.window_s);
    Effect {
        name: "base-motion".into(),
        kind: "base-motion",
        channel: None,
        channels: Vec::new(),
        parameters,
        sigma,
        p_value: chance(motion.log_odds),
        ambiguous_with: Vec::new(),
        evidence: format!(
            "log odds {:.0} that the gyro feels the turning of the base which the accelerometers show",
            motion.log_odds
        ),
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
