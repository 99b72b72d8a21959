//! A converter of the STM32H743 with its first analog watchdog (RM0433 25.4.30), which the emulator lacks. A reading
//! beyond a threshold sets a flag, and the flag causes an interrupt. A dead converter converts nothing.

use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::soc::stm32h743::generated::adc3::{Register, cfgr, ier, isr};
use rigless::soc::stm32h743::peripherals::adc::{Adc, Converter};
use rigless::time::{EventId, VirtualNanos};

/// Number of the converter's interrupt in the emulator's list.
const INTERRUPT: usize = 0;

#[derive(Debug)]
pub(super) struct AdcWithWatchdog {
    pub(super) converter: Adc,
    pub(super) dead: bool,
    /// Flag AWD1: a reading was beyond a threshold.
    left: bool,
    /// True while the interrupt is raised.
    raised: bool,
}

impl AdcWithWatchdog {
    pub(super) fn new(converter: Converter) -> Self {
        // The converter has no clock until the clock tree gives it one.
        Self { converter: Adc::new(converter, 0), dead: false, left: false, raised: false }
    }

    /// Runs a function while AWD1EN is hidden from the emulator, which would report that it has no analog watchdog.
    fn unguarded(&mut self, registers: &mut RegisterFile, act: impl FnOnce(&mut Adc, &mut RegisterFile)) {
        let configuration = registers.get(Register::Cfgr);
        registers.set(Register::Cfgr, cfgr::AWD1EN.set(configuration, 0));
        act(&mut self.converter, registers);
        registers.set(Register::Cfgr, configuration);
    }

    /// Adds AWD1 to the emulator's value of ISR.
    fn status(&self, emulated: u64) -> u64 {
        let ready = isr::ADRDY.mask();
        isr::AWD1.set(if self.dead { emulated & ready } else { emulated }, self.left.into())
    }

    fn compare(&mut self, registers: &RegisterFile, now: VirtualNanos) {
        let new =
            self.converter.peek(Register::Isr, registers, now).is_some_and(|flags| isr::EOC.is_set(flags));
        if self.dead || !new || !cfgr::AWD1EN.is_set(registers.get(Register::Cfgr)) {
            return;
        }
        let word = registers.get(Register::Dr);
        let [low, high] = [Register::Ltr1, Register::Lhtr1].map(|register| registers.get(register));
        self.left |= word < low || word > high;
    }

    fn interrupt(&mut self, registers: &RegisterFile, context: &mut DeviceContext<'_>) {
        let raised = self.left && ier::AWD1IE.is_set(registers.get(Register::Ier));
        if raised != self.raised {
            self.raised = raised;
            context.interrupt(INTERRUPT, Level::from(raised));
        }
    }
}

impl Device for AdcWithWatchdog {
    type Register = Register;

    forward!(converter: on_clock, on_request);

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        let emulated = self.converter.read(register, registers, context);
        if register == Register::Isr {
            return Some(self.status(emulated.unwrap_or_else(|| registers.get(Register::Isr))));
        }
        emulated
    }

    fn peek(&self, register: Register, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        let emulated = self.converter.peek(register, registers, now)?;
        Some(if register == Register::Isr { self.status(emulated) } else { emulated })
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if register == Register::Cfgr {
            self.converter.write(register, value, registers, context);
        } else {
            self.unguarded(registers, |adc, registers| adc.write(register, value, registers, context));
        }
        if register == Register::Isr && isr::AWD1.is_set(value) {
            self.left = false;
        }
        self.interrupt(registers, context);
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.unguarded(registers, |adc, registers| adc.on_event(event, registers, context));
        self.compare(registers, context.now());
        self.interrupt(registers, context);
    }

    fn reset(&mut self) {
        Device::reset(&mut self.converter);
        (self.left, self.raised) = (false, false);
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.converter.reset_line(registers, context);
        self.left = false;
        self.interrupt(registers, context);
    }
}
