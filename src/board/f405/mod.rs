//! STM32F405RG at 168 MHz from a crystal of 8, 12, 16 or 25 MHz.
//!
//! | pin | goes to |
//! |---|---|
//! | PA0 (TIM2 channel 1) | gyro, sample pulse of 50 µs: it samples at the rising edge, every 2.5 ms |
//! | PA9, PA10 (USART1 TX, RX) | gyro, commands and data: 921600 baud |
//! | PA2, PA3 (USART2 TX, RX) | host: 115200 baud |
//! | PA4, PA5, PA6, PA7 (SPI1) | accelerometer ADXL355: select, clock, data out, data in |
//! | PB12, PB13, PB14, PB15 (SPI2) | encoder AS5048A: select, clock, data out, data in |
//! | PA15, PC10, PC11, PC12 (SPI3) | block ADIS16505, where there is one: select, clock, data out, data in |
//! | PB6 (TIM4 channel 1) | block, sync input: it samples in step with this pulse of 100 Hz |
//! | PC0, PC1, PC2, PC3 (converter 1) | four analogue inputs, 0 to 3.3 V |
//! | PC4 (converter 1) | supply, behind its divider |
//! | PC6, PC7, PC8 | motor driver: step, direction, not-enable |
//! | PC9 | limit switch of the index, where there is one: closed to ground within the travel |
//!
//! The settings are in the flash, sectors 1 and 2: see [`flash`]. Where the crystal does not start or has another frequency, the internal
//! oscillator is used (see [`clock`]), and the first report tells it.

mod analogue;
mod bus;
mod clock;
mod flash;
mod lines;
mod slots;

use core::convert::Infallible;

pub use analogue::{Converter, analogue_calibration};
use bus::Ending;
use cortex_m::peripheral::DWT;
use defmt_rtt as _;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal::spi::{MODE_0, MODE_1, MODE_3};
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
pub use flash::Flash;
use lines::Reception;
pub use lines::{GyroLine, GyroPort, HostLine, ReportPort};
use north_finder::drivers::intake::{GYRO_BYTES, HOST_BYTES, Intake};
use north_finder::event::restart::Cause;
pub use slots::slots;
use stm32f4xx_hal::dma::{Stream2, Stream5, StreamsTuple};
use stm32f4xx_hal::gpio::{self, Input, Output, PinState, Speed};
pub use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable as _, Reset as _};
use stm32f4xx_hal::serial::config::{Config, DmaConfig};
use stm32f4xx_hal::serial::{Event, Serial};
use stm32f4xx_hal::spi::Spi;
use stm32f4xx_hal::time::Hertz;

#[cfg(feature = "f405")]
mod model {
    use north_finder::event::identity;

    /// What the board is called on the link.
    pub const BOARD: identity::Board = identity::Board::Stm32f405;
    /// There is a crystal.
    pub const CLOCK_COMES_IN: bool = false;
}
#[cfg(feature = "nucleo-f446")]
use super::nucleo_f446 as model;
pub use model::BOARD;
/// Of the fastest clock: what is timed by it takes no less with a slower one.
const CYCLES_PER_US: u32 = clock::SYSTEM.raw() / 1_000_000;
/// Within the limits of both parts, and a whole part of both buses' clocks.
const SPI_CLOCK: Hertz = Hertz::kHz(5_250);
/// The block takes at most 1.1 MHz in a burst. A 64th of its bus's clock, to the hertz, for the HAL takes the nearest part: a sample takes
/// 0.42 ms.
const BLOCK_CLOCK: Hertz = Hertz::Hz(656_250);
const GYRO_BAUD: u32 = 921_600;
const HOST_BAUD: u32 = north_finder::link::BAUD;
const TICK_HZ: u32 = 400;
/// Rounds of two instructions in a tick, with the crystal; a jump takes two cycles at least.
pub const TICK_ROUNDS: u32 = clock::SYSTEM.raw() / TICK_HZ / 3;
const SLOTS_HZ: u32 = 3200;
/// The gyro's pulse is high for this part of a tick, 50 µs: KVH's family wants 30 to 90 (1775 IMU, 56-0298 revision B, table 10-1).
const GYRO_PULSE_PART: u32 = 50;
const BLOCK_HZ: u32 = 100;
/// Divides the clock of the block's pulse, so that a period fits 16 bits.
const BLOCK_DIVISOR: u32 = 20;

/// The encoder wants 0.35 µs before, after and between selections, the accelerometer less.
const SELECT_CYCLES: u32 = CYCLES_PER_US / 2;
/// The slowest of the usual stepper drivers (DRV8825) wants 1.9 µs high and low, and 0.65 µs of direction before that.
const STEP_CYCLES: u32 = 2 * CYCLES_PER_US;

/// Within this an alive instrument feeds the watchdog four times; the low-speed oscillator's tolerance makes it 2.7 to 7.5 s.
const WATCHDOG_S: u16 = 4;

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
    /// What no other start has.
    pub entropy: [u32; 4],
    /// Whether the clock runs from the crystal.
    pub crystal: Option<bool>,
}

type Select<PIN> = Held<PIN, SELECT_CYCLES>;
pub type Accelerometer = ExclusiveDevice<Ending<pac::SPI1>, Select<gpio::PA4<Output>>, NoDelay>;
pub type Encoder = ExclusiveDevice<Ending<pac::SPI2>, Select<gpio::PB12<Output>>, NoDelay>;
pub type Block = ExclusiveDevice<Ending<pac::SPI3>, Select<gpio::PA15<Output>>, Cycles>;
pub type Step = Held<gpio::PC6<Output>, STEP_CYCLES>;
pub type Direction = gpio::PC7<Output>;
pub type Enable = ActiveLow<gpio::PC8<Output>>;

#[expect(clippy::too_many_lines, reason = "every pin and peripheral")]
pub fn init(device: pac::Peripherals, intake: &'static Intake) -> Board {
    // SAFETY: only this and RTIC look at the core's registers, and RTIC not at these.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let (mut rcc, crystal) = clock::start(device.RCC, &device.TIM11);
    if !crystal {
        defmt::error!("boot: no crystal of 8, 12, 16 or 25 MHz; the clock is good to 1 % only");
    }
    let mut flash = Flash::new(device.FLASH);
    if flash.set_brown_out_level().is_err() {
        defmt::error!("boot: the brown-out level cannot be set");
    }
    let a = device.GPIOA.split(&mut rcc);
    let b = device.GPIOB.split(&mut rcc);
    let c = device.GPIOC.split(&mut rcc);

    a.pa0.into_alternate::<1>();
    let tick_cycles = rcc.clocks.timclk1().raw() / TICK_HZ;
    let slot_cycles = rcc.clocks.timclk1().raw() / SLOTS_HZ;
    pac::TIM2::enable(&mut rcc);
    pac::TIM2::reset(&mut rcc);
    pac::TIM3::enable(&mut rcc);
    pac::TIM3::reset(&mut rcc);

    let (dma1, dma2) = (StreamsTuple::new(device.DMA1, &mut rcc), StreamsTuple::new(device.DMA2, &mut rcc));
    let gyro_bytes = Reception::start(dma2.2, &device.USART1, &intake.gyro);
    let requests = Reception::start(dma1.5, &device.USART2, &intake.host);
    let reports = ReportPort::new(dma1.6, &device.USART2);
    let line = |baud: u32, dma: DmaConfig| Config::default().baudrate(baud.bps()).dma(dma);
    let gyro = Serial::<_, u8>::new(device.USART1, (a.pa9, a.pa10), line(GYRO_BAUD, DmaConfig::Rx), &mut rcc);
    let host = Serial::<_, u8>::new(device.USART2, (a.pa2, a.pa3), line(HOST_BAUD, DmaConfig::TxRx), &mut rcc);
    let (Ok(gyro), Ok(mut host)) = (gyro, host) else { panic!("a baud rate is out of the clock's reach") };
    host.listen(Event::TransmissionComplete);
    let ((gyro, _), (host, _)) = (gyro.release(), host.release());
    for registers in [&*gyro, &*host] {
        registers.cr3().modify(|_, w| w.eie().enabled());
    }

    let bus = (
        Some(a.pa5.into_alternate::<5>().speed(Speed::High)),
        Some(a.pa6.into_alternate::<5>()),
        Some(a.pa7.into_alternate::<5>().speed(Speed::High)),
    );
    let accelerometer = Ending(Spi::new(device.SPI1, bus, MODE_0, SPI_CLOCK, &mut rcc));
    let bus = (
        Some(b.pb13.into_alternate::<5>().speed(Speed::High)),
        Some(b.pb14.into_alternate::<5>()),
        Some(b.pb15.into_alternate::<5>().speed(Speed::High)),
    );
    let encoder = Ending(Spi::new(device.SPI2, bus, MODE_1, SPI_CLOCK, &mut rcc));
    let bus = (
        Some(c.pc10.into_alternate::<6>().speed(Speed::High)),
        Some(c.pc11.into_alternate::<6>()),
        Some(c.pc12.into_alternate::<6>().speed(Speed::High)),
    );
    let block = Ending(Spi::new(device.SPI3, bus, MODE_3, BLOCK_CLOCK, &mut rcc));
    b.pb6.into_alternate::<2>();
    pac::TIM4::enable(&mut rcc);
    pac::TIM4::reset(&mut rcc);
    let Ok(block) = ExclusiveDevice::new(block, Held(a.pa15.into_push_pull_output_in_state(PinState::High)), Cycles);
    let Ok(accelerometer) =
        ExclusiveDevice::new_no_delay(accelerometer, Held(a.pa4.into_push_pull_output_in_state(PinState::High)));
    let Ok(encoder) =
        ExclusiveDevice::new_no_delay(encoder, Held(b.pb12.into_push_pull_output_in_state(PinState::High)));

    let pins =
        (c.pc0.into_analog(), c.pc1.into_analog(), c.pc2.into_analog(), c.pc3.into_analog(), c.pc4.into_analog());
    let mut converter = Converter::new(device.ADC1, &device.ADC_COMMON, pins, &mut rcc);

    Board {
        ticker: Ticker::new(device.TIM2, tick_cycles, device.TIM4, rcc.clocks.sysclk(), gyro_bytes, requests),
        slots: Slots::new(device.TIM3, slot_cycles),
        gyro: GyroLine(gyro),
        gyro_port: GyroPort,
        host: HostLine(host),
        reports,
        accelerometer,
        encoder,
        block,
        step: Held(c.pc6.into_push_pull_output()),
        direction: c.pc7.into_push_pull_output(),
        enable: ActiveLow(c.pc8.into_push_pull_output_in_state(PinState::High)),
        limit: Limit(c.pc9.into_pull_up_input()),
        flash,
        entropy: converter.entropy(),
        converter,
        crystal: Some(crystal),
    }
}

/// By the port's register, whoever owns the pin: not-enable goes high.
pub fn motor_off() {
    // SAFETY: the register sets bits without reading them, so that nobody else's work on the port is lost.
    unsafe { (*pac::GPIOC::ptr()).bsrr().write(|w| w.bs8().set_bit()) };
}

/// The clock security system: the crystal stopped, and the processor goes on with the internal oscillator.
pub const NOT_MASKABLE: Cause = Cause::Clock;

/// What the reset flags say, where that is a fault; they are cleared.
pub fn reset_cause() -> Option<Cause> {
    // SAFETY: flags of the last reset, which nothing else looks at.
    let status = unsafe { (*pac::RCC::ptr()).csr() };
    let flags = status.read();
    status.modify(|_, w| w.rmvf().set_bit());
    if flags.wdgrstf().bit_is_set() {
        Some(Cause::Watchdog)
    } else if flags.borrstf().bit_is_set() && flags.porrstf().bit_is_clear() {
        Some(Cause::BrownOut)
    } else {
        None
    }
}

/// The independent watchdog, on a clock of its own: once started nothing stops it.
pub struct Watchdog(pac::IWDG);

impl Watchdog {
    pub fn start() -> Self {
        const START: u16 = 0xCCCC;
        const ACCESS: u16 = 0x5555;
        // SAFETY: only this owns the watchdog, and it is made once; nobody else uses the debug unit.
        let pac::Peripherals { IWDG: registers, DBGMCU: debug, .. } = unsafe { pac::Peripherals::steal() };
        // It stands still while a debugger halts the processor.
        debug.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        // SAFETY: keys of the reference manual (RM0090, 21.4.1), here and below.
        registers.kr().write(|w| unsafe { w.bits(START) });
        registers.kr().write(|w| unsafe { w.bits(ACCESS) });
        // 32 kHz by 64.
        registers.pr().write(|w| w.pr().divide_by64());
        registers.rlr().write(|w| w.rl().set(WATCHDOG_S * 500 - 1));
        let mut watchdog = Self(registers);
        watchdog.feed();
        watchdog
    }

    pub fn feed(&mut self) {
        feed_watchdog();
    }
}

/// Whoever owns the watchdog; where it does not run, nothing happens.
fn feed_watchdog() {
    const RELOAD: u16 = 0xAAAA;
    // SAFETY: the key of the reference manual; the register is only written.
    unsafe { (*pac::IWDG::ptr()).kr().write(|w| w.bits(RELOAD)) };
}

/// The chip's own number (RM0090, 39.1).
pub fn serial() -> [u32; 3] {
    const UNIQUE: *const [u32; 3] = 0x1FFF_7A10 as *const [u32; 3];
    // SAFETY: memory that the chip's maker wrote.
    unsafe { UNIQUE.read_volatile() }
}

/// Waits for the next interrupt.
pub fn sleep() {
    cortex_m::asm::wfi();
}

/// Starts anew, as after power-up.
pub fn restart() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// The 2.5 ms timer. Its channel 1 is the gyro's sample pulse, so that no interrupt's delay is in the sampling.
pub struct Ticker {
    timer: pac::TIM2,
    block: pac::TIM4,
    gyro: Reception<Stream2<pac::DMA2>, GYRO_BYTES>,
    host: Reception<Stream5<pac::DMA1>, HOST_BYTES>,
    /// The processor's cycle counter at the tick before; none where it does not count.
    last_cycles: Option<u32>,
    /// Cycles of the processor in a cycle of the timer, and in a tick.
    timer_cycles: u32,
    tick_cycles: u32,
}

impl Ticker {
    /// Set up, and stopped. The block's pulse goes on in step with the ticks: four of them are its period.
    fn new(
        timer: pac::TIM2,
        cycles: u32,
        block: pac::TIM4,
        system: Hertz,
        gyro: Reception<Stream2<pac::DMA2>, GYRO_BYTES>,
        host: Reception<Stream5<pac::DMA1>, HOST_BYTES>,
    ) -> Self {
        let block_cycles = (cycles * (TICK_HZ / BLOCK_HZ) / BLOCK_DIVISOR) as u16;
        block.psc().write(|w| w.psc().set(BLOCK_DIVISOR as u16 - 1));
        block.arr().write(|w| w.arr().set(block_cycles - 1));
        block.ccr1().write(|w| w.ccr().set(block_cycles / 10));
        block.ccmr1_output().write(|w| w.oc1m().pwm_mode1());
        block.ccer().write(|w| w.cc1e().set_bit());
        block.egr().write(|w| w.ug().set_bit());
        timer.arr().write(|w| w.arr().set(cycles - 1));
        timer.ccr1().write(|w| w.ccr().set(cycles / GYRO_PULSE_PART));
        timer.ccmr1_output().write(|w| w.oc1m().pwm_mode1());
        timer.ccer().write(|w| w.cc1e().set_bit());
        timer.dier().write(|w| w.uie().set_bit());
        let timer_cycles = (system.raw() / TICK_HZ).checked_div(cycles).unwrap_or(1);
        Self { timer, block, gyro, host, last_cycles: None, timer_cycles, tick_cycles: cycles * timer_cycles }
    }

    /// Begins, once all else is ready: what comes before the first tick takes no tick. The block's pulse begins with it.
    pub fn start(mut self) -> Self {
        self.block.cr1().write(|w| w.cen().set_bit());
        self.timer.cr1().write(|w| w.cen().set_bit());
        let before = DWT::cycle_count();
        cortex_m::asm::delay(16);
        // An emulator may have no cycle counter.
        self.last_cycles = (DWT::cycle_count() != before).then(|| self.cycles_at_update());
        self
    }

    /// When the tick under way began, by the processor's cycle counter, which goes on while flash is erased.
    fn cycles_at_update(&self) -> u32 {
        DWT::cycle_count().wrapping_sub(self.timer.cnt().read().bits().wrapping_mul(self.timer_cycles))
    }

    /// Takes the timer's interrupt; the gyro has been told to sample by the same timer. What has come on the lines is in the intake
    /// afterwards. Gives how many ticks were lost: their interrupts came together with this one.
    pub fn sync(&mut self) -> u32 {
        self.timer.sr().write(|w| w.uif().clear_bit());
        self.gyro.look();
        self.host.look();
        let Some(last) = self.last_cycles else { return 0 };
        let now = self.cycles_at_update();
        self.last_cycles = Some(now);
        let ticks = now.wrapping_sub(last).wrapping_add(self.tick_cycles / 2).checked_div(self.tick_cycles);
        ticks.unwrap_or(1).saturating_sub(1)
    }
}

/// How much of the tick under way has passed, by the timer itself.
pub fn passed_permille() -> u32 {
    // SAFETY: reading has no effect.
    let timer = unsafe { &*pac::TIM2::ptr() };
    timer.cnt().read().bits() / (timer.arr().read().bits() / 1000).max(1)
}

/// The motor's slots: eight to a tick, the first one half a slot after it.
pub struct Slots(pac::TIM3);

impl Slots {
    fn new(timer: pac::TIM3, cycles: u32) -> Self {
        timer.arr().write(|w| w.arr().set((cycles - 1) as u16));
        timer.dier().write(|w| w.uie().set_bit());
        Self(timer)
    }

    /// Called in every tick in which the motor turns; a timer that runs goes on.
    pub fn start(&mut self) {
        if self.0.cr1().read().cen().bit_is_clear() {
            let half = self.0.arr().read().arr().bits() / 2;
            self.0.cnt().write(|w| w.cnt().set(half));
            self.0.cr1().write(|w| w.cen().set_bit());
        }
    }

    pub fn stop(&mut self) {
        self.0.cr1().write(|w| w.cen().clear_bit());
        self.acknowledge();
    }

    /// Takes the timer's interrupt.
    pub fn acknowledge(&mut self) {
        self.0.sr().write(|w| w.uif().clear_bit());
    }
}

/// An output that holds every level for at least so many processor cycles.
pub struct Held<PIN, const CYCLES: u32>(PIN);

impl<PIN: OutputPin<Error = Infallible>, const CYCLES: u32> ErrorType for Held<PIN, CYCLES> {
    type Error = Infallible;
}

impl<PIN: OutputPin<Error = Infallible>, const CYCLES: u32> OutputPin for Held<PIN, CYCLES> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set_low()?;
        cortex_m::asm::delay(CYCLES);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set_high()?;
        cortex_m::asm::delay(CYCLES);
        Ok(())
    }
}

/// The limit switch, closed to ground within the travel.
pub struct Limit(gpio::PC9<Input>);

impl Limit {
    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        self.0.is_high()
    }
}

/// Waits by counting cycles.
pub struct Cycles;

impl DelayNs for Cycles {
    fn delay_ns(&mut self, ns: u32) {
        cortex_m::asm::delay(ns.div_ceil(1000).saturating_mul(CYCLES_PER_US));
    }
}

/// An output that is high where low is meant.
pub struct ActiveLow<PIN>(PIN);

impl<PIN: OutputPin<Error = Infallible>> ErrorType for ActiveLow<PIN> {
    type Error = Infallible;
}

impl<PIN: OutputPin<Error = Infallible>> OutputPin for ActiveLow<PIN> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set_high()
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set_low()
    }
}
