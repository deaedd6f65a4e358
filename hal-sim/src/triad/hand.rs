//! An accelerometer triad that is put down by hand in one attitude after the other.

use super::accelerometers::AccelerometerTriad;
use crate::noise::{Source, Stream};
use nalgebra::{UnitQuaternion, UnitVector3, Vector3};

/// How the hand works.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Which way is up, in coordinates of the case, attitude after attitude; any length but zero.
    pub up: Vec<[f64; 3]>,
    /// Time at rest in each, s.
    pub rest_s: f64,
    /// Time of a move, s.
    pub move_s: f64,
    /// Readings per second.
    pub rate_hz: f64,
    /// Shake of the hand while it moves, g rms.
    pub shake_g: f64,
    /// Shake while at rest, g rms: 0 on a table.
    pub rest_shake_g: f64,
}

/// A reading with its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandReading {
    pub t_s: f64,
    pub raw: [f64; 3],
    /// The attitude it belongs to, from 0; `None` while moving.
    pub attitude: Option<usize>,
}

/// Directions spread evenly over the sphere on a spiral (the golden section between one and the next), turned at random.
pub fn even_directions(count: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut stream = Stream::new(seed, Source::Base);
    let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
        stream.normal(),
        stream.normal(),
        stream.normal(),
        stream.normal(),
    ));
    let golden_rad = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let height = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let (sine, cosine) = (golden_rad * i as f64).sin_cos();
            let across = (1.0 - height * height).sqrt();
            (turn * Vector3::new(across * cosine, across * sine, height)).into()
        })
        .collect()
}

/// Records the triad through all attitudes.
pub fn place_by_hand(triad: &AccelerometerTriad, placement: &Placement, seed: u64) -> Vec<HandReading> {
    let mut stream = AccelerometerTriad::stream(seed);
    let mut hand = Stream::new(seed, Source::Base);
    let directions: Vec<_> = placement.up.iter().map(|up| UnitVector3::new_normalize(Vector3::from(*up))).collect();
    let mut readings = Vec::new();
    let mut t_s = 0.0;
    for (attitude, direction) in directions.iter().enumerate() {
        let rests = (placement.rest_s * placement.rate_hz).round() as u32;
        let moves = (placement.move_s * placement.rate_hz).round() as u32;
        let next = directions.get(attitude + 1);
        for step in 0..rests + if next.is_some() { moves } else { 0 } {
            t_s += 1.0 / placement.rate_hz;
            let moving = step >= rests;
            let (up, shake_g) = match next {
                Some(next) if moving => {
                    let done = f64::from(step - rests + 1) / f64::from(moves);
                    (between(direction, next, 0.5 * (1.0 - (std::f64::consts::PI * done).cos())), placement.shake_g)
                }
                _ => (direction.into_inner(), placement.rest_shake_g),
            };
            let shake = Vector3::from_fn(|_, _| shake_g * hand.normal());
            let raw = triad.read((up + shake).into(), &mut stream);
            readings.push(HandReading { t_s, raw, attitude: (!moving).then_some(attitude) });
        }
    }
    readings
}

/// On the great circle from one direction to another; opposite ones by way of any side.
fn between(from: &UnitVector3<f64>, to: &UnitVector3<f64>, part: f64) -> Vector3<f64> {
    match UnitQuaternion::rotation_between_axis(from, to) {
        Some(turn) => turn.powf(part) * from.into_inner(),
        None => {
            let across = if from.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
            let axis = UnitVector3::new_normalize(from.cross(&across));
            UnitQuaternion::from_axis_angle(&axis, std::f64::consts::PI * part) * from.into_inner()
        }
    }
}
