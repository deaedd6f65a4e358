//! What may have happened to base and index while the fix was taken: each is solved for, and the rates decide.

use super::base_motion::{self, BaseMotion};
use super::cause::Cause;
use super::dwell::DwellSummary;
use super::motion;
use super::solution::solve_for;
use super::{Declared, Fix, Unsolvable, turned};
use crate::effects::ErrorModel;
use crate::health::Flag;
use crate::units::wrap_180_deg;

/// Chi-squares that differ by so much tell two causes apart: three standard deviations.
const DECIDED: f64 = 9.0;
/// Ends of dwells and starts of the next ones are the same but for rounding, seconds.
const IN_ORDER_S: f64 = 0.01;

/// Solves for the azimuth. `dwells` in the order of time.
///
/// Where the levels change, either the base moved, which turned the gyro too, or the accelerometers drifted, which the gyro knows nothing of:
/// both are weighed, unless the model knows the accelerometers to change by as much. Where the levels jump, the base is supposed to have moved unless
/// the rates contradict it.
///
/// Where the dwells contradict each other, the encoder may have slipped in a move that did not follow its steps: then its slip is solved for. Or the
/// instrument may have been turned about the vertical meanwhile: then the azimuth is that after the turn, if the dwells determine it.
pub fn solve(dwells: &[DwellSummary], declared: &Declared, model: &ErrorModel) -> Result<Fix, Unsolvable> {
    let seen = base_motion::detect(dwells);
    let drifted = seen.is_moving() && is_of_accelerometers(dwells, model);
    let motion = if drifted { BaseMotion::Still } else { seen };
    let solved = solve_standing(dwells, declared, model, motion);
    let standing = if drifted { solved.map(standing) } else { solved };
    // The sectors of a continuous rotation are of no time of their own.
    let in_order =
        dwells.windows(2).all(|pair| matches!(pair, [before, after] if before.end_s <= after.start_s + IN_ORDER_S));
    if !in_order || !turned::is_suspected(&standing) {
        return standing;
    }
    let explained = |cause: Cause, motion: BaseMotion, doubt_deg: f64, flag: Flag| {
        let mut fix = solve_for(dwells, declared, model, motion, cause).ok()?;
        fix.sigma_deg = libm::hypot(fix.sigma_deg, doubt_deg);
        fix.flags.insert(flag);
        turned::is_explained(&fix).then_some(fix)
    };
    let slipped = turned::slip_in_move(dwells, declared)
        .and_then(|(slip, doubt_deg)| explained(Cause::SlippedInMove(slip), motion, doubt_deg, Flag::IndexSlip));
    let turned = |within| {
        let (turn, doubt_deg) = turned::find(dwells, declared, within)?;
        explained(Cause::Turned(turn), BaseMotion::Still, doubt_deg, Flag::Turned)
    };
    slipped.or_else(|| [0, 1].into_iter().find_map(turned)).map_or(standing, Ok)
}

/// Whether the levels change by no more than the model says that the accelerometers do while the base stands; twice
/// the greatest change that was seen is room for new runs.
fn is_of_accelerometers(dwells: &[DwellSummary], model: &ErrorModel) -> bool {
    base_motion::range_arcsec(dwells).is_some_and(|range_arcsec| range_arcsec <= 2.0 * model.level_drift_arcsec)
}

/// The solution for an instrument that was not turned.
fn solve_standing(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    motion: BaseMotion,
) -> Result<Fix, Unsolvable> {
    if !motion.is_moving() {
        return solve_for_jumps(dwells, declared, model, motion);
    }
    let slipped = dwells.iter().any(|dwell| dwell.slip_deg != 0.0);
    if !slipped && let Some(weighed) = motion::solve(dwells, declared, model, Cause::Spindle) {
        return weighed;
    }
    let moved = solve_for_jumps(dwells, declared, model, motion);
    match (moved, solve_for_jumps(dwells, declared, model, BaseMotion::Still)) {
        (Ok(moved), Ok(still)) if moved.chi_square - still.chi_square > DECIDED => Ok(standing(still)),
        (Ok(only), _) | (Err(_), Ok(only)) => Ok(only),
        (Err(refusal), Err(_)) => Err(refusal),
    }
}

/// Levels that changed while the gyro did not feel the base move.
fn standing(mut fix: Fix) -> Fix {
    fix.flags.insert(Flag::LevelDrift);
    fix
}

/// The solution for what is to be taken out of the base's motion.
///
/// Where the index reading jumped while the motor stood, either the spindle moved, and the readings are right, or the encoder
/// slipped on it, and from there on they are wrong by the jump. A gyro that turns by Δθ at an azimuth ψ − θ of its axis reads
/// h sin(ψ − θ) Δθ more: the rates themselves say which it was, where they can. Where they cannot, sigma holds both.
fn solve_for_jumps(
    dwells: &[DwellSummary],
    declared: &Declared,
    model: &ErrorModel,
    motion: BaseMotion,
) -> Result<Fix, Unsolvable> {
    let spindle = solve_for(dwells, declared, model, motion, Cause::Spindle);
    if dwells.iter().all(|dwell| dwell.slip_deg == 0.0) {
        return spindle;
    }
    let (mut better, mut other) = match (spindle, solve_for(dwells, declared, model, motion, Cause::Encoder)) {
        (Ok(spindle), Ok(encoder)) if encoder.chi_square < spindle.chi_square => (encoder, spindle),
        (Ok(spindle), Ok(encoder)) => (spindle, encoder),
        (Ok(only), Err(_)) | (Err(_), Ok(only)) => (only, only),
        (Err(refusal), Err(_)) => return Err(refusal),
    };
    if other.chi_square - better.chi_square > DECIDED {
        other = better;
    }
    let apart_deg = wrap_180_deg(other.azimuth_deg - better.azimuth_deg);
    better.sigma_deg = libm::hypot(better.sigma_deg, apart_deg);
    better.flags.insert(Flag::IndexSlip);
    Ok(better)
}
