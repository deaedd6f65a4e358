//! The fix in this process: the firmware's drivers and pipeline around the simulated instrument.

use std::sync::atomic::{AtomicBool, Ordering};

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, EncoderSpi, GyroLine, Pin, World};
use north_finder::drivers::sensors::{Due, Sensors};
use north_finder::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use north_finder::event::Report;
use north_finder::health::Refused;
use north_finder::index::MotorCommand;
use north_finder::link::Request;
use north_finder::pipeline::{Pipeline, Readings};
use north_finder::settings::Settings;
use north_finder::settings::store::{self, Loaded};

use super::{EngineError, FixWanted, Observer, Outcome, Person, PowerOff, Setup};

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
    let world = super::world(setup)?;
    let mut wanted = FixWanted::new(observe);
    let off = serve(&world, super::limit_ticks(setup), &mut wanted, stop, tap)?;
    Ok(wanted.outcome(off, &world))
}

/// Powers the instrument of a world up, and lets a person work with it for at most that many ticks.
pub fn serve(
    world: &World,
    limit_ticks: u64,
    person: &mut dyn Person,
    stop: &AtomicBool,
    tap: &mut Tap<'_>,
) -> Result<PowerOff, EngineError> {
    let mut instrument = Instrument::power_up(world.clone())?;
    for tick in 0..limit_ticks {
        if let Some(request) = person.request(tick) {
            instrument.request(request)?;
        }
        let mut heard = false;
        instrument.tick(tap, &mut |report| heard |= person.hear(&report));
        if heard {
            return Ok(PowerOff::Heard);
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(PowerOff::Interrupted);
        }
    }
    Ok(PowerOff::TimeLimit)
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

    /// A request over the link.
    fn request(&mut self, request: Request) -> Result<(), EngineError> {
        match request {
            Request::Command(command) => self.pipeline.command(command),
            Request::StoreSettings(settings)
                if settings.validate().is_ok() && store::save(&mut self.world.flash(), &settings).is_ok() =>
            {
                *self = Self::power_up(self.world.clone())?;
            }
            // A process has nothing that survives its crash.
            Request::StoreSettings(_) | Request::Provoke(_) => self.pipeline.bad_command(),
        }
        Ok(())
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
        let Due { acceleration, index } = self.sensors.read(self.tick);
        if let Some(command) = self.pending.take() {
            self.motor.command(command);
        }
        let (turning, refused) = (self.motor.is_turning(), Refused::default());
        let readings = Readings { tick: self.tick, acceleration, index, turning, refused };
        tap(&readings, &self.heard);
        self.pending = self.pipeline.tick(&readings, report);
        self.calibrate();
        self.tick += 1;
    }

    /// What the calibration in the field has done outside the pipeline.
    fn calibrate(&mut self) {
        let field = &mut self.pipeline.field;
        if let Some(problem) = field.problem() {
            field.solved(problem.solve());
        }
        if let Some(calibration) = field.to_store() {
            let change = |settings: &mut Settings| settings.accelerometer = Some(calibration);
            field.stored(store::update(&mut self.world.flash(), change).is_ok());
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
