//! Transfers on one I2C bus.
//!
//! The task takes a transfer from the responder, runs it, and returns its result. Each transfer ends within [`TIME_OUT`], also on a
//! bus with a stuck line. After a time-out and after an error of the bus the task frees the bus.

use super::Wires;
use crate::board::I2cBus;
use crate::protocol::answers::{I2cRead, I2cStatus};
use crate::protocol::payload::TEXT;
use crate::responder::i2c::Transfer;
use core::future::pending;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, with_timeout};
use embedded_hal_async::i2c::{Error, ErrorKind, NoAcknowledgeSource};

/// Longest time of a transfer. The longest transfer without clock stretching, 101 bytes at 100 kbit/s, takes 9.4 ms. A device may
/// stretch the clock for 30 ms.
pub const TIME_OUT: Duration = Duration::from_millis(50);

/// Runs the transfers of the bus with this number.
pub async fn run<M: RawMutex, const N: usize>(mut bus: impl I2cBus, number: usize, wires: &Wires<M, N>) -> ! {
    let Some(channel) = wires.i2c.get(number) else { pending().await };
    // A reset of the hub may have interrupted a transfer.
    bus.free().await;
    loop {
        let transfer = channel.request.wait().await;
        let result = transfer_on(&mut bus, &transfer).await;
        channel.done.signal(result);
    }
}

async fn transfer_on(bus: &mut impl I2cBus, transfer: &Transfer) -> I2cRead {
    let Transfer { address, fast, write, read } = transfer;
    bus.set_speed(*fast);
    let mut bytes = [0; TEXT];
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
        bus.free().await;
    }
    I2cRead { status, ..I2cRead::default() }
}
