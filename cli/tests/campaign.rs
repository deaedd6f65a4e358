//! Campaigns: what is written is read again, every digit; what is wrong is refused with its place.

use std::fs;
use std::path::Path;

use north::campaign::{Campaign, CampaignWriter, Instrument, Layout, Role, Row, Run, RunReader, RunWriter};
use north_finder::sensing::level::Specific;
use proptest::prelude::*;

fn read(text: &str) -> Result<Vec<Row>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    fs::write(&path, text).unwrap();
    let without_folder =
        |error: north::file_error::FileError| error.to_string().replace(&format!("{}/", folder.path().display()), "");
    RunReader::open(&path).map_err(without_folder)?.collect::<Result<_, _>>().map_err(without_folder)
}

fn read_manifest(text: &str) -> Result<Campaign, String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("campaign.toml"), text).unwrap();
    Campaign::read(folder.path())
        .map_err(|error| error.to_string().replace(&format!("{}/", folder.path().display()), ""))
}

#[test]
fn intervals_are_the_steps_and_the_first_is_since_zero() {
    let rows = read("t_s,index_deg,fog_arcsec\n0.5,0,1\n1.5,0,2\n4.0,0,3\n").unwrap();
    assert_eq!(rows.iter().map(|row| row.interval_s).collect::<Vec<_>>(), [0.5, 1.0, 2.5]);
}

#[test]
fn a_first_row_at_zero_takes_the_median_step() {
    let rows = read("t_s,index_deg,fog_arcsec\n0,0,1\n1,0,2\n2,0,3\n7,0,3\n").unwrap();
    assert_eq!(rows.iter().map(|row| row.interval_s).collect::<Vec<_>>(), [1.0, 1.0, 1.0, 5.0]);
    let even = read("t_s,index_deg,fog_arcsec\n0,0,1\n1,0,2\n4,0,3\n").unwrap();
    assert_eq!(even[0].interval_s, 2.0);
}

#[test]
fn a_recording_may_begin_late_and_not_at_another_zero() {
    // No row is longer than 900 s: the first hour is not in the file.
    let rows = read("t_s,index_deg,fog_arcsec\n3601,0,1\n3602,0,2\n3603,0,3\n").unwrap();
    assert_eq!(
        rows.iter().map(|row| (row.t_s, row.interval_s)).collect::<Vec<_>>(),
        [(3601.0, 1.0), (3602.0, 1.0), (3603.0, 1.0)]
    );
    let error = read("t_s,index_deg,fog_arcsec\n1700000001,0,1\n1700000002,0,2\n").unwrap_err();
    assert!(
        error.starts_with(
            "run.csv, line 2, column 1 (t_s): \"1700000001\" is not allowed; allowed is 0 to 86400 in the first row"
        ),
        "{error}"
    );
}

/// A clock that is set during a run jumps by years; a night without rows is a gap.
#[test]
fn a_clock_that_jumps_within_a_run_is_refused_with_its_row() {
    let head = "t_s,index_deg,fog_arcsec\n";
    assert_eq!(read(&format!("{head}1,0,1\n2,0,2\n43202,0,3\n43203,0,4\n")).unwrap().len(), 4);
    for (rows, line) in [("1,0,1\n2,0,2\n64000002,0,3\n64000003,0,4\n", 4), ("1,0,1\n64000001,0,2\n64000002,0,3\n", 3)]
    {
        let error = read(&format!("{head}{rows}")).unwrap_err();
        let told = format!("run.csv, line {line}, column 1 (t_s): \"a gap of 64000000 s\" is not allowed");
        assert!(error.starts_with(&told), "{error}");
    }
}

#[test]
fn lines_may_end_with_carriage_returns() {
    let rows = read("t_s,index_deg,fog_arcsec\r1,0,1\r2,0,2\r").unwrap();
    assert_eq!(rows.iter().map(|row| row.fog_arcsec).collect::<Vec<_>>(), [1.0, 2.0]);
    let error = read("t_s,index_deg,fog_arcsec\r1,0,1\r2,0,x\r").unwrap_err();
    assert!(error.starts_with("run.csv, line 3, column 3 (fog_arcsec)"), "{error}");
}

#[test]
fn a_given_latitude_holds_where_the_campaign_gives_none() {
    let folder = tempfile::tempdir().unwrap();
    let text = "format = 1\n[[run]]\nfile = \"a.csv\"\n[[run]]\nfile = \"b.csv\"\nlatitude_deg = -34\n";
    fs::write(folder.path().join("campaign.toml"), text).unwrap();
    assert!(Campaign::read(folder.path()).unwrap_err().to_string().contains("this run has no latitude_deg"));
    let campaign = Campaign::read_at(folder.path(), Some(60.0)).unwrap();
    let latitudes: Vec<_> = campaign.runs.iter().map(|run| campaign.latitude_of(run)).collect();
    assert_eq!(latitudes, [Some(60.0), Some(-34.0)]);
}

#[test]
fn columns_come_in_any_order_and_others_are_kept_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    let text = "\u{feff}supply_v, ay_g ,temp_c,fog_arcsec,ax_g,index_deg,t_s,field_nt,level_temp_c\r\n5,0.2,20,1,0.1,-370.5,1,9,21\r\n";
    fs::write(&path, text).unwrap();
    let mut reader = RunReader::open(&path).unwrap();
    assert_eq!(reader.channels(), ["supply_v", "field_nt"]);
    let row = reader.next().unwrap().unwrap();
    assert_eq!(
        row,
        Row {
            t_s: 1.0,
            interval_s: 1.0,
            index_deg: -370.5,
            fog_arcsec: 1.0,
            temp_c: Some(20.0),
            level: Some(Specific { forward: 0.1, left: 0.2 }),
            level_temp_c: Some(21.0),
            lost_frames: 0,
            own: None,
            extra: vec![5.0, 9.0],
        }
    );
    assert!(reader.next().is_none());
}

#[test]
fn one_level_accelerometer_alone_is_an_extra_channel() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    fs::write(&path, "t_s,index_deg,fog_arcsec,ax_g\n1,0,1,0.1\n").unwrap();
    let mut reader = RunReader::open(&path).unwrap();
    assert_eq!(reader.channels(), ["ax_g"]);
    assert_eq!(reader.next().unwrap().unwrap().level, None);
}

#[test]
fn bad_runs_are_refused_with_their_place() {
    let head = "t_s,index_deg,fog_arcsec";
    let number = "is not allowed; allowed is a finite decimal number";
    for (text, expected) in [
        ("".to_owned(), "run.csv: the file is empty; a header row is needed".to_owned()),
        (format!("{head}\n"), "run.csv: no data rows follow the header".into()),
        (
            "t_s,index_deg,temp_c\n1,2,3\n".into(),
            "run.csv, line 1: column `fog_arcsec` is missing; the header has: t_s, index_deg, temp_c".into(),
        ),
        (
            "1,0,1.5\n2,0,1.5\n".into(),
            "run.csv, line 1: column `t_s` is missing; the header has: 1, 0, 1.5".into(),
        ),
        (
            format!("{head},temp_c,t_s\n"),
            "run.csv, line 1, column 5 (t_s): column name \"t_s\" appears twice; the first is column 1".into(),
        ),
        (format!("{head},,v\n"), "run.csv, line 1, column 4 (): a column has no name".into()),
        (format!("{head}\n1,0,1\n2,0\n"), "run.csv, line 3: 2 fields; the header has 3".into()),
        (format!("{head}\n1,0,1\n2,0,1,4\n"), "run.csv, line 3: 4 fields; the header has 3".into()),
        (format!("{head}\n1,0,1\n2,0,abc\n"), format!("run.csv, line 3, column 3 (fog_arcsec): \"abc\" {number}")),
        (format!("{head}\n1,0,1\n2,,1\n"), format!("run.csv, line 3, column 2 (index_deg): \"\" {number}")),
        (format!("{head}\r\n1,0,1\r\n2,0,NaN\r\n"), format!("run.csv, line 3, column 3 (fog_arcsec): \"NaN\" {number}")),
        (format!("{head}\n1,0,1\n\n\n2,inf,1\n"), format!("run.csv, line 5, column 2 (index_deg): \"inf\" {number}")),
        (format!("{head}\r\n1,0,1\r\n\r\n2,inf,1"), format!("run.csv, line 4, column 2 (index_deg): \"inf\" {number}")),
        (format!("{head}\n1,0,1e999\n"), format!("run.csv, line 2, column 3 (fog_arcsec): \"1e999\" {number}")),
        (format!("{head},supply_v\n1,0,1,x\n"), format!("run.csv, line 2, column 4 (supply_v): \"x\" {number}")),
        (
            format!("{head}\n1,0,1\n1,0,1\n"),
            "run.csv, line 3, column 1 (t_s): time 1 is not later than the previous row's 1; `t_s` must increase from \
             row to row"
                .into(),
        ),
        (
            format!("{head}\n-1,0,1\n"),
            "run.csv, line 2, column 1 (t_s): \"-1\" is not allowed; allowed is 0 or more: seconds from the run's start"
                .into(),
        ),
        (
            format!("{head}\n0,0,1\n"),
            "run.csv: a single row at t_s = 0 has no interval; give its end, or a second row".into(),
        ),
        (
            format!("{head},lost_frames\n1,0,1,2.5\n"),
            "run.csv, line 2, column 4 (lost_frames): \"2.5\" is not allowed; allowed is a whole number from 0 to 65535"
                .into(),
        ),
    ] {
        assert_eq!(read(&text).unwrap_err(), expected, "for {text:?}");
    }
}

#[test]
fn a_missing_run_is_named() {
    let error = RunReader::open(Path::new("no/such.csv")).unwrap_err().to_string();
    assert_eq!(error, "no/such.csv: No such file or directory (os error 2)");
}

#[test]
fn a_recording_under_two_names_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write(
        "campaign.toml",
        "format = 1\nlatitude_deg = 1\nrun = [{ file = \"a\" }, { file = \"b\" }, { file = \"c\" }]\n",
    );
    write("a", "t_s,index_deg,fog_arcsec\n1,0,1\n");
    write("b", "t_s,index_deg,fog_arcsec\n1,0,2\n");
    write("c", "t_s,index_deg,fog_arcsec\n1,0,22\n");
    let campaign = Campaign::read(folder.path()).unwrap();
    campaign.check_copies().unwrap();
    write("c", "t_s,index_deg,fog_arcsec\n1,0,1\n");
    let error = campaign.check_copies().unwrap_err().to_string();
    assert!(error.ends_with("/c: the same recording as a: it would count twice"), "{error}");
}

#[test]
fn nothing_follows_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    fs::write(&path, "t_s,index_deg,fog_arcsec\n1,0,x\n2,0,1\n").unwrap();
    let mut reader = RunReader::open(&path).unwrap();
    assert!(reader.next().unwrap().is_err());
    assert!(reader.next().is_none());
}

#[test]
fn the_documented_campaign_is_read() {
    let campaign = read_manifest(
        r#"
format = 1
title = "acceptance, unit 7"
latitude_deg = 34.75
[instrument]
name = "unit 7"
arw_deg_per_sqrt_h = 0.0015
[[run]]
file = "runs/001.csv"
role = "fit"
reference_azimuth_deg = 12.345678
reference_sigma_deg = 0.001
latitude_deg = -34
started = "2026-05-04T09:00:00Z"
[[run]]
file = "runs/002.csv"
"#,
    )
    .unwrap();
    assert_eq!(campaign.runs[0].role, Role::Fit);
    assert_eq!(campaign.latitude_of(&campaign.runs[0]), Some(-34.0));
    assert_eq!(campaign.runs[1].role, Role::Check);
    assert_eq!(campaign.latitude_of(&campaign.runs[1]), Some(34.75));
    assert_eq!(campaign.instrument.unwrap().arw_deg_per_sqrt_h, Some(0.0015));
}

#[test]
fn bad_manifests_are_refused_with_their_place() {
    let good = "format = 1\nlatitude_deg = 34.75\n";
    let run = "[[run]]\nfile = \"a.csv\"\n";
    for (text, expected) in [
        ("latitude_deg = 34.75\n".to_owned(), "campaign.toml: the first line must be `format = 1`; no format is given"),
        (
            "format = 2\nshape = \"new\"\n".into(),
            "campaign.toml, line 1, column 10: \"format = 2\" is not allowed; allowed is format = 1",
        ),
        (
            "format = \"1\"\n".into(),
            "campaign.toml, line 1, column 10: `format`: invalid type: string \"1\", expected a whole number",
        ),
        (good.into(), "campaign.toml: no [[run]] is listed; a campaign has at least one"),
        (
            format!("{good}latitude = 3\n{run}"),
            "campaign.toml, line 3, column 1: unknown field `latitude`, expected one of `title`, `latitude_deg`, \
             `instrument`, `run`",
        ),
        (
            format!("{good}{run}rol = \"fit\"\n"),
            "campaign.toml, line 5, column 1: unknown field `rol`, expected one of `file`, `role`, \
             `reference_azimuth_deg`, `reference_sigma_deg`, `latitude_deg`, `station`, `started`",
        ),
        (
            format!("{good}{run}role = \"judge\"\n"),
            "campaign.toml, line 5, column 8: `run[1].role`: unknown variant `judge`, expected `fit` or `check`",
        ),
        (format!("{good}[[run]]\nrole = \"fit\"\n"), "campaign.toml, line 3, column 1: missing field `file`"),
        (
            format!("format = 1\nlatitude_deg = 91\n{run}"),
            "campaign.toml, line 2, column 16: \"latitude_deg = 91\" is not allowed; allowed is -90 to 90",
        ),
        (
            format!("format = 1\nlatitude_deg = nan\n{run}"),
            "campaign.toml, line 2, column 16: \"latitude_deg = NaN\" is not allowed; allowed is -90 to 90",
        ),
        (
            format!("format = 1\nlatitude_deg = \"34\"\n{run}"),
            "campaign.toml, line 2, column 16: `latitude_deg`: invalid type: string \"34\", expected a number",
        ),
        (
            format!("format = 1\n{run}"),
            "campaign.toml, line 2, column 1: this run has no latitude_deg, and the campaign gives none for all",
        ),
        (
            format!("{good}{run}reference_azimuth_deg = inf\n"),
            "campaign.toml, line 5, column 25: \"reference_azimuth_deg = inf\" is not allowed; allowed is -360 to 360",
        ),
        (
            format!("{good}{run}{run}"),
            "campaign.toml, line 6, column 8: \"file = a.csv\" is not allowed; allowed is a file listed only once",
        ),
        (
            format!("{good}[[run]]\nfile = \"/etc/passwd\"\n"),
            "campaign.toml, line 4, column 8: \"file = /etc/passwd\" is not allowed; allowed is a path relative to the \
             campaign's folder",
        ),
        (
            format!("{good}{run}started = \"yesterday\"\n"),
            "campaign.toml, line 5, column 11: \"started = yesterday\" is not allowed; allowed is an RFC 3339 time \
             such as 2026-05-04T09:00:00Z",
        ),
        (
            format!("{good}[instrument]\narw_deg_per_sqrt_h = -1\n{run}"),
            "campaign.toml, line 4, column 22: \"arw_deg_per_sqrt_h = -1\" is not allowed; allowed is 0 to 1",
        ),
        (format!("{good}[[run]\n"), "campaign.toml, line 3, column 7: unclosed array table, expected `]`"),
    ] {
        assert_eq!(read_manifest(&text).unwrap_err(), expected, "for {text:?}");
    }
}

/// What a recording that goes on has written is kept; what one that was interrupted has left gives way.
#[test]
fn a_second_recording_into_a_folder_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign { folder: folder.path().to_owned(), ..Campaign::of_bare_run(Path::new("x"), 0.0) };
    let run = folder.path().join("runs/001.csv");
    let first = CampaignWriter::create(campaign.clone()).unwrap();
    fs::write(&run, "t_s,index_deg,fog_arcsec\n").unwrap();
    for refused in [
        CampaignWriter::create(campaign.clone()).err(),
        CampaignWriter::check_free(folder.path()).err(),
        CampaignWriter::check_free_for_measurements(folder.path()).err(),
    ] {
        let error = refused.unwrap().to_string();
        assert!(error.contains("another north is writing a recording into this folder"), "{error}");
    }
    assert!(run.exists());
    drop(first);
    CampaignWriter::create(campaign).unwrap().finish().unwrap();
    assert!(!run.exists());
}

#[test]
fn recordings_are_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let campaign = Campaign { folder: folder.path().to_owned(), ..Campaign::of_bare_run(Path::new("x"), 0.0) };
    CampaignWriter::create(campaign.clone()).unwrap().finish().unwrap();
    let error = CampaignWriter::create(campaign).err().unwrap().to_string();
    assert!(
        error.ends_with(
            "the folder is not empty; recordings are never overwritten: name a new folder or empty this one"
        )
    );
}

#[test]
fn a_row_without_a_promised_value_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    let layout = Layout { temperature: true, ..Layout::default() };
    let error = RunWriter::create(&path, layout).unwrap().write(&Row::default()).unwrap_err();
    assert!(error.to_string().ends_with("this row lacks a value for column `temp_c`"));
}

fn finite() -> impl Strategy<Value = f64> {
    prop::num::f64::NORMAL | prop::num::f64::ZERO | prop::num::f64::SUBNORMAL
}

prop_compose! {
    fn rows(extra: usize)(
        steps in prop::collection::vec(1e-4..900.0f64, 1..40),
        fields in prop::collection::vec((finite(), finite(), finite(), [finite(), finite()], any::<u16>()), 40),
        channels in prop::collection::vec(prop::collection::vec(finite(), extra), 40),
    ) -> Vec<Row> {
        let mut t_s = 0.0;
        steps.iter().zip(fields).zip(channels).map(|((step_s, field), extra)| {
            let previous_s = t_s;
            t_s += step_s;
            let (index_deg, fog_arcsec, temp_c, [forward, left], lost_frames) = field;
            let interval_s = t_s - previous_s;
            Row {
                t_s, interval_s, index_deg, fog_arcsec, lost_frames, own: None, extra,
                temp_c: Some(temp_c), level: Some(Specific { forward, left }), level_temp_c: Some(temp_c),
            }
        }).collect()
    }
}

proptest! {
    #[test]
    fn a_written_campaign_is_read_back_bit_for_bit(
        rows in rows(2),
        latitude_deg in -90.0..=90.0f64,
        azimuth_deg in 0.0..360.0f64,
        arw in prop::option::of(0.0..1.0f64),
    ) {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("campaign");
        let campaign = Campaign {
            folder: folder.clone(),
            title: Some("a \"quoted\" title".into()),
            latitude_deg: Some(latitude_deg),
            instrument: Some(Instrument { name: Some("unit 7".into()), arw_deg_per_sqrt_h: arw, settings: None }),
            runs: Vec::new(),
        };
        let run = Run {
            file: "runs/001.csv".into(),
            role: Role::Fit,
            reference_azimuth_deg: Some(azimuth_deg),
            started: Some("2026-05-04T09:00:00Z".into()),
            ..Run::default()
        };
        let mut writer = CampaignWriter::create(campaign.clone()).unwrap();
        let extra = vec!["supply_v".to_owned(), "odd, name".to_owned()];
        let extra_names = extra.clone();
        let layout = Layout {
            temperature: true, level: true, level_temperature: true, lost_frames: true, own: None, extra: extra_names,
        };
        let mut run_writer = writer.run(&run.file, layout).unwrap();
        for row in &rows {
            run_writer.write(row).unwrap();
        }
        run_writer.finish().unwrap();
        writer.add(run.clone());
        writer.finish().unwrap();

        let read = Campaign::read(&folder).unwrap();
        prop_assert_eq!(&read, &Campaign { runs: vec![run], ..campaign });
        let reader = RunReader::open(&read.path_of(&read.runs[0])).unwrap();
        prop_assert_eq!(reader.channels(), &extra);
        let read_rows = reader.collect::<Result<Vec<_>, _>>().unwrap();
        prop_assert_eq!(read_rows, rows);
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "[ -~\n\r,\"0-9.]{0,200}") {
        let _ = read(&text);
        let _ = read(&format!("t_s,index_deg,fog_arcsec\n{text}"));
        let _ = read_manifest(&text);
    }
}
