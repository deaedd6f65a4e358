//! A sensor's reading at a tick.

use serde::{Deserialize, Serialize};

/// What a tick has of a sensor that is not read at every one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Reading<T> {
    /// It was not to be read at this tick.
    #[default]
    NotDue,
    /// It was, and gave nothing valid.
    Failed,
    Value(T),
}

impl<T> Reading<T> {
    pub fn map<U>(self, change: impl FnOnce(T) -> U) -> Reading<U> {
        match self {
            Self::NotDue => Reading::NotDue,
            Self::Failed => Reading::Failed,
            Self::Value(value) => Reading::Value(change(value)),
        }
    }

    pub fn value(self) -> Option<T> {
        match self {
            Self::Value(value) => Some(value),
            Self::NotDue | Self::Failed => None,
        }
    }
}

impl<T, E> From<Result<T, E>> for Reading<T> {
    fn from(result: Result<T, E>) -> Self {
        result.map_or(Self::Failed, Self::Value)
    }
}
