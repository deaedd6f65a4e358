//! Signs and special cases, by hand calculation.

use std::vec::Vec;

use super::accumulator::{Accumulator, Second, Taken};
use super::dwell::{DwellSummary, LevelLine, Line};
use super::*;
use crate::earth::earth_rate;
use crate::effects::{Conditions, ErrorModel, Sinusoid};
use crate::health::Flag;
use crate::sensing::index::Direction;
use crate::sensing::level::Specific;
use crate::units::wrap_180_deg;

/// Noise with a standard deviation of one, for tests that need no more: the sum of twelve uniform numbers less six.
pub fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// A dwell of 60 s at an index angle, beginning at `start_s`, with a fixed small scatter: 58 degrees of freedom at a
/// one-second noise of 0.09 °/h, the declared noise of the default settings.
pub fn dwell(start_s: f64, index_deg: f64, rate_deg_h: f64) -> DwellSummary {
    let (sin, cos) = crate::units::sin_cos_deg(index_deg);
    DwellSummary {
        seconds: 60.0,
        t_s: start_s + 30.0,
        start_s,
        end_s: start_s + 60.0,
        time_spread: 17_995.0,
        cos,
        sin,
        rate: Line {
            mean: rate_deg_h,
            slope_per_s: 0.0,
            residual_squares: 58.0 * 0.0081,
            successive_squares: 58.0 * 0.0081,
        },
        angle: None,
        level: Some([LevelLine::default(); 2]),
        degrees_of_freedom: 58,
        ..DwellSummary::default()
    }
}

fn dwells_at(rates: &[(f64, f64)]) -> Vec<DwellSummary> {
    (0..).zip(rates).map(|(i, &(index_deg, rate))| dwell(65.0 * f64::from(i), index_deg, rate)).collect()
}

pub fn declared(latitude_deg: f64) -> Declared {
    Declared {
        earth: earth_rate(latitude_deg).unwrap(),
        gyro: GyroSettings::default(),
        index_sigma_deg: 0.02,
        level_sigma_deg: 0.01,
        level_drift: crate::sensing::level::LevelSettings::default().drift(),
        calibrated: true,
        level_calibrated: true,
    }
}

fn solve_at(latitude_deg: f64, dwells: &[DwellSummary]) -> Fix {
    solve(dwells, &declared(latitude_deg), &ErrorModel::default()).unwrap()
}

fn assert_azimuth(solution: &Fix, azimuth_deg: f64, tolerance_deg: f64) {
    let error = wrap_180_deg(solution.azimuth_deg - azimuth_deg);
    assert!(error.abs() <= tolerance_deg, "{} instead of {azimuth_deg}", solution.azimuth_deg);
}

/// Level, at 60° (h = 7.5205335 °/h), azimuth 30°, bias 0.5 °/h: the axis points to azimuths 30°, −60°, −150°, 120° and
/// reads h·0.8660254, h·0.5, −h·0.8660254, −h·0.5 (plus bias).
const NORTH_EAST: [(f64, f64); 4] = [(0.0, 7.012973), (90.0, 4.260267), (180.0, -6.012973), (270.0, -3.260267)];

#[test]
fn the_axis_turns_counter_clockwise_and_azimuth_counts_clockwise() {
    let solution = solve_at(60.0, &dwells_at(&NORTH_EAST));
    assert_azimuth(&solution, 30.0, 1e-5);
    assert!((solution.bias_deg_h - 0.5).abs() < 1e-6);
    assert!((solution.amplitude_deg_h - 7.520534).abs() < 1e-5);
    assert!(solution.closure_deg_h.unwrap().abs() < 1e-6);
    assert_eq!(solution.flags, Flags::default());
}

#[test]
fn the_southern_hemisphere_finds_the_same_north() {
    assert_azimuth(&solve_at(-60.0, &dwells_at(&NORTH_EAST)), 30.0, 1e-5);
}

#[test]
fn the_four_position_arctangent_is_the_special_case() {
    // Any four rates of equal weight, also ones that do not close: atan2(ω90 − ω270, ω0 − ω180), closure
    // (ω0 + ω180 − ω90 − ω270)/4 = (7.1 − 6.0 − 4.2 + 3.3)/4 = 0.05. The declared drift is none.
    let rates = [(0.0, 7.1), (90.0, 4.2), (180.0, -6.0), (270.0, -3.3)];
    let mut declared = declared(60.0);
    declared.gyro.drift_deg_h_per_h = 0.0;
    declared.gyro.arw_deg_per_sqrt_h = 0.05;
    let solution = solve(&dwells_at(&rates), &declared, &ErrorModel::default()).unwrap();
    assert_azimuth(&solution, (4.2_f64 + 3.3).atan2(7.1 + 6.0).to_degrees(), 1e-9);
    assert!((solution.closure_deg_h.unwrap() - 0.05).abs() < 1e-12);
    assert!((solution.bias_deg_h - 0.5).abs() < 1e-9);
}

#[test]
fn nose_up_is_taken_out_with_its_sign() {
    // 60° north, azimuth 0, pitch 1° up. Forward axis: north component h cos 1°, up component Ω sin φ sin 1° =
    // 13.025946 · 0.0174524 = 0.2273341 °/h. The left axis stays level and points west: 0.
    let forward = 7.5205335 * 0.9998477 + 0.2273341;
    let mut tilted = dwells_at(&[(0.0, forward), (90.0, 0.0), (180.0, -forward), (270.0, 0.0)]);
    for dwell in &mut tilted {
        dwell.level = Some([LevelLine::still(0.0174524), LevelLine::default()]);
    }
    let solution = solve_at(60.0, &tilted);
    assert_azimuth(&solution, 0.0, 1e-5);
    assert!((solution.amplitude_deg_h - 7.520534).abs() < 1e-5, "{}", solution.amplitude_deg_h);
    assert!((solution.tilt.unwrap().pitch_deg - 1.0).abs() < 1e-5);
}

#[test]
fn left_side_up_is_taken_out_with_its_sign() {
    // The same with the left side up by 1°, azimuth 0: the left axis (index 90°) points west and rises by 1°, so it
    // reads +0.2273341; untreated that would turn the azimuth by tan φ · 1° = 1.73°.
    let mut tilted = dwells_at(&[(0.0, 7.5205335), (90.0, 0.2273341), (180.0, -7.5205335), (270.0, -0.2273341)]);
    let untreated = solve_at(60.0, &tilted);
    assert_azimuth(&untreated, 1.7315, 1e-3);
    for dwell in &mut tilted {
        dwell.level = Some([LevelLine::default(), LevelLine::still(0.0174524)]);
    }
    assert_azimuth(&solve_at(60.0, &tilted), 0.0, 1e-5);
}

#[test]
fn the_mirrored_order_is_blind_to_a_linear_drift_and_finds_it() {
    // Azimuth 30° as above, 0-90-180-270-270-180-90-0, with 3.6 °/h per hour: 0.001 °/h per second.
    let order = [0, 1, 2, 3, 3, 2, 1, 0];
    let mut dwells = dwells_at(&order.map(|i: usize| NORTH_EAST[i]));
    for dwell in &mut dwells {
        dwell.rate.mean += 0.001 * dwell.t_s;
        dwell.rate.slope_per_s += 0.001;
    }
    let solution = solve_at(60.0, &dwells);
    assert_azimuth(&solution, 30.0, 1e-5);
    assert!((solution.drift_deg_h_per_h - 3.6).abs() < 1e-6);
    assert!(solution.flags.contains(Flag::Drift));
}

#[test]
fn a_strong_drift_in_the_plain_order_is_estimated_and_flagged() {
    let mut dwells = dwells_at(&NORTH_EAST);
    for dwell in &mut dwells {
        dwell.rate.mean += 0.01 * dwell.t_s;
        dwell.rate.slope_per_s += 0.01;
    }
    let solution = solve_at(60.0, &dwells);
    assert_azimuth(&solution, 30.0, 1e-5);
    assert!(solution.flags.contains(Flag::Drift));
    // Free, the drift costs precision: the same noise without it gives a smaller sigma.
    assert!(solution.sigma_deg > solve_at(60.0, &dwells_at(&NORTH_EAST)).sigma_deg);
}

/// A forward accelerometer that reads a pitch which grows by 0.2 arcsec/s, with a noise of 3 arcsec.
fn pitching(dwells: &mut [DwellSummary]) {
    for dwell in dwells {
        let pitch = |t_s: f64| 0.2 * t_s / crate::units::ARCSEC_PER_RAD;
        let scatter = (58.0 * (3.0 / crate::units::ARCSEC_PER_RAD) * (3.0 / crate::units::ARCSEC_PER_RAD)) as f32;
        dwell.level = Some([
            LevelLine {
                mean: pitch(dwell.t_s) as f32,
                slope_per_s: pitch(1.0) as f32,
                residual_squares: scatter,
                successive_squares: scatter,
            },
            LevelLine { residual_squares: scatter, successive_squares: scatter, ..LevelLine::default() },
        ]);
    }
}

#[test]
fn a_base_that_turns_is_taken_out_with_its_sign() {
    // The base pitches nose up by 0.2 arcsec/s. At index 90° the axis points left; nose up is a negative rotation about
    // it, so the gyro reads −0.2 °/h more there and +0.2 at 270°. The accelerometers see the pitch grow with time. (A steady rate is held about
    // zero with the spread of the range of the tilt, which takes less than a thousandth of it away: 0.0002 of 7.52 °/h, 0.0015°.)
    let mut dwells = dwells_at(&NORTH_EAST);
    for dwell in &mut dwells {
        // Besides, the pitched axis feels the Earth's vertical rate, Ω sin 60° = 13.025946 °/h.
        dwell.rate.mean += -0.2 * dwell.sin + 13.025946 * 0.2 * dwell.t_s / crate::units::ARCSEC_PER_RAD * dwell.cos;
    }
    pitching(&mut dwells);
    let solution = solve_at(60.0, &dwells);
    assert!(solution.flags.contains(Flag::BaseMotion));
    assert_azimuth(&solution, 30.0, 1.5e-3);
}

/// The same readings, and the base stands: what would be taken out of the rates is −0.2 °/h at 90° and +0.2 at 270°, an azimuth that is off by 0.2/7.52 rad · cos 30°, 1.3°.
/// The levels change by 255 s of 0.2 arcsec/s, 51 arcsec. A model that knows the accelerometers to change by 26 arcsec leaves up to 52 to them; one that knows 25 does
/// not. Left in, only the vertical rate is taken out wrongly: at 225 s 45 arcsec of 13.03 °/h, 0.0028 °/h, which is 0.02° of azimuth.
#[test]
fn what_the_model_knows_the_accelerometers_to_change_by_is_no_motion() {
    let mut dwells = dwells_at(&NORTH_EAST);
    pitching(&mut dwells);
    let with = |level_drift_arcsec: f64| {
        solve(&dwells, &declared(60.0), &ErrorModel { level_drift_arcsec, ..ErrorModel::default() }).unwrap()
    };
    let known = with(26.0);
    assert!(known.flags.contains(Flag::LevelDrift) && !known.flags.contains(Flag::BaseMotion));
    assert_azimuth(&known, 30.0, 0.02);
    let beyond = with(25.0);
    assert!(beyond.flags.contains(Flag::BaseMotion), "{:?}", beyond.flags);
    assert_eq!(beyond, with(0.0));
}

/// An accelerometer that warms up reads a pitch of 0.005 t² arcsec, and the base stands still. A base that pitched so would turn the gyro by 0.01 t °/h
/// about its axis: at 90°, 90 s, by −0.9, and at 270°, 210 s, by +2.1 °/h; taken out of rates that know nothing of it that is an azimuth off by
/// 1.5/7.52 rad, 11°, and half of the difference, 0.6 °/h, at odds with the other two dwells. Left in, only the vertical rate is taken out
/// wrongly: at 150 s 112.5 arcsec of 13.03 °/h, 0.007 °/h, which is 0.03° of azimuth at most.
#[test]
fn accelerometers_that_drift_are_not_taken_for_a_base_that_turns() {
    let mut dwells = dwells_at(&NORTH_EAST);
    for dwell in &mut dwells {
        let arcsec = |arcsec: f64| (arcsec / crate::units::ARCSEC_PER_RAD) as f32;
        let scatter = 58.0 * arcsec(3.0) * arcsec(3.0);
        let still = LevelLine { residual_squares: scatter, successive_squares: scatter, ..LevelLine::default() };
        let pitch = [arcsec(0.005 * dwell.t_s * dwell.t_s), arcsec(0.01 * dwell.t_s)];
        dwell.level = Some([LevelLine { mean: pitch[0], slope_per_s: pitch[1], ..still }, still]);
    }
    let solution = solve_at(60.0, &dwells);
    assert!(!solution.flags.contains(Flag::BaseMotion) && solution.flags.contains(Flag::LevelDrift));
    assert_azimuth(&solution, 30.0, 0.03);
}

#[test]
fn sigma_is_the_white_noise_bound_when_nothing_else_is_declared() {
    let mut declared = declared(60.0);
    declared.gyro.bias_instability_deg_h = 0.0;
    declared.gyro.drift_deg_h_per_h = 0.0;
    declared.index_sigma_deg = 0.0;
    declared.level_sigma_deg = 0.0;
    let solution = solve(&dwells_at(&NORTH_EAST), &declared, &ErrorModel::default()).unwrap();
    // 60 √2 · 0.0015 / (7.5205335 · √240) = 1.0925e-3 rad = 0.062596°.
    assert!((solution.sigma_deg - 0.062596).abs() < 2e-5, "{}", solution.sigma_deg);
    assert!((white_noise_bound_deg(0.0015, 7.5205335, 240.0) - 0.062596).abs() < 1e-5);
}

#[test]
fn what_does_not_fit_is_flagged_and_widens_sigma() {
    let good = solve_at(60.0, &dwells_at(&NORTH_EAST));
    let mut rates = NORTH_EAST;
    rates[2].1 += 0.2;
    let bad = solve_at(60.0, &dwells_at(&rates));
    assert!(bad.flags.contains(Flag::Misfit) || bad.flags.contains(Flag::Drift), "{:?}", bad.flags);
    assert!(bad.sigma_deg > 1.5 * good.sigma_deg);
}

#[test]
fn noise_that_wanders_inside_the_stays_is_flagged_and_widens_sigma() {
    // Neighbours that differ by half of what white noise would show: correlation 1/2, variance of a mean times three.
    let mut dwells = dwells_at(&NORTH_EAST);
    let good = solve_at(60.0, &dwells);
    for dwell in &mut dwells {
        dwell.rate.successive_squares *= 0.5;
    }
    let wandering = solve_at(60.0, &dwells);
    assert!(wandering.flags.contains(Flag::Autocorrelated));
    assert!(wandering.sigma_deg > 1.5 * good.sigma_deg && wandering.azimuth_deg == good.azimuth_deg);
}

/// A drift of three sigma is as probable as none: the azimuth lies halfway between the one without a drift, whose error goes with the drift (3/2 of the error
/// at two sigma), and the one of a free drift, which has none; sigma holds half of what they differ by.
#[test]
fn an_undecided_drift_is_taken_by_its_probability() {
    let with_drift = |per_s: f64| {
        let mut dwells = dwells_at(&NORTH_EAST);
        for dwell in &mut dwells {
            dwell.rate.mean += per_s * dwell.t_s;
            dwell.rate.slope_per_s += per_s;
        }
        solve_at(60.0, &dwells)
    };
    let error_deg = |fix: &Fix| wrap_180_deg(fix.azimuth_deg - 30.0);
    let (mut least, mut most) = (0.0, 1e-2);
    for _ in 0..50 {
        let middle = 0.5 * (least + most);
        *(if with_drift(middle).flags.contains(Flag::Drift) { &mut most } else { &mut least }) = middle;
    }
    let [absent, two, three, there] = [0.0, 1.99 / 3.0, 1.0, 4.01 / 3.0].map(|share| with_drift(share * most));
    let apart_deg = error_deg(&two) * 3.0 / 1.99;
    assert!(apart_deg.abs() > absent.sigma_deg, "{apart_deg} {}", absent.sigma_deg);
    assert!((error_deg(&three) / apart_deg - 0.5).abs() < 0.01, "{} {apart_deg}", error_deg(&three));
    assert!(error_deg(&there).abs() < 1e-5 && there.flags.contains(Flag::Drift), "{}", error_deg(&there));
    let with_half = |sigma_deg: f64| sigma_deg.hypot(0.5 * apart_deg);
    assert!(
        (with_half(absent.sigma_deg)..with_half(there.sigma_deg)).contains(&three.sigma_deg),
        "{}",
        three.sigma_deg
    );
    assert!([two, three].iter().all(|fix| error_deg(fix).abs() < 4.0 * fix.sigma_deg));
    assert!(two.sigma_deg < 1.1 * absent.sigma_deg && !two.flags.contains(Flag::Drift));
}

#[test]
fn a_wrong_latitude_shows_in_the_amplitude() {
    // The rates of 60° taken for those of 50°: Ω cos 50° = 9.67 °/h against 7.52.
    assert!(solve_at(50.0, &dwells_at(&NORTH_EAST)).flags.contains(Flag::Amplitude));
}

/// An amplitude between what 0.9 and 1.1 of the Earth's rate give at latitudes 10° off is a doubt, one beyond them is no north:
/// at 60° 15.041067 · cos 70° · 0.9 = 4.63 and 15.041067 · cos 50° · 1.1 = 10.64 °/h, against 7.52.
#[test]
fn an_amplitude_that_nothing_explains_is_refused() {
    let of = |amplitude_deg_h: f64| {
        let share = amplitude_deg_h / 7.5205335;
        let rates = NORTH_EAST.map(|(index_deg, rate_deg_h)| (index_deg, 0.5 + share * (rate_deg_h - 0.5)));
        solve(&dwells_at(&rates), &declared(60.0), &ErrorModel::default())
    };
    for amplitude_deg_h in [5.2, 9.9] {
        assert!(of(amplitude_deg_h).unwrap().flags.contains(Flag::Amplitude));
    }
    for amplitude_deg_h in [3.76, 12.0] {
        assert_eq!(of(amplitude_deg_h), Err(Unsolvable::NotEarthRate));
    }
}

/// The axis of the first position points to azimuth 30°: a slip of +0.5° after it. A spindle that moved turns the gyro with
/// it, and the readings are right; an encoder that slipped reads half a degree too much from there on. In the mirrored order
/// of positions the rates tell: h sin(ψ − θ) · 0.5° is up to 0.066 °/h, and 60 s know a rate to 0.0116.
#[test]
fn a_slip_of_the_spindle_and_of_the_encoder_are_told_apart() {
    let order = [0, 1, 2, 3, 3, 2, 1, 0].map(|i: usize| NORTH_EAST[i]);
    let slipped = |encoder: bool| {
        let mut dwells = dwells_at(&order);
        for (place, dwell) in dwells.iter_mut().enumerate().skip(5) {
            dwell.slip_deg = 0.5;
            let index_deg = order[place].0 + 0.5;
            (dwell.sin, dwell.cos) = crate::units::sin_cos_deg(index_deg);
            if !encoder {
                dwell.rate.mean = 0.5 + 7.5205335 * libm::cos((30.0 - index_deg).to_radians());
            }
        }
        solve_at(60.0, &dwells)
    };
    let plain = solve_at(60.0, &dwells_at(&order));
    for encoder in [false, true] {
        let solution = slipped(encoder);
        assert!(solution.flags.contains(Flag::IndexSlip));
        assert_azimuth(&solution, 30.0, 1e-3);
        assert!(solution.sigma_deg < 1.05 * plain.sigma_deg, "{}", solution.sigma_deg);
    }
}

/// Slipped before the last of four positions, of which each was seen once: nothing tells, and sigma holds both.
#[test]
fn a_slip_that_cannot_be_told_widens_sigma() {
    let mut dwells = dwells_at(&NORTH_EAST);
    (dwells[3].slip_deg, (dwells[3].sin, dwells[3].cos)) = (0.5, crate::units::sin_cos_deg(270.5));
    let solution = solve_at(60.0, &dwells);
    assert!(solution.flags.contains(Flag::IndexSlip));
    let error_deg = wrap_180_deg(solution.azimuth_deg - 30.0).abs();
    assert!(error_deg < 1.5 * solution.sigma_deg && solution.sigma_deg < 0.5, "{error_deg} {}", solution.sigma_deg);
}

/// The declared limit of the bias is 1 °/h.
#[test]
fn a_bias_beyond_its_limit_is_flagged() {
    let flagged = |bias_deg_h: f64| {
        let rates = NORTH_EAST.map(|(index_deg, rate_deg_h)| (index_deg, rate_deg_h + bias_deg_h - 0.5));
        solve_at(60.0, &dwells_at(&rates)).flags.contains(Flag::Bias)
    };
    assert_eq!([-1.5, -0.9, 0.9, 1.5].map(flagged), [true, false, false, true]);
}

#[test]
fn a_dead_gyro_finds_no_north() {
    let dead = [0.0, 90.0, 180.0, 270.0].map(|index_deg| (index_deg, 0.0));
    let mut dwells = dwells_at(&dead);
    dwells.iter_mut().for_each(|dwell| dwell.rate = Line::default());
    assert_eq!(solve(&dwells, &declared(60.0), &ErrorModel::default()), Err(Unsolvable::NoSignal));
}

#[test]
fn too_little_is_refused() {
    let refusal = |rates: &[(f64, f64)]| solve(&dwells_at(rates), &declared(60.0), &ErrorModel::default()).unwrap_err();
    assert_eq!(refusal(&[]), Unsolvable::TooFewDirections);
    assert_eq!(refusal(&NORTH_EAST[..2]), Unsolvable::TooFewDirections);
    assert_eq!(refusal(&[(0.0, 1.0), (180.0, -1.0), (0.0, 1.0), (180.0, -1.0)]), Unsolvable::TooFewDirections);
    assert_eq!(refusal(&[(0.0, 0.5), (90.0, 0.5), (180.0, 0.5), (270.0, 0.5)]), Unsolvable::NoSignal);
}

#[test]
fn three_positions_have_an_azimuth_but_no_redundancy() {
    // 0°, 120°, 240° at azimuth 0: h·1, h·cos 120° = −h/2 twice.
    let solution = solve_at(60.0, &dwells_at(&[(0.0, 7.5205335), (120.0, -3.7602668), (240.0, -3.7602668)]));
    assert_azimuth(&solution, 0.0, 1e-5);
    assert_eq!(solution.closure_deg_h, None);
}

#[test]
fn positions_between_the_quarters_have_no_closure() {
    // h cos 45° = 5.3178202 at azimuth 0.
    let solution =
        solve_at(60.0, &dwells_at(&[(45.0, 5.3178202), (135.0, -5.3178202), (225.0, -5.3178202), (315.0, 5.3178202)]));
    assert_azimuth(&solution, 0.0, 1e-5);
    assert_eq!(solution.closure_deg_h, None);
}

#[test]
fn east_and_west_are_where_the_axis_points_there() {
    // α = ψ − θ: with ψ = 30° the axis points to 90° at θ = −60° = 300°, to 270° at θ = 120°.
    assert_eq!((east_index_deg(30.0), west_index_deg(30.0)), (300.0, 120.0));
}

/// A line of 0.3 °/h, its phase one radian, on the dwells of an azimuth of 30°; means and slopes by summing hundredths of a
/// second. Without it known, it turns the azimuth by 0.3/7.5 rad or so; with period and amplitude known it is estimated.
#[test]
fn a_line_of_unknown_phase_is_estimated() {
    let mut dwells = dwells_at(&NORTH_EAST);
    for dwell in &mut dwells {
        let (mut mean, mut with_time, mut squares) = (0.0, 0.0, 0.0);
        for i in 0..6000 {
            let from_middle_s = f64::from(i) / 100.0 - 29.995;
            let value = 0.3 * libm::cos(core::f64::consts::TAU * (dwell.t_s + from_middle_s) / 190.0 - 1.0);
            mean += value / 6000.0;
            with_time += from_middle_s * value;
            squares += from_middle_s * from_middle_s;
        }
        dwell.rate.mean += mean;
        dwell.rate.slope_per_s += with_time / squares;
    }
    let without = solve_at(60.0, &dwells);
    assert!(wrap_180_deg(without.azimuth_deg - 30.0).abs() > 0.5, "{}", without.azimuth_deg);
    let sinusoid = Some(Sinusoid { period_s: 190.0, amplitude_deg_h: 0.3 });
    let model = ErrorModel { sinusoid, ..Default::default() };
    let with = solve(&dwells, &declared(60.0), &model).unwrap();
    // The amplitude's spread draws the parts towards zero by a little.
    assert_azimuth(&with, 30.0, with.sigma_deg);
    assert!(with.sigma_deg < 0.5, "{}", with.sigma_deg);
}

/// The accelerometers warm by 0.01 K/s while the gyro's temperature stands: their drift follows their own thermometer, and the gyro's where they have
/// none. At 11 s, the middle of seconds 1 to 21, they are at 20.11 °C.
#[test]
fn the_levels_drift_with_their_own_temperature() {
    let temperature_of = |level_c: fn(f64) -> Option<f64>| {
        let mut gathered = Accumulator::empty(heapless::Vec::<DwellSummary, 4>::new());
        gathered.set_up(declared(45.0), &mut ErrorModel::default());
        for t_s in (1..=21).map(f64::from) {
            let index = Some(Direction::of_deg(0.0));
            // The last second has no levels: no temperature of theirs either, and the gyro's is none of theirs.
            let level = Specific::new(0.0, 0.0).filter(|_| t_s < 21.0);
            let conditions = Conditions { t_s, index, level, temp_c: Some(30.0), ..Conditions::default() };
            let level_temp_c = level_c(t_s).filter(|_| level.is_some());
            let second = Second { conditions, level_temp_c, ..Second::default() };
            let corrected = gathered.correct(&second);
            assert_eq!(gathered.collect(&corrected), Taken::Collected);
        }
        gathered.end_dwell().unwrap().temperature
    };
    let own = temperature_of(|t_s| Some(20.0 + 0.01 * t_s));
    assert!((own.kelvin - 293.26).abs() < 1e-4 && (own.kelvin_per_s - 0.01).abs() < 1e-6, "{own:?}");
    let of_gyro = temperature_of(|_| None);
    assert!((of_gyro.kelvin - 303.15).abs() < 1e-4 && of_gyro.kelvin_per_s.abs() < 1e-6, "{of_gyro:?}");
}
