//! Properties of the frame reader on frames that the simulator encoded.

use hal_sim::frames::{Frame as SimulatedFrame, kvh_a};
use hal_sim::scenario::GyroFormat as SimulatedFormat;
use north_finder::sensing::frame::{Frame, FrameReader};
use north_finder::settings::GyroFormat;
use proptest::prelude::*;

fn read(format: GyroFormat, bytes: &[u8]) -> (Vec<Frame>, FrameReader) {
    let mut reader = FrameReader::new(format);
    let frames = bytes.iter().filter_map(|&byte| reader.push(byte)).collect();
    (frames, reader)
}

fn compact(increment_uas: i32, sequence: u8) -> Vec<u8> {
    let frame = SimulatedFrame { increment_uas, sequence, ..frame_of_a_quiet_gyro() };
    frame.encode(SimulatedFormat::Compact)
}

fn frame_of_a_quiet_gyro() -> SimulatedFrame {
    SimulatedFrame { increment_uas: 0, temp_c: 20.0, sequence: 0, valid: true, saturated: false, temp_valid: true }
}

proptest! {
    #[test]
    fn what_the_gyro_sends_is_what_is_read(increments in prop::collection::vec(any::<i32>(), 1..20)) {
        let stream: Vec<u8> = increments.iter().zip(0..).flat_map(|(&uas, n)| compact(uas, n)).collect();
        let (frames, reader) = read(GyroFormat::Compact, &stream);
        prop_assert_eq!(frames.len(), increments.len());
        for ((frame, &uas), n) in frames.iter().zip(&increments).zip(0..) {
            prop_assert_eq!(frame.increment, i64::from(uas));
            prop_assert_eq!(frame.sequence, n);
        }
        prop_assert_eq!((reader.bad_crc(), reader.bytes_skipped()), (0, 0));
    }

    #[test]
    fn kvh_frames_are_read_back(x in -1e-3_f32..1e-3, sequence in 0_u8..128, temp_c in -40_i16..85) {
        let (frames, _) = read(GyroFormat::KvhA, &kvh_a([x, 0.1, -0.1], [0.0; 3], 0x77, sequence, temp_c));
        prop_assert_eq!(frames.len(), 1);
        let arcsec = f64::from(x) * 180.0 * 3600.0 / std::f64::consts::PI;
        // Cut to 2⁻⁴⁸ rad, 7.3e-10 arcsec.
        let increment_arcsec = frames[0].increment as f64 * GyroFormat::KvhA.arcsec_per_count();
        prop_assert!((increment_arcsec - arcsec).abs() <= 7.4e-10 + arcsec.abs() * 1e-12);
        prop_assert_eq!((frames[0].sequence, frames[0].temperature), (sequence, Some(temp_c)));
    }

    /// Garbage is survived, every byte of it is accounted for, and the first whole good frame after it is taken.
    #[test]
    fn garbage_costs_no_good_frame(garbage in prop::collection::vec(any::<u8>(), 0..100), kvh in any::<bool>()) {
        let (format, good) = if kvh {
            (GyroFormat::KvhA, kvh_a([1e-5; 3], [0.0; 3], 0x77, 5, 20))
        } else {
            (GyroFormat::Compact, compact(1234, 5))
        };
        // A beginning of a frame at the end of the garbage waits for its bytes: as many good frames as fit into one
        // frame length, plus one, leave no way to be held back.
        let stream: Vec<u8> = garbage.iter().copied().chain(good.iter().copied().cycle().take(2 * good.len())).collect();
        let (frames, reader) = read(format, &stream);
        // A CRC-32 lets garbage through once in 2^32; the generator does not find such a case by chance.
        prop_assert_eq!(frames.len(), 2);
        prop_assert!(frames.iter().all(|frame| frame.sequence == 5));
        prop_assert_eq!(reader.bytes_skipped() as usize, garbage.len());
    }

    /// Any burst of up to 32 damaged bits is caught, as a CRC-32 promises; the frames around it are taken.
    #[test]
    fn a_damaged_frame_is_never_accepted(start in 0_usize..(14 * 8 - 32), pattern in 1_u32..) {
        let mut damaged = compact(5678, 1);
        for bit in (0..32).filter(|bit| pattern >> bit & 1 == 1) {
            damaged[(start + bit) / 8] ^= 0x80 >> ((start + bit) % 8);
        }
        let stream = [compact(1, 0), damaged, compact(2, 2)].concat();
        let (frames, _) = read(GyroFormat::Compact, &stream);
        let sequences: Vec<u8> = frames.iter().map(|frame| frame.sequence).collect();
        prop_assert_eq!(sequences, [0, 2]);
    }
}
