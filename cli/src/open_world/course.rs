//! The course of a run by itself: steps, bumps, waves and switches that no channel tells, found in the run's own rate by matching pursuit.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::atom::{Atom, Extent, KINDS, STEP};
use super::columns::{from_columns, side_by_side};
use super::dictionary::Dictionary;
use super::evidence::{best_variance, half_of};
use super::habits::{Habits, SharedWave};
use super::levels::Switching;
use super::seen::Seen;
use super::sheet::Sheet;
use super::switching::Way;

/// Most columns of a course, as a share of the samples.
const MOST_COLUMNS: f64 = 0.4;
/// Log evidence, beyond what the choice among all atoms costs, that an atom must gain.
const LEAST_GAIN: f64 = 2.0;
/// Steps by which constants of atoms are refined, shares of the run; and most moves with each.
const STEPS: [f64; 5] = [0.02, 0.01, 0.005, 0.0025, 0.001];
const MOVES: usize = 8;
/// Log evidence by which an atom with other constants may be behind and still count.
const BEHIND: f64 = 4.0;
/// Most of these that count, of all atoms together: each takes a solution of its own.
const MOST_OTHERS: usize = 64;

/// What was found in a run: atoms whose sizes have one prior variance.
#[derive(Clone, Debug)]
pub struct Course {
    /// Of every atom.
    pub kinds: Vec<usize>,
    /// Columns of every atom over the samples times the prior standard deviation, °/h.
    parts: Vec<DMatrix<f64>>,
    /// Waves that all runs share, and steps between dwells, where nobody sees them: columns times the standard deviation that they
    /// are expected to have.
    expected: DMatrix<f64>,
    /// Of every atom, what else it may be: log evidence less that of the best, and its columns.
    others: Vec<Vec<(f64, DMatrix<f64>)>>,
    /// What a rate between two levels does over the samples by the likeliest way, °/h, and the ways that it may have gone; of none 0.
    pub mean: DVector<f64>,
    pub ways: Vec<Way>,
    /// How many things happen.
    pub events: usize,
    /// Log of the prior probability of these atoms.
    pub log_prior: f64,
    /// Standard deviation of what it does, °/h.
    pub size_deg_h: f64,
    pub length_s: f64,
    /// Inverse of the lower factor of the covariance white + atoms; logarithm of its determinant.
    pub half: DMatrix<f64>,
    pub log_determinant: f64,
}

/// A run's rate beside its own unknowns, and the atoms chosen so far.
struct Pursuit<'a> {
    sheet: &'a Sheet<'a>,
    extent: Extent,
    roots: DVector<f64>,
    /// Directions of the own unknowns, a surveyed heading's rows last.
    own: DMatrix<f64>,
    rate: DVector<f64>,
    variance: f64,
    penalties: [f64; KINDS],
    atoms: Vec<Atom>,
    kinds: Vec<usize>,
    /// Columns of every atom beside the own unknowns, and their sums.
    columns: Vec<DMatrix<f64>>,
    sums: Sums,
}

/// Gram matrix of columns, and their products with a rate: kept from move to move.
struct Sums {
    gram: DMatrix<f64>,
    right: DVector<f64>,
}

impl Sums {
    fn of(all: &DMatrix<f64>, rate: &DVector<f64>) -> Self {
        Self { gram: all.tr_mul(all), right: all.tr_mul(rate) }
    }

    /// With other columns, as many as there were, in a place.
    fn with(&self, columns: &[DMatrix<f64>], place: usize, new: &DMatrix<f64>, rate: &DVector<f64>) -> Self {
        let (mut gram, mut right) = (self.gram.clone(), self.right.clone());
        let (start, width) = (first_of(columns, place), new.ncols());
        for (other, columns_of) in columns.iter().enumerate() {
            let products = new.tr_mul(if other == place { new } else { columns_of });
            let (at, count) = (first_of(columns, other), products.ncols());
            gram.view_mut((start, at), (width, count)).copy_from(&products);
            gram.view_mut((at, start), (count, width)).copy_from(&products.transpose());
        }
        right.rows_mut(start, width).copy_from(&new.tr_mul(rate));
        Self { gram, right }
    }

    /// Without those of a place.
    fn without(&self, columns: &[DMatrix<f64>], place: usize) -> Self {
        let (start, width) = (first_of(columns, place), columns[place].ncols());
        let gram = self.gram.clone().remove_columns(start, width).remove_rows(start, width);
        Self { gram, right: self.right.clone().remove_rows(start, width) }
    }

    /// Log evidence that weights with this prior variance gain.
    fn gain(&self, variance: f64) -> f64 {
        best_variance(&self.gram, &self.right, &[variance]).0
    }
}

/// Where the columns of a place begin among all.
fn first_of(columns: &[DMatrix<f64>], place: usize) -> usize {
    columns[..place].iter().map(DMatrix::ncols).sum()
}

impl Pursuit<'_> {
    /// Columns over the samples beside the own unknowns.
    fn beside(&self, atom: Atom) -> DMatrix<f64> {
        let columns = atom.columns(self.sheet, self.extent);
        let n = self.roots.len();
        let mut all = DMatrix::zeros(self.own.nrows(), columns.len());
        for (mut column, values) in all.column_iter_mut().zip(&columns) {
            (0..n).for_each(|i| column[i] = values[i] * self.roots[i]);
        }
        let along = self.own.tr_mul(&all);
        all - &self.own * along
    }

    fn joined(&self) -> DMatrix<f64> {
        side_by_side(self.own.nrows(), &self.columns)
    }

    fn gain(&self) -> f64 {
        self.sums.gain(self.variance)
    }

    /// Gain with another atom of the same kind in a place.
    fn gain_with(&self, place: usize, atom: Atom) -> f64 {
        self.sums.with(&self.columns, place, &self.beside(atom), &self.rate).gain(self.variance)
    }

    fn put(&mut self, place: usize, atom: Atom) {
        let new = self.beside(atom);
        self.sums = self.sums.with(&self.columns, place, &new, &self.rate);
        self.columns[place] = new;
        self.atoms[place] = atom;
    }

    fn push(&mut self, atom: Atom, kind: usize) {
        self.kinds.push(kind);
        self.columns.push(self.beside(atom));
        self.atoms.push(atom);
        self.sums = Sums::of(&self.joined(), &self.rate);
    }

    fn remove(&mut self, place: usize) {
        self.sums = self.sums.without(&self.columns, place);
        self.atoms.remove(place);
        self.kinds.remove(place);
        self.columns.remove(place);
    }

    /// Constants of one atom to where the evidence is greatest.
    fn refine(&mut self, place: usize, steps: &[f64]) {
        let mut best = self.gain();
        for &step in steps {
            for _ in 0..MOVES {
                let near = self.atoms[place].neighbours(step, self.extent);
                let found = near.into_iter().map(|atom| (self.gain_with(place, atom), atom));
                let Some((gain, atom)) = found.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|each| each.0 > best) else {
                    break;
                };
                best = gain;
                self.put(place, atom);
            }
        }
    }

    /// Adds atoms until none gains enough.
    fn grow(&mut self, dictionary: &Dictionary) {
        let most = (MOST_COLUMNS * self.roots.len() as f64) as usize;
        while self.columns.iter().map(DMatrix::ncols).sum::<usize>() < most {
            let joined = self.joined();
            let chosen = if joined.ncols() > 0 { joined.qr().q() } else { joined };
            let left = &self.rate - &chosen * chosen.tr_mul(&self.rate);
            let q = side_by_side(self.own.nrows(), [&self.own, &chosen]);
            let best = dictionary.best(&q, &left, self.variance, &self.penalties);
            let Some(((atom, kind), _)) = best.filter(|each| each.1 > LEAST_GAIN) else { break };
            self.push(atom, kind);
            self.refine(self.atoms.len() - 1, &STEPS[..4]);
            if self.atoms.len().is_power_of_two() {
                (0..self.atoms.len()).for_each(|place| self.refine(place, &STEPS[1..4]));
            }
        }
        (0..self.atoms.len()).for_each(|place| self.refine(place, &STEPS[1..]));
    }

    /// Takes atoms away that others have made superfluous.
    fn prune(&mut self) {
        loop {
            let all = self.gain();
            let without = |place: usize| self.sums.without(&self.columns, place).gain(self.variance);
            let worth = |place: usize| all - without(place) - self.penalties[self.kinds[place]];
            let least = (0..self.atoms.len()).map(|place| (worth(place), place));
            let Some((_, place)) = least.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|each| each.0 < LEAST_GAIN) else {
                return;
            };
            self.remove(place);
        }
    }

    /// Columns of an atom over the samples times the prior standard deviation.
    fn part(&self, atom: Atom) -> DMatrix<f64> {
        let columns = atom.columns(self.sheet, self.extent);
        from_columns(self.roots.len(), columns) * self.variance.sqrt()
    }

    /// What else an atom may be. Where there are too many such, every second, third and so on from the likeliest on: they spread as all do.
    fn others(&self, place: usize) -> Vec<(f64, DMatrix<f64>)> {
        let (atom, best) = (self.atoms[place], self.gain());
        let near = STEPS.iter().flat_map(|&step| atom.neighbours(step, self.extent));
        let near: Vec<Atom> = near.collect();
        let near = near.into_iter().map(|atom| (self.gain_with(place, atom) - best, atom));
        let mut near: Vec<(f64, Atom)> = near.filter(|each| each.0 > -BEHIND).collect();
        near.sort_by(|a, b| b.0.total_cmp(&a.0));
        let step = (near.len() * self.atoms.len()).div_ceil(MOST_OTHERS).max(1);
        near.into_iter().step_by(step).map(|(behind, atom)| (behind, self.part(atom))).collect()
    }
}

impl Course {
    /// In what effects leave of a run's rate.
    pub fn find(run: &Seen<'_>, residual: &DVector<f64>, habits: &Habits) -> Self {
        match &habits.switching {
            Some(switching) => Self::of_switching(run, residual, switching),
            None => Self::of_atoms(run, residual, habits),
        }
    }

    fn of_atoms(run: &Seen<'_>, residual: &DVector<f64>, habits: &Habits) -> Self {
        let Seen { sheet, ties, dictionary, .. } = run;
        let roots = run.roots.clone();
        let n = roots.len();
        let rows = n + ties.len();
        let mut design = DMatrix::zeros(rows, 3);
        let mut rate = DVector::zeros(rows);
        for i in 0..n {
            (0..3).for_each(|j| design[(i, j)] = run.design[(i, j)] * roots[i]);
            rate[i] = residual[i] * roots[i];
        }
        for (i, tie) in ties.iter().enumerate() {
            design.row_mut(n + i).copy_from(&tie.row.transpose());
            rate[n + i] = tie.value;
        }
        let waves = of_waves(sheet, &habits.waves);
        let mut beside = DMatrix::zeros(rows, waves.ncols());
        (0..n).for_each(|i| beside.row_mut(i).copy_from(&(waves.row(i) * roots[i])));
        let own = side_by_side(rows, [&design, &beside]).qr().q();
        rate -= &own * own.tr_mul(&rate);
        let mean_square = rate.rows(0, n).norm_squared() / roots.norm_squared();
        let mut pursuit = Pursuit {
            sheet,
            extent: Extent::new(sheet),
            roots,
            own,
            rate,
            // Sizes are of the order of twice what there is to be explained.
            variance: 4.0 * mean_square,
            penalties: dictionary.penalties(habits),
            atoms: Vec::new(),
            kinds: Vec::new(),
            columns: Vec::new(),
            sums: Sums { gram: DMatrix::zeros(0, 0), right: DVector::zeros(0) },
        };
        pursuit.grow(dictionary);
        pursuit.prune();
        let unseen = unseen_steps(sheet, 4.0 * mean_square * habits.rates[STEP]);
        let expected = side_by_side(n, [&waves, &unseen]);
        let others = (0..pursuit.atoms.len()).map(|place| pursuit.others(place)).collect();
        let parts: Vec<DMatrix<f64>> = pursuit.atoms.iter().map(|&atom| pursuit.part(atom)).collect();
        let all = side_by_side(n, parts.iter().chain([&expected]));
        let (half, log_determinant) = half_of(&(&run.white + &all * all.transpose()));
        Self {
            log_prior: -habits.rates.iter().sum::<f64>()
                - pursuit.kinds.iter().map(|&kind| pursuit.penalties[kind]).sum::<f64>(),
            size_deg_h: mean_square.sqrt(),
            length_s: pursuit.extent.length_s,
            mean: DVector::zeros(n),
            ways: Vec::new(),
            events: pursuit.atoms.len(),
            kinds: pursuit.kinds,
            parts,
            others,
            expected,
            half,
            log_determinant,
        }
    }

    /// Of a run that has nothing but waves that all runs share.
    pub fn of_waves(run: &Seen<'_>, waves: &[SharedWave]) -> Self {
        Self::of_expected(run, of_waves(run.sheet, waves))
    }

    /// Of a run whose rate goes to and fro between two levels.
    fn of_switching(run: &Seen<'_>, residual: &DVector<f64>, switching: &Switching) -> Self {
        let ways = switching.ways(run, residual);
        let Some(Way { mean, factor, switches, log_prior, .. }) = ways.first().cloned() else {
            return Self::of_waves(run, &[]);
        };
        let size = mean.norm_squared() + factor.norm_squared();
        let size_deg_h = (size / mean.len() as f64).sqrt();
        Self { mean, size_deg_h, events: switches, log_prior, ways, ..Self::of_expected(run, factor) }
    }

    fn of_expected(run: &Seen<'_>, expected: DMatrix<f64>) -> Self {
        let (half, log_determinant) = half_of(&(&run.white + &expected * expected.transpose()));
        Self {
            log_prior: 0.0,
            size_deg_h: 0.0,
            length_s: Extent::new(run.sheet).length_s,
            mean: DVector::zeros(run.roots.len()),
            ways: Vec::new(),
            events: 0,
            kinds: Vec::new(),
            parts: Vec::new(),
            others: Vec::new(),
            expected,
            half,
            log_determinant,
        }
    }

    /// Factor of the covariance of what it does.
    pub fn factor(&self) -> DMatrix<f64> {
        side_by_side(self.half.nrows(), self.parts.iter().chain([&self.expected]))
    }

    /// Of each atom the columns of the factor that are its own, and what else it may be: log evidence less that of the best one, and its columns.
    pub fn others(&self) -> impl Iterator<Item = (Range<usize>, &[(f64, DMatrix<f64>)])> {
        self.others.iter().enumerate().map(|(place, others)| {
            let start = first_of(&self.parts, place);
            (start..start + self.parts[place].ncols(), others.as_slice())
        })
    }
}

/// Columns of waves times their prior standard deviations.
fn of_waves(sheet: &Sheet, waves: &[SharedWave]) -> DMatrix<f64> {
    let extent = Extent::new(sheet);
    let parts: Vec<DMatrix<f64>> = waves
        .iter()
        .map(|wave| from_columns(sheet.samples.len(), wave.atom(extent).columns(sheet, extent)) * wave.variance.sqrt())
        .collect();
    side_by_side(sheet.samples.len(), &parts)
}

/// Steps between samples that do not follow one another. One happens there with a probability in proportion to the time between; its
/// size then has a variance of which `variance` is what a run as a whole has.
fn unseen_steps(sheet: &Sheet, variance: f64) -> DMatrix<f64> {
    let (spans, length_s) = (&sheet.samples.spans, Extent::new(sheet).length_s);
    let steps = spans.windows(2).enumerate().filter(|(_, pair)| pair[1][0] > pair[0][1]).map(|(place, pair)| {
        let size = (variance * (pair[1][0] - pair[0][1]) / length_s).sqrt();
        (0..spans.len()).map(|i| if i > place { size } else { 0.0 }).collect::<Vec<f64>>()
    });
    from_columns(spans.len(), steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open_world::evidence::posterior;

    /// Sums that are kept are those of all columns anew, and their gain is that of the posterior.
    #[test]
    fn sums_are_kept_from_move_to_move() {
        let column = |of: f64| DMatrix::from_fn(9, 1, |i, _| (of * (1.0 + i as f64)).sin());
        let pair = |of: f64| side_by_side(9, [&column(of), &column(1.7 * of)]);
        let rate = DVector::from_fn(9, |i, _| (0.4 * i as f64).cos());
        let mut columns = vec![column(0.3), pair(0.5), column(0.9)];
        let kept = Sums::of(&side_by_side(9, &columns), &rate).with(&columns, 1, &pair(0.7), &rate);
        columns[1] = pair(0.7);
        let kept = kept.without(&columns, 0);
        columns.remove(0);
        let anew = Sums::of(&side_by_side(9, &columns), &rate);
        assert!((&kept.gram - &anew.gram).norm() < 1e-12 && (&kept.right - &anew.right).norm() < 1e-12);
        assert!((kept.gain(2.0) - posterior(&anew.gram, &anew.right, &[2.0; 3]).gain).abs() < 1e-12);
    }
}
