//! The design row: what a rate says of azimuth and bias. The solution and the diagnosis share it.

use crate::earth::EarthRate;
use crate::sensing::index::Direction;
use crate::sensing::level::Specific;

/// One row of the linear equations of a fix: rate = `cos` · h cos ψ + `sin` · h sin ψ + bias + `vertical_deg_h`, h = Ω cos φ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignRow {
    /// North component of the sensitive axis for an azimuth ψ = 0 of the mark: C = cos θ cos p − sin θ sin r sin p.
    pub cos: f64,
    /// The same for ψ = 90°: S = sin θ cos r.
    pub sin: f64,
    /// What the Earth's vertical rate adds, °/h: Ω sin φ times the upward component of the axis.
    pub vertical_deg_h: f64,
}

impl DesignRow {
    /// Of an instrument with the level accelerometers' reading (`None`: level), pitch p and roll r in it, and the gyro at
    /// the true index angle θ. With forward = sin p and left = sin r cos p the axis points up by cos θ · forward +
    /// sin θ · left. From the rotation of the sensitive axis by roll, pitch and azimuth.
    pub fn new(index: Direction, level: Option<Specific>, earth: &EarthRate) -> Self {
        let Specific { forward, left } = level.unwrap_or(Specific { forward: 0.0, left: 0.0 });
        let cos_pitch = libm::sqrt(1.0 - forward * forward);
        let sin_roll = left / cos_pitch;
        let cos_roll = libm::sqrt(1.0 - sin_roll * sin_roll);
        Self {
            cos: index.cos * cos_pitch - index.sin * sin_roll * forward,
            sin: index.sin * cos_roll,
            vertical_deg_h: earth.up_deg_h * (index.cos * forward + index.sin * left),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, pitch 30° and roll 20°, Ω cos φ = 12, Ω sin φ = 9: forward 0.5, left = sin 20° cos 30° = 0.2961981.
    #[test]
    fn a_tilted_instrument() {
        let earth = EarthRate { north_deg_h: 12.0, up_deg_h: 9.0 };
        let level = Specific::new(0.5, 0.2961981);
        // θ = 0: the axis is the mark: C = cos 30°, S = 0, up sin 30°.
        let row = DesignRow::new(Direction::of_deg(0.0), level, &earth);
        assert!((row.cos - 0.8660254).abs() < 1e-7 && row.sin == 0.0 && (row.vertical_deg_h - 4.5).abs() < 1e-12);
        // θ = 90°: the y axis. Pitched and rolled its north component is −sin r sin p = −0.1710101 for ψ = 0, and cos 20° =
        // 0.9396926 for ψ = 90°, when the axis points north.
        let row = DesignRow::new(Direction::of_deg(90.0), level, &earth);
        assert!((row.cos + 0.1710101).abs() < 1e-6 && (row.sin - 0.9396926).abs() < 1e-6, "{row:?}");
        assert!((row.vertical_deg_h - 9.0 * 0.2961981).abs() < 1e-6);
    }
}
