//! What the four motors do when something fails: the columns.

use std::ops::RangeInclusive;

use emulated::host_link::HostLink;
use emulated::{Bench, Mounting, recording};
use motor_hub::braking::Winding;
use motor_hub::extension::Request;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::model::load::Load;
use motor_hub::model::si::KgM2;
use motor_hub::motor::{OnFault, Settings};

use crate::common::am60_with;

/// One to a motor, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    OpenLoop,
    Velocity,
    /// On a long way at limited speed.
    Position,
    /// A load drives the motor the way it turns, and is slowed down.
    Braking,
}

pub(crate) const MODES: [Mode; 4] = [Mode::OpenLoop, Mode::Velocity, Mode::Position, Mode::Braking];

/// N m at the output shaft: a fifth of what stalls the motor.
const OVERHAULING: f64 = 0.8;
const SPEED: i16 = 1000;
const LOWERING: i16 = 300;
const POWER: i16 = 12_000;

/// How the motors are set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Setup {
    /// As they come: not configured but for the winding, and a fault lets a motor coast.
    AsTheyCome,
    /// The dynamics are configured, and a fault has a motor brake.
    ConfiguredBraking,
}

impl Setup {
    /// Sets a motor up, which a reset forgets.
    fn apply(self, bench: &mut Bench, host: &mut HostLink, motor: u8) {
        if self == Self::AsTheyCome {
            return;
        }
        let mut settings = Settings::new(Winding::NEVEREST_60);
        settings.dynamics = Some(recording::dynamics(&wheel(), &settings).expect("a motor's constants"));
        settings.on_fault = OnFault::Brake;
        for group in [Group::Motion, Group::Protection] {
            let values = Values::of(group, &MotorSettings::new(settings));
            host.order(bench, Request::Set(motor, values));
        }
    }
}

impl Mode {
    pub(crate) const fn motor(self) -> usize {
        self as usize
    }

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::OpenLoop => "open loop",
            Self::Velocity => "velocity",
            Self::Position => "position",
            Self::Braking => "braking a load",
        }
    }

    /// Sets a motor going.
    pub(crate) fn start(self, setup: Setup, bench: &mut Bench, host: &mut HostLink) {
        let motor = self as u8;
        setup.apply(bench, host, motor);
        match self {
            Self::OpenLoop => host.power(bench, motor, POWER),
            Self::Velocity => host.velocity(bench, motor, SPEED),
            Self::Position => host.position(bench, motor, 1_000_000, 10, SPEED),
            Self::Braking => host.velocity(bench, motor, LOWERING),
        }
    }

    /// Counts/s of a motor that follows its command.
    pub(crate) const fn speeds(self) -> RangeInclusive<f64> {
        match self {
            Self::OpenLoop => 900.0..=1250.0,
            Self::Velocity => 960.0..=1040.0,
            Self::Position => 940.0..=1060.0,
            Self::Braking => 240.0..=360.0,
        }
    }
}

/// Powered on, with four light wheels and a load that turns the last.
pub(crate) fn powered() -> Bench {
    let mut bench = crate::common::booted(vec![wheel(); MODES.len()]);
    bench.set_torque(Mode::Braking.motor(), OVERHAULING);
    bench
}

fn wheel() -> Mounting {
    am60_with(Load::inertia(KgM2(0.004)))
}
