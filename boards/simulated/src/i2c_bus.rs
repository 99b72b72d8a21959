//! The hub's ends of the I2C buses of the simulated board. A transfer takes the time of its bits. A fault of the bus
//! makes the transfer fail, hang or take longer.

use crate::i2c::Fault;
use crate::world::Board;
use embassy_time::{Duration, Timer};
use embedded_hal_async::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use motor_hub::board::I2cBus;
use std::future::pending;

/// Time that a stretching device holds the clock.
const STRETCH: Duration = Duration::from_millis(30);

/// The hub's end of one bus.
pub(crate) struct SimulatedBus {
    board: Board,
    bus: usize,
    fast: bool,
}

impl SimulatedBus {
    /// The bus of this number, at its slow speed.
    pub(crate) const fn new(board: Board, bus: usize) -> Self {
        Self { board, bus, fast: false }
    }
}

impl ErrorType for SimulatedBus {
    type Error = ErrorKind;
}

impl I2c for SimulatedBus {
    async fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        match self.board.with_i2c(|devices| devices.fault(self.bus)) {
            Fault::None => (),
            Fault::NoAcknowledge => return Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)),
            Fault::StuckData | Fault::Interrupted => {
                self.board.with_i2c(|devices| devices.hold_data(self.bus));
                return Err(ErrorKind::ArbitrationLoss);
            }
            Fault::StuckClock => return pending().await,
            Fault::Stretching => Timer::after(STRETCH).await,
        }
        let bytes = operations.iter().map(|operation| match operation {
            Operation::Write(bytes) => bytes.len(),
            Operation::Read(bytes) => bytes.len(),
        });
        // Each operation sends the address first. A byte takes nine clocks.
        let bits: usize = bytes.map(|bytes| 9 * (bytes + 1)).sum();
        let tenths_us = if self.fast { 25 } else { 100 };
        Timer::after(Duration::from_micros(bits as u64 * tenths_us / 10)).await;
        self.board.with_i2c(|devices| devices.transfer(self.bus, address, operations))
    }
}

impl I2cBus for SimulatedBus {
    fn set_speed(&mut self, fast: bool) {
        self.fast = fast;
    }

    async fn recover(&mut self) {
        self.board.with_i2c(|devices| devices.free_data(self.bus));
    }
}
