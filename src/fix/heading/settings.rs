//! What is declared of the block of three gyros.

use inertial::BlockClass;
use serde::{Deserialize, Serialize};

/// The block of three gyros and three accelerometers, where the instrument has one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BlockSettings {
    /// What such a block is good for.
    pub class: Class,
    /// Where this block is otherwise than its class: angle random walk of its gyros, °/√h.
    pub arw_deg_per_sqrt_h: Option<f64>,
    /// Bias of its gyros from run to run, °/h, one sigma.
    pub bias_deg_h: Option<f64>,
    /// Scale factor of its gyros, parts per million, one sigma.
    pub scale_ppm: Option<f64>,
    /// Range of its gyros, °/s.
    pub range_deg_s: Option<f64>,
    /// Beyond this one sigma of the heading a new fix is asked for, degrees.
    pub refix_sigma_deg: f64,
}

/// Classes of blocks: see [`BlockClass`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    SourceMems,
    #[default]
    ModernMems,
    SourceFog,
    RingLaser,
}

impl Default for BlockSettings {
    fn default() -> Self {
        Self {
            class: Class::default(),
            arw_deg_per_sqrt_h: None,
            bias_deg_h: None,
            scale_ppm: None,
            range_deg_s: None,
            refix_sigma_deg: 0.5,
        }
    }
}

impl BlockSettings {
    /// The class with what is declared otherwise.
    pub fn figures(&self) -> BlockClass {
        let class = match self.class {
            Class::SourceMems => BlockClass::SOURCE_MEMS,
            Class::ModernMems => BlockClass::MODERN_MEMS,
            Class::SourceFog => BlockClass::SOURCE_FOG,
            Class::RingLaser => BlockClass::RING_LASER,
        };
        BlockClass {
            arw_deg_sqrt_h: self.arw_deg_per_sqrt_h.unwrap_or(class.arw_deg_sqrt_h),
            run_to_run_deg_h: self.bias_deg_h.unwrap_or(class.run_to_run_deg_h),
            scale_ppm: self.scale_ppm.unwrap_or(class.scale_ppm),
            range_deg_s: self.range_deg_s.unwrap_or(class.range_deg_s),
            ..class
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_its_class_but_for_what_is_declared() {
        let settings = BlockSettings { bias_deg_h: Some(2.0), ..BlockSettings::default() };
        let figures = settings.figures();
        assert_eq!((figures.run_to_run_deg_h, figures.arw_deg_sqrt_h), (2.0, BlockClass::MODERN_MEMS.arw_deg_sqrt_h));
    }
}
