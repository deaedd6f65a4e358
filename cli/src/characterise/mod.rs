//! A gyro's noise from a still recording, and the settings that follow from it.
//!
//! The overlapping Allan deviation is fitted by the five noise processes of IEEE Std 952-1997, annex C: quantisation
//! 3 Q²/τ², angle random walk N²/τ, bias instability (2 ln 2/π) B², rate random walk K² τ/3, rate ramp R² τ²/2.

mod channels;
mod noise;
mod record;

use std::fmt;

use north_finder::settings::Settings;
use north_finder::settings::fields::FIELDS;
use serde::Serialize;

pub use channels::{Channels, of as of_channels};
pub use noise::{Noise, PROCESSES, Point};
pub use record::{Outlier, Record, read, told};

use crate::settings_file::declare_noise;

/// A threshold is this many times the largest change of the rate that the still gyro itself made.
const MARGIN_OF_CHANGE: f64 = 1.5;

/// The noise of one-second rates is taken for more than that of the fitted processes from this ratio of their variances on: a tenth is what the
/// fit of an hour leaves open.
const UNEXPLAINED: f64 = 1.1;

/// The settings that follow from a recording.
const ARW: &str = "gyro.arw_deg_per_sqrt_h";
const ANGLE_NOISE: &str = "gyro.angle_noise_arcsec";
const INSTABILITY: &str = "gyro.bias_instability_deg_h";
const DISTURBANCE: &str = "disturbance.threshold_deg_h";
const JITTER: &str = "jitter.threshold_deg_h";

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
    /// Rows that were replaced before all of this.
    pub outliers: Vec<Outlier>,
}

/// The settings that a recording suggests; what they do not name stays as it is. `None` where the recording does not show it, which does not make it
/// 0, or where it is beyond what the setting may be.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Suggested {
    pub arw_deg_per_sqrt_h: Option<f64>,
    pub angle_noise_arcsec: Option<f64>,
    pub bias_instability_deg_h: Option<f64>,
    pub disturbance_threshold_deg_h: Option<f64>,
    pub jitter_threshold_deg_h: Option<f64>,
    /// What was found beyond what its setting may be.
    pub beyond: Vec<Beyond>,
}

/// A value that a setting cannot have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Beyond {
    pub setting: &'static str,
    pub value: f64,
    pub allowed: &'static str,
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
            outliers: record.outliers.clone(),
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
        let mut beyond = Vec::new();
        let mut seen = |setting, value| possible(setting, value, &mut beyond);
        Suggested {
            arw_deg_per_sqrt_h: seen(ARW, settings.gyro.arw_deg_per_sqrt_h),
            angle_noise_arcsec: seen(ANGLE_NOISE, settings.gyro.angle_noise_arcsec),
            bias_instability_deg_h: seen(INSTABILITY, self.noise.bias_instability_deg_h),
            disturbance_threshold_deg_h: seen(DISTURBANCE, settings.disturbance.threshold_deg_h),
            jitter_threshold_deg_h: seen(JITTER, settings.jitter.threshold_deg_h),
            beyond,
        }
    }

    /// Said of a recording that is too short to look for slow processes in.
    pub fn doubt_of_length(&self) -> Option<String> {
        let seconds = noise::SLOW_SPAN * self.interval_s / noise::LONGEST_SHARE;
        (self.seconds < 0.99 * seconds).then(|| {
            format!(
                "{:.0} s are too short for bias instability, rate random walk and rate ramp: they were not looked for. With \
                 rows of {} s they need {seconds:.0} s or more; an hour is good",
                self.seconds, self.interval_s
            )
        })
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

/// The value if it is seen and its setting may have it; one that is beyond goes to the list.
fn possible(setting: &'static str, value: f64, beyond: &mut Vec<Beyond>) -> Option<f64> {
    let field = FIELDS.iter().find(|field| field.name == setting)?;
    if (field.low..=field.high).contains(&value) {
        return Some(value).filter(|seen| *seen > 0.0);
    }
    beyond.push(Beyond { setting, value, allowed: field.allowed });
    None
}

impl Suggested {
    /// As a settings file that `--settings` and `north settings restore` read.
    pub fn to_toml(&self) -> String {
        let defaults = Settings::default();
        let line = |setting: &str, value: Option<f64>| {
            let name = setting.rsplit('.').next().unwrap_or(setting);
            match (value, self.beyond.iter().find(|beyond| beyond.setting == setting)) {
                (Some(seen), _) => format!("{name} = {}", digits(seen)),
                (None, Some(beyond)) => format!("# {beyond}; it stays as it is"),
                (None, None) => format!("# {name}: not seen in this recording, it stays as it is"),
            }
        };
        let gate = |threshold: String, seconds: u16, timeout_s: f64| {
            format!("{threshold}\nseconds = {seconds}\ntimeout_s = {timeout_s:?}\n")
        };
        let (disturbance, jitter) = (defaults.disturbance, defaults.jitter);
        format!(
            "[gyro]\n{}\n{}\n{}\n\n[disturbance]\n{}\n[jitter]\n{}",
            line(ARW, self.arw_deg_per_sqrt_h),
            line(ANGLE_NOISE, self.angle_noise_arcsec),
            line(INSTABILITY, self.bias_instability_deg_h),
            gate(line(DISTURBANCE, self.disturbance_threshold_deg_h), disturbance.seconds, disturbance.timeout_s),
            gate(line(JITTER, self.jitter_threshold_deg_h), jitter.seconds, jitter.timeout_s),
        )
    }
}

impl fmt::Display for Beyond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { setting, value, allowed } = self;
        write!(f, "{setting} would be {}, and allowed is {allowed}", digits(*value))
    }
}

/// A number with six decimals, or as many as four digits of it need.
pub fn digits(value: f64) -> String {
    let decimals = if value > 0.0 { (3.0 - value.log10().floor()).clamp(6.0, 18.0) as usize } else { 6 };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn what_is_not_seen_is_no_zero() {
        let seen = |bias_instability_deg_h| Suggested {
            arw_deg_per_sqrt_h: Some(1.234e-7),
            angle_noise_arcsec: bias_instability_deg_h,
            bias_instability_deg_h,
            ..Suggested::default()
        };
        let text = seen(None).to_toml();
        assert!(text.contains("\n# bias_instability_deg_h: not seen") && !text.contains("0.000000\n"), "{text}");
        assert!(text.contains("\n# angle_noise_arcsec: not seen"), "{text}");
        assert!(text.contains("arw_deg_per_sqrt_h = 0.0000001234\n"), "{text}");
        assert!(seen(Some(0.0123)).to_toml().contains("\nbias_instability_deg_h = 0.012300\n"));
    }

    /// From angles at the ends of seconds, arcsec.
    fn of_angles(angle_arcsec: Vec<f64>) -> Suggested {
        Character::of(&Record { interval_s: 1.0, angle_arcsec, outliers: Vec::new() }).suggested()
    }

    /// Uniform numbers from −1/2 to 1/2, which have a variance of 1/12.
    fn uniform(count: usize) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        (0..count).map(|_| f64::from(rng.next_u32()) / f64::from(u32::MAX) - 0.5).collect()
    }

    #[test]
    fn a_random_walk_that_is_not_seen_stays_as_it_is() {
        // White noise of the angle alone: Q = 1/√12 = 0.289 arcsec.
        let settings = of_angles(uniform(1001));
        assert!((settings.angle_noise_arcsec.unwrap() / 0.289 - 1.0).abs() < 0.1, "{settings:?}");
        let text = settings.to_toml();
        assert!(text.starts_with("[gyro]\n# arw_deg_per_sqrt_h: not seen in this recording"), "{text}");
        crate::settings_file::laid_over("it", text, &Settings::default()).unwrap();
    }

    #[test]
    fn no_setting_is_proposed_beyond_what_it_may_be() {
        // White rates from −600 to 600 °/h have a deviation of 346 °/h, which is 5.8 °/√h in rows of a second; allowed is 1.
        let mut angle_arcsec = vec![0.0];
        uniform(600).iter().for_each(|rate| angle_arcsec.push(angle_arcsec.last().unwrap() + 1200.0 * rate));
        let settings = of_angles(angle_arcsec);
        assert_eq!((settings.arw_deg_per_sqrt_h, settings.beyond.len()), (None, 1), "{settings:?}");
        assert!((settings.beyond[0].value / 5.8 - 1.0).abs() < 0.1, "{settings:?}");
        let text = settings.to_toml();
        assert!(
            text.contains("\n# gyro.arw_deg_per_sqrt_h would be 5.") && text.contains("allowed is 0 to 1;"),
            "{text}"
        );
        crate::settings_file::laid_over("it", text, &Settings::default()).unwrap();
    }
}
