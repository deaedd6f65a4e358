//! Replay = record = replay: what entered the pipeline, entered again, gives the same reports bit for bit; and the
//! recording of a run's seconds gives the azimuth that the run gave.

mod common;

use std::sync::atomic::AtomicBool;

use common::{fix, run, setup};
use north::engine::host;
use north_finder::event::{Event, Report};
use north_finder::fix::dwell::DwellSummary;
use north_finder::pipeline::{Pipeline, Readings};
use north_finder::replay::{Replay, Row};
use north_finder::sequence::Command;
use north_finder::settings::store::Loaded;
use north_finder::units::wrap_180_deg;

#[test]
fn the_same_input_gives_the_same_reports() {
    for name in ["knocks-during-dwell", "lossy-link", "stalled-motor", "creep"] {
        let setup = setup(name, 7);
        let (mut recorded, mut reports): (Vec<(Readings, Vec<u8>)>, Vec<Report>) = Default::default();
        let mut tap = |readings: &Readings, bytes: &[u8]| recorded.push((*readings, bytes.to_vec()));
        host::run_tapped(&setup, &AtomicBool::new(false), &mut |report| reports.push(*report), &mut tap).unwrap();

        let mut pipeline = Pipeline::new(Loaded::Valid(setup.settings.clone().unwrap()));
        pipeline.command(Command::Start);
        let mut replayed = Vec::new();
        for (readings, bytes) in &recorded {
            pipeline.gyro_bytes(bytes);
            pipeline.tick(readings, &mut |report| replayed.push(report));
        }
        assert_eq!(format!("{replayed:?}"), format!("{reports:?}"), "{name}");
    }
}

#[test]
fn two_runs_of_one_seed_are_identical_and_two_seeds_are_not() {
    let reports = |seed| format!("{:?}", run(&setup("windy-tripod", seed)).1);
    assert_eq!(reports(3), reports(3));
    assert_ne!(reports(3), reports(4));
}

#[test]
fn recorded_seconds_give_the_azimuth_of_the_run() {
    for name in ["calm-bench", "creep", "drift", "lossy-link"] {
        let setup = setup(name, 5);
        let settings = setup.settings.clone().unwrap();
        let (outcome, reports) = run(&setup);
        let (live, _) = fix(&outcome);
        let mut slots = vec![DwellSummary::default(); reports.len()];
        let mut replay = Replay::new(&settings, &mut slots).unwrap();
        for (second, report) in (1..).zip(reports.iter().filter_map(|report| match report.event {
            Event::Second(second) => Some(second),
            _ => None,
        })) {
            let row = Row {
                t_s: f64::from(second),
                interval_s: 1.0,
                index_deg: report.index_deg.unwrap(),
                fog_arcsec: report.fog_arcsec,
                temp_c: report.temp_c,
                level_g: report.level_g,
                lost_frames: report.lost_frames,
            };
            replay.push(&row, &mut |_| {}).unwrap();
        }
        let replayed = replay.finish(&mut |_| {}).unwrap();
        // The replay also uses the seconds of the gates, about 30 beside the 240: the difference of the two azimuths
        // has at most the standard deviation √(1 − 240/270) = 1/3 of sigma, so 1.5 sigma are 4.5 of those.
        let difference_deg = wrap_180_deg(replayed.azimuth_deg - live.azimuth_deg);
        assert!(difference_deg.abs() < 1.5 * live.sigma_deg, "{name}: {difference_deg}° at sigma {}°", live.sigma_deg);
        assert!(replayed.seconds >= live.seconds);
    }
}
