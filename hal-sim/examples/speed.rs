use embedded_io::Read;
use hal_sim::seconds::{Dwell, SecondsGenerator, SiteAndGyro};
use hal_sim::{Scenario, World};
use std::time::Instant;
fn main() {
    for name in ["calm-bench", "windy-tripod", "creep", "vehicle", "jittery-drive", "kvh-gyro"] {
        let world = World::new(&Scenario::named(name).unwrap(), 1);
        let start = Instant::now();
        let mut buffer = [0; 256];
        let mut sum = 0u64;
        for _ in 0..120_000 {
            for _ in 0..8 {
                world.advance_slot();
            }
            world.sample();
            sum += world.gyro().read(&mut buffer).unwrap() as u64;
        }
        println!("{name}: 300 s in {:?} ({sum} bytes)", start.elapsed());
    }
    let world = SiteAndGyro::from(&Scenario::default());
    let dwells: Vec<_> = (0..8).map(|n| Dwell { index_deg: 90.0 * f64::from(n), gap_s: 5.0, seconds: 30.0 }).collect();
    let start = Instant::now();
    let mut sum = 0.0;
    for seed in 0..2000 {
        sum += SecondsGenerator::new(&world, seed).rows(&dwells).map(|row| row.fog_arcsec).sum::<f64>();
    }
    println!("2000 fixes of 240 s as seconds: {:?} {sum}", start.elapsed());
}
