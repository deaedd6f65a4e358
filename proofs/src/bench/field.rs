//! `north bench field`: what a calibration of the accelerometers in the field is worth.

use std::io::{self, Write};

use clap::Args;
use hal_sim::Scenario;
use north::engine::{self, Engine, Setup};
use north::failure::Failure;
use north::field::{self, End};
use north::interrupt;
use north::progress;
use north::settings_file::scenario_settings;
use north_finder::units::wrap_180_deg;
use serde::Serialize;

use super::{Bench, trials};
use crate::statistics::rms;

const SCENARIO: &str = "worn-accelerometers";

/// Accelerometers calibrated in the field by a simulated operator: tilt and azimuth without the calibration and with it
///
/// Each seed is one instrument of the scenario worn-accelerometers, calibrated and switched off and on, in this process.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench field --instruments 20")]
pub struct FieldBench {
    /// Instruments
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    instruments: u64,
    /// Seed of the first instrument
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One instrument. Errors without and with the calibration; none where there was no fix.
#[derive(Serialize)]
pub struct Row {
    seed: u64,
    stored: bool,
    /// When the calibration was over.
    elapsed_s: f64,
    pitch_error_deg: [Option<f64>; 2],
    roll_error_deg: [Option<f64>; 2],
    azimuth_error_deg: [Option<f64>; 2],
    azimuth_sigma_deg: [Option<f64>; 2],
    /// |f| − 1 g on attitudes that are only judged, rms.
    check_norm_rms_mg: Option<[f64; 2]>,
    /// Root mean square error of the three biases.
    bias_error_mg: Option<f64>,
}

impl Bench for FieldBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.instruments, "instruments");
        let rows = trials(self.seed..self.seed + self.instruments, &bar, one)?;
        bar.finish_and_clear();
        let rows: Vec<Row> = rows.into_iter().collect::<Result<_, Failure>>()?;
        write_rows(out, &rows)?;
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        match rows.iter().filter(|row| !row.stored).count() {
            0 => Ok(()),
            not => Err(Failure::Refused(format!("{not} calibrations were not stored"))),
        }
    }
}

fn one(seed: u64) -> Result<Row, Failure> {
    let scenario = Scenario::named(SCENARIO)?;
    let settings = scenario_settings(&scenario, None)?;
    let setup = Setup { scenario, seed, settings: Some(settings) };
    let world = engine::world(&setup)?;
    let before = world.flash_contents();
    let mut elapsed_s = 0.0;
    let outcome = field::calibrate(Engine::Host, None, &world, &setup, interrupt::flag(), &mut |report| {
        elapsed_s = report.t_s;
    })?;
    let fixes = [before, world.flash_contents()]
        .map(|flash| field::find(Engine::Host, None, &setup, &flash, interrupt::flag()));
    let mut row = Row {
        seed,
        stored: outcome.end == End::Stored,
        elapsed_s,
        pitch_error_deg: [None; 2],
        roll_error_deg: [None; 2],
        azimuth_error_deg: [None; 2],
        azimuth_sigma_deg: [None; 2],
        check_norm_rms_mg: outcome
            .solved
            .map(|solved| [solved.judged_before_g, solved.judged_after_g].map(|g| 1e3 * g)),
        bias_error_mg: outcome.solved.map(|solved| {
            let found = solved.calibration.correction().bias;
            let declared = setup.scenario.accelerometer.bias_mg;
            rms([0, 1, 2].map(|axis| 1e3 * found[axis] - declared[axis]))
        }),
    };
    for (which, fix) in fixes.into_iter().enumerate() {
        let outcome = fix?;
        let engine::End::Fix(fix) = outcome.end else { continue };
        row.azimuth_error_deg[which] = Some(wrap_180_deg(fix.azimuth_deg - outcome.truth.azimuth_deg));
        row.azimuth_sigma_deg[which] = Some(fix.sigma_deg);
        row.pitch_error_deg[which] = fix.tilt.map(|tilt| tilt.pitch_deg - outcome.truth.pitch_deg);
        row.roll_error_deg[which] = fix.tilt.map(|tilt| tilt.roll_deg - outcome.truth.roll_deg);
    }
    Ok(row)
}

fn write_rows(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    let stored = rows.iter().filter(|row| row.stored).count();
    let times: Vec<f64> = rows.iter().map(|row| row.elapsed_s).collect();
    let [least, most] = [f64::min, f64::max].map(|of| times.iter().copied().reduce(of).unwrap_or_default());
    writeln!(
        out,
        "{stored} of {} instruments stored their calibration, after {least:.0} to {most:.0} s.\n",
        rows.len()
    )?;
    writeln!(out, "| rms over the instruments | without | with | largest, with |\n|---|---|---|---|")?;
    let line = |out: &mut dyn Write, name: &str, of: &dyn Fn(&Row, usize) -> Option<f64>, digits: usize| {
        let [without, with] = [0, 1].map(|which| rows.iter().filter_map(|row| of(row, which)).collect::<Vec<f64>>());
        let largest = with.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        writeln!(out, "| {name} | {:.digits$} | {:.digits$} | {largest:.digits$} |", rms(without), rms(with))
    };
    line(out, "pitch error, °", &|row, which| row.pitch_error_deg[which], 4)?;
    line(out, "roll error, °", &|row, which| row.roll_error_deg[which], 4)?;
    line(out, "azimuth error, °", &|row, which| row.azimuth_error_deg[which], 3)?;
    line(out, "sigma of the azimuth, °", &|row, which| row.azimuth_sigma_deg[which], 3)?;
    line(out, "\\|f\\| − 1 g on attitudes only judged, mg", &|row, which| Some(row.check_norm_rms_mg?[which]), 3)?;
    let biases: Vec<f64> = rows.iter().filter_map(|row| row.bias_error_mg).collect();
    writeln!(out, "\nErrors of the estimated biases: {:.4} mg rms.", rms(biases))
}
