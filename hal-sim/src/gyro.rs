//! What the gyro makes of the angle that it turned: its error model.
//!
//! | effect | law | source |
//! |---|---|---|
//! | angle random walk N | white noise, 60·N·√dt arcsec in an interval of dt seconds | IEEE Std 952-1997, annex C |
//! | bias instability, rate random walk, drift, quantisation | [`SlowBias`], linear in time, a counter with a residue | the same |
//! | scale factor and its temperature | rate · (1 + s + s′·(T − T₀)) | the same |
//! | bias and temperature | c₁·(T − T₀) + c₂·(T − T₀)² | the same |
//! | stress between coil and housing | c · (T − T₀)·(T_h − T₀) | a product of two temperatures: the lowest order that neither shows alone |
//! | rate of temperature | c · dT/dt: a change that reaches one half of the coil before the other | D. M. Shupe, Applied Optics 19 (1980) 654 |
//! | hysteresis of temperature | ± h, by the direction from which the temperature came | play operator (Krasnosel'skii and Pokrovskii) |
//! | Earth's magnetic field | field along the axis and across it: Faraday effect in a twisted fibre | K. Hotate and K. Tabe, Applied Optics 25 (1986) 1086 |
//! | field in the instrument's body | harmonics of the index angle | a magnet, the heat of the drive |
//! | dead zone, cubic | odd functions of the rate, from coherent cross-coupling and loop gain | H. C. Lefèvre, The Fiber-Optic Gyroscope, 2nd ed., 2014 |
//! | after a move | exponential decay, proportional to the angle moved, or to a cosine of the angle where it ends | heat and stress that the move brings |
//! | vibration | proportional to the mean square of the acceleration | IEEE Std 952-1997 (vibration rectification) |
//! | gravity, supply voltage | linear | IEEE Std 952-1997 |
//! | interference | a sinusoidal rate, integrated over the interval | IEEE Std 952-1997, annex C (sinusoidal noise) |
//! | intermittent | random telegraph | a bad contact |

use crate::noise::{SlowBias, Source, Stream, Telegraph};
use crate::scenario::{Gyro, Harmonic, Site};
use crate::thermal::Thermal;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Voltage at which the bias is declared, V.
const NOMINAL_VOLTS: f64 = 12.0;
/// Turns of the spindle smaller than this are not moves, rad.
const MOVE_RAD: f64 = 1e-12;

/// What surrounds the gyro during one interval.
#[derive(Debug, Clone)]
pub struct Surroundings {
    /// End of the interval, s.
    pub t_s: f64,
    /// Its length, s.
    pub dt_s: f64,
    /// Inertial angle turned about the sensitive axis, arcsec, right-handed.
    pub turned_arcsec: f64,
    /// Index angle at the end, rad.
    pub index_rad: f64,
    /// Change of the index angle, rad, counter-clockwise positive.
    pub index_change_rad: f64,
    /// Direction of the sensitive axis, east, north, up.
    pub axis: Vector3<f64>,
    /// Vibration, g rms.
    pub vibration_g: f64,
    /// Supply voltage, V.
    pub supply_v: f64,
}

/// The gyro's errors and their state.
#[derive(Debug, Clone)]
pub struct GyroErrors {
    gyro: Gyro,
    field: Vector3<f64>,
    thermal: Thermal,
    housing: Thermal,
    slow: SlowBias,
    telegraph: Option<Telegraph>,
    after_move_deg_h: f64,
    turns: bool,
    harmonics_at: Option<(f64, f64)>,
    bias_deg_h: f64,
    white: Stream,
}

impl GyroErrors {
    /// The gyro at switch-on.
    pub fn new(gyro: &Gyro, site: &Site, seed: u64) -> Self {
        let declination = site.magnetic_declination_deg.to_radians();
        let inclination = site.magnetic_inclination_deg.to_radians();
        let telegraph = (gyro.intermittent_deg_h != 0.0).then(|| {
            let stream = Stream::new(seed, Source::Intermittent);
            Telegraph::new(gyro.intermittent_off_s, gyro.intermittent_on_s, stream)
        });
        let slow = Stream::new(seed, Source::GyroSlow);
        Self {
            gyro: gyro.clone(),
            field: Vector3::new(declination.sin(), declination.cos(), -inclination.tan()),
            thermal: Thermal::new(site, gyro),
            housing: Thermal::of_housing(site, gyro),
            slow: SlowBias::new(gyro.bias_instability_deg_h, gyro.rrw_deg_h_per_sqrt_h, slow),
            telegraph,
            after_move_deg_h: 0.0,
            turns: false,
            harmonics_at: None,
            bias_deg_h: gyro.bias_deg_h,
            white: Stream::new(seed, Source::GyroWhite),
        }
    }

    /// The air becomes warmer by this, at once.
    pub fn warm_the_air(&mut self, kelvin: f64) {
        self.thermal.warm_the_air(kelvin);
        self.housing.warm_the_air(kelvin);
    }

    /// The angle that the gyro's electronics integrate over the interval, arcsec, before quantisation and saturation.
    pub fn measure(&mut self, now: &Surroundings) -> f64 {
        self.thermal.advance(now.t_s, now.dt_s);
        self.housing.advance(now.t_s, now.dt_s);
        let gyro = &self.gyro;
        let scale = 1.0 + 1e-6 * (gyro.scale_ppm + gyro.scale_ppm_per_k * (self.thermal.temp_c() - gyro.reference_c));
        let rate_deg_h = now.turned_arcsec / now.dt_s;
        let mut output_deg_h = scale * rate_deg_h + self.non_linearity(rate_deg_h);
        self.bias_deg_h = self.bias(now);
        output_deg_h += self.bias_deg_h;
        let noise_arcsec = 60.0 * self.gyro.arw_deg_per_sqrt_h * now.dt_s.sqrt() * self.white.normal();
        output_deg_h * now.dt_s + self.interference_arcsec(now) + noise_arcsec
    }

    /// The sum of everything that is not noise from sample to sample, °/h, in the last interval.
    pub fn bias_deg_h(&self) -> f64 {
        self.bias_deg_h
    }

    /// True temperature of the gyro, °C.
    pub fn temp_c(&self) -> f64 {
        self.thermal.temp_c()
    }

    /// True temperature of the housing, °C.
    pub fn housing_c(&self) -> f64 {
        self.housing.temp_c()
    }

    /// What its temperature sensor reads, °C.
    pub fn temp_reading_c(&self) -> f64 {
        self.thermal.temp_c() + self.gyro.temperature_error_k
    }

    fn bias(&mut self, now: &Surroundings) -> f64 {
        let from_motion = self.after_move(now) + self.harmonics(now.index_rad);
        let slow = self.slow.advance(now.dt_s);
        let on = self.telegraph.as_mut().is_some_and(|telegraph| telegraph.is_on(now.t_s));
        let gyro = &self.gyro;
        let warm_k = self.thermal.temp_c() - gyro.reference_c;
        let right = now.axis.cross(&Vector3::z());
        gyro.bias_deg_h
            + slow
            + from_motion
            + gyro.drift_deg_h_per_h * (now.t_s - now.dt_s / 2.0) / 3600.0
            + gyro.bias_deg_h_per_k * warm_k
            + gyro.bias_deg_h_per_k2 * warm_k * warm_k
            + gyro.housing_deg_h_per_k2 * warm_k * (self.housing.temp_c() - gyro.reference_c)
            + gyro.shupe_deg_h_per_k_s * self.thermal.rate_k_s()
            + gyro.hysteresis_deg_h * self.thermal.hysteresis()
            + gyro.magnetic_axial_deg_h * self.field.dot(&now.axis)
            + gyro.magnetic_transverse_deg_h * self.field.dot(&right)
            + gyro.vibration_deg_h_per_g2 * now.vibration_g * now.vibration_g
            + gyro.g_sensitivity_deg_h_per_g * now.axis.z
            + gyro.supply_deg_h_per_v * (now.supply_v - NOMINAL_VOLTS)
            + if on { gyro.intermittent_deg_h } else { 0.0 }
    }

    /// Odd in the rate. The dead-zone-like loss is −depth at a rate of +width and dies out on both sides.
    fn non_linearity(&self, rate_deg_h: f64) -> f64 {
        let gyro = &self.gyro;
        let mut extra = gyro.cubic_per_deg_h2 * rate_deg_h.powi(3);
        if gyro.dead_zone_deg_h != 0.0 {
            let ratio = rate_deg_h / gyro.dead_zone_width_deg_h;
            extra -= gyro.dead_zone_deg_h * ratio * (0.5 * (1.0 - ratio * ratio)).exp();
        }
        extra
    }

    fn after_move(&mut self, now: &Surroundings) -> f64 {
        if self.gyro.after_move_deg_h == 0.0 && self.gyro.arrival_deg_h == 0.0 {
            return 0.0;
        }
        self.after_move_deg_h *= (-now.dt_s / self.gyro.after_move_tau_s).exp();
        let turned = std::mem::replace(&mut self.turns, now.index_change_rad.abs() > MOVE_RAD);
        if self.turns {
            self.after_move_deg_h += self.gyro.after_move_deg_h * now.index_change_rad / std::f64::consts::FRAC_PI_2;
        } else if turned {
            let apart_rad = now.index_rad - self.gyro.arrival_phase_deg.to_radians();
            self.after_move_deg_h += self.gyro.arrival_deg_h * apart_rad.cos();
        }
        self.after_move_deg_h
    }

    fn harmonics(&mut self, index_rad: f64) -> f64 {
        if self.gyro.harmonics.is_empty() {
            return 0.0;
        }
        match self.harmonics_at {
            Some((at_rad, bias_deg_h)) if at_rad == index_rad => bias_deg_h,
            _ => {
                let bias_deg_h = self.gyro.harmonics.iter().map(|harmonic| harmonic_deg_h(harmonic, index_rad)).sum();
                self.harmonics_at = Some((index_rad, bias_deg_h));
                bias_deg_h
            }
        }
    }

    /// The sinusoid, integrated over the interval.
    fn interference_arcsec(&self, now: &Surroundings) -> f64 {
        if self.gyro.interference_deg_h == 0.0 {
            return 0.0;
        }
        let omega = TAU * self.gyro.interference_hz;
        self.gyro.interference_deg_h / omega * ((omega * (now.t_s - now.dt_s)).cos() - (omega * now.t_s).cos())
    }
}

fn harmonic_deg_h(harmonic: &Harmonic, index_rad: f64) -> f64 {
    harmonic.amplitude_deg_h * (f64::from(harmonic.order) * (index_rad - harmonic.phase_deg.to_radians())).cos()
}
