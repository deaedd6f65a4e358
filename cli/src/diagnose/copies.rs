//! Channels that are the gyro itself: scaled, delayed, filtered or noisy copies of its rate, which explain everything and cause nothing.
//!
//! A copy holds the Earth's rate and the gyro's noise. A magnetometer on the spindle follows the heading as the Earth's rate does, but knows nothing
//! of the gyro's noise; a disturbance that the gyro feels goes with its noise, but knows nothing of north.

use super::Warning;
use crate::run_data::RunData;

/// A copy may come so many rows before the gyro or after it.
const EARLIER: usize = 3;
const LATER: usize = 12;
/// Both must go together by so many standard deviations: with a thousand channels and sixteen delays chance does it once in 10⁸ campaigns.
const SIGMAS: f64 = 7.0;

/// Takes channels out of the runs that are the gyro's own, but for those that a model already follows (`followed`), and says so.
pub fn leave_out(runs: &mut [RunData], followed: &dyn Fn(&str) -> bool, warnings: &mut Vec<Warning>) {
    let mut names: Vec<String> = runs.iter().flat_map(|run| run.names.iter().cloned()).collect();
    names.sort();
    names.dedup();
    for name in names.iter().filter(|name| !followed(name)) {
        let (by_earth, by_noise) = (of_earth(runs, name), of_noise(runs, name));
        if by_earth.abs() < SIGMAS || by_noise.abs() < SIGMAS {
            continue;
        }
        for run in runs.iter_mut() {
            if let Some(place) = run.names.iter().position(|each| each == name) {
                run.names.remove(place);
                run.channels.remove(place);
            }
        }
        warnings.push(Warning::of_campaign(format!(
            "column `{name}` is a copy of the gyro: it holds the Earth's rate ({:.0} sigma) and the gyro's own noise ({:.0} sigma); it is left out",
            by_earth.abs(),
            by_noise.abs()
        )));
    }
}

/// Rows at rest of a run: dwell, rate less the Earth's, Earth's rate, channel.
fn rows(run: &RunData, name: &str) -> Vec<(usize, f64, f64, f64)> {
    let azimuth_deg = run.reference_deg.or(run.before.map(|fix| fix.azimuth_deg));
    let (Some(values), Some(azimuth_deg)) = (run.channel(name), azimuth_deg) else { return Vec::new() };
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    run.samples
        .iter()
        .zip(values)
        .filter(|(sample, value)| run.enters(sample) && value.is_finite())
        .map(|(sample, value)| {
            let earth_deg_h = run.earth.north_deg_h * (sample.design.cos * cos + sample.design.sin * sin);
            (sample.dwell, sample.rate_deg_h - earth_deg_h, earth_deg_h, value)
        })
        .collect()
}

/// Student's t of the channel's dwell means on the Earth's rate, each run with a mean of its own.
fn of_earth(runs: &[RunData], name: &str) -> f64 {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    let mut free = 0.0;
    for run in runs {
        let rows = rows(run, name);
        let means: Vec<(f64, f64)> = rows
            .chunk_by(|a, b| a.0 == b.0)
            .map(|dwell| {
                let mean =
                    |of: fn(&(usize, f64, f64, f64)) -> f64| dwell.iter().map(of).sum::<f64>() / dwell.len() as f64;
                (mean(|row| row.2), mean(|row| row.3))
            })
            .collect();
        let count = means.len().max(1) as f64;
        let middle = (
            means.iter().map(|pair| pair.0).sum::<f64>() / count,
            means.iter().map(|pair| pair.1).sum::<f64>() / count,
        );
        pairs.extend(means.iter().map(|pair| (pair.0 - middle.0, pair.1 - middle.1)));
        free += (means.len() as f64 - 1.0).max(0.0);
    }
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>();
    let (of_earth, of_channel, both) =
        (sum(&|pair| pair.0 * pair.0), sum(&|pair| pair.1 * pair.1), sum(&|pair| pair.0 * pair.1));
    let left = (of_channel - both * both / of_earth).max(1e-12 * of_channel);
    let t = both / (of_earth * left / (free - 1.0)).sqrt();
    if free > 3.0 && t.is_finite() { t } else { 0.0 }
}

/// The greatest correlation of the curvature's sign with the changes of the gyro's rate within dwells, at any delay, in standard deviations of chance: the sign
/// alone, because behind a low-pass the channel still settles after a move.
fn of_noise(runs: &[RunData], name: &str) -> f64 {
    let (mut both, mut count) = ([0.0; EARLIER + LATER + 1], [0.0; EARLIER + LATER + 1]);
    let mut squares = (0.0, 0.0);
    for run in runs {
        for dwell in rows(run, name).chunk_by(|a, b| a.0 == b.0) {
            let changes: Vec<f64> = dwell.windows(2).map(|pair| pair[1].1 - pair[0].1).collect();
            squares.0 += changes.iter().map(|change| change * change).sum::<f64>();
            squares.1 += changes.len() as f64;
            for (i, three) in dwell.windows(3).enumerate() {
                let curvature = three[2].3 - 2.0 * three[1].3 + three[0].3;
                if curvature == 0.0 {
                    continue;
                }
                for (delay, (sum, number)) in both.iter_mut().zip(&mut count).enumerate() {
                    if let Some(change) = (i + 1 + EARLIER).checked_sub(delay).and_then(|place| changes.get(place)) {
                        *sum += curvature.signum() * change;
                        *number += 1.0;
                    }
                }
            }
        }
    }
    // Signs of a curvature go with their neighbours by −0.46 and +0.11 (arcsine law), changes by −1/2: the sum scatters by √(1 + 2 · 0.46/2) as much as
    // that of independent ones.
    let z = |(sum, number): (&f64, &f64)| sum / (1.46 * number * squares.0 / squares.1).sqrt();
    let all: Vec<f64> = both.iter().zip(&count).map(z).filter(|z| z.is_finite()).collect();
    all.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
}
