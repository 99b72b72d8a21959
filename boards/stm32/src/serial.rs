//! The host link's line: a USART with a buffer each way.
//!
//! Bytes are received by interrupt, not by a circular DMA stream. After a line error embassy restarts the stream at the start
//! of its buffer, but goes on reading at the old place. Old packets would then be executed again. At 460 800 baud there is at
//! most one short interrupt every 22 us.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::interrupt::typelevel::Binding;
use embassy_stm32::usart::{
    BufferedInterruptHandler, BufferedUart, BufferedUartRx, BufferedUartTx, Config, ConfigError, Error,
    Instance, RxPin, TxPin,
};
use embedded_io_async::{ErrorType, Write};
use motor_hub::protocol::BAUD;

/// Several of the longest requests that hosts send (112 bytes).
const RECEIVED: usize = 512;

/// Every answer of REV's protocol fits, and leaves in one burst. This hub's own reports leave in two.
const SENT: usize = 128;

/// Bytes that have not been read or sent yet.
pub struct Buffers {
    received: [u8; RECEIVED],
    sent: [u8; SENT],
}

impl Buffers {
    /// Empty.
    pub const fn new() -> Self {
        Self { received: [0; RECEIVED], sent: [0; SENT] }
    }
}

impl Default for Buffers {
    fn default() -> Self {
        Self::new()
    }
}

/// 460 800 baud, 8 data bits, no parity, one stop bit; RX pulled up.
///
/// # Errors
/// If the clocks cannot make that speed.
pub fn open<T: Instance>(
    usart: Peri<'static, T>,
    tx: Peri<'static, impl TxPin<T>>,
    rx: Peri<'static, impl RxPin<T>>,
    irqs: impl Binding<T::Interrupt, BufferedInterruptHandler<T>> + 'static,
    buffers: &'static mut Buffers,
) -> Result<(Sender, BufferedUartRx<'static>), ConfigError> {
    let mut config = Config::default();
    config.baudrate = BAUD;
    // Without power the ST-LINK does not drive the line, which must then be idle, not noise.
    config.rx_pull = Pull::Up;
    let line = BufferedUart::new(usart, rx, tx, &mut buffers.sent, &mut buffers.received, irqs, config)?;
    let (sender, receiver) = line.split();
    Ok((Sender(sender), receiver))
}

/// The line's sending half. A write to embassy's half that is longer than its buffer is refused, and each later flush waits
/// without end. A write that does not fit yet waits without being woken. So a write here is at most the buffer, and waits until
/// the buffer is empty.
pub struct Sender(BufferedUartTx<'static>);

impl ErrorType for Sender {
    type Error = Error;
}

impl Write for Sender {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        Write::flush(&mut self.0).await?;
        Write::write(&mut self.0, bytes.get(..SENT).unwrap_or(bytes)).await
    }

    async fn flush(&mut self) -> Result<(), Error> {
        Write::flush(&mut self.0).await
    }
}
