//! Every fault with its stable code, every doubt about an azimuth with its stable name, every counter.

use serde::{Deserialize, Serialize};

/// Declares an enum of stable codes: each with its number, its lower-case name, what it means and what to do about it. The
/// firmware, the monitor, the JSON and the documentation read the same table.
macro_rules! codes {
    ($(#[$outer:meta])* $kind:ident { $($variant:ident = $code:literal, $name:literal, $meaning:literal, $remedy:literal;)* }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $kind {
            $(#[doc = $meaning] $variant = $code,)*
        }

        impl $kind {
            /// All of them, by rising code.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// Number, stable: it is on the link and in the manual.
            pub fn code(self) -> u8 {
                self as u8
            }

            /// Lower-case name, stable: files and tools depend on it.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// What it means, for a person.
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$variant => $meaning,)* }
            }

            /// What a person can do about it.
            pub fn remedy(self) -> &'static str {
                match self { $(Self::$variant => $remedy,)* }
            }
        }
    };
}

codes! {
    /// What ends a fix without an azimuth.
    Fault {
        SettingsMissing = 1, "settings-missing",
            "no settings are stored: the latitude is not known",
            "load the settings, with the latitude of the site";
        SettingsCorrupt = 2, "settings-corrupt",
            "the stored settings fail their check",
            "load the settings again; if it happens twice, the flash is worn: replace the board";
        SettingsInvalid = 3, "settings-invalid",
            "the stored settings make no sense together",
            "correct the values that are named and load the settings again";
        NearPole = 4, "near-pole",
            "within 1 degree of a pole there is no horizontal Earth rate to find north by",
            "use another method at this latitude; if the instrument is elsewhere, correct the latitude";
        NotLevel = 10, "not-level-in-time",
            "the instrument was not levelled in time",
            "level it until pitch and roll are inside the limit, then start again";
        Disturbed = 11, "disturbed-too-long",
            "the base did not come to rest before the time limit of the disturbance gate",
            "stop engines, keep away from the tripod, shield it from wind; if the base is still, the gyro's bias is beyond its declared limit";
        Jitter = 12, "jitter-too-long",
            "the rate did not come to rest after a move before the time limit of the jitter gate",
            "look for vibration; if the base is still, the jitter threshold is too small for this gyro: take it from a still recording";
        LevelLost = 13, "level-lost",
            "the instrument left the level limit while measuring",
            "set the tripod on firm ground, level again and start again";
        MotorStall = 20, "motor-stall",
            "the encoder does not follow the motor",
            "free the spindle and its cable, check motor supply and coupling";
        WrongAngle = 21, "wrong-angle",
            "the encoder shows another angle than the commanded one after all retries",
            "check the coupling between motor, spindle and encoder, and the angle tolerance";
        EncoderFailed = 22, "encoder-failed",
            "the encoder gives no valid or no changing reading",
            "check the encoder's cable, supply and magnet";
        AccelerometerFailed = 23, "accelerometer-failed",
            "the accelerometer gives no valid or no changing reading",
            "check the accelerometer's cable and supply";
        IndexLimit = 24, "index-limit",
            "the limit switch of the index is open: the spindle ran beyond its travel, or the switch's wire is off",
            "turn the spindle off the switch by hand; then check the switch's wire, index.travel_from_deg and index.travel_deg";
        GyroSilent = 30, "gyro-silent",
            "no frame comes from the gyro",
            "check the gyro's supply, cable, baud rate and frame format";
        GyroInvalid = 31, "gyro-invalid",
            "the gyro declares its data invalid",
            "let the gyro warm up; if it goes on, the gyro needs service";
        GyroSaturated = 32, "gyro-saturated",
            "the gyro's rate is beyond its range",
            "keep the instrument still; if it is still, check the declared range and the frame format";
        GyroClock = 33, "gyro-clock",
            "the gyro does not send 400 frames a second by the instrument's clock",
            "check that the gyro is triggered by the instrument, or set its output rate to 400 Hz";
        LinkPoor = 34, "gyro-link-poor",
            "too many seconds in a row lost too many frames",
            "check the gyro's cable, its screen and its ground";
        GyroStuck = 35, "gyro-stuck",
            "the gyro repeats the same increment",
            "switch the gyro off and on; if it goes on, the gyro needs service";
        GyroUnits = 36, "gyro-units",
            "the gyro tells a steady rate by which the base would have tilted, and the level accelerometers see no tilt",
            "set the gyro to increments of angle in radians (gyro.configure does it over the gyro's line); else its bias is far beyond its limit";
        GyroUnanswered = 37, "gyro-unanswered",
            "the gyro did not repeat what it was told at the start: what its frames hold is not known",
            "check the wires from the instrument to the gyro and its supply, then switch off and on; or set the gyro by hand and gyro.configure to false";
        OutOfTime = 40, "out-of-time",
            "the fix took longer than its time limit",
            "remove what disturbs it, or allow more time";
        Aborted = 41, "aborted",
            "stopped by command",
            "start again when ready";
        Unsolvable = 42, "unsolvable",
            "the gyro was at rest in too few directions",
            "start again; if it happens again, check the drive and the encoder";
        NoEarthRate = 43, "no-earth-rate",
            "Earth rate was not detected above the noise",
            "find what shakes or turns the base, a drive that rings or the wind; if the base stood still, check the gyro";
        NotEarthRate = 44, "not-earth-rate",
            "the horizontal rate is not the Earth's, whatever scale factor and latitude error are granted",
            "see that nothing turns the base while it measures; then check the latitude and the gyro's scale factor";
    }
}

codes! {
    /// A doubt that an azimuth carries. The code is also its bit in [`Flags`].
    Flag {
        Uncalibrated = 0, "uncalibrated",
            "no error model from a calibration is stored",
            "calibrate, or take the azimuth with the gyro's declared errors in mind";
        Disturbed = 1, "disturbed",
            "the disturbance gate had to wait for the base to come to rest",
            "nothing, if it was a passing disturbance; else find its source";
        Jitter = 2, "jitter",
            "the jitter gate had to wait after a move",
            "nothing, if it is rare; else look for a loose drive or for wind";
        Shock = 3, "shock",
            "seconds were left out of the solution because the rate jumped in them",
            "keep away from the tripod while it measures";
        FramesLost = 4, "frames-lost",
            "seconds were repaired or left out because gyro frames were lost",
            "check the gyro's cable";
        BaseMotion = 5, "base-motion",
            "the base turned while measuring; what the accelerometers saw of it was taken out",
            "set the tripod on firm ground and let it settle before a fix that must be as good as possible";
        Drift = 6, "drift",
            "the bias drifted more than declared; the drift was estimated",
            "let the gyro warm up; a drift that the settings declare (gyro.drift_deg_h_per_h) is no flag";
        Misfit = 7, "misfit",
            "the rates do not fit the Earth's rotation within their noise",
            "repeat the fix; if it stays, record a campaign and diagnose it";
        Amplitude = 8, "amplitude",
            "the horizontal rate is not that of the Earth at this latitude",
            "check the latitude and the gyro's scale factor";
        TiltUnknown = 9, "tilt-unknown",
            "the tilt was not measured and is taken as zero",
            "level by the bubble, or add level accelerometers";
        Noisy = 10, "noisy",
            "the scatter is well above the declared noise",
            "look for vibration; if the base is still, declare the gyro's noise from a still recording";
        Temperature = 11, "temperature",
            "the temperature changed while measuring, and the error model does not cover it",
            "let the instrument take the temperature of the site, or calibrate it over temperature";
        NoRedundancy = 12, "no-redundancy",
            "the angles leave no redundancy: nothing would show an error",
            "measure at more than three directions";
        Autocorrelated = 13, "autocorrelated",
            "neighbouring seconds of a dwell are alike: something other than white noise acts",
            "repeat the fix with the instrument at its final temperature; if it stays, record a campaign and diagnose it";
        Bias = 14, "bias",
            "the gyro's bias is beyond its declared limit",
            "let the gyro warm up and calibrate it; if it stays, the gyro needs service, or the declared limit is too small";
        IndexSlip = 15, "index-slip",
            "the index angle changed while the motor stood, or did not follow its steps: the spindle or the encoder slipped, or steps were lost",
            "check spindle, coupling and encoder, switch off and on, and repeat the fix";
        AccuracyNotReached = 16, "accuracy-not-reached",
            "sigma is above the accuracy that was asked for",
            "allow more time, find what makes the noise, or ask for less";
        Turned = 17, "turned",
            "the instrument was turned on its base while it measured; the azimuth is that after the turn",
            "repeat the fix, and leave the instrument where it stands";
        LevelDrift = 18, "level-drift",
            "the level accelerometers' readings changed by more than their declared drift, and the gyro did not feel the base tilt",
            "let the instrument take the temperature of the site, calibrate the accelerometers over temperature, or declare their drift";
        LevelUncalibrated = 19, "level-uncalibrated",
            "no calibration of the level accelerometers is stored; what their biases tilt the vertical by, times the tangent of the latitude, is in the azimuth",
            "calibrate them: north calibrate field";
        ModelAged = 20, "model-aged",
            "a number that every fix gives moved away from what it was when the error model was loaded: the model may no longer hold",
            "read the log (north log) and let north watch say what moved; diagnose new runs and load the new model";
    }
}

codes! {
    /// Why a request is refused.
    Refusal {
        Damaged = 1, "damaged",
            "a frame came damaged: its check sum is wrong",
            "send the request again; if it happens often, check the cable and the baud rate";
        OtherVersion = 2, "other-version",
            "the frame is of another version of the link",
            "use the host tools of the firmware's version, or flash the firmware of the tools' version";
        NotUnderstood = 3, "not-understood",
            "the frame holds no request",
            "use the host tools of the firmware's version, or flash the firmware of the tools' version";
        NoFix = 4, "no-fix",
            "no fix can be started: the fault that was reported says why",
            "what the fault says";
        MotorTurns = 5, "motor-turns",
            "nothing is stored while the motor turns",
            "wait until the motor stands, or abort the fix";
        OutOfOrder = 6, "out-of-order",
            "a piece of settings or image before this one is missing, or there is no such piece",
            "begin again with the first piece";
        SettingsUnreadable = 7, "settings-unreadable",
            "these are no settings, or settings of a version that this firmware does not know",
            "use the host tools of the firmware's version";
        SettingsInvalid = 8, "settings-invalid",
            "the settings make no sense: the values that were reported are not allowed",
            "correct the values that are named and load the settings again";
        NotStored = 9, "not-stored",
            "the flash did not take settings or image; those before stay",
            "send them again; if it happens twice, the flash is worn: replace the board";
        NoSettings = 10, "no-settings",
            "no settings are stored",
            "load the settings, with the latitude of the site";
        SettingsCorrupt = 11, "settings-corrupt",
            "the stored settings fail their check",
            "load the settings again; if it happens twice, the flash is worn: replace the board";
        Busy = 12, "busy",
            "a fix or a calibration is under way",
            "wait for its end, or abort it";
        NoSlots = 13, "no-slots",
            "this image was not started by a loader, or the board has no second slot",
            "bring the image by a debug probe, or the loader first";
        UpdateUnfit = 14, "update-unfit",
            "this is no image, or one for another board, another slot or of another size",
            "use a file that was made for this board";
        UpdateUnsigned = 15, "update-unsigned",
            "the image is not signed by this instrument's key, or is not what was signed",
            "use a file that the holder of the key has signed, as it is";
        Unconfirmed = 16, "unconfirmed",
            "the image that runs is being tried: for ten seconds the other slot is the way back",
            "wait until it has run for ten seconds";
        NoFixYet = 17, "no-fix-yet",
            "there is no fix yet, or none with the error model in use",
            "start a fix first";
        LogUnreadable = 18, "log-unreadable",
            "the flash with the log of fixes cannot be read",
            "replace the board";
        Locked = 19, "locked",
            "this needs a session that the holder of the instrument's key has unlocked",
            "unlock it: north unlock --key FILE";
        NotUnlocked = 20, "not-unlocked",
            "there is no challenge that waits, or it was not signed with the instrument's key",
            "ask for another challenge and sign it with the key whose public half is in the settings (link.key)";
    }
}

codes! {
    /// What the instrument tests of itself, in the order in which it is told.
    Item {
        Settings = 1, "settings",
            "code of the fault of the settings in flash; 0: they are valid",
            "do what the table of faults says for that code";
        Memory = 2, "memory",
            "words of unused memory that do not hold what is written to them",
            "replace the board";
        Reset = 3, "reset",
            "code of the crash that ended the run before; 0: there was none",
            "look at the crash that is told at the start; if it happens again, report it";
        Clock = 4, "clock",
            "the clock runs from the crystal (1), or from the internal oscillator (0), which is good to 1 % only",
            "replace the crystal or the board: rates are wrong by as much as the clock";
        Gyro = 5, "gyro",
            "share of the gyro's frames that it vouches for; 0 where none came",
            "check the gyro's supply, cable, baud rate and frame format, and let it warm up";
        GyroRate = 6, "gyro-rate",
            "frames a second that the gyro sends, by its numbers and the instrument's clock",
            "check that the gyro is triggered by the instrument, or set its output rate to 400 Hz";
        Accelerometer = 7, "accelerometer",
            "share of the accelerometer's readings that are valid and differ from the one before",
            "check the accelerometer's cable and supply";
        Encoder = 8, "encoder",
            "share of the encoder's readings that are valid",
            "check the encoder's cable, supply and magnet";
        Block = 9, "block",
            "share of the readings of the block of three gyros that are valid",
            "check the block's cable and supply";
        Response = 10, "accelerometer-response",
            "what the accelerometer's own test force moves its reading by: the first axis that is off, else z",
            "replace the accelerometer";
        Drive = 11, "index-drive",
            "by how much the encoder sees a move of 5 degrees end off its target, out or back",
            "free the spindle and its cable, check the motor's supply and the coupling between motor, spindle and encoder";
        Limit = 12, "limit-switch",
            "the limit switch of the index is open (1): a stop was run into, or its wire is off; closed (0) within the travel",
            "turn the spindle off the switch by hand, and check the switch and its wire";
    }
}

codes! {
    /// What became of an item.
    TestVerdict {
        Passed = 1, "passed", "what was measured is allowed", "nothing";
        Failed = 2, "failed", "what was measured is not allowed", "what the item says";
        NotAsked = 3, "not-asked", "it is tested on request only", "ask for a self-test while the instrument stands";
        Absent = 4, "absent", "there is no such part", "nothing";
        Unmet = 5, "unmet", "what its test needs failed, or did not answer", "what the item that failed says";
        Interrupted = 6, "interrupted", "a command came before it was tested", "ask again";
    }
}

impl Item {
    /// Unit of what is measured; empty for codes.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Settings | Self::Reset | Self::Clock | Self::Limit => "",
            Self::Memory => "words",
            Self::Gyro | Self::Accelerometer | Self::Encoder | Self::Block => "%",
            Self::GyroRate => "1/s",
            Self::Response => "g",
            Self::Drive => "°",
        }
    }

    /// It is of the board that runs the firmware: a process of a host has none.
    pub fn is_of_board(self) -> bool {
        matches!(self, Self::Memory | Self::Reset | Self::Clock)
    }
}

/// What the test of an item found, in the item's unit. Single precision: it is for people.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    pub item: Item,
    pub verdict: TestVerdict,
    /// 0 where nothing was measured.
    pub measured: f32,
    /// What is allowed, both ends included; 0 and 0 where nothing was measured.
    pub allowed: [f32; 2],
}

impl Finding {
    pub fn judged(item: Item, measured: f32, allowed: [f32; 2]) -> Self {
        let [least, most] = allowed;
        let verdict = if (least..=most).contains(&measured) { TestVerdict::Passed } else { TestVerdict::Failed };
        Self { item, verdict, measured, allowed }
    }

    /// Of an item that was not tested, and why not.
    pub fn untested(item: Item, verdict: TestVerdict) -> Self {
        Self { item, verdict, measured: 0.0, allowed: [0.0; 2] }
    }

    pub fn passed(&self) -> bool {
        self.verdict == TestVerdict::Passed
    }

    /// Whether something was measured.
    pub fn was_tested(&self) -> bool {
        matches!(self.verdict, TestVerdict::Passed | TestVerdict::Failed)
    }
}

/// A set of [`Flag`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct Flags(u32);

impl Flags {
    pub fn insert(&mut self, flag: Flag) {
        self.0 |= 1 << flag as u8;
    }

    pub fn contains(self, flag: Flag) -> bool {
        self.0 & (1 << flag as u8) != 0
    }

    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The bit of a flag is its code.
    pub fn bits(self) -> u32 {
        self.0
    }

    pub fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    pub fn iter(self) -> impl Iterator<Item = Flag> {
        Flag::ALL.iter().copied().filter(move |&flag| self.contains(flag))
    }
}

/// A number that every fix leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[serde(rename_all = "kebab-case")]
pub enum Signal {
    /// Of the gyro, beyond the error model's, °/h.
    Bias,
    /// The horizontal rate, °/h.
    Amplitude,
    /// How the dwells fit together, as a standard normal number.
    Misfit,
    /// What the azimuth is off by at a surveyed heading, in its sigmas.
    AzimuthError,
}

impl Signal {
    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::Amplitude => "amplitude",
            Self::Misfit => "misfit",
            Self::AzimuthError => "azimuth-error",
        }
    }

    pub fn unit(self) -> &'static str {
        match self {
            Self::Bias | Self::Amplitude => "°/h",
            Self::Misfit | Self::AzimuthError => "sigma",
        }
    }
}

/// Everything discarded or repaired since the start, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct Counters {
    /// Good gyro frames.
    pub frames_good: u32,
    /// Frames whose check sum was wrong.
    pub frames_bad_crc: u32,
    /// Frames that the sequence numbers show to be missing.
    pub frames_lost: u32,
    /// Frames that came twice, or after their successors.
    pub frames_duplicate: u32,
    /// Frames that came, in order, after the tick by which they were due.
    pub frames_late: u32,
    /// Frames that the gyro itself marked as invalid or saturated.
    pub frames_invalid: u32,
    /// Bytes skipped in search of the next frame.
    pub bytes_skipped: u32,
    /// Bytes that newer ones overwrote before they were taken; at least so many.
    pub bytes_refused: u32,
    /// Seconds with a few missing frames, repaired.
    pub seconds_repaired: u32,
    /// Seconds with too many missing frames, left out.
    pub seconds_left_out: u32,
    /// Seconds left out of a dwell because the rate jumped.
    pub seconds_outlying: u32,
    /// Accelerometer readings that failed.
    pub accelerometer_errors: u32,
    /// Encoder readings that failed (parity, error flag, bus).
    pub encoder_errors: u32,
    /// Readings of the block of three gyros that failed.
    pub block_errors: u32,
    /// Samples of it that nobody read.
    pub block_missed: u32,
    /// Samples of it at the gyros' range.
    pub block_saturated: u32,
    /// Sensor readings that the solve task had no room for.
    pub readings_refused: u32,
    /// Reports that the link had no room for.
    pub reports_refused: u32,
    /// Commands that could not be understood.
    pub commands_bad: u32,
    /// Bytes from the gyro that came before the one before was read, with a wrong stop bit, and with noise.
    pub gyro_overruns: u32,
    pub gyro_framing_errors: u32,
    pub gyro_noise_errors: u32,
    /// The same from the host, and those that newer ones overwrote.
    pub host_overruns: u32,
    pub host_framing_errors: u32,
    pub host_noise_errors: u32,
    pub host_bytes_refused: u32,
    /// Ticks whose work was not done when the next one began.
    pub ticks_late: u32,
    /// Ticks that nobody saw: the processor stood still, or a reading was refused.
    pub ticks_lost: u32,
    /// Fixes that the flash did not take into the log.
    pub fixes_not_logged: u32,
}
