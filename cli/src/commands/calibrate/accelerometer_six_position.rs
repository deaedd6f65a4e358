//! `north calibrate accelerometer-six-position`: biases and scale factors from each axis up and down.

use std::io::{self, Write};
use std::path::PathBuf;

use calibration::known_attitudes::Attitudes;
use clap::Args;

use super::gravity::Gravity;
use super::{decimals, write_model, write_rejected, write_rows};
use crate::calibrate::known_attitudes::{KnownAttitudesError, Outcome, calibrate};
use crate::commands::number;
use crate::failure::Failure;
use crate::model_file::Triads;
use crate::output::{self, JsonOption};
use crate::report::{self, ReportOption};

/// Calibrate an accelerometer triad from each axis up and each axis down
///
/// FILE has the columns t_s, ax, ay, az (a continuous recording: the still intervals are found) or attitude, ax, ay, az
/// (several readings an attitude), in any unit. Which axis is up is told from the readings. Each axis up and down gives its
/// bias and scale factor; where the box is square, say how square, and the misalignments follow too.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  north calibrate accelerometer-six-position faces.csv --latitude 34.75 --model-out accelerometers.toml
  north calibrate accelerometer-six-position faces.csv --square-arcsec 60 --json -")]
pub struct AccelerometerSixPosition {
    /// The recording
    #[arg(value_name = "FILE")]
    path: PathBuf,
    /// The box's faces are square and its plate level to ± this, arcsec: misalignments are solved for too
    #[arg(long, value_name = "ARCSEC", value_parser = number::<0, 36_000>)]
    square_arcsec: Option<f64>,
    #[command(flatten)]
    gravity: Gravity,
    /// Write the calibration to M.toml
    #[arg(long, value_name = "M.toml")]
    model_out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    json: JsonOption,
}

impl AccelerometerSixPosition {
    pub fn run(self) -> Result<(), Failure> {
        let results = [self.model_out.as_deref(), self.report.path(), self.json.path()];
        output::check_beside([self.path.as_path()], results)?;
        let attitudes = self.square_arcsec.map_or(Attitudes::Rough, |arcsec| Attitudes::Square { arcsec });
        let gravity = self.gravity.norm();
        let outcome = calibrate(&self.path, gravity, attitudes).map_err(|error| match error {
            KnownAttitudesError::Recording(error) => error.into(),
            refused @ KnownAttitudesError::Refused { .. } => Failure::Refused(refused.to_string()),
        })?;
        self.write_outcome(&mut self.json.human(), &outcome)?;
        self.report.write(|| report::calibrate::faces(&self.path, &outcome, gravity))?;
        self.json.write(&outcome.record(gravity, self.square_arcsec.is_some()))?;
        let sigmas = (outcome.calibration.sigma_bias, outcome.sigma_matrix);
        let triads = Triads::of_accelerometer(&outcome.correction, sigmas, gravity);
        Ok(write_model(self.model_out.as_deref(), &triads)?)
    }

    fn write_outcome(&self, out: &mut dyn Write, outcome: &Outcome) -> io::Result<()> {
        let calibration = &outcome.calibration;
        writeln!(out, "{}", self.gravity.said())?;
        writeln!(out, "{:>8}  {:>8}          x          y          z", "up", "readings")?;
        let readings = decimals(calibration.sigma_bias);
        for (dwell, face) in &outcome.laid {
            let [x, y, z] = dwell.attitude.mean;
            let count = dwell.attitude.readings;
            writeln!(out, "{:>8}  {count:>8}  {x:+9.readings$}  {y:+9.readings$}  {z:+9.readings$}", face.name())?;
        }
        write_rejected(out, &outcome.rejected)?;
        writeln!(out, "\n     bias                         readings per unit of specific force")?;
        let sigma_scale = [0, 1, 2].map(|axis| calibration.sigma_response[axis][axis]);
        let places = decimals(sigma_scale);
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            let bias = format!("{:+.readings$} ± {:.readings$}", calibration.bias[axis], calibration.sigma_bias[axis]);
            let (scale, sigma) = (calibration.response[axis][axis], calibration.sigma_response[axis][axis]);
            writeln!(out, "  {name}  {bias:<27}  {scale:.places$} ± {sigma:.places$}")?;
        }
        if let Some(by_norm) = &outcome.by_norm {
            writeln!(
                out,
                "the same by the norm of the readings, the axes taken as orthogonal, and how far it is from them"
            )?;
            for (axis, name) in ["x", "y", "z"].iter().enumerate() {
                let (scale, own) = (by_norm.scale[axis], calibration.response[axis][axis]);
                let bias = format!(
                    "{:+.readings$} ({:+.readings$})",
                    by_norm.bias[axis],
                    by_norm.bias[axis] - calibration.bias[axis]
                );
                writeln!(out, "  {name}  {bias:<27}  {scale:.places$} ({:+.0} ppm)", 1e6 * (scale / own - 1.0))?;
            }
        }
        self.warn_of_lean(out, outcome)?;
        if self.square_arcsec.is_some() {
            writeln!(out, "\nmatrix: specific force along the box per reading less bias")?;
            let places = decimals(outcome.sigma_matrix.into_iter().flatten());
            write_rows(out, &outcome.correction.matrix, &outcome.sigma_matrix, places)?;
        } else {
            writeln!(out, "misalignments were not looked for: --square-arcsec says how square the box is")?;
        }
        match (calibration.closure.rms, calibration.closure.widened) {
            (None, _) => writeln!(out, "no closures: as many readings as parameters, nothing checks them"),
            (Some(rms), 1.0) => {
                writeln!(out, "{} closures: {rms:.readings$} rms, as noise has it", calibration.closure.count)
            }
            (Some(rms), widened) => writeln!(
                out,
                "{} closures: {rms:.readings$} rms, more than noise and angles explain; the sigmas are {widened:.1} times as \
                 wide for it",
                calibration.closure.count
            ),
        }
    }

    /// Faces that lean make the scale factors too small by more than the noise tells.
    fn warn_of_lean(&self, out: &mut dyn Write, outcome: &Outcome) -> io::Result<()> {
        let deficit = outcome.greatest_deficit();
        let calibration = &outcome.calibration;
        let least = (0..3).map(|axis| calibration.sigma_response[axis][axis] / calibration.response[axis][axis]);
        if deficit == 0.0 || least.fold(f64::INFINITY, f64::min) > 2.0 * deficit {
            return Ok(());
        }
        writeln!(
            out,
            "warning: what the other two axes read on a face is up to {:.2} deg of gravity: if the face leans by that, its axis reads {:.0} ppm too \
             little; the sigmas allow for it. Lay the faces level, or trust the norm where the axes are orthogonal; `north calibrate ellipsoid` \
             needs no faces",
            calibration.greatest_lean_rad.to_degrees(),
            1e6 * deficit
        )
    }
}
