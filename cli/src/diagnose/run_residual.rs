//! What is left of one run: every sample's rate less the Earth's, the run's own azimuth and bias.

use super::statistics::{dot, median, orthonormalise, rms, subtract};
use crate::run_data::{RunData, Sample};

/// Fewest samples of a run that says anything.
const LEAST_CELLS: usize = 4;
/// Unknowns of every run: h cos ψ, h sin ψ and bias.
pub const OWN_UNKNOWNS: f64 = 3.0;

/// One run with its own unknowns.
pub struct RunResidual<'a> {
    pub run: &'a RunData,
    /// Noise of a one-second rate, °/h.
    pub noise_deg_h: f64,
    /// Square root of the weight of each sample; 0 where it does not enter.
    pub root_weight: Vec<f64>,
    /// Weighted rates.
    pub y: Vec<f64>,
    basis: Vec<Vec<f64>>,
}

impl<'a> RunResidual<'a> {
    /// `None` where the run has too little in it.
    pub fn new(run: &'a RunData) -> Option<Self> {
        let noise_deg_h = run.noise_deg_h.or_else(|| noise_deg_h(run))?;
        let weight = |sample: &Sample| if run.enters(sample) { sample.seconds.sqrt() / noise_deg_h } else { 0.0 };
        let root_weight: Vec<f64> = run.samples.iter().map(weight).collect();
        if root_weight.iter().filter(|weight| **weight > 0.0).count() < LEAST_CELLS {
            return None;
        }
        let weighted = |value: &dyn Fn(&Sample) -> f64| -> Vec<f64> {
            run.samples.iter().zip(&root_weight).map(|(sample, weight)| weight * value(sample)).collect()
        };
        let y = weighted(&|sample| sample.rate_deg_h - sample.design.vertical_deg_h);
        let unknowns =
            vec![weighted(&|sample| sample.design.cos), weighted(&|sample| sample.design.sin), weighted(&|_| 1.0)];
        let basis = orthonormalise(&[], unknowns);
        Some(Self { run, noise_deg_h, root_weight, y, basis })
    }

    /// A weighted column.
    pub fn weighted(&self, column: &[f64]) -> Vec<f64> {
        column.iter().zip(&self.root_weight).map(|(value, weight)| value * weight).collect()
    }

    /// What the run's own azimuth and bias cannot imitate.
    pub fn project(&self, column: &[f64]) -> Vec<f64> {
        let mut left = column.to_vec();
        for each in &self.basis {
            let along = dot(&left, each);
            subtract(&mut left, along, each);
        }
        left
    }
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
    let spread = rms(&differences);
    let noise = median(differences) / 0.6745;
    // A coarse gyro repeats itself more often than not: then the mean square says more than the median.
    let noise = if noise > 0.0 { noise } else { spread };
    (noise > 0.0).then_some(noise)
}
