//! The calibration of the accelerometers in the field, line by line.

use calibration::field::guidance::{Guidance, Step};
use north_finder::event::{Event, State};

/// What an event of the calibration is worth saying in a line.
pub fn line(event: &Event) -> Option<String> {
    Some(match event {
        Event::State(State::Calibrating) => "calibrating the accelerometers".to_owned(),
        Event::Guidance(Guidance { step, attitudes, coverage, next }) => match step {
            Step::Turn => format!("turn: {next} up"),
            Step::Hold => "hold still".to_owned(),
            Step::Accepted => format!("attitude {attitudes} accepted, coverage {coverage:.2}"),
            Step::Known => format!("this direction is known, turn further: {next} up"),
            Step::Moved => "moved before it was measured: again".to_owned(),
            Step::NotGravity => format!("this is not gravity; turn: {next} up"),
            Step::Solving => "solving on board".to_owned(),
        },
        Event::CalibrationStored => "stored".to_owned(),
        Event::NoCalibration(reason) => match reason.missing {
            Some(missing) => format!("{}: {}; {missing} up is missing most", reason.why.name(), reason.why.explain()),
            None => format!("{}: {}", reason.why.name(), reason.why.explain()),
        },
        _ => return None,
    })
}
