//! What a hub has besides motors: servos, analog inputs, digital pins and I2C buses.
//!
//! When all motors are stopped together, the hub also ends the pulses of all servos and releases all digital outputs.
//! This happens at STOP, when the page in control is gone, and when the host is silent.

use crate::hub::{RequestError, within};
use crate::requests::DeviceRequest;
use motor_hub::board::{DIGITAL_PINS, Equipment, SERVOS};
use motor_hub::protocol::answers::I2cStatus;
use motor_hub::protocol::payload::{ByteIn, Text, WordFrom};
use motor_hub::protocol::pins::{I2cAddress, I2cBus, I2cCount, Pin, ServoOutput};
use motor_hub_client::devices::{Channel, I2C_ADDRESSES, Servo, channels, check_pulse};
use motor_hub_client::{Error, Session};
use serde::Serialize;
use serde_json::{Value, json};

/// Number of I2C addresses that a scan tries between two frames.
const ADDRESSES_A_FRAME: usize = 4;

/// Returns the equipment of a hub as JSON for pages.
pub(crate) fn has(Equipment { digital, servos, analog, i2c, .. }: Equipment) -> Value {
    let pins: Vec<u8> = (0..DIGITAL_PINS as u8).filter(|pin| digital >> pin & 1 != 0).collect();
    json!({ "servos": servos, "analog": analog, "pins": pins, "buses": i2c })
}

/// Result of a transfer on an I2C bus, or of a scan.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Transfer {
    bus: u8,
    /// `scan`, `read` or `write`.
    what: &'static str,
    /// Addresses of the devices that were found, or the bytes that were read or written.
    bytes: Vec<u8>,
    /// Why the transfer or the scan failed; `None` if it succeeded.
    why: Option<String>,
}

/// State of the devices that the server keeps.
#[derive(Debug, Default)]
pub(crate) struct Devices {
    /// Levels of digital outputs that were set since the last stop. A hub does not report them.
    levels: [Option<bool>; DIGITAL_PINS],
    scan: Option<Scan>,
}

/// A running scan of an I2C bus.
#[derive(Debug)]
struct Scan {
    bus: I2cBus,
    next: u8,
    found: Vec<u8>,
}

impl Devices {
    /// Notes that the hub has released its outputs.
    pub(crate) fn stopped(&mut self) {
        self.levels = Default::default();
    }

    /// States of the digital pins.
    pub(crate) fn pins(&self, session: &mut Session) -> Result<Vec<Value>, Error> {
        let has = session.equipment()?.unwrap_or_default();
        let mut pins = Vec::new();
        let all = (0..).filter_map(Pin::new).take(DIGITAL_PINS).zip(self.levels);
        for (pin, level) in all.filter(|(pin, _)| has.digital >> pin.get() & 1 != 0) {
            let output = session.is_output(pin)?;
            // The level of an output is the level that a page has set since the last stop. The level of an input is
            // read.
            let high = if output { level } else { Some(session.read_pin(pin)?) };
            pins.push(json!({ "pin": pin.get(), "output": output, "high": high }));
        }
        Ok(pins)
    }

    /// Executes an order to devices; returns the result of a transfer.
    pub(crate) fn execute(
        &mut self,
        session: &mut Session,
        order: &DeviceRequest,
    ) -> Result<Option<Transfer>, RequestError> {
        match *order {
            DeviceRequest::Servo { servo, period_us, width_us, on } => {
                let servo: ServoOutput = number("a servo output", servo)?;
                if on == Some(false) {
                    return Ok(session.enable_servo(servo, false).map(|()| None)?);
                }
                let word =
                    |what, us: f64| within(what, us.round(), 0.0..=u16::MAX.into(), "us").map(|us| us as u16);
                let (period_us, width_us) =
                    (word("a servo's period", period_us)?, word("a servo's pulse", width_us)?);
                let pulses = (WordFrom::new(period_us), WordFrom::new(width_us));
                let (Some(period), Some(width)) = pulses else {
                    return Err("a pulse is 1 to 65535 us long, and its period 2 to 65535 us".into());
                };
                check_pulse(width_us, period_us).map_err(|error| error.to_string())?;
                session.set_servo_period(servo, period)?;
                session.set_servo_width(servo, width)?;
                if on == Some(true) {
                    session.enable_servo(servo, true)?;
                }
            }
            DeviceRequest::Pin { pin, level } => {
                let pin: Pin = number("a digital pin", pin)?;
                match level {
                    Some(high) => session.drive_pin(pin, high)?,
                    None => session.release_pin(pin)?,
                }
                if let Some(kept) = self.levels.get_mut(usize::from(pin.get())) {
                    *kept = level;
                }
            }
            DeviceRequest::Scan { bus } => {
                let bus = number("an I2C bus", bus)?;
                self.scan = Some(Scan { bus, next: I2C_ADDRESSES.0, found: Vec::new() });
            }
            DeviceRequest::Read { bus, address, register, count, fast } => {
                let (at, address) = device(bus, address)?;
                let count: I2cCount = number("a number of bytes", count)?;
                session.set_i2c_speed(at, fast)?;
                let read = session.read_i2c(at, address, register, count)?;
                return Ok(Some(transfer(bus, "read", &read.bytes, read.status)));
            }
            DeviceRequest::Write { bus, address, ref bytes, fast } => {
                let (at, address) = device(bus, address)?;
                let text = Text::from_slice(bytes).ok().filter(|text| (1..=100).contains(&text.len()));
                let text =
                    text.ok_or_else(|| format!("a write of {} bytes; allowed is 1 to 100", bytes.len()))?;
                session.set_i2c_speed(at, fast)?;
                let written = session.write_i2c(at, address, text)?;
                return Ok(Some(transfer(bus, "write", bytes, written.status)));
            }
        }
        Ok(None)
    }

    /// Continues a running scan. Returns the result when the scan has ended, else `None`.
    pub(crate) fn go_on(&mut self, session: &mut Session) -> Result<Option<Transfer>, Error> {
        let Some(Scan { bus, mut next, mut found }) = self.scan.take() else { return Ok(None) };
        let bytes = |found| Transfer { bus: bus.get(), what: "scan", bytes: found, why: None };
        for _ in 0..ADDRESSES_A_FRAME {
            let Some(address) = I2cAddress::new(next).filter(|_| next <= I2C_ADDRESSES.1) else {
                return Ok(Some(bytes(found)));
            };
            match session.finds_i2c(bus, address)? {
                Ok(true) => found.push(next),
                Ok(false) => (),
                Err(why) => return Ok(Some(Transfer { why: Some(why), ..bytes(found) })),
            }
            next += 1;
        }
        self.scan = Some(Scan { bus, next, found });
        Ok(None)
    }
}

/// States of the servo outputs, by the number of the servo.
pub(crate) fn servos(session: &mut Session) -> Result<Vec<Servo>, Error> {
    let has = session.equipment()?.unwrap_or_default();
    let all = (0..SERVOS.min(has.servos.into()) as u8).filter_map(ServoOutput::new);
    all.map(|servo| session.servo(servo)).collect()
}

/// Values of all analog channels. A value that the hub refuses is replaced by the reason of the refusal.
pub(crate) fn analog(session: &mut Session) -> Result<Vec<Value>, Error> {
    let channels = channels().map(|channel| {
        let measured = session.measured(channel)?;
        let Channel { name, unit, .. } = channel;
        Ok(json!({ "name": name, "unit": unit, "value": measured.as_ref().ok(), "why": measured.as_ref().err() }))
    });
    channels.collect()
}

fn number<const LEAST: u8, const MOST: u8>(
    what: &str,
    given: u8,
) -> Result<ByteIn<LEAST, MOST>, RequestError> {
    ByteIn::new(given).ok_or_else(|| format!("{what} is {LEAST} to {MOST}, and not {given}").into())
}

fn device(bus: u8, address: u8) -> Result<(I2cBus, I2cAddress), RequestError> {
    Ok((number("an I2C bus", bus)?, number("an I2C address", address)?))
}

fn transfer(bus: u8, what: &'static str, bytes: &[u8], status: I2cStatus) -> Transfer {
    let why = status.error().map(str::to_owned);
    Transfer { bus, what, bytes: bytes.to_owned(), why }
}
