//! Where a track starts: heading and levels at the end of the first seconds of a recording.

use inertial::{AlignError, Aligned, Alignment, Angles, BlockClass, NoiseOfRate, Quaternion};
use libm::{atan2, hypot};
use nalgebra::Vector3;
use north_finder::earth::earth_rate;
use north_finder::units::{DEG_PER_RAD, RAD_PER_DEG};

use crate::block_csv::{BlockRecording, BlockRow};

/// Rows that are missing: for so many seconds before a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    pub seconds: f64,
    pub before_s: f64,
}

/// Orientation at the start, with its sigmas, and the number of rows that it was made of.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub angles: Angles,
    pub sigma_heading_deg: f64,
    pub sigma_level_deg: f64,
    pub rows: usize,
    /// Time that these rows cover.
    pub aligned_s: f64,
    /// What ended them before the time that was asked for.
    pub gap: Option<Gap>,
}

impl Start {
    /// That a gap made the alignment shorter than it was to be, in a sentence.
    pub fn doubt(&self, align_s: f64) -> Option<String> {
        let Gap { seconds, before_s } = self.gap?;
        let aligned_s = self.aligned_s;
        Some(format!(
            "aligned over {aligned_s:.1} s, not {align_s} s: no rows for {seconds:.3} s before t_s = {before_s}"
        ))
    }
}

/// Aligns the first `align_s`, or levels them where the heading at the recording's beginning is given with its sigma.
///
/// Errors: in words; a latitude near a pole, or one that the rates contradict, no Earth rate above the noise, nothing left to track.
pub fn start(
    recording: &BlockRecording,
    class: &BlockClass,
    latitude_deg: f64,
    align_s: f64,
    heading: Option<(f64, f64)>,
) -> Result<Start, String> {
    earth_rate(latitude_deg).map_err(|error| error.to_string())?;
    let (rows, gap) = first_rows(recording, align_s);
    let aligned_s = rows.iter().map(|row| row.interval_s).sum::<f64>();
    if rows.len() == recording.rows.len() {
        return Err(format!(
            "the recording lasts {aligned_s:.1} s, and --align takes the first {align_s} s: nothing is left to track"
        ));
    }
    let level_deg = class.accelerometer_m_s2 / 9.8 * DEG_PER_RAD;
    let aligned = aligned(&rows, class, latitude_deg);
    if let Err(error @ AlignError::OtherLatitude { .. }) = aligned {
        return Err(format!(
            "{error}; correct --latitude, or choose the --class of a block with biases that explain it"
        ));
    }
    if let Some((heading_deg, sigma_heading_deg)) = heading {
        let angles = levelled(&rows, latitude_deg, heading_deg)?;
        let sigma_heading_deg = sigma_heading_deg.hypot(carried_sigma_deg(&rows, class));
        let sigma_level_deg = level_deg;
        return Ok(Start { angles, sigma_heading_deg, sigma_level_deg, rows: rows.len(), aligned_s, gap });
    }
    let aligned = aligned.map_err(|error| match gap {
        Some(Gap { before_s, .. }) => format!(
            "{error}; give --heading: a gap before t_s = {before_s} ends the alignment after {aligned_s:.1} s; cut the recording there"
        ),
        None => format!("{error}; give --heading, or a longer --align"),
    })?;
    Ok(Start {
        angles: aligned.angles,
        sigma_heading_deg: aligned.sigma_heading_deg,
        sigma_level_deg: aligned.sigma_level_deg.max(level_deg),
        rows: rows.len(),
        aligned_s,
        gap,
    })
}

/// The rows of the first `align_s`, and the gap that ends them before.
fn first_rows(recording: &BlockRecording, align_s: f64) -> (Vec<&BlockRow>, Option<Gap>) {
    let (mut rows, mut seconds) = (Vec::new(), 0.0);
    for row in &recording.rows {
        if seconds > align_s - 0.5 * recording.step_s {
            break;
        }
        if let Some(seconds) = row.gap_s(recording.step_s) {
            return (rows, Some(Gap { seconds, before_s: row.t_s }));
        }
        seconds += row.interval_s;
        rows.push(row);
    }
    (rows, None)
}

/// By what the class declares.
fn aligned(rows: &[&BlockRow], class: &BlockClass, latitude_deg: f64) -> Result<Aligned, AlignError> {
    let mut alignment = Alignment::default();
    for row in rows {
        alignment.push(row.interval_s, row.increment);
    }
    let noise = NoiseOfRate::Declared(class.arw_deg_sqrt_h);
    alignment.solve(Some(latitude_deg), &noise, Some(class.run_to_run_deg_h))
}

/// One sigma of a turn that the gyros carry through these rows with their biases unknown, degrees.
fn carried_sigma_deg(rows: &[&BlockRow], class: &BlockClass) -> f64 {
    let hours = rows.iter().map(|row| row.interval_s).sum::<f64>() / 3600.0;
    let bias_deg_h = class.run_to_run_deg_h.hypot(class.markov_deg_h);
    (bias_deg_h * hours).hypot(class.arw_deg_sqrt_h * hours.sqrt())
}

/// The gyros carry the heading from the first row to the last; the mean support against gravity on that way is up.
fn levelled(rows: &[&BlockRow], latitude_deg: f64, heading_deg: f64) -> Result<Angles, String> {
    let rate = earth_rate(latitude_deg).map_err(|error| error.to_string())?;
    let earth_rad_s = Vector3::new(0.0, rate.north_deg_h, rate.up_deg_h) * (RAD_PER_DEG / 3600.0);
    let [x, y, z] = rows.first().map_or([0.0, 0.0, 1.0], |row| row.increment.velocity_m_s.into());
    let (pitch_deg, roll_deg) = (atan2(x, hypot(y, z)) * DEG_PER_RAD, atan2(y, z) * DEG_PER_RAD);
    let mut orientation = Quaternion::from_angles(&Angles { heading_deg, pitch_deg, roll_deg });
    let mut support = Vector3::zeros();
    for row in rows {
        let before = orientation;
        orientation = orientation.advance(&row.increment.angle_rad, &(earth_rad_s * row.interval_s));
        support += 0.5 * (before.rotate(&row.increment.velocity_m_s) + orientation.rotate(&row.increment.velocity_m_s));
    }
    let Some(up) = support.try_normalize(1e-6) else {
        return Err("the accelerometers feel no gravity in the first seconds".into());
    };
    let axis = up.cross(&Vector3::z());
    let turn = axis.try_normalize(1e-12).map_or_else(Vector3::zeros, |unit| unit * atan2(axis.norm(), up.z));
    Ok(Quaternion::from_rotation_vector(&turn).after(&orientation).angles())
}

#[cfg(test)]
mod tests {
    use inertial::Increment;

    use super::*;

    /// A block that rolls by ±5° with a period of 8 s, its heading steady at 30° but for the Earth: its mean support is up, wherever in the
    /// roll the window ends.
    #[test]
    fn a_rolling_block_is_levelled_where_it_is() {
        let roll = |t_s: f64| 5.0 * RAD_PER_DEG * (std::f64::consts::TAU * t_s / 8.0).sin();
        let row = |step: u32| {
            let (from_s, to_s) = (0.1 * f64::from(step), 0.1 * f64::from(step + 1));
            let middle = 0.5 * (roll(from_s) + roll(to_s));
            // Roll about x, left side up: gravity's support (0, sin roll, cos roll).
            let velocity_m_s = Vector3::new(0.0, middle.sin(), middle.cos()) * 0.98;
            let angle_rad = Vector3::new(roll(to_s) - roll(from_s), 0.0, 0.0);
            BlockRow {
                t_s: to_s,
                interval_s: 0.1,
                increment: Increment { angle_rad, velocity_m_s },
                ..BlockRow::default()
            }
        };
        let rows: Vec<BlockRow> = (0..420).map(row).collect();
        let found = levelled(&rows.iter().collect::<Vec<_>>(), 60.0, 30.0).unwrap();
        // 42 s end at a quarter of the period: 5°. The rows know nothing of the Earth's rate, 15 °/h · 42 s = 0.175° of it.
        assert!((found.roll_deg - 5.0).abs() < 0.2 && found.pitch_deg.abs() < 0.2, "{found:?}");
        assert!((found.heading_deg - 30.0).abs() < 0.3, "{found:?}");
    }

    /// 36 s are a hundredth of an hour: a bias of 10 °/h makes 0.1°, a random walk of 0.3 °/√h 0.03°.
    #[test]
    fn gyros_carry_a_heading_with_their_biases() {
        let class =
            BlockClass { run_to_run_deg_h: 8.0, markov_deg_h: 6.0, arw_deg_sqrt_h: 0.3, ..BlockClass::MODERN_MEMS };
        let rows = [BlockRow { interval_s: 36.0, ..BlockRow::default() }];
        let sigma_deg = carried_sigma_deg(&rows.iter().collect::<Vec<_>>(), &class);
        assert!((sigma_deg - 0.1_f64.hypot(0.03)).abs() < 1e-9, "{sigma_deg}");
    }
}
