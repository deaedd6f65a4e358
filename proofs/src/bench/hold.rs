//! `north bench hold`: a heading that is carried from a fix to another place, against the truth.

use std::io::{self, Write};

use clap::Args;
use hal_sim::block::CarriedBlock;
use hal_sim::scenario::{Block, Carry};
use north::failure::Failure;
use north::progress;
use north_finder::attitude::{Angles, BlockClass, Hold, HoldLimits, Increment, Quaternion};
use north_finder::units::wrap_180_deg;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::{Bench, trials};

/// Sway of the base before and after the walk, arcsec about each axis, and its frequencies, Hz: a tripod in the wind.
const SWAY_ARCSEC: [f64; 3] = [20.0, 14.0, 6.0];
const SWAY_HZ: std::ops::Range<f64> = 0.15..0.6;
/// Sigma of the fix that is carried, degrees.
const FIX_SIGMA_DEG: f64 = 0.04;
const LATITUDE_DEG: f64 = 34.75;

/// Heading and sigma of a fix that is carried to another place and set down, for every class of block
///
/// Each trial draws its fix error, its block and its way: 120 s of standing, a walk of 10 to 120 s with a turn, 60 s of
/// standing, on a firm base and on one that sways by 20 arcseconds. Tables are Markdown.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench hold --trials 100")]
pub struct HoldBench {
    /// Trials for each row, 10 to 100000
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(10..=100_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One line of a table.
#[derive(Serialize)]
pub struct Row {
    class: &'static str,
    /// "noise alone", or when in the trial.
    moment: String,
    rms_error_deg: f64,
    rms_sigma_deg: f64,
    within_95_percent: f64,
    refix_percent: f64,
}

/// Heading error and sigma at one moment of one trial.
#[derive(Clone, Copy)]
struct Outcome {
    error_deg: f64,
    sigma_deg: f64,
    refix: bool,
}

impl Bench for HoldBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(self.trials * (2 * BlockClass::ALL.len() as u64 + 6), "trials");
        let mut rows = Vec::new();
        for (number, class) in BlockClass::ALL.iter().enumerate() {
            for (base, sway_arcsec) in [("", [0.0; 3]), (", swaying base", SWAY_ARCSEC)] {
                let first = (number as u64) << 32;
                let trials = trials(first..first + self.trials, &bar, |trial| self.trial(class, trial, sway_arcsec))?;
                for (moment, name) in ["before the walk", "after the walk", "set down for 60 s"].into_iter().enumerate()
                {
                    let outcomes: Vec<Outcome> = trials.iter().map(|trial| trial[moment]).collect();
                    rows.push(row(class.name, format!("{name}{base}"), &outcomes));
                }
            }
        }
        for class in &BlockClass::ALL[..2] {
            for seconds in [0.33, 10.0, 60.0] {
                let outcomes = trials(0..self.trials, &bar, |trial| white(class, seconds, self.seed ^ (trial << 8)))?;
                rows.push(row(class.name, format!("white noise alone for {seconds} s"), &outcomes));
            }
        }
        bar.finish_and_clear();
        write_rows(out, self.trials, &rows)?;
        Ok(rows)
    }

    /// Of 100 intervals that hold 95 %, 89 to 99 do with a probability of 0.99 (binomial); the source's block is wide enough
    /// that none of its sigmas is small.
    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let n = self.trials as f64;
        let least = 100.0 * (0.95 - 2.58 * (0.95 * 0.05 / n).sqrt());
        let bad: Vec<String> = rows
            .iter()
            .filter(|row| row.within_95_percent < least)
            .map(|row| format!("{}, {}: {:.1} %", row.class, row.moment, row.within_95_percent))
            .collect();
        if bad.is_empty() {
            return Ok(());
        }
        Err(Failure::Refused(format!("95 % intervals hold less than {least:.1} %: {}", bad.join("; "))))
    }
}

impl HoldBench {
    fn trial(&self, class: &BlockClass, number: u64, sway_arcsec: [f64; 3]) -> [Outcome; 3] {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (fix_error_deg, level) = (FIX_SIGMA_DEG * normal(), [normal(), normal()]);
        let heading_deg: f64 = random.random_range(0.0..360.0);
        let carry = Carry {
            turn_deg: random.random_range(-180.0..180.0),
            wait_s: 120.0,
            walk_s: random.random_range(10.0_f64..120.0).round(),
            stand_s: 60.0,
            set_down_deg: [random.random_range(-3.0..3.0), random.random_range(-3.0..3.0)],
            ..Carry::default()
        };
        let level_sigma_deg = (class.accelerometer_m_s2 / 9.8).to_degrees();
        let fixed = Angles {
            heading_deg: heading_deg + fix_error_deg,
            pitch_deg: level_sigma_deg * level[0],
            roll_deg: level_sigma_deg * level[1],
        };
        let mut hold = Hold::new(class, HoldLimits::default(), LATITUDE_DEG, &fixed, FIX_SIGMA_DEG, level_sigma_deg)
            .expect("34.75° is far from the poles");
        let (hz, phase) = (random.random_range(SWAY_HZ), random.random_range(0.0..std::f64::consts::TAU));
        // It sways where it stands; a turn of arcseconds adds to the increments as it is, and about up it takes from the heading.
        let sway = |t_s: f64| {
            let stands = t_s <= carry.wait_s || t_s > carry.wait_s + carry.walk_s;
            let share = if stands { (std::f64::consts::TAU * hz * t_s + phase).sin() } else { 0.0 };
            nalgebra::Vector3::from(sway_arcsec) * (share * (1.0f64 / 3600.0).to_radians())
        };
        let ends_s = [carry.wait_s, carry.wait_s + carry.walk_s, f64::INFINITY];
        let mut outcomes = [None; 3];
        let seed = self.seed.wrapping_mul(1 << 20) ^ number;
        for sample in CarriedBlock::new(LATITUDE_DEG, heading_deg, &carry, &simulated(class), seed) {
            let swayed = sway(sample.t_s);
            let angle_rad = nalgebra::Vector3::from(sample.angle_rad) + swayed - sway(sample.t_s - sample.dt_s);
            let increment = Increment { angle_rad, velocity_m_s: sample.velocity_m_s.into() };
            let Some(second) = hold.push(sample.dt_s, increment) else { continue };
            let outcome = Outcome {
                error_deg: wrap_180_deg(second.angles.heading_deg - sample.heading_deg + swayed.z.to_degrees()),
                sigma_deg: second.sigma_heading_deg,
                refix: second.refix,
            };
            if let Some(moment) = ends_s.iter().position(|end_s| sample.t_s <= end_s + 0.001) {
                outcomes[moment] = Some(outcome);
            }
        }
        outcomes.map(|outcome| outcome.expect("every part of the way has a second"))
    }
}

/// A block of this class.
fn simulated(class: &BlockClass) -> Block {
    Block {
        arw_deg_per_sqrt_h: class.arw_deg_sqrt_h,
        run_to_run_deg_h: class.run_to_run_deg_h,
        markov_deg_h: class.markov_deg_h,
        markov_s: class.markov_s,
        scale_ppm: class.scale_ppm,
        misalignment_arcsec: class.misalignment_arcsec,
        accelerometer_m_s2: class.accelerometer_m_s2,
        vrw_m_s_per_sqrt_s: class.vrw_m_s_sqrt_s,
        saturation_deg_s: 1.02 * class.range_deg_s,
        ..Block::default()
    }
}

/// A block with nothing but white noise, summed up without any help.
fn white(class: &BlockClass, seconds: f64, seed: u64) -> Outcome {
    let quiet = Block {
        run_to_run_deg_h: 0.0,
        markov_deg_h: 0.0,
        scale_ppm: 0.0,
        misalignment_arcsec: 0.0,
        ..simulated(class)
    };
    // The mark points north at the equator, along the axis of the Earth; only the time of waiting is looked at.
    let carry = Carry { wait_s: seconds, ..Carry::default() };
    let earth = nalgebra::Vector3::new(0.0, 7.292115e-5 * 0.01, 0.0);
    let mut orientation = Quaternion::from_angles(&Angles::default());
    for sample in CarriedBlock::new(0.0, 0.0, &carry, &quiet, seed).take_while(|sample| sample.t_s < seconds + 0.005) {
        orientation = orientation.advance(&sample.angle_rad.into(), &earth);
    }
    let sigma_deg = class.arw_deg_sqrt_h / 60.0 * seconds.sqrt();
    let error_deg = wrap_180_deg(orientation.angles().heading_deg);
    Outcome { error_deg, sigma_deg, refix: sigma_deg > HoldLimits::default().refix_deg }
}

fn row(class: &'static str, moment: String, outcomes: &[Outcome]) -> Row {
    let n = outcomes.len() as f64;
    let rms = |of: fn(&Outcome) -> f64| (outcomes.iter().map(|outcome| of(outcome).powi(2)).sum::<f64>() / n).sqrt();
    let percent = |of: fn(&Outcome) -> bool| 100.0 * outcomes.iter().filter(|outcome| of(outcome)).count() as f64 / n;
    Row {
        class,
        moment,
        rms_error_deg: rms(|outcome| outcome.error_deg),
        rms_sigma_deg: rms(|outcome| outcome.sigma_deg),
        within_95_percent: percent(|outcome| outcome.error_deg.abs() <= 1.96 * outcome.sigma_deg),
        refix_percent: percent(|outcome| outcome.refix),
    }
}

fn write_rows(out: &mut dyn Write, trials: u64, rows: &[Row]) -> io::Result<()> {
    writeln!(
        out,
        "{trials} trials a row: a fix of {FIX_SIGMA_DEG}° at {LATITUDE_DEG}°, 120 s of standing, a walk of 10 to 120 s with a \
         turn, set down.\n\n| class | moment | rms error, ° | rms sigma, ° | within 1.96 sigma, % | new fix wanted, % |\n\
         |---|---|---|---|---|---|"
    )?;
    rows.iter().try_for_each(|row| {
        writeln!(
            out,
            "| {} | {} | {:.4} | {:.4} | {:.1} | {:.0} |",
            row.class, row.moment, row.rms_error_deg, row.rms_sigma_deg, row.within_95_percent, row.refix_percent
        )
    })
}
