//! `north bench attitude`: what is lost by each algorithm of orientation, on coning and on extreme tumbling.

mod tumbling;

use std::f64::consts::TAU;
use std::io::{self, Write};

use clap::Args;
use inertial::{Algorithm, Increment, Integrator, Quaternion};
use nalgebra::Vector3;
use north::failure::Failure;
use serde::Serialize;

use super::Bench;

/// Half-angle of the cone, degrees, and interval, s: those of the published table.
const HALF_ANGLE_DEG: f64 = 1.0;
const INTERVAL_S: f64 = 0.01;
/// Time that the drift is measured over, s.
const LENGTH_S: f64 = 10.0;
/// Frequencies of the table, Hz.
const FREQUENCIES_HZ: [f64; 5] = [1.0, 2.0, 5.0, 10.0, 20.0];
/// Drift below this is rounding of doubles: 1e-15 rad in ten seconds, °/h.
const RESOLUTION_DEG_H: f64 = 2e-7;

/// Drift of the six algorithms on coning against frequency, and error on extreme tumbling against quadruple precision
///
/// Slopes are fitted between 5 and 10 Hz at equal update (10 ms), k from the drift at 10 Hz. Tables are Markdown.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench attitude --json attitude.json")]
pub struct AttitudeBench {}

/// One line of a table.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Row {
    Coning(Coning),
    Tumbling(tumbling::Tumbling),
}

/// Drift of one algorithm.
#[derive(Serialize)]
pub struct Coning {
    algorithm: &'static str,
    /// "equal update" or "equal sensor rate".
    comparison: &'static str,
    interval_s: f64,
    frequency_hz: [f64; 5],
    drift_deg_h: [f64; 5],
    slope: f64,
    k: f64,
    slope_of_table: &'static str,
    k_of_table: Option<f64>,
}

impl Bench for AttitudeBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let mut rows = Vec::new();
        for comparison in ["equal update", "equal sensor rate"] {
            for algorithm in Algorithm::ALL {
                let samples = if comparison == "equal update" { 1.0 } else { algorithm.samples() as f64 };
                rows.push(coning(algorithm, comparison, INTERVAL_S * samples));
            }
        }
        write_coning(out, &rows)?;
        let tumbling = tumbling::measure(out)?;
        Ok(rows.into_iter().map(Row::Coning).chain(tumbling.into_iter().map(Row::Tumbling)).collect())
    }

    /// The table's constants within 6 %, its slopes within 0.1, at equal update; tumbling better with every order.
    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        for row in rows {
            let Row::Coning(coning) = row else { continue };
            if let Some(k) = coning.k_of_table
                && !((coning.k / k - 1.0).abs() < 0.06)
            {
                let Coning { algorithm, comparison, k: found, .. } = coning;
                return Err(Failure::Refused(format!("{algorithm}, {comparison}: k = {found:.0}, the table has {k}")));
            }
        }
        Ok(())
    }
}

fn coning(algorithm: Algorithm, comparison: &'static str, interval_s: f64) -> Coning {
    let at = |frequency_hz| drift_deg_h(algorithm, frequency_hz, interval_s);
    let drift_deg_h = FREQUENCIES_HZ.map(at);
    // Where ωT is small, but the drift above the resolution.
    let (low_hz, high_hz): (f64, f64) = if interval_s > INTERVAL_S { (2.0, 3.0) } else { (5.0, 7.0) };
    let (low, high) = (at(low_hz), at(high_hz));
    let slope = (high / low).ln() / (high_hz / low_hz).ln();
    let (slope_of_table, k_of_table, order) = match algorithm {
        Algorithm::Sum => ("3", Some(12.0), 2),
        Algorithm::PreviousInterval => ("5", Some(60.0), 4),
        Algorithm::TwoSample => ("5", Some(960.0), 4),
        Algorithm::ThreeSampleCubic => ("5", Some(6480.0), 4),
        Algorithm::ThreeSamplePrinted => ("3 to 5", None, 4),
        Algorithm::ThreeSampleConing => ("7", Some(204_120.0), 6),
    };
    let (half_rad, omega) = (HALF_ANGLE_DEG.to_radians(), TAU * low_hz);
    let per_k = half_rad * half_rad * omega * (omega * interval_s).powi(order);
    let k = per_k.to_degrees() * 3600.0 / low;
    Coning {
        algorithm: algorithm.name(),
        comparison,
        interval_s,
        frequency_hz: FREQUENCIES_HZ,
        drift_deg_h,
        slope,
        k,
        slope_of_table,
        k_of_table,
    }
}

/// Drift of the full quaternion about the cone's axis, °/h.
///
/// The block is turned by the half-angle about an axis that circulates in its x-y plane; the rate in block axes is
/// (−ω sin a sin ωt, ω sin a cos ωt, −2 ω sin² a/2), and its integral is known.
fn drift_deg_h(algorithm: Algorithm, frequency_hz: f64, interval_s: f64) -> f64 {
    let (half_rad, omega) = (HALF_ANGLE_DEG.to_radians(), TAU * frequency_hz);
    let sample_s = interval_s / algorithm.samples() as f64;
    let intervals = (LENGTH_S / interval_s).round() as usize;
    let z_rad_s = -2.0 * omega * (0.5 * half_rad).sin().powi(2);
    // The difference of two sums, by the product of sines: no digits are lost.
    let sample = |number: f64| {
        let middle = omega * (number - 0.5) * sample_s;
        let chord = 2.0 * half_rad.sin() * (0.5 * omega * sample_s).sin();
        let angle_rad = Vector3::new(-chord * middle.sin(), chord * middle.cos(), z_rad_s * sample_s);
        Increment { angle_rad, ..Increment::default() }
    };
    let attitude = |t_s: f64| {
        let (sine, cosine) = (omega * t_s).sin_cos();
        Quaternion::from_rotation_vector(&(Vector3::new(cosine, sine, 0.0) * half_rad))
    };
    let mut integrator = Integrator::new(algorithm);
    // One interval ahead, so that the one before the first is known.
    for number in 1..=algorithm.samples() {
        let _ = integrator.push(sample(number as f64 - algorithm.samples() as f64));
    }
    let mut orientation = attitude(0.0);
    for number in 1..=intervals * algorithm.samples() {
        if let Some(interval) = integrator.push(sample(number as f64)) {
            orientation = orientation.advance(&interval.angle_rad, &Vector3::zeros());
        }
    }
    let seconds = intervals as f64 * interval_s;
    let error = orientation.after(&attitude(seconds).inverse()).rotation_vector();
    error.norm().to_degrees() * 3600.0 / seconds
}

fn write_coning(out: &mut dyn Write, rows: &[Coning]) -> io::Result<()> {
    writeln!(
        out,
        "Coning of {HALF_ANGLE_DEG}° half-angle, full quaternions over {LENGTH_S} s; drifts below {RESOLUTION_DEG_H:e} °/h are \
         rounding.\nSlope and k are fitted at 5 to 7 Hz (2 to 3 Hz for intervals above 10 ms). At equal sensor rate (100 Hz) \
         an interval is as long as its samples."
    )?;
    for comparison in ["equal update", "equal sensor rate"] {
        writeln!(
            out,
            "\n### {comparison}\n\n| algorithm | interval, ms | drift, °/h, at 1 Hz | 2 Hz | 5 Hz | 10 Hz | 20 Hz | slope | of \
             the table | k | of the table |\n|---|---|---|---|---|---|---|---|---|---|---|"
        )?;
        for row in rows.iter().filter(|row| row.comparison == comparison) {
            let drifts = row.drift_deg_h.map(|drift| {
                if drift < RESOLUTION_DEG_H { format!("< {RESOLUTION_DEG_H:e}") } else { format!("{drift:.2e}") }
            });
            writeln!(
                out,
                "| {} | {:.0} | {} | {:.2} | {} | {} | {} |",
                row.algorithm,
                1e3 * row.interval_s,
                drifts.join(" | "),
                row.slope,
                row.slope_of_table,
                row.k_of_table.map_or_else(|| "–".into(), |_| format!("{:.0}", row.k)),
                row.k_of_table.map_or_else(|| "–".into(), |k| k.to_string()),
            )?;
        }
    }
    Ok(())
}
