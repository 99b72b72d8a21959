//! Serial lines: a USART each, with a buffer each way. The host link has one or two lines, and the chain of hubs has a line of its
//! own, behind an RS-485 transceiver.
//!
//! A hub with two lines to hosts has one host, on the line from which the first whole packet has come. The other line is then
//! ignored until the next start of the hub.
//!
//! Bytes are received by interrupt, not by a circular DMA stream. After a line error embassy restarts the stream at the start
//! of its buffer, but goes on reading at the old place. Old packets would then be executed again. At 460 800 baud there is at
//! most one short interrupt every 22 us.

use crate::supply::InterruptWaiter;
use core::sync::atomic::{AtomicU8, Ordering};
use embassy_futures::select::{Either, select};
use embassy_stm32::Peri;
use embassy_stm32::gpio::{Flex, Pin, Pull};
use embassy_stm32::interrupt::typelevel::Binding;
use embassy_stm32::usart::{
    BufferedInterruptHandler, BufferedUart, BufferedUartRx, BufferedUartTx, Config, ConfigError, Error,
    Instance, RxPin, TxPin,
};
use embassy_time::{Duration, Instant, block_for};
use embedded_io_async::{ErrorType, Read, Write};
use motor_hub::protocol::frame::{self, Frame};
use motor_hub::protocol::{BAUD, Decoder};
use motor_hub::units::Micros;

/// Size of the buffer for received bytes. The buffer holds several of the longest requests that hosts send (112 bytes).
const RECEIVED: usize = 512;

/// Size of the buffer for bytes to send. Every answer of REV's protocol fits. The longest reports of this hub's own interface
/// are sent in two parts.
const SENT: usize = 128;

/// Bytes after which the reader is woken while a line is busy. Without this number the reader would be woken when the line falls
/// idle, or when half the buffer is full. The first of eight requests without a pause would then be answered after the last one.
const RX_WAKE_BYTES: usize = 16;

/// Buffers of a line for bytes that have not been read or sent yet.
pub struct Buffers {
    received: [u8; RECEIVED],
    sent: [u8; SENT],
    /// Looks for the first packet on the line.
    decoder: Decoder,
}

impl Buffers {
    /// Empty buffers.
    pub const EMPTY: Self = Self { received: [0; RECEIVED], sent: [0; SENT], decoder: Decoder::new() };
}

/// A line: its sending and its receiving half.
pub type Line = (Sender, Receiver);

/// Opens a line of 460 800 baud, 8 data bits, no parity and one stop bit, with RX pulled up. `end` gives the way to
/// wait for the end of a transmission on boards where embassy's flush does not work. `None` selects embassy's flush.
///
/// # Errors
/// Returns an error if the clocks cannot make this speed.
pub fn open<T: Instance>(
    usart: Peri<'static, T>,
    tx: Peri<'static, impl TxPin<T>>,
    rx: Peri<'static, impl RxPin<T>>,
    irqs: impl Binding<T::Interrupt, BufferedInterruptHandler<T>> + 'static,
    buffers: &'static mut Buffers,
    end: Option<TransmissionEnd>,
) -> Result<Line, ConfigError> {
    let Buffers { received, sent, decoder } = buffers;
    let (sender, receiver) = BufferedUart::new(usart, rx, tx, sent, received, irqs, config())?.split();
    Ok((Sender { line: sender, end }, Receiver { line: receiver, decoder }))
}

/// Opens a line like [`open`]. The USART itself switches the line's transceiver to sending, by its pin DE: for each transmission,
/// and one bit longer at both ends.
///
/// # Errors
/// Returns an error if the clocks cannot make this speed.
#[cfg(feature = "h74x")]
pub fn open_with_driver_enable<T: Instance>(
    usart: Peri<'static, T>,
    tx: Peri<'static, impl TxPin<T>>,
    rx: Peri<'static, impl RxPin<T>>,
    de: Peri<'static, impl embassy_stm32::usart::DePin<T>>,
    irqs: impl Binding<T::Interrupt, BufferedInterruptHandler<T>> + 'static,
    buffers: &'static mut Buffers,
) -> Result<Line, ConfigError> {
    let mut config = config();
    // Both times are in sixteenths of a bit. The HAL uses the first time for both.
    config.de_assertion_time = 16;
    config.de_deassertion_time = 16;
    let Buffers { received, sent, decoder } = buffers;
    let (sender, receiver) =
        BufferedUart::new_with_de(usart, rx, tx, de, irqs, sent, received, config)?.split();
    Ok((Sender { line: sender, end: None }, Receiver { line: receiver, decoder }))
}

fn config() -> Config {
    let mut config = Config::default();
    config.baudrate = BAUD;
    // An ST-LINK without power does not drive the line, nor does a transceiver while it sends. The line must then read as idle.
    config.rx_pull = Pull::Up;
    config.eager_reads = Some(RX_WAKE_BYTES);
    config
}

/// Time after which a pull-down has discharged an open pin with its wire: 40 kohm and 100 pF need 4 us.
const DISCHARGE: Duration = Duration::from_micros(20);

/// Time of five bytes, each of which has a stop bit.
const FIVE_BYTES: Duration = Duration::from_micros(110);

/// Returns true if a transceiver drives the pin RX of the chain line. An idle line is high, and a busy line is high at each stop bit.
/// Without a transceiver the pin's pull-down keeps the pin low.
pub fn has_transceiver(rx: Peri<'_, impl Pin>) -> bool {
    let mut rx = Flex::new(rx);
    rx.set_as_input(Pull::Down);
    block_for(DISCHARGE);
    let end = Instant::now() + FIVE_BYTES;
    while rx.is_low() {
        if Instant::now() > end {
            return false;
        }
    }
    true
}

/// The line's receiving half.
pub struct Receiver {
    line: BufferedUartRx<'static>,
    decoder: &'static mut Decoder,
}

impl ErrorType for Receiver {
    type Error = Error;
}

impl Read for Receiver {
    async fn read(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        Read::read(&mut self.line, into).await
    }
}

/// The line's sending half. Embassy's half refuses a write that is longer than its buffer, and each later flush then
/// waits without end. A write that does not fit into the free part of the buffer waits and is never woken. Therefore a
/// write of this half is at most as long as the buffer, and waits until the buffer is empty.
pub struct Sender {
    line: BufferedUartTx<'static>,
    end: Option<TransmissionEnd>,
}

/// How a board switches a transceiver, and waits for the end of a transmission, where embassy's flush cannot be used.
#[derive(Clone, Copy)]
pub struct TransmissionEnd {
    /// Called before each transmission. Switches the line's transceiver to sending, if there is one.
    pub begin: fn(),
    /// Woken at the end of each transmission.
    pub waiter: &'static InterruptWaiter,
    /// True if nothing is being sent.
    pub is_idle: fn() -> bool,
}

impl ErrorType for Sender {
    type Error = Error;
}

impl Write for Sender {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.flush().await?;
        if let Some(TransmissionEnd { begin, .. }) = self.end {
            begin();
        }
        Write::write(&mut self.line, bytes.get(..SENT).unwrap_or(bytes)).await
    }

    async fn flush(&mut self) -> Result<(), Error> {
        match self.end {
            None => Write::flush(&mut self.line).await,
            Some(TransmissionEnd { waiter, is_idle, .. }) => {
                waiter.wait(is_idle, || ()).await;
                Ok(())
            }
        }
    }
}

/// The line of the host: [`UNDECIDED`], 0 or 1. There is one host link in a program.
static HOST: AtomicU8 = AtomicU8::new(UNDECIDED);
const UNDECIDED: u8 = 2;

/// Makes one host link of one or two lines.
pub fn host_link((sender, receiver): Line, second: Option<Line>) -> (HostSender, HostReceiver) {
    let (second_sender, second_receiver) = second.unzip();
    let receiver = HostReceiver { first: receiver, second: second_receiver, packet: Frame::new() };
    (HostSender { first: sender, second: second_sender }, receiver)
}

/// The host link's receiving half.
pub struct HostReceiver {
    first: Receiver,
    second: Option<Receiver>,
    /// The part of the first packet that the caller has not read yet.
    packet: Frame,
}

impl ErrorType for HostReceiver {
    type Error = Error;
}

impl Read for HostReceiver {
    async fn read(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        loop {
            if !self.packet.is_empty() {
                let count = self.packet.len().min(into.len());
                into.iter_mut().zip(self.packet.drain(..count)).for_each(|(place, byte)| *place = byte);
                return Ok(count);
            }
            let first = &mut self.first;
            let Some(second) = &mut self.second else { return first.read(into).await };
            match HOST.load(Ordering::Relaxed) {
                0 => return first.read(into).await,
                1 => return second.read(into).await,
                _ => {}
            }
            // Bytes are read one at a time, so bytes after the first packet stay in the buffer of their line.
            let (mut a, mut b) = ([0], [0]);
            let (line, decoder, byte) = match select(first.read(&mut a), second.read(&mut b)).await {
                Either::First(result) => result.map(|_| (0, &mut first.decoder, a))?,
                Either::Second(result) => result.map(|_| (1, &mut second.decoder, b))?,
            };
            let now = Micros::new(Instant::now().as_micros());
            if let Some(packet) = decoder.next(&mut &byte[..], now) {
                HOST.store(line, Ordering::Relaxed);
                // The decoder has consumed the packet's bytes. The caller gets them again.
                self.packet = frame::encode(&packet);
            }
        }
    }
}

/// The host link's sending half. Nothing is sent before the host has sent a packet.
pub struct HostSender {
    first: Sender,
    second: Option<Sender>,
}

impl HostSender {
    fn line(&mut self) -> &mut Sender {
        match &mut self.second {
            Some(second) if HOST.load(Ordering::Relaxed) == 1 => second,
            _ => &mut self.first,
        }
    }
}

impl ErrorType for HostSender {
    type Error = Error;
}

impl Write for HostSender {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.line().write(bytes).await
    }

    async fn flush(&mut self) -> Result<(), Error> {
        self.line().flush().await
    }
}
