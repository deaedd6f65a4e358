//! The two gates: is the base still before the first move, and has the gyro come to rest after a move?

use serde::{Deserialize, Serialize};

/// The disturbance gate and the jitter gate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GateSettings {
    /// °/h: for the disturbance gate the excess of |rate| over Ω cos φ, for the jitter gate the change of the rate from
    /// second to second, seen or possible.
    pub threshold_deg_h: f64,
    /// Seconds in a row that make a verdict.
    pub seconds: u16,
    /// Longest wait, seconds.
    pub timeout_s: f64,
}

impl GateSettings {
    /// The disturbance gate's defaults.
    pub const DISTURBANCE: Self = Self { threshold_deg_h: 2.0, seconds: 3, timeout_s: 120.0 };
    /// The jitter gate's defaults.
    pub const JITTER: Self = Self { threshold_deg_h: 3.0, seconds: 5, timeout_s: 90.0 };
}

/// Change of the rate from one second to the next, °/h rms, by the root mean square of an oscillating angle, arcsec, whose period does
/// not divide the second: θ(2) − 2θ(1) + θ(0) of three independent angles, √(1 + 4 + 1).
const CHANGE_BY_RIPPLE: f64 = 2.449489742783178;

/// What a second made a fix wait for, or doubt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Gate {
    Disturbance,
    Jitter,
    /// No wait: the index does not stand where it was left, or did not go where the motor's steps took it.
    Index,
}

/// What a gate says after a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Neither count is complete: keep watching.
    Watching,
    /// Quiet for the set number of seconds in a row.
    Passed,
    /// Above the threshold for the set number of seconds in a row; the count starts again.
    Refused,
}

/// Counts seconds in a row above and below a threshold. A mixed second completes neither count.
#[derive(Clone, Debug)]
struct Runs {
    settings: GateSettings,
    above: u16,
    below: u16,
}

impl Runs {
    fn new(settings: GateSettings) -> Self {
        Self { settings, above: 0, below: 0 }
    }

    fn push(&mut self, above: bool) -> Verdict {
        if above {
            self.above = self.above.saturating_add(1);
            self.below = 0;
        } else {
            self.below = self.below.saturating_add(1);
            self.above = 0;
        }
        if self.below >= self.settings.seconds {
            Verdict::Passed
        } else if self.above >= self.settings.seconds {
            self.above = 0;
            Verdict::Refused
        } else {
            Verdict::Watching
        }
    }
}

/// Disturbance gate: w0 = |ωg| − Ω cos φ, the signed excess over what a still gyro can read.
#[derive(Clone, Debug)]
pub struct DisturbanceGate {
    runs: Runs,
    north_deg_h: f64,
}

impl DisturbanceGate {
    /// `north_deg_h` is Ω cos φ.
    pub fn new(settings: GateSettings, north_deg_h: f64) -> Self {
        Self { runs: Runs::new(settings), north_deg_h }
    }

    /// Takes a second's rate, °/h; gives w0 in °/h and the verdict.
    pub fn push(&mut self, rate_deg_h: f64) -> (f64, Verdict) {
        let excess_deg_h = rate_deg_h.abs() - self.north_deg_h;
        // Written so that a rate that is not a number counts as disturbed.
        let still = excess_deg_h <= self.runs.settings.threshold_deg_h;
        (excess_deg_h, self.runs.push(!still))
    }

    /// Takes a second with or without a usable rate.
    pub fn second(&mut self, rate_deg_h: Option<f64>) -> (f64, Verdict) {
        if let Some(rate_deg_h) = rate_deg_h {
            return self.push(rate_deg_h);
        }
        self.interrupt();
        (0.0, Verdict::Watching)
    }

    /// The last second was below the threshold.
    pub fn is_quiet(&self) -> bool {
        self.runs.below > 0
    }

    /// A second without a usable rate: neither count may run on across it.
    pub fn interrupt(&mut self) {
        self.runs = Runs::new(self.runs.settings);
    }
}

/// Jitter gate: wp = ω(p+1) − ω(p) of successive seconds, with its sign, and beside it what oscillates within the second.
///
/// (With the difference of moduli a spindle that rings about a rate near nothing reads +R, −R, +R and passes.) A ringing whose period
/// divides the second makes no difference between seconds; the path of the angle within the second shows it.
#[derive(Clone, Debug)]
pub struct JitterGate {
    runs: Runs,
    last_deg_h: Option<f64>,
}

impl JitterGate {
    pub fn new(settings: GateSettings) -> Self {
        Self { runs: Runs::new(settings), last_deg_h: None }
    }

    /// Takes a second's rate, °/h, and the root mean square distance of its angle from a straight line, arcsec; gives the greater of wp
    /// and what a ringing of this size can make of it, °/h, and the verdict. The first second has no wp: 0, watching.
    pub fn push(&mut self, rate_deg_h: f64, ripple_arcsec: f64) -> (f64, Verdict) {
        let Some(last_deg_h) = self.last_deg_h.replace(rate_deg_h) else {
            return (0.0, Verdict::Watching);
        };
        let seen_deg_h = rate_deg_h - last_deg_h;
        let hidden_deg_h = CHANGE_BY_RIPPLE * ripple_arcsec;
        let change_deg_h = if hidden_deg_h > seen_deg_h.abs() { hidden_deg_h } else { seen_deg_h };
        let still = change_deg_h.abs() < self.runs.settings.threshold_deg_h;
        (change_deg_h, self.runs.push(!still))
    }

    /// Takes a second with or without a usable rate, and its ripple.
    pub fn second(&mut self, rate_deg_h: Option<f64>, ripple_arcsec: f64) -> (f64, Verdict) {
        if let Some(rate_deg_h) = rate_deg_h {
            return self.push(rate_deg_h, ripple_arcsec);
        }
        self.interrupt();
        (0.0, Verdict::Watching)
    }

    /// The last second was quiet, and so like the one before.
    pub fn is_quiet(&self) -> bool {
        self.runs.below > 0
    }

    /// The last second was not: it is no first one, of which nothing is known.
    pub fn is_ringing(&self) -> bool {
        self.runs.above > 0
    }

    /// A second without a usable rate: neither count may run on across it.
    pub fn interrupt(&mut self) {
        *self = Self::new(self.runs.settings);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Verdict::{Passed, Refused, Watching};

    const DISTURBANCE: GateSettings = GateSettings::DISTURBANCE;
    const JITTER: GateSettings = GateSettings::JITTER;

    fn disturbance(rates: &[f64]) -> heapless::Vec<Verdict, 16> {
        let mut gate = DisturbanceGate::new(DISTURBANCE, 12.0);
        rates.iter().map(|&rate| gate.push(rate).1).collect()
    }

    fn jitter(rates: &[f64]) -> heapless::Vec<Verdict, 16> {
        let mut gate = JitterGate::new(JITTER);
        rates.iter().map(|&rate| gate.push(rate, 0.0).1).collect()
    }

    #[test]
    fn three_still_seconds_pass() {
        assert_eq!(disturbance(&[12.0, -12.0, 3.0]), [Watching, Watching, Passed]);
    }

    #[test]
    fn the_excess_is_signed() {
        // A gyro pointing east reads about nothing: far below Ω cos φ, and that is no disturbance.
        let mut gate = DisturbanceGate::new(DISTURBANCE, 12.0);
        assert_eq!(gate.push(0.5), (-11.5, Watching));
        assert_eq!(gate.push(-15.0), (3.0, Watching));
    }

    #[test]
    fn three_disturbed_seconds_refuse_and_the_count_begins_again() {
        assert_eq!(
            disturbance(&[20.0, -20.0, 20.0, 20.0, 20.0, 20.0, 1.0, 1.0, 1.0]),
            [Watching, Watching, Refused, Watching, Watching, Refused, Watching, Watching, Passed]
        );
    }

    #[test]
    fn mixed_seconds_complete_neither_count() {
        assert_eq!(disturbance(&[20.0, 20.0, 1.0, 1.0, 20.0, 20.0, 1.0]), [Watching; 7]);
    }

    #[test]
    fn not_a_number_is_disturbed() {
        assert_eq!(disturbance(&[f64::NAN; 3]), [Watching, Watching, Refused]);
        assert_eq!(jitter(&[f64::NAN; 6])[5], Refused);
    }

    #[test]
    fn five_quiet_changes_pass_the_jitter_gate() {
        assert_eq!(
            jitter(&[10.0, 11.0, 10.0, 12.0, 10.0, 11.0]),
            [Watching, Watching, Watching, Watching, Watching, Passed]
        );
    }

    #[test]
    fn five_large_changes_are_jitter() {
        assert_eq!(
            jitter(&[0.0, 5.0, 0.0, 5.0, 0.0, 5.0]),
            [Watching, Watching, Watching, Watching, Watching, Refused]
        );
    }

    /// A ringing spindle with the axis east: the rate is near nothing, and its modulus does not change.
    #[test]
    fn a_change_of_sign_is_a_change() {
        assert_eq!(jitter(&[2.0, -2.0, 2.0, -2.0, 2.0, -2.0])[5], Refused);
    }

    /// 1.3 arcsec rms are worth a change of 3.18 °/h, 1.1 arcsec of 2.69 °/h.
    #[test]
    fn a_ringing_whose_period_divides_the_second_is_jitter() {
        for (ripple_arcsec, verdict) in [(1.3, Refused), (1.1, Passed)] {
            let mut gate = JitterGate::new(JITTER);
            let last = (0..6).map(|_| gate.push(10.0, ripple_arcsec).1).last();
            assert_eq!(last, Some(verdict), "{ripple_arcsec}");
        }
    }

    #[test]
    fn an_interrupted_count_begins_again() {
        let mut gate = JitterGate::new(JITTER);
        (0..5).for_each(|_| assert_eq!(gate.push(1.0, 0.0).1, Watching));
        gate.interrupt();
        (0..5).for_each(|_| assert_eq!(gate.push(1.0, 0.0).1, Watching));
        assert_eq!(gate.push(1.0, 0.0).1, Passed);
    }
}
