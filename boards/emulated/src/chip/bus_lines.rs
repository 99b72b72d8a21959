//! The two lines of an I2C bus, which a device can hold low: a device that stretches the clock, hangs, or waits in
//! the middle of a byte. The emulator's devices answer immediately and hold no line.

use delegate::delegate;
use rigless::device::{Device, DeviceContext, RegisterFile, RequestChange};
use rigless::soc::{stm32f427, stm32h743};
use rigless::time::EventId;

/// A controller of an I2C bus, as the emulator has it.
pub(super) trait Controller: Device {
    /// Returns whether this write requests a start condition.
    fn starts(register: Self::Register, value: u64) -> bool;

    /// Returns whether this write resets the controller.
    fn resets(register: Self::Register, value: u64) -> bool;

    /// Returns the bit of this register that shows a busy bus, or 0 if the register has no such bit.
    fn busy(register: Self::Register) -> u64;

    /// Notes that a line is low while no transfer of this controller may run. By default this does nothing: the bus counts as busy
    /// only while a line is low.
    fn note_low_line(_registers: &mut RegisterFile) {}
}

impl Controller for stm32f427::peripherals::i2c::I2c {
    fn starts(register: Self::Register, value: u64) -> bool {
        use stm32f427::generated::i2c3::{Register, cr1};
        register == Register::Cr1 && cr1::START.is_set(value) && cr1::PE.is_set(value)
    }

    fn resets(register: Self::Register, value: u64) -> bool {
        use stm32f427::generated::i2c3::{Register, cr1};
        register == Register::Cr1 && (cr1::SWRST.is_set(value) || !cr1::PE.is_set(value))
    }

    fn busy(register: Self::Register) -> u64 {
        use stm32f427::generated::i2c3::{Register, sr2};
        if register == Register::Sr2 { sr2::BUSY.mask() } else { 0 }
    }

    /// Sets BUSY. Only a stop condition or a reset of the controller clears BUSY (RM0090 27.6.7).
    fn note_low_line(registers: &mut RegisterFile) {
        use stm32f427::generated::i2c3::{Register, sr2};
        registers.set(Register::Sr2, sr2::BUSY.set(registers.get(Register::Sr2), 1));
    }
}

impl Controller for stm32h743::peripherals::i2c::I2c {
    fn starts(register: Self::Register, value: u64) -> bool {
        use stm32h743::generated::i2c1::{Register, cr2};
        register == Register::Cr2 && cr2::START.is_set(value)
    }

    fn resets(register: Self::Register, value: u64) -> bool {
        use stm32h743::generated::i2c1::{Register, cr1};
        register == Register::Cr1 && !cr1::PE.is_set(value)
    }

    fn busy(register: Self::Register) -> u64 {
        use stm32h743::generated::i2c1::{Register, isr};
        if register == Register::Isr { isr::BUSY.mask() } else { 0 }
    }
}

/// A controller with its two lines. Nothing holds a line at first.
#[derive(Debug)]
pub(super) struct Lines<C: Controller> {
    /// Name of the controller on the emulator's bus.
    pub(super) name: &'static str,
    pub(super) controller: C,
    /// Whether a device holds SCL and SDA low.
    low: [bool; 2],
    /// Steps of the transfer that end when SCL is released.
    held: Vec<EventId>,
    /// A start that waits for both lines.
    start: Option<(C::Register, u64)>,
}

impl<C: Controller> Lines<C> {
    pub(super) const fn new(name: &'static str, controller: C) -> Self {
        Self { name, controller, low: [false; 2], held: Vec::new(), start: None }
    }

    /// Makes a device hold SCL (line 0) or SDA (line 1) low, or release it. What waits for a released line continues.
    pub(super) fn hold(
        &mut self,
        line: usize,
        low: bool,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.low[line] = low;
        if low {
            C::note_low_line(registers);
        }
        if !self.low[0] {
            for event in std::mem::take(&mut self.held) {
                self.controller.on_event(event, registers, context);
            }
        }
        if self.low == [false; 2]
            && let Some((register, value)) = self.start.take()
        {
            self.controller.write(register, value, registers, context);
        }
    }
}

impl<C: Controller> Device for Lines<C>
where
    C::Register: Copy + PartialEq + std::fmt::Debug,
{
    type Register = C::Register;

    delegate! {
        to self.controller {
            fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>);
            fn on_request(
                &mut self,
                request: RequestChange,
                registers: &mut RegisterFile,
                context: &mut DeviceContext<'_>,
            );
        }
    }

    fn read(
        &mut self,
        register: Self::Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        let value = self.controller.read(register, registers, context);
        let busy = if self.low == [false; 2] { 0 } else { C::busy(register) };
        if busy == 0 { value } else { Some(value.unwrap_or_else(|| registers.get(register)) | busy) }
    }

    fn write(
        &mut self,
        register: Self::Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if C::resets(register, value) {
            self.held.clear();
            self.start = None;
        }
        if self.low != [false; 2] && C::starts(register, value) {
            self.start = Some((register, value));
        } else {
            self.controller.write(register, value, registers, context);
        }
        if self.low != [false; 2] && C::resets(register, value) {
            C::note_low_line(registers);
        }
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.low[0] {
            self.held.push(event);
        } else {
            self.controller.on_event(event, registers, context);
        }
    }

    fn reset(&mut self) {
        Device::reset(&mut self.controller);
        self.held.clear();
        self.start = None;
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.controller.reset_line(registers, context);
        self.held.clear();
        self.start = None;
    }
}
