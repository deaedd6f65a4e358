//! Finds the still intervals of a continuous recording.

use calibration::still::{Block, BlockMean, Rest};
use quantities::median::median;

/// Time that readings of a block span, s, where the rate allows it.
const BLOCK_S: f64 = 0.25;
/// Fewest readings in a block.
const LEAST_IN_BLOCK: f64 = 3.0;
/// Shortest rest that is an attitude, s.
const LEAST_REST_S: f64 = 1.0;
/// Fewest blocks of a rest.
const LEAST_BLOCKS: usize = 3;
/// Part of the recording that is taken to be at rest, at least.
const QUIET_PART: f64 = 0.1;
/// A block at rest scatters by no more than this factor over the noise …
const LIMIT: f64 = 3.0;
/// … or this over the root of the number of its readings: half of the limit is what the means of two blocks may be apart,
/// 4.5 standard deviations of their difference.
const LIMIT_OF_SHORT: f64 = 12.7;
/// Deviate of the normal distribution of which [`QUIET_PART`] is below.
const QUIET_DEVIATE: f64 = -1.2816;
/// Part of the blocks that is left out at either end of their range: of nine attitudes, the fewest for a calibration, each has five times as many.
const SPARED_PART: f64 = 0.02;
/// Rest scatters by less than this part of what the readings range over.
const MOST_NOISE: f64 = 0.02;
/// Neighbouring rests whose means differ by less than this part of the range are one attitude, interrupted.
const SAME: f64 = 0.01;
/// A rest of as many blocks has its first and its last one left out: the hand may be on it.
const TRIMMED_FROM: usize = 6;

/// A still interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Rested {
    /// First and last moment, s.
    pub t_s: [f64; 2],
    /// Means of its blocks.
    pub blocks: Vec<[f64; 3]>,
    /// Blocks in between that were not at rest: a shock.
    pub shocks: u16,
}

/// Nothing in the recording is at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Restless {
    TooShort {
        seconds: f64,
    },
    /// The quietest part scatters by this part of what the readings range over.
    Moving {
        noise: f64,
    },
}

impl std::fmt::Display for Restless {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::TooShort { seconds } => write!(f, "{seconds:.1} s of readings are too short a recording"),
            Self::Moving { noise } => write!(
                f,
                "the triad moves throughout: even the quietest tenth of the recording scatters by {:.1} % of the range of \
                 the readings, and it rests nowhere for {LEAST_REST_S} s (at most {:.0} % is rest)",
                100.0 * noise,
                100.0 * MOST_NOISE
            ),
        }
    }
}

/// Finds the rests among readings `t_s, x, y, z`. `resolution`: smallest step of the readings.
pub fn rests(rows: &[[f64; 4]], resolution: f64) -> Result<Vec<Rested>, Restless> {
    let mut steps: Vec<_> = rows.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let step_s = median(&mut steps).unwrap_or(0.0);
    let seconds = step_s * rows.len() as f64;
    let size = (BLOCK_S / step_s).round().clamp(LEAST_IN_BLOCK, f64::from(u16::MAX)) as u16;
    let block_s = f64::from(size) * step_s;
    let least = LEAST_BLOCKS.max((LEAST_REST_S / block_s).ceil() as usize);
    let blocks = blocks(rows, size);
    let mut spreads: Vec<_> = blocks.iter().map(|(_, block)| block.spread).collect();
    spreads.sort_unstable_by(f64::total_cmp);
    let Some(floor) = spreads.get((QUIET_PART * spreads.len() as f64) as usize) else {
        return Err(Restless::TooShort { seconds });
    };
    // A converter's step is noise too, with a standard deviation of step/√12.
    let noise = (floor / quiet_ratio(size)).max(resolution / 12f64.sqrt());
    let range = half_range(&blocks);
    if noise > MOST_NOISE * range {
        return Err(Restless::Moving { noise: noise / range });
    }
    let limit = LIMIT.max(LIMIT_OF_SHORT / f64::from(size).sqrt());
    let mut rests = Vec::new();
    for mut run in runs(rows, usize::from(size), limit * noise) {
        if run.len() >= TRIMMED_FROM {
            run = run[1..run.len() - 1].to_vec();
        }
        if run.len() >= least {
            rests.push(rested(&run, block_s));
        }
    }
    join(&mut rests, SAME * range, block_s);
    if rests.is_empty() {
        return Err(Restless::Moving { noise: noise / range });
    }
    Ok(rests)
}

/// What part of the noise the quietest [`QUIET_PART`] of blocks of so many readings scatters by: the root of a chi-square
/// over its 3 (size − 1) degrees of freedom. Source: E. B. Wilson and M. M. Hilferty, Proceedings of the National Academy
/// of Sciences 17, 1931, p. 684.
fn quiet_ratio(size: u16) -> f64 {
    let ninth = 2.0 / (9.0 * 3.0 * f64::from(size - 1));
    (1.0 - ninth + QUIET_DEVIATE * ninth.sqrt()).powf(1.5)
}

/// Blocks with the time of their last reading.
fn blocks(rows: &[[f64; 4]], size: u16) -> Vec<(f64, Block)> {
    let mut mean = BlockMean::new(size);
    rows.iter().filter_map(|&[t_s, x, y, z]| mean.push([x, y, z]).map(|block| (t_s, block))).collect()
}

/// Half of what the readings range over, on the axis with the widest range; without the blocks at either end that absurd readings or a shock
/// may have made.
fn half_range(blocks: &[(f64, Block)]) -> f64 {
    let range = |axis: usize| {
        let mut values: Vec<_> = blocks.iter().map(|(_, block)| block.mean[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let spared = (SPARED_PART * values.len() as f64).ceil() as usize;
        let inner = values.get(spared..values.len().saturating_sub(spared)).unwrap_or_default();
        inner.first().zip(inner.last()).map_or(0.0, |(low, high)| 0.5 * (high - low))
    };
    (0..3).map(range).fold(0.0, f64::max)
}

/// Runs of blocks that rest, by the largest spread of a block. Where nothing rests a block may begin at any reading, so
/// that those of a rest begin with it, however few they are.
fn runs(rows: &[[f64; 4]], size: usize, spread: f64) -> Vec<Vec<(f64, Block)>> {
    let mut runs = Vec::new();
    let (mut run, mut rest) = (Vec::new(), Rest::default());
    let mut start = 0;
    while let Some(block) = rows.get(start..start + size).and_then(|rows| blocks(rows, size as u16).pop()) {
        if rest.continues(&block.1, spread) {
            run.push(block);
            start += size;
        } else if run.is_empty() {
            start += 1;
        } else {
            runs.push(std::mem::take(&mut run));
            rest = Rest::default();
        }
    }
    runs.push(run);
    runs
}

fn rested(blocks: &[(f64, Block)], block_s: f64) -> Rested {
    let from_s = blocks.first().map_or(0.0, |(t_s, _)| t_s - block_s);
    let to_s = blocks.last().map_or(0.0, |(t_s, _)| *t_s);
    Rested { t_s: [from_s, to_s], blocks: blocks.iter().map(|(_, block)| block.mean).collect(), shocks: 0 }
}

/// Joins neighbours at the same attitude.
fn join(rests: &mut Vec<Rested>, same: f64, block_s: f64) {
    let mut joined: Vec<Rested> = Vec::with_capacity(rests.len());
    for rest in rests.drain(..) {
        match joined.last_mut() {
            Some(last) if apart(last, &rest) < same => {
                // A part of a block is one, but for rounding.
                last.shocks += ((rest.t_s[0] - last.t_s[1]) / block_s - 0.01).ceil() as u16;
                last.t_s[1] = rest.t_s[1];
                last.blocks.extend(rest.blocks);
            }
            _ => joined.push(rest),
        }
    }
    *rests = joined;
}

fn apart(a: &Rested, b: &Rested) -> f64 {
    let mean = |rest: &Rested, axis: usize| {
        rest.blocks.iter().map(|block| block[axis]).sum::<f64>() / rest.blocks.len() as f64
    };
    (0..3).map(|axis| (mean(a, axis) - mean(b, axis)).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use hal_sim::triad::{AccelerometerTriad, Placement, even_directions, place_by_hand};

    use super::*;

    fn rows(placement: &Placement, noise: f64) -> Vec<[f64; 4]> {
        let triad = AccelerometerTriad { noise, ..AccelerometerTriad::default() };
        place_by_hand(&triad, placement, 1)
            .iter()
            .map(|reading| [reading.t_s, reading.raw[0], reading.raw[1], reading.raw[2]])
            .collect()
    }

    fn placement(rest_s: f64, move_s: f64) -> Placement {
        Placement { up: even_directions(15, 4), rest_s, move_s, rate_hz: 100.0, shake_g: 0.02, rest_shake_g: 0.0 }
    }

    #[test]
    fn every_rest_is_found_and_no_move() {
        let found = rests(&rows(&placement(3.0, 1.5), 1e-3), 0.0).unwrap();
        assert_eq!(found.len(), 15);
        for (i, rest) in found.iter().enumerate() {
            let from_s = 4.5 * i as f64;
            assert!(rest.t_s[0] >= from_s - 0.01 && rest.t_s[1] <= from_s + 3.01, "{i}: {:?}", rest.t_s);
            assert!(rest.blocks.len() >= 9);
        }
    }

    #[test]
    fn slow_and_coarse_readings_do() {
        let placement = Placement { rate_hz: 4.0, ..placement(6.0, 2.0) };
        let coarse: Vec<_> = rows(&placement, 0.0)
            .iter()
            .map(|[t_s, x, y, z]| [*t_s, 64.0 * x, 64.0 * y, 64.0 * z].map(f64::round))
            .collect();
        let timed: Vec<_> = coarse.iter().zip(1..).map(|([_, x, y, z], i)| [f64::from(i) / 4.0, *x, *y, *z]).collect();
        assert_eq!(rests(&timed, 1.0).unwrap().len(), 15);
    }

    #[test]
    fn ten_readings_a_second_apart_are_a_rest() {
        let found = rests(&rows(&Placement { rate_hz: 1.0, ..placement(10.0, 0.0) }, 1e-3), 0.0).unwrap();
        assert_eq!(found.len(), 15);
        assert!(found.iter().all(|rest| rest.blocks.len() == 3), "{found:?}");
    }

    #[test]
    fn one_that_moves_throughout_is_told() {
        let restless = rests(&rows(&placement(0.0, 4.0), 1e-3), 0.0);
        assert!(matches!(restless, Err(Restless::Moving { .. })), "{restless:?}");
        let shaken = rests(&rows(&Placement { rest_shake_g: 0.05, ..placement(3.0, 1.0) }, 1e-3), 0.0);
        assert!(matches!(shaken, Err(Restless::Moving { .. })), "{shaken:?}");
        assert_eq!(rests(&[[0.0, 0.0, 0.0, 1.0]], 0.0).unwrap_err(), Restless::TooShort { seconds: 0.0 });
    }

    #[test]
    fn an_absurd_reading_is_a_shock_and_joins_no_attitudes() {
        let mut rows = rows(&placement(6.0, 1.0), 1e-3);
        rows[320][3] = 1e25;
        let rests = rests(&rows, 0.0).unwrap();
        assert_eq!(rests.len(), 15);
        assert!(rests[0].shocks >= 1 && rests[1].shocks == 0);
        assert!(rests.iter().flat_map(|rest| &rest.blocks).all(|block| block.iter().all(|value| value.abs() < 100.0)));
    }

    #[test]
    fn a_bump_does_not_make_two_attitudes_of_one() {
        let mut rows = rows(&placement(6.0, 1.0), 1e-3);
        rows[320][2] += 0.5;
        let rests = rests(&rows, 0.0).unwrap();
        assert_eq!(rests.len(), 15);
        assert!(rests[0].shocks >= 1 && rests[1].shocks == 0);
    }
}
