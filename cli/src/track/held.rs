//! A track without aiding: the heading is held.

use inertial::{BlockClass, Hold, HoldCounters, HoldLimits, HoldSecond, Increment};
use north_finder::units::DEG_PER_RAD;

use super::start::Start;
use super::{Detail, Innovations, Reference, Track, TrackRow};
use crate::block_csv::{BlockRecording, BlockRow};

/// Longest gap that is bridged, s.
const LONGEST_GAP_S: f64 = 5.0;

/// Holds the heading from the start on.
///
/// Errors: in words; a latitude near a pole, a gap that is not bridged.
pub fn run(
    recording: &BlockRecording,
    class: &BlockClass,
    latitude_deg: f64,
    start: &Start,
    reference: &Reference,
) -> Result<(Track, HoldCounters), String> {
    let Start { angles, sigma_heading_deg, sigma_level_deg, rows: used, .. } = start;
    let limits = HoldLimits::default();
    let mut hold = Hold::new(class, limits, latitude_deg, angles, *sigma_heading_deg, *sigma_level_deg)
        .map_err(|error| error.to_string())?;
    let mut rows = Vec::new();
    let mut innovations = Innovations { name: "standing", ..Innovations::default() };
    let mut keep = |row: &BlockRow, t_s: f64, second: HoldSecond| {
        if second.degrees_of_freedom > 0 {
            innovations.taken.push((t_s, second.normalised_squared, second.degrees_of_freedom));
        }
        rows.push(TrackRow {
            t_s,
            angles: second.angles,
            sigma_heading_deg: second.sigma_heading_deg,
            sigma_level_deg: second.sigma_level_deg,
            error_deg: reference.error_deg(row, second.angles.heading_deg),
            detail: Detail::Held { motion: second.motion, refix: second.refix },
        });
    };
    let rate_of = |row: &BlockRow| {
        let length_s = row.interval_s.min(recording.step_s);
        row.increment.angle_rad.norm() / length_s * DEG_PER_RAD
    };
    let mut before_deg_s = used.checked_sub(1).and_then(|last| recording.rows.get(last)).map_or(0.0, rate_of);
    for row in recording.rows.iter().skip(*used) {
        let mut sample = (row.interval_s, row.increment);
        if let Some(gap_s) = row.gap_s(recording.step_s) {
            if gap_s > LONGEST_GAP_S {
                let at = row.t_s;
                return Err(format!(
                    "no rows for {gap_s:.3} s before t_s = {at}; at most {LONGEST_GAP_S} s are bridged"
                ));
            }
            // It may have begun or ended to turn in the gap.
            let rate_deg_s = rate_of(row).max(before_deg_s);
            keep(row, row.t_s - recording.step_s, hold.bridge(gap_s, rate_deg_s));
            let velocity_m_s = row.increment.velocity_m_s * (recording.step_s / row.interval_s);
            sample = (recording.step_s, Increment { velocity_m_s, ..row.increment });
        }
        before_deg_s = rate_of(row);
        if let Some(second) = hold.push(sample.0, sample.1) {
            keep(row, row.t_s, second);
        }
    }
    Ok((Track { rows, innovations: vec![innovations] }, hold.counters()))
}
