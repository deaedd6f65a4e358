//! An instrument in service: the log of its fixes, and whether its error model still holds.

pub mod change;
pub mod flash;
pub mod level;
pub mod log;
pub mod record;
pub mod watch;

use crate::fix::Fix;
use crate::health::{Flag, Signal};
use record::{Context, Logged, Record};
use watch::Watch;

/// What a board makes of the numbers of its fixes.
#[derive(Clone, Debug, Default)]
pub struct Service {
    watch: Watch,
    /// The error model of the fixes that are watched.
    model: u32,
    /// There was a switch-on since the last fix.
    switched: bool,
    /// The last fix, for a check that follows it; whether one did.
    last: Option<Logged>,
    checked: bool,
}

impl Service {
    /// Takes a record of the log. The watch begins anew with the fixes of another error model.
    pub fn replay(&mut self, record: &Record, model: u32) {
        match record {
            Record::Context(Context { model: theirs, .. }) => self.follow(*theirs),
            Record::Fix(logged) if self.model == model => {
                self.watch.next(&logged.values(), logged.first);
                (self.last, self.checked) = (Some(*logged), false);
            }
            Record::Fix(_) | Record::Crash(_) | Record::More(_) => {}
            Record::Check(surveyed_deg) => self.check(*surveyed_deg),
        }
    }

    /// The log is read; what comes is of this error model.
    pub fn switched_on(&mut self, model: u32) {
        self.follow(model);
        self.switched = true;
    }

    fn follow(&mut self, model: u32) {
        if self.model != model {
            self.watch.restart();
            (self.model, self.switched, self.last) = (model, false, None);
        }
    }

    /// Takes a fix, and marks it where the error model may no longer hold. Gives the signal that moved, and the statistic.
    pub fn fixed(&mut self, fix: &mut Fix) -> Option<(Signal, f32)> {
        let logged = Logged::of(fix);
        self.watch.next(&logged.values(), core::mem::take(&mut self.switched));
        (self.last, self.checked) = (Some(logged), false);
        let signal = self.watch.aged()?;
        fix.flags.insert(Flag::ModelAged);
        Some((signal, self.watch.statistic().unwrap_or_default() as f32))
    }

    /// There is a fix with this error model, whose azimuth may be checked.
    pub fn has_fix(&self) -> bool {
        self.last.is_some()
    }

    /// The last fix was made at a surveyed azimuth. Said again of the same fix, as by a host that missed the answer, it is not counted again.
    pub fn check(&mut self, surveyed_deg: f64) {
        let Some(Logged { azimuth_deg, sigma_deg, .. }) = self.last.filter(|_| !self.checked) else { return };
        self.watch.check(azimuth_deg, sigma_deg.into(), surveyed_deg);
        self.checked = true;
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::health::Flags;

    /// Made of nothing but its numbers: without a generator, fractions of multiples of square roots, whose sum of three is nearly normal with variance 1/4.
    fn fix(number: u32) -> Fix {
        let noise = |at: f64| {
            [2.0_f64, 3.0, 5.0]
                .into_iter()
                .map(|root| (at + f64::from(number) * root.sqrt()).fract() - 0.5)
                .sum::<f64>()
        };
        Fix {
            azimuth_deg: 40.0,
            sigma_deg: 0.04,
            closure_deg_h: None,
            closure_sigma_deg_h: None,
            chi_square: 7.0 + 3.0 * noise(0.4),
            degrees_of_freedom: 7,
            bias_deg_h: 0.3 + 0.02 * noise(0.1),
            amplitude_deg_h: 12.3 + 0.01 * noise(0.7),
            drift_deg_h_per_h: 0.0,
            tilt: None,
            seconds: 240.0,
            flags: Flags::default(),
        }
    }

    fn context(model: u32) -> Record {
        Record::Context(Context { model, ..Context::default() })
    }

    #[test]
    fn what_is_watched_live_is_watched_again_after_a_switch_on() {
        let (mut live, mut again) = (Service::default(), Service::default());
        live.switched_on(7);
        again.replay(&context(7), 7);
        for number in 1..140 {
            let mut fix = fix(number);
            let first = number % 5 == 1;
            if first {
                live.switched_on(7);
            }
            assert_eq!(live.fixed(&mut fix), None);
            again.replay(&Record::Fix(Logged { first, ..Logged::of(&fix) }), 7);
            if number == 120 {
                // The second time it is the same one.
                live.check(40.01);
                live.check(40.01);
                again.replay(&Record::Check(40.01), 7);
            }
        }
        again.switched_on(7);
        assert!(live.watch.statistics().iter().all(|&statistic| statistic > 0.0));
        assert_eq!(live.watch.statistics(), again.watch.statistics());
        // Another error model begins anew.
        again.switched_on(8);
        assert_eq!((again.watch.statistic(), again.has_fix()), (None, false));
    }

    #[test]
    fn a_bias_that_moved_marks_every_fix_until_the_model_is_another() {
        let mut service = Service::default();
        service.switched_on(7);
        let told = (1..160).map(|number| {
            let mut fix = fix(number);
            if number > 120 {
                fix.bias_deg_h += 0.05;
            }
            let told = service.fixed(&mut fix);
            assert_eq!(told.is_some(), fix.flags.contains(Flag::ModelAged));
            told
        });
        let told: std::vec::Vec<_> = told.collect();
        let first = told.iter().position(Option::is_some).unwrap();
        assert!((120..130).contains(&first), "{first}");
        assert!(told[first..].iter().all(|told| told.is_some_and(|(signal, _)| signal == Signal::Bias)));
        service.switched_on(8);
        assert_eq!(service.fixed(&mut fix(161)), None);
    }
}
