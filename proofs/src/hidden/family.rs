//! The families of effects, and how one of a family is drawn.

use super::draw::Draw;
use super::outside::Outside;
use super::part::{MoveLaw, Part};
use super::plan::{Measure, Needs, Plan};

/// A kind of effect that a campaign can hide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    Nothing,
    ChannelValue,
    ChannelCurve,
    ChannelRate,
    ChannelLag,
    ChannelDelay,
    Drift,
    SinceSwitchOn,
    AfterMove,
    BodyHarmonic,
    EarthField,
    NonLinearity,
    BaseMotion,
    LevelBias,
    IndexAngle,
    Line,
    StepWithin,
    StepBetween,
    Hysteresis,
    TwoChannels,
    ComesAndGoes,
    /// One of those that are drawn apart.
    Outside(&'static Outside),
    /// Effects of this many families at once.
    Several(usize),
}

/// Kinds of families.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Nothing is hidden.
    Nothing,
    /// Effects with names that everybody has in a list.
    Named,
    /// Effects drawn apart from any list.
    Outside,
    /// Two or three effects at once.
    Together,
}

impl Group {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Nothing, Self::Named, Self::Outside, Self::Together];

    /// Name, stable.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Named => "named",
            Self::Outside => "outside",
            Self::Together => "together",
        }
    }
}

impl Family {
    /// The single ones that have parts of their own, the foreign ones last.
    pub const BASIC: [Self; 21] = [
        Self::Nothing,
        Self::ChannelValue,
        Self::ChannelCurve,
        Self::ChannelRate,
        Self::ChannelLag,
        Self::ChannelDelay,
        Self::Drift,
        Self::SinceSwitchOn,
        Self::AfterMove,
        Self::BodyHarmonic,
        Self::EarthField,
        Self::NonLinearity,
        Self::BaseMotion,
        Self::LevelBias,
        Self::IndexAngle,
        Self::Line,
        Self::StepWithin,
        Self::StepBetween,
        Self::Hysteresis,
        Self::TwoChannels,
        Self::ComesAndGoes,
    ];

    /// All of them.
    pub fn all() -> Vec<Self> {
        let outside = Outside::all().map(Self::Outside);
        Self::BASIC.into_iter().chain(outside).chain([Self::Several(2), Self::Several(3)]).collect()
    }

    /// The families whose effects stand together in a campaign: several of those that hide something, or this one.
    pub(super) fn members(self, draw: &mut Draw) -> Vec<Self> {
        let Self::Several(count) = self else { return vec![self] };
        let mut single: Vec<Self> =
            Self::all().into_iter().filter(|family| !matches!(family, Self::Nothing | Self::Several(_))).collect();
        draw.shuffle(&mut single);
        single.truncate(count);
        single
    }

    /// Name, stable: lower-case words with hyphens.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::ChannelValue => "channel-value",
            Self::ChannelCurve => "channel-curve",
            Self::ChannelRate => "channel-rate",
            Self::ChannelLag => "channel-lag",
            Self::ChannelDelay => "channel-delay",
            Self::Drift => "drift",
            Self::SinceSwitchOn => "since-switch-on",
            Self::AfterMove => "after-move",
            Self::BodyHarmonic => "body-harmonic",
            Self::EarthField => "earth-field",
            Self::NonLinearity => "non-linearity",
            Self::BaseMotion => "base-motion",
            Self::LevelBias => "level-bias",
            Self::IndexAngle => "index-angle",
            Self::Line => "line",
            Self::StepWithin => "step-within",
            Self::StepBetween => "step-between",
            Self::Hysteresis => "hysteresis",
            Self::TwoChannels => "two-channels",
            Self::ComesAndGoes => "comes-and-goes",
            Self::Outside(outside) => outside.name,
            Self::Several(2) => "two-effects",
            Self::Several(_) => "three-effects",
        }
    }

    /// Which kind of family it is.
    pub fn group(self) -> Group {
        match self {
            Self::Nothing => Group::Nothing,
            Self::Several(_) => Group::Together,
            family if family.is_foreign() => Group::Outside,
            _ => Group::Named,
        }
    }

    /// In a few words, for tables.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Nothing => "nothing at all",
            Self::ChannelValue => "a channel's value",
            Self::ChannelCurve => "a curve in a channel's value",
            Self::ChannelRate => "a channel's rate of change",
            Self::ChannelLag => "a channel behind a low-pass",
            Self::ChannelDelay => "a channel, delayed",
            Self::Drift => "drift since switch-on",
            Self::SinceSwitchOn => "exponential since switch-on",
            Self::AfterMove => "decay after a move",
            Self::BodyHarmonic => "harmonic of the index angle",
            Self::EarthField => "Earth's magnetic field",
            Self::NonLinearity => "non-linearity in the rate",
            Self::BaseMotion => "base motion",
            Self::LevelBias => "bias of the level sensors",
            Self::IndexAngle => "error of the index angle",
            Self::Line => "spectral line",
            Self::StepWithin => "step within each run",
            Self::StepBetween => "step between runs",
            Self::Hysteresis => "hysteresis in a channel",
            Self::TwoChannels => "function of two channels",
            Self::ComesAndGoes => "comes and goes",
            Self::Outside(outside) => outside.describe,
            Self::Several(2) => "two effects together",
            Self::Several(_) => "three effects together",
        }
    }

    /// The family of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|family| family.name() == name)
    }

    /// Whether it has no name: it is described by what it is composed of, or as a process of the runs' own.
    pub fn is_foreign(self) -> bool {
        matches!(
            self,
            Self::Line
                | Self::Hysteresis
                | Self::TwoChannels
                | Self::ComesAndGoes
                | Self::Outside(_)
                | Self::Several(_)
        )
    }

    pub(super) fn needs(self) -> Needs {
        let channels = match self {
            Self::Outside(outside) => return outside.needs,
            // Whichever they are.
            Self::Several(_) => return Needs { channels: 3, level: true, survey: true, outside: true, ..Needs::NONE },

            Self::ChannelValue
            | Self::ChannelCurve
            | Self::ChannelRate
            | Self::ChannelLag
            | Self::ChannelDelay
            | Self::Hysteresis => 1,
            Self::TwoChannels => 2,
            _ => 0,
        };
        let survey = matches!(
            self,
            Self::BodyHarmonic | Self::EarthField | Self::NonLinearity | Self::LevelBias | Self::IndexAngle
        );
        Needs {
            channels,
            level: matches!(self, Self::BaseMotion | Self::LevelBias),
            survey,
            smooth: self == Self::ChannelRate,
            ..Needs::NONE
        }
    }

    pub(super) fn measure(self) -> Measure {
        match self {
            Self::Outside(outside) => outside.measure,
            Self::Line => Measure::Rows,
            Self::StepBetween => Measure::Runs,
            Self::LevelBias | Self::IndexAngle => Measure::Azimuth,
            _ => Measure::Dwells,
        }
    }

    /// Parts with coefficients whose proportions hold; their size is settled afterwards.
    pub(super) fn parts(self, plan: &Plan, draw: &mut Draw) -> Vec<(f64, Part)> {
        let count = plan.channels.len();
        let channel = if count > 0 { draw.whole(0, count - 1) } else { 0 };
        let one = |part| vec![(1.0, part)];
        let any_phase = |draw: &mut Draw, part: &dyn Fn(bool) -> Part| {
            let phase = draw.uniform(0.0, std::f64::consts::TAU);
            vec![(phase.cos(), part(false)), (phase.sin(), part(true))]
        };
        let run_s = plan.runs.iter().map(|run| run.seconds()).min().unwrap_or_default() as f64;
        match self {
            Self::Nothing | Self::Several(_) => Vec::new(),
            Self::Outside(outside) => one(Part::Shape(outside.shape(plan, draw))),
            Self::ChannelValue => one(Part::Power { channel, exponent: 1 }),
            Self::ChannelCurve => curve(draw, channel),
            Self::ChannelRate => one(Part::Rate { channel }),
            Self::ChannelLag => one(Part::LowPassed { channel, tau_s: draw.log_uniform(15.0, 200.0) }),
            Self::ChannelDelay => one(Part::Delayed { channel, delay_s: draw.uniform(5.0, 30.0) }),
            Self::Drift => one(Part::Drift),
            Self::SinceSwitchOn => one(Part::Exponential { tau_s: draw.log_uniform(25.0, 0.6 * run_s) }),
            Self::AfterMove => {
                let law = match draw.whole(0, 2) {
                    0 => MoveLaw::Travel,
                    1 => MoveLaw::Distance,
                    _ => MoveLaw::Position { from_deg: draw.uniform(0.0, 360.0).round() },
                };
                one(Part::AfterMove { tau_s: draw.log_uniform(4.0, 30.0), law })
            }
            Self::BodyHarmonic => {
                let order = draw.pick(&[1, 1, 1, 2, 2, 3]);
                any_phase(draw, &|sine| Part::Harmonic { order, sine })
            }
            Self::EarthField => any_phase(draw, &|across| Part::Magnetic { across }),
            Self::NonLinearity if draw.chance(0.5) => one(Part::Cubic),
            Self::NonLinearity => one(Part::DeadZone { width_deg_h: draw.uniform(0.8, 4.0) }),
            Self::BaseMotion => base_motion(plan, draw),
            Self::LevelBias => {
                let angle = draw.uniform(0.0, std::f64::consts::TAU);
                // A level error τ turns the azimuth by τ tan φ at most.
                let mg_per_deg = 1e3_f64.to_radians() / plan.latitude_deg.to_radians().tan().abs();
                [(angle.cos(), false), (angle.sin(), true)]
                    .map(|(part, left)| (mg_per_deg * part, Part::LevelBias { left }))
                    .to_vec()
            }
            Self::IndexAngle if draw.chance(0.4) => one(Part::IndexZero),
            Self::IndexAngle => any_phase(draw, &|sine| Part::Eccentricity { sine }),
            Self::Line => {
                let hz = draw.log_uniform(0.015, 0.4);
                (0..plan.runs.len()).flat_map(|run| any_phase(draw, &|sine| Part::Line { run, hz, sine })).collect()
            }
            Self::StepWithin => one(Part::StepAt { at_s: draw.uniform(0.2, 0.8) * run_s }),
            Self::StepBetween => one(Part::StepFrom { run: draw.whole(2, plan.runs.len() - 2) }),
            Self::Hysteresis => one(Part::Hysteresis { channel, width: draw.uniform(0.3, 1.0) }),
            Self::TwoChannels => {
                let second = (channel + draw.whole(1, count - 1)) % count;
                let waves = [draw.uniform(0.8, 2.0), draw.uniform(0.8, 2.0), draw.uniform(0.0, 6.3)];
                one(Part::Surface { channels: [channel, second], waves })
            }
            Self::ComesAndGoes => one(Part::ComesAndGoes { on: windows(plan, draw) }),
        }
    }
}

/// Powers up to the third, or a bend.
fn curve(draw: &mut Draw, channel: usize) -> Vec<(f64, Part)> {
    if draw.chance(0.35) {
        let bend = Part::Bend { channel, at: draw.uniform(-0.7, 0.7), width: draw.uniform(0.2, 0.8) };
        return vec![(1.0, bend)];
    }
    let cubic = if draw.chance(0.5) { 0.2 * draw.normal() } else { 0.0 };
    let mut powers = vec![(0.5 * draw.normal(), 1), (draw.sign() * draw.uniform(0.3, 0.8), 2)];
    if cubic != 0.0 {
        powers.push((cubic, 3));
    }
    powers.into_iter().map(|(size, exponent)| (size, Part::Power { channel, exponent })).collect()
}

/// Every run settles by its own amounts, with time constants of the tripod; or every run sways by itself.
fn base_motion(plan: &Plan, draw: &mut Draw) -> Vec<(f64, Part)> {
    let runs = 0..plan.runs.len();
    if draw.chance(0.6) {
        let tau_s = draw.log_uniform(40.0, 300.0);
        return runs
            .flat_map(|run| [false, true].map(|roll| (draw.normal(), Part::Creep { run, roll, tau_s })))
            .collect();
    }
    let hz = 1.0 / draw.uniform(25.0, 90.0);
    let kinds = [(false, false), (false, true), (true, false), (true, true)];
    runs.flat_map(|run| kinds.map(|(roll, sine)| (draw.normal(), Part::Sway { run, roll, hz, sine }))).collect()
}

/// Times at which something is on, for each run.
fn windows(plan: &Plan, draw: &mut Draw) -> Vec<Vec<[f64; 2]>> {
    let (off_s, on_s) = (draw.log_uniform(20.0, 120.0), draw.log_uniform(8.0, 60.0));
    let duration_s = |draw: &mut Draw, mean_s: f64| -mean_s * draw.uniform(f64::EPSILON, 1.0).ln();
    plan.runs
        .iter()
        .map(|run| {
            let (mut t_s, mut windows) = (duration_s(draw, off_s), Vec::new());
            while t_s < run.seconds() as f64 {
                let end_s = t_s + duration_s(draw, on_s);
                windows.push([t_s, end_s]);
                t_s = end_s + duration_s(draw, off_s);
            }
            windows
        })
        .collect()
}
