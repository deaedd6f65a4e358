//! The image that is flashed finds north on the emulated chip: `make chip`, or with a scenario and a seed `make chip ARGS="windy-tripod 2"`. At
//! its end it says what of the stack was used, as far as its paint is gone, and how long the longest tick was; `north bench cost` reads that.

use std::process::ExitCode;
use std::time::Instant;

use hal_sim::{Scenario, World};
use north_chip::{Line, Setup, image, run};
use north_finder::event::{Event, Fix, Report};
use north_finder::link::{Ask, ReportDecoder, Request};
use north_finder::sequence::Command;
use simulated::RequestLine;

/// Beyond the settings' time limit, s: the instrument ends its fix by itself.
const MARGIN_S: f64 = 60.0;
const TICKS_PER_S: f64 = 400.0;

/// Wants a fix, and writes what happens on the way.
struct Surveyor {
    line: RequestLine,
    decoder: ReportDecoder,
    fix: Option<Fix>,
    /// After the fix: most bytes of the stack that were used, and thousandths of a tick that the longest took.
    vitals: Option<(u32, u32)>,
    /// Ends it without a fix.
    failed: bool,
    limit_ticks: u64,
}

impl Surveyor {
    fn hear(&mut self, report: &Report) {
        match &report.event {
            Event::State(state) => println!("{:8.1} s  {}", report.t_s, state.name()),
            Event::Fault { fault, state } => {
                println!("{:8.1} s  fault {} while {}", report.t_s, fault.name(), state.name());
                self.failed = true;
            }
            Event::Fix(fix) => self.fix = Some(*fix),
            Event::Vitals { stack_bytes, load_permille, .. } if self.fix.is_some() => {
                self.vitals = Some((*stack_bytes, *load_permille));
            }
            _ => {}
        }
    }
}

impl Line for Surveyor {
    fn tick(&mut self, tick: u64, sent: &[u8]) -> Option<Vec<u8>> {
        for &byte in sent {
            match self.decoder.feed(byte) {
                Some(Ok(report)) => self.hear(&report),
                Some(Err(error)) => eprintln!("a bad frame: {error:?}"),
                None => {}
            }
        }
        if tick == 0 {
            // A command fits a frame: a test of the link says so.
            let _ = self.line.send(&Request { number: 1, ask: Ask::Command(Command::Start) });
        }
        (self.vitals.is_none() && !self.failed && tick < self.limit_ticks).then(|| self.line.tick())
    }
}

fn main() -> ExitCode {
    match find() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

/// Whether there is an azimuth.
fn find() -> Result<bool, String> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "calm-bench".into());
    let seed = arguments.next().map_or(Ok(1), |seed| seed.parse().map_err(|error| format!("seed {seed}: {error}")))?;
    let scenario = Scenario::named(&name).map_err(|error| error.to_string())?;
    let settings = simulated::settings(&scenario).map_err(|error| format!("{name}: {error}"))?;
    let (image, stored) = (image::build()?, image::stored(&settings)?);
    let limit_ticks = ((settings.time_limit_s + MARGIN_S) * TICKS_PER_S) as u64;
    let (line, decoder) = (RequestLine::default(), ReportDecoder::new());
    let surveyor = Surveyor { line, decoder, fix: None, vitals: None, failed: false, limit_ticks };
    println!("{name}, seed {seed}, the image that is flashed on an emulated STM32F4");
    let began = Instant::now();
    let world = World::new(&scenario, seed);
    let ran =
        run(&Setup { settings: &stored, ..Setup::new(&image) }, &world, surveyor).map_err(|error| error.to_string())?;
    ran.complaints.iter().for_each(|complaint| println!("the emulator: {complaint}"));
    let (chip_s, took_s) = (world.truth().t_s, began.elapsed().as_secs_f64());
    let a_tick = ran.instructions as f64 / (chip_s * TICKS_PER_S);
    println!(
        "{chip_s:.1} s of the chip in {took_s:.1} s; {a_tick:.0} instructions a tick, waiting for the sensors' buses included"
    );
    let Some(fix) = ran.line.fix else {
        println!("no azimuth");
        return Ok(false);
    };
    let true_deg = world.truth().azimuth_deg;
    let error_deg = (fix.azimuth_deg - true_deg + 180.0).rem_euclid(360.0) - 180.0;
    println!("azimuth {:9.4}° ± {:.4}°", fix.azimuth_deg, fix.sigma_deg);
    println!("true    {true_deg:9.4}°");
    println!("error   {error_deg:+9.4}° ({:.1} sigma)", error_deg.abs() / fix.sigma_deg);
    if let Some((stack_bytes, load_permille)) = ran.line.vitals {
        println!("stack, bytes: {stack_bytes}\nlongest tick, thousandths: {load_permille}");
    }
    Ok(true)
}
