//! The search: groups proposed by a score test, decided by the evidence with every run's own process estimated again. The algebra is here,
//! the steps of the search in a room below.

mod steps;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::basis::Scales;
use super::columns::of_values;
use super::evidence::{Posterior, best_variance, posterior};
use super::group::{Base, Group};
use super::habits::Habits;
use super::process::{self, Kernel};
use super::recording::{Recording, Samples, median, shared_noise};
use super::run::{Run, Whitening};
use super::sheet::Sheet;

/// Least gain in log evidence, above the penalty, of a group that is taken.
pub const GAIN: f64 = 6.0;
/// Shares of the own process's size beside which groups are proposed: it may have swallowed an effect.
const SHARES: [f64; 3] = [1.0, 0.25, 0.03];
/// Prior standard deviations of weights in units of the runs' noise.
const SIZES: [f64; 11] = [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
/// Penalty for each step of a group's complexity.
const COMPLEXITY: f64 = 1.5;
/// Rounds in which own processes and effects are brought into agreement.
const ROUNDS: usize = 3;
/// Parts that the runs are summed in: always the same, so that sums have the same order on any number of cores.
const PARTS: usize = 4;
/// Log odds by which another kernel must be likelier than the one that a run has.
const HARDLY: f64 = 0.3;

/// An active group by its place, with the prior variance of its weights.
pub type Active = Vec<(usize, f64)>;

/// Sums over the runs of what columns are beside the runs' own unknowns.
struct Sums<'a> {
    /// Gram matrix of every group by itself.
    own: &'a [DMatrix<f64>],
    /// Products of all columns with the active ones; right sides.
    with_active: DMatrix<f64>,
    right: DVector<f64>,
    /// −½ (Σ ln det + yᵀy).
    constant: f64,
}

/// Gram matrices of all groups by themselves, summed over the runs: they change only with a run's kernel.
#[derive(Default)]
pub struct Grams {
    of_run: Vec<usize>,
    sums: Vec<DMatrix<f64>>,
}

/// Gram matrix, right side and constant of the active columns of a run.
pub type OfRun = (DMatrix<f64>, DVector<f64>, f64);

/// The training set in algebra, and its groups.
pub struct Search<'a> {
    pub runs: Vec<Run<'a>>,
    pub scales: Scales,
    pub groups: Vec<Group>,
    /// Factor that gives every group a variance of 1 within runs.
    pub factors: Vec<f64>,
    /// Log evidence that what every run chooses for itself costs.
    pub costs: Vec<f64>,
    /// Columns of all groups side by side, scaled, by run; where each group's begin, and where the last one's end.
    columns: Vec<DMatrix<f64>>,
    starts: Vec<usize>,
    pub kernels: Vec<Kernel>,
    pub unit_deg_h: f64,
    pub variances: Vec<f64>,
    /// For every share of the own process.
    pub grams: [Grams; SHARES.len()],
    /// Log evidence of every run without any group.
    pub bare: Vec<f64>,
    /// Of the courses that were found last.
    pub habits: Habits,
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

/// Prepares recordings with a common treatment of their noise; `None` where a run has too little in it. `known` are whitenings
/// under the same kernels.
pub fn prepare<'a>(
    recordings: &[&'a Recording],
    kernels: &[Kernel],
    unit_deg_h: Option<f64>,
    known: &[Arc<Whitening>],
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
    for (i, sheet) in sheets.iter().enumerate() {
        let Some(Sheet { samples, .. }) = sheet else { continue };
        let same = |first: &usize| sheets[*first].as_ref().is_some_and(|other| other.samples.is_alike(samples));
        if !known.iter().any(|known| known.is_of(&samples.spans, &samples.weights)) && !first_of.iter().any(same) {
            first_of.push(i);
        }
    }
    let new: Vec<Arc<Whitening>> = first_of
        .par_iter()
        .filter_map(|&first| sheets[first].as_ref())
        .map(|sheet| Arc::new(Whitening::new(&sheet.samples.spans, &sheet.samples.weights, kernels)))
        .collect();
    let prepared = |sheet: Option<Sheet<'a>>| {
        let sheet = sheet?;
        let of_sheet = |whitening: &&Arc<Whitening>| whitening.is_of(&sheet.samples.spans, &sheet.samples.weights);
        let whitening = known.iter().chain(&new).find(of_sheet)?.clone();
        Some((sheet, whitening))
    };
    (sheets.into_iter().map(prepared).collect(), unit_deg_h)
}

/// Standard deviations of the kernels' processes, °/h.
pub fn sizes_deg_h(kernels: &[Kernel], unit_deg_h: f64) -> Arc<Vec<f64>> {
    Arc::new(kernels.iter().map(|kernel| kernel.size * unit_deg_h).collect())
}

impl<'a> Search<'a> {
    /// `None` where no run has enough in it.
    pub fn new(recordings: &[&'a Recording], channels: usize) -> Option<Self> {
        let kernels = process::kernels();
        let (prepared, unit_deg_h) = prepare(recordings, &kernels, None, &[]);
        let sizes_deg_h = sizes_deg_h(&kernels, unit_deg_h);
        let runs: Vec<Run> = prepared
            .into_par_iter()
            .flatten()
            .map(|(sheet, whitening)| {
                let reference = sheet.recording.reference;
                Run::new(sheet, reference, whitening, &sizes_deg_h)
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
            columns: runs.iter().map(|run| DMatrix::zeros(run.rate.len(), 0)).collect(),
            starts: vec![0],
            runs,
            scales,
            groups: Vec::new(),
            factors: Vec::new(),
            costs: Vec::new(),
            kernels,
            unit_deg_h,
            variances,
            grams: Default::default(),
            bare: Vec::new(),
            habits: Habits::default(),
        };
        search.add(groups);
        Some(search)
    }

    /// Adds groups that vary within runs.
    pub fn add(&mut self, groups: Vec<Group>) {
        let built: Vec<Vec<DMatrix<f64>>> = self
            .runs
            .par_iter()
            .map(|run| {
                let mut bases = Vec::new();
                let of_group = |group: &Group| self.scales.columns_with(&run.sheet, group, run.azimuth_rad, &mut bases);
                groups.iter().map(of_group).collect()
            })
            .collect();
        let spread = |columns: &DMatrix<f64>| columns.column_iter().map(|column| column.variance()).sum::<f64>();
        let mut kept: Vec<(usize, f64)> = Vec::new();
        for (place, group) in groups.into_iter().enumerate() {
            let variance = built.iter().map(|built| spread(&built[place])).sum::<f64>() / built.len() as f64;
            if variance.is_nan() || variance < 1e-14 {
                continue;
            }
            kept.push((place, variance.powf(-0.5)));
            self.groups.push(group);
            self.factors.push(variance.powf(-0.5));
            self.costs.push(0.0);
            self.starts.push(self.starts[self.starts.len() - 1] + built[0][place].ncols());
        }
        for (columns, built) in self.columns.iter_mut().zip(built) {
            let scaled = kept.iter().flat_map(|&(place, factor)| built[place].iter().map(move |value| value * factor));
            *columns = of_values(columns.nrows(), columns.iter().copied().chain(scaled));
        }
    }

    fn width(&self, group: usize) -> usize {
        self.starts[group + 1] - self.starts[group]
    }

    /// Active columns of a run side by side.
    pub fn active_columns(&self, run: usize, active: &Active) -> DMatrix<f64> {
        let rows = self.runs[run].rate.len();
        let of_group = |&(group, _): &(usize, f64)| {
            self.columns[run].as_slice()[self.starts[group] * rows..self.starts[group + 1] * rows].iter().copied()
        };
        of_values(rows, active.iter().flat_map(of_group))
    }

    pub fn prior(&self, active: &Active) -> Vec<f64> {
        active.iter().flat_map(|&(group, variance)| vec![variance; self.width(group)]).collect()
    }

    /// Brings the groups' own Gram matrices to these kernels.
    fn refresh(&mut self, number: usize, of_run: &[usize]) {
        let share = SHARES[number];
        let mut grams = std::mem::take(&mut self.grams[number]);
        let changed: Vec<usize> = (0..of_run.len()).filter(|&i| grams.of_run.get(i) != Some(&of_run[i])).collect();
        // Half of them again are as much work as all of them anew.
        if 2 * changed.len() > of_run.len() {
            grams = Grams::default();
        }
        let old = grams.sums.len();
        let mut jobs: Vec<(usize, usize, f64, std::ops::Range<usize>)> = Vec::new();
        if old > 0 {
            for &i in &changed {
                jobs.push((i, grams.of_run[i], -1.0, 0..old));
                jobs.push((i, of_run[i], 1.0, 0..old));
            }
        }
        if old < self.groups.len() {
            jobs.extend((0..of_run.len()).map(|i| (i, of_run[i], 1.0, old..self.groups.len())));
            grams
                .sums
                .extend((old..self.groups.len()).map(|group| DMatrix::zeros(self.width(group), self.width(group))));
        }
        let zeros = || grams.sums.iter().map(|sum| DMatrix::zeros(sum.nrows(), sum.nrows())).collect::<Vec<_>>();
        let of_part = |part: usize| {
            let mut sums = zeros();
            for (run, kernel, sign, range) in jobs.iter().skip(part).step_by(PARTS) {
                let widths: Vec<usize> = range.clone().map(|group| self.width(group)).collect();
                let columns = self.columns[*run].columns(self.starts[range.start], widths.iter().sum()).into_owned();
                let beside = self.runs[*run].beside(*kernel, if *kernel == 0 { 1.0 } else { share });
                beside.add_grams(&columns, &widths, *sign, &mut sums[range.clone()]);
            }
            sums
        };
        if !jobs.is_empty() {
            for part in (0..PARTS.min(jobs.len())).into_par_iter().map(of_part).collect::<Vec<_>>() {
                grams.sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
            }
        }
        grams.of_run = of_run.to_vec();
        self.grams[number] = grams;
    }

    /// Sums over the runs beside active groups, under a share of the own process given by its place.
    /// The Gram matrices are those of the last refresh.
    fn sums(&self, active: &Active, of_run: &[usize], number: usize) -> Sums<'_> {
        let of_part = |part: usize| {
            let mut sum: Option<(DMatrix<f64>, f64)> = None;
            for run in (part..self.runs.len()).step_by(PARTS) {
                let beside = self.runs[run].beside(of_run[run], SHARES[number]);
                let toward = beside.toward(&self.active_columns(run, active));
                let products = self.columns[run].tr_mul(&toward);
                sum = Some(match sum {
                    None => (products, beside.constant),
                    Some((all, constant)) => (all + products, constant + beside.constant),
                });
            }
            sum
        };
        let parts: Vec<(DMatrix<f64>, f64)> = (0..PARTS).into_par_iter().filter_map(of_part).collect();
        let mut parts = parts.into_iter();
        let (mut products, mut constant) = parts.next().unwrap_or((DMatrix::zeros(0, 1), 0.0));
        for (each, of_part) in parts {
            products += each;
            constant += of_part;
        }
        let last = products.ncols() - 1;
        let right = products.column(last).into_owned();
        Sums { own: &self.grams[number].sums, with_active: products.remove_column(last), right, constant }
    }

    /// Gram matrix, right side and constant of the active columns of one run.
    pub fn of_run(&self, place: usize, active: &Active, kernel: usize) -> OfRun {
        let beside = self.runs[place].beside(kernel, 1.0);
        let (gram, right) = beside.sums(&self.active_columns(place, active));
        (gram, right, beside.constant)
    }

    /// The same of all runs.
    fn of_runs(&self, active: &Active, of_run: &[usize]) -> Vec<OfRun> {
        (0..self.runs.len()).into_par_iter().map(|place| self.of_run(place, active, of_run[place])).collect()
    }

    /// Log-likelihood of every run under every kernel when these effects (by the sample) are taken out.
    fn own_processes(&self, means: &[DVector<f64>]) -> Vec<Vec<f64>> {
        let of_run =
            |(run, mean): (&Run, &DVector<f64>)| run.log_likelihood(&(&run.rate - mean), true, run.course.as_deref());
        self.runs.par_iter().zip(means).map(of_run).collect()
    }

    /// What groups do in every run, by the sample.
    fn means(&self, active: &Active, weights: &DVector<f64>) -> Vec<DVector<f64>> {
        if active.is_empty() {
            return self.runs.iter().map(|run| DVector::zeros(run.rate.len())).collect();
        }
        (0..self.runs.len()).into_par_iter().map(|run| self.active_columns(run, active) * weights).collect()
    }

    /// The evidence of active groups with the own processes estimated again, beginning with those of `from`.
    pub fn total(&self, active: &Active, from: Option<&[usize]>) -> State {
        self.total_in(active, from, ROUNDS)
    }

    fn total_in(&self, active: &Active, from: Option<&[usize]>, rounds: usize) -> State {
        let prior = self.prior(active);
        let nothing = || self.means(&Vec::new(), &DVector::zeros(0));
        let mut of_run = from.map_or_else(|| self.settle(&nothing(), None).0, <[usize]>::to_vec);
        let mut each = self.of_runs(active, &of_run);
        let mut found = posterior_of(&each, &prior);
        let mut best: Option<State> = None;
        for _ in 0..rounds {
            let means = self.means(active, &found.0.mean);
            let (new, shares, process_gain) = self.settle(&means, Some(&of_run));
            let changed: Vec<usize> = (0..new.len()).filter(|&run| new[run] != of_run[run]).collect();
            let again: Vec<OfRun> = changed.par_iter().map(|&run| self.of_run(run, active, new[run])).collect();
            changed.iter().zip(again).for_each(|(&run, of_run)| each[run] = of_run);
            found = posterior_of(&each, &prior);
            let of_kernels: f64 = new.iter().map(|&kernel| shares[kernel].ln()).sum();
            let evidence = found.1 + found.0.gain + of_kernels;
            if best.as_ref().is_some_and(|best| evidence <= best.evidence + 0.1) {
                break;
            }
            of_run.clone_from(&new);
            best = Some(State { active: active.clone(), of_run: new, shares, evidence, process_gain });
            if changed.is_empty() || active.is_empty() {
                break;
            }
        }
        best.unwrap_or(State {
            active: active.clone(),
            of_run,
            shares: vec![1.0],
            evidence: f64::NEG_INFINITY,
            process_gain: 0.0,
        })
    }

    /// The likeliest kernel of every run (the one it had, where another is hardly likelier), the shares, and what they gain over
    /// white noise.
    fn settle(&self, means: &[DVector<f64>], before: Option<&[usize]>) -> (Vec<usize>, Vec<f64>, f64) {
        let likelihoods = self.own_processes(means);
        let shares = process::shares(&likelihoods);
        let of_run = likelihoods
            .iter()
            .enumerate()
            .map(|(place, run)| {
                let joint = |kernel: usize| run[kernel] + shares[kernel].ln();
                let best = (0..run.len()).max_by(|&a, &b| joint(a).total_cmp(&joint(b))).unwrap_or(0);
                let had = before.map_or(best, |before| before[place]);
                if joint(best) > joint(had) + HARDLY { best } else { had }
            })
            .collect();
        let process_gain = likelihoods.iter().map(|run| process::mixture(run, &shares) - run[0]).sum();
        (of_run, shares, process_gain)
    }

    /// Penalty of a group: for the number of groups, for its complexity, and for what every run chooses for itself.
    fn penalty(&self, group: usize) -> f64 {
        0.5 * (self.groups.len() as f64).ln() + COMPLEXITY * (self.groups[group].level() - 1.0) + self.costs[group]
    }

    /// Gain in log evidence of every group beside a part of the active ones (`rest`: their places in `active`), and the
    /// prior variance that gives it.
    fn gains(&self, sums: &Sums, active: &Active, rest: &[usize]) -> Vec<Option<(f64, f64)>> {
        let (columns, known) = self.known(sums, active, rest);
        let groups: Vec<usize> = rest.iter().map(|&place| active[place].0).collect();
        (0..self.groups.len())
            .into_par_iter()
            .map(|group| {
                // The phases of a rhythm were found beside other groups.
                if groups.contains(&group) || matches!(self.groups[group], Group::Rhythm(_)) {
                    return None;
                }
                if let Group::Extended { parent, .. } = &self.groups[group]
                    && !groups.iter().any(|&active| self.groups[active] == **parent)
                {
                    return None;
                }
                Some(self.best_beside(sums, group, &columns, &known))
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
        let rows: Vec<usize> =
            rest.iter().flat_map(|&place| self.starts[active[place].0]..self.starts[active[place].0 + 1]).collect();
        let n = columns.len();
        let gram = DMatrix::from_fn(n, n, |i, j| sums.with_active[(rows[i], columns[j])]);
        let right = DVector::from_fn(n, |i, _| sums.right[rows[i]]);
        let prior: Vec<f64> =
            rest.iter().flat_map(|&place| vec![active[place].1; self.width(active[place].0)]).collect();
        (columns, posterior(&gram, &right, &prior))
    }

    /// What a state has learned does in every run.
    pub fn learned_means(&self, state: &State) -> Vec<DVector<f64>> {
        let each = self.of_runs(&state.active, &state.of_run);
        let weights = posterior_of(&each, &self.prior(&state.active)).0.mean;
        self.means(&state.active, &weights)
    }

    /// Shares of the kernels where no run may have a course.
    pub fn shares_without_courses(&self, state: &State) -> Vec<f64> {
        let means = self.learned_means(state);
        let of_run = |(run, mean): (&Run, &DVector<f64>)| run.log_likelihood(&(&run.rate - mean), true, None);
        let likelihoods: Vec<Vec<f64>> = self.runs.par_iter().zip(&means).map(of_run).collect();
        let mut shares = process::shares(&likelihoods);
        if let Some(last) = shares.last_mut() {
            *last = 0.0;
        }
        shares
    }

    /// Log evidence of every run under its kernel, without groups.
    pub fn of_each(&self, state: &State) -> Vec<f64> {
        let of_run =
            |(run, &kernel): (usize, &usize)| self.of_run(run, &Vec::new(), kernel).2 + state.shares[kernel].ln();
        state.of_run.iter().enumerate().map(of_run).collect()
    }

    /// Log density that a state's groups, as learned from all other runs, give every run, more than what it has without groups.
    pub fn predictive_gain(&self, state: &State) -> f64 {
        let prior = self.prior(&state.active);
        let each = self.of_runs(&state.active, &state.of_run);
        let all = posterior_of(&each, &prior).0.gain;
        let own = (0..each.len()).into_par_iter().map(|run| {
            let others = each.iter().enumerate().filter(|(other, _)| *other != run);
            let (gram, right, _) = summed(others.map(|each| each.1), prior.len());
            let kernel = state.of_run[run];
            all - posterior(&gram, &right, &prior).gain + each[run].2 + state.shares[kernel].ln() - self.bare[run]
        });
        let cost: f64 = state.active.iter().map(|each| self.costs[each.0]).sum();
        own.collect::<Vec<f64>>().into_iter().sum::<f64>() - cost
    }

    /// Evidence less the penalties of the groups and of what the courses share.
    pub fn worth(&self, state: &State) -> f64 {
        state.evidence - self.habits.cost() - state.active.iter().map(|each| self.penalty(each.0)).sum::<f64>()
    }

    fn gain_of(&self, sums: &Sums, active: &Active, rest: &[usize], group: usize) -> (f64, f64) {
        let (columns, known) = self.known(sums, active, rest);
        self.best_beside(sums, group, &columns, &known)
    }

    /// Gain and prior variance of a group beside active ones, of which these columns among all active ones are known.
    fn best_beside(&self, sums: &Sums, group: usize, columns: &[usize], known: &Posterior) -> (f64, f64) {
        let (start, width) = (self.starts[group], self.width(group));
        let right = sums.right.rows(start, width);
        if columns.is_empty() {
            return best_variance(&sums.own[group], &right.into_owned(), &self.variances);
        }
        let with = sums.with_active.rows(start, width).select_columns(columns);
        let factored = &with * known.factor.transpose();
        let own = &sums.own[group] - &factored * factored.transpose();
        best_variance(&own, &(right - with * &known.mean), &self.variances)
    }
}

/// Posterior by the sums of runs, and the sum of their constants.
fn posterior_of(each: &[OfRun], prior: &[f64]) -> (Posterior, f64) {
    let (gram, right, constant) = summed(each.iter(), prior.len());
    (posterior(&gram, &right, prior), constant)
}

/// Sums of runs.
pub fn summed<'a>(each: impl Iterator<Item = &'a OfRun>, width: usize) -> OfRun {
    let mut total = (DMatrix::zeros(width, width), DVector::zeros(width), 0.0);
    for (gram, right, constant) in each {
        total.0 += gram;
        total.1 += right;
        total.2 += constant;
    }
    total
}
