//! Shows how a new board drives two motors. The board implements four traits, runs five tasks, and gets two commands.
//!
//! The board is a mock, so that the example runs on any computer: `cargo run --example two_motors`. On a chip the
//! traits read timers and write pins. The clock is the chip's, and an executor polls the tasks. Nothing else is
//! different.

use embassy_futures::join::join5;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, MockDriver};
use motor_hub::board::{Bridges, Encoders, SupplyAdc};
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeConstants, Drive};
use motor_hub::hub::{Command, Hub};
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::plant::{self, Plant};
use motor_hub::model::si::{Hertz, Kilograms, Metres, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::{self, Health, Wires};
use motor_hub::units::{CountsPerSecond, EmfConstant, Inductance, Millivolts, Period, Resistance, constant};
use std::cell::{Cell, RefCell};
use std::future::pending;
use std::ops::RangeInclusive;
use std::pin::pin;
use std::task::{Context, Waker};

/// Constants of a 12 V gear motor: back EMF in V s/rad and 28 counts per revolution, both of the motor shaft, resistance
/// in ohms, and inductance in mH.
const WINDING: Winding = Winding {
    emf: constant!(EmfConstant::from_ke(0.017_77, 28.0)),
    resistance: constant!(Resistance::from_ohms(3.3)),
    inductance: Some(constant!(Inductance::from_millihenries(0.694))),
};

/// A board. Its motors are simulated by the library's own physical model (feature `model`).
struct Board {
    plants: RefCell<[Plant; 2]>,
    drives: Cell<[Drive; 2]>,
}

impl Encoders<2> for &Board {
    fn counts(&mut self) -> [Option<u16>; 2] {
        self.plants.borrow().each_ref().map(|plant| Some(plant.counts() as u16))
    }
}

impl SupplyAdc for &Board {
    async fn sample(&mut self) -> Option<Millivolts> {
        Some(Millivolts::new(12_000))
    }

    async fn wait_until_outside(&mut self, _: RangeInclusive<Millivolts>) {
        pending().await
    }
}

impl Bridges<2> for &Board {
    fn apply(&mut self, drives: &[Drive; 2]) {
        self.drives.set(*drives);
    }
}

impl Board {
    fn new() -> Self {
        let motor = characterised("AM 60 A").expect("in the catalogue");
        let constants = BridgeConstants::IDEAL;
        let load = Load::flywheel(Kilograms(10.0), Metres(0.1));
        let pwm = Hertz(constants.pwm_hz().into());
        let plant = Plant::new(motor, load, Bridge::new(constants), pwm);
        Self { plants: RefCell::new([plant.clone(), plant]), drives: Cell::new([Drive::COAST; 2]) }
    }

    /// A millisecond passes.
    fn turn(&self) {
        for (plant, drive) in self.plants.borrow_mut().iter_mut().zip(self.drives.get()) {
            plant.run(Seconds(0.001), plant::PlantInput::pwm(drive.mode, drive.duty.to_f64()), Volts(12.0));
        }
    }
}

fn main() {
    let (board, wires, health) = (Board::new(), Wires::<NoopRawMutex, 2>::new(), Health::new());
    let mut hub = Hub::new([Settings::new(WINDING); 2], Period::DEFAULT);
    let mut tasks = pin!(join5(
        tasks::capture::run(&board, &wires, &health),
        tasks::supply::run(&board, Supply::new(Limits::default()), &wires, &health),
        tasks::control::run(&mut hub, &wires, &health),
        tasks::output::run(&board, Period::DEFAULT, &wires, &health),
        tasks::health::run(|| (), &health),
    ));

    // Any task may send commands. Motor 0 turns forward, and motor 1 moves to a position and holds it.
    let speed = Setpoint::Velocity(CountsPerSecond::new(1_000));
    let place = Setpoint::Position { target: 700, tolerance: 10, speed_limit: CountsPerSecond::new(1_500) };
    for (motor, setpoint) in [speed, place].into_iter().enumerate() {
        wires.try_send(Command::Set { motor, setpoint }).expect("16 commands may wait");
    }

    for ms in 0..=2_000 {
        // Replaces an executor: the tasks are polled several times, so that tasks whose timer is due, and tasks that
        // yield, continue in the same millisecond. The tasks never end.
        for _ in 0..4 {
            let _ = tasks.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        }
        if let Some(snapshot) = wires.snapshot.try_get().filter(|_| ms % 250 == 0) {
            let [a, b] = snapshot.motors;
            let (mode, duty) = (a.drive.mode.name(), 100.0 * a.drive.duty.to_f64());
            println!(
                "{ms:4} ms: {:4.0} counts/s by {mode} {duty:2.0} %; at {} counts",
                a.velocity.to_f64(),
                b.position
            );
        }
        board.turn();
        MockDriver::get().advance(Duration::from_millis(1));
    }
    let [a, b] = wires.snapshot.try_get().expect("the hub has taken ticks").motors;
    // A count in a control period is 20 counts/s.
    assert!((a.velocity.to_f64() - 1_000.0).abs() <= 20.0, "not at its speed");
    assert!(b.settled, "not at its target");
}
