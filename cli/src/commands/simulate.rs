//! `north simulate`: a campaign from the simulator.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use hal_sim::Scenario;
use rayon::prelude::*;

use super::instrument::InstrumentOptions;
use super::progress;
use crate::campaign::{CampaignWriter, Role, Run};
use crate::engine::{End, Outcome, Setup, host};
use crate::failure::Failure;
use crate::interrupt;
use crate::recorder::{Recorder, new_campaign};

/// Write a campaign from the simulator
///
/// Every run is a fix as `north find --host` makes it, with seeds N, N + 1, … and headings spread evenly over the
/// circle (unless --azimuth fixes them). Every other run has the role "fit", the rest "check"; the simulator's azimuth is
/// the reference.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north simulate --scenario warm-up --runs 12 --out warm && north solve warm")]
pub struct Simulate {
    #[command(flatten)]
    instrument: InstrumentOptions,
    /// A new or empty folder for the campaign
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of runs, 1 to 100000
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
}

/// One simulated fix and its recording.
struct Simulated {
    outcome: Outcome,
    recorder: Recorder,
}

impl Simulate {
    pub fn run(self) -> Result<(), Failure> {
        let (scenario, settings) = self.instrument.resolve()?;
        CampaignWriter::check_free(&self.out)?;
        let title = format!("{}, seed {}", scenario.name, self.instrument.seed);
        let setup = Setup { scenario, seed: self.instrument.seed, settings: Some(settings) };

        let bar = progress::bar(self.runs.into(), "runs");
        let simulated = (0..self.runs)
            .into_par_iter()
            .map(|number| {
                let simulated = simulate(&self.setup_of(&setup, number));
                bar.inc(1);
                simulated
            })
            .collect::<Result<Vec<_>, Failure>>();
        bar.finish_and_clear();

        let mut campaign = new_campaign(&self.out, title, &setup)?;
        let mut out = std::io::stdout();
        let mut without_azimuth = 0;
        for (number, Simulated { outcome, recorder }) in (1..).zip(simulated?) {
            let file = format!("runs/{number:03}.csv");
            if let Some(why) = why_not(&outcome) {
                without_azimuth += 1;
                writeln!(out, "{file}: the fix ended without an azimuth: {why}")?;
            }
            if recorder.rows().is_empty() {
                writeln!(out, "{file}: not written, the gyro gave no second of data")?;
                continue;
            }
            let role = if number % 2 == 1 && self.runs > 1 { Role::Fit } else { Role::Check };
            let reference_azimuth_deg = Some(outcome.truth.azimuth_deg);
            recorder.write(&mut campaign, Run { file, role, reference_azimuth_deg, ..Run::default() })?;
        }
        campaign.finish()?;
        writeln!(out, "{}: {} runs", self.out.display(), self.runs)?;
        match without_azimuth {
            0 => Ok(()),
            count => Err(Failure::Refused(format!("{count} of {} fixes ended without an azimuth", self.runs))),
        }
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
}

fn simulate(setup: &Setup) -> Result<Simulated, Failure> {
    let mut recorder = Recorder::default();
    let outcome = host::run(setup, interrupt::flag(), &mut |report| recorder.see(report))?;
    match outcome.end {
        End::Interrupted => Err(Failure::Interrupted),
        _ => Ok(Simulated { outcome, recorder }),
    }
}

fn why_not(outcome: &Outcome) -> Option<&'static str> {
    match outcome.end {
        End::Fix(_) => None,
        End::Fault { fault, .. } => Some(fault.name()),
        End::TimeLimit | End::Interrupted => Some("the scenario's time limit passed"),
    }
}
