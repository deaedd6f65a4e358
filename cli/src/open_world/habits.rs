//! What is alike in the runs of a campaign: how often something of every kind happens, and waves that all runs have.

use super::atom::{Atom, Extent, KINDS, STEP};
use super::levels::{self, Switching};

/// Log evidence that the constants of a wave cost beside other ways to explain the runs.
const COST: f64 = 11.0;
/// Rates of what is usual, and of what is not.
const USUAL: f64 = 2.0;
const SELDOM: f64 = 0.003;
/// What every kind counts for beside those that were found.
const LITTLE: f64 = 0.3;

/// What runs share of a wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedWave {
    /// Mean over a run.
    pub frequency_hz: f64,
    /// By how much the frequency changes over a run, as a share of it.
    pub change: f64,
    /// Prior variance of its cosine and of its sine, °²/h².
    pub variance: f64,
}

impl SharedWave {
    /// In a run.
    pub fn atom(&self, extent: Extent) -> Atom {
        let between_s = [extent.from_s, extent.from_s + extent.length_s];
        Atom::Wave { between_s, frequency_hz: self.frequency_hz, change: self.change }
    }
}

/// What happens in the runs of a campaign is alike.
#[derive(Clone, Debug)]
pub struct Habits {
    /// How many atoms of every kind a run has on average (Poisson).
    pub rates: [f64; KINDS],
    /// Waves that every run has.
    pub waves: Vec<SharedWave>,
    /// A rate that goes to and fro between two levels, in the place of atoms.
    pub switching: Option<Switching>,
}

impl Default for Habits {
    fn default() -> Self {
        Self { rates: [1.0 / KINDS as f64; KINDS], waves: Vec::new(), switching: None }
    }
}

impl Habits {
    /// What may be usual in a campaign: anything, or some kinds nearly alone; beside waves anything or nothing; two levels.
    pub fn all(waves: &[SharedWave], switching: Option<Switching>) -> Vec<Self> {
        let nearly_alone = |kinds: &[usize]| {
            let mut rates = [SELDOM; KINDS];
            kinds.iter().for_each(|&kind| rates[kind] = USUAL / kinds.len() as f64);
            Self { rates, ..Self::default() }
        };
        let with_waves = |habits: Self| Self { waves: waves.to_vec(), ..habits };
        let beside_waves = [Self::default(), nearly_alone(&[])].map(with_waves);
        let [slope, step, approached, whole, part, switch, sawtooth] = [0, STEP, STEP + 1, 4, 5, 6, 7];
        let some = [&[step][..], &[slope, step], &[approached], &[whole], &[part], &[switch], &[sawtooth]];
        let beside_waves = beside_waves.into_iter().filter(|_| !waves.is_empty());
        let two_levels = switching.map(|switching| Self { switching: Some(switching), ..nearly_alone(&[]) });
        std::iter::once(Self::default()).chain(some.map(nearly_alone)).chain(beside_waves).chain(two_levels).collect()
    }

    /// Log evidence that constants which the runs share cost.
    pub fn cost(&self) -> f64 {
        COST * self.waves.len() as f64 + self.switching.map_or(0.0, |_| levels::COST)
    }

    /// The rates from the kinds that were found in runs.
    pub fn taught<'a>(self, found: impl Iterator<Item = &'a [usize]>) -> Self {
        let (mut counts, mut runs) = ([LITTLE; KINDS], 1.0);
        for kinds in found {
            runs += 1.0;
            kinds.iter().for_each(|&kind| counts[kind] += 1.0);
        }
        Self { rates: counts.map(|count| count / runs), ..self }
    }
}
