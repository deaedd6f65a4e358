//! Finds the rests, averages them, and says where the next attitude is most needed.
//!
//! An attitude is ten readings of a fifth of a second each, at rest. Directions are judged by the calibration in use.

use heapless::Vec;

use super::guidance::{Guidance, Step};
use super::problem::{GRAVITY_G, MOST_ATTITUDES, Problem, Solved};
use super::refusal::{NoCalibration, Why};
use crate::ellipsoid::LEAST_ATTITUDES;
use crate::ellipsoid::attitude::Attitude;
use crate::ellipsoid::coverage::{Coverage, Direction};
use crate::ellipsoid::{Correction, Entry, Role};
use crate::still::{Block, BlockMean, Rest};

/// With this many, and the sphere covered, it is enough: a quarter of them is held out.
const ENOUGH_ATTITUDES: usize = 20;
/// Coverage of the sphere at which it is enough: the worst direction has 1.4 times the standard deviation of an even cover.
const ENOUGH_COVERAGE: f64 = 0.5;
/// Readings of an attitude, as in the source.
const READINGS: usize = 10;
/// Samples of the accelerometers in a reading: a fifth of a second at 100 Hz.
const SAMPLES: u16 = 20;
/// Noise of such a reading, g: 22.5 µg/√Hz (ADXL355 data sheet, noise density at ± 2 g, typical) over the 2.5 Hz that a mean
/// of a fifth of a second lets through.
const READING_NOISE_G: f64 = 36e-6;
/// Scatter of a sample about its reading that is still noise, g. Many times that of the sensor: a bench that shakes a
/// little will do.
const STILL_G: f64 = 0.003;
/// |f| at rest is within this of one g, before any calibration.
const MOST_OFF_G: f64 = 0.2;
/// Cosine of the angle by which attitudes must differ: 15°.
const APART: f32 = 0.965_925_8;
/// Samples without a new attitude after which it is given up: 2 minutes.
const PATIENCE: u16 = 12_000;
/// Samples in a row that may fail: 1 s.
const FAILURES: u16 = 100;

/// What a sample led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    GoOn,
    /// The attitudes are complete.
    Enough,
    /// It leads nowhere.
    Hopeless(NoCalibration),
}

/// Attitudes so far.
#[derive(Clone, Debug)]
pub struct Collection {
    problem: Problem,
    /// Which way of the instrument is up in each, unit vectors.
    directions: Vec<[f32; 3], MOST_ATTITUDES>,
    samples: BlockMean,
    rest: Rest,
    readings: Vec<[f64; 3], READINGS>,
    coverage: f64,
    next: Direction,
    /// The rest that goes on has been dealt with.
    done: bool,
    /// Since the last attitude: samples, and whether there was a rest.
    waited: u16,
    rested: bool,
    /// Samples in a row that failed.
    failed: u16,
}

/// Takes guidance to the operator.
type Sink<'a> = &'a mut dyn FnMut(Guidance);

impl Default for Collection {
    fn default() -> Self {
        Self {
            problem: Problem::default(),
            directions: Vec::new(),
            samples: BlockMean::new(SAMPLES),
            rest: Rest::default(),
            readings: Vec::new(),
            coverage: 0.0,
            next: Direction([0, 0, 1]),
            done: false,
            waited: 0,
            rested: false,
            failed: 0,
        }
    }
}

impl Collection {
    /// Begins anew with none; the calibration in use judges directions.
    pub fn begin(&mut self, in_use: Correction) {
        let none = Coverage::of(core::iter::empty());
        self.problem.in_use = in_use;
        self.problem.entries.clear();
        self.directions.clear();
        self.samples = BlockMean::new(SAMPLES);
        self.rest = Rest::default();
        self.readings.clear();
        (self.coverage, self.next) = (none.least(), none.worst());
        (self.done, self.rested) = (false, false);
        (self.waited, self.failed) = (0, 0);
    }

    /// Takes a reading of the accelerometers as they give it, g; `None`: it failed.
    pub fn push(&mut self, reading_g: Option<[f64; 3]>, sink: Sink) -> Progress {
        self.waited = self.waited.saturating_add(1);
        if self.waited > PATIENCE {
            return Progress::Hopeless(self.impatience());
        }
        let Some(raw_g) = reading_g else {
            self.failed = self.failed.saturating_add(1);
            self.samples.clear();
            let given_up = self.failed >= FAILURES;
            return if given_up { Progress::Hopeless(Why::AccelerometerFailed.into()) } else { Progress::GoOn };
        };
        self.failed = 0;
        match self.samples.push(raw_g) {
            Some(block) => self.block(&block, sink),
            None => Progress::GoOn,
        }
    }

    /// Where the operator stands.
    pub fn guidance(&self, step: Step) -> Guidance {
        let attitudes = u8::try_from(self.problem.entries.len()).unwrap_or(u8::MAX);
        Guidance { step, attitudes, coverage: self.coverage, next: self.next }
    }

    /// Solves for the calibration.
    pub fn solve(&mut self) -> Result<Solved, NoCalibration> {
        self.problem.solve()
    }

    fn block(&mut self, block: &Block, sink: Sink) -> Progress {
        if !self.rest.continues(block, STILL_G) {
            self.moved(sink);
            // What ends one rest may begin the next.
            let _ = self.rest.continues(block, STILL_G);
            return Progress::GoOn;
        }
        // The hand may still be on it in the first reading.
        if self.rest.blocks() == 1 || self.done {
            return Progress::GoOn;
        }
        if self.readings.is_empty() {
            self.rested = true;
            let known = self.is_near(self.direction(block.mean));
            sink(self.guidance(if known { Step::Known } else { Step::Hold }));
            self.done = known;
            if known {
                return Progress::GoOn;
            }
        }
        let _ = self.readings.push(block.mean);
        if !self.readings.is_full() {
            return Progress::GoOn;
        }
        self.done = true;
        self.take(sink)
    }

    /// The rest has ended.
    fn moved(&mut self, sink: Sink) {
        if !self.readings.is_empty() && !self.done {
            sink(self.guidance(Step::Moved));
        }
        self.rest = Rest::default();
        self.readings.clear();
        self.done = false;
    }

    /// The readings are complete.
    fn take(&mut self, sink: Sink) -> Progress {
        let attitude = Attitude::of(&self.readings, READING_NOISE_G, &mut [0.0; READINGS]);
        let is_gravity = |attitude: &Attitude| {
            let off_g = self.problem.in_use.norm(attitude.mean) - GRAVITY_G;
            off_g.abs() <= MOST_OFF_G
        };
        let Some(attitude) = attitude.filter(is_gravity) else {
            sink(self.guidance(Step::NotGravity));
            return Progress::GoOn;
        };
        let _ = self.problem.entries.push(Entry { attitude, role: Role::Fit });
        let _ = self.directions.push(self.direction(attitude.mean));
        self.waited = 0;
        self.rested = false;
        self.look_around();
        sink(self.guidance(Step::Accepted));
        let enough = self.problem.entries.len() >= ENOUGH_ATTITUDES && self.coverage >= ENOUGH_COVERAGE;
        if enough || self.problem.entries.is_full() {
            sink(self.guidance(Step::Solving));
            return Progress::Enough;
        }
        sink(self.guidance(Step::Turn));
        Progress::GoOn
    }

    /// Finds coverage and next direction. The direction known worst is the one whose attitude adds most to what is known of
    /// all nine parameters together: it multiplies the determinant of their information by 1 + d / n (V. V. Fedorov, Theory of
    /// Optimal Experiments, 1972, section 2.5), d and n as in [`Coverage`].
    fn look_around(&mut self) {
        let coverage = Coverage::of(self.directions.iter().map(|direction| direction.map(f64::from)));
        self.coverage = coverage.least();
        self.next = Direction::all()
            .map(|direction| (direction, direction.unit()))
            .filter(|(_, unit)| !self.is_near(unit.map(|part| part as f32)))
            .map(|(direction, unit)| (direction, coverage.towards(unit)))
            .min_by(|(_, a), (_, b)| a.total_cmp(b))
            .map_or(coverage.worst(), |(direction, _)| direction);
    }

    /// Why no attitude came for so long.
    fn impatience(&self) -> NoCalibration {
        if !self.rested {
            Why::MovingThroughout.into()
        } else if self.problem.entries.len() < LEAST_ATTITUDES || self.coverage >= ENOUGH_COVERAGE {
            Why::TooFew.into()
        } else {
            NoCalibration { why: Why::DirectionsMissing, missing: Some(self.next) }
        }
    }

    /// Whether an attitude has been measured in about this direction.
    fn is_near(&self, [x, y, z]: [f32; 3]) -> bool {
        self.directions.iter().any(|[ex, ey, ez]| x * ex + y * ey + z * ez > APART)
    }

    /// Which way of the instrument is up: a unit vector.
    fn direction(&self, raw_g: [f64; 3]) -> [f32; 3] {
        let norm = self.problem.in_use.norm(raw_g);
        self.problem.in_use.apply(raw_g).map(|part| (part / norm) as f32)
    }
}
