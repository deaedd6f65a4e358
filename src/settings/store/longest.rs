//! The longest settings that are valid: what record and frame must hold.

use heapless::Vec;

use crate::calibration::accelerometer::AccelerometerCalibration;
use crate::effects::spline::{MAX_KNOTS, Numbers};
use crate::effects::{ChannelName, ErrorModel, MAX_TERMS, Term};
use crate::sequence::order::{MAX_POSITIONS, Order};
use crate::settings::Settings;

/// Every number needs all its bytes, every list is full, every effect is of the longest kind.
pub fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.level.seconds = u16::MAX;
    settings.disturbance.seconds = u16::MAX;
    settings.jitter.seconds = u16::MAX;
    settings.sequence.dwell_s = u16::MAX;
    settings.sequence.coarse_dwell_s = u16::MAX;
    settings.gyro.repairable_frames = u16::MAX;

    let mut angles = Vec::new();
    angles.resize(MAX_POSITIONS, 1.1).unwrap();
    settings.sequence.order = Order::Custom(angles);

    let knots = [1.1, 2.2, 3.3, 4.4, 5.5, 6.6, 7.7];
    let curve = Term::ChannelSpline {
        channel: ChannelName::new("a_name_of_twenty_four_by").unwrap(),
        knots: Numbers::new(&knots).unwrap(),
        coefficients: Numbers::new(&knots[..MAX_KNOTS - 1]).unwrap(),
    };
    curve.validate().unwrap();
    let mut model = ErrorModel::default();
    model.terms.resize(MAX_TERMS, curve).unwrap();
    settings.model = Some(model);
    settings.accelerometer = Some(AccelerometerCalibration { bias_g: [1.1; 3], matrix: [1.1; 6] });
    settings
}
