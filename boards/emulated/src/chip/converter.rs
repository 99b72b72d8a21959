//! A converter of the STM32H743 with what the emulator lacks: its first analog watchdog (RM0433 25.4.30), and faults of a
//! test. A reading beyond a threshold of the watchdog sets a flag, and the flag causes an interrupt. A dead converter
//! converts nothing. A late conversion ends some time later than it should.

use delegate::delegate;
use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::soc::stm32h743::generated::adc3::{Register, cfgr, ier, isr};
use rigless::soc::stm32h743::peripherals::adc::{self, Adc};
use rigless::time::{EventId, VirtualNanos};

/// Number of the converter's interrupt in the emulator's list.
const INTERRUPT: usize = 0;

#[derive(Debug)]
pub(crate) struct Converter {
    pub(super) emulated: Adc,
    pub(super) dead: bool,
    /// Time by which the next conversion ends later, ns.
    pub(crate) next_is_late_by: Option<u64>,
    /// The event on which a late conversion ends, and the event on which it should have ended.
    late: Option<(EventId, EventId)>,
    /// Flag AWD1: a reading was beyond a threshold.
    left: bool,
    /// True while the interrupt is raised.
    raised: bool,
}

impl Converter {
    pub(super) fn new(converter: adc::Converter) -> Self {
        // The converter has no clock until the clock tree gives it one.
        let emulated = Adc::new(converter, 0);
        Self { emulated, dead: false, next_is_late_by: None, late: None, left: false, raised: false }
    }

    /// Runs a function while AWD1EN is hidden from the emulator, which would report that it has no analog watchdog.
    fn unguarded(&mut self, registers: &mut RegisterFile, act: impl FnOnce(&mut Adc, &mut RegisterFile)) {
        let configuration = registers.get(Register::Cfgr);
        registers.set(Register::Cfgr, cfgr::AWD1EN.set(configuration, 0));
        act(&mut self.emulated, registers);
        registers.set(Register::Cfgr, configuration);
    }

    /// Adds AWD1 to the emulator's value of ISR.
    fn status(&self, emulated: u64) -> u64 {
        let ready = isr::ADRDY.mask();
        isr::AWD1.set(if self.dead { emulated & ready } else { emulated }, self.left.into())
    }

    fn compare(&mut self, registers: &RegisterFile, now: VirtualNanos) {
        let new =
            self.emulated.peek(Register::Isr, registers, now).is_some_and(|flags| isr::EOC.is_set(flags));
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

impl Device for Converter {
    type Register = Register;

    delegate! {
        to self.emulated {
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
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        let emulated = self.emulated.read(register, registers, context);
        if register == Register::Isr {
            return Some(self.status(emulated.unwrap_or_else(|| registers.get(Register::Isr))));
        }
        emulated
    }

    fn peek(&self, register: Register, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        let emulated = self.emulated.peek(register, registers, now)?;
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
            self.emulated.write(register, value, registers, context);
        } else {
            self.unguarded(registers, |adc, registers| adc.write(register, value, registers, context));
        }
        if register == Register::Isr && isr::AWD1.is_set(value) {
            self.left = false;
        }
        self.interrupt(registers, context);
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if let Some(nanos) = self.next_is_late_by.take() {
            let at = VirtualNanos(context.now().0 + nanos);
            self.late = Some((context.schedule(at), event));
            return;
        }
        let event = self.late.take_if(|(mine, _)| *mine == event).map_or(event, |(_, theirs)| theirs);
        self.unguarded(registers, |adc, registers| adc.on_event(event, registers, context));
        self.compare(registers, context.now());
        self.interrupt(registers, context);
    }

    fn reset(&mut self) {
        Device::reset(&mut self.emulated);
        (self.next_is_late_by, self.late, self.left, self.raised) = (None, None, false, false);
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.emulated.reset_line(registers, context);
        self.left = false;
        self.interrupt(registers, context);
    }
}
