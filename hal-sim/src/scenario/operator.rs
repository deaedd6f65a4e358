//! Habits of the operator who turns the instrument from attitude to attitude.

use super::check::{Any, part};

part! {
    /// The operator.
    Operator {
        /// Error of the direction that is put up, degrees rms about each of the two axes across it.
        aim_deg: f64 = 4.0, 0.0..=45.0;
        /// Time until a turn begins, s.
        reaction_s: f64 = 0.6, 0.0..=60.0;
        /// Time of a turn, s.
        turn_s: f64 = 2.5, 0.1..=600.0;
        /// Shake of the hands while turning, g rms on each axis.
        shake_g: f64 = 0.03, 0.0..=1.0;
        /// Turns, counted from 1, after which the instrument is thrown over by 12° while it is measured.
        shocks: Vec<u32> = Vec::new(), Any;
        /// Turns, counted from 1, that are slow …
        slow: Vec<u32> = Vec::new(), Any;
        /// … and take this long, s.
        slow_s: f64 = 15.0, 0.1..=600.0;
    }
}
