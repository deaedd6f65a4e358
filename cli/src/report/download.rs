//! The numbers behind a figure, as a file to download that is a part of the page itself.

use std::fmt::Write;

use super::html::escape;

/// A link that gives a CSV file with these columns; values that are not numbers stay empty.
pub fn csv(name: &str, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut text = head.join(",");
    for row in rows {
        let quoted: Vec<String> = row.iter().map(|cell| quote(cell)).collect();
        let _ = write!(text, "\n{}", quoted.join(","));
    }
    file(name, "text/csv", &(text + "\n"))
}

/// A link that gives a file with this text.
pub fn file(name: &str, kind: &str, text: &str) -> String {
    let mut encoded = String::with_capacity(text.len());
    for byte in text.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b',' | b'/' | b':' => {
                encoded.push(char::from(byte));
            }
            _ => {
                let _ = write!(encoded, "%{byte:02X}");
            }
        }
    }
    format!(" <a download=\"{}\" href=\"data:{kind};charset=utf-8,{encoded}\">{}</a>", escape(name), escape(name))
}

/// A number with nine digits where it needs them, nothing where it is none.
pub fn cell(value: f64) -> String {
    let rounded = format!("{value:.8e}").parse::<f64>();
    rounded.ok().filter(|value| value.is_finite()).map_or_else(String::new, |value| value.to_string())
}

fn quote(cell: &str) -> String {
    if cell.contains([',', '"', '\n']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_the_page() {
        let link = csv("a.csv", &["run", "x"], [vec!["a,b".into(), cell(f64::NAN)], vec!["c".into(), cell(-1.25)]]);
        assert!(link.contains("download=\"a.csv\""));
        assert!(link.contains("run,x%0A%22a,b%22,%0Ac,-1.25%0A\""), "{link}");
    }

    #[test]
    fn small_numbers_keep_their_digits() {
        assert_eq!([cell(1.234_567_891_23e-7), cell(1234.5), cell(0.1 + 0.2)], ["0.000000123456789", "1234.5", "0.3"]);
    }
}
