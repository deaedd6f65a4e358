//! From what was learned to the diagnosis: azimuths, residuals, words.

use north_finder::effects::ErrorModel;
use north_finder::event::Fix;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::experiment::Proposal;
use super::found::{Found, WrongReference};
use super::moving;
use super::residual::Residuals;
use super::statistics::{median, rms_with_interval};
use super::turn::Turn;
use super::validate::{self, Validated};
use super::{
    Diagnosis, InFamily, NoiseTests, Options, Origin, RunDiagnosis, Spectra, Warning, advice, doubt, findings, guard,
    missed, stations, still, unexplained, verdict,
};
use super::{board, checks};
use crate::campaign::{Campaign, Role};
use crate::run_data::RunData;

/// Most runs of a campaign of which each is left out in turn without being asked for.
const LEFT_OUT: usize = 8;

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
    /// An index error, the same in all runs, that was taken out of them beforehand.
    pub turn: Option<Turn>,
    /// The model that the runs were made with.
    pub base: &'a ErrorModel,
    /// There are still recordings only.
    pub still: bool,
}

/// What was found, and what of it is used.
struct Judged {
    /// The effects that are used, and what was found beside them.
    found: Option<Found>,
    validated: Validated,
    family: Option<InFamily>,
    wrong: Vec<WrongReference>,
    /// The files of these.
    wrong_files: Vec<String>,
    /// All that was found, where it is not used and no reference says how far the azimuths are off.
    given_up: Option<ErrorModel>,
}

impl Judged {
    /// By runs that took no part in learning.
    fn new(material: &Material<'_>, found: Option<Found>, options: &Options) -> Self {
        let &Material { runs, base, .. } = material;
        let wrong = found.as_ref().map_or(Vec::new(), Found::wrong_references);
        let wrong_files: Vec<String> = wrong.iter().map(|each| each.file.clone()).collect();
        let judged = found.as_ref().filter(|found| !found.is_nothing());
        let folds = judged.map(|found| validate::folds(runs, found, base, &options.family, &wrong_files));
        let found = found.map(|found| match &folds {
            Some(folds) => folds.lead(found, &options.family),
            None => found,
        });
        let validated = validate::validated(runs, found.as_ref().zip(folds.as_ref()), base, &wrong_files);
        let with_family = found.as_ref().filter(|_| !options.family.members.is_empty());
        let family = with_family.map(|found| found.in_family(&options.family));
        let is_given_up = validated.withdrawn.is_some() && !guard::is_surveyed(runs, &wrong_files);
        let given_up = found.as_ref().filter(|_| is_given_up).map(|found| found.model().clone());
        let found = found.map(|found| found.forgetting_all_but(validated.effects.unwrap_or(0)));
        Self { found, validated, family, wrong, wrong_files, given_up }
    }

    /// What is used of what was found.
    fn used(&self) -> Option<&Found> {
        let is_used = |found: &&Found| self.validated.withdrawn.is_none() || found.effects_found() > 0;
        self.found.as_ref().filter(is_used)
    }
}

pub fn diagnosis(
    material: &Material<'_>,
    found: Option<Found>,
    options: &Options,
    mut warnings: Vec<Warning>,
) -> Diagnosis {
    let &Material { campaign, runs, .. } = material;
    let judged = Judged::new(material, found, options);
    let model = model_of(material, &judged);
    missed::warn_of_outliers(runs, &mut warnings);
    checks::warn_of_range(runs, &model, &mut warnings);
    let mut diagnosis = Diagnosis {
        title: campaign.title.clone(),
        origin: Origin {
            version: env!("CARGO_PKG_VERSION"),
            made: None,
            instrument: campaign.instrument.as_ref().and_then(|instrument| instrument.name.clone()),
            latitude_deg: campaign.latitude_deg,
        },
        model,
        warnings,
        withdrawn: judged.validated.withdrawn.clone(),
        family: judged.family.clone(),
        ..Diagnosis::default()
    };
    put_azimuths(&mut diagnosis, material, &judged);
    put_left_out(&mut diagnosis, material, &judged, options);
    put_residuals(&mut diagnosis, material, &judged);
    put_effects(&mut diagnosis, material, &judged);
    diagnosis.verdict = verdict::sentence(&diagnosis);
    if diagnosis.next_experiment.is_none() {
        diagnosis.next_experiment = advice::of(&diagnosis, runs);
    }
    diagnosis
}

/// Azimuths with the model, their errors, and the references that they miss.
fn put_azimuths(diagnosis: &mut Diagnosis, material: &Material<'_>, judged: &Judged) {
    let &Material { runs, as_recorded, .. } = material;
    let model = &diagnosis.model;
    let afters = after(runs, model);
    let records = records(material, &afters, &judged.validated, &judged.wrong);
    let errors = |of: fn(&RunDiagnosis) -> Option<f64>| records.iter().filter_map(of).collect::<Vec<_>>();
    let before = rms_with_interval(&errors(|run| run.error_before_deg));
    let after = rms_with_interval(&errors(|run| run.error_after_deg));
    let board_lacks = board::lacks(model, &board::measured(runs.iter()));
    let azimuth_rms_board_deg = if board_lacks.is_empty() {
        after.map(|each| each.0)
    } else {
        rms_on_board_deg(runs, &records, &afters, &board::model(model, runs))
    };
    let recorded_deg = as_recorded.iter().map(|fix| Some(fix.as_ref()?.azimuth_deg)).collect::<Vec<_>>();
    let by_others = records.iter().map(|run| run.azimuth_left_out_deg.or(run.azimuth_after_deg)).collect::<Vec<_>>();
    let station_spread_after_deg = stations::spread_deg(runs, &by_others);
    diagnosis.judged_runs = errors(|run| run.error_after_deg).len();
    diagnosis.azimuth_rms_before_deg = before.map(|each| each.0);
    diagnosis.azimuth_rms_after_deg = after.map(|each| each.0);
    diagnosis.azimuth_rms_board_deg = azimuth_rms_board_deg;
    diagnosis.board_lacks = board_lacks;
    diagnosis.azimuth_rms_before_interval_deg = before.map(|each| each.1);
    diagnosis.azimuth_rms_after_interval_deg = after.map(|each| each.1);
    diagnosis.judged_on = match after {
        Some(_) if is_judged_by_checks(runs) => Some("check-runs"),
        Some(_) => Some("cross-validation"),
        None => station_spread_after_deg.map(|_| "stations"),
    };
    diagnosis.station_spread_before_deg = stations::spread_deg(runs, &recorded_deg);
    diagnosis.station_spread_after_deg = station_spread_after_deg;
    diagnosis.missed_references = missed::missed(&records, &judged.wrong, &mut diagnosis.warnings);
    diagnosis.runs = records;
}

/// Each run by all others, where the runs are few or that was asked for.
fn put_left_out(diagnosis: &mut Diagnosis, material: &Material<'_>, judged: &Judged, options: &Options) {
    let &Material { runs, base, .. } = material;
    let few = (3..=LEFT_OUT).contains(&runs.len());
    if few || options.leave_one_out {
        let effects = judged.validated.effects;
        diagnosis.leave_one_out = validate::leave_one_out(runs, base, &options.family, &judged.wrong_files, effects);
    }
    if options.leave_one_out && diagnosis.leave_one_out.is_none() {
        let message = "no run is left out: none has a reference or shares a station with another, so that nothing could be judged by it";
        diagnosis.warnings.push(Warning::of_campaign(message.into()));
    }
}

/// What the model leaves of the rates, and whether it is noise.
fn put_residuals(diagnosis: &mut Diagnosis, material: &Material<'_>, judged: &Judged) {
    let &Material { campaign, runs, base, still: is_still, .. } = material;
    let model = &diagnosis.model;
    let with: Vec<RunData> = runs.par_iter().map(|run| run.with(model)).collect();
    let residuals = Residuals::new(runs.iter().collect(), with.iter().collect());
    // Of a base that moves a second's rate is mostly its motion, and with the motion taken out mostly the accelerometers' noise: the dwells are judged.
    let moves = judged.used().is_some_and(|found| found.motion.is_some());
    let dwells: Vec<(RunData, RunData)> = if moves { by_dwells(runs, base, model) } else { Vec::new() };
    let of_dwells = (!dwells.is_empty()).then(|| {
        Residuals::new(dwells.iter().map(|pair| &pair.0).collect(), dwells.iter().map(|pair| &pair.1).collect())
    });
    let noise = noise_tests(campaign, &residuals, of_dwells.as_ref());
    let (series, spectra) = match &of_dwells {
        Some(of_dwells) => (residuals.series_of(of_dwells), Spectra::default()),
        None => {
            let white_deg_h = noise.declared_noise_deg_h.unwrap_or(noise.noise_deg_h);
            (residuals.series(), residuals.spectra(white_deg_h))
        }
    };
    let found = judged.found.as_ref();
    let covered = model.doubt.process.filter(|_| found.is_some());
    let process = covered.or(found.and_then(Found::process)).map(|process| (process, covered.is_some()));
    let mut unexplained = unexplained::evidence(process, runs, &judged.validated.left_out, &judged.wrong_files, &noise);
    let of_judged = of_dwells.as_ref().unwrap_or(&residuals);
    unexplained.extend(note_contradictions(&mut diagnosis.runs, of_judged));
    diagnosis.residual_of = if of_dwells.is_some() { "dwell" } else { "second" };
    diagnosis.residual_rms_before_deg_h = of_judged.judged_rms(&of_judged.before);
    diagnosis.residual_rms_after_deg_h = of_judged.judged_rms(&of_judged.after);
    diagnosis.rate_rms_before_deg_h = is_still.then(|| still::rate_rms_deg_h(runs));
    diagnosis.rate_rms_after_deg_h = is_still.then(|| still::rate_rms_deg_h(&with));
    diagnosis.unexplained = !unexplained.is_empty();
    diagnosis.unexplained_evidence = unexplained;
    diagnosis.series = series;
    diagnosis.spectra = spectra;
    diagnosis.noise = noise;
}

/// The effects by name, those that were left, and what would tell them apart. A turn that was taken out beforehand is one of them, and enters the model.
fn put_effects(diagnosis: &mut Diagnosis, material: &Material<'_>, judged: &Judged) {
    let (runs, used) = (material.runs, judged.used());
    let up_deg_h = runs.first().map_or(0.0, |run| run.earth.up_deg_h);
    diagnosis.effects = used.map_or(Vec::new(), |found| found.effects(up_deg_h));
    if let Some(turn) = material.turn {
        findings::add_turn(&mut diagnosis.effects, turn);
        turn.put(&mut diagnosis.model);
    }
    diagnosis.candidates = judged.found.as_ref().map_or(Vec::new(), findings::candidates);
    diagnosis.rejected = findings::rejected(&diagnosis.candidates);
    let sigmas: Vec<f64> = diagnosis.runs.iter().filter_map(|run| run.sigma_after_deg).collect();
    let proposal = used.map_or_else(Proposal::default, |found| findings::next_experiment(found, runs, median(sigmas)));
    diagnosis.next_experiment = proposal.experiment;
    diagnosis.inseparable = proposal.inseparable;
}

/// Whether a check run has a reference; else the training runs are judged by what others of them taught.
fn is_judged_by_checks(runs: &[RunData]) -> bool {
    runs.iter().any(|run| run.role == Role::Check && run.reference_deg.is_some())
}

/// What is used, with what azimuths miss beyond their sigmas by it, and what nobody sees of it.
fn model_of(material: &Material<'_>, judged: &Judged) -> ErrorModel {
    let (runs, validated, wrong) = (material.runs, &judged.validated, &judged.wrong_files);
    let mut model = doubt::shown(validated.model.clone(), runs);
    let given_up_deg = judged.given_up.as_ref().map_or(0.0, |given_up| {
        doubt::turned_deg(runs, [&doubt::shown(given_up.clone(), runs), &model]).min(doubt::UNKNOWN_DEG)
    });
    if let Some(found) = judged.used().filter(|_| !guard::is_surveyed(runs, wrong)) {
        model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(found.index_error_deg());
    }
    if model != *material.base || validated.withdrawn.is_some() || material.turn.is_some() {
        let missed_deg = guard::missed_beyond_sigma_deg(runs, wrong, &validated.left_out);
        let of_turn_deg = material.turn.map_or(0.0, |turn| turn.sigma_deg);
        let sigma_deg = model.doubt.azimuth_sigma_deg.hypot(missed_deg).hypot(of_turn_deg);
        model.doubt.azimuth_sigma_deg = sigma_deg.hypot(given_up_deg);
    }
    model
}

/// The runs before and after; training runs by what the others taught, too.
fn records(
    material: &Material<'_>,
    afters: &[After],
    validated: &Validated,
    wrong: &[WrongReference],
) -> Vec<RunDiagnosis> {
    let wrong_of = |run: &RunData| WrongReference::of(wrong, &run.file);
    let runs = material.runs;
    let judged_by_checks = is_judged_by_checks(runs);
    let judged = |run: &RunData| {
        let role = if judged_by_checks { Role::Check } else { Role::Fit };
        run.role == role && run.reference_deg.is_some() && (judged_by_checks || wrong_of(run).is_none())
    };
    let of_run = |(i, run): (usize, &RunData)| {
        let left_out = validated.left_out[i].filter(|_| run.role == Role::Fit);
        let by_deg = if judged_by_checks { afters[i].azimuth_deg } else { left_out.map(|fix| fix.azimuth_deg) };
        let mut record = record(run, material.as_recorded[i], &afters[i], judged(run).then_some(by_deg));
        if material.still {
            // That one position gives no azimuth is no news there.
            record.notes.clear();
        }
        record.notes.extend(wrong_of(run).map(WrongReference::in_words));
        record.azimuth_left_out_deg = left_out.map(|fix| fix.azimuth_deg);
        record.sigma_left_out_deg = left_out.map(|fix| fix.sigma_deg);
        record
    };
    runs.iter().enumerate().map(of_run).collect()
}

/// Tests of the seconds; on a moving base of the dwells, which are free of the motion.
fn noise_tests(campaign: &Campaign, residuals: &Residuals, of_dwells: Option<&Residuals>) -> NoiseTests {
    let declared = campaign.instrument.as_ref().and_then(|instrument| instrument.arw_deg_per_sqrt_h);
    let mut after = residuals.tests_after.clone();
    if let Some(of_dwells) = of_dwells {
        after.clone_from(&of_dwells.tests_after);
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

/// The dwells of runs of a base that moves, by the model before and the one that takes the motion out; runs that have an azimuth by both.
fn by_dwells(runs: &[RunData], base: &ErrorModel, model: &ErrorModel) -> Vec<(RunData, RunData)> {
    let of_run = |run: &RunData| Some((moving::dwells_of(run, base)?, moving::dwells_at_rest(run, model)?));
    runs.par_iter().filter_map(of_run).collect()
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

/// Notes in the runs in which what was learned does not hold, and a sentence that names them.
fn note_contradictions(records: &mut [RunDiagnosis], residuals: &Residuals) -> Option<String> {
    let contradicted = residuals.contradicted();
    for (file, before, after) in &contradicted {
        let note = format!(
            "what was learned does not hold in this run: over blocks of seconds its residual changes {after:.1} times as much as white \
             noise with it, {before:.1} times without it"
        );
        records.iter_mut().filter(|record| record.file == *file).for_each(|record| record.notes.push(note.clone()));
    }
    let files: Vec<&str> = contradicted.iter().map(|each| each.0.as_str()).collect();
    (!files.is_empty()).then(|| format!("what was learned does not hold in {}", files.join(", ")))
}

/// `judged_deg` is the azimuth that the error after is of, if there is one; `None` where the run is not judged.
fn record(run: &RunData, before: Option<Fix>, after: &After, judged_deg: Option<Option<f64>>) -> RunDiagnosis {
    let error = |azimuth_deg: Option<f64>| {
        Some(wrap_180_deg(azimuth_deg.filter(|_| judged_deg.is_some())? - run.reference_deg?))
    };
    let mut notes: Vec<String> = run.refusal.iter().map(|refusal| format!("no azimuth before: {refusal}")).collect();
    notes.extend(after.note.clone());
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
