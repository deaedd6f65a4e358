//! What follows headings, angles and moves.

use super::super::plan::Needs;
use super::super::shape::Shape;
use super::{ANY, Outside, Sketch, channels, family};
use crate::hidden::run_view::RunView;

/// Seen only against surveyed headings.
const SURVEYED: Needs = Needs { survey: true, ..ANY };
/// On a mount that is not level.
const TILTED: Needs = Needs { survey: true, level: true, tilted: true, ..ANY };

pub(super) const FAMILIES: &[Outside] = &[
    family("heading-quadrant", "an effect in one quadrant of headings", SURVEYED, heading_quadrant),
    family("axis-sector", "an effect where the axis points one way", SURVEYED, axis_sector),
    family("axis-harmonic", "harmonic of the axis's azimuth", SURVEYED, axis_harmonic),
    family("gear", "index error with the period of a gear", SURVEYED, gear),
    family("gravity", "gyro sensitive to gravity, tilted mount", TILTED, gravity),
    family("gravity-squared", "gyro sensitive to gravity squared", TILTED, gravity_squared),
    family("cable", "a cable that winds up", ANY, cable),
    family("growing-decay", "decay that grows with the position's number", ANY, growing_decay),
    family("decay-temperature", "decay time that follows a channel", channels(1), decay_temperature),
    family("alternating", "sign that changes from dwell to dwell", ANY, alternating),
    family("logarithmic", "logarithmic creep after a move", ANY, logarithmic),
    family("two-decays", "two decays after a move", ANY, two_decays),
    family("last-direction", "backlash by the direction of the last move", ANY, last_direction),
    family("long-move", "a transient after long moves only", ANY, long_move),
];

/// A course from the second's number.
fn by_second(view: &RunView<'_>, function: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..view.seconds()).map(function).collect()
}

/// A magnet that the index feels, but only while the mark points into one quadrant.
fn heading_quadrant(sketch: &mut Sketch<'_>) -> Shape {
    let (from_deg, at_deg) = (sketch.draw.uniform(0.0, 360.0), sketch.draw.uniform(0.0, 360.0));
    Shape::new(format!("headings from {from_deg:.1}°, index at {at_deg:.1}°"), &[], move |view| {
        let inside = (view.azimuth_deg - from_deg).rem_euclid(360.0) < 90.0;
        by_second(view, |second| if inside { (view.index_deg[second] - at_deg).to_radians().cos() } else { 0.0 })
    })
}

fn axis_sector(sketch: &mut Sketch<'_>) -> Shape {
    let (at_deg, width_deg) = (sketch.draw.uniform(0.0, 360.0), sketch.draw.uniform(25.0, 60.0));
    Shape::new(format!("axis at {at_deg:.1}° ± {width_deg:.1}°"), &[], move |view| {
        by_second(view, |second| {
            let off_deg = (view.axis_deg(second) - at_deg + 180.0).rem_euclid(360.0) - 180.0;
            (-0.5 * (off_deg / width_deg).powi(2)).exp()
        })
    })
}

fn axis_harmonic(sketch: &mut Sketch<'_>) -> Shape {
    let (order, at_deg) = (sketch.draw.whole(2, 5) as f64, sketch.draw.uniform(0.0, 360.0));
    Shape::new(format!("{order} periods of the axis's azimuth, {at_deg:.1}°"), &[], move |view| {
        by_second(view, |second| (order * (view.axis_deg(second) - at_deg).to_radians()).cos())
    })
}

/// A gear that turns some times a turn: the axis stands elsewhere than the encoder says, degrees.
fn gear(sketch: &mut Sketch<'_>) -> Shape {
    let (teeth, phase) = (sketch.draw.uniform(1.5, 7.5), sketch.draw.uniform(0.0, 6.3));
    Shape::new(format!("gear of {teeth:.3} turns, phase {phase:.3}"), &[], move |view| {
        by_second(view, |second| {
            let error_deg = (teeth * view.index_deg[second].to_radians() + phase).sin();
            view.north_deg_h * (view.axis_deg(second).to_radians().sin()) * error_deg.to_radians()
        })
    })
}

fn gravity(sketch: &mut Sketch<'_>) -> Shape {
    let at_deg = sketch.draw.uniform(0.0, 360.0);
    Shape::new(format!("gravity along {at_deg:.1}° from the axis"), &[], move |view| {
        by_second(view, |second| view.up(second, at_deg))
    })
}

fn gravity_squared(_: &mut Sketch<'_>) -> Shape {
    Shape::new("gravity squared", &[], move |view| by_second(view, |second| 100.0 * view.up(second, 0.0).powi(2)))
}

fn cable(sketch: &mut Sketch<'_>) -> Shape {
    let slack_deg = sketch.draw.uniform(60.0, 150.0);
    Shape::new(format!("cable, slack {slack_deg:.0}°"), &[], move |view| {
        by_second(view, |second| {
            let index_deg = view.index_deg[second];
            index_deg.signum() * ((index_deg.abs() - slack_deg).max(0.0) / 90.0)
        })
    })
}

/// Sums what every move leaves: from the number of the position, its travel in degrees and the time since.
fn after_moves(view: &RunView<'_>, function: impl Fn(usize, f64, f64) -> f64) -> Vec<f64> {
    by_second(view, |second| {
        let t_s = second as f64 + 0.5;
        let past = view.arrivals.iter().enumerate().filter(|(_, arrival)| arrival.t_s <= t_s);
        past.map(|(number, arrival)| function(number, arrival.travel_deg, t_s - arrival.t_s)).sum()
    })
}

fn growing_decay(sketch: &mut Sketch<'_>) -> Shape {
    let tau_s = sketch.draw.log_uniform(5.0, 40.0);
    Shape::new(format!("grows with the position, dies in {tau_s:.1} s"), &[], move |view| {
        after_moves(view, |number, _, since_s| (1.0 + number as f64) * (-since_s / tau_s).exp())
    })
}

fn decay_temperature(sketch: &mut Sketch<'_>) -> Shape {
    let (channel, tau_s, slope) =
        (sketch.channels[0], sketch.draw.log_uniform(6.0, 25.0), sketch.draw.uniform(0.4, 0.9));
    Shape::new(format!("dies in {tau_s:.1} s · exp({slope:.3} · channel {channel})"), &[channel], move |view| {
        let values = view.channel(channel);
        after_moves(view, |number, travel_deg, since_s| {
            let at = (view.arrivals[number].t_s as usize).min(values.len() - 1);
            let tau_s = tau_s * (slope * values[at]).exp();
            (travel_deg / 90.0).abs() * (-since_s / tau_s).exp()
        })
    })
}

fn alternating(sketch: &mut Sketch<'_>) -> Shape {
    let tau_s = sketch.draw.log_uniform(5.0, 60.0);
    Shape::new(format!("alternates, grows in {tau_s:.1} s"), &[], move |view| {
        by_second(view, |second| {
            let t_s = second as f64 + 0.5;
            let past = view.arrivals.iter().filter(|arrival| arrival.t_s <= t_s);
            let (number, since_s) =
                past.enumerate().last().map_or((0, t_s), |(number, arrival)| (number + 1, t_s - arrival.t_s));
            let sign = if number % 2 == 0 { 1.0 } else { -1.0 };
            sign * (1.0 - (-since_s / tau_s).exp())
        })
    })
}

fn logarithmic(sketch: &mut Sketch<'_>) -> Shape {
    let tau_s = sketch.draw.log_uniform(0.5, 5.0);
    Shape::new(format!("logarithm of time over {tau_s:.2} s after a move"), &[], move |view| {
        let last = |second: usize| {
            let t_s = second as f64 + 0.5;
            view.arrivals.iter().rev().find(|arrival| arrival.t_s <= t_s).map(|arrival| (arrival, t_s - arrival.t_s))
        };
        by_second(view, |second| {
            last(second).map_or(0.0, |(arrival, since_s)| arrival.travel_deg.signum() * (1.0 + since_s / tau_s).ln())
        })
    })
}

fn two_decays(sketch: &mut Sketch<'_>) -> Shape {
    let (fast_s, slow_s) = (sketch.draw.log_uniform(3.0, 8.0), sketch.draw.log_uniform(25.0, 80.0));
    let share = sketch.draw.uniform(-0.8, 0.8);
    Shape::new(format!("{fast_s:.1} s by travel and {share:.2} × {slow_s:.1} s by distance"), &[], move |view| {
        after_moves(view, |_, travel_deg, since_s| {
            let quarters = travel_deg / 90.0;
            quarters * (-since_s / fast_s).exp() + share * quarters.abs() * (-since_s / slow_s).exp()
        })
    })
}

fn last_direction(_: &mut Sketch<'_>) -> Shape {
    Shape::new("direction of the last move", &[], move |view| {
        by_second(view, |second| {
            let t_s = second as f64 + 0.5;
            let last = view.arrivals.iter().rev().find(|arrival| arrival.t_s <= t_s);
            last.map_or(0.0, |arrival| arrival.travel_deg.signum())
        })
    })
}

fn long_move(sketch: &mut Sketch<'_>) -> Shape {
    let (tau_s, least_deg) = (sketch.draw.log_uniform(5.0, 40.0), sketch.draw.uniform(30.0, 80.0));
    Shape::new(format!("moves beyond {least_deg:.0}°, dies in {tau_s:.1} s"), &[], move |view| {
        after_moves(view, |_, travel_deg, since_s| {
            (travel_deg.abs() - least_deg).max(0.0).powi(2) / 1000.0 * (-since_s / tau_s).exp()
        })
    })
}
