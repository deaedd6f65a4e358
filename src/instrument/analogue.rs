//! Conversions of the analogue inputs to what they read, once a second.
//!
//! The converter's own reference is the 3.3 V of the board; how much that really is, the chip's reference of 1.21 V says. The maker converted it, and the
//! chip's thermometer at 30 °C and 110 °C, at 3.3 V, and keeps the codes in every chip (STM32F405/407 data sheet, DS8626, tables 70, 71 and 74).

use crate::drivers::analogue::{Conversion, Input};
use crate::effects::{ErrorModel, MAX_CHANNELS};
use crate::event::{AUXILIARY, Auxiliary};
use crate::settings::analogue::AnalogueSettings;

/// Volts of a code of 4095 where the reference is as the maker's.
const FULL_V: f64 = 3.3;
const FULL_CODE: f64 = 4095.0;

/// What the maker of the chip converted at 3.3 V.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calibration {
    pub reference: u16,
    pub at_30_c: u16,
    pub at_110_c: u16,
}

impl Calibration {
    /// By the data sheet: 1.21 V; 0.76 V at 25 °C and 2.5 mV/K.
    pub const TYPICAL: Self = Self { reference: 1502, at_30_c: 959, at_110_c: 1207 };

    /// As a chip keeps it; where that is no such thing, the typical one: the reference is good to 2.5 %, the thermometer's offset to some 45 K.
    pub fn of_chip(self) -> Self {
        let Self { reference, at_30_c, at_110_c } = self;
        let sound = (1400..1600).contains(&reference) && at_30_c > 700 && (at_30_c + 150..1600).contains(&at_110_c);
        if sound { self } else { Self::TYPICAL }
    }
}

/// Sum and number of an input's codes in this second.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    codes: u32,
    count: u16,
}

impl Sum {
    fn mean(self) -> Option<f64> {
        (self.count > 0).then(|| f64::from(self.codes) / f64::from(self.count))
    }
}

/// All inputs.
#[derive(Clone, Debug)]
pub struct Analogue {
    settings: AnalogueSettings,
    calibration: Calibration,
    sums: [Sum; Input::ALL.len()],
    /// Where the error model wants each of the channels.
    places: [Option<usize>; AUXILIARY],
}

impl Default for Analogue {
    fn default() -> Self {
        Self {
            settings: AnalogueSettings::default(),
            calibration: Calibration::TYPICAL,
            sums: [Sum::default(); Input::ALL.len()],
            places: [None; AUXILIARY],
        }
    }
}

impl Analogue {
    pub fn set_up(&mut self, settings: AnalogueSettings, model: Option<&ErrorModel>) {
        self.settings = settings;
        let channels = model.map(ErrorModel::channels).unwrap_or_default();
        self.places = settings.names().map(|name| channels.iter().position(|each| Some(*each) == name));
    }

    pub fn calibrate(&mut self, calibration: Calibration) {
        self.calibration = calibration;
    }

    pub fn push(&mut self, conversion: Conversion) {
        if let Some(sum) = self.sums.get_mut(conversion.input as usize) {
            sum.codes = sum.codes.saturating_add(conversion.code.into());
            sum.count = sum.count.saturating_add(1);
        }
    }

    /// Ends the second. An input that has no name, or was not converted, reads nothing. Single precision: what is reported and recorded is what the error
    /// model takes.
    pub fn finish(&mut self) -> Auxiliary {
        let [first, second, third, fourth, supply, chip, reference] = core::mem::take(&mut self.sums).map(Sum::mean);
        let Calibration { reference: at_maker, at_30_c, at_110_c } = self.calibration;
        // Codes at the maker's 3.3 V.
        let to_maker = f64::from(at_maker) / reference.filter(|mean| *mean > 0.0).unwrap_or_else(|| at_maker.into());
        let volts = |mean: f64| mean * to_maker * FULL_V / FULL_CODE;
        let degrees = |mean: f64| {
            let [low, high] = [at_30_c, at_110_c].map(f64::from);
            30.0 + 80.0 * (mean * to_maker - low) / (high - low)
        };
        let mut auxiliary = Auxiliary::default();
        let inputs = self.settings.inputs().into_iter().zip([first, second, third, fourth]);
        let named =
            inputs.map(|(input, mean)| input.zip(mean).map(|(input, mean)| (volts(mean) - input.zero_v) * input.per_v));
        let own = [supply.map(|mean| volts(mean) * self.settings.supply_ratio), chip.map(degrees)];
        for (place, value) in auxiliary.iter_mut().zip(named.chain(own)) {
            *place = value.map(|value| value as f32);
        }
        auxiliary
    }

    /// Puts what was read where the error model wants it.
    pub fn into_channels(&self, auxiliary: &Auxiliary, channels: &mut [f64; MAX_CHANNELS]) {
        for (place, value) in self.places.iter().zip(auxiliary) {
            if let (Some(place), Some(value)) = (place, value)
                && let Some(channel) = channels.get_mut(*place)
            {
                *channel = f64::from(*value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::ChannelName;
    use crate::settings::analogue::InputSettings;

    /// By hand: at 3.0 V in the place of 3.3 V all codes are 1.1 times as high. 2048 of 4095 codes are then 1.5004 V, by the divider 16.504 V;
    /// (1.5004 − 0.5) · 40 = 40.015. The thermometer at 70 °C, in the middle: (959 + 1207) / 2 · 1.1 = 1191.3.
    #[test]
    fn readings_by_hand() {
        let name = ChannelName::new("field_ut").unwrap();
        let third = Some(InputSettings { name, zero_v: 0.5, per_v: 40.0 });
        let mut analogue = Analogue::default();
        analogue.set_up(AnalogueSettings { third, ..AnalogueSettings::default() }, None);
        let codes = [(Input::First, 999), (Input::Third, 2048), (Input::Supply, 2048), (Input::Reference, 1652)];
        for (input, code) in codes.into_iter().chain([(Input::Chip, 1191), (Input::Chip, 1191)]) {
            analogue.push(Conversion { input, code });
        }
        let [first, second, read, fourth, supply, chip] = analogue.finish();
        assert_eq!((first, second, fourth), (None, None, None));
        let near = |read: Option<f32>, expected: f32, within: f32| (read.unwrap() - expected).abs() < within;
        assert!(near(read, 40.015, 0.02) && near(supply, 16.504, 0.01), "{read:?} {supply:?}");
        assert!(near(chip, 70.0, 0.1), "{chip:?}");
        assert_eq!(analogue.finish(), Auxiliary::default());
    }

    #[test]
    fn what_no_maker_wrote_is_not_believed() {
        let erased = Calibration { reference: 0xFFFF, at_30_c: 0xFFFF, at_110_c: 0xFFFF };
        assert_eq!(erased.of_chip(), Calibration::TYPICAL);
        let own = Calibration { reference: 1510, at_30_c: 940, at_110_c: 1190 };
        assert_eq!(own.of_chip(), own);
    }
}
