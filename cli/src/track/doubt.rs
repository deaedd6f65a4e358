//! What makes the sigmas of an aided track untrue: a source that the track contradicts, and velocities in another unit than the positions'; and sources
//! whose times are not those of the recording.

use nalgebra::Vector2;
use north_finder::earth::SEMI_MAJOR_M;
use north_finder::units::{RAD_PER_DEG, wrap_180_deg};

use super::aided::SourceSummary;
use super::aiding_csv::{Aiding, Reading, Value};

/// Time over which the way by the velocities is compared with that between two positions, s: of 1 m/s it is ten times the noise of a position.
const WAY_S: f64 = 60.0;
/// Fewest of such ways, and their least root mean square, m: twenty times the noise of a position that says no sigma.
const LEAST_WAYS: usize = 5;
const LEAST_WAY_M: f64 = 100.0;
/// Least correlation of both: ways that differ by more than a factor tell none.
const CORRELATION: f64 = 0.99;
/// A factor this close to that of a unit is the unit's; the nearest two, km/h and ft/s, are a tenth apart.
const OF_UNIT: f64 = 0.03;
/// How many times a velocity in m/s its number is in other units.
const UNITS: [(f64, &str); 3] =
    [(3600.0 / 1852.0, "they are in knots"), (3.6, "they are in km/h"), (1.0 / 0.3048, "they are in feet a second")];

/// In sentences.
pub fn warnings(aiding: &Aiding, sources: &[SourceSummary]) -> Vec<String> {
    sources
        .iter()
        .filter_map(of_source)
        .chain(aiding.files.iter().enumerate().filter_map(|(file, path)| {
            let readings: Vec<&Reading> = aiding.readings.iter().filter(|reading| reading.file == file).collect();
            let factor = velocity_factor(&readings)?;
            let (_, unit) = UNITS.iter().find(|(of_unit, _)| (factor / of_unit - 1.0).abs() < OF_UNIT)?;
            Some(format!(
                "{}: the velocities are {factor:.3} times what the positions move by: {unit}, and m/s are wanted",
                path.display()
            ))
        }))
        .collect()
}

/// Sources of which no reading was used because all of them lie before or after what is tracked; in sentences.
pub fn elsewhere(sources: &[SourceSummary], [from_s, to_s]: [f64; 2]) -> Vec<String> {
    let nothing = |source: &&SourceSummary| {
        source.outside > 0
            && source.outside == source.unused
            && source.taken + source.rejected + source.ignored_by_mode == 0
    };
    let said = |source: &SourceSummary| {
        format!(
            "no reading of {} lies within the tracked part of the recording, {from_s:.1} to {to_s:.1} s: are its times those of the recording?",
            source.source
        )
    };
    sources.iter().filter(nothing).map(said).collect()
}

/// A source of which most was rejected.
fn of_source(source: &SourceSummary) -> Option<String> {
    let SourceSummary { source: name, taken, rejected, longest_rejected_in_a_row: row, rejected_from_s, .. } = source;
    let from_s = rejected_from_s.filter(|_| rejected > taken)?;
    Some(format!(
        "{name}: {rejected} of {} readings were rejected, {row} in a row from {from_s:.1} s on: block, settings and sources contradict each \
         other, and the sigmas of position, velocity and heading do not hold",
        taken + rejected
    ))
}

/// By how many times the way by the velocities is that between the positions, where it is the same all along.
fn velocity_factor(readings: &[&Reading]) -> Option<f64> {
    let ways = ways(readings);
    let (mut both, mut moved, mut summed) = (0.0, 0.0, 0.0);
    for (by_positions, by_velocities) in &ways {
        both += by_positions.dot(by_velocities);
        moved += by_positions.norm_squared();
        summed += by_velocities.norm_squared();
    }
    let enough = ways.len() >= LEAST_WAYS && moved > ways.len() as f64 * LEAST_WAY_M * LEAST_WAY_M;
    (enough && both > CORRELATION * (moved * summed).sqrt()).then(|| both / moved)
}

/// Ways east and north, m, by positions and by velocities, over stretches without an interruption of the velocities.
fn ways(readings: &[&Reading]) -> Vec<(Vector2<f64>, Vector2<f64>)> {
    let mut ways = Vec::new();
    let (mut begin, mut summed, mut until_s) = (None, Vector2::zeros(), f64::NEG_INFINITY);
    for reading in readings {
        match reading.value {
            Value::Velocity { east_north_up_m_s: [east, north, _], interval_s } => {
                if reading.t_s - interval_s > until_s + 0.5 * interval_s {
                    begin = None;
                }
                until_s = reading.t_s;
                summed += Vector2::new(east, north) * interval_s;
            }
            Value::Position([latitude_deg, longitude_deg, _]) if reading.t_s == until_s => {
                let here = (reading.t_s, latitude_deg, longitude_deg);
                let (from_s, latitude_from_deg, longitude_from_deg) = *begin.get_or_insert_with(|| {
                    summed = Vector2::zeros();
                    here
                });
                if reading.t_s - from_s >= WAY_S {
                    let east = wrap_180_deg(longitude_deg - longitude_from_deg) * (latitude_deg * RAD_PER_DEG).cos();
                    let north = latitude_deg - latitude_from_deg;
                    ways.push((Vector2::new(east, north) * (RAD_PER_DEG * SEMI_MAJOR_M), summed));
                    (begin, summed) = (Some(here), Vector2::zeros());
                }
            }
            _ => {}
        }
    }
    ways
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 600 s to the north at 3 m/s, and half of it to the east: at 60° a degree of longitude is half as long as one of latitude, which is
    /// 111,319 m of a sphere of the equator's radius.
    fn readings(factor: f64) -> Vec<Reading> {
        let one = |t_s: f64| {
            let velocity = Value::Velocity { east_north_up_m_s: [1.5 * factor, 3.0 * factor, 0.0], interval_s: 1.0 };
            let north_deg = 3.0 * t_s / 111_319.5;
            let position = Value::Position([60.0 + north_deg, 30.0 + north_deg, 0.0]);
            [velocity, position].map(|value| Reading { t_s, value, sigma: 0.1, file: 0, line: 2 })
        };
        (1..=600).flat_map(|second| one(f64::from(second))).collect()
    }

    #[test]
    fn velocities_in_another_unit_are_named() {
        for (factor, said) in [(1.0, None), (1.943_844, Some("knots")), (3.6, Some("km/h")), (1.2, None)] {
            let aiding = Aiding { readings: readings(factor), files: vec!["s.csv".into()], unknown: Vec::new() };
            let found = velocity_factor(&aiding.readings.iter().collect::<Vec<_>>()).unwrap();
            assert!((found / factor - 1.0).abs() < 1e-3, "{found} {factor}");
            let warnings = warnings(&aiding, &[]);
            assert_eq!(
                warnings.first().is_some_and(|text| said.is_some_and(|unit| text.contains(unit))),
                said.is_some()
            );
            assert_eq!(warnings.len(), usize::from(said.is_some()), "{warnings:?}");
        }
    }

    #[test]
    fn a_source_of_which_most_is_rejected_is_told_with_its_time() {
        let source = |rejected| SourceSummary {
            source: "position",
            taken: 14,
            rejected,
            longest_rejected_in_a_row: rejected,
            rejected_from_s: (rejected > 0).then_some(75.0),
            ignored_by_mode: 0,
            unused: 0,
            outside: 0,
            nis: 1.0,
            nis_degrees_of_freedom: 42,
            lost: Vec::new(),
        };
        assert_eq!((of_source(&source(0)), of_source(&source(14))), (None, None));
        let said = of_source(&source(2027)).unwrap();
        assert!(
            said.starts_with("position: 2027 of 2041 readings were rejected, 2027 in a row from 75.0 s on"),
            "{said}"
        );
    }

    #[test]
    fn a_source_of_another_time_is_told() {
        let source = |taken, ignored_by_mode, outside| SourceSummary {
            source: "depth",
            taken,
            rejected: 0,
            longest_rejected_in_a_row: 0,
            rejected_from_s: None,
            ignored_by_mode,
            unused: 7,
            outside,
            nis: 0.0,
            nis_degrees_of_freedom: 0,
            lost: Vec::new(),
        };
        let used = [source(1, 0, 7), source(0, 1, 7), source(0, 0, 6)];
        assert_eq!(elsewhere(&used, [5.0, 60.0]), [""; 0]);
        let said = elsewhere(&[source(0, 0, 7)], [5.0, 60.0]);
        assert!(
            said.len() == 1 && said[0].contains("no reading of depth") && said[0].contains("5.0 to 60.0 s"),
            "{said:?}"
        );
    }
}
