//! Whatever bytes come, every decoder and every reader of files gives a value or an error: none panics, hangs or takes all memory.
//!
//! The fuzz targets feed them for hours (`cargo +nightly fuzz run NAME`), the acceptance tests for a moment.

use std::path::Path;
use std::{env, fs, process, thread};

use hal_sim::Scenario;
use north::calibrate::attitudes;
use north::campaign::{Campaign, RunReader};
use north::import::{Map, guess};
use north::model_file::ModelFile;
use north::settings_file::read_settings;
use north::{block_csv, characterise};
use north_finder::event::Report;
use north_finder::event::bytes::Bytes;
use north_finder::event::raw::Block;
use north_finder::link::{Ask, Decoder, MAX_REPORT, MAX_REQUEST, Request, encode_request};
use north_finder::sensing::frame::FrameReader;
use north_finder::sensing::frame::kvh::KvhReader;
use north_finder::sequence::Command;
use north_finder::settings::store::{VERSION, decode};
use north_finder::settings::{GyroFormat, Settings};
use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Something that reads bytes: its name, what it does with them, and good ones to begin with.
pub struct Reader {
    pub name: &'static str,
    pub read: fn(&[u8]),
    pub good: &'static [u8],
}

const RUN: &[u8] = b"t_s,index_deg,fog_arcsec,temp_c,ax_g,ay_g\n1,0,9.5,20.1,0.001,-0.002\n2,0,9.6,20.2,0.001,-0.002\n3,90,7.9,20.2,0,0\n";
const CAMPAIGN: &[u8] =
    b"format = 1\ntitle = \"a\"\nlatitude_deg = 34.75\n[[run]]\nfile = \"runs/001.csv\"\nrole = \"fit\"\n";
const SETTINGS: &[u8] = b"latitude_deg = 47.3\n[gyro]\narw_deg_per_sqrt_h = 0.002\n[sequence]\norder = { adaptive = { accuracy_deg = 0.05 } }\n";
const MODEL: &[u8] = b"format = 1\nbias_deg_h = 0.2\n[[terms]]\ncoefficients = [0.085, 0.002]\n[terms.basis.curve]\nchannel = \"temp_c\"\nsignal = \"value\"\nfunction = { powers = { reference = 20.0, degree = 2 } }\n";
const MAP: &[u8] = include_bytes!("../../cli/maps/psins-counts-csv.toml");
const SCENARIO: &[u8] = include_bytes!("../../hal-sim/scenarios/windy-tripod.toml");
const BLOCK: &[u8] = b"t_s,gx_arcsec,gy_arcsec,gz_arcsec,ax_m_s2,ay_m_s2,az_m_s2\n0.01,0.1,0.2,0.3,0,0,9.81\n0.02,0.1,0.2,0.3,0,0,9.81\n";
const ATTITUDES: &[u8] = b"t_s,ax_g,ay_g,az_g\n0.01,0,0,1\n0.02,0,0,1\n0.03,0,1,0\n";

/// All of them.
pub const READERS: &[Reader] = &[
    Reader {
        name: "frame",
        read: frames,
        good: &[0xA5, 0x5A, 7, 5, 0xE3, 0x92, 0, 0, 0x66, 8, 0xE0, 0xB8, 0xC5, 0x51],
    },
    Reader { name: "kvh", read: kvh, good: &[0xFE, 0x81, 0xFF, 0x55, 0x37, 0xA9] },
    Reader { name: "request", read: requests, good: &[2, 6, 1, 1, 1, 1, 1, 1, 2, 0x40, 1, 5, 0] },
    Reader { name: "report", read: reports, good: &[2, 7, 1, 1, 1, 1, 1, 1, 2, 0x40, 1, 5, 0xAF, 0x29, 0x26, 0x32, 0] },
    Reader {
        name: "raw",
        read: raw,
        good: &[0x89, 7, 0xD8, 4, 0x66, 8, 0x85, 8, 1, 1, 0, 1, 0x80, 1, 2, 0, 0, 0, 0x40, 0],
    },
    Reader { name: "record", read: record, good: &[0; 64] },
    Reader { name: "run", read: run, good: RUN },
    Reader { name: "campaign", read: campaign, good: CAMPAIGN },
    Reader { name: "settings", read: settings, good: SETTINGS },
    Reader { name: "model", read: model, good: MODEL },
    Reader { name: "map", read: map, good: MAP },
    Reader { name: "guess", read: guessed, good: RUN },
    Reader { name: "scenario", read: scenario, good: SCENARIO },
    Reader { name: "block", read: block, good: BLOCK },
    Reader { name: "attitudes", read: attitude_readings, good: ATTITUDES },
    Reader { name: "still", read: still, good: RUN },
];

/// Feeds the reader of this name: what a fuzz target does.
pub fn feed(name: &str, bytes: &[u8]) {
    READERS.iter().filter(|reader| reader.name == name).for_each(|reader| (reader.read)(bytes));
}

/// Feeds a reader its good bytes, the same with bytes changed, left out, doubled and put in, and bytes without any sense. The same seed
/// gives the same bytes.
pub fn exercise(reader: &Reader, cases: u32, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (reader.read)(reader.good);
    for case in 0..cases {
        let mut bytes = if case % 4 == 0 { Vec::new() } else { reader.good.to_vec() };
        for _ in 0..random.random_range(1..8) {
            let at = random.random_range(0..=bytes.len());
            match random.random_range(0..5) {
                0 if at < bytes.len() => bytes[at] = random.random(),
                1 => bytes.truncate(at),
                2 => bytes.insert(at, *b"\x00\n\",=.-[]{}e9\x1b\xff".get(random.random_range(0..15)).unwrap_or(&0)),
                3 => bytes.extend_from_within(at..),
                _ => bytes.extend((0..random.random_range(0..64)).map(|_| random.random::<u8>())),
            }
            bytes.truncate(1 << 14);
        }
        (reader.read)(&bytes);
    }
}

/// The bytes as a file, for as long as it is read.
fn as_file(ending: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    let name = format!("north-any-{}-{:?}.{ending}", process::id(), thread::current().id());
    let path = env::temp_dir().join(name);
    if fs::write(&path, bytes).is_ok() {
        read(&path);
        let _ = fs::remove_file(&path);
    }
}

/// Whatever came, the next good frames are taken: the first may be lost to a false header.
fn frames(bytes: &[u8]) {
    let good = [0xA5, 0x5A, 9, 5, 1, 2, 3, 0, 4, 5];
    let frame: Vec<u8> = good.into_iter().chain(hal_sim::frames::crc32(&good).to_le_bytes()).collect();
    for format in [GyroFormat::Compact, GyroFormat::KvhA] {
        let mut reader = FrameReader::new(format);
        let frames = bytes.iter().filter(|&&byte| reader.push(byte).is_some()).count();
        let accounted = frames * format.length() + reader.bytes_skipped() as usize;
        assert!(accounted <= bytes.len() && bytes.len() - accounted < format.length());
        if format == GyroFormat::Compact {
            let taken = frame.iter().chain(&frame).filter(|&&byte| reader.push(byte).is_some()).count();
            assert!(taken >= 1, "good frames are lost");
        }
    }
}

fn kvh(bytes: &[u8]) {
    let mut reader = KvhReader::default();
    for &byte in bytes {
        let _ = reader.push(byte);
    }
}

/// Whatever came, the request after the next 00 is taken.
fn requests(bytes: &[u8]) {
    let mut decoder: Decoder<Request, MAX_REQUEST> = Decoder::default();
    for &byte in bytes.iter().chain(&[0]) {
        let _ = decoder.feed(byte);
    }
    let request = Request::from(Ask::Command(Command::Start));
    let frame = encode_request(&request).unwrap_or_default();
    let found: Vec<_> = frame.iter().filter_map(|&byte| decoder.feed(byte)).collect();
    assert_eq!(found, [Ok(request)]);
}

fn reports(bytes: &[u8]) {
    let mut decoder: Decoder<Report, MAX_REPORT> = Decoder::default();
    for &byte in bytes.iter().chain(&[0]) {
        let _ = decoder.feed(byte);
    }
}

fn raw(bytes: &[u8]) {
    let block = Block { number: 0, bytes: Bytes::start_of(bytes) };
    assert!(block.items().count() <= bytes.len());
}

/// Settings out of a record whose check sum is right by chance.
fn record(bytes: &[u8]) {
    for version in [VERSION - 1, VERSION, VERSION + 1] {
        let mut settings = Settings::default();
        let _ = decode(version, bytes, &mut settings);
        let _ = settings.violations().count();
    }
}

fn run(bytes: &[u8]) {
    as_file("csv", bytes, |path| {
        if let Ok(reader) = RunReader::open(path) {
            let _ = reader.take_while(Result::is_ok).count();
        }
    });
}

fn campaign(bytes: &[u8]) {
    as_file("toml", bytes, |path| drop(Campaign::read(path)));
}

fn settings(bytes: &[u8]) {
    as_file("toml", bytes, |path| drop(read_settings(path, &Settings::default())));
}

fn model(bytes: &[u8]) {
    as_file("toml", bytes, |path| drop(ModelFile::read(path)));
}

fn map(bytes: &[u8]) {
    as_file("toml", bytes, |path| drop(Map::read(path)));
}

fn guessed(bytes: &[u8]) {
    as_file("csv", bytes, |path| drop(guess(path, Some(47.0))));
}

fn scenario(bytes: &[u8]) {
    as_file("toml", bytes, |path| drop(Scenario::load(path)));
}

fn block(bytes: &[u8]) {
    as_file("csv", bytes, |path| drop(block_csv::read(path)));
}

fn attitude_readings(bytes: &[u8]) {
    as_file("csv", bytes, |path| drop(attitudes::read(path, &mut Vec::new())));
}

fn still(bytes: &[u8]) {
    as_file("csv", bytes, |path| drop(characterise::read(path)));
}
