//! Dwells, by hand.

use super::*;
use crate::fix::tests::normal;
use crate::sensing::level::LevelMoments;

fn row(second: u16, rate_deg_h: f64) -> Row {
    Row {
        t_s: f64::from(second) + 0.5,
        seconds: 1.0,
        cos: 0.0,
        sin: 1.0,
        rate_deg_h,
        moment_arcsec_s: 0.0,
        level: None,
    }
}

fn rows(rates: &[f64]) -> DwellRows {
    let mut rows = DwellRows::default();
    for (second, &rate) in (0..).zip(rates) {
        rows.push(row(second, rate), 0.1);
    }
    rows
}

#[test]
fn mean_slope_and_scatter_by_hand() {
    // 1, 2, 3, 6 at 0.5, 1.5, 2.5, 3.5: mean 3, slope (−1.5·−2 − 0.5·−1 + 0.5·0 + 1.5·3)/5 = 1.6; residuals
    // 0.4, −0.2, −0.8, 0.6 with sum of squares 1.2; differences −0.6, −0.6, 1.4, half their squares 1.34. The mean
    // angles of the seconds are 0.5, 2, 4.5, 9: their slope is (−1.5·0.5 − 0.5·2 + 0.5·4.5 + 1.5·9)/5 = 2.8.
    let summary = rows(&[1.0, 2.0, 3.0, 6.0]).summary(1.0).unwrap();
    assert!((summary.rate.mean - 3.0).abs() < 1e-12);
    assert!((summary.rate.slope_per_s - 1.6).abs() < 1e-12);
    assert!((summary.rate.residual_squares - 1.2).abs() < 1e-6);
    assert!((summary.rate.successive_squares - 1.34).abs() < 1e-6);
    assert!((summary.angle.unwrap().slope_per_s - 2.8).abs() < 1e-12);
    assert_eq!((summary.degrees_of_freedom, summary.outliers, summary.seconds), (2, 0, 4.0));
    assert!((summary.sigma_deg_h() - libm::sqrt(1.2 / 2.0 / 4.0)).abs() < 1e-7);
    assert_eq!(summary.index_deg(), 90.0);
}

#[test]
fn a_shock_is_left_out() {
    let summary = rows(&[1.0, 1.1, 0.9, 50.0, 1.0, 1.1, 0.9]).summary(0.1).unwrap();
    assert_eq!((summary.outliers, summary.angle), (1, None));
    assert!((summary.rate.mean - 1.0).abs() < 1e-12);
}

/// 0.6 of 1 ± 0.1 in a second is off by four sigmas, as a mean of nine seconds by twelve.
#[test]
fn a_long_row_errs_less_than_a_second() {
    for (seconds, outliers) in [(1.0, 0), (9.0, 1)] {
        let mut dwell = rows(&[1.0, 1.1, 0.9, 1.0, 1.1, 0.9]);
        dwell.push(Row { t_s: 6.0 + 0.5 * seconds, seconds, ..row(6, 0.6) }, 0.1);
        assert_eq!(dwell.summary(0.1).unwrap().outliers, outliers, "{seconds}");
    }
}

/// A gyro of 0.09 °/h of noise in a second whose angle is counted in steps of 0.72 arcsec, and an Earth rate of a tenth
/// of a count above a count: nine seconds in ten read the same. Not one is left out, and the mean is the rate to a
/// count in the dwell's length; a true shock of twenty counts is still left out.
#[test]
fn a_second_on_the_next_count_is_no_shock() {
    let (count, rate_deg_h) = (0.72, 7.272);
    for shock in [0.0, 20.0 * count] {
        let (mut state, mut angle, mut counted) = (7, 0.0, 0.0);
        let mut rows = DwellRows::default();
        for second in 0..100 {
            angle += rate_deg_h + 0.09 * normal(&mut state);
            let reading = count * libm::round(angle / count);
            let shock = if second == 50 { shock } else { 0.0 };
            rows.push(row(second, reading - counted + shock), 0.09);
            counted = reading;
        }
        let summary = rows.summary(0.09).unwrap();
        assert_eq!(summary.outliers, u16::from(shock > 0.0));
        assert!((summary.rate.mean - rate_deg_h).abs() < 0.04, "{}", summary.rate.mean);
    }
}

/// A dwell of an hour and one of three, in their sums against the same by two passes over all rows, and its merged rows
/// against the first moment of all.
#[test]
fn the_length_of_a_dwell_changes_nothing() {
    for length in [129_u16, 135, 3600, 10_800] {
        let mut state = 1;
        let mut dwell = DwellRows::default();
        let all: std::vec::Vec<Row> = (0..length)
            .map(|second| {
                let x = normal(&mut state);
                Row {
                    moment_arcsec_s: 0.1 * x,
                    level: LevelMoments::constant(1e-4 * x, -2e-4 * x),
                    ..row(second, 5.0 + 1e-4 * f64::from(second) + x)
                }
            })
            .collect();
        all.iter().for_each(|row| dwell.push(*row, 1.0));
        let (number, middle_s) = (f64::from(length), 0.5 * f64::from(length));
        let mean = all.iter().map(|row| row.rate_deg_h).sum::<f64>() / number;
        let with_time: f64 = all.iter().map(|row| (row.t_s - middle_s) * row.rate_deg_h).sum();
        let spread: f64 = all.iter().map(|row| (row.t_s - middle_s) * (row.t_s - middle_s)).sum();
        let slope = with_time / spread;
        let residual = |row: &Row| row.rate_deg_h - mean - slope * (row.t_s - middle_s);
        let squares: f64 = all.iter().map(|row| residual(row) * residual(row)).sum();
        let steps: f64 = all.windows(2).map(|pair| 0.5 * (residual(&pair[1]) - residual(&pair[0])).powi(2)).sum();
        let summary = dwell.summary(1.0).unwrap();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{length}: {a} {b}");
        close(summary.rate.mean, mean);
        close(1e3 * summary.rate.slope_per_s, 1e3 * slope);
        let rounded = |a: f32, b: f64| assert!((f64::from(a) - b).abs() < 1e-7 * b, "{length}: {a} {b}");
        rounded(summary.rate.residual_squares, squares);
        rounded(summary.rate.successive_squares, steps);
        assert_eq!((summary.degrees_of_freedom, summary.outliers, summary.seconds), (length - 2, 0, number));
        // First moments are kept as floats: every merging rounds them and their means once, by a share of 2⁻²⁴ at most, and rows of
        // three hours are merged eight times.
        let kept: std::vec::Vec<Row> = dwell.as_slice().to_vec();
        let rounding = |rows: &[Row], of: &dyn Fn(&Row) -> f64| {
            9.0 * 2.0_f64.powi(-24) * rows.iter().map(|row| of(row).abs()).sum::<f64>()
        };
        let compare = |of: &dyn Fn(&Row) -> f64, parts: [&dyn Fn(&Row) -> f64; 2]| {
            let sum = |rows: &[Row]| rows.iter().map(of).sum::<f64>();
            let allowed: f64 = parts.iter().map(|part| rounding(&kept, part)).sum();
            assert!((sum(&kept) - sum(&all)).abs() <= allowed, "{length}: {} {} {allowed}", sum(&kept), sum(&all));
        };
        let of_mean = |row: &Row, mean: f64| row.seconds * (row.t_s - middle_s) * mean;
        let left = |row: &Row| row.level.unwrap();
        compare(
            &|row| row.moment_arcsec_s + of_mean(row, row.rate_deg_h),
            [&|row| row.moment_arcsec_s, &|row| of_mean(row, row.rate_deg_h)],
        );
        compare(
            &|row| left(row).first.left + of_mean(row, left(row).mean.left),
            [&|row| left(row).first.left, &|row| of_mean(row, left(row).mean.left)],
        );
        assert!(longest_piece(dwell.as_slice()).len() == dwell.len() && dwell.len() > 48);
    }
}

#[test]
fn gaps_everywhere_are_no_limit_either() {
    let mut dwell = DwellRows::default();
    (0..2000).for_each(|i| dwell.push(row(2 * i, f64::from(i % 3)), 1.0));
    let summary = dwell.summary(1.0).unwrap();
    assert_eq!((summary.seconds, summary.angle), (2000.0, None));
    assert!((summary.rate.mean - 1.0).abs() < 1e-3);
}

#[test]
fn jitter_at_the_beginning_is_skipped() {
    let mut shaken = rows(&[9.0, 1.0, 9.0, 1.0, 1.1, 1.0, 1.1]);
    assert_eq!(shaken.skip_jitter(3.0, 3), Some(3));
    assert_eq!(shaken.len(), 4);
    assert_eq!(rows(&[9.0, 1.0, 9.0, 1.0]).skip_jitter(3.0, 3), None);
}

/// A dwell of forty seconds, and its parts of fifteen and twenty-five joined: what a line says is the same, but for the step between them.
#[test]
fn parts_joined_are_the_whole() {
    let mut state = 1;
    let all: std::vec::Vec<Row> = (0..40)
        .map(|second| {
            let x = normal(&mut state);
            let level = LevelMoments::constant(1e-3 * x, 2e-3 * f64::from(second));
            Row { level, moment_arcsec_s: 0.3 * x, ..row(second, 5.0 + 0.1 * f64::from(second) + x) }
        })
        .collect();
    let summary = |rows: &[Row]| {
        let mut dwell = DwellRows::default();
        for row in rows {
            dwell.push(*row, 1.0);
            dwell.push_temperature(row.t_s, 20.0 + 0.01 * row.t_s * row.t_s);
        }
        dwell.summary(1.0).unwrap()
    };
    let (whole, first, second) = (summary(&all), summary(&all[..15]), summary(&all[15..]));
    assert!(first.goes_on_in(&second) && !second.goes_on_in(&first));
    let joined = first.joined(&second);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-5 * b.abs().max(1e-3), "{a} {b}");
    close(joined.seconds, 40.0);
    close(joined.t_s, whole.t_s);
    close(joined.end_s, 40.0);
    close(joined.time_spread.into(), whole.time_spread.into());
    close(joined.rate.mean, whole.rate.mean);
    close(joined.rate.slope_per_s, whole.rate.slope_per_s);
    close(joined.rate.residual_squares.into(), whole.rate.residual_squares.into());
    let [of_joined, of_whole] = [joined, whole].map(|dwell| dwell.eased.unwrap());
    assert!((of_joined.line.mean - of_whole.line.mean).abs() < 0.02, "{of_joined:?} {of_whole:?}");
    close(of_joined.others.into(), of_whole.others.into());
    let [levels, of_whole] = [joined, whole].map(|dwell| dwell.level.unwrap()[1]);
    close(levels.mean.into(), of_whole.mean.into());
    close(levels.slope_per_s.into(), of_whole.slope_per_s.into());
    close(joined.temperature.kelvin.into(), whole.temperature.kelvin.into());
    close(joined.temperature.kelvin_per_s.into(), whole.temperature.kelvin_per_s.into());
    assert_eq!(joined.degrees_of_freedom, whole.degrees_of_freedom);
}

/// The rows of a gyro whose angle, arcsec, is this function of the time in seconds, read 400 times a second.
fn rows_of_angle(seconds: u16, angle: impl Fn(f64) -> f64) -> DwellRows {
    let mut dwell = DwellRows::default();
    for second in 0..seconds {
        let turned = |i: i32| {
            let [from, to] = [i, i + 1].map(|i| angle(f64::from(second) + f64::from(i) / 400.0));
            (to - from, (f64::from(i) + 0.5) / 400.0 - 0.5)
        };
        let rate_deg_h = (0..400).map(|i| turned(i).0).sum();
        let moment_arcsec_s = (0..400).map(turned).map(|(turned, t_s)| turned * t_s).sum();
        dwell.push(Row { moment_arcsec_s, ..row(second, rate_deg_h) }, 1.0);
    }
    dwell
}

/// A gyro that turns by 3 °/h and 0.01 °/h more in every second, and a drive that rings by 1.7 arcsec at 5 Hz and forgets it in 5 s: it begins 1.7 arcsec
/// off and ends at 1.7 e⁻⁶. The plain mean of 30 s has −1.7 (1 − e⁻⁶)/30 = −0.0565 °/h of that. The first row's mean angle has
/// 1.7 · (1 − e⁻⁰·²)/(5 · ((10π)² + 0.04)) ≈ 6e-5 arcsec, and the end 0.004. The rows' slope has, by parts, 14.5 · 1.7 of the beginning less the sum
/// of 1.7 e^(−k/5) at the ends of all seconds, 7.66: 17.0 over its weight 30³/12, 0.0076 °/h/s.
#[test]
fn a_ringing_at_the_beginning_is_eased() {
    let even = |t_s: f64| 3.0 * t_s + 0.005 * t_s * t_s;
    let ringing = |t_s: f64| 1.7 * libm::exp(-t_s / 5.0) * libm::cos(core::f64::consts::TAU * 5.0 * t_s);
    let rung = rows_of_angle(30, |t_s| even(t_s) + ringing(t_s)).summary(1.0).unwrap();
    let quiet = rows_of_angle(30, even).summary(1.0).unwrap();
    assert!((rung.rate.mean - quiet.rate.mean + 0.0565).abs() < 1e-4, "{:?}", rung.rate);
    assert!((rung.rate.slope_per_s - 0.01 - 0.0076).abs() < 1e-4, "{:?}", rung.rate);
    let eased = rung.eased.unwrap();
    // Half of the first second counts, and the mean time is (0.5 · 0.67 + 29 · 15.5)/29.5 = 15.25 s: 0.25 s of a slope of 0.01 are in the mean.
    assert!((eased.line.mean - quiet.eased.unwrap().line.mean).abs() < 2e-4, "{eased:?}");
    assert!((quiet.eased.unwrap().line.mean - quiet.rate.mean - 0.0025).abs() < 1e-4, "{:?}", quiet.eased);
    assert!((eased.line.slope_per_s - 0.01).abs() < 4e-4, "{eased:?}");
    assert!(eased.first > 10.0 * eased.others / 29.0, "{eased:?}");
    // Of nothing but an even rate all of it is what the plain line is.
    let still = rows_of_angle(30, |t_s| 3.0 * t_s).summary(1.0).unwrap().eased.unwrap();
    assert!((still.line.mean - 3.0).abs() < 1e-9 && still.line.slope_per_s.abs() < 1e-9, "{still:?}");
}

/// A ringing of 1.7 arcsec at 7.37 Hz makes seconds of up to ± 3 °/h, far beyond 6 · 0.09, and moves the mean angle of a second by 1.7/(π · 7.37) = 0.07
/// arcsec at most: none is left out. A jump of 2 arcsec is left out wherever it is: in the middle of a second it moves the mean angle by half of it there.
#[test]
fn what_rings_at_the_beginning_is_no_shock() {
    let ringing = |t_s: f64| 1.7 * libm::exp(-t_s / 5.0) * libm::cos(core::f64::consts::TAU * 7.37 * t_s);
    // Without any noise the jump would be taken for a count of the gyro.
    let noise = |t_s: f64| 0.05 * libm::sin(1.3 * t_s * t_s);
    let outliers =
        |angle: &dyn Fn(f64) -> f64| rows_of_angle(30, |t_s| angle(t_s) + noise(t_s)).summary(0.09).unwrap().outliers;
    assert_eq!(outliers(&|t_s| 3.0 * t_s + ringing(t_s)), 0);
    for jump_s in [0.5, 12.1, 20.9, 29.5] {
        assert_eq!(outliers(&|t_s| 3.0 * t_s + if t_s > jump_s { 2.0 } else { 0.0 }), 1, "{jump_s}");
    }
    assert_eq!(outliers(&|t_s| ringing(t_s) + if t_s > 20.5 { 2.0 } else { 0.0 }), 1);
    let mut of_nothing = rows(&[9.0, f64::NAN, 9.0, 1.0, 1.1, 0.9, 1.0, 1.1]);
    assert!(of_nothing.summary(0.09).unwrap().rate.mean < 1.1);
}

#[test]
fn nothing_gives_nothing() {
    assert!(DwellRows::default().summary(1.0).is_none());
    assert!(rows(&[f64::NAN]).summary(1.0).is_none());
}
