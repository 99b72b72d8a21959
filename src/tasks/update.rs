//! New firmware in flash, for [`embassy_boot`]'s bootloader: chunks are written to the slot that it swaps in, and its state says
//! whether it is to.
//!
//! First this firmware confirms itself, if it is on trial: once all tasks have checked in often enough. Firmware that does not
//! get there is reset by the watchdog, and the bootloader goes back to the one before.
//!
//! ```
//! use motor_hub::tasks::update::{CONFIRMED_AFTER, Marks};
//!
//! // Some seconds at a control period of 50 ms.
//! assert_eq!(CONFIRMED_AFTER, 40);
//! // What the bootloader, too, has its state behind.
//! let state = Marks("a flash");
//! assert_eq!(state.0, "a flash");
//! ```

#[cfg(feature = "signed")]
mod signature;
mod waiting;

pub use waiting::Waiting;

use super::{Health, Wires};
use crate::update::{Booted, CHUNK, CRC, Done, Order, Outcome, Seal};
use embassy_boot::{FirmwareState, State};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// How often all tasks must have checked in before new firmware is confirmed.
pub const CONFIRMED_AFTER: u32 = 40;

/// How often that is looked at.
const LOOK: Duration = Duration::from_millis(50);

/// The answer to who asks for a restart takes less.
const FAREWELL: Duration = Duration::from_millis(50);

/// The longest word of any flash.
const WORD: usize = 32;

/// Confirms this firmware when all tasks have checked in often enough, and then does what is ordered, for ever.
pub async fn run<M: RawMutex, const N: usize>(
    mut slots: Slots<impl NorFlash, impl NorFlash>,
    wires: &Wires<M, N>,
    health: &Health,
    mut restart: impl FnMut(),
) -> ! {
    let mut booted = slots.booted().await;
    wires.update.done.signal(Done::Booted(booted));
    if booted == Booted::OnTrial {
        while health.rounds() < CONFIRMED_AFTER {
            Timer::after(LOOK).await;
        }
        while booted == Booted::OnTrial {
            // Unconfirmed it would be gone after the next reset, so one that fails is tried again.
            slots.confirm().await;
            booted = slots.booted().await;
        }
        wires.update.done.signal(Done::Booted(booted));
    }
    loop {
        let outcome = match wires.update.order.wait().await {
            Order::Write { offset, bytes } => slots.write(offset, &bytes).await,
            Order::Arm { length, crc, seal } => slots.arm(length, crc, seal, motors_off(wires)).await,
            Order::Disarm => slots.confirm().await,
            Order::Restart => {
                Timer::after(FAREWELL).await;
                restart();
                Outcome::Refused
            }
        };
        wires.update.done.signal(Done::Carried(outcome));
    }
}

/// Waits until no motor does anything.
async fn motors_off<M: RawMutex, const N: usize>(wires: &Wires<M, N>) {
    while wires.snapshot.try_get().is_some_and(|snapshot| !snapshot.all_disabled()) {
        Timer::after(LOOK).await;
    }
}

/// The slot that images are written to, and the bootloader's state.
pub struct Slots<D, S> {
    download: D,
    state: Marks<S>,
}

impl<D: NorFlash, S: NorFlash> Slots<D, S> {
    /// In these flashes, or parts of one; `None` for words that are longer than 32 bytes, or that no chunk is made of.
    pub fn new(download: D, state: S) -> Option<Self> {
        let words = [D::WRITE_SIZE, S::WRITE_SIZE, S::READ_SIZE];
        let fits = words.iter().all(|word| *word <= WORD) && CHUNK.is_multiple_of(D::WRITE_SIZE);
        fits.then_some(Self { download, state: Marks(state) })
    }

    /// The bootloader's state, read and written by this word, of which it takes as much as the flash does.
    fn state<'a>(&'a mut self, word: &'a mut [u8; WORD]) -> FirmwareState<'a, &'a mut Marks<S>> {
        // It is long enough, or there would be no slots.
        let word = word.get_mut(..S::WRITE_SIZE.max(S::READ_SIZE)).unwrap_or_default();
        FirmwareState::new(&mut self.state, word)
    }

    /// How this firmware was started.
    pub async fn booted(&mut self) -> Booted {
        let mut word = [0; WORD];
        match self.state(&mut word).get_state().await {
            Ok(State::Swap) => Booted::OnTrial,
            Ok(State::Revert) => Booted::WentBack,
            Ok(State::Boot | State::DfuDetach) => Booted::Confirmed,
            Err(_) => Booted::Unknown,
        }
    }

    /// Lets the bootloader start what it started last.
    pub async fn confirm(&mut self) -> Outcome {
        let mut word = [0; WORD];
        self.state(&mut word).mark_booted().await.map_or(Outcome::Refused, |()| Outcome::Done)
    }

    /// Writes a chunk, word by word, with all other tasks between two.
    pub async fn write(&mut self, offset: u32, bytes: &[u8]) -> Outcome {
        for (at, bytes) in (offset..).step_by(D::WRITE_SIZE).zip(bytes.chunks(D::WRITE_SIZE)) {
            if self.write_word(at, bytes).await.is_err() {
                return Outcome::Refused;
            }
            yield_now().await;
        }
        Outcome::Done
    }

    async fn write_word(&mut self, at: u32, bytes: &[u8]) -> Result<(), D::Error> {
        let page = D::ERASE_SIZE as u32;
        if at.is_multiple_of(page) {
            self.download.erase(at, at.saturating_add(page)).await?;
        }
        let mut word = [0xFF; WORD];
        word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.download.write(at, word.get(..D::WRITE_SIZE).unwrap_or_default()).await
    }

    /// Lets the next reset start what was written, if it reads back with this CRC-32 and, where there is a seal, has that one.
    /// A seal is looked at after `calm`: that holds the core up for some 10 ms.
    pub async fn arm(
        &mut self,
        length: u32,
        crc: u32,
        seal: Option<Seal>,
        calm: impl Future<Output = ()>,
    ) -> Outcome {
        let mut found = CRC.digest();
        if self.each_chunk(length, |chunk| found.update(chunk)).await.is_err() {
            return Outcome::Refused;
        }
        if found.finalize() != crc {
            return Outcome::Mismatch;
        }
        if let Some(seal) = seal {
            let genuine = self.verify(length, &seal, calm).await;
            if genuine != Outcome::Done {
                return genuine;
            }
        }
        let mut word = [0; WORD];
        if self.state(&mut word).mark_updated().await.is_err() {
            // Nobody will know of it, so it must not happen.
            self.confirm().await;
            return Outcome::Refused;
        }
        Outcome::Done
    }

    /// Without the arithmetic for it nothing is genuine.
    #[cfg(not(feature = "signed"))]
    async fn verify(&mut self, _: u32, _: &Seal, _: impl Future<Output = ()>) -> Outcome {
        Outcome::WrongSignature
    }

    /// Shows what was written, piece by piece, with all other tasks between two.
    async fn each_chunk(&mut self, length: u32, mut see: impl FnMut(&[u8])) -> Result<(), D::Error> {
        let mut chunk = [0; CHUNK];
        for at in (0..length).step_by(CHUNK) {
            let left = length.saturating_sub(at).min(CHUNK as u32) as usize;
            // In whole pieces that the flash reads.
            let read = left.next_multiple_of(D::READ_SIZE).min(CHUNK);
            self.download.read(at, chunk.get_mut(..read).unwrap_or_default()).await?;
            see(chunk.get(..left).unwrap_or_default());
            yield_now().await;
        }
        Ok(())
    }
}

/// The flash of the bootloader's state. Before it is erased its first word, which says what the bootloader is to do, is made
/// to say nothing: an erasure that power cuts could leave that word, and blank the progress of a swap behind it, which would then
/// be made a second time.
pub struct Marks<S>(pub S);

impl<S: ErrorType> ErrorType for Marks<S> {
    type Error = S::Error;
}

impl<S: NorFlash> ReadNorFlash for Marks<S> {
    const READ_SIZE: usize = S::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<S: NorFlash> NorFlash for Marks<S> {
    const WRITE_SIZE: usize = S::WRITE_SIZE;
    const ERASE_SIZE: usize = S::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.0.write(from, [0; WORD].get(..S::WRITE_SIZE).unwrap_or_default()).await?;
        self.0.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.0.write(offset, bytes).await
    }
}
