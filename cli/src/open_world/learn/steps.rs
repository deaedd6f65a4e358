//! The steps of the search: groups are taken, shifted, swapped for others and given up, by the evidence.

use rayon::prelude::*;

use super::super::group::Group;
use super::{Active, Alternative, GAIN, ROUNDS, SHARES, Search, State, Sums, posterior_of};

/// Gain below which a proposal is not tried.
const LEAST_PROPOSAL: f64 = 3.0;
/// Proposals beside each share of the own process that are looked at, by the number of runs, at least and at most; and how many
/// of all are tried in full.
const LOOKS_OF_RUNS: usize = 240;
const LOOKS: [usize; 2] = [6, 16];
const TRIALS: usize = 3;
/// Steps by which places of thresholds, bends and relays are shifted, half ranges of the channel.
const PLACE_STEPS: [f64; 4] = [0.04, 0.02, 0.01, 0.005];
/// Shifts by each of them.
const SHIFTS: usize = 2;
/// Gain of a shift that counts.
const SHIFTED: f64 = 0.3;
/// Most groups, and most swaps of one for another.
const MOST_GROUPS: usize = 8;
const MOST_SWAPS: usize = 10;
/// Gain of a swap.
const SWAP: f64 = 2.0;
/// Log evidence by which an alternative may be behind, and how many enter the average.
const BEHIND: f64 = 5.0;
const MOST_ALTERNATIVES: usize = 6;

impl Search<'_> {
    /// Takes groups until none is worth its penalty.
    pub fn grow(&mut self, mut state: State) -> State {
        let mut swaps = 0;
        if !state.active.is_empty() {
            state = self.polish(state, &mut swaps);
        }
        while state.active.len() < MOST_GROUPS {
            let Some((mut trial, penalty)) = self.best_trial(&state) else { break };
            if trial.evidence - penalty - state.evidence < GAIN {
                // Two together may do what neither does alone: an own process gives way to the whole of an effect only.
                let Some((both, of_second)) = self.best_trial(&trial) else { break };
                if both.evidence - penalty - of_second - state.evidence < 2.0 * GAIN {
                    break;
                }
                trial = both;
            }
            let before = state.evidence;
            let newest = trial.active.last().map(|each| each.0);
            state = self.polish(trial, &mut swaps);
            state = self.shift(state);
            if let Some(newest) = newest.filter(|newest| state.active.iter().any(|each| each.0 == *newest)) {
                self.extend(newest, &state);
            }
            if state.evidence - before < 0.5 * GAIN {
                break;
            }
        }
        state
    }

    /// The best of the proposed groups by the evidence less its penalty, which is also given.
    fn best_trial(&mut self, state: &State) -> Option<(State, f64)> {
        let places: Vec<usize> = (0..state.active.len()).collect();
        // A group with its prior variance, and whether the runs' processes are left to it.
        let mut proposed: Vec<(usize, f64, bool)> = Vec::new();
        for (number, share) in SHARES.into_iter().enumerate() {
            if share < 1.0 && state.of_run.iter().all(|&kernel| kernel == 0) {
                continue;
            }
            self.refresh(number, &state.of_run);
            let sums = self.sums(&state.active, &state.of_run, number);
            let gains = self.gains(&sums, &state.active, &places);
            let mut order: Vec<(usize, f64, f64)> = gains
                .iter()
                .enumerate()
                .filter_map(|(group, gain)| gain.map(|(gain, variance)| (group, gain, variance)))
                .filter(|each| each.1 >= LEAST_PROPOSAL)
                .collect();
            let worth = |each: &(usize, f64, f64)| each.1 - self.penalty(each.0);
            order.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
            for (group, _, variance) in
                order.into_iter().take((LOOKS_OF_RUNS / self.runs.len()).clamp(LOOKS[0], LOOKS[1]))
            {
                if !proposed.iter().any(|each| each.0 == group && each.2 == (share < 1.0)) {
                    proposed.push((group, variance, share < 1.0));
                }
            }
        }
        // An effect that begins without any process need not be taken away from one first.
        let none = vec![0; self.runs.len()];
        let look = |&(group, variance, fresh): &(usize, f64, bool), rounds: usize| {
            let active: Active = state.active.iter().copied().chain([(group, variance)]).collect();
            let from = if fresh { &none } else { &state.of_run };
            (self.total_in(&active, Some(from), rounds), self.penalty(group))
        };
        let worth = |each: &(State, f64)| each.0.evidence - each.1;
        let mut looked: Vec<(f64, &(usize, f64, bool))> =
            proposed.par_iter().map(|each| (worth(&look(each, 1)), each)).collect();
        looked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let tried: Vec<(State, f64)> = looked.into_iter().take(TRIALS).map(|(_, each)| look(each, ROUNDS)).collect();
        tried.into_iter().max_by(|a, b| worth(a).total_cmp(&worth(b)))
    }

    /// Thresholds, bends and relays to where the evidence is greatest.
    fn shift(&mut self, mut state: State) -> State {
        for step in PLACE_STEPS.into_iter().flat_map(|step| [step; SHIFTS]) {
            let near: Vec<(usize, Group)> = state
                .active
                .iter()
                .enumerate()
                .flat_map(|(place, each)| {
                    self.groups[each.0].neighbours(step).into_iter().map(move |group| (place, group))
                })
                .collect();
            let new: Vec<Group> =
                near.iter().map(|each| each.1.clone()).filter(|each| !self.groups.contains(each)).collect();
            self.add(new);
            let shifted = near.into_par_iter().filter_map(|(place, group)| {
                let mut active = state.active.clone();
                active[place].0 = self.groups.iter().position(|each| *each == group)?;
                Some(self.total(&active, Some(&state.of_run)))
            });
            let best = shifted.max_by(|a, b| a.evidence.total_cmp(&b.evidence));
            if let Some(best) = best.filter(|best| best.evidence > state.evidence + SHIFTED) {
                state = best;
            }
        }
        state
    }

    /// Sizes again, swaps of a group for a better one, and groups that have become superfluous go.
    fn polish(&mut self, mut state: State, swaps: &mut usize) -> State {
        loop {
            self.refresh(0, &state.of_run);
            let sums = self.sums(&state.active, &state.of_run, 0);
            self.reweigh(&sums, &mut state.active);
            let all: Vec<usize> = (0..state.active.len()).collect();
            let own = self.evidence(&sums, &state.active, &all);
            let without = |place: usize| all.iter().copied().filter(|&each| each != place).collect::<Vec<_>>();
            let mut best: Option<(f64, usize, usize, f64)> = None;
            let mut least: Option<(f64, usize)> = None;
            for place in 0..state.active.len() {
                let rest = without(place);
                let bare = self.evidence(&sums, &state.active, &rest);
                let lost = own - bare;
                if lost < GAIN && least.is_none_or(|least| lost < least.0) {
                    least = Some((lost, place));
                }
                if *swaps >= MOST_SWAPS {
                    continue;
                }
                let worth = own - self.penalty(state.active[place].0);
                for (group, gain) in self.gains(&sums, &state.active, &rest).into_iter().enumerate() {
                    let Some((gain, variance)) = gain.filter(|_| group != state.active[place].0) else { continue };
                    let better = bare + gain - self.penalty(group) - worth;
                    if better > SWAP && best.is_none_or(|best| better > best.0) {
                        best = Some((better, place, group, variance));
                    }
                }
            }
            if let Some((_, place, group, variance)) = best {
                *swaps += 1;
                let mut active = state.active.clone();
                active[place] = (group, variance);
                state = self.total(&active, Some(&state.of_run));
                continue;
            }
            if let Some((_, place)) = least {
                let mut active = state.active.clone();
                active.remove(place);
                state = self.total(&active, Some(&state.of_run));
                continue;
            }
            return self.total(&state.active, Some(&state.of_run));
        }
    }

    /// Prior variances of the active groups again, one beside the others.
    fn reweigh(&self, sums: &Sums, active: &mut Active) {
        for _ in 0..ROUNDS {
            for place in 0..active.len() {
                let rest: Vec<usize> = (0..active.len()).filter(|&each| each != place).collect();
                active[place].1 = self.gain_of(sums, active, &rest, active[place].0).1;
            }
        }
    }

    /// Products of what a newly accepted group was found to be with every base, and what its channels do together.
    fn extend(&mut self, newest: usize, state: &State) {
        if self.groups[newest].level() > 2.0 {
            return;
        }
        let each = self.of_runs(&state.active, &state.of_run);
        let found = posterior_of(&each, &self.prior(&state.active)).0.mean;
        let mut start = 0;
        for &(group, _) in &state.active {
            let width = self.width(group);
            if group == newest {
                let weights: Vec<f64> = found.rows(start, width).iter().map(|w| w * self.factors[group]).collect();
                let tilt = self.runs[0].sheet.recording.tilt_g.is_some();
                let mut new = self.groups[group].extensions(&weights, self.scales.channels.len(), tilt);
                new.retain(|each| !self.groups.contains(each));
                self.add(new);
                return;
            }
            start += width;
        }
    }

    /// Models whose evidence is near: every active group in turn retuned by another that does nearly as well.
    pub fn alternatives(&mut self, state: &State) -> Vec<Alternative> {
        self.refresh(0, &state.of_run);
        let sums = self.sums(&state.active, &state.of_run, 0);
        let all: Vec<usize> = (0..state.active.len()).collect();
        let own = self.evidence(&sums, &state.active, &all);
        let mut found = Vec::new();
        for place in 0..state.active.len() {
            let rest: Vec<usize> = all.iter().copied().filter(|&each| each != place).collect();
            let bare = self.evidence(&sums, &state.active, &rest);
            let worth = own - self.penalty(state.active[place].0);
            for (group, gain) in self.gains(&sums, &state.active, &rest).into_iter().enumerate() {
                let Some((gain, variance)) = gain.filter(|_| group != state.active[place].0) else { continue };
                let behind = bare + gain - self.penalty(group) - worth;
                if behind > -BEHIND {
                    let mut active = state.active.clone();
                    active[place] = (group, variance);
                    found.push(Alternative { behind, active });
                }
            }
        }
        found.sort_by(|a, b| b.behind.total_cmp(&a.behind));
        found.truncate(MOST_ALTERNATIVES);
        found
    }
}
