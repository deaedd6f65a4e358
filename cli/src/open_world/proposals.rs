//! What a campaign can show: the groups that the search begins with, and those that an accepted group leads to.

use super::group::{Base, Group, PLAY_WIDTHS, TIMES_S, unit};
use super::of_two::{OfTwo, directions_rad};
use super::tuned::{PLACE_STEP, PLACES, Tuned};

/// Channels up to which products of any two of their bases are tried; else only their values with everything global.
const MOST_PRODUCTS: usize = 4;
/// Channels up to which any two are tried in functions with constants that are tuned.
const MOST_TUNED: usize = 5;
const MOST_BICUBIC: usize = 6;
const MOST_BILINEAR: usize = 12;
/// Channels up to which any two, and any three, are combined.
const MOST_RIDGES: usize = 6;
const MOST_TRIPLE_RIDGES: usize = 5;
/// Orders of a gear: the first, how far apart, how many.
const GEARS: (f64, f64, usize) = (0.3, 0.13, 60);
/// Time constants of decays that follow a channel, seconds, and how steeply their logarithms do, a half range.
const FOLLOWING_S: [f64; 3] = [6.0, 14.0, 32.0];
const SLOPES: [f64; 4] = [-1.2, -0.5, 0.5, 1.2];
/// Sectors of headings: how far apart, and their widths, degrees.
const SECTOR_STEP_DEG: f64 = 15.0;
const SECTORS_DEG: [f64; 3] = [60.0, 90.0, 130.0];
/// Orders of harmonics of the axis's azimuth: the first is the Earth's rate, or turns with it.
const AXIS_ORDERS: std::ops::RangeInclusive<u8> = 2..=6;

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
            all.extend([Self::Smoothed(channel), Self::Relays(channel)]);
            all.extend(
                FOLLOWING_S
                    .into_iter()
                    .flat_map(|time_s| SLOPES.map(|slope| Self::SettlingTime { channel, time_s, slope })),
            );
            all.extend(Tuned::all().into_iter().map(|tuned| Self::Tuned(channel, tuned)));
            if channels <= MOST_TUNED {
                all.extend((0..channel).flat_map(|other| tuned_of_two(other, channel)));
            }
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
        all.extend([Self::SettlingByCount, Self::SettlingEveryDwell, Self::SettlingByPosition, Self::SettlingByCurve]);
        all.extend(AXIS_ORDERS.map(Self::AxisHarmonic));
        all.extend([Self::AxisCurve, Self::BroadAxisCurve, Self::IndexCurve]);
        all.extend([Self::Winding, Self::Creep, Self::Alternating]);
        if tilt {
            all.extend([Self::TiltLinear, Self::TiltSquare, Self::TiltQuadratic, Self::TiltRate]);
        }
        if channels > 1 {
            all.push(Self::AllChannels);
            all.extend((channels <= MOST_BICUBIC).then_some(Self::AllMemory));
        }
        all.extend(products(channels, &of_channels, &global));
        all.extend(ridges(channels));
        all.extend((0..GEARS.2).map(|number| Self::Gear(GEARS.0 + GEARS.1 * number as f64)));
        let sectors = (0..(360.0 / SECTOR_STEP_DEG) as usize).map(|number| SECTOR_STEP_DEG * number as f64);
        all.extend(sectors.flat_map(|from_deg| SECTORS_DEG.map(|width_deg| Self::Sector([from_deg, width_deg]))));
        all.push(Self::Relaxation);
        all
    }

    /// The products of an accepted group with every base, and what its channels do together.
    pub fn extensions(&self, weights: &[f64], channels: usize, tilt: bool) -> Vec<Self> {
        let bases = (0..channels).flat_map(|channel| [Base::Value(channel), Base::Memory(channel)]);
        let global =
            [Base::Harmonic(1), Base::Harmonic(2), Base::Rate, Base::Settling, Base::Travel, Base::Time, Base::Turn];
        let bases = bases.chain(global).chain(tilt.then_some(Base::Tilt));
        let extended =
            bases.map(|base| Self::Extended { parent: Box::new(self.clone()), weights: weights.to_vec(), base });
        extended.chain(self.of_its_channels(channels)).collect()
    }

    /// What the channels of an accepted group do together, two by two, or its only one with every other.
    fn of_its_channels(&self, channels: usize) -> Vec<Self> {
        let own = self.channels();
        let others = if own.len() > 1 { own.clone() } else { (0..channels).collect() };
        let mut all = Vec::new();
        for (place, &first) in own.iter().enumerate() {
            for &second in others.iter().filter(|&second| !own[..=place].contains(second)) {
                let values = [first, second].map(Base::Value);
                all.extend(tuned_of_two(first, second));
                all.extend(ridges_of_two(channels, first, second));
                all.extend([Self::Bicubic(first, second), Self::Product(values[0], values[1])]);
            }
        }
        all
    }
}

/// What two channels do together, with constants that are tuned.
fn tuned_of_two(first: usize, second: usize) -> Vec<Group> {
    let mut all: Vec<Group> =
        OfTwo::creases().into_iter().map(|crease| Group::OfTwo([first, second], crease)).collect();
    for [channel, by] in [[first, second], [second, first]] {
        let gates = (-PLACES..=PLACES).step_by(2).map(|place| f64::from(place) * PLACE_STEP);
        all.extend(gates.map(|at| Group::Gated { channel, by, at }));
        all.extend(OfTwo::quotients().into_iter().map(|quotient| Group::OfTwo([channel, by], quotient)));
    }
    all
}

/// Curves in a combination of some channels, with their shares of it.
fn ridge(channels: usize, of: &[(usize, f64)]) -> Group {
    let mut direction = vec![0.0; channels];
    of.iter().for_each(|&(channel, share)| direction[channel] = share);
    Group::Ridge { direction: unit(direction), sharp: false }
}

/// Curves in combinations of two channels.
fn ridges_of_two(channels: usize, first: usize, second: usize) -> impl Iterator<Item = Group> {
    directions_rad().map(move |toward_rad| {
        let (sin, cos) = toward_rad.sin_cos();
        ridge(channels, &[(first, cos), (second, sin)])
    })
}

/// Curves in combinations of two and of three channels.
fn ridges(channels: usize) -> Vec<Group> {
    let mut all = Vec::new();
    for first in 0..channels {
        for second in first + 1..channels {
            all.extend(ridges_of_two(channels, first, second).filter(|_| channels <= MOST_RIDGES));
            for third in (second + 1..channels).filter(|_| channels <= MOST_TRIPLE_RIDGES) {
                for [b, c] in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                    all.push(ridge(channels, &[(first, 1.0), (second, b), (third, c)]));
                }
            }
        }
    }
    all
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
            let many = channels > MOST_BICUBIC && of_value(first) && of_value(second);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// With many channels what two of them do together is tried once one of them is known, with every other; once both are, of these two.
    #[test]
    fn channels_of_an_accepted_group_are_tried_two_by_two() {
        let gate = Group::Gated { channel: 1, by: 6, at: -0.3 };
        let has = |all: &[Group], [channel, by]: [usize; 2]| {
            all.iter().any(|group| matches!(group, Group::Gated { channel: c, by: b, .. } if [*c, *b] == [channel, by]))
        };
        let begins = Group::all(9, true);
        assert!(!has(&begins, [1, 6]));
        let of_one = Group::Linear(1).of_its_channels(9);
        assert!((0..9).filter(|&other| other != 1).all(|other| has(&of_one, [1, other]) && has(&of_one, [other, 1])));
        assert!(!has(&of_one, [2, 6]));
        let of_both = Group::Bilinear(1, 6).of_its_channels(9);
        assert!(has(&of_both, [1, 6]) && has(&of_both, [6, 1]) && !has(&of_both, [1, 2]));
        assert_eq!(gate.of_its_channels(9), of_both);
        assert!(of_both.iter().all(|group| group.channels() == [1, 6]));
        assert!(Group::Drift.of_its_channels(9).is_empty());
    }
}
