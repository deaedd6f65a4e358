//! Every number that the diagnosis and its effects decide by stands in docs/constants.md, with where it comes from.

use std::fs;
use std::path::Path;

/// Rooms whose constants are listed.
const ROOMS: [&str; 3] = ["src/effects", "learn/src", "cli/src/diagnose"];
/// Fewer constants than this may decide.
const MOST: usize = 60;

/// A named number: file, name, value as it is written.
type Number = (String, String, String);

/// The numbers of a line: `const NAME: f64 = VALUE;`.
fn number(line: &str) -> Option<(&str, &str)> {
    let declared = line.trim_start();
    let declared = declared.strip_prefix("pub").map_or(declared, |rest| rest.split_once(' ').map_or(rest, |two| two.1));
    let (name, rest) = declared.strip_prefix("const ")?.split_once(": ")?;
    let (kind, value) = rest.split_once(" = ")?;
    let is_number = ["f32", "f64", "u8", "u32", "usize"].contains(&kind) || kind.starts_with("[f64;");
    is_number.then_some((name, value.strip_suffix(';')?))
}

fn numbers(top: &Path, folder: &Path, found: &mut Vec<Number>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            numbers(top, &path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs")
            && path.file_name().is_some_and(|name| name != "tests.rs")
        {
            let text = fs::read_to_string(&path).unwrap();
            let file = path.strip_prefix(top).unwrap().to_str().unwrap().to_owned();
            let code = text.lines().take_while(|line| !line.starts_with("#[cfg(test)]"));
            found
                .extend(code.filter_map(number).map(|(name, value)| (file.clone(), name.to_owned(), value.to_owned())));
        }
    }
}

#[test]
fn every_number_that_decides_has_its_reason() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let page = fs::read_to_string(top.join("docs/constants.md")).unwrap();
    let mut found = Vec::new();
    ROOMS.iter().for_each(|room| numbers(top, &top.join(room), &mut found));
    let decides = |(file, name, value): &Number| page.contains(&format!("| `{name}` | {value} | {file} | "));
    let is_listed = |(file, name, value): &Number| {
        let row = page.lines().find(|line| line.starts_with(&format!("| {file} | ")));
        row.is_some_and(|row| row.contains(&format!("`{name}` {value}")))
    };
    let missing: Vec<&Number> = found.iter().filter(|each| !decides(each) && !is_listed(each)).collect();
    assert!(missing.is_empty(), "docs/constants.md lacks {missing:#?}");
    let count = found.iter().filter(|each| decides(each)).count();
    assert!(page.contains(&format!("{count} numbers decide.")), "{count} numbers decide");
    assert!(count < MOST, "{count} numbers decide, of {MOST} at most");
    let rows = page.lines().filter(|line| line.starts_with("| `")).count();
    assert_eq!(rows, count, "docs/constants.md lists numbers that are no more");
}

/// By hand: a number with its value, and what is none.
#[test]
fn numbers_are_recognised() {
    assert_eq!(number("    pub(super) const LEVEL: f64 = 1e-3;"), Some(("LEVEL", "1e-3")));
    assert_eq!(number("const SHARES: [f64; 2] = [0.1, 0.2];"), Some(("SHARES", "[0.1, 0.2]")));
    assert_eq!(number("pub const NAME: &str = \"temp_c\";"), None);
    assert_eq!(number("pub const fn one() -> f64 {"), None);
}
