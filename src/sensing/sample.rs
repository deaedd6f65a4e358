//! Frames to one-second rates.
//!
//! A second is exactly 400 slots of 2.5 ms, told apart by the gyro's sequence numbers. A slot whose frame never came,
//! or came marked invalid, is *missing*. With at most `repairable_frames` missing, the mean of the others stands in for
//! them and the second is used, counted as repaired. With more it is left out, counted, and the dwell lasts a second
//! longer. No second is silently the mean of fewer samples.

use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::frame::{Frame, GyroFormat};
use super::ripple::Ripple;
use crate::health::Counters;

/// Samples in a second.
pub const SAMPLES_PER_SECOND: u16 = 400;
/// Seconds between samples.
pub const SAMPLE_S: f64 = 0.0025;
/// After this many ticks without a frame, slots count as lost with every further tick: below half of the shortest sequence.
const GIVE_UP_TICKS: u16 = 60;
/// A frame that comes more than this many ticks later than the promptest of the second before is counted as late: four are two seconds of a clock that
/// is 0.5 % slow.
const LATE_TICKS: i32 = 6;

/// What is declared about the gyro. The noise figures are what the azimuth's sigma never falls below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GyroSettings {
    pub format: GyroFormat,
    /// Angle random walk, °/√h.
    pub arw_deg_per_sqrt_h: f64,
    /// White noise of the angle at one moment, arcsec: counts, dither, a ring laser. A rate over any time has √2 of it at its ends.
    pub angle_noise_arcsec: f64,
    /// Bias instability (the floor of the Allan deviation), °/h.
    pub bias_instability_deg_h: f64,
    /// One sigma of the linear bias drift during a fix, °/h per hour.
    pub drift_deg_h_per_h: f64,
    /// Largest bias that is left after the error model, °/h.
    pub bias_limit_deg_h: f64,
    /// Largest rate that the gyro can read, °/h.
    pub range_deg_h: f64,
    /// Most missing frames that a second of 400 may have and still be repaired; more and it is left out.
    pub repairable_frames: u16,
    /// The gyro is set up over its line at the start (KVH's family); else it is taken for what was set by hand.
    pub configure: bool,
}

impl Default for GyroSettings {
    fn default() -> Self {
        Self {
            format: GyroFormat::Compact,
            arw_deg_per_sqrt_h: 0.0015,
            angle_noise_arcsec: 0.0,
            bias_instability_deg_h: 0.002,
            drift_deg_h_per_h: 0.1,
            bias_limit_deg_h: 1.0,
            range_deg_h: 500_000.0,
            repairable_frames: 8,
            configure: false,
        }
    }
}

impl GyroSettings {
    /// What the fields together must be.
    ///
    /// Errors: a gyro that takes no commands is to be told what to send.
    pub fn validate(&self) -> Result<(), Invalid> {
        let fits = !self.configure || self.format == GyroFormat::KvhA;
        if fits { Ok(()) } else { Err(Invalid::new("gyro.configure", 1.0, "false, where gyro.format is not kvh-a")) }
    }

    /// Declared noise of a one-second rate, °/h.
    pub fn noise_deg_h(&self) -> f64 {
        libm::hypot(self.white_noise_deg_h(), core::f64::consts::SQRT_2 * self.angle_noise_arcsec)
    }

    /// What of it averages out as white noise of the rate.
    pub fn white_noise_deg_h(&self) -> f64 {
        60.0 * self.arw_deg_per_sqrt_h
    }
}

/// One finished second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateSecond {
    /// Angle as the gyro gave it, arcsec: its mean rate in °/h.
    pub fog_arcsec: f64,
    /// First moment of the angle about the middle of the second, arcsec · s.
    pub moment_arcsec_s: f64,
    /// Root mean square distance of the angle's path within the second from a straight line, arcsec: what oscillates.
    pub ripple_arcsec: f64,
    /// Mean temperature of the gyro, °C, if it tells one.
    pub temp_c: Option<f64>,
    /// Slots without a valid frame.
    pub missing: u16,
    /// Slots whose frame was marked invalid, and those marked saturated or beyond the range; both are also missing.
    pub invalid: u16,
    pub saturated: u16,
    /// Every increment was the same: no living gyro does that for long.
    pub constant: bool,
    /// Few enough are missing.
    pub usable: bool,
}

/// Takes frames and ticks, gives seconds.
#[derive(Clone, Debug)]
pub struct Sampler {
    gyro: GyroSettings,
    /// Increments from this many counts on are beyond the gyro's range.
    range: u64,
    expected: Option<u8>,
    /// Ticks since the first frame, minus slots accounted for: grows where the gyro's clock is slow.
    behind: i32,
    /// The least of it in the second before, and in the second under way.
    prompt: i32,
    promptest: i32,
    /// Ticks since a slot's frame came, and frames since then that are of no slot.
    silent: u16,
    of_no_slot: u16,
    good: u32,
    second: Partial,
}

#[derive(Clone, Copy, Debug, Default)]
struct Partial {
    slots: u16,
    good: u16,
    invalid: u16,
    saturated: u16,
    /// Sum of increments, counts.
    angle: i64,
    /// Sum of increments times the distance of their middle from the second's, counts · half samples.
    moment: i64,
    /// The path of the angle, counts, over good samples.
    ripple: Ripple,
    temperature_sum: i32,
    temperatures: u16,
    first: Option<i64>,
    changed: bool,
}

impl Sampler {
    pub fn new(gyro: GyroSettings) -> Self {
        let range = libm::ceil(gyro.range_deg_h * SAMPLE_S / gyro.format.arcsec_per_count()) as u64;
        Self {
            gyro,
            range,
            expected: None,
            behind: 0,
            prompt: 0,
            promptest: i32::MAX,
            silent: 0,
            of_no_slot: 0,
            good: 0,
            second: Partial::default(),
        }
    }

    /// Takes a frame; gives the second that it completes.
    pub fn frame(&mut self, frame: &Frame, counters: &mut Counters) -> Option<RateSecond> {
        let modulus = self.gyro.format.sequence_modulus();
        let expected = *self.expected.get_or_insert(frame.sequence);
        let mut ahead = (u16::from(frame.sequence) + modulus - u16::from(expected) % modulus) % modulus;
        if ahead >= modulus / 2 {
            counters.frames_duplicate = counters.frames_duplicate.saturating_add(1);
            self.of_no_slot = self.of_no_slot.saturating_add(1);
            if self.of_no_slot < SAMPLES_PER_SECOND {
                return None;
            }
            // For a second no other frame came: the gyro has started again and counts anew.
            (self.expected, ahead) = (Some(frame.sequence), 0);
        }
        (self.silent, self.of_no_slot) = (0, 0);
        if ahead == 0 {
            return self.take(frame, counters);
        }
        // Fewer slots are skipped than a second has, so at most one second ends here.
        let before = (0..ahead).fold(None, |finished, _| self.lose_slot(counters).or(finished));
        self.take(frame, counters).or(before)
    }

    /// Takes the frame that belongs to the slot.
    fn take(&mut self, frame: &Frame, counters: &mut Counters) -> Option<RateSecond> {
        counters.frames_good = counters.frames_good.saturating_add(1);
        self.promptest = self.promptest.min(self.behind);
        if self.behind.saturating_sub(self.prompt) > LATE_TICKS {
            counters.frames_late = counters.frames_late.saturating_add(1);
        }
        let second = &mut self.second;
        if let Some(temperature) = frame.temperature {
            second.temperature_sum += i32::from(temperature);
            second.temperatures += 1;
        }
        let saturated = frame.saturated || frame.increment.unsigned_abs() >= self.range;
        if saturated || !frame.valid {
            counters.frames_invalid = counters.frames_invalid.saturating_add(1);
            second.invalid += u16::from(!frame.valid);
            second.saturated += u16::from(saturated);
        } else {
            second.good += 1;
            self.good = self.good.wrapping_add(1);
            second.changed |= *second.first.get_or_insert(frame.increment) != frame.increment;
            second.angle += frame.increment;
            second.ripple.push(f64::from(second.good), second.angle as f64);
            second.moment += frame.increment * (2 * i64::from(second.slots) + 1 - i64::from(SAMPLES_PER_SECOND));
        }
        self.next_slot()
    }

    /// A tick of the instrument's clock: a frame has become due. Gives the second that a given-up frame completes.
    pub fn tick(&mut self, counters: &mut Counters) -> Option<RateSecond> {
        self.expected?;
        self.behind = self.behind.saturating_add(1);
        self.silent = self.silent.saturating_add(1);
        if self.silent > GIVE_UP_TICKS { self.lose_slot(counters) } else { None }
    }

    /// Slots by which the frames are behind the instrument's clock. Constant when both clocks agree.
    pub fn behind(&self) -> i64 {
        self.behind.into()
    }

    /// A frame that is known to be lost; gives the second that it completes.
    pub fn lose_slot(&mut self, counters: &mut Counters) -> Option<RateSecond> {
        counters.frames_lost = counters.frames_lost.saturating_add(1);
        self.next_slot()
    }

    /// Good frames so far, over all seconds.
    pub fn good(&self) -> u32 {
        self.good
    }

    /// Slots of the second under way that are accounted for.
    pub fn slots(&self) -> u16 {
        self.second.slots
    }

    fn next_slot(&mut self) -> Option<RateSecond> {
        let modulus = self.gyro.format.sequence_modulus();
        self.expected = self.expected.map(|sequence| ((u16::from(sequence) + 1) % modulus) as u8);
        self.behind = self.behind.saturating_sub(1);
        self.second.slots += 1;
        if self.second.slots < SAMPLES_PER_SECOND {
            return None;
        }
        if self.promptest < i32::MAX {
            self.prompt = core::mem::replace(&mut self.promptest, i32::MAX);
        }
        let second = core::mem::take(&mut self.second);
        let missing = SAMPLES_PER_SECOND - second.good;
        // All 400 there: the plain sum, untouched by a division.
        let stretch = match (missing, second.good) {
            (0, _) => 1.0,
            (_, 0) => 0.0,
            (_, good) => f64::from(SAMPLES_PER_SECOND) / f64::from(good),
        };
        let format = self.gyro.format;
        let temp_c = (second.temperatures > 0)
            .then(|| f64::from(second.temperature_sum) * format.c_per_count() / f64::from(second.temperatures));
        Some(RateSecond {
            fog_arcsec: second.angle as f64 * format.arcsec_per_count() * stretch,
            moment_arcsec_s: second.moment as f64 * (0.5 * SAMPLE_S * format.arcsec_per_count()) * stretch,
            ripple_arcsec: second.ripple.rms() * format.arcsec_per_count(),
            temp_c,
            missing,
            invalid: second.invalid,
            saturated: second.saturated,
            constant: second.good > 1 && !second.changed,
            usable: missing <= self.gyro.repairable_frames,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u32) -> Frame {
        Frame {
            sequence: (number % 256) as u8,
            // 0.03 arcsec.
            increment: 30_000,
            temperature: Some(2000),
            valid: true,
            saturated: false,
        }
    }

    /// Feeds frames `numbers`, one a tick; the seconds and the counters.
    fn run(frames: impl Iterator<Item = Frame>) -> (heapless::Vec<RateSecond, 8>, Counters) {
        let mut sampler = Sampler::new(GyroSettings::default());
        let (mut seconds, mut counters) = (heapless::Vec::new(), Counters::default());
        for frame in frames {
            let by_tick = sampler.tick(&mut counters);
            let by_frame = sampler.frame(&frame, &mut counters);
            for second in by_tick.into_iter().chain(by_frame) {
                seconds.push(second).unwrap();
            }
        }
        (seconds, counters)
    }

    #[test]
    fn four_hundred_increments_make_a_second() {
        let (seconds, counters) = run((0..1200).map(frame));
        assert_eq!(seconds.len(), 3);
        // 400 · 0.03 arcsec in a second is 12 arcsec, and arcsec per second is °/h.
        assert!(seconds.iter().all(|s| (s.fog_arcsec - 12.0).abs() < 1e-9 && s.missing == 0 && s.usable));
        assert_eq!(counters, Counters { frames_good: 1200, ..Default::default() });
    }

    #[test]
    fn a_few_lost_frames_are_repaired_and_counted() {
        let (seconds, counters) = run((0..800).filter(|n| !(100..105).contains(n)).map(frame));
        assert_eq!(seconds.len(), 2);
        assert_eq!((seconds[0].missing, seconds[0].usable, counters.frames_lost), (5, true, 5));
        assert!((seconds[0].fog_arcsec - 12.0).abs() < 1e-9);
        assert_eq!(seconds[1].missing, 0);
    }

    #[test]
    fn a_loss_across_the_boundary_is_shared_out() {
        let (seconds, _) = run((0..800).filter(|n| !(398..403).contains(n)).map(frame));
        assert_eq!((seconds[0].missing, seconds[1].missing), (2, 3));
    }

    #[test]
    fn many_lost_frames_make_a_second_unusable() {
        let (seconds, _) = run((0..800).filter(|n| !(100..109).contains(n)).map(frame));
        assert_eq!((seconds[0].missing, seconds[0].usable, seconds[1].usable), (9, false, true));
    }

    #[test]
    fn duplicates_and_stragglers_are_not_counted_twice() {
        let numbers = (0..400)
            .flat_map(|n| if n == 50 { [50, 50, 48] } else { [n, n, n] }.into_iter().take(if n == 50 { 3 } else { 1 }));
        let (seconds, counters) = run(numbers.map(frame));
        assert_eq!((seconds.len(), counters.frames_duplicate, counters.frames_lost), (1, 2, 0));
        assert!((seconds[0].fog_arcsec - 12.0).abs() < 1e-9);
    }

    #[test]
    fn invalid_and_saturated_frames_are_missing() {
        let frames = (0..400).map(|n| match n {
            10 => Frame { valid: false, ..frame(n) },
            20 => Frame { saturated: true, ..frame(n) },
            30 => Frame { increment: 1_250_000_000, ..frame(n) }, // 1250 arcsec: 500 000 °/h, the range
            _ => frame(n),
        });
        let (seconds, counters) = run(frames);
        assert_eq!((seconds[0].missing, seconds[0].invalid, seconds[0].saturated), (3, 1, 2));
        assert_eq!(counters.frames_invalid, 3);
    }

    /// A clock that is 0.5 % slow is 60 ticks behind after 30 s, and 500 after 250 s: no frame is late or lost.
    #[test]
    fn a_slow_clock_of_the_gyro_loses_nothing() {
        let mut sampler = Sampler::new(GyroSettings::default());
        let (mut counters, mut seconds) = (Counters::default(), 0);
        for tick in 0..100_000_u32 {
            assert_eq!(sampler.tick(&mut counters), None);
            if tick % 200 != 199 {
                let second = sampler.frame(&frame(tick - tick / 200), &mut counters);
                seconds += second.map_or(0, |second| u32::from(second.missing == 0 && second.usable));
            }
        }
        assert_eq!((seconds, counters), (248, Counters { frames_good: 99_500, ..Default::default() }));
        assert_eq!(sampler.behind(), 499);
    }

    /// After 61 s, and 800 ticks of silence of which 740 slots are given up, 25,140 or 52 is expected. A gyro that counts from 100 is 48 ahead, and these slots are
    /// lost. One that counts from 0 or 30 is 204 or 234 ahead: its frames look like stragglers for a second.
    #[test]
    fn a_gyro_that_starts_again_is_heard_again() {
        for first in [0, 30, 100] {
            let mut sampler = Sampler::new(GyroSettings::default());
            let (mut counters, mut usable) = (Counters::default(), 0);
            let mut tick = |number: Option<u32>, counters: &mut Counters| {
                let by_tick = sampler.tick(counters);
                let by_frame = number.and_then(|number| sampler.frame(&frame(number), counters));
                usable += by_tick.into_iter().chain(by_frame).filter(|second| second.usable).count();
            };
            (0..24_400).for_each(|number| tick(Some(number), &mut counters));
            (0..800).for_each(|_| tick(None, &mut counters));
            (first..first + 4000).for_each(|number| tick(Some(number), &mut counters));
            assert!(usable >= 61 + 7, "{first}: {usable} {counters:?}");
        }
    }

    #[test]
    fn silence_ends_seconds_as_unusable() {
        let mut sampler = Sampler::new(GyroSettings::default());
        let mut counters = Counters::default();
        sampler.frame(&frame(0), &mut counters);
        let second = (0..1000).find_map(|_| sampler.tick(&mut counters)).unwrap();
        assert_eq!((second.missing, second.usable, second.fog_arcsec), (399, false, 400.0 * 0.03));
        // The frames that come after it continue the count: 600 ticks are due, 60 of them not yet given up.
        let lost_before = counters.frames_lost;
        sampler.frame(&frame(lost_before + 1), &mut counters);
        assert_eq!(counters.frames_lost, lost_before);
    }
}
