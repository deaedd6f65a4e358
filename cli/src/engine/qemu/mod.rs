//! The fix as the real firmware image in QEMU, in lock-step with the simulated instrument.
//!
//! The image talks to this module over QEMU's standard input and output; `src/board/mps2/exchange.rs` describes the
//! messages. World time passes only while a tick's request is answered here, and QEMU's clock counts instructions, so a
//! run depends on nothing but image, scenario and seed.

pub mod image;
mod instrument;
mod lines;
mod process;
#[cfg(test)]
mod tests;
mod wire;

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hal_sim::World;
use north_finder::event::Event;
use north_finder::link::ReportDecoder;
use north_finder::sensing::sample::SAMPLE_S;

use simulated::RequestLine;

use super::{EngineError, FixWanted, Observer, Outcome, Person, PowerOff, Setup};
use instrument::Instrument;
use lines::{Lines, Uarts};
use process::Qemu;
use wire::Ask;

/// QEMU's clock goes on by this much with every instruction: 125 million a second, about what the STM32F405 does at
/// 168 MHz with flash wait states and the occasional two-cycle instruction.
pub const INSTRUCTION_NS: u32 = 8;
/// The board's timers count with 25 MHz.
const CYCLE_NS: u32 = 40;

/// Why the image could not be run in QEMU.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    #[error(
        "qemu-system-arm cannot be started: {0}; install it (Debian, Ubuntu: apt-get install qemu-system-arm; macOS: brew install qemu)"
    )]
    NotStarted(io::Error),
    #[error("the firmware panicked: {0}")]
    Panicked(String),
    #[error("QEMU ended before the fix did{0}")]
    Died(String),
    #[error("the firmware did nothing for {0} s and was stopped")]
    Hung(u64),
    #[error("the firmware sent a message that is none: opcode {opcode:#04x} with {length} bytes")]
    Message { opcode: u8, length: usize },
    #[error("the firmware sent a report that cannot be decoded")]
    Report,
    #[error("QEMU's emulated UARTs cannot be reached: {0}")]
    Uart(io::Error),
    #[error(transparent)]
    Image(#[from] image::ImageError),
}

/// What a run cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Ticks of 2.5 ms, and with them the world time.
    pub ticks: u64,
    /// Instructions that a tick caused in all its tasks, mean over the ticks. In units of five: the timer's resolution.
    pub mean_instructions: f64,
    /// The same of the tick that caused most.
    pub most_instructions: u64,
    /// Number of that tick, from 0.
    pub most_at_tick: u64,
    /// Most stack that was ever in use, bytes.
    pub stack_bytes: u32,
    /// Duration of the run on the host.
    pub wall: Duration,
}

impl Cost {
    /// Takes what the last tick cost; the first message of all tells of the start-up.
    fn count(&mut self, busy_cycles: u32) {
        let instructions = u64::from(busy_cycles) * u64::from(CYCLE_NS / INSTRUCTION_NS);
        if self.ticks > 0 {
            self.mean_instructions += (instructions as f64 - self.mean_instructions) / self.ticks as f64;
            if instructions > self.most_instructions {
                (self.most_instructions, self.most_at_tick) = (instructions, self.ticks - 1);
            }
        }
    }

    /// World time over host time.
    pub fn speed(&self) -> f64 {
        self.ticks as f64 * SAMPLE_S / self.wall.as_secs_f64()
    }
}

/// How the microcontroller's time goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Only when nothing is left to do.
    LockStep,
    /// With every instruction, so that what takes longer than a tick makes the instrument lag. Two runs are the same.
    FreeRunning,
    /// As the host's; bytes of gyro and link go over the emulated UARTs. A smoke test of interrupts and UARTs: its reports depend on
    /// when the host had time.
    RealTime,
}

/// Powers the instrument up in QEMU, starts a fix and goes on until it ends.
///
/// `observe` sees every report. `stop` is looked at in every tick. Whatever happens, QEMU has ended when this returns.
pub fn run(
    pace: Pace,
    image: &Path,
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
) -> Result<(Outcome, Cost), EngineError> {
    let world = super::world(setup)?;
    let mut wanted = FixWanted::new(&world, observe);
    let (off, cost) = serve(pace, image, &world, super::limit_ticks(setup), &mut wanted, stop)?;
    Ok((wanted.outcome(off), cost))
}

/// Powers the instrument of a world up in QEMU and lets a person work with it for at most that many ticks.
///
/// `stop` is looked at in every tick. Whatever happens, QEMU has ended when this returns.
pub fn serve(
    pace: Pace,
    image: &Path,
    world: &World,
    limit_ticks: u64,
    person: &mut dyn Person,
    stop: &AtomicBool,
) -> Result<(PowerOff, Cost), EngineError> {
    let started = Instant::now();
    let (mut qemu, mut lines) = start(pace, image)?;
    let mut instrument = Instrument::new(world);
    let mut reports = ReportDecoder::new();
    let mut cost = Cost::default();
    let mut requests = RequestLine::default();
    let mut off = None;
    let mut hear = |bytes: &[u8], person: &mut dyn Person, off: &mut Option<PowerOff>| {
        for report in bytes.iter().filter_map(|&byte| reports.feed(byte)) {
            let report = report.map_err(|_| QemuError::Report)?;
            // What the board says of itself is no part of the fix, which is the same without a board.
            if !matches!(report.event, Event::Vitals { .. }) && person.hear(&report) {
                off.get_or_insert(PowerOff::Received);
            }
        }
        Ok::<(), QemuError>(())
    };
    loop {
        match qemu.receive()? {
            Ask::Tick { busy_cycles, input, edges } => {
                cost.count(busy_cycles);
                hear(&lines.receive()?, person, &mut off)?;
                if stop.load(Ordering::Relaxed) {
                    off = off.or(Some(PowerOff::Interrupted));
                } else if cost.ticks >= limit_ticks {
                    off = off.or(Some(PowerOff::TimeLimit));
                }
                let reply = if off.is_some() {
                    wire::power_off()
                } else {
                    let code = instrument.convert(input);
                    let gyro = instrument.tick(edges);
                    if let Some(request) = person.request(cost.ticks) {
                        requests.send(&request)?;
                    }
                    cost.ticks += 1;
                    lines.send(instrument.limit_is_open(), code, &gyro, &requests.tick())?
                };
                qemu.reply(&reply)?;
            }
            Ask::Uart { bytes } => hear(bytes, person, &mut off)?,
            Ask::Gyro { byte } => instrument.tell_gyro(byte),
            Ask::Log { .. } => {}
            Ask::Panic { text } => return Err(QemuError::Panicked(text.to_owned()).into()),
            Ask::End { stack_bytes } => {
                let cost = Cost { stack_bytes, wall: started.elapsed(), ..cost };
                return Ok((off.unwrap_or(PowerOff::Interrupted), cost));
            }
            device => {
                let reply = instrument.device(device);
                qemu.reply(&reply)?;
            }
        }
    }
}

fn start(pace: Pace, image: &Path) -> Result<(Qemu, Lines), QemuError> {
    Ok(match pace {
        Pace::LockStep | Pace::FreeRunning => {
            let shift = INSTRUCTION_NS.trailing_zeros();
            let clock = ["-icount".into(), format!("shift={shift},sleep=off")];
            let word: &[&str] = if pace == Pace::FreeRunning { &["free-running"] } else { &[] };
            (Qemu::start(image, &clock, word)?, Lines::Exchange)
        }
        Pace::RealTime => {
            let uarts = Uarts::listen().map_err(QemuError::Uart)?;
            let options = uarts.options().map_err(QemuError::Uart)?;
            let qemu = Qemu::start(image, &options, &["real-time"])?;
            (qemu, uarts.accept().map_err(QemuError::Uart)?)
        }
    })
}
