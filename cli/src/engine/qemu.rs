//! The fix as the real firmware image in QEMU, in lock-step with the simulated instrument.
//!
//! The image talks to this module over QEMU's standard input and output; `src/board/mps2/exchange.rs` describes the
//! messages. World time passes only while a tick's request is answered here, and QEMU's clock counts instructions, so a
//! run depends on nothing but image, scenario and seed.

pub mod image;
mod process;
mod wire;

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use embedded_hal::digital::OutputPin;
use embedded_io::Read as _;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use hal_sim::flash::FlashError;
use hal_sim::{AccelerometerSpi, EncoderSpi, Flash, GyroLine, Pin, World};
use north_finder::drivers::step_motor::SLOTS_PER_TICK;
use north_finder::link::{self, ReportDecoder, Request};
use north_finder::pipeline::Command;
use north_finder::sample::SAMPLE_S;

use super::{End, EndWatch, EngineError, Observer, Outcome, Setup};
use process::Qemu;
use wire::{Ask, Edge};

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
    /// World time over host time.
    pub fn speed(&self) -> f64 {
        self.ticks as f64 * SAMPLE_S / self.wall.as_secs_f64()
    }
}

/// Powers the instrument up in QEMU, starts a fix and goes on until it ends.
///
/// `observe` sees every report. `stop` is looked at in every tick. Whatever happens, QEMU has ended when this returns.
pub fn run(
    image: &Path,
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
) -> Result<(Outcome, Cost), EngineError> {
    let started = Instant::now();
    let world = super::world(setup)?;
    let mut qemu = Qemu::start(image, &[])?;
    let mut instrument = Instrument::new(&world)?;
    let limit_ticks = super::limit_ticks(setup);
    let mut watch = EndWatch::default();
    let mut end = None;
    loop {
        match qemu.receive()? {
            Ask::Tick { busy_cycles, edges } => {
                instrument.count(busy_cycles);
                if stop.load(Ordering::Relaxed) {
                    end = end.or(Some(End::Interrupted));
                } else if instrument.cost.ticks >= limit_ticks {
                    end = end.or(Some(End::TimeLimit));
                }
                if !edges.is_empty() {
                    eprintln!(
                        "{} {} {:?}",
                        instrument.cost.ticks,
                        busy_cycles,
                        edges.iter().map(|e| format!("{}.{}{}", e >> 5, e >> 1 & 15, e & 1)).collect::<Vec<_>>()
                    );
                }
                let reply = if end.is_some() { wire::power_off() } else { instrument.tick(edges) };
                qemu.reply(&reply)?;
            }
            Ask::Uart { bytes } => instrument.hear(bytes, &mut |report| {
                observe(report);
                end = end.or(watch.see(report));
            })?,
            Ask::Log { .. } => {}
            Ask::End { stack_bytes } => {
                instrument.cost.stack_bytes = stack_bytes;
                break;
            }
            Ask::Panic { text } => return Err(QemuError::Panicked(text.to_owned()).into()),
            device => {
                let reply = instrument.device(device);
                qemu.reply(&reply)?;
            }
        }
    }
    let cost = Cost { wall: started.elapsed(), ..instrument.cost };
    Ok((Outcome { end: end.unwrap_or(End::Interrupted), truth: world.truth() }, cost))
}

/// What is around the microcontroller.
struct Instrument {
    world: World,
    gyro: GyroLine,
    accelerometer: AccelerometerSpi,
    encoder: EncoderSpi,
    pins: [Pin; 3],
    flash: Flash,
    /// What the host has yet to send.
    requests: Vec<u8>,
    reports: ReportDecoder,
    cost: Cost,
}

impl Instrument {
    fn new(world: &World) -> Result<Self, QemuError> {
        let start = link::encode_request(&Request::Command(Command::Start)).map_err(|_| QemuError::Report)?;
        Ok(Self {
            gyro: world.gyro(),
            accelerometer: world.accelerometer(),
            encoder: world.encoder(),
            pins: [world.step_pin(), world.dir_pin(), world.enable_pin()],
            flash: world.flash(),
            world: world.clone(),
            requests: start.to_vec(),
            reports: ReportDecoder::new(),
            cost: Cost::default(),
        })
    }

    /// Takes what the last tick cost; the first message of all tells of the start-up.
    fn count(&mut self, busy_cycles: u32) {
        let instructions = u64::from(busy_cycles) * u64::from(CYCLE_NS / INSTRUCTION_NS);
        let cost = &mut self.cost;
        if cost.ticks > 0 {
            cost.mean_instructions += (instructions as f64 - cost.mean_instructions) / cost.ticks as f64;
            if instructions > cost.most_instructions {
                (cost.most_instructions, cost.most_at_tick) = (instructions, cost.ticks - 1);
            }
        }
    }

    /// Lets the world go on by a tick, the motor's pins as the firmware set them.
    fn tick(&mut self, edges: &[u8]) -> Vec<u8> {
        for slot in 0..SLOTS_PER_TICK {
            for edge in edges.iter().copied().map(Edge::from).filter(|edge| edge.slot == slot) {
                if let Some(pin) = self.pins.get_mut(edge.pin) {
                    let Ok(()) = pin.set_state(edge.level.into());
                }
            }
            self.world.advance_slot();
        }
        self.world.sample();
        self.cost.ticks += 1;
        let mut gyro = Vec::new();
        let mut bytes = [0; 256];
        while let Ok(count @ 1..) = self.gyro.read(&mut bytes) {
            gyro.extend(bytes.iter().take(count));
        }
        wire::tick_reply(&gyro, &std::mem::take(&mut self.requests))
    }

    /// Decodes what the firmware sent over its report port.
    fn hear(&mut self, bytes: &[u8], observe: &mut Observer<'_>) -> Result<(), QemuError> {
        for report in bytes.iter().filter_map(|&byte| self.reports.feed(byte)) {
            observe(&report.map_err(|_| QemuError::Report)?);
        }
        Ok(())
    }

    /// Answers for one of the devices.
    fn device(&mut self, ask: Ask<'_>) -> Vec<u8> {
        match ask {
            Ask::Spi { device: 0, mosi } => self.accelerometer.exchange(mosi),
            Ask::Spi { mosi, .. } => self.encoder.exchange(mosi),
            Ask::ReadFlash { offset, length } => {
                let mut bytes = vec![0xFF; length.into()];
                // Beyond the end it reads as erased.
                let _ = self.flash.read(offset, &mut bytes);
                bytes
            }
            Ask::WriteFlash { offset, bytes } => flash_reply(self.flash.write(offset, bytes)),
            Ask::EraseFlash { from, to } => flash_reply(self.flash.erase(from, to)),
            Ask::Tick { .. } | Ask::Uart { .. } | Ask::Log { .. } | Ask::Panic { .. } | Ask::End { .. } => Vec::new(),
        }
    }
}

fn flash_reply(result: Result<(), FlashError>) -> Vec<u8> {
    vec![result.map_or_else(FlashError::code, |()| 0)]
}
