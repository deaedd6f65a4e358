//! What a self-test found, for people.

use north_finder::health::{Fault, Finding, Item, TestVerdict};

/// An item with its verdict, what was measured and what is allowed; what to do, where it failed.
pub fn sentence(finding: &Finding) -> String {
    let Finding { item, verdict, measured, allowed: [least, most] } = *finding;
    let head = format!("{} {}", item.name(), verdict.name());
    if !finding.was_tested() {
        return format!("{head}: {}", verdict.meaning());
    }
    let value = |value: f32| format!("{value:.2}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let space = if matches!(item.unit(), "" | "°") { "" } else { " " };
    let allowed = if least == most { value(least) } else { format!("{} to {}", value(least), value(most)) };
    let text = format!("{head}: {}{space}{}, allowed {allowed}: {}", value(measured), item.unit(), item.meaning());
    let fault = Fault::ALL.iter().find(|fault| item == Item::Settings && f32::from(fault.code()) == measured);
    match (verdict, fault) {
        (TestVerdict::Failed, Some(fault)) => format!("{head}: {}. To do: {}", fault.meaning(), fault.remedy()),
        (TestVerdict::Failed, None) => format!("{text}. To do: {}", item.remedy()),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_and_what_is_allowed() {
        let slow = sentence(&Finding::judged(Item::GyroRate, 384.667, [394.0, 406.0]));
        assert!(slow.starts_with("gyro-rate failed: 384.67 1/s, allowed 394 to 406: frames a second"), "{slow}");
        assert!(slow.contains(". To do: check that the gyro is triggered"), "{slow}");
        let slipped = sentence(&Finding::judged(Item::Drive, 0.04, [0.0, 0.5]));
        assert!(slipped.starts_with("index-drive passed: 0.04°, allowed 0 to 0.5: by how much"), "{slipped}");
        let corrupt = sentence(&Finding::judged(Item::Settings, 2.0, [0.0, 0.0]));
        assert!(corrupt.starts_with("settings failed: the stored settings fail their check. To do: load"), "{corrupt}");
        let absent = sentence(&Finding::untested(Item::Block, TestVerdict::Absent));
        assert_eq!(absent, "block absent: there is no such part");
    }
}
