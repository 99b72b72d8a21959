//! Settings as TOML, read from a hub, and the requests that put them in force again.

use super::super::trouble::Trouble;
use crate::output::Failure;
use motor_hub::braking::{Blend, BlendFraction, DutyRule, Scheme};
use motor_hub::bridge::Timing;
use motor_hub::motion::Pidf;
use motor_hub::motor::{OnFault, ThermalLimit, ZeroPower};
use motor_hub::protocol::motor::{Algorithm, ChannelMode, Coefficients, Loop, RunMode, ToMotor};
use motor_hub::protocol::setup::{Motion, Protection, Setup, ToSetup};
use motor_hub::protocol::{CHANNELS, Request};
use motor_hub::regulator::Dynamics;
use motor_hub::units::{
    Acceleration, AccelerationPerVolt, Coefficient, DecayRate, EmfConstant, Inductance, Millivolts,
    Resistance,
};
use motor_hub_client::Session;
use motor_hub_client::line::Line;
use serde::{Deserialize, Serialize};
use simulated::scheme::{BlendChoice, SchemeName, SchemeWords};

/// Settings of a hub.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    schema_version: u32,
    #[serde(rename = "motor")]
    motors: Vec<Motor>,
}

/// Version of the document that this program writes and reads.
const SCHEMA_VERSION: u32 = 1;

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Motor {
    number: u8,
    mode: Mode,
    at_zero_power: AtZero,
    emf_mv_s_per_count: f64,
    resistance_ohm: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    inductance_mh: Option<f64>,
    scheme: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    blend: Option<toml::Value>,
    duty: Duty,
    on_fault: AtFault,
    /// 0 for none.
    current_alert_ma: u16,
    #[serde(skip_serializing_if = "Option::is_none")]
    acceleration_limit_cps2: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dynamics: Option<Moves>,
    #[serde(skip_serializing_if = "Option::is_none")]
    thermal: Option<Stands>,
    bridge: Switches,
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity_loop: Option<Gains>,
    #[serde(skip_serializing_if = "Option::is_none")]
    position_loop: Option<Gains>,
}

/// Defines the names that an enum of the firmware has in the document.
macro_rules! words {
    ($name:ident = $of:ident { $($word:literal $value:ident),+ }) => {
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        enum $name {
            $(#[serde(rename = $word)] $value,)+
        }

        impl From<$of> for $name {
            fn from(of: $of) -> Self {
                match of {
                    $($of::$value => Self::$value,)+
                }
            }
        }

        impl From<$name> for $of {
            fn from(word: $name) -> Self {
                match word {
                    $($name::$value => Self::$value,)+
                }
            }
        }
    };
}

words!(Mode = RunMode { "power" Power, "velocity" Velocity, "position" Position });
words!(AtZero = ZeroPower { "brake" Brake, "float" Float });
words!(Duty = DutyRule { "linear-current" LinearCurrent, "linear-duty" LinearDuty });
words!(AtFault = OnFault { "coast" Coast, "brake" Brake });
words!(Terms = Algorithm { "pid" Legacy, "pidf" Pidf });

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Moves {
    acceleration_cps2_per_v: f64,
    decay_per_s: f64,
    friction_mv: u16,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stands {
    continuous_current_ma: u16,
    winding_s: u16,
    case_s: u16,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Switches {
    least_off_ns: u16,
    least_on_ns: u16,
    turn_on_ns: u16,
    turn_off_ns: u16,
    change_us: u16,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Gains {
    p: f64,
    i: f64,
    d: f64,
    f: f64,
    terms: Terms,
}

// Steps of the protocol's fields per unit.
const EMF_STEPS: f64 = 1_048_576.0;
const COEFFICIENT_STEPS: f64 = 65_536.0;

impl Document {
    /// The settings in force.
    pub(super) fn of(session: &mut Session<Line>) -> Result<Self, Trouble> {
        let set = session.stored()?.coefficients;
        let motors = (0..CHANNELS as u8).map(|motor| Motor::of(session, motor, set >> motor & 1 != 0));
        Ok(Self { schema_version: SCHEMA_VERSION, motors: motors.collect::<Result<_, Trouble>>()? })
    }

    pub(super) fn to_toml(&self) -> Result<String, Failure> {
        let head = "# Settings of a motor hub: `motor-hub client settings import FILE` puts them in force.\n";
        toml::to_string(self).map(|text| format!("{head}{text}")).map_err(Failure::work)
    }

    /// The requests that put the settings in force, if all values are in range.
    ///
    /// # Errors
    /// A text that names the motor, the key, and the allowed values.
    pub(super) fn requests(&self) -> Result<Vec<Request>, String> {
        if self.schema_version != SCHEMA_VERSION {
            let version = self.schema_version;
            return Err(format!("schema_version is {version}; this program reads {SCHEMA_VERSION}"));
        }
        let mut numbers = Vec::new();
        let mut requests = Vec::new();
        for motor in &self.motors {
            let number = motor.number;
            if usize::from(number) >= CHANNELS || numbers.contains(&number) {
                return Err(format!(
                    "motor {number}: number is 0 to {}, and each number occurs once",
                    CHANNELS - 1
                ));
            }
            numbers.push(number);
            requests.extend(motor.requests().map_err(|why| format!("motor {number}: {why}"))?);
        }
        Ok(requests)
    }
}

impl Motor {
    fn of(session: &mut Session<Line>, number: u8, has_coefficients: bool) -> Result<Self, Trouble> {
        let Setup { emf, resistance, inductance, scheme, duty } = session.setup(number)?;
        let Motion { dynamics, acceleration } = session.motion(number)?;
        let Protection { on_fault, thermal } = session.protection(number)?;
        let Timing { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us } =
            session.timing(number)?;
        let ChannelMode { mode, zero_power } = session.ask(ToMotor::Mode.to(number))?;
        let current_alert_ma = session.ask(ToMotor::CurrentAlert.to(number))?;
        let mut gains = |of| -> Result<Option<Gains>, Trouble> {
            let gains: Option<Coefficients> =
                has_coefficients.then(|| session.ask(ToMotor::Pidf { of }.to(number))).transpose()?;
            Ok(gains.map(Gains::from))
        };
        let (velocity_loop, position_loop) = (gains(Loop::Velocity)?, gains(Loop::Position)?);
        let SchemeText { scheme, blend } = SchemeText::of(scheme)?;
        Ok(Self {
            number,
            mode: mode.into(),
            at_zero_power: zero_power.into(),
            emf_mv_s_per_count: f64::from(emf.to_bits()) / EMF_STEPS,
            resistance_ohm: f64::from(resistance.map_or(0, Resistance::as_milliohms)) / 1e3,
            inductance_mh: inductance.map(|it| f64::from(it.as_microhenries()) / 1e3),
            scheme,
            blend,
            duty: duty.into(),
            on_fault: on_fault.into(),
            current_alert_ma,
            acceleration_limit_cps2: acceleration.map(Acceleration::get),
            dynamics: dynamics.map(|Dynamics { gain, decay, friction }| Moves {
                acceleration_cps2_per_v: f64::from(gain.to_bits()) / 256.0,
                decay_per_s: f64::from(decay.to_bits()) / COEFFICIENT_STEPS,
                friction_mv: friction.get(),
            }),
            thermal: thermal.map(|limit| Stands {
                continuous_current_ma: limit.continuous_ma(),
                winding_s: limit.winding_s(),
                case_s: limit.case_s(),
            }),
            bridge: Switches { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us },
            velocity_loop,
            position_loop,
        })
    }

    /// The requests of one motor. The set-up comes first, because it resets motion and coefficients.
    fn requests(&self) -> Result<Vec<Request>, String> {
        let Self { number, mode, at_zero_power, current_alert_ma, .. } = *self;
        let Switches { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us } = self.bridge;
        let timing = Timing { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us };
        let thermal = self
            .thermal
            .as_ref()
            .map(|it| ThermalLimit::new(it.continuous_current_ma, it.winding_s, it.case_s));
        let protection = Protection {
            on_fault: self.on_fault.into(),
            thermal: thermal.transpose().map_err(named("thermal"))?,
        };
        let limit = self.acceleration_limit_cps2.map(Acceleration::new).transpose();
        let motion = Motion {
            dynamics: self.dynamics.as_ref().map(Moves::dynamics).transpose()?,
            acceleration: limit.map_err(named("acceleration_limit_cps2"))?,
        };
        let mut requests = vec![
            ToSetup::SetUp { setup: self.setup()? }.to(number),
            ToSetup::SetTiming { timing }.to(number),
            ToSetup::SetProtection { protection }.to(number),
            ToSetup::SetMotion { motion }.to(number),
            ToMotor::SetMode { mode: mode.into(), zero_power: at_zero_power.into() }.to(number),
            ToMotor::SetCurrentAlert { milliamperes: current_alert_ma }.to(number),
        ];
        let loops = [
            ("velocity_loop", Loop::Velocity, &self.velocity_loop),
            ("position_loop", Loop::Position, &self.position_loop),
        ];
        for (name, of, gains) in loops {
            if let Some(gains) = gains {
                let coefficients = gains.coefficients().map_err(|why| format!("{name}.{why}"))?;
                requests.push(ToMotor::SetPidf { of, coefficients }.to(number));
            }
        }
        Ok(requests)
    }

    fn setup(&self) -> Result<Setup, String> {
        let emf = steps(self.emf_mv_s_per_count, EMF_STEPS).and_then(|bits| i32::try_from(bits).ok());
        let emf = emf.and_then(|bits| EmfConstant::from_bits(bits).ok());
        let resistance = Resistance::from_ohms(self.resistance_ohm).map_err(named("resistance_ohm"))?;
        let inductance = self.inductance_mh.map(Inductance::from_millihenries).transpose();
        Ok(Setup {
            emf: emf.ok_or("emf_mv_s_per_count is above 0 and below 32")?,
            resistance: Some(resistance),
            inductance: inductance.map_err(named("inductance_mh"))?,
            scheme: SchemeText { scheme: self.scheme.clone(), blend: self.blend.clone() }.scheme()?,
            duty: self.duty.into(),
        })
    }
}

/// Name and blend of a scheme.
struct SchemeText {
    scheme: String,
    blend: Option<toml::Value>,
}

impl SchemeText {
    fn of(scheme: Scheme) -> Result<Self, Failure> {
        let words = serde_json::to_value(SchemeWords(scheme)).map_err(Failure::work)?;
        let name = words.get("scheme").and_then(|name| name.as_str()).unwrap_or_default().to_owned();
        let blend = match scheme {
            Scheme::D(Blend::Automatic) => Some("auto".into()),
            Scheme::D(Blend::Fixed(fraction)) => {
                Some((f64::from(fraction.to_bits()) / f64::from(BlendFraction::ONE.to_bits())).into())
            }
            _ => None,
        };
        Ok(Self { scheme: name, blend })
    }

    fn scheme(self) -> Result<Scheme, String> {
        let name: SchemeName = self.scheme.parse().map_err(named("scheme"))?;
        let blend: Option<BlendChoice> =
            self.blend.map(toml::Value::try_into).transpose().map_err(named("blend"))?;
        name.with_blend(blend).map_err(named("blend"))
    }
}

impl Moves {
    fn dynamics(&self) -> Result<Dynamics, String> {
        let gain = AccelerationPerVolt::from_f64(self.acceleration_cps2_per_v);
        Ok(Dynamics {
            gain: gain.map_err(named("dynamics.acceleration_cps2_per_v"))?,
            decay: DecayRate::from_f64(self.decay_per_s).map_err(named("dynamics.decay_per_s"))?,
            friction: Millivolts::new(self.friction_mv),
        })
    }
}

impl From<Coefficients> for Gains {
    fn from(Coefficients { pidf: Pidf { p, i, d, f }, algorithm }: Coefficients) -> Self {
        let [p, i, d, f] = [p, i, d, f].map(|it| f64::from(it.to_bits()) / COEFFICIENT_STEPS);
        Self { p, i, d, f, terms: algorithm.into() }
    }
}

impl Gains {
    fn coefficients(&self) -> Result<Coefficients, String> {
        let term = |name: &str, value: f64| {
            let bits = steps(value, COEFFICIENT_STEPS).and_then(|bits| i32::try_from(bits).ok());
            bits.map(Coefficient::from_bits).ok_or_else(|| format!("{name} is -32768 to 32767.9999"))
        };
        let (p, i) = (term("p", self.p)?, term("i", self.i)?);
        let (d, f) = (term("d", self.d)?, term("f", self.f)?);
        Ok(Coefficients { pidf: Pidf { p, i, d, f }, algorithm: self.terms.into() })
    }
}

/// The nearest whole number of steps, if there is one.
fn steps(value: f64, per_unit: f64) -> Option<i64> {
    let steps = (value * per_unit).round();
    (steps.abs() < 1e15).then_some(steps as i64)
}

/// Prefixes an error with the key that it belongs to.
fn named<E: ToString>(key: &'static str) -> impl Fn(E) -> String {
    move |error| format!("{key}: {}", error.to_string())
}
