//! What keeps a motor, and what it moves, from harm when something fails.

use motor_hub::braking::{Regime, Winding};
use motor_hub::bridge::{BridgeConstants, BridgeFeedback, Drive};
use motor_hub::model::catalogue;
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::si::{Hertz, KgM2, NewtonMetres, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motion::{Reading, Tracker};
use motor_hub::motor::{Motor, OnFault, Report, Setpoint, Settings, ThermalLimit};
use motor_hub::units::{Control, CountsPerSecond, Micros, Milliamperes, Millivolts, Period};

/// An AM 60 A with a load, on a hub of its own, every 10 ms.
struct Winch {
    motor: Motor,
    plant: Plant,
    tracker: Tracker,
    ms: u64,
    /// At the output shaft, in newton metres.
    torque: f64,
    /// Counts that come through; the last one for ever once the plug is pulled.
    seen: Option<i64>,
    battery: Option<Millivolts>,
    report: Report,
}

impl Winch {
    fn new(settings: Settings) -> Self {
        let entry = catalogue::find("AM 60 A").expect("known");
        let constants = entry.motor.expect("characterised").with_measured_rotor_inertia();
        let load = Load { inertia_after: KgM2(0.05), ..Load::NONE };
        let bridge = Bridge::new(BridgeConstants::IDEAL);
        Self {
            motor: Motor::new(settings, Period::from_millis(10).expect("in range")),
            plant: Plant::new(constants, load, bridge, Hertz(20_000.0)),
            tracker: Tracker::default(),
            ms: 0,
            torque: 0.0,
            seen: None,
            battery: Some(Millivolts::new(12_000)),
            report: Report::INITIAL,
        }
    }

    fn unplug(&mut self) {
        self.seen = Some(self.plant.counts());
    }

    fn run(&mut self, seconds: f64) -> &Report {
        for _ in 0..(seconds * 1e3) as u64 {
            let now = Micros::new(1_000 * self.ms);
            let position = self.tracker.step(self.seen.unwrap_or(self.plant.counts()) as u16, now);
            self.motor.sample(position);
            if self.ms.is_multiple_of(10) {
                self.report = self.motor.step(now, Some(position), self.battery);
            }
            let Drive { mode, duty } = self.report.drive;
            let torque_after = NewtonMetres(self.torque);
            let influence = PlantInput { torque_after, ..PlantInput::pwm(mode, duty.to_f64()) };
            self.plant.run(Seconds(1e-3), influence, Volts(12.0));
            self.ms += 1;
        }
        &self.report
    }

    /// Counts per second.
    fn speed(&self) -> f64 {
        self.plant.speed().0 / std::f64::consts::TAU * self.plant.motor().counts_per_rev_motor
    }
}

fn settings(on_fault: OnFault) -> Settings {
    Settings { on_fault, ..Settings::new(Winding::NEVEREST_60) }
}

fn at(cps: i32) -> Setpoint {
    Setpoint::Velocity(CountsPerSecond::new(cps))
}

/// Pays out 0.8 N m at 300 counts/s, until its encoder is unplugged; 3 s later.
fn unplugged(on_fault: OnFault) -> Winch {
    let mut winch = Winch::new(settings(on_fault));
    winch.torque = 0.8;
    winch.motor.set(at(300));
    winch.run(2.0);
    assert!((winch.speed() - 300.0).abs() < 10.0, "{}", winch.speed());
    winch.unplug();
    winch.run(3.0);
    winch
}

#[test]
fn a_load_whose_encoder_is_unplugged_runs_away_from_a_motor_that_coasts_and_sinks_on_one_that_brakes() {
    let coasting = unplugged(OnFault::Coast);
    assert_eq!((coasting.report.drive, coasting.report.regime), (Drive::COAST, None));
    assert!(coasting.speed() > 3_000.0, "{}", coasting.speed());

    let braking = unplugged(OnFault::Brake);
    assert!(braking.report.faults.encoder.is_some());
    assert_eq!((braking.report.drive, braking.report.regime), (Drive::BRAKE, Some(Regime::Braking)));
    // 0.8 N m behind 60 turns take 0.75 A of 17.8 mN m/A, and those 2.55 V behind 3.4 ohm: 144 rad/s, 28 counts a turn.
    assert!((braking.speed() - 640.0).abs() < 10.0, "{}", braking.speed());
}

#[test]
fn a_counter_that_falls_silent_brakes_until_it_speaks_again() {
    for setpoint in
        [at(300), Setpoint::Position { target: 9_000, tolerance: 5, speed_limit: CountsPerSecond::new(300) }]
    {
        let mut motor = Motor::new(settings(OnFault::Brake), Period::DEFAULT);
        motor.set(setpoint);
        let battery = Some(Millivolts::new(12_000));
        let mut step = |ms: u64, reading: bool| {
            let at = Micros::new(1_000 * ms);
            motor.step(at, reading.then_some(Reading { position: 0, edge_at: at, at }), battery)
        };
        assert_eq!(step(50, true).regime, Some(Regime::Forward));
        let silent = step(100, false);
        assert!(silent.faults.encoder_stale);
        assert_eq!(silent.drive, Drive::BRAKE);
        assert_eq!(step(150, true).regime, Some(Regime::Forward));
    }
}

#[test]
fn no_motor_brakes_on_a_bus_that_is_the_fault() {
    let mut winch = unplugged(OnFault::Brake);
    winch.battery = None;
    assert_eq!(winch.run(0.02).drive, Drive::COAST);
    winch.motor.set(Setpoint::FailSafe);
    assert_eq!(winch.run(0.02).drive, Drive::COAST);
    winch.battery = Some(Millivolts::new(12_000));
    assert_eq!(winch.run(0.02).drive, Drive::BRAKE);
}

#[test]
fn disabling_ends_the_braking() {
    let mut winch = unplugged(OnFault::Brake);
    winch.motor.set(Setpoint::Disabled);
    let report = winch.run(0.02);
    assert_eq!((report.drive, report.faults.encoder), (Drive::COAST, None));
}

#[test]
fn a_motor_that_needs_no_encoder_is_not_braked_for_want_of_one() {
    for (setpoint, drive) in [
        (Setpoint::ConstantPower(Control::MAX), None),
        (Setpoint::ConstantPower(Control::ZERO), Some(Drive::BRAKE)),
        (Setpoint::Disabled, Some(Drive::COAST)),
    ] {
        let mut motor = Motor::new(settings(OnFault::Brake), Period::DEFAULT);
        motor.set(setpoint);
        let report = motor.step(Micros::new(50_000), None, Some(Millivolts::new(12_000)));
        assert!(report.faults.encoder_stale);
        assert_eq!(report.drive == Drive::BRAKE, drive == Some(Drive::BRAKE), "{setpoint:?}");
    }
}

/// A third of the stall current of 12 V behind 3.4 ohm.
fn limited(on_fault: OnFault) -> Settings {
    Settings { thermal: ThermalLimit::new(1_200, 20, 600).ok(), ..settings(on_fault) }
}

/// Currents in amperes that flow in a held motor, by seconds.
fn stalled(settings: Settings, setpoint: Setpoint, seconds: u64) -> (Vec<f64>, Motor) {
    let mut motor = Motor::new(settings, Period::DEFAULT);
    motor.set(setpoint);
    let currents = (1..=seconds * 20).map(|tick| {
        let at = Micros::new(50_000 * tick);
        let report =
            motor.step(at, Some(Reading { position: 0, edge_at: at, at }), Some(Millivolts::new(12_000)));
        f64::from(report.current.get()) / 1e3
    });
    let by_tick: Vec<f64> = currents.collect();
    (by_tick.into_iter().skip(19).step_by(20).collect(), motor)
}

#[test]
fn a_motor_without_a_limit_is_stalled_for_ever_and_one_with_is_derated_to_what_it_stands() {
    let full = Setpoint::ConstantPower(Control::MAX);
    let (unlimited, _) = stalled(settings(OnFault::Coast), full, 30);
    assert!(unlimited.iter().all(|amperes| (3.5..3.6).contains(amperes)), "{unlimited:?}");

    for setpoint in [full, Setpoint::ConstantPower(Control::MIN)] {
        let (amperes, mut motor) = stalled(limited(OnFault::Coast), setpoint, 600);
        let amperes: Vec<f64> = amperes.iter().map(|amperes| amperes.abs()).collect();
        // All of it as long as it takes to get up speed; then less, step by step, and never cut.
        assert!(amperes[..7].iter().all(|amperes| *amperes > 3.5), "{amperes:?}");
        assert!(amperes[29] < 2.2, "{}", amperes[29]);
        assert!(amperes.is_sorted_by(|before, after| *after <= before + 0.03), "{amperes:?}");
        assert!((1.15..1.35).contains(&amperes[599]), "{}", amperes[599]);
        let at = Micros::new(600_050_000);
        let report = motor.step(at, None, Some(Millivolts::new(12_000)));
        assert!(
            report.derated && (950..1_050).contains(&report.heat) && !report.faults.overheated,
            "{report:?}"
        );
        // A motor that rests cools down.
        motor.set(Setpoint::Disabled);
        let cool =
            (0..20 * 300).map(|tick| motor.step(Micros::new(600_100_000 + 50_000 * tick), None, None)).last();
        assert!(cool.is_some_and(|report| !report.derated && report.heat < 700), "{cool:?}");
    }
}

#[test]
fn every_scheme_derates_a_motor_that_is_held() {
    use motor_hub::braking::{DutyRule, Scheme};
    for scheme in Scheme::EACH {
        for duty in DutyRule::EACH {
            for power in [Control::MAX, Control::MIN] {
                let settings = Settings { scheme, duty, ..limited(OnFault::Coast) };
                let (amperes, _) = stalled(settings, Setpoint::ConstantPower(power), 200);
                let last = amperes[199].abs();
                assert!((1.1..2.0).contains(&last), "{scheme:?} {duty:?}: {last}");
            }
        }
    }
}

/// A load of 2.2 N m, 2.1 A and more than the motor stands for ever, drives it until it is cut.
fn overrun(on_fault: OnFault) -> Winch {
    let mut winch = Winch::new(limited(on_fault));
    winch.torque = 2.2;
    winch.motor.set(at(300));
    assert!((0..240).any(|_| winch.run(1.0).faults.overheated), "{:?}", winch.report);
    winch
}

#[test]
fn braking_is_not_derated_but_a_motor_that_gets_too_hot_by_it_is_cut_and_reported() {
    let braking = overrun(OnFault::Brake);
    assert_eq!(braking.report.drive, Drive::BRAKE);
    let mut coasting = overrun(OnFault::Coast);
    assert_eq!(coasting.report.drive, Drive::COAST);
    // Disabled and enabled again, it is as hot as before.
    coasting.motor.set(Setpoint::Disabled);
    coasting.run(0.1);
    coasting.motor.set(at(300));
    assert!(coasting.run(0.1).faults.overheated);
}

#[test]
fn heat_is_of_the_measured_current_where_there_is_one() {
    let mut motor = Motor::new(limited(OnFault::Coast), Period::DEFAULT);
    motor.set(Setpoint::ConstantPower(Control::MAX));
    let mut heat = |measured: Option<i32>| {
        let report = (1..=40).map(|tick| {
            motor.sense(BridgeFeedback { current: measured.map(Milliamperes::new), fault: false });
            let at = Micros::new(50_000 * tick);
            motor.step(at, Some(Reading { position: 0, edge_at: at, at }), Some(Millivolts::new(12_000)))
        });
        report.last().map(|report| (report.heat, report.measured)).unwrap_or_default()
    };
    // Of the first tick, before which the bridge drove nothing, the modelled one.
    let (least, measured) = heat(Some(60));
    assert!(least < 15 && measured == Some(Milliamperes::new(60)), "{least}, {measured:?}");
    let (modelled, none) = heat(None);
    assert!(none.is_none() && (210..240).contains(&modelled), "{modelled}");
}

#[test]
fn a_bridge_that_switches_itself_off_is_named_and_stays_off_until_the_motor_is_disabled() {
    for on_fault in [OnFault::Coast, OnFault::Brake] {
        let mut winch = Winch::new(settings(on_fault));
        winch.motor.set(at(300));
        assert!(!winch.run(0.5).faults.bridge);
        winch.motor.sense(BridgeFeedback { current: None, fault: true });
        // It has come to again.
        winch.motor.sense(BridgeFeedback::default());
        let report = winch.run(0.5);
        assert_eq!((report.drive, report.faults.bridge), (Drive::COAST, true), "{on_fault:?}");
        winch.motor.set(Setpoint::Disabled);
        winch.run(0.02);
        winch.motor.set(at(300));
        let report = winch.run(0.5);
        assert!(report.drive != Drive::COAST && !report.faults.any(), "{report:?}");
        // One that is still at fault does not run again.
        winch.motor.sense(BridgeFeedback { current: None, fault: true });
        winch.motor.set(Setpoint::Disabled);
        winch.motor.sense(BridgeFeedback { current: None, fault: true });
        winch.motor.set(at(300));
        assert_eq!(winch.run(0.02).drive, Drive::COAST);
    }
}
