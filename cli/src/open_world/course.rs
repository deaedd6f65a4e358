//! The course of a run by itself: steps, bumps, waves and switches that no channel tells, found in the run's own rate by matching pursuit.

use nalgebra::{DMatrix, DVector};

use super::columns::{from_columns, side_by_side};
use super::dictionary::Dictionary;
use super::evidence::{half_of, posterior};
use super::sheet::Sheet;
use super::tie::Tie;
use super::waves::{self, SharedWave};

/// Samples for which a step or a bump begins with one place; parts of a run between whose borders a wave may last.
const PLACES_OF_SAMPLE: f64 = 1.5;
const PARTS: usize = 5;
/// Time constants of steps and widths of bumps, as shares of the run.
const APPROACHES: [f64; 4] = [0.0, 0.025, 0.07, 0.17];
const WIDTHS: [f64; 4] = [0.02, 0.045, 0.1, 0.2];
/// Frequencies of a wave: the least and their distance in cycles, and the greatest in cycles a sample.
const LEAST_CYCLES: f64 = 0.5;
const CYCLES: f64 = 0.35;
pub const MOST_FREQUENCY: f64 = 0.9;
/// Changes of the frequency of a wave that lasts the whole run, as shares of it.
pub const CHANGES: [f64; 7] = [0.0, -0.12, 0.12, -0.25, 0.25, -0.45, 0.45];
/// Greatest change of a wave's frequency.
pub const MOST_CHANGE: f64 = 0.7;
/// Cycles of what is periodic: the least, and samples in one at least; phases, and for switches shares of a period.
const LEAST_PERIODS: f64 = 0.9;
const SAMPLES_OF_PERIOD: f64 = 5.0;
const PHASES: usize = 8;
const DUTIES: [f64; 3] = [0.3, 0.5, 0.7];
const TIMES: [f64; 2] = [0.05, 0.4];
/// Most columns of a course, as a share of the samples.
const MOST_COLUMNS: f64 = 0.4;
/// Log evidence, beyond what the choice among all atoms costs, that an atom must gain.
const LEAST_GAIN: f64 = 2.0;
/// Steps by which constants of atoms are refined, shares of the run; and most moves with each.
const STEPS: [f64; 5] = [0.02, 0.01, 0.005, 0.0025, 0.001];
const MOVES: usize = 8;
/// Log evidence by which an atom with other constants may be behind and still count.
const BEHIND: f64 = 4.0;

/// What happens in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Atom {
    /// In proportion to time.
    Slope,
    /// From a time on; approached with a time constant, 0 at once.
    Step { at_s: f64, time_s: f64 },
    /// Comes and goes.
    Bump { at_s: f64, width_s: f64 },
    /// A sinusoid between two times, whose frequency changes by this share of it.
    Wave { between_s: [f64; 2], frequency_hz: f64, change: f64 },
    /// On for a share of every period, from a time on, behind a low-pass whose time constant is a share of the period: a heater.
    Switch { on_s: f64, period_s: f64, duty: f64, time: f64 },
    /// Grows in proportion to time and falls back, in every period from a time on.
    Sawtooth { from_s: f64, period_s: f64 },
}

/// Where the samples of a run begin and end.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    pub from_s: f64,
    pub length_s: f64,
}

impl Extent {
    pub fn new(sheet: &Sheet) -> Self {
        let spans = &sheet.samples.spans;
        let from_s = spans.first().map_or(0.0, |span| span[0]);
        let to_s = spans.last().map_or(1.0, |span| span[1]);
        Self { from_s, length_s: to_s - from_s }
    }

    /// Where a period begins that has another length, so that the phase in the middle stays.
    fn about_middle(self, begins_s: f64, period_s: f64, other_s: f64) -> f64 {
        let middle_s = self.from_s + 0.5 * self.length_s;
        middle_s + (begins_s - middle_s) * other_s / period_s
    }
}

/// Periods a little longer and shorter: by this many half cycles over the run.
fn scaled_periods(period_s: f64, share: f64, extent: Extent) -> [f64; 2] {
    let step = 4.0 * share * period_s / extent.length_s;
    [period_s / (1.0 + step), period_s * (1.0 + step)]
}

/// Kinds of atoms: slopes, steps at once and approached, bumps, waves of the whole run and of a part, switches, sawteeth.
pub const KINDS: usize = 8;
const STEP: usize = 1;
/// Rates of what is usual, and of what is not.
const USUAL: f64 = 2.0;
const SELDOM: f64 = 0.003;
/// What every kind counts for beside those that were found.
const LITTLE: f64 = 0.3;

/// What happens in the runs of a campaign is alike.
#[derive(Clone, Debug)]
pub struct Habits {
    /// How many atoms of every kind a run has on average (Poisson).
    pub rates: [f64; KINDS],
    /// Waves that every run has.
    pub waves: Vec<SharedWave>,
}

impl Default for Habits {
    fn default() -> Self {
        Self { rates: [1.0 / KINDS as f64; KINDS], waves: Vec::new() }
    }
}

impl Habits {
    /// What may be usual in a campaign: anything, or some kinds nearly alone; beside waves anything or nothing.
    pub fn all(waves: &[SharedWave]) -> Vec<Self> {
        let nearly_alone = |kinds: &[usize]| {
            let mut rates = [SELDOM; KINDS];
            kinds.iter().for_each(|&kind| rates[kind] = USUAL / kinds.len() as f64);
            Self { rates, waves: Vec::new() }
        };
        let with_waves = |habits: Self| Self { waves: waves.to_vec(), ..habits };
        let beside_waves = [Self::default(), nearly_alone(&[])].map(with_waves);
        let [slope, step, approached, whole, part, switch, sawtooth] = [0, STEP, STEP + 1, 4, 5, 6, 7];
        let some = [&[step][..], &[slope, step], &[approached], &[whole], &[part], &[switch], &[sawtooth]];
        let beside_waves = beside_waves.into_iter().filter(|_| !waves.is_empty());
        std::iter::once(Self::default()).chain(some.map(nearly_alone)).chain(beside_waves).collect()
    }

    /// Log evidence that the waves' constants cost.
    pub fn cost(&self) -> f64 {
        waves::COST * self.waves.len() as f64
    }

    /// From what was found in runs beside waves.
    pub fn of<'a>(courses: impl Iterator<Item = &'a Course>, waves: Vec<SharedWave>) -> Self {
        let (mut counts, mut runs) = ([LITTLE; KINDS], 1.0);
        for course in courses {
            runs += 1.0;
            course.kinds.iter().for_each(|&kind| counts[kind] += 1.0);
        }
        Self { rates: counts.map(|count| count / runs), waves }
    }
}

impl Atom {
    pub fn kind(self, extent: Extent) -> usize {
        match self {
            Self::Slope => 0,
            Self::Step { time_s, .. } => STEP + usize::from(time_s > 0.0),
            Self::Bump { .. } => 3,
            Self::Wave { between_s: [from_s, to_s], .. } => 4 + usize::from(to_s - from_s < 0.999 * extent.length_s),
            Self::Switch { .. } => 6,
            Self::Sawtooth { .. } => 7,
        }
    }

    pub fn all(extent: Extent, samples: usize) -> Vec<Self> {
        let Extent { from_s, length_s } = extent;
        let mut all = vec![Self::Slope];
        let number = (PLACES_OF_SAMPLE * samples as f64) as usize;
        for place in 0..number {
            let at_s = from_s + length_s * (place as f64 + 0.5) / number as f64;
            all.extend(APPROACHES.map(|share| Self::Step { at_s, time_s: share * length_s }));
            all.extend(WIDTHS.map(|share| Self::Bump { at_s, width_s: share * length_s }));
        }
        let border_s = |border: usize| from_s + length_s * border as f64 / PARTS as f64;
        let most_hz = MOST_FREQUENCY * samples as f64 / length_s;
        for from in 0..PARTS {
            for to in from + 1..=PARTS {
                let between_s = [border_s(from), border_s(to)];
                let lasts_s = between_s[1] - between_s[0];
                let changes = if to - from == PARTS { &CHANGES[..] } else { &CHANGES[..1] };
                let mut cycles = LEAST_CYCLES;
                while cycles < most_hz * lasts_s {
                    let frequency_hz = cycles / lasts_s;
                    all.extend(changes.iter().map(|&change| Self::Wave { between_s, frequency_hz, change }));
                    cycles += CYCLES;
                }
            }
        }
        let mut cycles = LEAST_PERIODS;
        while cycles * SAMPLES_OF_PERIOD < samples as f64 {
            let period_s = length_s / cycles;
            for phase in 0..PHASES {
                let from_s = from_s + period_s * phase as f64 / PHASES as f64;
                all.push(Self::Sawtooth { from_s, period_s });
                let times = DUTIES.into_iter().flat_map(|duty| TIMES.map(|time| (duty, time)));
                all.extend(times.map(|(duty, time)| Self::Switch { on_s: from_s, period_s, duty, time }));
            }
            cycles += CYCLES;
        }
        all
    }

    pub fn columns(self, sheet: &Sheet, extent: Extent) -> Vec<Vec<f64>> {
        let (t_s, interval_s) = (&sheet.recording.t_s, &sheet.recording.interval_s);
        let means = |of: &dyn Fn(f64) -> f64| sheet.samples.means(t_s.iter().map(|&t_s| of(t_s)));
        match self {
            Self::Slope => vec![means(&|t_s| (t_s - extent.from_s) / extent.length_s)],
            Self::Step { at_s, time_s } if time_s > 0.0 => {
                vec![means(&|t_s| -(-(t_s - at_s).max(0.0) / time_s).exp_m1())]
            }
            Self::Step { at_s, .. } => {
                // A second in which it happens has a part of it.
                let of = |(&t_s, &interval_s): (&f64, &f64)| ((t_s - at_s) / interval_s + 0.5).clamp(0.0, 1.0);
                vec![sheet.samples.means(t_s.iter().zip(interval_s).map(of))]
            }
            Self::Switch { on_s, period_s, duty, time } => {
                // The periodic state of a low-pass: 1 − a e^(−x/τ) while on, b e^(−(x − duty)/τ) while off, x in periods.
                let gone = |x: f64| (-x / time).exp();
                let (a, b) = ((1.0 - gone(1.0 - duty)) / (1.0 - gone(1.0)), (1.0 - gone(duty)) / (1.0 - gone(1.0)));
                vec![means(&|t_s| {
                    let x = ((t_s - on_s) / period_s).rem_euclid(1.0);
                    if x < duty { 1.0 - a * gone(x) } else { b * gone(x - duty) }
                })]
            }
            Self::Sawtooth { from_s, period_s } => vec![means(&|t_s| ((t_s - from_s) / period_s).rem_euclid(1.0))],
            Self::Bump { at_s, width_s } => vec![means(&|t_s| (-0.5 * ((t_s - at_s) / width_s).powi(2)).exp())],
            Self::Wave { between_s: [from_s, to_s], frequency_hz, change } => {
                let lasts_s = to_s - from_s;
                let phase = |t_s: f64| {
                    let share = (t_s - from_s) / lasts_s;
                    // The integral of f (1 + c (x − ½)).
                    std::f64::consts::TAU * frequency_hz * lasts_s * share * (1.0 + 0.5 * change * (share - 1.0))
                };
                let inside = |t_s: f64| t_s > from_s && t_s < to_s;
                let [cos, sin]: [fn(f64) -> f64; 2] = [f64::cos, f64::sin];
                [cos, sin].map(|of| means(&|t_s| if inside(t_s) { of(phase(t_s)) } else { 0.0 })).to_vec()
            }
        }
    }

    /// With one constant a little more or less, by a share of the run.
    fn neighbours(self, share: f64, extent: Extent) -> Vec<Self> {
        let moved = |at_s: f64| [at_s - share * extent.length_s, at_s + share * extent.length_s];
        let scaled = |value: f64| [value / (1.0 + 8.0 * share), value * (1.0 + 8.0 * share)];
        match self {
            Self::Slope => Vec::new(),
            Self::Step { at_s, time_s } => {
                let places = moved(at_s).map(|at_s| Self::Step { at_s, time_s });
                let times = scaled(time_s).map(|time_s| Self::Step { at_s, time_s });
                places.into_iter().chain(times.into_iter().filter(|_| time_s > 0.0)).collect()
            }
            Self::Bump { at_s, width_s } => {
                let places = moved(at_s).map(|at_s| Self::Bump { at_s, width_s });
                places.into_iter().chain(scaled(width_s).map(|width_s| Self::Bump { at_s, width_s })).collect()
            }
            Self::Switch { on_s, period_s, duty, time } => {
                let switch = |on_s, period_s, duty, time| Self::Switch { on_s, period_s, duty, time };
                let mut all: Vec<Self> = moved(on_s).map(|on_s| switch(on_s, period_s, duty, time)).to_vec();
                // About a period that is changed the phase is kept in the middle of the run.
                let periods = scaled_periods(period_s, share, extent);
                all.extend(
                    periods.map(|other_s| switch(extent.about_middle(on_s, period_s, other_s), other_s, duty, time)),
                );
                let duties =
                    [duty - 4.0 * share, duty + 4.0 * share].into_iter().filter(|duty| (0.05..0.95).contains(duty));
                all.extend(duties.map(|duty| switch(on_s, period_s, duty, time)));
                let times = scaled(time).into_iter().filter(|time| (0.01..3.0).contains(time));
                all.extend(times.map(|time| switch(on_s, period_s, duty, time)));
                all
            }
            Self::Sawtooth { from_s, period_s } => {
                let periods = scaled_periods(period_s, share, extent).map(|other_s| Self::Sawtooth {
                    from_s: extent.about_middle(from_s, period_s, other_s),
                    period_s: other_s,
                });
                moved(from_s).map(|from_s| Self::Sawtooth { from_s, period_s }).into_iter().chain(periods).collect()
            }
            Self::Wave { between_s: [from_s, to_s], frequency_hz, change } => {
                let wave = |between_s, frequency_hz, change| Self::Wave { between_s, frequency_hz, change };
                // A share of a cycle over its whole length, a share of the frequency that makes a similar difference.
                let is_wave = |wave: &Self| match *wave {
                    Self::Wave { between_s: [from_s, to_s], frequency_hz, change } => {
                        frequency_hz * (to_s - from_s) >= LEAST_CYCLES && change.abs() <= MOST_CHANGE
                    }
                    _ => true,
                };
                let step_hz = 8.0 * share / (to_s - from_s);
                let step = 32.0 * share / (frequency_hz * (to_s - from_s)).max(1.0);
                let mut all = vec![
                    wave([from_s, to_s], frequency_hz - step_hz, change),
                    wave([from_s, to_s], frequency_hz + step_hz, change),
                    wave([from_s, to_s], frequency_hz, change - step),
                    wave([from_s, to_s], frequency_hz, change + step),
                ];
                let end_s = extent.from_s + extent.length_s;
                let ends = moved(to_s).map(|to_s| [from_s, to_s.min(end_s)]);
                let begins = moved(from_s).map(|from_s| [from_s.max(extent.from_s), to_s]);
                let lasts = |between_s: &[f64; 2]| between_s[1] - between_s[0] > 0.05 * extent.length_s;
                let of_ends = ends.into_iter().chain(begins).filter(lasts);
                all.extend(of_ends.map(|between_s| wave(between_s, frequency_hz, change)));
                all.retain(is_wave);
                all
            }
        }
    }
}

/// What was found in a run: atoms whose sizes have one prior variance.
#[derive(Clone, Debug)]
pub struct Course {
    pub atoms: Vec<Atom>,
    kinds: Vec<usize>,
    /// Columns of every atom over the samples times the prior standard deviation, °/h.
    parts: Vec<DMatrix<f64>>,
    /// Waves that all runs share, and steps between dwells, where nobody sees them: columns times the standard deviation that they
    /// are expected to have.
    expected: DMatrix<f64>,
    /// Of every atom, what else it may be: log evidence less that of the best, and its columns.
    others: Vec<Vec<(f64, DMatrix<f64>)>>,
    /// Log of the prior probability of these atoms.
    pub log_prior: f64,
    /// Standard deviation of what it does, °/h.
    pub size_deg_h: f64,
    pub length_s: f64,
    /// Inverse of the lower factor of the covariance white + atoms; logarithm of its determinant.
    pub half: DMatrix<f64>,
    pub log_determinant: f64,
}

/// A run's rate beside its own unknowns, and the atoms chosen so far.
struct Pursuit<'a> {
    sheet: &'a Sheet<'a>,
    extent: Extent,
    roots: DVector<f64>,
    /// Directions of the own unknowns, a surveyed heading's rows last.
    own: DMatrix<f64>,
    rate: DVector<f64>,
    variance: f64,
    penalties: [f64; KINDS],
    atoms: Vec<Atom>,
    kinds: Vec<usize>,
    /// Columns of every atom beside the own unknowns.
    columns: Vec<DMatrix<f64>>,
}

impl Pursuit<'_> {
    /// Columns over the samples beside the own unknowns.
    fn beside(&self, atom: Atom) -> DMatrix<f64> {
        let columns = atom.columns(self.sheet, self.extent);
        let n = self.roots.len();
        let mut all = DMatrix::zeros(self.own.nrows(), columns.len());
        for (mut column, values) in all.column_iter_mut().zip(&columns) {
            (0..n).for_each(|i| column[i] = values[i] * self.roots[i]);
        }
        let along = self.own.tr_mul(&all);
        all - &self.own * along
    }

    fn joined(&self) -> DMatrix<f64> {
        side_by_side(self.own.nrows(), &self.columns)
    }

    fn gain(&self) -> f64 {
        let all = self.joined();
        posterior(&all.tr_mul(&all), &all.tr_mul(&self.rate), &vec![self.variance; all.ncols()]).gain
    }

    /// Gain with another atom in a place.
    fn gain_with(&mut self, place: usize, atom: Atom) -> f64 {
        let new = self.beside(atom);
        let had = std::mem::replace(&mut self.columns[place], new);
        let gain = self.gain();
        self.columns[place] = had;
        gain
    }

    fn put(&mut self, place: usize, atom: Atom) {
        self.columns[place] = self.beside(atom);
        self.atoms[place] = atom;
    }

    /// Constants of one atom to where the evidence is greatest.
    fn refine(&mut self, place: usize, steps: &[f64]) {
        let mut best = self.gain();
        for &step in steps {
            for _ in 0..MOVES {
                let near = self.atoms[place].neighbours(step, self.extent);
                let found = near.into_iter().map(|atom| (self.gain_with(place, atom), atom));
                let Some((gain, atom)) = found.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|each| each.0 > best) else {
                    break;
                };
                best = gain;
                self.put(place, atom);
            }
        }
    }

    /// Adds atoms until none gains enough.
    fn grow(&mut self, dictionary: &Dictionary) {
        let most = (MOST_COLUMNS * self.roots.len() as f64) as usize;
        while self.columns.iter().map(DMatrix::ncols).sum::<usize>() < most {
            let joined = self.joined();
            let chosen = if joined.ncols() > 0 { joined.qr().q() } else { joined };
            let left = &self.rate - &chosen * chosen.tr_mul(&self.rate);
            let q = side_by_side(self.own.nrows(), [&self.own, &chosen]);
            let best = dictionary.best(&q, &left, self.variance, &self.penalties);
            let Some(((atom, kind), _)) = best.filter(|each| each.1 > LEAST_GAIN) else { break };
            self.kinds.push(kind);
            self.columns.push(self.beside(atom));
            self.atoms.push(atom);
            self.refine(self.atoms.len() - 1, &STEPS[..4]);
            if self.atoms.len().is_power_of_two() {
                (0..self.atoms.len()).for_each(|place| self.refine(place, &STEPS[1..4]));
            }
        }
        (0..self.atoms.len()).for_each(|place| self.refine(place, &STEPS[1..]));
    }

    /// Takes atoms away that others have made superfluous.
    fn prune(&mut self) {
        loop {
            let all = self.gain();
            let without = |place: usize| {
                let kept = |each: &(usize, &DMatrix<f64>)| each.0 != place;
                let rest =
                    side_by_side(self.own.nrows(), self.columns.iter().enumerate().filter(kept).map(|each| each.1));
                posterior(&rest.tr_mul(&rest), &rest.tr_mul(&self.rate), &vec![self.variance; rest.ncols()]).gain
            };
            let worth = |place: usize| all - without(place) - self.penalties[self.kinds[place]];
            let least = (0..self.atoms.len()).map(|place| (worth(place), place));
            let Some((_, place)) = least.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|each| each.0 < LEAST_GAIN) else {
                return;
            };
            self.atoms.remove(place);
            self.kinds.remove(place);
            self.columns.remove(place);
        }
    }

    /// Columns of an atom over the samples times the prior standard deviation.
    fn part(&self, atom: Atom) -> DMatrix<f64> {
        let columns = atom.columns(self.sheet, self.extent);
        from_columns(self.roots.len(), columns) * self.variance.sqrt()
    }

    /// What else an atom may be.
    fn others(&mut self, place: usize) -> Vec<(f64, DMatrix<f64>)> {
        let (atom, best) = (self.atoms[place], self.gain());
        let near = STEPS.iter().flat_map(|&step| atom.neighbours(step, self.extent));
        let near: Vec<Atom> = near.collect();
        let near = near.into_iter().map(|atom| (self.gain_with(place, atom) - best, atom));
        let near: Vec<(f64, Atom)> = near.filter(|each| each.0 > -BEHIND).collect();
        near.into_iter().map(|(behind, atom)| (behind, self.part(atom))).collect()
    }
}

/// What a course is sought in: a run, white.
pub struct Seen<'a> {
    pub sheet: &'a Sheet<'a>,
    /// Roots of the samples' weights.
    pub roots: DVector<f64>,
    /// Their white noise.
    pub white: DMatrix<f64>,
    /// Rows of the run's own unknowns, and what a surveyed heading says of them.
    pub design: &'a DMatrix<f64>,
    pub ties: Vec<Tie>,
    pub dictionary: &'a Dictionary,
}

impl Course {
    /// In what effects leave of a run's rate.
    pub fn find(run: &Seen<'_>, residual: &DVector<f64>, habits: &Habits) -> Self {
        let Seen { sheet, ties, dictionary, .. } = run;
        let roots = run.roots.clone();
        let n = roots.len();
        let rows = n + ties.len();
        let mut design = DMatrix::zeros(rows, 3);
        let mut rate = DVector::zeros(rows);
        for i in 0..n {
            (0..3).for_each(|j| design[(i, j)] = run.design[(i, j)] * roots[i]);
            rate[i] = residual[i] * roots[i];
        }
        for (i, tie) in ties.iter().enumerate() {
            design.row_mut(n + i).copy_from(&tie.row.transpose());
            rate[n + i] = tie.value;
        }
        let waves = of_waves(sheet, &habits.waves);
        let mut beside = DMatrix::zeros(rows, waves.ncols());
        (0..n).for_each(|i| beside.row_mut(i).copy_from(&(waves.row(i) * roots[i])));
        let own = side_by_side(rows, [&design, &beside]).qr().q();
        rate -= &own * own.tr_mul(&rate);
        let mean_square = rate.rows(0, n).norm_squared() / roots.norm_squared();
        let mut pursuit = Pursuit {
            sheet,
            extent: Extent::new(sheet),
            roots,
            own,
            rate,
            // Sizes are of the order of twice what there is to be explained.
            variance: 4.0 * mean_square,
            penalties: dictionary.penalties(habits),
            atoms: Vec::new(),
            kinds: Vec::new(),
            columns: Vec::new(),
        };
        pursuit.grow(dictionary);
        pursuit.prune();
        let unseen = unseen_steps(sheet, 4.0 * mean_square * habits.rates[STEP]);
        let expected = side_by_side(n, [&waves, &unseen]);
        let others = (0..pursuit.atoms.len()).map(|place| pursuit.others(place)).collect();
        let parts: Vec<DMatrix<f64>> = pursuit.atoms.iter().map(|&atom| pursuit.part(atom)).collect();
        let all = side_by_side(n, parts.iter().chain([&expected]));
        let (half, log_determinant) = half_of(&(&run.white + &all * all.transpose()));
        Self {
            log_prior: -habits.rates.iter().sum::<f64>()
                - pursuit.kinds.iter().map(|&kind| pursuit.penalties[kind]).sum::<f64>(),
            size_deg_h: mean_square.sqrt(),
            length_s: pursuit.extent.length_s,
            atoms: pursuit.atoms,
            kinds: pursuit.kinds,
            parts,
            others,
            expected,
            half,
            log_determinant,
        }
    }

    /// Of a run that has nothing but waves that all runs share.
    pub fn of_waves(run: &Seen<'_>, waves: &[SharedWave]) -> Self {
        let expected = of_waves(run.sheet, waves);
        let (half, log_determinant) = half_of(&(&run.white + &expected * expected.transpose()));
        Self {
            log_prior: 0.0,
            size_deg_h: 0.0,
            length_s: Extent::new(run.sheet).length_s,
            atoms: Vec::new(),
            kinds: Vec::new(),
            parts: Vec::new(),
            others: Vec::new(),
            expected,
            half,
            log_determinant,
        }
    }

    /// Factor of the covariance of what it does.
    pub fn factor(&self) -> DMatrix<f64> {
        side_by_side(self.half.nrows(), self.parts.iter().chain([&self.expected]))
    }

    /// The same with each atom in turn as what else it may be: log evidence less that of the best one.
    pub fn others(&self) -> impl Iterator<Item = Vec<(f64, DMatrix<f64>)>> {
        self.others.iter().enumerate().map(|(place, others)| {
            let with = |other: &DMatrix<f64>| {
                let parts = self.parts.iter().enumerate().map(|(at, part)| if at == place { other } else { part });
                side_by_side(self.half.nrows(), parts.chain([&self.expected]))
            };
            others.iter().map(|(behind, other)| (*behind, with(other))).collect()
        })
    }
}

/// Columns of waves times their prior standard deviations.
fn of_waves(sheet: &Sheet, waves: &[SharedWave]) -> DMatrix<f64> {
    let extent = Extent::new(sheet);
    let parts: Vec<DMatrix<f64>> = waves
        .iter()
        .map(|wave| from_columns(sheet.samples.len(), wave.atom(extent).columns(sheet, extent)) * wave.variance.sqrt())
        .collect();
    side_by_side(sheet.samples.len(), &parts)
}

/// Steps between samples that do not follow one another. One happens there with a probability in proportion to the time between; its
/// size then has a variance of which `variance` is what a run as a whole has.
fn unseen_steps(sheet: &Sheet, variance: f64) -> DMatrix<f64> {
    let (spans, length_s) = (&sheet.samples.spans, Extent::new(sheet).length_s);
    let steps = spans.windows(2).enumerate().filter(|(_, pair)| pair[1][0] > pair[0][1]).map(|(place, pair)| {
        let size = (variance * (pair[1][0] - pair[0][1]) / length_s).sqrt();
        (0..spans.len()).map(|i| if i > place { size } else { 0.0 }).collect::<Vec<f64>>()
    });
    from_columns(spans.len(), steps)
}
