//! What nothing that was found explains, in words.

use north_finder::effects::doubt::{Kernel, Process};
use north_finder::effects::effect::Port;
use north_finder::event::Fix;
use north_finder::units::wrap_180_deg;

use super::NoiseTests;
use super::found::PROCESS;
use super::noise::azimuth_tests;
use super::statistics::p_value_in_words;
use crate::campaign::Role;
use crate::run_data::RunData;

/// What is left counts as structure below this probability.
const STRUCTURE: f64 = 1e-4;

/// Everything that says that structure remains; nothing where there is none. `process`: of the runs' own, and whether sigma covers it; `left_out`:
/// training runs by what the others taught; `wrong`: files whose references are not believed.
pub fn evidence(
    process: Option<(Process, bool)>,
    runs: &[RunData],
    left_out: &[Option<Fix>],
    wrong: &[String],
    noise: &NoiseTests,
) -> Vec<String> {
    let mut evidence: Vec<String> = process.map(in_words).into_iter().collect();
    // Where nothing may be learned, all runs together are asked.
    if runs.iter().all(|run| run.role != Role::Fit) {
        let of_all = |name: &str| matches!(name, "dwells" | "closure");
        let failed = noise.after.iter().filter(|test| of_all(&test.name) && test.p_value < STRUCTURE);
        evidence
            .extend(failed.map(|test| {
                format!("the test `{}` of all runs fails ({})", test.name, p_value_in_words(test.p_value))
            }));
    }
    let dependences: Vec<_> = noise.after.iter().filter(|test| test.name.starts_with("dependence:")).collect();
    for test in &dependences {
        let p_value = test.p_value * dependences.len() as f64;
        if let Some(channel) = test.name.strip_prefix("dependence:").filter(|_| p_value < STRUCTURE) {
            evidence.push(format!("what is left still goes with {channel} ({})", p_value_in_words(p_value)));
        }
    }
    evidence.extend(azimuths(runs, left_out, wrong));
    evidence
}

/// Azimuths of training runs, by what the others taught, against their references.
fn azimuths(runs: &[RunData], left_out: &[Option<Fix>], wrong: &[String]) -> Vec<String> {
    let error = |(run, fix): (&RunData, &Option<Fix>)| {
        let (fix, reference_deg) = ((*fix)?, run.reference_deg?);
        let sigma_deg = fix.sigma_deg.hypot(run.reference_sigma_deg);
        let believed = run.role == Role::Fit && !wrong.contains(&run.file);
        believed.then_some((wrap_180_deg(fix.azimuth_deg - reference_deg), sigma_deg, reference_deg))
    };
    let errors: Vec<(f64, f64, f64)> = runs.iter().zip(left_out).filter_map(error).collect();
    azimuth_tests(&errors)
        .into_iter()
        .filter(|test| test.p_value < STRUCTURE)
        .map(|test| match test.name.as_str() {
            "azimuth" => format!(
                "azimuths miss their references by {:.1} sigma rms ({})",
                (test.statistic / errors.len() as f64).sqrt(),
                p_value_in_words(test.p_value)
            ),
            _ => format!("azimuth errors go with the heading ({})", p_value_in_words(test.p_value)),
        })
        .collect()
}

/// A process in words, and whether sigma covers it.
fn in_words((process, covered): (Process, bool)) -> String {
    let kernel = match process.kernel {
        Kernel::DampedCosine { period_s } => format!(", ringing with a period of {period_s:.0} s"),
        Kernel::Transient => ", of another size after every move of the index".into(),
        Kernel::Start => ", of another size at the start of every run".into(),
        _ => String::new(),
    };
    let place = match process.port {
        Port::Rate => "",
        Port::Scale => " in the scale factor",
        Port::Index => " in the index angle",
        Port::Forward => " in the forward level",
        Port::Left => " in the left level",
    };
    let unit = match process.port.unit() {
        "deg_h" => "deg/h",
        "1" => "of the rate",
        unit => unit,
    };
    format!(
        "{PROCESS} that no channel tells{place}, typically {:.4} {unit} over {:.0} s{kernel}; {}",
        process.sigma_deg_h * process.port.per_deg_h(),
        process.time_s,
        if covered { "sigma covers it" } else { "sigma does not cover it" }
    )
}
