//! Every term by hand calculation.

use super::spline::Numbers;
use super::*;
use crate::index::Direction;
use crate::level::Specific;

fn model(terms: &[Term]) -> ErrorModel {
    ErrorModel { terms: Vec::from_slice(terms).unwrap(), ..Default::default() }
}

fn conditions(t_s: f64, index_deg: f64) -> Conditions {
    Conditions { t_s, index: Some(Direction::of_deg(index_deg)), temp_c: Some(20.0), ..Default::default() }
}

/// The bias that one term gives in the last of a run of conditions.
fn last_bias(term: Term, run: impl IntoIterator<Item = Conditions>) -> f64 {
    let mut evaluator = Evaluator::new(model(&[term]));
    run.into_iter().map(|each| evaluator.second(&each).bias_deg_h).last().unwrap()
}

fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
}

#[test]
fn bias_scale_and_temperature() {
    let mut model = model(&[
        Term::Temperature { reference_c: 20.0, linear_deg_h_per_k: 0.1, quadratic_deg_h_per_k2: 0.01 },
        Term::TemperatureRate { deg_h_per_k_per_s: 9.0 },
        Term::ScaleTemperature { reference_c: 20.0, per_k: 0.001 },
    ]);
    model.scale_error = 0.01;
    model.bias_deg_h = 0.5;
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
fn a_rate_waits_for_ten_seconds_and_starts_again_after_a_gap() {
    let mut evaluator = Evaluator::new(model(&[Term::TemperatureRate { deg_h_per_k_per_s: 1.0 }]));
    let mut second = |t_s: f64, temp_c| evaluator.second(&Conditions { t_s, temp_c, ..Default::default() });
    for i in 0..9 {
        assert!(second(f64::from(i), Some(0.1 * f64::from(i))).waiting);
    }
    let tenth = second(9.0, Some(0.9));
    assert!(!tenth.waiting);
    assert_close(tenth.bias_deg_h, 0.1);
    assert!(second(10.0, None).waiting);
}

#[test]
fn a_named_channel_with_its_powers_lag_and_low_pass() {
    let channel = ChannelName::new("supply_v").unwrap();
    let cubic = |lag_s, low_pass_s| Term::Channel {
        channel,
        lag_s,
        low_pass_s,
        reference: 24.0,
        linear_deg_h: 1.0,
        quadratic_deg_h: 0.5,
        cubic_deg_h: 0.25,
    };
    let ramp = (0..8).map(|i| {
        let mut each = conditions(f64::from(i), 0.0);
        each.channels[0] = 19.0 + f64::from(i);
        each
    });
    // At the end 26 V, u = 2: 2 + 0.5 · 4 + 0.25 · 8 = 6. Five seconds before 21 V, u = −3: −3 + 4.5 − 6.75 = −5.25.
    assert_close(last_bias(cubic(0.0, 0.0), ramp.clone()), 6.0);
    assert_close(last_bias(cubic(5.0, 0.0), ramp), -5.25);
    // A step from 24 to 25 V one second ago through a low-pass of 2 s: u = 1 − e^−0.5.
    let step = [24.0, 25.0].into_iter().zip([0.0, 1.0]).map(|(volts, t_s)| {
        let mut each = conditions(t_s, 0.0);
        each.channels[0] = volts;
        each
    });
    let u = 0.3934693402873666;
    assert_close(last_bias(cubic(0.0, 2.0), step), u + 0.5 * u * u + 0.25 * u * u * u);
    assert_eq!(model(&[cubic(0.0, 0.0)]).off_board(), Some(channel));
}

#[test]
fn time_since_switch_on() {
    let at = |term, t_s| last_bias(term, [conditions(t_s, 0.0)]);
    assert_close(at(Term::Drift { deg_h_per_h: 2.0, deg_h_per_h2: 4.0 }, 1800.0), 2.0);
    assert_close(at(Term::WarmUp { deg_h: 2.0, tau_s: 100.0 }, 100.0), 2.0 * 0.36787944117144233);
    assert_close(at(Term::Step { t_s: 50.0, deg_h: 0.3 }, 49.0), 0.0);
    assert_close(at(Term::Step { t_s: 50.0, deg_h: 0.3 }, 50.25), 0.3 * 0.75);
    assert_close(at(Term::Line { period_s: 40.0, cos_deg_h: 0.1, sin_deg_h: 0.2 }, 10.0), 0.2);
}

#[test]
fn settling_after_a_move() {
    let settling = Term::Settling {
        tau_s: 10.0,
        first_stay: false,
        deg_h: 0.1,
        by_direction_deg_h: 0.2,
        deg_h_per_deg_travel: 0.01,
        deg_h_per_deg_signed_travel: 0.002,
        cos_deg_h: 0.5,
        sin_deg_h: 0.3,
    };
    assert_close(last_bias(settling, [conditions(0.5, 0.0)]), 0.0);
    // From 0° to 270° is a quarter turn clockwise; rest began with the row at 1.0 s, and the middle of the row at 10.5 s is
    // 9.5 s later: (0.1 − 0.2 + 0.9 − 0.18 + 0 − 0.3) · e^−0.95.
    let run = [conditions(0.5, 0.0), conditions(1.5, 270.0), conditions(10.5, 270.0)];
    assert_close(last_bias(settling, run), 0.32 * 0.38674102345450123);
    // Back again at once: of the first move e^−1.95 is left at 20.5 s, of the second, which began to rest at 11 s, e^−0.95:
    // 0.1 + 0.2 + 0.9 + 0.18 + 0.5.
    let run = [conditions(0.5, 0.0), conditions(1.5, 270.0), conditions(10.5, 270.0), conditions(11.5, 0.0)];
    let later = run.into_iter().chain([conditions(20.5, 0.0)]);
    assert_close(last_bias(settling, later), 0.32 * 0.1422740715865136 + 1.88 * 0.38674102345450123);
}

#[test]
fn a_rate_at_the_end_of_a_curve() {
    // t² at 0, 1 … 5 s: a straight line has the slope of its middle, 5; at the end it is 10.
    let mut past = History::default();
    (0..6).for_each(|t| past.push(f64::from(t), Some(f64::from(t * t)), 0.0));
    assert_close(past.rate(6, false).unwrap(), 5.0);
    assert_close(past.rate(6, true).unwrap(), 10.0);
}

#[test]
fn a_curve_in_a_channel() {
    // Of knots at 0, 1 and 3: 2 · 2 + 9 · (2³ − 1 · 3/2)/9, as in the spline's own test.
    let term = Term::ChannelSpline {
        channel: ChannelName::new("supply_v").unwrap(),
        knots: Numbers::new(&[0.0, 1.0, 3.0]).unwrap(),
        coefficients: Numbers::new(&[2.0, 9.0]).unwrap(),
    };
    let mut evaluator = Evaluator::new(model(&[term]));
    let mut now = conditions(0.5, 0.0);
    now.channels[0] = 2.0;
    assert_close(evaluator.second(&now).bias_deg_h, 4.0 + 6.5);
    let unsorted = Term::ChannelSpline {
        channel: ChannelName::new("supply_v").unwrap(),
        knots: Numbers::new(&[0.0, 3.0, 1.0]).unwrap(),
        coefficients: Numbers::new(&[2.0, 9.0]).unwrap(),
    };
    assert_eq!(model(&[unsorted]).validate().unwrap_err().field, "model.terms.channel-spline.knots");
}

#[test]
fn index_and_rate() {
    let harmonic = Term::BodyHarmonic { order: 2, cos_deg_h: 0.1, sin_deg_h: 0.2 };
    assert_close(last_bias(harmonic, [conditions(0.0, 45.0)]), 0.2);
    let rate = |term, raw_rate_deg_h| last_bias(term, [Conditions { raw_rate_deg_h, ..conditions(0.0, 0.0) }]);
    // True −9 less 1: 0.01 · 100 − 0.002 · 1000 = −1 is added, which makes −10.
    let curved = Term::RateNonlinearity { centre_deg_h: 1.0, quadratic_per_deg_h: 0.01, cubic_per_deg_h2: 0.002 };
    assert_close(rate(curved, -10.0), -1.0);
    // Lost at the width is the depth, whatever the form; at twice the width 2 e^−1.5, 2/e, 4/5 and 2 − √3 of it.
    let forms = [
        (DeadZoneForm::Short, 0.4462603202968596),
        (DeadZoneForm::Middle, 0.7357588823428847),
        (DeadZoneForm::Long, 0.8),
        (DeadZoneForm::Lock, 0.2679491924311228),
    ];
    for (form, at_two) in forms {
        let term = Term::DeadZone { centre_deg_h: 0.5, depth_deg_h: 0.2, width_deg_h: 3.0, form };
        // True −2.5, a loss of 0.2 towards zero: −2.3; the slope of the last form is vertical there, and its root so much less
        // certain. True 6.5: less by the share at two.
        assert!((rate(term, -2.3) - 0.2).abs() < 1e-8);
        assert_close(rate(term, 6.5 - 0.2 * at_two), -0.2 * at_two);
    }
    // A gyro that nearly stands still about zero: 0.9 of the rate is lost. True 0.1 reads 0.01.
    let deaf = Term::DeadZone { centre_deg_h: 0.0, depth_deg_h: 1.8, width_deg_h: 2.0, form: DeadZoneForm::Lock };
    assert_close(rate(deaf, 0.01), -0.09);
}

#[test]
fn index_error_and_earth_field_turn_the_answer() {
    let offset = model(&[Term::IndexError { offset_deg: 10.0, cos_deg: 0.0, sin_deg: 0.0 }]);
    // Measured 40°, too large by 10°: truly 30°.
    let Direction { cos, sin } = offset.true_index(Direction { cos: 0.766_044_443_118_978, sin: 0.6427876096865394 });
    assert_close(cos, 0.8660254037844387);
    assert_close(sin, 0.5);
    // h = 7.5205335 at 60°; an east field of the same size turns the apparent azimuth by −45°.
    let earth = crate::earth::earth_rate(60.0).unwrap();
    let field = model(&[Term::EarthField { east_deg_h: earth.north_deg_h, north_deg_h: 0.0 }]);
    assert_close(field.true_azimuth_deg(330.0, &earth), 15.0);
}

#[test]
fn accelerometers_are_channels_too() {
    let term = Term::ScaleChannel { channel: ChannelName::new("ay_g").unwrap(), reference: 0.0, per_unit: 2.0 };
    let mut evaluator = Evaluator::new(model(&[term]));
    let level = Specific::new(0.0, 0.01);
    assert_close(evaluator.second(&Conditions { level, ..Default::default() }).scale, 1.02);
}

#[test]
fn nonsense_is_named() {
    let scale = ErrorModel { scale_error: 0.5, ..Default::default() };
    assert_eq!(scale.validate().unwrap_err().field, "model.scale_error");
    let bias = ErrorModel { bias_deg_h: f64::NAN, ..Default::default() };
    assert_eq!(bias.validate().unwrap_err().field, "model.bias_deg_h");
    let timeless = model(&[Term::WarmUp { deg_h: 1.0, tau_s: 0.0 }]);
    assert_eq!(timeless.validate().unwrap_err().field, "model.terms.warm-up.tau_s");
    let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i"];
    let terms = names.map(|name| Term::ScaleChannel {
        channel: ChannelName::new(name).unwrap(),
        reference: 0.0,
        per_unit: 0.0,
    });
    assert_eq!(model(&terms).validate().unwrap_err().field, "model.terms");
}
