//! Recorded inputs and results of one motor's control step on this computer, and the same step on the emulated chip.
//!
//! The inputs are recorded in a closed loop with the model of a motor. If the chip gets the recorded inputs, each of
//! its results must be equal to the last bit. Inputs and results are words, as the program on the chip has them
//! (`boards/emulated/budget`).

use emulated::{Bench, Hit, Mounting, Setup, elf};
use motor_hub::braking::{DutyRule, Winding};
use motor_hub::bridge::Drive;
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::si::{Hertz, NewtonMetres, Seconds, Volts};
use motor_hub::motion::{Reading, Tracker};
use motor_hub::motor::{Motor, Setpoint, Settings};
use motor_hub::regulator::{Coefficients, Dynamics};
use motor_hub::supply::Battery;
use motor_hub::units::{EmfConstant, Micros, Millivolts, Period};
use simulated::hardware::mechanics;

use crate::common::{am60, ms};

/// What is configured of a motor. This decides how the motor is regulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Configuration {
    /// The dynamics are configured: the model regulates.
    Configured,
    /// Only the winding is configured: the model regulates, and learns the acceleration per volt.
    Unknown,
    /// A host has set coefficients: PID regulates.
    Coefficients,
}

impl Configuration {
    pub(crate) const ALL: [Self; 3] = [Self::Configured, Self::Unknown, Self::Coefficients];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Configured => "configured",
            Self::Unknown => "not configured",
            Self::Coefficients => "PID",
        }
    }

    /// Returns settings with what is configured of this motor with its load.
    pub(crate) fn apply(self, settings: Settings, mounting: &Mounting) -> Settings {
        match self {
            Self::Configured => Settings { dynamics: Some(dynamics(mounting, &settings)), ..settings },
            Self::Unknown => settings,
            Self::Coefficients => {
                let suggested = Coefficients::suggested(settings.winding.emf);
                Settings { coefficients: Some(suggested), ..settings }
            }
        }
    }
}

/// Computes the dynamics of a motor with its load, in the firmware's units.
pub(crate) fn dynamics(mounting: &Mounting, settings: &Settings) -> Dynamics {
    let mechanics = mechanics(&mounting.motor, &mounting.load);
    Dynamics::from_mechanics(&settings.winding, &settings.bridge, &mechanics).expect("a motor's constants")
}

/// How the motor is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ControlVariant {
    pub(crate) rule: DutyRule,
    pub(crate) configuration: Configuration,
}

/// Words of an input: time (2), position, edge time (2), sample time (2), battery, set-point (4).
pub(crate) type Input = [u32; 12];
/// Words of a result: control value, mode and duty, velocity, position.
pub(crate) type Answer = [u32; 4];

/// Inputs and results of a closed loop, tick by tick.
#[derive(Clone, Debug)]
pub(crate) struct Recording {
    settings: Settings,
    period: Period,
    /// Inputs in the order of time: ticks, and samples of the encoder between them.
    pub(crate) inputs: Vec<Input>,
    /// Results on this computer, one for each tick.
    pub(crate) answers: Vec<Answer>,
}

impl Recording {
    /// Runs a motor for a number of ticks. `setpoint` returns the set-point of a tick. The battery voltage falls from 13 V to 11 V
    /// meanwhile.
    pub(crate) fn new(
        variant: ControlVariant,
        period: Period,
        ticks: usize,
        setpoint: impl Fn(usize) -> Setpoint,
    ) -> Self {
        let mounting = am60();
        let motor = &mounting.motor;
        let emf = EmfConstant::from_ke(motor.ke.0, motor.counts_per_rev_motor).expect("a motor's constants");
        let winding = Winding { emf, ..Winding::NEVEREST_60 };
        let settings = Settings { duty: variant.rule, ..Settings::new(winding) };
        let settings = variant.configuration.apply(settings, &mounting);
        let pwm = Hertz(settings.bridge.pwm_hz().into());
        let mut plant = Plant::new(mounting.motor, mounting.load, mounting.bridge, pwm);
        let mut motor = Motor::new(settings, period);
        let mut tracker = Tracker::default();
        let (mut last, mut drive) = (Setpoint::Disabled, Drive::COAST);
        let mut recording = Self { settings, period, inputs: Vec::new(), answers: Vec::new() };
        let mut reading = tracker.step(0, Micros::new(0));
        for tick in 0..ticks {
            let volts = 13.0 - 2.0 * tick as f64 / ticks as f64;
            // External torques on the output shaft: none, one in each direction, and a larger one.
            let torque_nm = [0.0, 0.3, -0.3, 0.0, 0.8][tick / 37 % 5];
            for ms in 1..=u64::from(period.as_millis()) {
                let command = PlantInput {
                    torque_after: NewtonMetres(torque_nm),
                    ..PlantInput::pwm(drive.mode, drive.duty.to_f64())
                };
                plant.run(Seconds(1e-3), command, Volts(volts));
                let now = Micros::new(tick as u64 * period.as_micros() + ms * 1000);
                reading = tracker.step(plant.counts() as u16, now);
                if ms < u64::from(period.as_millis()) {
                    motor.sample(&reading);
                    recording.inputs.push(input(reading.at, reading, Millivolts::new(0), [SAMPLE, 0, 0, 0]));
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
            recording.inputs.push(input(now, reading, battery, words(setpoint)));
            recording.answers.push([
                i32::from(report.control(&settings).get()).cast_unsigned(),
                (drive.mode as u32) << 16 | u32::from(drive.duty.to_bits()),
                report.velocity.to_bits().cast_unsigned(),
                report.position.cast_unsigned(),
            ]);
        }
        recording
    }
}

fn words(setpoint: Setpoint) -> [u32; 4] {
    match setpoint {
        Setpoint::Velocity(target) => [2, target.to_bits().cast_unsigned(), 0, 0],
        Setpoint::Position { target, tolerance, speed_limit } => {
            [3, target.cast_unsigned(), tolerance.into(), speed_limit.to_bits().cast_unsigned()]
        }
        other => unreachable!("no recording has {other:?}"),
    }
}

fn input(now: Micros, reading: Reading, battery: Millivolts, setpoint: [u32; 4]) -> Input {
    let halves = |time: Micros| [time.get() as u32, (time.get() >> 32) as u32];
    let [now, edge, at] = [now, reading.edge_at, reading.at].map(halves);
    let [kind, target, tolerance, limit] = setpoint;
    let (position, battery) = (reading.position.cast_unsigned(), battery.get().into());
    [now[0], now[1], position, edge[0], edge[1], at[0], at[1], battery, kind, target, tolerance, limit]
}

/// Largest number of inputs that the program on the chip takes at a time; the program has the same constant.
const BATCH: usize = 512;
/// Number for a sample between two ticks, in place of the kind of a set-point; the program on the chip has the same constant.
const SAMPLE: u32 = 4;

/// Numbers of instructions that each call has taken.
#[derive(Clone, Debug, Default)]
pub(crate) struct Counts {
    /// Instructions of each control step.
    pub(crate) steps: Vec<u64>,
    /// Instructions of each sample between two steps.
    pub(crate) samples: Vec<u64>,
}

/// The program that steps one motor on the chip.
pub(crate) struct OnChip {
    pub(crate) bench: Bench,
}

/// First instructions of a step and of the code after the step, and the same of a sample.
const CALLS: [&str; 4] = ["::step_motor", "::stepped", "::sample_motor", "::sampled"];

impl OnChip {
    /// Builds the program, and starts it with the settings of `recording`.
    pub(crate) fn new(recording: &Recording) -> Self {
        let image = elf::build("budget", elf::Variant::Usual);
        let mut bench = Bench::with_image(Setup::new(Vec::new()), &image);
        // The start-up code, which clears the memory, must end before the settings are written.
        bench.run(ms(1));
        let Settings { winding, duty, dynamics, coefficients, .. } = recording.settings;
        let words = vec![
            winding.emf.to_bits().cast_unsigned(),
            recording.period.as_millis(),
            u32::from(duty == DutyRule::LinearCurrent),
            dynamics.map_or(0, |known| known.gain.to_bits()),
            dynamics.map_or(0, |known| known.decay.to_bits()),
            u32::from(coefficients.is_some()),
        ];
        bench.write_words(bench.address("SETTINGS"), words);
        Self { bench }
    }

    /// Replays inputs, and returns the result of each tick.
    pub(crate) fn replay(&mut self, inputs: &[Input]) -> Vec<Answer> {
        let bench = &mut self.bench;
        let [to, from, pending] = ["INPUTS", "OUTPUTS", "PENDING"].map(|name| bench.address(name));
        let mut answers = Vec::new();
        for batch in inputs.chunks(BATCH) {
            bench.write_words(to, batch.as_flattened().to_vec());
            bench.write_words(pending, vec![batch.len() as u32]);
            let done = bench.run_while(ms(1), ms(10_000), |bench| bench.read_words(pending, 1) == [0]);
            assert!(done, "the program answers");
            let words = bench.read_words(from, 4 * batch.len());
            let ticks = words.as_chunks::<4>().0.iter().zip(batch).filter(|(_, input)| input[8] != SAMPLE);
            answers.extend(ticks.map(|(words, _)| *words));
        }
        answers
    }

    /// Replays inputs, and counts the instructions of each step and each sample.
    pub(crate) fn count(&mut self, inputs: &[Input]) -> Counts {
        let watched = CALLS.map(|name| self.bench.address(name));
        let [_, stepped, _, sampled] = watched;
        let (mut counts, mut from) = (Counts::default(), 0);
        for Hit { address, instruction_count: count, .. } in self.hits(watched.to_vec(), inputs) {
            if address == stepped {
                counts.steps.push(count - from);
            } else if address == sampled {
                counts.samples.push(count - from);
            }
            from = count;
        }
        counts
    }

    /// Replays inputs, and returns the executions of these instructions.
    fn hits(&mut self, watched: Vec<u64>, inputs: &[Input]) -> Vec<Hit> {
        self.bench.watch(watched);
        self.bench.take_hits();
        self.replay(inputs);
        self.bench.take_hits()
    }

    /// Replays inputs and counts the instructions of each call of a function from the motor's own functions, including the
    /// functions that it calls. Panics if the program has no such function, for example because the compiler has inlined it.
    pub(crate) fn count_within(&mut self, inputs: &[Input], function: &str) -> Vec<u64> {
        let entry = self.bench.address(function);
        let motor = |s: &&elf::Symbol| s.name.starts_with("<motor_hub::motor::Motor>::");
        let callers: Vec<_> =
            self.bench.symbols().iter().filter(motor).map(|s| s.address..s.address + s.size).collect();
        let watched = callers.iter().flat_map(|caller| caller.clone().step_by(2)).chain([entry]);
        let (mut counts, mut from) = (Vec::new(), None);
        for Hit { address, instruction_count: count, .. } in self.hits(watched.collect(), inputs) {
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
}
