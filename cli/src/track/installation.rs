//! Where antennas and an electrostatic gyro are on the ship, and what they are good for: `--installation FILE.toml`.

use std::path::Path;

use inertial::esg::filter::EsgErrors;
use inertial::esg::reference::DriftCoefficients;
use inertial::filter;
use nalgebra::Vector3;
use north_finder::earth::EARTH_RATE_DEG_H;
use north_finder::units::{ARCSEC_PER_RAD, RAD_PER_DEG};
use serde::{Deserialize, Serialize};

use crate::file_error::{FileError, Problem};
use crate::toml_file::TomlFile;

const RAD_S_PER_DEG_H: f64 = RAD_PER_DEG / 3600.0;

/// The installation; lengths along the block's axes: forward, left, up.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Installation {
    /// From the block to the antenna whose velocity and position are given, m.
    pub antenna_m: [f64; 3],
    /// From it to the second antenna, m, and how well that is known.
    pub baseline_m: [f64; 3],
    pub baseline_sigma_m: f64,
    /// Of the carrier.
    pub wavelength_m: f64,
    /// One sigma of the log's scale factor.
    pub log_scale_sigma: f64,
    /// One sigma of the water's current, each direction, and its time constant.
    pub current_m_s: f64,
    pub current_s: f64,
    pub electrostatic_gyro: Option<ElectrostaticGyro>,
}

/// An electrostatic gyro and what is known of its drift; the names are those of docs/attitude-filter.md.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ElectrostaticGyro {
    /// Direction of the momentum: declination from the equator, and hour angle from the meridian of Greenwich at `t_s` = 0, eastwards.
    pub declination_deg: f64,
    #[serde(default)]
    pub hour_angle_deg: f64,
    /// One sigma of both.
    pub direction_sigma_deg: f64,
    pub pick_off_arcsec: f64,
    pub reading_arcsec: f64,
    pub drift_deg_h: f64,
    pub drift_growth_deg_h_per_sqrt_h: f64,
    /// Torques fixed to the block: forward, left, up.
    #[serde(default)]
    pub block_deg_h: [f64; 3],
    #[serde(default)]
    pub unbalance_deg_h: f64,
    #[serde(default)]
    pub stiffness_deg_h: f64,
    /// One sigma of each of the five.
    pub coefficient_sigma_deg_h: f64,
}

impl Default for Installation {
    fn default() -> Self {
        Self {
            antenna_m: [0.0; 3],
            baseline_m: [0.0; 3],
            baseline_sigma_m: 0.01,
            wavelength_m: 0.190_293_67,
            log_scale_sigma: 0.01,
            current_m_s: 0.3,
            current_s: 3600.0,
            electrostatic_gyro: None,
        }
    }
}

impl Installation {
    /// Reads it. Errors: no such file, unknown fields, values that make no sense.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let file = TomlFile::read(path)?;
        let installation: Self = file.parse()?;
        let mut positive = vec![
            ("baseline_sigma_m", installation.baseline_sigma_m),
            ("wavelength_m", installation.wavelength_m),
            ("log_scale_sigma", installation.log_scale_sigma),
            ("current_m_s", installation.current_m_s),
            ("current_s", installation.current_s),
        ];
        if let Some(gyro) = &installation.electrostatic_gyro {
            positive.extend([
                ("electrostatic_gyro.direction_sigma_deg", gyro.direction_sigma_deg),
                ("electrostatic_gyro.pick_off_arcsec", gyro.pick_off_arcsec),
                ("electrostatic_gyro.reading_arcsec", gyro.reading_arcsec),
                ("electrostatic_gyro.drift_deg_h", gyro.drift_deg_h),
                ("electrostatic_gyro.drift_growth_deg_h_per_sqrt_h", gyro.drift_growth_deg_h_per_sqrt_h),
                ("electrostatic_gyro.coefficient_sigma_deg_h", gyro.coefficient_sigma_deg_h),
            ]);
        }
        for (field, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(file.at_field(None, field, Problem::not_allowed(value, "a positive number")));
            }
        }
        let lengths = [("antenna_m", installation.antenna_m), ("baseline_m", installation.baseline_m)];
        for (field, value) in lengths.iter().flat_map(|(field, length)| length.map(|value| (*field, value))) {
            if !(value.abs() <= 1000.0) {
                return Err(file.at_field(None, field, Problem::not_allowed(value, "lengths to 1000 m")));
            }
        }
        Ok(installation)
    }

    /// In hull axes: X starboard, Y forward, Z up.
    pub fn on_hull(&self) -> filter::Installation {
        filter::Installation { antenna_m: on_hull(self.antenna_m), baseline_m: on_hull(self.baseline_m) }
    }
}

/// Forward, left, up to starboard, forward, up.
fn on_hull([forward, left, up]: [f64; 3]) -> Vector3<f64> {
    Vector3::new(-left, forward, up)
}

impl ElectrostaticGyro {
    /// The momentum's direction in the Earth's axes as they stand at `t_s`.
    pub fn direction(&self, t_s: f64) -> Vector3<f64> {
        let hour_angle = (self.hour_angle_deg - EARTH_RATE_DEG_H * t_s / 3600.0) * RAD_PER_DEG;
        let declination = self.declination_deg * RAD_PER_DEG;
        let equatorial = declination.cos();
        Vector3::new(equatorial * hour_angle.cos(), equatorial * hour_angle.sin(), declination.sin())
    }

    pub fn coefficients(&self) -> DriftCoefficients {
        DriftCoefficients {
            block: self.block_deg_h.map(|rate| rate * RAD_S_PER_DEG_H),
            unbalance: self.unbalance_deg_h * RAD_S_PER_DEG_H,
            stiffness: self.stiffness_deg_h * RAD_S_PER_DEG_H,
        }
    }

    pub fn errors(&self) -> EsgErrors {
        EsgErrors {
            direction_rad: self.direction_sigma_deg * RAD_PER_DEG,
            pick_off_rad: self.pick_off_arcsec / ARCSEC_PER_RAD,
            reading_rad: self.reading_arcsec / ARCSEC_PER_RAD,
            drift_rad_s: self.drift_deg_h * RAD_S_PER_DEG_H,
            drift_growth_rad_s_per_sqrt_s: self.drift_growth_deg_h_per_sqrt_h * RAD_S_PER_DEG_H / 60.0,
            coefficient_rad_s: self.coefficient_sigma_deg_h * RAD_S_PER_DEG_H,
        }
    }
}
