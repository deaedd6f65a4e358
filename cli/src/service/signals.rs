//! What every fix says of the state of its instrument.

use north_finder::event::service::watch::misfit_sigmas;
use north_finder::units::wrap_180_deg;
use serde::Serialize;

use super::Logged;

/// What a number of every fix tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    Bias,
    Amplitude,
    Misfit,
    #[serde(rename = "azimuth error")]
    AzimuthError,
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::Amplitude => "amplitude",
            Self::Misfit => "misfit",
            Self::AzimuthError => "azimuth error",
        }
    }

    pub fn unit(self) -> &'static str {
        match self {
            Self::Bias | Self::Amplitude => "°/h",
            Self::Misfit => "sigma",
            Self::AzimuthError => "°",
        }
    }
}

/// One number of every fix of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    pub kind: Kind,
    pub values: Vec<f64>,
}

/// A number that some fixes of a log have and others lack, so that it is not watched.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Lacking {
    pub signal: Kind,
    /// How many fixes lack it, and the number of the first of them.
    pub lacking: usize,
    pub first_fix: u64,
}

/// The signals that every fix of a log has, and those that only some fixes have.
pub fn signals(fixes: &[Logged]) -> (Vec<Signal>, Vec<Lacking>) {
    let (mut watched, mut left_out) = (Vec::new(), Vec::new());
    let mut take = |kind, value: &dyn Fn(&Logged) -> Option<f64>| {
        let values: Vec<f64> = fixes.iter().filter_map(value).collect();
        match fixes.iter().find(|fix| value(fix).is_none()) {
            None => watched.push(Signal { kind, values }),
            Some(first) if !values.is_empty() => {
                let lacking = fixes.len() - values.len();
                left_out.push(Lacking { signal: kind, lacking, first_fix: first.fix });
            }
            Some(_) => {}
        }
    };
    take(Kind::Bias, &|fix| fix.bias_deg_h);
    take(Kind::Amplitude, &|fix| fix.amplitude_deg_h);
    take(Kind::Misfit, &|fix| misfit_sigmas(fix.misfit?, fix.freedom?));
    take(Kind::AzimuthError, &|fix| Some(wrap_180_deg(fix.azimuth_deg? - fix.check_deg?)));
    (watched, left_out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_that_a_fix_lacks_is_left_out_and_told() {
        let fix = Logged { bias_deg_h: Some(1.0), azimuth_deg: Some(359.0), check_deg: Some(1.0), ..Logged::default() };
        let (found, left_out) = signals(&[fix.clone(), Logged { fix: 7, bias_deg_h: None, ..fix }]);
        assert_eq!(found.len(), 1);
        assert_eq!(left_out, [Lacking { signal: Kind::Bias, lacking: 1, first_fix: 7 }]);
        assert_eq!((found[0].kind, found[0].values.as_slice()), (Kind::AzimuthError, [-2.0, -2.0].as_slice()));
    }
}
