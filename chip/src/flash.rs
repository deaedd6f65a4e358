//! The flash array: it keeps what the controller's registers make of the stores into it.
//!
//! Source: RM0090, revision 19, 3.5.2 (caches), 3.6.1 (unlocking), 3.6.2 (parallelism), 3.6.3 (erasing), 3.6.4 (programming), 3.9
//! (registers). Written from it and not from the driver. How long the controller is busy is the emulator's business.
#![allow(unsafe_code)] // the emulator hands over where the memory is by its address

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use rigless::soc::Width;

use crate::witness::Ledger;

pub type SharedArray = Arc<Mutex<Array>>;

mod register {
    pub const ACR: u64 = 0x4002_3C00;
    pub const KEYR: u64 = 0x4002_3C04;
    pub const CR: u64 = 0x4002_3C10;
}
const KEYS: [u64; 2] = [0x4567_0123, 0xCDEF_89AB];
const PROGRAM: u64 = 1 << 0;
const ERASE_SECTOR: u64 = 1 << 1;
const SECTOR_SHIFT: u32 = 3;
const SIZE_SHIFT: u32 = 8;
const START: u64 = 1 << 16;
const LOCK: u64 = 1 << 31;
const DATA_CACHE: u64 = 1 << 10;
const RESET_DATA_CACHE: u64 = 1 << 12;
/// After the controller is locked, the data cache has this long to be reset, ns.
const CACHE_NS: u64 = 10_000;
/// Bytes whose programming takes as long as erasing a sector of 16 KiB may be interrupted in.
const BYTES_OF_AN_ERASE: u64 = 64;
const MEGABYTE: usize = 1 << 20;
const ERASED: u8 = 0xFF;
/// Where the sectors for settings are.
const SETTINGS: usize = 16 << 10;
const SETTINGS_BYTES: usize = 32 << 10;

/// The array and the part of the controller that it follows.
#[derive(Debug)]
pub struct Array {
    host: *mut u8,
    /// What the sectors for settings hold.
    settings: Vec<u8>,
    unlocked: bool,
    keys: usize,
    control: u64,
    cache_control: u64,
    /// Something was erased and the data cache not reset since; and when the controller was locked after that.
    stale: bool,
    locked_ns: Option<u64>,
    /// Bytes that are programmed until power fails.
    power_left: Option<u64>,
    /// Set when power has failed.
    off: Arc<AtomicBool>,
    ledger: Ledger,
}

// SAFETY: the memory is the emulator's, which moves to the same thread and lives as long.
unsafe impl Send for Array {}

impl Array {
    pub const START: u64 = 0x0800_0000;

    /// `settings` is what the sectors for settings hold to begin with; the rest of them is erased.
    pub fn new(settings: &[u8], power_left: Option<u64>, off: Arc<AtomicBool>, ledger: Ledger) -> Self {
        let mut settings = settings.to_vec();
        settings.resize(SETTINGS_BYTES, ERASED);
        Self {
            host: std::ptr::null_mut(),
            settings,
            unlocked: false,
            keys: 0,
            control: LOCK,
            cache_control: 0,
            stale: false,
            locked_ns: None,
            power_left,
            off,
            ledger,
        }
    }

    /// Where the emulator keeps the array's bytes.
    pub fn mapped(&mut self, host: *mut u8) {
        self.host = host;
    }

    /// The chip was reset.
    pub fn reset(&mut self) {
        (self.unlocked, self.keys, self.control, self.cache_control) = (false, 0, LOCK, 0);
        (self.stale, self.locked_ns) = (false, None);
    }

    /// What the sectors for settings hold.
    pub fn settings(&self) -> &[u8] {
        &self.settings
    }

    /// Changes a byte of the first megabyte.
    fn change(&mut self, address: u64, change: impl FnOnce(u8) -> u8) {
        let Some(offset) = Self::offset(address) else { return };
        if self.host.is_null() {
            return;
        }
        let place = self.host.wrapping_add(offset);
        // SAFETY: within the memory that the emulator mapped, which the core, whose access this is, does not use meanwhile.
        let byte = unsafe {
            *place = change(*place);
            *place
        };
        if let Some(kept) = offset.checked_sub(SETTINGS).and_then(|offset| self.settings.get_mut(offset)) {
            *kept = byte;
        }
    }

    fn offset(address: u64) -> Option<usize> {
        usize::try_from(address.checked_sub(Self::START)?).ok().filter(|offset| *offset < MEGABYTE)
    }

    /// The core wrote this. Gives what of the array has changed.
    pub fn written(&mut self, address: u64, width: Width, value: u64, at_ns: u64) -> Option<Range<u64>> {
        if self.off.load(Ordering::Relaxed) {
            return None;
        }
        match address {
            register::ACR => self.cache(value),
            register::KEYR => self.key(value),
            register::CR => return self.control(value, at_ns),
            _ if Self::offset(address).is_some() => return self.store(address, width, value),
            _ => {}
        }
        None
    }

    /// At times: whether the data cache was reset soon enough.
    pub fn look(&mut self, at_ns: u64) {
        if self.stale && self.locked_ns.is_some_and(|locked_ns| at_ns > locked_ns + CACHE_NS) {
            self.ledger.violation("flash: erased, and the data cache holds what was there before (RM0090, 3.5.2)");
            self.stale = false;
        }
    }

    fn cache(&mut self, value: u64) {
        // It can be reset only while it is off.
        if value & RESET_DATA_CACHE != 0 && value & DATA_CACHE == 0 && self.cache_control & DATA_CACHE == 0 {
            self.stale = false;
        }
        self.cache_control = value;
    }

    fn key(&mut self, value: u64) {
        if KEYS.get(self.keys) == Some(&value) {
            self.keys += 1;
            self.unlocked |= self.keys == KEYS.len();
        } else {
            // Until the next reset.
            self.keys = usize::MAX;
        }
    }

    fn control(&mut self, value: u64, at_ns: u64) -> Option<Range<u64>> {
        if !self.unlocked {
            self.ledger.violation("flash: the controller is written to while it is locked (RM0090, 3.6.1)");
            return None;
        }
        self.control = value;
        if value & LOCK != 0 {
            (self.unlocked, self.keys, self.locked_ns) = (false, 0, Some(at_ns));
            return None;
        }
        (value & START != 0 && value & ERASE_SECTOR != 0).then(|| self.erase(value >> SECTOR_SHIFT & 0xF))
    }

    fn erase(&mut self, sector: u64) -> Range<u64> {
        const KIB: u64 = 1024;
        let place = match sector {
            0..4 => sector * 16 * KIB..(sector + 1) * 16 * KIB,
            4 => 64 * KIB..128 * KIB,
            _ => (sector - 4) * 128 * KIB..(sector - 3) * 128 * KIB,
        };
        let place = Self::START + place.start..Self::START + place.end;
        (self.stale, self.locked_ns) = (true, None);
        let cut = self.spend(BYTES_OF_AN_ERASE);
        for address in place.clone() {
            // An erase that is cut leaves anything: here some of the bits.
            self.change(address, |byte| if cut { byte | address.wrapping_mul(0x9E37_79B9) as u8 } else { ERASED });
        }
        place
    }

    fn store(&mut self, address: u64, width: Width, value: u64) -> Option<Range<u64>> {
        let size = self.control >> SIZE_SHIFT & 0b11;
        let wanted = match width {
            Width::W8 => 0,
            Width::W16 => 1,
            Width::W32 => 2,
            Width::W64 => 3,
        };
        if !self.unlocked || self.control & PROGRAM == 0 {
            let Self { unlocked, control, .. } = self;
            self.ledger.violation(format!(
                "flash: a store at {address:08x} while programming is not switched on (unlocked: {unlocked}, CR {control:08x}; PGSERR; RM0090, 3.6.4)"
            ));
            return None;
        }
        if size != wanted || size == 3 {
            self.ledger.violation("flash: a store of another width than PSIZE says (PGPERR; RM0090, 3.6.2)");
            return None;
        }
        let bytes = 1_u64 << wanted;
        let cut = self.spend(bytes);
        for (number, address) in (address..address + bytes).enumerate() {
            let written = (value >> (8 * number)) as u8;
            // Bits only go from 1 to 0; a word that is cut has some of them.
            self.change(address, |byte| byte & if cut { written | 0x5A } else { written });
        }
        Some(address..address + bytes)
    }

    /// Uses power; gives whether it fails meanwhile.
    fn spend(&mut self, bytes: u64) -> bool {
        let Some(left) = &mut self.power_left else { return false };
        let cut = *left < bytes;
        *left = left.saturating_sub(bytes);
        if cut {
            self.off.store(true, Ordering::Relaxed);
        }
        cut
    }
}
