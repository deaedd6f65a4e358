//! Units that a mapping may name, each with the factor to the project's own.

use north_finder::units::{ARCSEC_PER_RAD, DEG_PER_RAD, STANDARD_GRAVITY_M_S2};
use serde::Deserialize;

/// What a gyro column holds: an angle increment over the sample, or a rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum GyroUnit {
    #[serde(rename = "arcsec")]
    Arcsec,
    #[serde(rename = "deg")]
    Deg,
    #[serde(rename = "rad")]
    Rad,
    #[serde(rename = "deg/h")]
    DegPerHour,
    #[serde(rename = "deg/s")]
    DegPerSecond,
    #[serde(rename = "rad/s")]
    RadPerSecond,
}

impl GyroUnit {
    /// Arcsec over a sample of `interval_s` for a column's value of 1.
    pub fn arcsec(self, interval_s: f64) -> f64 {
        match self {
            Self::Arcsec => 1.0,
            Self::Deg => 3600.0,
            Self::Rad => ARCSEC_PER_RAD,
            // One degree per hour for one second is exactly one arcsecond.
            Self::DegPerHour => interval_s,
            Self::DegPerSecond => 3600.0 * interval_s,
            Self::RadPerSecond => ARCSEC_PER_RAD * interval_s,
        }
    }
}

/// What an accelerometer column holds: specific force, or a velocity increment over the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum AccelerationUnit {
    #[serde(rename = "g")]
    G,
    #[serde(rename = "mg")]
    MilliG,
    #[serde(rename = "ug")]
    MicroG,
    #[serde(rename = "m/s2")]
    MetrePerSecond2,
    #[serde(rename = "m/s")]
    MetrePerSecond,
    #[serde(rename = "g*s")]
    GSecond,
    #[serde(rename = "ug*s")]
    MicroGSecond,
}

impl AccelerationUnit {
    /// Mean specific force, g, over a sample of `interval_s` for a column's value of 1.
    pub fn g(self, interval_s: f64) -> f64 {
        match self {
            Self::G => 1.0,
            Self::MilliG => 1e-3,
            Self::MicroG => 1e-6,
            Self::MetrePerSecond2 => 1.0 / STANDARD_GRAVITY_M_S2,
            Self::MetrePerSecond => 1.0 / (STANDARD_GRAVITY_M_S2 * interval_s),
            Self::GSecond => 1.0 / interval_s,
            Self::MicroGSecond => 1e-6 / interval_s,
        }
    }
}

/// Unit of a time column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum TimeUnit {
    #[serde(rename = "h")]
    Hour,
    #[serde(rename = "min")]
    Minute,
    #[default]
    #[serde(rename = "s")]
    Second,
    #[serde(rename = "ms")]
    Milli,
    #[serde(rename = "us")]
    Micro,
    #[serde(rename = "ns")]
    Nano,
    /// Dates with times.
    #[serde(rename = "iso8601")]
    Iso8601,
}

impl TimeUnit {
    /// Of a column's value of 1; a date with a time is read in seconds.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Hour => 3600.0,
            Self::Minute => 60.0,
            Self::Second | Self::Iso8601 => 1.0,
            Self::Milli => 1e-3,
            Self::Micro => 1e-6,
            Self::Nano => 1e-9,
        }
    }
}

/// Unit of an index angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum AngleUnit {
    #[default]
    #[serde(rename = "deg")]
    Deg,
    #[serde(rename = "rad")]
    Rad,
    #[serde(rename = "turn")]
    Turn,
}

impl AngleUnit {
    pub fn deg(self) -> f64 {
        match self {
            Self::Deg => 1.0,
            Self::Rad => DEG_PER_RAD,
            Self::Turn => 360.0,
        }
    }
}

/// Unit of a temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum TemperatureUnit {
    #[default]
    #[serde(rename = "degC")]
    Celsius,
    #[serde(rename = "degF")]
    Fahrenheit,
    #[serde(rename = "K")]
    Kelvin,
}

impl TemperatureUnit {
    /// °C of a temperature in this unit.
    pub fn celsius(self, value: f64) -> f64 {
        match self {
            Self::Celsius => value,
            Self::Fahrenheit => (value - 32.0) / 1.8,
            Self::Kelvin => value - 273.15,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: f64, expected: f64) {
        assert!((value / expected - 1.0).abs() < 1e-12, "{value}, {expected}");
    }

    #[test]
    fn factors_by_hand() {
        // 1 °/h for a hundredth of a second; 1 °/s = 3600 arcsec/s.
        close(GyroUnit::DegPerHour.arcsec(0.01), 0.01);
        close(GyroUnit::DegPerSecond.arcsec(0.01), 36.0);
        close(GyroUnit::Rad.arcsec(0.5), 206_264.806_247_096_36);
        close(GyroUnit::RadPerSecond.arcsec(0.5), 103_132.403_123_548_18);
        // 125 µg·s in 10 ms is 12.5 mg; 9.80665 m/s gathered in 2 s is half a g.
        close(125.0 * AccelerationUnit::MicroGSecond.g(0.01), 0.0125);
        close(9.80665 * AccelerationUnit::MetrePerSecond.g(2.0), 0.5);
        close(9.80665 * AccelerationUnit::MetrePerSecond2.g(2.0), 1.0);
        close(TemperatureUnit::Fahrenheit.celsius(212.0), 100.0);
        close(TemperatureUnit::Kelvin.celsius(300.0), 26.85);
        close(AngleUnit::Turn.deg() * 0.25, 90.0);
        close(TimeUnit::Micro.seconds() * 2500.0, 0.0025);
    }
}
