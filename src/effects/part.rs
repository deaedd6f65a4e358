//! What every part of a factor (signal, dynamics, shape) says of itself.

use heapless::Vec;

use crate::bounded::bounded;

/// Most constants of one part.
pub const MAX_CONSTANTS: usize = 2;

/// A number that a part is not linear in: the search tunes it, the firmware runs with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    pub name: &'static str,
    pub value: f64,
    /// It is a scale, above 0: its logarithm is tuned.
    pub is_scale: bool,
}

impl Constant {
    /// A place, in the signal's unit.
    pub fn place(name: &'static str, value: f32) -> Self {
        Self { name, value: value.into(), is_scale: false }
    }

    /// A scale: a time constant, a width.
    pub fn scale(name: &'static str, value: f32) -> Self {
        Self { name, value: value.into(), is_scale: true }
    }
}

/// The constants of a part.
pub type Constants = Vec<Constant, MAX_CONSTANTS>;

/// Constants from a list; what is beyond the room is dropped.
pub fn constants<const N: usize>(list: [Constant; N]) -> Constants {
    bounded(list)
}

/// What a signal does in the recordings that are learned from: where the search begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    pub mean: f64,
    /// Standard deviation, in the signal's unit.
    pub deviation: f64,
    pub low: f64,
    pub high: f64,
    /// It is an angle, in degrees: 360 is 0.
    pub is_angle: bool,
    /// It is a time, in seconds, that no dynamics makes more of.
    pub is_time: bool,
    /// Length of a usual row and of the longest recording, or of the longest such time, seconds.
    pub row_s: f64,
    pub longest_s: f64,
}

impl Span {
    /// Time constants between a few rows and the length of a recording. Two first-order responses whose time constants differ by a factor
    /// q are correlated by 2√q/(1 + q): 0.94 at 2, so that no start is further than 0.97 from a time constant between two of these.
    pub fn time_constants_s(&self) -> impl Iterator<Item = f64> + use<> {
        let (first, last) = (3.0 * self.row_s, self.longest_s);
        core::iter::successors(Some(first), |tau_s| Some(2.0 * tau_s)).take_while(move |tau_s| *tau_s <= last)
    }

    /// Places at the quarters of the range.
    pub fn places(&self) -> impl Iterator<Item = f64> + use<> {
        let (low, range) = (self.low, self.high - self.low);
        [0.2, 0.35, 0.5, 0.65, 0.8].into_iter().map(move |share| low + share * range)
    }
}

/// Makes the enum of one kind of part from its files: a new part is one file and one line.
macro_rules! parts {
    ($(#[$about:meta])* $kind:ident is $part:ident of $($module:ident::$name:ident),+ $(,)?) => {
        $(mod $module;)+
        $(pub use $module::$name;)+

        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum $kind {
            $($name($name)),+
        }

        impl $kind {
            /// How many kinds there are.
            pub const KINDS: usize = [$(stringify!($name)),+].len();

            fn part(&self) -> &dyn $part {
                match self { $(Self::$name(part) => part),+ }
            }

            fn part_mut(&mut self) -> &mut dyn $part {
                match self { $(Self::$name(part) => part),+ }
            }

            /// All kinds, with the constants that the search begins with.
            pub fn starts(span: &Span, each: &mut dyn FnMut(Self)) {
                $($name::starts(span, each);)+
            }
        }

        $(impl From<$name> for $kind {
            fn from(part: $name) -> Self {
                Self::$name(part)
            }
        })+
    };
}
pub(crate) use parts;
