//! Native module of the Python package `motor_hub`: a session with one hub. Its calls block, and release Python's
//! global interpreter lock while they wait.
//!
//! `motor_hub/__init__.py` calls these functions in a thread, and offers them as an asyncio interface. Numbers arrive
//! from Python as `Whole` or `Real`: a value that is out of range, or a `Real` that is no number, raises a `ValueError`
//! that names the value and the range.

mod reading;

use motor_hub_client::base::Part;
use motor_hub_client::hub::FASTEST_GROUP_CPS;
use motor_hub_client::line::ports;
use motor_hub_client::motor::{SPEED_LIMITS_CPS, Setpoint, constant_current_ma};
use motor_hub_client::motor_hub::extension::HubFunction;
use motor_hub_client::motor_hub::extension::group::GroupCourse;
use motor_hub_client::motor_hub::extension::report::ReportedSetpoint;
use motor_hub_client::motor_hub::group::{BaseSettings, DEFAULT_TOLERANCE, DriveBase, GroupCommand};
use motor_hub_client::motor_hub::motor::ZeroPower;
use motor_hub_client::motor_hub::protocol::CHANNELS;
use motor_hub_client::motor_hub::protocol::motor::RunMode;
use motor_hub_client::motor_hub::regulator::identify::Identification;
use motor_hub_client::motor_hub::units::{Acceleration, Control, CountsPerSecond};
use motor_hub_client::{Error, Session, reasons};
use pyo3::exceptions::{PyOverflowError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::{Mutex, MutexGuard, PoisonError};

pyo3::create_exception!(
    motor_hub,
    HubError,
    pyo3::exceptions::PyException,
    "A hub refuses, or cannot be reached."
);
pyo3::create_exception!(
    motor_hub,
    Refused,
    HubError,
    "The hub refuses a request, or its firmware is too old for it."
);
pyo3::create_exception!(motor_hub, Unreachable, HubError, "The line to the hub fails, or no hub answers.");

impl From<Failure> for PyErr {
    fn from(Failure(error): Failure) -> Self {
        let text = error.to_string();
        match error {
            Error::Refused { .. } | Error::TooOld { .. } => Refused::new_err(text),
            Error::Unexpected { .. } => HubError::new_err(text),
            _ => Unreachable::new_err(text),
        }
    }
}

/// An error of the session, which is converted to a Python exception.
struct Failure(Error);

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

/// A motor's number from Python, limited to 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Whole(i64);

impl FromPyObject<'_, '_> for Whole {
    type Error = PyErr;

    fn extract(number: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        limited(number.extract(), number, [i64::MIN, i64::MAX]).map(Self)
    }
}

/// A quantity from Python. An integer that is too large for a float becomes an infinity.
struct Real {
    /// NaN, which is in no range, if Python gives no number.
    value: f64,
    /// What Python gives, for the text of an error.
    given: String,
}

impl FromPyObject<'_, '_> for Real {
    type Error = PyErr;

    fn extract(number: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        match limited(number.extract(), number, [f64::NEG_INFINITY, f64::INFINITY]) {
            Ok(value) => Ok(Self { value, given: value.to_string() }),
            Err(_) => Ok(Self { value: f64::NAN, given: number.repr()?.to_string() }),
        }
    }
}

impl Display for Real {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.given)
    }
}

/// Returns the value of a number from Python. If the type cannot hold the number, the value is one of these ends.
fn limited<T>(value: PyResult<T>, number: Borrowed<'_, '_, PyAny>, [least, most]: [T; 2]) -> PyResult<T> {
    match value {
        Err(error) if error.is_instance_of::<PyOverflowError>(number.py()) => {
            Ok(if number.lt(0)? { least } else { most })
        }
        value => value,
    }
}

impl Display for Whole {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let beyond = match self.0 {
            i64::MIN => " or less",
            i64::MAX => " or more",
            _ => "",
        };
        write!(out, "{}{beyond}", self.0)
    }
}

/// Checks a quantity from Python, and rounds the quantity to a whole number. The error names the quantity, what is given
/// and the range.
fn within<T: TryFrom<i64>>(name: &str, quantity: &Real, least: i64, most: i64, unit: &str) -> PyResult<T> {
    let rounded = Some(quantity.value.round()).filter(|value| (least as f64..=most as f64).contains(value));
    let whole = rounded.and_then(|value| T::try_from(value as i64).ok());
    whole.ok_or_else(|| outside(name, quantity, least, most, unit))
}

fn outside(name: &str, value: impl Display, least: impl Display, most: impl Display, unit: &str) -> PyErr {
    PyValueError::new_err(
        format!("{name} is {value}; allowed are {least} to {most} {unit}").trim_end().to_owned(),
    )
}

fn channel(motor: Whole) -> PyResult<u8> {
    let number = u8::try_from(motor.0).ok().filter(|number| usize::from(*number) < CHANNELS);
    number.ok_or_else(|| outside("motor", motor, 0, CHANNELS - 1, ""))
}

/// Checks a speed limit in counts/s.
fn speed_limit<T: TryFrom<i64>>(cps: &Real) -> PyResult<T> {
    let [least, most] = [SPEED_LIMITS_CPS.start(), SPEED_LIMITS_CPS.end()].map(|cps| i64::from(*cps));
    within("speed", cps, least, most, "counts/s")
}

/// A session with one hub.
#[pyclass(frozen, module = "motor_hub")]
struct Link {
    /// `None` once [`close`](Self::close) was called.
    session: Mutex<Option<Session>>,
    #[pyo3(get)]
    address: u8,
    /// Motors that a former host had left enabled. [`open`](Self::open) has disabled these motors.
    #[pyo3(get)]
    left_running: Vec<u8>,
}

impl Link {
    /// Runs a request. Other Python threads run meanwhile.
    fn run<T: Send>(
        &self,
        py: Python<'_>,
        request: impl FnOnce(&mut Session) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let closed = "the hub is closed; open it again by motor_hub.connect";
        py.detach(|| {
            let mut session = self.lock();
            let session = session.as_mut().ok_or_else(|| HubError::new_err(closed))?;
            Ok(request(session).map_err(Failure)?)
        })
    }

    /// Gives a motor a set-point. At power 0 and at velocity 0 the motor brakes.
    fn set_setpoint(&self, py: Python<'_>, motor: u8, setpoint: Setpoint) -> PyResult<()> {
        self.run(py, |session| session.set_setpoint(motor, setpoint, ZeroPower::Brake))
    }

    /// Locks the session. The session stays usable after a panic of another thread, because each request begins with a
    /// new packet.
    fn lock(&self) -> MutexGuard<'_, Option<Session>> {
        self.session.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Link {
    /// Opens a serial port, or a TCP connection if `place` is HOST:PORT.
    #[new]
    fn open(py: Python<'_>, place: &str) -> PyResult<Self> {
        py.detach(|| {
            let mut session = Session::open(place)
                .map_err(|error| Unreachable::new_err(format!("cannot open {place}: {error}")))?;
            let left_running = session.disable_left_enabled().map_err(Failure)?;
            session.end_left_outputs().map_err(Failure)?;
            let address = session.address();
            Ok(Self { session: Mutex::new(Some(session)), address, left_running })
        })
    }

    /// Disables motors, and closes the line. Later requests raise `HubError`. Closing again has no effect.
    fn close(&self, py: Python<'_>, motors: Vec<Whole>) -> PyResult<()> {
        let motors = motors.into_iter().map(channel).collect::<PyResult<Vec<u8>>>()?;
        let disable = |mut session: Session| session.disable_all(&motors);
        Ok(py.detach(|| self.lock().take().map_or(Ok(()), disable)).map_err(Failure)?)
    }

    fn version(&self, py: Python<'_>) -> PyResult<String> {
        self.run(py, Session::version)
    }

    fn keep_alive(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, Session::keep_alive)
    }

    fn fail_safe(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, Session::fail_safe)
    }

    /// Enables motors with constant power 0, so that they brake. After an error of one motor all these motors are
    /// disabled again.
    fn enable(&self, py: Python<'_>, motors: Vec<Whole>) -> PyResult<()> {
        let motors = motors.into_iter().map(channel).collect::<PyResult<Vec<u8>>>()?;
        let enabled = self.run(py, |session| {
            motors.iter().try_for_each(|motor| {
                session.brake(*motor)?;
                session.enable(*motor, true)
            })
        });
        if enabled.is_err() {
            // An error of this call is ignored, because the function returns the first error.
            let _ = self.run(py, |session| session.disable_all(&motors));
        }
        enabled
    }

    /// Disables motors. After an error all motors are tried again for 2.5 s, the time-out of the hub's keep-alive. An
    /// error of one motor does not prevent the attempt to disable the others. After [`close`](Self::close), which has
    /// disabled the motors, this function has no effect.
    fn disable(&self, py: Python<'_>, motors: Vec<Whole>) -> PyResult<()> {
        let motors = motors.into_iter().map(channel).collect::<PyResult<Vec<u8>>>()?;
        let disable = |session: &mut Session| session.disable_all(&motors);
        Ok(py.detach(|| self.lock().as_mut().map_or(Ok(()), disable)).map_err(Failure)?)
    }

    /// Returns those of these motors that the hub has disabled.
    fn disabled(&self, py: Python<'_>, motors: Vec<Whole>) -> PyResult<Vec<i64>> {
        let mut disabled = Vec::new();
        for motor in motors {
            let number = channel(motor)?;
            if !self.run(py, |session| session.enabled(number))? {
                disabled.push(motor.0);
            }
        }
        Ok(disabled)
    }

    /// Sets constant power as a share of full power, -1 to 1.
    fn power(&self, py: Python<'_>, motor: Whole, share: Real) -> PyResult<()> {
        let motor = channel(motor)?;
        if !(-1.0..=1.0).contains(&share.value) {
            return Err(outside("power", share, -1, 1, "of full power"));
        }
        let power = Control::saturating((share.value * f64::from(Control::MAX.get())).round() as i64);
        self.set_setpoint(py, motor, Setpoint::Power(power))
    }

    fn velocity(&self, py: Python<'_>, motor: Whole, cps: Real) -> PyResult<()> {
        let motor = channel(motor)?;
        let cps = within("velocity", &cps, i16::MIN.into(), i16::MAX.into(), "counts/s")?;
        self.set_setpoint(py, motor, Setpoint::Velocity(cps))
    }

    fn position(
        &self,
        py: Python<'_>,
        motor: Whole,
        counts: Real,
        speed: Real,
        tolerance: Real,
    ) -> PyResult<()> {
        let motor = channel(motor)?;
        let counts = within("position", &counts, i32::MIN.into(), i32::MAX.into(), "counts")?;
        let speed_limit = speed_limit(&speed)?;
        let tolerance = within("tolerance", &tolerance, 0, u16::MAX.into(), "counts")?;
        self.set_setpoint(py, motor, Setpoint::Position { counts, tolerance, speed_limit })
    }

    /// Sets a constant current in amperes. The hub reduces the current at the speed `speed` in counts/s.
    fn current(&self, py: Python<'_>, motor: Whole, amperes: Real, speed: Real) -> PyResult<()> {
        let motor = channel(motor)?;
        let ma =
            constant_current_ma(amperes.value).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let speed_limit = speed_limit(&speed)?;
        self.set_setpoint(py, motor, Setpoint::Current { ma, speed_limit })
    }

    /// Makes the present position 0 counts. Returns false, and resets nothing, while the motor has a target position, alone
    /// or in a group. The hub would keep the number of this target, so the motor would run to another place.
    fn reset_encoder(&self, py: Python<'_>, motor: Whole) -> PyResult<bool> {
        let motor = channel(motor)?;
        self.run(py, |session| {
            session.catch_up()?;
            let has_target = match session.report()? {
                Some(report) => report.motors.get(usize::from(motor)).is_some_and(|motor| {
                    matches!(motor.setpoint, ReportedSetpoint::Position(_) | ReportedSetpoint::Follow(_))
                }),
                None => {
                    let state = session.motor(motor)?;
                    state.enabled && state.mode == RunMode::Position
                }
            };
            if !has_target {
                session.reset_encoder(motor)?;
            }
            Ok(!has_target)
        })
    }

    /// Returns the state of all motors: the fields of `Reading` for each motor.
    fn readings<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let state = self.run(py, |session| {
            session.catch_up()?;
            let report = session.report()?;
            let bulk = if report.is_none() { Some(session.bulk()?) } else { None };
            Ok((report, bulk))
        })?;
        match state {
            (Some(report), _) => reading::of_report(py, &report),
            (None, Some(bulk)) => reading::of_bulk(py, &bulk),
            (None, None) => Ok(Vec::new()),
        }
    }

    /// Returns the battery voltage in volts; `None` if the hub does not know the voltage.
    fn battery(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        let mv = self.run(py, Session::battery)?.get();
        Ok((mv != 0).then_some(f64::from(mv) / 1e3))
    }

    /// Starts an identification. Returns the largest travel in counts in either direction.
    fn identify(&self, py: Python<'_>, motor: Whole, travel: Real) -> PyResult<u32> {
        let motor = channel(motor)?;
        let travel = within("travel", &travel, 1, u32::MAX.into(), "counts")?;
        self.run(py, |session| session.identify(motor, travel))
    }

    /// Returns the progress in percent while an identification runs, `None` before the first identification, and then
    /// the fields of `Identified`. Raises `Refused` if the motor was not identified.
    fn identification<'py>(&self, py: Python<'py>, motor: Whole) -> PyResult<Bound<'py, PyAny>> {
        let motor = channel(motor)?;
        match self.run(py, |session| session.identification(motor))? {
            Identification::None => Ok(py.None().into_bound(py)),
            Identification::Running(percent) => Ok(percent.into_pyobject(py)?.into_any()),
            Identification::Found(found) => Ok(reading::identified(py, &found)?.into_any()),
            Identification::Refused(why) => {
                Err(Refused::new_err(format!("motor {motor} was not identified: {why}")))
            }
        }
    }

    /// Puts the result of the last identification in force until the hub's reset. The hub deletes coefficients that a
    /// host has set.
    fn apply_identification(&self, py: Python<'_>, motor: Whole) -> PyResult<()> {
        let motor = channel(motor)?;
        let applied = self.run(py, |session| {
            let Identification::Found(found) = session.identification(motor)? else { return Ok(false) };
            session.set_dynamics(motor, Some(found.dynamics))?;
            Ok(true)
        })?;
        if applied { Ok(()) } else { Err(HubError::new_err(format!("motor {motor} is not identified"))) }
    }

    /// Stores the settings in force, so that they are in force after a reset of the hub.
    fn save(&self, py: Python<'_>) -> PyResult<()> {
        let report = self.run(py, |session| session.store(HubFunction::Save))?;
        match reasons::why_unsaved(&report) {
            None => Ok(()),
            Some(why) => Err(HubError::new_err(format!("settings were not stored: {why}"))),
        }
    }

    /// Configures the drive base. The odometry of the base then starts at the origin.
    fn set_base(
        &self,
        py: Python<'_>,
        wheels: (Whole, Whole),
        wheel_diameter_mm: Real,
        track_mm: Real,
        counts_per_turn: (Real, Real),
        use_gyro: bool,
    ) -> PyResult<()> {
        let wheels = [channel(wheels.0)?, channel(wheels.1)?];
        let counts_per_turn = <[Real; 2]>::from(counts_per_turn).map(|counts| counts.value);
        let base = DriveBase {
            wheel_diameter_mm: wheel_diameter_mm.value,
            track_mm: track_mm.value,
            counts_per_turn,
        };
        let base = BaseSettings::new(wheels, &base, use_gyro);
        let base = base.map_err(|error| PyValueError::new_err(error.to_string()))?;
        self.run(py, |session| session.set_base(base))
    }

    /// Returns the drive base in force: the fields of `Base`. `None` without a base.
    fn base<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let base = self.run(py, Session::base_if_reported)?;
        base.map(|base| reading::base(py, &base)).transpose()
    }

    /// Returns position and heading of the drive base: the fields of `Odometry`.
    fn odometry<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let report = self.run(py, |session| {
            session.catch_up()?;
            session.odometry()
        })?;
        reading::odometry(py, &report)
    }

    /// Drives the base over the distance `by` in mm, or turns the base by the angle `by` in degrees if `turns` is true.
    /// `start` are the target positions of the wheels of the last motion in counts. If the wheels are near `start`, the
    /// motion is computed from `start`, so that errors of several motions do not add up. Otherwise the motion is
    /// computed from the present positions. Returns the target positions of this motion, not rounded to whole counts.
    fn drive(
        &self,
        py: Python<'_>,
        start: Option<(f64, f64)>,
        turns: bool,
        by: Real,
        speed: Real,
        acceleration: Real,
    ) -> PyResult<(f64, f64)> {
        /// Largest distance of each wheel from `start` in counts. At a larger distance something else has moved the
        /// wheels since the last motion.
        const NEAR_COUNTS: u32 = 100;
        for (name, given, unit) in [("speed", &speed, "mm/s"), ("acceleration", &acceleration, "mm/s²")] {
            if !(0.001..=1e6).contains(&given.value) {
                return Err(outside(name, given, 0.001, 1_000_000, unit));
            }
        }
        let (name, unit, part) = if turns {
            ("angle", "degrees", Part::Turn(by.value))
        } else {
            ("distance", "mm", Part::Straight(by.value))
        };
        if !(-1e6..=1e6).contains(&by.value) {
            return Err(outside(name, by, -1_000_000, 1_000_000, unit));
        }
        let Some(base) = self.run(py, Session::base_if_reported)? else {
            return Err(HubError::new_err("the hub has no drive base; configure one by hub.set_base"));
        };
        let counts = self.run(py, Session::odometry)?.counts;
        let is_near = |end: &[f64; 2]| {
            // Positions wrap.
            let distance = |end: f64, counts: i32| (end.round() as i64 as i32).wrapping_sub(counts);
            end.iter().zip(counts).all(|(&end, counts)| distance(end, counts).unsigned_abs() <= NEAR_COUNTS)
        };
        let from = start.map(<[f64; 2]>::from).filter(is_near).unwrap_or(counts.map(f64::from));
        let (end, command) = part
            .command(&base, from, speed.value, acceleration.value)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        let [left, _] = base.wheels;
        self.run(py, |session| session.move_together(left, command))?;
        Ok(end.into())
    }

    /// Moves motors in step. The keys of `targets` are the members of the group. The values are positions in counts, or
    /// speeds in counts/s if `on` is true.
    fn together(
        &self,
        py: Python<'_>,
        targets: BTreeMap<Whole, Real>,
        on: bool,
        speed: Real,
        acceleration: Real,
        tolerance: Option<Real>,
    ) -> PyResult<()> {
        let fastest = i64::from(FASTEST_GROUP_CPS);
        let speed: i32 = within("speed", &speed, 1, fastest, "counts/s")?;
        let acceleration: u32 = within("acceleration", &acceleration, 1, u32::MAX.into(), "counts/s²")?;
        let acceleration =
            Acceleration::new(acceleration).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let (mut places, mut speeds) = ([None; CHANNELS], [None; CHANNELS]);
        for (&motor, target) in &targets {
            let at = usize::from(channel(motor)?);
            if on {
                let cps: i32 = within("speed", target, -fastest, fastest, "counts/s")?;
                speeds[at] = Some(CountsPerSecond::new(cps));
            } else {
                places[at] =
                    Some(within::<i32>("target", target, i32::MIN.into(), i32::MAX.into(), "counts")?);
            }
        }
        let Some(first) = targets.keys().next().copied() else {
            return Err(PyValueError::new_err("no motor is given; a group has one motor at least"));
        };
        let course = if on { GroupCourse::Velocity(speeds) } else { GroupCourse::Position(places) };
        let usual = GroupCommand::new(course, CountsPerSecond::new(speed), acceleration);
        let tolerance = tolerance.map_or(Ok(DEFAULT_TOLERANCE), |given| {
            within("tolerance", &given, 0, u16::MAX.into(), "counts")
        })?;
        let first = channel(first)?;
        self.run(py, |session| session.move_together(first, GroupCommand { tolerance, ..usual }))
    }

    /// State of the motor's group: 0 alone, 1 moving, 2 settled.
    fn group_state(&self, py: Python<'_>, motor: Whole) -> PyResult<u8> {
        let motor = channel(motor)?;
        Ok(self.run(py, |session| session.group_state(motor))? as u8)
    }
}

/// Returns the paths of the USB serial ports.
#[pyfunction]
fn usb_ports() -> PyResult<Vec<String>> {
    let usb = ports()?.into_iter().filter(|port| port.description.starts_with("USB"));
    Ok(usb.map(|port| port.path).collect())
}

#[pymodule]
fn native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Link>()?;
    module.add_function(wrap_pyfunction!(usb_ports, module)?)?;
    module.add("CHANNELS", CHANNELS)?;
    module.add("HubError", module.py().get_type::<HubError>())?;
    module.add("Refused", module.py().get_type::<Refused>())?;
    module.add("Unreachable", module.py().get_type::<Unreachable>())
}
