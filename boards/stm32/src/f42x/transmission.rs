//! The end of a transmission of the host's lines and of the chain line. The USARTs of this chip do not switch an RS-485 transceiver,
//! so the same handler releases the chain line.
//!
//! At the end of a transmission, embassy's handler reads the status register and writes it back to clear the flag TC.
//! If a byte arrives between the read and the write, the write clears its flag RXNE, and the byte is never read.
//! Therefore the handlers of [`transmission_ends!`](crate::transmission_ends) run before embassy's handler. They disable the interrupt of TC, and wake the
//! sender. The next byte that is sent clears TC (RM0090 30.6.1, TC).

use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::NVIC;
use embassy_stm32::pac::{Interrupt, usart::Usart};

/// Defines `TransmissionHandler`, the handler of the end of transmissions, and a [`TransmissionEnd`](crate::serial::TransmissionEnd)
/// of each line. A row has the name of the line and its USART. A line with a transceiver also has the port and the number
/// of the pin that is the transceiver's DE and RE. `bind_interrupts!` must name the handler before embassy's handler.
#[macro_export]
macro_rules! transmission_ends {
    ($($name:ident: $usart:ident $(, $port:ident $pin:literal)?;)+) => {
        /// The handler of a line, which is named by its interrupt.
        struct TransmissionHandler<I>(::core::marker::PhantomData<I>);

        $(
            /// The end of this line's transmissions.
            const $name: $crate::serial::TransmissionEnd = {
                static WAITER: $crate::supply::InterruptWaiter = $crate::supply::InterruptWaiter::new();
                $crate::serial::TransmissionEnd {
                    // The transceiver drives the line after 0.1 us, which is short against a start bit of 2.2 us.
                    begin: || {
                        $(::embassy_stm32::pac::$port.bsrr().write(|w| w.set_bs($pin, true));)?
                    },
                    waiter: &WAITER,
                    is_idle: || $crate::chip::transmission::is_idle(::embassy_stm32::pac::$usart),
                }
            };

            impl ::embassy_stm32::interrupt::typelevel::Handler<::embassy_stm32::interrupt::typelevel::$usart>
                for TransmissionHandler<::embassy_stm32::interrupt::typelevel::$usart>
            {
                #[allow(unsafe_code, reason = "embassy asks for an unsafe fn; nothing in it is")]
                unsafe fn on_interrupt() {
                    static TX_IS_EMPTY: ::core::sync::atomic::AtomicBool =
                        ::core::sync::atomic::AtomicBool::new(false);
                    if $crate::chip::transmission::finish_if_complete(
                        ::embassy_stm32::pac::$usart,
                        ::embassy_stm32::pac::Interrupt::$usart,
                        &TX_IS_EMPTY,
                    ) {
                        // The last stop bit has left.
                        $(::embassy_stm32::pac::$port.bsrr().write(|w| w.set_br($pin, true));)?
                        $name.waiter.wake();
                    }
                }
            }
        )+
    };
}

/// Returns true if nothing is being sent. Embassy enables TXE or TC as an interrupt while it sends.
pub fn is_idle(usart: Usart) -> bool {
    let control = usart.cr1().read();
    !control.txeie() && !control.tcie()
}

/// True once at the end of a transmission.
///
/// TC is set when the USART has no more byte to send. Embassy enables its interrupt for the last byte, but also for a byte at the
/// end of embassy's ring buffer, behind which further bytes may wait at the beginning of the buffer. If the next byte is late,
/// TC is then set in the middle of a transmission. So this function disables the interrupt of TC, and requests another
/// interrupt. Meanwhile embassy's handler sends the next byte, if there is one. `is_empty` keeps that TC was set.
pub fn finish_if_complete(usart: Usart, interrupt: Interrupt, is_empty: &AtomicBool) -> bool {
    if usart.cr1().read().tcie() && usart.sr().read().tc() {
        usart.cr1().modify(|w| w.set_tcie(false));
        is_empty.store(true, Ordering::Relaxed);
        NVIC::pend(interrupt);
        return false;
    }
    is_empty.swap(false, Ordering::Relaxed) && is_idle(usart)
}
