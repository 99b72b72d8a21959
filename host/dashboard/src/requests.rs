//! Orders of pages. An order with fields is a JSON object with one key, the name of the order; its value has the
//! fields. An order without fields is the same object with `null`, or a string with the name. Unknown or missing fields
//! are refused with a text; a field of type `Option` may be missing. Values out of range are refused when the order is
//! executed, so numbers of users are fields of type `f64`: the executor rounds them. A field `motor` is a motor's number, 0 to 3.

use crate::world::WorldOrder;
use motor_hub::braking::DutyRule;
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::motor::{Loop, RunMode};
use motor_hub::regulator::Kind;
use serde::Deserialize;
use serde_json::{Map, Value};
use simulated::scheme::SchemeName;

/// An order of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum PageRequest {
    /// The page has shown this frame.
    Shown { number: u64 },
    /// The page has been hidden, or is visible again.
    Hidden { hidden: bool },
    /// Disables all motors. Any page may stop.
    Stop,
    /// Takes control, or asks the page in control to release it.
    Take,
    /// Releases control, and gives it to the page that has asked for it.
    Release,
    /// Asks for the points S, T, Z and G of a motor at a speed and a battery voltage.
    Points {
        motor: u8,
        /// Scheme: `A` to `D`.
        scheme: SchemeName,
        /// Speed in counts/s, 0 to 1000000.
        cps: f64,
        /// Battery voltage in volts, 1 to 60.
        volts: f64,
    },
    /// Set-point of a motor. A disabled motor keeps the set-point until it is enabled.
    Drive {
        motor: u8,
        /// Kind of the set-point: power, velocity or position.
        mode: RunMode,
        /// Share of full power from -1 to 1, counts/s, or counts.
        value: f64,
        /// Speed limit towards a position, in counts/s; `None` for 1000 counts/s.
        speed: Option<f64>,
        /// Largest distance to a position at which a motor can settle, in counts; `None` for 10 counts.
        tolerance: Option<f64>,
        /// Behaviour at power 0 or speed 0.
        #[serde(default)]
        zero: ZeroPower,
        /// True to enable the motor once the hub has accepted the set-point.
        #[serde(default)]
        enable: bool,
    },
    /// Constant current of an enabled motor. A motor that stays disabled gets power 0 instead.
    Current {
        motor: u8,
        amperes: f64,
        /// Speed limit in counts/s; `None` for no limit.
        speed: Option<f64>,
        /// True to enable the motor with power 0 before the current starts.
        #[serde(default)]
        enable: bool,
    },
    /// Enables or disables a motor. An enabled motor follows the last set-point that the hub has accepted.
    Enable { motor: u8, on: bool },
    /// Makes a motor's present position 0.
    ResetEncoder { motor: u8 },
    /// Moves motors by distances in step.
    Together {
        /// Distance by motor in counts; `None` for a motor that does not take part.
        by: [Option<f64>; 4],
        /// Speed of the motor with the longest distance, in counts/s.
        speed: f64,
        /// Largest acceleration of any motor, in counts/s².
        acceleration: f64,
    },
    /// Sets the coefficients of a loop. From then on the motor is regulated by PID.
    Coefficients {
        motor: u8,
        of: Loop,
        /// Proportional, integral, derivative, feed-forward: -32768 to 32767 each.
        pidf: [f64; 4],
    },
    /// Chooses the regulator. For an unknown motor the model learns the acceleration per volt.
    Regulator { motor: u8, kind: Kind },
    /// Configures the connected motor, the scheme and the duty rule.
    SetUp {
        motor: u8,
        /// Name in the catalogue; `None` keeps the configured motor.
        name: Option<String>,
        /// Scheme: `none`, `A` to `D`.
        scheme: SchemeName,
        duty: DutyRule,
    },
    /// Turns motors at speeds in step, until the next request.
    Turn {
        /// Speed by motor in counts/s; `None` for a motor that does not take part.
        at: [Option<f64>; 4],
        /// Largest acceleration of any motor, in counts/s².
        acceleration: f64,
    },
    /// Changes settings of a motor, by their names in a settings file.
    Configure {
        motor: u8,
        /// Number or word by name; `null` removes the value of an optional setting.
        values: Map<String, Value>,
    },
    /// Limits a motor's acceleration.
    Acceleration {
        motor: u8,
        /// Limit in counts/s²; `None` for the acceleration that the battery gives.
        limit: Option<f64>,
    },
    /// Identifies a motor.
    Identify {
        motor: u8,
        /// Longest travel in either direction, in counts; `None` for no limit.
        travel: Option<f64>,
    },
    /// Applies the result of the last identification.
    Apply { motor: u8 },
    /// Undoes the last change of a motor's settings.
    Undo { motor: u8 },
    /// Asks for the hub's record of faults.
    Faults,
    /// Asks for the settings in force as a file.
    Export,
    /// Puts the settings of a file in force.
    Import {
        /// The file, as [`settings_file`](crate::settings_file) defines it.
        text: String,
    },
    /// Stores the settings in force permanently.
    Save,
    /// Puts the stored settings in force.
    Load,
    /// Deletes the stored settings, and puts the firmware's settings in force.
    Reset,
    /// Clears the hub's record of faults.
    ClearFaults,
    /// Asks for address, version, lamp and stored settings of the hub.
    Status,
    /// Shows another hub of the chain.
    Hub { address: u8 },
    /// Asks for the state of devices.
    Look(Look),
    /// Changes a servo or a digital pin, or uses an I2C bus.
    Device(DeviceRequest),
    /// Gives the hub another address.
    Address {
        /// Address, 1 to 254.
        new: i64,
    },
    /// Sets the colour of the hub's lamp.
    Led {
        /// Red, green and blue, 0 to 255 each.
        colour: [u8; 3],
    },
    /// A part of new firmware. Offset 0 begins another image.
    Firmware {
        /// Number of bytes before the part.
        offset: usize,
        /// Bytes as hexadecimal digits.
        hex: String,
    },
    /// Sends the firmware to the hub, and restarts the hub with it.
    Update {
        /// Version text in the firmware.
        version: String,
        /// Signature of the firmware; `None` for a hub that needs none.
        seal: Option<SignatureFiles>,
    },
    /// Plays the scenario of a simulated hub from its beginning.
    Play,
    /// Changes a simulated hub's world.
    World(WorldOrder),
}

impl PageRequest {
    /// Returns a notice of what an executed order has done; `None` if the page shows the effect already.
    pub(crate) fn done(&self) -> Option<String> {
        Some(match *self {
            Self::Coefficients { motor, of: Loop::Velocity, .. } => {
                format!("motor {motor}: the coefficients of the velocity loop are set, and PID regulates")
            }
            Self::Coefficients { motor, of: Loop::Position, .. } => {
                format!("motor {motor}: the coefficients of the position loop are set, and PID regulates")
            }
            Self::Regulator { motor, kind: Kind::Model } => {
                format!("motor {motor} is regulated by its model")
            }
            Self::Regulator { motor, kind: Kind::Pid } => format!("motor {motor} is regulated by PID"),
            Self::SetUp { motor, .. } => format!("motor {motor} is set up"),
            Self::Acceleration { motor, limit: Some(limit) } => {
                format!("motor {motor}: the acceleration limit is {} counts/s²", limit.round())
            }
            Self::Acceleration { motor, limit: None } => format!("motor {motor} has no acceleration limit"),
            Self::Apply { motor } => format!("motor {motor} uses the identified values"),
            Self::Import { .. } => {
                "the settings of the file are in force until the hub restarts, unless they are saved"
                    .to_owned()
            }
            Self::Configure { motor, .. } => format!("motor {motor}: the settings are in force"),
            Self::ClearFaults => "the record of faults is cleared".to_owned(),
            Self::Undo { motor } => format!("motor {motor}: the last change is undone"),
            Self::ResetEncoder { motor } => format!("motor {motor}: the present position is 0"),
            _ => return None,
        })
    }

    /// True for an order that a running identification of this motor does not allow: another identification, or a
    /// change of the motor's settings or of its zero.
    pub(crate) fn disturbs_identification(&self, identified: u8) -> bool {
        match *self {
            Self::Identify { .. } | Self::Load | Self::Reset => true,
            Self::ResetEncoder { motor } => motor == identified,
            _ => self.changed_motor() == Some(identified),
        }
    }

    /// The motor whose settings an order changes; `None` for all other orders.
    pub(crate) const fn changed_motor(&self) -> Option<u8> {
        match *self {
            Self::Coefficients { motor, .. }
            | Self::Regulator { motor, .. }
            | Self::SetUp { motor, .. }
            | Self::Configure { motor, .. }
            | Self::Acceleration { motor, .. }
            | Self::Apply { motor }
            | Self::Undo { motor } => Some(motor),
            _ => None,
        }
    }
}

/// Devices whose state a page asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Look {
    /// Servo outputs.
    Servos,
    /// Analog inputs, and what else the hub measures.
    Analog,
    /// Digital pins.
    Pins,
}

/// An order to what a hub has besides motors.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum DeviceRequest {
    /// Starts, changes or ends the pulses of a servo.
    Servo {
        /// Servo output, 0 to 5.
        servo: u8,
        /// Time between the starts of two pulses, in microseconds.
        period_us: f64,
        /// Length of the pulses in microseconds.
        width_us: f64,
        /// True to start the pulses, false to end them; `None` sets period and width, and starts no pulses.
        on: Option<bool>,
    },
    /// Sets a digital pin.
    Pin {
        /// Digital pin, 0 to 7.
        pin: u8,
        /// Level of an output; `None` makes the pin an input.
        level: Option<bool>,
    },
    /// Looks for the devices on an I2C bus.
    Scan {
        /// Bus, 0 to 3.
        bus: u8,
    },
    /// Reads bytes of a device on an I2C bus.
    Read {
        /// Bus, 0 to 3.
        bus: u8,
        /// Address of the device, 0 to 127.
        address: u8,
        /// Register to read from; `None` for a read without a register.
        register: Option<u8>,
        /// Number of bytes, 1 to 100.
        count: u8,
        /// True for 400 kbit/s, false for 100 kbit/s.
        fast: bool,
    },
    /// Writes bytes to a device on an I2C bus.
    Write {
        /// Bus, 0 to 3.
        bus: u8,
        /// Address of the device, 0 to 127.
        address: u8,
        /// The bytes to write, 1 to 100.
        bytes: Vec<u8>,
        /// True for 400 kbit/s, false for 100 kbit/s.
        fast: bool,
    },
}

/// Signature and public key of new firmware. Each is the contents of a file as hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SignatureFiles {
    /// The signature: 64 bytes.
    pub(crate) signature: String,
    /// The signer's public key in DER, as OpenSSL writes it.
    pub(crate) key: String,
}
