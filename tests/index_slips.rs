//! The index slips while the motor stands: the spindle in its coupling, or the encoder on the spindle.

use crate::common::{fix, of_scenario, run};
use hal_sim::Scenario;
use north_finder::event::{Event, Report};
use north_finder::health::{Flag, Flags};
use north_finder::sequence::order::Order;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Slips {
    Spindle,
    Encoder,
}

/// A calm bench where something slips at a time, in an order. Flags, azimuth error and sigma in degrees, and the reports.
fn slip(what: Slips, slip_deg: f64, at_s: f64, order: Order, seed: u64) -> (Flags, f64, f64, Vec<Report>) {
    let mut scenario = Scenario::named("calm-bench").unwrap();
    match what {
        Slips::Spindle => (scenario.motor.slip_deg, scenario.motor.slip_at_s) = (slip_deg, at_s),
        Slips::Encoder => (scenario.encoder.slip_deg, scenario.encoder.slip_at_s) = (slip_deg, at_s),
    }
    let mut setup = of_scenario(scenario, seed);
    setup.settings.as_mut().unwrap().sequence.order = order;
    let (outcome, reports) = run(&setup);
    let (fix, error_deg) = fix(&outcome);
    (fix.flags, error_deg, fix.sigma_deg, reports)
}

fn slipped_s(reports: &[Report]) -> Option<f64> {
    reports.iter().find_map(|report| matches!(report.event, Event::IndexSlipped { .. }).then_some(report.t_s))
}

/// Within the second dwell, while the gyro settles before it, and in the last dwell of the plain order.
#[test]
fn a_slip_is_named_in_its_second_and_the_azimuth_holds() {
    for (number, at_s) in [44.0, 60.0, 62.9, 150.5].into_iter().enumerate() {
        for (what, slip_deg) in [(Slips::Spindle, 0.5), (Slips::Encoder, 0.3), (Slips::Encoder, -0.7)] {
            for order in [Order::Mirrored, Order::Plain] {
                let of = format!("{what:?} {slip_deg}° at {at_s} s, {order:?}");
                let (flags, error_deg, sigma_deg, reports) = slip(what, slip_deg, at_s, order, number as u64 + 1);
                println!("{of}: {error_deg:.3} {sigma_deg:.3} {:?}", slipped_s(&reports));
                assert!(flags.contains(Flag::IndexSlip), "{of}");
                // A second's report comes at its end; a slip in the last tenth of one may be seen in the next.
                let named_s = slipped_s(&reports).unwrap();
                assert!((0.0..=2.1).contains(&(named_s - at_s)), "{of}: {named_s}");
                assert!(error_deg.abs() < 4.0 * sigma_deg, "{of}: {error_deg} ± {sigma_deg}");
            }
        }
    }
}

/// A slip of 3° turns the gyro's rate by up to 0.65 °/h: the rates tell spindle from encoder, and nothing of it is left.
#[test]
fn a_large_slip_is_told_apart_and_made_good() {
    for what in [Slips::Spindle, Slips::Encoder] {
        let (flags, error_deg, sigma_deg, _) = slip(what, 3.0, 60.0, Order::Mirrored, 1);
        println!("{what:?}: {error_deg:.3} {sigma_deg:.3}");
        assert!(flags.contains(Flag::IndexSlip) && sigma_deg < 0.3, "{what:?}: {sigma_deg}");
        assert!(error_deg.abs() < 4.0 * sigma_deg, "{what:?}: {error_deg} ± {sigma_deg}");
    }
}

/// A drive that loses steps does not slip; but a move that had to be corrected may as well be an encoder that slipped on the way, and is
/// flagged.
#[test]
fn nothing_slips_on_a_calm_bench_nor_with_a_drive_that_loses_steps() {
    for (name, corrected) in [("calm-bench", false), ("windy-tripod", false), ("lost-steps", true)] {
        let (outcome, reports) = run(&of_scenario(Scenario::named(name).unwrap(), 1));
        assert_eq!(fix(&outcome).0.flags.contains(Flag::IndexSlip), corrected, "{name}");
        assert_eq!(slipped_s(&reports), None, "{name}");
    }
}

/// The encoder slips while the base is watched, before the first dwell: the azimuth is wrong by as much, and says so.
#[test]
fn a_slip_before_the_first_dwell_is_flagged() {
    for order in [Order::Mirrored, Order::ADAPTIVE] {
        let (flags, error_deg, _, _) = slip(Slips::Encoder, 1.0, 4.3, order, 1);
        assert!(flags.contains(Flag::IndexSlip) && (error_deg.abs() - 1.0).abs() < 0.2, "{error_deg}");
    }
}
