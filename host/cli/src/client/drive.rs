//! `motor-hub client power`, `current`, `velocity` and `position`: motors run while the command runs.

use super::hub::HubOptions;
use super::motion::{Motion, Progress};
use super::motors_off::DrivingSession;
use super::readings::{Live, Reading, repeat};
use super::shaft_speed::{ShaftOptions, Speed};
use crate::output::{Failure, print};
use crate::parse::{MotorName, address, common_hub, motor, share, whole, within_a_day};
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::Address;
use motor_hub::units::Control;
use motor_hub_client::Session;
use motor_hub_client::motor::{NO_SPEED_LIMIT_CPS, SPEED_LIMITS_CPS, Setpoint, constant_current_ma};
use std::collections::BTreeSet;
use std::time::Duration;

/// Numbers of all motors that the protocol supports.
pub(crate) const ALL: [u8; motor_hub::protocol::CHANNELS] = [0, 1, 2, 3];

/// Interval between readings, far shorter than the hub's keep-alive of 2.5 s.
pub(crate) const INTERVAL: Duration = Duration::from_millis(100);

/// Options of all four commands.
#[derive(clap::Args)]
pub(crate) struct Common {
    /// Motor 0 to 3, several as 0,2, or all; of another hub of a chain as 3:0 or 3:all
    #[arg(value_name = "MOTOR", value_parser = motors)]
    motors: Motors,
    /// Longest duration in seconds [default: no limit]
    #[arg(long = "for-s", alias = "for", value_name = "S", value_parser = within_a_day)]
    length: Option<Duration>,
    /// Motors float at zero [default: they brake]
    #[arg(long)]
    float: bool,
    #[command(flatten)]
    shaft: ShaftOptions,
}

/// Motors of one hub.
#[derive(Clone)]
struct Motors {
    hub: Option<Address>,
    numbers: Vec<u8>,
}

fn motors(text: &str) -> Result<Motors, String> {
    if text.eq_ignore_ascii_case("all") {
        return Ok(Motors { hub: None, numbers: ALL.to_vec() });
    }
    if let Some((hub, "all")) = text.split_once(':') {
        return Ok(Motors { hub: Some(address(hub)?), numbers: ALL.to_vec() });
    }
    let names: Vec<MotorName> = text
        .split(',')
        .map(motor)
        .collect::<Result<_, _>>()
        .map_err(|why| format!("{why}; several motors are given as 0,2, all motors as all"))?;
    let hub = common_hub(names.iter().copied())?;
    let numbers: BTreeSet<u8> = names.iter().map(|name| name.number).collect();
    Ok(Motors { hub, numbers: numbers.into_iter().collect() })
}

fn power(text: &str) -> Result<Control, &'static str> {
    share(text).ok_or("a power is a share of full power, -1 to 1")
}

/// Parses amperes, and returns milliamperes.
fn milliamperes(text: &str) -> Result<i32, String> {
    let amperes = text.parse().map_err(|_| "a current is a number of amperes")?;
    constant_current_ma(amperes).map_err(|error| error.to_string())
}

/// The commands that make motors turn.
#[derive(clap::Subcommand)]
pub(crate) enum Drive {
    /// Runs motors with constant power, then disables them
    Power {
        #[command(flatten)]
        common: Common,
        /// Share of full power, -1 to 1; positive makes the encoder count up
        #[arg(value_name = "VALUE", value_parser = power)]
        value: Control,
    },
    /// Runs motors with a constant current, which is a constant torque, then disables them, on hubs of this project
    Current {
        #[command(flatten)]
        common: Common,
        /// Current in amperes, -65.535 to 65.535; positive makes the encoder count up
        #[arg(value_name = "AMPERES", value_parser = milliamperes)]
        ma: i32,
        /// Speed in counts per second at which the current decreases, so that the motor becomes no faster; 32767 for no limit
        #[arg(long = "speed-limit-cps", value_name = "CPS", default_value_t = NO_SPEED_LIMIT_CPS)]
        #[arg(value_parser = whole("a speed limit", SPEED_LIMITS_CPS, "counts/s"))]
        speed_limit: u16,
    },
    /// Runs motors with regulated velocity, then disables them
    ///
    /// With --for-s the command fails (exit code 1) if a motor misses the speed at the end. The mean speed over the last
    /// 0.5 s may differ by 5 % of the speed, and always by 40 counts/s.
    Velocity {
        #[command(flatten)]
        common: Common,
        /// Speed in counts per second, -32768 to 32767; or of the output shaft, as 30rpm or 3.1rad/s
        #[arg(value_name = "SPEED", allow_hyphen_values = true)]
        speed: Speed,
    },
    /// Moves motors to a position, then disables them
    ///
    /// The command fails (exit code 1) if the motors make no progress for 5 s, for example because they are held fast.
    Position {
        #[command(flatten)]
        common: Common,
        /// Target position in counts
        #[arg(value_name = "COUNTS", value_parser = whole("a position", i32::MIN..=i32::MAX, "counts"))]
        counts: i32,
        /// Largest distance to the target, in counts, at which a motor can settle
        #[arg(long = "tolerance-counts", alias = "tolerance", value_name = "COUNTS", default_value_t = 5)]
        #[arg(value_parser = whole("a tolerance", 0..=u16::MAX, "counts"))]
        tolerance: u16,
        /// Speed limit in counts per second, or as 30rpm or 3.1rad/s
        #[arg(long, value_name = "SPEED", default_value = "1000", allow_hyphen_values = true)]
        speed: Speed,
    },
}

impl Drive {
    const fn common(&self) -> &Common {
        match self {
            Self::Power { common, .. }
            | Self::Current { common, .. }
            | Self::Velocity { common, .. }
            | Self::Position { common, .. } => common,
        }
    }

    /// Returns the address of the motors' hub; `None` if the user gives no address.
    pub(super) const fn hub(&self) -> Option<Address> {
        self.common().motors.hub
    }

    /// Returns the requested motion.
    pub(super) fn motion(&self) -> Result<Motion, Failure> {
        let common = self.common();
        let counts_per_turn = common.shaft.counts();
        let setpoint = match *self {
            Self::Power { value, .. } => Setpoint::Power(value),
            Self::Current { ma, speed_limit, .. } => Setpoint::Current { ma, speed_limit },
            Self::Velocity { speed, .. } => Setpoint::Velocity(speed.cps(counts_per_turn)?),
            Self::Position { counts, tolerance, speed, .. } => {
                let speed_limit = speed.cps(counts_per_turn)?;
                if speed_limit < 1 {
                    return Err(Failure::Input(format!(
                        "--speed: {speed_limit} counts/s is out of range; allowed is 1 to {}",
                        i16::MAX
                    )));
                }
                Setpoint::Position { counts, tolerance, speed_limit }
            }
        };
        let zero = if common.float { ZeroPower::Float } else { ZeroPower::Brake };
        let motors = common.motors.numbers.clone();
        Ok(Motion { motors, setpoint, zero, length: common.length, counts_per_turn })
    }

    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let motion = self.motion()?;
        let session = &mut hub.open(self.hub())?;
        let mut progress = Progress::new(&motion, INTERVAL);
        let settled = DrivingSession::run(session, |driven| {
            motion.begin(driven)?;
            let settled =
                follow(driven, &motion.motors, motion.counts_per_turn, motion.length, |session, reading| {
                    motion.check(session)?;
                    progress.observe(reading.at, &reading.bulk, reading.report.as_ref())
                })?;
            if !settled {
                progress.judge()?;
            }
            Ok(settled)
        })?;
        if settled {
            print("settled at the target\n")?;
        }
        Ok(())
    }
}

/// Shows the motors until `settled` returns true or the time is over. Returns true if the motors have settled.
pub(super) fn follow(
    session: &mut Session,
    motors: &[u8],
    counts_per_turn: Option<f64>,
    length: Option<Duration>,
    mut settled: impl FnMut(&mut Session, &Reading) -> Result<bool, Failure>,
) -> Result<bool, Failure> {
    let mut live = Live::new();
    let done = repeat(INTERVAL, length, |since| {
        let reading = &Reading::take(session, since)?;
        live.show(|| reading.table(motors, counts_per_turn), &reading.line(motors, counts_per_turn))?;
        settled(session, reading)
    });
    // The last reading is always printed.
    let shown = live.finish();
    let done = done?;
    shown.map(|()| done)
}
