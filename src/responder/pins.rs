//! Digital pins, PWM and servo outputs. A motor hub has none, but host software sets them up when it
//! opens a hub: what is set is remembered and read back, and moves nothing. Inputs read 0.
//!
//! ```
//! use motor_hub::protocol::pins::{ServoOutput, ToPin};
//! use motor_hub::responder::Answer;
//! use motor_hub::responder::pins::PinMemory;
//!
//! let mut pins = PinMemory::default();
//! let servo = ServoOutput::new(5).expect("0 to 5");
//! assert_eq!(pins.receive(&ToPin::SetServoEnable { servo, on: true }), Ok(Answer::Ack));
//! assert!(matches!(pins.receive(&ToPin::ServoEnable { servo }), Ok(Answer::Data(on)) if *on == [1]));
//! ```

use super::answer::Answer;
use crate::protocol::Nack;
use crate::protocol::pins::{Pin, PwmOutput, ServoOutput, ToPin};

/// Outputs of each kind.
const PWM: usize = 4;
const SERVOS: usize = 6;

#[derive(Clone, Copy, Debug, Default)]
struct Pulses {
    /// In microseconds, as is the width.
    period: u16,
    width: u16,
    on: bool,
}

/// What has been set.
#[derive(Clone, Copy, Debug, Default)]
pub struct PinMemory {
    /// Bit i: pin i is an output.
    outputs: u8,
    /// Bit i: output i is high. Nothing reads it back.
    levels: u8,
    pwm: [Pulses; PWM],
    servos: [Pulses; SERVOS],
}

impl PinMemory {
    /// Does what a request says.
    ///
    /// # Errors
    /// Why the request is refused; nothing has changed then.
    pub fn receive(&mut self, request: &ToPin) -> Result<Answer, Nack> {
        match *request {
            ToPin::SetOutput { pin, high } => set_bit(&mut self.levels, pin, high),
            ToPin::SetOutputs { levels: all } => self.levels = all,
            ToPin::SetDirection { pin, output } => set_bit(&mut self.outputs, pin, output),
            ToPin::Direction { pin } => return Ok(Answer::data(&(self.outputs & bit(pin) != 0))),
            ToPin::Input { .. } | ToPin::Inputs => return Ok(Answer::data(&0u8)),
            ToPin::SetPwmPeriod { pwm, period } => self.pwm(pwm)?.period = period,
            ToPin::SetPwmWidth { pwm, width } => self.pwm(pwm)?.width = width,
            ToPin::SetPwmEnable { pwm, on } => self.pwm(pwm)?.on = on,
            ToPin::SetServoPeriod { servo, period } => self.servo(servo)?.period = period.get(),
            ToPin::SetServoWidth { servo, width } => self.servo(servo)?.width = width.get(),
            ToPin::SetServoEnable { servo, on } => self.servo(servo)?.on = on,
            ToPin::PwmPeriod { pwm } => return Ok(Answer::data(&self.pwm(pwm)?.period)),
            ToPin::PwmWidth { pwm } => return Ok(Answer::data(&self.pwm(pwm)?.width)),
            ToPin::PwmEnable { pwm } => return Ok(Answer::data(&self.pwm(pwm)?.on)),
            ToPin::ServoPeriod { servo } => return Ok(Answer::data(&self.servo(servo)?.period)),
            ToPin::ServoWidth { servo } => return Ok(Answer::data(&self.servo(servo)?.width)),
            ToPin::ServoEnable { servo } => return Ok(Answer::data(&self.servo(servo)?.on)),
        }
        Ok(Answer::Ack)
    }

    fn pwm(&mut self, output: PwmOutput) -> Result<&mut Pulses, Nack> {
        self.pwm.get_mut(usize::from(output.get())).ok_or(Nack::parameter(0))
    }

    fn servo(&mut self, output: ServoOutput) -> Result<&mut Pulses, Nack> {
        self.servos.get_mut(usize::from(output.get())).ok_or(Nack::parameter(0))
    }

    /// Fail-safe: nothing is enabled.
    pub fn disable(&mut self) {
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
