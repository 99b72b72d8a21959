//! The physical world behind the board's traits: plants on a battery, with the measurements and outputs of a chip.
//!
//! ```
//! use motor_hub::board::Bridges;
//! use motor_hub::bridge::{Drive, Mode};
//! use motor_hub::model::si::Seconds;
//! use motor_hub::units::Duty;
//! use simulated::{scenario::Scenario, world::Board};
//!
//! let mut board = Board::new(&Scenario::to_serve());
//! let full = Drive { mode: Mode::Cw98, duty: Duty::ONE };
//! board.apply(&[full, Drive::COAST, Drive::COAST, Drive::COAST]);
//! board.run(Seconds(0.1), &[0.0; 4]);
//! assert!(board.view().motors[0].0 > 0.0, "it turns");
//! ```

use crate::current_line::CurrentLine;
use crate::encoder::Counter;
use crate::ground::Ground;
use crate::hardware::{BRIDGE, MOTORS};
use crate::i2c::{Fault, I2cDevices};
use crate::scenario::{Attached, Motor, Scenario, Timed};
use crate::sim::STEP_S;
use embassy_time::Timer;
use motor_hub::board::{
    ANALOG_INPUTS, AnalogReading, AnalogReadings, BridgeSensors, Bridges, DIGITAL_PINS, Devices, Encoders,
    Equipment, I2C_BUSES, SERVOS, ServoPulse, SupplyAdc,
};
use motor_hub::bridge::{BridgeConstants, BridgeFeedback, Drive, SenseScale};
use motor_hub::group::Pose;
use motor_hub::model::bus::{Bus, Shutdown};
use motor_hub::model::plant::{Flow, Plant, PlantInput};
use motor_hub::model::rig::Rig;
use motor_hub::model::si::{Hertz, NewtonMetres, Seconds};
use motor_hub::model::switching::Bridge;
use motor_hub::supply::{VrefintCalibration, VrefintScale};
use motor_hub::tasks::supply::WATCH_INTERVAL;
use motor_hub::units::{Duty, Milliamperes, Millivolts, constant};
use std::cell::RefCell;
use std::ops::RangeInclusive;
use std::rc::Rc;

/// The bus's divider: 47 k over 10 k brings up to 18.6 V within the converter's range. Higher voltages read as 18.6 V.
const DIVIDER_OHMS: (u32, u32) = (47_000, 10_000);
/// Supply of the chip: as on real boards it differs from the nominal 3.3 V.
const RAIL_V: f64 = 3.27;
/// Voltage of the chip's internal reference VREFINT.
const VREFINT_V: f64 = 1.21;
/// Calibration of VREFINT by the factory.
const CALIBRATION: VrefintCalibration =
    VrefintCalibration { reading: 1501, rail: Millivolts::new(3_300), bits: 12 };
/// Scale of the converter for voltages.
const SCALE: VrefintScale = constant!(VrefintScale::new(DIVIDER_OHMS.0, DIVIDER_OHMS.1, CALIBRATION));
/// Scale of the converter for analog inputs, which have no divider.
const PIN_SCALE: VrefintScale = constant!(VrefintScale::new(1, 1_000_000, CALIBRATION));
/// Scale of the converter for the 5 V rail, which is divided by two.
const FIVE_VOLT_SCALE: VrefintScale = constant!(VrefintScale::new(10_000, 10_000, CALIBRATION));
/// True voltage of the 5 V rail.
const FIVE_VOLTS: f64 = 5.02;
/// Temperature of the board in 0.1 degrees Celsius.
const TEMPERATURE_DECIDEGREES: i16 = 312;
/// Current of a BNO055 in its fusion modes, in mA (data sheet: 12.3 mA).
const IMU_MA: i32 = 12;
/// Current of a small servo without load, in mA. A guess.
const IDLE_SERVO_MA: i32 = 8;
/// Largest reading of the 12-bit converter.
const FULL_SCALE: f64 = 4095.0;
/// Scale of the converter for currents.
const SENSE_SCALE: SenseScale = SenseScale::VNH5019_CARRIER;
/// Standard deviation of a conversion, in counts.
const NOISE: f64 = 1.5;

/// A watchdog that is not fed for this long resets the chip.
const WATCHDOG_S: f64 = 0.5;

/// Plants, battery, bridges, converter and watchdog.
pub struct World {
    rig: Rig,
    drives: [Drive; MOTORS],
    bridges: Vec<BridgeConstants>,
    counters: Vec<Counter>,
    /// Current-sense lines, and the amperes that their bridges sensed in the last run.
    lines: [(CurrentLine, f64); MOTORS],
    /// True for a bridge that has reported a fault and switched itself off, because it has taken a duty for a short
    /// circuit. The bridge stays off until it is commanded to coast.
    faults: [bool; MOTORS],
    /// Levels that push-buttons give the digital pins: bit i is pin i. A pin that nothing connects is pulled up.
    outside: u8,
    /// Digital pins that a wire connects: bit i is pin i.
    wired: u8,
    servos: [Option<ServoPulse>; SERVOS],
    /// Voltages at the analog inputs, in volts. An open input is pulled down.
    analog_v: [f64; ANALOG_INPUTS],
    i2c: I2cDevices,
    /// The drive base with the inertial sensor.
    ground: Ground,
    noise: fastrand::Rng,
    unfed_s: f64,
    starved: bool,
}

/// The board. Each task has a copy; all copies refer to the same world.
#[derive(Clone)]
pub struct Board(Rc<RefCell<World>>);

/// State of the world at one moment.
#[derive(Clone, Debug)]
pub struct View {
    /// Voltage at the battery's terminals, or of the bus, in volts.
    pub battery_v: f64,
    /// Highest voltage so far.
    pub highest_v: f64,
    /// Number of bridges that are open because the voltage was too low or too high.
    pub shut_down: usize,
    /// Speed in counts/s, and position in whole counts, by motor.
    pub motors: Vec<(f64, i64)>,
}

impl Board {
    /// The board of a scenario, with its motors at rest.
    pub fn new(scenario: &Scenario) -> Self {
        let Scenario { battery, motors, seed, floor, gyro, .. } = scenario;
        let pwm = Hertz(f64::from(BRIDGE.pwm_hz()));
        let plant = |motor: &Motor| {
            let plant = Plant::new(motor.constants, motor.load, Bridge::new(motor.bridge), pwm);
            if let Some(train) = motor.train { plant.with_train(train) } else { plant }
        };
        let mut rig = Rig::new(*battery, motors.iter().map(plant).collect());
        if let Some(known) = &scenario.bus {
            let mut bus = Bus::new(*battery, known.capacitance_f);
            bus.one_way = known.one_way;
            rig = rig.with_bus(bus);
        }
        let mut lines = [(CurrentLine::Absent, 0.0); MOTORS];
        for ((line, _), motor) in lines.iter_mut().zip(motors) {
            *line = motor.current_line;
        }
        let mut i2c = I2cDevices::default();
        i2c.imu.errors = *gyro;
        let board = Self(Rc::new(RefCell::new(World {
            rig,
            drives: [Drive::COAST; MOTORS],
            bridges: motors.iter().map(|motor| motor.bridge).collect(),
            counters: (0..motors.len() as u64).map(|motor| Counter::new(seed ^ motor)).collect(),
            lines,
            faults: [false; MOTORS],
            outside: u8::MAX,
            wired: scenario.wire.into_iter().flatten().fold(0, |wired, pin| wired | bit(pin.get())),
            servos: [None; SERVOS],
            analog_v: [0.0; ANALOG_INPUTS],
            i2c,
            ground: Ground::new(*floor),
            noise: fastrand::Rng::with_seed(*seed),
            unfed_s: 0.0,
            starved: false,
        })));
        board.connect(&scenario.attached);
        board
    }

    /// Sets battery, motors and connected devices as the scenario has them at a time.
    pub(crate) fn change(&self, scenario: &Scenario, now_s: f64) {
        self.0.borrow_mut().change(scenario, now_s);
        let step = |at_s: f64| (at_s / STEP_S).round();
        for Timed { at_s, value } in &scenario.attached_over_time {
            if step(*at_s) == step(now_s) {
                self.connect(value);
            }
        }
    }

    /// Connects what the scenario has connected at the start, and nothing else.
    pub(crate) fn connect_as_at_start(&self, scenario: &Scenario) {
        self.connect(&Attached {
            analog_v: vec![0.0; ANALOG_INPUTS],
            low_pins: Some(Vec::new()),
            i2c_faults: vec![Fault::None; I2C_BUSES],
        });
        self.connect(&scenario.attached);
    }

    /// Changes what is connected to the pins and the I2C buses.
    fn connect(&self, change: &Attached) {
        for (input, volts) in change.analog_v.iter().enumerate() {
            self.set_analog(input, *volts);
        }
        if let Some(low_pins) = &change.low_pins {
            for pin in 0..DIGITAL_PINS as u8 {
                self.press(pin, low_pins.iter().any(|low| low.get() == pin));
            }
        }
        self.with_i2c(|devices| {
            for (fault, changed) in devices.faults.iter_mut().zip(&change.i2c_faults) {
                *fault = *changed;
            }
        });
    }

    /// Changes a motor's plant, from now on.
    pub(crate) fn with_plant(&self, motor: usize, act: impl FnOnce(&mut Plant)) {
        self.0.borrow_mut().rig.plants.get_mut(motor).map(act);
    }

    /// Connects a digital pin, 0 to 7, to ground, or disconnects the pin from ground, as a push-button does.
    pub fn press(&self, pin: u8, pressed: bool) {
        let bit = bit(pin);
        let outside = &mut self.0.borrow_mut().outside;
        *outside = if pressed { *outside & !bit } else { *outside | bit };
    }

    /// Returns the pulses of the servo outputs.
    pub fn servos(&self) -> [Option<ServoPulse>; SERVOS] {
        self.0.borrow().servos
    }

    /// Sets the voltage at an analog input, in volts. Does nothing for an input that the board does not have.
    pub fn set_analog(&self, input: usize, volts: f64) {
        if let Some(voltage) = self.0.borrow_mut().analog_v.get_mut(input) {
            *voltage = volts;
        }
    }

    /// Returns where the drive base is.
    pub fn pose(&self) -> Pose {
        self.0.borrow().ground.pose()
    }

    pub(crate) fn with_i2c<T>(&self, act: impl FnOnce(&mut I2cDevices) -> T) -> T {
        act(&mut self.0.borrow_mut().i2c)
    }

    pub(crate) fn feed_watchdog(&self) {
        self.0.borrow_mut().unfed_s = 0.0;
    }

    /// Lets time pass under external torques in newton metres, one for each motor.
    pub fn run(&self, time: Seconds, torques: &[f64]) -> Vec<Flow> {
        let mut world = self.0.borrow_mut();
        let drives = world.drives.iter().zip(world.faults);
        let drives = drives.map(|(drive, fault)| if fault { Drive::COAST } else { *drive });
        let commands: Vec<_> = drives
            .zip(torques)
            .map(|(drive, &torque)| PlantInput {
                torque_after: NewtonMetres(torque),
                ..PlantInput::pwm(drive.mode, drive.duty.to_f64())
            })
            .collect();
        world.unfed_s += time.0;
        world.starved |= world.unfed_s > WATCHDOG_S;
        let flows = world.rig.run(time, &commands);
        let World { counters, rig, lines, .. } = &mut *world;
        for ((_, sensed), flow) in lines.iter_mut().zip(&flows) {
            *sensed = if flow.time.0 > 0.0 { flow.charge_shown.0 / flow.time.0 } else { 0.0 };
        }
        for (counter, plant) in counters.iter_mut().zip(&rig.plants) {
            counter.turn(plant.counts(), (1e9 * time.0).round() as u64);
        }
        world.move_base(time.0);
        flows
    }

    /// Returns the state of the world.
    pub fn view(&self) -> View {
        let world = self.0.borrow();
        let motors = world.rig.plants.iter().map(|plant| {
            let turns = plant.speed().0 / std::f64::consts::TAU;
            (turns * plant.motor().counts_per_rev_motor, plant.counts())
        });
        let shut_down = world.rig.shutdowns().iter().filter(|&&bridge| bridge != Shutdown::None).count();
        let (battery_v, highest_v) = (world.rig.voltage().0, world.rig.range().1.0);
        View { battery_v, highest_v, shut_down, motors: motors.collect() }
    }

    /// True if the true voltage of the battery is outside this range.
    pub(crate) fn has_left(&self, quiet: &RangeInclusive<Millivolts>) -> bool {
        let millivolts = 1e3 * self.0.borrow().rig.voltage().0;
        let [low, high] = [quiet.start(), quiet.end()].map(|voltage| f64::from(voltage.get()));
        millivolts < low || millivolts > high
    }

    /// True if the watchdog would have reset the chip.
    pub fn starved(&self) -> bool {
        self.0.borrow().starved
    }
}

impl World {
    /// Sets battery, temperatures and encoders as the scenario has them at a time.
    fn change(&mut self, scenario: &Scenario, now_s: f64) {
        self.rig.battery.emf = scenario.emf_at(now_s);
        if let Some(bus) = &mut self.rig.bus {
            let opens_at_s = scenario.bus.and_then(|bus| bus.opens_at_s);
            bus.closed = opens_at_s.is_none_or(|at_s| now_s < at_s);
        }
        let parts = self.rig.plants.iter_mut().zip(&mut self.counters);
        for ((plant, counter), motor) in parts.zip(&scenario.motors) {
            plant.set_temperatures(motor.temperatures_at(now_s));
            counter.connect(motor.encoder_at(now_s));
        }
    }

    /// Moves the drive base, on which the inertial sensor stands. Motor 0 drives the left wheel, motor 1 the right one.
    /// A board with less than two motors has no base.
    fn move_base(&mut self, time_s: f64) {
        let before = self.ground.pose().heading_degrees;
        if let [left, right, ..] = self.rig.plants.as_slice() {
            self.ground.turn([left.angle_after(), right.angle_after()]);
        }
        let after = self.ground.pose().heading_degrees;
        let rate = if time_s > 0.0 { (after - before) / time_s } else { 0.0 };
        self.i2c.imu.run(time_s, after.to_radians(), rate.to_radians());
    }

    /// Converts a voltage at a pin to counts, with noise.
    fn convert(&mut self, volts: f64) -> u16 {
        // The sum of three uniform numbers has a standard deviation of 1/2.
        let sum = self.noise.f64() + self.noise.f64() + self.noise.f64() - 1.5;
        counts(volts, 2.0 * NOISE * sum)
    }
}

/// Converts a voltage at a pin to counts, with this noise in counts.
fn counts(volts: f64, noise: f64) -> u16 {
    (volts / RAIL_V * FULL_SCALE + noise).round().clamp(0.0, FULL_SCALE) as u16
}

impl Encoders<MOTORS> for Board {
    fn counts(&mut self) -> [Option<u16>; MOTORS] {
        // A channel without a motor has a counter that stands still, as on a chip.
        let mut counts = [Some(0); MOTORS];
        for (count, counter) in counts.iter_mut().zip(&self.0.borrow().counters) {
            // A counter of 16 bits wraps.
            *count = Some(counter.count() as u16);
        }
        counts
    }
}

impl SupplyAdc for Board {
    async fn sample(&mut self) -> Option<Millivolts> {
        let mut world = self.0.borrow_mut();
        let (top, bottom) = (f64::from(DIVIDER_OHMS.0), f64::from(DIVIDER_OHMS.1));
        let pin = world.rig.voltage().0 * bottom / (top + bottom);
        let divider = world.convert(pin);
        SCALE.battery(divider, world.convert(VREFINT_V))
    }

    async fn wait_until_outside(&mut self, quiet: RangeInclusive<Millivolts>) {
        loop {
            Timer::after(WATCH_INTERVAL).await;
            if self.has_left(&quiet) {
                return;
            }
        }
    }
}

impl Bridges<MOTORS> for Board {
    fn apply(&mut self, drives: &[Drive; MOTORS]) {
        let world = &mut *self.0.borrow_mut();
        world.drives = *drives;
        for ((drive, bridge), fault) in drives.iter().zip(&world.bridges).zip(&mut world.faults) {
            *fault = *drive != Drive::COAST && (*fault || takes_for_a_short_circuit(bridge, drive.duty));
        }
    }
}

impl BridgeSensors<MOTORS> for Board {
    async fn sample(&mut self) -> [BridgeFeedback; MOTORS] {
        let mut world = self.0.borrow_mut();
        let faults = world.faults;
        let mut feedback = faults.map(|fault| BridgeFeedback { current: None, fault });
        for (feedback, (line, sensed)) in feedback.iter_mut().zip(world.lines) {
            let word = line.volts(sensed).map(|volts| world.convert(volts));
            feedback.current = word.map(|word| SENSE_SCALE.current(word, 12));
        }
        feedback
    }
}

/// True if a bridge takes this duty for a short circuit of its output to the battery. A real bridge does so if its PWM
/// line is low for too short a time.
fn takes_for_a_short_circuit(bridge: &BridgeConstants, duty: Duty) -> bool {
    let low_ns = 1e9 * (1.0 - duty.to_f64()) / f64::from(bridge.pwm_hz());
    // One step of a duty, which has 15 bits.
    let rounding_ns = 1e9 / 32_768.0 / f64::from(bridge.pwm_hz());
    low_ns > 0.0 && low_ns + rounding_ns < f64::from(bridge.timing.least_off_ns)
}

/// The board has all devices. An open analog input is pulled down.
impl Devices for Board {
    fn equipment(&self) -> Equipment {
        Equipment {
            digital: u8::MAX,
            servos: SERVOS as u8,
            analog: ANALOG_INPUTS as u8,
            i2c: I2C_BUSES as u8,
            rail: true,
            temperature: true,
        }
    }

    fn set_servos(&mut self, servos: &[Option<ServoPulse>; SERVOS]) {
        self.0.borrow_mut().servos = *servos;
    }

    fn analog(&mut self) -> AnalogReadings {
        let vrefint = counts(VREFINT_V, 0.0);
        let servos = self.servos().iter().flatten().count() as i32;
        let inputs = self.0.borrow().analog_v.map(|volts| {
            let counts = counts(volts, 0.0);
            let voltage = PIN_SCALE.battery(counts, vrefint)?;
            Some(AnalogReading { voltage, counts })
        });
        AnalogReadings {
            inputs,
            rail: FIVE_VOLT_SCALE.battery(counts(0.5 * FIVE_VOLTS, 0.0), vrefint),
            temperature_decidegrees: Some(TEMPERATURE_DECIDEGREES),
            // Nothing draws current from the digital pins.
            supply_currents: Some([0, IMU_MA, servos * IDLE_SERVO_MA].map(|ma| Some(Milliamperes::new(ma)))),
        }
    }

    fn update_digital_pins(&mut self, driven: u8, levels: u8) -> u8 {
        let world = self.0.borrow();
        let alone = world.outside & !driven | levels & driven;
        // A wire is low if one of its pins is low.
        if alone & world.wired == world.wired { alone } else { alone & !world.wired }
    }
}

/// Bit of a digital pin; 0 beyond the eighth pin.
fn bit(pin: u8) -> u8 {
    1u8.checked_shl(pin.into()).unwrap_or(0)
}
