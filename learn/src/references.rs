//! Surveys are a mixture: right with their sigma, wrong by anything, or exchanged with another run's. They compete with effects for what is to
//! be explained, so that one blunder invents none.

use north_finder::units::{DEG_PER_RAD, wrap_180_deg};
use rayon::prelude::*;

use super::model::Model;
use super::problem::Problem;
use super::rows::{Run, UNKNOWN_RAD};

/// Probability that a reference is wrong, that it is exchanged with another one, and that all are less accurate than was said, before anything is seen.
const BLUNDER: f64 = 0.01;
/// Most references that are put right: with more than that the survey as a whole is not to be believed.
pub const MOST_BLUNDERS: usize = 4;
/// References that are looked at exactly: those that miss most, and with them those that miss by what no turn in the linear equations is.
const SUSPECTS: usize = 4;
/// Blunders of these that are compared with effects.
const FINALISTS: usize = 2;

/// What may be wrong with the references.
#[derive(Clone, Debug, PartialEq)]
pub enum Blunder {
    /// The reference of this run is wrong.
    Wrong(usize),
    /// The references of these runs are exchanged.
    Exchanged(usize, usize),
}

impl Blunder {
    /// The runs with the blunder put right: an azimuth that is not known, or the other run's reference.
    pub fn mended(&self, runs: &[Run]) -> Vec<Run> {
        let mut runs = runs.to_vec();
        match *self {
            Self::Wrong(i) => runs[i].lose_reference(),
            Self::Exchanged(i, j) => {
                let (a, b) = (runs[i].reference, runs[j].reference);
                runs[i].take_reference(b);
                runs[j].take_reference(a);
            }
        }
        runs
    }

    /// Minus the logarithm of its probability beforehand, nats. A wrong one may be anything on the circle, where the search allows for a
    /// normal distribution about the first estimate: the ratio of the two densities there belongs to the cost.
    pub fn cost(&self, runs: usize) -> f64 {
        let runs = runs as f64;
        match self {
            Self::Wrong(_) => -BLUNDER.ln() + ((2.0 * std::f64::consts::PI).sqrt() / UNKNOWN_RAD).ln(),
            Self::Exchanged(..) => ((runs - 1.0) / BLUNDER).ln(),
        }
    }
}

/// The blunder that would raise the evidence of a model most, and by how much more than it costs.
pub fn likeliest(model: &Model<'_>) -> Option<(f64, Blunder)> {
    let problem = &model.problem;
    let runs = problem.runs;
    let all = proposed(runs, &misses(problem, &problem.weighed(&problem.left(&model.fit))));
    let gain = |blunder: Blunder, evidence_in: &dyn Fn(&[Run]) -> Option<f64>| {
        let evidence = evidence_in(&blunder.mended(runs))?;
        Some((evidence - model.evidence() - blunder.cost(runs.len()), blunder))
    };
    let mut likely: Vec<(f64, Blunder)> =
        all.into_par_iter().filter_map(|blunder| gain(blunder, &|mended| model.best_evidence_in(mended))).collect();
    likely.sort_by(|a, b| b.0.total_cmp(&a.0));
    likely.truncate(FINALISTS);
    // What a blunder leaves has been taken for a process: those that are left have one of their own.
    let finish = |(_, blunder)| gain(blunder, &|mended| Some(model.in_runs(mended)?.evidence()));
    likely.into_par_iter().filter_map(finish).max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Minus the logarithm of the probability beforehand that all references are less accurate than was said, nats: that of one blunder, which is made of the survey as a whole.
pub fn cost_of_less_accurate() -> f64 {
    -BLUNDER.ln()
}

/// The same runs with references that are all less accurate than was said, twice, four times … until they say nothing any more: what a model lacks turns azimuths, and right
/// references miss what they are turned to.
pub fn less_accurate(runs: &[Run]) -> Vec<Vec<Run>> {
    let twice = |runs: &Vec<Run>| {
        let mut runs = runs.clone();
        for (_, sigma_deg) in runs.iter_mut().filter_map(|run| run.reference.as_mut()) {
            *sigma_deg *= 2.0;
        }
        let says_something =
            |run: &Run| run.reference.is_some_and(|(_, sigma_deg)| sigma_deg < UNKNOWN_RAD * DEG_PER_RAD);
        runs.iter().any(says_something).then_some(runs)
    };
    std::iter::successors(twice(&runs.to_vec()), twice).collect()
}

/// The blunders that explain most beside a model's effects, one after the other, and the runs with all of them put right. Beside no process, because a process
/// takes for its own what several blunders do, so that one of them alone explains little.
pub fn together(model: &Model<'_>) -> (Vec<Blunder>, Vec<Run>) {
    let mut runs = model.problem.runs.to_vec();
    let mut blunders = Vec::new();
    while blunders.len() < MOST_BLUNDERS {
        let next = model.in_runs_without_process(&runs).and_then(|model| likeliest(&model));
        let Some((_, blunder)) = next.filter(|(gain, _)| *gain > 0.0) else { break };
        runs = blunder.mended(&runs);
        blunders.push(blunder);
    }
    (blunders, runs)
}

/// By how much a run's reference misses what it says beside a model.
#[derive(Clone, Copy)]
struct Miss {
    run: usize,
    chi_square: f64,
    turn_rad: f64,
}

/// What may be wrong with references that miss so much.
fn proposed(runs: &[Run], misses: &[Miss]) -> Vec<Blunder> {
    let mut suspects = misses.to_vec();
    suspects.sort_by(|a, b| b.chi_square.total_cmp(&a.chi_square));
    let others = suspects.split_off(SUSPECTS.min(suspects.len()));
    suspects.extend(others.into_iter().filter(|each| is_gross(&runs[each.run])));
    let alone = suspects.iter().map(|each| Blunder::Wrong(each.run));
    // The other run of an exchange need not be suspect: an effect may have taken it in.
    let pairs = suspects.iter().flat_map(|a| misses.iter().map(move |b| (a, b)));
    let exchanged = pairs
        .filter(|(a, b)| a.run != b.run && points_at(runs, a, b) && points_at(runs, b, a))
        .map(|(a, b)| Blunder::Exchanged(a.run.min(b.run), a.run.max(b.run)));
    let mut all: Vec<Blunder> = Vec::new();
    exchanged.chain(alone).for_each(|blunder| {
        if !all.contains(&blunder) {
            all.push(blunder)
        }
    });
    all
}

/// By how much every reference misses what its run says beside the model.
fn misses(problem: &Problem<'_>, weighed: &[f64]) -> Vec<Miss> {
    let mut end = 0;
    let of_run = |(i, run): (usize, &Run)| {
        end += run.rows();
        let (_, sigma_deg) = run.reference?;
        // One sigma of the survey turns the rates by this much.
        let [turn, ..] = run.unknowns();
        let score: f64 = turn.iter().zip(&weighed[end - run.rows()..end]).map(|(a, b)| a * b).sum();
        let information = problem.information(i);
        let sigma_rad = sigma_deg / DEG_PER_RAD;
        // The score is that of a run whose reference holds it: beside the survey's own variance.
        let free = information / (1.0 + information);
        (free > 0.0).then(|| Miss {
            run: i,
            chi_square: score * score / free,
            turn_rad: score / information * (1.0 + information) * sigma_rad,
        })
    };
    problem.runs.iter().enumerate().filter_map(of_run).collect()
}

/// A run whose own azimuth misses its reference by more than the linear equations hold for. (They are blind to a turn by 180°.)
fn is_gross(run: &Run) -> bool {
    let miss_deg = run.plain_deg.zip(run.reference).map(|(says_deg, (own_deg, _))| wrap_180_deg(says_deg - own_deg));
    miss_deg.is_some_and(|miss_deg| miss_deg.abs() > UNKNOWN_RAD * DEG_PER_RAD)
}

/// Whether run a, by what it says itself, points where the reference of run b does: nearer by five than to its own. Beside the model where the miss
/// is small enough for it to be linear, else by its own azimuth, of which effects are the smaller part.
fn points_at(runs: &[Run], a: &Miss, b: &Miss) -> bool {
    let run = &runs[a.run];
    let (Some((own_deg, _)), Some((other_deg, _))) = (run.reference, runs[b.run].reference) else { return false };
    let beside_model_deg = own_deg + a.turn_rad * DEG_PER_RAD;
    let is_linear = a.turn_rad.abs() < UNKNOWN_RAD && !is_gross(run);
    let says_deg = if is_linear { beside_model_deg } else { run.plain_deg.unwrap_or(beside_model_deg) };
    wrap_180_deg(says_deg - other_deg).abs() < 0.2 * wrap_180_deg(says_deg - own_deg).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// References of 3° and 1° and none: twice 6° and 2°, four times 12° and 4°, eight times 24° and 8°; at sixteen times both say less than 0.2 rad = 11.5°.
    #[test]
    fn references_that_are_all_less_accurate_by_hand() {
        let at = |sigma_deg: Option<f64>| {
            let mut run = Run::of_rates(&[0.0; 8]);
            run.take_reference(sigma_deg.map(|sigma_deg| (20.0, sigma_deg)));
            run
        };
        let all = less_accurate(&[at(Some(3.0)), at(Some(1.0)), at(None)]);
        let sigmas = |runs: &Vec<Run>| runs.iter().map(|run| run.reference.map(|(_, sigma)| sigma)).collect::<Vec<_>>();
        let expected = [2.0, 4.0, 8.0].map(|times| vec![Some(3.0 * times), Some(times), None]);
        assert_eq!(all.iter().map(sigmas).collect::<Vec<_>>(), expected);
    }

    /// Eight runs, of which the third points at 10° and has the reference of the sixth, 185°, and the other way round. To the linear equations that is a
    /// turn by sin 175° = 0.09 rad = 5°, which points at neither reference; they miss by less than four others do by their noise.
    #[test]
    fn references_of_nearly_opposite_headings_are_exchanged() {
        let headings_deg = [100.0, 130.0, 10.0, 60.0, 250.0, 185.0, 300.0, 340.0];
        let at = |(run, heading_deg): (usize, f64)| {
            let mut blank = Run::of_rates(&[0.0; 8]);
            blank.plain_deg = Some(heading_deg);
            let reference_deg = [(2, 185.0), (5, 10.0)].iter().find(|(exchanged, _)| *exchanged == run);
            blank.take_reference(Some((reference_deg.map_or(heading_deg, |(_, deg)| *deg), 0.01)));
            blank
        };
        let runs: Vec<Run> = headings_deg.into_iter().enumerate().map(at).collect();
        let misses: Vec<Miss> = (0..8)
            .map(|run| {
                let (chi_square, turn_rad) = if run == 2 || run == 5 { (0.5, 0.09) } else { (1.0, 0.0) };
                Miss { run, chi_square, turn_rad }
            })
            .collect();
        let proposed = proposed(&runs, &misses);
        assert_eq!(proposed[0], Blunder::Exchanged(2, 5));
        assert_eq!(proposed.len(), 7, "and six that are wrong alone: {proposed:?}");
    }
}
