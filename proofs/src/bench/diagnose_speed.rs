//! `north bench diagnose-speed`: time and memory of a diagnosis.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use super::Bench;
use clap::Args;
use hal_sim::scenario::Gyro;
use hal_sim::seconds::{Dwell, SecondsGenerator, SiteAndGyro};
use north_finder::sensing::level::Specific;
use rayon::prelude::*;
use serde::Serialize;

use north::campaign::{Campaign, CampaignWriter, Instrument, Layout, Role, Row, Run};
use north::diagnose::{Options, diagnose};
use north::failure::Failure;

/// One size of campaign.
struct Size {
    title: &'static str,
    runs: usize,
    /// Length of a run, s.
    seconds: f64,
    interval_s: f64,
    /// Channels beside temperature and levels, which have no effect.
    channels: usize,
}

/// The rows that the tables promise, twice as many of the long ones to see whether the cost is linear, and what an archive may hold.
const SIZES: [Size; 6] = [
    Size { title: "seconds", runs: 36, seconds: 256.0, interval_s: 1.0, channels: 0 },
    Size { title: "seconds, runs twice as long", runs: 36, seconds: 512.0, interval_s: 1.0, channels: 0 },
    Size { title: "400 Hz, a quarter of the runs", runs: 9, seconds: 240.0, interval_s: 0.0025, channels: 0 },
    Size { title: "400 Hz", runs: 36, seconds: 240.0, interval_s: 0.0025, channels: 0 },
    Size { title: "seconds, 40 channels", runs: 36, seconds: 256.0, interval_s: 1.0, channels: 40 },
    Size { title: "seconds, 16 channels", runs: 1000, seconds: 256.0, interval_s: 1.0, channels: 16 },
];
/// Runs after which a start is as warm as the first one.
const STARTS: usize = 36;

/// One line of the table.
#[derive(Serialize)]
pub struct Measured {
    title: &'static str,
    runs: usize,
    rows: usize,
    seconds: f64,
    microseconds_per_row: f64,
    /// Most memory that the process ever had, MB; grows from line to line.
    peak_mb: Option<f64>,
}

/// Time and memory of the diagnosis of campaigns of seconds and of raw rows
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench diagnose-speed")]
pub struct DiagnoseSpeed {}

impl Bench for DiagnoseSpeed {
    type Row = Measured;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Measured>, Failure> {
        writeln!(out, "| campaign | runs | rows | time, s | µs / row | peak memory, MB |\n|---|---|---|---|---|---|")?;
        let mut all = Vec::new();
        for size in &SIZES {
            let folder = tempfile::tempdir()?;
            let (campaign, rows) = record(size, folder.path())?;
            let start = Instant::now();
            diagnose(&campaign, &Options::default()).map_err(|refusal| Failure::Refused(refusal.to_string()))?;
            let seconds = start.elapsed().as_secs_f64();
            let measured = Measured {
                title: size.title,
                runs: size.runs,
                rows,
                seconds,
                microseconds_per_row: 1e6 * seconds / rows as f64,
                peak_mb: peak_mb(),
            };
            let peak = measured.peak_mb.map_or("–".into(), |peak| format!("{peak:.0}"));
            writeln!(
                out,
                "| {} | {} | {rows} | {seconds:.2} | {:.2} | {peak} |",
                size.title, size.runs, measured.microseconds_per_row
            )?;
            all.push(measured);
        }
        Ok(all)
    }
}

/// Writes the campaign: a warming gyro with a bias that follows the rate of its temperature.
fn record(size: &Size, folder: &Path) -> Result<(Campaign, usize), Failure> {
    let mut writer = CampaignWriter::create(Campaign {
        folder: folder.to_owned(),
        title: Some(size.title.into()),
        latitude_deg: Some(34.75),
        instrument: Some(Instrument { name: None, arw_deg_per_sqrt_h: Some(0.0015), settings: None }),
        runs: Vec::new(),
    })?;
    let name = |run: usize| format!("runs/{:04}.csv", run + 1);
    let rows = (0..size.runs)
        .into_par_iter()
        .map(|run| record_run(size, run, &writer, &name(run)))
        .collect::<Result<Vec<_>, Failure>>()?;
    for run in 0..size.runs {
        let role = if run % 2 == 0 { Role::Fit } else { Role::Check };
        writer.add(Run {
            file: name(run),
            role,
            reference_azimuth_deg: Some(azimuth_deg(size, run)),
            ..Run::default()
        });
    }
    writer.finish()?;
    Ok((Campaign::read(folder)?, rows.into_iter().sum()))
}

fn azimuth_deg(size: &Size, run: usize) -> f64 {
    360.0 * run as f64 / size.runs as f64
}

fn record_run(size: &Size, run: usize, campaign: &CampaignWriter, file: &str) -> Result<usize, Failure> {
    let mut world = SiteAndGyro::default();
    world.site.azimuth_deg = azimuth_deg(size, run);
    world.gyro = Gyro {
        shupe_deg_h_per_k_s: 9.0,
        start_offset_k: -3.0 - 0.2 * (run % STARTS) as f64,
        thermal_tau_s: 400.0,
        ..Gyro::default()
    };
    let mut generator = SecondsGenerator::new(&world, run as u64).with_interval_s(size.interval_s);
    let extra = (0..size.channels).map(|channel| format!("c{channel}_v")).collect();
    let layout = Layout { temperature: true, level: true, extra, ..Layout::default() };
    let mut writer = campaign.run(file, layout)?;
    let dwell_s = size.seconds / 8.0 - 4.0;
    let mut number = 0;
    for index_deg in [0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0] {
        let turn = generator.turn(index_deg, 4.0);
        let dwell: Vec<_> = generator.rows(&[Dwell { index_deg, gap_s: 0.0, seconds: dwell_s }]).collect();
        for row in turn.into_iter().chain(dwell) {
            number += 1;
            let t_s = number as f64 * size.interval_s;
            writer.write(&Row {
                t_s,
                interval_s: size.interval_s,
                index_deg: row.index_deg,
                fog_arcsec: row.fog_arcsec,
                temp_c: Some(row.temp_c),
                level: Some(Specific { forward: row.ax_g, left: row.ay_g }),
                extra: (0..size.channels).map(|channel| channel_v(channel, run, t_s)).collect(),
                ..Row::default()
            })?;
        }
    }
    writer.finish()?;
    Ok(number)
}

/// A channel with a period and a course of its own in every run.
fn channel_v(channel: usize, run: usize, t_s: f64) -> f64 {
    let (number, phase) = (channel as f64, (run * (2 * channel + 3)) as f64);
    phase.sin() + 0.2 * (phase + t_s / (20.0 + 7.0 * number)).sin()
}

/// Peak memory of this process, MB; `None` where the system does not tell.
fn peak_mb() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kilobytes| kilobytes / 1024.0)
}
