//! A campaign as a Parquet table, read back.

use std::fs::File;
use std::process::{Command, Output, Stdio};

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;

fn north(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_north")).args(arguments).stdin(Stdio::null()).output().unwrap()
}

/// Two runs; the second has a channel more and no temperature.
#[test]
fn every_row_comes_back_with_all_digits() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let manifest = "format = 1\nlatitude_deg = 34.75\n[[run]]\nfile = \"a.csv\"\nrole = \"fit\"\nreference_azimuth_deg = 12.5\n\
                    [[run]]\nfile = \"b.csv\"\n";
    std::fs::write(at("campaign.toml"), manifest).unwrap();
    std::fs::write(at("a.csv"), "t_s,index_deg,fog_arcsec,temp_c\n1,0,0.1234567890123,20.5\n2,0,0.25,20.75\n").unwrap();
    std::fs::write(at("b.csv"), "t_s,index_deg,fog_arcsec,supply_v\n1,90,-3,12.1\n2,90,-3.5,12.2\n").unwrap();
    let [campaign, out] = [folder.path().display().to_string(), at("table.parquet")];
    let output = north(&["export", &campaign, "--out", &out]);
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("4 rows of 2 runs"), "{output:?}");

    let reader = SerializedFileReader::new(File::open(&out).unwrap()).unwrap();
    let columns: Vec<String> =
        reader.metadata().file_metadata().schema_descr().columns().iter().map(|column| column.name().into()).collect();
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    let at = |name: &str| columns.iter().position(|column| column == name).unwrap();
    let number = |row: usize, name: &str| rows[row].get_double(at(name)).ok();
    assert_eq!(rows.len(), 4);
    assert_eq!(
        (rows[0].get_string(at("run")).unwrap().as_str(), rows[2].get_string(at("role")).unwrap().as_str()),
        ("a.csv", "check")
    );
    assert_eq!(number(0, "fog_arcsec"), Some(0.123_456_789_012_3));
    assert_eq!([number(1, "temp_c"), number(2, "temp_c")], [Some(20.75), None]);
    assert_eq!([number(1, "supply_v"), number(3, "supply_v")], [None, Some(12.2)]);
    assert_eq!([number(0, "reference_azimuth_deg"), number(3, "reference_azimuth_deg")], [Some(12.5), None]);
    assert_eq!(number(3, "latitude_deg"), Some(34.75));

    // Nothing is overwritten without being asked, and a run that cannot be read leaves no file.
    assert!(!north(&["export", &campaign, "--out", &out]).status.success());
    assert!(north(&["export", &campaign, "--out", &out, "--force"]).status.success());
    std::fs::write(folder.path().join("b.csv"), "t_s,index_deg,fog_arcsec\n1,90,x\n").unwrap();
    let other = folder.path().join("other.parquet");
    let refused = north(&["export", &campaign, "--out", &other.display().to_string()]);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && told.contains("b.csv, line 2") && !other.exists(), "{told}");
}
