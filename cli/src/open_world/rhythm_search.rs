//! The search for a rhythm: its period, its form and every run's phase together, by the evidence.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::columns::{Columns, side_by_side};
use super::evidence::{best_variance, posterior};
use super::rhythm::{Rhythm, orders};
use super::run::Run;

/// Periods: the longest as a share of the longest run, how far apart in cycles over it, samples in the shortest.
const LONGEST: f64 = 2.5;
const CYCLES: f64 = 0.15;
const SAMPLES_OF_PERIOD: f64 = 1.5;
/// Harmonics at first sight, how many periods are refined with these, and how many then looked at with all of them.
const FIRST_ORDERS: usize = 5;
const PEAKS: usize = 6;
const LOOKS: usize = 3;
const SMOOTHNESS: [i32; 3] = [0, 1, 2];
const BEGINS_S: [Option<f64>; 5] = [None, Some(6.0), Some(14.0), Some(32.0), Some(75.0)];
/// Phases that a run is aligned among; rounds in which runs are aligned with the others; halvings of the last step.
const PHASES: usize = 48;
const ROUNDS: usize = 4;
const HALVINGS: usize = 5;
/// Runs that the alignment begins with, one at a time.
const SEEDS: usize = 2;
/// Steps by which the constants are refined: cycles over the longest run, and shares of the time constant.
const STEPS: [f64; 4] = [0.05, 0.02, 0.01, 0.004];
const OF_TIME: f64 = 4.0;
const MOVES: usize = 6;

/// Gram matrix and right side of a run's columns at phase 0.
type Sums = (DMatrix<f64>, DVector<f64>);

/// A rhythm with the phase of every run.
#[derive(Clone, Debug)]
pub struct Found {
    pub rhythm: Rhythm,
    pub phases: Vec<f64>,
    /// Log evidence of the form with these phases.
    pub gain: f64,
    /// What the choice of phases and constants costs.
    pub cost: f64,
}

impl Found {
    pub fn worth(&self) -> f64 {
        self.gain - self.cost
    }
}

/// Looks for rhythms in what effects leave of runs.
pub struct Finder<'a> {
    pub runs: &'a [Run<'a>],
    /// What is known already, by the sample.
    pub effects: &'a [DVector<f64>],
    /// Prior variances that a form may have.
    pub variances: &'a [f64],
}

impl Finder<'_> {
    /// The rhythm that the evidence speaks for most.
    pub fn find(&self) -> Option<Found> {
        let frequencies = self.frequencies_hz();
        let look = |&hz: &f64| {
            let period_s = 1.0 / hz;
            let rhythm = Rhythm { period_s, smoothness: 1, begins_s: None, orders: orders(period_s).min(FIRST_ORDERS) };
            self.aligned(rhythm)
        };
        let looked: Vec<Found> = frequencies.par_iter().map(look).collect();
        let worth = |place: usize| looked.get(place).map_or(f64::NEG_INFINITY, Found::worth);
        let is_peak =
            |&place: &usize| worth(place) >= worth(place + 1) && (place == 0 || worth(place) > worth(place - 1));
        let mut peaks: Vec<usize> = (0..looked.len()).filter(is_peak).collect();
        peaks.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)));
        let mut looked: Vec<Found> =
            peaks.iter().take(PEAKS).map(|&place| self.refined(looked[place].clone())).collect();
        looked.sort_by(|a, b| b.worth().total_cmp(&a.worth()));
        looked.truncate(LOOKS);
        let forms = |found: &Found| {
            let period_s = found.rhythm.period_s;
            let forms = SMOOTHNESS.into_iter().flat_map(|smoothness| BEGINS_S.map(|begins_s| (smoothness, begins_s)));
            let of = |(smoothness, begins_s)| Rhythm { period_s, smoothness, begins_s, orders: orders(period_s) };
            forms.map(of).collect::<Vec<_>>()
        };
        let all: Vec<Rhythm> = looked.iter().flat_map(forms).collect();
        let tried: Vec<Found> = all.par_iter().map(|&rhythm| self.aligned(rhythm)).collect();
        let best = tried.into_iter().max_by(|a, b| a.worth().total_cmp(&b.worth()))?;
        let mut found = self.refined(best);
        found.cost += ((frequencies.len() * SMOOTHNESS.len() * BEGINS_S.len()) as f64).ln();
        Some(found)
    }

    fn longest_s(&self) -> f64 {
        let length_s = |run: &Run| {
            let spans = &run.sheet.samples.spans;
            spans.last().map_or(1.0, |last| last[1]) - spans.first().map_or(0.0, |first| first[0])
        };
        self.runs.iter().map(length_s).fold(1.0, f64::max)
    }

    fn frequencies_hz(&self) -> Vec<f64> {
        let longest_s = self.longest_s();
        let samples = self.runs.iter().map(|run| run.rate.len()).max().unwrap_or(0) as f64;
        let most = samples / SAMPLES_OF_PERIOD;
        (0..)
            .map(|number| 1.0 / LONGEST + CYCLES * f64::from(number))
            .take_while(|cycles| *cycles < most)
            .map(|cycles| cycles / longest_s)
            .collect()
    }

    /// Of every run, beside its own unknowns.
    fn sums(&self, rhythm: &Rhythm) -> Vec<Sums> {
        let of_run = |(run, effect): (&Run, &DVector<f64>)| {
            let columns: Columns = rhythm.columns(&run.sheet, 0.0);
            let width = columns.ncols();
            let effect = DMatrix::from_columns(std::slice::from_ref(effect));
            let (gram, right) = run.beside(0, 1.0).sums(&side_by_side(columns.nrows(), [&columns, &effect]));
            let left = right.rows(0, width) - gram.view((0, width), (width, 1)).column(0);
            (gram.view((0, 0), (width, width)).into_owned(), left)
        };
        self.runs.iter().zip(self.effects).map(of_run).collect()
    }

    /// With the phases that fit together: beginning with each of some runs that show most.
    fn aligned(&self, rhythm: Rhythm) -> Found {
        let alignment = Alignment { rhythm, sums: self.sums(&rhythm), variances: self.variances };
        let mut order: Vec<(f64, usize)> = alignment
            .sums
            .iter()
            .enumerate()
            .map(|(run, sums)| (best_variance(&sums.0, &sums.1, self.variances).0, run))
            .collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        let order: Vec<usize> = order.into_iter().map(|each| each.1).collect();
        let from = |seed: usize| alignment.settled(alignment.begun(&order, seed));
        let found = (0..SEEDS.min(order.len())).map(from).max_by(|a, b| a.worth().total_cmp(&b.worth()));
        found.unwrap_or(Found { rhythm, phases: Vec::new(), gain: 0.0, cost: f64::INFINITY })
    }

    /// The constants to where the evidence is greatest, from phases that are nearly right.
    fn refined(&self, mut best: Found) -> Found {
        let longest_s = self.longest_s();
        for step in STEPS {
            for _ in 0..MOVES {
                let rhythm = best.rhythm;
                let of_hz = [-step, step]
                    .map(|step| Rhythm { period_s: 1.0 / (1.0 / rhythm.period_s + step / longest_s), ..rhythm });
                let of_time = [1.0 + OF_TIME * step, 1.0 / (1.0 + OF_TIME * step)]
                    .map(|factor| Rhythm { begins_s: rhythm.begins_s.map(|time_s| time_s * factor), ..rhythm });
                let near: Vec<Rhythm> =
                    of_hz.into_iter().chain(of_time.into_iter().filter(|_| rhythm.begins_s.is_some())).collect();
                let tried: Vec<Found> = near
                    .into_par_iter()
                    .filter(|near| near.period_s > 0.0)
                    .map(|rhythm| {
                        let alignment = Alignment { rhythm, sums: self.sums(&rhythm), variances: self.variances };
                        alignment.settled(best.phases.clone())
                    })
                    .collect();
                let Some(found) = tried
                    .into_iter()
                    .max_by(|a, b| a.worth().total_cmp(&b.worth()))
                    .filter(|found| found.worth() > best.worth())
                else {
                    break;
                };
                best = found;
            }
        }
        best
    }
}

/// The runs' phases under constants that are given.
struct Alignment<'a> {
    rhythm: Rhythm,
    sums: Vec<Sums>,
    variances: &'a [f64],
}

impl Alignment<'_> {
    /// Sums of a run as at a phase.
    fn at(&self, run: usize, phase: f64) -> Sums {
        let (gram, right) = &self.sums[run];
        let half = self.rhythm.turn(gram, phase);
        let turned = self.rhythm.turn(&half.transpose(), phase);
        let right = self.rhythm.turn(&DMatrix::from_row_slice(1, right.len(), right.as_slice()), phase);
        (turned, DVector::from_iterator(right.ncols(), right.iter().copied()))
    }

    fn mean(&self, (gram, right): &Sums) -> DVector<f64> {
        let (_, variance) = best_variance(gram, right, self.variances);
        posterior(gram, right, &vec![variance; right.len()]).mean
    }

    /// Log-likelihood of a run at a phase by weights, more than without them.
    fn log_likelihood(&self, run: usize, weights: &DVector<f64>, phase: f64) -> f64 {
        let turned = self.rhythm.turned(weights, phase);
        let (gram, right) = &self.sums[run];
        right.dot(&turned) - 0.5 * turned.dot(&(gram * &turned))
    }

    /// The phase that is likeliest by weights that others have taught.
    fn best_phase(&self, run: usize, weights: &DVector<f64>) -> f64 {
        let of = |phase: f64| (self.log_likelihood(run, weights, phase), phase);
        let step = 1.0 / PHASES as f64;
        let best = (0..PHASES).map(|number| of(number as f64 * step)).max_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = best.unwrap_or((0.0, 0.0));
        let mut step = step;
        for _ in 0..HALVINGS {
            step *= 0.5;
            for other in [of(best.1 - step), of(best.1 + step)] {
                if other.0 > best.0 {
                    best = other;
                }
            }
        }
        best.1
    }

    /// One run after the other aligned with those before, beginning with one.
    fn begun(&self, order: &[usize], seed: usize) -> Vec<f64> {
        let mut phases = vec![0.0; self.sums.len()];
        let mut all = self.sums[order[seed]].clone();
        for &run in order.iter().filter(|&&run| run != order[seed]) {
            phases[run] = self.best_phase(run, &self.mean(&all));
            let own = self.at(run, phases[run]);
            all.0 += own.0;
            all.1 += own.1;
        }
        phases
    }

    /// Every run aligned with all others, until they agree.
    fn settled(&self, mut phases: Vec<f64>) -> Found {
        let mut own: Vec<Sums> = (0..phases.len()).map(|run| self.at(run, phases[run])).collect();
        let mut all = own.iter().skip(1).fold(own[0].clone(), |sum, each| (sum.0 + &each.0, sum.1 + &each.1));
        for _ in 0..ROUNDS {
            let mut moved = false;
            for run in 0..phases.len() {
                let others = (&all.0 - &own[run].0, &all.1 - &own[run].1);
                let phase = self.best_phase(run, &self.mean(&others));
                moved |= (phase - phases[run] + 0.5).rem_euclid(1.0) - 0.5 != 0.0;
                phases[run] = phase;
                own[run] = self.at(run, phase);
                all = (others.0 + &own[run].0, others.1 + &own[run].1);
            }
            if !moved {
                break;
            }
        }
        let (gain, _) = best_variance(&all.0, &all.1, self.variances);
        let weights = self.mean(&all);
        let cost = (0..phases.len()).map(|run| self.cost_of_phase(run, &weights, phases[run])).sum();
        Found { rhythm: self.rhythm, phases, gain, cost }
    }

    /// Logarithm of one over the mean likelihood of all phases in units of the greatest.
    fn cost_of_phase(&self, run: usize, weights: &DVector<f64>, phase: f64) -> f64 {
        // A narrow peak stands between the phases of a coarse grid.
        let number = 4 * PHASES;
        let of = |i: usize| self.log_likelihood(run, weights, phase + i as f64 / number as f64);
        let all: Vec<f64> = (0..number).map(of).collect();
        let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        -(all.iter().map(|each| (each - most).exp()).sum::<f64>() / number as f64).ln()
    }
}
