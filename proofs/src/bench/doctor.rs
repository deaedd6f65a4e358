//! `north bench doctor`: what the doctor says of instruments with faults, beside what a fix does.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use clap::Args;
use hal_sim::Scenario;
use hal_sim::scenario::{GyroFault, GyroFaultKind};
use north::commands::board;
use north::commands::doctor::{Examination, Finding, Verdict};
use north::engine::Setup;
use north::failure::Failure;
use north::progress;
use north::settings_file::scenario_settings;
use north_finder::health::Fault;
use serde::Serialize;

use super::fixes::fix;
use super::{Bench, trials};
use crate::faults::Trial;

/// Puts a fault into a scenario.
type Inject = fn(&mut Scenario);

/// Faults by themselves, from early on until the end.
const NAMED: [(&str, Inject); 6] = [
    ("healthy", |_| ()),
    ("gyro stuck from 2 s", |scenario| {
        scenario.gyro.faults.push(GyroFault { kind: GyroFaultKind::Stuck, from_s: 2.0, to_s: None });
    }),
    ("weak encoder magnet", |scenario| scenario.encoder.weak_magnet = true),
    ("encoder slips by 3° at 60 s", |scenario| {
        (scenario.encoder.slip_deg, scenario.encoder.slip_at_s) = (3.0, 60.0);
    }),
    ("bias of 50 °/h", |scenario| scenario.gyro.bias_deg_h = 50.0),
    ("noise times 100", |scenario| scenario.gyro.arw_deg_per_sqrt_h *= 100.0),
];
/// What the campaign of faults draws.
const DRAWN: &str = "one to three random faults";
/// Times real time: as fast as the machine is.
const SPEED: f64 = 1e6;
/// Headings of successive seeds, as a share of the circle: the golden ratio.
const OF_HEADING: f64 = 0.618_033_988_749_895;

/// The doctor beside a fix: worlds that a fix refuses must be bad, and healthy ones must not
///
/// Faults by themselves and those that "north bench faults" draws, without commands, power cuts and flipped bits, each acting from its beginning to the
/// end. Exit code 1 where the doctor finds nothing bad in a world that a fix refuses, or something in a healthy one.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench doctor --worlds 20 --drawn 100")]
pub struct DoctorBench {
    /// Worlds for each fault by itself, and healthy ones
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    worlds: u64,
    /// Worlds with drawn faults
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(0..=100_000))]
    drawn: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Worlds of one kind.
#[derive(Default, Serialize)]
pub struct Row {
    faults: &'static str,
    worlds: usize,
    /// Worlds that a fix refuses, and of those the ones that the doctor finds bad.
    refused: usize,
    refused_and_bad: usize,
    /// Worlds with an azimuth that the doctor finds bad all the same.
    azimuth_and_bad: usize,
    /// Of the worlds that a fix refuses and the doctor finds good: why it refused, and what the faults were.
    missed: Vec<String>,
    /// What was bad, worlds.
    bad: BTreeMap<&'static str, usize>,
}

/// What became of a world.
struct Examined {
    kinds: String,
    refused: Option<Option<Fault>>,
    findings: Vec<Finding>,
}

impl Bench for DoctorBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let bar = progress::bar(NAMED.len() as u64 * self.worlds + self.drawn, "worlds");
        writeln!(
            out,
            "| faults | worlds | a fix refuses | … and the doctor says bad | azimuth, and bad | what was bad | missed |\n\
             |---|---|---|---|---|---|---|"
        )?;
        let mut rows = Vec::new();
        for (name, inject) in NAMED {
            let worlds = trials(self.seed..self.seed + self.worlds, &bar, |seed| named(name, inject, seed))?;
            rows.push(Row::new(name, worlds.into_iter().collect::<Result<_, _>>()?));
            bar.suspend(|| rows.last().map_or(Ok(()), |row| row.write(out)))?;
        }
        if self.drawn > 0 {
            let drawn = self.draw()?;
            let worlds = trials(0..drawn.len() as u64, &bar, |number| {
                let trial = &drawn[number as usize];
                let kinds: Vec<_> = trial.kinds.iter().map(|kind| kind.name).collect();
                let setup = Setup {
                    scenario: trial.scenario.clone(),
                    seed: self.seed + number,
                    settings: trial.settings.clone(),
                };
                examine(kinds.join(" and "), &setup)
            })?;
            rows.push(Row::new(DRAWN, worlds.into_iter().collect::<Result<_, _>>()?));
            bar.suspend(|| rows.last().map_or(Ok(()), |row| row.write(out)))?;
        }
        bar.finish_and_clear();
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let missed: usize = rows.iter().map(|row| row.refused - row.refused_and_bad).sum();
        let falsely = rows.iter().filter(|row| row.faults == NAMED[0].0).map(|row| row.azimuth_and_bad).sum::<usize>();
        if missed == 0 && falsely == 0 {
            return Ok(());
        }
        Err(Failure::Refused(format!("{missed} worlds that a fix refuses are not bad, {falsely} healthy ones are")))
    }
}

impl DoctorBench {
    /// Worlds of the campaign of faults whose faults act by themselves, each from its beginning on.
    fn draw(&self) -> Result<Vec<Trial>, Failure> {
        let mut drawn = Vec::new();
        let mut number = 0;
        while (drawn.len() as u64) < self.drawn {
            let mut trial = Trial::draw(self.seed, number)?;
            number += 1;
            if !trial.acts.is_empty() || !trial.flipped_bits.is_empty() || trial.settings.is_none() {
                continue;
            }
            let Scenario { gyro, link, accelerometer, encoder, motor, .. } = &mut trial.scenario;
            gyro.faults.iter_mut().for_each(|fault| fault.to_s = None);
            link.faults.iter_mut().for_each(|fault| fault.to_s = None);
            accelerometer.faults.iter_mut().chain(&mut encoder.faults).for_each(|fault| fault.to_s = None);
            motor.stall_to_s = None;
            drawn.push(trial);
        }
        Ok(drawn)
    }
}

/// A world of a calm bench with one fault.
fn named(name: &str, inject: Inject, seed: u64) -> Result<Examined, Failure> {
    let mut scenario = Scenario::named("calm-bench")?;
    scenario.site.azimuth_deg = 360.0 * (OF_HEADING * seed as f64).fract();
    inject(&mut scenario);
    let settings = scenario_settings(&scenario, None)?;
    examine(name.to_owned(), &Setup { scenario, seed, settings: Some(settings) })
}

/// A fix, and the doctor on the same world from power-up on.
fn examine(kinds: String, setup: &Setup) -> Result<Examined, Failure> {
    let settings = setup.settings.clone().unwrap_or_default();
    let refused = fix(setup.scenario.clone(), setup.seed, settings)?.end.err();
    let (line, mut port) = board::connected()?;
    let stop = AtomicBool::new(false);
    let findings = thread::scope(|scope| {
        let served = scope.spawn(|| board::serve(setup, line, SPEED, &stop));
        let findings = Examination::default().examine(&mut port, &mut io::sink(), &mut io::sink());
        stop.store(true, Ordering::Relaxed);
        served.join().map_err(|_| Failure::Refused("the instrument panicked".into()))??;
        findings
    })?;
    Ok(Examined { kinds, refused, findings })
}

impl Row {
    fn new(faults: &'static str, worlds: Vec<Examined>) -> Self {
        let mut row = Self { faults, worlds: worlds.len(), ..Self::default() };
        for Examined { kinds, refused, findings } in worlds {
            let bad = || findings.iter().filter(|finding| finding.verdict == Verdict::Bad);
            let is_bad = bad().next().is_some();
            match refused {
                Some(fault) => {
                    row.refused += 1;
                    row.refused_and_bad += usize::from(is_bad);
                    if !is_bad {
                        row.missed.push(format!("{kinds}: {}", fault.map_or("no end in time", Fault::name)));
                    }
                }
                None => row.azimuth_and_bad += usize::from(is_bad),
            }
            if let Some(first) = bad().next() {
                *row.bad.entry(first.what).or_default() += 1;
            }
        }
        row
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let bad: Vec<_> = self.bad.iter().map(|(what, count)| format!("{what} {count}")).collect();
        let dash = |text: String| if text.is_empty() { "–".to_owned() } else { text };
        writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} |",
            self.faults,
            self.worlds,
            self.refused,
            self.refused_and_bad,
            self.azimuth_and_bad,
            dash(bad.join(", ")),
            dash(self.missed.join("; ")),
        )
    }
}
