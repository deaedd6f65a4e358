//! What a fleet's file says, for a person: a table, and a page with the weights of all units drawn.

use std::io::{self, Write};

use super::file::{Fleet, HasEffect, Shared, UnitRecord};
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

/// Weights with the unit of the port.
fn weights(shared: &Shared, weights: &[f64]) -> String {
    let unit = match shared.port.unit() {
        "1" => String::new(),
        unit => format!(" {unit}"),
    };
    weights.iter().map(|weight| format!("{weight:.4}")).collect::<Vec<_>>().join(", ") + &unit
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
            "effect     {}: {:.0} % of the units ({:.1} of them)",
            shared.name,
            100.0 * shared.share,
            shared.units
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
    let head = [("effect", false), ("share", true), ("units", true), ("mean", true), ("spread", true)];
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
        "<h1>{}</h1>\n<p class=\"verdict\">{} units. {}</p>\n",
        escape(title),
        fleet.units,
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

/// The first weight of an effect by the number of the unit, with the family's mean and two sigma of its spread.
fn drawing(fleet: &Fleet, number: usize, shared: &Shared) -> String {
    let first = |has: &HasEffect| has.weights.first().copied().unwrap_or(0.0);
    let units: Vec<(f64, &HasEffect)> =
        (1..).map(f64::from).zip(fleet.records.iter().filter_map(|unit| unit.effects.get(number))).collect();
    let (mean, spread) = (shared.mean.first().copied().unwrap_or(0.0), shared.spread().first().copied().unwrap_or(0.0));
    let all: Vec<f64> =
        units.iter().map(|(_, has)| first(has)).chain([mean - 2.0 * spread, mean + 2.0 * spread, 0.0]).collect();
    let caption = format!(
        "<code>{}</code>: its first weight in every unit, in the order of the file; filled dots: units that have it as the family, hollow ones: in a way of \
         their own or not at all. Lines: mean and two standard deviations from unit to unit.",
        escape(&shared.name)
    );
    figure(Legend::None, &format!("Weights of {} by unit", shared.name), &caption, |canvas| {
        let x = Axis::exact("unit", 0.0, units.len() as f64 + 1.0);
        let y = Axis::linear(format!("weight, {}", shared.port.unit()), all.iter().copied());
        let mut plot = Plot::new(canvas.width, HEIGHT, x, y);
        plot.level("line after", mean);
        plot.level("reference", mean - 2.0 * spread);
        plot.level("reference", mean + 2.0 * spread);
        let points = |in_family: bool| {
            let of = units.iter().filter(move |(_, has)| (has.family > OUTSIDE) == in_family);
            of.map(|(unit, has)| (*unit, first(has))).collect::<Vec<_>>()
        };
        plot.dots(Side::After, points(true));
        plot.dots(Side::Before, points(false));
        vec![plot]
    })
}
