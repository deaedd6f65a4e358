//! Draws effects: everything from wide continuous distributions.

use std::f64::consts::TAU;

use crate::hidden::draw::Draw;

use super::dynamics::Dynamics;
use super::effect::{Drift, Effect, Factor, Input, Port};
use super::plan::Plan;
use super::process::Process;
use super::record::{spreads, true_view};
use super::shape::Shape;
use super::signal::Signal;

/// What is to be outside the grammar.
#[derive(Clone, Copy, PartialEq)]
enum Outside {
    Nothing,
    Dynamics,
    Process,
    FourFactors,
    Drift,
}

/// Draws one effect of weight 1; `None` where a signal that it follows does not move in this campaign.
pub(super) fn effect(draw: &mut Draw, plan: &Plan, outside: bool) -> Option<Effect> {
    let outside = match outside {
        false => Outside::Nothing,
        true => match draw.uniform(0.0, 1.0) {
            share if share < 0.45 => Outside::Dynamics,
            share if share < 0.70 => Outside::Process,
            share if share < 0.85 => Outside::FourFactors,
            _ => Outside::Drift,
        },
    };
    let ports = [Port::Adds, Port::Adds, Port::Scales, Port::Turns, Port::Tilts { forward: draw.chance(0.5) }];
    let has_level = plan.level_noise_g.is_some() && outside != Outside::Process;
    let port = draw.pick(&ports[..if has_level { 5 } else { 4 }]);
    let count = match outside {
        Outside::FourFactors => 4,
        Outside::Process => usize::from(draw.chance(0.4)),
        _ => match draw.uniform(0.0, 1.0) {
            share if share < 0.55 => 1,
            share if share < 0.85 => 2,
            _ => 3,
        },
    };
    let strange = draw.whole(0, count.max(1) - 1);
    let factors = (0..count).map(|place| factor(draw, plan, outside == Outside::Dynamics && place == strange));
    let factors = factors.collect::<Option<Vec<_>>>()?;
    let drift = match outside {
        Outside::Drift if draw.chance(0.6) => Drift::Even { gain: draw.sign() * draw.log_uniform(0.5, 4.0) },
        Outside::Drift => Drift::Step { at: draw.uniform(0.2, 0.8), gain: draw.sign() * draw.log_uniform(0.5, 4.0) },
        _ => Drift::None,
    };
    let process = (outside == Outside::Process).then(|| Process::any(draw));
    let mut effect = Effect { port, factors, process, drift, weight: 1.0, unit: 1.0 };
    let spreads = spreads(plan);
    let courses: Vec<Vec<f64>> =
        (0..plan.runs.len()).map(|run| effect.course(plan, run, &true_view(plan, run), &spreads)).collect();
    let [mean, spread] = moments(plan, &courses);
    effect.unit = (mean * mean + spread * spread).sqrt().recip();
    effect.unit.is_finite().then_some(effect)
}

fn signal(draw: &mut Draw, plan: &Plan) -> Signal {
    let channels = plan.channels.len();
    let channel = draw.whole(0, channels - 1);
    if draw.chance(0.4) {
        return Signal::Channel(channel);
    }
    let mut other = vec![
        Signal::Index,
        Signal::Winding,
        Signal::AxisAzimuth,
        Signal::SinceSwitchOn,
        Signal::SinceMove,
        Signal::SinceMove,
        Signal::Travel,
        Signal::TravelSigned,
        Signal::Direction,
        Signal::Moves,
        Signal::TurningRate,
        Signal::Rate,
    ];
    if channels > 1 {
        other.push(Signal::Difference(channel, (channel + draw.whole(1, channels - 1)) % channels));
    }
    if plan.level_noise_g.is_some() {
        other.extend([Signal::TiltAlong, Signal::TiltAcross]);
    }
    if plan.has_started {
        other.extend([Signal::TimeOfDay, Signal::Rest]);
    }
    draw.pick(&other)
}

fn factor(draw: &mut Draw, plan: &Plan, strange: bool) -> Option<Factor> {
    let first = input(draw, plan, strange, false)?;
    let surface = first.after != [0.0, 1.0] && draw.chance(0.12);
    let other = if surface { Some(input(draw, plan, false, true)?) } else { None };
    let shape = match surface {
        true => {
            let hills = (0..draw.whole(1, 4))
                .map(|_| [draw.normal(), draw.normal(), draw.normal(), draw.log_uniform(0.4, 3.0)]);
            Shape::Surface { hills: hills.collect() }
        }
        false if first.after == [0.0, 1.0] && first.signal.is_angle() => of_angle(draw),
        false if first.after == [0.0, 1.0] => decay(draw, first.signal),
        false => of_value(draw),
    };
    Some(Factor { input: first, other, shape })
}

/// A signal and a dynamics; `strange`: a dynamics outside the grammar; `value`: to be standardised in any case.
fn input(draw: &mut Draw, plan: &Plan, strange: bool, value: bool) -> Option<Input> {
    let signal = match strange {
        true => Signal::Channel(draw.whole(0, plan.channels.len() - 1)),
        false => signal(draw, plan),
    };
    let signal = match (strange, draw.whole(0, 4)) {
        (true, 0) => Signal::TurningRate,
        (true, 1) => Signal::Winding,
        _ => signal,
    };
    // An angle as a plain value jumps where it begins anew.
    if value && signal.is_angle() {
        return None;
    }
    let dynamics = match (strange, signal) {
        (true, Signal::Channel(_)) if draw.chance(0.15) => {
            Dynamics::Across { tau_s: draw.log_uniform(300.0, 20_000.0) }
        }
        (true, _) => strange_dynamics(draw),
        (false, Signal::TurningRate) => passing(draw),
        (false, _) if signal.flows() && draw.chance(0.6) => dynamics(draw),
        _ => Dynamics::None,
    };
    let raw = !value && (signal.is_angle() || signal.is_elapsed() && draw.chance(0.8));
    let mut input = Input { signal, dynamics, before: [0.0, 1.0], after: [0.0, 1.0], states: Vec::new() };
    if raw {
        return Some(input);
    }
    let spreads = spreads(plan);
    let courses = |input: &Input| -> Vec<Vec<f64>> {
        (0..plan.runs.len()).map(|run| input.course(&true_view(plan, run), run, &spreads)).collect()
    };
    let still = Input { dynamics: Dynamics::None, ..input.clone() };
    let signals = courses(&still);
    // The turning rate is 0 at rest: its spread is that of all seconds.
    input.before = if signal == Signal::TurningRate { all_moments(&signals) } else { moments(plan, &signals) };
    if signal == Signal::TurningRate {
        input.before[0] = 0.0;
    }
    if !(input.before[1] > 0.0) {
        return None;
    }
    if let Dynamics::Across { tau_s } = input.dynamics {
        input.states = states(plan, &courses(&Input { dynamics: Dynamics::None, ..input.clone() }), tau_s);
    }
    input.after = moments(plan, &courses(&input));
    (input.after[1] > 1e-9).then_some(input)
}

/// States at the beginnings of runs of a low-pass that goes on between them towards the mean.
fn states(plan: &Plan, courses: &[Vec<f64>], tau_s: f64) -> Vec<f64> {
    let mut state = 0.0;
    let next = |(course, run): (&Vec<f64>, &super::plan::RunPlan)| {
        let begin = state * (-run.rest_s / tau_s).exp();
        state = Dynamics::Across { tau_s }.apply(course, begin).last().copied().unwrap_or_default();
        begin
    };
    courses.iter().zip(&plan.runs).map(next).collect()
}

fn time(draw: &mut Draw) -> f64 {
    draw.log_uniform(4.0, 1200.0)
}

fn dynamics(draw: &mut Draw) -> Dynamics {
    match draw.whole(0, 7) {
        0 => Dynamics::LowPass { tau_s: time(draw) },
        1 => Dynamics::Rate { tau_s: draw.log_uniform(4.0, 300.0) },
        2 => Dynamics::Delay { seconds: draw.log_uniform(3.0, 200.0) as usize },
        3 => Dynamics::Play { width: draw.log_uniform(0.1, 3.0) },
        4 => Dynamics::Relay { centre: 0.7 * draw.normal(), width: draw.log_uniform(0.05, 2.0) },
        5 => Dynamics::GreatestSoFar,
        6 => Dynamics::Memory { tau_s: time(draw) },
        _ => Dynamics::Heat { tau_s: time(draw) },
    }
}

/// Those that make something of a motion that is over when the index rests.
fn passing(draw: &mut Draw) -> Dynamics {
    match draw.whole(0, 2) {
        0 => Dynamics::LowPass { tau_s: time(draw) },
        1 => Dynamics::Heat { tau_s: time(draw) },
        _ => Dynamics::Delay { seconds: draw.log_uniform(3.0, 60.0) as usize },
    }
}

fn strange_dynamics(draw: &mut Draw) -> Dynamics {
    match draw.whole(0, 6) {
        0 => Dynamics::SecondOrder { period_s: draw.log_uniform(10.0, 600.0), damping: draw.log_uniform(0.03, 0.9) },
        1 => {
            let relay = |draw: &mut Draw| {
                let (centre, half_width) = (draw.normal(), draw.log_uniform(0.05, 1.5));
                [centre - half_width, centre + half_width, draw.uniform(0.0, 1.0)]
            };
            Dynamics::Preisach { relays: (0..draw.whole(20, 60)).map(|_| relay(draw)).collect() }
        }
        2 => Dynamics::Bristle { stiffness: draw.log_uniform(0.5, 20.0), exponent: draw.uniform(0.5, 2.0) },
        3 => Dynamics::TwoTimes { rise_s: time(draw), fall_s: time(draw) },
        4 => Dynamics::VaryingLag { tau_s: time(draw), gain: draw.sign() * draw.log_uniform(0.3, 1.5) },
        5 => Dynamics::PowerLaw {
            exponent: draw.uniform(0.0, 1.0),
            shortest_s: draw.log_uniform(1.0, 10.0),
            longest_s: draw.log_uniform(200.0, 5000.0),
        },
        _ => Dynamics::Oscillator {
            period_s: draw.log_uniform(30.0, 600.0),
            gain: draw.sign() * draw.log_uniform(0.05, 0.5),
        },
    }
}

fn of_angle(draw: &mut Draw) -> Shape {
    match draw.uniform(0.0, 1.0) {
        share if share < 0.65 => {
            Shape::Harmonic { order: draw.whole(1, 4) as f64, phase_deg: draw.uniform(0.0, 360.0) }
        }
        share if share < 0.85 => {
            Shape::AboutAngle { at_deg: draw.uniform(0.0, 360.0), concentration: draw.log_uniform(0.3, 10.0) }
        }
        _ => Shape::Sector { at_deg: draw.uniform(0.0, 360.0), half_width_deg: draw.uniform(15.0, 120.0) },
    }
}

fn decay(draw: &mut Draw, signal: Signal) -> Shape {
    let tau_s = match signal {
        Signal::Rest => draw.log_uniform(600.0, 40_000.0),
        Signal::SinceMove => draw.log_uniform(2.0, 200.0),
        _ => draw.log_uniform(10.0, 3000.0),
    };
    if draw.chance(0.75) { Shape::Decay { tau_s } } else { Shape::SlowDecay { tau_s, power: draw.uniform(0.3, 3.0) } }
}

fn of_value(draw: &mut Draw) -> Shape {
    let at = draw.normal();
    match draw.whole(0, 11) {
        0..=3 => Shape::Linear { centre: 0.7 * draw.normal() },
        4 => Shape::Polynomial { quadratic: 0.7 * draw.normal(), cubic: 0.2 * draw.normal() },
        5 => Shape::Bump { at, width: draw.log_uniform(0.3, 2.0) },
        6 => Shape::Saturating { at, width: draw.log_uniform(0.1, 2.0) },
        7 => Shape::Wave { frequency: draw.log_uniform(0.5, 5.0), phase: draw.uniform(0.0, TAU) },
        8 => Shape::Kink { at },
        9 => Shape::DeadZone { at, half_width: draw.log_uniform(0.1, 1.5) },
        10 => Shape::Modulus { at },
        _ => Shape::Step { at },
    }
}

/// Mean and standard deviation over the resting seconds of all runs.
fn moments(plan: &Plan, courses: &[Vec<f64>]) -> [f64; 2] {
    let rests = plan.runs.iter().map(|run| &run.rests);
    let values = || {
        courses
            .iter()
            .zip(rests.clone())
            .flat_map(|(course, rests)| course.iter().zip(rests).filter(|(_, rests)| **rests).map(|(value, _)| *value))
    };
    of(values)
}

fn all_moments(courses: &[Vec<f64>]) -> [f64; 2] {
    of(|| courses.iter().flatten().copied())
}

fn of<I: Iterator<Item = f64>>(values: impl Fn() -> I) -> [f64; 2] {
    let count = values().count() as f64;
    let mean = values().sum::<f64>() / count;
    [mean, (values().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()]
}
