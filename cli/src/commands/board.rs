//! `north board`: the instrument behind a pseudo-terminal, as if a board were plugged in.

use std::io::{self, Read, Write};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Args;
use hal_sim::{Operator, World};
use north_finder::event::{Event, Report};
use north_finder::link::nmea::Speaker;
use north_finder::link::{Ask, Request, RequestDecoder, encode_report};
use north_finder::sensing::sample::SAMPLE_S;
use north_finder::sequence::Command;
use serialport::{SerialPort, TTYPort};

use super::instrument::InstrumentOptions;
use crate::engine::{self, Engine, Person, Setup};
use crate::failure::Failure;
use crate::field::follow;
use crate::interrupt;
use crate::port::Port;

/// Ticks between two looks at the line and the clock: 10 ms.
const LOOK_TICKS: u64 = 4;
/// How long the instrument, whose time is not the wall's, waits for a client that has asked for something and does not read.
const PATIENCE: Duration = Duration::from_secs(2);

/// Serve the simulated instrument behind a pseudo-terminal until interrupted
#[derive(Args, Debug)]
#[command(after_help = "Example, in two terminals:
  north board --scenario calm-bench
  north monitor /dev/pts/5 --start

The first line on stdout is the port's path. A calibration of the accelerometers is done by the scenario's operator, who
turns the instrument as it is told.")]
pub struct Board {
    #[command(flatten)]
    instrument: InstrumentOptions,
    /// What runs the firmware
    #[arg(long, value_enum, default_value = "qemu")]
    engine: Engine,
    /// Times real time, 0.1 to 1000
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// The port speaks NMEA 0183: a fix starts by itself, THS, HDT and PNOFF come each second
    #[arg(long)]
    nmea: bool,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.1..=1000.0).contains(&value) => Ok(value),
        _ => Err("allowed is a number from 0.1 to 1000".into()),
    }
}

impl Board {
    pub fn run(self) -> Result<(), Failure> {
        let (scenario, settings) = self.instrument.resolve()?;
        let setup = Setup { scenario, seed: self.instrument.seed, settings: Some(settings) };
        let (line, other_end) = pair()?;
        println!("{}", other_end.name().unwrap_or_default());
        io::stdout().flush()?;
        // Who opens the port locks it: it is left to the clients.
        drop(other_end);
        let speech = if self.nmea { Speech::Nmea(Speaker::simulator()) } else { Speech::Link(Box::default()) };
        let bridge = Bridge::new(&setup, line, speech, self.speed)?;
        bridge.serve(self.engine, interrupt::flag())?;
        Err(Failure::Interrupted)
    }
}

/// A pseudo-terminal: the instrument's end and the clients'.
///
/// Errors: none is to be had.
fn pair() -> Result<(TTYPort, TTYPort), Failure> {
    TTYPort::pair().map_err(refused)
}

fn refused(error: serialport::Error) -> Failure {
    Failure::Refused(format!("no pseudo-terminal is to be had: {error}"))
}

/// The instrument's end of a pseudo-terminal, and a port that is open at the other.
///
/// Errors: none is to be had.
pub fn connected() -> Result<(TTYPort, Port), Failure> {
    let (line, other_end) = pair()?;
    Ok((line, Port::over("the simulated board", Box::new(other_end))?))
}

/// Serves an instrument in this process behind one end of a pseudo-terminal until `stop`, at so many times real time.
///
/// Errors: the scenario makes no world.
pub fn serve(setup: &Setup, line: TTYPort, speed: f64, stop: &AtomicBool) -> Result<(), Failure> {
    Bridge::new(setup, line, Speech::Link(Box::default()), speed)?.serve(Engine::Host, stop)
}

/// What goes over the line.
enum Speech {
    Link(Box<RequestDecoder>),
    Nmea(Speaker),
}

/// Between the instrument and the line.
struct Bridge {
    operator: Operator,
    world: World,
    line: TTYPort,
    speech: Speech,
    speed: f64,
    began: Instant,
    /// Somebody has sent something since the line was last full for longer than they are waited for.
    asked: bool,
}

impl Person for Bridge {
    fn request(&mut self, tick: u64) -> Option<Request> {
        if tick.is_multiple_of(LOOK_TICKS) {
            let due = Duration::from_secs_f64(tick as f64 * SAMPLE_S / self.speed);
            std::thread::sleep(due.saturating_sub(self.began.elapsed()));
        }
        let Speech::Link(decoder) = &mut self.speech else {
            return (tick == 0).then(|| Ask::Command(Command::Start).into());
        };
        let (mut byte, mut unreadable) = ([0], None);
        while let Ok(1) = self.line.read(&mut byte) {
            self.asked = true;
            match decoder.feed(byte[0]) {
                None => {}
                Some(Ok(request)) => return Some(request),
                Some(Err(bad)) => {
                    unreadable = Some(bad);
                    break;
                }
            }
        }
        // As the board does: its answer has the number of no request.
        if let Some(bad) = unreadable {
            let event = Event::Answer { number: 0, refusal: Some(bad.into()) };
            if let Ok(frame) = encode_report(&Report { t_s: tick as f64 * SAMPLE_S, event }) {
                self.say(&frame);
            }
        }
        None
    }

    fn hear(&mut self, report: &Report) -> bool {
        if let Event::Guidance(guidance) = report.event {
            follow(&mut self.operator, &self.world, &guidance);
        }
        match &mut self.speech {
            Speech::Link(_) => {
                if let Ok(frame) = encode_report(report) {
                    self.say(&frame);
                }
            }
            Speech::Nmea(speaker) => {
                let mut said = Vec::new();
                speaker.hear(report, &mut |sentence| said.extend(sentence.bytes()));
                self.say(&said);
            }
        }
        false
    }
}

impl Bridge {
    fn new(setup: &Setup, mut line: TTYPort, speech: Speech, speed: f64) -> Result<Self, Failure> {
        line.set_timeout(Duration::ZERO).map_err(refused)?;
        Ok(Self {
            operator: Operator::new(&setup.scenario, setup.seed),
            world: engine::world(setup)?,
            line,
            speech,
            speed,
            began: Instant::now(),
            asked: false,
        })
    }

    fn serve(mut self, engine: Engine, stop: &AtomicBool) -> Result<(), Failure> {
        let world = self.world.clone();
        engine::serve(engine, None, &world, u64::MAX, &mut self, stop)?;
        Ok(())
    }

    /// As on a wire, what nobody reads is lost. Whoever asked for something loses nothing, however many times real time the instrument runs
    /// and however slow the machine is: the instrument waits for them.
    fn say(&mut self, mut bytes: &[u8]) {
        let began = Instant::now();
        while !bytes.is_empty() {
            match self.line.write(bytes) {
                Ok(taken) => bytes = &bytes[taken..],
                Err(_) if self.asked && began.elapsed() < PATIENCE && !interrupt::requested() => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(_) => {
                    self.asked = false;
                    return;
                }
            }
        }
    }
}
