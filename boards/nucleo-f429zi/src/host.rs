//! The line to the host and the status LED on this board: USART3, which the ST-LINK shows to the computer as a serial
//! port, and the three lamps that show the state of the conversation.
//!
//! Bytes are received by interrupt, not by a circular DMA stream: after a line error embassy restarts
//! the stream at the start of its buffer while reading goes on where it was, and old packets are
//! executed again. At 460 800 baud that is at most one short interrupt every 22 us.

use embassy_stm32::gpio::{Level, Output};
use embassy_stm32::peripherals::{PD8, PD9, USART3};
use embassy_stm32::usart::{
    BufferedInterruptHandler, BufferedUart, BufferedUartRx, BufferedUartTx, Config, ConfigError,
};
use embassy_stm32::{Peri, bind_interrupts};
use motor_hub::protocol::{BAUD, Colour};
use static_cell::StaticCell;

bind_interrupts!(struct Irqs {
    USART3 => BufferedInterruptHandler<USART3>;
});

/// Several of the longest requests that hosts send (112 bytes).
const RECEIVED: usize = 512;

/// The longest reply fits, so that it leaves in one burst.
const SENT: usize = 128;

/// USART3 at 460 800 baud, 8 data bits, no parity, one stop bit.
///
/// # Errors
/// If the clocks cannot make that speed.
pub(crate) fn serial(
    usart: Peri<'static, USART3>,
    tx: Peri<'static, PD8>,
    rx: Peri<'static, PD9>,
) -> Result<(BufferedUartTx<'static>, BufferedUartRx<'static>), ConfigError> {
    static RX: StaticCell<[u8; RECEIVED]> = StaticCell::new();
    static TX: StaticCell<[u8; SENT]> = StaticCell::new();
    let mut config = Config::default();
    config.baudrate = BAUD;
    let buffers = (TX.init([0; SENT]), RX.init([0; RECEIVED]));
    Ok(BufferedUart::new(usart, rx, tx, buffers.0, buffers.1, Irqs, config)?.split())
}

/// LD1 green, LD2 blue and LD3 red: together one lamp of eight colours.
pub(crate) struct Lamp {
    pub(crate) red: Output<'static>,
    pub(crate) green: Output<'static>,
    pub(crate) blue: Output<'static>,
}

impl Lamp {
    /// Each of the three is lit if its share of the colour is a quarter or more: orange is red and green.
    pub(crate) fn show(&mut self, colour: Colour) {
        let level = |share: u8| if share >= 64 { Level::High } else { Level::Low };
        self.red.set_level(level(colour.red));
        self.green.set_level(level(colour.green));
        self.blue.set_level(level(colour.blue));
    }
}
