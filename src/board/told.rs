//! What of the reports goes to the log of a debugger: states, gates, moves, dwells, fixes with their flags, faults.

use north_finder::event::{Event, Report};

/// Logs a report, if it is one of those.
#[inline(never)]
pub fn log(report: &Report) {
    let t_s = report.t_s;
    match report.event {
        Event::State(state) => defmt::info!("{} s: {}", t_s, state),
        Event::Disturbed { excess_deg_h } => defmt::warn!("{} s: disturbed, {} deg/h", t_s, excess_deg_h),
        Event::Undisturbed { excess_deg_h } => defmt::info!("{} s: undisturbed, {} deg/h", t_s, excess_deg_h),
        Event::Moving { position, target_deg } => {
            defmt::info!("{} s: position {}, moving to {} deg", t_s, position, target_deg)
        }
        Event::Arrived { position, index_deg } => {
            defmt::info!("{} s: position {}, arrived at {} deg", t_s, position, index_deg)
        }
        Event::Jitter { position, change_deg_h } => {
            defmt::warn!("{} s: position {}, jitter, {} deg/h", t_s, position, change_deg_h)
        }
        Event::Settled { position } => defmt::info!("{} s: position {}, at rest", t_s, position),
        Event::IndexSlipped { position, before_deg } => {
            defmt::warn!("{} s: position {}, slipped from {} deg", t_s, position, before_deg)
        }
        Event::Dwell(dwell) => defmt::info!(
            "{} s: position {}, {} s, {} deg/h, sigma {} deg/h",
            t_s,
            dwell.position,
            dwell.seconds,
            dwell.rate_deg_h,
            dwell.sigma_deg_h
        ),
        Event::Fix(fix) => {
            defmt::info!("azimuth {} deg, sigma {} deg", fix.azimuth_deg, fix.sigma_deg);
            for flag in fix.flags.iter() {
                defmt::warn!("flag {}", flag);
            }
        }
        Event::Fault { fault, state } => defmt::error!("{} while {}", fault, state),
        Event::Guidance(guidance) => defmt::info!("{} s: {}", t_s, guidance.step),
        Event::NoCalibration(reason) => defmt::error!("no calibration: {}", reason.why),
        Event::SelfTest(found) => defmt::info!("self-test: {} {}: {}", found.item, found.verdict, found.measured),
        Event::ModelAged { signal, statistic } => {
            defmt::warn!("model aged: {} moved, statistic {}", signal, statistic)
        }
        _ => {}
    }
}
