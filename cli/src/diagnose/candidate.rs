//! Candidate effects, built from what a campaign has: its channels whatever their names, its times, angles and rates.

use std::collections::BTreeMap;

use north_finder::effects::spline::{MAX_KNOTS, Numbers};
use north_finder::effects::{ChannelName, Conditions, DeadZoneForm, ErrorModel, Evaluator, MAX_CHANNELS, Term};
use north_finder::index::Direction;
use north_finder::units::ARCSEC_PER_RAD;

use super::data::RunData;
use super::statistics::median;

/// What a candidate is, apart from its coefficients and its one non-linear constant.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Powers 1 … n of a channel.
    Powers(ChannelName, f64, usize),
    /// A natural cubic spline through these knots.
    Spline(ChannelName, Numbers),
    Lag(ChannelName, f64),
    LowPass(ChannelName, f64),
    /// By a straight line, or by a parabola at its end.
    Rate(ChannelName, bool),
    RateLowPass(ChannelName),
    Scale(ChannelName, f64),
    ScaleFactor,
    Drift(usize),
    WarmUp,
    Settling(SettlingBy, bool),
    Harmonic(u8),
    /// Bias of the level sensors, with the Earth's vertical rate.
    LevelBias(f64),
    /// A power of the rate less the centre.
    Nonlinearity(f64, i32),
    DeadZone(f64, DeadZoneForm),
    Line,
    Step,
    /// East alone, or east and north.
    EarthField(bool),
    IndexOffset,
    IndexHarmonic,
    BaseMotion,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettlingBy {
    Nothing,
    Direction,
    Travel,
    SignedTravel,
    Position,
}

/// Most periods of a line that are tried.
const MOST_LINES: usize = 200;

/// A candidate effect.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub name: String,
    pub kind: &'static str,
    pub channel: Option<String>,
    pub shape: Shape,
    /// Values of the non-linear constant to begin with; empty where there is none.
    pub grid: Vec<f64>,
}

/// Columns of a run: one a coefficient, one value a cell, °/h.
pub type Columns = Vec<Vec<f64>>;

impl Candidate {
    fn new(name: impl Into<String>, kind: &'static str, channel: Option<&str>, shape: Shape, grid: Vec<f64>) -> Self {
        Self { name: name.into(), kind, channel: channel.map(str::to_owned), shape, grid }
    }

    /// Its name, with the channel where that does not say it.
    pub fn full_name(&self) -> String {
        match &self.channel {
            Some(channel) if channel != "temp_c" => format!("{}:{channel}", self.name),
            _ => self.name.clone(),
        }
    }

    /// Number of coefficients.
    pub fn coefficients(&self) -> usize {
        match self.shape {
            Shape::Powers(_, _, n) | Shape::Drift(n) => n,
            Shape::Spline(_, knots) => knots.as_slice().len() - 1,
            Shape::Harmonic(_) | Shape::LevelBias(_) | Shape::Line | Shape::IndexHarmonic => 2,
            Shape::Settling(SettlingBy::Position, _) | Shape::EarthField(true) => 2,
            _ => 1,
        }
    }

    /// Whether its columns depend on the rate, or on the azimuth of the run.
    pub fn follows_rate(&self) -> bool {
        matches!(
            self.shape,
            Shape::Scale(..)
                | Shape::ScaleFactor
                | Shape::Nonlinearity(..)
                | Shape::DeadZone(..)
                | Shape::EarthField(_)
                | Shape::IndexOffset
                | Shape::IndexHarmonic
        )
    }

    /// Fitted constants in all.
    pub fn freedom(&self) -> usize {
        self.coefficients() + usize::from(!self.grid.is_empty())
    }

    /// The model term with these coefficients and constant; `None` where the scale factor takes it.
    pub fn term(&self, constant: f64, c: &[f64]) -> Option<Term> {
        let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
        let channel = |channel, lag_s, low_pass_s, reference| Term::Channel {
            channel,
            lag_s,
            low_pass_s,
            reference,
            linear_deg_h: at(0),
            quadratic_deg_h: at(1),
            cubic_deg_h: at(2),
        };
        Some(match self.shape {
            Shape::Powers(name, reference, n) if name.as_str() == "temp_c" && n <= 2 => {
                Term::Temperature { reference_c: reference, linear_deg_h_per_k: at(0), quadratic_deg_h_per_k2: at(1) }
            }
            Shape::Powers(name, reference, _) => channel(name, 0.0, 0.0, reference),
            Shape::Spline(channel, knots) => {
                Term::ChannelSpline { channel, knots, coefficients: Numbers::new(c).unwrap_or_default() }
            }
            Shape::Lag(name, reference) => channel(name, constant, 0.0, reference),
            Shape::LowPass(name, reference) => channel(name, 0.0, constant, reference),
            Shape::Rate(name, false) if name.as_str() == "temp_c" && constant > 29.0 => {
                Term::TemperatureRate { deg_h_per_k_per_s: at(0) }
            }
            Shape::Rate(channel, curved) => {
                let seconds = constant.round().clamp(3.0, 30.0) as u8;
                Term::ChannelRate { channel, low_pass_s: 0.0, seconds, curved, deg_h_per_unit_per_s: at(0) }
            }
            Shape::RateLowPass(channel) => Term::ChannelRate {
                channel,
                low_pass_s: constant,
                seconds: 6,
                curved: false,
                deg_h_per_unit_per_s: at(0),
            },
            Shape::Scale(name, reference) if name.as_str() == "temp_c" => {
                Term::ScaleTemperature { reference_c: reference, per_k: at(0) }
            }
            Shape::Scale(channel, reference) => Term::ScaleChannel { channel, reference, per_unit: at(0) },
            Shape::ScaleFactor => return None,
            Shape::Drift(_) => Term::Drift { deg_h_per_h: at(0), deg_h_per_h2: at(1) },
            Shape::WarmUp => Term::WarmUp { deg_h: at(0), tau_s: constant },
            Shape::Settling(by, first_stay) => {
                let only = |wanted| if by == wanted { at(0) } else { 0.0 };
                Term::Settling {
                    tau_s: constant,
                    first_stay,
                    deg_h: only(SettlingBy::Nothing),
                    by_direction_deg_h: only(SettlingBy::Direction),
                    deg_h_per_deg_travel: only(SettlingBy::Travel),
                    deg_h_per_deg_signed_travel: only(SettlingBy::SignedTravel),
                    cos_deg_h: only(SettlingBy::Position),
                    sin_deg_h: if by == SettlingBy::Position { at(1) } else { 0.0 },
                }
            }
            Shape::Harmonic(order) => Term::BodyHarmonic { order, cos_deg_h: at(0), sin_deg_h: at(1) },
            Shape::LevelBias(up_deg_h) => {
                Term::BodyHarmonic { order: 1, cos_deg_h: -up_deg_h * at(0), sin_deg_h: -up_deg_h * at(1) }
            }
            Shape::Nonlinearity(centre_deg_h, power) => {
                let of = |wanted| if power == wanted { at(0) } else { 0.0 };
                Term::RateNonlinearity { centre_deg_h, quadratic_per_deg_h: of(2), cubic_per_deg_h2: of(3) }
            }
            Shape::DeadZone(centre_deg_h, form) => {
                Term::DeadZone { centre_deg_h, depth_deg_h: at(0), width_deg_h: constant, form }
            }
            Shape::Line => Term::Line { period_s: constant, cos_deg_h: at(0), sin_deg_h: at(1) },
            Shape::Step => Term::Step { t_s: constant, deg_h: at(0) },
            Shape::EarthField(_) => Term::EarthField { east_deg_h: at(0), north_deg_h: at(1) },
            Shape::IndexOffset => Term::IndexError { offset_deg: at(0), cos_deg: 0.0, sin_deg: 0.0 },
            Shape::IndexHarmonic => Term::IndexError { offset_deg: 0.0, cos_deg: at(0), sin_deg: at(1) },
            Shape::BaseMotion => Term::BaseMotion { velocity: false, lag_s: 0.0 },
        })
    }

    /// Names of the coefficients, and of the constant, as documented.
    pub fn parameter_names(&self) -> (Vec<&'static str>, Option<&'static str>) {
        let powers = |n: usize, names: [&'static str; 3]| names[..n.min(3)].to_vec();
        match self.shape {
            Shape::Powers(name, _, n) if name.as_str() == "temp_c" => {
                (powers(n, ["deg_h_per_k", "deg_h_per_k2", "deg_h_per_k3"]), None)
            }
            Shape::Powers(_, _, n) => (powers(n, ["deg_h_per_unit", "deg_h_per_unit2", "deg_h_per_unit3"]), None),
            Shape::Spline(_, knots) => {
                let names = ["straight", "bend_1", "bend_2", "bend_3", "bend_4", "bend_5"];
                (names[..knots.as_slice().len() - 1].to_vec(), None)
            }
            Shape::Lag(..) => (vec!["deg_h_per_unit"], Some("lag_s")),
            Shape::LowPass(..) => (vec!["deg_h_per_unit"], Some("tau_s")),
            Shape::Rate(name, _) if name.as_str() == "temp_c" => (vec!["deg_h_per_k_per_s"], Some("slope_s")),
            Shape::Rate(..) => (vec!["deg_h_per_unit_per_s"], Some("slope_s")),
            Shape::RateLowPass(name) if name.as_str() == "temp_c" => (vec!["deg_h_per_k_per_s"], Some("tau_s")),
            Shape::RateLowPass(_) => (vec!["deg_h_per_unit_per_s"], Some("tau_s")),
            Shape::Scale(name, _) if name.as_str() == "temp_c" => (vec!["per_k"], None),
            Shape::Scale(..) => (vec!["per_unit"], None),
            Shape::ScaleFactor => (vec!["scale_error"], None),
            Shape::Drift(n) => (powers(n, ["deg_h_per_h", "deg_h_per_h2", ""]), None),
            Shape::WarmUp => (vec!["deg_h"], Some("tau_s")),
            Shape::Settling(SettlingBy::Position, _) => (vec!["cos_deg_h", "sin_deg_h"], Some("tau_s")),
            Shape::Settling(SettlingBy::Travel, _) => (vec!["deg_h_per_deg_travel"], Some("tau_s")),
            Shape::Settling(SettlingBy::SignedTravel, _) => (vec!["deg_h_per_deg_signed_travel"], Some("tau_s")),
            Shape::Settling(..) => (vec!["deg_h"], Some("tau_s")),
            Shape::Harmonic(_) => (vec!["cos_deg_h", "sin_deg_h"], None),
            Shape::LevelBias(_) => (vec!["forward_g", "left_g"], None),
            Shape::Nonlinearity(_, 2) => (vec!["per_deg_h"], None),
            Shape::Nonlinearity(..) => (vec!["per_deg_h2"], None),
            Shape::DeadZone(..) => (vec!["depth_deg_h"], Some("width_deg_h")),
            Shape::Line => (vec!["cos_deg_h", "sin_deg_h"], Some("period_s")),
            Shape::Step => (vec!["deg_h"], Some("t_s")),
            Shape::EarthField(both) => (powers(1 + usize::from(both), ["east_deg_h", "north_deg_h", ""]), None),
            Shape::IndexOffset => (vec!["offset_deg"], None),
            Shape::IndexHarmonic => (vec!["cos_deg", "sin_deg"], None),
            Shape::BaseMotion => (vec!["gain"], Some("window_s")),
        }
    }

    /// Parameters by name.
    pub fn named(&self, constant: f64, coefficients: &[f64]) -> BTreeMap<String, f64> {
        let (names, constant_name) = self.parameter_names();
        let mut map: BTreeMap<_, _> = names.into_iter().map(str::to_owned).zip(coefficients.iter().copied()).collect();
        map.extend(constant_name.map(|name| (name.to_owned(), constant)));
        map
    }

    /// Whether the other is this one with more freedom, or less: the same cause, told in other words.
    pub fn is_kin(&self, other: &Self) -> bool {
        if self.channel != other.channel {
            return false;
        }
        let value = |shape: &Shape| {
            matches!(shape, Shape::Powers(..) | Shape::Spline(..) | Shape::Lag(..) | Shape::LowPass(..))
        };
        let rate = |shape: &Shape| matches!(shape, Shape::Rate(..) | Shape::RateLowPass(_));
        match (&self.shape, &other.shape) {
            (Shape::Drift(_), Shape::Drift(_)) | (Shape::DeadZone(..), Shape::DeadZone(..)) => true,
            (Shape::Nonlinearity(_, a), Shape::Nonlinearity(_, b)) => a == b,
            (Shape::Settling(a, _), Shape::Settling(b, _)) => a == b,
            (Shape::EarthField(_), Shape::EarthField(_)) => true,
            (a, b) => (value(a) && value(b)) || (rate(a) && rate(b)) || a == b,
        }
    }

    /// The columns of a run: what unit coefficients add to the rate. `rate_deg_h` is each cell's rate by the fit so
    /// far, without effects, `azimuth_deg` the run's azimuth.
    pub fn columns(&self, run: &RunData, constant: f64, rate_deg_h: &[f64], azimuth_deg: f64) -> Columns {
        let psi = azimuth_deg.to_radians();
        let h = run.earth.north_deg_h;
        let cells = &run.cells;
        let sin_alpha = |cos: f64, sin: f64| psi.sin() * cos - psi.cos() * sin;
        let cos_alpha = |cos: f64, sin: f64| psi.cos() * cos + psi.sin() * sin;
        // A reading too large by δ: ω = h cos(ψ − θ + δ), dω/dδ = −h sin(ψ − θ).
        let per_degree = 1f64.to_radians() * h;
        match self.shape {
            Shape::EarthField(both) => {
                let mut columns = vec![cells.iter().map(|cell| sin_alpha(cell.cos, cell.sin)).collect()];
                if both {
                    columns.push(cells.iter().map(|cell| cos_alpha(cell.cos, cell.sin)).collect());
                }
                columns
            }
            Shape::ScaleFactor => vec![cells.iter().map(|cell| h * cos_alpha(cell.cos, cell.sin)).collect()],
            Shape::IndexOffset => {
                vec![cells.iter().map(|cell| -per_degree * sin_alpha(cell.cos, cell.sin)).collect()]
            }
            Shape::IndexHarmonic => {
                let by = |factor: fn(&super::data::Cell) -> f64| {
                    cells.iter().map(|cell| -per_degree * sin_alpha(cell.cos, cell.sin) * factor(cell)).collect()
                };
                vec![by(|cell| cell.cos), by(|cell| cell.sin)]
            }
            Shape::Nonlinearity(..) | Shape::DeadZone(..) => {
                let Some(term) = self.term(constant, &[1.0]) else { return Vec::new() };
                vec![rate_deg_h.iter().map(|rate| term.of_rate_deg_h(*rate)).collect()]
            }
            Shape::BaseMotion => vec![base_motion(run, constant)],
            _ => (0..self.coefficients()).map(|i| self.evaluated(run, constant, i, rate_deg_h)).collect(),
        }
    }

    /// A column by the firmware's own evaluation of the term with one coefficient of 1.
    fn evaluated(&self, run: &RunData, constant: f64, i: usize, rate_deg_h: &[f64]) -> Vec<f64> {
        let mut unit = vec![0.0; self.coefficients()];
        unit[i] = 1.0;
        let Some(term) = self.term(constant, &unit) else { return vec![0.0; run.cells.len()] };
        let mut model = ErrorModel::default();
        let _ = model.terms.push(term);
        let extra = term.channel().filter(|name| !name.is_on_board());
        let values = extra.and_then(|name| run.names.iter().position(|each| each == name.as_str()));
        let mut evaluator = Evaluator::new(model);
        let mut column = Vec::with_capacity(run.cells.len());
        let mut waiting = 0;
        for (k, (cell, &rate)) in run.cells.iter().zip(rate_deg_h).enumerate() {
            let mut channels = [f64::NAN; MAX_CHANNELS];
            if let Some(values) = values {
                channels[0] = run.channels[values][k];
            }
            let conditions = Conditions {
                t_s: cell.t_s,
                seconds: cell.seconds,
                raw_rate_deg_h: rate,
                index: Some(Direction { cos: cell.cos, sin: cell.sin }),
                temp_c: cell.temp_c,
                level: cell.level,
                channels,
            };
            let correction = evaluator.second(&conditions);
            if correction.waiting && waiting < 16 {
                waiting += 1;
            } else if waiting > 0 {
                let first = column.len() - waiting;
                let rates = evaluator.rates_deg_h();
                column[first..].iter_mut().for_each(|value| *value += rates);
                waiting = 0;
            }
            column.push(correction.bias_deg_h + (correction.scale - 1.0) * rate);
        }
        column
    }
}

/// Turning of the base about the sensitive axis by the accelerometers, °/h: slopes of pitch and roll over `window_s` about
/// each cell, inside its stay.
fn base_motion(run: &RunData, window_s: f64) -> Vec<f64> {
    let cells = &run.cells;
    let slope = |i: usize| {
        let here = &cells[i];
        let near = |j: &usize| {
            let cell = &cells[*j];
            cell.stay == here.stay && !cell.moving && (cell.t_s - here.t_s).abs() <= 0.5 * window_s + 0.01
        };
        let first = (0..i).rev().take_while(near).last().unwrap_or(i);
        let last = (i..cells.len()).take_while(near).last().unwrap_or(i);
        let inside = cells.get(first..=last)?;
        let mean_s = inside.iter().map(|cell| cell.t_s).sum::<f64>() / inside.len() as f64;
        let (mut along, mut squares) = (0.0, 0.0);
        for cell in inside {
            let level = cell.level?;
            let t_s = cell.t_s - mean_s;
            along += t_s * (here.cos * level.left - here.sin * level.forward);
            squares += t_s * t_s;
        }
        (squares > 0.0).then(|| along / squares * ARCSEC_PER_RAD)
    };
    (0..cells.len()).map(|i| if cells[i].moving { 0.0 } else { slope(i).unwrap_or(0.0) }).collect()
}

/// Logarithmic grid.
fn geometric(from: f64, to: f64, steps: usize) -> Vec<f64> {
    (0..steps).map(|i| from * (to / from).powf(i as f64 / (steps.max(2) - 1) as f64)).collect()
}

/// Every candidate that the runs allow.
pub fn all(runs: &[&RunData], constant_channels: &[String]) -> Vec<Candidate> {
    let mut list = Vec::new();
    let Some(first) = runs.first() else { return list };
    let longest_s = runs.iter().filter_map(|run| run.cells.last()).map(|cell| cell.t_s).fold(0.0, f64::max);
    let step_s = runs.iter().filter_map(|run| run.cells.first()).map(|cell| cell.seconds).fold(1.0, f64::max);
    for name in first.channel_names().iter().filter(|name| !constant_channels.contains(name)) {
        of_channel(&mut list, name, runs, longest_s);
    }
    let taus = geometric(4.0 * step_s, 4.0 * longest_s, 9);
    list.push(Candidate::new("drift", "bias", None, Shape::Drift(1), vec![]));
    list.push(Candidate::new("drift-quadratic", "bias", None, Shape::Drift(2), vec![]));
    list.push(Candidate::new("warm-up", "bias", None, Shape::WarmUp, taus.clone()));
    let settling = geometric(2.0 * step_s, longest_s / 3.0, 8);
    for (name, by) in [
        ("settling", SettlingBy::Nothing),
        ("settling-by-direction", SettlingBy::Direction),
        ("settling-by-travel", SettlingBy::Travel),
        ("settling-by-signed-travel", SettlingBy::SignedTravel),
        ("settling-by-position", SettlingBy::Position),
    ] {
        list.push(Candidate::new(name, "bias", None, Shape::Settling(by, false), settling.clone()));
    }
    let every = Shape::Settling(SettlingBy::Nothing, true);
    list.push(Candidate::new("settling-every-stay", "bias", None, every, settling));
    for order in 1..=6 {
        list.push(Candidate::new(format!("body-harmonic-{order}"), "bias", None, Shape::Harmonic(order), vec![]));
    }
    // What is distorted may be the rate alone, or with the gyro's bias.
    let usual_deg_h = median(runs.iter().filter_map(|run| Some(run.before?.bias_deg_h)).collect());
    for centre_deg_h in [0.0, usual_deg_h] {
        list.push(Candidate::new("rate-quadratic", "scale", None, Shape::Nonlinearity(centre_deg_h, 2), vec![]));
        list.push(Candidate::new("rate-cubic", "scale", None, Shape::Nonlinearity(centre_deg_h, 3), vec![]));
        for form in [DeadZoneForm::Short, DeadZoneForm::Middle, DeadZoneForm::Long, DeadZoneForm::Lock] {
            let shape = Shape::DeadZone(centre_deg_h, form);
            list.push(Candidate::new("dead-zone", "scale", None, shape, geometric(0.4, 10.0, 8)));
        }
    }
    list.push(Candidate::new("scale-factor", "scale", None, Shape::ScaleFactor, vec![]));
    for both in [false, true] {
        list.push(Candidate::new("earth-field", "azimuth", None, Shape::EarthField(both), vec![]));
    }
    list.push(Candidate::new("index-offset", "index", None, Shape::IndexOffset, vec![]));
    list.push(Candidate::new("index-eccentricity", "index", None, Shape::IndexHarmonic, vec![]));
    // Frequencies from two periods in the longest run to half the rate of the cells, half a resolution apart, or more
    // where they would be too many.
    let lines = (longest_s / step_s) as usize;
    let stride = lines.div_ceil(MOST_LINES).max(1);
    let periods = (4..lines).step_by(stride).map(|n| 2.0 * longest_s / n as f64).collect();
    list.push(Candidate::new("line", "bias", None, Shape::Line, periods));
    let steps = (1..32).map(|n| longest_s * f64::from(n) / 32.0).collect();
    list.push(Candidate::new("step", "bias", None, Shape::Step, steps));
    if runs.iter().all(|run| run.channel("ax_g").is_some()) {
        list.push(Candidate::new("base-motion", "base-motion", None, Shape::BaseMotion, vec![2.0, 8.0, 30.0, 80.0]));
        list.push(Candidate::new("level-bias", "bias", None, Shape::LevelBias(first.earth.up_deg_h), vec![]));
    }
    list
}

/// Knots of splines that may follow a curve: few and many at quantiles of the values, the outer ones at 5 % and 95 %
/// (Harrell, Regression modeling strategies, 2001, section 2.4.5); and many evenly between the same, or in a part of it for a
/// sharp bend between straight lines.
fn splines(mut values: Vec<f64>) -> Vec<Numbers> {
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64) as usize];
    let quantiles = |count: usize| (0..count).map(|i| at(0.05 + 0.9 * i as f64 / (count - 1) as f64)).collect();
    let (low, high) = (at(0.05), at(0.95));
    let even = |(from, to): (f64, f64)| {
        let at = |i: usize| low + (high - low) * (from + (to - from) * i as f64 / (MAX_KNOTS - 1) as f64);
        (0..MAX_KNOTS).map(at).collect()
    };
    let parts = [(0.0, 1.0), (0.0, 0.6), (0.2, 0.8), (0.4, 1.0)];
    let knots: Vec<Vec<f64>> = [quantiles(4), quantiles(MAX_KNOTS)].into_iter().chain(parts.map(even)).collect();
    let rising = |knots: &&Vec<f64>| knots.windows(2).all(|pair| pair[1] > pair[0]);
    knots.iter().filter(rising).filter_map(|knots| Numbers::new(knots)).collect()
}

fn of_channel(list: &mut Vec<Candidate>, name: &str, runs: &[&RunData], longest_s: f64) {
    let Some(channel) = ChannelName::new(name) else { return };
    let values: Vec<f64> = runs.iter().filter_map(|run| run.channel(name)).flatten().collect();
    if values.is_empty() || runs.iter().any(|run| run.channel(name).is_none()) {
        return;
    }
    // A reference that reads well.
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let temperature = name == "temp_c";
    let prefix = if temperature { "temperature" } else { "channel" };
    let scale = if temperature { "scale-temperature" } else { "scale-channel" };
    let mut add = |suffix: &str, shape, grid| {
        list.push(Candidate::new(format!("{prefix}{suffix}"), "bias", Some(name), shape, grid));
    };
    add("", Shape::Powers(channel, mean, 1), vec![]);
    if name == "ax_g" || name == "ay_g" {
        return;
    }
    add("-quadratic", Shape::Powers(channel, mean, 2), vec![]);
    add("-cubic", Shape::Powers(channel, mean, 3), vec![]);
    for knots in splines(values) {
        add("-spline", Shape::Spline(channel, knots), vec![]);
    }
    add("-rate", Shape::Rate(channel, false), vec![3.0, 6.0, 12.0, 30.0]);
    add("-rate", Shape::Rate(channel, true), vec![4.0, 8.0, 15.0, 30.0]);
    add("-lag", Shape::Lag(channel, mean), geometric(3.0, 30.0, 5));
    add("-low-pass", Shape::LowPass(channel, mean), geometric(5.0, longest_s, 7));
    add("-rate-low-pass", Shape::RateLowPass(channel), geometric(10.0, longest_s, 6));
    list.push(Candidate::new(scale, "scale", Some(name), Shape::Scale(channel, mean), vec![]));
}
