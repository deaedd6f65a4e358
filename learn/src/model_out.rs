//! What was learned as a model that the firmware runs: effects, the directions in which their weights are uncertain, the process of the runs' own.

use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen, Vector3};
use north_finder::effects::ErrorModel;
use north_finder::effects::doubt::MAX_DIRECTIONS;
use north_finder::effects::effect::{Effect, Port};
use north_finder::units::DEG_PER_RAD;

use super::posterior::Posterior;
use super::rows::Run;

impl Posterior {
    /// The model over `base`. The covariance of the weights is kept in the directions that turn the azimuths of the runs most; what the others
    /// turn them by, root mean square, widens sigma as a whole. The model's bias makes up for what the effects add on the mean: a fix has a bias of its own and
    /// knows no other azimuth by it, but the gates of a board look at rates.
    ///
    /// `None`: base and effects together are more than a model can hold.
    pub fn written(&self, base: &ErrorModel, runs: &[Run]) -> Option<ErrorModel> {
        let mut model = base.clone();
        for effect in &self.effects {
            model.effects.push(effect.clone()).ok()?;
        }
        model.bias_deg_h -= self.mean_deg_h(runs);
        let own: usize = self.effects.iter().map(Effect::count).sum();
        let of_base: usize = base.terms.iter().map(|term| term.coefficients.len()).sum::<usize>()
            + base.effects.iter().map(Effect::count).sum::<usize>();
        for direction in &mut model.doubt.directions {
            direction.resize(of_base + own, 0.0).ok()?;
        }
        let room = MAX_DIRECTIONS - model.doubt.directions.len();
        let (directions, left_rad2) = self.directions(runs, room);
        for direction in directions {
            let mut numbers = heapless::Vec::new();
            numbers.resize(of_base, 0.0).ok()?;
            numbers.extend_from_slice(&direction.iter().map(|number| *number as f32).collect::<Vec<f32>>()).ok()?;
            model.doubt.directions.push(numbers).ok()?;
        }
        model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(left_rad2.max(0.0).sqrt() * DEG_PER_RAD);
        model.doubt.process = self.process.or(model.doubt.process);
        model.validate().is_ok().then_some(model)
    }

    /// What the effects that do not depend on the azimuth add to the rate on the mean of the rows, °/h.
    fn mean_deg_h(&self, runs: &[Run]) -> f64 {
        let adding = || self.effects.iter().filter(|effect| effect.port == Port::Rate && !effect.needs_azimuth());
        let added = |run: &Run| -> f64 { adding().flat_map(|effect| run.added_by(effect)).sum() };
        let rows: usize = runs.iter().map(Run::rows).sum();
        runs.iter().map(added).sum::<f64>() / rows.max(1) as f64
    }

    /// Columns of a factor of the covariance, those that turn the azimuths most, and the mean square of what the others turn them by, rad².
    fn directions(&self, runs: &[Run], most: usize) -> (Vec<DVector<f64>>, f64) {
        let count = self.covariance.nrows();
        if count == 0 {
            return (Vec::new(), 0.0);
        }
        let turns: Vec<DVector<f64>> = runs.iter().filter_map(|run| self.turns_rad(run)).collect();
        let mut square = DMatrix::zeros(count, count);
        for turn in &turns {
            square += turn * turn.transpose() / turns.len() as f64;
        }
        // With C = R Rᵀ the azimuths turn by Rᵀ M R; its principal directions turn them independently of each other.
        let eigen = SymmetricEigen::new(self.covariance.clone());
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let root = &eigen.eigenvectors * DMatrix::from_diagonal(&roots);
        let turned = SymmetricEigen::new(root.tr_mul(&square) * &root);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| turned.eigenvalues[b].total_cmp(&turned.eigenvalues[a]));
        let kept = order.len().min(most);
        let directions = order[..kept].iter().map(|&i| &root * turned.eigenvectors.column(i)).collect();
        (directions, order[kept..].iter().map(|&i| turned.eigenvalues[i].max(0.0)).sum())
    }

    /// What a unit of every weight turns the azimuth of a run by, rad, where its amplitude and bias are free: least squares with white noise and the
    /// process. `None` where the run does not determine them.
    fn turns_rad(&self, run: &Run) -> Option<DVector<f64>> {
        let whitener = run.whitener(self.process.as_ref());
        let mut unknowns = run.unknowns_by_unit();
        unknowns.iter_mut().for_each(|column| whitener.apply(column));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let inverse = Matrix3::from_fn(|i, j| dot(&unknowns[i], &unknowns[j])).try_inverse()?;
        let mut turns = Vec::new();
        for effect in &self.effects {
            for mut column in run.columns_of(effect) {
                whitener.apply(&mut column);
                let right = Vector3::from_fn(|i, _| dot(&unknowns[i], &column));
                turns.push((inverse * right).x);
            }
        }
        Some(DVector::from_vec(turns))
    }
}
