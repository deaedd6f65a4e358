//! Where the work on a second is handed over: the sequencer goes to it with the second, and comes back with what came of it.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::ops::DerefMut;
use core::pin::Pin;

use heapless::Deque;

use super::{Seen, Sequencer};
use crate::event::Event;
use crate::fix::accumulator::{Corrected, Second};
use crate::index::{IndexAngle, MotorCommand};
use crate::slices::{self, pause};

/// Most events of a second: two of a slip, and then what follows a dwell's end: coarse azimuth, time to go, move and state.
const MOST_EVENTS: usize = 6;

/// `S` is how the sequencer is held.
pub struct Desk<S> {
    todo: Cell<Option<(S, Second, IndexAngle)>>,
    done: Cell<Option<Done<S>>>,
    events: RefCell<Deque<Event, MOST_EVENTS>>,
}

/// The sequencer after a second, what became of it, and the motor's command.
pub type Done<S> = (S, Seen, Option<MotorCommand>);

impl<S: DerefMut<Target = Sequencer>> Desk<S> {
    #[allow(clippy::new_without_default)] // as it is for a static
    pub const fn new() -> Self {
        Self { todo: Cell::new(None), done: Cell::new(None), events: RefCell::new(Deque::new()) }
    }

    /// All work that is ever handed over; never ends.
    pub async fn work(&self) -> Infallible {
        loop {
            if let Some((mut sequencer, corrected)) = self.begun() {
                let mut sink = |event| {
                    if let Ok(mut events) = self.events.try_borrow_mut() {
                        let _ = events.push_back(event);
                    }
                };
                let (seen, motor) = sequencer.second(&corrected, &mut sink).await;
                self.done.set(Some((sequencer, seen, motor)));
            }
            pause().await;
        }
    }

    /// What is to be done. A function of its own: the second as it was handed over is not kept from slice to slice.
    fn begun(&self) -> Option<(S, Corrected)> {
        let (mut sequencer, second, index) = self.todo.take()?;
        let corrected = sequencer.correct(&second, index);
        Some((sequencer, corrected))
    }

    /// Hands a second over, with the index angle at its end.
    pub fn begin(&self, sequencer: S, second: Second, index: IndexAngle) {
        self.todo.set(Some((sequencer, second, index)));
    }

    /// One slice; gives what came of the second, if that was the last.
    pub fn slice(&self, work: Pin<&mut (impl Future<Output = Infallible> + ?Sized)>) -> Option<Done<S>> {
        let _ = slices::slice(work);
        self.done.take()
    }

    /// The next event of the second.
    pub fn next_event(&self) -> Option<Event> {
        self.events.try_borrow_mut().ok()?.pop_front()
    }
}
