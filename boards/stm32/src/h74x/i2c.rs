//! The controllers of the I2C buses (RM0433 47.4.9): I2C1 to I2C4. A controller waits for one interrupt per byte.
//!
//! The controller stretches the clock until the core has read or written the byte, so a busy core loses no byte.

use crate::i2c_bus::{self, Error, i2c_controllers};
use crate::supply::InterruptWaiter;
use embassy_stm32::pac::i2c::I2c;
use embassy_stm32::pac::i2c::regs::Isr;
use embassy_stm32::pac::i2c::vals::{Addmode, Autoend, Dir};

/// Fields of the register TIMINGR (RM0433 47.4.10). One unit is `prescaler` + 1 periods of the controller's clock of
/// 100 MHz. `low`, `high` and `data_setup` are one less than their number of units.
struct Timing {
    prescaler: u8,
    low: u8,
    high: u8,
    data_hold: u8,
    data_setup: u8,
}

/// At most 100 kHz. The low and the high phase have 5.0 us each. The rise time of a line is at most 1000 ns.
const SLOW: Timing = Timing { prescaler: 9, low: 49, high: 49, data_hold: 3, data_setup: 12 };
/// At most 400 kHz. The low phase has 1.35 us, and the high phase has 1.15 us. The rise time of a line is at most 300
/// ns.
const FAST: Timing = Timing { prescaler: 4, low: 26, high: 22, data_hold: 5, data_setup: 7 };

i2c_controllers! {
    i2c1: I2C1, I2C1_EV, I2C1_ER;
    i2c2: I2C2, I2C2_EV, I2C2_ER;
    i2c3: I2C3, I2C3_EV, I2C3_ER;
    i2c4: I2C4, I2C4_EV, I2C4_ER;
}

/// Handles an interrupt of a controller: disables its interrupts, and wakes the task once. The event flags stay set,
/// because the task reads them. A bus error is cleared and ignored, because the transfer continues (ES0392 2.19.4).
fn handle_interrupt(registers: I2c, waiter: &InterruptWaiter) {
    registers.icr().write(|w| w.set_berrcf(true));
    enable(registers, false);
    waiter.wake();
}

/// Enables or disables all interrupts of a transfer. A missing acknowledgement needs no interrupt, because the stop
/// condition that follows has one.
fn enable(registers: I2c, on: bool) {
    registers.cr1().modify(|w| {
        w.set_txie(on);
        w.set_rxie(on);
        w.set_stopie(on);
        w.set_tcie(on);
        w.set_errie(on);
    });
}

impl Controller {
    /// Waits for a flag.
    ///
    /// # Errors
    /// Returns `refused` after a byte without acknowledgement; the controller has then made a stop condition. Returns
    /// [`Error::Arbitration`] after a lost arbitration.
    async fn wait(&self, flag: fn(&Isr) -> bool, refused: Error) -> Result<(), Error> {
        let registers = self.registers;
        // After a missing acknowledgement the controller makes a stop condition without a request.
        let failed = |status: Isr| status.arlo() || status.nackf() && status.stopf();
        let due = || {
            let status = registers.isr().read();
            failed(status) || !status.nackf() && flag(&status)
        };
        self.waiter.wait(due, || enable(registers, true)).await;
        let status = registers.isr().read();
        if !failed(status) {
            return Ok(());
        }
        self.clear();
        // Setting TXE discards a byte in TXDR that has not been sent.
        registers.isr().write(|w| w.set_txe(true));
        Err(if status.arlo() { Error::Arbitration } else { refused })
    }

    fn clear(&self) {
        self.registers.icr().write(|w| {
            w.set_stopcf(true);
            w.set_nackcf(true);
            w.set_arlocf(true);
        });
    }

    /// Puts a start condition and an address on the bus, for a transfer of `count` bytes.
    fn start(&self, address: u8, count: usize, direction: Dir, then_stop: bool) {
        self.registers.cr2().write(|w| {
            w.set_add10(Addmode::BIT7);
            w.set_sadd(u16::from(address) << 1);
            w.set_dir(direction);
            w.set_nbytes(u8::try_from(count).unwrap_or(u8::MAX));
            w.set_autoend(if then_stop { Autoend::AUTOMATIC } else { Autoend::SOFTWARE });
            w.set_start(true);
        });
    }

    /// Waits for the stop condition.
    async fn stopped(&self, refused: Error) -> Result<(), Error> {
        self.wait(Isr::stopf, refused).await?;
        self.clear();
        Ok(())
    }
}

impl i2c_bus::Controller for Controller {
    fn set_speed(&mut self, fast: bool) {
        self.fast = fast;
    }

    fn reset(&mut self) {
        let registers = self.registers;
        registers.cr1().write(|w| w.set_pe(false));
        // The controller must be disabled for at least three cycles of its APB clock (RM0433 47.4.6). Reading the
        // register takes this time.
        let _ = registers.cr1().read();
        let timing = if self.fast { FAST } else { SLOW };
        registers.timingr().write(|w| {
            w.set_presc(timing.prescaler);
            w.set_scll(timing.low);
            w.set_sclh(timing.high);
            w.set_sdadel(timing.data_hold);
            w.set_scldel(timing.data_setup);
        });
        registers.cr1().write(|w| w.set_pe(true));
        self.set = self.fast;
    }

    /// Applies a changed speed. No wait is needed, because every transfer has waited for its stop condition.
    async fn idle(&mut self) {
        if self.set != self.fast {
            self.reset();
        }
    }

    async fn write(&mut self, address: u8, bytes: &[u8], read_follows: bool) -> Result<(), Error> {
        self.start(address, bytes.len(), Dir::WRITE, !read_follows);
        let mut refused = Error::NoAddress;
        for byte in bytes {
            self.wait(Isr::txis, refused).await?;
            self.registers.txdr().write(|w| w.set_txdata(*byte));
            refused = Error::NoData;
        }
        if read_follows { self.wait(Isr::tc, refused).await } else { self.stopped(refused).await }
    }

    async fn read(&mut self, address: u8, into: &mut [u8]) -> Result<(), Error> {
        self.start(address, into.len(), Dir::READ, true);
        for byte in into {
            self.wait(Isr::rxne, Error::NoAddress).await?;
            *byte = self.registers.rxdr().read().rxdata();
        }
        self.stopped(Error::NoData).await
    }
}
