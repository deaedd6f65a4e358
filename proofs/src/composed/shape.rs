//! How an effect follows what a dynamics gives.

/// A function of one value, in standard deviations unless it is an angle in degrees, or of two.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    Linear {
        centre: f64,
    },
    /// Of an angle.
    Harmonic {
        order: f64,
        phase_deg: f64,
    },
    /// exp(κ (cos(angle − at) − 1)): smooth, about one angle.
    AboutAngle {
        at_deg: f64,
        concentration: f64,
    },
    /// 1 within this many degrees of an angle.
    Sector {
        at_deg: f64,
        half_width_deg: f64,
    },
    /// exp(−t/τ) of an elapsed time, s.
    Decay {
        tau_s: f64,
    },
    /// (1 + t/τ)^−p of an elapsed time, s.
    SlowDecay {
        tau_s: f64,
        power: f64,
    },
    Polynomial {
        quadratic: f64,
        cubic: f64,
    },
    Bump {
        at: f64,
        width: f64,
    },
    Saturating {
        at: f64,
        width: f64,
    },
    Wave {
        frequency: f64,
        phase: f64,
    },
    Kink {
        at: f64,
    },
    DeadZone {
        at: f64,
        half_width: f64,
    },
    Modulus {
        at: f64,
    },
    Step {
        at: f64,
    },
    /// Sum of Gaussian hills over two values: [height, first, second, width].
    Surface {
        hills: Vec<[f64; 4]>,
    },
}

impl Shape {
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Linear { .. } => "linear",
            Self::Harmonic { .. } => "harmonic",
            Self::AboutAngle { .. }
            | Self::Decay { .. }
            | Self::SlowDecay { .. }
            | Self::Polynomial { .. }
            | Self::Bump { .. }
            | Self::Saturating { .. }
            | Self::Wave { .. } => "smooth",
            Self::Sector { .. } | Self::Kink { .. } | Self::DeadZone { .. } | Self::Modulus { .. } => "sharp",
            Self::Step { .. } => "step",
            Self::Surface { .. } => "surface",
        }
    }

    pub(super) fn value(&self, x: f64, other: f64) -> f64 {
        match *self {
            Self::Linear { centre } => x - centre,
            Self::Harmonic { order, phase_deg } => (order * x - phase_deg).to_radians().cos(),
            Self::AboutAngle { at_deg, concentration } => {
                (concentration * ((x - at_deg).to_radians().cos() - 1.0)).exp()
            }
            Self::Sector { at_deg, half_width_deg } => {
                let apart_deg = (x - at_deg + 180.0).rem_euclid(360.0) - 180.0;
                f64::from(u8::from(apart_deg.abs() < half_width_deg))
            }
            Self::Decay { tau_s } => (-x / tau_s).exp(),
            Self::SlowDecay { tau_s, power } => (1.0 + x / tau_s).powf(-power),
            Self::Polynomial { quadratic, cubic } => x + quadratic * x * x + cubic * x.powi(3),
            Self::Bump { at, width } => (-0.5 * ((x - at) / width).powi(2)).exp(),
            Self::Saturating { at, width } => ((x - at) / width).tanh(),
            Self::Wave { frequency, phase } => (frequency * x + phase).sin(),
            Self::Kink { at } => (x - at).max(0.0),
            Self::DeadZone { at, half_width } => {
                let beyond = (x - at).abs() - half_width;
                beyond.max(0.0) * (x - at).signum()
            }
            Self::Modulus { at } => (x - at).abs(),
            Self::Step { at } => f64::from(u8::from(x > at)),
            Self::Surface { ref hills } => hills
                .iter()
                .map(|&[height, first, second, width]| {
                    height * (-0.5 * ((x - first).powi(2) + (other - second).powi(2)) / (width * width)).exp()
                })
                .sum(),
        }
    }
}
