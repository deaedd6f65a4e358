//! What a channel leaves behind: play operators, relays, friction, low-passes, delays, peaks.

/// Length of the beginning whose slope is the first rate of change, seconds.
const FIRST_S: f64 = 4.0;

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

/// A relay with two thresholds: 1 from the second upwards, 0 from the first downwards, in between what it was.
pub fn relay(input: &[f64], [low, high]: [f64; 2], begins: f64) -> Vec<f64> {
    let mut state = begins;
    let of = |&value: &f64| {
        if value > high {
            state = 1.0;
        } else if value < low {
            state = 0.0;
        }
        state
    };
    input.iter().map(of).collect()
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

/// What is smooth in the input (Whittaker, On a New Method of Graduation, 1923): the series whose sum of squared deviations from
/// the input plus τ⁴ times that of its second differences is least, so that a sinusoid of ω in each step keeps 1/(1 + (ωτ)⁴). Its ends
/// are no worse than straight lines.
pub fn smoothed(input: &[f64], time: f64) -> Vec<f64> {
    let n = input.len();
    let stiffness = time.powi(4);
    // (1 + τ⁴ DᵀD) z = input, of which the diagonal and two beside it are not zero, as L diag Lᵀ.
    let (mut diagonal, mut near, mut far) = (vec![1.0; n], vec![0.0; n], vec![0.0; n]);
    for i in 2..n {
        for (place, share) in [(i - 2, 1.0), (i - 1, 4.0), (i, 1.0)] {
            diagonal[place] += share * stiffness;
        }
        near[i - 1] -= 2.0 * stiffness;
        near[i] -= 2.0 * stiffness;
        far[i] += stiffness;
    }
    let mut smooth = input.to_vec();
    for i in 0..n {
        if i > 1 {
            far[i] /= diagonal[i - 2];
            near[i] -= far[i] * diagonal[i - 2] * near[i - 1];
            diagonal[i] -= far[i] * far[i] * diagonal[i - 2];
            smooth[i] -= far[i] * smooth[i - 2];
        }
        if i > 0 {
            near[i] /= diagonal[i - 1];
            diagonal[i] -= near[i] * near[i] * diagonal[i - 1];
            smooth[i] -= near[i] * smooth[i - 1];
        }
    }
    smooth.iter_mut().zip(&diagonal).for_each(|(value, diagonal)| *value /= diagonal);
    for i in (0..n).rev() {
        if i + 1 < n {
            smooth[i] -= near[i + 1] * smooth[i + 1];
        }
        if i + 2 < n {
            smooth[i] -= far[i + 2] * smooth[i + 2];
        }
    }
    smooth
}

/// A first-order low-pass that begins at the first value.
pub fn low_pass(input: &[f64], interval_s: &[f64], time_s: f64) -> Vec<f64> {
    low_pass_from(input.first().copied().unwrap_or_default(), input, interval_s, time_s)
}

/// Rate of change at the beginning, per second: the slope of the first seconds.
pub fn first_rate(input: &[f64], interval_s: &[f64]) -> f64 {
    let ends_s = interval_s.iter().scan(0.0, |end, interval| {
        *end += interval;
        Some(*end)
    });
    let first: Vec<(f64, f64)> = ends_s.zip(input.iter().copied()).take_while(|each| each.0 <= FIRST_S).collect();
    let number = first.len().max(1) as f64;
    let [t, value] =
        [first.iter().map(|each| each.0).sum::<f64>(), first.iter().map(|each| each.1).sum()].map(|sum| sum / number);
    let squares: f64 = first.iter().map(|each| (each.0 - t).powi(2)).sum();
    let products: f64 = first.iter().map(|each| (each.0 - t) * (each.1 - value)).sum();
    if squares > 0.0 { products / squares } else { 0.0 }
}

/// What was some time ago; before the beginning the first value.
pub fn delay(input: &[f64], interval_s: &[f64], delay_s: f64) -> Vec<f64> {
    let (mut at, mut ahead_s) = (0, 0.0);
    (0..input.len())
        .map(|i| {
            ahead_s += interval_s[i];
            while at < i && ahead_s > delay_s + interval_s[at] {
                ahead_s -= interval_s[at];
                at += 1;
            }
            input[at]
        })
        .collect()
}

/// The greatest value so far, which leaks towards the present one.
pub fn peak(input: &[f64], interval_s: &[f64], leak_s: f64) -> Vec<f64> {
    let mut state = f64::NEG_INFINITY;
    let of = |(&value, interval): (&f64, &f64)| {
        state = value.max(value + (state - value) * (-interval / leak_s).exp());
        state
    };
    input.iter().zip(interval_s).map(of).collect()
}

/// Friction (Bouc and Wen's model of exponent 1, without its asymmetric part): the state follows the input's changes u' and slips,
/// z' = u' − slip |u'| z − z/leak; begins at rest.
pub fn friction(input: &[f64], interval_s: &[f64], slip: f64, leak_s: f64) -> Vec<f64> {
    let (mut last, mut state) = (input.first().copied().unwrap_or_default(), 0.0_f64);
    let of = |(&value, interval): (&f64, &f64)| {
        let step: f64 = value - last;
        last = value;
        // Exact between two seconds for a constant rate of change.
        let rate = slip * step.abs() + interval / leak_s;
        let kept = (-rate).exp();
        state = state * kept + if rate > 0.0 { step * (1.0 - kept) / rate } else { 0.0 };
        state
    };
    input.iter().zip(interval_s).map(of).collect()
}
