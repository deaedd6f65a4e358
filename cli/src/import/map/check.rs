//! The mapping file as it stands, and what is checked in it.

use serde::Deserialize;
use toml::Spanned;

use super::{Accelerometer, Channel, Column, Gyro, Index, Map, Temperature, Text, Time, one};
use crate::campaign::{Instrument, Role, Run, check_range, check_station, check_time};
use crate::file_error::{FileError, Problem};
use crate::import::axes::{Axes, Direction};
use crate::import::unit::{AccelerationUnit, AngleUnit, GyroUnit, TimeUnit};
use crate::import::windows::{Position, Series, Windows};
use crate::toml_file::TomlFile;

/// No time in seconds and no rate in Hz is larger: 1e9 s are 32 years.
const LARGEST: f64 = 1e9;

/// The whole file, every value that can be wrong with its place.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Raw {
    title: Option<String>,
    latitude_deg: Spanned<f64>,
    instrument: Option<RawInstrument>,
    #[serde(default)]
    text: Text,
    time: Spanned<RawTime>,
    #[serde(default = "one_sample")]
    samples_per_row: Spanned<u32>,
    gyro: Spanned<RawTriad<GyroUnit>>,
    accelerometer: Option<Spanned<RawTriad<AccelerationUnit>>>,
    temperature: Option<Temperature>,
    index: Option<Spanned<RawIndex>>,
    #[serde(default)]
    channel: Vec<Channel>,
    #[serde(default)]
    run: Vec<Spanned<RawRun>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawInstrument {
    name: Option<String>,
    arw_deg_per_sqrt_h: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTime {
    column: Option<Spanned<Column>>,
    unit: Option<TimeUnit>,
    columns: Option<Spanned<Vec<Spanned<Column>>>>,
    #[serde(default)]
    units: Vec<TimeUnit>,
    interval_s: Option<Spanned<f64>>,
    rate_hz: Option<Spanned<f64>>,
    duration_s: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTriad<Unit> {
    columns: Vec<Spanned<Column>>,
    unit: Unit,
    #[serde(default)]
    scale: Option<Spanned<Scale>>,
    axes: Option<Spanned<Vec<Direction>>>,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a number, or a list of numbers, one a column")]
enum Scale {
    Same(f64),
    Each(Vec<f64>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawIndex {
    column: Option<Spanned<Column>>,
    #[serde(default)]
    unit: AngleUnit,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    offset_deg: f64,
    angles_deg: Option<Spanned<Vec<f64>>>,
    dwell_s: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRun {
    #[serde(default)]
    start_s: f64,
    seconds: Option<Spanned<f64>>,
    every_s: Option<Spanned<f64>>,
    repeat: Option<Spanned<u32>>,
    #[serde(default)]
    role: Role,
    reference_azimuth_deg: Option<Spanned<f64>>,
    reference_sigma_deg: Option<Spanned<f64>>,
    station: Option<Spanned<String>>,
    latitude_deg: Option<Spanned<f64>>,
    started: Option<Spanned<String>>,
    #[serde(default)]
    positions: Vec<Position>,
}

fn one_sample() -> Spanned<u32> {
    Spanned::new(0..0, 1)
}

impl Raw {
    pub(super) fn check(self, file: TomlFile) -> Result<Map, FileError> {
        let latitude_deg =
            check_range(&file, "latitude_deg", Some(self.latitude_deg), -90.0, 90.0)?.unwrap_or_default();
        let instrument = self.instrument.map(|raw| raw.check(&file)).transpose()?;
        if *self.samples_per_row.get_ref() == 0 {
            let problem = Problem::not_allowed("samples_per_row = 0", "1 or more");
            return Err(file.at(self.samples_per_row.span(), problem));
        }
        let time = check_clock(self.time, &file)?;
        let gyro = check_gyro(self.gyro, &file)?;
        let accelerometer = self.accelerometer.map(|raw| check_accelerometer(raw, &file)).transpose()?;
        let index = match self.index {
            Some(index) => check_index(index, gyro.axes.is_some(), &file)?,
            None => check_placed(&self.run, gyro.axes.is_some(), &file)?,
        };
        let series = self.run.into_iter().map(|run| check_run(run, &index, &file)).collect::<Result<Vec<_>, _>>()?;
        let windows = Windows::new(if series.is_empty() { vec![Series::whole(index.schedule_s())] } else { series });
        check_names(&self.channel, &file)?;
        check_offsets(self.temperature.as_ref(), &self.channel, &file)?;
        Ok(Map {
            title: self.title,
            latitude_deg,
            instrument,
            text: self.text,
            time,
            samples_per_row: self.samples_per_row.into_inner(),
            gyro,
            accelerometer,
            temperature: self.temperature,
            index,
            channels: self.channel,
            windows,
            file,
        })
    }
}

impl RawInstrument {
    fn check(self, file: &TomlFile) -> Result<Instrument, FileError> {
        let arw_deg_per_sqrt_h = check_range(file, "arw_deg_per_sqrt_h", self.arw_deg_per_sqrt_h, 0.0, 1.0)?;
        Ok(Instrument { name: self.name, arw_deg_per_sqrt_h, settings: None })
    }
}

fn check_clock(raw: Spanned<RawTime>, file: &TomlFile) -> Result<Time, FileError> {
    let span = raw.span();
    let raw = raw.into_inner();
    let rate_hz = positive(file, "rate_hz", raw.rate_hz)?;
    let interval_s = match (positive(file, "interval_s", raw.interval_s)?, rate_hz) {
        (Some(_), Some(_)) => {
            return Err(file.at(span, Problem::Syntax("interval_s and rate_hz say the same: give one of them".into())));
        }
        (interval_s, rate_hz) => interval_s.or(rate_hz.map(f64::recip)),
    };
    let mut columns: Vec<_> = raw.column.map(|column| (column, raw.unit.unwrap_or_default())).into_iter().collect();
    if let Some(several) = raw.columns {
        if !columns.is_empty() || raw.unit.is_some() || several.get_ref().len() != raw.units.len() {
            let problem = "time is one column with its unit, or columns = [...] with as many units = [...]";
            return Err(file.at(several.span(), Problem::Syntax(problem.into())));
        }
        columns = several.into_inner().into_iter().zip(raw.units).collect();
    }
    if interval_s.is_none() && columns.is_empty() {
        let problem = "[time] needs a column, or the samples' interval_s, or their rate_hz";
        return Err(file.at(span, Problem::Syntax(problem.into())));
    }
    let duration_s = positive(file, "duration_s", raw.duration_s)?;
    Ok(Time { columns, interval_s, duration_s })
}

fn check_gyro(raw: Spanned<RawTriad<GyroUnit>>, file: &TomlFile) -> Result<Gyro, FileError> {
    let span = raw.span();
    let RawTriad { columns, unit, scale, axes } = raw.into_inner();
    let scale = check_scale(scale, columns.len(), file)?;
    let axes = match (columns.len(), axes) {
        (1, None) => None,
        (3, Some(axes)) => Some(check_axes(axes, 3, file)?),
        (1, Some(axes)) => {
            let problem = "a single gyro has no axes: its direction is the index angle; a sign is a scale of -1";
            return Err(file.at(axes.span(), Problem::Syntax(problem.into())));
        }
        (3, None) => {
            let problem =
                "a triad needs axes: where each of its columns points, such as [\"forward\", \"left\", \"up\"]";
            return Err(file.at(span, Problem::Syntax(problem.into())));
        }
        (count, _) => {
            let problem = Problem::not_allowed(format!("{count} gyro columns"), "1, or the 3 of a triad");
            return Err(file.at(span, problem));
        }
    };
    Ok(Gyro { columns, unit, scale, axes })
}

fn check_accelerometer(raw: Spanned<RawTriad<AccelerationUnit>>, file: &TomlFile) -> Result<Accelerometer, FileError> {
    let span = raw.span();
    let RawTriad { columns, unit, scale, axes } = raw.into_inner();
    if !(2..=3).contains(&columns.len()) {
        let problem = Problem::not_allowed(format!("{} accelerometer columns", columns.len()), "2 level ones, or 3");
        return Err(file.at(span, problem));
    }
    let Some(axes) = axes else {
        let problem = "accelerometers need axes: where each column points, such as [\"forward\", \"left\", \"up\"]";
        return Err(file.at(span, Problem::Syntax(problem.into())));
    };
    let axes = check_axes(axes, columns.len(), file)?;
    let scale = check_scale(scale, columns.len(), file)?;
    Ok(Accelerometer { columns, unit, scale, axes })
}

fn check_axes(axes: Spanned<Vec<Direction>>, count: usize, file: &TomlFile) -> Result<Axes, FileError> {
    if axes.get_ref().len() != count {
        let problem = Problem::not_allowed(format!("{} axes", axes.get_ref().len()), format!("{count}, one a column"));
        return Err(file.at(axes.span(), problem));
    }
    Axes::new(axes.get_ref()).map_err(|error| {
        file.at(axes.span(), Problem::Syntax(format!("these axes are not those of an instrument: {error}")))
    })
}

fn check_scale(scale: Option<Spanned<Scale>>, count: usize, file: &TomlFile) -> Result<Vec<f64>, FileError> {
    let Some(scale) = scale else { return Ok(vec![1.0; count]) };
    let span = scale.span();
    let scale = match scale.into_inner() {
        Scale::Same(scale) => vec![scale; count],
        Scale::Each(scale) => scale,
    };
    if scale.len() != count {
        let allowed = format!("one number, or {count}, one a column");
        return Err(file.at(span, Problem::not_allowed(format!("{} scales", scale.len()), allowed)));
    }
    match scale.iter().find(|scale| !scale.is_finite() || **scale == 0.0) {
        Some(bad) => Err(file.at(span, Problem::not_allowed(format!("scale = {bad}"), "any number but 0"))),
        None => Ok(scale),
    }
}

fn check_index(raw: Spanned<RawIndex>, triad: bool, file: &TomlFile) -> Result<Index, FileError> {
    let span = raw.span();
    let raw = raw.into_inner();
    if !(raw.scale.is_finite() && raw.scale != 0.0 && raw.offset_deg.is_finite()) {
        let value = format!("scale = {}, offset_deg = {}", raw.scale, raw.offset_deg);
        return Err(file.at(span, Problem::not_allowed(value, "any scale but 0, finite; any finite offset")));
    }
    match (raw.column, raw.angles_deg, raw.dwell_s) {
        (Some(column), None, None) if !triad => {
            let scale = raw.unit.deg() * raw.scale;
            Ok(Index::Measured { column, scale, offset_deg: raw.offset_deg })
        }
        (None, Some(angles_deg), dwell_s @ Some(_)) if triad => {
            let dwell_s = positive(file, "dwell_s", dwell_s)?.unwrap_or_default();
            let span = angles_deg.span();
            let angles_deg = angles_deg.into_inner();
            if angles_deg.is_empty() || !angles_deg.iter().all(|angle| angle.is_finite()) {
                let problem = Problem::not_allowed(format!("angles_deg = {angles_deg:?}"), "one angle or more, finite");
                return Err(file.at(span, problem));
            }
            Ok(Index::Virtual { angles_deg, dwell_s })
        }
        _ => {
            let needed = if triad {
                "the index of a triad is virtual: [index] needs angles_deg and dwell_s, and no column"
            } else {
                "the index of a single gyro is measured: [index] needs a column, and no angles_deg or dwell_s"
            };
            Err(file.at(span, Problem::Syntax(needed.into())))
        }
    }
}

/// Without an index every run says at which angle each of its files was recorded.
fn check_placed(runs: &[Spanned<RawRun>], triad: bool, file: &TomlFile) -> Result<Index, FileError> {
    let refuse = |problem: &str, run: Option<&Spanned<RawRun>>| {
        let problem = Problem::Syntax(problem.into());
        match run {
            Some(run) => Err(file.at(run.span(), problem)),
            None => Err(FileError::whole(file.path(), problem)),
        }
    };
    if runs.is_empty() || triad {
        let problem = "[index] is missing: a column of a single gyro, or angles_deg and dwell_s of a triad; or, with a file \
                       for each position of a single gyro, positions = [{ file = ..., index_deg = ... }] in each [[run]]";
        return refuse(problem, None);
    }
    for run in runs {
        let raw = run.get_ref();
        if raw.positions.is_empty() {
            return refuse(
                "without [index] each run needs positions = [{ file = ..., index_deg = ... }, ...]",
                Some(run),
            );
        }
        if raw.start_s != 0.0 || raw.seconds.is_some() || raw.every_s.is_some() || raw.repeat.is_some() {
            return refuse("a run made of files holds them whole: no start_s, seconds, every_s or repeat", Some(run));
        }
        if let Some(position) = raw.positions.iter().find(|position| !position.index_deg.is_finite()) {
            let value = format!("index_deg = {}", position.index_deg);
            return Err(file.at(run.span(), Problem::not_allowed(value, "a finite angle")));
        }
    }
    Ok(Index::Placed)
}

fn check_run(raw: Spanned<RawRun>, index: &Index, file: &TomlFile) -> Result<Series, FileError> {
    let span = raw.span();
    let raw = raw.into_inner();
    let refuse = |problem: &str| Err(file.at(span.clone(), Problem::Syntax(problem.into())));
    if !(0.0..f64::INFINITY).contains(&raw.start_s) {
        let problem = Problem::not_allowed(format!("start_s = {}", raw.start_s), "0 or more");
        return Err(file.at(span, problem));
    }
    let given_s = positive(file, "seconds", raw.seconds)?;
    let seconds = match (index.schedule_s(), given_s) {
        (Some(_), Some(_)) => return refuse("a run of a virtual index is as long as its dwells: leave out `seconds`"),
        (schedule_s, given_s) => schedule_s.or(given_s),
    };
    let every_s = positive(file, "every_s", raw.every_s)?;
    let repeat = match (raw.repeat.map(Spanned::into_inner), every_s) {
        (Some(0), _) => return refuse("repeat = 0 is not allowed; allowed is 1 or more"),
        (Some(_), None) => return refuse("a run that is repeated needs every_s: from one beginning to the next"),
        (None, None) => Some(1),
        (repeat, Some(_)) => repeat,
    };
    if repeat != Some(1) && raw.started.is_some() {
        return refuse("`started` is the time of one run; this one is repeated");
    }
    if repeat != Some(1) && seconds.is_none() {
        return refuse("a run that is repeated needs `seconds`: its length");
    }
    if !raw.positions.is_empty() && !matches!(index, Index::Placed) {
        return refuse("`positions` is for runs made of a file for each position, without [index]");
    }
    let run = Run {
        file: String::new(),
        role: raw.role,
        reference_azimuth_deg: check_range(file, "reference_azimuth_deg", raw.reference_azimuth_deg, -360.0, 360.0)?,
        reference_sigma_deg: check_range(file, "reference_sigma_deg", raw.reference_sigma_deg, 0.0, 360.0)?,
        latitude_deg: check_range(file, "latitude_deg", raw.latitude_deg, -90.0, 90.0)?,
        station: raw.station.map(|station| check_station(file, station)).transpose()?,
        started: raw.started.map(|started| check_time(file, started)).transpose()?,
    };
    let positions = raw.positions;
    Ok(Series { span, start_s: raw.start_s, seconds, every_s: every_s.unwrap_or_default(), repeat, positions, run })
}

/// Names of channels must not be those of the columns that every run has.
fn check_names(channels: &[Channel], file: &TomlFile) -> Result<(), FileError> {
    const TAKEN: [&str; 7] = ["t_s", "index_deg", "fog_arcsec", "temp_c", "ax_g", "ay_g", "lost_frames"];
    for (i, channel) in channels.iter().enumerate() {
        let name = channel.name.get_ref();
        let twice = channels.iter().take(i).any(|earlier| earlier.name.get_ref() == name);
        if name.trim().is_empty() || TAKEN.contains(&name.as_str()) || twice {
            let allowed = format!("a name of its own, other than {}", TAKEN.join(", "));
            return Err(file.at(channel.name.span(), Problem::not_allowed(format!("name = {name:?}"), allowed)));
        }
    }
    Ok(())
}

/// What is added to and multiplied with a reading is finite.
fn check_offsets(temperature: Option<&Temperature>, channels: &[Channel], file: &TomlFile) -> Result<(), FileError> {
    let of_temperature = temperature.map(|it| (it.column.span(), it.scale, it.offset));
    let of_channels = channels.iter().map(|it| (it.column.span(), it.scale, it.offset));
    for (span, scale, offset) in of_temperature.into_iter().chain(of_channels) {
        if !(scale.is_finite() && scale != 0.0 && offset.is_finite()) {
            let value = format!("scale = {scale}, offset = {offset}");
            return Err(file.at(span, Problem::not_allowed(value, "any scale but 0, finite; any finite offset")));
        }
    }
    Ok(())
}

/// A number above 0.
fn positive(file: &TomlFile, name: &str, value: Option<Spanned<f64>>) -> Result<Option<f64>, FileError> {
    match value {
        Some(value) if !(*value.get_ref() > 0.0 && *value.get_ref() <= LARGEST) => {
            let problem =
                Problem::not_allowed(format!("{name} = {:?}", value.get_ref()), "a number above 0, at most 1e9");
            Err(file.at(value.span(), problem))
        }
        value => Ok(value.map(Spanned::into_inner)),
    }
}
