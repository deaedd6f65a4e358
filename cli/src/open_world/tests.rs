use nalgebra::{DMatrix, DVector};
use north_finder::fix::DesignRow;
use north_finder::level::Specific;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::dynamics::{delay, first_rate, friction, low_pass, peak, play, relay, smoothed};
use super::evidence::posterior;
use super::heading::share_of_sector;
use super::learn::Search;
use super::process::{Shape, kernels};
use super::rhythm::{Rhythm, possible_phases};
use super::*;

const NORTH_DEG_H: f64 = 12.0;
const NOISE_DEG_H: f64 = 0.1;
const DWELL_S: usize = 40;

/// A normal number (sum of twelve uniform ones).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// Runs at four positions with two channels that wander; `effect` of their values adds to the rate. With the true azimuths.
fn runs(number: usize, seed: u64, effect: impl Fn(&[Vec<f64>]) -> Vec<f64>) -> Vec<(Recording, f64)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut all = Vec::new();
    for _ in 0..number {
        let azimuth_rad = random.random::<f64>() * std::f64::consts::TAU;
        let length = 4 * DWELL_S;
        let channels: Vec<Vec<f64>> = (0..2)
            .map(|_| {
                let (amplitude, phase) = (1.0 + random.random::<f64>(), 6.3 * random.random::<f64>());
                let cycles = 1.0 + 2.0 * random.random::<f64>();
                let offset = random.random::<f64>() - 0.5;
                (0..length)
                    .map(|i| offset + amplitude * (phase + cycles * 6.3 * i as f64 / length as f64).sin())
                    .collect()
            })
            .collect();
        let effects = effect(&channels);
        let bias = normal(&mut random);
        let mut recording = Recording { north_deg_h: NORTH_DEG_H, channels, ..Recording::default() };
        for (i, effect) in effects.iter().enumerate() {
            let (sin, cos) = ((i / DWELL_S) as f64 * 0.25 * std::f64::consts::TAU).sin_cos();
            let rate = NORTH_DEG_H * (azimuth_rad.cos() * cos + azimuth_rad.sin() * sin);
            recording.t_s.push(i as f64 + 0.5);
            recording.interval_s.push(1.0);
            recording.dwell.push(i / DWELL_S);
            recording.moving.push(false);
            recording.enters.push(true);
            recording.design.push(DesignRow { cos, sin, vertical_deg_h: 0.0 });
            recording.rate_deg_h.push(rate + bias + effect + NOISE_DEG_H * normal(&mut random));
        }
        recording.reference = Some(Reference { azimuth_rad, sigma_rad: 1e-4 });
        all.push((recording, azimuth_rad));
    }
    all
}

/// A number between 0 and 1 of the run's own.
fn of_run(channels: &[Vec<f64>]) -> f64 {
    (1e4 * channels[0][0]).rem_euclid(1.0)
}

/// Root mean square azimuth error of the last six runs, and the sum of squares of errors over sigmas.
fn judged(all: &[(Recording, f64)], learned: &Learned) -> (f64, f64) {
    let check: Vec<&Recording> = all[all.len() - 6..].iter().map(|each| &each.0).collect();
    let (mut squares, mut normalised) = (0.0, 0.0);
    for (found, (_, truth)) in learned.azimuths(&check).into_iter().zip(&all[all.len() - 6..]) {
        let found = found.unwrap();
        let error = least_squares::wrap(found.azimuth_rad - truth);
        squares += error * error / 6.0;
        normalised += (error / found.sigma_rad).powi(2);
    }
    (squares.sqrt(), normalised)
}

/// The last six runs come out nearly as well as white noise allows, and inside their sigmas: χ² of six is above 22.5 once in a thousand times.
fn covers(all: &[(Recording, f64)], learned: &Learned) {
    let (rms_rad, normalised) = judged(all, learned);
    assert!(rms_rad < 2.0 * white_rad(), "{rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

fn training(all: &[(Recording, f64)]) -> Vec<&Recording> {
    all[..all.len() - 6].iter().map(|each| &each.0).collect()
}

/// Standard deviation of an azimuth by white noise: σ √(2/T) / h for positions equally spaced.
fn white_rad() -> f64 {
    NOISE_DEG_H * (2.0 / (4 * DWELL_S) as f64).sqrt() / NORTH_DEG_H
}

/// Half width 1 about the input 0, 2, 3, 1, 0, −2: pushed to 1 and 2, held, held at 0's upper end 1, pushed to −1.
#[test]
fn play_follows_where_it_is_pushed() {
    assert_eq!(play(&[0.0, 2.0, 3.0, 1.0, 0.0, -2.0], 1.0), [0.0, 1.0, 2.0, 2.0, 1.0, -1.0]);
}

/// A step of 1 after the first second, τ = 1/ln 2: half of what is missing every second.
#[test]
fn a_low_pass_halves_what_is_missing() {
    let found = low_pass(&[0.0, 1.0, 1.0], &[1.0; 3], 1.0 / std::f64::consts::LN_2);
    for (found, expected) in found.iter().zip([0.0, 0.5, 0.75]) {
        assert!((found - expected).abs() < 1e-12);
    }
}

/// Of three values v = (1, −2, 1) is the one second difference: (1 + v vᵀ)⁻¹ x = x − v (vᵀ x) / (1 + 6), which of (0, 1, 0) leaves
/// 2/7, 3/7, 2/7. A straight line has none, and stays.
#[test]
fn what_is_smooth_stays() {
    for (found, expected) in smoothed(&[0.0, 1.0, 0.0], 1.0).iter().zip([2.0, 3.0, 2.0]) {
        assert!((found - expected / 7.0).abs() < 1e-12, "{found}");
    }
    let line: Vec<f64> = (0..40).map(|i| 3.0 - 0.5 * f64::from(i)).collect();
    for (found, expected) in smoothed(&line, 20.0).iter().zip(&line) {
        assert!((found - expected).abs() < 1e-8, "{found} {expected}");
    }
}

/// Surveyed at 10°, 50°, 130° and 300°, of which 50° alone lies between 40° and 110°: the border may be anywhere from 50° to 130°, so
/// that 90° is inside with a probability of a half, 110° with a quarter, and on the other side 20° with a quarter.
#[test]
fn borders_of_a_sector_lie_between_surveyed_headings() {
    let surveyed_deg = [130.0, 10.0, 300.0, 50.0];
    for (heading_deg, expected) in
        [(50.0, 1.0), (90.0, 0.5), (110.0, 0.25), (20.0, 0.25), (130.0, 0.0), (200.0, 0.0), (-20.0, 0.0)]
    {
        let found = share_of_sector(&surveyed_deg, [40.0, 70.0], heading_deg);
        assert!((found - expected).abs() < 1e-12, "{heading_deg}: {found}");
    }
}

/// By 2 a second for the first four seconds, whatever comes then.
#[test]
fn the_first_rate_is_the_slope_of_the_beginning() {
    assert!((first_rate(&[1.0, 3.0, 5.0, 7.0, 0.0, 0.0], &[1.0; 6]) - 2.0).abs() < 1e-12);
    assert_eq!(first_rate(&[1.0], &[1.0]), 0.0);
}

/// On above 1, off below −1, in between what it was.
#[test]
fn a_relay_remembers() {
    let input = [0.0, 2.0, 0.5, -2.0, 0.5];
    assert_eq!(relay(&input, [-1.0, 1.0], 0.0), [0.0, 1.0, 1.0, 0.0, 0.0]);
    assert_eq!(relay(&input, [-1.0, 1.0], 1.0), [1.0, 1.0, 1.0, 0.0, 0.0]);
}

/// Two seconds ago, before the beginning the first value. A greatest value of 2 half of which leaks in a second.
#[test]
fn what_was_is_kept() {
    assert_eq!(delay(&[1.0, 2.0, 3.0, 4.0], &[1.0; 4], 2.0), [1.0, 1.0, 1.0, 2.0]);
    let found = peak(&[0.0, 2.0, 0.0], &[1.0; 3], 1.0 / std::f64::consts::LN_2);
    for (found, expected) in found.iter().zip([0.0, 2.0, 1.0]) {
        assert!((found - expected).abs() < 1e-12);
    }
}

/// z' = u' − ln 2 |u'| z without leak: a step of 1 leaves (1 − ½)/ln 2; the way back halves that and takes as much away again.
#[test]
fn friction_slips() {
    let slip = std::f64::consts::LN_2;
    let found = friction(&[0.0, 1.0, 0.0], &[1.0; 3], slip, f64::INFINITY);
    for (found, expected) in found.iter().zip([0.0, 0.5 / slip, 0.25 / slip - 0.5 / slip]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

/// Seconds with these index angles, turning in these of them.
fn turning(angles_deg: &[f64], moving: std::ops::Range<usize>) -> Recording {
    let mut recording = Recording::default();
    for (i, deg) in angles_deg.iter().enumerate() {
        let (sin, cos) = deg.to_radians().sin_cos();
        recording.t_s.push(i as f64 + 0.5);
        recording.interval_s.push(1.0);
        recording.moving.push(moving.contains(&i));
        recording.design.push(DesignRow { cos, sin, vertical_deg_h: 0.0 });
    }
    recording
}

/// From 270° back to 0° with the seconds of turning recorded: 270° clockwise, not 90° on.
#[test]
fn the_way_of_a_move_is_the_one_that_was_turned() {
    let (places, moves) = turning(&[270.0, 180.0, 90.0, 0.0], 1..3).places();
    assert_eq!(moves.len(), 1);
    assert!((moves[0].travel_deg + 270.0).abs() < 1e-9 && moves[0].ended_s == 3.0 && moves[0].number == 1.0);
    assert!((places[3].since_s - 0.5).abs() < 1e-12);
}

/// At 15° and 45° in the middle of the first two seconds it turned from 0°; it rests at 60° from the end of the second on. Seconds that
/// are called moving at rest are no move.
#[test]
fn a_run_may_begin_with_a_move() {
    let (places, moves) = turning(&[15.0, 45.0, 60.0, 60.0], 0..2).places();
    assert_eq!(moves.len(), 1);
    assert!((moves[0].travel_deg - 60.0).abs() < 1e-9 && moves[0].ended_s == 2.0);
    assert!(places[3].moves == 1.0 && (places[3].since_s - 1.5).abs() < 1e-12);
    assert!(turning(&[60.0; 4], 0..2).places().1.is_empty());
}

/// Covariances of means over spans against sums of the correlation over a fine grid; the midpoint rule errs by about a
/// twelfth of step² times the curvature, at the exponential's cusp by a sixth of step/τ of the diagonal: 2e-3 here.
#[test]
fn covariances_of_spans_are_double_means() {
    type Correlation = fn(f64, f64) -> f64;
    let correlation: [(Shape, Correlation); 4] = [
        (Shape::Exponential, |d, t| (-d / t).exp()),
        (Shape::Matern, |d, t| (1.0 + 3f64.sqrt() * d / t) * (-(3f64.sqrt()) * d / t).exp()),
        (Shape::SquaredExponential, |d, t| (-0.5 * (d / t).powi(2)).exp()),
        (Shape::DampedCosine, |d, t| (std::f64::consts::TAU * d / t).cos() * (-d / (6.0 * t)).exp()),
    ];
    let spans = [[0.0, 3.0], [3.0, 10.0], [15.0, 40.0]];
    let fine = |[from, to]: [f64; 2]| (0..200).map(move |i| from + (to - from) * (f64::from(i) + 0.5) / 200.0);
    for (shape, correlation) in correlation {
        let found = shape.covariance(12.0, &spans);
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 =
                    fine(spans[i]).flat_map(|a| fine(spans[j]).map(move |b| correlation((a - b).abs(), 12.0))).sum();
                assert!((found[(i, j)] - sum / 40_000.0).abs() < 2e-3, "{shape:?} {i} {j}");
            }
        }
    }
}

/// The log evidence by sums over runs against the dense normal density of all samples, azimuth and bias integrated out:
/// −½ (ln det V + ln det AᵀV⁻¹A + yᵀ(V⁻¹ − V⁻¹A(AᵀV⁻¹A)⁻¹AᵀV⁻¹) y) with V = white + process + ΦSΦᵀ, A and y with a row more: the
/// horizontal rate along the azimuth is 12 °/h to 0.2 %.
#[test]
fn the_evidence_is_that_of_the_dense_density() {
    let all = runs(1, 5, |channels| play(&channels[0], 0.5));
    let mut recording = all[0].0.clone();
    recording.reference = None;
    let search = Search::new(&[&recording], 2).unwrap();
    let run = &search.runs[0];
    let kernel = kernels().iter().position(|each| each.shape == Some(Shape::Matern) && each.size > 1.0).unwrap();
    let active: learn::Active = vec![(1, 0.02), (9, 0.3)];
    let (gram, right, constant) = search.of_run(0, &active, kernel);
    let found = constant + posterior(&gram, &right, &search.prior(&active)).gain;

    let columns = search.active_columns(0, &active);
    let prior = DMatrix::from_diagonal(&DVector::from_vec(search.prior(&active)));
    let size = search.kernels[kernel].size * search.unit_deg_h;
    let process =
        search.kernels[kernel].shape.unwrap().covariance(search.kernels[kernel].time_s, &run.sheet.samples.spans);
    let dense = run.whitening.white() + process * (size * size) + &columns * prior * columns.transpose();
    let factor = dense.clone().cholesky().unwrap();
    let log_determinant = 2.0 * factor.l().diagonal().iter().map(|value| value.ln()).sum::<f64>();
    let (sin, cos) = run.azimuth_rad.sin_cos();
    let along = DVector::from_vec(vec![cos, sin, 0.0]) / (0.002 * NORTH_DEG_H);
    let normal = run.design.transpose() * factor.solve(&run.design) + &along * along.transpose();
    let toward = run.design.transpose() * factor.solve(&run.rate) + &along * 500.0;
    let explained = toward.dot(&normal.clone().lu().solve(&toward).unwrap());
    let square = run.rate.dot(&factor.solve(&run.rate)) + 500.0 * 500.0 - explained;
    let expected = -0.5 * (log_determinant + normal.determinant().ln() + square);
    assert!((found - expected).abs() < 1e-6 * expected.abs(), "{found} {expected}");
}

#[test]
fn nothing_is_taken_where_nothing_is() {
    for seed in 0..3 {
        let all = runs(14, seed, |channels| vec![0.0; channels[0].len()]);
        let learned = learn(&training(&all)).unwrap();
        assert!(learned.models[0].groups.is_empty(), "seed {seed}: {:?}", learned.models[0].groups);
    }
}

/// Six errors over their sigmas: a chi-square of 6, above 22.5 once in a thousand. The learned effect may cost as much as the
/// noise itself and half of it again (eight runs for what is at most some ten numbers).
fn finds(effect: impl Fn(&[Vec<f64>]) -> Vec<f64>, name: &str) {
    let all = runs(18, 11, effect);
    let learned = learn(&training(&all)).unwrap();
    let names: Vec<String> = learned.models[0].groups.iter().map(|found| found.group.name()).collect();
    let (rms_rad, normalised) = judged(&all, &learned);
    assert!(names.iter().any(|found| found == name), "{names:?}");
    assert!(rms_rad < 2.0 * white_rad(), "{names:?}: {rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

#[test]
fn a_hysteresis_is_found_and_covered() {
    finds(|channels| play(&channels[0], 0.6).iter().map(|value| 0.3 * value).collect(), "hysteresis");
}

/// A coil on the body whose current is known but for what it idles at: 0.3 °/h along 90° of the index, which is 0.3/12 = 0.025 rad of
/// azimuth at some headings, and no heading is surveyed. Where the mark points makes the horizontal rate larger or smaller by as much:
/// twelve runs know the idle part to 0.002 · √(2/12) of 12 °/h, which is 0.0008 rad, beside 0.0009 rad of white noise. Once in a thousand six
/// errors are √(22.5/6) = 1.9 times as large.
#[test]
fn amplitudes_show_what_is_fixed_to_the_instrument() {
    let coil = |channels: &[Vec<f64>]| {
        let of = |(i, current): (usize, &f64)| {
            0.3 * (1.0 + current) * (i / DWELL_S % 2) as f64 * (2.0 - (i / DWELL_S) as f64)
        };
        channels[0].iter().enumerate().map(of).collect::<Vec<_>>()
    };
    let mut all = runs(18, 51, coil);
    all.iter_mut().for_each(|(recording, _)| recording.reference = None);
    let learned = learn(&training(&all)).unwrap();
    let (rms_rad, normalised) = judged(&all, &learned);
    assert!(rms_rad < 1.9 * white_rad().hypot(0.0008), "{rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

/// Student's t of 3 degrees of freedom at 97.5 % is 3.1824; of many it is the normal 1.96.
#[test]
fn few_misses_widen_sigma_as_students_t() {
    assert!((studentised(3) - 3.1824 / 1.96).abs() < 1e-3);
    assert!((studentised(100_000) - 1.0).abs() < 1e-4);
}

/// A switch that is on for a third of a minute at another phase in every run, behind 12 s: it is one atom.
#[test]
fn a_heater_of_each_runs_own_is_taken_out() {
    let heater = |channels: &[Vec<f64>]| {
        let phase_s = 60.0 * of_run(channels);
        let mut heat = 0.3;
        let of = |i: usize| {
            let on = f64::from(u8::from((i as f64 + phase_s).rem_euclid(60.0) < 20.0));
            heat += (on - heat) / 12.0;
            heat
        };
        (0..channels[0].len()).map(of).collect::<Vec<_>>()
    };
    let all = runs(12, 41, heater);
    let learned = learn(&training(&all)).unwrap();
    let (rms_rad, normalised) = judged(&all, &learned);
    assert!(rms_rad < 2.5 * white_rad(), "{rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

/// A step at another second of every run, by 0.5 or more, that no channel shows: the runs know it by themselves.
#[test]
fn a_step_of_each_runs_own_is_taken_out() {
    let step = |channels: &[Vec<f64>]| {
        let random = of_run(channels);
        let at = DWELL_S / 4 + (random * 3.5 * DWELL_S as f64) as usize;
        (0..channels[0].len()).map(|i| if i >= at { 0.5 + random } else { 0.0 }).collect::<Vec<_>>()
    };
    let all = runs(14, 31, step);
    let learned = learn(&training(&all)).unwrap();
    assert!(learned.models[0].groups.is_empty(), "{:?}", learned.models[0].groups);
    let (rms_rad, normalised) = judged(&all, &learned);
    // A step is one more unknown; where it stands near the middle of four dwells it is nearly another azimuth.
    assert!(rms_rad < 3.0 * white_rad(), "{rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

/// Between two levels 0.6 apart, about 25 s at each, at times of each run's own: the levels' difference is learned, and azimuths are
/// nearly those without it.
#[test]
fn two_levels_are_taken_out() {
    let telegraph = |channels: &[Vec<f64>]| {
        let mut random = ChaCha8Rng::seed_from_u64((1e9 * of_run(channels)) as u64);
        let mut upper = random.random::<f64>() < 0.5;
        let of = |_| {
            upper ^= random.random::<f64>() < 1.0 / 25.0;
            if upper { 0.6 } else { 0.0 }
        };
        (0..channels[0].len()).map(of).collect::<Vec<_>>()
    };
    let all = runs(14, 61, telegraph);
    let learned = learn(&training(&all)).unwrap();
    let found = learned.switching().unwrap();
    assert!((found.step_deg_h - 0.6).abs() < 0.05, "{found:?}");
    let (rms_rad, normalised) = judged(&all, &learned);
    assert!(rms_rad < 3.0 * white_rad(), "{rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

/// Eight relays of widths from 0.2 to 1.6, all off at the beginning.
#[test]
fn many_relays_are_found_and_covered() {
    let relays = |channels: &[Vec<f64>]| {
        let mut sum = vec![0.0; channels[0].len()];
        for number in 0..8 {
            let (at, half) = (0.35 * f64::from(number) - 1.2, 0.1 * f64::from(1 + number));
            for (sum, state) in sum.iter_mut().zip(relay(&channels[0], [at - half, at + half], 0.0)) {
                *sum += 0.1 * state;
            }
        }
        sum
    };
    finds(relays, "hysteresis");
}

/// The rate of change behind 50 s, which at the beginning is the rate that the channel has then.
#[test]
fn memory_of_a_rate_begins_with_the_first_rate() {
    let memory = |channels: &[Vec<f64>]| {
        let rates: Vec<f64> = channels[0].windows(2).map(|pair| pair[1] - pair[0]).collect();
        let all = [&rates[..1], &rates].concat();
        low_pass(&all, &vec![1.0; all.len()], 50.0).iter().map(|rate| 12.0 * rate).collect::<Vec<_>>()
    };
    finds(memory, "memory-of-rate");
}

/// A decay after every move, slower where the first channel is greater when the move ends.
#[test]
fn a_decay_time_that_follows_a_channel_is_found_and_covered() {
    let decays = |channels: &[Vec<f64>]| {
        let of = |i: usize| {
            let past = (1..=i / DWELL_S).map(|dwell| {
                let time_s = 10.0 * (0.5 * channels[0][dwell * DWELL_S]).exp();
                (-((i - dwell * DWELL_S) as f64 + 0.5) / time_s).exp()
            });
            past.sum::<f64>()
        };
        (0..channels[0].len()).map(of).collect::<Vec<_>>()
    };
    finds(decays, "settling-by-channel");
}

/// Eighteen runs, each on a mount that is tilted its own way by so many g, with what an effect of the tilt adds to every rate.
fn on_tilted_mounts(
    seed: u64,
    tilted_g: fn(usize) -> f64,
    effect: impl Fn(Specific, &DesignRow) -> f64,
) -> Vec<(Recording, f64)> {
    let mut all = runs(18, seed, |channels| vec![0.0; channels[0].len()]);
    for (number, (recording, _)) in all.iter_mut().enumerate() {
        let (left, forward) = (2.4 * number as f64).sin_cos();
        let tilt = Specific { forward: tilted_g(number) * forward, left: tilted_g(number) * left };
        for (rate_deg_h, row) in recording.rate_deg_h.iter_mut().zip(&recording.design) {
            *rate_deg_h += effect(tilt, row);
        }
        recording.tilt_g = Some(vec![tilt; recording.len()]);
    }
    all
}

/// A gyro that feels 2 °/h for each g across its axis, on mounts that are tilted by up to 0.1 g each their own way: in one run that is
/// another azimuth, by up to a degree.
#[test]
fn gravity_across_the_axis_is_found_and_covered() {
    let across = |tilt: Specific, row: &DesignRow| 2.0 * (tilt.left * row.cos - tilt.forward * row.sin);
    let all = on_tilted_mounts(61, |_| 0.1, across);
    let learned = learn(&training(&all)).unwrap();
    let names: Vec<String> = learned.models[0].groups.iter().map(|found| found.group.name()).collect();
    assert_eq!(names, ["gravity-sensitivity"]);
    covers(&all, &learned);
}

/// The index feels 0.5 °/h along 30° of its angle while the mark points into a quarter of the headings: up to 2.4° of azimuth, and up to
/// 4 % of the horizontal rate, by which a run between two surveyed headings knows whether it is inside. By the share of the gap alone errors
/// would be of the order of a degree.
#[test]
fn the_horizontal_rate_tells_whether_a_run_is_in_a_sector() {
    let mut all = runs(26, 77, |channels| vec![0.0; channels[0].len()]);
    for (recording, azimuth_rad) in &mut all {
        let inside = (azimuth_rad.to_degrees() - 90.0).rem_euclid(360.0) < 90.0;
        for (rate_deg_h, row) in recording.rate_deg_h.iter_mut().zip(&recording.design).filter(|_| inside) {
            *rate_deg_h += 0.5 * (row.cos * 30f64.to_radians().cos() + row.sin * 30f64.to_radians().sin());
        }
    }
    let learned = learn(&training(&all)).unwrap();
    assert_eq!(learned.models[0].groups[0].group.name(), "harmonic-in-sector");
    covers(&all, &learned);
}

/// A gyro that feels 40 °/h for each g² along its axis, beside 1 °/h for each g: runs on mounts that are tilted by up to 0.12 g each their
/// own way; some of the last are tilted by more than those that it was learned from.
#[test]
fn gravity_squared_is_found_and_goes_on_beyond_the_learned_range() {
    let along = |tilt: Specific, row: &DesignRow| tilt.forward * row.cos + tilt.left * row.sin;
    let of_gravity = |tilt: Specific, row: &DesignRow| along(tilt, row) + 40.0 * along(tilt, row).powi(2);
    let all = on_tilted_mounts(62, |number| if number < 12 { 0.08 } else { 0.12 }, of_gravity);
    let learned = learn(&training(&all)).unwrap();
    let names: Vec<String> = learned.models[0].groups.iter().map(|found| found.group.name()).collect();
    assert_eq!(names, ["gravity-sensitivity"]);
    covers(&all, &learned);
}

/// 0.2 °/h by the fifth harmonic of the axis's azimuth, which four positions do not tell from another azimuth (by up to 0.2/12 rad) and another
/// amplitude: six surveyed runs show it, for no harmonic but one makes all of these.
#[test]
fn a_harmonic_of_the_axis_azimuth_shows_in_few_runs() {
    let mut all = runs(12, 83, |channels| vec![0.0; channels[0].len()]);
    for (recording, azimuth_rad) in &mut all {
        for (rate_deg_h, row) in recording.rate_deg_h.iter_mut().zip(&recording.design) {
            *rate_deg_h += 0.2 * (5.0 * (*azimuth_rad - row.sin.atan2(row.cos)) + 1.0).cos();
        }
    }
    let learned = learn(&training(&all)).unwrap();
    assert_eq!(learned.models[0].groups[0].group, Group::AxisHarmonic(5));
    covers(&all, &learned);
}

#[test]
fn a_surface_is_found_and_covered() {
    let surface = |channels: &[Vec<f64>]| {
        channels[0].iter().zip(&channels[1]).map(|(a, b)| 0.2 * (1.2 * a).sin() * b).collect::<Vec<_>>()
    };
    finds(surface, "function-of-two-channels");
}

/// A covariance that is none must not be tried for ever; nor has a run without noise a variance of its own stretches.
#[test]
fn what_has_no_covariance_tells_nothing() {
    let (half, log_determinant) = evidence::half_of(&DMatrix::from_element(3, 3, f64::NAN));
    assert!(half.iter().all(|value| *value == 0.0) && log_determinant == f64::INFINITY);
    let found = evidence::half_of(&DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 5.0]));
    // L = [2 0; 1 2], its inverse [½ 0; −¼ ½], the determinant 16.
    assert!((found.0 - DMatrix::from_row_slice(2, 2, &[0.5, 0.0, -0.25, 0.5])).norm() < 1e-15);
    assert!((found.1 - 16f64.ln()).abs() < 1e-15);
}

/// An effect of the first channel, and a model that says the same of the second. Runs in which each goes its own way are expected to
/// tell them apart; runs in which the channels are twins are not.
#[test]
fn runs_that_are_expected_to_separate_twins_have_them_apart() {
    let effect = |channels: &[Vec<f64>]| channels[0].iter().map(|value| 0.1 * value).collect::<Vec<f64>>();
    let apart = runs(8, 22, effect);
    let mut twins = runs(4, 21, effect);
    twins.iter_mut().for_each(|(recording, _)| recording.channels[1] = recording.channels[0].clone());
    let mut learned = learn(&apart.iter().map(|each| &each.0).collect::<Vec<_>>()).unwrap();
    learned.scales.channels[1] = learned.scales.channels[0];
    let mut twin = learned.models[0].clone();
    for found in &mut twin.groups {
        found.group = match &found.group {
            Group::Linear(0) => Group::Linear(1),
            Group::Quadratic(0) => Group::Quadratic(1),
            Group::Smoothed(0) => Group::Smoothed(1),
            Group::Base(Base::Value(0)) => Group::Base(Base::Value(1)),
            other => panic!("{other:?}"),
        };
    }
    learned.models = vec![learned.models[0].clone(), twin];
    let proposed = |all: &[(Recording, f64)]| all.iter().map(|each| each.0.clone()).collect::<Vec<_>>();
    let usual = &twins[0].0;
    let same = learned.expected(&proposed(&twins), usual).unwrap();
    let told = learned.expected(&proposed(&apart[..4]), usual).unwrap();
    assert!(same.log_odds[0][1] < 1e-6, "{:?}", same.log_odds);
    assert!(told.log_odds[0][1] > 9.2 && told.log_odds[1][0] == told.log_odds[0][1], "{:?}", told.log_odds);
    // More runs make it no less certain.
    assert!(told.sigma_rad <= learned.expected(&[], usual).unwrap().sigma_rad);
}

/// Turning the columns of phase 0, or the weights, is the same as building columns at a phase, with a beginning at nothing too. Of a mean that is
/// approached in 10 s the first sample, of at most three seconds, has at most 1 − 10/3 (1 − e^−0.3) = 0.14; after 150 s it is there.
#[test]
fn a_rhythm_at_a_phase_is_one_at_none_turned() {
    let all = runs(1, 5, |channels| vec![0.0; channels[0].len()]);
    let search = Search::new(&[&all[0].0], 2).unwrap();
    let sheet = &search.runs[0].sheet;
    for begins_s in [None, Some(10.0)] {
        let rhythm = Rhythm { period_s: 37.0, smoothness: 1, begins_s, orders: 3 };
        let (at_none, at_phase) = (rhythm.columns(sheet, 0.0), rhythm.columns(sheet, 0.3));
        assert_eq!(at_none.ncols(), if begins_s.is_some() { 7 } else { 6 });
        assert!((rhythm.turn(&at_none, 0.3) - &at_phase).norm() < 1e-9);
        let weights = DVector::from_fn(at_none.ncols(), |i, _| 1.0 + i as f64);
        assert!((&at_none * rhythm.turned(&weights, 0.3) - at_phase * weights).norm() < 1e-9);
        if begins_s.is_some() {
            let mean = at_none.column(6);
            assert!(mean[0] < 0.14 && mean[mean.len() - 1] > 0.99);
        }
    }
}

/// Normal about 0.3 with a deviation of 0.02: so are the phases. Where nothing tells them apart, all are equal.
#[test]
fn possible_phases_have_their_probabilities() {
    let off = |phase: f64| least_squares::wrap(std::f64::consts::TAU * (phase - 0.3)) / std::f64::consts::TAU;
    let found = possible_phases(|phase| -0.5 * (off(phase) / 0.02).powi(2));
    let mean: f64 = found.iter().map(|(weight, phase)| weight * off(*phase)).sum();
    let variance: f64 = found.iter().map(|(weight, phase)| weight * off(*phase).powi(2)).sum();
    assert!(mean.abs() < 1e-3 && (variance.sqrt() / 0.02 - 1.0).abs() < 0.05, "{mean} {variance}");
    assert!((found.iter().map(|each| each.0).sum::<f64>() - 1.0).abs() < 1e-12);
    let flat = possible_phases(|_| 7.0);
    assert!(flat.iter().all(|each| (each.0 - 1.0 / flat.len() as f64).abs() < 1e-12));
}

/// A sawtooth of 55 s and ± 0.4 °/h that begins anywhere: the runs share its period and its form, and one number more of their own.
#[test]
fn a_rhythm_that_runs_share_is_taken_out() {
    let sawtooth = |channels: &[Vec<f64>]| {
        let at = |i: usize| (i as f64 / 55.0 + of_run(channels)).rem_euclid(1.0);
        (0..channels[0].len()).map(|i| 0.8 * at(i) - 0.4).collect::<Vec<_>>()
    };
    let all = runs(16, 61, sawtooth);
    let learned = learn(&training(&all)).unwrap();
    let found = learned.models[0].groups.iter().find_map(|found| match found.group {
        Group::Rhythm(rhythm) => Some(rhythm),
        _ => None,
    });
    assert!(found.is_some_and(|rhythm| (rhythm.period_s - 55.0).abs() < 1.0), "{found:?}");
    let (rms_rad, normalised) = judged(&all, &learned);
    assert!(rms_rad < 2.0 * white_rad(), "{rms_rad} against {}", white_rad());
    assert!(normalised < 22.5, "{normalised}");
}

/// Two sinusoids of 19 and 23 s, each at a phase of the run's own: over 160 s a frequency of a dozen such runs is known to well below a hundredth.
#[test]
fn waves_that_runs_share_are_found() {
    let beats = |channels: &[Vec<f64>]| {
        let (first, second) = (6.3 * of_run(channels), 6.3 * of_run(&channels[1..]));
        let at = |i: usize, period_s: f64| std::f64::consts::TAU * i as f64 / period_s;
        (0..channels[0].len())
            .map(|i| 0.5 * ((at(i, 19.0) + first).sin() + (at(i, 23.0) + second).sin()))
            .collect::<Vec<_>>()
    };
    let all = runs(12, 62, beats);
    let training: Vec<&Recording> = all.iter().map(|each| &each.0).collect();
    let search = Search::new(&training, 2).unwrap();
    let nothing: Vec<DVector<f64>> = search.runs.iter().map(|run| DVector::zeros(run.rate.len())).collect();
    let mut found: Vec<f64> =
        waves::find(&search.runs, &nothing, &search.variances).iter().map(|wave| 1.0 / wave.frequency_hz).collect();
    found.sort_by(f64::total_cmp);
    assert!(found.len() == 2 && (found[0] - 19.0).abs() < 0.1 && (found[1] - 23.0).abs() < 0.1, "{found:?}");
}
