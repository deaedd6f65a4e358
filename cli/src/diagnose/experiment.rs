//! The next experiment: the runs by which the models that are still possible would be told apart, or the azimuth known better, by
//! what they are expected to tell.

use north_finder::fix::DesignRow;
use north_finder::sensing::index::Direction;
use north_finder::sensing::level::Specific;
use north_finder::units::wrap_360_deg;
use rayon::prelude::*;

use super::result::{Ask, Experiment};
use super::run_residual::noise_deg_h;
use crate::run_data::{RunData, Sample};

/// Seconds of a move, and of the shortest dwell.
const MOVE_S: usize = 5;
const LEAST_DWELL_S: f64 = 10.0;
/// Expected log odds by which an answer is unique: twice what candidates may be apart and still count as confounded.
const DISTINCT_LOG_ODDS: f64 = 9.2;
/// Designs that are weighed together, from the shortest on, until one makes the answer unique.
const TOGETHER: usize = 4;
/// Expected log odds below which nothing is separated.
const LEAST_LOG_ODDS: f64 = 1.0;

/// Orders that are weighed against each other. Positions at even steps leave some harmonics of the index angle alike: the third and the fifth at
/// eighths of a turn, the first and the fifth at sixths.
const ORDERS: [(&str, &[f64]); 6] = [
    ("the mirrored order", &[0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0]),
    ("the plain order", &[0.0, 90.0, 180.0, 270.0]),
    ("eight positions out of order", &[0.0, 135.0, 270.0, 45.0, 180.0, 315.0, 90.0, 225.0]),
    ("six positions there and back", &[0.0, 60.0, 120.0, 180.0, 240.0, 300.0, 240.0, 120.0, 0.0, 180.0]),
    ("eight uneven positions", &[0.0, 35.0, 95.0, 170.0, 205.0, 265.0, 320.0, 130.0]),
    ("long and short moves by turns", &[0.0, 180.0, 90.0, 270.0, 0.0, 90.0, 270.0, 180.0]),
];
/// Headings at which the instrument is set down, dwells as multiples of those so far, and times of warming up first, seconds.
const HEADINGS: [usize; 4] = [1, 4, 8, 16];
const STRETCHES: [f64; 3] = [1.0, 3.0, 10.0];
/// Headings with which the longest dwells are worth their time.
const LONGEST_AT: usize = 8;
const WARM_UPS_S: [f64; 2] = [0.0, 1800.0];
/// Pitch and roll by which the mount leans, degrees: as it stood, or by more than the axis ever leaned in a usual run.
const LEANS_DEG: [f64; 2] = [0.0, 3.0];
/// What it takes to lean the mount, seconds.
const LEANING_S: f64 = 60.0;

/// Runs that have not been made.
#[derive(Clone)]
pub struct Design {
    name: &'static str,
    pub order_deg: &'static [f64],
    pub headings_deg: Vec<f64>,
    pub dwell_s: f64,
    pub warm_up_s: f64,
    /// Pitch and roll more than in the run that it is like, degrees.
    pub lean_deg: f64,
}

impl Design {
    /// All that are weighed, the shortest first; dwells as in `like`. Where the models follow channels the runs are no longer than that one, and
    /// begin as it did: how its channels would have gone on is not known. Only an instrument that measures how it stands leans, and only in
    /// runs that begin with the switch-on.
    fn all(like: &RunData, follow_channels: bool) -> Vec<Self> {
        let length_s = like.samples.last().map_or(240.0, |sample| sample.t_s).max(60.0);
        let has_level = like.samples.iter().all(|sample| sample.level.is_some());
        let mut all = Vec::new();
        for (name, order_deg) in ORDERS {
            for number in HEADINGS {
                for stretch in STRETCHES.into_iter().filter(|&stretch| stretch < STRETCHES[2] || number >= LONGEST_AT) {
                    let dwell_s =
                        (stretch * length_s / order_deg.len() as f64 - MOVE_S as f64).max(LEAST_DWELL_S).floor();
                    let heading_deg = |i: usize| wrap_360_deg(22.5 + 360.0 * i as f64 / number as f64);
                    let headings_deg: Vec<f64> = (0..number).map(heading_deg).collect();
                    let like_this = |warm_up_s: f64, lean_deg: f64| Self {
                        name,
                        order_deg,
                        headings_deg: headings_deg.clone(),
                        dwell_s,
                        warm_up_s,
                        lean_deg,
                    };
                    all.extend(WARM_UPS_S.map(|warm_up_s| like_this(warm_up_s, LEANS_DEG[0])));
                    if has_level {
                        all.push(like_this(WARM_UPS_S[0], LEANS_DEG[1]));
                    }
                }
            }
        }
        all.retain(|design| !follow_channels || design.warm_up_s == 0.0 && design.run_s() <= length_s);
        all.sort_by(|a, b| a.seconds().total_cmp(&b.seconds()));
        all
    }

    /// Length of one of its runs.
    fn run_s(&self) -> f64 {
        (self.dwell_s + MOVE_S as f64) * self.order_deg.len() as f64 + self.warm_up_s
    }

    /// What it takes.
    fn seconds(&self) -> f64 {
        let leaning_s = if self.lean_deg > 0.0 { LEANING_S } else { 0.0 };
        self.run_s() * self.headings_deg.len() as f64 + leaning_s
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
                t_s += 1.0;
                second += 1;
                let source = like.samples[place].clone();
                let level = source.level.map(|level| self.leaning(level));
                let design = DesignRow::new(Direction { cos, sin }, level, &like.earth);
                let rate_deg_h =
                    like.earth.north_deg_h * (cos_psi * design.cos + sin_psi * design.sin) + design.vertical_deg_h;
                run.samples.push(Sample {
                    t_s: t_s - 0.5,
                    seconds: 1.0,
                    rate_deg_h,
                    cos,
                    sin,
                    design,
                    level,
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

    /// The accelerometers' reading of a mount that leans by this much more: sin p forward, sin r · cos p left.
    fn leaning(&self, level: Specific) -> Specific {
        let (sin, cos) = self.lean_deg.to_radians().sin_cos();
        Specific { forward: level.forward + sin, left: level.left + sin * cos }
    }

    fn words(&self) -> String {
        let count = self.headings_deg.len();
        let warm = match self.warm_up_s > 0.0 {
            true => format!("{:.0} s after switch-on", self.warm_up_s),
            false => "from switch-on".to_owned(),
        };
        let lean = if self.lean_deg > 0.0 { format!(", leaning by {:.0} deg", self.lean_deg) } else { String::new() };
        let (runs, headings) = match count {
            1 => ("one run".to_owned(), "a surveyed heading".to_owned()),
            _ => (format!("{count} runs"), format!("surveyed headings {} deg apart", 360.0 / count as f64)),
        };
        format!("Make {runs}: {}, {:.0} s a position, {warm}{lean}, at {headings}", self.name, self.dwell_s)
    }
}

/// A name of which a sentence stays short.
pub fn short(name: &str) -> String {
    let words: Vec<&str> = name.split_whitespace().collect();
    if words.len() > 5 { format!("{} …", words[..4].join(" ")) } else { words.join(" ") }
}

/// Sentences of a text.
pub fn sentences(said: &[&str]) -> String {
    format!("{}.", said.join(". "))
}

/// The second of a run that stands for this one of a longer run: there and back again, so that nothing jumps.
fn second_of(like: &RunData, second: usize) -> Option<usize> {
    let length = like.samples.len();
    let last = length.checked_sub(1)?;
    let place = second % (2 * last).max(1);
    Some(if place <= last { place } else { 2 * last - place })
}

/// What the models say of runs.
pub struct Expectation {
    /// Log odds of each model over each other one that the runs add on average, if the first of both is the true one.
    pub log_odds: Vec<Vec<f64>>,
    /// The azimuth's sigma then, degrees.
    pub sigma_deg: f64,
}

impl Expectation {
    /// Between two models, whichever is true.
    fn between(&self, (one, other): (usize, usize)) -> f64 {
        self.log_odds[one][other].min(self.log_odds[other][one])
    }

    /// Whether it tells two models apart.
    fn tells(&self, pair: (usize, usize)) -> bool {
        self.between(pair) > LEAST_LOG_ODDS
    }

    /// Between those of these that are nearest to each other.
    fn least(&self, pairs: &[(usize, usize)]) -> f64 {
        pairs.iter().map(|&pair| self.between(pair)).fold(f64::INFINITY, f64::min)
    }

    /// Probability that the true model is the likeliest then, whichever it is; only these pairs count.
    fn right(&self, pairs: &[(usize, usize)]) -> f64 {
        let is_right = |one: usize| {
            let others = pairs.iter().filter_map(|&(a, b)| (a == one).then_some(b).or((b == one).then_some(a)));
            1.0 / (1.0 + others.map(|other| (-self.log_odds[one][other]).exp()).sum::<f64>())
        };
        (0..self.log_odds.len()).map(is_right).sum::<f64>() / self.log_odds.len() as f64
    }
}

/// What runs could tell.
#[derive(Default)]
pub struct Proposal {
    pub experiment: Option<Experiment>,
    /// Names of the models that none of the weighed runs would tell from the likeliest one.
    pub inseparable: Vec<String>,
}

/// The shortest runs that are expected to make the answer unique as far as any can, whichever of the models is true; where none does,
/// those after which the true one is the likeliest with the greatest probability.
///
/// `expect` says what runs would tell; `follow_channels` is whether any of the models follows one; `names` are those of the likeliest model and then of the others, in the order of the log odds;
/// `sigma_now_deg` is what the azimuth is known to now. Without others, the runs that bring the sigma down most for their time.
pub fn propose(
    like: &RunData,
    names: &[String],
    follow_channels: bool,
    sigma_now_deg: f64,
    expect: impl Fn(&[RunData]) -> Option<Expectation> + Sync,
) -> Proposal {
    let Some((likeliest, others)) = names.split_first() else { return Proposal::default() };
    let tells_apart = !others.is_empty();
    // Where nothing is to be told apart, neither headings nor warming up nor leaning matter.
    let matters = |design: &Design| {
        tells_apart || design.headings_deg.len() == 1 && design.warm_up_s == 0.0 && design.lean_deg == 0.0
    };
    let designs: Vec<Design> = Design::all(like, follow_channels).into_iter().filter(matters).collect();
    let pairs_of = |models: &[usize]| -> Vec<(usize, usize)> {
        models.iter().enumerate().flat_map(|(i, &one)| models[..i].iter().map(move |&other| (other, one))).collect()
    };
    let all_pairs = pairs_of(&(0..names.len()).collect::<Vec<_>>());
    let mut weighed: Vec<(Design, Expectation)> = Vec::new();
    for some in designs.chunks(TOGETHER) {
        let expected = |design: &Design| Some((design.clone(), expect(&design.runs(like))?));
        weighed.extend(some.par_iter().filter_map(expected).collect::<Vec<_>>());
        if tells_apart && weighed.iter().any(|(_, found)| found.least(&all_pairs) > DISTINCT_LOG_ODDS) {
            break;
        }
    }
    let is_told = |pair: (usize, usize)| weighed.iter().any(|(_, found)| found.tells(pair));
    let (told, untold): (Vec<usize>, Vec<usize>) = (1..names.len()).partition(|&other| is_told((0, other)));
    let named = |numbers: &[usize]| numbers.iter().map(|&other| names[other].clone()).collect::<Vec<_>>();
    let inseparable = named(&untold);
    let apart: Vec<usize> = std::iter::once(0).chain(told.iter().copied()).collect();
    let pairs: Vec<(usize, usize)> = pairs_of(&apart).into_iter().filter(|&pair| is_told(pair)).collect();
    let chosen = if !tells_apart {
        let gain = |(design, found): &(Design, Expectation)| (sigma_now_deg / found.sigma_deg).ln() / design.seconds();
        weighed.iter().max_by(|a, b| gain(a).total_cmp(&gain(b))).filter(|(_, found)| found.sigma_deg < sigma_now_deg)
    } else if told.is_empty() {
        None
    } else {
        let unique = weighed.iter().find(|(_, found)| found.least(&pairs) > DISTINCT_LOG_ODDS);
        let telling = weighed.iter().filter(|(_, found)| told.iter().any(|&other| found.tells((0, other))));
        unique.or_else(|| telling.max_by(|a, b| a.1.right(&pairs).total_cmp(&b.1.right(&pairs))))
    };
    let Some((design, found)) = chosen else { return Proposal { experiment: None, inseparable } };
    // What the other designs tell is not said of this one.
    let told: Vec<usize> = told.into_iter().filter(|&other| found.tells((0, other))).collect();
    let told_apart: Vec<(usize, usize)> = told.iter().map(|&other| (0, other)).collect();
    let log_odds = tells_apart.then(|| found.least(&told_apart).min(f64::MAX));
    let separates =
        if tells_apart { std::iter::once(likeliest.clone()).chain(named(&told)).collect() } else { Vec::new() };
    let more = match told.len() {
        0 | 1 => String::new(),
        2 => " and another one".into(),
        count => format!(" and {} others", count - 1),
    };
    let tells = log_odds.map(|log_odds| {
        let other = told.first().map_or("", |&other| names[other].as_str());
        format!("That tells {} from {}{more} by log odds of {log_odds:.0} or more", short(likeliest), short(other))
    });
    let gain = format!("The sigma of a usual azimuth falls from {sigma_now_deg:.4} to {:.4} deg", found.sigma_deg);
    let runs = design.words();
    let said: Vec<&str> = [Some(runs.as_str()), tells.as_deref(), Some(gain.as_str())].into_iter().flatten().collect();
    let experiment = Experiment {
        asks: Ask::Runs,
        description: sentences(&said),
        order_deg: design.order_deg.to_vec(),
        headings_deg: design.headings_deg.clone(),
        dwell_s: design.dwell_s,
        warm_up_s: design.warm_up_s,
        pitch_deg: design.lean_deg,
        roll_deg: design.lean_deg,
        like: like.file.clone(),
        separates,
        expected_log_odds: log_odds,
        sigma_now_deg,
        sigma_then_deg: found.sigma_deg,
    };
    Proposal { experiment: Some(experiment), inseparable }
}

#[cfg(test)]
mod tests {
    use super::super::statistics::{dot, orthonormalise, subtract};
    use super::*;

    /// Harmonics to the sixth are told apart by one order at least: beside a constant the
    /// cosines and sines of no two of them span the same at its positions.
    #[test]
    fn an_order_tells_all_harmonics_apart() {
        let columns = |angles: &[f64], order: i32| {
            let of = |f: fn(f64) -> f64| -> Vec<f64> {
                angles.iter().map(|angle| f(f64::from(order) * angle.to_radians())).collect()
            };
            vec![of(f64::cos), of(f64::sin)]
        };
        let is_told = |angles: &[f64], one: i32, other: i32| {
            let mut beside = orthonormalise(&[], vec![vec![1.0; angles.len()]]);
            beside.extend(orthonormalise(&beside, columns(angles, other)));
            let left = columns(angles, one).into_iter().map(|mut column| {
                for each in &beside {
                    let along = dot(&column, each);
                    subtract(&mut column, along, each);
                }
                dot(&column, &column)
            });
            left.sum::<f64>() > 0.1
        };
        let all = |angles: &&[f64]| (1..=6).all(|one| (1..=6).all(|other| one == other || is_told(angles, one, other)));
        assert!(!is_told(ORDERS[2].1, 3, 5) && !is_told(ORDERS[3].1, 1, 5));
        assert!(ORDERS.iter().any(|(_, angles)| all(angles)));
    }

    /// By hand: sin 3° = 0.0523360 and sin 3° · cos 3° = 0.0522642, each more than what it read.
    #[test]
    fn a_mount_that_leans() {
        let (name, order_deg) = ORDERS[1];
        let design = Design { name, order_deg, headings_deg: vec![0.0], dwell_s: 30.0, warm_up_s: 0.0, lean_deg: 3.0 };
        let level = design.leaning(Specific { forward: 0.001, left: -0.002 });
        assert!((level.forward - 0.0533360).abs() < 1e-7 && (level.left - 0.0502642).abs() < 1e-7, "{level:?}");
        assert!(design.words().contains("30 s a position, from switch-on, leaning by 3 deg, at a surveyed heading"));
        assert_eq!(design.seconds(), 4.0 * 35.0 + LEANING_S);
    }

    /// The longest that is said of a design: 25 words.
    #[test]
    fn designs_are_said_in_a_sentence() {
        for (name, order_deg) in ORDERS {
            let design =
                Design { name, order_deg, headings_deg: vec![0.0; 16], dwell_s: 300.0, warm_up_s: 0.0, lean_deg: 3.0 };
            assert!(design.words().split_whitespace().count() <= 25, "{}", design.words());
            let warm = Design { warm_up_s: 1800.0, lean_deg: 0.0, ..design };
            assert!(warm.words().split_whitespace().count() <= 25, "{}", warm.words());
        }
    }

    /// Log odds of ln 3 leave a rival one chance in four. With both others at ln 2 the true model has one in 1 + 1/2 + 1/2.
    #[test]
    fn chances_of_being_right() {
        let of = |odds: [[f64; 3]; 3]| Expectation { log_odds: odds.map(|row| row.to_vec()).to_vec(), sigma_deg: 0.0 };
        let (two, three) = (2f64.ln(), 3f64.ln());
        let found = of([[0.0, two, two], [three, 0.0, two], [two, two, 0.0]]);
        assert_eq!((found.between((0, 1)), found.between((1, 0))), (two, two));
        let all = [(0, 1), (0, 2), (1, 2)];
        let expected = (0.5 + 1.0 / (1.0 + 1.0 / 3.0 + 0.5) + 0.5) / 3.0;
        assert!((found.right(&all) - expected).abs() < 1e-12);
        // Where only the first two can be told apart, the third is right by itself.
        assert!((found.right(&all[..1]) - (1.0 / 1.5 + 0.75 + 1.0) / 3.0).abs() < 1e-12);
        assert_eq!(found.least(&[]), f64::INFINITY);
    }

    /// Runs that tell the first model from the second by odds of e² or more, and from the third by those of e^½, tell it from the second alone.
    #[test]
    fn what_runs_do_not_tell_apart_is_not_said_of_them() {
        let found = Expectation {
            log_odds: [[0.0, 2.0, 0.5], [3.0, 0.0, 4.0], [2.0, 4.0, 0.0]].map(|row| row.to_vec()).to_vec(),
            sigma_deg: 0.0,
        };
        assert!(found.tells((0, 1)) && !found.tells((0, 2)));
    }
}
