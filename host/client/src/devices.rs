//! Commands to the servos, digital pins, analog inputs and I2C buses of a hub.
//!
//! A hub refuses requests to devices that it does not have (NACK 253). When a host is silent for 2.5 s, the hub ends
//! the pulses of all servos and releases all digital outputs.
//!
//! ```
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::motor_hub::protocol::payload::WordFrom;
//! use motor_hub_client::motor_hub::protocol::pins::{Pin, ServoOutput};
//! use motor_hub_client::{Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! let mut session = Session::new(MemoryHub::default(), Address::DEFAULT, Duration::from_secs(1));
//! let servo = ServoOutput::new(2).expect("0 to 5");
//! session.set_servo_width(servo, WordFrom::new(1_500).expect("at least 1"))?;
//! assert_eq!(session.servo(servo)?.width_us, 1_500);
//!
//! let pin = Pin::new(7).expect("0 to 7");
//! session.drive_pin(pin, true)?;
//! assert_eq!(session.read_pin(pin).unwrap_err().to_string(), "the hub refuses to read digital pin 7: digital pin 7 is not an input (NACK 27)");
//! # Ok::<(), motor_hub_client::Error>(())
//! ```

use crate::clock::Instant;
use crate::error::{none_if_unsupported, or_reason};
use crate::{Error, Session};
use motor_hub::board::{DIGITAL_PINS, Equipment, SERVOS};
use motor_hub::extension::HubFunction;
use motor_hub::protocol::Nack;
use motor_hub::protocol::answers::{I2cRead, I2cStatus, I2cWritten};
use motor_hub::protocol::payload::{Text, WordFrom};
use motor_hub::protocol::pins::{I2cAddress, I2cBus, I2cCount, Pin, ServoOutput, ToPin};
use motor_hub::protocol::requests::{AdcChannel, BATTERY, RAIL, TEMPERATURE, ToHub};
use serde::Serialize;
use std::time::Duration;

/// Time-out of an I2C transfer. A hub of this project ends every transfer within 50 ms.
const TRANSFER: Duration = Duration::from_millis(500);

/// Lowest and highest address of a device on an I2C bus; the others are reserved.
pub const I2C_ADDRESSES: (u8, u8) = (0x08, 0x77);

/// A channel of the hub's ADC.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Number of the channel.
    pub number: AdcChannel,
    /// Name for display.
    pub name: &'static str,
    /// Key in JSON documents, with the unit.
    pub key: &'static str,
    /// Unit of the value.
    pub unit: &'static str,
    /// Factor that converts the number that the hub reports to `unit`.
    pub scale: f64,
}

/// Returns the channels of the analog inputs, of the currents of pins, I2C buses and servos, of the supplies and of the
/// temperature.
pub fn channels() -> impl Iterator<Item = Channel> {
    let channels = [
        (0, "analog input 0", "input_0_v", "V", 1e-3),
        (1, "analog input 1", "input_1_v", "V", 1e-3),
        (2, "analog input 2", "input_2_v", "V", 1e-3),
        (3, "analog input 3", "input_3_v", "V", 1e-3),
        (4, "current of digital pins", "digital_a", "A", 1e-3),
        (5, "current of I2C buses", "i2c_a", "A", 1e-3),
        (6, "current of servos", "servos_a", "A", 1e-3),
        (RAIL.get(), "5 V rail", "rail_v", "V", 1e-3),
        (BATTERY.get(), "battery", "battery_v", "V", 1e-3),
        (TEMPERATURE.get(), "temperature", "temperature_c", "\u{b0}C", 0.1),
    ];
    channels.into_iter().filter_map(|(number, name, key, unit, scale)| {
        Some(Channel { number: AdcChannel::new(number)?, name, key, unit, scale })
    })
}

/// The pulses of a servo output are longer than the time between their starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a pulse of {width_us} us is longer than its period of {period_us} us; allowed are 1 to {period_us} us"
)]
pub struct PulseTooLong {
    /// Length of the pulses in microseconds.
    pub width_us: u16,
    /// Time between the starts of two pulses, in microseconds.
    pub period_us: u16,
}

/// Checks that pulses are not longer than their period, both in microseconds.
///
/// # Errors
/// The pulses are longer.
pub const fn check_pulse(width_us: u16, period_us: u16) -> Result<(), PulseTooLong> {
    if width_us > period_us { Err(PulseTooLong { width_us, period_us }) } else { Ok(()) }
}

/// Settings of a servo output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Servo {
    /// Time between the starts of two pulses, in microseconds.
    pub period_us: u16,
    /// Length of the pulses in microseconds; 0 until a host has set the length.
    pub width_us: u16,
    /// True if the output is enabled, so that it has pulses.
    pub enabled: bool,
}

/// Outputs that a former host has left on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftOutputs {
    /// Servo outputs that had pulses.
    pub servos: Vec<ServoOutput>,
    /// Digital pins that were outputs. The hub does not report whether it still drove them.
    pub pins: Vec<Pin>,
}

impl Session {
    /// Ends the pulses of servos and makes digital outputs inputs, if a former host has left them on, and returns them.
    /// Without this call the outputs would stay on, because every packet resets the hub's keep-alive:
    /// see [`disable_left_enabled`](Self::disable_left_enabled). The keep-alive releases a digital output, but leaves its
    /// direction: the function returns this pin too.
    pub fn end_left_outputs(&mut self) -> Result<LeftOutputs, Error> {
        let mut left = LeftOutputs::default();
        for servo in (0..SERVOS as u8).filter_map(ServoOutput::new) {
            // A hub with fewer servos refuses the request.
            let Some(enabled) = none_if_unsupported(self.servo_enabled(servo))? else { break };
            if enabled {
                self.enable_servo(servo, false)?;
                left.servos.push(servo);
            }
        }
        for pin in (0..DIGITAL_PINS as u8).filter_map(Pin::new) {
            // A hub refuses the request for a pin that it does not have, and may have the next one.
            if none_if_unsupported(self.is_output(pin))? == Some(true) {
                self.release_pin(pin)?;
                left.pins.push(pin);
            }
        }
        Ok(left)
    }

    /// Numbers of servos, pins, analog inputs and I2C buses of the hub; `None` if the hub does not report them (another
    /// maker's, or older firmware).
    pub fn equipment(&mut self) -> Result<Option<Equipment>, Error> {
        none_if_unsupported(self.request(HubFunction::Equipment))
    }

    /// Settings of a servo output.
    pub fn servo(&mut self, servo: ServoOutput) -> Result<Servo, Error> {
        Ok(Servo {
            period_us: self.request(ToPin::ServoPeriod { servo })?,
            width_us: self.request(ToPin::ServoWidth { servo })?,
            enabled: self.servo_enabled(servo)?,
        })
    }

    /// True if a servo output is enabled, so that it has pulses.
    pub fn servo_enabled(&mut self, servo: ServoOutput) -> Result<bool, Error> {
        self.request(ToPin::ServoEnable { servo })
    }

    /// Sets the time between the starts of two pulses, in microseconds.
    pub fn set_servo_period(&mut self, servo: ServoOutput, period: WordFrom<2>) -> Result<(), Error> {
        self.command(ToPin::SetServoPeriod { servo, period })
    }

    /// Sets the length of the pulses in microseconds.
    pub fn set_servo_width(&mut self, servo: ServoOutput, width: WordFrom<1>) -> Result<(), Error> {
        self.command(ToPin::SetServoWidth { servo, width })
    }

    /// Starts or ends the pulses of a servo output.
    pub fn enable_servo(&mut self, servo: ServoOutput, on: bool) -> Result<(), Error> {
        self.command(ToPin::SetServoEnable { servo, on })
    }

    /// Makes a digital pin an output with this level.
    pub fn drive_pin(&mut self, pin: Pin, high: bool) -> Result<(), Error> {
        self.command(ToPin::SetDirection { pin, output: true })?;
        self.command(ToPin::SetOutput { pin, high })
    }

    /// Makes a digital pin an input with a pull-up.
    pub fn release_pin(&mut self, pin: Pin) -> Result<(), Error> {
        self.command(ToPin::SetDirection { pin, output: false })
    }

    /// True if a digital pin is an output.
    pub fn is_output(&mut self, pin: Pin) -> Result<bool, Error> {
        self.request(ToPin::Direction { pin })
    }

    /// Level of a digital input: true for high.
    pub fn read_pin(&mut self, pin: Pin) -> Result<bool, Error> {
        self.request(ToPin::Input { pin })
    }

    /// Value of an ADC channel in millivolts, milliamperes or 0.1 degrees Celsius; with `raw`, the converter's reading.
    pub fn adc(&mut self, channel: AdcChannel, raw: bool) -> Result<i16, Error> {
        self.request(ToHub::Adc { channel, raw })
    }

    /// Value of an ADC channel in its unit. The inner error is the hub's reason for a refusal.
    pub fn measured(&mut self, channel: Channel) -> Result<Result<f64, String>, Error> {
        Ok(or_reason(self.adc(channel.number, false))?.map(|value| f64::from(value) * channel.scale))
    }

    /// Sets the speed of an I2C bus: 400 kbit/s if `fast`, otherwise 100 kbit/s.
    pub fn set_i2c_speed(&mut self, bus: I2cBus, fast: bool) -> Result<(), Error> {
        self.command(ToPin::SetI2cSpeed { bus, fast })
    }

    /// Reads `count` bytes from a device; with `register`, writes the number of the register first. The status of the
    /// result says whether the transfer had an error.
    pub fn read_i2c(
        &mut self,
        bus: I2cBus,
        address: I2cAddress,
        register: Option<u8>,
        count: I2cCount,
    ) -> Result<I2cRead, Error> {
        let start = match register {
            Some(register) => ToPin::ReadI2cRegister { bus, address, count, register },
            None => ToPin::ReadI2c { bus, address, count },
        };
        self.transfer(start, |session| session.request(ToPin::PollI2cRead { bus }))
    }

    /// Reads one byte from a device. The result is `Ok(true)` if the device acknowledges its address, and `Ok(false)`
    /// if no device acknowledges. The inner error is a text that says why the read failed for another reason.
    pub fn finds_i2c(&mut self, bus: I2cBus, address: I2cAddress) -> Result<Result<bool, String>, Error> {
        let Some(one) = I2cCount::new(1) else { return Ok(Ok(false)) };
        Ok(or_reason(self.read_i2c(bus, address, None, one))?.and_then(|read| match read.status {
            I2cStatus::NO_ADDRESS => Ok(false),
            status => status.error().map_or(Ok(true), |error| Err(error.to_owned())),
        }))
    }

    /// Writes 1 to 100 bytes to a device. The status of the result says whether the transfer had an error.
    ///
    /// # Errors
    /// [`Error::Unconfirmed`] if the hub does not acknowledge the request. The device may have got the bytes.
    pub fn write_i2c(&mut self, bus: I2cBus, address: I2cAddress, bytes: Text) -> Result<I2cWritten, Error> {
        let start = ToPin::WriteI2c { bus, address, bytes };
        self.transfer(start, |session| session.request(ToPin::PollI2cWrite { bus }))
    }

    /// Starts a transfer, and polls its result. The start is repeated while the bus is busy with another transfer, and
    /// the poll is repeated while the transfer runs. Start and poll together last [`TRANSFER`] at most.
    fn transfer<T>(
        &mut self,
        start: ToPin,
        poll: impl Fn(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let end = Instant::now() + TRANSFER;
        let runs = |error: &Error| {
            let busy = [Nack::I2C_BUSY, Nack::I2C_RUNNING];
            matches!(error, Error::Refused { reason, .. } if busy.contains(reason)) && Instant::now() < end
        };
        loop {
            match self.command(start.clone()) {
                Err(error) if runs(&error) => (),
                started => break started?,
            }
        }
        loop {
            match poll(self) {
                Err(error) if runs(&error) => (),
                polled => return polled,
            }
        }
    }
}
