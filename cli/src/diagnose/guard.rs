//! Whether what was learned may be used: by the azimuths of training runs with what the others taught, and by the Earth's rate.

use north_finder::effects::ErrorModel;
use north_finder::effects::doubt::Doubt;
use north_finder::event::Fix;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::doubt::UNKNOWN_DEG;
use super::residual::{Residuals, in_white_noises};
use super::stations::misses_deg;
use super::statistics::{beyond_sigmas, median, studentised};
use crate::campaign::Role;
use crate::count::counted;
use crate::run_data::RunData;

/// A model is not used where the errors rise by more than this. (A true effect that the azimuth does not feel leaves every error as it is, but for the
/// noise of its parameters.)
const WORSE: f64 = 1.05;
/// One further effect of twenty that changes nothing raises errors by more than this many standard deviations of the rise.
const CHANCE: f64 = 1.645;
/// Fewest runs with a reference whose misses say something of sigma.
const LEAST_MISSES: usize = 3;
/// Relative amplitude error that scale factor and latitude of a sound instrument do not make.
const AMPLITUDE_LIMIT: f64 = 0.03;

/// Why a model that was found must not be used, if there is a reason: what it makes of the runs is impossible, or training runs that took no part in
/// learning it lose their azimuths or miss their references by more with it, or those do that it was learned from. (It says then that most references are
/// wrong.) Where too few have a reference, rates are judged: `rates` gives training runs, and each with the model taken out of it that the others taught,
/// and check runs, each with the model taken out of it. `wrong`: files whose references are not believed.
pub fn veto<'a>(
    runs: &[RunData],
    found: &ErrorModel,
    left_out: &[Option<Fix>],
    wrong: &[String],
    rates: impl Fn(Role) -> Vec<(&'a RunData, RunData)>,
) -> Option<String> {
    let of_training = || runs.iter().zip(left_out).filter(|(run, _)| run.role == Role::Fit);
    let without_azimuths = || lost_azimuth(of_training().map(|(run, fix)| (run, fix.as_ref())));
    // A run that lacks a channel of the model says nothing of it.
    let whole: Vec<&RunData> = runs.iter().filter(|run| run.has_channels_of(found)).collect();
    if let Some(why) = impossible(&whole, found).or_else(without_azimuths) {
        return Some(why);
    }
    let before: Vec<Option<Fix>> = runs.iter().map(|run| run.before).collect();
    let others = misses(runs, wrong, &before, left_out);
    let are_few = others.len() < LEAST_MISSES;
    let by_rates = || {
        let mut pairs = rates(Role::Fit);
        let of_training = pairs.len();
        pairs.extend(rates(Role::Check));
        rates_not_better(&pairs).or_else(|| rates_worse(&pairs[of_training..]))
    };
    let of_learned = || {
        let fixes: Vec<Option<Fix>> = runs.par_iter().map(|run| run.replay(found, &mut |_| ()).ok()).collect();
        made_worse(&misses(runs, wrong, &before, &fixes), "it was learned from")
    };
    made_worse(&others, "took no part in learning it").or_else(of_learned).or_else(|| are_few.then(by_rates).flatten())
}

/// Why a model with one effect more must not be used, if runs that took no part in learning it speak against it: they miss their references by more than
/// with the simpler one. Fixes by both, in the order of all runs. Where too few have a reference, rates are judged: how much they are off by both, in units
/// of white noise, if effects change them.
pub fn veto_beside(
    runs: &[RunData],
    wrong: &[String],
    [simpler, left_out]: [&[Option<Fix>]; 2],
    rates: impl Fn() -> Option<[f64; 2]>,
) -> Option<String> {
    let misses = misses(runs, wrong, simpler, left_out);
    let by_rates = || {
        let [before, after] = rates().filter(|[before, after]| is_worse(*before, *after))?;
        Some(format!("rates of runs that took no part in learning it are worse by it: {}", in_words(before, after)))
    };
    made_worse(&misses, "took no part in learning it")
        .filter(|_| is_more_than_chance(&misses))
        .or_else(|| (misses.len() < LEAST_MISSES).then(by_rates).flatten())
}

/// Whether the mean of what squared errors rise by is more than [`CHANCE`] of its own standard deviations. Too few do not say.
fn is_more_than_chance(misses: &[Miss]) -> bool {
    if misses.len() < LEAST_MISSES {
        return false;
    }
    let rises: Vec<f64> =
        misses.iter().map(|miss| miss.weight() * (miss.after.powi(2) - miss.before.powi(2))).collect();
    in_its_deviations(&rises) > CHANCE
}

/// The mean of two values or more in units of its own standard deviation, by how much they differ.
fn in_its_deviations(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean / (variance / count).sqrt()
}

/// What a run misses its reference by, or the others of its station, degrees: without a model and with it, and one sigma of the latter.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Miss {
    before: f64,
    after: f64,
    sigma: f64,
}

impl Miss {
    /// What it counts: of a run that was made where the others were not, what they taught says little, and its sigma says so.
    fn weight(&self) -> f64 {
        self.sigma.powi(-2)
    }
}

/// Root mean square of a value of misses, by their weights.
fn weighed_rms(misses: &[Miss], value: fn(&Miss) -> f64) -> f64 {
    let sum = |of: &dyn Fn(&Miss) -> f64| misses.iter().map(|miss| miss.weight() * of(miss)).sum::<f64>();
    (sum(&|miss| value(miss).powi(2)) / sum(&|_| 1.0)).sqrt()
}

/// Of training runs whose references are believed, without a model and with it. A run without an azimuth before says nothing of whether errors rise, but where
/// nearly all are such runs, they are what the model was made for: an azimuth is better than none.
fn misses(runs: &[RunData], wrong: &[String], before: &[Option<Fix>], after: &[Option<Fix>]) -> Vec<Miss> {
    let is_asked = |run: &RunData| run.role == Role::Fit && !wrong.contains(&run.file);
    // Those of a station are compared with each other: the same ones without the model and with it.
    let of = |fixes: &[Option<Fix>]| {
        let azimuth = |(run, fix): (&RunData, &Option<Fix>)| Some(fix.filter(|_| is_asked(run))?.azimuth_deg);
        misses_deg(runs, &runs.iter().zip(fixes).map(azimuth).collect::<Vec<Option<f64>>>())
    };
    let sigma =
        |(run, fix): (&RunData, &Option<Fix>)| fix.map_or(0.0, |fix| fix.sigma_deg.hypot(run.reference_sigma_deg));
    let sigmas = runs.iter().zip(after).map(sigma);
    paired(of(before).into_iter().zip(of(after)).zip(sigmas))
}

/// Of runs that have a miss before and after, degrees; with few of these the others, too, that have one after.
fn paired(misses: impl Iterator<Item = ((Option<f64>, Option<f64>), f64)>) -> Vec<Miss> {
    let after: Vec<(Option<f64>, Miss)> = misses
        .filter_map(|((before, after), sigma)| {
            Some((before, Miss { before: before.unwrap_or(UNKNOWN_DEG), after: after?, sigma }))
        })
        .collect();
    let both: Vec<Miss> = after.iter().filter(|(before, _)| before.is_some()).map(|(_, miss)| *miss).collect();
    if both.len() >= LEAST_MISSES { both } else { after.into_iter().map(|(_, miss)| miss).collect() }
}

/// Why a model must not be used by the rates of runs that took no part in learning it, if they speak against it: what is more in them than white
/// noise is not less with the model, by as much as errors of azimuths may rise. It is less where it falls in all of them together, or in the typical run
/// without rising in all together: one run in which an effect is much larger than in all others outweighs these, and they may not teach enough for it. It is
/// also less where it falls by little in the typical run, but by more than chance: beside a process of the runs' own an effect is a small part of what is left.
fn rates_not_better(pairs: &[(&RunData, RunData)]) -> Option<String> {
    let (before, after) = off_by(pairs);
    let logs = logs_of_off(pairs);
    let is_better = is_better((before, after), typically(&logs)) || after < before && falls_by_more_than_chance(&logs);
    (!is_better).then(|| {
        let runs = counted(pairs.len(), "run");
        format!("rates of {runs} that took no part in learning it are not better by it: {}", in_words(before, after))
    })
}

/// Why a model must not be used by the rates of check runs, if they speak against it: what is more in them than white noise rises with the model by more
/// than errors of azimuths may, and one run alone speaks against it. (An effect that acts in none of them adds the noise of its weights to white noise.)
fn rates_worse(pairs: &[(&RunData, RunData)]) -> Option<String> {
    let (before, after) = off_by(pairs);
    let speak_against = || {
        let (without, with) = pairs.iter().map(|(without, with)| (*without, with)).unzip();
        !Residuals::new(without, with).contradicted().is_empty()
    };
    let is_against = is_worse(before, after) && speak_against();
    is_against.then(|| format!("rates of {} check runs are worse by it: {}", pairs.len(), in_words(before, after)))
}

fn in_words(before: f64, after: f64) -> String {
    format!("they are off by {after:.1} times as much as white noise with it, by {before:.1} times without it")
}

/// How much rates of runs are off, without a model and with it; 1 is white noise.
pub fn off_by(pairs: &[(&RunData, RunData)]) -> (f64, f64) {
    let (without, with): (Vec<&RunData>, Vec<&RunData>) = pairs.iter().map(|(without, with)| (*without, with)).unzip();
    (in_white_noises(&without), in_white_noises(&with))
}

/// The logarithms of the same of each run; what is left of a run is at least white noise.
fn logs_of_off(pairs: &[(&RunData, RunData)]) -> Vec<(f64, f64)> {
    let log_of = |run: &RunData| in_white_noises(&[run]).max(1.0).ln();
    pairs.par_iter().map(|(without, with)| (log_of(without), log_of(with))).collect()
}

/// The same of the typical run, by the geometric mean over the runs, in which each counts alike however much it is off.
fn typically(logs: &[(f64, f64)]) -> (f64, f64) {
    let mean = |log: fn(&(f64, f64)) -> f64| logs.iter().map(log).sum::<f64>() / logs.len().max(1) as f64;
    (mean(|log| log.0).exp(), mean(|log| log.1).exp())
}

/// Whether the typical run falls by more than three standard deviations of the mean fall, by how much the runs' falls differ. What else is in the rates is in
/// both of a pair and drops out. One model of some hundreds that is nothing falls by as much by chance.
fn falls_by_more_than_chance(logs: &[(f64, f64)]) -> bool {
    let falls: Vec<f64> = logs.iter().map(|(before, after)| before - after).collect();
    falls.len() >= LEAST_MISSES && in_its_deviations(&falls) > 3.0 * studentised(falls.len())
}

/// What is left of rates beside white noise, in units of it, root mean square.
fn beyond_noise(left: f64) -> f64 {
    (left * left - 1.0).max(0.0).sqrt()
}

/// By what is left of rates in units of white noise, root mean square.
fn not_better(before: f64, after: f64) -> bool {
    after > before || WORSE * beyond_noise(after) > beyond_noise(before)
}

/// By all runs together and by the typical run, each before and after.
fn is_better(together: (f64, f64), typically: (f64, f64)) -> bool {
    let typically_falls = || typically.1 < typically.0 && !not_better(typically.0, typically.1);
    !not_better(together.0, together.1) || typically_falls() && !is_worse(together.0, together.1)
}

fn is_worse(before: f64, after: f64) -> bool {
    beyond_noise(after) > WORSE * beyond_noise(before)
}

/// What a model makes of runs that cannot be: one that had an azimuth has none with it, or the horizontal rate is not the Earth's any more. What is
/// uncertain of the model is left aside: it takes no azimuth away, but widens sigma.
pub fn impossible(runs: &[&RunData], model: &ErrorModel) -> Option<String> {
    let certain = ErrorModel { doubt: Doubt::default(), ..model.clone() };
    let with: Vec<Option<Fix>> = runs.par_iter().map(|run| run.replay(&certain, &mut |_| ()).ok()).collect();
    let after = || runs.iter().copied().zip(with.iter().map(Option::as_ref));
    lost_azimuth(after()).or_else(|| {
        let share = |(run, fix): (&RunData, Option<&Fix>)| Some(fix?.amplitude_deg_h / run.earth.north_deg_h);
        let before: Vec<f64> = runs.iter().filter_map(|run| share((run, run.before.as_ref()))).collect();
        impossible_amplitude(&before, &after().filter_map(share).collect::<Vec<f64>>())
    })
}

/// The first of some runs that had an azimuth and has none by this fix.
fn lost_azimuth<'a>(mut fixes: impl Iterator<Item = (&'a RunData, Option<&'a Fix>)>) -> Option<String> {
    let (run, _) = fixes.find(|(run, fix)| run.before.is_some() && fix.is_none())?;
    Some(format!("{} has no azimuth with it", run.file))
}

/// Training runs whose reference is known and believed: place, run, reference.
fn trusted<'a>(runs: &'a [RunData], wrong: &'a [String]) -> impl Iterator<Item = (usize, &'a RunData, f64)> {
    runs.iter().enumerate().filter_map(|(i, run)| {
        Some((i, run, run.reference_deg?)).filter(|_| run.role == Role::Fit && !wrong.contains(&run.file))
    })
}

/// By the errors of training runs before and after; `which` of them, in words. A few of them speak only where they are beyond their sigmas.
fn made_worse(misses: &[Miss], which: &str) -> Option<String> {
    let of = |value: fn(&Miss) -> f64| weighed_rms(misses, value);
    let (before, after) = (of(|miss| miss.before), of(|miss| miss.after));
    let speak = misses.len() >= LEAST_MISSES || after > CHANCE * of(|miss| miss.sigma);
    (speak && after > WORSE * before).then(|| {
        let count = misses.len();
        format!("on {count} training runs that {which}, azimuth errors, weighed by their sigmas, rise from {before:.4}° to {after:.4}° rms")
    })
}

/// By the horizontal rates of runs (shares of the Earth's at their latitude), which must be right where they were before.
fn impossible_amplitude(before: &[f64], after: &[f64]) -> Option<String> {
    let [before, after] = [before, after].map(|shares| median(shares.to_vec()));
    let beyond = |ratio: f64| (ratio - 1.0).abs() > AMPLITUDE_LIMIT;
    (after > 0.0 && beyond(after) && !beyond(before)).then(|| {
        format!(
            "it makes the horizontal rate impossible: {after:.3} of the Earth's at this latitude, {before:.3} without it"
        )
    })
}

/// What azimuths by what was learned miss beyond their sigmas ([`beyond_sigmas`]), degrees, over training runs with what the others taught; Student's, for
/// there are few of them.
pub fn missed_beyond_sigma_deg(runs: &[RunData], wrong: &[String], left_out: &[Option<Fix>]) -> f64 {
    let errors: Vec<(f64, f64)> = trusted(runs, wrong)
        .filter_map(|(i, run, reference_deg)| {
            let fix = left_out[i]?;
            let variance = fix.sigma_deg.powi(2) + run.reference_sigma_deg.powi(2);
            Some((wrap_180_deg(fix.azimuth_deg - reference_deg), variance))
        })
        .collect();
    if errors.len() < LEAST_MISSES {
        return 0.0;
    }
    studentised(errors.len()) * beyond_sigmas(&errors)
}

/// Whether a training run has a reference that is believed.
pub fn is_surveyed(runs: &[RunData], wrong: &[String]) -> bool {
    trusted(runs, wrong).next().is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_by_hand() {
        assert!(impossible_amplitude(&[1.001, 0.999, 1.0], &[1.05, 1.04, 0.9]).is_some());
        assert!(impossible_amplitude(&[1.001, 0.999, 1.0], &[1.02, 1.02, 0.9]).is_none());
        // A latitude that was wrong before is no model's fault.
        assert!(impossible_amplitude(&[1.05; 3], &[1.05; 3]).is_none());
    }

    /// Root of 2.21² less one is 1.971, 1.05 times 1.877, which is that of 2.127. White noise is not better than white noise, but nothing is left of it.
    #[test]
    fn rates_that_do_not_fall_by_hand() {
        assert!(not_better(2.21, 2.13) && !not_better(2.21, 2.12));
        assert!(not_better(1.0, 1.01) && !not_better(1.0, 0.99));
        assert!(!not_better(1.1, 0.98));
        // The same the other way round; white noise that is white noise again is no worse.
        assert!(is_worse(2.12, 2.21) && !is_worse(2.13, 2.21) && !is_worse(1.0, 1.0) && !is_worse(1.1, 0.98));
    }

    /// One run of five is off by 11.2 with and without a model that it would have to teach, the others fall from 1.5 to 1: together root of
    /// (11.2² + 4 · 1.5²)/5 = 5.19 becomes 5.09, by less than 5 %; typically (11.2 · 1.5⁴)^(1/5) = 2.24 becomes 1.62. It is not enough where all
    /// together are worse, or the typical run is white noise before and after.
    #[test]
    fn a_run_that_outweighs_the_others_by_hand() {
        assert!(!is_better((5.19, 5.09), (2.24, 2.24)));
        assert!(is_better((5.19, 5.09), (2.24, 1.62)));
        assert!(!is_better((5.19, 5.50), (2.24, 1.62)));
        assert!(!is_better((5.19, 5.19), (1.0, 1.0)));
    }

    /// Falls of 3, 4, 5 and 4: mean 4, variance 2/3, of the mean 1/6: 9.8 standard deviations. Of 1, 2, −1 and 2: mean 1, variance 2, of the mean 1/2: 1.4.
    #[test]
    fn falls_by_more_than_chance_by_hand() {
        let falls = |falls: [f64; 4]| falls_by_more_than_chance(&falls.map(|fall| (7.0, 7.0 - fall)));
        assert!(falls([3.0, 4.0, 5.0, 4.0]));
        assert!(!falls([1.0, 2.0, -1.0, 2.0]) && !falls([-3.0, -4.0, -5.0, -4.0]) && !falls([0.0; 4]));
    }

    /// Of four runs two had an azimuth, and a third has one with the model: 3°, where there was none. With three that had one it says nothing.
    #[test]
    fn an_azimuth_is_better_than_none() {
        let of = |misses: [(Option<f64>, Option<f64>); 4]| paired(misses.into_iter().map(|each| (each, 0.1)));
        let two = [(Some(0.1), Some(0.2)), (None, Some(3.0)), (Some(0.3), Some(0.2)), (None, None)];
        assert_eq!(of(two), with_sigma(0.1, &[(0.1, 0.2), (UNKNOWN_DEG, 3.0), (0.3, 0.2)]));
        let three = [(Some(0.1), Some(0.2)), (None, Some(3.0)), (Some(0.3), Some(0.2)), (Some(0.1), Some(0.1))];
        assert_eq!(of(three), with_sigma(0.1, &[(0.1, 0.2), (0.3, 0.2), (0.1, 0.1)]));
        assert!((UNKNOWN_DEG - 180.0 / 3f64.sqrt()).abs() < 1e-3);
    }

    /// Squares of errors rise by 3, 3 and 0, by 2 in the mean with a standard deviation of √3/√3 = 1 of it: 2 of them. By 3, 0 and 0 they rise by 1 of them:
    /// one run does not speak against an effect by itself.
    #[test]
    fn errors_that_rise_by_more_than_chance_by_hand() {
        let is_more = |pairs: &[(f64, f64)]| is_more_than_chance(&with_sigma(1.0, pairs));
        assert!(is_more(&[(1.0, 2.0), (1.0, 2.0), (1.0, 1.0)]));
        assert!(!is_more(&[(1.0, 2.0), (1.0, 1.0), (1.0, 1.0)]));
        assert!(!is_more(&[(1.0, 2.0), (1.0, 2.0)]));
    }

    /// Squares of 1, 1 and 1 become 1.2, 0.8 and 1: 1.03 in place of 1 by the mean square, 1 % more; 1.3, 0.9 and 1.1 are 11 % more. Two of these speak
    /// only where they are more than 1.645 sigma.
    #[test]
    fn errors_that_rise_by_hand() {
        assert!(made_worse(&with_sigma(1.0, &[(1.0, 1.2), (1.0, 0.8), (1.0, 1.0)]), "").is_none());
        assert!(made_worse(&with_sigma(1.0, &[(1.0, 1.3), (1.0, 0.9), (1.0, 1.1)]), "").is_some());
        assert!(made_worse(&with_sigma(1.0, &[(1.0, 1.3), (1.0, 1.1)]), "").is_none());
        assert!(made_worse(&with_sigma(0.5, &[(1.0, 1.3), (1.0, 1.1)]), "").is_some());
        assert!(made_worse(&[], "").is_none());
    }

    /// A run that was made elsewhere has a sigma ten times as large and counts a hundredth: 2² and 3² at 1/100 beside 1² and 1² are
    /// √((1 + 1 + 0.04)/2.01) = 1.0074 and √((1 + 1 + 0.09)/2.01) = 1.0197, which is 1 % more.
    #[test]
    fn a_run_made_elsewhere_counts_little_by_hand() {
        let elsewhere = Miss { before: 2.0, after: 3.0, sigma: 10.0 };
        let misses = [with_sigma(1.0, &[(1.0, 1.0), (1.0, 1.0)]), vec![elsewhere]].concat();
        assert!((weighed_rms(&misses, |miss| miss.before) - 1.0074).abs() < 1e-4);
        assert!((weighed_rms(&misses, |miss| miss.after) - 1.0197).abs() < 1e-4);
        assert!(made_worse(&misses, "").is_none());
        assert!(made_worse(&[misses.as_slice(), &[Miss { sigma: 1.0, ..elsewhere }]].concat(), "").is_some());
    }

    fn with_sigma(sigma: f64, pairs: &[(f64, f64)]) -> Vec<Miss> {
        pairs.iter().map(|&(before, after)| Miss { before, after, sigma }).collect()
    }
}
