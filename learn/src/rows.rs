//! The runs as the search sees them: rows at rest, what the Earth's rate should be in them, and what effects are evaluated from.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::sync::{Arc, Mutex};

use north_finder::earth::EarthRate;
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::{Effect, Port};
use north_finder::effects::factor::{Factor, Memory};
use north_finder::effects::now::{Belief, Now, RunFacts};
use north_finder::effects::shape::MAX_FUNCTIONS;
use north_finder::effects::signal::Signal;
use north_finder::effects::track::Track;
use north_finder::effects::{ChannelName, Conditions, MAX_CHANNELS};
use north_finder::fix::DesignRow;
use north_finder::fix::way::Turn;
use north_finder::sensing::index::Direction;
use north_finder::units::{DEG_PER_RAD, RAD_PER_DEG, wrap_180_deg, wrap_360_deg};

use super::process::{Instants, Whitener};
use super::recording::{Recording, Sample};
use super::rounding;

/// Most rows of one run in the search, and of all runs together as long as each has the least: longer ones are means over some seconds. A dwell of a
/// minute in eight has twenty rows of three seconds.
const MOST_ROWS: usize = 160;
const LEAST_ROWS: usize = 8;
/// The same of a still recording, which may last for days.
const MOST_STILL_ROWS: usize = 1600;
const ALL_ROWS: usize = 3200;
/// Relative error of the amplitude that a run may have of its own, one sigma: scale factor and latitude of a sound instrument.
const AMPLITUDE_SIGMA: f64 = 0.01;
/// One sigma of an azimuth about its first estimate where there is no reference, rad.
pub const UNKNOWN_RAD: f64 = 0.2;
/// One sigma of a survey that says none, and of the index on top of it, degrees.
const SURVEY_SIGMA_DEG: f64 = 0.005;
const INDEX_SIGMA_DEG: f64 = 0.01;
/// One sigma of how well the instrument is set up again on a station, rad: 0.005°, a pillar with forced centring.
const SETTING_RAD: f64 = 0.005 * RAD_PER_DEG;
/// One sigma of a run's bias, °/h: none to speak of.
const BIAS_SIGMA_DEG_H: f64 = 1e3;

/// Unknowns of every run that are integrated out: azimuth (rad), relative amplitude, bias (°/h).
pub const UNKNOWNS: usize = 3;

/// One run.
#[derive(Clone, Debug)]
pub struct Run {
    pub file: String,
    /// Surveyed azimuth and its sigma, degrees.
    pub reference: Option<(f64, f64)>,
    /// Where it was made, if others were made at the same heading and nobody surveyed it.
    pub station: Option<String>,
    /// What the run alone says, without any effect, degrees.
    pub plain_deg: Option<f64>,
    /// Where the equations are linearised, degrees.
    pub azimuth_deg: f64,
    /// The index stays at one position: there is no azimuth in it.
    pub still: bool,
    /// Nothing begins with its dwells: it is still, or turns most of the time.
    evenly: bool,
    /// Horizontal and vertical Earth rate, °/h.
    pub north_deg_h: f64,
    pub up_deg_h: f64,
    facts: RunFacts,
    /// Every second, the turning ones too.
    seconds: Vec<Conditions>,
    samples: Vec<Sample>,
    tracks: Vec<Track>,
    names: Vec<String>,
    channels: Vec<Vec<f64>>,
    /// Values of the signals by the second, as they are asked for.
    signals: Arc<Mutex<HashMap<String, Arc<Vec<f64>>>>>,
    /// The rows of the search, as ranges of seconds.
    bins: Vec<Range<usize>>,
    /// Of every bin: middle, and when the index had come to rest, s; mean rate less the vertical Earth rate, °/h; variance, (°/h)².
    pub t_s: Vec<f64>,
    pub rests_s: Vec<f64>,
    pub rate_deg_h: Vec<f64>,
    pub variance: Vec<f64>,
    cos: Vec<f64>,
    sin: Vec<f64>,
    /// The accelerometers are seen to err: their readings change, and the base stands.
    level_errs: bool,
}

impl Run {
    /// One of so many runs. `None` where nothing is at rest, or where there is neither a reference nor an azimuth and the index turned. At one
    /// position the Earth's rate is a bias.
    pub fn new(recording: Recording, runs: usize) -> Option<Self> {
        let most = if recording.still { MOST_STILL_ROWS } else { MOST_ROWS };
        let bins = bins(&recording, (ALL_ROWS / runs.max(1)).clamp(LEAST_ROWS, most));
        let mut run = Self::in_rows(recording, bins)?;
        let rates: Vec<f64> = run.samples.iter().map(|sample| sample.rate_deg_h).collect();
        let of_rounding = rounding::by_bin(&run.bins, &run.dwell_of_rows(), &rates);
        run.variance.iter_mut().zip(of_rounding).for_each(|(variance, more)| *variance += more);
        Some(run)
    }

    /// One row for every dwell, of which this is the rate (°/h): that of its seconds less the motion of the base.
    pub fn of_dwells(recording: Recording, dwells: &[(Range<usize>, f64)]) -> Option<Self> {
        let (bins, rates): (Vec<Range<usize>>, Vec<f64>) = dwells.iter().cloned().unzip();
        let mut run = Self::in_rows(recording, bins)?;
        let vertical = run.means(&|sample| sample.design.vertical_deg_h);
        run.rate_deg_h = rates.iter().zip(vertical).map(|(rate, vertical)| rate - vertical).collect();
        Some(run)
    }

    /// With these ranges of seconds as its rows.
    fn in_rows(recording: Recording, bins: Vec<Range<usize>>) -> Option<Self> {
        let Recording { reference_deg, reference_sigma_deg, fix_deg, still, earth, .. } = recording;
        let sigma_deg = if reference_sigma_deg > 0.0 { reference_sigma_deg } else { SURVEY_SIGMA_DEG };
        let reference = reference_deg.map(|deg| (deg, sigma_deg.hypot(INDEX_SIGMA_DEG)));
        let mut run = Self {
            file: recording.file,
            reference,
            station: recording.station.filter(|_| reference.is_none()),
            plain_deg: fix_deg,
            azimuth_deg: reference_deg.or(fix_deg).or(still.then_some(0.0))?,
            still,
            evenly: still || recording.rotation,
            north_deg_h: earth.north_deg_h,
            up_deg_h: earth.up_deg_h,
            facts: recording.facts,
            seconds: Vec::new(),
            samples: recording.samples,
            tracks: Vec::new(),
            names: recording.names,
            channels: recording.channels,
            signals: Arc::default(),
            bins,
            t_s: Vec::new(),
            rests_s: Vec::new(),
            rate_deg_h: Vec::new(),
            variance: Vec::new(),
            cos: Vec::new(),
            sin: Vec::new(),
            level_errs: false,
        };
        run.gather(recording.noise_deg_h);
        run.follow();
        (run.bins.len() > UNKNOWNS).then_some(run)
    }

    /// Means of a value of the samples, by the row.
    fn means(&self, value: &dyn Fn(&Sample) -> f64) -> Vec<f64> {
        let of_bin = |bin: &Range<usize>| self.samples[bin.clone()].iter().map(value).sum::<f64>() / bin.len() as f64;
        self.bins.iter().map(of_bin).collect()
    }

    /// Means over the rows; their noise is as declared for a second (°/h), or as they scatter.
    fn gather(&mut self, declared_deg_h: Option<f64>) {
        self.t_s = self.means(&|sample| sample.t_s);
        self.rests_s = self.came_to_rest_s();
        self.rate_deg_h = self.means(&|sample| sample.rate_deg_h - sample.design.vertical_deg_h);
        self.cos = self.means(&|sample| sample.design.cos);
        self.sin = self.means(&|sample| sample.design.sin);
        let seconds: Vec<f64> =
            self.bins.iter().map(|bin| self.samples[bin.clone()].iter().map(|each| each.seconds).sum()).collect();
        let noise = declared_deg_h.unwrap_or_else(|| noise_deg_h(&self.rate_deg_h, &self.t_s, &seconds));
        self.variance = seconds.iter().map(|seconds| noise * noise / seconds).collect();
    }

    /// What happens second by second. What the gyro measured is what it should have measured at this azimuth: its noise is no signal.
    fn follow(&mut self) {
        let second = |sample: &Sample| conditions(sample, self.belief(sample).rate_deg_h);
        self.seconds = self.samples.iter().map(second).collect();
        let mut track = Track::default();
        let follow = |each: &Conditions| {
            track.push(each);
            track
        };
        self.tracks = self.seconds.iter().map(follow).collect();
        self.signals = Arc::default();
    }

    /// Its reference is not believed: its azimuth is an unknown about what it says itself.
    pub fn lose_reference(&mut self) {
        self.reference = None;
        self.station = None;
        self.set_azimuth(self.plain_deg.unwrap_or(self.azimuth_deg));
    }

    /// The same without what something else added to its rates, °/h by the row.
    pub fn less(mut self, added_deg_h: &[f64]) -> Self {
        self.rate_deg_h.iter_mut().zip(added_deg_h).for_each(|(rate, added)| *rate -= added);
        self
    }

    /// The equations are linearised elsewhere.
    pub fn set_azimuth(&mut self, azimuth_deg: f64) {
        self.azimuth_deg = azimuth_deg;
        self.follow();
    }

    /// It has another reference.
    pub fn take_reference(&mut self, reference: Option<(f64, f64)>) {
        self.reference = reference;
        self.set_azimuth(reference.map_or(self.azimuth_deg, |(deg, _)| deg));
    }

    /// Its accelerometers err, by what all runs say.
    pub fn with_level_errors(self) -> Self {
        Self { level_errs: true, ..self }
    }

    pub fn level_errs(&self) -> bool {
        self.level_errs
    }

    /// Its levels are measured.
    pub fn has_level(&self) -> bool {
        self.samples.iter().any(|sample| sample.level.is_some())
    }

    pub fn rows(&self) -> usize {
        self.bins.len()
    }

    /// Length of a usual second, and of the whole run, s.
    pub fn lengths_s(&self) -> (f64, f64) {
        let row_s = self.samples.first().map_or(1.0, |sample| sample.seconds);
        (row_s, self.samples.last().map_or(0.0, |sample| sample.t_s))
    }

    /// Dwells by their rows.
    pub fn dwell_of_rows(&self) -> Vec<usize> {
        self.bins.iter().map(|bin| self.samples[bin.start].dwell).collect()
    }

    /// When the index had come to rest before each row, s: with the first row of its dwell.
    fn came_to_rest_s(&self) -> Vec<f64> {
        let mut last = None;
        let of_row = |bin: &Range<usize>| {
            let first = &self.samples[bin.start];
            let rest = last.filter(|(dwell, _)| *dwell == first.dwell);
            let (_, rest_s) = *last.insert(rest.unwrap_or((first.dwell, first.t_s - 0.5 * first.seconds)));
            rest_s
        };
        self.bins.iter().map(of_row).collect()
    }

    /// What makes its rows independent beside a process of its own.
    pub fn whitener(&self, process: Option<&Process>) -> Whitener {
        let gains = self.gains_of(process);
        Whitener::new(
            Instants { t_s: &self.t_s, rests_s: &self.rests_s, variance: &self.variance, gains: &gains },
            process,
        )
    }

    /// What 1 °/h of a process adds to the rate, °/h, by the row.
    pub fn gains_of(&self, process: Option<&Process>) -> Vec<f64> {
        match process.map(|process| process.port).filter(|port| *port != Port::Rate) {
            None => vec![1.0; self.rows()],
            Some(port) => self.gains(port).into_iter().map(|gain| gain * port.per_deg_h()).collect(),
        }
    }

    /// Rate that is left when the Earth's is taken out, by the row, °/h.
    pub fn residual_deg_h(&self) -> Vec<f64> {
        self.rate_deg_h.iter().zip(self.amplitudes()).map(|(rate, earth)| rate - earth).collect()
    }

    /// The Earth's horizontal rate about the axis, by the row, °/h.
    fn amplitudes(&self) -> Vec<f64> {
        let (sin, cos) = (self.azimuth_deg * RAD_PER_DEG).sin_cos();
        self.cos.iter().zip(&self.sin).map(|(c, s)| self.north_deg_h * (c * cos + s * sin)).collect()
    }

    /// Columns of the run's own unknowns, each for one sigma of what is known of it beforehand.
    pub fn unknowns(&self) -> [Vec<f64>; UNKNOWNS] {
        let free_rad = if self.station.is_some() { SETTING_RAD } else { UNKNOWN_RAD };
        let tie_rad = self.reference.map_or(free_rad, |(_, sigma_deg)| sigma_deg * RAD_PER_DEG);
        let azimuth = self.turned_by(tie_rad);
        let amplitude = self.amplitudes().into_iter().map(|rate| AMPLITUDE_SIGMA * rate).collect();
        [azimuth, amplitude, vec![BIAS_SIGMA_DEG_H; self.rows()]]
    }

    /// What a turn by an angle (rad) adds to the rates, °/h, by the row.
    fn turned_by(&self, angle_rad: f64) -> Vec<f64> {
        let (sin, cos) = (self.azimuth_deg * RAD_PER_DEG).sin_cos();
        let turn = |(c, s): (&f64, &f64)| angle_rad * self.north_deg_h * (s * cos - c * sin);
        self.cos.iter().zip(&self.sin).map(turn).collect()
    }

    /// The same for one radian, the whole amplitude and 1 °/h.
    pub fn unknowns_by_unit(&self) -> [Vec<f64>; UNKNOWNS] {
        [self.turned_by(1.0), self.amplitudes(), vec![1.0; self.rows()]]
    }

    /// Means over the rows of what was found by the second; 0 where a second of the row has nothing.
    pub fn by_row(&self, by_second: &[f64]) -> Vec<f64> {
        self.means_by_row(by_second).map(|mean| if mean.is_finite() { mean } else { 0.0 }).collect()
    }

    /// The same; not-a-number where a second has nothing.
    fn means_by_row(&self, by_second: &[f64]) -> impl Iterator<Item = f64> {
        self.bins.iter().map(|bin| by_second[bin.clone()].iter().sum::<f64>() / bin.len() as f64)
    }

    /// What unit weights of an effect add to the rate, °/h, by the row.
    pub fn columns_of(&self, effect: &Effect) -> Vec<Vec<f64>> {
        let mut columns = vec![self.gains(effect.port)];
        for factor in &effect.factors {
            let functions = self.functions_by_row(factor);
            let times = |column: &Vec<f64>, function: &Vec<f64>| -> Vec<f64> {
                column.iter().zip(function).map(|(a, b)| a * b).collect()
            };
            columns = columns.iter().flat_map(|column| functions.iter().map(move |each| times(column, each))).collect();
        }
        columns
    }

    /// What an effect adds to the rate, °/h, by the row.
    pub fn added_by(&self, effect: &Effect) -> Vec<f64> {
        let columns = self.columns_of(effect);
        let sum = |row: usize| columns.iter().zip(&effect.weights).map(|(c, w)| c[row] * f64::from(*w)).sum();
        (0..self.rows()).map(sum).collect()
    }

    /// What the rate of a second changes by, by unit of what an effect adds at a port.
    fn gain(&self, port: Port, sample: &Sample) -> f64 {
        let (sin, cos) = (self.azimuth_deg * RAD_PER_DEG).sin_cos();
        match port {
            Port::Rate => 1.0,
            Port::Scale => self.belief(sample).rate_deg_h,
            // The index reads too much: the axis is clockwise of where it is taken to be.
            Port::Index => -RAD_PER_DEG * self.north_deg_h * (sample.design.cos * sin - sample.design.sin * cos),
            // The level reads too much, and so much too much of the vertical rate is taken out.
            Port::Forward => -self.up_deg_h * sample.cos,
            Port::Left => -self.up_deg_h * sample.sin,
        }
    }

    /// What an error of the index, degrees by the row, adds to the rates beyond what is linear in it, °/h.
    pub fn beyond_linear(&self, index_error_deg: &[f64]) -> Vec<f64> {
        let rest = |(error_deg, (across, along)): (&f64, (f64, f64))| {
            let (sin, cos) = (error_deg * RAD_PER_DEG).sin_cos();
            along * (cos - 1.0) + across * (sin - error_deg * RAD_PER_DEG)
        };
        index_error_deg.iter().zip(self.turned_by(1.0).into_iter().zip(self.amplitudes())).map(rest).collect()
    }

    fn belief(&self, sample: &Sample) -> Belief {
        let index_deg = sample.sin.atan2(sample.cos) * DEG_PER_RAD;
        Belief {
            axis_azimuth_deg: wrap_360_deg(self.azimuth_deg - index_deg),
            rate_deg_h: self.earth_rate_deg_h(&sample.design),
        }
    }

    /// Names of all channels that vary by themselves.
    pub fn channel_names(&self) -> impl Iterator<Item = &str> {
        let temperature = self.samples.iter().all(|sample| sample.temp_c.is_some()).then_some("temp_c");
        temperature.into_iter().chain(self.names.iter().map(String::as_str))
    }

    /// What comes out of a factor's dynamics in the rows at rest; not-a-number where its signal says nothing.
    pub fn inputs(&self, factor: &Factor) -> Vec<f64> {
        let by_second = self.inputs_by_second(factor);
        let mut inputs = Vec::with_capacity(by_second.len());
        self.bins.iter().for_each(|bin| inputs.extend_from_slice(&by_second[bin.clone()]));
        inputs
    }

    /// How many seconds each row has.
    pub fn row_lengths(&self) -> impl Iterator<Item = usize> {
        self.bins.iter().map(|bin| bin.len())
    }

    /// The values of a signal by the second; not-a-number where it says nothing.
    fn signal(&self, signal: &Signal) -> Arc<Vec<f64>> {
        let key = format!("{signal:?}");
        if let Ok(signals) = self.signals.lock()
            && let Some(known) = signals.get(&key)
        {
            return known.clone();
        }
        let names: heapless::Vec<ChannelName, MAX_CHANNELS> = signal.channels().copied().collect();
        let places: Vec<Option<usize>> =
            names.iter().map(|name| self.names.iter().position(|each| each == name.as_str())).collect();
        let value = |(i, (conditions, track)): (usize, (&Conditions, &Track))| {
            let mut conditions = *conditions;
            for (value, place) in conditions.channels.iter_mut().zip(&places) {
                *value = place.map_or(f64::NAN, |place| self.channels[place][i]);
            }
            let belief = signal.needs_azimuth().then(|| self.belief(&self.samples[i]));
            let now = Now { conditions: &conditions, channels: &names, track, run: &self.facts, belief };
            signal.value(&now).unwrap_or(f64::NAN)
        };
        let values: Arc<Vec<f64>> = Arc::new(self.seconds.iter().zip(&self.tracks).enumerate().map(value).collect());
        if let Ok(mut signals) = self.signals.lock() {
            signals.insert(key, values.clone());
        }
        values
    }

    /// What comes out of a factor's dynamics by the second; not-a-number where its signal says nothing. A rate of change is not known in the first second
    /// of a run, or after a gap, and is that of the next one.
    fn inputs_by_second(&self, factor: &Factor) -> Vec<f64> {
        let values = self.signal(&factor.signal);
        if factor.dynamics.is_empty() {
            return values.to_vec();
        }
        let mut inputs = vec![f64::NAN; values.len()];
        let mut memory = Memory::default();
        let mut waits = false;
        for (i, (&value, track)) in values.iter().zip(&self.tracks).enumerate() {
            if factor.is_replayed() && i > 0 && !track.in_a_row {
                self.met_in_turn_deg_h(i).for_each(|rate_deg_h| _ = factor.pass(Some(rate_deg_h), 0.0, &mut memory));
            }
            let input = factor.pass(value.is_finite().then_some(value), track.step_s, &mut memory);
            if let Some(input) = input {
                inputs[i - usize::from(waits)..=i].fill(input);
            }
            waits = input.is_none() && value.is_finite();
        }
        inputs
    }

    /// The Earth's rates that the axis met in a turn to a second whose rows were left out, °/h.
    fn met_in_turn_deg_h(&self, second: usize) -> impl Iterator<Item = f64> {
        let [from_deg, to_deg] = [second - 1, second].map(|second| self.tracks[second].winding_deg);
        let earth = EarthRate { north_deg_h: self.north_deg_h, up_deg_h: self.up_deg_h };
        let level = self.samples[second].level;
        Turn { from_deg, to_deg, rows: 0.0 }
            .places_deg(self.azimuth_deg)
            .map(move |index_deg| self.earth_rate_deg_h(&DesignRow::new(Direction::of_deg(index_deg), level, &earth)))
    }

    /// The Earth's rate about the axis, °/h.
    fn earth_rate_deg_h(&self, design: &DesignRow) -> f64 {
        let (sin, cos) = (self.azimuth_deg * RAD_PER_DEG).sin_cos();
        self.north_deg_h * (design.cos * cos + design.sin * sin) + design.vertical_deg_h
    }

    /// Numbers of consecutive rows that one coarse row stands for, within one dwell.
    pub fn coarse(&self, most: usize) -> Vec<Range<usize>> {
        let together = self.rows().div_ceil(most).max(1);
        let dwells = self.dwell_of_rows();
        let mut coarse: Vec<Range<usize>> = Vec::new();
        let mut first = 0;
        while first < self.rows() {
            let count = dwells[first..].iter().take_while(|dwell| **dwell == dwells[first]).count();
            let own = first..first + count;
            coarse.extend(parted(&own, count.div_ceil(together), self.evenly, |row| self.bins[row].len()));
            first += count;
        }
        coarse
    }

    /// What the rate of a row changes by, by unit of what an effect adds at a port.
    pub fn gains(&self, port: Port) -> Vec<f64> {
        self.means(&|sample| self.gain(port, sample))
    }

    /// The functions of a factor by the row, means over its seconds; 0 where its signal says nothing.
    pub fn functions_by_row(&self, factor: &Factor) -> Vec<Vec<f64>> {
        functions_of_rows(factor, &self.inputs(factor), self.row_lengths())
    }
}

/// The functions of a factor, means over rows of so many seconds, whose seconds get these inputs one after the other; 0 in a row where one gets nothing.
pub fn functions_of_rows(factor: &Factor, inputs: &[f64], lengths: impl Iterator<Item = usize>) -> Vec<Vec<f64>> {
    let mut functions = vec![Vec::new(); factor.count()];
    let mut rest = inputs;
    for length in lengths {
        let (row, after) = rest.split_at(length);
        rest = after;
        let mut sums = [0.0_f64; MAX_FUNCTIONS + 1];
        if !row.iter().any(|input| input.is_nan()) {
            let (constant, of_shape) = sums.split_at_mut(usize::from(factor.constant));
            constant.fill(length as f64);
            for &input in row {
                of_shape.iter_mut().zip(&factor.shape.values(input)).for_each(|(sum, value)| *sum += value);
            }
        }
        for (function, sum) in functions.iter_mut().zip(sums) {
            let mean = sum / length as f64;
            function.push(if mean.is_finite() { mean } else { 0.0 });
        }
    }
    functions
}

/// Whether a signal is another one where a run is linearised at another azimuth: the rate as it was measured is the one that should have been.
pub fn depends_on_azimuth(signal: &Signal) -> bool {
    signal.needs_azimuth() || *signal == Signal::Measured
}

/// Names of the stations whose heading nobody knows.
fn names(runs: &[Run]) -> BTreeSet<String> {
    runs.iter().filter_map(|run| run.station.clone()).collect()
}

/// The runs of a station are linearised at one azimuth: the mean of what they say themselves.
pub fn linearise_by_station(runs: &mut [Run]) {
    for name in names(runs) {
        let own = |run: &Run| run.station.as_ref() == Some(&name);
        let first_deg = runs.iter().find(|run| own(run)).map_or(0.0, |run| run.azimuth_deg);
        let apart: Vec<f64> =
            runs.iter().filter(|run| own(run)).map(|run| wrap_180_deg(run.azimuth_deg - first_deg)).collect();
        let mean_deg = first_deg + apart.iter().sum::<f64>() / apart.len() as f64;
        runs.iter_mut().filter(|run| own(run)).for_each(|run| run.set_azimuth(wrap_360_deg(mean_deg)));
    }
}

/// What one sigma of every station's heading adds to the rates, by the row and all runs one after the other.
pub fn stations(runs: &[Run]) -> Vec<Vec<f64>> {
    let of_station = |name: String| {
        let of_run = |run: &Run| {
            let sigma_rad = if run.station.as_ref() == Some(&name) { UNKNOWN_RAD } else { 0.0 };
            run.turned_by(sigma_rad)
        };
        runs.iter().flat_map(of_run).collect()
    };
    names(runs).into_iter().map(of_station).collect()
}

fn conditions(sample: &Sample, raw_rate_deg_h: f64) -> Conditions {
    Conditions {
        t_s: sample.t_s,
        seconds: sample.seconds,
        raw_rate_deg_h,
        index: Some(north_finder::sensing::index::Direction { cos: sample.cos, sin: sample.sin }),
        temp_c: sample.temp_c,
        level: sample.level,
        channels: [f64::NAN; MAX_CHANNELS],
    }
}

/// Rows at rest, on average as many seconds together as the run's length asks for, within one dwell, and longer the later unless nothing begins with the
/// dwells.
fn bins(recording: &Recording, most: usize) -> Vec<Range<usize>> {
    let Recording { samples, still, rotation, .. } = recording;
    let entering: Vec<usize> = (0..samples.len()).filter(|&i| samples[i].enters(*rotation)).collect();
    let together = entering.len().div_ceil(most).max(1);
    let mut stretches: Vec<Range<usize>> = Vec::new();
    for i in entering {
        match stretches.last_mut() {
            Some(last) if last.end == i && samples[last.start].dwell == samples[i].dwell => last.end = i + 1,
            _ => stretches.push(i..i + 1),
        }
    }
    let rows = |stretch: &Range<usize>| parted(stretch, stretch.len().div_ceil(together), *still || *rotation, |_| 1);
    stretches.iter().flat_map(rows).collect()
}

/// What is in a range in so many parts at most, each of a length of its own. In a dwell parts become longer linearly, because after a move most happens at
/// first; `evenly` they are of one length.
fn parted(range: &Range<usize>, parts: usize, evenly: bool, length: impl Fn(usize) -> usize) -> Vec<Range<usize>> {
    let whole: usize = range.clone().map(&length).sum();
    let (mut before, mut last) = (0, usize::MAX);
    let mut all: Vec<Range<usize>> = Vec::new();
    for i in range.clone() {
        let share = (before as f64 + 0.5 * length(i) as f64) / whole as f64;
        let part = (if evenly { share } else { share.sqrt() } * parts as f64) as usize;
        match all.last_mut() {
            Some(own) if part == last => own.end = i + 1,
            _ => all.push(i..i + 1),
        }
        (before, last) = (before + length(i), part);
    }
    all
}

/// Noise of a one-second rate, °/h, from differences of neighbouring rows: the smaller of the root mean square and of the one that the median
/// gives, so that shocks do not count.
fn noise_deg_h(rate_deg_h: &[f64], t_s: &[f64], seconds: &[f64]) -> f64 {
    let mut squares: Vec<f64> = Vec::new();
    for i in 1..rate_deg_h.len() {
        if t_s[i] - t_s[i - 1] < 0.75 * (seconds[i] + seconds[i - 1]) {
            squares.push((rate_deg_h[i] - rate_deg_h[i - 1]).powi(2) / (1.0 / seconds[i] + 1.0 / seconds[i - 1]));
        }
    }
    if squares.is_empty() {
        return 1.0;
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    squares.sort_by(f64::total_cmp);
    // The median of a chi-square of one degree of freedom is 0.4549.
    let by_median = squares[squares.len() / 2] / 0.4549;
    if by_median > 0.0 { mean.min(by_median).sqrt() } else { mean.sqrt() }.max(1e-6)
}

#[cfg(test)]
impl Run {
    /// Of rates (°/h) of a second each at four positions in turn, with a surveyed azimuth of north.
    pub fn of_rates(rate_deg_h: &[f64]) -> Self {
        let quarter = |i: usize| (i as f64 * std::f64::consts::FRAC_PI_2).sin_cos();
        let sample = |(i, rate_deg_h): (usize, &f64)| Sample {
            t_s: i as f64,
            rate_deg_h: *rate_deg_h,
            ..Sample::at_index(quarter(i))
        };
        Self {
            file: String::new(),
            reference: Some((0.0, SURVEY_SIGMA_DEG)),
            station: None,
            plain_deg: None,
            azimuth_deg: 0.0,
            still: false,
            evenly: false,
            north_deg_h: 10.0,
            up_deg_h: 11.0,
            facts: RunFacts::default(),
            seconds: Vec::new(),
            samples: rate_deg_h.iter().enumerate().map(sample).collect(),
            tracks: Vec::new(),
            names: Vec::new(),
            channels: Vec::new(),
            signals: Arc::default(),
            bins: (0..rate_deg_h.len()).map(|i| i..i + 1).collect(),
            t_s: (0..rate_deg_h.len()).map(|i| i as f64).collect(),
            rests_s: (0..rate_deg_h.len()).map(|i| i as f64).collect(),
            rate_deg_h: rate_deg_h.to_vec(),
            variance: vec![1.0; rate_deg_h.len()],
            cos: (0..rate_deg_h.len()).map(|i| quarter(i).1).collect(),
            sin: (0..rate_deg_h.len()).map(|i| quarter(i).0).collect(),
            level_errs: false,
        }
    }

    /// The same with a move of the index before every `rest`-th of them.
    pub fn of_rests(rate_deg_h: &[f64], rest: usize) -> Self {
        let rests_s = (0..rate_deg_h.len()).map(|i| (i / rest * rest) as f64 - 0.5).collect();
        Self { rests_s, ..Self::of_rates(rate_deg_h) }
    }

    /// Numbers between -1 and 1 without a pattern, others for every run.
    pub fn noise(run: usize, i: usize) -> f64 {
        ((i * i * 7 + i * 13 + run * 31) % 17) as f64 / 8.0 - 1.0
    }
}

#[cfg(test)]
impl Sample {
    /// A second at an index angle of this sine and cosine.
    fn at_index((sin, cos): (f64, f64)) -> Self {
        Self {
            t_s: 0.0,
            seconds: 1.0,
            rate_deg_h: 5.0,
            cos,
            sin,
            design: DesignRow { cos, sin, vertical_deg_h: 0.1 },
            temp_c: Some(20.0),
            level: None,
            moving: false,
            left_out: false,
            dwell: 0,
            line: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use north_finder::effects::dynamics::{Greatest, Rate};

    use super::super::functions::Library;
    use super::super::spans::IDENTITY;
    use super::*;

    /// Of these seconds (values of a signal), each a second long.
    fn of_signal(signal: Signal, values: &[f64], bins: Vec<Range<usize>>) -> Run {
        let mut run = Run::of_rates(&vec![0.0; bins.len()]);
        let mut of_a_second = Track::default();
        of_a_second.step_s = 1.0;
        run.tracks = vec![of_a_second; values.len()];
        run.seconds = vec![Conditions::default(); values.len()];
        run.bins = bins;
        run.signals.lock().unwrap().insert(format!("{signal:?}"), Arc::new(values.to_vec()));
        run
    }

    fn sample(index_deg: f64) -> Sample {
        Sample::at_index(index_deg.to_radians().sin_cos())
    }

    /// North, east, south and west, 10 °/h horizontal. The index reads 30° too much: the axis is 30° clockwise of where it is taken to be. North: 10 cos 30° less
    /// 10; the index turns the other way than azimuths, so that 90° is west: 10 cos 60° = 5 less the linear 10 · π/6.
    #[test]
    fn beyond_what_is_linear_in_an_error_of_the_index() {
        let run = Run::of_rates(&[0.0; 4]);
        let north = 10.0 * (0.75f64.sqrt() - 1.0);
        let west = 5.0 - 10.0 * std::f64::consts::PI / 6.0;
        for (found, expected) in run.beyond_linear(&[30.0; 4]).into_iter().zip([north, west, -north, -west]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        assert!((run.turned_by(1.0)[1] - 10.0).abs() < 1e-9, "clockwise from west is towards north");
    }

    /// A signal of thousandths: of 0.001 and 0.003 the mean is 0.002, and it is not taken for nothing. In the row of the third second it says nothing.
    #[test]
    fn what_a_shape_gets_may_be_small() {
        let factor = Factor::new(Signal::Since, &[], IDENTITY);
        let run = of_signal(factor.signal, &[0.001, 0.003, f64::NAN, 0.004], vec![0..2, 2..3, 3..4]);
        let inputs = Library::new(&[]).inputs(&[run], &factor);
        assert!((inputs[0] - 0.002).abs() < 1e-12 && inputs[1].is_nan() && inputs[2] == 0.004, "{inputs:?}");
    }

    /// The signal 1, 3, 6, none, 2, 7 in rows of the first two seconds, the next two, and the last two: its rates over a second are 2, 2, 3, none, 5, 5,
    /// where the first second after a gap has that of the next one. The means are 2 and 5, and in the second row nothing is known: 0, of the constant too.
    #[test]
    fn a_rate_by_the_row_by_hand() {
        let factor = Factor::new(Signal::Turn, &[Rate { tau_s: 0.01 }.into()], IDENTITY).with_constant();
        let run = of_signal(factor.signal, &[1.0, 3.0, 6.0, f64::NAN, 2.0, 7.0], vec![0..2, 2..4, 4..6]);
        assert_eq!(run.functions_by_row(&factor), [[1.0, 0.0, 1.0], [2.0, 0.0, 5.0]]);
    }

    /// A run over north, at 10° and at 200°: of the signals that every second has those that depend on the azimuth differ, and no other.
    #[test]
    fn only_what_depends_on_the_azimuth_changes_with_it() {
        let mut run = Run::of_rates(&[0.0; 8]);
        run.samples = (0..8).map(|i| Sample { t_s: i.into(), ..sample(40.0 * f64::from(i)) }).collect();
        let at = |azimuth_deg: f64| {
            let mut run = run.clone();
            run.set_azimuth(azimuth_deg);
            run
        };
        let (one, other) = (at(10.0), at(200.0));
        for signal in Signal::without_channels() {
            let digits = |run: &Run| run.signal(&signal).iter().map(|value| value.to_bits()).collect::<Vec<u64>>();
            assert_eq!(digits(&one) != digits(&other), depends_on_azimuth(&signal), "{signal}");
            let factor = Factor::new(signal, &[Rate { tau_s: 3.0 }.into()], IDENTITY);
            let functions = |library: &Library, run: &Run| library.functions(from_ref(run), &factor).to_vec();
            let before = Library::new(from_ref(&one));
            functions(&before, &one);
            let anew = functions(&Library::new(from_ref(&other)), &other);
            assert_eq!(functions(&before.in_runs(from_ref(&other)), &other), anew, "{signal}");
        }
    }

    /// 10 °/h horizontal at an azimuth of 45°, at an index of 0° and then of 90°: both rates are 10 cos 45°, and the greatest is that of north, where the axis points on
    /// the way, if the rows of the turn were left out.
    #[test]
    fn a_turn_without_rows_meets_what_lies_between() {
        let greatest = |in_a_row: bool| {
            let factor = Factor::new(Signal::Rate, &[Greatest {}.into()], IDENTITY);
            let half = 10.0 * 0.5_f64.sqrt();
            let mut run = of_signal(factor.signal, &[half, half], vec![0..1, 1..2]);
            run.azimuth_deg = 45.0;
            run.samples = vec![sample(0.0), sample(90.0)];
            run.tracks[1].winding_deg = 90.0;
            run.tracks[1].in_a_row = in_a_row;
            run.inputs(&factor)[1]
        };
        assert!((greatest(false) - 10.0).abs() < 1e-9 && (greatest(true) - 7.0711).abs() < 1e-4);
    }

    /// Of sixteen seconds in four parts those end at 16 (k/4)²: 1, 4, 9 and 16. Of a rotation all are alike. Of rows of lengths 1, 3, 5 and 7 each is a part.
    #[test]
    fn parts_of_a_dwell_become_longer() {
        assert_eq!(parted(&(0..16), 4, false, |_| 1), [0..1, 1..4, 4..9, 9..16]);
        assert_eq!(parted(&(0..16), 4, true, |_| 1), [0..4, 4..8, 8..12, 12..16]);
        assert_eq!(parted(&(2..6), 4, false, |i| 2 * (i - 2) + 1), [2..3, 3..4, 4..5, 5..6]);
    }
}
