//! What of the error model depends on the azimuth that is sought, at a supposed azimuth: effects that follow the axis over ground or the rate itself,
//! and what an uncertain index angle or level adds to the rate.

use nalgebra::Vector4;

use super::doubt::Doubts;
use super::dwell::DwellSummary;
use crate::earth::EarthRate;
use crate::effects::doubt::MAX_DIRECTIONS;
use crate::effects::effect::{Port, Replayed};
use crate::effects::now::{Belief, Now, RunFacts};
use crate::effects::track::Track;
use crate::effects::{Conditions, Effect, ErrorModel};
use crate::fix::DesignRow;
use crate::fix::way::Way;
use crate::sensing::index::Direction;
use crate::units::{DEG_PER_RAD, RAD_PER_DEG, sin_cos_deg, wrap_360_deg};

/// Half width of the difference from which the slope against the azimuth is taken, degrees: the azimuth of one pass over an uncalibrated
/// instrument is about as wrong, so that a step in a curve becomes a slope over it.
const HALF_WIDTH_DEG: f64 = 0.1;

/// The model at a supposed azimuth.
#[derive(Clone, Copy)]
pub(super) struct AzimuthEffects<'a> {
    model: &'a ErrorModel,
    /// All of the fix, in the order of time.
    dwells: &'a [DwellSummary],
    earth: EarthRate,
    azimuth_deg: f64,
    cos: f64,
    sin: f64,
    /// How the effects go with the azimuth is left out.
    fixed: bool,
}

impl<'a> AzimuthEffects<'a> {
    pub fn new(model: &'a ErrorModel, dwells: &'a [DwellSummary], earth: EarthRate, azimuth_deg: f64) -> Self {
        let (sin, cos) = sin_cos_deg(azimuth_deg);
        Self { model, dwells, earth, azimuth_deg, cos, sin, fixed: false }
    }

    /// The same at another azimuth.
    fn at(&self, azimuth_deg: f64) -> Self {
        Self { fixed: self.fixed, ..Self::new(self.model, self.dwells, self.earth, azimuth_deg) }
    }

    /// At an azimuth that is less by so many degrees.
    pub fn earlier(self, azimuth_deg: f64) -> Self {
        if azimuth_deg == 0.0 {
            return self;
        }
        self.at(self.azimuth_deg - azimuth_deg)
    }

    /// The effects as they are at the supposed azimuth, wherever the azimuth is.
    pub fn without_slope(self) -> Self {
        Self { fixed: true, ..self }
    }

    /// What the effects add to the mean rate of a dwell, °/h, and how that goes with (h cos ψ, h sin ψ, bias, drift) about the supposed azimuth.
    pub fn of_dwell(&self, dwell: &DwellSummary, index: Direction) -> (f64, Vector4<f64>) {
        if self.model.effects_of_azimuth().next().is_none() {
            return (0.0, Vector4::zeros());
        }
        let weight = |effect: &Effect, number: usize| effect.weights.get(number).copied().unwrap_or(0.0).into();
        let at = |azimuth_deg: f64| self.at(azimuth_deg).sum(dwell, index, &weight);
        if self.fixed {
            return (at(self.azimuth_deg), Vector4::zeros());
        }
        let rise = at(self.azimuth_deg + HALF_WIDTH_DEG) - at(self.azimuth_deg - HALF_WIDTH_DEG);
        let per_rad = rise / (2.0 * HALF_WIDTH_DEG * RAD_PER_DEG);
        let north = self.earth.north_deg_h;
        (at(self.azimuth_deg), per_rad / north * Vector4::new(-self.sin, self.cos, 0.0, 0.0))
    }

    /// What is not certain of the model in the mean rate of a dwell.
    pub fn doubts(&self, dwell: &DwellSummary, index: Direction) -> Doubts {
        let design = DesignRow::new(index, dwell.specific(), &self.earth);
        let mut directions_deg_h = [0.0; MAX_DIRECTIONS];
        for (k, (doubt, direction)) in directions_deg_h.iter_mut().zip(&self.model.doubt.directions).enumerate() {
            for port in [Port::Rate, Port::Index, Port::Forward, Port::Left] {
                *doubt += self.gain(port, index, &design) * dwell.carried.doubt(port, k);
            }
            for (effect, first, gate) in self.model.effects_of_azimuth() {
                let of_weight = |number: usize| f64::from(direction.get(first + number).copied().unwrap_or(0.0));
                *doubt += self.effect(effect, gate, dwell, index, &design, &of_weight);
            }
        }
        let gain = |port: Port| self.gain(port, index, &design) * port.per_deg_h();
        Doubts { directions_deg_h, of_process: self.model.doubt.process.map_or(1.0, |process| gain(process.port)) }
    }

    fn sum(&self, dwell: &DwellSummary, index: Direction, weight: &dyn Fn(&Effect, usize) -> f64) -> f64 {
        let design = DesignRow::new(index, dwell.specific(), &self.earth);
        let effects = self.model.effects_of_azimuth();
        effects.map(|(effect, _, gate)| self.effect(effect, gate, dwell, index, &design, &|n| weight(effect, n))).sum()
    }

    /// Σ weight · product of the factors' functions, at its port, °/h.
    fn effect(
        &self,
        effect: &Effect,
        gate: usize,
        dwell: &DwellSummary,
        index: Direction,
        design: &DesignRow,
        weight: &dyn Fn(usize) -> f64,
    ) -> f64 {
        let (conditions, track, run) = (Conditions::default(), Track::default(), RunFacts::default());
        let belief = Some(Belief {
            axis_azimuth_deg: wrap_360_deg(self.azimuth_deg - libm::atan2(index.sin, index.cos) * DEG_PER_RAD),
            rate_deg_h: self.earth_rate_deg_h(design),
        });
        let now = Now { conditions: &conditions, channels: &[], track: &track, run: &run, belief };
        let gate_of = |number: usize| dwell.carried.gate(gate + number);
        let replayed = self.replayed(effect, dwell, design);
        let of_weight = |number: usize| weight(number) * effect.of_azimuth(number, &gate_of, &replayed, &now);
        self.gain(effect.port, index, design) * (0..effect.count()).map(of_weight).sum::<f64>()
    }

    /// The functions of those factors of an effect that are replayed, means over a dwell, whose row of the equations is `design`.
    fn replayed(&self, effect: &Effect, dwell: &DwellSummary, design: &DesignRow) -> Replayed {
        let rate_deg_h = |index: Direction, dwell: &DwellSummary| {
            self.earth_rate_deg_h(&DesignRow::new(index, dwell.specific(), &self.earth))
        };
        let way = Way { dwells: self.dwells, azimuth_deg: self.azimuth_deg, rate_deg_h: &rate_deg_h };
        let mut replayed = Replayed::default();
        for (functions, factor) in replayed.iter_mut().zip(&effect.factors).filter(|(_, factor)| factor.is_replayed()) {
            *functions = way.replay(factor, dwell, self.earth_rate_deg_h(design));
        }
        replayed
    }

    /// The Earth's rate about the axis, °/h.
    fn earth_rate_deg_h(&self, design: &DesignRow) -> f64 {
        self.earth.north_deg_h * (design.cos * self.cos + design.sin * self.sin) + design.vertical_deg_h
    }

    /// What a unit at a port adds to the rate that the solution takes for true, °/h.
    fn gain(&self, port: Port, index: Direction, design: &DesignRow) -> f64 {
        match port {
            Port::Rate => 1.0,
            Port::Scale => self.earth_rate_deg_h(design),
            // The encoder reads too much: the axis is clockwise of where it is taken to be.
            Port::Index => -RAD_PER_DEG * self.earth.north_deg_h * (design.cos * self.sin - design.sin * self.cos),
            // The level reads too much, and so much too much of the vertical rate is taken out.
            Port::Forward => -self.earth.up_deg_h * index.cos,
            Port::Left => -self.earth.up_deg_h * index.sin,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::effects::carried::MAX_GATES;
    use crate::effects::dynamics::{self, Play};
    use crate::effects::factor::Factor;
    use crate::effects::shape::{Harmonic, Linear, Saturation, Shape};
    use crate::effects::signal::{Axis, Rate};
    use crate::fix::Fix;
    use crate::fix::solve;
    use crate::fix::tests::{declared, dwell};
    use crate::units::wrap_180_deg;

    /// Ω cos 60°, °/h.
    const NORTH_DEG_H: f64 = 7.5205335;
    const ORDER: [f64; 8] = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];

    fn model(effect: Effect, weights: &[f32]) -> ErrorModel {
        let mut model = ErrorModel::default();
        let weights = weights.iter().copied().collect();
        model.effects.push(Effect { weights, ..effect }).unwrap();
        model.validate().unwrap();
        model
    }

    /// Eight dwells at an azimuth of 70° that read the Earth's rate and what is added to it: of the axis' azimuth and of the Earth's rate. Every
    /// product of factors that do not depend on the azimuth is one.
    fn fix(model: &ErrorModel, added_deg_h: impl Fn(f64, f64) -> f64) -> Fix {
        let mut track = Track::default();
        let dwells: Vec<DwellSummary> = (0..)
            .zip(ORDER)
            .map(|(i, index_deg)| {
                let axis_rad = (70.0 - index_deg).to_radians();
                let rate_deg_h = NORTH_DEG_H * libm::cos(axis_rad);
                let mut each = dwell(65.0 * f64::from(i), index_deg, rate_deg_h + added_deg_h(axis_rad, rate_deg_h));
                (0..MAX_GATES).for_each(|gate| each.carried.set_gate(gate, 1.0));
                track.winding_deg = index_deg;
                each.carried.set_way(&track);
                each
            })
            .collect();
        solve(&dwells, &declared(60.0), model).unwrap()
    }

    fn assert_azimuth(fix: &Fix, expected_deg: f64) {
        assert!(wrap_180_deg(fix.azimuth_deg - expected_deg).abs() < 2e-4, "{} {expected_deg}", fix.azimuth_deg);
    }

    /// What goes with the sine of the axis' azimuth turns the azimuth: h cos x + a sin x = √(h² + a²) cos(x − δ), tan δ = a/h; with a = 0.1 °/h δ is
    /// 0.76182°, and the azimuth reads 70° − δ. The model takes it out.
    #[test]
    fn an_effect_of_the_axis_over_ground() {
        let harmonic = Factor::new(Axis.into(), &[], Harmonic { period: 360.0 }.into());
        let effect = Effect::new(Port::Rate, &[harmonic]);
        let sine = |axis_rad: f64, _: f64| 0.1 * libm::sin(axis_rad);
        assert_azimuth(&fix(&ErrorModel::default(), sine), 70.0 - 0.76182);
        assert_azimuth(&fix(&model(effect.clone(), &[0.0, 0.1]), sine), 70.0);
        // At the port of the scale factor the same weight multiplies the Earth's rate: half of it goes with the sine of twice the axis' azimuth.
        let scaled = Effect { port: Port::Scale, ..effect };
        assert_azimuth(&fix(&model(scaled, &[0.0, 0.1]), |axis_rad, rate| rate * sine(axis_rad, 0.0)), 70.0);
    }

    /// A line in the rate, 0.02 of it at 7.5205 °/h, is a scale factor: the amplitude is the Earth's with the model, and 2 % more without.
    #[test]
    fn an_effect_of_the_rate_itself() {
        let line: Shape = Linear { reference: 0.0, scale: 1.0 }.into();
        let effect = Effect::new(Port::Rate, &[Factor::new(Rate.into(), &[], line)]);
        let added = |_: f64, rate_deg_h: f64| 0.02 * rate_deg_h;
        assert!((fix(&ErrorModel::default(), added).amplitude_deg_h / NORTH_DEG_H - 1.02).abs() < 1e-6);
        assert!((fix(&model(effect, &[0.02]), added).amplitude_deg_h / NORTH_DEG_H - 1.0).abs() < 1e-6);
    }

    /// A play of ±1 °/h, of a recording without the rows of turns, follows the Earth's rates h cos(70° − θ) with h = 7.5205 °/h: at θ = 0 it begins at h cos 70° = 2.5722; at 45° it is h cos 25° − 1 = 5.8159; on
    /// the way to 90° the axis points north, h − 1 = 6.5205, which it keeps until it is h cos 65° + 1 = 4.1783 at 135°; then h cos 110° + 1 = −1.5722 and
    /// h cos 155° + 1 = −5.8159; after south at 250° it is 1 − h = −6.5205, and at last h cos 115° − 1 = −4.1783.
    #[test]
    fn an_effect_of_the_rates_on_the_way() {
        let of_play = [2.5722, 5.8159, 6.5205, 4.1783, -1.5722, -5.8159, -6.5205, -4.1783];
        let line: Shape = Linear { reference: 0.0, scale: 1.0 }.into();
        let effect = Effect::new(Port::Rate, &[Factor::new(Rate.into(), &[Play { half_width: 1.0 }.into()], line)]);
        let added = |axis_rad: f64, _: f64| {
            let number = ((70.0 - axis_rad.to_degrees()) / 45.0).round() as usize;
            0.1 * of_play[number]
        };
        let turned_deg = wrap_180_deg(fix(&ErrorModel::default(), added).azimuth_deg - 70.0);
        assert!(turned_deg.abs() > 0.5, "{turned_deg}");
        let with = fix(&model(effect, &[0.1]), added);
        assert!(wrap_180_deg(with.azimuth_deg - 70.0).abs() < 0.01, "{}", with.azimuth_deg);
        assert!((with.amplitude_deg_h / NORTH_DEG_H - 1.0).abs() < 1e-4, "{}", with.amplitude_deg_h);
    }

    /// The saturating part of the rate that a low-pass of 30 s has not reached yet, gone through here by the second: the index turns at once, and after five
    /// seconds follows a dwell of 60 s. The solution, which knows the dwells alone, takes it out to a hundredth.
    #[test]
    fn an_effect_that_takes_its_time() {
        let rate = |index_deg: f64| NORTH_DEG_H * libm::cos((70.0 - index_deg).to_radians());
        let (mut low_pass, mut means) = (rate(0.0), Vec::new());
        for index_deg in ORDER {
            let now = rate(index_deg);
            let mut sum = 0.0;
            for second in 1..=65 {
                low_pass += (now - low_pass) * (1.0 - libm::exp(-1.0 / 30.0));
                sum += if second <= 5 { 0.0 } else { libm::tanh((now - low_pass) / 3.0) };
            }
            means.push(sum / 60.0);
        }
        let shape: Shape = Saturation { centre: 0.0, width: 3.0 }.into();
        let memory = dynamics::Memory { tau_s: 30.0 };
        let effect = Effect::new(Port::Rate, &[Factor::new(Rate.into(), &[memory.into()], shape)]);
        let added = |axis_rad: f64, _: f64| 0.3 * means[((70.0 - axis_rad.to_degrees()) / 45.0).round() as usize];
        let turned_deg = wrap_180_deg(fix(&ErrorModel::default(), added).azimuth_deg - 70.0);
        let left_deg = wrap_180_deg(fix(&model(effect, &[0.3]), added).azimuth_deg - 70.0);
        assert!(turned_deg.abs() > 0.5 && left_deg.abs() < 0.01 * turned_deg.abs(), "{turned_deg} {left_deg}");
    }

    /// The gyro reads (1 + s)·rate + 4 °/h with s = 0.05 at the indices 135° and 180° and 0 elsewhere, and the model divides by 1 + s: of the bias
    /// 4/1.05 °/h are left there. The azimuth is 70° and the bias 4 °/h where the dwells say so. Where they do not, the missing 0.1905 °/h change
    /// h cos ψ by 2/8 · 0.1905 · (1 + √½) = 0.0813 and h sin ψ by −2/8 · 0.1905 · √½ = −0.0337 °/h: −0.67° (the drift takes some of it).
    #[test]
    fn a_scale_factor_that_changes_divides_the_bias_too() {
        let dwells = |of_bias: bool| -> Vec<DwellSummary> {
            let each = |(i, index_deg): (u32, f64)| {
                let scale = if index_deg == 135.0 || index_deg == 180.0 { 1.05 } else { 1.0 };
                let raw_deg_h = scale * NORTH_DEG_H * libm::cos((70.0 - index_deg).to_radians()) + 4.0;
                let mut each = dwell(65.0 * f64::from(i), index_deg, raw_deg_h / scale);
                each.carried.set_of_bias(if of_bias { 1.0 / scale - 1.0 } else { 0.0 });
                each
            };
            (0..).zip(ORDER).map(each).collect()
        };
        let fix = |of_bias| solve(&dwells(of_bias), &declared(60.0), &ErrorModel::default()).unwrap();
        assert_azimuth(&fix(true), 70.0);
        assert!((fix(true).bias_deg_h - 4.0).abs() < 1e-6);
        assert!((wrap_180_deg(fix(false).azimuth_deg - 70.0) + 0.67).abs() < 0.25, "{}", fix(false).azimuth_deg);
    }

    /// An index offset known to 0.5° makes the azimuth uncertain by 0.5°; so does a level error of 0.5° that turns with the index at no azimuth: a
    /// constant reading of the forward accelerometer that is 0.01 g too large takes 0.01 · Ω sin φ cos θ from the rate, which at an azimuth of 70° is
    /// 0.01 · 13.02595 · sin 70°/7.5205 = 0.016276 rad = 0.93256°.
    #[test]
    fn what_is_not_certain_of_index_and_level() {
        let without = fix(&ErrorModel::default(), |_, _| 0.0);
        let added_deg = |port: Port, sigma: f64| {
            let mut model = model(Effect::new(port, &[]), &[0.0]);
            model.doubt.directions.push([sigma as f32].into_iter().collect()).unwrap();
            let dwells: Vec<DwellSummary> = (0..)
                .zip(ORDER)
                .map(|(i, index_deg)| {
                    let rate_deg_h = NORTH_DEG_H * libm::cos((70.0 - index_deg).to_radians());
                    let mut each = dwell(65.0 * f64::from(i), index_deg, rate_deg_h);
                    each.carried.set_doubt(port, 0, sigma);
                    each
                })
                .collect();
            let with = solve(&dwells, &declared(60.0), &model).unwrap();
            libm::sqrt(with.sigma_deg * with.sigma_deg - without.sigma_deg * without.sigma_deg)
        };
        assert!((added_deg(Port::Index, 0.5) - 0.5).abs() < 1e-3, "{}", added_deg(Port::Index, 0.5));
        assert!((added_deg(Port::Forward, 0.01) - 0.93256).abs() < 2e-3, "{}", added_deg(Port::Forward, 0.01));
    }
}
