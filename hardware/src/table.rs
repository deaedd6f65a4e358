//! What is made of the netlist in text: connection table, bill of materials, power budget.

use std::fmt::Write;

use crate::netlist::{Netlist, Part, Pin};
use crate::power;

/// docs/wiring.md.
pub fn document(netlist: &Netlist) -> String {
    format!(
        "# The wires of the reference instrument\n\nMade of [hardware/instrument.toml](../hardware/instrument.toml) by `make hardware`: change that file, not this \
         one. Tests hold both, and the firmware's pins, against each other.\n\n![Wiring diagram](wiring.svg)\n\n## Connections\n\n{}\n## \
         Parts\n\n{}\n## Power\n\n{}",
        connections(netlist),
        parts(netlist),
        budget(netlist)
    )
}

/// Every net that is no rail: the microcontroller's pin first, and what hangs on the wire.
pub fn connections(netlist: &Netlist) -> String {
    let centre = &netlist.drawing.centre;
    let mut table = format!(
        "| net | {centre}, pin of the package | function | goes to | on the wire | what for |\n|---|---|---|---|---|---|\n"
    );
    for net in netlist.signals() {
        let own = net.of(centre).map(|pin| {
            let numbers = netlist.part(centre).and_then(|part| part.numbers.get(pin)).into_iter().flatten();
            format!("{pin}, {}", joined(numbers.map(u32::to_string)))
        });
        let small: Vec<&str> = netlist.hanging(net).map(|(part, _)| part.name.as_str()).collect();
        let others = net.pins.iter().filter(|pin| pin.part != *centre && !small.contains(&pin.part.as_str()));
        let hanging =
            netlist.hanging(net).map(|(part, other)| format!("{} {} to {}", part.name, part.value, other.name));
        let function = net.function.as_deref().unwrap_or("–");
        writeln!(
            table,
            "| {} | {} | {function} | {} | {} | {} |",
            net.name,
            or_dash(joined(own)),
            or_dash(joined(others.map(|Pin { part, pin }| format!("{part}.{pin}")))),
            or_dash(joined(hanging)),
            net.why
        )
        .expect("a string takes everything");
    }
    for rail in &netlist.rails {
        let pins = netlist.nets.iter().filter(|net| net.name == rail.name).flat_map(|net| &net.pins);
        let pins = joined(pins.map(|Pin { part, pin }| format!("{part}.{pin}")));
        writeln!(table, "| {} | | {} V | {pins} | | {} |", rail.name, rail.volts, rail.note)
            .expect("a string takes everything");
    }
    table
}

/// A line of the bill of materials: parts that are alike, and how many.
struct Line<'a> {
    names: Vec<&'a str>,
    quantity: u32,
    part: &'a Part,
}

fn lines(netlist: &Netlist) -> Vec<Line<'_>> {
    let mut lines: Vec<Line> = Vec::new();
    for part in &netlist.parts {
        match lines.iter_mut().find(|line| (&line.part.what, &line.part.value) == (&part.what, &part.value)) {
            Some(line) => {
                line.names.push(&part.name);
                line.quantity += part.quantity;
            }
            None => lines.push(Line { names: vec![&part.name], quantity: part.quantity, part }),
        }
    }
    lines
}

pub fn parts(netlist: &Netlist) -> String {
    let mut table = "| parts | number | what | value | usual part | needed |\n|---|---|---|---|---|---|\n".to_owned();
    for Line { names, quantity, part } in lines(netlist) {
        let optional = part.optional.as_deref().unwrap_or("always");
        let (names, Part { what, value, usual, .. }) = (names.join(", "), part);
        writeln!(table, "| {names} | {quantity} | {what} | {value} | {usual} | {optional} |")
            .expect("a string takes everything");
    }
    table
}

/// hardware/bom.csv.
pub fn bill(netlist: &Netlist) -> String {
    let mut csv = "parts,number,what,value,usual_part,optional\n".to_owned();
    for Line { names, quantity, part } in lines(netlist) {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let optional = part.optional.as_deref().unwrap_or_default();
        let [names, what, value, usual, optional] =
            [names.join(" ").as_str(), &part.what, &part.value, &part.usual, optional].map(quoted);
        writeln!(csv, "{names},{quantity},{what},{value},{usual},{optional}").expect("a string takes everything");
    }
    csv
}

pub fn budget(netlist: &Netlist) -> String {
    let mut table = "| rail | part | typical, mA | greatest, mA | by |\n|---|---|---|---|---|\n".to_owned();
    for load in power::budget(netlist) {
        for (name, [typical, most]) in &load.takers {
            let source = netlist.part(name).map(|part| part.source.as_str()).unwrap_or_default();
            writeln!(table, "| {} | {name} | {typical:.0} | {most:.0} | {source} |", load.rail.name)
                .expect("a string takes everything");
        }
        let ([typical, most], volts) = (load.total_ma(), load.rail.volts);
        let limit = load.rail.limit_ma.map_or_else(String::new, |limit| format!("{limit} mA are allowed"));
        let [typical_w, most_w] = [typical, most].map(|ma| ma * volts / 1000.0);
        writeln!(
            table,
            "| **{}** | **all** | **{typical:.0}** ({typical_w:.1} W) | **{most:.0}** ({most_w:.1} W) | {limit} |",
            load.rail.name
        )
        .expect("a string takes everything");
    }
    table
}

fn joined(parts: impl Iterator<Item = String>) -> String {
    parts.collect::<Vec<_>>().join(", ")
}

fn or_dash(text: String) -> String {
    if text.is_empty() { "–".into() } else { text }
}
