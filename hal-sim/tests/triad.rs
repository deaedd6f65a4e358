//! The triads: which way the table turns them, and the sign of every error.

use hal_sim::triad::{
    AccelerometerTriad, GyroTriad, Placement, SIX_POSITIONS, ShipVoyage, Shock, Table, TriadErrors, Visit, Warming,
    distance_nmi, even_directions, place_by_hand,
};

const QUIET: TriadErrors = TriadErrors {
    bias_deg_h: [0.0; 3],
    bias_deg_h_per_k: [0.0; 3],
    scale_ppm: [0.0; 3],
    tilt_arcsec: [[0.0; 2]; 3],
    arw_deg_per_sqrt_h: 0.0,
    bias_instability_deg_h: 0.0,
};

fn letter(east_north_up: [f64; 3]) -> char {
    let letters = [('E', 'W'), ('N', 'S'), ('U', 'D')];
    let (axis, part) = east_north_up.into_iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap();
    assert!(part.abs() > 1.0 - 1e-9, "{east_north_up:?}");
    if part > 0.0 { letters[axis].0 } else { letters[axis].1 }
}

#[test]
fn the_table_angles_of_the_source_point_the_axes_as_it_says() {
    let table = Table::new(34.75, &QUIET, 1);
    for position in SIX_POSITIONS {
        let attitude = table.attitude(position.angles_deg).to_rotation_matrix();
        let axes: String = (0..3).map(|axis| letter(attitude.matrix().column(axis).into_owned().into())).collect();
        assert_eq!(axes, position.axes);
    }
}

#[test]
fn a_table_at_rest_feels_the_earth() {
    // At 30°: north 15.0411 · cos 30° = 13.0260, up 7.5205 °/h.
    let mut table = Table::new(30.0, &QUIET, 1);
    let rows = table.visit(&Visit::at_rest(SIX_POSITIONS[4].angles_deg, 10.0));
    assert_eq!(rows.len(), 10);
    let [x, y, z] = rows[3].arcsec;
    assert!((x + 13.0260).abs() < 1e-3 && y.abs() < 1e-9 && (z + 7.5205).abs() < 1e-3, "{:?}", rows[3]);
}

#[test]
fn a_table_error_turns_the_input() {
    // Outer axis 3600 arcsec too far counter-clockwise: x of ENU turns from east to 1° north of it.
    let mut table = Table::new(0.0, &QUIET, 1);
    table.set_error([0.0, 0.0, 3600.0]);
    let [x, ..] = table.visit(&Visit::at_rest([0.0; 3], 1.0))[0].arcsec;
    assert!((x - 15.0411 * 0.0174524).abs() < 1e-4, "{x}");
}

#[test]
fn gyro_errors_have_their_signs() {
    let errors = TriadErrors {
        bias_deg_h: [0.0, 0.5, 0.0],
        scale_ppm: [1000.0, 0.0, 0.0],
        tilt_arcsec: [[0.0; 2], [0.0; 2], [0.0, 206.2648]],
        ..QUIET
    };
    let mut triad = GyroTriad::new(&errors, 1);
    let [x, y, z] = triad.measure([100.0, 200.0, 300.0], 2.0);
    // z tilted by 1 mrad towards y reads a thousandth of the rotation about y.
    assert!((x - 100.1).abs() < 1e-9 && (y - 201.0).abs() < 1e-9 && (z - 300.2).abs() < 1e-3, "{x} {y} {z}");
}

#[test]
fn white_noise_is_that_of_the_data_sheet() {
    // 0.01 °/√h: in a second 36/60 = 0.6 arcsec.
    let mut triad = GyroTriad::new(&TriadErrors { arw_deg_per_sqrt_h: 0.01, ..QUIET }, 3);
    let squares: f64 = (0..10_000).flat_map(|_| triad.measure([0.0; 3], 1.0)).map(|arcsec| arcsec * arcsec).sum();
    assert!(((squares / 30_000.0).sqrt() / 0.6 - 1.0).abs() < 0.02);
}

#[test]
fn moving_in_and_a_shock_show_in_the_rows() {
    let mut table = Table::new(34.75, &QUIET, 1);
    let visit = Visit {
        moves_from_deg: Some([0.0, 0.0, -90.0]),
        move_s: 5.0,
        shocks: vec![Shock { at_s: 30.2, swing_arcsec: 400.0, turned_arcsec: [20.0, 0.0, -50.0] }],
        ..Visit::at_rest([0.0; 3], 60.0)
    };
    let rows = table.visit(&visit);
    let turned: f64 = rows[..5].iter().map(|row| row.arcsec[2]).sum();
    assert!((turned / 3600.0 - 90.0).abs() < 0.1, "{turned}");
    assert!(rows[30].arcsec[0].abs() > 20.0 && rows[20].arcsec[0].abs() < 0.1);
    // x points east and feels no Earth: what it adds up to is the turn that stays.
    let left: f64 = rows[25..50].iter().map(|row| row.arcsec[0]).sum();
    assert!((left - 20.0).abs() < 0.5, "{left}");
}

#[test]
fn warmth_moves_the_bias() {
    let mut table = Table::new(0.0, &TriadErrors { bias_deg_h_per_k: [0.01, 0.0, -0.02], ..QUIET }, 1);
    let warming = Some(Warming { at_s: 5.0, by_k: 10.0 });
    let rows = table.visit(&Visit { temp_c: 20.0, warming, ..Visit::at_rest([0.0; 3], 10.0) });
    let [before, after] = [2, 7].map(|row: usize| (rows[row].temp_c, rows[row].arcsec));
    assert_eq!((before.0, after.0), (20.0, 30.0));
    assert!((before.1[0] + 0.05).abs() < 1e-9 && (after.1[0] - 0.05).abs() < 1e-9, "{before:?} {after:?}");
    assert!((before.1[2] - 0.1).abs() < 1e-9 && (after.1[2] + 0.1).abs() < 1e-9, "{before:?} {after:?}");
}

#[test]
fn accelerometer_errors_have_their_signs() {
    let triad = AccelerometerTriad {
        zero: [0.0, 0.0, 500.0],
        per_g: [1.0, 1.01, 100.0],
        tilt_arcsec: [[206.2648, 0.0], [0.0; 2], [0.0; 2]],
        ..AccelerometerTriad::default()
    };
    let [x, y, z] = triad.ideal([0.0, 1.0, 0.0]);
    assert!((x - 0.001).abs() < 1e-6 && (y - 1.01).abs() < 1e-12 && z == 500.0, "{x} {y} {z}");
    assert_eq!(triad.ideal([0.0, 0.0, -1.0])[2], 400.0);
}

#[test]
fn a_hand_rests_and_moves() {
    let placement = Placement {
        up: vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [2.0, 0.0, 0.0]],
        rest_s: 2.0,
        move_s: 1.0,
        rate_hz: 10.0,
        shake_g: 0.0,
        rest_shake_g: 0.0,
    };
    let readings = place_by_hand(&AccelerometerTriad::default(), &placement, 1);
    assert_eq!(readings.len(), 80);
    assert_eq!(readings[19].attitude, Some(0));
    assert_eq!(readings[20].attitude, None);
    assert!((readings[79].raw[0] - 1.0).abs() < 1e-12);
    assert!(
        readings.iter().all(|reading| (reading.raw.iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-9)
    );
}

#[test]
fn even_directions_are_even() {
    let directions = even_directions(23, 5);
    for axis in 0..3 {
        let mean: f64 = directions.iter().map(|direction| direction[axis]).sum::<f64>() / 23.0;
        assert!(mean.abs() < 0.1, "{mean}");
    }
}

#[test]
fn a_ship_goes_where_its_course_and_speed_lead() {
    // 10 knots east along the equator: 20 nautical miles in two hours, which is a third of a degree.
    let voyage = ShipVoyage { start_deg: [0.0, 0.0], course_deg: 90.0, knots: 10.0 };
    let steps: Vec<_> = voyage.steps(1.0, 2.0).collect();
    let last = steps.last().unwrap();
    assert_eq!(last.t_s, 7200.0);
    let (start, ..) = voyage.start();
    assert!((distance_nmi(start, last.position_m) - 20.0).abs() < 1e-3);
    assert!(last.position_m[1] > 0.0 && last.position_m[2].abs() < 1.0);
    // y of the block points to port, north: in the first ten minutes it feels the Earth, 15.04 arcsec/s, and the going, a
    // rotation about the north axis of 10 knots over the radius, 0.1665 arcsec/s.
    let [x, y, z] = steps[100].turned_arcsec;
    assert!(x.abs() < 1e-6 && (y - 15.041 - 0.1665).abs() < 2e-3 && z.abs() < 1e-6, "{x} {y} {z}");
    // Up it feels gravity, less the acceleration of going round, v²/R and 2Ωv: 4.15e-6 and 7.5e-4 m/s².
    let [_, _, z] = steps[100].velocity_m_s;
    assert!((z - (9.80665 - 7.54e-4)).abs() < 2e-6, "{z}");
    // At 600 s the block begins to turn by +180° at 6°/s.
    assert!((steps[605].turned_arcsec[2] - 6.0 * 3600.0).abs() < 1.0);
    assert!(steps[640].turned_arcsec[2].abs() < 1e-6);
}
