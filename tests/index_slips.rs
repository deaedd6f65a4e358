//! The index slips while the motor stands: the spindle in its coupling, or the encoder on the spindle.

use crate::common::{fix, of_scenario, run};
use hal_sim::Scenario;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::Factor;
use north_finder::effects::shape::{Harmonic, Linear};
use north_finder::effects::signal::{Signal, Since};
use north_finder::effects::{ErrorModel, IndexError};
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
    slip_in(Scenario::named("calm-bench").unwrap(), what, slip_deg, at_s, order, seed, ErrorModel::default())
}

/// The same in a scenario, with an error model.
fn slip_in(
    mut scenario: Scenario,
    what: Slips,
    slip_deg: f64,
    at_s: f64,
    order: Order,
    seed: u64,
    model: ErrorModel,
) -> (Flags, f64, f64, Vec<Report>) {
    match what {
        Slips::Spindle => (scenario.motor.slip_deg, scenario.motor.slip_at_s) = (slip_deg, at_s),
        Slips::Encoder => (scenario.encoder.slip_deg, scenario.encoder.slip_at_s) = (slip_deg, at_s),
    }
    let mut setup = of_scenario(scenario, seed);
    let settings = setup.settings.as_mut().unwrap();
    settings.sequence.order = order;
    settings.model = Some(model);
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

/// By the model the encoder reads 1° too large, or by 1° more every minute of a rest, during which the reading stands and the drive turns the axis after it: nothing slips. The
/// encoder is right: at a reading θ the axis points to ψ − θ, of which the first model makes ψ′ − (θ − 1°), so that ψ′ = ψ − 1°. A slip beside either is named.
#[test]
fn an_error_that_the_model_knows_is_no_slip() {
    let index_error = |factors: &[Factor]| {
        let effect = Effect { weights: [1.0].into_iter().collect(), ..Effect::new(Port::Index, factors) };
        ErrorModel { effects: [effect].into_iter().collect(), ..ErrorModel::default() }
    };
    let constant = index_error(&[]);
    let growing = index_error(&[Factor::new(Since.into(), &[], Linear { reference: 0.0, scale: 60.0 }.into())]);
    for order in [Order::Mirrored, Order::ADAPTIVE, Order::Rotation { passes: 6 }] {
        let of = |model: &ErrorModel, slip_deg, at_s| {
            let scenario = Scenario::named("calm-bench").unwrap();
            slip_in(scenario, Slips::Encoder, slip_deg, at_s, order.clone(), 1, model.clone())
        };
        let (flags, error_deg, sigma_deg, _) = of(&constant, 0.0, 0.0);
        assert!(!flags.contains(Flag::IndexSlip), "{order:?}");
        assert!((error_deg + 1.0).abs() < 4.0 * sigma_deg, "{order:?}: {error_deg} ± {sigma_deg}");
        let (flags, _, _, reports) = of(&growing, 0.0, 0.0);
        assert!(!flags.contains(Flag::IndexSlip) && slipped_s(&reports).is_none(), "{order:?}");
        if !matches!(order, Order::Rotation { .. }) {
            for model in [&constant, &growing] {
                assert!(of(model, 0.5, 60.0).0.contains(Flag::IndexSlip), "{order:?}");
            }
        }
    }
}

/// An encoder whose magnet sits off the axis reads e · cos θ too large, within the tolerance of a move and beyond it. A model that knows it, as the error of the index or as an
/// effect that follows the index, makes moves of it that agree with their steps: nothing is doubted, but a slip beside it is.
#[test]
fn an_eccentric_encoder_that_the_model_knows_is_no_slip() {
    for eccentricity_deg in [0.4, 1.2] {
        let mut scenario = Scenario::named("calm-bench").unwrap();
        (scenario.encoder.eccentricity_deg, scenario.encoder.eccentricity_at_deg) = (eccentricity_deg, 0.0);
        let as_error = IndexError { cos_deg: eccentricity_deg, ..IndexError::default() };
        let as_error = ErrorModel { index_error: Some(as_error), ..ErrorModel::default() };
        let factor = Factor::new(Signal::Index, &[], Harmonic { period: 360.0 }.into());
        let weights = [eccentricity_deg as f32, 0.0].into_iter().collect();
        let as_effect = Effect { weights, ..Effect::new(Port::Index, &[factor]) };
        let as_effect = ErrorModel { effects: [as_effect].into_iter().collect(), ..ErrorModel::default() };
        for order in [Order::Plain, Order::Mirrored, Order::ADAPTIVE, Order::Rotation { passes: 6 }] {
            let of = |model: &ErrorModel, slip_deg| {
                slip_in(scenario.clone(), Slips::Encoder, slip_deg, 44.0, order.clone(), 1, model.clone())
            };
            let is_rotation = matches!(order, Order::Rotation { .. });
            assert!(is_rotation || of(&ErrorModel::default(), 0.0).0.contains(Flag::IndexSlip), "{order:?}");
            for model in [&as_error, &as_effect] {
                let (flags, error_deg, sigma_deg, _) = of(model, 0.0);
                assert!(!flags.contains(Flag::IndexSlip), "{eccentricity_deg} {order:?}");
                assert!(error_deg.abs() < 4.0 * sigma_deg, "{eccentricity_deg} {order:?}: {error_deg} ± {sigma_deg}");
                assert!(of(model, 1.0).0.contains(Flag::IndexSlip), "{eccentricity_deg} {order:?}");
            }
        }
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

/// In the middle of every pass but the last, by less than the tolerance of 0.5° and more than seven sigmas of the encoder, 0.14°. In the motion's direction
/// it went farther than its steps, against it what happened looks like play until the next pass.
#[test]
fn a_slip_within_a_rotation_is_flagged() {
    let order = || Order::Rotation { passes: 6 };
    let (flags, _, _, reports) = slip(Slips::Encoder, 0.0, 0.0, order(), 1);
    assert!(!flags.contains(Flag::IndexSlip));
    let passes_s: Vec<f64> = reports.iter().filter_map(|report| began_s(report, 128)).collect();
    assert_eq!(passes_s.len(), 6);
    for (pass, pass_s) in passes_s.iter().enumerate().take(5) {
        for slip_deg in [0.23, -0.23] {
            let (flags, error_deg, sigma_deg, _) = slip(Slips::Encoder, slip_deg, pass_s + 6.0, order(), 1);
            println!("{slip_deg}° in pass {pass}: {error_deg:.3} {sigma_deg:.3}");
            assert!(flags.contains(Flag::IndexSlip), "{slip_deg}° in pass {pass}");
        }
    }
}

/// Halfway in every move of the adaptive order but the last, which may be the first one its way and is followed by none.
#[test]
fn a_slip_in_a_move_of_the_adaptive_order_is_flagged() {
    let (flags, _, _, reports) = slip(Slips::Encoder, 0.0, 0.0, Order::ADAPTIVE, 1);
    assert!(!flags.contains(Flag::IndexSlip));
    let began: Vec<f64> = reports.iter().filter_map(|report| began_s(report, 0)).collect();
    let arrived = |report: &Report| matches!(report.event, Event::Arrived { .. }).then_some(report.t_s);
    let ended: Vec<f64> = reports.iter().filter_map(arrived).collect();
    assert!(began.len() >= 3 && began.len() == ended.len(), "{began:?} {ended:?}");
    for (began_s, ended_s) in began.iter().zip(&ended).take(began.len() - 1) {
        for slip_deg in [0.3, -0.3] {
            let at_s = 0.5 * (began_s + ended_s);
            let (flags, error_deg, sigma_deg, _) = slip(Slips::Encoder, slip_deg, at_s, Order::ADAPTIVE, 1);
            println!("{slip_deg}° at {at_s} s: {error_deg:.3} {sigma_deg:.3}");
            assert!(flags.contains(Flag::IndexSlip), "{slip_deg}° at {at_s} s");
        }
    }
}

/// When a move to a position of this number or a later one began.
fn began_s(report: &Report, from: u8) -> Option<f64> {
    matches!(report.event, Event::Moving { position, .. } if position >= from).then_some(report.t_s)
}

/// 0.3° between drive and gyro are less than the tolerance, and no slip in any order.
#[test]
fn play_is_no_slip() {
    for order in [Order::Rotation { passes: 6 }, Order::ADAPTIVE, Order::Mirrored, Order::EastWest] {
        for seed in 1..=4 {
            let mut scenario = Scenario::named("calm-bench").unwrap();
            scenario.motor.backlash_deg = 0.3;
            scenario.site.azimuth_deg = 85.0 * seed as f64;
            let mut setup = of_scenario(scenario, seed);
            setup.settings.as_mut().unwrap().sequence.order = order.clone();
            let (fix, _) = fix(&run(&setup).0);
            assert!(!fix.flags.contains(Flag::IndexSlip), "{order:?} {seed}");
        }
    }
}
