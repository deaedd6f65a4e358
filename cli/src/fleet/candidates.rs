//! Forms of effects that units of a fleet have, with constants by which they can be compared.

use learn::{Common, form};
use north_finder::effects::effect::Effect;
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Linear, Shape, Sharp, Smooth};

use crate::diagnose::median;

/// Fewest units whose constants say how much they differ from one to the next.
const LEAST_SPREAD: usize = 4;
/// A median absolute deviation is this share of the standard deviation of a normal distribution.
const OF_A_DEVIATION: f64 = 0.6745;

/// A form, with the constants that are usual for it.
#[derive(Clone, Debug)]
pub struct Candidate {
    form: String,
    pub effect: Effect,
    /// Standard deviation of every constant from unit to unit; of its logarithm where it is a scale. 0 where too few have it.
    pub spreads: Vec<f64>,
}

/// The forms of all units' effects.
pub fn candidates<'a>(effects: impl Iterator<Item = &'a Effect>) -> Vec<Candidate> {
    let mut groups: Vec<(String, Vec<&Effect>)> = Vec::new();
    for effect in effects {
        let form = key(effect);
        match groups.iter_mut().find(|(other, _)| *other == form) {
            Some((_, group)) => group.push(effect),
            None => groups.push((form, vec![effect])),
        }
    }
    groups.into_iter().filter_map(|(form, group)| candidate(form, &group)).collect()
}

fn candidate(form: String, group: &[&Effect]) -> Option<Candidate> {
    let first = group.first()?;
    let mut factors: Vec<Factor> = first.factors.to_vec();
    for (place, factor) in factors.iter_mut().enumerate() {
        let own: Vec<&Factor> = group.iter().filter_map(|effect| effect.factors.get(place)).collect();
        factor.shape = common_shape(factor.shape, &own);
    }
    let mut effect = Effect::new(first.port, &factors);
    let mut spreads = Vec::new();
    for (place, factor) in factors.iter().enumerate() {
        for number in 0..factor.constants().len() {
            let of = |effect: &&Effect| effect.factors.get(place)?.constants().get(number).copied();
            let all: Vec<_> = group.iter().filter_map(of).collect();
            let is_scale = all.first().is_some_and(|constant| constant.is_scale);
            let values: Vec<f64> =
                all.iter().map(|constant| if is_scale { constant.value.ln() } else { constant.value }).collect();
            let usual = median(values.clone());
            if let Some(factor) = effect.factors.get_mut(place) {
                factor.set(number, if is_scale { usual.exp() } else { usual });
            }
            let off = median(values.iter().map(|value| (value - usual).abs()).collect());
            spreads.push(if group.len() >= LEAST_SPREAD { off / OF_A_DEVIATION } else { 0.0 });
        }
    }
    effect.validate().ok().map(|()| Candidate { form, effect, spreads })
}

/// The shape of a factor on the interval of all units.
fn common_shape(shape: Shape, own: &[&Factor]) -> Shape {
    let middle = |of: fn(&Shape) -> Option<f32>| {
        median(own.iter().filter_map(|factor| of(&factor.shape)).map(f64::from).collect()) as f32
    };
    let ends = || {
        let all = own.iter().filter_map(|factor| interval(&factor.shape));
        all.fold((f32::INFINITY, f32::NEG_INFINITY), |ends, own| (ends.0.min(own.0), ends.1.max(own.1)))
    };
    match shape {
        Shape::Linear(_) => Linear {
            reference: middle(|shape| if let Shape::Linear(linear) = shape { Some(linear.reference) } else { None }),
            scale: middle(|shape| if let Shape::Linear(linear) = shape { Some(linear.scale) } else { None }),
        }
        .into(),
        Shape::Smooth(smooth) => {
            let (low, high) = ends();
            Smooth { low, high, ..smooth }.into()
        }
        Shape::Sharp(_) => {
            let (low, high) = ends();
            Sharp { low, high }.into()
        }
        other => other,
    }
}

fn interval(shape: &Shape) -> Option<(f32, f32)> {
    match shape {
        Shape::Smooth(Smooth { low, high, .. }) | Shape::Sharp(Sharp { low, high }) => Some((*low, *high)),
        _ => None,
    }
}

/// A form, and which of its factors stand beside a constant.
fn key(effect: &Effect) -> String {
    let constants = effect.factors.iter().map(|factor| if factor.constant { '1' } else { '0' });
    format!("{} {}", form(effect), constants.collect::<String>())
}

impl Candidate {
    /// With what is known of the form otherwise.
    pub fn known(common: &Common) -> Self {
        Self { form: key(&common.effect), effect: common.effect.clone(), spreads: common.spreads.clone() }
    }

    /// Whether an effect is of this form.
    pub fn is_of(&self, effect: &Effect) -> bool {
        key(effect) == self.form
    }

    /// The form with the constants that a unit has by itself, where it has the form.
    pub fn of_unit(&self, own: &[Effect]) -> Effect {
        let mut effect = self.effect.clone();
        let Some(found) = own.iter().find(|effect| self.is_of(effect)) else { return effect };
        for (factor, found) in effect.factors.iter_mut().zip(&found.factors) {
            for (number, constant) in found.constants().iter().enumerate() {
                factor.set(number, constant.value);
            }
        }
        if effect.validate().is_ok() { effect } else { self.effect.clone() }
    }
}

#[cfg(test)]
mod tests {
    use north_finder::effects::dynamics::LowPass;
    use north_finder::effects::effect::Port;
    use north_finder::effects::signal::Time;

    use super::*;

    fn effect(tau_s: f32, low: f32, high: f32) -> Effect {
        let shape = Smooth { low, high, count: 3 }.into();
        Effect::new(Port::Rate, &[Factor::new(Time.into(), &[LowPass { tau_s }.into()], shape)])
    }

    /// Four units whose time constants are 8, 16, 16 and 32 s and whose temperatures go from 10 to 40: usual are 16 s, a factor of 2 off in the middle.
    #[test]
    fn usual_constants_and_the_interval_of_all() {
        let units =
            [effect(8.0, 12.0, 30.0), effect(16.0, 10.0, 30.0), effect(16.0, 20.0, 30.0), effect(32.0, 20.0, 40.0)];
        let found = candidates(units.iter());
        assert_eq!(found.len(), 1);
        let factor = &found[0].effect.factors[0];
        assert!((factor.constants()[0].value - 16.0).abs() < 1e-4);
        assert!(matches!(factor.shape, Shape::Smooth(Smooth { low: 10.0, high: 40.0, .. })));
        assert!((found[0].spreads[0] - 2f64.ln() / OF_A_DEVIATION).abs() < 1e-6);
        // A unit that has the form keeps its own constant on the common interval.
        let own = found[0].of_unit(&units[..1]);
        assert!((own.factors[0].constants()[0].value - 8.0).abs() < 1e-4 && own.factors[0].shape == factor.shape);
    }
}
