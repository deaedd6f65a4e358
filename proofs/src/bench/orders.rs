//! `north bench orders`: orders of positions beside each other, scenario by scenario.

use std::collections::BTreeMap;
use std::io::Write;

use clap::Args;
use hal_sim::Scenario;
use north::commands::instrument::{LONGEST_S, OrderName, SPARE_S, accuracy};
use north::failure::Failure;
use north::progress;
use north::settings_file::scenario_settings;
use north_finder::event::Fix;
use north_finder::health::Flag;
use north_finder::sequence::order::Order;
use serde::Serialize;

use super::fixes::{Ended, Found, fix};
use super::{Bench, trials};
use crate::statistics::{median, probability_interval, rms};

/// Scenarios in which an instrument without a fault should find an azimuth, and two faults that only some orders show.
const SCENARIOS: [&str; 11] = [
    "calm-bench",
    "disturbed-start",
    "vehicle",
    "shocks-during-dwell",
    "windy-tripod",
    "creep",
    "jittery-drive",
    "after-move",
    "slipping-encoder",
    "magnet-in-base",
    "drift",
];
/// Headings and latitudes of successive seeds, as shares of the circle and of the range: golden ratio and √2, which fill both evenly.
const OF_HEADING: f64 = 0.618_033_988_749_895;
const OF_LATITUDE: f64 = std::f64::consts::SQRT_2;
/// Latitudes lie within this, degrees: near a pole every azimuth takes more time than there is.
const LATITUDES_DEG: f64 = 60.0;
/// Two-sided 95 % of the normal distribution, standard deviations.
const INSIDE_SIGMAS: f64 = 1.96;
/// An azimuth that is off by more is a wrong one.
const WRONG_SIGMAS: f64 = 4.0;

/// Orders of positions beside each other: azimuths, errors, sigmas, flags and refusals, at headings all around and latitudes to 60°
///
/// Whole fixes of the firmware's state machine, in this process. A seed has its heading and its latitude, the same in every order.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  north bench orders --fixes 30\n  north bench orders --scenario jittery-drive --ringing-hz 5\n  \
                  north bench orders --scenario calm-bench --scale 1.5\n  \
                  north bench orders --scenario calm-bench --order adaptive --accuracy 0.02"
)]
pub struct Orders {
    /// Fixes for each line
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    fixes: u64,
    /// Only these scenarios
    #[arg(long, value_name = "NAME")]
    scenario: Vec<String>,
    /// These orders
    #[arg(long, value_enum, default_values_t = [OrderName::Mirrored, OrderName::Adaptive])]
    order: Vec<OrderName>,
    /// The drive rings at this frequency, Hz, for as long as the scenario says
    #[arg(long, value_name = "HZ", value_parser = hertz)]
    ringing_hz: Option<f64>,
    /// The gyro's scale factor is off by so much more than the scenario says, percent, -9 to 9
    #[arg(long, value_name = "PERCENT", allow_negative_numbers = true, value_parser = percent)]
    scale: Option<f64>,
    /// All fixes are at this latitude, degrees
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = latitude)]
    latitude: Option<f64>,
    /// The adaptive order goes on until sigma is this, degrees, for half an hour at most
    #[arg(long, value_name = "DEG", value_parser = accuracy)]
    accuracy: Option<f64>,
    /// Seed of the first fix; each line has the same seeds
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// One scenario in one order.
#[derive(Serialize)]
pub struct Row {
    scenario: String,
    order: &'static str,
    fixes: usize,
    /// Fixes with an azimuth.
    azimuths: usize,
    rms_deg: Option<f64>,
    elapsed_mean_s: Option<f64>,
    /// Azimuths with the flag that sigma is above the accuracy that was asked for. It is not one of those below, which say that an azimuth may be
    /// wrong: an order that is asked for no accuracy cannot have it.
    accuracy_not_reached: usize,
    /// Azimuths with a flag that says that something is wrong, those without, and those without that are within 1.96 sigma.
    flagged: usize,
    unflagged: usize,
    inside: usize,
    /// 95 % interval of the share inside.
    inside_interval: [f64; 2],
    /// Azimuths off by more than four sigma, and those of them without a flag.
    wrong: usize,
    wrong_unflagged: usize,
    /// Fixes whose closure is determined, and these closures over their sigmas, rms.
    closures: usize,
    closure_rms_sigmas: Option<f64>,
    /// Mean of chi-square over its degrees of freedom.
    chi_square_ratio: Option<f64>,
    /// Duration from the first promise of a time to go to the end over what was promised: median, and the nine tenths' quantile, of fixes that
    /// reached the accuracy: the others were ended by the time limit, or fell back to four positions.
    time_to_go_ratio: Option<[f64; 2]>,
    /// Fixes with each flag.
    flags: BTreeMap<&'static str, usize>,
    /// Fixes refused, by fault.
    refused: BTreeMap<&'static str, usize>,
}

impl Bench for Orders {
    type Row = Row;

    fn measure(&self, out: &mut dyn Write) -> Result<Vec<Row>, Failure> {
        let scenarios: Vec<&str> = match self.scenario.is_empty() {
            true => SCENARIOS.to_vec(),
            false => self.scenario.iter().map(String::as_str).collect(),
        };
        let bar = progress::bar((scenarios.len() * self.order.len()) as u64 * self.fixes, "fixes");
        writeln!(
            out,
            "| scenario | order | azimuths | rms error, ° | elapsed, s | accuracy not reached | flagged | unflagged inside 95 % | beyond 4 sigma (unflagged) \
             | closures (rms, sigmas) | chi-square / degrees of freedom | real / promised (90 %) | flags | refused |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
        )?;
        let mut rows = Vec::new();
        for name in scenarios {
            for &order in &self.order {
                let fixes = trials(self.seed..self.seed + self.fixes, &bar, |seed| self.fix(name, order, seed))?;
                let fixes = fixes.into_iter().collect::<Result<Vec<_>, Failure>>()?;
                let row = Row::new(name, order, &fixes);
                bar.suspend(|| row.write(out))?;
                rows.push(row);
            }
        }
        bar.finish_and_clear();
        Ok(rows)
    }
}

impl Orders {
    fn fix(&self, name: &str, order: OrderName, seed: u64) -> Result<Ended, Failure> {
        let mut scenario = Scenario::named(name)?;
        scenario.site.azimuth_deg = 360.0 * (OF_HEADING * seed as f64).fract();
        let spread_deg = LATITUDES_DEG * (2.0 * (OF_LATITUDE * seed as f64).fract() - 1.0);
        scenario.site.latitude_deg = self.latitude.unwrap_or(spread_deg);
        if let Some(ringing_hz) = self.ringing_hz {
            // The time in which it decays is 1/(2π · damping · frequency).
            scenario.motor.damping *= scenario.motor.ringing_hz / ringing_hz;
            scenario.motor.ringing_hz = ringing_hz;
        }
        scenario.gyro.scale_ppm += 1e4 * self.scale.unwrap_or(0.0);
        let mut settings = scenario_settings(&scenario, None)?;
        settings.latitude_deg = scenario.site.latitude_deg;
        settings.sequence.order = order.into();
        if let (Some(asked_deg), Order::Adaptive { accuracy_deg }) = (self.accuracy, &mut settings.sequence.order) {
            *accuracy_deg = asked_deg;
            settings.time_limit_s = LONGEST_S;
            scenario.duration_limit_s = LONGEST_S + SPARE_S;
        }
        fix(scenario, seed, settings)
    }
}

/// A frequency that a drive may ring at, as the scenarios allow it.
fn hertz(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(hertz) if (0.5..=200.0).contains(&hertz) => Ok(hertz),
        _ => Err("allowed is 0.5 to 200".into()),
    }
}

/// A latitude at which a fix is not next to a pole.
fn latitude(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(degrees) if (-80.0..=80.0).contains(&degrees) => Ok(degrees),
        _ => Err("allowed is -80 to 80".into()),
    }
}

/// An error of the scale factor that a fix does not refuse.
fn percent(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(percent) if (-9.0..=9.0).contains(&percent) => Ok(percent),
        _ => Err("allowed is -9 to 9".into()),
    }
}

/// Whether a flag says that the azimuth may be wrong. (What was waited for, taken out or not reached does not.)
pub(super) fn is_warned(fix: &Fix) -> bool {
    let harmless = [Flag::Disturbed, Flag::Jitter, Flag::BaseMotion, Flag::FramesLost, Flag::AccuracyNotReached];
    fix.flags.iter().any(|flag| !harmless.contains(&flag))
}

impl Row {
    fn new(scenario: &str, order: OrderName, fixes: &[Ended]) -> Self {
        let (mut flags, mut refused) = (BTreeMap::new(), BTreeMap::new());
        let mut found: Vec<(&Ended, &Found)> = Vec::new();
        for ended in fixes {
            match &ended.end {
                Ok(azimuth) => {
                    found.push((ended, azimuth));
                    azimuth.fix.flags.iter().for_each(|flag| *flags.entry(flag.name()).or_default() += 1);
                }
                Err(fault) => *refused.entry(fault.map_or("no end in time", |fault| fault.name())).or_default() += 1,
            }
        }
        let azimuths = found.len();
        let sigmas = |found: &Found| found.error_deg.abs() / found.fix.sigma_deg;
        let count = |counts: &dyn Fn(&Found) -> bool| found.iter().filter(|(_, found)| counts(found)).count();
        let unflagged = count(&|found| !is_warned(&found.fix));
        let inside = count(&|found| !is_warned(&found.fix) && sigmas(found) < INSIDE_SIGMAS);
        let closure = |fix: &Fix| Some(fix.closure_deg_h? / fix.closure_sigma_deg_h?);
        let closures: Vec<f64> = found.iter().filter_map(|(_, found)| closure(&found.fix)).collect();
        let fits = found.iter().map(|(_, Found { fix, .. })| fix.chi_square / f64::from(fix.degrees_of_freedom.max(1)));
        let reached = found.iter().filter(|(_, found)| !found.fix.flags.contains(Flag::AccuracyNotReached));
        let mut ratios: Vec<f64> = reached.filter_map(|(ended, _)| ended.real_over_promised()).collect();
        ratios.sort_by(f64::total_cmp);
        let nine_tenths = ratios.get(ratios.len() * 9 / 10).copied();
        Self {
            scenario: scenario.into(),
            order: order.name(),
            fixes: fixes.len(),
            azimuths,
            rms_deg: (azimuths > 0).then(|| rms(found.iter().map(|(_, found)| found.error_deg))),
            elapsed_mean_s: (azimuths > 0)
                .then(|| found.iter().map(|(ended, _)| ended.elapsed_s).sum::<f64>() / azimuths as f64),
            accuracy_not_reached: count(&|found| found.fix.flags.contains(Flag::AccuracyNotReached)),
            flagged: azimuths - unflagged,
            unflagged,
            inside,
            inside_interval: probability_interval(inside, unflagged),
            wrong: count(&|found| sigmas(found) > WRONG_SIGMAS),
            wrong_unflagged: count(&|found| sigmas(found) > WRONG_SIGMAS && !is_warned(&found.fix)),
            closures: closures.len(),
            closure_rms_sigmas: (!closures.is_empty()).then(|| rms(closures)),
            chi_square_ratio: (azimuths > 0).then(|| fits.sum::<f64>() / azimuths as f64),
            time_to_go_ratio: nine_tenths.map(|high| [median(ratios), high]),
            flags,
            refused,
        }
    }

    fn write(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let number =
            |value: Option<f64>, digits: usize| value.map_or("–".into(), |value| format!("{value:.digits$}"));
        let counts = |counts: &BTreeMap<&str, usize>| {
            let counts: Vec<_> = counts.iter().map(|(name, count)| format!("{name} {count}")).collect();
            if counts.is_empty() { "–".into() } else { counts.join(", ") }
        };
        let [low, high] = self.inside_interval.map(|share| 100.0 * share);
        writeln!(
            out,
            "| {} | {} | {} of {} | {} | {} | {} | {} | {} of {} ({low:.0} … {high:.0} %) | {} ({}) | {} ({}) | {} | {} | {} | {} |",
            self.scenario,
            self.order,
            self.azimuths,
            self.fixes,
            number(self.rms_deg, 4),
            number(self.elapsed_mean_s, 0),
            self.accuracy_not_reached,
            self.flagged,
            self.inside,
            self.unflagged,
            self.wrong,
            self.wrong_unflagged,
            self.closures,
            number(self.closure_rms_sigmas, 2),
            number(self.chi_square_ratio, 2),
            self.time_to_go_ratio.map_or("–".into(), |[middle, high]| format!("{middle:.2} ({high:.2})")),
            counts(&self.flags),
            counts(&self.refused),
        )
    }
}
