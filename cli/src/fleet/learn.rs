//! From units to what they have in common.

use std::sync::atomic::AtomicBool;

use learn::{Common, Standing, Statistics, Ways, form_cost};
use north_finder::effects::effect::Effect;
use north_finder::effects::signal::Signal;

use super::candidates::{Candidate, candidates};
use super::file::{Fleet, HasEffect, OtherEffect, Shared, UnitRecord};
use super::map::map;
use super::mixture::mixture;
use super::project::{projection, scaled};
use super::unit::{Source, Unit};
use crate::diagnose::effect_name;
use crate::failure::Failure;

/// Learns what units have in common: every one by itself on one of so many threads, then all together. `done` is called after each unit, twice: once it
/// has been learned from alone, and once it has been compared. `stop` is the flag of an interrupt.
pub fn learn(sources: &[Source], threads: usize, stop: &AtomicBool, done: impl Fn() + Sync) -> Result<Fleet, Failure> {
    sources.iter().try_for_each(Source::check)?;
    let read = |source: &Source| {
        let unit = Unit::read(source);
        done();
        unit
    };
    let units = map(sources, threads, stop, read)?.into_iter().collect::<Result<Vec<Unit>, Failure>>()?;
    let forms = candidates(units.iter().flat_map(|unit| &unit.effects));
    let compare = |unit: &Unit| {
        let statistics = statistics(unit, &forms);
        done();
        statistics
    };
    let statistics = map(&units, threads, stop, compare)?.into_iter().collect::<Result<Vec<Statistics>, Failure>>()?;
    let signals = signals(&units);
    let family = mixture(&statistics, &forms, signals);
    let record = |(unit, statistics): (&Unit, &Statistics)| record(unit, statistics, &forms, &family, signals);
    Ok(Fleet {
        units: units.len(),
        effects: family.iter().map(|(_, common)| Shared::new(common)).collect(),
        records: units.iter().zip(&statistics).map(record).collect(),
    })
}

/// Signals that effects may follow, for what a form costs: those without channels, and the channels of what was found.
fn signals(units: &[Unit]) -> usize {
    let mut channels: Vec<&str> =
        units.iter().flat_map(|unit| &unit.effects).flat_map(Effect::channels).map(|name| name.as_str()).collect();
    channels.sort_unstable();
    channels.dedup();
    Signal::without_channels().count() + channels.len()
}

/// What a unit says of the weights of all forms.
fn statistics(unit: &Unit, forms: &[Candidate]) -> Result<Statistics, Failure> {
    let effects: Vec<Effect> = forms.iter().map(|candidate| candidate.of_unit(&unit.effects)).collect();
    if let Some((runs, process)) = unit.runs()? {
        return Ok(Statistics::of_runs(&runs, process.as_ref(), &effects));
    }
    Ok(of_model(unit, forms, &effects))
}

fn of_model(unit: &Unit, forms: &[Candidate], effects: &[Effect]) -> Statistics {
    let number = |effect: &Effect| forms.iter().position(|candidate| candidate.is_of(effect));
    let known: Vec<usize> = unit.effects.iter().filter_map(number).collect();
    let nothing =
        || Statistics::of_posterior(effects, &[], &nalgebra::DVector::zeros(0), &nalgebra::DMatrix::zeros(0, 0));
    // An effect that the model has twice cannot be compared with others.
    let mut distinct = known.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let (Some((mean, covariance)), true) = (unit.posterior(), distinct.len() == unit.effects.len()) else {
        return nothing();
    };
    let blocks: Option<Vec<_>> =
        unit.effects.iter().zip(&known).map(|(own, &number)| projection(own, &effects[number])).collect();
    let Some(blocks) = blocks else { return nothing() };
    let (rows, columns) =
        blocks.iter().fold((0, 0), |(rows, columns), block| (rows + block.nrows(), columns + block.ncols()));
    let mut turn = nalgebra::DMatrix::zeros(rows, columns);
    let (mut row, mut column) = (0, 0);
    for block in &blocks {
        turn.view_mut((row, column), block.shape()).copy_from(block);
        row += block.nrows();
        column += block.ncols();
    }
    let (mean, covariance) = (&turn * mean, &turn * covariance * turn.transpose());
    let priors: Vec<f64> =
        known.iter().flat_map(|&number| (0..effects[number].count()).map(move |k| effects[number].prior(k))).collect();
    let (mean, covariance) = scaled(&priors, mean, covariance);
    Statistics::of_posterior(effects, &known, &mean, &covariance)
}

/// How a unit stands to the family.
fn record(
    unit: &Unit,
    statistics: &Statistics,
    forms: &[Candidate],
    family: &[(usize, Common)],
    signals: usize,
) -> UnitRecord {
    let ways: Vec<Ways> = family.iter().map(|(number, common)| Ways::new(*number, common)).collect();
    let is_own = |number: &usize| {
        let found = unit.effects.iter().any(|effect| forms[*number].is_of(effect));
        found && !family.iter().any(|(known, _)| known == number)
    };
    let own: Vec<usize> = (0..forms.len()).filter(is_own).collect();
    let costs: Vec<(usize, f64)> =
        own.iter().map(|&number| (number, form_cost(&forms[number].effect, signals))).collect();
    let standing = Standing::new(statistics, &ways, &costs);
    let has = |((_, common), place): (&(usize, Common), &Option<_>)| has_effect(&common.effect, place.as_ref());
    let other = |(number, probability): (&usize, &f64)| OtherEffect {
        name: effect_name(&forms[*number].effect),
        probability: *probability,
    };
    UnitRecord {
        name: unit.name.clone(),
        outside: standing.outside,
        effects: family.iter().zip(&standing.places).map(has).collect(),
        others: own.iter().zip(&standing.others).filter(|(_, probability)| **probability > 0.5).map(other).collect(),
    }
}

/// How a unit has an effect, in numbers.
fn has_effect(effect: &Effect, place: Option<&learn::Place>) -> HasEffect {
    let weights = |likeliest: &nalgebra::DVector<f64>| {
        likeliest.iter().enumerate().map(|(number, weight)| weight * effect.prior(number)).collect()
    };
    HasEffect {
        family: place.map_or(0.0, |place| place.family),
        own: place.map_or(0.0, |place| place.own),
        weights: place.map_or_else(|| vec![0.0; effect.count()], |place| weights(&place.likeliest)),
    }
}
