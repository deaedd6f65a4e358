//! `north bench alignment`: heading errors and sigmas against the length of the window, and the bound of a base that stands.

use std::f64::consts::PI;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use hal_sim::vessel::block::{Block, BlockClass};
use hal_sim::vessel::ship::{Leg, Voyage, Waves};
use inertial::{Alignment, Increment, NoiseOfRate};
use nalgebra::Vector3;
use north::failure::Failure;
use north::progress;
use north_finder::units::wrap_180_deg;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::{Bench, trials};

/// Lengths of the windows, s.
const WINDOWS_S: [f64; 6] = [30.0, 60.0, 100.0, 180.0, 300.0, 304.0];
const LATITUDE_DEG: f64 = 34.75;
/// Between samples of the simulated block, s.
const INTERVAL_S: f64 = 0.02;

/// A ring-laser block with its noise alone: a bias is a heading error that no alignment at one heading can see.
const RING_LASER: BlockClass = BlockClass {
    scale_percent: 0.0,
    run_to_run_deg_h: 0.0,
    markov_deg_h: 0.0,
    markov_s: 600.0,
    white_deg_per_sqrt_h: 0.002,
    orthogonality_arcsec: 0.0,
    rhumb_deg_h: 0.0,
    accelerometer_m_s2: 0.0,
    accelerometer_white_m_s_per_sqrt_s: 1e-4,
};
/// The noise of the published system's fibre-optic block.
const FIBRE_OPTIC: BlockClass = BlockClass { white_deg_per_sqrt_h: 0.105409, ..RING_LASER };
/// Gyros better than their accelerometers.
const QUIET_GYROS: BlockClass = BlockClass { white_deg_per_sqrt_h: 0.0003, ..RING_LASER };
/// Accelerometers of 0.3 mg/√Hz beside good gyros: their force alone would tell the heading thirty times worse than the gyros' rates.
const LOUD_ACCELEROMETERS: BlockClass = BlockClass { accelerometer_white_m_s_per_sqrt_s: 3e-3, ..RING_LASER };
/// A rocked vehicle: degrees of roll, pitch, yaw; 3 s.
const VEHICLE: Waves = Waves { roll_deg: 0.1, pitch_deg: 0.05, yaw_deg: 0.02, heave_m: 0.003, period_s: 3.0 };

/// Tilt of a tripod on soft ground: 6″ in a minute. In 30 s the accelerometers tell a drift to 0.04 °/h.
const CREEP_DEG_H: f64 = 0.1;

/// What is simulated: name, block, sway of the base, its creep, °/h.
const CASES: [(&str, BlockClass, Waves, f64); 8] = [
    ("still, ring laser 0.002 °/√h", RING_LASER, Waves::NONE, 0.0),
    ("still, ring laser 0.0003 °/√h", QUIET_GYROS, Waves::NONE, 0.0),
    ("still, fibre-optic 0.105 °/√h", FIBRE_OPTIC, Waves::NONE, 0.0),
    ("still, ring laser 0.002 °/√h, accelerometers 0.3 mg/√Hz", LOUD_ACCELEROMETERS, Waves::NONE, 0.0),
    ("rocked vehicle, ring laser 0.002 °/√h", RING_LASER, VEHICLE, 0.0),
    ("moored in a harbour, ring laser 0.002 °/√h", RING_LASER, Waves::CALM, 0.0),
    ("in a seaway, ring laser 0.002 °/√h", RING_LASER, Waves::SEA, 0.0),
    ("creeps by 0.1 °/h, ring laser 0.002 °/√h", RING_LASER, Waves::NONE, CREEP_DEG_H),
];

/// Heading errors and sigmas of the alignment, with the latitude and without it, for windows of 30 to 304 s
///
/// Simulated blocks on still and on swaying bases, three-dimensional, at random headings; noise of the gyros learned from
/// all windows of a length, as `north align` does. The bound is that of the mean rate of a base that is known to stand. Where the recording of the ring-laser block in a parked vehicle is at hand, its
/// windows too, against the published heading, with a bias taken from the excess of the horizontal rate, and as repeatability.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  north bench alignment\n  north bench alignment --trials 200 --json alignment.json"
)]
pub struct AlignmentBench {
    /// Simulated windows of each case, 10 to 10000
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u64).range(10..=10_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder of the measured data, with ring-laser-triad/increments_100hz.csv; else that of NORTH_FINDER_DATA
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

/// All windows of a length.
#[derive(Serialize)]
pub struct Row {
    base: String,
    simulated: bool,
    seconds: f64,
    latitude_known: bool,
    windows: usize,
    refused: usize,
    rms_error_deg: f64,
    rms_sigma_deg: f64,
    rms_error_over_sigma: f64,
    within_95_percent: f64,
    /// Of a base that is known to stand, by the noise of the gyros; none of what was measured.
    bound_deg: Option<f64>,
}

/// A window with the true heading at its end.
struct Gathered {
    alignment: Alignment,
    heading_deg: f64,
}

impl Bench for AlignmentBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(CASES.len() as u64 * self.trials, "windows");
        let mut rows = Vec::new();
        for (number, (name, class, waves, creep_deg_h)) in CASES.iter().enumerate() {
            let all = trials(0..self.trials, &bar, |trial| {
                self.trial(class, waves, *creep_deg_h, ((number as u64) << 32) + trial)
            })?;
            let mut lengths: Vec<Vec<Gathered>> = WINDOWS_S.iter().map(|_| Vec::new()).collect();
            for (length, window) in all.into_iter().flat_map(|windows| windows.into_iter().enumerate()) {
                lengths[length].push(window);
            }
            for (seconds, windows) in WINDOWS_S.into_iter().zip(&lengths) {
                let bound = bound_deg(class, seconds);
                rows.extend(judged(name, Some(bound), seconds, windows, LATITUDE_DEG, Some(0.0)));
            }
        }
        bar.finish_and_clear();
        let data = self.data.clone().or_else(|| std::env::var_os("NORTH_FINDER_DATA").map(PathBuf::from));
        let samples = recording(&data.unwrap_or_else(|| PathBuf::from("../shared/data")))?;
        rows.extend(measured(&samples));
        write_rows(out, self.trials, &rows)?;
        Ok(rows)
    }

    /// 93 to 97 % of the headings lie within 1.96 sigma; 2.58 standard deviations of a share of 95 % of n are granted on top. Without a
    /// latitude sigma is not promised, and of windows of 30 s nothing: their noise cannot be told from what the base does.
    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let judged = rows.iter().filter(|row| row.simulated && row.latitude_known && row.seconds >= 60.0);
        let bad: Vec<String> = judged
            .filter(|row| {
                let granted = 258.0 * (0.95 * 0.05 / row.windows as f64).sqrt();
                !(93.0 - granted..=97.0 + granted).contains(&row.within_95_percent)
            })
            .map(|row| format!("{}, {} s: {:.1} %", row.base, row.seconds, row.within_95_percent))
            .collect();
        if bad.is_empty() {
            return Ok(());
        }
        Err(Failure::Refused(format!("1.96 sigma does not hold 93 to 97 % of the headings: {}", bad.join("; "))))
    }
}

impl AlignmentBench {
    /// One voyage that goes nowhere; a window of each length from its start.
    fn trial(&self, class: &BlockClass, waves: &Waves, creep_deg_h: f64, number: u64) -> Vec<Gathered> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number);
        let heading_deg = random.random_range(0.0..360.0);
        let waves = Waves { period_s: waves.period_s * random.random_range(0.7..1.4), ..*waves };
        let longest_s = WINDOWS_S.into_iter().fold(0.0, f64::max);
        let leg = Leg { until_s: longest_s, heading_deg, speed_m_s: 0.0, depth_m: 0.0 };
        let moored = Voyage::moored(LATITUDE_DEG, 1.0, &[heading_deg], 3600.0);
        let passage = Voyage { legs: vec![leg], waves, interval_s: INTERVAL_S, ..moored }.sail();
        let mut block = Block::new(*class, self.seed.wrapping_mul(1 << 20) ^ number);
        let mut growing = Alignment::default();
        let mut windows = Vec::new();
        for step in &passage.steps {
            // The ship's block has x to starboard and y forward.
            let ([ax, ay, az], [vx, vy, vz]) = block.read(step, INTERVAL_S);
            let (angle_rad, velocity_m_s) = (Vector3::new(ay, -ax, az), Vector3::new(vy, -vx, vz));
            // The left side rises: what the block measures turns the other way.
            let creep_rad_s = creep_deg_h.to_radians() / 3600.0;
            let roll_rad = creep_rad_s * growing.seconds();
            let rolled = |v: Vector3<f64>| Vector3::new(v.x, v.y + roll_rad * v.z, v.z - roll_rad * v.y);
            let angle_rad = rolled(angle_rad) + Vector3::x() * (creep_rad_s * INTERVAL_S);
            growing.push(INTERVAL_S, Increment { angle_rad, velocity_m_s: rolled(velocity_m_s) });
            if WINDOWS_S.iter().any(|seconds| (growing.seconds() - seconds).abs() < 0.5 * INTERVAL_S) {
                windows.push(Gathered { alignment: growing.clone(), heading_deg: step.end.heading_deg() });
            }
        }
        windows
    }
}

/// N/√T over Ω cos φ: white noise of the rate in the mean of a window.
fn bound_deg(class: &BlockClass, seconds: f64) -> f64 {
    let rate_deg_h = class.white_deg_per_sqrt_h / (seconds / 3600.0).sqrt();
    (rate_deg_h / (15.041067 * LATITUDE_DEG.to_radians().cos())).to_degrees()
}

/// With the latitude and without it on windows of one length, noise learned from all of them.
fn judged(
    base: &str,
    bound_deg: Option<f64>,
    seconds: f64,
    windows: &[Gathered],
    latitude_deg: f64,
    bias_deg_h: Option<f64>,
) -> Vec<Row> {
    let learned = |latitude: Option<f64>| {
        let of_windows = windows.iter().filter_map(|window| window.alignment.noise(latitude));
        of_windows.reduce(|a, b| a.with(&b)).unwrap_or(NoiseOfRate::Declared(0.0))
    };
    let noise = learned(Some(latitude_deg));
    let row = |latitude_known: bool| {
        let latitude = latitude_known.then_some(latitude_deg);
        let solved: Vec<(f64, f64)> = windows
            .iter()
            .filter_map(|window| {
                let aligned = window.alignment.solve(latitude, &noise, bias_deg_h).ok()?;
                Some((wrap_180_deg(aligned.angles.heading_deg - window.heading_deg), aligned.sigma_heading_deg))
            })
            .collect();
        let n = solved.len() as f64;
        let rms = |of: fn(&(f64, f64)) -> f64| (solved.iter().map(|pair| of(pair).powi(2)).sum::<f64>() / n).sqrt();
        Row {
            base: base.to_owned(),
            simulated: bound_deg.is_some(),
            seconds,
            latitude_known,
            windows: solved.len(),
            refused: windows.len() - solved.len(),
            rms_error_deg: rms(|pair| pair.0),
            rms_sigma_deg: rms(|pair| pair.1),
            rms_error_over_sigma: rms(|pair| pair.0 / pair.1),
            within_95_percent: 100.0
                * solved.iter().filter(|(error, sigma)| error.abs() <= 1.96 * sigma).count() as f64
                / n,
            bound_deg,
        }
    };
    [true, false].map(row).into()
}

/// Of the recording of a ring-laser block in a parked vehicle; its published heading, to 0.1°.
const MEASURED_LATITUDE_DEG: f64 = 34.246048;
const MEASURED_HEADING_DEG: f64 = 90.6;
/// Samples of it in a second.
const MEASURED_HZ: f64 = 100.0;

/// The recording of a ring-laser block in a parked vehicle (docs/import.md says where it is); none where it is not.
fn recording(data: &Path) -> Result<Vec<Increment>, Failure> {
    let path = data.join("ring-laser-triad/increments_100hz.csv");
    let Ok(text) = std::fs::read_to_string(&path) else { return Ok(Vec::new()) };
    // Counts of 0.1 arcsec, and of 0.0125 g over 10 ms; x to the right, y forward.
    let (rad, m_s) = (0.1 / 3600.0 * PI / 180.0, 0.0125 * 9.80665 * 0.01);
    let refused = |line: usize| Failure::Refused(format!("{}: line {line}: not six numbers", path.display()));
    let mut samples = Vec::new();
    for (number, line) in text.lines().enumerate().skip(1) {
        let fields: Vec<f64> = line.split(',').filter_map(|field| field.trim().parse().ok()).collect();
        let [gx, gy, gz, ax, ay, az] = fields[..] else { return Err(refused(number + 1)) };
        let (angle, velocity) = (Vector3::new(gy, -gx, gz), Vector3::new(ay, -ax, az));
        samples.push(Increment { angle_rad: angle * rad, velocity_m_s: velocity * m_s });
    }
    Ok(samples)
}

/// Windows one after the other.
fn cut(samples: &[Increment], seconds: f64) -> Vec<Gathered> {
    let gather = |samples: &[Increment]| {
        let mut alignment = Alignment::default();
        for sample in samples {
            alignment.push(1.0 / MEASURED_HZ, *sample);
        }
        Gathered { alignment, heading_deg: MEASURED_HEADING_DEG }
    };
    samples.chunks_exact((MEASURED_HZ * seconds) as usize).map(gather).collect()
}

/// The base's name in rows of the recording whose gyro bias is what the rate has beyond the Earth's.
const BIAS_BY_EXCESS: &str = "measured, bias by the excess";

fn measured(samples: &[Increment]) -> Vec<Row> {
    if samples.is_empty() {
        return Vec::new();
    }
    let rows = WINDOWS_S.into_iter().flat_map(|seconds| {
        let windows = cut(samples, seconds);
        [(BIAS_BY_EXCESS, None), ("measured, no bias", Some(0.0))]
            .into_iter()
            .flat_map(move |(name, bias)| judged(name, None, seconds, &windows, MEASURED_LATITUDE_DEG, bias))
    });
    rows.collect()
}

fn write_rows(out: &mut dyn Write, trials: u64, rows: &[Row]) -> io::Result<()> {
    let interval = 196.0 / (2.0 * trials as f64).sqrt();
    writeln!(
        out,
        "{trials} simulated windows a row at {LATITUDE_DEG}°: 95 % intervals of an rms ±{interval:.0} %.\n\n\
         | base | window, s | latitude | windows (refused) | rms error, ° | bound, ° | rms sigma, ° | error / sigma, rms | within 1.96 sigma, % |\n\
         |---|---|---|---|---|---|---|---|---|"
    )?;
    rows.iter().try_for_each(|row| {
        writeln!(
            out,
            "| {} | {:.0} | {} | {} ({}) | {:.4} | {} | {:.4} | {:.2} | {:.0} |",
            row.base,
            row.seconds,
            if row.latitude_known { "known" } else { "found" },
            row.windows,
            row.refused,
            row.rms_error_deg,
            row.bound_deg.map_or_else(|| "–".to_owned(), |bound| format!("{bound:.4}")),
            row.rms_sigma_deg,
            row.rms_error_over_sigma,
            row.within_95_percent
        )
    })?;
    write_by_length(out, rows)?;
    write_measured(out, rows)
}

/// The windows of the recording, of known latitude: the bias by the excess of the rate, and none.
fn write_measured(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    let (by_excess, without): (Vec<&Row>, Vec<&Row>) =
        rows.iter().filter(|row| !row.simulated && row.latitude_known).partition(|row| row.base == BIAS_BY_EXCESS);
    if by_excess.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\nThe recording, cut into windows:\n\n\
         | window, s | windows | rms error, ° | rms sigma, bias by the excess, ° | within 1.96 sigma | rms sigma, `--bias 0`, ° | within 1.96 sigma |\n\
         |---|---|---|---|---|---|---|"
    )?;
    let within = |row: &Row| (row.within_95_percent * row.windows as f64 / 100.0).round();
    by_excess.iter().zip(without).try_for_each(|(excess, none)| {
        writeln!(
            out,
            "| {:.0} | {} | {:.3} | {:.3} | {} | {:.3} | {} |",
            excess.seconds,
            excess.windows,
            excess.rms_error_deg,
            excess.rms_sigma_deg,
            within(excess),
            none.rms_sigma_deg,
            within(none)
        )
    })
}

/// The simulated windows of known latitude, one length beside the other.
fn write_by_length(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    let chosen: Vec<&Row> = rows.iter().filter(|row| row.simulated && row.latitude_known).collect();
    let lengths: String = WINDOWS_S.iter().map(|seconds| format!(" {seconds:.0} s |")).collect();
    writeln!(
        out,
        "\nrms error / rms sigma (bound), °, and the share within 1.96 sigma:\n\n| base |{lengths}\n|---|{}",
        "---|".repeat(WINDOWS_S.len())
    )?;
    let angle = |deg: f64| if deg < 1.0 { format!("{deg:.3}") } else { format!("{deg:.2}") };
    chosen.chunk_by(|a, b| a.base == b.base).try_for_each(|of_base| {
        let of_row = |row: &&Row| {
            let bound = row.bound_deg.map_or_else(|| "–".to_owned(), angle);
            let (error, sigma) = (angle(row.rms_error_deg), angle(row.rms_sigma_deg));
            format!(" {error} / {sigma} ({bound}), {:.0} % |", row.within_95_percent)
        };
        writeln!(out, "| {} |{}", of_base[0].base, of_base.iter().map(of_row).collect::<String>())
    })
}
