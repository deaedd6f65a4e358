//! Everything that can be set by a number or a word: name, unit, limits, meaning. The firmware checks by this table, `north settings
//! describe` prints it, and docs/settings.md is it.

use quantities::limits::Invalid;

use super::Settings;
use crate::earth::EARTH_RATE_DEG_H;

/// A number that can be set.
#[derive(Clone, Copy)]
pub struct Field {
    /// As it stands in a file of settings, dotted.
    pub name: &'static str,
    /// Both included.
    pub low: f64,
    pub high: f64,
    /// The limits in words.
    pub allowed: &'static str,
    /// None: it is not said, and holds what its meaning says then.
    pub value: fn(&Settings) -> Option<f64>,
}

/// What a person should know of a field; no board has it.
#[derive(Clone, Copy)]
pub struct Words {
    pub unit: &'static str,
    pub meaning: &'static str,
}

/// Something that is set by a word.
#[derive(Clone, Copy)]
pub struct Choice {
    pub name: &'static str,
    /// The words; the first is the default.
    pub allowed: &'static [&'static str],
    pub meaning: &'static str,
}

/// The words that can be set, in the order of the files; angles of a custom order are a list beside it.
pub const CHOICES: &[Choice] = &[
    Choice { name: "gyro.format", allowed: &["compact", "kvh-a"], meaning: "how the gyro's frames are written" },
    Choice {
        name: "gyro.configure",
        allowed: &["false", "true"],
        meaning: "whether the gyro (kvh-a) is told at the start, over its line, to send increments in radians at the instrument's pulses; no fix without its answer",
    },
    Choice {
        name: "index.hold_current",
        allowed: &["false", "true"],
        meaning: "whether the motor keeps its current through the dwells, or only while it turns",
    },
    Choice {
        name: "index.slip_ring",
        allowed: &["false", "true"],
        meaning: "whether the cable is led over a slip ring, so that the index may turn on and on; else it stays within its travel",
    },
    Choice {
        name: "index.limit_switch",
        allowed: &["false", "true"],
        meaning: "whether a switch that opens at the ends of the travel is wired to the limit input (PC9): where it is open the motor stops on the spot, and a fix ends with the fault index-limit",
    },
    Choice {
        name: "sequence.order",
        allowed: &["adaptive", "mirrored", "plain", "source", "east-west", "rotation", "custom"],
        meaning: "positions of the index and their order; adaptive: with accuracy_deg, the sigma of the azimuth that ends the fix, 0.001 to 10 (default 0.04); rotation: with passes to or fro, an even number, 2 to 120; custom: with angles",
    },
    Choice {
        name: "block.class",
        allowed: &["modern-mems", "source-mems", "source-fog", "ring-laser"],
        meaning: "what the block of three gyros is good for, where there is a group [block]; without it no block is read",
    },
    Choice {
        name: "link.nmea",
        allowed: &["false", "true"],
        meaning: "whether NMEA 0183 sentences (THS, HDT, PNOFF) go over the host's line each second, between the frames of the link",
    },
];

macro_rules! fields {
    ($($name:literal, $unit:literal, $low:literal to $high:literal, $value:expr, $meaning:literal;)*) => {
        /// The numbers, in the order of the files.
        pub const FIELDS: &[Field] = &[$(Field {
            name: $name,
            low: $low as f64,
            high: $high as f64,
            allowed: concat!($low, " to ", $high),
            value: |settings| {
                let value: fn(&Settings) -> _ = $value;
                value(settings).into()
            },
        }),*];

        /// The words of [`FIELDS`], in their order.
        pub const WORDS: &[Words] = &[$(Words { unit: $unit, meaning: $meaning }),*];
    };
}

fields! {
    "latitude_deg", "°", -90 to 90, |s| s.latitude_deg,
        "geodetic latitude, north positive; no fix within 1° of a pole";
    "gyro.arw_deg_per_sqrt_h", "°/√h", 0 to 1, |s| s.gyro.arw_deg_per_sqrt_h,
        "angle random walk of the gyro; the azimuth's sigma never falls below what it makes";
    "gyro.angle_noise_arcsec", "arcsec", 0 to 100, |s| s.gyro.angle_noise_arcsec,
        "white noise of the angle at one moment: counts, dither, a ring laser; every rate has it at both ends of its time";
    "gyro.bias_instability_deg_h", "°/h", 0 to 10, |s| s.gyro.bias_instability_deg_h,
        "bias instability, the floor of the Allan deviation";
    "gyro.drift_deg_h_per_h", "°/h per h", 0 to 1000, |s| s.gyro.drift_deg_h_per_h,
        "one sigma of the linear drift of the bias during a fix";
    "gyro.bias_limit_deg_h", "°/h", 0 to 1000, |s| s.gyro.bias_limit_deg_h,
        "largest bias that is left after the error model";
    "gyro.range_deg_h", "°/h", 100 to 10000000, |s| s.gyro.range_deg_h,
        "largest rate that the gyro can read";
    "gyro.repairable_frames", "frames", 0 to 40, |s| f64::from(s.gyro.repairable_frames),
        "most missing frames of a second of 400 that are made up for; with more it is left out";
    "level.limit_deg", "°", 0.001 to 10, |s| s.level.limit_deg,
        "pitch and roll must both lie within ± this before a fix";
    "level.sigma_deg", "°", 0 to 10, |s| s.level.sigma_deg,
        "one sigma of the level accelerometers; enters the azimuth's sigma by tan φ";
    "level.seconds", "s", 1 to 60, |s| f64::from(s.level.seconds),
        "for so long in a row it must be level";
    "level.timeout_s", "s", 1 to 36000, |s| s.level.timeout_s,
        "longest wait for that";
    "level.drift_mg_per_k", "mg/K", 0 to 100, |s| s.level.drift_mg_per_k,
        "one sigma of what the level accelerometers' readings change by with temperature, though the base stands still";
    "level.wander_mg_per_sqrt_h", "mg/√h", 0 to 100, |s| s.level.wander_mg_per_sqrt_h,
        "one sigma of what they wander by in an hour";
    "disturbance.threshold_deg_h", "°/h", 0 to 1000000, |s| s.disturbance.threshold_deg_h,
        "excess of the rate over Ω cos φ that counts as disturbed";
    "disturbance.seconds", "s", 1 to 600, |s| f64::from(s.disturbance.seconds),
        "seconds in a row that make the verdict";
    "disturbance.timeout_s", "s", 1 to 36000, |s| s.disturbance.timeout_s,
        "longest wait for an undisturbed base";
    "jitter.threshold_deg_h", "°/h", 0 to 1000000, |s| s.jitter.threshold_deg_h,
        "change of the rate from second to second that counts as jitter";
    "jitter.seconds", "s", 1 to 600, |s| f64::from(s.jitter.seconds),
        "seconds in a row that make the verdict";
    "jitter.timeout_s", "s", 1 to 36000, |s| s.jitter.timeout_s,
        "longest wait for rest after a move";
    "index.tolerance_deg", "°", 0.01 to 10, |s| s.index.tolerance_deg,
        "the encoder must show the commanded angle within ± this";
    "index.sigma_deg", "°", 0 to 10, |s| s.index.sigma_deg,
        "one sigma of the encoder at one position; enters the azimuth's sigma";
    "index.retries", "moves", 0 to 20, |s| f64::from(s.index.retries),
        "corrective moves before the angle counts as wrong";
    "index.speed_deg_s", "°/s", 0.1 to 30, |s| s.index.speed_deg_s,
        "fastest turning of the index";
    "index.acceleration_deg_s2", "°/s²", 1 to 1000, |s| s.index.acceleration_deg_s2,
        "acceleration of the index";
    "index.microsteps_per_turn", "microsteps", 200 to 1000000, |s| f64::from(s.index.microsteps_per_turn),
        "microsteps of the motor in one turn of the index: steps a turn, times microsteps a step, times the gear; times speed_deg_s/360 at most 3000";
    "index.travel_from_deg", "°", -180 to 0, |s| s.index.travel_from_deg,
        "where the travel begins, counter-clockwise from the mark; without a slip ring";
    "index.travel_deg", "°", 180 to 360, |s| s.index.travel_deg,
        "how far the travel goes from there; what lies in the gap of less than a turn is measured at the nearer end";
    "sequence.dwell_s", "s", 2 to 3600, |s| f64::from(s.sequence.dwell_s),
        "measuring time at each position, where the order is not adaptive";
    "sequence.coarse_dwell_s", "s", 2 to 3600, |s| f64::from(s.sequence.coarse_dwell_s),
        "measuring time at each of the four positions of the east-west order's coarse pass";
    "block.arw_deg_per_sqrt_h", "°/√h", 0.00001 to 100, |s| s.block?.arw_deg_per_sqrt_h,
        "angle random walk of the block's gyros, where it is not its class's";
    "block.bias_deg_h", "°/h", 0 to 100000, |s| s.block?.bias_deg_h,
        "one sigma of their bias from run to run, where it is not the class's";
    "block.scale_ppm", "ppm", 0 to 100000, |s| s.block?.scale_ppm,
        "one sigma of their scale factors, where it is not the class's";
    "block.range_deg_s", "°/s", 1 to 10000, |s| s.block?.range_deg_s,
        "rate at which they are saturated, where it is not the class's";
    "block.refix_sigma_deg", "°", 0.001 to 90, |s| s.block.map(|block| block.refix_sigma_deg),
        "beyond this sigma of the heading that is held a new fix is asked for; 0.5 where the group [block] does not say it";
    "analogue.supply_ratio", "1", 1 to 100, |s| s.analogue.supply_ratio,
        "supply voltage over the voltage behind its divider (PC4)";
    "analogue.first.zero_v", "V", -100 to 100, |s| s.analogue.first.map(|input| input.zero_v),
        "voltage at the first analogue input (PC0) at which it reads 0, where the input has a name; 0 where its group does not say it";
    "analogue.first.per_v", "1/V", -1000000 to 1000000, |s| s.analogue.first.map(|input| input.per_v),
        "what it reads by a volt, in its own unit; 1 where its group does not say it";
    "analogue.second.zero_v", "V", -100 to 100, |s| s.analogue.second.map(|input| input.zero_v),
        "voltage at the second analogue input (PC1) at which it reads 0, where the input has a name; 0 where its group does not say it";
    "analogue.second.per_v", "1/V", -1000000 to 1000000, |s| s.analogue.second.map(|input| input.per_v),
        "what it reads by a volt, in its own unit; 1 where its group does not say it";
    "analogue.third.zero_v", "V", -100 to 100, |s| s.analogue.third.map(|input| input.zero_v),
        "voltage at the third analogue input (PC2) at which it reads 0, where the input has a name; 0 where its group does not say it";
    "analogue.third.per_v", "1/V", -1000000 to 1000000, |s| s.analogue.third.map(|input| input.per_v),
        "what it reads by a volt, in its own unit; 1 where its group does not say it";
    "analogue.fourth.zero_v", "V", -100 to 100, |s| s.analogue.fourth.map(|input| input.zero_v),
        "voltage at the fourth analogue input (PC3) at which it reads 0, where the input has a name; 0 where its group does not say it";
    "analogue.fourth.per_v", "1/V", -1000000 to 1000000, |s| s.analogue.fourth.map(|input| input.per_v),
        "what it reads by a volt, in its own unit; 1 where its group does not say it";
    "time_limit_s", "s", 10 to 86400, |s| s.time_limit_s,
        "longest time from the start of a fix to its azimuth; an adaptive fix ends then with the sigma that it has";
}

impl Field {
    /// Whether its value is within its limits.
    fn violation(&self, settings: &Settings) -> Option<Invalid> {
        let value = (self.value)(settings)?;
        let Self { name: field, allowed, .. } = *self;
        (!(self.low..=self.high).contains(&value)).then_some(Invalid::new(field, value, allowed))
    }
}

/// Everything that is wrong with the numbers, each for itself and together.
///
/// A still gyro must pass the gates: its bias limit and five sigma of its one-second noise lie below the thresholds. And its
/// range lies above the Earth rate and the disturbance threshold. A fix has room for its dwells, and a wait for what it waits for.
pub fn violations(settings: &Settings) -> impl Iterator<Item = Invalid> + '_ {
    let noise_deg_h = settings.gyro.noise_deg_h();
    let together = [
        ("level.timeout_s", settings.level.timeout_s, settings.level.seconds.into(), "level.seconds"),
        (
            "disturbance.timeout_s",
            settings.disturbance.timeout_s,
            settings.disturbance.seconds.into(),
            "disturbance.seconds",
        ),
        (
            "jitter.timeout_s",
            settings.jitter.timeout_s,
            settings.jitter.seconds.saturating_add(1).into(),
            "jitter.seconds and the first, which has no change",
        ),
        (
            "disturbance.threshold_deg_h",
            settings.disturbance.threshold_deg_h,
            settings.gyro.bias_limit_deg_h + 5.0 * noise_deg_h,
            "the gyro's bias limit and five sigma of its 1 s noise",
        ),
        (
            "jitter.threshold_deg_h",
            settings.jitter.threshold_deg_h,
            5.0 * core::f64::consts::SQRT_2 * noise_deg_h,
            "five sigma of the gyro's 1 s differences",
        ),
        (
            "gyro.range_deg_h",
            settings.gyro.range_deg_h,
            EARTH_RATE_DEG_H + settings.disturbance.threshold_deg_h,
            "the Earth rate and the disturbance threshold",
        ),
        (
            "time_limit_s",
            settings.time_limit_s,
            settings.sequence.measuring_s(&settings.index),
            "the measuring time of the order",
        ),
    ];
    let together = together.into_iter().filter(|(_, value, least, _)| value < least);
    FIELDS
        .iter()
        .filter_map(|field| field.violation(settings))
        .chain(together.map(|(field, value, least, allowed)| Invalid { field, value, allowed, least: Some(least) }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fix::heading::settings::BlockSettings;

    #[test]
    fn the_defaults_are_allowed_and_every_number_has_words() {
        assert_eq!(violations(&Settings::default()).next(), None);
        assert_eq!(FIELDS.len(), WORDS.len());
        assert!(WORDS.iter().all(|words| !words.meaning.is_empty() && !words.unit.is_empty()));
        assert!(FIELDS.iter().all(|field| field.low < field.high));
    }

    #[test]
    fn all_violations_are_said_at_once_and_as_numbers() {
        let mut settings = Settings { latitude_deg: f64::NAN, ..Settings::default() };
        settings.level.seconds = 0;
        // 1 °/h and five times 60 · 0.01 °/h: 4 °/h; the threshold is 2. Jitter: 7.07 · 0.6 = 4.24; it is 3.
        settings.gyro.arw_deg_per_sqrt_h = 0.01;
        let found: std::vec::Vec<_> = violations(&settings).map(|invalid| std::format!("{invalid}")).collect();
        assert_eq!(
            found,
            [
                "latitude_deg = NaN: allowed is -90 to 90",
                "level.seconds = 0: allowed is 1 to 60",
                "disturbance.threshold_deg_h = 2: allowed is at least 4 (the gyro's bias limit and five sigma of its 1 s noise)",
                "jitter.threshold_deg_h = 3: allowed is at least 4.243 (five sigma of the gyro's 1 s differences)",
            ]
        );
    }

    #[test]
    fn a_block_is_checked_where_there_is_one() {
        let block = BlockSettings { range_deg_s: Some(f64::NAN), refix_sigma_deg: 0.0, ..BlockSettings::default() };
        let settings = Settings { block: Some(block), ..Settings::default() };
        let found: std::vec::Vec<_> = violations(&settings).map(|invalid| invalid.field).collect();
        assert_eq!(found, ["block.range_deg_s", "block.refix_sigma_deg"]);
    }
}
