//! Figures of README and docs against the files that named commands write (`make figures`): a comment before a paragraph says where each is from,
//!
//!     <!-- figures NAME.json: path.to.value = 12.3, other.0.value = 4.5 -->
//!
//! Each figure stands in the paragraph below as it is written there, and is the file's value with as many decimals; `path.to.share ×100` is a share in
//! percent. With NORTH_FIGURES=write the documents take what the files say.
//!
//!     <!-- table NAME.md 0 -->
//!
//! The table that follows is the first of docs/figures/NAME.md, which holds what the command printed; with `columns 0 2 3` before the end these of its columns.

use std::fs;
use std::iter;
use std::path::{Path, PathBuf};

use serde_json::Value;

const MARK: &str = "<!-- figures ";
const TABLE_MARK: &str = "<!-- table ";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// README and all of docs.
fn documents() -> Vec<PathBuf> {
    let pages = fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let mut all: Vec<PathBuf> = pages.filter(|path| path.extension().is_some_and(|end| end == "md")).collect();
    all.push(root().join("README.md"));
    all.sort();
    all
}

/// The number at a path such as `runs.1.sigma_after_deg`, or a hundred times that of `rows.0.coverage ×100`.
fn value(of: &Value, path: &str) -> Option<f64> {
    if let Some((share, "100")) = path.split_once(" ×") {
        return value(of, share).map(|share| 100.0 * share);
    }
    let step = |value: Option<&Value>, key: &str| -> Option<Value> {
        match key.parse::<usize>() {
            Ok(place) => value?.get(place).cloned(),
            Err(_) => value?.get(key).cloned(),
        }
    };
    path.split('.').try_fold(of.clone(), |value, key| step(Some(&value), key))?.as_f64()
}

/// The value with as many decimals as the text has, and its sign where the text has one.
fn like(value: f64, text: &str) -> String {
    let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    if text.starts_with('+') { format!("{value:+.decimals$}") } else { format!("{value:.decimals$}") }
}

/// Where a figure stands in a text, by itself and not as a part of another number.
fn find(text: &str, figure: &str, from: usize) -> Option<usize> {
    let part = |character: Option<char>| character.is_some_and(|each| each.is_ascii_digit() || each == '.');
    let alone = |at: &usize| {
        let (before, after) = (text[..*at].chars().next_back(), text[at + figure.len()..].chars().next());
        !part(before) && !after.is_some_and(|each| each.is_ascii_digit())
    };
    text[from..].match_indices(figure).map(|(at, _)| from + at).find(alone)
}

/// One document as its files say it, and what differs.
fn as_the_files_say(document: &str, read: &dyn Fn(&str) -> Value) -> (String, Vec<String>) {
    let mut differences = Vec::new();
    let mut of_paragraph = |paragraph: &str| -> String {
        let Some(begin) = paragraph.find(MARK) else { return paragraph.to_owned() };
        let end = paragraph.rfind("-->").expect("a comment ends");
        let (mut marks, mut text) = (String::new(), paragraph[end..].to_owned());
        for mark in paragraph[begin..end].split(MARK).skip(1) {
            let (file, figures) = mark.split_once(':').expect("a file, a colon, figures");
            let (figures, rest) = figures.split_once("-->").unwrap_or((figures, ""));
            let (found, mut from, mut written) = (read(file), 0, Vec::new());
            for figure in figures.split(',') {
                let (path, said) = figure.split_once('=').expect("a path, an equals sign, a figure");
                let (path, said) = (path.trim(), said.trim());
                let now = value(&found, path).map_or_else(|| "missing".to_owned(), |value| like(value, said));
                if now != said {
                    differences.push(format!("{file} {path}: the document has {said}, the file {now}"));
                }
                match find(&text, said, from) {
                    Some(at) => {
                        text.replace_range(at..at + said.len(), &now);
                        from = at + now.len();
                    }
                    None => {
                        differences.push(format!("{file} {path}: {said} does not stand in the paragraph in its turn"))
                    }
                }
                written.push(format!("{path} = {now}"));
            }
            let closed = if rest.is_empty() { String::new() } else { format!("-->{rest}") };
            marks += &format!("{MARK}{file}: {} {closed}", written.join(", "));
        }
        format!("{}{marks}{text}", &paragraph[..begin])
    };
    let written: Vec<String> = document.split("\n\n").map(&mut of_paragraph).collect();
    (written.join("\n\n"), differences)
}

/// The tables of a text, each a row of lines that begin with a bar.
fn tables(text: &str) -> Vec<Vec<&str>> {
    let lines: Vec<&str> = text.lines().collect();
    let is_row = |line: &&str| line.starts_with('|');
    lines.chunk_by(|a, b| is_row(a) == is_row(b)).filter(|lines| is_row(&lines[0])).map(<[&str]>::to_vec).collect()
}

/// These columns of a row.
fn with_columns(row: &str, columns: &[usize]) -> String {
    let cells: Vec<&str> = row.trim_matches('|').split('|').collect();
    columns.iter().map(|&column| format!("|{}", cells.get(column).unwrap_or(&""))).collect::<String>() + "|"
}

/// One document with the tables that its files hold, and what differs.
fn with_tables_of_files(document: &str, read: &dyn Fn(&str) -> String) -> (String, Vec<String>) {
    let (mut lines, mut differences) = (document.lines().peekable(), Vec::new());
    let mut written: Vec<String> = Vec::new();
    while let Some(line) = lines.next() {
        written.push(line.to_owned());
        let Some(mark) = line.strip_prefix(TABLE_MARK) else { continue };
        let (table, columns) = match mark.trim_end_matches("-->").split_once(" columns ") {
            Some((table, columns)) => (table, columns.split_whitespace().map(|each| each.parse().unwrap()).collect()),
            None => (mark.trim_end_matches("-->"), Vec::new()),
        };
        let (file, number) = table.trim().split_once(' ').expect("a file and a number");
        written.extend(iter::from_fn(|| lines.next_if(|line| line.is_empty())).map(str::to_owned));
        let shown: Vec<&str> = iter::from_fn(|| lines.next_if(|line| line.starts_with('|'))).collect();
        let text = read(file);
        let of_file = number.parse().ok().and_then(|number: usize| tables(&text).into_iter().nth(number));
        let chosen = |row: &str| if columns.is_empty() { row.to_owned() } else { with_columns(row, &columns) };
        let of_file: Vec<String> = of_file.unwrap_or_default().into_iter().map(chosen).collect();
        if of_file != shown {
            let unlike = of_file.iter().zip(&shown).find(|(a, b)| a != b);
            differences.push(format!("{file} {number}: {unlike:?} of {} and {} lines", of_file.len(), shown.len()));
        }
        written.extend(of_file);
    }
    (written.join("\n") + "\n", differences)
}

#[test]
fn documents_hold_the_figures_of_their_files() {
    let text_of = |file: &str| -> String {
        let path = root().join("docs/figures").join(file);
        fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let read = |file: &str| -> Value { serde_json::from_str(&text_of(file)).unwrap() };
    let write = std::env::var("NORTH_FIGURES").is_ok_and(|what| what == "write");
    let mut differences = Vec::new();
    let mut figures = 0;
    for path in documents() {
        let text = fs::read_to_string(&path).unwrap();
        figures += text.matches(MARK).count();
        let (written, mut found) = as_the_files_say(&text, &read);
        let (written, unlike) = with_tables_of_files(&written, &text_of);
        found.extend(unlike);
        if write && written != text {
            fs::write(&path, written).unwrap();
        } else {
            differences.extend(found.into_iter().map(|each| format!("{}: {each}", path.display())));
        }
    }
    assert!(figures > 0 && differences.is_empty(), "{}", differences.join("\n"));
}

#[test]
fn every_file_of_figures_has_its_command() {
    let script = fs::read_to_string(root().join("scripts/figures.sh")).unwrap();
    for entry in fs::read_dir(root().join("docs/figures")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let bench = name.split_once('.').map(|(stem, _)| format!("\nbench {stem} "));
        let has_command = script.contains(&name) || bench.is_some_and(|bench| script.contains(&bench));
        assert!(has_command, "no command of scripts/figures.sh writes docs/figures/{name}");
    }
}

#[test]
fn a_figure_that_differs_is_found_and_written() {
    let text = "one\n\n<!-- figures a.json: x = 0.10, list.1 = +2 -->\n<!-- figures b.json: x = 7, x ×100 = 700 -->\nIt is 10.10, 0.10 and +2 of +2, of 7, of 700.\n\nend";
    let read = |file: &str| match file {
        "a.json" => serde_json::json!({"x": 0.1234, "list": [1, 3]}),
        _ => serde_json::json!({"x": 7.2}),
    };
    let (written, differences) = as_the_files_say(text, &read);
    let expected = "one\n\n<!-- figures a.json: x = 0.12, list.1 = +3 -->\n<!-- figures b.json: x = 7, x ×100 = 720 -->\nIt is 10.10, 0.12 and +3 of +2, of 7, of 720.\n\nend";
    assert_eq!(written, expected);
    assert_eq!(differences.len(), 3, "{differences:?}");
    assert_eq!(as_the_files_say(&written, &read), (written.clone(), Vec::new()));
}

#[test]
fn a_table_that_differs_is_found_and_written() {
    let file = "# made\n\n| x |\n|---|\n| 1 |\n\n| y |\n|---|\n| 2 |\n| 3 |\n";
    let document = "one\n\n<!-- table a.md 1 -->\n\n| y |\n|---|\n| 7 |\n\ntwo\n";
    let (written, differences) = with_tables_of_files(document, &|_| file.to_owned());
    assert_eq!(written, "one\n\n<!-- table a.md 1 -->\n\n| y |\n|---|\n| 2 |\n| 3 |\n\ntwo\n");
    assert_eq!(differences.len(), 1, "{differences:?}");
    assert_eq!(with_tables_of_files(&written, &|_| file.to_owned()), (written.clone(), Vec::new()));
    assert_eq!(with_tables_of_files(&document.replace("md 1", "md 2"), &|_| file.to_owned()).1.len(), 1);
    let wide = "| x | y | z |\n|---|---|---|\n| 1 | 2 | 3 |\n";
    let (written, _) = with_tables_of_files("<!-- table a.md 0 columns 0 2 -->\n", &|_| wide.to_owned());
    assert_eq!(written, "<!-- table a.md 0 columns 0 2 -->\n| x | z |\n|---|---|\n| 1 | 3 |\n");
}
