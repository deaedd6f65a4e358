//! The accuracy that an adaptive order asks for, and what no measuring time takes out of sigma.

use super::{Declared, Fix};
use crate::effects::ErrorModel;
use crate::health::Flag;
use crate::units::DEG_PER_RAD;

/// What the bias instability adds to the variance of an azimuth, by (instability/h)²: in three dwells, east, west, east with weights of a
/// quarter, a half and a quarter, the azimuth is (west − east)/2h, and half the mean square of its parts is (1/4 + 1/4 + 1)/4.
const OF_INSTABILITY: f64 = 3.0 / 8.0;

impl Declared {
    /// The part of an azimuth's sigma that does not average out, degrees: encoder, level, bias instability, and what the model adds.
    pub fn floor_deg(&self, model: &ErrorModel) -> f64 {
        let of_index = self.index_sigma_deg * self.index_sigma_deg / 2.0;
        let of_level = self.level_sigma_deg * self.earth.up_deg_h / self.earth.north_deg_h;
        let of_instability = DEG_PER_RAD * self.gyro.bias_instability_deg_h / self.earth.north_deg_h;
        let of_model = model.doubt.azimuth_sigma_deg;
        libm::sqrt(
            of_index + of_level * of_level + OF_INSTABILITY * of_instability * of_instability + of_model * of_model,
        )
    }
}

impl Fix {
    /// Says so where sigma is above the accuracy that was asked for, degrees, if one was.
    pub fn judge(&mut self, accuracy_deg: Option<f64>) {
        if accuracy_deg.is_some_and(|accuracy_deg| self.sigma_deg > accuracy_deg) {
            self.flags.insert(Flag::AccuracyNotReached);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fix::tests::declared;

    /// At 60° north h is 7.5205 °/h: 0.02°/√2 of the encoder, 0.01° · tan 60° of the level, and 0.002 °/h of instability, which is
    /// 0.01524° · √(3/8): √(0.014142² + 0.017321² + 0.009331²).
    #[test]
    fn the_floor_by_hand() {
        let mut declared = declared(60.0);
        (declared.index_sigma_deg, declared.level_sigma_deg) = (0.02, 0.01);
        declared.gyro.bias_instability_deg_h = 0.002;
        let floor_deg = declared.floor_deg(&ErrorModel::default());
        assert!((floor_deg - 0.024231).abs() < 1e-5, "{floor_deg}");
    }
}
