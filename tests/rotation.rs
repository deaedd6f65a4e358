//! Continuous rotation: the azimuth with a gyro that feels the turning, live and from both of its recordings.

use std::cell::RefCell;
use std::sync::atomic::AtomicBool;

use crate::common::{fix, setup};
use north::engine::host;
use north::recorder::{RawRecorder, Recorder, new_campaign, write_run};
use north::settings_file::read_settings;
use north::solve::solve_file;
use north_finder::effects::now::RunFacts;
use north_finder::event::{Event, Fix, Report};
use north_finder::health::Flag;
use north_finder::sequence::order::Order;
use north_finder::settings::Settings;

/// The axis 60 arcsec off the normal of the spindle, which makes 31 °/h of 30 °/s, a drive uneven by 0.02°, and frames that the line loses. A bias
/// that wanders by 0.05 °/h. Every pass but its ramps counts.
#[test]
fn a_rotation_finds_north_and_its_recordings_give_the_fix_with_all_digits() {
    let folder = std::env::temp_dir().join(format!("north-rotation-{}", std::process::id()));
    for (name, azimuth_deg, passes, harmless) in
        [("calm-bench", 10.0, 6, &[][..]), ("lossy-link", 200.0, 4, &[Flag::FramesLost]), ("calm-bench", 300.0, 2, &[])]
    {
        let mut setup = setup(name, 5);
        setup.scenario.site.azimuth_deg = azimuth_deg;
        setup.scenario.gyro.axis_elevation_arcsec = 60.0;
        setup.scenario.gyro.bias_instability_deg_h = 0.05;
        setup.scenario.motor.unevenness_deg = 0.02;
        let settings = setup.settings.as_mut().unwrap();
        settings.sequence.order = Order::Rotation { passes };
        settings.gyro.bias_instability_deg_h = 0.05;
        let mut seconds = Recorder::default();
        let frames = RefCell::new(RawRecorder::new(settings.gyro));
        let (mut collected, mut promised_s, mut ended_s) = (0.0, f64::NAN, f64::NAN);
        let mut observe = |report: &Report| {
            seconds.see(report);
            frames.borrow_mut().report(report);
            match report.event {
                Event::Second(second) => collected += f64::from(u8::from(second.collected)),
                Event::ToGo { seconds } => promised_s = report.t_s + seconds,
                Event::Fix(_) => ended_s = report.t_s,
                _ => {}
            }
        };
        let mut tap = |readings: &_, bytes: &[u8]| frames.borrow_mut().tick(readings, bytes);
        let outcome = host::run_tapped(&setup, &AtomicBool::new(false), &mut observe, &mut tap).unwrap();
        let (found, error_deg) = fix(&outcome);
        assert!(error_deg.abs() < 4.0 * found.sigma_deg && found.sigma_deg < 0.3, "{name}: {error_deg} {found:?}");
        let doubts: Vec<_> = found.flags.iter().filter(|flag| !harmless.contains(flag)).collect();
        assert!(doubts.is_empty(), "{name}: {doubts:?}");
        // Of 13 s each 11 to 12 lie between the ramps, of which 10 or 11 are whole seconds; the pair of the first second needs the next one.
        let per_pass_s = found.seconds / f64::from(passes);
        assert!(found.seconds == collected && (9.5..=11.0).contains(&per_pass_s), "{name}: {per_pass_s} {collected}");
        assert!((ended_s - promised_s).abs() < 0.05 * 13.0 * f64::from(passes) + 2.0, "{name}: {promised_s} {ended_s}");

        let campaign = new_campaign(&folder.join(name), name.into(), &setup).unwrap();
        for (file, rows) in [("runs/s.csv", seconds.take_rows()), ("runs/f.csv", frames.into_inner().take_rows())] {
            write_run(&campaign, file, rows).unwrap();
            let settings = read_settings(&folder.join(name).join("settings.toml"), &Settings::default()).unwrap();
            let again = solve_file(&folder.join(name).join(file), &settings, RunFacts::default()).unwrap().fix;
            let digits = |fix: &Fix| (fix.azimuth_deg.to_bits(), fix.sigma_deg.to_bits(), fix.flags);
            assert_eq!(digits(&again), digits(&found), "{name} {file}");
        }
        std::fs::remove_dir_all(folder.join(name)).unwrap();
    }
}
