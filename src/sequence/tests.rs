//! Whatever validates works: every limit of the settings, on a still base with the drive and a quiet gyro.

extern crate std;

use core::cell::Cell;
use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use quantities::codes::IndexCode;

use super::*;
use crate::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use crate::effects::{Conditions, ErrorModel};
use crate::sensing::index::{Direction, IndexSettings};
use crate::sensing::sample::{SAMPLE_S, SAMPLES_PER_SECOND};
use crate::settings::Settings;
use crate::units::wrap_180_deg;

const AZIMUTH_DEG: f64 = 40.0;

/// Step, direction and enable of a drive that follows, microsteps from the mark.
#[derive(Default)]
struct Drive {
    position: Cell<i32>,
    /// How far it has ever been to either side.
    low: Cell<i32>,
    high: Cell<i32>,
    forward: Cell<bool>,
}

struct StepPin<'a>(&'a Drive);
struct DirectionPin<'a>(&'a Drive);
struct EnablePin;

impl ErrorType for StepPin<'_> {
    type Error = Infallible;
}

impl ErrorType for DirectionPin<'_> {
    type Error = Infallible;
}

impl ErrorType for EnablePin {
    type Error = Infallible;
}

impl OutputPin for StepPin<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        let position = self.0.position.get() + if self.0.forward.get() { 1 } else { -1 };
        self.0.position.set(position);
        self.0.low.set(self.0.low.get().min(position));
        self.0.high.set(self.0.high.get().max(position));
        Ok(())
    }
}

impl OutputPin for DirectionPin<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.forward.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.forward.set(true);
        Ok(())
    }
}

impl OutputPin for EnablePin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A fix on a still base, from the mark. The fix, or the fault.
fn run(settings: &Settings) -> Result<Fix, Fault> {
    power_up(settings, &Drive::default(), AZIMUTH_DEG, u64::MAX).unwrap()
}

/// The clocks of gyro and instrument have run apart by hours before the fix: its time limits are those of the gyro's seconds.
#[test]
fn clocks_that_ran_apart_end_no_fix() {
    for ahead_s in [-20_000.0, 20_000.0] {
        let fix =
            fix_after(&Settings { time_limit_s: 600.0, ..quick() }, &Drive::default(), AZIMUTH_DEG, u64::MAX, ahead_s);
        assert!(matches!(fix, Some(Ok(_))), "{ahead_s}: {fix:?}");
        // Four dwells of a minute, and the moves between them.
        let mut too_short = Settings { time_limit_s: 240.0, ..quick() };
        too_short.sequence.dwell_s = 60;
        too_short.sequence.order = order::Order::Plain;
        let fix = fix_after(&too_short, &Drive::default(), AZIMUTH_DEG, u64::MAX, ahead_s);
        assert_eq!(fix.map(|fix| fix.err()), Some(Some(Fault::OutOfTime)), "{ahead_s}");
    }
}

/// A fix on a still base, from where the drive stands, with the power cut at a tick. The gyro reads 12.358 °/h · cos(azimuth − θ) at 34.75° north and
/// ± 0.001 °/h in turn, the encoder in steps of 1/16384 of a turn. The fix, or the fault; none if the power went before.
fn power_up(settings: &Settings, drive: &Drive, azimuth_deg: f64, cut: u64) -> Option<Result<Fix, Fault>> {
    fix_after(settings, drive, azimuth_deg, cut, 0.0)
}

/// The same with a gyro whose clock is ahead by so much at the start.
fn fix_after(
    settings: &Settings,
    drive: &Drive,
    azimuth_deg: f64,
    cut: u64,
    ahead_s: f64,
) -> Option<Result<Fix, Fault>> {
    settings.validate().unwrap();
    let declared = settings.declared().unwrap();
    let north_deg_h = declared.earth.north_deg_h;
    let mut sequencer = Sequencer::empty();
    sequencer.set_up(settings.rules(), declared, &mut ErrorModel::default());
    let mut motor = StepMotor::new(StepPin(drive), DirectionPin(drive), EnablePin, &settings.index);
    let mut verdict = None;
    let mut sink = |event| match event {
        Event::Fix(fix) => verdict = Some(Ok(fix)),
        Event::Fault { fault, .. } => verdict = Some(Err(fault)),
        _ => {}
    };
    let before = Second { conditions: Conditions { t_s: ahead_s - 0.5, ..Conditions::default() }, ..Second::default() };
    sequencer.correct(&before, IndexAngle::default(), 0.0);
    sequencer.start(0.0, &mut sink);
    let (mut tick, mut pending, mut direction) = (0_u64, None, Direction::default());
    let mut index = IndexAngle::default();
    while sequencer.is_active() && tick < cut {
        for _ in 0..SLOTS_PER_TICK {
            motor.slot();
        }
        tick += 1;
        let t_s = tick as f64 * SAMPLE_S;
        let index_deg = f64::from(drive.position.get()) / settings.index.microsteps_per_deg();
        let read = IndexCode((libm::round(index_deg / 360.0 * 16384.0) as i32 as u32) << 18);
        let now = Direction::of_deg(index_deg);
        (direction.cos, direction.sin) = (direction.cos + now.cos, direction.sin + now.sin);
        if let Some(command) = pending.take() {
            motor.command(command);
        }
        let fresh = tick.is_multiple_of(4);
        if fresh {
            index.push(read);
        }
        pending = sequencer.tick(tick, index, fresh, motor.is_turning(), &mut sink);
        if tick.is_multiple_of(SAMPLES_PER_SECOND.into()) {
            let samples = f64::from(SAMPLES_PER_SECOND);
            let mean = Direction { cos: direction.cos / samples, sin: direction.sin / samples };
            direction = Direction::default();
            let along = Direction::of_deg(azimuth_deg);
            let dither = if (tick / u64::from(SAMPLES_PER_SECOND)).is_multiple_of(2) { 1e-3 } else { -1e-3 };
            let conditions = Conditions {
                t_s: ahead_s + t_s - 0.5,
                raw_rate_deg_h: north_deg_h * (mean.cos * along.cos + mean.sin * along.sin) + dither,
                index: Some(mean),
                level: Specific::new(0.0, 0.0),
                ..Conditions::default()
            };
            let second = Second { conditions, ..Second::default() };
            let corrected = sequencer.correct(&second, index, t_s);
            let (_, command) = sequencer.second(&corrected, &mut sink);
            pending = command.or(pending);
        }
    }
    verdict
}

/// Short dwells and all the time in the world.
fn quick() -> Settings {
    let mut settings = Settings { latitude_deg: 34.75, time_limit_s: 86_400.0, ..Settings::default() };
    (settings.sequence.dwell_s, settings.sequence.coarse_dwell_s) = (4, 4);
    settings
}

fn works(settings: &Settings, what: &str) {
    match run(settings) {
        Ok(fix) => {
            let error_deg = wrap_180_deg(fix.azimuth_deg - AZIMUTH_DEG);
            assert!(error_deg.abs() < 4.0 * fix.sigma_deg, "{what}: {error_deg} ± {}", fix.sigma_deg);
        }
        Err(fault) => panic!("{what}: {}", fault.name()),
    }
}

#[test]
fn every_order_with_its_shortest_dwells() {
    use order::Order::{EastWest, Mirrored, Plain, Source};
    for order in [Plain, Source, Mirrored, EastWest, order::Order::Custom([300.0, -700.0, 10.0].into_iter().collect())]
    {
        let mut settings = quick();
        (settings.sequence.dwell_s, settings.sequence.coarse_dwell_s) = (2, 2);
        settings.sequence.order = order.clone();
        works(&settings, &std::format!("{order:?}"));
    }
}

#[test]
fn every_order_with_its_longest_dwells() {
    for order in [order::Order::Plain, order::Order::EastWest] {
        let mut settings = quick();
        (settings.sequence.dwell_s, settings.sequence.coarse_dwell_s) = (3600, 3600);
        settings.sequence.order = order.clone();
        works(&settings, &std::format!("{order:?}"));
    }
}

#[test]
fn the_limits_of_the_drive() {
    for speed_deg_s in [0.1, 0.2, 0.3, 1.0, 30.0] {
        for acceleration_deg_s2 in [1.0, 60.0, 1000.0] {
            let mut settings = quick();
            settings.sequence.order = order::Order::Plain;
            (settings.index.speed_deg_s, settings.index.acceleration_deg_s2) = (speed_deg_s, acceleration_deg_s2);
            works(&settings, &std::format!("{speed_deg_s} °/s, {acceleration_deg_s2} °/s²"));
        }
    }
    for (tolerance_deg, sigma_deg, retries) in [(0.02, 0.0, 20), (10.0, 10.0, 0)] {
        let mut settings = quick();
        settings.index = IndexSettings { tolerance_deg, sigma_deg, retries, ..IndexSettings::default() };
        works(&settings, &std::format!("± {tolerance_deg}°, {sigma_deg}°, {retries} retries"));
    }
}

/// A motor of 200 steps with 16 microsteps, on a gear of 1 to 3.
#[test]
fn another_motor_is_a_setting() {
    for (microsteps_per_turn, speed_deg_s) in [(9600, 30.0), (200, 30.0), (1_000_000, 1.0)] {
        let mut settings = quick();
        settings.sequence.order = order::Order::Plain;
        settings.index =
            IndexSettings { microsteps_per_turn, speed_deg_s, tolerance_deg: 2.0, ..IndexSettings::default() };
        works(&settings, &std::format!("{microsteps_per_turn} microsteps"));
    }
}

/// The power goes at any moment of a fix, in any order, at any heading, and the next fix begins where the spindle stands then: the cable is never wound up.
#[test]
fn the_spindle_stays_within_its_turn_over_power_cycles() {
    use order::Order::{EastWest, Mirrored, Plain, Source};
    let custom = order::Order::Custom([355.0, -5.0, 720.0, 354.9, 120.0, -240.0].into_iter().collect());
    let rotation = order::Order::Rotation { passes: 4 };
    let orders = [Plain, Source, Mirrored, EastWest, order::Order::ADAPTIVE, custom, rotation];
    let drive = Drive::default();
    // A multiplicative generator modulo 2³¹ − 1 (Park and Miller 1988).
    let mut state = 20_261_u64;
    let mut draw = |most: u64| {
        state = state * 48_271 % 2_147_483_647;
        state % most
    };
    let mut settings = quick();
    (settings.sequence.dwell_s, settings.sequence.coarse_dwell_s) = (2, 2);
    let turn = f64::from(settings.index.microsteps_per_turn);
    let mut fixes = 0;
    for cycle in 0..10_000 {
        settings.sequence.order = orders[draw(7) as usize].clone();
        let azimuth_deg = draw(3600) as f64 / 10.0;
        let ended = power_up(&settings, &drive, azimuth_deg, draw(120 * 400));
        fixes += u32::from(matches!(ended, Some(Ok(_))));
        assert!(!matches!(ended, Some(Err(_))), "{cycle}: {ended:?}");
        let [low, high] = [drive.low.get(), drive.high.get()].map(|steps| f64::from(steps) / turn * 360.0);
        assert!(low >= -5.0 && high <= 355.0, "cycle {cycle}, {:?}: {low} to {high}", settings.sequence.order);
    }
    assert!(fixes > 1000, "{fixes}");
}

#[test]
fn the_limits_of_gates_and_level() {
    let change = |change: fn(&mut Settings)| {
        let mut settings = quick();
        change(&mut settings);
        settings
    };
    for settings in [
        change(|settings| (settings.disturbance.seconds, settings.disturbance.timeout_s) = (1, 1.0)),
        change(|settings| (settings.disturbance.seconds, settings.disturbance.timeout_s) = (600, 600.0)),
        change(|settings| (settings.jitter.seconds, settings.jitter.timeout_s) = (1, 2.0)),
        change(|settings| (settings.jitter.seconds, settings.jitter.timeout_s) = (600, 601.0)),
        change(|settings| (settings.level.seconds, settings.level.timeout_s) = (1, 1.0)),
        change(|settings| (settings.level.seconds, settings.level.timeout_s) = (60, 60.0)),
        change(|settings| settings.level.limit_deg = 0.001),
        change(|settings| settings.disturbance.threshold_deg_h = 4e5),
        change(|settings| settings.gyro.arw_deg_per_sqrt_h = 0.0),
    ] {
        works(&settings, &std::format!("{settings:?}"));
    }
}

/// Two passes at 30 °/s and at 5 °/s; and one too fast for its ramps, and an odd number of passes, which are refused.
#[test]
fn a_rotation_at_the_limits_of_its_speed() {
    for speed_deg_s in [30.0, 5.0] {
        let mut settings = quick();
        settings.sequence.order = order::Order::Rotation { passes: 2 };
        settings.index.speed_deg_s = speed_deg_s;
        works(&settings, &std::format!("{speed_deg_s} °/s"));
    }
    let mut settings = quick();
    settings.sequence.order = order::Order::Rotation { passes: 3 };
    assert_eq!(settings.validate().unwrap_err().field, "sequence.order.rotation.passes");
    settings.sequence.order = order::Order::Rotation { passes: 2 };
    settings.index.acceleration_deg_s2 = 1.0;
    assert_eq!(settings.validate().unwrap_err().field, "index.speed_deg_s");
}

/// A wait that is shorter than what it waits for would end every fix.
#[test]
fn a_wait_that_cannot_end_well_is_refused() {
    for (field, change) in [
        ("disturbance.timeout_s", (|settings| settings.disturbance.timeout_s = 2.0) as fn(&mut Settings)),
        ("jitter.timeout_s", |settings| settings.jitter.timeout_s = 5.0),
        ("level.timeout_s", |settings| (settings.level.seconds, settings.level.timeout_s) = (5, 4.0)),
    ] {
        let mut settings = quick();
        change(&mut settings);
        assert_eq!(settings.validate().unwrap_err().field, field);
    }
}
