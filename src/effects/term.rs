//! The effects that a model can hold.

use serde::{Deserialize, Serialize};

use super::channel::{ChannelName, FORWARD, LEFT, TEMPERATURE};
use super::spline::{MAX_KNOTS, Numbers};
use crate::limits::Invalid;

/// An effect. Unless it says otherwise it adds to the raw rate. Time constants are above 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Term {
    /// linear · (T − reference) + quadratic · (T − reference)², °/h.
    Temperature { reference_c: f64, linear_deg_h_per_k: f64, quadratic_deg_h_per_k2: f64 },
    /// Proportional to dT/dt, °/h per K/s (Shupe, Applied Optics 19, 1980, p. 654).
    TemperatureRate { deg_h_per_k_per_s: f64 },
    /// Scale factor error proportional to T − reference, 1/K.
    ScaleTemperature { reference_c: f64, per_k: f64 },
    /// A cubic in u = (value − reference) of a channel, °/h per unit, unit² and unit³. The value is that of `lag_s`
    /// seconds ago (0 … 30), or, with `low_pass_s` above 0, what a first-order low-pass of that time constant makes of it.
    Channel {
        channel: ChannelName,
        lag_s: f64,
        low_pass_s: f64,
        reference: f64,
        linear_deg_h: f64,
        quadratic_deg_h: f64,
        cubic_deg_h: f64,
    },
    /// A curve in a channel's value, °/h: a natural cubic spline through three to seven rising knots, straight beyond the
    /// outer ones; one coefficient fewer than knots, °/h per unit ([`super::spline::basis`]).
    ChannelSpline { channel: ChannelName, knots: Numbers, coefficients: Numbers },
    /// Proportional to the channel's rate of change (of the low-passed channel with `low_pass_s` above 0), a slope over the
    /// last `seconds` (3 … 30), °/h per unit/s: of a straight line, or, `curved`, of a parabola at its end.
    ChannelRate { channel: ChannelName, low_pass_s: f64, seconds: u8, curved: bool, deg_h_per_unit_per_s: f64 },
    /// Scale factor error proportional to value − reference, 1/unit.
    ScaleChannel { channel: ChannelName, reference: f64, per_unit: f64 },
    /// linear · t + quadratic · t², t in hours since switch-on.
    Drift { deg_h_per_h: f64, deg_h_per_h2: f64 },
    /// amplitude · exp(−t/τ), t since switch-on.
    WarmUp { deg_h: f64, tau_s: f64 },
    /// Every move leaves something behind that dies away with exp(−t/τ), t since the index came to rest; what is left of the
    /// last eight moves adds up. Its size is a sum: constant, by the sign of the move, per degree of its travel without and
    /// with sign (counter-clockwise positive), and by cosine and sine of the index angle that it led to. `first_stay`:
    /// switch-on counts as a move too.
    Settling {
        tau_s: f64,
        first_stay: bool,
        deg_h: f64,
        by_direction_deg_h: f64,
        deg_h_per_deg_travel: f64,
        deg_h_per_deg_signed_travel: f64,
        cos_deg_h: f64,
        sin_deg_h: f64,
    },
    /// cos_deg_h · cos(order · θ) + sin_deg_h · sin(order · θ): fixed to the instrument's body.
    BodyHarmonic { order: u8, cos_deg_h: f64, sin_deg_h: f64 },
    /// quadratic · ω² + cubic · ω³. ω, °/h, is the rate without the effects of rate and without all others, less `centre`: the
    /// gyro's usual bias, where this is not a part of what is distorted, else 0.
    RateNonlinearity { centre_deg_h: f64, quadratic_per_deg_h: f64, cubic_per_deg_h2: f64 },
    /// Lost near zero rate, at most `depth`, there where ω = ± width; ω as above.
    DeadZone { centre_deg_h: f64, depth_deg_h: f64, width_deg_h: f64, form: DeadZoneForm },
    /// cos_deg_h · cos(2πt/period) + sin_deg_h · sin(2πt/period), t since switch-on.
    Line { period_s: f64, cos_deg_h: f64, sin_deg_h: f64 },
    /// A line whose phase is another in every fix, with its typical amplitude: the solution estimates its parts.
    FreeLine { period_s: f64, amplitude_deg_h: f64 },
    /// Added from `t_s` since switch-on.
    Step { t_s: f64, deg_h: f64 },
    /// Fixed to the Earth: east_deg_h · sin α + north_deg_h · cos α, α the axis' azimuth. Turns the answer.
    EarthField { east_deg_h: f64, north_deg_h: f64 },
    /// The index angle reads too large by offset + cos_deg · cos θ + sin_deg · sin θ, degrees.
    IndexError { offset_deg: f64, cos_deg: f64, sin_deg: f64 },
    /// The base turns: what the accelerometers feel of it is taken out row by row. `velocity`: their noise is white in the
    /// velocity (counts of velocity increments, shocks), not in the acceleration. `lag_s`: they read this much later than
    /// the gyro (−10 … 10).
    BaseMotion { velocity: bool, lag_s: f64 },
}

/// How the loss about zero rate goes with x = ω/width; 1 at x = 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeadZoneForm {
    /// x · exp((1 − x²)/2): gone well beyond the width.
    Short,
    /// x · exp(1 − |x|).
    Middle,
    /// 2x/(1 + x²): a long tail.
    Long,
    /// x up to the width, beyond x − √(x² − 1): two waves that lock (Aronowitz, The laser gyro, 1971).
    Lock,
}

impl DeadZoneForm {
    /// The loss at `x`, odd.
    pub fn at(self, x: f64) -> f64 {
        match self {
            Self::Short => x * libm::exp(0.5 * (1.0 - x * x)),
            Self::Middle => x * libm::exp(1.0 - x.abs()),
            Self::Long => 2.0 * x / (1.0 + x * x),
            Self::Lock if x.abs() <= 1.0 => x,
            Self::Lock => x - libm::copysign(libm::sqrt(x * x - 1.0), x),
        }
    }
}

impl Term {
    /// Lower-case name, as in a model file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Temperature { .. } => "temperature",
            Self::TemperatureRate { .. } => "temperature-rate",
            Self::ScaleTemperature { .. } => "scale-temperature",
            Self::Channel { .. } => "channel",
            Self::ChannelSpline { .. } => "channel-spline",
            Self::ChannelRate { .. } => "channel-rate",
            Self::ScaleChannel { .. } => "scale-channel",
            Self::Drift { .. } => "drift",
            Self::WarmUp { .. } => "warm-up",
            Self::Settling { .. } => "settling",
            Self::BodyHarmonic { .. } => "body-harmonic",
            Self::RateNonlinearity { .. } => "rate-nonlinearity",
            Self::DeadZone { .. } => "dead-zone",
            Self::Line { .. } => "line",
            Self::FreeLine { .. } => "free-line",
            Self::Step { .. } => "step",
            Self::EarthField { .. } => "earth-field",
            Self::IndexError { .. } => "index-error",
            Self::BaseMotion { .. } => "base-motion",
        }
    }

    /// The channel that it follows beyond the gyro's own temperature.
    pub fn channel(&self) -> Option<ChannelName> {
        match *self {
            Self::Channel { channel, .. }
            | Self::ChannelSpline { channel, .. }
            | Self::ChannelRate { channel, .. }
            | Self::ScaleChannel { channel, .. } => Some(channel),
            _ => None,
        }
    }

    /// The board's own channels that it cannot do without.
    pub fn needs(&self) -> &'static [&'static str] {
        match self {
            Self::Temperature { .. } | Self::TemperatureRate { .. } | Self::ScaleTemperature { .. } => &[TEMPERATURE],
            Self::BaseMotion { .. } => &[FORWARD],
            _ => match self.channel().as_ref().map(ChannelName::as_str) {
                Some(TEMPERATURE) => &[TEMPERATURE],
                Some(FORWARD | LEFT) => &[FORWARD],
                _ => &[],
            },
        }
    }

    /// What it adds to a true rate, °/h, because of that rate; 0 for other effects.
    pub fn of_rate_deg_h(&self, rate_deg_h: f64) -> f64 {
        match *self {
            Self::RateNonlinearity { centre_deg_h, quadratic_per_deg_h, cubic_per_deg_h2 } => {
                let rate = rate_deg_h - centre_deg_h;
                (quadratic_per_deg_h + cubic_per_deg_h2 * rate) * rate * rate
            }
            Self::DeadZone { centre_deg_h, depth_deg_h, width_deg_h, form } => {
                -depth_deg_h * form.at((rate_deg_h - centre_deg_h) / width_deg_h)
            }
            _ => 0.0,
        }
    }

    /// Whether it is a rate of change, which a few seconds must pass for.
    pub fn is_rate(&self) -> bool {
        matches!(self, Self::TemperatureRate { .. } | Self::ChannelRate { .. })
    }

    /// Every number finite, time constants and widths positive, lags and orders in their range.
    pub fn validate(&self) -> Result<(), Invalid> {
        let finite = |field, values: &[f64]| match values.iter().find(|value| !value.is_finite()) {
            Some(&value) => Err(Invalid { field, value, allowed: "a finite number" }),
            None => Ok(()),
        };
        let positive = |field, value: f64| match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => Err(Invalid { field, value, allowed: "a finite number above 0" }),
        };
        let within = |field, value: f64, low: f64, high: f64, allowed| match (low..=high).contains(&value) {
            true => Ok(()),
            false => Err(Invalid { field, value, allowed }),
        };
        let filter = |value| within("model.terms.low_pass_s", value, 0.0, 1e6, "0 (none) to 1000000");
        match *self {
            Self::Temperature { reference_c, linear_deg_h_per_k, quadratic_deg_h_per_k2 } => {
                finite("model.terms.temperature", &[reference_c, linear_deg_h_per_k, quadratic_deg_h_per_k2])
            }
            Self::TemperatureRate { deg_h_per_k_per_s } => finite("model.terms.temperature-rate", &[deg_h_per_k_per_s]),
            Self::ScaleTemperature { reference_c, per_k } => {
                finite("model.terms.scale-temperature", &[reference_c, per_k])
            }
            Self::Channel { lag_s, low_pass_s, reference, linear_deg_h, quadratic_deg_h, cubic_deg_h, .. } => {
                within("model.terms.channel.lag_s", lag_s, 0.0, 30.0, "0 to 30")?;
                filter(low_pass_s)?;
                finite("model.terms.channel", &[reference, linear_deg_h, quadratic_deg_h, cubic_deg_h])
            }
            Self::ChannelSpline { knots, coefficients, .. } => {
                let (knots, coefficients) = (knots.as_slice(), coefficients.as_slice());
                let number = knots.len() as f64;
                within("model.terms.channel-spline.knots (number)", number, 3.0, MAX_KNOTS as f64, "3 to 7")?;
                if coefficients.len() + 1 != knots.len() {
                    let field = "model.terms.channel-spline.coefficients (number)";
                    return Err(Invalid { field, value: coefficients.len() as f64, allowed: "one fewer than knots" });
                }
                for pair in knots.windows(2) {
                    if let &[below, above] = pair
                        && !(above > below)
                    {
                        let field = "model.terms.channel-spline.knots";
                        return Err(Invalid { field, value: above, allowed: "above the knot before it" });
                    }
                }
                finite("model.terms.channel-spline", knots)?;
                finite("model.terms.channel-spline", coefficients)
            }
            Self::ChannelRate { low_pass_s, seconds, deg_h_per_unit_per_s, .. } => {
                filter(low_pass_s)?;
                within("model.terms.channel-rate.seconds", seconds.into(), 3.0, 30.0, "3 to 30")?;
                finite("model.terms.channel-rate", &[deg_h_per_unit_per_s])
            }
            Self::ScaleChannel { reference, per_unit, .. } => {
                finite("model.terms.scale-channel", &[reference, per_unit])
            }
            Self::Drift { deg_h_per_h, deg_h_per_h2 } => finite("model.terms.drift", &[deg_h_per_h, deg_h_per_h2]),
            Self::WarmUp { deg_h, tau_s } => {
                positive("model.terms.warm-up.tau_s", tau_s)?;
                finite("model.terms.warm-up", &[deg_h])
            }
            Self::Settling {
                tau_s,
                first_stay: _,
                deg_h,
                by_direction_deg_h,
                deg_h_per_deg_travel,
                deg_h_per_deg_signed_travel,
                cos_deg_h,
                sin_deg_h,
            } => {
                positive("model.terms.settling.tau_s", tau_s)?;
                let by_travel = [deg_h_per_deg_travel, deg_h_per_deg_signed_travel];
                finite("model.terms.settling", &[deg_h, by_direction_deg_h, cos_deg_h, sin_deg_h])?;
                finite("model.terms.settling", &by_travel)
            }
            Self::BodyHarmonic { order, cos_deg_h, sin_deg_h } => {
                within("model.terms.body-harmonic.order", order.into(), 1.0, 36.0, "1 to 36")?;
                finite("model.terms.body-harmonic", &[cos_deg_h, sin_deg_h])
            }
            Self::RateNonlinearity { centre_deg_h, quadratic_per_deg_h, cubic_per_deg_h2 } => {
                finite("model.terms.rate-nonlinearity", &[centre_deg_h, quadratic_per_deg_h, cubic_per_deg_h2])
            }
            Self::DeadZone { centre_deg_h, depth_deg_h, width_deg_h, .. } => {
                positive("model.terms.dead-zone.width_deg_h", width_deg_h)?;
                finite("model.terms.dead-zone", &[centre_deg_h, depth_deg_h])
            }
            Self::Line { period_s, cos_deg_h, sin_deg_h } => {
                positive("model.terms.line.period_s", period_s)?;
                finite("model.terms.line", &[cos_deg_h, sin_deg_h])
            }
            Self::FreeLine { period_s, amplitude_deg_h } => {
                positive("model.terms.free-line.period_s", period_s)?;
                positive("model.terms.free-line.amplitude_deg_h", amplitude_deg_h)
            }
            Self::Step { t_s, deg_h } => finite("model.terms.step", &[t_s, deg_h]),
            Self::EarthField { east_deg_h, north_deg_h } => {
                finite("model.terms.earth-field", &[east_deg_h, north_deg_h])
            }
            Self::IndexError { offset_deg, cos_deg, sin_deg } => {
                finite("model.terms.index-error", &[offset_deg, cos_deg, sin_deg])
            }
            Self::BaseMotion { lag_s, .. } => within("model.terms.base-motion.lag_s", lag_s, -10.0, 10.0, "-10 to 10"),
        }
    }
}
