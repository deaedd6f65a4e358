//! What comes by itself in every run: with and without a rhythm that the runs share, with and without courses.

use std::sync::Arc;

use nalgebra::DVector;
use rayon::prelude::*;

use super::course::Course;
use super::group::Group;
use super::habits::Habits;
use super::learn::{Active, GAIN, Search, State};
use super::process::PROCESS;
use super::recording::median;
use super::rhythm_search::Finder;
use super::switching_search;
use super::waves;

/// Runs that are asked for what usually happens in them.
const RUNS_OF_HABITS: usize = 12;

/// A state with what happens in the runs by itself, what that is made of, and the log evidence of every run without groups.
pub struct Candidate {
    pub state: State,
    courses: Vec<Option<Arc<Course>>>,
    habits: Habits,
    bare: Vec<f64>,
    worth: f64,
}

impl Search<'_> {
    /// Learns. Where processes of the runs' own remain, also with a rhythm that the runs share, and each once more with what happens in
    /// each run by itself: the evidence decides. What the azimuths must decide between is given, without a rhythm first.
    pub fn learn(&mut self) -> Vec<Candidate> {
        let nothing = self.total(&Vec::new(), None);
        self.bare = self.of_each(&nothing);
        let plain = self.grow(nothing.clone());
        if plain.process_gain < PROCESS {
            return vec![self.candidate(plain)];
        }
        let rhythmic = self.with_rhythm(&nothing, &plain).map(|state| self.candidate(state));
        let from = if plain.active.is_empty() { vec![nothing] } else { vec![nothing, plain.clone()] };
        let plain = self.candidate(plain);
        let mut all = vec![self.with_courses(plain, from)];
        if let Some(rhythmic) = rhythmic {
            self.adopt(&rhythmic);
            let from = if rhythmic.state.process_gain < PROCESS { Vec::new() } else { vec![rhythmic.state.clone()] };
            all.push(self.with_courses(rhythmic, from));
        }
        all
    }

    /// A state beside what now happens in the runs by itself.
    fn candidate(&self, state: State) -> Candidate {
        let courses = self.runs.iter().map(|run| run.course.clone()).collect();
        let worth = self.worth(&state);
        Candidate { state, worth, courses, habits: self.habits.clone(), bare: self.bare.clone() }
    }

    /// Goes back to where a candidate was found.
    pub fn adopt(&mut self, candidate: &Candidate) {
        self.set_courses(candidate.courses.clone());
        self.habits.clone_from(&candidate.habits);
        self.bare.clone_from(&candidate.bare);
        self.size_course();
    }

    /// The best with what happens in each run by itself, or the candidate without.
    fn with_courses(&mut self, mut best: Candidate, from: Vec<State>) -> Candidate {
        for state in from {
            let without = state.evidence;
            self.find_courses(&state);
            let begun = self.total(&state.active, None);
            if begun.active.is_empty() && begun.evidence > without {
                self.bare = self.of_each(&begun);
            }
            let state = self.grow(begun);
            if self.worth(&state) > best.worth {
                best = self.candidate(state);
            }
        }
        best
    }

    /// The best state that has a rhythm: found beside nothing, or beside what was learned. `None` where it is worth less than that.
    fn with_rhythm(&mut self, nothing: &State, plain: &State) -> Option<State> {
        let from = if plain.active.is_empty() { vec![nothing] } else { vec![nothing, plain] };
        let mut best: Option<State> = None;
        for state in from {
            let Some((group, variance)) = self.find_rhythm(state) else { continue };
            let active: Active = state.active.iter().copied().chain([(group, variance)]).collect();
            let begun = self.total(&active, Some(&vec![0; self.runs.len()]));
            let state = self.grow(begun);
            if self.worth(&state) > self.worth(best.as_ref().unwrap_or(plain)) {
                best = Some(state);
            }
        }
        best
    }

    /// Adds the rhythm of what a state leaves of the runs; its group, and the prior variance of its weights.
    fn find_rhythm(&mut self, state: &State) -> Option<(usize, f64)> {
        let effects = self.learned_means(state);
        let finder = Finder { runs: &self.runs, effects: &effects, variances: &self.variances };
        let found = finder.find().filter(|found| found.worth() > GAIN)?;
        self.runs.iter_mut().zip(&found.phases).for_each(|(run, &phase)| run.sheet.phase = phase);
        let group = self.groups.len();
        self.add(vec![Group::Rhythm(found.rhythm)]);
        *self.costs.get_mut(group)? = found.cost;
        Some((group, self.variances[self.variances.len() / 2]))
    }

    /// What happens in the runs by themselves beside what a state has learned: with the habits that some of the runs speak for most,
    /// and once more with those that are found then.
    fn find_courses(&mut self, state: &State) {
        let means = self.learned_means(state);
        let residual = |place: usize| &self.runs[place].rate - &means[place];
        let find = |place: usize, habits: &Habits| Course::find(&self.runs[place].seen(true), &residual(place), habits);
        let likelihood = |place: usize, habits: &Habits| {
            let course = find(place, habits);
            let of_kernels = self.runs[place].log_likelihood(&residual(place), true, Some(&course));
            of_kernels.last().copied().unwrap_or(f64::NEG_INFINITY)
        };
        let some = self.runs.len().min(RUNS_OF_HABITS);
        let of_habits = |habits: Habits| {
            let each: Vec<f64> = (0..some).into_par_iter().map(|place| likelihood(place, &habits)).collect();
            (each.into_iter().sum::<f64>() - habits.cost(), habits)
        };
        let waves = waves::find(&self.runs, &means, &self.variances);
        let left: Vec<DVector<f64>> = (0..self.runs.len()).map(residual).collect();
        let switching = switching_search::find(&self.runs, &left);
        let best = Habits::all(&waves, switching).into_iter().map(of_habits).max_by(|a, b| a.0.total_cmp(&b.0));
        let mut habits = best.map_or_else(Habits::default, |best| best.1);
        let mut courses: Vec<Course> = Vec::new();
        for _ in 0..2 {
            courses = (0..self.runs.len()).into_par_iter().map(|place| find(place, &habits)).collect();
            habits = habits.taught(courses.iter().map(|course| &course.kinds[..]));
        }
        self.set_courses(courses.into_iter().map(|course| Some(Arc::new(course))).collect());
        self.habits = habits;
    }

    fn set_courses(&mut self, courses: Vec<Option<Arc<Course>>>) {
        self.runs.iter_mut().zip(courses).for_each(|(run, course)| run.course = course);
        self.grams = Default::default();
    }

    /// The last kernel as what courses are like: their usual size, and the time between what happens.
    fn size_course(&mut self) {
        let courses: Vec<Arc<Course>> = self.runs.iter().filter_map(|run| run.course.clone()).collect();
        if let Some(kernel) = self.kernels.last_mut().filter(|_| !courses.is_empty()) {
            kernel.size = median(courses.iter().map(|course| course.size_deg_h).collect()) / self.unit_deg_h;
            kernel.time_s = median(courses.iter().map(|course| course.length_s / (course.events + 1) as f64).collect());
        }
    }
}
