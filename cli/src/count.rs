//! Counts in sentences.

use std::fmt::Display;

/// A count with its noun: 1 gap, 2 gaps, 3 fixes.
pub fn counted(count: impl Display, noun: &str) -> String {
    let count = count.to_string();
    let ending = match count.as_str() {
        "1" => "",
        _ if noun.ends_with('x') => "es",
        _ => "s",
    };
    format!("{count} {noun}{ending}")
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn one_is_singular_and_none_is_plural() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "gap")), ["0 gaps", "1 gap", "2 gaps"]);
        assert_eq!([1, 100].map(|count| counted(count, "fix")), ["1 fix", "100 fixes"]);
        assert_eq!(counted(2, "switch-on"), "2 switch-ons");
    }
}
