//! A run as the parts of an effect see it.

use super::signal::Course;

/// The end of a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Arrival {
    pub(super) t_s: f64,
    pub(super) travel_deg: f64,
    pub(super) index_deg: f64,
}

/// What a part needs to know of a run.
#[derive(Debug)]
pub(super) struct RunView<'a> {
    pub(super) run: usize,
    /// Azimuth of the mark, degrees.
    pub(super) azimuth_deg: f64,
    /// Horizontal Earth rate, °/h.
    pub(super) north_deg_h: f64,
    /// Pitch and roll, degrees.
    pub(super) tilt_deg: [f64; 2],
    /// Index angle in the middle of every second, degrees.
    pub(super) index_deg: Vec<f64>,
    pub(super) arrivals: &'a [Arrival],
    /// One course for each channel, in standard deviations from its mean.
    pub(super) channels: &'a [Course],
}

/// A moment of a run: the middle of a row of one second.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub(super) t_s: f64,
    pub(super) index_deg: f64,
}

impl RunView<'_> {
    /// Its length.
    pub(super) fn seconds(&self) -> usize {
        self.index_deg.len()
    }

    /// What a channel truly is in the middle of every second.
    pub(super) fn channel(&self, channel: usize) -> Vec<f64> {
        (0..self.seconds())
            .map(|second| self.channels.get(channel).map_or(0.0, |course| course.at(second as f64 + 0.5)))
            .collect()
    }

    /// Azimuth of the sensitive axis in a second, degrees.
    pub(super) fn axis_deg(&self, second: usize) -> f64 {
        self.azimuth_deg - self.index_deg[second]
    }

    /// Component of the horizontal Earth rate along the axis in every second, °/h.
    pub(super) fn north(&self) -> Vec<f64> {
        (0..self.seconds()).map(|second| self.north_deg_h * self.axis_deg(second).to_radians().cos()).collect()
    }

    /// How steeply a direction in the plane of the index, so many degrees from the axis, rises in a second: its sine.
    pub(super) fn up(&self, second: usize, from_axis_deg: f64) -> f64 {
        let (sin, cos) = (self.index_deg[second] + from_axis_deg).to_radians().sin_cos();
        let [pitch, roll] = self.tilt_deg.map(f64::to_radians);
        cos * pitch.sin() + sin * roll.sin() * pitch.cos()
    }
}
