//! Effects with a physical name, and their parameters in units of the field.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use north_finder::effects::dynamics::Dynamics;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::Shape;
use north_finder::effects::signal::Signal;

/// The gyro's own temperature: what an effect follows where it is named after it.
const TEMPERATURE: &str = "temp_c";
/// An index offset and a field fixed to the Earth turn every azimuth by the same angle: only another latitude tells them apart.
pub const INDEX_OFFSET: &str = "index-offset";
pub const EARTH_FIELD: &str = "earth-field";
/// A bias of the level sensors leaves a first harmonic of the index angle: only another latitude tells them apart.
pub const LEVEL_BIAS: &str = "level-bias";
pub const FIRST_HARMONIC: &str = "body-harmonic-1";
/// In proportion to the specific force along the sensitive axis.
pub const GRAVITY_SENSITIVITY: &str = "gravity-sensitivity";
/// Not an effect of the gyro: the campaign says another latitude than that of the place.
pub const LATITUDE: &str = "latitude";
const S_PER_H: f64 = 3600.0;

/// Whether an effect of this name turns azimuths at one latitude as another effect does, and otherwise at another: as cos φ, or as tan φ where the tilt enters.
pub fn differs_by_latitude(name: &str) -> bool {
    [INDEX_OFFSET, EARTH_FIELD, LEVEL_BIAS, FIRST_HARMONIC].contains(&name)
}

/// What an effect is called.
pub struct Named {
    pub name: String,
    parameters: Vec<Parameter>,
}

struct Parameter {
    name: String,
    value: f64,
    /// Number of the weight that it is in proportion to, and the factor.
    weight: Option<(usize, f64)>,
}

impl Parameter {
    fn constant(name: &str, value: f64) -> Self {
        Self { name: name.to_owned(), value, weight: None }
    }
}

impl Named {
    /// The physical name of an effect that has one, else what it is made of.
    pub fn new(effect: &Effect) -> Self {
        let weight = |number: usize, name: &str, factor: f64| Parameter {
            name: name.to_owned(),
            value: factor * f64::from(effect.weights.get(number).copied().unwrap_or(0.0)),
            weight: Some((number, factor)),
        };
        let (name, parameters) = match (effect.port, effect.factors.as_slice()) {
            (Port::Index, []) => (Some(INDEX_OFFSET.to_owned()), vec![weight(0, "offset_deg", 1.0)]),
            (Port::Scale, []) => (Some("scale-factor".to_owned()), vec![weight(0, "scale_error", 1.0)]),
            (Port::Forward, []) => (None, vec![weight(0, "forward_g", 1.0)]),
            (Port::Left, []) => (None, vec![weight(0, "left_g", 1.0)]),
            (Port::Rate, [factor]) if !factor.constant => of_rate(factor, &weight),
            _ => (None, Vec::new()),
        };
        let parameters = if name.is_some() {
            parameters
        } else {
            parameters.into_iter().chain(constants(&effect.factors)).collect()
        };
        Self { name: name.unwrap_or_else(|| effect.to_string()), parameters }
    }

    pub fn parameters(&self) -> BTreeMap<String, f64> {
        self.parameters.iter().map(|each| (each.name.clone(), each.value)).collect()
    }

    /// One sigma of the parameters, by the covariance of all weights, of which the effect's own begin at `first`.
    pub fn sigma(&self, covariance: &DMatrix<f64>, first: usize) -> BTreeMap<String, f64> {
        let of = |each: &Parameter| {
            let (number, factor) = each.weight?;
            let variance = covariance.get((first + number, first + number))?;
            Some((each.name.clone(), factor.abs() * variance.max(0.0).sqrt()))
        };
        self.parameters.iter().filter_map(of).collect()
    }
}

/// Name and channel: what one effect is called where another one is spoken of.
pub fn full_name(effect: &Effect) -> String {
    let name = Named::new(effect).name;
    match effect.channels().next() {
        Some(channel) if channel.as_str() != TEMPERATURE && !name.contains(channel.as_str()) => {
            format!("{name}:{}", channel.as_str())
        }
        _ => name,
    }
}

/// A factor that adds to the rate by itself.
fn of_rate(factor: &Factor, weight: &dyn Fn(usize, &str, f64) -> Parameter) -> (Option<String>, Vec<Parameter>) {
    let slope = match factor.shape {
        Shape::Linear(linear) => 1.0 / f64::from(linear.scale),
        _ => 1.0,
    };
    let named = |name: &str, parameters: Vec<Parameter>| (Some(name.to_owned()), parameters);
    match (factor.signal, factor.dynamics.as_slice(), factor.shape) {
        (Signal::TiltAlong, [], Shape::Linear(_)) => named(GRAVITY_SENSITIVITY, vec![weight(0, "deg_h_per_g", slope)]),
        (Signal::Time, [], Shape::Linear(_)) => named("drift", vec![weight(0, "deg_h_per_h", slope * S_PER_H)]),
        (Signal::Time, [], Shape::Step(step)) => {
            let at = Parameter::constant("at_s", step.at.into());
            named("step", vec![weight(0, "deg_h", 1.0), at])
        }
        (Signal::Time | Signal::Since | Signal::After, [], Shape::Decay(decay)) => {
            let name = if factor.signal == Signal::Time { "warm-up" } else { "settling" };
            let tau = Parameter::constant("tau_s", decay.tau_s.into());
            named(name, vec![weight(0, "deg_h", 1.0), tau])
        }
        (Signal::Index, [], Shape::Harmonic(harmonic)) => {
            let order = (360.0 / harmonic.period).round();
            named(&format!("body-harmonic-{order}"), vec![weight(0, "cos_deg_h", 1.0), weight(1, "sin_deg_h", 1.0)])
        }
        // A rate along north is felt with the cosine of the axis' azimuth.
        (Signal::Axis, [], Shape::Harmonic(harmonic)) if harmonic.period == 360.0 => {
            named(EARTH_FIELD, vec![weight(0, "north_deg_h", 1.0), weight(1, "east_deg_h", 1.0)])
        }
        (Signal::Channel(channel), dynamics, Shape::Linear(_)) if dynamics.len() < 2 => {
            let (name, unit) =
                if channel.name.as_str() == TEMPERATURE { ("temperature", "k") } else { ("channel", "unit") };
            let rate = if matches!(dynamics, [Dynamics::Rate(_)]) { "_per_s" } else { "" };
            let mut parameters = vec![weight(0, &format!("deg_h_per_{unit}{rate}"), slope)];
            parameters.extend(constants(std::slice::from_ref(factor)));
            let behind: String = dynamics.iter().map(|each| format!("-{each}")).collect();
            (Some(format!("{name}{behind}")), parameters)
        }
        (_, _, Shape::Step(_)) => (None, vec![weight(0, "deg_h", 1.0)]),
        _ => (None, Vec::new()),
    }
}

/// The constants of an effect's factors, in their order; a name that comes again has its number.
fn constants(factors: &[Factor]) -> Vec<Parameter> {
    let mut all: Vec<Parameter> = Vec::new();
    for constant in factors.iter().flat_map(Factor::constants) {
        let again = all.iter().filter(|each| each.name.split('-').next() == Some(constant.name)).count();
        let name = if again == 0 { constant.name.to_owned() } else { format!("{}-{}", constant.name, again + 1) };
        all.push(Parameter::constant(&name, constant.value));
    }
    all
}

#[cfg(test)]
mod tests {
    use north_finder::effects::ChannelName;
    use north_finder::effects::dynamics::Rate;
    use north_finder::effects::shape::{Harmonic, Linear, Step};
    use north_finder::effects::signal::{Channel, Index, Time};

    use super::*;

    fn effect(factor: Factor, weights: &[f32]) -> Effect {
        let mut effect = Effect::new(Port::Rate, &[factor]);
        effect.weights.copy_from_slice(weights);
        effect
    }

    /// 0.3 for 0.02 K/s is 15 °/h per K/s, with a sigma of 0.01 for them 0.5; 2 for 1200 s is 6 °/h per hour.
    #[test]
    fn parameters_by_hand() {
        let linear = |scale: f32| Shape::from(Linear { reference: 0.0, scale });
        let name = ChannelName::new("temp_c").unwrap();
        let factor = Factor::new(Channel { name }.into(), &[Rate { tau_s: 4.0 }.into()], linear(0.02));
        let of_temperature = Named::new(&effect(factor, &[0.3]));
        assert_eq!(of_temperature.name, "temperature-rate");
        assert!((of_temperature.parameters()["deg_h_per_k_per_s"] - 15.0).abs() < 1e-5);
        let covariance = DMatrix::from_diagonal_element(2, 2, 1e-4);
        assert!((of_temperature.sigma(&covariance, 1)["deg_h_per_k_per_s"] - 0.5).abs() < 1e-6);
        let drift = Named::new(&effect(Factor::new(Time.into(), &[], linear(1200.0)), &[2.0]));
        assert!(drift.name == "drift" && (drift.parameters()["deg_h_per_h"] - 6.0).abs() < 1e-6);
        let channel = || Channel { name: ChannelName::new("supply_v").unwrap() }.into();
        let step = Factor::new(channel(), &[], Step { at: 24.5 }.into());
        let of_step = Named::new(&effect(step.clone(), &[2.0]));
        assert_eq!(
            (of_step.name.as_str(), of_step.parameters()["at"], of_step.parameters()["deg_h"]),
            ("supply_v-step", 24.5, 2.0)
        );
        let twice =
            Named::new(&Effect::new(Port::Rate, &[step, Factor::new(channel(), &[], Step { at: 23.5 }.into())]));
        assert_eq!((twice.parameters()["at"], twice.parameters()["at-2"]), (24.5, 23.5));
        let third = Factor::new(Index.into(), &[], Harmonic { period: 120.0 }.into());
        assert_eq!(full_name(&effect(third, &[0.0, 0.0])), "body-harmonic-3");
        let name = ChannelName::new("supply_v").unwrap();
        assert_eq!(
            full_name(&effect(Factor::new(Channel { name }.into(), &[], linear(1.0)), &[0.0])),
            "channel:supply_v"
        );
    }
}
