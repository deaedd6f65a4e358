//! One trial: a world of its own, rows of one second, the firmware's replay.

use hal_sim::scenario::{Accelerometer, Base, Encoder, Gyro, Site};
use hal_sim::seconds::{Dwell, Row as SimulatedRow, SecondsGenerator, SiteAndGyro};
use north::solve::solve_rows;
use north_finder::effects::{Conditions, ErrorModel};
use north_finder::event::Fix;
use north_finder::fix::accumulator::Second;
use north_finder::fix::rotation::FIRST_PASS;
use north_finder::fix::{east_index_deg, west_index_deg};
use north_finder::health::Flag;
use north_finder::instrument::replay::{Mark, Recorded, Refusal, Row};
use north_finder::sensing::index::Direction;
use north_finder::settings::Settings;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StudentT};

use super::case::{
    COARSE_DWELL_S, Case, ELEVATION_ARCSEC, EVEN_DEG, EVEN_S, Noise, Order, REVERSAL_S, SPEED_DEG_S, Spread,
    UNEVENNESS_DEG,
};
use north::settings_file::declare_noise;

/// Time from the end of a dwell to the beginning of the next: a quarter turn and five seconds of settling, s.
const MOVE_S: f64 = 9.0;

/// Rows of a gyro with noise of its angle, s: the mean angle of a second is that of four readings.
const QUARTER_S: f64 = 0.25;

/// Rows of a rotation, s: the world's rotation vector over a row is the integral of the rate to a thousandth where the index turns by 1.5°.
const STEP_S: f64 = 0.05;

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
    let mut world = world(&case, azimuth_deg, bias_deg_h);
    let settings = settings(&case);
    if let Order::Rotation { .. } = case.order {
        world.gyro.axis_elevation_arcsec = random.random_range(-ELEVATION_ARCSEC..ELEVATION_ARCSEC);
        world.unevenness_deg = UNEVENNESS_DEG;
    }
    let mut measurement = Measurement::new(&case, &world, random.random());
    let fix = match case.order {
        Order::Rotation { passes } => measurement.rotate(passes, &mut random, &settings)?,
        _ => solve(&settings, &measurement.rows(&case, &mut random, &settings)?, measurement.interval_s)?,
    };
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
        let interval_s = match (case.order, case.noise) {
            (Order::Rotation { .. }, _) => STEP_S,
            (_, Noise::Angle { .. }) => QUARTER_S,
            _ => 1.0,
        };
        Self { generator: SecondsGenerator::new(world, seed).with_interval_s(interval_s), last_deg: None, interval_s }
    }

    /// The rows of a whole fix.
    fn rows(
        &mut self,
        case: &Case,
        random: &mut ChaCha8Rng,
        settings: &Settings,
    ) -> Result<Vec<SimulatedRow>, Refusal> {
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

    /// A continuous rotation, its seconds marked as the instrument marks them.
    fn rotate(&mut self, passes: u16, random: &mut ChaCha8Rng, settings: &Settings) -> Result<Fix, Refusal> {
        let mut seconds = Vec::new();
        for pass in 0..passes {
            // The whole seconds begin somewhere in the first of them.
            let way_deg = SPEED_DEG_S * EVEN_S;
            let low_deg = random.random_range(EVEN_DEG[0]..EVEN_DEG[1] - way_deg);
            let ends_deg = [low_deg, low_deg + way_deg];
            let [from_deg, to_deg] = if pass % 2 == 0 { ends_deg } else { [ends_deg[1], ends_deg[0]] };
            let gap = Dwell { index_deg: from_deg, gap_s: REVERSAL_S, seconds: 0.0 };
            self.generator.rows(&[gap]).for_each(drop);
            let mark = Mark { dwell: Some(FIRST_PASS + (pass % 100) as u8), waited_at: None };
            let rows = self.generator.turn(to_deg, EVEN_S);
            let in_second = (1.0 / STEP_S) as usize;
            seconds.extend(rows.chunks_exact(in_second).map(|rows| Recorded::Second(second(rows), mark)));
            seconds.push(Recorded::Second(Second::default(), Mark::default()));
        }
        solve_rows(settings, seconds)
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

/// The rows of a second of the instrument, with their mean angle, as it takes it.
fn second(rows: &[SimulatedRow]) -> Second {
    let mean_deg = rows.iter().map(|row| row.index_deg).sum::<f64>() / rows.len() as f64;
    let conditions = Conditions {
        t_s: rows.last().map_or(0.0, |row| row.t_s) - 0.5,
        seconds: 1.0,
        raw_rate_deg_h: rows.iter().map(|row| row.fog_arcsec).sum(),
        index: Some(Direction::of_deg(mean_deg)),
        ..Conditions::default()
    };
    Second { conditions, ..Second::default() }
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
    if let Order::Rotation { passes } = case.order {
        settings.sequence.order = north_finder::sequence::order::Order::Rotation { passes: passes as u8 };
    }
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
