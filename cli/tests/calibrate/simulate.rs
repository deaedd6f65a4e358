//! `north calibrate simulate`: what it writes can be calibrated, and comes out as the truth beside it.

use std::fs;

use super::{calibrate, near};

#[test]
fn simulated_recordings_are_calibrated_to_their_truth() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(calibrate(&folder, &["simulate", "ellipsoid", "--out", "hand", "--seed", "4"]).code, 0);
    let printed = calibrate(&folder, &["ellipsoid", "hand/readings.csv", "--compare", "hand/truth.toml"]);
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    let arguments = ["simulate", "six-position", "--out", "table", "--seconds", "120"];
    assert_eq!(calibrate(&folder, &arguments).code, 0);
    let result = calibrate(&folder, &["six-position", "table", "--json", "-"]).json();
    let truth: toml::Table = fs::read_to_string(folder.path().join("table/truth.toml")).unwrap().parse().unwrap();
    for axis in 0..3 {
        let expected = truth["gyro_triad"]["bias_deg_h"][axis].as_float().unwrap();
        near(&result["bias_deg_h"][axis], expected, 5.0 * result["sigma_bias_deg_h"][axis].as_f64().unwrap());
    }
    assert_eq!(calibrate(&folder, &arguments).code, 1);
}
