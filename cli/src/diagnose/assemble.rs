//! From what was learned to the diagnosis: azimuths, residuals, words.

use north_finder::effects::ErrorModel;
use north_finder::event::Fix;
use north_finder::units::{RAD_PER_DEG, wrap_180_deg, wrap_360_deg};
use rayon::prelude::*;

use super::checks;
use super::data::RunData;
use super::open::{OffBoard, Open};
use super::residual::Residuals;
use super::statistics::{median, rms, rms_with_interval};
use super::{
    Diagnosis, Fitted, LeaveOneOut, NoiseTests, Options, Origin, Refusal, RunDiagnosis, Warning, doubt, findings,
    fit_training_runs, guard, judge, turn, unexplained, verdict,
};
use crate::campaign::{Campaign, Role};

/// Most folds of the cross-validation.
const FOLDS: usize = 6;
/// Most runs of a campaign of which each is left out in turn without being asked for.
const LEFT_OUT: usize = 8;
/// A reference that is missed by more than this, in degrees and in sigmas, is named.
const MISS_DEG: f64 = 1.0;
const MISS_SIGMAS: f64 = 5.0;

/// A run's azimuth with the model.
#[derive(Clone, Default)]
struct After {
    azimuth_deg: Option<f64>,
    sigma_deg: Option<f64>,
    closure_deg_h: Option<f64>,
    flags: Vec<&'static str>,
    note: Option<String>,
}

/// `as_recorded` are the runs' fixes before anything was learned or taken out of them.
pub fn diagnosis(
    campaign: &Campaign,
    runs: &[RunData],
    as_recorded: &[Option<Fix>],
    constant: &[String],
    fitted: &Fitted,
    options: &Options,
    mut warnings: Vec<Warning>,
) -> Result<Diagnosis, Refusal> {
    let base = &options.settings.model.clone().unwrap_or_default();
    let judged_by_checks = runs.iter().any(|run| run.role == Role::Check && run.reference_deg.is_some());
    let mut model = model_of(fitted, base, runs)?;
    let mut afters = after(runs, &model);
    let bad: Vec<String> = fitted.bad_references.iter().map(|(file, _)| file.clone()).collect();
    let of_named: Vec<Option<f64>> = afters.iter().map(|after| after.azimuth_deg).collect();
    let left_out = || guard::left_out(runs, fitted, base);
    let found =
        if fitted.by_dwell.is_some() { None } else { Open::choose(runs, &fitted.by_second.taken, &bad, left_out) };
    // A sinusoid with a phase of every run's own is such a process, and one that has a name; but there may be more in the runs than one.
    let found = found.filter(|open| {
        let is_named = fitted.sinusoid.is_some() && open.replaces && open.is_process_only();
        !is_named || open.misses_far_less(runs, &left_out(), &bad)
    });
    let structure = found.as_ref().is_some_and(Open::is_structure);
    // Where processes of the runs' own do as well, the named effects are nothing, whether or not these processes help.
    let spurious = found.as_ref().is_some_and(|open| open.replaces && open.is_process_only());
    let (mut open, refused) = match found {
        Some(open) if open.is_better(runs, &of_named, &bad) => (Some(open), None),
        other => (None, other.filter(Open::is_structure)),
    };
    let mut bare = fitted.bare();
    if spurious {
        let names = fitted.learned().taken.iter().map(|each| each.candidate.full_name()).collect();
        bare.withdrawn = Some((names, "processes of the runs' own, which no channel tells, explain as much".into()));
    }
    let fitted = if spurious || open.as_ref().is_some_and(|open| open.replaces) {
        model = model_of(&bare, base, runs)?;
        afters = after(runs, &model);
        &bare
    } else {
        fitted
    };
    let learned = fitted.learned();
    let unseen_deg = guard::unseen_index_offset_deg(runs, fitted);
    if unseen_deg > 0.0 {
        model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(unseen_deg);
        afters = after(runs, &model);
    }
    warn_of_runs(runs, fitted, &mut warnings);
    checks::warn_of_range(runs, learned, &mut warnings);
    let mut crossed_deg: Vec<Option<f64>> =
        if judged_by_checks { vec![None; runs.len()] } else { cross_validated(runs, base, constant, fitted) };
    if open.is_none() && (structure || !fitted.is_empty()) {
        let left_out = match fitted.is_empty() {
            true => runs.iter().map(|run| run.before).collect(),
            false => guard::left_out(runs, fitted, base),
        };
        let missed_deg = guard::missed_beyond_sigma_deg(runs, fitted, &left_out);
        // What is not used may be true all the same.
        let plain: Vec<Option<f64>> = afters.iter().map(|after| after.azimuth_deg).collect();
        let apart_deg = refused.as_ref().map_or(0.0, |open| open.apart_beyond_sigma_deg(&plain));
        if missed_deg.max(apart_deg) > 0.0 {
            model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(missed_deg.max(apart_deg));
            afters = after(runs, &model);
        }
    }
    if let Some(open) = &mut open {
        let written = open.written(runs, &model).and_then(|written| {
            let by_model = after(runs, &written);
            let azimuths: Vec<Option<f64>> = by_model.iter().map(|after| after.azimuth_deg).collect();
            let apart =
                || OffBoard("what the firmware's weights make of it differs from the engine's by too much".into());
            if !open.agrees(&azimuths) {
                return Err(apart());
            }
            let short_deg2 = short_of_engine_deg2(runs, &by_model, open);
            if short_deg2 <= 0.0 {
                return Ok((written, by_model));
            }
            let mut widened = written;
            widened.doubt.azimuth_sigma_deg = widened.doubt.azimuth_sigma_deg.hypot(short_deg2.sqrt());
            let by_model = after(runs, &widened);
            Ok((widened, by_model))
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
        for ((after, own), crossed_deg) in afters.iter_mut().zip(&open.azimuths).zip(&mut crossed_deg) {
            let Some(own) = own else { continue };
            let own_deg = wrap_360_deg(own.azimuth_rad / RAD_PER_DEG);
            // The engine's azimuth of a training run is by a model without it.
            *crossed_deg = Some(own_deg);
            if !open.deployed || after.azimuth_deg.is_none() {
                after.azimuth_deg = Some(own_deg);
                after.sigma_deg = Some((own.sigma_rad / RAD_PER_DEG).hypot(unseen_deg));
            }
        }
    }
    let judged = |run: &RunData| {
        let role = if judged_by_checks { Role::Check } else { Role::Fit };
        run.role == role && run.reference_deg.is_some() && (judged_by_checks || !bad.contains(&run.file))
    };
    let mut records: Vec<RunDiagnosis> = runs
        .iter()
        .zip(as_recorded)
        .zip(afters.iter().zip(&crossed_deg))
        .map(|((run, before), (after, crossed_deg))| {
            let by_deg = if judged_by_checks { after.azimuth_deg } else { *crossed_deg };
            record(run, *before, after, judged(run).then_some(by_deg), fitted)
        })
        .collect();
    let missed_references = warn_of_misses(&records, &bad, &mut warnings);
    let errors = |of: fn(&RunDiagnosis) -> Option<f64>| records.iter().filter_map(of).collect::<Vec<_>>();
    let judged_runs = errors(|run| run.error_after_deg).len();
    let before = rms_with_interval(&errors(|run| run.error_before_deg));
    let rms_after = rms_with_interval(&errors(|run| run.error_after_deg));

    let few = (3..=LEFT_OUT).contains(&runs.len());
    let left_out = (few || options.leave_one_out).then(|| leave_one_out(runs, base, constant, &bad)).flatten();

    let (all, period_s) = (runs.iter().collect(), fitted.sinusoid_period_s());
    let residuals = match &open {
        Some(open) if open.deployed => {
            let without: Vec<RunData> = runs.par_iter().map(|run| run.with(&model)).collect();
            Residuals::beside(all, without.iter().collect(), &[], period_s)
        }
        Some(open) => {
            let without = open.taken_out(runs);
            Residuals::beside(all, without.iter().collect(), &fitted.by_second.taken, period_s)
        }
        None => Residuals::new(all, &fitted.by_second.taken, period_s),
    };
    let sigmas: Vec<f64> = afters.iter().filter_map(|after| after.sigma_deg).collect();
    let sigma_now_deg = median(sigmas);
    let mut proposal = open.as_ref().map(|open| open.next_experiment(runs, sigma_now_deg)).unwrap_or_default();
    if proposal.experiment.is_none() {
        let of_named = findings::next_experiment(fitted, runs, sigma_now_deg);
        proposal.experiment = of_named.experiment;
        proposal.inseparable.extend(of_named.inseparable);
    }
    let noise = noise_tests(campaign, runs, &residuals, base, fitted);
    let mut unexplained = match &open {
        Some(open) => open.unexplained(),
        None => unexplained::evidence(fitted, runs, &noise),
    };
    unexplained.extend(note_contradictions(&mut records, &residuals));
    if let Some(turned_deg) = fitted.turned_deg {
        turn::put(&mut model, turned_deg);
    }
    let mut diagnosis = Diagnosis {
        title: campaign.title.clone(),
        origin: Origin {
            version: env!("CARGO_PKG_VERSION"),
            made: None,
            instrument: campaign.instrument.as_ref().and_then(|instrument| instrument.name.clone()),
            latitude_deg: campaign.latitude_deg,
        },
        verdict: String::new(),
        runs: records,
        rejected: findings::rejected(fitted, runs, constant),
        candidates: findings::candidates(fitted, runs, constant),
        residual_rms_before_deg_h: residuals.judged_rms(&residuals.before),
        residual_rms_after_deg_h: residuals.judged_rms(&residuals.after),
        azimuth_rms_before_deg: before.map(|each| each.0),
        azimuth_rms_after_deg: rms_after.map(|each| each.0),
        azimuth_rms_before_interval_deg: before.map(|each| each.1),
        azimuth_rms_after_interval_deg: rms_after.map(|each| each.1),
        judged_runs,
        leave_one_out: left_out,
        judged_on: rms_after.map(|_| if judged_by_checks { "check-runs" } else { "cross-validation" }),
        unexplained: !unexplained.is_empty(),
        unexplained_evidence: unexplained,
        withdrawn: fitted
            .withdrawn
            .as_ref()
            .map(|(names, why)| format!("{} was found and is not used: {why}", names.join(" and "))),
        missed_references,
        next_experiment: proposal.experiment,
        inseparable: proposal.inseparable,
        series: residuals.series(),
        spectra: residuals.spectra(noise.declared_noise_deg_h.unwrap_or(noise.noise_deg_h)),
        noise,
        warnings,
        effects: findings::found(fitted, runs.first().map_or(0.0, |run| run.earth.up_deg_h)),
        model,
    };
    if let Some(open) = &open {
        diagnosis.effects.extend(open.effects());
    }
    diagnosis.verdict = verdict::sentence(&diagnosis);
    Ok(diagnosis)
}

/// By how much the variances of azimuths by the written model fall short of the engine's, the difference of the two azimuths
/// counted in; mean over the training runs, degrees². The engine averages over models, of which one is written.
fn short_of_engine_deg2(runs: &[RunData], by_model: &[After], open: &Open) -> f64 {
    let short: Vec<f64> = runs
        .iter()
        .zip(by_model.iter().zip(&open.azimuths))
        .filter(|(run, _)| run.role == Role::Fit)
        .filter_map(|(_, (after, own))| {
            let own = own.as_ref()?;
            let apart_deg = wrap_180_deg(after.azimuth_deg? - own.azimuth_rad / RAD_PER_DEG);
            Some((own.sigma_rad / RAD_PER_DEG).powi(2) + apart_deg.powi(2) - after.sigma_deg?.powi(2))
        })
        .collect();
    short.iter().sum::<f64>() / short.len().max(1) as f64
}

/// The model with what was learned, and with its uncertainty.
fn model_of(fitted: &Fitted, base: &ErrorModel, runs: &[RunData]) -> Result<ErrorModel, Refusal> {
    let full = |_| Refusal::Campaign("what was learned has more terms than a model can hold".into());
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let model = doubt::model(fitted.learned(), &fitted.base(base), &fit).map_err(full)?;
    model.validate().map_err(|invalid| Refusal::Campaign(format!("what was learned makes no model: {invalid}")))?;
    Ok(model)
}

/// Tests of the seconds; on a moving base of the dwells, which are free of the motion.
fn noise_tests(
    campaign: &Campaign,
    runs: &[RunData],
    residuals: &Residuals,
    base: &ErrorModel,
    fitted: &Fitted,
) -> NoiseTests {
    let declared = campaign.instrument.as_ref().and_then(|instrument| instrument.arw_deg_per_sqrt_h);
    let mut after = residuals.tests_after.clone();
    if let Some((_, learned)) = &fitted.by_dwell {
        let model = fitted.base(base);
        let dwells: Vec<RunData> = runs.par_iter().filter_map(|run| judge::dwells_of(run, &model)).collect();
        after = Residuals::new(dwells.iter().collect(), &learned.taken, None).tests_after;
        for test in after.iter_mut().filter(|test| matches!(test.name.as_str(), "whiteness" | "periodogram")) {
            test.passed = false;
            test.not_applied = Some("the base's motion is taken out of a dwell's mean, not of its seconds");
        }
    }
    NoiseTests {
        noise_deg_h: residuals.noise_deg_h,
        declared_noise_deg_h: declared.map(|arw| 60.0 * arw),
        before: residuals.tests_before.clone(),
        after,
    }
}

fn warn_of_runs(runs: &[RunData], fitted: &Fitted, warnings: &mut Vec<Warning>) {
    for (file, error_deg) in &fitted.bad_references {
        warnings.push(Warning {
            run: Some(file.clone()),
            line: None,
            message: format!(
                "its reference does not fit the other runs' by {:+.2} deg: it is not used; survey it again",
                -error_deg
            ),
        });
    }
    for (run, &line) in runs.iter().flat_map(|run| run.outliers.iter().map(move |line| (run, line))) {
        warnings.push(Warning {
            run: Some(run.file.clone()),
            line: Some(line),
            message: "the rate jumps for this second: it is left out as an outlier".into(),
        });
    }
}

/// All runs with the model: the azimuths of `north solve --model`.
fn after(runs: &[RunData], model: &ErrorModel) -> Vec<After> {
    let of_run = |run: &RunData| match run.replay(model, &mut |_| ()) {
        Ok(fix) => After {
            azimuth_deg: Some(fix.azimuth_deg),
            sigma_deg: Some(fix.sigma_deg),
            closure_deg_h: fix.closure_deg_h,
            flags: fix.flags.iter().map(|flag| flag.name()).collect(),
            note: None,
        },
        Err(refusal) => After { note: Some(format!("no azimuth after: {refusal}")), ..After::default() },
    };
    runs.par_iter().map(of_run).collect()
}

/// Azimuths of the training runs by models that they took no part in, degrees. Where nothing was learned from all of them, there
/// is nothing to teach.
fn cross_validated(runs: &[RunData], base: &ErrorModel, constant: &[String], fitted: &Fitted) -> Vec<Option<f64>> {
    let fit: Vec<usize> = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit).collect();
    if fitted.is_empty() || fit.len() < 2 {
        return runs.iter().map(|run| Some(run.before?.azimuth_deg)).collect();
    }
    let fixes = by_the_others(runs, &fit, FOLDS, base, constant);
    fixes.into_iter().map(|fix| Some(fix?.azimuth_deg)).collect()
}

/// Each of these runs by what was learned from the others of them, in so many parts at most. In the order of all runs.
fn by_the_others(
    runs: &[RunData],
    places: &[usize],
    folds: usize,
    base: &ErrorModel,
    constant: &[String],
) -> Vec<Option<Fix>> {
    let folds = folds.min(places.len());
    let mut fixes = vec![None; runs.len()];
    for fold in 0..folds {
        let inside = |place: usize| place % folds == fold;
        let training: Vec<&RunData> =
            places.iter().enumerate().filter(|(place, _)| !inside(*place)).map(|(_, &i)| &runs[i]).collect();
        let fitted = fit_training_runs(&training, base, constant);
        let Ok(model) = doubt::model(fitted.learned(), &fitted.base(base), &training) else { continue };
        for (_, &i) in places.iter().enumerate().filter(|(place, _)| inside(*place)) {
            fixes[i] = runs[i].replay(&model, &mut |_| ()).ok();
        }
    }
    fixes
}

/// All runs with a reference, whatever their role, each by what was learned from all others. Nothing of it enters the model.
fn leave_one_out(runs: &[RunData], base: &ErrorModel, constant: &[String], bad: &[String]) -> Option<LeaveOneOut> {
    let places: Vec<usize> = (0..runs.len()).collect();
    let fixes = by_the_others(runs, &places, runs.len(), base, constant);
    let error = |run: &RunData, fix: &Option<Fix>| {
        let reference_deg = run.reference_deg.filter(|_| !bad.contains(&run.file))?;
        Some(wrap_180_deg(fix.as_ref()?.azimuth_deg - reference_deg))
    };
    let before: Vec<f64> = runs.iter().filter_map(|run| error(run, &run.before)).collect();
    let errors_deg: Vec<Option<f64>> = runs.iter().zip(&fixes).map(|(run, fix)| error(run, fix)).collect();
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

/// Runs whose azimuth is far from the reference, whatever was found: something is wrong with one of the two. Their files; those
/// of bad references are warned of already.
fn warn_of_misses(records: &[RunDiagnosis], bad_references: &[String], warnings: &mut Vec<Warning>) -> Vec<String> {
    let mut missed = Vec::new();
    for run in records {
        let azimuth = run.azimuth_after_deg.zip(run.sigma_after_deg);
        let (Some((azimuth_deg, sigma_deg)), Some(reference_deg)) = (azimuth, run.reference_azimuth_deg) else {
            continue;
        };
        let missed_deg = wrap_180_deg(azimuth_deg - reference_deg);
        if missed_deg.abs() > MISS_DEG.max(MISS_SIGMAS * sigma_deg) {
            missed.push(run.file.clone());
            if bad_references.contains(&run.file) {
                continue;
            }
            let message = format!(
                "the azimuth misses the reference by {missed_deg:+.2} deg ({:.0} sigma): the reference, or the run, is wrong",
                missed_deg.abs() / sigma_deg
            );
            warnings.push(Warning { run: Some(run.file.clone()), line: None, message });
        }
    }
    missed
}

/// Notes in the runs in which what was learned does not hold, and a sentence that names them.
fn note_contradictions(records: &mut [RunDiagnosis], residuals: &Residuals) -> Option<String> {
    let contradicted = residuals.contradicted();
    for (place, before, after) in &contradicted {
        records[*place].notes.push(format!(
            "what was learned does not hold in this run: over blocks of seconds its residual changes {after:.1} times as much as white \
             noise with it, {before:.1} times without it"
        ));
    }
    let files: Vec<&str> = contradicted.iter().map(|each| records[each.0].file.as_str()).collect();
    (!files.is_empty()).then(|| format!("what was learned does not hold in {}", files.join(", ")))
}

/// `judged_deg` is the azimuth that the error after is of, if there is one; `None` where the run is not judged.
fn record(
    run: &RunData,
    before: Option<Fix>,
    after: &After,
    judged_deg: Option<Option<f64>>,
    fitted: &Fitted,
) -> RunDiagnosis {
    let error = |azimuth_deg: Option<f64>| {
        Some(wrap_180_deg(azimuth_deg.filter(|_| judged_deg.is_some())? - run.reference_deg?))
    };
    let mut notes: Vec<String> = run.refusal.iter().map(|refusal| format!("no azimuth before: {refusal}")).collect();
    notes.extend(after.note.clone());
    if fitted.bad_references.iter().any(|(file, _)| *file == run.file) {
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
        error_after_deg: error(judged_deg.flatten()),
        reference_azimuth_deg: run.reference_deg,
        closure_before_deg_h: before.and_then(|fix| fix.closure_deg_h),
        closure_after_deg_h: after.closure_deg_h,
        flags_before: before.map_or(Vec::new(), |fix| fix.flags.iter().map(|flag| flag.name()).collect()),
        flags_after: after.flags.clone(),
        notes,
    }
}
