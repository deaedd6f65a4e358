//! Settings in flash.

use super::Settings;

/// What the flash holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Loaded {
    /// Nothing was ever stored.
    Missing,
    /// Something was stored, and its check fails.
    Corrupt,
    Valid(Settings),
}
