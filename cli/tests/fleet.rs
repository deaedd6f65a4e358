//! `north fleet`: a prior from some units, a diagnosis with it, and many diagnoses that are done once.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use serde_json::Value;

use crate::common::north;

fn simulated(folder: &Path, name: &str, seed: &str) -> String {
    let path = folder.join(name).to_str().unwrap().to_owned();
    let (code, _, error) =
        north(&["simulate", "--scenario", "air-conditioning", "--runs", "8", "--seed", seed, "--out", &path]);
    assert_eq!(code, 0, "{error}");
    path
}

/// Three units of one scenario have its effect in common, with the same coefficient: one of the prior's is as likely as any. (Of three fit runs a unit cannot tell
/// the temperature's rate from a quick memory of it; of four and more it can.)
#[test]
#[ignore = "several diagnoses: make proofs"]
fn units_of_one_scenario_have_its_effect_in_common() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (name, seed) in [("units/a", "11"), ("units/b", "22"), ("units/c", "33")] {
        simulated(folder.path(), name, seed);
    }
    let (units, prior, results) = (path("units"), path("f.toml"), path("results"));
    let (code, said, error) = north(&["fleet", "learn", &units, "--out", &prior]);
    assert!(
        code == 0 && said.contains("units      3") && said.contains("effect     temperature-rate"),
        "{said}{error}"
    );
    let (_, said, _) = north(&["fleet", "show", &prior, "--report", &path("f.html"), "--json", "-"]);
    let shown: Value = serde_json::from_str(&said).unwrap();
    assert_eq!((&shown["units"], shown["unit"].as_array().unwrap().len()), (&Value::from(3), 3));
    assert!(shown["unit"][0]["outside"].as_f64().unwrap() < 0.5, "{shown}");
    assert!(fs::read_to_string(path("f.html")).unwrap().contains("What the units have in common"));

    let next = simulated(folder.path(), "next", "44");
    let (code, said, error) = north(&["diagnose", &next, "--fleet", &prior, "--json", "-"]);
    let diagnosis: Value = serde_json::from_str(&said).unwrap_or_else(|_| panic!("{code} {error}"));
    assert_eq!(diagnosis["effects"][0]["name"], "temperature-rate");
    let family = &diagnosis["family"];
    assert!(
        family["outside"].as_f64().unwrap() < 0.5 && family["effects"][0]["family"].as_f64().unwrap() > 0.5,
        "{family}"
    );

    // The same by the map over folders, once.
    let all = ["fleet", "diagnose", &next, "--results", &results, "--fleet", &prior, "--table", &path("t.parquet")];
    let (code, said, error) = north(&all);
    assert!(code == 0 && said.contains("1 campaign: 0 done before, 0 cannot"), "{said}{error}");
    let result = Path::new(&results).join("next.json");
    let of_map: Value = serde_json::from_str(&fs::read_to_string(&result).unwrap()).unwrap();
    assert_eq!(of_map, diagnosis);
    let modified = || -> SystemTime { fs::metadata(&result).unwrap().modified().unwrap() };
    let first = modified();
    let (code, said, _) = north(&[&all[..7], &["--force", "--table", &path("t.parquet")]].concat());
    assert!(code == 0 && said.contains("1 done before") && modified() == first, "{said}");
    // Results that were made with something else are not mixed with these.
    let (code, _, error) = north(&["fleet", "diagnose", &next, "--results", &results]);
    assert!(code == 1 && error.contains("another fleet"), "{error}");

    // The models that were written are units, too.
    let (code, said, error) = north(&["fleet", "learn", &results, "--out", &path("m.toml")]);
    assert!(code == 0 && said.contains("units      1"), "{said}{error}");
}

#[test]
fn what_is_no_unit_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (code, _, error) = north(&["fleet", "learn", &path("none"), "--out", &path("f.toml")]);
    assert!(code == 1 && error.contains("none"), "{error}");
    fs::write(path("model.toml"), "format = 2\n").unwrap();
    let (code, _, error) = north(&["fleet", "diagnose", &path("model.toml"), "--results", &path("r")]);
    assert!(code == 1 && error.contains("a model file is no campaign"), "{error}");
    fs::write(path("f.toml"), "format = 1\nunits = 3\n[[effect]]\nname = \"x\"\nshare = 2.0\nunits = 1.0\nport = \"rate\"\nmean = [1.0]\ncovariance = [[1.0]]\n").unwrap();
    let (code, _, error) = north(&["fleet", "show", &path("f.toml")]);
    assert!(code == 1 && error.contains("f.toml") && error.contains("share = 2"), "{error}");
}

/// What cannot be read is a result of its own, and does not keep the others from their table; once it is mended it is diagnosed.
#[test]
fn a_campaign_that_cannot_be_read_is_refused_until_it_is_mended() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    assert_eq!(north(&["simulate", "--runs", "2", "--out", &path("units/unit 1")]).0, 0);
    let manifest = path("units/unit 2/campaign.toml");
    fs::create_dir(path("units/unit 2")).unwrap();
    fs::write(&manifest, "format = \n").unwrap();
    let (units, results, table) = (path("units"), path("results"), path("t.parquet"));
    let all = ["fleet", "diagnose", &units, "--results", &results, "--table", &table, "--force"];
    for before in [0, 1] {
        let (code, said, error) = north(&all);
        let counts = format!("2 campaigns: {before} done before, 1 cannot be diagnosed");
        assert!(code == 0 && said.contains(&counts) && Path::new(&table).exists(), "{said}{error}");
    }
    let refused = fs::read_to_string(path("results/unit 2.json")).unwrap();
    assert!(refused.contains("campaign.toml, line 1, column 10"), "{refused}");
    fs::remove_dir_all(path("units/unit 2")).unwrap();
    assert_eq!(north(&["simulate", "--runs", "2", "--seed", "9", "--out", &path("units/unit 2")]).0, 0);
    let (_, said, _) = north(&all);
    assert!(said.contains("1 done before, 0 cannot be diagnosed"), "{said}");
    assert!(!fs::read_to_string(path("results/unit 2.json")).unwrap().contains("refused"));
}

#[test]
fn results_have_a_folder_and_a_name_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::create_dir_all(path("units/made-with")).unwrap();
    fs::write(path("units/made-with/campaign.toml"), "").unwrap();
    let (code, _, error) = north(&["fleet", "diagnose", &path("units"), "--results", &path("results")]);
    assert!(code == 1 && error.contains("made-with: a campaign of this name has no results"), "{error}");
    fs::rename(path("units/made-with"), path("units/unit-1")).unwrap();
    let (code, _, error) = north(&["fleet", "diagnose", &path("units"), "--results", &path("units")]);
    assert!(code == 1 && error.contains("the campaigns are in this folder"), "{error}");
}
