//! An I2C bus for hosts: its lines SCL and SDA, and the controller of the chip that transfers bytes.
//!
//! The HAL's driver is not used. On the STM32F4 a transfer continues after its future is dropped. On the STM32H7 other
//! tasks cannot run while the driver waits for a busy bus, and the driver's DMA does not reach the memory that holds
//! the tasks. A [`Controller`] waits for one interrupt per byte, and never in a loop for a line.
//! [`motor_hub::tasks::i2c`] has the time-out of a transfer. A line that a device holds low is found before a transfer
//! starts.
//!
//! Resistors outside the chip pull both lines up to 3.3 V. The chip's own pull-ups are too weak for 400 kbit/s.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, AnyPin, Flex, OutputType, Pin, Speed};
use embassy_stm32::i2c::{Instance, SclPin, SdaPin};
use embassy_time::Timer;
use embedded_hal_async::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use motor_hub::board::I2cBus;

/// Half the period of a clock pulse while a bus is freed, in microseconds. The clock is then 100 kHz, at which every device works.
const HALF_PULSE_US: u64 = 5;

/// Clock pulses after which a device that was cut off in the middle of a byte has released SDA (NXP UM10204, 3.1.16).
const PULSES: usize = 9;

/// Why a transfer has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// No device has this address.
    NoAddress,
    /// A device has not acknowledged a byte.
    NoData,
    /// Another controller has taken the bus.
    Arbitration,
    /// A line is held low.
    Held,
    /// The operations are not a write, a read, or a write and a read. No host requests other operations.
    Unsupported,
}

impl embedded_hal_async::i2c::Error for Error {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAddress => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            Self::NoData => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
            Self::Arbitration => ErrorKind::ArbitrationLoss,
            Self::Held => ErrorKind::Bus,
            Self::Unsupported => ErrorKind::Other,
        }
    }
}

/// The I2C controller of a chip. Addresses have 7 bits. After the future of a transfer has been dropped,
/// [`reset`](Self::reset) must be called.
#[expect(async_fn_in_trait, reason = "one executor, one core: no future has to be Send")]
pub trait Controller {
    /// Sets the speed from the next transfer on: 400 kbit/s if `fast` is true, otherwise 100 kbit/s.
    fn set_speed(&mut self, fast: bool);

    /// Ends any transfer, and releases the lines.
    fn reset(&mut self);

    /// Waits until the stop condition of the last transfer is on the lines.
    async fn idle(&mut self);

    /// Writes bytes, 255 at most. The bus stays taken if a read follows.
    async fn write(&mut self, address: u8, bytes: &[u8], read_follows: bool) -> Result<(), Error>;

    /// Reads bytes, 1 to 255, after a start condition, or after a repeated start if a write came before.
    async fn read(&mut self, address: u8, into: &mut [u8]) -> Result<(), Error>;
}

/// Defines the controllers of a chip. A row has the name of the function that makes a controller, its peripheral, and its two
/// interrupts. The chip's module has the function `handle_interrupt`, and implements [`Controller`] for the struct `Controller`.
#[cfg(any(feature = "f42x", feature = "h74x"))]
macro_rules! i2c_controllers {
    ($($new:ident: $peripheral:ident, $event:ident, $error:ident;)+) => {
        /// A controller of this chip.
        pub struct Controller {
            registers: ::embassy_stm32::pac::i2c::I2c,
            waiter: &'static InterruptWaiter,
            fast: bool,
            /// True if the registers are set for the fast speed, 400 kbit/s.
            set: bool,
        }

        /// The type of a bus with such a controller.
        pub type Bus = i2c_bus::Bus<Controller>;

        use ::embassy_stm32::interrupt;
        use ::embassy_stm32::pac::{self, Interrupt};

        $(
            /// Creates the controller of this peripheral, and starts its clock.
            pub fn $new() -> Controller {
                ::embassy_stm32::rcc::enable_and_reset::<::embassy_stm32::peripherals::$peripheral>();
                crate::supply::unmask(Interrupt::$event);
                crate::supply::unmask(Interrupt::$error);
                Controller { registers: pac::$peripheral, waiter: &$new::WAITER, fast: false, set: false }
            }

            mod $new {
                pub(super) static WAITER: super::InterruptWaiter = super::InterruptWaiter::new();
            }

            #[interrupt]
            fn $event() {
                handle_interrupt(pac::$peripheral, &$new::WAITER);
            }

            #[interrupt]
            fn $error() {
                handle_interrupt(pac::$peripheral, &$new::WAITER);
            }
        )+
    };
}

#[cfg(any(feature = "f42x", feature = "h74x"))]
pub(crate) use i2c_controllers;

/// A bus with its lines.
pub struct Bus<C> {
    controller: C,
    scl: Flex<'static>,
    sda: Flex<'static>,
    /// Numbers of the alternate function of both pins.
    functions: (u8, u8),
}

impl<C: Controller> Bus<C> {
    /// Creates the bus of peripheral `T`. The clock of its controller must run.
    pub fn new<T: Instance>(
        controller: C,
        scl: Peri<'static, impl SclPin<T>>,
        sda: Peri<'static, impl SdaPin<T>>,
    ) -> Self {
        let functions = (scl.af_num(), sda.af_num());
        let mut bus = Self { controller, scl: line(scl), sda: line(sda), functions };
        bus.connect();
        bus.controller.reset();
        bus
    }

    /// Connects the lines to the controller.
    fn connect(&mut self) {
        let open_drain = AfType::output(OutputType::OpenDrain, Speed::Medium);
        self.scl.set_as_af_unchecked(self.functions.0, open_drain);
        self.sda.set_as_af_unchecked(self.functions.1, open_drain);
    }

    fn is_line_low(&self) -> bool {
        self.scl.is_low() || self.sda.is_low()
    }

    /// Waits until the controller is idle, and checks that both lines are high.
    ///
    /// # Errors
    /// Returns [`Error::Held`] if a line is low.
    async fn check_lines(&mut self) -> Result<(), Error> {
        self.controller.idle().await;
        if self.is_line_low() {
            // After a stop condition a line needs some time to rise.
            Timer::after_micros(HALF_PULSE_US).await;
            if self.is_line_low() {
                return Err(Error::Held);
            }
        }
        Ok(())
    }
}

fn line(pin: Peri<'static, impl Pin>) -> Flex<'static> {
    let pin: Peri<'static, AnyPin> = pin.into();
    Flex::new(pin)
}

impl<C: Controller> ErrorType for Bus<C> {
    type Error = Error;
}

impl<C: Controller> I2c for Bus<C> {
    async fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Error> {
        self.check_lines().await?;
        match operations {
            [Operation::Write(bytes)] => self.controller.write(address, bytes, false).await,
            [Operation::Read(into)] => self.controller.read(address, into).await,
            [Operation::Write(bytes), Operation::Read(into)] => {
                self.controller.write(address, bytes, true).await?;
                self.controller.read(address, into).await
            }
            _ => Err(Error::Unsupported),
        }
    }
}

impl<C: Controller> I2cBus for Bus<C> {
    fn set_speed(&mut self, fast: bool) {
        self.controller.set_speed(fast);
    }

    async fn recover(&mut self) {
        self.controller.reset();
        let half_pulse = || Timer::after_micros(HALF_PULSE_US);
        self.scl.set_high();
        self.sda.set_high();
        self.scl.set_as_input_output(Speed::Medium);
        self.sda.set_as_input_output(Speed::Medium);
        half_pulse().await;
        for _ in 0..PULSES {
            if self.sda.is_high() {
                break;
            }
            self.scl.set_low();
            half_pulse().await;
            self.scl.set_high();
            half_pulse().await;
        }
        // A stop condition: SDA rises while SCL is high.
        self.scl.set_low();
        self.sda.set_low();
        half_pulse().await;
        self.scl.set_high();
        half_pulse().await;
        self.sda.set_high();
        half_pulse().await;
        self.connect();
    }
}
