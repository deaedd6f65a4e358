//! How far the model itself may be wrong: what widens the sigma of every azimuth that it is used for.

use heapless::Vec;
use quantities::limits::{Invalid, finite, positive, within};
use serde::{Deserialize, Serialize};

use super::effect::Port;

/// Most coefficients of all terms and weights of all effects together.
pub const MAX_COEFFICIENTS: usize = 96;
/// Most directions in which they are uncertain.
pub const MAX_DIRECTIONS: usize = 6;

/// What is not certain about a model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Doubt {
    /// Added to the sigma of every azimuth (root sum of squares), degrees: what azimuths by this model missed their references
    /// by, beyond their sigmas, on runs that took no part in learning.
    pub azimuth_sigma_deg: f64,
    /// Columns of a factor L of the covariance L Lᵀ of the coefficients of all terms, in the terms' order, and then of the weights of all effects,
    /// in theirs; each as long as there are of both.
    pub directions: Vec<Vec<f32, MAX_COEFFICIENTS>, MAX_DIRECTIONS>,
    pub process: Option<Process>,
}

/// What no channel tells: a random process u(t) of each run's own, which enters where an effect does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Process {
    #[serde(default = "rate")]
    pub port: Port,
    pub kernel: Kernel,
    /// Its standard deviation, °/h; of what decays where it begins to. At another port than the rate: what it makes of a rate as great as the Earth's
    /// ([`Port::per_deg_h`]).
    pub sigma_deg_h: f64,
    /// Its time constant, seconds.
    pub time_s: f64,
}

fn rate() -> Port {
    Port::Rate
}

/// Correlation at a distance of x time constants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// exp(−x).
    Exponential,
    /// (1 + √3 x) exp(−√3 x).
    Matern,
    /// exp(−x²/2).
    SquaredExponential,
    /// exp(−x) cos(2π t/period).
    DampedCosine { period_s: f64 },
    /// What a move leaves behind: A exp(−x), x since the index came to rest, with another A of its own at every rest. At x₁ and x₂ of one rest the
    /// correlation is exp(−x₁ − x₂); there is none between two rests.
    Transient,
    /// What a start leaves behind, by the same law: x since the run began, with another A in every run.
    Start,
}

impl Kernel {
    /// It is what something leaves behind, and not stationary.
    pub fn decays(self) -> bool {
        matches!(self, Self::Transient | Self::Start)
    }
}

/// An interval of a run, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub start_s: f64,
    pub end_s: f64,
    /// Since when there is something that decays in it: since the index came to rest, or the run began. `None` where there is nothing.
    pub since_s: Option<f64>,
}

impl Interval {
    pub fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }
}

impl Process {
    /// Covariance of the process' means over two intervals, (°/h)²; of the rates they are times what the port adds to each. With K″ = k that of a stationary process is
    /// [K(b₂ − a₁) + K(a₂ − b₁) − K(b₁ − a₁) − K(b₂ − a₂)] over the lengths.
    pub fn covariance(&self, a: &Interval, b: &Interval) -> f64 {
        if self.kernel.decays() {
            let left = self.left_deg_h(a) * self.left_deg_h(b);
            return if a.since_s == b.since_s { left } else { 0.0 };
        }
        let power = self.sigma_deg_h * self.sigma_deg_h;
        let lengths = a.length_s() * b.length_s();
        if !(lengths > 0.0) {
            return power;
        }
        let k = |distance_s: f64| self.twice_integrated(distance_s.abs());
        power * (k(b.end_s - a.start_s) + k(a.end_s - b.start_s) - k(b.start_s - a.start_s) - k(b.end_s - a.end_s))
            / lengths
    }

    /// Of one sigma of what decays the mean over an interval, °/h; 0 where there is nothing of it.
    pub fn left_deg_h(&self, interval: &Interval) -> f64 {
        let Some(since_s) = interval.since_s else { return 0.0 };
        let at_start_deg_h = self.sigma_deg_h * libm::exp(-(interval.start_s - since_s) / self.time_s);
        let length = interval.length_s() / self.time_s;
        if length > 0.0 { at_start_deg_h * -libm::expm1(-length) / length } else { at_start_deg_h }
    }

    /// K(x) with K″ the correlation and K′(0) = 0, s².
    fn twice_integrated(&self, x_s: f64) -> f64 {
        let tau_s = self.time_s;
        match self.kernel {
            Kernel::Exponential => tau_s * tau_s * libm::exp(-x_s / tau_s) + tau_s * x_s,
            Kernel::Matern => {
                let a = libm::sqrt(3.0) / tau_s;
                libm::exp(-a * x_s) * (3.0 / a + x_s) / a + 2.0 * x_s / a
            }
            Kernel::SquaredExponential => {
                let x = x_s / (core::f64::consts::SQRT_2 * tau_s);
                tau_s * tau_s * libm::exp(-x * x)
                    + tau_s * x_s * libm::sqrt(core::f64::consts::FRAC_PI_2) * libm::erf(x)
            }
            Kernel::DampedCosine { period_s } => {
                // The real part of e^(−zx)/z² + x/z with z = 1/τ − iω.
                let (re, im) = (1.0 / tau_s, core::f64::consts::TAU / period_s);
                let squared = re * re + im * im;
                let (sin, cos) = libm::sincos(im * x_s);
                let (re2, im2) = (re * re - im * im, 2.0 * re * im);
                (cos * re2 - sin * im2) * libm::exp(-re * x_s) / (squared * squared) + x_s * re / squared
            }
            // They are not stationary.
            Kernel::Transient | Kernel::Start => 0.0,
        }
    }

    fn validate(&self) -> Result<(), Invalid> {
        positive("model.doubt.process.sigma_deg_h", self.sigma_deg_h)?;
        positive("model.doubt.process.time_s", self.time_s)?;
        match self.kernel {
            Kernel::DampedCosine { period_s } => positive("model.doubt.process.kernel.period_s", period_s),
            _ => Ok(()),
        }
    }
}

impl Doubt {
    /// `coefficients` is how many the terms and the effects have.
    pub fn validate(&self, coefficients: usize) -> Result<(), Invalid> {
        within("model.doubt.azimuth_sigma_deg", self.azimuth_sigma_deg, 0.0, 180.0, "0 to 180")?;
        for direction in &self.directions {
            if direction.len() != coefficients {
                let (field, value) = ("model.doubt.directions (numbers of one)", direction.len() as f64);
                return Err(Invalid::new(field, value, "as many as terms and effects have coefficients"));
            }
            direction.iter().try_for_each(|&number| finite("model.doubt.directions", &[number.into()]))?;
        }
        self.process.as_ref().map_or(Ok(()), Process::validate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the definition: the mean of the correlation over both intervals, on a grid of 400 by 400 midpoints, whose error is
    /// below 1e-4 for a kink on the diagonal.
    #[test]
    fn covariances_of_means_by_summing() {
        type Correlation = fn(f64) -> f64;
        let kernels: [(Kernel, Correlation); 4] = [
            (Kernel::Exponential, |x| libm::exp(-x)),
            (Kernel::Matern, |x| (1.0 + libm::sqrt(3.0) * x) * libm::exp(-libm::sqrt(3.0) * x)),
            (Kernel::SquaredExponential, |x| libm::exp(-0.5 * x * x)),
            // Time constant 20 s, period 30 s.
            (Kernel::DampedCosine { period_s: 30.0 }, |x| libm::exp(-x) * libm::cos(core::f64::consts::TAU * x / 1.5)),
        ];
        for (kernel, correlation) in kernels {
            let process = Process { port: Port::Rate, kernel, sigma_deg_h: 0.5, time_s: 20.0 };
            let stretch = |[start_s, end_s]: [f64; 2]| Interval { start_s, end_s, since_s: Some(start_s) };
            for b in [[0.0, 30.0], [38.0, 60.0]] {
                let mut sum = 0.0;
                for i in 0..400 {
                    for j in 0..400 {
                        let s = 30.0 * (f64::from(i) + 0.5) / 400.0;
                        let t = b[0] + (b[1] - b[0]) * (f64::from(j) + 0.5) / 400.0;
                        sum += correlation((t - s).abs() / 20.0);
                    }
                }
                let found = process.covariance(&stretch([0.0, 30.0]), &stretch(b));
                assert!((found - 0.25 * sum / 160_000.0).abs() < 1e-4, "{kernel:?} {b:?} {found}");
            }
        }
    }

    /// Of 2 °/h and 10 s, over the first ten seconds at rest and the next ten: means (1 − e⁻¹) = 0.632121 and e⁻¹ times that, 0.232544; products times 4.
    /// Nothing goes from one rest to the next, and nothing where the index moves.
    #[test]
    fn a_transient_by_hand() {
        let process = Process { port: Port::Rate, kernel: Kernel::Transient, sigma_deg_h: 2.0, time_s: 10.0 };
        let interval = |start_s, since_s| Interval { start_s, end_s: start_s + 10.0, since_s };
        let [first, second] = [100.0, 110.0].map(|start_s| interval(start_s, Some(100.0)));
        assert!((process.covariance(&first, &first) - 4.0 * 0.632121 * 0.632121).abs() < 1e-5);
        assert!((process.covariance(&first, &second) - 4.0 * 0.632121 * 0.232544).abs() < 1e-5);
        assert_eq!(process.covariance(&first, &interval(200.0, Some(200.0))), 0.0);
        assert_eq!(process.covariance(&interval(100.0, None), &interval(100.0, None)), 0.0);
    }

    /// The same since the start of the run, across a move: of the third ten seconds e⁻² = 0.135335 times the mean of the first is left.
    #[test]
    fn what_a_start_leaves_by_hand() {
        let process = Process { port: Port::Rate, kernel: Kernel::Start, sigma_deg_h: 2.0, time_s: 10.0 };
        let interval = |start_s| Interval { start_s, end_s: start_s + 10.0, since_s: Some(100.0) };
        let found = process.covariance(&interval(100.0), &interval(120.0));
        assert!((found - 4.0 * 0.632121 * 0.632121 * 0.135335).abs() < 1e-5, "{found}");
    }
}
