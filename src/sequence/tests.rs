//! Whatever validates works: every limit of the settings, on a still base with the drive and a quiet gyro.

extern crate std;

use core::cell::Cell;
use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};

use super::*;
use crate::codes::IndexCode;
use crate::drivers::step_motor::{SLOTS_PER_TICK, StepMotor};
use crate::effects::{Conditions, ErrorModel};
use crate::index::{Direction, MICROSTEPS_PER_DEG};
use crate::sample::{SAMPLE_S, SAMPLES_PER_SECOND};
use crate::settings::Settings;
use crate::units::wrap_180_deg;

const AZIMUTH_DEG: f64 = 40.0;

/// Step, direction and enable of a drive that follows, microsteps from the mark.
#[derive(Default)]
struct Drive {
    position: Cell<i32>,
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
        self.0.position.set(self.0.position.get() + if self.0.forward.get() { 1 } else { -1 });
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

/// A fix on a still base. The gyro reads 12.358 °/h · cos(40° − θ) at 34.75° north and ± 0.001 °/h in turn, the encoder in
/// steps of 1/16384 of a turn. The fix, or the fault.
fn run(settings: &Settings) -> Result<Fix, Fault> {
    settings.validate().unwrap();
    let declared = settings.declared()?;
    let north_deg_h = declared.earth.north_deg_h;
    let mut sequencer = Sequencer::empty();
    sequencer.set_up(settings.rules(), declared, &mut ErrorModel::default());
    let drive = Drive::default();
    let mut motor = StepMotor::new(StepPin(&drive), DirectionPin(&drive), EnablePin, &settings.index);
    let mut verdict = None;
    let mut sink = |event| match event {
        Event::Fix(fix) => verdict = Some(Ok(fix)),
        Event::Fault { fault, .. } => verdict = Some(Err(fault)),
        _ => {}
    };
    sequencer.start(0.0, &mut sink);
    let (mut tick, mut pending, mut direction) = (0_u64, None, Direction::default());
    let mut index = IndexAngle::default();
    while sequencer.is_active() {
        for _ in 0..SLOTS_PER_TICK {
            motor.slot();
        }
        tick += 1;
        let t_s = tick as f64 * SAMPLE_S;
        let index_deg = f64::from(drive.position.get()) / f64::from(MICROSTEPS_PER_DEG);
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
            let along = Direction::of_deg(AZIMUTH_DEG);
            let dither = if (tick / u64::from(SAMPLES_PER_SECOND)).is_multiple_of(2) { 1e-3 } else { -1e-3 };
            let conditions = Conditions {
                t_s: t_s - 0.5,
                raw_rate_deg_h: north_deg_h * (mean.cos * along.cos + mean.sin * along.sin) + dither,
                index: Some(mean),
                level: Specific::new(0.0, 0.0),
                ..Conditions::default()
            };
            let second = Second { conditions, ..Second::default() };
            let corrected = sequencer.correct(&second, index);
            let (_, command) = sequencer.second(&corrected, &mut sink);
            pending = command.or(pending);
        }
    }
    verdict.unwrap()
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
