//! What a board's settings, seconds, counters and line say of it.

use north_finder::earth::earth_rate;
use north_finder::event::Second;
use north_finder::health::Counters;
use north_finder::settings::Settings;

use super::{Finding, Received, Verdict, finding};
use crate::port::Port;

/// Least seconds that say something of the gyro's noise.
const LEAST_SECONDS: usize = 5;
/// Noise that differs from what is declared by more than this factor is worth a look. Of twelve seconds' differences it is known to 25 %.
const NOISE_FACTOR: f64 = 2.0;
/// By more than this it is no noise that a declaration could be wrong by: the gyro or the base is at fault.
const FAR_NOISE_FACTOR: f64 = 10.0;
/// A load of so many thousandths of a tick is too near to one.
const HIGH_LOAD: u32 = 900;

pub(super) fn of_settings(settings: &Settings, findings: &mut Vec<Finding>) {
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
    findings.push(match settings.accelerometer {
        Some(_) => finding("accelerometers", Verdict::Good, "A calibration is stored."),
        None => finding(
            "accelerometers",
            Verdict::Look,
            "No calibration is stored, and every azimuth carries the flag level-uncalibrated: north calibrate field makes one.",
        ),
    });
}

/// `worst` is what makes `find` refuse as long as it goes on: bad, or to look at where a fix is tried.
pub(super) fn of_seconds(received: &Received, settings: &Settings, worst: Verdict, findings: &mut Vec<Finding>) {
    let seconds = &received.seconds;
    let Some(last) = seconds.last().filter(|_| seconds.len() >= LEAST_SECONDS) else {
        let text = "Not a second came from it: check its supply, its cable, its baud rate and the frame format in the settings.";
        findings.push(finding("gyro", Verdict::Bad, text));
        return;
    };
    let lost: u32 = seconds.iter().map(|second| u32::from(second.lost_frames)).sum();
    let frames = 400 * seconds.len();
    findings.push(match lost as usize {
        0 => finding("gyro frames", Verdict::Good, format!("All {frames} came.")),
        lost if lost >= frames => finding(
            "gyro frames",
            Verdict::Bad,
            format!("None of {frames} came: check its supply, its cable, its baud rate and the frame format."),
        ),
        _ => finding("gyro frames", Verdict::Bad, format!("{lost} of {frames} were lost: check the gyro's cable.")),
    });
    if (lost as usize) < frames {
        of_rates(seconds, settings, worst, findings);
    }
    findings.push(of_level(last, received.up, settings.level.limit_deg, worst));
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

/// Noise and mean of the gyro's rates.
fn of_rates(seconds: &[Second], settings: &Settings, worst: Verdict, findings: &mut Vec<Finding>) {
    // Differences of neighbours: a drift and the Earth's rate are not in them.
    let differences = seconds.windows(2).map(|pair| (pair[1].fog_arcsec - pair[0].fog_arcsec).powi(2));
    let noise = (differences.sum::<f64>() / (2 * (seconds.len() - 1)) as f64).sqrt();
    let declared = settings.gyro.noise_deg_h();
    let text = format!("{noise:.4} °/h from second to second; {declared:.4} °/h is declared");
    let still = "if the base is still, north characterise says what to declare, or the gyro needs service.";
    findings.push(if noise == 0.0 {
        finding("gyro noise", Verdict::Bad, "Every second has the same rate, to the last digit: the gyro repeats itself. Switch it off and on; if it goes on, it needs service.")
    } else if noise > FAR_NOISE_FACTOR * declared {
        finding("gyro noise", worst, format!("{text}: {still}"))
    } else if noise > NOISE_FACTOR * declared {
        finding("gyro noise", Verdict::Look, format!("{text}: {still}"))
    } else if noise * NOISE_FACTOR < declared {
        finding("gyro noise", Verdict::Look, format!("{text}: sigmas are wider than they need be."))
    } else {
        finding("gyro noise", Verdict::Good, format!("{text}."))
    });
    let rate = seconds.iter().map(|second| second.rate_deg_h).sum::<f64>() / seconds.len() as f64;
    if let Ok(earth) = earth_rate(settings.latitude_deg) {
        let limit = earth.north_deg_h + settings.gyro.bias_limit_deg_h + declared;
        findings.push(match rate.abs() > limit {
            true => finding("base", worst, format!("The rate is {rate:+.3} °/h, and a still gyro reads {limit:.3} at most: it moves, or the bias is beyond its limit.")),
            false => finding("base", Verdict::Good, format!("The rate is {rate:+.3} °/h: not more than the Earth's and the bias allow.")),
        });
    }
}

/// `up` is measured where the firmware has no level.
fn of_level(last: &Second, up: Option<[f64; 3]>, limit_deg: f64, worst: Verdict) -> Finding {
    let Some(level) = last.level else {
        return match up {
            Some([x, y, z]) => finding(
                "level",
                Verdict::Bad,
                format!(
                    "It is not upright: up is ({x:+.2}, {y:+.2}, {z:+.2}) of its axes forward, left and up. Set it upright and level it."
                ),
            ),
            None => finding("level", Verdict::Bad, "The accelerometer gives no reading: check its cable and supply."),
        };
    };
    let tilt = level.mean.tilt();
    let text = format!("Pitch {:+.3}°, roll {:+.3}°", tilt.pitch_deg, tilt.roll_deg);
    match tilt.is_level(limit_deg) {
        true => finding("level", Verdict::Good, format!("{text}: inside ± {limit_deg}°.")),
        false => finding("level", worst, format!("{text}: no fix begins before it is level to ± {limit_deg}°.")),
    }
}

pub(super) fn of_counters(received: &Received, findings: &mut Vec<Finding>) {
    let (Some(first), Some(last)) = (received.first, received.last) else { return };
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

pub(super) fn of_line(port: &Port, received: &Received, findings: &mut Vec<Finding>) {
    findings.push(match port.bad_frames() {
        // The line is joined in the middle of a frame.
        0 | 1 => finding("host line", Verdict::Good, "No frame came damaged."),
        count => {
            finding("host line", Verdict::Look, format!("{count} frames came damaged: check the cable and its ground."))
        }
    });
    if let (Some(load), Some(stack)) = (received.load_permille, received.stack_bytes) {
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
            level_temp_c: None,
            auxiliary: [None; 6],
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
        let received = Received { seconds, ..Received::default() };
        of_seconds(&received, &settings, Verdict::Look, &mut findings);
        assert!(findings[1].sentence.starts_with("0.1273 °/h"), "{}", findings[1].sentence);
        assert_eq!((verdict(&findings, "gyro noise"), verdict(&findings, "base")), (Verdict::Good, Verdict::Good));
        assert_eq!((verdict(&findings, "level"), verdict(&findings, "encoder")), (Verdict::Bad, Verdict::Good));
    }

    #[test]
    fn what_rises_is_bad_and_what_once_was_is_worth_a_look() {
        let once = Counters { frames_good: 7, encoder_errors: 3, ..Counters::default() };
        let mut findings = Vec::new();
        let received =
            Received { first: Some(once), last: Some(Counters { frames_good: 9, ..once }), ..Received::default() };
        of_counters(&received, &mut findings);
        let more = Counters { encoder_errors: 5, ..once };
        of_counters(&Received { last: Some(more), ..received }, &mut findings);
        assert_eq!([findings[0].verdict, findings[1].verdict], [Verdict::Look, Verdict::Bad]);
        assert_eq!(findings[1].sentence, "Going on: encoder_errors 5, 2 of them now.");
    }

    /// 12 seconds of one rate and one index angle.
    fn seconds(rate_deg_h: impl Fn(usize) -> f64) -> Received {
        Received { seconds: (0..12).map(|n| second(rate_deg_h(n))).collect(), ..Received::default() }
    }

    #[test]
    fn a_gyro_that_repeats_itself_is_bad_and_one_far_off_is_as_bad_as_it_may_be() {
        let settings = Settings { latitude_deg: 34.75, ..Settings::default() };
        let of = |received: &Received, worst| {
            let mut findings = Vec::new();
            of_seconds(received, &settings, worst, &mut findings);
            (verdict(&findings, "gyro noise"), verdict(&findings, "base"))
        };
        assert_eq!(of(&seconds(|_| 9.0), Verdict::Look), (Verdict::Bad, Verdict::Good));
        // Declared are 0.09 °/h: ± 0.9 in turn are 1.27, fourteen times as much.
        let noisy = seconds(|n| if n % 2 == 0 { 9.9 } else { 8.1 });
        for worst in [Verdict::Look, Verdict::Bad] {
            assert_eq!(of(&noisy, worst), (worst, Verdict::Good));
            assert_eq!(of(&seconds(|n| 50.0 + 0.09 * (n % 2) as f64), worst), (Verdict::Good, worst));
        }
    }

    #[test]
    fn an_instrument_on_its_side_is_not_upright_and_one_without_readings_is_not_known() {
        let settings = Settings { latitude_deg: 34.75, ..Settings::default() };
        for (up, part) in [(Some([0.0, 0.0, -1.0]), "not upright: up is (+0.00, +0.00, -1.00)"), (None, "no reading")] {
            let mut findings = Vec::new();
            let received = Received { up, ..seconds(|n| 9.0 + 0.09 * (n % 2) as f64) };
            of_seconds(&received, &settings, Verdict::Look, &mut findings);
            let level = findings.iter().find(|finding| finding.what == "level").unwrap();
            assert!(level.verdict == Verdict::Bad && level.sentence.contains(part), "{level:?}");
        }
    }
}
