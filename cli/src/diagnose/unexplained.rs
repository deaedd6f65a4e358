//! What no candidate explains, in words.

use super::block::Block;
use super::learn::STRUCTURE;
use super::noise::azimuth_tests;
use super::problem::Problem;
use super::statistics::{chi_square_tail, p_value_in_words};
use super::{Fitted, NoiseTests};
use crate::campaign::Role;
use crate::run_data::RunData;

/// Everything that says that structure remains; nothing where there is none.
pub fn evidence(fitted: &Fitted, runs: &[RunData], noise: &NoiseTests) -> Vec<String> {
    let learned = fitted.learned();
    let mut evidence = Vec::new();
    let p_value = chi_square_tail(learned.left * learned.left_freedom, learned.left_freedom);
    if learned.left_freedom > 0.0 && p_value < STRUCTURE {
        evidence.push(format!(
            "what is left changes {:.2} times as much over blocks of seconds as white noise would ({})",
            learned.left.sqrt(),
            p_value_in_words(p_value)
        ));
    }
    // Where nothing may be learned, all runs together are asked.
    if learned.left_freedom == 0.0 {
        evidence.extend(
            noise
                .after
                .iter()
                .filter(|test| matches!(test.name.as_str(), "dwells" | "closure") && test.p_value < STRUCTURE)
                .map(|test| format!("the test `{}` of all runs fails ({})", test.name, p_value_in_words(test.p_value))),
        );
    }
    if !learned.taken.is_empty() && learned.sameness_p_value < STRUCTURE {
        evidence
            .push(format!("what was found differs from run to run ({})", p_value_in_words(learned.sameness_p_value)));
    }
    let dependences: Vec<_> = noise.after.iter().filter(|test| test.name.starts_with("dependence:")).collect();
    for test in &dependences {
        let p_value = test.p_value * dependences.len() as f64;
        if let Some(channel) = test.name.strip_prefix("dependence:").filter(|_| p_value < STRUCTURE) {
            evidence.push(format!("what is left still goes with {channel} ({})", p_value_in_words(p_value)));
        }
    }
    if fitted.by_dwell.is_none() {
        evidence.extend(azimuths(fitted, runs));
    }
    evidence
}

/// Azimuths of the fit runs against their references.
fn azimuths(fitted: &Fitted, runs: &[RunData]) -> Vec<String> {
    let trusted = |run: &&RunData| fitted.bad_references.iter().all(|(file, _)| *file != run.file);
    let fit = runs.iter().filter(|run| run.role == Role::Fit).filter(trusted);
    let mut problem = Problem::new(fit.filter_map(|run| Block::new(run, true, fitted.sinusoid_period_s())).collect());
    problem.linearise(&fitted.learned().taken);
    let errors: Vec<(f64, f64, f64)> = problem
        .azimuth_errors(&problem.effects(&fitted.learned().taken))
        .into_iter()
        .zip(&problem.blocks)
        .filter_map(|(each, block)| each.map(|(error, sigma)| (error, sigma, block.azimuth_deg)))
        .collect();
    azimuth_tests(&errors)
        .into_iter()
        .filter(|test| test.p_value < STRUCTURE)
        .map(|test| match test.name.as_str() {
            "azimuth" => format!(
                "azimuths miss their references by {:.1} sigma rms ({})",
                (test.statistic / errors.len() as f64).sqrt(),
                p_value_in_words(test.p_value)
            ),
            _ => format!("azimuth errors go with the heading ({})", p_value_in_words(test.p_value)),
        })
        .collect()
}
