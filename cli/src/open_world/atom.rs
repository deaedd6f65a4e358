//! What may happen in a run by itself: its kinds, their functions of the time, what is near to one.

use super::sheet::Sheet;

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

    /// Where a period begins that has another length, so that the phase in the middle is the same.
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
pub const STEP: usize = 1;

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
    pub fn neighbours(self, share: f64, extent: Extent) -> Vec<Self> {
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
