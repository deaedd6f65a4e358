//! Further runs of the same instrument: what a model that was learned from a campaign is worth.

use super::plan::{Plan, RunPlan};
use super::{Campaign, plain, record};
use crate::hidden::draw::Draw;

impl Campaign {
    /// Its fit runs alone, with their references.
    pub fn of_fit_runs(&self) -> Self {
        let chosen: Vec<usize> = (0..self.rows.len()).filter(|&run| self.plan.runs[run].is_fit).collect();
        self.of(chosen.iter().map(|&run| self.plan.runs[run].clone()).collect(), |place| {
            self.rows[chosen[place]].clone()
        })
    }

    /// So many runs of the same instrument with the same effects, which nobody surveyed, one after the other. Each has the order of one of this
    /// campaign's runs and the rest before it (early ones come first), heading, tilt and bias of others, and noise and channels of its own.
    pub fn fresh_runs(&self, count: usize, seed: u64) -> Self {
        let mut draw = Draw::new(seed, 0);
        let mut now_s = self.plan.runs.first().map_or(0, |run| run.started_s);
        let run = |number: usize| {
            let run = self.fresh_run(number * self.plan.runs.len() / count, now_s, &mut draw);
            now_s = run.started_s + run.seconds() as u64;
            run
        };
        let runs = (0..count).map(run).collect();
        let plan = Plan { runs, ..self.plan.clone() };
        let spreads = record::spreads(&self.plan);
        let rows = |number: usize| record::rows(&plan, number, &self.effects, &spreads, 1.0);
        self.of(plan.runs.clone(), rows)
    }

    fn fresh_run(&self, number: usize, now_s: u64, draw: &mut Draw) -> RunPlan {
        let other = |draw: &mut Draw| &self.plan.runs[draw.whole(0, self.plan.runs.len() - 1)];
        let like = &self.plan.runs[number];
        RunPlan {
            seed: draw.seed(),
            is_fit: false,
            azimuth_deg: other(draw).azimuth_deg,
            reference_deg: None,
            started_s: now_s + like.rest_s as u64,
            bias_deg_h: other(draw).bias_deg_h,
            tilt_rad: other(draw).tilt_rad,
            courses: self.plan.channels.iter().map(|channel| channel.course(draw, like.seconds())).collect(),
            ..like.clone()
        }
    }

    /// A campaign of these runs.
    fn of(&self, runs: Vec<RunPlan>, rows: impl Fn(usize) -> Vec<super::Row>) -> Self {
        let plan = Plan { runs, ..self.plan.clone() };
        let rows: Vec<Vec<super::Row>> = (0..plan.runs.len()).map(rows).collect();
        let plain_deg = rows.iter().enumerate().map(|(run, rows)| plain::azimuth_deg(&plan, run, rows)).collect();
        Self { plain_deg, oracle: vec![None; rows.len()], rows, plan, ..self.clone() }
    }

    /// Its surveyed runs.
    pub fn surveyed(&self) -> usize {
        self.plan.runs.iter().filter(|run| run.reference_deg.is_some()).count()
    }
}
