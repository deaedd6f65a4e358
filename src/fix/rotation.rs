//! A continuous rotation, to and fro: its seconds in sectors of the circle, for either direction of turning.
//!
//! Every sector has seconds of every pass, so that a bias which wanders more slowly than a pass is the same in all of them and stays out of the
//! azimuth, and the memory does not grow with the time. A second's mean cosine and sine are shorter than those of its middle, by sin(w/2)/(w/2)
//! for a turn by w.
//!
//! A sensitive axis that is not quite normal to the spindle feels a share of the turning, and the encoder lags behind the gyro: both have the sign
//! of the turning. Half the difference of both directions is estimated with the azimuth and taken out; a lag of the encoder turns the azimuths of
//! both directions apart by as much, and their mean has none of it.
//!
//! What the base does meanwhile cannot be told from the sectors, which are of no time of their own. A straight line through the levels says how
//! fast it tilts, and sigma holds that.

use nalgebra::{Matrix4, Vector4};

use super::dwell::{DwellSummary, Row};
use super::dwells::Dwells;
use super::observation::{Observation, regular_inverse};
use crate::earth::EarthRate;
use crate::effects::Carried;
use crate::sensing::index::Direction;
use crate::sensing::level::Specific;
use crate::units::{ARCSEC_PER_RAD, DEG_PER_RAD, RAD_PER_DEG, wrap_180_deg};

/// Numbers of dwells from here on are passes of a continuous rotation, in recordings, too.
pub const FIRST_PASS: u8 = 128;
/// Sectors of the circle. Their mean direction is shorter than a second's by 1.1 %, and so is what they say of the azimuth.
const SECTORS: usize = 12;
/// Places for dwells that a rotation takes.
pub const PLACES: usize = 2 * SECTORS;
/// A tilt rate is the base's, or the accelerometers', beyond so many of its sigmas; below, it is their noise.
const TILTS_SIGMAS: f64 = 3.0;

/// A second of the rotation.
#[derive(Clone, Copy, Debug)]
struct Second {
    row: Row,
    carried: Carried,
    /// It is in its sector.
    counted: bool,
}

/// Gathers a rotation.
#[derive(Clone, Debug, Default)]
pub struct Rotation {
    /// The last second: the next one says how far the index turned in both.
    last: Option<Second>,
    /// Which dwell a sector is: first those of turning clockwise, then the others.
    places: [Option<u8>; PLACES],
    levels: [Line; 2],
}

/// A straight line through what a level accelerometer reads, g; times from the first second's.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    first: Option<(f64, f64)>,
    seconds: f64,
    time: f64,
    time_squares: f64,
    reading: f64,
    with_time: f64,
    reading_squares: f64,
}

impl Line {
    fn push(&mut self, t_s: f64, reading_g: f64) {
        let (first_s, first_g) = *self.first.get_or_insert((t_s, reading_g));
        let (time_s, off_g) = (t_s - first_s, reading_g - first_g);
        self.seconds += 1.0;
        self.time += time_s;
        self.time_squares += time_s * time_s;
        self.reading += off_g;
        self.with_time += time_s * off_g;
        self.reading_squares += off_g * off_g;
    }

    /// Slope and its variance, arcsec/s; `None` of fewer than three seconds.
    fn slope(&self) -> Option<[f64; 2]> {
        let spread = self.time_squares - self.time * self.time / self.seconds;
        if self.seconds < 3.0 || spread <= 0.0 {
            return None;
        }
        let about_mean = self.with_time - self.time * self.reading / self.seconds;
        let slope = about_mean / spread;
        let residual = self.reading_squares - self.reading * self.reading / self.seconds - slope * about_mean;
        let variance = residual.max(0.0) / (self.seconds - 2.0) / spread;
        Some([slope * ARCSEC_PER_RAD, variance * ARCSEC_PER_RAD * ARCSEC_PER_RAD])
    }
}

impl Rotation {
    pub fn is_any(&self) -> bool {
        self.places.iter().any(Option::is_some)
    }

    /// Takes the next second in which the index turned evenly. `false`: there is no room.
    pub fn push(&mut self, row: Row, carried: Carried, dwells: &mut impl Dwells) -> bool {
        if let Some(level) = row.level {
            let Specific { forward, left } = level.mean;
            self.levels.iter_mut().zip([forward, left]).for_each(|(line, reading)| line.push(row.t_s, reading));
        }
        let last = self.last.replace(Second { row, carried, counted: false });
        let Some(before) = last.filter(|last| last.row.joins(&row)) else { return true };
        let way_deg = wrap_180_deg(index_deg(&row) - index_deg(&before.row));
        let fits = before.counted || self.keep(&before, way_deg, dwells);
        if let Some(last) = &mut self.last {
            last.counted = true;
        }
        fits && self.keep(&Second { row, carried, counted: true }, way_deg, dwells)
    }

    /// Into the sector of a second that the index turned by `way_deg` in.
    fn keep(&mut self, Second { row, carried, .. }: &Second, way_deg: f64, dwells: &mut impl Dwells) -> bool {
        let middle_deg = index_deg(row);
        let half_rad = 0.5 * way_deg.abs().max(1e-6) * RAD_PER_DEG;
        let Direction { cos, sin } = Direction::of_deg(middle_deg);
        let shorter = libm::sin(half_rad) / half_rad;
        let row = Row { cos: shorter * cos, sin: shorter * sin, ..*row };
        let dwell = DwellSummary { carried: *carried, ..DwellSummary::moving(&row) };
        let sector = (middle_deg / 360.0 * SECTORS as f64) as usize % SECTORS;
        let Some(place) = self.places.get_mut(sector + if way_deg > 0.0 { SECTORS } else { 0 }) else { return false };
        if let Some(sector) = place.and_then(|place| dwells.get_mut(place.into())) {
            sector.merge(&dwell);
            return true;
        }
        *place = Some(dwells.as_slice().len() as u8);
        dwells.push(dwell)
    }

    /// Takes half the difference of both directions of turning out of the sectors. Done twice it changes nothing more.
    pub fn take_out_turning(&self, dwells: &mut impl Dwells) {
        let sectors = || {
            let places = self.places.iter().enumerate();
            places.filter_map(|(key, place)| Some((usize::from((*place)?), if key < SECTORS { -1.0 } else { 1.0 })))
        };
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (place, turning) in sectors() {
            let Some(dwell) = dwells.as_slice().get(place) else { return };
            let row = Vector4::new(dwell.cos, dwell.sin, 1.0, turning);
            let observation = Observation { weight: dwell.seconds, row, cos_2theta: 0.0, rate_deg_h: dwell.rate.mean };
            observation.add_to(&mut normal, &mut right);
        }
        // Where one direction alone was turned in, nothing tells it from the bias.
        let Some(inverse) = regular_inverse(&normal) else { return };
        let of_turning_deg_h = (inverse * right).w;
        for (place, turning) in sectors() {
            if let Some(dwell) = dwells.get_mut(place) {
                dwell.rate.mean -= turning * of_turning_deg_h;
            }
        }
    }

    /// What a base that tilts meanwhile may have turned the azimuth by, degrees; `None` where the levels show no more than noise, or are not there. A
    /// roll that changes by ṙ and a pitch that does by ṗ add cos θ · ṙ − sin θ · ṗ to the rates: (ṙ, −ṗ) to (h cos ψ, h sin ψ).
    pub fn tilting_deg(&self, earth: &EarthRate) -> Option<f64> {
        let [forward, left] = &self.levels;
        let ([pitch, of_pitch], [roll, of_roll]) = (forward.slope()?, left.slope()?);
        let squared = pitch * pitch + roll * roll;
        let significant = squared > TILTS_SIGMAS * TILTS_SIGMAS * (of_pitch + of_roll);
        significant.then(|| libm::sqrt(squared) / earth.north_deg_h * DEG_PER_RAD)
    }
}

fn index_deg(row: &Row) -> f64 {
    Direction { cos: row.cos, sin: row.sin }.deg()
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::earth::earth_rate;
    use crate::effects::ErrorModel;
    use crate::fix::{Declared, solve};
    use crate::sensing::level::LevelMoments;
    use crate::sensing::sample::GyroSettings;

    const AZIMUTH_DEG: f64 = 200.0;

    /// Ten passes of ten seconds at 30 °/s at 40° north. The gyro's mean rate over a second is h (sin(ψ − θ1) − sin(ψ − θ2))/w, and `of_turning`
    /// with the sign of the turning, °/h; the base tilts by `roll` arcsec/s.
    fn rotation(of_turning_deg_h: f64, roll: f64, passes: u8) -> (Rotation, Vec<DwellSummary>, EarthRate) {
        let earth = earth_rate(40.0).unwrap();
        let (mut rotation, mut dwells) = (Rotation::default(), Vec::new());
        for pass in 0..passes {
            let turning = if pass % 2 == 0 { 1.0 } else { -1.0 };
            for second in 0..10 {
                let t_s = f64::from(pass) * 14.0 + f64::from(second) + 0.5;
                let middle_deg = 180.0 + turning * 30.0 * (f64::from(second) - 4.5);
                let ends = [-15.0, 15.0].map(|off: f64| (AZIMUTH_DEG - middle_deg - off).to_radians().sin());
                let rate = earth.north_deg_h * (ends[0] - ends[1]) / 30f64.to_radians();
                let Direction { cos, sin } = Direction::of_deg(middle_deg);
                let rate_deg_h = rate + 0.4 + turning * of_turning_deg_h + roll * middle_deg.to_radians().cos();
                let level = LevelMoments::constant(0.0, roll * t_s / ARCSEC_PER_RAD);
                let row = Row { t_s, seconds: 1.0, cos, sin, rate_deg_h, moment_arcsec_s: 0.0, level };
                assert!(rotation.push(row, Carried::default(), &mut dwells));
            }
        }
        (rotation, dwells, earth)
    }

    #[test]
    fn every_second_is_in_a_sector_and_the_turning_is_taken_out() {
        for of_turning_deg_h in [0.0, 31.0, -3.0] {
            let (rotation, mut dwells, earth) = rotation(of_turning_deg_h, 0.0, 10);
            // Ten sectors of twelve, in two directions.
            assert_eq!(dwells.len(), 20);
            assert!((dwells.iter().map(|dwell| dwell.seconds).sum::<f64>() - 100.0).abs() < 1e-9);
            rotation.take_out_turning(&mut dwells);
            rotation.take_out_turning(&mut dwells);
            let declared = Declared { earth, gyro: GyroSettings::default(), ..Declared::default() };
            let fix = solve(&dwells, &declared, &ErrorModel::default()).unwrap();
            assert!(wrap_180_deg(fix.azimuth_deg - AZIMUTH_DEG).abs() < 1e-6, "{fix:?}");
            assert!((fix.amplitude_deg_h - earth.north_deg_h).abs() < 1e-6, "{fix:?}");
            assert!((fix.bias_deg_h - 0.4).abs() < 1e-6 && rotation.tilting_deg(&earth).is_none());
        }
    }

    /// One direction alone: a bias and what the axis feels of the turning are one.
    #[test]
    fn one_direction_leaves_the_turning_in_the_bias() {
        let (rotation, mut dwells, _) = rotation(5.0, 0.0, 1);
        let before = dwells.clone();
        rotation.take_out_turning(&mut dwells);
        assert_eq!(before, dwells);
    }

    /// 0.2 arcsec/s of roll are 0.2 °/h in 11.522 °/h of horizontal rate: 0.995°.
    #[test]
    fn a_base_that_tilts_is_seen() {
        let (rotation, _, earth) = rotation(0.0, 0.2, 10);
        let tilting_deg = rotation.tilting_deg(&earth).unwrap();
        assert!((tilting_deg - 0.9945).abs() < 1e-3, "{tilting_deg}");
    }
}
