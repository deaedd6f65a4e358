use quantities::earth::{EARTH_RATE_DEG_H, LatitudeError};

use super::*;
use std::vec::Vec;

const LATITUDE_DEG: f64 = 34.75;
/// cos 34.75° = 0.821647, sin 34.75° = 0.569997.
const NORTH: f64 = EARTH_RATE_DEG_H * 0.821_647;
const UP: f64 = EARTH_RATE_DEG_H * 0.569_997;

fn knowledge() -> Knowledge {
    Knowledge { latitude_deg: LATITUDE_DEG, table_arcsec: 0.0, bias_instability_deg_h: 0.0 }
}

fn position(axes: &str, rate_deg_h: [f64; 3]) -> Position {
    let dwell = Dwell { rate_deg_h, variance: [1e-6; 3], wander: [7.0; 3], rows: 600, left_out: 0, turned: None };
    Position { axes: Axes::parse(axes).unwrap(), dwell }
}

/// The six positions with inputs written out by hand, through a triad whose gyros read what `output` says.
fn six(output: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Position> {
    [
        ("ENU", [0.0, NORTH, UP]),
        ("WSU", [0.0, -NORTH, UP]),
        ("WND", [0.0, NORTH, -UP]),
        ("NED", [NORTH, 0.0, -UP]),
        ("SWD", [-NORTH, 0.0, -UP]),
        ("NWU", [NORTH, 0.0, UP]),
    ]
    .map(|(axes, input)| position(axes, output(input)))
    .to_vec()
}

fn published_of(positions: &[Position]) -> published::Published {
    let rates: Vec<_> = positions.iter().map(|position| position.dwell.rate_deg_h).collect();
    published::differences(rates.as_slice().try_into().unwrap(), LATITUDE_DEG).unwrap()
}

#[test]
fn every_parameter_has_its_place_and_sign() {
    // x: bias +0.5, turned a little towards y: reads +0.002 of a rotation about y.
    // y: bias −0.25, scale factor 1.001. z: reads −0.003 of a rotation about x.
    let positions = six(|[x, y, z]| [0.5 + x + 0.002 * y, -0.25 + 1.001 * y, z - 0.003 * x]);
    let expected = [[1.0, 0.002, 0.0], [0.0, 1.001, 0.0], [-0.003, 0.0, 1.0]];
    let solved = solve(&positions, &knowledge()).unwrap();
    let formulas = published_of(&positions);
    for (found, bias) in [(solved.matrix, solved.bias_deg_h), (formulas.matrix, formulas.bias_deg_h)] {
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 2e-6, "{found} {expected}");
        }
        for (found, expected) in bias.into_iter().zip([0.5, -0.25, 0.0]) {
            assert!((found - expected).abs() < 2e-5, "{found} {expected}");
        }
    }
}

#[test]
fn six_closures_are_left_and_sigmas_follow_by_hand() {
    let solved = solve(&six(|input| input), &knowledge()).unwrap();
    assert_eq!(solved.closure.count, 6);
    // Six rows with (1, x, y, z): x is in rows 4, 5, 6 as (c, −c, c), y in 1, 2, 3 as (c, −c, c), z as (s, s, −s, −s, −s, s).
    // Normal matrix in (bias, x, y, z) with c and s divided out:
    // [[6, 1, 1, 0], [1, 3, 0, 1], [1, 0, 3, −1], [0, 1, −1, 6]]; its inverse has the diagonal 3/16, 3/8, 3/8, 3/16.
    let sigma = 1e-3;
    let bias = sigma * (3.0_f64 / 16.0).sqrt();
    let about = [(3.0_f64 / 8.0).sqrt() / NORTH, (3.0_f64 / 8.0).sqrt() / NORTH, (3.0_f64 / 16.0).sqrt() / UP];
    for gyro in 0..3 {
        assert!((solved.sigma_bias_deg_h[gyro] / bias - 1.0).abs() < 1e-4, "{}", solved.sigma_bias_deg_h[gyro] / bias);
        for (found, expected) in solved.sigma_matrix[gyro].iter().zip(about) {
            assert!((found / (sigma * expected) - 1.0).abs() < 1e-4);
        }
    }
    // The differences have σ/√2 for the bias and σ/√2 over c and s for the responses: 3/16 and 3/8 are below 1/2.
}

#[test]
fn the_closure_is_the_rms_of_what_is_left() {
    // An error e of x in position 2. The two closures of a gyro are N2 + N3 − N5 − N6 and N1 − N3 − N6 + N4, each with a
    // variance of 4σ², and independent (their product is −1 + 1 = 0). So chi² = e²/4σ² and the squares e²/4 over 6.
    let mut positions = six(|input| input);
    positions[1].dwell.rate_deg_h[0] += 2e-3;
    let closure = solve(&positions, &knowledge()).unwrap().closure;
    assert!((closure.rms_deg_h.unwrap() - (1e-6_f64 / 6.0).sqrt()).abs() < 2e-6, "{closure:?}");
    // Q(1 | 6) = e^−1/2 (1 + 1/2 + 1/8) = 0.9856.
    assert!((closure.p_value.unwrap() - 0.9856).abs() < 1e-2, "{closure:?}");
}

#[test]
fn a_closure_that_is_not_noise_is_refused_with_the_suspects() {
    let mut positions = six(|input| input);
    positions[2].dwell.rate_deg_h[1] += 0.05;
    // Position 3 alone is in both closures with these signs.
    let Err(Refusal::Closure { p_value, suspects, .. }) = solve(&positions, &knowledge()) else { panic!() };
    assert!(p_value < 1e-9);
    assert_eq!(suspects, 1 << 2);
    // An error of position 2 leaves the same as the opposite one of position 5.
    let mut positions = six(|input| input);
    positions[1].dwell.rate_deg_h[1] += 0.05;
    let Err(Refusal::Closure { suspects, .. }) = solve(&positions, &knowledge()) else { panic!() };
    assert_eq!(suspects, 1 << 1 | 1 << 4);
}

#[test]
fn two_positions_whose_axes_are_exchanged_are_named() {
    let six = six(|input| input);
    for one in 0..6 {
        for other in one + 1..6 {
            let mut positions = six.clone();
            (positions[one].axes, positions[other].axes) = (six[other].axes, six[one].axes);
            let refusal = solve(&positions, &knowledge()).unwrap_err();
            // Positions 1 and 4 are in the closures N2 + N3 − N5 − N6 and N1 − N3 − N6 + N4 with the same sign: their exchange changes neither.
            if (one, other) == (0, 3) {
                assert!(matches!(refusal, Refusal::LatitudeContradicts { .. }), "{refusal}");
                continue;
            }
            let Refusal::Closure { exchanged, .. } = refusal else { panic!("{one} {other}: {refusal}") };
            assert_eq!(exchanged, Some((one, other)), "{refusal}");
        }
    }
    // A single wrong reading is no exchange.
    let mut positions = six.clone();
    positions[2].dwell.rate_deg_h[1] += 0.05;
    assert!(matches!(solve(&positions, &knowledge()), Err(Refusal::Closure { exchanged: None, .. })));
}

#[test]
fn a_table_that_does_not_stand_to_the_north_is_refused() {
    // Turned by 2° about the vertical: north turns to east.
    let (sin, cos) = (0.034_899_5, 0.999_390_8);
    let turned: Vec<_> = [
        ("ENU", [sin * NORTH, cos * NORTH, UP]),
        ("WSU", [-sin * NORTH, -cos * NORTH, UP]),
        ("WND", [-sin * NORTH, cos * NORTH, -UP]),
        ("NED", [cos * NORTH, sin * NORTH, -UP]),
        ("SWD", [-cos * NORTH, -sin * NORTH, -UP]),
        ("NWU", [cos * NORTH, -sin * NORTH, UP]),
    ]
    .map(|(axes, input)| position(axes, input))
    .to_vec();
    assert!(matches!(solve(&turned, &knowledge()), Err(Refusal::Closure { .. })));
}

#[test]
fn undetermined_parameters_are_named() {
    let refusal = |positions: &[Position]| match solve(positions, &knowledge()) {
        Err(Refusal::Undetermined(parameters)) => parameters,
        other => panic!("{other:?}"),
    };
    let positions = six(|input| input);
    // z always up: bias and the response about z cannot be told apart.
    let up = [positions[0], positions[1], positions[5], position("SEU", [-NORTH, 0.0, UP])];
    assert_eq!(refusal(&up), Undetermined { bias: true, about: [false, false, true] });
    assert_eq!(refusal(&positions[..1]), Undetermined { bias: true, about: [true, true, true] });
    // Without 4, 5 and 6 nothing turns about x.
    let undetermined = refusal(&positions[..3]);
    assert_eq!(undetermined.about, [true, false, false]);
}

#[test]
fn four_positions_determine_all_and_leave_no_closure() {
    let positions = six(|[x, y, z]| [x + 0.1, y, 0.999 * z]);
    let solved = solve(&[positions[0], positions[1], positions[2], positions[3]], &knowledge()).unwrap();
    assert_eq!(solved.closure, Closure { count: 0, rms_deg_h: None, p_value: None });
    assert!((solved.matrix[2][2] - 0.999).abs() < 1e-5);
}

#[test]
fn any_set_that_determines_the_parameters_will_do() {
    // Each axis up, down, north and south at least once, in an order of its own.
    let output = |[x, y, z]: [f64; 3]| [1.0 + 0.002 * z + x, y, 1.01 * z + 0.001 * y];
    let sets = [
        ("UEN", [UP, 0.0, NORTH]),
        ("DWN", [-UP, 0.0, NORTH]),
        ("NUE", [NORTH, UP, 0.0]),
        ("SDE", [-NORTH, -UP, 0.0]),
        ("ENU", [0.0, NORTH, UP]),
        ("ESD", [0.0, -NORTH, -UP]),
        ("EUS", [0.0, UP, -NORTH]),
    ];
    let positions: Vec<_> = sets.into_iter().map(|(axes, input)| position(axes, output(input))).collect();
    let solved = solve(&positions, &knowledge()).unwrap();
    assert_eq!(solved.closure.count, 9);
    assert!((solved.matrix[0][2] - 0.002).abs() < 1e-5 && (solved.matrix[2][1] - 0.001).abs() < 1e-5);
    assert!((solved.matrix[2][2] - 1.01).abs() < 1e-5 && (solved.bias_deg_h[0] - 1.0).abs() < 1e-4);
}

#[test]
fn a_latitude_that_contradicts_the_data_is_refused() {
    let positions = six(|input| input);
    for (declared_deg, about_deg) in [(-34.75, 34.75), (37.0, 34.75), (55.75, 34.75)] {
        let knowledge = Knowledge { latitude_deg: declared_deg, ..knowledge() };
        match solve(&positions, &knowledge) {
            Err(Refusal::LatitudeContradicts { found_deg, sigma_deg, .. }) => {
                assert!((found_deg - about_deg).abs() < 0.5, "{declared_deg}: {found_deg}");
                assert!(sigma_deg < 0.5);
            }
            other => panic!("{declared_deg}: {other:?}"),
        }
    }
    // All scale factors 3 % low is not a latitude; nor are scale factors that differ by 1 %.
    assert!(solve(&six(|input| input.map(|rate| 0.97 * rate)), &knowledge()).is_ok());
    assert!(solve(&six(|[x, y, z]| [x, y, 1.01 * z]), &knowledge()).is_ok());
}

#[test]
fn with_axes_both_level_and_upright_a_small_contradiction_shows() {
    // Nine positions in which every axis feels both parts: 0.2° is found, whatever the scale factors are.
    let mut positions = six(|[x, y, z]| [1.01 * x, 0.99 * y, z]);
    for (axes, [x, y, z]) in
        [("UEN", [UP, 0.0, NORTH]), ("EUS", [0.0, UP, -NORTH]), ("DWN", [-UP, 0.0, NORTH]), ("WDS", [0.0, -UP, -NORTH])]
    {
        positions.push(position(axes, [1.01 * x, 0.99 * y, z]));
    }
    assert!(solve(&positions, &knowledge()).is_ok());
    let knowledge = Knowledge { latitude_deg: LATITUDE_DEG + 0.2, ..knowledge() };
    match solve(&positions, &knowledge) {
        Err(Refusal::LatitudeContradicts { found_deg, .. }) => assert!((found_deg - LATITUDE_DEG).abs() < 0.02),
        other => panic!("{other:?}"),
    }
}

#[test]
fn exchanged_gyros_are_refused() {
    // The consistent exchange of x and y closes perfectly.
    assert!(matches!(
        solve(&six(|[x, y, z]| [y, x, z]), &knowledge()),
        Err(Refusal::NotItsAxis { gyro: 0, about: 0, .. })
    ));
}

#[test]
fn at_the_equator_the_vertical_response_of_the_six_positions_is_missing() {
    let knowledge = Knowledge { latitude_deg: 0.0, ..knowledge() };
    let Err(Refusal::Undetermined(parameters)) = solve(&six(|input| input), &knowledge) else { panic!() };
    assert_eq!(parameters, Undetermined { bias: false, about: [false, false, true] });
    let near = Knowledge { latitude_deg: 89.5, ..knowledge };
    assert_eq!(solve(&six(|input| input), &near), Err(Refusal::Latitude(LatitudeError::NearPole)));
}

#[test]
fn wandering_rates_widen_the_sigmas() {
    let still = solve(&six(|input| input), &knowledge()).unwrap();
    let mut positions = six(|input| input);
    for position in &mut positions {
        position.dwell.wander = [28.0, 7.0, 7.0];
    }
    let wandering = solve(&positions, &knowledge()).unwrap();
    // 28 over 7 degrees of freedom: variances times four.
    assert!((wandering.sigma_bias_deg_h[0] / still.sigma_bias_deg_h[0] - 2.0).abs() < 1e-9);
    assert!((wandering.sigma_bias_deg_h[1] / still.sigma_bias_deg_h[1] - 1.0).abs() < 1e-9);
}

#[test]
fn a_table_is_the_floor() {
    let mut positions = six(|input| input);
    for position in &mut positions {
        position.dwell.variance = [0.0; 3];
    }
    assert_eq!(solve(&positions, &knowledge()), Err(Refusal::NoScatter { position: 0 }));
    let knowledge = Knowledge { table_arcsec: 3.0, ..knowledge() };
    let solved = solve(&positions, &knowledge).unwrap();
    // z in every position feels the table through the level rate alone: 3/√3 arcsec · 12.36 °/h = 1.0e-4 °/h.
    let of_a_mean = 3.0 / 3.0_f64.sqrt() / 206_264.8 * NORTH;
    assert!((solved.sigma_bias_deg_h[2] / (of_a_mean * (3.0_f64 / 16.0).sqrt()) - 1.0).abs() < 1e-3);
}
