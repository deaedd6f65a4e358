//! The fault campaign: an instrument with random faults anywhere, and what becomes of its fix.

mod kind;
mod session;

pub use kind::Kind;
pub use session::{Ending, Outcome};

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use clap::ValueEnum;
use hal_sim::Scenario;
use north::commands::instrument::OrderName;
use north::failure::Failure;
use north_finder::effects::ErrorModel;
use north_finder::sequence::Command;
use north_finder::settings::{AccelerometerCalibration, Settings};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One instrument with its faults.
#[derive(Clone, Debug)]
pub struct Trial {
    pub kinds: Vec<&'static Kind>,
    pub order: &'static str,
    pub scenario: Scenario,
    /// What is stored before power-up; `None`: nothing.
    pub settings: Option<Settings>,
    /// Bits of the flash that are inverted before power-up.
    pub flipped_bits: Vec<usize>,
    /// What is done to it, in the order of time.
    pub acts: Vec<(f64, Act)>,
    seed: u64,
}

/// What is done to an instrument at work.
#[derive(Clone, Debug)]
pub enum Act {
    Command(Command),
    /// New settings over the link.
    Store(Box<Settings>),
    /// The same, and the power fails after so many bytes of the flash are written.
    StoreAndFail(Box<Settings>, usize),
    /// Power off and on.
    PowerCut,
}

/// The longest that a fix may take, s.
const TIME_LIMIT_S: f64 = 400.0;
/// Time in which the faults of a window begin, s: a short fix has ended by then.
const BUSY_S: f64 = 110.0;

/// An instrument knows where its index stands after two whole seconds, s.
const LEARNING_S: f64 = 3.0;

impl Trial {
    /// Draws trial number `number`: a place, an order, one to three kinds of faults.
    pub fn draw(seed: u64, number: u64) -> Result<Self, Failure> {
        Self::draw_without(seed, number, &[])
    }

    /// The twin of that trial without those of its faults that no single fix can see; everything else is drawn as in the trial.
    pub fn draw_seeable(seed: u64, number: u64) -> Result<Self, Failure> {
        let left_out: Vec<&'static Kind> = Self::draw(seed, number)?.unseeable().collect();
        Self::draw_without(seed, number, &left_out)
    }

    fn draw_without(seed: u64, number: u64, left_out: &[&'static Kind]) -> Result<Self, Failure> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number);
        let mut scenario = Scenario::named("calm-bench")?;
        scenario.site.latitude_deg = random.random_range(-85.0..85.0);
        scenario.site.azimuth_deg = random.random_range(0.0..360.0);
        scenario.duration_limit_s = 2.0 * TIME_LIMIT_S;
        let orders = OrderName::value_variants();
        let order = orders[random.random_range(0..orders.len())];
        let mut settings = Settings {
            latitude_deg: scenario.site.latitude_deg,
            time_limit_s: TIME_LIMIT_S,
            // Gyro and accelerometers are calibrated: what lacks that is flagged in every fix.
            model: Some(ErrorModel::default()),
            accelerometer: Some(AccelerometerCalibration::UNIT),
            ..Settings::default()
        };
        settings.sequence.order = order.into();
        settings.sequence.dwell_s = random.random_range(8..=16);
        settings.level.timeout_s = 40.0;
        let mut trial = Self {
            kinds: Vec::new(),
            order: order.name(),
            scenario,
            settings: Some(settings),
            flipped_bits: Vec::new(),
            acts: Vec::new(),
            seed: random.random(),
        };
        trial.inject(&mut random, left_out);
        trial.acts.sort_by(|(first_s, _), (second_s, _)| first_s.total_cmp(second_s));
        Ok(trial)
    }

    /// One to three kinds of faults. What is left out is drawn all the same, so that the random stream goes on as with it.
    fn inject(&mut self, random: &mut ChaCha8Rng, left_out: &[&'static Kind]) {
        let count = random.random_range(1..=3);
        let mut drawn: Vec<&'static Kind> = Vec::new();
        while drawn.len() < count {
            let kind = &kind::KINDS[random.random_range(0..kind::KINDS.len())];
            if drawn.contains(&kind) {
                continue;
            }
            drawn.push(kind);
            if left_out.contains(&kind) {
                (kind.inject)(random, &mut self.clone());
            } else {
                self.kinds.push(kind);
                (kind.inject)(random, self);
            }
        }
    }

    /// Runs it, in this process or, where there is an image of the firmware, in QEMU; a panic is an ending like others.
    pub fn run(&self, image: Option<&Path>) -> Result<Outcome, Failure> {
        catch_unwind(AssertUnwindSafe(|| session::run(self, image))).unwrap_or(Ok(Outcome::PANIC))
    }

    /// When the instrument started anew for the last time: power came back, or settings were stored.
    fn last_start_s(&self) -> f64 {
        let starts = self.acts.iter().filter(|(_, act)| match act {
            Act::PowerCut | Act::StoreAndFail(..) => true,
            Act::Store(settings) => settings.validate().is_ok(),
            Act::Command(_) => false,
        });
        starts.map(|(at_s, _)| *at_s).fold(0.0, f64::max)
    }

    /// Those of its faults of which docs/method.md says that no single fix sees them in this order.
    pub fn unseeable(&self) -> impl Iterator<Item = &'static Kind> {
        self.kinds.iter().copied().filter(move |kind| match kind.blind {
            kind::Blind::No => false,
            kind::Blind::Always => true,
            kind::Blind::BeforePower => self.scenario.encoder.slip_at_s < self.last_start_s() + LEARNING_S,
            kind::Blind::InPlainOrder => matches!(self.order, "plain" | "source"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two hundred trials every twin keeps the faults that a fix can see, with the same numbers, and has no other.
    #[test]
    fn a_twin_differs_by_what_cannot_be_seen_alone() {
        let mut differ = 0;
        for number in 0..200 {
            let (trial, twin) = (Trial::draw(1, number).unwrap(), Trial::draw_seeable(1, number).unwrap());
            let left_out: Vec<&Kind> = trial.unseeable().collect();
            let kept: Vec<&Kind> = trial.kinds.iter().copied().filter(|kind| !left_out.contains(kind)).collect();
            assert_eq!((&twin.kinds, twin.order, twin.seed), (&kept, trial.order, trial.seed), "{number}");
            assert_eq!(twin.unseeable().count(), 0, "{number}");
            assert_eq!(twin.flipped_bits, trial.flipped_bits, "{number}");
            assert_eq!(twin.scenario.base.shocks, trial.scenario.base.shocks, "{number}");
            assert_eq!(twin.scenario.gyro.faults, trial.scenario.gyro.faults, "{number}");
            differ += usize::from(!left_out.is_empty());
        }
        assert!((20..180).contains(&differ), "{differ}");
    }
}
