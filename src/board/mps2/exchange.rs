//! The exchange with the simulated world, over semihosting on QEMU's standard input and output.
//!
//! The board sends a request and waits for the reply; meanwhile virtual time stands still. All numbers are
//! little-endian. A request is the length of what follows (u16), an opcode, and a payload; a reply is the length of
//! what follows (u16) and a payload.
//!
//! | opcode | request | reply |
//! |---|---|---|
//! | `T` tick | u32 busy time of the tick before in timer cycles, without the exchange's own; u8 analogue input that is converted, from 0 (255: none); pin edges, one byte each: bits 7-5 slot, 4-1 pin, 0 level | u8 status (bit 0: power off, bit 1: the limit switch is open); u16 code of the converter; u16 n; n bytes from the gyro; the rest: bytes for the request port |
//! | `S` SPI | u8 device; the bytes of all operations, 00 where only reading | as many bytes |
//! | `G` gyro | a byte sent to the gyro | – |
//! | `U` UART | bytes sent by the report port | – |
//! | `L` log | a frame of defmt's | – |
//! | `R` read flash | u32 offset, u16 length | the bytes |
//! | `W` write flash | u32 offset, the bytes | u8 0, or the error |
//! | `E` erase flash | u32 from, u32 to | u8 0, or the error |
//! | `P` an answer was none | text | none: the board ends |
//! | `Z` end | u32 most bytes of stack that were used | none: the board ends |

use super::pac::TIMER0;
use cortex_m_semihosting::{debug, nr, syscall, syscall1};

/// Longest message, with its length. A flash record is the longest: 6144 bytes.
const MAX_MESSAGE: usize = 6160;

pub struct Exchange {
    /// What the exchange itself took since it was last asked for, cycles of the timer, and what else no board with timers and buses of
    /// its own does.
    cycles: u32,
    to_host: usize,
    from_host: usize,
    message: [u8; MAX_MESSAGE],
}

impl Exchange {
    pub const fn closed() -> Self {
        Self { cycles: 0, to_host: 0, from_host: 0, message: [0; MAX_MESSAGE] }
    }

    /// Opens QEMU's standard input and output.
    pub fn open(&mut self) {
        self.to_host = open(c"/dev/stdout", nr::open::W_TRUNC_BINARY);
        self.from_host = open(c"/dev/stdin", nr::open::R_BINARY);
    }

    /// Sends a request in parts and gives the reply. A lost host ends the program.
    pub fn ask(&mut self, opcode: u8, parts: &[&[u8]]) -> &[u8] {
        let end = self.timed(|exchange| {
            exchange.send(opcode, parts);
            exchange.receive()
        });
        &self.message[2..end]
    }

    /// Sends a request that has no reply.
    pub fn tell(&mut self, opcode: u8, parts: &[&[u8]]) {
        self.timed(|exchange| exchange.send(opcode, parts));
    }

    /// What the exchange took since this was last asked, cycles of the timer.
    pub fn take_cycles(&mut self) -> u32 {
        core::mem::take(&mut self.cycles)
    }

    /// Counts what this takes as the exchange's: of one within another, the outer.
    pub fn timed<R>(&mut self, talk: impl FnOnce(&mut Self) -> R) -> R {
        let (began, before) = (TIMER0.remaining(), self.cycles);
        let result = talk(self);
        self.cycles = before;
        self.count_from(began);
        result
    }

    /// Counts as the exchange's what was done since the timer stood there.
    pub fn count_from(&mut self, began: u32) {
        self.cycles = self.cycles.wrapping_add(began.wrapping_sub(TIMER0.remaining()));
    }

    /// Waits for a reply; gives where it ends in the message.
    fn receive(&mut self) -> usize {
        let mut received = self.read(0);
        while received < 2 {
            received += self.read(received);
        }
        let [low, high, ..] = self.message;
        let end = 2 + usize::from(u16::from_le_bytes([low, high]));
        while received < end {
            received += self.read(received);
        }
        end
    }

    fn send(&mut self, opcode: u8, parts: &[&[u8]]) {
        let length = 1 + parts.iter().map(|part| part.len()).sum::<usize>();
        self.message[..2].copy_from_slice(&(length as u16).to_le_bytes());
        self.message[2] = opcode;
        let mut end = 3;
        for part in parts {
            self.message[end..][..part.len()].copy_from_slice(part);
            end += part.len();
        }
        // SAFETY: the buffer lives through the call.
        let not_written = unsafe { syscall!(WRITE, self.to_host, self.message.as_ptr(), end) };
        if not_written != 0 {
            lost();
        }
    }

    /// Reads into the message from here; waits for at least one byte.
    fn read(&mut self, from: usize) -> usize {
        let room = &mut self.message[from..];
        // SAFETY: the buffer lives through the call.
        let not_read = unsafe { syscall!(READ, self.from_host, room.as_mut_ptr(), room.len()) };
        match room.len().checked_sub(not_read) {
            Some(read) if read > 0 => read,
            _ => lost(),
        }
    }
}

fn open(path: &core::ffi::CStr, mode: usize) -> usize {
    // SAFETY: the path lives through the call and ends with 0.
    unsafe { syscall!(OPEN, path.as_ptr(), mode, path.count_bytes()) }
}

/// Whether the word is among those that QEMU was started with (`-semihosting-config arg=…`).
pub fn has_argument(word: &str) -> bool {
    let mut line = [0_u8; 128];
    let mut block = [line.as_mut_ptr() as usize, line.len()];
    // SAFETY: both buffers live through the call, and the second one says how long the first is.
    let failed = unsafe { syscall1(nr::GET_CMDLINE, block.as_mut_ptr() as usize) };
    let line = line.split(|&byte| byte == 0).next().and_then(|line| str::from_utf8(line).ok());
    failed == 0 && line.is_some_and(|line| line.split(' ').any(|argument| argument == word))
}

/// The host is gone.
fn lost() -> ! {
    exit(debug::EXIT_FAILURE)
}

/// Ends QEMU.
pub fn exit(status: debug::ExitStatus) -> ! {
    loop {
        debug::exit(status);
    }
}
