//! What the open world learned, in the terms that the firmware evaluates.

use north_finder::effects::basis::Basis;
use north_finder::effects::basis::curve::Curve;
use north_finder::effects::basis::curve::function::Function;
use north_finder::effects::basis::curve::signal::Signal;
use north_finder::effects::basis::drift::Drift;
use north_finder::effects::basis::harmonic::BodyHarmonic;
use north_finder::effects::basis::settling::{Settling, Size};
use north_finder::effects::basis::warm_up::WarmUp;
use north_finder::effects::channel::{FORWARD, LEFT};
use north_finder::effects::{ChannelName, Term};

use crate::open_world::{
    Base, DECAYS_S, Group, MEMORY_S, PLAY_WIDTHS, RELAXATION_S, TIMES_S, TRAVEL_S, Tuned, WARM_UP_S,
};

/// A channel with the range in which it was learned: middle and half.
pub struct Ranged {
    pub name: String,
    pub middle: f64,
    pub half: f64,
}

/// Knots of a curve and of the two sides of a surface.
const KNOTS: usize = 7;
const SIDES: [usize; 2] = [4, 5];
/// Outer knots of a table with a place of its own, and half the width of a step in it, half ranges.
const OUTER: f64 = 1.3;
const STEEP: f64 = 0.003;
/// Time constant of the low-pass that a rate of change is the lack of, seconds.
const CHANGE_S: f64 = 12.0;

/// Terms whose sum can be what a group does; `None` where the firmware has none.
pub fn terms(group: &Group, channels: &[Ranged]) -> Option<Vec<Term>> {
    let curve = |channel: usize, signal: Signal, function: Function| {
        let channel = ChannelName::new(&channels.get(channel)?.name)?;
        Some(Basis::Curve(Curve { channel, signal, function }))
    };
    let knots = |channel: usize, number: usize| -> Option<_> {
        let Ranged { middle, half, .. } = channels.get(channel)?;
        let at = |i: usize| middle + half * 1.1 * (2.0 * i as f64 / (number - 1) as f64 - 1.0);
        Some((0..number).map(|i| at(i) as f32).collect())
    };
    let powers =
        |channel: usize, degree: u8| Some(Function::Powers { reference: channels.get(channel)?.middle as f32, degree });
    let spline = |channel: usize| Some(Function::Spline(knots(channel, KNOTS)?));
    let table = |channel: usize, number: usize| Some(Function::Table(knots(channel, number)?));
    let straight = |channel: usize, signal: Signal| {
        // What a memory or a rate is made of has no middle of its own.
        Some(Term::new(curve(channel, signal, Function::Powers { reference: 0.0, degree: 1 })?))
    };
    let play =
        |channel: usize, width: f64| Some(Signal::Play { half_width: (width * channels.get(channel)?.half) as f32 });
    let settling =
        |tau_s: f64, by: Size, first_dwell: bool| Basis::Settling(Settling { tau_s: tau_s as f32, by, first_dwell });
    let decays = |by: Size, first_dwell: bool| -> Option<Vec<Term>> {
        Some(DECAYS_S.iter().map(|&tau_s| Term::new(settling(tau_s, by, first_dwell))).collect())
    };
    let places = |channel: usize, places: &[f64]| -> Option<_> {
        let Ranged { middle, half, .. } = channels.get(channel)?;
        Some(places.iter().map(|place| (middle + half * place) as f32).collect())
    };
    let step = |channel: usize, at: f64| {
        let knots = places(channel, &[-OUTER, at - STEEP, at + STEEP, OUTER])?;
        curve(channel, Signal::Value, Function::Table(knots))
    };
    let surface_of_tables = |first: usize, second: usize| {
        Some(vec![Term::product(
            curve(first, Signal::Value, table(first, SIDES[0])?)?,
            curve(second, Signal::Value, table(second, SIDES[1])?)?,
        )])
    };
    let value = |channel: usize| Some(Term::new(curve(channel, Signal::Value, spline(channel)?)?));
    let one = |term: Option<Term>| Some(vec![term?]);
    match *group {
        Group::Base(Base::Value(channel)) | Group::SharpCurve(channel) => one(value(channel)),
        Group::Tuned(channel, Tuned::Threshold(at)) => one(Some(Term::new(step(channel, at)?))),
        Group::Tuned(channel, Tuned::Bend(at)) => one(Some(Term::new(curve(
            channel,
            Signal::Value,
            Function::Table(places(channel, &[-OUTER, at, OUTER])?),
        )?))),
        Group::Tuned(channel, Tuned::Play(width)) => {
            Some(vec![straight(channel, Signal::Value)?, straight(channel, play(channel, width)?)?])
        }
        Group::Gated { channel, by, at } => {
            let through = Term::product(step(by, at)?, curve(channel, Signal::Value, powers(channel, 1)?)?);
            Some(vec![Term::new(step(by, at)?), through])
        }
        Group::Linear(channel) => one(Some(Term::new(curve(channel, Signal::Value, powers(channel, 1)?)?))),
        Group::Quadratic(channel) => one(Some(Term::new(curve(channel, Signal::Value, powers(channel, 2)?)?))),
        Group::Change(channel) => one(straight(channel, Signal::Memory { tau_s: CHANGE_S as f32 })),
        Group::Base(Base::Memory(channel)) => {
            TIMES_S.iter().map(|&tau_s| straight(channel, Signal::Memory { tau_s: tau_s as f32 })).collect()
        }
        Group::LongMemory(channel) => {
            MEMORY_S.iter().map(|&tau_s| straight(channel, Signal::Memory { tau_s: tau_s as f32 })).collect()
        }
        Group::Hysteresis(channel, width) => {
            one(Some(Term::new(curve(channel, play(channel, PLAY_WIDTHS[width])?, table(channel, KNOTS)?)?)))
        }
        Group::Base(Base::Play(channel)) => [0.15, 0.4]
            .iter()
            .map(|&width| Some(Term::new(curve(channel, play(channel, width)?, table(channel, KNOTS)?)?)))
            .collect(),
        Group::Backlash(channel) => std::iter::once(straight(channel, Signal::Value))
            .chain([0.1, 0.2, 0.35, 0.55, 0.8].iter().map(|&width| straight(channel, play(channel, width)?)))
            .collect(),
        Group::CurveOfMemory(channel, time) => {
            let signal = Signal::LowPass { tau_s: TIMES_S[time] as f32 };
            one(Some(Term::new(curve(channel, signal, spline(channel)?)?)))
        }
        Group::Base(Base::Settling) => decays(Size::Constant, false),
        Group::SettlingEveryDwell => decays(Size::Constant, true),
        Group::SettlingByCount => decays(Size::Number, false),
        Group::SettlingByPosition => decays(Size::Position, false),
        Group::Base(Base::Travel) => Some(
            [Size::Travel, Size::SignedTravel]
                .into_iter()
                .flat_map(|by| TRAVEL_S.map(|tau_s| Term::new(settling(tau_s, by, false))))
                .collect(),
        ),
        Group::Base(Base::Harmonic(order)) => one(Some(Term::new(Basis::BodyHarmonic(BodyHarmonic { order })))),
        Group::HighHarmonics => {
            Some((3..=6).map(|order| Term::new(Basis::BodyHarmonic(BodyHarmonic { order }))).collect())
        }
        Group::Drift => one(Some(Term::new(Basis::Drift(Drift { degree: 1 })))),
        Group::Base(Base::Time) => Some(
            std::iter::once(Term::new(Basis::Drift(Drift { degree: 3 })))
                .chain(WARM_UP_S.iter().map(|&tau_s| Term::new(Basis::WarmUp(WarmUp { tau_s: tau_s as f32 }))))
                .collect(),
        ),
        Group::Relaxation => {
            Some(RELAXATION_S.map(|tau_s| Term::new(Basis::WarmUp(WarmUp { tau_s: tau_s as f32 }))).to_vec())
        }
        Group::Ridge { .. } => match group.channels()[..] {
            [first, second] => surface_of_tables(first, second),
            _ => None,
        },
        Group::TiltLinear => [FORWARD, LEFT]
            .into_iter()
            .map(|name| {
                let function = Function::Powers { reference: 0.0, degree: 1 };
                let level = Curve { channel: ChannelName::new(name)?, signal: Signal::Value, function };
                Some(Term::product(Basis::Curve(level), Basis::BodyHarmonic(BodyHarmonic { order: 1 })))
            })
            .collect(),
        Group::LinearTimes(channel, Base::Rate) => {
            one(Some(Term::scaling(curve(channel, Signal::Value, powers(channel, 1)?)?)))
        }
        Group::LinearTimes(channel, Base::Harmonic(order)) => {
            let harmonic = Basis::BodyHarmonic(BodyHarmonic { order });
            let times = Term::product(curve(channel, Signal::Value, powers(channel, 1)?)?, harmonic.clone());
            Some(if order == 1 { vec![Term::new(harmonic), times] } else { vec![times] })
        }
        Group::LinearTimes(channel, Base::Settling) => DECAYS_S
            .iter()
            .map(|&tau_s| {
                let decay = settling(tau_s, Size::Constant, false);
                Some(Term::product(curve(channel, Signal::Value, powers(channel, 1)?)?, decay))
            })
            .collect(),
        Group::Bilinear(first, second) | Group::Bicubic(first, second) => {
            surface(curve(first, Signal::Value, powers(first, 2)?)?, curve(second, Signal::Value, powers(second, 2)?)?)
        }
        Group::Product(Base::Value(first), Base::Value(second)) if first != second => surface_of_tables(first, second),
        Group::Product(Base::Value(channel), Base::Harmonic(order)) => one(Some(Term::product(
            curve(channel, Signal::Value, table(channel, SIDES[1])?)?,
            Basis::BodyHarmonic(BodyHarmonic { order }),
        ))),
        Group::Product(Base::Value(channel), Base::Settling) => DECAYS_S
            .iter()
            .map(|&tau_s| {
                let decay = settling(tau_s, Size::Constant, false);
                Some(Term::product(curve(channel, Signal::Value, table(channel, SIDES[0])?)?, decay))
            })
            .collect(),
        _ => None,
    }
}

/// Two curves by themselves, and their product.
fn surface(first: Basis, second: Basis) -> Option<Vec<Term>> {
    Some(vec![Term::new(first.clone()), Term::new(second.clone()), Term::product(first, second)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forward and left each times cosine and sine of the index angle: four numbers.
    #[test]
    fn gravity_is_the_level_times_the_first_harmonic() {
        let found = terms(&Group::TiltLinear, &[]).unwrap();
        let names: Vec<&str> = found.iter().flat_map(Term::channels).map(ChannelName::as_str).collect();
        assert_eq!(names, [FORWARD, LEFT]);
        assert_eq!(found.iter().map(Term::count).sum::<usize>(), 4);
    }
}
