//! The shortest runs that bring a model back, and the model that they give.

use north_finder::effects::ErrorModel;
use serde::Serialize;

use super::{Cause, Change, Kind};
use crate::campaign::{Campaign, Role};
use crate::count::counted;
use crate::diagnose::{Options, diagnose};
use crate::failure::Failure;
use crate::run_data::{self, RunData};

/// A change is known well enough when its size is this many sigmas: a quarter of it is left at most.
const KNOWN: f64 = 4.0;
/// Fewest runs of each kind, and those around the circle where it is not the mean that counts.
const FEWEST: f64 = 2.0;
const AROUND: f64 = 8.0;
/// Runs at two temperatures are apart by this share of the range of the log at least.
const RANGE: f64 = 0.5;
/// Headings around the circle leave no gap greater than this, degrees.
const GAP_DEG: f64 = 120.0;

/// The runs that show a change best.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Needed {
    pub runs: usize,
    /// They are at surveyed headings around the circle.
    pub surveyed: bool,
    /// They are at headings around the circle.
    pub around: bool,
    /// Half of them are at each of these temperatures of the gyro, °C.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperatures_c: Option<[f64; 2]>,
}

impl Needed {
    /// By the information that a run has about the change: that of a fix, whose sigma the log says. The mean of n runs knows a step of s sigma to
    /// √n s of its own sigmas. Of a slope over a range on which it changes the signal by s sigma, the difference of n runs at each end has the variance
    /// 2/n in those of a fix, and knows it to √(n/2) s.
    pub fn new(change: &Change, temperatures_c: Option<[f64; 2]>) -> Self {
        let of_temperature = change.cause == Cause::Temperature;
        let sigmas = KNOWN / change.sigmas_of_fix.abs().max(f64::MIN_POSITIVE);
        let mean = (sigmas * sigmas).ceil().max(FEWEST);
        let runs = match change.signal {
            _ if of_temperature => 2.0 * (2.0 * sigmas * sigmas).ceil().max(FEWEST),
            Kind::Bias | Kind::Amplitude => mean,
            Kind::Misfit => AROUND,
            Kind::AzimuthError => mean.max(AROUND),
        };
        Self {
            runs: runs as usize,
            surveyed: change.signal == Kind::AzimuthError,
            around: matches!(change.signal, Kind::Misfit | Kind::AzimuthError),
            temperatures_c: temperatures_c.filter(|_| of_temperature),
        }
    }

    /// The sentence for a person.
    pub fn sentence(&self) -> String {
        let headings = match (self.surveyed, self.around) {
            (true, _) => "at surveyed headings around the circle",
            (false, true) => "at headings around the circle",
            (false, false) => "at one heading",
        };
        let temperatures = self.temperatures_c.map_or_else(String::new, |[low, high]| {
            format!(", half of them with the gyro at {low:.0} °C and half at {high:.0} °C")
        });
        format!("Record {} {headings}{temperatures}; --runs makes the model from them", counted(self.runs, "run"))
    }

    /// Why runs cannot show the change, if they cannot.
    fn lacks(&self, runs: &[&RunData]) -> Option<String> {
        if runs.len() < self.runs {
            return Some(format!("{} that may be learned from, of {} needed", counted(runs.len(), "run"), self.runs));
        }
        if self.surveyed && runs.iter().any(|run| run.reference_deg.is_none()) {
            return Some("runs without a surveyed heading: without one nothing shows an error of the azimuth".into());
        }
        let headings = || runs.iter().filter_map(|run| run.reference_deg.or(run.before.map(|fix| fix.azimuth_deg)));
        if self.around && greatest_gap_deg(headings().collect()) > GAP_DEG {
            return Some(format!("headings that leave more than {GAP_DEG:.0}° of the circle out"));
        }
        let [low, high] = self.temperatures_c?;
        let means: Vec<f64> = runs.iter().filter_map(|run| mean_temperature(run)).collect();
        let (least, most) =
            means.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |ends, at| (ends.0.min(*at), ends.1.max(*at)));
        (!(most - least >= RANGE * (high - low))).then(|| {
            format!(
                "temperatures that differ by less than {:.1} K: the change follows the temperature",
                RANGE * (high - low)
            )
        })
    }

    /// The model that runs make of an old one. What is the same in all of a run's rows (bias, scale factor) is the mean of the runs; else it is what a
    /// diagnosis of them finds.
    ///
    /// Errors: runs that cannot be read; such that cannot show the change, with the reason.
    pub fn updated(&self, change: &Change, campaign: &Campaign, options: &Options) -> Result<ErrorModel, Failure> {
        let refused = |text: String| Failure::Refused(text);
        let (runs, _) = run_data::read(campaign, &options.settings).map_err(|refusal| refused(refusal.to_string()))?;
        let fit: Vec<&RunData> = runs.iter().filter(|run| run.role == Role::Fit).collect();
        if let Some(lack) = self.lacks(&fit) {
            return Err(refused(format!("these runs cannot show what changed: {lack}")));
        }
        let mut model = options.settings.model.clone().unwrap_or_default();
        let mean = |value: &dyn Fn(&RunData) -> Option<f64>| {
            let values: Vec<f64> = fit.iter().filter_map(|run| value(run)).collect();
            values.iter().sum::<f64>() / values.len().max(1) as f64
        };
        match (change.signal, change.cause) {
            (Kind::Bias, Cause::Step | Cause::Ramp) => {
                model.bias_deg_h += mean(&|run| Some(run.before?.bias_deg_h));
            }
            (Kind::Amplitude, Cause::Step | Cause::Ramp) => {
                let excess = mean(&|run| Some(run.before?.amplitude_deg_h / run.earth.north_deg_h - 1.0));
                model.scale_error = (1.0 + model.scale_error) * (1.0 + excess) - 1.0;
            }
            _ => {
                let diagnosis = diagnose(campaign, options).map_err(|refusal| refused(refusal.to_string()))?;
                if diagnosis.effects.is_empty() {
                    return Err(refused(format!("these runs show no effect: {}", diagnosis.verdict)));
                }
                model = diagnosis.model;
            }
        }
        model.validate().map_err(|invalid| {
            refused(format!("the model that these runs give is refused: {} = {}", invalid.field, invalid.value))
        })?;
        Ok(model)
    }
}

fn mean_temperature(run: &RunData) -> Option<f64> {
    let values = run.samples.iter().map(|sample| sample.temp_c).collect::<Option<Vec<f64>>>()?;
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The greatest part of the circle between two neighbouring headings, degrees.
fn greatest_gap_deg(mut headings_deg: Vec<f64>) -> f64 {
    headings_deg.sort_by(f64::total_cmp);
    let Some((&first, &last)) = headings_deg.first().zip(headings_deg.last()) else { return 360.0 };
    let between = headings_deg.windows(2).map(|pair| pair[1] - pair[0]);
    between.fold(360.0 - (last - first), f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(signal: Kind, cause: Cause, sigmas_of_fix: f64) -> Change {
        Change {
            signal,
            unit: signal.unit(),
            from: 150,
            cause,
            size: 1.0,
            sigma: 0.1,
            sigmas_of_fix,
            instead: None,
            share: 1.0,
            passed: false,
        }
    }

    /// A step of one sigma: the mean of sixteen runs knows it to a quarter. A slope that makes one sigma over the range: sixteen at each end know both
    /// ends to a quarter, and their difference to √2 times that; thirty-two do.
    #[test]
    fn runs_by_hand() {
        let range = Some([10.0, 30.0]);
        assert_eq!(Needed::new(&change(Kind::Bias, Cause::Step, 1.0), range).runs, 16);
        let slope = Needed::new(&change(Kind::Bias, Cause::Temperature, 1.0), range);
        assert_eq!((slope.runs, slope.temperatures_c), (64, range));
        assert!(slope.sentence().contains("64 runs at one heading, half of them with the gyro at 10 °C"));
        let azimuth = Needed::new(&change(Kind::AzimuthError, Cause::Step, 8.0), range);
        assert!(azimuth.runs == 8 && azimuth.surveyed && azimuth.temperatures_c.is_none());
    }

    #[test]
    fn gaps_go_round() {
        assert_eq!(greatest_gap_deg(vec![350.0, 10.0, 190.0]), 180.0);
        assert_eq!(greatest_gap_deg(vec![0.0, 90.0, 180.0, 270.0]), 90.0);
        assert_eq!(greatest_gap_deg(Vec::new()), 360.0);
    }
}
