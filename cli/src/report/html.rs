//! Text for the page: escaping, numbers, names of units.

use std::fmt::Write;

use crate::diagnose::statistics::is_below_numbers;

/// Text as it may stand in HTML, in attributes too.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            letter => escaped.push(letter),
        }
    }
    escaped
}

/// A number for a person: so many significant digits, a true minus sign, powers of ten where they are shorter.
pub fn number(value: f64, significant: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let power = value.abs().log10().floor() as i32;
    if !(-4..6).contains(&power) {
        let text = format!("{value:.*e}", significant.saturating_sub(1));
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}·10{}", minus(mantissa), raised(exponent));
    }
    let decimals = (significant as i32 - 1 - power).max(0) as usize;
    minus(&format!("{value:.decimals$}"))
}

/// A number that was set, not measured: as few digits as it needs, four decimals at most.
pub fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { minus(text) }
}

/// A value and its sigma: the sigma with two digits, the value with as many decimals.
pub fn with_sigma(value: f64, sigma: Option<f64>) -> String {
    let Some(sigma) = sigma.filter(|sigma| sigma.is_finite() && *sigma > 0.0) else { return number(value, 4) };
    let power = sigma.log10().floor() as i32;
    if !(-6..4).contains(&power) {
        return format!("{} ± {}", number(value, 4), number(sigma, 2));
    }
    let decimals = (1 - power).max(0) as usize;
    format!("{} ± {sigma:.decimals$}", minus(&format!("{value:.decimals$}")))
}

/// A probability, as HTML; small ones as a bound would only hide how small they are.
pub fn probability(p: f64) -> String {
    match p {
        p if p >= 0.001 => format!("{p:.3}"),
        p if is_below_numbers(p) => "&lt; 10⁻³⁰⁰".into(),
        p => number(p, 1),
    }
}

/// The same as a statement: "p = 0.012", "p < 10⁻³⁰⁰".
pub fn p_value(p: f64) -> String {
    format!("p {}{}", if is_below_numbers(p) { "" } else { "= " }, probability(p))
}

/// A number that stands out, with its name and a note.
pub fn tile(name: &str, value: &str, note: &str) -> String {
    format!("<div class=\"tile\"><span>{name}</span><b>{value}</b><small>{note}</small></div>\n")
}

/// A list in words, with code formatting.
pub fn code_list(names: &[String]) -> String {
    names.iter().map(|name| format!("<code>{}</code>", escape(name))).collect::<Vec<_>>().join(", ")
}

/// An HTML table; where a narrow screen stacks its cells, each is named by its column, if that has a name.
pub fn table(head: &[(&str, bool)], rows: &[Vec<String>]) -> String {
    let mut html = String::from("<table class=\"stack\"><thead><tr>");
    for (name, numeric) in head {
        let _ = write!(html, "<th{}>{name}</th>", if *numeric { " class=\"n\"" } else { "" });
    }
    html.push_str("</tr></thead><tbody>\n");
    for row in rows {
        html.push_str("<tr>");
        for (sample, (name, numeric)) in row.iter().zip(head) {
            let class = if *numeric { " class=\"n\"" } else { "" };
            let name = if name.is_empty() { String::new() } else { format!(" data-name=\"{name}\"") };
            let _ = write!(html, "<td{class}{name}>{sample}</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table>\n");
    html
}

fn minus(text: &str) -> String {
    text.replace('-', "−")
}

fn raised(exponent: &str) -> String {
    let raise = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    exponent.chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_a_person() {
        assert_eq!(number(-0.012345, 3), "−0.0123");
        assert_eq!(number(1234.5, 2), "1234");
        assert_eq!(number(1.5e-9, 2), "1.5·10⁻⁹");
        assert_eq!(number(0.0, 3), "0");
        assert_eq!(number(f64::NAN, 3), "–");
        assert_eq!([0.0, 90.0, -12.5, 90.60001].map(short), ["0", "90", "−12.5", "90.6"]);
        assert_eq!(with_sigma(9.1234, Some(0.213)), "9.12 ± 0.21");
        assert_eq!(with_sigma(-912.34, Some(21.3)), "−912 ± 21");
        assert_eq!(with_sigma(9.1234, None), "9.123");
    }

    #[test]
    fn nothing_escapes() {
        assert_eq!(escape("<b a=\"x\">&'"), "&lt;b a=&quot;x&quot;&gt;&amp;&#39;");
    }
}
