//! The end of a run: a panic, a HardFault, a falling supply, or an interrupt without a handler.
//!
//! Each opens all bridges, stores its fault for the record, logs it, and waits until the watchdog resets the chip. A fault in
//! the middle of a line of the log is not logged: the log holds one line at a time.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m_rt::ExceptionFrame;
use defmt::{Display2Format, error};
use motor_hub::record::Fault;

use crate::stack;

/// Makes the handlers of a board's program. `$end` is its [`End`].
///
/// The board's crate needs `cortex-m-rt`.
#[macro_export]
macro_rules! end_faults_with {
    ($end:path) => {
        #[panic_handler]
        fn panic(info: &::core::panic::PanicInfo<'_>) -> ! {
            $end.panicked(info)
        }

        #[::cortex_m_rt::exception]
        #[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
        unsafe fn HardFault(frame: &::cortex_m_rt::ExceptionFrame) -> ! {
            $end.hard_fault(frame)
        }

        #[::cortex_m_rt::exception]
        #[allow(unsafe_code, reason = "cortex-m-rt asks for an unsafe fn; nothing in it is")]
        unsafe fn DefaultHandler(irqn: i16) -> ! {
            $end.unhandled(irqn)
        }
    };
}

/// How the run of a board's program ends.
pub struct End {
    /// Opens all bridges for good from any context, touching nothing but registers.
    pub open: fn(),
    /// Stores the fault for the next run.
    pub say: fn(Fault, [u32; 2]),
}

impl End {
    /// Opens the bridges, and only then reports.
    fn stop(&self, fault: Fault, detail: [u32; 2], report: impl FnOnce()) -> ! {
        (self.open)();
        cortex_m::interrupt::disable();
        // A second fault in the lines below must not run them again. Interrupts are masked, so nothing comes between the load
        // and the store. Every core has plain loads and stores.
        static REPORTED: AtomicBool = AtomicBool::new(false);
        if !REPORTED.load(Ordering::Relaxed) {
            REPORTED.store(true, Ordering::Relaxed);
            (self.say)(fault, detail);
            report();
        }
        loop {
            cortex_m::asm::nop();
        }
    }

    /// Ends the run after a panic.
    pub fn panicked(&self, info: &PanicInfo<'_>) -> ! {
        let place = info.location().map_or([0; 2], |place| [place.line(), place.column()]);
        self.stop(Fault::Panic, place, || error!("{}; bridges off", Display2Format(info)))
    }

    /// Ends the run after a HardFault.
    pub fn hard_fault(&self, frame: &ExceptionFrame) -> ! {
        let stack = core::ptr::from_ref(frame).addr() as u32;
        if stack::overflowed(stack) {
            // The core could not write the frame: the guard forbade it.
            self.stop(Fault::StackOverflow, [stack, 0], || {
                error!("stack overflow, down to {=u32:#010x}; bridges off", stack);
            });
        }
        let (pc, lr) = (frame.pc(), frame.lr());
        self.stop(Fault::HardFault, [pc, lr], || {
            error!("HardFault at {=u32:#010x} from {=u32:#010x}; bridges off", pc, lr);
        })
    }

    /// Ends the run when the supply falls: for the interrupt of a board's voltage detector.
    pub fn supply_fell(&self) -> ! {
        self.stop(Fault::SupplyFell, [0; 2], || error!("the chip's supply fell; bridges off"))
    }

    /// Ends the run after an interrupt without a handler.
    pub fn unhandled(&self, irqn: i16) -> ! {
        let number = irqn as u16;
        self.stop(Fault::UnhandledInterrupt, [number.into(), 0], || {
            error!("interrupt {=i16} without a handler; bridges off", irqn);
        })
    }
}
