//! `north bench calibration`, with few trials: what it promises and that it prints it.

use serde_json::Value;

use crate::north;

#[test]
fn few_trials_keep_the_promises() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["bench", "calibration", "--trials", "300", "--voyages", "10", "--seed", "2"];
    let printed = north(&folder, &[&arguments[..], &["--json", "b.json"]].concat()).text();
    for part in ["| x0, deg/h |", "| table, +- arcsec |", "| least squares |", "| 1.64 of 4.38 | 62.6 % |", "| m33 |"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    let report: Value = serde_json::from_str(&std::fs::read_to_string(folder.path().join("b.json")).unwrap()).unwrap();
    assert_eq!(report["six_position"].as_array().unwrap().len(), 12);
    assert_eq!(report["ellipsoid"].as_array().unwrap().len(), 9);
    // The table's ±3″ alone: 3″/√3 rms an angle, 8.4 millionths of a radian; six positions together leave less.
    let floor_ppm = report["tables"][1]["matrix_floor_ppm"].as_f64().unwrap();
    assert!((3.0..8.4).contains(&floor_ppm), "{floor_ppm}");
    let voyages: Vec<_> =
        report["voyage"].as_array().unwrap().iter().map(|voyage| voyage["rms_nmi"].as_f64().unwrap()).collect();
    assert!(voyages[2] < 0.5 * voyages[0] && voyages[4] < voyages[2], "{voyages:?}");
}
