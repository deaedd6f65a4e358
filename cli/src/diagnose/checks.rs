//! Doubts about a campaign, before anything is learned from it.

use std::collections::BTreeSet;

use north_finder::earth::EARTH_RATE_DEG_H;
use north_finder::effects::ErrorModel;
use north_finder::effects::doubt::Doubt;
use north_finder::effects::effect::{Effect, Port};
use north_finder::units::{RAD_PER_DEG, wrap_180_deg};
use rayon::prelude::*;

use super::found::Found;
use super::names::{EARTH_FIELD, Named};
use super::statistics::median;
use super::{Refusal, Warning, stations};
use crate::campaign::{Campaign, Role};
use crate::count::counted;
use crate::run_data::RunData;

/// Relative amplitude error beyond which latitude and recording do not belong together.
const AMPLITUDE_LIMIT: f64 = 0.03;
/// Share of a channel's range that a run may go beyond it.
const BEYOND: f64 = 0.1;
/// What many runs beyond a channel's range are.
const OUT_OF_RANGE: &str = "a channel leaves the range in which its effect was learned";
/// What many runs without a channel are.
const LACKS_CHANNEL: &str = "a column that other runs have is not in every row";
/// What many pairs of runs that overlap are.
const OVERLAPS: &str =
    "they overlap: their errors are not independent, and what is learned from one must not be judged by the other";
/// The slope of azimuths against tilts is that of a latitude of the other sign within this share of it and so many sigma, and stands out by as many.
const LIKE_OTHER_SIGN: f64 = 0.2;
const OTHER_SIGN_SIGMAS: f64 = 6.0;

/// Leaves out runs of a dead gyro, by name, as long as there is another.
pub fn leave_out_dead(runs: &mut Vec<RunData>, warnings: &mut Vec<Warning>) {
    if runs.iter().all(RunData::repeats_itself) {
        return;
    }
    runs.retain(|run| {
        let dead = run.repeats_itself();
        if dead {
            let message = "the gyro repeats the same reading throughout: the run is left out";
            warnings.push(Warning::of_run(&run.file, message));
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

/// Refuses a campaign whose horizontal rate is not that of its latitude, nor is with what was learned. A constant scale factor or
/// a field along the axis would make any latitude right, and are not asked. A latitude does not vary: where only a scale factor that does makes it right,
/// there is a warning.
pub fn refuse_latitude(
    runs: &[RunData],
    found: Option<&Found>,
    base: &ErrorModel,
    warnings: &mut Vec<Warning>,
) -> Result<(), Refusal> {
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
    let is_scale = |effect: &Effect| effect.port == Port::Scale || Named::new(effect).name == EARTH_FIELD;
    let varies = |effect: &Effect| effect.port == Port::Scale && !effect.factors.is_empty();
    let is_constant = |effect: &Effect| is_scale(effect) && !varies(effect);
    let may_be = |effect: &Effect, which: &dyn Fn(&Effect) -> bool| {
        which(effect) || found.is_some_and(|found| found.in_its_place(effect).iter().any(which))
    };
    let is_right_with = |is_asked: &dyn Fn(&Effect) -> bool| {
        let mut shaped = found.map_or_else(|| base.clone(), |found| found.model().clone());
        shaped.doubt = Doubt::default();
        shaped.effects.retain(|effect| base.effects.contains(effect) || is_asked(effect));
        let with = |run: &RunData| Some(run.replay(&shaped, &mut |_| ()).ok()?.amplitude_deg_h);
        of(runs.par_iter().map(with).collect()).is_none()
    };
    if is_right_with(&|effect| !may_be(effect, &is_scale)) {
        return Ok(());
    }
    let north = runs[0].earth.north_deg_h;
    let cosine = middle * north / EARTH_RATE_DEG_H;
    let latitude = (cosine.clamp(-1.0, 1.0).acos() / RAD_PER_DEG * 100.0).round() / 100.0;
    let doubt = format!(
        "the horizontal rate is {:.3} deg/h where the latitude of {} deg says {north:.3}: the latitude is wrong (the rate \
         belongs to {latitude} deg north or south) or the scale factor by {:+.1} %",
        middle * north,
        runs[0].settings.latitude_deg,
        100.0 * (middle - 1.0)
    );
    let may_be_latitude =
        found.is_some_and(|found| found.model().effects.iter().any(|effect| may_be(effect, &is_constant)));
    if may_be_latitude || !is_right_with(&|_| true) {
        return Err(Refusal::Campaign(format!("{doubt}; correct that first")));
    }
    warnings.push(Warning::of_campaign(format!("{doubt}; what was learned of the scale factor makes it right")));
    Ok(())
}

/// Refuses a campaign whose latitude has the wrong sign. The solution takes Ω sin φ times the tilt out of the rates; with the wrong sign twice that
/// remains, which turns the azimuth ψ by 2 Ω sin φ (left tilt · cos ψ − forward tilt · sin ψ)/(Ω cos φ), and references and stations show it. A gyro as
/// sensitive to gravity as that (17 °/h at 1 g at 35°) would look the same, and is not asked; one that is less so, or an error of the level, makes another slope. And it has to explain
/// nearly all: with the right sign the misses have to be less than a third of what they are.
pub fn refuse_other_sign(runs: &[RunData]) -> Result<(), Refusal> {
    let azimuths: Vec<Option<f64>> = runs.iter().map(|run| Some(run.before?.azimuth_deg)).collect();
    let misses = stations::misses_deg(runs, &azimuths);
    let pair = |(run, miss): (&RunData, &Option<f64>)| {
        let (sin, cos) = run.before?.azimuth_deg.to_radians().sin_cos();
        let tilts = || run.samples.iter().filter(|sample| run.enters(sample)).filter_map(|sample| sample.level);
        let count = tilts().count() as f64;
        let turned: f64 = tilts().map(|tilt| (tilt.left * cos - tilt.forward * sin) / count).sum();
        let by_model = 2.0 * run.earth.up_deg_h / run.earth.north_deg_h * turned;
        by_model.is_finite().then_some((-by_model, (*miss)?.to_radians()))
    };
    let pairs: Vec<(f64, f64)> = runs.iter().zip(&misses).filter_map(pair).collect();
    let count = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|pair| of(pair.0 - x, pair.1 - y)).sum::<f64>();
    let squares = sum(&|x, _| x * x);
    let slope = sum(&|x, y| x * y) / squares;
    let sigma = (sum(&|x, y| (y - slope * x).powi(2)) / (count - 2.0) / squares).sqrt();
    let limit = LIKE_OTHER_SIGN.min(OTHER_SIGN_SIGMAS * sigma);
    let explains = 9.0 * sum(&|x, y| (y - x).powi(2)) < sum(&|_, y| y * y);
    if count > 3.0 && explains && (slope - 1.0).abs() < limit && slope > OTHER_SIGN_SIGMAS * sigma {
        let latitude_deg = runs[0].settings.latitude_deg;
        return Err(Refusal::Campaign(format!(
            "the azimuths of tilted runs miss by what a latitude of {} deg does to them ({slope:.2} ± {sigma:.2} of it): \
             latitude_deg = {latitude_deg} has the wrong sign, or a level accelerometer both of its signs; correct that first",
            -latitude_deg
        )));
    }
    Ok(())
}

/// Warns of runs that hold one stretch of a recording, or were made at one time: their errors are not independent.
pub fn warn_of_overlaps(runs: &[RunData], campaign: &Campaign, warnings: &mut Vec<Warning>) {
    let spans: Vec<Option<(f64, f64)>> = runs
        .iter()
        .map(|run| {
            let start_s = campaign.start_s(campaign.runs.iter().find(|each| each.file == run.file)?)?;
            Some((start_s, start_s + run.samples.last()?.t_s))
        })
        .collect();
    for (i, run) in runs.iter().enumerate() {
        for (other, span) in runs.iter().zip(&spans).take(i) {
            let at_one_time = spans[i].zip(*span).is_some_and(|(a, b)| a.0.max(b.0) < a.1.min(b.1));
            let what = match (run.overlaps(other), at_one_time) {
                (true, _) => "holds a stretch of the same recording as",
                (false, true) => "was made, by `started`, at the same time as",
                (false, false) => continue,
            };
            let consequence = match run.role == other.role {
                true => "their errors are not independent",
                false => "what is learned from one must not be judged by the other",
            };
            let message = format!("it {what} {}: {consequence}", other.file);
            let warning = Warning::of_run(&run.file, message);
            warnings.push(Warning { of_many: Some(OVERLAPS), other: Some(other.file.clone()), ..warning });
        }
    }
}

/// Warnings about the campaign as a whole.
pub fn warn(runs: &[RunData], constant: &[String], still: bool, warnings: &mut Vec<Warning>) {
    let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
    if fit.is_empty() {
        warnings.push(Warning::of_campaign(
            "no run has the role \"fit\": nothing may be learned, the runs are only judged".into(),
        ));
    } else if fit.len() < 4 && !still {
        warnings.push(Warning::of_campaign(format!(
            "only {} may be learned from: effects that change from run to run cannot be told from chance",
            counted(fit.len(), "run")
        )));
    }
    let headings: Vec<f64> = fit.iter().filter_map(|run| run.reference_deg).collect();
    if let Some(first) = headings.first()
        && headings.len() > 1
        && headings.iter().all(|heading| wrap_180_deg(heading - first).abs() < 20.0)
    {
        warnings.push(Warning::of_campaign(format!(
            "all surveyed headings lie near {first:.1} deg: effects fixed to the body, to the Earth and to the index cannot \
             be told apart"
        )));
    }
    for name in constant {
        warnings.push(Warning::of_campaign(format!("column `{name}` never changes: it is left out")));
    }
    for run in runs.iter().filter(|_| !still) {
        if let Some(refusal) = &run.refusal {
            warnings.push(Warning::of_run(&run.file, format!("no azimuth before: {refusal}")));
        }
    }
}

/// Warns of runs whose channels leave the range that an effect was learned in.
pub fn warn_of_range(runs: &[RunData], model: &ErrorModel, warnings: &mut Vec<Warning>) {
    let range = |run: &RunData, name: &str| {
        let values = run.channel(name).unwrap_or_default();
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)))
    };
    let mut names: Vec<&str> = model.effects.iter().flat_map(Effect::channels).map(|name| name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let fit = runs.iter().filter(|run| run.role == Role::Fit).map(|run| range(run, name));
        let (low, high) = fit.fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        let margin = BEYOND * (high - low);
        for run in runs.iter().filter(|run| run.role != Role::Fit) {
            let (lowest, highest) = range(run, name);
            if lowest < low - margin || highest > high + margin {
                let message = format!(
                    "`{name}` goes from {lowest:.6} to {highest:.6}; what it does was learned from {low:.6} to \
                     {high:.6} only"
                );
                warnings.push(Warning { of_many: Some(OUT_OF_RANGE), ..Warning::of_run(&run.file, message) });
            }
        }
    }
}

/// Warns of channels that some runs have and others lack: what follows them is learned of runs only that all have them.
pub fn warn_of_missing_channels(runs: &[RunData], warnings: &mut Vec<Warning>) {
    let all = channel_names(runs);
    for run in runs {
        let consequence = match run.role {
            Role::Fit => "it is not looked at as a cause in any run",
            _ => "the run has no azimuth with an effect of it",
        };
        for name in all.difference(&run.channel_names().into_iter().collect()) {
            let message = format!("column `{name}`, which other runs have, is not in every row: {consequence}");
            warnings.push(Warning { of_many: Some(LACKS_CHANNEL), ..Warning::of_run(&run.file, message) });
        }
    }
}

/// The channels of all runs.
fn channel_names(runs: &[RunData]) -> BTreeSet<String> {
    runs.iter().flat_map(RunData::channel_names).collect()
}

/// Channels that never change in any run.
pub fn constant_channels(runs: &[RunData]) -> Vec<String> {
    let still = |name: &String| {
        let mut seen: Option<f64> = None;
        runs.iter()
            .filter_map(|run| run.channel(name))
            .flatten()
            .all(|value| (*seen.get_or_insert(value) - value).abs() <= 1e-12 * value.abs())
    };
    channel_names(runs).into_iter().filter(still).collect()
}
