//! The one plant behind all devices.

use crate::accelerometer::{Adxl355, Felt};
use crate::adis16505::Adis16505;
use crate::analogue::Carried;
use crate::base::BaseMotion;
use crate::carry::Way;
use crate::encoder::As5048a;
use crate::flash::FlashMemory;
use crate::geometry::{self, ARCSEC_PER_RAD, BaseAngles};
use crate::gyro::{GyroErrors, Surroundings};
use crate::gyro_output::GyroOutput;
use crate::hand::Hand;
use crate::kvh_console::Console;
use crate::line::Line;
use crate::motor::Drive;
use crate::played::Played;
use crate::pose::PoseTracker;
use crate::scenario::{Analogue, Scenario};
use crate::truth::Truth;
use nalgebra::Vector3;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The plant, shared by the world's handles.
pub(crate) type Shared = Arc<Mutex<Plant>>;

/// The plant, for as long as this is held; also after a panic of somebody who held it.
pub(crate) fn open(plant: &Shared) -> MutexGuard<'_, Plant> {
    plant.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Length of a slot, s: an eighth of a tick.
const SLOT_S: f64 = 0.0025 / 8.0;

/// A device behind a select line.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SpiPart {
    Accelerometer,
    Block,
    Encoder,
}

/// Everything that has a state.
#[derive(Debug, Clone)]
pub struct Plant {
    scenario: Scenario,
    slots: u64,
    sampled_slots: u64,
    pub base: BaseMotion,
    pub hand: Hand,
    way: Option<Way>,
    pub drive: Drive,
    tracker: PoseTracker,
    pub errors: GyroErrors,
    output: GyroOutput,
    console: Console,
    line: Line,
    accelerometer: Adxl355,
    block: Option<Adis16505>,
    encoder: As5048a,
    pub flash: FlashMemory,
    pub played: Played,
}

impl Plant {
    pub fn new(scenario: &Scenario, seed: u64) -> Self {
        let gyro = &scenario.gyro;
        let base = BaseMotion::new(&scenario.base, scenario.site.azimuth_deg, seed);
        let drive = Drive::new(&scenario.motor, seed);
        let tracker = PoseTracker::new(scenario.site.latitude_deg, gyro, base.angles(), drive.index_deg());
        Self {
            scenario: scenario.clone(),
            slots: 0,
            sampled_slots: 0,
            base,
            hand: Hand::off(),
            way: None,
            drive,
            tracker,
            errors: GyroErrors::new(gyro, &scenario.site, seed),
            output: GyroOutput::new(gyro),
            console: Console::new(gyro),
            line: Line::new(&scenario.link, seed),
            accelerometer: Adxl355::new(&scenario.accelerometer, seed),
            block: scenario.block.as_ref().map(|block| Adis16505::new(block, seed)),
            encoder: As5048a::new(&scenario.encoder, seed),
            flash: FlashMemory::erased(),
            played: Played::default(),
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
        let before = self.tracker.pose().attitude;
        let turn = self.tracker.move_to(self.base_angles(), self.drive.index_deg(), dt_s);
        let pose = self.tracker.pose();
        if let Some(block) = &mut self.block {
            let acceleration = acceleration_m_s2(self.way.as_ref(), t_s - 0.5 * dt_s);
            let earth_rad_s = geometry::earth_rate_rad_s(self.scenario.site.latitude_deg);
            block.feel(t_s, [&before, &pose.attitude], &acceleration, &earth_rad_s, dt_s);
        }
        let increment_arcsec = self.errors.measure(&Surroundings {
            t_s,
            dt_s,
            turned_arcsec: turn.turned_arcsec,
            index_rad: pose.index_deg.to_radians(),
            index_change_rad: turn.index_change_rad,
            axis: pose.axis,
            vibration_g: self.scenario.base.vibration_g,
            supply_v: self.scenario.supply.volts_at(t_s),
        }) + self.played.increment_arcsec(t_s, dt_s, turn.turned_arcsec);
        let format = self.scenario.gyro.format;
        let line = &mut self.line;
        let temp_c = self.errors.temp_reading_c();
        let (sends, output) = (self.console.sends_frames(), self.console.output());
        self.output.tick(t_s, increment_arcsec, temp_c, output.own_clock, |frame, interval_s| {
            if sends {
                line.send(&frame.encode_as(format, output, interval_s), t_s);
            }
        });
    }

    /// See [`crate::World::carry`].
    pub fn carry(&mut self) -> Option<f64> {
        let carry = self.scenario.carry.as_ref()?;
        let lifted_s = self.t_s() + carry.wait_s;
        self.way = Some(Way::new(carry, lifted_s));
        Some(lifted_s + carry.walk_s + carry.stand_s)
    }

    /// The base with the give of the tripod under the motor's torque, and where it was carried to.
    fn base_angles(&self) -> BaseAngles {
        let lag_deg = self.drive.torque_lag_deg();
        let [pitch, roll, azimuth] =
            self.scenario.motor.base_reaction_arcsec_per_deg.map(|arcsec| arcsec * lag_deg / ARCSEC_PER_RAD);
        let angles = self.base.angles();
        let carried = self.way.as_ref().map_or_else(BaseAngles::default, |way| way.turned(self.t_s()));
        BaseAngles {
            pitch_rad: angles.pitch_rad + pitch + carried.pitch_rad,
            roll_rad: angles.roll_rad + roll + carried.roll_rad,
            azimuth_rad: angles.azimuth_rad + azimuth + carried.azimuth_rad,
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

    /// A transaction with one of the devices: what it gets, and what comes back, as many bytes.
    pub fn exchange(&mut self, device: SpiPart, mosi: &[u8]) -> Vec<u8> {
        let t_s = self.t_s();
        match device {
            SpiPart::Accelerometer => {
                let felt = self.felt();
                self.accelerometer.exchange(mosi, &felt)
            }
            SpiPart::Block => match &mut self.block {
                Some(block) => block.exchange(mosi, t_s, self.errors.housing_c()),
                None => vec![0xFF; mosi.len()],
            },
            SpiPart::Encoder => {
                let read_deg = self.drive.index_deg() + self.played.index_deg(t_s);
                self.encoder.exchange(mosi, read_deg, t_s)
            }
        }
    }

    /// What comes back with the last of these bytes, in a transaction that is under way: the devices stay as they were.
    pub fn answer(&mut self, device: SpiPart, mosi: &[u8]) -> u8 {
        let before = (self.accelerometer.clone(), self.block.clone(), self.encoder.clone());
        // By a byte longer, so that no device takes the frame for cut off in the middle.
        let miso = self.exchange(device, &[mosi, &[0]].concat());
        (self.accelerometer, self.block, self.encoder) = before;
        mosi.len().checked_sub(1).and_then(|last| miso.get(last)).copied().unwrap_or_default()
    }

    fn felt(&self) -> Felt {
        let attitude = &self.tracker.pose().attitude;
        let walk_g = attitude.inverse() * acceleration_m_s2(self.way.as_ref(), self.t_s()) / geometry::GRAVITY_M_S2;
        let [forward_g, left_g] = self.played.level_g(self.t_s());
        let played_g = Vector3::new(forward_g, left_g, 0.0);
        Felt {
            t_s: self.t_s(),
            force_g: geometry::specific_force_g(attitude) + walk_g + self.hand.shake_g() + played_g,
            vibration_g: self.scenario.base.vibration_g,
            temp_c: self.errors.temp_c(),
        }
    }

    pub fn receive(&mut self) -> Option<u8> {
        let t_s = self.t_s();
        self.line.receive(t_s)
    }

    /// What the analogue inputs carry now.
    pub fn carried(&self) -> Carried {
        Carried {
            supply_v: self.scenario.supply.volts_at(self.t_s()),
            gyro_c: self.errors.temp_c(),
            housing_c: self.errors.housing_c(),
        }
    }

    /// What is wired to them.
    pub fn analogue(&self) -> &Analogue {
        &self.scenario.analogue
    }

    /// The gyro hears a byte.
    pub fn tell_gyro(&mut self, byte: u8) {
        if let Some(answer) = self.console.hear(byte) {
            let t_s = self.t_s();
            self.line.send(answer.as_bytes(), t_s);
        }
    }

    pub fn has_received(&self) -> bool {
        self.line.is_ready(self.t_s())
    }
}

/// Of the place of the instrument, east, north, up.
fn acceleration_m_s2(way: Option<&Way>, t_s: f64) -> Vector3<f64> {
    way.map_or_else(Vector3::zeros, |way| way.acceleration_m_s2(t_s))
}
