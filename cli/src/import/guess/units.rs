//! Units by the columns' names, or by the size of what every gyro and accelerometer on the Earth feels.

use north_finder::earth::EARTH_RATE_DEG_H;
use north_finder::units::STANDARD_GRAVITY_M_S2;

use super::table::Table;

/// Gravity that agrees within this factor is recognised.
const GRAVITY_FACTOR: f64 = 2.0;
/// A triad's mean rate that agrees with the Earth's within this factor is taken for it: larger biases hide it, and units lie further apart.
const TRIAD_FACTOR: f64 = 1.25;
/// A single gyro that is turned feels the horizontal part: between 15° and 75° of latitude half of the Earth's rate within this factor.
const INDEXED_FACTOR: f64 = 2.0;
/// The amplitude over the index is seen beyond so many standard deviations.
const SEEN_SIGMAS: f64 = 5.0;
/// Written where nothing tells the unit: an import refuses it, with the units that there are.
pub const ASKED: &str = "EDIT";

/// A unit as the mapping names it, the scale of its column, and why.
pub struct Unit {
    pub name: &'static str,
    pub scale: f64,
    pub why: String,
    /// By the Earth's rate, or by name: not asked for.
    pub is_known: bool,
}

fn known(name: &'static str, why: String) -> Unit {
    Unit { name, scale: 1.0, why, is_known: true }
}

fn asked(why: String) -> Unit {
    Unit { name: ASKED, scale: 1.0, why: format!("EDIT: {why}"), is_known: false }
}

/// The unit of a time column and its length in seconds; whether the recording itself says it.
pub fn of_time(table: &Table, column: usize, step: f64) -> (&'static str, f64, bool) {
    if table.moments == Some(column) {
        return ("iso8601", 1.0, true);
    }
    let described = table.described(column);
    let units = [("ns", 1e-9), ("us", 1e-6), ("ms", 1e-3), ("min", 60.0), ("h", 3600.0), ("s", 1.0)];
    let named = units.into_iter().find(|(unit, _)| {
        [format!("_{unit}"), format!("[{unit}]"), format!("({unit})"), format!(" {unit}")]
            .iter()
            .any(|end| described.ends_with(end))
    });
    // Nobody samples slower than once in 100 s: larger steps are smaller units.
    let (unit, seconds) = named.unwrap_or(match step {
        step if step > 1e5 => ("ns", 1e-9),
        step if step > 100.0 => ("us", 1e-6),
        step if step > 1.0 => ("ms", 1e-3),
        _ => ("s", 1.0),
    });
    (unit, seconds, named.is_some())
}

/// Of one gyro or a triad, whose rows are `interval_s` apart where that is known; `index_deg` is the index's column of a single one.
pub fn of_gyro(table: &Table, gyro: &[usize], interval_s: Option<f64>, index: Option<usize>) -> Unit {
    let described = gyro.first().map(|&column| table.described(column)).unwrap_or_default();
    const NAMED: [(&str, &str); 10] = [
        ("deg_h", "deg/h"),
        ("deg/h", "deg/h"),
        ("dph", "deg/h"),
        ("deg_s", "deg/s"),
        ("deg/s", "deg/s"),
        ("dps", "deg/s"),
        ("rad_s", "rad/s"),
        ("rad/s", "rad/s"),
        ("rps", "rad/s"),
        ("arcsec", "arcsec"),
    ];
    if let Some((_, unit)) = NAMED.into_iter().find(|(word, _)| described.contains(word)) {
        return known(unit, "by the column's name".into());
    }
    if gyro.len() == 3 {
        let size = table.norm(gyro);
        return by_earth_rate(size, 1.0, TRIAD_FACTOR, interval_s, &format!("the triad's mean is {size:.4e}"));
    }
    let swing =
        gyro.first().zip(index).and_then(|(&gyro, index)| amplitude(&table.columns[gyro], &table.columns[index]));
    match swing {
        Some(size) => {
            by_earth_rate(size, 0.5, INDEXED_FACTOR, interval_s, &format!("it swings by {size:.4e} over the index"))
        }
        None => asked("one gyro that is not turned does not tell its unit".into()),
    }
}

/// The one unit in which the size is this share of the Earth's rate, within a factor.
fn by_earth_rate(size: f64, share: f64, factor: f64, interval_s: Option<f64>, what: &str) -> Unit {
    let deg_s = EARTH_RATE_DEG_H / 3600.0;
    let rates = [("deg/h", EARTH_RATE_DEG_H), ("deg/s", deg_s), ("rad/s", deg_s.to_radians())];
    let increments = interval_s.into_iter().flat_map(|interval_s| {
        [("arcsec", EARTH_RATE_DEG_H), ("deg", deg_s), ("rad", deg_s.to_radians())]
            .map(|(unit, rate)| (unit, rate * interval_s))
    });
    let fits = |expected: f64| (size / (share * expected)).ln().abs() < factor.ln();
    let fitting: Vec<(&'static str, f64)> =
        rates.into_iter().chain(increments).filter(|(_, rate)| fits(*rate)).collect();
    match fitting[..] {
        [(unit, _)] => known(unit, format!("{what}: the Earth's rate in this unit")),
        // A degree an hour is an arcsecond a second: with rows of a second both are the same.
        [(unit, rate), (_, same)] if rate == same => known(unit, format!("{what}: the Earth's rate in this unit")),
        [] => asked(format!("{what}, in no unit the Earth's rate: counts, or a large bias")),
        _ => asked(format!(
            "{what}: the Earth's rate in {}",
            fitting.iter().map(|(unit, _)| *unit).collect::<Vec<_>>().join(" or ")
        )),
    }
}

/// Amplitude of a gyro's values over the index angle, degrees, where it stands out of their scatter: least squares of a mean, a cosine and a sine.
fn amplitude(values: &[f64], index_deg: &[f64]) -> Option<f64> {
    let design = nalgebra::DMatrix::from_fn(values.len(), 3, |row, column| match column {
        0 => 1.0,
        1 => index_deg[row].to_radians().cos(),
        _ => index_deg[row].to_radians().sin(),
    });
    let values = nalgebra::DVector::from_column_slice(values);
    let inverse = (design.transpose() * &design).try_inverse()?;
    let found = &inverse * design.transpose() * &values;
    let degrees_of_freedom = values.len().checked_sub(3).filter(|left| *left > 0)? as f64;
    let variance = (&values - design * &found).norm_squared() / degrees_of_freedom;
    let size = found[1].hypot(found[2]);
    (size > SEEN_SIGMAS * (variance * inverse[(1, 1)].max(inverse[(2, 2)])).sqrt()).then_some(size)
}

/// Of three accelerometers; two level ones do not tell it.
pub fn of_acceleration(table: &Table, columns: &[usize], interval_s: Option<f64>) -> Unit {
    let described = columns.first().map(|&column| table.described(column)).unwrap_or_default();
    const NAMED: [(&str, &str); 8] = [
        ("m_s2", "m/s2"),
        ("m/s2", "m/s2"),
        ("m/s^2", "m/s2"),
        ("m/s²", "m/s2"),
        ("_mg", "mg"),
        (" mg", "mg"),
        ("_g", "g"),
        (" g", "g"),
    ];
    if let Some((_, unit)) = NAMED.into_iter().find(|(word, _)| described.ends_with(word)) {
        return known(unit, "by the column's name".into());
    }
    if columns.len() < 3 {
        return asked("two level accelerometers do not tell their unit".into());
    }
    let size = table.norm(columns);
    let forces = [("g", 1.0), ("mg", 1e3), ("ug", 1e6), ("m/s2", STANDARD_GRAVITY_M_S2)];
    let increments = interval_s
        .into_iter()
        .flat_map(|interval_s| [("m/s", STANDARD_GRAVITY_M_S2 * interval_s), ("g*s", interval_s)]);
    let away = |expected: f64| (size / expected).ln().abs();
    let nearest = forces.into_iter().chain(increments).min_by(|a, b| away(a.1).total_cmp(&away(b.1)));
    match nearest {
        Some((unit, gravity)) if away(gravity) < GRAVITY_FACTOR.ln() => {
            known(unit, format!("the mean is {size:.4e}: gravity in this unit"))
        }
        _ => Unit {
            name: "g",
            scale: 1.0 / size,
            why: format!(
                "EDIT: the mean is {size:.4e}, which is gravity in no known unit: the columns hold counts or have offsets"
            ),
            is_known: true,
        },
    }
}
