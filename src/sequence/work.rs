//! The work on a second, in one piece that can be handed over: a board gives it to a task of low priority, an engine on a host does it
//! at once.
//!
//! It owns the sequencer, with the accumulator in it, and a copy of the second; so it needs nothing else while it is under way, and
//! whatever comes meanwhile waits for it to be handed back.

use heapless::Vec;

use super::{Observed, Sequencer};
use crate::event::Event;
use crate::event::service::Service;
use crate::fix::accumulator::Second;
use crate::sensing::index::{IndexAngle, MotorCommand};

/// Most events of a second: two of a slip, and then what follows a dwell's end: coarse azimuth, time to go, move and state; or fix, state and what the watch says.
const MOST_EVENTS: usize = 6;

/// The sequencer, the second that it works on, and what came of that.
pub struct SecondWork {
    pub sequencer: Sequencer,
    second: Second,
    /// At the end of the second, and when that was by the instrument's clock.
    index: IndexAngle,
    t_s: f64,
    outcome: Outcome,
    /// What becomes of the numbers of fixes.
    pub service: Service,
}

/// What a second led to.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub observed: Observed,
    pub motor: Option<MotorCommand>,
    /// In their order.
    pub events: Vec<Event, MOST_EVENTS>,
}

impl SecondWork {
    /// With a sequencer that is of no use before it is set up.
    // Inlined, so that it is made where it is kept, and not copied there over the stack.
    #[inline(always)]
    pub fn empty() -> Self {
        Self {
            sequencer: Sequencer::empty(),
            second: Second::default(),
            index: IndexAngle::default(),
            t_s: 0.0,
            outcome: Outcome::default(),
            service: Service::default(),
        }
    }

    /// Takes the next second, with the index angle at its end and the instrument's time then, s.
    pub fn begin(&mut self, second: &Second, index: IndexAngle, t_s: f64) {
        (self.second, self.index, self.t_s) = (*second, index, t_s);
    }

    /// Does the work.
    pub fn run(&mut self) {
        let corrected = self.sequencer.correct(&self.second, self.index, self.t_s);
        let events = &mut self.outcome.events;
        events.clear();
        // There are no more of them than places.
        let mut sink = |event| {
            let _ = events.push(event);
        };
        (self.outcome.observed, self.outcome.motor) = self.sequencer.second(&corrected, &mut sink);
        let aged = events
            .iter_mut()
            .find_map(|event| if let Event::Fix(fix) = event { self.service.fixed(fix) } else { None });
        if let Some((signal, statistic)) = aged {
            let _ = events.push(Event::ModelAged { signal, statistic });
        }
    }

    /// What came of the last second.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }
}
