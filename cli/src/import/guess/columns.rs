//! What the columns of a recording are taken for.

use super::table::Table;

/// An index angle turns through so much, in whatever unit, and between two rows it rests …
const INDEX_SPAN: f64 = 80.0;
/// … within this share of its range, in this share of the rows: it dwells.
const INDEX_REST: f64 = 1e-3;
const INDEX_RESTS: f64 = 0.7;

/// How an axis is called, and its place among x, y, z: the body's own, which turns about them by roll, pitch and yaw.
const AXES: [(&str, usize); 6] = [("x", 0), ("y", 1), ("z", 2), ("roll", 0), ("pitch", 1), ("yaw", 2)];

/// What a column is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Time,
    Gyro,
    Accelerometer,
    Temperature,
    Index,
    Other,
}

/// The columns by what they are; none is in two places.
pub struct Columns {
    kinds: Vec<Kind>,
}

impl Columns {
    pub fn of(table: &Table) -> Self {
        let mut kinds: Vec<Kind> = (0..table.columns.len()).map(|column| by_name(table, column)).collect();
        for kind in [Kind::Time, Kind::Index, Kind::Temperature] {
            only_first(&mut kinds, kind);
        }
        if table.names.is_empty() {
            without_names(table, &mut kinds);
        }
        let columns = Self { kinds };
        // Two of a triad are none, and four are a triad and something else.
        let keep = match columns.all(Kind::Gyro).len() {
            count if count >= 3 => 3,
            _ => 1,
        };
        columns.keep(Kind::Gyro, keep).keep(Kind::Accelerometer, 3)
    }

    /// All of a kind.
    pub fn all(&self, kind: Kind) -> Vec<usize> {
        (0..self.kinds.len()).filter(|&column| self.kinds[column] == kind).collect()
    }

    pub fn first(&self, kind: Kind) -> Option<usize> {
        self.kinds.iter().position(|each| *each == kind)
    }

    fn keep(mut self, kind: Kind, count: usize) -> Self {
        self.all(kind).into_iter().skip(count).for_each(|column| self.kinds[column] = Kind::Other);
        self
    }
}

/// The columns of a triad, or two of it, in the order of their axes, where their names differ in nothing but the axis.
pub fn by_axis(table: &Table, columns: &[usize]) -> Option<Vec<usize>> {
    let named: Vec<Vec<(String, usize)>> =
        columns.iter().map(|&column| table.names.get(column).map(|name| without_axis(name))).collect::<Option<_>>()?;
    let (first, others) = named.split_first()?;
    first.iter().find_map(|(rest, axis)| {
        let alike = |names: &Vec<(String, usize)>| names.iter().find(|(other, _)| other == rest).map(|(_, axis)| *axis);
        let axes: Vec<usize> = std::iter::once(Some(*axis)).chain(others.iter().map(alike)).collect::<Option<_>>()?;
        (0..columns.len()).map(|wanted| Some(columns[axes.iter().position(|axis| *axis == wanted)?])).collect()
    })
}

/// What a name is without each axis that it may name, and that axis.
fn without_axis(name: &str) -> Vec<(String, usize)> {
    let name = name.to_lowercase();
    let of = |(axis, place): (&'static str, usize)| {
        let name = &name;
        name.match_indices(axis).map(move |(at, _)| (format!("{}*{}", &name[..at], &name[at + axis.len()..]), place))
    };
    AXES.into_iter().flat_map(of).collect()
}

fn only_first(kinds: &mut [Kind], kind: Kind) {
    kinds.iter_mut().filter(|each| **each == kind).skip(1).for_each(|each| *each = Kind::Other);
}

/// By its name; without one, a column that rises is the time.
fn by_name(table: &Table, column: usize) -> Kind {
    let name = table.described(column);
    let begins = |words: &[&str]| words.iter().any(|word| name.starts_with(word));
    let holds = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let rises = table.columns[column].len() > 1 && table.columns[column].windows(2).all(|pair| pair[1] > pair[0]);
    let is_time =
        name.is_empty() || begins(&["t_", "t ", "sec", "tow", "elapsed"]) || holds(&["time", "stamp"]) || name == "t";
    if rises && (is_time || table.moments == Some(column)) {
        Kind::Time
    } else if holds(&["temp", "degc", "celsius"]) {
        Kind::Temperature
    } else if holds(&["acc"]) || begins(&["ax", "ay", "az", "fx", "fy", "fz", "f_"]) {
        Kind::Accelerometer
    } else if holds(&["gyr", "omega", "rate", "fog"])
        || begins(&["gx", "gy", "gz", "wx", "wy", "wz", "w_", "w "])
        || name == "w"
    {
        Kind::Gyro
    } else if holds(&["index", "enc", "angle", "theta"]) {
        Kind::Index
    } else {
        Kind::Other
    }
}

/// Six columns, or six after a time: the order that most loggers have. One that dwells at angles is the index, and one that is left is the gyro.
fn without_names(table: &Table, kinds: &mut [Kind]) {
    let unknown: Vec<usize> = (0..kinds.len()).filter(|&column| kinds[column] == Kind::Other).collect();
    if let (Some(first), Some(second)) = (unknown.get(..3), unknown.get(3..6)) {
        let gyro_first = table.norm(first) < table.norm(second);
        for (columns, is_gyro) in [(first, gyro_first), (second, !gyro_first)] {
            let kind = if is_gyro { Kind::Gyro } else { Kind::Accelerometer };
            columns.iter().for_each(|&column| kinds[column] = kind);
        }
        return;
    }
    let (index, left): (Vec<usize>, Vec<usize>) =
        unknown.into_iter().partition(|&column| dwells(&table.columns[column]));
    index.iter().take(1).for_each(|&column| kinds[column] = Kind::Index);
    if let [gyro] = left[..] {
        kinds[gyro] = Kind::Gyro;
    }
}

/// Whether values rest at several places that lie far apart.
fn dwells(values: &[f64]) -> bool {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)));
    let rests = values.windows(2).filter(|pair| (pair[1] - pair[0]).abs() <= INDEX_REST * (high - low)).count();
    high - low >= INDEX_SPAN && rests as f64 >= INDEX_RESTS * values.len() as f64
}
