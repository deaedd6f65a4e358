//! Dead reckoning with an inertial block, Earth-fixed, on a spherical Earth whose surface the ship does not leave.
//!
//! For showing what a calibration is worth. The block's accelerometers are perfect; its gyros are what is looked at.

/// Rate of the Earth, rad/s (WGS 84).
const EARTH_RATE_RAD_S: f64 = 7.292_115e-5;
/// Gravity towards the centre, m/s².
const GRAVITY_M_S2: f64 = 9.80665;
const ARCSEC_PER_RAD: f64 = 3600.0 * 180.0 / std::f64::consts::PI;

type Vector = [f64; 3];
/// Hamilton's; w first; takes block coordinates to Earth-fixed ones.
type Quaternion = [f64; 4];

/// Position, velocity and attitude.
#[derive(Clone, Copy, Debug)]
pub struct Navigator {
    /// Earth-fixed, m.
    pub position_m: Vector,
    velocity_m_s: Vector,
    attitude: Quaternion,
    radius_m: f64,
}

impl Navigator {
    /// At a known position, velocity and attitude (rows of the matrix from block to Earth-fixed coordinates).
    pub fn new(position_m: Vector, velocity_m_s: Vector, attitude: [Vector; 3]) -> Self {
        let radius_m = dot(position_m, position_m).sqrt();
        Self { position_m, velocity_m_s, attitude: of_matrix(attitude), radius_m }
    }

    /// A step: angles in arcsec and changes of velocity in m/s about and along x, y, z of the block.
    pub fn step(&mut self, turned_arcsec: Vector, velocity_m_s: Vector, dt_s: f64) {
        let turned = turned_arcsec.map(|angle| angle / ARCSEC_PER_RAD);
        // The force acts along the attitude in the middle of the step.
        let half = multiply(self.attitude, of_rotation(turned.map(|angle| 0.5 * angle)));
        let half = multiply(of_rotation([0.0, 0.0, -0.5 * EARTH_RATE_RAD_S * dt_s]), half);
        let force = rotate(half, velocity_m_s);
        let attitude = multiply(self.attitude, of_rotation(turned));
        self.attitude = normalized(multiply(of_rotation([0.0, 0.0, -EARTH_RATE_RAD_S * dt_s]), attitude));

        let middle_m = add(self.position_m, self.velocity_m_s, 0.5 * dt_s);
        let up = middle_m.map(|part| part / dot(middle_m, middle_m).sqrt());
        let [vx, vy, _] = self.velocity_m_s;
        let coriolis = [2.0 * EARTH_RATE_RAD_S * vy, -2.0 * EARTH_RATE_RAD_S * vx, 0.0];
        let mut velocity_m_s = add(self.velocity_m_s, force, 1.0);
        velocity_m_s = add(velocity_m_s, coriolis, dt_s);
        velocity_m_s = add(velocity_m_s, up, -GRAVITY_M_S2 * dt_s);
        let mean = add(self.velocity_m_s, velocity_m_s, 1.0).map(|part| 0.5 * part);
        let position_m = add(self.position_m, mean, dt_s);
        // The ship stays on the sea: height and vertical velocity are known.
        let radius_m = dot(position_m, position_m).sqrt();
        self.position_m = position_m.map(|part| part * self.radius_m / radius_m);
        let up = self.position_m.map(|part| part / self.radius_m);
        self.velocity_m_s = add(velocity_m_s, up, -dot(velocity_m_s, up));
    }
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a + factor · b.
fn add(a: Vector, b: Vector, factor: f64) -> Vector {
    [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]
}

fn multiply(a: Quaternion, b: Quaternion) -> Quaternion {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn normalized(q: Quaternion) -> Quaternion {
    let norm = q.iter().map(|part| part * part).sum::<f64>().sqrt();
    q.map(|part| part / norm)
}

fn rotate(q: Quaternion, v: Vector) -> Vector {
    let [_, x, y, z] = multiply(multiply(q, [0.0, v[0], v[1], v[2]]), [q[0], -q[1], -q[2], -q[3]]);
    [x, y, z]
}

/// Of a rotation vector, rad.
fn of_rotation(rotation: Vector) -> Quaternion {
    let angle = dot(rotation, rotation).sqrt();
    let factor = if angle > 1e-12 { (0.5 * angle).sin() / angle } else { 0.5 };
    [(0.5 * angle).cos(), factor * rotation[0], factor * rotation[1], factor * rotation[2]]
}

/// Of a rotation matrix, from its greatest component (S. W. Shepperd, Journal of Guidance and Control 1, 1978, p. 223).
fn of_matrix(m: [Vector; 3]) -> Quaternion {
    let squares = [
        1.0 + m[0][0] + m[1][1] + m[2][2],
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
    ];
    let (x, y, z) = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]);
    let (xy, xz, yz) = (m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]);
    let greatest = squares.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let of_greatest = match squares.map(|square| square == greatest) {
        [true, ..] => [greatest, x, y, z],
        [_, true, ..] => [x, greatest, xy, xz],
        [_, _, true, _] => [y, xy, greatest, yz],
        _ => [z, xz, yz, greatest],
    };
    normalized(of_greatest)
}

#[cfg(test)]
mod tests {
    use hal_sim::triad::{ShipVoyage, distance_nmi};

    use super::*;

    const VOYAGE: ShipVoyage = ShipVoyage { start_deg: [34.75, 20.0], course_deg: 60.0, knots: 12.0 };

    /// Error at the end, nautical miles, with gyros that are off by a rate in arcsec/s.
    fn error_nmi(hours: f64, off_arcsec_s: Vector) -> f64 {
        let (position_m, velocity_m_s, attitude) = VOYAGE.start();
        let mut navigator = Navigator::new(position_m, velocity_m_s, attitude);
        let mut truth = position_m;
        for step in VOYAGE.steps(0.5, hours) {
            navigator.step(add(step.turned_arcsec, off_arcsec_s, 0.5), step.velocity_m_s, 0.5);
            truth = step.position_m;
        }
        distance_nmi(navigator.position_m, truth)
    }

    #[test]
    fn perfect_gyros_navigate_without_error() {
        let error = error_nmi(15.0, [0.0; 3]);
        assert!(error < 0.02, "{error}");
    }

    #[test]
    fn an_error_about_the_vertical_does_what_theory_says() {
        // A constant error r about the vertical, which indexing about it leaves alone, makes (K. R. Britting, Inertial Navigation
        // Systems Analysis, 1971, chapter 8, without the Schuler oscillation): in latitude r/Ω · cos φ · (1 − cos Ωt), in
        // longitude r · sin φ · (t − sin Ωt/Ω). For 0.01 °/h at 34.75°: r/Ω is 2.286′. After 3 h 0.55′ and 0.10′ · cos φ, in all
        // 0.556; after 12 h 3.76′ and 4.10′ · cos φ, in all 5.05 nautical miles.
        for (hours, expected) in [(3.0, 0.556), (12.0, 5.05)] {
            let error = error_nmi(hours, [0.0, 0.0, 0.01]);
            assert!((error / expected - 1.0).abs() < 0.03, "{hours} h: {error}");
        }
    }

    #[test]
    fn indexing_takes_out_what_is_fixed_to_the_block() {
        let level = error_nmi(12.0, [0.01, 0.0, 0.0]);
        let vertical = error_nmi(12.0, [0.0, 0.0, 0.01]);
        assert!(level < 0.5 * vertical, "{level} {vertical}");
    }
}
