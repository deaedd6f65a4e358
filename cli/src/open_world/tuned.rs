//! Functions of one channel with constants that the search tunes.

use nalgebra::DMatrix;

use super::columns::from_columns;
use super::dynamics::{delay, first_rate, friction, low_pass, peak, play, relay};
use super::recording::Samples;

/// A function of a channel with constants that are tuned: the channel counted in half ranges, times in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tuned {
    /// 1 above, 0 below.
    Threshold(f64),
    /// A straight line with a bend.
    Bend(f64),
    /// The square of what is above.
    Rectified(f64),
    /// On above the second, off below the first; in between as it was, at the beginning both ways.
    Relay([f64; 2]),
    /// A play operator of this half width beside the channel.
    Play(f64),
    /// The channel and its square behind a low-pass.
    Heat(f64),
    /// Some seconds ago, behind two low-passes of a time constant.
    Delay([f64; 2]),
    /// The greatest and the least so far, that leak in this time.
    Peak(f64),
    /// Friction: what follows the channel's changes and slips by this share of them, and leaks in this time.
    Slip([f64; 2]),
    /// The rate of change behind a low-pass of this time constant; with what the rate at the beginning leaves of itself.
    Rate(f64),
}

/// Places in the range of a channel that are begun with, and how far apart.
pub const PLACES: i32 = 12;
pub const PLACE_STEP: f64 = 0.075;
/// What else is begun with.
const RELAY_WIDTHS: [f64; 4] = [0.1, 0.2, 0.4, 0.7];
const PLAYS: [f64; 6] = [0.06, 0.12, 0.2, 0.3, 0.45, 0.7];
const HEATS_S: [f64; 5] = [25.0, 50.0, 100.0, 200.0, 400.0];
const DELAYS_S: [f64; 7] = [10.0, 20.0, 32.0, 45.0, 58.0, 72.0, 88.0];
const SMEARS_S: [f64; 2] = [5.0, 16.0];
const PEAKS_S: [f64; 3] = [250.0, 600.0, 1500.0];
const SLIPS: [f64; 4] = [1.5, 3.0, 5.0, 9.0];
const LEAKS_S: [f64; 2] = [100.0, 350.0];
const RATES_S: [f64; 5] = [12.0, 25.0, 50.0, 100.0, 200.0];

impl Tuned {
    /// All that are begun with.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for place in -PLACES..=PLACES {
            let at = f64::from(place) * PLACE_STEP;
            all.push(Self::Threshold(at));
            if place % 2 == 0 && place.abs() < PLACES {
                all.extend([Self::Bend(at), Self::Rectified(at)]);
            }
            if place % 3 == 0 {
                all.extend(RELAY_WIDTHS.map(|width| Self::Relay([at - 0.5 * width, at + 0.5 * width])));
            }
        }
        all.extend(PLAYS.map(Self::Play));
        all.extend(HEATS_S.map(Self::Heat));
        all.extend(DELAYS_S.into_iter().flat_map(|delay_s| SMEARS_S.map(|smear_s| Self::Delay([delay_s, smear_s]))));
        all.extend(PEAKS_S.map(Self::Peak));
        all.extend(SLIPS.into_iter().flat_map(|slip| LEAKS_S.map(|leak_s| Self::Slip([slip, leak_s]))));
        all.extend(RATES_S.map(Self::Rate));
        all
    }

    /// How many constants are tuned.
    pub fn constants(self) -> usize {
        match self {
            Self::Relay(_) | Self::Delay(_) | Self::Slip(_) => 2,
            _ => 1,
        }
    }

    /// With one constant a little more or less: places by this share of a half range, all others by five times the share of
    /// themselves.
    pub fn neighbours(self, share: f64) -> Vec<Self> {
        let moved = |at: f64| [at - share, at + share];
        let scaled = |value: f64| [value / (1.0 + 5.0 * share), value * (1.0 + 5.0 * share)];
        let one_of_two = |pair: [f64; 2], change: &dyn Fn(f64) -> [f64; 2]| {
            let [first, second] = [change(pair[0]), change(pair[1])];
            [[first[0], pair[1]], [first[1], pair[1]], [pair[0], second[0]], [pair[0], second[1]]]
        };
        match self {
            Self::Threshold(at) => moved(at).map(Self::Threshold).to_vec(),
            Self::Bend(at) => moved(at).map(Self::Bend).to_vec(),
            Self::Rectified(at) => moved(at).map(Self::Rectified).to_vec(),
            Self::Relay(between) => {
                let near = one_of_two(between, &moved).into_iter().filter(|[low, high]| low < high);
                near.map(Self::Relay).collect()
            }
            Self::Play(width) => scaled(width).map(Self::Play).to_vec(),
            Self::Heat(time_s) => scaled(time_s).map(Self::Heat).to_vec(),
            Self::Delay(pair) => one_of_two(pair, &scaled).map(Self::Delay).to_vec(),
            Self::Peak(leak_s) => scaled(leak_s).map(Self::Peak).to_vec(),
            Self::Slip(pair) => one_of_two(pair, &scaled).map(Self::Slip).to_vec(),
            Self::Rate(time_s) => scaled(time_s).map(Self::Rate).to_vec(),
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Threshold(_) => "threshold",
            Self::Bend(_) => "bend",
            Self::Rectified(_) => "rectified",
            Self::Relay(_) => "relay",
            Self::Play(_) => "hysteresis",
            Self::Heat(_) => "memory-of-function",
            Self::Delay(_) => "delay",
            Self::Peak(_) => "greatest-so-far",
            Self::Slip(_) => "friction",
            Self::Rate(_) => "memory-of-rate",
        }
    }

    pub fn words(self, channel: &str) -> String {
        match self {
            Self::Threshold(_) => format!("threshold in {channel}"),
            Self::Bend(_) => format!("bend in {channel}"),
            Self::Rectified(_) => format!("square of {channel} above a place"),
            Self::Relay(_) => format!("relay in {channel}"),
            Self::Play(_) => format!("hysteresis in {channel}"),
            Self::Heat(_) => format!("memory of the square of {channel}"),
            Self::Delay(_) => format!("{channel} some time ago"),
            Self::Peak(_) => format!("greatest and least {channel} so far"),
            Self::Slip(_) => format!("friction behind {channel}"),
            Self::Rate(_) => format!("memory of the rate of change of {channel}"),
        }
    }

    /// Its columns over samples, from the channel's values in half ranges by the second.
    pub fn columns(self, samples: &Samples, values: &[f64], interval: &[f64]) -> DMatrix<f64> {
        let above = |at: f64| values.iter().map(move |value| (value - at).max(0.0));
        let series: Vec<Vec<f64>> = match self {
            Self::Threshold(at) => vec![values.iter().map(|&value| f64::from(u8::from(value > at))).collect()],
            Self::Bend(at) => vec![values.to_vec(), above(at).collect()],
            Self::Rectified(at) => vec![above(at).map(|value| value * value).collect()],
            Self::Relay(between) => [0.0, 1.0].map(|begins| relay(values, between, begins)).to_vec(),
            Self::Play(width) => vec![values.to_vec(), play(values, width)],
            Self::Heat(time_s) => {
                let squares: Vec<f64> = values.iter().map(|value| value * value).collect();
                [values, &squares].map(|formed| low_pass(formed, interval, time_s)).to_vec()
            }
            Self::Delay([delay_s, smear_s]) => {
                let delayed = delay(values, interval, delay_s);
                vec![low_pass(&low_pass(&delayed, interval, smear_s), interval, smear_s)]
            }
            Self::Peak(leak_s) => {
                let mirrored: Vec<f64> = values.iter().map(|value| -value).collect();
                [values, &mirrored].map(|values| peak(values, interval, leak_s)).to_vec()
            }
            Self::Slip([slip, leak_s]) => vec![friction(values, interval, slip, leak_s)],
            Self::Rate(time_s) => {
                let smooth = low_pass(values, interval, time_s);
                let first = time_s * first_rate(values, interval);
                let left = interval.iter().scan(first, |left, interval| {
                    *left *= (-interval / time_s).exp();
                    Some(*left)
                });
                vec![values.iter().zip(&smooth).map(|(value, smooth)| value - smooth).collect(), left.collect()]
            }
        };
        from_columns(samples.len(), series.into_iter().map(|values| samples.means(values)))
    }
}
