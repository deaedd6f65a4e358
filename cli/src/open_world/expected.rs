//! What runs that have not been made yet would tell: which of the models that are possible is the true one, and how well
//! azimuths would be known then.

use std::sync::Arc;

use nalgebra::DMatrix;

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
    /// Log odds of the likeliest model over every other one that they add on average, if it is the true one.
    pub log_odds: Vec<f64>,
    /// Standard deviation of the azimuth of a usual run by the likeliest model, once it has learned from them; radians.
    pub sigma_rad: f64,
}

impl Learned {
    /// What these runs would tell, each at its reference; `usual` is a run whose azimuth is to be known. `None` where one has too
    /// little in it.
    pub fn expected(&self, proposed: &[Recording], usual: &Recording) -> Option<Expected> {
        let (first, others) = self.models.split_first()?;
        let mut log_odds = vec![0.0; others.len()];
        let mut information = inverse(&first.covariance);
        for recording in proposed {
            let run = self.run(recording)?;
            let columns = self.columns(&run, first, run.azimuth_rad);
            let plain = self.covariance(&run);
            let beside = Beside::new(&run, &plain);
            let seen = beside.of(&columns);
            information += seen.transpose() * seen;
            for (odds, other) in log_odds.iter_mut().zip(others) {
                let of_other = self.columns(&run, other, run.azimuth_rad);
                let apart = &columns * &first.mean - &of_other * &other.mean;
                // Neither model knows its weights exactly.
                let unsure = &plain + spread(&columns, first) + spread(&of_other, other);
                *odds += 0.5 * Beside::new(&run, &unsure).of(&DMatrix::from_columns(&[apart])).norm_squared();
            }
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

/// Covariance of what a model says at a run, from that of its weights.
fn spread(columns: &DMatrix<f64>, model: &Model) -> DMatrix<f64> {
    columns * &model.covariance * columns.transpose()
}

/// Inverse of a covariance, or of an information.
fn inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let (half, _) = half_of(matrix);
    half.transpose() * half
}
