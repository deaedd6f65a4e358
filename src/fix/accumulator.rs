//! The one accumulator: seconds and the boundaries of dwells in, the fix out.
//!
//! Whoever runs a fix only says where a dwell begins and ends: [`crate::sequence`] commands a motor, [`crate::instrument::replay`] finds
//! the dwells of a recording or reads them from it. Everything else is done here, once: the error model second by second, the
//! statistics of a dwell, the watch of the temperature, the flags, the solution. Equal seconds and boundaries give equal
//! azimuths, with all digits.

use heapless::Vec;

use super::azimuth_effects::AzimuthEffects;
use super::base_motion;
pub use super::dwell::Outliers;
use super::dwell::{DwellRows, DwellSummary, Row};
pub use super::dwells::Dwells;
use super::index_watch::{Angle, IndexWatch};
use super::noise::Noise;
use super::robust::LEAST_ROWS;
use super::rotation::Rotation;
use super::{Declared, DesignRow, Fix, Unsolvable, doubt, moving_base};
use crate::earth::EarthRate;
use crate::effects::carried::CarriedSums;
use crate::effects::now::RunFacts;
use crate::effects::{Carried, Conditions, Correction, ErrorModel, Evaluator};
use crate::health::{Flag, Flags};
use crate::sensing::gates::Gate;
use crate::sensing::index::Direction;
use crate::sensing::level::{LevelMoments, Specific};
use crate::units::wrap_180_deg;

/// Temperature change during a fix that an error model must cover, K.
const TEMPERATURE_CHANGE_K: f64 = 0.5;
/// Most seconds that wait for the first rate of change; a rate is known after ten.
const HELD: usize = 16;
/// Share of the time at rest below which the index was turning all the time: every second counts at its own angle.
pub const ROTATION_SHARE: f64 = 0.25;

/// Dwells that a doubtful model weighs are kept in parts of this length, seconds: a process of some tens of seconds, or a drift, shows between them. Where
/// there is no room for more, the shortest neighbours are joined.
const PART_S: f64 = 10.0;

/// A second as it was measured, or a row of a recording of another length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Second {
    /// Time, mean rate as the gyro gave it, measured index, temperature, level, further channels.
    pub conditions: Conditions,
    /// First moment of the gyro's angle about the middle of the second, ∫ (t − middle) · rate dt, arcsec · s.
    pub moment_arcsec_s: f64,
    /// Root mean square distance of the gyro's angle within the second from a straight line, arcsec; 0 where nothing finer than the
    /// second was measured.
    pub ripple_arcsec: f64,
    /// First moment of the level accelerometers about the middle of the second, s² by unit of gravity.
    pub level_moment: Specific,
    /// Temperature of the level accelerometers, °C, where they have a thermometer.
    pub level_temp_c: Option<f64>,
    /// Gyro frames that never came or were not valid.
    pub lost_frames: u16,
}

impl Second {
    /// Its end, seconds since switch-on.
    pub fn end_s(&self) -> f64 {
        self.conditions.t_s + 0.5 * self.conditions.seconds
    }
}

/// A second with the error model applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrected {
    pub measured: Second,
    /// The error model in this second.
    pub correction: Correction,
    /// Mean true rate, °/h.
    pub rate_deg_h: f64,
    /// True direction of the index.
    pub index: Option<Direction>,
    /// What the level accelerometers should have read.
    pub level: Option<Specific>,
}

impl Corrected {
    /// The index angle as it was read and by the model; `None` without a reading.
    pub fn angle(&self) -> Option<Angle> {
        Some(Angle { read: self.measured.conditions.index?, by_model: self.index })
    }

    /// The row of the equations that this second is in the solution: `None` without an index angle.
    pub fn design(&self, earth: &EarthRate) -> Option<DesignRow> {
        Some(DesignRow::new(self.index?, self.level, earth))
    }

    /// What those effects of a model that depend on the azimuth add to the rate of this second where the azimuth is this, °/h: [`Self::rate_deg_h`] still
    /// contains it. `before`: where the axis has been, as [`Self::as_dwell`] says. 0 without an index angle.
    pub fn of_azimuth_deg_h(
        &self,
        model: &ErrorModel,
        before: &[DwellSummary],
        earth: &EarthRate,
        azimuth_deg: f64,
    ) -> f64 {
        let (Some(second), Some(index)) = (self.as_dwell(), self.index) else { return 0.0 };
        AzimuthEffects::new(model, before, *earth, azimuth_deg).without_slope().of_dwell(&second, index).0
    }

    /// By what share more of a bias is left in the rate ([`Carried::of_bias`]).
    pub fn of_bias(&self) -> f64 {
        self.correction.carried.of_bias()
    }

    /// As a dwell of its own; `None` without an index angle.
    pub fn as_dwell(&self) -> Option<DwellSummary> {
        Some(DwellSummary { carried: self.correction.carried, ..DwellSummary::moving(&self.row()?) })
    }

    /// As a row of a dwell.
    fn row(&self) -> Option<Row> {
        let Direction { cos, sin } = self.index?;
        let Conditions { t_s, seconds, .. } = self.measured.conditions;
        let Second { moment_arcsec_s, level_moment, .. } = self.measured;
        let level = self.level.map(|mean| LevelMoments { mean, first: level_moment });
        Some(Row { t_s, seconds, cos, sin, rate_deg_h: self.rate_deg_h, moment_arcsec_s, level })
    }
}

/// What became of a second of a dwell.
#[allow(clippy::large_enum_variant)] // taken apart at once
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Taken {
    /// It is in the dwell.
    Collected,
    /// It cannot be used.
    LeftOut,
    /// The index slipped within it.
    Slipped(Slip),
}

/// The index angle changed while the motor stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Index angle before it, degrees in [0°, 360°).
    pub before_deg: f64,
    /// What the dwell says that it ended, if one was under way.
    pub ended: Option<DwellSummary>,
}

/// What the index did in a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Index {
    Rested,
    /// Somehow: of a recording that says no more.
    Moved,
    /// Evenly, in a pass of a continuous rotation.
    Rotated,
}

/// A row whose correction waits for the first rate of change.
#[derive(Clone, Copy, Debug)]
struct Held {
    row: Row,
    carried: Carried,
    scale: f64,
    index: Index,
}

/// Gathers a fix. In the order of time: [`Self::correct`] every second, whatever it is used for, because the error model
/// remembers; [`Self::collect`] those of a dwell, [`Self::end_dwell`] after its last, [`Self::collect_rotating`] those of a continuous rotation,
/// [`Self::between_dwells`] the others; then [`Self::solve`].
#[derive(Clone, Debug)]
pub struct Accumulator<D> {
    declared: Declared,
    evaluator: Evaluator,
    dwells: D,
    /// There was no room for a dwell.
    full: bool,
    rows: DwellRows,
    rotation: Rotation,
    outliers_s: Outliers,
    /// Of the rows of the dwell.
    carried: CarriedSums,
    held: Vec<Held, HELD>,
    watch: IndexWatch,
    /// The index slipped since the last dwell: its angle before.
    slipped_from: Option<Direction>,
    /// Sum of all slips of the fix before the dwell under way, degrees.
    slip_deg: f64,
    /// The last move did not follow its steps.
    doubted: bool,
    /// What the rates of change added to the bias when the last second was collected, °/h.
    rates_deg_h: f64,
    rest_s: f64,
    moving_s: f64,
    temperature_c: Option<(f64, f64)>,
    /// Beginning of the dwell under way, if parts of it are kept.
    parted_s: Option<f64>,
    flags: Flags,
}

impl<D: Dwells> Accumulator<D> {
    /// An accumulator that keeps its dwells in `dwells`, which is empty.
    pub fn new(declared: Declared, mut model: ErrorModel, dwells: D) -> Self {
        let mut accumulator = Self::empty(dwells);
        accumulator.set_up(declared, &mut model);
        accumulator
    }

    /// The same, before anything is declared.
    // Inlined, so that it is made where it stays: copies of it would take tens of kilobytes of a board's stack.
    #[inline(always)]
    pub fn empty(dwells: D) -> Self {
        Self {
            declared: Declared::default(),
            evaluator: Evaluator::empty(),
            dwells,
            full: false,
            rows: DwellRows::default(),
            rotation: Rotation::default(),
            outliers_s: Outliers::new(),
            carried: CarriedSums::default(),
            held: Vec::new(),
            watch: IndexWatch::new(0.0),
            slipped_from: None,
            slip_deg: 0.0,
            doubted: false,
            rates_deg_h: 0.0,
            rest_s: 0.0,
            moving_s: 0.0,
            temperature_c: None,
            parted_s: None,
            flags: Flags::default(),
        }
    }

    /// Takes what is declared, and the model, which it leaves its own for. Nothing was gathered yet.
    pub fn set_up(&mut self, declared: Declared, model: &mut ErrorModel) {
        self.declared = declared;
        self.evaluator.set_up(model);
        self.watch = IndexWatch::new(declared.index_sigma_deg);
        self.restart();
    }

    /// Begins another fix. What the error model remembers is the instrument's and stays.
    pub fn restart(&mut self) {
        self.begin_anew();
        self.watch.restart();
        (self.slipped_from, self.slip_deg, self.doubted) = (None, 0.0, false);
        self.temperature_c = None;
        self.flags = Flags::default();
        if !self.declared.calibrated {
            self.flags.insert(Flag::Uncalibrated);
        }
        if !self.declared.level_calibrated {
            self.flags.insert(Flag::LevelUncalibrated);
        }
    }

    /// Forgets the dwells so far. What was waited for, lost or slipped is held against the fix all the same.
    pub fn begin_anew(&mut self) {
        self.dwells.retain(|_| false);
        self.full = false;
        self.rows.clear();
        self.rotation = Rotation::default();
        self.carried.clear();
        self.held.clear();
        (self.rest_s, self.moving_s) = (0.0, 0.0);
        self.parted_s = None;
    }

    /// What is known of the run as a whole: time of day, rest before it.
    pub fn set_run(&mut self, run: RunFacts) {
        self.evaluator.set_run(run);
    }

    pub fn into_dwells(self) -> D {
        self.dwells
    }

    pub fn declared(&self) -> &Declared {
        &self.declared
    }

    pub fn model(&self) -> &ErrorModel {
        self.evaluator.model()
    }

    /// Few enough frames are missing, and there is an index angle.
    pub fn is_usable(&self, second: &Second) -> bool {
        second.lost_frames <= self.declared.gyro.repairable_frames && second.conditions.index.is_some()
    }

    /// From the next fix on the accelerometers are calibrated, or not.
    pub fn level_is_calibrated(&mut self, calibrated: bool) {
        self.declared.level_calibrated = calibrated;
    }

    /// Takes the next second, used or not; gives it with the error model applied.
    pub fn correct(&mut self, second: &Second) -> Corrected {
        let correction = self.evaluator.second(&second.conditions);
        let index = |measured| self.evaluator.model().true_index(measured).turned_deg(-correction.index_deg);
        Corrected {
            measured: *second,
            correction,
            rate_deg_h: correction.apply(second.conditions.raw_rate_deg_h, 1.0),
            index: second.conditions.index.map(index),
            level: second.conditions.level.map(|read| Specific {
                forward: read.forward - correction.level.forward,
                left: read.left - correction.level.left,
            }),
        }
    }

    /// A second of the dwell that is under way.
    pub fn collect(&mut self, second: &Corrected) -> Taken {
        if let Some(slip) = self.slip(second) {
            return Taken::Slipped(slip);
        }
        if self.take(second, Index::Rested) { Taken::Collected } else { Taken::LeftOut }
    }

    /// A second within which the index moved. It counts only if the index moved nearly all the time.
    pub fn collect_moving(&mut self, second: &Corrected) {
        self.take(second, Index::Moved);
    }

    /// A second of a continuous rotation, in which the index turned evenly. Whether it can be used.
    pub fn collect_rotating(&mut self, second: &Corrected) -> bool {
        self.take(second, Index::Rotated)
    }

    /// A second of no dwell: the index may turn, and come to rest. The slip, if it slipped at rest. (Before the first dwell nobody
    /// knows what the motor does.)
    pub fn between_dwells(&mut self, second: &Corrected) -> Option<Slip> {
        if self.dwells.as_slice().is_empty() && self.rows.is_empty() && self.held.is_empty() {
            return None;
        }
        self.slip(second)
    }

    /// The motor is commanded: from here to its rest the index may move.
    pub fn index_turns(&mut self) {
        self.watch.restart();
    }

    fn slip(&mut self, second: &Corrected) -> Option<Slip> {
        let before = self.watch.push(second.angle()?)?;
        self.flags.insert(Flag::IndexSlip);
        let ended = self.end_dwell();
        self.slipped_from.get_or_insert(before);
        Some(Slip { before_deg: before.deg(), ended })
    }

    /// The dwell that was under way is over: what it says, `None` if nothing of it could be used.
    pub fn end_dwell(&mut self) -> Option<DwellSummary> {
        if self.held.iter().any(|held| held.index == Index::Rested) {
            self.release();
        }
        let last = self.end_part();
        let Some(start_s) = self.parted_s.take() else { return last };
        if last.is_some_and(|last| usize::from(last.degrees_of_freedom) < LEAST_ROWS) {
            self.join_last(start_s);
        }
        let parts = self.dwells.as_slice().iter().filter(|part| part.start_s >= start_s);
        parts.copied().reduce(|dwell, part| dwell.joined(&part))
    }

    /// A part of the dwell that is under way is over, or all of it.
    fn end_part(&mut self) -> Option<DwellSummary> {
        let noise_deg_h = self.least_scatter_deg_h();
        if self.parted_s.is_none() {
            self.outliers_s.clear();
        }
        let summary = match self.evaluator.model().base_motion {
            Some(sensing) => moving_base::summary(self.rows.as_slice(), sensing, noise_deg_h),
            None => {
                let summary = self.rows.summary(noise_deg_h);
                // Of more than there is room for it is known how many there were.
                self.outliers_s.extend(
                    self.rows.outliers_s().iter().copied().take(self.outliers_s.capacity() - self.outliers_s.len()),
                );
                summary
            }
        };
        self.rows.clear();
        let mut summary = summary?;
        if let Some(before) = self.slipped_from.take() {
            self.slip_deg += wrap_180_deg(summary.index_deg() - before.deg());
        }
        summary.slip_deg = self.slip_deg as f32;
        summary.doubted = core::mem::take(&mut self.doubted);
        summary.carried = self.carried.take();
        self.keep(summary);
        Some(summary)
    }

    /// Whether dwells are kept in parts. Noise of the angle has none: what one reads too much the next one lacks.
    fn in_parts(&self) -> bool {
        let model = self.evaluator.model();
        doubt::is_any(&model.doubt) && model.base_motion.is_none() && self.declared.gyro.angle_noise_arcsec == 0.0
    }

    /// Whether the rows so far, which end with this one, are a part of their dwell that is kept by itself: long enough, and as many as tell a
    /// robust mean.
    fn is_part(&self, last: &Row) -> bool {
        let rows = self.rows.as_slice();
        let length_s = |first: &Row| last.t_s - first.t_s + 0.5 * (first.seconds + last.seconds);
        rows.len() >= LEAST_ROWS
            && rows.first().is_some_and(|first| length_s(first) > 0.999 * PART_S)
            && self.in_parts()
    }

    /// Middles of the seconds that were left out of the last dwell as outliers, seconds.
    pub fn outliers_s(&self) -> &Outliers {
        &self.outliers_s
    }

    /// A gate had to wait, or the index is to be doubted.
    pub fn waited_at(&mut self, gate: Gate) {
        self.doubted |= gate == Gate::Index;
        self.flags.insert(match gate {
            Gate::Disturbance => Flag::Disturbed,
            Gate::Jitter => Flag::Jitter,
            Gate::Index => Flag::IndexSlip,
        });
    }

    /// The azimuth of all dwells so far; of one that has not ended nothing enters.
    pub fn solve(&mut self) -> Result<Fix, Unsolvable> {
        self.release();
        if self.full {
            return Err(Unsolvable::TooManyDwells);
        }
        if self.rotation.is_any() {
            self.rotation.take_out_turning(&mut self.dwells);
        }
        if self.rest_s >= ROTATION_SHARE * (self.rest_s + self.moving_s) {
            self.dwells.retain(|dwell| !dwell.moving);
        }
        self.rows.clear();
        let mut fix = super::solve(self.dwells.as_slice(), &self.declared, self.evaluator.model())?;
        fix.flags = fix.flags.union(self.flags);
        if let Some(tilting_deg) = self.rotation.tilting_deg(&self.declared.earth) {
            fix.sigma_deg = libm::hypot(fix.sigma_deg, tilting_deg);
            fix.flags.insert(Flag::BaseMotion);
        }
        Ok(fix)
    }

    /// Azimuth of too few dwells for a solution, degrees: to turn the axis nearly east.
    pub fn coarse_azimuth_deg(&self) -> Option<f64> {
        super::coarse_azimuth_deg(self.dwells.as_slice(), &self.declared.earth)
    }

    /// Noise of a second, °/h, as the dwells so far show it and a solution will reckon with it, at least the declared one; and whether the
    /// levels changed by more than their noise.
    pub fn seen(&self) -> (f64, bool) {
        let (dwells, gyro) = (self.dwells.as_slice(), &self.declared.gyro);
        let noise = Noise::with(self.evaluator.model(), dwells.iter(), gyro, || None);
        let noise_deg_h = noise.map_or(gyro.noise_deg_h(), |noise| libm::sqrt(noise.variance * noise.widening));
        (noise_deg_h, base_motion::levels_changed(dwells))
    }

    fn take(&mut self, second: &Corrected, index: Index) -> bool {
        if second.measured.lost_frames > 0 {
            self.flags.insert(Flag::FramesLost);
        }
        let is_usable = self.is_usable(&second.measured) && !second.correction.unknown;
        let Some(row) = second.row().filter(|_| is_usable) else { return false };
        let rested = index == Index::Rested;
        *(if rested { &mut self.rest_s } else { &mut self.moving_s }) += row.seconds;
        let temp_c = second.measured.conditions.temp_c;
        if let Some(temp_c) = temp_c {
            self.watch_temperature(temp_c);
        }
        // The accelerometers drift with their own temperature; the gyro's stands for it where they have no thermometer.
        let of_levels_c = row.level.and(second.measured.level_temp_c.or(temp_c));
        if let Some(temp_c) = of_levels_c.filter(|_| rested) {
            self.rows.push_temperature(row.t_s, temp_c);
        }
        self.rates_deg_h = self.evaluator.rates_deg_h();
        let carried = second.correction.carried;
        let held = Held { row, carried, scale: second.correction.scale, index };
        if second.correction.waiting && self.held.push(held).is_ok() {
            return true;
        }
        self.release();
        self.push(row, &carried, index);
        true
    }

    /// Takes the seconds that waited, corrected by the latest rates of change.
    fn release(&mut self) {
        for i in 0..self.held.len() {
            let Some(&Held { mut row, carried, scale, index }) = self.held.get(i) else { break };
            row.rate_deg_h -= self.rates_deg_h / scale;
            self.push(row, &carried, index);
        }
        self.held.clear();
    }

    fn push(&mut self, row: Row, carried: &Carried, index: Index) {
        match index {
            Index::Rested => {
                self.carried.add(carried, row.seconds);
                self.rows.push(row, self.least_scatter_deg_h());
                if self.is_part(&row) {
                    let part = self.end_part();
                    self.parted_s = self.parted_s.or(part.map(|part| part.start_s));
                }
            }
            Index::Moved => self.keep(DwellSummary { carried: *carried, ..DwellSummary::moving(&row) }),
            Index::Rotated => self.full |= !self.rotation.push(row, *carried, &mut self.dwells),
        }
    }

    /// The smallest scale by which outliers are judged, °/h: the declared noise; where the model follows the rate behind a dynamics, the horizontal Earth
    /// rate, because that part is not yet taken out.
    fn least_scatter_deg_h(&self) -> f64 {
        let noise_deg_h = self.declared.gyro.noise_deg_h();
        if self.evaluator.model().remembers_rate() {
            noise_deg_h.max(self.declared.earth.north_deg_h)
        } else {
            noise_deg_h
        }
    }

    fn keep(&mut self, dwell: DwellSummary) {
        if self.in_parts() && self.dwells.as_slice().iter().filter(|dwell| !dwell.moving).count() >= doubt::MOST {
            self.join_shortest();
        }
        self.full |= !self.dwells.push(dwell);
    }

    /// Joins the last part, which is too short to stand alone, to the one before it of the dwell that began at this time.
    fn join_last(&mut self, start_s: f64) {
        if let [before @ .., own, last] = self.dwells.as_slice()
            && own.start_s >= start_s
            && own.goes_on_in(last)
        {
            self.dwells.join_next(before.len());
        }
    }

    /// Makes room: joins the two neighbouring parts of a dwell that are the shortest together.
    fn join_shortest(&mut self) {
        let pairs = self.dwells.as_slice().windows(2).enumerate().filter_map(|(number, pair)| match pair {
            [own, next] if own.goes_on_in(next) && self.parted_s != Some(next.start_s) => {
                Some((own.seconds + next.seconds, number))
            }
            _ => None,
        });
        if let Some((_, number)) = pairs.min_by(|(a, _), (b, _)| a.total_cmp(b)) {
            self.dwells.join_next(number);
        }
    }

    fn watch_temperature(&mut self, temp_c: f64) {
        let (low_c, high_c) = self.temperature_c.unwrap_or((temp_c, temp_c));
        let (low_c, high_c) = (low_c.min(temp_c), high_c.max(temp_c));
        self.temperature_c = Some((low_c, high_c));
        if high_c - low_c > TEMPERATURE_CHANGE_K && !self.evaluator.model().covers_temperature() {
            self.flags.insert(Flag::Temperature);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::effects::channel::ChannelName;
    use crate::effects::effect::{Effect, Port};
    use crate::effects::factor::Factor;
    use crate::effects::{dynamics, shape, signal};
    use crate::fix::tests::{declared, normal};

    /// Ω cos 60°, °/h.
    const NORTH_DEG_H: f64 = 7.5205335;

    fn empty(declared: Declared, model: ErrorModel) -> Accumulator<Vec<DwellSummary>> {
        Accumulator::new(declared, model, Vec::new())
    }

    /// Four positions at azimuth 90° while the bias drifts by 6 °/h an hour, so that it changes by 0.1 °/h in a dwell of a minute; the dwells, as
    /// they end.
    fn turn(accumulator: &mut Accumulator<Vec<DwellSummary>>, seconds: u16) -> Vec<DwellSummary> {
        let (mut state, mut t_s, mut ended) = (5, 0.0, Vec::new());
        for index_deg in [0.0, 90.0, 180.0, 270.0] {
            for _ in 0..seconds {
                let rate = NORTH_DEG_H * libm::cos(f64::to_radians(90.0 - index_deg)) + 6.0 * t_s / 3600.0;
                let conditions = Conditions {
                    t_s: t_s + 0.5,
                    raw_rate_deg_h: rate + 0.01 * normal(&mut state),
                    index: Some(Direction::of_deg(index_deg)),
                    ..Conditions::default()
                };
                let second = accumulator.correct(&Second { conditions, ..Second::default() });
                assert_eq!(accumulator.collect(&second), Taken::Collected);
                t_s += 1.0;
            }
            ended.extend(accumulator.end_dwell());
            accumulator.index_turns();
            t_s += 5.0;
        }
        ended
    }

    /// The fix of these, and what the accumulator keeps of them.
    fn drifting(model: ErrorModel, seconds: u16) -> (Fix, Vec<DwellSummary>, Vec<DwellSummary>) {
        let mut accumulator = empty(declared(60.0), model);
        let ended = turn(&mut accumulator, seconds);
        (accumulator.solve().unwrap(), accumulator.dwells, ended)
    }

    /// Two hundredths of the rate itself: at azimuth 90° and index 90° the axis points north, and 0.02 · 7.52053 °/h are added, at index 0° it points
    /// east, and nothing is. The rate of the second contains it.
    #[test]
    fn what_depends_on_the_azimuth_by_the_second() {
        let line: shape::Shape = shape::Linear { reference: 0.0, scale: 1.0 }.into();
        let factors = [Factor::new(signal::Rate.into(), &[], line)];
        let mut model = ErrorModel::default();
        model
            .effects
            .push(Effect { weights: [0.02].into_iter().collect(), ..Effect::new(Port::Rate, &factors) })
            .unwrap();
        let mut accumulator = Accumulator::new(declared(60.0), model.clone(), Vec::<DwellSummary>::new());
        let earth = crate::earth::earth_rate(60.0).unwrap();
        let mut at = |index_deg: f64| {
            let index = Some(Direction::of_deg(index_deg));
            let conditions = Conditions { raw_rate_deg_h: 1.0, index, ..Conditions::default() };
            let second = accumulator.correct(&Second { conditions, ..Second::default() });
            assert_eq!(second.rate_deg_h, 1.0);
            second.of_azimuth_deg_h(&model, &[], &earth, 90.0)
        };
        assert!(at(0.0).abs() < 1e-6);
        assert!((at(90.0) - 0.150411).abs() < 1e-6);
    }

    fn doubtful() -> ErrorModel {
        let mut model = ErrorModel::default();
        model.doubt.directions.push(heapless::Vec::new()).unwrap();
        model
    }

    /// By the dwells' means alone the drift would turn the azimuth: of a minute's dwells the means at 0° and 180° are 130 s apart, 0.217 °/h, which is
    /// half of that over h, 0.83°.
    #[test]
    fn a_drift_is_seen_beside_a_doubtful_model() {
        for model in [ErrorModel::default(), doubtful()] {
            let (fix, ..) = drifting(model, 60);
            assert!(fix.flags.contains(Flag::Drift), "{fix:?}");
            assert!(wrap_180_deg(fix.azimuth_deg - 90.0).abs() < 0.25, "{fix:?}");
        }
    }

    /// 2 °/h by K/s of a temperature that rises by 0.5 K a second, 1 °/h: nobody knows in the first second, which is left out, and the bias of all others is
    /// free of it.
    #[test]
    fn a_second_without_a_rate_of_change_yet_is_left_out() {
        let temperature = signal::Channel { name: ChannelName::new("temp_c").unwrap() };
        let line = shape::Linear { reference: 0.0, scale: 1.0 };
        let factor = Factor::new(temperature.into(), &[dynamics::Rate { tau_s: 20.0 }.into()], line.into());
        let mut effect = Effect::new(Port::Rate, &[factor]);
        effect.weights = [2.0].into_iter().collect();
        let mut model = ErrorModel::default();
        model.effects.push(effect).unwrap();
        let mut accumulator = Accumulator::new(declared(60.0), model, Vec::<DwellSummary>::new());
        let taken = |i: u8| {
            let (t_s, index) = (f64::from(i), Some(Direction::of_deg(0.0)));
            let temp_c = Some(20.0 + 0.5 * t_s);
            let conditions = Conditions { t_s, raw_rate_deg_h: 4.0, index, temp_c, ..Conditions::default() };
            let second = accumulator.correct(&Second { conditions, ..Second::default() });
            accumulator.collect(&second)
        };
        let taken: Vec<Taken> = (0..10).map(taken).collect();
        assert_eq!(taken, [vec![Taken::LeftOut], vec![Taken::Collected; 9]].concat());
        let dwell = accumulator.end_dwell().unwrap();
        assert!(dwell.seconds == 9.0 && (dwell.rate.mean - 3.0).abs() < 1e-6, "{dwell:?}");
    }

    /// Which of these flags a fix has that is made now.
    fn flagged<const N: usize>(accumulator: &mut Accumulator<Vec<DwellSummary>>, flags: [Flag; N]) -> [bool; N] {
        turn(accumulator, 60);
        let fix = accumulator.solve().unwrap();
        flags.map(|flag| fix.flags.contains(flag))
    }

    /// What is held against a fix is kept where its dwells are begun anew, and goes with the next fix.
    #[test]
    fn flags_of_a_fix_are_its_own() {
        let flags = [Flag::FramesLost, Flag::Disturbed, Flag::Jitter];
        let mut accumulator = empty(declared(60.0), ErrorModel::default());
        let conditions = Conditions { index: Some(Direction::of_deg(0.0)), ..Conditions::default() };
        let lossy = accumulator.correct(&Second { conditions, lost_frames: 1, ..Second::default() });
        assert_eq!(accumulator.collect(&lossy), Taken::Collected);
        [Gate::Disturbance, Gate::Jitter].into_iter().for_each(|gate| accumulator.waited_at(gate));
        accumulator.begin_anew();
        assert_eq!(flagged(&mut accumulator, flags), [true; 3]);
        accumulator.restart();
        assert_eq!(flagged(&mut accumulator, flags), [false; 3]);
    }

    /// What is not calibrated is said of every fix; a calibration of the accelerometers holds from the next one on.
    #[test]
    fn what_is_not_calibrated_is_said_of_every_fix() {
        let flags = [Flag::Uncalibrated, Flag::LevelUncalibrated];
        let declared = Declared { calibrated: false, level_calibrated: false, ..declared(60.0) };
        let mut accumulator = empty(declared, ErrorModel::default());
        assert_eq!(flagged(&mut accumulator, flags), [true, true]);
        accumulator.restart();
        assert_eq!(flagged(&mut accumulator, flags), [true, true]);
        accumulator.level_is_calibrated(true);
        accumulator.restart();
        assert_eq!(flagged(&mut accumulator, flags), [true, false]);
    }

    /// Of 54 s there are five parts of ten seconds, the last with the four that are left; whoever hears of a dwell hears of all of it. Dwells of ten minutes
    /// have as many parts as there is room for, of about the same length.
    #[test]
    fn dwells_are_kept_in_parts() {
        let (_, parts, ended) = drifting(doubtful(), 54);
        let lengths: Vec<f64> = parts.iter().map(|part| part.seconds).collect();
        assert_eq!(lengths, [10.0, 10.0, 10.0, 10.0, 14.0].repeat(4));
        assert!(ended.iter().all(|dwell| dwell.seconds == 54.0 && dwell.degrees_of_freedom == 52), "{ended:?}");
        let (_, parts, ended) = drifting(doubtful(), 600);
        assert_eq!((parts.len(), ended.len()), (doubt::MOST, 4));
        assert_eq!(parts.iter().map(|part| part.seconds).sum::<f64>(), 2400.0);
        let longest = parts.iter().map(|part| part.seconds).fold(0.0, f64::max);
        assert!(longest <= 240.0, "{longest}");
        let (_, whole, _) = drifting(ErrorModel::default(), 600);
        assert_eq!(whole.len(), 4);
    }
}
