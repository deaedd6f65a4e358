//! `north doctor`: everything of a board checked in one go, in sentences; last of all a fix is tried.

mod attempt;
mod checks;

use std::io::Write;

use clap::Args;
use north_finder::event::identity::Identity;
use north_finder::event::raw;
use north_finder::event::{Event, Report, Second};
use north_finder::health::{self, Counters, Item, Refusal, TestVerdict};
use north_finder::link::Ask;
use north_finder::settings::Settings;
use quantities::codes::TriadCode;
use schemars::JsonSchema;
use serde::Serialize;

use crate::failure::Failure;
use crate::output::JsonOption;
use crate::port::{Port, PortError, PortOption, SILENCE};
use crate::present;

use self::checks::{of_counters, of_line, of_seconds, of_settings};

/// Seconds that are listened to, where nothing else is said.
const LISTENING_S: u32 = 12;
/// Seconds after the self-test's move that are not listened to.
const SETTLING_SECONDS: usize = 2;
/// Blocks of the raw stream that are waited for them: some seconds of it.
const MOST_BLOCKS: usize = 200;
/// What a finding is about that says that a fix or a calibration is under way.
const BUSY: &str = "under way";
/// Readings of the accelerometers that tell which way is up: a quarter of a second of them.
const UP_READINGS: usize = 25;

/// Check everything of a board: its self-test, link, settings, gyro, encoder, accelerometers, counters, load, and a fix
///
/// Asks for the self-test, which turns the index by 5° and back, listens for some seconds, and where nothing is bad tries a fix: what makes a fix
/// refuse, or raises a flag, is reported with what to do. That takes some minutes; --no-fix leaves it out. The instrument should stand still and level,
/// and no fix run. Exit code 1 where something is bad.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north doctor --port /dev/ttyUSB0\n  north doctor --no-fix")]
pub struct Doctor {
    #[command(flatten)]
    port: PortOption,
    #[command(flatten)]
    examination: Examination,
    #[command(flatten)]
    json: JsonOption,
}

/// What is looked at.
#[derive(Args, Debug)]
pub struct Examination {
    /// Seconds to listen
    #[arg(long, value_name = "N", default_value_t = LISTENING_S, value_parser = clap::value_parser!(u32).range(5..=600))]
    seconds: u32,
    /// Ask for no self-test and try no fix: nothing moves
    #[arg(long)]
    still: bool,
    /// Try no fix
    #[arg(long)]
    no_fix: bool,
}

impl Default for Examination {
    fn default() -> Self {
        Self { seconds: LISTENING_S, still: false, no_fix: false }
    }
}

/// How something is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    Good,
    /// It works; somebody should look at it.
    Look,
    /// No fix can be trusted, or none be made.
    Bad,
    /// The board has no test of it: neither good nor bad.
    Untested,
}

/// A sentence on one thing.
#[derive(Clone, Debug, JsonSchema, Serialize)]
pub struct Finding {
    pub what: &'static str,
    pub verdict: Verdict,
    pub sentence: String,
}

fn finding(what: &'static str, verdict: Verdict, sentence: impl Into<String>) -> Finding {
    Finding { what, verdict, sentence: sentence.into() }
}

/// What was received of the board.
#[derive(Clone, Debug, Default)]
struct Received {
    seconds: Vec<Second>,
    first: Option<Counters>,
    last: Option<Counters>,
    load_permille: Option<u32>,
    stack_bytes: Option<u32>,
    /// Unit vector that points up, of the axes forward, left, up; looked for where the firmware has no level.
    up: Option<[f64; 3]>,
}

impl Received {
    fn receive(&mut self, report: &Report) {
        match report.event {
            Event::Second(second) => self.seconds.push(second),
            Event::Health(counters) => {
                self.first.get_or_insert(counters);
                self.last = Some(counters);
            }
            Event::Vitals { load_permille, stack_bytes, .. } => {
                (self.load_permille, self.stack_bytes) = (Some(load_permille), Some(stack_bytes));
            }
            _ => {}
        }
    }
}

impl Doctor {
    pub fn run(self) -> Result<(), Failure> {
        crate::output::check([self.json.path()])?;
        let mut port = self.port.open()?;
        let findings = self.examination.examine(&mut port, &mut self.json.human(), &mut std::io::stderr())?;
        self.json.write(&findings)?;
        match findings.iter().filter(|finding| finding.verdict == Verdict::Bad).count() {
            0 => Ok(()),
            count => Err(Failure::Refused(format!("{count} of {} checks are bad", findings.len()))),
        }
    }
}

impl Examination {
    /// Everything of the board on a port, in sentences to `out` as they come; `notes` says what takes long.
    pub fn examine(
        &self,
        port: &mut Port,
        out: &mut dyn Write,
        notes: &mut dyn Write,
    ) -> Result<Vec<Finding>, Failure> {
        let (mut findings, settings) = self.look(port)?;
        write_findings(out, &findings)?;
        let of_fix = if self.tries_fix(&findings) {
            let limit_s = settings.time_limit_s;
            writeln!(notes, "north: note: a fix is tried, which takes up to {limit_s:.0} s; --no-fix leaves it out")?;
            attempt::fix(port, &settings)?
        } else if self.wants_fix() {
            let text = "None was tried: mend what is bad first, or wait for what is under way.";
            vec![finding("fix", Verdict::Look, text)]
        } else {
            Vec::new()
        };
        write_findings(out, &of_fix)?;
        findings.extend(of_fix);
        Ok(findings)
    }

    fn wants_fix(&self) -> bool {
        !self.still && !self.no_fix
    }

    /// Where something is bad a fix says nothing new.
    fn tries_fix(&self, findings: &[Finding]) -> bool {
        self.wants_fix() && !findings.iter().any(|finding| finding.verdict == Verdict::Bad || finding.what == BUSY)
    }

    /// Everything but the fix, with the settings that are in effect.
    fn look(&self, port: &mut Port) -> Result<(Vec<Finding>, Settings), Failure> {
        let identity = port.identity()?;
        let mut findings = vec![finding(
            "link",
            Verdict::Good,
            format!(
                "{} answers: {}, firmware {}, build {:08x}{}.",
                port.name(),
                identity.board.name(),
                identity.version.as_str(),
                identity.program,
                of_chip(&identity)
            ),
        )];
        let settings = match port.settings() {
            Ok(Some(settings)) => Some(settings),
            Ok(None) => {
                let text = "No settings are stored: load them, with the latitude of the site.";
                findings.push(finding("settings", Verdict::Bad, text));
                None
            }
            Err(PortError::Refused { refusal, .. }) => {
                let text = format!("{}: {}.", sentence(refusal.meaning()), refusal.remedy());
                findings.push(finding("settings", Verdict::Bad, text));
                None
            }
            Err(error) => return Err(error.into()),
        };
        let tested = !self.still && self_test(port, &mut findings)?;
        let received = self.listen(port, if tested { SETTLING_SECONDS } else { 0 })?;
        if let Some(settings) = &settings {
            of_settings(settings, &mut findings);
        }
        let settings = settings.unwrap_or_default();
        let worst = if self.wants_fix() && tested { Verdict::Look } else { Verdict::Bad };
        of_seconds(&received, &settings, worst, &mut findings);
        of_counters(&received, &mut findings);
        of_line(port, &received, &mut findings);
        Ok((findings, settings))
    }

    /// Hears what the board tells, but for the first seconds.
    fn listen(&self, port: &mut Port, settling: usize) -> Result<Received, PortError> {
        let mut received = Received::default();
        port.ask(Ask::Status, &mut |report| received.receive(report))?;
        let silent = |received: &Received, error| if received.first.is_some() { Ok(()) } else { Err(error) };
        while received.seconds.len() < self.seconds as usize + settling {
            match port.report(SILENCE) {
                Ok(report) => received.receive(&report),
                // A board without a gyro answers, and tells no second.
                Err(error @ PortError::Silent { .. }) => {
                    silent(&received, error)?;
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        port.ask(Ask::Status, &mut |report| received.receive(report))?;
        received.seconds.drain(..settling.min(received.seconds.len()));
        if received.seconds.last().is_some_and(|second| second.level.is_none()) {
            received.up = up(port)?;
        }
        Ok(received)
    }
}

fn write_findings(out: &mut dyn Write, findings: &[Finding]) -> std::io::Result<()> {
    for Finding { what, verdict, sentence } in findings {
        let mark = match verdict {
            Verdict::Good => "good",
            Verdict::Look => "look",
            Verdict::Bad => "BAD ",
            Verdict::Untested => "n/a ",
        };
        writeln!(out, "{mark}  {what:<14} {sentence}")?;
    }
    out.flush()
}

/// The accelerometers' own readings, whichever way the instrument lies: up in its axes. `None` where they give none, or no gravity.
fn up(port: &mut Port) -> Result<Option<[f64; 3]>, PortError> {
    let (mut sum, mut count, mut blocks) = ([0.0; 3], 0, 0);
    port.ask(Ask::Stream(true), &mut |_| ())?;
    while count < UP_READINGS && blocks < MOST_BLOCKS {
        let Event::Raw(block) = port.report(SILENCE)?.event else { continue };
        blocks += 1;
        for item in block.items() {
            if let raw::Item::Acceleration(TriadCode(codes)) = item {
                count += 1;
                sum.iter_mut().zip(codes).for_each(|(sum, code)| *sum += f64::from(code) / TriadCode::COUNTS_PER_G);
            }
        }
    }
    port.ask(Ask::Stream(false), &mut |_| ())?;
    let norm = sum.iter().map(|sum| sum * sum).sum::<f64>().sqrt();
    let is_gravity = count > 0 && (0.9..=1.1).contains(&(norm / count as f64));
    Ok(is_gravity.then(|| sum.map(|sum| sum / norm)))
}

/// Which sources the firmware is of, and on which chip it runs; nothing of the instrument in a host's process.
fn of_chip(identity: &Identity) -> String {
    let [high, middle, low] = identity.serial;
    if identity.serial == [0; 3] {
        return String::new();
    }
    format!(", revision {}, chip {high:08x}{middle:08x}{low:08x}", identity.revision.as_str())
}

/// Asks for the self-test and waits for its last item; gives whether it was done.
fn self_test(port: &mut Port, findings: &mut Vec<Finding>) -> Result<bool, PortError> {
    match port.ask(Ask::SelfTest, &mut |_| ()) {
        Ok(()) => {}
        Err(PortError::Refused { refusal: refusal @ Refusal::Busy, .. }) => {
            let text = format!("{}: {}.", sentence(refusal.meaning()), refusal.remedy());
            findings.push(finding(BUSY, Verdict::Look, text));
            return Ok(false);
        }
        Err(error) => return Err(error),
    }
    loop {
        let Event::SelfTest(found) = port.report(SILENCE)?.event else { continue };
        findings.push(of_item(&found));
        if Item::ALL.last() == Some(&found.item) {
            return Ok(true);
        }
    }
}

fn of_item(found: &health::Finding) -> Finding {
    let verdict = match found.verdict {
        TestVerdict::Passed => Verdict::Good,
        TestVerdict::Absent => Verdict::Untested,
        TestVerdict::Failed => Verdict::Bad,
        TestVerdict::NotAsked | TestVerdict::Unmet | TestVerdict::Interrupted => Verdict::Look,
    };
    finding("self-test", verdict, format!("{}.", sentence(&present::self_test::sentence(found))))
}

/// With a capital.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
