//! The heading after a fix: the block of three gyros carries it while the instrument is moved.

pub mod settings;

use inertial::{Angles, BlockClass, Hold, HoldLimits, HoldSecond, Increment, Motion, Stood};
use serde::{Deserialize, Serialize};

use crate::drivers::adis16505::Increments;
use crate::fix::Fix;
use crate::health::Counters;
use crate::sensing::level::Tilt;
use crate::units::DEG_PER_RAD;
use settings::BlockSettings;

/// Length of a sample of the block, s.
const SAMPLE_S: f64 = 0.01;
/// Samples in a second, and reports of the heading in none.
const SAMPLES_PER_SECOND: u16 = 100;
/// How fast a hand can make it turn faster, °/s²: what it may have done in a gap.
const HAND_DEG_S2: f64 = 500.0;
/// One sigma of the levels of a fix without level accelerometers, degrees.
const UNKNOWN_LEVEL_DEG: f64 = 1.0;

/// Orientation at the end of a second, as it is held since the last fix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Heading {
    /// Azimuth of the index-zero mark, degrees clockwise from true north, in [0°, 360°).
    pub heading_deg: f64,
    /// Nose up positive, degrees.
    pub pitch_deg: f64,
    /// Left side up positive, degrees.
    pub roll_deg: f64,
    /// One sigma of the heading, degrees.
    pub sigma_deg: f64,
    /// One sigma of pitch and roll, degrees.
    pub sigma_level_deg: f64,
    /// What the instrument did in the second.
    pub motion: Motion,
    /// Sigma has passed its limit: a new fix is asked for.
    pub refix: bool,
}

impl From<HoldSecond> for Heading {
    fn from(second: HoldSecond) -> Self {
        let Angles { heading_deg, pitch_deg, roll_deg } = second.angles;
        Self {
            heading_deg,
            pitch_deg,
            roll_deg,
            sigma_deg: second.sigma_heading_deg,
            sigma_level_deg: second.sigma_level_deg,
            motion: second.motion,
            refix: second.refix,
        }
    }
}

/// Keeps the heading of the last fix.
#[derive(Clone, Debug)]
pub struct Keeper {
    class: BlockClass,
    limits: HoldLimits,
    latitude_deg: f64,
    /// One sigma of the levels of a fix, degrees.
    level_sigma_deg: f64,
    /// Since the last motion: what a fix needs to tell the gyros' biases.
    stood: Stood,
    /// Since the last fix.
    hold: Option<Hold>,
    /// Rate of the last sample, °/s.
    rate_deg_s: f64,
    /// Samples since the last one that was read, and how many of them the hold knows of.
    missing: u16,
    bridged: u16,
    /// What the next report says, and samples since the last report.
    latest: Option<HoldSecond>,
    since_report: u16,
}

impl Keeper {
    /// Without a fix yet.
    pub fn new(block: &BlockSettings, latitude_deg: f64, level_sigma_deg: f64) -> Self {
        Self {
            class: block.figures(),
            limits: HoldLimits { refix_deg: block.refix_sigma_deg, ..HoldLimits::default() },
            latitude_deg,
            level_sigma_deg,
            stood: Stood::default(),
            hold: None,
            rate_deg_s: 0.0,
            missing: 0,
            bridged: 0,
            latest: None,
            since_report: 0,
        }
    }

    /// A fix: its heading is kept from now on. The instrument stands.
    ///
    /// Never inlined: what it takes of the stack is free again for what comes after it.
    #[inline(never)]
    pub fn fixed(&mut self, fix: &Fix) {
        let level = fix.tilt.unwrap_or(Tilt { pitch_deg: 0.0, roll_deg: 0.0 });
        let level_sigma_deg = if fix.tilt.is_some() { self.level_sigma_deg } else { UNKNOWN_LEVEL_DEG };
        let angles = Angles { heading_deg: fix.azimuth_deg, pitch_deg: level.pitch_deg, roll_deg: level.roll_deg };
        // Without a latitude there is no fix either.
        self.hold =
            Hold::new(&self.class, self.limits, self.latitude_deg, &angles, fix.sigma_deg, level_sigma_deg).ok();
        if let Some(hold) = &mut self.hold {
            hold.learn(&self.stood);
        }
        (self.missing, self.bridged, self.latest, self.since_report) = (0, 0, None, 0);
    }

    /// The block's reading, due every 10 ms; `None`: it failed. Once a second: the heading.
    pub fn push(&mut self, sample: Option<&Increments>, counters: &mut Counters) -> Option<Heading> {
        match sample {
            Some(sample) => self.read(sample, counters),
            None => {
                counters.block_errors = counters.block_errors.saturating_add(1);
                self.missing = self.missing.saturating_add(1);
                if self.missing.saturating_sub(self.bridged) >= SAMPLES_PER_SECOND {
                    self.bridge();
                }
            }
        }
        self.since_report = self.since_report.saturating_add(1);
        if self.since_report < SAMPLES_PER_SECOND {
            return None;
        }
        let latest = self.latest.take()?;
        self.since_report = 0;
        Some(latest.into())
    }

    fn read(&mut self, sample: &Increments, counters: &mut Counters) {
        counters.block_missed = counters.block_missed.saturating_add(sample.missed.into());
        self.missing = self.missing.max(sample.missed);
        if self.missing > self.bridged {
            self.bridge();
        }
        (self.missing, self.bridged) = (0, 0);
        let increment = Increment { angle_rad: sample.angle_rad().into(), velocity_m_s: sample.velocity_m_s().into() };
        self.rate_deg_s = increment.angle_rad.norm() * DEG_PER_RAD / SAMPLE_S;
        self.stood.push(&self.class, SAMPLE_S, &increment);
        let Some(hold) = &mut self.hold else { return };
        let saturated = hold.counters().saturated;
        self.latest = hold.push(SAMPLE_S, increment).or(self.latest);
        let saturated = hold.counters().saturated.saturating_sub(saturated);
        counters.block_saturated = counters.block_saturated.saturating_add(saturated);
    }

    /// Tells the hold of the samples that are missing.
    fn bridge(&mut self) {
        let gap_s = f64::from(self.missing.saturating_sub(self.bridged)) * SAMPLE_S;
        let rate_deg_s = self.rate_deg_s + 0.5 * HAND_DEG_S2 * f64::from(self.missing) * SAMPLE_S;
        self.bridged = self.missing;
        self.stood.interrupt();
        if let Some(hold) = &mut self.hold {
            self.latest = Some(hold.bridge(gap_s, rate_deg_s.min(self.class.range_deg_s)));
        }
    }
}

#[cfg(test)]
mod tests;
