//! The search: groups proposed by a score test, decided by the evidence with every run's own process estimated again.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::basis::{Columns, Scales, Sheet};
use super::evidence::{Posterior, best_variance, posterior};
use super::group::{Base, Group};
use super::process::{self, Kernel};
use super::recording::{Recording, Samples, median, shared_noise};
use super::run::{Run, Whitening};

/// Least gain in log evidence, above the penalty, of a group that is taken.
const GAIN: f64 = 6.0;
/// Gain below which a proposal is not tried.
const LEAST_PROPOSAL: f64 = 3.0;
/// Proposals that are tried, beside each share of the own process.
const TRIALS: usize = 4;
/// Shares of the own process's size beside which groups are proposed: it may have swallowed an effect.
const SHARES: [f64; 3] = [1.0, 0.25, 0.03];
/// Most groups, and most swaps of one for another.
const MOST_GROUPS: usize = 8;
const MOST_SWAPS: usize = 10;
/// Gain of a swap.
const SWAP: f64 = 2.0;
/// Prior standard deviations of weights in units of the runs' noise.
const SIZES: [f64; 11] = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
/// Penalty for each step of a group's complexity.
const COMPLEXITY: f64 = 1.5;
/// Rounds in which own processes and effects are brought into agreement.
const ROUNDS: usize = 3;
/// Parts that the runs are summed in: always the same, so that sums have the same order on any number of cores.
const PARTS: usize = 4;
/// Log evidence by which an alternative may be behind, and how many enter the average.
const BEHIND: f64 = 5.0;
const MOST_ALTERNATIVES: usize = 6;

/// An active group by its place, with the prior variance of its weights.
pub type Active = Vec<(usize, f64)>;

/// Sums over the runs of what columns are beside the runs' own unknowns.
struct Sums {
    /// Gram matrix of every group by itself; products with the active columns; right sides.
    own: Vec<DMatrix<f64>>,
    with_active: Vec<DMatrix<f64>>,
    right: Vec<DVector<f64>>,
    /// −½ (Σ ln det + yᵀy).
    constant: f64,
}

/// The training set in algebra, and its groups.
pub struct Search<'a> {
    pub runs: Vec<Run<'a>>,
    pub scales: Scales,
    pub groups: Vec<Group>,
    /// Factor that gives every group a variance of 1 within runs.
    pub factors: Vec<f64>,
    /// Columns of every group, scaled, by run.
    columns: Vec<Vec<Columns>>,
    pub kernels: Vec<Kernel>,
    pub unit_deg_h: f64,
    variances: Vec<f64>,
    first_groups: usize,
}

/// Where the search stands.
#[derive(Clone, Debug)]
pub struct State {
    pub active: Active,
    /// Kernel of every run, and the kernels' shares.
    pub of_run: Vec<usize>,
    pub shares: Vec<f64>,
    pub evidence: f64,
    /// Log-likelihood that the processes of the runs' own gain over white noise.
    pub process_gain: f64,
}

/// One of the models that the data leave possible: its log evidence less the best one's.
pub struct Alternative {
    pub behind: f64,
    pub active: Active,
}

/// A recording with its samples and what makes their noise white.
type Prepared<'a> = (Sheet<'a>, Arc<Whitening>);

/// Prepares recordings with a common treatment of their noise; `None` where a run has too little in it.
pub fn prepare<'a>(
    recordings: &[&'a Recording],
    kernels: &[Kernel],
    unit_deg_h: Option<f64>,
) -> (Vec<Option<Prepared<'a>>>, f64) {
    let entering: Vec<Vec<bool>> = recordings.par_iter().map(|recording| recording.without_shocks()).collect();
    let noises: Vec<Option<(f64, usize)>> =
        recordings.par_iter().zip(&entering).map(|(recording, enters)| recording.noise(enters)).collect();
    let noises = shared_noise(&noises);
    let unit_deg_h = unit_deg_h.unwrap_or_else(|| median(noises.iter().flatten().copied().collect()) / 10f64.sqrt());
    let sheets: Vec<Option<Sheet>> = recordings
        .par_iter()
        .zip(&entering)
        .zip(&noises)
        .map(|((recording, enters), noise)| Some(Sheet::new(recording, Samples::new(recording, (*noise)?, enters)?)))
        .collect();
    // Runs with the same spans and weights share their whitening.
    let mut first_of: Vec<usize> = Vec::new();
    let mut place = vec![0; sheets.len()];
    for (i, sheet) in sheets.iter().enumerate() {
        let Some(sheet) = sheet else { continue };
        let same = |&first: &usize| {
            sheets[first].as_ref().is_some_and(|other| {
                other.samples.spans == sheet.samples.spans && other.samples.weights == sheet.samples.weights
            })
        };
        place[i] = first_of.iter().position(same).unwrap_or_else(|| {
            first_of.push(i);
            first_of.len() - 1
        });
    }
    let whitenings: Vec<Arc<Whitening>> = first_of
        .par_iter()
        .filter_map(|&first| sheets[first].as_ref())
        .map(|sheet| Arc::new(Whitening::new(&sheet.samples.spans, &sheet.samples.weights, kernels, unit_deg_h)))
        .collect();
    let prepared = sheets
        .into_iter()
        .zip(place)
        .map(|(sheet, place)| sheet.map(|sheet| (sheet, whitenings[place].clone())))
        .collect();
    (prepared, unit_deg_h)
}

impl<'a> Search<'a> {
    /// `None` where no run has enough in it.
    pub fn new(recordings: &[&'a Recording], channels: usize) -> Option<Self> {
        let kernels = process::kernels();
        let (prepared, unit_deg_h) = prepare(recordings, &kernels, None);
        let number = kernels.len();
        let runs: Vec<Run> = prepared
            .into_par_iter()
            .flatten()
            .map(|(sheet, whitening)| {
                let reference = sheet.recording.reference;
                Run::new(sheet, reference, whitening, number)
            })
            .collect();
        if runs.is_empty() || unit_deg_h <= 0.0 {
            return None;
        }
        let tilt = runs.iter().all(|run| run.sheet.recording.tilt_g.is_some());
        let groups = Group::all(channels, tilt);
        let mut bases: Vec<Base> = Vec::new();
        for group in &groups {
            if let Group::Product(first, second) = group {
                bases.extend([*first, *second]);
            }
            if let Group::LinearTimes(_, base) | Group::Triple(_, _, base) = group {
                bases.push(*base);
            }
        }
        let mut once: Vec<Base> = Vec::new();
        bases.into_iter().for_each(|base| {
            if !once.contains(&base) {
                once.push(base);
            }
        });
        let sheets: Vec<Sheet> = runs.iter().map(|run| run.sheet.clone()).collect();
        let scales = Scales::new(&sheets, &once);
        let variances = SIZES.map(|size| (size * unit_deg_h * 10f64.sqrt()).powi(2)).to_vec();
        let mut search = Self {
            columns: vec![Vec::new(); runs.len()],
            runs,
            scales,
            groups: Vec::new(),
            factors: Vec::new(),
            kernels,
            unit_deg_h,
            variances,
            first_groups: 0,
        };
        search.add(groups);
        search.first_groups = search.groups.len();
        Some(search)
    }

    /// Adds groups that vary within runs.
    fn add(&mut self, groups: Vec<Group>) {
        let mut built: Vec<Vec<Columns>> = self
            .runs
            .par_iter()
            .map(|run| groups.iter().map(|group| self.scales.columns(&run.sheet, group, run.azimuth_rad)).collect())
            .collect();
        for (place, group) in groups.into_iter().enumerate() {
            let spread =
                |columns: &Vec<Columns>| columns[place].column_iter().map(|column| column.variance()).sum::<f64>();
            let variance = built.iter().map(spread).sum::<f64>() / built.len() as f64;
            if variance.is_nan() || variance < 1e-14 {
                continue;
            }
            let factor = variance.powf(-0.5);
            self.groups.push(group);
            self.factors.push(factor);
            for (columns, built) in self.columns.iter_mut().zip(&mut built) {
                columns.push(std::mem::replace(&mut built[place], DMatrix::zeros(0, 0)) * factor);
            }
        }
    }

    fn width(&self, group: usize) -> usize {
        self.columns[0][group].ncols()
    }

    /// Active columns of a run side by side.
    pub fn active_columns(&self, run: usize, active: &Active) -> DMatrix<f64> {
        let rows = self.runs[run].rate.len();
        let all: Vec<f64> =
            active.iter().flat_map(|(group, _)| self.columns[run][*group].as_slice().iter().copied()).collect();
        DMatrix::from_vec(rows, all.len() / rows, all)
    }

    pub fn prior(&self, active: &Active) -> Vec<f64> {
        active.iter().flat_map(|&(group, variance)| vec![variance; self.width(group)]).collect()
    }

    /// Sums over the runs for all groups in `of` (by place), beside active ones.
    fn sums(&self, active: &Active, of_run: &[usize], share: f64, of: std::ops::Range<usize>) -> Sums {
        let part = |runs: std::ops::Range<usize>| {
            let mut sums: Option<Sums> = None;
            for run in runs {
                let each = self.sums_of_run(run, active, of_run[run], share, of.clone());
                match &mut sums {
                    None => sums = Some(each),
                    Some(sums) => sums.add(&each),
                }
            }
            sums
        };
        let parts: Vec<std::ops::Range<usize>> = (0..PARTS)
            .map(|i| i * self.runs.len() / PARTS..(i + 1) * self.runs.len() / PARTS)
            .filter(|range| !range.is_empty())
            .collect();
        let found: Vec<Sums> = parts.into_par_iter().filter_map(part).collect();
        let mut found = found.into_iter();
        let mut sums = found.next().unwrap_or_else(|| Sums {
            own: Vec::new(),
            with_active: Vec::new(),
            right: Vec::new(),
            constant: 0.0,
        });
        found.for_each(|each| sums.add(&each));
        sums
    }

    fn sums_of_run(
        &self,
        place: usize,
        active: &Active,
        kernel: usize,
        share: f64,
        of: std::ops::Range<usize>,
    ) -> Sums {
        let run = &self.runs[place];
        let projection = run.projection(kernel, self.kernels[kernel].size * self.unit_deg_h, share);
        let of_active = projection.of(&self.active_columns(place, active));
        let mut sums = Sums {
            own: Vec::with_capacity(of.len()),
            with_active: Vec::with_capacity(of.len()),
            right: Vec::with_capacity(of.len()),
            constant: -0.5 * (projection.log_determinant + projection.rate.norm_squared()),
        };
        for group in of {
            let columns = projection.of(&self.columns[place][group]);
            let transposed = columns.transpose();
            sums.own.push(&transposed * &columns);
            sums.with_active.push(&transposed * &of_active);
            sums.right.push(&transposed * &projection.rate);
        }
        sums
    }

    /// Gram matrix and right side of the active columns of one run.
    pub fn of_run(&self, place: usize, active: &Active, kernel: usize) -> (DMatrix<f64>, DVector<f64>) {
        let (gram, right, _) = self.active_sums_of(place, active, kernel);
        (gram, right)
    }

    fn active_sums_of(&self, place: usize, active: &Active, kernel: usize) -> (DMatrix<f64>, DVector<f64>, f64) {
        let projection = self.runs[place].projection(kernel, self.kernels[kernel].size * self.unit_deg_h, 1.0);
        let columns = projection.of(&self.active_columns(place, active));
        let transposed = columns.transpose();
        let constant = -0.5 * (projection.log_determinant + projection.rate.norm_squared());
        (&transposed * &columns, &transposed * &projection.rate, constant)
    }

    /// The same summed over the runs, with the constant part of the log evidence.
    pub fn active_sums(&self, active: &Active, of_run: &[usize]) -> (DMatrix<f64>, DVector<f64>, f64) {
        let each: Vec<_> = (0..self.runs.len())
            .into_par_iter()
            .map(|place| self.active_sums_of(place, active, of_run[place]))
            .collect();
        let width = each.first().map_or(0, |first| first.1.len());
        let mut total = (DMatrix::zeros(width, width), DVector::zeros(width), 0.0);
        for (gram, right, constant) in each {
            total.0 += gram;
            total.1 += right;
            total.2 += constant;
        }
        total
    }

    /// Log-likelihood of every run under every kernel when these effects (by the sample) are taken out.
    fn own_processes(&self, means: &[DVector<f64>]) -> Vec<Vec<f64>> {
        let residuals: Vec<DVector<f64>> = self.runs.iter().zip(means).map(|(run, mean)| &run.rate - mean).collect();
        // Runs that share their whitening are whitened together.
        let mut together: Vec<Vec<usize>> = Vec::new();
        for (i, run) in self.runs.iter().enumerate() {
            match together.iter_mut().find(|each| Arc::ptr_eq(&self.runs[each[0]].whitening, &run.whitening)) {
                Some(each) => each.push(i),
                None => together.push(vec![i]),
            }
        }
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); self.runs.len()];
        let each: Vec<(usize, Vec<f64>)> = together
            .par_iter()
            .flat_map(|places| {
                let columns: Vec<DVector<f64>> = places.iter().map(|&i| residuals[i].clone()).collect();
                let whitened = &self.runs[places[0]].whitening.halves * DMatrix::from_columns(&columns);
                let n = whitened.nrows();
                places
                    .iter()
                    .enumerate()
                    .map(|(column, &i)| {
                        let whitened = &whitened.as_slice()[column * n..(column + 1) * n];
                        (i, self.runs[i].log_likelihood(&residuals[i], whitened, true))
                    })
                    .collect::<Vec<_>>()
            })
            .collect();
        each.into_iter().for_each(|(i, values)| found[i] = values);
        found
    }

    /// The evidence of active groups with the own processes estimated again, beginning with those of `from`.
    fn total(&self, active: &Active, from: Option<&[usize]>) -> State {
        let none: Vec<DVector<f64>> = self.runs.iter().map(|run| DVector::zeros(run.rate.len())).collect();
        let prior = self.prior(active);
        let mut of_run = from.map_or_else(|| self.settle(&none).0, <[usize]>::to_vec);
        let mut best: Option<State> = None;
        for _ in 0..ROUNDS {
            let means = if active.is_empty() {
                none.clone()
            } else {
                let (gram, right, _) = self.active_sums(active, &of_run);
                let weights = posterior(&gram, &right, &prior).mean;
                (0..self.runs.len()).map(|run| self.active_columns(run, active) * &weights).collect()
            };
            let (new, shares, process_gain) = self.settle(&means);
            let (gram, right, constant) = self.active_sums(active, &new);
            let of_kernels: f64 = new.iter().map(|&kernel| shares[kernel].ln()).sum();
            let evidence = constant + posterior(&gram, &right, &prior).gain + of_kernels;
            if best.as_ref().is_some_and(|best| evidence <= best.evidence + 0.1) {
                break;
            }
            of_run.clone_from(&new);
            best = Some(State { active: active.clone(), of_run: new, shares, evidence, process_gain });
        }
        best.unwrap_or(State {
            active: active.clone(),
            of_run,
            shares: vec![1.0],
            evidence: f64::NEG_INFINITY,
            process_gain: 0.0,
        })
    }

    /// The likeliest kernel of every run, the shares, and what they gain over white noise.
    fn settle(&self, means: &[DVector<f64>]) -> (Vec<usize>, Vec<f64>, f64) {
        let likelihoods = self.own_processes(means);
        let shares = process::shares(&likelihoods);
        let of_run = likelihoods
            .iter()
            .map(|run| {
                let joint = |kernel: usize| run[kernel] + shares[kernel].ln();
                (0..run.len()).max_by(|&a, &b| joint(a).total_cmp(&joint(b))).unwrap_or(0)
            })
            .collect();
        let gain = |run: &Vec<f64>| {
            let most = run.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = run.iter().zip(&shares).map(|(value, share)| share * (value - most).exp()).sum();
            most + sum.ln() - run[0]
        };
        let process_gain = likelihoods.iter().map(gain).sum();
        (of_run, shares, process_gain)
    }

    /// Penalty of a group: for the number of groups and for its complexity.
    fn penalty(&self, group: usize) -> f64 {
        0.5 * (self.groups.len() as f64).ln() + COMPLEXITY * (self.groups[group].level() - 1.0)
    }

    /// Gain in log evidence of every group beside a part of the active ones (`rest`: their places in `active`), and the
    /// prior variance that gives it.
    fn gains(&self, sums: &Sums, active: &Active, rest: &[usize]) -> Vec<Option<(f64, f64)>> {
        let (columns, known) = self.known(sums, active, rest);
        let groups: Vec<usize> = rest.iter().map(|&place| active[place].0).collect();
        (0..self.groups.len())
            .into_par_iter()
            .map(|group| {
                if groups.contains(&group) {
                    return None;
                }
                if let Group::Extended { parent, .. } = &self.groups[group]
                    && !groups.iter().any(|&active| self.groups[active] == **parent)
                {
                    return None;
                }
                if rest.is_empty() {
                    return Some(best_variance(&sums.own[group], &sums.right[group], &self.variances));
                }
                let with = sums.with_active[group].select_columns(&columns);
                let own = &sums.own[group] - &with * &known.covariance * with.transpose();
                let right = &sums.right[group] - with * &known.mean;
                Some(best_variance(&own, &right, &self.variances))
            })
            .collect()
    }

    /// Log evidence of the active groups by sums that were made with them, without the kernels' part.
    fn evidence(&self, sums: &Sums, active: &Active, rest: &[usize]) -> f64 {
        sums.constant + self.known(sums, active, rest).1.gain
    }

    /// Posterior of a part of the active groups (`rest`: their places in `active`), and its columns among all active ones.
    fn known(&self, sums: &Sums, active: &Active, rest: &[usize]) -> (Vec<usize>, Posterior) {
        let starts: Vec<usize> = active
            .iter()
            .scan(0, |start, (group, _)| {
                let at = *start;
                *start += self.width(*group);
                Some(at)
            })
            .collect();
        let columns: Vec<usize> =
            rest.iter().flat_map(|&place| starts[place]..starts[place] + self.width(active[place].0)).collect();
        let rows: Vec<(usize, usize)> = rest
            .iter()
            .flat_map(|&place| (0..self.width(active[place].0)).map(move |at| (active[place].0, at)))
            .collect();
        let n = columns.len();
        let gram = DMatrix::from_fn(n, n, |i, j| sums.with_active[rows[i].0][(rows[i].1, columns[j])]);
        let right = DVector::from_fn(n, |i, _| sums.right[rows[i].0][rows[i].1]);
        let prior: Vec<f64> =
            rest.iter().flat_map(|&place| vec![active[place].1; self.width(active[place].0)]).collect();
        (columns, posterior(&gram, &right, &prior))
    }

    /// Learns.
    pub fn learn(&mut self) -> State {
        let mut state = self.total(&Vec::new(), None);
        let mut swaps = 0;
        while state.active.len() < MOST_GROUPS {
            let Some((mut trial, penalty)) = self.best_trial(&state) else { break };
            if trial.evidence - penalty - state.evidence < GAIN {
                // Two together may do what neither does alone: an own process gives way to the whole of an effect only.
                let Some((both, of_second)) = self.best_trial(&trial) else { break };
                if both.evidence - penalty - of_second - state.evidence < 2.0 * GAIN {
                    break;
                }
                trial = both;
            }
            let before = state.evidence;
            let newest = trial.active.last().map(|each| each.0);
            state = self.polish(trial, &mut swaps);
            if let Some(newest) = newest.filter(|newest| state.active.iter().any(|each| each.0 == *newest)) {
                self.extend(newest, &state);
            }
            if state.evidence - before < 0.5 * GAIN {
                break;
            }
        }
        state
    }

    /// The best of the proposed groups by the evidence less its penalty, which is also given.
    fn best_trial(&self, state: &State) -> Option<(State, f64)> {
        let mut tried: Vec<(usize, bool)> = Vec::new();
        let mut best: Option<(State, f64)> = None;
        let places: Vec<usize> = (0..state.active.len()).collect();
        for share in SHARES {
            if share < 1.0 && state.of_run.iter().all(|&kernel| kernel == 0) {
                continue;
            }
            let sums = self.sums(&state.active, &state.of_run, share, 0..self.groups.len());
            let gains = self.gains(&sums, &state.active, &places);
            let mut order: Vec<(usize, f64, f64)> = gains
                .iter()
                .enumerate()
                .filter_map(|(group, gain)| gain.map(|(gain, variance)| (group, gain, variance)))
                .filter(|each| each.1 >= LEAST_PROPOSAL)
                .collect();
            let worth = |each: &(usize, f64, f64)| each.1 - self.penalty(each.0);
            order.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
            for (group, _, variance) in order.into_iter().take(TRIALS) {
                if tried.contains(&(group, share < 1.0)) {
                    continue;
                }
                tried.push((group, share < 1.0));
                let mut active = state.active.clone();
                active.push((group, variance));
                let mut trial = self.total(&active, Some(&state.of_run));
                if share < 1.0 {
                    // Begun without any process the effect need not be taken away from one first.
                    let fresh = self.total(&active, Some(&vec![0; self.runs.len()]));
                    if fresh.evidence > trial.evidence {
                        trial = fresh;
                    }
                }
                let penalty = self.penalty(group);
                if best.as_ref().is_none_or(|best| trial.evidence - penalty > best.0.evidence - best.1) {
                    best = Some((trial, penalty));
                }
            }
        }
        best
    }

    /// Sizes again, swaps of a group for a better one, and groups that have become superfluous go.
    fn polish(&self, mut state: State, swaps: &mut usize) -> State {
        loop {
            let sums = self.sums(&state.active, &state.of_run, 1.0, 0..self.groups.len());
            self.reweigh(&sums, &mut state.active);
            let all: Vec<usize> = (0..state.active.len()).collect();
            let own = self.evidence(&sums, &state.active, &all);
            let without = |place: usize| all.iter().copied().filter(|&each| each != place).collect::<Vec<_>>();
            let mut best: Option<(f64, usize, usize, f64)> = None;
            let mut least: Option<(f64, usize)> = None;
            for place in 0..state.active.len() {
                let rest = without(place);
                let bare = self.evidence(&sums, &state.active, &rest);
                let lost = own - bare;
                if lost < GAIN && least.is_none_or(|least| lost < least.0) {
                    least = Some((lost, place));
                }
                if *swaps >= MOST_SWAPS {
                    continue;
                }
                let worth = own - self.penalty(state.active[place].0);
                for (group, gain) in self.gains(&sums, &state.active, &rest).into_iter().enumerate() {
                    let Some((gain, variance)) = gain.filter(|_| group != state.active[place].0) else { continue };
                    let better = bare + gain - self.penalty(group) - worth;
                    if better > SWAP && best.is_none_or(|best| better > best.0) {
                        best = Some((better, place, group, variance));
                    }
                }
            }
            if let Some((_, place, group, variance)) = best {
                *swaps += 1;
                let mut active = state.active.clone();
                active[place] = (group, variance);
                state = self.total(&active, Some(&state.of_run));
                continue;
            }
            if let Some((_, place)) = least {
                let mut active = state.active.clone();
                active.remove(place);
                state = self.total(&active, Some(&state.of_run));
                continue;
            }
            return self.total(&state.active, Some(&state.of_run));
        }
    }

    /// Prior variances of the active groups again, one beside the others.
    fn reweigh(&self, sums: &Sums, active: &mut Active) {
        for _ in 0..ROUNDS {
            for place in 0..active.len() {
                let rest: Vec<usize> = (0..active.len()).filter(|&each| each != place).collect();
                active[place].1 = self.gain_of(sums, active, &rest, active[place].0).1;
            }
        }
    }

    fn gain_of(&self, sums: &Sums, active: &Active, rest: &[usize], group: usize) -> (f64, f64) {
        if rest.is_empty() {
            return best_variance(&sums.own[group], &sums.right[group], &self.variances);
        }
        let (columns, known) = self.known(sums, active, rest);
        let with = sums.with_active[group].select_columns(&columns);
        let own = &sums.own[group] - &with * &known.covariance * with.transpose();
        let right = &sums.right[group] - with * &known.mean;
        best_variance(&own, &right, &self.variances)
    }

    /// Products of what a newly accepted group was found to be with every base.
    fn extend(&mut self, newest: usize, state: &State) {
        if self.groups[newest].level() > 2.0 {
            return;
        }
        let (gram, right, _) = self.active_sums(&state.active, &state.of_run);
        let found = posterior(&gram, &right, &self.prior(&state.active)).mean;
        let mut start = 0;
        for &(group, _) in &state.active {
            let width = self.width(group);
            if group == newest {
                let weights: Vec<f64> = found.rows(start, width).iter().map(|w| w * self.factors[group]).collect();
                let tilt = self.runs[0].sheet.recording.tilt_g.is_some();
                let new = self.groups[group].extensions(&weights, self.scales.channels.len(), tilt);
                self.add(new);
                return;
            }
            start += width;
        }
    }

    /// Models whose evidence is near: every active group in turn replaced by another that does nearly as well.
    pub fn alternatives(&self, state: &State) -> Vec<Alternative> {
        let sums = self.sums(&state.active, &state.of_run, 1.0, 0..self.groups.len());
        let all: Vec<usize> = (0..state.active.len()).collect();
        let own = self.evidence(&sums, &state.active, &all);
        let mut found = Vec::new();
        for place in 0..state.active.len() {
            let rest: Vec<usize> = all.iter().copied().filter(|&each| each != place).collect();
            let bare = self.evidence(&sums, &state.active, &rest);
            let worth = own - self.penalty(state.active[place].0);
            for (group, gain) in self.gains(&sums, &state.active, &rest).into_iter().enumerate() {
                let Some((gain, variance)) = gain.filter(|_| group != state.active[place].0) else { continue };
                let behind = bare + gain - self.penalty(group) - worth;
                if behind > -BEHIND && group < self.first_groups {
                    let mut active = state.active.clone();
                    active[place] = (group, variance);
                    found.push(Alternative { behind, active });
                }
            }
        }
        found.sort_by(|a, b| b.behind.total_cmp(&a.behind));
        found.truncate(MOST_ALTERNATIVES);
        found
    }
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.own.iter_mut().zip(&other.own).for_each(|(sum, each)| *sum += each);
        self.with_active.iter_mut().zip(&other.with_active).for_each(|(sum, each)| *sum += each);
        self.right.iter_mut().zip(&other.right).for_each(|(sum, each)| *sum += each);
        self.constant += other.constant;
    }
}
