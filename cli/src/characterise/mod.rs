//! A gyro's noise from a still recording, and the settings that follow from it.
//!
//! The overlapping Allan deviation is fitted by the five noise processes of IEEE Std 952-1997, annex C: quantisation
//! 3 Q²/τ², angle random walk N²/τ, bias instability (2 ln 2/π) B², rate random walk K² τ/3, rate ramp R² τ²/2.

mod channels;
mod noise;
mod record;

use north_finder::settings::Settings;
use serde::Serialize;

pub use channels::{Channels, of as of_channels};
pub use noise::{Noise, PROCESSES, Point};
pub use record::{Record, read};

use crate::settings_file::declare_noise;

/// A threshold is this many times the largest change of the rate that the still gyro itself made.
const MARGIN_OF_CHANGE: f64 = 1.5;

/// The noise of one-second rates is taken for more than that of the fitted processes from this ratio of their variances on: a tenth is what the
/// fit of an hour leaves open.
const UNEXPLAINED: f64 = 1.1;

/// What a still recording tells of a gyro.
#[derive(Clone, Debug, Serialize)]
pub struct Character {
    /// Length of the recording and of its rows, seconds.
    pub seconds: f64,
    pub interval_s: f64,
    /// Mean rate, °/h: bias and the Earth's rate along the axis.
    pub mean_deg_h: f64,
    /// Overlapping Allan deviation.
    pub allan: Vec<Point>,
    #[serde(flatten)]
    pub noise: Noise,
    /// Correlation of neighbouring one-second rates, and its standard deviation if they were white.
    pub autocorrelation_1s: f64,
    pub autocorrelation_sigma: f64,
    /// Largest change between neighbouring one-second rates, °/h.
    pub largest_change_deg_h: f64,
    /// Smallest step between two increments where all of them are multiples of it, arcsec.
    pub quantum_arcsec: Option<f64>,
}

/// The settings that a recording suggests; what they do not name stays as it is.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Suggested {
    pub arw_deg_per_sqrt_h: f64,
    /// `None` where the recording does not show it: it is not 0 for that.
    pub angle_noise_arcsec: Option<f64>,
    pub bias_instability_deg_h: Option<f64>,
    pub disturbance_threshold_deg_h: f64,
    pub jitter_threshold_deg_h: f64,
}

impl Character {
    pub fn of(record: &Record) -> Self {
        let rates_deg_h = record.one_second_rates_deg_h();
        let allan = noise::allan(&record.angle_arcsec, record.interval_s);
        let noise = noise::fit(&allan);
        let (autocorrelation_1s, autocorrelation_sigma) = noise::autocorrelation(&rates_deg_h);
        Self {
            seconds: record.seconds(),
            interval_s: record.interval_s,
            mean_deg_h: rates_deg_h.iter().sum::<f64>() / rates_deg_h.len() as f64,
            noise,
            allan,
            autocorrelation_1s,
            autocorrelation_sigma,
            largest_change_deg_h: rates_deg_h.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max),
            quantum_arcsec: record.quantum_arcsec(),
        }
    }

    /// What the correlation of neighbouring one-second rates says, for a person.
    pub fn correlation_verdict(&self) -> &'static str {
        if self.autocorrelation_1s.abs() < 3.0 * self.autocorrelation_sigma {
            "white"
        } else if self.autocorrelation_1s < 0.0 {
            "noise of the angle: counts, dither or a ring laser"
        } else {
            "not white: temperature, vibration or a moving base"
        }
    }

    /// Noise as measured; thresholds that the still gyro does not cross: what its noise asks for, and more where it made
    /// larger changes.
    pub fn suggested(&self) -> Suggested {
        let mut settings = Settings::default();
        settings.jitter.threshold_deg_h = MARGIN_OF_CHANGE * self.largest_change_deg_h;
        settings.disturbance.threshold_deg_h = 0.0;
        settings.gyro.angle_noise_arcsec = self.noise.quantisation_arcsec;
        declare_noise(&mut settings, self.one_second_arw());
        Suggested {
            arw_deg_per_sqrt_h: settings.gyro.arw_deg_per_sqrt_h,
            angle_noise_arcsec: Some(settings.gyro.angle_noise_arcsec).filter(|seen| *seen > 0.0),
            bias_instability_deg_h: Some(self.noise.bias_instability_deg_h).filter(|seen| *seen > 0.0),
            disturbance_threshold_deg_h: settings.disturbance.threshold_deg_h,
            jitter_threshold_deg_h: settings.jitter.threshold_deg_h,
        }
    }

    /// What the bias instability is below, °/h: the least of the curve if all of it were flicker noise. It is no estimate: white noise and random
    /// walk are in the least point too, some 20 % and more of it.
    pub fn greatest_instability_deg_h(&self) -> f64 {
        let least = self.allan.iter().map(|point| point.sigma_deg_h).fold(f64::INFINITY, f64::min);
        least / noise::flicker_deviation()
    }

    /// The angle random walk that gives one-second rates, beside the noise of the angle, the scatter that they have: N, and more where something
    /// else makes them scatter more than both explain.
    fn one_second_arw(&self) -> f64 {
        let white = self.noise.angle_random_walk_deg_per_sqrt_h;
        let second = self.allan.iter().min_by(|a, b| (a.tau_s - 1.0).abs().total_cmp(&(b.tau_s - 1.0).abs()));
        let Some(Point { tau_s, sigma_deg_h, .. }) = second else { return white };
        let of_second = sigma_deg_h * sigma_deg_h * tau_s;
        let of_angle = 3.0 * self.noise.quantisation_arcsec.powi(2) / tau_s;
        let explained = (60.0 * white).powi(2) + of_angle;
        if of_second > UNEXPLAINED * explained { (of_second - of_angle).sqrt() / 60.0 } else { white }
    }
}

impl Suggested {
    /// As a settings file that `--settings` and `north settings restore` read.
    pub fn to_toml(self) -> String {
        let Self {
            arw_deg_per_sqrt_h,
            angle_noise_arcsec,
            bias_instability_deg_h,
            disturbance_threshold_deg_h,
            jitter_threshold_deg_h,
        } = self;
        let defaults = Settings::default();
        let gate = |threshold_deg_h: f64, seconds: u16, timeout_s: f64| {
            format!("threshold_deg_h = {threshold_deg_h:.4}\nseconds = {seconds}\ntimeout_s = {timeout_s:?}\n")
        };
        let or_not_seen = |name: &str, value: Option<f64>| match value {
            Some(seen) => format!("{name} = {}", digits(seen)),
            None => format!("# {name}: not seen in this recording, it stays as it is"),
        };
        let angle_noise = or_not_seen("angle_noise_arcsec", angle_noise_arcsec);
        let instability = or_not_seen("bias_instability_deg_h", bias_instability_deg_h);
        format!(
            "[gyro]\narw_deg_per_sqrt_h = {}\n{angle_noise}\n{instability}\n\n[disturbance]\n{}\n[jitter]\n{}",
            digits(arw_deg_per_sqrt_h),
            gate(disturbance_threshold_deg_h, defaults.disturbance.seconds, defaults.disturbance.timeout_s),
            gate(jitter_threshold_deg_h, defaults.jitter.seconds, defaults.jitter.timeout_s),
        )
    }
}

/// A number with six decimals, or as many as four digits of it need.
pub fn digits(value: f64) -> String {
    let decimals = if value > 0.0 { (3.0 - value.log10().floor()).clamp(6.0, 18.0) as usize } else { 6 };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_seen_is_no_zero() {
        let seen = |bias_instability_deg_h| Suggested {
            arw_deg_per_sqrt_h: 1.234e-7,
            angle_noise_arcsec: bias_instability_deg_h,
            bias_instability_deg_h,
            disturbance_threshold_deg_h: 1.0,
            jitter_threshold_deg_h: 0.5,
        };
        let text = seen(None).to_toml();
        assert!(text.contains("\n# bias_instability_deg_h: not seen") && !text.contains("0.000000\n"), "{text}");
        assert!(text.contains("\n# angle_noise_arcsec: not seen"), "{text}");
        assert!(text.contains("arw_deg_per_sqrt_h = 0.0000001234\n"), "{text}");
        assert!(seen(Some(0.0123)).to_toml().contains("\nbias_instability_deg_h = 0.012300\n"));
    }
}
