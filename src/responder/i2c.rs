//! The I2C buses: which transfers run, and their results.
//!
//! Each bus has its own state. A result is kept until the next transfer starts, so a host may poll again when an answer was lost.
//!
//! ```text
//!              a request starts a transfer        the task of the bus has ended it
//! +------+      +---------+                        +----------+
//! | Idle | ---> | Running | ---------------------> | Finished |
//! +------+      +---------+ <--------------------- +----------+
//!                            a request starts a transfer
//! ```
//!
//! | state | start of a transfer | poll of the transfer's kind | poll of the other kind |
//! |---|---|---|---|
//! | `Idle` | acknowledged | NACK 42 | NACK 42 |
//! | `Running` | NACK 40 | NACK 41 | NACK 41 |
//! | `Finished` | acknowledged; the result is dropped | the result | NACK 43 |
//!
//! A transfer always ends: a bus error or a time-out ends it with an error in [`I2cStatus`]. Hosts poll a transfer until its result
//! comes, so errors of the bus are no refusals. The result of a transfer with an error has no bytes.

use crate::protocol::answers::{I2cRead, I2cStatus, I2cWritten};
use crate::protocol::payload::Text;
use crate::protocol::pins::{I2cBus, ToPin};
use crate::protocol::{Nack, Reply};
use core::mem;

/// A transfer on one bus: a write, a read, or a write and a read after a repeated start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// Address of the device, 0 to 127.
    pub address: u8,
    /// True for 400 kbit/s, false for 100 kbit/s.
    pub fast: bool,
    /// The bytes to write; empty for a read.
    pub write: Text,
    /// Number of bytes to read after the write, 0 to 100.
    pub read: u8,
}

/// What a transfer's result answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TransferKind {
    /// The host polls with *poll read*.
    Read,
    /// The host polls with *poll write*, and has written this number of bytes.
    Write(u8),
}

#[derive(Clone, Debug, Default)]
enum TransferState {
    #[default]
    Idle,
    /// The task of the bus has not taken the transfer.
    Requested(Transfer),
    Running(TransferKind),
    Finished(TransferKind, I2cRead),
}

/// The transfers of one I2C bus.
#[derive(Clone, Debug, Default)]
pub struct Transfers {
    state: TransferState,
    fast: bool,
}

impl Transfer {
    fn kind(&self) -> TransferKind {
        if self.read == 0 { TransferKind::Write(self.write.len() as u8) } else { TransferKind::Read }
    }
}

impl Transfers {
    /// Executes a request to the bus.
    ///
    /// # Errors
    /// Returns why the request is refused. Nothing has changed then.
    pub fn receive(&mut self, request: &ToPin) -> Result<Reply, Nack> {
        let fast = self.fast;
        let transfer = |address: u8, write: &[u8], read| {
            let write = Text::from_slice(write).unwrap_or_default();
            Transfer { address, fast, write, read }
        };
        match *request {
            ToPin::SetI2cSpeed { fast, .. } => self.fast = fast,
            ToPin::I2cSpeed { .. } => return Ok(Reply::data(&self.fast)),
            ToPin::PollI2cRead { .. } => {
                return self.result().and_then(|(kind, result)| match kind {
                    TransferKind::Read => Ok(Reply::data(result)),
                    TransferKind::Write(_) => Err(Nack::I2C_OTHER_TRANSFER),
                });
            }
            ToPin::PollI2cWrite { .. } => {
                return self.result().and_then(|(kind, result)| match kind {
                    TransferKind::Read => Err(Nack::I2C_OTHER_TRANSFER),
                    TransferKind::Write(count) => {
                        let status = result.status;
                        let count = if status == I2cStatus::default() { count } else { 0 };
                        Ok(Reply::data(&I2cWritten { status, count }))
                    }
                });
            }
            ToPin::WriteI2cByte { address, byte, .. } => self.start(transfer(address.get(), &[byte], 0))?,
            ToPin::WriteI2c { ref bytes, .. } if bytes.is_empty() => return Err(Nack::parameter(2)),
            ToPin::WriteI2c { address, ref bytes, .. } => self.start(transfer(address.get(), bytes, 0))?,
            ToPin::ReadI2cByte { address, .. } => self.start(transfer(address.get(), &[], 1))?,
            ToPin::ReadI2c { address, count, .. } => self.start(transfer(address.get(), &[], count.get()))?,
            ToPin::ReadI2cRegister { address, count, register, .. } => {
                self.start(transfer(address.get(), &[register], count.get()))?;
            }
            _ => return Err(Nack::UNSUPPORTED),
        }
        Ok(Reply::ACK)
    }

    /// Returns the next transfer for the task of the bus. `None` if no new transfer was requested.
    pub fn take_request(&mut self) -> Option<Transfer> {
        let TransferState::Requested(transfer) = &self.state else { return None };
        let running = TransferState::Running(transfer.kind());
        let TransferState::Requested(transfer) = mem::replace(&mut self.state, running) else { return None };
        Some(transfer)
    }

    /// Stores the result of the running transfer.
    pub fn done(&mut self, result: I2cRead) {
        if let TransferState::Running(kind) = self.state {
            self.state = TransferState::Finished(kind, result);
        }
    }

    /// True while a transfer is requested or running.
    pub(super) const fn is_running(&self) -> bool {
        matches!(self.state, TransferState::Requested(_) | TransferState::Running(_))
    }

    fn start(&mut self, transfer: Transfer) -> Result<(), Nack> {
        if self.is_running() {
            return Err(Nack::I2C_BUSY);
        }
        self.state = TransferState::Requested(transfer);
        Ok(())
    }

    const fn result(&self) -> Result<(TransferKind, &I2cRead), Nack> {
        match &self.state {
            TransferState::Idle => Err(Nack::I2C_NO_TRANSFER),
            TransferState::Requested(_) | TransferState::Running(_) => Err(Nack::I2C_RUNNING),
            TransferState::Finished(kind, result) => Ok((*kind, result)),
        }
    }
}

/// Returns the bus that a request is for. `None` for a request to pins and servos.
pub(super) const fn bus_of(request: &ToPin) -> Option<I2cBus> {
    match *request {
        ToPin::WriteI2cByte { bus, .. }
        | ToPin::WriteI2c { bus, .. }
        | ToPin::ReadI2cByte { bus, .. }
        | ToPin::ReadI2c { bus, .. }
        | ToPin::ReadI2cRegister { bus, .. }
        | ToPin::PollI2cRead { bus }
        | ToPin::PollI2cWrite { bus }
        | ToPin::SetI2cSpeed { bus, .. }
        | ToPin::I2cSpeed { bus } => Some(bus),
        _ => None,
    }
}
