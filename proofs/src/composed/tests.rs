use super::dynamics::Dynamics;
use super::plan::{EARTH_DEG_H, course_of_index};
use super::*;

/// Sum of squares of that many standard normal values at most, but in one of a million cases: mean n, variance 2n.
fn most(count: f64) -> f64 {
    count + 5.0 * (2.0 * count).sqrt() + 10.0
}

/// Squared errors of the check runs in sigmas, and their number.
fn squares(campaign: &Campaign, azimuth_deg: impl Fn(usize) -> f64) -> [f64; 2] {
    let runs = campaign.plan.runs.iter().enumerate();
    runs.filter_map(|(run, plan)| Some((run, plan, campaign.oracle[run]?))).fold(
        [0.0; 2],
        |[sum, count], (run, plan, told)| {
            [sum + (apart_deg(azimuth_deg(run), plan.azimuth_deg) / told.sigma_deg).powi(2), count + 1.0]
        },
    )
}

#[test]
fn a_seed_and_a_number_give_the_campaign() {
    for kind in [Kind::Inside, Kind::Outside, Kind::Empty] {
        let [first, again] = [0, 1].map(|_| Campaign::draw(8, 3, kind));
        assert!(first.rows == again.rows && first.truth() == again.truth());
        assert!(first.rows != Campaign::draw(8, 4, kind).rows);
    }
}

#[test]
fn inside_is_inside_and_what_counts_matters() {
    for number in 0..4 {
        let inside = Campaign::draw(2, number, Kind::Inside);
        assert!(
            !inside.effects.is_empty() && !inside.effects.iter().any(Effect::is_outside),
            "{:?}",
            inside.describe()
        );
        let outside = Campaign::draw(2, number, Kind::Outside);
        assert!(outside.effects.iter().any(Effect::is_outside), "{:?}", outside.describe());
        for campaign in [inside, outside] {
            assert!(campaign.before_deg() >= 3.0 * campaign.oracle_deg());
        }
    }
}

/// With nothing hidden the oracle is least squares with a bias and an amplitude of each run's own: its sigma is that of
/// the plain azimuth.
#[test]
fn nothing_hidden_leaves_noise() {
    let mut sum = [0.0; 2];
    for number in 0..6 {
        let campaign = Campaign::draw(4, number, Kind::Empty);
        assert!(campaign.effects.is_empty());
        let one = squares(&campaign, |run| campaign.plain_deg[run]);
        sum = [sum[0] + one[0], sum[1] + one[1]];
    }
    assert!(sum[0] < most(sum[1]), "{sum:?}");
}

/// Whatever the port, the oracle's errors are those that its sigma says.
#[test]
fn the_oracle_finds_the_truth_on_each_port() {
    let mut seen = [("adds", [0.0; 2]), ("scales", [0.0; 2]), ("turns", [0.0; 2]), ("tilts", [0.0; 2])];
    for number in 0..14 {
        let campaign = Campaign::draw(6, number, Kind::Inside);
        let one = squares(&campaign, |run| campaign.oracle[run].unwrap().azimuth_deg);
        for (_, sum) in
            seen.iter_mut().filter(|(port, _)| campaign.effects.iter().any(|effect| effect.port.name() == *port))
        {
            *sum = [sum[0] + one[0], sum[1] + one[1]];
        }
    }
    for (port, sum) in seen {
        assert!(sum[1] > 0.0 && sum[0] < most(sum[1]), "{port}: {sum:?}");
    }
}

/// Plain azimuth of a level instrument with four positions, without noise, with one effect of this size while the axis
/// points within 10 degrees of `axis_deg`.
fn plain_with(port: Port, weight: f64, axis_deg: f64, azimuth_deg: f64) -> f64 {
    let mut plan = Plan::new(&mut Draw::new(1, 0));
    plan.latitude_deg = 45.0;
    plan.scale_ppm = 0.0;
    plan.runs.truncate(1);
    let run = &mut plan.runs[0];
    let (index_deg, rests, moves) = course_of_index(vec![(0.0, 20), (90.0, 20), (180.0, 20), (270.0, 20)], 30.0);
    (run.azimuth_deg, run.tilt_rad, run.index_deg, run.rests, run.moves) =
        (azimuth_deg, [0.0; 2], index_deg, rests, moves);
    run.courses =
        plan.channels.iter().map(|channel| channel.course(&mut Draw::new(1, 1), run.index_deg.len())).collect();
    let input = Input {
        signal: Signal::AxisAzimuth,
        dynamics: Dynamics::None,
        before: [0.0, 1.0],
        after: [0.0, 1.0],
        states: Vec::new(),
    };
    let shape = Shape::Sector { at_deg: axis_deg, half_width_deg: 10.0 };
    let factors = vec![Factor { input, other: None, shape }];
    let effect = Effect { port, factors, process: None, drift: Drift::None, weight, unit: 1.0 };
    let spreads = record::spreads(&plan);
    let rows = record::rows(&plan, 0, &[effect], &spreads, 0.0);
    apart_deg(plain::azimuth_deg(&plan, 0, &rows), azimuth_deg)
}

/// ψ = atan2(ω90 − ω270, ω0 − ω180), h = Ω cos 45°. The mark points north: the axis points east at an index of 270°,
/// where 1 °/h more turns the azimuth by −1/(2h) rad.
#[test]
fn by_hand_a_rate_in_the_east() {
    let h = EARTH_DEG_H * 45.0_f64.to_radians().cos();
    let expected_deg = (-1.0 / (2.0 * h)).atan().to_degrees();
    assert!((plain_with(Port::Adds, 1.0, 90.0, 0.0) - expected_deg).abs() < 1e-9);
}

/// The mark points to 45°, the axis at an index of 0 too, where the rate h/√2 is 1 + s times as great:
/// tan ψ = 2h/√2 / ((2 + s) h/√2).
#[test]
fn by_hand_a_scale_in_the_north_east() {
    let expected_deg = (2.0_f64 / 2.01).atan().to_degrees() - 45.0;
    assert!((plain_with(Port::Scales, 0.01, 45.0, 45.0) - expected_deg).abs() < 1e-9);
}

/// The axis points east at 270° where the encoder reads 0.1° too large: the axis stands at 269.9° and the rate is
/// h cos(0 − 269.9°) = −h sin 0.1°, where 0 is expected: ψ = atan2(h sin 0.1°, 2h).
#[test]
fn by_hand_an_encoder_in_the_east() {
    let expected_deg = (0.5 * 0.1_f64.to_radians().sin()).atan().to_degrees();
    assert!((plain_with(Port::Turns, 0.1, 90.0, 0.0) - expected_deg).abs() < 1e-9);
}

/// The mark points east. At an index of 0 the forward level reads nose up by 0.1° where it is level; Ω sin 45° · 0.1°
/// too much is taken out of ω0: tan ψ = 2h / (−Ω sin 45° · e) with h = Ω sin 45°.
#[test]
fn by_hand_a_level_in_the_east() {
    let expected_deg = (0.5 * 0.1_f64.to_radians()).atan().to_degrees();
    assert!((plain_with(Port::Tilts { forward: true }, 0.1, 90.0, 90.0) - expected_deg).abs() < 1e-9);
}

/// Means of products over many runs. The variance of a product of two values of variance 1 is at most the kurtosis less
/// the squared covariance: 3 of Gaussian values; of pulses with normal heights 3 + 3/(λτ) (Campbell), here 7.5.
#[test]
fn processes_have_the_covariance_that_the_oracle_uses() {
    let processes = [
        Process::Telegraph { mean_s: 40.0 },
        Process::Flicker,
        Process::Bursts { between_s: 30.0, tau_s: 20.0 },
        Process::RandomWalk,
        Process::Ringing { period_s: 60.0, tau_s: 100.0 },
    ];
    let (runs, seconds) = (4000, 100);
    for process in processes {
        let courses: Vec<Vec<f64>> = (0..runs).map(|run| process.course(&mut Draw::new(3, run), seconds)).collect();
        for (first, other) in [(20, 20), (20, 60), (80, 90)] {
            let mean = courses.iter().map(|course| course[first] * course[other]).sum::<f64>() / runs as f64;
            let expected = process.covariance(first as f64 + 1.0, other as f64 + 1.0, seconds as f64);
            let kurtosis = if matches!(process, Process::Bursts { .. }) { 7.5 } else { 3.0 };
            let bound = 5.0 * f64::sqrt(kurtosis / runs as f64);
            assert!((mean - expected).abs() < bound, "{process:?} {first} {other}: {mean} {expected}");
        }
    }
}
