//! The result of a fix as a block of text.

use std::io::{self, Write};

use north_finder::event::{Fix, Heading, State};
use north_finder::health::Fault;
use north_finder::sensing::level::Tilt;
use north_finder::units::wrap_180_deg;

use super::Directions;

/// An azimuth to compare with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// "true" or "reference".
    pub name: &'static str,
    /// Degrees clockwise from true north.
    pub azimuth_deg: f64,
}

/// Azimuth, sigma, closure, what the fix found besides, flags with explanations, and the error.
pub fn write_fix(
    out: &mut dyn Write,
    fix: &Fix,
    directions: &Directions,
    reference: Option<Reference>,
) -> io::Result<()> {
    directions.write(out, fix.azimuth_deg, fix.sigma_deg)?;
    if let Some(Reference { name, azimuth_deg }) = reference {
        let error_deg = wrap_180_deg(fix.azimuth_deg - azimuth_deg);
        let sigmas = error_deg.abs() / fix.sigma_deg;
        writeln!(out, "{name:<10} {}", directions.unit().azimuth(azimuth_deg))?;
        writeln!(out, "error      {error_deg:+.4}° ({sigmas:.1} sigma)")?;
    }
    match (fix.closure_deg_h, fix.closure_sigma_deg_h) {
        (Some(closure), Some(sigma)) => writeln!(out, "closure    {closure:+.5} ± {sigma:.5} °/h")?,
        _ => writeln!(out, "closure    not determined by these angles")?,
    }
    let (chi_square, degrees_of_freedom) = (fix.chi_square, fix.degrees_of_freedom);
    writeln!(out, "fit        chi-square {chi_square:.1}, {degrees_of_freedom} degrees of freedom")?;
    writeln!(
        out,
        "found      horizontal rate {:.4} °/h, bias {:+.4} °/h, drift {:+.3} °/h per hour",
        fix.amplitude_deg_h, fix.bias_deg_h, fix.drift_deg_h_per_h
    )?;
    if let Some(Tilt { pitch_deg, roll_deg }) = fix.tilt {
        writeln!(out, "tilt       pitch {pitch_deg:+.4}°, roll {roll_deg:+.4}°")?;
    }
    writeln!(out, "measured   {:.0} s", fix.seconds)?;
    if fix.flags.is_empty() {
        writeln!(out, "flags      none")?;
    }
    for flag in fix.flags.iter() {
        writeln!(out, "flag       {}: {}. To do: {}.", flag.name(), flag.meaning(), flag.remedy())?;
    }
    Ok(())
}

/// The heading that is held after the instrument was carried, and the error.
pub fn write_held(out: &mut dyn Write, heading: &Heading, true_deg: f64) -> io::Result<()> {
    let Heading { heading_deg, sigma_deg, refix, .. } = *heading;
    let error_deg = wrap_180_deg(heading_deg - true_deg);
    let sigmas = error_deg.abs() / sigma_deg;
    writeln!(out, "held       {heading_deg:.4}° ± {sigma_deg:.4}° where it was carried to")?;
    writeln!(out, "true       {true_deg:.4}°")?;
    writeln!(out, "error      {error_deg:+.4}° ({sigmas:.1} sigma)")?;
    if refix {
        writeln!(out, "new fix    asked for: sigma has passed its limit")?;
    }
    Ok(())
}

/// The fault that ended a fix.
pub fn write_fault(out: &mut dyn Write, fault: Fault, state: State) -> io::Result<()> {
    writeln!(
        out,
        "no azimuth: {} while {}: {}. To do: {}.",
        fault.name(),
        state.name(),
        fault.meaning(),
        fault.remedy()
    )
}
