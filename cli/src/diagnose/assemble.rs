//! From what was learned to the diagnosis: azimuths, residuals, words.

use north_finder::model::ErrorModel;
use north_finder::settings::Settings;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::candidate;
use super::data::RunData;
use super::learn::{ACCEPT, Learned, Problem, Taken, searched};
use super::noise;
use super::problem::Block;
use super::statistics::{chi_square_tail, median, rms};
use super::{
    Candidate, Diagnosis, Effect, Lesson, NoiseTests, Refusal, Rejected, RunDiagnosis, RunSeries, Warning, experiment,
    judge, study,
};
use crate::campaign::{Campaign, Role};
use crate::solve::{SolveError, solve_file};

/// What is left counts as structure below this probability.
const STRUCTURE: f64 = 1e-4;
/// Most folds of the cross-validation.
const FOLDS: usize = 6;

/// A run's azimuth with the model.
#[derive(Clone, Default)]
struct After {
    azimuth_deg: Option<f64>,
    sigma_deg: Option<f64>,
    closure_deg_h: Option<f64>,
    flags: Vec<&'static str>,
    note: Option<String>,
}

pub fn diagnosis(
    campaign: &Campaign,
    runs: &[RunData],
    constant: &[String],
    base: &ErrorModel,
    lesson: &Lesson,
    mut warnings: Vec<Warning>,
) -> Result<Diagnosis, Refusal> {
    let learned = lesson.learned();
    let model = learned.model(&lesson.base(base));
    model.validate().map_err(|invalid| Refusal::Campaign(format!("what was learned makes no model: {invalid}")))?;
    warn_of_lesson(lesson, &mut warnings);

    let judged_by_checks = runs.iter().any(|run| run.role == Role::Check && run.reference_deg.is_some());
    let mut afters = after(campaign, runs, &model, base, lesson)?;
    let judged: Vec<bool> = if judged_by_checks {
        runs.iter().map(|run| run.role == Role::Check && run.reference_deg.is_some()).collect()
    } else {
        let left_out = cross_validated(runs, base, constant);
        for (after, crossed) in afters.iter_mut().zip(left_out) {
            if let Some(crossed) = crossed {
                *after = crossed;
            }
        }
        let bad = |run: &RunData| lesson.bad_references.iter().any(|(file, _)| *file == run.file);
        runs.iter().map(|run| run.role == Role::Fit && run.reference_deg.is_some() && !bad(run)).collect()
    };
    let records: Vec<RunDiagnosis> = runs
        .iter()
        .zip(&afters)
        .zip(&judged)
        .map(|((run, after), &judged)| record(run, after, judged, lesson))
        .collect();
    let errors = |of: fn(&RunDiagnosis) -> Option<f64>| records.iter().filter_map(of).collect::<Vec<_>>();
    let before = judge::rms_with_interval(&errors(|run| run.error_before_deg));
    let rms_after = judge::rms_with_interval(&errors(|run| run.error_after_deg));

    let residuals = Residuals::new(runs, lesson);
    let noise = residuals.tests(campaign, runs);
    let unexplained = unexplained(lesson, runs);
    let mut effects = effects(lesson);
    effects.extend(own_line(runs, &residuals, lesson));
    let spectra = noise::spectra(
        runs,
        &residuals.before,
        &residuals.after,
        noise.declared_noise_deg_h.unwrap_or(noise.noise_deg_h),
    );
    let mut diagnosis = Diagnosis {
        title: campaign.title.clone(),
        verdict: String::new(),
        runs: records,
        rejected: rejected(lesson, runs, constant),
        candidates: candidates(lesson, runs, constant),
        residual_rms_before_deg_h: residuals.judged_rms(runs, &residuals.before),
        residual_rms_after_deg_h: residuals.judged_rms(runs, &residuals.after),
        azimuth_rms_before_deg: before.map(|each| each.0),
        azimuth_rms_after_deg: rms_after.map(|each| each.0),
        azimuth_rms_before_interval_deg: before.map(|each| each.1),
        azimuth_rms_after_interval_deg: rms_after.map(|each| each.1),
        judged_on: rms_after.map(|_| if judged_by_checks { "check-runs" } else { "cross-validation" }),
        unexplained: !unexplained.is_empty(),
        unexplained_evidence: unexplained,
        next_experiment: next_experiment(lesson, runs),
        noise,
        warnings,
        effects,
        model,
        series: residuals.series(runs),
        spectra,
    };
    diagnosis.verdict = verdict(&diagnosis);
    Ok(diagnosis)
}

fn warn_of_lesson(lesson: &Lesson, warnings: &mut Vec<Warning>) {
    for (file, error_deg) in &lesson.bad_references {
        warnings.push(Warning {
            run: Some(file.clone()),
            line: None,
            message: format!(
                "its reference does not fit the other runs' by {:+.2} deg: it is not used; survey it again",
                -error_deg
            ),
        });
    }
    for (file, line) in &lesson.knocked {
        warnings.push(Warning {
            run: Some(file.clone()),
            line: Some(*line),
            message: "the rate jumps for this second: it is left out".into(),
        });
    }
}

/// All runs with the model, by the same way as `north solve --model`.
fn after(
    campaign: &Campaign,
    runs: &[RunData],
    model: &ErrorModel,
    base: &ErrorModel,
    lesson: &Lesson,
) -> Result<Vec<After>, Refusal> {
    campaign
        .runs
        .par_iter()
        .zip(runs)
        .map(|(run, data)| {
            let settings = Settings { model: Some(model.clone()), ..data.settings.clone() };
            match solve_file(&campaign.path_of(run), &settings) {
                Ok(solution) => {
                    let fix = solution.fix;
                    let of_parameters = match data.solve(model) {
                        Some((own, _)) => judge::parameter_sigma_deg(data, &lesson.base(base), lesson.learned(), &own),
                        None => 0.0,
                    };
                    Ok(After {
                        azimuth_deg: Some(fix.azimuth_deg),
                        sigma_deg: Some(fix.sigma_deg.hypot(of_parameters)),
                        closure_deg_h: fix.closure_deg_h,
                        flags: fix.flags.iter().map(|flag| flag.name()).collect(),
                        note: None,
                    })
                }
                Err(SolveError::File(error)) => Err(error.into()),
                Err(error) => Ok(After { note: Some(format!("no azimuth after: {error}")), ..After::default() }),
            }
        })
        .collect()
}

/// Every fit run by a lesson that it took no part in.
fn cross_validated(runs: &[RunData], base: &ErrorModel, constant: &[String]) -> Vec<Option<After>> {
    let fit: Vec<usize> = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit).collect();
    let folds = FOLDS.min(fit.len());
    let mut afters: Vec<Option<After>> = vec![None; runs.len()];
    if folds < 2 {
        return afters;
    }
    for fold in 0..folds {
        let inside = |place: usize| place % folds == fold;
        let teachers: Vec<&RunData> =
            fit.iter().enumerate().filter(|(place, _)| !inside(*place)).map(|(_, &i)| &runs[i]).collect();
        let lesson = study(&teachers, base, constant);
        for (_, &i) in fit.iter().enumerate().filter(|(place, _)| inside(*place)) {
            let found = judge::azimuth_after(&runs[i], &lesson.base(base), lesson.learned());
            afters[i] = found.map(|(fix, sigma_deg)| After {
                azimuth_deg: Some(fix.azimuth_deg),
                sigma_deg: Some(sigma_deg),
                closure_deg_h: fix.closure_deg_h,
                flags: fix.flags.iter().map(|flag| flag.name()).collect(),
                note: None,
            });
        }
    }
    afters
}

fn record(run: &RunData, after: &After, judged: bool, lesson: &Lesson) -> RunDiagnosis {
    let before = run.before;
    let error = |azimuth_deg: Option<f64>| Some(wrap_180_deg(azimuth_deg? - run.reference_deg?)).filter(|_| judged);
    let mut notes: Vec<String> = run.refusal.iter().map(|refusal| format!("no azimuth before: {refusal}")).collect();
    notes.extend(after.note.clone());
    if lesson.bad_references.iter().any(|(file, _)| *file == run.file) {
        notes.push("its reference does not fit the others and is not used".into());
    }
    RunDiagnosis {
        file: run.file.clone(),
        role: run.role,
        azimuth_before_deg: before.map(|fix| fix.azimuth_deg),
        sigma_before_deg: before.map(|fix| fix.sigma_deg),
        azimuth_after_deg: after.azimuth_deg,
        sigma_after_deg: after.sigma_deg,
        error_before_deg: error(before.map(|fix| fix.azimuth_deg)),
        error_after_deg: error(after.azimuth_deg),
        reference_azimuth_deg: run.reference_deg,
        closure_before_deg_h: before.and_then(|fix| fix.closure_deg_h),
        closure_after_deg_h: after.closure_deg_h,
        flags_before: before.map_or(Vec::new(), |fix| fix.flags.iter().map(|flag| flag.name()).collect()),
        flags_after: after.flags.clone(),
        notes,
    }
}

/// The residual of every run by the cell, before and after, its own azimuth and bias taken out; °/h.
struct Residuals {
    before: Vec<noise::Residual>,
    after: Vec<noise::Residual>,
    noise_deg_h: f64,
}

impl Residuals {
    fn new(runs: &[RunData], lesson: &Lesson) -> Self {
        let taken = &lesson.by_second.taken;
        let of = |run: &RunData| {
            let Some(block) = Block::new(run, false) else {
                let nothing = vec![f64::NAN; run.cells.len()];
                return (nothing.clone(), nothing, f64::NAN);
            };
            let blocks = [block];
            let effects = Problem::new(&blocks).effects(taken);
            let [block] = &blocks;
            let rest: Vec<f64> = block.y.iter().zip(&effects).map(|(y, effect)| y - effect).collect();
            let unweighted = |left: Vec<f64>| {
                left.iter()
                    .zip(&block.root_weight)
                    .map(|(value, weight)| if *weight > 0.0 { value / weight } else { f64::NAN })
                    .collect::<Vec<_>>()
            };
            (unweighted(block.project(&block.y)), unweighted(block.project(&rest)), block.noise_deg_h)
        };
        let found: Vec<_> = runs.par_iter().map(of).collect();
        let noise_deg_h = median(found.iter().map(|each| each.2).filter(|noise| noise.is_finite()).collect());
        let (before, after) = found.into_iter().map(|(before, after, _)| (before, after)).unzip();
        Self { before, after, noise_deg_h }
    }

    fn tests(&self, campaign: &Campaign, runs: &[RunData]) -> NoiseTests {
        let declared = campaign.instrument.as_ref().and_then(|instrument| instrument.arw_deg_per_sqrt_h);
        NoiseTests {
            noise_deg_h: self.noise_deg_h,
            declared_noise_deg_h: declared.map(|arw| 60.0 * arw),
            before: noise::tests(runs, &self.before, self.noise_deg_h),
            after: noise::tests(runs, &self.after, self.noise_deg_h),
        }
    }

    /// Over the check runs, or all if there are none.
    fn judged_rms(&self, runs: &[RunData], residuals: &[noise::Residual]) -> f64 {
        let any_check = runs.iter().any(|run| run.role == Role::Check);
        let values: Vec<f64> = runs
            .iter()
            .zip(residuals)
            .filter(|(run, _)| !any_check || run.role == Role::Check)
            .flat_map(|(_, residual)| residual.iter().copied())
            .filter(|value| value.is_finite())
            .collect();
        rms(&values)
    }

    fn series(&self, runs: &[RunData]) -> Vec<RunSeries> {
        runs.iter()
            .zip(self.before.iter().zip(&self.after))
            .map(|(run, (before, after))| RunSeries {
                file: run.file.clone(),
                t_s: run.cells.iter().map(|cell| cell.t_s).collect(),
                index_deg: run
                    .cells
                    .iter()
                    .map(|cell| cell.sin.atan2(cell.cos).to_degrees().rem_euclid(360.0))
                    .collect(),
                residual_before_deg_h: before.clone(),
                residual_after_deg_h: after.clone(),
                channels: run
                    .channel_names()
                    .into_iter()
                    .filter_map(|name| run.channel(&name).map(|values| (name, values)))
                    .collect(),
            })
            .collect()
    }
}

/// What no candidate explains, in words.
fn unexplained(lesson: &Lesson, runs: &[RunData]) -> Vec<String> {
    let learned = lesson.learned();
    let mut evidence = Vec::new();
    let p_value = chi_square_tail(learned.left * learned.left_freedom, learned.left_freedom);
    if learned.left_freedom > 0.0 && p_value < STRUCTURE {
        evidence.push(format!(
            "what is left changes {:.2} times as much over blocks of seconds as white noise would (p = {p_value:.1e})",
            learned.left.sqrt()
        ));
    }
    if lesson.by_stay.is_none() {
        let fit: Vec<Block> =
            runs.iter().filter(|run| run.role == Role::Fit).filter_map(|run| Block::new(run, true)).collect();
        let problem = Problem::new(&fit);
        let errors: Vec<(f64, f64)> = problem
            .azimuth_errors(&problem.effects(&learned.taken))
            .into_iter()
            .zip(&fit)
            .filter(|(_, block)| lesson.bad_references.iter().all(|(file, _)| *file != block.run.file))
            .filter_map(|(each, _)| each)
            .collect();
        let chi_square: f64 = errors.iter().map(|(error, sigma)| (error / sigma).powi(2)).sum();
        let p_value = chi_square_tail(chi_square, errors.len() as f64);
        if p_value < STRUCTURE {
            evidence.push(format!(
                "azimuths miss their references by {:.1} sigma rms (p = {p_value:.1e})",
                (chi_square / errors.len() as f64).sqrt()
            ));
        }
    }
    evidence
}

fn effects(lesson: &Lesson) -> Vec<Effect> {
    let mut effects: Vec<Effect> = Vec::new();
    if lesson.by_stay.is_some() {
        let base = lesson.by_second.taken.iter().find(|each| each.candidate.name == "base-motion");
        effects.extend(base.map(effect));
    }
    let mut taken: Vec<&Taken> = lesson.learned().taken.iter().collect();
    taken.sort_by(|a, b| b.improvement.total_cmp(&a.improvement));
    effects.extend(taken.into_iter().map(effect));
    effects
}

fn effect(taken: &Taken) -> Effect {
    let candidate = &taken.candidate;
    let board = candidate.term(taken.constant, &taken.coefficients).and_then(|term| term.channel());
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
        board: board.is_none_or(|name| name.is_on_board()),
    }
}

/// A line whose phase is each run's own: nothing that a model could know beforehand. From the fit runs alone.
fn own_line(runs: &[RunData], residuals: &Residuals, lesson: &Lesson) -> Option<Effect> {
    if lesson.by_stay.is_some() || lesson.learned().taken.iter().any(|each| each.candidate.name == "line") {
        return None;
    }
    let fit: Vec<(RunData, noise::Residual)> = runs
        .iter()
        .zip(&residuals.after)
        .filter(|(run, _)| run.role == Role::Fit)
        .map(|(run, residual)| (run.clone(), residual.clone()))
        .collect();
    if fit.is_empty() {
        return None;
    }
    let (fit, left): (Vec<_>, Vec<_>) = fit.into_iter().unzip();
    let (period_s, amplitude_deg_h, p_value) = noise::line(&fit, &left)?;
    Some(Effect {
        name: "line".into(),
        kind: "bias",
        channel: None,
        parameters: [("period_s".to_owned(), period_s), ("amplitude_deg_h".to_owned(), amplitude_deg_h)].into(),
        sigma: Default::default(),
        p_value: p_value.min(1.0),
        ambiguous_with: Vec::new(),
        evidence:
            "a line in the periodogram with a phase of its own in every run: it averages out over a stay, and no \
                   model can foretell it"
                .into(),
        board: false,
    })
}

/// The candidates of the fit runs with what they were worth before anything was taken.
fn candidates(lesson: &Lesson, runs: &[RunData], constant: &[String]) -> Vec<Candidate> {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let all = candidate::all(&fit, constant);
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
        None if p_value_searched < ACCEPT => "alone it explains something, beside the taken effects nothing".into(),
        None => format!("chance would do as well (p = {p_value_searched:.2} after the search)"),
    }
}

fn rejected(lesson: &Lesson, runs: &[RunData], constant: &[String]) -> Vec<Rejected> {
    candidates(lesson, runs, constant)
        .into_iter()
        .filter(|each| !each.taken)
        .map(|each| Rejected { name: each.name, channel: each.channel, why: each.why })
        .collect()
}

fn next_experiment(lesson: &Lesson, runs: &[RunData]) -> Option<super::Experiment> {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let taken = lesson.learned().taken.iter().find(|each| !each.rivals.is_empty())?;
    let rivals: Vec<(&candidate::Candidate, f64)> = taken.rivals.iter().map(|(rival, c)| (rival, *c)).collect();
    experiment::propose(fit.first()?, &fit, (&taken.candidate, taken.constant), &rivals)
}

/// The outcome in a sentence or two.
fn verdict(diagnosis: &Diagnosis) -> String {
    let names: Vec<String> = diagnosis
        .effects
        .iter()
        .map(|effect| {
            effect.channel.as_ref().map_or(effect.name.clone(), |channel| format!("{} ({channel})", effect.name))
        })
        .collect();
    let found = match names.as_slice() {
        [] if diagnosis.unexplained => "The residual is not noise, and no candidate explains it".to_owned(),
        [] => "Nothing was found: the residual is noise".to_owned(),
        names => format!("The model lacked {}", names.join(" and ")),
    };
    let change = match (diagnosis.azimuth_rms_before_deg, diagnosis.azimuth_rms_after_deg) {
        (Some(before), Some(after)) if !names.is_empty() => {
            format!(": azimuth error {before:.3} deg rms before, {after:.3} deg after")
        }
        (_, Some(after)) => format!(": azimuth error {after:.3} deg rms"),
        _ => String::new(),
    };
    let rest =
        if diagnosis.unexplained && !names.is_empty() { "; structure remains that nothing explains" } else { "" };
    let ambiguous = if diagnosis.effects.iter().any(|effect| !effect.ambiguous_with.is_empty()) {
        "; this campaign cannot tell every cause from others"
    } else {
        ""
    };
    format!("{found}{change}{rest}{ambiguous}.")
}
