//! A converter of the STM32F427 with its sampling capacitor. A conversion of a channel without a wire reads the charge
//! that the last conversion has left in the capacitor. The emulator's own model has a voltage for every channel
//! instead.
//!
//! With the bit SCAN of CR1 cleared, a group has one channel (RM0090 13.3.8). The emulator uses the bit for the regular group
//! only, so the number of injected channels (JL) is hidden from it.

use delegate::delegate;
use rigless::device::{Device, DeviceContext, RegisterFile, RequestChange};
use rigless::soc::stm32f427::generated::adc1::{Register, cr1, jsqr};
use rigless::soc::stm32f427::peripherals::adc::{Adc, Channel};
use rigless::time::EventId;

use super::RAIL_MV;

const FULL_SCALE: u64 = 0xFFF;

/// The data registers of both groups.
const DATA: [Register; 5] = [Register::Dr, Register::Jdr1, Register::Jdr2, Register::Jdr3, Register::Jdr4];

/// A value that no conversion gives, because readings have 12 bits.
const NO_WORD: u64 = 0xFFFF_FFFF;

#[derive(Debug)]
pub(super) struct AdcWithCapacitor {
    pub(super) converter: Adc,
    /// Channels that nothing drives.
    pub(super) floating: Vec<Channel>,
    /// The voltage of the sampling capacitor, mV.
    held: u32,
}

impl AdcWithCapacitor {
    pub(super) fn new() -> Self {
        // The converter has no clock until the common block gives it one.
        Self { converter: Adc::with_clock(0), floating: Vec::new(), held: 0 }
    }
}

impl AdcWithCapacitor {
    /// Runs a function while JL is hidden from the emulator, if SCAN is cleared.
    fn with_one_channel(registers: &mut RegisterFile, act: impl FnOnce(&mut RegisterFile)) {
        let sequence = registers.get(Register::Jsqr);
        if !cr1::SCAN.is_set(registers.get(Register::Cr1)) {
            registers.set(Register::Jsqr, jsqr::JL.set(sequence, 0));
        }
        act(registers);
        registers.set(Register::Jsqr, sequence);
    }
}

impl Device for AdcWithCapacitor {
    type Register = Register;

    delegate! {
        to self.converter {
            fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>);
            fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>);
            fn read(
                &mut self,
                register: Register,
                registers: &mut RegisterFile,
                context: &mut DeviceContext<'_>,
            ) -> Option<u64>;
            fn on_request(
                &mut self,
                request: RequestChange,
                registers: &mut RegisterFile,
                context: &mut DeviceContext<'_>,
            );
        }
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if register == Register::Jsqr {
            self.converter.write(register, value, registers, context);
        } else {
            Self::with_one_channel(registers, |registers| {
                self.converter.write(register, value, registers, context);
            });
        }
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        for channel in &self.floating {
            self.converter.set_input(*channel, self.held);
        }
        // The register with a new value afterwards has the new reading.
        let before = DATA.map(|register| registers.get(register));
        DATA.into_iter().for_each(|register| registers.set(register, NO_WORD));
        Self::with_one_channel(registers, |registers| self.converter.on_event(event, registers, context));
        for (register, before) in DATA.into_iter().zip(before) {
            match registers.get(register) {
                NO_WORD => registers.set(register, before),
                word => self.held = (word * u64::from(RAIL_MV)).div_ceil(FULL_SCALE) as u32,
            }
        }
    }

    fn reset(&mut self) {
        Device::reset(&mut self.converter);
    }
}
