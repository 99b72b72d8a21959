//! The end of a transmission of the host's lines and of the chain line. The USARTs of this chip do not switch an RS-485 transceiver,
//! so the same handler releases the chain line.
//!
//! At the end of a transmission, embassy's handler reads the status register and writes it back to clear the flag TC.
//! If a byte arrives between the read and the write, the write clears its flag RXNE, and the byte is never read.
//! Therefore the handlers of [`transmission_ends!`](crate::transmission_ends) run before embassy's handler. They disable the interrupt of TC, and wake the
//! sender. The next byte that is sent clears TC (RM0090 30.6.1, TC).

use embassy_stm32::pac::usart::Usart;

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
                    if $crate::chip::transmission::finish_if_complete(::embassy_stm32::pac::$usart) {
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

/// Disables the interrupt of TC at the end of a transmission. True if this is the end.
pub fn finish_if_complete(usart: Usart) -> bool {
    let is_complete = usart.cr1().read().tcie() && usart.sr().read().tc();
    if is_complete {
        usart.cr1().modify(|w| w.set_tcie(false));
    }
    is_complete
}
