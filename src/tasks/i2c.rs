//! Transfers on one I2C bus.
//!
//! The task takes a transfer from the responder, runs it, and returns its result. A transfer ends within [`TIME_OUT`],
//! also on a bus with a stuck line. After a time-out or an error of the bus the task frees the bus before it returns
//! the result.
//!
//! On bus [`GYRO_BUS`] the task also reads the gyro of a drive base, between the transfers of the host. A host may write
//! the number of a register and read later: see [`HostRegister`].

use super::{Wires, micros};
use crate::board::I2cBus;
use crate::devices::bno055::{Bno055, HostRegister};
use crate::devices::{I2C_BYTES, I2cTransfer};
use crate::hub::GyroReading;
use crate::protocol::answers::{I2cRead, I2cStatus};
use core::cell::Cell;
use core::future::pending;
use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_hal_async::i2c::{Error, ErrorKind, NoAcknowledgeSource};

/// Longest time of a transfer. The longest transfer has 103 bytes: the address twice, the number of a register, and 100
/// bytes of data. It takes 11.2 ms at 83 kbit/s, the slowest clock of a board. A device may also stretch the clock for 30 ms.
pub const TIME_OUT: Duration = Duration::from_millis(50);

/// Number of the bus with the gyro of a drive base.
pub const GYRO_BUS: usize = 0;

/// Time between two readings of the gyro. A BNO055 has new angles 100 times a second.
pub const GYRO_INTERVAL: Duration = Duration::from_millis(10);

/// Interval at which the task checks whether a drive base uses the gyro, while no drive base uses it.
const IDLE_INTERVAL: Duration = Duration::from_millis(100);

/// Runs the transfers of the bus with this number.
pub async fn run<M: RawMutex, const N: usize>(mut bus: impl I2cBus, number: usize, wires: &Wires<M, N>) -> ! {
    let Some(channel) = wires.i2c.get(number) else { pending().await };
    // A reset of the hub may have interrupted a transfer.
    bus.recover().await;
    let (mut sensor, mut due) = (Bno055::default(), Instant::now());
    let mut host_register = HostRegister::default();
    loop {
        let reading = async {
            match number {
                GYRO_BUS => Timer::at(due).await,
                _ => pending().await,
            }
        };
        match select(channel.request.wait(), reading).await {
            Either::First(transfer) => {
                let transfer = host_register.prepare(transfer);
                let result = transfer_on(&mut bus, &transfer).await;
                channel.done.signal(result);
            }
            Either::Second(()) => {
                let interval = if wires.gyro_wanted.lock(Cell::get) { GYRO_INTERVAL } else { IDLE_INTERVAL };
                read_gyro(&mut bus, &mut sensor, &mut host_register, wires).await;
                due = Instant::now().max(due + interval);
            }
        }
    }
}

/// Does the next access to the gyro, and publishes its angle. The gyro is not accessed if no drive base uses it.
async fn read_gyro<M: RawMutex, const N: usize>(
    bus: &mut impl I2cBus,
    sensor: &mut Bno055,
    host_register: &mut HostRegister,
    wires: &Wires<M, N>,
) {
    if !wires.gyro_wanted.lock(Cell::get) {
        *sensor = Bno055::default();
        wires.gyro.lock(|gyro| gyro.set(None));
        return;
    }
    let now = || micros(Instant::now());
    let Some(transfer) = sensor.next(now()) else { return };
    host_register.note_driver_access();
    let I2cRead { status, bytes } = transfer_on(bus, &transfer).await;
    let answer = (status == I2cStatus::default()).then_some(bytes.as_slice());
    match sensor.receive(now(), answer) {
        Some(left_degrees) => {
            wires.gyro.lock(|gyro| gyro.set(Some(GyroReading { left_degrees, at: now() })));
        }
        None if !sensor.is_measuring() => wires.gyro.lock(|gyro| gyro.set(None)),
        // A few accesses in a row may fail. The last angle stays valid for 100 ms.
        None => (),
    }
}

async fn transfer_on(bus: &mut impl I2cBus, transfer: &I2cTransfer) -> I2cRead {
    let I2cTransfer { address, fast, write, read } = transfer;
    bus.set_speed(*fast);
    let mut bytes = [0; I2C_BYTES];
    let into = bytes.get_mut(..usize::from(*read)).unwrap_or_default();
    let result = with_timeout(TIME_OUT, async {
        match (write.is_empty(), into.is_empty()) {
            (true, _) => bus.read(*address, into).await,
            (false, true) => bus.write(*address, write).await,
            (false, false) => bus.write_read(*address, write, into).await,
        }
    });
    let status = match result.await {
        Ok(Ok(())) => {
            return I2cRead { status: I2cStatus::default(), bytes: into.iter().copied().collect() };
        }
        Ok(Err(error)) => match error.kind() {
            ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data) => I2cStatus::NO_DATA,
            ErrorKind::NoAcknowledge(_) => I2cStatus::NO_ADDRESS,
            ErrorKind::ArbitrationLoss => I2cStatus::ARBITRATION_LOST,
            _ => I2cStatus::TIME_OUT,
        },
        Err(_) => I2cStatus::TIME_OUT,
    };
    if status == I2cStatus::ARBITRATION_LOST || status == I2cStatus::TIME_OUT {
        bus.recover().await;
    }
    I2cRead { status, ..I2cRead::default() }
}
