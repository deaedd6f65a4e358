//! The motor that turns the gyro: step, direction and enable pins, and a ramp that ends exactly on the target.
//!
//! Time comes in slots of 1/3200 s; a slot makes at most one step. The ramp is trapezoidal: it gains the permitted
//! acceleration until the permitted speed, and brakes along v = √(2 · a · way). micromath's square root is at most 6.1 % above the true
//! one; one step of Newton's makes that 0.18 % (half of 0.061², by the mean of estimate and quotient, which is never below the root), so
//! that the braking is even to 0.4 %. The number of steps is exact whatever the ramp.

use core::convert::Infallible;

use embedded_hal::digital::OutputPin;
use micromath::F32;

use crate::sensing::index::{IndexSettings, MotorCommand};

/// Slots in a second.
pub const SLOTS_HZ: u16 = 3200;
/// Slots in a tick of 2.5 ms.
pub const SLOTS_PER_TICK: u8 = 8;

/// The braking along the ramp, as a part of the permitted acceleration: what is left is for the steps, whose speed follows the ramp at the
/// next slot only.
const BRAKING: f32 = 0.9;

/// The step/direction motor. Pins: a rising edge of `S` is a step, `D` high turns counter-clockwise from above, `E` high
/// switches the windings on. They are of the kind that cannot fail; an expander on a bus would be too slow.
#[derive(Debug)]
pub struct StepMotor<S, D, E> {
    step: S,
    direction: D,
    enable: E,
    ramp: Ramp,
    /// Steps to go, counter-clockwise positive.
    to_go: i32,
    /// Whether the direction pin says counter-clockwise.
    counter_clockwise: bool,
    /// Steps per slot, never negative, below 1.
    speed: f32,
    /// How much of the next step has passed.
    phase: f32,
    /// The windings go off as soon as it rests.
    release: bool,
    /// There is a limit switch.
    limit_switch: bool,
}

/// Speed in steps per slot, acceleration in steps per slot².
#[derive(Clone, Copy, Debug)]
struct Ramp {
    acceleration: f32,
    top_speed: f32,
}

impl Ramp {
    fn new(settings: &IndexSettings) -> Self {
        let (steps_deg, slots_s) = (settings.microsteps_per_deg() as f32, f32::from(SLOTS_HZ));
        Self {
            acceleration: settings.acceleration_deg_s2 as f32 * steps_deg / (slots_s * slots_s),
            top_speed: settings.speed_deg_s as f32 * steps_deg / slots_s,
        }
    }

    /// The speed from which braking ends after this many steps.
    fn speed_before(self, steps: i32) -> f32 {
        if steps > 0 { root(2.0 * BRAKING * self.acceleration * steps as f32) } else { 0.0 }
    }

    /// The steps that braking from this speed takes, rounded up.
    fn steps_to_stop(self, speed: f32) -> i32 {
        (speed * speed / (2.0 * BRAKING * self.acceleration)) as i32 + 1
    }
}

/// The square root of a number above 0, 0.18 % too great at most.
fn root(square: f32) -> f32 {
    let estimate = F32(square).sqrt().0;
    0.5 * (estimate + square / estimate)
}

/// The lesser of two numbers: `f32::min`, which looks for what is no number, is a call of a function on a Cortex-M4F.
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl<S, D, E> StepMotor<S, D, E>
where
    S: OutputPin<Error = Infallible>,
    D: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible>,
{
    /// A motor at rest, its windings off until the first turn.
    pub fn new(step: S, direction: D, mut enable: E, settings: &IndexSettings) -> Self {
        let Ok(()) = enable.set_low();
        Self {
            step,
            direction,
            enable,
            ramp: Ramp::new(settings),
            to_go: 0,
            counter_clockwise: false,
            speed: 0.0,
            phase: 0.0,
            release: false,
            limit_switch: settings.limit_switch,
        }
    }

    pub fn command(&mut self, command: MotorCommand) {
        match command {
            MotorCommand::Turn { microsteps } => self.turn(microsteps),
            MotorCommand::Stop => self.stop(),
        }
    }

    /// Turns by this many microsteps from where the motor is, counter-clockwise positive; replaces what was left of the
    /// turn before. A motor that runs the other way, or too fast, brakes and comes back.
    pub fn turn(&mut self, microsteps: i32) {
        self.to_go = microsteps;
        self.release = false;
        let Ok(()) = self.enable.set_high();
    }

    /// Brakes as fast as the ramp allows and stays there, without current: the windings go off at rest.
    pub fn stop(&mut self) {
        let way = if self.speed > 0.0 { self.ramp.steps_to_stop(self.speed) } else { 0 };
        self.to_go = if self.counter_clockwise { way } else { -way };
        self.release = true;
        self.release_at_rest();
    }

    /// Whether the limit input is open, at every tick. Where there is a switch the motor stops on the spot then, without current: behind a
    /// switch there is no way to brake in. As long as it is open, no turn begins.
    pub fn limit(&mut self, open: bool) {
        if open && self.limit_switch && self.is_turning() {
            (self.to_go, self.speed, self.release) = (0, 0.0, true);
            self.release_at_rest();
        }
    }

    fn release_at_rest(&mut self) {
        if self.release && !self.is_turning() {
            let Ok(()) = self.enable.set_low();
        }
    }

    /// Whether slots are needed.
    pub fn is_turning(&self) -> bool {
        self.to_go != 0 || self.speed > 0.0
    }

    /// One slot, 1/3200 s: perhaps a step.
    pub fn slot(&mut self) {
        if !self.is_turning() {
            return;
        }
        if self.speed == 0.0 {
            self.face(self.to_go > 0);
        }
        let permitted = lesser(self.ramp.speed_before(self.ahead()), self.ramp.top_speed);
        self.speed = if permitted >= self.speed {
            lesser(permitted, self.speed + self.ramp.acceleration)
        } else {
            -lesser(-permitted, self.ramp.acceleration - self.speed)
        };
        self.phase += self.speed;
        if self.phase >= 1.0 {
            self.phase -= 1.0;
            self.make_step();
        }
    }

    /// Steps to go in the direction of the motion; negative: the target lies behind.
    fn ahead(&self) -> i32 {
        if self.counter_clockwise { self.to_go } else { self.to_go.saturating_neg() }
    }

    fn face(&mut self, counter_clockwise: bool) {
        self.phase = 0.0;
        self.counter_clockwise = counter_clockwise;
        let Ok(()) = if counter_clockwise { self.direction.set_high() } else { self.direction.set_low() };
    }

    fn make_step(&mut self) {
        let Ok(()) = self.step.set_high();
        self.to_go = self.to_go.saturating_add(if self.counter_clockwise { -1 } else { 1 });
        // On the target, and slow enough to stop within a step.
        if self.to_go == 0 && self.speed * self.speed <= 2.0 * self.ramp.acceleration {
            self.speed = 0.0;
        }
        let Ok(()) = self.step.set_low();
        self.release_at_rest();
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use core::cell::Cell;
    use embedded_hal::digital::ErrorType;
    use std::vec;

    /// What the pins did.
    #[derive(Default)]
    struct Plant {
        position: Cell<i32>,
        counter_clockwise: Cell<bool>,
        enabled: Cell<bool>,
        steps: Cell<u32>,
    }

    #[derive(Clone, Copy)]
    enum Pin<'a> {
        Step(&'a Plant),
        Direction(&'a Plant),
        Enable(&'a Plant),
    }

    impl ErrorType for Pin<'_> {
        type Error = Infallible;
    }

    impl OutputPin for Pin<'_> {
        fn set_low(&mut self) -> Result<(), Infallible> {
            match self {
                Self::Step(_) => {}
                Self::Direction(plant) => plant.counter_clockwise.set(false),
                Self::Enable(plant) => plant.enabled.set(false),
            }
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Infallible> {
            match self {
                Self::Step(plant) => {
                    assert!(plant.enabled.get());
                    plant.position.update(|at| if plant.counter_clockwise.get() { at + 1 } else { at - 1 });
                    plant.steps.update(|steps| steps + 1);
                }
                Self::Direction(plant) => plant.counter_clockwise.set(true),
                Self::Enable(plant) => plant.enabled.set(true),
            }
            Ok(())
        }
    }

    type Motor<'a> = StepMotor<Pin<'a>, Pin<'a>, Pin<'a>>;

    fn motor(plant: &Plant) -> Motor<'_> {
        // 30 °/s and 60 °/s²: 0.9375 steps/slot and 6000 steps/s² = 5.86e-4 steps/slot².
        let settings = IndexSettings { speed_deg_s: 30.0, acceleration_deg_s2: 60.0, ..IndexSettings::default() };
        StepMotor::new(Pin::Step(plant), Pin::Direction(plant), Pin::Enable(plant), &settings)
    }

    /// Runs until the motor rests; gives the number of slots. Checks in every slot what always holds.
    fn run(motor: &mut Motor, plant: &Plant) -> u32 {
        let mut slots = 0;
        while motor.is_turning() {
            let (speed, steps) = (motor.speed, plant.steps.get());
            motor.slot();
            assert!(plant.steps.get() <= steps + 1, "more than one step in a slot");
            assert!(motor.speed <= 0.9375);
            let stopped = motor.speed == 0.0 && speed * speed <= 2.0 * 5.9e-4;
            assert!(stopped || (motor.speed - speed).abs() <= 5.9e-4, "{speed} to {}", motor.speed);
            slots += 1;
            assert!(slots < 1_000_000, "never stops");
        }
        slots
    }

    #[test]
    fn turns_exactly_and_back() {
        let plant = Plant::default();
        let mut motor = motor(&plant);
        for microsteps in [9000, 1, -1, 2, -9002, 36_000, -7, 100] {
            let target = plant.position.get() + microsteps;
            motor.turn(microsteps);
            assert!(motor.is_turning());
            run(&mut motor, &plant);
            assert_eq!(plant.position.get(), target);
        }
    }

    #[test]
    fn counter_clockwise_is_positive_and_high() {
        let plant = Plant::default();
        let mut motor = motor(&plant);
        motor.turn(5);
        run(&mut motor, &plant);
        assert_eq!((plant.position.get(), plant.counter_clockwise.get()), (5, true));
    }

    #[test]
    fn a_quarter_turn_takes_its_time() {
        let plant = Plant::default();
        let mut motor = motor(&plant);
        motor.turn(9000);
        let seconds = f64::from(run(&mut motor, &plant)) / f64::from(SLOTS_HZ);
        // By hand: 0.5 s up to 30 °/s over 7.5°; down at 54 °/s² in 0.556 s over 8.33°; the rest of 90° at 30 °/s: 3.528 s in all,
        // but for the 0.019 s that a ramp to rest would take after its last step but one.
        assert!((3.505..3.515).contains(&seconds), "{seconds}");
    }

    /// From v² = 2 · a · way, by the standard library's root, over all ways that an index has: 720° in 3000 steps a degree.
    #[test]
    fn the_root_is_exact_to_two_parts_in_a_thousand() {
        for exponent in -60..90_i32 {
            for part in 0..200_u16 {
                let square = (f64::from(exponent) / 3.0 + f64::from(part) / 600.0).exp2();
                let error = f64::from(root(square as f32)) / square.sqrt() - 1.0;
                assert!((-1e-6..0.0019).contains(&error), "{square}: {error}");
            }
        }
    }

    /// Over each twentieth of a second the speed falls by 54 °/s², as the ramp says: 0.375 steps a slot in 0.05 s of 20 speeds, and no more
    /// than the permitted 60 °/s².
    #[test]
    fn the_braking_is_even() {
        let plant = Plant::default();
        let mut motor = motor(&plant);
        motor.turn(36_000);
        (0..6400).for_each(|_| motor.slot());
        motor.stop();
        let mut speeds = vec![motor.speed];
        while motor.is_turning() {
            (0..160).for_each(|_| motor.slot());
            speeds.push(motor.speed);
        }
        // The last one may end within its twentieth.
        for pair in speeds[..speeds.len() - 1].windows(2) {
            let deg_s2 = (pair[0] - pair[1]) * 3200.0 / 100.0 / 0.05;
            assert!((52.0..56.0).contains(&deg_s2), "{deg_s2}");
        }
    }

    #[test]
    fn stops_within_the_braking_way_and_stays() {
        let plant = Plant::default();
        let mut motor = motor(&plant);
        motor.turn(36_000);
        for _ in 0..6400 {
            motor.slot();
        }
        let at = plant.position.get();
        motor.stop();
        let slots = run(&mut motor, &plant);
        // From 30 °/s at 54 °/s²: 8.33°, 0.556 s or 1778 slots, but for the last √(2 / (0.9 · 5.86e-4)) = 62: it rests at its last step.
        assert!((plant.position.get() - at - 833).abs() <= 5, "{}", plant.position.get() - at);
        assert!((1710..1725).contains(&slots), "{slots}");
        assert!(!plant.enabled.get(), "a motor that was stopped has no current");
        motor.slot();
        assert!(!motor.is_turning());
    }

    #[test]
    fn an_open_limit_switch_stops_it_on_the_spot_and_keeps_it() {
        let plant = Plant::default();
        for limit_switch in [false, true] {
            let mut motor = motor(&plant);
            motor.limit_switch = limit_switch;
            motor.limit(true);
            motor.turn(36_000);
            (0..6400).for_each(|_| motor.slot());
            motor.limit(false);
            assert!(motor.is_turning());
            let at = plant.position.get();
            motor.limit(true);
            motor.slot();
            assert_eq!(motor.is_turning(), !limit_switch);
            // What a fix that failed asks for, and what would turn it on.
            motor.stop();
            motor.turn(-36_000);
            motor.limit(true);
            motor.slot();
            assert_eq!([plant.position.get() == at, !plant.enabled.get(), !motor.is_turning()], [limit_switch; 3]);
        }
    }

    #[test]
    fn current_flows_from_a_turn_to_the_next_stop() {
        let plant = Plant::default();
        plant.enabled.set(true);
        let mut motor = motor(&plant);
        assert!(!plant.enabled.get(), "there is none at the start");
        motor.turn(10);
        run(&mut motor, &plant);
        assert!(plant.enabled.get(), "it holds until it is told to stop");
        motor.stop();
        assert!(!plant.enabled.get());
    }

    #[test]
    fn a_turn_commanded_while_turning_ends_where_it_says() {
        for microsteps in [-500, 50, 20_000] {
            let plant = Plant::default();
            let mut motor = motor(&plant);
            motor.turn(9000);
            for _ in 0..3000 {
                motor.slot();
            }
            let target = plant.position.get() + microsteps;
            motor.turn(microsteps);
            run(&mut motor, &plant);
            assert_eq!(plant.position.get(), target);
        }
    }

    #[test]
    fn extreme_turns_do_not_overflow() {
        let plant = Plant::default();
        let mut motor = motor(&plant);
        for microsteps in [i32::MIN, i32::MAX] {
            motor.turn(microsteps);
            for _ in 0..10_000 {
                motor.slot();
            }
            motor.stop();
            run(&mut motor, &plant);
        }
    }
}
