//! What happened before the instrument started: whether a person or a fault restarted it, and what the fault left behind.
//!
//! A board keeps a [`Crash`] in memory that a reset does not clear, as [`Crash::to_words`]: at power-up that memory holds anything,
//! and [`Crash::of_words`] finds out.

use north_boot::CRC_32;
use serde::{Deserialize, Serialize};

/// Bytes of each of the two texts.
const TEXT: usize = 32;
const TEXT_WORDS: usize = TEXT / 4;
const NUMBERS: usize = 8;
/// Words of a kept crash: numbers, two texts, and their CRC-32.
pub const WORDS: usize = NUMBERS + 2 * TEXT_WORDS + 1;

/// What ended the run before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum Cause {
    /// The firmware found itself in a state that cannot be.
    Panic,
    /// The processor refused an instruction or an address.
    HardFault,
    /// The stack was too small.
    StackOverflow,
    /// A task did not check in.
    LateTask,
    /// The watchdog was not fed.
    Watchdog,
    /// The supply fell below the brown-out level.
    BrownOut,
    /// The crystal stopped.
    Clock,
}

impl Cause {
    pub const ALL: [Self; 7] = [
        Self::Panic,
        Self::HardFault,
        Self::StackOverflow,
        Self::LateTask,
        Self::Watchdog,
        Self::BrownOut,
        Self::Clock,
    ];

    /// Number, stable, from 1.
    pub fn code(self) -> u8 {
        self as u8 + 1
    }

    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::HardFault => "hard-fault",
            Self::StackOverflow => "stack-overflow",
            Self::LateTask => "late-task",
            Self::Watchdog => "watchdog",
            Self::BrownOut => "brown-out",
            Self::Clock => "clock-stopped",
        }
    }
}

/// A crash or a delay on purpose, by a request: to see on a board that it is survived and told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Provocation {
    Panic,
    HardFault,
    StackOverflow,
    /// A task that never ends: `solve`.
    Hang,
    /// The same of `report`.
    HangReport,
    /// The work of a tick takes so many ticks, once.
    Lag {
        ticks: u8,
    },
}

/// A text of fixed room, padded with zeros.
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Text([u8; TEXT]);

impl Text {
    /// As much of the end of a text as there is room for: of a path, the file.
    pub fn end_of(text: &str) -> Self {
        Self::of(text.as_bytes().iter().skip(text.len().saturating_sub(TEXT)))
    }

    /// As much of the beginning of a text as there is room for.
    pub fn start_of(text: &str) -> Self {
        Self::of(text.as_bytes().iter())
    }

    fn of<'a>(bytes: impl Iterator<Item = &'a u8>) -> Self {
        let mut text = [0; TEXT];
        text.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
        Self(text)
    }

    pub fn as_str(&self) -> &str {
        let used = self.0.split(|&byte| byte == 0).next().unwrap_or_default();
        // A character cut in two is left out.
        used.utf8_chunks().map(|chunk| chunk.valid()).find(|valid| !valid.is_empty()).unwrap_or_default()
    }
}

impl core::fmt::Debug for Text {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.as_str().fmt(f)
    }
}

/// What is known of it. Registers are 0 where nothing is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Crash {
    pub cause: Cause,
    /// Where the processor was, where it would have returned to, and its stack pointer.
    pub program_counter: u32,
    pub link_register: u32,
    pub stack_pointer: u32,
    /// The processor's fault status (CFSR, ARMv7-M B3.2.15).
    pub fault_status: u32,
    /// CRC-32 of the program that crashed.
    pub program: u32,
    /// Line and file of a panic.
    pub line: u32,
    pub file: Text,
    /// Its message; the task that was late.
    pub message: Text,
}

impl Crash {
    /// One of which nothing but the cause is known.
    pub const fn new(cause: Cause) -> Self {
        Self {
            cause,
            program_counter: 0,
            link_register: 0,
            stack_pointer: 0,
            fault_status: 0,
            program: 0,
            line: 0,
            file: Text([0; TEXT]),
            message: Text([0; TEXT]),
        }
    }

    /// For memory that a reset does not clear.
    pub fn to_words(&self) -> [u32; WORDS] {
        let numbers = [
            u32::from(self.cause as u8),
            self.program_counter,
            self.link_register,
            self.stack_pointer,
            self.fault_status,
            self.program,
            self.line,
            0,
        ];
        let texts = self.file.0.as_chunks().0.iter().chain(self.message.0.as_chunks().0);
        let mut words = [0; WORDS];
        let content = numbers.into_iter().chain(texts.map(|bytes| u32::from_le_bytes(*bytes)));
        words.iter_mut().zip(content).for_each(|(word, value)| *word = value);
        if let Some((check, content)) = words.split_last_mut() {
            *check = check_of(content);
        }
        words
    }

    /// From such memory; `None` where it holds none.
    pub fn of_words(words: &[u32; WORDS]) -> Option<Self> {
        let (check, content) = words.split_last()?;
        if *check != check_of(content) {
            return None;
        }
        let (&[cause, program_counter, link_register, stack_pointer, fault_status, program, line, _], texts) =
            content.split_first_chunk::<NUMBERS>()?;
        let (file, message) = texts.split_at_checked(TEXT_WORDS)?;
        let text = |words: &[u32]| {
            let mut text = [0; TEXT];
            text.as_chunks_mut().0.iter_mut().zip(words).for_each(|(bytes, word)| *bytes = word.to_le_bytes());
            Text(text)
        };
        Some(Self {
            cause: *Cause::ALL.get(cause as usize)?,
            program_counter,
            link_register,
            stack_pointer,
            fault_status,
            program,
            line,
            file: text(file),
            message: text(message),
        })
    }
}

/// CRC-32/ISO-HDLC of bytes: the check sum that a program is known by.
pub fn check(bytes: &[u8]) -> u32 {
    CRC_32.checksum(bytes)
}

fn check_of(words: &[u32]) -> u32 {
    let mut digest = CRC_32.digest();
    words.iter().for_each(|word| digest.update(&word.to_le_bytes()));
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CRASH: Crash = Crash {
        program_counter: 0x0801_2345,
        link_register: 0x0801_0001,
        stack_pointer: 0x2000_1234,
        fault_status: 0x0200_0000,
        program: 0xDEAD_BEEF,
        line: 77,
        ..Crash::new(Cause::HardFault)
    };

    #[test]
    fn what_is_kept_is_found_again() {
        for cause in Cause::ALL {
            let file = Text::end_of("/a/long/way/to/the/source/src/fix/dwell.rs");
            let crash =
                Crash { cause, file, message: Text::start_of("a message longer than its thirty-two bytes"), ..CRASH };
            assert_eq!(Crash::of_words(&crash.to_words()), Some(crash));
            assert_eq!(crash.file.as_str(), "y/to/the/source/src/fix/dwell.rs");
            assert_eq!(crash.message.as_str(), "a message longer than its thirty");
        }
    }

    #[test]
    fn memory_as_it_is_at_power_up_holds_none() {
        assert_eq!(Crash::of_words(&[0; WORDS]), None);
        assert_eq!(Crash::of_words(&[u32::MAX; WORDS]), None);
        for place in 0..WORDS {
            let mut words = CRASH.to_words();
            words[place] ^= 1 << (place % 32);
            assert_eq!(Crash::of_words(&words), None);
        }
    }

    #[test]
    fn a_character_that_is_cut_is_left_out() {
        // 31 bytes and a character of two.
        assert_eq!(Text::start_of("0123456789012345678901234567890°").as_str(), "0123456789012345678901234567890");
        assert_eq!(Text::end_of("°0123456789012345678901234567890").as_str(), "0123456789012345678901234567890");
    }
}
