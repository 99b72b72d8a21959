//! Tests of the slots, and of the task that owns the slots. The task runs under virtual time.

use crate::power::{STATE, new_chip, send, slots};
use crate::torn_flash::{Code, Wear};
use embassy_futures::block_on;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, MockDriver};
use motor_hub::tasks::update::CONFIRM_AFTER_ROUNDS;
use motor_hub::tasks::{self, Health, Task, Wires};
use motor_hub::update::{Booted, CHUNK, CRC, Outcome, SlotReport};
use std::future::ready;
use std::pin::pin;
use std::task::{Context, Waker};

/// Value of each byte of the swap mark in the bootloader's state.
const SWAPPED: u8 = 0xF0;

#[test]
fn an_image_is_not_armed_if_the_flash_has_dropped_the_swap_mark() {
    let chip = new_chip(Code::None);
    chip.borrow_mut().wear = Wear::Drops(|word| word.first() == Some(&SWAPPED));
    let mut slots = slots(&chip);
    let image = [1; CHUNK];
    assert_eq!(send(&mut slots, &image), Outcome::Done);
    let armed = block_on(slots.arm(CHUNK as u32, CRC.checksum(&image), None, ready(())));
    assert_eq!(armed, Outcome::Refused);
    assert_eq!(block_on(slots.booted()), Booted::Confirmed);
}

#[test]
fn firmware_that_cannot_confirm_itself_lets_all_other_tasks_run_and_says_so() {
    MockDriver::get().reset();
    let chip = new_chip(Code::Detects);
    // The new firmware has been swapped in.
    chip.borrow_mut().put(STATE.start, &[SWAPPED; STATE.end - STATE.start]);
    chip.borrow_mut().wear = Wear::Refuses;
    let wires = Wires::<NoopRawMutex, 1>::new();
    let health = Health::new();
    let mut update =
        pin!(tasks::update::run(slots(&chip), &wires, &health, || unreachable!("no restart request")));
    let mut supervision = pin!(tasks::health::run(|| (), &health));
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
