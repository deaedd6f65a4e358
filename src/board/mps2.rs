//! QEMU's mps2-an386: a Cortex-M4F whose sensors, motor and flash are simulated by the host.
//!
//! In lock-step, which is how tests and `north find` run, world time passes only in [`Ticker::sync`]: the host lets
//! the world go on by a tick and hands over what has arrived. If the tick before is not finished when the timer fires,
//! the world waits, so that results do not depend on how fast instructions are. With the argument `real-time` the
//! gyro's bytes and the link go over the emulated UARTs and nothing waits.

mod exchange;
mod log;
pub mod pac;

use core::cell::RefCell;
use core::convert::Infallible;
use core::fmt::Write;

use cortex_m::interrupt::Mutex;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug;
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use embedded_storage::nor_flash::{self, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use heapless::{Deque, String, Vec};

use super::Overrun;
use exchange::{Exchange, has_argument};

/// Cycles of the 25 MHz clock in a tick of 2.5 ms.
const TICK_CYCLES: u32 = 62_500;
const SLOTS_PER_TICK: u8 = 8;

/// What the parts of the board share.
struct State {
    exchange: Exchange,
    real_time: bool,
    /// The processor has slept since the last tick: everything that the tick caused is done.
    rested: bool,
    /// Ticks at which the world had to wait, since it went on last.
    held_ticks: u32,
    /// Cycles slept since the world went on last.
    slept_cycles: u32,
    /// Slots that have begun in this tick.
    slots_begun: u8,
    edges: Vec<u8, 64>,
    gyro: Deque<u8, 1024>,
    requests: Deque<u8, 1024>,
}

static STATE: Mutex<RefCell<State>> = Mutex::new(RefCell::new(State {
    exchange: Exchange::closed(),
    real_time: false,
    rested: false,
    held_ticks: 0,
    slept_cycles: 0,
    slots_begun: 0,
    edges: Vec::new(),
    gyro: Deque::new(),
    requests: Deque::new(),
}));

fn with<R>(f: impl FnOnce(&mut State) -> R) -> R {
    cortex_m::interrupt::free(|cs| f(&mut STATE.borrow(cs).borrow_mut()))
}

pub struct Board {
    pub ticker: Ticker,
    pub slots: Slots,
    pub gyro: GyroPort,
    pub requests: RequestPort,
    pub reports: ReportPort,
    pub accelerometer: Accelerometer,
    pub encoder: Encoder,
    pub step: Step,
    pub direction: Direction,
    pub enable: Enable,
    pub flash: Flash,
}

pub type Accelerometer = Spi<0>;
pub type Encoder = Spi<1>;
pub type Step = Pin<0>;
pub type Direction = Pin<1>;
pub type Enable = Pin<2>;

pub fn init(_device: pac::Peripherals) -> Board {
    with(|state| {
        state.exchange.open();
        state.real_time = has_argument("real-time");
        if state.real_time {
            pac::UART0.start();
            pac::UART1.start();
        }
    });
    pac::TIMER0.start(TICK_CYCLES);
    Board {
        ticker: Ticker,
        slots: Slots,
        gyro: GyroPort,
        requests: RequestPort,
        reports: ReportPort,
        accelerometer: Spi,
        encoder: Spi,
        step: Pin,
        direction: Pin,
        enable: Pin,
        flash: Flash,
    }
}

/// Waits for the next interrupt.
pub fn sleep() {
    // An interrupt that comes while they are masked ends the sleep, and is served after it has been timed.
    cortex_m::interrupt::disable();
    let before = pac::TIMER0.remaining();
    with(|state| state.rested = true);
    cortex_m::asm::wfi();
    let after = pac::TIMER0.remaining();
    with(|state| state.slept_cycles += before - after);
    // SAFETY: they were on before; RTIC calls this from its idle task only.
    unsafe { cortex_m::interrupt::enable() };
}

/// Starts anew, as after power-up.
pub fn restart() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

pub struct Ticker;

impl Ticker {
    /// Takes the timer's interrupt and lets the gyro sample. False: not yet, this tick does not count.
    pub fn sync(&mut self) -> bool {
        pac::TIMER0.start(TICK_CYCLES);
        with(|state| {
            if !state.real_time && !core::mem::take(&mut state.rested) {
                state.held_ticks += 1;
                return false;
            }
            state.tick();
            true
        })
    }
}

impl State {
    /// Lets the world go on by a tick.
    fn tick(&mut self) {
        let busy_cycles = (TICK_CYCLES * (1 + self.held_ticks)).saturating_sub(self.slept_cycles);
        let reply = self.exchange.ask(b'T', &[&busy_cycles.to_le_bytes(), &self.edges]);
        let (status, gyro, requests) = match *reply {
            [status, low, high, ref bytes @ ..] => {
                let (gyro, requests) = bytes.split_at(u16::from_le_bytes([low, high]).into());
                (status, gyro, requests)
            }
            _ => panic!("the host's answer to a tick is too short"),
        };
        if status != 0 {
            self.power_off();
        }
        // As on a line that nobody reads: what there is no room for is lost.
        gyro.iter().for_each(|&byte| self.gyro.push_back(byte).unwrap_or(()));
        requests.iter().for_each(|&byte| self.requests.push_back(byte).unwrap_or(()));
        pend_while_waiting(&self.gyro, pac::Interrupt::USART1);
        pend_while_waiting(&self.requests, pac::Interrupt::USART2);
        self.edges.clear();
        self.slots_begun = 0;
        self.held_ticks = 0;
        self.slept_cycles = 0;
    }

    fn power_off(&mut self) -> ! {
        self.exchange.tell(b'Z', &[&most_stack_bytes().to_le_bytes()]);
        exchange::exit(debug::EXIT_SUCCESS)
    }
}

/// A receiver holds its interrupt up while a byte waits.
fn pend_while_waiting<const N: usize>(bytes: &Deque<u8, N>, interrupt: pac::Interrupt) {
    if !bytes.is_empty() {
        NVIC::pend(interrupt);
    }
}

/// The motor's slots: eight to a tick, the first one half a slot after it.
pub struct Slots;

impl Slots {
    /// Starts the slots of this tick.
    pub fn start(&mut self) {
        self.wait_for(0);
    }

    pub fn stop(&mut self) {
        pac::TIMER1.stop();
    }

    /// Takes the timer's interrupt.
    pub fn acknowledge(&mut self) {
        let begun = with(|state| {
            state.slots_begun += 1;
            state.slots_begun
        });
        if begun < SLOTS_PER_TICK { self.wait_for(begun) } else { self.stop() }
    }

    fn wait_for(&mut self, slot: u8) {
        let half_slots_left = 2 * (SLOTS_PER_TICK - slot) - 1;
        let left = TICK_CYCLES * u32::from(half_slots_left) / u32::from(2 * SLOTS_PER_TICK);
        pac::TIMER1.start(pac::TIMER0.remaining().saturating_sub(left).max(1));
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

/// The gyro's line.
pub struct GyroPort;

impl GyroPort {
    /// The byte that interrupted, if one did.
    pub fn read(&mut self) -> Option<Result<u8, Overrun>> {
        with(|state| {
            if state.real_time {
                return pac::UART1.read();
            }
            let byte = state.gyro.pop_front();
            pend_while_waiting(&state.gyro, pac::Interrupt::USART1);
            byte
        })
        .map(Ok)
    }
}

/// The host's line, towards the instrument.
pub struct RequestPort;

impl RequestPort {
    /// The byte that interrupted, if one did.
    pub fn read(&mut self) -> Option<Result<u8, Overrun>> {
        with(|state| {
            if state.real_time {
                return pac::UART0.read();
            }
            let byte = state.requests.pop_front();
            pend_while_waiting(&state.requests, pac::Interrupt::USART2);
            byte
        })
        .map(Ok)
    }
}

/// The host's line, away from the instrument.
pub struct ReportPort;

impl ReportPort {
    /// Sends all, and waits as long as that takes.
    pub fn write(&mut self, bytes: &[u8]) {
        if with(|state| state.real_time) {
            bytes.iter().for_each(|&byte| pac::UART0.write(byte));
        } else {
            with(|state| state.exchange.tell(b'U', &[bytes]));
        }
    }
}

/// A device behind its select line.
pub struct Spi<const DEVICE: u8>;

impl<const DEVICE: u8> spi::ErrorType for Spi<DEVICE> {
    type Error = Infallible;
}

impl<const DEVICE: u8> SpiDevice for Spi<DEVICE> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let mut mosi = Vec::<u8, 32>::new();
        for operation in operations.iter() {
            match operation {
                Operation::Write(bytes) => mosi.extend_from_slice(bytes),
                Operation::TransferInPlace(bytes) => mosi.extend_from_slice(bytes),
                Operation::Read(bytes) => mosi.resize(mosi.len() + bytes.len(), 0),
                Operation::Transfer(..) | Operation::DelayNs(_) => unimplemented!("no driver uses it"),
            }
            .expect("a transaction longer than the drivers' longest");
        }
        with(|state| {
            let mut miso = state.exchange.ask(b'S', &[&[DEVICE], &mosi]);
            for operation in operations {
                let (length, target) = match operation {
                    Operation::Read(bytes) | Operation::TransferInPlace(bytes) => (bytes.len(), Some(bytes)),
                    Operation::Write(bytes) => (bytes.len(), None),
                    Operation::Transfer(..) | Operation::DelayNs(_) => (0, None),
                };
                let (now, later) = miso.split_at(length);
                if let Some(target) = target {
                    target.copy_from_slice(now);
                }
                miso = later;
            }
        });
        Ok(())
    }
}

/// The flash memory: two sectors of 4096 bytes, words of four.
pub struct Flash;

/// The simulated flash refused; its error number.
#[derive(Clone, Copy, Debug, defmt::Format)]
pub struct FlashError(u8);

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl nor_flash::ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let length = (bytes.len() as u16).to_le_bytes();
        with(|state| bytes.copy_from_slice(state.exchange.ask(b'R', &[&offset.to_le_bytes(), &length])));
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * Self::ERASE_SIZE
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        with(|state| flash_result(state.exchange.ask(b'E', &[&from.to_le_bytes(), &to.to_le_bytes()])))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        with(|state| flash_result(state.exchange.ask(b'W', &[&offset.to_le_bytes(), bytes])))
    }
}

fn flash_result(reply: &[u8]) -> Result<(), FlashError> {
    match *reply {
        [0] => Ok(()),
        [error] => Err(FlashError(error)),
        _ => panic!("the host's answer to a flash operation is not a byte"),
    }
}

/// How much of the stack was ever used, by the paint that is gone from it.
fn most_stack_bytes() -> u32 {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let (top, mut at) = (&raw const _stack_start, &raw const _stack_end);
    // SAFETY: from `at` to `top` is the stack, which starts at the top and was painted before main.
    unsafe {
        while at < top && at.read_volatile() == cortex_m_rt::STACK_PAINT_VALUE {
            at = at.add(1);
        }
        top.byte_offset_from(at) as u32
    }
}

/// Tells the host why, and ends QEMU: a test never hangs.
fn die(why: core::fmt::Arguments) -> ! {
    cortex_m::interrupt::disable();
    let mut text = String::<512>::new();
    // What does not fit is left out.
    let _ = text.write_fmt(why);
    cortex_m::interrupt::free(|cs| {
        // If the panic came from inside an exchange, there is no other way than the exit code.
        if let Ok(mut state) = STATE.borrow(cs).try_borrow_mut() {
            state.exchange.tell(b'P', &[text.as_bytes()]);
        }
    });
    exchange::exit(debug::EXIT_FAILURE)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    die(format_args!("{info}"))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    die(format_args!("hard fault at {:#010x}", frame.pc()))
}

#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    die(format_args!("interrupt {number} has no task"))
}
