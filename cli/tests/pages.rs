//! The pages of every verb: self-contained, with pictures, and without a number that is none.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::north;

/// A file of a folder that is new.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn page(&self, name: &str) -> String {
        let html = fs::read_to_string(self.path(name)).unwrap();
        assert!(html.contains("<svg") && html.ends_with("</html>\n"), "{name}");
        for wrong in ["NaN", "inf", "http:", "https:", "<script"] {
            assert!(!html.replace("info", "").contains(wrong), "{name}: {wrong}");
        }
        html
    }
}

fn succeeds(arguments: &[&str]) -> String {
    let (code, out, error) = north(arguments);
    assert_eq!(code, 0, "{arguments:?}: {error}");
    out
}

#[test]
fn a_fix_is_drawn_and_certified_live_and_from_its_recording() {
    let folder = Folder::new("pages-fix");
    let [campaign, live, certificate, again, of_recording] =
        ["campaign", "live.html", "certificate.html", "again.html", "of-recording.html"].map(|name| folder.path(name));
    let out = succeeds(&[
        "find",
        "--host",
        "--seed",
        "3",
        "--target",
        "30",
        "--unit",
        "gon",
        "--record",
        &campaign,
        "--report",
        &live,
        "--certificate",
        &certificate,
    ]);
    let azimuth = out.lines().find_map(|line| line.strip_prefix("azimuth    ")).unwrap();
    let said = azimuth.split(" ±").next().unwrap();
    assert!(folder.page("live.html").contains(said), "{said}");
    let page = folder.page("certificate.html");
    // The target's azimuth beside the mark's, and no doubt about who measured.
    assert!(page.contains(said) && page.contains("target") && page.contains("simulated instrument"));
    // The recording gives the same azimuth, and its certificate says nothing of a simulation.
    succeeds(&["solve", &campaign, "--unit", "gon", "--report", &again, "--certificate", &of_recording]);
    assert!(folder.page("again.html").contains(said));
    let page = folder.page("of-recording.html");
    assert!(page.contains(said) && !page.contains("simulated instrument"));
    // Nothing is overwritten unasked, and that is said before the work.
    let (code, _, error) = north(&["find", "--host", "--report", &live]);
    assert!(code != 0 && error.contains("--force"), "{error}");
}

#[test]
fn the_noise_is_drawn_with_its_parts() {
    let folder = Folder::new("pages-noise");
    // White noise in the rate from a linear congruential generator, 0.05 arcsec in a second.
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    };
    let rows: String = (1..=1200).map(|t| format!("{t},0,{}\n", 9.5 + 0.17 * uniform())).collect();
    let still = folder.path("still.csv");
    fs::write(&still, format!("t_s,index_deg,fog_arcsec\n{rows}")).unwrap();
    succeeds(&["characterise", &still, "--report", &folder.path("noise.html")]);
    let page = folder.page("noise.html");
    // White noise has one part, and its line is drawn; a ramp was not put in.
    assert!(page.contains("class=\"part walk\" d=\"M"), "no angle random walk");
    assert!(!page.contains("class=\"part ramp\" d=\"M1"), "a ramp");
}
