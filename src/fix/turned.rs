//! The instrument was turned about the vertical while it measured: the dwells before and after have two azimuths.
//!
//! With an axis at index θ a gyro reads h cos(ψ − θ). Before a turn by Δ the azimuth was ψ − Δ: so a turn is one more unknown, and a search over
//! when it was and how far finds it. The tilt of the base that the levels read turns with the instrument, and is not taken for motion.

use nalgebra::{Matrix4, Matrix4x2, Matrix6, Vector2, Vector4, Vector6};

use super::base_motion::BaseMotion;
use super::cause::{Cause, Turn};
use super::dwell::DwellSummary;
use super::estimate::{AMPLITUDE_TOLERANCE, LEAST_DRIFT};
use super::noise::Noise;
use super::observation::{LEAST_SHARE, Observation};
use super::problem::Problem;
use super::{Declared, Fix, Unsolvable};
use crate::health::Flag;
use crate::units::{DEG_PER_RAD, sin_cos_deg, wrap_180_deg};

/// A turn is searched for in these steps, degrees: chi-square has harmonics up to the second, with valleys 90° wide.
const STEPS: usize = 24;
const STEP_DEG: f64 = 15.0;
/// Halvings of a step: to a thousandth of a degree.
const HALVINGS: usize = 14;
/// Less than this is a shock, a slip or a bias that jumped: the other flags name it. Degrees.
const LEAST_TURN_DEG: f64 = 20.0;
/// By how much a turn must lower chi-square: with two unknowns more, less than once in 3,000,000, and 24 · 46 of them are tried.
const DECIDED: f64 = 30.0;
/// Positions that either side of a turn must have: one is explained by some turn whatever it reads.
const LEAST_POSITIONS: usize = 2;
/// Fewest positions of a fix, in the order of their visits: azimuth, bias and turn take three, and three more test them. Where only two did,
/// a bias that followed the moves was taken for a turn by 100° in 2 of 21 runs of five positions.
const LEAST_IN_ALL: usize = 6;
/// What a turn does to a fix that does not know of it.
const SUSPICIOUS: [Flag; 6] =
    [Flag::Misfit, Flag::Amplitude, Flag::Bias, Flag::Drift, Flag::Noisy, Flag::Autocorrelated];
/// What a fix that knows of it must not have.
const CONTRADICTING: [Flag; 4] = [Flag::Misfit, Flag::Amplitude, Flag::Bias, Flag::Drift];

/// Whether a turn may have made this of a fix.
pub(super) fn is_suspected(standing: &Result<Fix, Unsolvable>) -> bool {
    match standing {
        Ok(fix) => SUSPICIOUS.into_iter().any(|flag| fix.flags.contains(flag)),
        Err(unsolvable) => matches!(unsolvable, Unsolvable::NoSignal | Unsolvable::NotEarthRate),
    }
}

/// A fix with a turn found has none of what would contradict it.
pub(super) fn is_explained(turned: &Fix) -> bool {
    !CONTRADICTING.into_iter().any(|flag| turned.flags.contains(flag))
}

/// The slip of the encoder in a move that did not follow its steps, if one explains the dwells far better than none; and what its own uncertainty adds to
/// the sigma of the azimuth before it, degrees. To the rates it is a turn of the instrument, of any size and at a known time.
pub(super) fn slip_in_move(dwells: &[DwellSummary], declared: &Declared) -> Option<(Turn, f64)> {
    let after = dwells.iter().position(|dwell| dwell.doubted)?;
    let best = best_after(dwells, declared, after, 0)?;
    (best.gain > DECIDED).then(|| (best.turn, best.sigma_deg * (best.azimuth_by_turn - 1.0).abs()))
}

/// The turn that explains the dwells far better than none, between two of them or, `within` 1, in one of them; and what its own
/// uncertainty adds to the azimuth's sigma, degrees.
pub(super) fn find(dwells: &[DwellSummary], declared: &Declared, within: usize) -> Option<(Turn, f64)> {
    if positions(dwells) < LEAST_IN_ALL + within {
        return None;
    }
    let candidates = (1..dwells.len()).filter_map(|after| best_after(dwells, declared, after, within));
    let best = candidates.min_by(|a, b| a.chi_square.total_cmp(&b.chi_square))?;
    let doubt_deg = best.sigma_deg * best.azimuth_by_turn.abs();
    (best.turn.deg.abs() > LEAST_TURN_DEG && best.gain > DECIDED).then_some((best.turn, doubt_deg))
}

/// The best turn after so many dwells, `within` as many of the next ones; none without enough positions on either side.
fn best_after(dwells: &[DwellSummary], declared: &Declared, after: usize, within: usize) -> Option<Best> {
    let (before, rest) = dwells.split_at_checked(after)?;
    let (_, rest) = rest.split_at_checked(within)?;
    if positions(before).min(positions(rest)) < LEAST_POSITIONS {
        return None;
    }
    let turn = Turn { before_s: before.last()?.end_s, after_s: rest.first()?.start_s, deg: 0.0 };
    Search::new(dwells, declared, turn)?.best()
}

/// How many positions dwells, or parts of them, visit one after the other.
fn positions(dwells: &[DwellSummary]) -> usize {
    let is_move = |pair: &&[DwellSummary]| matches!(pair, [a, b] if !b.is_at_position_of(a));
    dwells.windows(2).filter(is_move).count() + usize::from(!dwells.is_empty())
}

/// The best turn at a given time.
struct Best {
    turn: Turn,
    chi_square: f64,
    /// By how much it is below that of no turn.
    gain: f64,
    /// Of the turn, degrees.
    sigma_deg: f64,
    /// By how much the azimuth after it grows with the turn.
    azimuth_by_turn: f64,
}

/// The normal equations of a turn at a given time in the horizontal rates north and east of the mark, before it and after it, °/h; bias and
/// drift are eliminated. A turn of any angle is then four products: the fix is solved on the board, between two ticks.
struct Search {
    turn: Turn,
    normal: Matrix4<f64>,
    right: Vector4<f64>,
    squares: f64,
    north_deg_h: f64,
}

impl Search {
    fn new(dwells: &[DwellSummary], declared: &Declared, turn: Turn) -> Option<Self> {
        let mut problem = Problem::new(dwells, declared.earth, BaseMotion::Still, Cause::Turned(turn))?;
        let noise = Noise::new(problem.counting(), &declared.gyro, || None)?;
        problem.noise = Some(noise);
        let (mut normal, mut right, mut squares) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for dwell in dwells {
            let [of_before, of_after] = if turn.is_after(dwell) { [1.0, 0.0] } else { [0.0, 1.0] };
            for Observation { weight, row, rate_deg_h, .. } in problem.observations(dwell) {
                let sides = [of_before * row.x, of_before * row.y, of_after * row.x, of_after * row.y, row.z, row.w];
                let (row, weight) = (Vector6::from(sides), weight / noise.variance);
                normal += weight * row * row.transpose();
                right += weight * rate_deg_h * row;
                squares += weight * rate_deg_h * rate_deg_h;
            }
        }
        let drift_sigma = declared.gyro.drift_deg_h_per_h.max(LEAST_DRIFT);
        normal.m66 += 1.0 / (drift_sigma * drift_sigma);
        let of_bias = normal.fixed_view::<2, 2>(4, 4).try_inverse()?;
        let cross = normal.fixed_view::<4, 2>(0, 4) * of_bias;
        let right_of_bias = right.fixed_rows::<2>(4);
        Some(Self {
            turn,
            normal: normal.fixed_view::<4, 4>(0, 0) - cross * normal.fixed_view::<2, 4>(4, 0),
            right: right.fixed_rows::<4>(0) - cross * right_of_bias,
            squares: squares - right_of_bias.dot(&(of_bias * right_of_bias)),
            north_deg_h: declared.earth.north_deg_h,
        })
    }

    /// Chi-square with a turn of so many degrees, the horizontal rate held to the Earth's; and that rate after the turn, north and east of the mark, °/h.
    fn at(&self, deg: f64) -> Option<(f64, Vector2<f64>)> {
        let (sin, cos) = sin_cos_deg(deg);
        let of_after = Matrix4x2::new(cos, sin, -sin, cos, 1.0, 0.0, 0.0, 1.0);
        let normal = of_after.transpose() * self.normal * of_after;
        let right = of_after.transpose() * self.right;
        let trace = normal.trace();
        let regular = normal.determinant() > LEAST_SHARE * trace * trace;
        let rates_deg_h = normal.try_inverse().filter(|_| regular)? * right;
        let off = libm::hypot(rates_deg_h.x, rates_deg_h.y) / self.north_deg_h - 1.0;
        let of_amplitude = off * off / (AMPLITUDE_TOLERANCE * AMPLITUDE_TOLERANCE);
        Some((self.squares - right.dot(&rates_deg_h) + of_amplitude, rates_deg_h))
    }

    /// The best turn, if no other is nearly as good. (Of an axis that points east or west half a turn shows nothing.)
    fn best(&self) -> Option<Best> {
        let (none, _) = self.at(0.0)?;
        let mut coarse = [f64::INFINITY; STEPS];
        for (step, chi_square) in coarse.iter_mut().enumerate() {
            *chi_square = self.at(step as f64 * STEP_DEG).map_or(f64::INFINITY, |(chi_square, _)| chi_square);
        }
        let (mut best, mut next) = ((f64::INFINITY, 0.0), f64::INFINITY);
        let neighbours = coarse.iter().cycle().skip(STEPS - 1).zip(coarse.iter().cycle().skip(1));
        for (step, (chi_square, (before, after))) in coarse.iter().zip(neighbours).enumerate() {
            if chi_square <= before && chi_square <= after {
                let found = self.refined((*chi_square, wrap_180_deg(step as f64 * STEP_DEG)));
                next = next.min(best.0.max(found.0));
                best = if found.0 < best.0 { found } else { best };
            }
        }
        if next - best.0 < DECIDED {
            return None;
        }
        let (chi_square, deg) = best;
        // Half the second derivative of chi-square is the inverse of the turn's variance.
        let ((less, rates_less), (more, rates_more)) = (self.at(deg - 1.0)?, self.at(deg + 1.0)?);
        let curvature = 0.5 * (less + more - 2.0 * chi_square);
        let across = rates_less.perp(&rates_more);
        let azimuth_by_turn = 0.5 * DEG_PER_RAD * libm::atan2(across, rates_less.dot(&rates_more));
        let sigma_deg = if curvature > 0.0 { 1.0 / libm::sqrt(curvature) } else { f64::INFINITY };
        Some(Best { turn: Turn { deg, ..self.turn }, chi_square, gain: none - chi_square, sigma_deg, azimuth_by_turn })
    }

    /// A minimum of chi-square within a step of this one: chi-square and turn, degrees.
    fn refined(&self, mut best: (f64, f64)) -> (f64, f64) {
        let mut step_deg = STEP_DEG;
        for _ in 0..HALVINGS {
            step_deg *= 0.5;
            for deg in [best.1 - step_deg, best.1 + step_deg] {
                if let Some((chi_square, _)) = self.at(deg).filter(|(chi_square, _)| *chi_square < best.0) {
                    best = (chi_square, deg);
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::effects::ErrorModel;
    use crate::fix::dwell::LevelLine;
    use crate::fix::solve;
    use crate::fix::tests::{declared, dwell, normal};
    use crate::units::ARCSEC_PER_RAD;

    const MIRRORED: [f64; 8] = [0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0];
    /// Ω cos 60°, °/h.
    const NORTH_DEG_H: f64 = 7.5205335;

    /// The axis points to azimuth − index: rates h cos(azimuth − index) + 0.2 °/h and the noise of a dwell of 60 s.
    fn dwells(azimuth_deg: &[f64; 8], state: &mut u64) -> Vec<DwellSummary> {
        let rate = |i: usize| NORTH_DEG_H * libm::cos((azimuth_deg[i] - MIRRORED[i]).to_radians()) + 0.2;
        (0..8).map(|i| dwell(65.0 * i as f64, MIRRORED[i], rate(i) + 0.0116 * normal(state))).collect()
    }

    fn fix(dwells: &[DwellSummary]) -> Result<Fix, Unsolvable> {
        solve(dwells, &declared(60.0), &ErrorModel::default())
    }

    /// 30°, and after three dwells 120°, or −60°, or 165°: the azimuth afterwards, and one flag.
    #[test]
    fn a_turn_between_dwells_is_named_and_the_azimuth_after_it_found() {
        let mut state = 7;
        for after_deg in [120.0, -60.0, 165.0] {
            for first in 2..=6 {
                let azimuth_deg = core::array::from_fn(|i| if i < first { 30.0 } else { after_deg });
                let found = fix(&dwells(&azimuth_deg, &mut state)).unwrap();
                assert_eq!(found.flags.iter().collect::<Vec<_>>(), [Flag::Turned], "{first} {after_deg}");
                let error_deg = wrap_180_deg(found.azimuth_deg - after_deg);
                assert!(error_deg.abs() < 4.0 * found.sigma_deg && found.sigma_deg < 0.5, "{first} {found:?}");
            }
        }
    }

    /// A base that is not level by 200 arcsec, nose up at 30°, is so to the left once the nose points to 120°, 90° clockwise: a step of the levels, and what
    /// the Earth's vertical rate of 13.026 °/h makes of them, on an axis forward or left.
    #[test]
    fn the_tilt_that_turns_with_the_instrument_is_no_motion() {
        let azimuth_deg = core::array::from_fn(|i| if i < 4 { 30.0 } else { 120.0 });
        let mut dwells = dwells(&azimuth_deg, &mut 11);
        let tilt = 200.0 / ARCSEC_PER_RAD;
        let scatter = (58.0 * (3.0 / ARCSEC_PER_RAD) * (3.0 / ARCSEC_PER_RAD)) as f32;
        for (i, dwell) in dwells.iter_mut().enumerate() {
            let [forward, left] = if i < 4 { [tilt, 0.0] } else { [0.0, tilt] };
            dwell.rate.mean += 13.025946 * (forward * dwell.cos + left * dwell.sin);
            dwell.level = Some([forward, left].map(|mean| LevelLine {
                mean: mean as f32,
                residual_squares: scatter,
                successive_squares: scatter,
                ..LevelLine::default()
            }));
        }
        let found = fix(&dwells).unwrap();
        assert_eq!(found.flags.iter().collect::<Vec<_>>(), [Flag::Turned]);
        assert!(wrap_180_deg(found.azimuth_deg - 120.0).abs() < 4.0 * found.sigma_deg, "{found:?}");
    }

    /// Half of the fourth dwell is read before the turn, half after it: a step in its seconds, and a mean that is neither.
    #[test]
    fn a_turn_within_a_dwell_leaves_that_dwell_out() {
        let azimuth_deg = [30.0, 30.0, 30.0, 30.0, 120.0, 120.0, 120.0, 120.0];
        let mut dwells = dwells(&azimuth_deg, &mut 3);
        let step_deg_h =
            NORTH_DEG_H * (libm::cos((120.0_f64 - 270.0).to_radians()) - libm::cos((30.0_f64 - 270.0).to_radians()));
        dwells[3].rate.mean += 0.5 * step_deg_h;
        // A step in the middle of 60 s: slope 1.5 steps in the dwell, and a quarter of what is left of its squares.
        dwells[3].rate.slope_per_s = 1.5 * step_deg_h / 60.0;
        dwells[3].rate.residual_squares += (60.0 * step_deg_h * step_deg_h / 16.0) as f32;
        let found = fix(&dwells).unwrap();
        assert_eq!(found.flags.iter().collect::<Vec<_>>(), [Flag::Turned]);
        assert!(wrap_180_deg(found.azimuth_deg - 120.0).abs() < 4.0 * found.sigma_deg, "{found:?}");
        assert_eq!(found.seconds, 420.0);
    }

    /// East and west read the same after half a turn: a bias that jumps there is none.
    #[test]
    fn half_a_turn_is_not_seen_from_east_and_west() {
        let rates = [(0.0, 0.8660254), (90.0, 0.5), (300.0, 0.0), (120.0, 0.0), (300.0, 0.03), (120.0, 0.0)];
        let dwells: Vec<DwellSummary> = (0..)
            .zip(rates)
            .map(|(i, (index_deg, of_north))| dwell(65.0 * f64::from(i), index_deg, NORTH_DEG_H * of_north))
            .collect();
        assert!(!fix(&dwells).is_ok_and(|fix| fix.flags.contains(Flag::Turned)));
    }

    /// Five positions that contradict each other by 3 °/h are not enough to tell a turn from what else may do that, however many dwells or parts
    /// of dwells there are of them: of the eight the fourth and the fifth are at one index.
    #[test]
    fn five_positions_tell_no_turn() {
        let mut state = 9;
        let azimuth_deg = core::array::from_fn(|i| if i < 2 { 30.0 } else { 120.0 });
        let eight = dwells(&azimuth_deg, &mut state);
        assert!(fix(&eight[..7]).is_ok_and(|fix| fix.flags.contains(Flag::Turned)));
        assert_eq!(positions(&eight[..6]), 5);
        let halved: Vec<DwellSummary> = eight[..5]
            .iter()
            .flat_map(|dwell| {
                let middle_s = 0.5 * (dwell.start_s + dwell.end_s);
                let half = DwellSummary { seconds: 0.5 * dwell.seconds, ..*dwell };
                [DwellSummary { end_s: middle_s, ..half }, DwellSummary { start_s: middle_s, ..half }]
            })
            .collect();
        for five in [&eight[..6], &halved[..]] {
            assert!(!fix(five).is_ok_and(|fix| !fix.flags.contains(Flag::Misfit) || fix.flags.contains(Flag::Turned)));
        }
    }

    /// The encoder reads 3° too much after a move, or 2° too little: where that move did not follow its steps, the azimuth is the one before, which the dwells
    /// before and the Earth's rate tell; where nothing says so, the dwells contradict each other.
    #[test]
    fn a_slip_in_a_move_is_solved_for() {
        let mut state = 13;
        for (slip_deg, first) in [(3.0, 3), (-2.0, 3), (3.0, 5), (-2.0, 6)] {
            let mut dwells = dwells(&[30.0; 8], &mut state);
            for dwell in &mut dwells[first..] {
                let (sin, cos) = crate::units::sin_cos_deg(dwell.index_deg() + slip_deg);
                (dwell.sin, dwell.cos) = (sin, cos);
            }
            assert!(fix(&dwells).unwrap().flags.contains(Flag::Misfit), "{slip_deg} {first}");
            dwells[first].doubted = true;
            let found = fix(&dwells).unwrap();
            assert_eq!(found.flags.iter().collect::<Vec<_>>(), [Flag::IndexSlip], "{slip_deg} {first}");
            let error_deg = wrap_180_deg(found.azimuth_deg - 30.0);
            assert!(error_deg.abs() < 4.0 * found.sigma_deg && found.sigma_deg < 0.3, "{slip_deg} {first} {found:?}");
        }
    }

    /// One dwell that is off, and a bias that jumps, are no turn.
    #[test]
    fn what_else_goes_wrong_is_no_turn() {
        let mut state = 5;
        for which in 0..8 {
            let mut off = dwells(&[30.0; 8], &mut state);
            off[which].rate.mean += 3.0;
            assert!(!fix(&off).is_ok_and(|fix| fix.flags.contains(Flag::Turned)), "{which}");
            let mut jumped = dwells(&[30.0; 8], &mut state);
            jumped[which..].iter_mut().for_each(|dwell| dwell.rate.mean += 1.0);
            assert!(!fix(&jumped).is_ok_and(|fix| fix.flags.contains(Flag::Turned)), "{which}");
        }
    }
}
