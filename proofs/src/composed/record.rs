//! Recordings: the geometry of the instrument, its noise, and the effects at their ports.

use crate::hidden::draw::Draw;

use super::effect::{Effect, Port};
use super::plan::Plan;
use super::signal::{View, earth_rate_deg_h};

/// One second.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// End of the second, s.
    pub t_s: f64,
    pub index_deg: f64,
    pub fog_arcsec: f64,
    /// Forward and left accelerometer, g.
    pub level_g: [f64; 2],
    pub channels: Vec<f64>,
}

/// Mean and standard deviation of every channel over all seconds of the campaign.
pub(super) fn spreads(plan: &Plan) -> Vec<[f64; 2]> {
    let of = |channel: usize| {
        let values = || plan.runs.iter().flat_map(move |run| run.courses[channel].truth.iter().copied());
        let count = values().count() as f64;
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        [mean, variance.sqrt().max(f64::MIN_POSITIVE)]
    };
    (0..plan.channels.len()).map(of).collect()
}

/// A run as it is.
pub(super) fn true_view(plan: &Plan, number: usize) -> View<'_> {
    let run = &plan.runs[number];
    View {
        azimuth_deg: run.azimuth_deg,
        latitude_deg: plan.latitude_deg,
        tilt_rad: run.tilt_rad,
        day_s: (run.started_s % 86_400) as f64,
        rest_s: run.rest_s,
        index_deg: &run.index_deg,
        moves: &run.moves,
        channels: run.courses.iter().map(|course| course.truth.as_slice()).collect(),
    }
}

/// What each effect does at its port in a run, in its unit, by the second.
pub(super) fn courses(plan: &Plan, number: usize, effects: &[Effect], spreads: &[[f64; 2]]) -> Vec<(Port, Vec<f64>)> {
    let (run, view) = (&plan.runs[number], true_view(plan, number));
    let of = |(effect, stream): (&Effect, u64)| {
        let mut course = effect.course(plan, number, &view, spreads);
        let process = effect.process.map(|process| process.course(&mut Draw::new(run.seed, stream), course.len()));
        for (second, value) in course.iter_mut().enumerate() {
            *value *= effect.weight * process.as_ref().map_or(1.0, |process| process[second]);
        }
        (effect.port, course)
    };
    effects.iter().zip(1..).map(of).collect()
}

/// Records a run; `noise` scales all noise of gyro, encoder and levels.
pub(super) fn rows(plan: &Plan, number: usize, effects: &[Effect], spreads: &[[f64; 2]], noise: f64) -> Vec<Row> {
    let run = &plan.runs[number];
    let courses = courses(plan, number, effects, spreads);
    let mut draw = Draw::new(run.seed, 0);
    let [pitch, roll] = run.tilt_rad;
    let second = |second: usize| {
        let sum = |port: Port| -> f64 {
            courses.iter().filter(|(at, _)| *at == port).map(|(_, course)| course[second]).sum()
        };
        let read_deg = run.index_deg[second] + noise * plan.encoder_noise_deg * draw.normal();
        // The servo closes on the encoder: where it reads too large, the axis has not come as far.
        let axis_deg = run.index_deg[second] - sum(Port::Turns);
        let earth_deg_h = earth_rate_deg_h(plan.latitude_deg, run.azimuth_deg, run.tilt_rad, axis_deg);
        // °/h over one second are arcsec; N °/√h are 60 N arcsec in a second.
        let fog_arcsec = earth_deg_h * (1.0 + 1e-6 * plan.scale_ppm + sum(Port::Scales))
            + run.bias_deg_h
            + sum(Port::Adds)
            + noise * 60.0 * plan.arw_deg_per_sqrt_h * draw.normal();
        let level_noise_g = noise * plan.level_noise_g.unwrap_or_default();
        let mut level = |true_g: f64, forward: bool| {
            true_g + sum(Port::Tilts { forward }).to_radians() + level_noise_g * draw.normal()
        };
        let level_g = [level(pitch.sin(), true), level(roll.sin() * pitch.cos(), false)];
        let channels = run.courses.iter().map(|course| course.reading[second]).collect();
        Row { t_s: second as f64 + 1.0, index_deg: read_deg, fog_arcsec, level_g, channels }
    };
    (0..run.seconds()).map(second).collect()
}
