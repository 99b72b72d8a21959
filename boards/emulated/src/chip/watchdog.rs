//! The independent watchdog of the STM32H743 (RM0433 45), which the emulator lacks: twelve bits, counted down by the
//! LSI, that reset the chip at zero. Left out are the window, which the firmware does not set, and the five cycles of
//! the LSI that prescaler and reload take to get across.

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32h743::generated::iwdg::Register;
use rigless::soc::stm32h743::peripherals::rcc::IWDG_STARTED;
use rigless::time::{EventId, VirtualNanos};

// KR (45.4.1).
const RELOAD: u64 = 0xAAAA;
const UNLOCK: u64 = 0x5555;
const START: u64 = 0xCCCC;

/// What the counter starts from.
const FULL: u64 = 0xFFF;

#[derive(Debug, Default)]
pub(super) struct Watchdog {
    unlocked: bool,
    started: bool,
    prescaler: u64,
    reload: Option<u64>,
    /// LSI; the clock tree gives it once the watchdog is started.
    hz: u64,
    /// Ticks that it counts from when it is loaded.
    loaded: u64,
    expiry: Option<EventId>,
}

impl Watchdog {
    /// Counts down from `ticks`, from now on.
    fn load(&mut self, ticks: u64, context: &mut DeviceContext<'_>) {
        self.loaded = ticks;
        self.expiry = None;
        if self.started && self.hz > 0 {
            // PR: a fourth, doubling to 1/256 (45.4.2).
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
