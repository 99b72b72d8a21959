//! What a board implements: four small traits over its peripherals, two more where its bridges can be heard, and one for
//! digital pins.
//!
//! A board is its pins and peripherals behind these traits, plus the spawning of the tasks of
//! `crate::tasks`. embedded-hal 1.0 has no trait for a quadrature counter, for an ADC or for a
//! bridge with three lines, so these are our own.
//!
//! ```
//! use motor_hub::board::Encoders;
//!
//! /// Counters in memory, the second of them out of order.
//! struct Counters([u16; 1]);
//!
//! impl Encoders<2> for Counters {
//!     fn counts(&mut self) -> [Option<u16>; 2] {
//!         [Some(self.0[0]), None]
//!     }
//! }
//! assert_eq!(Counters([65_535]).counts(), [Some(65_535), None]);
//! ```

use crate::bridge::Drive;
use crate::units::{Milliamperes, Millivolts};
use core::ops::RangeInclusive;

/// The quadrature counters of N motors.
pub trait Encoders<const N: usize> {
    /// All counters, wrapping at 16 bits, counting up when the motor turns CW; `None` for one that cannot
    /// be read now. Must not block.
    ///
    /// A motor whose counter is silent for 20 ms is without an encoder; no other motor is. A counter that
    /// answers again is taken to have counted on meanwhile, by less than 32 768.
    fn counts(&mut self) -> [Option<u16>; N];
}

/// The converter that measures the battery.
#[allow(async_fn_in_trait, reason = "tasks of one thread: no bound on the future is needed")]
pub trait SupplyAdc {
    /// The battery's voltage as measured now, scaled but not judged: [`crate::supply::VrefintScale`] may be
    /// of use. `None` if the converter does not answer or its reference makes no sense. Must end by itself
    /// in a few milliseconds.
    async fn sample(&mut self) -> Option<Millivolts>;

    /// Ends when the battery's voltage lies outside of `quiet`, or so near to its ends that the converter cannot tell,
    /// a millisecond later at most: a converter's own watchdog costs the core nothing meanwhile. May be dropped at any
    /// time.
    async fn leaves(&mut self, quiet: RangeInclusive<Millivolts>);
}

/// N H bridges.
pub trait Bridges<const N: usize> {
    /// Makes all bridges do what `drives` says, from now on.
    ///
    /// On the way from one drive to another a bridge must only pass through states that may be
    /// commanded: never a short circuit, and never the new direction with the old duty.
    fn apply(&mut self, drives: &[Drive; N]);
}

/// Bridges that say when they have switched themselves off, as a VNH5019 does on its DIAG pins.
pub trait BridgeFaults<const N: usize> {
    /// True of each bridge that says so now. Must not block.
    fn faults(&mut self) -> [bool; N];
}

/// Current-sense lines of bridges, each behind a filter of some tenths of a millisecond.
#[allow(async_fn_in_trait, reason = "tasks of one thread: no bound on the future is needed")]
pub trait CurrentSense<const N: usize> {
    /// What the lines show now, positive: the mean currents of their motors in 9/8 and 6/2, nothing in 5/0. `None` of a
    /// motor without a line, or one whose converter does not answer: a zero is a measurement. Must end by itself in a few
    /// milliseconds.
    async fn sample(&mut self) -> [Option<Milliamperes>; N];
}

/// No lines: currents are modelled.
impl<const N: usize> CurrentSense<N> for () {
    async fn sample(&mut self) -> [Option<Milliamperes>; N] {
        [None; N]
    }
}

/// Digital pins for whatever a host connects to them, numbered from 0, as far as there are some: eight at most.
pub trait DigitalPins {
    /// Drives the pins of `driven` to their `levels`, lets go of all others, which a resistor pulls up, and returns the
    /// levels of all: bit i is pin i, 1 is high. A pin that there is not reads 1, as one does that nothing is connected
    /// to. Must not block.
    fn exchange(&mut self, driven: u8, levels: u8) -> u8;
}

/// One that is lent.
impl<T: DigitalPins + ?Sized> DigitalPins for &mut T {
    fn exchange(&mut self, driven: u8, levels: u8) -> u8 {
        (**self).exchange(driven, levels)
    }
}

/// No pins.
impl DigitalPins for () {
    fn exchange(&mut self, _: u8, _: u8) -> u8 {
        u8::MAX
    }
}

/// A watchdog that resets the chip, and with it opens the bridges, unless it is fed.
pub trait Watchdog {
    /// Starts its time anew.
    fn feed(&mut self);
}
