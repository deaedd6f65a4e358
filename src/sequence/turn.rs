//! One move of the index, watched through the encoder.

use crate::health::Fault;
use crate::sensing::index::{IndexSettings, MotorCommand};
use crate::sensing::sample::SAMPLE_S;

/// The motor starts one tick after the command, and the tick after that shows it turning.
const START_TICKS: u32 = 4;
/// Wait between the last step and the reading of the angle: 0.2 s.
const REST_TICKS: u32 = 80;
/// Where the readings differ by more than this share of the tolerance the drive rings. Then the angle is their mean over one second more, with weights
/// that rise and fall: of a ringing of f Hz 1/(πf)² are left.
const RINGING_SHARE: f64 = 0.5;
const RUNG_TICKS: u32 = REST_TICKS + 400;
/// A turning motor must move the encoder within each window of this length, 0.5 s or more: so long that an honest motor moves by
/// this angle, many times what the encoder's noise and steps can be.
const STALL_WINDOW_S: f64 = 0.5;
const STALL_WINDOW_DEG: f64 = 1.0;
/// … by this share of what it should.
const STALL_SHARE: f64 = 0.3;
/// More sigmas of the encoder beyond the end of a move than both its ends can be wrong by.
const BEYOND_SIGMAS: f64 = 7.0;

/// How far the end of a move may be from where its steps lead, degrees: as far as the encoder can be wrong.
pub fn beyond_deg(settings: &IndexSettings) -> f64 {
    (BEYOND_SIGMAS * settings.sigma_deg).max(0.1)
}

/// A move under way.
#[derive(Clone, Debug)]
pub struct Turn {
    settings: IndexSettings,
    target_deg: f64,
    retries_left: u8,
    /// Where this attempt began, and how far it shall go, degrees.
    start_deg: f64,
    way_deg: f64,
    ticks: u32,
    resting: u32,
    window_s: f64,
    window_start_deg: f64,
    window_ticks: u32,
    rest_sum_deg: f64,
    rest_weight: f64,
    rest_range_deg: [f64; 2],
}

/// What a tick of a move brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    Turning,
    /// Not there yet: another attempt.
    Again(MotorCommand),
    /// The encoder confirms the angle, degrees.
    Arrived {
        index_deg: f64,
        /// It went farther than its steps: no motor does that, an encoder that slipped looks so.
        beyond: bool,
    },
    Failed(Fault),
}

fn command(settings: &IndexSettings, way_deg: f64) -> MotorCommand {
    MotorCommand::Turn { microsteps: libm::round(way_deg * settings.microsteps_per_deg()) as i32 }
}

impl Turn {
    /// From `from_deg` to `target_deg`, both unwrapped.
    pub fn new(settings: IndexSettings, from_deg: f64, target_deg: f64) -> (Self, MotorCommand) {
        let way_deg = target_deg - from_deg;
        let by_speed_s = STALL_WINDOW_DEG / settings.speed_deg_s;
        let by_ramp_s = libm::sqrt(2.0 * STALL_WINDOW_DEG / settings.acceleration_deg_s2);
        let turn = Self {
            settings,
            target_deg,
            retries_left: settings.retries,
            start_deg: from_deg,
            way_deg,
            ticks: 0,
            resting: 0,
            window_s: STALL_WINDOW_S.max(by_speed_s).max(by_ramp_s),
            window_start_deg: from_deg,
            window_ticks: 0,
            rest_sum_deg: 0.0,
            rest_weight: 0.0,
            rest_range_deg: [f64::INFINITY, f64::NEG_INFINITY],
        };
        (turn, command(&settings, way_deg))
    }

    /// A tick: the unwrapped index angle, whether the encoder was read at this tick, and whether the motor is turning.
    pub fn tick(&mut self, index_deg: f64, fresh: bool, turning: bool) -> Progress {
        self.ticks = self.ticks.saturating_add(1);
        if turning {
            self.resting = 0;
            return self.watch_stall(index_deg);
        }
        if self.ticks <= START_TICKS {
            return Progress::Turning;
        }
        self.resting += 1;
        if self.resting <= REST_TICKS / 2 {
            return Progress::Turning;
        }
        if fresh {
            let weight = self.weight();
            self.rest_sum_deg += weight * index_deg;
            self.rest_weight += weight;
            let [least_deg, most_deg] = self.rest_range_deg;
            self.rest_range_deg = [least_deg.min(index_deg), most_deg.max(index_deg)];
        }
        let [least_deg, most_deg] = self.rest_range_deg;
        let rings = most_deg - least_deg > RINGING_SHARE * self.settings.tolerance_deg;
        if rings && self.resting == REST_TICKS {
            (self.rest_sum_deg, self.rest_weight) = (0.0, 0.0);
        }
        let is_over = if rings { self.resting >= RUNG_TICKS } else { self.resting >= REST_TICKS };
        if !is_over || self.rest_weight == 0.0 {
            return Progress::Turning;
        }
        self.verify(self.rest_sum_deg / self.rest_weight)
    }

    /// Of a reading at this tick of rest: one, and rising and falling in the second of a drive that rings.
    fn weight(&self) -> f64 {
        match self.resting.checked_sub(REST_TICKS) {
            None | Some(0) => 1.0,
            Some(rung) => f64::from(rung.min(RUNG_TICKS.saturating_sub(self.resting)).max(1)),
        }
    }

    fn watch_stall(&mut self, index_deg: f64) -> Progress {
        self.window_ticks += 1;
        let window_s = f64::from(self.window_ticks) * SAMPLE_S;
        if window_s < self.window_s {
            return Progress::Turning;
        }
        // The slowest window of an honest move is one of acceleration or of braking at its end.
        let cruise_deg = self.settings.speed_deg_s * window_s;
        let ramp_deg = 0.5 * self.settings.acceleration_deg_s2 * window_s * window_s;
        let moved_deg = (index_deg - self.window_start_deg).abs();
        self.window_start_deg = index_deg;
        self.window_ticks = 0;
        if moved_deg < STALL_SHARE * cruise_deg.min(ramp_deg).min(self.way_deg.abs()) {
            Progress::Failed(Fault::MotorStall)
        } else {
            Progress::Turning
        }
    }

    fn verify(&mut self, index_deg: f64) -> Progress {
        let left_deg = self.target_deg - index_deg;
        let moved_deg = (index_deg - self.start_deg) * self.way_deg.signum();
        if left_deg.abs() <= self.settings.tolerance_deg {
            let beyond = moved_deg - self.way_deg.abs() > beyond_deg(&self.settings);
            return Progress::Arrived { index_deg, beyond };
        }
        if moved_deg < STALL_SHARE * self.way_deg.abs() && self.way_deg.abs() > 2.0 {
            return Progress::Failed(Fault::MotorStall);
        }
        let Some(retries_left) = self.retries_left.checked_sub(1) else {
            return Progress::Failed(Fault::WrongAngle);
        };
        let (next, command) = Self::new(self.settings, index_deg, self.target_deg);
        *self = Self { retries_left, ..next };
        Progress::Again(command)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motor that reaches `share` of each commanded way at 30 °/s; the last progress and the attempts.
    fn run(from_deg: f64, target_deg: f64, share: f64, settings: IndexSettings) -> (Progress, u32) {
        let (mut turn, mut command) = Turn::new(settings, from_deg, target_deg);
        let (mut index_deg, mut attempts) = (from_deg, 1);
        loop {
            let MotorCommand::Turn { microsteps } = command else { panic!() };
            let way_deg = f64::from(microsteps) / settings.microsteps_per_deg();
            let end_deg = index_deg + share * way_deg;
            let ticks = (way_deg.abs() / 30.0 / SAMPLE_S) as u32;
            let step_deg = (end_deg - index_deg) / f64::from(ticks.max(1));
            let mut tick = 0;
            command = loop {
                tick += 1;
                let turning = tick > 2 && tick <= 2 + ticks;
                if turning {
                    index_deg += step_deg;
                }
                match turn.tick(index_deg, true, turning) {
                    Progress::Turning => {}
                    Progress::Again(command) => break command,
                    end => return (end, attempts),
                }
            };
            attempts += 1;
        }
    }

    /// A drive that rings by 1° at 2 Hz stands where it rings about; the readings of a tenth of a second miss it by up to 1°.
    #[test]
    fn a_ringing_drive_arrives_in_the_mean() {
        let settings = IndexSettings::default();
        let (mut turn, _) = Turn::new(settings, 0.0, 90.0);
        let ends = (0..1200u32).find_map(|tick| {
            let turning = (3..600).contains(&tick);
            let ringing_deg = libm::cos(core::f64::consts::TAU * 2.0 * f64::from(tick) * SAMPLE_S);
            let index_deg = if turning { 90.0 * f64::from(tick) / 600.0 } else { 90.0 + ringing_deg };
            match turn.tick(if tick < 3 { 0.0 } else { index_deg }, true, turning) {
                Progress::Turning => None,
                end => Some(end),
            }
        });
        let Some(Progress::Arrived { index_deg, .. }) = ends else { panic!("{ends:?}") };
        assert!((index_deg - 90.0).abs() < 1.0 / (2.0 * core::f64::consts::PI).powi(2), "{index_deg}");
    }

    #[test]
    fn an_honest_move_arrives() {
        let (end, attempts) = run(0.0, 90.0, 1.0, IndexSettings::default());
        assert!(
            matches!(end, Progress::Arrived { index_deg, beyond: false } if (index_deg - 90.0).abs() < 0.01),
            "{end:?}"
        );
        assert_eq!(attempts, 1);
    }

    /// 90° · 1.003 is 0.27° too far, and 0.997 as much too short: of these only the first is no motor's.
    #[test]
    fn a_move_beyond_its_steps_is_told() {
        for (share, told) in [(1.003, true), (0.997, false)] {
            let (end, _) = run(0.0, 90.0, share, IndexSettings::default());
            assert!(matches!(end, Progress::Arrived { beyond, .. } if beyond == told), "{end:?}");
        }
    }

    #[test]
    fn a_short_move_is_corrected() {
        let (end, attempts) = run(0.0, -90.0, 0.95, IndexSettings::default());
        assert!(matches!(end, Progress::Arrived { index_deg, .. } if (index_deg + 90.0).abs() < 0.5), "{end:?}");
        assert_eq!(attempts, 2);
    }

    #[test]
    fn an_angle_that_stays_wrong_is_a_fault() {
        let settings = IndexSettings { tolerance_deg: 0.01, ..Default::default() };
        assert_eq!(run(0.0, 90.0, 0.5, settings).0, Progress::Failed(Fault::WrongAngle));
    }

    #[test]
    fn a_motor_that_does_not_move_is_a_stall() {
        assert_eq!(run(0.0, 90.0, 0.0, IndexSettings::default()).0, Progress::Failed(Fault::MotorStall));
        assert_eq!(run(0.0, 5.0, 0.0, IndexSettings::default()).0, Progress::Failed(Fault::MotorStall));
    }
}
