//! The runs of a campaign as seconds: what is learned from and judged.

use std::path::Path;

use north_finder::calibration::ellipsoid::Correction;
use north_finder::earth::{EarthRate, earth_rate};
use north_finder::effects::{ErrorModel, MAX_CHANNELS};
use north_finder::event::{Dwell, Fix};
use north_finder::level::Specific;
use north_finder::replay::{Recorded, Replay, Row as ReplayRow, Told};
use north_finder::settings::Settings;
use north_finder::units::{RAD_PER_DEG, sin_cos_deg, wrap_180_deg};
use rayon::prelude::*;

use super::{Options, Refusal, Warning};
use crate::campaign::{Campaign, Role, Row, Run, RunReader};
use crate::solve::{AllDwells, correct_level, recorded};

/// The index is at rest while it stays within this, degrees.
const REST_DEG: f64 = 0.5;
/// Rows are gathered until they cover this, seconds.
const GATHER_S: f64 = 0.9995;
/// Most rows of a run that are kept as they are.
const MOST_RAW: usize = 20_000;

/// A second of a run, or a longer row.
#[derive(Clone, Debug, Default)]
pub struct Cell {
    /// Middle, and length.
    pub t_s: f64,
    pub seconds: f64,
    pub raw_deg_h: f64,
    pub cos: f64,
    pub sin: f64,
    pub temp_c: Option<f64>,
    pub level: Option<Specific>,
    pub moving: bool,
    /// Rows are missing before it.
    pub after_gap: bool,
    /// Number of the stay, from 0.
    pub stay: usize,
    /// Line of the file that it begins with.
    pub line: u64,
}

/// One run, read.
#[derive(Clone, Debug)]
pub struct RunData {
    pub file: String,
    pub role: Role,
    pub settings: Settings,
    pub earth: EarthRate,
    pub reference_deg: Option<f64>,
    pub reference_sigma_deg: f64,
    pub cells: Vec<Cell>,
    /// Names of the extra channels and their values by the cell.
    pub names: Vec<String>,
    pub channels: Vec<Vec<f64>>,
    /// The rows themselves, where they are shorter than the cells and not too many, or the instrument recorded them.
    pub raw: Vec<Recorded>,
    pub before: Option<Fix>,
    /// Why there is no azimuth.
    pub refusal: Option<String>,
    /// Noise of a one-second rate where it is known beforehand, °/h.
    pub noise_deg_h: Option<f64>,
    /// Most of the time the index turns.
    pub rotation: bool,
}

impl RunData {
    /// Cells that enter: those at rest, or in a continuous rotation all.
    pub fn enters(&self, cell: &Cell) -> bool {
        !cell.after_gap && (self.rotation || !cell.moving)
    }

    /// A channel's values by the cell.
    pub fn channel(&self, name: &str) -> Option<Vec<f64>> {
        let of = |value: fn(&Cell) -> Option<f64>| self.cells.iter().map(value).collect::<Option<Vec<_>>>();
        match name {
            "temp_c" => of(|cell| cell.temp_c),
            "ax_g" => of(|cell| cell.level.map(|level| level.forward)),
            "ay_g" => of(|cell| cell.level.map(|level| level.left)),
            _ => self.names.iter().position(|each| each == name).and_then(|i| self.channels.get(i).cloned()),
        }
    }

    /// All channels' names.
    pub fn channel_names(&self) -> Vec<String> {
        let has = |name: &str| self.channel(name).is_some();
        let known = ["temp_c", "ax_g", "ay_g"].into_iter().filter(|name| has(name)).map(str::to_owned);
        known.chain(self.names.iter().cloned()).collect()
    }

    /// Azimuth by the firmware's replay of the cells with a model; the stays with the time of their end.
    pub fn solve(&self, model: &ErrorModel) -> Option<(Fix, Vec<(f64, Dwell)>)> {
        let settings = Settings { model: Some(model.clone()), ..self.settings.clone() };
        let slots: Vec<usize> = model
            .channels()
            .iter()
            .map(|name| self.names.iter().position(|each| each == name.as_str()))
            .collect::<Option<_>>()?;
        let mut replay = Replay::new(&settings, AllDwells::default()).ok()?;
        let mut dwells = Vec::new();
        let mut note = |told: Told| {
            if let Told::Dwell { dwell, end_s } = told {
                dwells.push((end_s, dwell));
            }
        };
        if !self.raw.is_empty() && slots.is_empty() {
            self.raw.iter().for_each(|row| replay.push(row, &mut note));
            let fix = replay.finish(&mut note).ok()?;
            return Some((fix, dwells));
        }
        for (i, cell) in self.cells.iter().enumerate() {
            let mut channels = [f64::NAN; MAX_CHANNELS];
            for (value, &slot) in channels.iter_mut().zip(&slots) {
                *value = self.channels[slot][i];
            }
            let row = ReplayRow {
                t_s: cell.t_s + 0.5 * cell.seconds,
                interval_s: cell.seconds,
                index_deg: cell.sin.atan2(cell.cos) / RAD_PER_DEG,
                fog_arcsec: cell.raw_deg_h * cell.seconds,
                temp_c: cell.temp_c,
                level: cell.level,
                lost_frames: 0,
                channels,
            };
            replay.push(&Recorded::Row(row), &mut note);
        }
        let fix = replay.finish(&mut note).ok()?;
        Some((fix, dwells))
    }
}

/// Reads all runs.
pub fn read(campaign: &Campaign, options: &Options) -> Result<(Vec<RunData>, Vec<Warning>), Refusal> {
    let read: Vec<_> = campaign.runs.par_iter().map(|run| read_run(campaign, run, options)).collect();
    let (mut runs, mut warnings) = (Vec::new(), Vec::new());
    for each in read {
        let (run, doubts) = each?;
        runs.push(run);
        warnings.extend(doubts);
    }
    Ok((runs, warnings))
}

fn read_run(campaign: &Campaign, run: &Run, options: &Options) -> Result<(RunData, Vec<Warning>), Refusal> {
    let path = campaign.path_of(run);
    let latitude_deg = campaign.latitude_of(run).unwrap_or_default();
    let refuse = |problem: String| Refusal::Run { run: run.file.clone(), line: None, problem };
    let earth = earth_rate(latitude_deg).map_err(|_| {
        refuse(format!("at latitude {latitude_deg} there is no horizontal Earth rate to find north by"))
    })?;
    let settings = Settings { latitude_deg, ..options.settings.clone() };
    let (mut data, warnings) = read_cells(&path, run, &settings.triad())?;
    data.settings = settings;
    data.earth = earth;
    let solved = crate::solve::solve_file(&path, &data.settings);
    match solved {
        Ok(solution) => data.before = Some(solution.fix),
        Err(crate::solve::SolveError::File(error)) => return Err(error.into()),
        Err(crate::solve::SolveError::Refused { refusal, .. }) => data.refusal = Some(refusal.to_string()),
        Err(error @ crate::solve::SolveError::NoChannel { .. }) => return Err(refuse(error.to_string())),
    }
    Ok((data, warnings))
}

fn read_cells(path: &Path, run: &Run, triad: &Correction) -> Result<(RunData, Vec<Warning>), Refusal> {
    let reader = RunReader::open(path)?;
    let names = reader.channels().to_vec();
    let mut gatherer = Gatherer::new(names.len());
    let mut warnings = Vec::new();
    let (mut rows, mut gap_warned) = (0_u64, false);
    let mut raw = Vec::new();
    let mut usual_s: Option<f64> = None;
    for row in reader {
        let mut row = row?;
        correct_level(&mut row, triad);
        rows += 1;
        let usual = *usual_s.get_or_insert(row.interval_s);
        let still = gatherer.last_deg.is_some_and(|last| wrap_180_deg(row.index_deg - last).abs() <= REST_DEG);
        let gap = rows > 2 && row.interval_s > 2.5 * usual && row.interval_s > 1.0 && still;
        if gap && !gap_warned {
            gap_warned = true;
            let message = format!(
                "a gap of {:.3} s in time within a stay (rows are {usual} s apart): nothing is learned from the row after \
                 it; check the recorder",
                row.interval_s
            );
            warnings.push(Warning { run: Some(run.file.clone()), line: Some(rows + 1), message });
        }
        if rows == 2 {
            usual_s = Some(row.interval_s);
        }
        gatherer.push(&row, rows + 1, gap);
        if row.own.is_some() || row.interval_s < 0.9 && raw.len() < MOST_RAW {
            raw.push(recorded(&row, [f64::NAN; MAX_CHANNELS]));
        }
    }
    gatherer.end();
    // Part of the rows would be another recording.
    if raw.len() as u64 != rows {
        raw = Vec::new();
    }
    let Gatherer { cells, channels, .. } = gatherer;
    let moving: f64 = cells.iter().filter(|cell| cell.moving).map(|cell| cell.seconds).sum();
    let all: f64 = cells.iter().map(|cell| cell.seconds).sum();
    let data = RunData {
        file: run.file.clone(),
        role: run.role,
        settings: Settings::default(),
        earth: EarthRate { north_deg_h: 0.0, up_deg_h: 0.0 },
        reference_deg: run.reference_azimuth_deg,
        reference_sigma_deg: run.reference_sigma_deg.unwrap_or(0.0),
        cells,
        names,
        channels,
        raw,
        before: None,
        refusal: None,
        noise_deg_h: None,
        rotation: moving > 0.75 * all,
    };
    Ok((data, warnings))
}

/// Gathers rows into seconds as the firmware's replay does.
struct Gatherer {
    cells: Vec<Cell>,
    channels: Vec<Vec<f64>>,
    sum: Cell,
    sum_channels: Vec<f64>,
    count: u32,
    level: [f64; 2],
    last_deg: Option<f64>,
    stay_deg: Option<f64>,
    stay: usize,
    first_deg: f64,
}

impl Gatherer {
    fn new(channels: usize) -> Self {
        Self {
            cells: Vec::new(),
            channels: vec![Vec::new(); channels],
            sum: Cell::default(),
            sum_channels: vec![0.0; channels],
            count: 0,
            level: [0.0; 2],
            last_deg: None,
            stay_deg: None,
            stay: 0,
            first_deg: 0.0,
        }
    }

    /// A row after a gap becomes a cell that does not enter.
    fn push(&mut self, row: &Row, line: u64, gap: bool) {
        let way_deg = self.last_deg.replace(row.index_deg).map_or(0.0, |last| wrap_180_deg(row.index_deg - last));
        let moved = way_deg.abs() > REST_DEG;
        if gap {
            self.end();
        }
        if moved {
            self.end();
            // Where the second row moved, the first one did.
            if let [first] = self.cells.as_mut_slice() {
                first.moving = true;
            }
        }
        if self.count == 0 {
            self.sum.line = line;
            self.first_deg = row.index_deg;
        }
        let (sin, cos) = sin_cos_deg(row.index_deg);
        let half = 0.5 * way_deg * RAD_PER_DEG;
        let shorter = if half.abs() > 1e-9 { half.sin() / half } else { 1.0 };
        let weight = row.interval_s;
        let sum = &mut self.sum;
        sum.t_s = row.t_s;
        sum.seconds += weight;
        sum.raw_deg_h += row.fog_arcsec;
        sum.cos += weight * cos * shorter;
        sum.sin += weight * sin * shorter;
        sum.moving |= moved;
        if let Some(temp_c) = row.temp_c {
            *sum.temp_c.get_or_insert(0.0) += weight * temp_c;
        }
        if let Some(Specific { forward, left }) = row.level {
            self.level[0] += weight * forward;
            self.level[1] += weight * left;
            sum.level = Some(Specific { forward: 0.0, left: 0.0 });
        }
        for (sum, value) in self.sum_channels.iter_mut().zip(&row.extra) {
            *sum += weight * value;
        }
        self.count += 1;
        if moved || self.sum.seconds >= GATHER_S {
            self.end();
        }
        if gap && let Some(cell) = self.cells.last_mut() {
            cell.after_gap = true;
        }
    }

    fn end(&mut self) {
        if self.count == 0 {
            return;
        }
        let mut cell = std::mem::take(&mut self.sum);
        let seconds = cell.seconds;
        cell.t_s -= 0.5 * seconds;
        cell.raw_deg_h /= seconds;
        cell.cos /= seconds;
        cell.sin /= seconds;
        cell.temp_c = cell.temp_c.map(|sum| sum / seconds);
        let [forward, left] = std::mem::take(&mut self.level).map(|sum| sum / seconds);
        cell.level = cell.level.and(Specific::new(forward, left));
        let left =
            cell.moving || self.stay_deg.is_some_and(|stay| wrap_180_deg(self.first_deg - stay).abs() > REST_DEG);
        if left && self.stay_deg.take().is_some() {
            self.stay += 1;
        }
        if !cell.moving {
            self.stay_deg.get_or_insert(self.first_deg);
        }
        cell.stay = self.stay;
        for (values, sum) in self.channels.iter_mut().zip(&mut self.sum_channels) {
            values.push(std::mem::take(sum) / seconds);
        }
        self.cells.push(cell);
        self.count = 0;
    }
}
