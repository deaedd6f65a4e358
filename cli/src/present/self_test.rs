//! What a self-test found, for people.

use north_finder::event::restart::Cause;
use north_finder::health::{Fault, Finding, Item, TestVerdict};

/// What the test found of an item, as a sentence without its full stop; what to do, where it failed.
pub fn sentence(finding: &Finding) -> String {
    let name = finding.item.name();
    if finding.verdict == TestVerdict::Absent {
        return match finding.item.is_of_board() {
            true => format!("{name} was not tested: this board has no such test"),
            false => format!("{name} was not tested: this board has no such part, or the settings name none"),
        };
    }
    if !finding.was_tested() {
        return format!("{name} was not tested: {}", finding.verdict.meaning());
    }
    let found = found(finding);
    match (finding.verdict, fault(finding)) {
        (TestVerdict::Failed, Some(fault)) => format!("{name} failed: {found}. To do: {}", fault.remedy()),
        (TestVerdict::Failed, None) => format!("{name} failed: {found}. To do: {}", finding.item.remedy()),
        _ => format!("{name} {}: {found}", finding.verdict.name()),
    }
}

/// The fault whose code the test of the settings gives.
fn fault(finding: &Finding) -> Option<Fault> {
    let of_settings = finding.item == Item::Settings;
    Fault::ALL.iter().copied().find(|fault| of_settings && f32::from(fault.code()) == finding.measured)
}

/// The cause whose code the test of the last reset gives.
fn cause(finding: &Finding) -> Option<Cause> {
    Cause::ALL.iter().copied().find(|cause| f32::from(cause.code()) == finding.measured)
}

/// What was measured, in words.
fn found(finding: &Finding) -> String {
    let Finding { item, measured, allowed: [least, most], .. } = *finding;
    let passed = finding.verdict != TestVerdict::Failed;
    let number = |value: f32| format!("{value:.2}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let value = number(measured);
    let range = match least == most {
        true => format!("{} is allowed", number(least)),
        false => format!("{} to {} are allowed", number(least), number(most)),
    };
    match item {
        Item::Settings => match fault(finding) {
            Some(fault) => fault.meaning().to_owned(),
            None if passed => "the settings in flash are valid".to_owned(),
            None => format!("the settings in flash have an unknown fault, code {value}"),
        },
        Item::Memory if passed => "every word of the unused memory holds what is written to it".to_owned(),
        Item::Memory => format!("{value} words of the unused memory do not hold what is written to them"),
        Item::Reset if passed => "the run before did not end in a crash".to_owned(),
        Item::Reset => match cause(finding) {
            Some(cause) => format!("the run before ended in a crash: {}", cause.name()),
            None => format!("the run before ended in a crash of an unknown kind, code {value}"),
        },
        Item::Clock if passed => "the clock runs from the crystal".to_owned(),
        Item::Clock => "the clock runs from the internal oscillator, which is good to 1 % only".to_owned(),
        Item::Gyro => format!("the gyro vouches for {value} % of its frames; {range}"),
        Item::GyroRate => format!("the gyro sends {value} frames a second; {range}"),
        Item::Accelerometer => {
            format!("{value} % of the accelerometer's readings are valid and differ from the one before; {range}")
        }
        Item::Encoder => format!("{value} % of the encoder's readings are valid; {range}"),
        Item::Block => format!("{value} % of the readings of the block of three gyros are valid; {range}"),
        Item::Response => format!("the accelerometer's own test force moves its reading by {value} g; {range}"),
        Item::Drive => format!("a move of 5° ended {value}° off its target by the encoder; {range}"),
        Item::Limit if passed => "the limit switch is closed".to_owned(),
        Item::Limit => "the limit switch is open".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_and_what_is_allowed() {
        let slow = sentence(&Finding::judged(Item::GyroRate, 384.667, [394.0, 406.0]));
        assert!(
            slow.starts_with(
                "gyro-rate failed: the gyro sends 384.67 frames a second; 394 to 406 are allowed. To do: check"
            ),
            "{slow}"
        );
        let slipped = sentence(&Finding::judged(Item::Drive, 0.04, [0.0, 0.5]));
        assert_eq!(
            slipped,
            "index-drive passed: a move of 5° ended 0.04° off its target by the encoder; 0 to 0.5 are allowed"
        );
        let corrupt = sentence(&Finding::judged(Item::Settings, 2.0, [0.0, 0.0]));
        assert!(corrupt.starts_with("settings failed: the stored settings fail their check. To do: load"), "{corrupt}");
        let valid = sentence(&Finding::judged(Item::Settings, 0.0, [0.0, 0.0]));
        assert_eq!(valid, "settings passed: the settings in flash are valid");
        let crashed = sentence(&Finding::judged(Item::Reset, 5.0, [0.0, 0.0]));
        assert!(crashed.starts_with("reset failed: the run before ended in a crash: watchdog. To do: "), "{crashed}");
        let absent = sentence(&Finding::untested(Item::Block, TestVerdict::Absent));
        assert_eq!(absent, "block was not tested: this board has no such part, or the settings name none");
        let untested = sentence(&Finding::untested(Item::Memory, TestVerdict::Absent));
        assert_eq!(untested, "memory was not tested: this board has no such test");
    }
}
