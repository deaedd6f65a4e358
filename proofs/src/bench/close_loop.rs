//! `north bench close-loop`: the loop with the firmware itself, from a hidden effect to azimuths without it.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::hidden::{Hidden, Instrument};
use clap::Args;
use indicatif::ProgressBar;
use north_finder::effects::ErrorModel;
use north_finder::fix::heading::settings::BlockSettings;
use north_finder::settings::Settings;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;
use serde::Serialize;

use super::Bench;
use north::campaign::{Campaign, CampaignWriter, Role, Row, Run};
use north::commands::instrument::OrderName;
use north::commands::number;
use north::diagnose::{Diagnosis, Effect, Options, diagnose};
use north::engine::{self, End, Engine, Outcome, Setup, qemu};
use north::failure::Failure;
use north::interrupt;
use north::model_file::ModelFile;
use north::progress;
use north::recorder::{Recorder, new_campaign, write_run};
use north::settings_file::write_model;

/// Close the loop with the firmware itself: a hidden effect, recorded runs, diagnosis, the model in the settings
///
/// An instrument is drawn with a hidden effect in it. The firmware image in QEMU records runs of it;
/// they are diagnosed; the model that comes out goes into the image's settings in flash; and new runs, which took no part,
/// give their azimuths without and with it, as the firmware reports them.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north bench close-loop --seed 4
  north bench close-loop --effect hysteresis,decay-by-position,base-motion
  north bench close-loop --effect magnet --host --out /tmp/magnet")]
pub struct CloseLoop {
    /// The effect, or "random"; several with commas between them, one instrument after the other
    #[arg(long, value_name = "NAME", default_value = "random", value_parser = hidden, value_delimiter = ',')]
    effect: Vec<HiddenOption>,
    /// Seed of everything random: the instrument, its effect, headings, noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Runs to learn from, 4 to 100
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u64).range(4..=100))]
    runs: u64,
    /// New runs, each without and with the model, 2 to 100
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u64).range(2..=100))]
    new_runs: u64,
    /// Order of the index positions
    #[arg(long, value_enum, default_value_t = OrderName::Plain)]
    order: OrderName,
    /// Latitude, degrees, north positive, -90 to 90
    #[arg(long, value_name = "DEG", default_value_t = 34.75, allow_negative_numbers = true, value_parser = number::<-90, 90>)]
    latitude: f64,
    /// Run the state machine in this process instead of the firmware image in QEMU
    #[arg(long)]
    host: bool,
    /// The firmware image to run; without it the image is built
    #[arg(long, value_name = "FILE", conflicts_with = "host")]
    image: Option<PathBuf>,
    /// Keep the recorded campaign, and the learned model as model.toml, in this new or empty folder; of several in one each in it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// `None`: random.
type HiddenOption = Option<Hidden>;

/// An instrument, what was learned of it, and what that was good for.
#[derive(Serialize)]
pub struct Report {
    engine: &'static str,
    hidden: &'static str,
    truth: String,
    /// What the diagnosis named, with what it cannot be told from.
    effects: Vec<Effect>,
    verdict: String,
    model: ErrorModel,
    runs: Vec<NewRun>,
    rms_before_deg: f64,
    rms_after_deg: f64,
}

/// A run that took no part in learning, twice.
#[derive(Serialize)]
pub struct NewRun {
    true_azimuth_deg: f64,
    before: Fixed,
    after: Fixed,
}

/// What the firmware reports.
#[derive(Clone, Copy, Serialize)]
pub struct Fixed {
    azimuth_deg: f64,
    sigma_deg: f64,
    error_deg: f64,
}

/// Where the firmware runs.
struct Rig<'a> {
    engine: Engine,
    image: Option<PathBuf>,
    instrument: &'a Instrument,
}

impl Bench for CloseLoop {
    type Row = Report;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Report>, Failure> {
        let engine = if self.host { Engine::Host } else { Engine::Qemu };
        let image = self.image(engine)?;
        self.effect.iter().map(|&effect| self.close(effect, engine, image.clone(), out)).collect()
    }
}

impl CloseLoop {
    /// The loop with one instrument.
    fn close(
        &self,
        effect: HiddenOption,
        engine: Engine,
        image: Option<PathBuf>,
        out: &mut dyn Write,
    ) -> Result<Report, Failure> {
        let instrument = Instrument::draw(effect, self.latitude, self.seed);
        let rig = Rig { engine, image, instrument: &instrument };
        let mut settings =
            Settings { latitude_deg: self.latitude, model: Some(ErrorModel::default()), ..Settings::default() };
        settings.sequence.order = self.order.into();
        settings.block = instrument.has_block().then(BlockSettings::default);
        writeln!(out, "hidden     {}: {}", instrument.hidden.name(), instrument.truth)?;
        writeln!(out, "engine     {}", engine.description())?;

        let bar = progress::bar(self.runs + 2 * self.new_runs, "runs");
        let temporary = tempfile::tempdir()?;
        let folder = match &self.out {
            Some(folder) if self.effect.len() > 1 => folder.join(instrument.hidden.name()),
            Some(folder) => folder.clone(),
            None => temporary.path().to_owned(),
        };
        let folder = folder.as_path();
        let campaign = self.record(&rig, &settings, folder, &bar)?;
        let options = Options { settings: settings.clone(), ..Options::default() };
        let diagnosis = diagnose(&campaign, &options).map_err(|refusal| Failure::Refused(refusal.to_string()))?;
        let taught = taught(&settings, &diagnosis, folder)?;

        let before = self.new_fixes(&rig, &settings, &bar)?;
        let after = self.new_fixes(&rig, &taught, &bar)?;
        bar.finish_and_clear();
        let runs: Vec<NewRun> = before
            .into_iter()
            .zip(after)
            .map(|((true_azimuth_deg, before), (_, after))| NewRun { true_azimuth_deg, before, after })
            .collect();
        let rms = |fixed: fn(&NewRun) -> Fixed| {
            (runs.iter().map(|run| fixed(run).error_deg.powi(2)).sum::<f64>() / runs.len() as f64).sqrt()
        };
        let report = Report {
            engine: engine.name(),
            hidden: instrument.hidden.name(),
            truth: instrument.truth.clone(),
            effects: diagnosis.effects,
            verdict: diagnosis.verdict,
            model: diagnosis.model,
            rms_before_deg: rms(|run| run.before),
            rms_after_deg: rms(|run| run.after),
            runs,
        };
        report.print(out)?;
        Ok(report)
    }

    /// The image that all runs share, built once.
    fn image(&self, engine: Engine) -> Result<Option<PathBuf>, Failure> {
        Ok(match (engine, &self.image) {
            (Engine::Host, _) => None,
            (Engine::Qemu, Some(image)) => Some(image.clone()),
            (Engine::Qemu, None) => Some(qemu::image::build(qemu::image::Board::Mps2)?),
        })
    }

    /// The runs to learn from, as a campaign with the simulator's azimuths as survey.
    fn record(
        &self,
        rig: &Rig<'_>,
        settings: &Settings,
        folder: &Path,
        bar: &ProgressBar,
    ) -> Result<Campaign, Failure> {
        CampaignWriter::check_free(folder)?;
        let recorded = (0..self.runs)
            .into_par_iter()
            .map(|number| {
                let mut recorder = Recorder::default();
                let outcome = rig.run(number, settings, &mut |report| recorder.see(report))?;
                bar.inc(1);
                Ok((outcome, recorder))
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        let recorded =
            recorded.into_iter().map(|(outcome, mut recorder)| (outcome.truth.azimuth_deg, recorder.take_rows()));
        write_campaign(folder, "close-loop", &rig.setup(0, settings), recorded)
    }

    /// New runs with these settings: true azimuths and what the firmware reports.
    fn new_fixes(&self, rig: &Rig<'_>, settings: &Settings, bar: &ProgressBar) -> Result<Vec<(f64, Fixed)>, Failure> {
        (self.runs..self.runs + self.new_runs)
            .into_par_iter()
            .map(|number| {
                let outcome = rig.run(number, settings, &mut |_| ())?;
                bar.inc(1);
                let true_deg = outcome.truth.azimuth_deg;
                match outcome.end {
                    End::Fix(fix) => Ok((
                        true_deg,
                        Fixed {
                            azimuth_deg: fix.azimuth_deg,
                            sigma_deg: fix.sigma_deg,
                            error_deg: wrap_180_deg(fix.azimuth_deg - true_deg),
                        },
                    )),
                    End::Fault { fault, .. } => {
                        Err(Failure::Refused(format!("run {number}: {}: {}", fault.name(), fault.meaning())))
                    }
                    End::TimeLimit | End::Interrupted => Err(Failure::Interrupted),
                }
            })
            .collect()
    }
}

/// The simulator's azimuth is exact; a surveyor would give about this, degrees.
pub(super) const SURVEY_SIGMA_DEG: f64 = 0.001;

impl Rig<'_> {
    fn setup(&self, number: u64, settings: &Settings) -> Setup {
        let (scenario, seed) = self.instrument.scenario(number);
        Setup { scenario, seed, settings: Some(settings.clone()) }
    }

    fn run(&self, number: u64, settings: &Settings, observe: &mut engine::Observer<'_>) -> Result<Outcome, Failure> {
        let setup = self.setup(number, settings);
        let outcome = engine::run(self.engine, self.image.as_deref(), &setup, interrupt::flag(), observe)?;
        if outcome.end == End::Interrupted { Err(Failure::Interrupted) } else { Ok(outcome) }
    }
}

impl Report {
    fn print(&self, out: &mut dyn Write) -> Result<(), Failure> {
        if self.effects.is_empty() {
            writeln!(out, "found      nothing")?;
        }
        for effect in &self.effects {
            let sizes: Vec<_> = effect.parameters.iter().map(|(name, value)| format!("{name} {value:+.4}")).collect();
            writeln!(out, "found      {}: {}", effect.name, sizes.join(", "))?;
            if !effect.ambiguous_with.is_empty() {
                writeln!(out, "           which these runs cannot tell from {}", effect.ambiguous_with.join(", "))?;
            }
        }
        writeln!(out, "verdict    {}\n", self.verdict)?;
        writeln!(out, "| new run | true azimuth, ° | before, ° | error, ° | after, ° | error, ° | sigma after, ° |")?;
        writeln!(out, "|---|---|---|---|---|---|---|")?;
        for (number, NewRun { true_azimuth_deg, before, after }) in (1..).zip(&self.runs) {
            writeln!(
                out,
                "| {number} | {true_azimuth_deg:.4} | {:.4} | {:+.4} | {:.4} | {:+.4} | {:.4} |",
                before.azimuth_deg, before.error_deg, after.azimuth_deg, after.error_deg, after.sigma_deg
            )?;
        }
        writeln!(out, "| rms | | | {:.4} | | {:.4} | |", self.rms_before_deg, self.rms_after_deg)?;
        Ok(())
    }
}

/// Runs to learn from as a campaign: their azimuths, degrees, which are the survey, and their rows.
pub(super) fn write_campaign(
    folder: &Path,
    title: &str,
    setup: &Setup,
    recorded: impl IntoIterator<Item = (f64, Vec<Row>)>,
) -> Result<Campaign, Failure> {
    let mut writer = new_campaign(folder, title.into(), setup)?;
    for (number, (azimuth_deg, rows)) in recorded.into_iter().enumerate() {
        let run = Run {
            file: format!("runs/{:03}.csv", number + 1),
            role: Role::Fit,
            reference_azimuth_deg: Some(azimuth_deg),
            reference_sigma_deg: Some(SURVEY_SIGMA_DEG),
            ..Run::default()
        };
        write_run(&writer, &run.file, rows)?;
        writer.add(run);
    }
    writer.finish()?;
    Ok(Campaign::read(folder)?)
}

/// The settings with the learned model by way of its file, as anyone loads it; a board with them must be able to evaluate it.
pub(super) fn taught(settings: &Settings, diagnosis: &Diagnosis, folder: &Path) -> Result<Settings, Failure> {
    let path = folder.join("model.toml");
    write_model(&path, &diagnosis.model)?;
    let mut settings = settings.clone();
    ModelFile::read(&path)?.apply_to_board(&mut settings)?;
    Ok(settings)
}

fn hidden(name: &str) -> Result<HiddenOption, String> {
    match (name, Hidden::named(name)) {
        ("random", _) => Ok(None),
        (_, Some(hidden)) => Ok(Some(hidden)),
        _ => Err(format!("effects are: random, {}", Hidden::ALL.map(Hidden::name).join(", "))),
    }
}
