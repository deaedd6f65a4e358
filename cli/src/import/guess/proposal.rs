//! The text of the mapping that is proposed.

use std::path::Path;

use super::columns::{Columns, Kind, by_axis};
use super::table::Table;
use super::units::{self, Unit};

/// The vertical accelerometer reads this share of gravity at least.
const UPRIGHT: f64 = 0.8;
/// Dwells of a virtual index, seconds, where the recording is long enough, and how many there are.
const DWELL_S: f64 = 60.0;
const DWELLS: f64 = 4.0;
/// Where the reasons stand.
const REASONS: usize = 38;

/// A mapping that is being written.
struct Proposal<'a> {
    table: &'a Table,
    columns: Columns,
    gyro: Vec<usize>,
    accelerometer: Vec<usize>,
    /// Whether the names of either are those of axes, in whose order they then stand.
    by_name: [bool; 2],
    /// Time between rows, seconds, where a column tells it.
    interval_s: Option<f64>,
    lines: Vec<String>,
}

/// The mapping for a table, which is in the file.
pub fn of(table: &Table, file: &Path, latitude_deg: Option<f64>) -> String {
    let columns = Columns::of(table);
    let interval_s = columns.first(Kind::Time).map(|column| {
        let step = table.median_step(column);
        step * units::of_time(table, column, step).1
    });
    let (gyro, accelerometer) = (columns.all(Kind::Gyro), columns.all(Kind::Accelerometer));
    let (gyro_axes, force_axes) = (by_axis(table, &gyro), by_axis(table, &accelerometer));
    let by_name = [gyro_axes.is_some(), force_axes.is_some()];
    let (gyro, accelerometer) = (gyro_axes.unwrap_or(gyro), force_axes.unwrap_or(accelerometer));
    let mut proposal = Proposal { table, columns, gyro, accelerometer, by_name, interval_s, lines: Vec::new() };
    let unit = units::of_gyro(table, &proposal.gyro, interval_s, proposal.columns.first(Kind::Index));
    proposal.head(file, latitude_deg, &unit);
    proposal.text();
    proposal.time();
    proposal.gyro(&unit);
    proposal.accelerometer();
    proposal.others();
    proposal.index_and_runs(file);
    proposal.lines.join("\n") + "\n"
}

impl Proposal<'_> {
    fn line(&mut self, line: impl Into<String>) {
        self.lines.push(line.into());
    }

    /// A line with the reason for it.
    fn because(&mut self, line: impl AsRef<str>, why: impl AsRef<str>) {
        self.lines.push(format!("{:<REASONS$}# {}", line.as_ref(), why.as_ref()));
    }

    fn head(&mut self, file: &Path, latitude_deg: Option<f64>, unit: &Unit) {
        let rows = self.table.columns[0].len();
        self.line(format!(
            "# A proposal for {}, from its first {rows} rows. Check every line; an import",
            file.display()
        ));
        self.line("# refuses what is marked EDIT and cannot be told.");
        if let Some(bad) = self.table.bad_rows() {
            self.line(format!("# EDIT: an import stops at {bad}: correct or remove them first."));
        }
        self.line("format = 1");
        match latitude_deg.or(self.latitude_deg().filter(|_| unit.is_known)) {
            Some(given) if latitude_deg.is_some() => self.line(format!("latitude_deg = {given:?}")),
            Some(found) => self.because(
                format!("latitude_deg = {found:.2}"),
                "EDIT: from the angle between gravity and the triad's mean rate",
            ),
            None => self.because("latitude_deg = nan", "EDIT: nothing in the recording tells it"),
        }
    }

    fn text(&mut self) {
        let Table { delimiter, comment, decimal_comma, header_rows, names_row, footer_rows, .. } = *self.table;
        let delimiter = match delimiter {
            "\t" => "tab",
            " " => "whitespace",
            other => other,
        };
        self.line("\n[text]");
        self.line(format!("delimiter = {delimiter:?}"));
        self.line(format!("comment = \"{comment}\""));
        self.line(format!("header_rows = {header_rows}"));
        if let Some(row) = names_row {
            self.because(format!("names_row = {row}"), "below it stand units");
        }
        if footer_rows > 0 {
            self.because(format!("footer_rows = {footer_rows}"), "lines at the end that are no rows of numbers");
        }
        if decimal_comma {
            self.line("decimal_comma = true");
        }
    }

    fn time(&mut self) {
        self.line("\n[time]");
        let Some(column) = self.columns.first(Kind::Time) else {
            return self.because("interval_s = 0", "EDIT: no column is recognised as the time");
        };
        let step = self.table.median_step(column);
        let (unit, _, by_name) = units::of_time(self.table, column, step);
        self.line(format!("column = {}", self.table.name(column)));
        let doubt = if by_name { "" } else { "EDIT: no name tells the unit; " };
        let of_step = if self.table.moments == Some(column) { "s" } else { unit };
        self.because(format!("unit = {unit:?}"), format!("{doubt}the usual step is {step:.6} {of_step}"));
    }

    fn gyro(&mut self, unit: &Unit) {
        self.line("\n[gyro]");
        match self.gyro[..] {
            [] => self.because("columns = [\"EDIT\"]", "EDIT: no column is recognised as a gyro's"),
            _ => self.line(format!("columns = {}", self.names(&self.gyro))),
        }
        self.unit(unit);
        if self.is_triad() {
            let axes = axes(self.upright());
            let why = match self.by_name[0] {
                true => "EDIT: x, y, z by the columns' names; only the vertical one is seen in the data",
                false => "EDIT: a guess, only the vertical one is seen in the data",
            };
            self.because(format!("axes = {axes:?}"), why);
        }
    }

    fn accelerometer(&mut self) {
        let columns = self.accelerometer.clone();
        if columns.len() < 2 {
            return;
        }
        self.line("\n[accelerometer]");
        self.line(format!("columns = {}", self.names(&columns)));
        let axes = if columns.len() == 3 { axes(self.upright()).to_vec() } else { vec!["forward", "left"] };
        let why = if self.by_name[1] { "EDIT: x, y, z by the columns' names" } else { "EDIT: a guess" };
        self.because(format!("axes = {axes:?}"), why);
        self.unit(&units::of_acceleration(self.table, &columns, self.interval_s));
    }

    fn unit(&mut self, unit: &Unit) {
        self.because(format!("unit = {:?}", unit.name), &unit.why);
        if unit.scale != 1.0 {
            self.line(format!("scale = {:.6e}", unit.scale));
        }
    }

    /// Temperature and channels.
    fn others(&mut self) {
        if let Some(column) = self.columns.first(Kind::Temperature) {
            self.line(format!("\n[temperature]\ncolumn = {}", self.table.name(column)));
            self.because("unit = \"degC\"", "EDIT: or degF, K");
        }
        for column in self.columns.all(Kind::Other) {
            if let Some(name) = self.table.names.get(column).filter(|name| !name.is_empty()) {
                self.line(format!(
                    "\n[[channel]]\nname = {:?}\ncolumn = {}",
                    name.to_lowercase(),
                    self.table.name(column)
                ));
            }
        }
    }

    fn index_and_runs(&mut self, file: &Path) {
        match (self.is_triad(), self.columns.first(Kind::Index)) {
            (true, _) => self.virtual_index(),
            (false, Some(column)) => {
                self.line(format!("\n[index]\ncolumn = {}", self.table.name(column)));
                self.because("unit = \"deg\"", "EDIT: or rad, turn; counter-clockwise from above, or scale = -1");
                self.run("role = \"fit\"", "it may be learned from; \"check\" (the default): only judged");
                self.reference();
                self.line("# seconds = 240                       # EDIT: where the recording holds several runs, one [[run]] each, with start_s");
            }
            (false, None) => {
                let name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                self.run("role = \"fit\"", "it may be learned from; \"check\" (the default): only judged");
                self.because(
                    format!("positions = [{{ file = {name:?}, index_deg = 0 }}]"),
                    "EDIT: no column is recognised as an index angle: a file for each position, one here; the command's FILE is their folder",
                );
            }
        }
    }

    /// The triad read as one gyro; every other run is only judged.
    fn virtual_index(&mut self) {
        let seconds = self.interval_s.map(|interval_s| interval_s * (self.table.rows_of_file - 1.0));
        let dwell_s = seconds.map_or(DWELL_S, |seconds| DWELL_S.min((seconds / DWELLS * 10.0).floor() / 10.0));
        let schedule_s = DWELLS * dwell_s;
        self.line("\n[index]");
        self.because("angles_deg = [0, 90, 180, 270]", "the triad read as one gyro; `north align` solves it whole");
        self.line(format!("dwell_s = {dwell_s:?}"));
        self.run("role = \"fit\"", "it may be learned from");
        if seconds.is_some_and(|seconds| seconds >= 2.0 * schedule_s) {
            self.line(format!("every_s = {:?}", 2.0 * schedule_s));
            self.reference();
            self.run("role = \"check\"", "every other run is only judged");
            self.line(format!("start_s = {schedule_s:?}\nevery_s = {:?}", 2.0 * schedule_s));
        }
        self.reference();
    }

    fn run(&mut self, role: &str, why: &str) {
        self.line("\n[[run]]");
        self.because(role, why);
    }

    fn reference(&mut self) {
        self.line("# reference_azimuth_deg = 0           # EDIT: the surveyed azimuth, where it is known; else station = \"A\" of runs at one heading");
    }

    fn names(&self, columns: &[usize]) -> String {
        format!("[{}]", columns.iter().map(|&column| self.table.name(column)).collect::<Vec<_>>().join(", "))
    }

    fn is_triad(&self) -> bool {
        self.gyro.len() == 3
    }

    /// Which of three accelerometers stands upright, and whether it reads upwards.
    fn upright(&self) -> Option<(usize, bool)> {
        let three = self.accelerometer.get(..3)?;
        let norm = self.table.norm(three);
        let mean = |axis: usize| self.table.mean(three[axis]);
        (0..3).find(|&axis| mean(axis).abs() > UPRIGHT * norm).map(|axis| (axis, mean(axis) > 0.0))
    }

    /// Magnitude of the latitude from sin φ = ω·f/(|ω||f|), with its sign if the columns of both triads are alike.
    fn latitude_deg(&self) -> Option<f64> {
        let (gyro, accelerometer) = (self.gyro.get(..3)?, self.accelerometer.get(..3)?);
        let mean = |column: &usize| self.table.mean(*column);
        let dot: f64 = gyro.iter().zip(accelerometer).map(|(g, a)| mean(g) * mean(a)).sum();
        let sine = dot / (self.table.norm(gyro) * self.table.norm(accelerometer));
        sine.is_finite().then(|| sine.clamp(-1.0, 1.0).asin().to_degrees())
    }
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
