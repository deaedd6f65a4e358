//! What a channel leaves behind: play operators, low-passes.

/// The play operator (Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989): it follows the input only where this
/// pushes it, `half_width` behind. Begins at the first value.
pub fn play(input: &[f64], half_width: f64) -> Vec<f64> {
    let mut state = input.first().copied().unwrap_or_default();
    input
        .iter()
        .map(|&value| {
            state = state.clamp(value - half_width, value + half_width);
            state
        })
        .collect()
}

/// A first-order low-pass over intervals of these lengths; begins at `start`.
pub fn low_pass_from(start: f64, input: &[f64], interval_s: &[f64], time_s: f64) -> Vec<f64> {
    let mut state = start;
    input
        .iter()
        .zip(interval_s)
        .map(|(&value, interval)| {
            state += (value - state) * -(-interval / time_s).exp_m1();
            state
        })
        .collect()
}

/// The same, beginning at the first value.
pub fn low_pass(input: &[f64], interval_s: &[f64], time_s: f64) -> Vec<f64> {
    low_pass_from(input.first().copied().unwrap_or_default(), input, interval_s, time_s)
}
