//! The independent watchdog beside an erase of flash: its clock has up to 47 kHz (DS8626, low-speed oscillator), so that it may run out 2.7 s after it was
//! fed, and an erase, in which the core stands still, takes up to 2 s. So it is fed just before and just after each.

use rigless::emulator::Access;

use super::Ledger;

const KEY: u64 = 0x4000_3000;
const RELOAD: u64 = 0xAAAA;
const FLASH_CONTROL: u64 = 0x4002_3C10;
/// A sector, and the start of its erase (RM0090, 3.9.8).
const ERASE: u64 = 1 << 16 | 1 << 1;
const LOCK: u64 = 1 << 31;
const JUST_NS: u64 = 1_000_000;

/// When it was fed, ns, and what it has to be fed after.
#[derive(Debug, Default)]
pub struct Watchdog {
    fed_ns: u64,
    erases: bool,
    erased_ns: Option<u64>,
}

impl Watchdog {
    /// The core has written to a register.
    pub fn written(&mut self, access: &Access, ledger: &Ledger) {
        let at = access.virtual_time.0;
        let late = self.erased_ns.take_if(|erased_ns| at > *erased_ns + JUST_NS);
        ledger.must(late.is_none(), || "watchdog: not fed just after an erase".into());
        match access.address {
            KEY if access.value == RELOAD => (self.fed_ns, self.erased_ns) = (at, None),
            FLASH_CONTROL if access.value & ERASE == ERASE => {
                ledger.must(at <= self.fed_ns + JUST_NS, || "watchdog: not fed just before an erase".into());
                self.erases = true;
            }
            FLASH_CONTROL if access.value & LOCK != 0 && self.erases => {
                (self.erases, self.erased_ns) = (false, Some(at))
            }
            _ => {}
        }
    }
}
