//! What a crash leaves behind, in memory that a reset does not clear, for the next start to tell.
//!
//! A panic, a hard fault, a stack overflow and a late task all end here: the motor goes off, what is known is kept, the processor
//! starts anew. A stack overflow is a hard fault, since nothing lies below the stack.

use core::arch::naked_asm;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use north_finder::event::restart::{self, Cause, Crash, Provocation, Text, WORDS};

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
    /// Not set at power-up: whoever reads it must expect anything.
    static mut _crash: [u32; WORDS];
}

/// The crash that ended the run before, once.
pub fn take() -> Option<Crash> {
    // SAFETY: every bit pattern is a number, and nothing else runs: the tasks have not begun, and a crash ends everything.
    let words = unsafe { (&raw const _crash).read_volatile() };
    keep([0; WORDS]);
    Crash::of_words(&words)
}

fn keep(words: [u32; WORDS]) {
    // SAFETY: memory that the linker sets aside for this, and nothing else runs: see above.
    unsafe { (&raw mut _crash).write_volatile(words) };
}

/// Keeps what is known, with the motor off, and starts anew.
pub fn end(crash: &Crash) -> ! {
    cortex_m::interrupt::disable();
    super::motor_off();
    keep(Crash { program: program(), ..*crash }.to_words());
    SCB::sys_reset()
}

/// CRC-32 of the program, by which an image is known: of all that is linked between the vectors and the variables' first values.
pub fn program() -> u32 {
    unsafe extern "C" {
        static __stext: u8;
        static __erodata: u8;
    }
    let (from, to) = (&raw const __stext, &raw const __erodata);
    // SAFETY: the linker's symbols of one piece of flash, the earlier first.
    restart::check(unsafe { core::slice::from_raw_parts(from, to.byte_offset_from(from) as usize) })
}

/// A task did not check in.
pub fn late(task: &str) -> ! {
    end(&Crash { message: Text::start_of(task), ..Crash::new(Cause::LateTask) })
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let (file, line) = info.location().map_or(("", 0), |place| (place.file(), place.line()));
    // Messages with numbers in them are left out: to write them would take kilobytes of flash.
    let message = info.message().as_str().unwrap_or_default();
    end(&Crash { line, file: Text::end_of(file), message: Text::start_of(message), ..Crash::new(Cause::Panic) })
}

/// The processor's vector: goes on with an empty stack, because the one there was may be what is wrong.
///
/// # Safety
///
/// For the processor alone.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "mrs r0, MSP",
        "ldr r1, =_stack_start",
        "msr MSP, r1",
        "b {hard_fault}",
        hard_fault = sym hard_fault,
    )
}

/// The same for what no software can hold off.
///
/// # Safety
///
/// For the processor alone.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn NonMaskableInt() -> ! {
    naked_asm!("mrs r0, MSP", "b {not_maskable}", not_maskable = sym not_maskable)
}

extern "C" fn not_maskable(frame: *const u32) -> ! {
    end(&seen(super::NOT_MASKABLE, frame))
}

#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    let message = Text::start_of("an interrupt without a task");
    end(&Crash { line: number as u32, message, ..Crash::new(Cause::Panic) })
}

extern "C" fn hard_fault(frame: *const u32) -> ! {
    let overflow = frame < &raw const _stack_end;
    end(&seen(if overflow { Cause::StackOverflow } else { Cause::HardFault }, frame))
}

/// `frame` is where the processor put its registers, if the stack had room for them: r0-r3, r12, lr, pc, xpsr.
fn seen(cause: Cause, frame: *const u32) -> Crash {
    const LINK_REGISTER: usize = 5;
    const PROGRAM_COUNTER: usize = 6;
    const WORDS_OF_FRAME: usize = 8;
    let (bottom, top) = (&raw const _stack_end, &raw const _stack_start);
    let on_stack = frame >= bottom && frame.wrapping_add(WORDS_OF_FRAME) <= top;
    // SAFETY: within the stack.
    let register = |number: usize| if on_stack { unsafe { frame.add(number).read_volatile() } } else { 0 };
    // SAFETY: reading has no effect.
    let fault_status = unsafe { (*SCB::PTR).cfsr.read() };
    Crash {
        program_counter: register(PROGRAM_COUNTER),
        link_register: register(LINK_REGISTER),
        stack_pointer: frame as u32,
        fault_status,
        ..Crash::new(cause)
    }
}

/// The report task shall never end.
static REPORT_HANGS: AtomicBool = AtomicBool::new(false);

/// Where the report task waits until a report is out.
pub async fn hang_if_provoked() {
    if REPORT_HANGS.load(Ordering::Relaxed) {
        core::future::pending().await
    }
}

/// Crashes on purpose, or takes its time.
pub fn provoke(how: Provocation) {
    match how {
        Provocation::Panic => panic!("provoked"),
        Provocation::HardFault => cortex_m::asm::udf(),
        Provocation::StackOverflow => {
            core::hint::black_box(fill_stack(0));
            panic!("the stack has no end")
        }
        // Not the hint that a loop waits: an emulator leaves its loop at every one of them.
        Provocation::Hang => loop {
            cortex_m::asm::nop();
        },
        Provocation::HangReport => REPORT_HANGS.store(true, Ordering::Relaxed),
        Provocation::Lag { ticks } => cortex_m::asm::delay(u32::from(ticks) * super::TICK_ROUNDS),
    }
}

/// Goes deeper and deeper.
#[inline(never)]
fn fill_stack(depth: u32) -> u32 {
    let room = core::hint::black_box([depth; 64]);
    if depth == u32::MAX {
        return depth;
    }
    room.iter().fold(fill_stack(core::hint::black_box(depth.wrapping_add(1))), |sum, each| sum.wrapping_add(*each))
}

/// What the board says of itself comes after the first second, and then every ten seconds.
const FIRST_VITALS_TICK: u32 = 399;
const VITALS_TICKS: u32 = 4000;
/// Words of the stack that are looked at in each of the ticks before: 64 KiB, more than there are.
const SWEEP_WORDS: usize = 64;
const SWEEP_TICKS: u32 = 256;

/// Looks for the most of the stack that was ever used, a few words at a time, by the paint that is gone from it.
#[derive(Default)]
pub struct StackSweep {
    /// As many words from the stack's end on are still painted.
    painted: usize,
}

impl StackSweep {
    /// A tick's part of the sweep; where the board is to say it, how much of the stack was ever used, bytes.
    pub fn tick(&mut self, tick: u64) -> Option<u32> {
        let to_vitals = (VITALS_TICKS + FIRST_VITALS_TICK - tick as u32 % VITALS_TICKS) % VITALS_TICKS;
        if (1..=SWEEP_TICKS).contains(&to_vitals) {
            self.go_on(SWEEP_WORDS);
        }
        (to_vitals == 0).then(|| self.finish())
    }

    /// Looks at so many words more.
    pub fn go_on(&mut self, words: usize) {
        // SAFETY: from the stack's end to its start is the stack, which was painted before main.
        let room = unsafe { (&raw const _stack_start).offset_from(&raw const _stack_end) } as usize;
        for _ in 0..words.min(room - self.painted) {
            // SAFETY: as above.
            if unsafe { (&raw const _stack_end).add(self.painted).read_volatile() } != cortex_m_rt::STACK_PAINT_VALUE {
                break;
            }
            self.painted += 1;
        }
    }

    /// Ends the sweep: how much of the stack was ever used, bytes.
    pub fn finish(&mut self) -> u32 {
        let painted_bytes = 4 * core::mem::take(&mut self.painted) as u32;
        (&raw const _stack_start as u32) - (&raw const _stack_end as u32) - painted_bytes
    }
}
