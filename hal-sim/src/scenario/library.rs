//! The built-in scenarios, compiled in from `scenarios/`.

use super::Scenario;
use std::sync::LazyLock;

macro_rules! built_in {
    ($($name:literal),* $(,)?) => {
        /// Name and text, the default first.
        const FILES: &[(&str, &str)] = &[$(($name, include_str!(concat!("../../scenarios/", $name, ".toml")))),*];
    };
}

built_in!["calm-bench",];

/// Descriptions, in the order of [`FILES`].
static DESCRIPTIONS: LazyLock<Vec<String>> = LazyLock::new(|| {
    FILES
        .iter()
        .map(|(name, text)| Scenario::parse(text, name).map_or_else(|error| error.to_string(), |s| s.description))
        .collect()
});

/// The text of a built-in scenario.
pub fn text_of(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Name and description of each.
pub fn names() -> impl Iterator<Item = (&'static str, &'static str)> {
    FILES.iter().zip(DESCRIPTIONS.iter()).map(|((name, _), description)| (*name, description.as_str()))
}
