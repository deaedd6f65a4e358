//! What the channels of a recording do: temperatures, voltages, fields, and things that matter to nobody.

use std::f64::consts::TAU;

use crate::hidden::draw::Draw;

/// A column of the campaign and how it moves; every run has a course of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Column name; `temp_c` is the gyro's temperature.
    pub name: String,
    /// Typical value and how much it varies, in the channel's unit.
    centre: f64,
    span: f64,
    /// Shares of the span: the mean from run to run, a ramp over the run, a warm-up, a step, a sinusoid, a smooth
    /// course, a random walk over the run.
    between_runs: f64,
    ramp: f64,
    warm_up: f64,
    step: f64,
    wave: f64,
    wander: f64,
    walk: f64,
    /// Time constants, s.
    warm_up_s: f64,
    wave_s: f64,
    wander_s: f64,
    /// Standard deviation of a reading's noise, as a share of the span.
    noise: f64,
}

/// A channel in one run, one value a second: what is so and what is recorded.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    pub(super) truth: Vec<f64>,
    pub(super) reading: Vec<f64>,
}

/// Name, least and greatest centre, least and greatest span, whether it is a temperature (which does not step).
type Kind = (&'static str, [f64; 2], [f64; 2], bool);

const GYRO: Kind = ("temp_c", [-10.0, 40.0], [0.5, 8.0], true);
const KINDS: [Kind; 12] = [
    ("housing_c", [-15.0, 40.0], [0.5, 10.0], true),
    ("supply_v", [11.0, 29.0], [0.02, 2.0], false),
    ("field_ut", [15.0, 60.0], [0.2, 10.0], false),
    ("humidity_pct", [15.0, 90.0], [0.5, 15.0], true),
    ("vibration_mg", [0.5, 30.0], [0.1, 10.0], false),
    ("pressure_hpa", [930.0, 1030.0], [0.2, 10.0], true),
    ("source_ma", [60.0, 150.0], [0.1, 5.0], false),
    ("light_uw", [20.0, 400.0], [0.5, 40.0], false),
    ("drive_ma", [50.0, 900.0], [5.0, 200.0], false),
    ("board_c", [0.0, 60.0], [0.5, 8.0], true),
    ("wind_m_s", [0.5, 9.0], [0.1, 3.0], false),
    ("adc_5", [-2.0, 2.0], [0.01, 1.0], false),
];

impl Channel {
    /// Draws `count` channels, the gyro's temperature first if there is one.
    pub(super) fn several(draw: &mut Draw, temperature: bool, count: usize) -> Vec<Self> {
        let mut kinds = KINDS;
        draw.shuffle(&mut kinds);
        let gyro = temperature.then_some(GYRO);
        gyro.into_iter().chain(kinds).take(count).map(|kind| Self::new(draw, kind)).collect()
    }

    fn new(draw: &mut Draw, (name, centre, span, slow): Kind) -> Self {
        let mut share = |probability: f64| if draw.chance(probability) { draw.log_uniform(0.15, 1.5) } else { 0.0 };
        let mut channel = Self {
            name: name.to_owned(),
            centre: 0.0,
            span: 0.0,
            between_runs: share(0.7),
            ramp: share(0.4),
            warm_up: share(0.4),
            step: if slow { 0.0 } else { share(0.3) },
            wave: share(0.35),
            wander: share(0.5),
            walk: share(0.3),
            warm_up_s: draw.log_uniform(40.0, 2000.0),
            wave_s: draw.log_uniform(50.0, 5000.0),
            wander_s: draw.log_uniform(15.0, 300.0),
            noise: draw.log_uniform(1e-5, 3e-4),
        };
        channel.centre = draw.uniform(centre[0], centre[1]);
        channel.span = draw.log_uniform(span[0], span[1]);
        if channel.ramp + channel.warm_up + channel.step + channel.wave + channel.wander + channel.walk == 0.0 {
            channel.wander = 1.0;
        }
        channel
    }

    /// Its course over a run.
    pub(super) fn course(&self, draw: &mut Draw, seconds: usize) -> Course {
        let length_s = seconds as f64;
        let level = self.between_runs * draw.normal();
        let ramp = self.ramp * draw.normal();
        let warm_up = self.warm_up * draw.uniform(-1.5, 1.5);
        let (step, step_s) = (self.step * draw.normal(), draw.uniform(0.0, length_s));
        let phase = draw.uniform(0.0, TAU);
        let wander = smooth(draw, self.wander_s, seconds);
        let mut walk = 0.0;
        let truth: Vec<f64> = (0..seconds)
            .map(|second| {
                let t_s = second as f64 + 0.5;
                walk += self.walk * draw.normal() / length_s.sqrt();
                let motion = level
                    + ramp * (t_s / length_s - 0.5)
                    + warm_up * (-t_s / self.warm_up_s).exp()
                    + if t_s > step_s { step } else { 0.0 }
                    + self.wave * (TAU * t_s / self.wave_s + phase).sin()
                    + self.wander * wander[second]
                    + walk;
                self.centre + self.span * motion
            })
            .collect();
        let reading = truth.iter().map(|value| value + self.span * self.noise * draw.normal()).collect();
        Course { truth, reading }
    }
}

/// A stationary Gaussian process of variance 1: white noise through two equal low-passes of `correlation_s`.
pub(super) fn smooth(draw: &mut Draw, correlation_s: f64, seconds: usize) -> Vec<f64> {
    let kept = (-1.0 / correlation_s).exp();
    // x[k] = a·x[k−1] + √(1−a²)·n has variance 1 and correlation a; y[k] = a·y[k−1] + (1−a)·x[k] then has the variance
    // (1−a)²/(1−a²) · (1+a²)/(1−a²).
    let squared = 1.0 - kept * kept;
    let spread = (1.0 - kept) * (1.0 + kept * kept).sqrt() / squared;
    let (mut first, mut second) = (draw.normal(), 0.0);
    let lead_in = (8.0 * correlation_s) as usize;
    (0..lead_in + seconds)
        .map(|_| {
            first = kept * first + squared.sqrt() * draw.normal();
            second = kept * second + (1.0 - kept) * first;
            second / spread
        })
        .skip(lead_in)
        .collect()
}
