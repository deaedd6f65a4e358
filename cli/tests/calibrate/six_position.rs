//! `north calibrate six-position`: what it finds.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use hal_sim::triad::{SIX_POSITIONS, Shock, Table, TriadErrors, Visit};
use serde_json::Value;
use tempfile::TempDir;

use super::{calibrate, keys, near};

/// A triad with an error of each kind.
pub fn triad() -> TriadErrors {
    TriadErrors {
        bias_deg_h: [0.3, -0.1, 0.05],
        scale_ppm: [2000.0, 0.0, -3000.0],
        // x tilted towards y by 3 mrad, z towards x by −2 mrad.
        tilt_arcsec: [[618.8, 0.0], [0.0, 0.0], [-412.5, 0.0]],
        arw_deg_per_sqrt_h: 0.001,
        ..TriadErrors::default()
    }
}

/// Positions, each recorded for 200 s; the table moves at both ends of each file.
pub struct Set {
    pub errors: TriadErrors,
    pub latitude_deg: f64,
    /// What calibration.toml says besides the positions.
    pub declared: String,
    /// What happens at position number …, from 0.
    pub visit: fn(usize, Visit) -> Visit,
    /// What calibration.toml says of where the axes of position number … point.
    pub axes: fn(usize) -> &'static str,
    /// Errors of the table's angles at position number …, arcsec.
    pub table_arcsec: fn(usize) -> [f64; 3],
}

impl Set {
    pub fn new() -> Self {
        Self {
            errors: triad(),
            latitude_deg: 34.75,
            declared: "latitude_deg = 34.75".into(),
            visit: |_, visit| visit,
            axes: |position| SIX_POSITIONS[position].axes,
            table_arcsec: |_| [0.0; 3],
        }
    }

    /// Records the six positions.
    pub fn record(&self) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let mut table = Table::new(self.latitude_deg, &self.errors, 5);
        let mut manifest = format!("format = 1\n{}\n", self.declared);
        for (i, position) in SIX_POSITIONS.iter().enumerate() {
            table.set_error((self.table_arcsec)(i));
            write_visit(&mut table, folder.path(), i, (self.visit)(i, visit(position.angles_deg)));
            write!(manifest, "[[position]]\nfile = \"{i}.csv\"\naxes = \"{}\"\n", (self.axes)(i)).unwrap();
        }
        fs::write(folder.path().join("calibration.toml"), manifest).unwrap();
        folder
    }
}

pub fn visit(angles_deg: [f64; 3]) -> Visit {
    Visit {
        interval_s: 0.1,
        moves_from_deg: Some([10.0, 20.0, 30.0]),
        move_s: 4.0,
        ..Visit::at_rest(angles_deg, 200.0)
    }
}

/// Writes `number`.csv, its columns in an order of their own.
pub fn write_visit(table: &mut Table, folder: &Path, number: usize, visit: Visit) {
    let mut text = String::from("t_s,temp_c,gz_arcsec,gy_arcsec,gx_arcsec\n");
    for row in table.visit(&visit) {
        let [x, y, z] = row.arcsec;
        writeln!(text, "{:.3},{:.2},{z:.7},{y:.7},{x:.7}", row.t_s, row.temp_c).unwrap();
    }
    fs::write(folder.join(format!("{number}.csv")), text).unwrap();
}

fn solve(folder: &TempDir) -> Value {
    calibrate(folder, &["six-position", ".", "--json", "-"]).json()
}

/// That biases and matrix are those of [`triad`]. 0.001 °/√h over 200 s: 0.0042 °/h a mean, times √(3/16) for a bias; over Ω cos φ
/// times √(3/8) for a response. Five sigma.
fn assert_true(result: &Value) {
    for (axis, expected) in [0.3, -0.1, 0.05].into_iter().enumerate() {
        near(&result["bias_deg_h"][axis], expected, 5.0 * 0.0019);
    }
    // Rows: sensitive axes times scale factors.
    let expected = [[1.002, 0.003, 0.0], [0.0, 1.0, 0.0], [-0.002, 0.0, 0.997]];
    for (row, expected) in expected.iter().enumerate() {
        for (column, expected) in expected.iter().enumerate() {
            near(&result["matrix"][row][column], *expected, 5.0 * 2.2e-4);
        }
    }
}

#[test]
fn six_positions_with_moves_and_a_shock() {
    let shock = |i, visit| match i {
        1 => Visit { shocks: vec![Shock { at_s: 77.3, swing_arcsec: 500.0, turned_arcsec: [0.0; 3] }], ..visit },
        _ => visit,
    };
    let folder = Set { visit: shock, ..Set::new() }.record();
    let result = calibrate(&folder, &["six-position", ".", "--json", "-", "--model-out", "m.toml"]).json();
    assert_eq!(
        keys(&result),
        [
            "bias_deg_h",
            "closure_p_value",
            "closure_rms_deg_h",
            "matrix",
            "published_bias_deg_h",
            "published_matrix",
            "sigma_bias_deg_h",
            "sigma_matrix"
        ]
    );
    assert_true(&result);
    for axis in 0..3 {
        near(&result["sigma_bias_deg_h"][axis], 0.0019, 0.0003);
    }
    for (row, column, expected) in [(0, 0, 1.002), (0, 1, 0.003), (1, 0, 0.0), (2, 0, -0.002), (2, 2, 0.997)] {
        near(&result["published_matrix"][row][column], expected, 5.0 * 3.5e-4);
    }
    assert!(result["closure_p_value"].as_f64().unwrap() > 1e-3);
    let model = fs::read_to_string(folder.path().join("m.toml")).unwrap();
    assert!(model.starts_with("format = 2\n\n[gyro_triad]\nbias_deg_h = ["), "{model}");
}

#[test]
fn the_table_is_printed_for_people() {
    let printed = calibrate(&Set::new().record(), &["six-position", "calibration.toml"]).text();
    for part in ["1.csv", "left out", "least squares", "by differences", "6 closures"] {
        assert!(printed.contains(part), "{printed}");
    }
}

#[test]
fn a_shock_that_leaves_the_triad_turned_parts_the_stay() {
    // By half a degree: 0.1 °/h, a tenth of a second's noise, and 25 sigma of the mean if it were left in.
    let shock = |i, visit| match i {
        2 => Visit {
            shocks: vec![Shock { at_s: 110.2, swing_arcsec: 400.0, turned_arcsec: [0.0, 1800.0, 0.0] }],
            ..visit
        },
        _ => visit,
    };
    let folder = Set { visit: shock, ..Set::new() }.record();
    assert_true(&solve(&folder));
    let printed = calibrate(&folder, &["six-position", "."]).text();
    let note = printed.lines().find(|line| line.starts_with("note: 2.csv: ")).unwrap_or_else(|| panic!("{printed}"));
    let words: Vec<_> = note.split(' ').collect();
    let (seconds, arcsec): (f64, f64) = (words[2].parse().unwrap(), words[9].parse().unwrap());
    assert!((70.0..85.0).contains(&seconds) && (1790.0..1810.0).contains(&arcsec), "{note}");
}

#[test]
fn a_table_good_to_three_arcseconds_does_no_harm() {
    let errors = |i| [[3.0, -3.0, 3.0], [-3.0, -3.0, 3.0], [3.0, 3.0, -3.0]][i % 3];
    let result = solve(&Set { table_arcsec: errors, ..Set::new() }.record());
    assert_true(&result);
    assert!(result["closure_p_value"].as_f64().unwrap() > 1e-3);
}

#[test]
fn the_southern_hemisphere() {
    let south = Set { latitude_deg: -34.75, declared: "latitude_deg = -34.75".into(), ..Set::new() };
    assert_true(&solve(&south.record()));
    Set { declared: "latitude_deg = 34.75".into(), ..south }.refused("contradicts the data: they say -34.");
}

#[test]
fn a_temperature_that_differs_is_noted() {
    let warmer = |i, visit| if i == 3 { Visit { temp_c: 28.0, ..visit } } else { visit };
    let folder = Set { visit: warmer, ..Set::new() }.record();
    let printed = calibrate(&folder, &["six-position", "."]).text();
    assert!(printed.contains("note: the temperature differs from 25.0 to 28.0 C"), "{printed}");
}

#[test]
fn another_set_of_positions_that_determines_all() {
    // Every attitude that quarter turns of the middle and the inner gimbal reach, at two angles of the outer one.
    let folder = tempfile::tempdir().unwrap();
    let mut table = Table::new(60.0, &triad(), 6);
    let mut manifest = String::from("format = 1\nlatitude_deg = 60.0\n");
    let quarters = [0.0, 90.0, 180.0, 270.0];
    let angles = quarters.into_iter().flat_map(|middle| [[0.0, middle, 0.0], [90.0, middle, 90.0]]);
    for (i, angles_deg) in angles.enumerate() {
        let axes = axes_of(&table, angles_deg);
        write_visit(&mut table, folder.path(), i, visit(angles_deg));
        write!(manifest, "[[position]]\nfile = \"{i}.csv\"\naxes = \"{axes}\"\n").unwrap();
    }
    fs::write(folder.path().join("calibration.toml"), &manifest).unwrap();
    let result = solve(&folder);
    assert_true(&result);
    assert!(result["published_matrix"].is_null() && result["closure_p_value"].as_f64().unwrap() > 1e-3);

    // Four of them leave no closure.
    let [zero, one, two, three] = [0, 1, 2, 4].map(|i| manifest.split("[[position]]").nth(i + 1).unwrap());
    let head = "format = 1\nlatitude_deg = 60.0\n";
    let four = [head, zero, one, two, three].join("[[position]]");
    fs::write(folder.path().join("calibration.toml"), four).unwrap();
    let printed = calibrate(&folder, &["six-position", "."]);
    assert!(printed.code == 1 || printed.stdout.contains("no closures"), "{} {}", printed.stdout, printed.stderr);
}

/// Which way x, y and z point, by the attitude of the table.
fn axes_of(table: &Table, angles_deg: [f64; 3]) -> String {
    let attitude = table.attitude(angles_deg).to_rotation_matrix();
    (0..3)
        .map(|axis| {
            let column = attitude.matrix().column(axis);
            let letters = [('E', 'W'), ('N', 'S'), ('U', 'D')];
            let (place, part) = column.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap();
            if *part > 0.0 { letters[place].0 } else { letters[place].1 }
        })
        .collect()
}
