//! The plain azimuth, before anything is known: least squares over dwell means with amplitude and bias free.

use nalgebra::{Matrix3, Vector3};

use super::plan::{EARTH_DEG_H, Plan};
use super::record::Row;

/// Azimuth of a run from its rows, degrees.
pub(super) fn azimuth_deg(plan: &Plan, number: usize, rows: &[Row]) -> f64 {
    let rests = &plan.runs[number].rests;
    let up_deg_h = EARTH_DEG_H * plan.latitude_deg.to_radians().sin();
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let mut start = 0;
    while start < rows.len() {
        let end = (start + 1..rows.len()).find(|&row| rests[row] != rests[start]).unwrap_or(rows.len());
        if rests[start] {
            let dwell = &rows[start..end];
            let mean = |of: &dyn Fn(&Row) -> f64| dwell.iter().map(of).sum::<f64>() / dwell.len() as f64;
            let (sin, cos) = mean(&|row| row.index_deg).to_radians().sin_cos();
            let up = cos * mean(&|row| row.level_g[0]) + sin * mean(&|row| row.level_g[1]);
            let rate_deg_h = mean(&|row| row.fog_arcsec) - up_deg_h * up;
            let design = Vector3::new(cos, sin, 1.0);
            normal += dwell.len() as f64 * design * design.transpose();
            right += dwell.len() as f64 * rate_deg_h * design;
        }
        start = end;
    }
    // h cos(ψ − θ) = h cos ψ · cos θ + h sin ψ · sin θ.
    let solution = normal.try_inverse().map_or(Vector3::repeat(f64::NAN), |inverse| inverse * right);
    solution.y.atan2(solution.x).to_degrees().rem_euclid(360.0)
}
