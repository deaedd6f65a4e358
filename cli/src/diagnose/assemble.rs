//! From what was learned to the diagnosis: azimuths, residuals, words.

use north_finder::effects::ErrorModel;
use north_finder::effects::doubt::Process;
use north_finder::event::Fix;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::composition::{self, Composition, WrongReference};
use super::residual::Residuals;
use super::stations;
use super::statistics::{median, rms, rms_with_interval};
use super::still;
use super::{
    Diagnosis, Effect, Fitted, LeaveOneOut, MissedReference, NoiseTests, Options, Origin, Refusal, RunDiagnosis,
    Warning, doubt, findings, fit_training_runs, guard, judge, turn, unexplained, verdict,
};
use super::{board, checks};
use crate::campaign::{Campaign, Role};
use crate::run_data::RunData;

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

/// What a diagnosis is made from.
pub struct Material<'a> {
    pub campaign: &'a Campaign,
    pub runs: &'a [RunData],
    /// The runs' fixes before anything was learned or taken out of them.
    pub as_recorded: &'a [Option<Fix>],
    /// Channels that never change.
    pub constant: &'a [String],
    /// The model that the runs were made with.
    pub base: &'a ErrorModel,
    /// There are still recordings only.
    pub still: bool,
}

pub fn diagnosis(
    material: &Material<'_>,
    fitted: &Fitted,
    found: Option<&Composition>,
    options: &Options,
    mut warnings: Vec<Warning>,
) -> Result<Diagnosis, Refusal> {
    let &Material { campaign, runs, as_recorded, constant, base, still: is_still } = material;
    let judged_by_checks = runs.iter().any(|run| run.role == Role::Check && run.reference_deg.is_some());
    let bad: Vec<String> = fitted.bad_references.iter().map(|(file, _)| file.clone()).collect();
    let choice = choose(runs, fitted, found, base, &bad);
    let bare;
    let fitted = if choice.composition.is_some() {
        bare = fitted.bare();
        &bare
    } else {
        fitted
    };
    let learned = fitted.learned();
    let mut model = match &choice.composition {
        Some(composition) => composition.model.clone(),
        None => model_of(fitted, base, runs)?,
    };
    if choice.composition.is_none() && model.doubt.process.is_none() {
        model.doubt.process = choice.process;
    }
    let mut model = doubt::shown(model, runs);
    let unseen_deg = guard::unseen_index_offset_deg(runs, fitted);
    model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(unseen_deg);
    let left_out = match &choice.left_out {
        Some(fixes) => fixes.clone(),
        None if fitted.is_empty() => runs.iter().map(|run| run.before).collect(),
        None => guard::left_out(runs, fitted, base),
    };
    let missed_deg = guard::missed_beyond_sigma_deg(runs, fitted, &left_out);
    if choice.composition.is_some() || !fitted.is_empty() || model.doubt.process.is_some() {
        model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(missed_deg);
    }
    let afters = after(runs, &model);
    let wrong = found.map_or(Vec::new(), Composition::wrong_references);
    warn_of_runs(runs, fitted, &wrong, &mut warnings);
    checks::warn_of_range(runs, learned, &mut warnings);
    let crossed_deg: Vec<Option<f64>> = match &choice.left_out {
        Some(fixes) => fixes.iter().map(|fix| Some(fix.as_ref()?.azimuth_deg)).collect(),
        None if judged_by_checks => vec![None; runs.len()],
        None => cross_validated(runs, base, constant, fitted),
    };
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
    let errors = |of: fn(&RunDiagnosis) -> Option<f64>| records.iter().filter_map(of).collect::<Vec<_>>();
    let judged_runs = errors(|run| run.error_after_deg).len();
    let before = rms_with_interval(&errors(|run| run.error_before_deg));
    let rms_after = rms_with_interval(&errors(|run| run.error_after_deg));
    for (record, fix) in records.iter_mut().zip(&left_out).filter(|(record, _)| record.role == Role::Fit) {
        record.azimuth_left_out_deg = fix.map(|fix| fix.azimuth_deg);
        record.sigma_left_out_deg = fix.map(|fix| fix.sigma_deg);
    }
    let missed_references = warn_of_misses(&records, &bad, &wrong, &mut warnings);
    let board_lacks = board::lacks(&model);
    let azimuth_rms_board_deg = if board_lacks.is_empty() {
        rms_after.map(|each| each.0)
    } else {
        rms_on_board_deg(runs, &records, &afters, &board::model(&model, runs))
    };
    let azimuths = |fixes: &[Option<Fix>]| -> Vec<Option<f64>> {
        fixes.iter().map(|fix| Some(fix.as_ref()?.azimuth_deg)).collect()
    };
    let station_spread_before_deg = stations::spread_deg(runs, &azimuths(as_recorded));
    let by_others = records.iter().map(|run| run.azimuth_left_out_deg.or(run.azimuth_after_deg)).collect::<Vec<_>>();
    let station_spread_after_deg = stations::spread_deg(runs, &by_others);
    let few = (3..=LEFT_OUT).contains(&runs.len());
    let left_out = (few || options.leave_one_out)
        .then(|| leave_one_out(runs, base, constant, &bad, choice.composition.is_some()))
        .flatten();

    let (all, period_s) = (runs.iter().collect(), fitted.sinusoid_period_s());
    let residuals = if choice.composition.is_some() {
        let without: Vec<RunData> = runs.par_iter().map(|run| run.with(&model)).collect();
        Residuals::beside(all, without.iter().collect(), &[], period_s)
    } else {
        Residuals::new(all, &fitted.by_second.taken, period_s)
    };
    let sigmas: Vec<f64> = afters.iter().filter_map(|after| after.sigma_deg).collect();
    let proposal = findings::next_experiment(fitted, runs, median(sigmas));
    let noise = noise_tests(campaign, runs, &residuals, base, fitted);
    let mut unexplained = match &choice.composition {
        Some(composition) => composition.unexplained(),
        None => unexplained::evidence(fitted, runs, &noise),
    };
    if choice.composition.is_none() {
        unexplained.extend(choice.process.map(composition::in_words));
    }
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
        rate_rms_before_deg_h: is_still.then(|| still::rate_rms_deg_h(runs)),
        rate_rms_after_deg_h: is_still.then(|| {
            let with: Vec<RunData> = runs.par_iter().map(|run| run.with(&model)).collect();
            still::rate_rms_deg_h(&with)
        }),
        azimuth_rms_before_deg: before.map(|each| each.0),
        azimuth_rms_after_deg: rms_after.map(|each| each.0),
        azimuth_rms_board_deg,
        board_lacks,
        azimuth_rms_before_interval_deg: before.map(|each| each.1),
        azimuth_rms_after_interval_deg: rms_after.map(|each| each.1),
        judged_runs,
        leave_one_out: left_out,
        judged_on: match rms_after {
            Some(_) if judged_by_checks => Some("check-runs"),
            Some(_) => Some("cross-validation"),
            None => station_spread_after_deg.map(|_| "stations"),
        },
        station_spread_before_deg,
        station_spread_after_deg,
        unexplained: !unexplained.is_empty(),
        unexplained_evidence: unexplained,
        withdrawn: choice
            .withdrawn
            .as_ref()
            .or(fitted.withdrawn.as_ref())
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
    if let Some(composition) = &choice.composition {
        diagnosis.effects.extend(composition.effects());
    }
    diagnosis.verdict = verdict::sentence(&diagnosis);
    Ok(diagnosis)
}

/// What of all that was found is used.
#[derive(Default)]
struct Choice<'a> {
    /// Products of factors in the place of the named effects.
    composition: Option<&'a Composition>,
    /// A process of the runs' own beside the named effects.
    process: Option<Process>,
    /// Training runs by what was learned from the others.
    left_out: Option<Vec<Option<Fix>>>,
    /// Names of products that must not be used, and why.
    withdrawn: Option<(Vec<String>, String)>,
}

/// Named effects or products of factors, by their evidence on the same runs; products must lower the errors of runs that took no part.
fn choose<'a>(
    runs: &[RunData],
    fitted: &Fitted,
    found: Option<&'a Composition>,
    base: &ErrorModel,
    bad: &[String],
) -> Choice<'a> {
    let Some(found) = found.filter(|_| fitted.by_dwell.is_none() && fitted.sinusoid.is_none()) else {
        return Choice::default();
    };
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    let (better, process) = found.against(&fit, &fitted.by_second.taken);
    if !better {
        return Choice { process, ..Choice::default() };
    }
    let left_out = composition::by_the_others(runs, &training_places(runs), composition::FOLDS, base);
    match composition::veto(runs, &found.model, &left_out, bad) {
        None => Choice { composition: Some(found), left_out: Some(left_out), ..Choice::default() },
        Some(why) => {
            let names = found.effects().iter().map(Effect::full_name).collect();
            Choice { process, withdrawn: Some((names, why)), ..Choice::default() }
        }
    }
}

/// Numbers of the runs that may be learned from.
fn training_places(runs: &[RunData]) -> Vec<usize> {
    (0..runs.len()).filter(|&i| runs[i].role == Role::Fit).collect()
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

fn warn_of_runs(runs: &[RunData], fitted: &Fitted, wrong: &[WrongReference], warnings: &mut Vec<Warning>) {
    let exchanged = |file: &str| wrong.iter().any(|each| each.file == file && each.exchanged_with.is_some());
    for (file, error_deg) in fitted.bad_references.iter().filter(|(file, _)| !exchanged(file)) {
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
    let fit = training_places(runs);
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
        let fitted = fit_training_runs(&training, base, constant, &[]);
        let Ok(model) = doubt::model(fitted.learned(), &fitted.base(base), &training) else { continue };
        for (_, &i) in places.iter().enumerate().filter(|(place, _)| inside(*place)) {
            fixes[i] = runs[i].replay(&model, &mut |_| ()).ok();
        }
    }
    fixes
}

/// All runs with a reference or at a station, whatever their role, each by what was learned from all others. Nothing of it enters the model.
fn leave_one_out(
    runs: &[RunData],
    base: &ErrorModel,
    constant: &[String],
    bad: &[String],
    composed: bool,
) -> Option<LeaveOneOut> {
    let places: Vec<usize> = (0..runs.len()).collect();
    let fixes = match composed {
        true => composition::by_the_others(runs, &places, runs.len(), base),
        false => by_the_others(runs, &places, runs.len(), base, constant),
    };
    let errors = |fixes: &[Option<Fix>]| -> Vec<Option<f64>> {
        let azimuths: Vec<Option<f64>> = fixes.iter().map(|fix| Some(fix.as_ref()?.azimuth_deg)).collect();
        let misses = stations::misses_deg(runs, &azimuths).into_iter().zip(runs);
        misses.map(|(miss, run)| miss.filter(|_| !bad.contains(&run.file))).collect()
    };
    let as_read: Vec<Option<Fix>> = runs.iter().map(|run| run.before).collect();
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

/// Azimuth error of the judged runs with what a board can run of the model: that of the whole model, and what the board's differs from it in each run.
fn rms_on_board_deg(
    runs: &[RunData],
    records: &[RunDiagnosis],
    afters: &[After],
    on_board: &ErrorModel,
) -> Option<f64> {
    let error = |((run, record), whole): ((&RunData, &RunDiagnosis), &After)| {
        let fix = run.replay(on_board, &mut |_| ()).ok()?;
        Some(record.error_after_deg? + wrap_180_deg(fix.azimuth_deg - whole.azimuth_deg?))
    };
    let errors: Vec<f64> = runs.iter().zip(records).zip(afters).filter_map(error).collect();
    rms_with_interval(&errors).map(|each| each.0)
}

/// References that are wrong by what the runs say of each other, and runs whose azimuth is far from the reference, whatever was found: something is
/// wrong with one of the two. Bad references are warned of already.
fn warn_of_misses(
    records: &[RunDiagnosis],
    bad: &[String],
    wrong: &[WrongReference],
    warnings: &mut Vec<Warning>,
) -> Vec<MissedReference> {
    let mut missed = Vec::new();
    for run in records {
        let azimuth = run.azimuth_after_deg.zip(run.sigma_after_deg);
        let (Some((azimuth_deg, sigma_deg)), Some(reference_deg)) = (azimuth, run.reference_azimuth_deg) else {
            continue;
        };
        let misses_by_deg = wrap_180_deg(azimuth_deg - reference_deg);
        let sigmas = misses_by_deg.abs() / sigma_deg;
        let found = wrong.iter().find(|each| each.file == run.file);
        let far = misses_by_deg.abs() > MISS_DEG.max(MISS_SIGMAS * sigma_deg);
        if found.is_none() && !far && !bad.contains(&run.file) {
            continue;
        }
        let exchanged_with = found.and_then(|each| each.exchanged_with.clone());
        if let Some(other) = &exchanged_with {
            let message = format!("its reference seems to be that of {other}, and the other way round");
            warnings.push(Warning { run: Some(run.file.clone()), line: None, message });
        } else if far && !bad.contains(&run.file) {
            let message = format!(
                "the azimuth misses the reference by {misses_by_deg:+.2} deg ({sigmas:.0} sigma): the reference, or the run, is wrong"
            );
            warnings.push(Warning { run: Some(run.file.clone()), line: None, message });
        }
        missed.push(MissedReference { file: run.file.clone(), misses_by_deg, sigmas, exchanged_with });
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
        azimuth_left_out_deg: None,
        sigma_left_out_deg: None,
        error_before_deg: error(before.map(|fix| fix.azimuth_deg)),
        error_after_deg: error(judged_deg.flatten()),
        reference_azimuth_deg: run.reference_deg,
        reference_sigma_deg: run.reference_sigma_deg,
        closure_before_deg_h: before.and_then(|fix| fix.closure_deg_h),
        closure_after_deg_h: after.closure_deg_h,
        flags_before: before.map_or(Vec::new(), |fix| fix.flags.iter().map(|flag| flag.name()).collect()),
        flags_after: after.flags.clone(),
        notes,
    }
}
