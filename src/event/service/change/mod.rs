//! Does a signal go on as it did? A sequential test with a false-alarm rate that is derived, small enough for a board.
//!
//! **What is expected.** A [`Level`] whose ratios q/r and s/r are not known: the mixture over a grid of both (`WANDERS`, `SWITCHES`), weighted by how well each predicts
//! what was seen. The variance r of a fix is not known either, with the prior 1/r: the likelihood of n innovations eᵢ of variances r·vᵢ is then
//! ∏ vᵢ^(−1/2) · S^(−n/2) with S = Σ eᵢ²/vᵢ (Jeffreys 1961). After the baseline the `MEMBERS` ratios of most weight are kept.
//!
//! **The test.** A change that began at fix j adds d·cᵢ to the fixes since then: cᵢ = 1 (a step), or the fixes since j (a ramp). In the innovations it is d·gᵢ; with
//! a = Σ eᵢgᵢ/vᵢ, I = Σ gᵢ²/vᵢ and d ~ N(0, τ²r) its likelihood over that without it is
//!
//! Λ = (1 + τ²I)^(−1/2) · (1 − τ²a² / ((1 + τ²I)·S))^(−n/2).
//!
//! Λ is a martingale of mean 1 where nothing changed, so that R(t) = Σⱼ mean of Λ over both shapes, the statistic of Shiryaev and Roberts,
//! has R(t) − t as a martingale of mean 0. Stopped when R first reaches A, the mean number of fixes until a false alarm is E\[T\] = E\[R(T)\] ≥ A
//! (Pollak 1985; Shin, Ramdas and Rinaldo 2023 call it an e-detector). The mean of R over several signals is such a statistic, too. Starts that are
//! forgotten make R smaller and false alarms rarer.

use heapless::Vec;

use super::level::{Followed, Gain, Innovation, Level};
use crate::bounded::bounded;

/// Fixes that say what is normal.
pub const BASELINE: usize = 100;
/// The statistic at which the model no longer holds; also the least mean number of fixes between false alarms.
pub const ALARM: f64 = 1000.0;
/// Variances of the wander from fix to fix and of a switch-on, in those of a fix. A bias that wanders by more than 0.1 sigma a fix loses a sigma in a hundred
/// fixes by itself: there the model has changed.
const WANDERS: [f64; 3] = [0.0, 0.002, 0.01];
const SWITCHES: [f64; 4] = [0.0, 0.3, 1.5, 10.0];
const GRID: usize = WANDERS.len() * SWITCHES.len();
/// Ratios that stay after the baseline.
const MEMBERS: usize = 2;
/// Starts that are remembered; with these and the members a signal takes 1.1 KB of a board's memory.
const STARTS: usize = 12;
/// For so many fixes: a ramp of three sigma in a hundred fixes is found within a hundred.
const REACH: u32 = 150;
/// One sigma of a step, and of a ramp over a hundred fixes, in sigmas of a fix: two, and three, are to be found soon.
const STEP: f32 = 2.0;
const RAMP: f32 = 4.0;
const RAMP_FIXES: f32 = 100.0;
/// No likelihood ratio is greater: sums of them stay numbers.
const GREATEST: f32 = 1e30;

/// What the fixes since a start show of a change of unit size.
#[derive(Clone, Copy, Debug, Default)]
struct Trace {
    followed: Followed,
    /// a and I.
    score: f32,
    information: f32,
}

/// An innovation as traces take it: its gain, its value over its variance, and one over its variance.
struct Shown {
    gain: Gain,
    score: f32,
    information: f32,
}

impl From<Innovation> for Shown {
    fn from(Innovation { value, variance, gain }: Innovation) -> Self {
        Self { gain, score: (value / variance) as f32, information: (1.0 / variance) as f32 }
    }
}

impl Trace {
    /// Takes a fix, at which the change has reached `now`.
    fn next(&mut self, now: f32, shown: &Shown) {
        let seen = self.followed.seen(now, shown.gain);
        self.score += seen * shown.score;
        self.information += seen * seen * shown.information;
    }

    /// Λ for a change of so many sigmas of a fix. In single precision: a board reads thousands of fixes when it starts, each with a hundred of these.
    fn likelihood_ratio(&self, size: f32, squares: f32, half_count: f32) -> f32 {
        let square = size * size;
        let spread = 1.0 + square * self.information;
        let explained = square * self.score * self.score / (spread * squares);
        libm::expf(-0.5 * libm::logf(spread) - half_count * libm::log1pf(-explained)).min(GREATEST)
    }
}

/// A level and how well it predicted.
#[derive(Clone, Debug)]
struct Member {
    level: Level,
    /// S, and Σ ln v.
    squares: f64,
    logs: f64,
}

impl Member {
    fn next(&mut self, value: f64, switched: bool) -> Innovation {
        let innovation = self.level.next(value, switched);
        self.squares += innovation.value * innovation.value / innovation.variance;
        self.logs += libm::log(innovation.variance);
        innovation
    }

    fn log_weight(&self, half_count: f64) -> f64 {
        -0.5 * self.logs - half_count * libm::log(self.squares)
    }
}

/// A member that is watched: what it has seen of changes that began at each of the starts, step and ramp.
#[derive(Clone, Debug)]
struct Watched {
    member: Member,
    traces: Vec<[Trace; 2], STARTS>,
}

/// A fix at which the changes that are looked for may have begun.
#[derive(Clone, Copy, Debug)]
struct Start {
    fix: u32,
    /// Its own, and that of the starts whose place it took.
    weight: f32,
    /// Λ of its changes.
    ratio: f32,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // without a heap there is no other place
enum Stage {
    Empty,
    /// The signal did not move in the baseline.
    Still,
    Learning(Vec<Member, GRID>),
    Watching(Vec<Watched, MEMBERS>),
}

/// The test of one signal.
#[derive(Clone, Debug)]
pub struct ChangeTest {
    stage: Stage,
    /// Fixes that were seen.
    count: u32,
    starts: Vec<Start, STARTS>,
}

impl Default for ChangeTest {
    fn default() -> Self {
        Self { stage: Stage::Empty, count: 0, starts: Vec::new() }
    }
}

impl ChangeTest {
    /// Of a signal that is expected to be 0 with a variance of 1, which is trusted as if a baseline had shown it.
    pub fn known() -> Self {
        let member = Member { level: Level::known(0.0), squares: (BASELINE - 1) as f64, logs: 0.0 };
        let watched = Watched { member, traces: Vec::new() };
        Self { stage: Stage::Watching(bounded([watched])), count: BASELINE as u32, starts: Vec::new() }
    }

    /// Takes the next fix. Gives the statistic of Shiryaev and Roberts once the baseline is over; never of a signal that does not move in it.
    // Not inlined: the stages are built on the stack only here.
    #[inline(never)]
    pub fn next(&mut self, value: f64, switched: bool) -> Option<f64> {
        self.count = self.count.saturating_add(1);
        let half_count = self.half_count();
        match &mut self.stage {
            Stage::Empty => {
                let grid = WANDERS.iter().flat_map(|&wander| SWITCHES.iter().map(move |&switch| (wander, switch)));
                let members = grid.map(|(wander, switch)| {
                    let level = Level::new(wander, switch, value);
                    Member { level, squares: 0.0, logs: 0.0 }
                });
                self.stage = Stage::Learning(bounded(members));
                None
            }
            Stage::Learning(members) => {
                for member in members.iter_mut() {
                    member.next(value, switched);
                }
                if self.count as usize == BASELINE {
                    let moves = members.iter().all(|member| member.squares > 0.0);
                    self.stage = if moves { Stage::Watching(foremost(members, half_count)) } else { Stage::Still };
                }
                None
            }
            Stage::Still => None,
            Stage::Watching(_) => Some(self.watch(value, switched)),
        }
    }

    /// The level that predicts best, with the variance of a fix; `None` in the baseline.
    pub fn foremost(&self) -> Option<(&Level, f64)> {
        let Stage::Watching(members) = &self.stage else { return None };
        let half_count = self.half_count();
        let weight = |watched: &&Watched| watched.member.log_weight(half_count);
        let best = members.iter().max_by(|a, b| weight(a).total_cmp(&weight(b)))?;
        Some((&best.member.level, best.member.squares / (2.0 * half_count)))
    }

    /// Half of the number of innovations.
    fn half_count(&self) -> f64 {
        0.5 * f64::from(self.count.saturating_sub(1))
    }

    fn watch(&mut self, value: f64, switched: bool) -> f64 {
        let forgotten = self.forget();
        let _ = self.starts.push(Start { fix: self.count, weight: 1.0, ratio: 0.0 });
        let half_count = self.half_count();
        let Stage::Watching(members) = &mut self.stage else { return 0.0 };
        for Watched { member, traces } in members.iter_mut() {
            if let Some(at) = forgotten {
                let _ = taken_out(traces, at);
            }
            let _ = traces.push(Default::default());
            let shown = Shown::from(member.next(value, switched));
            for ([step, ramp], start) in traces.iter_mut().zip(&self.starts) {
                let age = (self.count - start.fix + 1) as f32;
                step.next(1.0, &shown);
                ramp.next(age / RAMP_FIXES, &shown);
            }
        }
        let weight = |watched: &Watched| watched.member.log_weight(half_count);
        let most = members.iter().map(weight).fold(f64::NEG_INFINITY, f64::max);
        let share = |watched: &Watched| libm::exp(weight(watched) - most);
        let total: f64 = members.iter().map(share).sum();
        self.starts.iter_mut().for_each(|start| start.ratio = 0.0);
        for watched in members.iter() {
            let (share, squares) = ((share(watched) / total) as f32, watched.member.squares as f32);
            let ratio = |trace: &Trace, size| trace.likelihood_ratio(size, squares, half_count as f32);
            for (start, [step, ramp]) in self.starts.iter_mut().zip(&watched.traces) {
                start.ratio += share * 0.5 * (ratio(step, STEP) + ratio(ramp, RAMP));
            }
        }
        self.starts.iter().map(|start| f64::from(start.weight) * f64::from(start.ratio)).sum()
    }

    /// Makes room for another start where there is none. The one that lies closest between its neighbours, for its age, gives its part of the statistic to
    /// the neighbour of greater Λ: R stays what it is, and what its difference from t is.
    fn forget(&mut self) -> Option<usize> {
        if self.starts.first().is_some_and(|oldest| self.count - oldest.fix > REACH) {
            let _ = taken_out(&mut self.starts, 0);
            return Some(0);
        }
        if !self.starts.is_full() {
            return None;
        }
        let gap = |three: &[Start]| match three {
            [before, _, after] => f64::from(after.fix - before.fix) / f64::from(self.count - after.fix),
            _ => f64::INFINITY,
        };
        let inner = self.starts.windows(3).enumerate().min_by(|(_, a), (_, b)| gap(a).total_cmp(&gap(b)));
        let at = inner.map_or(0, |(before, _)| before + 1);
        let gone = taken_out(&mut self.starts, at)?;
        let neighbours = self.starts.iter_mut().skip(at.saturating_sub(1)).take(2);
        if let Some(neighbour) = neighbours.max_by(|a, b| a.ratio.total_cmp(&b.ratio)).filter(|start| start.ratio > 0.0)
        {
            neighbour.weight += gone.weight * (gone.ratio / neighbour.ratio);
        }
        Some(at)
    }
}

/// Takes the element of that number out, and keeps the order of the others.
fn taken_out<T: Copy, const N: usize>(list: &mut Vec<T, N>, at: usize) -> Option<T> {
    let gone = *list.get(at)?;
    let mut place = 0..;
    list.retain(|_| place.next() != Some(at));
    Some(gone)
}

/// The members of most weight.
fn foremost(members: &mut Vec<Member, GRID>, half_count: f64) -> Vec<Watched, MEMBERS> {
    members.sort_unstable_by(|a, b| b.log_weight(half_count).total_cmp(&a.log_weight(half_count)));
    bounded(members.iter().take(MEMBERS).map(|member| Watched { member: member.clone(), traces: Vec::new() }))
}

#[cfg(test)]
mod tests;
