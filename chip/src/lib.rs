//! The image that is flashed, executed: an emulated microcontroller on the board that `src/board/f405/mod.rs` describes, wired to the
//! simulated instrument.
//!
//! The emulator is [`rigless`]: its STM32F427 is the STM32F405 with more memory and more devices, by the same reference manual
//! (RM0090), with the same addresses. It has what QEMU's STM32F405 lacks: DMA, timers that keep time, slaves on SPI buses, clocks, the
//! flash's controller, and the independent watchdog.
//!
//! Time is the chip's: an instruction takes a cycle of 168 MHz. The world goes on by an eighth of a tick at a time, as the 2.5 ms timer
//! counts, from the moment in which the image starts that timer; while it does not run (the image starts), the world stands still.

mod core;
mod devices;
mod flash;
pub mod image;
mod microcontroller;
mod parts;
mod witness;

use std::fmt;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex};

use embedded_hal::digital::OutputPin as _;
use hal_sim::{Pin, World};
use rigless::device::Level;
use rigless::emulator::{self, AccessKind, Driver, Finished, Host, Settled, Start, Stop, Watch};
use rigless::image::Image;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use devices::{GyroOutput, HostLine, Slave};
use flash::{Array, SharedArray};
use microcontroller::{MotorPins, Wired};
use parts::{Adis16505, Adxl355, As5048a};
use witness::{Ledger, Witness};

/// Where the maker of the chip wrote the size of its flash, and what he wrote: KiB (RM0090, 39.2).
const FLASH_SIZE: u64 = 0x1FFF_7A22;
const FLASH_KIB: u16 = 1024;
/// Where the settings are in the flash.
const SETTINGS: u64 = 0x0800_4000;
/// Where the sectors of the log are: 4 and 11.
const LOG: [u64; 2] = [0x0801_0000, 0x080E_0000];
const TICK: u64 = 2_500_000;
const SLOTS_PER_TICK: u64 = 8;
const SLOT: u64 = TICK / SLOTS_PER_TICK;
/// How often it is looked whether the image has started its timer, and for how long after a reset.
const LOOK: u64 = 100_000;
const PATIENCE: u64 = 12_000_000_000;
/// The bit of a bad word.
const BAD_BIT: u64 = 1 << 7;

/// What the chip starts with.
pub struct Setup<'a> {
    /// The firmware, as it is flashed.
    pub image: &'a Path,
    /// The loader in the first sector, where the firmware is linked for a slot.
    pub loader: Option<&'a Path>,
    /// What the flash's sectors for settings hold; the rest of them is erased.
    pub settings: &'a [u8],
    /// What the two sectors of the log hold; the rest of them is erased.
    pub log: [&'a [u8]; 2],
    /// The board's crystal, MHz; 0: it has none that starts.
    pub crystal_mhz: u64,
    /// From when on accelerometer, encoder and block are there, ns after power-up.
    pub parts_from_ns: [u64; 3],
    /// From when on the accelerometer measures no more, ns after power-up.
    pub accelerometer_stops_ns: u64,
    /// The encoder's magnet is weak: its diagnostics say so, and its angle is valid nevertheless.
    pub weak_magnet: bool,
    /// An error flag of the block that is raised at this time, ns after power-up, and stays until it is read.
    pub block_flag: Option<(u64, u16)>,
    /// So many bytes are programmed until power fails; erasing a sector counts for 64.
    pub power_fails_after: Option<u64>,
    /// At the end of this tick the 2.5 ms timer stops by itself: an interrupt that comes no more.
    pub timer_stops: Option<u64>,
    /// At the ends of these ticks the timer does not interrupt: nobody sees them.
    pub unseen_ticks: Range<u64>,
    /// A word of memory in which one bit is always 0.
    pub bad_word: Option<u32>,
    /// Of a million bytes from the gyro so many come with noise, and as many with a wrong stop bit.
    pub damaged_per_million: u32,
}

impl<'a> Setup<'a> {
    /// Nothing stored, and nothing wrong.
    pub fn new(image: &'a Path) -> Self {
        Self {
            image,
            loader: None,
            settings: &[],
            log: [&[]; 2],
            crystal_mhz: 8,
            parts_from_ns: [0; 3],
            accelerometer_stops_ns: u64::MAX,
            weak_magnet: false,
            block_flag: None,
            power_fails_after: None,
            timer_stops: None,
            unseen_ticks: 0..0,
            bad_word: None,
            damaged_per_million: 0,
        }
    }
}

/// What is at the other end of the host's line.
pub trait Line: Send + 'static {
    /// A tick is over, counted from 0 at the first one ever: what the chip has sent since the one before. Gives what is sent to the chip
    /// from now on; `None`: power off.
    fn tick(&mut self, tick: u64, sent: &[u8]) -> Option<Vec<u8>>;
}

/// What became of a run.
#[derive(Debug)]
pub struct Ran<L> {
    pub line: L,
    /// How often the chip was reset, and by what: the core itself, or a device.
    pub resets: Vec<String>,
    /// The motor had current when one of them came.
    pub current_at_reset: bool,
    /// Periods of the pulses that tell gyro and block to sample, ns, at the run's end.
    pub pulse_periods_ns: [Option<u64>; 2],
    /// Steps of the motor, and the first and the last moment in an eighth of a tick at which one began, ns.
    pub steps: u64,
    pub step_window_ns: [u64; 2],
    /// The brown-out level in the option bytes at the run's end.
    pub brown_out_level: u8,
    /// What the sectors for settings hold at the run's end.
    pub settings: Vec<u8>,
    /// From power-up to the first tick, ns.
    pub start_ns: u64,
    /// Whether the watchdog stands still while a debugger halts the core.
    pub watchdog_frozen_in_debug: bool,
    /// What a data sheet of a part, or of the chip's flash, does not allow. The first of these ends the run.
    pub violations: Vec<String>,
    /// Instructions of the whole run, those that wait for the sensors' buses among them.
    pub instructions: u64,
    /// What the reference manual forbids, and registers that the emulator does not have, each once.
    pub complaints: Vec<String>,
}

/// The chip cannot be started, or the image does not start its timer.
#[derive(Debug)]
pub struct NotStarted(String);

impl fmt::Display for NotStarted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the chip cannot be started: {}", self.0)
    }
}

impl std::error::Error for NotStarted {}

fn not_started(error: impl fmt::Display) -> NotStarted {
    NotStarted(error.to_string())
}

/// Powers the chip up in a world, and runs until the line says otherwise.
pub fn run<L: Line>(setup: &Setup<'_>, world: &World, line: L) -> Result<Ran<L>, NotStarted> {
    let ledger = Ledger::default();
    let array = Array::new(setup.settings, setup.power_fails_after, ledger.over().clone(), ledger.clone());
    let array = Arc::new(Mutex::new(array));
    let mut board =
        Wired::new(setup.crystal_mhz * 1_000_000, setup.damaged_per_million, array.clone()).map_err(not_started)?;
    let [accelerometer, encoder, block] = setup.parts_from_ns;
    board.attach(
        Slave::new(world.accelerometer(), Adxl355::new(setup.accelerometer_stops_ns), accelerometer, &ledger),
        Slave::new(world.encoder(), As5048a::new(setup.weak_magnet), encoder, &ledger),
        Slave::new(world.block(), Adis16505::new(setup.block_flag), block, &ledger),
        GyroOutput(world.gyro()),
    );
    let mut images = vec![Image::read(setup.image, None).map_err(not_started)?];
    let size = Image::new(Path::new("size of the flash"), FLASH_KIB.to_le_bytes().to_vec(), Some(FLASH_SIZE));
    images.push(size.map_err(not_started)?);
    if let Some(loader) = setup.loader {
        images.push(Image::read(loader, None).map_err(not_started)?);
    }
    if !setup.settings.is_empty() {
        let settings = Image::new(Path::new("settings"), setup.settings.to_vec(), Some(SETTINGS));
        images.push(settings.map_err(not_started)?);
    }
    for (sector, address) in setup.log.into_iter().zip(LOG).filter(|(sector, _)| !sector.is_empty()) {
        images.push(Image::new(Path::new("log"), sector.to_vec(), Some(address)).map_err(not_started)?);
    }
    let mut session = Session::new(Box::new(board), 0, VirtualNanos(LOOK)).map_err(not_started)?;
    if let Some(address) = setup.bad_word {
        session.watch(Watch::Writes { address: address.into(), length: 4 });
    }
    let surroundings = Surroundings::new(world, line, setup, array.clone(), &ledger);
    let mut start = Start::new(&images);
    start.interrupt = Some(ledger.over());
    let finished = emulator::run(session, &start, surroundings).map_err(not_started)?;
    let Finished { mut session, driver, stop, .. } = finished;
    if driver.looked > PATIENCE {
        return Err(NotStarted(format!("the 2.5 ms timer does not run {PATIENCE} ns after a reset")));
    }
    let told = session.told().map(|told| format!("{told:x?}"));
    let unmapped = session.unmapped().into_iter().map(|unmapped| format!("{unmapped:x?}"));
    let refused = session.refused().iter().map(|refused| format!("{refused:x?}"));
    let unimplemented =
        session.unimplemented().iter().filter(|(address, _)| !microcontroller::TIMER_11.contains(*address));
    let unimplemented = unimplemented.map(|unimplemented| format!("{unimplemented:x?}"));
    let complaints = told.chain(unmapped).chain(refused).chain(unimplemented).collect();
    Ok(Ran {
        resets: session.resets().iter().map(|reset| format!("{:?}", reset.cause)).collect(),
        current_at_reset: driver.current_at_reset,
        pulse_periods_ns: session.board_mut().pulse_periods_ns(),
        steps: driver.steps,
        step_window_ns: driver.step_window_ns,
        brown_out_level: session.board_mut().brown_out_level(),
        settings: array.lock().expect("one thread").settings().to_vec(),
        start_ns: driver.start_ns,
        watchdog_frozen_in_debug: stop.is_some_and(|stop| session.board_mut().watchdog_is_frozen_in_debug(stop.at)),
        violations: ledger.violations(),
        instructions: stop.map_or(0, |stop| stop.instruction_count),
        complaints,
        line: driver.line,
    })
}

/// The world, the motor's driver and the host's line around the chip.
struct Surroundings<L> {
    world: World,
    step: Pin,
    direction: Pin,
    enable: Pin,
    levels: MotorPins,
    line: L,
    /// When the tick under way began, by the chip's timer; nothing while that does not run.
    began: Option<u64>,
    /// Eighths of it that the world has gone on by.
    slots: u64,
    ticks: u64,
    /// How long the timer has not run, ns.
    looked: u64,
    steps: u64,
    step_window_ns: [u64; 2],
    timer_stops: Option<u64>,
    unseen_ticks: Range<u64>,
    start_ns: u64,
    /// How often the chip was reset, and whether the motor had current then.
    resets: usize,
    current_at_reset: bool,
    array: SharedArray,
    witness: Witness,
}

impl<L: Line> Surroundings<L> {
    fn new(world: &World, line: L, setup: &Setup<'_>, array: SharedArray, ledger: &Ledger) -> Self {
        let (step, mut direction, enable) = (world.step_pin(), world.dir_pin(), world.enable_pin());
        let levels = MotorPins::default();
        // Where it floats it is low; step and enable are off in the world by themselves.
        let Ok(()) = direction.set_low();
        let world = world.clone();
        Self {
            world,
            step,
            direction,
            enable,
            levels,
            line,
            began: None,
            slots: 0,
            ticks: 0,
            looked: 0,
            steps: 0,
            step_window_ns: [SLOT, 0],
            timer_stops: setup.timer_stops,
            unseen_ticks: setup.unseen_ticks.clone(),
            start_ns: 0,
            resets: 0,
            current_at_reset: false,
            array,
            witness: Witness::new(ledger.clone()),
        }
    }

    /// Lets the world go on to so many eighths of the tick.
    fn go_on(&mut self, slots: u64) {
        while self.slots < slots {
            self.world.advance_slot();
            self.slots += 1;
        }
    }

    /// A chip that was reset has no timer that runs, and its pins float.
    fn look_for_resets(&mut self, session: &Session<Wired>) {
        if session.resets().len() != self.resets {
            self.resets = session.resets().len();
            self.began = None;
            self.current_at_reset |= self.levels.not_enable == Level::Low;
            self.drive(MotorPins::default());
            self.witness.reset();
            self.array.lock().expect("one thread").reset();
        }
    }

    /// The motor's driver sees its inputs.
    fn drive(&mut self, levels: MotorPins) {
        let set = |pin: &mut Pin, level| match level {
            Level::High => pin.set_high(),
            Level::Low => pin.set_low(),
        };
        if levels.not_enable != self.levels.not_enable {
            let Ok(()) = set(&mut self.enable, opposite(levels.not_enable));
        }
        if levels.direction != self.levels.direction {
            let Ok(()) = set(&mut self.direction, levels.direction);
        }
        if levels.step != self.levels.step {
            let Ok(()) = set(&mut self.step, levels.step);
        }
        self.levels = levels;
    }
}

fn opposite(level: Level) -> Level {
    match level {
        Level::High => Level::Low,
        Level::Low => Level::High,
    }
}

impl<L: Line> Driver<Wired> for Surroundings<L> {
    fn on_settled(&mut self, session: &mut Session<Wired>, host: &mut dyn Host, settled: Settled) {
        self.look_for_resets(session);
        match settled {
            Settled::Access { access, .. } if microcontroller::TIMER_11.contains(&access.address) => {
                session.board_mut().measure_crystal(&access);
            }
            Settled::Access { access, .. } if access.kind == AccessKind::Write => {
                let at = access.virtual_time.0;
                self.witness.access(session.board_mut().mcu_mut(), &access);
                if microcontroller::starts_timer(access.address, access.value) && self.began.is_none() {
                    (self.began, self.slots, self.looked) = (Some(at), 0, 0);
                    self.start_ns = if self.start_ns == 0 { at } else { self.start_ns };
                }
                if microcontroller::is_of_motor_port(access.address) {
                    let levels = session.board_mut().motor_pins();
                    let passed = self.began.map_or(0, |began| at - began);
                    self.go_on((passed / SLOT).min(SLOTS_PER_TICK - 1));
                    if (self.levels.step, levels.step) == (Level::Low, Level::High) {
                        let [first, last] = self.step_window_ns;
                        self.step_window_ns = [first.min(passed % SLOT), last.max(passed % SLOT)];
                        self.steps += 1;
                    }
                    self.witness.motor(levels, access.virtual_time);
                    self.drive(levels);
                }
            }
            Settled::Access { access, value } => self.witness.read(access.address, value),
            Settled::Stop(_) => {
                session.board_mut().hold_absent_crystal();
            }
            Settled::Hit(hit) => {
                let word = host.read(hit.address, Width::W32).expect("memory");
                host.write(hit.address, Width::W32, word & !BAD_BIT).expect("memory");
            }
            _ => {}
        }
    }

    fn on_stop(&mut self, session: &mut Session<Wired>, stop: Stop, _host: &mut dyn Host) -> Option<VirtualNanos> {
        self.look_for_resets(session);
        let Some(began) = self.began else {
            self.looked += LOOK;
            return (self.looked <= PATIENCE).then_some(VirtualNanos(stop.at.0 + LOOK));
        };
        let passed = (stop.at.0 - began) / SLOT;
        self.array.lock().expect("one thread").look(stop.at.0);
        self.witness.look(session.board_mut().mcu_mut(), stop.at);
        self.go_on(passed.min(SLOTS_PER_TICK));
        if passed < SLOTS_PER_TICK {
            return Some(VirtualNanos(began + (passed + 1) * SLOT));
        }
        self.world.sample();
        let board = session.board_mut();
        board.put_on_inputs(&self.world.analogue());
        board.put_on_limit(stop.at, self.world.limit_is_open());
        if self.timer_stops == Some(self.ticks) {
            board.stop_timer(stop.at);
        }
        // The interrupt of this tick's end has been raised already.
        if self.ticks + 1 == self.unseen_ticks.start {
            board.let_timer_interrupt(stop.at, false);
        } else if self.ticks == self.unseen_ticks.end {
            board.let_timer_interrupt(stop.at, true);
        }
        let host: &mut HostLine = board.host_line()?;
        let sent = std::mem::take(&mut host.sent);
        host.to_send.extend(self.line.tick(self.ticks, &sent)?);
        (self.began, self.slots) = (Some(began + TICK), 0);
        self.ticks += 1;
        Some(VirtualNanos(began + TICK + SLOT))
    }
}
