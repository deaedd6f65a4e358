//! From what was learned to the diagnosis: azimuths, residuals, words.

use north_finder::effects::ErrorModel;
use north_finder::settings::Settings;
use north_finder::units::{RAD_PER_DEG, wrap_180_deg, wrap_360_deg};
use rayon::prelude::*;

use super::checks;
use super::data::RunData;
use super::open::{OffBoard, Open};
use super::residual::Residuals;
use super::{
    Diagnosis, Lesson, NoiseTests, Refusal, RunDiagnosis, Warning, findings, judge, study, unexplained, verdict,
};
use crate::campaign::{Campaign, Role};
use crate::solve::{SolveError, solve_file};

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
    let judged_by_checks = runs.iter().any(|run| run.role == Role::Check && run.reference_deg.is_some());
    let mut model = model_of(lesson, base)?;
    let mut afters = after(campaign, runs, &model, base, lesson)?;
    let bad: Vec<String> = lesson.bad_references.iter().map(|(file, _)| file.clone()).collect();
    let of_named: Vec<Option<f64>> = afters.iter().map(|after| after.azimuth_deg).collect();
    let mut open = if lesson.by_stay.is_some() { None } else { Open::choose(runs, &lesson.by_second.taken, &bad) }
        .filter(|open| open.is_better(runs, &of_named, &bad));
    let bare =
        Lesson { bad_references: lesson.bad_references.clone(), knocked: lesson.knocked.clone(), ..Lesson::default() };
    let lesson = if open.as_ref().is_some_and(|open| open.replaces) {
        model = model_of(&bare, base)?;
        afters = after(campaign, runs, &model, base, &bare)?;
        &bare
    } else {
        lesson
    };
    let learned = lesson.learned();
    warn_of_lesson(lesson, &mut warnings);
    checks::warn_of_range(runs, learned, &mut warnings);
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
    if open.is_none() && !learned.taken.is_empty() {
        let missed_deg = missed_beyond_sigma_deg(runs, &afters, &bad);
        model.doubt.azimuth_sigma_deg = missed_deg;
        for after in &mut afters {
            after.sigma_deg = after.sigma_deg.map(|sigma| sigma.hypot(missed_deg));
        }
    }
    if let Some(open) = &mut open {
        let written = open.written(runs, &model).and_then(|written| {
            let by_model =
                after(campaign, runs, &written, base, lesson).map_err(|error| OffBoard(error.to_string()))?;
            let azimuths: Vec<Option<f64>> = by_model.iter().map(|after| after.azimuth_deg).collect();
            let apart =
                || OffBoard("what the firmware's weights make of it differs from the engine's by too much".into());
            if open.agrees(&azimuths) { Ok((written, by_model)) } else { Err(apart()) }
        });
        match written {
            Ok((written, by_model)) => {
                model = written;
                afters = by_model;
                open.deployed = true;
            }
            Err(OffBoard(what)) => warnings.push(Warning {
                run: None,
                line: None,
                message: format!(
                    "the model that is written lacks what the open world learned ({what}): azimuths after are the \
                     engine's own, not those of `north solve --model`"
                ),
            }),
        }
        for ((run, after), own) in runs.iter().zip(&mut afters).zip(&open.azimuths) {
            let Some(own) = own else { continue };
            let left_out = run.role == Role::Fit && !judged_by_checks;
            let own_deg = wrap_360_deg(own.azimuth_rad / RAD_PER_DEG);
            // A training run that is judged has its azimuth by a model without it.
            let azimuth_deg = after.azimuth_deg.filter(|_| open.deployed && !left_out).unwrap_or(own_deg);
            after.azimuth_deg = Some(azimuth_deg);
            after.sigma_deg = Some((own.sigma_rad / RAD_PER_DEG).hypot(wrap_180_deg(azimuth_deg - own_deg)));
        }
    }
    let records: Vec<RunDiagnosis> = runs
        .iter()
        .zip(&afters)
        .zip(&judged)
        .map(|((run, after), &judged)| record(run, after, judged, lesson))
        .collect();
    let errors = |of: fn(&RunDiagnosis) -> Option<f64>| records.iter().filter_map(of).collect::<Vec<_>>();
    let before = judge::rms_with_interval(&errors(|run| run.error_before_deg));
    let rms_after = judge::rms_with_interval(&errors(|run| run.error_after_deg));

    let residuals = Residuals::new(runs.iter().collect(), &lesson.by_second.taken, lesson.line_s());
    let noise = noise_tests(campaign, runs, &residuals, base, lesson);
    let unexplained = match &open {
        Some(open) => open.unexplained(),
        None => unexplained::evidence(lesson, runs, &noise),
    };
    let mut diagnosis = Diagnosis {
        title: campaign.title.clone(),
        verdict: String::new(),
        runs: records,
        rejected: findings::rejected(lesson, runs, constant),
        candidates: findings::candidates(lesson, runs, constant),
        residual_rms_before_deg_h: residuals.judged_rms(&residuals.before),
        residual_rms_after_deg_h: residuals.judged_rms(&residuals.after),
        azimuth_rms_before_deg: before.map(|each| each.0),
        azimuth_rms_after_deg: rms_after.map(|each| each.0),
        azimuth_rms_before_interval_deg: before.map(|each| each.1),
        azimuth_rms_after_interval_deg: rms_after.map(|each| each.1),
        judged_on: rms_after.map(|_| if judged_by_checks { "check-runs" } else { "cross-validation" }),
        unexplained: !unexplained.is_empty(),
        unexplained_evidence: unexplained,
        next_experiment: findings::next_experiment(lesson, runs),
        series: residuals.series(),
        spectra: residuals.spectra(noise.declared_noise_deg_h.unwrap_or(noise.noise_deg_h)),
        noise,
        warnings,
        effects: findings::found(lesson),
        model,
    };
    if let Some(open) = &open {
        diagnosis.effects.extend(open.effects());
    }
    diagnosis.verdict = verdict::sentence(&diagnosis);
    Ok(diagnosis)
}

/// What the azimuths of the fit runs miss their references by beyond their sigmas: root of mean(e² − σ²), at least 0; degrees.
fn missed_beyond_sigma_deg(runs: &[RunData], afters: &[After], bad_references: &[String]) -> f64 {
    let beyond: Vec<f64> = runs
        .iter()
        .zip(afters)
        .filter(|(run, _)| run.role == Role::Fit && !bad_references.contains(&run.file))
        .filter_map(|(run, after)| {
            let error_deg = wrap_180_deg(after.azimuth_deg? - run.reference_deg?);
            Some(error_deg.powi(2) - after.sigma_deg?.powi(2) - run.reference_sigma_deg.powi(2))
        })
        .collect();
    (beyond.iter().sum::<f64>() / beyond.len().max(1) as f64).max(0.0).sqrt()
}

/// The model with what was learned.
fn model_of(lesson: &Lesson, base: &ErrorModel) -> Result<ErrorModel, Refusal> {
    let full = |_| Refusal::Campaign("what was learned has more terms than a model can hold".into());
    let model = lesson.learned().model(&lesson.base(base)).map_err(full)?;
    model.validate().map_err(|invalid| Refusal::Campaign(format!("what was learned makes no model: {invalid}")))?;
    Ok(model)
}

/// Tests of the seconds; on a moving base of the stays, which are free of the motion.
fn noise_tests(
    campaign: &Campaign,
    runs: &[RunData],
    residuals: &Residuals,
    base: &ErrorModel,
    lesson: &Lesson,
) -> NoiseTests {
    let declared = campaign.instrument.as_ref().and_then(|instrument| instrument.arw_deg_per_sqrt_h);
    let mut after = residuals.tests_after.clone();
    if let Some((_, learned)) = &lesson.by_stay {
        let model = lesson.base(base);
        let stays: Vec<RunData> = runs.par_iter().filter_map(|run| judge::stays_of(run, &model)).collect();
        after = Residuals::new(stays.iter().collect(), &learned.taken, None).tests_after;
        after.retain(|test| !matches!(test.name.as_str(), "whiteness" | "lines"));
    }
    NoiseTests {
        noise_deg_h: residuals.noise_deg_h,
        declared_noise_deg_h: declared.map(|arw| 60.0 * arw),
        before: residuals.tests_before.clone(),
        after,
    }
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
