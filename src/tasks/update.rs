//! Writes new firmware to flash, for [`embassy_boot`]'s bootloader. The firmware runs from the *active slot*, and the
//! task writes chunks to the *download slot*. The *swap mark*, the first word of the *bootloader's state*, makes the
//! bootloader *swap* the contents of the two slots at the next reset.
//!
//! ```text
//!              +-----------+ all tasks check in 40 times +-----------+
//!   swap ----> | on trial  | --------------------------> | confirmed |
//!              +-----------+                             +-----------+
//!                    | reset
//!                    v
//!              +-----------+
//!              | reverted  | the bootloader has restored the previous firmware, or has refused the new one
//!              +-----------+
//! ```
//!
//! If not all tasks of new firmware check in, the watchdog resets the chip. If the confirmation cannot be written, the
//! new firmware continues to run and reports [`Booted::Unconfirmable`].
//!
//! ```
//! use motor_hub::tasks::update::{CONFIRM_AFTER_ROUNDS, StateFlash};
//!
//! // This takes 2 s at a control period of 50 ms.
//! assert_eq!(CONFIRM_AFTER_ROUNDS, 40);
//! // The bootloader uses the same wrapper for its state.
//! let state = StateFlash("a flash");
//! assert_eq!(state.0, "a flash");
//! ```

mod blocking_flash;
#[cfg(feature = "signed")]
mod signature;
mod swap;

pub use blocking_flash::BlockingFlash;
#[cfg(feature = "signed")]
pub use signature::discard_refused_swap;
pub use swap::discard_stale_swap;

use super::{Health, WORD_BYTES, Wires};
use crate::update::{Booted, CHUNK, CRC, ImageSignature, Outcome, SlotReport, UpdateRequest};
use embassy_boot::{FirmwareState, State};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Number of [rounds](Health::rounds) before new firmware is confirmed. In each round all tasks check in.
pub const CONFIRM_AFTER_ROUNDS: u32 = 40;

/// Interval at which the task checks rounds or motors, while the task waits for rounds or for disabled motors.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Number of attempts to write the confirmation of new firmware.
const CONFIRM_ATTEMPTS: u32 = 10;

/// Pause after an attempt to write the confirmation.
const CONFIRM_PAUSE: Duration = Duration::from_secs(1);

/// Time from the request of a restart to the restart. The responder replies to the host during this time.
const RESTART_DELAY: Duration = Duration::from_millis(50);

/// Value of each byte of erased flash.
const BLANK: u8 = 0xFF;

/// Runs the task. Never returns.
///
/// If this firmware is on trial, the task first waits for [`CONFIRM_AFTER_ROUNDS`] and confirms the firmware. The task
/// then carries out the requests of the responder.
pub async fn run<M: RawMutex, const N: usize>(
    mut slots: Slots<impl ReadNorFlash, impl NorFlash, impl NorFlash>,
    wires: &Wires<M, N>,
    health: &Health,
    mut restart: impl FnMut(),
) -> ! {
    let booted = slots.booted().await;
    wires.update.done.signal(SlotReport::Booted(booted));
    if booted == Booted::OnTrial {
        while health.rounds() < CONFIRM_AFTER_ROUNDS {
            Timer::after(POLL_INTERVAL).await;
        }
        wires.update.done.signal(SlotReport::Booted(confirm(&mut slots).await));
    }
    loop {
        let outcome = match wires.update.request.wait().await {
            UpdateRequest::Write { offset, bytes } => slots.write(offset, &bytes).await,
            UpdateRequest::Arm { length, crc, signature } => {
                slots.arm(length, crc, signature, motors_off(wires)).await
            }
            UpdateRequest::Disarm => slots.confirm().await,
            UpdateRequest::Restart => {
                Timer::after(RESTART_DELAY).await;
                restart();
                // The chip still runs, so the restart has failed.
                Outcome::Refused
            }
        };
        wires.update.done.signal(SlotReport::Result(outcome));
    }
}

/// Confirms this firmware, and returns what [`Slots::booted`] reads afterwards.
///
/// While the state still says that the firmware is on trial, the confirmation is tried again after a pause, because a
/// reset would otherwise restore the previous firmware. Returns [`Booted::Unconfirmable`] if [`CONFIRM_ATTEMPTS`]
/// attempts have failed, and [`Booted::Unknown`] as soon as the state cannot be read.
async fn confirm(slots: &mut Slots<impl ReadNorFlash, impl NorFlash, impl NorFlash>) -> Booted {
    for _ in 0..CONFIRM_ATTEMPTS {
        slots.confirm().await;
        let booted = slots.booted().await;
        if booted != Booted::OnTrial {
            return booted;
        }
        Timer::after(CONFIRM_PAUSE).await;
    }
    Booted::Unconfirmable
}

/// Waits until the newest snapshot shows that all motors are disabled or in fail-safe. Does not wait if there is no
/// snapshot.
async fn motors_off<M: RawMutex, const N: usize>(wires: &Wires<M, N>) {
    while wires.snapshot.try_get().is_some_and(|snapshot| !snapshot.all_disabled()) {
        Timer::after(POLL_INTERVAL).await;
    }
}

/// The flash of an update: the active slot, the download slot, and the bootloader's state.
pub struct Slots<A, D, S> {
    active: A,
    download: D,
    state: StateFlash<S>,
}

impl<A: ReadNorFlash, D: NorFlash, S: NorFlash> Slots<A, D, S> {
    /// Creates the slots in three flashes, or in partitions of flashes.
    ///
    /// `None` if a word to write to the download slot or to the state, or a word to read from the state, has more than
    /// 32 bytes. Also `None` if a word of the state has less than 8 bytes, or if a chunk is not a multiple of the
    /// download slot's word. A chunk must be a multiple of the words to read from both slots; this is not checked.
    pub fn new(active: A, download: D, state: S) -> Option<Self> {
        let words = [D::WRITE_SIZE, S::WRITE_SIZE, S::READ_SIZE];
        let fits = words.iter().all(|word| *word <= WORD_BYTES) && CHUNK.is_multiple_of(D::WRITE_SIZE);
        (fits && S::WRITE_SIZE >= swap::SUMS_BYTES).then_some(Self {
            active,
            download,
            state: StateFlash(state),
        })
    }

    /// Returns embassy-boot's access to the bootloader's state. `word` is a buffer for one word of the flash.
    fn state<'a>(&'a mut self, word: &'a mut [u8; WORD_BYTES]) -> FirmwareState<'a, &'a mut StateFlash<S>> {
        // `new` has checked that the buffer is long enough.
        let word = word.get_mut(..S::WRITE_SIZE.max(S::READ_SIZE)).unwrap_or_default();
        FirmwareState::new(&mut self.state, word)
    }

    /// Reads from the bootloader's state how this firmware was started. After [`arm`](Self::arm) the result is
    /// [`Booted::OnTrial`], although the new firmware has not been started. [`Booted::Unknown`] if the state cannot be
    /// read.
    pub async fn booted(&mut self) -> Booted {
        let mut word = [0; WORD_BYTES];
        match self.state(&mut word).get_state().await {
            Ok(State::Swap) => Booted::OnTrial,
            Ok(State::Revert) => Booted::Reverted,
            Ok(State::Boot | State::DfuDetach) => Booted::Confirmed,
            Err(_) => Booted::Unknown,
        }
    }

    /// Confirms this firmware, so that the bootloader starts this firmware after each reset. Removes a swap mark.
    pub async fn confirm(&mut self) -> Outcome {
        let mut word = [0; WORD_BYTES];
        self.state(&mut word).mark_booted().await.map_or(Outcome::Refused, |()| Outcome::Done)
    }

    /// Writes a chunk word by word. Other tasks run between two words.
    pub async fn write(&mut self, offset: u32, bytes: &[u8]) -> Outcome {
        for (at, bytes) in (offset..).step_by(D::WRITE_SIZE).zip(bytes.chunks(D::WRITE_SIZE)) {
            if self.write_word(at, bytes).await.is_err() {
                return Outcome::Refused;
            }
            yield_now().await;
        }
        Outcome::Done
    }

    /// Writes one word. Missing bytes at its end are written as [`BLANK`]. If the word is the first of a page, the page
    /// is erased first.
    async fn write_word(&mut self, at: u32, bytes: &[u8]) -> Result<(), D::Error> {
        let page = D::ERASE_SIZE as u32;
        if at.is_multiple_of(page) {
            self.download.erase(at, at.saturating_add(page)).await?;
        }
        let mut word = [BLANK; WORD_BYTES];
        word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.download.write(at, word.get(..D::WRITE_SIZE).unwrap_or_default()).await
    }

    /// Checks the written image. If the image is valid, writes the swap mark.
    ///
    /// The image must read back with this CRC-32. If there is a signature, the signature must be valid for the
    /// image, and the image must not be older than the present firmware. The check of a signature blocks the processor
    /// for some 10 ms, so the method first awaits `motors_off`.
    pub async fn arm(
        &mut self,
        length: u32,
        crc: u32,
        signature: Option<ImageSignature>,
        motors_off: impl Future<Output = ()>,
    ) -> Outcome {
        match checksum(&mut self.download, 0, length).await {
            Err(_) => return Outcome::Refused,
            Ok(found) if found != crc => return Outcome::Mismatch,
            Ok(_) => (),
        }
        if let Some(signature) = signature {
            let verified = self.verify(length, &signature, motors_off).await;
            if verified != Outcome::Done {
                return verified;
            }
        }
        let signature = signature.map(|signature| (length, signature.bytes));
        let marked = swap::mark(&mut self.active, &mut self.download, &mut self.state, signature).await;
        // A flash may drop a write without an error, so the swap mark is read back.
        if marked.is_err() || self.booted().await != Booted::OnTrial {
            // The host gets an error, so a swap mark that was written only in part must not start the image.
            self.confirm().await;
            return Outcome::Refused;
        }
        Outcome::Done
    }

    /// Rejects every signature, because a build without the feature `signed` cannot check signatures.
    #[cfg(not(feature = "signed"))]
    async fn verify(&mut self, _: u32, _: &ImageSignature, _: impl Future<Output = ()>) -> Outcome {
        Outcome::WrongSignature
    }
}

/// Reads `length` bytes of a flash from the address `from` in chunks, and calls `visit` with each chunk. Other tasks
/// run between two chunks.
async fn each_chunk<F: ReadNorFlash>(
    flash: &mut F,
    from: u32,
    length: u32,
    mut visit: impl FnMut(&[u8]),
) -> Result<(), F::Error> {
    let mut chunk = [0; CHUNK];
    for at in (0..length).step_by(CHUNK) {
        let left = length.saturating_sub(at).min(CHUNK as u32) as usize;
        // The flash reads whole words only.
        let read = left.next_multiple_of(F::READ_SIZE).min(CHUNK);
        flash.read(from + at, chunk.get_mut(..read).unwrap_or_default()).await?;
        visit(chunk.get(..left).unwrap_or_default());
        yield_now().await;
    }
    Ok(())
}

/// Returns the CRC-32 of `length` bytes of a flash from the address `from`.
async fn checksum<F: ReadNorFlash>(flash: &mut F, from: u32, length: u32) -> Result<u32, NorFlashErrorKind> {
    let mut sum = CRC.digest();
    each_chunk(flash, from, length, |chunk| sum.update(chunk)).await.map_err(|error| error.kind())?;
    Ok(sum.finalize())
}

/// The flash with the bootloader's state. Hub and bootloader must both access the state through this type.
///
/// * Before an erasure the swap mark is overwritten with 0. If a power failure interrupted the erasure, the swap mark
///   could otherwise remain while the progress of the swap is erased already. The bootloader would then swap a second
///   time.
/// * Only the swap mark is written twice, before an erasure. A write of zeros to another word that is written already
///   is skipped, because the flash permits no second write to a word.
pub struct StateFlash<S>(pub S);

impl<S: ErrorType> ErrorType for StateFlash<S> {
    type Error = S::Error;
}

impl<S: NorFlash> ReadNorFlash for StateFlash<S> {
    const READ_SIZE: usize = S::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<S: NorFlash> NorFlash for StateFlash<S> {
    const WRITE_SIZE: usize = S::WRITE_SIZE;
    const ERASE_SIZE: usize = S::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        // A word that is written twice may read back with a wrong bit (RM0433 4.3.9). Such a word still consists mostly
        // of 0, and so is no swap mark. If the write fails, the page is erased anyway.
        let _ = self.0.write(from, [0; WORD_BYTES].get(..S::WRITE_SIZE).unwrap_or_default()).await;
        self.0.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let mut buffer = [0; WORD_BYTES];
        if bytes.iter().all(|byte| *byte == 0)
            && let Some(word) = buffer.get_mut(..bytes.len())
        {
            // After a power failure the bootloader repeats its last write of zeros. A word without a blank byte has
            // been written.
            self.0.read(offset, word).await?;
            if !word.contains(&BLANK) {
                return Ok(());
            }
        }
        self.0.write(offset, bytes).await
    }
}
