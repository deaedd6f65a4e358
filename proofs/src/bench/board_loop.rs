//! `north bench board-loop`: effects composed at random, learned from a board's recordings and taken out by the board.

use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::Args;
use hal_sim::{Played, Scenario};
use north::campaign::{self, CampaignWriter, Own};
use north::diagnose::{Options, diagnose};
use north::engine::{self, End, Engine, Setup};
use north::failure::Failure;
use north::recorder::Recorder;
use north::settings_file::declare_noise;
use north::{interrupt, progress};
use north_finder::effects::ErrorModel;
use north_finder::event::{Fix, Report};
use north_finder::sequence::order::Order;
use north_finder::settings::Settings;
use north_finder::units::wrap_180_deg;
use rayon::prelude::*;
use serde::Serialize;

use super::Bench;
use super::close_loop::{SURVEY_SIGMA_DEG, taught, write_campaign};
use crate::composed::board::{Instrument, Recorded, Second};
use crate::composed::judge::covered;
use crate::composed::{Effect, LEAST_RATIO, Port, Row};
use crate::hidden::draw::Draw;
use crate::statistics::{azimuth_error_deg, median, probability_interval, rms};

/// Effects composed at random of what a board measures, learned from its recordings and taken out by itself
///
/// Each instrument hides an effect (or several) at any port, composed of the gyro's temperature, the index, the axis, the base's tilt, the moves, the time since
/// switch-on and the rate. They are played into the simulated sensors. The firmware, in this process, records runs; they are diagnosed; the
/// model goes into the firmware's settings; and new runs, which took no part, give their azimuths without and with it, as the firmware reports them. They are
/// compared with those of an oracle, who knows the form of the effects, and with those that the firmware reports where nothing is hidden.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  north bench board-loop --instruments 30 --seed 5 --verbose")]
pub struct BoardLoop {
    /// How many instruments, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    instruments: u64,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Runs to learn from, 8 to 100
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(8..=100))]
    runs: u64,
    /// New runs, each without and with the model, 2 to 100
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u64).range(2..=100))]
    new_runs: u64,
    /// Effects that every instrument hides, 1 to 3
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    effects: u8,
    /// Only the instrument with this number, from 0
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..10_000))]
    only: Option<u64>,
    /// Keep the recorded campaigns, and the learned models as model.toml, in new folders DIR/0000, DIR/0001 …
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Print what is hidden in every instrument and what was found
    #[arg(long)]
    verbose: bool,
}

/// Times that runs are made until an effect and the course that it follows agree.
const MOST_PASSES: usize = 5;
/// Stream numbers that an instrument has: those of its runs, and those of its draws of effects.
const STREAMS: u64 = 1 << 20;
const FIRST_DRAW: u64 = 1 << 10;

/// An instrument, what was learned of it, and what that was good for.
#[derive(Serialize)]
pub struct Told {
    instrument: u64,
    names: Vec<String>,
    composition: Vec<String>,
    found: Vec<String>,
    verdict: String,
    /// Why the board has no azimuths with what was learned.
    refusal: Option<String>,
    /// Errors of the new runs, degrees: of the same runs with nothing hidden, without a model, by the board with it, by the oracle.
    quiet_deg: Vec<f64>,
    before_deg: Vec<f64>,
    after_deg: Vec<f64>,
    oracle_deg: Vec<f64>,
    /// What the board states, degrees.
    sigma_deg: Vec<f64>,
}

impl Told {
    /// Errors with the model over the oracle's, rms; without azimuths worse than any.
    fn over_oracle(&self) -> f64 {
        if self.after_deg.is_empty() { f64::INFINITY } else { rms_deg(&self.after_deg) / rms_deg(&self.oracle_deg) }
    }

    /// New runs whose azimuth ± 1.96 sigma holds the truth.
    fn covered(&self) -> usize {
        covered(&self.after_deg, &self.sigma_deg)
    }
}

fn rms_deg(errors_deg: &[f64]) -> f64 {
    rms(errors_deg.iter().copied())
}

/// An instrument before anything is hidden in it.
struct Rig {
    settings: Settings,
    /// What its runs are made in, and their seeds.
    runs: Vec<(Scenario, u64)>,
    first_new: usize,
}

/// A run: what was recorded, and its fix.
struct Ran {
    rows: Vec<campaign::Row>,
    fix: Fix,
    true_deg: f64,
}

impl Ran {
    fn error_deg(&self) -> f64 {
        azimuth_error_deg(self.fix.azimuth_deg, self.true_deg)
    }
}

impl Bench for BoardLoop {
    type Row = Told;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Told>, Failure> {
        let numbers = self.only.map_or(0..self.instruments, |only| only..only + 1);
        for number in numbers.clone() {
            self.kept(number).as_deref().map_or(Ok(()), CampaignWriter::check_free)?;
        }
        let bar = progress::bar(numbers.end - numbers.start, "instruments");
        let mut all = Vec::new();
        for number in numbers {
            let told = self.one(number)?;
            if self.verbose {
                print(&told, out)?;
            }
            all.push(told);
            bar.inc(1);
        }
        bar.finish_and_clear();
        print_all(&all, out)?;
        Ok(all)
    }
}

impl BoardLoop {
    /// The folder in which the campaign of an instrument is kept.
    fn kept(&self, number: u64) -> Option<PathBuf> {
        self.keep.as_ref().map(|keep| keep.join(format!("{number:04}")))
    }

    fn one(&self, number: u64) -> Result<Told, Failure> {
        let temporary = tempfile::tempdir()?;
        let folder = self.kept(number).unwrap_or_else(|| temporary.path().join("campaign"));
        let first = number * STREAMS;
        let rig = Rig::draw(&mut Draw::new(self.seed, first), self.runs, self.new_runs);
        let quiet = rig.runs_with(&rig.settings, &|_| Played::default(), 0..rig.runs.len())?;
        let quiet = quiet.into_iter().collect::<Option<Vec<Ran>>>();
        let quiet = quiet.ok_or_else(|| Failure::Refused("a run without an effect has no fix".into()))?;
        let runs: Vec<Recorded> = quiet.iter().enumerate().map(|(place, ran)| rig.recorded(place, ran)).collect();
        let mut draw = Draw::new(self.seed, first + FIRST_DRAW);
        let arw = rig.runs[0].0.gyro.arw_deg_per_sqrt_h;
        let instrument = Instrument::new(&mut draw, rig.settings.latitude_deg, arw, &runs);
        for attempt in 1..STREAMS - FIRST_DRAW {
            let mut draw = Draw::new(self.seed, first + FIRST_DRAW + attempt);
            let Some(effects) = instrument.compose(&mut draw, usize::from(self.effects)) else { continue };
            if let Some(told) = rig.judge(number, &instrument, &effects, &folder)? {
                let quiet_deg = quiet[rig.first_new..].iter().map(Ran::error_deg).collect();
                return Ok(Told { quiet_deg, ..told });
            }
        }
        Err(Failure::Refused(format!("instrument {number}: of a million draws none counts")))
    }
}

impl Rig {
    fn draw(draw: &mut Draw, fit: u64, new: u64) -> Self {
        let latitude_deg = draw.sign() * draw.uniform(8.0, 65.0);
        let arw_deg_per_sqrt_h = draw.log_uniform(0.0005, 0.01);
        let (thermal_tau_s, wave_k) = (draw.log_uniform(30.0, 300.0), draw.uniform(0.0, 12.0));
        let wave_s = draw.log_uniform(60.0, 600.0);
        let tilt_deg = draw.log_uniform(0.02, 0.3);
        let scenario = |_| {
            let mut scenario = Scenario { name: "composed effects".into(), ..Scenario::default() };
            scenario.site.latitude_deg = latitude_deg;
            scenario.site.azimuth_deg = draw.uniform(0.0, 360.0);
            scenario.site.ambient_c = draw.uniform(5.0, 35.0);
            (scenario.site.ambient_wave_k, scenario.site.ambient_wave_period_s) = (wave_k, wave_s);
            scenario.base.pitch_deg = tilt_deg * draw.normal();
            scenario.base.roll_deg = tilt_deg * draw.normal();
            scenario.accelerometer.bias_mg = [0.0; 3];
            scenario.gyro.arw_deg_per_sqrt_h = arw_deg_per_sqrt_h;
            // The oracle knows of white noise alone.
            (scenario.gyro.bias_instability_deg_h, scenario.gyro.rrw_deg_h_per_sqrt_h) = (0.0, 0.0);
            (scenario.gyro.thermal_tau_s, scenario.gyro.start_offset_k) = (thermal_tau_s, 8.0 * draw.normal());
            (scenario, draw.seed())
        };
        let runs = (0..fit + new).map(scenario).collect();
        let mut settings = Settings { latitude_deg, model: Some(ErrorModel::default()), ..Settings::default() };
        settings.sequence.order = Order::Plain;
        // An accelerometer that is wrong by degrees keeps nobody from a fix.
        settings.level.limit_deg = 10.0;
        declare_noise(&mut settings, arw_deg_per_sqrt_h);
        Self { settings, runs, first_new: fit as usize }
    }

    fn setup(&self, place: usize, settings: &Settings) -> Setup {
        let (scenario, seed) = self.runs[place].clone();
        Setup { scenario, seed, settings: Some(settings.clone()) }
    }

    /// Some of its runs with these settings, and these errors of the sensors; `None` where one has no fix.
    fn runs_with(
        &self,
        settings: &Settings,
        played: &(dyn Fn(usize) -> Played + Sync),
        places: Range<usize>,
    ) -> Result<Vec<Option<Ran>>, Failure> {
        let run = |place: usize| -> Result<Option<Ran>, Failure> {
            let setup = self.setup(place, settings);
            let world = engine::world(&setup)?.with_played(played(place));
            let mut recorder = Recorder::default();
            let mut observe = |report: &Report| recorder.see(report);
            let limit_ticks = engine::limit_ticks(&setup);
            let outcome = engine::run_in(Engine::Host, None, &world, limit_ticks, interrupt::flag(), &mut observe)?;
            let rows = recorder.take_rows();
            match outcome.end {
                End::Interrupted => Err(Failure::Interrupted),
                End::Fix(fix) => Ok(Some(Ran { rows, fix, true_deg: outcome.truth.azimuth_deg })),
                End::Fault { .. } | End::TimeLimit => Ok(None),
            }
        };
        places.into_par_iter().map(run).collect()
    }

    fn recorded(&self, place: usize, ran: &Ran) -> Recorded {
        let base = &self.runs[place].0.base;
        Recorded {
            is_fit: place < self.first_new,
            azimuth_deg: ran.true_deg,
            tilt_rad: [base.pitch_deg.to_radians(), base.roll_deg.to_radians()],
            survey_sigma_deg: SURVEY_SIGMA_DEG,
            seconds: seconds(&ran.rows),
        }
    }

    /// Some of its runs with these settings and effects, and the instrument in the course that they took: what an effect follows, the firmware's course, may
    /// depend on the effect. `None` where one has no fix, or the course does not come to an end with what it does to the effects.
    fn runs_hiding(
        &self,
        settings: &Settings,
        instrument: &Instrument,
        effects: &[Effect],
        places: Range<usize>,
    ) -> Result<Option<(Instrument, Vec<Ran>)>, Failure> {
        let mut instrument = instrument.clone();
        for _ in 0..MOST_PASSES {
            let ran = self.runs_with(settings, &|place| played(&instrument, effects, place), places.clone())?;
            let Some(ran) = ran.into_iter().collect::<Option<Vec<Ran>>>() else { return Ok(None) };
            let then = places
                .clone()
                .zip(&ran)
                .fold(instrument.clone(), |then, (place, ran)| then.in_course(place, &self.recorded(place, ran)));
            if places.clone().all(|place| then.has_course_of(&instrument, place)) {
                return Ok(Some((then, ran)));
            }
            instrument = then;
        }
        Ok(None)
    }

    /// Records, learns, and makes the new runs again with what was learned; `None` where the effects do not count: they keep the firmware from a fix, or
    /// are too small for the azimuths.
    fn judge(
        &self,
        number: u64,
        instrument: &Instrument,
        effects: &[Effect],
        folder: &Path,
    ) -> Result<Option<Told>, Failure> {
        let Some((instrument, ran)) = self.runs_hiding(&self.settings, instrument, effects, 0..self.runs.len())? else {
            return Ok(None);
        };
        let rows: Vec<Vec<Row>> =
            ran.iter().map(|ran| seconds(&ran.rows).into_iter().map(|second| second.row).collect()).collect();
        let Some(oracle) = instrument.oracle(effects, &rows) else { return Ok(None) };
        let before_deg: Vec<f64> = ran[self.first_new..].iter().map(Ran::error_deg).collect();
        let told = ran.iter().zip(&oracle);
        let oracle_deg: Vec<f64> =
            told.filter_map(|(ran, told)| Some(azimuth_error_deg(told.as_ref()?.azimuth_deg, ran.true_deg))).collect();
        if rms_deg(&before_deg) < LEAST_RATIO * rms_deg(&oracle_deg) {
            return Ok(None);
        }
        let recorded = ran.into_iter().take(self.first_new).map(|ran| (ran.true_deg, ran.rows));
        let mut told = Told {
            instrument: number,
            names: effects.iter().map(Effect::name).collect(),
            composition: instrument.describe(effects),
            found: Vec::new(),
            verdict: String::new(),
            refusal: None,
            quiet_deg: Vec::new(),
            before_deg,
            after_deg: Vec::new(),
            oracle_deg,
            sigma_deg: Vec::new(),
        };
        let campaign = write_campaign(folder, "board-loop", &self.setup(0, &self.settings), recorded)?;
        let options = Options { settings: self.settings.clone(), ..Options::default() };
        let diagnosis = match diagnose(&campaign, &options) {
            Ok(diagnosis) => diagnosis,
            Err(why) => return Ok(Some(Told { refusal: Some(why.to_string()), ..told })),
        };
        told.found = diagnosis.effects.iter().map(|effect| effect.full_name()).collect();
        told.verdict = diagnosis.verdict.clone();
        match taught(&self.settings, &diagnosis, folder) {
            Ok(settings) => {
                match self.runs_hiding(&settings, &instrument, effects, self.first_new..self.runs.len())? {
                    Some((_, after)) => {
                        told.after_deg = after.iter().map(Ran::error_deg).collect();
                        told.sigma_deg = after.iter().map(|ran| ran.fix.sigma_deg).collect();
                    }
                    None => told.refusal = Some("a run has no fix with it".into()),
                }
            }
            Err(why) => told.refusal = Some(why.to_string()),
        }
        Ok(Some(told))
    }
}

/// What effects do to the sensors in a run.
fn played(instrument: &Instrument, effects: &[Effect], place: usize) -> Played {
    let courses = instrument.courses(effects, place);
    let at = |port: Port| {
        let mut courses = courses.iter().filter(|(at, _)| *at == port).map(|(_, course)| course.clone());
        let first = courses.next().unwrap_or_default();
        courses.fold(first, |sum, course| sum.iter().zip(&course).map(|(sum, value)| sum + value).collect())
    };
    let level_g = |forward: bool| at(Port::Tilts { forward }).into_iter().map(f64::to_radians).collect::<Vec<f64>>();
    Played {
        rate_deg_h: at(Port::Adds),
        scale: at(Port::Scales),
        index_deg: at(Port::Turns),
        level_g: [level_g(true), level_g(false)],
    }
}

/// Recorded rows, the index angles one after the other without a jump of a turn.
fn seconds(rows: &[campaign::Row]) -> Vec<Second> {
    let mut last_deg = 0.0;
    let mut unwrapped = |mut second: Second| {
        last_deg += wrap_180_deg(second.row.index_deg - last_deg);
        second.row.index_deg = last_deg;
        second
    };
    rows.iter().map(second).map(&mut unwrapped).collect()
}

/// A recorded row as whoever does not know the project reads it.
fn second(row: &campaign::Row) -> Second {
    let is_of_dwell = matches!(row.own, Some(Own::Second { mark, .. }) if mark.dwell.is_some());
    let level_g = row.level.map_or([0.0; 2], |level| [level.forward, level.left]);
    let channels = vec![row.temp_c.unwrap_or(f64::NAN)];
    let row = Row { t_s: row.t_s, index_deg: row.index_deg, fog_arcsec: row.fog_arcsec, level_g, channels };
    Second { row, is_of_dwell }
}

fn print(told: &Told, out: &mut dyn Write) -> Result<(), Failure> {
    let found = if told.found.is_empty() { "nothing".to_owned() } else { told.found.join(", ") };
    let refused = told.refusal.as_ref().map(|why| format!("; refused: {why}")).unwrap_or_default();
    writeln!(
        out,
        "{:04} {}: ratio {:.2}; found {found}{refused}",
        told.instrument,
        told.names.join(" + "),
        told.over_oracle()
    )?;
    for effect in &told.composition {
        writeln!(out, "    {effect}")?;
    }
    out.flush()?;
    Ok(())
}

fn print_all(all: &[Told], out: &mut dyn Write) -> Result<(), Failure> {
    let ratios: Vec<f64> = all.iter().map(Told::over_oracle).collect();
    let percent = |most: f64| 100.0 * ratios.iter().filter(|ratio| **ratio <= most).count() as f64 / all.len() as f64;
    let [runs, covered] =
        all.iter().fold([0; 2], |[runs, covered], told| [runs + told.after_deg.len(), covered + told.covered()]);
    let [low, high] = probability_interval(covered, runs);
    writeln!(
        out,
        "| instruments | refused | rms / oracle, median | ≤ 1.25, % | ≤ 2, % | new runs | covered, % (95 %) |"
    )?;
    writeln!(out, "|---|---|---|---|---|---|---|")?;
    writeln!(
        out,
        "| {} | {} | {:.2} | {:.0} | {:.0} | {runs} | {:.1} ({:.1} … {:.1}) |\n",
        all.len(),
        all.iter().filter(|told| told.refusal.is_some()).count(),
        median(ratios.clone()),
        percent(1.25),
        percent(2.0),
        100.0 * covered as f64 / runs as f64,
        100.0 * low,
        100.0 * high
    )?;
    writeln!(
        out,
        "| instrument | hidden | rms before, ° | after, on the board, ° | oracle, ° | nothing hidden, ° | after / oracle | covered |"
    )?;
    writeln!(out, "|---|---|---|---|---|---|---|---|")?;
    let mut sorted: Vec<&Told> = all.iter().collect();
    sorted.sort_by(|a, b| a.over_oracle().total_cmp(&b.over_oracle()));
    for told in sorted {
        writeln!(
            out,
            "| {} | `{}` | {:.4} | {:.4} | {:.4} | {:.4} | {:.2} | {} of {} |",
            told.instrument,
            told.names.join(" + "),
            rms_deg(&told.before_deg),
            rms_deg(&told.after_deg),
            rms_deg(&told.oracle_deg),
            rms_deg(&told.quiet_deg),
            told.over_oracle(),
            told.covered(),
            told.after_deg.len()
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In every second of a dwell 2 °/h are 2 arcsec more. A hundredth of the rate is a hundredth of what a row is without its bias of 0.3 °/h. Where the
    /// encoder reads 0.5° too large the drive goes on until it reads what it should: the axis is 0.5° short, and a cosine of the true angle remains.
    /// The accelerometers read 0.01 g forward and −0.02 g left more.
    #[test]
    fn what_is_played_reaches_the_recording_by_hand() {
        let mut rig = Rig::draw(&mut Draw::new(1, 0), 1, 0);
        let (scenario, _) = &mut rig.runs[0];
        scenario.gyro.arw_deg_per_sqrt_h = 1e-6;
        (scenario.base.pitch_deg, scenario.base.roll_deg, scenario.gyro.scale_ppm) = (0.0, 0.0, 0.0);
        let north_deg_h = 15.041_067 * scenario.site.latitude_deg.to_radians().cos();
        let azimuth_deg = scenario.site.azimuth_deg;
        let ran = |played: Played| {
            let ran = rig.runs_with(&rig.settings, &|_| played.clone(), 0..1).expect("a run").remove(0).expect("a fix");
            seconds(&ran.rows)
                .into_iter()
                .filter(|second| second.is_of_dwell)
                .map(|second| second.row)
                .collect::<Vec<Row>>()
        };
        let always = |value: f64| vec![value; 1000];
        let quiet = ran(Played::default());
        assert!(quiet.len() > 100);
        let differ = |played: Played, of: &dyn Fn(&Row, &Row) -> f64, tolerance: f64| {
            let rows = ran(played);
            assert_eq!(rows.len(), quiet.len());
            for (row, before) in rows.iter().zip(&quiet) {
                assert!(of(row, before).abs() < tolerance, "{row:?} {before:?}");
            }
        };
        let rate = Played { rate_deg_h: always(2.0), ..Played::default() };
        differ(rate, &|row, before| row.fog_arcsec - before.fog_arcsec - 2.0, 0.002);
        let scale = Played { scale: always(0.01), ..Played::default() };
        differ(scale, &|row, before| row.fog_arcsec - before.fog_arcsec - 0.01 * (before.fog_arcsec - 0.3), 0.002);
        let level = Played { level_g: [always(0.01), always(-0.02)], ..Played::default() };
        differ(level.clone(), &|row, before| row.level_g[0] - before.level_g[0] - 0.01, 1e-5);
        differ(level, &|row, before| row.level_g[1] - before.level_g[1] + 0.02, 1e-5);
        let index = Played { index_deg: always(0.5), ..Played::default() };
        differ(index.clone(), &|row, before| row.index_deg - before.index_deg, 0.05);
        let rate_deg_h = |row: &Row| north_deg_h * (azimuth_deg - row.index_deg + 0.5).to_radians().cos() + 0.3;
        differ(index, &|row, _| row.fog_arcsec - rate_deg_h(row), 0.02);
    }
}
