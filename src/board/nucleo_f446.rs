//! ST's Nucleo-F446RE: what differs from the STM32F405 of [`super::f405`].
//!
//! The pins are the same, and all of them are on the board's connectors CN7 and CN10; RAM, and the sectors of the flash that the image uses,
//! are at the same addresses. USART2, the host's line, goes to the debug probe of the board, which is a serial port of the host: no cable of
//! its own is needed. The 8 MHz come from that probe as a clock, and not from a crystal (UM1724, 6.7.1: MCO of the ST-LINK, as it is delivered).
//! The flash has 512 KiB: one image, without the second slot of an update.

use north_finder::event::identity;

/// What the board is called on the link.
pub const BOARD: identity::Board = identity::Board::NucleoF446;
/// The crystal's input gets a clock.
pub const CLOCK_COMES_IN: bool = true;
