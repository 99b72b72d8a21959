//! The end of a transmission of the host's lines and of the chain line. The USARTs of this chip do not switch an RS-485 transceiver,
//! so the same handler releases the chain line: PC12 is high while this hub sends.
//!
//! At the end of a transmission, embassy's handler reads the status register and writes it back to clear the flag TC.
//! If a byte arrives between the read and the write, the write clears its flag RXNE, and the byte is never read.
//! Therefore the handlers of this module run before embassy's handler. They disable the interrupt of TC, and wake the
//! sender. The next byte that is sent clears TC (RM0090 30.6.1, TC).

use core::marker::PhantomData;
use embassy_stm32::interrupt::typelevel::{self, Handler};
use embassy_stm32::pac::{self, usart::Usart};
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
                    if end(pac::$usart) {
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

/// Disables the interrupt of TC at the end of a transmission. True if this is the end.
fn end(usart: Usart) -> bool {
    let ended = usart.cr1().read().tcie() && usart.sr().read().tc();
    if ended {
        usart.cr1().modify(|w| w.set_tcie(false));
    }
    ended
}
