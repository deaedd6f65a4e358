//! The instrument with the work on its seconds, done at once or some ticks later.

use hal_sim::Flash;
use north_finder::drivers::intake::Intake;
use north_finder::event::Report;
use north_finder::event::identity::Identity;
use north_finder::instrument::workspace::Workspace;
use north_finder::instrument::{Instrument, Orders, Readings};
use north_finder::sequence::work::{Outcome, SecondWork};

/// The instrument, and the second that is being worked on.
pub struct Stepper {
    pub instrument: Box<Instrument<Box<SecondWork>, Box<Workspace>>>,
    /// Ticks that the work on a second takes, by what came of it.
    pub work_ticks: fn(&Outcome) -> u64,
    /// What is worked on, and the tick at which it is done.
    under_way: Option<(Box<SecondWork>, u64)>,
}

impl Stepper {
    /// Powered up, with what the flash holds.
    pub fn power_up(flash: &mut Flash) -> Self {
        let work = Box::new(SecondWork::empty());
        let instrument = Instrument::power_up(flash, Identity::host(), work, Box::default());
        Self { instrument: Box::new(instrument), work_ticks: |_| 0, under_way: None }
    }

    /// A tick, and the work that is done by its end.
    pub fn step(
        &mut self,
        readings: &Readings,
        intake: &Intake,
        flash: &mut Flash,
        report: &mut dyn FnMut(Report),
    ) -> Orders {
        let orders = self.instrument.step(readings, intake, flash, report);
        if let Some(mut work) = self.instrument.second_to_work_on() {
            work.run();
            let done = readings.tick + (self.work_ticks)(work.outcome());
            self.under_way = Some((work, done));
        }
        if let Some((work, _)) = self.under_way.take_if(|(_, done)| *done <= readings.tick) {
            self.instrument.worked_on(work);
        }
        orders
    }
}
