//! The fix in this process: the firmware's drivers and pipeline around the simulated instrument.

use std::sync::atomic::{AtomicBool, Ordering};

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, EncoderSpi, GyroLine, Pin, World};
use north_finder::drivers::sensors::{Due, Sensors};
use north_finder::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use north_finder::event::Report;
use north_finder::health::Refused;
use north_finder::pipeline::{Command, MotorCommand, Pipeline, Readings};
use north_finder::settings::Settings;
use north_finder::settings::store::{self, Loaded};

use super::{End, EndWatch, EngineError, Observer, Outcome, Setup};

/// Sees what enters the pipeline at every tick.
pub type Tap<'a> = dyn FnMut(&Readings, &[u8]) + 'a;

/// The instrument: its parts, wired as on the board.
struct Instrument {
    world: World,
    gyro: GyroLine,
    /// What the gyro sent in this tick.
    heard: Vec<u8>,
    sensors: Sensors<AccelerometerSpi, EncoderSpi>,
    motor: StepMotor<Pin, Pin, Pin>,
    pipeline: Pipeline,
    /// Decided by the last solve, carried out at the next tick.
    pending: Option<MotorCommand>,
    tick: u64,
}

/// Powers the instrument up, starts a fix and goes on until it ends.
///
/// `observe` sees every report. `stop` is looked at in every tick.
/// Errors: the settings do not fit the flash.
pub fn run(setup: &Setup, stop: &AtomicBool, observe: &mut Observer<'_>) -> Result<Outcome, EngineError> {
    run_tapped(setup, stop, observe, &mut |_, _| ())
}

/// The same, with a look at what enters the pipeline at every tick: readings and gyro bytes.
pub fn run_tapped(
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
    tap: &mut Tap<'_>,
) -> Result<Outcome, EngineError> {
    let mut instrument = Instrument::power_up(super::world(setup)?)?;
    instrument.pipeline.command(Command::Start);
    let limit_ticks = super::limit_ticks(setup);
    let mut watch = EndWatch::default();
    let mut end = None;
    while end.is_none() {
        instrument.tick(tap, &mut |report| {
            observe(&report);
            end = end.or(watch.see(&report));
        });
        if stop.load(Ordering::Relaxed) {
            end = end.or(Some(End::Interrupted));
        } else if instrument.tick >= limit_ticks {
            end = end.or(Some(End::TimeLimit));
        }
    }
    Ok(Outcome { end: end.unwrap_or(End::TimeLimit), truth: instrument.world.truth() })
}

impl Instrument {
    fn power_up(world: World) -> Result<Self, EngineError> {
        let loaded = store::load(&mut world.flash()).map_err(|error| EngineError::Flash(format!("{error:?}")))?;
        let index = match &loaded {
            Loaded::Valid(settings) => settings.index,
            Loaded::Missing | Loaded::Corrupt => Settings::default().index,
        };
        Ok(Self {
            gyro: world.gyro(),
            heard: Vec::new(),
            sensors: Sensors::new(world.accelerometer(), world.encoder()),
            motor: StepMotor::new(world.step_pin(), world.dir_pin(), world.enable_pin(), &index),
            pipeline: Pipeline::new(loaded),
            pending: None,
            tick: 0,
            world,
        })
    }

    /// 2.5 ms, everything in the order in which the board does it.
    fn tick(&mut self, tap: &mut Tap<'_>, report: &mut dyn FnMut(Report)) {
        for _ in 0..SLOTS_PER_TICK {
            self.motor.slot();
            self.world.advance_slot();
        }
        self.world.sample();
        self.hear_gyro();
        self.pipeline.gyro_bytes(&self.heard);
        let Due { acceleration_g, index_deg } = self.sensors.read(self.tick);
        if let Some(command) = self.pending.take() {
            self.motor.command(command);
        }
        let (turning, refused) = (self.motor.is_turning(), Refused::default());
        let readings = Readings { tick: self.tick, acceleration_g, index_deg, turning, refused };
        tap(&readings, &self.heard);
        self.pending = self.pipeline.tick(&readings, report);
        self.tick += 1;
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
