//! The one plant behind all devices.

use crate::accelerometer::{Adxl355, Felt};
use crate::base::BaseMotion;
use crate::encoder::As5048a;
use crate::flash::FlashMemory;
use crate::geometry::{self, ARCSEC_PER_RAD, BaseAngles};
use crate::gyro::{GyroErrors, Surroundings};
use crate::gyro_output::GyroOutput;
use crate::hand::Hand;
use crate::line::Line;
use crate::motor::Drive;
use crate::pose::PoseTracker;
use crate::scenario::Scenario;
use crate::truth::Truth;
use nalgebra::Vector3;

/// Length of a slot, s: an eighth of a tick.
const SLOT_S: f64 = 0.0025 / 8.0;

/// Everything that has a state.
#[derive(Debug, Clone)]
pub struct Plant {
    scenario: Scenario,
    slots: u64,
    sampled_slots: u64,
    base: BaseMotion,
    pub hand: Hand,
    pub drive: Drive,
    tracker: PoseTracker,
    errors: GyroErrors,
    output: GyroOutput,
    line: Line,
    accelerometer: Adxl355,
    encoder: As5048a,
    pub flash: FlashMemory,
}

impl Plant {
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        let gyro = &scenario.gyro;
        let base = BaseMotion::new(&scenario.base, scenario.site.azimuth_deg, seed);
        let drive = Drive::new(&scenario.motor);
        let tracker = PoseTracker::new(scenario.site.latitude_deg, gyro, base.angles(), drive.index_deg());
        Self {
            scenario: scenario.clone(),
            slots: 0,
            sampled_slots: 0,
            base,
            hand: Hand::off(),
            drive,
            tracker,
            errors: GyroErrors::new(gyro, &scenario.site, seed),
            output: GyroOutput::new(gyro),
            line: Line::new(&scenario.link, seed),
            accelerometer: Adxl355::new(&scenario.accelerometer, seed),
            encoder: As5048a::new(&scenario.encoder, seed),
            flash: FlashMemory::erased(),
        }
    }

    pub fn t_s(&self) -> f64 {
        self.slots as f64 * SLOT_S
    }

    pub fn advance_slot(&mut self) {
        self.slots += 1;
        let t_s = self.t_s();
        self.drive.advance(t_s, SLOT_S);
    }

    /// The gyro ends its increment and its frame goes on the line.
    pub fn sample(&mut self) {
        let dt_s = (self.slots - self.sampled_slots) as f64 * SLOT_S;
        if dt_s == 0.0 {
            return;
        }
        self.sampled_slots = self.slots;
        let t_s = self.t_s();
        self.base.advance_to(t_s);
        self.hand.advance_to(t_s);
        self.tracker.hold(self.hand.rotation());
        let turn = self.tracker.move_to(self.base_angles(), self.drive.index_deg(), dt_s);
        let pose = self.tracker.pose();
        let increment_arcsec = self.errors.measure(&Surroundings {
            t_s,
            dt_s,
            turned_arcsec: turn.turned_arcsec,
            index_rad: pose.index_deg.to_radians(),
            index_change_rad: turn.index_change_rad,
            axis: pose.axis,
            vibration_g: self.scenario.base.vibration_g,
            supply_v: self.scenario.supply.volts_at(t_s),
        });
        let format = self.scenario.gyro.format;
        let line = &mut self.line;
        let temp_c = self.errors.temp_reading_c();
        self.output.tick(t_s, increment_arcsec, temp_c, |frame| line.send(&frame.encode(format), t_s));
    }

    /// The base with the give of the tripod under the motor's torque.
    fn base_angles(&self) -> BaseAngles {
        let lag_deg = self.drive.torque_lag_deg();
        let [pitch, roll, azimuth] =
            self.scenario.motor.base_reaction_arcsec_per_deg.map(|arcsec| arcsec * lag_deg / ARCSEC_PER_RAD);
        let angles = self.base.angles();
        BaseAngles {
            pitch_rad: angles.pitch_rad + pitch,
            roll_rad: angles.roll_rad + roll,
            azimuth_rad: angles.azimuth_rad + azimuth,
        }
    }

    pub fn truth(&self) -> Truth {
        let pose = self.tracker.pose();
        let mark = pose.attitude * Vector3::x();
        let t_s = self.t_s();
        Truth {
            t_s,
            azimuth_deg: mark.x.atan2(mark.y).to_degrees().rem_euclid(360.0),
            index_deg: self.drive.index_deg(),
            pitch_deg: pose.angles.pitch_rad.to_degrees(),
            roll_deg: pose.angles.roll_rad.to_degrees(),
            bias_deg_h: self.errors.bias_deg_h(),
            temp_c: self.errors.temp_c(),
            supply_v: self.scenario.supply.volts_at(t_s),
            vibration_g: self.scenario.base.vibration_g,
            lost_steps: self.drive.lost_steps(),
        }
    }

    pub fn exchange_accelerometer(&mut self, mosi: &[u8]) -> Vec<u8> {
        let felt = Felt {
            t_s: self.t_s(),
            force_g: geometry::specific_force_g(&self.tracker.pose().attitude) + self.hand.shake_g(),
            vibration_g: self.scenario.base.vibration_g,
            temp_c: self.errors.temp_c(),
        };
        self.accelerometer.exchange(mosi, &felt)
    }

    pub fn exchange_encoder(&mut self, mosi: &[u8]) -> Vec<u8> {
        self.encoder.exchange(mosi, self.drive.index_deg(), self.t_s())
    }

    pub fn receive(&mut self) -> Option<u8> {
        let t_s = self.t_s();
        self.line.receive(t_s)
    }

    pub fn has_received(&self) -> bool {
        self.line.is_ready(self.t_s())
    }
}
