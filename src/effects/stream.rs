//! Effects at work, second by second, in the order of time: the one place where they are evaluated, for the firmware, for replays and for the
//! diagnosis.

use heapless::Vec;

use super::channel::{ChannelName, MAX_CHANNELS};
use super::conditions::Conditions;
use super::effect::{Effect, EffectMemory};
use super::now::{Belief, Now, RunFacts};
use super::track::Track;

/// Most effects of one model.
pub const MAX_EFFECTS: usize = 16;

/// What effects remember.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    run: RunFacts,
    track: Track,
    memories: [EffectMemory; MAX_EFFECTS],
}

impl Stream {
    pub fn new(run: RunFacts) -> Self {
        Self { run, ..Self::default() }
    }

    /// Takes the next second. Calls `each` with the number of an effect, the number of one of its weights, and the function that it multiplies.
    pub fn second(
        &mut self,
        effects: &[Effect],
        channels: &Vec<ChannelName, MAX_CHANNELS>,
        conditions: &Conditions,
        belief: Option<Belief>,
        each: &mut dyn FnMut(usize, usize, f64),
    ) {
        self.track.push(conditions);
        let now = Now { conditions, channels, track: &self.track, run: &self.run, belief };
        for (i, (effect, memory)) in effects.iter().zip(&mut self.memories).enumerate() {
            effect.functions(&now, memory, &mut |number, value| each(i, number, value));
        }
    }
}
