//! The devices on the I2C buses of the simulated board, the hub's ends of the buses, and the buses' faults.
//!
//! | bus | address | device |
//! |---|---|---|
//! | 0 | 0x28 | a [`Bno055`], which turns with the drive base |
//! | 1 | 0x50 | a [`ByteMemory`] |
//!
//! The other two buses have no device. A transfer takes the time of its bits. A fault of the bus makes the transfer fail,
//! hang or take longer.

use crate::bno055::Bno055;
use crate::world::Board;
use embassy_time::{Duration, Timer};
use embedded_hal_async::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use motor_hub::board::{I2C_BUSES, I2cBus};
use serde::Deserialize;
use std::future::pending;

/// Address of the inertial sensor on bus 0.
pub const IMU_ADDRESS: u8 = 0x28;
/// Address of the memory on bus 1.
pub const MEMORY_ADDRESS: u8 = 0x50;

/// Result of a transfer to an address that no device acknowledges.
const NO_DEVICE: Result<(), ErrorKind> = Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));

/// Condition of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The bus works.
    #[default]
    None,
    /// No device acknowledges its address.
    NoAcknowledge,
    /// From the first transfer on, a device holds SDA low until the bus is freed.
    StuckData,
    /// A reset of the hub has interrupted a transfer: a device holds SDA low until the bus is freed.
    Interrupted,
    /// A device holds SCL low and never releases it.
    StuckClock,
    /// The devices stretch the clock for 30 ms in each transfer.
    Stretching,
}

/// A memory of 256 bytes. The first byte of a write is the address of the next byte. A read begins where the last access
/// ended.
#[derive(Clone, Debug)]
pub struct ByteMemory {
    bytes: [u8; 256],
    next: u8,
}

impl ByteMemory {
    /// Creates a memory with this content.
    pub const fn new(bytes: [u8; 256]) -> Self {
        Self { bytes, next: 0 }
    }

    /// Returns the byte at an address.
    pub const fn byte(&self, address: u8) -> u8 {
        self.bytes[address as usize]
    }

    /// Writes the bytes of one transfer.
    pub fn write(&mut self, bytes: &[u8]) {
        let Some((address, contents)) = bytes.split_first() else { return };
        self.next = *address;
        contents.iter().for_each(|byte| *self.next_byte() = *byte);
    }

    /// Reads bytes.
    pub fn read(&mut self, bytes: &mut [u8]) {
        bytes.iter_mut().for_each(|byte| *byte = *self.next_byte());
    }

    fn next_byte(&mut self) -> &mut u8 {
        let address = self.next;
        self.next = address.wrapping_add(1);
        &mut self.bytes[usize::from(address)]
    }
}

#[derive(Clone, Debug)]
pub(crate) struct I2cDevices {
    pub(crate) imu: Bno055,
    memory: ByteMemory,
    pub(crate) faults: [Fault; I2C_BUSES],
}

impl Default for I2cDevices {
    fn default() -> Self {
        let memory = ByteMemory::new([0; 256]);
        Self { imu: Bno055::default(), memory, faults: [Fault::None; I2C_BUSES] }
    }
}

impl I2cDevices {
    /// Frees a bus whose SDA a device holds low.
    fn free_data(&mut self, bus: usize) {
        if self.faults[bus] == Fault::Interrupted {
            self.faults[bus] = Fault::None;
        }
    }

    fn transfer(
        &mut self,
        bus: usize,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        for operation in operations {
            match (bus, address, operation) {
                (0, IMU_ADDRESS, _) if !self.imu.answers() => return NO_DEVICE,
                (0, IMU_ADDRESS, Operation::Write(bytes)) => self.imu.write(bytes),
                (0, IMU_ADDRESS, Operation::Read(bytes)) => {
                    self.imu.start();
                    self.imu.read(bytes);
                }
                (1, MEMORY_ADDRESS, Operation::Write(bytes)) => self.memory.write(bytes),
                (1, MEMORY_ADDRESS, Operation::Read(bytes)) => self.memory.read(bytes),
                _ => return NO_DEVICE,
            }
        }
        Ok(())
    }
}

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
        match self.board.with_i2c(|devices| devices.faults[self.bus]) {
            Fault::None => (),
            Fault::NoAcknowledge => return NO_DEVICE,
            Fault::StuckData | Fault::Interrupted => {
                // From now on a device holds SDA low.
                self.board.with_i2c(|devices| devices.faults[self.bus] = Fault::Interrupted);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_is_freed_from_held_data_only() {
        let mut devices = I2cDevices::default();
        devices.faults[0] = Fault::Interrupted;
        devices.free_data(0);
        assert_eq!(devices.faults[0], Fault::None);
        for lasting in [Fault::StuckData, Fault::StuckClock, Fault::NoAcknowledge, Fault::Stretching] {
            devices.faults[0] = lasting;
            devices.free_data(0);
            assert_eq!(devices.faults[0], lasting);
        }
    }
}
