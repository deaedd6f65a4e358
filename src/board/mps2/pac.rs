//! Registers and interrupts of QEMU's mps2-an386 that the firmware uses. The interrupts have the names that they have on
//! the STM32, so that the app binds its tasks to the same names on both boards.
//!
//! Source: Arm, "Cortex-M System Design Kit", r1p1 (UART and timer), and Application Note 386 (addresses, interrupts).

use cortex_m::interrupt::InterruptNumber;

pub const NVIC_PRIO_BITS: u8 = 3;

#[derive(Clone, Copy)]
#[repr(u16)]
pub enum Interrupt {
    /// UART0 receives: requests from the host. And a report is out.
    USART2 = 0,
    /// UART1 receives: the gyro.
    USART1 = 2,
    /// TIMER0.
    TIM2 = 8,
    /// TIMER1.
    TIM3 = 9,
    // Numbers without a peripheral, for RTIC's software tasks.
    UART4 = 24,
    UART5 = 25,
    /// For the task that reads the sensors, and the one that steps the instrument.
    SPI1 = 26,
    SPI2 = 27,
}

pub use Interrupt as interrupt;

// SAFETY: every number is an interrupt of the machine, and none occurs twice.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// RTIC wants one; the board takes its peripherals by name.
pub struct Peripherals;

impl Peripherals {
    /// # Safety
    ///
    /// None needed: there is nothing in it.
    pub unsafe fn steal() -> Self {
        Self
    }
}

unsafe extern "C" {
    fn USART1();
    fn USART2();
    fn TIM2();
    fn TIM3();
    fn UART4();
    fn UART5();
    fn SPI1();
    fn SPI2();
}

type Handler = Option<unsafe extern "C" fn()>;

#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
pub static __INTERRUPTS: [Handler; 28] = {
    let mut table: [Handler; 28] = [None; 28];
    table[Interrupt::USART2 as usize] = Some(USART2);
    table[Interrupt::USART1 as usize] = Some(USART1);
    table[Interrupt::TIM2 as usize] = Some(TIM2);
    table[Interrupt::TIM3 as usize] = Some(TIM3);
    table[Interrupt::UART4 as usize] = Some(UART4);
    table[Interrupt::UART5 as usize] = Some(UART5);
    table[Interrupt::SPI1 as usize] = Some(SPI1);
    table[Interrupt::SPI2 as usize] = Some(SPI2);
    table
};

/// A register, by its address.
#[derive(Clone, Copy)]
struct Register(usize);

impl Register {
    fn read(self) -> u32 {
        // SAFETY: only this module makes registers, all at addresses of the machine's peripherals.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    fn write(self, value: u32) {
        // SAFETY: as for reading; none of these registers lets a peripheral access memory.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}

/// A timer that counts down at 25 MHz.
#[derive(Clone, Copy)]
pub struct Timer(usize);

pub const TIMER0: Timer = Timer(0x4000_0000);
pub const TIMER1: Timer = Timer(0x4000_1000);

impl Timer {
    const ENABLE: u32 = 0b0001;
    const ENABLE_AND_INTERRUPT: u32 = 0b1001;

    /// Interrupts after `first` cycles and then every `period` cycles.
    pub fn start(self, first: u32, period: u32) {
        self.stop();
        Register(self.0 + 0x8).write(period - 1);
        Register(self.0 + 0x4).write(first);
        Register(self.0).write(Self::ENABLE_AND_INTERRUPT);
    }

    /// Counts without interrupts; see [`Self::remaining`].
    pub fn run_freely(self) {
        Register(self.0 + 0x8).write(u32::MAX);
        Register(self.0).write(Self::ENABLE);
    }

    pub fn stop(self) {
        Register(self.0).write(0);
        self.acknowledge();
    }

    pub fn acknowledge(self) {
        Register(self.0 + 0xC).write(1);
    }

    /// Cycles until it begins anew.
    pub fn remaining(self) -> u32 {
        Register(self.0 + 0x4).read()
    }
}

/// The watchdog, which counts down at 25 MHz: first its interrupt, which cannot be masked, then a reset.
#[derive(Clone, Copy)]
pub struct Watchdog(usize);

pub const WATCHDOG: Watchdog = Watchdog(0x4000_8000);

impl Watchdog {
    /// Counts from here, anew.
    pub fn start(self, cycles: u32) {
        const KEY: u32 = 0x1ACC_E551;
        const INTERRUPT_AND_RESET: u32 = 0b11;
        Register(self.0 + 0xC00).write(KEY);
        Register(self.0).write(cycles);
        Register(self.0 + 0x8).write(INTERRUPT_AND_RESET);
    }
}

/// A UART; QEMU does not care for its rate.
#[derive(Clone, Copy)]
pub struct Uart(usize);

pub const UART0: Uart = Uart(0x4000_4000);
pub const UART1: Uart = Uart(0x4000_5000);

impl Uart {
    /// Transmitter, receiver and the receiver's interrupt on.
    pub fn start(self) {
        const LOWEST_DIVIDER: u32 = 16;
        Register(self.0 + 0x10).write(LOWEST_DIVIDER);
        Register(self.0 + 0x8).write(0b1011);
    }

    /// The byte that was received, and clears the interrupt.
    pub fn read(self) -> Option<u8> {
        const RECEIVED: u32 = 0b10;
        Register(self.0 + 0xC).write(RECEIVED);
        (Register(self.0 + 0x4).read() & RECEIVED != 0).then(|| Register(self.0).read() as u8)
    }

    /// Waits for room and sends.
    pub fn write(self, byte: u8) {
        const FULL: u32 = 0b01;
        while Register(self.0 + 0x4).read() & FULL != 0 {}
        Register(self.0).write(byte.into());
    }
}
