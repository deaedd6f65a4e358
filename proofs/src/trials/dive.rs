//! A dive with an electrostatic gyro, in the aided filter or beside it.

use hal_sim::vessel::electrostatic::{Electrostatic, EsgClass, Orientation};
use hal_sim::vessel::globe;
use hal_sim::vessel::ship::{Passage, Step};
use inertial::esg::filter::{EsgErrors, EsgFilter, PickOff, Situation};
use inertial::esg::reference::{DriftCoefficients, Reference};
use inertial::esg::sky;
use inertial::filter::measurement::Measurement;
use inertial::filter::{Filter, state};
use nalgebra::{Matrix3, Vector3};

use super::aided::{Case, run_with};

/// The attitude that aids the gyro at the surface is read so often, s.
const READ_S: u32 = 60;
/// Errors of that attitude, and of the gyro's heading below, keep for about so long, s: readings in between bring nothing new.
const CORRELATED_S: f64 = 3600.0;
/// Mean radius of the Earth.
const EARTH_M: f64 = 6.371e6;
const ARCSEC: f64 = 4.848_136_811e-6;
const DEG_H: f64 = 4.848_136_811e-6;

/// A dive: the aided filter's case, and the gyro.
#[derive(Clone, Debug)]
pub struct Dive<'a> {
    pub case: Case<'a>,
    pub gyro: EsgClass,
    pub orientation: Orientation,
    /// Rotor of the equatorial orientation, from Greenwich at time zero.
    pub hour_angle_deg: f64,
    /// Until then satellites and antennas tell the attitude, s.
    pub surface_s: f64,
    /// The drift coefficients are known from a stand to this, °/h; `None`: not at all.
    pub calibrated_deg_h: Option<f64>,
}

/// The heading by the gyro at a time.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    pub t_s: f64,
    pub error_deg: f64,
    pub sigma_deg: f64,
    pub position_error_m: f64,
}

/// What the filter is told of a class of gyros.
pub fn declared(class: &EsgClass, coefficient_deg_h: f64, direction_deg: f64) -> EsgErrors {
    EsgErrors {
        direction_rad: direction_deg.to_radians(),
        pick_off_rad: class.pick_off_arcsec * ARCSEC,
        reading_rad: class.reading_arcsec * ARCSEC,
        drift_rad_s: class.drift_deg_h * DEG_H,
        drift_growth_rad_s_per_sqrt_s: class.drift_growth_deg_h_per_sqrt_h * DEG_H / 60.0,
        coefficient_rad_s: coefficient_deg_h * DEG_H,
    }
}

fn ordered(orientation: Orientation, hour_angle_deg: f64) -> Vector3<f64> {
    let angle = hour_angle_deg.to_radians();
    match orientation {
        Orientation::Polar => Vector3::z(),
        Orientation::Equatorial => Vector3::new(angle.cos(), angle.sin(), 0.0),
    }
}

/// Degrees by which the rotor may be off its ordered direction.
const OFF_DEG: f64 = 0.5;

/// Runs with the gyro in the aided filter, 47 states, and tells the heading each `every_s`.
pub fn run_joined(dive: &Dive, seed: u64, every_s: u32) -> Vec<Shot> {
    let mut rotor = Electrostatic::new(dive.gyro, dive.orientation, dive.hour_angle_deg, OFF_DEG, seed);
    let left = dive.calibrated_deg_h.unwrap_or(dive.gyro.coefficient_deg_h);
    let gyro = declared(&dive.gyro, left, OFF_DEG);
    let interval_s = dive.case.passage.interval_s;
    let each = (1.0 / interval_s).round() as u64;
    let (mut shots, mut count) = (Vec::new(), 0u64);
    run_with(&dive.case, seed, |filter, step| {
        if count == 0 {
            let direction = ordered(dive.orientation, dive.hour_angle_deg);
            filter.add_electrostatic(&direction, known(dive, &rotor, seed), gyro);
        }
        rotor.advance(step, interval_s);
        count += 1;
        let second = (count / each) as u32;
        if !count.is_multiple_of(each) || !second.is_multiple_of(READ_S) {
            return;
        }
        let (direction, sensor) = rotor.read(&step.end);
        let _ = filter.measure(&Measurement::PickOff(PickOff { direction, sensor }));
        if second.is_multiple_of(every_s) {
            let told = filter.heading();
            shots.push(shot(filter, step, told.heading_deg, told.sigma_deg));
        }
    });
    shots
}

fn shot(filter: &Filter, step: &Step, heading_deg: f64, sigma_deg: f64) -> Shot {
    let navigation = filter.navigation();
    let here = globe::position(
        navigation.latitude_rad.to_degrees(),
        navigation.longitude_rad.to_degrees(),
        navigation.height_m,
    );
    Shot {
        t_s: step.end.t_s,
        error_deg: (step.end.heading_deg() - heading_deg + 540.0).rem_euclid(360.0) - 180.0,
        sigma_deg,
        position_error_m: (step.end.position_m - here).norm(),
    }
}

/// Runs with a filter of `N` states beside the aided one and tells the heading each `every_s`.
pub fn run<const N: usize, const OTHERS: usize, const PACKED: usize>(
    dive: &Dive,
    seed: u64,
    every_s: u32,
) -> Vec<Shot> {
    let mut rotor = Electrostatic::new(dive.gyro, dive.orientation, dive.hour_angle_deg, OFF_DEG, seed);
    let coefficients = known(dive, &rotor, seed);
    let reference = Reference::new(&ordered(dive.orientation, dive.hour_angle_deg), coefficients);
    let left = dive.calibrated_deg_h.unwrap_or(dive.gyro.coefficient_deg_h);
    let mut esg = EsgFilter::<N, OTHERS, PACKED>::new(reference, declared(&dive.gyro, left, OFF_DEG));
    let interval_s = dive.case.passage.interval_s;
    let each = (1.0 / interval_s).round() as u64;
    let mut shots = Vec::new();
    let mut count = 0u64;
    run_with(&dive.case, seed, |filter, step| {
        rotor.advance(step, interval_s);
        count += 1;
        if !count.is_multiple_of(each) {
            return;
        }
        let second = (count / each) as u32;
        let t_s = step.end.t_s;
        let attitude = filter.navigation().attitude;
        let up_g = attitude.row(2).transpose();
        esg.advance(1.0, &to_inertial(filter, t_s), &up_g);
        if second.is_multiple_of(READ_S) {
            let (direction, sensor) = rotor.read(&step.end);
            let reading = PickOff { direction, sensor };
            if t_s <= dive.surface_s {
                let repeats = (CORRELATED_S / f64::from(READ_S)).sqrt();
                let heading_rad = filter.heading().sigma_deg.to_radians();
                let tilt_rad = filter.sigma(state::ATTITUDE).max(filter.sigma(state::ATTITUDE + 1));
                let sigma_rad = heading_rad.max(tilt_rad) * repeats;
                let _ = esg.measure(&reading, &to_inertial(filter, t_s), sigma_rad);
            }
            let shot = heading(filter, &esg, &reading, step, t_s > dive.surface_s);
            shots.extend(shot.filter(|_| second.is_multiple_of(every_s)));
        }
    });
    shots
}

/// Tells the heading; below the surface the aided filter is given it.
fn heading<const N: usize, const OTHERS: usize, const PACKED: usize>(
    filter: &mut Filter,
    esg: &EsgFilter<N, OTHERS, PACKED>,
    reading: &PickOff,
    step: &Step,
    below: bool,
) -> Option<Shot> {
    let own_deg = filter.heading().heading_deg;
    let navigation = filter.navigation();
    let at = Situation {
        latitude_rad: navigation.latitude_rad,
        longitude_rad: navigation.longitude_rad,
        time_s: step.end.t_s,
        attitude: navigation.attitude,
        tilt_sigma_rad: filter.sigma(state::ATTITUDE).max(filter.sigma(state::ATTITUDE + 1)),
        place_sigma_rad: filter.sigma(state::POSITION).max(filter.sigma(state::POSITION + 1)) / EARTH_M,
    };
    let told = esg.heading(reading, &at)?;
    let heading_rad = own_deg.to_radians() + told.correction_rad;
    let shot = shot(filter, step, heading_rad.to_degrees(), told.sigma_rad.to_degrees());
    if below {
        let sigma_rad = told.sigma_rad * (CORRELATED_S / f64::from(READ_S)).sqrt();
        let _ = filter.measure(&Measurement::Heading { heading_rad, sigma_rad });
    }
    Some(shot)
}

fn to_inertial(filter: &Filter, t_s: f64) -> Matrix3<f64> {
    let navigation = filter.navigation();
    sky::inertial_to_geographic(navigation.latitude_rad, navigation.longitude_rad, t_s).transpose()
        * navigation.attitude
}

/// The true coefficients with the errors of the calibration, or none.
fn known(dive: &Dive, rotor: &Electrostatic, seed: u64) -> DriftCoefficients {
    let Some(sigma_deg_h) = dive.calibrated_deg_h else { return DriftCoefficients::default() };
    let [x, y, z, unbalance, stiffness] = rotor.coefficients_deg_h(sigma_deg_h, seed).map(|value| value * DEG_H);
    DriftCoefficients { block: [x, y, z], unbalance, stiffness }
}

/// A calibration on a stand: attitude known to 5 arcseconds, twelve states. Times, s, and errors of the modelled drift across
/// the rotor, °/h.
pub fn calibrate(passage: &Passage, gyro: EsgClass, seed: u64, every_s: u32) -> Vec<(f64, f64)> {
    let mut rotor = Electrostatic::new(gyro, Orientation::Equatorial, 20.0, OFF_DEG, seed);
    let reference = Reference::new(&ordered(Orientation::Equatorial, 20.0), DriftCoefficients::default());
    let mut esg = EsgFilter::<12, 10, 78>::new(reference, declared(&gyro, gyro.coefficient_deg_h, OFF_DEG));
    let each = (1.0 / passage.interval_s).round() as usize;
    let mut told = Vec::new();
    for (count, step) in passage.steps.iter().enumerate() {
        rotor.advance(step, passage.interval_s);
        if !(count + 1).is_multiple_of(each) {
            continue;
        }
        let second = ((count + 1) / each) as u32;
        let (latitude, longitude, _) = globe::geodetic(&step.end.position_m);
        let to_geographic = sky::inertial_to_geographic(latitude.to_radians(), longitude.to_radians(), step.end.t_s);
        let attitude = step.end.block_attitude();
        let block = to_geographic.transpose() * attitude;
        let up_g = attitude.row(2).transpose();
        esg.advance(1.0, &block, &up_g);
        if second.is_multiple_of(10) {
            let (direction, sensor) = rotor.read(&step.end);
            let _ = esg.measure(&PickOff { direction, sensor }, &block, 5.0 * ARCSEC);
        }
        if second.is_multiple_of(every_s) {
            // What the coefficients and the residual leave of the drift, here and now.
            let error = rotor.drift_rad_s(step, passage.interval_s) - esg.reference().drift(&block, &up_g);
            let across = error - rotor.direction * error.dot(&rotor.direction);
            told.push((step.end.t_s, across.norm() / DEG_H));
        }
    }
    told
}
