extern crate std;

use std::vec::Vec;

use super::*;

/// Normal numbers of a sequence (splitmix64, Box and Muller).
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / 2_f64.powi(53)
    }

    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// The statistics after the baseline, of noise 1 with a change.
fn statistics(seed: u64, count: usize, change: impl Fn(usize) -> f64) -> Vec<f64> {
    let (mut normal, mut test) = (Normal(seed), ChangeTest::default());
    (0..count).filter_map(|fix| test.next(5.0 + 0.1 * (normal.next() + change(fix)), fix % 5 == 0)).collect()
}

/// One start, one member of a known level: by the formula. The first fix is 2: e = 2, v = 1, n = 100, S = 99 + 4; step: g = 1, a = 2, I = 1;
/// Λ = 5^(−1/2) (1 − 16/(5 · 103))^(−50) = 0.4472 · 4.8492; ramp: g = 0.01, a = 0.02, I = 10⁻⁴: 1.0016^(−1/2) (1 − 0.0064/(1.0016 · 103))^(−50) = 0.9992 · 1.0031.
#[test]
fn the_statistic_is_its_formula() {
    let found = ChangeTest::known().next(2.0, false).unwrap();
    let step = 5_f64.sqrt().recip() * (1.0 - 16.0 / 515.0_f64).powi(-50);
    let ramp = 1.0016_f64.sqrt().recip() * (1.0 - 0.0064 / (1.0016 * 103.0_f64)).powi(-50);
    assert!((found - 0.5 * (step + ramp)).abs() < 1e-6 * found, "{found}");
}

/// R(t) has the mean t: over 400 logs of 50 fixes the mean of R(50)/50 is 1 within what R's own scatter leaves, which is heavy to the right; R is cut off at
/// the alarm, which takes less than a twentieth of the mean.
#[test]
fn the_statistic_grows_by_one_a_fix_on_average() {
    let last = |seed| statistics(seed, BASELINE + 50, |_| 0.0).last().copied().unwrap().min(ALARM);
    let mean = (0..400).map(last).sum::<f64>() / 400.0 / 50.0;
    assert!((0.4..1.6).contains(&mean), "{mean}");
}

#[test]
fn a_step_of_two_sigma_is_found_within_eight_fixes() {
    let mut delays: Vec<usize> = (0..41)
        .map(|seed| {
            let found = statistics(seed, 300, |fix| if fix >= 200 { 2.0 } else { 0.0 });
            found.iter().position(|&statistic| statistic >= ALARM).map_or(usize::MAX, |at| at.saturating_sub(99))
        })
        .collect();
    delays.sort_unstable();
    assert!(delays[20] <= 8, "{delays:?}");
}

#[test]
fn what_never_moves_is_not_watched() {
    let mut test = ChangeTest::default();
    assert!((0..300).all(|_| test.next(1.0, false).is_none()) && test.foremost().is_none());
}

/// A start that gives its place up leaves the statistic as it is.
#[test]
fn what_is_forgotten_is_inherited() {
    let mut test = ChangeTest::default();
    let mut normal = Normal(3);
    for _ in 0..BASELINE + STARTS {
        test.next(normal.next(), false);
    }
    let sum = |test: &ChangeTest| test.starts.iter().map(|start| start.weight * start.ratio).sum::<f32>();
    let before = sum(&test);
    assert!(test.starts.is_full());
    test.forget();
    assert!((sum(&test) - before).abs() < 1e-5 * before);
}
