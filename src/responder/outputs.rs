//! Digital pins, PWM and servo outputs, and the speeds of I2C buses.
//!
//! A motor hub has digital pins, but no PWM outputs, servo outputs and I2C buses. Host software sets up all outputs and buses of
//! REV's hubs when it opens a hub, and reads the settings back. The hub therefore keeps settings of missing outputs until a reset.
//!
//! * After a reset all digital pins are inputs with a pull-up. A pin without a connection reads 1. A pin that the board does not
//!   have reads 1 too.
//! * A pin that becomes an output is low until a host sets its level.
//! * Fail-safe *releases* the digital outputs: the board stops driving the pins, but for requests they stay outputs. A released
//!   output is driven again when a host sets its level. Fail-safe also switches off PWM and servos.
//! * A request of all inputs returns 0 for outputs.
//!
//! ```
//! use motor_hub::protocol::pins::{Pin, ServoOutput, ToPin};
//! use motor_hub::protocol::{Nack, Reply};
//! use motor_hub::responder::outputs::Outputs;
//!
//! let mut pins = Outputs::default();
//! let servo = ServoOutput::new(5).expect("0 to 5");
//! assert_eq!(pins.receive(&ToPin::SetServoEnable { servo, on: true }), Ok(Reply::ACK));
//! assert!(matches!(pins.receive(&ToPin::ServoEnable { servo }), Ok(Reply::Data(on)) if *on == [1]));
//!
//! let pin = Pin::new(3).expect("0 to 7");
//! assert_eq!(pins.receive(&ToPin::SetOutput { pin, high: true }), Err(Nack(13)));
//! assert!(matches!(pins.receive(&ToPin::Input { pin }), Ok(Reply::Data(level)) if *level == [1]));
//! ```

use crate::protocol::pins::{I2cBus, Pin, PwmOutput, ServoOutput, ToPin};
use crate::protocol::{Nack, Reply};

/// Number of PWM outputs in REV's protocol.
const PWM: usize = 4;
/// Number of servo outputs in REV's protocol.
const SERVOS: usize = 6;
/// Number of I2C buses in REV's protocol.
const I2C_BUSES: usize = 4;

/// Settings of a PWM output or a servo output. The hub has neither, so the settings have no effect.
#[derive(Clone, Copy, Debug, Default)]
struct Pulses {
    period_micros: u16,
    width_micros: u16,
    on: bool,
}

/// The command to the digital pins. Bit i stands for pin i.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DigitalLines {
    /// 1 for each pin that the board must drive.
    pub driven: u8,
    /// Level of each driven pin; 1 is high.
    pub levels: u8,
}

/// State of all pins, outputs and buses.
#[derive(Clone, Copy, Debug)]
pub struct Outputs {
    /// Bit i is set if pin i is an output, released or not.
    outputs: u8,
    /// The command to the pins.
    lines: DigitalLines,
    /// Bit i is set if pin i was high when the board last read the pins.
    sensed: u8,
    pwm: [Pulses; PWM],
    servos: [Pulses; SERVOS],
    /// For each bus, true for 400 kbit/s and false for 100 kbit/s.
    fast_i2c: [bool; I2C_BUSES],
}

impl Default for Outputs {
    /// The state after a reset.
    fn default() -> Self {
        Self {
            outputs: 0,
            lines: DigitalLines::default(),
            sensed: u8::MAX,
            pwm: Default::default(),
            servos: Default::default(),
            fast_i2c: [false; I2C_BUSES],
        }
    }
}

impl Outputs {
    /// Stores the levels of all pins. Bit i stands for pin i.
    pub const fn sense(&mut self, levels: u8) {
        self.sensed = levels;
    }

    /// Returns the command to the pins.
    pub const fn lines(&self) -> DigitalLines {
        self.lines
    }

    /// Returns the levels of the inputs. The bits of outputs are 0.
    pub const fn inputs(&self) -> u8 {
        self.sensed & !self.outputs
    }

    /// Executes a request.
    ///
    /// # Errors
    /// Returns why the request is refused. Nothing has changed then.
    pub fn receive(&mut self, request: &ToPin) -> Result<Reply, Nack> {
        match *request {
            ToPin::SetOutput { pin, .. } if !self.is_output(pin) => return Err(Nack::not_an_output(pin)),
            ToPin::SetOutput { pin, high } => {
                set_bit(&mut self.lines.levels, pin, high);
                set_bit(&mut self.lines.driven, pin, true);
            }
            ToPin::SetOutputs { .. } if self.outputs == 0 => return Err(Nack::NO_OUTPUT),
            // The levels have bits of inputs too, which have no effect.
            ToPin::SetOutputs { levels } => {
                self.lines = DigitalLines { driven: self.outputs, levels: levels & self.outputs };
            }
            ToPin::SetDirection { pin, output } => {
                if output != self.is_output(pin) {
                    set_bit(&mut self.lines.levels, pin, false);
                }
                set_bit(&mut self.outputs, pin, output);
                set_bit(&mut self.lines.driven, pin, output);
            }
            ToPin::Direction { pin } => return Ok(Reply::data(&self.is_output(pin))),
            ToPin::Input { pin } if self.is_output(pin) => return Err(Nack::not_an_input(pin)),
            ToPin::Input { pin } => return Ok(Reply::data(&(self.sensed & bit(pin) != 0))),
            ToPin::Inputs if self.outputs == u8::MAX => return Err(Nack::NO_INPUT),
            ToPin::Inputs => return Ok(Reply::data(&self.inputs())),
            ToPin::SetPwmPeriod { pwm, period } => self.pwm(pwm)?.period_micros = period,
            ToPin::SetPwmWidth { pwm, width } => self.pwm(pwm)?.width_micros = width,
            ToPin::SetPwmEnable { pwm, on } => self.pwm(pwm)?.on = on,
            ToPin::SetServoPeriod { servo, period } => self.servo(servo)?.period_micros = period.get(),
            ToPin::SetServoWidth { servo, width } => self.servo(servo)?.width_micros = width.get(),
            ToPin::SetServoEnable { servo, on } => self.servo(servo)?.on = on,
            ToPin::SetI2cSpeed { bus, fast } => *self.fast_i2c(bus)? = fast,
            ToPin::PwmPeriod { pwm } => return Ok(Reply::data(&self.pwm(pwm)?.period_micros)),
            ToPin::PwmWidth { pwm } => return Ok(Reply::data(&self.pwm(pwm)?.width_micros)),
            ToPin::PwmEnable { pwm } => return Ok(Reply::data(&self.pwm(pwm)?.on)),
            ToPin::ServoPeriod { servo } => return Ok(Reply::data(&self.servo(servo)?.period_micros)),
            ToPin::ServoWidth { servo } => return Ok(Reply::data(&self.servo(servo)?.width_micros)),
            ToPin::ServoEnable { servo } => return Ok(Reply::data(&self.servo(servo)?.on)),
            ToPin::I2cSpeed { bus } => return Ok(Reply::data(self.fast_i2c(bus)?)),
        }
        Ok(Reply::ACK)
    }

    const fn is_output(&self, pin: Pin) -> bool {
        self.outputs & bit(pin) != 0
    }

    fn pwm(&mut self, output: PwmOutput) -> Result<&mut Pulses, Nack> {
        self.pwm.get_mut(usize::from(output.get())).ok_or(Nack::parameter(0))
    }

    fn servo(&mut self, output: ServoOutput) -> Result<&mut Pulses, Nack> {
        self.servos.get_mut(usize::from(output.get())).ok_or(Nack::parameter(0))
    }

    fn fast_i2c(&mut self, bus: I2cBus) -> Result<&mut bool, Nack> {
        self.fast_i2c.get_mut(usize::from(bus.get())).ok_or(Nack::parameter(0))
    }

    /// Releases all outputs, and switches off PWM and servos.
    pub fn disable(&mut self) {
        self.lines.driven = 0;
        for pulses in self.pwm.iter_mut().chain(&mut self.servos) {
            pulses.on = false;
        }
    }
}

const fn bit(pin: Pin) -> u8 {
    1u8.wrapping_shl(pin.get() as u32)
}

const fn set_bit(bits: &mut u8, pin: Pin, to: bool) {
    *bits = if to { *bits | bit(pin) } else { *bits & !bit(pin) };
}
