//! Aided navigation: an error-state filter of 35 states, 47 with an electrostatic gyro, with full feedback; its covariance is kept as
//! U·D·Uᵀ.
//!
//! Increments of the block go in at their own rate; readings of whatever aids are taken in at their own times, each judged by
//! its innovation. The errors that the filter finds are fed back at once, so that its error estimate is always zero between
//! readings. States: [`state`]; equations: [`transition`]; readings: [`measurement`]; the electrostatic
//! gyro: `electrostatic`; covariance: [`ud`].

pub mod block;
pub mod measurement;
pub mod navigation;
pub mod state;
pub mod transition;

mod ambiguity;
mod electrostatic;
#[cfg(test)]
mod tests;

use libm::{atan2, cos, exp, sin, sqrt};
use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

use crate::coning::{Increment, LONGEST_SAMPLE_S};
use crate::ud::{self, Ud};
use block::BlockErrors;
use electrostatic::Electrostatic;
use measurement::{Measurement, Source};
use navigation::Navigation;
use quantities::earth::POLE_LIMIT_DEG;
use quantities::units::{DEG_PER_RAD, RAD_PER_DEG, wrap_360_deg};
use state::{
    ACCELEROMETER, AIDED, AMBIGUITY, ATTITUDE, BASELINE, CURRENT, Errors, LEAD, LOG_SCALE, MARKOV, ORTHOGONALITY,
    OTHERS, PACKED, PHASES, POSITION, RHUMB, RUN_TO_RUN, SCALE, STATES, VELOCITY,
};
use transition::Interval;

/// Readings further from what is expected than this many standard deviations are outliers: one good one in 1.7 million.
pub const GATE_SIGMAS: f64 = 5.0;
/// Longest interval over which the covariance is moved at once, s.
const LONGEST_INTERVAL_S: f64 = 1.0;
/// Increments further apart than this are not bridged, s.
const LONGEST_GAP_S: f64 = 1.0;

/// The heading's error changes within some two minutes, by its drift and by corrections, s.
///
/// In the equations every change of the heading turns the accelerometers' bias, which tells bias from tilt; a change that is
/// none does not. A filter that takes it for one claims tilts of 0.02° that are known to 0.07° (simulated at a mooring without
/// modulation: NEES 3.7 after 4 h; with this noise 0.96).
const HEADING_ERROR_S: f64 = 120.0;

/// What aids, and so which readings are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// On a stand: it does not move, its place and heading are surveyed.
    Stand,
    /// Satellites, with the antenna baseline, log.
    Aided,
    /// Satellites alone while the ship manoeuvres: the heading from turns and accelerations.
    Manoeuvring,
    /// Log and sea level.
    LogOnly,
    /// Log, depth gauge, acoustic fixes, and the heading by an electrostatic gyro.
    Submerged,
}

impl Mode {
    /// Whether readings of a source are taken.
    pub fn takes(self, source: Source) -> bool {
        match self {
            Self::Stand => {
                matches!(source, Source::Velocity | Source::Position | Source::Heading | Source::Electrostatic)
            }
            Self::Aided => source != Source::Acoustic,
            Self::Manoeuvring => matches!(source, Source::Velocity | Source::Position | Source::Height),
            Self::LogOnly => matches!(source, Source::Log | Source::Height),
            Self::Submerged => matches!(
                source,
                Source::Log | Source::Height | Source::Acoustic | Source::Heading | Source::Electrostatic
            ),
        }
    }
}

/// Where antennas are, hull axes from the block, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Installation {
    /// The antenna whose velocity and position are given.
    pub antenna_m: Vector3<f64>,
    /// From it to the second antenna, as measured.
    pub baseline_m: Vector3<f64>,
}

/// Standard deviations at the start, of what is not the block's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartSigmas {
    /// About east and about north, rad.
    pub tilt_rad: f64,
    /// About up, rad.
    pub heading_rad: f64,
    pub velocity_m_s: f64,
    pub position_m: f64,
    /// Current, each direction, and its time constant.
    pub current_m_s: f64,
    pub current_s: f64,
    pub log_scale: f64,
    pub baseline_m: f64,
}

impl StartSigmas {
    /// Levelled to 0.1°, heading to 3°, at rest; 0.3 m/s of current over an hour, log to 1 %, baseline to 1 cm.
    pub const USUAL: Self = Self {
        tilt_rad: 0.1 * RAD_PER_DEG,
        heading_rad: 3.0 * RAD_PER_DEG,
        velocity_m_s: 0.1,
        position_m: 5.0,
        current_m_s: 0.3,
        current_s: 3600.0,
        log_scale: 0.01,
        baseline_m: 0.01,
    };
}

/// What the filter has found of the constants and slow processes, SI units; axes as in [`state`].
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates {
    pub markov_rad_s: Vector3<f64>,
    pub run_to_run_rad_s: Vector3<f64>,
    pub scale: Vector3<f64>,
    pub orthogonality_rad: Vector3<f64>,
    pub rhumb_rad_s: Vector2<f64>,
    pub accelerometer_m_s2: Vector3<f64>,
    pub current_m_s: Vector2<f64>,
    pub log_scale: f64,
    pub baseline_m: Vector2<f64>,
    pub ambiguity_m: [f64; PHASES],
}

/// What the block gives in one interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockReading {
    /// Length of the interval, s.
    pub dt_s: f64,
    /// Increments as read.
    pub increment: Increment,
    /// Turn of the block on the hull about the deck normal at the interval's end, counter-clockwise from above, rad.
    pub turn_rad: f64,
}

/// Why a reading could not be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Not a number, or infinite.
    NotANumber,
    /// An interval of no length, or backwards in time.
    Time,
    /// Increments are missing for longer than is bridged: align again.
    Gap,
    /// A standard deviation that is not positive.
    Sigma,
    /// Within a degree of a pole east and north mean nothing.
    NearPole,
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotANumber => write!(f, "the reading holds something that is not a number"),
            Self::Time => write!(f, "the interval has no length or goes back in time"),
            Self::Gap => write!(f, "increments are missing for more than {LONGEST_GAP_S} s; align again"),
            Self::Sigma => write!(f, "the standard deviation of the reading is not positive"),
            Self::NearPole => write!(f, "within {POLE_LIMIT_DEG} degree of a pole there is no heading"),
        }
    }
}

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Taken, with the sum of its normalised squared innovations and their number.
    Taken { normalised_squared: f64, degrees_of_freedom: u32 },
    /// Further from what is expected than the gate: so many standard deviations.
    Rejected { sigmas: f64 },
    /// The mode does not use its source.
    Ignored,
    /// It says nothing of the errors: a velocity whose interval did not begin at the last mark, an electrostatic gyro's direction without
    /// that gyro, phases of no satellites.
    Silent,
}

/// Counters of one source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SourceHealth {
    /// Readings taken.
    pub taken: u32,
    /// Readings rejected by their innovation.
    pub rejected: u32,
    /// Rejected without a taken one since: a source that disagrees for long is wrong, or the filter is.
    pub rejected_in_a_row: u32,
    /// Readings that the mode does not use.
    pub ignored: u32,
    /// Readings that could not be used at all.
    pub refused: u32,
    /// Interruptions ([`Source::outage_s`]) that ended.
    pub outages: u32,
    /// Sum of the normalised squared innovations of those taken, and its degrees of freedom.
    pub normalised_squared: f64,
    pub degrees_of_freedom: u32,
    last_s: Option<f64>,
}

/// Where the interval of a velocity began.
#[derive(Clone, Debug)]
struct Mark {
    elapsed_s: f64,
    displacement_m: Vector3<f64>,
    lever_m: Vector3<f64>,
}

/// Heading of the hull with its standard deviation; never one without the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// Clockwise from true north, 0 … 360°.
    pub heading_deg: f64,
    /// One standard deviation.
    pub sigma_deg: f64,
}

/// The filter.
#[derive(Clone, Debug)]
pub struct Filter {
    mode: Mode,
    block: BlockErrors,
    installation: Installation,
    current_m_s: f64,
    current_s: f64,
    navigation: Navigation,
    estimates: Estimates,
    covariance: Ud<STATES, PACKED>,
    turn_rad: f64,
    time_s: f64,
    interval: Interval,
    mark: Mark,
    /// Rate of the velocity errors by the errors, over the last interval.
    velocity_rate: SMatrix<f64, 3, STATES>,
    lines: [ambiguity::Line; PHASES],
    electrostatic: Option<Electrostatic>,
    sources: [SourceHealth; Source::ALL.len()],
    bridged_gaps: u32,
    last_reading: Option<BlockReading>,
}

fn about_deck_normal(turn_rad: f64) -> Matrix3<f64> {
    let (s, c) = (sin(turn_rad), cos(turn_rad));
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

impl Filter {
    /// Starts where `navigation` is (attitude of the block, which is turned on the hull by `turn_rad`).
    pub fn new(
        navigation: Navigation,
        turn_rad: f64,
        block: BlockErrors,
        start: &StartSigmas,
        installation: Installation,
        mode: Mode,
    ) -> Result<Self, Refusal> {
        near_pole(&navigation)?;
        let mut sigmas = Errors::zeros();
        let mut put = |first: usize, count: usize, sigma: f64| sigmas.rows_mut(first, count).fill(sigma);
        put(ATTITUDE, 2, start.tilt_rad);
        put(ATTITUDE + 2, 1, start.heading_rad);
        put(VELOCITY, 3, start.velocity_m_s);
        put(POSITION, 3, start.position_m);
        put(MARKOV, 3, block.gyro_markov_rad_s);
        put(CURRENT, 2, start.current_m_s);
        put(RUN_TO_RUN, 3, block.gyro_run_to_run_rad_s);
        put(SCALE, 3, block.gyro_scale);
        put(ORTHOGONALITY, 3, block.orthogonality_rad);
        put(RHUMB, 2, block.rhumb_rad_s);
        put(ACCELEROMETER, 3, block.accelerometer_bias_m_s2);
        put(LOG_SCALE, 1, start.log_scale);
        put(BASELINE, 2, start.baseline_m);
        let hull = navigation.attitude * about_deck_normal(turn_rad).transpose();
        let lever_m = hull * installation.antenna_m;
        let mut covariance = Ud::diagonal(&sigmas);
        covariance.use_first(AIDED);
        Ok(Self {
            mode,
            block,
            installation,
            current_m_s: start.current_m_s,
            current_s: start.current_s,
            navigation,
            estimates: Estimates {
                markov_rad_s: Vector3::zeros(),
                run_to_run_rad_s: Vector3::zeros(),
                scale: Vector3::zeros(),
                orthogonality_rad: Vector3::zeros(),
                rhumb_rad_s: Vector2::zeros(),
                accelerometer_m_s2: Vector3::zeros(),
                current_m_s: Vector2::zeros(),
                log_scale: 0.0,
                baseline_m: Vector2::zeros(),
                ambiguity_m: [0.0; PHASES],
            },
            covariance,
            turn_rad,
            time_s: 0.0,
            interval: Interval::empty(),
            mark: Mark { elapsed_s: 0.0, displacement_m: Vector3::zeros(), lever_m },
            velocity_rate: SMatrix::zeros(),
            lines: [ambiguity::Line::default(); PHASES],
            electrostatic: None,
            sources: [SourceHealth::default(); Source::ALL.len()],
            bridged_gaps: 0,
            last_reading: None,
        })
    }

    /// Other readings are taken from now on.
    pub fn set_mode(&mut self, mode: Mode) {
        self.mode = mode;
    }

    /// One interval of the block.
    pub fn advance(&mut self, reading: &BlockReading) -> Result<(), Refusal> {
        let (dt_s, increment) = (reading.dt_s, &reading.increment);
        let finite = increment.angle_rad.iter().chain(increment.velocity_m_s.iter()).all(|value| value.is_finite());
        if !(finite && reading.turn_rad.is_finite()) {
            return Err(Refusal::NotANumber);
        }
        if !(dt_s > 0.0 && dt_s <= LONGEST_SAMPLE_S) {
            return Err(Refusal::Time);
        }
        near_pole(&self.navigation)?;
        let hull_before = self.hull();
        let compensated = self.compensated(reading);
        let place = self.navigation.place();
        let before = self.navigation.velocity_m_s;
        let block_before = self.navigation.attitude;
        let force = self.navigation.advance(&place, dt_s, compensated);
        self.turn_rad = reading.turn_rad;
        let block = 0.5 * (block_before + self.navigation.attitude);
        let hull = 0.5 * (hull_before + self.hull());
        self.interval.add(dt_s, &block, &hull, &compensated.angle_rad, &force);
        self.mark.elapsed_s += dt_s;
        self.mark.displacement_m += 0.5 * (before + self.navigation.velocity_m_s) * dt_s;
        self.time_s += dt_s;
        self.last_reading = Some(*reading);
        if self.interval.dt_s >= LONGEST_INTERVAL_S - 0.5 * dt_s {
            self.close_interval();
        }
        Ok(())
    }

    /// Increments are missing for `gap_s`: the last rates are held on, and the covariance pays for what may have happened,
    /// turns of `motion_rad_s` and accelerations of `motion_m_s2` (standard deviations over the gap).
    pub fn bridge(&mut self, gap_s: f64, motion_rad_s: f64, motion_m_s2: f64) -> Result<(), Refusal> {
        if !(gap_s > 0.0 && gap_s <= LONGEST_GAP_S) {
            return Err(Refusal::Gap);
        }
        let last = self.last_reading.ok_or(Refusal::Gap)?;
        let stretch = gap_s / last.dt_s;
        let increment = Increment {
            angle_rad: last.increment.angle_rad * stretch,
            velocity_m_s: last.increment.velocity_m_s * stretch,
        };
        self.advance(&BlockReading { dt_s: gap_s, increment, turn_rad: last.turn_rad })?;
        self.doubt(motion_rad_s * gap_s, motion_m_s2 * gap_s);
        for axis in 0..3 {
            let moved = 0.5 * motion_m_s2 * gap_s * gap_s;
            self.covariance.add_noise(POSITION + axis, moved * moved);
        }
        self.bridged_gaps += 1;
        Ok(())
    }

    /// Increments that were just taken are not to be trusted, saturated ones for example: standard deviations of the angle and of the
    /// velocity that they may be wrong by, about and along each axis.
    pub fn doubt(&mut self, angle_rad: f64, velocity_m_s: f64) {
        self.close_interval();
        for axis in 0..3 {
            self.covariance.add_noise(ATTITUDE + axis, angle_rad * angle_rad);
            self.covariance.add_noise(VELOCITY + axis, velocity_m_s * velocity_m_s);
        }
    }

    /// The next velocity reading covers the time from here on.
    pub fn mark(&mut self) {
        let lever_m = self.hull() * self.installation.antenna_m;
        self.mark = Mark { elapsed_s: 0.0, displacement_m: Vector3::zeros(), lever_m };
    }

    /// Takes a reading that belongs to now (or has its age).
    pub fn measure(&mut self, measurement: &Measurement) -> Result<Outcome, Refusal> {
        let source = measurement.source();
        if !self.mode.takes(source) {
            self.health_mut(source, |health| health.ignored += 1);
            return Ok(Outcome::Ignored);
        }
        self.close_interval();
        match measurement {
            Measurement::Phases { differences, .. } => self.follow(differences),
            Measurement::PickOff(reading) => self.follow_sensor(reading.sensor),
            _ => {}
        }
        let rows = self.rows(measurement);
        if source == Source::Velocity {
            self.mark();
        }
        if rows.iter().all(Option::is_none) {
            return Ok(Outcome::Silent);
        }
        if rows.iter().flatten().any(|row| !(row.value.is_finite() && row.h.iter().all(|h| h.is_finite()))) {
            self.health_mut(source, |health| health.refused += 1);
            return Err(Refusal::NotANumber);
        }
        if rows.iter().flatten().any(|row| !(row.variance > 0.0 && row.variance.is_finite())) {
            self.health_mut(source, |health| health.refused += 1);
            return Err(Refusal::Sigma);
        }
        let outcome = self.take(&rows, source == Source::Phase);
        let time_s = self.time_s;
        self.health_mut(source, |health| match outcome {
            Outcome::Taken { normalised_squared, degrees_of_freedom } => {
                health.taken += 1;
                health.rejected_in_a_row = 0;
                health.normalised_squared += normalised_squared;
                health.degrees_of_freedom += degrees_of_freedom;
                health.outages += u32::from(health.last_s.is_some_and(|last| time_s - last > source.outage_s()));
                health.last_s = Some(time_s);
            }
            Outcome::Rejected { .. } => {
                health.rejected += 1;
                health.rejected_in_a_row += 1;
            }
            Outcome::Ignored | Outcome::Silent => {}
        });
        if source == Source::Phase {
            self.resolve();
        }
        Ok(outcome)
    }

    /// Judges the rows and takes in the good ones; without `each`, one bad row condemns all.
    fn take(&mut self, rows: &measurement::Rows, each: bool) -> Outcome {
        let limit = GATE_SIGMAS * GATE_SIGMAS;
        let mut x = Errors::zeros();
        let worst = rows.iter().flatten().fold(0.0, |worst: f64, row| {
            worst.max(self.covariance.innovation(&x, &row.h, row.value, row.variance).normalised_squared())
        });
        let rejected = Outcome::Rejected { sigmas: sqrt(worst) };
        if !each && worst > limit {
            return rejected;
        }
        let (mut normalised_squared, mut degrees_of_freedom) = (0.0, 0);
        for row in rows.iter().flatten() {
            let innovation = self.covariance.innovation(&x, &row.h, row.value, row.variance);
            if each && innovation.normalised_squared() > limit {
                continue;
            }
            self.covariance.update(&mut x, &row.h, row.value, row.variance);
            normalised_squared += innovation.normalised_squared();
            degrees_of_freedom += 1;
        }
        if degrees_of_freedom == 0 {
            return rejected;
        }
        self.feed_back(&x);
        Outcome::Taken { normalised_squared, degrees_of_freedom }
    }

    /// The whole error estimate goes into the navigation and the estimates.
    fn feed_back(&mut self, x: &Errors) {
        let three = |first: usize| x.fixed_rows::<3>(first).into_owned();
        let two = |first: usize| x.fixed_rows::<2>(first).into_owned();
        let place = self.navigation.place();
        let (turn, velocity) = (three(ATTITUDE), three(VELOCITY));
        self.navigation.turn_by(&turn);
        // The attitude had the same error at the mark.
        self.mark.lever_m += turn.cross(&self.mark.lever_m);
        self.navigation.velocity_m_s += velocity;
        self.navigation.move_by(&place, &three(POSITION));
        // What has been travelled since the mark was travelled with the same velocity error.
        self.mark.displacement_m += velocity * self.mark.elapsed_s;
        let estimates = &mut self.estimates;
        estimates.markov_rad_s += three(MARKOV);
        estimates.run_to_run_rad_s += three(RUN_TO_RUN);
        estimates.scale += three(SCALE);
        estimates.orthogonality_rad += three(ORTHOGONALITY);
        estimates.rhumb_rad_s += two(RHUMB);
        estimates.accelerometer_m_s2 += three(ACCELEROMETER);
        estimates.current_m_s += two(CURRENT);
        estimates.log_scale += x[LOG_SCALE];
        estimates.baseline_m += two(BASELINE);
        for (line, ambiguity) in estimates.ambiguity_m.iter_mut().enumerate() {
            *ambiguity += x[AMBIGUITY + line];
        }
        if let Some(gyro) = &mut self.electrostatic {
            gyro.feed_back(x);
        }
    }

    /// How well the horizontal specific force is known, m/s²: tilt and accelerometer bias together.
    fn force_sigma_m_s2(&self) -> f64 {
        let gravity = self.navigation.place().gravity_m_s2;
        let axes = &self.navigation.attitude;
        let variance = |tilt: usize, towards: usize, sign: f64| {
            let mut h: Errors = ud::unit::<STATES>(ATTITUDE + tilt) * (sign * gravity);
            h.fixed_rows_mut::<3>(ACCELEROMETER).copy_from(&-axes.row(towards).transpose());
            self.covariance.variance_of(&h)
        };
        sqrt(variance(1, 0, 1.0) + variance(0, 1, -1.0))
    }

    /// Moves the covariance to now.
    fn close_interval(&mut self) {
        let Some(transition) = self.interval.transition(&self.navigation, &self.block, self.force_sigma_m_s2()) else {
            return;
        };
        self.covariance.lead::<LEAD, OTHERS, { 2 * LEAD }>(&transition.phi, &transition.coupling, &transition.noise);
        let dt_s = transition.dt_s;
        let drift = exp(-dt_s / self.block.gyro_markov_s);
        let current = exp(-dt_s / self.current_s);
        for (first, count, kept, sigma) in
            [(MARKOV, 3, drift, self.block.gyro_markov_rad_s), (CURRENT, 2, current, self.current_m_s)]
        {
            for state in first..first + count {
                self.covariance.decay(state, kept);
                self.covariance.add_noise(state, sigma * sigma * (1.0 - kept * kept));
            }
        }
        // A turn that is not known turns the accelerometers' bias with it: a product of two errors, which the equations lack.
        let turned = self.covariance.variance(ATTITUDE + 2) * 2.0 * dt_s / HEADING_ERROR_S;
        let [x, y] = [0, 1].map(|axis| self.covariance.variance(ACCELEROMETER + axis));
        self.covariance.add_noise(ACCELEROMETER, y * turned);
        self.covariance.add_noise(ACCELEROMETER + 1, x * turned);
        self.advance_electrostatic(dt_s);
        self.estimates.markov_rad_s *= drift;
        self.estimates.current_m_s *= current;
        self.velocity_rate = transition.velocity_rate();
        self.interval = Interval::empty();
    }

    /// The increments without what is known of the block's errors.
    fn compensated(&self, reading: &BlockReading) -> Increment {
        let BlockReading { dt_s, increment: Increment { angle_rad, velocity_m_s }, turn_rad } = *reading;
        let estimates = &self.estimates;
        let rhumb = Vector3::new(estimates.rhumb_rad_s.x, estimates.rhumb_rad_s.y, 0.0);
        let middle = 0.5 * (self.turn_rad + turn_rad);
        let drift = estimates.markov_rad_s + estimates.run_to_run_rad_s + about_deck_normal(-middle) * rhumb;
        let raw = angle_rad - drift * dt_s;
        let skew = &estimates.orthogonality_rad;
        let z = raw.z / (1.0 + estimates.scale.z);
        let y = (raw.y - skew.z * z) / (1.0 + estimates.scale.y);
        let x = (raw.x - skew.x * y - skew.y * z) / (1.0 + estimates.scale.x);
        Increment { angle_rad: Vector3::new(x, y, z), velocity_m_s: velocity_m_s - estimates.accelerometer_m_s2 * dt_s }
    }

    /// Hull axes (X starboard, Y forward, Z up) to east, north, up.
    pub fn hull(&self) -> Matrix3<f64> {
        self.navigation.attitude * about_deck_normal(-self.turn_rad)
    }

    /// Heading of the hull; its sigma covers the filter's own state at this moment.
    pub fn heading(&mut self) -> Heading {
        self.close_interval();
        let bow = self.hull().column(1).into_owned();
        let level_2 = (bow.x * bow.x + bow.y * bow.y).max(1e-6);
        let mut h = Errors::zeros();
        h.fixed_rows_mut::<3>(ATTITUDE).copy_from(&(Vector3::new(bow.x * bow.z, bow.y * bow.z, -level_2) / level_2));
        Heading {
            heading_deg: wrap_360_deg(atan2(bow.x, bow.y) * DEG_PER_RAD),
            sigma_deg: sqrt(self.covariance.variance_of(&h)) * DEG_PER_RAD,
        }
    }

    /// Where the block is and how it moves.
    pub fn navigation(&self) -> &Navigation {
        &self.navigation
    }

    /// What has been found of the constants.
    pub fn estimates(&self) -> &Estimates {
        &self.estimates
    }

    /// Standard deviation of one error state of [`state`], SI units.
    pub fn sigma(&self, state: usize) -> f64 {
        if state < STATES { sqrt(self.covariance.variance(state)) } else { f64::NAN }
    }

    /// Covariance of two error states.
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        if a.max(b) < STATES { self.covariance.covariance(a, b) } else { f64::NAN }
    }

    /// Counters of a source.
    pub fn source(&self, source: Source) -> SourceHealth {
        self.sources.get(source as usize).copied().unwrap_or_default()
    }

    /// Gaps in the increments that were bridged.
    pub fn bridged_gaps(&self) -> u32 {
        self.bridged_gaps
    }

    fn health_mut(&mut self, source: Source, change: impl FnOnce(&mut SourceHealth)) {
        if let Some(health) = self.sources.get_mut(source as usize) {
            change(health);
        }
    }
}

fn near_pole(navigation: &Navigation) -> Result<(), Refusal> {
    let latitude_deg = navigation.latitude_rad * DEG_PER_RAD;
    if latitude_deg.is_nan() {
        return Err(Refusal::NotANumber);
    }
    if latitude_deg.abs() > 90.0 - POLE_LIMIT_DEG { Err(Refusal::NearPole) } else { Ok(()) }
}
