//! The built-in scenarios, compiled in from `scenarios/`.

use super::Scenario;
use std::sync::LazyLock;

macro_rules! built_in {
    ($($name:literal),* $(,)?) => {
        /// Name and text, the default first.
        const FILES: &[(&str, &str)] = &[$(($name, include_str!(concat!("../../scenarios/", $name, ".toml")))),*];
    };
}

built_in![
    "calm-bench",
    "windy-tripod",
    "shocks-during-dwell",
    "disturbed-start",
    "always-disturbed",
    "jittery-drive",
    "endless-jitter",
    "creep",
    "warm-up",
    "lossy-link",
    "noisy-link",
    "stalled-motor",
    "wrong-angle",
    "lost-steps",
    "slipping-encoder",
    "slipping-spindle",
    "hard-stop",
    "backlash",
    "magnet-in-base",
    "unshielded-coil",
    "dead-zone",
    "southern-site",
    "near-pole",
    "not-level",
    "levelled-late",
    "slow-start",
    "gyro-silent",
    "gyro-invalid",
    "gyro-saturated",
    "gyro-stuck",
    "gyro-clock",
    "stuck-encoder",
    "stuck-accelerometer",
    "broken-bus",
    "drift",
    "after-move",
    "air-conditioning",
    "tired-battery",
    "intermittent",
    "uncalibrated",
    "kvh-gyro",
    "kvh-by-command",
    "kvh-rates",
    "kvh-deaf",
    "vehicle",
    "worn-accelerometers",
    "warming-accelerometers",
    "warming-on-creep",
    "carried",
];

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
