use quantities::units::wrap_180_deg;

use super::*;

/// Increments of 10 ms of a level block that stands at latitude 60° with its mark east: x feels nothing, y points north and
/// feels Ω cos 60° = 7.5205335 °/h, z Ω sin 60° = 13.025946 °/h.
const STILL_ARCSEC: [f64; 3] = [0.0, 0.075205335, 0.13025946];

fn sample(arcsec: [f64; 3], force_m_s2: [f64; 3]) -> Increment {
    Increment {
        angle_rad: Vector3::from(arcsec) * (RAD_PER_DEG / 3600.0),
        velocity_m_s: Vector3::from(force_m_s2) * 0.01,
    }
}

/// Noise that no test of signs minds.
fn quiet() -> NoiseOfRate {
    NoiseOfRate::Declared(1e-5)
}

fn still(seconds: u32, arcsec: [f64; 3]) -> Alignment {
    let mut alignment = Alignment::default();
    for _ in 0..100 * seconds {
        assert!(alignment.push(0.01, sample(arcsec, [0.0, 0.0, 9.8])));
    }
    alignment
}

#[test]
fn a_still_block_finds_its_heading_and_its_latitude() {
    let alignment = still(100, STILL_ARCSEC);
    for latitude_deg in [Some(60.0), None] {
        let aligned = alignment.solve(latitude_deg, &quiet(), Some(0.0)).unwrap();
        let Angles { heading_deg, pitch_deg, roll_deg } = aligned.angles;
        assert!((heading_deg - 90.0).abs() < 1e-4, "{latitude_deg:?} {heading_deg}");
        assert!(pitch_deg.abs() < 1e-4 && roll_deg.abs() < 1e-4, "{latitude_deg:?} {pitch_deg} {roll_deg}");
        assert!((aligned.latitude_deg - 60.0).abs() < 1e-3, "{latitude_deg:?} {}", aligned.latitude_deg);
    }
}

#[test]
fn the_southern_hemisphere_shows_in_the_vertical_rate() {
    let [x, y, z] = STILL_ARCSEC;
    let aligned = still(100, [x, y, -z]).solve(None, &quiet(), Some(0.0)).unwrap();
    assert!((aligned.latitude_deg + 60.0).abs() < 1e-3 && (aligned.angles.heading_deg - 90.0).abs() < 1e-4);
}

#[test]
fn a_latitude_that_the_rates_contradict_is_refused_with_theirs() {
    // Ω sin 60° = +13.026 °/h up, where −60° has −13.026 and 45° has 10.636 (and Ω cos 45° = 10.636 instead of 7.521): of a bias of 0.1 °/h
    // the latitude has a sigma of 0.1/15.041 = 0.381°, and 5 of them and a degree are 2.9°.
    let alignment = still(100, STILL_ARCSEC);
    for given_deg in [-60.0, 45.0, 63.0] {
        for bias_deg_h in [None, Some(0.0), Some(0.1)] {
            let refused = alignment.solve(Some(given_deg), &quiet(), bias_deg_h).unwrap_err();
            let AlignError::OtherLatitude { given_deg: said_deg, found_deg, sigma_deg } = refused else {
                panic!("{refused:?}")
            };
            assert!(said_deg == given_deg && (found_deg - 60.0).abs() < 0.01, "{refused:?}");
            let expected_deg = bias_deg_h.unwrap_or(0.0) / 15.041 * DEG_PER_RAD;
            assert!((sigma_deg - expected_deg).abs() < 0.01, "{refused:?}");
        }
    }
    // Within a degree and five sigmas it stands; so does any with gyros of 10 °/h, of which the rates say nothing.
    assert!(alignment.solve(Some(60.9), &quiet(), Some(0.0)).is_ok());
    assert!(alignment.solve(Some(62.8), &quiet(), Some(0.1)).is_ok());
    assert!(!matches!(alignment.solve(Some(-60.0), &quiet(), Some(10.0)), Err(AlignError::OtherLatitude { .. })));
}

#[test]
fn a_base_that_turns_about_the_vertical_contradicts_no_latitude() {
    // It turns by −10 °/h: 3.026 °/h are left about the vertical, and with 7.521 horizontally they make 8.106 °/h, 6.9 less than the Earth's.
    // One that sways by 0.5° within 20 s returns to where it was: the heading is its own.
    let [_, y, z] = STILL_ARCSEC;
    let yawing = |yaw_arcsec: &dyn Fn(f64) -> f64| {
        let mut alignment = Alignment::default();
        for step in 0..10_500 {
            let (from_s, to_s) = (0.01 * f64::from(step), 0.01 * f64::from(step + 1));
            let (from, to) = (yaw_arcsec(from_s), yaw_arcsec(to_s));
            let turned_rad = 0.5 * (from + to) / 3600.0 * RAD_PER_DEG;
            // The Earth's rate points north, to the left of the mark; a turn to the left takes the mark nearer to it.
            let (sin, cos) = (libm::sin(turned_rad), libm::cos(turned_rad));
            alignment.push(0.01, sample([y * sin, y * cos, z + to - from], [0.0, 0.0, 9.8]));
        }
        alignment.solve(Some(60.0), &quiet(), Some(0.0)).unwrap().angles.heading_deg
    };
    // To the right, negative about up: 10 °/h · 105 s = 0.292°.
    let turned_deg = yawing(&|t_s| -10.0 * t_s);
    assert!((turned_deg - 90.2917).abs() < 0.005, "{turned_deg}");
    // A quarter beyond five periods: 0.5° to the left.
    let swayed_deg = yawing(&|t_s| 1800.0 * libm::sin(2.0 * core::f64::consts::PI * t_s / 20.0));
    assert!((swayed_deg - 89.5).abs() < 0.1, "{swayed_deg}");
}

#[test]
fn a_bias_beyond_the_declared_one_counts_in_sigma() {
    // Along north 1 °/h too much, declared 0.01: what shows, 1/7.5205 = 7.6°, may be across north as well. 0 asks for the repeatability.
    let [x, y, z] = STILL_ARCSEC;
    let biased = still(100, [x, y + 0.01, z]);
    let sigma_deg = |declared| biased.solve(Some(60.0), &quiet(), Some(declared)).unwrap().sigma_heading_deg;
    assert!((sigma_deg(0.01) - 7.62).abs() < 0.05, "{}", sigma_deg(0.01));
    assert!((sigma_deg(2.0) - 15.24).abs() < 0.05 && sigma_deg(0.0) < 0.1);
}

#[test]
fn a_bias_of_the_east_gyro_turns_the_heading_by_its_share() {
    // Mark east: x reads 0.1 °/h too much. East rate is −h sin of the heading error: 0.1 / 7.5205 = 0.7618°. The gyro sees
    // its axis a little south of east or north of it: x = Ω cos φ cos ψ > 0 means ψ < 90°.
    let alignment = still(100, [0.001, STILL_ARCSEC[1], STILL_ARCSEC[2]]);
    let aligned = alignment.solve(Some(60.0), &quiet(), Some(0.1)).unwrap();
    assert!((aligned.angles.heading_deg - 90.0 + 0.7618).abs() < 1e-3, "{:?}", aligned.angles);
    assert!((aligned.sigma_heading_deg - 0.7618).abs() < 0.01, "{}", aligned.sigma_heading_deg);
}

#[test]
fn a_swaying_base_does_not_disturb_the_heading() {
    // Pitch 0.2° sin(2π t/7 s), the block 1.5 m above the axis, mark east: the nose goes up, the block back to the west.
    let (amplitude, omega, arm_m) = (0.2 * RAD_PER_DEG, 2.0 * core::f64::consts::PI / 7.0, 1.5);
    let pitch = |t_s: f64| amplitude * libm::sin(omega * t_s);
    let mut alignment = Alignment::default();
    let earth = Vector3::from(STILL_ARCSEC) * (RAD_PER_DEG / 3600.0);
    for step in 0..10_000 {
        let (from_s, to_s) = (0.01 * f64::from(step), 0.01 * f64::from(step + 1));
        let middle = pitch(0.5 * (from_s + to_s));
        // Nose up is a rotation about −y. Backward acceleration of the block: arm · d²p/dt².
        let (sin, cos) = (libm::sin(middle), libm::cos(middle));
        let back = -arm_m * omega * omega * middle;
        let up = 9.8;
        let force = [up * sin - back * cos, 0.0, up * cos + back * sin];
        let body = Vector3::new(earth.x * cos + earth.z * sin, earth.y, earth.z * cos - earth.x * sin);
        let angle_rad = body - Vector3::y() * (pitch(to_s) - pitch(from_s));
        alignment.push(0.01, Increment { angle_rad, ..sample([0.0; 3], force) });
    }
    let aligned = alignment.solve(Some(60.0), &quiet(), Some(0.0)).unwrap();
    let error_deg = wrap_180_deg(aligned.angles.heading_deg - 90.0);
    assert!(error_deg.abs() < 0.05 && error_deg.abs() < 3.0 * aligned.sigma_heading_deg, "{error_deg} {aligned:?}");
    assert!(aligned.base.jitter_arcsec > 100.0, "{:?}", aligned.base);
}

/// Sums of uniform numbers: nearly normal, variance 1.
struct Numbers(u64);

impl Numbers {
    fn normal(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            sum += (self.0 >> 11) as f64 / (1u64 << 53) as f64;
        }
        sum
    }
}

#[test]
fn sigma_covers_noise_of_the_gyros_that_nobody_declared() {
    // 0.01 °/√h: 0.6 arcsec/√s, 0.06 in 10 ms. Over 40 windows of 60 s the sum of (error/sigma)² would be chi-square with 40
    // degrees of freedom were sigma known; its 0.1 and 99.9 % points are 18 and 73. Noise is learned from all windows.
    let mut numbers = Numbers(7);
    let windows: std::vec::Vec<Alignment> = (0..40)
        .map(|_| {
            let mut alignment = Alignment::default();
            for _ in 0..6000 {
                let arcsec = STILL_ARCSEC.map(|mean| mean + 0.06 * numbers.normal());
                let force = [0.0, 0.0, 9.8].map(|mean| mean + 0.0003 * numbers.normal());
                alignment.push(0.01, sample(arcsec, force));
            }
            alignment
        })
        .collect();
    let noise = windows.iter().filter_map(|w| w.noise(Some(60.0))).reduce(|a, b| a.with(&b)).unwrap();
    assert!((noise.deg_per_sqrt_h() / 0.01 - 1.0).abs() < 0.35, "{}", noise.deg_per_sqrt_h());
    let solved = windows.iter().map(|window| window.solve(Some(60.0), &noise, Some(0.0)).unwrap());
    let squares: f64 =
        solved.map(|aligned| square(wrap_180_deg(aligned.angles.heading_deg - 90.0) / aligned.sigma_heading_deg)).sum();
    assert!((18.0..73.0).contains(&squares), "{squares}");
}

fn square(value: f64) -> f64 {
    value * value
}

/// 100 s with gyros of 0.002 °/√h (0.12″/√s) and accelerometers of 3e-3 m/s/√s, on a base that stands.
fn loud_accelerometers(numbers: &mut Numbers) -> Alignment {
    let mut alignment = Alignment::default();
    for _ in 0..10_000 {
        let arcsec = STILL_ARCSEC.map(|mean| mean + 0.012 * numbers.normal());
        let force = [0.0, 0.0, 9.8].map(|mean| mean + 0.03 * numbers.normal());
        alignment.push(0.01, sample(arcsec, force));
    }
    alignment
}

#[test]
fn a_base_that_stands_is_aligned_to_the_bound_of_its_gyros() {
    // N/√T = 0.12″/√100 s = 0.012 °/h of 7.5205 °/h: 0.0914°. The slope of the force alone has √12 · 3e-3/9.8/1000 = 0.219 °/h: 1.67°.
    // Of 30 errors over 0.0914° the sum of squares is chi-square: 0.1 and 99.9 % points 11.6 and 59.7.
    let mut numbers = Numbers(11);
    let noise = NoiseOfRate::Declared(0.002);
    let solved: std::vec::Vec<Aligned> =
        (0..30).map(|_| loud_accelerometers(&mut numbers).solve(Some(60.0), &noise, Some(0.0)).unwrap()).collect();
    let squares: f64 =
        solved.iter().map(|aligned| square(wrap_180_deg(aligned.angles.heading_deg - 90.0) / 0.0914)).sum();
    assert!((11.6..59.7).contains(&squares), "{squares}");
    // In 5 % of the windows the accelerometers contradict that it stands, and sigma is wide: of 30, more than 6 with a chance of 0.06 %.
    let wide = solved.iter().filter(|aligned| aligned.sigma_heading_deg > 0.2).count();
    assert!(wide <= 6 && solved.iter().all(|aligned| aligned.sigma_heading_deg > 0.09), "{wide}");
}

#[test]
fn a_base_that_turns_faster_than_its_accelerometers_can_miss_is_no_rate_of_the_earth() {
    // 4″ in a second are 4 °/h, 18 sigmas of the force's 0.219 °/h: the mean of the gyros' rates would be off by 4/7.52 = 28°.
    let mut numbers = Numbers(13);
    let mut alignment = Alignment::default();
    for step in 0..10_000 {
        let mut arcsec = STILL_ARCSEC.map(|mean| mean + 0.012 * numbers.normal());
        arcsec[0] += 0.04;
        // Left side up by 4″ in a second: the support against gravity leans to the left axis.
        let roll = 4.0 / 3600.0 * RAD_PER_DEG * 0.01 * f64::from(step);
        let force = [0.0, 9.8 * roll, 9.8].map(|mean| mean + 0.03 * numbers.normal());
        alignment.push(0.01, sample(arcsec, force));
    }
    let aligned = alignment.solve(Some(60.0), &NoiseOfRate::Declared(0.002), Some(0.0)).unwrap();
    let error_deg = wrap_180_deg(aligned.angles.heading_deg - 90.0);
    assert!(
        error_deg.abs() < 3.0 * aligned.sigma_heading_deg && aligned.sigma_heading_deg < 5.0,
        "{error_deg} {aligned:?}"
    );
    assert!(aligned.base.drift_deg_h > 1.0, "{:?}", aligned.base);
}

#[test]
fn what_the_accelerometers_contradict_counts_in_sigma_and_what_they_cannot_see_is_said() {
    // Of 100 s with 3e-3 m/s/√s the force tells a drift to √12 · 3e-3/9.8/1000 = 0.219 °/h. A drift of 0.8 °/h of the support is
    // 3.7 of that: the sum of squares over its variance, per axis, is 6.8, and the 3.8 beyond 3 are √3.8 · 0.219 = 0.43 °/h, 3.2° of heading.
    let mut numbers = Numbers(17);
    let mut alignment = Alignment::default();
    for step in 0..10_000 {
        let mut arcsec = STILL_ARCSEC.map(|mean| mean + 0.012 * numbers.normal());
        arcsec[0] += 0.008;
        let roll = 0.8 / 3600.0 * RAD_PER_DEG * 0.01 * f64::from(step);
        let force = [0.0, 9.8 * roll, 9.8].map(|mean| mean + 0.03 * numbers.normal());
        alignment.push(0.01, sample(arcsec, force));
    }
    let aligned = alignment.solve(Some(60.0), &NoiseOfRate::Declared(0.002), Some(0.0)).unwrap();
    let error_deg = wrap_180_deg(aligned.angles.heading_deg - 90.0);
    assert!(error_deg.abs() < 3.0 * aligned.sigma_heading_deg, "{error_deg} {aligned:?}");
    assert!((aligned.base.unseen_drift_deg_h / 0.219 - 1.0).abs() < 0.3, "{:?}", aligned.base);
}

#[test]
fn what_cannot_be_aligned_is_refused_with_its_reason() {
    let solve =
        |alignment: &Alignment, latitude_deg| alignment.solve(Some(latitude_deg), &quiet(), Some(0.0)).unwrap_err();
    assert!(matches!(solve(&still(5, STILL_ARCSEC), 60.0), AlignError::TooShort { .. }));
    let good = still(60, STILL_ARCSEC);
    assert_eq!(solve(&good, 89.5), AlignError::Latitude(LatitudeError::NearPole));
    assert!(matches!(solve(&still(60, [0.0; 3]), 60.0), AlignError::NoEarthRate { .. }));
    let mut falling = Alignment::default();
    for _ in 0..2000 {
        falling.push(0.01, sample(STILL_ARCSEC, [0.0, 0.0, 3.0]));
    }
    assert!(matches!(solve(&falling, 60.0), AlignError::NotGravity { .. }));
    assert!(!falling.push(0.0, sample(STILL_ARCSEC, [0.0, 0.0, 9.8])));
    assert!(!falling.push(0.01, sample([f64::NAN, 0.0, 0.0], [0.0, 0.0, 9.8])));
}
