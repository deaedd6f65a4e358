//! The netlist against its own rules, against what is made of it, and against the firmware's board.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use hardware::netlist::Netlist;
use hardware::{INSTRUMENT, check, outcome, power, root};

fn netlist() -> Netlist {
    Netlist::read(INSTRUMENT).unwrap()
}

#[test]
fn the_netlist_keeps_the_rules_and_its_files_are_up_to_date() {
    let outcome = outcome().unwrap();
    assert!(outcome.faults.is_empty(), "{:#?}", outcome.faults);
    for (name, text) in outcome.files {
        let found = fs::read_to_string(root().join(name)).unwrap_or_default();
        assert!(found == text, "{name} is not what hardware/instrument.toml makes: make hardware");
    }
}

/// One change to the file at a time, each of which a rule names.
#[test]
fn what_is_wrong_is_named() {
    for (from, to, fault) in [
        (r#""U1.PA10", "U5.RO""#, r#""U1.PA10", "U5.RO", "J3.TXD""#, "net GYRO_RX has 2 drivers"),
        (r#""U1.PA10", "U5.RO""#, r#""U1.PA10", "U1.PA10""#, "net GYRO_RX has an input, and nothing drives it"),
        (r#""U1.PA4", "U2.CS", "R5.1""#, r#""U1.PA4", "R5.1""#, "U2.CS is on no net"),
        (r#""U1.PA4", "U2.CS", "R5.1""#, r#""U1.PA4", "U2.CSX", "U2.CS", "R5.1""#, "net ACC_CS: there is no U2.CSX"),
        (r#"PA15 = [50]"#, r#"PA15 = [51]"#, "U1 has two pins 51"),
        (r#"volts = [2.25, 3.6]"#, r#"volts = [4.5, 5.5]"#, "U2 takes 4.5 to 5.5 V, and +3V3 has 3.3 V"),
        (
            r#"current_ma = [15.0, 15.0]"#,
            r#"current_ma = [15.0, 900.0]"#,
            "rail +3V3 gives 1000 mA, and 1062 mA are taken",
        ),
        (r#""U6.VOUT", "#, "", "rail +3V3 has 0 sources"),
    ] {
        let text = INSTRUMENT.replacen(from, to, 1);
        assert_ne!(text, INSTRUMENT, "{from}");
        let faults = check::faults(&Netlist::read(&text).unwrap());
        assert!(faults.iter().any(|found| found.contains(fault)), "{to}: {faults:?}");
    }
}

/// What the regulator takes, by hand: 148.2 mA of 3.3 V are 0.489 W; by 85 % and 12 V these are 47.9 mA.
#[test]
fn the_regulator_takes_what_it_gives_by_its_efficiency() {
    let netlist = netlist();
    let budget = power::budget(&netlist);
    let supply = budget.iter().find(|load| load.rail.name == "+12V").unwrap();
    let (_, [typical, _]) = supply.takers.iter().find(|(name, _)| *name == "U6").unwrap();
    assert!((typical - 47.9).abs() < 0.1, "{typical}");
}

/// What the firmware says of a pin.
#[derive(Debug, PartialEq, Eq)]
enum Use {
    Output,
    Input,
    /// A peripheral's function by its number, where the code gives the number alone.
    Alternate(u32),
    Function(String),
}

/// The code of the board, without comments.
fn code() -> String {
    let files = fs::read_dir(root().join("src/board/f405")).unwrap().map(|entry| entry.unwrap().path());
    let text: String = files.map(|path| fs::read_to_string(path).unwrap()).collect();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Pins like `a.pa10` in a piece of code, with what follows each.
fn pins(code: &str) -> Vec<(String, &str)> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices(".p") {
        let rest = &code[at + 2..];
        let mut letters = rest.chars();
        let Some(port) = letters.next().filter(|port| ('a'..='d').contains(port)) else { continue };
        let digits = rest[1..].chars().take_while(char::is_ascii_digit).count();
        if digits == 0 || !code[..at].ends_with(port) {
            continue;
        }
        found.push((format!("P{}{}", port.to_ascii_uppercase(), &rest[1..=digits]), &rest[digits + 1..]));
    }
    found
}

/// Every pin that the firmware sets up, and what for.
fn uses(code: &str) -> BTreeMap<String, Use> {
    let mut uses = BTreeMap::new();
    for (pin, after) in pins(code) {
        if let Some(rest) = after.strip_prefix(".into_alternate::<") {
            uses.insert(pin, Use::Alternate(rest.split('>').next().unwrap().parse().unwrap()));
        } else if after.starts_with(".into_push_pull_output") {
            uses.insert(pin, Use::Output);
        } else if after.starts_with(".into_pull_up_input()") {
            uses.insert(pin, Use::Input);
        } else if after.starts_with(".into_analog()") {
            // DS8626, table 7: PC0 is input 10 of converter 1.
            let number: u32 = pin[2..].parse().unwrap();
            uses.insert(pin, Use::Function(format!("ADC1_IN{}", 10 + number)));
        }
    }
    for (at, call) in code.match_indices("Spi::new(device.SPI") {
        let number = &code[at + call.len()..=at + call.len()];
        let bus = code[..at].rfind("let bus = (").unwrap();
        for ((pin, _), signal) in pins(&code[bus..at]).into_iter().zip(["SCK", "MISO", "MOSI"]) {
            uses.insert(pin, Use::Function(format!("SPI{number}_{signal}")));
        }
    }
    for (at, call) in code.match_indices("Serial::<_, u8>::") {
        let call = &code[at + call.len()..];
        let call = &call[..call.find("&mut rcc").unwrap()];
        let number = call.split("USART").nth(1).unwrap().chars().next().unwrap();
        let signals: &[&str] = if call.starts_with("rx") { &["RX"] } else { &["TX", "RX"] };
        for ((pin, _), signal) in pins(call).into_iter().zip(signals) {
            uses.insert(pin, Use::Function(format!("USART{number}_{signal}")));
        }
    }
    uses
}

/// The number of a peripheral's function (DS8626, table 9).
fn alternate(function: &str) -> u32 {
    match function.split('_').next().unwrap() {
        "TIM1" | "TIM2" => 1,
        "TIM3" | "TIM4" | "TIM5" => 2,
        "SPI1" | "SPI2" => 5,
        "SPI3" => 6,
        "USART1" | "USART2" | "USART3" => 7,
        other => panic!("{other} has no number here"),
    }
}

#[test]
fn the_firmware_uses_the_pins_as_they_are_wired() {
    let netlist = netlist();
    let uses = uses(&code());
    let centre = netlist.drawing.centre.as_str();
    let mut wired = BTreeSet::new();
    for net in netlist.signals() {
        let Some(function) = net.function.as_deref().filter(|function| !function.starts_with("SW")) else { continue };
        for pin in net.of(centre) {
            wired.insert(pin.to_owned());
            let fits = match uses.get(pin) {
                Some(Use::Output) => function == "output",
                Some(Use::Input) => function == "input",
                Some(Use::Alternate(number)) => {
                    !matches!(function, "output" | "input") && alternate(function) == *number
                }
                Some(Use::Function(used)) => function == used,
                None => false,
            };
            assert!(
                fits,
                "net {}: {pin} is wired as {function}, the firmware uses it as {:?}",
                net.name,
                uses.get(pin)
            );
        }
    }
    let used: BTreeSet<String> = uses.into_keys().collect();
    assert_eq!(used, wired, "pins that the firmware uses, and pins that hardware/instrument.toml wires");
}

/// The table at the head of the board's file.
#[test]
fn the_boards_own_table_has_the_same_pins() {
    let netlist = netlist();
    let text = fs::read_to_string(root().join("src/board/f405/mod.rs")).unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("//! | P"));
    let cells = rows.map(|row| format!("P{}", row.split('|').next().unwrap()));
    let told: BTreeSet<String> = cells
        .flat_map(|cell| {
            let pins = cell.split('(').next().unwrap().trim().to_owned();
            pins.split(", ").map(str::to_owned).collect::<Vec<_>>()
        })
        .collect();
    let wired =
        netlist.signals().filter(|net| net.function.as_deref().is_some_and(|function| !function.starts_with("SW")));
    let wired: BTreeSet<String> = wired.flat_map(|net| net.of("U1").map(str::to_owned)).collect();
    assert_eq!(told, wired);
}
