//! A model under way: effects beside a process of the runs' own, and what the evidence says of them.

use nalgebra::{DMatrix, DVector};
use north_finder::effects::doubt::{Kernel, Process};
use north_finder::effects::effect::{Effect, Port};
use rayon::prelude::*;

use super::family::Known;
use super::functions::Library;
use super::grammar::{Grammar, complexity, largest, ports_of_changes};
use super::problem::{Fit, Gram, Problem, Term, fit_sizes};
use super::rows::Run;

/// A form that is less likely than another by more than this is no rival of it, nats: e^-4 is two in a hundred.
pub const NEGLIGIBLE: f64 = 4.0;
/// Turns of the sizes' fixed point; it moves by less than 2 % then.
const TURNS: usize = 30;

/// Up to this root mean square errors of the index are taken as linear, degrees: e²/2 of the rate is 4e-5 of it then.
pub const LINEAR_INDEX_DEG: f64 = 0.5;
/// Times that what is beyond linear is taken out: of an error of 5° (0.087) 0.4 % of the rate are, and what is left falls by a factor of ten each time.
const TURNS_OF_INDEX: usize = 2;

/// Offsets of the rests that are tried: the noise of a row by these powers of two, from less than a dwell's mean shows to a hundred times the noise.
const OFFSETS: std::ops::RangeInclusive<i32> = -3..=8;

/// Shortest period of ringing that rates of a second show: some ten of them.
const SHORTEST_PERIOD_S: f64 = 10.0;

/// A model under way.
pub struct Model<'a> {
    pub process: Option<Process>,
    pub problem: Problem<'a>,
    pub terms: Vec<Term>,
    pub fit: Fit,
}

impl<'a> Model<'a> {
    /// Of these effects in these runs; sizes are fitted. What large errors of the index add beyond what is linear in them is taken out.
    pub fn new(runs: &'a [Run], process: Option<Process>, terms: &[Term]) -> Option<Self> {
        let problem = Problem::with_known(runs, process.as_ref(), terms);
        let mut gram = Gram::new(&problem, terms);
        let mut terms = terms.to_vec();
        let sizes2: Vec<f64> = terms.iter().map(|term| term.size2).collect();
        let fit = fit_sizes(&problem, &gram, &mut terms, TURNS)?;
        let mut model = Self { process, problem, terms, fit };
        let mut taken_out: Vec<f64> = Vec::new();
        for _ in 0..TURNS_OF_INDEX {
            let Some(beyond) = model.beyond_linear() else { break };
            let before = taken_out.iter().chain(std::iter::repeat(&0.0));
            model.problem.take_out(&beyond.iter().zip(before).map(|(all, before)| all - before).collect::<Vec<f64>>());
            taken_out = beyond;
            model.terms.iter_mut().zip(&sizes2).for_each(|(term, size2)| term.size2 = *size2);
            gram = gram.with_residual(&model.problem.residual);
            model.fit = fit_sizes(&model.problem, &gram, &mut model.terms, TURNS)?;
        }
        Some(model)
    }

    /// What its effects add at the ports that are wanted, each in its port's unit, by the row, all runs one after the other.
    pub fn added(&self, is_wanted: impl Fn(Port) -> bool) -> Vec<(Port, Vec<f64>)> {
        if !self.terms.iter().any(|term| is_wanted(term.effect.port)) {
            return Vec::new();
        }
        let (means, _) = self.weights();
        let mut first = 0;
        let mut all = Vec::new();
        for term in &self.terms {
            let own = first..first + term.values.len();
            first = own.end;
            if is_wanted(term.effect.port) {
                let mut sum = vec![0.0; term.functions.first().map_or(0, Vec::len)];
                for (function, mean) in term.functions.iter().zip(&means.as_slice()[own]) {
                    sum.iter_mut().zip(function).for_each(|(sum, value)| *sum += mean * value);
                }
                all.push((term.effect.port, sum));
            }
        }
        all
    }

    /// What its errors of the index add to the rates beyond what is linear in them, °/h, all runs one after the other; `None` where they are small.
    fn beyond_linear(&self) -> Option<Vec<f64>> {
        let sum = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).map(|(a, b)| a + b).collect();
        let errors = self.added(|port| port == Port::Index).into_iter().map(|(_, errors)| errors);
        let error_deg = errors.reduce(sum).filter(|errors| !is_within(errors, LINEAR_INDEX_DEG))?;
        let mut rest = error_deg.as_slice();
        let of_run = |run: &Run| {
            let (own, others) = rest.split_at(run.rows());
            rest = others;
            run.beyond_linear(own)
        };
        Some(self.problem.runs.iter().flat_map(of_run).collect())
    }

    /// Its effects, in order.
    pub fn effects(&self) -> Vec<Effect> {
        self.terms.iter().map(|term| term.effect.clone()).collect()
    }

    /// What is known of those of its effects that are the family's.
    pub fn known(&self) -> impl Iterator<Item = &Known> {
        self.terms.iter().filter_map(|term| term.known.as_ref().map(|(known, _)| known))
    }

    /// Its effects that are not the family's.
    pub fn found(&self) -> Vec<Effect> {
        self.terms.iter().filter(|term| term.known.is_none()).map(|term| term.effect.clone()).collect()
    }

    /// An effect as a term beside this model, of the size that suits it best.
    pub fn term(&self, library: &Library, effect: &Effect) -> Term {
        let term = Term::new(library, self.problem.runs, effect, 1.0);
        let (_, size2) = self.fit.gain_of(&self.problem, &self.problem.columns(&term.values));
        Term { size2: size2.max(1e-20), ..term }
    }

    /// The evidence, less what the effects' forms cost.
    pub fn score(&self, grammar: &Grammar) -> f64 {
        self.fit.evidence - self.cost(grammar)
    }

    /// The same by how well every run is predicted from the others: where a model is wrong, it is the better judge.
    pub fn predictive(&self, grammar: &Grammar) -> f64 {
        self.problem.predictive(&self.fit) - self.cost(grammar)
    }

    /// Log odds of the model over another one that the runs leave, nats: what evidence and prediction both say, and how much more complex the other is.
    pub fn log_odds_over(&self, other: &Self) -> f64 {
        let predictive = |model: &Self| model.problem.predictive(&model.fit);
        let said = f64::min(self.fit.evidence - other.fit.evidence, predictive(self) - predictive(other));
        said + other.cost_by(complexity) - self.cost_by(complexity)
    }

    /// What the forms of effects and process cost, nats.
    pub fn cost(&self, grammar: &Grammar) -> f64 {
        self.cost_by(|effect| grammar.cost(effect))
    }

    /// The same with another cost of an effect's form; one of the family costs what the family says.
    fn cost_by(&self, of_form: impl Fn(&Effect) -> f64) -> f64 {
        let of_term = |term: &Term| match &term.known {
            Some((known, _)) => known.prior.cost,
            None => of_form(&term.effect),
        };
        process_cost(&self.process) + self.terms.iter().map(of_term).sum::<f64>()
    }

    /// Mean and covariance of the weights of all effects, in units of their priors.
    pub fn weights(&self) -> (DVector<f64>, DMatrix<f64>) {
        let mut mean = DVector::from_vec(self.fit.scaled_means());
        let mut turn = DMatrix::identity(mean.len(), mean.len());
        let mut offset = DVector::zeros(mean.len());
        let mut first = 0;
        for term in &self.terms {
            let count = term.values.len();
            if let Some((known, _)) = &term.known {
                turn.view_mut((first, first), (count, count)).copy_from(&known.prior.root);
                offset.rows_mut(first, count).copy_from(&known.prior.mean);
            }
            first += count;
        }
        mean = offset + &turn * mean;
        (mean, &turn * self.fit.scaled_covariance() * turn.transpose())
    }

    /// The evidence less what the process costs.
    pub fn evidence(&self) -> f64 {
        self.fit.evidence - process_cost(&self.process)
    }

    /// The same for these effects in other runs, with the process or without one.
    pub fn best_evidence_in(&self, runs: &[Run]) -> Option<f64> {
        let terms = self.terms_in(runs);
        let of = |process| Model::new(runs, process, &terms).map(|model| model.evidence());
        let (with, without) = (of(self.process), of(None));
        with.into_iter().chain(without).max_by(f64::total_cmp)
    }

    /// Its effects in other runs, with the process that suits these best.
    pub fn in_runs<'b>(&self, runs: &'b [Run]) -> Option<Model<'b>> {
        Some(Model::new(runs, self.process, &self.terms_in(runs))?.with_likeliest_process())
    }

    /// The same without any process.
    pub fn in_runs_without_process<'b>(&self, runs: &'b [Run]) -> Option<Model<'b>> {
        Model::new(runs, None, &self.terms_in(runs))
    }

    /// Its effects evaluated in other runs.
    fn terms_in(&self, runs: &[Run]) -> Vec<Term> {
        let library = Library::new(runs);
        self.terms.iter().map(|term| term.in_runs(&library, runs)).collect()
    }

    /// The same effects beside the process that has the greatest evidence.
    pub fn with_likeliest_process(self) -> Self {
        let mut best = self;
        let runs = best.problem.runs;
        let noise = typical_noise(runs);
        let lengths = Lengths::of(runs);
        let score = |process: &Option<Process>| {
            let allowed = process.as_ref().is_none_or(is_possible);
            let model = allowed.then(|| Model::new(runs, *process, &best.terms))??;
            Some((model.evidence(), *process))
        };
        let likeliest =
            |processes: &[Option<Process>]| processes.par_iter().filter_map(score).max_by(|a, b| a.0.total_cmp(&b.0));
        let tuned = |mut top: f64, mut process: Process| {
            let mut step = 0.7;
            // What was tried is no better.
            let mut tried = vec![process];
            while step > 0.15 {
                let mut near = neighbours(&process, step, &lengths);
                near.retain(|each| each.is_none_or(|each| !tried.iter().any(|known| is_same(known, &each))));
                tried.extend(near.iter().flatten());
                match likeliest(&near) {
                    Some((above, Some(each))) if above > top + 1e-3 => (top, process) = (above, each),
                    _ => step *= 0.5,
                }
            }
            (top, process)
        };
        let of = |kernel, sigma_deg_h, time_s| Process { port: Port::Rate, kernel, sigma_deg_h, time_s };
        let exponentials = [4.0, 20.0, 100.0].map(|time_s| of(Kernel::Exponential, 0.5 * noise, time_s));
        let decaying = [(Kernel::Transient, 5.0), (Kernel::Transient, 25.0), (Kernel::Start, 25.0)];
        let decaying = decaying.map(|(kernel, time_s)| of(kernel, noise, time_s));
        let at_others = other_ports(&exponentials[1], runs);
        let processes = exponentials.into_iter().chain(decaying).chain(at_others).map(Some);
        let starts: Vec<Option<Process>> = [best.process, None].into_iter().chain(processes).collect();
        let Some((top, first)) = likeliest(&starts) else { return best };
        // Another kernel or port suits with other constants: the likeliest of the others is tuned as well, and the smoother one. Ten nats behind before it is
        // tuned, it is about as likely with the best one's constants.
        let among = |found: (f64, Process), others: Vec<Process>| {
            let scored = others.into_par_iter().filter_map(|other| Some((score(&Some(other))?.0, other)));
            let scored: Vec<(f64, Process)> = scored.collect();
            let smoother = scored.iter().find(|(_, other)| other.kernel == Kernel::Matern);
            let likeliest = scored.iter().max_by(|a, b| a.0.total_cmp(&b.0));
            let further = smoother.into_iter().chain(likeliest.filter(|other| Some(*other) != smoother));
            let further = further.filter(|(above, _)| *above > found.0 - 2.5 * NEGLIGIBLE);
            let further = further.map(|(above, other)| tuned(*above, *other));
            further.fold(found, |best, other| if other.0 > best.0 { other } else { best })
        };
        let process = first.map(|first| {
            let found = tuned(top, first);
            let found = among(found, other_kernels(&found.1, &lengths));
            let moved = among(found, other_ports(&found.1, runs));
            if moved.1.port == found.1.port { found.1 } else { among(moved, other_kernels(&moved.1, &lengths)).1 }
        });
        if process != best.process
            && let Some(with) = Model::new(runs, process, &best.terms)
        {
            best = with;
        }
        best
    }

    /// The same, or beside an offset of every rest that lasts until the next move, where that has the greater evidence. (Where effects are searched for, an
    /// offset would take for its own what effects cause.)
    pub fn with_likeliest_process_or_offsets(self) -> Self {
        let runs = self.problem.runs;
        let noise = typical_noise(runs);
        let offset = |power: i32| {
            let sigma_deg_h = noise * 2f64.powi(power);
            let process = Process { port: Port::Rate, kernel: Kernel::Transient, sigma_deg_h, time_s: f64::INFINITY };
            Model::new(runs, Some(process), &self.terms)
        };
        let offsets: Vec<Model<'a>> = OFFSETS.into_par_iter().filter_map(offset).collect();
        let likelier = |best: Self, other: Self| if other.evidence() > best.evidence() { other } else { best };
        offsets.into_iter().fold(self.with_likeliest_process(), likelier)
    }
}

/// Lengths of the longest run and of the longest rest, seconds.
struct Lengths {
    run_s: f64,
    rest_s: f64,
}

impl Lengths {
    fn of(runs: &[Run]) -> Self {
        let run_s = runs.iter().filter_map(|run| run.t_s.last()).copied().fold(1.0, f64::max);
        let rests = runs.iter().flat_map(|run| run.t_s.iter().zip(&run.rests_s).map(|(t_s, rest_s)| t_s - rest_s));
        Self { run_s, rest_s: rests.fold(1.0, f64::max) }
    }

    /// Longest time constant of a process. A transient decays within its rest: a longer one would be an offset of the rest, which effects cause as well.
    fn longest_s(&self, kernel: Kernel) -> f64 {
        if kernel == Kernel::Transient { self.rest_s } else { 4.0 * self.run_s }
    }
}

/// The root mean square is at most this.
pub fn is_within(values: &[f64], most: f64) -> bool {
    values.iter().map(|value| value * value).sum::<f64>() <= most * most * values.len() as f64
}

/// One sigma of a process is no more than its port allows.
fn is_possible(process: &Process) -> bool {
    process.sigma_deg_h * process.port.per_deg_h() <= largest(process.port)
}

/// A process with each of its constants a step greater or less, in its logarithm.
fn neighbours(process: &Process, step: f64, lengths: &Lengths) -> Vec<Option<Process>> {
    let longest_s = lengths.longest_s(process.kernel);
    let by = |factor: f64| {
        let kernel = match process.kernel {
            Kernel::DampedCosine { period_s } => {
                Some(Process { kernel: Kernel::DampedCosine { period_s: period_s * factor }, ..*process })
            }
            _ => None,
        };
        let size = Process { sigma_deg_h: process.sigma_deg_h * factor, ..*process };
        let time = Process { time_s: (process.time_s * factor).clamp(1.0, longest_s), ..*process };
        [Some(size), Some(time), kernel]
    };
    [step.exp(), (-step).exp()].into_iter().flat_map(by).filter(Option::is_some).collect()
}

/// Whether two processes of one kernel have the same constants but for rounding.
fn is_same(a: &Process, b: &Process) -> bool {
    let period_s = |process: &Process| match process.kernel {
        Kernel::DampedCosine { period_s } => period_s,
        _ => 1.0,
    };
    let ratios = [a.sigma_deg_h / b.sigma_deg_h, a.time_s / b.time_s, period_s(a) / period_s(b)];
    ratios.into_iter().all(|ratio| (ratio - 1.0).abs() < 1e-9)
}

/// Processes of other kernels for which this one may stand: a smoother one, ringing of all periods of which a run sees one at least, and what moves
/// or a start leave behind.
fn other_kernels(process: &Process, lengths: &Lengths) -> Vec<Process> {
    let periods = std::iter::successors(Some(lengths.run_s), |period_s| Some(0.5 * period_s));
    let ringing = |period_s| Process { kernel: Kernel::DampedCosine { period_s }, time_s: period_s, ..*process };
    let others = [Kernel::Matern, Kernel::Transient, Kernel::Start].map(|kernel| Process {
        kernel,
        time_s: process.time_s.min(lengths.longest_s(kernel)),
        ..*process
    });
    others
        .into_iter()
        .filter(|other| other.kernel != process.kernel)
        .chain(periods.take_while(|period_s| *period_s > SHORTEST_PERIOD_S).map(ringing))
        .collect()
}

/// A process of the same size at the other ports of these runs.
fn other_ports(process: &Process, runs: &[Run]) -> Vec<Process> {
    let size = |process: &Process| {
        let gains = runs.iter().flat_map(|run| run.gains_of(Some(process)));
        process.sigma_deg_h * gains.map(|gain| gain * gain).sum::<f64>().sqrt()
    };
    let own = size(process);
    let at = |port: Port| {
        let process = Process { port, ..*process };
        let ratio = own / size(&process);
        ratio.is_finite().then_some(Process { sigma_deg_h: process.sigma_deg_h * ratio, ..process })
    };
    ports_of_changes(runs).into_iter().filter(|port| *port != process.port).filter_map(at).collect()
}

/// What a process costs, nats: its constants, each one of some eight values that recordings tell apart, and one of four other kernels half of the time; and as many other
/// ports.
pub fn process_cost(process: &Option<Process>) -> f64 {
    let constants = match process.map(|process| process.kernel) {
        None => return 0.0,
        Some(Kernel::DampedCosine { .. }) => 3.0,
        Some(_) => 2.0,
    };
    let plain = process.is_some_and(|process| process.kernel == Kernel::Exponential);
    let at_rate = process.is_none_or(|process| process.port == Port::Rate);
    let choices = [plain, at_rate].into_iter().filter(|usual| !usual).count();
    constants * 8f64.ln() + choices as f64 * 4f64.ln()
}

/// Noise of a row of a usual run, °/h.
fn typical_noise(runs: &[Run]) -> f64 {
    let mut all: Vec<f64> =
        runs.iter().filter_map(|run| run.variance.first()).map(|variance| variance.sqrt()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTHS: Lengths = Lengths { run_s: 80.0, rest_s: 20.0 };

    /// Half a period less each time, down to ten seconds; three constants, and one of four other kernels half of the time.
    #[test]
    fn what_is_tried_for_an_exponential_process() {
        let exponential = Process { port: Port::Rate, kernel: Kernel::Exponential, sigma_deg_h: 1.0, time_s: 10.0 };
        let kernels: Vec<Kernel> =
            other_kernels(&exponential, &LENGTHS).into_iter().map(|process| process.kernel).collect();
        let ringing = |period_s| Kernel::DampedCosine { period_s };
        assert_eq!(
            kernels,
            [Kernel::Matern, Kernel::Transient, Kernel::Start, ringing(80.0), ringing(40.0), ringing(20.0)]
        );
        let ringing = Process { kernel: ringing(40.0), ..exponential };
        assert!((process_cost(&Some(ringing)) - (3.0 * 8f64.ln() + 4f64.ln())).abs() < 1e-12);
        assert_eq!(neighbours(&ringing, 0.7, &LENGTHS).len(), 6);
        assert_eq!(neighbours(&exponential, 0.7, &LENGTHS).len(), 4);
        let near = neighbours(&exponential, 0.7, &LENGTHS)[0].unwrap();
        assert!(!is_same(&near, &exponential));
        assert_eq!(
            neighbours(&near, 0.7, &LENGTHS).iter().flatten().filter(|each| is_same(each, &exponential)).count(),
            1
        );
    }

    /// Eight runs whose rate, beside the Earth's at four positions in turn, rings with a period of 30 s and another phase each time.
    #[test]
    fn a_ringing_process_is_found() {
        let ringing = |run: usize| -> Vec<f64> {
            let phase = 2.4 * run as f64;
            let at = |i: usize| 5.0 * (std::f64::consts::TAU * i as f64 / 30.0 + phase).cos() + Run::noise(run, i);
            (0..120).map(|i| at(i) + [10.0, 0.0, -10.0, 0.0][i % 4]).collect()
        };
        let runs: Vec<Run> = (0..8).map(|run| Run::of_rates(&ringing(run))).collect();
        let process = Model::new(&runs, None, &[]).unwrap().with_likeliest_process().process.unwrap();
        let Kernel::DampedCosine { period_s } = process.kernel else { panic!("{process:?}") };
        assert!((period_s / 30.0).ln().abs() < 0.15, "{process:?}");
    }

    /// The same of an index that rings by 6.3°, 1.1 of 10 °/h: the rates at the positions across the axis ring with it, one against the other.
    #[test]
    fn a_process_in_the_index_is_found() {
        let across = |i: usize| [0.0, 1.0, 0.0, -1.0][i % 4];
        let ringing = |run: usize| -> Vec<f64> {
            let error = |i: usize| 1.1 * (std::f64::consts::TAU * i as f64 / 30.0 + 2.4 * run as f64).cos();
            (0..120).map(|i| error(i) * across(i) + Run::noise(run, i) + [10.0, 0.0, -10.0, 0.0][i % 4]).collect()
        };
        let runs: Vec<Run> = (0..8).map(|run| Run::of_rates(&ringing(run))).collect();
        let process = Model::new(&runs, None, &[]).unwrap().with_likeliest_process().process.unwrap();
        let Kernel::DampedCosine { period_s } = process.kernel else { panic!("{process:?}") };
        assert!(process.port == Port::Index && (period_s / 30.0).ln().abs() < 0.15, "{process:?}");
    }

    /// Eight runs of six rests of twenty seconds each, after every one of which another rate decays within four seconds; or within thirty seconds from the
    /// start of the run.
    #[test]
    fn what_moves_and_starts_leave_behind_is_found() {
        let cases = [(Kernel::Transient, 20, 4.0), (Kernel::Start, 120, 30.0)];
        for (kernel, every, time_s) in cases {
            let resting = |run: usize| -> Run {
                let left = |i: usize| {
                    let size = 9.0 * (2.4 * (i / every) as f64 + run as f64).cos();
                    size * (-((i % every) as f64 + 0.5) / time_s).exp()
                };
                let rates: Vec<f64> =
                    (0..120).map(|i| left(i) + Run::noise(run, i) + [10.0, 0.0, -10.0, 0.0][i % 4]).collect();
                Run::of_rests(&rates, 20)
            };
            let runs: Vec<Run> = (0..8).map(resting).collect();
            let process = Model::new(&runs, None, &[]).unwrap().with_likeliest_process().process.unwrap();
            assert!(process.kernel == kernel && (process.time_s / time_s).ln().abs() < 0.3, "{process:?}");
        }
    }
}
