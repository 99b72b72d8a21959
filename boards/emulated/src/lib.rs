//! The flashed image of a [`Board`], unmodified, on its emulated chip: an STM32F427 or an STM32H743. The chip's pins
//! are wired to the motors of `motor_hub::model`.
//!
//! ```text
//!          +---------------- emulated chip -----------------+
//! battery -> ADC1          the ELF, instruction by           TIM1 -> PWM  \
//! edges   -> TIM2,3,4,8    instruction, virtual time         PD0-7 -> INA/INB -> bridges -> plants
//! bytes   <-> USART3                                         RTT -> log
//!          +------------------------------------------------+
//! ```
//!
//! A test builds a [`Bench`], runs it, injects faults, and checks. At the end it calls [`Bench::assert_sound`], which
//! fails after a gap of the emulator or an illegal transition of a bridge.
//!
//! Times are virtual. The emulated core executes one instruction per clock cycle, without the wait states of the real
//! flash. Counts of instructions are exact, and the times that code takes are not those of a real chip.

mod bench;
mod board;
mod bridge_lines;
mod chip;
pub mod elf;
mod faulty_code;
pub mod host_link;
mod processor;
mod pwm;
mod register_device;
pub mod replay;
mod rtt;
mod serial;
pub mod serve;
mod shafts;
mod surroundings;
mod system_break;
mod wiring;

pub use bench::{Bench, ChainBench, LineFault, Setup};
pub use board::{Board, UnknownBoard};
pub use bridge_lines::{Lines, Transition};
pub use chip::{ChipFaults, FlashFaults, ServoPulse};
pub use faulty_code::FaultyCode;
pub use pwm::{Grid, Output};
pub use register_device::RegisterDevice;
pub use rigless::emulator::Hit;
pub use rigless::session::Reset;
pub use rtt::LogLine;
pub use serial::SerialByte;
pub use shafts::{Look, Mounting};
pub use simulated::encoder::{Encoder, Wire};
