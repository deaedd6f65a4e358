//! `F.toml`: what the instruments of one type have in common, and how each unit that it was learned from stands to it.

use std::path::Path;

use learn::{Common, Family};
use nalgebra::DMatrix;
use north_finder::effects::effect::{Effect, MAX_FACTORS, Port};
use north_finder::effects::factor::Factor;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::diagnose::effect_name;
use crate::file_error::{FileError, Problem};
use crate::toml_file::TomlFile;

const FORMAT: i64 = 1;
/// No weight and no covariance of weights is beyond this: squares of either are still numbers.
const GREATEST: f64 = 1e30;
const PROBABILITY: &str = "a probability, 0 to 1";

/// A field that makes no sense.
struct Wrong {
    field: &'static str,
    value: String,
    allowed: String,
}

/// Sums of probabilities may be rounded to a little more than 1.
fn is_probability(number: f64) -> bool {
    (-1e-9..=1.0 + 1e-9).contains(&number)
}

fn are_numbers(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.abs() <= GREATEST)
}

/// A fleet, as its file holds it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fleet {
    /// How many units it was learned from.
    pub units: usize,
    #[serde(rename = "effect", default)]
    pub effects: Vec<Shared>,
    #[serde(rename = "unit", default)]
    pub records: Vec<UnitRecord>,
}

/// An effect of the type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shared {
    /// Its name, as a diagnosis gives it.
    pub name: String,
    /// Share of the units that have it, and how many of those it was learned from do.
    pub share: f64,
    pub units: f64,
    pub port: Port,
    /// As in a model file, with the usual constants.
    #[serde(default)]
    pub factors: heapless::Vec<Factor, MAX_FACTORS>,
    /// Mean of the weights, and their covariance from unit to unit, row by row.
    pub mean: Vec<f64>,
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviation of each constant of its factors from unit to unit, of the logarithm where it is a time or a width.
    #[serde(default)]
    pub constant_spreads: Vec<f64>,
}

/// How a unit stands to the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UnitRecord {
    pub name: String,
    /// Probability that it is out of the family.
    pub outside: f64,
    /// How it has each of the family's effects.
    #[serde(rename = "has", default)]
    pub effects: Vec<HasEffect>,
    /// Effects that it has by itself, with their probabilities.
    #[serde(default)]
    pub others: Vec<OtherEffect>,
}

/// How a unit has one effect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HasEffect {
    /// Probability that it has it as the others have it, and that it has it in a way of its own; it lacks it otherwise.
    pub family: f64,
    pub own: f64,
    /// Its weights in the likeliest way; 0 where it lacks it.
    pub weights: Vec<f64>,
}

/// An effect that a unit has by itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OtherEffect {
    pub name: String,
    pub probability: f64,
}

impl Fleet {
    /// Reads a file.
    ///
    /// Errors: no such file, not TOML, another format, unknown keys, values that make no sense, with their place.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let file = TomlFile::read(path)?;
        let fleet: Self = file.parse_format(FORMAT)?;
        fleet.check_units().map_err(|problem| file.at_field(None, "units", problem))?;
        let refused = |table: String, name: &str, wrong: Wrong| {
            let Wrong { field, value, allowed } = wrong;
            let kind = table.split('.').next().unwrap_or(&table);
            let problem = Problem::not_allowed(format!("{kind} {name}: {field} = {value}"), allowed);
            file.at_field(None, &format!("{table}.{field}"), problem)
        };
        for (number, shared) in fleet.effects.iter().enumerate() {
            shared.check(fleet.units).map_err(|wrong| refused(format!("effect.{number}"), &shared.name, wrong))?;
        }
        for (number, unit) in fleet.records.iter().enumerate() {
            let wrong = unit.check(&fleet.effects);
            wrong.map_err(|wrong| refused(format!("unit.{number}"), &unit.name, wrong))?;
        }
        Ok(fleet)
    }

    /// A fleet is learned from one unit at least, and from every one that is in it.
    fn check_units(&self) -> Result<(), Problem> {
        let least = self.records.len().max(1);
        match self.units < least {
            true => Err(Problem::not_allowed(format!("units = {}", self.units), format!("{least} or more"))),
            false => Ok(()),
        }
    }

    /// Writes a file, over one that may be there where that is allowed.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = toml::to_string(self).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
        crate::output::write(path, format!("format = {FORMAT}\n{text}")).map_err(|error| FileError::whole(path, error))
    }

    /// The prior of the next unit.
    pub fn family(&self) -> Family {
        Family { members: self.effects.iter().map(Shared::common).collect() }
    }
}

impl Shared {
    pub fn new(common: &Common) -> Self {
        Self {
            name: effect_name(&common.effect),
            share: common.share,
            units: common.units,
            port: common.effect.port,
            factors: common.effect.factors.clone(),
            mean: common.effect.weights.iter().map(|weight| f64::from(*weight)).collect(),
            covariance: common.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
            constant_spreads: common.spreads.clone(),
        }
    }

    fn common(&self) -> Common {
        let count = self.mean.len();
        let at = |i: usize, j: usize| self.covariance.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
        Common {
            effect: self.effect(),
            share: self.share,
            units: self.units,
            covariance: DMatrix::from_fn(count, count, |i, j| 0.5 * (at(i, j) + at(j, i))),
            spreads: self.constant_spreads.clone(),
        }
    }

    /// With the mean of its weights.
    pub fn effect(&self) -> Effect {
        let mut effect = Effect::new(self.port, &self.factors);
        effect.weights.iter_mut().zip(&self.mean).for_each(|(weight, mean)| *weight = *mean as f32);
        effect
    }

    /// Standard deviations of the weights from unit to unit.
    pub fn spread(&self) -> Vec<f64> {
        let own = |(i, row): (usize, &Vec<f64>)| row.get(i).copied().unwrap_or(0.0).max(0.0).sqrt();
        self.covariance.iter().enumerate().map(own).collect()
    }

    /// What makes no sense of a fleet of so many units, if something does.
    fn check(&self, units: usize) -> Result<(), Wrong> {
        let without_weights = Effect::new(self.port, &self.factors);
        without_weights.validate().map_err(|invalid| {
            let field = invalid.field.strip_prefix("model.effects.").unwrap_or("factors");
            Wrong { field, value: invalid.value.to_string(), allowed: invalid.allowed.into() }
        })?;
        let constants: usize = self.factors.iter().map(|factor| factor.constants().len()).sum();
        let count = without_weights.count();
        let wrong = |field, value, allowed: String| Err(Wrong { field, value, allowed });
        if !is_probability(self.share) {
            return wrong("share", self.share.to_string(), PROBABILITY.into());
        }
        // A sum of probabilities.
        if !(0.0..=units as f64 + 1e-6).contains(&self.units) {
            return wrong("units", self.units.to_string(), format!("a number from 0 to {units}"));
        }
        if self.mean.len() != count || !are_numbers(&self.mean) {
            return wrong("mean", format!("{:?}", self.mean), format!("{count} numbers within ±{GREATEST:e}"));
        }
        if self.covariance.len() != count || self.covariance.iter().any(|row| row.len() != count || !are_numbers(row)) {
            let allowed = format!("{count} rows of {count} numbers within ±{GREATEST:e}");
            return wrong("covariance", format!("{:?}", self.covariance), allowed);
        }
        if (0..count).any(|i| self.covariance[i][i] < 0.0) {
            return wrong("covariance", format!("{:?}", self.covariance), "variances that are not negative".into());
        }
        let is_spread = |spread: &f64| *spread >= 0.0 && spread.is_finite();
        if self.constant_spreads.len() != constants || !self.constant_spreads.iter().all(is_spread) {
            let allowed = format!("{constants} finite numbers that are not negative");
            return wrong("constant_spreads", format!("{:?}", self.constant_spreads), allowed);
        }
        Ok(())
    }
}

impl UnitRecord {
    /// What makes no sense beside the effects of the type, if something does.
    fn check(&self, effects: &[Shared]) -> Result<(), Wrong> {
        if !is_probability(self.outside) {
            return Err(Wrong { field: "outside", value: self.outside.to_string(), allowed: PROBABILITY.into() });
        }
        if self.effects.len() != effects.len() {
            let value = format!("{} tables", self.effects.len());
            return Err(Wrong { field: "has", value, allowed: "one for every effect".into() });
        }
        for (has, shared) in self.effects.iter().zip(effects) {
            let (name, count) = (&shared.name, shared.mean.len());
            let wrong = |value, allowed| Err(Wrong { field: "has", value, allowed });
            if !(is_probability(has.family) && is_probability(has.own)) {
                let HasEffect { family, own, .. } = has;
                return wrong(format!("family {family}, own {own} of {name}"), "probabilities, 0 to 1".into());
            }
            if has.weights.len() != count || !are_numbers(&has.weights) {
                let allowed = format!("{count} numbers within ±{GREATEST:e}");
                return wrong(format!("weights {:?} of {name}", has.weights), allowed);
            }
        }
        match self.others.iter().find(|other| !is_probability(other.probability)) {
            Some(OtherEffect { name, probability }) => {
                let value = format!("probability {probability} of {name}");
                Err(Wrong { field: "others", value, allowed: PROBABILITY.into() })
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fleet() -> Fleet {
        let mut effect = Effect::new(Port::Scale, &[]);
        effect.weights.copy_from_slice(&[0.25]);
        let covariance = DMatrix::from_element(1, 1, 0.0025);
        let shared = Shared::new(&Common { effect, share: 0.75, units: 3.5, covariance, spreads: Vec::new() });
        let has = HasEffect { family: 0.9, own: 0.05, weights: vec![0.2] };
        let record = UnitRecord { name: "unit-7".into(), outside: 0.125, effects: vec![has], others: Vec::new() };
        Fleet { units: 4, effects: vec![shared], records: vec![record] }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.toml");
        fleet().write(&path).unwrap();
        let read = Fleet::read(&path).unwrap();
        assert_eq!(read, fleet());
        assert_eq!((read.effects[0].name.as_str(), read.effects[0].spread()), ("scale-factor", vec![0.05]));
        assert_eq!(read.family().members[0].effect.weights[0], 0.25);
    }

    #[test]
    fn what_makes_no_sense_is_refused_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let refusal = |change: &dyn Fn(&mut Fleet)| {
            let mut fleet = fleet();
            change(&mut fleet);
            let path = folder.path().join("f.toml");
            std::fs::write(&path, format!("format = 1\n{}", toml::to_string(&fleet).unwrap())).unwrap();
            Fleet::read(&path).unwrap_err().to_string()
        };
        assert!(refusal(&|fleet| fleet.effects[0].share = 1.5).contains("share = 1.5"));
        let none = refusal(&|fleet| fleet.units = 0);
        assert!(none.contains("line 2, column 9") && none.contains("\"units = 0\" is not allowed"), "{none}");
        assert!(refusal(&|fleet| (fleet.units, fleet.records) = (0, Vec::new())).contains("allowed is 1 or more"));
        assert!(refusal(&|fleet| fleet.effects[0].units = 4.5).contains("allowed is a number from 0 to 4"));
        assert!(refusal(&|fleet| fleet.effects[0].mean.push(1.0)).contains("mean = [0.25, 1.0]"));
        assert!(refusal(&|fleet| fleet.effects[0].covariance[0][0] = -1.0).contains("not negative"));
        assert!(refusal(&|fleet| fleet.effects[0].constant_spreads.push(1.0)).contains("constant_spreads"));
        assert!(refusal(&|fleet| fleet.records[0].outside = -0.1).contains("unit unit-7: outside = -0.1"));
        assert!(refusal(&|fleet| fleet.records[0].effects.clear()).contains("one for every effect"));
        let units = refusal(&|fleet| fleet.effects[0].units = f64::NAN);
        assert!(units.contains("line 7, column 9") && units.contains("effect scale-factor: units = NaN"), "{units}");
        assert!(refusal(&|fleet| fleet.effects[0].mean[0] = f64::INFINITY).contains("mean = [inf]"));
        assert!(refusal(&|fleet| fleet.effects[0].covariance[0][0] = 1e300).contains("covariance = [[1e300]]"));
        let has = refusal(&|fleet| fleet.records[0].effects[0].family = 7.0);
        assert!(has.contains("unit unit-7: has = family 7, own 0.05 of scale-factor"), "{has}");
        assert!(refusal(&|fleet| fleet.records[0].effects[0].weights.clear()).contains("weights [] of scale-factor"));
        let other = OtherEffect { name: "x".into(), probability: 9.0 };
        let others = refusal(&|fleet| fleet.records[0].others.push(other.clone()));
        assert!(others.contains("others = probability 9 of x"), "{others}");
    }
}
