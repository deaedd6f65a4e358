//! The index drive: step pulses in, angle of the gyro out.
//!
//! The field of a stepper pulls the rotor towards the commanded angle with a torque that is a sine of the lag (T. Kenjo,
//! Stepping Motors and Their Microprocessor Controls, 1984). So the rotor is a lightly damped second-order
//! system for small lags, has a greatest acceleration, rings when the command stops, and slips by whole electrical periods
//! (loses steps) when it is asked for more. The electrical period follows from stiffness and torque: 2π·a_max/ω².

use crate::noise::{Source, Stream};
use crate::scenario::Motor;
use crate::window;
use std::f64::consts::TAU;

/// Below this lag and speed (degrees, °/s) the rotor is taken to be at rest.
const REST_DEG: f64 = 1e-7;
const REST_DEG_S: f64 = 1e-5;

/// The driver goes over to its holding current when no step has come for this time, s.
const HOLD_AFTER_S: f64 = 0.05;

/// The unevenness of the turning is forgotten in this time, s.
const UNEVEN_TAU_S: f64 = 0.05;

/// The drive's state.
#[derive(Debug, Clone)]
pub struct Drive {
    motor: Motor,
    omega: f64,
    wave_number: f64,
    step_high: bool,
    counter_clockwise: bool,
    enabled: bool,
    command_deg: f64,
    rotor_deg: f64,
    speed_deg_s: f64,
    load_deg: f64,
    slipped: bool,
    asleep: bool,
    moved: bool,
    last_step_s: f64,
    kick_due: bool,
    pulses: u64,
    lost: u64,
    uneven_deg: f64,
    stream: Stream,
}

impl Drive {
    /// The drive at rest, coils off.
    pub fn new(motor: &Motor, seed: u64) -> Self {
        let omega = TAU * motor.ringing_hz;
        Self {
            motor: motor.clone(),
            omega,
            wave_number: omega * omega / motor.max_acceleration_deg_s2,
            step_high: false,
            counter_clockwise: true,
            enabled: false,
            command_deg: motor.start_deg,
            rotor_deg: motor.start_deg,
            speed_deg_s: 0.0,
            load_deg: motor.start_deg,
            slipped: false,
            asleep: true,
            moved: false,
            last_step_s: 0.0,
            kick_due: false,
            pulses: 0,
            lost: 0,
            uneven_deg: 0.0,
            stream: Stream::new(seed, Source::Drive),
        }
    }

    /// Level of the direction pin: high is counter-clockwise seen from above.
    pub fn set_direction(&mut self, high: bool) {
        self.counter_clockwise = high;
    }

    /// Level of the enable pin: high switches the coils on. Without current the rotor stays by its detent torque.
    pub fn set_enable(&mut self, high: bool) {
        self.enabled = high;
    }

    /// Whether current flows.
    pub fn has_current(&self) -> bool {
        self.enabled
    }

    /// Level of the step pin at `t_s`: a rising edge is a microstep, if the coils are on.
    pub fn set_step(&mut self, high: bool, t_s: f64) {
        let rising = high && !self.step_high;
        self.step_high = high;
        if !rising || !self.enabled {
            return;
        }
        self.pulses += 1;
        let every = u64::from(self.motor.lose_every);
        let skipped = every > 0 && self.pulses.is_multiple_of(every);
        let stalled =
            self.motor.stall_from_s.is_some_and(|from_s| window::contains(from_s, self.motor.stall_to_s, t_s));
        if skipped || stalled {
            self.lost += 1;
            return;
        }
        self.command_deg += if self.counter_clockwise { self.motor.microstep_deg } else { -self.motor.microstep_deg };
        self.asleep = false;
        self.moved = true;
        self.last_step_s = t_s;
        self.kick_due = self.motor.kick_deg_s > 0.0;
    }

    /// Moves on by `dt_s` to `t_s`.
    pub fn advance(&mut self, t_s: f64, dt_s: f64) {
        self.slipped = t_s >= self.motor.slip_at_s;
        let hunts = self.moved && self.enabled && self.motor.hunting_deg > 0.0;
        if self.asleep && !hunts {
            return;
        }
        if self.kick_due && t_s - self.last_step_s >= HOLD_AFTER_S {
            self.kick_due = false;
            self.speed_deg_s += if self.counter_clockwise { self.motor.kick_deg_s } else { -self.motor.kick_deg_s };
        }
        let hunting_deg = if hunts { self.motor.hunting_deg * (TAU * self.motor.hunting_hz * t_s).sin() } else { 0.0 };
        let lag_deg = self.command_deg + hunting_deg - self.rotor_deg;
        let pull = self.motor.max_acceleration_deg_s2 * (self.wave_number * lag_deg).sin();
        let damping = 2.0 * self.motor.damping * self.omega;
        let free = (self.speed_deg_s + pull * dt_s) / (1.0 + damping * dt_s);
        // Dry friction takes speed away but never turns it round.
        self.speed_deg_s = free.signum() * (free.abs() - self.motor.friction_deg_s2 * dt_s).max(0.0);
        self.rotor_deg += self.speed_deg_s * dt_s;
        self.wander(dt_s);
        self.stop_hard();
        let half_deg = self.motor.backlash_deg / 2.0;
        self.load_deg = self.load_deg.clamp(self.rotor_deg - half_deg, self.rotor_deg + half_deg);
        self.fall_asleep(lag_deg, pull);
    }

    /// A Gauss-Markov process of the angle while the drive turns.
    fn wander(&mut self, dt_s: f64) {
        let sigma_deg = self.motor.unevenness_deg;
        if sigma_deg > 0.0 {
            let kept = (-dt_s / UNEVEN_TAU_S).exp();
            self.uneven_deg = kept * self.uneven_deg + sigma_deg * (1.0 - kept * kept).sqrt() * self.stream.normal();
        }
    }

    fn stop_hard(&mut self) {
        if let Some(stop_deg) = self.motor.hard_stop_deg
            && self.rotor_deg > stop_deg
        {
            self.rotor_deg = stop_deg;
            self.speed_deg_s = 0.0;
        }
    }

    fn fall_asleep(&mut self, lag_deg: f64, pull: f64) {
        let held_by_friction = self.speed_deg_s == 0.0 && pull.abs() <= self.motor.friction_deg_s2;
        // A rotor that slipped rests whole electrical periods away from its command.
        let period_deg = TAU / self.wave_number;
        let from_rest_deg = lag_deg - period_deg * (lag_deg / period_deg).round();
        let at_rest = from_rest_deg.abs() < REST_DEG && self.speed_deg_s.abs() < REST_DEG_S;
        if (held_by_friction || at_rest) && !self.kick_due {
            self.asleep = true;
            self.speed_deg_s = 0.0;
        }
    }

    /// Index angle of the gyro, degrees, counter-clockwise; counts turns.
    pub fn index_deg(&self) -> f64 {
        self.load_deg + self.uneven_deg + if self.slipped { self.motor.slip_deg } else { 0.0 }
    }

    /// Whether the limit switch at the rotor is open.
    pub fn limit_is_open(&self) -> bool {
        self.motor.limit_deg.is_some_and(|limit_deg| self.rotor_deg > limit_deg)
    }

    /// The motor's torque on the base, as the lag that would make it, degrees: zero at rest.
    pub fn torque_lag_deg(&self) -> f64 {
        if self.asleep && self.motor.hunting_deg == 0.0 && self.motor.friction_deg_s2 == 0.0 {
            return 0.0;
        }
        (self.wave_number * (self.command_deg - self.rotor_deg)).sin() / self.wave_number
    }

    /// Step pulses that the drive did not follow.
    pub fn lost_steps(&self) -> u64 {
        self.lost
    }
}
