//! The independent watchdog of the STM32H743 (RM0433 45), which the emulator lacks. The LSI counts a counter of twelve bits
//! down, which resets the chip at zero. Two things are left out: the window, which the firmware does not set, and the delay
//! of five cycles of the LSI until prescaler and reload value take effect.

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32h743::generated::iwdg::Register;
use rigless::soc::stm32h743::peripherals::rcc::IWDG_STARTED;
use rigless::time::{EventId, VirtualNanos};

// KR (45.4.1).
const RELOAD: u64 = 0xAAAA;
const UNLOCK: u64 = 0x5555;
const START: u64 = 0xCCCC;

/// Value from which the counter starts while no reload value has been written.
const FULL: u64 = 0xFFF;

#[derive(Debug, Default)]
pub(super) struct Watchdog {
    unlocked: bool,
    started: bool,
    prescaler: u64,
    reload: Option<u64>,
    /// Frequency of the LSI; 0 until the watchdog is started.
    hz: u64,
    /// Ticks from which the counter was last started.
    loaded: u64,
    expiry: Option<EventId>,
}

impl Watchdog {
    /// Starts to count down from `ticks`.
    fn load(&mut self, ticks: u64, context: &mut DeviceContext<'_>) {
        self.loaded = ticks;
        self.expiry = None;
        if self.started && self.hz > 0 {
            // The prescaler divides by 4 for PR = 0, and by twice as much for each further value, at most by 256 (45.4.2).
            let cycles = (ticks + 1) * (4 << self.prescaler.min(6));
            let after = cycles * 1_000_000_000 / self.hz;
            self.expiry = Some(context.schedule(VirtualNanos(context.now().0 + after)));
        }
    }
}

impl Device for Watchdog {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match register {
            Register::Kr => {
                self.unlocked = value == UNLOCK;
                match value {
                    START if !self.started => {
                        self.started = true;
                        context.request(IWDG_STARTED, Level::High);
                        self.load(FULL, context);
                    }
                    RELOAD => self.load(self.reload.unwrap_or(FULL), context),
                    _ => {}
                }
            }
            Register::Pr if self.unlocked => self.prescaler = value,
            Register::Rlr if self.unlocked => self.reload = Some(value & FULL),
            Register::Pr => registers.set(register, self.prescaler),
            Register::Rlr => registers.set(register, self.reload.unwrap_or(FULL)),
            Register::Sr | Register::Winr => {}
        }
    }

    fn on_clock(&mut self, hz: u64, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.hz = hz;
        self.load(self.loaded, context);
    }

    fn on_event(&mut self, event: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if self.expiry == Some(event) {
            context.request_reset();
        }
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
