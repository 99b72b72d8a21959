//! Requests in words.

use motor_hub::protocol::Request;
use motor_hub::protocol::group::ToGroup;
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::record::ToRecord;
use motor_hub::protocol::requests::{BATTERY, Interface, Standard, ToHub};
use motor_hub::protocol::setup::ToSetup;
use motor_hub::protocol::store::ToStore;
use motor_hub::protocol::update::ToUpdate;

/// What completes "the hub was asked to".
pub(crate) fn words(request: &Request) -> String {
    match request {
        Request::Standard(request) => standard(request).to_owned(),
        Request::Hub(request) => hub(request).to_owned(),
        Request::Motor(motor, request) => format!("{} motor {motor}", of_motor(request)),
        Request::Setup(motor, ToSetup::SetUp { .. }) => format!("set up motor {motor}"),
        Request::Setup(motor, ToSetup::SetMotion { .. }) => format!("set how motor {motor} moves"),
        Request::Setup(motor, ToSetup::Motion) => format!("tell how motor {motor} moves"),
        Request::Setup(motor, ToSetup::Identify { .. }) => format!("learn how motor {motor} moves"),
        Request::Setup(motor, ToSetup::Identification) => format!("tell what it learned of motor {motor}"),
        Request::Setup(motor, ToSetup::SetProtection { .. }) => format!("set what protects motor {motor}"),
        Request::Setup(motor, ToSetup::Protection) => format!("tell what protects motor {motor}"),
        Request::Setup(motor, ToSetup::Condition) => format!("tell how motor {motor} is"),
        Request::Setup(motor, ToSetup::SetTiming { .. }) => {
            format!("set how the bridge of motor {motor} switches")
        }
        Request::Setup(motor, ToSetup::Timing) => format!("tell how the bridge of motor {motor} switches"),
        Request::Setup(motor, ToSetup::Setup) => format!("tell the set-up of motor {motor}"),
        Request::Group(motor, ToGroup::Move { .. }) => format!("move motor {motor} and others together"),
        Request::Group(motor, ToGroup::State) => format!("tell how far the group of motor {motor} is"),
        Request::Bus => "tell how its bus is".to_owned(),
        Request::Record(ToRecord::Entries { .. }) => "tell what happened".to_owned(),
        Request::Record(ToRecord::Ticks { number, .. }) => format!("tell the ticks of entry {number}"),
        Request::Store(ToStore::Save) => "store its settings".to_owned(),
        Request::Store(ToStore::Load) => "take its settings from where they are stored".to_owned(),
        Request::Store(ToStore::Reset) => "forget its settings".to_owned(),
        Request::Store(ToStore::State) => "tell what it has stored".to_owned(),
        Request::Report => "tell what its motors do".to_owned(),
        Request::Update(ToUpdate::Begin { .. }) => "take new firmware".to_owned(),
        Request::Update(ToUpdate::Sign { .. }) => "take the signature of its new firmware".to_owned(),
        Request::Update(ToUpdate::Chunk { offset, .. }) => {
            format!("take the chunk of its firmware at byte {offset}")
        }
        Request::Update(ToUpdate::Finish) => "check its new firmware".to_owned(),
        Request::Update(ToUpdate::Restart) => "restart with its new firmware".to_owned(),
        Request::Update(ToUpdate::Abandon) => "forget its new firmware".to_owned(),
        Request::Update(ToUpdate::State) => "tell how far its update is".to_owned(),
        Request::Pin(request) => format!("do function {} of its pins", request.number()),
    }
}

const fn standard(request: &Standard) -> &'static str {
    match request {
        Standard::Status { .. } => "tell its status",
        Standard::KeepAlive => "go on",
        Standard::FailSafe => "stop",
        Standard::SetAddress { .. } => "take another address",
        Standard::QueryInterface { interface: Interface::Motors } => "number its motor functions",
        Standard::QueryInterface { interface: Interface::Setup } => "number its set-up functions",
        Standard::SetLedColour { .. } => "set its LED colour",
        Standard::LedColour => "tell its LED colour",
        Standard::SetLedPattern { .. } => "set its LED pattern",
        Standard::LedPattern => "tell its LED pattern",
        Standard::DebugLevel { .. } => "log more or less",
        Standard::Discovery => "say where it is",
    }
}

const fn hub(request: &ToHub) -> &'static str {
    match request {
        ToHub::Bulk => "tell its motors' state",
        ToHub::Adc { channel: BATTERY, .. } => "tell its battery voltage",
        ToHub::Adc { .. } => "tell what its converter measures",
        ToHub::SetPhoneCharge { .. } => "set its phone charging",
        ToHub::PhoneCharge => "tell its phone charging",
        ToHub::LogHint { .. } => "log a hint",
        ToHub::VersionText | ToHub::Version => "tell its version",
        ToHub::SetFtdiReset { .. } => "set its USB reset",
        ToHub::FtdiReset => "tell its USB reset",
    }
}

const fn of_motor(request: &ToMotor) -> &'static str {
    match request {
        ToMotor::SetMode { .. } => "set the mode of",
        ToMotor::Mode => "tell the mode of",
        ToMotor::SetEnable { on: true } => "enable",
        ToMotor::SetEnable { on: false } => "disable",
        ToMotor::Enable => "tell the enable of",
        ToMotor::SetCurrentAlert { .. } => "set the current alert of",
        ToMotor::CurrentAlert => "tell the current alert of",
        ToMotor::ResetEncoder => "reset the encoder of",
        ToMotor::SetPower { .. } => "set the power of",
        ToMotor::Power => "tell the power of",
        ToMotor::SetVelocity { .. } => "set the target velocity of",
        ToMotor::Velocity => "tell the target velocity of",
        ToMotor::SetPosition { .. } => "set the target position of",
        ToMotor::Position => "tell the target position of",
        ToMotor::AtTarget => "tell the arrival of",
        ToMotor::Encoder => "tell the encoder of",
        ToMotor::SetPid { .. } | ToMotor::SetPidf { .. } => "set the coefficients of",
        ToMotor::Pid { .. } | ToMotor::Pidf { .. } => "tell the coefficients of",
    }
}
