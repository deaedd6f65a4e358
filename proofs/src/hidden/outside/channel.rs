//! What channels can do to a rate beyond their value, curve, rate and low-pass. Values are in standard deviations from the
//! mean over the campaign.

use super::super::plan::Needs;
use super::super::shape::Shape;
use super::{ANY, Outside, Sketch, channels, family, low_passed};

pub(super) const FAMILIES: &[Outside] = &[
    family("thermostat", "a thermostat's duty", channels(1), thermostat),
    family("threshold", "a threshold in a channel", channels(1), threshold),
    family("saturation", "a channel that saturates", channels(1), saturation),
    family("backlash", "backlash behind a channel", channels(1), backlash),
    family("preisach", "many relays in a channel", channels(1), preisach),
    family("rate-hysteresis", "hysteresis that depends on the rate", channels(1), rate_hysteresis),
    family("rate-memory", "memory of a channel's rate", Needs { smooth: true, ..channels(1) }, rate_memory),
    family("squared-heat", "heat of a squared current", channels(1), squared_heat),
    family("transport", "a channel by way of a long pipe", channels(1), transport),
    family("noisy-copy", "a channel that is recorded with much noise", Needs { noisy: true, ..channels(1) }, value),
    family("coarse-channel", "a channel that is recorded coarsely", Needs { coarse: true, ..channels(1) }, value),
    family("peak-memory", "the greatest value so far", channels(1), peak_memory),
    family("difference", "a curve in the difference of two channels", channels(2), difference),
    family("product", "product of two channels", channels(2), product),
    family("quotient", "quotient of two channels", channels(2), quotient),
    family("maximum", "the larger of two channels", channels(2), maximum),
    family("gated", "a channel while another is high", channels(2), gated),
    family("surface-of-three", "smooth function of three channels", channels(3), surface_of_three),
    family("scale-by-channel", "scale factor that follows a channel", channels(1), scale_by_channel),
    family("coil-current", "magnetic coil with a current", channels(1), coil_current),
    family("rectified-vibration", "vibration, rectified", channels(1), rectified),
    family("hidden-cause", "a cause that no channel shows", ANY, hidden_cause),
];

fn value(sketch: &mut Sketch<'_>) -> Shape {
    let channel = sketch.channels[0];
    Shape::new(format!("value of channel {channel}"), &[channel], move |view| view.channel(channel))
}

/// Heats below one value until the other is reached.
fn thermostat(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, at, width) = (sketch.channels[0], sketch.draw.uniform(-0.5, 0.5), sketch.draw.uniform(0.2, 0.8));
    Shape::new(format!("thermostat {at:.3} {width:.3}"), &[channel], move |view| {
        let mut on = false;
        view.channel(channel)
            .into_iter()
            .map(|value| {
                on = value < at - 0.5 * width || (on && value < at + 0.5 * width);
                f64::from(u8::from(on))
            })
            .collect()
    })
}

fn threshold(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, at) = (sketch.channels[0], sketch.draw.uniform(-0.7, 0.7));
    Shape::new(format!("threshold {at:.3}"), &[channel], move |view| {
        view.channel(channel).into_iter().map(|value| f64::from(u8::from(value > at))).collect()
    })
}

fn saturation(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, at) = (sketch.channels[0], sketch.draw.uniform(-0.5, 0.3));
    Shape::new(format!("saturation {at:.3}"), &[channel], move |view| {
        view.channel(channel).into_iter().map(|value| value.min(at)).collect()
    })
}

/// What is driven through a play of this width.
fn play(values: &[f64], width: f64) -> Vec<f64> {
    let mut follower = values.first().copied().unwrap_or_default();
    values
        .iter()
        .map(|value| {
            follower = follower.clamp(value - 0.5 * width, value + 0.5 * width);
            follower
        })
        .collect()
}

fn backlash(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, width) = (sketch.channels[0], sketch.draw.uniform(0.5, 1.5));
    Shape::new(format!("backlash {width:.3}"), &[channel], move |view| play(&view.channel(channel), width))
}

/// Relays with thresholds of their own.
fn preisach(sketch: &mut Sketch<'_>) -> Shape {
    let channel = sketch.channels[0];
    let relays: Vec<[f64; 2]> = (0..12)
        .map(|_| {
            let (at, width) = (sketch.draw.normal(), sketch.draw.uniform(0.1, 1.5));
            [at - 0.5 * width, at + 0.5 * width]
        })
        .collect();
    Shape::new(format!("relays {relays:.3?}"), &[channel], move |view| {
        let mut up = vec![false; relays.len()];
        view.channel(channel)
            .into_iter()
            .map(|value| {
                for (up, [low, high]) in up.iter_mut().zip(&relays) {
                    *up = value > *high || (*up && value > *low);
                }
                up.iter().filter(|up| **up).count() as f64 / relays.len() as f64
            })
            .collect()
    })
}

/// Bouc and Wen's: z' = u' − β |u'| z, with a leak.
fn rate_hysteresis(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, beta) = (sketch.channels[0], sketch.draw.uniform(1.0, 4.0));
    let leak_s = sketch.draw.log_uniform(60.0, 600.0);
    Shape::new(format!("Bouc-Wen {beta:.3} {leak_s:.1} s"), &[channel], move |view| {
        let values = view.channel(channel);
        let (mut last, mut state) = (values.first().copied().unwrap_or_default(), 0.0);
        values
            .into_iter()
            .map(|value| {
                let step: f64 = value - last;
                last = value;
                state += step - beta * step.abs() * state - state / leak_s;
                state
            })
            .collect()
    })
}

fn rate_memory(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, tau_s) = (sketch.channels[0], sketch.draw.log_uniform(15.0, 120.0));
    Shape::new(format!("rate behind {tau_s:.1} s"), &[channel], move |view| {
        let values = view.channel(channel);
        let rates: Vec<f64> = values.windows(2).map(|pair| 60.0 * (pair[1] - pair[0])).collect();
        let rates = [&rates[..1], &rates].concat();
        low_passed(&rates, tau_s)
    })
}

fn squared_heat(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, zero) = (sketch.channels[0], sketch.draw.uniform(-0.6, 0.6));
    let tau_s = sketch.draw.log_uniform(30.0, 400.0);
    Shape::new(format!("(channel − {zero:.3})² behind {tau_s:.1} s"), &[channel], move |view| {
        let heat: Vec<f64> = view.channel(channel).into_iter().map(|value| (value - zero).powi(2)).collect();
        low_passed(&heat, tau_s)
    })
}

/// Delayed, and smeared on its way.
fn transport(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, delay_s) = (sketch.channels[0], sketch.draw.whole(35, 90));
    let smear_s = sketch.draw.log_uniform(4.0, 25.0);
    Shape::new(format!("{delay_s} s ago, smeared {smear_s:.1} s"), &[channel], move |view| {
        let values = view.channel(channel);
        let delayed: Vec<f64> = (0..values.len()).map(|second| values[second.saturating_sub(delay_s)]).collect();
        low_passed(&low_passed(&delayed, smear_s), smear_s)
    })
}

fn peak_memory(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, leak_s) = (sketch.channels[0], sketch.draw.log_uniform(200.0, 2000.0));
    Shape::new(format!("greatest so far, leaking in {leak_s:.0} s"), &[channel], move |view| {
        let values = view.channel(channel);
        let mut peak = f64::NEG_INFINITY;
        values
            .iter()
            .map(|value| {
                peak = value.max(peak - (peak - value) / leak_s);
                peak
            })
            .collect()
    })
}

/// A function of two channels, second by second.
fn of_two(sketch: &mut Sketch<'_>, words: String, function: impl Fn(f64, f64) -> f64 + Send + Sync + 'static) -> Shape {
    let (first, second) = (sketch.channels[0], sketch.channels[1]);
    Shape::new(format!("{words} of {first}, {second}"), &[first, second], move |view| {
        view.channel(first).into_iter().zip(view.channel(second)).map(|(a, b)| function(a, b)).collect()
    })
}

fn difference(sketch: &mut Sketch<'_>) -> Shape {
    let at = sketch.draw.uniform(-0.5, 0.5);
    of_two(sketch, format!("bend of the difference at {at:.3}"), move |a, b| (1.5 * (a - b - at)).tanh())
}

fn product(sketch: &mut Sketch<'_>) -> Shape {
    of_two(sketch, "product".into(), |a, b| a * b)
}

fn quotient(sketch: &mut Sketch<'_>) -> Shape {
    let offset = sketch.draw.uniform(2.5, 4.0);
    of_two(sketch, format!("quotient {offset:.3}"), move |a, b| (offset + a) / (offset + b).max(0.3))
}

fn maximum(sketch: &mut Sketch<'_>) -> Shape {
    of_two(sketch, "maximum".into(), f64::max)
}

fn gated(sketch: &mut Sketch<'_>) -> Shape {
    let at = sketch.draw.uniform(-0.4, 0.4);
    of_two(sketch, format!("gate at {at:.3}"), move |a, b| if b > at { a } else { 0.0 })
}

fn surface_of_three(sketch: &mut Sketch<'_>) -> Shape {
    let channels = [sketch.channels[0], sketch.channels[1], sketch.channels[2]];
    let waves = [(); 3].map(|()| sketch.draw.sign() * sketch.draw.uniform(0.6, 1.4));
    let phase = sketch.draw.uniform(0.0, 6.3);
    Shape::new(format!("sine of {channels:?} by {waves:.3?} + {phase:.3}"), &channels, move |view| {
        let of = channels.map(|channel| view.channel(channel));
        (0..view.seconds())
            .map(|second| (phase + (0..3).map(|i| waves[i] * of[i][second]).sum::<f64>()).sin())
            .collect()
    })
}

fn scale_by_channel(sketch: &mut Sketch<'_>) -> Shape {
    let channel = sketch.channels[0];
    Shape::new(format!("north rate times channel {channel}"), &[channel], move |view| {
        view.channel(channel).into_iter().zip(view.north()).map(|(value, north)| value * north).collect()
    })
}

/// The coil's field lies along a fixed direction of the case, the gyro feels it across its axis.
fn coil_current(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, at_deg) = (sketch.channels[0], sketch.draw.uniform(0.0, 360.0));
    let idle = sketch.draw.uniform(0.0, 1.5);
    Shape::new(format!("coil at {at_deg:.1}°, idle {idle:.3}"), &[channel], move |view| {
        view.channel(channel)
            .into_iter()
            .zip(&view.index_deg)
            .map(|(value, index_deg)| (idle + value) * (index_deg - at_deg).to_radians().cos())
            .collect()
    })
}

fn rectified(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, floor) = (sketch.channels[0], sketch.draw.uniform(-1.0, 0.5));
    Shape::new(format!("square above {floor:.3}"), &[channel], move |view| {
        view.channel(channel).into_iter().map(|value| (value - floor).max(0.0).powi(2)).collect()
    })
}

/// Smooth, drawn anew for each run.
fn hidden_cause(sketch: &mut Sketch<'_>) -> Shape {
    let (seed, tau_s) = (sketch.draw.seed(), sketch.draw.log_uniform(20.0, 150.0));
    let course = move |view: &super::RunView<'_>| {
        let mut draw = super::of_run(seed, view);
        let white: Vec<f64> = (0..view.seconds()).map(|_| draw.normal()).collect();
        low_passed(&low_passed(&white, tau_s), tau_s)
    };
    Shape::new(format!("wanders in {tau_s:.1} s"), &[], course).unknowable()
}
