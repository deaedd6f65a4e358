//! A model under way: effects beside a process of the runs' own, and what the evidence says of them.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::doubt::{Kernel, Process};
use north_finder::effects::effect::Effect;
use rayon::prelude::*;

use super::family::Known;
use super::functions::Library;
use super::grammar::{Grammar, complexity};
use super::problem::{Fit, Gram, Problem, Term, fit_sizes};
use super::rows::Run;

/// Turns of the sizes' fixed point; it moves by less than 2 % then.
const TURNS: usize = 30;

/// A model under way.
pub struct Model<'a> {
    pub process: Option<Process>,
    pub problem: Problem<'a>,
    pub terms: Vec<Term>,
    pub fit: Fit,
}

impl<'a> Model<'a> {
    /// Of these effects in these runs; sizes are fitted.
    pub fn new(runs: &'a [Run], process: Option<Process>, terms: &[Term]) -> Option<Self> {
        let problem = Problem::with_known(runs, process.as_ref(), terms);
        let with = |term: &Term| Term { columns: problem.columns(&term.values), ..term.clone() };
        let mut terms: Vec<Term> = terms.iter().map(with).collect();
        let gram = Gram::new(&problem, &terms);
        let fit = fit_sizes(&problem, &gram, &mut terms, TURNS)?;
        Some(Self { process, problem, terms, fit })
    }

    /// Its effects, in order.
    pub fn effects(&self) -> Vec<Effect> {
        self.terms.iter().map(|term| term.effect.clone()).collect()
    }

    /// What is known of those of its effects that are the family's.
    pub fn known(&self) -> impl Iterator<Item = &Known> {
        self.terms.iter().filter_map(|term| term.known.as_ref().map(|(known, _)| known))
    }

    /// Its effects that are not the family's.
    pub fn found(&self) -> Vec<Effect> {
        self.terms.iter().filter(|term| term.known.is_none()).map(|term| term.effect.clone()).collect()
    }

    /// The evidence, less what the effects' forms cost.
    pub fn score(&self, grammar: &Grammar) -> f64 {
        self.fit.evidence - self.cost(grammar)
    }

    /// The same by how well every run is predicted from the others: where a model is wrong, it is the better judge.
    pub fn predictive(&self, grammar: &Grammar) -> f64 {
        self.problem.predictive(&self.terms) - self.cost(grammar)
    }

    /// Log odds of the model over another one that the runs leave, nats: what evidence and prediction both say, and how much more complex the other is.
    pub fn log_odds_over(&self, other: &Self) -> f64 {
        let predictive = |model: &Self| model.problem.predictive(&model.terms);
        let said = f64::min(self.fit.evidence - other.fit.evidence, predictive(self) - predictive(other));
        said + other.cost_by(complexity) - self.cost_by(complexity)
    }

    /// What the forms of effects and process cost, nats.
    fn cost(&self, grammar: &Grammar) -> f64 {
        self.cost_by(|effect| grammar.cost(effect))
    }

    /// The same with another cost of an effect's form; one of the family costs what the family says.
    fn cost_by(&self, of_form: impl Fn(&Effect) -> f64) -> f64 {
        let of_term = |term: &Term| match &term.known {
            Some((known, _)) => known.prior.cost,
            None => of_form(&term.effect),
        };
        process_cost(&self.process) + self.terms.iter().map(of_term).sum::<f64>()
    }

    /// Mean and covariance of the weights of all effects, in units of their priors.
    pub fn weights(&self) -> (DVector<f64>, DMatrix<f64>) {
        let mut mean = DVector::from_vec(self.fit.scaled_means());
        let mut turn = DMatrix::identity(mean.len(), mean.len());
        let mut offset = DVector::zeros(mean.len());
        let mut first = 0;
        for term in &self.terms {
            let count = term.columns.len();
            if let Some((known, _)) = &term.known {
                turn.view_mut((first, first), (count, count)).copy_from(&known.prior.root);
                offset.rows_mut(first, count).copy_from(&known.prior.mean);
            }
            first += count;
        }
        mean = offset + &turn * mean;
        (mean, &turn * self.fit.scaled_covariance() * turn.transpose())
    }

    /// The evidence less what the process costs.
    pub fn evidence(&self) -> f64 {
        self.fit.evidence - process_cost(&self.process)
    }

    /// The same for these effects in other runs, with the process or without one.
    pub fn best_evidence_in(&self, runs: &[Run]) -> Option<f64> {
        let terms = self.terms_in(runs);
        let of = |process| Model::new(runs, process, &terms).map(|model| model.evidence());
        let (with, without) = (of(self.process), of(None));
        with.into_iter().chain(without).max_by(f64::total_cmp)
    }

    /// The same with the process that suits these runs best.
    pub fn likeliest_evidence_in(&self, runs: &[Run]) -> Option<f64> {
        Some(Model::new(runs, self.process, &self.terms_in(runs))?.with_likeliest_process().evidence())
    }

    /// Its effects evaluated in other runs.
    fn terms_in(&self, runs: &[Run]) -> Vec<Term> {
        let library = Library::new(runs);
        self.terms.iter().map(|term| term.with_values(library.values(runs, &term.effect))).collect()
    }

    /// The same effects beside the process that has the greatest evidence.
    pub fn with_likeliest_process(self) -> Self {
        let mut best = self;
        let runs = best.problem.runs;
        let noise = typical_noise(runs);
        let longest_s = runs.iter().map(|run| run.lengths_s().1).fold(0.0, f64::max);
        let mut starts: Vec<Option<Process>> = vec![best.process, None];
        for time_s in [4.0, 20.0, 100.0] {
            starts.push(Some(Process { kernel: Kernel::Exponential, sigma_deg_h: 0.5 * noise, time_s }));
        }
        let score = |process: &Option<Process>| {
            Model::new(runs, *process, &best.terms).map(|each| (each.fit.evidence - process_cost(process), *process))
        };
        let mut tried: Vec<(f64, Option<Process>)> = starts.par_iter().filter_map(score).collect();
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some(&(mut top, mut process)) = tried.first() else { return best };
        if let Some(mut own) = process {
            let mut step = 0.7;
            while step > 0.15 {
                let moves = [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)];
                let moved = moves
                    .par_iter()
                    .filter_map(|(size, time): &(f64, f64)| {
                        let each = Process {
                            sigma_deg_h: own.sigma_deg_h * size.exp(),
                            time_s: (own.time_s * time.exp()).clamp(1.0, 4.0 * longest_s),
                            ..own
                        };
                        score(&Some(each))
                    })
                    .max_by(|a, b| a.0.total_cmp(&b.0));
                match moved {
                    Some((above, Some(each))) if above > top + 1e-3 => (top, own) = (above, each),
                    _ => step *= 0.5,
                }
            }
            process = Some(own);
        }
        if process != best.process
            && let Some(with) = Model::new(runs, process, &best.terms)
        {
            best = with;
        }
        best
    }
}

/// What a process costs, nats: its two constants, each one of some eight values that recordings tell apart.
pub fn process_cost(process: &Option<Process>) -> f64 {
    if process.is_some() { 2.0 * 8f64.ln() } else { 0.0 }
}

/// Noise of a row of a usual run, °/h.
fn typical_noise(runs: &[Run]) -> f64 {
    let mut all: Vec<f64> =
        runs.iter().filter_map(|run| run.variance.first()).map(|variance| variance.sqrt()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(1.0)
}
