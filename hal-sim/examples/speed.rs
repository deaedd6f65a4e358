//! How much faster than real time the simulator is: `cargo run --release -p hal-sim --example speed`.

use embedded_io::Read;
use hal_sim::seconds::{Dwell, SecondsGenerator, SiteAndGyro};
use hal_sim::{Scenario, World};
use std::error::Error;
use std::time::Instant;

/// A fix of five minutes: ticks of 2.5 ms.
const TICKS: u32 = 120_000;
const FIXES: u32 = 2000;

fn main() -> Result<(), Box<dyn Error>> {
    for name in ["calm-bench", "windy-tripod", "creep", "vehicle", "kvh-gyro"] {
        let world = World::new(&Scenario::named(name)?, 1);
        let start = Instant::now();
        let mut buffer = [0; 256];
        for _ in 0..TICKS {
            for _ in 0..8 {
                world.advance_slot();
            }
            world.sample();
            world.gyro().read(&mut buffer)?;
        }
        println!("{name}: 300 s frame by frame in {:.0} ms", 1e3 * start.elapsed().as_secs_f64());
    }
    let world = SiteAndGyro::from(&Scenario::default());
    let dwells: Vec<_> = (0..8).map(|n| Dwell { index_deg: 90.0 * f64::from(n), gap_s: 5.0, seconds: 30.0 }).collect();
    let start = Instant::now();
    let rows: usize = (0..FIXES).map(|seed| SecondsGenerator::new(&world, seed.into()).rows(&dwells).count()).sum();
    let each_us = 1e6 * start.elapsed().as_secs_f64() / f64::from(FIXES);
    println!("a fix as rows of seconds: {each_us:.0} µs ({} rows)", rows / FIXES as usize);
    Ok(())
}
