//! `north simulate`: a campaign from the simulator, or a voyage of a ship with what aids it.

use std::cell::RefCell;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use hal_sim::Scenario;
use north_finder::event::Report;
use north_finder::instrument::Readings;
use rayon::prelude::*;

use super::instrument::InstrumentOptions;
use crate::campaign::{CampaignWriter, Role, Row, Run};
use crate::count::counted;
use crate::engine::{End, EngineError, Outcome, Setup, host};
use crate::failure::Failure;
use crate::interrupt;
use crate::progress;
use crate::recorder::{RawRecorder, Recorder, new_campaign, write_run};
use crate::voyage::{self, VoyageName};

/// Write a campaign from the simulator
///
/// Every run is a fix as `north find --host` makes it, with seeds N, N + 1, … and headings spread evenly over the
/// circle (unless --azimuth fixes them). Every other run has the role "fit", the rest "check"; the simulator's azimuth is
/// the reference.
///
/// With --voyage: recordings of a ship's block and of its satellites, antennas, log, depth gauge, acoustic fixes and electrostatic gyro,
/// for `north track`; the command that reads them is printed.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  north simulate --scenario warm-up --runs 12 --out warm && north solve warm\n  north simulate --voyage dive --out dive"
)]
pub struct Simulate {
    #[command(flatten)]
    instrument: InstrumentOptions,
    /// A new or empty folder for the campaign
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of runs, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// Instead of a campaign: a voyage of a ship
    #[arg(long, value_enum, conflicts_with_all = ["scenario", "runs", "raw"])]
    voyage: Option<VoyageName>,
    /// Rows at 400 Hz, one for each frame of the gyro, instead of 1 s
    #[arg(long)]
    raw: bool,
}

/// One simulated fix.
struct Simulated {
    file: String,
    outcome: Outcome,
    /// Whether there was anything to write.
    recorded: bool,
}

impl Simulate {
    pub fn run(self) -> Result<(), Failure> {
        if let Some(voyage) = self.voyage {
            let how = voyage::write(voyage, self.instrument.seed, &self.out)?;
            return Ok(writeln!(crate::output::people(), "{how}")?);
        }
        let (scenario, settings) = self.instrument.resolve()?;
        let title = format!("{}, seed {}", scenario.name, self.instrument.seed);
        let setup = Setup { scenario, seed: self.instrument.seed, settings: Some(settings) };
        let mut campaign = new_campaign(&self.out, title, &setup)?;

        let bar = progress::bar(self.runs.into(), "runs");
        let simulated = (0..self.runs)
            .into_par_iter()
            .map(|number| {
                let simulated = self.simulate(&setup, number, &campaign);
                bar.inc(1);
                simulated
            })
            .collect::<Result<Vec<_>, Failure>>();
        bar.finish_and_clear();

        let simulated = simulated?;
        for (number, Simulated { file, outcome, .. }) in simulated.iter().enumerate().filter(|(_, each)| each.recorded)
        {
            let role = if number % 2 == 0 && self.runs > 1 { Role::Fit } else { Role::Check };
            let reference_azimuth_deg = Some(outcome.truth.azimuth_deg);
            campaign.add(Run { file: file.clone(), role, reference_azimuth_deg, ..Run::default() });
        }
        campaign.finish()?;
        self.conclude(&simulated)
    }

    /// Runs a fix and writes its file; rows are kept in memory for one run at a time and core.
    fn simulate(&self, setup: &Setup, number: u32, campaign: &CampaignWriter) -> Result<Simulated, Failure> {
        let setup = self.setup_of(setup, number);
        let (outcome, rows) = if self.raw { record_raw(&setup) } else { record_seconds(&setup) }?;
        if outcome.end == End::Interrupted {
            return Err(Failure::Interrupted);
        }
        let file = format!("runs/{:03}.csv", number + 1);
        let recorded = !rows.is_empty();
        if recorded {
            write_run(campaign, &file, rows)?;
        }
        Ok(Simulated { file, outcome, recorded })
    }

    /// The world of one run: its own seed and, unless the azimuth is given, its own heading.
    fn setup_of(&self, setup: &Setup, number: u32) -> Setup {
        let mut scenario: Scenario = setup.scenario.clone();
        if self.instrument.azimuth.is_none() {
            let turned = scenario.site.azimuth_deg + 360.0 * f64::from(number) / f64::from(self.runs);
            scenario.site.azimuth_deg = turned.rem_euclid(360.0);
        }
        Setup { scenario, seed: setup.seed.wrapping_add(number.into()), settings: setup.settings.clone() }
    }

    /// Says what was written; fixes without an azimuth are told, and are an error.
    fn conclude(&self, simulated: &[Simulated]) -> Result<(), Failure> {
        let mut out = crate::output::people();
        let mut without_azimuth = 0;
        for Simulated { file, outcome, recorded } in simulated {
            if let Some(why) = why_not(outcome) {
                without_azimuth += 1;
                let recorded = if *recorded { "" } else { " (not written: the gyro gave no data)" };
                writeln!(out, "{file}: the fix ended without an azimuth: {why}{recorded}")?;
            }
        }
        let recorded = simulated.iter().filter(|each| each.recorded).count();
        writeln!(out, "{}: {}", self.out.display(), counted(recorded, "run"))?;
        match without_azimuth {
            0 => Ok(()),
            count => {
                let fixes = counted(self.runs, "fix");
                Err(Failure::Refused(format!("{count} of {fixes} ended without an azimuth")))
            }
        }
    }
}

fn record_seconds(setup: &Setup) -> Result<(Outcome, Vec<Row>), EngineError> {
    let mut recorder = Recorder::default();
    let outcome = host::run(setup, interrupt::flag(), &mut |report| recorder.see(report))?;
    Ok((outcome, recorder.take_rows()))
}

fn record_raw(setup: &Setup) -> Result<(Outcome, Vec<Row>), EngineError> {
    let gyro = setup.settings.as_ref().map(|settings| settings.gyro).unwrap_or_default();
    let recorder = RefCell::new(RawRecorder::new(gyro));
    let mut tap = |readings: &Readings, gyro_bytes: &[u8]| recorder.borrow_mut().tick(readings, gyro_bytes);
    let mut observe = |report: &Report| recorder.borrow_mut().report(report);
    let outcome = host::run_tapped(setup, interrupt::flag(), &mut observe, &mut tap)?;
    Ok((outcome, recorder.into_inner().take_rows()))
}

fn why_not(outcome: &Outcome) -> Option<&'static str> {
    match outcome.end {
        End::Fix(_) => None,
        End::Fault { fault, .. } => Some(fault.name()),
        End::TimeLimit | End::Interrupted => Some("the scenario's time limit passed"),
    }
}
