//! A campaign's files to runs: the seconds that the firmware's gatherer makes of the rows, and the means of all channels over them.

use std::path::Path;

use north_finder::earth::earth_rate;
use north_finder::effects::MAX_CHANNELS;
use north_finder::effects::now::RunFacts;
use north_finder::instrument::replay::{REST_DEG, RecordedSecond, Seconds};
use north_finder::settings::Settings;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;

use super::fingerprints::Fingerprints;
use super::{Refusal, RunData, Warning};
use crate::block_csv::GAP_STEPS;
use crate::campaign::{Campaign, Row, Run, RunReader, doubt_of_clock};
use crate::solve::{correct_level, recorded};

/// What many gaps are.
const GAPS: &str = "a gap in time within a dwell: nothing is learned from the row after it; check the recorder";

/// Reads all runs.
pub fn read(campaign: &Campaign, settings: &Settings) -> Result<(Vec<RunData>, Vec<Warning>), Refusal> {
    let read: Vec<_> = campaign
        .runs
        .par_iter()
        .zip(campaign.facts())
        .map(|(run, facts)| read_run(campaign, run, facts, settings))
        .collect();
    let (mut runs, mut warnings) = (Vec::new(), Vec::new());
    for each in read {
        let (run, doubts) = each?;
        runs.push(run);
        warnings.extend(doubts);
    }
    share_references(&mut runs);
    Ok((runs, warnings))
}

/// A run without a survey has that of another run of its station.
fn share_references(runs: &mut [RunData]) {
    for i in 0..runs.len() {
        let Some(station) = runs[i].station.clone().filter(|_| runs[i].reference_deg.is_none()) else { continue };
        let surveyed = runs.iter().find(|run| run.station.as_ref() == Some(&station) && run.reference_deg.is_some());
        if let Some((deg, sigma_deg)) = surveyed.and_then(|run| Some((run.reference_deg?, run.reference_sigma_deg))) {
            runs[i].reference_deg = Some(deg);
            runs[i].reference_sigma_deg = sigma_deg;
        }
    }
}

fn read_run(
    campaign: &Campaign,
    run: &Run,
    facts: RunFacts,
    settings: &Settings,
) -> Result<(RunData, Vec<Warning>), Refusal> {
    let latitude_deg = campaign.latitude_of(run).unwrap_or_default();
    let refuse = |problem: String| Refusal::Run { run: run.file.clone(), line: None, problem };
    let earth = earth_rate(latitude_deg).map_err(|_| {
        refuse(format!("at latitude {latitude_deg} there is no horizontal Earth rate to find north by"))
    })?;
    let settings = Settings { latitude_deg, ..settings.clone() };
    let Gathered { seconds, names, channels, lines, gaps, marks, rows, .. } =
        Gathered::read(&campaign.path_of(run), &settings)?;
    let mut data = RunData {
        file: run.file.clone(),
        role: run.role,
        settings,
        earth,
        reference_deg: run.reference_azimuth_deg,
        reference_sigma_deg: run.reference_sigma_deg.unwrap_or(0.0),
        station: run.station.clone(),
        samples: Vec::new(),
        names,
        channels,
        turned_deg: None,
        recorded: seconds,
        before: None,
        refusal: None,
        outliers: Vec::new(),
        facts,
        marks,
        noise_deg_h: None,
        rotation: false,
    };
    data.slots(&data.settings.model.clone().unwrap_or_default()).map_err(refuse)?;
    let places: Vec<usize> = gaps.iter().map(|gap| gap.place).collect();
    data.replay_as_made(&places, &lines);
    let of_gap = gaps.first().map(|gap| {
        let message = format!(
            "a gap of {:.3} s in time within a dwell (rows are {} s apart): nothing is learned from the row after it; \
             check the recorder",
            gap.seconds, gap.usual_s
        );
        Warning { of_many: Some(GAPS), ..Warning::of_run(&run.file, message).at_line(gap.line) }
    });
    let end_s = data.samples.last().map_or(0.0, |sample| sample.t_s);
    let of_clock = doubt_of_clock(end_s / rows as f64, end_s).map(|doubt| Warning::of_run(&run.file, doubt));
    Ok((data, of_gap.into_iter().chain(of_clock).collect()))
}

/// Rows are missing within a dwell.
struct Gap {
    /// Number of the second that the row after it is in, and the line of that row.
    place: usize,
    line: u64,
    seconds: f64,
    usual_s: f64,
}

/// A file's seconds by the core's gatherer, and the means of all channels over them.
#[derive(Default)]
struct Gathered {
    seconds: Vec<RecordedSecond>,
    names: Vec<String>,
    channels: Vec<Vec<f64>>,
    /// Line that each second begins with.
    lines: Vec<u64>,
    gaps: Vec<Gap>,
    /// Marks of the increments, and how many there are.
    marks: Fingerprints,
    rows: u64,
    /// Of the second under way: the sums of its channels, its time, its first line.
    sums: Vec<f64>,
    sum_s: f64,
    line: Option<u64>,
}

impl Gathered {
    fn read(path: &Path, settings: &Settings) -> Result<Self, Refusal> {
        let reader = RunReader::open(path)?;
        let names = reader.channels().to_vec();
        let number = names.len();
        let mut gathered =
            Self { names, channels: vec![Vec::new(); number], sums: vec![0.0; number], ..Self::default() };
        let mut seconds = Seconds::new(settings);
        let triad = settings.triad();
        let (mut usual_s, mut last_deg) = (0.0, None);
        for (row, line) in reader.zip(2..) {
            let mut row = row?;
            correct_level(&mut row, &triad);
            let still = last_deg
                .replace(row.index_deg)
                .is_some_and(|last| wrap_180_deg(row.index_deg - last).abs() <= REST_DEG);
            let gap = line > 3 && row.interval_s > 1.0 && row.interval_s > GAP_STEPS * usual_s && still;
            // The first row's interval says nothing where it begins late.
            if line <= 3 {
                usual_s = row.interval_s;
            }
            let [before, complete] = seconds.push(&recorded(&row, [f64::NAN; MAX_CHANNELS]));
            gathered.end(before);
            if gap {
                gathered.gaps.push(Gap { place: gathered.seconds.len(), line, seconds: row.interval_s, usual_s });
            }
            gathered.marks.push(row.fog_arcsec);
            gathered.rows += 1;
            gathered.add(&row, line);
            gathered.end(complete);
        }
        gathered.end(seconds.finish());
        Ok(gathered)
    }

    fn add(&mut self, row: &Row, line: u64) {
        self.line.get_or_insert(line);
        self.sum_s += row.interval_s;
        for (sum, value) in self.sums.iter_mut().zip(&row.extra) {
            *sum += row.interval_s * value;
        }
    }

    fn end(&mut self, second: Option<RecordedSecond>) {
        let Some(second) = second else { return };
        self.seconds.push(second);
        self.lines.push(self.line.take().unwrap_or_default());
        let seconds = std::mem::take(&mut self.sum_s);
        for (values, sum) in self.channels.iter_mut().zip(&mut self.sums) {
            values.push(std::mem::take(sum) / seconds);
        }
    }
}
