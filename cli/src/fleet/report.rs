//! What a fleet's file says, for a person: a table, and a page with the weights of all units drawn.

use std::io::{self, Write};

use north_finder::effects::effect::Port;

use super::file::{Fleet, HasEffect, Shared, UnitRecord};
use crate::count::counted;
use crate::report::{Axis, Legend, Plot, Side, escape, figure, page, table};

/// From this probability on a unit is called out of the family.
pub const OUTSIDE: f64 = 0.5;
/// Height of a drawing, pixels.
const HEIGHT: f64 = 240.0;

impl Fleet {
    /// Units that are out of the family rather than in it, the most certain first.
    pub fn outsiders(&self) -> Vec<&UnitRecord> {
        let mut outside: Vec<&UnitRecord> = self.records.iter().filter(|unit| unit.outside > OUTSIDE).collect();
        outside.sort_by(|a, b| b.outside.total_cmp(&a.outside));
        outside
    }

    /// Why a unit is out of the family, in words.
    pub fn reasons(&self, unit: &UnitRecord) -> String {
        let of_effect = |(shared, has): (&Shared, &HasEffect)| {
            let absent = 1.0 - has.family - has.own;
            if has.own > OUTSIDE {
                Some(format!("its own {}: {}", shared.name, weights(shared, &has.weights)))
            } else if absent > OUTSIDE && shared.share > OUTSIDE {
                Some(format!("no {}", shared.name))
            } else {
                None
            }
        };
        let others = unit.others.iter().map(|other| format!("also {}", other.name));
        let reasons: Vec<String> = self.effects.iter().zip(&unit.effects).filter_map(of_effect).chain(others).collect();
        if reasons.is_empty() { "several effects, each a little".into() } else { reasons.join("; ") }
    }
}

/// Unit of the port for a person.
fn unit(port: Port) -> &'static str {
    match port {
        Port::Rate => "°/h",
        Port::Scale => "1",
        Port::Index => "°",
        Port::Forward | Port::Left => "g",
    }
}

/// Weights with the unit of the port.
fn weights(shared: &Shared, weights: &[f64]) -> String {
    let unit = match unit(shared.port) {
        "1" => String::new(),
        unit => format!(" {unit}"),
    };
    let decimals = decimals(weights);
    weights.iter().map(|weight| format!("{weight:.decimals$}")).collect::<Vec<_>>().join(", ") + &unit
}

/// Decimals that give the greatest number four digits.
fn decimals(numbers: &[f64]) -> usize {
    let greatest = numbers.iter().fold(0.0, |greatest: f64, number| greatest.max(number.abs()));
    if greatest > 0.0 { (3.0 - greatest.log10().floor()).clamp(0.0, 12.0) as usize } else { 4 }
}

/// Prints the table.
pub fn write(out: &mut dyn Write, fleet: &Fleet) -> io::Result<()> {
    writeln!(out, "units      {}", fleet.units)?;
    if fleet.effects.is_empty() {
        writeln!(out, "effects    none that the units have in common")?;
    }
    for shared in &fleet.effects {
        writeln!(
            out,
            "effect     {}: {:.1} of the units have it, and a new one with a probability of {:.0} %",
            shared.name,
            shared.units,
            100.0 * shared.share
        )?;
        writeln!(
            out,
            "           mean {}, spread {}",
            weights(shared, &shared.mean),
            weights(shared, &shared.spread())
        )?;
    }
    let outside = fleet.outsiders();
    if outside.is_empty() {
        writeln!(out, "outside    no unit")?;
    }
    for unit in outside {
        writeln!(out, "outside    {} ({:.3}): {}", unit.name, unit.outside, fleet.reasons(unit))?;
    }
    Ok(())
}

/// The page.
pub fn html(fleet: &Fleet, title: &str) -> String {
    let head = [
        ("effect", false),
        ("a new unit has it", true),
        ("units that have it", true),
        ("mean", true),
        ("spread", true),
    ];
    let row = |shared: &Shared| {
        vec![
            format!("<code>{}</code>", escape(&shared.name)),
            format!("{:.0} %", 100.0 * shared.share),
            format!("{:.1}", shared.units),
            weights(shared, &shared.mean),
            weights(shared, &shared.spread()),
        ]
    };
    let effects: Vec<Vec<String>> = fleet.effects.iter().map(row).collect();
    let unit =
        |unit: &&UnitRecord| vec![escape(&unit.name), format!("{:.3}", unit.outside), escape(&fleet.reasons(unit))];
    let outside: Vec<Vec<String>> = fleet.outsiders().iter().map(unit).collect();
    let mut body = format!(
        "<h1>{}</h1>\n<p class=\"verdict\">{}. {}</p>\n",
        escape(title),
        counted(fleet.units, "unit"),
        match outside.len() {
            0 => "None of them is out of the family.".into(),
            1 => "One of them is out of the family.".into(),
            number => format!("{number} of them are out of the family."),
        }
    );
    if effects.is_empty() {
        body += "<p>They have no effect in common.</p>\n";
    } else {
        body += "<h2>What the units have in common</h2>\n";
        body += &table(&head, &effects);
        body += &fleet
            .effects
            .iter()
            .enumerate()
            .map(|(number, shared)| drawing(fleet, number, shared))
            .collect::<String>();
    }
    if !outside.is_empty() {
        body += "<h2>Out of the family</h2>\n";
        body += &table(&[("unit", false), ("probability", true), ("because of", false)], &outside);
    }
    page(title, &body)
}

/// The greatest weight of an effect by the number of the unit, with the family's mean and two sigma of its spread.
fn drawing(fleet: &Fleet, number: usize, shared: &Shared) -> String {
    let place =
        (0..shared.mean.len()).max_by(|&a, &b| shared.mean[a].abs().total_cmp(&shared.mean[b].abs())).unwrap_or(0);
    let drawn = |weights: &[f64]| weights.get(place).copied().unwrap_or(0.0);
    let weight = |has: &HasEffect| drawn(&has.weights);
    let units: Vec<(f64, &HasEffect)> =
        (1..).map(f64::from).zip(fleet.records.iter().filter_map(|unit| unit.effects.get(number))).collect();
    let (mean, spread) = (drawn(&shared.mean), drawn(&shared.spread()));
    let all: Vec<f64> =
        units.iter().map(|(_, has)| weight(has)).chain([mean - 2.0 * spread, mean + 2.0 * spread, 0.0]).collect();
    let which = match shared.mean.len() {
        1 => "its weight".into(),
        count => format!("the greatest of its {count} weights, number {},", place + 1),
    };
    let caption = format!(
        "<code>{}</code>: {which} in every unit, in the order of the file; filled dots: units that have it as the family, hollow ones: in a way of \
         their own or not at all. Lines: mean and two standard deviations from unit to unit.",
        escape(&shared.name)
    );
    figure(Legend::None, &format!("Weights of {} by unit", shared.name), &caption, |canvas| {
        let x = Axis::exact("unit", 0.0, units.len() as f64 + 1.0);
        let y = Axis::linear(format!("weight, {}", unit(shared.port)), all.iter().copied());
        let mut plot = Plot::new(canvas.width, HEIGHT, x, y);
        plot.level("line after", mean);
        plot.level("reference", mean - 2.0 * spread);
        plot.level("reference", mean + 2.0 * spread);
        let points = |in_family: bool| {
            let of = units.iter().filter(move |(_, has)| (has.family > OUTSIDE) == in_family);
            of.map(|(unit, has)| (*unit, weight(has))).collect::<Vec<_>>()
        };
        plot.dots(Side::After, points(true));
        plot.dots(Side::Before, points(false));
        vec![plot]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_number_has_four_digits() {
        let said = |numbers: &[f64]| {
            let decimals = decimals(numbers);
            numbers.iter().map(|number| format!("{number:.decimals$}")).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(said(&[0.000_3, -0.000_012]), "0.0003000 -0.0000120");
        assert_eq!(said(&[0.31, 1.5]), "0.310 1.500");
        assert_eq!((said(&[0.0]), said(&[12_345.6])), ("0.0000".into(), "12346".into()));
    }

    /// The weights of functions that are nothing for all units say nothing.
    #[test]
    fn the_page_draws_the_greatest_weight() {
        let shared = Shared {
            name: "x".into(),
            share: 0.8,
            units: 1.0,
            port: Port::Rate,
            factors: heapless::Vec::new(),
            mean: vec![0.0, -0.5, 0.2],
            covariance: vec![vec![0.01, 0.0, 0.0], vec![0.0, 0.01, 0.0], vec![0.0, 0.0, 0.01]],
            constant_spreads: Vec::new(),
        };
        let has = HasEffect { family: 1.0, own: 0.0, weights: vec![0.0, -0.4, 0.1] };
        let record = UnitRecord { name: "a".into(), outside: 0.0, effects: vec![has], others: Vec::new() };
        let page = html(&Fleet { units: 1, effects: vec![shared], records: vec![record] }, "t");
        assert!(
            page.contains("the greatest of its 3 weights, number 2, in every unit") && page.contains("weight, °/h")
        );
    }
}
