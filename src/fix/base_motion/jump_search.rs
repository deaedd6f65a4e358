//! Where the base jumped, by its levels.

use super::jumps::Jumps;
use super::levels::{FUNCTIONS, Law, Levels, Prior, SIGNIFICANT};
use super::tilt::tilt_arcsec;
use crate::fix::dwell::DwellSummary;

/// What a jump must explain in a dwell in which the gyro measured a shock, variances: twice what chance explains of both axes by its size (Akaike, IEEE Transactions on
/// Automatic Control 19, 1974, p. 716). Elsewhere it must be as significant as a path.
const WHERE_SHOCKED: f64 = 4.0;

/// No jumps, where the gyro measured no shock, or as many as leave the least: each where a polynomial of few degrees leaves the least beside those before it.
pub fn likeliest(dwells: &[DwellSummary]) -> Jumps {
    let none = Jumps::default();
    if dwells.iter().all(|dwell| dwell.outliers == 0) {
        return none;
    }
    let without = usual_variance_arcsec2(dwells).and_then(|variance| left(&none, dwells, variance));
    match one_at_least(dwells).zip(without) {
        Some(((left, jumps), without)) if left < without => jumps,
        _ => none,
    }
}

/// The same, but one at least, and what it leaves. `None` where the dwells do not determine any.
pub fn one_at_least(dwells: &[DwellSummary]) -> Option<(f64, Jumps)> {
    let variance = usual_variance_arcsec2(dwells)?;
    let (mut jumps, mut best): (Jumps, Option<(f64, Jumps)>) = (Jumps::default(), None);
    while let Some((left, with)) = with_next(&jumps, dwells, variance) {
        if best.as_ref().is_none_or(|best| left < best.0) {
            best = Some((left, with.clone()));
        }
        jumps = with;
    }
    best
}

/// With a further one, in a dwell or between two, and what is left then.
fn with_next(jumps: &Jumps, dwells: &[DwellSummary], variance: [f64; 2]) -> Option<(f64, Jumps)> {
    let with = |at_s: f64| {
        let with = jumps.with(at_s)?;
        Some((left(&with, dwells, variance)?, with))
    };
    let between = dwells.iter().skip(1).map(|dwell| dwell.start_s);
    let within = dwells.iter().map(|dwell| 0.5 * (dwell.start_s + dwell.end_s));
    between.chain(within).filter_map(with).min_by(|a, b| a.0.total_cmp(&b.0))
}

/// The sum of squares that these and a polynomial leave, in variances, less what is expected of the readings that count, and what every power of the
/// polynomial and every jump must explain to be taken for one.
fn left(jumps: &Jumps, dwells: &[DwellSummary], variance: [f64; 2]) -> Option<f64> {
    let levels = Levels::new(dwells, Law::Powers, variance, &Prior::FREE, jumps)?;
    let of_jumps = jumps.at_s().iter().map(|&at_s| asked_of(dwells, at_s)).sum::<f64>();
    let with_path = |degree: usize| levels.chi_square(degree) + SIGNIFICANT * degree as f64;
    Some((0..FUNCTIONS).map(with_path).min_by(f64::total_cmp)? + of_jumps - jumps.readings(dwells))
}

/// What a jump at this time must explain.
fn asked_of(dwells: &[DwellSummary], at_s: f64) -> f64 {
    let shocked = |dwell: &DwellSummary| dwell.outliers > 0 && dwell.start_s < at_s && at_s < dwell.end_s;
    if dwells.iter().any(shocked) { WHERE_SHOCKED } else { SIGNIFICANT }
}

/// Variance of a one-second tilt about a line in a usual dwell, the median, arcsec², pitch and roll: a jump in a few of them is not in it.
fn usual_variance_arcsec2(dwells: &[DwellSummary]) -> Option<[f64; 2]> {
    let mut variances = [0.0; 2];
    for (axis, variance) in variances.iter_mut().enumerate() {
        let of_dwell = |dwell: &DwellSummary| {
            let line = *tilt_arcsec(dwell)?.get(axis)?;
            Some(f64::from(line.residual_squares) / f64::from(dwell.degrees_of_freedom.max(1)))
        };
        let all = || dwells.iter().filter_map(of_dwell);
        let is_upper_half = |&value: &f64| 2 * all().filter(|&other| other <= value).count() > dwells.len();
        *variance = all().filter(is_upper_half).min_by(f64::total_cmp)?;
    }
    variances.iter().all(|&variance| variance > 0.0).then_some(variances)
}
