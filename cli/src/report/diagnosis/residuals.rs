//! The residual before and after: against time, against what carries each effect, in frequency, in averaging time.

use super::abscissa::{Abscissa, Points};
use crate::diagnose::{Diagnosis, RunSeries};
use crate::report::{Axis, Canvas, Legend, Plot, Side, cell, csv, escape, figure, number, quantile_of_sizes};

/// A plot reaches as far as the residuals do, but not further than this many times what 95 % of them keep within: 5.9
/// sigma of noise. What lies outside is counted in the caption.
const REACH: f64 = 3.0;
/// Most specks of a plot, so that the page stays small.
const SPECKS: usize = 1500;
/// Up to so many points are drawn as they are, without means.
const FEW: usize = 80;
/// Bins of the means.
const BINS: usize = 16;

pub fn section(diagnosis: &Diagnosis) -> String {
    let mut html = String::from("<h2>What is left of the rate</h2>\n");
    if diagnosis.residual_of == "dwell" {
        html.push_str("<p>The motion of the base is taken out of whole dwells: every second stands with what is left of its dwell.</p>\n");
    }
    if diagnosis.series.iter().any(|run| !run.t_s.is_empty()) {
        html.push_str(&against_time(&diagnosis.series));
        for effect in &diagnosis.effects {
            if let Some(abscissa) = Abscissa::of(effect) {
                html.push_str(&against(&abscissa, &effect.name, &diagnosis.series));
            }
        }
    }
    html.push_str(&periodogram(diagnosis));
    html.push_str(&allan(diagnosis));
    html
}

fn residuals(run: &RunSeries, side: Side) -> &[f64] {
    match side {
        Side::Before => &run.residual_before_deg_h,
        Side::After => &run.residual_after_deg_h,
    }
}

/// All runs one after the other; upright lines part them.
fn against_time(series: &[RunSeries]) -> String {
    let length_s = |run: &RunSeries| run.t_s.last().copied().unwrap_or_default();
    let total_s: f64 = series.iter().map(length_s).sum();
    let all: Vec<f64> = Side::BOTH
        .iter()
        .flat_map(|&side| series.iter().flat_map(move |run| residuals(run, side).iter().copied()))
        .filter(|value| value.is_finite())
        .collect();
    let limit = reach(&all);
    let draw = |canvas: Canvas| {
        let plots = Side::BOTH.map(|side| {
            let y = Axis::exact("residual, °/h", -limit, limit);
            let x = Axis::exact("time, all runs one after the other, s", 0.0, total_s.max(1.0));
            let mut plot = Plot::new(canvas.width, if canvas.narrow { 190.0 } else { 210.0 }, x, y);
            let rms = rms(series.iter().flat_map(|run| residuals(run, side).iter().copied()));
            plot.corner(&format!("{}, rms of all runs {} °/h", side.name(), number(rms, 3)));
            let step_s = total_s / plot.frame_width();
            let (mut bands, mut means, mut start_s) = (Vec::new(), Vec::new(), 0.0);
            for run in series {
                bands.extend(envelope(run, side, start_s, step_s));
                means.extend(smoothed(run, side, start_s, 6.0 * step_s));
                means.push((f64::NAN, f64::NAN));
                start_s += length_s(run);
                plot.upright("split", start_s);
            }
            plot.bars(&format!("band {}", side.name()), bands);
            plot.level("zero", 0.0);
            plot.line(&format!("mean {}", side.name()), means.iter().copied());
            plot
        });
        Vec::from(plots)
    };
    let caption = format!(
        "Measured rate less the Earth's, and less each run's own azimuth and bias; below, also less what was learned. Pale: \
         the spread; line: the mean. Dotted lines part the runs.{}{}",
        outside(&all, limit),
        seconds(series)
    );
    figure(Legend::None, "Residual against time before and after", &caption, draw)
}

/// The residuals by the second as a file.
fn seconds(series: &[RunSeries]) -> String {
    let rows = series.iter().flat_map(|run| {
        (0..run.t_s.len()).map(|i| {
            let numbers = [run.t_s[i], run.index_deg[i], run.residual_before_deg_h[i], run.residual_after_deg_h[i]];
            std::iter::once(run.file.clone()).chain(numbers.map(cell)).collect()
        })
    });
    csv("residuals.csv", &["run", "t_s", "index_deg", "before_deg_h", "after_deg_h"], rows)
}

/// How far a plot of these values reaches to either side.
fn reach(values: &[f64]) -> f64 {
    let quantile = |share| quantile_of_sizes(values.iter().copied(), share);
    (1.08 * quantile(1.0)).min(REACH * quantile(0.95)).max(1e-9)
}

/// How many values a plot does not show, in words.
fn outside(values: &[f64], limit: f64) -> String {
    match values.iter().filter(|value| value.abs() > limit).count() {
        0 => String::new(),
        count => format!(" Outside of the frame: {count} of {} values, before and after.", values.len()),
    }
}

/// Lowest and highest residual of every `step_s`.
fn envelope(run: &RunSeries, side: Side, start_s: f64, step_s: f64) -> Vec<(f64, f64, f64)> {
    grouped(run, side, step_s)
        .into_iter()
        .map(|(t_s, values)| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            (start_s + t_s, low, high)
        })
        .collect()
}

/// Mean residual of every `step_s`.
fn smoothed(run: &RunSeries, side: Side, start_s: f64, step_s: f64) -> Vec<(f64, f64)> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    grouped(run, side, step_s).into_iter().map(|(t_s, values)| (start_s + t_s, mean(&values))).collect()
}

/// Residuals gathered by time, with the mean time of each group. A gap of the recording becomes no group.
fn grouped(run: &RunSeries, side: Side, step_s: f64) -> Vec<(f64, Vec<f64>)> {
    let mut groups: Vec<(i64, f64, Vec<f64>)> = Vec::new();
    for (&t_s, &value) in run.t_s.iter().zip(residuals(run, side)).filter(|(_, value)| value.is_finite()) {
        let number = (t_s / step_s.max(1e-9)) as i64;
        match groups.last_mut() {
            Some((last, sum, values)) if *last == number => {
                *sum += t_s;
                values.push(value);
            }
            _ => groups.push((number, t_s, vec![value])),
        }
    }
    groups.into_iter().map(|(_, sum, values)| (sum / values.len() as f64, values)).collect()
}

/// Against what carries an effect: before above, after below, on one scale.
fn against(abscissa: &Abscissa, name: &str, series: &[RunSeries]) -> String {
    let points: Points = series.iter().flat_map(|run| abscissa.points(run)).collect();
    if points.len() < 2 {
        return String::new();
    }
    let few = points.len() <= FEW;
    let bins = if few { Vec::new() } else { bins(&points) };
    let values: Vec<f64> = points.iter().flat_map(|point| [point[1], point[2]]).collect();
    let limit = reach(&values);
    let draw = |canvas: Canvas| {
        let plots = Side::BOTH.map(|side| {
            let s = 1 + side as usize;
            let x = Axis::linear(abscissa.label(), points.iter().map(|point| point[0]));
            let mut plot = Plot::new(
                canvas.width,
                if canvas.narrow { 200.0 } else { 220.0 },
                x,
                Axis::exact("residual, °/h", -limit, limit),
            );
            plot.corner(side.name());
            plot.level("zero", 0.0);
            if few {
                plot.dots(side, points.iter().map(|point| (point[0], point[s])));
            } else {
                let step = points.len().div_ceil(SPECKS);
                plot.specks(side, points.iter().step_by(step).map(|point| (point[0], point[s])));
            }
            plot.bars(
                &format!("bar {}", side.name()),
                bins.iter().map(|bin| (bin.x, bin.mean[s - 1] - bin.sigma[s - 1], bin.mean[s - 1] + bin.sigma[s - 1])),
            );
            plot.dots(side, bins.iter().map(|bin| (bin.x, bin.mean[s - 1])));
            plot
        });
        Vec::from(plots)
    };
    let each =
        if *abscissa == Abscissa::TiltRate { "dwell of the index (tilt rate by the accelerometers)" } else { "second" };
    let marks = if few {
        format!("Dots: one a {each}.")
    } else {
        let groups = bins.len();
        format!(
            "Specks: one a {each}; dots: means of {groups} groups of equal size, with the standard error of the mean."
        )
    };
    let rows = points.iter().map(|point| point.map(cell).to_vec());
    let caption = format!(
        "The residual against what carries <code>{}</code>. {marks}{}{}",
        escape(name),
        outside(&values, limit),
        csv(&format!("{name}.csv"), &["x", "before_deg_h", "after_deg_h"], rows)
    );
    let about = format!("Residual against {} before and after", abscissa.label());
    figure(Legend::None, &about, &caption, draw)
}

/// Points of nearly the same abscissa.
struct Bin {
    x: f64,
    mean: [f64; 2],
    sigma: [f64; 2],
}

fn bins(points: &Points) -> Vec<Bin> {
    let mut sorted = points.clone();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let size = sorted.len().div_ceil(BINS).max(3);
    sorted
        .chunks(size)
        .filter(|chunk| 2 * chunk.len() > size)
        .map(|chunk| {
            let count = chunk.len() as f64;
            let mean = |i: usize| chunk.iter().map(|point| point[i]).sum::<f64>() / count;
            let sigma = |i: usize| {
                let mean = mean(i);
                let squares: f64 = chunk.iter().map(|point| (point[i] - mean).powi(2)).sum();
                (squares / (count - 1.0).max(1.0) / count).sqrt()
            };
            Bin { x: mean(0), mean: [mean(1), mean(2)], sigma: [sigma(1), sigma(2)] }
        })
        .collect()
}

fn periodogram(diagnosis: &Diagnosis) -> String {
    let spectra = &diagnosis.spectra;
    if spectra.frequency_hz.len() < 2 {
        return String::new();
    }
    let powers = [&spectra.power_before, &spectra.power_after];
    let draw = |canvas: Canvas| {
        // Single lines fall arbitrarily low, and what lies far below noise says nothing.
        let y = Axis::logarithmic(
            "power, multiple of white noise",
            powers.iter().flat_map(|power| power.iter().map(|value| value.max(0.01))).chain([1.0]),
        );
        let x = Axis::logarithmic("frequency, Hz", spectra.frequency_hz.iter().copied());
        let mut plot = Plot::new(canvas.width, 270.0, x, y);
        plot.level("reference", 1.0);
        for (side, power) in Side::BOTH.into_iter().zip(powers) {
            let points = spectra.frequency_hz.iter().copied().zip(power.iter().map(|value| value.max(1e-3)));
            plot.line(&format!("line {}", side.name()), points.filter(|(frequency, _)| *frequency > 0.0));
        }
        vec![plot]
    };
    let caption = "Periodogram of the residual of all runs. White noise lies about the dashed line; what stands above it is \
                   structure.";
    let rows = (0..spectra.frequency_hz.len())
        .map(|i| [spectra.frequency_hz[i], powers[0][i], powers[1][i]].map(cell).to_vec());
    let data = csv("periodogram.csv", &["frequency_hz", "before", "after"], rows);
    let caption = format!("{caption}{data}");
    figure(Legend::Lines("white noise"), "Periodogram of the residual before and after", &caption, draw)
}

fn allan(diagnosis: &Diagnosis) -> String {
    let spectra = &diagnosis.spectra;
    if spectra.tau_s.len() < 2 {
        return String::new();
    }
    let curves = [&spectra.allan_before_deg_h, &spectra.allan_after_deg_h];
    let draw = |canvas: Canvas| {
        let values = curves.iter().flat_map(|curve| curve.iter()).chain(&spectra.allan_white_deg_h).copied();
        let y = Axis::logarithmic("Allan deviation, °/h", values);
        let x = Axis::logarithmic("averaging time, s", spectra.tau_s.iter().copied());
        let mut plot = Plot::new(canvas.width, 270.0, x, y);
        let points = |values: &[f64]| -> Vec<(f64, f64)> {
            spectra.tau_s.iter().copied().zip(values.iter().copied()).filter(|(_, value)| *value > 0.0).collect()
        };
        plot.line("reference", points(&spectra.allan_white_deg_h));
        for (side, curve) in Side::BOTH.into_iter().zip(curves) {
            plot.line(&format!("line {}", side.name()), points(curve));
            plot.dots(side, points(curve));
        }
        vec![plot]
    };
    let source = if diagnosis.noise.declared_noise_deg_h.is_some() { "declared" } else { "measured" };
    let caption = format!(
        "Allan deviation of the residual. The dashed line is what the {source} white noise alone would give; a curve that \
         leaves it upwards holds something that does not average out.{}",
        csv(
            "allan.csv",
            &["tau_s", "before_deg_h", "after_deg_h", "white_deg_h"],
            (0..spectra.tau_s.len()).map(|i| {
                let white = spectra.allan_white_deg_h.get(i).copied().unwrap_or(f64::NAN);
                [spectra.tau_s[i], curves[0][i], curves[1][i], white].map(cell).to_vec()
            })
        )
    );
    figure(Legend::Lines("white noise alone"), "Allan deviation of the residual before and after", &caption, draw)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values
        .filter(|value| value.is_finite())
        .fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}
