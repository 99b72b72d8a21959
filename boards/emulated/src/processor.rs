//! The chip's emulated core, which is reused from one run to the next.
//!
//! The emulator translates the firmware to code of this computer, block by block. Without reuse, translation takes most of the
//! time of a short run. Therefore a core that has run an image is kept in a list, and the next run of this image begins with
//! its translations. Only the translations are kept. Registers are as at power-on, and the memory is that of the new run.
//!
//! The emulator discards all translations when the memory protection unit (MPU) changes, and accesses memory slowly while the
//! unit is on. So the MPU's registers [only store](crate::Setup::full_mpu) what is written to them, unless a run tests the stack guard.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use delegate::delegate;
use rigless::cpu::armv7m::Window;
use rigless::emulator::{
    Access, AccessKind, BitAlias, Checked, CoreBus, CoreSpec, DataModel, Error, Exit, HaltReason, HostCall,
    InterruptLine, Processor, Queued,
};
use rigless::image::Image;
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::board::Board;
use crate::system_break::Connections;

/// The MPU's registers (PM0214 4.2, PM0253 4.6).
const MPU: Range<u64> = 0xE000_ED90..0xE000_EDBC;

/// What a core has run. Only a run of the same code can reuse the core's translations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Code {
    board: Board,
    full_mpu: bool,
    images: u64,
    is_constant: bool,
}

impl Code {
    /// Describes images on a board. `is_constant` is true if the code stays the same for the whole run.
    pub(crate) fn new(board: Board, full_mpu: bool, images: &[Image], is_constant: bool) -> Self {
        let mut hasher = DefaultHasher::new();
        images.iter().for_each(|image| image.bytes().hash(&mut hasher));
        Self { board, full_mpu, images: hasher.finish(), is_constant }
    }

    /// Returns the addresses on the processor's own bus that the bench handles instead of the processor.
    pub(crate) const fn windows(self) -> &'static [Window] {
        if self.full_mpu { &[] } else { &[Window { base: MPU.start, size: MPU.end - MPU.start }] }
    }
}

/// A core with its translations, and its state at power-on.
#[derive(Debug)]
struct Translator {
    processor: Box<dyn Processor>,
    power_on: Vec<u8>,
}

/// Cores that wait for their next run, each with the code that it has translated.
static CORE_POOL: Mutex<Vec<(Code, Translator)>> = Mutex::new(Vec::new());

fn core_pool() -> std::sync::MutexGuard<'static, Vec<(Code, Translator)>> {
    // A panic in another thread cannot leave the list in an invalid state.
    CORE_POOL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes a run reuse a core that has run `code`, if the list has such a core. After the run the core is put into the
/// list, if it has run nothing else.
pub(crate) fn reuse_core(spec: &mut CoreSpec, code: Code, connections: &Connections) {
    let connections = connections.clone();
    let make = Arc::clone(&spec.processor);
    spec.processor = Arc::new(move |endian| {
        let waiting = {
            let mut core_pool = core_pool();
            let place = core_pool.iter().position(|(of, _)| *of == code);
            place.map(|place| core_pool.swap_remove(place).1)
        };
        let translated = waiting.is_some();
        let translator = match waiting {
            Some(mut translator) => {
                let processor = &mut translator.processor;
                processor.take_reset_request();
                processor.load(&translator.power_on)?;
                // The images have code in the flash only, so code in RAM was run by a fault. Its translations are discarded.
                let Range { start, end } = code.board.ram();
                processor.ask(Queued::Invalidate(start, end));
                translator
            }
            None => {
                let processor = make(endian)?;
                let power_on = processor.save();
                Translator { processor, power_on }
            }
        };
        let core = ReusedCore {
            translator: Some(translator),
            code,
            placing: Some(translated),
            as_new: code.is_constant,
            breakpoints: Vec::new(),
            connections: connections.clone(),
            locked_up: false,
        };
        Ok(Box::new(core))
    });
}

/// The emulator's core for one run.
#[derive(Debug)]
struct ReusedCore {
    /// The core; `None` only while this value is dropped.
    translator: Option<Translator>,
    code: Code,
    /// True while the images that are put into memory equal the images of the last run. The translations then stay.
    /// `None` once the core has run.
    placing: Option<bool>,
    /// True if nothing has changed the core in a way that the next run would have to undo.
    as_new: bool,
    /// Breakpoints of this run, one entry for each request. They are removed at the end of the run.
    breakpoints: Vec<u64>,
    connections: Connections,
    /// True if the core has locked up, and has not been reset since.
    locked_up: bool,
}

impl ReusedCore {
    fn processor(&self) -> &dyn Processor {
        &*self.translator.as_ref().expect("until it is dropped").processor
    }

    fn processor_mut(&mut self) -> &mut dyn Processor {
        &mut *self.translator.as_mut().expect("until it is dropped").processor
    }

    /// Returns whether the next run may reuse the core after this request.
    fn leaves_as_new(&self, queued: Queued) -> bool {
        match queued {
            Queued::Invalidate(start, end) => [self.code.board.ram(), self.code.board.store()]
                .iter()
                .any(|data| data.start <= start && end <= data.end),
            Queued::Route(_) | Queued::Unroute(_) => false,
            Queued::Line(..) | Queued::Return => true,
        }
    }
}

impl Drop for ReusedCore {
    fn drop(&mut self) {
        let Some(mut translator) = self.translator.take() else { return };
        for &address in &self.breakpoints {
            translator.processor.remove_breakpoint(address);
        }
        if self.as_new && !std::thread::panicking() {
            core_pool().push((self.code, translator));
        }
    }
}

impl Processor for ReusedCore {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        self.placing = None;
        let (connections, full_mpu) = (self.connections.clone(), self.code.full_mpu);
        let (exit, ran) =
            self.processor_mut().run(budget, &mut Outside { bus, full_mpu, connections: &connections });
        let locks_up = exit == Exit::Lockup && !self.locked_up;
        self.locked_up = exit == Exit::Lockup;
        if locks_up {
            connections.locked_up(self.retired(), bus);
        }
        (exit, ran)
    }

    fn ask(&mut self, queued: Queued) {
        if let (Queued::Invalidate(..), Some(same)) = (queued, self.placing) {
            if same {
                return;
            }
        } else {
            self.as_new &= self.leaves_as_new(queued);
        }
        self.processor_mut().ask(queued);
    }

    #[expect(unsafe_code, reason = "the emulator hands its memory over by address")]
    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        // SAFETY: the caller's promise is passed on. A core that waits runs nothing. Before the first instruction of its next
        // run all of the board's memory is mapped again.
        unsafe { self.processor_mut().map(start, length, host, writable) }
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.breakpoints.push(address);
        self.processor_mut().add_breakpoint(address)
    }

    fn attach_debugger(&mut self, attached: bool) {
        self.as_new &= !attached;
        self.processor_mut().attach_debugger(attached);
    }

    fn hold_interrupts(&mut self, held: bool) {
        self.as_new &= !held;
        self.processor_mut().hold_interrupts(held);
    }

    fn check_reads(&mut self, every: bool) {
        self.as_new &= !every;
        self.processor_mut().check_reads(every);
    }

    fn check_words(&mut self, words: &[u64]) {
        self.as_new &= words.is_empty();
        self.processor_mut().check_words(words);
    }

    fn remove_breakpoint(&mut self, address: u64) {
        // The processor counts how often a breakpoint was added, so the breakpoint must be removed as often.
        if let Some(place) = self.breakpoints.iter().position(|&asked| asked == address) {
            self.breakpoints.swap_remove(place);
        }
        self.processor_mut().remove_breakpoint(address);
    }

    delegate! {
        to self.processor() {
            fn retired(&self) -> u64;
            fn maps(&self, start: u64, length: u64) -> bool;
            fn page_size(&self) -> u64;
            fn next_event(&self) -> Option<VirtualNanos>;
            fn waiting(&self) -> bool;
            fn pc(&self) -> u64;
            fn gdb_register(&self, number: usize) -> Option<Vec<u8>>;
            fn target_xml(&self) -> &'static str;
            fn data_model(&self) -> DataModel;
            fn byte_order(&self, address: u64) -> Endian;
            fn save(&self) -> Vec<u8>;
            fn bit_alias(&self, address: u64, width: Width) -> Option<BitAlias>;
            fn own_ranges(&self) -> Vec<Range<u64>>;
            fn host_call(&self, read: &mut dyn FnMut(u64, Width) -> Option<u64>) -> Option<HostCall>;
        }
        to self.processor_mut() {
            fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>);
            fn reset(&mut self);
            fn take_reset_request(&mut self) -> bool;
            fn on_event(&mut self, now: VirtualNanos);
            fn pass_breakpoint(&mut self, address: u64);
            fn set_gdb_register(&mut self, number: usize, bytes: &[u8]) -> bool;
            fn debugger_access(
                &mut self,
                write: Option<u64>,
                address: u64,
                width: Width,
                now: VirtualNanos,
            ) -> Option<u64>;
            fn take_debugger_trace(&mut self) -> Vec<u8>;
            fn load(&mut self, bytes: &[u8]) -> Result<(), Error>;
            fn monitor_command(&mut self, command: &str) -> Option<String>;
            fn debugger_halted(&mut self, why: HaltReason) -> bool;
            fn answer_host_call(&mut self, answer: Option<u64>);
        }
    }
}

/// The bus, with a register that the emulator lacks. Without the full MPU its registers protect nothing and read as 0.
/// The firmware does not read them.
struct Outside<'a> {
    bus: &'a mut dyn CoreBus,
    full_mpu: bool,
    connections: &'a Connections,
}

impl CoreBus for Outside<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        if !self.full_mpu && MPU.contains(&access.address) {
            return Some(if access.kind == AccessKind::Write { access.value } else { 0 });
        }
        match self.connections.access(&access) {
            None => self.bus.access(access, from_code),
            answer => answer,
        }
    }

    delegate! {
        to self.bus {
            fn time(&self, instructions: u64) -> VirtualNanos;
            fn queued(&mut self) -> Vec<Queued>;
            fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32>;
            fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64>;
            fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked>;
            fn write_checked(&mut self, access: Access) -> Option<bool>;
            fn stops_before(&mut self, access: &Access) -> bool;
            fn send_trace(&mut self, bytes: &[u8]);
        }
    }
}
