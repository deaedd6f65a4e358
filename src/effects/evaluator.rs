//! The model at work: it remembers what lags, low-passes, rates of change and the time since a move need.

use heapless::Vec;

use super::channel::{ChannelName, TEMPERATURE};
use super::conditions::{Conditions, History, Move, RATE_SAMPLES, Travel};
use super::{Correction, ErrorModel, MAX_TERMS, Term, spline};
use crate::earth::EarthRate;
use crate::index::Direction;
use crate::units::{DEG_PER_RAD, wrap_360_deg};

/// Most steps of Newton's method, the half width of its slopes, and their least value.
const NEWTON_STEPS: usize = 12;
const SLOPE_DEG_H: f64 = 1e-4;
const LEAST_SLOPE: f64 = 0.1;

/// Evaluates a model second by second, in the order of time.
#[derive(Clone, Debug)]
pub struct Evaluator {
    model: ErrorModel,
    /// One past a term; only terms that follow a channel use theirs.
    pasts: [History; MAX_TERMS],
    channels: Vec<ChannelName, { super::MAX_CHANNELS }>,
    travel: Travel,
}

impl Evaluator {
    pub fn new(model: ErrorModel) -> Self {
        let channels = model.channels();
        Self { model, pasts: core::array::from_fn(|_| History::default()), channels, travel: Travel::default() }
    }

    pub fn model(&self) -> &ErrorModel {
        &self.model
    }

    /// Takes the next second; gives what turns its raw rate into a true one.
    pub fn second(&mut self, conditions: &Conditions) -> Correction {
        self.travel.push(conditions);
        for (term, past) in self.model.terms.iter().zip(&mut self.pasts) {
            let (name, low_pass_s) = match *term {
                Term::TemperatureRate { .. } => (ChannelName::new(TEMPERATURE), 0.0),
                Term::Channel { channel, low_pass_s, .. } | Term::ChannelRate { channel, low_pass_s, .. } => {
                    (Some(channel), low_pass_s)
                }
                Term::ChannelSpline { channel, .. } => (Some(channel), 0.0),
                _ => continue,
            };
            let value = name.and_then(|name| conditions.value(&name, &self.channels));
            past.push(conditions.t_s, value, low_pass_s);
        }
        let mut correction =
            Correction { bias_deg_h: self.model.bias_deg_h, scale: 1.0 + self.model.scale_error, waiting: false };
        for (term, past) in self.model.terms.iter().zip(&self.pasts) {
            self.add(term, past, conditions, &mut correction);
        }
        correction.bias_deg_h += self.of_rate_deg_h(conditions.raw_rate_deg_h - correction.bias_deg_h);
        correction
    }

    /// What the true rate x adds to itself, given the sum of both: the root of x + N(x) = sum by Newton's method.
    fn of_rate_deg_h(&self, sum_deg_h: f64) -> f64 {
        let added = |rate: f64| self.model.terms.iter().map(|term| term.of_rate_deg_h(rate)).sum::<f64>();
        let mut rate = sum_deg_h;
        for _ in 0..NEWTON_STEPS {
            let missed = rate + added(rate) - sum_deg_h;
            let slope = 1.0 + (added(rate + SLOPE_DEG_H) - added(rate - SLOPE_DEG_H)) / (2.0 * SLOPE_DEG_H);
            // A gyro that turns back where its input goes on has no single answer there; the step stays bounded.
            rate -= missed / slope.max(LEAST_SLOPE);
            if missed.abs() < 1e-12 {
                break;
            }
        }
        sum_deg_h - rate
    }

    /// What the rates of change add to the bias now, °/h. A recording's first seconds, when no rate is known yet, are
    /// corrected by the first one.
    pub fn rates_deg_h(&self) -> f64 {
        self.model.terms.iter().zip(&self.pasts).filter_map(|(term, past)| rate_deg_h(term, past)).sum()
    }

    fn add(&self, term: &Term, past: &History, conditions: &Conditions, correction: &mut Correction) {
        let above = |reference_c| conditions.temp_c.map_or(0.0, |temp_c| temp_c - reference_c);
        let hours = conditions.t_s / 3600.0;
        let Direction { cos, sin } = conditions.index.unwrap_or_default();
        correction.bias_deg_h += match *term {
            Term::Temperature { reference_c, linear_deg_h_per_k, quadratic_deg_h_per_k2 } => {
                let above_k = above(reference_c);
                (linear_deg_h_per_k + quadratic_deg_h_per_k2 * above_k) * above_k
            }
            Term::TemperatureRate { .. } | Term::ChannelRate { .. } => {
                let rate_deg_h = rate_deg_h(term, past);
                correction.waiting |= rate_deg_h.is_none();
                rate_deg_h.unwrap_or(0.0)
            }
            Term::ScaleTemperature { reference_c, per_k } => {
                correction.scale += per_k * above(reference_c);
                0.0
            }
            Term::Channel { lag_s, reference, linear_deg_h, quadratic_deg_h, cubic_deg_h, .. } => {
                let value = if lag_s > 0.0 { past.lagged(lag_s) } else { past.latest() };
                let u = value.map_or(0.0, |value| value - reference);
                ((cubic_deg_h * u + quadratic_deg_h) * u + linear_deg_h) * u
            }
            Term::ChannelSpline { knots, coefficients, .. } => {
                past.latest().map_or(0.0, |value| spline::at(knots.as_slice(), coefficients.as_slice(), value))
            }
            Term::ScaleChannel { channel, reference, per_unit } => {
                let value = conditions.value(&channel, &self.channels);
                correction.scale += per_unit * value.map_or(0.0, |value| value - reference);
                0.0
            }
            Term::Drift { deg_h_per_h, deg_h_per_h2 } => (deg_h_per_h + deg_h_per_h2 * hours) * hours,
            Term::WarmUp { deg_h, tau_s } => deg_h * libm::exp(-conditions.t_s.max(0.0) / tau_s),
            Term::Settling { .. } => self.settling_deg_h(term, conditions),
            Term::BodyHarmonic { order, cos_deg_h, sin_deg_h } => {
                let angle = f64::from(order) * libm::atan2(sin, cos);
                cos_deg_h * libm::cos(angle) + sin_deg_h * libm::sin(angle)
            }
            Term::Line { period_s, cos_deg_h, sin_deg_h } => {
                let phase = core::f64::consts::TAU * conditions.t_s / period_s;
                cos_deg_h * libm::cos(phase) + sin_deg_h * libm::sin(phase)
            }
            Term::Step { t_s, deg_h } => {
                // The share of the second that lies after the step.
                let after = (conditions.t_s - t_s) / conditions.seconds.max(f64::MIN_POSITIVE) + 0.5;
                deg_h * after.clamp(0.0, 1.0)
            }
            Term::RateNonlinearity { .. }
            | Term::DeadZone { .. }
            | Term::EarthField { .. }
            | Term::IndexError { .. }
            | Term::FreeLine { .. }
            | Term::BaseMotion { .. } => 0.0,
        };
    }

    /// What is left of the moves so far.
    fn settling_deg_h(&self, term: &Term, conditions: &Conditions) -> f64 {
        let &Term::Settling {
            tau_s,
            first_stay,
            deg_h,
            by_direction_deg_h,
            deg_h_per_deg_travel,
            deg_h_per_deg_signed_travel,
            cos_deg_h,
            sin_deg_h,
        } = term
        else {
            return 0.0;
        };
        let left = |each: &Move| {
            let direction = if each.travel_deg == 0.0 { 0.0 } else { libm::copysign(1.0, each.travel_deg) };
            let Direction { cos, sin } = each.index;
            let size = deg_h
                + by_direction_deg_h * direction
                + deg_h_per_deg_travel * each.travel_deg.abs()
                + deg_h_per_deg_signed_travel * each.travel_deg
                + cos_deg_h * cos
                + sin_deg_h * sin;
            size * libm::exp(-(conditions.t_s - each.ended_s).max(0.0) / tau_s)
        };
        self.travel.moves().filter(|each| first_stay || !each.switch_on).map(left).sum()
    }
}

/// A rate's contribution; `None` for other terms, and before a rate is known.
fn rate_deg_h(term: &Term, past: &History) -> Option<f64> {
    match *term {
        Term::TemperatureRate { deg_h_per_k_per_s } => {
            past.rate(RATE_SAMPLES, false).map(|rate| deg_h_per_k_per_s * rate)
        }
        Term::ChannelRate { deg_h_per_unit_per_s, seconds, curved, .. } => {
            past.rate(seconds.into(), curved).map(|rate| deg_h_per_unit_per_s * rate)
        }
        _ => None,
    }
}

impl ErrorModel {
    /// True direction of the index from the measured one.
    pub fn true_index(&self, measured: Direction) -> Direction {
        let Direction { cos, sin } = measured;
        let mut error_deg = 0.0;
        for term in &self.terms {
            if let Term::IndexError { offset_deg, cos_deg, sin_deg } = *term {
                error_deg += offset_deg + cos_deg * cos + sin_deg * sin;
            }
        }
        if error_deg == 0.0 {
            return measured;
        }
        // θ true = θ measured − error.
        let (s, c) = crate::units::sin_cos_deg(error_deg);
        Direction { cos: cos * c + sin * s, sin: sin * c - cos * s }
    }

    /// True azimuth from the one that the rates gave. A field of east e and north n adds e sin α + n cos α to h cos α:
    /// the sum is a cosine about the azimuth less atan(e / (h + n)).
    pub fn true_azimuth_deg(&self, azimuth_deg: f64, earth: &EarthRate) -> f64 {
        let (mut east, mut north) = (0.0, 0.0);
        for term in &self.terms {
            if let Term::EarthField { east_deg_h, north_deg_h } = *term {
                east += east_deg_h;
                north += north_deg_h;
            }
        }
        if east == 0.0 {
            return azimuth_deg;
        }
        wrap_360_deg(azimuth_deg + libm::atan2(east, earth.north_deg_h + north) * DEG_PER_RAD)
    }
}
