//! The raw stream: all that enters the instrument from gyro, accelerometers and encoder, tick by tick, as whole numbers.
//!
//! A [`Block`] holds items one after the other. An item is a byte that tells its kind and then its fields; `varint` is a
//! zigzag LEB128 number (0, −1, 1, −2 … are 0, 1, 2, 3 …, seven bits a byte, the lowest first, the upper bit set in all but the last):
//!
//! | kind | item | fields |
//! |---|---|---|
//! | `00` | end of a tick of 2.5 ms | – |
//! | `01` | a reading of the accelerometers | x, y, z: three varints, counts of 2.048 g / 2³¹ |
//! | `02` | a reading of the encoder | 4 bytes, little-endian, 2⁻³² of a turn |
//! | `80` + bits | a good frame of the gyro | its sequence number, 1 byte; its increment, a varint, counts; its temperature, 2 bytes, little-endian, signed, counts, where bit 3 is set |
//!
//! Bits of a frame: 0 valid, 1 saturated, 2 the temperature is that of the frame before in the same block, 3 the temperature follows (neither: the gyro
//! sends none). Counts of the gyro: compact frame 1e-6 arcsec and 0.01 °C, KVH format A 2⁻⁴⁸ rad and 1 °C.
//!
//! In a tick come first the frames that arrived in it, then the readings, then its end. The first tick of a stream is the first of a
//! second of 400 frames; the report of a second stands behind the last tick that it was made of. Blocks are numbered modulo 256.

use heapless::Vec;
use quantities::codes::{IndexCode, TriadCode};
use serde::{Deserialize, Serialize};

use super::bytes::Bytes;
use crate::sensing::frame::Frame;

const TICK: u8 = 0x00;
const ACCELERATION: u8 = 0x01;
const INDEX: u8 = 0x02;
const FRAME: u8 = 0x80;
const VALID: u8 = 0x01;
const SATURATED: u8 = 0x02;
const SAME_TEMPERATURE: u8 = 0x04;
const TEMPERATURE: u8 = 0x08;
/// The longest item: three varints of 33 bits, 16 bytes, or a frame, 14.
const LONGEST: usize = 16;

/// Something that enters the instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Item {
    /// A tick is over.
    Tick,
    Frame(Frame),
    Acceleration(TriadCode),
    Index(IndexCode),
}

/// Items, encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// Counts the blocks modulo 256, so that a missing one shows.
    pub number: u8,
    pub bytes: Bytes,
}

/// What is streamed and has not left yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stream {
    number: u8,
    bytes: Bytes,
    /// Of the last frame in `bytes` that had one.
    temperature: Option<i16>,
}

impl Stream {
    /// Takes an item; gives the block that had no room for it.
    pub fn push(&mut self, item: &Item) -> Option<Block> {
        if self.bytes.extend(&encoded(item, &mut self.temperature)) {
            return None;
        }
        let full = self.flush();
        // An empty block has room for every item.
        let _ = self.bytes.extend(&encoded(item, &mut self.temperature));
        full
    }

    /// What there is, as a block.
    pub fn flush(&mut self) -> Option<Block> {
        let bytes = core::mem::take(&mut self.bytes);
        self.temperature = None;
        if bytes.as_slice().is_empty() {
            return None;
        }
        let block = Block { number: self.number, bytes };
        self.number = self.number.wrapping_add(1);
        Some(block)
    }
}

type Encoded = Vec<u8, LONGEST>;

fn encoded(item: &Item, temperature: &mut Option<i16>) -> Encoded {
    let mut bytes = Encoded::new();
    // Every item has room: LONGEST.
    let mut put = |more: &[u8]| drop(bytes.extend_from_slice(more));
    match item {
        Item::Tick => put(&[TICK]),
        Item::Acceleration(TriadCode(counts)) => {
            put(&[ACCELERATION]);
            counts.iter().for_each(|&count| put_varint(count.into(), &mut put));
        }
        Item::Index(IndexCode(code)) => {
            put(&[INDEX]);
            put(&code.to_le_bytes());
        }
        Item::Frame(frame) => {
            let mut kind = FRAME;
            kind |= if frame.valid { VALID } else { 0 } | if frame.saturated { SATURATED } else { 0 };
            let follows = frame.temperature.filter(|_| frame.temperature != *temperature);
            kind |= match (frame.temperature, follows) {
                (None, _) => 0,
                (Some(_), None) => SAME_TEMPERATURE,
                (Some(_), Some(_)) => TEMPERATURE,
            };
            *temperature = frame.temperature.or(*temperature);
            put(&[kind, frame.sequence]);
            put_varint(frame.increment, &mut put);
            if let Some(count) = follows {
                put(&count.to_le_bytes());
            }
        }
    }
    bytes
}

fn put_varint(number: i64, put: &mut impl FnMut(&[u8])) {
    let mut rest = ((number << 1) ^ (number >> 63)).cast_unsigned();
    while rest >= 0x80 {
        put(&[rest as u8 | 0x80]);
        rest >>= 7;
    }
    put(&[rest as u8]);
}

/// Reads the items of a block; ends before the first that is none, and [`Items::is_damaged`] then says so.
#[derive(Clone, Debug)]
pub struct Items<'a> {
    rest: &'a [u8],
    temperature: Option<i16>,
    damaged: bool,
}

impl Block {
    pub fn items(&self) -> Items<'_> {
        Items { rest: self.bytes.as_slice(), temperature: None, damaged: false }
    }
}

impl Items<'_> {
    /// There is something in the block that is no item.
    pub fn is_damaged(&self) -> bool {
        self.damaged
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(*first)
    }

    fn varint(&mut self) -> Option<i64> {
        let mut number = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Some((number >> 1).cast_signed() ^ -(number & 1).cast_signed());
            }
        }
        None
    }

    fn item(&mut self) -> Option<Item> {
        match self.byte()? {
            TICK => Some(Item::Tick),
            ACCELERATION => {
                let mut counts = [0; 3];
                for count in &mut counts {
                    *count = self.varint()?.try_into().ok()?;
                }
                Some(Item::Acceleration(TriadCode(counts)))
            }
            INDEX => self.array().map(|bytes| Item::Index(IndexCode(u32::from_le_bytes(bytes)))),
            kind if kind & FRAME != 0 => {
                let (sequence, increment) = (self.byte()?, self.varint()?);
                let temperature = match kind & (TEMPERATURE | SAME_TEMPERATURE) {
                    0 => None,
                    SAME_TEMPERATURE => Some(self.temperature?),
                    _ => Some(i16::from_le_bytes(self.array()?)),
                };
                self.temperature = temperature.or(self.temperature);
                let (valid, saturated) = (kind & VALID != 0, kind & SATURATED != 0);
                Some(Item::Frame(Frame { sequence, increment, temperature, valid, saturated }))
            }
            _ => None,
        }
    }
}

impl Iterator for Items<'_> {
    type Item = Item;

    fn next(&mut self) -> Option<Item> {
        if self.rest.is_empty() {
            return None;
        }
        let item = self.item();
        if item.is_none() {
            (self.rest, self.damaged) = (&[], true);
        }
        item
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec as StdVec;

    use proptest::prelude::*;

    use super::*;

    fn frame(sequence: u8, increment: i64, temperature: Option<i16>) -> Item {
        Item::Frame(Frame { sequence, increment, temperature, valid: true, saturated: false })
    }

    #[test]
    fn a_block_by_hand() {
        // 300 is 600 in zigzag, 0b100_1011000: D8 04. −1 is 1. 2150 is 0x0866. A quarter of a turn is 2³⁰.
        let mut stream = Stream::default();
        let items = [
            frame(7, 300, Some(2150)),
            frame(8, -1, Some(2150)),
            Item::Acceleration(TriadCode([0, -1, 64])),
            Item::Index(IndexCode(1 << 30)),
            Item::Tick,
        ];
        assert!(items.iter().all(|item| stream.push(item).is_none()));
        let block = stream.flush().unwrap();
        let expected = [0x89, 7, 0xD8, 0x04, 0x66, 0x08, 0x85, 8, 1, 0x01, 0, 1, 0x80, 0x01, 0x02, 0, 0, 0, 0x40, 0x00];
        assert_eq!((block.number, block.bytes.as_slice()), (0, &expected[..]));
        assert_eq!(block.items().collect::<StdVec<_>>(), items);
        assert_eq!(stream.flush(), None);
    }

    fn any_item() -> impl Strategy<Value = Item> {
        prop_oneof![
            Just(Item::Tick),
            any::<u32>().prop_map(|code| Item::Index(IndexCode(code))),
            any::<[i32; 3]>().prop_map(|counts| Item::Acceleration(TriadCode(counts))),
            (any::<u8>(), any::<i64>(), any::<Option<i16>>(), any::<bool>(), any::<bool>()).prop_map(
                |(sequence, increment, temperature, valid, saturated)| {
                    Item::Frame(Frame { sequence, increment, temperature, valid, saturated })
                }
            ),
        ]
    }

    proptest! {
        #[test]
        fn every_item_comes_through_in_order(items in proptest::collection::vec(any_item(), 0..200)) {
            let mut stream = Stream::default();
            let mut blocks: StdVec<Block> = items.iter().filter_map(|item| stream.push(item)).collect();
            blocks.extend(stream.flush());
            prop_assert!(blocks.iter().zip(0_u8..).all(|(block, number)| block.number == number));
            let read: StdVec<Item> = blocks.iter().flat_map(Block::items).collect();
            prop_assert_eq!(read, items);
        }

        #[test]
        fn any_bytes_are_survived(bytes: StdVec<u8>) {
            let block = Block { number: 0, bytes: Bytes::start_of(&bytes) };
            let mut items = block.items();
            prop_assert!(items.by_ref().count() <= bytes.len());
        }
    }
}
