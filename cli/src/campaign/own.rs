//! What a recording of the instrument says beyond the columns of the format: all that its fix used, so that a replay is
//! that fix, with all digits.

use north_finder::instrument::replay::Mark;
use north_finder::sensing::gates::Gate;
use north_finder::sensing::level::Specific;

/// Bits of the column `read`: what was read in a row. The others repeat their last reading.
pub const TEMPERATURE: u8 = 1;
pub const ACCELEROMETERS: u8 = 2;
pub const INDEX: u8 = 4;

/// Columns of every recording of the instrument; together with either of the two groups below they tell that it is one.
pub const COMMON: [&str; 4] = ["lost_frames", "read", "dwell", "gate"];
/// Of seconds: first moments about the middle of the second.
pub const MOMENTS: [&str; 3] = ["fog_moment_arcsec_s", "ax_moment_s2", "ay_moment_s2"];
/// Of frames: the third accelerometer; all three are as they were read, before their calibration.
pub const UP: &str = "az_g";

/// A row of the instrument's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Own {
    /// A second.
    Second { read: u8, mark: Mark, moment_arcsec_s: f64, level_moment: Specific },
    /// A frame of the gyro.
    Raw { read: u8, mark: Mark, az_g: f64 },
}

impl Own {
    /// Length of the row, seconds.
    pub fn interval_s(&self) -> f64 {
        match self {
            Self::Second { .. } => 1.0,
            Self::Raw { .. } => north_finder::sensing::sample::SAMPLE_S,
        }
    }

    /// The third accelerometer, of a frame.
    pub fn az_g(&self) -> Option<f64> {
        match self {
            Self::Second { .. } => None,
            Self::Raw { az_g, .. } => Some(*az_g),
        }
    }

    /// The columns after those of the format.
    pub fn header(raw: bool) -> Vec<&'static str> {
        let rest: &[&str] = if raw { &[UP] } else { &MOMENTS };
        COMMON[1..].iter().chain(rest).copied().collect()
    }

    /// The fields below [`Self::header`].
    pub fn fields(&self) -> Vec<String> {
        let (Self::Second { read, mark, .. } | Self::Raw { read, mark, .. }) = self;
        let mut fields = vec![read.to_string(), dwell_number(mark).to_string(), gate_number(mark).to_string()];
        match self {
            Self::Second { moment_arcsec_s, level_moment, .. } => {
                fields
                    .extend([*moment_arcsec_s, level_moment.forward, level_moment.left].map(|value| value.to_string()));
            }
            Self::Raw { az_g, .. } => fields.push(az_g.to_string()),
        }
        fields
    }
}

/// From 1; 0: none.
fn dwell_number(mark: &Mark) -> u16 {
    mark.dwell.map_or(0, |dwell| u16::from(dwell) + 1)
}

fn gate_number(mark: &Mark) -> u8 {
    match mark.waited_at {
        None => 0,
        Some(Gate::Disturbance) => 1,
        Some(Gate::Jitter) => 2,
        Some(Gate::Index) => 3,
    }
}

/// The mark of the numbers in `dwell` and `gate`; `None` where a gate of that number is not known.
pub fn mark(dwell: u8, gate: u8) -> Option<Mark> {
    let waited_at = match gate {
        0 => None,
        1 => Some(Gate::Disturbance),
        2 => Some(Gate::Jitter),
        3 => Some(Gate::Index),
        _ => return None,
    };
    Some(Mark { dwell: dwell.checked_sub(1), waited_at })
}
