//! Requests as text, for error messages.

use motor_hub::extension::settings::Group;
use motor_hub::extension::{HubFunction, INTERFACE, MotorFunction, Request};
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::pins::ToPin;
use motor_hub::protocol::requests::{BATTERY, Standard, ToHub};

/// Text that completes "the hub was asked to".
pub(crate) fn text(request: &Request) -> String {
    match request {
        Request::Standard(request) => standard(request).to_owned(),
        Request::ToHub(request) => hub(request).to_owned(),
        Request::ToMotor(motor, request) => format!("{} motor {motor}", of_motor(request)),
        Request::ToPin(request) => of_pin(request),
        Request::Set(motor, values) => format!("set the {} of motor {motor}", of_group(values.group())),
        Request::Get(motor, group) => format!("report the {} of motor {motor}", of_group(*group)),
        Request::Motor(motor, MotorFunction::Identify { .. }) => format!("identify motor {motor}"),
        Request::Motor(motor, MotorFunction::Identification) => {
            format!("report the identification of motor {motor}")
        }
        Request::Motor(motor, MotorFunction::Current { .. }) => {
            format!("give motor {motor} a constant current")
        }
        Request::Motor(motor, MotorFunction::Condition) => format!("report the condition of motor {motor}"),
        Request::Motor(motor, MotorFunction::Move { .. }) => {
            format!("move motor {motor} and others together")
        }
        Request::Motor(motor, MotorFunction::Group) => format!("report the group of motor {motor}"),
        Request::Hub(HubFunction::Ticks { number, .. }) => format!("report the ticks of entry {number}"),
        Request::Hub(HubFunction::Chunk { offset, .. }) => {
            format!("accept the firmware's chunk at byte {offset}")
        }
        Request::Hub(function) => of_hub(function).to_owned(),
    }
}

/// Name of a group of settings.
#[must_use]
pub const fn of_group(group: Group) -> &'static str {
    match group {
        Group::SetUp => "set-up",
        Group::Timing => "bridge timing",
        Group::Protection => "protection",
        Group::CurrentLimit => "current limit",
        Group::Motion => "motion",
        Group::Mode => "mode",
        Group::CurrentAlert => "current alert",
        Group::VelocityLoop | Group::PositionLoop => "coefficients",
    }
}

const fn of_hub(function: &HubFunction) -> &'static str {
    match function {
        HubFunction::Bus => "report its bus",
        HubFunction::Entries { .. } | HubFunction::Ticks { .. } => "report its record of faults",
        HubFunction::Save => "store its settings",
        HubFunction::Load => "load its stored settings",
        HubFunction::Reset => "reset its settings",
        HubFunction::Stored => "report its stored settings",
        HubFunction::Report => "report its motors",
        HubFunction::BeginUpdate { .. } | HubFunction::Chunk { .. } => "accept new firmware",
        HubFunction::Sign { .. } => "accept the signature of its new firmware",
        HubFunction::FinishUpdate => "check its new firmware",
        HubFunction::Restart => "restart with its new firmware",
        HubFunction::AbandonUpdate => "forget its new firmware",
        HubFunction::Update => "report its update",
        HubFunction::Equipment => "report its equipment",
        HubFunction::Chain => "report the hubs behind it",
        HubFunction::SetBase { .. } => "configure its drive base",
        HubFunction::Base => "report the settings of its drive base",
        HubFunction::Odometry => "report where its drive base is",
    }
}

fn standard(request: &Standard) -> &'static str {
    match request {
        Standard::Status { .. } => "report its status",
        Standard::KeepAlive => "keep running",
        Standard::FailSafe => "disable all motors",
        Standard::SetAddress { .. } => "change its address",
        Standard::QueryInterface { name } if name == INTERFACE => "report the numbers of its own functions",
        Standard::QueryInterface { .. } => "report the numbers of its motor functions",
        Standard::SetLedColour { .. } => "set its LED colour",
        Standard::LedColour => "report its LED colour",
        Standard::SetLedPattern { .. } => "set its LED pattern",
        Standard::LedPattern => "report its LED pattern",
        Standard::DebugLevel { .. } => "set its log level",
        Standard::Discovery => "answer a discovery",
    }
}

const fn hub(request: &ToHub) -> &'static str {
    match request {
        ToHub::Bulk => "report its motors' state",
        ToHub::Adc { channel: BATTERY, .. } => "report its battery voltage",
        ToHub::Adc { .. } => "report this analog value",
        ToHub::SetPhoneCharge { .. } => "set its phone charging",
        ToHub::PhoneCharge => "report its phone charging",
        ToHub::LogHint { .. } => "log a hint",
        ToHub::VersionText | ToHub::Version => "report its version",
        ToHub::SetFtdiReset { .. } => "set its USB reset",
        ToHub::FtdiReset => "report its USB reset",
    }
}

fn of_pin(request: &ToPin) -> String {
    match request {
        ToPin::SetOutput { pin, .. } => format!("set digital pin {}", pin.get()),
        ToPin::SetOutputs { .. } => "set its digital outputs".to_owned(),
        ToPin::SetDirection { pin, .. } => format!("set the direction of digital pin {}", pin.get()),
        ToPin::Direction { pin } => format!("report the direction of digital pin {}", pin.get()),
        ToPin::Input { pin } => format!("read digital pin {}", pin.get()),
        ToPin::Inputs => "read its digital inputs".to_owned(),
        ToPin::SetServoPeriod { servo, .. } => format!("set the period of servo {}", servo.get()),
        ToPin::SetServoWidth { servo, .. } => format!("set the pulse of servo {}", servo.get()),
        ToPin::SetServoEnable { servo, on: true } => format!("enable servo {}", servo.get()),
        ToPin::SetServoEnable { servo, on: false } => format!("disable servo {}", servo.get()),
        ToPin::ServoPeriod { servo } | ToPin::ServoWidth { servo } | ToPin::ServoEnable { servo } => {
            format!("report servo {}", servo.get())
        }
        ToPin::WriteI2cByte { bus, address, .. } | ToPin::WriteI2c { bus, address, .. } => {
            format!("write to device {:#04x} on I2C bus {}", address.get(), bus.get())
        }
        ToPin::ReadI2cByte { bus, address }
        | ToPin::ReadI2c { bus, address, .. }
        | ToPin::ReadI2cRegister { bus, address, .. } => {
            format!("read device {:#04x} on I2C bus {}", address.get(), bus.get())
        }
        ToPin::PollI2cRead { bus } | ToPin::PollI2cWrite { bus } => {
            format!("report the transfer on I2C bus {}", bus.get())
        }
        ToPin::SetI2cSpeed { bus, .. } => format!("set the speed of I2C bus {}", bus.get()),
        ToPin::I2cSpeed { bus } => format!("report the speed of I2C bus {}", bus.get()),
    }
}

const fn of_motor(request: &ToMotor) -> &'static str {
    match request {
        ToMotor::SetMode { .. } => "set the mode of",
        ToMotor::Mode => "report the mode of",
        ToMotor::SetEnable { on: true } => "enable",
        ToMotor::SetEnable { on: false } => "disable",
        ToMotor::Enable => "report the enable of",
        ToMotor::SetCurrentAlert { .. } => "set the current alert of",
        ToMotor::CurrentAlert => "report the current alert of",
        ToMotor::ResetEncoder => "reset the encoder of",
        ToMotor::SetPower { .. } => "set the power of",
        ToMotor::Power => "report the power of",
        ToMotor::SetVelocity { .. } => "set the target velocity of",
        ToMotor::Velocity => "report the target velocity of",
        ToMotor::SetPosition { .. } => "set the target position of",
        ToMotor::Position => "report the target position of",
        ToMotor::AtTarget => "report the at-target state of",
        ToMotor::Encoder => "report the encoder of",
        ToMotor::SetPid { .. } | ToMotor::SetPidf { .. } => "set the coefficients of",
        ToMotor::Pid { .. } | ToMotor::Pidf { .. } => "report the coefficients of",
    }
}
