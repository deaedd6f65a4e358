//! How the base turns, as the accelerometers show it.

use north_finder::units::ARCSEC_PER_RAD;

use crate::run_data::RunData;

/// Turning of the base about the sensitive axis by the accelerometers, °/h: slopes of pitch and roll over `window_s` about
/// each sample, inside its dwell.
pub fn column(run: &RunData, window_s: f64) -> Vec<f64> {
    let samples = &run.samples;
    let slope = |i: usize| {
        let here = &samples[i];
        let near = |j: &usize| {
            let sample = &samples[*j];
            sample.dwell == here.dwell && !sample.moving && (sample.t_s - here.t_s).abs() <= 0.5 * window_s + 0.01
        };
        let first = (0..i).rev().take_while(near).last().unwrap_or(i);
        let last = (i..samples.len()).take_while(near).last().unwrap_or(i);
        let inside = samples.get(first..=last)?;
        let mean_s = inside.iter().map(|sample| sample.t_s).sum::<f64>() / inside.len() as f64;
        let (mut along, mut squares) = (0.0, 0.0);
        for sample in inside {
            let level = sample.level?;
            let t_s = sample.t_s - mean_s;
            along += t_s * (here.cos * level.left - here.sin * level.forward);
            squares += t_s * t_s;
        }
        (squares > 0.0).then(|| along / squares * ARCSEC_PER_RAD)
    };
    (0..samples.len()).map(|i| if samples[i].moving { 0.0 } else { slope(i).unwrap_or(0.0) }).collect()
}
