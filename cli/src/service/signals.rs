//! What every fix of a log says of the state of its instrument.

use north_finder::service::watch::{Values, error_sigmas, misfit_sigmas};

use super::Logged;

impl Logged {
    /// In the order of the core's signals.
    pub fn values(&self) -> Values {
        let misfit = self.misfit.zip(self.freedom).and_then(|(misfit, freedom)| misfit_sigmas(misfit, freedom));
        let error = match (self.azimuth_deg, self.sigma_deg, self.check_deg) {
            (Some(azimuth_deg), Some(sigma_deg), Some(check_deg)) => error_sigmas(azimuth_deg, sigma_deg, check_deg),
            _ => None,
        };
        [self.bias_deg_h, self.amplitude_deg_h, misfit, error]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The median of chi-square with 7 degrees of freedom is 6.346; 359° is 2° west of 1°.
    #[test]
    fn what_a_fix_lacks_it_does_not_say() {
        let fix = Logged { bias_deg_h: Some(1.5), misfit: Some(6.346), freedom: Some(7.0), ..Logged::default() };
        let [bias, amplitude, misfit, error] = fix.values();
        assert_eq!((bias, amplitude, error), (Some(1.5), None, None));
        assert!(misfit.unwrap().abs() < 0.01);
        let checked = Logged { azimuth_deg: Some(359.0), sigma_deg: Some(0.5), check_deg: Some(1.0), ..fix };
        assert_eq!(checked.values()[3], Some(-4.0));
    }
}
