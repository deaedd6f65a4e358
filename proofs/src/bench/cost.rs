//! `north bench cost`: what the firmware image takes of the microcontroller, against a checked-in file.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{Bench, image_size};
use clap::Args;
use hal_sim::Scenario;
use north_finder::calibration::field::guidance::Step;
use north_finder::event::{Event, Report};
use north_finder::sample::SAMPLE_S;
use north_finder::sequence::order::Order;
use serde::{Deserialize, Serialize};

use north::engine::qemu::{self, Cost, Pace, image};
use north::engine::{self, End, EngineError, Setup};
use north::failure::Failure;
use north::field::{self, Obedient};
use north::file_error::{FileError, Problem};
use north::interrupt;
use north::settings_file::scenario_settings;
use north::toml_file::TomlFile;

/// First lines of a baseline file.
const HEADER: &str = "\
# What the firmware costs: instructions and stack in QEMU (mps2-an386, one fix of calm-bench, one field calibration of
# worn-accelerometers), flash and RAM of the STM32F405's image; and by how much each number may grow.
# Written by: north bench cost --check proofs/cost-baseline.toml --update

";
/// The fix that is measured.
const SCENARIO: &str = "calm-bench";
const SEED: u64 = 1;
/// The calibration of the accelerometers that is measured.
const FIELD_SCENARIO: &str = "worn-accelerometers";
/// Growth that a new baseline allows, percent.
const MARGIN_PERCENT: f64 = 5.0;

/// Instructions per 2.5 ms tick, image size, stack and speed of the firmware image in QEMU
///
/// One whole fix is run, and one calibration of the accelerometers in the field; flash and RAM are those of the image that is flashed. With --check the numbers must not exceed those of a baseline file by more than its margins; the
/// speed, which depends on the machine, is not checked.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north bench cost
  north bench cost --check proofs/cost-baseline.toml
  north bench cost --check proofs/cost-baseline.toml --update")]
pub struct CostBench {
    /// Compare with this baseline; exit code 1 when a number grew beyond its margin
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,
    /// Write the measured numbers into the baseline instead of comparing; its margins stay
    #[arg(long, requires = "check")]
    update: bool,
    /// The firmware image to measure; without it the image is built
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
}

/// What was measured.
#[derive(Clone, Copy, Debug)]
struct Measured {
    mean_instructions: f64,
    most_instructions: f64,
    flash_bytes: f64,
    ram_bytes: f64,
    stack_bytes: f64,
    field: FieldCost,
    /// World time over host time.
    speed: f64,
}

/// What a calibration of the accelerometers in the field costs.
#[derive(Clone, Copy, Debug)]
struct FieldCost {
    /// Of the tick that takes in an attitude and looks where the next is needed, most.
    attitude_instructions: f64,
    /// Of the tick that solves; it runs below everything else.
    solution_instructions: f64,
    /// Most stack in use from power-up to the stored result.
    stack_bytes: f64,
}

/// What is allowed: the checked-in file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Baseline {
    mean_instructions: Allowed,
    most_instructions: Allowed,
    flash_bytes: Allowed,
    ram_bytes: Allowed,
    stack_bytes: Allowed,
    field_attitude_instructions: Allowed,
    field_solution_instructions: Allowed,
    field_stack_bytes: Allowed,
}

/// A number, and by how much it may grow.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Allowed {
    value: f64,
    margin_percent: f64,
}

/// One line of either table.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Row {
    Image(Line),
    Step(Kernel),
}

/// What a step after a fix costs, most.
#[derive(Clone, Debug, Serialize)]
pub struct Kernel {
    name: String,
    instructions: u64,
    stack_bytes: u64,
    ram_bytes: u64,
}

/// One line of the table.
#[derive(Serialize)]
pub struct Line {
    what: &'static str,
    value: f64,
    allowed: Option<Allowed>,
}

impl Bench for CostBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let baseline = match &self.check {
            Some(path) if !self.update || path.exists() => Some(TomlFile::read(path)?.parse::<Baseline>()?),
            _ => None,
        };
        let image = match &self.image {
            Some(image) => image.clone(),
            None => image::build(image::Board::Mps2)?,
        };
        let measured = measure(&image)?;
        let lines = lines(&measured, if self.update { None } else { baseline.as_ref() });
        write_lines(out, &lines, measured.speed)?;
        let kernels = if self.image.is_none() { kernels()? } else { Vec::new() };
        write_kernels(out, &kernels)?;
        if let (Some(path), true) = (&self.check, self.update) {
            update(path, &measured, baseline.as_ref())?;
        }
        Ok(lines.into_iter().map(Row::Image).chain(kernels.into_iter().map(Row::Step)).collect())
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        check(rows.iter().filter_map(|row| if let Row::Image(line) = row { Some(line) } else { None }))
    }
}

fn setup(scenario: &str) -> Result<Setup, Failure> {
    let scenario = Scenario::named(scenario)?;
    let mut settings = scenario_settings(&scenario, None)?;
    settings.sequence.order = Order::Mirrored;
    let settings = Some(settings);
    Ok(Setup { scenario, seed: SEED, settings })
}

fn measure(image: &Path) -> Result<Measured, Failure> {
    let setup = setup(SCENARIO)?;
    let flashed = image::build(image::Board::F405)?;
    let size = image_size::size(&flashed)?;
    let (outcome, cost) = qemu::run(Pace::LockStep, image, &setup, interrupt::flag(), &mut |_| ())?;
    match outcome.end {
        End::Fix(_) => Ok(Measured::new(&cost, size, measure_field(image)?)),
        End::Interrupted => Err(Failure::Interrupted),
        End::Fault { fault, .. } => Err(Failure::Refused(format!("{SCENARIO}: {}", fault.meaning()))),
        End::TimeLimit => Err(Failure::Refused(format!("{SCENARIO}: no azimuth in time"))),
    }
}

/// A calibration in the field up to the solution, and another one to its end.
fn measure_field(image: &Path) -> Result<FieldCost, Failure> {
    let setup = setup(FIELD_SCENARIO)?;
    let mut solving = None;
    let mut observe = |report: &Report| {
        if let Event::Guidance(guidance) = report.event
            && guidance.step == Step::Solving
        {
            solving = Some((report.t_s / SAMPLE_S).round() as u64);
        }
    };
    let calibrate = |limit_ticks, observe: &mut engine::Observer<'_>| {
        let world = engine::world(&setup)?;
        let mut person = Obedient::new(&world, &setup, observe);
        let (off, cost) = qemu::serve(Pace::LockStep, image, &world, limit_ticks, &mut person, interrupt::flag())?;
        Ok::<_, EngineError>((person.outcome(off).end, cost))
    };
    let (end, whole) = calibrate(engine::limit_ticks(&setup), &mut observe)?;
    match (end, solving) {
        (field::End::Interrupted, _) => Err(Failure::Interrupted),
        (field::End::Stored, Some(tick)) => {
            let (_, attitudes) = calibrate(tick, &mut |_| ())?;
            Ok(FieldCost {
                attitude_instructions: attitudes.most_instructions as f64,
                solution_instructions: whole.most_instructions as f64,
                stack_bytes: f64::from(whole.stack_bytes),
            })
        }
        (end, _) => Err(Failure::Refused(format!("{FIELD_SCENARIO}: no calibration was stored: {end:?}"))),
    }
}

impl Measured {
    fn new(cost: &Cost, size: image_size::Size, field: FieldCost) -> Self {
        Self {
            mean_instructions: cost.mean_instructions,
            most_instructions: cost.most_instructions as f64,
            flash_bytes: size.flash as f64,
            ram_bytes: size.ram as f64,
            stack_bytes: f64::from(cost.stack_bytes),
            field,
            speed: cost.speed(),
        }
    }
}

fn lines(measured: &Measured, baseline: Option<&Baseline>) -> [Line; 8] {
    let line = |what, value, allowed: fn(&Baseline) -> Allowed| Line { what, value, allowed: baseline.map(allowed) };
    [
        line("instructions per 2.5 ms tick, mean", measured.mean_instructions, |baseline| baseline.mean_instructions),
        line("instructions per 2.5 ms tick, most", measured.most_instructions, |baseline| baseline.most_instructions),
        line("STM32F405: flash, bytes", measured.flash_bytes, |baseline| baseline.flash_bytes),
        line("STM32F405: static RAM, bytes", measured.ram_bytes, |baseline| baseline.ram_bytes),
        line("stack, most in use, bytes", measured.stack_bytes, |baseline| baseline.stack_bytes),
        line(
            "field calibration: instructions of an attitude, most",
            measured.field.attitude_instructions,
            |baseline| baseline.field_attitude_instructions,
        ),
        line("field calibration: instructions of the solution", measured.field.solution_instructions, |baseline| {
            baseline.field_solution_instructions
        }),
        line("field calibration: stack, most in use, bytes", measured.field.stack_bytes, |baseline| {
            baseline.field_stack_bytes
        }),
    ]
}

impl Line {
    fn limit(&self) -> Option<f64> {
        self.allowed.map(|allowed| allowed.value * (1.0 + allowed.margin_percent / 100.0))
    }

    fn too_much(&self) -> bool {
        self.limit().is_some_and(|limit| self.value > limit)
    }
}

fn write_lines(out: &mut dyn Write, lines: &[Line], speed: f64) -> io::Result<()> {
    writeln!(out, "| QEMU mps2-an386, one fix of {SCENARIO} | measured | allowed |\n|---|---|---|")?;
    for line in lines {
        let limit = line.limit().map_or("".into(), |limit| format!("{limit:.0}"));
        writeln!(out, "| {} | {:.0} | {limit} |", line.what, line.value)?;
    }
    writeln!(out, "| speed over real time, on this machine | {speed:.0} | |")
}

/// Runs the program that measures single steps.
fn kernels() -> Result<Vec<Kernel>, Failure> {
    let program = image::build_program(image::Board::Mps2, "kernels")?;
    let said = Command::new("qemu-system-arm")
        .args(["-machine", "mps2-an386", "-nodefaults", "-nic", "none", "-display", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(["-icount", &format!("shift={},sleep=off", qemu::INSTRUCTION_NS.trailing_zeros())])
        .arg("-kernel")
        .arg(program)
        .stdin(Stdio::null())
        .output()?;
    let kernels: Option<Vec<Kernel>> = String::from_utf8_lossy(&said.stdout).lines().map(kernel).collect();
    kernels
        .filter(|kernels| said.status.success() && !kernels.is_empty())
        .ok_or_else(|| Failure::Refused(format!("the program that measures single steps failed: {}", said.status)))
}

/// Name, instructions, stack, RAM; names have commas of their own.
fn kernel(line: &str) -> Option<Kernel> {
    let mut fields = line.rsplitn(4, ',');
    let mut number = || fields.next()?.parse().ok();
    let (ram_bytes, stack_bytes, instructions) = (number()?, number()?, number()?);
    Some(Kernel { name: fields.next()?.to_owned(), instructions, stack_bytes, ram_bytes })
}

fn write_kernels(out: &mut dyn Write, kernels: &[Kernel]) -> io::Result<()> {
    if kernels.is_empty() {
        return Ok(());
    }
    writeln!(out, "\n| a step after a fix, most | instructions | stack, bytes | RAM kept, bytes |\n|---|---|---|---|")?;
    kernels.iter().try_for_each(|Kernel { name, instructions, stack_bytes, ram_bytes }| {
        writeln!(out, "| {name} | {instructions} | {stack_bytes} | {ram_bytes} |")
    })
}

fn check<'a>(lines: impl IntoIterator<Item = &'a Line>) -> Result<(), Failure> {
    let grown: Vec<_> = lines
        .into_iter()
        .filter(|line| line.too_much())
        .map(|line| {
            format!("{} grew to {:.0}; allowed is {:.0}", line.what, line.value, line.limit().unwrap_or_default())
        })
        .collect();
    if grown.is_empty() { Ok(()) } else { Err(Failure::Refused(grown.join("\nnorth: "))) }
}

fn update(path: &Path, measured: &Measured, old: Option<&Baseline>) -> Result<(), FileError> {
    let allowed = |value: f64, margin: fn(&Baseline) -> Allowed| Allowed {
        value: value.round(),
        margin_percent: old.map_or(MARGIN_PERCENT, |old| margin(old).margin_percent),
    };
    let baseline = Baseline {
        mean_instructions: allowed(measured.mean_instructions, |old| old.mean_instructions),
        most_instructions: allowed(measured.most_instructions, |old| old.most_instructions),
        flash_bytes: allowed(measured.flash_bytes, |old| old.flash_bytes),
        ram_bytes: allowed(measured.ram_bytes, |old| old.ram_bytes),
        stack_bytes: allowed(measured.stack_bytes, |old| old.stack_bytes),
        field_attitude_instructions: allowed(measured.field.attitude_instructions, |old| {
            old.field_attitude_instructions
        }),
        field_solution_instructions: allowed(measured.field.solution_instructions, |old| {
            old.field_solution_instructions
        }),
        field_stack_bytes: allowed(measured.field.stack_bytes, |old| old.field_stack_bytes),
    };
    let table =
        toml::to_string(&baseline).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
    let text = format!("{HEADER}{table}");
    fs::write(path, text).map_err(|error| FileError::whole(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_beyond_the_margin_is_refused_by_name() {
        let measured = Measured {
            mean_instructions: 1040.0,
            most_instructions: 2000.0,
            flash_bytes: 1051.0,
            ram_bytes: 10.0,
            stack_bytes: 1100.0,
            field: FieldCost { attitude_instructions: 1.0, solution_instructions: 1000.0, stack_bytes: 1.0 },
            speed: 1.0,
        };
        let allowed = Allowed { value: 1000.0, margin_percent: 5.0 };
        let baseline = Baseline {
            mean_instructions: allowed,
            most_instructions: Allowed { margin_percent: 100.0, ..allowed },
            flash_bytes: allowed,
            ram_bytes: allowed,
            stack_bytes: allowed,
            field_attitude_instructions: allowed,
            field_solution_instructions: allowed,
            field_stack_bytes: allowed,
        };
        let failure = check(&lines(&measured, Some(&baseline))).unwrap_err();
        assert_eq!(
            failure.to_string(),
            "STM32F405: flash, bytes grew to 1051; allowed is 1050\nnorth: stack, most in use, bytes grew to 1100; allowed is 1050"
        );
        assert!(check(&lines(&measured, None)).is_ok());
    }
}
