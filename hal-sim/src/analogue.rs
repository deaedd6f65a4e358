//! What is at the analogue inputs of the microcontroller, and what its converter makes of it.
//!
//! | input | carries | source |
//! |---|---|---|
//! | 0 to 3 | a thermometer of 0.5 V + 10 mV/°C, or nothing | Analog Devices, TMP35/TMP36/TMP37, revision H |
//! | 4 | the supply, by 10 of 110 kΩ | the netlist of the instrument |
//! | 5 | the chip's thermometer: 0.76 V at 25 °C, 2.5 mV/K | ST, DS8626, table 69 |
//! | 6 | the chip's reference: 1.21 V | ST, DS8626, table 73 |
//!
//! Voltages are whole millivolts, and the converter has 12 bits of 3.3 V: what an emulated chip takes and makes of it.

use crate::scenario::{Analogue, AnalogueSource};

/// Converter: its greatest code, and the voltage that gives it, mV.
const FULL: u32 = 4095;
const FULL_MV: u32 = 3300;
const REFERENCE_MV: u32 = 1210;
/// The chip is warmer than the housing, K.
const CHIP_ABOVE_HOUSING_K: f64 = 10.0;

/// The state of what the inputs carry.
#[derive(Debug, Clone, Copy)]
pub struct Carried {
    pub supply_v: f64,
    pub gyro_c: f64,
    pub housing_c: f64,
}

impl Carried {
    /// Voltage at a pin, 0 to 4, mV.
    pub fn millivolts(&self, wired: &Analogue, pin: usize) -> u32 {
        let thermometer = |temp_c: f64| (500.0 + 10.0 * temp_c).round().max(0.0) as u32;
        let source = [wired.first, wired.second, wired.third, wired.fourth].get(pin).copied();
        match source {
            Some(AnalogueSource::Open) => 0,
            Some(AnalogueSource::Housing) => thermometer(self.housing_c),
            Some(AnalogueSource::Gyro) => thermometer(self.gyro_c),
            None => (1000.0 * self.supply_v * 10.0 / 110.0).round() as u32,
        }
    }

    /// Temperature of the chip, hundredths of a degree Celsius.
    pub fn chip_centi_c(&self) -> i32 {
        (100.0 * (self.housing_c + CHIP_ABOVE_HOUSING_K)).round() as i32
    }

    /// What the converter makes of an input.
    pub fn code(&self, wired: &Analogue, input: usize) -> u16 {
        let millivolts = match input {
            5 => (760 + (self.chip_centi_c() - 2500) / 40).max(0).unsigned_abs(),
            6 => REFERENCE_MV,
            pin => self.millivolts(wired, pin),
        };
        (millivolts * FULL / FULL_MV).min(FULL) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 25 °C at the housing are 0.75 V, 930 of 4095; 12 V are 1.091 V, 1353; the chip at 35 °C is 0.785 V, 974; the reference 1501.
    #[test]
    fn codes_by_hand() {
        let wired = Analogue { second: AnalogueSource::Housing, ..Analogue::default() };
        let carried = Carried { supply_v: 12.0, gyro_c: 30.0, housing_c: 25.0 };
        let codes: Vec<u16> = (0..7).map(|input| carried.code(&wired, input)).collect();
        assert_eq!(codes, [0, 930, 0, 0, 1353, 974, 1501]);
    }
}
