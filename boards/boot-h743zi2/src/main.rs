//! The bootloader of a NUCLEO-H743ZI2: `embassy-boot`'s, over the slots of [`layout`].
//!
//! It swaps the slots if the hub has armed new firmware, and back if that was started and has not confirmed itself; then it
//! starts a watchdog, so that firmware that never gets to its own ends too, and jumps. A cut of the power costs nothing: the
//! swap goes on where it was. It touches no pin: bridges are open as their pull-downs have them.
#![no_std]
#![no_main]
#![deny(unsafe_code)]

use boot_h743zi2::{Words, layout};
use core::future::Future;
use core::ops::Range;
use core::panic::PanicInfo;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use cortex_m::asm::wfe;
use cortex_m::peripheral::SCB;
use embassy_boot_stm32::{BootLoader, BootLoaderConfig};
use embassy_embedded_hal::flash::partition::Partition;
use embassy_stm32::flash::{Flash, InterruptHandler};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, pac, rcc};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embedded_storage::nor_flash as blocking;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash};
use motor_hub::tasks::update::Marks;

bind_interrupts!(struct Irqs {
    FLASH => InterruptHandler;
});

/// Until the firmware has fed the watchdog for the first time, with its own shorter time; the LSI is exact to 8 %.
const TRIAL_MICROS: u32 = 4_000_000;

/// Bytes that are copied at once; a divisor of a sector.
const BUFFER: usize = 4096;

#[cortex_m_rt::entry]
fn main() -> ! {
    let p = embassy_stm32::init(clocks());
    let regions = Flash::new(p.FLASH, Irqs).into_regions();
    let first: Mutex<NoopRawMutex, _> = Mutex::new(Words::new(regions.bank1_region, 0));
    let second: Mutex<NoopRawMutex, _> = Mutex::new(Words::new(regions.bank2_region, 1));
    let config = BootLoaderConfig {
        active: Waiting(part(&first, layout::ACTIVE)),
        dfu: Waiting(part(&second, layout::DOWNLOAD)),
        state: Waiting(Marks(part(&second, layout::STATE))),
    };
    let Ok(loader) = BootLoader::try_prepare::<_, _, _, BUFFER>(config) else {
        // What is booted may be half of each.
        SCB::sys_reset()
    };
    IndependentWatchdog::new(p.IWDG1, TRIAL_MICROS).unleash();
    // Until these have got to the watchdog the hub's own would be lost (RM0433 45.4.4).
    while pac::IWDG1.sr().read().0 != 0 {}
    boot(loader)
}

#[expect(unsafe_code, reason = "to jump to other firmware is for the bootloader alone")]
fn boot(loader: BootLoader) -> ! {
    // SAFETY: nothing that runs here is used again, and the slot has firmware: what was flashed there, or what the hub took
    // for an image and found whole.
    unsafe { loader.load(layout::ORIGIN) }
}

/// The chip's own oscillator, undivided, and nothing else that the hub would have to undo.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
    config.rcc.hsi48 = None;
    config.rcc.ls = rcc::LsConfig::off();
    config
}

fn part<F: NorFlash>(flash: &Mutex<NoopRawMutex, F>, at: Range<u32>) -> Partition<'_, NoopRawMutex, F> {
    Partition::new(flash, at.start, at.end - at.start)
}

/// A flash for who has nothing else to do.
struct Waiting<F>(F);

impl<F: ErrorType> blocking::ErrorType for Waiting<F> {
    type Error = F::Error;
}

impl<F: NorFlash> blocking::ReadNorFlash for Waiting<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        wait(self.0.read(offset, bytes))
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<F: NorFlash> blocking::NorFlash for Waiting<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        wait(self.0.erase(from, to))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        for (at, word) in (offset..).step_by(F::WRITE_SIZE).zip(bytes.chunks(F::WRITE_SIZE)) {
            // Blank is what it is already.
            if word.iter().any(|byte| *byte != 0xFF) {
                wait(self.0.write(at, word))?;
            }
        }
        Ok(())
    }
}

/// Sleeps until it is done: any interrupt is an event, also one just before the core sleeps.
fn wait<T>(work: impl Future<Output = T>) -> T {
    let mut work = pin!(work);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(done) = work.as_mut().poll(&mut context) {
            return done;
        }
        wfe();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    SCB::sys_reset()
}
