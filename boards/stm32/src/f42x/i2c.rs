//! The controllers of the I2C buses (RM0090 27.3.3): I2C1, I2C2 and I2C3. A controller waits for one interrupt per
//! byte.
//!
//! The controller stretches the clock until the core has read or written the byte, so a busy core loses no byte.

use crate::i2c_bus::{self, Error, i2c_controllers};
use crate::supply::InterruptWaiter;
use embassy_stm32::pac::i2c::I2c;
use embassy_stm32::pac::i2c::regs::Sr1;
use embassy_stm32::pac::i2c::vals::{Duty, FS, Pos};
use embassy_time::Timer;

/// Clock of the controllers, PCLK1, in MHz.
const CLOCK_MHZ: u16 = 42;

/// Time in microseconds between two checks whether a stop condition is complete. It is about one clock period.
const STOP_MICROS: u64 = 10;

i2c_controllers! {
    i2c1: I2C1, I2C1_EV, I2C1_ER;
    i2c2: I2C2, I2C2_EV, I2C2_ER;
    i2c3: I2C3, I2C3_EV, I2C3_ER;
}

/// Handles an interrupt of a controller: disables its interrupts, and wakes the task once. The event flags stay set,
/// because the task reads them. A bus error is cleared and ignored, because the transfer continues (ES0206 2.9.6).
fn handle_interrupt(registers: I2c, waiter: &InterruptWaiter) {
    registers.sr1().write(|w| {
        // A written 0 clears a flag, and a written 1 changes nothing.
        w.0 = u32::MAX;
        w.set_berr(false);
    });
    registers.cr2().modify(|w| {
        w.set_itevten(false);
        w.set_itbufen(false);
        w.set_iterren(false);
    });
    waiter.wake();
}

impl Controller {
    /// Waits for a flag. If `buffered` is true, the interrupts TXE and RXNE are enabled too. These interrupts stay
    /// pending until the data register is written or read.
    ///
    /// # Errors
    /// Returns `refused` after a byte without acknowledgement, and requests a stop condition. Returns
    /// [`Error::Arbitration`] after a lost arbitration.
    async fn wait(&self, flag: fn(&Sr1) -> bool, buffered: bool, refused: Error) -> Result<(), Error> {
        let registers = self.registers;
        let failed = |status: Sr1| status.af() || status.arlo();
        let due = || {
            let status = registers.sr1().read();
            flag(&status) || failed(status)
        };
        let enable = || {
            registers.cr2().modify(|w| {
                w.set_itevten(true);
                w.set_itbufen(buffered);
                w.set_iterren(true);
            });
        };
        self.waiter.wait(due, enable).await;
        let status = registers.sr1().read();
        if !failed(status) {
            return Ok(());
        }
        registers.sr1().write(|w| {
            w.0 = u32::MAX;
            w.set_af(false);
            w.set_arlo(false);
        });
        if status.arlo() {
            return Err(Error::Arbitration);
        }
        self.stop();
        Err(refused)
    }

    fn stop(&self) {
        self.registers.cr1().modify(|w| w.set_stop(true));
    }

    /// Puts a start and an address on the bus. The bus then waits until SR2 is read.
    async fn address(&self, byte: u8) -> Result<(), Error> {
        self.registers.cr1().modify(|w| {
            w.set_ack(true);
            w.set_pos(Pos::CURRENT);
            w.set_start(true);
        });
        self.wait(Sr1::start, false, Error::NoAddress).await?;
        self.registers.dr().write(|w| w.set_dr(byte));
        self.wait(Sr1::addr, false, Error::NoAddress).await
    }

    fn clear_addr(&self) {
        let _ = self.registers.sr2().read();
    }

    async fn next_byte(&self) -> Result<u8, Error> {
        self.wait(Sr1::rxne, true, Error::NoData).await?;
        Ok(self.registers.dr().read().dr())
    }
}

impl i2c_bus::Controller for Controller {
    fn set_speed(&mut self, fast: bool) {
        self.fast = fast;
    }

    fn reset(&mut self) {
        let registers = self.registers;
        // The reset also clears BUSY if the controller takes a free bus for busy (RM0090 27.6.1, SWRST).
        registers.cr1().write(|w| w.set_swrst(true));
        registers.cr1().write(|w| w.set_swrst(false));
        registers.cr2().write(|w| w.set_freq(CLOCK_MHZ as u8));
        // Ratio of the low to the high phase: 1 in standard mode, 2 in fast mode (RM0090 27.6.8). The rise time of a line
        // is at most 1000 ns or 300 ns. The bus runs at 83 and 378 kHz. From 88 to 100 kHz the chip may send a repeated
        // start too early (ES0206), and the internal oscillator, from which the clock comes, may be 4 % too fast.
        let (mode, ticks, rise) = if self.fast {
            (FS::FAST, CLOCK_MHZ * 10 / 12 + 2, CLOCK_MHZ * 3 / 10)
        } else {
            (FS::STANDARD, CLOCK_MHZ * 6, CLOCK_MHZ)
        };
        registers.ccr().write(|w| {
            w.set_f_s(mode);
            w.set_duty(Duty::DUTY2_1);
            w.set_ccr(ticks);
        });
        registers.trise().write(|w| w.set_trise(rise as u8 + 1));
        registers.cr1().write(|w| w.set_pe(true));
        self.set = self.fast;
    }

    async fn idle(&mut self) {
        while self.registers.cr1().read().stop() {
            Timer::after_micros(STOP_MICROS).await;
        }
        // A low line sets BUSY, also while no transfer runs. Only a stop condition or a reset clears BUSY, and a start waits for
        // it (RM0090 27.6.1, 27.6.7). The hub is the only controller of the bus, so BUSY is wrong here.
        if self.set != self.fast || self.registers.sr2().read().busy() {
            self.reset();
        }
    }

    async fn write(&mut self, address: u8, bytes: &[u8], read_follows: bool) -> Result<(), Error> {
        self.address(address << 1).await?;
        self.clear_addr();
        for byte in bytes {
            self.wait(Sr1::txe, true, Error::NoData).await?;
            self.registers.dr().write(|w| w.set_dr(*byte));
        }
        if !bytes.is_empty() {
            self.wait(Sr1::btf, false, Error::NoData).await?;
        }
        if !read_follows {
            self.stop();
        }
        Ok(())
    }

    /// The acknowledgement of a byte is decided before the byte ends, so the end of a read depends on its length (RM0090 27.3.3,
    /// master receiver).
    async fn read(&mut self, address: u8, into: &mut [u8]) -> Result<(), Error> {
        let registers = self.registers;
        self.address(address << 1 | 1).await?;
        match into {
            [] => {
                self.clear_addr();
                self.stop();
            }
            [only] => {
                // The stop must be requested before the byte has ended.
                cortex_m::interrupt::free(|_| {
                    registers.cr1().modify(|w| w.set_ack(false));
                    self.clear_addr();
                    self.stop();
                });
                *only = self.next_byte().await?;
            }
            [first, second] => {
                // With POS set, the bit ACK applies to the next byte.
                cortex_m::interrupt::free(|_| {
                    registers.cr1().modify(|w| w.set_pos(Pos::NEXT));
                    self.clear_addr();
                    registers.cr1().modify(|w| w.set_ack(false));
                });
                self.wait(Sr1::btf, false, Error::NoData).await?;
                self.stop();
                *first = registers.dr().read().dr();
                *second = registers.dr().read().dr();
            }
            [early @ .., third_last, second_last, last] => {
                self.clear_addr();
                for byte in early {
                    *byte = self.next_byte().await?;
                }
                // Two received bytes wait in the controller, which holds SCL low.
                self.wait(Sr1::btf, false, Error::NoData).await?;
                cortex_m::interrupt::free(|_| {
                    registers.cr1().modify(|w| w.set_ack(false));
                    *third_last = registers.dr().read().dr();
                    self.stop();
                });
                *second_last = registers.dr().read().dr();
                *last = self.next_byte().await?;
            }
        }
        Ok(())
    }
}
