//! Whether what was found is used: by runs that took no part in learning, each judged by what the others taught.

use learn::Family;
use north_finder::effects::ErrorModel;
use north_finder::effects::effect::Effect;
use north_finder::event::Fix;
use rayon::prelude::*;

use super::found::Found;
use super::stations::misses_deg;
use super::statistics::{rms, rms_with_interval};
use super::{LeaveOneOut, doubt, guard};
use crate::campaign::Role;
use crate::run_data::RunData;

/// Folds of the validation, each of which learns again without its share of the runs.
const FOLDS: usize = 4;

/// What of all that was found is used.
pub struct Validated {
    pub model: ErrorModel,
    /// How many of the effects that were found are in the model; `None` where not even what was found beside effects is.
    pub effects: Option<usize>,
    /// Training runs by what was learned from others of them.
    pub left_out: Vec<Option<Fix>>,
    /// What must not be used, and why, in words.
    pub withdrawn: Option<String>,
}

/// A model with some of the effects that were found.
struct Part {
    effects: usize,
    model: ErrorModel,
    /// Those of the folds, with as many effects at most.
    models: Vec<ErrorModel>,
    left_out: Vec<Option<Fix>>,
}

/// The training runs in parts, and what the others of them teach for each part. `found`: what all taught; `wrong`: files whose references are not believed.
pub fn folds<'a>(
    runs: &'a [RunData],
    found: &Found,
    base: &ErrorModel,
    family: &Family,
    wrong: &[String],
) -> Folds<'a> {
    let places: Vec<usize> = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit).collect();
    Folds::learn(runs, places, FOLDS, (base, family), wrong, Some(found))
}

/// Judges what was found: the process of the runs' own and the base's motion alone, then with one effect more each time, the one that is missed most. The
/// last against which no run speaks that took no part in learning it is used. `wrong`: files whose references are not believed.
pub fn validated(
    runs: &[RunData],
    found: Option<(&Found, &Folds<'_>)>,
    base: &ErrorModel,
    wrong: &[String],
) -> Validated {
    let before = || runs.iter().map(|run| run.before).collect();
    let Some((found, folds)) = found else {
        return Validated { model: base.clone(), effects: None, left_out: before(), withdrawn: None };
    };
    let least = usize::from(found.beside_effects().is_empty());
    let mut used: Option<Part> = None;
    let mut why_not = None;
    for effects in least..=found.effects_found() {
        if effects > 0 && !folds.judge() {
            why_not =
                why_not.or(Some("no run that took no part in learning it judges it: the runs are too few".into()));
            break;
        }
        let part = folds.part(found, base, effects);
        // Only effects change rates; those of a moving base's seconds are mostly noise of the accelerometers with it.
        let are_judged = effects > 0 && found.motion.is_none();
        let rates = |role: Role| match role {
            Role::Fit if are_judged => folds.with(&part.models),
            Role::Check if are_judged => checks_with(runs, &part.model),
            _ => Vec::new(),
        };
        let beside = |simpler: &Part| {
            let off = |part: &Part| guard::off_by(&folds.all_with(part)).1;
            let rates = || are_judged.then(|| [off(simpler), off(&part)]);
            guard::veto_beside(runs, wrong, [&simpler.left_out, &part.left_out], rates)
        };
        match guard::veto(runs, &part.model, &part.left_out, wrong, rates).or_else(|| beside(used.as_ref()?)) {
            None => (used, why_not) = (Some(part), None),
            Some(why) => why_not = why_not.or(Some(why)),
        }
    }
    let Some(Part { effects, model, left_out, .. }) = used else {
        let withdrawn = why_not.map(|why| not_used(&found.in_words(), &why));
        return Validated { model: base.clone(), effects: None, left_out: before(), withdrawn };
    };
    let withdrawn = why_not.map(|why| not_used(&found.in_words_beyond(effects), &why));
    Validated { model, effects: Some(effects), left_out, withdrawn }
}

fn not_used(names: &[String], why: &str) -> String {
    let were = if names.len() > 1 { "were found and are" } else { "was found and is" };
    format!("{} {were} not used: {why}", names.join(" and "))
}

/// The check runs, and each with a model taken out of it.
fn checks_with<'a>(runs: &'a [RunData], model: &ErrorModel) -> Vec<(&'a RunData, RunData)> {
    let model = doubt::shown(model.clone(), runs);
    runs.iter().filter(|run| run.role == Role::Check).map(|run| (run, run.with(&model))).collect()
}

/// Some of all runs in parts, and what the others of them taught for each part; nothing where they taught nothing.
pub struct Folds<'a> {
    runs: &'a [RunData],
    places: Vec<usize>,
    found: Vec<Option<Found>>,
}

impl<'a> Folds<'a> {
    /// In so many parts at most. A reference that is not believed teaches nothing: `wrong` are the files of such runs.
    fn learn(
        runs: &'a [RunData],
        places: Vec<usize>,
        folds: usize,
        (base, family): (&ErrorModel, &Family),
        wrong: &[String],
        found: Option<&Found>,
    ) -> Self {
        let without_reference = |run: &RunData| {
            let mut run = wrong.contains(&run.file).then(|| run.clone())?;
            run.reference_deg = None;
            Some(run)
        };
        let unbelieved: Vec<Option<RunData>> = runs.iter().map(without_reference).collect();
        let folds = folds.min(places.len());
        let learned = |fold: usize| {
            let others = places.iter().enumerate().filter(|(place, _)| fold_of(*place, folds) != fold);
            let training: Vec<&RunData> = others.map(|(_, &i)| unbelieved[i].as_ref().unwrap_or(&runs[i])).collect();
            Found::learn(&training, base, family, found)
        };
        let found = (0..folds).into_par_iter().map(learned).collect();
        Self { runs, places, found }
    }

    /// What was found of all the runs, or what is found of them when the search begins with what the others taught for a part, where that is likelier.
    pub fn lead(&self, found: Found, family: &Family) -> Found {
        let all: Vec<&RunData> = self.places.iter().map(|&i| &self.runs[i]).collect();
        let taught: Vec<&[Effect]> = self.found.iter().flatten().map(Found::likeliest).collect();
        found.led_by(&taught, &all, family)
    }

    /// Whether there are runs that took no part in learning: of the training runs some that the others taught something for, or check runs.
    fn judge(&self) -> bool {
        self.found.iter().any(Option::is_some) || self.runs.iter().any(|run| run.role == Role::Check)
    }

    /// What was found with so many effects at most, and what was found in every fold.
    fn part(&self, found: &Found, base: &ErrorModel, effects: usize) -> Part {
        let models = self.models(base, effects);
        Part { effects, model: found.with_at_most(effects).clone(), left_out: self.fixes(&models), models }
    }

    /// The model of every fold, with so many effects at most.
    fn models(&self, base: &ErrorModel, effects: usize) -> Vec<ErrorModel> {
        let of = |found: &Option<Found>| found.as_ref().map_or(base, |found| found.with_at_most(effects)).clone();
        self.found.iter().map(|found| doubt::shown(of(found), self.runs)).collect()
    }

    /// The runs that are in a part, with its model.
    fn pairs<'m>(&self, models: &'m [ErrorModel]) -> impl Iterator<Item = (usize, &'m ErrorModel)> {
        let model = |place: usize| &models[fold_of(place, models.len())];
        self.places.iter().copied().enumerate().map(move |(place, i)| (i, model(place)))
    }

    /// Each run by the model of its part: azimuth and sigma by the firmware's replay, in the order of all runs; `None` where there is no azimuth.
    fn fixes(&self, models: &[ErrorModel]) -> Vec<Option<Fix>> {
        let mut fixes = vec![None; self.runs.len()];
        for (i, model) in self.pairs(models) {
            fixes[i] = self.runs[i].replay(model, &mut |_| ()).ok();
        }
        fixes
    }

    /// Each run of a part for which the others taught something, and with the model of its part taken out.
    fn with(&self, models: &[ErrorModel]) -> Vec<(&'a RunData, RunData)> {
        let taught = |place: usize| self.found[fold_of(place, self.found.len())].is_some();
        let pairs = self.pairs(models).enumerate().filter(|(place, _)| taught(*place));
        pairs.map(|(_, (i, model))| (&self.runs[i], self.runs[i].with(model))).collect()
    }

    /// The same, and the check runs.
    fn all_with(&self, part: &Part) -> Vec<(&'a RunData, RunData)> {
        let mut all = self.with(&part.models);
        all.extend(checks_with(self.runs, &part.model));
        all
    }
}

/// The part that a training run belongs to. Runs whose headings come again and again in the same order are mixed: a part without a heading that the others
/// have would judge what was learned where it was not learned.
fn fold_of(place: usize, folds: usize) -> usize {
    (place + place / folds) % folds
}

/// All runs with a reference or at a station, whatever their role, each by what was learned from all others, with as many effects at most as are used;
/// `None` where nothing is used. Nothing of it enters the model.
pub fn leave_one_out(
    runs: &[RunData],
    base: &ErrorModel,
    family: &Family,
    wrong: &[String],
    effects: Option<usize>,
) -> Option<LeaveOneOut> {
    let folds = Folds::learn(runs, (0..runs.len()).collect(), runs.len(), (base, family), wrong, None);
    let models = effects.map_or_else(|| vec![base.clone(); runs.len()], |effects| folds.models(base, effects));
    let fixes = folds.fixes(&models);
    let errors = |fixes: &[Option<Fix>]| -> Vec<Option<f64>> {
        let azimuths: Vec<Option<f64>> = fixes.iter().map(|fix| Some(fix.as_ref()?.azimuth_deg)).collect();
        let misses = misses_deg(runs, &azimuths).into_iter().zip(runs);
        misses.map(|(miss, run)| miss.filter(|_| !wrong.contains(&run.file))).collect()
    };
    let as_read: Vec<Option<Fix>> = runs.par_iter().map(|run| run.before).collect();
    let before: Vec<f64> = errors(&as_read).into_iter().flatten().collect();
    let errors_deg = errors(&fixes);
    let in_sigmas = errors_deg.iter().zip(runs.iter().zip(&fixes)).filter_map(|(error, (run, fix))| {
        Some(error.as_ref()? / fix.as_ref()?.sigma_deg.hypot(run.reference_sigma_deg))
    });
    let errors: Vec<f64> = errors_deg.iter().flatten().copied().collect();
    let (azimuth_rms_deg, azimuth_rms_interval_deg) = rms_with_interval(&errors)?;
    Some(LeaveOneOut {
        runs: errors.len(),
        azimuth_rms_before_deg: rms_with_interval(&before).map(|each| each.0),
        azimuth_rms_deg,
        azimuth_rms_interval_deg,
        errors_over_sigma_rms: rms(&in_sigmas.collect::<Vec<f64>>()),
        errors_deg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four headings in turn, four times: every part has each of them once. Of as many parts as runs each has one.
    #[test]
    fn parts_have_every_heading() {
        for fold in 0..4 {
            let mut headings: Vec<usize> =
                (0..16).filter(|&place| fold_of(place, 4) == fold).map(|place| place % 4).collect();
            headings.sort_unstable();
            assert_eq!(headings, [0, 1, 2, 3]);
        }
        assert_eq!((0..5).map(|place| fold_of(place, 5)).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    }
}
