//! A witness at the wires: at every transfer it reads the controllers' registers and the clock, and holds them against what the data sheets
//! of the parts at the other end allow. The emulator itself carries a word whatever the mode, the clock or the baud rate.

mod lines;
mod motor;
mod pulses;
mod spi;
mod watchdog;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use rigless::emulator::Access;
use rigless::mcu::Operate as _;
use rigless::soc::Width;
use rigless::soc::stm32f427::Stm32f427;
use rigless::time::VirtualNanos;

use crate::microcontroller::MotorPins;

/// What was found wrong. The first finding ends the run.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    violations: Arc<Mutex<Vec<String>>>,
    over: Arc<AtomicBool>,
}

impl Ledger {
    pub fn violation(&self, what: impl Into<String>) {
        self.violations.lock().expect("one thread").push(what.into());
        self.over.store(true, Ordering::Relaxed);
    }

    pub fn violations(&self) -> Vec<String> {
        self.violations.lock().expect("one thread").clone()
    }

    /// What ends the run: it is set by the first violation, or when power is off.
    pub fn over(&self) -> &Arc<AtomicBool> {
        &self.over
    }

    /// What must be at least so long, ns.
    fn least(&self, what: &str, ns: u64, least_ns: u64) {
        if ns < least_ns {
            self.violation(format!("{what}: {ns} ns, at least {least_ns}"));
        }
    }

    fn must(&self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.violation(what());
        }
    }
}

/// The chip at an instant: what its registers hold.
struct Chip<'a> {
    mcu: &'a mut Stm32f427,
    at: VirtualNanos,
}

impl Chip<'_> {
    fn register(&mut self, address: u64) -> u64 {
        self.mcu.peek(self.at, address, Width::W32).unwrap_or(0)
    }

    /// The clocks of the buses APB1 and APB2, Hz.
    fn bus_hz(&mut self) -> [u64; 2] {
        let (clocks, registers) = self.mcu.clocks();
        [clocks.pclk1(registers), clocks.pclk2(registers)]
    }

    /// A pin's mode: 0 input, 1 output, 2 alternate function, 3 analogue; and its alternate function.
    fn pin(&mut self, (port, number): Pin) -> (u64, u64) {
        let base = port_base(port);
        let mode = self.register(base) >> (2 * number) & 0b11;
        let functions = self.register(base + if number < 8 { 0x20 } else { 0x24 });
        (mode, functions >> (4 * (number % 8)) & 0xF)
    }
}

/// A port by its letter, and a pin's number.
type Pin = (char, u8);

fn port_base(port: char) -> u64 {
    0x4002_0000 + 0x400 * (port as u64 - 'A' as u64)
}

/// All of it.
#[derive(Debug)]
pub struct Witness {
    ledger: Ledger,
    buses: [spi::Bus; 3],
    motor: motor::Motor,
    watchdog: watchdog::Watchdog,
}

impl Witness {
    pub fn new(ledger: Ledger) -> Self {
        let (buses, motor, watchdog) = (spi::BUSES.map(spi::Bus::new), motor::Motor::default(), Default::default());
        Self { ledger, buses, motor, watchdog }
    }

    /// The chip was reset: its pins float.
    pub fn reset(&mut self) {
        *self = Self::new(self.ledger.clone());
    }

    /// The core has written to a register.
    pub fn access(&mut self, mcu: &mut Stm32f427, access: &Access) {
        self.watchdog.written(access, &self.ledger);
        let mut chip = Chip { mcu, at: access.virtual_time };
        self.buses.iter_mut().for_each(|bus| bus.written(&mut chip, access.address, &self.ledger));
    }

    /// The core has read this from a register.
    pub fn read(&mut self, address: u64, value: u64) {
        self.buses.iter_mut().for_each(|bus| bus.read(address, value));
    }

    /// What the motor's driver gets now.
    pub fn motor(&mut self, levels: MotorPins, at: VirtualNanos) {
        self.motor.sees(levels, at.0, &self.ledger);
    }

    /// In every slot of the motor: what is transferred without the core.
    pub fn look(&mut self, mcu: &mut Stm32f427, at: VirtualNanos) {
        let mut chip = Chip { mcu, at };
        lines::look(&mut chip, &self.ledger);
        pulses::look(&mut chip, &self.ledger);
        motor::look(&mut chip, &self.ledger);
    }
}
