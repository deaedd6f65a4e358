//! The microcontroller and how it is wired: the pins of `src/board/f405.rs`.

use std::num::{NonZeroU32, NonZeroU64};

use hal_sim::{AccelerometerSpi, BlockSpi, EncoderSpi};
use rigless::chip::uart::Rate;
use rigless::cpu;
use rigless::device::Level;
use rigless::machine::{Board, Crystal, Target, armv7m};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::Error;
use rigless::soc::Width;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::{flash, rcc};
use rigless::soc::stm32f427::peripherals::gpio::{Gpio, Pin};
use rigless::soc::stm32f427::peripherals::spi::Select;
use rigless::soc::stm32f427::peripherals::tim::Channel;
use rigless::time::VirtualNanos;

use crate::devices::{GyroOutput, HostLine, Slave};

const NAME: &str = "stm32f405";
const SYSTEM_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).expect("a clock");
const CRYSTAL_HZ: u64 = 8_000_000;
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
    crystal: bool,
}

impl Wired {
    pub fn new(crystal: bool, damaged_per_million: u32) -> Result<Self, Error> {
        let mut mcu = Stm32f427::new()?;
        mcu.rcc.attach_crystals(CRYSTAL_HZ, Crystal::NONE.0);
        mcu.set_supply(SUPPLY_MV);
        let errors = mcu.usart[USART1].errors_mut();
        errors.noise = Rate { name: "noise", per_million: damaged_per_million };
        errors.framing = Rate { name: "framing", per_million: damaged_per_million };
        Ok(Self { mcu, crystal })
    }

    /// The emulator's oscillator gets ready without a crystal, too: where there is none, its flag is taken back as soon as it rises.
    pub fn hold_absent_crystal(&mut self) {
        if !self.crystal {
            let (_, registers) = self.mcu.clocks();
            let control = registers.get(rcc::Register::Cr);
            registers.set(rcc::Register::Cr, rcc::cr::HSERDY.set(control, 0));
        }
    }

    pub fn attach(
        &mut self,
        accelerometer: Slave<AccelerometerSpi>,
        encoder: Slave<EncoderSpi>,
        block: Slave<BlockSpi>,
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
        let core = core.spec_with_parts(&windows, armv7m::Fpu::FpV4Sp, armv7m::MpuRegions::Eight);
        vec![Target::new(NAME, &mut self.mcu, core)]
    }
}
