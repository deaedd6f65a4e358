//! The world as its users see it: time, truth, and handles to the devices.

use crate::device::{AccelerometerSpi, AnalogueInputs, BlockSpi, EncoderSpi, Flash, GyroLine, Pin, PinFunction};
use crate::flash::FlashMemory;
use crate::hand::Turn;
use crate::plant::{Plant, Shared, open};
use crate::played::Played;
use crate::scenario::{Relevel, Scenario, Shock};
use crate::truth::Truth;
use std::sync::{Arc, Mutex};

/// A handle to the simulated world. Clones and devices refer to the same world, from any thread: an emulator has its own.
#[derive(Debug, Clone)]
pub struct World {
    plant: Shared,
}

impl World {
    /// The world of a scenario at power-up. The same scenario and seed give the same bytes, always.
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        Self { plant: Arc::new(Mutex::new(Plant::new(scenario, seed))) }
    }

    /// Lets 312.5 µs pass: an eighth of a tick.
    pub fn advance_slot(&self) {
        open(&self.plant).advance_slot();
    }

    /// Ends a tick: the gyro closes its increment and puts its frame on the line.
    pub fn sample(&self) {
        open(&self.plant).sample();
    }

    /// What is really so.
    pub fn truth(&self) -> Truth {
        open(&self.plant).truth()
    }

    /// Whether current flows through the motor.
    pub fn motor_has_current(&self) -> bool {
        open(&self.plant).drive.has_current()
    }

    /// Whether the limit switch of the index is open.
    pub fn limit_is_open(&self) -> bool {
        open(&self.plant).drive.limit_is_open()
    }

    /// Somebody lifts the instrument off its base, turns it, and holds it so.
    pub(crate) fn turn_by_hand(&self, turn: Turn) {
        open(&self.plant).hand.turn(turn);
    }

    /// The instrument has its fix: after the scenario's time of waiting it is carried to another place. Gives the time, s, at
    /// which it has stood there for as long as the scenario says; nothing where the scenario has no carry.
    pub fn carry(&self) -> Option<f64> {
        open(&self.plant).carry()
    }

    /// Somebody strikes the base now: first swing of pitch, roll and azimuth, and what stays of pitch and roll, arcsec.
    pub fn shock(&self, swing_arcsec: [f64; 3], permanent_arcsec: [f64; 2]) {
        let mut plant = open(&self.plant);
        let at_s = plant.t_s();
        let [pitch_arcsec, roll_arcsec] = permanent_arcsec;
        let permanent_arcsec = [pitch_arcsec, roll_arcsec, 0.0];
        plant.base.shock(Shock { at_s, swing_arcsec, permanent_arcsec, ..Shock::default() });
    }

    /// Somebody levels the instrument, or tilts it, to this pitch and roll, degrees, within `duration_s`.
    pub fn tilt(&self, duration_s: f64, pitch_deg: f64, roll_deg: f64) {
        let mut plant = open(&self.plant);
        let at_s = plant.t_s();
        plant.base.relevel(Relevel { at_s, duration_s, pitch_deg, roll_deg });
    }

    /// Somebody turns the instrument clockwise by this angle, degrees, within `duration_s`.
    pub fn turn(&self, duration_s: f64, by_deg: f64) {
        let mut plant = open(&self.plant);
        let at_s = plant.t_s();
        plant.base.turn(at_s, duration_s, by_deg);
    }

    /// The air around the instrument becomes warmer by this, at once; the gyro follows with its time constant.
    pub fn warm_the_air(&self, kelvin: f64) {
        open(&self.plant).errors.warm_the_air(kelvin);
    }

    /// The accelerometer on its bus.
    pub fn accelerometer(&self) -> AccelerometerSpi {
        AccelerometerSpi::new(Arc::clone(&self.plant))
    }

    /// The block of three gyros and three accelerometers on its bus.
    pub fn block(&self) -> BlockSpi {
        BlockSpi::new(Arc::clone(&self.plant))
    }

    /// The analogue inputs.
    pub fn analogue(&self) -> AnalogueInputs {
        AnalogueInputs::new(Arc::clone(&self.plant))
    }

    /// The encoder on its bus.
    pub fn encoder(&self) -> EncoderSpi {
        EncoderSpi::new(Arc::clone(&self.plant))
    }

    /// The motor driver's step input: a rising edge is one microstep.
    pub fn step_pin(&self) -> Pin {
        Pin::new(Arc::clone(&self.plant), PinFunction::Step)
    }

    /// The motor driver's direction input: high is counter-clockwise seen from above.
    pub fn dir_pin(&self) -> Pin {
        Pin::new(Arc::clone(&self.plant), PinFunction::Direction)
    }

    /// The motor driver's enable input: high switches the coils on; while it is low, steps are ignored.
    pub fn enable_pin(&self) -> Pin {
        Pin::new(Arc::clone(&self.plant), PinFunction::Enable)
    }

    /// The instrument's end of the gyro's serial line.
    pub fn gyro(&self) -> GyroLine {
        GyroLine::new(Arc::clone(&self.plant))
    }

    /// The flash memory.
    pub fn flash(&self) -> Flash {
        Flash::new(Arc::clone(&self.plant))
    }

    /// A copy of the flash memory's content, to be kept for another world.
    pub fn flash_contents(&self) -> Vec<u8> {
        open(&self.plant).flash.contents().to_vec()
    }

    /// The same world with these errors of its sensors.
    pub fn with_played(self, played: Played) -> Self {
        open(&self.plant).played = played;
        self
    }

    /// The same world with this content in its flash memory.
    pub fn with_flash(self, image: &[u8]) -> Self {
        open(&self.plant).flash = FlashMemory::with_contents(image);
        self
    }
}
