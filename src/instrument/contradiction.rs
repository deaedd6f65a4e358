//! A rate that the base does not have: a gyro that sends rates, degrees or anything else in the place of increments in radians.
//!
//! The sensitive axis lies in the horizontal plane, and whatever turns the instrument about such an axis tilts it: the level accelerometers must see
//! it. A wrong unit makes of the Earth's 15 °/h a steady rate of 860 (degrees) or 6,000 (rates), and nothing tilts.

use crate::earth::EARTH_RATE_DEG_H;
use crate::sensing::level::Specific;
use crate::units::ARCSEC_PER_RAD;

/// Seconds in a row of a steady rate.
const SECONDS: u16 = 10;
/// Steady: within this share of the first of them. Nobody who levels the instrument turns it so evenly for so long.
const STEADY: f64 = 0.25;
/// Of a rate beyond the declared bias and this many times the Earth's: two thirds of it or more are then the base's own. By the
/// accelerometers it must have tilted by the share below at least; their noise is a hundredth of that.
const EARTH_RATES: f64 = 3.0;
const SHARE: f64 = 0.25;

/// What is seen of it.
#[derive(Clone, Debug, Default)]
pub struct Contradiction {
    /// Rate of the first second, °/h, and the force in it.
    first: Option<(f64, Specific)>,
    seconds: u16,
    told_arcsec: f64,
}

impl Contradiction {
    /// At the end of a second: the gyro's mean rate, °/h; the accelerometers, where they were read and the index stood. Gives whether they contradict
    /// each other.
    pub fn second(&mut self, rate_deg_h: f64, bias_limit_deg_h: f64, level: Option<Specific>) -> bool {
        let Some(level) = level.filter(|_| rate_deg_h.abs() > bias_limit_deg_h + EARTH_RATES * EARTH_RATE_DEG_H) else {
            *self = Self::default();
            return false;
        };
        let (first_deg_h, began) = *self.first.get_or_insert((rate_deg_h, level));
        if (rate_deg_h - first_deg_h).abs() > STEADY * first_deg_h.abs() {
            *self = Self { first: Some((rate_deg_h, level)), ..Self::default() };
            return false;
        }
        // The first second's own rate came before its reading.
        if self.seconds > 0 {
            self.told_arcsec += rate_deg_h;
        }
        self.seconds = self.seconds.saturating_add(1);
        let tilted_rad = libm::hypot(level.forward - began.forward, level.left - began.left);
        self.seconds > SECONDS && tilted_rad < SHARE * self.told_arcsec.abs() / ARCSEC_PER_RAD
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds until the contradiction is seen: of a rate, and a base that tilts by so many °/h.
    fn seen(rate_deg_h: impl Fn(u16) -> f64, tilts_deg_h: f64) -> Option<u16> {
        let mut contradiction = Contradiction::default();
        (0..100).find(|&second| {
            // 1 °/h for 1 s is 1 arcsec.
            let forward = f64::from(second) * tilts_deg_h / ARCSEC_PER_RAD;
            contradiction.second(rate_deg_h(second), 1.0, Some(Specific { forward, left: 0.0 }))
        })
    }

    #[test]
    fn a_steady_rate_must_tilt_the_base() {
        // The Earth's 12 °/h as degrees, and as rates.
        assert_eq!((seen(|_| 688.0, 0.0), seen(|_| -4800.0, 0.0)), (Some(10), Some(10)));
        // A base that turns by 300 °/h, with and without the Earth's rate; a rate that nothing forbids; one that is not steady.
        assert_eq!((seen(|_| 300.0, 300.0), seen(|_| 300.0, 285.0), seen(|_| 300.0, 315.0)), (None, None, None));
        assert_eq!(seen(|_| 45.0, 0.0), None);
        assert_eq!(seen(|second| if second % 5 == 0 { 500.0 } else { 800.0 }, 0.0), None);
    }
}
