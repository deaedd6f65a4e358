//! `north bench hold`: a heading that is carried from a fix to another place, against the truth.

use std::io::{self, Write};

use clap::Args;
use hal_sim::block::CarriedBlock;
use hal_sim::scenario::{Block, Carry};
use indicatif::ProgressBar;
use inertial::{Angles, BlockClass, Hold, HoldLimits, Increment, Quaternion};
use north::engine::qemu::image;
use north::failure::Failure;
use north::progress;
use north_finder::fix::heading::settings::{BlockSettings, Class};
use north_finder::units::wrap_180_deg;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::{Bench, trials};
use crate::statistics::{probability_interval, rms};
use crate::trials::carried::{self, DWELL_S, MOMENTS, Moment, simulated};

/// Sway of the base before and after the walk, arcsec about each axis, and its frequencies, Hz: a tripod in the wind.
const SWAY_ARCSEC: [f64; 3] = [20.0, 14.0, 6.0];
const SWAY_HZ: std::ops::Range<f64> = 0.15..0.6;
/// Sigma of the fix that is carried, degrees.
const FIX_SIGMA_DEG: f64 = 0.04;
const LATITUDE_DEG: f64 = 34.75;

/// Classes of blocks that are carried by the whole instrument.
const CHAIN: [Class; 3] = [Class::SourceMems, Class::ModernMems, Class::SourceFog];
const ALONE: &str = "hold alone";
const WHOLE: &str = "whole instrument";

/// Heading and sigma of a fix that is carried to another place and set down, for every class of block
///
/// Each trial draws its block and its way, a walk of 10 to 120 s with a turn. First the hold alone: it draws its fix error, stands
/// for 120 s before the walk and for 60 s after it, on a firm base and on one that sways by 20 arcseconds. Then the whole instrument: a fix, a minute of waiting, the walk, 30 s. Tables
/// are Markdown; intervals are of 95 %, binomial.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north bench hold --trials 100\n  north bench hold --whole --trials 100 --qemu 20")]
pub struct HoldBench {
    /// Trials for each row, 10 to 100000
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(10..=100_000))]
    trials: u64,
    /// Only the whole instrument
    #[arg(long)]
    whole: bool,
    /// Beside the whole instrument in this process: so many of its first trials of each class as the firmware image in QEMU, 1 to 10000.
    /// Every report must be the same, bit for bit
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    qemu: Option<u64>,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One line of a table.
#[derive(Serialize)]
pub struct Row {
    /// "hold alone" or "whole instrument".
    what: &'static str,
    class: &'static str,
    trials: usize,
    /// "noise alone", or when in the trial.
    moment: String,
    rms_error_deg: f64,
    rms_sigma_deg: f64,
    within_95_percent: f64,
    /// Its 95 % interval.
    interval_percent: [f64; 2],
    refix_percent: f64,
    /// Mean normalised squared innovation while it stood, and how many.
    nis: Option<f64>,
    nis_degrees_of_freedom: u32,
    /// Trials that were run in QEMU too, and how many of them were the same, bit for bit.
    in_qemu: u64,
    same_in_qemu: u64,
}

impl Bench for HoldBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let alone = if self.whole { 0 } else { 2 * BlockClass::ALL.len() + 6 };
        let in_qemu = self.qemu.unwrap_or(0) * CHAIN.len() as u64;
        let bar = progress::bar(self.trials * (alone + CHAIN.len()) as u64 + in_qemu, "trials");
        let mut rows = if self.whole { Vec::new() } else { self.alone(&bar)? };
        for class in CHAIN {
            let seeds = self.seed..self.seed + self.trials;
            let trials = trials(seeds, &bar, |seed| carried::carry(class, seed))?;
            let fixed: Vec<[Moment; 4]> =
                trials.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect();
            let name = BlockSettings { class, ..Default::default() }.figures().name;
            for (number, moment) in MOMENTS.into_iter().enumerate() {
                let moments: Vec<Moment> = fixed.iter().map(|trial| trial[number]).collect();
                rows.push(row(WHOLE, name, moment.to_owned(), &moments));
            }
        }
        if let Some(count) = self.qemu {
            self.in_qemu(count, &bar, &mut rows)?;
        }
        bar.finish_and_clear();
        write_rows(out, &rows)?;
        Ok(rows)
    }

    /// Of 100 intervals that hold 95 %, 89 to 99 do with a probability of 0.99 (binomial).
    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let least = |trials: usize| 100.0 * (0.95 - 2.58 * (0.95 * 0.05 / trials as f64).sqrt());
        if let Some(row) = rows.iter().find(|row| row.same_in_qemu < row.in_qemu) {
            let (same, all) = (row.same_in_qemu, row.in_qemu);
            return Err(Failure::Refused(format!("{}: {same} of {all} trials are the same in QEMU", row.class)));
        }
        let bad: Vec<String> = rows
            .iter()
            .filter(|row| !(row.within_95_percent >= least(row.trials)))
            .map(|row| format!("{}, {}, {}: {:.1} %", row.what, row.class, row.moment, row.within_95_percent))
            .collect();
        if bad.is_empty() {
            return Ok(());
        }
        Err(Failure::Refused(format!("95 % intervals hold too little: {}", bad.join("; "))))
    }
}

impl HoldBench {
    /// The first trials of each class in the image too.
    fn in_qemu(&self, count: u64, bar: &ProgressBar, rows: &mut [Row]) -> Result<(), Failure> {
        let image = image::build(image::Board::Mps2)?;
        for class in CHAIN {
            let name = BlockSettings { class, ..Default::default() }.figures().name;
            let same = trials(self.seed..self.seed + count, bar, |seed| carried::same_in_qemu(&image, class, seed))?;
            let same = same.into_iter().collect::<Result<Vec<_>, _>>()?;
            for row in rows.iter_mut().filter(|row| row.what == WHOLE && row.class == name) {
                (row.in_qemu, row.same_in_qemu) = (count, same.iter().filter(|same| **same).count() as u64);
            }
        }
        Ok(())
    }

    /// The hold alone.
    fn alone(&self, bar: &ProgressBar) -> Result<Vec<Row>, Failure> {
        let mut rows = Vec::new();
        for (number, class) in BlockClass::ALL.iter().enumerate() {
            for (base, sway_arcsec) in [("", [0.0; 3]), (", swaying base", SWAY_ARCSEC)] {
                let first = (number as u64) << 32;
                let trials = trials(first..first + self.trials, bar, |trial| self.trial(class, trial, sway_arcsec))?;
                for (moment, name) in ["before the walk", "after the walk", "set down for 60 s"].into_iter().enumerate()
                {
                    let outcomes: Vec<Moment> = trials.iter().map(|trial| trial[moment]).collect();
                    rows.push(row(ALONE, class.name, format!("{name}{base}"), &outcomes));
                }
            }
        }
        for class in &BlockClass::ALL[..2] {
            for seconds in [0.33, 10.0, 60.0] {
                let outcomes = trials(0..self.trials, bar, |trial| white(class, seconds, self.seed ^ (trial << 8)))?;
                rows.push(row(ALONE, class.name, format!("white noise alone for {seconds} s"), &outcomes));
            }
        }
        Ok(rows)
    }

    fn trial(&self, class: &BlockClass, number: u64, sway_arcsec: [f64; 3]) -> [Moment; 3] {
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
        let mut innovations = [(0.0, 0); 3];
        let seed = self.seed.wrapping_mul(1 << 20) ^ number;
        for sample in CarriedBlock::new(LATITUDE_DEG, heading_deg, &carry, &simulated(class), seed) {
            let swayed = sway(sample.t_s);
            let angle_rad = nalgebra::Vector3::from(sample.angle_rad) + swayed - sway(sample.t_s - sample.dt_s);
            let increment = Increment { angle_rad, velocity_m_s: sample.velocity_m_s.into() };
            let Some(second) = hold.push(sample.dt_s, increment) else { continue };
            let Some(moment) = ends_s.iter().position(|end_s| sample.t_s <= end_s + 0.001) else { continue };
            innovations[moment].0 += second.normalised_squared;
            innovations[moment].1 += second.degrees_of_freedom;
            outcomes[moment] = Some(Moment {
                error_deg: wrap_180_deg(second.angles.heading_deg - sample.heading_deg + swayed.z.to_degrees()),
                sigma_deg: second.sigma_heading_deg,
                refix: second.refix,
                innovations: innovations[moment],
            });
        }
        outcomes.map(|outcome| outcome.expect("every part of the way has a second"))
    }
}

/// A block with nothing but white noise, summed up without any help.
fn white(class: &BlockClass, seconds: f64, seed: u64) -> Moment {
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
    Moment { error_deg, sigma_deg, refix: sigma_deg > HoldLimits::default().refix_deg, innovations: (0.0, 0) }
}

fn row(what: &'static str, class: &'static str, moment: String, outcomes: &[Moment]) -> Row {
    let trials = outcomes.len();
    let rms = |of: fn(&Moment) -> f64| rms(outcomes.iter().map(of));
    let count = |of: fn(&Moment) -> bool| outcomes.iter().filter(|outcome| of(outcome)).count();
    let percent = |count: usize| 100.0 * count as f64 / trials as f64;
    let (squares, number) =
        outcomes.iter().fold((0.0, 0), |sum, outcome| (sum.0 + outcome.innovations.0, sum.1 + outcome.innovations.1));
    let within = count(|outcome| outcome.error_deg.abs() <= 1.96 * outcome.sigma_deg);
    Row {
        what,
        class,
        trials,
        moment,
        rms_error_deg: rms(|outcome| outcome.error_deg),
        rms_sigma_deg: rms(|outcome| outcome.sigma_deg),
        within_95_percent: percent(within),
        interval_percent: probability_interval(within, trials).map(|probability| 100.0 * probability),
        refix_percent: percent(count(|outcome| outcome.refix)),
        nis: (number > 0).then(|| squares / f64::from(number)),
        nis_degrees_of_freedom: number,
        in_qemu: 0,
        same_in_qemu: 0,
    }
}

fn write_rows(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        out,
        "Hold alone: a fix of {FIX_SIGMA_DEG}° at {LATITUDE_DEG}°, 120 s of standing, a walk of 10 to 120 s with a turn, set down. \
         Whole instrument: dwells of {DWELL_S} s at four positions, 60 s of standing, the walk, 30 s of standing.\n\n\
         | what | class | moment | trials | rms error, ° | rms sigma, ° | within 1.96 sigma, % | new fix wanted, % | NIS | same in QEMU, of |\n\
         |---|---|---|---|---|---|---|---|---|---|"
    )?;
    rows.iter().try_for_each(|row| {
        writeln!(
            out,
            "| {} | {} | {} | {} | {:.4} | {:.4} | {:.1} ({:.1} to {:.1}) | {:.0} | {} | {} |",
            row.what,
            row.class,
            row.moment,
            row.trials,
            row.rms_error_deg,
            row.rms_sigma_deg,
            row.within_95_percent,
            row.interval_percent[0],
            row.interval_percent[1],
            row.refix_percent,
            row.nis.map_or_else(|| "–".to_owned(), |nis| format!("{nis:.3}")),
            if row.in_qemu > 0 { format!("{}, {}", row.same_in_qemu, row.in_qemu) } else { "–".to_owned() }
        )
    })
}
