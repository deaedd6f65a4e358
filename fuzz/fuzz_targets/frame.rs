//! Any bytes from the gyro: the reader never panics, accounts for every byte, accepts no frame with a wrong check sum,
//! and takes the first good frames that follow.
//!
//! cargo +nightly fuzz run frame
#![no_main]

use hal_sim::frames::{crc32, kvh_a};
use libfuzzer_sys::fuzz_target;
use north_finder::frame::FrameReader;
use north_finder::settings::GyroFormat;

fuzz_target!(|bytes: &[u8]| {
    for format in [GyroFormat::Compact, GyroFormat::KvhA] {
        let mut reader = FrameReader::new(format);
        let mut frames = 0;
        for (end, &byte) in (1..).zip(bytes) {
            if reader.push(byte).is_some() {
                frames += 1;
                let frame = &bytes[end - format.length()..end];
                let (content, check) = frame.split_last_chunk::<4>().unwrap();
                let check = match format {
                    GyroFormat::Compact => u32::from_le_bytes(*check),
                    GyroFormat::KvhA => u32::from_be_bytes(*check),
                };
                assert_eq!(crc32(content), check);
            }
        }
        let accounted = frames * format.length() + reader.bytes_skipped() as usize;
        assert!(accounted <= bytes.len() && bytes.len() - accounted < format.length());

        let good = match format {
            GyroFormat::KvhA => kvh_a([1e-5; 3], [0.0; 3], 0x77, 9, 20),
            GyroFormat::Compact => {
                let content = [0xA5, 0x5A, 9, 5, 1, 2, 3, 0, 4, 5];
                content.into_iter().chain(crc32(&content).to_le_bytes()).collect()
            }
        };
        let twice = [good.clone(), good].concat();
        let found = twice.iter().filter_map(|&byte| reader.push(byte)).filter(|frame| frame.sequence == 9).count();
        assert_eq!(found, 2);
    }
});
