//! The block at register level: Analog Devices ADIS16505 data sheet, the model for ±500 °/s.
//!
//! Modelled: identity and range model, registers in frames of 16 bits that answer one frame later, bursts of 16 and 32 bits
//! with their sum, increments or rates in them, the number of the sample, decimation, the internal clock and the scaled pulse
//! of 100 Hz, time of starting. Not modelled: filters, user offsets, flash, self-test, watermarks; a rate of output faster than a tick gives
//! the tick's mean.

use crate::block::Block;
use crate::scenario::{self, SensorFaultKind};
use crate::window;
use nalgebra::{UnitQuaternion, Vector3};

mod register {
    pub const FIRST_WRITABLE: usize = 0x40;
    pub const RANG_MDL: usize = 0x5E;
    pub const MSC_CTRL: usize = 0x60;
    pub const UP_SCALE: usize = 0x62;
    pub const DEC_RATE: usize = 0x64;
    pub const BURST: u8 = 0x68;
    pub const PROD_ID: usize = 0x72;
    pub const COUNT: usize = 0x80;
}

/// The board's pulse, Hz, and the part's own clock.
const PULSE_HZ: f64 = 100.0;
const INTERNAL_HZ: f64 = 2000.0;
/// Temperature: 0.1 K a count.
const COUNTS_PER_K: f64 = 10.0;

/// The device.
#[derive(Debug, Clone)]
pub struct Adis16505 {
    block: Block,
    scenario: scenario::Block,
    registers: [u8; register::COUNT],
    /// Answers the next frame.
    answer: [u8; 2],
    /// When the last output interval ended, s.
    ended_s: f64,
    number: u16,
    /// Of the last output: angle in rad, velocity in m/s, and the length of the interval.
    output: [[f64; 3]; 2],
    interval_s: f64,
}

impl Adis16505 {
    /// The device at power-up.
    pub fn new(scenario: &scenario::Block, seed: u64) -> Self {
        let mut registers = [0; register::COUNT];
        for (address, value) in [
            (register::RANG_MDL, 0x0007_u16),
            (register::MSC_CTRL, 0x00C1),
            (register::UP_SCALE, 0x07D0),
            (register::PROD_ID, 16505),
        ] {
            registers[address..address + 2].copy_from_slice(&value.to_le_bytes());
        }
        Self {
            block: Block::new(scenario, seed),
            scenario: scenario.clone(),
            registers,
            answer: [0; 2],
            ended_s: 0.0,
            number: 0,
            output: [[0.0; 3]; 2],
            interval_s: 1.0 / INTERNAL_HZ,
        }
    }

    /// Up to `t_s` the case moved as [`Block::feel`] says.
    pub fn feel(
        &mut self,
        t_s: f64,
        attitudes: [&UnitQuaternion<f64>; 2],
        acceleration_m_s2: &Vector3<f64>,
        earth_rad_s: &Vector3<f64>,
        dt_s: f64,
    ) {
        self.block.feel(attitudes, acceleration_m_s2, earth_rad_s, dt_s);
        self.interval_s = f64::from(self.register(register::DEC_RATE) + 1) / self.internal_hz();
        let intervals_to = |t_s: f64| (t_s / self.interval_s + 1e-6).floor() as i64;
        let ended = intervals_to(t_s) - intervals_to(self.ended_s);
        if ended > 0 {
            self.ended_s = t_s;
            let share = (self.interval_s / dt_s).min(1.0);
            let increments = self.block.increments().map(|triad| triad.map(|increment| increment * share));
            // What a part that is stuck feels is lost.
            if self.fault(t_s) != Some(SensorFaultKind::Stuck) {
                self.output = increments;
                self.number = self.number.wrapping_add(ended as u16);
            }
        }
    }

    /// Internal samples a second.
    fn internal_hz(&self) -> f64 {
        match self.register(register::MSC_CTRL) >> 2 & 0b11 {
            0b10 => PULSE_HZ * f64::from(self.register(register::UP_SCALE)),
            _ => INTERNAL_HZ,
        }
    }

    fn register(&self, address: usize) -> u16 {
        u16::from_le_bytes([self.registers[address], self.registers[address + 1]])
    }

    fn fault(&self, t_s: f64) -> Option<SensorFaultKind> {
        let in_force = |fault: &&scenario::SensorFault| window::contains(fault.from_s, fault.to_s, t_s);
        self.scenario.faults.iter().find(in_force).map(|fault| fault.kind)
    }

    /// One transaction (select low to select high): bytes in, as many bytes out.
    pub fn exchange(&mut self, mosi: &[u8], t_s: f64, temp_c: f64) -> Vec<u8> {
        let starting = (t_s < self.scenario.startup_s).then_some(SensorFaultKind::BusHigh);
        match self.fault(t_s).or(starting) {
            Some(SensorFaultKind::BusHigh) => return vec![0xFF; mosi.len()],
            Some(SensorFaultKind::BusLow) => return vec![0x00; mosi.len()],
            Some(SensorFaultKind::Stuck) | None => {}
        }
        let mut miso = Vec::with_capacity(mosi.len());
        if mosi.len() > 2 && mosi[0] == register::BURST {
            miso.extend(self.answer);
            miso.extend(self.burst(temp_c));
        } else {
            for frame in mosi.chunks_exact(2) {
                miso.extend(self.answer);
                self.frame(frame[0], frame[1]);
            }
        }
        miso.resize(mosi.len(), 0);
        miso
    }

    fn frame(&mut self, command: u8, data: u8) {
        let address = usize::from(command & 0x7F);
        if command & 0x80 != 0 {
            if (register::FIRST_WRITABLE..register::PROD_ID).contains(&address) && address & !1 != register::RANG_MDL {
                self.registers[address] = data;
            }
            self.answer = [0; 2];
        } else {
            self.answer = self.register(address & !1).to_be_bytes();
        }
    }

    /// What a burst answers after its command.
    fn burst(&self, temp_c: f64) -> Vec<u8> {
        let control = self.register(register::MSC_CTRL);
        let (wide, increments) = (control & 0x200 != 0, control & 0x100 != 0);
        let [angle, velocity] = self.output;
        let full_scales = if increments { [720_f64.to_radians(), 100.0] } else { [819.2_f64.to_radians(), 80.282] };
        let divisor = if increments { 1.0 } else { self.interval_s };
        let mut bytes = vec![0, 0];
        for (triad, full_scale) in [angle, velocity].into_iter().zip(full_scales) {
            for value in triad {
                let counts = (value / divisor / full_scale * 2_f64.powi(31)).round();
                let [a, b, c, d] = (counts.clamp(-2_f64.powi(31), 2_f64.powi(31) - 1.0) as i32).to_be_bytes();
                bytes.extend(if wide { vec![c, d, a, b] } else { vec![a, b] });
            }
        }
        bytes.extend(((temp_c * COUNTS_PER_K).round() as i16).to_be_bytes());
        bytes.extend(self.number.to_be_bytes());
        let sum: u32 = bytes.iter().map(|&byte| u32::from(byte)).sum();
        bytes.extend((sum as u16).to_be_bytes());
        bytes
    }
}
