//! A blocking flash on top of an async one, for programs without other tasks, such as a bootloader.

use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_storage::nor_flash as blocking;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash};

/// A flash whose operations block until they are done.
///
/// While an operation is pending, `idle` is called repeatedly. A word of only 0xFF bytes is not written, because an
/// erased word has these bytes already.
pub struct BlockingFlash<F> {
    /// The async flash.
    pub flash: F,
    /// Function that is called while an operation is pending. The function may sleep until the next interrupt.
    pub idle: fn(),
    /// Function that is called before each erasure. A bootloader can feed its watchdog in this function.
    pub erasing: fn(),
}

impl<F> BlockingFlash<F> {
    /// Polls `work` until it is ready. Calls `idle` between two polls.
    fn wait<T>(idle: fn(), work: impl Future<Output = T>) -> T {
        let mut work = pin!(work);
        let mut context = Context::from_waker(Waker::noop());
        loop {
            if let Poll::Ready(done) = work.as_mut().poll(&mut context) {
                return done;
            }
            idle();
        }
    }
}

impl<F: ErrorType> blocking::ErrorType for BlockingFlash<F> {
    type Error = F::Error;
}

impl<F: NorFlash> blocking::ReadNorFlash for BlockingFlash<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        Self::wait(self.idle, self.flash.read(offset, bytes))
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash> blocking::NorFlash for BlockingFlash<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), F::Error> {
        (self.erasing)();
        Self::wait(self.idle, self.flash.erase(from, to))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), F::Error> {
        for (at, word) in (offset..).step_by(F::WRITE_SIZE).zip(bytes.chunks(F::WRITE_SIZE)) {
            if word.iter().any(|byte| *byte != 0xFF) {
                Self::wait(self.idle, self.flash.write(at, word))?;
            }
        }
        Ok(())
    }
}
