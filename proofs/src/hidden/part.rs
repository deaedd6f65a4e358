//! Shapes of effects: each is one number to be found times one course in time.
//!
//! Rates are in °/h added to what the gyro reads, for a coefficient of 1; a channel enters as its standard deviations
//! from its mean over the campaign, so that a coefficient is the effect of a typical excursion in °/h.

use super::run_view::{Arrival, Moment, RunView};
use super::shape::Shape;
use hal_sim::scenario::{BaseAngle, Sway};
use hal_sim::seconds::SiteAndGyro;
use std::f64::consts::{FRAC_PI_2, TAU};

/// One shape with its constants. Its coefficient stands beside it, in [`Effect`](super::Effect).
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// A power of a channel's value.
    Power { channel: usize, exponent: i32 },
    /// A bend in a channel's value: tanh((u − at) / width).
    Bend { channel: usize, at: f64, width: f64 },
    /// Rate of change of a channel, in standard deviations a minute.
    Rate { channel: usize },
    /// A channel behind a low-pass that starts settled.
    LowPassed { channel: usize, tau_s: f64 },
    /// A channel some time ago.
    Delayed { channel: usize, delay_s: f64 },
    /// Time since switch-on, hours.
    Drift,
    /// exp(−t/τ) since switch-on.
    Exponential { tau_s: f64 },
    /// exp(−t/τ) since a move.
    AfterMove { tau_s: f64, law: MoveLaw },
    /// cos (or sin) of a multiple of the index angle.
    Harmonic { order: u32, sine: bool },
    /// A step at a time since switch-on, in every run.
    StepAt { at_s: f64 },
    /// All runs from this one on.
    StepFrom { run: usize },
    /// A sinusoid in one run, by itself since its phase is its own.
    Line { run: usize, hz: f64, sine: bool },
    /// Earth's magnetic field along the axis (or across it).
    Magnetic { across: bool },
    /// A loss of rate near zero that is greatest at `width_deg_h`.
    DeadZone { width_deg_h: f64 },
    /// Cube of the rate, in units of 10⁻⁴ (°/h)⁻².
    Cubic,
    /// The base settles in one run, arcsec in pitch (or roll).
    Creep { run: usize, roll: bool, tau_s: f64 },
    /// The base sways in one run, arcsec in pitch (or roll).
    Sway { run: usize, roll: bool, hz: f64, sine: bool },
    /// Bias of the forward (or left) accelerometer, mg.
    LevelBias { left: bool },
    /// Zero error of the encoder, degrees.
    IndexZero,
    /// Once-per-turn error of the encoder: the cos (or sin) part of it, degrees.
    Eccentricity { sine: bool },
    /// Foreign: ± 1 by the direction from which the channel came.
    Hysteresis { channel: usize, width: f64 },
    /// Foreign: a smooth function of two channels that is no sum: sin(a·u + b·v + c).
    Surface { channels: [usize; 2], waves: [f64; 3] },
    /// Foreign: on and off at random times, drawn for each run.
    ComesAndGoes { on: Vec<Vec<[f64; 2]>> },
    /// Foreign: a course over the run.
    Shape(Shape),
}

/// What the size of a transient after a move follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MoveLaw {
    /// Travel in quarter turns, with its sign.
    Travel,
    /// Travel in quarter turns, either way.
    Distance,
    /// Cosine of the position's angle from this one, degrees.
    Position { from_deg: f64 },
}

impl Part {
    /// Whether the coefficient belongs to one run: then nothing is learned of it for another.
    pub fn of_run(&self) -> Option<usize> {
        match *self {
            Self::Line { run, .. } | Self::Creep { run, .. } | Self::Sway { run, .. } => Some(run),
            _ => None,
        }
    }

    /// Whether whoever knows the shape knows its course: not of noise.
    pub fn is_knowable(&self) -> bool {
        !matches!(self, Self::Shape(shape) if !shape.is_knowable)
    }

    /// Numbers of the channels that it depends on.
    pub fn channels(&self) -> Vec<usize> {
        match *self {
            Self::Power { channel, .. }
            | Self::Bend { channel, .. }
            | Self::Rate { channel }
            | Self::LowPassed { channel, .. }
            | Self::Delayed { channel, .. }
            | Self::Hysteresis { channel, .. } => vec![channel],
            Self::Surface { channels, .. } => channels.to_vec(),
            Self::Shape(ref shape) => shape.channels.clone(),
            _ => Vec::new(),
        }
    }

    /// Puts the part into the world of the full plant, for the effects that need its geometry.
    pub(super) fn disturb(&self, size: f64, run: usize, world: &mut SiteAndGyro) {
        match *self {
            Self::Magnetic { across: false } => world.gyro.magnetic_axial_deg_h += size,
            Self::Magnetic { across: true } => world.gyro.magnetic_transverse_deg_h += size,
            Self::DeadZone { width_deg_h } => {
                world.gyro.dead_zone_deg_h = size;
                world.gyro.dead_zone_width_deg_h = width_deg_h;
            }
            Self::Cubic => world.gyro.cubic_per_deg_h2 += 1e-4 * size,
            Self::Creep { run: of, roll, tau_s } if of == run => {
                let axis = usize::from(roll);
                world.base.creep_arcsec[axis] += size;
                world.base.creep_tau_s[axis] = tau_s;
            }
            Self::Sway { run: of, roll, hz, sine } if of == run => world.base.sway.push(Sway {
                angle: if roll { BaseAngle::Roll } else { BaseAngle::Pitch },
                amplitude_arcsec: size.abs(),
                frequency_hz: hz,
                // sin(x + 90°) = cos x; half a turn more is the other sign.
                phase_deg: if sine { 0.0 } else { 90.0 } + if size < 0.0 { 180.0 } else { 0.0 },
                ..Sway::default()
            }),
            Self::LevelBias { left } => world.accelerometer.bias_mg[usize::from(left)] += size,
            Self::IndexZero => world.encoder.zero_deg += size,
            Self::Eccentricity { sine } => {
                // The two parts are those of one amplitude at one angle.
                let encoder = &mut world.encoder;
                let (sin, cos) = encoder.eccentricity_at_deg.to_radians().sin_cos();
                let (mut x, mut y) = (encoder.eccentricity_deg * cos, encoder.eccentricity_deg * sin);
                *(if sine { &mut y } else { &mut x }) += size;
                encoder.eccentricity_deg = x.hypot(y);
                encoder.eccentricity_at_deg = y.atan2(x).to_degrees();
            }
            _ => {}
        }
    }

    /// What it adds to the gyro's rate, for a coefficient of 1; 0 for the parts that are in the plant.
    pub(super) fn rate(&self, view: &RunView<'_>, now: Moment) -> f64 {
        let at = |channel: usize, t_s: f64| view.channels.get(channel).map_or(0.0, |course| course.at(t_s));
        match self {
            Self::Power { channel, exponent } => at(*channel, now.t_s).powi(*exponent),
            Self::Bend { channel, at: bend, width } => ((at(*channel, now.t_s) - bend) / width).tanh(),
            Self::Rate { channel } => 60.0 * (at(*channel, now.t_s + 0.5) - at(*channel, now.t_s - 0.5)),
            Self::LowPassed { channel, tau_s } => {
                view.channels.get(*channel).map_or(0.0, |course| course.low_passed(*tau_s, now.t_s))
            }
            Self::Delayed { channel, delay_s } => at(*channel, (now.t_s - delay_s).max(0.0)),
            Self::Drift => now.t_s / 3600.0,
            Self::Exponential { tau_s } => (-now.t_s / tau_s).exp(),
            Self::AfterMove { tau_s, law } => view
                .arrivals
                .iter()
                .filter(|arrival| arrival.t_s <= now.t_s)
                .map(|arrival| law.size(arrival) * (-(now.t_s - arrival.t_s) / tau_s).exp())
                .sum(),
            Self::Harmonic { order, sine } => {
                let angle = f64::from(*order) * now.index_deg.to_radians();
                if *sine { angle.sin() } else { angle.cos() }
            }
            Self::StepAt { at_s } => f64::from(u8::from(now.t_s >= *at_s)),
            Self::StepFrom { run } => f64::from(u8::from(view.run >= *run)),
            Self::Line { run, hz, sine } if *run == view.run => {
                let angle = TAU * hz * now.t_s;
                // The mean over a row of one second.
                let half = 0.5 * TAU * hz;
                half.sin() / half * if *sine { angle.sin() } else { angle.cos() }
            }
            Self::Hysteresis { channel, width } => {
                view.channels.get(*channel).map_or(0.0, |course| course.play(*width, now.t_s))
            }
            Self::Surface { channels: [first, second], waves: [a, b, c] } => {
                (a * at(*first, now.t_s) + b * at(*second, now.t_s) + c).sin()
            }
            Self::ComesAndGoes { on } => {
                let windows = on.get(view.run).map_or(&[][..], Vec::as_slice);
                f64::from(u8::from(windows.iter().any(|[from_s, to_s]| (*from_s..*to_s).contains(&now.t_s))))
            }
            _ => 0.0,
        }
    }
}

impl MoveLaw {
    fn size(self, arrival: &Arrival) -> f64 {
        let quarters = arrival.travel_deg.to_radians() / FRAC_PI_2;
        match self {
            Self::Travel => quarters,
            Self::Distance => quarters.abs(),
            Self::Position { from_deg } => (arrival.index_deg - from_deg).to_radians().cos(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hidden::signal::Course;

    const STAYS: [Arrival; 2] = [
        Arrival { t_s: 0.0, travel_deg: 0.0, index_deg: 0.0 },
        Arrival { t_s: 40.0, travel_deg: -180.0, index_deg: -180.0 },
    ];

    fn rate(part: &Part, t_s: f64, index_deg: f64) -> f64 {
        // A channel that climbs by 0.1 a second from 2.
        let truth: Vec<f64> = (0..=100).map(|second| 2.0 + 0.1 * f64::from(second)).collect();
        let channels = [Course { reading: truth.clone(), truth }];
        let view = RunView {
            run: 3,
            azimuth_deg: 0.0,
            north_deg_h: 12.0,
            tilt_deg: [0.0; 2],
            index_deg: vec![index_deg; 100],
            arrivals: &STAYS,
            channels: &channels,
        };
        part.rate(&view, Moment { t_s, index_deg })
    }

    fn assert_near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn functions_of_a_channel_by_hand() {
        // At 10 s it is 3.
        assert_near(rate(&Part::Power { channel: 0, exponent: 2 }, 10.0, 0.0), 9.0);
        assert_near(rate(&Part::Rate { channel: 0 }, 10.0, 0.0), 6.0);
        assert_near(rate(&Part::Delayed { channel: 0, delay_s: 4.0 }, 10.0, 0.0), 2.6);
        assert_near(rate(&Part::Delayed { channel: 0, delay_s: 40.0 }, 10.0, 0.0), 2.0);
        assert_near(rate(&Part::Bend { channel: 0, at: 3.0, width: 0.5 }, 10.0, 0.0), 0.0);
        // A ramp behind a low-pass lags by tau · rate when it has settled, here after 10 tau.
        let lag = rate(&Part::Power { channel: 0, exponent: 1 }, 99.5, 0.0)
            - rate(&Part::LowPassed { channel: 0, tau_s: 9.0 }, 99.5, 0.0);
        assert!((lag - 0.9).abs() < 0.06, "{lag}");
    }

    #[test]
    fn after_a_move_by_hand() {
        let law = |law| Part::AfterMove { tau_s: 10.0, law };
        let decayed = (-1.0_f64).exp();
        // Half a turn clockwise, ten seconds ago.
        assert_near(rate(&law(MoveLaw::Travel), 50.0, -180.0), -2.0 * decayed);
        assert_near(rate(&law(MoveLaw::Distance), 50.0, -180.0), 2.0 * decayed);
        // The dwell at 0 began at 0 s, that at −180° at 40 s.
        let both = (-5.0_f64).exp() - decayed;
        assert_near(rate(&law(MoveLaw::Position { from_deg: 0.0 }), 50.0, -180.0), both);
        assert_near(rate(&law(MoveLaw::Travel), 39.0, 0.0), 0.0);
    }

    #[test]
    fn functions_of_time_and_angle_by_hand() {
        assert_near(rate(&Part::Drift, 36.0, 0.0), 0.01);
        assert_near(rate(&Part::Exponential { tau_s: 30.0 }, 60.0, 0.0), (-2.0_f64).exp());
        assert_near(rate(&Part::Harmonic { order: 1, sine: true }, 0.0, 90.0), 1.0);
        assert_near(rate(&Part::Harmonic { order: 2, sine: false }, 0.0, 90.0), -1.0);
        assert_near(rate(&Part::StepAt { at_s: 20.0 }, 19.9, 0.0), 0.0);
        assert_near(rate(&Part::StepAt { at_s: 20.0 }, 20.0, 0.0), 1.0);
        assert_near(rate(&Part::StepFrom { run: 3 }, 0.0, 0.0), 1.0);
        assert_near(rate(&Part::StepFrom { run: 4 }, 0.0, 0.0), 0.0);
        assert_near(rate(&Part::Line { run: 2, hz: 0.1, sine: true }, 2.5, 0.0), 0.0);
        // sinc of a tenth of a turn.
        let angle = 0.1 * std::f64::consts::PI;
        assert_near(rate(&Part::Line { run: 3, hz: 0.1, sine: true }, 2.5, 0.0), angle.sin() / angle);
    }

    #[test]
    fn foreign_shapes_by_hand() {
        // A climbing channel pulls the play to its upper side once it has used it up.
        assert_near(rate(&Part::Hysteresis { channel: 0, width: 1.0 }, 50.5, 0.0), 1.0);
        assert_near(rate(&Part::Hysteresis { channel: 0, width: 1.0 }, 2.0, 0.0), 0.4);
        let on = vec![vec![], vec![], vec![], vec![[10.0, 20.0]]];
        assert_near(rate(&Part::ComesAndGoes { on: on.clone() }, 15.0, 0.0), 1.0);
        assert_near(rate(&Part::ComesAndGoes { on }, 25.0, 0.0), 0.0);
    }
}
