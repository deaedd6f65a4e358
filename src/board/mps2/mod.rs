//! QEMU's mps2-an386: a Cortex-M4F whose sensors, motor and flash are simulated by the host.
//!
//! In lock-step, which is how tests and `north find` run, time passes only when nothing is left to do: instead of
//! sleeping, the idle task lets the timer run out that would be next, and in [`Ticker::sync`] the host lets the world
//! go on by a tick and hands over what has arrived. So results do not depend on how fast instructions are.
//!
//! With the argument `free-running` the timers run by themselves, by instructions counted, and a solution takes as long as it takes:
//! `solve` can lag. All else stays as it is in lock-step, so that two runs are the same, and the same as in lock-step where nothing lags.
//!
//! With the argument `real-time` the timers run by the host's clock, and the gyro's bytes and the link go over the emulated UARTs.

mod end;
mod exchange;
mod flash;
mod log;
pub mod pac;

use core::cell::RefCell;
use core::convert::Infallible;
use core::sync::atomic::{AtomicU8, Ordering};

use cortex_m::interrupt::Mutex;
use cortex_m::peripheral::{NVIC, SCB};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use heapless::Vec;
use north_finder::drivers::analogue::{self, Input};
use north_finder::drivers::intake::{Intake, Line};
use north_finder::event::identity;
use north_finder::event::restart::Cause;
use north_finder::instrument::analogue::Calibration;
use north_finder::instrument::update;
use north_finder::link::MAX_REPORT;

use exchange::{Exchange, has_argument};
pub use flash::Flash;

/// What the board is called on the link.
pub const BOARD: identity::Board = identity::Board::Mps2;
/// Cycles of the 25 MHz clock in a tick of 2.5 ms, and in a slot, rounded down: slots start anew at every tick.
const TIMER_CYCLES: u32 = 62_500;
const SLOT_CYCLES: u32 = TIMER_CYCLES / SLOTS_PER_TICK as u32;
/// Rounds of two instructions in a tick, where one takes the 8 ns that QEMU is told.
pub const TICK_ROUNDS: u32 = 156_250;
const SLOTS_PER_TICK: u8 = 8;
/// Bits of the status of a tick.
const POWER_OFF: u8 = 1;
const LIMIT_OPEN: u8 = 2;
/// No analogue input is converted.
const NO_INPUT: u8 = 0xFF;

/// How time passes.
#[derive(Clone, Copy, PartialEq)]
enum Pace {
    LockStep,
    FreeRunning,
    RealTime,
}

/// What the parts of the board share.
struct State {
    exchange: Exchange,
    pace: Pace,
    /// The free-running timer when the tick began.
    tick_began: u32,
    /// Whether the motor needs its slots, and how many have begun in this tick.
    slots_run: bool,
    slots_begun: u8,
    edges: Vec<u8, 64>,
    /// The analogue input that is converted, and the last result.
    input: u8,
    code: u16,
    /// The limit switch is open.
    limit_open: bool,
    /// A report is out.
    sent: bool,
}

static STATE: Mutex<RefCell<State>> = Mutex::new(RefCell::new(State {
    exchange: Exchange::closed(),
    pace: Pace::LockStep,
    tick_began: 0,
    slots_run: false,
    slots_begun: 0,
    edges: Vec::new(),
    input: NO_INPUT,
    code: 0,
    limit_open: false,
    sent: false,
}));

fn with<R>(f: impl FnOnce(&mut State) -> R) -> R {
    cortex_m::interrupt::free(|cs| f(&mut STATE.borrow(cs).borrow_mut()))
}

pub struct Board {
    pub ticker: Ticker,
    pub slots: Slots,
    pub gyro: GyroLine,
    pub gyro_port: GyroPort,
    pub host: HostLine,
    pub reports: ReportPort,
    pub accelerometer: Accelerometer,
    pub encoder: Encoder,
    pub block: Block,
    pub step: Step,
    pub direction: Direction,
    pub enable: Enable,
    pub limit: Limit,
    pub flash: Flash,
    pub converter: Converter,
    /// What no other start has: nothing here is a secret.
    pub entropy: [u32; 4],
    /// There is none.
    pub crystal: Option<bool>,
}

pub type Accelerometer = Spi<0>;
pub type Encoder = Spi<1>;
pub type Block = Spi<2>;
pub type Step = Pin<0>;
pub type Direction = Pin<1>;
pub type Enable = Pin<2>;

pub fn init(_device: pac::Peripherals, intake: &'static Intake) -> Board {
    with(|state| {
        state.exchange.open();
        if has_argument("real-time") {
            state.pace = Pace::RealTime;
            pac::UART0.start();
            pac::UART1.start();
        } else if has_argument("free-running") {
            state.pace = Pace::FreeRunning;
        }
    });
    Board {
        ticker: Ticker(intake),
        slots: Slots,
        gyro: GyroLine,
        gyro_port: GyroPort,
        host: HostLine,
        reports: ReportPort,
        accelerometer: Spi,
        encoder: Spi,
        block: Spi,
        step: Pin,
        direction: Pin,
        enable: Pin,
        limit: Limit,
        flash: Flash,
        converter: Converter,
        entropy: [0; 4],
        crystal: None,
    }
}

/// There is one image.
pub fn slots() -> Option<&'static mut dyn update::Slots> {
    None
}

/// It has no number of its own.
pub fn serial() -> [u32; 3] {
    [0; 3]
}

/// Waits for the next interrupt; making one, in lock-step, is counted as the exchange's. Free-running it does not sleep: QEMU lets a
/// processor that sleeps by instructions miss interrupts of one of two timers (seen in 7.2). It counts through a hundredth of a tick instead of
/// asking the timer over and over.
pub fn sleep() {
    let began = pac::TIMER0.remaining();
    let pace = with(|state| {
        if state.pace == Pace::LockStep {
            NVIC::pend(state.next_timer());
        }
        state.exchange.count_from(began);
        state.pace
    });
    match pace {
        Pace::LockStep => {}
        Pace::FreeRunning => cortex_m::asm::delay(TICK_ROUNDS / 100),
        Pace::RealTime => cortex_m::asm::wfi(),
    }
}

/// Starts anew, as after power-up.
pub fn restart() -> ! {
    SCB::sys_reset()
}

/// Nothing to be done: time stands still until the first tick after the restart, and that one takes the current off.
pub fn motor_off() {}

/// The watchdog's first time-out; the second one would reset.
pub const NOT_MASKABLE: Cause = Cause::Watchdog;

/// What the board knows of its last reset: nothing.
pub fn reset_cause() -> Option<Cause> {
    None
}

/// Two seconds.
const WATCHDOG_CYCLES: u32 = 50_000_000;

pub struct Watchdog;

impl Watchdog {
    /// Two seconds: the pace is not known yet, so the longer time-out is set first.
    pub fn start() -> Self {
        pac::WATCHDOG.start(WATCHDOG_CYCLES);
        Self
    }

    /// Two seconds; in lock-step, where time is instructions, half a second of them: five times what the longest work takes.
    pub fn feed(&mut self) {
        let cycles = if with(|state| state.pace) == Pace::LockStep { 12_500_000 } else { WATCHDOG_CYCLES };
        pac::WATCHDOG.start(cycles);
    }
}

pub struct Ticker(&'static Intake);

impl Ticker {
    /// Begins, once all else is ready.
    pub fn start(self) -> Self {
        if with(|state| state.pace) == Pace::LockStep {
            pac::TIMER0.run_freely();
        } else {
            pac::TIMER0.start(TIMER_CYCLES, TIMER_CYCLES);
        }
        self
    }

    /// Takes the timer's interrupt and lets the gyro sample. What has come on the lines is in the intake afterwards, in real time by
    /// their interrupts. Gives how many ticks were lost: none, time stands still for what is late.
    pub fn sync(&mut self) -> u32 {
        pac::TIMER0.acknowledge();
        with(|state| state.tick(self.0));
        0
    }
}

impl State {
    /// In lock-step: the timer that is the next to run out.
    fn next_timer(&self) -> pac::Interrupt {
        let slot = self.slots_run && self.slots_begun < SLOTS_PER_TICK;
        if slot { pac::Interrupt::TIM3 } else { pac::Interrupt::TIM2 }
    }

    /// Lets the world go on by a tick.
    fn tick(&mut self, intake: &Intake) {
        let all_cycles = self.tick_began.wrapping_sub(pac::TIMER0.remaining());
        let busy_cycles = all_cycles.wrapping_sub(self.exchange.take_cycles());
        let input = core::mem::replace(&mut self.input, NO_INPUT);
        let reply = self.exchange.ask(b'T', &[&busy_cycles.to_le_bytes(), &[input], &self.edges]);
        let (status, gyro, requests) = match *reply {
            [status, code_low, code_high, low, high, ref bytes @ ..] => {
                self.code = u16::from_le_bytes([code_low, code_high]);
                let (gyro, requests) = bytes.split_at(u16::from_le_bytes([low, high]).into());
                (status, gyro, requests)
            }
            _ => end::broken("the host's answer to a tick is too short"),
        };
        intake.gyro.put(gyro);
        intake.host.put(requests);
        self.limit_open = status & LIMIT_OPEN != 0;
        if status & POWER_OFF != 0 {
            end::power_off(self);
        }
        self.edges.clear();
        self.slots_begun = 0;
        self.exchange.take_cycles();
        self.tick_began = pac::TIMER0.remaining();
    }
}

/// How much of the tick under way has passed: in lock-step by the instructions that it took, else by the timer.
pub fn passed_permille() -> u32 {
    let cycles = with(|state| {
        let from = if state.pace == Pace::LockStep { state.tick_began } else { TIMER_CYCLES };
        from.wrapping_sub(pac::TIMER0.remaining())
    });
    cycles / (TIMER_CYCLES / 1000)
}

/// The motor's slots: eight to a tick, the first one half a slot after it.
pub struct Slots;

impl Slots {
    /// Called in every tick in which the motor turns.
    pub fn start(&mut self) {
        with(|state| {
            state.slots_run = true;
            if state.pace != Pace::LockStep {
                pac::TIMER1.start(SLOT_CYCLES / 2, SLOT_CYCLES);
            }
        });
    }

    pub fn stop(&mut self) {
        with(|state| state.slots_run = false);
        pac::TIMER1.stop();
    }

    /// Takes the timer's interrupt.
    pub fn acknowledge(&mut self) {
        pac::TIMER1.acknowledge();
        with(|state| {
            state.slots_begun += 1;
            if state.slots_begun == SLOTS_PER_TICK {
                pac::TIMER1.stop();
            }
        });
    }
}

/// The motor's limit switch, as the host tells it with each tick.
pub struct Limit;

impl Limit {
    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        with(|state| state.limit_open)
    }
}

/// An output of the motor. Its edges go to the world with the next tick.
pub struct Pin<const NUMBER: u8>;

impl<const NUMBER: u8> Pin<NUMBER> {
    fn set(&mut self, level: bool) {
        with(|state| {
            let slot = state.slots_begun.saturating_sub(1);
            let edge = slot << 5 | NUMBER << 1 | u8::from(level);
            state.edges.push(edge).expect("too many edges in a tick");
        });
    }
}

impl<const NUMBER: u8> digital::ErrorType for Pin<NUMBER> {
    type Error = Infallible;
}

impl<const NUMBER: u8> OutputPin for Pin<NUMBER> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

/// The analogue inputs: converted by the host, with the next tick.
pub struct Converter;

impl analogue::Converter for Converter {
    fn start(&mut self, input: Input) {
        with(|state| state.input = input as u8);
    }

    fn result(&mut self) -> Option<u16> {
        Some(with(|state| state.code))
    }
}

/// No maker converted anything.
pub fn analogue_calibration() -> Calibration {
    Calibration::TYPICAL
}

/// The gyro's line.
pub struct GyroLine;

impl GyroLine {
    /// Takes the interrupt: in real time bytes have come.
    pub fn serve<const N: usize>(&mut self, line: &Line<N>) {
        receive(pac::UART1, line);
    }
}

/// The gyro's line, away from the instrument.
pub struct GyroPort;

impl GyroPort {
    /// In real time its UART; else the exchange.
    pub fn send(&mut self, byte: u8) {
        with(|state| match state.pace {
            Pace::RealTime => pac::UART1.write(byte),
            Pace::LockStep | Pace::FreeRunning => state.exchange.tell(b'G', &[&[byte]]),
        });
    }
}

/// The host's line.
pub struct HostLine;

impl HostLine {
    /// Takes the interrupt: in real time bytes have come. Gives whether what was to be sent is out.
    pub fn serve<const N: usize>(&mut self, line: &Line<N>) -> bool {
        receive(pac::UART0, line);
        with(|state| core::mem::take(&mut state.sent))
    }
}

fn receive<const N: usize>(uart: pac::Uart, line: &Line<N>) {
    while let Some(byte) = uart.read() {
        line.put(&[byte]);
    }
}

/// The host's line, away from the instrument.
pub struct ReportPort;

impl ReportPort {
    /// Sends; [`HostLine::serve`] tells that all is out, which it is at once.
    pub fn start(&mut self, bytes: &'static [AtomicU8]) {
        let byte = |place: &AtomicU8| place.load(Ordering::Relaxed);
        with(|state| {
            match state.pace {
                Pace::RealTime => bytes.iter().for_each(|place| pac::UART0.write(byte(place))),
                Pace::LockStep | Pace::FreeRunning => {
                    for places in bytes.chunks(MAX_REPORT) {
                        let part: Vec<u8, MAX_REPORT> = places.iter().map(byte).collect();
                        state.exchange.tell(b'U', &[&part]);
                    }
                }
            }
            state.sent = true;
        });
        NVIC::pend(pac::Interrupt::USART2);
    }
}

/// A device behind its select line.
pub struct Spi<const DEVICE: u8>;

impl<const DEVICE: u8> spi::ErrorType for Spi<DEVICE> {
    type Error = Infallible;
}

impl<const DEVICE: u8> SpiDevice for Spi<DEVICE> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        with(|state| state.exchange.timed(|exchange| transfer(DEVICE, operations, exchange)));
        Ok(())
    }
}

/// A transaction, by the exchange.
fn transfer(device: u8, operations: &mut [Operation<'_, u8>], exchange: &mut Exchange) {
    let mut mosi = Vec::<u8, 40>::new();
    for operation in operations.iter() {
        match operation {
            Operation::Write(bytes) => mosi.extend_from_slice(bytes),
            Operation::TransferInPlace(bytes) => mosi.extend_from_slice(bytes),
            Operation::Read(bytes) => mosi.resize(mosi.len() + bytes.len(), 0),
            Operation::Transfer(read, write) => {
                let padding = read.len().saturating_sub(write.len());
                mosi.extend_from_slice(write).and_then(|()| mosi.resize(mosi.len() + padding, 0))
            }
            // The world stands still within a transaction.
            Operation::DelayNs(_) => Ok(()),
        }
        .expect("a transaction longer than the drivers' longest");
    }
    let mut miso = exchange.ask(b'S', &[&[device], &mosi]);
    for operation in operations {
        let (length, target) = match operation {
            Operation::Read(bytes) | Operation::TransferInPlace(bytes) => (bytes.len(), Some(bytes)),
            Operation::Write(bytes) => (bytes.len(), None),
            Operation::Transfer(read, write) => (read.len().max(write.len()), Some(read)),
            Operation::DelayNs(_) => (0, None),
        };
        let (now, later) = miso.split_at(length);
        if let Some(target) = target {
            target.copy_from_slice(&now[..target.len()]);
        }
        miso = later;
    }
}
