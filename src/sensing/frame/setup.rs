//! Sets a gyro of KVH's family up over its own line: increments of angle in radians, one frame for each of the instrument's pulses.
//!
//! The gyro takes lines of text on the line that its frames come from. Between `=CONFIG,1` and `=CONFIG,0` it sends no frames; it repeats what it
//! has set, without the sign before it, and keeps it without power. A command that it does not repeat is sent again.
//!
//! Whether a frame holds an angle or a rate, in radians or degrees, the frame does not say: so the gyro is told, and asked to repeat it.
//!
//! Source: KVH, 1775 IMU technical manual, 56-0298 revision B, chapter 8; the 1750 and 1760 have the same commands.

/// In their order: the data rate is that of the filter alone where the pulses are the instrument's (500 is the next that is allowed above 400), and the
/// pulses come after it, because they bring a filter of their own.
const COMMANDS: [&str; 6] =
    ["=CONFIG,1\r\n", "=ROTFMT,DELTA\r\n", "=ROTUNITS,RAD\r\n", "=DR,500\r\n", "=MSYNC,EXT\r\n", "=CONFIG,0\r\n"];
/// Ticks that a repetition is waited for, 0.5 s: the gyro answers within 0.1 s.
const PATIENCE_TICKS: u16 = 200;
/// How often a command is sent. The first one meets a gyro that is still starting: 26 s, less than is waited for its first frame.
const TRIES: u8 = 3;
const FIRST_TRIES: u8 = 50;

/// The conversation.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    command: usize,
    /// Bytes of it that are out, and ticks since all of them are.
    sent: usize,
    waited: u16,
    tries: u8,
    /// Characters of the expected repetition that have come, and the last one of all.
    matched: usize,
    last: u8,
}

/// Where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// A byte for the gyro, where there is one in this tick.
    UnderWay(Option<u8>),
    /// The gyro has repeated everything.
    Done,
    /// It did not repeat a command.
    Unanswered,
}

impl Setup {
    /// A tick. A byte takes 11 µs of it: no other one is on its way.
    pub fn tick(&mut self) -> Progress {
        let Some(command) = COMMANDS.get(self.command) else { return Progress::Done };
        if let Some(&byte) = command.as_bytes().get(self.sent) {
            self.sent += 1;
            return Progress::UnderWay(Some(byte));
        }
        // The last command is answered by frames.
        if self.matched >= expected(command).len() || self.command + 1 == COMMANDS.len() {
            *self = Self { command: self.command + 1, ..Self::default() };
            return Progress::UnderWay(None);
        }
        self.waited += 1;
        if self.waited < PATIENCE_TICKS {
            return Progress::UnderWay(None);
        }
        let tries = self.tries + 1;
        if tries >= if self.command == 0 { FIRST_TRIES } else { TRIES } {
            return Progress::Unanswered;
        }
        *self = Self { command: self.command, tries, ..Self::default() };
        Progress::UnderWay(None)
    }

    /// A byte of the gyro: of a frame, or of a repetition. A line that comes back as it was sent is none: its sign stands before it.
    pub fn hear(&mut self, byte: u8) {
        let Some(expected) = COMMANDS.get(self.command).map(|command| expected(command)) else { return };
        if byte == b' ' || self.matched >= expected.len() {
            return;
        }
        let byte = byte.to_ascii_uppercase();
        let is = |place: usize| expected.get(place) == Some(&byte);
        self.matched = match self.matched {
            0 if self.last == b'=' => 0,
            matched if is(matched) => matched + 1,
            _ => usize::from(is(0)),
        };
        self.last = byte;
    }
}

/// What the gyro repeats of a command: what is between its sign and the line's end.
fn expected(command: &'static str) -> &'static [u8] {
    command.trim_end().strip_prefix('=').unwrap_or_default().as_bytes()
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::String;
    use std::vec::Vec;

    use super::*;

    /// Talks to something that answers a whole line with what `answer` makes of it; the lines that it got, and how it ended.
    fn talk(answer: impl Fn(&str, usize) -> String) -> (Vec<String>, Progress, usize) {
        let (mut setup, mut line, mut lines) = (Setup::default(), String::new(), Vec::new());
        for tick in 0.. {
            match setup.tick() {
                Progress::UnderWay(None) => {}
                Progress::UnderWay(Some(byte)) => {
                    line.push(byte.into());
                    if byte == b'\n' {
                        lines.push(std::mem::take(&mut line));
                        answer(lines.last().unwrap(), lines.len()).bytes().for_each(|byte| setup.hear(byte));
                    }
                }
                end => return (lines, end, tick),
            }
        }
        unreachable!()
    }

    fn repeats(line: &str) -> String {
        line.replacen('=', "", 1)
    }

    #[test]
    fn a_gyro_that_repeats_everything_is_set_up() {
        let (lines, end, ticks) = talk(|line, _| repeats(line));
        assert_eq!((lines.len(), end), (COMMANDS.len(), Progress::Done));
        assert_eq!(lines.concat(), COMMANDS.concat());
        // A byte a tick, and one tick more for each command.
        assert_eq!(ticks, COMMANDS.concat().len() + COMMANDS.len());
        // In small letters, behind a space, and after the rest of a frame that looks like its beginning.
        let (_, end, _) = talk(|line, _| std::format!("\u{7f}ROT{}", repeats(line).to_lowercase().replace(',', ", ")));
        assert_eq!(end, Progress::Done);
    }

    #[test]
    fn what_is_not_repeated_is_sent_again_and_given_up() {
        let (lines, end, _) = talk(|line, number| if number == 1 { String::new() } else { repeats(line) });
        assert_eq!((lines.len(), end), (COMMANDS.len() + 1, Progress::Done));
        // A wire to itself sends back what was sent: that is no answer.
        let (lines, end, ticks) = talk(|line, _| line.into());
        assert_eq!((lines.len(), end), (FIRST_TRIES.into(), Progress::Unanswered));
        // 26 s.
        assert!((10_400..10_800).contains(&ticks), "{ticks}");
        let (lines, end, _) =
            talk(|line, _| if line.contains("ROTFMT") { "ROTFMT,RATE\r\n".into() } else { repeats(line) });
        assert_eq!((lines.len(), end), (1 + usize::from(TRIES), Progress::Unanswered));
    }
}
