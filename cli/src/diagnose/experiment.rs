//! The next experiment: the runs by which the models that are still possible would be told apart, or the azimuth known better, by
//! what they are expected to tell.

use north_finder::fix::DesignRow;
use north_finder::index::Direction;
use north_finder::units::wrap_360_deg;
use rayon::prelude::*;

use super::block::{Block, noise_deg_h};
use super::candidate::Candidate;
use super::data::{RunData, Sample};
use super::problem::Problem;
use super::result::Experiment;
use super::statistics::{dot, orthonormalise};

/// Seconds of a move.
const MOVE_S: usize = 5;
/// Expected log odds by which an answer is unique: twice what candidates may be apart and still count as confounded.
const UNIQUE: f64 = 9.2;
/// Designs that are weighed together, from the shortest on, until one makes the answer unique.
const TOGETHER: usize = 4;
/// Expected log odds below which nothing is separated.
const NOTHING: f64 = 1.0;

/// Orders that are weighed against each other.
const ORDERS: [(&str, &[f64]); 5] = [
    ("the mirrored order", &[0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0]),
    ("the plain order", &[0.0, 90.0, 180.0, 270.0]),
    ("eight positions out of order", &[0.0, 135.0, 270.0, 45.0, 180.0, 315.0, 90.0, 225.0]),
    ("six positions there and back", &[0.0, 60.0, 120.0, 180.0, 240.0, 300.0, 240.0, 120.0, 0.0, 180.0]),
    ("long and short moves by turns", &[0.0, 180.0, 90.0, 270.0, 0.0, 90.0, 270.0, 180.0]),
];
/// Headings at which the instrument is set down, dwells as multiples of those so far, and times of warming up first, seconds.
const HEADINGS: [usize; 4] = [1, 4, 8, 16];
const STRETCHES: [f64; 3] = [1.0, 3.0, 10.0];
/// Headings with which the longest dwells are worth their time.
const LONGEST_AT: usize = 8;
const WARM_UPS_S: [f64; 2] = [0.0, 1800.0];

/// Runs that have not been made.
#[derive(Clone)]
pub struct Design {
    name: &'static str,
    pub order_deg: &'static [f64],
    pub headings_deg: Vec<f64>,
    pub dwell_s: f64,
    pub warm_up_s: f64,
}

impl Design {
    /// All that are weighed, the shortest first; dwells as in `like`.
    fn all(like: &RunData) -> Vec<Self> {
        let length_s = like.samples.last().map_or(240.0, |sample| sample.t_s).max(60.0);
        let mut all = Vec::new();
        for (name, order_deg) in ORDERS {
            for number in HEADINGS {
                for stretch in STRETCHES.into_iter().filter(|&stretch| stretch < STRETCHES[2] || number >= LONGEST_AT) {
                    for warm_up_s in WARM_UPS_S {
                        let dwell_s = (stretch * length_s / order_deg.len() as f64 - MOVE_S as f64).max(10.0).round();
                        let heading_deg = |i: usize| wrap_360_deg(22.5 + 360.0 * i as f64 / number as f64);
                        let headings_deg = (0..number).map(heading_deg).collect();
                        all.push(Self { name, order_deg, headings_deg, dwell_s, warm_up_s });
                    }
                }
            }
        }
        all.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
        all
    }

    /// What it takes.
    fn seconds(&self) -> f64 {
        let run_s = (self.dwell_s + MOVE_S as f64) * self.order_deg.len() as f64 + self.warm_up_s;
        run_s * self.headings_deg.len() as f64
    }

    /// Its runs: seconds, with the channels as they went in the run that it is like.
    pub fn runs(&self, like: &RunData) -> Vec<RunData> {
        self.headings_deg.iter().map(|&heading_deg| self.run(like, heading_deg)).collect()
    }

    fn run(&self, like: &RunData, heading_deg: f64) -> RunData {
        let mut run = like.clone();
        run.reference_deg = Some(heading_deg);
        run.rotation = false;
        run.noise_deg_h = like.noise_deg_h.or_else(|| noise_deg_h(like));
        run.samples.clear();
        run.channels.iter_mut().for_each(Vec::clear);
        let (sin_psi, cos_psi) = heading_deg.to_radians().sin_cos();
        let mut t_s = self.warm_up_s;
        let mut second = 0;
        for (dwell, angle) in self.order_deg.iter().enumerate() {
            let (sin, cos) = angle.to_radians().sin_cos();
            for row in 0..self.dwell_s as usize + if dwell > 0 { MOVE_S } else { 0 } {
                let moving = dwell > 0 && row < MOVE_S;
                let Some(place) = second_of(like, second) else { return run };
                let rate_deg_h = like.earth.north_deg_h * (cos_psi * cos + sin_psi * sin);
                t_s += 1.0;
                second += 1;
                let source = like.samples[place].clone();
                let design = DesignRow::new(Direction { cos, sin }, source.level, &like.earth);
                run.samples.push(Sample {
                    t_s: t_s - 0.5,
                    seconds: 1.0,
                    rate_deg_h,
                    cos,
                    sin,
                    design,
                    moving,
                    left_out: false,
                    dwell,
                    ..source
                });
                for (channel, values) in run.channels.iter_mut().zip(&like.channels) {
                    channel.push(values[place]);
                }
            }
        }
        run
    }

    fn words(&self) -> String {
        let angles = |angles: &[f64], digits: usize| {
            angles.iter().map(|angle| format!("{angle:.digits$}")).collect::<Vec<_>>().join(", ")
        };
        let warm = if self.warm_up_s > 0.0 {
            format!(", {:.0} s after switch-on", self.warm_up_s)
        } else {
            ", from switch-on".into()
        };
        format!(
            "{} ({}), {:.0} s at each position{warm}, with the mark turned to {} surveyed heading{}: {} deg",
            self.name,
            angles(self.order_deg, 0).replace(", ", "-"),
            self.dwell_s,
            self.headings_deg.len(),
            if self.headings_deg.len() == 1 { "" } else { "s" },
            angles(&self.headings_deg, 1),
        )
    }
}

/// The second of a run that stands for this one of a longer run: there and back again, so that nothing jumps.
fn second_of(like: &RunData, second: usize) -> Option<usize> {
    let length = like.samples.len();
    let last = length.checked_sub(1)?;
    let place = second % (2 * last).max(1);
    Some(if place <= last { place } else { 2 * last - place })
}

/// What the models say of runs: log odds of the likeliest over each other one on average, and the azimuth's sigma then, degrees.
pub struct Expectation {
    pub log_odds: Vec<f64>,
    pub sigma_deg: f64,
}

/// What runs could tell.
#[derive(Default)]
pub struct Proposal {
    pub experiment: Option<Experiment>,
    /// Names of the models that none of the weighed runs would tell from the likeliest one.
    pub inseparable: Vec<String>,
}

/// The shortest runs that are expected to make the answer unique as far as any can; where none does, those that tell most.
///
/// `expect` says what runs would tell; `names` are those of the likeliest model and then of the others, in the order of the log odds;
/// `sigma_now_deg` is what the azimuth is known to now. Without others, the runs that bring the sigma down most for their time.
pub fn propose(
    like: &RunData,
    names: &[String],
    sigma_now_deg: f64,
    expect: impl Fn(&[RunData]) -> Option<Expectation> + Sync,
) -> Proposal {
    let Some((likeliest, others)) = names.split_first() else { return Proposal::default() };
    let tells_apart = !others.is_empty();
    // Where nothing is to be told apart, neither headings nor warming up matter.
    let matters = |design: &Design| tells_apart || design.headings_deg.len() == 1 && design.warm_up_s == 0.0;
    let designs: Vec<Design> = Design::all(like).into_iter().filter(matters).collect();
    let mut weighed: Vec<(Design, Expectation)> = Vec::new();
    for some in designs.chunks(TOGETHER) {
        let expected = |design: &Design| Some((design.clone(), expect(&design.runs(like))?));
        weighed.extend(some.par_iter().filter_map(expected).collect::<Vec<_>>());
        let all_told = |(_, found): &(Design, Expectation)| found.log_odds.iter().all(|odds| *odds > UNIQUE);
        if tells_apart && weighed.iter().any(all_told) {
            break;
        }
    }
    let told_at_best = |other: usize| weighed.iter().map(|(_, found)| found.log_odds[other]).fold(0.0, f64::max);
    let (told, untold): (Vec<usize>, Vec<usize>) = (0..others.len()).partition(|&other| told_at_best(other) > NOTHING);
    let named = |numbers: &[usize]| numbers.iter().map(|&other| others[other].clone()).collect::<Vec<_>>();
    let inseparable = named(&untold);
    let least = |found: &Expectation| told.iter().map(|&other| found.log_odds[other]).fold(f64::INFINITY, f64::min);
    let chosen = if !tells_apart {
        let gain = |(design, found): &(Design, Expectation)| (sigma_now_deg / found.sigma_deg).ln() / design.seconds();
        weighed.iter().max_by(|a, b| gain(a).total_cmp(&gain(b))).filter(|(_, found)| found.sigma_deg < sigma_now_deg)
    } else if told.is_empty() {
        None
    } else {
        let unique = weighed.iter().find(|(_, found)| least(found) > UNIQUE);
        unique.or_else(|| weighed.iter().max_by(|a, b| least(&a.1).total_cmp(&least(&b.1))))
    };
    let Some((design, found)) = chosen else { return Proposal { experiment: None, inseparable } };
    let log_odds = tells_apart.then(|| least(found).min(f64::MAX));
    let separates =
        if tells_apart { std::iter::once(likeliest.clone()).chain(named(&told)).collect() } else { Vec::new() };
    let tells = log_odds.map_or(String::new(), |log_odds| {
        format!(
            "; it is expected to separate {} by log odds of {log_odds:.0}, with channels as in {}",
            separates.join(" from "),
            like.file
        )
    });
    let experiment = Experiment {
        description: format!(
            "{}{tells}; sigma of a usual azimuth then {:.4} deg ({sigma_now_deg:.4} now)",
            design.words(),
            found.sigma_deg
        ),
        order_deg: design.order_deg.to_vec(),
        headings_deg: design.headings_deg.clone(),
        dwell_s: design.dwell_s,
        warm_up_s: design.warm_up_s,
        like: like.file.clone(),
        separates,
        expected_log_odds: log_odds,
        sigma_now_deg,
        sigma_then_deg: found.sigma_deg,
    };
    Proposal { experiment: Some(experiment), inseparable }
}

/// An effect that was taken, with its constant and coefficients.
pub struct Known<'a> {
    pub candidate: &'a Candidate,
    pub constant: f64,
    pub coefficients: &'a [f64],
}

/// Sum of squares of an effect that no coefficients of each of the alternatives can imitate, in noise variances: half of what runs add to
/// it are the log odds that they add on average, if it is the true one.
pub fn not_imitated<'a>(
    runs: impl Iterator<Item = &'a RunData>,
    effect: &Known,
    alternatives: &[(&Candidate, f64)],
) -> Vec<f64> {
    let problem = Problem::new(runs.filter_map(|run| Block::new(run, true, None)).collect());
    let mut whole = vec![0.0; problem.rows()];
    for (column, size) in problem.projected(effect.candidate, effect.constant).iter().zip(effect.coefficients) {
        whole.iter_mut().zip(column).for_each(|(sum, value)| *sum += size * value);
    }
    alternatives
        .iter()
        .map(|(alternative, constant)| {
            let basis = orthonormalise(&[], problem.projected(alternative, *constant));
            let imitated: f64 = basis.iter().map(|each| dot(&whole, each).powi(2)).sum();
            (dot(&whole, &whole) - imitated).max(0.0)
        })
        .collect()
}
