//! Proposes a mapping for a recording that nobody has described: delimiter, header, columns, units by the size of gravity
//! and of the Earth's rate, interval, axes. It is a file to edit, with the reason for each guess beside it.

use std::fmt::Write;
use std::io::Read;
use std::path::Path;

use north_finder::earth::EARTH_RATE_DEG_H;
use north_finder::units::STANDARD_GRAVITY_M_S2;

use super::text::refuse_binary;
use crate::file_error::{FileError, Problem};

/// So much of the file is looked at.
const LOOKED_AT: u64 = 4 << 20;
/// A size that agrees within this factor is recognised.
const FACTOR: f64 = 2.0;
/// The vertical accelerometer reads this share of gravity at least.
const UPRIGHT: f64 = 0.8;

/// The recording's head as numbers.
struct Table {
    delimiter: &'static str,
    comment: char,
    decimal_comma: bool,
    header_rows: usize,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

/// What a column is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Time,
    Gyro,
    Accelerometer,
    Temperature,
    Index,
    Other,
}

/// A unit as the mapping names it, and the scale of its column.
struct Unit {
    name: &'static str,
    scale: f64,
    why: String,
}

/// The text of a mapping for the recording.
///
/// Errors: no such file, a binary file, no rows of numbers.
pub fn guess(path: &Path, latitude_deg: Option<f64>) -> Result<String, FileError> {
    let io = |error| FileError::whole(path, Problem::Io(error));
    let mut head = Vec::new();
    crate::input::open(path).map_err(io)?.take(LOOKED_AT).read_to_end(&mut head).map_err(io)?;
    refuse_binary(path, &head)?;
    let text = String::from_utf8_lossy(&head);
    let table = Table::read(&text).ok_or_else(|| {
        let problem = "no rows of numbers with the same number of columns were found: this is not a text recording";
        FileError::whole(path, Problem::Syntax(problem.into()))
    })?;
    Ok(table.mapping(&path.display().to_string(), latitude_deg))
}

impl Table {
    fn read(text: &str) -> Option<Self> {
        // The last line may be cut off by the limit of what is looked at.
        let whole = text.rfind('\n').map_or(text, |end| &text[..end]);
        let lines: Vec<&str> = whole.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        let comment =
            ['#', '%', '!'].into_iter().find(|&mark| lines.first().is_some_and(|line| line.starts_with(mark)));
        let comment = comment.unwrap_or('#');
        let lines: Vec<&str> = lines.into_iter().filter(|line| !line.starts_with(comment)).collect();
        let middle = *lines.get(lines.len() / 2)?;
        let (delimiter, decimal_comma) =
            [(";", true), ("\t", true), (";", false), ("\t", false), (",", false), (" ", true), (" ", false)]
                .into_iter()
                .find(|&(delimiter, comma)| {
                    let fields = split(middle, delimiter);
                    fields.len() > 1
                        && fields.iter().all(|field| number(field, comma).is_some())
                        && (!comma || fields.iter().any(|field| field.contains(',')))
                })?;
        let width = split(middle, delimiter).len();
        let row = |line: &str| -> Option<Vec<f64>> {
            let fields = split(line, delimiter);
            (fields.len() == width).then(|| fields.iter().map(|field| number(field, decimal_comma)).collect())?
        };
        let header_rows = lines.iter().take_while(|line| row(line).is_none()).count();
        let names = header_rows
            .checked_sub(1)
            .and_then(|last| lines.get(last))
            .map_or(Vec::new(), |line| split(line, delimiter));
        let names =
            if names.len() == width { names.iter().map(|name| (*name).to_owned()).collect() } else { Vec::new() };
        let mut columns = vec![Vec::new(); width];
        for values in lines.iter().skip(header_rows).map_while(|line| row(line)) {
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        }
        columns[0].first()?;
        Some(Self { delimiter, comment, decimal_comma, header_rows, names, columns })
    }

    fn name(&self, column: usize) -> String {
        match self.names.get(column) {
            Some(name) if self.names.iter().filter(|each| *each == name).count() == 1 => format!("{name:?}"),
            _ => (column + 1).to_string(),
        }
    }

    fn mean(&self, column: usize) -> f64 {
        self.columns[column].iter().sum::<f64>() / self.columns[column].len() as f64
    }

    /// By its name; without one, a column that rises by even steps is the time.
    fn kind(&self, column: usize) -> Kind {
        let name = self.names.get(column).map(|name| name.to_lowercase()).unwrap_or_default();
        let begins = |words: &[&str]| words.iter().any(|word| name.starts_with(word));
        let holds = |words: &[&str]| words.iter().any(|word| name.contains(word));
        let rises = self.columns[column].len() > 1 && self.columns[column].windows(2).all(|pair| pair[1] > pair[0]);
        if rises && (name.is_empty() || begins(&["t_", "time", "stamp", "sec", "tow"]) || name == "t") {
            Kind::Time
        } else if holds(&["temp", "degc", "celsius"]) {
            Kind::Temperature
        } else if holds(&["acc"]) || begins(&["ax", "ay", "az", "fx", "fy", "fz", "f_"]) {
            Kind::Accelerometer
        } else if holds(&["gyr", "omega", "rate", "fog"])
            || begins(&["gx", "gy", "gz", "wx", "wy", "wz", "w_"])
            || name == "w"
        {
            Kind::Gyro
        } else if holds(&["index", "enc", "angle", "theta"]) {
            Kind::Index
        } else {
            Kind::Other
        }
    }

    fn mapping(&self, file: &str, latitude_deg: Option<f64>) -> String {
        let mut kinds: Vec<Kind> = (0..self.columns.len()).map(|column| self.kind(column)).collect();
        let of = |kinds: &[Kind], kind| (0..kinds.len()).filter(|&column| kinds[column] == kind).collect::<Vec<_>>();
        // Six unnamed columns, or six after a time: the order that most loggers have.
        let unnamed = of(&kinds, Kind::Other);
        if self.names.is_empty() && unnamed.len() >= 6 {
            let larger = |columns: &[usize]| self.norm(columns);
            let (first, second) = (&unnamed[..3], &unnamed[3..6]);
            let gyro_first = larger(first) < larger(second);
            for (columns, is_gyro) in [(first, gyro_first), (second, !gyro_first)] {
                columns
                    .iter()
                    .for_each(|&column| kinds[column] = if is_gyro { Kind::Gyro } else { Kind::Accelerometer });
            }
        }
        let [time, gyro, accelerometer, temperature, index] =
            [Kind::Time, Kind::Gyro, Kind::Accelerometer, Kind::Temperature, Kind::Index].map(|kind| of(&kinds, kind));
        let step = time.first().map(|&column| self.median_step(column));

        let mut out = String::new();
        let mut line = |text: String| {
            let _ = writeln!(out, "{text}");
        };
        line(format!("# A proposal for {file}, from its first {} rows. Check every line.", self.columns[0].len()));
        line("format = 1".into());
        let by_triad = self.latitude_deg(&gyro, &accelerometer);
        match (latitude_deg, by_triad) {
            (Some(given), _) => line(format!("latitude_deg = {given:?}")),
            (None, Some(found)) => line(format!(
                "latitude_deg = {found:.2}                  # EDIT: from the angle between gravity and the triad's mean rate"
            )),
            (None, None) => {
                line("latitude_deg = 0.0                    # EDIT: nothing in the recording tells it".into())
            }
        }
        line("\n[text]".into());
        let delimiter = match self.delimiter {
            "\t" => "tab",
            " " => "whitespace",
            other => other,
        };
        line(format!("delimiter = {delimiter:?}\ncomment = \"{}\"\nheader_rows = {}", self.comment, self.header_rows));
        if self.decimal_comma {
            line("decimal_comma = true".into());
        }
        line("\n[time]".into());
        let interval_s = match (time.first(), step) {
            (Some(&column), Some(step)) => {
                let (unit, seconds) = time_unit(&self.names.get(column).cloned().unwrap_or_default(), step);
                line(format!(
                    "column = {}\nunit = {unit:?}                           # the usual step is {step:.6} {unit}",
                    self.name(column)
                ));
                step * seconds
            }
            _ => {
                line("interval_s = 0.01                     # EDIT: no column rises like a time".into());
                0.01
            }
        };
        let triad = gyro.len() >= 3;
        let gyro = &gyro[..gyro.len().min(if triad { 3 } else { 1 })];
        let up = self.upright(&accelerometer);
        line("\n[gyro]".into());
        if gyro.is_empty() {
            line("columns = [1]                         # EDIT: no column is recognised as a gyro's".into());
        } else {
            line(format!(
                "columns = [{}]",
                gyro.iter().map(|&column| self.name(column)).collect::<Vec<_>>().join(", ")
            ));
        }
        let size = self.norm(gyro);
        let unit = gyro_unit(&self.name_of(gyro), size, interval_s, triad);
        line(format!("unit = {:?}                         # {}", unit.name, unit.why));
        if unit.scale != 1.0 {
            line(format!("scale = {:.6e}", unit.scale));
        }
        if triad {
            line(format!("axes = {:?}       # EDIT: a guess, only the vertical one is seen in the data", axes(up)));
        }
        if accelerometer.len() >= 2 {
            line("\n[accelerometer]".into());
            let columns = &accelerometer[..accelerometer.len().min(3)];
            line(format!(
                "columns = [{}]",
                columns.iter().map(|&column| self.name(column)).collect::<Vec<_>>().join(", ")
            ));
            let axes = if columns.len() == 3 { axes(up).to_vec() } else { vec!["forward", "left"] };
            let unit = acceleration_unit(self.norm(columns), interval_s, columns.len() == 3);
            line(format!("axes = {axes:?}\nunit = {:?}                              # {}", unit.name, unit.why));
            if unit.scale != 1.0 {
                line(format!("scale = {:.6e}", unit.scale));
            }
        }
        if let Some(&column) = temperature.first() {
            line(format!("\n[temperature]\ncolumn = {}\nunit = \"degC\"", self.name(column)));
        }
        line("\n[index]".into());
        match (triad, index.first()) {
            (true, _) => line(
                "angles_deg = [0, 90, 180, 270]        # the triad read as one gyro; `north align` solves it whole\ndwell_s = 60".into(),
            ),
            (false, Some(&column)) => line(format!("column = {}\nunit = \"deg\"", self.name(column))),
            (false, None) => line("column = 1                            # EDIT: no column is recognised as an index angle".into()),
        }
        for column in of(&kinds, Kind::Other) {
            if let Some(name) = self.names.get(column) {
                line(format!("\n[[channel]]\nname = {:?}\ncolumn = {}", name.to_lowercase(), self.name(column)));
            }
        }
        out
    }

    fn name_of(&self, columns: &[usize]) -> String {
        columns.first().and_then(|&column| self.names.get(column)).map(|name| name.to_lowercase()).unwrap_or_default()
    }

    fn median_step(&self, column: usize) -> f64 {
        let mut steps: Vec<f64> = self.columns[column].windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_unstable_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(0.0)
    }

    fn norm(&self, columns: &[usize]) -> f64 {
        columns.iter().map(|&column| self.mean(column).powi(2)).sum::<f64>().sqrt()
    }

    /// Which of three accelerometers stands upright, and whether it reads upwards.
    fn upright(&self, columns: &[usize]) -> Option<(usize, bool)> {
        let three = columns.get(..3)?;
        let norm = self.norm(three);
        (0..3).find(|&i| self.mean(three[i]).abs() > UPRIGHT * norm).map(|i| (i, self.mean(three[i]) > 0.0))
    }

    /// Magnitude of the latitude from sin φ = ω·f/(|ω||f|), with its sign if the columns of both triads are alike.
    fn latitude_deg(&self, gyro: &[usize], accelerometer: &[usize]) -> Option<f64> {
        let (gyro, accelerometer) = (gyro.get(..3)?, accelerometer.get(..3)?);
        let dot: f64 = gyro.iter().zip(accelerometer).map(|(&g, &a)| self.mean(g) * self.mean(a)).sum();
        let sine = dot / (self.norm(gyro) * self.norm(accelerometer));
        sine.is_finite().then(|| sine.clamp(-1.0, 1.0).asin().to_degrees())
    }
}

fn split<'a>(line: &'a str, delimiter: &str) -> Vec<&'a str> {
    match delimiter {
        " " => line.split_whitespace().collect(),
        delimiter => line.split(delimiter).map(|field| field.trim().trim_matches('"')).collect(),
    }
}

fn number(field: &str, decimal_comma: bool) -> Option<f64> {
    let value = if decimal_comma { field.replacen(',', ".", 1).parse::<f64>() } else { field.parse::<f64>() };
    value.ok().filter(|value| value.is_finite())
}

/// A right-handed triad whose `up.0`-th axis is vertical.
fn axes(up: Option<(usize, bool)>) -> [&'static str; 3] {
    match up {
        Some((0, true)) => ["up", "forward", "left"],
        Some((0, false)) => ["down", "left", "forward"],
        Some((1, true)) => ["left", "up", "forward"],
        Some((1, false)) => ["forward", "down", "left"],
        Some((_, false)) => ["forward", "right", "down"],
        Some((_, true)) | None => ["forward", "left", "up"],
    }
}

fn time_unit(name: &str, step: f64) -> (&'static str, f64) {
    let name = name.to_lowercase();
    let named = [("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3), ("min", 60.0)].into_iter().find(|(unit, _)| {
        name.ends_with(&format!("_{unit}"))
            || name.ends_with(&format!("[{unit}]"))
            || name.ends_with(&format!("({unit})"))
    });
    // Nobody samples slower than once in 100 s: larger steps are smaller units.
    named.unwrap_or(match step {
        step if step > 1e5 => ("ns", 1e-9),
        step if step > 100.0 => ("us", 1e-6),
        step if step > 1.0 => ("ms", 1e-3),
        _ => ("s", 1.0),
    })
}

/// The unit in which the size is nearest to what is expected.
fn by_size(size: f64, expected: &[(&'static str, f64)]) -> Option<&'static str> {
    let away = |expected: f64| (size / expected).ln().abs();
    let nearest = expected.iter().min_by(|a, b| away(a.1).total_cmp(&away(b.1)))?;
    (away(nearest.1) < FACTOR.ln()).then_some(nearest.0)
}

fn gyro_unit(name: &str, size: f64, interval_s: f64, triad: bool) -> Unit {
    let deg_s = EARTH_RATE_DEG_H / 3600.0;
    let rad_s = deg_s.to_radians();
    let rates = [("deg/h", EARTH_RATE_DEG_H), ("deg/s", deg_s), ("rad/s", rad_s)];
    let increments =
        [("arcsec", EARTH_RATE_DEG_H * interval_s), ("deg", deg_s * interval_s), ("rad", rad_s * interval_s)];
    let named = [
        ("deg_h", "deg/h"),
        ("deg/h", "deg/h"),
        ("deg_s", "deg/s"),
        ("deg/s", "deg/s"),
        ("dps", "deg/s"),
        ("rad_s", "rad/s"),
        ("rad/s", "rad/s"),
        ("arcsec", "arcsec"),
    ]
    .into_iter()
    .find(|(word, _)| name.contains(word));
    let unit = |name, scale, why: String| Unit { name, scale, why };
    if let Some((_, named)) = named {
        return unit(named, 1.0, "by the column's name".into());
    }
    if !triad {
        return unit("deg/h", 1.0, "EDIT: one gyro alone does not tell its unit".into());
    }
    match by_size(size, &[rates, increments].concat()) {
        Some(found) => unit(found, 1.0, format!("the triad's mean is {size:.4e}: the Earth's rate in this unit")),
        None => unit(
            "arcsec",
            EARTH_RATE_DEG_H * interval_s / size,
            format!(
                "EDIT: the triad's mean is {size:.4e}, no unit's Earth rate: counts of a scale that makes it so, or a bias"
            ),
        ),
    }
}

fn acceleration_unit(size: f64, interval_s: f64, triad: bool) -> Unit {
    let unit = |name, scale, why: String| Unit { name, scale, why };
    if !triad {
        return unit("g", 1.0, "EDIT: two level accelerometers do not tell their unit".into());
    }
    let expected = [
        ("g", 1.0),
        ("mg", 1e3),
        ("ug", 1e6),
        ("m/s2", STANDARD_GRAVITY_M_S2),
        ("m/s", STANDARD_GRAVITY_M_S2 * interval_s),
        ("g*s", interval_s),
    ];
    match by_size(size, &expected) {
        Some(found) => unit(found, 1.0, format!("the mean is {size:.4e}: gravity in this unit")),
        None => unit(
            "g",
            1.0 / size,
            format!("EDIT: the mean is {size:.4e}, no unit's gravity: counts of a scale that makes it so, or offsets"),
        ),
    }
}
