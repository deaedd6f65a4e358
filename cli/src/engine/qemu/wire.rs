//! The messages of the exchange: what the firmware asks, as `src/board/mps2/exchange.rs` describes it, and replies.

use super::QemuError;

/// What the firmware asks.
#[derive(Debug, PartialEq)]
pub enum Ask<'a> {
    Tick { busy_cycles: u32, input: u8, edges: &'a [u8] },
    Spi { device: u8, mosi: &'a [u8] },
    Gyro { byte: u8 },
    Uart { bytes: &'a [u8] },
    Log { frame: &'a [u8] },
    ReadFlash { offset: u32, length: u16 },
    WriteFlash { offset: u32, bytes: &'a [u8] },
    EraseFlash { from: u32, to: u32 },
    Panic { text: &'a str },
    End { stack_bytes: u32 },
}

impl<'a> Ask<'a> {
    /// A request without its length.
    pub fn decode(message: &'a [u8]) -> Result<Self, QemuError> {
        let (&opcode, payload) = message.split_first().unwrap_or((&0, &[]));
        Self::decode_payload(opcode, payload).ok_or(QemuError::Message { opcode, length: payload.len() })
    }

    fn decode_payload(opcode: u8, payload: &'a [u8]) -> Option<Self> {
        Some(match opcode {
            b'T' => {
                let (busy_cycles, rest) = split_u32(payload)?;
                let (&input, edges) = rest.split_first()?;
                Self::Tick { busy_cycles, input, edges }
            }
            b'S' => {
                let (&device, mosi) = payload.split_first()?;
                Self::Spi { device, mosi }
            }
            b'G' => Self::Gyro { byte: *payload.first()? },
            b'U' => Self::Uart { bytes: payload },
            b'L' => Self::Log { frame: payload },
            b'R' => {
                let (offset, length) = split_u32(payload)?;
                Self::ReadFlash { offset, length: u16::from_le_bytes(length.try_into().ok()?) }
            }
            b'W' => {
                let (offset, bytes) = split_u32(payload)?;
                Self::WriteFlash { offset, bytes }
            }
            b'E' => {
                let (from, to) = split_u32(payload)?;
                Self::EraseFlash { from, to: u32::from_le_bytes(to.try_into().ok()?) }
            }
            b'P' => Self::Panic { text: str::from_utf8(payload).ok()? },
            b'Z' => Self::End { stack_bytes: u32::from_le_bytes(payload.try_into().ok()?) },
            _ => return None,
        })
    }
}

fn split_u32(payload: &[u8]) -> Option<(u32, &[u8])> {
    payload.split_first_chunk().map(|(number, rest)| (u32::from_le_bytes(*number), rest))
}

/// A pin's change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// In which slot of the tick, 0 to 7.
    pub slot: u8,
    /// 0 step, 1 direction, 2 enable.
    pub pin: usize,
    pub level: bool,
}

impl From<u8> for Edge {
    fn from(edge: u8) -> Self {
        Self { slot: edge >> 5, pin: usize::from(edge >> 1 & 0x0F), level: edge & 1 == 1 }
    }
}

/// The answer to a tick: go on, with the limit switch, this code of the converter and these bytes for the gyro's and the host's line.
pub fn tick_reply(limit_open: bool, code: u16, gyro: &[u8], requests: &[u8]) -> Vec<u8> {
    let mut reply = vec![u8::from(limit_open) << 1];
    reply.extend(code.to_le_bytes());
    reply.extend((gyro.len() as u16).to_le_bytes());
    reply.extend(gyro);
    reply.extend(requests);
    reply
}

/// The answer to a tick: the power goes off.
pub fn power_off() -> Vec<u8> {
    vec![1, 0, 0, 0, 0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_with_an_edge() {
        let ask = Ask::decode(&[b'T', 0x10, 0x27, 0, 0, 4, 0b1010_0001]).unwrap();
        assert_eq!(ask, Ask::Tick { busy_cycles: 10_000, input: 4, edges: &[0b1010_0001] });
        assert_eq!(Edge::from(0b1010_0001), Edge { slot: 5, pin: 0, level: true });
        assert_eq!(Edge::from(0b0000_0100), Edge { slot: 0, pin: 2, level: false });
    }

    #[test]
    fn what_is_no_message_is_named() {
        for message in [&b""[..], b"T123", b"R1234", b"X"] {
            assert!(matches!(Ask::decode(message), Err(QemuError::Message { .. })), "{message:?}");
        }
    }

    #[test]
    fn replies() {
        assert_eq!(tick_reply(false, 0x0102, &[7, 8], &[9]), [0, 2, 1, 2, 0, 7, 8, 9]);
        assert_eq!(tick_reply(true, 0, &[], &[]), [2, 0, 0, 0, 0]);
    }
}
