//! The end of a second. The work on it, up to the azimuth, is handed over; what it led to takes effect a fixed time later.
//!
//! So the work may take any time: on a chip several ticks, in a process none. As long as it is done in [`EFFECT_TICKS`], its duration
//! changes nothing, bit for bit. If it takes longer, what it led to takes effect when it is done; seconds that end meanwhile wait in their
//! order, and everything is reported as of the tick at which its second ended.

use core::ops::DerefMut;

use embedded_storage::nor_flash::NorFlash;

use super::gather::Gathered;
use super::workspace::Workspace;
use super::{Instrument, Streaming};
use crate::event::raw::Stream;
use crate::event::service::flash::LogFlash;
use crate::event::service::record::{Logged, More};
use crate::event::{self, Dwell, Event, Fix, State};
use crate::health::Fault;
use crate::sensing::index::{IndexAngle, MotorCommand};
use crate::sensing::level::LevelMoments;
use crate::sensing::sample::{RateSecond, SAMPLE_S};
use crate::sequence::Observed;
use crate::sequence::work::{Outcome, SecondWork};

/// From the end of a second to the effect of what it led to: 0.1 s, in which a chip of 168 MHz does 16.8 million instructions.
pub const EFFECT_TICKS: u64 = 40;
/// Seconds that can wait.
pub(super) const MOST_WAITING: usize = 4;
/// Seconds between two reports of the counters, if they changed.
const HEALTH_SECONDS: u32 = 10;

/// A second that ended, and waits for the work on it, or for its effect.
#[derive(Clone, Debug)]
pub(super) struct Ended {
    tick: u64,
    gathered: Gathered,
    /// What the gyro's stream showed at its end.
    fault: Option<Fault>,
    index: IndexAngle,
}

/// Scatter of the seconds of a fix, from its dwells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Scatter {
    /// Of the seconds' squares, (°/h)², and their number.
    sum: f64,
    seconds: f64,
}

impl Scatter {
    /// The variance of a second is that of the mean times their number; a dwell of two seconds has none.
    pub(super) fn hear(&mut self, event: &Event) {
        if let &Event::Dwell(Dwell { seconds, sigma_deg_h, .. }) = event
            && sigma_deg_h.is_finite()
        {
            self.sum += seconds * seconds * sigma_deg_h * sigma_deg_h;
            self.seconds += seconds;
        }
    }

    /// 0 where there was no dwell.
    pub(super) fn rms_deg_h(&self) -> f64 {
        libm::sqrt(self.sum / self.seconds.max(1.0))
    }
}

impl<S: DerefMut<Target = SecondWork>, R: DerefMut<Target = Workspace>> Instrument<S, R> {
    /// Hands the sequencer over with the next second to be worked on, if there is one: whoever takes it calls [`SecondWork::run`] and
    /// gives it back by [`Self::worked_on`]. To be asked after every [`Self::step`].
    pub fn second_to_work_on(&mut self) -> Option<S> {
        if self.working || self.refusal.is_some() {
            return None;
        }
        let ended = self.ended.front()?;
        let mut work = self.work.take()?;
        self.working = true;
        self.state = work.sequencer.state();
        work.begin(&ended.gathered.directed(), ended.index, ended.tick as f64 * SAMPLE_S);
        Some(work)
    }

    /// The work on a second is handed over and not yet back.
    pub fn is_worked_on(&self) -> bool {
        self.work.is_none()
    }

    /// Takes the sequencer back when the work is done.
    pub fn worked_on(&mut self, work: S) {
        self.work = Some(work);
    }

    /// The sequencer, unless a second is being worked on.
    pub(super) fn idle_work(&mut self) -> Option<&mut SecondWork> {
        if self.working { None } else { self.work.as_deref_mut() }
    }

    pub(super) fn keep(&mut self, second: Option<RateSecond>) {
        if let Some(second) = second {
            // Five seconds between two ticks cannot be: a second has 400 frames, and no more than three are made up for.
            let _ = self.finished.push_back(second);
        }
    }

    pub(super) fn end_seconds(&mut self, sink: &mut dyn FnMut(Event)) {
        self.end_block(sink);
        while let Some(rate) = self.finished.pop_front() {
            self.end_second(&rate);
            if matches!(self.streaming, Streaming::Requested) && self.gatherer.sampler().slots() == 0 {
                self.streaming = Streaming::On(Stream::default());
            }
        }
    }

    fn end_second(&mut self, rate: &RateSecond) {
        let counters = &mut self.counters;
        if !rate.usable {
            counters.seconds_left_out = counters.seconds_left_out.saturating_add(1);
        } else if rate.missing > 0 {
            counters.seconds_repaired = counters.seconds_repaired.saturating_add(1);
        }
        let fault = self.watch.second(rate, self.gatherer.sampler().behind());
        let mut gathered = self.gatherer.finish(rate, self.tick as f64 * SAMPLE_S);
        let stands = matches!(self.state(), State::Watching | State::Settling | State::Collecting);
        let level = gathered.second.conditions.level.filter(|_| stands && rate.usable);
        let contradicts = self.contradiction.second(rate.fog_arcsec, self.bias_limit_deg_h, level);
        let fault = fault.or(contradicts.then_some(Fault::GyroUnits));
        if let (Some(block_temp_c), Some(place)) = (gathered.block_temp_c, self.block_temperature)
            && let Some(channel) = gathered.second.conditions.channels.get_mut(place)
        {
            *channel = block_temp_c;
        }
        gathered.auxiliary = self.analogue.finish();
        self.analogue.into_channels(&gathered.auxiliary, &mut gathered.second.conditions.channels);
        // Work that lags by several seconds loses the next ones, and counts them.
        if self.ended.push_back(Ended { tick: self.tick, gathered, fault, index: self.index }).is_err() {
            self.counters.seconds_left_out = self.counters.seconds_left_out.saturating_add(1);
        }
    }

    /// Reports a second and what the work on it led to, when it is time and the work is done. Gives the motor's command.
    pub(super) fn take_effect(
        &mut self,
        flash: &mut impl NorFlash,
        sink: &mut dyn FnMut(f64, Event),
    ) -> Option<MotorCommand> {
        let ended = self.ended.front()?;
        let t_s = ended.tick as f64 * SAMPLE_S;
        if self.tick < ended.tick + EFFECT_TICKS {
            return None;
        }
        let outcome = if self.refusal.is_some() {
            // Without settings there is nothing to be done.
            let rate_deg_h = ended.gathered.second.conditions.raw_rate_deg_h;
            Outcome { observed: Observed { rate_deg_h, ..Observed::default() }, ..Outcome::default() }
        } else {
            self.work.as_ref().filter(|_| self.working)?.outcome().clone()
        };
        self.working = false;
        let Ended { gathered, fault, .. } = self.ended.pop_front()?;
        let sink: &mut dyn FnMut(Event) = &mut |event| sink(t_s, event);
        self.report_second(&gathered, &outcome.observed, sink);
        for &event in &outcome.events {
            self.scatter.hear(&event);
            if let Event::Fix(fix) = &event {
                // Before the fix, what is to be held against it.
                sink(Event::Health(self.counters));
                if let Some(keeper) = &mut self.keeper {
                    keeper.fixed(fix);
                }
            }
            // The azimuth is told before the flash may stand still.
            sink(event);
            if let Event::Fix(fix) = &event {
                self.log_fix(flash, fix, t_s, &gathered);
            }
        }
        self.finish_second(fault, t_s, sink).or(outcome.motor)
    }

    /// Into the log. The flash stands still for less than a millisecond; where a sector is full and was not made ready at the start, for a second.
    #[inline(never)]
    fn log_fix(&mut self, flash: &mut impl NorFlash, fix: &Fix, t_s: f64, gathered: &Gathered) {
        let utc_s = self.clock_utc_s.map(|start_s| (start_s + t_s) as u32);
        let single = |temp_c: Option<f64>| temp_c.map(|temp_c| temp_c as f32);
        let temp_c = single(gathered.second.conditions.temp_c);
        let [first, second, third, fourth, supply_v, chip_temp_c] = gathered.auxiliary;
        let scatter_deg_h = self.scatter.rms_deg_h() as f32;
        let t_s = t_s as u32;
        let logged = Logged { t_s, utc_s, scatter_deg_h, temp_c, supply_v, chip_temp_c, ..Logged::of(fix) };
        let more = More { block_temp_c: single(gathered.block_temp_c), inputs: [first, second, third, fourth] };
        let flash = &mut LogFlash(flash);
        let pushed = self.log.push(flash, &logged, self.identity.program, self.model);
        self.last_logged = pushed.is_ok();
        if pushed.and_then(|()| self.log.more(flash, &more)).is_err() {
            self.counters.fixes_not_logged = self.counters.fixes_not_logged.saturating_add(1);
        }
    }

    /// The second is reported before what it led to: a recording that ends with the azimuth holds all of its seconds.
    fn report_second(&mut self, gathered: &Gathered, observed: &Observed, sink: &mut dyn FnMut(Event)) {
        let Gathered { second, index_deg, block_temp_c, auxiliary } = gathered;
        self.counters.seconds_outlying = self.counters.seconds_outlying.saturating_add(observed.outliers.into());
        let conditions = &second.conditions;
        sink(Event::Second(event::Second {
            t_s: second.end_s(),
            index_deg: *index_deg,
            fog_arcsec: conditions.raw_rate_deg_h,
            moment_arcsec_s: second.moment_arcsec_s,
            rate_deg_h: observed.rate_deg_h,
            temp_c: conditions.temp_c,
            block_temp_c: *block_temp_c,
            auxiliary: *auxiliary,
            level: conditions.level.map(|mean| LevelMoments { mean, first: second.level_moment }),
            level_temp_c: second.level_temp_c,
            lost_frames: second.lost_frames,
            dwell: observed.dwell,
            collected: observed.collected,
            waited_at: observed.waited_at,
        }));
    }

    /// What the gyro's stream showed at the second's end, and what was requested of the sequencer meanwhile.
    fn finish_second(&mut self, fault: Option<Fault>, t_s: f64, sink: &mut dyn FnMut(Event)) -> Option<MotorCommand> {
        let fault = fault.filter(|_| self.refusal.is_none());
        let mut motor = None;
        for fault in fault.into_iter().chain(self.fault.take()) {
            motor = self.fail(fault, t_s, sink).or(motor);
        }
        if let Some(command) = self.requested.take() {
            motor = self.command(command, t_s, sink).or(motor);
        }
        self.seconds = self.seconds.wrapping_add(1);
        if self.seconds.is_multiple_of(HEALTH_SECONDS) && self.reported != self.counters {
            self.reported = self.counters;
            sink(Event::Health(self.counters));
        }
        motor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of 4 s with 0.1 and of 9 s with 0.05 °/h: squares of a second 0.04 and 0.0225, by their seconds 0.3625/13.
    #[test]
    fn the_scatter_is_that_of_the_dwells_that_show_one() {
        let mut scatter = Scatter::default();
        for (seconds, sigma_deg_h) in [(4.0, 0.1), (2.0, f64::NAN), (9.0, 0.05)] {
            scatter.hear(&Event::Dwell(Dwell { position: 0, index_deg: 0.0, seconds, rate_deg_h: 12.0, sigma_deg_h }));
        }
        assert!((scatter.rms_deg_h() - libm::sqrt(0.3625 / 13.0)).abs() < 1e-12);
    }
}
