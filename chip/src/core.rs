//! The emulator's core with the flash array behind it, which the emulator maps as memory that never changes: what the core stores there, and
//! what it writes to the flash controller's registers, goes to the array's model (see [`crate::flash`]), which changes the memory itself.
#![allow(unsafe_code)] // the emulator hands over where the memory is by its address

use std::ops::Range;

use rigless::emulator::{Access, AccessKind, BitAlias, CoreBus, DataModel, Error, Exit, Processor, Queued};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::flash::{Array, SharedArray};

/// A core of the emulator's, and the array.
#[derive(Debug)]
pub struct Core {
    core: Box<dyn Processor>,
    array: SharedArray,
}

impl Core {
    pub fn new(core: Box<dyn Processor>, array: SharedArray) -> Self {
        Self { core, array }
    }
}

/// What the core reaches, with the array in between.
struct Bus<'a> {
    bus: &'a mut dyn CoreBus,
    array: SharedArray,
    changed: Vec<Range<u64>>,
}

impl CoreBus for Bus<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        let answer = self.bus.access(access, from_code);
        if access.kind == AccessKind::Write {
            let mut array = self.array.lock().expect("one thread");
            self.changed.extend(array.written(access.address, access.width, access.value, access.virtual_time.0));
        }
        answer
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        let changed = self.changed.drain(..).map(|range| Queued::Invalidate(range.start, range.end));
        self.bus.queued().into_iter().chain(changed).collect()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        self.bus.carry_on(instructions, event)
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.bus.stops_before(access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.bus.send_trace(bytes);
    }
}

impl Processor for Core {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let mut bus = Bus { bus, array: self.array.clone(), changed: Vec::new() };
        let ran = self.core.run(budget, &mut bus);
        for range in bus.changed {
            self.core.ask(Queued::Invalidate(range.start, range.end));
        }
        ran
    }

    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        if start == Array::START {
            self.array.lock().expect("one thread").mapped(host);
        }
        // SAFETY: what the caller promises.
        unsafe { self.core.map(start, length, host, writable) }
    }

    fn retired(&self) -> u64 {
        self.core.retired()
    }

    fn ask(&mut self, queued: Queued) {
        self.core.ask(queued);
    }

    fn maps(&self, start: u64, length: u64) -> bool {
        self.core.maps(start, length)
    }

    fn page_size(&self) -> u64 {
        self.core.page_size()
    }

    fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>) {
        self.core.boot(table, read);
    }

    fn reset(&mut self) {
        self.core.reset();
    }

    fn take_reset_request(&mut self) -> bool {
        self.core.take_reset_request()
    }

    fn next_event(&self) -> Option<VirtualNanos> {
        self.core.next_event()
    }

    fn on_event(&mut self, now: VirtualNanos) {
        self.core.on_event(now);
    }

    fn waiting(&self) -> bool {
        self.core.waiting()
    }

    fn pc(&self) -> u64 {
        self.core.pc()
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.core.add_breakpoint(address)
    }

    fn remove_breakpoint(&mut self, address: u64) {
        self.core.remove_breakpoint(address);
    }

    fn pass_breakpoint(&mut self, address: u64) {
        self.core.pass_breakpoint(address);
    }

    fn data_model(&self) -> DataModel {
        self.core.data_model()
    }

    fn byte_order(&self, address: u64) -> Endian {
        self.core.byte_order(address)
    }

    fn save(&self) -> Vec<u8> {
        self.core.save()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.core.load(bytes)
    }

    fn bit_alias(&self, address: u64, width: Width) -> Option<BitAlias> {
        self.core.bit_alias(address, width)
    }

    fn own_ranges(&self) -> Vec<Range<u64>> {
        self.core.own_ranges()
    }
}
