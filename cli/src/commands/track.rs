//! `north track`: orientation along a recording.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use north_finder::attitude::{
    Alignment, Angles, BlockClass, Hold, HoldLimits, HoldSecond, Increment, Method, Motion, NoiseOfRate,
};
use north_finder::units::{DEG_PER_RAD, wrap_180_deg};
use serde::Serialize;

use super::number;
use crate::block_csv;
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::model_file::ModelFile;
use crate::output::JsonOption;
use crate::track_report::{self, TrackRow};

/// A step longer than so many usual ones is a gap.
const GAP_STEPS: f64 = 1.5;
/// Longest gap that is bridged, s.
const LONGEST_GAP_S: f64 = 5.0;

/// Orientation along a recording of a three-axis block
///
/// The heading starts from --heading, or from an alignment of the first seconds, in which the block stands. It is held from
/// there: biases are learned while the block stands, increments are summed up while it moves, sigma grows with the class of the
/// block. Gaps are bridged up to 5 s with a wider sigma, saturated gyros counted.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north track walk.csv --latitude 34.75 --heading 12.34 --class modern-mems --out track.csv
  north track parked.csv --latitude 34.246 --align 300 --class ring-laser --out track.csv --report track.html")]
pub struct Track {
    /// Recording: t_s, gx_arcsec, gy_arcsec, gz_arcsec, ax_m_s2, ay_m_s2, az_m_s2; x forward, y left, z up
    #[arg(value_name = "FILE.csv")]
    recording: PathBuf,
    /// Calibrations of the block's triads, as north calibrate writes them: [gyro_triad], [accelerometer]
    #[arg(long, value_name = "M.toml")]
    model: Option<PathBuf>,
    /// Latitude, degrees, north positive, -90 to 90
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-90, 90>)]
    latitude: f64,
    /// Where the orientation goes, a row a second
    #[arg(long, value_name = "TRACK.csv")]
    out: PathBuf,
    /// Heading at the start, degrees; without it the first seconds are aligned
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-360, 360>)]
    heading: Option<f64>,
    /// One sigma of that heading, degrees
    #[arg(long, value_name = "DEG", default_value = "0.04", value_parser = number::<0, 180>)]
    heading_sigma: f64,
    /// Seconds of standing at the start that are aligned, or levelled
    #[arg(long, value_name = "S", default_value = "100", value_parser = number::<1, 100_000>)]
    align: f64,
    /// Class of the block
    #[arg(long, value_enum, default_value_t = Class::ModernMems)]
    class: Class,
    /// Heading to compare with, degrees, where the block stood all the time; a column reference_heading_deg does it for each row
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-360, 360>)]
    reference: Option<f64>,
    /// Write a page with heading, sigma, errors and innovations
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// Names of the classes of blocks.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Class {
    SourceMems,
    ModernMems,
    SourceFog,
    RingLaser,
}

impl Class {
    fn block(self) -> BlockClass {
        match self {
            Self::SourceMems => BlockClass::SOURCE_MEMS,
            Self::ModernMems => BlockClass::MODERN_MEMS,
            Self::SourceFog => BlockClass::SOURCE_FOG,
            Self::RingLaser => BlockClass::RING_LASER,
        }
    }
}

/// What became of the recording.
#[derive(Serialize)]
struct Summary {
    class: &'static str,
    seconds: usize,
    standing_s: usize,
    moving_s: usize,
    gaps: u32,
    saturated: u32,
    invalid: u32,
    heading_deg: f64,
    sigma_heading_deg: f64,
    refix_at_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rms_error_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    within_two_sigma: Option<f64>,
    /// Mean normalised squared innovation, and how many.
    nis: f64,
    nis_degrees_of_freedom: u32,
}

impl Summary {
    fn said(&self) -> String {
        let refix = self.refix_at_s.map_or_else(String::new, |t_s| format!("; a new fix is wanted since {t_s:.0} s"));
        let rms = self.rms_error_deg.map_or_else(String::new, |rms| format!("; rms error {rms:.4}°"));
        let m = f64::from(self.nis_degrees_of_freedom);
        let nis = if m > 0.0 {
            format!("; NIS {:.3} (95 %: 1 ± {:.3})", self.nis, 1.96 * (2.0 / m).sqrt())
        } else {
            String::new()
        };
        format!(
            "{}: {} s ({} standing, {} moving), heading {:.4}° ± {:.4}°; {} gaps, {} saturated, {} invalid samples{nis}{refix}{rms}",
            self.class,
            self.seconds,
            self.standing_s,
            self.moving_s,
            self.heading_deg,
            self.sigma_heading_deg,
            self.gaps,
            self.saturated,
            self.invalid
        )
    }
}

impl Track {
    pub fn run(self) -> Result<(), Failure> {
        let recording = ModelFile::read_block(&self.recording, self.model.as_deref())?;
        let class = self.class.block();
        let (mut hold, start) = self.start(&recording, &class)?;
        let mut rows = Vec::new();
        for row in recording.rows.iter().skip(start) {
            let mut samples = (row.interval_s, row.increment);
            let gap_s = row.interval_s - recording.step_s;
            if row.interval_s > GAP_STEPS * recording.step_s {
                if gap_s > LONGEST_GAP_S {
                    let problem = format!(
                        "no rows for {gap_s:.3} s before t_s = {}; at most {LONGEST_GAP_S} s are bridged",
                        row.t_s
                    );
                    return Err(FileError::whole(&self.recording, Problem::Syntax(problem)).into());
                }
                let rate_deg_s = row.increment.angle_rad.norm() / recording.step_s * DEG_PER_RAD;
                rows.push(self.row(
                    row.t_s - recording.step_s,
                    hold.bridge(gap_s, rate_deg_s),
                    row.reference_heading_deg,
                ));
                samples = (
                    recording.step_s,
                    Increment {
                        velocity_m_s: row.increment.velocity_m_s * (recording.step_s / row.interval_s),
                        ..row.increment
                    },
                );
            }
            if let Some(second) = hold.push(samples.0, samples.1) {
                rows.push(self.row(row.t_s, second, row.reference_heading_deg));
            }
        }
        self.write_track(&rows)?;
        let summary = summary(&class, &rows, &hold);
        let said = summary.said();
        writeln!(self.json.human(), "{said}")?;
        if let Some(path) = &self.report {
            let page = track_report::html(&self.recording, &said, &rows);
            std::fs::write(path, page).map_err(|error| FileError::whole(path, error))?;
        }
        self.json.write(&summary)
    }

    fn row(&self, t_s: f64, second: HoldSecond, reference_deg: Option<f64>) -> TrackRow {
        let reference_deg = reference_deg.or(self.reference);
        let error_deg = reference_deg.map(|reference| wrap_180_deg(second.angles.heading_deg - reference));
        TrackRow { t_s, second, error_deg }
    }

    /// The hold at its start, and the row after it.
    fn start(&self, recording: &block_csv::BlockRecording, class: &BlockClass) -> Result<(Hold, usize), Failure> {
        let mut alignment = Alignment::default();
        let mut felt = [0.0; 3];
        let mut count = 0;
        for row in &recording.rows {
            if alignment.seconds() > self.align - 0.5 * recording.step_s
                || row.interval_s > GAP_STEPS * recording.step_s
            {
                break;
            }
            alignment.push(row.interval_s, row.increment);
            for (sum, part) in felt.iter_mut().zip(row.increment.velocity_m_s.iter()) {
                *sum += part;
            }
            count += 1;
        }
        let refused = |reason: String| Failure::Refused(format!("{}: {reason}", self.recording.display()));
        let [x, y, z] = felt;
        let level_sigma_deg = class.accelerometer_m_s2 / 9.8 * DEG_PER_RAD;
        let (angles, sigma_deg, level_deg) = match self.heading {
            Some(heading_deg) => {
                let pitch_deg = x.atan2(y.hypot(z)) * DEG_PER_RAD;
                let roll_deg = y.atan2(z) * DEG_PER_RAD;
                (Angles { heading_deg, pitch_deg, roll_deg }, self.heading_sigma, level_sigma_deg)
            }
            None => {
                let noise = NoiseOfRate::Declared(class.arw_deg_sqrt_h);
                let aligned = alignment
                    .solve(Method::LeastSquares, Some(self.latitude), &noise, Some(class.run_to_run_deg_h))
                    .map_err(|error| refused(format!("{error}; give --heading, or a longer --align")))?;
                (aligned.angles, aligned.sigma_heading_deg, aligned.sigma_level_deg.max(level_sigma_deg))
            }
        };
        let hold = Hold::new(class, HoldLimits::default(), self.latitude, &angles, sigma_deg, level_deg);
        Ok((hold.map_err(|error| refused(error.to_string()))?, count))
    }

    fn write_track(&self, rows: &[TrackRow]) -> Result<(), Failure> {
        let write = || -> std::io::Result<()> {
            let mut out = BufWriter::new(File::create(&self.out)?);
            writeln!(out, "t_s,heading_deg,pitch_deg,roll_deg,sigma_heading_deg,sigma_level_deg,standing,refix")?;
            for TrackRow { t_s, second, .. } in rows {
                let Angles { heading_deg, pitch_deg, roll_deg } = second.angles;
                writeln!(
                    out,
                    "{t_s},{heading_deg},{pitch_deg},{roll_deg},{},{},{},{}",
                    second.sigma_heading_deg,
                    second.sigma_level_deg,
                    u8::from(second.motion == Motion::Standing),
                    u8::from(second.refix)
                )?;
            }
            out.flush()
        };
        write().map_err(|error| FileError::whole(&self.out, error).into())
    }
}

fn summary(class: &BlockClass, rows: &[TrackRow], hold: &Hold) -> Summary {
    let count = |motion| rows.iter().filter(|row| row.second.motion == motion).count();
    let errors: Vec<(f64, f64)> =
        rows.iter().filter_map(|row| row.error_deg.map(|error| (error, row.second.sigma_heading_deg))).collect();
    let some = (!errors.is_empty()).then_some(errors.len() as f64);
    let last = rows.last().map(|row| row.second);
    let counters = hold.counters();
    let squares: f64 = rows.iter().map(|row| row.second.normalised_squared).sum();
    let nis_degrees_of_freedom = rows.iter().map(|row| row.second.degrees_of_freedom).sum();
    Summary {
        nis: squares / f64::from(u32::max(nis_degrees_of_freedom, 1)),
        nis_degrees_of_freedom,
        class: class.name,
        seconds: rows.len(),
        standing_s: count(Motion::Standing),
        moving_s: count(Motion::Moving),
        gaps: counters.gaps,
        saturated: counters.saturated,
        invalid: counters.invalid,
        heading_deg: last.map_or(f64::NAN, |second| second.angles.heading_deg),
        sigma_heading_deg: last.map_or(180.0, |second| second.sigma_heading_deg),
        refix_at_s: rows.iter().find(|row| row.second.refix).map(|row| row.t_s),
        rms_error_deg: some.map(|n| (errors.iter().map(|(error, _)| error * error).sum::<f64>() / n).sqrt()),
        within_two_sigma: some
            .map(|n| errors.iter().filter(|(error, sigma)| error.abs() <= 1.96 * sigma).count() as f64 / n),
    }
}
