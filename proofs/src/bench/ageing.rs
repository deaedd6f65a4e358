//! `north bench ageing`: the source's experiment with the ellipsoid calibration.

use std::io::Write;

use clap::Args;
use north::failure::Failure;
use north::progress;
use serde::Serialize;

use super::{Bench, trials};
use crate::statistics::rms;
use crate::trials::ageing::{CALIBRATIONS, Errors, run};

/// What was expected before the project began, from a simulation of its own (400 triads): bias, mg; scale factor, ppm; z up:
/// x and y, mg; z, mg. None where it was not worked out.
const EXPECTED: [[Option<f64>; 4]; CALIBRATIONS.len()] = [
    [Some(9.69), Some(1916.0), None, None],
    [Some(0.11), Some(158.0), Some(0.11), Some(0.20)],
    [Some(0.18), Some(274.0), Some(10.2), Some(0.31)],
    [Some(0.11), Some(159.0), Some(0.27), Some(0.20)],
    [Some(0.09), Some(162.0), Some(0.18), Some(0.17)],
];

/// Calibrations of an accelerometer triad before and after a month of ageing
///
/// Day 0: a turntable (six faces, each twice). Then biases age by 10 mg and scale factors by 0.2 % (one sigma), misalignments
/// do not. Day 30: 23 attitudes in the field, alone, with the old misalignments, and with none; the turntable again. Ten
/// readings of 1 mg of noise everywhere. All are judged by the truth, and by the triad at rest with its sensor z up.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench ageing --trials 4000")]
pub struct AgeingBench {
    /// Triads, 20 to 1000000
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u64).range(20..=1_000_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One calibration, over all triads.
#[derive(Serialize)]
pub struct Row {
    calibration: &'static str,
    bias_rms_mg: f64,
    scale_rms_ppm: f64,
    z_up_level_rms_mg: f64,
    z_up_upright_rms_mg: f64,
    /// The same four as they were expected.
    expected: [Option<f64>; 4],
}

impl Bench for AgeingBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.trials, "triads");
        let all: Vec<_> =
            trials(0..self.trials, &bar, |number| run(self.seed, number))?.into_iter().flatten().collect();
        bar.finish_and_clear();
        let over = |place: usize, value: fn(&Errors) -> &[f64]| {
            rms(all.iter().flat_map(move |errors: &[Errors; CALIBRATIONS.len()]| value(&errors[place]).iter().copied()))
        };
        let row = |(place, calibration): (usize, &'static str)| Row {
            calibration,
            bias_rms_mg: 1e3 * over(place, |errors| &errors.bias_g),
            scale_rms_ppm: 1e6 * over(place, |errors| &errors.scale),
            z_up_level_rms_mg: 1e3 * over(place, |errors| &errors.z_up_g[..2]),
            z_up_upright_rms_mg: 1e3 * over(place, |errors| &errors.z_up_g[2..]),
            expected: EXPECTED[place],
        };
        let rows: Vec<_> = CALIBRATIONS.into_iter().enumerate().map(row).collect();
        writeln!(
            out,
            "{} triads ({} refused); in brackets what was expected\n",
            all.len(),
            self.trials - all.len() as u64
        )?;
        writeln!(
            out,
            "| calibration | bias rms, mg | scale rms, ppm | sensor z up: x and y, mg | sensor z up: z, mg |\n\
             |---|---|---|---|---|"
        )?;
        for row in &rows {
            let cell = |value: String, expected: Option<f64>| match expected {
                Some(expected) => format!("{value} ({expected})"),
                None => value,
            };
            let [bias, scale, level, upright] = row.expected;
            writeln!(
                out,
                "| {} | {} | {} | {} | {} |",
                row.calibration,
                cell(format!("{:.2}", row.bias_rms_mg), bias),
                cell(format!("{:.0}", row.scale_rms_ppm), scale),
                cell(format!("{:.2}", row.z_up_level_rms_mg), level),
                cell(format!("{:.2}", row.z_up_upright_rms_mg), upright)
            )?;
        }
        Ok(rows)
    }

    /// The source's finding, and that the field with the old misalignments is no worse than without them.
    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let [day_0, old, ignored, nine, _] = rows else { return Ok(()) };
        let promises = [
            ("the field's biases are no better than those of day 0", old.bias_rms_mg < 0.1 * day_0.bias_rms_mg),
            (
                "the field's scale factors are no better than those of day 0",
                old.scale_rms_ppm < 0.2 * day_0.scale_rms_ppm,
            ),
            ("the old misalignments do not help", old.z_up_level_rms_mg < nine.z_up_level_rms_mg),
            ("ignored misalignments do not show", ignored.z_up_level_rms_mg > 10.0 * nine.z_up_level_rms_mg),
        ];
        let broken: Vec<_> = promises.into_iter().filter(|(_, kept)| !kept).map(|(broken, _)| broken).collect();
        if broken.is_empty() { Ok(()) } else { Err(Failure::Refused(broken.join("; "))) }
    }
}
