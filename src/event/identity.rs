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
}

impl Identity {
    pub fn new(board: Board, program: u32) -> Self {
        Self { board, version: Text::start_of(env!("CARGO_PKG_VERSION")), program }
    }

    /// Of the instrument in a host's process.
    pub fn host() -> Self {
        Self::new(Board::Host, 0)
    }
}
