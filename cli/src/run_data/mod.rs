//! The runs of a campaign as the seconds that the firmware's replay makes of them: what is learned from and judged.

mod fingerprints;
mod read;
mod to_search;

pub use read::read;
pub use to_search::{Runs, to_search};

use fingerprints::Fingerprints;

use learn::Recording;
pub use learn::Sample;
use north_finder::earth::EarthRate;
use north_finder::effects::now::RunFacts;
use north_finder::effects::plausible::LastReadings;
use north_finder::effects::track::REST_DEG;
use north_finder::effects::{ChannelName, ErrorModel, Plausible};
use north_finder::event::{Dwell, Fix};
use north_finder::fix::DesignRow;
use north_finder::fix::accumulator::{Corrected, ROTATION_SHARE};
use north_finder::fix::dwell::DwellSummary;
use north_finder::instrument::replay::{Place, RecordedSecond, Replay, Reported};
use north_finder::settings::Settings;
use schemars::JsonSchema;
use serde::Serialize;

use crate::campaign::Role;
use crate::file_error::FileError;
use crate::solve::{AllDwells, AllSeconds, lacking_fact};

/// More outliers than one second in this many are no shocks but something to be explained.
const SECONDS_BY_SHOCK: usize = 50;

/// The index of a still recording keeps within this, as the chord of its directions: 2°.
const CHORD: f64 = 0.035;

/// One run, read.
#[derive(Clone, Debug)]
pub struct RunData {
    pub file: String,
    pub role: Role,
    /// With the model that the run was made with.
    pub settings: Settings,
    pub earth: EarthRate,
    pub reference_deg: Option<f64>,
    pub reference_sigma_deg: f64,
    /// Where it was made; runs of one station share one heading.
    pub station: Option<String>,
    pub samples: Vec<Sample>,
    /// Names of the extra channels and their values by the sample.
    pub names: Vec<String>,
    pub channels: Vec<Vec<f64>>,
    /// An index error that was taken out of the samples and is in every replay, degrees.
    pub turned_deg: Option<f64>,
    /// The seconds as they were recorded, for other models.
    recorded: Vec<RecordedSecond>,
    pub before: Option<Fix>,
    /// Why there is no azimuth.
    pub refusal: Option<String>,
    /// Lines of seconds that the fix left out as outliers.
    pub outliers: Vec<u64>,
    /// What is known of it as a whole.
    pub facts: RunFacts,
    /// Marks of its increments.
    marks: Fingerprints,
    /// Noise of a one-second rate where it is known beforehand, °/h.
    pub noise_deg_h: Option<f64>,
    /// Most of the time the index turns.
    pub rotation: bool,
}

impl RunData {
    /// Cells that enter: those at rest, or in a continuous rotation all.
    pub fn enters(&self, sample: &Sample) -> bool {
        sample.enters(self.rotation)
    }

    /// Whether the index stays where it is throughout.
    pub fn at_one_position(&self) -> bool {
        let Some(first) = self.samples.first() else { return false };
        self.samples.iter().all(|each| !each.moving && (each.cos - first.cos).hypot(each.sin - first.sin) < CHORD)
    }

    /// As the search takes it.
    pub fn recording(&self) -> Recording {
        Recording {
            file: self.file.clone(),
            reference_deg: self.reference_deg,
            reference_sigma_deg: self.reference_sigma_deg,
            station: self.station.clone(),
            fix_deg: self.before.map(|fix| fix.azimuth_deg),
            earth: self.earth,
            facts: self.facts,
            samples: self.samples.clone(),
            names: self.names.clone(),
            channels: self.channels.clone(),
            noise_deg_h: self.noise_deg_h,
            still: self.at_one_position(),
            rotation: self.rotation,
        }
    }

    /// Whether another run holds a stretch of the same recording.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.marks.overlap(&other.marks)
    }

    /// Whether the gyro gives one reading throughout: it is dead.
    pub fn repeats_itself(&self) -> bool {
        let raw = |each: &RecordedSecond| each.second.conditions.raw_rate_deg_h;
        !self.recorded.is_empty() && self.recorded.windows(2).all(|pair| raw(&pair[0]) == raw(&pair[1]))
    }

    /// A channel's values by the sample.
    pub fn channel(&self, name: &str) -> Option<Vec<f64>> {
        let of = |value: fn(&Sample) -> Option<f64>| self.samples.iter().map(value).collect::<Option<Vec<_>>>();
        match name {
            "temp_c" => of(|sample| sample.temp_c),
            "ax_g" => of(|sample| sample.level.map(|level| level.forward)),
            "ay_g" => of(|sample| sample.level.map(|level| level.left)),
            _ => self.names.iter().position(|each| each == name).and_then(|i| self.channels.get(i).cloned()),
        }
    }

    /// All channels' names.
    pub fn channel_names(&self) -> Vec<String> {
        let has = |name: &str| self.channel(name).is_some();
        let known = ["temp_c", "ax_g", "ay_g"].into_iter().filter(|name| has(name)).map(str::to_owned);
        known.chain(self.names.iter().cloned()).collect()
    }

    /// Which of the channels the model follows, in its order.
    ///
    /// Errors: the run lacks one, or the temperature or the level that a term needs.
    fn slots(&self, model: &ErrorModel) -> Result<Vec<usize>, String> {
        let lacks = |channel: &str| {
            format!("the error model follows channel `{channel}`, and the recording has no such column")
        };
        let has = |of: fn(&RecordedSecond) -> bool| self.recorded.iter().any(of);
        let (has_temperature, has_level) =
            (has(|each| each.second.conditions.temp_c.is_some()), has(|each| each.second.conditions.level.is_some()));
        if let Some(channel) = model.lacks(has_temperature, has_level) {
            return Err(lacks(channel));
        }
        let slot = |name: &str| self.names.iter().position(|each| each == name).ok_or_else(|| lacks(name));
        model.channels().iter().map(|name| slot(name.as_str())).collect()
    }

    /// Holds the last reading of a channel that could be, as a model with these intervals does.
    pub fn hold_readings(&mut self, plausible: &[Plausible]) {
        let names: Vec<ChannelName> = plausible.iter().map(|each| each.channel).collect();
        let slots: Vec<Option<usize>> =
            names.iter().map(|name| self.names.iter().position(|each| each == name.as_str())).collect();
        let mut last = LastReadings::default();
        for (i, each) in self.recorded.iter_mut().enumerate() {
            let mut read = each.second.conditions;
            for (value, slot) in read.channels.iter_mut().zip(&slots) {
                *value = slot.map_or(f64::NAN, |slot| self.channels[slot][i]);
            }
            last.hold(plausible, &names, &mut read);
            for (value, slot) in read.channels.iter().zip(&slots) {
                if let Some(slot) = slot {
                    self.channels[*slot][i] = *value;
                }
            }
            each.second.conditions.temp_c = read.temp_c;
            if let Some(sample) = self.samples.get_mut(i) {
                sample.temp_c = read.temp_c;
            }
        }
    }

    /// Whether it has every channel that a model follows.
    pub fn has_channels_of(&self, model: &ErrorModel) -> bool {
        self.slots(model).is_ok()
    }

    /// Azimuth by the firmware's replay with a model: that of `north solve --model`, with all digits. What was taken out of the
    /// samples is in the model.
    ///
    /// Errors: why there is none, in words.
    pub fn replay(&self, model: &ErrorModel, told: &mut dyn FnMut(Reported)) -> Result<Fix, String> {
        self.replayed(model, told).map(|(fix, _)| fix)
    }

    /// The same with the dwells as the solution sees them.
    fn replayed(&self, model: &ErrorModel, told: &mut dyn FnMut(Reported)) -> Result<(Fix, AllDwells), String> {
        let slots = self.slots(model)?;
        if let Some(fact) = lacking_fact(model, &self.facts) {
            return Err(format!("the error model follows the {fact}, and it is not known when the run started"));
        }
        let mut model = model.clone();
        if let Some(turned_deg) = self.turned_deg {
            model.index_error.get_or_insert_default().offset_deg += turned_deg;
        }
        let settings = Settings { model: Some(model), ..self.settings.clone() };
        let mut replay = Replay::new(&settings, AllDwells::default(), AllSeconds::default())
            .map_err(|refusal| refusal.to_string())?;
        replay.set_run(self.facts);
        for (i, each) in self.recorded.iter().enumerate() {
            let mut each = *each;
            for (value, &slot) in each.second.conditions.channels.iter_mut().zip(&slots) {
                *value = self.channels[slot][i];
            }
            replay.take(&each, told);
        }
        let fix = replay.finish(told).map_err(|refusal| refusal.to_string())?;
        Ok((fix, replay.into_dwells()))
    }

    /// The dwells as the solution sees them; `None` without an azimuth.
    pub fn dwells(&self, model: &ErrorModel) -> Option<AllDwells> {
        self.replayed(model, &mut |_| ()).ok().map(|(_, dwells)| dwells)
    }

    /// The same with the dwells and the times of their ends; `None` without an azimuth.
    pub fn solve(&self, model: &ErrorModel) -> Option<(Fix, Vec<(f64, Dwell)>)> {
        let mut dwells = Vec::new();
        let mut note = |told: Reported| {
            if let Reported::Dwell { dwell, end_s, .. } = told {
                dwells.push((end_s, dwell));
            }
        };
        let fix = self.replay(model, &mut note).ok()?;
        Some((fix, dwells))
    }

    /// The run with another model applied to its samples, as the replay applies it; what depends on the azimuth is taken out with the azimuth of the replay, and what the correction of the scale
    /// factor makes of the run's own bias with its bias.
    pub fn with(&self, model: &ErrorModel) -> Self {
        let mut told = Vec::with_capacity(self.recorded.len());
        // Without an azimuth the samples are corrected all the same.
        let fix = self.replay(model, &mut |each| {
            if let Reported::Second(second, _) = each {
                told.push(second);
            }
        });
        told.sort_by(|a, b| time_s(a).total_cmp(&time_s(b)));
        if let Ok(fix) = fix {
            let mut way: Vec<DwellSummary> = Vec::new();
            for second in &mut told {
                second.rate_deg_h -= second.of_azimuth_deg_h(model, &way, &self.earth, fix.azimuth_deg);
                second.rate_deg_h -= second.of_bias() * fix.bias_deg_h;
                let winding_deg = |dwell: &DwellSummary| dwell.carried.winding_deg();
                let has_turned = |own: &DwellSummary| {
                    way.last().is_none_or(|last| (winding_deg(own) - winding_deg(last)).abs() > REST_DEG)
                };
                way.extend(second.as_dwell().filter(has_turned));
            }
        }
        let mut run = self.clone();
        for (place, second) in told.iter().enumerate() {
            if let Some(of_run) = run.samples.get_mut(place) {
                let Sample { moving, left_out, dwell, line, .. } = *of_run;
                *of_run = Sample { moving, left_out, ..sample(second, Place::LeftOut, dwell, line, &self.earth) };
            }
        }
        run
    }

    /// The samples, dwells and outliers by the model that the run was made with, and its azimuth.
    fn replay_as_made(&mut self, gaps: &[usize], lines: &[u64]) {
        let model = self.settings.model.clone().unwrap_or_default();
        let mut told = Vec::with_capacity(self.recorded.len());
        let (mut dwell, mut outliers_s) = (0, Vec::new());
        let fix = self.replay(&model, &mut |each| match each {
            Reported::Second(second, place) => {
                if let Place::Dwell(number) = place {
                    dwell = usize::from(number);
                }
                told.push((second, place, dwell));
            }
            Reported::Dwell { outliers_s: of_dwell, .. } => {
                dwell += 1;
                outliers_s.extend(of_dwell);
            }
        });
        match fix {
            Ok(fix) => self.before = Some(fix),
            Err(refusal) => self.refusal = Some(refusal),
        }
        told.sort_by(|a, b| time_s(&a.0).total_cmp(&time_s(&b.0)));
        self.samples = told
            .iter()
            .zip(lines)
            .map(|(&(second, place, dwell), &line)| sample(&second, place, dwell, line, &self.earth))
            .collect();
        for &gap in gaps {
            if let Some(sample) = self.samples.get_mut(gap) {
                sample.left_out = true;
            }
        }
        let of_rest = |moving: bool| -> f64 {
            self.samples.iter().filter(|sample| sample.moving == moving).map(|sample| sample.seconds).sum()
        };
        let (rest_s, moving_s) = (of_rest(false), of_rest(true));
        self.rotation = rest_s < ROTATION_SHARE * (rest_s + moving_s);
        if outliers_s.len() * SECONDS_BY_SHOCK <= self.samples.len() {
            let is_outlier = |sample: &&mut Sample| !sample.left_out && outliers_s.contains(&sample.t_s);
            for sample in self.samples.iter_mut().filter(is_outlier) {
                sample.left_out = true;
                self.outliers.push(sample.line);
            }
        }
    }
}

fn time_s(second: &Corrected) -> f64 {
    second.measured.conditions.t_s
}

fn sample(second: &Corrected, place: Place, dwell: usize, line: u64, earth: &EarthRate) -> Sample {
    let conditions = &second.measured.conditions;
    let index = second.index.unwrap_or_default();
    Sample {
        t_s: conditions.t_s,
        seconds: conditions.seconds,
        rate_deg_h: second.rate_deg_h,
        cos: index.cos,
        sin: index.sin,
        design: second.design(earth).unwrap_or_else(|| DesignRow::new(index, conditions.level, earth)),
        temp_c: conditions.temp_c,
        level: conditions.level,
        moving: place == Place::Moving,
        left_out: place == Place::LeftOut,
        dwell,
        line,
    }
}

/// Why a campaign cannot be diagnosed at all.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    #[error(transparent)]
    File(#[from] FileError),
    /// The campaign as a whole does not allow it.
    #[error("{0}")]
    Campaign(String),
    /// A run makes no sense; `line` counts the header as 1.
    #[error("{run}{}: {problem}", line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Run { run: String, line: Option<u64>, problem: String },
}

/// A doubt about the campaign.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Warning {
    /// The run's file; absent when it concerns the whole campaign.
    pub run: Option<String>,
    /// Line of that file, from 1, the header being 1.
    pub line: Option<u64>,
    pub message: String,
    /// What many warnings of this kind say in one line; without it, those with the same message.
    #[serde(skip)]
    pub of_many: Option<&'static str>,
    /// The other run that it concerns.
    #[serde(skip)]
    pub other: Option<String>,
}

impl Warning {
    /// Of the campaign as a whole.
    pub fn of_campaign(message: String) -> Self {
        Self { run: None, line: None, message, of_many: None, other: None }
    }

    /// Of a run.
    pub fn of_run(file: &str, message: impl Into<String>) -> Self {
        Self { run: Some(file.to_owned()), line: None, message: message.into(), of_many: None, other: None }
    }

    /// At a line of the run's file.
    pub fn at_line(self, line: u64) -> Self {
        Self { line: Some(line), ..self }
    }
}
