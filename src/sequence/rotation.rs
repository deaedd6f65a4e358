//! A continuous rotation: passes to and fro over the travel of one turn. The seconds in which the index turns evenly count.
//!
//! A pass turns from one end of the travel to the other and its encoder is read all the while; the next one begins as soon as the drive
//! rests. Where it accelerates and brakes the mean angle of a second is not that of its mean rate: these seconds are left out. Passes have
//! numbers of their own, from [`FIRST_PASS`] on.

use super::turn::{Progress, Turn};
use crate::fix::rotation::FIRST_PASS;
use crate::sensing::index::{IndexSettings, MotorCommand};

/// Way of accelerating and of braking, as a share of v²/a: the motor brakes with 0.9 of its acceleration, v²/(1.8 a) = 0.56 v²/a, and 0.04 v²/a more
/// let the rotor swing in.
const UNEVEN: f64 = 0.6;
/// From the last step of a pass to the first of the next one, seconds: 0.2 s of rest, and what reading and command take.
const REVERSAL_S: f64 = 0.25;
/// Least share of a pass that is even.
const LEAST_EVEN: f64 = 0.5;

/// A rotation under way.
#[derive(Clone, Debug)]
pub struct Rotation {
    settings: IndexSettings,
    turn: Turn,
    /// Both ends of the travel, unwrapped, and the number of the pass: an even one turns to the second end.
    ends_deg: [f64; 2],
    pass: u8,
    passes: u8,
    /// Index angle at the beginning of the second under way, if it began in this pass.
    began_deg: Option<f64>,
    /// In the last second the index turned evenly.
    pub is_even: bool,
    /// The last pass has ended.
    pub is_over: bool,
}

impl Rotation {
    /// From the first end of the travel, where the index stands at `angle_deg`, unwrapped.
    pub fn new(settings: IndexSettings, angle_deg: f64, passes: u8) -> (Self, MotorCommand) {
        let [first_deg, last_deg] = settings.ends_deg();
        let turns_deg = 360.0 * libm::round((angle_deg - first_deg) / 360.0);
        let (first_deg, last_deg) = (first_deg + turns_deg, last_deg + turns_deg);
        let (turn, command) = Turn::new(settings, angle_deg, last_deg);
        let ends_deg = [first_deg, last_deg];
        (Self { settings, turn, ends_deg, pass: 0, passes, began_deg: None, is_even: false, is_over: false }, command)
    }

    /// Number of the pass under way, among those of the dwells.
    pub fn number(&self) -> u8 {
        FIRST_PASS.saturating_add(self.pass)
    }

    /// Where the pass under way ends, degrees, unwrapped.
    pub fn target_deg(&self) -> f64 {
        let [first_deg, last_deg] = self.ends_deg;
        if self.pass.is_multiple_of(2) { last_deg } else { first_deg }
    }

    /// A tick, as of a [`Turn`].
    pub fn tick(&mut self, index_deg: f64, fresh: bool, turning: bool) -> Progress {
        if self.is_over { Progress::Turning } else { self.turn.tick(index_deg, fresh, turning) }
    }

    /// The pass is over, where the index stands: turns back, unless it was the last one, or after as many to as fro `room_s` seconds are not enough for
    /// two more.
    pub fn turn_back(&mut self, index_deg: f64, room_s: f64) -> Option<MotorCommand> {
        let done = self.pass.saturating_add(1);
        let out_of_time = done.is_multiple_of(2) && room_s < 2.0 * pass_s(&self.settings);
        if done >= self.passes || out_of_time {
            self.is_over = true;
            return None;
        }
        (self.pass, self.began_deg) = (done, None);
        let (turn, command) = Turn::new(self.settings, index_deg, self.target_deg());
        self.turn = turn;
        Some(command)
    }

    /// A second has ended, at this index angle. Whether the index turned evenly all the while.
    pub fn second(&mut self, index_deg: Option<f64>) -> bool {
        let margin_deg = uneven_deg(&self.settings);
        let [first_deg, last_deg] = self.ends_deg;
        let even = first_deg + margin_deg..=last_deg - margin_deg;
        let began_deg = core::mem::replace(&mut self.began_deg, index_deg);
        self.is_even =
            !self.is_over && [began_deg, index_deg].iter().all(|at| at.is_some_and(|at_deg| even.contains(&at_deg)));
        self.is_even
    }
}

/// Way at either end of a pass in which the index does not turn evenly, degrees.
fn uneven_deg(settings: &IndexSettings) -> f64 {
    UNEVEN * settings.speed_deg_s * settings.speed_deg_s / settings.acceleration_deg_s2
}

/// How long a pass takes, with its turning point, seconds.
pub fn pass_s(settings: &IndexSettings) -> f64 {
    let [first_deg, last_deg] = settings.ends_deg();
    let IndexSettings { speed_deg_s, acceleration_deg_s2, .. } = *settings;
    (last_deg - first_deg) / speed_deg_s + speed_deg_s / acceleration_deg_s2 * (0.5 + 0.5 / 0.9) + REVERSAL_S
}

/// Whether at this speed half of a pass, and three seconds of it, are even.
pub fn is_even_enough(settings: &IndexSettings) -> bool {
    let [first_deg, last_deg] = settings.ends_deg();
    let way_deg = last_deg - first_deg;
    let even_deg = way_deg - 2.0 * uneven_deg(settings);
    even_deg >= LEAST_EVEN * way_deg && even_deg >= 4.0 * settings.speed_deg_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 358° at 30 °/s, 0.25 s and 0.278 s for the ramps beside it, and the reversal.
    #[test]
    fn a_pass_by_hand() {
        let settings = IndexSettings::default();
        assert!((pass_s(&settings) - (11.9333 + 0.25 + 0.2778 + 0.25)).abs() < 1e-3);
        assert!(is_even_enough(&settings));
        // 0.6 · 30²/5 = 108° at either end: 142° of 358° are even.
        let sluggish = IndexSettings { acceleration_deg_s2: 5.0, ..settings };
        assert!(!is_even_enough(&sluggish));
    }

    /// 9° at either end are not even: seconds that begin and end at 5° to 345°, in one pass.
    #[test]
    fn even_seconds_count() {
        let settings = IndexSettings::default();
        let (mut rotation, command) = Rotation::new(settings, -4.0, 4);
        assert_eq!(command, MotorCommand::Turn { microsteps: 35_800 });
        assert_eq!((rotation.number(), rotation.target_deg()), (128, 354.0));
        let evens = |rotation: &mut Rotation, angles_deg: &[f64]| {
            angles_deg.iter().map(|&angle_deg| rotation.second(Some(angle_deg))).collect::<std::vec::Vec<_>>()
        };
        assert_eq!(
            evens(&mut rotation, &[-4.0, 4.0, 34.0, 64.0, 344.0, 354.0]),
            [false, false, false, true, true, false]
        );
        assert!(!rotation.second(None) && !rotation.second(Some(40.0)));
        assert_eq!(rotation.turn_back(354.0, 1000.0), Some(MotorCommand::Turn { microsteps: -35_800 }));
        assert_eq!((rotation.number(), rotation.target_deg()), (129, -4.0));
        assert_eq!(evens(&mut rotation, &[340.0, 310.0]), [false, true]);
    }

    /// With time for one pass more it goes back, so that there are as many to as fro; with time for two and less it ends.
    #[test]
    fn it_ends_after_as_many_to_as_fro() {
        for (passes, room_s, ended_after) in [(2, 1000.0, 2), (4, 1000.0, 4), (40, 0.0, 2), (40, 20.0, 2)] {
            let (mut rotation, _) = Rotation::new(IndexSettings::default(), -4.0, passes);
            let mut done = 1;
            while rotation.turn_back(rotation.target_deg(), room_s).is_some() {
                done += 1;
            }
            assert_eq!(done, ended_after);
            assert!(rotation.is_over && !rotation.second(Some(100.0)));
        }
    }

    /// Over a slip ring the spindle may be turns away.
    #[test]
    fn it_rotates_where_the_spindle_is() {
        let settings = IndexSettings { slip_ring: true, ..IndexSettings::default() };
        let (rotation, _) = Rotation::new(settings, 715.3, 2);
        assert_eq!(rotation.target_deg(), 1074.0);
    }
}
