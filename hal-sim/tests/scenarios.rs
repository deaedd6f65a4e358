//! Scenario files: all built-in ones are good, and what is wrong is said with its place.

use hal_sim::scenario::{Scenario, ScenarioError};

#[test]
fn every_built_in_scenario_parses_and_describes_itself() {
    for (name, description) in Scenario::names() {
        let scenario = Scenario::named(name).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scenario.name, name);
        assert_eq!(scenario.description, description);
        assert!(description.len() > 10, "{name}: {description}");
    }
}

#[test]
fn every_scenario_file_is_built_in() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/scenarios");
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be listed").path();
        let name = path.file_stem().expect("files have names").to_str().expect("in plain letters").to_owned();
        assert!(Scenario::names().any(|(known, _)| known == name), "{name} is not in the library");
        assert_eq!(Scenario::load(&path), Scenario::named(&name));
    }
}

#[test]
fn the_default_scenario_comes_first() {
    assert_eq!(Scenario::names().next().map(|(name, _)| name), Some("calm-bench"));
}

#[test]
fn a_scenario_survives_being_written_and_read() {
    for (name, _) in Scenario::names() {
        let scenario = Scenario::named(name).expect("it parses");
        let text = toml::to_string(&scenario).expect("it can be written");
        assert_eq!(Scenario::parse(&text, "again"), Ok(scenario), "{name}");
    }
}

#[test]
fn an_unknown_name_lists_the_known_ones() {
    let message = Scenario::named("calm-bunch").expect_err("there is none").to_string();
    assert!(message.contains("\"calm-bunch\"") && message.contains("calm-bench, windy-tripod"), "{message}");
}

/// Text, and what the message must be.
#[test]
fn errors_name_file_line_field_value_and_what_is_allowed() {
    for (text, expected) in [
        (
            "[site]\n\nlatitude_deg = 91.0\n",
            "x.toml:3: site.latitude_deg = 91.0 is out of range; allowed: -90.0 to 90.0",
        ),
        ("[site]\nlatitude_deg = nan\n", "x.toml:2: site.latitude_deg = NaN is out of range; allowed: -90.0 to 90.0"),
        (
            "[[gyro.faults]]\nfrom_s = 5.0\nto_s = 4.0\n",
            "x.toml:3: gyro.faults[0].to_s = 4.0 is out of range; allowed: later than from_s = 5.0",
        ),
        (
            "[motor]\nstall_from_s = 5.0\nstall_to_s = 5.0\n",
            "x.toml:3: motor.stall_to_s = 5.0 is out of range; allowed: later than stall_from_s = 5.0",
        ),
        (
            "[[base.relevel]]\nat_s = 5.0\nduration_s = 2.0\n[[base.relevel]]\nat_s = 6.0\n",
            "x.toml:5: base.relevel[1].at_s = 6.0 is out of range; allowed: from 7.0, when the one before has ended",
        ),
        (
            "[[base.shocks]]\nat_s = 1.0\n[[base.shocks]]\nat_s = -1\n",
            "x.toml:4: base.shocks[1].at_s = -1.0 is out of range; allowed: 0.0 to 1000000.0",
        ),
        (
            "[accelerometer]\nbias_mg = [\n  0.0,\n  900.0,\n  0.0,\n]\n",
            "x.toml:4: accelerometer.bias_mg[1] = 900.0 is out of range; allowed: -500.0 to 500.0",
        ),
        ("[link]\nbaud = 300\n", "x.toml:2: link.baud = 300 is out of range; allowed: 9600 to 10000000"),
        (
            "[motor]\nhard_stop_deg = 1e9\n",
            "x.toml:2: motor.hard_stop_deg = 1000000000.0 is out of range; allowed: -7200.0 to 7200.0",
        ),
    ] {
        let message = Scenario::parse(text, "x.toml").expect_err(text).to_string();
        assert_eq!(message, expected);
    }
}

#[test]
fn unknown_fields_wrong_types_and_wrong_choices_are_refused_with_their_place() {
    for (text, start, parts) in [
        ("[gyro]\nbias = 1.0\n", "x.toml:2:1: `bias = 1.0`: ", ["unknown field `bias`", "`bias_deg_h`"]),
        (
            "\n[site]\nlatitude_deg = \"north\"\n",
            "x.toml:3:16: `latitude_deg = \"north\"`: ",
            ["string", "expected f64"],
        ),
        ("[gyro]\nformat = \"morse\"\n", "x.toml:2:10: `format = \"morse\"`: ", ["unknown variant `morse`", "`kvh-a`"]),
        ("[gyro\n", "x.toml:1:6: `[gyro`: ", ["unclosed", "`]`"]),
    ] {
        let message = Scenario::parse(text, "x.toml").expect_err(text).to_string();
        assert!(message.starts_with(start), "{message}");
        for part in parts {
            assert!(message.contains(part), "{message} lacks {part}");
        }
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = Scenario::load("no/such.toml".as_ref()).expect_err("it is not there");
    assert!(matches!(&error, ScenarioError::Unreadable { file, .. } if file == "no/such.toml"), "{error}");
}

#[test]
fn what_might_never_end_is_no_scenario() {
    let error = Scenario::load("/dev/zero".as_ref()).expect_err("it never ends");
    assert!(error.to_string().contains("no regular file"), "{error}");
    let path = std::env::temp_dir().join(format!("long-scenario-{}.toml", std::process::id()));
    std::fs::write(&path, "#\n".repeat(1 << 20)).expect("a temporary file");
    let error = Scenario::load(&path).expect_err("it is too long");
    std::fs::remove_file(&path).expect("it is there");
    assert!(error.to_string().contains("more than 1 MiB"), "{error}");
}

#[test]
fn a_changed_scenario_can_be_checked_again() {
    let mut scenario = Scenario::default();
    assert_eq!(scenario.violations(), []);
    scenario.site.latitude_deg = 100.0;
    assert_eq!(scenario.violations()[0].field(), "site.latitude_deg");
}

#[test]
fn overrides_for_the_firmware_pass_through_untouched() {
    let scenario = Scenario::parse("[instrument]\nanything = { at = [1, 2] }\n", "x.toml").expect("it parses");
    assert_eq!(scenario.instrument["anything"]["at"][1].as_integer(), Some(2));
}
