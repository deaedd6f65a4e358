//! The one plant behind all devices.

use crate::accelerometer::{Adxl355, Felt};
use crate::base::BaseMotion;
use crate::encoder::As5048a;
use crate::flash::FlashMemory;
use crate::geometry::{self, ARCSEC_PER_RAD, BaseAngles, Mounting};
use crate::gyro::{GyroErrors, Surroundings};
use crate::gyro_output::GyroOutput;
use crate::line::Line;
use crate::motor::Drive;
use crate::scenario::{Scenario, Supply};
use crate::world::Truth;
use nalgebra::{UnitQuaternion, Vector3};

/// Length of a slot, s: an eighth of a tick.
const SLOT_S: f64 = 0.0025 / 8.0;

/// Everything that has a state.
#[derive(Debug, Clone)]
pub struct Plant {
    scenario: Scenario,
    slots: u64,
    sampled_slots: u64,
    mounting: Mounting,
    earth_rad_s: Vector3<f64>,
    base: BaseMotion,
    pub drive: Drive,
    pose: Pose,
    errors: GyroErrors,
    output: GyroOutput,
    line: Line,
    accelerometer: Adxl355,
    encoder: As5048a,
    pub flash: FlashMemory,
}

/// Where the gyro was at the end of the last sample interval.
#[derive(Debug, Clone)]
struct Pose {
    angles: BaseAngles,
    attitude: UnitQuaternion<f64>,
    index_deg: f64,
    case: UnitQuaternion<f64>,
    axis: Vector3<f64>,
}

impl Pose {
    fn new(angles: BaseAngles, index_deg: f64, mounting: &Mounting) -> Self {
        let attitude = angles.attitude();
        let case = mounting.case(&attitude, index_deg.to_radians());
        Self { angles, attitude, index_deg, case, axis: mounting.axis(&case) }
    }
}

impl Plant {
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        let gyro = &scenario.gyro;
        let mounting = Mounting::new(
            gyro.spindle_tilt_arcsec.map(|arcsec| arcsec / ARCSEC_PER_RAD),
            gyro.axis_elevation_arcsec / ARCSEC_PER_RAD,
        );
        let base = BaseMotion::new(&scenario.base, scenario.site.azimuth_deg, seed);
        let drive = Drive::new(&scenario.motor);
        let pose = Pose::new(base.angles(), drive.index_deg(), &mounting);
        Self {
            scenario: scenario.clone(),
            slots: 0,
            sampled_slots: 0,
            earth_rad_s: geometry::earth_rate_rad_s(scenario.site.latitude_deg),
            mounting,
            base,
            drive,
            pose,
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
        let (turned_rad, index_change_rad) = self.move_to(self.base_angles(), dt_s);
        let increment_arcsec = self.errors.measure(&Surroundings {
            t_s,
            dt_s,
            turned_arcsec: turned_rad * ARCSEC_PER_RAD,
            index_rad: self.pose.index_deg.to_radians(),
            index_change_rad,
            axis: self.pose.axis,
            vibration_g: self.scenario.base.vibration_g,
            supply_v: supply_v(&self.scenario.supply, t_s),
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

    /// Inertial angle about the sensitive axis and change of index between the last pose and the present one, rad.
    fn move_to(&mut self, angles: BaseAngles, dt_s: f64) -> (f64, f64) {
        let index_deg = self.drive.index_deg();
        if angles == self.pose.angles && index_deg == self.pose.index_deg {
            return (self.earth_rad_s.dot(&self.pose.axis) * dt_s, 0.0);
        }
        let next = Pose::new(angles, index_deg, &self.mounting);
        let mean_axis = (self.pose.axis + next.axis) / 2.0;
        let turned_rad =
            self.mounting.turned_rad(&self.pose.case, &next.case) + self.earth_rad_s.dot(&mean_axis) * dt_s;
        let index_change_rad = (index_deg - self.pose.index_deg).to_radians();
        self.pose = next;
        (turned_rad, index_change_rad)
    }

    pub fn truth(&self) -> Truth {
        let mark = self.pose.attitude * Vector3::x();
        let t_s = self.t_s();
        Truth {
            t_s,
            azimuth_deg: mark.x.atan2(mark.y).to_degrees().rem_euclid(360.0),
            index_deg: self.drive.index_deg(),
            pitch_deg: self.pose.angles.pitch_rad.to_degrees(),
            roll_deg: self.pose.angles.roll_rad.to_degrees(),
            bias_deg_h: self.errors.bias_deg_h(),
            temp_c: self.errors.temp_c(),
            supply_v: supply_v(&self.scenario.supply, t_s),
            vibration_g: self.scenario.base.vibration_g,
            lost_steps: self.drive.lost_steps(),
        }
    }

    pub fn exchange_accelerometer(&mut self, mosi: &[u8]) -> Vec<u8> {
        let felt = Felt {
            t_s: self.t_s(),
            force_g: geometry::specific_force_g(&self.pose.attitude),
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

fn supply_v(supply: &Supply, t_s: f64) -> f64 {
    let step_v = if t_s >= supply.step_at_s { supply.step_v } else { 0.0 };
    supply.volts + supply.volts_h * t_s / 3600.0 + step_v
}
