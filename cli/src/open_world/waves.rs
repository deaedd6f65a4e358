//! Sinusoids that all runs share, each at a phase and with a size of the run's own.

use nalgebra::DVector;
use rayon::prelude::*;

use super::atom::{CHANGES, Extent, MOST_CHANGE, MOST_FREQUENCY};
use super::columns::from_columns;
use super::course::Course;
use super::evidence::posterior;
use super::habits::SharedWave;
use super::run::Run;

/// Frequencies in cycles over the longest run: the least (of slower ones nobody can say that runs share them), and how far apart.
const LEAST_CYCLES: f64 = 1.5;
const CYCLES: f64 = 0.3;
/// Steps by which both are refined, cycles and shares; and moves with each.
const STEPS: [f64; 5] = [0.1, 0.04, 0.015, 0.006, 0.002];
const MOVES: usize = 8;
/// Log evidence, beyond what the choice costs, that a wave must gain.
const LEAST_GAIN: f64 = 6.0;
/// Most waves.
const MOST: usize = 4;

/// Looks for waves in what effects leave of runs, one beside the other, by the evidence of all runs together.
pub fn find(runs: &[Run<'_>], effects: &[DVector<f64>], variances: &[f64]) -> Vec<SharedWave> {
    let search = WaveSearch { runs, effects, variances };
    let mut found: Vec<SharedWave> = Vec::new();
    while found.len() < MOST {
        let Some(wave) = search.best(&search.courses(&found)) else { break };
        found.push(wave);
        // Those before were found without it.
        for place in 0..found.len() - 1 {
            let mut others = found.clone();
            let wave = others.remove(place);
            found[place] = search.refined(&search.courses(&others), wave).1;
        }
    }
    found
}

struct WaveSearch<'a> {
    runs: &'a [Run<'a>],
    effects: &'a [DVector<f64>],
    variances: &'a [f64],
}

impl WaveSearch<'_> {
    /// The runs with these waves in them.
    fn courses(&self, waves: &[SharedWave]) -> Vec<Course> {
        self.runs.par_iter().map(|run| Course::of_waves(&run.seen(true), waves)).collect()
    }

    fn longest_s(&self) -> f64 {
        self.runs.iter().map(|run| Extent::new(&run.sheet).length_s).fold(1.0, f64::max)
    }

    /// The wave that gains most, if it gains enough.
    fn best(&self, courses: &[Course]) -> Option<SharedWave> {
        let longest_s = self.longest_s();
        let samples = self.runs.iter().map(|run| run.rate.len()).max().unwrap_or(0) as f64;
        let cycles = (0..).map(|number| LEAST_CYCLES + CYCLES * f64::from(number));
        let frequencies_hz =
            cycles.take_while(|cycles| *cycles < MOST_FREQUENCY * samples).map(|cycles| cycles / longest_s);
        let all: Vec<SharedWave> = frequencies_hz
            .flat_map(|frequency_hz| CHANGES.map(|change| SharedWave { frequency_hz, change, variance: 0.0 }))
            .collect();
        let found = all.par_iter().map(|wave| self.gain(courses, *wave)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (gain, wave) = self.refined(courses, found.1);
        (gain - (all.len() as f64).ln() > LEAST_GAIN).then_some(wave)
    }

    /// Frequency and change to where the evidence is greatest.
    fn refined(&self, courses: &[Course], wave: SharedWave) -> (f64, SharedWave) {
        let longest_s = self.longest_s();
        let mut best = self.gain(courses, wave);
        for step in STEPS {
            for _ in 0..MOVES {
                let SharedWave { frequency_hz, change, .. } = best.1;
                // A change counts by the cycles that it shifts the ends by.
                let (step_hz, of_change) = (step / longest_s, 8.0 * step / (frequency_hz * longest_s).max(1.0));
                let near =
                    [(-step_hz, 0.0), (step_hz, 0.0), (0.0, -of_change), (0.0, of_change)].map(|(hz, of_change)| {
                        SharedWave { frequency_hz: frequency_hz + hz, change: change + of_change, ..wave }
                    });
                let is_wave = |near: &&SharedWave| {
                    near.frequency_hz * longest_s >= LEAST_CYCLES && near.change.abs() <= MOST_CHANGE
                };
                let tried = near.par_iter().filter(is_wave).map(|near| self.gain(courses, *near));
                let Some(found) = tried.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|found| found.0 > best.0) else {
                    break;
                };
                best = found;
            }
        }
        best
    }

    /// Log evidence that a wave gains beside what is known of the runs, and the wave with the prior variance for which it is greatest.
    fn gain(&self, courses: &[Course], wave: SharedWave) -> (f64, SharedWave) {
        let sums: Vec<_> = self
            .runs
            .iter()
            .zip(self.effects)
            .zip(courses)
            .map(|((run, effect), course)| {
                let extent = Extent::new(&run.sheet);
                let mut columns = wave.atom(extent).columns(&run.sheet, extent);
                columns.push(effect.as_slice().to_vec());
                let columns = from_columns(run.rate.len(), columns);
                let (gram, right) = run.beside_course(course).sums(&columns);
                let right = DVector::from_fn(2, |i, _| right[i] - gram[(i, 2)]);
                (gram.view((0, 0), (2, 2)).into_owned(), right)
            })
            .collect();
        let of = |&variance: &f64| {
            let gain = sums.iter().map(|(gram, right)| posterior(gram, right, &[variance; 2]).gain).sum::<f64>();
            (gain, SharedWave { variance, ..wave })
        };
        self.variances.iter().map(of).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, wave))
    }
}
