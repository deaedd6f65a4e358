//! The equations of a fix: its dwells as weighted observations.

use nalgebra::Vector4;

use super::azimuth_effects::AzimuthEffects;
use super::base_motion::BaseMotion;
use super::base_motion::levels::Path;
use super::cause::Cause;
use super::design::DesignRow;
use super::doubt::{Correlated, Doubts};
use super::dwell::DwellSummary;
use super::noise::Noise;
use super::observation::Observation;
use super::sinusoid::Fitted;
use crate::earth::EarthRate;
use crate::effects::effect::Port;
use crate::sensing::index::Direction;

/// The dwells of a fix with what belongs to all of them.
pub(super) struct Problem<'a> {
    pub dwells: &'a [DwellSummary],
    pub earth: EarthRate,
    pub motion: BaseMotion,
    pub start_s: f64,
    pub sinusoid: Option<Fitted>,
    pub noise: Option<Noise>,
    /// What is not certain of the error model.
    pub correlated: Option<Correlated>,
    pub cause: Cause,
    /// What of the error model depends on the azimuth, at a supposed one.
    pub at_azimuth: Option<AzimuthEffects<'a>>,
}

impl<'a> Problem<'a> {
    /// Of dwells of which nothing is known yet but what is supposed to have happened; `None` without any.
    pub fn new(dwells: &'a [DwellSummary], earth: EarthRate, motion: BaseMotion, cause: Cause) -> Option<Self> {
        Some(Self {
            dwells,
            earth,
            motion,
            start_s: dwells.first()?.start_s,
            sinusoid: None,
            noise: None,
            correlated: None,
            cause,
            at_azimuth: None,
        })
    }

    /// The dwells that say something: all but one in which the instrument was turned.
    pub fn counting(&self) -> impl Iterator<Item = &'a DwellSummary> + Clone {
        let cause = self.cause;
        self.dwells.iter().filter(move |dwell| !cause.spoils(dwell))
    }

    /// True direction of the index at a dwell.
    fn index(&self, dwell: &DwellSummary) -> Direction {
        let index = Direction { cos: dwell.cos, sin: dwell.sin };
        index.turned_deg(self.cause.index_deg(dwell))
    }

    /// What of the model depends on the azimuth, at the one of this dwell.
    fn effects_at(&self, dwell: &DwellSummary) -> Option<AzimuthEffects<'a>> {
        self.at_azimuth.map(|effects| effects.earlier(self.cause.azimuth_deg(dwell)))
    }

    /// Mean and slope of a dwell, the Earth's vertical rate and the base's turning taken out.
    pub fn observations(&self, dwell: &DwellSummary) -> [Observation; 2] {
        let index = self.index(dwell);
        let design = DesignRow::new(index, dwell.specific(), &self.earth);
        let (mean_deg_h, mut weight) = self.noise.map_or((dwell.rate.mean, dwell.seconds), |noise| noise.mean(dwell));
        let mut weight_of_slope = self.noise.map_or(dwell.time_spread.into(), |noise| noise.weight_of_slope(dwell));
        let slope_per_s = self.noise.map_or(dwell.rate.slope_per_s, |noise| noise.slope_per_s(dwell));
        if self.cause.spoils(dwell) {
            (weight, weight_of_slope) = (0.0, 0.0);
        }
        let rate_deg_h = mean_deg_h - design.vertical_deg_h - self.motion.rate_deg_h(dwell);
        let hours = (dwell.t_s - self.start_s) / 3600.0;
        let (effects_deg_h, with_azimuth) =
            self.effects_at(dwell).map_or((0.0, Vector4::zeros()), |effects| effects.of_dwell(dwell, index));
        let of_bias = 1.0 + dwell.carried.of_bias();
        let row = Vector4::new(design.cos, design.sin, of_bias, of_bias * hours) + with_azimuth;
        // At an azimuth that was less by Δ: h cos(ψ − Δ) and h sin(ψ − Δ) in the unknowns h cos ψ and h sin ψ.
        let horizontal = Direction { cos: row.x, sin: row.y }.turned_deg(self.cause.azimuth_deg(dwell));
        let [sinusoid_deg_h, sinusoid_deg_h_per_h] = match &self.sinusoid {
            None => [0.0; 2],
            Some(sinusoid) => sinusoid.of_dwell(dwell),
        };
        [
            Observation {
                weight,
                row: Vector4::new(horizontal.cos, horizontal.sin, row.z, row.w),
                cos_2theta: index.cos * index.cos - index.sin * index.sin,
                rate_deg_h: rate_deg_h - sinusoid_deg_h - effects_deg_h,
            },
            Observation {
                weight: weight_of_slope / (3600.0 * 3600.0),
                row: Vector4::new(0.0, 0.0, 0.0, 1.0),
                cos_2theta: 0.0,
                rate_deg_h: slope_per_s * 3600.0 - sinusoid_deg_h_per_h,
            },
        ]
    }

    /// The mean alone.
    pub fn mean(&self, dwell: &DwellSummary) -> Observation {
        let [mean, _] = self.observations(dwell);
        mean
    }

    /// The observations with errors that are independent of each other.
    pub fn for_each(&self, take: &mut dyn FnMut(Observation)) {
        if let Some(correlated) = &self.correlated {
            return correlated.for_each(self.dwells, &|dwell| self.with_doubts(dwell), take);
        }
        for dwell in self.dwells {
            self.observations(dwell).into_iter().for_each(&mut *take);
        }
    }

    /// The mean of a dwell, and what is not certain of the model in it.
    pub fn with_doubts(&self, dwell: &DwellSummary) -> (Observation, Doubts) {
        let doubts = match self.effects_at(dwell) {
            Some(effects) => effects.doubts(dwell, self.index(dwell)),
            None => Doubts {
                directions_deg_h: core::array::from_fn(|direction| dwell.carried.doubt(Port::Rate, direction)),
                of_process: 1.0,
            },
        };
        (self.mean(dwell), doubts)
    }

    /// What an error of a dwell's rate adds to the right-hand side of the normal equations.
    pub fn gain(&self, dwell: usize, observation: &Observation) -> Vector4<f64> {
        match &self.correlated {
            Some(correlated) => correlated.gain(dwell).unwrap_or_default(),
            None => observation.weight * observation.row,
        }
    }

    /// The path of the base that is taken out.
    pub fn path(&self) -> Option<&Path> {
        self.motion.path()
    }
}
