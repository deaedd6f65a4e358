//! Room for what is never there at the same time: settings on their way, the attitudes of a calibration, and its answer.

use calibration::field::collection::Collection;
use calibration::field::problem::Solved;
use calibration::field::refusal::{NoCalibration, Why};

use crate::settings::pieces::Incoming;

/// One of them. The instrument owns it, and lends it to whoever solves a calibration.
///
/// It may be shared because settings that are stored end everything: the instrument starts anew with them. While a calibration uses the
/// room, settings are refused; a calibration that begins takes the room from settings that came only in part, and their next piece is
/// refused. A calibration needs its attitudes no more when it is stored, which takes the room of settings.
#[allow(clippy::large_enum_variant)] // that is what it is for
#[derive(Debug)]
pub enum Workspace {
    Settings(Incoming),
    Attitudes(Collection),
    /// What came of them.
    Answer(Result<Solved, NoCalibration>),
}

impl Default for Workspace {
    fn default() -> Self {
        Self::Settings(Incoming::default())
    }
}

impl Workspace {
    /// For settings: those that have come, or none yet.
    pub fn settings(&mut self) -> Option<&mut Incoming> {
        if !matches!(self, Self::Settings(_)) {
            *self = Self::default();
        }
        if let Self::Settings(incoming) = self { Some(incoming) } else { None }
    }

    /// For a calibration that begins.
    pub fn begin(&mut self) -> Option<&mut Collection> {
        *self = Self::Attitudes(Collection::default());
        self.attitudes()
    }

    /// Solves the calibration whose attitudes are here; the answer takes their place.
    ///
    /// Never inlined: what solving takes of the stack is no task's that waits.
    #[inline(never)]
    pub fn solve(&mut self) {
        let answer = self.attitudes().map_or(Err(Why::TooFew.into()), Collection::solve);
        *self = Self::Answer(answer);
    }

    /// The answer, once it is there.
    pub fn answer(&self) -> Option<Result<Solved, NoCalibration>> {
        if let Self::Answer(answer) = self { Some(*answer) } else { None }
    }

    /// Those of the calibration that is under way.
    pub fn attitudes(&mut self) -> Option<&mut Collection> {
        if let Self::Attitudes(collection) = self { Some(collection) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::bytes::{Bytes, Piece};
    use crate::health::Refusal;
    use crate::settings::store::VERSION;

    #[test]
    fn a_calibration_takes_the_room_from_settings_that_came_in_part() {
        let piece = |offset| Piece { version: VERSION, length: 9, offset, bytes: Bytes::start_of(&[1, 2, 3]) };
        let mut workspace = Workspace::default();
        assert_eq!(workspace.settings().unwrap().take(&piece(0)), Ok(false));
        assert!(workspace.attitudes().is_none() && workspace.begin().is_some() && workspace.attitudes().is_some());
        assert!(workspace.answer().is_none());
        workspace.solve();
        assert_eq!(workspace.answer().unwrap().map_err(|reason| reason.why), Err(Why::TooFew));
        assert_eq!(workspace.settings().unwrap().take(&piece(3)), Err(Refusal::OutOfOrder));
        assert!(workspace.answer().is_none());
    }
}
