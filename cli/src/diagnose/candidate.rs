//! A candidate effect: a part of the error model whose coefficients, and whose one non-linear constant, are to be found.

use std::collections::BTreeMap;

use north_finder::effects::basis::curve::Curve;
use north_finder::effects::basis::curve::function::Function;
use north_finder::effects::basis::curve::signal::Signal;
use north_finder::effects::basis::harmonic::BodyHarmonic;
use north_finder::effects::channel::{FORWARD, LEFT};
use north_finder::effects::{
    Basis, ChannelName, Conditions, EarthField, ErrorModel, Evaluator, IndexError, MAX_CHANNELS, RateTerm, Term,
    TooMany,
};
use north_finder::index::Direction;

use super::base_turning;
use crate::run_data::{RunData, Sample};

/// Seconds that wait for the first rate of change, as in the firmware's replay.
const HELD: usize = 16;

/// What a candidate is, apart from its coefficients and its one non-linear constant.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // A few hundred candidates, made once: a box each would save nothing.
pub enum Part {
    Term(Term),
    Rate(RateTerm),
    ScaleFactor,
    /// East alone, or east and north.
    EarthField {
        north: bool,
    },
    IndexOffset,
    IndexEccentricity,
    /// Bias of the level sensors, with the Earth's vertical rate.
    LevelBias {
        up_deg_h: f64,
    },
    /// In proportion to the specific force along the sensitive axis, by its tilt: a gyro sensitive to gravity.
    AxisTilt,
    BaseMotion,
}

/// A candidate effect.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub name: String,
    pub kind: &'static str,
    pub channel: Option<String>,
    pub part: Part,
    /// Values of the non-linear constant to begin with; empty where there is none.
    pub grid: Vec<f64>,
}

/// Columns of a run: one a coefficient, one value a sample, °/h.
pub type Columns = Vec<Vec<f64>>;

impl Candidate {
    /// A term, of whose constant the grid is tried.
    pub fn term(term: Term, grid: Vec<f64>) -> Self {
        let channels: Vec<&str> = term.channels().map(ChannelName::as_str).collect();
        Self {
            name: term.to_string(),
            kind: if term.scales { "scale" } else { "bias" },
            channel: (!channels.is_empty()).then(|| channels.join(" and ")),
            part: Part::Term(term),
            grid,
        }
    }

    /// Any other part.
    pub fn new(name: impl Into<String>, kind: &'static str, part: Part, grid: Vec<f64>) -> Self {
        Self { name: name.into(), kind, channel: None, part, grid }
    }

    /// Its name, with the channel where that does not say it.
    pub fn full_name(&self) -> String {
        match &self.channel {
            Some(channel) if channel != "temp_c" => format!("{}:{channel}", self.name),
            _ => self.name.clone(),
        }
    }

    /// The columns that it depends on.
    pub fn channels(&self) -> Vec<String> {
        match &self.part {
            Part::Term(term) => {
                let mut names: Vec<String> = term.channels().map(|name| name.as_str().to_owned()).collect();
                names.dedup();
                names
            }
            _ => self.channel.iter().cloned().collect(),
        }
    }

    /// Its basis, where it is a term.
    pub fn basis(&self) -> Option<&Basis> {
        match &self.part {
            Part::Term(term) => Some(&term.basis),
            _ => None,
        }
    }

    pub fn is_base_motion(&self) -> bool {
        self.part == Part::BaseMotion
    }

    /// Whether it is a curve through knots.
    pub fn is_spline(&self) -> bool {
        matches!(self.basis(), Some(Basis::Curve(curve)) if matches!(curve.function, Function::Spline(_)))
    }

    /// Number of coefficients.
    pub fn coefficients(&self) -> usize {
        match &self.part {
            Part::Term(term) => term.count(),
            Part::EarthField { north } => 1 + usize::from(*north),
            Part::IndexEccentricity | Part::LevelBias { .. } => 2,
            Part::Rate(_) | Part::ScaleFactor | Part::IndexOffset | Part::AxisTilt | Part::BaseMotion => 1,
        }
    }

    /// Whether its columns depend on the rate, or on the azimuth of the run.
    pub fn follows_rate(&self) -> bool {
        match &self.part {
            Part::Term(term) => term.scales,
            Part::LevelBias { .. } | Part::AxisTilt | Part::BaseMotion => false,
            _ => true,
        }
    }

    /// Fitted constants in all.
    pub fn freedom(&self) -> usize {
        self.coefficients() + usize::from(!self.grid.is_empty())
    }

    /// Its term with the constant.
    fn placed(&self, term: &Term, constant: f64) -> Term {
        if self.grid.is_empty() { term.clone() } else { term.clone().with_constant(constant) }
    }

    /// Puts it into a model, with these coefficients and constant.
    pub fn put(&self, constant: f64, c: &[f64], model: &mut ErrorModel) -> Result<(), TooMany> {
        let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
        match &self.part {
            Part::Term(term) => model.add(self.placed(term, constant).with_coefficients(c))?,
            Part::Rate(term) => model.add_rate_term(term.with_constant(constant).with_coefficient(at(0)))?,
            Part::ScaleFactor => model.scale_error += at(0),
            Part::EarthField { .. } => {
                let field = model.earth_field.get_or_insert(EarthField::default());
                field.east_deg_h += at(0);
                field.north_deg_h += at(1);
            }
            Part::IndexOffset => model.index_error.get_or_insert(IndexError::default()).offset_deg += at(0),
            Part::IndexEccentricity => {
                let error = model.index_error.get_or_insert(IndexError::default());
                error.cos_deg += at(0);
                error.sin_deg += at(1);
            }
            Part::LevelBias { up_deg_h } => {
                let harmonic = Term::new(Basis::BodyHarmonic(BodyHarmonic { order: 1 }));
                model.add(harmonic.with_coefficients(&[-up_deg_h * at(0), -up_deg_h * at(1)]))?;
            }
            Part::AxisTilt => {
                let axes = [FORWARD, LEFT].map(ChannelName::new).into_iter().flatten();
                for (channel, pair) in axes.zip([[at(0), 0.0], [0.0, at(0)]]) {
                    let harmonic = Basis::BodyHarmonic(BodyHarmonic { order: 1 });
                    model.add(Term::product(harmonic, plain(channel)).with_coefficients(&pair))?;
                }
            }
            // The solver takes the accelerometers' measure of a slow creep out by itself.
            Part::BaseMotion => {}
        }
        Ok(())
    }

    /// Names of the coefficients, and of the constant, as documented.
    fn parameter_names(&self) -> (&'static [&'static str], Option<&'static str>) {
        match &self.part {
            Part::Term(term) if term.scales && self.channel.as_deref() == Some("temp_c") => (&["per_k"], None),
            Part::Term(term) if term.scales => (&["per_unit"], None),
            Part::Term(term) => (term.basis.coefficient_names(), term.constant().map(|each| each.0)),
            Part::Rate(term) => match term.parameter_names() {
                ("per_deg_h", constant) => (&["per_deg_h"], constant),
                ("per_deg_h2", constant) => (&["per_deg_h2"], constant),
                (_, constant) => (&["depth_deg_h"], constant),
            },
            Part::ScaleFactor => (&["scale_error"], None),
            Part::EarthField { .. } => (&["east_deg_h", "north_deg_h"], None),
            Part::IndexOffset => (&["offset_deg"], None),
            Part::IndexEccentricity => (&["cos_deg", "sin_deg"], None),
            Part::LevelBias { .. } => (&["forward_g", "left_g"], None),
            Part::AxisTilt => (&["deg_h_per_g"], None),
            Part::BaseMotion => (&["gain"], Some("window_s")),
        }
    }

    /// Parameters by name.
    pub fn named(&self, constant: f64, coefficients: &[f64]) -> BTreeMap<String, f64> {
        let (names, constant_name) = self.parameter_names();
        let mut map: BTreeMap<_, _> =
            names.iter().map(|name| (*name).to_owned()).zip(coefficients.iter().copied()).collect();
        // Functions of a product have no names of their own.
        map.extend(coefficients.iter().enumerate().skip(names.len()).map(|(i, c)| (format!("function_{}", i + 1), *c)));
        map.extend(constant_name.filter(|_| !self.grid.is_empty()).map(|name| (name.to_owned(), constant)));
        map
    }

    /// Whether the other is this one with more freedom, or less: the same cause in another form.
    pub fn same_cause(&self, other: &Self) -> bool {
        if self.channel != other.channel {
            return false;
        }
        match (&self.part, &other.part) {
            (Part::Term(a), Part::Term(b)) if a.scales == b.scales && a.times == b.times => {
                match (&a.basis, &b.basis) {
                    (Basis::Curve(a), Basis::Curve(b)) => a.signal.is_rate() == b.signal.is_rate(),
                    (Basis::Drift(_), Basis::Drift(_)) => true,
                    (Basis::Settling(a), Basis::Settling(b)) => a.by == b.by,
                    (a, b) => a == b,
                }
            }
            (Part::Rate(RateTerm::DeadZone { .. }), Part::Rate(RateTerm::DeadZone { .. })) => true,
            (Part::Rate(RateTerm::Power { power: a, .. }), Part::Rate(RateTerm::Power { power: b, .. })) => a == b,
            (Part::EarthField { .. }, Part::EarthField { .. }) => true,
            (a, b) => a == b,
        }
    }

    /// The columns of a run: what unit coefficients add to the rate. `rate_deg_h` is each sample's rate by the fit so
    /// far, without effects, `azimuth_deg` the run's azimuth.
    pub fn columns(&self, run: &RunData, constant: f64, rate_deg_h: &[f64], azimuth_deg: f64) -> Columns {
        let psi = azimuth_deg.to_radians();
        let h = run.earth.north_deg_h;
        let sin_alpha = |sample: &Sample| psi.sin() * sample.cos - psi.cos() * sample.sin;
        let cos_alpha = |sample: &Sample| psi.cos() * sample.cos + psi.sin() * sample.sin;
        // A reading too large by δ: ω = h cos(ψ − θ + δ), dω/dδ = −h sin(ψ − θ).
        let turned = |sample: &Sample| -1f64.to_radians() * h * sin_alpha(sample);
        let of = |value: &dyn Fn(&Sample) -> f64| run.samples.iter().map(value).collect::<Vec<f64>>();
        match &self.part {
            Part::Term(term) => evaluated(run, self.placed(term, constant), rate_deg_h),
            Part::Rate(term) => {
                let term = term.with_constant(constant).with_coefficient(1.0);
                vec![rate_deg_h.iter().map(|rate| term.of_rate_deg_h(*rate)).collect()]
            }
            Part::EarthField { north: false } => vec![of(&sin_alpha)],
            Part::EarthField { north: true } => vec![of(&sin_alpha), of(&cos_alpha)],
            Part::ScaleFactor => vec![of(&|sample| h * cos_alpha(sample))],
            Part::IndexOffset => vec![of(&turned)],
            Part::IndexEccentricity => {
                vec![of(&|sample| turned(sample) * sample.cos), of(&|sample| turned(sample) * sample.sin)]
            }
            Part::LevelBias { up_deg_h } => {
                vec![of(&|sample| -up_deg_h * sample.cos), of(&|sample| -up_deg_h * sample.sin)]
            }
            Part::AxisTilt => {
                vec![of(&|sample| {
                    sample.level.map_or(0.0, |level| sample.cos * level.forward + sample.sin * level.left)
                })]
            }
            Part::BaseMotion => vec![base_turning::column(run, constant)],
        }
    }
}

/// A channel as it is.
fn plain(channel: ChannelName) -> Basis {
    Basis::Curve(Curve { channel, signal: Signal::Value, function: Function::Powers { reference: 0.0, degree: 1 } })
}

/// The functions of a term by the firmware's own evaluation.
pub fn evaluated(run: &RunData, term: Term, rate_deg_h: &[f64]) -> Columns {
    let (scales, count) = (term.scales, term.count());
    let mut model = ErrorModel::default();
    let _ = model.add(term);
    let slots: Vec<Option<&Vec<f64>>> = model
        .channels()
        .iter()
        .map(|name| run.names.iter().position(|each| each == name.as_str()).map(|slot| &run.channels[slot]))
        .collect();
    let mut evaluator = Evaluator::new(model);
    let mut columns: Columns = vec![Vec::with_capacity(run.samples.len()); count];
    let mut held = 0;
    for (k, (sample, &rate)) in run.samples.iter().zip(rate_deg_h).enumerate() {
        let mut channels = [f64::NAN; MAX_CHANNELS];
        for (value, slot) in channels.iter_mut().zip(&slots) {
            *value = slot.map_or(f64::NAN, |values| values[k]);
        }
        let conditions = Conditions {
            t_s: sample.t_s,
            seconds: sample.seconds,
            raw_rate_deg_h: rate,
            index: Some(Direction { cos: sample.cos, sin: sample.sin }),
            temp_c: sample.temp_c,
            level: sample.level,
            channels,
        };
        let factor = if scales { rate } else { 1.0 };
        columns.iter_mut().for_each(|column| column.push(0.0));
        let correction = evaluator.tapped(&conditions, &mut |place, value| columns[place][k] = factor * value);
        if correction.waiting && held < HELD {
            held += 1;
        } else if held > 0 {
            for column in &mut columns {
                let first_known = column[k];
                column[k - held..k].iter_mut().for_each(|value| *value = first_known);
            }
            held = 0;
        }
    }
    columns
}
