use nalgebra::SVector;

use super::measurement::PhaseDifference;
use super::state::{ESG_DIRECTION, ESG_DRIFT, ESG_PICK_OFF};
use super::*;
use crate::Quaternion;
use crate::esg::filter::{EsgErrors, PickOff};
use crate::esg::reference::DriftCoefficients;
use crate::esg::sky::inertial_to_geographic;

/// Steps of the block, and their length: just short of the second after which the filter closes its interval.
const STEPS: usize = 98;
const STEP_S: f64 = 0.01;

fn filter() -> Filter {
    let attitude = Quaternion::from_rotation_vector(&Vector3::new(0.1, -0.2, 1.1)).direction_cosines();
    let navigation = Navigation::new(attitude, Vector3::new(8.0, -5.0, 0.3), 60.0 * RAD_PER_DEG, 0.3, 20.0);
    let installation =
        Installation { antenna_m: Vector3::new(1.0, 4.0, 10.0), baseline_m: Vector3::new(2.0, 0.0, 0.0) };
    // The specific force is well known: the equations hold all of it.
    let block = BlockErrors { accelerometer_bias_m_s2: 1e-6, ..BlockErrors::FOG };
    let start = StartSigmas { tilt_rad: 1e-6, ..StartSigmas::USUAL };
    Filter::new(navigation, 0.4, block, &start, installation, Mode::Aided).unwrap()
}

/// A second in which the block turns, is tossed and turns on the hull.
fn second(filter: &mut Filter) {
    let dt_s = STEP_S;
    for step in 0..STEPS {
        let t = step as f64 * dt_s;
        let rate = Vector3::new(0.02, 0.03, 0.05);
        let force = Vector3::new(0.5, -0.4, 9.7 + 0.1 * sin(2.0 * t));
        let increment = Increment { angle_rad: rate * dt_s, velocity_m_s: force * dt_s };
        filter.advance(&BlockReading { dt_s, increment, turn_rad: 0.4 + 0.033 * (t + dt_s) }).unwrap();
    }
}

/// What has to be added to `estimate` to get `truth`.
fn error_between(estimate: &Filter, truth: &Filter) -> Errors {
    let mut x = Errors::zeros();
    let turn = truth.navigation.attitude * estimate.navigation.attitude.transpose();
    let skew = 0.5 * (turn - turn.transpose());
    x.fixed_rows_mut::<3>(ATTITUDE).copy_from(&Vector3::new(skew.m32, skew.m13, skew.m21));
    let (a, b) = (&estimate.navigation, &truth.navigation);
    x.fixed_rows_mut::<3>(VELOCITY).copy_from(&(b.velocity_m_s - a.velocity_m_s));
    let place = a.place();
    x[POSITION] = (b.longitude_rad - a.longitude_rad) * place.prime_vertical_m * cos(a.latitude_rad);
    x[POSITION + 1] = (b.latitude_rad - a.latitude_rad) * place.meridian_m;
    x[POSITION + 2] = b.height_m - a.height_m;
    x
}

/// Every state's error is put into the nonlinear navigation and let run for a second: the error equations must tell what comes out.
///
/// Central differences, so that what is left of the errors' own size is of the third order in them. The equations hold the
/// interval's mean force where what is integrated twice has it weighted by the time that is left. The block here turns by 0.06
/// rad, so that the force in geographic axes changes by 0.6 m/s²: a velocity that comes of a drift may be off by a twelfth
/// of that times what the drift turns, a position by a sixth.
#[test]
fn the_error_equations_are_the_derivative_of_the_navigation() {
    let mut nominal = filter();
    second(&mut nominal);
    let transition =
        nominal.interval.transition(&nominal.navigation, &nominal.block, nominal.force_sigma_m_s2()).unwrap();
    let sizes = [
        (ATTITUDE, 3, 1e-4),
        (VELOCITY, 3, 0.1),
        (POSITION, 3, 100.0),
        (MARKOV, 3, 1e-5),
        (CURRENT, 2, 0.1),
        (RUN_TO_RUN, 3, 1e-5),
        (SCALE, 3, 1.5e-4),
        (ORTHOGONALITY, 3, 1.5e-4),
        (RHUMB, 2, 1e-5),
        (ACCELEROMETER, 3, 0.01),
    ];
    for (state, size) in sizes.iter().flat_map(|(first, count, size)| (*first..first + count).map(move |s| (s, *size)))
    {
        let run = |size: f64| {
            let mut truth = filter();
            let mut x = Errors::zeros();
            x[state] = size;
            truth.feed_back(&x);
            second(&mut truth);
            error_between(&nominal, &truth)
        };
        let derivative = (run(size) - run(-size)) / 2.0;
        let predicted: SVector<f64, LEAD> = if state < LEAD {
            transition.phi.column(state) * size
        } else {
            transition.coupling.column(state - LEAD) * size
        };
        let turned = if state < LEAD { 0.0 } else { predicted.fixed_rows::<3>(ATTITUDE).norm() };
        let (second, third) = (2e-8 + 0.07 * turned, 2e-7 + 0.1 * turned);
        for (first, share, least) in [(ATTITUDE, 2e-3, 2e-11), (VELOCITY, 2e-3, second), (POSITION, 0.05, third)] {
            let got = derivative.fixed_rows::<3>(first).into_owned();
            let want = predicted.fixed_rows::<3>(first).into_owned();
            let error = (got - want).norm();
            assert!(error < share * want.norm().max(got.norm()) + least, "state {state} on {first}: {got} {want}");
        }
    }
}

/// How the expected reading changes with the errors, by putting them into the filter: central differences against the row.
#[test]
fn rows_are_the_derivatives_of_the_expected_readings() {
    let mut nominal = filter();
    second(&mut nominal);
    let difference = PhaseDifference {
        pair: 1,
        direction: Vector3::new(0.4, -0.7, 0.3),
        phase_m: 0.0,
        wavelength_m: 0.19,
        slipped: false,
    };
    let (latitude_rad, longitude_rad) = (nominal.navigation.latitude_rad, nominal.navigation.longitude_rad);
    let readings = [
        Measurement::Position { latitude_rad, longitude_rad, height_m: 20.0, age_s: 0.4, sigma_m: 5.0 },
        Measurement::Height { height_m: 20.0, sigma_m: 1.0 },
        Measurement::Heading { heading_rad: 1.0, sigma_rad: 0.01 },
        Measurement::Log { starboard_m_s: Some(0.0), forward_m_s: Some(5.0), sigma_m_s: 0.1 },
        Measurement::Phases { differences: [Some(difference), None, None, None], sigma_m: 0.003 },
    ];
    for reading in &readings {
        let rows = nominal.rows(reading);
        for state in 0..STATES {
            let size = if (POSITION..POSITION + 3).contains(&state) { 1.0 } else { 1e-5 };
            let values = |size: f64| {
                let mut moved = nominal.clone();
                let mut x = Errors::zeros();
                x[state] = size;
                moved.feed_back(&x);
                moved.rows(reading).map(|row| row.map_or(0.0, |row| row.value))
            };
            let (up, down) = (values(size), values(-size));
            for (row, (up, down)) in rows.iter().flatten().zip(up.into_iter().zip(down)) {
                // What the estimate takes over is gone from the innovation.
                let derivative = (down - up) / (2.0 * size);
                assert!(
                    (derivative - row.h[state]).abs() < 1e-4,
                    "{reading:?} state {state}: {derivative} {}",
                    row.h[state]
                );
            }
        }
    }
}

/// The rows of the electrostatic gyro by putting errors into the filter; sizes that move a direction by some arcseconds each.
#[test]
fn the_rows_of_the_rotor_are_the_derivatives_of_the_expected_reading() {
    let mut nominal = filter();
    let direction = Vector3::new(0.3, -0.5, 0.8).normalize();
    let errors = EsgErrors {
        direction_rad: 1e-4,
        pick_off_rad: 1e-4,
        reading_rad: 2e-5,
        drift_rad_s: 1e-8,
        drift_growth_rad_s_per_sqrt_s: 0.0,
        coefficient_rad_s: 1e-6,
    };
    let coefficients = DriftCoefficients { block: [2e-6, -1e-6, 1e-6], unbalance: 1e-6, stiffness: 2e-6 };
    nominal.add_electrostatic(&direction, coefficients, errors);
    let seen = |filter: &Filter| {
        let navigation = &filter.navigation;
        let sky = inertial_to_geographic(navigation.latitude_rad, navigation.longitude_rad, filter.time_s);
        navigation.attitude.transpose() * sky * filter.virtual_gyro().unwrap().direction()
    };
    let reading =
        Measurement::PickOff(PickOff { direction: seen(&nominal) + Vector3::new(1e-5, 2e-5, -1e-5), sensor: 4 });
    let rows = nominal.rows(&reading);
    for state in (0..LEAD).chain(ESG_DIRECTION..ESG_DRIFT) {
        let size = if (POSITION..LEAD).contains(&state) { 100.0 } else { 1e-5 };
        let values = |size: f64| {
            let mut moved = nominal.clone();
            let mut x = Errors::zeros();
            x[state] = size;
            moved.feed_back(&x);
            moved.rows(&reading).map(|row| row.map_or(0.0, |row| row.value))
        };
        let (up, down) = (values(size), values(-size));
        for (row, (up, down)) in rows.iter().flatten().zip(up.into_iter().zip(down)) {
            let (got, want) = (0.5 * (down - up), row.h[state] * size);
            assert!((got - want).abs() < 1e-9 + 1e-3 * want.abs(), "state {state}: {got} {want}");
        }
    }
    // A drift error of the virtual gyro, by the covariance's own arithmetic and by letting two gyros run for 98 × 10 ms: x6 and x7 of
    // 1e-6 rad/s each move the direction by 1e-6 rad.
    for (state, along) in [(ESG_DRIFT, ESG_DIRECTION + 1), (ESG_DRIFT + 1, ESG_DIRECTION)] {
        let mut truth = nominal.clone();
        let mut x = Errors::zeros();
        x[state] = 1e-6;
        truth.feed_back(&x);
        let mut estimate = nominal.clone();
        for filter in [&mut truth, &mut estimate] {
            second(filter);
            filter.close_interval();
        }
        let moved = truth.virtual_gyro().unwrap().direction() - estimate.virtual_gyro().unwrap().direction();
        let (a, b) = estimate.virtual_gyro().unwrap().plane();
        let axis = if along == ESG_DIRECTION { a } else { b };
        assert!((moved - axis * 0.98e-6).norm() < 1e-9, "{moved} along {axis}");
        let slope = estimate.covariance(along, state) / estimate.covariance(state, state);
        assert!((slope - 0.98).abs() < 1e-6, "{slope}");
    }
    // Readings of another sensor begin anew; those without a gyro say nothing.
    let heading_rad = nominal.heading().heading_deg * RAD_PER_DEG;
    nominal.measure(&Measurement::Heading { heading_rad, sigma_rad: 1e-6 }).unwrap();
    nominal.measure(&reading).unwrap();
    assert!(nominal.sigma(ESG_PICK_OFF + 1) < 0.99e-4);
    nominal.follow_sensor(2);
    assert!((nominal.sigma(ESG_PICK_OFF + 1) - 1e-4).abs() < 1e-8);
    assert_eq!(filter().measure(&reading), Ok(Outcome::Silent));
}

/// The velocity of a second belongs to its middle: what the error then was follows from the error now.
#[test]
fn a_velocity_belongs_to_the_middle_of_its_second() {
    let mut nominal = filter();
    nominal.mark();
    second(&mut nominal);
    let transition =
        nominal.interval.transition(&nominal.navigation, &nominal.block, nominal.force_sigma_m_s2()).unwrap();
    nominal.close_interval();
    let reading = Measurement::Velocity { mean_m_s: Vector3::zeros(), interval_s: 1.0, sigma_m_s: 0.1 };
    let rows = nominal.rows(&reading);
    for (state, size) in [(0, 1e-4), (1, 1e-4), (2, 1e-4), (3, 0.1), (5, 0.1), (25, 1e-2), (26, 1e-2), (27, 1e-2)] {
        let values = |size: f64| {
            let mut truth = filter();
            let mut x = Errors::zeros();
            x[state] = size;
            truth.feed_back(&x);
            truth.mark();
            second(&mut truth);
            truth.rows(&reading).map(|row| row.map_or(0.0, |row| row.value))
        };
        // The error now, of the error a second ago.
        let mut now = Errors::zeros();
        now[state] = size;
        let lead: SVector<f64, LEAD> = if state < LEAD {
            transition.phi.column(state) * size
        } else {
            transition.coupling.column(state - LEAD) * size
        };
        now.fixed_rows_mut::<LEAD>(0).copy_from(&lead);
        let (up, down) = (values(size), values(-size));
        for (row, (up, down)) in rows.iter().flatten().zip(up.into_iter().zip(down)) {
            let got = 0.5 * (down - up);
            // A twentieth of what tilt does in half a second: the mean force stands for the changing one.
            let least = 0.05 * 5.0 * size.min(1e-2);
            assert!((got - row.h.dot(&now)).abs() < least, "state {state}: {got} {}", row.h.dot(&now));
        }
    }
}

/// After an interruption the first velocity belongs to a second that began at no mark: it opens the next one.
#[test]
fn a_velocity_after_an_interruption_is_not_taken_for_a_mean_over_it() {
    let mut filter = filter();
    filter.mark();
    second(&mut filter);
    second(&mut filter);
    let reading = Measurement::Velocity { mean_m_s: Vector3::zeros(), interval_s: 0.98, sigma_m_s: 1.0 };
    assert_eq!(filter.measure(&reading), Ok(Outcome::Silent));
    second(&mut filter);
    assert_ne!(filter.measure(&reading), Ok(Outcome::Silent));
}

#[test]
fn an_outlier_is_rejected_counted_and_changes_nothing() {
    let mut filter = filter();
    second(&mut filter);
    filter.close_interval();
    let before = (filter.navigation.velocity_m_s, filter.sigma(VELOCITY));
    let height_m = filter.navigation.height_m + 1000.0;
    // 1000 m, of a sigma of 5 m for the position and of 1 m for the reading: 196 sigmas.
    let outcome = filter.measure(&Measurement::Height { height_m, sigma_m: 1.0 });
    assert!(matches!(outcome, Ok(Outcome::Rejected { sigmas }) if (sigmas - 196.0).abs() < 1.0), "{outcome:?}");
    assert_eq!(before, (filter.navigation.velocity_m_s, filter.sigma(VELOCITY)));
    let health = filter.source(Source::Height);
    assert_eq!((health.taken, health.rejected, health.rejected_in_a_row), (0, 1, 1));
    // The mode decides what is taken.
    filter.set_mode(Mode::LogOnly);
    let heading = Measurement::Heading { heading_rad: 1.0, sigma_rad: 0.01 };
    assert_eq!(filter.measure(&heading), Ok(Outcome::Ignored));
    assert_eq!(filter.source(Source::Heading).ignored, 1);
}

#[test]
fn bad_input_is_refused_by_name() {
    let mut filter = filter();
    let good = BlockReading {
        dt_s: 0.01,
        increment: Increment { angle_rad: Vector3::zeros(), velocity_m_s: Vector3::new(0.0, 0.0, 0.098) },
        turn_rad: 0.4,
    };
    let bad = BlockReading { turn_rad: f64::NAN, ..good };
    assert_eq!(filter.advance(&bad), Err(Refusal::NotANumber));
    assert_eq!(filter.advance(&BlockReading { dt_s: 0.0, ..good }), Err(Refusal::Time));
    assert_eq!(filter.bridge(2.0, 0.1, 1.0), Err(Refusal::Gap));
    let reading = Measurement::Height { height_m: f64::NAN, sigma_m: 1.0 };
    assert_eq!(filter.measure(&reading), Err(Refusal::NotANumber));
    assert_eq!(filter.measure(&Measurement::Height { height_m: 20.0, sigma_m: 0.0 }), Err(Refusal::Sigma));
    let mut polar = filter.navigation.clone();
    polar.latitude_rad = 89.5 * RAD_PER_DEG;
    let installation = filter.installation;
    let started = Filter::new(polar, 0.0, BlockErrors::FOG, &StartSigmas::USUAL, installation, Mode::Aided);
    assert!(matches!(started, Err(Refusal::NearPole)));
    // A gap is bridged at the price of what the ship may have done in it.
    filter.advance(&good).unwrap();
    filter.close_interval();
    let before = filter.sigma(ATTITUDE + 2);
    filter.bridge(0.5, 0.1, 1.0).unwrap();
    let added = filter.sigma(ATTITUDE + 2).powi(2) - before * before;
    assert!((added.sqrt() - 0.05).abs() < 1e-3, "{}", added.sqrt());
    assert_eq!(filter.bridged_gaps(), 1);
}
