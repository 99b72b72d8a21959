//! The columns of the fault matrix: the modes in which the four motors run when a fault occurs.

use std::ops::RangeInclusive;

use emulated::host_link::{HostLink, Line};
use emulated::{Board, ChainBench, Mounting};
use motor_hub::braking::Winding;
use motor_hub::extension::settings::Group;
use motor_hub::model::load::Load;
use motor_hub::model::si::KgM2;
use motor_hub::motor::{OnFault, Settings};

use crate::common::{am60_with, ms};
use crate::recording::dynamics;

/// The modes of the four motors, in the order of the motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    OpenLoop,
    Velocity,
    /// The motor moves to a distant position at a limited speed.
    Position,
    /// A load drives the motor in its direction, and regulation of the velocity brakes it.
    Braking,
}

pub(crate) const MODES: [Mode; 4] = [Mode::OpenLoop, Mode::Velocity, Mode::Position, Mode::Braking];

/// Torque of the load in mode `Braking`, N m at the output shaft.
const OVERHAULING: f64 = 0.8;
const SPEED: i16 = 1000;
const LOWERING: i16 = 300;
const POWER: i16 = 12_000;

/// How the motors are set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Setup {
    /// Only the winding is configured, and a motor coasts after a fault.
    AsTheyCome,
    /// The dynamics are configured too, and a motor brakes after a fault.
    ConfiguredBraking,
}

impl Setup {
    /// Sends the settings of a motor, which the hub loses at a reset.
    fn apply(self, line: &mut impl Line, host: &mut HostLink, motor: u8) {
        if self == Self::AsTheyCome {
            return;
        }
        let mut settings = Settings::new(Winding::NEVEREST_60);
        settings.dynamics = Some(dynamics(&wheel(), &settings));
        settings.on_fault = OnFault::Brake;
        for group in [Group::Motion, Group::Protection] {
            host.set(line, motor, group, settings);
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

    /// Starts a motor in this mode.
    pub(crate) fn start(self, setup: Setup, line: &mut impl Line, host: &mut HostLink) {
        let motor = self as u8;
        setup.apply(line, host, motor);
        match self {
            Self::OpenLoop => host.power(line, motor, POWER),
            Self::Velocity => host.velocity(line, motor, SPEED),
            Self::Position => host.position(line, motor, 1_000_000, 10, SPEED),
            Self::Braking => host.velocity(line, motor, LOWERING),
        }
    }

    /// Returns the range of speeds of a motor that follows its command, counts/s.
    pub(crate) const fn speeds(self) -> RangeInclusive<f64> {
        match self {
            // Some 908 counts/s. When other motors accelerate, the battery's voltage falls, and with it this speed.
            Self::OpenLoop => 880.0..=1250.0,
            Self::Velocity => 960.0..=1040.0,
            Self::Position => 940.0..=1060.0,
            Self::Braking => 240.0..=360.0,
        }
    }
}

/// Powers on hubs on these boards. The four motors of a hub have light wheels, with a torque on the wheel of the last motor.
pub(crate) fn powered(boards: &[Board]) -> ChainBench {
    let setup = |&board| emulated::Setup { board, ..emulated::Setup::new(vec![wheel(); MODES.len()]) };
    let mut chain = ChainBench::new(boards.iter().map(setup).collect());
    chain.run(ms(300));
    chain.hubs.iter_mut().for_each(|hub| hub.set_torque(Mode::Braking.motor(), OVERHAULING));
    chain
}

fn wheel() -> Mounting {
    am60_with(Load::inertia(KgM2(0.004)))
}
