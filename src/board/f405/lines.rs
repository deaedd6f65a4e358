//! The serial lines: the DMA controllers carry their bytes, the processor takes part only where one was damaged and where a report is out.
//!
//! | line | controller, stream, channel |
//! |---|---|
//! | gyro, received (USART1) | DMA2, 2, 4 |
//! | host, received (USART2) | DMA1, 5, 4 |
//! | host, sent (USART2) | DMA1, 6, 4 |
//!
//! What comes goes into the rings of the intake, round and round. The receivers interrupt neither at a byte nor where their line is idle:
//! a tick takes what had come at its beginning, and there it is looked how far the controllers are.
//!
//! Source: RM0090, revision 19, 10.3 (DMA) and 30.3.13 (USART and DMA).

use core::sync::atomic::{AtomicU8, Ordering, fence};

use north_finder::drivers::intake::{Line, LineError};
use stm32f4xx_hal::dma::traits::{DMASet, PeriAddress, Stream};
use stm32f4xx_hal::dma::{DmaChannel, DmaDirection, DmaFlag, MemoryToPeripheral, PeripheralToMemory, Stream6};
use stm32f4xx_hal::pac::{self, usart1};
use stm32f4xx_hal::prelude::*;

/// Of all three streams.
const CHANNEL: u8 = 4;

/// A line's bytes on their way into its ring.
pub struct Reception<STREAM, const N: usize> {
    stream: STREAM,
    line: &'static Line<N>,
}

impl<STREAM: Stream, const N: usize> Reception<STREAM, N> {
    /// Begins; the receiver may be started afterwards.
    pub fn start<USART>(mut stream: STREAM, receiver: &USART, line: &'static Line<N>) -> Self
    where
        USART: PeriAddress<MemSize = u8> + DMASet<STREAM, CHANNEL, PeripheralToMemory>,
    {
        stream.set_channel(DmaChannel::Channel4);
        stream.set_direction(DmaDirection::PeripheralToMemory);
        stream.set_peripheral_address(receiver.address());
        stream.set_memory_address(line.ring().all_places().as_ptr() as u32);
        stream.set_memory_increment(true);
        stream.set_number_of_transfers(N as u16);
        stream.set_circular_mode(true);
        // SAFETY: byte by byte, as after the controller's reset, into N bytes that are a static's, which all may change at any time.
        unsafe { stream.enable() };
        Self { stream, line }
    }

    /// Looks how far the controller is. Its counter alone says so: the flag that it has gone around rises some cycles after the counter has
    /// begun anew.
    pub fn look(&mut self) {
        self.line.ring().come_to(N.saturating_sub(self.stream.number_of_transfers().into()));
    }
}

/// The gyro's line.
pub struct GyroLine(pub(super) pac::USART1);

impl GyroLine {
    /// Takes the interrupt.
    pub fn serve<const N: usize>(&mut self, line: &Line<N>) {
        count_errors(&self.0, line);
    }
}

/// The gyro's line, away from the instrument: a byte at a time, which is out long before the next tick.
pub struct GyroPort;

impl GyroPort {
    pub fn send(&mut self, byte: u8) {
        // SAFETY: writing sends; only this writes there, and reading it is the DMA controller's.
        unsafe { (*pac::USART1::ptr()).dr().write(|w| w.dr().bits(byte.into())) };
    }
}

/// The host's line.
pub struct HostLine(pub(super) pac::USART2);

impl HostLine {
    /// Takes the interrupt; gives whether what was to be sent is out, to its last bit.
    pub fn serve<const N: usize>(&mut self, line: &Line<N>) -> bool {
        let sent = count_errors(&self.0, line).tc().bit_is_set();
        if sent {
            const COMPLETE: u16 = 1 << 6;
            // SAFETY: a flag is cleared by a 0, and left as it is by a 1.
            self.0.sr().write(|w| unsafe { w.bits(!COMPLETE) });
        }
        sent
    }
}

/// What a receiver found wrong; gives its flags. The controller has taken the byte meanwhile.
fn count_errors<const N: usize>(registers: &usart1::RegisterBlock, line: &Line<N>) -> usart1::sr::R {
    let flags = registers.sr().read();
    let (overrun, framing, noise) = (flags.ore().bit_is_set(), flags.fe().bit_is_set(), flags.nf().bit_is_set());
    if overrun || framing || noise {
        // Reading the data after the flags clears these.
        registers.dr().read();
        let kinds = [(overrun, LineError::Overrun), (framing, LineError::Framing), (noise, LineError::Noise)];
        kinds.into_iter().filter(|(found, _)| *found).for_each(|(_, error)| line.lost(error));
    }
    flags
}

/// The host's line, away from the instrument.
pub struct ReportPort(Stream6<pac::DMA1>);

impl ReportPort {
    pub fn new<USART>(mut stream: Stream6<pac::DMA1>, sender: &USART) -> Self
    where
        USART: PeriAddress<MemSize = u8> + DMASet<Stream6<pac::DMA1>, CHANNEL, MemoryToPeripheral>,
    {
        stream.set_channel(DmaChannel::Channel4);
        stream.set_direction(DmaDirection::MemoryToPeripheral);
        stream.set_peripheral_address(sender.address());
        stream.set_memory_increment(true);
        Self(stream)
    }

    /// Begins to send bytes from where they are; [`HostLine::serve`] tells when all are out. Only then the next ones can be sent.
    pub fn start(&mut self, bytes: &'static [AtomicU8]) {
        self.0.clear_flags(DmaFlag::TransferComplete | DmaFlag::HalfTransfer | DmaFlag::FifoError);
        self.0.set_memory_address(bytes.as_ptr() as u32);
        self.0.set_number_of_transfers(bytes.len().min(u16::MAX.into()) as u16);
        fence(Ordering::SeqCst);
        // SAFETY: byte by byte, as after the controller's reset, and no more of them than there are.
        unsafe { self.0.enable() };
    }
}
