//! What a netlist must keep to: every pin in one net, one driver for every signal, rails that feed what they may.

use crate::netlist::{Kind, Net, Netlist, Part};
use crate::power;

/// Everything that is wrong, in sentences that name net, part and pin.
pub fn faults(netlist: &Netlist) -> Vec<String> {
    let names = twice(netlist.parts.iter().map(|part| part.name.as_str()), "part")
        .chain(twice(netlist.nets.iter().map(|net| net.name.as_str()), "net"));
    let parts = netlist.parts.iter().flat_map(|part| of_part(netlist, part));
    let nets = netlist.nets.iter().flat_map(|net| of_net(netlist, net));
    let rails = power::budget(netlist).into_iter().filter_map(|load| {
        let limit_ma = load.rail.limit_ma?;
        let [_, most] = load.total_ma();
        (most > limit_ma).then(|| format!("rail {} gives {limit_ma} mA, and {most:.0} mA are taken", load.rail.name))
    });
    names.chain(parts).chain(nets).chain(rails).collect()
}

fn twice<'a>(names: impl Iterator<Item = &'a str>, what: &'static str) -> impl Iterator<Item = String> {
    let mut sorted: Vec<&str> = names.collect();
    sorted.sort_unstable();
    let found: Vec<String> = sorted
        .windows(2)
        .filter(|pair| pair[0] == pair[1])
        .map(|pair| format!("{what} {} is there twice", pair[0]))
        .collect();
    found.into_iter()
}

fn of_part(netlist: &Netlist, part: &Part) -> Vec<String> {
    let name = &part.name;
    let mut faults = Vec::new();
    for (pin, kind) in &part.pins {
        let nets: Vec<&str> = netlist
            .nets
            .iter()
            .filter(|net| net.of(name).any(|other| other == pin))
            .map(|net| net.name.as_str())
            .collect();
        match (nets.as_slice(), kind) {
            ([], Kind::Open) | ([_], Kind::In | Kind::Out | Kind::Both | Kind::Rail | Kind::Source | Kind::Passive) => {
            }
            ([], _) => faults.push(format!("{name}.{pin} is on no net")),
            (nets, Kind::Open) => faults.push(format!("{name}.{pin} is open, and on {}", nets.join(", "))),
            (nets, _) => faults.push(format!("{name}.{pin} is on several nets: {}", nets.join(", "))),
        }
    }
    let mut numbers: Vec<u32> = part.numbers.values().flatten().copied().collect();
    numbers.sort_unstable();
    faults.extend(
        numbers.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| format!("{name} has two pins {}", pair[0])),
    );
    if !part.numbers.is_empty() && !part.pins.keys().eq(part.numbers.keys()) {
        faults.push(format!("{name} has pins without a number, or numbers without a pin"));
    }
    if let Some(supply) = &part.supply {
        match (netlist.rail(supply), part.volts) {
            (Some(rail), Some([least, most])) if (least..=most).contains(&rail.volts) => {}
            (Some(rail), Some([least, most])) => {
                faults.push(format!("{name} takes {least} to {most} V, and {supply} has {} V", rail.volts));
            }
            (None, _) => faults.push(format!("{name} is fed from {supply}, which is no rail")),
            (_, None) => faults.push(format!("{name} is fed from {supply}, and does not say what it allows")),
        }
        let fed = part.pins.iter().filter(|(_, kind)| **kind == Kind::Rail);
        if !fed.filter_map(|(pin, _)| netlist.net_of(name, pin)).any(|net| net.name == *supply) {
            faults.push(format!("{name} is fed from {supply}, and no pin of it is there"));
        }
    }
    faults
}

fn of_net(netlist: &Netlist, net: &Net) -> Vec<String> {
    let name = &net.name;
    let (mut faults, mut kinds) = (Vec::new(), Vec::new());
    for pin in &net.pins {
        match netlist.part(&pin.part).and_then(|part| part.pins.get(&pin.pin)) {
            Some(kind) => kinds.push(*kind),
            None => faults.push(format!("net {name}: there is no {}.{}", pin.part, pin.pin)),
        }
    }
    let count = |wanted: Kind| kinds.iter().filter(|kind| **kind == wanted).count();
    if kinds.len() < 2 {
        faults.push(format!("net {name} joins nothing"));
    }
    if netlist.rail(name).is_some() {
        if count(Kind::Source) != 1 {
            faults.push(format!("rail {name} has {} sources", count(Kind::Source)));
        }
        if count(Kind::Out) + count(Kind::Both) > 0 {
            faults.push(format!("rail {name} is driven by a signal"));
        }
    } else {
        if count(Kind::Rail) + count(Kind::Source) > 0 {
            faults.push(format!("net {name} is no rail, and a supply pin is on it"));
        }
        if count(Kind::Out) > 1 {
            faults.push(format!("net {name} has {} drivers", count(Kind::Out)));
        }
        let driven = count(Kind::Out) + count(Kind::Both) > 0 || netlist.hanging(net).next().is_some();
        if count(Kind::In) > 0 && !driven {
            faults.push(format!("net {name} has an input, and nothing drives it"));
        }
    }
    faults
}
