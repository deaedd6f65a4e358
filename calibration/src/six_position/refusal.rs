//! Why a set of positions gives no calibration.

use quantities::earth::LatitudeError;

use super::{LEAST_CLOSURE_P, MOST_SIGMA};

/// A parameter of one gyro: its bias or its response to rotation about an axis. Which gyro does not matter: all see the
/// same positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Undetermined {
    pub bias: bool,
    /// Responses to rotation about x, y, z.
    pub about: [bool; 3],
}

/// Why a set gives no calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    Latitude(LatitudeError),
    /// The rows of a position have no scatter and the table is declared perfect: nothing can be weighed.
    NoScatter {
        position: usize,
    },
    /// These parameters do not follow from the positions.
    Undetermined(Undetermined),
    /// This matrix element comes out with a standard deviation beyond what is an answer.
    TooNoisy {
        gyro: usize,
        about: usize,
        sigma: f64,
    },
    /// The data say another latitude.
    LatitudeContradicts {
        declared_deg: f64,
        found_deg: f64,
        sigma_deg: f64,
    },
    /// The closure is not noise. `suspects`: bit k set if the set is consistent without position k. `exchanged`: the set is consistent with the axes
    /// of these two exchanged.
    Closure {
        rms_deg_h: f64,
        p_value: f64,
        suspects: u64,
        exchanged: Option<(usize, usize)>,
    },
    /// A gyro does not follow its axis: swapped or turned round, or the axes of all positions are.
    NotItsAxis {
        gyro: usize,
        about: usize,
        element: f64,
    },
}

/// Names of the axes for messages.
const AXIS_NAMES: [char; 3] = ['x', 'y', 'z'];

/// Name of an axis number.
fn axis_name(axis: usize) -> char {
    AXIS_NAMES.get(axis).copied().unwrap_or('?')
}

impl core::fmt::Display for Undetermined {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mut separator = "";
        if self.bias {
            write!(f, "the biases")?;
            separator = ", ";
        }
        for (name, _) in AXIS_NAMES.iter().zip(self.about).filter(|(_, missing)| *missing) {
            write!(f, "{separator}the responses to rotation about {name}")?;
            separator = ", ";
        }
        Ok(())
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Latitude(error) => write!(f, "{error}"),
            Self::NoScatter { position } => write!(
                f,
                "the rows of position {} have no scatter at all, and the table is declared perfect: give table_arcsec",
                position + 1
            ),
            Self::Undetermined(parameters) => write!(
                f,
                "the positions do not determine {parameters}: every axis must feel different rates, and the same rate with \
                 both signs"
            ),
            Self::TooNoisy { gyro, about, sigma } => write!(
                f,
                "the response of gyro {} to rotation about {} is known to ± {sigma:.2} only (allowed is {MOST_SIGMA}): \
                 measure longer, or where the Earth's rotation has a larger part along that axis",
                axis_name(*gyro),
                axis_name(*about)
            ),
            Self::LatitudeContradicts { declared_deg, found_deg, sigma_deg } => write!(
                f,
                "latitude_deg = {declared_deg} contradicts the data: they say {found_deg:.3} ± {sigma_deg:.3}"
            ),
            Self::Closure { rms_deg_h, p_value, suspects, exchanged } => {
                // Beyond what a double holds it is 0.
                let (below, p_value) = if *p_value > 0.0 { ("", *p_value) } else { ("less than ", f64::MIN_POSITIVE) };
                write!(
                    f,
                    "the closure is not noise: {rms_deg_h:.5} deg/h rms has a probability of {below}{p_value:.1e} (at least \
                     {LEAST_CLOSURE_P} is needed)"
                )?;
                if let Some((one, other)) = exchanged {
                    write!(f, "; with the axes of positions {} and {} exchanged all agree", one + 1, other + 1)?;
                }
                let mut separator = "; without one of these positions the others agree: ";
                for position in (0..64).filter(|position| suspects >> position & 1 == 1) {
                    write!(f, "{separator}{}", position + 1)?;
                    separator = ", ";
                }
                Ok(())
            }
            Self::NotItsAxis { gyro, about, element } => write!(
                f,
                "the response of gyro {} to rotation about {} is {element:.3}: columns or axes are exchanged or turned round",
                axis_name(*gyro),
                axis_name(*about)
            ),
        }
    }
}
