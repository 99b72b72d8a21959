//! Protection of a motor and its load when something fails.

mod common;

use common::{Bench, Cable, configured, inertia, neverest_60, plant, position, velocity};
use motor_hub::braking::{DutyRule, Regime, Scheme, Winding};
use motor_hub::bridge::{BridgeFeedback, Drive};
use motor_hub::motor::{OnFault, Setpoint, Settings, ThermalLimit};
use motor_hub::units::{Control, Milliamperes};

fn settings(on_fault: OnFault) -> Settings {
    Settings { on_fault, ..Settings::new(Winding::NEVEREST_60) }
}

/// A NeveRest 60 with a drum, at a period of 10 ms, lowering a load of this torque in N m at 300 counts/s.
fn winch(settings: Settings, torque: f64) -> Bench<1> {
    let mut winch = Bench::one(settings, plant(neverest_60(), common::inertia(0.05)), 10);
    winch.axes[0].torque = torque;
    winch.set(0, velocity(300));
    winch
}

/// A winch 3 s after its encoder was unplugged while it lowered 0.8 N m.
fn unplugged(on_fault: OnFault) -> Bench<1> {
    let mut winch = winch(settings(on_fault), 0.8);
    winch.run_ms(2_000);
    assert!((winch.speed(0) - 300.0).abs() < 10.0, "{}", winch.speed(0));
    winch.axes[0].cable = Cable::Unplugged;
    winch.run_ms(3_000);
    winch
}

#[test]
fn a_load_whose_encoder_is_unplugged_runs_away_from_a_motor_that_coasts_and_sinks_on_one_that_brakes() {
    let coasting = unplugged(OnFault::Coast);
    assert_eq!((coasting.report().drive, coasting.report().regime), (Drive::COAST, None));
    assert!(coasting.speed(0) > 3_000.0, "{}", coasting.speed(0));

    let braking = unplugged(OnFault::Brake);
    assert!(braking.report().faults.encoder.is_some());
    assert_eq!((braking.report().drive, braking.report().regime), (Drive::BRAKE, Some(Regime::Braking)));
    // A torque of 0.8 N m behind a gear of 60 : 1 with an efficiency of 90 % is 14.8 mN m at the motor. Drag takes 1.5
    // mN m. The rest needs 0.75 A at 17.8 mN m/A. This current needs 2.55 V at 3.4 ohm, which is the back EMF at 144
    // rad/s. With 28 counts per turn the speed is 640 counts/s.
    assert!((braking.speed(0) - 640.0).abs() < 10.0, "{}", braking.speed(0));

    // Disabling ends the braking.
    let mut disabled = braking;
    disabled.set(0, Setpoint::Disabled);
    let [report] = disabled.tick().motors;
    assert_eq!((report.drive, report.faults.encoder), (Drive::COAST, None));
}

#[test]
fn a_counter_that_falls_silent_brakes_until_it_speaks_again() {
    for setpoint in [velocity(300), position(9_000, 5, 300)] {
        // The winch lifts, so that the motor is always driven forward.
        let mut winch = winch(settings(OnFault::Brake), -0.4);
        winch.set(0, setpoint);
        winch.run_ms(1_000);
        assert_eq!(winch.report().regime, Some(Regime::Forward));
        winch.axes[0].unread_ms = 50;
        winch.run_ms(50);
        assert!(winch.report().faults.encoder_stale);
        assert_eq!(winch.report().drive, Drive::BRAKE);
        winch.run_ms(300);
        assert_eq!((winch.report().regime, winch.report().faults.any()), (Some(Regime::Forward), false));
    }
}

#[test]
fn a_motor_that_held_its_position_holds_where_it_is_when_its_encoder_is_read_again() {
    for on_fault in [OnFault::Coast, OnFault::Brake] {
        let mut winch = winch(settings(on_fault), 0.4);
        winch.set(0, velocity(0));
        winch.run_ms(2_000);
        let held = winch.counts(0);
        winch.axes[0].unread_ms = 2_000;
        winch.run_ms(2_000);
        assert!(winch.counts(0) > held + 300.0, "{on_fault:?}: {} from {held}", winch.counts(0));
        let lowest = winch.highest(3_000, |winch| winch.counts(0));
        let end = winch.counts(0);
        assert!(lowest - end < 50.0, "{on_fault:?}: from {lowest} back to {end} counts");
    }
}

#[test]
fn without_readings_the_estimated_speed_does_not_grow_for_longer_than_300_ms() {
    let mut winch = winch(settings(OnFault::Coast), 0.8);
    winch.set(0, velocity(0));
    winch.run_ms(2_000);
    winch.axes[0].unread_ms = u64::MAX;
    winch.run_ms(500);
    let early = winch.report().velocity.to_f32();
    winch.run_ms(9_500);
    let late = winch.report().velocity.to_f32();
    assert!(early > 200.0 && (late - early).abs() < 1.0, "{early} counts/s, later {late} counts/s");
}

#[test]
fn a_motor_is_not_settled_while_a_fault_opens_its_bridge() {
    let losses: [fn(&mut Bench<1>); 2] =
        [|bench| bench.battery_read = false, |bench| bench.axes[0].unread_ms = 500];
    for lose in losses {
        let mut bench = Bench::one(settings(OnFault::Coast), plant(neverest_60(), common::inertia(0.01)), 10);
        bench.set(0, position(200, 10, 500));
        bench.run_ms(2_000);
        assert!(bench.report().settled);
        lose(&mut bench);
        bench.run_ms(200);
        assert!(bench.report().faults.any() && !bench.report().settled, "{:?}", bench.report());
    }
}

#[test]
fn no_motor_brakes_on_a_bus_that_is_the_fault() {
    let mut winch = unplugged(OnFault::Brake);
    let mut drive = |battery_read, setpoint: Option<Setpoint>| {
        winch.battery_read = battery_read;
        setpoint.into_iter().for_each(|setpoint| winch.set(0, setpoint));
        winch.tick().motors[0].drive
    };
    assert_eq!(drive(false, None), Drive::COAST);
    assert_eq!(drive(false, Some(Setpoint::FailSafe)), Drive::COAST);
    assert_eq!(drive(true, None), Drive::BRAKE);
}

#[test]
fn a_motor_that_needs_no_encoder_is_not_braked_for_want_of_one() {
    for (setpoint, braked) in [
        (Setpoint::ConstantPower(Control::MAX), false),
        (Setpoint::ConstantPower(Control::ZERO), true),
        (Setpoint::Disabled, false),
    ] {
        let mut bench = Bench::turned(settings(OnFault::Brake), [0.0]);
        bench.axes[0].unread_ms = u64::MAX;
        bench.set(0, setpoint);
        bench.tick();
        let [report] = bench.tick().motors;
        assert!(report.faults.encoder_stale);
        assert_eq!(report.drive == Drive::BRAKE, braked, "{setpoint:?}");
    }
}

/// Returns settings with a thermal limit. The continuous current is a third of the stall current, 12 V at 3.4 ohm.
fn limited(on_fault: OnFault) -> Settings {
    Settings { thermal: ThermalLimit::new(1_200, 20, 600).ok(), ..settings(on_fault) }
}

/// Currents in A of a motor whose shaft is held, one for each second.
fn stalled(settings: Settings, setpoint: Setpoint, seconds: u64) -> (Vec<f64>, Bench<1>) {
    let mut bench = Bench::turned(settings, [0.0]);
    bench.set(0, setpoint);
    let amperes = (0..seconds).map(|_| {
        bench.run_ms(1_000);
        f64::from(bench.report().current.get()) / 1e3
    });
    (amperes.collect(), bench)
}

#[test]
fn a_motor_without_a_limit_is_stalled_for_ever_and_one_with_is_derated_to_what_it_stands() {
    let full = Setpoint::ConstantPower(Control::MAX);
    let (unlimited, _) = stalled(settings(OnFault::Coast), full, 30);
    assert!(unlimited.iter().all(|amperes| (3.5..3.6).contains(amperes)), "{unlimited:?}");

    for setpoint in [full, Setpoint::ConstantPower(Control::MIN)] {
        let (amperes, mut bench) = stalled(limited(OnFault::Coast), setpoint, 600);
        let amperes: Vec<f64> = amperes.iter().map(|amperes| amperes.abs()).collect();
        // The motor gets the full current for the time of a start, and then less current in steps. It is never switched
        // off.
        assert!(amperes[..7].iter().all(|amperes| *amperes > 3.5), "{amperes:?}");
        assert!(amperes[29] < 2.2, "{}", amperes[29]);
        assert!(amperes.is_sorted_by(|before, after| *after <= before + 0.03), "{amperes:?}");
        assert!((1.15..1.35).contains(&amperes[599]), "{}", amperes[599]);
        let report = bench.report();
        assert!(report.derated && (950..1_050).contains(&report.heat), "{report:?}");
        assert!(!report.faults.overheated, "{report:?}");
        // A motor that rests cools down.
        bench.set(0, Setpoint::Disabled);
        bench.run_ms(300_000);
        let report = bench.report();
        assert!(!report.derated && report.heat < 700, "{report:?}");
    }
}

#[test]
fn every_scheme_derates_a_motor_that_is_held() {
    for (scheme, duty) in Scheme::ALL.into_iter().flat_map(|s| DutyRule::ALL.map(|duty| (s, duty))) {
        for power in [Control::MAX, Control::MIN] {
            let settings = Settings { scheme, duty, ..limited(OnFault::Coast) };
            let (amperes, _) = stalled(settings, Setpoint::ConstantPower(power), 200);
            let last = amperes[199].abs();
            assert!((1.1..2.0).contains(&last), "{scheme:?} {duty:?}: {last}");
        }
    }
}

#[test]
fn a_derated_motor_reaches_a_position_without_overshoot() {
    let (motor, load) = (neverest_60(), inertia(0.2));
    let thermal = ThermalLimit::new(800, 20, 600).ok();
    let mut bench = Bench::one(Settings { thermal, ..configured(&motor, &load) }, plant(motor, load), 50);
    let mut derated_moves = 0;
    for target in [4_000, 0].into_iter().cycle().take(20) {
        bench.set(0, position(target, 5, 100_000));
        let side = if target > 0 { 1.0 } else { -1.0 };
        let farthest = bench.highest(5_000, |bench| side * (bench.counts(0) - f64::from(target)));
        assert!(farthest < 6.0, "{target}: {farthest:.0} counts beyond {:?}", bench.report());
        derated_moves += u32::from(bench.report().derated);
    }
    assert!(derated_moves > 5, "{derated_moves}");
}

/// A motor under a load of 2.2 N m, until the thermal limit cuts it. The load needs 2.1 A, which is above the
/// continuous current.
fn overrun(on_fault: OnFault) -> Bench<1> {
    let mut winch = winch(limited(on_fault), 2.2);
    let overheats = (0..240).any(|_| {
        winch.run_ms(1_000);
        winch.report().faults.overheated
    });
    assert!(overheats, "{:?}", winch.report());
    winch
}

#[test]
fn braking_is_not_derated_but_a_motor_that_gets_too_hot_by_it_is_cut_and_reported() {
    assert_eq!(overrun(OnFault::Brake).report().drive, Drive::BRAKE);
    let mut coasting = overrun(OnFault::Coast);
    assert_eq!(coasting.report().drive, Drive::COAST);
    // After it was disabled and enabled again, the motor is as hot as before.
    coasting.set(0, Setpoint::Disabled);
    coasting.run_ms(100);
    coasting.set(0, velocity(300));
    coasting.run_ms(100);
    assert!(coasting.report().faults.overheated);
}

#[test]
fn heat_is_of_the_measured_current_where_there_is_one() {
    let mut bench = Bench::turned(limited(OnFault::Coast), [0.0]);
    bench.set(0, Setpoint::ConstantPower(Control::MAX));
    let mut heat = |measured: Option<i32>| {
        for _ in 0..40 {
            bench.hub.set_bridge_feedback(&[BridgeFeedback {
                current: measured.map(Milliamperes::new),
                fault: false,
            }]);
            bench.tick();
        }
        (bench.report().heat, bench.report().measured)
    };
    // At the first tick the heat is modelled, because the bridge was open before.
    let (least, measured) = heat(Some(60));
    assert!(least < 15 && measured == Some(Milliamperes::new(60)), "{least}, {measured:?}");
    let (modelled, none) = heat(None);
    assert!(none.is_none() && (210..240).contains(&modelled), "{modelled}");
}

#[test]
fn a_bridge_that_switches_itself_off_is_named_and_stays_off_until_the_motor_is_disabled() {
    let fault = [BridgeFeedback { current: None, fault: true }];
    for on_fault in [OnFault::Coast, OnFault::Brake] {
        let mut winch = winch(settings(on_fault), 0.0);
        winch.run_ms(500);
        assert!(!winch.report().faults.bridge);
        winch.hub.set_bridge_feedback(&fault);
        // The bridge has recovered.
        winch.hub.set_bridge_feedback(&[BridgeFeedback::default()]);
        winch.run_ms(500);
        let report = winch.report();
        assert_eq!((report.drive, report.faults.bridge), (Drive::COAST, true), "{on_fault:?}");
        winch.set(0, Setpoint::Disabled);
        winch.tick();
        winch.set(0, velocity(300));
        winch.run_ms(500);
        let report = winch.report();
        assert!(report.drive != Drive::COAST && !report.faults.any(), "{report:?}");
        // A bridge that is still at fault does not run again.
        winch.hub.set_bridge_feedback(&fault);
        winch.set(0, Setpoint::Disabled);
        winch.hub.set_bridge_feedback(&fault);
        winch.set(0, velocity(300));
        assert_eq!(winch.tick().motors[0].drive, Drive::COAST);
    }
}
