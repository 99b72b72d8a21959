//! The end of a transmission of the host's lines and of the chain line. The USARTs of this chip do not switch an RS-485 transceiver,
//! so the same handler releases the chain line: PC12 is high while this hub sends.
//!
//! At the end of a transmission, embassy's handler reads the status register and writes it back to clear the flag TC.
//! If a byte arrives between the read and the write, the write clears its flag RXNE, and the byte is never read.
//! Therefore the handlers of this module run before embassy's handler. They disable the interrupt of TC, and wake the
//! sender. The next byte that is sent clears TC (RM0090 30.6.1, TC).

use core::marker::PhantomData;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::NVIC;
use embassy_stm32::interrupt::typelevel::{self, Handler};
use embassy_stm32::pac::{self, Interrupt, usart::Usart};
use motor_hub_stm32::serial::TransmissionEnd;
use motor_hub_stm32::supply::Watcher;

/// The handler of a line, which is named by its interrupt.
pub(crate) struct End<I>(PhantomData<I>);

macro_rules! lines {
    ($($name:ident: $usart:ident, $begin:path, $released:path;)+) => {
        $(
            /// The end of this line's transmissions.
            pub(crate) const $name: TransmissionEnd = {
                static WATCHER: Watcher = Watcher::new();
                TransmissionEnd { begin: $begin, watcher: &WATCHER, ended: || ended(pac::$usart) }
            };

            impl Handler<typelevel::$usart> for End<typelevel::$usart> {
                #[allow(unsafe_code, reason = "embassy asks for an unsafe fn; nothing in it is")]
                unsafe fn on_interrupt() {
                    static TX_IS_EMPTY: AtomicBool = AtomicBool::new(false);
                    if end(pac::$usart, Interrupt::$usart, &TX_IS_EMPTY) {
                        $released();
                        $name.watcher.wake();
                    }
                }
            }
        )+
    };
}

lines! {
    ST_LINK: USART3, nothing, nothing;
    ADAPTER: USART6, nothing, nothing;
    CHAIN: UART4, drive_chain, release_chain;
}

/// Does nothing, because the lines of hosts have no transceiver.
fn nothing() {}

/// Sets PC12, the transceiver's DE and RE. The transceiver drives the line after 0.1 us, which is short against a start
/// bit of 2.2 us.
fn drive_chain() {
    pac::GPIOC.bsrr().write(|w| w.set_bs(DIRECTION, true));
}

/// Clears PC12 when the last stop bit has left.
fn release_chain() {
    pac::GPIOC.bsrr().write(|w| w.set_br(DIRECTION, true));
}

/// The pin of port C that switches the transceiver.
const DIRECTION: usize = 12;

/// Returns true if nothing is being sent. Embassy enables TXE or TC as an interrupt while it sends.
fn ended(usart: Usart) -> bool {
    let control = usart.cr1().read();
    !control.txeie() && !control.tcie()
}

/// True once at the end of a transmission.
///
/// TC is set when the USART has no more byte to send. Embassy enables its interrupt for the last byte, but also for a byte at the
/// end of embassy's ring buffer, behind which further bytes may wait at the beginning of the buffer. If the next byte is late,
/// TC is then set in the middle of a transmission. So this function disables the interrupt of TC, and requests another
/// interrupt. Meanwhile embassy's handler sends the next byte, if there is one. `is_empty` keeps that TC was set.
fn end(usart: Usart, interrupt: Interrupt, is_empty: &AtomicBool) -> bool {
    if usart.cr1().read().tcie() && usart.sr().read().tc() {
        usart.cr1().modify(|w| w.set_tcie(false));
        is_empty.store(true, Ordering::Relaxed);
        NVIC::pend(interrupt);
        return false;
    }
    is_empty.swap(false, Ordering::Relaxed) && ended(usart)
}
