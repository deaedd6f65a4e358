extern crate std;

use std::vec::Vec;

use calibration::accelerometer::AccelerometerCalibration;
use embedded_storage::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind, check_erase, check_read, check_write};

use super::*;
use crate::effects::effect::{MAX_EFFECT_WEIGHTS, Port};
use crate::settings::{AnalogueSettings, LinkSettings};

/// Smallest of the boards.
const SECTOR: usize = 8192;

/// Two sectors of 8192 bytes in words of `WORD` bytes that are written once after an erase; power can fail after
/// any number of bytes, in the middle of a word or of an erase.
#[derive(Clone)]
struct Flash<const WORD: usize> {
    bytes: Vec<u8>,
    written: Vec<bool>,
    power_left: usize,
    erases: usize,
}

#[derive(Debug, PartialEq, Eq)]
enum Failure {
    Arguments(NorFlashErrorKind),
    WrittenTwice,
    PowerLost,
}

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const WORD: usize> Flash<WORD> {
    fn erased() -> Self {
        Self {
            bytes: std::vec![0xFF; 2 * SECTOR],
            written: std::vec![false; 2 * SECTOR],
            power_left: usize::MAX,
            erases: 0,
        }
    }

    fn spend(&mut self) -> Result<(), Failure> {
        self.power_left = self.power_left.checked_sub(1).ok_or(Failure::PowerLost)?;
        Ok(())
    }
}

impl<const WORD: usize> ErrorType for Flash<WORD> {
    type Error = Failure;
}

impl<const WORD: usize> ReadNorFlash for Flash<WORD> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        check_read(self, offset, bytes.len()).map_err(Failure::Arguments)?;
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WORD: usize> NorFlash for Flash<WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        check_erase(self, from, to).map_err(Failure::Arguments)?;
        self.erases += 1;
        for at in from as usize..to as usize {
            if at % 256 == 0 {
                self.spend()?;
            }
            self.bytes[at] = 0xFF;
            self.written[at] = false;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        check_write(self, offset, bytes.len()).map_err(Failure::Arguments)?;
        for (at, &byte) in (offset as usize..).zip(bytes) {
            self.spend()?;
            if core::mem::replace(&mut self.written[at], true) {
                return Err(Failure::WrittenTwice);
            }
            self.bytes[at] &= byte;
        }
        Ok(())
    }
}

fn settings(latitude_deg: f64) -> Settings {
    Settings { latitude_deg, ..Settings::default() }
}

#[test]
fn erased_flash_is_missing() {
    assert_eq!(load(&mut Flash::<4>::erased()), Ok(Loaded::Missing));
}

#[test]
fn the_last_saved_is_loaded() {
    let mut flash = Flash::<4>::erased();
    for latitude_deg in [10.0, 20.0, 30.0, 40.0, 50.0] {
        save(&mut flash, &settings(latitude_deg)).unwrap();
        assert_eq!(load(&mut flash), Ok(Loaded::Valid(settings(latitude_deg))));
    }
}

#[test]
fn the_record_is_as_documented() {
    let mut flash = Flash::<4>::erased();
    save(&mut flash, &settings(45.0)).unwrap();
    let first = written(&flash);
    save(&mut flash, &settings(45.5)).unwrap();
    let record = &flash.bytes[first.next_multiple_of(16)..];
    let length = usize::from(u16::from_le_bytes([record[6], record[7]]));
    assert_eq!(record[..6], *b"NFST\x0b\x00");
    assert_eq!(record[8..12], [1, 0, 0, 0]);
    assert_eq!(record[12..20], 45.5_f64.to_le_bytes());
    let crc = CRC_32.checksum(&record[..12 + length]).to_le_bytes();
    assert_eq!(record[12 + length..][..4], crc);
    assert!(record[12 + length + 4..].iter().all(|&byte| byte == 0xFF));
}

/// Bytes of a flash before nothing but erased ones.
fn written<const WORD: usize>(flash: &Flash<WORD>) -> usize {
    flash.bytes.iter().rposition(|&byte| byte != 0xFF).map_or(0, |last| last + 1)
}

/// 8192 bytes of records before one is erased, and that is done at power-up, if power is ever cycled.
#[test]
fn nothing_is_erased_while_there_is_room_and_prepared_flash_never() {
    for prepared in [false, true] {
        let (mut flash, mut erased_while_saving) = (Flash::<4>::erased(), 0);
        for number in 0..100 {
            if prepared {
                prepare(&mut flash).unwrap();
            }
            let before = flash.erases;
            save(&mut flash, &settings(f64::from(number))).unwrap();
            erased_while_saving += flash.erases - before;
            assert_eq!(load(&mut flash), Ok(Loaded::Valid(settings(f64::from(number)))));
        }
        assert!((1..=100 * 320 / SECTOR).contains(&flash.erases), "{}", flash.erases);
        assert_eq!(erased_while_saving > 0, !prepared);
    }
}

#[test]
fn nothing_but_damaged_records_is_corrupt() {
    let mut flash = Flash::<4>::erased();
    save(&mut flash, &settings(45.0)).unwrap();
    flash.bytes[20] ^= 1;
    assert_eq!(load(&mut flash), Ok(Loaded::Corrupt));
    save(&mut flash, &settings(46.0)).unwrap();
    assert_eq!(load(&mut flash), Ok(Loaded::Valid(settings(46.0))));
}

#[test]
fn another_version_is_corrupt() {
    let mut flash = Flash::<4>::erased();
    save(&mut flash, &settings(45.0)).unwrap();
    let length = HEADER + usize::from(u16::from_le_bytes([flash.bytes[6], flash.bytes[7]]));
    flash.bytes[4] = 3;
    let crc = CRC_32.checksum(&flash.bytes[..length]).to_le_bytes();
    flash.bytes[length..][..4].copy_from_slice(&crc);
    assert_eq!(load(&mut flash), Ok(Loaded::Corrupt));
}

/// Bytes at the record's end that came with version 9: the group of the host's line, without a key, and the analogue one with nothing connected.
const SINCE_9_AT_END: usize = 2 + 4 + 8;

/// A record of an earlier version is one of today without what came since, which ended its group: the microsteps, three bytes, and the slip ring,
/// one, with version 8; what the level accelerometers drift by, two numbers of eight bytes, with version 7. Version 10 brought by how much they change while the
/// base stands, eight bytes behind the model's scale factor and bias; version 11 readings that
/// can be, behind those, and where its process enters, a byte at the process' start; version 9 the noise of the
/// gyro's angle, eight bytes behind its random walk, which stands behind the latitude and the byte of the format; what ends the gyro's group, a
/// byte, and the index's, two numbers and a byte; and what ends the record.
#[test]
fn the_versions_before_are_read() {
    for version in [6, 7, 8, 9, 10] {
        let mut flash = Flash::<4>::erased();
        let mut expected =
            Settings { analogue: AnalogueSettings::default(), link: LinkSettings::default(), ..longest::settings() };
        if version < 8 {
            expected.index.microsteps_per_turn = 36_000;
        }
        save(&mut flash, &expected).unwrap();
        let mut place = [0; 8192];
        let until_gyro = (expected.latitude_deg, expected.gyro);
        let gyro_end = HEADER + postcard::to_slice(&until_gyro, &mut place).unwrap().len();
        let until_drift = (expected.latitude_deg, expected.gyro, expected.level);
        let drift_end = HEADER + postcard::to_slice(&until_drift, &mut place).unwrap().len();
        let until_index = (until_drift, expected.disturbance, expected.jitter, expected.index);
        let index_end = HEADER + postcard::to_slice(&until_index, &mut place).unwrap().len();
        let until_model = (until_index, &expected.sequence, expected.time_limit_s);
        let level_drift = HEADER + postcard::to_slice(&until_model, &mut place).unwrap().len() + 1 + 8 + 8;
        let model_end = HEADER + postcard::to_slice(&(until_model, &expected.model), &mut place).unwrap().len();
        let process = postcard::to_slice(&expected.model.as_ref().unwrap().doubt.process, &mut place).unwrap().len();
        let port = model_end - process + 1;
        let plausible = postcard::to_slice(&expected.model.as_ref().unwrap().plausible, &mut place).unwrap().len();
        let model = expected.model.as_mut().unwrap();
        if version < 10 {
            model.level_drift_arcsec = 0.0;
        }
        model.plausible.clear();
        model.doubt.process.as_mut().unwrap().port = Port::Rate;
        let length = usize::from(u16::from_le_bytes([flash.bytes[6], flash.bytes[7]]));
        let angle_noise = HEADER + 8 + 1 + 8;
        let record_end = HEADER + length;
        // From the end on, so that no place moves before its turn.
        let came_since = [
            (9, record_end - SINCE_9_AT_END..record_end),
            (11, port..port + 1),
            (11, level_drift + 8..level_drift + 8 + plausible),
            (10, level_drift..level_drift + 8),
            (9, index_end - 17..index_end),
            (8, index_end - 21..index_end - 17),
            (7, drift_end - 16..drift_end),
            (9, gyro_end - 1..gyro_end),
            (9, angle_noise..angle_noise + 8),
        ];
        let mut less = 0;
        for (_, place) in came_since.into_iter().filter(|(since, _)| version < *since) {
            less += place.len();
            flash.bytes.drain(place);
        }
        flash.bytes[4] = version;
        flash.bytes[6..8].copy_from_slice(&((length - less) as u16).to_le_bytes());
        let end = HEADER + length - less;
        let crc = CRC_32.checksum(&flash.bytes[..end]).to_le_bytes();
        flash.bytes[end..][..4].copy_from_slice(&crc);
        flash.bytes.resize(flash.bytes.len() + less, 0xFF);
        assert_eq!(load(&mut flash), Ok(Loaded::Valid(expected)));
    }
}

#[test]
fn the_longest_settings_fit() {
    let mut flash = Flash::<16>::erased();
    save(&mut flash, &longest::settings()).unwrap();
    assert_eq!(load(&mut flash), Ok(Loaded::Valid(longest::settings())));
}

#[test]
fn too_long_settings_are_refused_and_the_former_stay() {
    // Not valid: five times as many weights as a model can have, and the longest terms beside them.
    let mut settings = longest::settings();
    let model = settings.model.as_mut().unwrap();
    model.effects.iter_mut().for_each(|effect| effect.weights.resize(MAX_EFFECT_WEIGHTS, 1.1).unwrap());
    model.terms = longest::of_terms("a_name_of_twenty_four_by").terms;
    let mut flash = Flash::<4>::erased();
    save(&mut flash, &longest::settings()).unwrap();
    assert_eq!(save(&mut flash, &settings), Err(SaveError::TooLong));
    assert_eq!(load(&mut flash), Ok(Loaded::Valid(longest::settings())));
}

#[test]
fn an_update_changes_what_it_says_and_nothing_without_settings() {
    let mut flash = Flash::<4>::erased();
    assert_eq!(update(&mut flash, &mut [0; MAX_SETTINGS], |_| ()), Err(UpdateError::Nothing));
    save(&mut flash, &settings(45.0)).unwrap();
    let calibration = AccelerometerCalibration { bias_g: [0.01; 3], matrix: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0] };
    update(&mut flash, &mut [0; MAX_SETTINGS], |settings| settings.accelerometer = Some(calibration)).unwrap();
    let expected = Settings { accelerometer: Some(calibration), ..settings(45.0) };
    assert_eq!(load(&mut flash), Ok(Loaded::Valid(expected)));
}

#[test]
fn every_single_flipped_bit_is_seen() {
    let mut flash = Flash::<4>::erased();
    save(&mut flash, &settings(45.0)).unwrap();
    let length = HEADER + usize::from(u16::from_le_bytes([flash.bytes[6], flash.bytes[7]])) + CRC_LENGTH;
    for bit in 0..8 * length {
        let mut damaged = flash.clone();
        damaged.bytes[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(load(&mut damaged), Ok(Loaded::Corrupt), "bit {bit}");
    }
}

#[test]
fn sequence_numbers_may_wrap() {
    assert!(later(0, u32::MAX));
    assert!(!later(u32::MAX, 0));
    assert!(later(5, 4));
}

fn power_cut_at_every_byte<const WORD: usize>(saved_before: usize) {
    let mut before = Flash::<WORD>::erased();
    for number in 0..saved_before {
        save(&mut before, &settings(number as f64)).unwrap();
    }
    let former = load(&mut before).unwrap();
    for bytes in 0.. {
        let mut flash = before.clone();
        flash.power_left = bytes;
        let saved = save(&mut flash, &settings(80.0));
        flash.power_left = usize::MAX;
        let found = load(&mut flash).unwrap();
        if saved.is_ok() {
            assert_eq!(found, Loaded::Valid(settings(80.0)));
            assert!(bytes > 100);
            break;
        }
        assert_eq!(saved, Err(SaveError::Flash(Failure::PowerLost)));
        // Padding after the CRC is no part of the record: without it the new settings are there already.
        let complete = found == Loaded::Valid(settings(80.0));
        let broken_first = saved_before == 0 && matches!(found, Loaded::Missing | Loaded::Corrupt);
        assert!(found == former || complete || broken_first, "after {bytes} bytes: {found:?}");
        // And whatever was left behind, the next save works.
        save(&mut flash, &settings(81.0)).unwrap();
        assert_eq!(load(&mut flash), Ok(Loaded::Valid(settings(81.0))));
    }
}

#[test]
fn a_power_cut_at_any_byte_leaves_the_former_settings() {
    for saved_before in 0..4 {
        power_cut_at_every_byte::<1>(saved_before);
        power_cut_at_every_byte::<4>(saved_before);
        power_cut_at_every_byte::<16>(saved_before);
    }
}
