//! The accelerometer triad at register level: Analog Devices ADXL354/ADXL355 data sheet.
//!
//! Not modelled: FIFO, activity detection, interrupts, high-pass filter (their registers can be written and read); the test force acts
//! at once.

use crate::noise::{Source, Stream};
use crate::scenario::{Accelerometer, SensorFaultKind};
use crate::window;
use nalgebra::Vector3;

mod register {
    pub const STATUS: u8 = 0x04;
    pub const TEMP2: u8 = 0x06;
    pub const XDATA3: u8 = 0x08;
    pub const ZDATA1: u8 = 0x10;
    pub const FILTER: u8 = 0x28;
    pub const RANGE: u8 = 0x2C;
    pub const POWER_CTL: u8 = 0x2D;
    pub const SELF_TEST: u8 = 0x2E;
    pub const RESET: u8 = 0x2F;
}

/// Writing this to RESET restarts the device.
const RESET_CODE: u8 = 0x52;
/// Registers below this are read-only.
const FIRST_WRITABLE: u8 = 0x1E;
const REGISTERS: usize = 0x30;
/// Temperature: 1885 counts at 25 °C, −9.05 counts per kelvin.
const TEMP_COUNTS_AT_25C: f64 = 1885.0;
const TEMP_COUNTS_PER_K: f64 = -9.05;
/// Highest output data rate, Hz; FILTER halves it.
const FASTEST_HZ: f64 = 4000.0;
/// The sensor's own bias is declared at this temperature, °C.
const REFERENCE_C: f64 = 20.0;

/// What the triad feels.
#[derive(Debug, Clone, Copy)]
pub struct Felt {
    /// Time, s.
    pub t_s: f64,
    /// Specific force in instrument axes, g.
    pub force_g: Vector3<f64>,
    /// Vibration, g rms.
    pub vibration_g: f64,
    /// Temperature of the sensor, °C.
    pub temp_c: f64,
}

/// The device.
#[derive(Debug, Clone)]
pub struct Adxl355 {
    errors: Accelerometer,
    registers: [u8; REGISTERS],
    last_sample: Option<i64>,
    ready: bool,
    stream: Stream,
}

impl Adxl355 {
    /// The device after power-up: in standby.
    pub fn new(errors: &Accelerometer, seed: u64) -> Self {
        Self {
            errors: errors.clone(),
            registers: power_up(),
            last_sample: None,
            ready: false,
            stream: Stream::new(seed, Source::Accelerometer),
        }
    }

    /// One transaction (select low to select high): bytes in, as many bytes out.
    ///
    /// The first byte is the register address shifted left by one, bit 0 set to read; the address then counts up.
    pub fn exchange(&mut self, mosi: &[u8], felt: &Felt) -> Vec<u8> {
        let mut miso = vec![0; mosi.len()];
        if let Some((&command, data)) = mosi.split_first() {
            self.sample(felt);
            let mut address = command >> 1;
            for (out, &byte) in miso[1..].iter_mut().zip(data) {
                if command & 1 == 1 {
                    *out = self.read(address);
                } else {
                    self.write(address, byte);
                }
                address = address.wrapping_add(1) & 0x7F;
            }
        }
        match self.fault(felt.t_s) {
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

    fn get(&self, address: u8) -> u8 {
        self.registers.get(usize::from(address)).copied().unwrap_or(0)
    }

    fn read(&mut self, address: u8) -> u8 {
        let value = match address {
            register::STATUS => self.get(address) | u8::from(self.ready),
            _ => self.get(address),
        };
        if address == register::ZDATA1 {
            self.ready = false;
        }
        value
    }

    fn write(&mut self, address: u8, value: u8) {
        if address == register::RESET {
            if value == RESET_CODE {
                self.registers = power_up();
                self.last_sample = None;
                self.ready = false;
            }
        } else if address >= FIRST_WRITABLE
            && let Some(register) = self.registers.get_mut(usize::from(address))
        {
            *register = value;
        }
    }

    /// Output data rate, Hz.
    fn rate_hz(&self) -> f64 {
        FASTEST_HZ / f64::from(1_u32 << (self.get(register::FILTER) & 0x0F).min(10))
    }

    /// Counts per g in the selected range.
    fn counts_per_g(&self) -> f64 {
        match self.get(register::RANGE) & 0b11 {
            0b11 => 64_000.0,
            0b10 => 128_000.0,
            _ => 256_000.0,
        }
    }

    /// Takes a new sample if one fell due since the last look and the device is measuring.
    fn sample(&mut self, felt: &Felt) {
        let power = self.get(register::POWER_CTL);
        let due = (felt.t_s * self.rate_hz() + 1e-6).floor() as i64;
        if power & 0b001 != 0 || self.last_sample == Some(due) || self.fault(felt.t_s) == Some(SensorFaultKind::Stuck) {
            return;
        }
        self.last_sample = Some(due);
        self.ready = power & 0b100 == 0;
        for axis in 0..3 {
            let counts = (self.noisy_g(axis, felt) * self.counts_per_g()).round().clamp(-524_288.0, 524_287.0);
            // 20 bits, left-justified in three bytes.
            let [_, high, middle, low] = ((counts as i32) << 4).to_be_bytes();
            let at = usize::from(register::XDATA3) + 3 * axis;
            self.registers[at..at + 3].copy_from_slice(&[high, middle, low]);
        }
        if power & 0b010 == 0 {
            let counts = TEMP_COUNTS_AT_25C + TEMP_COUNTS_PER_K * (felt.temp_c - 25.0);
            let [high, low] = (counts.round().clamp(0.0, 4095.0) as u16).to_be_bytes();
            let at = usize::from(register::TEMP2);
            self.registers[at..at + 2].copy_from_slice(&[high, low]);
        }
    }

    fn noisy_g(&mut self, axis: usize, felt: &Felt) -> f64 {
        // The corner of the low-pass filter is a quarter of the data rate.
        let noise_g = 1e-6 * self.errors.noise_ug_per_sqrt_hz * (self.rate_hz() / 4.0).sqrt();
        // ST1 enables the self-test, ST2 applies its electrostatic force.
        let tested = self.get(register::SELF_TEST) & 0b11 == 0b11;
        let response_g = if tested { self.errors.self_test_g[axis] } else { 0.0 };
        self.errors.reading_g(axis, &felt.force_g, felt.temp_c)
            + response_g
            + noise_g.hypot(felt.vibration_g) * self.stream.normal()
    }
}

impl Accelerometer {
    /// What axis 0, 1 or 2 reads without noise, g.
    pub(crate) fn reading_g(&self, axis: usize, force_g: &Vector3<f64>, temp_c: f64) -> f64 {
        let [x_from_y, x_from_z, y_from_z] = self.cross_axis_ppm;
        let cross = match axis {
            0 => x_from_y * force_g.y + x_from_z * force_g.z,
            1 => y_from_z * force_g.z - x_from_y * force_g.x,
            _ => -x_from_z * force_g.x - y_from_z * force_g.y,
        };
        let [y_in_x, z_in_x, z_in_y] = self.skew_ppm;
        let skew = match axis {
            0 => y_in_x * force_g.y + z_in_x * force_g.z,
            1 => z_in_y * force_g.z,
            _ => 0.0,
        };
        let bias_mg = self.bias_mg[axis] + self.bias_mg_per_k[axis] * (temp_c - REFERENCE_C);
        force_g[axis] * (1.0 + 1e-6 * self.scale_ppm[axis]) + 1e-6 * (cross + skew) + 1e-3 * bias_mg
    }
}

/// Register contents after power-up.
fn power_up() -> [u8; REGISTERS] {
    let mut registers = [0; REGISTERS];
    for (address, value) in
        [(0x00, 0xAD), (0x01, 0x1D), (0x02, 0xED), (0x03, 0x01), (0x25, 0x01), (0x29, 0x60), (0x2C, 0x81), (0x2D, 0x01)]
    {
        registers[address] = value;
    }
    registers
}
