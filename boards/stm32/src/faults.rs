//! Handlers for the events that end a run: a panic, a HardFault, a falling supply, or an interrupt without a handler.
//!
//! Each handler opens all bridges, stores the fault for the record, logs the fault, and waits until the watchdog resets the
//! chip. If the fault interrupts the writing of a log line, the fault is not logged, because the log holds one line at a time.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m_rt::ExceptionFrame;
use defmt::{Display2Format, error};
use motor_hub::record::Fault;

use crate::stack;

/// What the handlers do when the run of a board's program ends.
pub struct FaultHandlers {
    /// Opens all bridges until the next reset. The function accesses only registers, so it may be called in any context.
    pub open_bridges: fn(),
    /// Stores the fault and its two detail words for the next run.
    pub store_fault: fn(Fault, [u32; 2]),
}

impl FaultHandlers {
    /// Opens the bridges, then stores and reports the fault.
    fn stop(&self, fault: Fault, detail: [u32; 2], report: impl FnOnce()) -> ! {
        (self.open_bridges)();
        cortex_m::interrupt::disable();
        // A second fault while this one is reported must not be reported again. Interrupts are masked, so nothing runs between
        // the load and the store.
        static REPORTED: AtomicBool = AtomicBool::new(false);
        if !REPORTED.load(Ordering::Relaxed) {
            REPORTED.store(true, Ordering::Relaxed);
            (self.store_fault)(fault, detail);
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
            // The stack guard forbade the core to write the frame, so `frame` is not valid.
            self.stop(Fault::StackOverflow, [stack, 0], || {
                error!("stack overflow, down to {=u32:#010x}; bridges off", stack);
            });
        }
        let (pc, lr) = (frame.pc(), frame.lr());
        self.stop(Fault::HardFault, [pc, lr], || {
            error!("HardFault at {=u32:#010x} from {=u32:#010x}; bridges off", pc, lr);
        })
    }

    /// Ends the run when the supply falls. The interrupt handler of a board's voltage detector calls this function.
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
