//! Effects found by one grammar: products of factors at a port, proposed by the thousand and chosen by their evidence.
//!
//! [`read`] → [`bank`] proposes → [`search`] chooses, by the evidence of a [`model`] → [`posterior`] says what was learned. Wrong references
//! compete with effects ([`references`]). It stands beside the search of [`crate::diagnose`] until it does better in one table.

mod bank;
mod functions;
mod grammar;
mod judge;
mod model;
mod posterior;
mod problem;
mod process;
mod read;
mod references;
mod rows;
mod search;

pub use judge::chi_square_by_freedom;
pub use posterior::Posterior;
pub use read::{Runs, read};
pub use references::Blunder;

use rows::Run;
use search::Search;

/// Most references that are put right: with more than that the survey as a whole is not to be believed.
const MOST_BLUNDERS: usize = 4;

/// What some runs taught.
#[derive(Clone, Debug, Default)]
pub struct Learned {
    pub posterior: Posterior,
    /// What was wrong with the references, by the numbers of the runs.
    pub blunders: Vec<Blunder>,
}

/// Learns from runs.
pub fn learn(runs: Vec<Run>) -> Learned {
    let mut learned = Learned::default();
    let mut runs = runs;
    loop {
        let search = Search::new(&runs);
        match search.run() {
            Ok(models) => {
                learned.posterior = Posterior::new(&search, &models);
                return learned;
            }
            Err(blunder) => {
                let mended = blunder.mended(&runs);
                learned.blunders.push(blunder);
                runs = mended;
                if learned.blunders.len() > MOST_BLUNDERS {
                    return learned;
                }
            }
        }
    }
}
