//! `north track`: orientation along a recording.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use inertial::filter::Mode;
use inertial::filter::block::BlockErrors;
use inertial::{Angles, BlockClass, Motion};
use schemars::JsonSchema;
use serde::Serialize;

use super::number;
use crate::block_csv::{BlockRecording, BlockRow};
use crate::block_gate::{self, Gated};
use crate::count::counted;
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::model_file::ModelFile;
use crate::output::{self, JsonOption};
use crate::report::{self, ReportOption};
use crate::track::aided::{self, Aided, Loss, Rejection, SourceSummary};
use crate::track::aiding_csv::Aiding;
use crate::track::installation::Installation;
use crate::track::start::{self, Start};
use crate::track::{Detail, Reference, doubt, held};

/// Orientation along a recording of a three-axis block
///
/// The heading starts from --heading, or from an alignment of the first seconds, in which the block stands. Without aiding it is held
/// from there: biases are learned while the block stands, increments are summed up while it moves, sigma grows with the class of the
/// block. With aiding, in columns of the recording or in files of their own, a filter of 35 states takes every reading at its own
/// time (47 states with an electrostatic gyro). Outliers are rejected and counted, lost sources are told. Gaps are bridged with a
/// wider sigma, 5 s held, 1 s aided; saturated gyros are counted.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north track walk.csv --latitude 34.75 --heading 12.34 --class modern-mems --out track.csv
  north track parked.csv --latitude 34.246 --align 300 --class ring-laser --out track.csv --report track.html
  north simulate --voyage dive --out dive && north track dive/block.csv --latitude 60 --heading 40 --heading-sigma 3 --align 60 \\
    --class modern-mems --aid dive/satellites.csv --aid dive/log.csv --aid dive/depth.csv --aid dive/acoustic.csv \\
    --aid dive/phases.csv --aid dive/esg.csv --installation dive/installation.toml --mode aided --mode submerged@1200 --out track.csv --report track.html")]
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
    /// Seconds at the start that are aligned, or levelled
    #[arg(long, value_name = "S", default_value = "100", value_parser = number::<1, 100_000>)]
    align: f64,
    /// Class of the block
    #[arg(long, value_enum, default_value_t = Class::ModernMems)]
    class: Class,
    /// Readings that aid, with a column t_s of their own: docs/formats.md; again for each file
    #[arg(long, value_name = "FILE.csv")]
    aid: Vec<PathBuf>,
    /// Where antennas are, and what an electrostatic gyro is good for: docs/formats.md
    #[arg(long, value_name = "FILE.toml")]
    installation: Option<PathBuf>,
    /// Which sources are taken, from a time on, s: "aided", "submerged@3600"; again for each change; aided without it
    #[arg(long, value_name = "MODE[@S]", value_parser = mode)]
    mode: Vec<(f64, Mode)>,
    /// Heading to compare with, degrees, where the block stood all the time; a column reference_heading_deg does it for each row
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-360, 360>, conflicts_with = "reference_track")]
    reference: Option<f64>,
    /// Headings to compare with: a file with t_s and heading_deg, another track for example
    #[arg(long, value_name = "FILE.csv")]
    reference_track: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    json: JsonOption,
}

/// Names of the modes.
const MODES: [(&str, Mode); 5] = [
    ("stand", Mode::Stand),
    ("aided", Mode::Aided),
    ("manoeuvring", Mode::Manoeuvring),
    ("log-only", Mode::LogOnly),
    ("submerged", Mode::Submerged),
];

fn mode(text: &str) -> Result<(f64, Mode), String> {
    let (name, from_s) = match text.split_once('@') {
        Some((name, from)) => (name, from.parse().ok().filter(|from_s: &f64| from_s.is_finite())),
        None => (text, Some(f64::NEG_INFINITY)),
    };
    let mode = MODES.iter().find(|(known, _)| *known == name).map(|(_, mode)| *mode);
    match (mode, from_s) {
        (Some(mode), Some(from_s)) => Ok((from_s, mode)),
        _ => Err(format!("allowed is one of {}, with @ and a time in seconds", MODES.map(|(name, _)| name).join(", "))),
    }
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

    /// What the aided filter is told of it.
    fn errors(self) -> BlockErrors {
        match self {
            Self::SourceMems => BlockErrors::MEMS_HARDWARE,
            Self::ModernMems => BlockErrors::STIM300,
            Self::SourceFog => BlockErrors::FOG,
            Self::RingLaser => BlockErrors::RING_LASER,
        }
    }
}

/// What became of the recording.
#[derive(Serialize, JsonSchema)]
pub(super) struct Summary {
    class: &'static str,
    seconds: usize,
    /// Time at the start that was aligned, or levelled.
    aligned_s: f64,
    gaps: u32,
    saturated: u32,
    outliers: Gated,
    #[schemars(with = "Option<f64>")]
    heading_deg: f64,
    sigma_heading_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    rms_error_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    within_two_sigma: Option<f64>,
    /// Mean normalised squared innovation, and how many.
    nis: f64,
    nis_degrees_of_freedom: u32,
    /// Nothing speaks against the sigmas.
    #[serde(skip)]
    sigmas_hold: bool,
    /// Why the sigmas do not hold, and what of the recording or of the files beside it was of no use.
    warnings: Vec<String>,
    #[serde(flatten)]
    how: How,
}

/// A track, however it was made, with what is told of it.
struct Tracked {
    track: crate::track::Track,
    gaps: u32,
    saturated: u32,
    /// Why the sigmas do not hold.
    doubts: Vec<String>,
    /// Sources whose times are not those of the recording.
    elsewhere: Vec<String>,
    how: How,
}

/// What only one of the two ways knows.
#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
enum How {
    Held {
        standing_s: usize,
        moving_s: usize,
        invalid: u32,
        refix_at_s: Option<f64>,
    },
    Aided {
        sources: Vec<SourceSummary>,
        rejections: Vec<Rejection>,
        sigma_position_m: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        rms_position_error_m: Option<f64>,
    },
}

impl Summary {
    fn said(&self) -> String {
        let rms = self.rms_error_deg.zip(self.within_two_sigma).map_or_else(String::new, |(rms, within)| {
            format!("; rms error {rms:.4}°, within 1.96 sigma {:.1} %", 100.0 * within)
        });
        let m = f64::from(self.nis_degrees_of_freedom);
        let nis = if m > 0.0 {
            format!("; NIS {:.3} (95 %: 1 ± {:.3})", self.nis, 1.96 * (2.0 / m).sqrt())
        } else {
            String::new()
        };
        let how = match &self.how {
            How::Held { standing_s, moving_s, invalid, refix_at_s } => {
                let refix =
                    refix_at_s.map_or_else(String::new, |t_s| format!("; a new fix is wanted since {t_s:.0} s"));
                format!("; {standing_s} s standing, {moving_s} moving, {invalid} invalid samples{refix}")
            }
            How::Aided { sources, sigma_position_m, rms_position_error_m, .. } => {
                let rms = rms_position_error_m.map_or_else(String::new, |rms| format!(", rms error {rms:.1} m"));
                let doubted = if self.sigmas_hold { "" } else { " (the sigmas do not hold, see the warnings)" };
                let sources: String = sources.iter().map(said_of_source).collect();
                format!("; position ± {sigma_position_m:.1} m{doubted}{rms}{sources}")
            }
        };
        format!(
            "{}: {} s, heading {:.4}° ± {:.4}°; {}, {} saturated, {}{how}{nis}{rms}",
            self.class,
            self.seconds,
            self.heading_deg,
            self.sigma_heading_deg,
            counted(self.gaps, "gap"),
            self.saturated,
            self.outliers
        )
    }
}

fn said_of_source(source: &SourceSummary) -> String {
    let SourceSummary {
        source: name, taken, rejected, longest_rejected_in_a_row, ignored_by_mode, unused, nis, ..
    } = source;
    let mut said = format!("\n  {name}: {taken} taken, {rejected} rejected beyond 5 sigma");
    if *longest_rejected_in_a_row > 1 {
        said += &format!(" (up to {longest_rejected_in_a_row} in a row)");
    }
    for (count, why) in
        [(*ignored_by_mode, "not used in the mode"), (*unused, "before, after or across an interruption")]
    {
        if count > 0 {
            said += &format!(", {count} {why}");
        }
    }
    said += &format!(", NIS {nis:.3}");
    for Loss { from_s, to_s, sigma_heading_before_deg: before, sigma_heading_after_deg: after } in &source.lost {
        let to = to_s.map_or_else(|| "the end".into(), |to_s| format!("{to_s:.1} s"));
        said += &format!("; lost from {from_s:.1} s to {to}, heading sigma {before:.4}° to {after:.4}°");
    }
    said
}

impl Track {
    pub fn run(mut self) -> Result<(), Failure> {
        let results = [Some(self.out.as_path()), self.report.path(), self.json.path()];
        output::check_beside(self.files_read(), results)?;
        let mut recording = ModelFile::read_block(&self.recording, self.model.as_deref())?;
        let outliers = block_gate::gate(&mut recording, &self.recording)?;
        let aiding = self.aiding()?;
        self.mode.sort_by(|a, b| a.0.total_cmp(&b.0));
        let reference = match &self.reference_track {
            Some(path) => Reference::read(path)?,
            None => Reference::fixed(self.reference),
        };
        let heading = self.heading.map(|heading_deg| (heading_deg, self.heading_sigma));
        let start = start::start(&recording, &self.class.block(), self.latitude, self.align, heading)
            .map_err(|reason| self.refused(&reason))?;
        let tracked = self.tracked(&recording, &aiding, &start, &reference)?;
        self.write_track(&tracked.track)?;
        let doubt = self.doubt_of_reference(&reference, &tracked.track);
        let warnings = start.doubt(self.align).into_iter().chain(doubt).collect();
        let (summary, track) = self.summary(tracked, outliers, &start, warnings);
        for warning in &summary.warnings {
            output::warn(warning);
        }
        let said = summary.said();
        writeln!(self.json.human(), "{said}")?;
        self.report.write(|| report::track::html(&self.recording, &said, &track))?;
        self.json.write(&summary)
    }

    fn refused(&self, reason: &str) -> Failure {
        Failure::Refused(format!("{}: {reason}", self.recording.display()))
    }

    /// The readings that aid.
    fn aiding(&self) -> Result<Aiding, Failure> {
        let aiding = Aiding::read(&self.recording, &self.aid)?;
        for unknown in &aiding.unknown {
            eprintln!("north: note: columns that are no readings: {unknown}");
        }
        if aiding.is_empty() && (self.installation.is_some() || !self.mode.is_empty()) {
            return Err(Failure::Usage(
                "--installation and --mode need aiding: --aid, or columns of the recording".into(),
            ));
        }
        Ok(aiding)
    }

    /// Held where nothing aids.
    fn tracked(
        &self,
        recording: &BlockRecording,
        aiding: &Aiding,
        start: &Start,
        reference: &Reference,
    ) -> Result<Tracked, Failure> {
        if aiding.is_empty() {
            let (track, counters) = held::run(recording, &self.class.block(), self.latitude, start, reference)
                .map_err(|reason| self.refused(&reason))?;
            let how = how_held(&track, counters.invalid);
            let (gaps, saturated) = (counters.gaps, counters.saturated);
            return Ok(Tracked { track, gaps, saturated, doubts: Vec::new(), elsewhere: Vec::new(), how });
        }
        let Aided { track, sources, rejections, gaps, saturated } = self.aided(recording, aiding, start, reference)?;
        let time_s = |row: Option<&BlockRow>| row.map_or(0.0, |row| row.t_s);
        let first = start.rows.checked_sub(1).and_then(|last| recording.rows.get(last));
        let elsewhere = doubt::elsewhere(&sources, [time_s(first), time_s(recording.rows.last())]);
        let doubts = doubt::warnings(aiding, &sources);
        let how = how_aided(&track, sources, rejections);
        Ok(Tracked { track, gaps, saturated, doubts, elsewhere, how })
    }

    /// That no row of the track could be compared with the track that was given for it, in a sentence.
    fn doubt_of_reference(&self, reference: &Reference, track: &crate::track::Track) -> Option<String> {
        let (path, [from_s, to_s]) = (self.reference_track.as_ref()?, reference.span_s()?);
        let (first, last) = (track.rows.first()?, track.rows.last()?);
        track.errors().is_none().then(|| {
            format!(
                "no row of the track lies within the times of {}, {from_s:.1} to {to_s:.1} s; the track: {:.1} to {:.1} s",
                path.display(),
                first.t_s,
                last.t_s
            )
        })
    }

    /// With the track that it is of; `warnings` are those that do not come from the track itself.
    fn summary(
        &self,
        tracked: Tracked,
        outliers: Gated,
        start: &Start,
        warnings: Vec<String>,
    ) -> (Summary, crate::track::Track) {
        let Tracked { track, gaps, saturated, doubts, elsewhere, how } = tracked;
        let last = track.rows.last();
        let (errors, (nis, nis_degrees_of_freedom)) = (track.errors(), track.nis());
        let summary = Summary {
            class: self.class.block().name,
            seconds: track.rows.len(),
            aligned_s: start.aligned_s,
            gaps,
            saturated,
            outliers,
            heading_deg: last.map_or(f64::NAN, |row| row.angles.heading_deg),
            sigma_heading_deg: last.map_or(180.0, |row| row.sigma_heading_deg),
            rms_error_deg: errors.map(|(rms, _)| rms),
            within_two_sigma: errors.map(|(_, within)| within),
            nis,
            nis_degrees_of_freedom,
            sigmas_hold: doubts.is_empty(),
            warnings: doubts.into_iter().chain(elsewhere).chain(warnings).collect(),
            how,
        };
        (summary, track)
    }

    /// The files that are read.
    fn files_read(&self) -> impl Iterator<Item = &Path> {
        let named = [&self.model, &self.installation, &self.reference_track];
        let named = named.into_iter().filter_map(Option::as_deref);
        std::iter::once(self.recording.as_path()).chain(named).chain(self.aid.iter().map(PathBuf::as_path))
    }

    fn aided(
        &self,
        recording: &BlockRecording,
        aiding: &Aiding,
        start: &Start,
        reference: &Reference,
    ) -> Result<Aided, Failure> {
        let installation =
            self.installation.as_deref().map_or_else(|| Ok(Installation::default()), Installation::read)?;
        let settings = aided::Settings {
            class: self.class.block(),
            errors: self.class.errors(),
            latitude_deg: self.latitude,
            installation,
            modes: self.mode.clone(),
        };
        aided::run(recording, aiding, start, &settings, reference).map_err(|reason| self.refused(&reason))
    }

    fn write_track(&self, track: &crate::track::Track) -> Result<(), Failure> {
        let write = || -> io::Result<()> {
            let mut out = crate::output::create(&self.out)?;
            let own = match track.rows.first().map(|row| row.detail) {
                Some(Detail::Aided { .. }) => "lat_deg,lon_deg,height_m,ve_m_s,vn_m_s,vu_m_s,sigma_position_m",
                _ => "standing,refix",
            };
            writeln!(out, "t_s,heading_deg,pitch_deg,roll_deg,sigma_heading_deg,sigma_level_deg,{own}")?;
            for row in &track.rows {
                let Angles { heading_deg, pitch_deg, roll_deg } = row.angles;
                let (t_s, sigma_deg, level_deg) = (row.t_s, row.sigma_heading_deg, row.sigma_level_deg);
                write!(out, "{t_s},{heading_deg},{pitch_deg},{roll_deg},{sigma_deg},{level_deg},")?;
                match row.detail {
                    Detail::Held { motion, refix } => {
                        writeln!(out, "{},{}", u8::from(motion == Motion::Standing), u8::from(refix))?;
                    }
                    Detail::Aided { latitude_deg, longitude_deg, height_m, velocity_m_s, sigma_position_m, .. } => {
                        let [east, north, up] = velocity_m_s;
                        writeln!(
                            out,
                            "{latitude_deg},{longitude_deg},{height_m},{east},{north},{up},{sigma_position_m}"
                        )?;
                    }
                }
            }
            out.finish()
        };
        write().map_err(|error| FileError::whole(&self.out, error).into())
    }
}

fn how_held(track: &crate::track::Track, invalid: u32) -> How {
    let held = || {
        track.rows.iter().filter_map(|row| match row.detail {
            Detail::Held { motion, refix } => Some((row.t_s, motion, refix)),
            Detail::Aided { .. } => None,
        })
    };
    let count = |wanted| held().filter(|(_, motion, _)| *motion == wanted).count();
    How::Held {
        standing_s: count(Motion::Standing),
        moving_s: count(Motion::Moving),
        invalid,
        refix_at_s: held().find(|(_, _, refix)| *refix).map(|(t_s, ..)| t_s),
    }
}

fn how_aided(track: &crate::track::Track, sources: Vec<SourceSummary>, rejections: Vec<Rejection>) -> How {
    let places: Vec<(f64, Option<f64>)> = track
        .rows
        .iter()
        .filter_map(|row| match row.detail {
            Detail::Aided { sigma_position_m, position_error_m, .. } => Some((sigma_position_m, position_error_m)),
            Detail::Held { .. } => None,
        })
        .collect();
    let errors: Vec<f64> = places.iter().filter_map(|(_, error)| *error).collect();
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    How::Aided {
        sources,
        rejections,
        sigma_position_m: places.last().map_or(f64::INFINITY, |(sigma, _)| *sigma),
        rms_position_error_m: (!errors.is_empty()).then_some(rms),
    }
}
