//! Scenarios: what the world and the instrument are like, in a file with a name.
//!
//! A scenario is TOML. Everything has a default (a calm bench, a healthy instrument), so that a file says only what is
//! different. Every number has an allowed range; what is outside is refused with the file, the line, the field, the value
//! and the range.

mod block;
pub mod check;
mod describe;
mod devices;
mod error;
mod gyro;
mod library;
mod operator;
mod sense;
mod site;

pub use block::{Block, Carry};
pub use describe::{Field, Group, Table};
pub use devices::{
    Accelerometer, Analogue, AnalogueSource, Encoder, Link, LinkFault, LinkFaultKind, Motor, SensorFault,
    SensorFaultKind,
};
pub use error::ScenarioError;
pub use gyro::{Gyro, GyroFault, GyroFaultKind, GyroFormat, Harmonic};
pub use operator::Operator;
pub use site::{Base, BaseAngle, Relevel, Rocking, Shock, Site, Supply, Sway, Wind};

use check::{Any, Findings, Inner, Part, part};
use std::io::{self, Read};
use std::path::Path;

part! {
    /// A scenario.
    Scenario {
        /// Short name, lower-case words with hyphens; empty when the file does not say it.
        name: String = String::new(), Any;
        /// What it is about, in one line.
        description: String = String::new(), Any;
        /// Time after which a fix that has not ended is given up, s.
        duration_limit_s: f64 = 900.0, 1.0..=1e6;
        /// The place.
        site: Site = Site::default(), Inner;
        /// The base and its motions.
        base: Base = Base::default(), Inner;
        /// The supply voltage.
        supply: Supply = Supply::default(), Inner;
        /// What is wired to the analogue inputs.
        analogue: Analogue = Analogue::default(), Inner;
        /// The gyro.
        gyro: Gyro = Gyro::default(), Inner;
        /// The accelerometer.
        accelerometer: Accelerometer = Accelerometer::default(), Inner;
        /// The block of three gyros and three accelerometers, if the instrument has one.
        block: Option<Block> = None, Inner;
        /// The encoder.
        encoder: Encoder = Encoder::default(), Inner;
        /// The index drive.
        motor: Motor = Motor::default(), Inner;
        /// The line from the gyro.
        link: Link = Link::default(), Inner;
        /// The instrument is carried to another place after the fix.
        carry: Option<Carry> = None, Inner;
        /// Who turns it when the accelerometers are calibrated.
        operator: Operator = Operator::default(), Inner;
        /// Settings of the firmware that this scenario overrides. The simulator does not look into it.
        instrument: toml::Table = toml::Table::new(), Any;
    }
}

impl Scenario {
    /// The built-in scenario of that name.
    ///
    /// Errors: [`ScenarioError::UnknownName`] lists the names that there are.
    pub fn named(name: &str) -> Result<Self, ScenarioError> {
        match library::text_of(name) {
            Some(text) => Self::parse(text, &format!("scenarios/{name}.toml")),
            None => Err(ScenarioError::UnknownName {
                name: name.to_owned(),
                known: Self::names().map(|(name, _)| name).collect(),
            }),
        }
    }

    /// Name and description of every built-in scenario, the default first.
    pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
        library::names()
    }

    /// Reads a scenario from text; `file` is used in errors only.
    ///
    /// Errors: TOML that cannot be read, unknown fields, wrong types, values out of range: with file, line and field.
    pub fn parse(text: &str, file: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = toml::from_str(text).map_err(|error| ScenarioError::syntax(file, text, &error))?;
        match scenario.violations().into_iter().next() {
            None => Ok(scenario),
            Some(violation) => Err(ScenarioError::value(file, text, &violation)),
        }
    }

    /// Reads a scenario file.
    ///
    /// Errors: as [`Scenario::parse`], and [`ScenarioError::Unreadable`].
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let file = path.display().to_string();
        match read(path) {
            Ok(text) => Self::parse(&text, &file),
            Err(error) => Err(ScenarioError::Unreadable { file, reason: error.to_string() }),
        }
    }

    /// Everything that a scenario file may hold, group by group.
    pub fn describe() -> Vec<Group> {
        let mut groups = Vec::new();
        <Self as Part>::describe(Table::default(), &mut groups);
        groups
    }

    /// Every value that is out of its range or contradicts another, also for scenarios that a program changed after reading.
    pub fn violations(&self) -> Vec<check::Violation> {
        let mut findings = Findings::default();
        self.check(&mut findings);
        sense::check(self, &mut findings);
        findings.violations
    }
}

/// Longest scenario file, bytes: a hundred times the longest built-in one.
const LONGEST_FILE: u64 = 1 << 20;

/// The text of a scenario file: a device or a pipe might never end, and no such file is long.
fn read(path: &Path) -> io::Result<String> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is no regular file"));
    }
    let mut text = String::new();
    std::fs::File::open(path)?.take(LONGEST_FILE + 1).read_to_string(&mut text)?;
    match text.len() as u64 > LONGEST_FILE {
        true => Err(io::Error::new(io::ErrorKind::InvalidData, "more than 1 MiB: this is no scenario")),
        false => Ok(text),
    }
}
