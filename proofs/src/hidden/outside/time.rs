//! What goes by time, or comes by itself.

use std::f64::consts::TAU;

use super::super::shape::Shape;
use super::{ANY, Outside, Sketch, family, of_run};
use crate::hidden::draw::Draw;

pub(super) const FAMILIES: &[Outside] = &[
    family("scale-drift", "drifting scale factor", ANY, scale_drift),
    family("power-law", "settling by a power of time", ANY, power_law),
    family("beats", "beats between two sinusoids", ANY, beats),
    family("burst", "a burst that no channel shows", ANY, burst),
    family("heater", "a heater that no channel shows", ANY, heater),
    family("hidden-step", "a step at a time of each run's own", ANY, hidden_step),
    family("spike-train", "a train of spikes", ANY, spike_train),
    family("telegraph", "random telegraph", ANY, telegraph),
    family("interference", "intermittent interference", ANY, interference),
    family("alias", "an aliased vibration that drifts", ANY, alias),
    family("sawtooth", "a sawtooth of each run's own phase", ANY, sawtooth),
];

fn scale_drift(sketch: &mut Sketch<'_>) -> Shape {
    let tau_s = sketch.draw.log_uniform(60.0, 2000.0);
    Shape::new(format!("scale factor settles in {tau_s:.0} s"), &[], move |view| {
        (0..)
            .zip(view.north())
            .map(|(second, north)| north * (1.0 - (-(f64::from(second) + 0.5) / tau_s).exp()))
            .collect()
    })
}

fn power_law(sketch: &mut Sketch<'_>) -> Shape {
    let (power, start_s) = (sketch.draw.uniform(0.3, 1.0), sketch.draw.log_uniform(2.0, 30.0));
    Shape::new(format!("(1 + t / {start_s:.1} s)^−{power:.2}"), &[], move |view| {
        (0..view.seconds()).map(|second| (1.0 + (second as f64 + 0.5) / start_s).powf(-power)).collect()
    })
}

/// A course from chance of the run's own and the time in seconds.
fn by_time(
    words: String,
    seed: u64,
    of_time: impl Fn(&mut Draw, f64) -> Box<dyn Fn(f64) -> f64> + Send + Sync + 'static,
) -> Shape {
    Shape::new(words, &[], move |view| {
        let function = of_time(&mut of_run(seed, view), view.seconds() as f64);
        (0..view.seconds()).map(|second| function(second as f64 + 0.5)).collect()
    })
}

fn beats(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, hz) = (sketch.draw.seed(), sketch.draw.log_uniform(0.01, 0.2));
    let ratio = sketch.draw.uniform(1.02, 1.25);
    by_time(format!("{hz:.4} and {:.4} Hz", ratio * hz), seed, move |draw, _| {
        let phases = [draw.uniform(0.0, TAU), draw.uniform(0.0, TAU)];
        Box::new(move |t_s| (TAU * hz * t_s + phases[0]).sin() + (TAU * ratio * hz * t_s + phases[1]).sin())
    })
}

fn burst(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, width_s) = (sketch.draw.seed(), sketch.draw.log_uniform(5.0, 40.0));
    by_time(format!("burst of {width_s:.1} s"), seed, move |draw, seconds| {
        let (at_s, size) = (draw.uniform(0.0, seconds), draw.sign() * draw.uniform(0.5, 1.5));
        Box::new(move |t_s| size * (-0.5 * ((t_s - at_s) / width_s).powi(2)).exp())
    })
}

/// On and off with a period, heating and cooling.
fn heater(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, period_s) = (sketch.draw.seed(), sketch.draw.uniform(40.0, 160.0));
    let (duty, tau_s) = (sketch.draw.uniform(0.2, 0.6), sketch.draw.log_uniform(5.0, 40.0));
    Shape::new(format!("heater of {period_s:.0} s, duty {duty:.2}, {tau_s:.1} s"), &[], move |view| {
        let phase_s = of_run(seed, view).uniform(0.0, period_s);
        let on: Vec<f64> = (0..view.seconds())
            .map(|second| f64::from(u8::from((second as f64 + phase_s) % period_s < duty * period_s)))
            .collect();
        super::low_passed(&on, tau_s)
    })
}

fn hidden_step(sketch: &mut Sketch<'_>) -> Shape {
    let seed = sketch.draw.seed();
    by_time("a step".into(), seed, |draw, seconds| {
        let (at_s, size) = (draw.uniform(0.1, 0.9) * seconds, draw.normal());
        Box::new(move |t_s| if t_s > at_s { size } else { 0.0 })
    })
}

fn spike_train(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, period_s) = (sketch.draw.seed(), sketch.draw.uniform(7.0, 45.0));
    by_time(format!("spikes every {period_s:.1} s"), seed, move |draw, _| {
        let phase_s = draw.uniform(0.0, period_s);
        Box::new(move |t_s| f64::from(u8::from((t_s + phase_s) % period_s < 1.0)))
    })
}

fn telegraph(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, mean_s) = (sketch.draw.seed(), sketch.draw.log_uniform(15.0, 90.0));
    Shape::new(format!("telegraph of {mean_s:.1} s"), &[], move |view| {
        let mut draw = of_run(seed, view);
        let mut state = draw.sign();
        (0..view.seconds())
            .map(|_| {
                if draw.chance(1.0 / mean_s) {
                    state = -state;
                }
                state
            })
            .collect()
    })
}

fn interference(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, hz) = (sketch.draw.seed(), sketch.draw.log_uniform(0.008, 0.1));
    by_time(format!("{hz:.4} Hz for a while"), seed, move |draw, seconds| {
        let (phase, from_s) = (draw.uniform(0.0, TAU), draw.uniform(0.0, 0.6) * seconds);
        let to_s = from_s + draw.uniform(0.2, 0.5) * seconds;
        Box::new(move |t_s| if (from_s..to_s).contains(&t_s) { (TAU * hz * t_s + phase).sin() } else { 0.0 })
    })
}

fn alias(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, hz) = (sketch.draw.seed(), sketch.draw.log_uniform(0.005, 0.05));
    let chirp = sketch.draw.uniform(-0.5, 0.5);
    by_time(format!("{hz:.4} Hz, changing by {chirp:.2} of it in a run"), seed, move |draw, seconds| {
        let phase = draw.uniform(0.0, TAU);
        Box::new(move |t_s| (TAU * hz * t_s * (1.0 + 0.5 * chirp * t_s / seconds) + phase).sin())
    })
}

fn sawtooth(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, period_s) = (sketch.draw.seed(), sketch.draw.log_uniform(30.0, 200.0));
    by_time(format!("sawtooth of {period_s:.0} s"), seed, move |draw, _| {
        let phase_s = draw.uniform(0.0, period_s);
        Box::new(move |t_s| 2.0 * ((t_s + phase_s) / period_s).fract() - 1.0)
    })
}
