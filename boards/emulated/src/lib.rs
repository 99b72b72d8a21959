//! The image that is flashed, run against the physics: the firmware of a [`Board`], unmodified, on its emulated chip,
//! an STM32F427 or an STM32H743, its pins wired to the motors of `motor_hub::model`.
//!
//! ```text
//!          +---------------- emulated chip -----------------+
//! battery -> ADC1          the ELF, instruction by           TIM1 -> PWM  \
//! edges   -> TIM2,3,4,8    instruction, virtual time         PD0-7 -> INA/INB -> bridges -> plants
//! bytes   <-> USART3                                         RTT -> log
//!          +------------------------------------------------+
//! ```
//!
//! A test builds a [`Bench`], lets it run, looks, injects a fault, and at the end calls
//! [`Bench::assert_sound`], which fails if the emulator had a gap or a bridge went an illegal way.
//!
//! Times are virtual. The core retires one instruction per cycle, without the wait states of the
//! real flash: instruction counts are exact, times of code are a lower bound.

mod astray;
mod bench;
mod board;
mod chip;
pub mod elf;
mod lab;
mod pins;
mod processor;
mod pwm;
pub mod recording;
pub mod replay;
mod rtt;
mod serial;
pub mod serve;
mod shafts;
mod silence;
pub mod talk;
mod wiring;

pub use bench::{Bench, Reset, SerialByte, Setup};
pub use board::{Board, UnknownBoard};
pub use chip::{FlashFaults, Pwm};
pub use pins::{Lines, Transition};
pub use processor::Mpu;
pub use pwm::{Grid, Output};
pub use rtt::LogLine;
pub use shafts::{Look, Mounting};
pub use simulated::encoder::{Encoder, Wire};
