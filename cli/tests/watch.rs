//! `north watch`: a log of fixes, and what moved.

use std::fs;

use crate::common::{command, north};
use serde_json::Value;

/// A log of fixes, their bias by number.
fn log(count: u32, bias_deg_h: impl Fn(u32) -> f64) -> String {
    let mut text =
        String::from("fix,boot,utc,azimuth_deg,sigma_deg,misfit,freedom,bias_deg_h,amplitude_deg_h,temp_c\n");
    for fix in 1..=count {
        // Noise without a generator: fractions of multiples of square roots, whose sum of three is nearly normal, with variance 1/4.
        let noise = |at: f64| {
            [2.0_f64, 3.0, 5.0].into_iter().map(|root| (at + f64::from(fix) * root.sqrt()).fract() - 0.5).sum::<f64>()
        };
        let (boot, bias) = (fix / 5, bias_deg_h(fix) + 0.02 * noise(0.1));
        let amplitude = 12.3 + 0.01 * noise(0.7);
        let misfit = 7.0 + 3.0 * noise(0.4);
        text += &format!("{fix},{boot},2026-03-01 07:00:00,40.0,0.04,{misfit},7,{bias},{amplitude},20.0\n");
    }
    text
}

#[test]
fn a_model_that_holds_and_one_that_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (good, bad) = (path("good.csv"), path("bad.csv"));
    fs::write(&good, log(200, |_| 0.3)).unwrap();
    fs::write(&bad, log(200, |fix| if fix >= 150 { 0.4 } else { 0.3 })).unwrap();
    let (code, said, error) = north(&["watch", &good]);
    assert!(code == 0 && said.contains("holds      100 fixes watched") && said.contains("not seen"), "{said}{error}");
    let (code, said, error) = north(&["watch", &bad]);
    assert!(code == 1 && error.contains("no longer holds"), "{said}{error}");
    assert!(said.contains("bias       a step of +0.") && said.contains("since fix 150, 2026-03-01"), "{said}");
    assert!(said.contains("To do: bias cancels in every azimuth"), "{said}");
    let (_, said, _) = north(&["watch", &bad, "--json", "-"]);
    let found: Value = serde_json::from_str(&said).unwrap();
    assert_eq!((&found["holds"], &found["since"][0]["fix"]), (&Value::from(false), &Value::from(150)));
    let change = &found["changes"][0];
    assert_eq!((&change["signal"], &change["cause"]), (&Value::from("bias"), &Value::from("step")));
    assert!((change["size"].as_f64().unwrap() - 0.1).abs() < 4.0 * change["sigma"].as_f64().unwrap(), "{change}");
}

#[test]
fn a_log_that_is_too_short_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("l.csv");
    fs::write(&path, log(100, |_| 0.3)).unwrap();
    let (code, _, error) = north(&["watch", path.to_str().unwrap()]);
    assert!(code == 1 && error.contains("hold 100 fixes"), "{error}");
}

/// Fixes of a campaign become a log, with their references as check azimuths.
#[test]
fn solved_runs_are_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &[&str]| command(line).current_dir(folder.path()).output().unwrap();
    assert!(run(&["simulate", "--runs", "3", "--out", "c"]).status.success());
    let solved = run(&["solve", "c", "--log", "l.csv", "--json", "-"]);
    let solved: Value = serde_json::from_slice(&solved.stdout).unwrap();
    let mut rows = csv::Reader::from_path(folder.path().join("l.csv")).unwrap();
    let header = rows.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|each| each == name).unwrap();
    let rows: Vec<csv::StringRecord> = rows.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 3);
    for (row, run) in rows.iter().zip(solved["runs"].as_array().unwrap()) {
        for (name, of) in
            [("azimuth_deg", "azimuth_deg"), ("bias_deg_h", "bias_deg_h"), ("check_deg", "reference_azimuth_deg")]
        {
            assert_eq!(row[column(name)].parse::<f64>().unwrap(), run[of].as_f64().unwrap());
        }
        assert!((row[column("temp_c")].parse::<f64>().unwrap() - 20.0).abs() < 5.0);
    }
}

/// The coefficient that moved, the history drawn, and a model made anew of runs: their bias, and refused where they cannot show what changed.
#[test]
fn the_coefficient_that_moved_and_the_model_of_runs_since() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (bad, model, page) = (path("bad.csv"), path("m.toml"), path("r.html"));
    fs::write(&bad, log(200, |fix| if fix >= 150 { 0.4 } else { 0.3 })).unwrap();
    fs::write(&model, "format = 2\nbias_deg_h = 0.05\n").unwrap();
    assert_eq!(north(&["simulate", "--runs", "4", "--out", &path("runs")]).0, 0);
    let (new, runs) = (path("new.toml"), path("runs"));
    let line = ["watch", &bad, "--model", &model, "--report", &page, "--runs", &runs, "--model-out", &new];
    let (code, said, error) = north(&line);
    assert!(code == 1 && error.contains("no longer holds"), "{said}{error}");
    assert!(said.contains("in the model: bias_deg_h is 0.050000 °/h, and has moved by +0."), "{said}");
    assert!(said.contains("To do: bias cancels in every azimuth. Record 2 runs at one heading"), "{said}");
    let drawn = fs::read_to_string(&page).unwrap();
    assert!(drawn.contains("The upright line is fix 150") && drawn.matches("<figure>").count() == 4, "{drawn}");
    // The runs with the old model have this bias left.
    let (_, solved, _) = north(&["solve", &runs, "--model", &model, "--json", "-"]);
    let solved: Value = serde_json::from_str(&solved).unwrap();
    let roles: toml::Table = fs::read_to_string(format!("{runs}/campaign.toml")).unwrap().parse().unwrap();
    let of_role = solved["runs"].as_array().unwrap().iter().zip(roles["run"].as_array().unwrap());
    let fit: Vec<f64> = of_role
        .filter(|(_, run)| run.get("role").is_some_and(|role| role.as_str() == Some("fit")))
        .map(|(run, _)| run["bias_deg_h"].as_f64().unwrap())
        .collect();
    let written: toml::Table = fs::read_to_string(&new).unwrap().parse().unwrap();
    let expected = 0.05 + fit.iter().sum::<f64>() / fit.len() as f64;
    assert_eq!(fit.len(), 2);
    assert!((written["bias_deg_h"].as_float().unwrap() - expected).abs() < 1e-9, "{written:?} {expected}");

    // An azimuth that is wrong shows at eight surveyed headings, not at two.
    let text = log(200, |_| 0.3).replace(",temp_c\n", ",temp_c,check_deg\n");
    let wrong = |(row, line): (usize, &str)| match row {
        0 => line.to_owned(),
        1..150 => format!("{line},{}", 40.0 + 0.01 * (row as f64 * 1.3).sin()),
        _ => format!("{line},{}", 40.2 + 0.01 * (row as f64 * 1.3).sin()),
    };
    fs::write(path("wrong.csv"), text.lines().enumerate().map(wrong).collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let wrong = path("wrong.csv");
    let (code, said, error) = north(&["watch", &wrong, "--runs", &runs, "--model-out", &path("other.toml")]);
    assert!(code == 1 && said.contains("Record 8 runs at surveyed headings"), "{said}{error}");
    assert!(error.contains("these runs cannot show what changed: 2 runs"), "{error}");
    assert!(!folder.path().join("other.toml").exists());
}

/// One empty field, and a signal is not watched: that is said, not passed over.
#[test]
fn what_is_not_watched_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (gap, page) = (path("gap.csv"), path("r.html"));
    let without = |(row, line): (usize, &str)| {
        let mut fields: Vec<&str> = line.split(',').collect();
        if row == 57 {
            fields[7] = "";
        }
        fields.join(",") + "\n"
    };
    let text: String = log(200, |fix| if fix >= 150 { 0.4 } else { 0.3 }).lines().enumerate().map(without).collect();
    fs::write(&gap, text).unwrap();
    let (code, said, error) = north(&["watch", &gap, "--report", &page]);
    let sentence = "bias is not watched: 1 of 200 fixes lack it, the first of them fix 57";
    assert!(code == 0 && said.contains(&format!("left out   {sentence}")), "{said}{error}");
    assert!(fs::read_to_string(&page).unwrap().contains(sentence));
    let (_, said, _) = north(&["watch", &gap, "--json", "-"]);
    let found: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(found["left_out"], serde_json::json!([{"signal": "bias", "lacking": 1, "first_fix": 57}]));
}

/// Another error model has another bias left: no change of the instrument. The board begins anew with it, too.
#[test]
fn the_watch_begins_anew_with_another_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("l.csv");
    let of_models = |count: u32| {
        let log = log(count, |fix| if fix >= 200 { 0.0 } else { 0.3 });
        let model = |(row, line): (usize, &str)| match row {
            0 => format!("{line},model\n"),
            1..200 => format!("{line},00c0ffee\n"),
            _ => format!("{line},deadbeef\n"),
        };
        log.lines().enumerate().map(model).collect::<String>()
    };
    fs::write(&path, of_models(350)).unwrap();
    let (code, said, error) = north(&["watch", path.to_str().unwrap()]);
    assert!(code == 0 && said.contains("151 fixes, ") && said.contains("holds      51 fixes watched"), "{said}{error}");
    assert!(said.contains("left out   199 fixes before these, made with another error model"), "{said}");
    fs::write(&path, of_models(250)).unwrap();
    let (code, _, error) = north(&["watch", path.to_str().unwrap()]);
    assert!(code == 1 && error.contains("51 fixes of the last error model, after 199 of others"), "{error}");
}

/// As the help has it: one log a year, each of a campaign that counts its runs from the first.
#[test]
fn logs_of_two_years_are_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &[&str]| command(line).current_dir(folder.path()).output().unwrap();
    for (year, seed) in [("2025", "1"), ("2026", "7")] {
        assert!(run(&["simulate", "--runs", "2", "--seed", seed, "--out", year]).status.success());
        assert!(run(&["solve", year, "--log", &format!("{year}.csv")]).status.success());
    }
    let watched = run(&["watch", "2025.csv", "2026.csv"]);
    let error = String::from_utf8_lossy(&watched.stderr);
    assert!(error.contains("2026.csv: its fixes are counted from 1 anew; here they go on from 3"), "{error}");
    assert!(error.contains("the logs hold 4 fixes"), "{error}");
}
