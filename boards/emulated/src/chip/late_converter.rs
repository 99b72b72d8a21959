//! A converter of the STM32H743. A test can make one of its conversions take too long.

use rigless::device::{Device, DeviceContext, RegisterFile, RequestChange};
use rigless::soc::stm32h743::generated::adc3::Register;
use rigless::soc::stm32h743::peripherals::adc::{Adc, Converter};
use rigless::time::{EventId, VirtualNanos};

#[derive(Debug)]
pub(super) struct DelayedAdc {
    pub(super) converter: Adc,
    /// Time by which the next conversion ends later, ns.
    pub(super) next_is_late_by: Option<u64>,
    /// The event on which a late conversion ends, and the event on which it should have ended.
    late: Option<(EventId, EventId)>,
}

impl DelayedAdc {
    pub(super) fn new(converter: Converter) -> Self {
        // The converter has no clock until the clock tree gives it one.
        Self { converter: Adc::new(converter, 0), next_is_late_by: None, late: None }
    }
}

impl Device for DelayedAdc {
    type Register = Register;

    forward!(converter: read, write, on_clock, on_request, reset_line);

    fn peek(&self, register: Register, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        self.converter.peek(register, registers, now)
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if let Some(nanos) = self.next_is_late_by.take() {
            let at = VirtualNanos(context.now().0 + nanos);
            self.late = Some((context.schedule(at), event));
            return;
        }
        let event = self.late.take_if(|(mine, _)| *mine == event).map_or(event, |(_, theirs)| theirs);
        self.converter.on_event(event, registers, context);
    }

    fn reset(&mut self) {
        Device::reset(&mut self.converter);
        (self.next_is_late_by, self.late) = (None, None);
    }
}
