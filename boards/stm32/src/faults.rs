//! Where the firmware ends: panic, HardFault, a failing supply and interrupts that nobody handles open all bridges,
//! say what happened, and wait for the watchdog to start the chip afresh. (What comes while another line of the log
//! is being written is not said: the log has no room for two at once.)

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use defmt::{Display2Format, error};

use crate::stack;

/// Makes these ends those of a board's program. `$open` is a `fn()` that opens all bridges for good from any
/// context, touching nothing but registers.
///
/// The board's crate needs `cortex-m-rt`.
#[macro_export]
macro_rules! end_faults_with {
    ($open:path) => {
        #[panic_handler]
        fn panic(info: &::core::panic::PanicInfo<'_>) -> ! {
            $crate::faults::panicked($open, info)
        }

        #[::cortex_m_rt::exception]
        #[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
        unsafe fn HardFault(frame: &::cortex_m_rt::ExceptionFrame) -> ! {
            $crate::faults::hard_fault(
                $open,
                ::core::ptr::from_ref(frame).addr() as u32,
                frame.pc(),
                frame.lr(),
            )
        }

        #[::cortex_m_rt::exception]
        #[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
        unsafe fn DefaultHandler(irqn: i16) -> ! {
            $crate::faults::unhandled($open, irqn)
        }
    };
}

/// Opens the bridges, and only then reports.
fn stop(open: fn(), report: impl FnOnce()) -> ! {
    open();
    cortex_m::interrupt::disable();
    // A fault inside the logger must not lead back into the logger. Nothing can come between these two:
    // interrupts are masked. (Plain load and store do on every core.)
    static REPORTED: AtomicBool = AtomicBool::new(false);
    if !REPORTED.load(Ordering::Relaxed) {
        REPORTED.store(true, Ordering::Relaxed);
        report();
    }
    loop {
        cortex_m::asm::nop();
    }
}

/// The end of a panic.
pub fn panicked(open: fn(), info: &PanicInfo<'_>) -> ! {
    stop(open, || error!("{}; bridges off", Display2Format(info)))
}

/// The end of a HardFault, whose frame is at `stack`.
pub fn hard_fault(open: fn(), stack: u32, pc: u32, lr: u32) -> ! {
    stop(open, || {
        if stack::overflowed(stack) {
            // Its frame has not been written: the guard forbade it.
            error!("stack overflow, down to {=u32:#010x}; bridges off", stack);
        } else {
            error!("HardFault at {=u32:#010x} from {=u32:#010x}; bridges off", pc, lr);
        }
    })
}

/// The end of a supply that falls, for the interrupt of a board's voltage detector.
pub fn supply_fell(open: fn()) -> ! {
    stop(open, || error!("the chip's supply fell; bridges off"))
}

/// The end of an interrupt that nobody handles.
pub fn unhandled(open: fn(), irqn: i16) -> ! {
    stop(open, || error!("interrupt {=i16} without a handler; bridges off", irqn))
}
