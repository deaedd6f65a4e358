use super::attitude::Attitude;
use super::coverage::Direction;
use super::*;
use std::vec::Vec;

/// A reading of a triad with specific force `f`, by hand: x reads 1.02 fx + 0.01 (bias), y reads fy − 0.03 fx − 0.02, z
/// reads 0.98 fz + 0.004.
fn reading([x, y, z]: [f64; 3]) -> [f64; 3] {
    [1.02 * x + 0.01, y - 0.03 * x - 0.02, 0.98 * z + 0.004]
}

/// Ten readings with a scatter of ± `rough` whose mean is exact.
fn attitude(mean: [f64; 3], rough: f64) -> Attitude {
    let readings: Vec<_> = (0..10).map(|i| mean.map(|part| part + if i % 2 == 0 { rough } else { -rough })).collect();
    Attitude::of(&readings, 0.0, &mut [0.0; 10]).unwrap()
}

fn entries(directions: impl Iterator<Item = [f64; 3]>, rough: f64) -> Vec<Entry> {
    let role = |i: usize| if i % 4 == 2 { Role::Check } else { Role::Fit };
    directions.enumerate().map(|(i, unit)| Entry { attitude: attitude(reading(unit), rough), role: role(i) }).collect()
}

fn all(rough: f64) -> Vec<Entry> {
    entries(Direction::all().map(Direction::unit), rough)
}

fn solve(entries: &mut [Entry]) -> Result<Calibration, Refusal> {
    fit(entries, 1.0)
}

#[test]
fn every_parameter_has_its_place_and_sign() {
    let found = solve(&mut all(1e-4)).unwrap();
    for (found, expected) in found.correction.bias.into_iter().zip([0.01, -0.02, 0.004]) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    // raw − b = A f with A = [[1.02, 0, 0], [−0.03, 1, 0], [0, 0, 0.98]]. M = R A⁻¹ with MᵀM = A⁻ᵀA⁻¹; R turns about z.
    // AAᵀ = [[1.0404, −0.0306], [−0.0306, 1.0009]]; its inverse is MᵀM: over the determinant 1.0404.
    let (m11_squared, m11_m12, m22_and_m12) = (1.0009 / 1.0404, 0.0306 / 1.0404, 1.0404 / 1.0404);
    let m11 = f64::sqrt(m11_squared);
    let m12 = m11_m12 / m11;
    let m22 = f64::sqrt(m22_and_m12 - m12 * m12);
    let expected = [[m11, m12, 0.0], [0.0, m22, 0.0], [0.0, 0.0, 1.0 / 0.98]];
    for (found, expected) in found.correction.matrix.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    assert!(m12 > 0.0);
    assert!(found.norm_rms < 1e-9 && found.check_norm_rms.unwrap() < 1e-9);
    assert_eq!(found.weights, Weights::Noise);
}

#[test]
fn scale_factors_and_angles_by_hand() {
    let correction = solve(&mut all(1e-4)).unwrap().correction;
    // The rows of A: (1.02, 0, 0), (−0.03, 1, 0), (0, 0, 0.98).
    let expected = [1.02, 1.0009_f64.sqrt(), 0.98];
    for (found, expected) in correction.scale_factors().into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    // cos xy = −0.03/√1.0009: more than a right angle, by atan 0.03 = 1.71836°.
    let [xy, xz, yz] = correction.angles_deg();
    assert!((xy - 91.718358).abs() < 1e-5 && (xz - 90.0).abs() < 1e-6 && (yz - 90.0).abs() < 1e-6, "{xy} {xz} {yz}");
}

#[test]
fn the_corrected_norm_is_gravity_in_the_unit_wanted() {
    let mut entries = all(1e-4);
    let found = fit(&mut entries, 9.81).unwrap();
    assert!((found.correction.norm(reading([0.0, 0.6, 0.8])) - 9.81).abs() < 1e-8);
    // z keeps its direction: a reading along z is corrected along z.
    let [x, y, z] = found.correction.apply(reading([0.0, 0.0, -1.0]));
    assert!(x.abs() < 1e-8 && y.abs() < 1e-8 && (z + 9.81).abs() < 1e-8);
}

#[test]
fn raw_counts_do_as_well() {
    let mut entries = all(1e-4);
    for entry in &mut entries {
        let Attitude { mean, squares, .. } = &mut entry.attitude;
        *mean = mean.map(|part| 32_768.0 + 4000.0 * part);
        *squares = squares.map(|square| 16e6 * square);
    }
    let found = solve(&mut entries).unwrap();
    assert!((found.correction.bias[0] - 32_808.0).abs() < 1e-4, "{found:?}");
    assert!((found.correction.matrix[2][2] - 1.0 / 3920.0).abs() < 1e-11);
    let [greatest, _, least] = found.half_axes;
    assert!(greatest < 4000.0 * 1.03 && least > 4000.0 * 0.97);
}

#[test]
fn sigmas_are_those_of_an_even_cover() {
    // Icosahedron, twelve attitudes, σ = 1e-3 for each mean: Σ u uᵀ = 12/3, so each bias has σ/√4.
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let norm = (1.0 + golden * golden).sqrt();
    let mut entries = Vec::new();
    for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        let (short, long) = (a / norm, b * golden / norm);
        for unit in [[0.0, short, long], [short, long, 0.0], [long, 0.0, short]] {
            entries.push(Entry { attitude: attitude(unit, 1e-3 * 9.0_f64.sqrt()), role: Role::Fit });
        }
    }
    let found = solve(&mut entries).unwrap();
    // ten readings of ± 3e-3: their variance is 90e-6/9, that of the mean 1e-6.
    for sigma in found.sigma_bias {
        assert!((sigma / 5e-4 - 1.0).abs() < 1e-6, "{sigma}");
    }
    assert!((found.coverage - 1.0).abs() < 1e-6);
}

#[test]
fn an_attitude_that_contradicts_the_others_is_left_out() {
    let mut entries = all(1e-4);
    entries[5].attitude.mean[2] += 0.05;
    let found = solve(&mut entries).unwrap();
    assert_eq!(entries[5].role, Role::Invalid);
    assert_eq!(entries.iter().filter(|entry| entry.role == Role::Invalid).count(), 1);
    assert!((found.correction.bias[0] - 0.01).abs() < 1e-6);
}

#[test]
fn what_noise_does_not_explain_widens_the_sigmas() {
    let exact = solve(&mut all(1e-4)).unwrap();
    let mut entries = all(1e-4);
    for (i, entry) in entries.iter_mut().enumerate() {
        entry.attitude.mean[i % 3] += if i % 2 == 0 { 2e-3 } else { -2e-3 };
    }
    let rough = solve(&mut entries).unwrap();
    let Weights::Excess(rms) = rough.weights else { panic!("{rough:?}") };
    assert!((5e-4..4e-3).contains(&rms), "{rms}");
    assert!(rough.sigma_bias[0] > 10.0 * exact.sigma_bias[0]);
}

#[test]
fn readings_without_any_noise_are_solved() {
    let found = solve(&mut all(0.0)).unwrap();
    assert!((found.correction.bias[1] + 0.02).abs() < 1e-9 && found.sigma_bias[1] < 1e-6);
}

#[test]
fn too_few_and_badly_spread_attitudes_are_refused() {
    let mut few = all(1e-4);
    few.truncate(11);
    assert_eq!(solve(&mut few), Err(Refusal::TooFew { attitudes: 8 }));
    // z always up: −z is missing.
    let ring = |z: f64, n: u32| {
        (0..n).map(move |i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            [across * cos, across * sin, z]
        })
    };
    let mut cap = entries(ring(0.6, 8).chain(ring(0.8, 8)).chain(ring(0.95, 4)), 1e-5);
    match solve(&mut cap) {
        Err(Refusal::Coverage { coverage, missing }) => {
            assert!(coverage < 0.01);
            assert_eq!(missing[0], Some(Direction([0, 0, -1])));
        }
        other => panic!("{other:?}"),
    }
    // About one axis only.
    let mut plane = entries(ring(0.0, 24), 1e-5);
    assert!(matches!(solve(&mut plane), Err(Refusal::Coverage { .. })), "{:?}", solve(&mut plane));
}

#[test]
fn what_is_no_ellipsoid_is_refused() {
    // A cube: corners 1.7 times as far as faces.
    let mut cube: Vec<_> = Direction::all()
        .map(|direction| Entry { attitude: attitude(direction.0.map(f64::from), 1e-4), role: Role::Fit })
        .collect();
    assert!(matches!(solve(&mut cube), Err(Refusal::Residual { .. })), "{:?}", solve(&mut cube));
    let mut cigar: Vec<_> = Direction::all()
        .map(|direction| {
            let [x, y, z] = direction.unit();
            Entry { attitude: attitude([3.0 * x, y, z], 1e-4), role: Role::Fit }
        })
        .collect();
    assert!(matches!(solve(&mut cigar), Err(Refusal::Elongated { .. })), "{:?}", solve(&mut cigar));
    // One sheet of a hyperboloid: z² = 1 + x² + y².
    let mut sheet: Vec<_> = (0..20)
        .map(|i| {
            let (sin, cos) = (0.9 * f64::from(i)).sin_cos();
            let away = 0.1 * f64::from(i);
            let point = [away * cos, away * sin, (1.0 + away * away).sqrt()];
            Entry { attitude: attitude(point, 1e-4), role: Role::Fit }
        })
        .collect();
    assert!(solve(&mut sheet).is_err());
}

#[test]
fn nominal_is_a_common_offset_and_factor() {
    let readings = || Direction::all().map(|direction| direction.unit().map(|part| 500.0 + 100.0 * part));
    let found = nominal(readings(), 9.81);
    assert!((found.bias[0] - 500.0).abs() < 1e-6 && found.bias[0] == found.bias[2]);
    assert!((found.matrix[1][1] - 0.0981).abs() < 1e-9);
    assert_eq!(nominal(Direction::all().map(Direction::unit), 1.0), Correction::UNIT);
}
