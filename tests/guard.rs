//! The encoder check finds encoders that are unplugged or reversed, and does not take a stalled motor for either.

use motor_hub::braking::{DutyRule, Regime, Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive, Mode};
use motor_hub::hub::{Action, Command, Hub, Inputs, Snapshot};
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::plant::{self, Plant};
use motor_hub::model::si::{Hertz, KgM2, NewtonMetres, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motion::{Pidf, Reading, Tracker};
use motor_hub::motor::{EncoderFault, Motor as Controlled, Report, Setpoint, Settings};
use motor_hub::regulator::{Coefficients, Dynamics, Mechanics};
use motor_hub::supply::Battery;
use motor_hub::units::{Coefficient, Control, CountsPerSecond, Duty, Micros, Millivolts, Period};

const BRIDGE: Bridge = Bridge::new(BridgeConstants::IDEAL);

fn neverest_60() -> Motor {
    let entry = catalogue::find("AM 60 A").expect("known");
    entry.motor.expect("characterised").with_measured_rotor_inertia()
}

/// The dynamics of the motor of a [`Bench`] with its default load.
fn configured() -> Dynamics {
    let motor = neverest_60();
    let load = Load { inertia_after: KgM2(0.05), ..Load::NONE };
    let shaft = Shaft::new(&motor, &load);
    let mechanics = Mechanics {
        torque_constant: motor.kt.0,
        counts_per_turn: motor.counts_per_rev_motor,
        inertia: shaft.inertia.0,
        drag: shaft.drag.0,
        friction: 0.0,
    };
    Dynamics::from_mechanics(&Winding::NEVEREST_60, &BridgeConstants::IDEAL, &mechanics).expect("in range")
}

/// One simulated motor with its load and its encoder.
struct Axis {
    plant: Plant,
    tracker: Tracker,
    /// True if the encoder is plugged in.
    plugged: bool,
    /// True if the encoder counts in the other direction.
    reversed: bool,
    /// Count of the encoder. It stays while the encoder is unplugged.
    count: i64,
    /// True if one of the encoder's two wires is stuck, so that the count toggles by one.
    one_wire: bool,
    /// Stiffness of the stops at the motor's shaft, in N m/rad; `None` for hard stops.
    spring: Option<f64>,
    /// Load torque at the output, in N m.
    torque: f64,
    /// Motor angles of the two stops, in radians.
    stops: (f64, f64),
}

impl Axis {
    fn new() -> Self {
        Self::with(KgM2(0.05))
    }

    fn with(inertia: KgM2) -> Self {
        let load = Load { inertia_after: inertia, ..Load::NONE };
        Self {
            plant: Plant::new(neverest_60(), load, BRIDGE, Hertz(20_000.0)),
            tracker: Tracker::default(),
            plugged: true,
            reversed: false,
            count: 0,
            one_wire: false,
            spring: None,
            torque: 0.0,
            stops: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    fn run_ms(&mut self, drive: Drive) {
        let mut command = plant::PlantInput::pwm(drive.mode, drive.duty.to_f64());
        let angle = self.plant.angle();
        let beyond = angle - angle.clamp(self.stops.0, self.stops.1);
        command.torque_after = NewtonMetres(self.torque - self.spring.unwrap_or(0.0) * beyond);
        self.plant.run(Seconds(1e-3), command, Volts(12.0));
        let angle = self.plant.angle();
        let stopped_at = angle.clamp(self.stops.0, self.stops.1);
        if stopped_at != angle && self.spring.is_none() {
            self.plant.place(self.plant.current(), motor_hub::model::si::RadPerSec(0.0), stopped_at);
        }
        if self.plugged && self.one_wire {
            // The other wire toggles once in two counts.
            self.count += (self.plant.counts() / 2).rem_euclid(2) - self.count.rem_euclid(2);
        } else if self.plugged {
            self.count = self.plant.counts();
        }
    }
}

/// A hub with `N` simulated axes, which run in steps of 1 ms.
struct Bench<const N: usize> {
    hub: Hub<N>,
    axes: [Axis; N],
    drives: [Drive; N],
    ms: u64,
    snapshot: Snapshot<N>,
}

impl<const N: usize> Bench<N> {
    fn new(period_ms: u32) -> Self {
        Self::with(period_ms, Settings::new(Winding::NEVEREST_60))
    }

    fn with(period_ms: u32, settings: Settings) -> Self {
        Self {
            hub: Hub::new([settings; N], Period::from_millis(period_ms).expect("period")),
            axes: std::array::from_fn(|_| Axis::new()),
            drives: [Drive::COAST; N],
            ms: 0,
            snapshot: Snapshot::INITIAL,
        }
    }

    fn set(&mut self, motor: usize, setpoint: Setpoint) {
        self.hub.apply(Command { motor, action: Action::Set(setpoint) }).expect("motor");
    }

    fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.ms += 1;
            let now = Micros::new(self.ms * 1000);
            let mut readings = self.axes.each_mut().map(|axis| axis.tracker.step(0, now));
            for ((axis, drive), reading) in self.axes.iter_mut().zip(self.drives).zip(&mut readings) {
                axis.run_ms(drive);
                let count = if axis.reversed { -axis.count } else { axis.count };
                *reading = axis.tracker.step(count as u16, now);
            }
            if self.ms.is_multiple_of(u64::from(self.hub.period().as_millis())) {
                let battery = Some(Battery::good(Millivolts::new(12_000), now));
                self.snapshot = self.hub.step(&Inputs { now, readings: readings.map(Some), battery });
                self.drives = self.snapshot.drives();
            }
        }
    }

    fn fault(&self, motor: usize) -> Option<EncoderFault> {
        self.snapshot.motors[motor].faults.encoder
    }

    /// Runs until there is a fault; returns the time in ms.
    fn run_until_fault(&mut self, motor: usize) -> u64 {
        let start = self.ms;
        while self.fault(motor).is_none() {
            self.run_ms(1);
            assert!(self.ms - start < 5_000, "no fault: {:?}", self.snapshot.motors[motor]);
        }
        self.ms - start
    }
}

fn velocity(cps: i32) -> Setpoint {
    Setpoint::Velocity(CountsPerSecond::new(cps))
}

fn position(target: i32) -> Setpoint {
    Setpoint::Position { target, tolerance: 10, speed_limit: CountsPerSecond::new(2_000) }
}

/// Settings of every scheme with every duty rule.
fn all_schemes() -> impl Iterator<Item = Settings> {
    Scheme::EACH.into_iter().flat_map(|scheme| {
        DutyRule::EACH.map(|duty| Settings { duty, ..Settings::for_scheme(Winding::NEVEREST_60, scheme) })
    })
}

const PERIODS: [u32; 4] = [5, 10, 25, 50];

#[test]
fn an_encoder_unplugged_from_the_start_is_at_fault_within_250_ms_of_strong_drive() {
    for period in PERIODS {
        for setpoint in [velocity(2_000), velocity(-1_500), position(50_000)] {
            let mut bench = Bench::<1>::new(period);
            bench.axes[0].plugged = false;
            bench.set(0, setpoint);
            // This control value turns every motor that is not blocked.
            while bench.snapshot.motors[0].control.get().abs() < 20_000 {
                bench.run_ms(1);
                assert!(bench.ms <= 200, "{period} ms period: no strong drive");
            }
            let ms = bench.run_until_fault(0);
            assert!(ms <= 250 + u64::from(period), "{period} ms period: after {ms} ms");
            assert_eq!(bench.fault(0), Some(EncoderFault::Stuck));
            assert_eq!(bench.drives, [Drive::COAST]);
        }
    }
}

#[test]
fn an_encoder_unplugged_while_the_motor_turns_is_at_fault_within_300_ms() {
    for period in PERIODS {
        let mut bench = Bench::<1>::new(period);
        bench.set(0, velocity(1_500));
        bench.run_ms(3_000);
        assert_eq!(bench.fault(0), None);
        bench.axes[0].plugged = false;
        // Up to one period until the first tick without counts, and one until the drive is strong.
        let ms = bench.run_until_fault(0);
        assert!(ms <= 300, "{period} ms period: after {ms} ms");
        assert_eq!(bench.fault(0), Some(EncoderFault::Stuck));
    }
}

#[test]
fn an_encoder_with_one_broken_wire_is_at_fault_within_250_ms_of_strong_drive_at_every_period() {
    for period in [1, 2, 5, 10, 20, 50, 60, 80, 100] {
        for dynamics in [None, Some(configured())] {
            for from in [0, 1_500] {
                let settings = Settings { dynamics, ..Settings::new(Winding::NEVEREST_60) };
                let mut bench = Bench::<1>::with(period, settings);
                bench.set(0, velocity(from));
                bench.run_ms(2_000);
                bench.axes[0].one_wire = true;
                bench.set(0, velocity(1_000));
                while bench.snapshot.motors[0].control.get().abs() < 28_000 {
                    bench.run_ms(1);
                    assert!(bench.ms <= 3_000, "{period} ms period: no strong drive");
                }
                let ms = bench.run_until_fault(0);
                // The drive may have become strong in the middle of a period.
                let most = 250 + u64::from(period);
                assert!(ms <= most, "{period} ms period, from {from}, {dynamics:?}: after {ms} ms");
                assert_eq!(bench.fault(0), Some(EncoderFault::Stuck));
            }
        }
    }
}

#[test]
fn a_motor_at_a_springy_stop_is_probed_once_and_has_no_fault() {
    for period in [5, 50, 100] {
        for dynamics in [None, Some(configured())] {
            // Stiffness at the output shaft, in N m/rad.
            for stiffness in [20.0, 100.0, 1_000.0] {
                if period == 50 && dynamics.is_none() && stiffness < 100.0 {
                    // This stop throws an unknown motor back for longer than the check waits.
                    continue;
                }
                let settings = Settings { dynamics, ..Settings::new(Winding::NEVEREST_60) };
                let mut bench = Bench::<1>::with(period, settings);
                bench.axes[0].stops = (-200.0, 200.0);
                bench.axes[0].spring = Some(stiffness / 60.0);
                bench.set(0, velocity(1_500));
                let (mut probes, mut probing) = (0, false);
                for _ in 0..15_000 {
                    bench.run_ms(1);
                    let back = bench.drives[0].mode == Mode::Ccw62
                        && bench.snapshot.motors[0].control < Control::ZERO;
                    probes += u32::from(back && !probing);
                    probing = back;
                }
                assert_eq!(bench.fault(0), None, "{period} ms, {stiffness} N m/rad, {dynamics:?}");
                assert!(probes <= 1, "{period} ms, {stiffness} N m/rad, {dynamics:?}: {probes} times");
            }
        }
    }
}

#[test]
fn a_motor_that_may_not_be_probed_is_not_driven_back() {
    let settings = Settings { probing: false, ..Settings::new(Winding::NEVEREST_60) };
    let mut bench = Bench::<1>::with(50, settings);
    bench.axes[0].plugged = false;
    bench.set(0, velocity(1_500));
    while bench.fault(0).is_none() {
        bench.run_ms(50);
        assert!(bench.snapshot.motors[0].control >= Control::ZERO);
        assert!(bench.ms < 1_000);
    }
}

#[test]
fn friction_up_to_40_percent_of_stall_raises_no_fault_of_a_sound_encoder() {
    for period in [1, 10, 50, 100] {
        for dynamics in [None, Some(configured())] {
            // Friction of up to 40 % of the stall torque, against the motion.
            for share in [0.2, 0.4] {
                let settings = Settings { dynamics, ..Settings::new(Winding::NEVEREST_60) };
                let mut bench = Bench::<1>::with(period, settings);
                for cps in [60, 200, -200, 1_000, -1_000] {
                    bench.set(0, velocity(cps));
                    for _ in 0..2_000 {
                        let moving = bench.snapshot.motors[0].velocity.to_f64();
                        bench.axes[0].torque = -3.8 * share * (moving / 5.0).clamp(-1.0, 1.0);
                        bench.run_ms(1);
                    }
                    assert_eq!(bench.fault(0), None, "{period} ms, {cps} counts/s, {share}, {dynamics:?}");
                }
            }
        }
    }
}

#[test]
fn a_reversed_encoder_is_at_fault_within_250_ms_of_running_away() {
    for period in PERIODS {
        for cps in [2_000, -2_000] {
            let mut bench = Bench::<1>::new(period);
            bench.axes[0].reversed = true;
            bench.set(0, velocity(cps));
            // The motor runs away clearly from a tenth of the free speed on.
            while bench.snapshot.motors[0].velocity.round().abs() < 301 {
                bench.run_ms(1);
            }
            let ms = bench.run_until_fault(0);
            assert!(ms <= 250, "{period} ms period: after {ms} ms");
            assert_eq!(bench.fault(0), Some(EncoderFault::Reversed));
            assert_eq!(bench.drives, [Drive::COAST]);
        }
    }
}

#[test]
fn a_fault_is_latched_until_the_motor_is_disabled_and_affects_no_other_motor() {
    let mut bench = Bench::<2>::new(50);
    let mut alone = Bench::<2>::new(50);
    bench.axes[0].plugged = false;
    bench.set(0, velocity(2_000));
    for bench in [&mut bench, &mut alone] {
        bench.set(1, velocity(1_000));
        bench.run_ms(2_000);
    }
    assert_eq!(bench.fault(0), Some(EncoderFault::Stuck));
    assert_eq!(bench.snapshot.motors[1], alone.snapshot.motors[1]);

    bench.axes[0].plugged = true;
    bench.set(0, velocity(500));
    bench.set(0, position(0));
    bench.run_ms(200);
    assert_eq!((bench.fault(0), bench.drives[0]), (Some(EncoderFault::Stuck), Drive::COAST));

    bench.set(0, Setpoint::Disabled);
    bench.set(0, velocity(500));
    bench.run_ms(2_000);
    assert_eq!(bench.fault(0), None);
    assert!((bench.snapshot.motors[0].velocity.round() - 500).abs() < 25);
}

#[test]
fn a_stall_at_a_hard_stop_is_no_fault_of_the_encoder() {
    for period in PERIODS {
        for cps in [1_500, -1_500] {
            let mut bench = Bench::<1>::new(period);
            bench.axes[0].stops = (-200.0, 200.0);
            bench.set(0, velocity(cps));
            bench.run_ms(5_000);
            let report = bench.snapshot.motors[0];
            assert_eq!(report.faults.encoder, None, "{period} ms, {cps} counts/s");
            assert!(report.stalled, "{period} ms, {cps} counts/s: {report:?}");
            // The motor is still driven against the stop, and leaves the stop when the set-point reverses.
            assert!(report.control.get().abs() > 20_000);
            bench.set(0, velocity(-cps));
            bench.run_ms(500);
            assert!(!bench.snapshot.motors[0].stalled);
            assert_eq!(bench.fault(0), None);
        }
    }
}

#[test]
fn a_stalled_motor_is_probed_only_once() {
    let mut bench = Bench::<1>::new(50);
    bench.axes[0].stops = (-200.0, 200.0);
    bench.set(0, velocity(1_500));
    let mut probes = 0;
    for _ in 0..200 {
        bench.run_ms(50);
        probes += u32::from(bench.drives[0].mode == Mode::Ccw62);
    }
    assert_eq!(probes, 1);
}

#[test]
fn reversals_standstill_creep_and_positions_raise_no_fault_and_no_stall() {
    for period in [1, 10, 50, 100] {
        for torque in [0.0, 2.0, -2.0] {
            let mut bench = Bench::<1>::new(period);
            bench.axes[0].torque = torque;
            // Reversals at full speed, a standstill against the load, low speeds, positions, and open loop.
            for setpoint in [
                velocity(2_700),
                velocity(-2_700),
                velocity(0),
                velocity(20),
                velocity(-20),
                position(8_000),
                position(-8_000),
                Setpoint::ConstantPower(Control::MAX),
                velocity(-2_000),
                Setpoint::ConstantPower(Control::ZERO),
                velocity(2_700),
            ] {
                bench.set(0, setpoint);
                for _ in 0..40 {
                    bench.run_ms(50);
                    let report = bench.snapshot.motors[0];
                    assert!(!report.faults.any() && !report.stalled, "{period} ms {torque} N m {report:?}");
                }
            }
        }
    }
}

#[test]
fn open_loop_power_needs_no_encoder() {
    let mut bench = Bench::<1>::new(50);
    bench.axes[0].plugged = false;
    bench.set(0, Setpoint::ConstantPower(Control::MAX));
    bench.run_ms(3_000);
    assert_eq!(bench.fault(0), None);
    assert_eq!(bench.drives[0].mode, Mode::Cw98);
}

#[test]
fn open_loop_power_resets_the_encoder_check() {
    // Number of ticks until a motor that does not count is probed.
    let ticks_to_probe = |bench: &mut Bench<1>| {
        bench.set(0, velocity(2_000));
        for tick in 1..100 {
            bench.run_ms(10);
            if bench.snapshot.motors[0].control < Control::ZERO {
                return tick;
            }
        }
        panic!("no probe");
    };
    let unplugged = || {
        let mut bench = Bench::<1>::new(10);
        bench.axes[0].plugged = false;
        bench
    };
    let ticks = ticks_to_probe(&mut unplugged());
    let mut bench = unplugged();
    bench.set(0, velocity(2_000));
    bench.run_ms(10 * (ticks - 1));
    assert!(bench.snapshot.motors[0].control >= Control::ZERO);
    bench.set(0, Setpoint::ConstantPower(Control::MAX));
    bench.run_ms(10);
    assert_eq!(ticks_to_probe(&mut bench), ticks, "earlier evidence is left");

    let mut bench = Bench::<1>::new(10);
    bench.axes[0].stops = (-200.0, 200.0);
    bench.set(0, velocity(1_500));
    bench.run_ms(5_000);
    assert!(bench.snapshot.motors[0].stalled);
    bench.set(0, Setpoint::ConstantPower(Control::MAX));
    bench.run_ms(10);
    assert!(!bench.snapshot.motors[0].stalled);
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_load_that_drives_the_motor_is_not_taken_for_a_reversed_encoder_in_any_scheme() {
    for settings in all_schemes() {
        // Torques of up to 0.6 of the stall torque. Schemes C and D cannot balance the largest of them.
        let torques = [0.4, 0.8, 1.2, 1.6, 2.0];
        for (period, torque) in [10, 50].into_iter().flat_map(|p| torques.map(|t| (p, t))) {
            for cps in [100, 300, 600, 1_000, 1_360, 2_000, 0, -300, -1_000] {
                // The load begins at the requested speed, or near the free speed, where C and D brake weakly.
                for before in [cps, 2_500] {
                    let mut bench = Bench::<1>::with(period, settings);
                    bench.set(0, velocity(before));
                    bench.run_ms(1_500);
                    bench.axes[0].torque = torque;
                    bench.set(0, velocity(cps));
                    bench.run_ms(3_000);
                    let fault = bench.fault(0);
                    assert_eq!(fault, None, "{settings:?}: {period} ms, {torque} N m, {before} to {cps}");
                }
            }
        }
    }
}

#[test]
fn a_motor_that_turns_back_slower_than_160_counts_per_s_is_no_runaway() {
    let faults = |moved: i32| {
        let period = Period::from_millis(50).expect("in range");
        let mut motor = Controlled::new(Settings::new(Winding::NEVEREST_60), period);
        motor.set(velocity(1_000));
        (1..40).any(|tick: i32| {
            let at = Micros::new(50_000 * u64::from(tick.unsigned_abs()));
            let reading = Reading { position: -moved * tick, edge_at: at, at };
            motor
                .step(at, Some(reading), Some(Battery::good(Millivolts::new(12_000), at)))
                .faults
                .encoder
                .is_some()
        })
    };
    // 20, 140, 160 and 2000 counts/s.
    assert_eq!([1, 7, 8, 100].map(faults), [false, false, true, true]);
}

/// Settings of Scheme C with low coefficients: a load moves the motor far before the control value reaches its end.
fn gentle_and_slow() -> Settings {
    let winding = Winding::NEVEREST_60;
    // P is 3.7, and I is 11 per second, in units of the full control range per free speed at 12 V.
    let [p, i] = [40.06, 120.2 / 20.0].map(|value: f64| Coefficient::from_bits((65_536.0 * value) as i32));
    let velocity = Pidf { p, i, ..Pidf::default() };
    let slow = Coefficients { velocity, position: Pidf::default() };
    Settings {
        duty: DutyRule::LinearDuty,
        coefficients: Some(slow),
        ..Settings::for_scheme(winding, Scheme::C)
    }
}

#[test]
fn full_reverse_stops_a_load_that_overpowers_scheme_c_before_the_encoder_is_at_fault() {
    let mut bench = Bench::<1>::with(10, gentle_and_slow());
    bench.set(0, velocity(600));
    bench.run_ms(1_500);
    bench.axes[0].torque = 2.0;
    let full = |drive| drive == Drive { mode: Mode::Ccw62, duty: Duty::ONE };
    let mut full_reverse_ms = 0;
    for _ in 0..3_000 {
        bench.run_ms(1);
        full_reverse_ms += u32::from(full(bench.drives[0]));
    }
    assert_eq!(bench.fault(0), None);
    assert!(full_reverse_ms > 0);
    // The motor is back at its speed, and stays there.
    let cps = bench.snapshot.motors[0].velocity.round();
    assert!((cps - 600).abs() < 60, "{cps} counts/s");
    // A load that the scheme can balance needs no full reverse.
    bench.axes[0].torque = 0.8;
    bench.run_ms(1_000);
    for _ in 0..2_000 {
        bench.run_ms(1);
        assert!(!full(bench.drives[0]));
    }
}

/// A motor in Scheme C that turns at 600 counts/s in one direction, independent of its bridge. Its set-point is the
/// same speed in the other direction.
struct Backwards {
    motor: Controlled,
    direction: i32,
    ticks: i32,
}

impl Backwards {
    const MS: u32 = 10;

    /// Runs the motor until full reverse begins.
    fn in_full_reverse(direction: i32) -> Self {
        let motor = Controlled::new(gentle_and_slow(), Period::from_millis(Self::MS).expect("period"));
        let mut axis = Self { motor, direction, ticks: 0 };
        // The estimated speed settles before the set-point reverses.
        (0..3).for_each(|_| _ = axis.step());
        axis.motor.set(velocity(-600 * direction));
        while !axis.full_reverse() {
            assert!(axis.ticks < 30, "no full reverse");
        }
        axis
    }

    fn step(&mut self) -> Report {
        self.ticks += 1;
        let at = Micros::new(u64::from(Self::MS * self.ticks.unsigned_abs()) * 1000);
        let reading = Reading { position: 6 * self.direction * self.ticks, edge_at: at, at };
        self.motor.step(at, Some(reading), Some(Battery::good(Millivolts::new(12_000), at)))
    }

    /// Takes a tick; returns true if the bridge is in full reverse.
    fn full_reverse(&mut self) -> bool {
        let report = self.step();
        let (mode, end) =
            if self.direction > 0 { (Mode::Ccw62, Control::MIN) } else { (Mode::Cw98, Control::MAX) };
        let full = report.drive == Drive { mode, duty: Duty::ONE };
        assert!(!full || (report.control, report.regime) == (end, Some(Regime::Reverse)));
        full
    }
}

#[test]
fn full_reverse_for_100_ms_without_effect_makes_a_fault() {
    for direction in [1, -1] {
        let mut axis = Backwards::in_full_reverse(direction);
        for ms in (20..=100).step_by(10) {
            assert!(axis.full_reverse(), "{ms} ms");
        }
        assert_eq!(axis.step().faults.encoder, Some(EncoderFault::Reversed));
    }
}

#[test]
fn full_reverse_ends_when_the_set_point_takes_the_direction_of_motion() {
    for direction in [1, -1] {
        let mut axis = Backwards::in_full_reverse(direction);
        axis.motor.set(velocity(600 * direction));
        // This tick checks the motion since the last command.
        assert!(axis.full_reverse());
        for _ in 0..40 {
            assert!(!axis.full_reverse());
            assert_eq!(axis.step().faults.encoder, None);
        }
    }
}

#[test]
fn a_heavy_load_that_reverses_slowly_is_not_taken_for_a_reversed_encoder_in_any_scheme() {
    for settings in all_schemes() {
        for period in [1, 10, 50, 100] {
            let mut bench = Bench::<1>::with(period, settings);
            bench.axes[0] = Axis::with(KgM2(1.0));
            // A robot of 100 kg on wheels of 10 cm takes seconds to reverse.
            for cps in [2_500, -2_500, 1_000, -300, 0] {
                bench.set(0, velocity(cps));
                bench.run_ms(6_000);
                assert_eq!(bench.fault(0), None, "{settings:?}: {period} ms, {cps} counts/s");
            }
        }
    }
}

#[test]
fn an_unknown_motor_that_reverses_slowly_raises_no_fault() {
    for period in [1, 10, 50] {
        let mut bench = Bench::<1>::new(period);
        // Some 400 counts/s² at 12 V. The motor has no counts for 200 ms while its direction reverses.
        bench.axes[0] = Axis::with(KgM2(2.5));
        for cps in [300, -300, 200] {
            bench.set(0, velocity(cps));
            bench.run_ms(5_000);
            assert_eq!(bench.fault(0), None, "{period} ms, {cps} counts/s");
        }
    }
}

#[test]
fn every_scheme_finds_a_reversed_encoder() {
    for settings in all_schemes() {
        for (period, inertia) in [10, 50].into_iter().flat_map(|p| [0.0, 0.002, 0.05, 0.5].map(|j| (p, j))) {
            for cps in [100, 300, 1_000, 2_500, -300, -2_000] {
                let mut bench = Bench::<1>::with(period, settings);
                bench.axes[0] = Axis::with(KgM2(inertia));
                bench.axes[0].reversed = true;
                bench.set(0, velocity(cps));
                // A clear runaway is faster than a tenth of the free speed in the wrong direction, at full control, and
                // not slower than before. In Scheme C full control may drive a fast motor too weakly. The motor then
                // slows down with any encoder.
                let (start, mut clear_ms, mut distance) = (bench.ms, 0, 0);
                while bench.fault(0).is_none() {
                    let from = bench.snapshot.motors[0].position;
                    bench.run_ms(50);
                    let report = &bench.snapshot.motors[0];
                    let before = std::mem::replace(&mut distance, report.position.wrapping_sub(from).abs());
                    let against = -cps.signum() * report.velocity.round() > 301;
                    let clear = against && report.control.get().abs() > 30_720 && distance >= before;
                    clear_ms = if clear { clear_ms + 50 } else { 0 };
                    let ms = bench.ms - start;
                    assert!(
                        clear_ms <= 250 && ms < 4_000,
                        "{settings:?}: {period} ms, {inertia} kg m2, {cps}: {ms} ms"
                    );
                }
                assert_eq!(bench.fault(0), Some(EncoderFault::Reversed));
            }
        }
    }
}
