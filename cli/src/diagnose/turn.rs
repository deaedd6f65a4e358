//! A turn that all references share: the index zero stands elsewhere, or the references were turned.

use learn::{Learned, MOST_INDEX_DEG};
use north_finder::effects::ErrorModel;
use north_finder::effects::effect::{Effect, Port};
use north_finder::fix::DesignRow;
use north_finder::sensing::index::Direction;
use north_finder::units::{sin_cos_deg, wrap_180_deg};

use super::statistics::{median, rms};
use crate::campaign::Role;
use crate::run_data::RunData;

/// Share of it that the runs may differ by.
const APART: f64 = 0.2;
/// Fewest training runs with a reference that tell it.
const LEAST_RUNS: usize = 3;

/// Standard deviation of the median of normal errors over that of their mean, √(π/2).
const OF_A_MEDIAN: f64 = 1.2533;

/// An angle by which the azimuths of all training runs are off, and one sigma of it, degrees.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    pub deg: f64,
    pub sigma_deg: f64,
}

/// The angle by which the azimuths of all training runs are off, if that is more than an effect on the index may be.
pub fn common(runs: &[RunData]) -> Option<Turn> {
    let fit = runs.iter().filter(|run| run.role == Role::Fit);
    let errors: Vec<f64> =
        fit.filter_map(|run| Some(wrap_180_deg(run.before?.azimuth_deg - run.reference_deg?))).collect();
    let first = *errors.first()?;
    let deg = wrap_180_deg(first + median(errors.iter().map(|error| wrap_180_deg(error - first)).collect()));
    let apart: Vec<f64> = errors.iter().map(|error| wrap_180_deg(error - deg)).collect();
    let apart_deg = median(apart.iter().map(|apart| apart.abs()).collect());
    let found = errors.len() >= LEAST_RUNS && deg.abs() > MOST_INDEX_DEG && apart_deg < APART * deg.abs();
    found.then(|| Turn { deg, sigma_deg: OF_A_MEDIAN * rms(&apart) / (errors.len() as f64).sqrt() })
}

impl Turn {
    /// Takes an index that reads too large by it out of a run.
    pub fn take_out(self, run: &mut RunData, base: &ErrorModel) {
        let (s, c) = sin_cos_deg(self.deg);
        for sample in &mut run.samples {
            (sample.cos, sample.sin) = (sample.cos * c + sample.sin * s, sample.sin * c - sample.cos * s);
            sample.design = DesignRow::new(Direction { cos: sample.cos, sin: sample.sin }, sample.level, &run.earth);
        }
        run.turned_deg = Some(self.deg);
        run.before = run.solve(base).map(|(fix, _)| fix);
    }

    /// Puts it into a model.
    pub fn put(self, model: &mut ErrorModel) {
        model.index_error.get_or_insert_default().offset_deg += self.deg;
    }

    /// What it costs as one effect more beside what was learned with it, an angle of which beforehand nothing is known, nats.
    pub fn cost(self, learned: &Learned) -> f64 {
        let form = learn::form_cost(&Effect::new(Port::Index, &[]), learn::signals(&learned.runs));
        form + learn::asked_beside(learned.best.effects()) + (180.0 / self.sigma_deg).ln()
    }
}
