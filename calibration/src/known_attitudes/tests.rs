use super::*;
use std::vec::Vec;

const UP: [[f64; 3]; 6] =
    [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
const G: f64 = 9.81;

/// Ten readings an attitude with a standard deviation of 0.003: 0.00095 of their mean.
fn position(up: [f64; 3], mean: [f64; 3]) -> Position {
    let squares = [9.0 * 0.003 * 0.003; 3];
    Position { up, attitude: Attitude { mean, squares, readings: 10, dropped: 0 } }
}

/// Bias 0.1, −0.2, 0; scale factors 1.02, 0.99, 1; y reads 0.01 of what is along x.
fn six() -> Vec<Position> {
    let read = |[x, y, z]: [f64; 3]| [0.1 + 1.02 * x, -0.2 + 0.99 * y + 0.01 * x, z];
    UP.iter().map(|up| position(*up, read(up.map(|part| G * part)))).collect()
}

#[test]
fn own_pairs_by_hand() {
    let found = solve(&six(), G, Attitudes::Rough).unwrap();
    // x up reads 0.1 + 1.02·9.81 = 10.1062, x down −9.9062: half the sum 0.1, half the difference 10.0062 = 1.02·9.81.
    for (found, expected) in found.bias.iter().zip([0.1, -0.2, 0.0]) {
        assert!((found - expected).abs() < 1e-12);
    }
    for (row, (found, expected)) in found.response.iter().zip([1.02, 0.99, 1.0]).enumerate() {
        assert!((found[row] - expected).abs() < 1e-12);
        assert_eq!(found.iter().filter(|part| **part == 0.0).count(), 2);
    }
    // Two means of 0.00095: bias ± 0.00095/√2, scale ± 0.00095/√2/9.81. y reads 0.01 of G across where x is up or down: a lean of 0.01/0.99 rad, and
    // 1.02 · 9.81 times half of its square too little, twice squared.
    let of_mean = 0.003 / 10f64.sqrt();
    let lean: f64 = 0.01 / 0.99;
    let deficit = 1.02 * G * lean * lean / 2.0;
    assert!((found.greatest_lean_rad - lean).abs() < 1e-9);
    assert!((found.sigma_bias[0] - ((of_mean * of_mean + 2.0 * deficit * deficit) / 2.0).sqrt()).abs() < 1e-9);
    // Without noise the sigma of the scale factor would be the deficit itself: 51 ppm.
    let expected = (of_mean * of_mean / 2.0 / (G * G) + (1.02 * lean * lean / 2.0).powi(2)).sqrt();
    assert!((found.sigma_response[0][0] - expected).abs() < 1e-9);
    assert!((found.sigma_response[2][2] - of_mean / 2f64.sqrt() / G).abs() < 1e-9);
    assert_eq!(found.closure, Closure { count: 0, rms: None, widened: 1.0 });
}

#[test]
fn a_square_box_shows_misalignments_with_closures() {
    let found = solve(&six(), G, Attitudes::Square { arcsec: 0.0 }).unwrap();
    assert!((found.response[1][0] - 0.01).abs() < 1e-12 && found.response[0][1].abs() < 1e-12);
    assert_eq!(found.closure.count, 6);
    // Six means for the bias of each axis: 0.00095/√6; 60″ of the plate, 0.00285/√3 on the four level readings, beside.
    let of_mean = 0.003 / 10f64.sqrt();
    assert!((found.sigma_bias[2] - of_mean / 6f64.sqrt()).abs() < 1e-9);
    let rough = solve(&six(), G, Attitudes::Square { arcsec: 60.0 }).unwrap();
    let level = of_mean.powi(2) + (60.0 / 206_264.8 * G).powi(2) / 3.0;
    let expected = (2.0 / of_mean.powi(2) + 4.0 / level).sqrt().recip();
    assert!((rough.sigma_bias[2] / expected - 1.0).abs() < 1e-3, "{}", rough.sigma_bias[2]);
}

#[test]
fn the_correction_undoes_the_responses() {
    let found = solve(&six(), G, Attitudes::Square { arcsec: 0.0 }).unwrap();
    let (correction, sigma) = found.correction().unwrap();
    // y up: the readings 0.1, −0.2 + 0.99·9.81, 0 are 9.81 along y.
    let force = correction.apply([0.1, -0.2 + 0.99 * G, 0.0]);
    assert!(force[0].abs() < 1e-12 && (force[1] - G).abs() < 1e-12 && force[2].abs() < 1e-12);
    // x up: y reads 0.0981 of it, and is put right.
    let force = correction.apply([0.1 + 1.02 * G, -0.2 + 0.01 * G, 0.0]);
    assert!((force[0] - G).abs() < 1e-12 && force[1].abs() < 1e-12);
    // Of a diagonal element: δs/s².
    assert!((sigma[0][0] / (found.sigma_response[0][0] / (1.02 * 1.02)) - 1.0).abs() < 1e-3);
}

#[test]
fn closures_that_nothing_explains_widen_the_sigmas() {
    let mut positions = six();
    positions[0].attitude.mean[2] += 0.05;
    let found = solve(&positions, G, Attitudes::Square { arcsec: 0.0 }).unwrap();
    assert!(found.closure.widened > 5.0, "{:?}", found.closure);
    positions[0].attitude.mean[2] += 3.0;
    let refusal = solve(&positions, G, Attitudes::Square { arcsec: 0.0 });
    assert!(matches!(refusal, Err(Refusal::Residual { axis: 2, .. })), "{refusal:?}");
}

#[test]
fn what_is_missing_is_named() {
    let without = |place: usize| {
        let mut positions = six();
        positions.remove(place);
        positions
    };
    assert_eq!(solve(&without(3), G, Attitudes::Rough), Err(Refusal::NotBothWays { axis: 1 }));
    assert_eq!(solve(&[], G, Attitudes::Rough), Err(Refusal::NotBothWays { axis: 0 }));
    // Three faces of a square box: four unknowns an axis.
    let three: Vec<_> = six().into_iter().step_by(2).collect();
    assert_eq!(solve(&three, G, Attitudes::Square { arcsec: 0.0 }), Err(Refusal::Undetermined { axis: 0 }));
    // An axis that reads next to nothing.
    let mut dead = six();
    dead.iter_mut().for_each(|position| position.attitude.mean[2] = 0.0);
    assert_eq!(solve(&dead, G, Attitudes::Rough), Err(Refusal::Unequal { axis: 2 }));
}
