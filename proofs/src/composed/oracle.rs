//! An oracle: it knows the form of what is hidden with all constants in it, and the statistics of what goes on in a run
//! of its own accord. It reads the recordings, and fits the weights.
//!
//! Unknowns of a run are azimuth, amplitude and bias, and pitch and roll where a level sensor errs; the weights are
//! common. The fit runs together give the weights (Gauss-Newton, generalised least squares, surveyed azimuths as
//! data); they are a prior in each check run. Nothing here is the product's: not the fix, not its least squares.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::effect::{Effect, Port};
use super::plain;
use super::plan::{EARTH_DEG_H, Plan};
use super::record::{Row, true_view};
use super::signal::{View, up};

/// Values of a run at most: beyond, seconds are averaged where a covariance stands between them.
const MOST_VALUES: usize = 300;
const ITERATIONS: usize = 6;
/// What a weight may be before anything is known, in what no instrument has.
const WIDE: f64 = 10.0;
/// Steps of the differences: degrees of azimuth, and radians of tilt.
const STEP_DEG: f64 = 1e-3;
const STEP_RAD: f64 = 1e-5;

/// Azimuth and sigma of a run, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reported {
    pub azimuth_deg: f64,
    pub sigma_deg: f64,
}

/// Azimuths of the check runs (`None` for fit runs), and the weights; `None` where the equations cannot be solved.
pub(super) fn consult(
    plan: &Plan,
    effects: &[Effect],
    spreads: &[[f64; 2]],
    rows: &[Vec<Row>],
) -> Option<(Vec<Option<Reported>>, Vec<f64>)> {
    let oracle = Oracle { plan, effects, spreads };
    let runs: Vec<Recording<'_>> =
        (0..rows.len()).map(|run| Recording::new(&oracle, run, &rows[run])).collect::<Option<_>>()?;
    let known: Vec<usize> = (0..effects.len()).filter(|&effect| effects[effect].process.is_none()).collect();
    let prior = DMatrix::from_diagonal(&DVector::from_iterator(
        known.len(),
        known.iter().map(|&effect| (WIDE * effects[effect].port.most()).powi(-2)),
    ));
    let mut weights = DVector::zeros(known.len());
    let mut locals: Vec<DVector<f64>> = runs.iter().map(|run| run.start.clone()).collect();
    let mut information = prior.clone();
    for _ in 0..ITERATIONS {
        information = prior.clone();
        let mut right = -&prior * &weights;
        let mut pending = Vec::new();
        for (place, run) in runs.iter().enumerate().filter(|(_, run)| plan.runs[run.number].is_fit) {
            let equations = run.equations(&oracle, &locals[place], &weights)?;
            let gain = &equations.across * equations.local.clone().try_inverse()?;
            information += &equations.common - &gain * equations.across.transpose();
            right += &equations.right_common - &gain * &equations.right_local;
            pending.push((place, equations));
        }
        let step = information.clone().cholesky()?.solve(&right);
        for (place, equations) in pending {
            let right = &equations.right_local - equations.across.transpose() * &step;
            locals[place] += equations.local.cholesky()?.solve(&right);
        }
        weights += step;
    }
    let told = |run: &Recording<'_>| match plan.runs[run.number].is_fit {
        true => Some(None),
        false => run.told(&oracle, &weights, &information).map(Some),
    };
    Some((runs.iter().map(told).collect::<Option<_>>()?, weights.iter().copied().collect()))
}

struct Oracle<'a> {
    plan: &'a Plan,
    effects: &'a [Effect],
    spreads: &'a [[f64; 2]],
}

/// Normal equations of a run: of the weights, of its own unknowns, and between them.
struct Equations {
    common: DMatrix<f64>,
    across: DMatrix<f64>,
    local: DMatrix<f64>,
    right_common: DVector<f64>,
    right_local: DVector<f64>,
}

/// A run as it is recorded.
struct Recording<'a> {
    number: usize,
    view: View<'a>,
    index_deg: Vec<f64>,
    channels: Vec<Vec<f64>>,
    /// Resting seconds, in blocks that are averaged.
    blocks: Vec<Vec<usize>>,
    /// Rates, then forward and left levels in radians, if a level sensor errs.
    observed: DVector<f64>,
    /// Inverse standard deviation of each value; of rates only where no covariance stands between them.
    precision: DVector<f64>,
    /// Cholesky factor of the covariance of the rates.
    covariance: Option<Cholesky<f64, nalgebra::Dyn>>,
    start: DVector<f64>,
}

impl<'a> Recording<'a> {
    fn new(oracle: &Oracle<'a>, number: usize, rows: &[Row]) -> Option<Self> {
        let plan = oracle.plan;
        let run = &plan.runs[number];
        let has_process = oracle.effects.iter().any(|effect| effect.process.is_some());
        let has_tilt = oracle.effects.iter().any(|effect| matches!(effect.port, Port::Tilts { .. }));
        let blocks = blocks(&run.rests, has_process);
        let mean = |block: &Vec<usize>, of: &dyn Fn(&Row) -> f64| {
            block.iter().map(|&second| of(&rows[second])).sum::<f64>() / block.len() as f64
        };
        let mut observed: Vec<f64> = blocks.iter().map(|block| mean(block, &|row| row.fog_arcsec)).collect();
        let root = |block: &Vec<usize>| (block.len() as f64).sqrt();
        let mut precision: Vec<f64> =
            blocks.iter().map(|block| root(block) / (60.0 * plan.arw_deg_per_sqrt_h)).collect();
        let everything: Vec<usize> = (0..rows.len()).collect();
        let level = [0, 1].map(|axis| mean(&everything, &|row| row.level_g[axis]));
        let tilt_rad = [level[0].asin(), (level[1] / level[0].asin().cos()).asin()];
        if has_tilt {
            for axis in 0..2 {
                observed.extend(blocks.iter().map(|block| mean(block, &|row| row.level_g[axis])));
                precision.extend(blocks.iter().map(|block| root(block) / plan.level_noise_g.unwrap_or(1.0)));
            }
        }
        let plain_deg = plain::azimuth_deg(plan, number, rows);
        let azimuth_deg =
            run.reference_deg.filter(|_| run.is_fit).map_or(plain_deg, |(reference_deg, _)| reference_deg);
        let bias_deg_h = observed[..blocks.len()].iter().sum::<f64>() / blocks.len() as f64;
        let north_deg_h = EARTH_DEG_H * plan.latitude_deg.to_radians().cos();
        let mut start = vec![azimuth_deg, north_deg_h, bias_deg_h];
        if has_tilt {
            start.extend(tilt_rad);
        }
        let mut recording = Self {
            number,
            view: View { tilt_rad, azimuth_deg, ..true_view(plan, number) },
            index_deg: rows.iter().map(|row| row.index_deg).collect(),
            channels: (0..plan.channels.len())
                .map(|channel| rows.iter().map(|row| row.channels[channel]).collect())
                .collect(),
            blocks,
            observed: DVector::from_vec(observed),
            precision: DVector::from_vec(precision),
            covariance: None,
            start: DVector::from_vec(start),
        };
        if has_process {
            recording.covariance = Some(recording.covariance(oracle)?);
        }
        Some(recording)
    }

    /// The run as it is recorded, at this azimuth and tilt.
    fn seen<'b>(&'b self, local: &DVector<f64>) -> View<'b>
    where
        'a: 'b,
    {
        View {
            azimuth_deg: local[0],
            tilt_rad: self.tilt(local),
            index_deg: &self.index_deg,
            channels: self.channels.iter().map(Vec::as_slice).collect(),
            ..self.view.clone()
        }
    }

    fn tilt(&self, local: &DVector<f64>) -> [f64; 2] {
        if local.len() > 3 { [local[3], local[4]] } else { self.view.tilt_rad }
    }

    /// The rate at an index angle that reads too large by `turned_deg`, without bias, °/h; horizontal part of a free size.
    fn rate(&self, local: &DVector<f64>, second: usize, turned_deg: f64) -> f64 {
        let axis_deg = self.index_deg[second] - turned_deg;
        let up_deg_h = EARTH_DEG_H * self.view.latitude_deg.to_radians().sin();
        local[1] * (local[0] - axis_deg).to_radians().cos() + up_deg_h * up(self.tilt(local), axis_deg)
    }

    /// What the values would be.
    fn predict(
        &self,
        oracle: &Oracle<'_>,
        local: &DVector<f64>,
        courses: &[Vec<f64>],
        weights: &DVector<f64>,
    ) -> DVector<f64> {
        let known = oracle.effects.iter().filter(|effect| effect.process.is_none());
        let ports: Vec<Port> = known.map(|effect| effect.port).collect();
        let sum = |port: Port, second: usize| -> f64 {
            (0..ports.len()).filter(|&at| ports[at] == port).map(|at| weights[at] * courses[at][second]).sum()
        };
        let rate = |second: usize| {
            self.rate(local, second, sum(Port::Turns, second)) * (1.0 + sum(Port::Scales, second))
                + local[2]
                + sum(Port::Adds, second)
        };
        let mean = |block: &Vec<usize>, of: &dyn Fn(usize) -> f64| {
            block.iter().map(|&second| of(second)).sum::<f64>() / block.len() as f64
        };
        let mut values: Vec<f64> = self.blocks.iter().map(|block| mean(block, &rate)).collect();
        if local.len() > 3 {
            let level = [local[3].sin(), local[4].sin() * local[3].cos()];
            for (level, forward) in level.into_iter().zip([true, false]) {
                let of = |second: usize| level + sum(Port::Tilts { forward }, second).to_radians();
                values.extend(self.blocks.iter().map(|block| mean(block, &of)));
            }
        }
        DVector::from_vec(values)
    }

    fn courses(&self, oracle: &Oracle<'_>, local: &DVector<f64>) -> Vec<Vec<f64>> {
        let known = oracle.effects.iter().filter(|effect| effect.process.is_none());
        let seen = self.seen(local);
        known.map(|effect| effect.course(oracle.plan, self.number, &seen, oracle.spreads)).collect()
    }

    /// White noise and the processes, each with its size and what it is multiplied with.
    fn covariance(&self, oracle: &Oracle<'_>) -> Option<Cholesky<f64, nalgebra::Dyn>> {
        let count = self.blocks.len();
        let mut covariance = DMatrix::from_diagonal(&self.precision.rows(0, count).map(|precision| precision.powi(-2)));
        let seen = self.seen(&self.start);
        let length_s = self.index_deg.len() as f64;
        for effect in oracle.effects {
            let Some(process) = effect.process else { continue };
            let course = effect.course(oracle.plan, self.number, &seen, oracle.spreads);
            let size = |second: usize| {
                let port = match effect.port {
                    Port::Adds => 1.0,
                    Port::Scales => self.rate(&self.start, second, 0.0),
                    // One degree more.
                    Port::Turns => self.rate(&self.start, second, 1.0) - self.rate(&self.start, second, 0.0),
                    Port::Tilts { .. } => 0.0,
                };
                effect.weight * port * course[second]
            };
            let of_block = |block: &Vec<usize>| {
                let count = block.len() as f64;
                let middle_s = block.iter().map(|&second| second as f64 + 0.5).sum::<f64>() / count;
                (middle_s, block.iter().map(|&second| size(second)).sum::<f64>() / count)
            };
            let places: Vec<(f64, f64)> = self.blocks.iter().map(of_block).collect();
            for (i, &(first_s, first)) in places.iter().enumerate() {
                for (j, &(other_s, other)) in places.iter().enumerate() {
                    covariance[(i, j)] += first * other * process.covariance(first_s, other_s, length_s);
                }
            }
        }
        covariance.cholesky()
    }

    /// Divides by the noise.
    fn whiten(&self, values: &DVector<f64>) -> DVector<f64> {
        let mut white = values.component_mul(&self.precision);
        if let Some(covariance) = &self.covariance {
            let count = self.blocks.len();
            let mut rates = values.rows(0, count).into_owned();
            covariance.l_dirty().solve_lower_triangular_mut(&mut rates);
            white.rows_mut(0, count).copy_from(&rates);
        }
        white
    }

    fn equations(&self, oracle: &Oracle<'_>, local: &DVector<f64>, weights: &DVector<f64>) -> Option<Equations> {
        let courses = self.courses(oracle, local);
        let now = self.predict(oracle, local, &courses, weights);
        let residual = self.whiten(&(&self.observed - &now));
        let steps = [STEP_DEG, 1.0, 1.0, STEP_RAD, STEP_RAD];
        let columns: Vec<DVector<f64>> = (0..local.len())
            .map(|at| {
                let mut moved = local.clone();
                moved[at] += steps[at];
                // Azimuth and tilt change what the effect follows, too.
                let courses = if matches!(at, 1 | 2) { courses.clone() } else { self.courses(oracle, &moved) };
                self.whiten(&((self.predict(oracle, &moved, &courses, weights) - &now) / steps[at]))
            })
            .collect();
        let own = DMatrix::from_columns(&columns);
        let columns: Vec<DVector<f64>> = (0..weights.len())
            .map(|at| {
                let mut moved = weights.clone();
                moved[at] += 1e-3;
                self.whiten(&((self.predict(oracle, local, &courses, &moved) - &now) / 1e-3))
            })
            .collect();
        let common =
            if columns.is_empty() { DMatrix::zeros(residual.len(), 0) } else { DMatrix::from_columns(&columns) };
        let mut equations = Equations {
            common: common.transpose() * &common,
            across: common.transpose() * &own,
            local: own.transpose() * &own,
            right_common: common.transpose() * &residual,
            right_local: own.transpose() * &residual,
        };
        let run = &oracle.plan.runs[self.number];
        if let Some((reference_deg, sigma_deg)) = run.reference_deg.filter(|_| run.is_fit) {
            let missing_deg = (reference_deg - local[0] + 180.0).rem_euclid(360.0) - 180.0;
            equations.local[(0, 0)] += sigma_deg.powi(-2);
            equations.right_local[0] += missing_deg / sigma_deg.powi(2);
        }
        residual.iter().all(|value| value.is_finite()).then_some(equations)
    }

    /// Azimuth of a check run: the weights are known from the others.
    fn told(&self, oracle: &Oracle<'_>, known: &DVector<f64>, information: &DMatrix<f64>) -> Option<Reported> {
        let (mut local, mut weights) = (self.start.clone(), known.clone());
        let mut sigma_deg = f64::NAN;
        for _ in 0..ITERATIONS {
            let equations = self.equations(oracle, &local, &weights)?;
            let (all, own) = (weights.len() + local.len(), local.len());
            let mut matrix = DMatrix::zeros(all, all);
            matrix.view_mut((0, 0), (own, own)).copy_from(&equations.local);
            matrix.view_mut((own, own), (weights.len(), weights.len())).copy_from(&(&equations.common + information));
            matrix.view_mut((own, 0), (weights.len(), own)).copy_from(&equations.across);
            matrix.view_mut((0, own), (own, weights.len())).copy_from(&equations.across.transpose());
            let mut right = DVector::zeros(all);
            right.rows_mut(0, own).copy_from(&equations.right_local);
            right.rows_mut(own, weights.len()).copy_from(&(&equations.right_common + information * (known - &weights)));
            let inverse = matrix.cholesky()?.inverse();
            let step = &inverse * right;
            local += step.rows(0, own);
            weights += step.rows(own, weights.len());
            sigma_deg = inverse[(0, 0)].sqrt();
        }
        Some(Reported { azimuth_deg: local[0].rem_euclid(360.0), sigma_deg })
    }
}

/// The resting seconds; with a covariance between them, means of so many that there are not too many.
fn blocks(rests: &[bool], averaged: bool) -> Vec<Vec<usize>> {
    let count = rests.iter().filter(|&&rests| rests).count();
    let longest = if averaged { count.div_ceil(MOST_VALUES) } else { 1 };
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    for second in (0..rests.len()).filter(|&second| rests[second]) {
        match blocks.last_mut() {
            Some(block) if block.len() < longest && block.last() == Some(&(second - 1)) => block.push(second),
            _ => blocks.push(vec![second]),
        }
    }
    blocks
}
