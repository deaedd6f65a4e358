//! The microcontroller and how it is wired: the pins of `src/board/f405/mod.rs`.

use std::num::{NonZeroU32, NonZeroU64};
use std::sync::Arc;

use hal_sim::{AccelerometerSpi, AnalogueInputs, BlockSpi, EncoderSpi};
use rigless::chip::uart::Rate;
use rigless::cpu;
use rigless::device::Level;
use rigless::emulator::{Access, AccessKind, Processor};
use rigless::machine::{Board, Crystal, Target, armv7m};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::Error;
use rigless::soc::Width;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::{flash, rcc, tim11};
use rigless::soc::stm32f427::peripherals::adc;
use rigless::soc::stm32f427::peripherals::gpio::{Gpio, Pin};
use rigless::soc::stm32f427::peripherals::rcc::Apb;
use rigless::soc::stm32f427::peripherals::spi::Select;
use rigless::soc::stm32f427::peripherals::tim::Channel;
use rigless::time::VirtualNanos;

use crate::core::Core;
use crate::devices::{GyroOutput, HostLine, Slave};
use crate::flash::SharedArray;
use crate::parts::{Adis16505, Adxl355, As5048a};

const NAME: &str = "stm32f405";
const SYSTEM_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).expect("a clock");
const SUPPLY_MV: u32 = 3300;
/// Ports, buses and lines by their place in the emulator's lists.
const PORT_A: usize = 0;
const PORT_B: usize = 1;
const PORT_C: usize = 2;
const TIM2: usize = 0;
const TIM4: usize = 2;
const SPI1: usize = 0;
const SPI2: usize = 1;
const SPI3: usize = 2;
const ADC1: usize = 0;
const USART1: usize = 0;
const USART2: usize = 1;
/// TIM2's control register, and the bit by which the counter runs (RM0090, 18.4.1).
const TIM2_CR1: u64 = 0x4000_0000;
const COUNTER_RUNS: u64 = 1;
/// TIM2's interrupts, and the one at the end of a period (RM0090, 18.4.4).
const TIM2_DIER: u64 = 0x4000_000C;
const AT_UPDATE: u64 = 1;
/// The registers of port C.
const PORT_C_REGISTERS: std::ops::Range<u64> = 0x4002_0800..0x4002_0C00;

/// The registers of timer 11, which the emulator stores and does not act on, and the one that is read at a capture.
pub const TIMER_11: std::ops::Range<u64> = 0x4001_4800..0x4001_4C00;
const TIM11_CR1: u64 = 0x4001_4800;
const TIM11_CCR1: u64 = 0x4001_4834;
/// Its input from the crystal, which it captures at every eighth edge (RM0090, 19.5.11, 19.4.5).
const FROM_CRYSTAL: u64 = 0b10;
const EVERY_EIGHTH: u64 = 0b1101;
const CAPTURED: u64 = 1 << 1;
/// Of the debug unit: what stands still while a debugger halts the core, the independent watchdog among it (RM0090, 38.16.4).
const DEBUG_FREEZE: u64 = 0xE004_2008;
const WATCHDOG_FROZEN: u64 = 1 << 12;

/// Whether what is written there starts the 2.5 ms timer.
pub fn starts_timer(address: u64, value: u64) -> bool {
    address == TIM2_CR1 && value & COUNTER_RUNS != 0
}

/// Whether what is written there may change the motor's pins.
pub fn is_of_motor_port(address: u64) -> bool {
    PORT_C_REGISTERS.contains(&address)
}

/// What the motor's driver gets; by default what its resistors make of pins that float.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorPins {
    pub step: Level,
    pub direction: Level,
    pub not_enable: Level,
}

impl Default for MotorPins {
    fn default() -> Self {
        Self { step: Level::Low, direction: Level::Low, not_enable: Level::High }
    }
}

/// The board.
#[derive(Debug)]
pub struct Wired {
    mcu: Stm32f427,
    crystal_hz: u64,
    measured: Measured,
    array: SharedArray,
}

/// Timer 11 at the crystal: when it was started, and the edges that were captured and read.
#[derive(Debug, Default)]
struct Measured {
    started_ns: u64,
    read: u64,
}

impl Wired {
    pub fn new(crystal_hz: u64, damaged_per_million: u32, array: SharedArray) -> Result<Self, Error> {
        let mut mcu = Stm32f427::new()?;
        mcu.rcc.attach_crystals(crystal_hz, Crystal::NONE.0);
        mcu.set_supply(SUPPLY_MV);
        let errors = mcu.usart[USART1].errors_mut();
        errors.noise = Rate { name: "noise", per_million: damaged_per_million };
        errors.framing = Rate { name: "framing", per_million: damaged_per_million };
        Ok(Self { mcu, crystal_hz, measured: Measured::default(), array })
    }

    /// The emulator's oscillator gets ready without a crystal, too: where there is none, its flag is taken back as soon as it rises.
    pub fn hold_absent_crystal(&mut self) {
        if self.crystal_hz == 0 {
            let (_, registers) = self.mcu.clocks();
            let control = registers.get(rcc::Register::Cr);
            registers.set(rcc::Register::Cr, rcc::cr::HSERDY.set(control, 0));
        }
    }

    /// Timer 11 captures the crystal's edges: what the emulator lacks.
    pub fn measure_crystal(&mut self, access: &Access) {
        let at_ns = access.virtual_time.0;
        match (access.kind, access.address) {
            (AccessKind::Write, TIM11_CR1) => self.measured = Measured { started_ns: at_ns, read: 0 },
            (AccessKind::Read, TIM11_CCR1) => self.measured.read = self.edges(at_ns).0,
            _ => {}
        }
        let (edges, cycles) = self.edges(at_ns);
        let slot = self.mcu.bus().slot_of("TIM11").expect("a timer of the part");
        let registers = self.mcu.bus_mut().slot_mut(slot).registers_mut();
        registers.set(tim11::Register::Sr, if edges > self.measured.read { CAPTURED } else { 0 });
        registers.set(tim11::Register::Ccr1, cycles & 0xFFFF);
    }

    /// How many edges have been captured since the timer was started, and its cycles at the last of them.
    fn edges(&mut self, at_ns: u64) -> (u64, u64) {
        let (clocks, registers) = self.mcu.clocks();
        let timer_hz = clocks.timer_clock(registers, Apb::Two);
        let divider = rcc::cfgr::RTCPRE.get(registers.get(rcc::Register::Cfgr));
        let slot = self.mcu.bus().slot_of("TIM11").expect("a timer of the part");
        let registers = self.mcu.bus_mut().slot_mut(slot).registers_mut();
        let set_up = registers.get(tim11::Register::Or) == FROM_CRYSTAL
            && registers.get(tim11::Register::Ccmr1Input) == EVERY_EIGHTH
            && registers.get(tim11::Register::Cr1) == 1
            && registers.get(tim11::Register::Ccer) == 1;
        if !set_up || divider < 2 || self.crystal_hz == 0 {
            return (0, 0);
        }
        let edges = (at_ns - self.measured.started_ns) * self.crystal_hz / (8 * divider * 1_000_000_000);
        (edges, edges * 8 * divider * timer_hz / self.crystal_hz)
    }

    /// What is at the analogue inputs from now on: PC0 to PC4 are channels 10 to 14.
    pub fn put_on_inputs(&mut self, inputs: &AnalogueInputs) {
        let converter = &mut self.mcu.adc[ADC1];
        for pin in 0..5 {
            let channel = adc::Channel::new(10 + pin).expect("a channel of the pins");
            converter.set_input(channel, inputs.millivolts(pin.into()));
        }
        converter.set_temperature(inputs.chip_centi_c());
    }

    /// The limit switch at PC9, open or closed to ground, from now on.
    pub fn put_on_limit(&mut self, at: VirtualNanos, open: bool) {
        let level = (!open).then_some(Level::Low);
        self.mcu.drive_port(at, PORT_C, |port, registers, context| port.drive(pin(9), level, registers, context));
    }

    /// The microcontroller, for who looks at its registers.
    pub fn mcu_mut(&mut self) -> &mut Stm32f427 {
        &mut self.mcu
    }

    /// Whether the watchdog stands still while a debugger halts the core.
    pub fn watchdog_is_frozen_in_debug(&mut self, at: VirtualNanos) -> bool {
        self.mcu.peek(at, DEBUG_FREEZE, Width::W32).is_ok_and(|frozen| frozen & WATCHDOG_FROZEN != 0)
    }

    pub fn attach(
        &mut self,
        accelerometer: Slave<AccelerometerSpi, Adxl355>,
        encoder: Slave<EncoderSpi, As5048a>,
        block: Slave<BlockSpi, Adis16505>,
        gyro: GyroOutput,
    ) {
        let [on_bus_1, on_bus_2, on_bus_3] = [("GPIOA", 4), ("GPIOB", 12), ("GPIOA", 15)].map(selected_by);
        self.mcu.spi[SPI1].attach_selected(accelerometer, on_bus_1);
        self.mcu.spi[SPI2].attach_selected(encoder, on_bus_2);
        self.mcu.spi[SPI3].attach_selected(block, on_bus_3);
        self.mcu.usart[USART1].attach(gyro);
        self.mcu.usart[USART2].attach(HostLine::default());
    }

    /// What the motor's driver gets.
    pub fn motor_pins(&mut self) -> MotorPins {
        let [step, direction, not_enable] = [6, 7, 8].map(|number| self.level(PORT_C, number));
        MotorPins { step, direction, not_enable }
    }

    /// Periods of the pulses that tell gyro (PA0) and block (PB6) to sample, ns; nothing where no timer drives the pin.
    pub fn pulse_periods_ns(&mut self) -> [Option<u64>; 2] {
        [(PORT_A, 0, TIM2, 1), (PORT_B, 6, TIM4, 2)].map(|(port, number, timer, function)| {
            let driven = Gpio::function(pin(number), self.mcu.port(port).1) == Some(function);
            let (timer, registers) = self.mcu.timer(timer);
            let pulse = timer.pulse(Channel::new(1)?, registers).filter(|_| driven)?;
            Some(pulse.period.0)
        })
    }

    /// The option bytes' brown-out level.
    pub fn brown_out_level(&mut self) -> u8 {
        let (_, registers) = self.mcu.program();
        let levels = [3, 2, 1, 0];
        levels[flash::optcr::BOR_LEV.get(registers.get(flash::Register::Optcr)) as usize]
    }

    /// Whether the 2.5 ms timer interrupts.
    pub fn let_timer_interrupt(&mut self, at: VirtualNanos, interrupts: bool) {
        let enabled = if interrupts { AT_UPDATE } else { 0 };
        self.mcu.write(at, TIM2_DIER, Width::W32, enabled).expect("a register of a clocked timer");
    }

    /// The 2.5 ms timer counts no more.
    pub fn stop_timer(&mut self, at: VirtualNanos) {
        self.mcu.write(at, TIM2_CR1, Width::W32, 0).expect("a register of a clocked timer");
    }

    /// The host's end of its line.
    pub fn host_line(&mut self) -> Option<&mut HostLine> {
        self.mcu.usart[USART2].chip_mut()
    }

    fn level(&mut self, port: usize, number: u8) -> Level {
        let (port, registers) = self.mcu.port(port);
        port.level(pin(number), registers)
    }
}

fn pin(number: u8) -> Pin {
    Pin::new(number).expect("a port has sixteen pins")
}

fn selected_by((port, number): (&'static str, u8)) -> Select {
    Select { port, pin: pin(number), active: Level::Low }
}

impl Store for Wired {}

impl Board for Wired {
    fn name(&self) -> &'static str {
        NAME
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![NAME]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.mcu)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let lines = Operate::cpu(&self.mcu).interrupt_lines;
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: SYSTEM_HZ,
            interrupt_lines: NonZeroU32::new(lines.into()).expect("interrupts"),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).expect("a divider"),
            instructions_per_second: SYSTEM_HZ,
            boot: "flash",
        };
        let windows = cpu::armv7m::windows(Mcu::bus(&self.mcu));
        let mut core = core.spec_with_parts(&windows, armv7m::Fpu::FpV4Sp, armv7m::MpuRegions::Eight);
        let (make, array) = (core.processor.clone(), self.array.clone());
        core.processor = Arc::new(move |order| {
            make(order).map(|processor| -> Box<dyn Processor> { Box::new(Core::new(processor, array.clone())) })
        });
        vec![Target::new(NAME, &mut self.mcu, core)]
    }
}
