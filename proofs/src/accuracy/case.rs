//! What a Monte Carlo trial simulates.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Rate of the Earth, °/h: 7.292115e-5 rad/s of WGS 84. Stated here anew, so that the yardstick is not the firmware's.
const EARTH_RATE_DEG_H: f64 = 7.292_115e-5 * 180.0 / std::f64::consts::PI * 3600.0;

/// One simulated fix, but for its heading and its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    pub order: Order,
    /// Angle random walk of the gyro, °/√h; the instrument knows it.
    pub arw_deg_per_sqrt_h: f64,
    /// Measuring time at each position, s; in the east-west order, at each of its four long ones.
    pub dwell_s: f64,
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Linear drift of the bias, °/h per hour; the instrument does not know it.
    pub drift_deg_h_per_h: f64,
    /// One sigma of the drift that the instrument reckons with, °/h per hour.
    pub declared_drift_deg_h_per_h: f64,
    pub noise: Noise,
}

/// What the gyro's noise is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// White, of the angle random walk.
    White,
    /// The same, and flicker noise of this bias instability, °/h, which the instrument knows.
    Flicker { instability_deg_h: f64 },
    /// Seconds with as large a standard deviation, by Student's t with three degrees of freedom.
    HeavyTails,
    /// The same, one second in ten with four times the noise of the others.
    Bursts,
    /// White, and this noise of the angle, arcsec; the instrument knows it or does not.
    Angle { arcsec: f64, declared: bool },
}

impl Noise {
    /// Name as in the tables.
    pub fn name(self) -> String {
        match self {
            Self::White => "white".into(),
            Self::Flicker { instability_deg_h } => format!("flicker, {instability_deg_h} °/h"),
            Self::HeavyTails => "Student's t, 3".into(),
            Self::Bursts => "four times the noise in a tenth of the seconds".into(),
            Self::Angle { arcsec, declared: true } => format!("angle, {arcsec} arcsec, declared"),
            Self::Angle { arcsec, declared: false } => format!("angle, {arcsec} arcsec, not declared"),
        }
    }
}

/// The order of positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    Plain,
    Source,
    Mirrored,
    EastWest,
    /// To and fro, in so many passes, at 30 °/s; the dwell is the time of one that counts.
    Rotation {
        passes: u16,
    },
}

/// The part of the travel of a continuous rotation in which the index turns evenly, degrees: it begins at −4° and ends at 354°, and takes 9° at
/// either end to gain and lose 30 °/s.
pub const EVEN_DEG: [f64; 2] = [5.0, 345.0];
/// Speed of the index, °/s.
pub const SPEED_DEG_S: f64 = 30.0;
/// Whole seconds in it at that speed, when they begin at any moment: 10 or 11.
pub const EVEN_S: f64 = 10.0;
/// From the end of these seconds to the beginning of the next ones, s: the ramps, 0.25 s of rest, and what is left of seconds. A pass takes 12.7 s.
pub const REVERSAL_S: f64 = 3.0;
/// The sensitive axis lies within this of the normal of the spindle, arcsec, evenly: 31 °/h of 30 °/s at the most.
pub const ELEVATION_ARCSEC: f64 = 60.0;
/// Unevenness of the turning, degrees rms.
pub const UNEVENNESS_DEG: f64 = 0.02;

/// Measuring time at each of the four positions of the east-west order's coarse pass, s.
pub const COARSE_DWELL_S: f64 = 10.0;

impl Order {
    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Source => "source",
            Self::Mirrored => "mirrored",
            Self::EastWest => "east-west",
            Self::Rotation { .. } => "rotation",
        }
    }

    /// Index angles that are known beforehand, degrees.
    pub fn angles_deg(self) -> &'static [f64] {
        match self {
            Self::Plain | Self::EastWest => &[0.0, 90.0, 180.0, 270.0],
            Self::Source => &[90.0, 180.0, 270.0, 360.0],
            Self::Mirrored => &[0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0],
            Self::Rotation { .. } => &[],
        }
    }
}

impl Case {
    /// A good bench at a middle latitude.
    pub const NOMINAL: Self = Self {
        order: Order::Mirrored,
        arw_deg_per_sqrt_h: 0.0015,
        dwell_s: 30.0,
        latitude_deg: 34.75,
        drift_deg_h_per_h: 0.0,
        declared_drift_deg_h_per_h: 0.0,
        noise: Noise::White,
    };

    /// Measuring time of the whole fix, s.
    pub fn seconds(&self) -> f64 {
        match self.order {
            Order::Rotation { passes } => f64::from(passes) * EVEN_S,
            Order::EastWest => 4.0 * (COARSE_DWELL_S + self.dwell_s),
            other => other.angles_deg().len() as f64 * self.dwell_s,
        }
    }

    /// The least standard deviation of the azimuth for equally spaced positions, 60√2 · N / (h √T), degrees.
    pub fn bound_deg(&self) -> f64 {
        let north_deg_h = EARTH_RATE_DEG_H * self.latitude_deg.to_radians().cos();
        let bound_rad = 60.0 * 2f64.sqrt() * self.arw_deg_per_sqrt_h / (north_deg_h * self.seconds().sqrt());
        bound_rad.to_degrees()
    }
}

/// Where the numbers of a case come from: all the same, or drawn anew for every trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spread {
    One(Case),
    /// Angle random walk 0.0005 … 0.02 °/√h (its logarithm is uniform), dwell 10 … 120 s, latitude −70 … 70°.
    All(Order),
}

impl Spread {
    pub fn draw(&self, random: &mut ChaCha8Rng) -> Case {
        match *self {
            Self::One(case) => case,
            Self::All(order) => Case {
                order,
                arw_deg_per_sqrt_h: random.random_range(0.0005f64.ln()..0.02f64.ln()).exp(),
                dwell_s: f64::from(random.random_range(10..=120)),
                latitude_deg: random.random_range(-70.0..70.0),
                ..Case::NOMINAL
            },
        }
    }
}
