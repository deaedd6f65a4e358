//! Means of the dwells before and after, on one scale, with the band that white noise alone would keep within.

use crate::diagnose::{Diagnosis, RunSeries};
use crate::report::{Axis, Canvas, Legend, Plot, Side, cell, csv, figure, quantile_of_sizes};

/// An index that moves by more than this is at another dwell, degrees.
const APART_DEG: f64 = 0.5;
/// Half width of the band in standard deviations: white noise is outside once in twenty.
const BAND: f64 = 1.96;

/// The mean of a dwell.
struct Dwell {
    run: usize,
    t_s: f64,
    index_deg: f64,
    seconds: f64,
    mean_deg_h: [f64; 2],
}

pub fn section(diagnosis: &Diagnosis) -> String {
    let dwells: Vec<Dwell> =
        diagnosis.series.iter().enumerate().flat_map(|(run, series)| of_run(run, series)).collect();
    if dwells.is_empty() {
        return String::new();
    }
    let noise_deg_h = diagnosis.noise.declared_noise_deg_h.unwrap_or(diagnosis.noise.noise_deg_h);
    let sigma = |dwell: &Dwell| noise_deg_h / dwell.seconds.sqrt();
    let all = || dwells.iter().flat_map(|dwell| dwell.mean_deg_h);
    let widest = dwells.iter().map(|dwell| 1.3 * BAND * sigma(dwell)).fold(0.0, f64::max);
    let limit = (1.1 * quantile_of_sizes(all(), 1.0)).max(widest).max(1e-9);
    let draw = |canvas: Canvas| {
        let plots = Side::BOTH.map(|side| {
            let x = Axis::exact("dwell, all runs one after the other", -0.5, dwells.len() as f64 - 0.5);
            let y = Axis::exact("mean of a dwell, °/h", -limit, limit);
            let mut plot = Plot::new(canvas.width, if canvas.narrow { 190.0 } else { 210.0 }, x, y);
            plot.corner(side.name());
            for edge in [BAND, -BAND] {
                plot.line("reference", dwells.iter().enumerate().map(|(i, dwell)| (i as f64, edge * sigma(dwell))));
            }
            plot.level("zero", 0.0);
            for (i, pair) in dwells.windows(2).enumerate().filter(|(_, pair)| pair[0].run != pair[1].run) {
                plot.upright("split", i as f64 + 0.5 * (pair.len() as f64 - 1.0));
            }
            plot.dots(side, dwells.iter().enumerate().map(|(i, dwell)| (i as f64, dwell.mean_deg_h[side as usize])));
            plot
        });
        Vec::from(plots)
    };
    let inside = |side: usize| {
        let within = dwells.iter().filter(|dwell| dwell.mean_deg_h[side].abs() <= BAND * sigma(dwell)).count();
        100.0 * within as f64 / dwells.len() as f64
    };
    let rows = dwells.iter().map(|dwell| {
        let numbers =
            [dwell.t_s, dwell.index_deg, dwell.seconds, dwell.mean_deg_h[0], dwell.mean_deg_h[1], sigma(dwell)];
        std::iter::once(diagnosis.series[dwell.run].file.clone()).chain(numbers.map(cell)).collect()
    });
    let head = ["run", "t_s", "index_deg", "seconds", "before_deg_h", "after_deg_h", "sigma_deg_h"];
    let caption = format!(
        "Mean of the residual over each dwell; dashed: ± {BAND} sigma of white noise alone (each run's own azimuth and bias, \
         which are fitted, take some of it). Inside: {:.0} % before, {:.0} % after. Dotted lines part the runs.{}",
        inside(0),
        inside(1),
        csv("dwells.csv", &head, rows)
    );
    figure(Legend::None, "Means of the dwells before and after", &caption, draw)
}

fn of_run(run: usize, series: &RunSeries) -> Vec<Dwell> {
    let mut dwells: Vec<Dwell> = Vec::new();
    let mut last_deg = f64::NAN;
    for i in 0..series.t_s.len() {
        let (before, after) = (series.residual_before_deg_h[i], series.residual_after_deg_h[i]);
        if !before.is_finite() || !after.is_finite() {
            continue;
        }
        let (index_deg, seconds) = (series.index_deg[i], series.seconds[i]);
        let apart = ((index_deg - last_deg + 180.0).rem_euclid(360.0) - 180.0).abs();
        let same = apart <= APART_DEG;
        last_deg = index_deg;
        match dwells.last_mut().filter(|_| same) {
            Some(dwell) => {
                dwell.seconds += seconds;
                let share = seconds / dwell.seconds;
                dwell.t_s += share * (series.t_s[i] - dwell.t_s);
                dwell.mean_deg_h[0] += share * (before - dwell.mean_deg_h[0]);
                dwell.mean_deg_h[1] += share * (after - dwell.mean_deg_h[1]);
            }
            None => {
                dwells.push(Dwell { run, t_s: series.t_s[i], index_deg, seconds, mean_deg_h: [before, after] });
            }
        }
    }
    // In a rotation there are none.
    dwells.retain(|dwell| dwell.seconds > 1.0);
    dwells
}
