//! The HTML report: complete, self-contained, and safe whatever names a campaign brings.

use std::collections::BTreeMap;
use std::path::Path;

use north::campaign::Role;
use north::diagnose::{
    Ask, Candidate, Diagnosis, Effect, Experiment, NoiseTests, Origin, Rejected, RunDiagnosis, RunSeries, Spectra,
    Test, Warning,
};
use north::report::diagnosis;
use north_finder::effects::ErrorModel;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const RUNS: usize = 12;
const SECONDS: usize = 256;

/// A run with a temperature that rises and settles; its rate adds 9 °/h per K/s, and after learning only noise is left.
fn series(run: usize, rng: &mut ChaCha8Rng) -> RunSeries {
    let t_s: Vec<f64> = (0..SECONDS).map(|i| i as f64 + 0.5).collect();
    let size_k = 1.0 + 0.3 * run as f64;
    let temp_c: Vec<f64> = t_s.iter().map(|t| 25.0 - size_k * (-t / 90.0).exp()).collect();
    let noise: Vec<f64> = t_s.iter().map(|_| 0.15 * (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>()).collect();
    let effect = t_s.iter().map(|t| 9.1 * size_k / 90.0 * (-t / 90.0).exp());
    RunSeries {
        file: format!("runs/{:03}.csv", run + 1),
        seconds: vec![1.0; SECONDS],
        index_deg: t_s.iter().map(|t| 90.0 * (t / 64.0).floor()).collect(),
        residual_before_deg_h: noise.iter().zip(effect).map(|(noise, effect)| noise + effect - 0.08).collect(),
        residual_after_deg_h: noise,
        channels: BTreeMap::from([("temp_c".to_owned(), temp_c)]),
        t_s,
    }
}

#[expect(clippy::too_many_lines, reason = "every field of a diagnosis")]
fn diagnosis() -> Diagnosis {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut error = |size: f64| size * (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
    let runs = (0..RUNS)
        .map(|run| RunDiagnosis {
            file: format!("runs/{:03}.csv", run + 1),
            role: if run % 2 == 0 { Role::Fit } else { Role::Check },
            azimuth_before_deg: Some(30.0 * run as f64 + 1.4),
            azimuth_after_deg: Some(30.0 * run as f64),
            sigma_before_deg: Some(0.12),
            sigma_after_deg: Some(0.11),
            error_before_deg: Some(1.4 + error(0.6)),
            error_after_deg: Some(error(0.11)),
            reference_azimuth_deg: Some(30.0 * run as f64),
            ..RunDiagnosis::default()
        })
        .collect();
    let frequency_hz: Vec<f64> = (1..128).map(|i| f64::from(i) / 256.0).collect();
    let tau_s: Vec<f64> = (0..7).map(|i| 2f64.powi(i)).collect();
    let white: Vec<f64> = tau_s.iter().map(|tau| 0.15 / tau.sqrt()).collect();
    let test = |name: &str, passed| Test {
        name: name.into(),
        about: "Is the residual of one second independent of the one before?".into(),
        statistic: 3.0,
        p_value: if passed { 0.43 } else { 1e-12 },
        passed,
        not_applied: None,
    };
    let candidate = |name: &str, taken: bool, p: f64, why: &str| Candidate {
        name: name.into(),
        kind: "bias",
        channel: Some("temp_c".into()),
        freedom: 1,
        improvement: 812.0,
        p_value: p / 40.0,
        p_value_searched: p,
        taken,
        why: why.into(),
    };
    Diagnosis {
        title: Some("acceptance, unit 7".into()),
        origin: Origin {
            version: "9.8.7",
            made: Some("2026-05-04".into()),
            instrument: Some("unit 7".into()),
            latitude_deg: Some(34.75),
        },
        verdict:
            "The rate of change of temp_c adds 9.1 ± 0.2 °/h per K/s; with it in the model the azimuth error falls \
                  from 1.52° to 0.11° rms on runs that took no part."
                .into(),
        runs,
        effects: vec![Effect {
            name: "temperature-rate".into(),
            kind: "bias",
            channel: Some("temp_c".into()),
            channels: vec!["temp_c".into()],
            parameters: BTreeMap::from([("deg_h_per_k_per_s".to_owned(), 9.1234)]),
            sigma: BTreeMap::from([("deg_h_per_k_per_s".to_owned(), 0.213)]),
            p_value: 1e-12,
            ambiguous_with: vec!["warm-up".into()],
            evidence: "explains 94 % of the residual beyond noise, in every run with one sign".into(),
            board: true,
        }],
        rejected: vec![Rejected { name: "drift".into(), channel: None, why: "nothing left once it is taken".into() }],
        candidates: vec![
            candidate("temperature-rate", true, 1e-12, "the best, and it holds on runs that were left out"),
            candidate("warm-up", false, 3e-10, "explains less, and nothing once temperature-rate is taken"),
            candidate("temperature", false, 0.73, "no more than chance"),
        ],
        residual_rms_before_deg_h: 0.212,
        residual_rms_after_deg_h: 0.1501,
        azimuth_rms_before_deg: Some(1.52),
        azimuth_rms_after_deg: Some(0.112),
        azimuth_rms_board_deg: Some(0.112),
        residual_of: "second",
        rate_rms_before_deg_h: None,
        rate_rms_after_deg_h: None,
        station_spread_before_deg: None,
        station_spread_after_deg: None,
        board_lacks: Vec::new(),
        inseparable: Vec::new(),
        azimuth_rms_before_interval_deg: Some([1.2, 1.81]),
        azimuth_rms_after_interval_deg: Some([0.08, 0.14]),
        judged_runs: 6,
        leave_one_out: None,
        family: None,
        judged_on: Some("check-runs"),
        unexplained: false,
        unexplained_evidence: Vec::new(),
        withdrawn: None,
        missed_references: Vec::new(),
        next_experiment: Some(Experiment {
            asks: Ask::Runs,
            description: "Six runs in the mirrored order, started cold and warm by turns, tell the two apart.".into(),
            order_deg: vec![0.0, 90.0, 180.0, 270.0, 270.0, 180.0, 90.0, 0.0],
            headings_deg: vec![0.0, 90.0],
            dwell_s: 32.0,
            separates: vec!["temperature-rate".into(), "warm-up".into()],
            warm_up_s: 0.0,
            pitch_deg: 0.0,
            roll_deg: 0.0,
            like: "runs/001.csv".into(),
            expected_log_odds: Some(12.0),
            sigma_now_deg: 0.11,
            sigma_then_deg: 0.06,
        }),
        noise: NoiseTests {
            noise_deg_h: 0.15,
            declared_noise_deg_h: Some(0.15),
            before: vec![test("whiteness", false), test("closure", true)],
            after: vec![test("whiteness", true), test("closure", true)],
        },
        warnings: vec![Warning {
            of_many: None,
            other: None,
            run: Some("runs/005.csv".into()),
            line: Some(118),
            message: "a second stands 9 sigma out; it was left out".into(),
        }],
        model: ErrorModel::default(),
        series: {
            let mut rng = ChaCha8Rng::seed_from_u64(11);
            (0..RUNS).map(|run| series(run, &mut rng)).collect()
        },
        spectra: Spectra {
            power_before: frequency_hz.iter().map(|f| 1.0 + 0.004 / (f * f)).collect(),
            power_after: frequency_hz.iter().map(|f| 1.0 + 0.3 * (400.0 * f).sin()).collect(),
            frequency_hz,
            allan_before_deg_h: white.iter().zip(&tau_s).map(|(white, tau)| white.hypot(0.01 * tau.sqrt())).collect(),
            allan_after_deg_h: white.clone(),
            allan_white_deg_h: white,
            tau_s,
        },
    }
}

/// Opening tags without their closing ones, in order.
fn unclosed(html: &str) -> Vec<String> {
    const VOID: [&str; 2] = ["meta", "!doctype"];
    let mut open: Vec<String> = Vec::new();
    for tag in html.split('<').skip(1) {
        let inside = tag.split('>').next().unwrap_or_default();
        let name = inside.split([' ', '\n']).next().unwrap_or_default();
        if let Some(closed) = name.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(closed), "near {inside}");
        } else if !inside.ends_with('/') && !VOID.contains(&name) {
            open.push(name.to_owned());
        }
    }
    open
}

#[test]
fn the_page_is_whole_and_fetches_nothing() {
    let html = diagnosis::html(&diagnosis());
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html");
    std::fs::write(path, &html).unwrap();
    assert_eq!(unclosed(&html), Vec::<String>::new());
    for foreign in ["<script", "http:", "https:", "url(", "@import", "src="] {
        assert!(!html.contains(foreign), "{foreign}");
    }
    for part in ["acceptance, unit 7", "9.12 ± 0.21", "°/h per K/s", "1.52 → 0.112°", "✓ taken", "mirrored order"]
    {
        assert!(html.contains(part), "{part}");
    }
    assert_eq!(html.matches("href=").count(), html.matches("href=\"data:").count(), "a link leaves the page");
    for part in ["north 9.8.7", "2026-05-04", "instrument unit 7", "latitude 34.75", "dwells.csv", "runs.csv"] {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("NaN") && !html.contains("inf\""), "a number that is none was drawn");
    assert!(html.len() < 1_000_000, "{} bytes", html.len());
}

#[test]
fn names_from_a_campaign_cannot_break_the_page() {
    let mut diagnosis = diagnosis();
    let evil = "<script>alert(\"1\")</script>&".to_owned();
    diagnosis.title = Some(evil.clone());
    diagnosis.verdict = evil.clone();
    diagnosis.effects[0].channel = Some(evil.clone());
    diagnosis.effects[0].evidence = evil.clone();
    diagnosis.candidates[0].channel = Some(evil.clone());
    for run in &mut diagnosis.series {
        let values = run.channels.remove("temp_c").unwrap();
        run.channels.insert(evil.clone(), values);
    }
    diagnosis.runs[0].file = evil.clone();
    diagnosis.warnings[0].message = evil;
    let html = diagnosis::html(&diagnosis);
    assert!(!html.contains("<script"));
    assert_eq!(unclosed(&html), Vec::<String>::new());
}

#[test]
fn little_is_drawn_of_little() {
    let full = diagnosis();
    let bare = Diagnosis {
        title: None,
        effects: Vec::new(),
        rejected: Vec::new(),
        candidates: Vec::new(),
        azimuth_rms_before_deg: None,
        azimuth_rms_after_deg: None,
        next_experiment: None,
        noise: NoiseTests::default(),
        warnings: Vec::new(),
        series: vec![RunSeries::default()],
        spectra: Spectra::default(),
        runs: vec![RunDiagnosis { file: "runs/001.csv".into(), ..RunDiagnosis::default() }],
        unexplained: true,
        unexplained_evidence: vec!["the periodogram stands at 0.01 Hz".into()],
        ..full
    };
    let html = diagnosis::html(&bare);
    assert_eq!(unclosed(&html), Vec::<String>::new());
    assert!(html.contains("no effect of the grammar explains it") && html.contains("0.01 Hz") && !html.contains("NaN"));
}

#[test]
fn the_model_on_the_page_is_read_as_it_stands() {
    let mut model = ErrorModel { scale_error: 2e-4, ..ErrorModel::default() };
    model.doubt.azimuth_sigma_deg = 0.03;
    let html = diagnosis::html(&Diagnosis { model: model.clone(), ..diagnosis() });
    let (_, rest) = html.split_once("<pre>").unwrap();
    let (text, _) = rest.split_once("</pre>").unwrap();
    let text = text.replace("&quot;", "\"").replace("&#39;", "'").replace("&lt;", "<").replace("&gt;", ">");
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("model-of-the-report.toml");
    std::fs::write(&path, text).unwrap();
    assert_eq!(north::model_file::ModelFile::read(&path).unwrap().error_model.unwrap(), model);
}
