//! What the rails are loaded with.

use crate::netlist::{Netlist, Rail};

/// A rail's load: who takes how much, typical and greatest.
pub struct Load<'a> {
    pub rail: &'a Rail,
    pub takers: Vec<(&'a str, [f64; 2])>,
}

impl Load<'_> {
    pub fn total_ma(&self) -> [f64; 2] {
        self.takers.iter().fold([0.0; 2], |[a, b], (_, [c, d])| [a + c, b + d])
    }
}

/// Every rail but ground. What a regulator takes is what the rail that it feeds takes, by both voltages and its efficiency.
pub fn budget(netlist: &Netlist) -> Vec<Load<'_>> {
    netlist.rails.iter().filter(|rail| rail.volts != 0.0).map(|rail| load(netlist, rail)).collect()
}

fn load<'a>(netlist: &'a Netlist, rail: &'a Rail) -> Load<'a> {
    let fed = netlist.parts.iter().filter(|part| part.supply.as_deref() == Some(&rail.name));
    let takers = fed.filter_map(|part| {
        let own = part.current_ma?;
        let Some(made) = part.feeds.as_ref().and_then(|feeds| netlist.rail(feeds)) else {
            return Some((part.name.as_str(), own));
        };
        let factor = made.volts / rail.volts / part.efficiency.unwrap_or(1.0);
        Some((part.name.as_str(), load(netlist, made).total_ma().map(|ma| ma * factor)))
    });
    Load { rail, takers: takers.collect() }
}
