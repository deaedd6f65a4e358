//! Errors that somebody plays into the instrument: what follows a law that no scenario has.

/// Errors of the sensors, one value for each second from power-up; after the last value there is no error.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Played {
    /// Adds to the gyro's rate, °/h.
    pub rate_deg_h: Vec<f64>,
    /// The gyro shows so much more of the inertial rate, a ratio.
    pub scale: Vec<f64>,
    /// The encoder reads too large by this, degrees.
    pub index_deg: Vec<f64>,
    /// The accelerometer reads too large by this, forward and left, g.
    pub level_g: [Vec<f64>; 2],
}

impl Played {
    /// What the gyro's electronics integrate too much over an interval that ends at `t_s`, s, and lasts `dt_s`, arcsec. It turned by `turned_arcsec`.
    pub(crate) fn increment_arcsec(&self, t_s: f64, dt_s: f64, turned_arcsec: f64) -> f64 {
        at(&self.rate_deg_h, t_s) * dt_s + at(&self.scale, t_s) * turned_arcsec
    }

    /// What the encoder reads too much, degrees.
    pub(crate) fn index_deg(&self, t_s: f64) -> f64 {
        at(&self.index_deg, t_s)
    }

    /// What the accelerometer reads too much, forward and left, g.
    pub(crate) fn level_g(&self, t_s: f64) -> [f64; 2] {
        [0, 1].map(|axis| at(&self.level_g[axis], t_s))
    }
}

/// The value of the second that this time, s, is in: a second ends with the time that is its number.
fn at(values: &[f64], t_s: f64) -> f64 {
    let second = (t_s.ceil() - 1.0).max(0.0) as usize;
    values.get(second).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 °/h for 2.5 ms are 0.0075 arcsec; 1 % of 0.04 arcsec are 0.0004. The second second begins after 1 s and ends with 2 s.
    #[test]
    fn errors_by_hand() {
        let played = Played {
            rate_deg_h: vec![0.0, 3.0],
            scale: vec![0.0, 0.01],
            index_deg: vec![0.0, 0.5],
            level_g: [vec![0.0, 0.02], vec![0.0, -0.03]],
        };
        assert!((played.increment_arcsec(1.0025, 0.0025, 0.04) - 0.0079).abs() < 1e-15);
        assert_eq!([0.0, 1.0, 1.0025, 2.0, 2.0025].map(|t_s| played.index_deg(t_s)), [0.0, 0.0, 0.5, 0.5, 0.0]);
        assert_eq!(played.level_g(1.5), [0.02, -0.03]);
    }
}
