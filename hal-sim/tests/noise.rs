//! Random errors of the gyro have the size that their parameters say, within bounds that follow from the number of samples.

use crate::common::{increments, quiet, tick};
use hal_sim::World;
use hal_sim::seconds::{Dwell, SecondsGenerator, SiteAndGyro};

/// 1 s rates of a resting gyro without the Earth, °/h.
fn rates(world: &SiteAndGyro, seed: u64, seconds: f64) -> Vec<f64> {
    let dwell = Dwell { index_deg: 0.0, gap_s: 0.0, seconds };
    SecondsGenerator::new(world, seed).rows(&[dwell]).map(|row| row.fog_arcsec).collect()
}

fn world(change: impl FnOnce(&mut SiteAndGyro)) -> SiteAndGyro {
    let mut world = SiteAndGyro::from(&quiet());
    world.site.latitude_deg = 90.0;
    change(&mut world);
    world
}

/// Sum of squared differences of neighbouring means over `length` samples, and their number (IEEE Std 952, annex C).
fn allan_sum(rates: &[f64], length: usize) -> (f64, f64) {
    let means: Vec<f64> = rates.chunks_exact(length).map(|chunk| chunk.iter().sum::<f64>() / length as f64).collect();
    let sum = means.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]).powi(2)).sum();
    (sum, means.len() as f64 - 1.0)
}

/// Allan deviation over several runs, and the relative standard deviation of this estimate. Neighbouring differences are
/// correlated: for white noise their squares make the variance 3/2 of that of independent ones.
fn allan_deviation(runs: &[Vec<f64>], length: usize) -> (f64, f64) {
    let (sum, count) = runs.iter().map(|run| allan_sum(run, length)).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    ((sum / count).sqrt(), 0.5 * (2.0 * 1.5 / count).sqrt())
}

#[test]
fn angle_random_walk_in_frames_is_white_and_has_its_size() {
    let mut scenario = quiet();
    scenario.site.latitude_deg = 90.0;
    scenario.gyro.arw_deg_per_sqrt_h = 0.0015;
    let world = World::new(&scenario, 3);
    tick(&world);
    let noise = increments(&world, 40_000);
    let count = noise.len() as f64;
    let variance = noise.iter().map(|x| x * x).sum::<f64>() / count;
    // 0.0015 °/√h = 0.0015 · 3600 / 60 arcsec/√s = 0.09; in 2.5 ms 0.0045 arcsec.
    let ratio = variance / 0.0045_f64.powi(2);
    assert!((ratio - 1.0).abs() < 5.0 * (2.0 / count).sqrt(), "{ratio}");
    for lag in [1, 2, 8, 400] {
        let covariance = noise.iter().zip(&noise[lag..]).map(|(a, b)| a * b).sum::<f64>() / count;
        assert!((covariance / variance).abs() < 5.0 / count.sqrt(), "lag {lag}: {}", covariance / variance);
    }
}

#[test]
fn angle_random_walk_in_seconds_has_the_same_size() {
    let world = world(|world| world.gyro.arw_deg_per_sqrt_h = 0.0015);
    let runs = [rates(&world, 1, 20_000.0)];
    for length in [1, 10, 100] {
        let (found, scatter) = allan_deviation(&runs, length);
        let ratio = found / (0.09 / (length as f64).sqrt());
        assert!((ratio - 1.0).abs() < 4.0 * scatter, "{length} s: {ratio} ± {scatter}");
    }
}

#[test]
fn bias_instability_is_level_at_0_664_b() {
    let world = world(|world| world.gyro.bias_instability_deg_h = 1.0);
    let runs: Vec<_> = (0..40).map(|seed| rates(&world, seed, 6000.0)).collect();
    for length in [4, 16, 64, 256] {
        let (found, scatter) = allan_deviation(&runs, length);
        let ratio = found / 0.664;
        // The sum of processes a factor of 4 apart is level within 5 %.
        assert!((ratio - 1.0).abs() < 0.05 + 4.0 * scatter, "{length} s: {ratio} ± {scatter}");
    }
}

#[test]
fn bias_instability_is_the_same_in_frames_and_in_seconds() {
    let mut scenario = quiet();
    scenario.site.latitude_deg = 90.0;
    scenario.gyro.bias_instability_deg_h = 1.0;
    let runs: Vec<_> = (0..40)
        .map(|seed| {
            let world = World::new(&scenario, seed);
            tick(&world);
            increments(&world, 400 * 200).chunks(400).map(|second| second.iter().sum()).collect::<Vec<f64>>()
        })
        .collect();
    for length in [4, 16] {
        let (found, scatter) = allan_deviation(&runs, length);
        let ratio = found / 0.664;
        assert!((ratio - 1.0).abs() < 0.05 + 4.0 * scatter, "{length} s: {ratio} ± {scatter}");
    }
}

#[test]
fn rate_random_walk_spreads_with_the_root_of_time() {
    let world = world(|world| world.gyro.rrw_deg_h_per_sqrt_h = 0.5);
    let runs: Vec<_> = (0..200).map(|seed| rates(&world, seed, 3600.0)).collect();
    for (second, variance) in [(899, 0.0625), (3599, 0.25)] {
        let found = runs.iter().map(|run| run[second] * run[second]).sum::<f64>() / 200.0;
        let ratio = found / variance;
        assert!((ratio - 1.0).abs() < 4.0 * (2.0_f64 / 200.0).sqrt(), "{second} s: {ratio}");
    }
    // Allan variance K² τ / 3 (IEEE Std 952, annex C).
    let (found, scatter) = allan_deviation(&runs, 100);
    let ratio = found / (0.5 * (100.0_f64 / 3600.0 / 3.0).sqrt());
    assert!((ratio - 1.0).abs() < 4.0 * scatter, "{ratio} ± {scatter}");
}

#[test]
fn wind_has_its_size() {
    let mut scenario = quiet();
    scenario.base.wind.pitch_rms_arcsec = 3.0;
    scenario.base.wind.gust_s = 0.5;
    scenario.base.wind.support_hz = 20.0;
    scenario.base.wind.support_damping = 0.7;
    let world = World::new(&scenario, 2);
    let count = 400 * 600;
    let mut sum = 0.0;
    for _ in 0..count {
        tick(&world);
        sum += (world.truth().pitch_deg * 3600.0).powi(2);
    }
    // A stiff support follows the gusts: 600 s are 600 independent samples of a process with 0.5 s. Its own resonance adds
    // less than 5 %.
    let ratio = sum / f64::from(count) / 9.0;
    assert!((ratio - 1.0).abs() < 0.05 + 4.0 * (2.0_f64 / 600.0).sqrt(), "{ratio}");
}
