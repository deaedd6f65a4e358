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
use rand_distr::{Distribution, StandardNormal, StudentT};

use super::case::{COARSE_DWELL_S, Case, Noise, Order, Spread, TRAVEL_DEG};
use north::settings_file::declare_noise;

/// Time from the end of a dwell to the beginning of the next: a quarter turn and five seconds of settling, s.
const MOVE_S: f64 = 9.0;

/// Rows of a gyro with noise of its angle, s: the mean angle of a second is that of four readings.
const QUARTER_S: f64 = 0.25;

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
    let mut measurement = Measurement::new(&case, &world, random.random());
    let rows = measurement.rows(&case, &mut random, &settings)?;
    let fix = solve(&settings, &rows, measurement.interval_s)?;
    let error_deg = (fix.azimuth_deg - azimuth_deg + 180.0).rem_euclid(360.0) - 180.0;
    let unmeasured = [Flag::TiltUnknown, Flag::LevelUncalibrated];
    let flagged = fix.flags.iter().any(|flag| !unmeasured.contains(&flag));
    Ok(Trial { error_deg, sigma_deg: fix.sigma_deg, bound_deg: case.bound_deg(), flagged })
}

/// An instrument that measures.
struct Measurement {
    generator: SecondsGenerator,
    /// Where its last dwell was.
    last_deg: Option<f64>,
    interval_s: f64,
}

impl Measurement {
    fn new(case: &Case, world: &SiteAndGyro, seed: u64) -> Self {
        let interval_s = if matches!(case.noise, Noise::Angle { .. }) { QUARTER_S } else { 1.0 };
        Self { generator: SecondsGenerator::new(world, seed).with_interval_s(interval_s), last_deg: None, interval_s }
    }

    /// The rows of a whole fix.
    fn rows(
        &mut self,
        case: &Case,
        random: &mut ChaCha8Rng,
        settings: &Settings,
    ) -> Result<Vec<SimulatedRow>, Refusal> {
        if let Order::Rotation { passes } = case.order {
            let pass = |pass: u16| self.generator.turn(TRAVEL_DEG[usize::from(1 - pass % 2)], case.dwell_s);
            let mut rows: Vec<_> = (0..passes).flat_map(pass).collect();
            add_noise(&mut rows, case, self.interval_s, random);
            return Ok(rows);
        }
        let first_s = if case.order == Order::EastWest { COARSE_DWELL_S } else { case.dwell_s };
        let mut rows = self.dwells(case.order.angles_deg(), first_s);
        add_noise(&mut rows, case, self.interval_s, random);
        if case.order == Order::EastWest {
            let coarse = solve(settings, &rows, self.interval_s)?;
            let (east, west) = (east_index_deg(coarse.azimuth_deg), west_index_deg(coarse.azimuth_deg));
            let mut fine = self.dwells(&[east, west, west, east], case.dwell_s);
            add_noise(&mut fine, case, self.interval_s, random);
            rows.extend(fine);
        }
        Ok(rows)
    }

    /// Rows of a dwell at each angle, a move before each that is at another angle than the last. The last second of a move
    /// has a row, as in a recording; the replay leaves it out, because the index moved in it.
    fn dwells(&mut self, angles_deg: &[f64], seconds: f64) -> Vec<SimulatedRow> {
        let dwells: Vec<_> = angles_deg
            .iter()
            .map(|&index_deg| match self.last_deg.replace(index_deg) {
                None => Dwell { index_deg, gap_s: 0.0, seconds },
                Some(last_deg) if last_deg == index_deg => Dwell { index_deg, gap_s: 0.0, seconds },
                Some(_) => Dwell { index_deg, gap_s: MOVE_S - 1.0, seconds: seconds + 1.0 },
            })
            .collect();
        self.generator.rows(&dwells).collect()
    }
}

/// Adds to the rows the noise that the world does not have.
fn add_noise(rows: &mut [SimulatedRow], case: &Case, interval_s: f64, random: &mut ChaCha8Rng) {
    let sigma_arcsec = 60.0 * case.arw_deg_per_sqrt_h * interval_s.sqrt();
    match case.noise {
        Noise::White | Noise::Flicker { .. } => {}
        Noise::HeavyTails => {
            // Its variance with n degrees of freedom is n/(n − 2).
            let Ok(tails) = StudentT::new(3.0) else { return };
            rows.iter_mut().for_each(|row| row.fog_arcsec += sigma_arcsec / 3f64.sqrt() * tails.sample(random));
        }
        Noise::Bursts => rows.iter_mut().for_each(|row| {
            // 0.9 + 0.1 · 16 = 2.5.
            let times = if random.random_bool(0.1) { 4.0 } else { 1.0 };
            let normal: f64 = StandardNormal.sample(random);
            row.fog_arcsec += sigma_arcsec / 2.5f64.sqrt() * times * normal;
        }),
        Noise::Angle { arcsec, .. } => {
            let mut angle = || -> f64 { arcsec * Distribution::<f64>::sample(&StandardNormal, random) };
            let mut last = angle();
            rows.iter_mut().for_each(|row| {
                let now = angle();
                row.fog_arcsec += now - last;
                last = now;
            });
        }
    }
}

/// A level instrument with white noise and, perhaps, a drift; everything else is perfect.
fn world(case: &Case, azimuth_deg: f64, bias_deg_h: f64) -> SiteAndGyro {
    SiteAndGyro {
        site: Site { latitude_deg: case.latitude_deg, azimuth_deg, ..Site::default() },
        base: Base { pitch_deg: 0.0, roll_deg: 0.0, ..Base::default() },
        gyro: Gyro {
            arw_deg_per_sqrt_h: match case.noise {
                Noise::HeavyTails | Noise::Bursts => 0.0,
                Noise::White | Noise::Flicker { .. } | Noise::Angle { .. } => case.arw_deg_per_sqrt_h,
            },
            drift_deg_h_per_h: case.drift_deg_h_per_h,
            bias_deg_h,
            bias_instability_deg_h: instability_deg_h(case),
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
    settings.gyro.bias_instability_deg_h = instability_deg_h(case);
    if let Noise::Angle { arcsec, declared: true } = case.noise {
        settings.gyro.angle_noise_arcsec = arcsec;
    }
    settings.gyro.drift_deg_h_per_h = case.declared_drift_deg_h_per_h;
    settings.index.sigma_deg = 0.0;
    settings.level.sigma_deg = 0.0;
    declare_noise(&mut settings, case.arw_deg_per_sqrt_h);
    settings
}

fn instability_deg_h(case: &Case) -> f64 {
    match case.noise {
        Noise::Flicker { instability_deg_h } => instability_deg_h,
        _ => 0.0,
    }
}

fn solve(settings: &Settings, rows: &[SimulatedRow], interval_s: f64) -> Result<Fix, Refusal> {
    let rows = rows.iter().map(|&SimulatedRow { t_s, index_deg, fog_arcsec, .. }| {
        Recorded::Row(Row { t_s, index_deg, fog_arcsec, interval_s, ..Row::default() })
    });
    solve_rows(settings, rows)
}
