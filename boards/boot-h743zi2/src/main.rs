//! The bootloader of a NUCLEO-H743ZI2: `embassy-boot`'s, over the slots of [`layout`].
//!
//! It swaps the slots if the hub has armed new firmware, and back if that was started and has not confirmed itself; then it
//! starts a watchdog, so that firmware that never gets to its own ends too, and jumps. A cut of the power costs nothing: the
//! swap goes on where it was. It touches no pin: bridges are open as their pull-downs have them.
#![no_std]
#![no_main]
#![deny(unsafe_code)]

use boot_h743zi2::{Words, layout};
use core::ops::Range;
use core::panic::PanicInfo;
use cortex_m::asm::wfe;
use cortex_m::peripheral::SCB;
use embassy_boot_stm32::{BootLoader, BootLoaderConfig};
use embassy_embedded_hal::flash::partition::Partition;
use embassy_stm32::flash::{Flash, InterruptHandler};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, pac, rcc};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embedded_storage_async::nor_flash::NorFlash;
use motor_hub::tasks::update::{BlockingFlash, StateFlash};

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
        active: blocking(part(&first, layout::ACTIVE)),
        dfu: blocking(part(&second, layout::DOWNLOAD)),
        state: blocking(StateFlash(part(&second, layout::STATE))),
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

/// Any interrupt is an event, also one just before the core sleeps.
const fn blocking<F>(flash: F) -> BlockingFlash<F> {
    BlockingFlash { flash, idle: wfe }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    SCB::sys_reset()
}
