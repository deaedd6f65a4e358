//! Axes of a plot: from values to pixels, and ticks at round numbers.

/// How values are spread over an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spread {
    Linear,
    Logarithmic,
}

/// An axis with its label and its range.
#[derive(Clone, Debug)]
pub struct Axis {
    pub label: String,
    pub low: f64,
    pub high: f64,
    spread: Spread,
}

impl Axis {
    /// A linear axis over the values and a little more; never empty.
    pub fn linear(label: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = range(values).unwrap_or((0.0, 1.0));
        let room = match high - low {
            0.0 => (0.1 * high.abs()).max(1e-9),
            width => 0.06 * width,
        };
        Self::exact(label, low - room, high + room)
    }

    /// A linear axis from `low` to `high`.
    pub fn exact(label: impl Into<String>, low: f64, high: f64) -> Self {
        Self { label: label.into(), low, high, spread: Spread::Linear }
    }

    /// A logarithmic axis over the values above 0.
    pub fn logarithmic(label: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = range(values.into_iter().filter(|value| *value > 0.0)).unwrap_or((1.0, 10.0));
        let (low, high) = if high / low < 2.0 { (low / 1.5, high * 1.5) } else { (low / 1.15, high * 1.15) };
        Self { label: label.into(), low, high, spread: Spread::Logarithmic }
    }

    /// The place of a value: 0 at the low end, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        match self.spread {
            Spread::Linear => (value - self.low) / (self.high - self.low),
            Spread::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
        }
    }

    /// About `count` round values with their texts.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        match self.spread {
            // Round steps may be coarse: three ticks at least, so that the scale can be read.
            Spread::Linear => (count..count + 8)
                .map(|count| self.linear_ticks(count))
                .find(|ticks| ticks.len() > 2)
                .unwrap_or_else(|| self.linear_ticks(count)),
            // Within a decade there may be none of 1, 2, 5 and 10.
            Spread::Logarithmic => Some(self.logarithmic_ticks(count))
                .filter(|ticks| ticks.len() > 1)
                .unwrap_or_else(|| self.linear_ticks(count)),
        }
    }

    fn linear_ticks(&self, count: usize) -> Vec<(f64, String)> {
        let step = round_step((self.high - self.low) / count.max(1) as f64);
        let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        (first..=last.min(first.saturating_add(50)))
            .map(|i| (i as f64 * step, label(i as f64 * step, decimals)))
            .collect()
    }

    fn logarithmic_ticks(&self, count: usize) -> Vec<(f64, String)> {
        let decades = (self.high / self.low).log10();
        let mantissas: &[f64] = if decades * 3.0 <= count as f64 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = if mantissas.len() == 1 { (decades / count as f64).ceil().max(1.0) as i32 } else { 1 };
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        (first..=last)
            .filter(|power| power.rem_euclid(every) == 0)
            .flat_map(|power| mantissas.iter().map(move |mantissa| (mantissa * 10f64.powi(power), power)))
            .filter(|(value, _)| (self.low..=self.high).contains(value))
            .map(|(value, power)| (value, label(value, (-power).clamp(0, 12) as usize)))
            .collect()
    }
}

/// The smallest of 1, 2 or 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    if step.is_nan() || step <= 0.0 || step.is_infinite() {
        return 1.0;
    }
    let power = 10f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0].iter().map(|mantissa| mantissa * power).find(|round| *round >= step * 0.999).unwrap_or(10.0 * power)
}

fn label(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { "0".into() } else { text.replace('-', "−") }
}

fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|value| value.is_finite()).fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((value.min(low), value.max(high)))
    })
}

/// The value below which a share of the absolute values lies.
pub fn quantile_of_sizes(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut sizes: Vec<f64> = values.into_iter().map(f64::abs).filter(|size| size.is_finite()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let at = (share * sizes.len().saturating_sub(1) as f64).round() as usize;
    sizes.get(at).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis, count: usize) -> Vec<String> {
        axis.ticks(count).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(texts(&Axis::exact("", -0.7, 1.2), 4), ["−0.5", "0", "0.5", "1.0"]);
        assert_eq!(texts(&Axis::exact("", -190.0, 190.0), 3), ["−100", "0", "100"]);
        assert_eq!(texts(&Axis::exact("", 0.0, 152.0), 4), ["0", "50", "100", "150"]);
        assert_eq!(texts(&Axis::logarithmic("", [0.05, 30.0]), 4), ["0.1", "1", "10"]);
        assert_eq!(texts(&Axis::logarithmic("", [1.0, 9.0]), 4), ["1", "2", "5", "10"]);
        assert_eq!(texts(&Axis::logarithmic("", [3.1, 3.2]), 4), ["3", "4"]);
    }

    #[test]
    fn nothing_to_draw_is_still_an_axis() {
        let axis = Axis::linear("", [f64::NAN]);
        assert!(axis.place(0.5).is_finite());
        assert!(!axis.ticks(5).is_empty());
        assert!(Axis::linear("", [3.0, 3.0]).high > 3.0);
    }
}
