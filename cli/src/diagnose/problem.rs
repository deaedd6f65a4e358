//! Runs side by side: the global residual, and what candidates look like beside every run's own unknowns.

use super::block::Block;
use super::candidate::{Candidate, Columns};
use super::learned::Taken;
use super::statistics::{dot, orthonormalise, subtract};

/// Seconds that are averaged for the test whether what is left is white.
pub const BLOCK_SAMPLES: usize = 12;

/// A candidate, by its place among all of them, with its constant.
pub type Chosen = (usize, f64);

/// Runs side by side.
pub struct Problem<'a> {
    pub blocks: Vec<Block<'a>>,
    y: Vec<f64>,
}

impl<'a> Problem<'a> {
    pub fn new(blocks: Vec<Block<'a>>) -> Self {
        let y = blocks.iter().flat_map(|block| block.project(&block.y)).collect();
        Self { blocks, y }
    }

    /// The residual of all runs, their own unknowns taken out; in units of its noise.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    pub fn rows(&self) -> usize {
        self.y.len()
    }

    /// The rows of a block in the layout of [`Self::y`].
    pub fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.blocks.iter().scan(0, |start, block| {
            let range = *start..*start + block.y.len();
            *start = range.end;
            Some(range)
        })
    }

    /// Weighted columns of a candidate over all runs.
    pub fn weighted(&self, candidate: &Candidate, constant: f64) -> Columns {
        self.gather(candidate, constant, |_, column| column)
    }

    /// The same beside every run's own unknowns.
    pub fn projected(&self, candidate: &Candidate, constant: f64) -> Columns {
        self.gather(candidate, constant, |block, column| block.project(&column))
    }

    fn gather(&self, candidate: &Candidate, constant: f64, map: impl Fn(&Block, Vec<f64>) -> Vec<f64>) -> Columns {
        let mut all: Columns = vec![Vec::with_capacity(self.y.len()); candidate.coefficients()];
        for block in &self.blocks {
            let columns = candidate.columns(block.run, constant, &block.smooth_deg_h, block.azimuth_deg);
            for (whole, column) in all.iter_mut().zip(block.weighted(&columns)) {
                whole.extend(map(block, column));
            }
        }
        all
    }

    /// An orthonormal basis of what the chosen candidates span.
    pub fn basis(&self, candidates: &[Candidate], chosen: &[Chosen]) -> Vec<Vec<f64>> {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for &(index, constant) in chosen {
            let new = orthonormalise(&basis, self.projected(&candidates[index], constant));
            basis.extend(new);
        }
        basis
    }

    /// What a basis leaves of the residual.
    pub fn left(&self, basis: &[Vec<f64>]) -> Vec<f64> {
        let mut left = self.y.clone();
        for each in basis {
            let along = dot(&left, each);
            subtract(&mut left, along, each);
        }
        left
    }

    /// Sum of squares of means over blocks of seconds inside dwells, over its degrees of freedom: 1 for white noise. And
    /// these.
    pub fn overdispersion(&self, left: &[f64], taken: usize) -> (f64, f64) {
        let (sum, freedom) =
            self.dispersions(left).into_iter().fold((0.0, -(taken as f64)), |all, run| (all.0 + run.0, all.1 + run.1));
        if freedom >= 3.0 { (sum / freedom, freedom) } else { (1.0, 0.0) }
    }

    /// Of every run: sum of squares of means over blocks of seconds inside dwells, in units of white noise, and its degrees of freedom.
    pub fn dispersions(&self, left: &[f64]) -> Vec<(f64, f64)> {
        self.blocks.iter().zip(self.ranges()).map(|(block, range)| dispersion(block, &left[range])).collect()
    }

    /// Errors of the runs' own azimuths against their references when these effects are taken out: errors and sigmas.
    pub fn azimuth_errors(&self, effects: &[f64]) -> Vec<Option<(f64, f64)>> {
        let of = |(block, range): (&Block, std::ops::Range<usize>)| {
            block.azimuth_error_deg(&effects[range]).filter(|_| block.tied)
        };
        self.blocks.iter().zip(self.ranges()).map(of).collect()
    }

    /// Weighted sum of effects in the layout of the residual.
    pub fn effects(&self, taken: &[Taken]) -> Vec<f64> {
        let mut sum = vec![0.0; self.y.len()];
        for each in taken {
            for (column, coefficient) in self.weighted(&each.candidate, each.constant).iter().zip(&each.coefficients) {
                subtract(&mut sum, -coefficient, column);
            }
        }
        sum
    }

    /// Looks at every run anew about these effects.
    pub fn linearise(&mut self, taken: &[Taken]) {
        for block in &mut self.blocks {
            let mut sum = vec![0.0; block.run.samples.len()];
            for each in taken {
                let columns = each.candidate.columns(block.run, each.constant, &block.smooth_deg_h, block.azimuth_deg);
                for (column, coefficient) in columns.iter().zip(&each.coefficients) {
                    subtract(&mut sum, -coefficient, column);
                }
            }
            block.linearise(&sum);
        }
    }

    /// Share of a candidate's weight that only the surveyed headings give.
    pub fn by_references(&self, candidate: &Candidate, constant: f64) -> f64 {
        let (mut tied, mut free) = (0.0, 0.0);
        for block in &self.blocks {
            let columns = candidate.columns(block.run, constant, &block.smooth_deg_h, block.azimuth_deg);
            for column in block.weighted(&columns) {
                let left = block.project(&column);
                tied += dot(&left, &left);
                let left = block.project_free(&column);
                free += dot(&left, &left);
            }
        }
        if tied > 0.0 { 1.0 - free / tied } else { 0.0 }
    }
}

/// Sum of squares of means over blocks of seconds inside dwells, in units of white noise, and its degrees of freedom.
fn dispersion(block: &Block, left: &[f64]) -> (f64, f64) {
    let (mut sum, mut count) = (0.0, 0.0);
    let (mut total, mut number, mut dwell) = (0.0, 0.0, usize::MAX);
    let mut flush = |total: &mut f64, number: &mut f64| {
        if *number > 0.0 {
            sum += *total * *total / *number;
            count += 1.0;
        }
        (*total, *number) = (0.0, 0.0);
    };
    for ((sample, weight), value) in block.run.samples.iter().zip(&block.root_weight).zip(left) {
        if sample.dwell != dwell || number >= BLOCK_SAMPLES as f64 {
            flush(&mut total, &mut number);
            dwell = sample.dwell;
        }
        if *weight > 0.0 {
            total += value;
            number += 1.0;
        }
    }
    flush(&mut total, &mut number);
    (sum, count - block.own_unknowns())
}
