//! What no named effect explains: the engine of the open world on the runs, beside the named effects or in their place.

use std::collections::BTreeMap;

use north_finder::effects::channel::TEMPERATURE;
use north_finder::effects::{ChannelName, ErrorModel, Term, doubt};
use north_finder::event::Fix;
use north_finder::units::{RAD_PER_DEG, wrap_180_deg};
use rayon::prelude::*;

use super::Effect;
use super::block::Block;
use super::candidate::evaluated;
use super::data::{RunData, Sample};
use super::deploy::{self, Ranged};
use super::experiment::{self, Expectation, Proposal};
use super::guard;
use super::learned::{AS_GOOD, Taken};
use super::problem::Problem;
use crate::campaign::Role;
use crate::open_world::{
    self, DAMPING, Found, Group, Learned, MARGIN_OF_PROCESSES, PROCESS, Prediction, Recording, Reference, Shape,
};

/// Share of the mean square error of what it replaces that a model must fall below.
const BETTER: f64 = 0.95;
/// Gain of log density, in predicting the rates of the fit runs, from which on the mean square error may be greater than that of what it
/// replaces; and by which factor.
const PREDICTS: f64 = 20.0;
const WORSE: f64 = 1.5;
/// The gain that is enough without any reference.
const PREDICTS_BLIND: f64 = 4.0;
/// Share of the mean square error of a named sinusoid and what stands beside it that processes of the runs' own must fall below to stand in
/// their place.
const FAR_LESS: f64 = 0.5;
/// Share of an effect that its terms in the firmware may miss.
const MISSED: f64 = 0.15;
/// Share of the sigmas by which azimuths by the written model may differ from the engine's, root mean square.
const AGREES: f64 = 0.6;
/// Log evidence that every fitted number of a named effect must be worth.
const OF_NUMBER: f64 = 4.0;

/// Sigma of an azimuth that tells nothing, degrees.
const TELLS_NOTHING_DEG: f64 = 30.0;
/// Turning in a second above which the index does not rest, degrees.
const TURNS_DEG: f64 = 0.05;
/// Log evidence by which a model without the named effects must be better.
const MARGIN: f64 = 6.0;
/// The first where it has fewer effects, or as many with fewer numbers.
const MARGIN_OF_SIMPLER: f64 = 2.0;

/// A model of the open world over the runs of a campaign.
pub struct Open {
    learned: Learned,
    /// Names of the channels that its groups count.
    names: Vec<String>,
    /// Of every run; of those that were learned from by models without them.
    pub azimuths: Vec<Option<Prediction>>,
    /// It stands in the place of the named effects, not beside them.
    pub replaces: bool,
    /// Named effects that it replaces and that explain the campaign as well.
    named_as_good: Vec<String>,
    /// The model that was written holds all of it.
    pub deployed: bool,
    recordings: Vec<Recording>,
}

/// What was learned cannot be written as a model that the firmware evaluates: what of it, or why.
pub struct OffBoard(pub String);

impl Open {
    /// Beside the named effects or, where the evidence is for that, in their place. `left_out` gives the fit runs' azimuths by named
    /// effects without them.
    pub fn choose(
        runs: &[RunData],
        taken: &[Taken],
        bad_references: &[String],
        left_out: impl FnOnce() -> Vec<Option<Fix>>,
    ) -> Option<Self> {
        let beside = Self::learn(runs, taken, bad_references)?;
        if taken.is_empty() {
            return Some(beside);
        }
        let alone = Self::learn(runs, &[], bad_references)?;
        let numbers: usize = taken.iter().map(|each| each.candidate.freedom()).sum();
        let ahead = alone.learned.worth - (beside.learned.worth - OF_NUMBER * numbers as f64);
        let [size, of_beside] = [&alone, &beside].map(Self::size);
        let lead = ahead - margin(size, (taken.len() + of_beside.0, numbers + of_beside.1));
        if lead <= 0.0 {
            return Some(beside);
        }
        // What all runs have in common predicts others; processes of the runs' own may hide an azimuth.
        let hides = alone.is_process_only() && !beside.is_structure() && ahead < MARGIN_OF_PROCESSES;
        if hides && alone.misses_more(runs, &left_out(), bad_references) {
            return Some(beside);
        }
        let as_good = lead < 0.5 * AS_GOOD;
        let named_as_good = taken.iter().filter(|_| as_good).map(|each| each.candidate.full_name()).collect();
        Some(Self { replaces: true, named_as_good, ..alone })
    }

    /// Learns from the fit runs, whose named effects are taken out.
    fn learn(runs: &[RunData], taken: &[Taken], bad_references: &[String]) -> Option<Self> {
        let names = shared_channels(runs);
        let recordings = recordings(runs, taken, &names, bad_references);
        let fit: Vec<usize> =
            (0..runs.len()).filter(|&i| runs[i].role == Role::Fit && !recordings[i].is_empty()).collect();
        let training: Vec<&Recording> = fit.iter().map(|&i| &recordings[i]).collect();
        let learned = open_world::learn(&training)?;
        let all: Vec<&Recording> = recordings.iter().collect();
        let mut azimuths = learned.azimuths(&all);
        if learned.left_out.len() == fit.len() {
            for (&i, &left_out) in fit.iter().zip(&learned.left_out) {
                azimuths[i] = Some(left_out);
            }
        }
        Some(Self { learned, names, azimuths, replaces: false, named_as_good: Vec::new(), deployed: false, recordings })
    }

    /// Whether the fit runs' azimuths, each by a model without that run, miss their references by less (mean square, weighted by what
    /// their sigmas promise) than what it stands against: the azimuths by the named effects (`of_named`, degrees) where it stands
    /// beside these, else those before. Named effects that the evidence is against may fit few references closely, and are not asked.
    /// Where the fit runs' rates speak for it, each by what the others taught, it is enough that no azimuths get worse beyond chance: an
    /// effect may stand in few azimuths of these runs, and in all of others.
    pub fn is_better(&self, runs: &[RunData], of_named: &[Option<f64>], bad_references: &[String]) -> bool {
        let mut pairs: Vec<(f64, f64)> = Vec::new();
        for ((run, named_deg), own) in runs.iter().zip(of_named).zip(&self.azimuths) {
            let trusted = run.role == Role::Fit && !bad_references.contains(&run.file);
            let other_deg = if self.replaces { run.before.map(|fix| fix.azimuth_deg) } else { *named_deg };
            if let (Some(reference), Some(other_deg), Some(own)) =
                (run.reference_deg.filter(|_| trusted), other_deg, own)
            {
                let (own_deg, sigma_deg) = (own.azimuth_rad / RAD_PER_DEG, own.sigma_rad / RAD_PER_DEG);
                // A survey that is coarser than the sigma and than what the two azimuths differ by says nothing.
                let coarse_deg = run.reference_sigma_deg;
                if coarse_deg > sigma_deg && coarse_deg > wrap_180_deg(own_deg - other_deg).abs() {
                    continue;
                }
                // A run that the others say little about, and whose sigma says so, counts for little.
                let in_sigmas = |azimuth_deg: f64| wrap_180_deg(azimuth_deg - reference) / sigma_deg.hypot(coarse_deg);
                pairs.push((in_sigmas(other_deg), in_sigmas(own_deg)));
            }
        }
        let (before, after) =
            pairs.iter().fold((0.0, 0.0), |sum, each| (sum.0 + each.0 * each.0, sum.1 + each.1 * each.1));
        // Without references only the rates can be asked.
        let blind = pairs.is_empty() && (self.is_process_only() || self.learned.predictive_gain > PREDICTS_BLIND);
        let no_worse = blind
            || after < BETTER * before
            || (!pairs.is_empty()
                && self.learned.predictive_gain > PREDICTS
                && after < WORSE * before
                && guard::made_worse(&pairs).is_none());
        let share = |amplitude_deg_h: f64, run: &RunData| amplitude_deg_h / run.earth.north_deg_h;
        let had: Vec<f64> = runs.iter().filter_map(|run| Some(share(run.before?.amplitude_deg_h, run))).collect();
        let has: Vec<f64> = runs
            .iter()
            .zip(&self.azimuths)
            .filter_map(|(run, own)| Some(share((*own)?.amplitude_deg_h, run)))
            .collect();
        self.is_structure() && no_worse && guard::impossible_amplitude(&had, &has).is_none()
    }

    /// Whether the fit runs' azimuths, each by a model without that run, miss their references by more than others (mean square). Without
    /// references they do not.
    fn misses_more(&self, runs: &[RunData], others: &[Option<Fix>], bad_references: &[String]) -> bool {
        let (own_deg2, others_deg2) = self.missed_deg2(runs, others, bad_references);
        own_deg2 > others_deg2
    }

    /// Whether they miss them by far less than others.
    pub fn misses_far_less(&self, runs: &[RunData], others: &[Option<Fix>], bad_references: &[String]) -> bool {
        let (own_deg2, others_deg2) = self.missed_deg2(runs, others, bad_references);
        own_deg2 < FAR_LESS * others_deg2
    }

    /// Sums of the squares of what the fit runs' azimuths, each by a model without that run, and others miss, degrees².
    fn missed_deg2(&self, runs: &[RunData], others: &[Option<Fix>], bad_references: &[String]) -> (f64, f64) {
        let (mut own_deg2, mut others_deg2) = (0.0, 0.0);
        for ((run, own), other) in runs.iter().zip(&self.azimuths).zip(others) {
            let trusted = run.role == Role::Fit && !bad_references.contains(&run.file);
            if let (Some(reference_deg), Some(own), Some(other)) = (run.reference_deg.filter(|_| trusted), own, other) {
                own_deg2 += wrap_180_deg(own.azimuth_rad / RAD_PER_DEG - reference_deg).powi(2);
                others_deg2 += wrap_180_deg(other.azimuth_deg - reference_deg).powi(2);
            }
        }
        (own_deg2, others_deg2)
    }

    /// Whether there is anything but white noise.
    pub fn is_structure(&self) -> bool {
        !self.groups().is_empty() || self.has_process()
    }

    /// Whether runs have processes of their own.
    fn has_process(&self) -> bool {
        self.learned.process_gain > PROCESS
    }

    /// The model with what was learned in the firmware's terms.
    ///
    /// Errors: a group that the firmware has no terms for; terms that do not fit in a model, or not the effect.
    pub fn written(&self, runs: &[RunData], base: &ErrorModel) -> Result<ErrorModel, OffBoard> {
        let ranges = self.names.iter().zip(&self.learned.scales.channels);
        let channels: Vec<Ranged> =
            ranges.map(|(name, &[middle, half])| Ranged { name: name.clone(), middle, half }).collect();
        let mut terms: Vec<Term> = Vec::new();
        for found in self.groups() {
            let words = || OffBoard(found.group.words(&self.names));
            terms.extend(deploy::terms(&found.group, &channels).ok_or_else(words)?);
        }
        let too_many = || OffBoard("more terms than a model can hold".into());
        let mut model = base.clone();
        let known: usize = model.terms.iter().map(Term::count).sum();
        if terms.is_empty() {
            self.doubt(&mut model);
            return Ok(model);
        }
        let fit: Vec<usize> = (0..runs.len())
            .filter(|&i| runs[i].role == Role::Fit && !self.recordings[i].is_empty() && self.azimuths[i].is_some())
            .collect();
        let azimuth_rad = |i: usize| self.azimuths[i].map_or(0.0, |own| own.azimuth_rad);
        let functions: Vec<Vec<Vec<f64>>> = fit
            .par_iter()
            .map(|&i| {
                let (sin, cos) = azimuth_rad(i).sin_cos();
                let rate: Vec<f64> = runs[i]
                    .samples
                    .iter()
                    .map(|sample| runs[i].earth.north_deg_h * (cos * sample.cos + sin * sample.sin))
                    .collect();
                terms.iter().flat_map(|term| evaluated(&runs[i], term.clone(), &rate)).collect()
            })
            .collect();
        let recordings: Vec<(&Recording, f64)> = fit.iter().map(|&i| (&self.recordings[i], azimuth_rad(i))).collect();
        let Some(found) = self.learned.in_functions(&recordings, &functions).filter(|found| found.missed < MISSED)
        else {
            return Err(OffBoard("its curves are finer than the model's tables".into()));
        };
        let mut first = 0;
        for term in terms {
            let count = term.count();
            model.add(term.with_coefficients(&found.coefficients[first..first + count])).map_err(|_| too_many())?;
            first += count;
        }
        for direction in &mut model.doubt.directions {
            direction.resize(known + first, 0.0).map_err(|_| too_many())?;
        }
        for direction in &found.directions {
            let all = std::iter::repeat_n(0.0, known).chain(direction.iter().map(|&number| number as f32));
            let mut numbers = heapless::Vec::new();
            all.into_iter().try_for_each(|number| numbers.push(number)).map_err(|_| too_many())?;
            if model.doubt.directions.push(numbers).is_err() {
                break;
            }
        }
        self.doubt(&mut model);
        model.validate().map_err(|invalid| OffBoard(invalid.to_string()))?;
        Ok(model)
    }

    /// What widens the sigma: the misses of the training runs, and the likeliest process where there is one.
    fn doubt(&self, model: &mut ErrorModel) {
        model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(self.learned.excess_rad / RAD_PER_DEG);
        model.doubt.process = self.likeliest_process().and_then(|kernel| {
            let (kernel_of_model, time_s) = match kernel.shape? {
                Shape::Exponential | Shape::Course => (doubt::Kernel::Exponential, kernel.time_s),
                Shape::Matern => (doubt::Kernel::Matern, kernel.time_s),
                Shape::SquaredExponential => (doubt::Kernel::SquaredExponential, kernel.time_s),
                Shape::DampedCosine => {
                    (doubt::Kernel::DampedCosine { period_s: kernel.time_s }, DAMPING * kernel.time_s)
                }
            };
            Some(doubt::Process { kernel: kernel_of_model, sigma_deg_h: kernel.size * self.learned.unit_deg_h, time_s })
        });
    }

    /// Whether azimuths by the written model are those of the engine, within a part of its sigmas.
    pub fn agrees(&self, azimuths_deg: &[Option<f64>]) -> bool {
        let (mut apart, mut sigma) = (0.0, 0.0);
        for (azimuth_deg, own) in azimuths_deg.iter().zip(&self.azimuths) {
            if let (Some(azimuth_deg), Some(own)) = (azimuth_deg, own) {
                apart += wrap_180_deg(azimuth_deg - own.azimuth_rad / RAD_PER_DEG).powi(2);
                sigma += (own.sigma_rad / RAD_PER_DEG).powi(2);
            }
        }
        apart <= AGREES * AGREES * sigma
    }

    /// By how much its azimuths differ from others beyond its sigmas, degrees: the root of mean(d² − σ²), at least 0. A run whose sigma is
    /// of 30° or more says nothing.
    pub fn apart_beyond_sigma_deg(&self, azimuths_deg: &[Option<f64>]) -> f64 {
        let beyond: Vec<f64> = azimuths_deg
            .iter()
            .zip(&self.azimuths)
            .filter_map(|(azimuth_deg, own)| {
                let own = own.filter(|own| own.sigma_rad < TELLS_NOTHING_DEG * RAD_PER_DEG)?;
                let apart_deg = wrap_180_deg((*azimuth_deg)? - own.azimuth_rad / RAD_PER_DEG);
                Some(apart_deg.powi(2) - (own.sigma_rad / RAD_PER_DEG).powi(2))
            })
            .collect();
        open_world::root_of_mean(&beyond)
    }

    /// The runs without what it learned, as the engine itself sees that.
    pub fn taken_out(&self, runs: &[RunData]) -> Vec<RunData> {
        let of_run = |(run, recording): (&RunData, &Recording)| {
            let effect_deg_h = (!recording.is_empty()).then(|| self.learned.effect_deg_h(recording)).flatten();
            let mut run = run.clone();
            for (sample, effect_deg_h) in run.samples.iter_mut().zip(effect_deg_h.into_iter().flatten()) {
                sample.rate_deg_h -= effect_deg_h;
            }
            run
        };
        runs.par_iter().zip(&self.recordings).map(of_run).collect()
    }

    fn likeliest_process(&self) -> Option<open_world::Kernel> {
        (1..self.learned.kernels.len())
            .max_by(|&a, &b| self.learned.shares[a].total_cmp(&self.learned.shares[b]))
            .map(|kernel| self.learned.kernels[kernel])
            .filter(|_| self.has_process())
    }

    /// It has nothing but processes of the runs' own.
    pub fn is_process_only(&self) -> bool {
        self.groups().is_empty()
    }

    /// How many groups there are, and how many numbers were found for them: weights and constants.
    fn size(&self) -> (usize, usize) {
        let numbers = self.groups().iter().map(|found| found.width + found.group.constants());
        (self.groups().len(), numbers.sum())
    }

    fn groups(&self) -> &[Found] {
        self.learned.models.first().map_or(&[], |model| &model.groups)
    }

    /// Names of the channels that a group depends on.
    fn channels_of(&self, group: &Group) -> Vec<String> {
        group.channels().into_iter().map(|channel| self.names[channel].clone()).collect()
    }

    /// A group's name, with the channels where that does not say them, as a named candidate has it.
    fn full_name(&self, group: &Group) -> String {
        match self.channels_of(group).join(" and ").as_str() {
            "" | TEMPERATURE => group.name(),
            channels => format!("{}:{channels}", group.name()),
        }
    }

    /// What it learned, in words.
    pub fn effects(&self) -> Vec<Effect> {
        let weight = self.learned.models.first().map_or(1.0, |model| model.weight);
        let effect = |(place, found): (usize, &Found)| {
            let name = found.group.name();
            let channels = self.channels_of(&found.group);
            let mut ambiguous_with: Vec<String> = Vec::new();
            if place == 0 {
                ambiguous_with.extend(self.named_as_good.iter().cloned());
            }
            for model in self.learned.models.iter().skip(1) {
                let other = model.groups.get(place).map(|other| self.full_name(&other.group));
                let is_new = |other: &String| *other != self.full_name(&found.group) && !ambiguous_with.contains(other);
                ambiguous_with.extend(other.filter(is_new));
            }
            Effect {
                kind: "bias",
                channel: match channels.as_slice() {
                    [one] => Some(one.clone()),
                    _ => None,
                },
                parameters: BTreeMap::from([("rms_deg_h".to_owned(), found.size_deg_h)]),
                sigma: BTreeMap::new(),
                p_value: 1.0 / (1.0 + found.log_odds.exp()),
                ambiguous_with,
                evidence: format!(
                    "{}: log odds {:.0} over the model without it; weight of this model among those that are possible \
                     {weight:.2}",
                    found.group.words(&self.names),
                    found.log_odds
                ),
                board: self.deployed
                    && channels.iter().all(|name| ChannelName::new(name).is_some_and(|name| name.is_on_board(true))),
                channels,
                name,
            }
        };
        self.groups().iter().enumerate().map(effect).collect()
    }

    /// Runs that would tell the models that are still possible apart or, where a process of the runs' own remains, make the azimuth
    /// more certain; `sigma_now_deg` is what a usual azimuth is known to.
    pub fn next_experiment(&self, runs: &[RunData], sigma_now_deg: f64) -> Proposal {
        let words = |model: &open_world::Model| {
            model.groups.iter().map(|found| found.group.words(&self.names)).collect::<Vec<_>>().join(" and ")
        };
        let of_models: Vec<String> = self.learned.models.iter().map(words).collect();
        // Models with the same words are the same to whoever reads them.
        let mut names: Vec<String> = Vec::new();
        of_models.iter().for_each(|name| {
            if !names.contains(name) {
                names.push(name.clone());
            }
        });
        let place = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit && !self.recordings[i].is_empty());
        let place = place.max_by(|&a, &b| {
            self.learned.spread(&self.recordings[a]).total_cmp(&self.learned.spread(&self.recordings[b]))
        });
        let Some(place) = place.filter(|_| names.len() > 1 || self.has_process()) else { return Proposal::default() };
        let usual = &self.recordings[place];
        let mut groups = self.learned.models.iter().flat_map(|model| &model.groups);
        let follow_channels = groups.any(|found| !found.group.channels().is_empty());
        experiment::propose(&runs[place], &names, follow_channels, sigma_now_deg, |proposed| {
            let proposed: Vec<Recording> = proposed
                .iter()
                .map(|run| {
                    let rate_deg_h = run.samples.iter().map(|sample| sample.rate_deg_h).collect();
                    let noise_deg_h = Some(self.learned.unit_deg_h * 10f64.sqrt());
                    Recording { noise_deg_h, ..recording(run, rate_deg_h, &self.names, &[]) }
                })
                .collect();
            let found = self.learned.expected(&proposed, usual)?;
            let between = |one: &String, other: &String| {
                let is = |name: &String| (0..of_models.len()).filter(|&i| of_models[i] == *name).collect::<Vec<_>>();
                let pairs = is(one).into_iter().flat_map(|i| is(other).into_iter().map(move |k| (i, k)));
                pairs.map(|(i, k)| found.log_odds[i][k]).fold(f64::INFINITY, f64::min)
            };
            let log_odds = names.iter().map(|one| names.iter().map(|other| between(one, other)).collect()).collect();
            Some(Expectation { log_odds, sigma_deg: found.sigma_rad / RAD_PER_DEG })
        })
    }

    /// What remains: processes of the runs' own, in words.
    pub fn unexplained(&self) -> Vec<String> {
        let mut all = self.unexplained_process();
        let periods: Vec<String> = self.learned.wave_periods_s().iter().map(|s| format!("{s:.1} s")).collect();
        if !all.is_empty() && !periods.is_empty() {
            all.push(format!(
                "sinusoids that all runs share, each with a phase and a size of the run's own: {}; azimuths are estimated \
                 beside them",
                periods.join(", ")
            ));
        }
        if let Some(levels) = self.learned.switching().filter(|_| !all.is_empty()) {
            let [lower_s, upper_s] = levels.mean_s;
            all.push(format!(
                "rates go to and fro between two levels {:.4} deg/h apart, at times of each run's own: on average {lower_s:.0} s at the \
                 lower and {upper_s:.0} s at the upper one; azimuths are averaged over the ways that a run may have gone",
                levels.step_deg_h.hypot(levels.spread_deg_h)
            ));
        }
        all
    }

    fn unexplained_process(&self) -> Vec<String> {
        match self.likeliest_process() {
            Some(kernel) if kernel.shape == Some(Shape::Course) => vec![format!(
                "something happens in the runs by itself that no channel tells, typically {:.4} deg/h and {:.0} s apart; \
                 azimuths are estimated beside it, and sigma covers it",
                kernel.size * self.learned.unit_deg_h,
                kernel.time_s
            )],
            Some(kernel) => vec![format!(
                "a process of every run's own that no channel tells, typically {:.4} deg/h over {:.0} s; sigma covers it",
                kernel.size * self.learned.unit_deg_h,
                kernel.time_s
            )],
            None => Vec::new(),
        }
    }
}

/// Log evidence by which a model must be better to stand in the place of another, by the effects and the numbers of both. A model of
/// processes only is no simpler for it.
fn margin(size: (usize, usize), of_other: (usize, usize)) -> f64 {
    if size.0 > 0 && size < of_other { MARGIN_OF_SIMPLER } else { MARGIN }
}

/// Channels that all runs have and that take more than one value; the level accelerometers are no channels of the gyro's
/// environment here, but enter through the tilt.
fn shared_channels(runs: &[RunData]) -> Vec<String> {
    let Some(first) = runs.first() else { return Vec::new() };
    let varies = |name: &String| {
        runs.iter()
            .any(|run| run.channel(name).is_some_and(|values| values.iter().any(|value| Some(value) != values.first())))
    };
    first
        .channel_names()
        .into_iter()
        .filter(|name| !matches!(name.as_str(), "ax_g" | "ay_g"))
        .filter(|name| {
            runs.iter().all(|run| run.channel(name).is_some_and(|values| values.iter().all(|v| v.is_finite())))
        })
        .filter(varies)
        .collect()
}

/// The runs as the engine takes them, without what the named effects do; empty where a run has too little in it.
fn recordings(runs: &[RunData], taken: &[Taken], names: &[String], bad_references: &[String]) -> Vec<Recording> {
    let runs: Vec<RunData> = runs.par_iter().map(RunData::with_outliers).collect();
    let blocks: Vec<Option<Block>> = runs.iter().map(|run| Block::new(run, run.role == Role::Fit, None)).collect();
    let present: Vec<bool> = blocks.iter().map(Option::is_some).collect();
    let mut problem = Problem::new(blocks.into_iter().flatten().collect());
    problem.linearise(taken);
    let effects = problem.effects(taken);
    let mut rates = problem.blocks.iter().zip(problem.ranges()).map(|(block, range)| {
        let weighted = block.y.iter().zip(&effects[range]).zip(&block.root_weight);
        weighted.map(|((y, effect), weight)| if *weight > 0.0 { (y - effect) / weight } else { 0.0 }).collect()
    });
    let mut found = Vec::new();
    for (run, present) in runs.iter().zip(present) {
        let rate: Option<Vec<f64>> = if present { rates.next() } else { None };
        found.push(rate.map_or_else(Recording::default, |rate| recording(run, rate, names, bad_references)));
    }
    found
}

fn recording(run: &RunData, rate_deg_h: Vec<f64>, names: &[String], bad_references: &[String]) -> Recording {
    let reference_deg = run.reference_deg.filter(|_| !bad_references.contains(&run.file));
    Recording {
        north_deg_h: run.earth.north_deg_h,
        t_s: run.samples.iter().map(|sample| sample.t_s).collect(),
        interval_s: run.samples.iter().map(|sample| sample.seconds).collect(),
        dwell: run.samples.iter().map(|sample| sample.dwell).collect(),
        moving: run.samples.iter().map(|sample| sample.moving).collect(),
        enters: run.samples.iter().map(|sample| run.enters(sample)).collect(),
        design: run.samples.iter().map(|sample| sample.design).collect(),
        rate_deg_h,
        tilt_g: run.samples.iter().map(|sample| sample.level).collect(),
        channels: names.iter().map(|name| run.channel(name).unwrap_or_default()).collect(),
        reference: reference_deg
            .map(|deg| Reference { azimuth_rad: deg * RAD_PER_DEG, sigma_rad: run.reference_sigma_deg * RAD_PER_DEG }),
        rotation: run.rotation || turns(run),
        noise_deg_h: None,
    }
}

/// Whether the index turns in most of the seconds, if only so slowly that the replay makes a dwell of every few of them.
fn turns(run: &RunData) -> bool {
    let turned = |pair: &&[Sample]| {
        let [before, after] = pair else { return false };
        (after.sin * before.cos - after.cos * before.sin).abs() > TURNS_DEG * RAD_PER_DEG
    };
    2 * run.samples.windows(2).filter(turned).count() > run.samples.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bend in the place of a spline of six numbers; a gear in that of an eccentricity and another gear; two groups in that of one.
    #[test]
    fn what_is_simpler_needs_less_evidence() {
        assert_eq!(margin((1, 3), (1, 6)), MARGIN_OF_SIMPLER);
        assert_eq!(margin((1, 3), (2, 5)), MARGIN_OF_SIMPLER);
        assert_eq!(margin((1, 3), (1, 2)), MARGIN);
        assert_eq!(margin((2, 2), (1, 6)), MARGIN);
        assert_eq!(margin((0, 0), (1, 6)), MARGIN);
    }
}
