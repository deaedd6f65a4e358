//! An effect beside a model is changed for better neighbours: in its form, and in its constants.

use std::collections::BTreeMap;
use std::ops::Range;

use north_finder::effects::dynamics::Dynamics;
use north_finder::effects::effect::{Effect, MAX_FACTORS};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::Shape;
use rayon::prelude::*;

use super::bank::{Left, best_of_each, most_promising};
use super::grammar::{extended, fineness, of_rate, redriven, reduced, replaced, reshaped};
use super::model::Model;
use super::proposals::{Proposals, form};

/// Neighbours of a form whose exact evidence is computed, and those of them that are tuned.
const NEAREST: usize = 12;
const TUNED: usize = 2;
/// Starts of one kind of dynamics that are tuned before kinds are compared.
const OF_A_KIND: usize = 2;
/// Factors that are tried as a further one, each of another signal.
const FURTHER: usize = 8;
/// Most changes of form in a row.
const REACH_OF_CONTENDERS: usize = 2;
const REACH: usize = 6;
/// Unit in which the edges of a sector are tuned.
const SECTOR_STEP_DEG: f64 = 60.0;
/// First step of a constant, in its unit.
const FIRST_STEP: f64 = 0.35;

/// How thoroughly an effect's constants are tuned: rounds over all of them, and the smallest step.
struct Tuning {
    rounds: usize,
    least_step: f64,
}

const ROUGHLY: Tuning = Tuning { rounds: 1, least_step: 0.1 };
const FINELY: Tuning = Tuning { rounds: 3, least_step: 0.02 };

impl Proposals<'_> {
    /// An effect beside a model, changed for better neighbours and finely tuned, with its gain. `left`: what the model leaves.
    pub fn improved(&self, model: &Model<'_>, effect: Effect, gain: f64, left: &Left) -> (f64, Effect) {
        let (gain, effect) = self.climb(model, effect, gain, left, REACH);
        self.tuned(model, effect, gain, &FINELY)
    }

    /// An effect changed by few forms: enough to compare it with others.
    pub fn improved_a_little(&self, model: &Model<'_>, effect: Effect, gain: f64, left: &Left) -> (f64, Effect) {
        self.climb(model, effect, gain, left, REACH_OF_CONTENDERS)
    }

    /// An effect with its constants finely tuned, with its gain.
    pub fn finely_tuned(&self, model: &Model<'_>, effect: Effect) -> (f64, Effect) {
        let gain = self.gain(model, &effect);
        self.tuned(model, effect, gain, &FINELY)
    }

    /// An effect with its constants roughly tuned, with its gain.
    pub fn roughly_tuned(&self, model: &Model<'_>, effect: Effect, gain: f64) -> (f64, Effect) {
        self.tuned(model, effect, gain, &ROUGHLY)
    }

    /// Replaces the form by a neighbouring one, at most so many times, as long as the gain grows by more than half a nat. Where no form of its own signals,
    /// and none with one factor more, is better, one with another factor in the place of one may be.
    fn climb(&self, model: &Model<'_>, mut effect: Effect, mut gain: f64, left: &Left, steps: usize) -> (f64, Effect) {
        for _ in 0..steps {
            let better = |forms: Vec<Effect>| self.best_of(model, forms, left).filter(|(above, _)| *above > gain + 0.5);
            let own = [self.forms_of(&effect, left), self.extensions_of(&effect, left, FURTHER)].concat();
            let best = better(own).or_else(|| better(self.exchanges_of(&effect, left)));
            let Some(best) = best else { break };
            (gain, effect) = best;
        }
        (gain, effect)
    }

    /// The best of some forms beside a model, roughly tuned, with its gain.
    fn best_of(&self, model: &Model<'_>, forms: Vec<Effect>, left: &Left) -> Option<(f64, Effect)> {
        let near = self.nearest(forms, left);
        let gains = near.into_par_iter().map(|each| (self.gain(model, &each), each)).collect();
        most_promising(gains, TUNED)
            .into_par_iter()
            .map(|(gain, each)| self.roughly_tuned(model, each, gain))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Removes factors, each simpler form finely tuned, as long as the gain does not fall.
    pub fn simplified(&self, model: &Model<'_>, mut effect: Effect, mut gain: f64) -> Effect {
        loop {
            let simpler = reduced(&effect).into_par_iter();
            let best = simpler.map(|each| self.finely_tuned(model, each)).max_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((above, each)) if above >= gain => (gain, effect) = (above, each),
                _ => return effect,
            }
        }
    }

    /// Other forms of the same signals.
    pub fn forms_of(&self, effect: &Effect, left: &Left) -> Vec<Effect> {
        let mut forms = reshaped(effect, &self.grammar, self.runs);
        let others = |f: usize| [self.other_shapes(effect, f, left), self.other_dynamics(effect, f, left)].concat();
        forms.extend((0..effect.factors.len()).into_par_iter().flat_map_iter(others).collect::<Vec<Effect>>());
        if let Some(of_rate) = of_rate(effect) {
            forms.extend(self.other_dynamics(&of_rate, effect.factors.len(), left));
        }
        forms
    }

    /// The same with one factor more, one of so many.
    pub fn extensions_of(&self, effect: &Effect, left: &Left, most: usize) -> Vec<Effect> {
        // At the levels a constant may have no place beyond itself.
        if effect.factors.len() == MAX_FACTORS || !self.grammar.ports.contains(&effect.port) {
            return Vec::new();
        }
        let fitted = self.bank.fitted(self.runs, effect, left);
        extended(effect, &self.further.beside(&self.bank.coarse, left, &fitted, most))
    }

    /// The same with another factor, of any signal, in the place of one.
    fn exchanges_of(&self, effect: &Effect, left: &Left) -> Vec<Effect> {
        let simpler = if effect.factors.len() > 1 { reduced(effect) } else { Vec::new() };
        simpler.iter().flat_map(|each| self.extensions_of(each, left, FURTHER)).collect()
    }

    /// The most promising forms, each once: effects of one form differ by constants, which are tuned.
    pub fn nearest(&self, forms: Vec<Effect>, left: &Left) -> Vec<Effect> {
        let promise = |each: Effect| (self.bank.promise(self.runs, &each, left) - self.grammar.cost(&each), each);
        let mut promising: Vec<(f64, Effect)> = forms.into_par_iter().map(promise).collect();
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut seen: Vec<String> = Vec::new();
        let mut nearest: Vec<Effect> = Vec::new();
        for (_, each) in promising {
            let form = form(&each);
            if nearest.len() < NEAREST && !seen.contains(&form) {
                seen.push(form);
                nearest.push(each);
            }
        }
        nearest
    }

    /// Tunes every constant in turn, with steps that become smaller.
    fn tuned(&self, model: &Model<'_>, effect: Effect, gain: f64, tuning: &Tuning) -> (f64, Effect) {
        let of_factor = |(f, factor): (usize, &Factor)| moves_of(f, factor, 0..factor.constants().len());
        let constants: Vec<(usize, usize)> = effect.factors.iter().enumerate().flat_map(of_factor).collect();
        self.tuned_by(effect, gain, tuning, &constants, &|each| self.gain(model, each))
    }

    /// The same with these constants, by another gain.
    fn tuned_by(
        &self,
        mut effect: Effect,
        mut gain: f64,
        tuning: &Tuning,
        constants: &[(usize, usize)],
        gain_of: &dyn Fn(&Effect) -> f64,
    ) -> (f64, Effect) {
        // Of every constant the step to begin with, and the effect when its steps were last tried.
        let mut known: Vec<(f64, Option<Effect>)> = vec![(FIRST_STEP, None); constants.len()];
        for _ in 0..tuning.rounds {
            let before = gain;
            for (&(f, number), (first_step, tried)) in constants.iter().zip(&mut known) {
                if tried.as_ref() == Some(&effect) {
                    continue;
                }
                let unit = self.unit(&effect.factors[f], number);
                let fineness = fineness(&effect.factors[f]);
                let mut step = *first_step;
                while step > tuning.least_step / fineness {
                    let last = gain;
                    for sign in [1.0, -1.0] {
                        let Some(each) = moved_by(&effect, f, number, sign * step * unit) else { continue };
                        let above = gain_of(&each);
                        if above > gain {
                            (gain, effect) = (above, each);
                            // Where it jumps, the gain has maxima at all distances.
                            *first_step = if fineness > 1.0 { FIRST_STEP } else { FIRST_STEP.min(2.0 * step) };
                            break;
                        }
                    }
                    // By less than a third of a nat nobody tells two constants apart.
                    let has_gained = gain - last >= 0.3;
                    if !has_gained {
                        step *= 0.5;
                    }
                }
                *tried = Some(effect.clone());
            }
            if gain < before + 1.0 {
                break;
            }
        }
        (gain, effect)
    }

    /// The effect with another shape in the place of one factor's, of every kind the one that promises most with its constants tuned in coarse rows:
    /// what is tuned already hides a better shape that is not.
    fn other_shapes(&self, effect: &Effect, f: usize, left: &Left) -> Vec<Effect> {
        let own = &effect.factors[f];
        let Some(span) = self.grammar.span(self.runs, own.signal, &own.dynamics) else { return Vec::new() };
        let (input, beside) = (self.bank.input(self.runs, own), self.bank.beside_factor(self.runs, effect, f));
        let gain_of = |each: &Effect| left.gain(&beside.columns(&each.factors[f], &input)).0 - self.grammar.cost(each);
        let mut best: BTreeMap<String, (f64, Effect)> = BTreeMap::new();
        Shape::starts(&span, &mut |shape| {
            let factor = Factor { shape, ..own.clone() };
            let Some(each) = replaced(effect, f, factor) else { return };
            let gain = gain_of(&each);
            let known = best.entry(form(&each)).or_insert_with(|| (f64::NEG_INFINITY, each.clone()));
            if gain > known.0 {
                *known = (gain, each);
            }
        });
        let first = own.dynamics.iter().map(|dynamics| dynamics.constants().len()).sum::<usize>();
        let tuned = |(gain, each): (f64, Effect)| {
            let factor = &each.factors[f];
            let constants = moves_of(f, factor, first..first + factor.shape.constants().len());
            self.tuned_by(each, gain, &ROUGHLY, &constants, &gain_of).1
        };
        best.into_values().map(tuned).collect()
    }

    /// The effect with other dynamics in the place of one factor's, those that promise most with their constants tuned in coarse rows, from two starts of every kind.
    fn other_dynamics(&self, effect: &Effect, f: usize, left: &Left) -> Vec<Effect> {
        let beside = self.bank.beside_factor(self.runs, effect, f);
        let gain_of = |each: &Effect| {
            let factor = &each.factors[f];
            left.gain(&beside.columns(factor, &self.bank.input(self.runs, factor))).0 - self.grammar.cost(each)
        };
        let starts = redriven(effect, f, &self.grammar, self.runs);
        let starts: Vec<_> = starts.into_par_iter().map(|each| (form(&each), gain_of(&each), each)).collect();
        let best = most_promising(best_of_each(OF_A_KIND, starts), NEAREST);
        let tuned = |(place, (gain, each)): (usize, (f64, Effect))| {
            if place >= OF_A_KIND * TUNED {
                return each;
            }
            let count = each.factors[f].dynamics.iter().map(|dynamics| dynamics.constants().len()).sum::<usize>();
            let constants = moves_of(f, &each.factors[f], 0..count);
            self.tuned_by(each, gain, &ROUGHLY, &constants, &gain_of).1
        };
        best.into_par_iter().enumerate().map(tuned).collect()
    }

    /// Unit in which a constant of a factor is tuned: 1 for the logarithm of a scale; of a place the width that its shape has, or else the standard
    /// deviation of what the part gets; of a signal's ratio its size.
    fn unit(&self, factor: &Factor, number: usize) -> f64 {
        let constants = factor.constants();
        let number = moved_together(factor, number).first().copied().unwrap_or(number);
        let Some(constant) = constants.get(number).filter(|constant| !constant.is_scale) else { return 1.0 };
        let deviation = |before: &[Dynamics]| {
            self.grammar.span(self.runs, factor.signal, before).map_or(1.0, |span| span.deviation)
        };
        let mut first = 0;
        for (place, dynamics) in factor.dynamics.iter().enumerate() {
            first += dynamics.constants().len();
            if number < first {
                return deviation(&factor.dynamics[..place]);
            }
        }
        let of_shape = factor.shape.constants();
        if number >= first + of_shape.len() {
            return constant.value.abs();
        }
        match factor.shape {
            Shape::Sector(_) => SECTOR_STEP_DEG,
            _ => of_shape
                .iter()
                .find(|each| each.is_scale)
                .map_or_else(|| deviation(&factor.dynamics), |width| width.value),
        }
    }
}

/// Numbers of an effect's constants: of the factor, and in it.
pub fn constants_of(effect: &Effect) -> Vec<(usize, usize)> {
    effect
        .factors
        .iter()
        .enumerate()
        .flat_map(|(f, factor)| (0..factor.constants().len()).map(move |number| (f, number)))
        .collect()
}

/// Moves by which these constants of a factor are tuned: first all places of one part together, which a relay with near thresholds, a narrow sector or a short middle
/// line cannot pass each other by, then every constant by itself.
fn moves_of(f: usize, factor: &Factor, constants: Range<usize>) -> Vec<(usize, usize)> {
    let first = factor.constants().len();
    let together = (first..=first + factor.dynamics.len()).filter(|&number| {
        let moved = moved_together(factor, number);
        moved.len() > 1 && constants.contains(&moved[0])
    });
    together.chain(constants.clone()).map(|number| (f, number)).collect()
}

/// The constants of a factor that a number stands for: itself, or beyond the last one all places of its first dynamics, of its second one, of its shape.
fn moved_together(factor: &Factor, number: usize) -> Vec<usize> {
    let Some(wanted) = number.checked_sub(factor.constants().len()) else { return vec![number] };
    let parts = factor.dynamics.iter().map(Dynamics::constants).chain([factor.shape.constants()]);
    let mut first = 0;
    for (part, constants) in parts.enumerate() {
        if part == wanted {
            return (0..constants.len()).filter(|&i| !constants[i].is_scale).map(|i| first + i).collect();
        }
        first += constants.len();
    }
    Vec::new()
}

/// The effect with one constant, or all places of one part, moved by so much: its logarithm where it is a scale, else by its own unit.
pub fn moved_by(effect: &Effect, f: usize, number: usize, step: f64) -> Option<Effect> {
    let mut effect = effect.clone();
    let factor = effect.factors.get_mut(f)?;
    let (constants, moved) = (factor.constants(), moved_together(factor, number));
    moved.first()?;
    for number in moved {
        let constant = constants.get(number)?;
        factor.set(number, if constant.is_scale { constant.value * step.exp() } else { constant.value + step });
    }
    effect.validate().ok().map(|()| effect)
}
