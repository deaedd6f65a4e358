//! Closing the loop with what people really have: unsurveyed stations, still logs, copies of the gyro, dead runs, surveys with a blunder.

use north::campaign::Campaign;
use north::diagnose::{Ask, Diagnosis};
use north_finder::units::wrap_180_deg;

use crate::diagnose::{Folder, Plan, Second, missed, names, run, temp_c};

/// 0.02 °/h for each K: 0.02 · 28 s of a wave of 200 s do not average out in a dwell.
fn warmth(second: &Second) -> f64 {
    0.2 * (temp_c(second) - 20.0)
}

/// Rewrites the rows of a run's file: the fields of each.
fn rewrite(campaign: &Campaign, run: usize, header: &str, row: &mut dyn FnMut(usize, &[&str]) -> String) {
    let path = campaign.path_of(&campaign.runs[run]);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines = text.lines();
    let mut written = format!("{}{header}\n", lines.next().unwrap());
    for (i, line) in lines.enumerate() {
        written += &row(i, &line.split(',').collect::<Vec<_>>());
        written.push('\n');
    }
    std::fs::write(path, written).unwrap();
}

/// All runs at one heading that nobody surveyed.
fn at_one_station(folder: &Folder, effect_deg_h: &dyn Fn(&Second) -> f64) -> Diagnosis {
    let plan = Plan { check: usize::MAX, heading_deg: &|_, _| 123.4, effect_deg_h, ..Plan::default() };
    let mut campaign = plan.make(folder);
    for run in &mut campaign.runs {
        (run.station, run.reference_azimuth_deg) = (Some("pillar".into()), None);
    }
    run(&campaign)
}

/// At one heading nothing is named where nothing is, and the azimuths lie as far apart as their noise says: of a mean over 28 s of 0.09 °/h at eight
/// positions, 0.09/√28 · √(2/8)/9.668 rad = 0.0504°. A mean square of eleven degrees of freedom scatters by √(2/11): within 1 ± 3 · 0.43.
#[test]
fn a_station_without_an_effect() {
    let folder = Folder::new("station-without");
    let diagnosis = at_one_station(&folder, &|_| 0.0);
    assert!(names(&diagnosis).is_empty() && !diagnosis.unexplained, "{}", diagnosis.verdict);
    assert_eq!(diagnosis.judged_on, Some("stations"));
    let [before, after] = [diagnosis.station_spread_before_deg, diagnosis.station_spread_after_deg].map(Option::unwrap);
    assert!(before == after && before / 0.0504 < 1.51, "{before}");
}

/// An effect is found by what it does to runs of one unknown heading, and training runs that took no part come closer together.
#[test]
fn a_station_with_an_effect() {
    let folder = Folder::new("station-with");
    let diagnosis = at_one_station(&folder, &warmth);
    assert!(names(&diagnosis).iter().any(|name| name.contains("temp")), "{}", diagnosis.verdict);
    let [before, after] = [diagnosis.station_spread_before_deg, diagnosis.station_spread_after_deg].map(Option::unwrap);
    assert!(after < 0.5 * before, "{before} {after}");
}

/// A log of two hours at one position: the half that was not learned from has the noise of a second, 0.09 °/h, and a share of 0.2 · sin before: √(0.0081 +
/// 0.02) = 0.168 °/h.
#[test]
fn a_still_log_against_its_temperature() {
    let folder = Folder::new("still-log");
    let campaign =
        Plan { runs: 1, order_deg: &[0.0], rest_s: 7200, effect_deg_h: &warmth, ..Plan::default() }.make(&folder);
    let diagnosis = run(&campaign);
    assert!(names(&diagnosis).iter().any(|name| name.contains("temp")), "{}", diagnosis.verdict);
    let [before, after] = [diagnosis.rate_rms_before_deg_h, diagnosis.rate_rms_after_deg_h].map(Option::unwrap);
    assert!((before - 0.168).abs() < 0.01 && (after - 0.09).abs() < 0.005, "{before} {after}");
}

/// A scaled and delayed copy of the gyro's rate explains everything; it is left out by name.
#[test]
fn a_copy_of_the_gyro_is_no_cause() {
    let folder = Folder::new("copy");
    let campaign = Plan { effect_deg_h: &warmth, ..Plan::default() }.make(&folder);
    for run in 0..campaign.runs.len() {
        let mut rates: Vec<f64> = Vec::new();
        rewrite(&campaign, run, ",logger", &mut |i, fields| {
            rates.push(fields[2].parse().unwrap());
            format!("{},{}", fields.join(","), 3.0 - 0.4 * rates[i.saturating_sub(3)])
        });
    }
    let diagnosis = run(&campaign);
    assert!(diagnosis.warnings.iter().any(|warning| warning.message.contains("`logger` is a copy of the gyro")));
    assert!(names(&diagnosis).iter().all(|name| !name.contains("logger")), "{}", diagnosis.verdict);
}

/// A dead gyro in one run is named, and the rest is diagnosed.
#[test]
fn a_dead_run_stops_nothing() {
    let folder = Folder::new("dead-run");
    let campaign = Plan { effect_deg_h: &warmth, ..Plan::default() }.make(&folder);
    rewrite(&campaign, 4, "", &mut |_, fields| [&fields[..2], &["7.25"], &fields[3..]].concat().join(","));
    let diagnosis = run(&campaign);
    assert!(diagnosis.warnings.iter().any(|warning| warning.run.as_deref() == Some("runs/004.csv")));
    assert!(names(&diagnosis).iter().any(|name| name.contains("temp")), "{}", diagnosis.verdict);
}

/// Two headings that were exchanged in the book: both runs are named as such, no effect is invented, and the real one is found.
#[test]
#[ignore = "a long search: make proofs"]
fn exchanged_headings_are_named_as_such() {
    let folder = Folder::new("exchanged");
    let mut campaign = Plan { runs: 20, effect_deg_h: &warmth, ..Plan::default() }.make(&folder);
    let (a, b) = (campaign.runs[2].reference_azimuth_deg, campaign.runs[8].reference_azimuth_deg);
    (campaign.runs[2].reference_azimuth_deg, campaign.runs[8].reference_azimuth_deg) = (b, a);
    let diagnosis = run(&campaign);
    assert_eq!(missed(&diagnosis).collect::<Vec<_>>(), ["runs/002.csv", "runs/008.csv"]);
    assert_eq!(diagnosis.missed_references[0].exchanged_with.as_deref(), Some("runs/008.csv"));
    assert!(wrap_180_deg(diagnosis.missed_references[0].misses_by_deg + 108.0).abs() < 1.0);
    assert!(names(&diagnosis).iter().all(|name| name.contains("temp")), "{}", diagnosis.verdict);
}

/// A run that holds a stretch of another one, and one that says it was made at the same time, are told; the others are not.
#[test]
fn overlapping_runs_are_told() {
    let folder = Folder::new("overlaps");
    let mut campaign = Plan::default().make(&folder);
    let of = |run: usize| std::fs::read_to_string(campaign.path_of(&campaign.runs[run])).unwrap();
    let (third, fifth) = (of(3), of(5));
    let increments: Vec<&str> = third.lines().skip(1).map(|line| line.split(',').nth(2).unwrap()).collect();
    // The last 130 rows of the third run stand at the beginning of the fifth.
    let taken = &increments[increments.len() - 130..];
    let row = |(i, line): (usize, &str)| {
        let mut fields: Vec<&str> = line.split(',').collect();
        if let Some(other) = i.checked_sub(1).and_then(|row| taken.get(row)) {
            fields[2] = other;
        }
        fields.join(",") + "\n"
    };
    std::fs::write(campaign.path_of(&campaign.runs[5]), fifth.lines().enumerate().map(row).collect::<String>())
        .unwrap();
    for (run, started) in [
        (7, "2026-05-04T09:00:00Z"),
        (8, "2026-05-04T09:04:00Z"),
        (9, "2026-05-04T10:00:00+01:00"),
        (10, "2026-05-04T12:00:00Z"),
    ] {
        campaign.runs[run].started = Some(started.into());
    }
    let diagnosis = run(&campaign);
    let told: Vec<(&str, &str)> = diagnosis
        .warnings
        .iter()
        .filter_map(|each| Some((each.run.as_deref()?, each.message.as_str())))
        .filter(|(_, message)| message.contains("recording") || message.contains("same time"))
        .collect();
    // Runs of 256 s: the eighth began 240 s after the seventh, the ninth at the very time of the seventh.
    let files: Vec<&str> = told.iter().map(|(file, _)| *file).collect();
    assert_eq!(files, ["runs/005.csv", "runs/008.csv", "runs/009.csv", "runs/009.csv"], "{told:?}");
    assert!(told[0].1.starts_with("it holds a stretch of the same recording as runs/003.csv"), "{told:?}");
}

/// At most three sentences of at most 25 words.
fn is_short(description: &str) -> bool {
    let sentences: Vec<&str> = description.split(". ").collect();
    sentences.len() <= 3 && sentences.iter().all(|sentence| sentence.split_whitespace().count() <= 25)
}

/// Something to do next wherever something is not determined: no survey, few runs, one heading; nothing where all is well.
#[test]
fn the_next_experiment_asks_for_what_is_missing() {
    let asked = |name: &str, plan: Plan, change: &dyn Fn(&mut Campaign)| {
        let folder = Folder::new(name);
        let mut campaign = plan.make(&folder);
        change(&mut campaign);
        let experiment = run(&campaign).next_experiment;
        if let Some(experiment) = &experiment {
            assert!(is_short(&experiment.description), "{}", experiment.description);
            assert!(experiment.sigma_then_deg <= experiment.sigma_now_deg, "{experiment:?}");
        }
        experiment.map(|experiment| experiment.asks)
    };
    let unsurveyed = |campaign: &mut Campaign| {
        campaign.runs.iter_mut().for_each(|run| run.reference_azimuth_deg = None);
    };
    let at_a_station = |campaign: &mut Campaign| {
        unsurveyed(campaign);
        campaign.runs.iter_mut().for_each(|run| run.station = Some("pillar".into()));
    };
    assert_eq!(asked("well", Plan::default(), &|_| ()), None);
    assert_eq!(asked("unsurveyed", Plan::default(), &unsurveyed), Some(Ask::Stations));
    let one_heading = || Plan { heading_deg: &|_, _| 123.4, ..Plan::default() };
    assert_eq!(asked("pillar", one_heading(), &at_a_station), Some(Ask::Survey));
    assert_eq!(asked("one-heading", one_heading(), &|_| ()), Some(Ask::Runs));
    assert_eq!(asked("few", Plan { runs: 4, ..Plan::default() }, &|_| ()), Some(Ask::Runs));
}
