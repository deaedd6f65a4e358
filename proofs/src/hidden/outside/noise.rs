//! Noise that is not white, not Gaussian or not always the same. Nobody can know its course: the oracle leaves it in.

use super::super::plan::{Measure, Needs};
use super::super::shape::Shape;
use super::{ANY, Outside, Sketch, channels, of_run};

/// A family that is measured by its rows.
const fn noise(
    name: &'static str,
    describe: &'static str,
    needs: Needs,
    draw: fn(&mut Sketch<'_>) -> Shape,
) -> Outside {
    Outside { name, describe, needs, measure: Measure::Rows, draw }
}

pub(super) const FAMILIES: &[Outside] = &[
    noise("flicker", "flicker of the bias", ANY, flicker),
    noise("random-walk", "bias that walks at random", ANY, random_walk),
    noise("heavy-tails", "noise with heavy tails", ANY, heavy_tails),
    noise("noise-by-channel", "noise that follows a channel", channels(1), by_channel),
    noise("noise-bursts", "noise in bursts", ANY, bursts),
    noise("angle-noise", "noise in the angle, not in the rate", ANY, angle_noise),
    noise("quantum", "a coarse quantum", ANY, quantum),
];

/// A sum of low-passed noises an octave apart.
fn flicker(sketch: &mut Sketch<'_>) -> Shape {
    let seed = sketch.draw.seed();
    let course = move |view: &super::RunView<'_>| {
        let mut draw = of_run(seed, view);
        let mut states = [0.0; 9].map(|_: f64| draw.normal());
        (0..view.seconds())
            .map(|_| {
                for (octave, state) in states.iter_mut().enumerate() {
                    let kept = (-0.5_f64.powi(octave as i32 + 1)).exp();
                    *state = kept * *state + (1.0 - kept * kept).sqrt() * draw.normal();
                }
                states.iter().sum()
            })
            .collect()
    };
    Shape::new(format!("flicker {seed}"), &[], course).unknowable()
}

fn random_walk(sketch: &mut Sketch<'_>) -> Shape {
    let seed = sketch.draw.seed();
    let course = move |view: &super::RunView<'_>| {
        let mut draw = of_run(seed, view);
        let mut state = 0.0;
        (0..view.seconds())
            .map(|_| {
                state += draw.normal();
                state
            })
            .collect()
    };
    Shape::new(format!("random walk {seed}"), &[], course).unknowable()
}

/// Student's t with 2.5 degrees of freedom: a Gaussian over the root of a chi-square.
fn heavy_tails(sketch: &mut Sketch<'_>) -> Shape {
    let seed = sketch.draw.seed();
    let course = move |view: &super::RunView<'_>| {
        let mut draw = of_run(seed, view);
        (0..view.seconds()).map(|_| draw.student(2.5)).collect()
    };
    Shape::new(format!("heavy tails {seed}"), &[], course).unknowable()
}

fn by_channel(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, channel) = (sketch.draw.seed(), sketch.channels[0]);
    let course = move |view: &super::RunView<'_>| {
        let mut draw = of_run(seed, view);
        view.channel(channel).into_iter().map(|value| value.exp() * draw.normal()).collect()
    };
    Shape::new(format!("noise by channel {channel}, {seed}"), &[channel], course).unknowable()
}

fn bursts(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, mean_s) = (sketch.draw.seed(), sketch.draw.log_uniform(10.0, 60.0));
    let course = move |view: &super::RunView<'_>| {
        let mut draw = of_run(seed, view);
        let mut on = draw.chance(0.3);
        (0..view.seconds())
            .map(|_| {
                if draw.chance(if on { 2.0 } else { 1.0 } / mean_s) {
                    on = !on;
                }
                if on { draw.normal() } else { 0.0 }
            })
            .collect()
    };
    Shape::new(format!("bursts of {mean_s:.0} s, {seed}"), &[], course).unknowable()
}

/// Differences of white noise: neighbouring seconds are anticorrelated, as of a ring laser.
fn angle_noise(sketch: &mut Sketch<'_>) -> Shape {
    let seed = sketch.draw.seed();
    let course = move |view: &super::RunView<'_>| {
        let mut draw = of_run(seed, view);
        let mut last = draw.normal();
        (0..view.seconds())
            .map(|_| {
                let next = draw.normal();
                let difference = next - last;
                last = next;
                difference
            })
            .collect()
    };
    Shape::new(format!("noise in the angle {seed}"), &[], course).unknowable()
}

/// What is lost below a step of the counter that a slow rate crosses now and then.
fn quantum(sketch: &mut Sketch<'_>) -> Shape {
    let seed = sketch.draw.seed();
    let course = move |view: &super::RunView<'_>| {
        let mut left = of_run(seed, view).uniform(0.0, 1.0);
        let north = view.north();
        // A quarter of the horizontal Earth rate to a step.
        north
            .into_iter()
            .map(|north| {
                let counted = left + 4.0 * (north + 1.37);
                let step = counted.floor() - left - 4.0 * (north + 1.37);
                left = counted - counted.floor();
                step
            })
            .collect()
    };
    Shape::new(format!("quantum {seed}"), &[], course).unknowable()
}
