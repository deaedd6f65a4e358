//! The grammar: groups of basis functions, built from bases of channels, time, moves and headings.

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
    RateCurve,
    Drift,
    SettlingByCount,
    SettlingEveryDwell,
    SettlingByPosition,
    TiltLinear,
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

/// Channels up to which products of any two of their bases are tried; else only their values with everything global.
const MOST_PRODUCTS: usize = 4;
const MOST_BICUBIC: usize = 6;
const MOST_BILINEAR: usize = 12;

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
    /// All that a campaign with so many channels can show.
    pub fn all(channels: usize, tilt: bool) -> Vec<Self> {
        let mut all = Vec::new();
        for channel in 0..channels {
            use Group::{
                Backlash, Change, CurveOfMemory, Hysteresis, Linear, LongMemory, MemoryOfChange, MemoryOfCurve,
                Quadratic, SharpCurve,
            };
            all.extend([Linear(channel), Quadratic(channel), Change(channel), SharpCurve(channel)]);
            all.extend([LongMemory(channel), Backlash(channel), MemoryOfCurve(channel), MemoryOfChange(channel)]);
            all.extend((0..PLAY_WIDTHS.len()).map(|width| Hysteresis(channel, width)));
            all.extend((0..TIMES_S.len()).map(|time| CurveOfMemory(channel, time)));
        }
        let of_channel = |channel| [Base::Value(channel), Base::Memory(channel), Base::Play(channel)];
        let of_channels: Vec<Base> = (0..channels).flat_map(of_channel).collect();
        let mut global = vec![
            Base::Harmonic(1),
            Base::Harmonic(2),
            Base::Rate,
            Base::Settling,
            Base::Travel,
            Base::Time,
            Base::Heading,
            Base::Turn,
        ];
        global.extend(tilt.then_some(Base::Tilt));
        all.extend(of_channels.iter().chain(&global).map(|&base| Self::Base(base)));
        all.extend([Self::HighHarmonics, Self::EarthField, Self::AxisHarmonics, Self::RateCurve, Self::Drift]);
        all.extend([Self::SettlingByCount, Self::SettlingEveryDwell, Self::SettlingByPosition]);
        if tilt {
            all.extend([Self::TiltLinear, Self::TiltRate]);
        }
        if channels > 1 {
            all.push(Self::AllChannels);
            all.extend((channels <= MOST_BICUBIC).then_some(Self::AllMemory));
        }
        all.extend(products(channels, &of_channels, &global));
        all
    }

    /// The products of an accepted group with every base.
    pub fn extensions(&self, weights: &[f64], channels: usize, tilt: bool) -> Vec<Self> {
        let bases = (0..channels).flat_map(|channel| [Base::Value(channel), Base::Memory(channel)]);
        let global =
            [Base::Harmonic(1), Base::Harmonic(2), Base::Rate, Base::Settling, Base::Travel, Base::Time, Base::Turn];
        let bases = bases.chain(global).chain(tilt.then_some(Base::Tilt));
        bases.map(|base| Self::Extended { parent: Box::new(self.clone()), weights: weights.to_vec(), base }).collect()
    }

    /// How complex: the penalty grows with it.
    pub fn level(&self) -> f64 {
        match self {
            Self::Bilinear(..) | Self::LinearTimes(..) => 1.3,
            Self::Bicubic(..) => 1.6,
            Self::Product(..) => 2.0,
            Self::Triple(..) | Self::Extended { .. } => 3.0,
            _ => 1.0,
        }
    }

    /// Whether its functions depend on the run's azimuth.
    pub fn follows_heading(&self) -> bool {
        match self {
            Self::Base(base) | Self::LinearTimes(_, base) | Self::Triple(_, _, base) => base.follows_heading(),
            Self::EarthField | Self::AxisHarmonics | Self::RateCurve => true,
            Self::Product(first, second) => first.follows_heading() || second.follows_heading(),
            Self::Extended { parent, base, .. } => parent.follows_heading() || base.follows_heading(),
            _ => false,
        }
    }

    /// The channels that it depends on, each once.
    pub fn channels(&self) -> Vec<usize> {
        let mut channels: Vec<usize> = match self {
            Self::Base(base) => base.channel().into_iter().collect(),
            Self::Linear(channel)
            | Self::Quadratic(channel)
            | Self::Change(channel)
            | Self::SharpCurve(channel)
            | Self::LongMemory(channel)
            | Self::Backlash(channel)
            | Self::Hysteresis(channel, _)
            | Self::MemoryOfCurve(channel)
            | Self::CurveOfMemory(channel, _)
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
            Self::Linear(_) => "channel".into(),
            Self::Change(_) => "channel-rate".into(),
            Self::MemoryOfCurve(_) => "memory-of-function".into(),
            Self::CurveOfMemory(..) => "function-of-memory".into(),
            Self::MemoryOfChange(_) => "memory-of-rate".into(),
            Self::HighHarmonics => "body-harmonics".into(),
            Self::EarthField => "earth-field".into(),
            Self::AxisHarmonics => "harmonics-of-axis-azimuth".into(),
            Self::RateCurve => "rate-nonlinearity".into(),
            Self::Drift => "drift".into(),
            Self::SettlingByCount => "settling-by-count".into(),
            Self::SettlingEveryDwell => "settling-every-dwell".into(),
            Self::SettlingByPosition => "settling-by-position".into(),
            Self::TiltLinear => "gravity-sensitivity".into(),
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
            Self::RateCurve => "non-linearity in the rate".into(),
            Self::Drift => "drift in proportion to time".into(),
            Self::SettlingByCount => "decay after a move that grows with the number of moves".into(),
            Self::SettlingEveryDwell => "decay at the beginning of every dwell".into(),
            Self::SettlingByPosition => "decay after a move by the index angle".into(),
            Self::TiltLinear => "gravity along the axis".into(),
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

fn products(channels: usize, of_channels: &[Base], global: &[Base]) -> Vec<Group> {
    let mut all = Vec::new();
    let near: Vec<Base> = if channels <= MOST_PRODUCTS {
        of_channels.iter().chain(global).copied().collect()
    } else {
        global.iter().copied().chain((0..channels).map(Base::Value)).collect()
    };
    for (place, &first) in near.iter().enumerate() {
        for &second in &near[place..] {
            let of_value = |base: Base| matches!(base, Base::Value(_));
            // Products with the heading act as numbers of the runs, but for harmonics.
            let heading = [first, second].contains(&Base::Heading);
            let harmonic = |base: Base| matches!(base, Base::Harmonic(_));
            let itself = first == second && !matches!(first, Base::Memory(_));
            let many = channels > MOST_PRODUCTS && of_value(first) && of_value(second);
            if !(itself || many || heading && !harmonic(first) && !harmonic(second)) {
                all.push(Group::Product(first, second));
            }
        }
    }
    let gates = [Base::Harmonic(1), Base::Rate, Base::Settling];
    for first in 0..channels {
        all.extend(gates.map(|base| Group::LinearTimes(first, base)));
        for second in first + 1..channels {
            all.extend((channels <= MOST_BILINEAR).then_some(Group::Bilinear(first, second)));
            all.extend((channels <= MOST_BICUBIC).then_some(Group::Bicubic(first, second)));
            if channels <= MOST_PRODUCTS {
                all.extend(gates.map(|base| Group::Triple(first, second, base)));
            }
        }
    }
    all
}
