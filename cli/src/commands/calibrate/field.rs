//! `north calibrate field`: the instrument's own accelerometers, calibrated by the instrument.

use std::io::{self, Write};
use std::path::PathBuf;

use calibration::field::problem::Solved;
use clap::Args;
use north_finder::event::{Event, Report, State};
use north_finder::sequence::Command;
use serde::Serialize;

use crate::commands::instrument::InstrumentOptions;
use crate::commands::seed;
use crate::engine::{self, Engine, Outcome, Setup};
use crate::failure::Failure;
use crate::field::{self, End};
use crate::interrupt;
use crate::json::EventRecord;
use crate::output::JsonOption;
use crate::port::{Port, PortError, SILENCE};
use crate::present::guidance;

/// Calibrate the instrument's own accelerometers by hand, guided by the firmware
///
/// The firmware in QEMU asks for one attitude after the other, and the scenario's operator turns the simulated instrument
/// there, not quite exactly. The ellipsoid is solved on board and stored only if it is better on attitudes held out. Then the
/// power is switched off and on, and north is found with and without the stored calibration.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north calibrate field
  north calibrate field worn-accelerometers --host --seed 7 --json -
  north calibrate field my-scenario.toml
  north calibrate field --port /dev/ttyUSB0")]
pub struct Field {
    /// A built-in scenario ("north scenarios" lists them) or a scenario file ending in .toml
    #[arg(value_name = "SCENARIO", default_value = "worn-accelerometers")]
    scenario: String,
    /// Seed of everything random; the same scenario and seed give the same run
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = seed)]
    seed: u64,
    /// Run the instrument in this process instead of the firmware image in QEMU
    #[arg(long)]
    host: bool,
    /// The firmware image to run; without it the image is built, which needs cargo and the sources
    #[arg(long, value_name = "FILE", conflicts_with = "host")]
    image: Option<PathBuf>,
    /// Calibrate the board at this serial port, turned by you, instead of the simulated instrument; the only one on which a board
    /// answers, if it is not named
    #[arg(long, value_name = "PORT", num_args = 0..=1, conflicts_with_all = ["host", "image", "seed", "scenario"])]
    port: Option<Option<String>>,
    #[command(flatten)]
    json: JsonOption,
}

/// The machine-readable result.
#[derive(Debug, Serialize)]
struct Record {
    /// Of a board its port.
    scenario: String,
    /// "qemu", "host" or "board".
    engine: &'static str,
    events: Vec<EventRecord>,
    /// What was found on board, also if it was not stored.
    calibration: Option<CalibrationRecord>,
    stored: bool,
    /// Name of the reason why nothing was stored.
    refused: Option<&'static str>,
    /// North without the calibration and, after the power was off, with it; only where it is stored.
    before: Option<FixRecord>,
    after: Option<FixRecord>,
}

#[derive(Debug, Serialize)]
struct CalibrationRecord {
    attitudes: u8,
    judged: u8,
    left_out: u8,
    coverage: f64,
    norm_rms_before_g: f64,
    norm_rms_after_g: f64,
    check_norm_rms_before_g: f64,
    check_norm_rms_after_g: f64,
    evidence_sigmas: f64,
    bias_g: [f64; 3],
    matrix: [[f64; 3]; 3],
}

/// A fix and its errors against what is really so, degrees; `None`: the fix ended without an azimuth.
#[derive(Clone, Copy, Debug, Serialize)]
struct FixRecord {
    azimuth_deg: Option<f64>,
    sigma_deg: Option<f64>,
    azimuth_error_deg: Option<f64>,
    pitch_error_deg: Option<f64>,
    roll_error_deg: Option<f64>,
}

impl Field {
    pub fn run(self) -> Result<(), Failure> {
        crate::output::check([self.json.path()])?;
        if let Some(port) = &self.port {
            return self.board(&mut Port::open(port.as_deref())?);
        }
        let engine = if self.host { Engine::Host } else { Engine::Qemu };
        let options = InstrumentOptions { scenario: self.scenario.clone(), ..InstrumentOptions::default() };
        let (scenario, settings) = options.resolve()?;
        let mut out = self.json.human();
        writeln!(out, "{}, seed {}, {}", scenario.name, self.seed, engine.description())?;
        let setup = Setup { scenario, seed: self.seed, settings: Some(settings) };
        let world = engine::world(&setup)?;
        let flash_before = world.flash_contents();

        let mut events = Vec::new();
        let mut unwritten = Ok(());
        let image = self.image.as_deref();
        let outcome = field::calibrate(engine, image, &world, &setup, interrupt::flag(), &mut |report| {
            events.extend(EventRecord::of(report));
            if unwritten.is_ok() {
                unwritten = write_report(&mut out, report);
            }
        });
        if interrupt::requested() {
            return Err(Failure::Interrupted);
        }
        unwritten?;
        let outcome = outcome?;
        let fixes = match outcome.end {
            End::Stored => {
                // Power off and on without and with what was stored.
                let find = |flash: &[u8]| -> Result<FixRecord, Failure> {
                    let outcome = field::find(engine, image, &setup, flash, interrupt::flag())?;
                    if interrupt::requested() { Err(Failure::Interrupted) } else { Ok(FixRecord::of(&outcome)) }
                };
                Some([find(&flash_before)?, find(&world.flash_contents())?])
            }
            _ => None,
        };
        if let Some([before, after]) = &fixes {
            write_fixes(&mut out, before, after)?;
        }
        let refused = match outcome.end {
            End::Refused(reason) => Some(reason.why.name()),
            End::Fault(fault) => Some(fault.name()),
            End::Stored | End::TimeLimit | End::Interrupted => None,
        };
        let [before, after] = fixes.map_or([None, None], |fixes| fixes.map(Some));
        let record = Record {
            scenario: setup.scenario.name.clone(),
            engine: engine.name(),
            events,
            calibration: outcome.solved.as_ref().map(CalibrationRecord::from),
            stored: outcome.end == End::Stored,
            refused,
            before,
            after,
        };
        self.json.write(&record)?;
        conclude(outcome.end, setup.scenario.duration_limit_s)
    }

    /// The board says what to do, until it has stored a calibration or says why not.
    fn board(&self, port: &mut Port) -> Result<(), Failure> {
        let mut out = self.json.human();
        let name = port.name().to_owned();
        let (mut reports, mut record) = (Vec::new(), Record::of_board(name));
        port.command(Command::CalibrateAccelerometers, &mut |report| reports.push(*report))?;
        let mut reports = reports.into_iter();
        let mut refused = None;
        loop {
            let report = match reports.next().map_or_else(|| port.report(SILENCE), Ok) {
                Err(PortError::Interrupted) => {
                    abort(port);
                    return Err(Failure::Interrupted);
                }
                report => report?,
            };
            write_report(&mut out, &report)?;
            record.events.extend(EventRecord::of(&report));
            match report.event {
                Event::Calibration(solved) => record.calibration = Some((&solved).into()),
                Event::CalibrationStored => record.stored = true,
                Event::NoCalibration(reason) => {
                    record.refused = Some(reason.why.name());
                    refused = Some(reason.why.explain());
                }
                Event::State(State::Finished | State::Failed) if record.stored || refused.is_some() => break,
                _ => {}
            }
        }
        self.json.write(&record)?;
        match (record.refused, refused) {
            (Some(name), Some(why)) => Err(Failure::Refused(format!("{name}: {why}"))),
            _ => Ok(()),
        }
    }
}

/// Ends the calibration on the board; whoever is interrupted does not wait for the answer.
fn abort(port: &mut Port) {
    let _ = port.command(Command::Abort, &mut |_| ());
}

impl Record {
    fn of_board(port: String) -> Self {
        Self {
            scenario: port,
            engine: "board",
            events: Vec::new(),
            calibration: None,
            stored: false,
            refused: None,
            before: None,
            after: None,
        }
    }
}

impl FixRecord {
    fn of(outcome: &Outcome) -> Self {
        let engine::End::Fix(fix) = outcome.end else {
            return Self {
                azimuth_deg: None,
                sigma_deg: None,
                azimuth_error_deg: None,
                pitch_error_deg: None,
                roll_error_deg: None,
            };
        };
        let truth = &outcome.truth;
        Self {
            azimuth_deg: Some(fix.azimuth_deg),
            sigma_deg: Some(fix.sigma_deg),
            azimuth_error_deg: Some(north_finder::units::wrap_180_deg(fix.azimuth_deg - truth.azimuth_deg)),
            pitch_error_deg: fix.tilt.map(|tilt| tilt.pitch_deg - truth.pitch_deg),
            roll_error_deg: fix.tilt.map(|tilt| tilt.roll_deg - truth.roll_deg),
        }
    }
}

impl From<&Solved> for CalibrationRecord {
    fn from(solved: &Solved) -> Self {
        let correction = solved.calibration.correction();
        Self {
            attitudes: solved.attitudes,
            judged: solved.judged,
            left_out: solved.left_out,
            coverage: solved.coverage,
            norm_rms_before_g: solved.before_g,
            norm_rms_after_g: solved.after_g,
            check_norm_rms_before_g: solved.judged_before_g,
            check_norm_rms_after_g: solved.judged_after_g,
            evidence_sigmas: solved.evidence,
            bias_g: correction.bias,
            matrix: correction.matrix,
        }
    }
}

/// What a report is worth saying: a line, or what was found, before and after.
fn write_report(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    if let Event::Calibration(solved) = &report.event {
        return write_solved(out, solved);
    }
    guidance::line(&report.event).map_or(Ok(()), |text| writeln!(out, "{:8.1} s  {text}", report.t_s))
}

fn write_solved(out: &mut dyn Write, solved: &Solved) -> io::Result<()> {
    let Solved { attitudes, judged, left_out, coverage, evidence, .. } = solved;
    writeln!(
        out,
        "attitudes   {attitudes} learned from, {judged} only judged, {left_out} left out; coverage {coverage:.2}"
    )?;
    let rms = |before: f64, after: f64| format!("{:9.4} mg before, {:9.4} mg after", 1e3 * before, 1e3 * after);
    writeln!(out, "|f| - 1 g   {} (rms, learned from)", rms(solved.before_g, solved.after_g))?;
    writeln!(out, "            {} (rms, only judged)", rms(solved.judged_before_g, solved.judged_after_g))?;
    let verdict = if solved.is_better() { "better" } else { "not shown to be better" };
    writeln!(out, "evidence    {evidence:.1} standard deviations: {verdict}")?;
    let [x, y, z] = solved.calibration.bias_g.map(|bias_g| 1e3 * bias_g);
    writeln!(out, "bias        {x:+.3} {y:+.3} {z:+.3} mg")?;
    let mut name = "matrix";
    for [x, y, z] in solved.calibration.correction().matrix {
        writeln!(out, "{name:<11} {x:+.6} {y:+.6} {z:+.6}")?;
        name = "";
    }
    Ok(())
}

fn write_fixes(out: &mut dyn Write, before: &FixRecord, after: &FixRecord) -> io::Result<()> {
    writeln!(out, "\nPower off and on; north without and with the stored calibration:")?;
    writeln!(out, "| error, degrees | without | with |\n|---|---|---|")?;
    let number = |value: Option<f64>| value.map_or("no azimuth".to_owned(), |value| format!("{value:.4}"));
    for (what, value) in [
        ("pitch", (|fix| fix.pitch_error_deg) as fn(&FixRecord) -> Option<f64>),
        ("roll", |fix| fix.roll_error_deg),
        ("azimuth", |fix| fix.azimuth_error_deg),
        ("sigma of the azimuth", |fix| fix.sigma_deg),
    ] {
        writeln!(out, "| {what} | {} | {} |", number(value(before)), number(value(after)))?;
    }
    Ok(())
}

fn conclude(end: End, limit_s: f64) -> Result<(), Failure> {
    match end {
        End::Stored => Ok(()),
        End::Refused(reason) => Err(Failure::Refused(format!("{}: {}", reason.why.name(), reason.why.explain()))),
        End::Fault(fault) => Err(Failure::Refused(format!("{}: {}", fault.name(), fault.meaning()))),
        End::TimeLimit => {
            Err(Failure::Refused(format!("no calibration within the scenario's duration_limit_s = {limit_s}")))
        }
        End::Interrupted => Err(Failure::Interrupted),
    }
}
