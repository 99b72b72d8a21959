//! The I2C buses: which transfers run, and their results.
//!
//! Each bus has its own state. A result is kept until the next transfer starts, so a host may poll again when an answer
//! was lost.
//!
//! ```text
//!              a request starts a transfer        the task of the bus has ended it
//! +------+      +---------+                        +----------+
//! | Idle | ---> | Running | ---------------------> | Finished |
//! +------+      +---------+ <--------------------- +----------+
//!                            a request starts a transfer
//! ```
//!
//! In diagram and table, `Running` also stands for the state `Requested`, in which the task of the bus has not taken
//! the transfer.
//!
//! | state | start of a transfer | poll of the transfer's kind | poll of the other kind |
//! |---|---|---|---|
//! | `Idle` | acknowledged | NACK 42 | NACK 42 |
//! | `Running` | NACK 40 | NACK 41 | NACK 41 |
//! | `Finished` | acknowledged; the result is dropped | the result | NACK 43 |
//!
//! A transfer always ends: a bus error or a time-out ends it with an error in [`I2cStatus`]. Hosts poll until they get
//! a result, so an error of the bus is reported as a result and not as a refusal. The result of a transfer with an
//! error has no bytes.

use crate::devices::I2cTransfer;
use crate::protocol::answers::{I2cRead, I2cStatus, I2cWritten};
use crate::protocol::payload::Text;
use crate::protocol::pins::{I2cBus, ToPin};
use crate::protocol::{Nack, Reply};
use core::mem;

/// State of a bus. `written` is the number of bytes of a write, which the host polls with *poll write*. `written` is
/// `None` for a transfer that reads, which the host polls with *poll read*.
#[derive(Clone, Debug, Default)]
enum TransferState {
    #[default]
    Idle,
    /// The task of the bus has not taken the transfer.
    Requested(I2cTransfer),
    Running {
        written: Option<u8>,
    },
    Finished {
        written: Option<u8>,
        result: I2cRead,
    },
}

/// The transfers of one I2C bus.
#[derive(Clone, Debug, Default)]
pub struct Transfers {
    state: TransferState,
    fast: bool,
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
            I2cTransfer { address, fast, write, read }
        };
        match *request {
            ToPin::SetI2cSpeed { fast, .. } => self.fast = fast,
            ToPin::I2cSpeed { .. } => return Ok(Reply::data(&self.fast)),
            ToPin::PollI2cRead { .. } => {
                let (written, result) = self.result()?;
                return if written.is_none() {
                    Ok(Reply::data(result))
                } else {
                    Err(Nack::I2C_OTHER_TRANSFER)
                };
            }
            ToPin::PollI2cWrite { .. } => {
                let (written, I2cRead { status, .. }) = self.result()?;
                let count = written.ok_or(Nack::I2C_OTHER_TRANSFER)?;
                let count = if *status == I2cStatus::default() { count } else { 0 };
                return Ok(Reply::data(&I2cWritten { status: *status, count }));
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
    pub fn take_request(&mut self) -> Option<I2cTransfer> {
        let TransferState::Requested(transfer) = &self.state else { return None };
        let written = (transfer.read == 0).then_some(transfer.write.len() as u8);
        let running = TransferState::Running { written };
        let TransferState::Requested(transfer) = mem::replace(&mut self.state, running) else { return None };
        Some(transfer)
    }

    /// Stores the result of the running transfer.
    pub fn done(&mut self, result: I2cRead) {
        if let TransferState::Running { written } = self.state {
            self.state = TransferState::Finished { written, result };
        }
    }

    /// True while a transfer is requested or running.
    pub(super) const fn is_running(&self) -> bool {
        matches!(self.state, TransferState::Requested(_) | TransferState::Running { .. })
    }

    fn start(&mut self, transfer: I2cTransfer) -> Result<(), Nack> {
        if self.is_running() {
            return Err(Nack::I2C_BUSY);
        }
        self.state = TransferState::Requested(transfer);
        Ok(())
    }

    /// Returns the number of bytes of a finished write, or `None` for a read, and the result of the transfer.
    ///
    /// # Errors
    /// Refuses the poll of a bus without a finished transfer.
    const fn result(&self) -> Result<(Option<u8>, &I2cRead), Nack> {
        match &self.state {
            TransferState::Idle => Err(Nack::I2C_NO_TRANSFER),
            TransferState::Requested(_) | TransferState::Running { .. } => Err(Nack::I2C_RUNNING),
            TransferState::Finished { written, result } => Ok((*written, result)),
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
