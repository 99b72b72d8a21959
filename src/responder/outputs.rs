//! Digital pins and servo outputs.
//!
//! The hub refuses requests to pins and outputs that the board does not have.
//!
//! * After a reset all digital pins are inputs with a pull-up. A pin without a connection reads 1.
//! * A pin that becomes an output is low until a host sets its level.
//! * Fail-safe *releases* the digital outputs: the board stops driving the pins, and forgets their levels. The direction
//!   of a released pin is still output. The board drives the pin again when a host sets its level or its direction.
//! * A request of all inputs returns 0 for outputs, and for pins that the board does not have. It is refused if all
//!   pins of the board are outputs.
//! * After a reset servo outputs have a period of 20 ms, and no width. An output can be enabled once a host has set its
//!   width. A width longer than the period is stored, and the pulse is then as long as the period.
//! * Fail-safe and a low battery disable all servo outputs. Their periods and widths stay.
//!
//! ```
//! use motor_hub::devices::{Equipment, ServoPulse};
//! use motor_hub::protocol::payload::WordFrom;
//! use motor_hub::protocol::pins::{Pin, ServoOutput, ToPin};
//! use motor_hub::protocol::{Nack, Reply};
//! use motor_hub::responder::outputs::Outputs;
//!
//! let mut outputs = Outputs::default();
//! outputs.equipment = Equipment { digital: 0xFF, servos: 6, ..Equipment::default() };
//! let servo = ServoOutput::new(5).expect("0 to 5");
//! let enable = ToPin::SetServoEnable { servo, on: true };
//! assert_eq!(outputs.receive(&enable, true), Err(Nack::SERVO_NOT_CONFIGURED));
//! let width = WordFrom::new(1_500).expect("at least 1");
//! assert_eq!(outputs.receive(&ToPin::SetServoWidth { servo, width }, true), Ok(Reply::ACK));
//! assert_eq!(outputs.receive(&enable, true), Ok(Reply::ACK));
//! assert_eq!(outputs.servo_pulses()[5], Some(ServoPulse { period_us: 20_000, width_us: 1_500 }));
//!
//! let pin = Pin::new(3).expect("0 to 7");
//! assert_eq!(outputs.receive(&ToPin::SetOutput { pin, high: true }, true), Err(Nack(13)));
//! assert!(matches!(outputs.receive(&ToPin::Input { pin }, true), Ok(Reply::Data(level)) if *level == [1]));
//! ```

use crate::devices::{Equipment, SERVOS, ServoPulse};
use crate::protocol::pins::{Pin, ServoOutput, ToPin};
use crate::protocol::{Nack, Reply};

/// Period of a servo's pulses after a reset, in microseconds: the usual period of hobby servos. The hub needs a
/// default, because host software that has set the period once does not set it again after a reset of the hub.
const SERVO_PERIOD_US: u16 = 20_000;

/// Settings of a servo output.
#[derive(Clone, Copy, Debug)]
struct Servo {
    period_us: u16,
    /// 0 until a host has set the width.
    width_us: u16,
    on: bool,
}

impl Servo {
    fn pulse(self) -> Option<ServoPulse> {
        let Self { period_us, width_us, on } = self;
        on.then_some(ServoPulse { period_us, width_us: width_us.min(period_us) })
    }
}

/// State of all pins and outputs.
#[derive(Clone, Copy, Debug)]
pub struct Outputs {
    /// Bit i is set if pin i is an output, released or not.
    outputs: u8,
    /// Pins that the board must drive. Bit i is set if the board must drive pin i.
    pub driven: u8,
    /// Levels of the driven pins. Bit i is set if pin i must be high.
    pub levels: u8,
    /// Levels of the pins when the board last read them. Bit i is set if pin i was high. After a reset all bits are
    /// set.
    pub sensed: u8,
    /// What the board has.
    pub equipment: Equipment,
    servos: [Servo; SERVOS],
    /// The pulses that the board has been given last.
    last_pulses: [Option<ServoPulse>; SERVOS],
}

impl Default for Outputs {
    /// The state after a reset.
    fn default() -> Self {
        Self {
            outputs: 0,
            driven: 0,
            levels: 0,
            sensed: u8::MAX,
            equipment: Equipment::default(),
            servos: [Servo { period_us: SERVO_PERIOD_US, width_us: 0, on: false }; SERVOS],
            last_pulses: [None; SERVOS],
        }
    }
}

impl Outputs {
    /// Returns the levels of the inputs. The bits of outputs, and of pins that the board does not have, are 0.
    pub const fn inputs(&self) -> u8 {
        self.sensed & !self.outputs & self.equipment.digital
    }

    /// Returns the pulses of all servo outputs. `None` for an output that is not enabled.
    pub fn servo_pulses(&self) -> [Option<ServoPulse>; SERVOS] {
        self.servos.map(Servo::pulse)
    }

    /// Returns the pulses of all servo outputs if they have changed since the last call.
    pub fn new_servo_pulses(&mut self) -> Option<[Option<ServoPulse>; SERVOS]> {
        let pulses = self.servo_pulses();
        let last = core::mem::replace(&mut self.last_pulses, pulses);
        (pulses != last).then_some(pulses)
    }

    /// Executes a request to a pin or a servo output. `battery_good` is false while motors may not be enabled.
    ///
    /// # Errors
    /// Returns why the request is refused. Nothing has changed then.
    pub fn receive(&mut self, request: &ToPin, battery_good: bool) -> Result<Reply, Nack> {
        self.check_pin(request)?;
        match *request {
            ToPin::SetOutput { pin, .. } if !self.is_output(pin) => return Err(Nack::not_an_output(pin)),
            ToPin::SetOutput { pin, high } => {
                set_bit(&mut self.levels, pin, high);
                set_bit(&mut self.driven, pin, true);
            }
            ToPin::SetOutputs { .. } if self.outputs == 0 => return Err(Nack::NO_OUTPUT),
            // The levels have bits of inputs too, which have no effect.
            ToPin::SetOutputs { levels } => {
                self.driven = self.outputs;
                self.levels = levels & self.outputs;
            }
            ToPin::SetDirection { pin, output } => {
                if output != self.is_output(pin) {
                    set_bit(&mut self.levels, pin, false);
                }
                set_bit(&mut self.outputs, pin, output);
                set_bit(&mut self.driven, pin, output);
            }
            ToPin::Direction { pin } => return Ok(Reply::data(&self.is_output(pin))),
            ToPin::Input { pin } if self.is_output(pin) => return Err(Nack::not_an_input(pin)),
            ToPin::Input { pin } => return Ok(Reply::data(&(self.sensed & bit(pin) != 0))),
            ToPin::Inputs if self.outputs == self.equipment.digital => return Err(Nack::NO_INPUT),
            ToPin::Inputs => return Ok(Reply::data(&self.inputs())),
            ToPin::SetServoPeriod { servo, period } => self.servo(servo)?.period_us = period.get(),
            ToPin::SetServoWidth { servo, width } => self.servo(servo)?.width_us = width.get(),
            ToPin::SetServoEnable { servo, on } => {
                let servo = self.servo(servo)?;
                if on && servo.width_us == 0 {
                    return Err(Nack::SERVO_NOT_CONFIGURED);
                }
                if on && !battery_good {
                    return Err(Nack::SERVO_BATTERY_LOW);
                }
                servo.on = on;
            }
            ToPin::ServoPeriod { servo } => return Ok(Reply::data(&self.servo(servo)?.period_us)),
            ToPin::ServoWidth { servo } => return Ok(Reply::data(&self.servo(servo)?.width_us)),
            ToPin::ServoEnable { servo } => return Ok(Reply::data(&self.servo(servo)?.on)),
            // The remaining requests are for I2C buses.
            _ => return Err(Nack::UNSUPPORTED),
        }
        Ok(Reply::ACK)
    }

    /// Refuses a request to a digital pin that the board does not have.
    fn check_pin(&self, request: &ToPin) -> Result<(), Nack> {
        let has = match *request {
            ToPin::SetOutput { pin, .. }
            | ToPin::SetDirection { pin, .. }
            | ToPin::Direction { pin }
            | ToPin::Input { pin } => self.equipment.digital & bit(pin) != 0,
            ToPin::SetOutputs { .. } | ToPin::Inputs => self.equipment.digital != 0,
            _ => true,
        };
        if has { Ok(()) } else { Err(Nack::UNSUPPORTED) }
    }

    const fn is_output(&self, pin: Pin) -> bool {
        self.outputs & bit(pin) != 0
    }

    fn servo(&mut self, output: ServoOutput) -> Result<&mut Servo, Nack> {
        let has = output.get() < self.equipment.servos;
        self.servos.get_mut(usize::from(output.get())).filter(|_| has).ok_or(Nack::UNSUPPORTED)
    }

    /// Releases all digital outputs, and disables all servo outputs.
    pub fn disable(&mut self) {
        (self.driven, self.levels) = (0, 0);
        self.disable_servos();
    }

    /// Disables all servo outputs.
    pub fn disable_servos(&mut self) {
        self.servos.iter_mut().for_each(|servo| servo.on = false);
    }
}

const fn bit(pin: Pin) -> u8 {
    1u8.wrapping_shl(pin.get() as u32)
}

const fn set_bit(bits: &mut u8, pin: Pin, to: bool) {
    *bits = if to { *bits | bit(pin) } else { *bits & !bit(pin) };
}
