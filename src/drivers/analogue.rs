//! The analogue inputs: at every tick one conversion begins, in turns, and at the next its result is there.

/// What is converted, in the order of the turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Input {
    First,
    Second,
    Third,
    Fourth,
    /// The supply, behind its divider.
    Supply,
    /// The chip's own thermometer.
    Chip,
    /// The chip's own reference, by which the converter's is known.
    Reference,
}

impl Input {
    pub const ALL: [Self; 7] =
        [Self::First, Self::Second, Self::Third, Self::Fourth, Self::Supply, Self::Chip, Self::Reference];
}

/// Ticks between two conversions of an input: 50 a second.
const TURN_TICKS: u64 = 8;

/// A converter of 12 bits.
pub trait Converter {
    /// Begins a conversion, which takes less than a tick.
    fn start(&mut self, input: Input);
    /// The result of the one that was begun last; `None`: there is none.
    fn result(&mut self) -> Option<u16>;
}

/// A result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conversion {
    pub input: Input,
    pub code: u16,
}

/// Converts all inputs, in turns.
#[derive(Debug)]
pub struct Scan<C> {
    converter: C,
    under_way: Option<Input>,
}

impl<C: Converter> Scan<C> {
    pub fn new(converter: C) -> Self {
        Self { converter, under_way: None }
    }

    /// The tick of this number: takes what was begun at the one before, and begins the next.
    pub fn tick(&mut self, tick: u64) -> Option<Conversion> {
        let done = self.under_way.take().and_then(|input| {
            let code = self.converter.result()?;
            Some(Conversion { input, code })
        });
        self.under_way = Input::ALL.get((tick % TURN_TICKS) as usize).copied();
        self.under_way.into_iter().for_each(|input| self.converter.start(input));
        done
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    /// Gives the place of the input as its code; the third gives nothing.
    struct Places(u16);

    impl Converter for Places {
        fn start(&mut self, input: Input) {
            self.0 = input as u16;
        }

        fn result(&mut self) -> Option<u16> {
            (self.0 != 2).then_some(100 + self.0)
        }
    }

    #[test]
    fn every_input_has_its_tick_and_its_result_the_next() {
        let mut scan = Scan::new(Places(0));
        let codes: Vec<_> = (0..10).map(|tick| scan.tick(tick).map(|done| (done.input, done.code))).collect();
        let done = |input| Some((input, 100 + input as u16));
        let expected = [None, done(Input::First), done(Input::Second), None, done(Input::Fourth), done(Input::Supply)];
        assert_eq!(codes[..6], expected);
        assert_eq!(codes[6..], [done(Input::Chip), done(Input::Reference), None, done(Input::First)]);
    }
}
