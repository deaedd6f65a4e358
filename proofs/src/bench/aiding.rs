//! `north bench aiding`: errors of a simulated ship over what the aided filter says of them, mode by mode.

use std::io::{self, Write};

use clap::Args;
use hal_sim::vessel::satellites::Antennas;
use hal_sim::vessel::ship::{Leg, Modulation, Passage, Voyage, Waves};
use hal_sim::vessel::water::WaterClass;
use indicatif::ProgressBar;
use inertial::filter::measurement::Source;
use inertial::filter::{Mode, StartSigmas, state};
use nalgebra::Vector3;
use north::failure::Failure;
use north::progress;
use serde::Serialize;

use super::{Bench, trials};
use crate::trials::aided::{Aids, Case, Class, Outcome, Snapshot, antennas, run};

/// Heading by aided navigation: errors over seeds, how far the filter's sigmas hold, and which states are observable when
///
/// A ship is simulated in Earth-centred geometry, a fibre-optic block and its aids with random errors; the filter runs for
/// four hours. Each row is the root mean square over the trials, after 1 h and after 4 h. The first table has beside it what a covariance simulation of
/// this project says, made before the filter: it shares the filter's equations, and nothing is judged by it.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north bench aiding\n  north bench aiding --trials 20 --json aiding.json")]
pub struct Aiding {
    /// Runs of each case, 2 to 10000
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..=10_000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// A mean normalised squared error beyond 1 by so many standard deviations of chance (one row in 2000) says that the filter claims more than it knows.
const CLAIMS_SIGMAS: f64 = 3.3;

impl Bench for Aiding {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let tables = [
            ("Moored at 60°, satellite velocity 0.1 m/s and position 5 m each second, first heading 3°", moored_ship()),
            ("Modes", modes()),
        ];
        let cases: usize = tables.iter().map(|(_, lines)| lines.len()).sum();
        let bar = progress::bar(cases as u64 * self.trials, "runs");
        write_preamble(out, self.trials)?;
        let (mut rows, mut observable) = (Vec::new(), Vec::new());
        for (title, lines) in &tables {
            bar.suspend(|| write_head(out, title))?;
            for line in lines {
                let outcomes = self.runs(line, &bar)?;
                for at in [FIRST_HOUR, LAST_HOUR] {
                    let Some(row) = row(line, &outcomes, at) else { continue };
                    bar.suspend(|| write_row(out, &row))?;
                    rows.push(row);
                }
                observable.push((line.name, sigmas(&outcomes)));
            }
        }
        bar.finish_and_clear();
        write_observable(out, &observable)?;
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        // The ship is simulated by geometry that shares nothing with the filter.
        let most =
            |row: &&Row| !(row.nees <= 1.0 + CLAIMS_SIGMAS * (2.0 / (DEGREES_OF_FREEDOM * row.trials as f64)).sqrt());
        let named = |row: &Row| format!("{} after {:.0} h", row.case, row.hours);
        match rows.iter().filter(most).map(named).collect::<Vec<_>>() {
            claims if claims.is_empty() => Ok(()),
            claims => {
                Err(Failure::Refused(format!("errors are larger than the filter's sigmas say: {}", claims.join(", "))))
            }
        }
    }
}

/// Of a normalised squared error: attitude, velocity and position.
const DEGREES_OF_FREEDOM: f64 = 9.0;
/// Snapshots of each half hour: those of the first and of the fourth hour.
const FIRST_HOUR: usize = 1;
const LAST_HOUR: usize = 7;

/// A case with what the covariance simulation says of it.
struct Line {
    name: &'static str,
    passage: Passage,
    class: Class,
    start: StartSigmas,
    aids: Vec<Aids>,
    water: WaterClass,
    antennas: Antennas,
    /// By the covariance simulation: heading after 1 h and 4 h, °.
    covariance_deg: Option<[f64; 2]>,
    /// Scale of z after 1 h, %.
    covariance_scale_percent: Option<f64>,
}

/// One case at one time.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub case: &'static str,
    pub hours: f64,
    pub trials: usize,
    pub covariance_simulation_deg: Option<f64>,
    pub heading_rms_deg: f64,
    pub heading_sigma_deg: f64,
    /// Share of errors within 3 sigma.
    pub within_3_sigma: f64,
    pub scale_z_rms_percent: f64,
    pub scale_z_sigma_percent: f64,
    pub covariance_simulation_scale_z_percent: Option<f64>,
    /// Of both axes.
    pub rhumb_sigma_deg_h: f64,
    pub position_rms_m: f64,
    pub position_sigma_m: f64,
    /// Mean normalised squared error of attitude, velocity and position, per degree of freedom.
    pub nees: f64,
    /// Normalised squared innovations per degree of freedom, all sources, to the end of the run.
    pub nis: f64,
    pub nis_degrees_of_freedom: u32,
    pub rejected: u32,
    pub outages: u32,
    pub ambiguities_fixed: f64,
}

fn moored(amplitude_deg: f64, headings: &[f64], waves: Waves) -> Passage {
    let voyage = Voyage::moored(60.0, 4.0, headings, 1800.0);
    Voyage { modulation: Modulation::harmonic(amplitude_deg), waves, ..voyage }.sail()
}

/// Moored, with what modulation, turns and a heading do.
fn moored_ship() -> Vec<Line> {
    let line = |name, amplitude, covariance_deg| Line {
        name,
        passage: moored(amplitude, &[0.0], Waves::NONE),
        class: Class::FOG,
        start: StartSigmas::USUAL,
        aids: vec![Aids::SATELLITES],
        water: WaterClass::USUAL,
        antennas: antennas(),
        covariance_deg,
        covariance_scale_percent: None,
    };
    let mut without_rhumb = line("±180°, no rhumb drift", 180.0, Some([1.49, 1.00]));
    without_rhumb.class.simulated.rhumb_deg_h = 0.0;
    without_rhumb.class.declared.rhumb_rad_s = 0.0;
    let turns: Vec<f64> = (0..8).map(|turn| 90.0 * f64::from(turn)).collect();
    let turning = Line {
        passage: moored(180.0, &turns, Waves::NONE),
        ..line("±180°, a turn of 90° each 30 min", 180.0, Some([1.82, 1.04]))
    };
    let aided = Line {
        aids: vec![Aids { heading_s: Some(1), mode: Mode::Aided, ..Aids::SATELLITES }],
        covariance_scale_percent: Some(0.005),
        ..line("±180°, heading 0.3° at 1 Hz", 180.0, Some([0.031, 0.031]))
    };
    vec![
        line("no modulation", 0.0, Some([4.16, 6.69])),
        line("±90°", 90.0, Some([3.10, 2.87])),
        Line { covariance_scale_percent: Some(0.283), ..line("±180°", 180.0, Some([2.99, 2.72])) },
        without_rhumb,
        turning,
        aided,
    ]
}

/// The modes.
fn modes() -> Vec<Line> {
    let line = |name, passage, aids| Line {
        name,
        passage,
        class: Class::FOG,
        start: StartSigmas::USUAL,
        aids,
        water: WaterClass::USUAL,
        antennas: antennas(),
        covariance_deg: None,
        covariance_scale_percent: None,
    };
    let harbour = line(
        "±180°, harbour swell, antenna on an 8 m mast",
        moored(180.0, &[0.0], Waves::CALM),
        vec![Aids::SATELLITES],
    );
    let phases = Aids { phases: true, mode: Mode::Aided, ..Aids::SATELLITES };
    let baseline = line("±180°, phases over 2 m at 10 Hz", moored(180.0, &[0.0], Waves::CALM), vec![phases]);
    let cruise = |hours: f64, depth_m: f64, dive_s: f64| {
        // Legs of 20 min, each turned by 60° to and fro: a survey's zigzag.
        let legs = (0..(hours * 3.0) as u32).map(|leg| Leg {
            until_s: f64::from(leg + 1) * 1200.0,
            heading_deg: 40.0 + if leg % 2 == 0 { 0.0 } else { 60.0 },
            speed_m_s: 4.0,
            depth_m: if f64::from(leg) * 1200.0 >= dive_s { depth_m } else { 0.0 },
        });
        let voyage = Voyage::moored(60.0, hours, &[40.0], 1.0);
        let modulation = Modulation::harmonic(180.0);
        let current_m_s = [0.2, -0.1];
        Voyage { legs: legs.collect(), waves: Waves::SEA, modulation, current_m_s, ..voyage }.sail()
    };
    let sea = Some(0.5);
    let outage = |outliers| {
        let aided = Aids { outliers, height_m: sea, log_s: Some(1), mode: Mode::Aided, ..Aids::SATELLITES };
        vec![Aids { until_s: 7200.0, ..aided }, Aids { until_s: 9000.0, satellites_s: None, ..aided }, aided]
    };
    let surface =
        Aids { until_s: 3600.0, height_m: sea, log_s: Some(1), phases: true, mode: Mode::Aided, ..Aids::SATELLITES };
    let below = |mode, acoustic_s, height_m| Aids {
        mode,
        satellites_s: None,
        log_s: Some(1),
        acoustic_s,
        height_m,
        ..Aids::SATELLITES
    };
    let stand_turns: Vec<f64> = (0..48).map(|turn| 90.0 * f64::from(turn)).collect();
    let stand = Line {
        antennas: Antennas { antenna_m: Vector3::zeros(), velocity_m_s: 0.001, position_m: 0.1, ..antennas() },
        water: WaterClass { heading_deg: 0.02, ..WaterClass::USUAL },
        passage: {
            let voyage = Voyage::moored(60.0, 4.0, &stand_turns, 300.0);
            Voyage { modulation: Modulation::harmonic(0.0), waves: Waves::NONE, ..voyage }.sail()
        },
        ..line(
            "calibration on a stand, turned 90° each 5 min",
            moored(0.0, &[0.0], Waves::NONE),
            vec![Aids { mode: Mode::Stand, heading_s: Some(1), ..Aids::SATELLITES }],
        )
    };
    vec![
        harbour,
        baseline,
        line("heading while manoeuvring, zigzag at 4 m/s", cruise(4.0, 0.0, 1e9), vec![Aids::SATELLITES]),
        line("aided at sea, satellites lost from 2 h to 2.5 h, 1 % outliers", cruise(4.0, 0.0, 1e9), outage(0.01)),
        line(
            "log only after an hour with satellites and phases",
            cruise(4.0, 0.0, 1e9),
            vec![surface, below(Mode::LogOnly, None, sea)],
        ),
        line(
            "submerged after an hour, acoustic fix each 10 min, 2 % wrong",
            cruise(4.0, 100.0, 3600.0),
            vec![surface, below(Mode::Submerged, Some(600), Some(0.3))],
        ),
        stand,
    ]
}

impl Aiding {
    fn runs(&self, line: &Line, bar: &ProgressBar) -> Result<Vec<Outcome>, Failure> {
        let case = Case {
            passage: &line.passage,
            class: line.class,
            start: line.start,
            aids: &line.aids,
            water: line.water,
            antennas: line.antennas,
            every_s: 1800,
        };
        trials(0..self.trials, bar, |trial| run(&case, (self.seed << 32) + trial))
    }
}

fn row(line: &Line, outcomes: &[Outcome], at: usize) -> Option<Row> {
    let shots: Vec<&Snapshot> = outcomes.iter().filter_map(|outcome| outcome.snapshots.get(at)).collect();
    let first = *shots.first()?;
    let n = shots.len() as f64;
    let rms = |f: &dyn Fn(&Snapshot) -> f64| (shots.iter().map(|shot| f(shot).powi(2)).sum::<f64>() / n).sqrt();
    let share = |f: &dyn Fn(&Snapshot) -> bool| shots.iter().filter(|shot| f(shot)).count() as f64 / n;
    let sums = Source::ALL.iter().flat_map(|source| outcomes.iter().map(|outcome| outcome.filter.source(*source)));
    let (nis, freedom, rejected, outages) = sums.fold((0.0, 0, 0, 0), |sum, health| {
        (
            sum.0 + health.normalised_squared,
            sum.1 + health.degrees_of_freedom,
            sum.2 + health.rejected,
            sum.3 + health.outages,
        )
    });
    let hours = first.t_s / 3600.0;
    let early = hours < 1.5;
    Some(Row {
        case: line.name,
        hours,
        trials: shots.len(),
        covariance_simulation_deg: line.covariance_deg.map(|[one, four]| if early { one } else { four }),
        heading_rms_deg: rms(&|shot| shot.heading_error_deg),
        heading_sigma_deg: rms(&|shot| shot.heading_sigma_deg),
        within_3_sigma: share(&|shot| shot.heading_error_deg.abs() <= 3.0 * shot.heading_sigma_deg),
        scale_z_rms_percent: 100.0 * rms(&|shot| shot.scale_z_error),
        scale_z_sigma_percent: 100.0 * rms(&|shot| shot.scale_z_sigma),
        covariance_simulation_scale_z_percent: line.covariance_scale_percent.filter(|_| early),
        rhumb_sigma_deg_h: (3600.0 * rms(&|shot| shot.rhumb_sigma_rad_s)).to_degrees(),
        position_rms_m: rms(&|shot| shot.position_error_m),
        position_sigma_m: rms(&|shot| shot.position_sigma_m),
        nees: shots.iter().map(|shot| shot.normalised_squared_error).sum::<f64>() / (DEGREES_OF_FREEDOM * n),
        nis: nis / f64::from(freedom.max(1)),
        nis_degrees_of_freedom: freedom,
        rejected,
        outages,
        ambiguities_fixed: share(&|shot| shot.fixed),
    })
}

fn write_preamble(out: &mut dyn Write, trials: u64) -> io::Result<()> {
    let n = trials as f64;
    let (rms, nees) = (196.0 / (2.0 * n).sqrt(), 1.96 * (2.0 / (9.0 * n)).sqrt());
    writeln!(
        out,
        "Each row: {trials} runs. 95 % intervals: an rms of n Gaussian errors has the relative standard deviation 1/√(2n), here\n\
         ±{rms:.0} %. NEES is the mean normalised squared error of attitude, velocity and position a degree of freedom: chi-square with\n\
         9n degrees of freedom over 9n, 1 ± {nees:.2} for a consistent filter. NIS is that of all innovations of all runs, 1 ± 1.96·√(2/m)\n\
         with m of the order of 10⁷: 1 ± 0.001; what is cut off at 5 sigma takes 1e-5 of it."
    )
}

fn write_head(out: &mut dyn Write, title: &str) -> io::Result<()> {
    writeln!(out, "\n### {title}\n")?;
    writeln!(
        out,
        "| case | h | covariance simulation, ° | heading rms, ° | heading sigma, ° | within 3 sigma, % | scale z rms / sigma (covariance simulation), % \
         | rhumb sigma of both axes, °/h | position rms / sigma, m | NEES | NIS | rejected | outages | fixed, % |"
    )?;
    writeln!(out, "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
}

fn write_row(out: &mut dyn Write, row: &Row) -> io::Result<()> {
    let optional = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| value.to_string());
    writeln!(
        out,
        "| {} | {:.0} | {} | {:.3} | {:.3} | {:.1} | {:.4} / {:.4} ({}) | {:.3} | {:.1} / {:.1} | {:.3} | {:.4} | {} | {} | {:.0} |",
        row.case,
        row.hours,
        optional(row.covariance_simulation_deg),
        row.heading_rms_deg,
        row.heading_sigma_deg,
        100.0 * row.within_3_sigma,
        row.scale_z_rms_percent,
        row.scale_z_sigma_percent,
        optional(row.covariance_simulation_scale_z_percent),
        row.rhumb_sigma_deg_h,
        row.position_rms_m,
        row.position_sigma_m,
        row.nees,
        row.nis,
        row.rejected,
        row.outages,
        100.0 * row.ambiguities_fixed,
    )
}

/// Sigmas at the end of the first run, which hardly depend on its noise.
fn sigmas(outcomes: &[Outcome]) -> Vec<f64> {
    let last = outcomes.first().and_then(|outcome| outcome.snapshots.last());
    last.map_or_else(Vec::new, |shot| shot.sigmas.iter().copied().collect())
}

/// Which states are observable when.
fn write_observable(out: &mut dyn Write, cases: &[(&str, Vec<f64>)]) -> io::Result<()> {
    writeln!(out, "\n### Which states are observable when: standard deviations after 4 h\n")?;
    write!(out, "| states | unit |")?;
    for (name, _) in cases {
        write!(out, " {name} |")?;
    }
    writeln!(out, "\n|---|---|{}", "---|".repeat(cases.len()))?;
    for group in state::GROUPS.iter().filter(|group| group.first < state::AIDED) {
        write!(out, "| {} | {} |", group.name, group.unit)?;
        for (_, sigmas) in cases {
            let values = sigmas.iter().skip(group.first).take(group.count);
            let texts: Vec<String> =
                values.map(|sigma| format!("{:.2e}", sigma * group.scale)).map(|text| short(&text)).collect();
            write!(out, " {} |", texts.join(" "))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Three digits at most, without an exponent where that is as short.
fn short(text: &str) -> String {
    let value: f64 = text.parse().unwrap_or(f64::NAN);
    if value == 0.0 || (1e-3..1e4).contains(&value) { format!("{value}") } else { text.to_owned() }
}
