//! What runs that have not been made yet would tell: which of the models that are possible is the true one, and how well
//! azimuths would be known then.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::columns::side_by_side;
use super::evidence::half_of;
use super::learn::{prepare, sizes_deg_h};
use super::least_squares::least_squares;
use super::predict::{Learned, Model};
use super::process::Kernel;
use super::recording::Recording;
use super::run::{Run, Whitening};

/// What a set of runs would tell.
#[derive(Clone, Debug)]
pub struct Expected {
    /// Log odds of each model over each other one that they add on average, if the first of both is the true one.
    pub log_odds: Vec<Vec<f64>>,
    /// Standard deviation of the azimuth of a usual run by the likeliest model, once it has learned from them; radians.
    pub sigma_rad: f64,
}

impl Learned {
    /// What these runs would tell, each at its reference; `usual` is a run whose azimuth is to be known. `None` where one has too
    /// little in it.
    pub fn expected(&self, proposed: &[Recording], usual: &Recording) -> Option<Expected> {
        let first = self.models.first()?;
        let learned: Vec<DMatrix<f64>> = self.models.iter().map(|model| inverse(&model.covariance)).collect();
        let pairs = (0..self.models.len()).flat_map(|one| (0..one).map(move |other| (one, other)));
        let mut rivals: Vec<Rival> = pairs.map(|pair| Rival::new(&learned, pair)).collect();
        let mut information = learned[0].clone();
        for recording in proposed {
            let run = self.run(recording)?;
            let beside = Beside::new(&run, &self.covariance(&run));
            let seen: Vec<DMatrix<f64>> =
                self.models.iter().map(|model| beside.of(&self.columns(&run, model, run.azimuth_rad))).collect();
            information += seen[0].transpose() * &seen[0];
            rivals.iter_mut().for_each(|rival| rival.add(&self.models, &seen));
        }
        let mut log_odds = vec![vec![0.0; self.models.len()]; self.models.len()];
        for rival in &rivals {
            let (one, other) = rival.pair;
            log_odds[one][other] = rival.log_odds();
            log_odds[other][one] = log_odds[one][other];
        }
        let run = self.run(usual)?;
        let columns = self.columns(&run, first, run.azimuth_rad);
        let covariance = self.covariance(&run) + &columns * inverse(&information) * columns.transpose();
        let found = least_squares(&run, &covariance);
        Some(Expected { log_odds, sigma_rad: found.sigma_rad.hypot(self.excess_rad) })
    }

    /// What was learned does in a run, averaged over the models: by the second, °/h; 0 where none enters.
    pub fn effect_deg_h(&self, recording: &Recording) -> Option<Vec<f64>> {
        // The phase of a rhythm is the likeliest beside every process that the run may have.
        let run = self.run_under(recording, &self.kernels, &self.whitenings)?;
        let of_model = |model: &Model| self.effect(&run, model, run.azimuth_rad, None) * model.weight;
        let of_samples = self.models.iter().map(of_model).reduce(|sum, each| sum + each)?;
        Some(run.sheet.samples.by_second(of_samples.as_slice()))
    }

    /// How much the likeliest model does in a run: the root of the sum of its squares, °/h.
    pub fn spread(&self, recording: &Recording) -> f64 {
        let of = |run: &Run, model: &Model| (self.columns(run, model, run.azimuth_rad) * &model.mean).norm();
        self.run(recording).zip(self.models.first()).map_or(0.0, |(run, model)| of(&run, model))
    }

    /// The run in the engine's algebra, under white noise alone.
    fn run<'a>(&self, recording: &'a Recording) -> Option<Run<'a>> {
        self.run_under(recording, &self.kernels[..1], &[])
    }

    /// The same under some kernels; `known` are whitenings that were made before.
    fn run_under<'a>(&self, recording: &'a Recording, kernels: &[Kernel], known: &[Arc<Whitening>]) -> Option<Run<'a>> {
        let (prepared, _) = prepare(&[recording], kernels, Some(self.unit_deg_h), known);
        let (sheet, whitening) = prepared.into_iter().next()??;
        Some(Run::new(sheet, recording.reference, whitening, &sizes_deg_h(kernels, self.unit_deg_h)))
    }

    /// White noise and the processes that a run may have, by their shares.
    fn covariance(&self, run: &Run) -> DMatrix<f64> {
        let mut covariance = run.whitening.white();
        for (kernel, share) in self.kernels.iter().zip(&self.shares).filter(|(_, share)| **share > LEAST_SHARE) {
            if let Some(shape) = kernel.shape {
                let variance = share * (kernel.size * self.unit_deg_h).powi(2);
                covariance += shape.covariance(kernel.time_s, &run.sheet.samples.spans) * variance;
            }
        }
        covariance
    }
}

/// Kernels below this share do not count.
const LEAST_SHARE: f64 = 0.02;

/// What tells two models apart over some runs together. Neither knows its weights exactly, and a weight is the same in all runs: what
/// other weights within their covariance would explain in all of them tells nothing.
struct Rival {
    /// Their places among all models.
    pair: (usize, usize),
    /// Information about the weights of both, from what was learned and from the runs.
    information: DMatrix<f64>,
    /// Their columns times the difference of what the models say, and the sum of its squares, in noise variances.
    pull: DVector<f64>,
    distance: f64,
}

impl Rival {
    /// `learned` is what is known of the weights of every model.
    fn new(learned: &[DMatrix<f64>], pair: (usize, usize)) -> Self {
        let (one, other) = (&learned[pair.0], &learned[pair.1]);
        let (m, n) = (one.nrows(), other.nrows());
        let mut information = DMatrix::zeros(m + n, m + n);
        information.view_mut((0, 0), (m, m)).copy_from(one);
        information.view_mut((m, m), (n, n)).copy_from(other);
        Self { pair, information, pull: DVector::zeros(m + n), distance: 0.0 }
    }

    /// A run more: the columns of all models in it, as white noise sees them.
    fn add(&mut self, models: &[Model], seen: &[DMatrix<f64>]) {
        let (one, other) = (&seen[self.pair.0], &seen[self.pair.1]);
        let apart = one * &models[self.pair.0].mean - other * &models[self.pair.1].mean;
        let both = side_by_side(one.nrows(), [one, other]);
        self.information += both.transpose() * &both;
        self.pull += both.transpose() * &apart;
        self.distance += apart.norm_squared();
    }

    /// Log odds of one over the other that the runs add on average, if it is the true one.
    fn log_odds(&self) -> f64 {
        let explained = (half_of(&self.information).0 * &self.pull).norm_squared();
        0.5 * (self.distance - explained).max(0.0)
    }
}

/// Whitening, and projection beside a run's own unknowns and its surveyed heading.
struct Beside {
    half: DMatrix<f64>,
    q: DMatrix<f64>,
}

impl Beside {
    fn new(run: &Run, covariance: &DMatrix<f64>) -> Self {
        let (half, _) = half_of(covariance);
        let (n, ties) = (half.nrows(), run.ties(true));
        let mut design = DMatrix::zeros(n + ties.len(), 3);
        design.rows_mut(0, n).copy_from(&(&half * &run.design));
        ties.iter().enumerate().for_each(|(i, tie)| design.row_mut(n + i).copy_from(&tie.row.transpose()));
        Self { half, q: design.qr().q() }
    }

    fn of(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let whitened = &self.half * columns;
        let mut all = DMatrix::zeros(self.q.nrows(), columns.ncols());
        all.rows_mut(0, whitened.nrows()).copy_from(&whitened);
        &all - &self.q * (self.q.transpose() * &all)
    }
}

/// Inverse of a covariance, or of an information.
fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let (half, _) = half_of(matrix);
    half.transpose() * half
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two models with one weight each, of variance 1, that act in different seconds; the first says 2, the other nothing. By hand: one run
    /// has a distance of 4, of which weights within their variance explain 2² / (1 + 1); of two runs it is 8, and 4² / (1 + 2).
    #[test]
    fn the_same_weights_in_all_runs() {
        let model = |mean: f64| Model {
            weight: 0.5,
            groups: Vec::new(),
            mean: DVector::from_element(1, mean),
            covariance: DMatrix::identity(1, 1),
            factor: DMatrix::identity(1, 1),
        };
        let models = [model(2.0), model(0.0)];
        let seen = [DMatrix::from_column_slice(2, 1, &[1.0, 0.0]), DMatrix::from_column_slice(2, 1, &[0.0, 1.0])];
        let mut rival = Rival::new(&[DMatrix::identity(1, 1), DMatrix::identity(1, 1)], (0, 1));
        rival.add(&models, &seen);
        assert!((rival.log_odds() - 1.0).abs() < 1e-12, "{}", rival.log_odds());
        rival.add(&models, &seen);
        assert!((rival.log_odds() - 0.5 * (8.0 - 16.0 / 3.0)).abs() < 1e-12, "{}", rival.log_odds());
    }
}
