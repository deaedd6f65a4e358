//! `north bench cost`: what the firmware image takes of the microcontroller, against a checked-in file.

use std::env;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{Bench, image_size};
use calibration::field::guidance::Step;
use clap::Args;
use hal_sim::Scenario;
use north_finder::event::{Event, Report};
use north_finder::sensing::sample::SAMPLE_S;
use north_finder::sequence::order::Order;
use serde::{Deserialize, Serialize};

use north::engine::qemu::{self, Cost, Pace, image};
use north::engine::{self, End, EngineError, Setup};
use north::failure::Failure;
use north::field::{self, Obedient};
use north::interrupt;
use north::settings_file::scenario_settings;
use north::toml_file::TomlFile;

/// The fix that is measured.
const SCENARIO: &str = "calm-bench";
const SEED: u64 = 1;
/// The calibration of the accelerometers that is measured.
const FIELD_SCENARIO: &str = "worn-accelerometers";

/// Instructions per 2.5 ms tick, image size, stack and speed of the firmware image in QEMU
///
/// One whole fix is run, and one calibration of the accelerometers in the field; flash and RAM are those of the image that is flashed, which makes a fix on the emulated chip, too, for its stack and its longest tick. Stacks are measured by the paint that is gone from them, which is no bound of what could be used. With --check the numbers must not exceed the limits of a file.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north bench cost
  north bench cost --check proofs/cost-baseline.toml")]
pub struct CostBench {
    /// Compare with these limits; exit code 1 when a number is beyond its own
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,
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
    chip: ChipCost,
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

/// What the image that is flashed says of itself after a fix on the emulated chip.
#[derive(Clone, Copy, Debug)]
struct ChipCost {
    /// Most stack in use since power-up.
    stack_bytes: f64,
    /// From a tick to the end of its work, most.
    longest_tick_percent: f64,
}

/// What is allowed: the checked-in file.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Limits {
    /// Of all tasks from a tick until the processor sleeps, the work on a second included.
    instructions: f64,
    flash_bytes: f64,
    /// Variables and the most of the stack that is in use.
    ram_bytes: f64,
    /// On the emulated chip, where an instruction takes a cycle.
    longest_tick_percent: f64,
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
    limit: Option<f64>,
}

impl Bench for CostBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let limits = match &self.check {
            Some(path) => Some(TomlFile::read(path)?.parse::<Limits>()?),
            None => None,
        };
        let image = match &self.image {
            Some(image) => image.clone(),
            None => image::build(image::Board::Mps2)?,
        };
        let measured = measure(&image)?;
        let lines = lines(&measured, limits.as_ref());
        write_lines(out, &lines, measured.speed)?;
        let kernels = if self.image.is_none() { kernels()? } else { Vec::new() };
        write_kernels(out, &kernels)?;
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
        End::Fix(_) => Ok(Measured::new(&cost, size, measure_field(image)?, measure_chip()?)),
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

/// Runs the program that finds north on the emulated chip: a workspace of its own.
fn measure_chip() -> Result<ChipCost, Failure> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize()?;
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from).join("chip");
    let said = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(&root)
        .args(["run", "--quiet", "--manifest-path", "chip/Cargo.toml", "--ignore-rust-version", "--target-dir"])
        .arg(&target)
        .args(["--", SCENARIO, &SEED.to_string()])
        .stdin(Stdio::null())
        .output()?;
    let text = String::from_utf8_lossy(&said.stdout);
    let number = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.parse::<f64>().ok());
    match (number("stack, bytes: "), number("longest tick, thousandths: ")) {
        (Some(stack_bytes), Some(thousandths)) => {
            Ok(ChipCost { stack_bytes, longest_tick_percent: thousandths / 10.0 })
        }
        _ => Err(Failure::Refused(format!(
            "no fix on the emulated chip: {text}{}",
            String::from_utf8_lossy(&said.stderr)
        ))),
    }
}

impl Measured {
    fn new(cost: &Cost, size: image_size::Size, field: FieldCost, chip: ChipCost) -> Self {
        Self {
            mean_instructions: cost.mean_instructions,
            most_instructions: cost.most_instructions as f64,
            flash_bytes: size.flash as f64,
            ram_bytes: size.ram as f64,
            stack_bytes: f64::from(cost.stack_bytes),
            field,
            chip,
            speed: cost.speed(),
        }
    }
}

fn lines(measured: &Measured, limits: Option<&Limits>) -> [Line; 11] {
    let line = |what, value| Line { what, value, limit: None };
    let limited = |what, value, limit: fn(&Limits) -> f64| Line { what, value, limit: limits.map(limit) };
    let stack_bytes = measured.stack_bytes.max(measured.field.stack_bytes).max(measured.chip.stack_bytes);
    [
        line("instructions per 2.5 ms tick, mean", measured.mean_instructions),
        limited("instructions from a tick until sleep, most", measured.most_instructions, |limits| limits.instructions),
        limited("STM32F405: flash, bytes", measured.flash_bytes, |limits| limits.flash_bytes),
        line("STM32F405: static RAM, bytes", measured.ram_bytes),
        line("stack, most in use in a fix, bytes", measured.stack_bytes),
        limited("RAM and the most of the stack, bytes", measured.ram_bytes + stack_bytes, |limits| limits.ram_bytes),
        line("emulated chip: stack, most in use in a fix, bytes", measured.chip.stack_bytes),
        limited("emulated chip: longest tick, % of 2.5 ms", measured.chip.longest_tick_percent, |limits| {
            limits.longest_tick_percent
        }),
        line("field calibration: instructions of an attitude, most", measured.field.attitude_instructions),
        line("field calibration: instructions of the solution", measured.field.solution_instructions),
        line("field calibration: stack, most in use, bytes", measured.field.stack_bytes),
    ]
}

impl Line {
    fn too_much(&self) -> bool {
        self.limit.is_some_and(|limit| self.value > limit)
    }
}

fn write_lines(out: &mut dyn Write, lines: &[Line], speed: f64) -> io::Result<()> {
    writeln!(out, "| QEMU mps2-an386, one fix of {SCENARIO} | measured | allowed |\n|---|---|---|")?;
    for line in lines {
        let limit = line.limit.map_or("".into(), |limit| format!("{limit:.0}"));
        writeln!(out, "| {} | {:.0} | {limit} |", line.what, line.value)?;
    }
    writeln!(out, "| speed over real time, on this machine | {speed:.0} | |")
}

/// Runs the program that measures single steps.
fn kernels() -> Result<Vec<Kernel>, Failure> {
    let program = image::build_kernels()?;
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
        .map(|line| format!("{}: {:.0}; allowed is {:.0}", line.what, line.value, line.limit.unwrap_or_default()))
        .collect();
    if grown.is_empty() { Ok(()) } else { Err(Failure::Refused(grown.join("\nnorth: "))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beyond_its_limit_is_refused_by_name() {
        let measured = Measured {
            mean_instructions: 1040.0,
            most_instructions: 2000.0,
            flash_bytes: 1051.0,
            ram_bytes: 10.0,
            stack_bytes: 1000.0,
            field: FieldCost { attitude_instructions: 1.0, solution_instructions: 1000.0, stack_bytes: 1100.0 },
            chip: ChipCost { stack_bytes: 1090.0, longest_tick_percent: 50.1 },
            speed: 1.0,
        };
        let limits =
            Limits { instructions: 2000.0, flash_bytes: 1050.0, ram_bytes: 1100.0, longest_tick_percent: 50.0 };
        let failure = check(&lines(&measured, Some(&limits))).unwrap_err();
        assert_eq!(
            failure.to_string(),
            "STM32F405: flash, bytes: 1051; allowed is 1050\nnorth: RAM and the most of the stack, bytes: 1110; allowed is 1100\nnorth: emulated chip: longest tick, % of 2.5 ms: 50; allowed is 50"
        );
        assert!(check(&lines(&measured, None)).is_ok());
    }
}
