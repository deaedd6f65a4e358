//! What the channels of a recording show: temperature, voltages, fields, anything.

use super::draw::Draw;
use std::f64::consts::TAU;

/// A channel of the campaign: its name and how it moves. Every run has its own course of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Column name; `temp_c` is the gyro's temperature.
    pub name: String,
    /// A typical value, in the channel's own unit.
    pub centre: f64,
    /// How much it varies, in the same unit: the motions below are shares of it.
    pub span: f64,
    /// Spread of the mean from run to run.
    between_runs: f64,
    /// Exponential settling since switch-on.
    settling: f64,
    settling_s: f64,
    /// A sinusoid with a phase of each run's own.
    wave: f64,
    wave_s: f64,
    /// A smooth random course.
    wander: f64,
    wander_s: f64,
    /// Jumps at random times.
    jumps: f64,
    jumps_s: f64,
    /// Noise of a reading.
    noise: f64,
    /// Smallest step of a reading; 0: none.
    step: f64,
}

/// A channel in one run, at 0, 1, 2 … seconds: what is truly so and what is recorded.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    pub(super) truth: Vec<f64>,
    pub(super) reading: Vec<f64>,
}

const WORDS: [&str; 24] = [
    "supply_v",
    "laser_ma",
    "mag_x_ut",
    "mag_y_ut",
    "fan_rpm",
    "case_c",
    "board_c",
    "pump_ma",
    "vib_mg",
    "humidity_pct",
    "pressure_hpa",
    "coil_c",
    "pd_mv",
    "heater_w",
    "adc3",
    "adc7",
    "ch_12",
    "p4",
    "strain_a",
    "bus_v",
    "wind_m_s",
    "sun_w",
    "load_n",
    "x",
];

impl Channel {
    /// The gyro's temperature, °C.
    pub(super) fn temperature(draw: &mut Draw) -> Self {
        let mut channel = Self::lively(draw, "temp_c".into());
        channel.centre = draw.uniform(-10.0, 40.0);
        channel.span = draw.log_uniform(0.8, 8.0);
        channel.jumps = 0.0;
        if channel.settling + channel.wave + channel.wander == 0.0 {
            channel.wander = 1.0;
        }
        channel.wander_s = draw.log_uniform(60.0, 400.0);
        channel.noise = draw.log_uniform(0.0002, 0.001) / channel.span;
        channel
    }

    /// A channel of any kind, with a name that none of `taken` has.
    pub(super) fn any(draw: &mut Draw, taken: &[Self]) -> Self {
        let word = draw.pick(&WORDS);
        let name = if taken.iter().any(|channel| channel.name == word) {
            format!("{word}_{}", taken.len())
        } else {
            word.to_owned()
        };
        let mut channel = Self::lively(draw, name);
        channel.centre = draw.sign() * draw.log_uniform(0.01, 1000.0);
        channel.span = channel.centre.abs() * draw.log_uniform(0.01, 0.5);
        channel
    }

    fn lively(draw: &mut Draw, name: String) -> Self {
        let some = |draw: &mut Draw, probability| {
            if draw.chance(probability) { draw.uniform(0.3, 1.0) } else { 0.0 }
        };
        let mut channel = Self {
            name,
            centre: 0.0,
            span: 1.0,
            between_runs: draw.uniform(0.0, 1.0),
            settling: some(draw, 0.4),
            settling_s: draw.log_uniform(60.0, 1500.0),
            wave: some(draw, 0.4),
            wave_s: draw.log_uniform(40.0, 600.0),
            wander: some(draw, 0.7),
            wander_s: draw.log_uniform(15.0, 200.0),
            jumps: some(draw, 0.2),
            jumps_s: draw.log_uniform(30.0, 150.0),
            noise: draw.log_uniform(0.0001, 0.002),
            step: 0.0,
        };
        if channel.settling + channel.wave + channel.wander + channel.jumps == 0.0 {
            channel.wander = 1.0;
        }
        channel
    }

    /// Without jumps: a rate of change makes sense.
    pub(super) fn without_jumps(&mut self) {
        self.jumps = 0.0;
        self.wander = self.wander.max(0.3);
        self.wander_s = self.wander_s.max(30.0);
    }

    /// Readings that are mostly noise.
    pub(super) fn drown(&mut self, draw: &mut Draw) {
        self.noise = draw.uniform(0.3, 1.2);
    }

    /// Readings in coarse steps.
    pub(super) fn coarsen(&mut self, draw: &mut Draw) {
        self.step = draw.uniform(0.5, 1.5);
    }

    /// The channel over a run of `seconds`.
    pub(super) fn course(&self, draw: &mut Draw, seconds: usize) -> Course {
        let level = self.between_runs * draw.normal();
        let settling = self.settling * draw.uniform(-1.5, 1.5);
        let phase = draw.uniform(0.0, TAU);
        let wander = smooth(draw, self.wander_s, seconds);
        let mut jump = draw.normal();
        let mut truth = Vec::with_capacity(seconds + 1);
        for (second, wander) in wander.iter().enumerate() {
            let t_s = second as f64;
            if draw.chance(1.0 / self.jumps_s) {
                jump = draw.normal();
            }
            let motion = level
                + settling * (-t_s / self.settling_s).exp()
                + self.wave * (TAU * t_s / self.wave_s + phase).sin()
                + self.wander * wander
                + self.jumps * jump;
            truth.push(self.centre + self.span * motion);
        }
        let step = self.span * self.step;
        let counted = |value: f64| if step > 0.0 { step * (value / step).round() } else { value };
        let reading = truth.iter().map(|value| counted(value + self.span * self.noise * draw.normal())).collect();
        Course { truth, reading }
    }
}

/// A Gaussian process of variance 1 that is smooth over `correlation_s`: white noise through two equal low-passes.
fn smooth(draw: &mut Draw, correlation_s: f64, seconds: usize) -> Vec<f64> {
    let kept = (-1.0 / correlation_s).exp();
    let drive = (1.0 - kept * kept).sqrt();
    let mut first = draw.normal();
    // Stationary second stage: variance of y[k] = a·y[k−1] + (1 − a)·x[k] for an x with correlation a is
    // (1 − a)(1 + a²) / ((1 + a)(1 − a²)) of x's.
    let ratio = ((1.0 - kept) * (1.0 + kept * kept) / ((1.0 + kept) * (1.0 - kept * kept))).sqrt();
    let mut second = 0.0;
    let lead_in = (8.0 * correlation_s) as usize;
    let mut out = Vec::with_capacity(seconds + 1);
    for step in 0..=lead_in + seconds {
        first = kept * first + drive * draw.normal();
        second = kept * second + (1.0 - kept) * first;
        if step >= lead_in {
            out.push(second / ratio);
        }
    }
    out
}

impl Course {
    /// The true value at a time, s.
    pub(super) fn at(&self, t_s: f64) -> f64 {
        let below = (t_s.max(0.0) as usize).min(self.truth.len().saturating_sub(2));
        let share = (t_s - below as f64).clamp(0.0, 1.0);
        match self.truth.get(below..below + 2) {
            Some([first, second]) => first + share * (second - first),
            _ => 0.0,
        }
    }

    /// Behind a low-pass of time constant `tau_s` that has settled to the value at 0.
    pub(super) fn low_passed(&self, tau_s: f64, t_s: f64) -> f64 {
        let kept = (-1.0 / tau_s).exp();
        let last = (t_s + 0.5) as usize;
        let mut value = self.truth.first().copied().unwrap_or_default();
        for pair in self.truth.windows(2).take(last) {
            value = kept * value + (1.0 - kept) * 0.5 * (pair[0] + pair[1]);
        }
        value
    }

    /// Position, −1 … 1, of a play of this width behind the value.
    pub(super) fn play(&self, width: f64, t_s: f64) -> f64 {
        let mut follower = self.truth.first().copied().unwrap_or_default();
        let mut value = follower;
        for now in self.truth.iter().take((t_s + 1.0) as usize) {
            value = *now;
            follower = follower.clamp(value - width / 2.0, value + width / 2.0);
        }
        (value - follower) / (width / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_course_has_unit_variance() {
        let values = smooth(&mut Draw::new(1, 1), 20.0, 200_000);
        let variance = values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
        // Two equal low-passes of 20 s: some 200000 / (5 · 20) independent values.
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / 2000.0_f64).sqrt(), "{variance}");
    }

    #[test]
    fn names_are_unique() {
        let mut draw = Draw::new(3, 0);
        let mut channels: Vec<Channel> = Vec::new();
        for _ in 0..40 {
            let next = Channel::any(&mut draw, &channels);
            assert!(channels.iter().all(|channel| channel.name != next.name), "{}", next.name);
            channels.push(next);
        }
    }
}
