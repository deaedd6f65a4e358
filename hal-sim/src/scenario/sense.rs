//! Values that are allowed one by one but make no sense together.

use super::Scenario;
use super::check::Findings;

/// Notes windows that end before they begin and levellings that overlap.
pub fn check(scenario: &Scenario, findings: &mut Findings) {
    findings.within("base", |findings| {
        let base = &scenario.base;
        windows("sway", base.sway.iter().map(|sway| (sway.from_s, sway.to_s)), findings);
        findings.within("wind", |findings| window("", base.wind.from_s, base.wind.to_s, findings));
        findings.within("rocking", |findings| window("", base.rocking.from_s, base.rocking.to_s, findings));
        findings.within("relevel", |findings| relevel(scenario, findings));
    });
    findings.within("gyro", |findings| {
        windows("faults", scenario.gyro.faults.iter().map(|fault| (fault.from_s, fault.to_s)), findings);
    });
    for (name, faults) in [("accelerometer", &scenario.accelerometer.faults), ("encoder", &scenario.encoder.faults)] {
        findings.within(name, |findings| {
            windows("faults", faults.iter().map(|fault| (fault.from_s, fault.to_s)), findings);
        });
    }
    if let Some(block) = &scenario.block {
        findings.within("block", |findings| {
            windows("faults", block.faults.iter().map(|fault| (fault.from_s, fault.to_s)), findings);
        });
    }
    findings.within("motor", |findings| {
        window("stall_", scenario.motor.stall_from_s.unwrap_or(0.0), scenario.motor.stall_to_s, findings);
    });
    findings.within("link", |findings| {
        windows("faults", scenario.link.faults.iter().map(|fault| (fault.from_s, fault.to_s)), findings);
    });
}

fn windows(name: &str, all: impl Iterator<Item = (f64, Option<f64>)>, findings: &mut Findings) {
    findings.within(name, |findings| {
        for (position, (from_s, to_s)) in all.enumerate() {
            findings.within(position.to_string(), |findings| window("", from_s, to_s, findings));
        }
    });
}

fn window(prefix: &str, from_s: f64, to_s: Option<f64>, findings: &mut Findings) {
    if let Some(to_s) = to_s
        && to_s <= from_s
    {
        findings.within(format!("{prefix}to_s"), |findings| {
            findings.refuse(to_s, format!("later than {prefix}from_s = {from_s:?}"));
        });
    }
}

fn relevel(scenario: &Scenario, findings: &mut Findings) {
    for (position, pair) in scenario.base.relevel.windows(2).enumerate() {
        let ended_s = pair[0].at_s + pair[0].duration_s;
        if pair[1].at_s < ended_s {
            findings.within((position + 1).to_string(), |findings| {
                findings.within("at_s", |findings| {
                    findings.refuse(pair[1].at_s, format!("from {ended_s:?}, when the one before has ended"));
                });
            });
        }
    }
}
