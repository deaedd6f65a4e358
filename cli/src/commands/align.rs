//! `north align`: heading and levels of a block that stands or sways.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use inertial::{AlignError, Aligned, Alignment, NoiseOfRate};
use north_finder::earth::earth_rate;

use super::number;
use crate::block_csv::BlockRecording;
use crate::block_gate::{self, Gated};
use crate::failure::Failure;
use crate::file_error::FileError;
use crate::model_file::ModelFile;
use crate::output::JsonOption;
use crate::report::align::{self as align_report, Method, Report, Window};

/// Heading and levels of a still or swaying three-axis block
///
/// One estimator for every base: its jitter, random walk and drift are found together with the heading, so that a block that
/// stands is aligned to the bound of its gyros and one that rocks by its accelerometers. Where the latitude is known, the
/// windows are solved without it too, as a check. Heading and levels are those at the window's end. Outliers are replaced and counted.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north align parked.csv --latitude 34.246 --window 100 --report align.html
  north align buoy.csv --latitude unknown --json -")]
pub struct Align {
    /// Recording: t_s, gx_arcsec, gy_arcsec, gz_arcsec, ax_m_s2, ay_m_s2, az_m_s2; x forward, y left, z up
    #[arg(value_name = "FILE.csv")]
    recording: PathBuf,
    /// Calibrations of the block's triads, as north calibrate writes them: [gyro_triad], [accelerometer]
    #[arg(long, value_name = "M.toml")]
    model: Option<PathBuf>,
    /// Latitude, degrees, north positive, -90 to 90; "unknown" finds it
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = latitude)]
    latitude: Latitude,
    /// Length of the windows, seconds, 10 to 100000; without it the whole recording is the only one
    #[arg(long, value_name = "S", value_parser = number::<10, 100_000>)]
    window: Option<f64>,
    /// Angle random walk of the gyros, degrees per root hour; without it it is estimated from the recording
    #[arg(long, value_name = "DEG", value_parser = number::<0, 10>)]
    arw: Option<f64>,
    /// Bias of the gyros, one sigma, degrees per hour: no alignment at one heading can see it. Without it, what the horizontal
    /// rate has beyond the Earth's and its noise is taken for one; 0 gives the repeatability
    #[arg(long, value_name = "DEG_H", value_parser = number::<0, 1000>)]
    bias: Option<f64>,
    /// Heading to compare with, degrees: errors are printed
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = number::<-360, 360>)]
    reference: Option<f64>,
    /// Write a page with the headings of all windows
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// Known or to be found.
#[derive(Clone, Copy, Debug)]
struct Latitude(Option<f64>);

fn latitude(text: &str) -> Result<Latitude, String> {
    if text == "unknown" { Ok(Latitude(None)) } else { number::<-90, 90>(text).map(|deg| Latitude(Some(deg))) }
}

/// Samples of a window.
struct Gathered {
    start_s: f64,
    alignment: Alignment,
}

impl Align {
    pub fn run(self) -> Result<(), Failure> {
        let read = std::iter::once(self.recording.as_path()).chain(self.model.as_deref());
        crate::output::check_beside(read, [self.report.as_deref(), self.json.path()])?;
        let mut recording = ModelFile::read_block(&self.recording, self.model.as_deref())?;
        let gated = block_gate::gate(&mut recording, &self.recording)?;
        let whole = longest(gather(&recording, f64::INFINITY));
        let windows = self.window.map_or_else(Vec::new, |seconds| {
            let all = gather(&recording, seconds);
            all.into_iter().filter(|window| window.alignment.seconds() > 0.99 * seconds).collect()
        });
        let noise = self.noise(&whole, &windows);
        let mut report = self.whole(&whole, &noise)?;
        report.outliers = gated;
        report.gaps = recording.rows.iter().filter_map(|row| row.gap_s(recording.step_s)).count();
        report.recording_s = recording.rows.iter().map(|row| row.interval_s).sum();
        let all = if windows.is_empty() { std::slice::from_ref(&whole) } else { &windows };
        for window in all {
            report.windows.extend(self.methods().map(|method| {
                let Gathered { start_s, alignment } = window;
                Window::new(*start_s, alignment.seconds(), method, self.solve(alignment, method, &noise))
            }));
        }
        self.print(&mut self.json.human(), &report)?;
        if let Some(path) = &self.report {
            let page = align_report::html(&self.recording, &report, self.reference);
            crate::output::write(path, page).map_err(|error| FileError::whole(path, error))?;
        }
        self.json.write(&report)
    }

    /// The first one is the answer.
    fn methods(&self) -> impl Iterator<Item = Method> + use<> {
        let known = self.latitude.0.is_some();
        Method::ALL.into_iter().filter(move |method| known || *method == Method::UnknownLatitude)
    }

    fn noise(&self, whole: &Gathered, windows: &[Gathered]) -> NoiseOfRate {
        if let Some(arw) = self.arw {
            return NoiseOfRate::Declared(arw);
        }
        let all = if windows.is_empty() { std::slice::from_ref(whole) } else { windows };
        let learned = all.iter().filter_map(|window| window.alignment.noise(self.latitude.0));
        learned.reduce(|a, b| a.with(&b)).unwrap_or(NoiseOfRate::Declared(0.0))
    }

    fn solve(&self, alignment: &Alignment, method: Method, noise: &NoiseOfRate) -> Result<Aligned, AlignError> {
        let latitude_deg = self.latitude.0.filter(|_| method == Method::KnownLatitude);
        alignment.solve(latitude_deg, noise, self.bias)
    }

    fn whole(&self, whole: &Gathered, noise: &NoiseOfRate) -> Result<Report, Failure> {
        let method = if self.latitude.0.is_some() { Method::KnownLatitude } else { Method::UnknownLatitude };
        let aligned = self
            .solve(&whole.alignment, method, noise)
            .map_err(|error| Failure::Refused(format!("{}: {error}{}", self.recording.display(), mend(&error))))?;
        Ok(Report {
            heading_deg: aligned.angles.heading_deg,
            pitch_deg: aligned.angles.pitch_deg,
            roll_deg: aligned.angles.roll_deg,
            sigma_heading_deg: aligned.sigma_heading_deg,
            method: method.name(),
            latitude_deg: aligned.latitude_deg,
            arw_deg_per_sqrt_h: noise.deg_per_sqrt_h(),
            rate_excess_deg_h: aligned.rate_excess_deg_h,
            base_jitter_arcsec: aligned.base.jitter_arcsec,
            base_walk_arcsec_per_sqrt_s: aligned.base.walk_arcsec_sqrt_s,
            base_drift_deg_h: aligned.base.drift_deg_h,
            unseen_drift_deg_h: aligned.base.unseen_drift_deg_h,
            unseen_drift_heading_deg: earth_rate(aligned.latitude_deg)
                .map_or(180.0, |earth| (aligned.base.unseen_drift_deg_h / earth.north_deg_h).atan().to_degrees()),
            outliers: Gated::default(),
            gaps: 0,
            used_s: [whole.start_s, whole.start_s + whole.alignment.seconds()],
            recording_s: whole.alignment.seconds(),
            windows: Vec::new(),
        })
    }

    fn print(&self, out: &mut dyn Write, report: &Report) -> io::Result<()> {
        writeln!(
            out,
            "heading {:.4}° ± {:.4}°, pitch {:.4}°, roll {:.4}°, latitude {:.3}° ({})\nnoise of the gyros {:.5} °/√h, \
             horizontal rate {:+.4} °/h against the Earth's\nbase: jitter {:.3}″, random walk {:.3} ″/√s, drift {:.4} °/h, one sigma \
             each; a drift of {:.4} °/h would not be seen, and turn the heading by {:.4}°\n{}",
            report.heading_deg,
            report.sigma_heading_deg,
            report.pitch_deg,
            report.roll_deg,
            report.latitude_deg,
            report.method,
            report.arw_deg_per_sqrt_h,
            report.rate_excess_deg_h,
            report.base_jitter_arcsec,
            report.base_walk_arcsec_per_sqrt_s,
            report.base_drift_deg_h,
            report.unseen_drift_deg_h,
            report.unseen_drift_heading_deg,
            report.outliers,
        )?;
        if let Some(said) = report.said_of_gaps() {
            writeln!(out, "{said}")?;
        }
        writeln!(out, "\n| start, s | seconds | method | heading, ° | sigma, ° |\n|---|---|---|---|---|")?;
        for window in &report.windows {
            let Window { start_s, seconds, method, heading_deg, sigma_heading_deg, reason } = window;
            match (heading_deg, sigma_heading_deg) {
                (Some(heading), Some(sigma)) => {
                    writeln!(out, "| {start_s:.1} | {seconds:.1} | {method} | {heading:.4} | {sigma:.4} |")?;
                }
                _ => writeln!(
                    out,
                    "| {start_s:.1} | {seconds:.1} | {method} | – | {} |",
                    reason.as_deref().unwrap_or("")
                )?,
            }
        }
        self.print_errors(out, report)
    }

    /// Root mean square errors of the methods, and how often 1.96 sigma held the reference.
    fn print_errors(&self, out: &mut dyn Write, report: &Report) -> io::Result<()> {
        let Some(reference_deg) = self.reference else { return Ok(()) };
        writeln!(
            out,
            "\n| method | windows | rms error, ° | rms sigma, ° | within 1.96 sigma |\n|---|---|---|---|---|"
        )?;
        for method in self.methods() {
            let of_method = report.windows.iter().filter(|window| window.method == method.name());
            let errors: Vec<(f64, f64)> = of_method
                .filter_map(|window| {
                    let error = north_finder::units::wrap_180_deg(window.heading_deg? - reference_deg);
                    Some((error, window.sigma_heading_deg?))
                })
                .collect();
            let rms = |of: fn(&(f64, f64)) -> f64| {
                (errors.iter().map(|pair| of(pair).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
            };
            let within = errors.iter().filter(|(error, sigma)| error.abs() <= 1.96 * sigma).count();
            writeln!(
                out,
                "| {} | {} | {:.4} | {:.4} | {within} |",
                method.name(),
                errors.len(),
                rms(|pair| pair.0),
                rms(|pair| pair.1)
            )?;
        }
        Ok(())
    }
}

/// What the command line can do about it.
fn mend(error: &AlignError) -> &'static str {
    match error {
        AlignError::OtherLatitude { .. } => {
            "; correct --latitude, give \"unknown\", or declare the --bias of the gyros that explains it"
        }
        _ => "",
    }
}

impl Window {
    fn new(start_s: f64, seconds: f64, method: Method, solved: Result<Aligned, AlignError>) -> Self {
        let (aligned, reason) = match solved {
            Ok(aligned) => (Some(aligned), None),
            Err(error) => (None, Some(error.to_string())),
        };
        Self {
            start_s,
            seconds,
            method: method.name(),
            heading_deg: aligned.map(|aligned| aligned.angles.heading_deg),
            sigma_heading_deg: aligned.map(|aligned| aligned.sigma_heading_deg),
            reason,
        }
    }
}

/// Windows of `seconds` one after the other; a gap ends one.
fn gather(recording: &BlockRecording, seconds: f64) -> Vec<Gathered> {
    let mut windows: Vec<Gathered> = Vec::new();
    for row in &recording.rows {
        let gap = row.gap_s(recording.step_s).is_some();
        let full = |window: &Gathered| window.alignment.seconds() > seconds - 0.5 * recording.step_s;
        if gap || windows.last().is_none_or(full) {
            let start_s = row.t_s - if gap { 0.0 } else { row.interval_s };
            windows.push(Gathered { start_s, alignment: Alignment::default() });
            if gap {
                continue;
            }
        }
        if let Some(window) = windows.last_mut() {
            window.alignment.push(row.interval_s, row.increment);
        }
    }
    windows
}

fn longest(windows: Vec<Gathered>) -> Gathered {
    let longest = windows.into_iter().max_by(|a, b| a.alignment.seconds().total_cmp(&b.alignment.seconds()));
    longest.unwrap_or_else(|| Gathered { start_s: 0.0, alignment: Alignment::default() })
}
