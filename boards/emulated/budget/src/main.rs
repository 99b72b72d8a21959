//! Runs the control step of one motor with recorded inputs. The host, the program on the computer, writes the inputs to
//! words in memory and counts the instructions of each step. The program is compiled like the firmware. The watched
//! functions are not inlined, so that the host can watch their first instructions.
//!
//! The host writes [`SETTINGS`] once. It writes [`INPUTS`] in batches, and then the number of inputs to [`PENDING`].
//! The program writes its results to [`OUTPUTS`], and sets [`PENDING`] to 0. All are little-endian words.
#![no_std]
#![no_main]

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m as _;
use cortex_m_rt::entry;
use motor_hub::braking::{DutyRule, Winding};
use motor_hub::motion::Reading;
use motor_hub::motor::{Motor, Report, Setpoint, Settings};
use motor_hub::regulator::{Coefficients, Dynamics};
use motor_hub::supply::Battery;
use motor_hub::units::{
    AccelerationPerVolt, CountsPerSecond, DecayRate, EmfConstant, Micros, Millivolts, Period,
};

/// Inputs in a batch.
const BATCH: usize = 512;
/// Words of an input: time (2), position, edge time (2), sample time (2), battery, set-point (4).
const INPUT: usize = 12;
/// Words of an output.
const OUTPUT: usize = 4;

type Words<const N: usize> = [AtomicU32; N];

/// Settings of the motor, one word each: back-EMF constant (6q20), period in ms, duty rule (0 linear duty, 1 linear
/// current), acceleration per volt (0 for an unknown motor), decay rate, and coefficients (0 none, 1 the suggested
/// ones). Acceleration per volt and decay rate are in the steps of their types.
static SETTINGS: Words<6> = [const { AtomicU32::new(0) }; 6];
static INPUTS: Words<{ BATCH * INPUT }> = [const { AtomicU32::new(0) }; BATCH * INPUT];
static OUTPUTS: Words<{ BATCH * OUTPUT }> = [const { AtomicU32::new(0) }; BATCH * OUTPUT];
static PENDING: Words<1> = [const { AtomicU32::new(0) }; 1];

fn word(words: &[AtomicU32], index: usize) -> u32 {
    words.get(index).map_or(0, |word| word.load(Ordering::Relaxed))
}

fn put(words: &[AtomicU32], index: usize, value: u32) {
    if let Some(word) = words.get(index) {
        word.store(value, Ordering::Relaxed);
    }
}

/// Returns a set-point from its four words: kind, target, tolerance, speed limit.
fn setpoint(words: &[AtomicU32], at: usize) -> Setpoint {
    let speed = |bits: u32| CountsPerSecond::saturating_from_bits(i64::from(bits.cast_signed()));
    match word(words, at) {
        2 => Setpoint::Velocity(speed(word(words, at + 1))),
        3 => Setpoint::Position {
            target: word(words, at + 1).cast_signed(),
            tolerance: word(words, at + 2) as u16,
            speed_limit: speed(word(words, at + 3)),
        },
        _ => Setpoint::Disabled,
    }
}

/// Word that stands for a sample between two ticks, in place of the kind of a set-point.
const SAMPLE: u32 = 4;

/// The count of a sample begins at the first instruction of this function.
#[inline(never)]
fn sample_motor(motor: &mut Motor, reading: Reading) {
    motor.sample(&reading);
}

/// The count of a sample ends at the first instruction of this function.
#[inline(never)]
fn sampled() {
    core::hint::black_box(());
}

/// The count of a control step begins at the first instruction of this function.
#[inline(never)]
fn step_motor(motor: &mut Motor, now: Micros, reading: Reading, battery: Millivolts) -> Report {
    motor.step(now, Some(reading), Some(Battery::unlimited(battery, now)))
}

/// Writes the results of a step: control value, mode and duty, velocity, position. The count of a control step ends at
/// the first instruction of this function.
#[inline(never)]
fn stepped(index: usize, motor: &Motor, report: &Report) {
    let drive = report.drive;
    let mode = drive.mode as u32;
    put(&OUTPUTS, OUTPUT * index, i32::from(report.control(motor.settings()).get()).cast_unsigned());
    put(&OUTPUTS, OUTPUT * index + 1, mode << 16 | u32::from(drive.duty.to_bits()));
    put(&OUTPUTS, OUTPUT * index + 2, report.velocity.to_bits().cast_unsigned());
    put(&OUTPUTS, OUTPUT * index + 3, report.position.cast_unsigned());
}

fn time(words: &[AtomicU32], at: usize) -> Micros {
    Micros::new(u64::from(word(words, at + 1)) << 32 | u64::from(word(words, at)))
}

#[entry]
fn main() -> ! {
    // The host writes these words while the program runs, so the compiler must not assume constant values.
    core::hint::black_box((&SETTINGS, &INPUTS, &OUTPUTS, &PENDING));
    let mut motor = None;
    let mut last = Setpoint::Disabled;
    loop {
        let pending = word(&PENDING, 0) as usize;
        for index in 0..pending.min(BATCH) {
            let at = INPUT * index;
            let motor = motor.get_or_insert_with(new_motor);
            let reading = Reading {
                position: word(&INPUTS, at + 2).cast_signed(),
                edge_at: time(&INPUTS, at + 3),
                at: time(&INPUTS, at + 5),
            };
            if word(&INPUTS, at + 8) == SAMPLE {
                sample_motor(motor, reading);
                sampled();
                continue;
            }
            let wanted = setpoint(&INPUTS, at + 8);
            if wanted != last {
                last = wanted;
                motor.set(wanted);
            }
            let battery = Millivolts::new(word(&INPUTS, at + 7) as u16);
            let report = step_motor(motor, time(&INPUTS, at), reading, battery);
            stepped(index, motor, &report);
        }
        put(&PENDING, 0, 0);
        while word(&PENDING, 0) == 0 {
            cortex_m::asm::nop();
        }
    }
}

fn new_motor() -> Motor {
    let emf = EmfConstant::from_bits(word(&SETTINGS, 0).cast_signed())
        .unwrap_or_else(|_| panic!("the host gives a back-EMF constant"));
    let period = Period::from_millis(word(&SETTINGS, 1)).unwrap_or_default();
    let mut settings = Settings::new(Winding { emf, ..Winding::NEVEREST_60 });
    settings.duty = match word(&SETTINGS, 2) {
        0 => DutyRule::LinearDuty,
        _ => DutyRule::LinearCurrent,
    };
    settings.dynamics = AccelerationPerVolt::from_bits(word(&SETTINGS, 3)).ok().map(|gain| Dynamics {
        gain,
        decay: DecayRate::from_bits(word(&SETTINGS, 4)),
        friction: Millivolts::new(0),
    });
    if word(&SETTINGS, 5) != 0 {
        settings.coefficients = Some(Coefficients::suggested(emf));
    }
    Motor::new(settings, period)
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
