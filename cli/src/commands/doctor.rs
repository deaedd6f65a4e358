//! `north doctor`: everything of a board checked in one go, in sentences.

use std::io::Write;

use clap::Args;
use north_finder::earth::earth_rate;
use north_finder::event::{Event, Report, Second};
use north_finder::health::{self, Counters, Item, Refusal, TestVerdict};
use north_finder::link::Ask;
use north_finder::settings::Settings;
use schemars::JsonSchema;
use serde::Serialize;

use crate::failure::Failure;
use crate::output::JsonOption;
use crate::port::{Port, PortError, PortOption, SILENCE};
use crate::present;

/// Least seconds that say something of the gyro's noise.
const LEAST_SECONDS: usize = 5;
/// Noise that differs from what is declared by more than this factor is worth a look.
const NOISE_FACTOR: f64 = 2.0;
/// Seconds after the self-test's move that are not listened to.
const SETTLING_SECONDS: usize = 2;
/// A load of so many thousandths of a tick is too near to one.
const HIGH_LOAD: u32 = 900;

/// Check everything of a board: its self-test, link, settings, gyro, encoder, accelerometers, counters, load
///
/// Asks for the self-test, which turns the index by 5° and back, and listens for some seconds; the instrument should stand still, and
/// no fix run.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north doctor --port /dev/ttyUSB0")]
pub struct Doctor {
    #[command(flatten)]
    port: PortOption,
    /// Seconds to listen
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(5..=600))]
    seconds: u32,
    /// Do not ask for the self-test: nothing moves
    #[arg(long)]
    still: bool,
    #[command(flatten)]
    json: JsonOption,
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

/// What was heard of the board.
#[derive(Clone, Debug, Default)]
struct Heard {
    seconds: Vec<Second>,
    first: Option<Counters>,
    last: Option<Counters>,
    load_permille: Option<u32>,
    stack_bytes: Option<u32>,
}

impl Heard {
    fn hear(&mut self, report: &Report) {
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
        let mut port = self.port.open()?;
        let identity = port.identity()?;
        let mut findings = vec![finding(
            "link",
            Verdict::Good,
            format!(
                "{} answers: {}, firmware {}, build {:08x}.",
                port.name(),
                identity.board.name(),
                identity.version.as_str(),
                identity.program
            ),
        )];
        let mut unreadable = false;
        let settings = match port.settings() {
            Ok(settings) => settings,
            Err(PortError::Refused { refusal, .. }) => {
                unreadable = true;
                findings.push(finding(
                    "settings",
                    Verdict::Bad,
                    format!("{}: {}.", sentence(refusal.meaning()), refusal.remedy()),
                ));
                None
            }
            Err(error) => return Err(error.into()),
        };
        let tested = !self.still && self_test(&mut port, &mut findings)?;
        let heard = self.listen(&mut port, if tested { SETTLING_SECONDS } else { 0 })?;
        match &settings {
            Some(settings) => of_settings(settings, &mut findings),
            None if !unreadable => findings.push(finding(
                "settings",
                Verdict::Bad,
                "No settings are stored: load them, with the latitude of the site.",
            )),
            None => {}
        }
        of_seconds(&heard.seconds, &settings.unwrap_or_default(), &mut findings);
        of_counters(&heard, &mut findings);
        of_line(&port, &heard, &mut findings);

        let out = &mut self.json.human();
        for Finding { what, verdict, sentence } in &findings {
            let mark = match verdict {
                Verdict::Good => "good",
                Verdict::Look => "look",
                Verdict::Bad => "BAD ",
            };
            writeln!(out, "{mark}  {what:<14} {sentence}")?;
        }
        self.json.write(&findings)?;
        match findings.iter().filter(|finding| finding.verdict == Verdict::Bad).count() {
            0 => Ok(()),
            count => Err(Failure::Refused(format!("{count} of {} checks are bad", findings.len()))),
        }
    }

    /// Hears what the board tells, but for the first seconds.
    fn listen(&self, port: &mut Port, settling: usize) -> Result<Heard, PortError> {
        let mut heard = Heard::default();
        port.ask(Ask::Status, &mut |report| heard.hear(report))?;
        let silent = |heard: &Heard, error| if heard.first.is_some() { Ok(()) } else { Err(error) };
        while heard.seconds.len() < self.seconds as usize + settling {
            match port.report(SILENCE) {
                Ok(report) => heard.hear(&report),
                // A board without a gyro answers, and tells no second.
                Err(error @ PortError::Silent { .. }) => {
                    silent(&heard, error)?;
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        port.ask(Ask::Status, &mut |report| heard.hear(report))?;
        heard.seconds.drain(..settling.min(heard.seconds.len()));
        Ok(heard)
    }
}

/// Asks for the self-test and waits for its last item; gives whether it was done.
fn self_test(port: &mut Port, findings: &mut Vec<Finding>) -> Result<bool, PortError> {
    match port.ask(Ask::SelfTest, &mut |_| ()) {
        Ok(()) => {}
        Err(PortError::Refused { refusal: refusal @ Refusal::Busy, .. }) => {
            let text = format!("{}: {}.", sentence(refusal.meaning()), refusal.remedy());
            findings.push(finding("self-test", Verdict::Look, text));
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
        TestVerdict::Passed | TestVerdict::Absent => Verdict::Good,
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

fn of_settings(settings: &Settings, findings: &mut Vec<Finding>) {
    let violations: Vec<String> = settings.violations().map(|invalid| invalid.to_string()).collect();
    findings.push(match violations.as_slice() {
        [] => finding("settings", Verdict::Good, "They are stored, and their values are allowed."),
        some => finding("settings", Verdict::Bad, format!("They make no sense: {}.", some.join("; "))),
    });
    let latitude_deg = settings.latitude_deg;
    findings.push(match (earth_rate(latitude_deg), latitude_deg == 0.0) {
        (Err(_), _) => {
            finding("latitude", Verdict::Bad, format!("It is {latitude_deg}°: within 1° of a pole there is no fix."))
        }
        (Ok(_), true) => {
            finding("latitude", Verdict::Look, "It is 0°, as nobody may have set it: north settings set latitude_deg=…")
        }
        (Ok(earth), false) => finding(
            "latitude",
            Verdict::Good,
            format!("It is {latitude_deg}°: the horizontal Earth rate there is {:.4} °/h.", earth.north_deg_h),
        ),
    });
    findings.push(match settings.model {
        Some(_) => finding("error model", Verdict::Good, "One from a calibration is stored."),
        None => finding("error model", Verdict::Look, "None is stored: every azimuth carries the flag uncalibrated."),
    });
    if settings.accelerometer.is_none() {
        let text = "No calibration is stored: north calibrate field makes one.";
        findings.push(finding("accelerometers", Verdict::Look, text));
    }
}

fn of_seconds(seconds: &[Second], settings: &Settings, findings: &mut Vec<Finding>) {
    let Some(last) = seconds.last().filter(|_| seconds.len() >= LEAST_SECONDS) else {
        let text = "Not a second came from it: check its supply, its cable, its baud rate and the frame format in the settings.";
        findings.push(finding("gyro", Verdict::Bad, text));
        return;
    };
    let lost: u32 = seconds.iter().map(|second| u32::from(second.lost_frames)).sum();
    let frames = 400 * seconds.len();
    findings.push(match lost {
        0 => finding("gyro frames", Verdict::Good, format!("All {frames} came.")),
        _ => finding("gyro frames", Verdict::Bad, format!("{lost} of {frames} were lost: check the gyro's cable.")),
    });

    // Differences of neighbours: a drift and the Earth's rate are not in them.
    let differences = seconds.windows(2).map(|pair| (pair[1].fog_arcsec - pair[0].fog_arcsec).powi(2));
    let noise = (differences.sum::<f64>() / (2 * (seconds.len() - 1)) as f64).sqrt();
    let declared = settings.gyro.noise_deg_h();
    let text = format!("{noise:.4} °/h from second to second; {declared:.4} °/h is declared");
    findings.push(match noise {
        noise if noise > NOISE_FACTOR * declared => finding(
            "gyro noise",
            Verdict::Look,
            format!("{text}: if the base is still, north characterise says what to declare."),
        ),
        noise if noise * NOISE_FACTOR < declared => {
            finding("gyro noise", Verdict::Look, format!("{text}: sigmas are wider than they need be."))
        }
        _ => finding("gyro noise", Verdict::Good, format!("{text}.")),
    });

    let rate = seconds.iter().map(|second| second.rate_deg_h).sum::<f64>() / seconds.len() as f64;
    if let Ok(earth) = earth_rate(settings.latitude_deg) {
        let limit = earth.north_deg_h + settings.gyro.bias_limit_deg_h + declared;
        findings.push(match rate.abs() > limit {
            true => finding("base", Verdict::Look, format!("The rate is {rate:+.3} °/h, and a still gyro reads {limit:.3} at most: it moves, or the bias is beyond its limit.")),
            false => finding("base", Verdict::Good, format!("The rate is {rate:+.3} °/h: not more than the Earth's and the bias allow.")),
        });
    }
    findings.push(match last.level {
        None => finding("level", Verdict::Bad, "The accelerometer gives no reading: check its cable and supply."),
        Some(level) => {
            let tilt = level.mean.tilt();
            let limit_deg = settings.level.limit_deg;
            let text = format!("Pitch {:+.3}°, roll {:+.3}°", tilt.pitch_deg, tilt.roll_deg);
            match tilt.is_level(limit_deg) {
                true => finding("level", Verdict::Good, format!("{text}: inside ± {limit_deg}°.")),
                false => finding("level", Verdict::Look, format!("{text}: level it to ± {limit_deg}° before a fix.")),
            }
        }
    });
    findings.push(match last.index_deg {
        Some(index_deg) => finding("encoder", Verdict::Good, format!("It shows {index_deg:.3}°.")),
        None => finding("encoder", Verdict::Bad, "It gives no reading: check its cable, supply and magnet."),
    });
    let temperatures = || seconds.iter().filter_map(|second| second.temp_c);
    findings.push(match (temperatures().reduce(f64::min), temperatures().reduce(f64::max)) {
        (Some(low), Some(high)) => finding("temperature", Verdict::Good, format!("{low:.2} to {high:.2} °C.")),
        _ => finding("temperature", Verdict::Look, "The gyro sends none: effects of temperature stay unseen."),
    });
}

fn of_counters(heard: &Heard, findings: &mut Vec<Finding>) {
    let (Some(first), Some(last)) = (heard.first, heard.last) else { return };
    let named = |counters: &Counters| match serde_json::to_value(counters) {
        Ok(serde_json::Value::Object(fields)) => fields,
        _ => serde_json::Map::new(),
    };
    let before = named(&first);
    let (mut rising, mut old) = (Vec::new(), Vec::new());
    for (name, value) in named(&last) {
        let count = value.as_u64().unwrap_or_default();
        let rose = count - before.get(&name).and_then(serde_json::Value::as_u64).unwrap_or_default().min(count);
        match (name.as_str(), count, rose) {
            ("frames_good", ..) | (_, 0, _) => {}
            (_, _, 0) => old.push(format!("{name} {count}")),
            _ => rising.push(format!("{name} {count}, {rose} of them now")),
        }
    }
    findings.push(match (rising.as_slice(), old.as_slice()) {
        ([], []) => finding("counters", Verdict::Good, "Nothing was discarded or repaired since the start."),
        ([], old) => {
            finding("counters", Verdict::Look, format!("Since the start: {}; nothing of it now.", old.join(", ")))
        }
        (rising, _) => finding("counters", Verdict::Bad, format!("Going on: {}.", rising.join("; "))),
    });
}

fn of_line(port: &Port, heard: &Heard, findings: &mut Vec<Finding>) {
    findings.push(match port.bad_frames() {
        // The line is joined in the middle of a frame.
        0 | 1 => finding("host line", Verdict::Good, "No frame came damaged."),
        count => {
            finding("host line", Verdict::Look, format!("{count} frames came damaged: check the cable and its ground."))
        }
    });
    if let (Some(load), Some(stack)) = (heard.load_permille, heard.stack_bytes) {
        let verdict = if load > HIGH_LOAD { Verdict::Look } else { Verdict::Good };
        let text =
            format!("The work of a tick took {:.1} % of it at most, the stack {stack} bytes.", f64::from(load) / 10.0);
        findings.push(finding("processor", verdict, text));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn second(rate_deg_h: f64) -> Second {
        Second {
            t_s: 1.0,
            index_deg: Some(0.0),
            fog_arcsec: rate_deg_h,
            moment_arcsec_s: 0.0,
            rate_deg_h,
            temp_c: Some(20.0),
            block_temp_c: None,
            level: None,
            lost_frames: 0,
            dwell: None,
            collected: false,
            waited_at: None,
        }
    }

    fn verdict(findings: &[Finding], what: &str) -> Verdict {
        findings.iter().find(|finding| finding.what == what).unwrap().verdict
    }

    #[test]
    fn noise_by_hand() {
        // 9 ± 0.09 in turn: differences of 0.18, 0.18/√2 = 0.127 °/h; declared are 60 · 0.0015 = 0.09.
        let settings = Settings { latitude_deg: 34.75, ..Settings::default() };
        let seconds: Vec<Second> = (0..10).map(|n| second(if n % 2 == 0 { 9.09 } else { 8.91 })).collect();
        let mut findings = Vec::new();
        of_seconds(&seconds, &settings, &mut findings);
        assert!(findings[1].sentence.starts_with("0.1273 °/h"), "{}", findings[1].sentence);
        assert_eq!((verdict(&findings, "gyro noise"), verdict(&findings, "base")), (Verdict::Good, Verdict::Good));
        assert_eq!((verdict(&findings, "level"), verdict(&findings, "encoder")), (Verdict::Bad, Verdict::Good));
    }

    #[test]
    fn what_rises_is_bad_and_what_once_was_is_worth_a_look() {
        let once = Counters { frames_good: 7, encoder_errors: 3, ..Counters::default() };
        let mut findings = Vec::new();
        let heard = Heard { first: Some(once), last: Some(Counters { frames_good: 9, ..once }), ..Heard::default() };
        of_counters(&heard, &mut findings);
        let more = Counters { encoder_errors: 5, ..once };
        of_counters(&Heard { last: Some(more), ..heard }, &mut findings);
        assert_eq!([findings[0].verdict, findings[1].verdict], [Verdict::Look, Verdict::Bad]);
        assert_eq!(findings[1].sentence, "Going on: encoder_errors 5, 2 of them now.");
    }
}
