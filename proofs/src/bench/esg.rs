//! `north bench esg`: the questions about an electrostatic gyro: accuracy, readiness, fixes, requirements.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use hal_sim::vessel::block::BlockClass;
use hal_sim::vessel::electrostatic::{EsgClass, Orientation};
use hal_sim::vessel::ship::{Leg, Modulation, Passage, Voyage, Waves};
use hal_sim::vessel::water::WaterClass;
use indicatif::ProgressBar;
use inertial::esg::filter::{PickOff, SevenStates, Situation};
use inertial::esg::reference::{DriftCoefficients, Reference};
use inertial::filter::block::BlockErrors;
use inertial::filter::{Mode, StartSigmas};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use north::failure::Failure;
use north::progress;
use north::report::{Axis, Legend, Plot, Side, figure, page};
use serde::Serialize;

use super::{Bench, trials};
use crate::trials::aided::{Aids, Case, Class, antennas};
use crate::trials::dive::{Dive, Shot, calibrate, declared, run, run_joined};

const GYRO: EsgClass = EsgClass::TYPICAL;
const SURFACE_S: f64 = 3600.0;

const CLASSES: [Class; 4] = [
    Class::FOG,
    Class { name: "MEMS, STIM300", simulated: BlockClass::STIM300, declared: BlockErrors::STIM300 },
    Class {
        name: "MEMS, source's hardware",
        simulated: BlockClass::MEMS_HARDWARE,
        declared: BlockErrors::MEMS_HARDWARE,
    },
    Class {
        name: "MEMS, source's introduction",
        simulated: BlockClass::MEMS_INTRODUCTION,
        declared: BlockErrors::MEMS_INTRODUCTION,
    },
];

/// A dive with an electrostatic gyro: accuracy and readiness, position fixes, requirements on gyro and block
///
/// Calibrated on a stand, aligned for an hour at the surface beside satellites and a heading of 0.3°, then hours below with
/// log, depth gauge and acoustic fixes. Each row is the root mean square over the trials and over the time that it names.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  north bench esg\n  north bench esg --trials 12 --report esg.html")]
pub struct EsgBench {
    /// Dives of each row, 2 to 1000
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u64).range(2..=1000))]
    trials: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the figures as an HTML page
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Latitudes and intervals between fixes, min, that are asked for; `None`: no fix.
const LATITUDES_DEG: [f64; 3] = [45.0, 60.0, 80.0];
const FIXES_S: [Option<u32>; 4] = [Some(3600), Some(10_800), Some(21_600), None];
/// Drift, °/h, and pick-off errors, arcseconds, that are asked for.
const GYROS: [(f64, f64); 7] =
    [(0.0005, 20.0), (0.002, 20.0), (0.01, 20.0), (0.05, 20.0), (0.002, 5.0), (0.002, 60.0), (0.002, 300.0)];

impl Bench for EsgBench {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let dives = 4 * CLASSES.len() + LATITUDES_DEG.len() * 2 * FIXES_S.len() + GYROS.len() + 1;
        let bar = progress::bar(dives as u64 * self.trials, "dives");
        geometry(out)?;
        self.stand(out, &bar)?;
        let mut rows = Vec::new();
        let middle = passage(60.0, 5.0);
        let base = Setup {
            table: "",
            passage: &middle,
            latitude_deg: 60.0,
            class: CLASSES[1],
            orientation: Orientation::Polar,
            fix_every_s: Some(3600),
            gyro: GYRO,
            filter: Beside::Full,
        };
        let windows_s = [(0.0, 600.0), (600.0, 1800.0), (1800.0, 3600.0), (3600.0, 18_000.0)];
        for filter in [Beside::Full, Beside::Seven, Beside::FullUncalibrated, Beside::Twelve] {
            for class in CLASSES {
                let setup = Setup { table: "readiness", class, filter, ..base };
                self.add(&setup, &windows_s, &bar, &mut rows)?;
            }
        }
        bar.suspend(|| write_readiness(out, &rows))?;
        let done = rows.len();
        for latitude_deg in LATITUDES_DEG {
            let long = passage(latitude_deg, 13.0);
            for orientation in [Orientation::Polar, Orientation::Equatorial] {
                for fix_every_s in FIXES_S {
                    let setup = Setup { table: FIXES, passage: &long, latitude_deg, orientation, fix_every_s, ..base };
                    self.add(&setup, &[(43_200.0, 46_800.0)], &bar, &mut rows)?;
                }
            }
        }
        bar.suspend(|| write_fixes(out, &rows[done..]))?;
        let done = rows.len();
        for (drift_deg_h, pick_off_arcsec) in GYROS {
            let drift_growth_deg_h_per_sqrt_h = 0.25 * drift_deg_h;
            let gyro = EsgClass { drift_deg_h, pick_off_arcsec, drift_growth_deg_h_per_sqrt_h, ..GYRO };
            let setup = Setup { table: "requirements", gyro, ..base };
            self.add(&setup, &[(14_400.0, 18_000.0)], &bar, &mut rows)?;
        }
        bar.finish_and_clear();
        write_requirements(out, &rows[done..])?;
        let least = rows.iter().map(|row| row.within_3_sigma).fold(1.0, f64::min);
        writeln!(out, "\nWithin 3 sigma: {:.1} % of the headings of the worst row.", 100.0 * least)?;
        if let Some(file) = &self.report {
            north::output::write(file, html(&rows))
                .map_err(|error| Failure::Refused(format!("{}: {error}", file.display())))?;
        }
        Ok(rows)
    }

    fn judge(&self, rows: &[Row]) -> Result<(), Failure> {
        let missed = rows.iter().filter(|row| row.within_3_sigma < 0.95);
        match missed
            .map(|row| format!("{}, {}, {}, {}°", row.table, row.filter, row.block, row.latitude_deg))
            .collect::<Vec<_>>()
        {
            missed if missed.is_empty() => Ok(()),
            missed => Err(Failure::Refused(format!("heading errors beyond 3 sigma: {}", missed.join(", ")))),
        }
    }
}

const FIXES: &str = "fixes";

/// One line of the tables.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub table: &'static str,
    pub filter: &'static str,
    pub block: &'static str,
    pub orientation: &'static str,
    pub latitude_deg: f64,
    pub fix_every_s: Option<u32>,
    pub drift_deg_h: f64,
    pub pick_off_arcsec: f64,
    pub hours: f64,
    pub heading_rms_deg: f64,
    pub heading_sigma_deg: f64,
    pub within_3_sigma: f64,
    pub position_rms_m: f64,
}

fn name(orientation: Orientation) -> &'static str {
    match orientation {
        Orientation::Polar => "polar",
        Orientation::Equatorial => "equatorial",
    }
}

/// Heading error of a direction error of an arcminute in a random direction, over a sidereal day.
fn geometry(out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "\n### Heading error for a direction error across the horizontal plane, by latitude\n")?;
    writeln!(
        out,
        "| latitude, ° | polar: simulated | 1/cos φ | equatorial: least over the day | most | 1/sin φ |\n|---|---|---|---|---|---|"
    )?;
    for latitude_deg in [10.0, 30.0, 45.0, 60.0, 70.0, 80.0, 85.0_f64] {
        let polar = amplification(&Vector3::z(), latitude_deg, 0.0);
        let day: Vec<f64> = (0..96)
            .filter_map(|quarter| amplification(&Vector3::x(), latitude_deg, f64::from(quarter) * 3.75))
            .collect();
        let (least, most) = day.iter().fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
        writeln!(
            out,
            "| {latitude_deg} | {} | {:.3} | {least:.3} | {most:.3} | {:.3} |",
            polar.map_or_else(|| "refused".to_owned(), |polar| format!("{polar:.3}")),
            1.0 / latitude_deg.to_radians().cos(),
            1.0 / latitude_deg.to_radians().sin()
        )?;
    }
    Ok(())
}

/// Heading error over direction error, the worst direction, by turning the rotor a little and asking for the heading.
fn amplification(direction: &Vector3<f64>, latitude_deg: f64, hour_deg: f64) -> Option<f64> {
    let small = 1e-5;
    let quiet = EsgClass { pick_off_arcsec: 0.001, ..GYRO };
    let esg = SevenStates::new(Reference::new(direction, DriftCoefficients::default()), declared(&quiet, 0.0, 0.001));
    let place = hal_sim::vessel::globe::position(latitude_deg, hour_deg, 0.0);
    let geographic = hal_sim::vessel::globe::east_north_up(&place).transpose();
    let situation = Situation {
        latitude_rad: latitude_deg.to_radians(),
        longitude_rad: hour_deg.to_radians(),
        time_s: 0.0,
        attitude: Matrix3::identity(),
        tilt_sigma_rad: 0.0,
        place_sigma_rad: 0.0,
    };
    // Block axes are the geographic ones. The rotor is turned about the vertical's perpendicular that moves it sideways.
    let seen = geographic * direction;
    let across = Vector3::z().cross(&seen).try_normalize(1e-9)?;
    let axis = Unit::new_normalize(seen.cross(&across));
    let read = Rotation3::from_axis_angle(&axis, small) * seen;
    let heading =
        |direction: Vector3<f64>| Some(esg.heading(&PickOff { direction, sensor: 0 }, &situation)?.correction_rad);
    Some(((heading(read)? - heading(seen)?) / small).abs())
}

/// An hour at the surface with satellites, antennas and turns, then below.
fn passage(latitude_deg: f64, hours: f64) -> Passage {
    let legs = (0..(hours * 2.0) as u32).map(|leg| Leg {
        until_s: f64::from(leg + 1) * 1800.0,
        heading_deg: 30.0 + if leg % 2 == 0 { 0.0 } else { 40.0 },
        speed_m_s: 3.0,
        depth_m: if f64::from(leg) * 1800.0 >= SURFACE_S { 100.0 } else { 0.0 },
    });
    let voyage = Voyage::moored(latitude_deg, hours, &[30.0], 1.0);
    let waves = Waves { roll_deg: 2.0, pitch_deg: 1.0, yaw_deg: 0.5, heave_m: 0.3, period_s: 8.0 };
    Voyage { legs: legs.collect(), waves, modulation: Modulation::harmonic(0.0), current_m_s: [0.1, 0.1], ..voyage }
        .sail()
}

fn aids(acoustic_s: Option<u32>) -> [Aids; 2] {
    let surface = Aids {
        until_s: SURFACE_S,
        mode: Mode::Aided,
        height_m: Some(0.3),
        log_s: Some(1),
        heading_s: Some(1),
        ..Aids::SATELLITES
    };
    let below = Aids {
        mode: Mode::Submerged,
        satellites_s: None,
        height_m: Some(0.3),
        log_s: Some(1),
        acoustic_s,
        ..Aids::SATELLITES
    };
    [surface, below]
}

/// Settings of a Monte Carlo of dives.
#[derive(Clone, Copy)]
struct Setup<'a> {
    table: &'static str,
    passage: &'a Passage,
    latitude_deg: f64,
    class: Class,
    orientation: Orientation,
    fix_every_s: Option<u32>,
    gyro: EsgClass,
    filter: Beside,
}

/// How the gyro's filter stands to the aided one.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Beside {
    /// One filter of 47 states; the drift's coefficients are known from a stand, or not.
    Full,
    FullUncalibrated,
    /// Seven states of its own, after a stand.
    Seven,
    /// Twelve states of its own, no stand.
    Twelve,
}

impl Beside {
    fn name(self) -> &'static str {
        match self {
            Self::Full => "full, 47 states, calibrated",
            Self::FullUncalibrated => "full, 47 states, no stand",
            Self::Seven => "seven states beside, calibrated",
            Self::Twelve => "twelve states beside, no stand",
        }
    }

    fn calibrated(self) -> bool {
        matches!(self, Self::Full | Self::Seven)
    }
}

impl EsgBench {
    fn dives(&self, setup: &Setup, bar: &ProgressBar) -> Result<Vec<Vec<Shot>>, Failure> {
        let aids = aids(setup.fix_every_s);
        let case = Case {
            passage: setup.passage,
            class: setup.class,
            start: StartSigmas::USUAL,
            aids: &aids,
            water: WaterClass::USUAL,
            antennas: antennas(),
            every_s: 3600,
        };
        trials(0..self.trials, bar, |trial| {
            let dive = Dive {
                case: case.clone(),
                gyro: setup.gyro,
                orientation: setup.orientation,
                hour_angle_deg: (trial * 37 % 360) as f64,
                surface_s: SURFACE_S,
                calibrated_deg_h: setup.filter.calibrated().then_some(EsgClass::CALIBRATED_DEG_H),
            };
            let seed = (self.seed << 32) + trial;
            match setup.filter {
                Beside::Full | Beside::FullUncalibrated => run_joined(&dive, seed, 600),
                Beside::Seven => run::<7, 5, 28>(&dive, seed, 600),
                Beside::Twelve => run::<12, 10, 78>(&dive, seed, 600),
            }
        })
    }

    fn add(
        &self,
        setup: &Setup,
        windows_s: &[(f64, f64)],
        bar: &ProgressBar,
        rows: &mut Vec<Row>,
    ) -> Result<(), Failure> {
        let shots = self.dives(setup, bar)?;
        for (from_s, to_s) in windows_s {
            rows.push(row(setup, &shots, *from_s, *to_s));
        }
        Ok(())
    }

    /// What a stand leaves of the drift.
    fn stand(&self, out: &mut dyn Write, bar: &ProgressBar) -> Result<(), Failure> {
        let turns: Vec<f64> = (0..24).map(|turn| 90.0 * f64::from(turn)).collect();
        let voyage = Voyage { waves: Waves::NONE, interval_s: 0.5, ..Voyage::moored(60.0, 12.0, &turns, 1800.0) };
        let passage = voyage.sail();
        let told = trials(0..self.trials, bar, |trial| calibrate(&passage, GYRO, (self.seed << 32) + trial, 3600))?;
        let title =
            "Calibration on a stand at 60°, turned 90° each 30 min: drift of the virtual gyro less the real one's";
        bar.suspend(|| writeln!(out, "\n### {title}\n\n| after, h | rms error across the rotor, °/h |\n|---|---|"))?;
        for at in [0, 1, 3, 5, 8, 11] {
            let errors: Vec<f64> = told.iter().filter_map(|told| told.get(at)).map(|(_, error)| *error).collect();
            let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len().max(1) as f64).sqrt();
            bar.suspend(|| writeln!(out, "| {} | {rms:.4} |", at + 1))?;
        }
        Ok(())
    }
}

/// Shots of all trials from `from_s` to `to_s`.
fn row(setup: &Setup, shots: &[Vec<Shot>], from_s: f64, to_s: f64) -> Row {
    let within: Vec<&Shot> = shots.iter().flatten().filter(|shot| shot.t_s > from_s && shot.t_s < to_s + 1.0).collect();
    let n = within.len().max(1) as f64;
    let rms = |f: &dyn Fn(&Shot) -> f64| (within.iter().map(|shot| f(shot).powi(2)).sum::<f64>() / n).sqrt();
    Row {
        table: setup.table,
        filter: setup.filter.name(),
        block: setup.class.name,
        orientation: name(setup.orientation),
        latitude_deg: setup.latitude_deg,
        fix_every_s: setup.fix_every_s,
        drift_deg_h: setup.gyro.drift_deg_h,
        pick_off_arcsec: setup.gyro.pick_off_arcsec,
        hours: to_s / 3600.0,
        heading_rms_deg: rms(&|shot| shot.error_deg),
        heading_sigma_deg: rms(&|shot| shot.sigma_deg),
        within_3_sigma: within.iter().filter(|shot| shot.error_deg.abs() <= 3.0 * shot.sigma_deg).count() as f64 / n,
        position_rms_m: rms(&|shot| shot.position_error_m),
    }
}

/// Errors and sigmas of the heading, °.
fn heading(row: &Row) -> String {
    format!("{:.3} / {:.3}", row.heading_rms_deg, row.heading_sigma_deg)
}

/// A filter in a block: one row, with a column for each window of time.
fn write_readiness(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        out,
        "\n### Heading in the hour at the surface and in four hours below: rms / sigma, °\n\n\
         | filter | block | 10 min | 30 min | 1 h | below |\n|---|---|---|---|---|---|"
    )?;
    rows.chunk_by(|a, b| (a.filter, a.block) == (b.filter, b.block)).try_for_each(|of_dive| {
        let cells: String = of_dive.iter().map(|row| format!(" {} |", heading(row))).collect();
        writeln!(out, "| {} | {} |{cells}", of_dive[0].filter, of_dive[0].block)
    })
}

/// A latitude and an orientation of the gyro: one row, with a column for each interval between fixes.
fn write_fixes(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        out,
        "\n### How often a position fix is needed, the last hour of twelve below: heading rms / sigma, °; position rms, m\n\n\
         | latitude, ° | orientation | fix each 1 h | 3 h | 6 h | none |\n|---|---|---|---|---|---|"
    )?;
    let at = |row: &Row| (row.latitude_deg, row.orientation);
    rows.chunk_by(|a, b| at(a) == at(b)).try_for_each(|of_place| {
        let cell = |row: &Row| format!(" {}; {:.0} |", heading(row), row.position_rms_m);
        let cells: String = of_place.iter().map(cell).collect();
        writeln!(out, "| {} | {} |{cells}", of_place[0].latitude_deg, of_place[0].orientation)
    })
}

fn write_requirements(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    writeln!(
        out,
        "\n### Requirements on the gyro, the last hour of four below\n\n\
         | drift that nothing explains, °/h | pick-off, ″ | heading rms, ° | sigma, ° |\n|---|---|---|---|"
    )?;
    rows.iter().try_for_each(|row| {
        let (error, sigma) = (row.heading_rms_deg, row.heading_sigma_deg);
        writeln!(out, "| {} | {} | {error:.3} | {sigma:.3} |", row.drift_deg_h, row.pick_off_arcsec)
    })
}

/// The figures.
fn html(rows: &[Row]) -> String {
    let latitudes: Vec<f64> = (50..=840).map(|tenth| 0.1 * f64::from(tenth)).collect();
    let geometry = figure(
        Legend::Named(&[("line after", "polar, 1/cos φ"), ("line before", "equatorial at worst, 1/sin φ")]),
        "heading error over direction error by latitude",
        "Heading error for an error of the rotor's direction. The orientations cross at 45°: polar below, equatorial above.",
        |canvas| {
            let polar = |latitude: f64| 1.0 / latitude.to_radians().cos();
            let equatorial = |latitude: f64| 1.0 / latitude.to_radians().sin();
            let x = Axis::exact("latitude, °", 0.0, 90.0);
            let mut plot =
                Plot::new(canvas.width, 260.0, x, Axis::logarithmic("heading error / direction error", [1.0, 12.0]));
            plot.line("line after", latitudes.iter().map(|latitude| (*latitude, polar(*latitude))));
            plot.line("line before", latitudes.iter().map(|latitude| (*latitude, equatorial(*latitude))));
            vec![plot]
        },
    );
    let hours = |row: &Row| f64::from(row.fix_every_s.unwrap_or(43_200)) / 3600.0;
    let fixes = figure(
        Legend::Named(&[("line after", "polar"), ("line before", "equatorial")]),
        "heading error by the interval between fixes",
        "Heading in the twelfth hour below against the interval between position fixes (12 h: none), one drawing a latitude.",
        |canvas| {
            let drawing = |latitude: f64| {
                let at: Vec<&Row> =
                    rows.iter().filter(|row| row.table == FIXES && row.latitude_deg == latitude).collect();
                let x = Axis::exact(format!("interval between fixes at {latitude}°, h"), 0.0, 12.5);
                let y = Axis::logarithmic("heading rms, °", at.iter().map(|row| row.heading_rms_deg));
                let mut plot = Plot::new(canvas.width, 220.0, x, y);
                for (orientation, class, side) in
                    [("polar", "line after", Side::After), ("equatorial", "line before", Side::Before)]
                {
                    let of = || at.iter().filter(move |row| row.orientation == orientation);
                    plot.line(class, of().map(|row| (hours(row), row.heading_rms_deg)));
                    plot.dots(side, of().map(|row| (hours(row), row.heading_rms_deg)));
                }
                plot
            };
            LATITUDES_DEG.map(drawing).into_iter().collect()
        },
    );
    let required = figure(
        Legend::Named(&[("line after", "rms"), ("reference", "sigma")]),
        "heading error by the gyro's drift",
        "Heading four hours below at 60°, polar, against the drift that nothing explains.",
        |canvas| {
            let of = || rows.iter().filter(|row| row.table == "requirements" && row.pick_off_arcsec == 20.0);
            let x = Axis::logarithmic("drift, °/h", of().map(|row| row.drift_deg_h));
            let values = of().flat_map(|row| [row.heading_rms_deg, row.heading_sigma_deg]);
            let mut plot = Plot::new(canvas.width, 240.0, x, Axis::logarithmic("heading, °", values));
            plot.line("line after", of().map(|row| (row.drift_deg_h, row.heading_rms_deg)));
            plot.line("reference", of().map(|row| (row.drift_deg_h, row.heading_sigma_deg)));
            vec![plot]
        },
    );
    let body = format!(
        "<h1>Electrostatic gyro</h1>\n<h2>Orientation</h2>\n{geometry}<h2>Position fixes</h2>\n{fixes}<h2>Drift</h2>\n{required}"
    );
    page("Electrostatic gyro", &body)
}
