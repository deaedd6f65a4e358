//! The last check: a fix. What makes it refuse, or doubt its azimuth, no look at the parts alone can find.

use north_finder::event::{Event, Fix, Report, State};
use north_finder::health::{Fault, Flag};
use north_finder::sequence::Command;
use north_finder::settings::Settings;

use super::{Finding, Verdict, finding, sentence};
use crate::port::{Port, PortError, SILENCE};

/// A fix that has not ended so long after its time limits does not end, s.
const SPARE_S: f64 = 60.0;

/// Tries a fix; gives what came of it, and a finding for each of its flags.
///
/// Errors: the line breaks; an interrupt.
pub(super) fn fix(port: &mut Port, settings: &Settings) -> Result<Vec<Finding>, PortError> {
    let mut early = Vec::new();
    let started = port.command(Command::Start, &mut |report| early.push(*report));
    let mut watch = Watch::new(settings);
    for report in &early {
        if let Some(findings) = watch.see(report) {
            return Ok(findings);
        }
    }
    match started {
        Ok(()) => {}
        Err(PortError::Refused { refusal, .. }) => {
            return Ok(bad(format!("{}: {}.", sentence(refusal.meaning()), refusal.remedy())));
        }
        Err(error) => return Err(error),
    }
    loop {
        match port.report(SILENCE) {
            Ok(report) => {
                if let Some(findings) = watch.see(&report) {
                    return Ok(findings);
                }
            }
            Err(PortError::Silent { .. }) => {
                return Ok(bad("The board fell silent during it: look at its supply and at the cable.".into()));
            }
            Err(error) => return Err(error),
        }
    }
}

fn bad(sentence: String) -> Vec<Finding> {
    vec![finding("fix", Verdict::Bad, sentence)]
}

/// A fix as its reports come.
struct Watch {
    began_s: Option<f64>,
    last_s: f64,
    limit_s: f64,
    state: State,
}

impl Watch {
    fn new(settings: &Settings) -> Self {
        let limit_s = settings.time_limit_s + settings.level.timeout_s + SPARE_S;
        Self { began_s: None, last_s: 0.0, limit_s, state: State::Idle }
    }

    /// The findings, with the report that ends it.
    fn see(&mut self, report: &Report) -> Option<Vec<Finding>> {
        let began_s = *self.began_s.get_or_insert(report.t_s);
        let restarted = report.t_s < self.last_s - 1.0;
        self.last_s = report.t_s;
        match report.event {
            Event::Fix(fix) => Some(of_fix(&fix, report.t_s - began_s)),
            Event::Fault { fault, state } => Some(of_fault(fault, state)),
            Event::Crash(_) => Some(bad("The firmware crashed during it and started anew: report it.".into())),
            _ if restarted => Some(bad(
                "The board started anew during it: look at its supply, and at the self-test's item reset.".into(),
            )),
            _ if report.t_s - began_s > self.limit_s => {
                Some(bad(format!("It did not end within {:.0} s, while {}.", self.limit_s, self.state.name())))
            }
            Event::State(state) => {
                self.state = state;
                None
            }
            _ => None,
        }
    }
}

fn of_fault(fault: Fault, state: State) -> Vec<Finding> {
    bad(format!("{} ({}, while {}). To do: {}.", sentence(fault.meaning()), fault.name(), state.name(), fault.remedy()))
}

fn of_fix(fix: &Fix, seconds: f64) -> Vec<Finding> {
    let text = format!("Azimuth {:.3}° ± {:.3}° after {seconds:.0} s.", fix.azimuth_deg, fix.sigma_deg);
    let said_already = [Flag::Uncalibrated, Flag::LevelUncalibrated];
    let flags = fix.flags.iter().filter(|flag| !said_already.contains(flag));
    let flags = flags.map(|flag| {
        let text = format!("{} ({}). To do: {}.", sentence(flag.meaning()), flag.name(), flag.remedy());
        finding("flag", weight(flag), text)
    });
    [finding("fix", Verdict::Good, text)].into_iter().chain(flags).collect()
}

/// Bad is what says that a part of the instrument is at fault; the others may be the site's.
fn weight(flag: Flag) -> Verdict {
    match flag {
        Flag::Bias | Flag::IndexSlip => Verdict::Bad,
        _ => Verdict::Look,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch() -> Watch {
        Watch::new(&Settings::default())
    }

    fn only(findings: Option<Vec<Finding>>) -> Finding {
        let [finding] = <[Finding; 1]>::try_from(findings.unwrap()).unwrap();
        finding
    }

    #[test]
    fn a_fault_ends_it_with_what_to_do() {
        let mut watch = watch();
        assert!(watch.see(&Report { t_s: 20.0, event: Event::State(State::Watching) }).is_none());
        let event = Event::Fault { fault: Fault::GyroStuck, state: State::Watching };
        let found = only(watch.see(&Report { t_s: 30.0, event }));
        assert!(found.verdict == Verdict::Bad && found.sentence.starts_with("The gyro repeats the same increment"));
        assert!(found.sentence.contains("(gyro-stuck, while watching). To do: switch the gyro off"), "{found:?}");
    }

    #[test]
    fn a_board_that_starts_anew_or_does_not_end_is_bad() {
        let at = |t_s| Report { t_s, event: Event::State(State::Watching) };
        let mut restarting = watch();
        assert!(restarting.see(&at(20.0)).is_none());
        assert!(only(restarting.see(&at(0.5))).sentence.contains("started anew"));
        let mut endless = watch();
        assert!(endless.see(&at(20.0)).is_none() && endless.see(&at(21.0 + endless.limit_s - 2.0)).is_none());
        assert!(only(endless.see(&at(20.5 + endless.limit_s))).sentence.contains("while watching"));
    }
}
