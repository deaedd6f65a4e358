//! The instrument with the work of its seconds, a slice of it a tick.

use std::convert::Infallible;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;

use hal_sim::Flash;
use north_finder::event::Report;
use north_finder::identity::Identity;
use north_finder::instrument::workroom::Workroom;
use north_finder::instrument::{Instrument, Orders, Readings};
use north_finder::intake::Intake;
use north_finder::sequence::Sequencer;
use north_finder::sequence::desk::Desk;

/// The instrument, and what it lends its sequencer to.
pub struct Stepper {
    pub instrument: Box<Instrument<Box<Sequencer>, Box<Workroom>>>,
    desk: Rc<Desk<Box<Sequencer>>>,
    work: Pin<Box<dyn Future<Output = Infallible>>>,
}

impl Stepper {
    /// Powered up, with what the flash holds.
    pub fn power_up(flash: &mut Flash) -> Self {
        let instrument = Instrument::power_up(flash, Identity::host(), Box::new(Sequencer::empty()), Box::default());
        let desk = Rc::new(Desk::new());
        let own = Rc::clone(&desk);
        Self { instrument: Box::new(instrument), desk, work: Box::pin(async move { own.work().await }) }
    }

    /// A tick with its slice of work, as on the board.
    pub fn step(
        &mut self,
        readings: &Readings,
        intake: &Intake,
        flash: &mut Flash,
        report: &mut dyn FnMut(Report),
    ) -> Orders {
        let orders = self.instrument.step(readings, intake, flash, report);
        let motor = self.instrument.slice(&self.desk, self.work.as_mut(), report);
        Orders { motor: motor.or(orders.motor), ..orders }
    }
}
