//! Reports on their way out: all to the host, and states, gates, moves, dwells, fixes with their flags and faults to the log of a debugger.

use core::sync::atomic::AtomicU32;

use heapless::Vec;
use north_finder::drivers::intake::one_more;
use north_finder::drivers::ring::Ring;
use north_finder::event::{Event, Report};
use north_finder::link;
use north_finder::link::nmea::{MAX_SENTENCE, Speaker};
use rtic_sync::signal::SignalWriter;

/// Reports on their way to the host, as frames: `solve` puts them, `report` sends them from there. The line takes 90 ms for all.
pub static FRAMES: Ring<1024> = Ring::new();

/// Puts reports among those that wait for the host's line.
pub struct ReportSender {
    waiting: SignalWriter<'static, ()>,
    speaker: Option<Speaker>,
    /// Counts what there is no room for.
    refused: &'static AtomicU32,
}

impl ReportSender {
    /// `nmea`: sentences go with the reports.
    pub fn new(waiting: SignalWriter<'static, ()>, nmea: bool, refused: &'static AtomicU32) -> Self {
        Self { waiting, speaker: nmea.then(Speaker::default), refused }
    }

    /// Logs a report and puts it among those that wait. (A test of the link says that the longest fits a frame.)
    #[inline(never)]
    pub fn send(&mut self, report: &Report) {
        log(report);
        let frame = link::encode_report(report);
        self.put(frame.as_deref().unwrap_or_default());
        if let Some(mut speaker) = self.speaker.take() {
            speaker.hear(report, &mut |sentence| {
                let mut frame = Vec::<u8, { MAX_SENTENCE + 1 }>::new();
                // There is room.
                let _ = frame.extend_from_slice(sentence.as_bytes());
                let _ = frame.push(0);
                self.put(&frame);
            });
            self.speaker = Some(speaker);
        }
    }

    fn put(&mut self, bytes: &[u8]) {
        if !bytes.is_empty() && FRAMES.put_whole(bytes) {
            self.waiting.write(());
        } else {
            one_more(self.refused);
        }
    }
}

/// Logs a report, if it is one of those.
#[inline(never)]
fn log(report: &Report) {
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
