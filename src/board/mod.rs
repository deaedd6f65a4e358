//! The boards: the only place that knows registers and pins. Every board offers the same names.
//!
//! | name | what |
//! |---|---|
//! | `BOARD` | its name on the link |
//! | `init` | clocks, pins and peripherals, and where bytes go; gives a `Board` |
//! | `Ticker` | the 2.5 ms timer (TIM2) that also tells the gyro to sample, how many ticks were lost, and the bytes that came on both lines |
//! | `Slots` | the 3200 Hz timer (TIM3) of the motor |
//! | `GyroLine`, `HostLine` | what interrupts on the lines (USART1, USART2): a damaged byte, a report that is out |
//! | `ReportPort`, `GyroPort` | the senders of the link to the host and of commands to the gyro |
//! | `Accelerometer`, `Encoder`, `Block` | SPI devices |
//! | `Step`, `Direction`, `Enable` | output pins of the motor |
//! | `Limit` | the input of its limit switch |
//! | `Converter`, `analogue_calibration` | the analogue inputs, and what the chip's maker converted |
//! | `Flash` | NOR flash for the settings |
//! | `slots`, `serial` | the slots of an update, where the board has them; the chip's own number |
//! | `sleep` | waits for the next interrupt |
//! | `TICK_ROUNDS` | rounds of a loop of two instructions that take a tick |
//! | `passed_permille` | how much of the tick under way has passed |
//! | `restart` | starts anew, as after power-up |
//! | `Watchdog` | starts the instrument anew where it is not fed |
//! | `motor_off` | takes the current off the motor, whatever else happens |
//! | `NOT_MASKABLE` | what the processor's non-maskable interrupt means |
//! | `pac` | the device for RTIC: interrupts by the STM32's names |

#[cfg(any(
    all(feature = "f405", feature = "mps2"),
    all(feature = "f405", feature = "nucleo-f446"),
    all(feature = "nucleo-f446", feature = "mps2")
))]
compile_error!("choose one board: for QEMU build with --no-default-features --features mps2");
#[cfg(not(any(feature = "f405", feature = "nucleo-f446", feature = "mps2")))]
compile_error!("choose a board: --features f405, nucleo-f446 or mps2");

pub mod crash;
#[cfg(feature = "stm32f4")]
mod f405;
pub mod memory;
#[cfg(feature = "nucleo-f446")]
mod nucleo_f446;
pub mod report_queue;
#[cfg(feature = "stm32f4")]
pub use f405::*;

#[cfg(all(feature = "mps2", not(feature = "stm32f4")))]
mod mps2;
#[cfg(all(feature = "mps2", not(feature = "stm32f4")))]
pub use mps2::*;
