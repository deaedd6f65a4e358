//! Frames against published vectors and the layout that is written down.

use hal_sim::frames::{Frame, crc32, kvh_a};
use hal_sim::scenario::GyroFormat;

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    digits
        .chunks(2)
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).expect("text"), 16).expect("hex"))
        .collect()
}

/// Frames of the KVH 1750/1760/1775 family, format A, from public driver tests.
const KVH_GOOD: [&str; 2] = [
    "FE81FF55 37A96A6E 38586C1F B75BF862 BF803E78 BB650D28 3B0A37AC 77 3D 0028 4BFA34D8",
    "FE81FF55 B3D0BBE7 32193EF4 30AC19A5 BA8F78D6 3A290594 3F7ECBD4 77 68 001D ADC5F651",
];
/// Another of them, with a wrong CRC in the test; the right one is 14DC0D3A.
const KVH_BAD: &str = "FE81FF55 B46B86C6 B44F5B83 B4106D09 BB713CB7 BBABD914 3F7E319A 77 69 001D 95BBDB4F";

#[test]
fn the_crc_is_that_of_published_frames() {
    for frame in KVH_GOOD {
        let frame = bytes(frame);
        assert_eq!(crc32(&frame[..32]).to_be_bytes(), frame[32..]);
    }
    assert_eq!(crc32(&bytes(KVH_BAD)[..32]), 0x14DC_0D3A);
    // The catalogue's check value of CRC-32/MPEG-2, which has the same parameters.
    assert_eq!(crc32(b"123456789"), 0x0376_E6E7);
}

#[test]
fn published_kvh_frames_are_written_byte_for_byte() {
    for frame in KVH_GOOD {
        let frame = bytes(frame);
        let float = |at: usize| f32::from_be_bytes([frame[at], frame[at + 1], frame[at + 2], frame[at + 3]]);
        let written = kvh_a(
            [float(4), float(8), float(12)],
            [float(16), float(20), float(24)],
            frame[28],
            frame[29],
            i16::from_be_bytes([frame[30], frame[31]]),
        );
        assert_eq!(written, frame);
    }
}

const FRAME: Frame =
    Frame { increment_uas: -37_603, temp_c: -12.34, sequence: 200, valid: true, saturated: false, temp_valid: true };

#[test]
fn the_compact_frame_has_its_layout() {
    let bytes = FRAME.encode(GyroFormat::Compact);
    // −37603 = FFFF6D1D, −1234 = FB2E.
    assert_eq!(bytes[..10], [0xA5, 0x5A, 200, 0b101, 0x1D, 0x6D, 0xFF, 0xFF, 0x2E, 0xFB]);
    assert_eq!(bytes[10..], crc32(&bytes[..10]).to_le_bytes());
    let bad = Frame { valid: false, saturated: true, temp_valid: false, ..FRAME }.encode(GyroFormat::Compact);
    assert_eq!(bad[3], 0b010);
}

#[test]
fn the_kvh_frame_carries_radians_on_x() {
    let bytes = FRAME.encode(GyroFormat::KvhA);
    assert_eq!(bytes.len(), 36);
    let radians = f32::from_be_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]);
    // −0.037603 arcsec / 206264.806 arcsec per radian.
    assert!((radians / -1.823_045e-7 - 1.0).abs() < 1e-6, "{radians}");
    assert_eq!(bytes[8..28], [0; 20]);
    assert_eq!((bytes[28], bytes[29]), (0x77, 200 - 128));
    assert_eq!(i16::from_be_bytes([bytes[30], bytes[31]]), -12);
    assert_eq!(Frame { valid: false, ..FRAME }.encode(GyroFormat::KvhA)[28], 0x76);
    assert_eq!(Frame { saturated: true, ..FRAME }.encode(GyroFormat::KvhA)[28], 0x76);
}
