//! The whole instrument, bus by bus, with a hidden effect in it: for the loop with the firmware itself.

use super::draw::Draw;
use hal_sim::scenario::{BaseAngle, Block, Gyro, Harmonic, Scenario, Sway};

/// Effects that a board can find out about and correct: it measures temperature, level and index angle, and knows the
/// time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    TemperatureRate,
    Temperature,
    AfterMove,
    Magnet,
    EarthField,
    DeadZone,
    Hysteresis,
    Arrival,
    BaseMotion,
    Housing,
}

impl Hidden {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::TemperatureRate,
        Self::Temperature,
        Self::AfterMove,
        Self::Magnet,
        Self::EarthField,
        Self::DeadZone,
        Self::Hysteresis,
        Self::Arrival,
        Self::BaseMotion,
        Self::Housing,
    ];

    /// Name, stable: lower-case words with hyphens.
    pub fn name(self) -> &'static str {
        match self {
            Self::TemperatureRate => "temperature-rate",
            Self::Temperature => "temperature",
            Self::AfterMove => "after-move",
            Self::Magnet => "magnet",
            Self::EarthField => "earth-field",
            Self::DeadZone => "dead-zone",
            Self::Hysteresis => "hysteresis",
            Self::Arrival => "decay-by-position",
            Self::BaseMotion => "base-motion",
            Self::Housing => "surface-of-two-temperatures",
        }
    }

    /// The effect of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|hidden| hidden.name() == name)
    }
}

/// One instrument that is put up again and again: each time at another heading, at another temperature.
#[derive(Debug, Clone)]
pub struct Instrument {
    /// What is hidden in it.
    pub hidden: Hidden,
    /// The same in words, with its size.
    pub truth: String,
    seed: u64,
    latitude_deg: f64,
    gyro: Gyro,
    /// Amplitude of a slow sway of the base, arcsec.
    sway_arcsec: f64,
}

impl Instrument {
    /// Draws an instrument; with `None` the effect is drawn too.
    pub fn draw(hidden: Option<Hidden>, latitude_deg: f64, seed: u64) -> Self {
        let mut draw = Draw::new(seed, u64::MAX);
        let drawn = draw.pick(&Hidden::ALL);
        let hidden = hidden.unwrap_or(drawn);
        let sign = draw.sign();
        let mut gyro =
            Gyro { bias_deg_h: draw.uniform(-0.3, 0.3), thermal_tau_s: draw.uniform(120.0, 250.0), ..Gyro::default() };
        let mut sway_arcsec = 0.0;
        let truth = match hidden {
            Hidden::TemperatureRate => {
                gyro.shupe_deg_h_per_k_s = sign * draw.uniform(8.0, 16.0);
                format!("{:+.2} °/h for each K/s of temperature", gyro.shupe_deg_h_per_k_s)
            }
            Hidden::Temperature => {
                gyro.bias_deg_h_per_k = sign * draw.uniform(0.03, 0.1);
                format!("{:+.3} °/h for each K", gyro.bias_deg_h_per_k)
            }
            Hidden::AfterMove => {
                gyro.after_move_deg_h = sign * draw.uniform(0.3, 0.9);
                gyro.after_move_tau_s = draw.uniform(8.0, 20.0);
                format!(
                    "{:+.3} °/h after a quarter turn, dying away in {:.1} s",
                    gyro.after_move_deg_h, gyro.after_move_tau_s
                )
            }
            Hidden::Magnet => {
                let amplitude_deg_h = draw.uniform(0.1, 0.4);
                let phase_deg = draw.uniform(0.0, 360.0);
                gyro.harmonics = vec![Harmonic { order: 1, amplitude_deg_h, phase_deg }];
                format!("a magnet in the base: {amplitude_deg_h:.3} °/h, most at an index of {phase_deg:.1}°")
            }
            Hidden::EarthField => {
                gyro.magnetic_transverse_deg_h = sign * draw.uniform(0.08, 0.25);
                format!("{:+.3} °/h for the Earth's field across the axis", gyro.magnetic_transverse_deg_h)
            }
            Hidden::DeadZone => {
                gyro.dead_zone_deg_h = draw.uniform(0.15, 0.5);
                gyro.dead_zone_width_deg_h = draw.uniform(1.0, 3.0);
                format!("a loss of {:.3} °/h at a rate of {:.2} °/h", gyro.dead_zone_deg_h, gyro.dead_zone_width_deg_h)
            }
            Hidden::Hysteresis => {
                gyro.hysteresis_deg_h = sign * draw.uniform(0.15, 0.4);
                gyro.hysteresis_width_k = draw.uniform(1.0, 4.0);
                // The air goes up and down during a run, and the gyro follows.
                gyro.thermal_tau_s = draw.uniform(20.0, 50.0);
                format!(
                    "± {:.3} °/h by whether it warmed or cooled, over {:.1} K",
                    gyro.hysteresis_deg_h.abs(),
                    gyro.hysteresis_width_k
                )
            }
            Hidden::Arrival => {
                gyro.arrival_deg_h = sign * draw.uniform(0.4, 1.2);
                gyro.arrival_phase_deg = draw.uniform(0.0, 360.0);
                gyro.after_move_tau_s = draw.uniform(8.0, 20.0);
                format!(
                    "{:+.3} °/h · cos(θ − {:.1}°) after a move to θ, dying away in {:.1} s",
                    gyro.arrival_deg_h, gyro.arrival_phase_deg, gyro.after_move_tau_s
                )
            }
            Hidden::Housing => {
                gyro.housing_deg_h_per_k2 = sign * draw.uniform(0.01, 0.03);
                gyro.thermal_tau_s = draw.uniform(20.0, 50.0);
                gyro.housing_tau_s = draw.uniform(60.0, 150.0);
                format!(
                    "{:+.4} °/h for each K of the gyro times each K of the housing, from 20 °C",
                    gyro.housing_deg_h_per_k2
                )
            }
            Hidden::BaseMotion => {
                sway_arcsec = draw.uniform(3.0, 9.0);
                format!("a base that sways by {sway_arcsec:.1}″ about both axes, within 15 to 40 s")
            }
        };
        Self { hidden, truth, seed, latitude_deg, gyro, sway_arcsec }
    }

    /// Whether it carries an inertial block, whose thermometer shows the housing.
    pub fn has_block(&self) -> bool {
        self.hidden == Hidden::Housing
    }

    /// The instrument put up for run number `number`, and the seed of its noise.
    pub fn scenario(&self, number: u64) -> (Scenario, u64) {
        let mut draw = Draw::new(self.seed, number);
        let mut scenario = Scenario { name: format!("hidden effect, run {number}"), ..Scenario::default() };
        scenario.site.latitude_deg = self.latitude_deg;
        scenario.site.azimuth_deg = draw.uniform(0.0, 360.0);
        scenario.site.ambient_c = draw.uniform(10.0, 30.0);
        scenario.base.pitch_deg = 0.05 * draw.normal();
        scenario.base.roll_deg = 0.05 * draw.normal();
        scenario.accelerometer.bias_mg = [0.0; 3];
        scenario.gyro = self.gyro.clone();
        scenario.block = self.has_block().then(Block::default);
        scenario.gyro.start_offset_k = draw.sign() * draw.uniform(2.0, 10.0);
        if matches!(self.hidden, Hidden::Hysteresis | Hidden::Housing) {
            scenario.site.ambient_wave_k = draw.uniform(8.0, 16.0);
            scenario.site.ambient_wave_period_s = draw.uniform(60.0, 180.0);
        }
        if self.sway_arcsec > 0.0 {
            for angle in [BaseAngle::Pitch, BaseAngle::Roll] {
                scenario.base.sway.push(Sway {
                    angle,
                    amplitude_arcsec: self.sway_arcsec,
                    frequency_hz: 1.0 / draw.uniform(15.0, 40.0),
                    phase_deg: draw.uniform(0.0, 360.0),
                    ..Sway::default()
                });
            }
        }
        (scenario, draw.seed())
    }
}
