//! `north calibrate ellipsoid`: biases, scale factors and non-orthogonality of an accelerometer triad.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use north_finder::calibration::ellipsoid::{Role, Weights, norm_rms};

use super::{decimals, write_rows};
use crate::calibrate::ellipsoid::{EllipsoidError, Outcome, calibrate};
use crate::calibrate::model_file::{Accelerometer, CalibrationFile};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::output::JsonOption;

/// Calibrate an accelerometer triad from readings at rest in many attitudes
///
/// FILE has the columns t_s, ax, ay, az (a continuous recording: the still intervals are found) or attitude, ax, ay, az
/// (several readings an attitude), in any unit: ax_raw, ax_g and the like are found too. A quarter of the attitudes is not
/// learned from, only judged. Corrected: f = matrix (reading - bias), in the unit of G.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north calibrate ellipsoid readings.csv --model-out accelerometers.toml
  north calibrate ellipsoid counts.csv --gravity 9.81744 --compare another.toml --json -")]
pub struct Ellipsoid {
    /// The recording
    #[arg(value_name = "FILE")]
    path: PathBuf,
    /// Norm of specific force at rest, in the unit that is wanted: 1 for g, 9.81 for m/s2
    #[arg(long, value_name = "G", default_value_t = 1.0, value_parser = gravity)]
    gravity: f64,
    /// Judge another calibration by the same attitudes
    #[arg(long, value_name = "M.toml")]
    compare: Option<PathBuf>,
    /// Write the calibration to M.toml
    #[arg(long, value_name = "M.toml")]
    model_out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

fn gravity(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(gravity) if (1e-30..=1e30).contains(&gravity) => Ok(gravity),
        _ => Err("allowed is a number from 1e-30 to 1e30".into()),
    }
}

impl Ellipsoid {
    pub fn run(self) -> Result<(), Failure> {
        let other = self.other()?;
        let outcome = calibrate(&self.path, self.gravity).map_err(|error| match error {
            EllipsoidError::File(error) => error.into(),
            refused => Failure::Refused(refused.to_string()),
        })?;
        write_outcome(&mut self.json.human(), &outcome, self.gravity, other.as_ref())?;
        self.json.write(&outcome.record())?;
        if let Some(path) = &self.model_out {
            CalibrationFile::of_accelerometer(&outcome.calibration, self.gravity).write(path)?;
        }
        Ok(())
    }

    /// The calibration to compare with.
    fn other(&self) -> Result<Option<Accelerometer>, FileError> {
        let Some(path) = &self.compare else { return Ok(None) };
        match CalibrationFile::read(path)?.accelerometer {
            Some(other) => Ok(Some(other)),
            None => Err(FileError::whole(path, Problem::Syntax("it has no table [accelerometer]".into()))),
        }
    }
}

fn write_outcome(
    out: &mut dyn Write,
    outcome: &Outcome,
    gravity: f64,
    other: Option<&Accelerometer>,
) -> io::Result<()> {
    let calibration = &outcome.calibration;
    let correction = &calibration.correction;
    let [fitted, judged] = [Role::Fit, Role::Check].map(|role| outcome.count(role));
    writeln!(out, "{} attitudes: {fitted} learned from, {judged} only judged", fitted + judged)?;
    for rejected in &outcome.rejected {
        let time = rejected.t_s.map_or(String::new(), |[from_s, to_s]| format!(" ({from_s:.1} to {to_s:.1} s)"));
        writeln!(
            out,
            "left out: attitude {}{time}, {} readings: {}",
            rejected.attitude, rejected.readings, rejected.why
        )?;
    }
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
    if let Some(other) = other {
        let rms = |role| {
            let scaled = norm_rms(outcome.means(role), &other.correction(), other.gravity);
            scaled.map_or("-".into(), |rms| format!("{:.6}", rms * gravity / other.gravity))
        };
        writeln!(
            out,
            "  by the other calibration: learned from here {}, only judged {}",
            rms(Role::Fit),
            rms(Role::Check)
        )?;
    }
    Ok(())
}
