//! A track with aiding: the filter of 35 states, 47 with an electrostatic gyro, takes every reading at its own time.

use std::f64::consts::FRAC_PI_2;

use inertial::esg::filter::PickOff;
use inertial::filter::block::BlockErrors;
use inertial::filter::measurement::{Measurement, PhaseDifference, Source};
use inertial::filter::navigation::Navigation;
use inertial::filter::{BlockReading, Filter, Mode, Outcome, StartSigmas, state};
use inertial::{Angles, BlockClass, Increment, Quaternion};
use nalgebra::Vector3;
use north_finder::earth::SEMI_MAJOR_M;
use north_finder::units::{DEG_PER_RAD, RAD_PER_DEG, wrap_180_deg};
use schemars::JsonSchema;
use serde::Serialize;

use super::aiding_csv::{Aiding, Reading, Value};
use super::installation::Installation;
use super::start::Start;
use super::{Detail, Innovations, Reference, Track, TrackRow};
use crate::block_csv::{BlockRecording, BlockRow};

/// The recording's x is forward, y left: the block's axes are turned so far on the hull, whose X is to starboard.
const FORWARD_RAD: f64 = FRAC_PI_2;
/// Readings this close to the end of a row belong to it, s.
const SAME_TIME_S: f64 = 1e-6;
/// In a gap the ship may accelerate by so much, m/s².
const GAP_M_S2: f64 = 1.0;
/// Latitude of the command line and of the first position must agree to this, degrees.
const SAME_LATITUDE_DEG: f64 = 1.0;
/// One sigma of the place at the start without a position, and of the velocity without one.
const UNKNOWN_PLACE_M: f64 = 1000.0;
const UNKNOWN_SPEED_M_S: f64 = 1.0;
/// Of the readings within so many seconds of the start the nearest tell place and velocity there; the place is not trusted to be better than so many metres.
const START_S: f64 = 10.0;
const START_M: f64 = 10.0;
/// Rejections that are listed, each with its reason; all are counted.
const LISTED: usize = 100;

/// What a run needs beside recording and readings.
#[derive(Clone, Debug)]
pub struct Settings {
    pub class: BlockClass,
    pub errors: BlockErrors,
    pub latitude_deg: f64,
    pub installation: Installation,
    /// Modes with the times from which they hold, in the order of time.
    pub modes: Vec<(f64, Mode)>,
}

impl Settings {
    /// The mode that holds at a time: before the first one begins it is aided.
    fn mode_at(&self, t_s: f64) -> Mode {
        let begun = self.modes.iter().take_while(|(from_s, _)| *from_s <= t_s);
        begun.last().map_or(Mode::Aided, |(_, mode)| *mode)
    }
}

/// What became of a source.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SourceSummary {
    pub source: &'static str,
    pub taken: u32,
    pub rejected: u32,
    pub longest_rejected_in_a_row: u32,
    /// When the longest row of rejections began; none where none was rejected.
    pub rejected_from_s: Option<f64>,
    /// The mode does not take it.
    pub ignored_by_mode: u32,
    /// Before the start, after the end, in a gap of the block, or the first after an interruption: no use.
    pub unused: u32,
    /// Those of them that lie before the start or after the end.
    #[serde(skip)]
    pub outside: u32,
    pub nis: f64,
    pub nis_degrees_of_freedom: u32,
    pub lost: Vec<Loss>,
}

/// A source was silent, or all it said was rejected, for longer than it may be.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Loss {
    pub from_s: f64,
    /// None: it did not come back.
    pub to_s: Option<f64>,
    /// Of the heading when it was lost, and when it came back or at the end.
    pub sigma_heading_before_deg: f64,
    pub sigma_heading_after_deg: f64,
}

/// A reading that was not taken.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Rejection {
    pub t_s: f64,
    pub source: &'static str,
    pub place: String,
    pub reason: String,
}

/// What became of the recording beside its track.
#[derive(Clone, Debug)]
pub struct Aided {
    pub track: Track,
    pub sources: Vec<SourceSummary>,
    pub rejections: Vec<Rejection>,
    pub gaps: u32,
    pub saturated: u32,
}

/// Runs the filter from the start on.
///
/// Errors: in words, with the time; a latitude near a pole, a gap that is not bridged, no readings.
pub fn run(
    recording: &BlockRecording,
    aiding: &Aiding,
    start: &Start,
    settings: &Settings,
    reference: &Reference,
) -> Result<Aided, String> {
    Run::new(recording, aiding, start, settings)?.along(recording, start, reference)
}

struct Run<'a> {
    aiding: &'a Aiding,
    settings: &'a Settings,
    filter: Filter,
    /// The next reading.
    next: usize,
    watches: Vec<Watch>,
    rejections: Vec<Rejection>,
    /// Rate of the row before, rad/s.
    before_rad_s: f64,
    gaps: u32,
    saturated: u32,
}

/// What the installation lacks for a reading.
fn lacking(reading: &Reading, settings: &Settings) -> Option<&'static str> {
    let installation = &settings.installation;
    match reading.value {
        Value::BaselineHeading(_) | Value::Phases(_) if installation.baseline_m == [0.0; 3] => Some("baseline_m"),
        Value::Rotor { .. } if installation.electrostatic_gyro.is_none() => Some("[electrostatic_gyro]"),
        _ => None,
    }
}

/// What the reading that is nearest to the start, of those that tell something, tells.
fn nearest<'a, T>(readings: &'a [Reading], start_s: f64, told: impl Fn(&'a Reading) -> Option<T>) -> Option<T> {
    let away_s = |reading: &Reading| (reading.t_s - start_s).abs();
    let near = readings.iter().filter(|reading| away_s(reading) <= START_S);
    let telling = near.filter_map(|reading| Some((away_s(reading), told(reading)?)));
    telling.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, told)| told)
}

/// One source along the run.
struct Watch {
    source: Source,
    innovations: Innovations,
    last_s: f64,
    sigma_heading_deg: f64,
    lost: Vec<Loss>,
    in_a_row: u32,
    row_from_s: f64,
    longest_in_a_row: u32,
    longest_from_s: Option<f64>,
    unused: u32,
    outside: u32,
    seen: bool,
}

/// Refuses a first position at another latitude than the settings'.
fn refuse_other_latitude(
    aiding: &Aiding,
    reading: &Reading,
    latitude_deg: f64,
    settings: &Settings,
) -> Result<(), String> {
    if (latitude_deg - settings.latitude_deg).abs() > SAME_LATITUDE_DEG {
        return Err(format!(
            "{}: the first position's latitude is {latitude_deg}°, --latitude says {}°",
            aiding.place(reading),
            settings.latitude_deg
        ));
    }
    Ok(())
}

/// Refuses readings that need what the installation does not say.
fn refuse_what_lacks(aiding: &Aiding, settings: &Settings) -> Result<(), String> {
    match aiding.readings.iter().find_map(|reading| Some((reading, lacking(reading, settings)?))) {
        Some((reading, lacks)) => {
            Err(format!("{}: this reading needs {lacks} in the --installation", aiding.place(reading)))
        }
        None => Ok(()),
    }
}

impl<'a> Run<'a> {
    fn new(
        recording: &BlockRecording,
        aiding: &'a Aiding,
        start: &Start,
        settings: &'a Settings,
    ) -> Result<Self, String> {
        let start_s = start.rows.checked_sub(1).and_then(|last| recording.rows.get(last)).map_or(0.0, |row| row.t_s);
        let turn_deg = recording.rows.get(start.rows).map_or(0.0, |row| row.turn_deg);
        let depth_m = nearest(&aiding.readings, start_s, |reading| match reading.value {
            Value::Depth(depth_m) => Some(depth_m),
            _ => None,
        });
        let place = nearest(&aiding.readings, start_s, |reading| match reading.value {
            Value::Position([latitude, longitude, height_m]) => Some(([latitude, longitude, height_m], reading)),
            Value::Acoustic([latitude, longitude]) => {
                Some(([latitude, longitude, -depth_m.unwrap_or_default()], reading))
            }
            _ => None,
        });
        if let Some(([latitude_deg, ..], reading)) = place {
            refuse_other_latitude(aiding, reading, latitude_deg, settings)?;
        }
        refuse_what_lacks(aiding, settings)?;
        let velocity = nearest(&aiding.readings, start_s, |reading| match reading.value {
            Value::Velocity { east_north_up_m_s, .. } => Some((Vector3::from(east_north_up_m_s), reading.sigma)),
            _ => None,
        });
        let installation = settings.installation.on_hull();
        let (velocity_m_s, velocity_sigma_m_s) =
            velocity.map_or((Vector3::zeros(), UNKNOWN_SPEED_M_S), |(velocity, sigma)| (velocity, sigma + 0.5));
        let place_sigma_m = |reading: &Reading| {
            let has_height = depth_m.is_some() || !matches!(reading.value, Value::Acoustic(_));
            let travelled_m = (velocity_m_s.norm() + velocity_sigma_m_s) * (reading.t_s - start_s).abs();
            let sigma_m = reading.sigma.hypot(installation.antenna_m.norm()).hypot(START_M).hypot(travelled_m);
            if has_height { sigma_m } else { UNKNOWN_PLACE_M }
        };
        let ([latitude_deg, longitude_deg, height_m], place_sigma_m) = place.map_or_else(
            || ([settings.latitude_deg, 0.0, 0.0], UNKNOWN_PLACE_M),
            |(place, reading)| (place, place_sigma_m(reading)),
        );
        let attitude = Quaternion::from_angles(&start.angles).direction_cosines();
        let navigation =
            Navigation::new(attitude, velocity_m_s, latitude_deg * RAD_PER_DEG, longitude_deg * RAD_PER_DEG, height_m);
        let sigmas = StartSigmas {
            tilt_rad: StartSigmas::USUAL.tilt_rad.max(start.sigma_level_deg * RAD_PER_DEG),
            heading_rad: start.sigma_heading_deg * RAD_PER_DEG,
            velocity_m_s: velocity_sigma_m_s,
            position_m: place_sigma_m,
            current_m_s: settings.installation.current_m_s,
            current_s: settings.installation.current_s,
            log_scale: settings.installation.log_scale_sigma,
            baseline_m: settings.installation.baseline_sigma_m,
        };
        let turn_rad = FORWARD_RAD + turn_deg * RAD_PER_DEG;
        let mode = settings.mode_at(start_s);
        let started = Filter::new(navigation, turn_rad, settings.errors, &sigmas, installation, mode);
        let mut filter = started.map_err(|refusal| refusal.to_string())?;
        if let Some(gyro) = &settings.installation.electrostatic_gyro {
            filter.add_electrostatic(&gyro.direction(start_s), gyro.coefficients(), gyro.errors());
        }
        let watches = Source::ALL.map(|source| Watch {
            source,
            innovations: Innovations { name: source.name(), ..Innovations::default() },
            last_s: start_s,
            sigma_heading_deg: start.sigma_heading_deg,
            lost: Vec::new(),
            in_a_row: 0,
            row_from_s: start_s,
            longest_in_a_row: 0,
            longest_from_s: None,
            unused: 0,
            outside: 0,
            seen: false,
        });
        let (rejections, watches) = (Vec::new(), watches.into());
        let mut run =
            Self { aiding, settings, filter, next: 0, watches, rejections, before_rad_s: 0.0, gaps: 0, saturated: 0 };
        run.skip_until(start_s + SAME_TIME_S, true);
        Ok(run)
    }

    fn along(mut self, recording: &BlockRecording, start: &Start, reference: &Reference) -> Result<Aided, String> {
        let mut rows = Vec::new();
        let begin_s = recording.rows.get(start.rows).map_or(0.0, |row| row.t_s - row.interval_s);
        let mut due_s = begin_s + 1.0;
        let mut turn_deg = recording.rows.get(start.rows).map_or(0.0, |row| row.turn_deg);
        for row in recording.rows.iter().skip(start.rows) {
            self.interval(row, recording.step_s, turn_deg).map_err(|why| format!("t_s = {}: {why}", row.t_s))?;
            turn_deg = row.turn_deg;
            if row.t_s + SAME_TIME_S >= due_s {
                due_s = (due_s + 1.0).max(row.t_s);
                rows.push(self.row(row, reference));
            }
        }
        self.skip_until(f64::INFINITY, true);
        let sigma_deg = self.filter.heading().sigma_deg;
        let end_s = recording.rows.last().map_or(0.0, |row| row.t_s);
        let sources = self.watches.iter_mut().filter(|watch| watch.seen);
        let sources: Vec<SourceSummary> = sources.map(|watch| watch.end(&self.filter, end_s, sigma_deg)).collect();
        let innovations = self.watches.into_iter().filter(|watch| watch.seen).map(|watch| watch.innovations).collect();
        let track = Track { rows, innovations };
        Ok(Aided { track, sources, rejections: self.rejections, gaps: self.gaps, saturated: self.saturated })
    }

    /// One row of the block, with the readings that fall into it at their own times.
    fn interval(&mut self, row: &BlockRow, step_s: f64, turn_from_deg: f64) -> Result<(), String> {
        let refused = |refusal: inertial::filter::Refusal| refusal.to_string();
        let (mut dt_s, mut increment) = (row.interval_s, row.increment);
        if let Some(gap_s) = row.gap_s(step_s) {
            increment.velocity_m_s *= step_s / row.interval_s;
            dt_s = step_s;
            self.skip_until(row.t_s - step_s, false);
            // It may have begun or ended to turn in the gap.
            let rate_rad_s = (increment.angle_rad.norm() / step_s).max(self.before_rad_s);
            self.filter
                .bridge(gap_s, rate_rad_s, GAP_M_S2)
                .map_err(|why| format!("no rows for {gap_s:.3} s: {why}"))?;
            self.gaps += 1;
        }
        self.before_rad_s = increment.angle_rad.norm() / dt_s;
        let begin_s = row.t_s - dt_s;
        let mut done_s = 0.0;
        let mut advance = |filter: &mut Filter, to_s: f64| {
            let part_s = to_s - done_s;
            if part_s <= 0.0 {
                return Ok(());
            }
            let share = part_s / dt_s;
            done_s = to_s;
            let turn_deg = turn_from_deg + wrap_180_deg(row.turn_deg - turn_from_deg) * to_s / dt_s;
            let increment =
                Increment { angle_rad: increment.angle_rad * share, velocity_m_s: increment.velocity_m_s * share };
            filter.advance(&BlockReading { dt_s: part_s, increment, turn_rad: FORWARD_RAD + turn_deg * RAD_PER_DEG })
        };
        while let Some(reading) = self.aiding.readings.get(self.next).filter(|next| next.t_s <= row.t_s + SAME_TIME_S) {
            let to_s = reading.t_s - begin_s;
            advance(&mut self.filter, if to_s > dt_s - SAME_TIME_S { dt_s } else { to_s }).map_err(refused)?;
            self.next += 1;
            self.take(reading);
        }
        advance(&mut self.filter, dt_s).map_err(refused)?;
        let range_rad = self.settings.class.range_deg_s * RAD_PER_DEG * dt_s;
        if increment.angle_rad.amax() >= range_rad {
            self.saturated += 1;
            // It may have been twice as fast.
            self.filter.doubt(range_rad, 0.0);
        }
        self.filter.set_mode(self.settings.mode_at(row.t_s));
        self.watch(row.t_s);
        Ok(())
    }

    fn take(&mut self, reading: &Reading) {
        let measurement = self.measurement(reading);
        let source = measurement.source();
        let outcome = self.filter.measure(&measurement);
        let sigma_deg = self.filter.heading().sigma_deg;
        let Some(watch) = self.watches.get_mut(source as usize) else { return };
        watch.seen = true;
        let reason = match outcome {
            Ok(Outcome::Taken { normalised_squared, degrees_of_freedom }) => {
                watch.innovations.taken.push((reading.t_s, normalised_squared, degrees_of_freedom));
                watch.back(reading.t_s, sigma_deg);
                return;
            }
            Ok(Outcome::Ignored) => return,
            Ok(Outcome::Silent) => {
                watch.unused += 1;
                return;
            }
            Ok(Outcome::Rejected { sigmas }) => format!("{sigmas:.1} sigmas from what was expected"),
            Err(refusal) => refusal.to_string(),
        };
        watch.rejected(reading.t_s);
        if self.rejections.len() < LISTED {
            let place = self.aiding.place(reading);
            self.rejections.push(Rejection { t_s: reading.t_s, source: source.name(), place, reason });
        }
    }

    fn measurement(&self, reading: &Reading) -> Measurement {
        let sigma = reading.sigma;
        let heading = |heading_deg: f64| Measurement::Heading {
            heading_rad: heading_deg * RAD_PER_DEG,
            sigma_rad: sigma * RAD_PER_DEG,
        };
        let log = |forward_m_s, starboard_m_s| Measurement::Log { starboard_m_s, forward_m_s, sigma_m_s: sigma };
        match &reading.value {
            Value::Velocity { east_north_up_m_s, interval_s } => Measurement::Velocity {
                mean_m_s: Vector3::from(*east_north_up_m_s),
                interval_s: *interval_s,
                sigma_m_s: sigma,
            },
            Value::Position([latitude_deg, longitude_deg, height_m]) => Measurement::Position {
                latitude_rad: latitude_deg * RAD_PER_DEG,
                longitude_rad: longitude_deg * RAD_PER_DEG,
                height_m: *height_m,
                age_s: 0.0,
                sigma_m: sigma,
            },
            Value::Heading(heading_deg) => heading(*heading_deg),
            Value::BaselineHeading(heading_deg) => {
                // The baseline points so far to the right of the bow.
                let baseline = self.settings.installation.on_hull().baseline_m;
                heading(heading_deg - baseline.x.atan2(baseline.y) * DEG_PER_RAD)
            }
            Value::LogForward(speed_m_s) => log(Some(*speed_m_s), None),
            Value::LogStarboard(speed_m_s) => log(None, Some(*speed_m_s)),
            Value::Depth(depth_m) => Measurement::Height { height_m: -depth_m, sigma_m: sigma },
            Value::Acoustic([latitude_deg, longitude_deg]) => Measurement::Acoustic {
                latitude_rad: latitude_deg * RAD_PER_DEG,
                longitude_rad: longitude_deg * RAD_PER_DEG,
                age_s: 0.0,
                sigma_m: sigma,
            },
            Value::Phases(lines) => Measurement::Phases {
                differences: lines.map(|line| {
                    let [phase_m, east, north, up, pair] = line?;
                    Some(PhaseDifference {
                        pair: pair as u16,
                        direction: Vector3::new(east, north, up),
                        phase_m,
                        wavelength_m: self.settings.installation.wavelength_m,
                        slipped: false,
                    })
                }),
                sigma_m: sigma,
            },
            Value::Rotor { direction, sensor } => {
                Measurement::PickOff(PickOff { direction: Vector3::from(*direction), sensor: *sensor })
            }
        }
    }

    /// Readings up to then are of no use: they lie before the start or after the end, or in a gap.
    fn skip_until(&mut self, t_s: f64, outside: bool) {
        while let Some(reading) = self.aiding.readings.get(self.next).filter(|reading| reading.t_s <= t_s) {
            let source = self.measurement(reading).source();
            if let Some(watch) = self.watches.get_mut(source as usize) {
                watch.unused += 1;
                watch.outside += u32::from(outside);
                watch.seen = true;
            }
            self.next += 1;
        }
    }

    /// Sources that are silent for too long.
    fn watch(&mut self, t_s: f64) {
        for watch in self.watches.iter_mut().filter(|watch| watch.seen) {
            if watch.is_here() && t_s - watch.last_s > watch.source.outage_s() {
                watch.lost.push(Loss {
                    from_s: watch.last_s,
                    to_s: None,
                    sigma_heading_before_deg: watch.sigma_heading_deg,
                    sigma_heading_after_deg: f64::NAN,
                });
            }
        }
    }

    fn row(&mut self, row: &BlockRow, reference: &Reference) -> TrackRow {
        let heading = self.filter.heading();
        let navigation = self.filter.navigation();
        // Block axes forward, left, up on the hull: the turn of the block is taken out.
        let hull = self.filter.hull();
        let (forward, left) = (hull.column(1), -hull.column(0));
        let level = |axis: f64, across: f64| axis.atan2(across) * DEG_PER_RAD;
        let angles = Angles {
            heading_deg: heading.heading_deg,
            pitch_deg: level(forward.z, forward.x.hypot(forward.y)),
            roll_deg: level(left.z, hull.m33),
        };
        let tilt = self.filter.sigma(state::ATTITUDE).max(self.filter.sigma(state::ATTITUDE + 1));
        let (latitude_deg, longitude_deg) =
            (navigation.latitude_rad * DEG_PER_RAD, wrap_180_deg(navigation.longitude_rad * DEG_PER_RAD));
        let position_error_m = row.reference_place_deg.map(|[latitude, longitude]| {
            let east = wrap_180_deg(longitude_deg - longitude) * (latitude * RAD_PER_DEG).cos();
            (latitude_deg - latitude).hypot(east) * RAD_PER_DEG * SEMI_MAJOR_M
        });
        TrackRow {
            t_s: row.t_s,
            angles,
            sigma_heading_deg: heading.sigma_deg,
            sigma_level_deg: tilt * DEG_PER_RAD,
            error_deg: reference.error_deg(row, heading.heading_deg),
            detail: Detail::Aided {
                latitude_deg,
                longitude_deg,
                height_m: navigation.height_m,
                velocity_m_s: navigation.velocity_m_s.into(),
                sigma_position_m: self.filter.sigma(state::POSITION).hypot(self.filter.sigma(state::POSITION + 1)),
                position_error_m,
            },
        }
    }
}

impl Watch {
    fn is_here(&self) -> bool {
        self.lost.last().is_none_or(|loss| loss.to_s.is_some())
    }

    /// A reading was taken.
    fn back(&mut self, t_s: f64, sigma_heading_deg: f64) {
        if let Some(loss) = self.lost.last_mut().filter(|loss| loss.to_s.is_none()) {
            (loss.to_s, loss.sigma_heading_after_deg) = (Some(t_s), sigma_heading_deg);
        }
        (self.last_s, self.sigma_heading_deg, self.in_a_row) = (t_s, sigma_heading_deg, 0);
    }

    /// A reading was not taken.
    fn rejected(&mut self, t_s: f64) {
        self.innovations.rejected_s.push(t_s);
        if self.in_a_row == 0 {
            self.row_from_s = t_s;
        }
        self.in_a_row += 1;
        if self.in_a_row > self.longest_in_a_row {
            (self.longest_in_a_row, self.longest_from_s) = (self.in_a_row, Some(self.row_from_s));
        }
    }

    fn end(&mut self, filter: &Filter, end_s: f64, sigma_heading_deg: f64) -> SourceSummary {
        let health = filter.source(self.source);
        if let Some(loss) = self.lost.last_mut().filter(|loss| loss.to_s.is_none() && loss.from_s < end_s) {
            loss.sigma_heading_after_deg = sigma_heading_deg;
        }
        SourceSummary {
            source: self.source.name(),
            taken: health.taken,
            rejected: health.rejected + health.refused,
            longest_rejected_in_a_row: self.longest_in_a_row,
            rejected_from_s: self.longest_from_s,
            ignored_by_mode: health.ignored,
            unused: self.unused,
            outside: self.outside,
            nis: health.normalised_squared / f64::from(health.degrees_of_freedom.max(1)),
            nis_degrees_of_freedom: health.degrees_of_freedom,
            lost: self.lost.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the positions 9 s before the start, at it and 20 s after it the one at the start is taken; a depth that nobody sent tells nothing.
    #[test]
    fn the_nearest_reading_tells_the_start() {
        let reading = |t_s: f64| Reading { t_s, value: Value::Heading(t_s), sigma: 1.0, file: 0, line: 1 };
        let readings: Vec<Reading> = [91.0, 100.5, 120.0].map(reading).into();
        let heading =
            |reading: &Reading| if let Value::Heading(heading) = reading.value { Some(heading) } else { None };
        let depth = |reading: &Reading| if let Value::Depth(depth) = reading.value { Some(depth) } else { None };
        assert_eq!((nearest(&readings, 100.0, heading), nearest(&readings, 100.0, depth)), (Some(100.5), None));
        assert_eq!(nearest(&readings[2..], 100.0, heading), None);
    }

    #[test]
    fn a_mode_holds_from_its_time_on_and_before_the_first_it_is_aided() {
        let modes = vec![(600.0, Mode::LogOnly), (1200.0, Mode::Submerged)];
        let settings = Settings {
            class: BlockClass::MODERN_MEMS,
            errors: BlockErrors::STIM300,
            latitude_deg: 60.0,
            installation: Installation::default(),
            modes,
        };
        let at = [0.0, 599.9, 600.0, 1199.9, 1200.0, 1e9].map(|t_s| settings.mode_at(t_s));
        assert_eq!(at, [Mode::Aided, Mode::Aided, Mode::LogOnly, Mode::LogOnly, Mode::Submerged, Mode::Submerged]);
    }
}
