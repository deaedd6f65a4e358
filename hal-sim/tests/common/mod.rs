//! A little user of the simulated instrument, written for the tests: reads frames, turns the drive, reads the sensors.

use embedded_hal::digital::OutputPin;
use embedded_io::Read;
use hal_sim::frames::crc32;
use hal_sim::{Scenario, World};

/// Ticks in a second.
pub const TICKS_PER_S: u32 = 400;

/// A calm scenario without any error of the sensors.
pub fn quiet() -> Scenario {
    let mut scenario = Scenario::default();
    scenario.base.pitch_deg = 0.0;
    scenario.base.roll_deg = 0.0;
    let gyro = &mut scenario.gyro;
    gyro.arw_deg_per_sqrt_h = 0.0;
    gyro.bias_deg_h = 0.0;
    gyro.bias_instability_deg_h = 0.0;
    gyro.rrw_deg_h_per_sqrt_h = 0.0;
    gyro.scale_ppm = 0.0;
    gyro.quantum_arcsec = 1e-6;
    scenario.accelerometer.noise_ug_per_sqrt_hz = 0.0;
    scenario.accelerometer.bias_mg = [0.0; 3];
    scenario.encoder.noise_deg = 0.0;
    scenario.encoder.eccentricity_deg = 0.0;
    scenario.motor.base_reaction_arcsec_per_deg = [0.0; 3];
    scenario
}

/// Lets one tick pass and gives the bytes that arrived.
pub fn tick(world: &World) -> Vec<u8> {
    for _ in 0..8 {
        world.advance_slot();
    }
    world.sample();
    arrived(world)
}

/// Bytes that have arrived by now.
pub fn arrived(world: &World) -> Vec<u8> {
    let mut bytes = vec![0; 4096];
    let count = world.gyro().read(&mut bytes).expect("reading never fails");
    bytes.truncate(count);
    bytes
}

/// Content of a good compact frame: sequence, status, increment in arcsec, temperature in °C.
pub fn compact(frame: &[u8]) -> (u8, u8, f64, f64) {
    assert_eq!(frame.len(), 14, "{frame:02X?}");
    assert_eq!(frame[..2], [0xA5, 0x5A]);
    assert_eq!(crc32(&frame[..10]).to_le_bytes(), frame[10..]);
    let increment = i32::from_le_bytes([frame[4], frame[5], frame[6], frame[7]]);
    let temperature = i16::from_le_bytes([frame[8], frame[9]]);
    (frame[2], frame[3], f64::from(increment) * 1e-6, f64::from(temperature) * 0.01)
}

/// Increments of the frames that arrive in the next `ticks` ticks, arcsec.
pub fn increments(world: &World, ticks: u32) -> Vec<f64> {
    (0..ticks).flat_map(|_| tick(world).chunks(14).map(|frame| compact(frame).2).collect::<Vec<_>>()).collect()
}

/// Mean rate over the next seconds, °/h. A frame arrives in the tick after its own.
pub fn rate_deg_h(world: &World, seconds: f64) -> f64 {
    let ticks = (seconds * f64::from(TICKS_PER_S)).round() as u32;
    tick(world);
    let increments = increments(world, ticks);
    assert_eq!(increments.len(), ticks as usize);
    increments.iter().sum::<f64>() / seconds
}

/// Turns the drive by `microsteps`, counter-clockwise if positive, one step in `slots_per_step` slots without any ramp, and
/// lets it settle. The bytes that the gyro sends meanwhile are thrown away.
pub fn drive(world: &World, microsteps: i32, slots_per_step: u32, settle_s: f64) {
    world.enable_pin().set_high().expect("pins do not fail");
    world.dir_pin().set_state((microsteps > 0).into()).expect("pins do not fail");
    let mut step = world.step_pin();
    let mut slots = 0;
    for _ in 0..microsteps.unsigned_abs() {
        step.set_high().expect("pins do not fail");
        step.set_low().expect("pins do not fail");
        for _ in 0..slots_per_step {
            world.advance_slot();
            slots += 1;
            if slots % 8 == 0 {
                world.sample();
                arrived(world);
            }
        }
    }
    while slots % 8 != 0 {
        world.advance_slot();
        slots += 1;
    }
    world.sample();
    for _ in 0..(settle_s * f64::from(TICKS_PER_S)) as u32 {
        tick(world);
    }
}

/// Turns the drive at a gentle 4 °/s.
pub fn drive_to(world: &World, microsteps: i32, settle_s: f64) {
    drive(world, microsteps, 8, settle_s);
}

/// Switches the accelerometer to measuring and reads x, y, z in g.
pub fn read_g(world: &World) -> [f64; 3] {
    let mut spi = world.accelerometer();
    spi.exchange(&[0x28 << 1, 0x05]);
    spi.exchange(&[0x2D << 1, 0x00]);
    let bytes = spi.exchange(&[0x08 << 1 | 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    [1, 4, 7].map(|at| f64::from(i32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], 0]) >> 12) / 256_000.0)
}

/// Reads the encoder's angle in degrees (two frames: command, then answer).
pub fn read_encoder_deg(world: &World) -> f64 {
    let mut spi = world.encoder();
    spi.exchange(&[0xFF, 0xFF]);
    let answer = spi.exchange(&[0xC0, 0x00]);
    f64::from(u16::from_be_bytes([answer[0], answer[1]]) & 0x3FFF) * 360.0 / 16_384.0
}
