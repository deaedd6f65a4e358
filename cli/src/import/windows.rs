//! Which stretches of a recording become runs.

use std::ops::Range;
use std::path::PathBuf;

use serde::Deserialize;

use crate::campaign::Run;

/// The file of one position, relative to the recording's folder, and the index angle at which it was recorded.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    pub file: PathBuf,
    pub index_deg: f64,
}

/// One stretch, or several that follow each other at equal steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Where it stands in the mapping file.
    pub span: Range<usize>,
    pub start_s: f64,
    /// To the recording's end, if it is not said.
    pub seconds: Option<f64>,
    /// From one beginning to the next.
    pub every_s: f64,
    /// As many as the recording holds, if it is not said.
    pub repeat: Option<u32>,
    /// The files that make it up, where each position has its own.
    pub positions: Vec<Position>,
    /// What is known of each.
    pub run: Run,
}

/// One stretch: from its beginning (inclusive) to its end, seconds of the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    pub span: Range<usize>,
    pub start_s: f64,
    /// The recording's end, if there is none.
    pub end_s: Option<f64>,
    /// It may be left out if the recording ends within it.
    pub optional: bool,
    pub positions: Vec<Position>,
    pub run: Run,
}

/// Hands out the windows by the time of their beginnings.
#[derive(Clone, Debug)]
pub struct Windows {
    /// Each series, and how many of its windows were handed out.
    series: Vec<(Series, u32)>,
}

impl Series {
    /// The whole recording as one run, or as many runs of a virtual index as it holds: each that many seconds long.
    pub fn whole(seconds: Option<f64>) -> Self {
        let repeat = if seconds.is_some() { None } else { Some(1) };
        Self {
            span: 0..0,
            start_s: 0.0,
            seconds,
            every_s: seconds.unwrap_or_default(),
            repeat,
            positions: Vec::new(),
            run: Run::default(),
        }
    }

    fn window(&self, number: u32) -> Option<Window> {
        if self.repeat.is_some_and(|repeat| number >= repeat) {
            return None;
        }
        let start_s = self.start_s + f64::from(number) * self.every_s;
        Some(Window {
            span: self.span.clone(),
            start_s,
            end_s: self.seconds.map(|seconds| start_s + seconds),
            optional: self.repeat.is_none(),
            positions: self.positions.clone(),
            run: self.run.clone(),
        })
    }
}

impl Windows {
    pub fn new(series: Vec<Series>) -> Self {
        Self { series: series.into_iter().map(|series| (series, 0)).collect() }
    }

    /// The window that begins next.
    pub fn next_window(&mut self) -> Option<Window> {
        let (window, used) = self
            .series
            .iter_mut()
            .filter_map(|(series, used)| Some((series.window(*used)?, used)))
            .min_by(|(a, _), (b, _)| a.start_s.total_cmp(&b.start_s))?;
        *used += 1;
        Some(window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Role;

    #[test]
    fn series_interleave_by_time() {
        let series = |start_s, repeat, role| Series {
            span: 0..0,
            start_s,
            seconds: Some(10.0),
            every_s: 20.0,
            repeat,
            positions: Vec::new(),
            run: Run { role, ..Run::default() },
        };
        let mut windows = Windows::new(vec![series(10.0, None, Role::Check), series(0.0, Some(2), Role::Fit)]);
        let five: Vec<_> = (0..5).map_while(|_| windows.next_window()).collect();
        let starts: Vec<_> = five.iter().map(|window| (window.start_s, window.run.role == Role::Fit)).collect();
        assert_eq!(starts, [(0.0, true), (10.0, false), (20.0, true), (30.0, false), (50.0, false)]);
        assert_eq!((five[2].end_s, five[2].optional, five[3].optional), (Some(30.0), false, true));
    }
}
