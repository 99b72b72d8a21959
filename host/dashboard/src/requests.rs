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
    /// Asks for the points S, T, Z and G of a motor with a scheme, `A` to `D`, at a speed of 0 to 1000000 counts/s and a
    /// battery voltage of 1 to 60 V.
    Points { motor: u8, scheme: SchemeName, cps: f64, volts: f64 },
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
    /// Sets the coefficients of a loop: proportional, integral, derivative and feed-forward, -32768 to 32767 each. From
    /// then on the motor is regulated by PID.
    Coefficients { motor: u8, of: Loop, pidf: [f64; 4] },
    /// Chooses the regulator. For an unknown motor the model learns the acceleration per volt.
    Regulator { motor: u8, kind: Kind },
    /// Configures the connected motor by its name in the catalogue, the scheme (`none`, `A` to `D`), and the duty rule.
    /// Without a name the configured motor is kept.
    SetUp { motor: u8, name: Option<String>, scheme: SchemeName, duty: DutyRule },
    /// Turns motors at speeds in step, until the next request.
    Turn {
        /// Speed by motor in counts/s; `None` for a motor that does not take part.
        at: [Option<f64>; 4],
        /// Largest acceleration of any motor, in counts/s².
        acceleration: f64,
    },
    /// Changes settings of a motor: numbers or words by their names in a settings file. `null` removes the value of an
    /// optional setting.
    Configure { motor: u8, values: Map<String, Value> },
    /// Limits a motor's acceleration, in counts/s²; `None` for the acceleration that the battery gives.
    Acceleration { motor: u8, limit: Option<f64> },
    /// Identifies a motor, with a longest travel in either direction in counts; `None` for no limit.
    Identify { motor: u8, travel: Option<f64> },
    /// Applies the result of the last identification.
    Apply { motor: u8 },
    /// Undoes the last change of a motor's settings.
    Undo { motor: u8 },
    /// Asks for the hub's record of faults.
    Faults,
    /// Asks for the settings in force as a file.
    Export,
    /// Puts the settings of a file in force, as [`settings_file`](crate::settings_file) defines the file.
    Import { text: String },
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
    /// Gives the hub another address, 1 to 254.
    Address { new: i64 },
    /// Sets the colour of the hub's lamp: red, green and blue, 0 to 255 each.
    Led { colour: [u8; 3] },
    /// A part of new firmware: bytes as hexadecimal digits, and the number of bytes before them. Offset 0 begins another
    /// image.
    Firmware { offset: usize, hex: String },
    /// Sends the firmware with this version text to the hub, and restarts the hub with it. A hub without a key needs no
    /// signature.
    Update { version: String, seal: Option<SignatureFiles> },
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

    /// True for an order that a running identification of this motor does not allow: another identification, a scenario,
    /// or a change of the motor's settings or of its zero.
    pub(crate) fn disturbs_identification(&self, identified: u8) -> bool {
        match *self {
            Self::Identify { .. } | Self::Play | Self::Load | Self::Reset => true,
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
    /// Sets period and width of the pulses of a servo output, 0 to 5. `on` starts or ends the pulses; `None` does neither.
    Servo { servo: u8, period_us: f64, width_us: f64, on: Option<bool> },
    /// Makes a digital pin, 0 to 7, an output with a level; `None` makes the pin an input.
    Pin { pin: u8, level: Option<bool> },
    /// Looks for the devices on an I2C bus, 0 to 3.
    Scan { bus: u8 },
    /// Reads 1 to 100 bytes of a device on an I2C bus, from a register if one is given. `fast` is 400 kbit/s instead of
    /// 100 kbit/s.
    Read { bus: u8, address: u8, register: Option<u8>, count: u8, fast: bool },
    /// Writes 1 to 100 bytes to a device on an I2C bus. `fast` is 400 kbit/s instead of 100 kbit/s.
    Write { bus: u8, address: u8, bytes: Vec<u8>, fast: bool },
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
