//! Which firmware this is.

use serde::{Deserialize, Serialize};

use super::restart::Text;

/// What runs the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Board {
    /// The program of a host.
    Host,
    /// QEMU's mps2-an386.
    Mps2,
    Stm32f405,
    /// ST's Nucleo-F446RE.
    NucleoF446,
}

impl Board {
    /// Lower-case name, stable: files and tools depend on it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Host => "host",
            Self::Mps2 => "mps2-an386",
            Self::Stm32f405 => "stm32f405",
            Self::NucleoF446 => "nucleo-f446re",
        }
    }
}

/// Which program runs on which board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    pub board: Board,
    /// Version of the firmware.
    pub version: Text,
    /// The build: CRC-32/ISO-HDLC of the program as it is in flash; 0 on a host.
    pub program: u32,
    /// Of the sources: what git calls it, with `+` where they were changed; empty where it is not known.
    pub revision: Text,
    /// The chip's own number; 0 on a host.
    pub serial: [u32; 3],
    /// Where an image must be linked for that an update brings: the free slot; 0 where there is none.
    pub free_slot: u32,
}

impl Identity {
    pub fn new(board: Board, program: u32, serial: [u32; 3]) -> Self {
        let [version, revision] =
            [env!("CARGO_PKG_VERSION"), option_env!("NORTH_REVISION").unwrap_or_default()].map(Text::start_of);
        Self { board, version, program, revision, serial, free_slot: 0 }
    }

    /// Of the instrument in a host's process.
    pub fn host() -> Self {
        Self::new(Board::Host, 0, [0; 3])
    }
}
