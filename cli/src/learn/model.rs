//! A model under way: effects beside a process of the runs' own, and what the evidence says of them.

use std::collections::HashMap;
use std::sync::Arc;

use north_finder::effects::doubt::Process;

use super::functions::Library;
use super::grammar::Grammar;
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
        let problem = Problem::new(runs, process.as_ref());
        let with = |term: &Term| Term {
            effect: term.effect.clone(),
            values: term.values.clone(),
            columns: problem.columns(&term.values),
            size2: term.size2,
        };
        let mut terms: Vec<Term> = terms.iter().map(with).collect();
        let gram = Gram::new(&problem, &terms);
        let fit = fit_sizes(&problem, &gram, &mut terms, TURNS)?;
        Some(Self { process, problem, terms, fit })
    }

    /// The evidence, less what the effects' forms cost.
    pub fn score(&self, grammar: &Grammar) -> f64 {
        self.fit.evidence
            - process_cost(&self.process)
            - self.terms.iter().map(|term| grammar.cost(&term.effect)).sum::<f64>()
    }

    /// The evidence less what the process costs.
    pub fn evidence(&self) -> f64 {
        self.fit.evidence - process_cost(&self.process)
    }

    /// The same for these effects in other runs, with the process or without one.
    pub fn best_evidence_in(&self, runs: &[Run]) -> Option<f64> {
        let library = Library::new(runs, HashMap::new());
        let with = |term: &Term| Term { values: Arc::new(library.values(runs, &term.effect)), ..term.clone() };
        let terms: Vec<Term> = self.terms.iter().map(with).collect();
        let of = |process| Model::new(runs, process, &terms).map(|model| model.evidence());
        let (with, without) = (of(self.process), of(None));
        with.into_iter().chain(without).max_by(f64::total_cmp)
    }

    /// How many weights its effects have.
    pub fn weights(&self) -> usize {
        self.terms.iter().map(|term| term.columns.len()).sum()
    }
}

/// What a process costs, nats: its two constants, each one of some eight values that recordings tell apart.
pub fn process_cost(process: &Option<Process>) -> f64 {
    if process.is_some() { 2.0 * 8f64.ln() } else { 0.0 }
}
