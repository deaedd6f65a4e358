//! Effects found by one grammar: products of factors at a port, proposed by the thousand and chosen by their evidence.
//!
//! [`read`] → [`bank`] proposes → [`search`] chooses, by the evidence of a [`model`] → [`posterior`] says what was learned. Wrong references
//! compete with effects ([`references`]). It stands beside the search of [`crate::diagnose`] until it does better in one table.

mod bank;
mod functions;
mod grammar;
mod judge;
mod model;
mod pairs;
mod posterior;
mod problem;
mod process;
mod read;
mod references;
mod rows;
mod search;
mod written;

pub use judge::chi_square_by_freedom;
pub use posterior::Posterior;
pub use read::{Runs, read};
pub use references::Blunder;

use std::sync::Arc;

use model::Model;
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};
use problem::Term;
pub use rows::Run;
use search::{Search, Start};

/// Most references that are put right: with more than that the survey as a whole is not to be believed.
const MOST_BLUNDERS: usize = 4;

/// What some runs taught.
#[derive(Clone, Debug, Default)]
pub struct Learned {
    pub posterior: Posterior,
    /// The evidence of the likeliest model less what its form costs, and that without any effect, nats.
    pub score: f64,
    pub score_without: f64,
    /// The runs with their references put right.
    pub runs: Vec<Run>,
    /// What was wrong with the references, by the numbers of the runs.
    pub blunders: Vec<Blunder>,
}

/// The evidence of effects that are proposed elsewhere, each by its columns: what units of its coefficients add to the rates, by the row and all runs
/// one after the other; beside the process of the runs' own that suits them best, which is given with it.
pub fn evidence_of(runs: &[Run], groups: &[Vec<Vec<f64>>]) -> Option<(f64, Option<Process>)> {
    let bare = Model::new(runs, None, &[])?;
    let term = |values: &Vec<Vec<f64>>| {
        let columns = bare.problem.columns(values);
        let (_, size2) = bare.fit.gain_of(&bare.problem, &[], &columns);
        Term {
            effect: Effect::new(Port::Rate, &[]),
            values: Arc::new(values.clone()),
            columns,
            size2: size2.max(1e-20),
        }
    };
    let terms: Vec<Term> = groups.iter().map(term).collect();
    let model = Model::new(runs, None, &terms)?.with_likeliest_process();
    Some((model.evidence(), model.process))
}

/// Learns from runs.
///
/// A reference is put right, or not believed, where with everything that is learned then the runs predict each other better, by more than what a blunder
/// costs beforehand.
pub fn learn(mut runs: Vec<Run>) -> Learned {
    rows::linearise_by_station(&mut runs);
    let mut blunders: Vec<Blunder> = Vec::new();
    let mut start = Start::default();
    loop {
        let search = Search::new(&runs);
        let Some(best) = search.best(&start) else { return Learned { runs, blunders, ..Learned::default() } };
        let (score, predictive) = (best.score(&search.grammar), best.predictive(&search.grammar));
        start = Start { effects: best.effects(), process: best.process };
        let suspects = if blunders.len() < MOST_BLUNDERS { search.suspects(&best) } else { Vec::new() };
        let likelier = suspects.into_iter().find_map(|blunder| {
            let mended = blunder.mended(&runs);
            let search = Search::new(&mended);
            let predictive_then = search.best(&start)?.predictive(&search.grammar);
            (predictive_then - blunder.cost(runs.len()) > predictive).then_some((blunder, mended))
        });
        if let Some((blunder, mended)) = likelier {
            blunders.push(blunder);
            runs = mended;
            continue;
        }
        let score_without = Model::new(&runs, None, &[]).map_or(0.0, |bare| bare.with_likeliest_process().evidence());
        let posterior = Posterior::new(&search, &search.with_rivals(best));
        return Learned { posterior, score, score_without, runs, blunders };
    }
}
