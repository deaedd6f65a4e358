//! The loader: starts the image of one of the slots. It is in the flash's first sector and never changes in the field.
//!
//! It runs from the internal oscillator, touches nothing but the flash's controller, and writes a word only: the mark that an image was tried.
//! Signatures are not its business: an image gets its seal from the firmware that received and checked it, and who can write flash otherwise has a
//! debug probe.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is the loader: it runs on a board, from the first sector of its flash.");
    std::process::exit(2);
}

#[cfg(target_os = "none")]
mod flash;

#[cfg(target_os = "none")]
mod loader {
    use core::panic::PanicInfo;

    use cortex_m_rt::entry;
    use north_boot::{SLOTS, choice};

    use super::flash::Slot;

    #[entry]
    fn main() -> ! {
        let mut slots = SLOTS.map(Slot::at);
        match choice::choose(&mut slots).and_then(|number| SLOTS.get(number)) {
            // SAFETY: the image begins with its vectors, which are where the processor is told that they are; nothing of the loader is used afterwards.
            Some(&origin) => unsafe {
                let core = cortex_m::Peripherals::steal();
                core.SCB.vtor.write(origin);
                cortex_m::asm::bootload(origin as *const u32)
            },
            // No image: a probe brings one.
            None => loop {
                cortex_m::asm::wfi();
            },
        }
    }

    #[panic_handler]
    fn panic(_: &PanicInfo) -> ! {
        cortex_m::peripheral::SCB::sys_reset()
    }
}
