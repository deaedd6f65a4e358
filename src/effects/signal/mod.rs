//! Signals: what an effect can depend on. One file a signal, and one line here.

use core::fmt;

use quantities::limits::Invalid;
use serde::{Deserialize, Serialize};

use super::channel::ChannelName;
use super::now::Now;
use super::part::Constant;

/// What every signal says of itself.
pub trait SignalPart {
    /// Its value in this second; `None`: it says nothing now.
    fn value(&self, now: &Now<'_>) -> Option<f64>;
    /// Words of its name: lower case, with hyphens.
    fn name(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result;
    /// Its unit.
    fn unit(&self) -> &'static str;
    /// Parameters in their range.
    fn validate(&self) -> Result<(), Invalid> {
        Ok(())
    }
    /// It is an angle in degrees: 360 is 0.
    fn is_angle(&self) -> bool {
        false
    }
    /// It depends on the azimuth that is sought, so that it is evaluated by the dwell once there is one.
    fn needs_azimuth(&self) -> bool {
        false
    }
    /// It is a time, in seconds, that no dynamics makes more of.
    fn is_time(&self) -> bool {
        false
    }
    /// It may only stand behind a dynamics.
    fn needs_dynamics(&self) -> bool {
        false
    }
    /// The channels that it reads.
    fn channels(&self) -> [Option<&ChannelName>; 2] {
        [None, None]
    }
    /// The number that the search tunes, if there is one.
    fn constant(&self) -> Option<Constant> {
        None
    }
    /// Sets that number.
    fn set(&mut self, _: f64) {}
}

/// Makes the enum of the signals from their files: those that read channels, those that every second has, and readers that came later, because stored
/// settings number the signals.
macro_rules! signals {
    ($($of_channels:ident::$reader:ident),+; $($module:ident::$name:ident),+; $($later:ident::$last:ident),+ $(,)?) => {
        $(mod $of_channels;)+
        $(mod $module;)+
        $(mod $later;)+
        $(pub use $of_channels::$reader;)+
        $(pub use $module::$name;)+
        $(pub use $later::$last;)+

        /// A signal.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum Signal {
            $($reader($reader),)+
            $($name,)+
            $($last($last)),+
        }

        $(impl From<$reader> for Signal {
            fn from(signal: $reader) -> Self {
                Self::$reader(signal)
            }
        })+

        $(impl From<$last> for Signal {
            fn from(signal: $last) -> Self {
                Self::$last(signal)
            }
        })+

        $(impl From<$name> for Signal {
            fn from(_: $name) -> Self {
                Self::$name
            }
        })+

        impl Signal {
            fn part(&self) -> &dyn SignalPart {
                match self {
                    $(Self::$reader(part) => part,)+
                    $(Self::$name => &$name,)+
                    $(Self::$last(part) => part),+
                }
            }

            fn part_mut(&mut self) -> Option<&mut dyn SignalPart> {
                match self {
                    $(Self::$reader(part) => Some(part),)+
                    $(Self::$last(part) => Some(part),)+
                    _ => None,
                }
            }

            /// All signals that read no channel.
            pub fn without_channels() -> impl Iterator<Item = Self> {
                [$(Self::$name),+].into_iter()
            }
        }
    };
}

signals! {
    channel::Channel, difference::Difference;
    index::Index,
    winding::Winding,
    axis::Axis,
    tilt_along::TiltAlong,
    tilt_across::TiltAcross,
    time::Time,
    hour::Hour,
    rest::Rest,
    since::Since,
    travel::Travel,
    distance::Distance,
    turn::Turn,
    number::Number,
    turning::Turning,
    speed::Speed,
    moves::Moves,
    rate::Rate,
    measured::Measured,
    after::After;
    weighted_difference::WeightedDifference,
}

impl Signal {
    /// Its value in this second; `None`: it says nothing now.
    pub fn value(&self, now: &Now<'_>) -> Option<f64> {
        self.part().value(now).filter(|value| value.is_finite())
    }

    pub fn unit(&self) -> &'static str {
        self.part().unit()
    }

    pub fn is_angle(&self) -> bool {
        self.part().is_angle()
    }

    /// It depends on the azimuth that is sought.
    pub fn needs_azimuth(&self) -> bool {
        self.part().needs_azimuth()
    }

    /// It is a time that passes at its own pace, in seconds.
    pub fn is_time(&self) -> bool {
        self.part().is_time()
    }

    /// It may only stand behind a dynamics.
    pub fn needs_dynamics(&self) -> bool {
        self.part().needs_dynamics()
    }

    /// The channels that it reads.
    pub fn channels(&self) -> impl Iterator<Item = &ChannelName> {
        self.part().channels().into_iter().flatten()
    }

    /// The number that the search tunes, if there is one.
    pub fn constant(&self) -> Option<Constant> {
        self.part().constant()
    }

    /// Sets that number.
    pub fn set(&mut self, value: f64) {
        if let Some(part) = self.part_mut() {
            part.set(value);
        }
    }

    pub fn validate(&self) -> Result<(), Invalid> {
        self.part().validate()
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.part().name(f)
    }
}
