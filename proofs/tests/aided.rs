//! Small Monte Carlo of the aided filter and of the electrostatic gyro; the large ones are `north bench aiding` and `north bench esg`.

use hal_sim::vessel::electrostatic::{EsgClass, Orientation};
use hal_sim::vessel::ship::{Leg, Modulation, Voyage, Waves};
use hal_sim::vessel::water::WaterClass;
use inertial::filter::measurement::Source;
use inertial::filter::{Mode, StartSigmas};
use proofs::trials::aided::{Aids, Case, Class, antennas, run};
use proofs::trials::dive::{self, Dive};

const SEEDS: u64 = 8;

/// Errors are as large as the filter says, and innovations too.
///
/// 8 runs × 9 states make NEES a chi-square of 72 degrees of freedom over 72: mean 1, standard deviation √(2/72) = 0.167; four of
/// them are allowed either way. The innovations, 7 a second for half an hour in 8 runs, have 1 ± 4·√(2/100800) = 0.018.
#[test]
fn errors_and_innovations_are_as_large_as_the_filter_says() {
    let voyage = Voyage::moored(60.0, 0.5, &[20.0], 3600.0);
    let passage = Voyage { modulation: Modulation::harmonic(180.0), waves: Waves::CALM, ..voyage }.sail();
    let aids = [Aids { heading_s: Some(1), mode: Mode::Aided, ..Aids::SATELLITES }];
    let case = Case {
        passage: &passage,
        class: Class::FOG,
        start: StartSigmas::USUAL,
        aids: &aids,
        water: WaterClass::USUAL,
        antennas: antennas(),
        every_s: 1800,
    };
    let outcomes: Vec<_> = (0..SEEDS).map(|seed| run(&case, seed)).collect();
    let shots = || outcomes.iter().filter_map(|outcome| outcome.snapshots.last());
    assert!(
        shots()
            .all(|shot| shot.heading_error_deg.abs() < 4.0 * shot.heading_sigma_deg && shot.heading_sigma_deg < 0.05)
    );
    let nees = shots().map(|shot| shot.normalised_squared_error).sum::<f64>() / (9.0 * SEEDS as f64);
    assert!((nees - 1.0).abs() < 4.0 * 0.167, "{nees}");
    let sums = Source::ALL.iter().flat_map(|source| outcomes.iter().map(|outcome| outcome.filter.source(*source)));
    let (sum, freedom) = sums.fold((0.0, 0), |(sum, freedom), health| {
        (sum + health.normalised_squared, freedom + health.degrees_of_freedom)
    });
    let nis = sum / f64::from(freedom);
    assert_eq!(freedom, 7 * 1800 * SEEDS as u32);
    assert!((nis - 1.0).abs() < 0.018, "{nis}");
}

/// Half an hour at the surface, an hour below without a fix: the gyro's heading stays inside its sigmas.
#[test]
fn an_electrostatic_gyro_keeps_the_heading_below() {
    let leg = |until_s, heading_deg, depth_m| Leg { until_s, heading_deg, speed_m_s: 3.0, depth_m };
    let voyage = Voyage::moored(50.0, 1.5, &[30.0], 1.0);
    let legs = vec![leg(900.0, 30.0, 0.0), leg(1800.0, 70.0, 0.0), leg(5400.0, 30.0, 60.0)];
    let passage = Voyage { legs, waves: Waves::CALM, ..voyage }.sail();
    let surface = Aids { until_s: 1800.0, heading_s: Some(1), log_s: Some(1), mode: Mode::Aided, ..Aids::SATELLITES };
    let below =
        Aids { satellites_s: None, log_s: Some(1), height_m: Some(0.3), mode: Mode::Submerged, ..Aids::SATELLITES };
    let aids = [surface, below];
    let gyro = EsgClass::TYPICAL;
    for (seed, orientation) in [(1, Orientation::Polar), (2, Orientation::Equatorial)] {
        let case = Case {
            passage: &passage,
            class: Class::FOG,
            start: StartSigmas::USUAL,
            aids: &aids,
            water: WaterClass::USUAL,
            antennas: antennas(),
            every_s: 3600,
        };
        let dive =
            Dive { case, gyro, orientation, hour_angle_deg: 40.0, surface_s: 1800.0, calibrated_deg_h: Some(0.002) };
        let shots = dive::run::<7, 5, 28>(&dive, seed, 600);
        let last = shots.last().unwrap();
        assert!(last.t_s > 5000.0 && last.sigma_deg < 0.3, "{last:?}");
        assert!(shots.iter().all(|shot| shot.error_deg.abs() < 4.0 * shot.sigma_deg), "{shots:?}");
    }
}
