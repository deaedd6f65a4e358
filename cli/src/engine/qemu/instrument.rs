//! What is around the microcontroller: the simulated devices, answering its requests.

use embedded_hal::digital::OutputPin;
use embedded_io::Read as _;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use hal_sim::flash::FlashError;
use hal_sim::{AccelerometerSpi, AnalogueInputs, BlockSpi, EncoderSpi, Flash, GyroLine, Pin, World};
use north_finder::drivers::step_motor::SLOTS_PER_TICK;

use super::wire::{Ask, Edge};

pub struct Instrument {
    world: World,
    gyro: GyroLine,
    inputs: AnalogueInputs,
    accelerometer: AccelerometerSpi,
    encoder: EncoderSpi,
    block: BlockSpi,
    pins: [Pin; 3],
    flash: Flash,
}

impl Instrument {
    pub fn new(world: &World) -> Self {
        Self {
            gyro: world.gyro(),
            inputs: world.analogue(),
            accelerometer: world.accelerometer(),
            encoder: world.encoder(),
            block: world.block(),
            pins: [world.step_pin(), world.dir_pin(), world.enable_pin()],
            flash: world.flash(),
            world: world.clone(),
        }
    }

    /// Lets the world go on by a tick, the motor's pins as the firmware set them; gives what the gyro sent.
    pub fn tick(&mut self, edges: &[u8]) -> Vec<u8> {
        for slot in 0..SLOTS_PER_TICK {
            for edge in edges.iter().copied().map(Edge::from).filter(|edge| edge.slot == slot) {
                if let Some(pin) = self.pins.get_mut(edge.pin) {
                    let Ok(()) = pin.set_state(edge.level.into());
                }
            }
            self.world.advance_slot();
        }
        self.world.sample();
        let mut gyro = Vec::new();
        let mut bytes = [0; 256];
        while let Ok(count @ 1..) = self.gyro.read(&mut bytes) {
            gyro.extend(bytes.iter().take(count));
        }
        gyro
    }

    /// What the converter makes of an input as it is now.
    pub fn convert(&self, input: u8) -> u16 {
        self.inputs.code(input.into())
    }

    /// Whether the index's limit switch is open.
    pub fn limit_is_open(&self) -> bool {
        self.world.limit_is_open()
    }

    /// The gyro hears a byte.
    pub fn tell_gyro(&mut self, byte: u8) {
        self.gyro.send(byte);
    }

    /// Answers for one of the devices.
    pub fn device(&mut self, ask: Ask<'_>) -> Vec<u8> {
        match ask {
            Ask::Spi { device: 0, mosi } => self.accelerometer.exchange(mosi),
            Ask::Spi { device: 1, mosi } => self.encoder.exchange(mosi),
            Ask::Spi { mosi, .. } => self.block.exchange(mosi),
            Ask::ReadFlash { offset, length } => {
                let mut bytes = vec![0xFF; length.into()];
                // Beyond the end it reads as erased.
                let _ = self.flash.read(offset, &mut bytes);
                bytes
            }
            Ask::WriteFlash { offset, bytes } => flash_reply(self.flash.write(offset, bytes)),
            Ask::EraseFlash { from, to } => flash_reply(self.flash.erase(from, to)),
            Ask::Tick { .. }
            | Ask::Gyro { .. }
            | Ask::Uart { .. }
            | Ask::Log { .. }
            | Ask::Panic { .. }
            | Ask::End { .. } => Vec::new(),
        }
    }
}

fn flash_reply(result: Result<(), FlashError>) -> Vec<u8> {
    vec![result.map_or_else(FlashError::code, |()| 0)]
}
