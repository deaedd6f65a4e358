//! Proposals by the thousand, judged by a score: which are worth an exact look.

use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use rayon::prelude::*;

use super::functions::{Functions, Library, Values, functions, key};
use super::grammar::Grammar;
use super::rows::Run;

/// Rows of one run by which products are judged: means over some seconds; what stands alone is judged by every row.
const COARSE_ROWS: usize = 48;

/// All rows of all runs, one after the other: of functions, weights, precisions.
struct Rows {
    /// Where each run ends.
    ends: Vec<usize>,
    precision: Vec<f32>,
}

impl Rows {
    fn new(runs: &[Run]) -> Self {
        let ends = runs
            .iter()
            .scan(0, |end, run| {
                *end += run.rows();
                Some(*end)
            })
            .collect();
        let precision =
            runs.iter().flat_map(|run| run.variance.iter().map(|variance| 1.0 / *variance as f32)).collect();
        Self { ends, precision }
    }

    /// The same of coarse rows.
    fn coarse(runs: &[Run]) -> Self {
        let of_run = |run: &Run| -> Vec<f32> {
            let sum =
                |rows: std::ops::Range<usize>| run.variance[rows].iter().map(|variance| 1.0 / *variance as f32).sum();
            run.coarse(COARSE_ROWS).into_iter().map(sum).collect()
        };
        let by_run: Vec<Vec<f32>> = runs.iter().map(of_run).collect();
        let ends = by_run
            .iter()
            .scan(0, |end, run| {
                *end += run.len();
                Some(*end)
            })
            .collect();
        Self { ends, precision: by_run.concat() }
    }

    /// About what the evidence would gain by a column: score²/information, information that of white noise with every run's mean taken out. At
    /// the best size the gain is half of ratio − 1 − ln ratio.
    fn gain(&self, column: impl Fn(usize) -> f32, weighed: &[f32]) -> f64 {
        let (mut score, mut information, mut first) = (0.0f64, 0.0f64, 0);
        for &end in &self.ends {
            let (mut sum, mut weight, mut square, mut right) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
            for (row, weighed) in weighed.iter().enumerate().take(end).skip(first) {
                let (value, precision) = (column(row), self.precision[row]);
                let heavy = value * precision;
                sum += heavy;
                weight += precision;
                square += value * heavy;
                right += value * weighed;
            }
            first = end;
            score += f64::from(right);
            information += f64::from((square - sum * sum / weight).max(0.0));
        }
        let ratio = if information > 0.0 { score * score / information } else { 0.0 };
        if ratio > 1.0 { 0.5 * (ratio - 1.0 - ratio.ln()) } else { 0.0 }
    }
}

/// A port and the numbers of factors in the bank.
struct Proposal {
    effect: Effect,
    cost: f64,
    factors: Vec<usize>,
}

/// All proposals.
pub struct Bank {
    rows: Rows,
    coarse: Rows,
    /// By port: what the rate of a row changes by.
    gains: Vec<(Port, Vec<f32>, Vec<f32>)>,
    /// Functions of the factors in rows and in coarse rows.
    fine_functions: Vec<Functions>,
    coarse_functions: Vec<Functions>,
    proposals: Vec<Proposal>,
    /// Rows of every coarse row.
    coarse_rows: Vec<std::ops::Range<usize>>,
    pub library: Library,
}

impl Bank {
    pub fn new(runs: &[Run], grammar: &Grammar, factors: &[Factor], gates: &[Factor]) -> Self {
        let mut first = 0;
        let mut coarse_rows = Vec::new();
        for run in runs {
            coarse_rows.extend(run.coarse(COARSE_ROWS).into_iter().map(|rows| rows.start + first..rows.end + first));
            first += run.rows();
        }
        let means = |fine: &[f32]| -> Vec<f32> {
            coarse_rows.iter().map(|rows| fine[rows.clone()].iter().sum::<f32>() / rows.len() as f32).collect()
        };
        let gains = Port::ALL
            .into_iter()
            .map(|port| {
                let fine: Vec<f32> = runs.iter().flat_map(|run| run.gains(port)).map(|gain| gain as f32).collect();
                let coarse = means(&fine);
                (port, fine, coarse)
            })
            .collect();
        let fine_functions: Vec<Functions> = factors.par_iter().map(|factor| functions(runs, factor)).collect();
        let is_gate: Vec<bool> = factors.iter().map(|factor| gates.contains(factor)).collect();
        let coarse_of = |(functions, is_gate): (&Functions, &bool)| -> Functions {
            if *is_gate { functions.iter().map(|f| means(f)).collect() } else { Vec::new() }
        };
        let coarse_functions = fine_functions.iter().zip(&is_gate).map(coarse_of).collect();
        let gate_numbers: Vec<usize> = (0..factors.len()).filter(|&i| is_gate[i]).collect();
        let singles = (0..factors.len()).map(|i| vec![i]);
        let pairs =
            gate_numbers.iter().enumerate().flat_map(|(n, &i)| gate_numbers[..n].iter().map(move |&j| vec![i, j]));
        let all: Vec<Vec<usize>> = std::iter::once(Vec::new()).chain(singles).chain(pairs).collect();
        let ports = |factors: &[usize]| -> &[Port] {
            match factors.len() {
                0 => &[Port::Scale, Port::Index],
                1 => &Port::ALL,
                _ => &[Port::Rate, Port::Scale, Port::Index],
            }
        };
        let proposals = all
            .iter()
            .flat_map(|numbers| ports(numbers).iter().map(move |&port| (port, numbers)))
            .filter_map(|(port, numbers)| {
                let factors: Vec<Factor> = numbers.iter().map(|&i| factors[i].clone()).collect();
                let effect = Effect::new(port, &factors);
                effect.validate().ok()?;
                Some(Proposal { cost: grammar.cost(&effect), effect, factors: numbers.clone() })
            })
            .collect();
        let known = factors.iter().map(key).zip(fine_functions.iter().cloned()).collect();
        let library = Library::new(runs, known);
        Self {
            rows: Rows::new(runs),
            coarse: Rows::coarse(runs),
            gains,
            fine_functions,
            coarse_functions,
            proposals,
            coarse_rows,
            library,
        }
    }

    /// How many proposals there are.
    pub fn len(&self) -> usize {
        self.proposals.len()
    }

    /// The effects that promise most, the first of them first. `weighed`: V⁻¹ times what is left of the residual, by the row.
    pub fn shortlist(&self, weighed: &[f64], most: usize) -> Vec<&Effect> {
        let fine: Vec<f32> = weighed.iter().map(|value| *value as f32).collect();
        let coarse: Vec<f32> =
            self.coarse_rows.iter().map(|rows| weighed[rows.clone()].iter().sum::<f64>() as f32).collect();
        let mut scored: Vec<(f64, &Effect)> = self
            .proposals
            .par_iter()
            .map(|each| (self.score(each, &fine, &coarse) - each.cost, &each.effect))
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        scored.truncate(most);
        scored.into_iter().map(|(_, effect)| effect).collect()
    }

    fn score(&self, proposal: &Proposal, fine: &[f32], coarse: &[f32]) -> f64 {
        let (_, of_fine, of_coarse) =
            self.gains.iter().find(|(port, ..)| *port == proposal.effect.port).unwrap_or(&self.gains[0]);
        match proposal.factors.as_slice() {
            [] => self.rows.gain(|row| of_fine[row], fine),
            [i] => self.fine_functions[*i].iter().map(|f| self.rows.gain(|row| of_fine[row] * f[row], fine)).sum(),
            [i, j, ..] => {
                let (a, b) = (&self.coarse_functions[*i], &self.coarse_functions[*j]);
                let products = a.iter().flat_map(|f| b.iter().map(move |g| (f, g)));
                products.map(|(f, g)| self.coarse.gain(|row| of_coarse[row] * f[row] * g[row], coarse)).sum()
            }
        }
    }

    /// About what an effect that is not in the bank would gain.
    pub fn promise(&self, values: &Values, weighed: &[f64]) -> f64 {
        let fine: Vec<f32> = weighed.iter().map(|value| *value as f32).collect();
        values.iter().map(|column| self.rows.gain(|row| column[row] as f32, &fine)).sum()
    }
}
