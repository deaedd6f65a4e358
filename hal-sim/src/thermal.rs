//! Temperatures of the gyro and of the housing: each one thermal mass between its own heat and the air.

use crate::scenario::{Gyro, Site};
use std::f64::consts::TAU;

/// Temperature, its rate, and the hysteresis state that follows it.
#[derive(Debug, Clone)]
pub struct Thermal {
    ambient_c: f64,
    ambient_k_s: f64,
    wave_k: f64,
    wave_period_s: f64,
    self_heating_k: f64,
    tau_s: f64,
    width_k: f64,
    temp_c: f64,
    rate_k_s: f64,
    follower_c: f64,
}

impl Thermal {
    /// The gyro at switch-on.
    pub fn new(site: &Site, gyro: &Gyro) -> Self {
        let temp_c = site.ambient_c + gyro.start_offset_k;
        Self {
            ambient_c: site.ambient_c,
            ambient_k_s: site.ambient_k_h / 3600.0,
            wave_k: site.ambient_wave_k,
            wave_period_s: site.ambient_wave_period_s,
            self_heating_k: gyro.self_heating_k,
            tau_s: gyro.thermal_tau_s,
            width_k: gyro.hysteresis_width_k,
            temp_c,
            rate_k_s: 0.0,
            follower_c: temp_c,
        }
    }

    /// The housing at switch-on: as warm as the air, without heat of its own.
    pub fn of_housing(site: &Site, gyro: &Gyro) -> Self {
        let housing =
            Gyro { start_offset_k: 0.0, self_heating_k: 0.0, thermal_tau_s: gyro.housing_tau_s, ..gyro.clone() };
        Self::new(site, &housing)
    }

    /// The air becomes warmer by this, at once.
    pub fn warm_the_air(&mut self, kelvin: f64) {
        self.ambient_c += kelvin;
    }

    /// Moves on by `dt_s` to `t_s`.
    pub fn advance(&mut self, t_s: f64, dt_s: f64) {
        let mut goal_c = self.ambient_c + self.self_heating_k + self.ambient_k_s * t_s;
        if self.wave_k > 0.0 {
            goal_c += self.wave_k * (TAU * t_s / self.wave_period_s).sin();
        }
        let change_k = (goal_c - self.temp_c) * -(-dt_s / self.tau_s).exp_m1();
        self.temp_c += change_k;
        self.rate_k_s = change_k / dt_s;
        let half_k = self.width_k / 2.0;
        self.follower_c = self.follower_c.clamp(self.temp_c - half_k, self.temp_c + half_k);
    }

    /// Temperature now, °C.
    pub fn temp_c(&self) -> f64 {
        self.temp_c
    }

    /// Mean rate over the last step, K/s.
    pub fn rate_k_s(&self) -> f64 {
        self.rate_k_s
    }

    /// Where between −1 (has been cooling) and +1 (has been warming) the hysteresis stands.
    pub fn hysteresis(&self) -> f64 {
        (self.temp_c - self.follower_c) / (self.width_k / 2.0)
    }
}
