//! The recent past of a channel, for lags and rates of change.

use heapless::Deque;

use super::channel::ChannelName;

/// Samples that are kept.
const SAMPLES: usize = 32;
/// Fewest samples that give a rate, where not fewer are asked for.
const LEAST_RATE_SAMPLES: usize = 10;

/// The last samples of a channel, or of what a low-pass makes of it.
///
/// Samples are kept as small numbers, steps in time and distances from the first value, because a board has little memory.
#[derive(Clone, Debug)]
pub struct Window {
    channel: ChannelName,
    /// Time constant of the low-pass, seconds; 0: none.
    low_pass_s: f32,
    /// The first value since the last gap.
    first: f64,
    /// Seconds since the sample before, and value less the first; oldest first.
    past: Deque<(f32, f32), SAMPLES>,
}

impl Window {
    pub fn new(channel: ChannelName, low_pass_s: f32) -> Self {
        Self { channel, low_pass_s, first: 0.0, past: Deque::new() }
    }

    pub fn channel(&self) -> &ChannelName {
        &self.channel
    }

    pub fn is_of(&self, channel: &ChannelName, low_pass_s: f32) -> bool {
        self.channel == *channel && self.low_pass_s == low_pass_s
    }

    /// Takes a value, `step_s` after the one before. The low-pass starts at the first value. A missing value starts
    /// everything again.
    pub fn push(&mut self, step_s: f64, value: Option<f64>) {
        let Some(value) = value else {
            self.past.clear();
            return;
        };
        if self.past.is_empty() {
            self.first = value;
        }
        let above = value - self.first;
        let passed = match self.past.back() {
            Some(&(_, last)) => super::low_pass(last.into(), above, step_s, self.low_pass_s.into()),
            None => above,
        };
        if self.past.is_full() {
            self.past.pop_front();
        }
        let _ = self.past.push_back((step_s as f32, passed as f32));
    }

    /// Age in seconds and value less the first of each sample, the latest first.
    fn samples(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.past.iter().rev().scan(0.0, |age_s, &(step_s, above)| {
            let own_s = *age_s;
            *age_s += f64::from(step_s);
            Some((own_s, f64::from(above)))
        })
    }

    /// The value of `lag_s` ago, between samples by a straight line; the oldest if nothing is that old.
    pub fn lagged(&self, lag_s: f64) -> Option<f64> {
        let mut samples = self.samples();
        let mut after = samples.next()?;
        for (age_s, above) in samples {
            if age_s >= lag_s {
                let share = if age_s > after.0 { (lag_s - after.0).max(0.0) / (age_s - after.0) } else { 0.0 };
                return Some(self.first + after.1 + share * (above - after.1));
            }
            after = (age_s, above);
        }
        Some(self.first + after.1)
    }

    /// Rate of change per second over the last `count` samples (3 … 30): the least-squares slope, which is that of their
    /// middle; or, `curved`, the slope of a parabola at its end, which does not come late but is noisier. Half a minute of a
    /// sensor that resolves 0.01 K still gives 1e-4 K/s. `None` before ten samples are there, or `count` if these are fewer.
    pub fn rate(&self, count: usize, curved: bool) -> Option<f64> {
        if self.past.len() < LEAST_RATE_SAMPLES.min(count) {
            return None;
        }
        let last = || self.samples().take(count).map(|(age_s, above)| (-age_s, above));
        let number = self.past.len().min(count) as f64;
        let mean_s = last().map(|(t_s, _)| t_s).sum::<f64>() / number;
        let (mut with_time, mut time_squared, mut time_cubed) = (0.0, 0.0, 0.0);
        for (t_s, above) in last() {
            let t_s = t_s - mean_s;
            with_time += t_s * above;
            time_squared += t_s * t_s;
            time_cubed += t_s * t_s * t_s;
        }
        if time_squared <= 0.0 {
            return None;
        }
        let slope = with_time / time_squared;
        if !curved {
            return Some(slope);
        }
        // The part of t² that neither a constant nor t imitates.
        let (skew, spread) = (time_cubed / time_squared, time_squared / number);
        let (mut with_bend, mut bend_squared) = (0.0, 0.0);
        for (t_s, above) in last() {
            let t_s = t_s - mean_s;
            let bend = t_s * t_s - skew * t_s - spread;
            with_bend += bend * above;
            bend_squared += bend * bend;
        }
        (bend_squared > 0.0).then(|| slope + with_bend / bend_squared * (-2.0 * mean_s - skew))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(values: impl Iterator<Item = f64>) -> Window {
        let mut window = Window::new(ChannelName::new("temp_c").unwrap(), 0.0);
        values.for_each(|value| window.push(1.0, Some(value)));
        window
    }

    #[test]
    fn a_rate_at_the_end_of_a_curve() {
        // t² at 0, 1 … 5 s: a straight line has the slope of its middle, 5; at the end it is 10.
        let window = window((0..6).map(|t| f64::from(t * t)));
        assert!((window.rate(6, false).unwrap() - 5.0).abs() < 1e-9);
        assert!((window.rate(6, true).unwrap() - 10.0).abs() < 1e-9);
    }

    #[test]
    fn earlier_values_lie_between_samples() {
        let window = window([20.0, 24.0, 22.0].into_iter());
        for (lag_s, value) in [(0.0, 22.0), (0.5, 23.0), (1.0, 24.0), (1.25, 23.0), (9.0, 20.0)] {
            assert_eq!(window.lagged(lag_s), Some(value), "{lag_s}");
        }
    }

    #[test]
    fn a_rate_waits_and_starts_again_after_a_gap() {
        let mut window = window((0..9).map(|i| 0.25 * f64::from(i)));
        assert_eq!(window.rate(30, false), None);
        window.push(1.0, Some(2.25));
        assert_eq!(window.rate(30, false), Some(0.25));
        window.push(1.0, None);
        assert_eq!(window.rate(30, false), None);
    }
}
