//! Rows of seconds agree with the full plant and with the hand.

use crate::common::{quiet, rate_deg_h};
use hal_sim::seconds::{Dwell, Row, SecondsGenerator, SiteAndGyro};
use hal_sim::{Scenario, World};

const QUARTERS: [Dwell; 4] = [
    Dwell { index_deg: 0.0, gap_s: 0.0, seconds: 10.0 },
    Dwell { index_deg: 90.0, gap_s: 5.0, seconds: 10.0 },
    Dwell { index_deg: 180.0, gap_s: 5.0, seconds: 10.0 },
    Dwell { index_deg: 270.0, gap_s: 5.0, seconds: 10.0 },
];

fn rows(scenario: &Scenario, seed: u64) -> Vec<Row> {
    SecondsGenerator::new(&SiteAndGyro::from(scenario), seed).rows(&QUARTERS).collect()
}

#[test]
fn dwells_and_gaps_take_their_time() {
    let rows = rows(&quiet(), 1);
    assert_eq!(rows.len(), 40);
    let times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    assert_eq!((times[0], times[9], times[10], times[39]), (1.0, 10.0, 16.0, 55.0));
}

#[test]
fn the_rates_are_those_of_the_full_plant() {
    let mut scenario = quiet();
    scenario.base.pitch_deg = 0.4;
    scenario.base.roll_deg = -0.7;
    scenario.gyro.bias_deg_h = 0.3;
    scenario.gyro.axis_elevation_arcsec = 100.0;
    scenario.gyro.dead_zone_deg_h = 0.1;
    for (row, dwell) in rows(&scenario, 1).chunks(10).zip(QUARTERS) {
        scenario.motor.start_deg = dwell.index_deg;
        let full = rate_deg_h(&World::new(&scenario, 1), 1.0);
        assert!((row[5].fog_arcsec - full).abs() < 1e-5, "{} {full}", row[5].fog_arcsec);
        assert_eq!(row[5].index_deg, dwell.index_deg);
        assert!((row[5].ax_g - 0.4_f64.to_radians().sin()).abs() < 1e-12);
    }
}

#[test]
fn a_creeping_base_is_felt_by_gyro_and_accelerometers() {
    let mut scenario = quiet();
    scenario.site.latitude_deg = 90.0;
    scenario.base.creep_arcsec_s = [2.0, 1.0, 0.0];
    let rows = rows(&scenario, 1);
    // cos θ · dr/dt − sin θ · dp/dt at 0 and 90°.
    assert!((rows[3].fog_arcsec - 1.0).abs() < 0.01);
    assert!((rows[13].fog_arcsec + 2.0).abs() < 0.01);
    assert!(((rows[9].ax_g - rows[0].ax_g) * 206_264.8 - 18.0).abs() < 1e-3);
}

#[test]
fn the_interval_can_be_chosen() {
    let mut generator = SecondsGenerator::new(&SiteAndGyro::from(&quiet()), 1).with_interval_s(0.1);
    let rows: Vec<_> = generator.rows(&QUARTERS[..1]).collect();
    assert_eq!(rows.len(), 100);
    assert!((rows[99].t_s - 10.0).abs() < 1e-9);
    assert!((generator.azimuth_deg() - 40.0).abs() < 1e-9);
}

#[test]
fn sensors_have_their_noise() {
    let mut scenario = quiet();
    scenario.encoder.noise_deg = 0.02;
    scenario.accelerometer.noise_ug_per_sqrt_hz = 22.5;
    let dwell = Dwell { index_deg: 0.0, gap_s: 0.0, seconds: 4000.0 };
    let rows: Vec<_> = SecondsGenerator::new(&SiteAndGyro::from(&scenario), 1).rows(&[dwell]).collect();
    let variance = |value: fn(&Row) -> f64| rows.iter().map(|row| value(row).powi(2)).sum::<f64>() / 4000.0;
    let bound = 5.0 * (2.0_f64 / 4000.0).sqrt();
    // 100 readings of 0.02°; 22.5 µg/√Hz over an equivalent 0.5 Hz.
    assert!((variance(|row| row.index_deg) / 0.002_f64.powi(2) - 1.0).abs() < bound);
    assert!((variance(|row| row.ay_g) / (22.5e-6_f64.powi(2) / 2.0) - 1.0).abs() < bound);
}

#[test]
fn the_same_seed_gives_the_same_rows() {
    let scenario = Scenario::named("vehicle").expect("it is built in");
    assert_eq!(rows(&scenario, 5), rows(&scenario, 5));
    assert_ne!(rows(&scenario, 5), rows(&scenario, 6));
}

/// To and fro in rows of 0.05 s, an axis 60 arcsec off the normal of the spindle: it feels sin(60 arcsec) of 30 °/s, 31.4 °/h, with the sign of the turning;
/// the mean over an even turn of 180° from the north to the south has nothing of the horizontal rate. An uneven drive ends its rows elsewhere.
#[test]
fn an_axis_off_the_normal_feels_the_turning() {
    let mut scenario = quiet();
    scenario.gyro.axis_elevation_arcsec = 60.0;
    scenario.site.azimuth_deg = 0.0;
    let world = SiteAndGyro::from(&scenario);
    let mut generator = SecondsGenerator::new(&world, 1).with_interval_s(0.05);
    let up_deg_h = 15.041067 * scenario.site.latitude_deg.to_radians().sin() * 60.0 / 206_264.8;
    for (to_deg, sign) in [(180.0, 1.0), (0.0, -1.0)] {
        let turned_arcsec: f64 = generator.turn(to_deg, 6.0).iter().map(|row| row.fog_arcsec).sum();
        let expected_deg_h = sign * 30.0 * 3600.0 * 60.0 / 206_264.8 + up_deg_h;
        assert!((turned_arcsec / 6.0 - expected_deg_h).abs() < 1e-2, "{} {expected_deg_h}", turned_arcsec / 6.0);
    }
    let uneven = SiteAndGyro { unevenness_deg: 0.02, ..world.clone() };
    let [even, uneven] = [world, uneven].map(|world| SecondsGenerator::new(&world, 1).turn(180.0, 6.0));
    let off_deg: Vec<f64> = even.iter().zip(&uneven).map(|(even, uneven)| uneven.index_deg - even.index_deg).collect();
    assert!(off_deg.iter().all(|off_deg| off_deg.abs() < 0.1) && off_deg.iter().any(|off_deg| off_deg.abs() > 0.001));
}
