//! Every effect by hand calculation.

use super::basis::curve::Curve;
use super::basis::curve::function::Function;
use super::basis::curve::signal::Signal;
use super::basis::drift::Drift;
use super::basis::harmonic::BodyHarmonic;
use super::basis::line::Line;
use super::basis::settling::{Settling, Size};
use super::basis::step::Step;
use super::basis::warm_up::WarmUp;
use super::effect::Port;
use super::factor::Factor;
use super::rate_term::DeadZoneForm;
use super::*;
use crate::sensing::index::Direction;
use crate::sensing::level::Specific;
use std::string::ToString;

fn model(terms: &[Term]) -> ErrorModel {
    ErrorModel { terms: terms.iter().cloned().collect(), ..Default::default() }
}

fn term(basis: Basis, coefficients: &[f64]) -> Term {
    Term::new(basis).with_coefficients(coefficients)
}

/// Powers of a signal of a channel.
fn powers(channel: &str, signal: Signal, reference: f32, degree: u8) -> Basis {
    let function = Function::Powers { reference, degree };
    Basis::Curve(Curve { channel: ChannelName::new(channel).unwrap(), signal, function })
}

fn conditions(t_s: f64, index_deg: f64) -> Conditions {
    Conditions { t_s, index: Some(Direction::of_deg(index_deg)), temp_c: Some(20.0), ..Default::default() }
}

/// A second with one further channel.
fn channel(t_s: f64, value: f64) -> Conditions {
    let mut each = conditions(t_s, 0.0);
    each.channels[0] = value;
    each
}

/// The bias that a model gives in the last of a run of conditions.
fn last_bias(model: ErrorModel, run: impl IntoIterator<Item = Conditions>) -> f64 {
    model.validate().unwrap();
    let mut evaluator = Evaluator::new(model);
    run.into_iter().map(|each| evaluator.second(&each).bias_deg_h).last().unwrap()
}

/// Coefficients and remembered values are of single precision.
fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found} instead of {expected}");
}

#[test]
fn bias_scale_and_temperature() {
    let rate = Signal::Rate { samples: 30, curved: false, low_pass_s: 0.0 };
    let mut model = model(&[
        term(powers("temp_c", Signal::Value, 20.0, 2), &[0.1, 0.01]),
        term(powers("temp_c", rate, 0.0, 1), &[9.0]),
        Term::scaling(powers("temp_c", Signal::Value, 20.0, 1)).with_coefficients(&[0.001]),
    ]);
    model.scale_error = 0.01;
    model.bias_deg_h = 0.5;
    model.validate().unwrap();
    let mut evaluator = Evaluator::new(model);
    let mut correction = None;
    for second in 0..=30 {
        let t_s = f64::from(second);
        correction = Some(evaluator.second(&Conditions { temp_c: Some(24.7 + 0.01 * t_s), ..conditions(t_s, 0.0) }));
    }
    // At 25 °C, rising by 0.01 K/s: bias 0.5 + 5 · 0.1 + 25 · 0.01 + 9 · 0.01 = 1.34 °/h; scale 1 + 0.01 + 0.005. A true
    // 10 °/h over 2 s is 20 arcsec, read as 20 · 1.015 + 2 · 1.34 = 22.98 arcsec.
    assert_close(correction.unwrap().apply(22.98, 2.0), 20.0);
}

#[test]
fn a_rate_waits_for_ten_seconds_and_all_that_follow_rates_wait_together() {
    let rate = |samples| powers("temp_c", Signal::Rate { samples, curved: false, low_pass_s: 0.0 }, 0.0, 1);
    let mut evaluator = Evaluator::new(model(&[term(rate(30), &[1.0]), term(rate(3), &[2.0])]));
    let mut second = |t_s: f64, temp_c| {
        let correction = evaluator.second(&Conditions { t_s, temp_c, ..Default::default() });
        (correction.waiting, correction.bias_deg_h, evaluator.rates_deg_h())
    };
    for i in 0..9 {
        let (waiting, bias_deg_h, _) = second(f64::from(i), Some(0.125 * f64::from(i)));
        assert!(waiting && bias_deg_h == 0.0);
    }
    assert_eq!(second(9.0, Some(1.125)), (false, 0.375, 0.375));
    assert!(second(10.0, None).0);
}

#[test]
fn a_channel_with_its_powers_lag_low_pass_memory_and_play() {
    let cubic = |signal| model(&[term(powers("supply_v", signal, 24.0, 3), &[1.0, 0.5, 0.25])]);
    let ramp = || (0..8).map(|i| channel(f64::from(i), 19.0 + f64::from(i)));
    // At the end 26 V, u = 2: 2 + 0.5 · 4 + 0.25 · 8 = 6. Five seconds before 21 V, u = −3: −3 + 4.5 − 6.75 = −5.25.
    assert_close(last_bias(cubic(Signal::Value), ramp()), 6.0);
    assert_close(last_bias(cubic(Signal::Lag { lag_s: 5.0 }), ramp()), -5.25);
    // A step from 24 to 25 V one second ago through a low-pass of 2 s: u = 1 − e^−0.5; what has not passed is e^−0.5.
    let step = || [channel(0.0, 24.0), channel(1.0, 25.0)];
    let u = 0.3934693402873666;
    assert_close(last_bias(cubic(Signal::LowPass { tau_s: 2.0 }), step()), u + 0.5 * u * u + 0.25 * u * u * u);
    let memory = model(&[term(powers("supply_v", Signal::Memory { tau_s: 2.0 }, 0.0, 1), &[1.0])]);
    assert_close(last_bias(memory, step()), 1.0 - u);
    // A play of ± 1 V starts at 24, follows up to 28 one below, stands still on the way back to 26.5 and follows to 25 one
    // above.
    let play = || model(&[term(powers("supply_v", Signal::Play { half_width: 1.0 }, 0.0, 1), &[1.0])]);
    let way = [24.0, 24.5, 26.0, 28.0, 26.5, 25.0];
    for (length, expected) in [(1, 24.0), (2, 24.0), (3, 25.0), (4, 27.0), (5, 27.0), (6, 26.0)] {
        let run = way[..length].iter().zip(0..).map(|(&volts, t)| channel(f64::from(t), volts));
        assert_close(last_bias(play(), run), expected);
    }
    assert_eq!(play().off_board(&[]), ChannelName::new("supply_v"));
}

#[test]
fn a_surface_of_two_channels_is_a_product_of_tables() {
    let table = |channel: &str, knots: &[f32]| {
        let function = Function::Table(knots.iter().copied().collect());
        Basis::Curve(Curve { channel: ChannelName::new(channel).unwrap(), signal: Signal::Value, function })
    };
    // Corners (0, 20), (0, 30), (10, 20), (10, 30) have 1, 2, 3, 8. At (2.5, 24): between 1 and 2 by 0.4: 1.4; between 3 and
    // 8: 5; between these by 0.25: 2.3.
    let surface = Term::product(table("supply_v", &[0.0, 10.0]), table("temp_c", &[20.0, 30.0]));
    let surface = model(&[surface.with_coefficients(&[1.0, 2.0, 3.0, 8.0])]);
    let now = Conditions { temp_c: Some(24.0), ..channel(0.5, 2.5) };
    assert_close(last_bias(surface, [now]), 2.3);
}

#[test]
fn time_since_switch_on() {
    let at = |basis, coefficients: &[f64], t_s| last_bias(model(&[term(basis, coefficients)]), [conditions(t_s, 0.0)]);
    assert_close(at(Basis::Drift(Drift { degree: 2 }), &[2.0, 4.0], 1800.0), 2.0);
    assert_close(at(Basis::WarmUp(WarmUp { tau_s: 100.0 }), &[2.0], 100.0), 2.0 * 0.36787944117144233);
    assert_close(at(Basis::Step(Step { t_s: 50.0 }), &[0.3], 49.0), 0.0);
    assert_close(at(Basis::Step(Step { t_s: 50.0 }), &[0.3], 50.25), 0.3 * 0.75);
    assert_close(at(Basis::Line(Line { period_s: 40.0 }), &[0.1, 0.2], 10.0), 0.2);
}

#[test]
fn settling_after_a_move() {
    let settling = |by, first_dwell| Basis::Settling(Settling { tau_s: 10.0, by, first_dwell });
    let all = || {
        model(&[
            term(settling(Size::Constant, false), &[0.1]),
            term(settling(Size::Direction, false), &[0.2]),
            term(settling(Size::Travel, false), &[0.01]),
            term(settling(Size::SignedTravel, false), &[0.002]),
            term(settling(Size::Position, false), &[0.5, 0.3]),
        ])
    };
    assert_close(last_bias(all(), [conditions(0.5, 0.0)]), 0.0);
    // From 0° to 270° is a quarter turn clockwise; rest began with the row at 1.0 s, and the middle of the row at 10.5 s is
    // 9.5 s later: (0.1 − 0.2 + 0.9 − 0.18 + 0 − 0.3) · e^−0.95.
    let run = [conditions(0.5, 0.0), conditions(1.5, 270.0), conditions(10.5, 270.0)];
    assert_close(last_bias(all(), run), 0.32 * 0.38674102345450123);
    // Back again at once: of the first move e^−1.95 is left at 20.5 s, of the second, which began to rest at 11 s, e^−0.95:
    // 0.1 + 0.2 + 0.9 + 0.18 + 0.5.
    let run = [conditions(0.5, 0.0), conditions(1.5, 270.0), conditions(10.5, 270.0), conditions(11.5, 0.0)];
    let later = run.into_iter().chain([conditions(20.5, 0.0)]);
    assert_close(last_bias(all(), later.clone()), 0.32 * 0.1422740715865136 + 1.88 * 0.38674102345450123);
    // By the number of moves: the first counts 1, the second 2.
    let by_number = model(&[term(settling(Size::Number, true), &[1.0])]);
    assert_close(last_bias(by_number, later.clone()), 0.1422740715865136 + 2.0 * 0.38674102345450123);
    // Times the temperature, 20 °C.
    let hot = Term::product(settling(Size::Number, true), powers("temp_c", Signal::Value, 0.0, 1));
    let by_both = model(&[hot.with_coefficients(&[0.05])]);
    assert_close(last_bias(by_both, later), 0.1422740715865136 + 2.0 * 0.38674102345450123);
}

#[test]
fn index_and_rate() {
    let harmonic = Basis::BodyHarmonic(BodyHarmonic { order: 2 });
    assert_close(last_bias(model(&[term(harmonic, &[0.1, 0.2])]), [conditions(0.0, 45.0)]), 0.2);
    let rate = |terms: &[RateTerm], raw_rate_deg_h| {
        let model = ErrorModel { rate_terms: terms.iter().copied().collect(), ..Default::default() };
        last_bias(model, [Conditions { raw_rate_deg_h, ..conditions(0.0, 0.0) }])
    };
    // True −9 less 1: 0.01 · 100 − 0.002 · 1000 = −1 is added, which makes −10.
    let power = |power, coefficient| RateTerm::Power { centre_deg_h: 1.0, power, coefficient };
    assert_close(rate(&[power(2, 0.01), power(3, 0.002)], -10.0), -1.0);
    // Lost at the width is the depth, whatever the form; at twice the width 2 e^−1.5, 2/e, 4/5 and 2 − √3 of it.
    let at_two = [0.4462603202968596, 0.7357588823428847, 0.8, 0.2679491924311228];
    for (form, at_two) in DeadZoneForm::ALL.into_iter().zip(at_two) {
        let zone = RateTerm::DeadZone { centre_deg_h: 0.5, depth_deg_h: 0.2, width_deg_h: 3.0, form };
        // True −2.5, a loss of 0.2 towards zero: −2.3; the slope of the last form is vertical there, and its root so much less
        // certain. True 6.5: less by the share at two.
        assert!((rate(&[zone], -2.3) - 0.2).abs() < 1e-8);
        assert!((rate(&[zone], 6.5 - 0.2 * at_two) + 0.2 * at_two).abs() < 1e-9);
    }
    // A gyro that nearly stands still about zero: 0.9 of the rate is lost. True 0.1 reads 0.01.
    let deaf = RateTerm::DeadZone { centre_deg_h: 0.0, depth_deg_h: 1.8, width_deg_h: 2.0, form: DeadZoneForm::Lock };
    assert!((rate(&[deaf], 0.01) + 0.09).abs() < 1e-9);
}

#[test]
fn index_error_and_earth_field_turn_the_answer() {
    let error = IndexError { offset_deg: 10.0, ..Default::default() };
    let offset = ErrorModel { index_error: Some(error), ..Default::default() };
    // Measured 40°, too large by 10°: truly 30°.
    let Direction { cos, sin } = offset.true_index(Direction { cos: 0.766_044_443_118_978, sin: 0.6427876096865394 });
    assert!((cos - 0.8660254037844387).abs() < 1e-12);
    assert!((sin - 0.5).abs() < 1e-12);
    // h = 7.5205335 at 60°; an east field of the same size turns the apparent azimuth by −45°.
    let earth = crate::earth::earth_rate(60.0).unwrap();
    let field = EarthField { east_deg_h: earth.north_deg_h, north_deg_h: 0.0 };
    let field = ErrorModel { earth_field: Some(field), ..Default::default() };
    assert!((field.true_azimuth_deg(330.0, &earth) - 15.0).abs() < 1e-9);
}

#[test]
fn accelerometers_are_channels_too() {
    let scale = Term::scaling(powers("ay_g", Signal::Value, 0.0, 1)).with_coefficients(&[2.0]);
    let mut evaluator = Evaluator::new(model(&[scale]));
    let level = Specific::new(0.0, 0.01);
    assert_close(evaluator.second(&Conditions { level, ..Default::default() }).scale, 1.02);
}

#[test]
fn doubt_is_what_a_sigma_along_each_direction_adds() {
    let scale = Term::scaling(powers("ay_g", Signal::Value, 0.0, 1)).with_coefficients(&[2.0]);
    let mut model = model(&[term(powers("temp_c", Signal::Value, 15.0, 2), &[1.0, 0.0]), scale]);
    let directions: [&[f32]; 2] = [&[0.5, 0.25, 0.0], &[0.0, 0.0, 1.0]];
    model.doubt.directions = directions.into_iter().map(|each| each.iter().copied().collect()).collect();
    model.validate().unwrap();
    // At 20 °C, tilted by 0.01 g: 0.5 · 5 + 0.25 · 25 = 8.75 °/h of raw rate; the scale is 1.02, and raw 56 less 5 is a true
    // 50 °/h, of which 0.01 in the scale is 0.5 °/h.
    let level = Specific::new(0.0, 0.01);
    let now = Conditions { raw_rate_deg_h: 56.0, level, ..conditions(0.5, 0.0) };
    let carried = Evaluator::new(model.clone()).second(&now).carried;
    let [first, second, third] = [0, 1, 2].map(|direction| carried.doubt(Port::Rate, direction));
    assert_close(first, 8.75 / 1.02);
    assert_close(second, 0.5 / 1.02);
    assert_eq!(third, 0.0);
    model.doubt.directions[1].pop();
    assert_eq!(model.validate().unwrap_err().field, "model.doubt.directions (numbers of one)");
}

/// At 20 °C, each port by hand: 0.5 °/h by K above 18 °C; a scale factor of 0.001 by K; an index that reads 2° too much where it stands at 90°, 0 where it
/// stands at 0°; a forward accelerometer that reads 0.01 g too much.
#[test]
fn effects_at_every_port() {
    let temperature = signal::Channel { name: ChannelName::new("temp_c").unwrap() };
    let above = Factor::new(temperature.into(), &[], shape::Linear { reference: 18.0, scale: 1.0 }.into());
    let harmonic = Factor::new(signal::Index.into(), &[], shape::Harmonic { period: 360.0 }.into());
    let effect = |port, factors: &[Factor], weights: &[f32]| Effect {
        weights: weights.iter().copied().collect(),
        ..Effect::new(port, factors)
    };
    let model = ErrorModel {
        effects: [
            effect(Port::Rate, core::slice::from_ref(&above), &[0.5]),
            effect(Port::Scale, &[above], &[0.001]),
            effect(Port::Index, &[harmonic], &[0.0, 2.0]),
            effect(Port::Forward, &[], &[0.01]),
        ]
        .into_iter()
        .collect(),
        ..Default::default()
    };
    model.validate().unwrap();
    let mut evaluator = Evaluator::new(model);
    for (index_deg, turned_deg) in [(0.0, 0.0), (90.0, 2.0)] {
        let found = evaluator.second(&conditions(0.5, index_deg));
        assert_close(found.bias_deg_h, 1.0);
        assert_close(found.scale, 1.002);
        assert_close(found.index_deg, turned_deg);
        assert_close(found.level.forward, 0.01);
        assert_eq!(found.level.left, 0.0);
    }
}

/// At 60°: 0.4° · cos 60° of an eccentric encoder and 0.2° · sin² 60° of an effect that follows the index twice; neither the zero error of 5° nor a
/// constant, what follows the temperature, or the index behind a dynamics.
#[test]
fn the_error_of_a_reading_by_hand() {
    let harmonic = Factor::new(signal::Index.into(), &[], shape::Harmonic { period: 360.0 }.into());
    let behind = Factor::new(signal::Index.into(), &[dynamics::LowPass { tau_s: 9.0 }.into()], harmonic.shape);
    let temperature = signal::Channel { name: ChannelName::new("temp_c").unwrap() };
    let warm = Factor::new(temperature.into(), &[], shape::Linear { reference: 18.0, scale: 1.0 }.into());
    let effect = |factors: &[Factor], weights: &[f32]| Effect {
        weights: weights.iter().copied().collect(),
        ..Effect::new(Port::Index, factors)
    };
    let of_rate = Effect { port: Port::Rate, ..effect(core::slice::from_ref(&harmonic), &[1.0, 1.0]) };
    let effects = [
        effect(&[harmonic.clone(), harmonic.clone()], &[0.0, 0.0, 0.0, 0.2]),
        effect(&[], &[1.0]),
        effect(&[warm], &[1.0]),
        effect(&[behind], &[1.0, 1.0]),
        of_rate,
    ];
    let model = ErrorModel {
        index_error: Some(IndexError { offset_deg: 5.0, cos_deg: 0.4, sin_deg: 0.0 }),
        effects: effects.into_iter().collect(),
        ..Default::default()
    };
    model.validate().unwrap();
    assert_close(model.index_error_here_deg(60.0), 0.2 + 0.15);
}

/// A decay of 1/ln 2 s, 8 °/h, halves every second. The index is at 0° for two seconds and then at 90°: it rests there since 2 s, so that the middle of the
/// fourth second comes 1.5 s after the move, and that of the first one 0.5 s after the start.
#[test]
fn what_a_move_leaves_behind_is_absent_before_the_first_one() {
    let tau_s = (1.0 / core::f64::consts::LN_2) as f32;
    let of = |signal: signal::Signal| {
        let mut effect = Effect::new(Port::Rate, &[Factor::new(signal, &[], shape::Decay { tau_s }.into())]);
        effect.weights.iter_mut().for_each(|weight| *weight = 8.0);
        let mut model = ErrorModel::default();
        assert!(model.effects.push(effect).is_ok());
        let mut evaluator = Evaluator::new(model);
        [(0.5, 0.0), (1.5, 0.0), (2.5, 90.0), (3.5, 90.0), (4.5, 90.0)]
            .map(|(t_s, index_deg)| evaluator.second(&conditions(t_s, index_deg)).bias_deg_h)
    };
    let root = 8.0 / core::f64::consts::SQRT_2;
    let [first, second, _, third, fourth] = of(signal::After.into());
    assert_close(first, 0.0);
    assert_close(second, 0.0);
    assert_close(third, 0.5 * root);
    assert_close(fourth, 0.25 * root);
    assert_close(of(signal::Since.into())[0], root);
}

/// A product with a factor that depends on the azimuth leaves the others to the solution: 2 K above 18 °C, times what belongs to the axis.
#[test]
fn the_solution_gets_what_it_multiplies() {
    let temperature = signal::Channel { name: ChannelName::new("temp_c").unwrap() };
    let above = Factor::new(temperature.into(), &[], shape::Linear { reference: 18.0, scale: 1.0 }.into());
    let harmonic = Factor::new(signal::Axis.into(), &[], shape::Harmonic { period: 360.0 }.into());
    let effect = Effect::new(Port::Rate, &[harmonic, above]);
    assert_eq!((effect.count(), effect.gates()), (2, 1));
    let mut model = ErrorModel::default();
    assert!(model.effects.push(effect).is_ok());
    let found = Evaluator::new(model).second(&conditions(0.5, 0.0));
    assert_eq!(found.bias_deg_h, 0.0);
    assert_close(found.carried.gate(0), 2.0);
}

#[test]
fn nonsense_is_named() {
    let refused = |model: ErrorModel| model.validate().unwrap_err().field;
    assert_eq!(refused(ErrorModel { scale_error: 0.5, ..Default::default() }), "model.scale_error");
    assert_eq!(refused(ErrorModel { bias_deg_h: f64::NAN, ..Default::default() }), "model.bias_deg_h");
    let timeless = Basis::WarmUp(WarmUp { tau_s: 0.0 });
    assert_eq!(refused(model(&[term(timeless, &[1.0])])), "model.terms.basis.warm-up.tau_s");
    let short = term(Basis::Drift(Drift { degree: 2 }), &[1.0]);
    assert_eq!(refused(model(&[short])), "model.terms.coefficients (number)");
    let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i"];
    let followers = names.map(|name| Term::scaling(powers(name, Signal::Value, 0.0, 1)));
    assert_eq!(refused(model(&followers)), "model.terms (channels)");
    let lags = names.map(|name| Term::new(powers(name, Signal::Lag { lag_s: 3.0 }, 0.0, 1)));
    assert_eq!(refused(model(&lags[..5])), "model.terms (pasts)");
    model(&lags[..4]).validate().unwrap();
}

#[test]
fn one_term_too_many_is_an_error() {
    let step = || term(Basis::Step(Step { t_s: 1.0 }), &[1.0]);
    let mut full = ErrorModel::default();
    for _ in 0..MAX_TERMS {
        full.add(step()).unwrap();
    }
    assert_eq!(full.add(step()), Err(TooMany));
}

#[test]
fn names_are_stable() {
    let name = |basis: Basis| Term::new(basis).to_string();
    let rate = |low_pass_s| Signal::Rate { samples: 30, curved: false, low_pass_s };
    assert_eq!(name(powers("temp_c", Signal::Value, 0.0, 2)), "temperature-quadratic");
    assert_eq!(name(powers("temp_c", rate(0.0), 0.0, 1)), "temperature-rate");
    assert_eq!(name(powers("supply_v", rate(9.0), 0.0, 1)), "channel-rate-low-pass");
    assert_eq!(Term::scaling(powers("supply_v", Signal::Value, 0.0, 1)).to_string(), "scale-channel");
    let settling = Basis::Settling(Settling { tau_s: 1.0, by: Size::Number, first_dwell: false });
    let product = Term::product(settling, powers("temp_c", Signal::Value, 0.0, 1));
    assert_eq!(product.to_string(), "settling-by-number-times-temperature");
}
