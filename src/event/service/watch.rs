//! The watch over the numbers that every fix leaves: does the error model still hold, and which number moved?

use super::change::{ALARM, ChangeTest};
use super::record::Logged;
use crate::fix::statistics::chi_square_z_score;
use crate::health::Signal;
use crate::units::wrap_180_deg;

/// The signals in the order of [`Values`].
pub const SIGNALS: [Signal; 4] = [Signal::Bias, Signal::Amplitude, Signal::Misfit, Signal::AzimuthError];

/// What a fix says of each signal; `None`: nothing.
pub type Values = [Option<f64>; SIGNALS.len()];

/// The test of a signal. What an azimuth is off by has a mean and a variance without a baseline: the fix says its sigma.
pub fn test(signal: Signal) -> ChangeTest {
    match signal {
        Signal::AzimuthError => ChangeTest::known(),
        _ => ChangeTest::default(),
    }
}

/// A chi-square as a standard normal number; `None`: it has no degrees of freedom.
pub fn misfit_sigmas(chi_square: f64, freedom: f64) -> Option<f64> {
    (freedom > 0.0).then(|| chi_square_z_score(chi_square, freedom))
}

/// What an azimuth is off by at a surveyed heading, in its sigmas.
pub fn error_sigmas(azimuth_deg: f64, sigma_deg: f64, surveyed_deg: f64) -> Option<f64> {
    (sigma_deg > 0.0).then(|| wrap_180_deg(azimuth_deg - surveyed_deg) / sigma_deg)
}

impl Logged {
    pub fn values(&self) -> Values {
        let misfit = misfit_sigmas(self.chi_square.into(), self.degrees_of_freedom.into());
        [Some(self.bias_deg_h.into()), Some(self.amplitude_deg_h.into()), misfit, None]
    }
}

/// The test of a signal with its state.
#[derive(Clone, Debug, Default)]
struct Watched {
    test: ChangeTest,
    /// There was a switch-on since its last value.
    switched: bool,
    /// Once its baseline is over.
    statistic: Option<f64>,
}

impl Watched {
    #[inline(never)]
    fn of(signal: Signal) -> Self {
        Self { test: test(signal), switched: false, statistic: None }
    }
}

/// The watch.
#[derive(Clone, Debug)]
pub struct Watch {
    tests: [Watched; SIGNALS.len()],
    aged: Option<Signal>,
}

impl Default for Watch {
    fn default() -> Self {
        Self { tests: SIGNALS.map(Watched::of), aged: None }
    }
}

impl Watch {
    /// Begins anew, in its place: copies of it would take kilobytes of a board's stack.
    pub fn restart(&mut self) {
        for (watched, signal) in self.tests.iter_mut().zip(SIGNALS) {
            *watched = Watched::of(signal);
        }
        self.aged = None;
    }

    /// Takes what a fix says. `switched`: the instrument was switched on since the fix before.
    pub fn next(&mut self, values: &Values, switched: bool) {
        for (watched, value) in self.tests.iter_mut().zip(values) {
            watched.switched |= switched;
            if let Some(value) = *value {
                let statistic = watched.test.next(value, core::mem::take(&mut watched.switched));
                watched.statistic = statistic.or(watched.statistic);
            }
        }
        if self.aged.is_none() && self.statistic().is_some_and(|mean| mean >= ALARM) {
            let most = self.statistics().into_iter().zip(SIGNALS).max_by(|(a, _), (b, _)| a.total_cmp(b));
            self.aged = most.map(|(_, signal)| signal);
        }
    }

    /// The last fix was made at a surveyed heading.
    pub fn check(&mut self, azimuth_deg: f64, sigma_deg: f64, surveyed_deg: f64) {
        self.next(&[None, None, None, error_sigmas(azimuth_deg, sigma_deg, surveyed_deg)], false);
    }

    /// Of each signal, 0 where it says nothing yet.
    pub fn statistics(&self) -> [f64; SIGNALS.len()] {
        self.tests.each_ref().map(|watched| watched.statistic.unwrap_or_default())
    }

    /// The mean of those that say something.
    pub fn statistic(&self) -> Option<f64> {
        let told = self.tests.iter().filter_map(|watched| watched.statistic);
        let (sum, count) = told.fold((0.0, 0.0), |(sum, count), statistic| (sum + statistic, count + 1.0));
        (count > 0.0).then_some(sum / count)
    }

    /// The signal that had moved most when the statistic reached [`ALARM`].
    pub fn aged(&self) -> Option<Signal> {
        self.aged
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The median of chi-square with 7 degrees of freedom is 6.346, its 97.5 % point 16.013.
    #[test]
    fn a_misfit_is_a_normal_number() {
        let sigmas = |chi_square| misfit_sigmas(chi_square, 7.0).unwrap();
        assert!(sigmas(6.346).abs() < 0.01 && (sigmas(16.013) - 1.96).abs() < 0.02);
        assert_eq!(misfit_sigmas(1.0, 0.0), None);
    }

    /// 359° is 2° west of 1°: four sigmas of 0.5°.
    #[test]
    fn an_azimuth_is_off_by_the_shorter_way() {
        assert_eq!(error_sigmas(359.0, 0.5, 1.0), Some(-4.0));
    }

    /// An error of four sigmas at a pillar needs no baseline. By hand for one fix of n = 100 innovations, S = 99 + 16: a = 4, I = 1; the step, τ = 2, gives
    /// 5^(−1/2) · (1 − 64/(5 · 115))^(−50) = 0.447 · e^5.9 = 163, the ramp (a = 0.04) less than 1.1: a second one is an alarm.
    #[test]
    fn two_wrong_azimuths_at_a_pillar_are_an_alarm_of_the_azimuth() {
        let mut watch = Watch::default();
        watch.check(14.0, 1.0, 10.0);
        let first = watch.statistic().unwrap();
        assert!((80.0..84.0).contains(&first) && watch.aged().is_none(), "{first}");
        watch.check(14.0, 1.0, 10.0);
        assert_eq!(watch.aged(), Some(Signal::AzimuthError));
    }
}
