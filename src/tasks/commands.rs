//! The queue of commands to the control task. No queued command is lost, commands stay in order, and each command has a number.
//!
//! The first command since boot has the number 1. Numbers wrap from 2^32 - 1 to 0. [`Hub`](crate::hub::Hub) counts the commands
//! that it applies, and each [`Snapshot`](crate::hub::Snapshot) states the number of the newest command that it includes. The
//! numbers of hub and queue agree only if all commands to the hub go through this queue.

use super::COMMANDS;
use crate::hub::Command;
use core::cell::Cell;
use core::future::poll_fn;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::{Channel, TryReceiveError, TrySendError};

/// The queue of commands to the control task.
pub struct CommandQueue<M: RawMutex> {
    channel: Channel<M, Command, COMMANDS>,
    /// Number of the newest command that has entered the channel; 0 before the first. The lock is held while a command enters, so
    /// that commands have their numbers in the order of the channel.
    newest: Mutex<M, Cell<u32>>,
}

impl<M: RawMutex> CommandQueue<M> {
    /// Creates an empty queue.
    pub const fn new() -> Self {
        Self { channel: Channel::new(), newest: Mutex::new(Cell::new(0)) }
    }

    /// Queues a command, and returns its number.
    ///
    /// # Errors
    /// Returns the command if the queue is full.
    pub fn try_send(&self, command: Command) -> Result<u32, TrySendError<Command>> {
        self.newest.lock(|newest| {
            self.channel.try_send(command)?;
            newest.set(newest.get().wrapping_add(1));
            Ok(newest.get())
        })
    }

    /// Waits until there is room, queues a command, and returns its number. If the future is dropped before it is ready, the
    /// command is not queued.
    pub async fn send(&self, command: Command) -> u32 {
        loop {
            if let Ok(number) = self.try_send(command) {
                return number;
            }
            poll_fn(|context| self.channel.poll_ready_to_send(context)).await;
        }
    }

    /// Takes the oldest command out of the queue.
    ///
    /// # Errors
    /// Returns [`TryReceiveError::Empty`] if the queue is empty.
    pub fn try_receive(&self) -> Result<Command, TryReceiveError> {
        self.channel.try_receive()
    }
}

impl<M: RawMutex> Default for CommandQueue<M> {
    fn default() -> Self {
        Self::new()
    }
}
