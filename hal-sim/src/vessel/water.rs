//! Log, depth gauge, heading aid and acoustic fixes.

use super::globe;
use super::ship::Instant;
use crate::noise::{Source, Stream};

/// How well they work.
#[derive(Clone, Copy, Debug)]
pub struct WaterClass {
    pub log_m_s: f64,
    pub log_scale_percent: f64,
    pub depth_m: f64,
    pub acoustic_m: f64,
    /// Share of acoustic fixes that are wrong, by hundreds of metres.
    pub acoustic_outliers: f64,
    pub heading_deg: f64,
}

impl WaterClass {
    /// Doppler log of 0.05 m/s and 0.3 %, depth to 0.3 m, acoustic fixes to 5 m of which one in fifty is wrong, heading
    /// to 0.3°.
    pub const USUAL: Self = Self {
        log_m_s: 0.05,
        log_scale_percent: 0.3,
        depth_m: 0.3,
        acoustic_m: 5.0,
        acoustic_outliers: 0.02,
        heading_deg: 0.3,
    };
}

/// The instruments.
#[derive(Clone, Debug)]
pub struct WaterInstruments {
    class: WaterClass,
    gain: f64,
    noise: Stream,
}

impl WaterInstruments {
    pub fn new(class: WaterClass, seed: u64) -> Self {
        let mut noise = Stream::new(seed, Source::Water);
        let gain = 1.0 + 0.01 * class.log_scale_percent * noise.normal();
        Self { class, gain, noise }
    }

    /// Speed through the water to starboard and forward, m/s.
    pub fn log_m_s(&mut self, at: &Instant) -> [f64; 2] {
        let through = at.velocity_m_s - at.east_north_up() * at.water_m_s;
        let hull = at.hull.inverse() * through;
        [hull.x, hull.y].map(|speed| self.gain * speed + self.class.log_m_s * self.noise.normal())
    }

    /// Height above the ellipsoid by the depth gauge, m.
    pub fn height_m(&mut self, at: &Instant) -> f64 {
        globe::geodetic(&at.position_m).2 + self.class.depth_m * self.noise.normal()
    }

    /// Heading of the hull, degrees.
    pub fn heading_deg(&mut self, at: &Instant) -> f64 {
        at.heading_deg() + self.class.heading_deg * self.noise.normal()
    }

    /// Latitude and longitude, degrees; now and then wrong.
    pub fn acoustic_fix(&mut self, at: &Instant) -> (f64, f64) {
        let wrong = self.noise.uniform() < self.class.acoustic_outliers;
        let sigma = if wrong { 300.0 } else { self.class.acoustic_m };
        let axes = at.east_north_up();
        let error = axes.column(0) * (sigma * self.noise.normal()) + axes.column(1) * (sigma * self.noise.normal());
        let (latitude, longitude, _) = globe::geodetic(&(at.position_m + error));
        (latitude, longitude)
    }
}
