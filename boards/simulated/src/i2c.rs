//! The I2C buses of the simulated board, with their devices and their faults.
//!
//! | bus | address | device |
//! |---|---|---|
//! | 0 | 0x28 | a [`Bno055`], which turns with the drive base |
//! | 1 | 0x50 | a memory of 256 bytes; the first byte of a write is the address of the next byte |
//!
//! The other two buses have no device.

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

/// Time that a stretching device holds the clock.
const STRETCH: Duration = Duration::from_millis(30);

/// Condition of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// The bus works.
    #[default]
    None,
    /// No device acknowledges its address.
    NoAcknowledge,
    /// In the first transfer a device begins to hold SDA low, until the bus is freed.
    StuckData,
    /// A reset of the hub has interrupted a transfer: a device holds SDA low until the bus is freed.
    Interrupted,
    /// A device holds SCL low for ever.
    StuckClock,
    /// The devices stretch the clock for 30 ms in each transfer.
    Stretching,
}

/// The devices of all buses.
#[derive(Clone, Debug)]
pub(crate) struct I2cDevices {
    pub(crate) imu: Bno055,
    memory: [u8; 256],
    next: u8,
    pub(crate) faults: [Fault; I2C_BUSES],
    /// For each bus, true while a device holds SDA low.
    data_held: [bool; I2C_BUSES],
}

impl Default for I2cDevices {
    fn default() -> Self {
        Self {
            imu: Bno055::default(),
            memory: [0; 256],
            next: 0,
            faults: [Fault::None; I2C_BUSES],
            data_held: [false; I2C_BUSES],
        }
    }
}

impl I2cDevices {
    fn hold_data(&mut self, bus: usize) {
        if let Some(held) = self.data_held.get_mut(bus) {
            *held = true;
        }
    }

    fn free_data(&mut self, bus: usize) {
        if let (Some(held), Some(fault)) = (self.data_held.get_mut(bus), self.faults.get_mut(bus))
            && (std::mem::take(held) || *fault == Fault::Interrupted)
        {
            *fault = Fault::None;
        }
    }

    fn transfer(
        &mut self,
        bus: usize,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let no_device = Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));
        for operation in operations {
            match (bus, address, operation) {
                (0, IMU_ADDRESS, _) if !self.imu.answers() => return no_device,
                (0, IMU_ADDRESS, Operation::Write(bytes)) => self.imu.write(bytes),
                (0, IMU_ADDRESS, Operation::Read(bytes)) => self.imu.read(bytes),
                (1, MEMORY_ADDRESS, Operation::Write(bytes)) => {
                    for (index, byte) in bytes.iter().enumerate() {
                        if index == 0 {
                            self.next = *byte;
                            continue;
                        }
                        self.memory[usize::from(self.next)] = *byte;
                        self.next = self.next.wrapping_add(1);
                    }
                }
                (1, MEMORY_ADDRESS, Operation::Read(bytes)) => {
                    for byte in bytes.iter_mut() {
                        *byte = self.memory[usize::from(self.next)];
                        self.next = self.next.wrapping_add(1);
                    }
                }
                _ => return no_device,
            }
        }
        Ok(())
    }
}

/// The hub's end of one bus.
pub struct SimulatedBus {
    pub(crate) board: Board,
    pub(crate) bus: usize,
    pub(crate) fast: bool,
}

impl ErrorType for SimulatedBus {
    type Error = ErrorKind;
}

impl I2c for SimulatedBus {
    async fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        match self.board.i2c_fault(self.bus) {
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

    async fn free(&mut self) {
        self.board.with_i2c(|devices| devices.free_data(self.bus));
    }
}
