//! Extreme tumbling: each algorithm against an integration in double-double arithmetic (32 digits).

use std::io::Write;

use inertial::{Algorithm, Increment, Integrator, Quaternion};
use nalgebra::Vector3;
use north::failure::Failure;
use serde::Serialize;
use twofloat::TwoFloat;

/// Rates about x, y, z: amplitude, frequency, phase, mean; °/s, Hz, rad, °/s.
const RATES: [[f64; 4]; 3] = [[400.0, 1.1, 0.3, 50.0], [300.0, 0.7, 1.7, -80.0], [500.0, 1.9, 4.0, 120.0]];
const LENGTH_S: f64 = 10.0;
const INTERVAL_S: f64 = 0.01;
/// Steps of the reference in an interval: divisible by one, two and three samples.
const STEPS: usize = 6;
/// Terms of its series.
const TERMS: usize = 22;

/// One line of the table.
#[derive(Serialize)]
pub struct Tumbling {
    algorithm: &'static str,
    error_after_10_s_deg: f64,
    largest_error_deg: f64,
}

type Quad = [TwoFloat; 4];

/// Runs all algorithms along the reference and prints the table.
pub fn measure(out: &mut dyn Write) -> Result<Vec<Tumbling>, Failure> {
    let intervals = (LENGTH_S / INTERVAL_S).round() as usize;
    let reference = integrate(intervals, STEPS);
    let finer = integrate(intervals, 2 * STEPS);
    let difference =
        last(&reference).iter().zip(last(&finer)).map(|(a, b)| f64::from(*a - b).abs()).fold(0.0, f64::max);
    writeln!(
        out,
        "\n### Extreme tumbling\n\nRates to 620 °/s about three axes at 0.7 to 1.9 Hz, 10 s, intervals of 10 ms; the reference \
         is a Taylor series of order {TERMS} in double-double arithmetic, and with half its step differs by {difference:.1e}.\n\n\
         | algorithm | error after 10 s, ° | largest, ° |\n|---|---|---|"
    )?;
    let mut rows = Vec::new();
    for algorithm in Algorithm::ALL {
        let row = follow(algorithm, &reference);
        writeln!(out, "| {} | {:.2e} | {:.2e} |", row.algorithm, row.error_after_10_s_deg, row.largest_error_deg)?;
        rows.push(row);
    }
    Ok(rows)
}

/// A step of the reference: orientation at its end, and the increment of angle over it.
struct Step {
    orientation: Quad,
    angle_rad: [TwoFloat; 3],
}

fn last(steps: &[Step]) -> Quad {
    steps.last().map_or([TwoFloat::from(0.0); 4], |step| step.orientation)
}

fn follow(algorithm: Algorithm, reference: &[Step]) -> Tumbling {
    let per_sample = STEPS / algorithm.samples();
    let mut integrator = Integrator::new(algorithm);
    let mut orientation = Quaternion::IDENTITY;
    let (mut error_deg, mut largest_deg) = (0.0, 0.0_f64);
    for sample in reference.chunks(per_sample) {
        let mut sum = [TwoFloat::from(0.0); 3];
        for step in sample {
            for (sum, angle) in sum.iter_mut().zip(step.angle_rad) {
                *sum += angle;
            }
        }
        let increment = Increment { angle_rad: Vector3::from(sum.map(f64::from)), ..Increment::default() };
        let (Some(interval), Some(end)) = (integrator.push(increment), sample.last()) else { continue };
        orientation = orientation.advance(&interval.angle_rad, &Vector3::zeros());
        let [w, x, y, z] = end.orientation.map(f64::from);
        let truth = Quaternion { w, v: Vector3::new(x, y, z) };
        error_deg = orientation.after(&truth.inverse()).rotation_vector().norm().to_degrees();
        largest_deg = largest_deg.max(error_deg);
    }
    Tumbling { algorithm: algorithm.name(), error_after_10_s_deg: error_deg, largest_error_deg: largest_deg }
}

/// dq/dt = q ω / 2 by its Taylor series: the coefficients of the rates follow from those of sine and cosine, and the
/// coefficients of q from the product of the two series. Nothing but the four operations is needed.
fn integrate(intervals: usize, steps: usize) -> Vec<Step> {
    let step_s = TwoFloat::from(INTERVAL_S) / TwoFloat::from(steps as f64);
    let tau = TwoFloat::from(2.0) * twofloat::consts::PI;
    let rad = twofloat::consts::PI / TwoFloat::from(180.0);
    let omega = RATES.map(|[_, hz, ..]| tau * TwoFloat::from(hz));
    let mut phase = RATES.map(|[_, _, phase, _]| [TwoFloat::from(phase.sin()), TwoFloat::from(phase.cos())]);
    let mut q: Quad = [1.0, 0.0, 0.0, 0.0].map(TwoFloat::from);
    let mut out = Vec::with_capacity(intervals * steps);
    for _ in 0..intervals * steps {
        let mut rate = [[TwoFloat::from(0.0); 3]; TERMS];
        let mut angle_rad = [TwoFloat::from(0.0); 3];
        for axis in 0..3 {
            let [amplitude, _, _, mean] = RATES[axis];
            let mut series = [phase[axis]; TERMS];
            for k in 1..TERMS {
                let [sine, cosine] = series[k - 1];
                let by = omega[axis] / TwoFloat::from(k as f64);
                series[k] = [cosine * by, -(sine * by)];
            }
            for k in 0..TERMS {
                rate[k][axis] = series[k][0] * rad * TwoFloat::from(amplitude);
            }
            rate[0][axis] += rad * TwoFloat::from(mean);
            phase[axis] = [0, 1].map(|part| horner((0..TERMS).map(|k| series[k][part]), step_s));
            let integrated = (0..TERMS).map(|k| rate[k][axis] / TwoFloat::from(k as f64 + 1.0));
            angle_rad[axis] = horner(integrated, step_s) * step_s;
        }
        let mut series = [q; TERMS];
        for k in 0..TERMS - 1 {
            let mut sum = [TwoFloat::from(0.0); 4];
            for j in 0..=k {
                for (sum, part) in sum.iter_mut().zip(times(&series[j], &rate[k - j])) {
                    *sum += part;
                }
            }
            series[k + 1] = sum.map(|part| part / TwoFloat::from(2.0 * (k as f64 + 1.0)));
        }
        q = [0, 1, 2, 3].map(|part| horner((0..TERMS).map(|k| series[k][part]), step_s));
        out.push(Step { orientation: q, angle_rad });
    }
    out
}

/// The product of a quaternion with a vector.
fn times(q: &Quad, v: &[TwoFloat; 3]) -> Quad {
    let ([w, x, y, z], [a, b, c]) = (*q, *v);
    [-(x * a) - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
}

fn horner(coefficients: impl DoubleEndedIterator<Item = TwoFloat>, at: TwoFloat) -> TwoFloat {
    coefficients.rev().fold(TwoFloat::from(0.0), |sum, coefficient| sum * at + coefficient)
}
