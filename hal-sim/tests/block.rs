//! The block that is carried: what it feels where it stands, and the signs on its way.

use hal_sim::block::{BlockErrors, BlockSample, CarriedBlock, Carry};

const NONE: BlockErrors = BlockErrors {
    arw_deg_sqrt_h: 0.0,
    run_to_run_deg_h: 0.0,
    markov_deg_h: 0.0,
    markov_s: 600.0,
    scale_ppm: 0.0,
    misalignment_arcsec: 0.0,
    accelerometer_m_s2: 0.0,
    vrw_m_s_sqrt_s: 0.0,
};
const CARRY: Carry = Carry {
    latitude_deg: 60.0,
    heading_deg: 90.0,
    turn_deg: 90.0,
    stand_s: 1.0,
    carry_s: 20.0,
    stand_again_s: 1.0,
    set_down_deg: [30.0, 0.0],
};

#[test]
fn a_block_feels_the_earth_and_its_turn() {
    let samples: Vec<BlockSample> = CarriedBlock::new(CARRY, NONE, 1).collect();
    assert_eq!(samples.len(), 2200);
    // Mark east at 60°: y points north, 15.0411 cos 60° = 7.5205 arcsec/s; z up, 13.0260.
    let arcsec = samples[50].angle_rad.map(|rad| rad.to_degrees() * 360_000.0);
    assert!(arcsec[0].abs() < 1e-6 && (arcsec[1] - 7.5205).abs() < 1e-3 && (arcsec[2] - 13.0260).abs() < 1e-3);
    assert!((samples[50].velocity_m_s[2] - 0.0980665).abs() < 1e-9);
    // Turned clockwise to south, nose up by 30°: x feels g/2.
    let last = samples[2199];
    assert!((last.heading_deg - 180.0).abs() < 1e-9 && (last.pitch_deg - 30.0).abs() < 1e-9, "{last:?}");
    assert!((last.velocity_m_s[0] - 0.5 * 0.0980665).abs() < 1e-9 && last.velocity_m_s[1].abs() < 1e-9);
    // What the accelerometers felt on the way adds up to a walk of 20 m that ends at rest: seen level, the sum of the
    // acceleration is nothing. Clockwise is negative about up: the z gyro sums up to nearly −90°.
    let turned: f64 = samples.iter().map(|sample| sample.angle_rad[2].to_degrees()).sum();
    assert!((-95.0..-70.0).contains(&turned), "{turned}");
}

#[test]
fn a_run_draws_its_errors() {
    let errors = BlockErrors { run_to_run_deg_h: 10.0, ..NONE };
    // Variance of 200 draws of three axes: 600 degrees of freedom, relative sigma of the root 2.9 %.
    let squares: f64 = (0..200)
        .map(|seed| {
            let first = |errors| CarriedBlock::new(CARRY, errors, seed).next().unwrap().angle_rad;
            let (with, without) = (first(errors), first(NONE));
            (0..3).map(|axis| ((with[axis] - without[axis]).to_degrees() * 360_000.0).powi(2)).sum::<f64>()
        })
        .sum();
    assert!(((squares / 600.0).sqrt() / 10.0 - 1.0).abs() < 0.1);
}
