//! One trial: a world of its own, rows of one second, the firmware's replay.

use hal_sim::scenario::{Accelerometer, Base, Encoder, Gyro, Site};
use hal_sim::seconds::{Dwell, Row as SimulatedRow, SecondsGenerator, SiteAndGyro};
use north::solve::solve_rows;
use north_finder::effects::ErrorModel;
use north_finder::event::Fix;
use north_finder::fix::{east_index_deg, west_index_deg};
use north_finder::health::Flag;
use north_finder::instrument::replay::{Recorded, Refusal, Row};
use north_finder::settings::Settings;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::{COARSE_DWELL_S, Case, Order, Spread};
use north::settings_file::declare_noise;

/// Time from the end of a dwell to the beginning of the next: a quarter turn and five seconds of settling, s.
const MOVE_S: f64 = 9.0;

/// How a trial came out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Azimuth minus truth, degrees, in −180 … 180.
    pub error_deg: f64,
    /// The sigma that the fix gave itself, degrees.
    pub sigma_deg: f64,
    /// The bound for this trial's case, degrees.
    pub bound_deg: f64,
    /// The fix carried a doubt (other than of the tilt, which these trials do not measure).
    pub flagged: bool,
}

/// Runs trial number `number`; the same seed and number give the same trial.
///
/// Errors: the fix was refused.
pub fn run(spread: &Spread, seed: u64, number: u64) -> Result<Trial, Refusal> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    let case = spread.draw(&mut random);
    let azimuth_deg = random.random_range(0.0..360.0);
    let bias_deg_h = random.random_range(-0.5..0.5);
    let world = world(&case, azimuth_deg, bias_deg_h);
    let settings = settings(&case);
    let mut generator = SecondsGenerator::new(&world, random.random());

    let first_s = if case.order == Order::EastWest { COARSE_DWELL_S } else { case.dwell_s };
    let mut last_deg = None;
    let mut rows = dwells(&mut generator, &mut last_deg, case.order.angles_deg(), first_s);
    let mut fix = solve(&settings, &rows)?;
    if case.order == Order::EastWest {
        let (east, west) = (east_index_deg(fix.azimuth_deg), west_index_deg(fix.azimuth_deg));
        rows.extend(dwells(&mut generator, &mut last_deg, &[east, west, west, east], case.dwell_s));
        fix = solve(&settings, &rows)?;
    }
    let error_deg = (fix.azimuth_deg - azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
    let flagged = fix.flags.iter().any(|flag| flag != Flag::TiltUnknown);
    Ok(Trial { error_deg, sigma_deg: fix.sigma_deg, bound_deg: case.bound_deg(), flagged })
}

/// A level instrument with white noise and, perhaps, a drift; everything else is perfect.
fn world(case: &Case, azimuth_deg: f64, bias_deg_h: f64) -> SiteAndGyro {
    SiteAndGyro {
        site: Site { latitude_deg: case.latitude_deg, azimuth_deg, ..Site::default() },
        base: Base { pitch_deg: 0.0, roll_deg: 0.0, ..Base::default() },
        gyro: Gyro {
            arw_deg_per_sqrt_h: case.arw_deg_per_sqrt_h,
            drift_deg_h_per_h: case.drift_deg_h_per_h,
            bias_deg_h,
            bias_instability_deg_h: 0.0,
            rrw_deg_h_per_sqrt_h: 0.0,
            scale_ppm: 0.0,
            ..Gyro::default()
        },
        accelerometer: Accelerometer::default(),
        encoder: Encoder { noise_deg: 0.0, eccentricity_deg: 0.0, ..Encoder::default() },
        ..SiteAndGyro::default()
    }
}

/// What the instrument knows: its noise, and that nothing else is wrong with it.
fn settings(case: &Case) -> Settings {
    let mut settings =
        Settings { latitude_deg: case.latitude_deg, model: Some(ErrorModel::default()), ..Settings::default() };
    settings.gyro.bias_instability_deg_h = 0.0;
    settings.gyro.drift_deg_h_per_h = case.declared_drift_deg_h_per_h;
    settings.index.sigma_deg = 0.0;
    settings.level.sigma_deg = 0.0;
    declare_noise(&mut settings, case.arw_deg_per_sqrt_h);
    settings
}

/// Rows of a dwell at each angle, a move before each that is at another angle than the last. The last second of a move
/// has a row, as in a recording; the replay leaves it out, because the index moved in it.
fn dwells(
    generator: &mut SecondsGenerator,
    last_deg: &mut Option<f64>,
    angles_deg: &[f64],
    seconds: f64,
) -> Vec<SimulatedRow> {
    let dwells: Vec<_> = angles_deg
        .iter()
        .map(|&index_deg| match last_deg.replace(index_deg) {
            None => Dwell { index_deg, gap_s: 0.0, seconds },
            Some(last_deg) if last_deg == index_deg => Dwell { index_deg, gap_s: 0.0, seconds },
            Some(_) => Dwell { index_deg, gap_s: MOVE_S - 1.0, seconds: seconds + 1.0 },
        })
        .collect();
    generator.rows(&dwells).collect()
}

fn solve(settings: &Settings, rows: &[SimulatedRow]) -> Result<Fix, Refusal> {
    let rows = rows.iter().map(|row| {
        Recorded::Row(Row { t_s: row.t_s, index_deg: row.index_deg, fog_arcsec: row.fog_arcsec, ..Row::default() })
    });
    solve_rows(settings, rows)
}
