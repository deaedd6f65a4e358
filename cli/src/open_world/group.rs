//! The grammar: groups of basis functions, built from bases of channels, time, moves and headings.

use super::of_two::OfTwo;
use super::rhythm::Rhythm;
use super::tuned::Tuned;

/// Half widths of the play operators, in half ranges of the channel.
pub const PLAY_WIDTHS: [f64; 6] = [0.06, 0.12, 0.2, 0.35, 0.55, 0.8];
/// Time constants of the low-passes behind curves, seconds.
pub const TIMES_S: [f64; 3] = [10.0, 40.0, 150.0];

/// What a channel, the time, the moves or the heading give by themselves, reduced to few functions: products are made of
/// these. Channels by their place among the campaign's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Base {
    /// A smooth curve in a channel.
    Value(usize),
    /// A channel less its low-passes.
    Memory(usize),
    /// Curves in a channel's play operators.
    Play(usize),
    /// Harmonic of the index angle, of this order.
    Harmonic(u8),
    /// The Earth's part of the rate.
    Rate,
    /// Decays after a move.
    Settling,
    /// The same in proportion to the move's travel, without and with its sign.
    Travel,
    /// A curve in the time since switch-on, and decays.
    Time,
    /// Bumps in the heading.
    Heading,
    /// A curve in the tilt along the axis.
    Tilt,
    /// Whether the number of moves is odd, and the direction of the last.
    Turn,
}

/// Functions that enter or leave a model together: their weights have one prior variance.
#[derive(Clone, Debug, PartialEq)]
pub enum Group {
    Base(Base),
    Tuned(usize, Tuned),
    /// A channel while another is above a place.
    Gated {
        channel: usize,
        by: usize,
        at: f64,
    },
    OfTwo([usize; 2], OfTwo),
    /// A smooth or sharp curve in a combination of channels, whose direction (of length 1) is tuned.
    Ridge {
        direction: Vec<f64>,
        sharp: bool,
    },
    /// An error of the index as a harmonic of its angle, turns counted, of any order: what a gear makes.
    Gear(f64),
    /// The first harmonic of the index angle while the heading is in a sector: where it begins, and its width, degrees.
    Sector([f64; 2]),
    /// Many relays with thresholds of their own in a channel, all off at the beginning.
    Relays(usize),
    /// Decays after a move whose time constant is this many seconds in the middle of a channel's range, and e times as long where the
    /// channel is greater by this share of a half range.
    SettlingTime {
        channel: usize,
        time_s: f64,
        slope: f64,
    },
    /// Decays since switch-on of all times: together also a power of the time.
    Relaxation,
    /// What repeats itself, at a phase of each run's own.
    Rhythm(Rhythm),
    /// Low-passes of a channel forward and backward: a channel that is recorded with noise.
    Smoothed(usize),
    Linear(usize),
    Quadratic(usize),
    Change(usize),
    SharpCurve(usize),
    LongMemory(usize),
    Backlash(usize),
    /// One play operator, by the place of its width in [`PLAY_WIDTHS`].
    Hysteresis(usize, usize),
    /// Memory of a curve in a channel: the heat of a current.
    MemoryOfCurve(usize),
    /// A curve in the low-passed channel, by the place of the time constant.
    CurveOfMemory(usize, usize),
    /// Memory of the channel's rate of change, its square and its modulus.
    MemoryOfChange(usize),
    HighHarmonics,
    EarthField,
    AxisHarmonics,
    /// Harmonic of the axis's azimuth, of this order.
    AxisHarmonic(u8),
    /// A curve in the axis's azimuth; a broad one.
    AxisCurve,
    BroadAxisCurve,
    /// A curve in the index angle as an error of the index.
    IndexCurve,
    /// A curve in the index angle, turns counted: a cable that winds up.
    Winding,
    /// What grows or dies away after a move, by its direction; and with a sign that changes from move to move.
    Creep,
    Alternating,
    /// Decays by powers of the travel.
    SettlingByCurve,
    RateCurve,
    Drift,
    SettlingByCount,
    SettlingEveryDwell,
    SettlingByPosition,
    TiltLinear,
    /// Tilt along the axis and its square; with that across the axis, all terms of the second order.
    TiltSquare,
    TiltQuadratic,
    TiltRate,
    /// All channels by their principal components within runs; and their memory.
    AllChannels,
    AllMemory,
    Product(Base, Base),
    /// The plain product of two channels; and all terms up to the third power.
    Bilinear(usize, usize),
    Bicubic(usize, usize),
    LinearTimes(usize, Base),
    Triple(usize, usize, Base),
    /// What an accepted group was found to be, times a base.
    Extended {
        parent: Box<Group>,
        weights: Vec<f64>,
        base: Base,
    },
}

/// Steps of a slope of the logarithm of a time constant, a half range, for a share of one.
const OF_SLOPE: f64 = 5.0;
/// Steps of what is tuned for a share of one: of a direction, an order, an angle in degrees.
const OF_DIRECTION: f64 = 5.0;
const OF_GEAR: f64 = 1.5;
const OF_SECTOR_DEG: f64 = 180.0;

impl Base {
    fn follows_heading(self) -> bool {
        matches!(self, Self::Rate | Self::Heading)
    }

    pub fn channel(self) -> Option<usize> {
        match self {
            Self::Value(channel) | Self::Memory(channel) | Self::Play(channel) => Some(channel),
            _ => None,
        }
    }

    fn words(self, names: &[String]) -> String {
        match self {
            Self::Value(channel) => names[channel].clone(),
            Self::Memory(channel) => format!("memory of {}", names[channel]),
            Self::Play(channel) => format!("hysteresis in {}", names[channel]),
            Self::Harmonic(order) => format!("harmonic {order} of the index angle"),
            Self::Rate => "rate".into(),
            Self::Settling => "decay after a move".into(),
            Self::Travel => "decay by travel".into(),
            Self::Time => "time since switch-on".into(),
            Self::Heading => "heading".into(),
            Self::Tilt => "tilt along the axis".into(),
            Self::Turn => "direction of the move".into(),
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Value(_) => "curve",
            Self::Memory(_) => "memory",
            Self::Play(_) => "hysteresis",
            Self::Harmonic(_) => "harmonic",
            Self::Rate => "rate",
            Self::Settling => "settling",
            Self::Travel => "settling-by-travel",
            Self::Time => "time",
            Self::Heading => "heading",
            Self::Tilt => "tilt",
            Self::Turn => "turn",
        }
    }
}

impl Group {
    /// The same functions with a constant a little more or less, by a share of a channel's half range.
    pub fn neighbours(&self, share: f64) -> Vec<Self> {
        match self {
            Self::Tuned(channel, tuned) => {
                tuned.neighbours(share).into_iter().map(|tuned| Self::Tuned(*channel, tuned)).collect()
            }
            Self::Gated { channel, by, at } => {
                [at - share, at + share].map(|at| Self::Gated { channel: *channel, by: *by, at }).to_vec()
            }
            Self::OfTwo(channels, of_two) => {
                of_two.neighbours(share).into_iter().map(|of_two| Self::OfTwo(*channels, of_two)).collect()
            }
            Self::Ridge { direction, sharp } => {
                let turned = |channel: usize, by: f64| {
                    let mut direction = direction.clone();
                    direction[channel] += OF_DIRECTION * by;
                    Self::Ridge { direction: unit(direction), sharp: *sharp }
                };
                let used: Vec<usize> = (0..direction.len()).filter(|&channel| direction[channel] != 0.0).collect();
                let mut all: Vec<Self> =
                    used.into_iter().flat_map(|channel| [turned(channel, -share), turned(channel, share)]).collect();
                all.push(Self::Ridge { direction: direction.clone(), sharp: !sharp });
                all
            }
            Self::SettlingTime { channel, time_s, slope } => {
                let times = [time_s / (1.0 + OF_SLOPE * share), time_s * (1.0 + OF_SLOPE * share)];
                let slopes = [slope - OF_SLOPE * share, slope + OF_SLOPE * share];
                let new = |time_s: f64, slope: f64| Self::SettlingTime { channel: *channel, time_s, slope };
                times
                    .map(|time_s| new(time_s, *slope))
                    .into_iter()
                    .chain(slopes.map(|slope| new(*time_s, slope)))
                    .collect()
            }
            Self::Gear(order) => [order - OF_GEAR * share, order + OF_GEAR * share].map(Self::Gear).to_vec(),
            Self::Sector([from_deg, width_deg]) => {
                let step_deg = OF_SECTOR_DEG * share;
                [(-step_deg, 0.0), (step_deg, 0.0), (0.0, -step_deg), (0.0, step_deg)]
                    .map(|(of_from, of_width)| Self::Sector([from_deg + of_from, width_deg + of_width]))
                    .to_vec()
            }
            _ => Vec::new(),
        }
    }

    /// Of what acts in a sector of headings, the same at all headings.
    pub fn everywhere(&self) -> Option<Self> {
        matches!(self, Self::Sector(_)).then_some(Self::Base(Base::Harmonic(1)))
    }

    /// How complex: the penalty grows with it.
    pub fn level(&self) -> f64 {
        match self {
            Self::Bilinear(..) | Self::LinearTimes(..) => 1.3,
            // A constant is searched for.
            Self::Tuned(..) | Self::Gated { .. } | Self::OfTwo(..) | Self::Gear(_) => 2.0,
            Self::Ridge { direction, .. } => direction.iter().filter(|share| **share != 0.0).count() as f64,
            Self::Sector(_) | Self::SettlingTime { .. } | Self::Rhythm(_) => 3.0,
            Self::Bicubic(..) => 1.6,
            Self::Product(..) => 2.0,
            Self::Triple(..) | Self::Extended { .. } => 3.0,
            _ => 1.0,
        }
    }

    /// How many constants of its functions are tuned.
    pub fn constants(&self) -> usize {
        match self {
            Self::Tuned(_, tuned) => tuned.constants(),
            Self::OfTwo(_, of_two) => of_two.constants(),
            Self::Gated { .. } | Self::Gear(_) => 1,
            Self::Sector(_) | Self::SettlingTime { .. } => 2,
            Self::Ridge { .. } => self.channels().len() - 1,
            _ => 0,
        }
    }

    /// Whether its functions depend on the run's azimuth.
    pub fn follows_heading(&self) -> bool {
        match self {
            Self::Base(base) | Self::LinearTimes(_, base) | Self::Triple(_, _, base) => base.follows_heading(),
            Self::Gear(_) | Self::Sector(_) | Self::AxisHarmonic(_) => true,
            Self::EarthField | Self::AxisHarmonics | Self::AxisCurve | Self::BroadAxisCurve => true,
            Self::IndexCurve | Self::RateCurve => true,
            Self::Product(first, second) => first.follows_heading() || second.follows_heading(),
            Self::Extended { parent, base, .. } => parent.follows_heading() || base.follows_heading(),
            _ => false,
        }
    }

    /// The channels that it depends on, each once.
    pub fn channels(&self) -> Vec<usize> {
        let mut channels: Vec<usize> = match self {
            Self::Base(base) => base.channel().into_iter().collect(),
            Self::Gated { channel, by, .. } => vec![*channel, *by],
            Self::OfTwo(channels, _) => channels.to_vec(),
            Self::Ridge { direction, .. } => {
                (0..direction.len()).filter(|&channel| direction[channel] != 0.0).collect()
            }
            Self::Linear(channel)
            | Self::Tuned(channel, _)
            | Self::Smoothed(channel)
            | Self::Quadratic(channel)
            | Self::Change(channel)
            | Self::SharpCurve(channel)
            | Self::LongMemory(channel)
            | Self::Backlash(channel)
            | Self::Hysteresis(channel, _)
            | Self::MemoryOfCurve(channel)
            | Self::CurveOfMemory(channel, _)
            | Self::Relays(channel)
            | Self::SettlingTime { channel, .. }
            | Self::MemoryOfChange(channel) => vec![*channel],
            Self::Product(first, second) => first.channel().into_iter().chain(second.channel()).collect(),
            Self::Bilinear(first, second) | Self::Bicubic(first, second) => vec![*first, *second],
            Self::LinearTimes(channel, base) => std::iter::once(*channel).chain(base.channel()).collect(),
            Self::Triple(first, second, base) => [*first, *second].into_iter().chain(base.channel()).collect(),
            Self::Extended { parent, base, .. } => parent.channels().into_iter().chain(base.channel()).collect(),
            _ => Vec::new(),
        };
        channels.sort_unstable();
        channels.dedup();
        channels
    }

    /// Lower-case name with hyphens, stable.
    pub fn name(&self) -> String {
        match self {
            Self::Base(Base::Value(_)) | Self::Quadratic(_) | Self::SharpCurve(_) => "smooth-function".into(),
            Self::Base(Base::Memory(_)) | Self::LongMemory(_) => "memory".into(),
            Self::Base(Base::Play(_)) | Self::Hysteresis(..) | Self::Backlash(_) => "hysteresis".into(),
            Self::Base(Base::Harmonic(order)) => format!("body-harmonic-{order}"),
            Self::Base(Base::Rate) => "scale-factor".into(),
            Self::Base(Base::Settling) => "settling".into(),
            Self::Base(Base::Travel) => "settling-by-travel".into(),
            Self::Base(Base::Time) => "function-of-time".into(),
            Self::Base(Base::Heading) => "function-of-heading".into(),
            Self::Base(Base::Tilt) => "gravity-sensitivity".into(),
            Self::Base(Base::Turn) => "function-of-direction".into(),
            Self::Tuned(_, tuned) => tuned.name().into(),
            Self::Gated { .. } => "gated-channel".into(),
            Self::OfTwo(..) => "function-of-two-channels".into(),
            Self::Smoothed(_) => "smoothed-channel".into(),
            Self::Ridge { .. } if self.channels().len() == 2 => "function-of-two-channels".into(),
            Self::Ridge { .. } => "function-of-channels".into(),
            Self::Relays(_) => "hysteresis".into(),
            Self::SettlingTime { .. } => "settling-by-channel".into(),
            Self::Gear(_) => "gear-error".into(),
            Self::Sector(_) => "harmonic-in-sector".into(),
            Self::Relaxation => "relaxation".into(),
            Self::Rhythm(_) => "rhythm".into(),
            Self::AxisCurve | Self::BroadAxisCurve => "function-of-axis-azimuth".into(),
            Self::IndexCurve => "index-error".into(),
            Self::Winding => "winding".into(),
            Self::Creep => "creep".into(),
            Self::Alternating => "alternating-creep".into(),
            Self::SettlingByCurve => "settling-by-travel".into(),
            Self::Linear(_) => "channel".into(),
            Self::Change(_) => "channel-rate".into(),
            Self::MemoryOfCurve(_) => "memory-of-function".into(),
            Self::CurveOfMemory(..) => "function-of-memory".into(),
            Self::MemoryOfChange(_) => "memory-of-rate".into(),
            Self::HighHarmonics => "body-harmonics".into(),
            Self::EarthField => "earth-field".into(),
            Self::AxisHarmonics | Self::AxisHarmonic(_) => "harmonics-of-axis-azimuth".into(),
            Self::RateCurve => "rate-nonlinearity".into(),
            Self::Drift => "drift".into(),
            Self::SettlingByCount => "settling-by-count".into(),
            Self::SettlingEveryDwell => "settling-every-dwell".into(),
            Self::SettlingByPosition => "settling-by-position".into(),
            Self::TiltLinear | Self::TiltSquare | Self::TiltQuadratic => "gravity-sensitivity".into(),
            Self::TiltRate => "base-motion".into(),
            Self::AllChannels => "combination-of-channels".into(),
            Self::AllMemory => "memory-of-channels".into(),
            Self::Bilinear(..) | Self::Bicubic(..) => "function-of-two-channels".into(),
            Self::Product(Base::Value(first), Base::Value(second)) if first != second => {
                "function-of-two-channels".into()
            }
            Self::Product(first, second) => format!("{}-by-{}", first.word(), second.word()),
            Self::LinearTimes(_, base) => format!("{}-by-channel", base.word()),
            Self::Triple(_, _, base) => format!("{}-by-two-channels", base.word()),
            Self::Extended { parent, base, .. } => format!("{}-by-{}", parent.name(), base.word()),
        }
    }

    /// In words.
    pub fn words(&self, names: &[String]) -> String {
        match self {
            Self::Base(Base::Value(channel)) | Self::SharpCurve(channel) | Self::Quadratic(channel) => {
                format!("smooth function of {}", names[*channel])
            }
            Self::Base(base) => base.words(names),
            Self::Tuned(channel, tuned) => tuned.words(&names[*channel]),
            Self::Gated { channel, by, .. } => format!("{} while {} is high", names[*channel], names[*by]),
            Self::OfTwo(channels, of_two) => of_two.words(channels.map(|channel| names[channel].as_str())),
            Self::Smoothed(channel) => format!("{} without its noise", names[*channel]),
            Self::Ridge { .. } => {
                let names: Vec<&str> = self.channels().into_iter().map(|channel| names[channel].as_str()).collect();
                format!("smooth function of a combination of {}", names.join(" and "))
            }
            Self::Relays(channel) => format!("relays in {}", names[*channel]),
            Self::SettlingTime { channel, .. } => {
                format!("decay after a move that is slower or faster by {}", names[*channel])
            }
            Self::Gear(_) => "error of the index by a harmonic of its angle, turns counted".into(),
            Self::Sector(_) => "harmonic of the index angle in a sector of headings".into(),
            Self::Relaxation => "decays since switch-on".into(),
            Self::Rhythm(rhythm) => {
                format!("what repeats itself every {:.1} s, at a phase of each run's own", rhythm.period_s)
            }
            Self::AxisCurve | Self::BroadAxisCurve => "smooth function of the axis azimuth".into(),
            Self::IndexCurve => "error of the index by its angle".into(),
            Self::Winding => "smooth function of the index angle, turns counted".into(),
            Self::Creep => "creep after a move by its direction".into(),
            Self::Alternating => "creep after a move, its sign changing from move to move".into(),
            Self::SettlingByCurve => "decay by powers of the travel".into(),
            Self::Linear(channel) => format!("{} in proportion", names[*channel]),
            Self::Change(channel) => format!("rate of change of {}", names[*channel]),
            Self::LongMemory(channel) => format!("memory of {}", names[*channel]),
            Self::Backlash(channel) | Self::Hysteresis(channel, _) => format!("hysteresis in {}", names[*channel]),
            Self::MemoryOfCurve(channel) => format!("memory of a function of {}", names[*channel]),
            Self::CurveOfMemory(channel, _) => format!("smooth function of the low-passed {}", names[*channel]),
            Self::MemoryOfChange(channel) => format!("memory of the rate of change of {}", names[*channel]),
            Self::HighHarmonics => "harmonics 3 to 6 of the index angle".into(),
            Self::EarthField => "field fixed to the Earth".into(),
            Self::AxisHarmonics => "harmonics of the axis azimuth".into(),
            Self::AxisHarmonic(order) => format!("harmonic {order} of the axis azimuth"),
            Self::RateCurve => "non-linearity in the rate".into(),
            Self::Drift => "drift in proportion to time".into(),
            Self::SettlingByCount => "decay after a move that grows with the number of moves".into(),
            Self::SettlingEveryDwell => "decay at the beginning of every dwell".into(),
            Self::SettlingByPosition => "decay after a move by the index angle".into(),
            Self::TiltLinear => "gravity along and across the axis".into(),
            Self::TiltSquare => "gravity along the axis and its square".into(),
            Self::TiltQuadratic => "gravity along and across the axis, and its squares".into(),
            Self::TiltRate => "tilt rate".into(),
            Self::AllChannels => "combination of all channels".into(),
            Self::AllMemory => "memory of a combination of all channels".into(),
            Self::Bilinear(first, second) | Self::Bicubic(first, second) => {
                format!("smooth function of {} and {}", names[*first], names[*second])
            }
            Self::Product(Base::Value(first), Base::Value(second)) if first != second => {
                format!("smooth function of {} and {}", names[*first], names[*second])
            }
            Self::Product(first, second) => format!("{} times {}", first.words(names), second.words(names)),
            Self::LinearTimes(channel, base) => format!("{} times {}", base.words(names), names[*channel]),
            Self::Triple(first, second, base) => {
                format!("{} times {} and {}", base.words(names), names[*first], names[*second])
            }
            Self::Extended { parent, base, .. } => format!("{} times {}", parent.words(names), base.words(names)),
        }
    }
}

/// A direction with the length 1.
pub fn unit(direction: Vec<f64>) -> Vec<f64> {
    let length = direction.iter().map(|share| share * share).sum::<f64>().sqrt();
    direction.into_iter().map(|share| share / length).collect()
}
