//! `north calibrate ellipsoid`: biases, scale factors and non-orthogonality of an accelerometer triad.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use calibration::ellipsoid::{Calibration, Misalignments, Role, Weights};
use clap::Args;

use super::gravity::Gravity;
use super::{decimals, write_model, write_rejected, write_rows};
use crate::calibrate::ellipsoid::{Compared, EllipsoidError, Outcome, calibrate};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::model_file::{Accelerometer, ModelFile, Triads};
use crate::output::{self, JsonOption};
use crate::report::{self, ReportOption};

/// Calibrate an accelerometer triad from readings at rest in many attitudes
///
/// FILE has the columns t_s, ax, ay, az (a continuous recording: the still intervals are found) or attitude, ax, ay, az
/// (several readings an attitude), in any unit: ax_raw, ax_g and the like are found too. A quarter of the attitudes is not
/// learned from, only judged. Corrected: f = matrix (reading - bias), in the unit of G.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north calibrate ellipsoid readings.csv --model-out accelerometers.toml
  north calibrate ellipsoid counts.csv --latitude 45.41 --height 15 --compare another.toml --json -
  north calibrate ellipsoid field.csv --prior turntable.toml")]
pub struct Ellipsoid {
    /// The recording
    #[arg(value_name = "FILE")]
    path: PathBuf,
    #[command(flatten)]
    gravity: Gravity,
    /// Misalignments of an earlier calibration, combined with the biases and scale factors of this one by their sigmas
    #[arg(long, value_name = "M.toml")]
    prior: Option<PathBuf>,
    /// Judge another calibration by the same attitudes
    #[arg(long, value_name = "M.toml")]
    compare: Option<PathBuf>,
    /// Write the calibration to M.toml
    #[arg(long, value_name = "M.toml")]
    model_out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    json: JsonOption,
}

impl Ellipsoid {
    pub fn run(self) -> Result<(), Failure> {
        let models = [&self.prior, &self.compare].into_iter().filter_map(Option::as_deref);
        let results = [self.model_out.as_deref(), self.report.path(), self.json.path()];
        output::check_beside(std::iter::once(self.path.as_path()).chain(models), results)?;
        let other = self.compare.as_deref().map(accelerometer).transpose()?;
        let prior = self.prior.as_deref().map(misalignments).transpose()?;
        let gravity = self.gravity.norm();
        let outcome = calibrate(&self.path, gravity, prior.as_ref()).map_err(|error| match error {
            EllipsoidError::Recording(error) => error.into(),
            refused @ EllipsoidError::Refused { .. } => Failure::Refused(refused.to_string()),
        })?;
        let out = &mut self.json.human();
        writeln!(out, "{}", self.gravity.said())?;
        if let Some(path) = &self.prior {
            writeln!(out, "misalignments combined with those of {}", path.display())?;
        }
        let compared = other.map(|other| outcome.compared(&other.correction(), other.gravity, gravity));
        write_outcome(out, &outcome, gravity, compared)?;
        self.report.write(|| report::calibrate::ellipsoid(&self.path, &outcome, gravity))?;
        self.json.write(&outcome.record(gravity, compared))?;
        let Calibration { correction, sigma_bias, sigma_matrix, .. } = &outcome.calibration;
        let triads = Triads::of_accelerometer(correction, (*sigma_bias, *sigma_matrix), gravity);
        Ok(write_model(self.model_out.as_deref(), &triads)?)
    }
}

/// The accelerometers' calibration in a file.
fn accelerometer(path: &Path) -> Result<Accelerometer, FileError> {
    ModelFile::read(path)?.accelerometer().copied()
}

/// The misalignments in a file; exact where it has no sigmas.
///
/// Errors: as [`accelerometer`]; sigmas of misalignments that were not estimated; a matrix that no triad has.
fn misalignments(path: &Path) -> Result<Misalignments, FileError> {
    let accelerometer = accelerometer(path)?;
    if accelerometer.has_no_misalignments() {
        let problem = "its misalignments were not estimated (their sigmas are 0): give a calibration that has them, from \
                       `calibrate ellipsoid` or from `accelerometer-six-position --square-arcsec`";
        return Err(FileError::whole(path, Problem::Syntax(problem.into())));
    }
    let sigma_matrix = accelerometer.sigma_matrix.unwrap_or_default();
    Misalignments::of(&accelerometer.correction(), &sigma_matrix)
        .ok_or_else(|| FileError::whole(path, Problem::Syntax("the matrix of [accelerometer] is no triad's".into())))
}

fn write_outcome(out: &mut dyn Write, outcome: &Outcome, gravity: f64, compared: Option<Compared>) -> io::Result<()> {
    let calibration = &outcome.calibration;
    let correction = &calibration.correction;
    let [fitted, judged] = [Role::Fit, Role::Check].map(|role| outcome.count(role));
    writeln!(out, "{} attitudes: {fitted} learned from, {judged} only judged", fitted + judged)?;
    write_rejected(out, &outcome.rejected)?;
    writeln!(out, "coverage of the sphere {:.3}", calibration.coverage)?;
    writeln!(out, "\n     bias              scale factor, readings per unit")?;
    let places = decimals(calibration.sigma_bias);
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let bias = format!("{:+.places$} ± {:.places$}", correction.bias[axis], calibration.sigma_bias[axis]);
        writeln!(out, "  {name}  {bias:<30}  {:.places$}", correction.scale_factors()[axis])?;
    }
    let [xy, xz, yz] = correction.angles_deg();
    writeln!(out, "angles between the axes: x-y {xy:.4}, x-z {xz:.4}, y-z {yz:.4} deg")?;
    let [greatest, middle, least] = calibration.half_axes;
    writeln!(out, "half axes of the ellipsoid: {greatest:.places$}, {middle:.places$}, {least:.places$} readings")?;
    writeln!(out, "\nmatrix: specific force per reading less bias")?;
    let places = decimals(calibration.sigma_matrix.into_iter().flatten());
    write_rows(out, &correction.matrix, &calibration.sigma_matrix, places)?;
    match calibration.weights {
        Weights::Noise => writeln!(out, "the noise of the readings explains what is left")?,
        Weights::Excess(rms) => writeln!(
            out,
            "more is left than the noise of the readings explains: {:.6} rms; the sigmas allow for it",
            rms * gravity
        )?,
    }
    writeln!(out, "\nnorm at rest less {gravity}, rms")?;
    writeln!(out, "  before                {:.6}", outcome.norm_rms_before)?;
    writeln!(out, "  after, learned from   {:.6}", calibration.norm_rms)?;
    if let Some(rms) = calibration.check_norm_rms {
        writeln!(out, "  after, only judged    {rms:.6}")?;
    }
    if let Some(Compared { learned_from_rms, judged_rms }) = compared {
        let said = |rms: Option<f64>| rms.map_or("-".into(), |rms| format!("{rms:.6}"));
        writeln!(
            out,
            "  by the other calibration: learned from here {}, only judged {}",
            said(learned_from_rms),
            said(judged_rms)
        )?;
    }
    Ok(())
}
