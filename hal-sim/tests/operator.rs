//! The operator's hands, as the accelerometer triad feels them.

use hal_sim::{AccelerometerSpi, Operator, Scenario, World};

/// An operator without errors, a triad without noise and errors.
fn perfect() -> Scenario {
    let mut scenario = Scenario::named("calm-bench").unwrap();
    scenario.base.pitch_deg = 0.0;
    scenario.base.roll_deg = 0.0;
    scenario.accelerometer.noise_ug_per_sqrt_hz = 0.0;
    scenario.accelerometer.bias_mg = [0.0; 3];
    scenario.operator.aim_deg = 0.0;
    scenario
}

/// Lets time pass.
fn wait(world: &World, seconds: f64) {
    for _ in 0..(seconds / 0.0025).round() as u32 {
        (0..8).for_each(|_| world.advance_slot());
        world.sample();
    }
}

/// A measuring triad in its widest sensitivity: ± 2.048 g, 256 000 counts per g.
fn switched_on(world: &World) -> AccelerometerSpi {
    let mut spi = world.accelerometer();
    spi.exchange(&[0x2D << 1, 0x00]);
    spi
}

/// x, y, z in g.
fn read(spi: &mut AccelerometerSpi) -> [f64; 3] {
    let mut command = [0; 10];
    command[0] = 0x08 << 1 | 1;
    let bytes = spi.exchange(&command);
    [1, 4, 7].map(|at| {
        let code = i32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], 0]) >> 12;
        f64::from(code) / 256_000.0
    })
}

fn assert_near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    for (found, expected) in found.into_iter().zip(expected) {
        assert!((found - expected).abs() < tolerance, "{found:?} {expected:?}");
    }
}

#[test]
fn the_direction_that_is_asked_for_points_up() {
    let world = World::new(&perfect(), 1);
    let mut spi = switched_on(&world);
    wait(&world, 0.1);
    assert_near(read(&mut spi), [0.0, 0.0, 1.0], 1e-5);
    let mut operator = Operator::new(&perfect(), 1);
    let half = 0.5_f64.sqrt();
    for (asked, felt) in [
        ([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ([0.0, -3.0, 0.0], [0.0, -1.0, 0.0]),
        // The opposite, by way of any side.
        ([0.0, 1.0, 0.0], [0.0, 1.0, 0.0]),
        ([1.0, 0.0, -1.0], [half, 0.0, -half]),
        ([0.0, 0.0, -1.0], [0.0, 0.0, -1.0]),
    ] {
        operator.turn(&world, asked);
        wait(&world, 3.2);
        assert_near(read(&mut spi), felt, 1e-5);
    }
}

#[test]
fn a_turn_takes_its_time_and_shakes() {
    let world = World::new(&perfect(), 1);
    let mut spi = switched_on(&world);
    Operator::new(&perfect(), 1).turn(&world, [1.0, 0.0, 0.0]);
    wait(&world, 0.5);
    assert_near(read(&mut spi), [0.0, 0.0, 1.0], 1e-5);
    // In its middle, at 0.6 s + 1.25 s: 45°, and norms that differ from 1 g by some of the 0.03 g.
    wait(&world, 1.35);
    let [x, y, z] = read(&mut spi);
    assert_near([x, y, z], [0.707, 0.0, 0.707], 0.06);
    assert!(((x * x + y * y + z * z).sqrt() - 1.0).abs() > 1e-3);
}

#[test]
fn a_shock_comes_after_the_instrument_was_put_down() {
    let mut scenario = perfect();
    scenario.operator.shocks = vec![1];
    let world = World::new(&scenario, 1);
    let mut spi = switched_on(&world);
    Operator::new(&scenario, 1).turn(&world, [0.0, 1.0, 0.0]);
    wait(&world, 4.5);
    assert_near(read(&mut spi), [0.0, 1.0, 0.0], 1e-5);
    wait(&world, 1.0);
    // cos 12° = 0.97815.
    let [_, y, _] = read(&mut spi);
    assert!((y - 0.97815).abs() < 1e-4, "{y}");
}

#[test]
fn errors_of_the_aim_are_as_declared() {
    let mut scenario = perfect();
    scenario.operator.aim_deg = 4.0;
    let world = World::new(&scenario, 1);
    let mut spi = switched_on(&world);
    let mut operator = Operator::new(&scenario, 7);
    let mut squares = 0.0;
    for turn in 0..100 {
        let up = if turn % 2 == 0 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        operator.turn(&world, up);
        wait(&world, 3.2);
        let felt = read(&mut spi);
        let along: f64 = felt.iter().zip(up).map(|(felt, up)| felt * up).sum();
        squares += along.min(1.0).acos().to_degrees().powi(2);
    }
    // Two axes of 4° rms: 5.66°; of 200 numbers known to 5 %.
    let rms = (squares / 100.0_f64).sqrt();
    assert!((rms / 5.66 - 1.0).abs() < 0.2, "{rms}");
}

#[test]
fn skew_turns_x_and_y_but_not_z() {
    let mut scenario = perfect();
    scenario.accelerometer.skew_ppm = [1000.0, 2000.0, 3000.0];
    let world = World::new(&scenario, 1);
    let mut spi = switched_on(&world);
    wait(&world, 0.1);
    assert_near(read(&mut spi), [0.002, 0.003, 1.0], 1e-5);
    Operator::new(&scenario, 1).turn(&world, [0.0, 1.0, 0.0]);
    wait(&world, 3.2);
    assert_near(read(&mut spi), [0.001, 1.0, 0.0], 1e-5);
}
