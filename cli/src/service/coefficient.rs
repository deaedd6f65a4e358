//! Which coefficient of the error model a change of a signal is, and what the coefficient is now.

use north_finder::earth::EARTH_RATE_DEG_H;
use north_finder::effects::effect::Port;
use north_finder::effects::{ErrorModel, channel};
use north_finder::units::{DEG_PER_RAD, wrap_180_deg};
use serde::Serialize;

use super::watch::BASELINE;
use super::{Cause, Change, Kind, Log};

/// Difference of two temperatures between which a model's slope is taken, K.
const STEP_K: f64 = 1.0;
/// An azimuth that differs from that of the fix before by more than this is another set-up, degrees: no change of an instrument turns it so far.
const ANOTHER_SETUP_DEG: f64 = 1.0;

/// A coefficient that moved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moved {
    /// Its name in a model file; in words where it is no single number of it.
    pub coefficient: &'static str,
    pub unit: &'static str,
    /// What the model says.
    pub before: f64,
    /// By how much it moved, and one sigma of that.
    pub by: f64,
    pub sigma: f64,
}

/// What a change of the amplitude is if the instrument was taken to another place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherPlace {
    /// Latitudes that the amplitudes say, degrees from the equator.
    pub latitude_before_deg: f64,
    pub latitude_after_deg: f64,
    /// It was set up anew with the first changed fix: switched on, and turned.
    pub set_up_anew: bool,
}

impl Moved {
    /// The coefficient that a change of a signal moves. `None` for the misfit, which says that something does not repeat from dwell to dwell, not what.
    pub fn new(change: &Change, log: &Log, model: &ErrorModel) -> Option<Self> {
        let of_temperature = change.cause == Cause::Temperature;
        let share = |value: f64| value / usual(log, |fix| fix.amplitude_deg_h);
        let moved = |coefficient, unit, before, by, sigma| Some(Self { coefficient, unit, before, by, sigma });
        let (size, sigma) = (change.size, change.sigma);
        match (change.signal, of_temperature) {
            (Kind::Bias, false) => moved("bias_deg_h", "°/h", model.bias_deg_h, size, sigma),
            (Kind::Bias, true) => {
                let slope = slope(model, Port::Rate, usual(log, |fix| fix.temp_c));
                moved("slope of the rate over temp_c", "°/h for each kelvin", slope, size, sigma)
            }
            (Kind::Amplitude, false) => moved("scale_error", "", model.scale_error, share(size), share(sigma)),
            (Kind::Amplitude, true) => {
                let slope = slope(model, Port::Scale, usual(log, |fix| fix.temp_c));
                moved("slope of the scale over temp_c", "for each kelvin", slope, share(size), share(sigma))
            }
            // An index that reads too large makes the azimuth too large.
            (Kind::AzimuthError, false) => {
                let offset_deg = model.index_error.map_or(0.0, |error| error.offset_deg);
                moved("index_error.offset_deg", "°", offset_deg, size, sigma)
            }
            (Kind::AzimuthError, true) => {
                let slope = slope(model, Port::Index, usual(log, |fix| fix.temp_c));
                moved("slope of the index over temp_c", "° for each kelvin", slope, size, sigma)
            }
            (Kind::Misfit, _) => None,
        }
    }
}

impl OtherPlace {
    /// Of a step of the amplitude Ω cos φ. `None` of anything else, and where no latitude has such an amplitude.
    pub fn new(change: &Change, log: &Log) -> Option<Self> {
        if change.signal != Kind::Amplitude || change.cause != Cause::Step {
            return None;
        }
        let before_deg_h = usual(log, |fix| fix.amplitude_deg_h);
        let latitude_deg = |amplitude_deg_h: f64| {
            let cos = amplitude_deg_h / EARTH_RATE_DEG_H;
            (0.0..=1.0).contains(&cos).then(|| cos.acos() * DEG_PER_RAD)
        };
        let [last, first] = [change.from.checked_sub(1)?, change.from].map(|at| log.fixes.get(at));
        let (last, first) = (last?, first?);
        let turned =
            last.azimuth_deg.zip(first.azimuth_deg).is_some_and(|(a, b)| wrap_180_deg(a - b).abs() > ANOTHER_SETUP_DEG);
        Some(Self {
            latitude_before_deg: latitude_deg(before_deg_h)?,
            latitude_after_deg: latitude_deg(before_deg_h + change.size)?,
            set_up_anew: turned && first.boot != last.boot,
        })
    }
}

/// Mean of a number over the fixes that say what is normal.
fn usual(log: &Log, value: impl Fn(&super::Logged) -> Option<f64>) -> f64 {
    let values: Vec<f64> = log.fixes.iter().take(BASELINE).filter_map(value).collect();
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// By how much the effects at a port rise with the gyro's temperature, about one temperature: those that follow it as it is.
fn slope(model: &ErrorModel, port: Port, temp_c: f64) -> f64 {
    let own = model.effects.iter().filter(|effect| effect.port == port);
    own.filter_map(|effect| match effect.factors.as_slice() {
        [factor]
            if factor.dynamics.is_empty() && factor.channels().all(|name| name.as_str() == channel::TEMPERATURE) =>
        {
            // Signals other than channels have no names at all.
            factor.channels().next()?;
            let at = |temp_c: f64| -> f64 {
                factor
                    .values(temp_c)
                    .iter()
                    .zip(&effect.weights)
                    .map(|(value, weight)| value * f64::from(*weight))
                    .sum()
            };
            Some((at(temp_c + 0.5 * STEP_K) - at(temp_c - 0.5 * STEP_K)) / STEP_K)
        }
        _ => None,
    })
    .sum::<f64>()
        // The sum of nothing is -0, and is printed so.
        + 0.0
}

#[cfg(test)]
mod tests {
    use north_finder::effects::ChannelName;
    use north_finder::effects::effect::Effect;
    use north_finder::effects::factor::Factor;
    use north_finder::effects::shape::Linear;
    use north_finder::effects::signal::Channel;

    use super::super::Logged;
    use super::*;

    fn log(amplitude_deg_h: f64) -> Log {
        let fix = |number: u64| Logged {
            fix: number,
            boot: number / 5,
            azimuth_deg: Some(if number < 150 { 40.0 } else { 75.0 }),
            amplitude_deg_h: Some(amplitude_deg_h),
            temp_c: Some(20.0),
            ..Logged::default()
        };
        Log { fixes: (0..200).map(fix).collect(), warnings: Vec::new() }
    }

    fn change(signal: Kind, cause: Cause, size: f64, from: usize) -> Change {
        Change {
            signal,
            unit: signal.unit(),
            from,
            cause,
            size,
            sigma: 0.1 * size.abs(),
            sigmas_of_fix: 5.0,
            instead: None,
            share: 1.0,
            passed: false,
        }
    }

    /// 0.3 °/h for 2 K is 0.15 for each kelvin; 0.12 °/h of 12 °/h is one in a hundred.
    #[test]
    fn coefficients_by_hand() {
        let name = ChannelName::new("temp_c").unwrap();
        let line = Factor::new(Channel { name }.into(), &[], Linear { reference: 15.0, scale: 2.0 }.into());
        let mut effect = Effect::new(Port::Rate, &[line]);
        effect.weights.copy_from_slice(&[0.3]);
        let mut model = ErrorModel { scale_error: 0.001, ..ErrorModel::default() };
        model.effects.push(effect).unwrap();
        let moved = |change: Change| Moved::new(&change, &log(12.0), &model).unwrap();
        let slope = moved(change(Kind::Bias, Cause::Temperature, 0.02, 100));
        assert!((slope.before - 0.15).abs() < 1e-6 && slope.by == 0.02, "{slope:?}");
        let scale = moved(change(Kind::Amplitude, Cause::Step, 0.12, 150));
        assert!(scale.before == 0.001 && (scale.by - 0.01).abs() < 1e-12 && (scale.sigma - 0.001).abs() < 1e-12);
        assert_eq!(Moved::new(&change(Kind::Misfit, Cause::Step, 3.0, 150), &log(12.0), &model), None);
    }

    /// Ω cos 45° = 10.6356 °/h and Ω cos 46° = 10.4484: 0.1872 less is a degree further from the equator.
    #[test]
    fn another_place_by_hand() {
        let step =
            |from: usize| OtherPlace::new(&change(Kind::Amplitude, Cause::Step, -0.187_2, from), &log(10.635_64));
        let place = step(150).unwrap();
        assert!(
            (place.latitude_before_deg - 45.0).abs() < 1e-3 && (place.latitude_after_deg - 46.0).abs() < 1e-3,
            "{place:?}"
        );
        // Fix 150 is the first at another azimuth, after a switch-on; 160 was made where 159 was.
        assert!(place.set_up_anew && !step(160).unwrap().set_up_anew);
    }
}
