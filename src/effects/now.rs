//! What the factors of an effect are evaluated from.

use serde::{Deserialize, Serialize};

use super::channel::ChannelName;
use super::conditions::Conditions;
use super::track::Track;

/// What is known of a run as a whole. A board knows it where a host has set its clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    /// Time of day at the run's start, hours of Universal Time, 0 … 24.
    pub hour_of_day: Option<f64>,
    /// Time without power before the run, seconds.
    pub rest_s: Option<f64>,
}

/// What the rates say of the instrument: known once there is an azimuth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Azimuth of the sensitive axis, degrees clockwise from north.
    pub axis_azimuth_deg: f64,
    /// True rate about the sensitive axis, °/h.
    pub rate_deg_h: f64,
}

/// One second.
#[derive(Clone, Copy)]
pub struct Now<'a> {
    pub conditions: &'a Conditions,
    /// Names of the conditions' further channels.
    pub channels: &'a [ChannelName],
    pub track: &'a Track,
    pub run: &'a RunFacts,
    /// `None` while the azimuth is not known.
    pub belief: Option<Belief>,
}
