//! The documents say what the code says.

use std::fmt::Write;
use std::path::Path;

use north::toml_file::TomlFile;
use north_finder::fix::heading::settings::BlockSettings;
use north_finder::health::{Fault, Flag, Item, Refusal, TestVerdict};
use north_finder::settings::fields::{CHOICES, FIELDS, WORDS};
use north_finder::settings::{GyroFormat, Settings};

/// The table of docs/formats.md for one enum of codes.
fn table(rows: impl Iterator<Item = (u8, &'static str, &'static str, &'static str)>) -> String {
    rows.fold("| code | name | meaning | what to do |\n|---|---|---|---|\n".to_owned(), |mut table, row| {
        let (code, name, meaning, remedy) = row;
        writeln!(table, "| {code} | `{name}` | {meaning} | {remedy} |").unwrap();
        table
    })
}

#[test]
fn settings_are_documented_as_they_are() {
    let mut table = "| setting | default | unit | allowed | meaning |\n|---|---|---|---|---|\n".to_owned();
    let defaults = Settings::default();
    for (field, words) in FIELDS.iter().zip(WORDS) {
        let (name, allowed) = (field.name, field.allowed);
        let default = (field.value)(&defaults).map_or_else(|| "–".to_owned(), |value| value.to_string());
        writeln!(table, "| `{name}` | {default} | {} | {allowed} | {} |", words.unit, words.meaning).unwrap();
    }
    for choice in CHOICES {
        let [default, ..] = choice.allowed else { panic!("{} has no words", choice.name) };
        let allowed = choice.allowed.join(", ");
        writeln!(table, "| `{}` | {default} | | {allowed} | {} |", choice.name, choice.meaning).unwrap();
    }
    let settings = include_str!("../docs/settings.md");
    assert!(settings.contains(&table), "docs/settings.md lacks this table:\n{table}");
}

/// Every word of a choice is one that a file of settings may say (an order that is a list or a table with it), and the first is the
/// default.
#[test]
fn choices_are_those_of_a_file_of_settings() {
    let defaults = Settings { block: Some(BlockSettings::default()), ..Settings::default() };
    for choice in CHOICES {
        let (group, name) = choice.name.split_once('.').unwrap();
        for (number, word) in choice.allowed.iter().enumerate() {
            let quoted = match *word {
                "true" | "false" => (*word).to_owned(),
                "adaptive" => "{ adaptive = { accuracy_deg = 0.04 } }".into(),
                "rotation" => "{ rotation = { passes = 20 } }".into(),
                "custom" => "{ custom = [0.0, 120.0, 240.0] }".into(),
                _ => format!("\"{word}\""),
            };
            let settings: Settings = TomlFile::of_text(Path::new("choice"), format!("[{group}]\n{name} = {quoted}\n"))
                .parse_over(&Settings::default(), None)
                .unwrap();
            let settings = Settings { block: settings.block.or(defaults.block), ..settings };
            assert_eq!(settings == defaults, number == 0, "{} = {word}", choice.name);
        }
    }
}

/// The settings for each gyro make sense, and every format of frames is among them.
#[test]
fn settings_for_gyros_are_valid() {
    let gyros = include_str!("../docs/gyros.md");
    let blocks: Vec<&str> = gyros.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    let read = |text: &&str| {
        let file = TomlFile::of_text(Path::new("docs/gyros.md"), (*text).to_owned());
        file.parse_over::<Settings>(&Settings::default(), None).unwrap()
    };
    let settings: Vec<Settings> = blocks.iter().map(read).collect();
    assert!(settings.iter().all(|settings| settings.validate() == Ok(())), "{settings:#?}");
    for format in [GyroFormat::Compact, GyroFormat::KvhA] {
        assert!(settings.iter().any(|settings| settings.gyro.format == format), "{format:?}");
    }
}

#[test]
fn flags_and_faults_are_documented_as_they_are() {
    let formats = include_str!("../docs/formats.md");
    let flags = table(Flag::ALL.iter().map(|flag| (flag.code(), flag.name(), flag.meaning(), flag.remedy())));
    let faults = table(Fault::ALL.iter().map(|fault| (fault.code(), fault.name(), fault.meaning(), fault.remedy())));
    assert!(formats.contains(&flags), "docs/formats.md lacks this table of flags:\n{flags}");
    assert!(formats.contains(&faults), "docs/formats.md lacks this table of faults:\n{faults}");
    let link = include_str!("../docs/link.md");
    let refusals = table(Refusal::ALL.iter().map(|why| (why.code(), why.name(), why.meaning(), why.remedy())));
    assert!(link.contains(&refusals), "docs/link.md lacks this table of refusals:\n{refusals}");
    let items = table(Item::ALL.iter().map(|item| (item.code(), item.name(), item.meaning(), item.remedy())));
    assert!(link.contains(&items), "docs/link.md lacks this table of the self-test's items:\n{items}");
    let verdicts = TestVerdict::ALL.iter().map(|why| (why.code(), why.name(), why.meaning(), why.remedy()));
    let verdicts = table(verdicts);
    assert!(link.contains(&verdicts), "docs/link.md lacks this table of verdicts:\n{verdicts}");
}
