//! A recording of a foreign instrument to an azimuth: its dwells are found in the index angle.
//!
//! `cargo run --example replay_recording --no-default-features [FILE.csv LATITUDE]`; the file has the columns t_s (end of the row, seconds), index_deg
//! and fog_arcsec. Without one, a recording of four positions is made up.

use std::error::Error;
use std::io::{BufRead, BufReader};

use heapless::Vec as Bounded;
use north_finder::fix::accumulator::Corrected;
use north_finder::fix::dwell::DwellSummary;
use north_finder::instrument::replay::{Place, Recorded, Replay, Reported, Row, Waiting};
use north_finder::settings::Settings;

/// Where seconds wait for the jitter gate.
#[derive(Default)]
struct Room(Vec<Corrected>);

impl Waiting for Room {
    fn push(&mut self, second: Corrected) {
        self.0.push(second);
    }

    fn as_slice(&self) -> &[Corrected] {
        &self.0
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (rows, latitude_deg) = match arguments.as_slice() {
        [file, latitude] => (read(file)?, latitude.parse()?),
        _ => (made_up(), 60.0),
    };
    let settings = Settings { latitude_deg, ..Settings::default() };
    let dwells: Bounded<DwellSummary, 64> = Bounded::new();
    let mut replay = Replay::new(&settings, dwells, Room::default()).map_err(|refusal| refusal.to_string())?;
    let mut used = 0;
    let mut tell = |told: Reported| match told {
        Reported::Second(_, Place::Dwell(_)) => used += 1,
        Reported::Second(..) => {}
        Reported::Dwell { dwell, end_s, .. } => println!("{end_s:6.0} s: {dwell:?}"),
    };
    rows.into_iter().for_each(|row| replay.push(&Recorded::Row(row), &mut tell));
    let fix = replay.finish(&mut tell).map_err(|refusal| refusal.to_string())?;
    println!("azimuth {:.3}° ± {:.3}° from {used} seconds", fix.azimuth_deg, fix.sigma_deg);
    Ok(())
}

/// Rows of a file.
fn read(file: &str) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut rows: Vec<Row> = Vec::new();
    for (number, line) in (2..).zip(BufReader::new(std::fs::File::open(file)?).lines().skip(1)) {
        let line = line?;
        let fields: Vec<f64> = line
            .split(',')
            .map(|field| field.trim().parse())
            .collect::<Result<_, _>>()
            .map_err(|error| format!("{file}, line {number}: {line:?}: {error}"))?;
        let &[t_s, index_deg, fog_arcsec] = fields.as_slice() else {
            return Err(format!("{file}, line {number}: three columns are needed: {line:?}").into());
        };
        let interval_s = rows.last().map_or(1.0, |last| t_s - last.t_s);
        rows.push(Row { t_s, interval_s, index_deg, fog_arcsec, ..Row::default() });
    }
    Ok(rows)
}

/// 60° north, azimuth 30°, a gyro without noise but for counts of 0.05 arcsec: 60 s at each position, five seconds from one to the next.
fn made_up() -> Vec<Row> {
    const NORTH_DEG_H: f64 = 7.520_533_5;
    let index_deg = |t_s: u32| {
        let (position, second) = (t_s / 65, t_s % 65);
        90.0 * f64::from(position) + 18.0 * f64::from(second.saturating_sub(60))
    };
    (0..4 * 65 - 5)
        .map(|second| {
            let index_deg = 0.5 * (index_deg(second) + index_deg(second + 1));
            let rate_deg_h = 0.5 + NORTH_DEG_H * (30.0 - index_deg).to_radians().cos();
            // A degree per hour is an arcsec per second.
            let fog_arcsec = (rate_deg_h / 0.05).round() * 0.05;
            Row { t_s: f64::from(second) + 1.0, index_deg, fog_arcsec, ..Row::default() }
        })
        .collect()
}
