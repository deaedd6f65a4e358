//! What aids along a recording: readings of satellites, antennas, log, depth gauge, acoustic fixes and an electrostatic gyro, in
//! columns of the recording itself or of files of their own. An empty field is no reading.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use inertial::filter::state::PHASES;

use crate::block_csv;
use crate::file_error::{FileError, Problem};
use crate::table_csv::TableCsv;

const TIME: &str = "t_s";
/// A velocity that comes after more than so many usual intervals does not cover the time since the last one.
const USUAL_INTERVALS: f64 = 1.5;

/// Columns that belong together, what is allowed in them, the column of their standard deviation and what it is without one.
struct Group {
    columns: &'static [&'static str],
    allowed: &'static [RangeInclusive<f64>],
    sigma: &'static str,
    usual_sigma: f64,
}

const SPEED_M_S: RangeInclusive<f64> = -1000.0..=1000.0;
const LATITUDE_DEG: RangeInclusive<f64> = -90.0..=90.0;
const CIRCLE_DEG: RangeInclusive<f64> = -360.0..=360.0;
/// Of a unit vector, or of the difference of two.
const PART: RangeInclusive<f64> = -2.0..=2.0;
const SIGMA: RangeInclusive<f64> = 1e-9..=1e9;

const VELOCITY: Group = Group {
    columns: &["ve_m_s", "vn_m_s", "vu_m_s"],
    allowed: &[SPEED_M_S, SPEED_M_S, SPEED_M_S],
    sigma: "sigma_velocity_m_s",
    usual_sigma: 0.1,
};
const POSITION: Group = Group {
    columns: &["lat_deg", "lon_deg", "height_m"],
    allowed: &[LATITUDE_DEG, CIRCLE_DEG, -12_000.0..=100_000.0],
    sigma: "sigma_position_m",
    usual_sigma: 5.0,
};
const HEADING: Group =
    Group { columns: &["heading_deg"], allowed: &[CIRCLE_DEG], sigma: "sigma_heading_deg", usual_sigma: 0.3 };
const BASELINE: Group = Group {
    columns: &["baseline_heading_deg"],
    allowed: &[CIRCLE_DEG],
    sigma: "sigma_baseline_heading_deg",
    usual_sigma: 0.3,
};
const LOG: Group = Group { columns: &["log_m_s"], allowed: &[SPEED_M_S], sigma: "sigma_log_m_s", usual_sigma: 0.05 };
const LOG_STARBOARD: Group = Group { columns: &["log_starboard_m_s"], ..LOG };
const DEPTH: Group =
    Group { columns: &["depth_m"], allowed: &[-100.0..=12_000.0], sigma: "sigma_depth_m", usual_sigma: 0.3 };
const ACOUSTIC: Group = Group {
    columns: &["acoustic_lat_deg", "acoustic_lon_deg"],
    allowed: &[LATITUDE_DEG, CIRCLE_DEG],
    sigma: "sigma_acoustic_m",
    usual_sigma: 5.0,
};
const PHASE_COLUMNS: [&[&str]; PHASES] = [
    &["phase1_m", "phase1_east", "phase1_north", "phase1_up", "phase1_pair"],
    &["phase2_m", "phase2_east", "phase2_north", "phase2_up", "phase2_pair"],
    &["phase3_m", "phase3_east", "phase3_north", "phase3_up", "phase3_pair"],
    &["phase4_m", "phase4_east", "phase4_north", "phase4_up", "phase4_pair"],
];
const PHASE_ALLOWED: &[RangeInclusive<f64>] = &[-1e9..=1e9, PART, PART, PART, 0.0..=65_535.0];
const ROTOR: Group = Group {
    columns: &["esg_x", "esg_y", "esg_z", "esg_sensor"],
    allowed: &[PART, PART, PART, 0.0..=5.0],
    // The gyro's own errors stand in the installation.
    sigma: "",
    usual_sigma: 0.0,
};

/// A reading as it stands in its file, degrees and metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// East, north, up; over so many seconds before it.
    Velocity {
        east_north_up_m_s: [f64; 3],
        interval_s: f64,
    },
    /// Latitude, longitude, height above the ellipsoid.
    Position([f64; 3]),
    Heading(f64),
    BaselineHeading(f64),
    LogForward(f64),
    LogStarboard(f64),
    Depth(f64),
    Acoustic([f64; 2]),
    /// Each: length of the phase, direction, number of its pair of satellites.
    Phases([Option<[f64; 5]>; PHASES]),
    Rotor {
        direction: [f64; 3],
        sensor: u8,
    },
}

/// One reading, and where it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    pub t_s: f64,
    pub value: Value,
    pub sigma: f64,
    /// Number of its file among those that were read.
    pub file: usize,
    pub line: u64,
}

/// All readings, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct Aiding {
    pub readings: Vec<Reading>,
    pub files: Vec<PathBuf>,
    /// Columns that are no readings: `FILE: name, …`.
    pub unknown: Vec<String>,
}

/// A reading of a group's numbers.
type OfNumbers = fn(&[f64]) -> Option<Value>;

/// Places of a group in a table.
struct Found {
    group: &'static Group,
    columns: Vec<usize>,
    sigma: Option<usize>,
}

impl Aiding {
    /// Reads what aids in the recording's own columns, if anything does, and in these files.
    ///
    /// Errors: a file that cannot be read; one of `files` without a reading; one without a reading's columns, with some of those
    /// that belong together, or with one of them twice; a field that is no number or not allowed; time that does not increase.
    pub fn read(recording: &Path, files: &[PathBuf]) -> Result<Self, FileError> {
        let mut aiding = Self::default();
        aiding.add(recording, true)?;
        for file in files {
            aiding.add(file, false)?;
        }
        aiding.readings.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        Ok(aiding)
    }

    /// Whether anything aids.
    pub fn is_empty(&self) -> bool {
        self.readings.is_empty()
    }

    /// `FILE, line N` of a reading.
    pub fn place(&self, reading: &Reading) -> String {
        let file = self.files.get(reading.file).map_or_else(String::new, |file| file.display().to_string());
        format!("{file}, line {}", reading.line)
    }

    fn add(&mut self, path: &Path, recording: bool) -> Result<(), FileError> {
        let mut table = TableCsv::open(path)?;
        let time = table.column(TIME)?;
        let mut used = vec![TIME];
        if recording {
            used.extend(block_csv::COLUMNS);
            used.extend(block_csv::REFERENCES);
            used.push(block_csv::TURN);
        }
        let mut find = |group: &'static Group| -> Result<Option<Found>, FileError> {
            if !group.columns.iter().any(|name| table.find(name).is_some()) {
                return Ok(None);
            }
            let columns = group.columns.iter().map(|name| table.column(name)).collect::<Result<_, _>>()?;
            used.extend(group.columns);
            used.push(group.sigma);
            Ok(Some(Found { group, columns, sigma: table.find_one(group.sigma)? }))
        };
        let singles: [(&'static Group, OfNumbers); 9] = [
            (&VELOCITY, |v| Some(Value::Velocity { east_north_up_m_s: three(v)?, interval_s: 0.0 })),
            (&POSITION, |v| Some(Value::Position(three(v)?))),
            (&HEADING, |v| Some(Value::Heading(*v.first()?))),
            (&BASELINE, |v| Some(Value::BaselineHeading(*v.first()?))),
            (&LOG, |v| Some(Value::LogForward(*v.first()?))),
            (&LOG_STARBOARD, |v| Some(Value::LogStarboard(*v.first()?))),
            (&DEPTH, |v| Some(Value::Depth(*v.first()?))),
            (&ACOUSTIC, |v| Some(Value::Acoustic(v.try_into().ok()?))),
            (&ROTOR, |v| Some(Value::Rotor { direction: three(v)?, sensor: *v.get(3)? as u8 })),
        ];
        let mut found = Vec::new();
        for (group, value) in singles {
            found.extend(find(group)?.map(|found| (found, value)));
        }
        let mut phases = [const { None }; PHASES];
        for (place, group) in phases.iter_mut().zip(&PHASE_GROUPS) {
            *place = find(group)?;
        }
        let unknown: Vec<&str> =
            table.header().iter().map(String::as_str).filter(|name| !used.contains(name)).collect();
        if !recording && found.is_empty() && phases.iter().all(Option::is_none) {
            let allowed =
                "columns of a reading, docs/formats.md: ve_m_s vn_m_s vu_m_s, lat_deg lon_deg height_m, heading_deg, …";
            return Err(table.whole(Problem::not_allowed(table.header().join(", "), allowed)));
        }
        if !unknown.is_empty() && !recording {
            self.unknown.push(format!("{}: {}", path.display(), unknown.join(", ")));
        }
        if recording && found.is_empty() && phases.iter().all(Option::is_none) {
            return Ok(());
        }
        self.files.push(path.to_owned());
        let first = self.readings.len();
        self.take_rows(&mut table, time, &found, &phases)?;
        if !recording && self.readings.len() == first {
            return Err(table.whole(Problem::Syntax("no line of it holds a reading".into())));
        }
        intervals(&mut self.readings[first..]);
        Ok(())
    }

    /// The readings of all rows of the last file.
    fn take_rows(
        &mut self,
        table: &mut TableCsv,
        time: usize,
        found: &[(Found, OfNumbers)],
        phases: &[Option<Found>; PHASES],
    ) -> Result<(), FileError> {
        let file = self.files.len() - 1;
        let mut previous_s = f64::NEG_INFINITY;
        while table.next_row()? {
            let t_s = table.number(time)?;
            if t_s <= previous_s {
                return Err(table.error(time, Problem::TimeNotIncreasing { t_s, previous_s }));
            }
            previous_s = t_s;
            let line = table.line();
            let mut put = |value: Value, sigma: f64| self.readings.push(Reading { t_s, value, sigma, file, line });
            for (found, value) in found {
                if let Some((numbers, sigma)) = found.read(table)?
                    && let Some(value) = value(&numbers)
                {
                    put(value, sigma);
                }
            }
            let (mut lines, mut sigma_m) = ([None; PHASES], PHASE_SIGMA_M);
            for (line, found) in lines.iter_mut().zip(phases) {
                if let Some((numbers, sigma)) = found.as_ref().map_or(Ok(None), |found| found.read(table))? {
                    (*line, sigma_m) = (<[f64; 5]>::try_from(&numbers[..]).ok(), sigma);
                }
            }
            if lines.iter().any(Option::is_some) {
                put(Value::Phases(lines), sigma_m);
            }
        }
        Ok(())
    }
}

const PHASE_SIGMA_M: f64 = 0.003;
const PHASE_GROUPS: [Group; PHASES] = {
    const fn of(columns: &'static [&'static str]) -> Group {
        Group { columns, allowed: PHASE_ALLOWED, sigma: "sigma_phase_m", usual_sigma: PHASE_SIGMA_M }
    }
    [of(PHASE_COLUMNS[0]), of(PHASE_COLUMNS[1]), of(PHASE_COLUMNS[2]), of(PHASE_COLUMNS[3])]
};

fn three(values: &[f64]) -> Option<[f64; 3]> {
    values.get(..3)?.try_into().ok()
}

impl Found {
    /// The numbers of the row and their standard deviation; none where all fields are empty.
    fn read(&self, table: &TableCsv) -> Result<Option<(Vec<f64>, f64)>, FileError> {
        if self.columns.iter().all(|column| table.is_empty(*column)) {
            return Ok(None);
        }
        let mut numbers = Vec::new();
        for (column, allowed) in self.columns.iter().zip(self.group.allowed) {
            numbers.push(table.number_within(*column, allowed)?);
        }
        let sigma = match self.sigma.filter(|column| !table.is_empty(*column)) {
            Some(column) => table.number_within(column, &SIGMA)?,
            None => self.group.usual_sigma,
        };
        Ok(Some((numbers, sigma)))
    }
}

/// The time that each velocity of a file covers: since the last one, or the usual time where that is longer ago.
fn intervals(readings: &mut [Reading]) {
    let is_velocity = |reading: &&Reading| matches!(reading.value, Value::Velocity { .. });
    let times: Vec<f64> = readings.iter().filter(is_velocity).map(|reading| reading.t_s).collect();
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let usual_s = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let mut previous_s = f64::NEG_INFINITY;
    for reading in readings {
        if let Value::Velocity { interval_s, .. } = &mut reading.value {
            let since_s = reading.t_s - std::mem::replace(&mut previous_s, reading.t_s);
            *interval_s = if since_s < USUAL_INTERVALS * usual_s { since_s } else { usual_s };
        }
    }
}
