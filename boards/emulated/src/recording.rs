//! Recorded inputs and results of one motor's control step on this computer, and the same step on the emulated chip.
//!
//! The inputs are recorded in a closed loop with the model of a motor and its load. If the chip gets the recorded inputs, each of
//! its results must be equal to the last bit.
//!
//! ```
//! use emulated::Mounting;
//! use emulated::recording::{ControlVariant, Configuration, Recording};
//! use motor_hub::braking::DutyRule;
//! use motor_hub::model::{catalogue::characterised, load::Load};
//! use motor_hub::motor::Setpoint;
//! use motor_hub::units::{Control, Period};
//! use simulated::hardware::BRIDGE;
//!
//! let motor = characterised("AM 60 A")?;
//! let alone = Mounting { motor, load: Load::NONE, bridge: BRIDGE.into(), stops: None };
//! let full = |_| Setpoint::ConstantPower(Control::MAX);
//! let variant = ControlVariant { rule: DutyRule::LinearCurrent, configuration: Configuration::Unknown };
//! let recording = Recording::new(&alone, variant, Period::DEFAULT, 10, full, |_| 0.0);
//! assert_eq!(recording.answers.last().map(|answer| answer.control), Some(Control::MAX.get()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use motor_hub::braking::{DutyRule, Winding};
use motor_hub::bridge::Drive;
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::si::{Hertz, NewtonMetres, Seconds, Volts};
use motor_hub::motion::{Reading, Tracker};
use motor_hub::motor::{Motor, Report, Setpoint, Settings};
use motor_hub::regulator::{Coefficients, Dynamics};
use motor_hub::supply::Battery;
use motor_hub::units::{CountsPerSecond, EmfConstant, Micros, Millivolts, Period, RangeError};
use simulated::hardware::mechanics;

use crate::bench::{Bench, Setup};
use crate::elf;
use crate::shafts::Mounting;

/// Input of a motor: a sample of its encoder, or a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Input {
    /// Reading of the encoder.
    pub reading: Reading,
    /// Further inputs of a tick. `None` for a sample between two ticks.
    pub tick: Option<Tick>,
}

/// Inputs of a tick besides the encoder's reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// The time of the tick.
    pub now: Micros,
    /// Voltage of the battery.
    pub battery: Millivolts,
    /// The set-point.
    pub setpoint: Setpoint,
}

/// How the motor is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ControlVariant {
    /// Rule by which the duty is computed.
    pub rule: DutyRule,
    /// What is configured of the motor.
    pub configuration: Configuration,
}

/// What is configured of a motor. This decides how the motor is regulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Configuration {
    /// The dynamics are configured: the model regulates.
    Configured,
    /// Only the winding is configured: the model regulates, and learns the acceleration per volt.
    Unknown,
    /// A host has set coefficients: PID regulates.
    Coefficients,
}

impl Configuration {
    /// All variants.
    pub const ALL: [Self; 3] = [Self::Configured, Self::Unknown, Self::Coefficients];

    /// Returns the name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Configured => "configured",
            Self::Unknown => "not configured",
            Self::Coefficients => "PID",
        }
    }
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Control value, -32767 to 32767.
    pub control: i16,
    /// Mode and duty.
    pub drive: Drive,
    /// Estimated speed.
    pub velocity: CountsPerSecond,
    /// Position in counts.
    pub position: i32,
}

impl Answer {
    fn new(report: &Report, settings: &Settings) -> Self {
        Self {
            control: report.control(settings).get(),
            drive: report.drive,
            velocity: report.velocity,
            position: report.position,
        }
    }
}

impl Answer {
    fn words(&self) -> [u32; 4] {
        [
            i32::from(self.control).cast_unsigned(),
            (self.drive.mode as u32) << 16 | u32::from(self.drive.duty.to_bits()),
            self.velocity.to_bits().cast_unsigned(),
            self.position.cast_unsigned(),
        ]
    }
}

/// Inputs and results of a closed loop, tick by tick.
#[derive(Clone, Debug)]
pub struct Recording {
    settings: Settings,
    period: Period,
    /// Inputs in the order of time.
    pub inputs: Vec<Input>,
    /// Results on this computer, one for each tick.
    pub answers: Vec<Answer>,
}

fn settings(mounting: &Mounting, variant: ControlVariant, period: Period) -> Result<Settings, RangeError> {
    let motor = &mounting.motor;
    let emf = EmfConstant::from_ke(motor.ke.0, motor.counts_per_rev_motor)?;
    let settings = Settings { duty: variant.rule, ..Settings::new(Winding { emf, ..Winding::NEVEREST_60 }) };
    Ok(match variant.configuration {
        Configuration::Configured => Settings { dynamics: Some(dynamics(mounting, &settings)?), ..settings },
        Configuration::Unknown => settings,
        Configuration::Coefficients => {
            let suggested = Coefficients::guessed(emf, settings.scheme, period);
            Settings { coefficients: Some(suggested), ..settings }
        }
    })
}

/// Computes the dynamics of a motor on the bench with its load, in the firmware's units.
///
/// # Errors
/// Returns an error if a constant of the motor is out of the firmware's range.
pub fn dynamics(mounting: &Mounting, settings: &Settings) -> Result<Dynamics, RangeError> {
    let mechanics = mechanics(&mounting.motor, &mounting.load);
    Dynamics::from_mechanics(&settings.winding, &settings.bridge, &mechanics)
}

impl Recording {
    /// Runs a motor for a number of ticks. `setpoint` returns the set-point of a tick, and `torque` the external torque on the
    /// output shaft, N m. The battery voltage falls from 13 V to 11 V meanwhile.
    ///
    /// # Panics
    /// Panics if a constant of the motor is out of the firmware's range.
    #[must_use]
    pub fn new(
        mounting: &Mounting,
        variant: ControlVariant,
        period: Period,
        ticks: usize,
        setpoint: impl Fn(usize) -> Setpoint,
        torque: impl Fn(usize) -> f64,
    ) -> Self {
        let settings = settings(mounting, variant, period).expect("a motor's constants");
        let pwm = Hertz(settings.bridge.pwm_hz().into());
        let mut plant = Plant::new(mounting.motor, mounting.load, mounting.bridge, pwm);
        let mut motor = Motor::new(settings, period);
        let mut tracker = Tracker::default();
        let (mut last, mut drive) = (Setpoint::Disabled, Drive::COAST);
        let mut recording = Self { settings, period, inputs: Vec::new(), answers: Vec::new() };
        let mut reading = tracker.step(0, Micros::new(0));
        for tick in 0..ticks {
            let volts = 13.0 - 2.0 * tick as f64 / ticks as f64;
            for ms in 1..=u64::from(period.as_millis()) {
                let command = PlantInput {
                    torque_after: NewtonMetres(torque(tick)),
                    ..PlantInput::pwm(drive.mode, drive.duty.to_f64())
                };
                plant.run(Seconds(1e-3), command, Volts(volts));
                let now = Micros::new(tick as u64 * period.as_micros() + ms * 1000);
                reading = tracker.step(plant.counts() as u16, now);
                if ms < u64::from(period.as_millis()) {
                    motor.sample(&reading);
                    recording.inputs.push(Input { reading, tick: None });
                }
            }
            // A tick comes shortly after a sample.
            let now = Micros::new(reading.at.get() + 37);
            let battery = Millivolts::new((volts * 1000.0) as u16);
            let setpoint = setpoint(tick);
            if setpoint != last {
                last = setpoint;
                motor.set(last);
            }
            let report = motor.step(now, Some(reading), Some(Battery::unlimited(battery, now)));
            drive = report.drive;
            recording.inputs.push(Input { reading, tick: Some(Tick { now, battery, setpoint }) });
            recording.answers.push(Answer::new(&report, &settings));
        }
        recording
    }
}

impl Input {
    fn words(&self) -> [u32; 12] {
        let speed = |speed: CountsPerSecond| speed.to_bits().cast_unsigned();
        // The program ignores these values for a sample between two ticks.
        let nothing =
            Tick { now: self.reading.at, battery: Millivolts::new(0), setpoint: Setpoint::Disabled };
        let Tick { now, battery, setpoint } = self.tick.unwrap_or(nothing);
        let [kind, target, tolerance, limit] = match setpoint {
            _ if self.tick.is_none() => [SAMPLE, 0, 0, 0],
            // A motor that is replayed alone is in no group.
            Setpoint::Disabled | Setpoint::FailSafe | Setpoint::Follow(_) => [0; 4],
            Setpoint::ConstantPower(power) => [1, i32::from(power.get()).cast_unsigned(), 0, 0],
            Setpoint::Current { current, speed_limit } => {
                [6, current.get().cast_unsigned(), 0, speed(speed_limit)]
            }
            Setpoint::Velocity(target) => [2, speed(target), 0, 0],
            Setpoint::Position { target, tolerance, speed_limit } => {
                [3, target.cast_unsigned(), u32::from(tolerance), speed(speed_limit)]
            }
            Setpoint::Identify { travel_limit } => [5, travel_limit, 0, 0],
        };
        let halves = |time: Micros| [time.get() as u32, (time.get() >> 32) as u32];
        let [now, edge, at] = [now, self.reading.edge_at, self.reading.at].map(halves);
        [
            now[0],
            now[1],
            self.reading.position.cast_unsigned(),
            edge[0],
            edge[1],
            at[0],
            at[1],
            u32::from(battery.get()),
            kind,
            target,
            tolerance,
            limit,
        ]
    }
}

/// The program that steps one motor on the chip.
pub struct OnChip {
    bench: Bench,
    image: PathBuf,
    settings: u64,
    inputs: u64,
    outputs: u64,
    pending: u64,
    /// First instructions of a step, and of the code after the step.
    step: (u64, u64),
    /// First instructions of a sample, and of the code after the sample.
    sample: (u64, u64),
}

/// Largest number of inputs that the program on the chip takes at a time; the program has the same constant.
const BATCH: usize = 512;
/// Number for a sample between two ticks; the program on the chip has the same constant.
const SAMPLE: u32 = 4;

/// Numbers of instructions that each call has taken.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// Instructions of each control step.
    pub steps: Vec<u64>,
    /// Instructions of each sample between two steps.
    pub samples: Vec<u64>,
}

impl OnChip {
    /// Starts the program with the settings of `recording`. Builds it first, unless `MOTOR_HUB_BUDGET_ELF` names its file.
    #[must_use]
    pub fn new(recording: &Recording) -> Self {
        let image =
            std::env::var_os("MOTOR_HUB_BUDGET_ELF").map_or_else(|| elf::build("budget"), PathBuf::from);
        let bench = Bench::with_image(Setup::new(Vec::new()), &image);
        let [settings, inputs, outputs, pending] =
            ["SETTINGS", "INPUTS", "OUTPUTS", "PENDING"].map(|name| bench.address(name));
        let step = (bench.address("::step_motor"), bench.address("::stepped"));
        let sample = (bench.address("::sample_motor"), bench.address("::sampled"));
        let mut chip = Self { bench, image, settings, inputs, outputs, pending, step, sample };
        // The start-up code, which clears the memory, must end before the settings are written.
        chip.bench.run(Duration::from_millis(1));
        let Settings { winding, duty, dynamics, coefficients, .. } = recording.settings;
        let words = vec![
            winding.emf.to_bits().cast_unsigned(),
            recording.period.as_millis(),
            u32::from(duty == DutyRule::LinearCurrent),
            dynamics.map_or(0, |known| known.gain.to_bits()),
            dynamics.map_or(0, |known| known.decay.to_bits()),
            u32::from(coefficients.is_some()),
        ];
        chip.bench.write_words(chip.settings, words);
        chip
    }

    /// Returns what the emulator could not do as the chip would.
    pub fn gaps(&mut self) -> Vec<String> {
        self.bench.gaps()
    }

    /// Replays inputs, and returns the result of each tick as words.
    ///
    /// # Panics
    /// Panics if the program has not answered after 10 s of virtual time.
    pub fn replay(&mut self, inputs: &[Input]) -> Vec<[u32; 4]> {
        let mut answers = Vec::new();
        for batch in inputs.chunks(BATCH) {
            let words: Vec<u32> = batch.iter().flat_map(Input::words).collect();
            self.bench.write_words(self.inputs, words);
            self.bench.write_words(self.pending, vec![batch.len() as u32]);
            let pending = self.pending;
            let done = self.bench.run_while(Duration::from_millis(1), Duration::from_secs(10), |bench| {
                bench.read_words(pending, 1) == [0]
            });
            assert!(done, "the program answers");
            let words = self.bench.read_words(self.outputs, 4 * batch.len());
            let ticks = words.as_chunks::<4>().0.iter().zip(batch).filter(|(_, input)| input.tick.is_some());
            answers.extend(ticks.map(|(words, _)| *words));
        }
        answers
    }

    /// Replays inputs, and counts the instructions of each step and each sample.
    pub fn count(&mut self, inputs: &[Input]) -> Counts {
        let (step, sample) = (self.step, self.sample);
        self.bench.watch(vec![step.0, step.1, sample.0, sample.1]);
        self.bench.take_hits();
        self.replay(inputs);
        let (mut counts, mut from) = (Counts::default(), 0);
        for (address, count) in self.bench.take_hits() {
            if address == step.1 {
                counts.steps.push(count - from);
            } else if address == sample.1 {
                counts.samples.push(count - from);
            }
            from = count;
        }
        counts
    }

    /// Replays inputs, and returns how often each instruction of the steps ran, by address.
    pub fn profile(&mut self, inputs: &[Input]) -> BTreeMap<u64, u64> {
        self.bench.watch_all();
        self.bench.take_hits();
        self.replay(inputs);
        let (begin, end) = self.step;
        let mut within = false;
        let mut counts = BTreeMap::new();
        for (address, _) in self.bench.take_hits() {
            within = address == begin || within && address != end;
            if within {
                *counts.entry(address).or_default() += 1;
            }
        }
        counts
    }

    /// Replays inputs and counts the instructions of each call of a function from the motor's own functions, including the
    /// functions that it calls.
    ///
    /// # Panics
    /// Panics if the program has no function with this name, for example because the compiler has inlined it.
    pub fn count_within(&mut self, inputs: &[Input], function: &str) -> Vec<u64> {
        let entry = self.bench.address(function);
        let motor = |s: &&elf::Symbol| s.name.starts_with("<motor_hub::motor::Motor>::");
        let callers: Vec<_> =
            self.bench.symbols().iter().filter(motor).map(|s| s.address..s.address + s.size).collect();
        let watched = callers.iter().flat_map(|caller| caller.clone().step_by(2)).chain([entry]);
        self.bench.watch(watched.collect());
        self.bench.take_hits();
        self.replay(inputs);
        let (mut counts, mut from) = (Vec::new(), None);
        for (address, count) in self.bench.take_hits() {
            if address == entry {
                from = Some(count);
            } else if callers.iter().any(|caller| caller.contains(&address))
                && let Some(from) = from.take()
            {
                counts.push(count - from);
            }
        }
        counts
    }

    /// Returns the file of the program.
    #[must_use]
    pub fn image(&self) -> &Path {
        &self.image
    }

    /// Returns the symbols of the program.
    #[must_use]
    pub fn symbols(&self) -> &[elf::Symbol] {
        self.bench.symbols()
    }
}

/// Returns the results of a recording as words, to compare them with the results of the chip.
#[must_use]
pub fn expected(recording: &Recording) -> Vec<[u32; 4]> {
    recording.answers.iter().map(Answer::words).collect()
}
