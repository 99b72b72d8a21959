//! Recorded inputs of one motor's control step, with what the host's core makes of them, and the same
//! step on the emulated chip.
//!
//! The recording closes the loop through the plant: speeds, loads and set-points that a motor meets.
//! Replayed on the chip, every output must be the same to the last bit.
//!
//! ```
//! use emulated::Mounting;
//! use emulated::recording::Recording;
//! use motor_hub::braking::DutyRule;
//! use motor_hub::model::{catalogue::characterised, load::Load};
//! use motor_hub::motor::Setpoint;
//! use motor_hub::units::{Control, Period};
//! use simulated::hardware::BRIDGE;
//!
//! let motor = characterised("AM 60 A")?;
//! let alone = Mounting { motor, load: Load::NONE, bridge: BRIDGE.into(), stops: None };
//! let full = |_| Setpoint::ConstantPower(Control::MAX);
//! let recording = Recording::new(&alone, DutyRule::LinearCurrent, Period::DEFAULT, 10, full, |_| 0.0);
//! assert_eq!(recording.answers.last().map(|answer| answer.control), Some(Control::MAX.get()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use motor_hub::braking::{DutyRule, Winding};
use motor_hub::bridge::Drive;
use motor_hub::model::plant::{Command, Plant};
use motor_hub::model::si::{Hertz, NewtonMetres, Seconds, Volts};
use motor_hub::motion::{Reading, Tracker};
use motor_hub::motor::{Motor, Report, Setpoint, Settings};
use motor_hub::units::{CountsPerSecond, EmfConstant, Micros, Millivolts, Period};

use crate::bench::{Bench, Setup};
use crate::elf;
use crate::shafts::Mounting;

/// What one tick is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Input {
    /// The time of the tick.
    pub now: Micros,
    /// The encoder.
    pub reading: Reading,
    /// The battery.
    pub battery: Millivolts,
    /// What is asked for.
    pub setpoint: Setpoint,
}

/// What a tick answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Control value, -32767 to 32767.
    pub control: i16,
    /// Mode and duty.
    pub drive: Drive,
    /// Estimated speed.
    pub velocity: CountsPerSecond,
    /// Counts.
    pub position: i32,
}

impl From<Report> for Answer {
    fn from(report: Report) -> Self {
        Self {
            control: report.control.get(),
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

/// A closed loop, tick by tick.
#[derive(Clone, Debug)]
pub struct Recording {
    rule: DutyRule,
    period: Period,
    emf: EmfConstant,
    /// What went in.
    pub inputs: Vec<Input>,
    /// What came out on the host.
    pub answers: Vec<Answer>,
}

fn settings(emf: EmfConstant, duty: DutyRule) -> Settings {
    Settings { duty, ..Settings::new(Winding { emf, ..Winding::NEVEREST_60 }) }
}

impl Recording {
    /// Runs `ticks` of a motor under `setpoint`, a function of the tick, with the external torque of
    /// `torque` on its output shaft, on a battery that sags from 13 to 11 V meanwhile.
    ///
    /// # Panics
    /// If the motor is none that the core can drive.
    #[must_use]
    pub fn new(
        mounting: &Mounting,
        rule: DutyRule,
        period: Period,
        ticks: usize,
        setpoint: impl Fn(usize) -> Setpoint,
        torque: impl Fn(usize) -> f64,
    ) -> Self {
        let emf = EmfConstant::from_ke(mounting.motor.ke.0, mounting.motor.counts_per_rev_motor)
            .expect("a motor's back-EMF constant");
        let settings = settings(emf, rule);
        let pwm = Hertz(settings.bridge.pwm_hz().into());
        let mut plant = Plant::new(mounting.motor, mounting.load, mounting.bridge, pwm);
        let mut motor = Motor::new(settings, period);
        let mut tracker = Tracker::default();
        let (mut last, mut drive) = (Setpoint::Disabled, Drive::COAST);
        let mut recording = Self { rule, period, emf, inputs: Vec::new(), answers: Vec::new() };
        let mut reading = tracker.step(0, Micros::new(0));
        for tick in 0..ticks {
            let volts = 13.0 - 2.0 * tick as f64 / ticks as f64;
            for ms in 1..=u64::from(period.as_millis()) {
                let command = Command {
                    torque_after: NewtonMetres(torque(tick)),
                    ..Command::pwm(drive.mode, drive.duty.to_f64())
                };
                plant.run(Seconds(1e-3), command, Volts(volts));
                let now = Micros::new(tick as u64 * period.as_micros() + ms * 1000);
                reading = tracker.step(plant.counts() as u16, now);
            }
            // A tick comes a little after a sample.
            let now = Micros::new(reading.at.get() + 37);
            let input = Input {
                now,
                reading,
                battery: Millivolts::new((volts * 1000.0) as u16),
                setpoint: setpoint(tick),
            };
            if input.setpoint != last {
                last = input.setpoint;
                motor.set(last);
            }
            let report = motor.step(now, Some(reading), Some(input.battery));
            drive = report.drive;
            recording.inputs.push(input);
            recording.answers.push(report.into());
        }
        recording
    }
}

impl Input {
    fn words(&self) -> [u32; 12] {
        let speed = |speed: CountsPerSecond| speed.to_bits().cast_unsigned();
        let [kind, target, tolerance, limit] = match self.setpoint {
            Setpoint::Disabled => [0; 4],
            Setpoint::ConstantPower(power) => [1, i32::from(power.get()).cast_unsigned(), 0, 0],
            Setpoint::Velocity(target) => [2, speed(target), 0, 0],
            Setpoint::Position { target, tolerance, speed_limit } => {
                [3, target.cast_unsigned(), u32::from(tolerance), speed(speed_limit)]
            }
        };
        let halves = |time: Micros| [time.get() as u32, (time.get() >> 32) as u32];
        let [now, edge, at] = [self.now, self.reading.edge_at, self.reading.at].map(halves);
        [
            now[0],
            now[1],
            self.reading.position.cast_unsigned(),
            edge[0],
            edge[1],
            at[0],
            at[1],
            u32::from(self.battery.get()),
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
    begin: u64,
    end: u64,
}

/// As in the program.
const BATCH: usize = 512;

impl OnChip {
    /// Builds the program if need be, and boots it with the settings of `recording`.
    #[must_use]
    pub fn new(recording: &Recording) -> Self {
        let image =
            std::env::var_os("MOTOR_HUB_BUDGET_ELF").map_or_else(|| elf::build("budget"), PathBuf::from);
        let bench = Bench::with_image(Setup::new(Vec::new()), &image);
        let [settings, inputs, outputs, pending, begin, end] =
            ["SETTINGS", "INPUTS", "OUTPUTS", "PENDING", "::step_motor", "::stepped"]
                .map(|name| bench.address(name));
        let mut chip = Self { bench, image, settings, inputs, outputs, pending, begin, end };
        // Past the start-up code, which clears the memory.
        chip.bench.run(Duration::from_millis(1));
        let rule = u32::from(recording.rule == DutyRule::LinearCurrent);
        let words = vec![recording.emf.to_bits().cast_unsigned(), recording.period.as_millis(), rule];
        chip.bench.write_words(chip.settings, words);
        chip
    }

    /// Everything that the emulator could not do as the chip would.
    pub fn gaps(&mut self) -> Vec<String> {
        self.bench.gaps()
    }

    /// Replays inputs.
    ///
    /// # Panics
    /// If the program does not answer.
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
            answers.extend_from_slice(words.as_chunks::<4>().0);
        }
        answers
    }

    /// Replays inputs and counts the instructions of each step.
    pub fn count(&mut self, inputs: &[Input]) -> Vec<u64> {
        self.bench.watch(vec![self.begin, self.end]);
        self.bench.take_hits();
        self.replay(inputs);
        let (mut counts, mut from) = (Vec::new(), 0);
        for (address, count) in self.bench.take_hits() {
            if address == self.begin {
                from = count;
            } else {
                counts.push(count - from);
            }
        }
        counts
    }

    /// Replays inputs and says how often each instruction of the steps ran, by address.
    pub fn profile(&mut self, inputs: &[Input]) -> BTreeMap<u64, u64> {
        // Every even address might be an instruction; one that is not is never arrived at.
        let code = self.bench.symbols().iter().filter(|s| (0x0800_0000..0x0810_0000).contains(&s.address));
        let all = code.flat_map(|s| (s.address..s.address + s.size).step_by(2)).collect();
        self.bench.watch(all);
        self.bench.take_hits();
        self.replay(inputs);
        let mut within = false;
        let mut counts = BTreeMap::new();
        for (address, _) in self.bench.take_hits() {
            within = address == self.begin || within && address != self.end;
            if within {
                *counts.entry(address).or_default() += 1;
            }
        }
        counts
    }

    /// The program's image.
    #[must_use]
    pub fn image(&self) -> &Path {
        &self.image
    }

    /// The program's symbols.
    #[must_use]
    pub fn symbols(&self) -> &[elf::Symbol] {
        self.bench.symbols()
    }
}

/// Words of the host's answer, to compare with the chip's.
#[must_use]
pub fn expected(recording: &Recording) -> Vec<[u32; 4]> {
    recording.answers.iter().map(Answer::words).collect()
}
