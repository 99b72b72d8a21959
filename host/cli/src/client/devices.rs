//! `motor-hub client servo`, `analog`, `digital` and `i2c`: commands to the devices of a hub other than motors.

use super::hub::HubOptions;
use super::interrupt::{self, CTRL_C};
use super::readings::repeat;
use crate::output::{Failure, print, print_as};
use crate::parse::{byte_in, whole, within_a_day};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use motor_hub::board::{DIGITAL_PINS, Equipment, SERVOS};
use motor_hub::protocol::answers::{I2cStatus, Status};
use motor_hub::protocol::payload::{Text, WordFrom};
use motor_hub::protocol::pins::{I2cAddress, I2cBus, I2cCount, Pin, ServoOutput};
use motor_hub_client::devices::{Channel, I2C_ADDRESSES, channels, check_pulse};
use motor_hub_client::error::or_reason;
use motor_hub_client::{Error, Session};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::time::Duration;
use studies::{table, with_fields};

/// Interval between two packets that keep servos and digital outputs on.
const KEEP_ON: Duration = Duration::from_millis(500);

/// Returns a text that lists the devices of a hub, such as "6 servos, 4 analog inputs, 8 digital pins, 4 I2C buses".
pub(super) fn equipment_text(equipment: Equipment) -> String {
    let count = |count: u32, one: &str, many: &str| match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        count => Some(format!("{count} {many}")),
    };
    let parts = [
        count(equipment.servos.into(), "servo", "servos"),
        count(equipment.analog.into(), "analog input", "analog inputs"),
        count(equipment.digital.count_ones(), "digital pin", "digital pins"),
        count(equipment.i2c.into(), "I2C bus", "I2C buses"),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    if parts.is_empty() { "motors only".to_owned() } else { parts.join(", ") }
}

/// Writes the devices of a hub as JSON; null if the hub does not report them.
pub(super) fn equipment_json<S: Serializer>(equipment: &Option<Equipment>, to: S) -> Result<S::Ok, S::Error> {
    let document = equipment.map(|equipment| json!({
        "servos": equipment.servos,
        "analog_inputs": equipment.analog,
        "digital_pins": pins().filter(|pin| equipment.digital & 1 << pin.get() != 0).map(Pin::get).collect::<Vec<_>>(),
        "i2c_buses": equipment.i2c,
        "measures_rail": equipment.rail,
        "measures_temperature": equipment.temperature,
    }));
    document.serialize(to)
}

fn pins() -> impl Iterator<Item = Pin> {
    (0..DIGITAL_PINS as u8).filter_map(Pin::new)
}

/// Switches an output on, prints a line, and keeps the output on until `length` is over, a signal arrives, a request
/// fails, or the hub has switched the output off: `is_on` then returns false. The output is then released, also if the
/// hub's answer to the request is lost, because the hub may have switched the output on. Without a `length`, Ctrl-C is no
/// failure.
fn keep_on(
    session: &mut Session,
    line: &str,
    length: Option<Duration>,
    switch: impl Fn(&mut Session, bool) -> Result<(), Error>,
    is_on: impl Fn(&mut Session) -> Result<bool, Error>,
) -> Result<(), Failure> {
    let check = |session: &mut Session| {
        if is_on(session)? {
            return Ok(());
        }
        let words = session.status(false)?.words().join(", ");
        Err(Failure::Work(format!("the hub has switched the output off; hub status: {words}")))
    };
    interrupt::listen()?;
    let kept = switch(session, true).map_err(Failure::from).and_then(|()| {
        print(&format!("{line}\n"))?;
        repeat(KEEP_ON, length, |_| check(session).map(|()| false))?;
        check(session)
    });
    let released = switch(session, false);
    match kept {
        // Without a duration, Ctrl-C is the usual end.
        Err(Failure::Stopped(CTRL_C)) if length.is_none() => (),
        kept => kept?,
    }
    Ok(released?)
}

/// Shows the servo outputs, or gives a servo pulses until the command ends
#[derive(clap::Args)]
pub(super) struct ServoOptions {
    /// Servo output, 0 to 5 [default: lists all servo outputs]
    #[arg(value_parser = byte_in("a servo output", ServoOutput::new))]
    servo: Option<ServoOutput>,
    /// Length of the pulses in microseconds, 1 to 65535; servos usually take 500 to 2500
    #[arg(value_name = "US", requires = "servo", value_parser = whole("a pulse", 1..=u16::MAX, "us"))]
    width: Option<u16>,
    /// Time between the starts of two pulses in microseconds
    #[arg(long = "period-us", value_name = "US", default_value_t = 20_000)]
    #[arg(value_parser = whole("a period", 2..=u16::MAX, "us"))]
    period: u16,
    /// Duration in seconds [default: until Ctrl-C]
    #[arg(long = "for-s", value_name = "S", value_parser = within_a_day)]
    length: Option<Duration>,
    /// JSON instead of a table
    #[arg(long, conflicts_with = "width")]
    json: bool,
}

impl ServoOptions {
    pub(super) fn execute(&self, hub: &HubOptions) -> Result<(), Failure> {
        if let Some(width) = self.width {
            check_pulse(width, self.period)
                .map_err(|error| Failure::Input(format!("{error}, or a longer --period-us")))?;
        }
        let session = &mut hub.open(None)?;
        if let (Some(servo), Some(width)) = (self.servo, self.width) {
            return self.drive(session, servo, width);
        }
        let mut table = table::new(&["servo", "period, us", "pulse, us", "enabled"], 0);
        let mut servos = Vec::new();
        let all = (0..SERVOS as u8).filter_map(ServoOutput::new);
        for servo in all.filter(|servo| self.servo.is_none_or(|only| only == *servo)) {
            let of = session.servo(servo)?;
            let enabled = if of.enabled { "yes" } else { "no" };
            let number = servo.get();
            let [period, width] = [of.period_us, of.width_us].map(|us| us.to_string());
            table.add_row([&number.to_string(), &period, &width, enabled]);
            servos.push(with_fields(json!({ "servo": number }), json!(of)));
        }
        print_as(self.json, &json!({ "servos": servos }), table)
    }

    /// Starts the pulses of a servo. Ends the pulses when the duration is over, after a signal, and after an error.
    fn drive(&self, session: &mut Session, servo: ServoOutput, width: u16) -> Result<(), Failure> {
        // The parsers of the options have checked the ranges.
        if let (Some(period), Some(width)) = (WordFrom::new(self.period), WordFrom::new(width)) {
            session.set_servo_period(servo, period)?;
            session.set_servo_width(servo, width)?;
        }
        let line = format!("servo {}: pulses of {width} us every {} us", servo.get(), self.period);
        let switch = |session: &mut Session, on| session.enable_servo(servo, on);
        keep_on(session, &line, self.length, switch, |session| session.servo_enabled(servo))
    }
}

pub(super) fn analog(hub: &HubOptions, json: bool) -> Result<(), Failure> {
    let session = &mut hub.open(None)?;
    let mut table = table::new(&["channel", "value", "raw"], 0);
    let mut document = serde_json::Map::new();
    for channel @ Channel { number, name, key, unit, scale } in channels() {
        match session.measured(channel)? {
            Ok(value) => {
                let raw = session.adc(number, true)?;
                let digits = if scale < 0.01 { 3 } else { 1 };
                table.add_row([name.to_owned(), format!("{value:.digits$} {unit}"), raw.to_string()]);
                document.insert(key.to_owned(), json!(value));
                document.insert(format!("{key}_raw"), json!(raw));
            }
            Err(reason) => {
                table.add_row([name.to_owned(), reason, String::new()]);
                document.insert(key.to_owned(), Value::Null);
            }
        }
    }
    print_as(json, &document, table)
}

/// Shows the digital pins, or drives a pin until the command ends
#[derive(clap::Args)]
pub(super) struct DigitalOptions {
    /// Digital pin, 0 to 7 [default: lists all digital pins]
    #[arg(value_parser = byte_in("a digital pin", Pin::new))]
    pin: Option<Pin>,
    /// Drives the pin high or low, until the command ends
    #[arg(value_name = "LEVEL", requires = "pin")]
    #[arg(value_parser = PossibleValuesParser::new(["high", "low"]).map(|level| level == "high"))]
    high: Option<bool>,
    /// Duration in seconds [default: until Ctrl-C]
    #[arg(long = "for-s", value_name = "S", value_parser = within_a_day)]
    length: Option<Duration>,
    /// JSON instead of a table
    #[arg(long, conflicts_with = "high")]
    json: bool,
}

impl DigitalOptions {
    pub(super) fn execute(&self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(None)?;
        if let (Some(pin), Some(high)) = (self.pin, self.high) {
            return self.drive(session, pin, high);
        }
        let mut table = table::new(&["pin", "direction", "level"], 0);
        let mut found = Vec::new();
        for pin in pins().filter(|pin| self.pin.is_none_or(|only| only == *pin)) {
            let (direction, level, high) = match or_reason(session.is_output(pin))? {
                Ok(true) => ("output", String::new(), None),
                Ok(false) => {
                    let high = session.read_pin(pin)?;
                    ("input", if high { "high" } else { "low" }.to_owned(), Some(high))
                }
                Err(reason) => ("", reason, None),
            };
            table.add_row([&pin.get().to_string(), direction, &level]);
            let known = Some(direction).filter(|direction| !direction.is_empty());
            found.push(json!({ "pin": pin.get(), "direction": known, "high": high }));
        }
        print_as(self.json, &json!({ "pins": found }), table)
    }

    /// Drives a pin. Releases the pin when the duration is over, after a signal, and after an error.
    fn drive(&self, session: &mut Session, pin: Pin, high: bool) -> Result<(), Failure> {
        let line = format!("digital pin {} is {}", pin.get(), if high { "high" } else { "low" });
        // The hub does not report whether it drives an output, so its status must have no earlier event.
        session.status(true)?;
        let switch = |session: &mut Session, on| {
            if on { session.drive_pin(pin, high) } else { session.release_pin(pin) }
        };
        let released = Status::KEEP_ALIVE_TIMEOUT | Status::RESET | Status::FAIL_SAFE;
        keep_on(session, &line, self.length, switch, |session| {
            Ok(session.status(false)?.status & released == 0)
        })
    }
}

/// What to do on an I2C bus.
#[derive(clap::Subcommand)]
pub(super) enum I2c {
    /// Lists the devices that acknowledge their address, by a read of one byte from each address 0x08 to 0x77
    Scan {
        /// Bus, 0 to 3 [default: all buses]
        #[arg(value_parser = byte_in("an I2C bus", I2cBus::new))]
        bus: Option<I2cBus>,
        /// JSON instead of a table
        #[arg(long)]
        json: bool,
    },
    /// Reads bytes from a device
    Read {
        /// Bus, 0 to 3
        #[arg(value_parser = byte_in("an I2C bus", I2cBus::new))]
        bus: I2cBus,
        /// Address of the device, 0 to 127, as 40 or 0x28
        #[arg(value_name = "ADDRESS", value_parser = device)]
        device: I2cAddress,
        /// Number of bytes, 1 to 100
        #[arg(default_value = "1", value_parser = byte_in("a number of bytes", I2cCount::new))]
        count: I2cCount,
        /// Register to read from: its number is written first, and the read follows after a repeated start
        #[arg(long, value_name = "R", value_parser = byte)]
        register: Option<u8>,
        /// 400 kbit/s instead of 100 kbit/s
        #[arg(long)]
        fast: bool,
        /// JSON instead of text
        #[arg(long)]
        json: bool,
    },
    /// Writes bytes to a device
    Write {
        /// Bus, 0 to 3
        #[arg(value_parser = byte_in("an I2C bus", I2cBus::new))]
        bus: I2cBus,
        /// Address of the device, 0 to 127, as 40 or 0x28
        #[arg(value_name = "ADDRESS", value_parser = device)]
        device: I2cAddress,
        /// 1 to 100 bytes, as 61 or 0x3d
        #[arg(required = true, num_args = 1..=100, value_name = "BYTE", value_parser = byte)]
        bytes: Vec<u8>,
        /// 400 kbit/s instead of 100 kbit/s
        #[arg(long)]
        fast: bool,
    },
}

fn byte(text: &str) -> Result<u8, String> {
    let number = match text.strip_prefix("0x") {
        Some(hex) => u8::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    };
    number.ok_or_else(|| "a byte is 0 to 255, or 0x00 to 0xff".to_owned())
}

fn device(text: &str) -> Result<I2cAddress, String> {
    let address = byte(text).ok().and_then(I2cAddress::new);
    address.ok_or_else(|| "an I2C address is 0 to 127, or 0x00 to 0x7f".to_owned())
}

fn check(status: I2cStatus, bus: I2cBus, address: I2cAddress) -> Result<(), Failure> {
    match status.error() {
        None => Ok(()),
        Some(error) => Err(Failure::Work(format!(
            "device {:#04x} on I2C bus {}: {error} (status {:#04x})",
            address.get(),
            bus.get(),
            status.bits
        ))),
    }
}

impl I2c {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(None)?;
        match self {
            Self::Scan { bus, json } => scan(session, bus, json),
            Self::Read { bus, device: address, count, register, fast, json } => {
                session.set_i2c_speed(bus, fast)?;
                let read = session.read_i2c(bus, address, register, count)?;
                check(read.status, bus, address)?;
                let bytes = read.bytes.as_slice();
                let document = json!({ "bus": bus.get(), "address": address.get(), "bytes": bytes });
                let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
                print_as(json, &document, bytes.join(" "))
            }
            Self::Write { bus, device: address, bytes, fast } => {
                session.set_i2c_speed(bus, fast)?;
                let bytes =
                    Text::from_slice(&bytes).map_err(|_| Failure::Input("give 1 to 100 bytes".into()))?;
                let written = session.write_i2c(bus, address, bytes)?;
                check(written.status, bus, address)?;
                print(&format!("{} bytes written\n", written.count))
            }
        }
    }
}

fn scan(session: &mut Session, only: Option<I2cBus>, json: bool) -> Result<(), Failure> {
    let mut table = table::new(&["bus", "devices"], 1);
    let mut buses = Vec::new();
    for bus in (0..4).filter_map(I2cBus::new).filter(|bus| only.is_none_or(|only| only == *bus)) {
        let mut devices = Vec::new();
        let mut error = None;
        for address in (I2C_ADDRESSES.0..=I2C_ADDRESSES.1).filter_map(I2cAddress::new) {
            match session.finds_i2c(bus, address)? {
                Ok(true) => devices.push(address.get()),
                Ok(false) => (),
                // An error concerns the whole bus, so the remaining addresses are not read.
                Err(why) => {
                    error = Some(why);
                    break;
                }
            }
        }
        let found: Vec<String> = devices.iter().map(|address| format!("{address:#04x}")).collect();
        let text = match &error {
            Some(error) => error.clone(),
            None if found.is_empty() => "none".to_owned(),
            None => found.join(" "),
        };
        table.add_row([bus.get().to_string(), text]);
        buses.push(json!({ "bus": bus.get(), "devices": devices, "reason": error }));
    }
    print_as(json, &json!({ "buses": buses }), table)
}
