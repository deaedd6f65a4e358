//! The Earth: its rate, what of it a horizontal axis can feel, and its gravity.

use crate::units::sin_cos_deg;

/// Rate of the Earth relative to the stars, degrees per hour.
///
/// 7.292115e-5 rad/s (WGS 84, NIMA TR8350.2, table 3.1) is 15.041067 °/h.
pub const EARTH_RATE_DEG_H: f64 = 15.041067;

/// Closer to a pole than this no azimuth is given: the horizontal Earth rate is below 0.26 °/h.
pub const POLE_LIMIT_DEG: f64 = 1.0;

/// Semi-major axis, m, and first eccentricity squared of WGS 84.
pub const SEMI_MAJOR_M: f64 = 6_378_137.0;
pub const ECCENTRICITY_2: f64 = 6.694_379_990_14e-3;
/// Normal gravity at the equator, m/s², and Somigliana's constant of WGS 84.
pub const EQUATOR_GRAVITY_M_S2: f64 = 9.780_325_335_9;
pub const SOMIGLIANA: f64 = 1.931_852_652_41e-3;

/// The Earth's rate at a latitude, split in its horizontal and its vertical part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EarthRate {
    /// Towards north, °/h; positive in both hemispheres.
    pub north_deg_h: f64,
    /// Upwards, °/h; negative in the southern hemisphere.
    pub up_deg_h: f64,
}

/// Why a latitude cannot be worked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum LatitudeError {
    /// Not a number, or outside −90° … 90°.
    NotALatitude,
    /// Within [`POLE_LIMIT_DEG`] of a pole: there is no horizontal Earth rate to find north by.
    NearPole,
}

impl core::fmt::Display for LatitudeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotALatitude => write!(f, "a latitude lies between -90 and 90 degrees"),
            Self::NearPole => write!(
                f,
                "within {POLE_LIMIT_DEG} degree of a pole the Earth's rate has no horizontal part to find north by"
            ),
        }
    }
}

/// Earth rate at `latitude_deg` (north positive, −89° … 89°): Ω cos φ north, Ω sin φ up.
pub fn earth_rate(latitude_deg: f64) -> Result<EarthRate, LatitudeError> {
    if !(-90.0..=90.0).contains(&latitude_deg) {
        return Err(LatitudeError::NotALatitude);
    }
    if latitude_deg.abs() > 90.0 - POLE_LIMIT_DEG {
        return Err(LatitudeError::NearPole);
    }
    let (sin, cos) = sin_cos_deg(latitude_deg);
    Ok(EarthRate { north_deg_h: EARTH_RATE_DEG_H * cos, up_deg_h: EARTH_RATE_DEG_H * sin })
}

/// Normal gravity, m/s², at a geodetic latitude (rad, north positive) and a height above the ellipsoid (m).
///
/// Somigliana's formula with the constants of WGS 84 (NIMA TR8350.2, section 4.2), less with height as 2h/a, to the first
/// order. What a place really has differs by some 5·10⁻⁴ m/s², in mountains by more.
pub fn normal_gravity_m_s2(latitude_rad: f64, height_m: f64) -> f64 {
    let s = libm::sin(latitude_rad);
    let root = libm::sqrt(1.0 - ECCENTRICITY_2 * s * s);
    let surface = EQUATOR_GRAVITY_M_S2 * (1.0 + SOMIGLIANA * s * s) / root;
    surface * (1.0 - 2.0 * height_m / SEMI_MAJOR_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_of_the_tables() {
        // TR8350.2, table 3.4: 9.7803253359 at the equator, 9.8321849378 at the pole, m/s². 1000 m higher: 2/6378.137 less.
        let at = |latitude_deg: f64, height_m| normal_gravity_m_s2(latitude_deg.to_radians(), height_m);
        assert!((at(0.0, 0.0) - 9.780_325_335_9).abs() < 1e-10);
        assert!((at(90.0, 0.0) - 9.832_184_937_8).abs() < 1e-9 && at(-90.0, 0.0) == at(90.0, 0.0));
        assert!((at(45.0, 0.0) - at(45.0, 1000.0) - 3.0752e-3).abs() < 1e-6);
    }

    #[test]
    fn both_hemispheres_point_the_horizontal_rate_north() {
        // By hand: cos 60° = 1/2, sin 60° = 0.8660254.
        let north = earth_rate(60.0).unwrap();
        assert!((north.north_deg_h - 7.5205335).abs() < 1e-9);
        assert!((north.up_deg_h - 13.025946).abs() < 1e-6);
        let south = earth_rate(-60.0).unwrap();
        assert_eq!(south.north_deg_h, north.north_deg_h);
        assert_eq!(south.up_deg_h, -north.up_deg_h);
    }

    #[test]
    fn the_rate_is_the_wgs_84_one() {
        let from_rad_s = 7.292115e-5 * crate::units::DEG_PER_RAD * 3600.0;
        assert!((EARTH_RATE_DEG_H - from_rad_s).abs() < 1e-6);
    }

    #[test]
    fn poles_and_nonsense_are_refused() {
        assert!(earth_rate(88.9).is_ok());
        assert_eq!(earth_rate(89.1), Err(LatitudeError::NearPole));
        assert_eq!(earth_rate(-90.0), Err(LatitudeError::NearPole));
        assert_eq!(earth_rate(91.0), Err(LatitudeError::NotALatitude));
        assert_eq!(earth_rate(f64::NAN), Err(LatitudeError::NotALatitude));
    }
}
