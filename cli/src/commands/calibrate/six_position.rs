//! `north calibrate six-position`: bias, scale factors and misalignments of a gyro triad.

use std::io::{self, Write};
use std::path::PathBuf;

use calibration::six_position::dwell::Turned;
use clap::Args;

use super::write_rows;
use crate::calibrate::six_position::{Outcome, SixPositionError, calibrate, files, noted_temperatures};
use crate::failure::Failure;
use crate::model_file::Triads;
use crate::output::JsonOption;
use crate::report::{self, ReportOption};

/// Calibrate a gyro triad from its dwells in known positions on a table at rest
///
/// DIR/calibration.toml lists the positions: format = 1, latitude_deg, and for each a [[position]] with file and axes (which
/// way x, y and z point, such as "ENU"). A file has the columns t_s, gx_arcsec, gy_arcsec, gz_arcsec. Six positions determine the
/// twelve parameters with six closures; any set that determines them will do.
#[derive(Args, Debug)]
#[command(after_help = "Example:
  north calibrate six-position table-2026-05-04 --model-out triad.toml")]
pub struct SixPosition {
    /// The folder with calibration.toml
    #[arg(value_name = "DIR")]
    path: PathBuf,
    /// Write the calibration to M.toml
    #[arg(long, value_name = "M.toml")]
    model_out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    json: JsonOption,
}

impl SixPosition {
    pub fn run(self) -> Result<(), Failure> {
        let read = files(&self.path)?;
        let results = [self.model_out.as_deref(), self.report.path(), self.json.path()];
        crate::output::check_beside(read.iter().map(PathBuf::as_path), results)?;
        let outcome = calibrate(&self.path).map_err(|error| match error {
            SixPositionError::File(error) => error.into(),
            refused => Failure::Refused(refused.to_string()),
        })?;
        write_outcome(&mut self.json.human(), &outcome)?;
        self.report.write(|| report::calibrate::six_position(&self.path, &outcome))?;
        self.json.write(&outcome.record())?;
        if let Some(path) = &self.model_out {
            Triads::of_gyros(&outcome.calibration).write(path)?;
        }
        Ok(())
    }
}

fn write_outcome(out: &mut dyn Write, outcome: &Outcome) -> io::Result<()> {
    write_visits(out, outcome)?;
    let calibration = &outcome.calibration;
    writeln!(out, "\nbias, deg/h                  least squares    by differences")?;
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let (bias, sigma) = (calibration.bias_deg_h[axis], calibration.sigma_bias_deg_h[axis]);
        write!(out, "  {name}  {:>34}", format!("{bias:+.5} ± {sigma:.5}"))?;
        writeln!(out, "  {}", outcome.published.map_or("-".into(), |by| format!("{:+.5}", by.bias_deg_h[axis])))?;
    }
    writeln!(out, "\noutput per true rate about x, y, z, least squares")?;
    write_rows(out, &calibration.matrix, &calibration.sigma_matrix, 6)?;
    if let Some(published) = outcome.published {
        writeln!(out, "the same by differences")?;
        for (name, [x, y, z]) in ["x", "y", "z"].iter().zip(published.matrix) {
            writeln!(out, "  {name}  {x:+.6}             {y:+.6}             {z:+.6}")?;
        }
    }
    let closure = &calibration.closure;
    match (closure.rms_deg_h, closure.p_value) {
        (Some(rms_deg_h), Some(p_value)) => {
            writeln!(out, "\n{} closures: {rms_deg_h:.5} deg/h rms, probability {p_value:.3}", closure.count)
        }
        _ => writeln!(out, "\nno closures: as many measurements as parameters, nothing checks them"),
    }
}

fn write_visits(out: &mut dyn Write, outcome: &Outcome) -> io::Result<()> {
    let width = outcome.visits.iter().map(|visit| visit.name.chars().count()).max().unwrap_or_default().max(8);
    writeln!(out, "{:<width$}    seconds  left out          x          y          z  deg/h", "position")?;
    for visit in &outcome.visits {
        let dwell = &visit.position.dwell;
        let seconds = |rows: usize| rows as f64 * visit.mean_s;
        let [x, y, z] = dwell.rate_deg_h;
        writeln!(
            out,
            "{:<width$}  {:9.0} {:9.0}  {x:+9.4}  {y:+9.4}  {z:+9.4}",
            visit.name,
            seconds(dwell.rows),
            seconds(dwell.left_out)
        )?;
    }
    for visit in &outcome.visits {
        if let Some(Turned { rows, arcsec }) = visit.position.dwell.turned {
            let seconds = rows as f64 * visit.mean_s;
            writeln!(
                out,
                "note: {}: {seconds:.0} s at rest but turned by {arcsec:.0} arcsec are left out",
                visit.name
            )?;
        }
    }
    if let Some([low, high]) = noted_temperatures(&outcome.visits) {
        writeln!(
            out,
            "note: the temperature differs from {low:.1} to {high:.1} C between the positions; biases may follow it"
        )?;
    }
    Ok(())
}
