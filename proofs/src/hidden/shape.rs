//! A shape of its own: a course over a whole run, for effects that remember or that are drawn anew for every run.

use std::fmt;
use std::sync::Arc;

use super::run_view::RunView;

/// What adds to the gyro's rate over a run, °/h for a coefficient of 1, one value a second.
type Course = dyn Fn(&RunView<'_>) -> Vec<f64> + Send + Sync;

/// A named course.
#[derive(Clone)]
pub struct Shape {
    /// What it is, with its constants.
    words: String,
    /// Numbers of the channels that cause it.
    pub(super) channels: Vec<usize>,
    /// Whether whoever knows the shape knows the course: not of noise.
    pub(super) is_knowable: bool,
    course: Arc<Course>,
}

impl Shape {
    pub(super) fn new(
        words: impl Into<String>,
        channels: &[usize],
        course: impl Fn(&RunView<'_>) -> Vec<f64> + Send + Sync + 'static,
    ) -> Self {
        Self { words: words.into(), channels: channels.to_vec(), is_knowable: true, course: Arc::new(course) }
    }

    /// The same, drawn by chance and known to nobody.
    pub(super) fn unknowable(mut self) -> Self {
        self.is_knowable = false;
        self
    }

    pub(super) fn course(&self, view: &RunView<'_>) -> Vec<f64> {
        (self.course)(view)
    }
}

impl fmt::Debug for Shape {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.words)
    }
}

/// Equal words mean equal courses: they hold the constants.
impl PartialEq for Shape {
    fn eq(&self, other: &Self) -> bool {
        self.words == other.words
    }
}
