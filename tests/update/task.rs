//! Tests of the slots, and of the task that owns the slots. The task runs under virtual time.

use crate::power::{ACTIVE, DOWNLOAD, Part, STATE, new_chip};
use crate::torn_flash::{Code, NoPower};
use embassy_futures::block_on;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, MockDriver};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use motor_hub::board::Watchdog;
use motor_hub::tasks::update::{CONFIRM_AFTER_ROUNDS, Slots};
use motor_hub::tasks::{self, Health, Task, Wires};
use motor_hub::update::{Booted, CHUNK, CRC, Outcome, SlotReport};
use std::future::ready;
use std::pin::pin;
use std::task::{Context, Waker};

/// A flash in which every byte reads as a byte of the swap mark. The flash refuses all writes and erasures.
#[derive(Default)]
struct Refusing {
    refused: u32,
}

impl Refusing {
    fn refuse(&mut self) -> Result<(), NoPower> {
        self.refused += 1;
        assert!(self.refused < 1_000, "the task repeats a refused write without a pause");
        Err(NoPower)
    }
}

/// Value of each byte of the swap mark in the bootloader's state.
const SWAPPED: u8 = 0xF0;

impl ErrorType for Refusing {
    type Error = NoPower;
}

impl ReadNorFlash for Refusing {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, _: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        bytes.fill(SWAPPED);
        Ok(())
    }

    fn capacity(&self) -> usize {
        STATE.len()
    }
}

impl NorFlash for Refusing {
    const WRITE_SIZE: usize = 32;
    const ERASE_SIZE: usize = STATE.end - STATE.start;

    async fn erase(&mut self, _: u32, _: u32) -> Result<(), NoPower> {
        self.refuse()
    }

    async fn write(&mut self, _: u32, _: &[u8]) -> Result<(), NoPower> {
        self.refuse()
    }
}

/// The bootloader's state in a flash that drops each write of the swap mark without an error.
struct Dropping<'a>(Part<'a>);

impl ErrorType for Dropping<'_> {
    type Error = NoPower;
}

impl ReadNorFlash for Dropping<'_> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        self.0.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for Dropping<'_> {
    const WRITE_SIZE: usize = Part::WRITE_SIZE;
    const ERASE_SIZE: usize = Part::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        self.0.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        if bytes.first() == Some(&SWAPPED) { Ok(()) } else { self.0.write(offset, bytes).await }
    }
}

#[test]
fn an_image_is_not_armed_if_the_flash_has_dropped_the_swap_mark() {
    let chip = new_chip(Code::None);
    let state = Dropping(Part(&chip, STATE));
    let mut slots = Slots::new(Part(&chip, ACTIVE), Part(&chip, DOWNLOAD), state).expect("valid word sizes");
    let image = [1; CHUNK];
    assert_eq!(block_on(slots.write(0, &image)), Outcome::Done);
    let armed = block_on(slots.arm(CHUNK as u32, CRC.checksum(&image), None, ready(())));
    assert_eq!(armed, Outcome::Refused);
    assert_eq!(block_on(slots.booted()), Booted::Confirmed);
}

struct Fed;

impl Watchdog for Fed {
    fn feed(&mut self) {}
}

#[test]
fn firmware_that_cannot_confirm_itself_lets_all_other_tasks_run_and_says_so() {
    MockDriver::get().reset();
    let chip = new_chip(Code::Detects);
    let slots = Slots::new(Part(&chip, ACTIVE), Part(&chip, DOWNLOAD), Refusing::default());
    let slots = slots.expect("valid word sizes");
    let wires = Wires::<NoopRawMutex, 1>::new();
    let health = Health::new();
    let mut update = pin!(tasks::update::run(slots, &wires, &health, || unreachable!("no restart request")));
    let mut supervision = pin!(tasks::health::run(Fed, &health));
    let mut context = Context::from_waker(Waker::noop());
    let mut done = Vec::new();
    for _ in 0..CONFIRM_AFTER_ROUNDS + 20 * 20 {
        for task in [Task::Capture, Task::Supply, Task::Control, Task::Output] {
            health.check_in(task);
        }
        assert!(supervision.as_mut().poll(&mut context).is_pending());
        // The poll returns, so other tasks run.
        assert!(update.as_mut().poll(&mut context).is_pending());
        done.extend(wires.update.done.try_take());
        MockDriver::get().advance(Duration::from_millis(50));
    }
    assert_eq!(done, [Booted::OnTrial, Booted::Unconfirmable].map(SlotReport::Booted));
}
