//! `north find`: one fix of the simulated instrument, live.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use north_finder::earth::earth_rate;
use north_finder::event::{Dwell, Event, Fix, Heading};
use north_finder::health::Counters;

use super::instrument::InstrumentOptions;
use crate::campaign::{CampaignWriter, HEADINGS, Run};
use crate::engine::{self, End, Engine, Outcome, Setup};
use crate::failure::Failure;
use crate::interrupt;
use crate::json::{EventRecord, Found, Held, Run as RunRecord};
use crate::output::JsonOption;
use crate::present::{Directions, Reference, View, write_fault, write_fix, write_held};
use crate::recorder::{Recorder, new_campaign, write_headings, write_run};
use crate::report::certificate::Made;
use crate::report::fix::Shown;
use crate::report::{self, ReportOption};

/// Name of the one run in a recording of `north find`.
const RUN: &str = "runs/001.csv";

/// Find north once: the real firmware image in QEMU against the simulated instrument, live
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north find --scenario windy-tripod --seed 7
  north find --host --azimuth 123.4 --order east-west --json -
  north find --scenario creep --record /tmp/creep && north solve /tmp/creep
  north find --report fix.html --certificate certificate.html")]
pub struct Find {
    #[command(flatten)]
    instrument: InstrumentOptions,
    /// Run the state machine in this process instead of the firmware image in QEMU
    #[arg(long)]
    host: bool,
    /// The firmware image to run; without it the image is built, which needs cargo and the sources
    #[arg(long, value_name = "FILE", conflicts_with = "host")]
    image: Option<PathBuf>,
    /// Write a campaign with this run into a new or empty folder
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
    #[command(flatten)]
    directions: Directions,
    #[command(flatten)]
    report: ReportOption,
    /// Write a certificate of the azimuth: one page to print
    #[arg(long, value_name = "C.html")]
    certificate: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// What the reports of a fix leave behind.
#[derive(Default)]
struct Log {
    recorder: Recorder,
    events: Vec<EventRecord>,
    dwells: Vec<Dwell>,
    headings: Vec<(f64, Heading)>,
    health: Option<Counters>,
}

impl Find {
    pub fn run(self) -> Result<(), Failure> {
        let (scenario, settings) = self.instrument.resolve()?;
        if let Some(folder) = &self.record {
            CampaignWriter::check_free(folder)?;
        }
        let results = [self.report.path(), self.certificate.as_deref(), self.json.path()];
        crate::output::check_beside(self.instrument.files(), results)?;
        let engine = if self.host { Engine::Host } else { Engine::Qemu };
        let mut out = self.json.human();
        writeln!(
            out,
            "{}, seed {}, latitude {}°, {}",
            scenario.name,
            self.instrument.seed,
            scenario.site.latitude_deg,
            engine.description()
        )?;
        let mut view = View::new(out, &settings);
        let setup = Setup { scenario, seed: self.instrument.seed, settings: Some(settings) };
        let mut log = Log::default();
        let outcome = engine::run(engine, self.image.as_deref(), &setup, interrupt::flag(), &mut |report| {
            // What comes after the azimuth is not of its run.
            if log.headings.is_empty() {
                log.recorder.see(report);
            }
            log.events.extend(EventRecord::of(report));
            match report.event {
                Event::Dwell(dwell) => log.dwells.push(dwell),
                Event::Heading(heading) => log.headings.push((report.t_s, heading)),
                Event::Health(counters) => log.health = Some(counters),
                _ => {}
            }
            view.report(report);
        });
        // Whatever happened, the bars go first.
        let mut out = view.finish()?;
        // An interrupt may also have ended what the engine needs: the build of the image, say.
        if interrupt::requested() {
            return Err(Failure::Interrupted);
        }
        let outcome = outcome?;
        let kept = self.keep(&mut out, log, &outcome, &setup, engine);
        // The azimuth is said even where it could not be written.
        let concluded = conclude(&mut out, &outcome, &self.directions, setup.scenario.duration_limit_s);
        kept.and(concluded)
    }
}

impl Find {
    /// Writes what was asked for: the recording, the pages, the machine-readable result.
    fn keep(
        &self,
        out: &mut dyn Write,
        log: Log,
        outcome: &Outcome,
        setup: &Setup,
        engine: Engine,
    ) -> Result<(), Failure> {
        let has_rows = !log.recorder.rows().is_empty();
        match &self.record {
            Some(folder) if has_rows => record(folder, setup, outcome, &log)?,
            Some(_) => writeln!(out, "nothing recorded: the gyro gave no second of data")?,
            None => {}
        }
        if let End::Fix(fix) = &outcome.end {
            self.draw(fix, &log, outcome, setup, engine)?;
        }
        let recorded = has_rows && self.record.is_some();
        self.json.write(&log.into_json(outcome, engine, recorded, &self.directions))
    }

    /// The pages that were asked for.
    fn draw(&self, fix: &Fix, log: &Log, outcome: &Outcome, setup: &Setup, engine: Engine) -> Result<(), Failure> {
        let Setup { scenario, seed, .. } = setup;
        let latitude_deg = scenario.site.latitude_deg;
        let shown = Shown {
            name: &scenario.name,
            fix,
            dwells: &log.dwells,
            earth: earth_rate(latitude_deg).ok(),
            reference: Some(Reference { name: "true", azimuth_deg: outcome.truth.azimuth_deg }),
        };
        let about = [format!("seed {seed}"), format!("latitude {latitude_deg}°"), engine.description().to_owned()];
        self.report.write(|| report::fix::one(&shown, log.recorder.rows(), &self.directions, &about))?;
        let instrument =
            [("scenario", format!("{}, seed {seed}", scenario.name)), ("firmware", engine.description().to_owned())];
        let made = Made { instrument: &instrument, latitude_deg, simulated: true };
        report::write(self.certificate.as_deref(), || report::certificate::html(&shown, &made, &self.directions))
    }
}

/// Prints the result; without an azimuth it is an error.
fn conclude(out: &mut dyn Write, outcome: &Outcome, directions: &Directions, limit_s: f64) -> Result<(), Failure> {
    match outcome.end {
        End::Fix(fix) => {
            let truth = Reference { name: "true", azimuth_deg: outcome.truth.azimuth_deg };
            write_fix(out, &fix, directions, Some(truth))?;
            outcome.held.iter().try_for_each(|held| Ok(write_held(out, &held.heading, held.truth.azimuth_deg)?))
        }
        End::Fault { fault, state } => {
            write_fault(out, fault, state)?;
            Err(Failure::Refused(format!("{}: {}", fault.name(), fault.meaning())))
        }
        End::TimeLimit => Err(Failure::Refused(time_limit(limit_s))),
        End::Interrupted => Err(Failure::Interrupted),
    }
}

fn time_limit(limit_s: f64) -> String {
    format!("no azimuth within the scenario's duration_limit_s = {limit_s}")
}

/// Writes the recording, with the simulator's azimuth as the reference.
fn record(folder: &std::path::Path, setup: &Setup, outcome: &Outcome, log: &Log) -> Result<(), Failure> {
    let title = format!("{}, seed {}", setup.scenario.name, setup.seed);
    let mut campaign = new_campaign(folder, title, setup)?;
    let run = Run { file: RUN.into(), reference_azimuth_deg: Some(outcome.truth.azimuth_deg), ..Run::default() };
    write_run(&campaign, RUN, log.recorder.rows().to_vec())?;
    if !log.headings.is_empty() {
        write_headings(&folder.join(HEADINGS), &log.headings)?;
    }
    campaign.add(run);
    Ok(campaign.finish()?)
}

impl Log {
    fn into_json(self, outcome: &Outcome, engine: Engine, recorded: bool, directions: &Directions) -> Found {
        let file = if recorded { RUN.to_owned() } else { String::new() };
        let mut run = match outcome.end {
            End::Fix(fix) => RunRecord::of_fix(file, &fix, &self.dwells),
            End::Fault { fault, .. } => {
                RunRecord::without_azimuth(file, &self.dwells, Some(fault.name()), Some(fault.meaning().into()))
            }
            End::TimeLimit | End::Interrupted => {
                RunRecord::without_azimuth(file, &self.dwells, None, Some("the scenario's time limit passed".into()))
            }
        };
        run.compare(outcome.truth.azimuth_deg);
        run.ask(directions);
        Found {
            runs: vec![run],
            true_azimuth_deg: outcome.truth.azimuth_deg,
            engine: engine.name(),
            events: self.events,
            held: outcome.held.map(|held| Held::new(held.heading, held.truth.azimuth_deg)),
            health: self.health,
        }
    }
}
