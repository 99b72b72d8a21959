//! Random settings, set-points and samples cause no panic, and estimates stay in their ranges. After a sound encoder is
//! back, the estimate follows it again.

use crate::common::ScriptedMotor;
use crate::random::any_settings;
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeConstants, Drive};
use motor_hub::extension::settings::MotorSettings;
use motor_hub::motor::{Report, Setpoint, Settings};
use motor_hub::regulator::Dynamics;
use motor_hub::units::{AccelerationPerVolt, Control, CountsPerSecond, DecayRate, Millivolts, Period};
use proptest::option;
use proptest::prelude::*;

/// Highest estimated speed in counts/s, beyond what an encoder's timer could count.
const FASTEST: f64 = 1e6;

/// Any settings in their ranges, on any bridge. Half of the motors lack each setting that a motor may lack.
fn settings() -> impl Strategy<Value = Settings> {
    let bridge = (0u16..=2_000, 0u16..=4_095, 100u32..=200_000)
        .prop_map(|(mv, mohm, hz)| BridgeConstants::new(mv, mohm, hz).expect("in range"));
    (any_settings(), bridge, any::<[bool; 5]>()).prop_map(
        |(MotorSettings { motor: any, .. }, bridge, has)| Settings {
            bridge: bridge.with_timing(any.bridge.timing),
            dynamics: any.dynamics.filter(|_| has[0]),
            coefficients: any.coefficients.filter(|_| has[1]),
            acceleration: any.acceleration.filter(|_| has[2]),
            thermal: any.thermal.filter(|_| has[3]),
            current_limit: any.current_limit.filter(|_| has[4]),
            ..any
        },
    )
}

fn setpoint() -> impl Strategy<Value = Setpoint> {
    let speed = || any::<i32>().prop_map(CountsPerSecond::from_bits);
    prop_oneof![
        Just(Setpoint::Disabled),
        any::<i16>().prop_map(|power| Setpoint::ConstantPower(Control::new(power))),
        Just(Setpoint::Velocity(CountsPerSecond::ZERO)),
        speed().prop_map(Setpoint::Velocity),
        (any::<i32>(), any::<u16>(), speed()).prop_map(|(target, tolerance, speed_limit)| {
            Setpoint::Position { target, tolerance, speed_limit }
        }),
    ]
}

/// Events until the next tick.
#[derive(Clone, Debug)]
struct Happening {
    setpoint: Option<Setpoint>,
    settings: Option<Settings>,
    /// Milliseconds to a sample, and the counts in that time.
    samples: Vec<(u64, i32)>,
    battery: Option<u16>,
}

fn happening() -> impl Strategy<Value = Happening> {
    let gap = prop_oneof![8 => Just(1u64), 1 => Just(0), 2 => 2..30u64, 1 => 30..5_000u64];
    let counts = prop_oneof![4 => -3..=3i32, 2 => -300..=300i32, 1 => any::<i32>()];
    let samples = prop::collection::vec((gap, counts), 0..12);
    let battery = option::weighted(0.9, prop_oneof![3 => 6_000..16_000u16, 1 => any::<u16>()]);
    (option::weighted(0.3, setpoint()), option::weighted(0.1, settings()), samples, battery)
        .prop_map(|(setpoint, settings, samples, battery)| Happening { setpoint, settings, samples, battery })
}

fn apply_event(puppet: &mut ScriptedMotor, happening: &Happening) -> Report {
    if let Some(settings) = happening.settings {
        puppet.configure(settings);
    }
    if let Some(setpoint) = happening.setpoint {
        puppet.set(setpoint);
    }
    for &(ms, counts) in &happening.samples {
        puppet.sample(ms, counts);
    }
    puppet.step(happening.battery)
}

fn check(report: &Report, known: bool) -> Result<(), TestCaseError> {
    prop_assert!(report.regime.is_some() || report.drive == Drive::COAST, "{report:?}");
    prop_assert!(!known || report.velocity.to_f64().abs() <= FASTEST, "{:?}", report.velocity);
    Ok(())
}

fn period() -> impl Strategy<Value = Period> {
    prop_oneof![Just(1), Just(10), Just(50), 1..=100u32]
        .prop_map(|ms| Period::from_millis(ms).expect("in range"))
}

/// A motor with realistic constants.
fn plausible() -> impl Strategy<Value = Settings> {
    (20.0..20_000.0f64, 1.0..2.0f64, 0..2_000u16, any_settings()).prop_map(|(b, drag, friction, any)| {
        // The back EMF makes a decay of b times keFw. Drag raises the decay to up to twice this value.
        let decay = drag * b * 3.98683e-3;
        let dynamics = Dynamics {
            gain: AccelerationPerVolt::from_f64(b).expect("in range"),
            decay: DecayRate::from_f64(decay).expect("in range"),
            friction: Millivolts::new(friction),
        };
        let scheme = any.motor.scheme;
        Settings { dynamics: Some(dynamics), ..Settings::for_scheme(Winding::NEVEREST_60, scheme) }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_takes_a_motor_out_of_its_ranges(
        settings in settings(),
        period in period(),
        story in prop::collection::vec(happening(), 1..60),
    ) {
        let mut puppet = ScriptedMotor::new(settings, period);
        for happening in &story {
            let report = apply_event(&mut puppet, happening);
            check(&report, puppet.settings().dynamics.is_some())?;
        }
    }

    #[test]
    fn after_any_nonsense_an_encoder_is_believed_again(
        settings in plausible(),
        period in period(),
        story in prop::collection::vec(happening(), 1..40),
        speed in prop_oneof![-2_000..-50i32, 50..2_000i32],
    ) {
        let mut puppet = ScriptedMotor::new(settings, period);
        for happening in &story {
            apply_event(&mut puppet, happening);
        }
        // The settings were random too.
        puppet.configure(settings);
        puppet.set(Setpoint::Disabled);
        let every = u64::from(period.as_millis());
        let mut velocity = 0.0;
        for ms in 1..=3_000u64 {
            puppet.sample(1, 0);
            if ms % every == 0 {
                velocity = puppet.step(Some(12_000)).velocity.to_f64();
            }
        }
        prop_assert!(velocity.abs() < 25.0, "{velocity} counts/s at rest");
        // The shaft is turned at a constant speed.
        let position = |ms: i64| (i64::from(speed) * ms).div_euclid(1_000) as i32;
        for ms in 1..=3_000i64 {
            puppet.sample(1, position(ms) - position(ms - 1));
            if ms.unsigned_abs() % every == 0 {
                velocity = puppet.step(Some(12_000)).velocity.to_f64();
            }
        }
        let speed = f64::from(speed);
        prop_assert!((velocity - speed).abs() < 0.05 * speed.abs() + 2.0, "{velocity} for {speed} counts/s");
    }
}
