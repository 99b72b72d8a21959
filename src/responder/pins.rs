//! Digital pins, PWM and servo outputs, the speeds of I2C buses.
//!
//! Digital pins are inputs after a reset, pulled up: one that nothing is connected to reads 1, as does one that the board
//! does not have. What is set of such a pin is remembered and read back, and moves nothing; so it is with all PWM and servo
//! outputs and I2C buses, of which a motor hub has none: host software sets them up when it opens a hub.
//!
//! The level of an output is what a host sets, low before that. Fail-safe lets go of all outputs, which stay what they
//! are, until they are set again; it switches PWM and servos off. Of all inputs at once, outputs read 0.
//!
//! ```
//! use motor_hub::protocol::Nack;
//! use motor_hub::protocol::pins::{Pin, ServoOutput, ToPin};
//! use motor_hub::responder::Answer;
//! use motor_hub::responder::pins::PinMemory;
//!
//! let mut pins = PinMemory::default();
//! let servo = ServoOutput::new(5).expect("0 to 5");
//! assert_eq!(pins.receive(&ToPin::SetServoEnable { servo, on: true }), Ok(Answer::Ack));
//! assert!(matches!(pins.receive(&ToPin::ServoEnable { servo }), Ok(Answer::Data(on)) if *on == [1]));
//!
//! let pin = Pin::new(3).expect("0 to 7");
//! assert_eq!(pins.receive(&ToPin::SetOutput { pin, high: true }), Err(Nack(13)));
//! assert!(matches!(pins.receive(&ToPin::Input { pin }), Ok(Answer::Data(level)) if *level == [1]));
//! ```

use super::answer::Answer;
use crate::protocol::Nack;
use crate::protocol::pins::{I2cBus, Pin, PwmOutput, ServoOutput, ToPin};

/// Outputs of each kind.
const PWM: usize = 4;
const SERVOS: usize = 6;
const I2C_BUSES: usize = 4;

#[derive(Clone, Copy, Debug, Default)]
struct Pulses {
    /// In microseconds, as is the width.
    period: u16,
    width: u16,
    on: bool,
}

/// What is to be done to digital pins: bit i is pin i.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DigitalLines {
    /// Those that are driven.
    pub driven: u8,
    /// To which level: 1 is high.
    pub levels: u8,
}

/// What has been set.
#[derive(Clone, Copy, Debug)]
pub struct PinMemory {
    /// Bit i: pin i is an output.
    outputs: u8,
    /// What is done to them: outputs that fail-safe has let go of are not driven.
    lines: DigitalLines,
    /// Bit i: pin i is high, as the board said last.
    sensed: u8,
    pwm: [Pulses; PWM],
    servos: [Pulses; SERVOS],
    /// At 400 kbit/s.
    fast_i2c: [bool; I2C_BUSES],
}

/// After a reset.
impl Default for PinMemory {
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

impl PinMemory {
    /// The levels of all pins, as the board sees them.
    pub const fn sense(&mut self, levels: u8) {
        self.sensed = levels;
    }

    /// What the board is to do to them.
    pub const fn lines(&self) -> DigitalLines {
        self.lines
    }

    /// Levels of the inputs; 0 of outputs.
    pub const fn inputs(&self) -> u8 {
        self.sensed & !self.outputs
    }

    /// Does what a request says.
    ///
    /// # Errors
    /// Why the request is refused; nothing has changed then.
    pub fn receive(&mut self, request: &ToPin) -> Result<Answer, Nack> {
        match *request {
            ToPin::SetOutput { pin, .. } if !self.is_output(pin) => return Err(Nack::not_an_output(pin)),
            ToPin::SetOutput { pin, high } => {
                set_bit(&mut self.lines.levels, pin, high);
                set_bit(&mut self.lines.driven, pin, true);
            }
            ToPin::SetOutputs { .. } if self.outputs == 0 => return Err(Nack::NO_OUTPUT),
            // Bits of inputs mean nothing.
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
            ToPin::Direction { pin } => return Ok(Answer::data(&self.is_output(pin))),
            ToPin::Input { pin } if self.is_output(pin) => return Err(Nack::not_an_input(pin)),
            ToPin::Input { pin } => return Ok(Answer::data(&(self.sensed & bit(pin) != 0))),
            ToPin::Inputs if self.outputs == u8::MAX => return Err(Nack::NO_INPUT),
            ToPin::Inputs => return Ok(Answer::data(&self.inputs())),
            ToPin::SetPwmPeriod { pwm, period } => self.pwm(pwm)?.period = period,
            ToPin::SetPwmWidth { pwm, width } => self.pwm(pwm)?.width = width,
            ToPin::SetPwmEnable { pwm, on } => self.pwm(pwm)?.on = on,
            ToPin::SetServoPeriod { servo, period } => self.servo(servo)?.period = period.get(),
            ToPin::SetServoWidth { servo, width } => self.servo(servo)?.width = width.get(),
            ToPin::SetServoEnable { servo, on } => self.servo(servo)?.on = on,
            ToPin::SetI2cSpeed { bus, fast } => *self.fast_i2c(bus)? = fast,
            ToPin::PwmPeriod { pwm } => return Ok(Answer::data(&self.pwm(pwm)?.period)),
            ToPin::PwmWidth { pwm } => return Ok(Answer::data(&self.pwm(pwm)?.width)),
            ToPin::PwmEnable { pwm } => return Ok(Answer::data(&self.pwm(pwm)?.on)),
            ToPin::ServoPeriod { servo } => return Ok(Answer::data(&self.servo(servo)?.period)),
            ToPin::ServoWidth { servo } => return Ok(Answer::data(&self.servo(servo)?.width)),
            ToPin::ServoEnable { servo } => return Ok(Answer::data(&self.servo(servo)?.on)),
            ToPin::I2cSpeed { bus } => return Ok(Answer::data(self.fast_i2c(bus)?)),
        }
        Ok(Answer::Ack)
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

    /// Fail-safe: nothing is enabled, and no pin is driven.
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
