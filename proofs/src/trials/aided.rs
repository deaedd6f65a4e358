//! One run of the aided filter along a simulated passage: what a Monte Carlo repeats.

use hal_sim::vessel::block::{Block, BlockClass};
use hal_sim::vessel::globe;
use hal_sim::vessel::satellites::{Antennas, Receivers, WAVELENGTH_M};
use hal_sim::vessel::ship::{Instant, Passage, Step};
use hal_sim::vessel::water::{WaterClass, WaterInstruments};
use inertial::Increment;
use inertial::filter::block::BlockErrors;
use inertial::filter::measurement::{Measurement, PhaseDifference};
use inertial::filter::navigation::Navigation;
use inertial::filter::{BlockReading, Filter, Installation, Mode, StartSigmas, state};
use nalgebra::{Rotation3, SMatrix, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What aids in a stretch of the run, and how often; `None` is never. Seconds.
#[derive(Clone, Copy, Debug)]
pub struct Aids {
    pub until_s: f64,
    pub mode: Mode,
    pub satellites_s: Option<u32>,
    /// Sea level with this heave as its noise, or the depth gauge with this noise, m.
    pub height_m: Option<f64>,
    pub heading_s: Option<u32>,
    pub log_s: Option<u32>,
    pub acoustic_s: Option<u32>,
    pub phases: bool,
    /// Share of satellite positions that are wrong, by hundreds of metres.
    pub outliers: f64,
}

impl Aids {
    pub const SATELLITES: Self = Self {
        until_s: f64::INFINITY,
        mode: Mode::Manoeuvring,
        satellites_s: Some(1),
        height_m: None,
        heading_s: None,
        log_s: None,
        acoustic_s: None,
        phases: false,
        outliers: 0.0,
    };
}

/// A class of blocks: what the simulator draws from, and what the filter is told.
#[derive(Clone, Copy, Debug)]
pub struct Class {
    pub name: &'static str,
    pub simulated: BlockClass,
    pub declared: BlockErrors,
}

impl Class {
    pub const FOG: Self = Self { name: "FOG", simulated: BlockClass::FOG, declared: BlockErrors::FOG };
}

/// A case of a Monte Carlo.
#[derive(Clone, Debug)]
pub struct Case<'a> {
    pub passage: &'a Passage,
    pub class: Class,
    pub start: StartSigmas,
    pub aids: &'a [Aids],
    pub water: WaterClass,
    pub antennas: Antennas,
    /// Record every so many seconds.
    pub every_s: u32,
}

/// What is kept of one time.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
    pub t_s: f64,
    /// True less estimated.
    pub heading_error_deg: f64,
    pub heading_sigma_deg: f64,
    pub position_error_m: f64,
    pub position_sigma_m: f64,
    pub scale_z_error: f64,
    pub scale_z_sigma: f64,
    /// Root mean square of both axes'.
    pub rhumb_sigma_rad_s: f64,
    /// Normalised squared error of attitude, velocity and position together: chi-square with nine degrees of freedom.
    pub normalised_squared_error: f64,
    pub sigmas: SVector<f64, { state::STATES }>,
    pub fixed: bool,
}

/// A finished run.
pub struct Outcome {
    pub snapshots: Vec<Snapshot>,
    pub filter: Filter,
}

/// Antennas of a ship: velocity 0.1 m/s, position 5 m, phase differences 3 mm over 2 m.
pub fn antennas() -> Antennas {
    Antennas {
        antenna_m: Vector3::new(0.5, 2.0, 8.0),
        baseline_m: Vector3::new(2.0, 0.0, 0.0),
        velocity_m_s: 0.1,
        position_m: 5.0,
        phase_m: 0.003,
    }
}

/// Runs the filter with the errors of `seed`.
pub fn run(case: &Case, seed: u64) -> Outcome {
    run_with(case, seed, |_, _| {})
}

/// The same, with something beside the filter that sees every interval of the block.
pub fn run_with(case: &Case, seed: u64, mut beside: impl FnMut(&mut Filter, &Step)) -> Outcome {
    let passage = case.passage;
    let mut random = Normal(ChaCha8Rng::seed_from_u64(seed ^ 0x5eed));
    let mut block = Block::new(case.class.simulated, seed);
    let mut receivers = {
        let mut antennas = case.antennas;
        let off = Vector3::new(0.0, random.draw(), random.draw()) * case.start.baseline_m;
        antennas.baseline_m += off;
        Receivers::new(antennas, seed)
    };
    let mut water = WaterInstruments::new(case.water, seed);
    let navigation = start(&passage.start, &case.start, &mut random);
    let installation = Installation { antenna_m: case.antennas.antenna_m, baseline_m: case.antennas.baseline_m };
    let first = case.aids.first().copied().unwrap_or(Aids::SATELLITES);
    let mut filter =
        Filter::new(navigation, passage.start.turn_rad, case.class.declared, &case.start, installation, first.mode)
            .expect("away from the poles");
    let mut snapshots = Vec::new();
    let mut last = passage.start;
    let each = (1.0 / passage.interval_s).round() as usize;
    for (number, step) in passage.steps.iter().enumerate() {
        let (angle, velocity) = block.read(step, passage.interval_s);
        let increment = Increment { angle_rad: Vector3::from(angle), velocity_m_s: Vector3::from(velocity) };
        let reading = BlockReading { dt_s: passage.interval_s, increment, turn_rad: step.end.turn_rad };
        filter.advance(&reading).expect("a good reading");
        let at = &step.end;
        let aids = case.aids.iter().find(|aids| at.t_s < aids.until_s + 1e-6).copied().unwrap_or(first);
        if aids.phases && (number + 1) % (each / 10).max(1) == 0 {
            let differences = receivers.phases(at).map(|difference| {
                Some(PhaseDifference {
                    pair: difference.pair,
                    direction: difference.direction,
                    phase_m: difference.phase_m,
                    wavelength_m: WAVELENGTH_M,
                    slipped: false,
                })
            });
            let _ = filter.measure(&Measurement::Phases { differences, sigma_m: case.antennas.phase_m });
        }
        beside(&mut filter, step);
        if (number + 1) % each != 0 {
            continue;
        }
        let second = ((number + 1) / each) as u32;
        filter.set_mode(aids.mode);
        aid(&mut filter, case, &aids, second, (&last, at), (&mut receivers, &mut water, &mut random));
        last = *at;
        if second.is_multiple_of(case.every_s) {
            snapshots.push(snapshot(&mut filter, at, &block));
        }
    }
    Outcome { snapshots, filter }
}

fn aid(
    filter: &mut Filter,
    case: &Case,
    aids: &Aids,
    second: u32,
    (last, at): (&Instant, &Instant),
    (receivers, water, random): (&mut Receivers, &mut WaterInstruments, &mut Normal),
) {
    let class = &case.water;
    let due = |every: Option<u32>| every.is_some_and(|every| second.is_multiple_of(every));
    if due(aids.satellites_s) {
        let mean_m_s = receivers.velocity_m_s(last, at);
        let (interval_s, sigma_m_s) = (at.t_s - last.t_s, case.antennas.velocity_m_s);
        let _ = filter.measure(&Measurement::Velocity { mean_m_s, interval_s, sigma_m_s });
        let (latitude, longitude, mut height_m) = receivers.position(at);
        if aids.outliers > 0.0 && random.0.random::<f64>() < aids.outliers {
            height_m += 300.0 * random.draw();
        }
        let _ = filter.measure(&Measurement::Position {
            latitude_rad: latitude.to_radians(),
            longitude_rad: longitude.to_radians(),
            height_m,
            age_s: 0.0,
            sigma_m: case.antennas.position_m,
        });
    }
    if let Some(sigma_m) = aids.height_m {
        let height_m = if aids.mode == Mode::Submerged { water.height_m(at) } else { 0.0 };
        let _ = filter.measure(&Measurement::Height { height_m, sigma_m });
    }
    if due(aids.heading_s) {
        let heading_rad = water.heading_deg(at).to_radians();
        let _ = filter.measure(&Measurement::Heading { heading_rad, sigma_rad: class.heading_deg.to_radians() });
    }
    if due(aids.log_s) {
        let [starboard_m_s, forward_m_s] = water.log_m_s(at).map(Some);
        let _ = filter.measure(&Measurement::Log { starboard_m_s, forward_m_s, sigma_m_s: class.log_m_s });
    }
    if due(aids.acoustic_s) {
        let (latitude, longitude) = water.acoustic_fix(at);
        let _ = filter.measure(&Measurement::Acoustic {
            latitude_rad: latitude.to_radians(),
            longitude_rad: longitude.to_radians(),
            age_s: 0.0,
            sigma_m: class.acoustic_m,
        });
    }
}

/// The truth with errors drawn from the start's standard deviations.
fn start(at: &Instant, sigmas: &StartSigmas, random: &mut Normal) -> Navigation {
    let turn = Vector3::new(
        sigmas.tilt_rad * random.draw(),
        sigmas.tilt_rad * random.draw(),
        sigmas.heading_rad * random.draw(),
    );
    let attitude = Rotation3::new(-turn).matrix() * at.block_attitude();
    let mut three = |sigma: f64| Vector3::from_fn(|_, _| sigma * random.draw());
    let velocity = at.ground_velocity_m_s() - three(sigmas.velocity_m_s);
    let position = at.position_m - at.east_north_up() * three(sigmas.position_m);
    let (latitude, longitude, height) = globe::geodetic(&position);
    Navigation::new(attitude, velocity, latitude.to_radians(), longitude.to_radians(), height)
}

fn snapshot(filter: &mut Filter, at: &Instant, block: &Block) -> Snapshot {
    let heading = filter.heading();
    let navigation = filter.navigation();
    let turn = Rotation3::from_matrix_unchecked(at.block_attitude() * navigation.attitude.transpose()).scaled_axis();
    let here = globe::position(
        navigation.latitude_rad.to_degrees(),
        navigation.longitude_rad.to_degrees(),
        navigation.height_m,
    );
    let velocity = at.ground_velocity_m_s() - navigation.velocity_m_s;
    let position = at.east_north_up().transpose() * (at.position_m - here);

    let error = SVector::<f64, 9>::from_iterator(turn.iter().chain(velocity.iter()).chain(position.iter()).copied());
    let covariance = SMatrix::<f64, 9, 9>::from_fn(|i, j| filter.covariance(i, j));
    let normalised_squared_error =
        covariance.cholesky().map_or(f64::INFINITY, |factor| error.dot(&factor.solve(&error)));
    let wrapped = (at.heading_deg() - heading.heading_deg + 540.0).rem_euclid(360.0) - 180.0;
    Snapshot {
        t_s: at.t_s,
        heading_error_deg: wrapped,
        heading_sigma_deg: heading.sigma_deg,
        position_error_m: position.xy().norm(),
        position_sigma_m: filter.sigma(state::POSITION).hypot(filter.sigma(state::POSITION + 1)),
        scale_z_error: block.gains.z - 1.0 - filter.estimates().scale.z,
        scale_z_sigma: filter.sigma(state::SCALE + 2),
        rhumb_sigma_rad_s: filter.sigma(state::RHUMB).hypot(filter.sigma(state::RHUMB + 1)) / std::f64::consts::SQRT_2,
        normalised_squared_error,
        sigmas: SVector::from_fn(|state, _| filter.sigma(state)),
        fixed: filter.ambiguities_fixed(),
    }
}

struct Normal(ChaCha8Rng);

impl Normal {
    /// Gaussian, mean 0, variance 1 (Box and Muller).
    fn draw(&mut self) -> f64 {
        let (a, b): (f64, f64) = (self.0.random(), self.0.random());
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}
