//! The north finder, simulated: the firmware's drivers and its [`Instrument`](north_finder::instrument::Instrument) around the simulated devices, in one process.
//!
//! The host command runs it natively, the page in a browser; both do the same things in the same order, bit for bit.

mod request_line;
mod settings;
mod stepper;

pub use request_line::RequestLine;
pub use settings::{declare_noise, default_settings, lay_over, settings};
pub use stepper::Stepper;

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, BlockSpi, EncoderSpi, GyroLine, Pin, World};
use north_finder::drivers::sensors::Sensors;
use north_finder::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use north_finder::event::Report;
use north_finder::index::MotorCommand;
use north_finder::instrument::Readings;
use north_finder::intake::Intake;

/// Sees what enters the instrument at every tick: readings and gyro bytes.
pub type Tap<'a> = dyn FnMut(&Readings, &[u8]) + 'a;

/// The instrument and its devices, wired as on the board.
pub struct Wired {
    world: World,
    gyro: GyroLine,
    /// What the gyro sent in this tick.
    heard: Vec<u8>,
    sensors: Sensors<AccelerometerSpi, EncoderSpi, BlockSpi>,
    motor: StepMotor<Pin, Pin, Pin>,
    stepper: Stepper,
    intake: Box<Intake>,
    /// Decided by the last solve, carried out at the next tick.
    pending: Option<MotorCommand>,
    tick: u64,
}

impl Wired {
    /// The instrument of a world, with what its flash holds.
    pub fn power_up(world: &World) -> Self {
        let stepper = Stepper::power_up(&mut world.flash());
        let instrument = &stepper.instrument;
        let index = instrument.index_settings();
        Self {
            gyro: world.gyro(),
            heard: Vec::new(),
            sensors: Sensors::new(
                world.accelerometer(),
                world.encoder(),
                instrument.has_block().then(|| world.block()),
            ),
            motor: StepMotor::new(world.step_pin(), world.dir_pin(), world.enable_pin(), &index),
            stepper,
            intake: Box::new(Intake::new()),
            pending: None,
            tick: 0,
            world: world.clone(),
        }
    }

    /// 2.5 ms, everything in the order in which the board does it. `requests`: what the host's line brings in it.
    pub fn tick(&mut self, requests: &[u8], tap: &mut Tap<'_>, report: &mut dyn FnMut(Report)) {
        for _ in 0..SLOTS_PER_TICK {
            self.motor.slot();
            self.world.advance_slot();
        }
        self.world.sample();
        self.hear_gyro();
        let sensors = self.sensors.read(self.tick);
        if let Some(command) = self.pending.take() {
            self.motor.command(command);
        }
        self.intake.gyro.put(&self.heard);
        self.intake.host.put(requests);
        let (turning, heard) = (self.motor.is_turning(), self.intake.heard());
        let readings = Readings { tick: self.tick, sensors, turning, heard };
        tap(&readings, &self.heard);
        let orders = self.stepper.step(&readings, &self.intake, &mut self.world.flash(), report);
        self.pending = orders.motor;
        if orders.test_accelerometer {
            self.sensors.test_accelerometer();
        }
        if let Some(mut room) = self.stepper.instrument.posed() {
            room.solve();
            self.stepper.instrument.solved(room);
        }
        self.tick += 1;
        if orders.restart {
            *self = Self::power_up(&self.world);
        }
    }

    /// All bytes that the gyro has sent by now.
    fn hear_gyro(&mut self) {
        self.heard.clear();
        let mut bytes = [0; 64];
        while let Ok(count @ 1..) = self.gyro.read(&mut bytes) {
            self.heard.extend(bytes.iter().take(count));
        }
    }
}
