//! Handles that firmware drivers take: embedded-hal, embedded-io and embedded-storage over the plant.

use crate::flash::{CAPACITY, FlashError, SECTOR, WORD};
use crate::plant::{Shared, SpiPart, open};
use embedded_hal::digital::{self, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use embedded_storage::nor_flash::{self, NorFlash, ReadNorFlash};
use std::convert::Infallible;

/// Runs a list of operations as one exchange of bytes in both directions, as a bus with one select line does.
fn transact(operations: &mut [Operation<'_, u8>], exchange: impl FnOnce(&[u8]) -> Vec<u8>) {
    let mut mosi = Vec::new();
    for operation in operations.iter() {
        match operation {
            Operation::Write(bytes) | Operation::Transfer(_, bytes) => mosi.extend_from_slice(bytes),
            Operation::TransferInPlace(bytes) => mosi.extend_from_slice(bytes),
            Operation::Read(_) | Operation::DelayNs(_) => {}
        }
        mosi.resize(mosi.len() + clocked_beyond_written(operation), 0);
    }
    let miso = exchange(&mosi);
    let mut rest = miso.as_slice();
    for operation in operations {
        let clocked = clocked(operation);
        let (now, later) = rest.split_at(clocked);
        rest = later;
        match operation {
            Operation::Read(bytes) | Operation::TransferInPlace(bytes) => bytes.copy_from_slice(now),
            Operation::Transfer(bytes, _) => {
                let length = bytes.len();
                bytes.copy_from_slice(&now[..length]);
            }
            Operation::Write(_) | Operation::DelayNs(_) => {}
        }
    }
}

/// Bytes that an operation clocks over the bus.
fn clocked(operation: &Operation<'_, u8>) -> usize {
    match operation {
        Operation::Read(bytes) => bytes.len(),
        Operation::TransferInPlace(bytes) => bytes.len(),
        Operation::Write(bytes) => bytes.len(),
        Operation::Transfer(read, write) => read.len().max(write.len()),
        Operation::DelayNs(_) => 0,
    }
}

/// Bytes that an operation clocks after it has nothing more to write.
fn clocked_beyond_written(operation: &Operation<'_, u8>) -> usize {
    match operation {
        Operation::Read(bytes) => bytes.len(),
        Operation::Transfer(read, write) => read.len().saturating_sub(write.len()),
        Operation::TransferInPlace(_) | Operation::Write(_) | Operation::DelayNs(_) => 0,
    }
}

macro_rules! spi_handle {
    ($(#[$meta:meta])* $name:ident, $device:ident) => {
        $(#[$meta])*
        #[derive(Debug, Clone)]
        pub struct $name(Shared);

        impl $name {
            pub(crate) fn new(plant: Shared) -> Self {
                Self(plant)
            }

            /// One transaction as bytes: what the controller sends, and what it gets back, as many.
            pub fn exchange(&mut self, mosi: &[u8]) -> Vec<u8> {
                open(&self.0).exchange(SpiPart::$device, mosi)
            }

            /// What comes back with the last of these bytes, in a transaction that is under way. It is ended by
            /// [`Self::exchange`] with all of them; until then the device is as it was.
            pub fn answer(&mut self, mosi: &[u8]) -> u8 {
                open(&self.0).answer(SpiPart::$device, mosi)
            }
        }

        impl spi::ErrorType for $name {
            type Error = Infallible;
        }

        impl SpiDevice<u8> for $name {
            fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
                transact(operations, |mosi| self.exchange(mosi));
                Ok(())
            }
        }
    };
}

spi_handle! {
    /// The ADXL355 behind its select line. A broken bus gives bytes, not errors, as on a real one.
    AccelerometerSpi, Accelerometer
}
spi_handle! {
    /// The ADIS16505 behind its select line, where the scenario has a block: bytes of ones otherwise.
    BlockSpi, Block
}
spi_handle! {
    /// The AS5048A behind its select line. Each transaction is one 16-bit frame.
    EncoderSpi, Encoder
}

/// Which input of the motor driver a pin goes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PinFunction {
    Step,
    Direction,
    Enable,
}

/// An output of the microcontroller that goes to the motor driver.
#[derive(Debug, Clone)]
pub struct Pin {
    plant: Shared,
    function: PinFunction,
}

impl Pin {
    pub(crate) fn new(plant: Shared, function: PinFunction) -> Self {
        Self { plant, function }
    }

    fn set(&mut self, high: bool) {
        let plant = &mut *open(&self.plant);
        let t_s = plant.t_s();
        match self.function {
            PinFunction::Step => plant.drive.set_step(high, t_s),
            PinFunction::Direction => plant.drive.set_direction(high),
            PinFunction::Enable => plant.drive.set_enable(high),
        }
    }
}

impl digital::ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

/// The analogue inputs of the microcontroller: four pins, the supply behind its divider, the chip's thermometer, its reference.
#[derive(Debug, Clone)]
pub struct AnalogueInputs(Shared);

impl AnalogueInputs {
    pub(crate) fn new(plant: Shared) -> Self {
        Self(plant)
    }

    /// What the converter makes of an input, 0 to 6.
    pub fn code(&self, input: usize) -> u16 {
        let plant = open(&self.0);
        plant.carried().code(plant.analogue(), input)
    }

    /// Voltage at a pin, 0 to 4, mV: for a converter of one's own.
    pub fn millivolts(&self, pin: usize) -> u32 {
        let plant = open(&self.0);
        plant.carried().millivolts(plant.analogue(), pin)
    }

    /// Temperature of the chip, hundredths of a degree Celsius.
    pub fn chip_centi_c(&self) -> i32 {
        open(&self.0).carried().chip_centi_c()
    }
}

/// The instrument's end of the gyro's line.
#[derive(Debug, Clone)]
pub struct GyroLine(Shared);

impl GyroLine {
    pub(crate) fn new(plant: Shared) -> Self {
        Self(plant)
    }

    /// Sends a byte to the gyro, whose console takes lines of text where it has one.
    pub fn send(&mut self, byte: u8) {
        open(&self.0).tell_gyro(byte);
    }
}

impl embedded_io::ErrorType for GyroLine {
    type Error = Infallible;
}

impl embedded_io::Read for GyroLine {
    /// The bytes that have arrived by now. World time does not pass in here, so that it does not wait: 0 means that
    /// nothing is there yet.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let plant = &mut *open(&self.0);
        let mut count = 0;
        for slot in buffer {
            let Some(byte) = plant.receive() else { break };
            *slot = byte;
            count += 1;
        }
        Ok(count)
    }
}

impl embedded_io::ReadReady for GyroLine {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(open(&self.0).has_received())
    }
}

/// The flash memory.
#[derive(Debug, Clone)]
pub struct Flash(Shared);

impl Flash {
    pub(crate) fn new(plant: Shared) -> Self {
        Self(plant)
    }

    /// Power fails after that many more bytes are written ([`crate::flash::ERASE_COST`] for an erased sector).
    pub fn cut_power_after(&mut self, bytes: usize) {
        open(&self.0).flash.cut_power_after(bytes);
    }

    /// Power is back and stays.
    pub fn restore_power(&mut self) {
        open(&self.0).flash.restore_power();
    }
}

impl nor_flash::ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        open(&self.0).flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        open(&self.0).flash.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        open(&self.0).flash.write(offset, bytes)
    }
}
