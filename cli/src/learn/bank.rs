//! Proposals by the thousand, judged by a score: which are worth an exact look.

use std::ops::Range;

use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use rayon::prelude::*;

use super::functions::{Functions, Library};
use super::grammar::Grammar;
use super::rows::Run;

/// Rows of one run by which products are judged: means over some seconds; what stands alone is judged by every row.
const COARSE_ROWS: usize = 48;
/// Numbers that are added up side by side: what a processor's vector holds.
const LANES: usize = 8;

/// All rows of all runs, one after the other: where each run ends, and the precision of every row.
struct Rows {
    ends: Vec<usize>,
    precision: Vec<f32>,
}

impl Rows {
    fn new(by_run: Vec<Vec<f32>>) -> Self {
        let ends = by_run
            .iter()
            .scan(0, |end, run| {
                *end += run.len();
                Some(*end)
            })
            .collect();
        Self { ends, precision: by_run.concat() }
    }

    /// The information that a column has of its weight in white noise with every run's mean taken out.
    fn information(&self, column: &[f32]) -> f32 {
        let mut first = 0;
        let of_run = |&end: &usize| {
            let (column, precision) = (&column[first..end], &self.precision[first..end]);
            first = end;
            let sum = dot(column, precision);
            triple(column, column, precision) - sum * sum / precision.iter().sum::<f32>()
        };
        self.ends.iter().map(of_run).map(|information| information.max(0.0)).sum()
    }
}

/// About what the evidence gains by a column at its best size: half of ratio − 1 − ln ratio, the ratio that of the square of its score to its
/// information.
fn gain(score: f32, information: f32) -> f64 {
    let ratio = if information > 0.0 { f64::from(score).powi(2) / f64::from(information) } else { 0.0 };
    if ratio > 1.0 { 0.5 * (ratio - 1.0 - ratio.ln()) } else { 0.0 }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    let (a, b) = (a.chunks(LANES), b.chunks(LANES));
    a.zip(b).for_each(|(a, b)| sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b));
    sums.iter().sum()
}

fn triple(a: &[f32], b: &[f32], c: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    let chunks = a.chunks(LANES).zip(b.chunks(LANES)).zip(c.chunks(LANES));
    chunks.for_each(|((a, b), c)| {
        sums.iter_mut().zip(a.iter().zip(b).zip(c)).for_each(|(sum, ((a, b), c))| *sum += a * b * c);
    });
    sums.iter().sum()
}

fn product(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// An effect of the bank: the numbers of its factors, what its form costs, the information of each of its columns.
struct Proposal {
    effect: Effect,
    cost: f64,
    factors: Vec<usize>,
    information: Vec<f32>,
}

/// All proposals.
pub struct Bank {
    rows: Rows,
    coarse: Rows,
    /// By port: what the rate of a row changes by, of rows and of coarse rows.
    gains: Vec<(Port, Vec<f32>, Vec<f32>)>,
    /// Functions of the factors in rows and, of those that stand in products, in coarse rows.
    fine_functions: Vec<Functions>,
    coarse_functions: Vec<Functions>,
    proposals: Vec<Proposal>,
    /// Rows of every coarse row.
    coarse_rows: Vec<Range<usize>>,
    pub library: Library,
}

impl Bank {
    pub fn new(runs: &[Run], grammar: &Grammar, factors: &[Factor], gates: &[Factor]) -> Self {
        let library = Library::new(runs);
        let mut first = 0;
        let mut coarse_rows = Vec::new();
        let mut coarse_precision = Vec::new();
        let precision = |run: &Run, rows: Range<usize>| run.variance[rows].iter().map(|v| 1.0 / *v as f32).sum::<f32>();
        for run in runs {
            let coarse = run.coarse(COARSE_ROWS);
            coarse_precision.push(coarse.iter().map(|rows| precision(run, rows.clone())).collect());
            coarse_rows.extend(coarse.into_iter().map(|rows| rows.start + first..rows.end + first));
            first += run.rows();
        }
        let rows =
            Rows::new(runs.iter().map(|run| (0..run.rows()).map(|i| precision(run, i..i + 1)).collect()).collect());
        let coarse = Rows::new(coarse_precision);
        let means = |fine: &[f32]| means(&coarse_rows, fine);
        let gains: Vec<(Port, Vec<f32>, Vec<f32>)> = Port::ALL
            .into_iter()
            .map(|port| {
                let fine: Vec<f32> = runs.iter().flat_map(|run| run.gains(port)).map(|gain| gain as f32).collect();
                let coarse = means(&fine);
                (port, fine, coarse)
            })
            .collect();
        let fine_functions: Vec<Functions> = factors.par_iter().map(|factor| library.keep(runs, factor)).collect();
        let is_gate: Vec<bool> = factors.iter().map(|factor| gates.contains(factor)).collect();
        let coarse_of = |(functions, is_gate): (&Functions, &bool)| -> Functions {
            if *is_gate { functions.iter().map(|f| means(f)).collect::<Vec<_>>().into() } else { Functions::default() }
        };
        let coarse_functions: Vec<Functions> = fine_functions.iter().zip(&is_gate).map(coarse_of).collect();
        let gate_numbers: Vec<usize> = (0..factors.len()).filter(|&i| is_gate[i]).collect();
        let singles = (0..factors.len()).map(|i| vec![i]);
        let pairs =
            gate_numbers.iter().enumerate().flat_map(|(n, &i)| gate_numbers[..n].iter().map(move |&j| vec![i, j]));
        let all: Vec<Vec<usize>> = std::iter::once(Vec::new()).chain(singles).chain(pairs).collect();
        let forms: Vec<(Port, Vec<usize>)> = all
            .into_iter()
            .flat_map(|numbers| {
                let open = ports(&numbers).iter().filter(|port| grammar.ports.contains(port));
                open.map(|&port| (port, numbers.clone())).collect::<Vec<_>>()
            })
            .collect();
        let mut bank =
            Self { rows, coarse, gains, fine_functions, coarse_functions, proposals: Vec::new(), coarse_rows, library };
        bank.proposals = forms
            .into_par_iter()
            .filter_map(|(port, numbers)| {
                let chosen: Vec<Factor> = numbers.iter().map(|&i| factors[i].clone()).collect();
                let effect = Effect::new(port, &chosen);
                effect.validate().ok()?;
                let mut information = Vec::new();
                let rows = if numbers.len() > 1 { &bank.coarse } else { &bank.rows };
                bank.each_column(port, &numbers, &mut |column| information.push(rows.information(column)));
                Some(Proposal { cost: grammar.cost(&effect), effect, factors: numbers, information })
            })
            .collect();
        bank
    }

    /// The columns of a proposal: of a product in coarse rows.
    fn each_column(&self, port: Port, factors: &[usize], take: &mut dyn FnMut(&[f32])) {
        let (_, fine, coarse) = self.gains.iter().find(|(each, ..)| *each == port).unwrap_or(&self.gains[0]);
        match factors {
            [] => take(fine),
            [i] => self.fine_functions[*i].iter().for_each(|f| take(&product(fine, f))),
            [i, j, ..] => {
                for f in self.coarse_functions[*i].iter() {
                    let own = product(coarse, f);
                    self.coarse_functions[*j].iter().for_each(|g| take(&product(&own, g)));
                }
            }
        }
    }

    /// The effects that promise most, the first of them first. `weighed`: V⁻¹ times what is left of the residual, by the row.
    pub fn shortlist(&self, weighed: &[f64], most: usize) -> Vec<&Effect> {
        let fine: Vec<f32> = weighed.iter().map(|value| *value as f32).collect();
        let coarse = self.coarse_sums(weighed);
        // The rate that a unit at each port is worth.
        let heavy: Vec<(Port, Vec<f32>, Vec<f32>)> =
            self.gains.iter().map(|(port, f, c)| (*port, product(f, &fine), product(c, &coarse))).collect();
        let mut scored: Vec<(f64, &Effect)> =
            self.proposals.par_iter().map(|each| (self.promise_of(each, &heavy) - each.cost, &each.effect)).collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        scored.truncate(most);
        scored.into_iter().map(|(_, effect)| effect).collect()
    }

    fn promise_of(&self, proposal: &Proposal, heavy: &[(Port, Vec<f32>, Vec<f32>)]) -> f64 {
        let (_, fine, coarse) = heavy.iter().find(|(port, ..)| *port == proposal.effect.port).unwrap_or(&heavy[0]);
        let mut information = proposal.information.iter();
        let mut of = |score: f32| information.next().map_or(0.0, |information| gain(score, *information));
        match proposal.factors.as_slice() {
            [] => of(fine.iter().sum()),
            [i] => self.fine_functions[*i].iter().map(|f| of(dot(fine, f))).sum(),
            [i, j, ..] => {
                let (a, b) = (&self.coarse_functions[*i], &self.coarse_functions[*j]);
                a.iter().flat_map(|f| b.iter().map(move |g| (f, g))).map(|(f, g)| of(triple(coarse, f, g))).sum()
            }
        }
    }

    /// About what an effect that is not in the bank would gain, by coarse rows.
    pub fn promise(&self, runs: &[Run], effect: &Effect, coarse: &[f32]) -> f64 {
        let (_, _, gains) = self.gains.iter().find(|(port, ..)| *port == effect.port).unwrap_or(&self.gains[0]);
        let mut columns = vec![gains.clone()];
        for factor in &effect.factors {
            let functions: Vec<Vec<f32>> = self.library.keep(runs, factor).iter().map(|f| self.means(f)).collect();
            columns = columns.iter().flat_map(|column| functions.iter().map(move |f| product(column, f))).collect();
        }
        columns.iter().map(|column| gain(dot(column, coarse), self.coarse.information(column))).sum()
    }

    /// Sums over coarse rows of what is V⁻¹ times a residual.
    pub fn coarse_sums(&self, weighed: &[f64]) -> Vec<f32> {
        self.coarse_rows.iter().map(|rows| weighed[rows.clone()].iter().sum::<f64>() as f32).collect()
    }

    fn means(&self, fine: &[f32]) -> Vec<f32> {
        means(&self.coarse_rows, fine)
    }
}

/// Means over coarse rows.
fn means(coarse_rows: &[Range<usize>], fine: &[f32]) -> Vec<f32> {
    coarse_rows.iter().map(|rows| fine[rows.clone()].iter().sum::<f32>() / rows.len() as f32).collect()
}

/// Ports at which so many factors are proposed together.
fn ports(factors: &[usize]) -> &'static [Port] {
    match factors.len() {
        0 => &[Port::Scale, Port::Index, Port::Forward, Port::Left],
        1 => &Port::ALL,
        _ => &[Port::Rate, Port::Scale, Port::Index],
    }
}
