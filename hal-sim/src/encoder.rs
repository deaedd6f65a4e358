//! The absolute encoder at register level: ams AS5048A data sheet, 14 bits, SPI frames of 16 bits.

use crate::noise::{Source, Stream};
use crate::scenario::{Encoder, SensorFaultKind};
use crate::window;

mod register {
    pub const NOP: u16 = 0x0000;
    pub const CLEAR_ERROR: u16 = 0x0001;
    pub const PROGRAMMING: u16 = 0x0003;
    pub const ZERO_HIGH: u16 = 0x0016;
    pub const ZERO_LOW: u16 = 0x0017;
    pub const DIAGNOSTICS: u16 = 0x3FFD;
    pub const MAGNITUDE: u16 = 0x3FFE;
    pub const ANGLE: u16 = 0x3FFF;
}

const PARITY_BIT: u16 = 0x8000;
/// Command: this is a read. Response: an error happened.
const READ_OR_ERROR_BIT: u16 = 0x4000;
const DATA_MASK: u16 = 0x3FFF;
const COUNTS: f64 = 16_384.0;

const FRAMING_ERROR: u16 = 0b001;
const COMMAND_INVALID: u16 = 0b010;
const PARITY_ERROR: u16 = 0b100;

/// Diagnostics: offset compensation finished; field too weak.
const COMPENSATED: u16 = 1 << 8;
const FIELD_WEAK: u16 = 1 << 11;
/// Automatic gain and magnitude of a good and of a weak magnet.
const GAIN_GOOD: u16 = 0x7F;
const GAIN_MOST: u16 = 0xFF;
const MAGNITUDE_GOOD: u16 = 0x1000;
const MAGNITUDE_WEAK: u16 = 0x0180;

/// The device.
#[derive(Debug, Clone)]
pub struct As5048a {
    errors: Encoder,
    response: u16,
    error_bits: u16,
    zero: u16,
    write_to: Option<u16>,
    last_angle: u16,
    stream: Stream,
}

impl As5048a {
    /// The device after power-up.
    pub fn new(errors: &Encoder, seed: u64) -> Self {
        Self {
            errors: errors.clone(),
            response: 0,
            error_bits: 0,
            zero: 0,
            write_to: None,
            last_angle: 0,
            stream: Stream::new(seed, Source::Encoder),
        }
    }

    /// One transaction (select low to select high): a frame of two bytes; the answer to a command comes in the next one.
    pub fn exchange(&mut self, mosi: &[u8], index_deg: f64, t_s: f64) -> Vec<u8> {
        let mut miso = vec![0; mosi.len()];
        for (out, byte) in miso.iter_mut().zip(with_parity(self.response).to_be_bytes()) {
            *out = byte;
        }
        match *mosi {
            [high, low] => self.receive(u16::from_be_bytes([high, low]), index_deg, t_s),
            _ => self.fail(FRAMING_ERROR),
        }
        match self.fault(t_s) {
            Some(SensorFaultKind::BusHigh) => miso.fill(0xFF),
            Some(SensorFaultKind::BusLow) => miso.fill(0x00),
            Some(SensorFaultKind::Stuck) | None => {}
        }
        miso
    }

    fn fault(&self, t_s: f64) -> Option<SensorFaultKind> {
        let in_force = |fault: &&crate::scenario::SensorFault| window::contains(fault.from_s, fault.to_s, t_s);
        self.errors.faults.iter().find(in_force).map(|fault| fault.kind)
    }

    fn fail(&mut self, error: u16) {
        self.error_bits |= error;
        self.write_to = None;
        self.respond(0);
    }

    fn respond(&mut self, data: u16) {
        let error = if self.error_bits != 0 { READ_OR_ERROR_BIT } else { 0 };
        self.response = error | data & DATA_MASK;
    }

    fn receive(&mut self, frame: u16, index_deg: f64, t_s: f64) {
        if !frame.count_ones().is_multiple_of(2) {
            return self.fail(PARITY_ERROR);
        }
        if let Some(address) = self.write_to.take() {
            self.write(address, frame);
            return self.respond(frame & DATA_MASK);
        }
        let address = frame & DATA_MASK;
        if frame & READ_OR_ERROR_BIT == 0 && address != register::NOP {
            return match address {
                register::PROGRAMMING | register::ZERO_HIGH | register::ZERO_LOW => {
                    self.write_to = Some(address);
                    self.respond(0);
                }
                _ => self.fail(COMMAND_INVALID),
            };
        }
        match address {
            register::NOP | register::PROGRAMMING => self.respond(0),
            register::CLEAR_ERROR => {
                let bits = std::mem::take(&mut self.error_bits);
                self.respond(bits);
            }
            register::ZERO_HIGH => self.respond(self.zero >> 6),
            register::ZERO_LOW => self.respond(self.zero & 0x3F),
            register::DIAGNOSTICS => self.respond(self.diagnostics()),
            register::MAGNITUDE => self.respond(if self.errors.weak_magnet { MAGNITUDE_WEAK } else { MAGNITUDE_GOOD }),
            register::ANGLE => {
                let angle = self.angle(index_deg, t_s);
                self.respond(angle);
            }
            _ => self.fail(COMMAND_INVALID),
        }
    }

    fn write(&mut self, address: u16, data: u16) {
        match address {
            register::ZERO_HIGH => self.zero = (data & 0xFF) << 6 | self.zero & 0x3F,
            register::ZERO_LOW => self.zero = self.zero & !0x3F | data & 0x3F,
            _ => {}
        }
    }

    fn diagnostics(&self) -> u16 {
        if self.errors.weak_magnet { COMPENSATED | FIELD_WEAK | GAIN_MOST } else { COMPENSATED | GAIN_GOOD }
    }

    fn angle(&mut self, index_deg: f64, t_s: f64) -> u16 {
        if self.fault(t_s) != Some(SensorFaultKind::Stuck) {
            let errors = &self.errors;
            let slip_deg = if t_s >= errors.slip_at_s { errors.slip_deg } else { 0.0 };
            let seen_deg = errors.reading_deg(index_deg) + slip_deg + errors.noise_deg * self.stream.normal();
            self.last_angle = (seen_deg / 360.0 * COUNTS).round().rem_euclid(COUNTS) as u16;
        }
        self.last_angle.wrapping_sub(self.zero) & DATA_MASK
    }
}

impl Encoder {
    /// What an encoder without noise and steps reads, degrees.
    pub(crate) fn reading_deg(&self, index_deg: f64) -> f64 {
        let once_per_turn = (index_deg - self.eccentricity_at_deg).to_radians().cos();
        index_deg + self.zero_deg + self.eccentricity_deg * once_per_turn
    }
}

/// Sets the top bit so that the number of ones is even.
fn with_parity(word: u16) -> u16 {
    if word.count_ones().is_multiple_of(2) { word } else { word ^ PARITY_BIT }
}
