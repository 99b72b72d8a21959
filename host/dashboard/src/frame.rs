//! What pages are told: JSON objects with a `kind`. Shares of full control and of full duty are from -1 to 1, everything
//! else has its unit in its name or is in counts and seconds.

use crate::world::WorldIs;
use motor_hub::braking::{DutyRule, Regime, Scheme};
use motor_hub::model::catalogue::motors;
use motor_hub::motion::Pidf;
use motor_hub::protocol::report::{HubReport, MotorReport, Told};
use motor_hub::protocol::setup::{Motion, Setup};
use motor_hub::regulator::Kind;
use motor_hub::regulator::identify::Identified;
use motor_hub::supply::BusState;
use motor_hub::units::{Acceleration, Control, Milliamperes};
use motor_hub_client::why::why_still;
use serde::Serialize;
use simulated::scheme::SchemeWords;
use tungstenite::Utf8Bytes;

/// Everything that a page may be told.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum Message {
    /// Once, when it comes.
    Welcome(Welcome),
    /// Fifty times a second.
    Frame(Frame),
    /// When it changes.
    Settings(SettingsOf),
    /// When it changes.
    Desk {
        /// The number of the page in control.
        controller: Option<u32>,
        /// How many there are.
        pages: usize,
    },
    /// When it changes: whether the hub answers, and in words why not.
    Line {
        /// It does.
        connected: bool,
        /// Why it does not.
        why: String,
        /// It tells everything at once.
        reports: bool,
        /// It can store its settings.
        stores: bool,
    },
    /// Something that somebody should read.
    Notice {
        /// In words.
        text: String,
        /// Motors were switched off for it.
        grave: bool,
    },
    /// An order was not carried out.
    Refused {
        /// In words.
        why: String,
    },
    /// What comes of an identification.
    Identification(Learned),
    /// When it changes, of a simulated hub.
    World(WorldIs),
}

/// What a page is told first.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Welcome {
    /// The page's own number.
    pub(crate) you: u32,
    /// Where the hub is.
    pub(crate) place: String,
    /// It is a simulated one.
    pub(crate) simulated: bool,
    /// Its scenario can be played.
    pub(crate) playable: bool,
    /// Motors that may be connected.
    pub(crate) catalogue: Vec<Known>,
}

/// A motor of the catalogue.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Known {
    name: &'static str,
    /// Of the output shaft.
    counts_per_turn: f64,
    /// In counts/s at 12 V.
    free_cps: f64,
    emf_mv_s_per_count: f64,
    resistance_ohm: f64,
}

/// What the hub does at one instant.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Frame {
    /// Of the frame, from 1; a page returns it.
    pub(crate) number: u64,
    /// Since the server's start.
    pub(crate) at_s: f64,
    /// Since the hub's, of its control tick.
    pub(crate) tick_ms: u32,
    /// Nothing if it is unknown.
    pub(crate) battery_v: Option<f64>,
    /// In one word; nothing of a hub that does not tell.
    pub(crate) bus: Option<&'static str>,
    /// How far braking motors burn what they would return, 0 to 1.
    pub(crate) burning: f64,
    /// By motor.
    pub(crate) motors: Vec<OfMotor>,
}

/// What a motor does. What a hub does not tell is left out.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct OfMotor {
    /// In one word.
    pub(crate) told: &'static str,
    /// Share, counts/s or counts; nothing if there is none.
    pub(crate) target: Option<f64>,
    /// Counts.
    pub(crate) position: i32,
    /// Counts per second.
    pub(crate) velocity: i16,
    /// It may run.
    pub(crate) enabled: bool,
    /// It is where it should be.
    pub(crate) at_target: bool,
    /// Why it stands.
    pub(crate) why: Option<&'static str>,
    /// The rest.
    #[serde(flatten)]
    pub(crate) more: Option<More>,
}

/// What hubs of this project tell beside what all do.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct More {
    regulator: &'static str,
    control: f64,
    regime: Option<&'static str>,
    mode: &'static str,
    duty: f64,
    current_a: f64,
    measured_a: Option<f64>,
    load_a: Option<f64>,
    heat: f64,
    stalled: bool,
    derated: bool,
    fault: bool,
    /// S, T, Z and G.
    points: Option<[f64; 4]>,
}

/// How a motor is set.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SettingsOf {
    /// 0 to 3.
    pub(crate) motor: usize,
    /// By the catalogue, if it is one of them.
    pub(crate) name: Option<&'static str>,
    /// Of the output shaft, of such a one.
    pub(crate) counts_per_turn: Option<f64>,
    emf_mv_s_per_count: f64,
    resistance_ohm: Option<f64>,
    scheme: SchemeWords,
    duty: &'static str,
    dynamics: Option<Dynamics>,
    acceleration: Option<u32>,
    velocity: [f64; 4],
    position: [f64; 4],
    /// Changes that can be taken back.
    pub(crate) undoable: usize,
}

/// How a motor answers to a voltage.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Dynamics {
    /// In counts/s² per volt.
    gain: f64,
    /// In 1/s.
    decay: f64,
    /// In volts.
    friction_v: f64,
}

/// What comes of an identification.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Learned {
    /// 0 to 3.
    pub(crate) motor: u8,
    /// `running`, `found` or `refused`.
    pub(crate) state: &'static str,
    /// Of a running one, 0 to 100.
    pub(crate) percent: Option<u8>,
    /// Of a refused one.
    pub(crate) why: Option<String>,
    /// Of one that was found.
    pub(crate) found: Option<Found>,
}

/// What was found.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Found {
    #[serde(flatten)]
    dynamics: Dynamics,
    /// In mV s/count, with drag.
    emf_mv_s_per_count: f64,
    /// Standard errors, in shares.
    gain_error: f64,
    decay_error: f64,
    /// What is left of the changes of speed, in shares of them.
    residual: f64,
}

impl Message {
    /// As it goes over a socket.
    #[must_use]
    pub(crate) fn text(&self) -> Utf8Bytes {
        // Plain data, which always can be written.
        serde_json::to_string(self).unwrap_or_default().into()
    }
}

/// An order was not carried out.
#[must_use]
pub(crate) fn refused(why: &str) -> Utf8Bytes {
    Message::Refused { why: why.to_owned() }.text()
}

impl Welcome {
    /// With all motors of the catalogue.
    #[must_use]
    pub(crate) fn new(you: u32, place: &str, simulated: bool, playable: bool) -> Self {
        let known = motors().map(|motor| Known {
            name: motor.name,
            counts_per_turn: motor.counts_per_rev_output(),
            free_cps: 12_000.0 / motor.ke_fw(),
            emf_mv_s_per_count: motor.ke_fw(),
            resistance_ohm: motor.r.0,
        });
        Self { you, place: place.to_owned(), simulated, playable, catalogue: known.collect() }
    }
}

impl Frame {
    /// Of a hub that tells everything at once.
    #[must_use]
    pub(crate) fn of(report: &HubReport) -> Self {
        let motors = report.motors.iter().enumerate();
        Self {
            tick_ms: report.at_ms,
            battery_v: report.battery.map(|mv| f64::from(mv.get()) / 1e3),
            bus: Some(bus_word(report.bus)),
            burning: f64::from(report.burning) / 1e3,
            motors: motors.map(|(index, motor)| OfMotor::of(motor, why_still(report, index))).collect(),
            ..Self::default()
        }
    }
}

impl OfMotor {
    fn of(motor: &MotorReport, why: Option<&'static str>) -> Self {
        let (told, target) = match motor.told {
            Told::Off => ("off", None),
            Told::FailSafe => ("fail-safe", None),
            Told::Power(control) => ("power", Some(share(control))),
            Told::Velocity(cps) => ("velocity", Some(cps.into())),
            Told::Position(counts) => ("position", Some(counts.into())),
            Told::Together(counts) => ("together", Some(counts.into())),
            Told::Identify(_) => ("identify", None),
        };
        let MotorReport { position, velocity, enabled, at_target, .. } = *motor;
        Self { told, target, position, velocity, enabled, at_target, why, more: Some(More::of(motor)) }
    }
}

impl More {
    fn of(motor: &MotorReport) -> Self {
        let regime = motor.regime.map(|regime| match regime {
            Regime::Reverse => "reverse",
            Regime::Braking => "braking",
            Regime::Forward => "forward",
        });
        let regulator = match motor.regulator {
            Kind::Model => "model",
            Kind::Pid => "pid",
        };
        Self {
            regulator,
            control: share(motor.control),
            regime,
            mode: motor.drive.mode.name(),
            duty: motor.drive.duty.to_f64(),
            current_a: amperes(motor.current),
            measured_a: motor.measured_ma.map(|ma| f64::from(ma) / 1e3),
            load_a: motor.load.map(amperes),
            heat: f64::from(motor.heat) / 1e3,
            stalled: motor.stalled,
            derated: motor.derated,
            fault: motor.faults.any() && motor.enabled,
            points: motor.points.map(|points| points.map(share)),
        }
    }
}

impl SettingsOf {
    /// As the hub has them.
    #[must_use]
    pub(crate) fn new(
        motor: usize,
        setup: &Setup,
        motion: &Motion,
        loops: [Pidf; 2],
        undoable: usize,
    ) -> Self {
        let emf = f64::from(setup.emf.to_bits()) / f64::from(1 << 20);
        let resistance_ohm = setup.resistance.map(|resistance| f64::from(resistance.as_milliohms()) / 1e3);
        let known = resistance_ohm.and_then(|ohms| {
            motors().find(|known| (known.ke_fw() - emf).abs() < 1e-3 * emf && (known.r.0 - ohms).abs() < 2e-3)
        });
        let [velocity, position] = loops.map(|Pidf { p, i, d, f }| {
            [p, i, d, f].map(|coefficient| f64::from(coefficient.to_bits()) / f64::from(1 << 16))
        });
        Self {
            motor,
            name: known.map(|known| known.name),
            counts_per_turn: known.map(|known| known.counts_per_rev_output()),
            emf_mv_s_per_count: emf,
            resistance_ohm,
            scheme: SchemeWords(setup.scheme),
            duty: match setup.duty {
                DutyRule::LinearDuty => "linear-duty",
                DutyRule::LinearCurrent => "linear-current",
            },
            dynamics: motion.dynamics.map(Dynamics::of),
            acceleration: motion.acceleration.map(Acceleration::get),
            velocity,
            position,
            undoable,
        }
    }
}

impl Dynamics {
    fn of(known: motor_hub::regulator::Dynamics) -> Self {
        Self {
            gain: known.gain.to_f32().into(),
            decay: known.decay.to_f32().into(),
            friction_v: f64::from(known.friction.get()) / 1e3,
        }
    }
}

impl Found {
    pub(crate) fn of(found: &Identified) -> Self {
        Self {
            dynamics: Dynamics::of(found.dynamics),
            emf_mv_s_per_count: f64::from(found.emf.to_bits()) / f64::from(1 << 20),
            gain_error: f64::from(found.gain_error) / 1e3,
            decay_error: f64::from(found.decay_error) / 1e3,
            residual: f64::from(found.residual) / 1e3,
        }
    }
}

const fn bus_word(bus: BusState) -> &'static str {
    match bus {
        BusState::Silent => "silent",
        BusState::TooLow => "too low",
        BusState::Cut => "cut",
        BusState::Derated => "derated",
        BusState::Quiet => "quiet",
        BusState::Burning => "burning",
        BusState::TooHigh => "too high",
    }
}

/// -1 to 1.
fn share(control: Control) -> f64 {
    f64::from(control.get()) / f64::from(Control::MAX.get())
}

fn amperes(current: Milliamperes) -> f64 {
    f64::from(current.get()) / 1e3
}

/// Of a scheme, by its name.
pub(crate) fn scheme(name: &str) -> Result<Scheme, String> {
    let name: simulated::scheme::SchemeName =
        name.parse().map_err(|error: simulated::scheme::UnknownScheme| error.to_string())?;
    name.with_blend(None).map_err(|error| error.to_string())
}
