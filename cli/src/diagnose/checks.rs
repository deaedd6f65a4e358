//! Doubts about a campaign, before anything is learned from it.

use north_finder::earth::EARTH_RATE_DEG_H;
use north_finder::effects::ErrorModel;
use north_finder::units::{RAD_PER_DEG, wrap_180_deg};

use super::block::AMPLITUDE_SIGMA;
use super::candidate::{Candidate, Part};
use super::learned::Learned;
use super::problem::Problem;
use super::statistics::{f_tail, median};
use super::{Refusal, Warning};
use crate::campaign::Role;
use crate::run_data::RunData;

/// Relative amplitude error beyond which latitude and recording do not belong together.
const AMPLITUDE_LIMIT: f64 = 0.03;
/// Share of a channel's range that a run may go beyond it.
const BEYOND: f64 = 0.1;
/// A reference is an outlier when chance would give one as far out in fewer campaigns than this share.
const OUTLIER: f64 = 1e-3;
/// Fewest references among which one can stand out: a mean, it, and one degree of freedom for the scatter.
const LEAST_REFERENCES: usize = 3;
/// And by at least this much, degrees.
const OUTLIER_DEG: f64 = 0.2;

fn warning(message: String) -> Warning {
    Warning { run: None, line: None, message }
}

/// A run's horizontal rate is another than the others' by so many sigmas: its own, or 1.48 times their median deviation, and that of the tie to Ω cos φ.
const AMPLITUDE_SIGMAS: f64 = 5.0;
const SIGMA_OF_MEDIAN: f64 = 1.4826;

/// Leaves out runs of a dead gyro, by name, as long as there is another.
pub fn leave_out_dead(runs: &mut Vec<RunData>, warnings: &mut Vec<Warning>) {
    if runs.iter().all(RunData::repeats_itself) {
        return;
    }
    runs.retain(|run| {
        let dead = run.repeats_itself();
        if dead {
            let message = "the gyro repeats the same reading throughout: the run is left out".into();
            warnings.push(Warning { run: Some(run.file.clone()), line: None, message });
        }
        !dead
    });
}

/// Refuses what makes no sense at all.
pub fn refuse(runs: &[RunData]) -> Result<(), Refusal> {
    if let Some(run) = runs.iter().find(|run| run.repeats_itself()) {
        return Err(Refusal::Run {
            run: run.file.clone(),
            line: None,
            problem:
                "the gyro repeats the same reading throughout: Earth rate not detected above the noise; no azimuth"
                    .into(),
        });
    }
    if runs.iter().all(|run| run.before.is_none())
        && let Some((run, refusal)) = runs.iter().find_map(|run| Some((run, run.refusal.as_ref()?)))
        // With accelerometers a base that moves may be what hides the signal, and can be taken out.
        && (refusal.contains("directions") || runs.iter().all(|run| run.channel("ax_g").is_none()))
    {
        return Err(Refusal::Run {
            run: run.file.clone(),
            line: None,
            problem: format!("no run of the campaign gives an azimuth; this one does not because {refusal}"),
        });
    }
    let turned: Vec<(f64, f64)> =
        runs.iter().filter_map(|run| Some((run.before?.azimuth_deg, run.reference_deg?))).collect();
    let typical = |sign: f64, offset: f64| {
        median(turned.iter().map(|(found, truth)| wrap_180_deg(found - sign * truth - offset).abs()).collect())
    };
    if turned.len() >= 3 && typical(1.0, 0.0) > 20.0 {
        let in_degrees: Vec<f64> =
            turned.iter().map(|(found, truth)| wrap_180_deg(found - truth / RAD_PER_DEG).abs()).collect();
        if median(in_degrees) < 5.0 {
            return Err(Refusal::Campaign(
                "the references fit the azimuths as radians: reference_azimuth_deg must be in degrees".into(),
            ));
        }
        if typical(1.0, 180.0) < 5.0 {
            return Err(Refusal::Campaign(
                "every azimuth is off by about 180 degrees: the gyro's sign is reversed (fog_arcsec counts right-handed \
                 rotation about the axis as positive)"
                    .into(),
            ));
        }
        if typical(-1.0, 0.0) < 5.0 || typical(-1.0, 180.0) < 5.0 {
            return Err(Refusal::Campaign(
                "the azimuths mirror the references: index_deg must count counter-clockwise as seen from above, or the \
                 references clockwise from north"
                    .into(),
            ));
        }
    }
    Ok(())
}

/// Refuses a campaign whose horizontal rate is not that of its latitude, nor is with what was learned. A scale factor or
/// a field along the axis would make any latitude right, and are not asked.
pub fn refuse_latitude(runs: &[RunData], learned: &Learned, base: &ErrorModel) -> Result<(), Refusal> {
    let of = |fixes: Vec<Option<f64>>| -> Option<(f64, f64)> {
        let ratios: Vec<f64> =
            fixes.iter().zip(runs).filter_map(|(fix, run)| Some((*fix)? / run.earth.north_deg_h)).collect();
        let middle = median(ratios.clone());
        let spread = median(ratios.iter().map(|ratio| (ratio - middle).abs()).collect());
        (ratios.len() >= 2 && (middle - 1.0).abs() > AMPLITUDE_LIMIT.max(6.0 * spread)).then_some((middle, spread))
    };
    let Some((middle, _)) = of(runs.iter().map(|run| Some(run.before?.amplitude_deg_h)).collect()) else {
        return Ok(());
    };
    let mut shaped = learned.clone();
    shaped.keep(|each| {
        let is_scale = |candidate: &Candidate| matches!(candidate.part, Part::ScaleFactor | Part::EarthField { .. });
        !is_scale(&each.candidate) && !each.alternatives.iter().any(|(alternative, _)| is_scale(alternative))
    });
    let Ok(model) = shaped.model(base) else { return Ok(()) };
    if of(runs.iter().map(|run| run.solve(&model).map(|(fix, _)| fix.amplitude_deg_h)).collect()).is_none() {
        return Ok(());
    }
    let north = runs[0].earth.north_deg_h;
    let cosine = middle * north / EARTH_RATE_DEG_H;
    let latitude = (cosine.clamp(-1.0, 1.0).acos() / RAD_PER_DEG * 100.0).round() / 100.0;
    Err(Refusal::Campaign(format!(
        "the horizontal rate is {:.3} deg/h where the latitude of {} deg says {north:.3}: the latitude is wrong (the rate \
         belongs to {latitude} deg north or south) or the scale factor by {:+.1} %; correct that first",
        middle * north,
        runs[0].settings.latitude_deg,
        100.0 * (middle - 1.0)
    )))
}

/// Warnings about the campaign as a whole.
pub fn warn(runs: &[RunData], constant: &[String], still: bool, warnings: &mut Vec<Warning>) {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    if fit.is_empty() {
        warnings.push(warning("no run has the role \"fit\": nothing may be learned, the runs are only judged".into()));
    } else if fit.len() < 4 && !still {
        let count = fit.len();
        warnings.push(warning(format!(
            "only {count} run{} may be learned from: effects that change from run to run cannot be told from chance",
            if count == 1 { "" } else { "s" }
        )));
    }
    let headings: Vec<f64> = fit.iter().filter_map(|run| run.reference_deg).collect();
    if let Some(first) = headings.first()
        && headings.len() > 1
        && headings.iter().all(|heading| wrap_180_deg(heading - first).abs() < 20.0)
    {
        warnings.push(warning(format!(
            "all surveyed headings lie near {first:.1} deg: effects fixed to the body, to the Earth and to the index cannot \
             be told apart"
        )));
    }
    for name in constant {
        warnings.push(warning(format!("column `{name}` never changes: it is left out")));
    }
    for run in runs.iter().filter(|_| !still) {
        if let Some(refusal) = &run.refusal {
            warnings.push(Warning {
                run: Some(run.file.clone()),
                line: None,
                message: format!("no azimuth before: {refusal}"),
            });
        }
    }
}

/// Warns of runs whose channels leave the range that an effect was learned in.
pub fn warn_of_range(runs: &[RunData], learned: &Learned, warnings: &mut Vec<Warning>) {
    let range = |run: &RunData, name: &str| {
        let values = run.channel(name).unwrap_or_default();
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)))
    };
    let mut names: Vec<&str> = learned.taken.iter().filter_map(|each| each.candidate.channel.as_deref()).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let fit = runs.iter().filter(|run| run.role == Role::Fit).map(|run| range(run, name));
        let (low, high) = fit.fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        let margin = BEYOND * (high - low);
        for run in runs.iter().filter(|run| run.role != Role::Fit) {
            let (lowest, highest) = range(run, name);
            if lowest < low - margin || highest > high + margin {
                warnings.push(Warning {
                    run: Some(run.file.clone()),
                    line: None,
                    message: format!(
                        "`{name}` goes from {lowest:.6} to {highest:.6}; what it does was learned from {low:.6} to \
                         {high:.6} only"
                    ),
                });
            }
        }
    }
}

/// Channels that never change in any run.
pub fn constant_channels(runs: &[RunData]) -> Vec<String> {
    let Some(first) = runs.first() else { return Vec::new() };
    let still = |name: &String| {
        let mut seen: Option<f64> = None;
        runs.iter()
            .filter_map(|run| run.channel(name))
            .flatten()
            .all(|value| (*seen.get_or_insert(value) - value).abs() <= 1e-12 * value.abs())
    };
    first.channel_names().into_iter().filter(|name| still(name)).collect()
}

/// The reference that does not fit the others, if there is one: its place among the blocks and its error. The errors of
/// the others may depend on the heading as a first harmonic does.
pub fn outlying_reference(problem: &Problem, effects: &[f64]) -> Option<(usize, f64)> {
    let errors: Vec<(usize, f64, f64)> = problem
        .azimuth_errors(effects)
        .into_iter()
        .enumerate()
        .filter_map(|(i, each)| {
            each.map(|(error, _)| (i, error, problem.blocks[i].run.reference_deg.unwrap_or(0.0).to_radians()))
        })
        .collect();
    let number = errors.len();
    if number < LEAST_REFERENCES {
        return None;
    }
    let harmonic = number >= 8;
    let parameters = if harmonic { 3 } else { 1 };
    let squares = |without: Option<usize>| {
        let kept: Vec<_> = errors.iter().filter(|(i, ..)| Some(*i) != without).collect();
        let y: Vec<f64> = kept.iter().map(|each| each.1).collect();
        let mut columns = vec![vec![1.0; kept.len()]];
        if harmonic {
            columns.push(kept.iter().map(|each| each.2.cos()).collect());
            columns.push(kept.iter().map(|each| each.2.sin()).collect());
        }
        let mut left = y;
        for each in super::statistics::orthonormalise(&[], columns) {
            let along = super::statistics::dot(&left, &each);
            super::statistics::subtract(&mut left, along, &each);
        }
        super::statistics::dot(&left, &left)
    };
    let all = squares(None);
    let (index, error, best) =
        errors.iter().map(|&(i, error, _)| (i, error, squares(Some(i)))).min_by(|a, b| a.2.total_cmp(&b.2))?;
    let freedom = (number - 1 - parameters) as f64;
    // Survey and index alone scatter the others by a hundredth of a degree.
    let scatter = (best / freedom).max(1e-4);
    let p_value = f_tail((all - best) / scatter, 1.0, freedom) * number as f64;
    let typical = median(errors.iter().map(|each| each.1).collect());
    let outlying = p_value < OUTLIER && (error - typical).abs() > OUTLIER_DEG;
    // A wrong reference leaves the horizontal rate as it is; what acts in one run only need not.
    let share = |run: &RunData| Some((run.before?.amplitude_deg_h / run.earth.north_deg_h, run.before?.sigma_deg));
    let own = share(problem.blocks[index].run);
    let others = problem.blocks.iter().enumerate().filter(|(i, _)| *i != index);
    let others: Vec<f64> = others.filter_map(|(_, block)| Some(share(block.run)?.0)).collect();
    let is_the_run = own.is_some_and(|(own, sigma_deg)| stands_out(own, sigma_deg * RAD_PER_DEG, &others));
    (outlying && !is_the_run).then_some((index, error))
}

/// Whether a run's horizontal rate, known to a share of `sigma`, is another than those of others (all as shares of the Earth's).
fn stands_out(own: f64, sigma: f64, others: &[f64]) -> bool {
    let usual = median(others.to_vec());
    let scatter = SIGMA_OF_MEDIAN * median(others.iter().map(|other| (other - usual).abs()).collect());
    (own - usual).abs() > AMPLITUDE_SIGMAS * sigma.max(scatter).hypot(AMPLITUDE_SIGMA)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Others about 1 with a median deviation of 0.001: 5 · √(0.0015² + 0.002²) = 0.0125, with a sigma of its own of 0.01 it is 0.051.
    #[test]
    fn a_horizontal_rate_stands_out_by_hand() {
        let others = [0.999, 1.001, 1.0, 1.0, 1.001, 0.999, 1.002];
        assert!(stands_out(1.014, 0.001, &others) && stands_out(0.986, 0.001, &others));
        assert!(!stands_out(1.011, 0.001, &others) && !stands_out(1.04, 0.01, &others));
    }
}
