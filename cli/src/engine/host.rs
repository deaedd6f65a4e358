//! The fix in this process: the firmware's drivers and its [`Instrument`] around the simulated devices.

use std::sync::atomic::{AtomicBool, Ordering};

use embedded_io::Read as _;
use hal_sim::{AccelerometerSpi, BlockSpi, EncoderSpi, GyroLine, Pin, World};
use north_finder::calibration::field::problem::Problem;
use north_finder::drivers::sensors::Sensors;
use north_finder::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use north_finder::event::Report;
use north_finder::identity::Identity;
use north_finder::index::MotorCommand;
use north_finder::instrument::{Instrument, Readings};
use north_finder::intake::Intake;

use super::{EngineError, FixWanted, Observer, Outcome, Person, PowerOff, RequestLine, Setup};

/// Sees what enters the instrument at every tick: readings and gyro bytes.
pub type Tap<'a> = dyn FnMut(&Readings, &[u8]) + 'a;

/// The instrument and its devices, wired as on the board.
struct Wired {
    world: World,
    gyro: GyroLine,
    /// What the gyro sent in this tick.
    heard: Vec<u8>,
    sensors: Sensors<AccelerometerSpi, EncoderSpi, BlockSpi>,
    motor: StepMotor<Pin, Pin, Pin>,
    instrument: Box<Instrument>,
    intake: Box<Intake>,
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

/// The same, with a look at what enters the instrument at every tick.
pub fn run_tapped(
    setup: &Setup,
    stop: &AtomicBool,
    observe: &mut Observer<'_>,
    tap: &mut Tap<'_>,
) -> Result<Outcome, EngineError> {
    let world = super::world(setup)?;
    let mut wanted = FixWanted::new(&world, observe);
    let off = serve(&world, super::limit_ticks(setup), &mut wanted, stop, tap)?;
    Ok(wanted.outcome(off))
}

/// Powers the instrument of a world up, and lets a person work with it for at most that many ticks.
pub fn serve(
    world: &World,
    limit_ticks: u64,
    person: &mut dyn Person,
    stop: &AtomicBool,
    tap: &mut Tap<'_>,
) -> Result<PowerOff, EngineError> {
    let mut wired = Wired::power_up(world);
    let mut requests = RequestLine::default();
    for tick in 0..limit_ticks {
        if let Some(request) = person.request(tick) {
            requests.send(&request)?;
        }
        let mut heard = false;
        wired.tick(&requests.tick(), tap, &mut |report| heard |= person.hear(&report));
        if heard {
            return Ok(PowerOff::Heard);
        }
        if stop.load(Ordering::Relaxed) {
            return Ok(PowerOff::Interrupted);
        }
    }
    Ok(PowerOff::TimeLimit)
}

impl Wired {
    fn power_up(world: &World) -> Self {
        let instrument = Instrument::power_up(&mut world.flash(), Identity::host());
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
            instrument: Box::new(instrument),
            intake: Box::new(Intake::new()),
            pending: None,
            tick: 0,
            world: world.clone(),
        }
    }

    /// 2.5 ms, everything in the order in which the board does it.
    fn tick(&mut self, requests: &[u8], tap: &mut Tap<'_>, report: &mut dyn FnMut(Report)) {
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
        let readings = Readings { tick: self.tick, sensors, turning: self.motor.is_turning() };
        tap(&readings, &self.heard);
        self.intake.gyro.put(&self.heard);
        self.intake.host.put(requests);
        let orders = self.instrument.step(&readings, &self.intake, &mut self.world.flash(), report);
        self.pending = orders.motor;
        let mut problem = Problem::default();
        if self.instrument.problem(&mut problem) {
            self.instrument.solved(problem.solve());
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
