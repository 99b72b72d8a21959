//! The bootloader of a NUCLEO-H743ZI2. It uses `embassy-boot` with the two slots of firmware of [`layout`].
//!
//! The bootloader swaps the slots if the hub has armed new firmware. It swaps them back if the new firmware was started and has
//! not confirmed itself. Then it starts the firmware. A bootloader with a public key only swaps in firmware that is signed with
//! the secret key, and that is not older than the present firmware. After a power cut or a fault a swap continues at its last
//! step. Every fault ends in a reset.
//!
//! ```text
//! reset -> watchdog, 32 s -> discard a stale or refused swap -> swap, if armed or on trial -> watchdog, 4 s -> jump
//!   ^          |                |                      |   fed before each erasure      |
//!   +----------+----------------+----------------------+--------------------------------+  fault, panic, failing flash
//! ```
//!
//! The bootloader drives one pin: the red lamp is on until the clocks run, and blinks during a swap. Pull-down resistors keep
//! the bridges open.
#![no_std]
#![no_main]
#![deny(unsafe_code)]

use boot_h743zi2::{Bank, before_clocks, execute_first_bank_only, layout};
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
use embassy_stm32::pac::gpio::vals::Pupdr;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, pac, peripherals, rcc};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embedded_storage_async::nor_flash::NorFlash;
#[cfg(feature = "signed")]
use motor_hub::tasks::update::discard_refused_swap;
use motor_hub::tasks::update::{BlockingFlash, StateFlash, discard_stale_swap};

/// Time-out of the watchdog in microseconds while the bootloader runs: nearly the watchdog's longest, 32.8 s. A swap must reach its
/// next erasure in this time. The LSI oscillator that counts the time is exact to 8 %.
const SWAP_MICROS: u32 = 32_000_000;

/// Time-out of the watchdog in microseconds in which the firmware must set its own shorter time-out.
const TRIAL_MICROS: u32 = 4_000_000;

/// Number of bytes that a swap copies at a time; a divisor of the size of a sector.
const BUFFER: usize = 4096;

/// Frequency in Hz of the interrupt that wakes the core to check whether an operation of the flash has ended.
const TICK_HZ: u32 = 10_000;

/// Ticks for which the lamp is on, or off, during a swap.
const BLINK_TICKS: u32 = TICK_HZ / 4;

/// Number of the red lamp's pin, PB14.
const LAMP: usize = 14;

#[cortex_m_rt::entry]
fn main() -> ! {
    pac::RCC.ahb4enr().modify(|w| w.set_gpioben(true));
    before_clocks(pac::IWDG1, pac::GPIOB, LAMP);
    let mut p = embassy_stm32::init(clocks());
    watch(p.IWDG1.reborrow(), SWAP_MICROS);
    let lamp = Output::new(p.PB14, Level::Low, Speed::Low);
    release_encoders();
    let Some(mut core) = Peripherals::take() else { SCB::sys_reset() };
    execute_first_bank_only(&mut core.MPU);
    tick(&mut core.SYST, true);
    let [first, second] = Bank::both(p.FLASH, yield_now).map(Mutex::<NoopRawMutex, _>::new);
    let mut state = StateFlash(part(&second, layout::STATE));
    let mut active = part(&first, layout::ACTIVE);
    if block_on(discard_stale_swap(&mut active, &mut state)).is_err() {
        SCB::sys_reset()
    }
    #[cfg(feature = "signed")]
    if let Some(key) = boot_h743zi2::SIGNER {
        let mut download = part(&second, layout::DOWNLOAD);
        if block_on(discard_refused_swap(&mut active, &mut download, &mut state, key)).is_err() {
            SCB::sys_reset()
        }
    }
    let config = BootLoaderConfig {
        active: blocking(active),
        dfu: blocking(part(&second, layout::DOWNLOAD)),
        state: blocking(state),
    };
    let Ok(loader) = BootLoader::try_prepare::<_, _, _, BUFFER>(config) else {
        // The swap is not complete, so the slot may hold a part of each firmware.
        SCB::sys_reset()
    };
    tick(&mut core.SYST, false);
    drop(lamp);
    watch(p.IWDG1, TRIAL_MICROS);
    boot(loader)
}

#[expect(unsafe_code, reason = "only the bootloader jumps to other firmware")]
fn boot(loader: BootLoader) -> ! {
    // SAFETY: the bootloader's own state is not used after the jump. The slot has firmware, which was flashed there, or which
    // the hub checked.
    unsafe { loader.load(layout::ORIGIN) }
}

/// Returns the clocks: the chip's own oscillator of 64 MHz, undivided. All other clocks stay as after a reset.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
    config.rcc.hsi48 = None;
    config.rcc.ls = rcc::LsConfig::off();
    config
}

/// Switches the pull-ups of JTAG off, which PA15 and PB4 have after a reset (RM0433 11.4.4). Encoders are on these pins, and the
/// pins take 5 V only without a pull-up (DS12110, I/O static characteristics). A swap lasts half a minute.
fn release_encoders() {
    pac::GPIOA.pupdr().modify(|w| w.set_pupdr(15, Pupdr::FLOATING));
    pac::GPIOB.pupdr().modify(|w| w.set_pupdr(4, Pupdr::FLOATING));
}

/// Starts the watchdog, or changes its time-out.
fn watch(watchdog: Peri<'_, peripherals::IWDG1>, micros: u32) {
    let mut watchdog = IndependentWatchdog::new(watchdog, micros);
    watchdog.unleash();
    // The registers must not be written again until the watchdog has taken over these values (RM0433 45.4.4).
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

/// Makes a flash driver that sleeps while it waits. It feeds the watchdog before each erasure, so an operation that never ends
/// leads to a reset.
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
