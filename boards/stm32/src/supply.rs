//! Parts of the measurement of the battery, and of the chip's own supply, that are the same on all STM32 chips.

use core::future::poll_fn;
use core::ptr::with_exposed_provenance;
use core::task::Poll;
use embassy_stm32::pac;
use embassy_sync::waitqueue::AtomicWaker;
use motor_hub::supply::VrefintCalibration;
use motor_hub::units::Millivolts;

/// Resistances in ohm of the battery's voltage divider, to the battery and to ground. A battery of 24 V, the highest voltage of
/// the bridges' operating range, gives 2.61 V at the pin. The converter's full scale of 3.3 V corresponds to 30.4 V.
pub const DIVIDER_OHMS: (u32, u32) = (82_000, 10_000);

/// EXTI line of the programmable voltage detector (RM0090 12.2.5, RM0433 table 150, RM0440 table 103).
const PVD_LINE: usize = 16;

/// Switches the voltage detector on by `enable`. Its interrupt comes when the supply falls below the detector's level, or
/// immediately if the supply is too low already. The interrupt ends the run, so the watchdog must run.
///
/// The brown-out reset is not used, because its level is an option byte. If the supply failed while firmware writes option
/// bytes, the chip could lose all of them.
pub fn enable_voltage_detector(interrupt: pac::Interrupt, enable: impl FnOnce()) {
    // The EXTI line is set before the detector is enabled. A supply that is already low then makes an edge when the
    // detector is switched on.
    pac::EXTI.rtsr(0).modify(|w| w.set_line(PVD_LINE, true));
    pac::EXTI.imr(0).modify(|w| w.set_line(PVD_LINE, true));
    unmask(interrupt);
    enable();
}

/// Unmasks an interrupt.
#[expect(
    unsafe_code,
    reason = "unmasking could break a critical section that masks a single interrupt; none does"
)]
pub fn unmask(interrupt: pac::Interrupt) {
    // SAFETY: a safe handler shares only registers, atomics, and wakers that are made for interrupts.
    unsafe { cortex_m::peripheral::NVIC::unmask(interrupt) }
}

/// Wakes the task that waits for an interrupt, for example the interrupt of a converter's analog watchdog.
pub struct InterruptWaiter(AtomicWaker);

impl InterruptWaiter {
    /// Creates a waiter for which no task waits.
    pub const fn new() -> Self {
        Self(AtomicWaker::new())
    }

    /// Waits until `is_reached` returns true. `enable` enables the interrupt whose handler calls [`wake`](Self::wake).
    pub async fn wait(&self, is_reached: impl Fn() -> bool, enable: impl Fn()) {
        poll_fn(|context| {
            self.0.register(context.waker());
            if is_reached() {
                return Poll::Ready(());
            }
            enable();
            Poll::Pending
        })
        .await;
    }

    /// Wakes the waiting task.
    pub fn wake(&self) {
        self.0.wake();
    }
}

impl Default for InterruptWaiter {
    fn default() -> Self {
        Self::new()
    }
}

/// Address of a reading that the factory has stored in a chip, of the reference VREFINT or of the temperature sensor. The factory
/// took the reading at a known supply voltage.
#[derive(Clone, Copy)]
pub struct FactoryWord {
    address: usize,
    /// Supply voltage of the converter when the factory took the reading.
    rail: Millivolts,
    /// Resolution of the reading.
    bits: u8,
}

impl FactoryWord {
    /// Reading of VREFINT of an STM32F42x (DS9405, internal reference voltage calibration values).
    pub const F42X: Self = Self { address: 0x1FFF_7A2A, rail: Millivolts::new(3_300), bits: 12 };
    /// Readings of the temperature sensor at 30 and at 110 degrees of an STM32F42x (DS9405, temperature sensor calibration
    /// values).
    pub const F42X_TEMPERATURE: [Self; 2] =
        [Self { address: 0x1FFF_7A2C, ..Self::F42X }, Self { address: 0x1FFF_7A2E, ..Self::F42X }];
    /// Readings of the temperature sensor at 30 and at 110 degrees of an STM32H74x (DS12110, temperature sensor calibration
    /// values).
    pub const H74X_TEMPERATURE: [Self; 2] =
        [Self { address: 0x1FF1_E820, ..Self::H74X }, Self { address: 0x1FF1_E840, ..Self::H74X }];
    /// Reading of VREFINT of an STM32H74x (DS12110, internal reference voltage calibration values).
    pub const H74X: Self = Self { address: 0x1FF1_E860, rail: Millivolts::new(3_300), bits: 16 };
    /// Reading of VREFINT of an STM32G47x (DS12288, internal reference voltage calibration values).
    pub const G47X: Self = Self { address: 0x1FFF_75AA, rail: Millivolts::new(3_000), bits: 12 };

    /// Returns the reading. The word must be that of the chip that runs this code.
    #[expect(unsafe_code, reason = "the peripheral access crate has no name for this word")]
    #[must_use]
    pub fn read(self) -> VrefintCalibration {
        let word = with_exposed_provenance::<u16>(self.address);
        // SAFETY: an aligned half-word of read-only system memory, and any bits are a u16.
        let reading = unsafe { word.read_volatile() };
        VrefintCalibration { reading, rail: self.rail, bits: self.bits }
    }
}
