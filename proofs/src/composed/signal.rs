//! What an effect may follow: channels, the index, the axis, the base, the clock, the moves, the rate.

use super::plan::{EARTH_DEG_H, Move};

/// One run as whoever looks at it sees it: what is so, or what is recorded.
#[derive(Debug, Clone)]
pub(super) struct View<'a> {
    /// Azimuth of the mark, degrees.
    pub(super) azimuth_deg: f64,
    pub(super) latitude_deg: f64,
    /// Pitch and roll, rad.
    pub(super) tilt_rad: [f64; 2],
    /// Second of the day at the beginning, and time since the run before, s.
    pub(super) day_s: f64,
    pub(super) rest_s: f64,
    /// Index angle of every second, degrees.
    pub(super) index_deg: &'a [f64],
    pub(super) moves: &'a [Move],
    pub(super) channels: Vec<&'a [f64]>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Signal {
    /// By its place among the channels.
    Channel(usize),
    /// The first less the second, each in its standard deviations.
    Difference(usize, usize),
    Index,
    Winding,
    /// Azimuth of the sensitive axis.
    AxisAzimuth,
    TiltAlong,
    TiltAcross,
    SinceSwitchOn,
    TimeOfDay,
    Rest,
    SinceMove,
    Travel,
    TravelSigned,
    Direction,
    Moves,
    TurningRate,
    /// The rate about the axis, without bias and effects.
    Rate,
}

impl Signal {
    pub(super) fn is_angle(self) -> bool {
        matches!(self, Self::Index | Self::AxisAzimuth | Self::TimeOfDay)
    }

    /// Whether it begins with the first move; before, the effect is not there.
    pub(super) fn begins_with_move(self) -> bool {
        matches!(self, Self::SinceMove | Self::Travel | Self::TravelSigned | Self::Direction)
    }

    /// A time that begins at zero: what follows it decays.
    pub(super) fn is_elapsed(self) -> bool {
        matches!(self, Self::SinceSwitchOn | Self::SinceMove | Self::Rest)
    }

    /// Whether a dynamics behind it makes something new of it.
    pub(super) fn flows(self) -> bool {
        matches!(
            self,
            Self::Channel(_) | Self::Difference(..) | Self::Winding | Self::TurningRate | Self::Rate | Self::TiltAlong
        )
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Channel(_) => "channel",
            Self::Difference(..) => "difference",
            Self::Index => "index",
            Self::Winding => "winding",
            Self::AxisAzimuth => "axis-azimuth",
            Self::TiltAlong => "tilt-along",
            Self::TiltAcross => "tilt-across",
            Self::SinceSwitchOn => "since-switch-on",
            Self::TimeOfDay => "time-of-day",
            Self::Rest => "rest",
            Self::SinceMove => "since-move",
            Self::Travel => "travel",
            Self::TravelSigned => "signed-travel",
            Self::Direction => "direction",
            Self::Moves => "moves",
            Self::TurningRate => "turning-rate",
            Self::Rate => "rate",
        }
    }

    /// Its course, one value a second: angles and angular quantities in degrees, times in s (time of day as an angle,
    /// 360° a day), rates in °/h and the turning rate in °/s. `spreads` are mean and standard deviation of the channels.
    pub(super) fn course(self, view: &View<'_>, spreads: &[[f64; 2]]) -> Vec<f64> {
        let seconds = view.index_deg.len();
        let each = |value: &dyn Fn(usize) -> f64| (0..seconds).map(value).collect();
        let standard = |channel: usize, second: usize| {
            (view.channels[channel][second] - spreads[channel][0]) / spreads[channel][1]
        };
        let last_move = |second: usize| view.moves.iter().rev().find(|one| one.end_s <= second);
        match self {
            Self::Channel(channel) => view.channels[channel].to_vec(),
            Self::Difference(first, other) => each(&|second| standard(first, second) - standard(other, second)),
            Self::Index => each(&|second| view.index_deg[second].rem_euclid(360.0)),
            Self::Winding => view.index_deg.to_vec(),
            Self::AxisAzimuth => each(&|second| (view.azimuth_deg - view.index_deg[second]).rem_euclid(360.0)),
            Self::TiltAlong => each(&|second| up(view.tilt_rad, view.index_deg[second]).to_degrees()),
            Self::TiltAcross => each(&|second| up(view.tilt_rad, view.index_deg[second] + 90.0).to_degrees()),
            Self::SinceSwitchOn => each(&|second| second as f64 + 0.5),
            Self::TimeOfDay => each(&|second| (view.day_s + second as f64 + 0.5) / 240.0),
            Self::Rest => vec![view.rest_s; seconds],
            Self::SinceMove => {
                each(&|second| last_move(second).map_or(0.0, |one| second as f64 + 0.5 - one.end_s as f64))
            }
            Self::Travel => each(&|second| last_move(second).map_or(0.0, |one| one.travel_deg.abs())),
            Self::TravelSigned => each(&|second| last_move(second).map_or(0.0, |one| one.travel_deg)),
            Self::Direction => each(&|second| last_move(second).map_or(0.0, |one| one.travel_deg.signum())),
            Self::Moves => each(&|second| view.moves.iter().filter(|one| one.end_s <= second).count() as f64),
            Self::TurningRate => each(&|second| match second {
                0 => 0.0,
                _ => view.index_deg[second] - view.index_deg[second - 1],
            }),
            Self::Rate => each(&|second| view.rate_deg_h(view.index_deg[second])),
        }
    }
}

impl View<'_> {
    /// Rate of the Earth about the axis at this index angle, °/h.
    pub(super) fn rate_deg_h(&self, index_deg: f64) -> f64 {
        earth_rate_deg_h(self.latitude_deg, self.azimuth_deg, self.tilt_rad, index_deg)
    }
}

/// Up component of the axis at this index angle: the axis is cos θ · x + sin θ · y, and x, forward, has the up component
/// sin p, y, left, sin r · cos p.
pub(super) fn up([pitch, roll]: [f64; 2], index_deg: f64) -> f64 {
    let (sin, cos) = index_deg.to_radians().sin_cos();
    cos * pitch.sin() + sin * roll.sin() * pitch.cos()
}

/// Earth's rate about the axis of a tilted instrument, °/h, from its axes in east, north and up.
pub(super) fn earth_rate_deg_h(latitude_deg: f64, azimuth_deg: f64, [pitch, roll]: [f64; 2], index_deg: f64) -> f64 {
    let (north_deg_h, up_deg_h) = {
        let (sin, cos) = latitude_deg.to_radians().sin_cos();
        (EARTH_DEG_H * cos, EARTH_DEG_H * sin)
    };
    let (sin_psi, cos_psi) = azimuth_deg.to_radians().sin_cos();
    let (sin, cos) = index_deg.to_radians().sin_cos();
    // Left, level, points to (−cos ψ, sin ψ, 0); with roll it goes up along forward × left.
    let forward = [cos_psi * pitch.cos(), pitch.sin()];
    let left = [roll.cos() * sin_psi - roll.sin() * pitch.sin() * cos_psi, roll.sin() * pitch.cos()];
    north_deg_h * (cos * forward[0] + sin * left[0]) + up_deg_h * (cos * forward[1] + sin * left[1])
}
