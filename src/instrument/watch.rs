//! Watches the gyro's stream: silence, status, saturation, a poor link, a wrong clock.

use crate::health::Fault;
use crate::sensing::sample::{GyroSettings, RateSecond, SAMPLES_PER_SECOND};

/// No good frame for this long is silence: 0.5 s.
const SILENT_TICKS: u64 = 200;
/// A gyro that was just switched on may take this long to its first frame: 30 s.
const WAKING_TICKS: u64 = 12_000;
/// Seconds in a row in which most frames are marked invalid or saturated.
const STATUS_SECONDS: u16 = 2;
/// Seconds in a row without any change of the increment.
const CONSTANT_SECONDS: u16 = 5;
/// A coarse gyro that points east counts nothing until its random walk has made a count: it is stuck when it should have made three.
const COUNTS_WALKED: f64 = 3.0;
/// Seconds in a row that had to be left out.
const POOR_SECONDS: u16 = 10;
/// Frames that the gyro's clock may gain or lose on the instrument's between two settings of the mark: 0.5 % of 10 s. A
/// gyro of one family was seen at 962 Hz instead of 1000 with every status bit good.
const SLIP_FRAMES: i64 = 20;
const SLIP_SECONDS: u16 = 2;
const MARK_SECONDS: u16 = 10;

/// Counts of bad seconds in a row.
#[derive(Clone, Debug)]
pub struct GyroWatch {
    /// Silence counts from here.
    since_tick: u64,
    awake: bool,
    constant: u16,
    /// Seconds in a row without any count that make a stuck gyro.
    still_seconds: u16,
    invalid: u16,
    saturated: u16,
    poor: u16,
    slipped: u16,
    mark: Option<(i64, u16)>,
}

impl GyroWatch {
    /// Before anything was heard of this gyro.
    pub fn new(gyro: &GyroSettings) -> Self {
        // Counts of a size have a standard deviation of 1/√12 of it; a rate of 1 °/h over a second is an arcsecond.
        let count_arcsec = libm::sqrt(12.0) * gyro.angle_noise_arcsec;
        let walked = COUNTS_WALKED * count_arcsec / gyro.white_noise_deg_h();
        // Whatever is not finite takes the longest time.
        let still_seconds = (walked * walked).max(f64::from(CONSTANT_SECONDS)) as u16;
        Self {
            since_tick: 0,
            awake: false,
            constant: 0,
            still_seconds,
            invalid: 0,
            saturated: 0,
            poor: 0,
            slipped: 0,
            mark: None,
        }
    }

    /// Begins to count anew at a tick.
    pub fn restart(&mut self, tick: u64) {
        let Self { awake, still_seconds, .. } = *self;
        *self = Self { since_tick: tick, awake, still_seconds, ..Self::new(&GyroSettings::default()) };
    }

    /// A frame with a right check sum came.
    pub fn heard(&mut self, tick: u64) {
        self.since_tick = tick;
        self.awake = true;
    }

    /// At every tick: is there silence?
    pub fn tick(&self, tick: u64) -> Option<Fault> {
        let patience = if self.awake { SILENT_TICKS } else { WAKING_TICKS };
        (tick.saturating_sub(self.since_tick) > patience).then_some(Fault::GyroSilent)
    }

    /// At the end of a second; `behind` is the sampler's measure of the gyro's clock against the instrument's.
    pub fn second(&mut self, second: &RateSecond, behind: i64) -> Option<Fault> {
        let half = SAMPLES_PER_SECOND / 2;
        let run = |count: &mut u16, bad: bool, limit: u16, fault: Fault| {
            *count = if bad { count.saturating_add(1) } else { 0 };
            (*count >= limit).then_some(fault)
        };
        let saturated = run(&mut self.saturated, second.saturated > half, STATUS_SECONDS, Fault::GyroSaturated);
        let invalid = run(&mut self.invalid, second.invalid > half, STATUS_SECONDS, Fault::GyroInvalid);
        let constant_seconds = if second.fog_arcsec == 0.0 { self.still_seconds } else { CONSTANT_SECONDS };
        let constant = run(&mut self.constant, second.constant, constant_seconds, Fault::GyroStuck);
        let (mark, age) = *self.mark.get_or_insert((behind, 0));
        let slips = (behind - mark).abs() > SLIP_FRAMES;
        if !slips {
            self.mark = Some(if age + 1 >= MARK_SECONDS { (behind, 0) } else { (mark, age + 1) });
        }
        let clock = run(&mut self.slipped, slips, SLIP_SECONDS, Fault::GyroClock);
        let poor = run(&mut self.poor, !second.usable, POOR_SECONDS, Fault::LinkPoor);
        saturated.or(invalid).or(clock).or(constant).or(poor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: RateSecond = RateSecond {
        fog_arcsec: 12.0,
        moment_arcsec_s: 0.0,
        ripple_arcsec: 0.0,
        temp_c: None,
        missing: 0,
        invalid: 0,
        saturated: 0,
        constant: false,
        usable: true,
    };

    fn faults(seconds: impl Iterator<Item = (RateSecond, i64)>) -> Option<(usize, Fault)> {
        let mut watch = GyroWatch::new(&GyroSettings::default());
        seconds.enumerate().find_map(|(i, (second, behind))| Some((i, watch.second(&second, behind)?)))
    }

    #[test]
    fn silence_after_half_a_second() {
        let mut watch = GyroWatch::new(&GyroSettings::default());
        watch.heard(1000);
        assert_eq!(watch.tick(1200), None);
        assert_eq!(watch.tick(1201), Some(Fault::GyroSilent));
        watch.heard(1201);
        assert_eq!(watch.tick(1300), None);
        watch.restart(2000);
        assert_eq!((watch.tick(2200), watch.tick(2201)), (None, Some(Fault::GyroSilent)));
    }

    #[test]
    fn a_gyro_may_take_half_a_minute_to_wake() {
        let watch = GyroWatch::new(&GyroSettings::default());
        assert_eq!((watch.tick(12_000), watch.tick(12_001)), (None, Some(Fault::GyroSilent)));
    }

    #[test]
    fn five_constant_seconds() {
        let stuck = RateSecond { constant: true, ..GOOD };
        assert_eq!(faults([(stuck, 0); 6].into_iter()), Some((4, Fault::GyroStuck)));
    }

    /// Counts of 1 arcsec and a random walk of 0.09 arcsec in a second: three counts in (3 / 0.09)² = 1111 s.
    #[test]
    fn a_coarse_gyro_may_count_nothing_and_not_always_the_same() {
        let coarse = GyroSettings { angle_noise_arcsec: 1.0 / libm::sqrt(12.0), ..GyroSettings::default() };
        let stuck_after = |fog_arcsec: f64| {
            let mut watch = GyroWatch::new(&coarse);
            let second = RateSecond { fog_arcsec, constant: true, ..GOOD };
            (1..2000).find(|_| watch.second(&second, 0).is_some())
        };
        assert_eq!((stuck_after(0.0), stuck_after(400.0)), (Some(1111), Some(5)));
    }

    #[test]
    fn status_for_two_seconds() {
        let invalid = RateSecond { invalid: 400, missing: 400, usable: false, ..GOOD };
        assert_eq!(faults([(invalid, 0), (invalid, 0)].into_iter()), Some((1, Fault::GyroInvalid)));
        assert_eq!(faults([(invalid, 0), (GOOD, 0), (invalid, 0)].into_iter()), None);
        let saturated = RateSecond { saturated: 400, missing: 400, usable: false, ..GOOD };
        assert_eq!(faults([(saturated, 0); 2].into_iter()), Some((1, Fault::GyroSaturated)));
    }

    #[test]
    fn ten_poor_seconds() {
        let poor = RateSecond { missing: 50, usable: false, ..GOOD };
        assert_eq!(faults([(poor, 0); 12].into_iter()), Some((9, Fault::LinkPoor)));
    }

    #[test]
    fn a_slow_clock_is_found_and_a_late_link_is_not_one() {
        // 385 frames a second instead of 400: 15 more behind every second.
        assert_eq!(faults((0..9).map(|s| (GOOD, 15 * s))), Some((3, Fault::GyroClock)));
        // A fast one, 1 %.
        assert_eq!(faults((0..20).map(|s| (GOOD, -4 * s))).map(|(_, fault)| fault), Some(Fault::GyroClock));
        // 100 ppm: 0.04 frames a second.
        assert_eq!(faults((0..2000).map(|s| (GOOD, s / 25))), None);
        // A delay of 12 ticks that comes and goes.
        assert_eq!(faults((0..100).map(|s| (GOOD, if s % 7 == 0 { 12 } else { 0 }))), None);
    }
}
