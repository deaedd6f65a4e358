//! The residual: every sample's rate less the Earth's, the run's own azimuth and bias; and how columns look beside these.

use std::f64::consts::TAU;

use north_finder::units::{RAD_PER_DEG, wrap_180_deg};

use super::candidate::Columns;
use super::statistics::{dot, least_squares, median, orthonormalise, subtract};
use crate::run_data::{RunData, Sample};

/// One sigma of the amplitude about Ω cos φ, relative, where a surveyed heading ties the rates down.
pub const AMPLITUDE_SIGMA: f64 = 0.002;
/// One sigma of a surveyed heading that says none, and of the index on top of it, degrees.
const REFERENCE_SIGMA_DEG: f64 = 0.005;
const INDEX_SIGMA_DEG: f64 = 0.01;
/// Fewest samples of a run that is learned from.
const LEAST_CELLS: usize = 4;

/// One run in the regression: its own unknowns are h cos ψ, h sin ψ, bias and, if there is one, the parts of a sinusoid.
pub struct Block<'a> {
    pub run: &'a RunData,
    /// Noise of a one-second rate, °/h.
    pub noise_deg_h: f64,
    /// Square root of the weight of each sample; 0 where it does not enter.
    pub root_weight: Vec<f64>,
    /// Weighted rates, and two rows of the surveyed heading.
    pub y: Vec<f64>,
    basis: Vec<Vec<f64>>,
    /// The same without the surveyed heading.
    free_basis: Vec<Vec<f64>>,
    nuisance: Vec<Vec<f64>>,
    /// Azimuth that the columns are built with, degrees.
    pub azimuth_deg: f64,
    /// Whether its reference enters.
    pub tied: bool,
    /// Rate by the fit without effects, °/h.
    pub smooth_deg_h: Vec<f64>,
    /// Period of a sinusoid whose phase is the run's own, seconds.
    sinusoid_period_s: Option<f64>,
    reference_deg: Option<f64>,
}

impl<'a> Block<'a> {
    /// `None` where the run has too little in it. The reference enters if `trusted`. A sinusoid of the period `sinusoid_period_s` has a phase
    /// and an amplitude of the run's own.
    pub fn new(run: &'a RunData, trusted: bool, sinusoid_period_s: Option<f64>) -> Option<Self> {
        let noise_deg_h = run.noise_deg_h.or_else(|| noise_deg_h(run))?;
        let root_weight: Vec<f64> = run
            .samples
            .iter()
            .map(|sample| if run.enters(sample) { sample.seconds.sqrt() / noise_deg_h } else { 0.0 })
            .collect();
        if root_weight.iter().filter(|weight| **weight > 0.0).count() < LEAST_CELLS {
            return None;
        }
        let reference_deg = run.reference_deg.filter(|_| trusted);
        let mut block = Self {
            run,
            noise_deg_h,
            root_weight,
            y: Vec::new(),
            basis: Vec::new(),
            free_basis: Vec::new(),
            nuisance: Vec::new(),
            azimuth_deg: 0.0,
            tied: reference_deg.is_some(),
            smooth_deg_h: Vec::new(),
            sinusoid_period_s,
            reference_deg,
        };
        let none = vec![0.0; run.samples.len()];
        block.solve(&none)?;
        Some(block)
    }

    /// Looks at the run anew, about these effects (°/h, one value a sample): its rate and its azimuth are then those
    /// without them.
    pub fn linearise(&mut self, effects_deg_h: &[f64]) {
        // It could be solved before; other effects change no column of it.
        let _ = self.solve(effects_deg_h);
    }

    fn solve(&mut self, effects_deg_h: &[f64]) -> Option<()> {
        let (run, reference_deg) = (self.run, self.reference_deg);
        let north = run.earth.north_deg_h;
        let plain = nuisance_columns(run, self.sinusoid_period_s);
        let mut nuisance = plain.clone();
        self.y = run
            .samples
            .iter()
            .zip(&self.root_weight)
            .map(|(sample, w)| w * (sample.rate_deg_h - sample.design.vertical_deg_h))
            .collect();
        for column in &mut nuisance {
            column.iter_mut().zip(&self.root_weight).for_each(|(value, weight)| *value *= weight);
        }
        if let Some(reference_deg) = reference_deg {
            let sigma_deg = run.reference_sigma_deg.max(REFERENCE_SIGMA_DEG).hypot(INDEX_SIGMA_DEG);
            let (sin, cos) = (reference_deg * RAD_PER_DEG).sin_cos();
            let across = 1.0 / (north * sigma_deg * RAD_PER_DEG);
            let along = 1.0 / (north * AMPLITUDE_SIGMA);
            nuisance[0].extend([-sin * across, cos * along]);
            nuisance[1].extend([cos * across, sin * along]);
            nuisance[2..].iter_mut().for_each(|column| column.extend([0.0, 0.0]));
            self.y.extend([0.0, north * along]);
        } else {
            nuisance.iter_mut().for_each(|column| column.extend([0.0, 0.0]));
            self.y.extend([0.0, 0.0]);
        }
        let columns: Vec<&[f64]> = nuisance.iter().map(Vec::as_slice).collect();
        let weighted = effects_deg_h.iter().zip(&self.root_weight).map(|(effect, weight)| effect * weight);
        let rest: Vec<f64> = self.y.iter().zip(weighted.chain([0.0, 0.0])).map(|(y, effect)| y - effect).collect();
        let (found, _) = least_squares(&columns, &rest)?;
        self.azimuth_deg = reference_deg.unwrap_or_else(|| found[1].atan2(found[0]) / RAD_PER_DEG);
        self.basis = orthonormalise(&[], nuisance.clone());
        let mut free = nuisance.clone();
        let samples = run.samples.len();
        free.iter_mut().flat_map(|column| &mut column[samples..]).for_each(|value| *value = 0.0);
        self.free_basis = orthonormalise(&[], free);
        self.smooth_deg_h =
            (0..run.samples.len()).map(|i| found.iter().zip(&plain).map(|(c, column)| c * column[i]).sum()).collect();
        self.nuisance = nuisance;
        Some(())
    }

    /// Number of the run's own unknowns that the rates alone must tell.
    pub fn own_unknowns(&self) -> f64 {
        (self.nuisance.len() - if self.tied { 2 } else { 0 }) as f64
    }

    /// Weighted columns with the rows of the surveyed heading (on which effects have no part).
    pub fn weighted(&self, columns: &Columns) -> Columns {
        columns
            .iter()
            .map(|column| column.iter().zip(&self.root_weight).map(|(value, w)| value * w).chain([0.0, 0.0]).collect())
            .collect()
    }

    /// What the run's own azimuth and bias cannot imitate.
    pub fn project(&self, column: &[f64]) -> Vec<f64> {
        beside(&self.basis, column)
    }

    /// The same if no heading had been surveyed.
    pub fn project_free(&self, column: &[f64]) -> Vec<f64> {
        beside(&self.free_basis, column)
    }

    /// The azimuth that the rates alone give after effects (weighted, in the layout of `y`) are taken out: error against
    /// the reference and sigma, degrees.
    pub fn azimuth_error_deg(&self, effects: &[f64]) -> Option<(f64, f64)> {
        let samples = self.run.samples.len();
        let y: Vec<f64> = self.y.iter().zip(effects).map(|(y, effect)| y - effect).take(samples).collect();
        let columns: Vec<&[f64]> = self.nuisance.iter().map(|column| &column[..samples]).collect();
        let (found, covariance) = least_squares(&columns, &y)?;
        let (x, y) = (found[0], found[1]);
        let squared = x * x + y * y;
        let gradient = [-y / squared, x / squared];
        let mut variance = 0.0;
        for (i, a) in gradient.iter().enumerate() {
            for (j, b) in gradient.iter().enumerate() {
                variance += a * b * covariance[i][j];
            }
        }
        let reference_deg = self.run.reference_deg?;
        let own_deg = variance.sqrt() / RAD_PER_DEG;
        let sigma_deg = own_deg.hypot(self.run.reference_sigma_deg.max(REFERENCE_SIGMA_DEG)).hypot(INDEX_SIGMA_DEG);
        Some((wrap_180_deg(y.atan2(x) / RAD_PER_DEG - reference_deg), sigma_deg))
    }
}

/// What is left of a column beside an orthonormal basis.
fn beside(basis: &[Vec<f64>], column: &[f64]) -> Vec<f64> {
    let mut left = column.to_vec();
    for each in basis {
        let along = dot(&left, each);
        subtract(&mut left, along, each);
    }
    left
}

/// Factors of h cos ψ, h sin ψ and the bias, and of the two parts of a sinusoid.
fn nuisance_columns(run: &RunData, sinusoid_period_s: Option<f64>) -> Vec<Vec<f64>> {
    let of = |factor: &dyn Fn(&Sample) -> f64| run.samples.iter().map(factor).collect();
    let mut columns = vec![of(&|sample| sample.design.cos), of(&|sample| sample.design.sin), of(&|_| 1.0)];
    if let Some(sinusoid_period_s) = sinusoid_period_s {
        columns.push(of(&|sample| (TAU * sample.t_s / sinusoid_period_s).cos()));
        columns.push(of(&|sample| (TAU * sample.t_s / sinusoid_period_s).sin()));
    }
    columns
}

/// Noise of a one-second rate from its fast changes: median of the differences of neighbours in a dwell, °/h.
pub fn noise_deg_h(run: &RunData) -> Option<f64> {
    let differences: Vec<f64> = run
        .samples
        .windows(2)
        .filter(|pair| pair[0].dwell == pair[1].dwell && run.enters(&pair[0]) && run.enters(&pair[1]))
        .filter(|pair| !pair[1].moving || run.rotation)
        .map(|pair| {
            let apart = (1.0 / pair[0].seconds + 1.0 / pair[1].seconds).sqrt();
            let turned = run.earth.north_deg_h * (pair[1].cos - pair[0].cos).hypot(pair[1].sin - pair[0].sin);
            // In a rotation the signal itself changes from sample to sample; its share is small for samples of a second.
            ((pair[1].rate_deg_h - pair[0].rate_deg_h).abs() - if run.rotation { turned } else { 0.0 }).abs() / apart
        })
        .collect();
    if differences.len() < 8 {
        return None;
    }
    // The median of |normal| is 0.6745 sigma.
    let spread = super::statistics::rms(&differences);
    let noise = median(differences) / 0.6745;
    // A coarse gyro repeats itself more often than not: then the mean square says more than the median.
    let noise = if noise > 0.0 { noise } else { spread };
    (noise > 0.0).then_some(noise)
}
