//! The block of three gyros and three accelerometers, and how the instrument is carried.

use super::SensorFault;
use super::check::{Each, part};

part! {
    /// The block: one sigma of what is wrong with it; a run draws its own.
    Block {
        /// Angle random walk, °/√h.
        arw_deg_per_sqrt_h: f64 = 0.15, 0.0..=100.0;
        /// Bias of the gyros from run to run, °/h.
        run_to_run_deg_h: f64 = 10.0, 0.0..=100000.0;
        /// Bias that wanders (Gauss-Markov), °/h.
        markov_deg_h: f64 = 0.5, 0.0..=100000.0;
        /// Its time constant, s.
        markov_s: f64 = 600.0, 0.1..=1e6;
        /// Scale factor of the gyros, parts per million.
        scale_ppm: f64 = 500.0, 0.0..=100000.0;
        /// Axes of the gyros out of their directions, arcsec.
        misalignment_arcsec: f64 = 206.0, 0.0..=36000.0;
        /// Bias of the accelerometers, m/s².
        accelerometer_m_s2: f64 = 0.0075, 0.0..=10.0;
        /// Velocity random walk of the accelerometers, m/s/√s.
        vrw_m_s_per_sqrt_s: f64 = 0.001, 0.0..=10.0;
        /// Rate at which a gyro saturates, °/s: a little more than a data sheet promises.
        saturation_deg_s: f64 = 410.0, 1.0..=2000.0;
        /// Time after power-up in which nothing answers on its bus, s.
        startup_s: f64 = 0.31, 0.0..=60.0;
        /// Faults of its bus.
        faults: Vec<SensorFault> = Vec::new(), Each;
    }
}

part! {
    /// Somebody lifts the instrument off its place, walks, and sets it down in another one.
    Carry {
        /// Time from the fix until it is lifted, s.
        wait_s: f64 = 60.0, 0.0..=100000.0;
        /// Time of the walk, s.
        walk_s: f64 = 60.0, 1.0..=100000.0;
        /// Time on the new place until the power goes off, s.
        stand_s: f64 = 30.0, 1.0..=100000.0;
        /// By how much it is turned clockwise on the way, degrees.
        turn_deg: f64 = 130.0, -3600.0..=3600.0;
        /// By how much it stands otherwise on the new place, pitch and roll, degrees.
        set_down_deg: [f64; 2] = [1.5, -1.0], -30.0..=30.0;
        /// How far it is carried, m.
        distance_m: f64 = 20.0, 0.0..=10000.0;
        /// How high it is lifted, m.
        lift_m: f64 = 0.8, 0.0..=3.0;
        /// Sway in the hands, amplitudes in pitch, roll and azimuth, degrees.
        sway_deg: [f64; 3] = [5.0, 4.0, 6.0], 0.0..=45.0;
        /// Steps a second; pitch sways with every step, roll with every second, azimuth with every fourth.
        steps_hz: f64 = 1.8, 0.1..=4.0;
        /// Rise and fall with every step, m.
        bob_m: f64 = 0.03, 0.0..=0.3;
    }
}
