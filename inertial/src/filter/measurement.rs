//! What aids the filter, and how each reading depends on the errors.

use libm::{atan2, cos, sqrt};
use nalgebra::{Matrix3, RowVector3, Vector3};
use quantities::units::{DEG_PER_RAD, RAD_PER_DEG, wrap_180_deg};

use super::Filter;
use super::state::{AMBIGUITY, ATTITUDE, BASELINE, CURRENT, Errors, LOG_SCALE, PHASES, POSITION, VELOCITY};
use crate::esg::filter::PickOff;
use crate::ud::put;

/// What a heading error φ leaves of a baseline b beyond the first order is ½·b·φ²: its rms is √3/2 of b times the variance.
pub(super) const SECOND_ORDER: f64 = 0.866;
/// … and it stays the same for so many readings in a row.
const SECOND_ORDER_REPEATS: f64 = 3600.0;
/// The interval of a velocity is the time since the last mark, to this share of it.
const SAME_INTERVAL: f64 = 0.1;

/// A source of aiding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Satellite velocity.
    Velocity,
    /// Satellite position.
    Position,
    /// Height against the sea, or the depth gauge.
    Height,
    /// Heading from another instrument.
    Heading,
    /// Log.
    Log,
    /// Acoustic position fix.
    Acoustic,
    /// Phase differences over the antenna baseline.
    Phase,
    /// Direction of an electrostatic gyro's rotor.
    Electrostatic,
}

impl Source {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Velocity,
        Self::Position,
        Self::Height,
        Self::Heading,
        Self::Log,
        Self::Acoustic,
        Self::Phase,
        Self::Electrostatic,
    ];

    /// Longer without a reading than this is an interruption, s: acoustic fixes are rare by nature.
    pub fn outage_s(self) -> f64 {
        if self == Self::Acoustic { 3600.0 } else { 60.0 }
    }

    /// What a person calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Position => "position",
            Self::Height => "height",
            Self::Heading => "heading",
            Self::Log => "log",
            Self::Acoustic => "acoustic fix",
            Self::Phase => "phase",
            Self::Electrostatic => "electrostatic gyro",
        }
    }
}

/// A second difference of carrier phases: between two antennas and between two satellites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseDifference {
    /// Tells one pair of satellites from another.
    pub pair: u16,
    /// Unit vector to the pair's satellite less that to its reference, east, north, up.
    pub direction: Vector3<f64>,
    /// Phase as a length, m, without a whole number of wavelengths.
    pub phase_m: f64,
    /// m.
    pub wavelength_m: f64,
    /// The receiver lost count of the wavelengths since the last one.
    pub slipped: bool,
}

impl PhaseDifference {
    /// Its numbers are numbers.
    pub(super) fn is_finite(&self) -> bool {
        self.phase_m.is_finite() && self.wavelength_m.is_finite() && self.direction.iter().all(|part| part.is_finite())
    }
}

/// A reading with its standard deviation.
#[derive(Clone, Debug, PartialEq)]
pub enum Measurement {
    /// Displacement of the antenna east, north, up over the last `interval_s`, divided by that time: it belongs to the middle. It is of
    /// use where the interval began with the last such reading, or with [`Filter::mark`].
    Velocity { mean_m_s: Vector3<f64>, interval_s: f64, sigma_m_s: f64 },
    /// Position of the antenna as it was `age_s` ago.
    Position { latitude_rad: f64, longitude_rad: f64, height_m: f64, age_s: f64, sigma_m: f64 },
    /// Height of the block above the ellipsoid: sea level with heave as its noise, or the depth gauge's.
    Height { height_m: f64, sigma_m: f64 },
    /// Heading of the hull, clockwise from north.
    Heading { heading_rad: f64, sigma_rad: f64 },
    /// Speed through the water along the hull's X and Y, as far as the log reads it.
    Log { starboard_m_s: Option<f64>, forward_m_s: Option<f64>, sigma_m_s: f64 },
    /// Position of the block as it was `age_s` ago.
    Acoustic { latitude_rad: f64, longitude_rad: f64, age_s: f64, sigma_m: f64 },
    /// Phase differences of one time.
    Phases { differences: [Option<PhaseDifference>; PHASES], sigma_m: f64 },
    /// Where the rotor of the electrostatic gyro points, as its pick-offs read it.
    PickOff(PickOff),
}

impl Measurement {
    /// Where it comes from.
    pub fn source(&self) -> Source {
        match self {
            Self::Velocity { .. } => Source::Velocity,
            Self::Position { .. } => Source::Position,
            Self::Height { .. } => Source::Height,
            Self::Heading { .. } => Source::Heading,
            Self::Log { .. } => Source::Log,
            Self::Acoustic { .. } => Source::Acoustic,
            Self::Phases { .. } => Source::Phase,
            Self::PickOff(_) => Source::Electrostatic,
        }
    }
}

/// A scalar measurement of the error state: `value` = h·x with variance `variance`.
#[derive(Clone, Debug)]
pub struct Row {
    /// Dependence on the errors.
    pub h: Errors,
    /// Measured less predicted.
    pub value: f64,
    /// Square of the unit.
    pub variance: f64,
}

/// The rows of a measurement; phases that are not there are none.
pub type Rows = [Option<Row>; 4];

fn row(value: f64, sigma: f64, parts: &[(usize, RowVector3<f64>)]) -> Row {
    let mut h = Errors::zeros();
    for (first, part) in parts {
        h.fixed_rows_mut::<3>(*first).copy_from(&part.transpose());
    }
    Row { h, value, variance: sigma * sigma }
}

fn unit(axis: usize) -> RowVector3<f64> {
    RowVector3::from_fn(|_, column| if column == axis { 1.0 } else { 0.0 })
}

impl Filter {
    /// How the reading depends on the errors now, and how far it is from what is expected.
    pub(super) fn rows(&self, measurement: &Measurement) -> Rows {
        match *measurement {
            Measurement::Velocity { mean_m_s, interval_s, sigma_m_s } => {
                self.velocity_rows(&mean_m_s, interval_s, sigma_m_s)
            }
            Measurement::Position { latitude_rad, longitude_rad, height_m, age_s, sigma_m } => {
                let lever = self.hull() * self.installation.antenna_m;
                let place = (latitude_rad, longitude_rad, height_m);
                let rows = self.position_rows(place, &lever, age_s, sigma_m);
                let [east, north, up] = rows;
                [Some(east), Some(north), Some(up), None]
            }
            Measurement::Acoustic { latitude_rad, longitude_rad, age_s, sigma_m } => {
                let place = (latitude_rad, longitude_rad, self.navigation.height_m);
                let [east, north, _] = self.position_rows(place, &Vector3::zeros(), age_s, sigma_m);
                [Some(east), Some(north), None, None]
            }
            Measurement::Height { height_m, sigma_m } => {
                [Some(row(height_m - self.navigation.height_m, sigma_m, &[(POSITION, unit(2))])), None, None, None]
            }
            Measurement::Heading { heading_rad, sigma_rad } => {
                [Some(self.heading_row(heading_rad, sigma_rad)), None, None, None]
            }
            Measurement::Log { starboard_m_s, forward_m_s, sigma_m_s } => {
                let [starboard, forward] = self.log_rows([starboard_m_s, forward_m_s], sigma_m_s);
                [starboard, forward, None, None]
            }
            Measurement::Phases { ref differences, sigma_m } => {
                let mut rows = [const { None }; 4];
                for (line, (place, difference)) in rows.iter_mut().zip(differences).enumerate() {
                    *place = difference.as_ref().map(|difference| self.phase_row(line, difference, sigma_m));
                }
                rows
            }
            Measurement::PickOff(ref reading) => self.pick_off_rows(reading),
        }
    }

    /// The velocity belongs to the middle of its interval: the error then was the error now less half an interval of its rate.
    fn velocity_rows(&self, mean_m_s: &Vector3<f64>, interval_s: f64, sigma_m_s: f64) -> Rows {
        let duration_s = self.mark.elapsed_s;
        if !(duration_s > 0.0 && libm::fabs(duration_s - interval_s) < SAME_INTERVAL * duration_s) {
            return [const { None }; 4];
        }
        let lever = self.hull() * self.installation.antenna_m - self.mark.lever_m;
        let innovation = mean_m_s - (self.mark.displacement_m + lever) / duration_s;
        let by_attitude: Matrix3<f64> = -lever.cross_matrix() / duration_s;
        core::array::from_fn(|axis| {
            let value = innovation.iter().nth(axis)?;
            let part = by_attitude.row(axis).into_owned();
            let mut row = row(*value, sigma_m_s, &[(ATTITUDE, part), (VELOCITY, unit(axis))]);
            row.h -= 0.5 * duration_s * self.velocity_rate.row(axis).transpose();
            Some(row)
        })
    }

    fn position_rows(&self, place: (f64, f64, f64), lever: &Vector3<f64>, age_s: f64, sigma_m: f64) -> [Row; 3] {
        let (latitude_rad, longitude_rad, height_m) = place;
        let navigation = &self.navigation;
        let here = navigation.place();
        let east_deg = wrap_180_deg((longitude_rad - navigation.longitude_rad) * DEG_PER_RAD);
        let offset = Vector3::new(
            east_deg * RAD_PER_DEG * here.prime_vertical_m * cos(navigation.latitude_rad),
            (latitude_rad - navigation.latitude_rad) * here.meridian_m,
            height_m - navigation.height_m,
        );
        let innovation = offset - lever + navigation.velocity_m_s * age_s;
        let by_attitude: Matrix3<f64> = -lever.cross_matrix();
        [innovation.x, innovation.y, innovation.z].map({
            let mut axes = 0..3;
            move |value| {
                let axis = axes.next().unwrap_or(0);
                let attitude = by_attitude.row(axis).into_owned();
                row(value, sigma_m, &[(ATTITUDE, attitude), (VELOCITY, -age_s * unit(axis)), (POSITION, unit(axis))])
            }
        })
    }

    /// A turn of the axes to the left, seen from above, is a smaller heading; a pitched bow mixes tilt into it.
    fn heading_row(&self, heading_rad: f64, sigma_rad: f64) -> Row {
        let bow = self.hull().column(1).into_owned();
        let level_2 = bow.x * bow.x + bow.y * bow.y;
        let predicted = atan2(bow.x, bow.y);
        let value = wrap_180_deg((heading_rad - predicted) * DEG_PER_RAD) * RAD_PER_DEG;
        let attitude = RowVector3::new(bow.x * bow.z, bow.y * bow.z, -level_2) / level_2.max(1e-6);
        row(value, sigma_rad, &[(ATTITUDE, attitude)])
    }

    fn log_rows(&self, measured_m_s: [Option<f64>; 2], sigma_m_s: f64) -> [Option<Row>; 2] {
        let hull = self.hull();
        let current = &self.estimates.current_m_s;
        let through = self.navigation.velocity_m_s - Vector3::new(current.x, current.y, 0.0);
        let gain = 1.0 + self.estimates.log_scale;
        let mut axes = 0..2;
        measured_m_s.map(|measured| {
            let axis = hull.column(axes.next().unwrap_or(0)).into_owned();
            let measured = measured?;
            let speed = axis.dot(&through);
            let attitude = axis.cross(&through).transpose() * gain;
            let velocity = axis.transpose() * gain;
            let mut row = row(measured - gain * speed, sigma_m_s, &[(ATTITUDE, attitude), (VELOCITY, velocity)]);
            put(&mut row.h, CURRENT, -velocity.x);
            put(&mut row.h, CURRENT + 1, -velocity.y);
            put(&mut row.h, LOG_SCALE, speed);
            Some(row)
        })
    }

    /// Length of the baseline towards the pair of satellites, as it is now expected, m.
    pub(super) fn expected_phase_m(&self, difference: &PhaseDifference) -> f64 {
        (self.hull() * (self.installation.baseline_m + self.baseline_error_m())).dot(&difference.direction)
    }

    fn baseline_error_m(&self) -> Vector3<f64> {
        Vector3::new(0.0, self.estimates.baseline_m.x, self.estimates.baseline_m.y)
    }

    fn phase_row(&self, line: usize, difference: &PhaseDifference, sigma_m: f64) -> Row {
        let hull = self.hull();
        let baseline = hull * (self.installation.baseline_m + self.baseline_error_m());
        let whole_m = self.estimates.ambiguity_m.get(line).copied().unwrap_or(0.0);
        let value = difference.phase_m - baseline.dot(&difference.direction) - whole_m;
        let attitude = baseline.cross(&difference.direction).transpose();
        let heading_variance = self.covariance.variance(ATTITUDE + 2);
        let bent_m = SECOND_ORDER * sqrt(baseline.norm_squared()) * heading_variance * sqrt(SECOND_ORDER_REPEATS);
        let mut row = row(value, sqrt(sigma_m * sigma_m + bent_m * bent_m), &[(ATTITUDE, attitude)]);
        put(&mut row.h, BASELINE, hull.column(1).dot(&difference.direction));
        put(&mut row.h, BASELINE + 1, hull.column(2).dot(&difference.direction));
        put(&mut row.h, AMBIGUITY + line, 1.0);
        row
    }
}
