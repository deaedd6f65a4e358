//! Recordings of a plan: rows by the full plant's geometry and noise, and what the effect adds.

use super::part::Part;
use super::plan::{Plan, RunPlan};
use super::run_view::{Moment, RunView};
use super::{EARTH_DEG_H, Run};
use hal_sim::scenario::{Accelerometer, Base, Encoder, Gyro, Site};
use hal_sim::seconds::{Dwell, Row as Second, SecondsGenerator, SiteAndGyro};

/// One row of one second.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// End of the interval, s.
    pub t_s: f64,
    /// Index angle by the encoder, degrees counter-clockwise.
    pub index_deg: f64,
    /// Gyro's angle increment, arcsec.
    pub fog_arcsec: f64,
    /// Forward and left accelerometer, g; there even in a campaign that does not show them.
    pub level_g: [f64; 2],
    /// Readings of the channels, the temperature first.
    pub channels: Vec<f64>,
}

/// Records every run with these parts.
pub(super) fn runs(plan: &Plan, parts: &[(f64, Part)]) -> Vec<Run> {
    (0..plan.runs.len()).map(|number| run(plan, number, parts)).collect()
}

/// Records one run with these parts.
pub(super) fn run(plan: &Plan, number: usize, parts: &[(f64, Part)]) -> Run {
    let run = &plan.runs[number];
    let arrivals = run.arrivals();
    let view = RunView {
        run: number,
        azimuth_deg: run.azimuth_deg,
        north_deg_h: EARTH_DEG_H * plan.latitude_deg.to_radians().cos(),
        tilt_deg: run.tilt_deg,
        index_deg: run.index_deg(),
        arrivals: &arrivals,
        channels: &plan.standard[number],
    };
    let shapes = shapes(parts, &view);
    let rows = (1..)
        .zip(seconds(plan, run, &view, parts))
        .map(|(second, row): (usize, Second)| Row {
            t_s: second as f64,
            index_deg: row.index_deg,
            fog_arcsec: row.fog_arcsec + added(parts, &view, &row) + shapes[second - 1],
            level_g: [row.ax_g, row.ay_g],
            // The mean over the second.
            channels: run
                .courses
                .iter()
                .map(|course| 0.5 * (course.reading[second - 1] + course.reading[second]))
                .collect(),
        })
        .collect();
    Run {
        rows,
        azimuth_deg: run.azimuth_deg,
        reference_deg: run.survey_error_deg.map(|error_deg| (run.azimuth_deg + error_deg).rem_euclid(360.0)),
        reference_sigma_deg: run.survey_sigma_deg,
        may_learn: run.may_learn,
    }
}

/// The sum of the parts that are courses, one value a second, arcsec.
fn shapes(parts: &[(f64, Part)], view: &RunView<'_>) -> Vec<f64> {
    let mut sum = vec![0.0; view.seconds()];
    for (size, part) in parts {
        if let Part::Shape(shape) = part {
            sum.iter_mut().zip(shape.course(view)).for_each(|(sum, value)| *sum += size * value);
        }
    }
    sum
}

/// Root mean square of what the parts do to the mean rates of the dwells of a run, about the run's mean, °/h.
pub(super) fn spread_of_dwells(plan: &Plan, parts: &[(f64, Part)]) -> f64 {
    let deviations = differences(plan, parts).zip(&plan.runs).flat_map(|(rates, run)| {
        let means = dwell_means(run, &rates);
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        means.into_iter().map(move |of_dwell| of_dwell - mean)
    });
    rms(deviations)
}

/// Root mean square of what the parts do to the rates of the rows, °/h.
pub(super) fn spread_of_rows(plan: &Plan, parts: &[(f64, Part)]) -> f64 {
    rms(differences(plan, parts).flatten())
}

/// Root mean square of what the parts do to the mean rates of the runs, about their mean, °/h.
pub(super) fn spread_of_runs(plan: &Plan, parts: &[(f64, Part)]) -> f64 {
    let means: Vec<f64> =
        differences(plan, parts).map(|rates| rates.iter().sum::<f64>() / rates.len() as f64).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    rms(means.into_iter().map(|of_run| of_run - mean))
}

/// Difference that the parts make to every row's rate, °/h, run by run.
fn differences(plan: &Plan, parts: &[(f64, Part)]) -> impl Iterator<Item = Vec<f64>> {
    runs(plan, parts).into_iter().zip(runs(plan, &[])).map(|(with, without)| {
        with.rows.iter().zip(&without.rows).map(|(with, without)| with.fog_arcsec - without.fog_arcsec).collect()
    })
}

fn dwell_means(run: &RunPlan, rates: &[f64]) -> Vec<f64> {
    let (mut at_deg, mut start) = (0.0, 0);
    run.dwells
        .iter()
        .map(|&(index_deg, seconds)| {
            start += run.turn_seconds(index_deg - at_deg);
            at_deg = index_deg;
            let dwell = &rates[start..start + seconds];
            start += seconds;
            dwell.iter().sum::<f64>() / seconds as f64
        })
        .collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0_u32, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (sum / f64::from(count.max(1))).sqrt()
}

/// The rows of the plant, the parts that need its geometry in them.
fn seconds(plan: &Plan, run: &RunPlan, view: &RunView<'_>, parts: &[(f64, Part)]) -> Vec<Second> {
    let mut world = world(plan, run);
    for (size, part) in parts {
        part.disturb(*size, view.run, &mut world);
    }
    let mut generator = SecondsGenerator::new(&world, run.seed);
    let mut at_deg = 0.0;
    let mut rows = Vec::with_capacity(run.seconds());
    for &(index_deg, seconds) in &run.dwells {
        if run.rotates {
            rows.extend(generator.turn(index_deg, seconds as f64));
        } else {
            rows.extend(generator.turn(index_deg, run.turn_seconds(index_deg - at_deg) as f64));
            rows.extend(generator.rows(&[Dwell { index_deg, gap_s: 0.0, seconds: seconds as f64 }]));
        }
        at_deg = index_deg;
    }
    rows
}

/// The sum of the parts over a row, arcsec: over one second, °/h are arcsec.
fn added(parts: &[(f64, Part)], view: &RunView<'_>, row: &Second) -> f64 {
    let now = Moment { t_s: row.t_s - 0.5, index_deg: row.index_deg };
    parts.iter().map(|(size, part)| size * part.rate(view, now)).sum()
}

/// A good instrument in which only what every instrument has is wrong.
fn world(plan: &Plan, run: &RunPlan) -> SiteAndGyro {
    let [pitch_deg, roll_deg] = run.tilt_deg;
    SiteAndGyro {
        site: Site {
            latitude_deg: plan.latitude_deg,
            azimuth_deg: run.azimuth_deg,
            magnetic_declination_deg: plan.declination_deg,
            ..Site::default()
        },
        base: Base { pitch_deg, roll_deg, ..Base::default() },
        gyro: Gyro {
            arw_deg_per_sqrt_h: plan.arw_deg_per_sqrt_h,
            bias_deg_h: run.bias_deg_h,
            bias_instability_deg_h: plan.instability_deg_h,
            rrw_deg_h_per_sqrt_h: 0.0,
            scale_ppm: plan.scale_ppm,
            quantum_arcsec: 1e-6,
            ..Gyro::default()
        },
        accelerometer: Accelerometer {
            bias_mg: [0.0; 3],
            noise_ug_per_sqrt_hz: plan.level_noise,
            ..Accelerometer::default()
        },
        encoder: Encoder { noise_deg: 0.01, eccentricity_deg: 0.0, ..Encoder::default() },
        ..SiteAndGyro::default()
    }
}
