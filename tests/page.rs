//! The page in a real browser: it finds north, and it is the host engine's north.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::common::{fix, run, setup};

const TARGET: &str = "wasm32-unknown-unknown";
const BROWSERS: [&str; 4] = ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"];

/// Browser and page, if this machine can have both; says in one line why not.
fn browser_and_page() -> Option<(&'static str, &'static Path)> {
    static FOUND: OnceLock<Option<(&str, PathBuf)>> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let answers = |browser: &&str| Command::new(browser).arg("--version").output().is_ok();
        let Some(browser) = BROWSERS.into_iter().find(answers) else {
            eprintln!("skipped: no browser ({})", BROWSERS.join(", "));
            return None;
        };
        let root = Command::new("rustc").args(["--print", "sysroot"]).output().unwrap().stdout;
        if !Path::new(String::from_utf8(root).unwrap().trim()).join("lib/rustlib").join(TARGET).is_dir() {
            eprintln!("skipped: the Rust target {TARGET} is not installed (make page installs it)");
            return None;
        }
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("page");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/page.sh");
        assert!(Command::new(script).arg(&folder).status().unwrap().success(), "the page is not built");
        Some((browser, folder))
    });
    found.as_ref().map(|(browser, folder)| (*browser, folder.as_path()))
}

/// How often a page is opened that the browser printed before it had begun: it does not wait for what it still compiles on a busy machine.
const OPENED: usize = 5;

/// The attributes of the page's body when the fix that the address asks for has ended: state, azimuth, sigma, words.
fn shown(asked: &str) -> Option<[String; 4]> {
    let (browser, folder) = browser_and_page()?;
    let address = format!("file://{}#start&once&{asked}", folder.join("index.html").display());
    let body = (0..OPENED).map(|_| printed_body(browser, &address)).find(|body| body.contains("data-state"));
    let body = body.unwrap_or_else(|| panic!("{asked}: the page has not begun"));
    let attribute = |name: &str| {
        let value = body.split_once(&format!("data-{name}=\"")).and_then(|(_, rest)| rest.split_once('"'));
        value.unwrap_or_else(|| panic!("{asked}: no {name} in <body{body}>")).0.to_owned()
    };
    Some(["state", "azimuth", "sigma", "words"].map(attribute))
}

/// The attributes of the body of a page, as the browser prints it when it has come to rest.
fn printed_body(browser: &str, address: &str) -> String {
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--virtual-time-budget=5000"])
        .args(["--dump-dom", address])
        .output()
        .unwrap();
    let complaints = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!complaints.contains(":CONSOLE"), "{complaints}");
    let page = String::from_utf8(output.stdout).unwrap();
    page.split_once("<body").and_then(|(_, rest)| rest.split_once('>')).unwrap().0.to_owned()
}

#[test]
fn the_page_finds_the_host_engines_north_with_all_bits() {
    for (scenario, seed) in [("calm-bench", 1), ("windy-tripod", 7), ("lossy-link", 3)] {
        let asked = format!("scenario={scenario}&seed={seed}&order=mirrored");
        let Some([state, azimuth, sigma, words]) = shown(&asked) else { return };
        let (fix, _) = fix(&run(&setup(scenario, seed)).0);
        let flags: Vec<_> = fix.flags.iter().map(|flag| flag.name()).collect();
        assert_eq!((state.as_str(), words), ("finished", flags.join(" ")), "{scenario}");
        assert_eq!(azimuth.parse::<f64>().unwrap().to_bits(), fix.azimuth_deg.to_bits(), "{scenario}");
        assert_eq!(sigma.parse::<f64>().unwrap().to_bits(), fix.sigma_deg.to_bits(), "{scenario}");
    }
}

#[test]
fn a_shock_during_a_dwell_is_flagged() {
    let Some([_, _, _, still]) = shown("seed=1&order=mirrored") else { return };
    let [state, azimuth, _, words] = shown("seed=1&order=mirrored&shock=60:600").unwrap();
    assert_eq!((still.as_str(), state.as_str()), ("", "finished"));
    assert!(words.split(' ').any(|word| word == "shock"), "{words}");
    assert!(!azimuth.is_empty());
}

#[test]
fn a_refusal_is_shown_with_its_fault() {
    let Some([state, azimuth, _, words]) = shown("scenario=always-disturbed") else { return };
    assert_eq!((state.as_str(), azimuth.as_str(), words.as_str()), ("failed", "", "disturbed-too-long"));
}

/// What the page is made of must be in the folder, and nothing may be fetched from elsewhere.
#[test]
fn the_page_needs_nothing_but_its_folder() {
    let Some((_, folder)) = browser_and_page() else { return };
    for name in ["index.html", "style.css", "page.js", "chart.js", "instrument.js", "wasm.js"] {
        let text = fs::read_to_string(folder.join(name)).unwrap();
        let elsewhere = text.replace("http://www.w3.org/2000/svg", "");
        assert!(!elsewhere.contains("http:") && !elsewhere.contains("https:"), "{name}");
    }
}
