//! Requests as text, for error messages.

use motor_hub::protocol::Request;
use motor_hub::protocol::group::ToGroup;
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::record::ToRecord;
use motor_hub::protocol::requests::{BATTERY, Interface, Standard, ToHub};
use motor_hub::protocol::setup::ToSetup;
use motor_hub::protocol::store::ToStore;
use motor_hub::protocol::update::ToUpdate;

/// Text that completes "the hub was asked to".
pub(crate) fn words(request: &Request) -> String {
    match request {
        Request::Standard(request) => standard(request).to_owned(),
        Request::Hub(request) => hub(request).to_owned(),
        Request::Motor(motor, request) => format!("{} motor {motor}", of_motor(request)),
        Request::Setup(motor, ToSetup::SetUp { .. }) => format!("set up motor {motor}"),
        Request::Setup(motor, ToSetup::SetMotion { .. }) => format!("set the motion of motor {motor}"),
        Request::Setup(motor, ToSetup::Motion) => format!("report the motion of motor {motor}"),
        Request::Setup(motor, ToSetup::Identify { .. }) => format!("identify motor {motor}"),
        Request::Setup(motor, ToSetup::Identification) => {
            format!("report the identification of motor {motor}")
        }
        Request::Setup(motor, ToSetup::SetProtection { .. }) => {
            format!("set the protection of motor {motor}")
        }
        Request::Setup(motor, ToSetup::Protection) => format!("report the protection of motor {motor}"),
        Request::Setup(motor, ToSetup::Condition) => format!("report the condition of motor {motor}"),
        Request::Setup(motor, ToSetup::SetTiming { .. }) => {
            format!("set the bridge timing of motor {motor}")
        }
        Request::Setup(motor, ToSetup::Timing) => format!("report the bridge timing of motor {motor}"),
        Request::Setup(motor, ToSetup::Setup) => format!("report the set-up of motor {motor}"),
        Request::Group(motor, ToGroup::Move { .. }) => format!("move motor {motor} and others together"),
        Request::Group(motor, ToGroup::State) => format!("report the group of motor {motor}"),
        Request::Bus => "report its bus".to_owned(),
        Request::Record(ToRecord::Entries { .. }) => "report its record of faults".to_owned(),
        Request::Record(ToRecord::Ticks { number, .. }) => format!("report the ticks of entry {number}"),
        Request::Store(ToStore::Save) => "store its settings".to_owned(),
        Request::Store(ToStore::Load) => "load its stored settings".to_owned(),
        Request::Store(ToStore::Reset) => "reset its settings".to_owned(),
        Request::Store(ToStore::State) => "report its stored settings".to_owned(),
        Request::Report => "report its motors".to_owned(),
        Request::Update(ToUpdate::Begin { .. }) => "accept new firmware".to_owned(),
        Request::Update(ToUpdate::Sign { .. }) => "accept the signature of its new firmware".to_owned(),
        Request::Update(ToUpdate::Chunk { offset, .. }) => {
            format!("accept the firmware's chunk at byte {offset}")
        }
        Request::Update(ToUpdate::Finish) => "check its new firmware".to_owned(),
        Request::Update(ToUpdate::Restart) => "restart with its new firmware".to_owned(),
        Request::Update(ToUpdate::Abandon) => "forget its new firmware".to_owned(),
        Request::Update(ToUpdate::State) => "report its update".to_owned(),
        Request::Pin(request) => format!("execute function {} of its pins", request.number()),
    }
}

const fn standard(request: &Standard) -> &'static str {
    match request {
        Standard::Status { .. } => "report its status",
        Standard::KeepAlive => "keep running",
        Standard::FailSafe => "disable all motors",
        Standard::SetAddress { .. } => "change its address",
        Standard::QueryInterface { interface: Interface::Motors } => {
            "report the numbers of its motor functions"
        }
        Standard::QueryInterface { interface: Interface::Setup } => {
            "report the numbers of its set-up functions"
        }
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
        ToHub::Adc { .. } => "report an analog value",
        ToHub::SetPhoneCharge { .. } => "set its phone charging",
        ToHub::PhoneCharge => "report its phone charging",
        ToHub::LogHint { .. } => "log a hint",
        ToHub::VersionText | ToHub::Version => "report its version",
        ToHub::SetFtdiReset { .. } => "set its USB reset",
        ToHub::FtdiReset => "report its USB reset",
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
