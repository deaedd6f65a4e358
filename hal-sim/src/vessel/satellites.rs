//! Satellite receivers with two antennas.

use nalgebra::{Rotation3, Vector3};

use super::globe;
use super::ship::Instant;
use crate::noise::{Source, Stream};

/// Wavelength of the carrier, m (1575.42 MHz).
pub const WAVELENGTH_M: f64 = 0.190_293_67;
/// Satellites in use: one is the reference of the differences.
const SATELLITES: usize = 5;

/// Where the antennas are, and how well the receivers work.
#[derive(Clone, Copy, Debug)]
pub struct Antennas {
    /// Hull axes, from the block, m.
    pub antenna_m: Vector3<f64>,
    /// True baseline to the second one, m.
    pub baseline_m: Vector3<f64>,
    pub velocity_m_s: f64,
    pub position_m: f64,
    pub phase_m: f64,
}

/// A second difference of phases.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    pub pair: u16,
    /// To the pair's satellite less to the reference, east, north, up.
    pub direction: Vector3<f64>,
    pub phase_m: f64,
}

/// The receivers.
#[derive(Clone, Debug)]
pub struct Receivers {
    antennas: Antennas,
    noise: Stream,
    phase_noise: Stream,
    wavelengths: [f64; SATELLITES],
}

impl Receivers {
    pub fn new(antennas: Antennas, seed: u64) -> Self {
        let mut phase_noise = Stream::new(seed, Source::Phases);
        let wavelengths = std::array::from_fn(|_| (1000.0 * (phase_noise.uniform() - 0.5)).round());
        Self { antennas, noise: Stream::new(seed, Source::Satellites), phase_noise, wavelengths }
    }

    fn antenna(&self, at: &Instant) -> Vector3<f64> {
        at.position_m + at.hull * self.antennas.antenna_m
    }

    /// Mean velocity of the antenna between two instants, east, north, up, m/s.
    pub fn velocity_m_s(&mut self, from: &Instant, to: &Instant) -> Vector3<f64> {
        let moved = self.antenna(to) - self.antenna(from);
        let axes = globe::east_north_up(&(0.5 * (self.antenna(to) + self.antenna(from))));
        axes.transpose() * moved / (to.t_s - from.t_s)
            + Vector3::from_fn(|_, _| self.antennas.velocity_m_s * self.noise.normal())
    }

    /// Latitude and longitude, degrees, height, m.
    pub fn position(&mut self, at: &Instant) -> (f64, f64, f64) {
        let error = Vector3::from_fn(|_, _| self.antennas.position_m * self.noise.normal());
        globe::geodetic(&(self.antenna(at) + at.east_north_up() * error))
    }

    /// Phase differences now.
    pub fn phases(&mut self, at: &Instant) -> [Difference; SATELLITES - 1] {
        let axes = at.east_north_up();
        let baseline = axes.transpose() * (at.hull * self.antennas.baseline_m);
        let directions: [Vector3<f64>; SATELLITES] = std::array::from_fn(|satellite| direction(satellite, at.t_s));
        std::array::from_fn(|pair| {
            let direction = directions[pair + 1] - directions[0];
            // Each receiver's phase has noise of its own: the reference's is left out of the correlation between pairs.
            let noise = self.antennas.phase_m * self.phase_noise.normal();
            let whole = (self.wavelengths[pair + 1] - self.wavelengths[0]) * WAVELENGTH_M;
            Difference { pair: pair as u16, direction, phase_m: direction.dot(&baseline) + whole + noise }
        })
    }

    /// A receiver loses count: the phases of one pair jump by some wavelengths.
    pub fn slip(&mut self, pair: usize, by: f64) {
        self.wavelengths[1 + pair % (SATELLITES - 1)] += by;
    }
}

/// Satellites drift across the sky as the real ones do, half a turn in some six hours.
fn direction(satellite: usize, t_s: f64) -> Vector3<f64> {
    const SKY: [(f64, f64, f64); SATELLITES] =
        [(20.0, 75.0, 0.3), (60.0, 35.0, 0.9), (150.0, 50.0, -0.7), (235.0, 28.0, 0.8), (310.0, 45.0, -0.9)];
    let (azimuth, elevation, sense) = SKY[satellite];
    let orbit = Rotation3::from_axis_angle(&Vector3::x_axis(), sense * 7e-5 * t_s);
    let up = elevation.to_radians();
    let along = f64::to_radians(azimuth);
    orbit * Vector3::new(up.cos() * along.sin(), up.cos() * along.cos(), up.sin())
}
