//! The bootloader of a NUCLEO-H743ZI2: `embassy-boot`'s, over the slots of [`layout`].
//!
//! It swaps the slots if the hub has armed new firmware, and back if that was started and has not confirmed itself; then it
//! jumps. A cut of the power costs nothing: the swap goes on where it was. Whatever goes wrong ends in a reset, and the swap
//! goes on after that too.
//!
//! ```text
//! reset -> watchdog, 32 s -> discard a stale swap -> swap, if armed or on trial -> watchdog, 4 s -> jump
//!   ^          |                |                      |   fed before each erasure      |
//!   +----------+----------------+----------------------+--------------------------------+  fault, panic, failing flash
//! ```
//!
//! It touches one pin, that of the red lamp: it blinks during a swap. Bridges are open as their pull-downs have them.
#![no_std]
#![no_main]
#![deny(unsafe_code)]

use boot_h743zi2::{Bank, execute_first_bank_only, layout};
use core::ops::Range;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::Peripherals;
use cortex_m::asm::wfi;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_boot_stm32::{BootLoader, BootLoaderConfig};
use embassy_embedded_hal::flash::partition::Partition;
use embassy_futures::{block_on, yield_now};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, pac, peripherals, rcc};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embedded_storage_async::nor_flash::NorFlash;
use motor_hub::tasks::update::{BlockingFlash, StateFlash, discard_stale_swap};

/// Until a swap has got to its next erasure; the longest that the watchdog has. The LSI is exact to 8 %.
const SWAP_MICROS: u32 = 32_000_000;

/// Until the firmware has fed the watchdog for the first time, with its own shorter time.
const TRIAL_MICROS: u32 = 4_000_000;

/// Bytes that are copied at once; a divisor of a sector.
const BUFFER: usize = 4096;

/// Frequency of the interrupt at which the core looks for the end of an operation of the flash, in Hz.
const TICK_HZ: u32 = 10_000;

/// Ticks for which the lamp is on, or off, during a swap.
const BLINK_TICKS: u32 = TICK_HZ / 4;

/// PB14, the red lamp.
const LAMP: usize = 14;

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut p = embassy_stm32::init(clocks());
    watch(p.IWDG1.reborrow(), SWAP_MICROS);
    let lamp = Output::new(p.PB14, Level::Low, Speed::Low);
    let Some(mut core) = Peripherals::take() else { SCB::sys_reset() };
    execute_first_bank_only(&mut core.MPU);
    tick(&mut core.SYST, true);
    let [first, second] = Bank::both(p.FLASH, yield_now).map(Mutex::<NoopRawMutex, _>::new);
    let mut state = StateFlash(part(&second, layout::STATE));
    if block_on(discard_stale_swap(&mut part(&first, layout::ACTIVE), &mut state)).is_err() {
        SCB::sys_reset()
    }
    let config = BootLoaderConfig {
        active: blocking(part(&first, layout::ACTIVE)),
        dfu: blocking(part(&second, layout::DOWNLOAD)),
        state: blocking(state),
    };
    let Ok(loader) = BootLoader::try_prepare::<_, _, _, BUFFER>(config) else {
        // What is booted may be half of each.
        SCB::sys_reset()
    };
    tick(&mut core.SYST, false);
    drop(lamp);
    watch(p.IWDG1, TRIAL_MICROS);
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

/// Starts the watchdog, or gives it another time.
fn watch(watchdog: Peri<'_, peripherals::IWDG1>, micros: u32) {
    let mut watchdog = IndependentWatchdog::new(watchdog, micros);
    watchdog.unleash();
    // Until these have got to the watchdog, it takes no others (RM0433 45.4.4).
    while pac::IWDG1.sr().read().0 != 0 {}
    watchdog.pet();
}

/// Starts or stops the interrupt that ends each sleep of the core.
fn tick(timer: &mut SYST, on: bool) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(64_000_000 / TICK_HZ - 1);
    timer.clear_current();
    if on {
        timer.enable_interrupt();
        timer.enable_counter();
    } else {
        timer.disable_counter();
        timer.disable_interrupt();
        SCB::clear_pendst();
    }
}

fn part<F: NorFlash>(flash: &Mutex<NoopRawMutex, F>, at: Range<u32>) -> Partition<'_, NoopRawMutex, F> {
    Partition::new(flash, at.start, at.end - at.start)
}

/// The watchdog is fed page by page: an operation that never ends ends in a reset.
const fn blocking<F>(flash: F) -> BlockingFlash<F> {
    BlockingFlash { flash, idle: wfi, erasing: feed }
}

fn feed() {
    pac::IWDG1.kr().write(|w| w.set_key(pac::iwdg::vals::Key::RESET));
}

#[exception]
fn SysTick() {
    static TICKS: AtomicU32 = AtomicU32::new(0);
    let ticks = TICKS.fetch_add(1, Ordering::Relaxed);
    let level = (ticks / BLINK_TICKS) % 2 == 1;
    pac::GPIOB.bsrr().write(|w| if level { w.set_bs(LAMP, true) } else { w.set_br(LAMP, true) });
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    SCB::sys_reset()
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
unsafe fn DefaultHandler(_: i16) -> ! {
    SCB::sys_reset()
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    SCB::sys_reset()
}
