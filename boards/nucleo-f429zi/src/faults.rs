//! Where the firmware ends: panic, HardFault and interrupts that nobody handles open all bridges, say
//! what happened, and wait for the watchdog to start the chip afresh.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m_rt::{ExceptionFrame, exception};
use defmt::error;

/// Opens the bridges, and only then reports.
fn stop(report: impl FnOnce()) -> ! {
    crate::bridges::open_all();
    cortex_m::interrupt::disable();
    // A fault inside the logger must not lead back into the logger.
    static REPORTED: AtomicBool = AtomicBool::new(false);
    if !REPORTED.swap(true, Ordering::Relaxed) {
        report();
    }
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    stop(|| {
        // Not the formatted message: core's formatting costs more flash than it is worth here.
        let message = info.message();
        let message = message.as_str().unwrap_or("panic");
        match info.location() {
            Some(at) => error!("{=str} at {=str}:{=u32}; bridges off", message, at.file(), at.line()),
            None => error!("{=str}; bridges off", message),
        }
    })
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    stop(|| error!("HardFault at {=u32:#010x} from {=u32:#010x}; bridges off", frame.pc(), frame.lr()))
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
unsafe fn DefaultHandler(irqn: i16) -> ! {
    stop(|| error!("interrupt {=i16} without a handler; bridges off", irqn))
}
