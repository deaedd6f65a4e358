//! A ship under way: its true motion, and what ideal gyros and accelerometers on a turning block would add up.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::globe;

/// Steps of the motion in an interval of the block.
const SUBSTEPS: usize = 4;
/// Time in which the ship follows an order for its rate of turn or speed, s.
const RESPONSE_S: f64 = 4.0;

/// A stretch of the voyage: what the helm is told until a time.
#[derive(Clone, Copy, Debug)]
pub struct Leg {
    /// End, s from the start.
    pub until_s: f64,
    /// Course to steer, degrees clockwise from north; not wrapped: 450 is a full turn and a quarter.
    pub heading_deg: f64,
    /// Through the water, m/s.
    pub speed_m_s: f64,
    /// Below the surface, m.
    pub depth_m: f64,
}

/// Motion by waves: amplitudes and periods.
#[derive(Clone, Copy, Debug)]
pub struct Waves {
    pub roll_deg: f64,
    pub pitch_deg: f64,
    pub yaw_deg: f64,
    pub heave_m: f64,
    /// Of roll; pitch, heave and yaw have 0.75, 0.9 and 4 times of it.
    pub period_s: f64,
}

impl Waves {
    /// None: a dock without a breath of wind.
    pub const NONE: Self = Self { roll_deg: 0.0, pitch_deg: 0.0, yaw_deg: 0.0, heave_m: 0.0, period_s: 8.0 };
    /// A harbour on a calm day.
    pub const CALM: Self = Self { roll_deg: 0.5, pitch_deg: 0.2, yaw_deg: 0.3, heave_m: 0.05, period_s: 8.0 };
    /// A seaway.
    pub const SEA: Self = Self { roll_deg: 5.0, pitch_deg: 2.0, yaw_deg: 1.0, heave_m: 0.7, period_s: 9.0 };
}

/// The block's turn about the deck normal: harmonic.
#[derive(Clone, Copy, Debug)]
pub struct Modulation {
    /// 0 for none.
    pub amplitude_deg: f64,
    pub period_s: f64,
    /// Of the middle: 90° is a block whose x axis points forward, y to port.
    pub mean_deg: f64,
}

impl Modulation {
    /// Ten minutes, as in the source.
    pub fn harmonic(amplitude_deg: f64) -> Self {
        Self { amplitude_deg, period_s: 600.0, mean_deg: 0.0 }
    }

    fn turn_rad(&self, t_s: f64) -> f64 {
        (self.mean_deg + self.amplitude_deg * (TAU * t_s / self.period_s).sin()).to_radians()
    }
}

/// What is sailed.
#[derive(Clone, Debug)]
pub struct Voyage {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    /// At the start.
    pub heading_deg: f64,
    pub legs: Vec<Leg>,
    /// Highest rate of turn, °/s, and of diving, m/s.
    pub turn_deg_s: f64,
    pub dive_m_s: f64,
    pub waves: Waves,
    pub modulation: Modulation,
    /// Of the water over the ground, east and north, m/s: what the ship drifts with.
    pub current_m_s: [f64; 2],
    /// Interval of the block, s.
    pub interval_s: f64,
}

/// The ship at one instant. Vectors in axes fixed to the Earth.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    pub t_s: f64,
    pub position_m: Vector3<f64>,
    pub velocity_m_s: Vector3<f64>,
    /// Hull axes (X starboard, Y forward, Z up) to axes fixed to the Earth.
    pub hull: Rotation3<f64>,
    /// Turn of the block on the hull, counter-clockwise from above, rad.
    pub turn_rad: f64,
    /// Of the water under the ship, east, north, up, m/s.
    pub water_m_s: Vector3<f64>,
}

/// An interval of the block: its end, and the integrals of rate and specific force over it, block axes.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub end: Instant,
    pub angle_rad: Vector3<f64>,
    pub velocity_m_s: Vector3<f64>,
}

/// A voyage, sailed.
#[derive(Clone, Debug)]
pub struct Passage {
    pub interval_s: f64,
    pub start: Instant,
    pub steps: Vec<Step>,
}

impl Instant {
    /// East, north, up as columns.
    pub fn east_north_up(&self) -> Matrix3<f64> {
        globe::east_north_up(&self.position_m)
    }

    /// Hull axes to east, north, up.
    pub fn attitude(&self) -> Matrix3<f64> {
        self.east_north_up().transpose() * self.hull.matrix()
    }

    /// Block axes to east, north, up.
    pub fn block_attitude(&self) -> Matrix3<f64> {
        self.attitude() * Rotation3::from_axis_angle(&Vector3::z_axis(), self.turn_rad).matrix()
    }

    /// Heading of the bow, degrees clockwise from north.
    pub fn heading_deg(&self) -> f64 {
        let bow = self.attitude().column(1).into_owned();
        bow.x.atan2(bow.y).to_degrees()
    }

    /// East, north, up, m/s.
    pub fn ground_velocity_m_s(&self) -> Vector3<f64> {
        self.east_north_up().transpose() * self.velocity_m_s
    }
}

/// The helm's state.
#[derive(Clone, Copy)]
struct Helm {
    heading_deg: f64,
    turn_deg_s: f64,
    speed_m_s: f64,
    depth_m: f64,
    dive_m_s: f64,
    /// Of the yaw on top of the course, at the last step: its change is part of the motion.
    t_s: f64,
    position_m: Vector3<f64>,
}

impl Voyage {
    /// A ship moored for `hours`: it turns to `headings_deg` one after the other, each for `each_s`.
    pub fn moored(latitude_deg: f64, hours: f64, headings_deg: &[f64], each_s: f64) -> Self {
        let last = headings_deg.last().copied().unwrap_or(0.0);
        let legs = headings_deg.iter().enumerate().map(|(i, heading_deg)| Leg {
            until_s: (i + 1) as f64 * each_s,
            heading_deg: *heading_deg,
            speed_m_s: 0.0,
            depth_m: 0.0,
        });
        let rest = Leg { until_s: hours * 3600.0, heading_deg: last, speed_m_s: 0.0, depth_m: 0.0 };
        Self {
            latitude_deg,
            longitude_deg: 30.0,
            heading_deg: headings_deg.first().copied().unwrap_or(0.0),
            legs: legs.chain([rest]).collect(),
            turn_deg_s: 1.5,
            dive_m_s: 0.5,
            waves: Waves::CALM,
            modulation: Modulation::harmonic(0.0),
            current_m_s: [0.0, 0.0],
            interval_s: 0.1,
        }
    }

    /// Sails it: up to the end of the last leg.
    pub fn sail(&self) -> Passage {
        let first = self.legs.first();
        let mut helm = Helm {
            heading_deg: self.heading_deg,
            turn_deg_s: 0.0,
            speed_m_s: first.map_or(0.0, |leg| leg.speed_m_s),
            depth_m: first.map_or(0.0, |leg| leg.depth_m),
            dive_m_s: 0.0,
            t_s: 0.0,
            position_m: Vector3::zeros(),
        };
        helm.position_m = globe::position(self.latitude_deg, self.longitude_deg, -helm.depth_m);
        let duration_s = self.legs.last().map_or(0.0, |leg| leg.until_s);
        let h = self.interval_s / SUBSTEPS as f64;
        let start = self.instant(&helm);
        let mut before = start;
        let steps = (0..(duration_s / self.interval_s).round() as usize)
            .map(|_| {
                let (mut angle_rad, mut velocity_m_s) = (Vector3::zeros(), Vector3::zeros());
                for _ in 0..SUBSTEPS {
                    self.steer(&mut helm, h);
                    // Euler forwards for where "up" is, then the mean velocity for where the ship is.
                    let from = helm.position_m;
                    helm.position_m = from + before.velocity_m_s * h;
                    let velocity = self.instant(&helm).velocity_m_s;
                    helm.position_m = from + 0.5 * h * (before.velocity_m_s + velocity);
                    let after = self.instant(&helm);
                    let (angle, force) = increments(&before, &after, h);
                    angle_rad += angle;
                    velocity_m_s += force;
                    before = after;
                }
                Step { end: before, angle_rad, velocity_m_s }
            })
            .collect();
        Passage { interval_s: self.interval_s, start, steps }
    }

    fn steer(&self, helm: &mut Helm, h: f64) {
        helm.t_s += h;
        let Some(leg) = self.legs.iter().find(|leg| helm.t_s < leg.until_s).or(self.legs.last()) else { return };
        let follow = h / RESPONSE_S;
        let turn = ((leg.heading_deg - helm.heading_deg) / (3.0 * RESPONSE_S)).clamp(-self.turn_deg_s, self.turn_deg_s);
        helm.turn_deg_s += follow * (turn - helm.turn_deg_s);
        helm.heading_deg += helm.turn_deg_s * h;
        helm.speed_m_s += follow * (leg.speed_m_s - helm.speed_m_s).clamp(-2.0, 2.0);
        let dive = ((leg.depth_m - helm.depth_m) / (3.0 * RESPONSE_S)).clamp(-self.dive_m_s, self.dive_m_s);
        helm.dive_m_s += follow * (dive - helm.dive_m_s);
        helm.depth_m += helm.dive_m_s * h;
    }

    fn instant(&self, helm: &Helm) -> Instant {
        let waves = &self.waves;
        // Waves die out with the depth.
        let size = (-helm.depth_m / 15.0).exp();
        let phase = TAU * helm.t_s / waves.period_s;
        let roll = size * waves.roll_deg.to_radians() * phase.sin();
        let pitch = size * waves.pitch_deg.to_radians() * (phase / 0.75 + 1.0).sin();
        let yaw = size * waves.yaw_deg.to_radians() * (phase / 4.0 + 2.0).sin();
        let heave_rate = size * waves.heave_m * TAU / (0.9 * waves.period_s) * (phase / 0.9).cos();
        let heading = helm.heading_deg.to_radians() + yaw;
        let level = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), pitch)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), roll);
        let axes = globe::east_north_up(&helm.position_m);
        let water_m_s = Vector3::new(self.current_m_s[0], self.current_m_s[1], 0.0);
        let course = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading) * Vector3::y();
        let local = course * helm.speed_m_s + water_m_s + Vector3::z() * (heave_rate - helm.dive_m_s);
        Instant {
            t_s: helm.t_s,
            position_m: helm.position_m,
            velocity_m_s: axes * local,
            hull: Rotation3::from_matrix_unchecked(axes * level.matrix()),
            turn_rad: self.modulation.turn_rad(helm.t_s),
            water_m_s,
        }
    }
}

/// Integrals of rate and specific force over a short step, block axes.
fn increments(before: &Instant, after: &Instant, h: f64) -> (Vector3<f64>, Vector3<f64>) {
    let block = |instant: &Instant| instant.hull * Rotation3::from_axis_angle(&Vector3::z_axis(), instant.turn_rad);
    let (b0, b1) = (block(before), block(after));
    let angle = (b0.inverse() * globe::turn(h) * b1).scaled_axis();
    let spin = globe::axis() * globe::RATE_RAD_S;
    let velocity = 0.5 * (before.velocity_m_s + after.velocity_m_s);
    let position = 0.5 * (before.position_m + after.position_m);
    let acceleration = (after.velocity_m_s - before.velocity_m_s) / h
        + 2.0 * spin.cross(&velocity)
        + spin.cross(&spin.cross(&position));
    let force = acceleration - globe::gravitation(&position);
    (angle, 0.5 * h * (b0.inverse() * force + b1.inverse() * force))
}
