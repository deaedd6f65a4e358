//! The wiring diagram: the microcontroller in the middle, chains of parts on both sides of it, every wire in a row of its own, what hangs on a wire
//! drawn on it or in series with it, the supply below.

use std::fmt::Write;

use crate::netlist::{Kind, Net, Netlist, Part};

/// Measures in pixels.
const ROW: f64 = 27.0;
/// Above a part's first wire: its name, and what it is.
const HEAD: f64 = 48.0;
const FOOT_LINE: f64 = 14.0;
const GAP: f64 = 22.0;
const WIDTH: f64 = 1800.0;
const CENTRE: Column = Column { x: 810.0, width: 220.0 };
/// From the centre outwards.
const LEFT: [Column; 2] = [Column { x: 370.0, width: 190.0 }, Column { x: 20.0, width: 190.0 }];
const RIGHT: [Column; 2] = [Column { x: 1280.0, width: 190.0 }, Column { x: 1590.0, width: 190.0 }];
/// The length of a wire that ends at what hangs on it.
const STUB: f64 = 190.0;
/// What hangs on a wire beside something else hangs lower by so much.
const HANGING: f64 = 18.0;
/// Characters of a part's lowest lines.
const FOOT_CHARACTERS: usize = 30;

#[derive(Clone, Copy)]
struct Column {
    x: f64,
    width: f64,
}

impl Column {
    fn end(self) -> f64 {
        self.x + self.width
    }
}

/// A part that has its place.
struct Placed<'a> {
    part: &'a Part,
    column: Column,
    rows: Vec<f64>,
    foot: Vec<String>,
}

impl Placed<'_> {
    fn top(&self) -> f64 {
        self.rows.first().copied().unwrap_or_default() - HEAD
    }

    fn bottom(&self) -> f64 {
        self.rows.last().copied().unwrap_or_default() + 14.0 + FOOT_LINE * self.foot.len() as f64
    }
}

/// A drawing under way.
struct Sheet<'a> {
    netlist: &'a Netlist,
    body: String,
    /// Nets that are drawn.
    drawn: Vec<&'a str>,
    /// Pins of the centre that are drawn: rows.
    centre_rows: Vec<f64>,
}

/// The whole diagram as SVG.
pub fn svg(netlist: &Netlist) -> String {
    let mut sheet = Sheet { netlist, body: String::new(), drawn: Vec::new(), centre_rows: Vec::new() };
    let left = sheet.side(&netlist.drawing.left, LEFT);
    let left = sheet.rest(left);
    let right = sheet.side(&netlist.drawing.right, RIGHT);
    let below = sheet.centre(left.max(right));
    let height = sheet.supply(below + 2.0 * GAP) + GAP;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <style>.wire {{ stroke: #246; fill: none }} .part {{ stroke: #222; fill: #f6f3ea }} .small {{ stroke: #222; fill: #fff }} \
         .note {{ font-size: 11px; fill: #555 }} .net {{ font-size: 11px; fill: #246 }} .name {{ font-weight: bold }}</style>\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n{}</svg>\n",
        sheet.body
    )
}

impl<'a> Sheet<'a> {
    /// The chains of one side, from the top; gives where they end.
    fn side(&mut self, chains: &'a [Vec<String>], columns: [Column; 2]) -> f64 {
        let mut top = GAP;
        for chain in chains {
            let parts = chain.iter().rev().filter_map(|name| self.netlist.part(name)).zip(columns);
            top = self.chain(parts.collect(), top) + GAP;
        }
        top
    }

    /// A chain of parts, from the centre outwards; gives where it ends.
    fn chain(&mut self, parts: Vec<(&'a Part, Column)>, top: f64) -> f64 {
        let mut placed: Vec<Placed> = parts
            .into_iter()
            .map(|(part, column)| Placed { part, column, rows: Vec::new(), foot: self.foot(part) })
            .collect();
        let nets = self.nets_between(&placed);
        let mut y = top + HEAD;
        let mut wires = Vec::new();
        for (number, net) in nets.iter().enumerate() {
            let passes = |placed: &Placed| net.of(&placed.part.name).next().is_none() && !placed.rows.is_empty();
            // A wire that goes past a part goes below it.
            if number > 0 && placed.first().is_some_and(passes) {
                y = y.max(placed.first().map_or(y, Placed::bottom) + GAP);
            }
            placed
                .iter_mut()
                .filter(|placed| net.of(&placed.part.name).next().is_some())
                .for_each(|placed| placed.rows.push(y));
            wires.push((*net, y));
            y += ROW;
        }
        placed.iter().for_each(|placed| self.part(placed));
        for (net, y) in wires {
            self.wire(net, y, &placed);
        }
        placed.iter().map(Placed::bottom).fold(y - ROW, f64::max)
    }

    /// The signals that join parts of a chain with each other or with the centre: those of the innermost part first.
    fn nets_between(&self, placed: &[Placed<'a>]) -> Vec<&'a Net> {
        let members =
            || placed.iter().map(|placed| placed.part.name.as_str()).chain([self.netlist.drawing.centre.as_str()]);
        let joins = |net: &&Net| {
            let joined = members().filter(|member| net.of(member).next().is_some()).count();
            joined > 1 || joined == 1 && self.in_series(net).is_some()
        };
        // What an earlier chain has is drawn.
        let is_new = |net: &&Net| !self.drawn.contains(&net.name.as_str());
        let mut nets: Vec<&Net> = self.netlist.signals().filter(is_new).filter(joins).collect();
        nets.sort_by_key(|net| placed.first().is_none_or(|inner| net.of(&inner.part.name).next().is_none()));
        nets
    }

    /// The part through which a signal goes to the centre, and what it is called there.
    fn in_series(&self, net: &'a Net) -> Option<(&'a Part, &'a Net)> {
        let centre = self.netlist.drawing.centre.as_str();
        let is_of_centre = |net: &Net| net.of(centre).next().is_some();
        let ends_there = |(_, other): &(&Part, &Net)| self.netlist.rail(&other.name).is_none() && is_of_centre(other);
        (!is_of_centre(net)).then(|| self.netlist.hanging(net).find(ends_there)).flatten()
    }

    /// A wire from a part through another one in series to the centre. It has two names, both of which stand in the table of connections.
    fn wire_in_series(&mut self, net: &'a Net, y: f64, outer: &Placed<'a>, (series, inner): (&'a Part, &'a Net)) {
        let centre = self.netlist.drawing.centre.as_str();
        let from = outer.column.end();
        self.line([from, y], [CENTRE.x, y]);
        self.rectangle([from + 10.0, y - 4.0], [20.0, 8.0], "small");
        let label = format!("{} {}", series.name, short(&series.value));
        self.text([from + 8.0, y - 7.0], "note", "start", &label);
        self.pin(net, &outer.part.name, from - 6.0, y, "end");
        self.pin(inner, centre, CENTRE.x + 6.0, y, "start");
        self.drawn.extend([net.name.as_str(), inner.name.as_str()]);
        self.hanging(inner, [CENTRE.x - 135.0, y]);
        self.centre_rows.push(y);
    }

    /// A wire from member to member of its chain, with what hangs on it.
    fn wire(&mut self, net: &'a Net, y: f64, placed: &[Placed<'a>]) {
        let centre = self.netlist.drawing.centre.as_str();
        let outer = placed.iter().find(|placed| net.of(&placed.part.name).next().is_some());
        if let Some((outer, series)) = outer.zip(self.in_series(net)) {
            return self.wire_in_series(net, y, outer, series);
        }
        let mut ends: Vec<(&str, Column)> =
            placed.iter().map(|placed| (placed.part.name.as_str(), placed.column)).collect();
        ends.push((centre, CENTRE));
        ends.retain(|(name, _)| net.of(name).next().is_some());
        ends.sort_by(|(_, a), (_, b)| a.x.total_cmp(&b.x));
        for pair in ends.windows(2) {
            let [(first, from), (second, to)] = [pair[0], pair[1]];
            self.line([from.end(), y], [to.x, y]);
            self.pin(net, first, from.end() - 6.0, y, "end");
            self.pin(net, second, to.x + 6.0, y, "start");
        }
        if let [(_, from), (_, to), ..] = ends[..] {
            self.text([from.end() + 8.0, y - 5.0], "net", "start", &net.name);
            self.hanging(net, [(to.x.min(from.end() + 250.0) - 135.0).max(from.end() + 85.0), y]);
        }
        if net.of(centre).next().is_some() {
            self.centre_rows.push(y);
        }
        self.drawn.push(&net.name);
    }

    fn pin(&mut self, net: &Net, part: &str, x: f64, y: f64, anchor: &str) {
        let numbers = self.netlist.part(part).map(|part| &part.numbers);
        let label = |pin: &str| match numbers.and_then(|numbers| numbers.get(pin)) {
            Some(numbers) => format!("{pin} ({})", numbers.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")),
            None => pin.to_owned(),
        };
        let labels: Vec<String> = net.of(part).map(label).collect();
        self.text([x, y + 4.0], "", anchor, &labels.join(", "));
    }

    /// Resistors and capacitors on a wire: to a rail, or to the wire below.
    fn hanging(&mut self, net: &'a Net, [x, y]: [f64; 2]) {
        let mut at = y - 9.0;
        for (part, other) in self.netlist.hanging(net) {
            if self.netlist.rail(&other.name).is_none() {
                if !self.drawn.contains(&other.name.as_str()) {
                    self.line([x, y], [x, y + ROW]);
                    self.rectangle([x - 4.0, y + 4.0], [8.0, ROW - 8.0], "small");
                    self.text([x + 8.0, y + 16.0], "note", "start", &format!("{} {}", part.name, part.value));
                }
                continue;
            }
            self.dot([x, y]);
            self.line([x, y], [x, at]);
            self.line([x, at], [x + 30.0, at]);
            if part.what == "resistor" {
                self.rectangle([x + 5.0, at - 4.0], [20.0, 8.0], "small");
            } else {
                self.rectangle([x + 13.0, at - 6.0], [4.0, 12.0], "small");
            }
            self.text(
                [x + 33.0, at + 4.0],
                "note",
                "start",
                &format!("{} {}, {}", part.name, short(&part.value), other.name),
            );
            at += HANGING;
        }
    }

    /// Signals of the centre that no chain has: they end at what hangs on them.
    fn rest(&mut self, top: f64) -> f64 {
        let centre = self.netlist.drawing.centre.as_str();
        let in_chain = |net: &Net| {
            let drawing = &self.netlist.drawing;
            let of_part = drawing.left.iter().chain(&drawing.right).flatten().any(|part| net.of(part).next().is_some());
            of_part || self.drawn.contains(&net.name.as_str())
        };
        let nets: Vec<&Net> =
            self.netlist.signals().filter(|net| net.of(centre).next().is_some() && !in_chain(net)).collect();
        let mut y = top + GAP;
        for net in nets {
            self.line([CENTRE.x - STUB, y], [CENTRE.x, y]);
            self.pin(net, centre, CENTRE.x + 6.0, y, "start");
            self.text([CENTRE.x - STUB - 6.0, y + 4.0], "net", "end", &net.name);
            self.hanging(net, [CENTRE.x - STUB, y]);
            self.centre_rows.push(y);
            // What hangs on the wire first is drawn above it, the rest below.
            y += ROW + HANGING * self.netlist.hanging(net).count().saturating_sub(1) as f64;
        }
        y
    }

    /// The centre's own box; gives where it ends.
    fn centre(&mut self, bottom: f64) -> f64 {
        let Some(part) = self.netlist.part(&self.netlist.drawing.centre) else { return bottom };
        let mut rows = std::mem::take(&mut self.centre_rows);
        rows.sort_by(f64::total_cmp);
        let placed = Placed { part, column: CENTRE, rows, foot: self.foot(part) };
        let under = std::mem::take(&mut self.body);
        self.part(&placed);
        self.body.push_str(&under);
        placed.bottom().max(bottom)
    }

    /// The supply, from left to right.
    fn supply(&mut self, top: f64) -> f64 {
        let y = top + HEAD;
        let parts = self.netlist.drawing.supply.iter().filter_map(|name| self.netlist.part(name));
        let placed: Vec<Placed> = (parts.enumerate())
            .map(|(number, part)| {
                let column = Column { x: 20.0 + 430.0 * number as f64, width: 190.0 };
                Placed { part, column, rows: vec![y], foot: self.foot(part) }
            })
            .collect();
        placed.iter().for_each(|placed| self.part(placed));
        let mut bottom = placed.iter().map(Placed::bottom).fold(y, f64::max);
        for (number, Placed { part, column, .. }) in placed.iter().enumerate() {
            let next = placed.get(number + 1);
            let outgoing = self.netlist.nets.iter().find(|net| {
                let leaves =
                    net.of(&part.name).any(|pin| matches!(part.pins.get(pin), Some(Kind::Source | Kind::Passive)));
                leaves && net.name != "GND" && next.is_none_or(|next| net.of(&next.part.name).next().is_some())
            });
            let Some(net) = outgoing else { continue };
            self.line([column.end(), y], [column.end() + 240.0, y]);
            self.text([column.end() + 8.0, y - 5.0], "net", "start", &net.name);
            self.pin(net, &part.name, column.end() - 6.0, y, "end");
            if let Some(next) = next {
                self.pin(net, &next.part.name, next.column.x + 6.0, y, "start");
            }
            let mut below = y;
            for other in self.shunts(net, &placed) {
                below += FOOT_LINE;
                self.text([column.end() + 8.0, below], "note", "start", &other);
            }
            bottom = bottom.max(below);
        }
        bottom
    }

    /// What is between a rail and another one, in words.
    fn shunts(&self, net: &Net, supply: &[Placed<'_>]) -> Vec<String> {
        let shunt = |part: &&Part| {
            let others = part.pins.keys().filter_map(|pin| self.netlist.net_of(&part.name, pin)).collect::<Vec<_>>();
            part.pins.len() == 2
                && !supply.iter().any(|other| other.part.name == part.name)
                && others.iter().any(|other| other.name == net.name)
                && others.iter().all(|other| self.netlist.rail(&other.name).is_some())
        };
        let parts = self.netlist.parts.iter().filter(shunt);
        parts
            .map(|part| match part.quantity {
                1 => format!("{} {} to GND", part.name, part.value),
                count => format!("{} {count} × {} to GND", part.name, part.value),
            })
            .collect()
    }

    /// A part's lowest lines: which of its pins are on which rail, and which are open.
    fn foot(&self, part: &Part) -> Vec<String> {
        let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
        for (pin, kind) in &part.pins {
            let rail = self.netlist.net_of(&part.name, pin).filter(|net| self.netlist.rail(&net.name).is_some());
            let group = match (rail, kind) {
                (_, Kind::Open) => "open".to_owned(),
                (Some(net), _) => net.name.clone(),
                _ => continue,
            };
            match groups.iter_mut().find(|(name, _)| *name == group) {
                Some((_, pins)) => pins.push(pin),
                None => groups.push((group, vec![pin])),
            }
        }
        groups.iter().flat_map(|(name, pins)| wrapped(&format!("{name}: {}", pins.join(", ")))).collect()
    }

    fn part(&mut self, placed: &Placed) {
        let Placed { part, column, foot, .. } = placed;
        let (top, bottom) = (placed.top(), placed.bottom());
        self.rectangle([column.x, top], [column.width, bottom - top], "part");
        let middle = column.x + column.width / 2.0;
        self.text([middle, top + 15.0], "name", "middle", &format!("{} {}", part.name, short(&part.value)));
        self.text([middle, top + 29.0], "note", "middle", short(&part.what));
        for (number, line) in foot.iter().enumerate() {
            self.text([middle, bottom - 4.0 - FOOT_LINE * (foot.len() - 1 - number) as f64], "note", "middle", line);
        }
    }

    fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
        writeln!(self.body, "<line class=\"wire\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>")
            .expect("a string takes everything");
    }

    fn dot(&mut self, [x, y]: [f64; 2]) {
        writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"2.5\" fill=\"#246\"/>")
            .expect("a string takes everything");
    }

    fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], class: &str) {
        writeln!(self.body, "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>")
            .expect("a string takes everything");
    }

    fn text(&mut self, [x, y]: [f64; 2], class: &str, anchor: &str, text: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        writeln!(self.body, "<text class=\"{class}\" x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>")
            .expect("a string takes everything");
    }
}

/// What comes before the first comma.
fn short(text: &str) -> &str {
    text.split(',').next().unwrap_or(text)
}

/// Broken between words.
fn wrapped(text: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + word.chars().count() < FOOT_CHARACTERS => {
                if !line.is_empty() {
                    line.push(' ');
                }
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
