//! Compares the duty rules with the event-exact model of the switching bridge.

mod common;

use common::{neverest_60 as am60, winding};
use motor_hub::braking::{
    Blend, BlendFraction, DutyRule, LinearCurrent, Modulator, OperatingPoint, Points, Regime, Scheme,
    Winding, linear_current, linear_duty,
};
use motor_hub::bridge::{BridgeConstants, Drive, Mode, Timing};
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::model::periodic::Steady;
use motor_hub::model::si::{Hertz, Volts};
use motor_hub::model::switching::{Bridge, Circuit, Conditions, Pwm};
use motor_hub::units::{
    Control, CountsPerSecond, Duty, Emf, EmfConstant, Inductance, Millivolts, RangeError, Resistance, Voltage,
};

const BRIDGE: Bridge = Bridge::new(BridgeConstants::IDEAL);
const FREQUENCIES: [f64; 4] = [1_000.0, 8_000.0, 15_600.0, 20_000.0];
const BATTERIES: [f64; 4] = [6.5, 9.0, 12.0, 14.5];

/// The schemes that ask for a current.
fn schemes() -> impl Iterator<Item = Scheme> {
    Scheme::ALL.into_iter().filter(|scheme| *scheme != Scheme::ForwardReverse)
}

/// The constants of the usual bridge with this PWM frequency.
fn bridge(frequency: f64) -> BridgeConstants {
    BridgeConstants::new(700, 50, frequency as u32).expect("in range")
}

/// Voltages of a motor's current at a constant duty while the back EMF changes from `emf` volts: the back EMF after
/// `steps` steps of a tick. The tick has the length of `ticks` time constants of the motor, and `load` is in V.
fn emf_after(modulator: &Modulator, drive: Drive, emf: f64, battery: f64, load: f64, ticks: f64) -> f64 {
    const STEPS: u32 = 1_000;
    (0..STEPS).fold(emf, |emf, _| {
        let voltage = modulator.modulation(Point::new(emf, battery).at, drive).voltage.to_volts();
        emf + (f64::from(voltage) - emf - load) * ticks / f64::from(STEPS)
    })
}

#[test]
fn a_discontinuous_current_brings_a_motor_to_the_back_emf_that_was_asked_for() {
    let (battery, mut tried) = (12.0, 0);
    for motor in catalogue::motors() {
        let bridge = bridge(20_000.0);
        let modulator = Modulator::new(&winding(&motor), &bridge, Scheme::A, DutyRule::LinearCurrent);
        for (ticks, emf) in
            [0.1, 0.4, 1.0, 4.0, 12.0].into_iter().flat_map(|ticks| [2.0, 6.0, 9.0].map(|emf| (ticks, emf)))
        {
            for (share, load) in
                [0.4, 0.8, 0.95, 1.05, 1.2].into_iter().flat_map(|share| [0.0, 0.1].map(|load| (share, load)))
            {
                let at = Point::new(emf, battery).at;
                let change = (share - 1.0) * emf;
                let [change_f32, load_f32, ticks_f32] = [change, load, ticks].map(|value| value as f32);
                if load * ticks > 0.3 {
                    continue;
                }
                let Some((beyond, boundary)) =
                    modulator.discontinuous_to(at, change_f32, load_f32, ticks_f32)
                else {
                    continue;
                };
                let voltage = Voltage::from_volts(emf as f32 + beyond);
                if beyond.abs() > 0.9 * boundary {
                    continue;
                }
                let drive = modulator.for_voltage(at, voltage).drive;
                let reached = emf_after(&modulator, drive, emf, battery, load, ticks);
                let error = reached - emf - change;
                tried += 1;
                assert!(
                    error.abs() < 0.15 * change.abs() + 0.03 * emf,
                    "{}, {ticks} time constants, {emf} V to {share} of it with {load} V: {reached:.2} V",
                    motor.name
                );
            }
        }
    }
    assert!(tried > 300, "{tried}");
}

#[test]
fn the_current_of_a_duty_changes_with_the_back_emf_by_the_share_that_is_told() {
    for motor in catalogue::motors() {
        let bridge = bridge(20_000.0);
        let modulator = Modulator::new(&winding(&motor), &bridge, Scheme::A, DutyRule::LinearCurrent);
        for (mode, duty, emf) in [Mode::Cw98, Mode::Brake50]
            .into_iter()
            .flat_map(|mode| [0.05, 0.2, 0.5, 0.8].map(|duty| (mode, duty)))
            .flat_map(|(mode, duty)| [2.0, 6.0, 9.0].map(|emf| (mode, duty, emf)))
        {
            let drive = Drive { mode, duty: Duty::from_bits((duty * 32_768.0) as u16) };
            let beyond = |emf: f64| {
                f64::from(modulator.modulation(Point::new(emf, 12.0).at, drive).voltage.to_volts()) - emf
            };
            let share = f64::from(modulator.modulation(Point::new(emf, 12.0).at, drive).emf_share);
            let [below, above] = [-0.02, 0.02].map(|change| {
                modulator.modulation(Point::new(emf + change, 12.0).at, drive).emf_share == 1.0
            });
            if below != above {
                // The boundary of discontinuous current.
                continue;
            }
            let slope = (beyond(emf - 0.02) - beyond(emf + 0.02)) / 0.04;
            assert!(
                (slope - share).abs() < 0.35,
                "{}, {mode:?} {duty} at {emf} V: {slope:.3}, told {share:.3}",
                motor.name
            );
        }
    }
}

/// The duty rule for a motor on the usual bridge with this PWM frequency.
fn rule(motor: &Motor, frequency: f64) -> LinearCurrent {
    LinearCurrent::new(&winding(motor), &bridge(frequency))
}

/// An operating point at this back EMF, to 1/256 mV.
struct Point {
    at: OperatingPoint,
    emf: f64,
    battery: f64,
}

impl Point {
    fn new(emf_volts: f64, battery: f64) -> Self {
        // At 1 mV s/count the speed is the back EMF.
        let constant = EmfConstant::from_bits(1 << 20).expect("in range");
        let speed = CountsPerSecond::saturating_from_bits((emf_volts * 256e3).round() as i64);
        let emf: Emf = constant.emf(speed);
        let at = OperatingPoint::new(emf, Millivolts::new((battery * 1e3) as u16)).expect("battery");
        Self { at, emf: emf.to_f64() / 1e3, battery }
    }

    /// Returns the mean current of the ideal bridge for a bridge command, in A.
    fn current(&self, motor: &Motor, frequency: f64, placement: Drive) -> f64 {
        self.current_on(BRIDGE, motor, frequency, placement)
    }

    /// Returns the mean current of a bridge for a bridge command, in A.
    fn current_on(&self, bridge: Bridge, motor: &Motor, frequency: f64, placement: Drive) -> f64 {
        self.steady(bridge, motor, frequency, placement).mean.0
    }

    fn steady(&self, bridge: Bridge, motor: &Motor, frequency: f64, placement: Drive) -> Steady {
        let pwm = Pwm::new(placement.mode, placement.duty.to_f64(), Hertz(frequency));
        let conditions = Conditions { battery: Volts(self.battery), emf: Volts(self.emf) };
        Circuit::new(motor, bridge).steady(pwm, conditions)
    }

    /// Returns the deviation of a current from the straight line of the scheme, as a share of Vbat/R.
    fn deviation(&self, motor: &Motor, scheme: Scheme, control: i16, current: f64) -> f64 {
        (current - self.asked(motor, scheme, control)).abs() / (self.battery / motor.r.0)
    }

    /// Returns the current that the straight lines of the scheme request (paper, sections 2 and 3). It is computed here
    /// independently of the hub's code.
    fn asked(&self, motor: &Motor, scheme: Scheme, control: i16) -> f64 {
        let turn = if self.emf < 0.0 { -1.0 } else { 1.0 };
        let c = turn * f64::from(control) / 32_767.0;
        let (v, e) = (self.battery, self.emf.abs());
        let u = e / v;
        // `rho` is the factor by which Scheme C stretches S and T. `leaving(a)` limits the factor, so that a share `a`
        // of full braking stays within the control range.
        let rho = (1.0 + u) / (1.0 - u);
        let leaving = |a: f64| if a > 0.0 { rho.min((1.0 + u) / (u * a)) } else { rho };
        let near_overrun = leaving(10.0 * u - 9.0);
        let scaled_pull = |blend: f64, stretch: f64| (v + e) / (1.0 + blend * (stretch - 1.0));
        let volts = match scheme {
            Scheme::A => c * v - e,
            _ if c > 0.0 => c * (v - e),
            Scheme::B => c * (v + e),
            Scheme::C => c * scaled_pull(1.0, near_overrun),
            Scheme::D(Blend::Fixed(_)) => c * scaled_pull(0.5, near_overrun),
            Scheme::D(Blend::Automatic) => c * scaled_pull(1.0, leaving(1.0)),
            Scheme::ForwardReverse => unreachable!("asks for no current"),
        };
        turn * volts / (motor.r.0 + 2.0 * BRIDGE.ron.0)
    }
}

/// Operating points at speeds from standstill to 95 % of the free speed, in both directions.
fn points(motor: &Motor, batteries: &[f64]) -> Vec<Point> {
    let free = motor.ke.0 * motor.ke.0 / (motor.ke.0 * motor.ke.0 + motor.r.0 * motor.b.0);
    let shares = [0.0, 0.005, 0.02, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95];
    let emfs = |battery: f64| {
        shares.into_iter().flat_map(move |u| [1.0, -1.0].map(|sign| sign * u * free * battery))
    };
    batteries.iter().flat_map(|&battery| emfs(battery).map(move |emf| Point::new(emf, battery))).collect()
}

fn controls() -> impl Iterator<Item = i16> {
    (-32..=32).map(|n: i16| n.saturating_mul(1024).clamp(-32_767, 32_767))
}

/// Largest deviation from the straight line, as a share of Vbat/R, over the whole catalogue.
fn worst(place: impl Fn(&LinearCurrent, Scheme, OperatingPoint, Control) -> Drive) -> f64 {
    let mut worst = 0.0f64;
    for (motor, frequency) in catalogue::motors().flat_map(|motor| FREQUENCIES.map(|hz| (motor, hz))) {
        let rule = rule(&motor, frequency);
        for point in points(&motor, &BATTERIES) {
            for (scheme, control) in schemes().flat_map(|s| controls().map(move |c| (s, c))) {
                let placement = place(&rule, scheme, point.at, Control::new(control));
                let current = point.current(&motor, frequency, placement);
                worst = worst.max(point.deviation(&motor, scheme, control, current));
            }
        }
    }
    worst
}

#[test]
fn mean_current_is_the_line_asked_for_over_the_whole_catalogue() {
    let linear_duty = worst(|_, scheme, at, control| linear_duty(scheme, at, control));
    let linear_current = worst(linear_current);
    println!("worst deviation from the line, share of Vbat/R:");
    println!("linear duty {linear_duty:.4}, linear current {linear_current:.4}");
    assert!(linear_current < 0.0025, "{linear_current}");
    assert!(linear_duty > 0.2, "{linear_duty}: the comparison has lost its point");
}

#[test]
fn current_is_continuous_and_rises_with_every_control_value() {
    let motor = &am60();
    for frequency in [1_000.0, 20_000.0] {
        let winding = rule(motor, frequency);
        for emf in [-10.8, -0.3, 0.0, 0.5, 3.0, 6.0, 11.0, 12.5] {
            let point = Point::new(emf, 12.0);
            for scheme in schemes() {
                let mut last: Option<f64> = None;
                for control in (-32_767..=32_767).step_by(7) {
                    let placement = linear_current(&winding, scheme, point.at, Control::new(control));
                    let current = point.current(motor, frequency, placement);
                    if let Some(last) = last {
                        let step = (current - last) / (12.0 / motor.r.0);
                        assert!((-0.0015..0.006).contains(&step), "{scheme:?} {emf} V at {control}: {step}");
                    }
                    last = Some(current);
                }
            }
        }
    }
}

/// A number that grows with the requested torque: first by regime, then by duty.
fn rank(at: OperatingPoint, placement: Drive, emf: f64) -> i32 {
    let duty = i32::from(placement.duty.to_bits());
    let turn = if emf < 0.0 { -1 } else { 1 };
    turn * match at.regime(placement) {
        Regime::Reverse => -(1 << 17) - duty,
        Regime::Braking => -duty,
        Regime::Forward => duty,
    }
}

#[test]
fn duty_is_monotone_over_every_control_value_to_its_last_bits() {
    let usual = Winding::NEVEREST_60;
    let ideal = BridgeConstants::new(0, 0, 20_000).expect("in range");
    for (winding, bridge) in [
        (usual, bridge(20_000.0)),
        (usual, bridge(1_000.0)),
        (Winding { inductance: None, ..usual }, bridge(20_000.0)),
        (
            Winding { resistance: Resistance::from_milliohms(20_600).expect("in range"), ..usual },
            bridge(1_000.0),
        ),
        (usual, ideal),
    ] {
        let rule = LinearCurrent::new(&winding, &bridge);
        for emf in [-14.0, -6.0, -0.2, 0.0, 0.01, 0.69, 0.71, 3.0, 6.0, 11.9, 12.0, 12.1, 14.0, 25.0] {
            let point = Point::new(emf, 12.0);
            for scheme in schemes() {
                let mut last = i32::MIN;
                for control in -32_767..=32_767 {
                    let placement = linear_current(&rule, scheme, point.at, Control::new(control));
                    let rank = rank(point.at, placement, emf);
                    // The solution is rounded: 2^-13 of a duty may be lost from one value to the next.
                    assert!(
                        rank >= last.saturating_sub(4),
                        "{winding:?} {bridge:?} {scheme:?} {emf} V at {control}"
                    );
                    last = last.max(rank);
                }
            }
        }
    }
}

#[test]
fn regimes_are_those_of_the_points() {
    let rule = LinearCurrent::new(&Winding::NEVEREST_60, &BridgeConstants::IDEAL);
    for emf in [-11.0, -3.0, 0.0, 0.4, 6.0, 11.5] {
        let at = Point::new(emf, 12.0).at;
        for scheme in schemes() {
            let mut differing = 0i32;
            for control in (-32_767..=32_767).map(Control::new) {
                let linear = linear_duty(scheme, at, control);
                let current = linear_current(&rule, scheme, at, control);
                differing += i32::from(at.regime(linear) != at.regime(current));
            }
            // The points are exact, and voltages are rounded to 1/16 mV. At a boundary the regimes may therefore
            // differ. The automatic blend is also rounded, by 1/65536 of the distance to Scheme C.
            let most = match scheme {
                Scheme::D(Blend::Automatic) => 2 - (Points::new(Scheme::C, at).t.to_f64() / 65_536.0) as i32,
                _ => 2,
            };
            assert!(differing <= most, "{scheme:?} {emf} V: {differing}");
        }
    }
}

#[test]
fn a_resistance_or_inductance_that_is_wrong_costs_little() {
    let motor = &am60();
    for (resistance, inductance) in [(0.5, 1.0), (2.0, 1.0), (1.0, 0.5), (1.0, 2.0)] {
        let configured = Winding {
            resistance: Resistance::from_ohms(resistance * motor.r.0).expect("in range"),
            inductance: Inductance::from_millihenries(1e3 * inductance * motor.l.0).ok(),
            ..winding(motor)
        };
        let mut worst = 0.0f64;
        for frequency in FREQUENCIES {
            let rule = LinearCurrent::new(&configured, &bridge(frequency));
            for (point, control) in points(motor, &[12.0])
                .iter()
                .flat_map(|point| controls().map(move |control| (point, control)))
            {
                let placement = linear_current(&rule, Scheme::A, point.at, Control::new(control));
                let current = point.current(motor, frequency, placement);
                worst = worst.max(point.deviation(motor, Scheme::A, control, current));
            }
        }
        println!("R x{resistance}, L x{inductance}: {worst:.4} of Vbat/R");
        assert!(worst < 0.065, "R x{resistance}, L x{inductance}: {worst}");
    }
}

#[test]
fn an_unknown_inductance_is_the_limit_of_a_high_frequency() {
    let motor = &am60();
    let unknown = Winding { inductance: None, ..Winding::NEVEREST_60 };
    let unknown = LinearCurrent::new(&unknown, &BridgeConstants::IDEAL);
    for emf in [0.0, 3.0, 9.0] {
        let point = Point::new(emf, 12.0);
        for control in controls() {
            let placement = linear_current(&unknown, Scheme::A, point.at, Control::new(control));
            let current = point.current(motor, 1e6, placement);
            let deviation = point.deviation(motor, Scheme::A, control, current);
            assert!(deviation < 0.01, "{emf} V at {control}: {deviation}");
        }
    }
}

#[test]
fn nothing_overflows_at_the_ends_of_the_ranges() {
    assert_eq!(OperatingPoint::new(Emf::default(), Millivolts::new(0)), None);
    for mohm in [1, u16::MAX] {
        for uh in [None, Some(1), Some(u16::MAX)] {
            let winding = Winding {
                resistance: Resistance::from_milliohms(mohm).expect("in range"),
                inductance: uh.and_then(|uh| Inductance::from_microhenries(uh).ok()),
                ..Winding::NEVEREST_60
            };
            for (diode_mv, switch_mohm) in [(0, 0), (0, 4_095), (2_000, 0), (2_000, 4_095)] {
                for pwm_hz in [100, 200_000] {
                    let bridge = BridgeConstants::new(diode_mv, switch_mohm, pwm_hz).expect("in range");
                    ends(&LinearCurrent::new(&winding, &bridge));
                }
            }
        }
    }
}

fn ends(rule: &LinearCurrent) {
    let largest = EmfConstant::from_bits((1 << 25) - 1).expect("largest");
    for cps in [i32::MIN, -400, -1, 0, 1, 12, 399, i32::MAX] {
        for battery in [1, 12_000, u16::MAX] {
            let emf = largest.emf(CountsPerSecond::new(cps));
            let at = OperatingPoint::new(emf, Millivolts::new(battery)).expect("battery");
            for scheme in Scheme::ALL.into_iter().chain([Scheme::D(Blend::Fixed(BlendFraction::ONE))]) {
                for control in [i16::MIN, -20_000, -1, 0, 1, 20_000, i16::MAX] {
                    let _ = linear_current(rule, scheme, at, Control::new(control));
                }
            }
        }
    }
}

#[test]
fn bridges_out_of_range_are_refused() {
    for (diode_mv, switch_mohm, pwm_hz) in
        [(2_001, 50, 20_000), (700, 4_096, 20_000), (700, 50, 99), (700, 50, 200_001)]
    {
        let refused = BridgeConstants::new(diode_mv, switch_mohm, pwm_hz);
        assert_eq!(refused, Err(RangeError::Bridge), "{diode_mv} {switch_mohm} {pwm_hz}");
    }
    for (diode_mv, switch_mohm, pwm_hz) in [(0, 0, 100), (2_000, 4_095, 200_000)] {
        let bridge = BridgeConstants::new(diode_mv, switch_mohm, pwm_hz).expect("in range");
        let constants = (bridge.diode_mv(), bridge.switch_mohm(), bridge.pwm_hz());
        assert_eq!(constants, (diode_mv, switch_mohm, pwm_hz));
    }
}

#[test]
fn the_neverest_60_is_the_one_of_the_catalogue() {
    let motor = &am60();
    let winding = Winding::NEVEREST_60;
    assert!((f64::from(winding.emf.to_bits()) - motor.ke_fw() * f64::from(1 << 20)).abs() <= 0.5);
    assert_eq!(f64::from(winding.resistance.as_milliohms()), (1e3 * motor.r.0).round());
    assert_eq!(winding.inductance.map(|l| f64::from(l.as_microhenries())), Some((1e6 * motor.l.0).round()));
}

/// Largest deviation from the line of a bridge with `real` edges, when the hub is configured for other edges. Both
/// values are shares of Vbat/R: of all control values, and of control values whose duty the bridge accepts.
fn worst_of_timed(real: Timing, configured: Timing, frequency: f64) -> (f64, f64) {
    let real = Bridge::new(bridge(frequency).with_timing(real));
    let (mut worst, mut of_allowed) = (0.0f64, 0.0f64);
    for motor in catalogue::motors() {
        let rule = |timing| LinearCurrent::new(&winding(&motor), &bridge(frequency).with_timing(timing));
        let limited = rule(configured);
        let unlimited = rule(Timing { least_off_ns: 0, least_on_ns: 0, ..configured });
        for point in points(&motor, &BATTERIES) {
            for control in controls() {
                let drive = |rule| linear_current(rule, Scheme::A, point.at, Control::new(control));
                let current = point.current_on(real, &motor, frequency, drive(&limited));
                let deviation = point.deviation(&motor, Scheme::A, control, current);
                worst = worst.max(deviation);
                if drive(&unlimited) == drive(&limited) {
                    of_allowed = of_allowed.max(deviation);
                }
            }
        }
    }
    (worst, of_allowed)
}

#[test]
fn of_a_real_bridge_the_line_keeps_what_the_shortest_low_time_leaves_of_it() {
    let real = Timing::VNH5019;
    let slowest = Timing { turn_on_ns: 2_400, turn_off_ns: 1_600, ..real };
    println!("worst deviation from the line with the timing of a VNH2SP30-E, share of Vbat/R:");
    for (frequency, most) in [(20_000.0, 0.064), (10_000.0, 0.033)] {
        let (uncompensated, _) = worst_of_timed(real, Timing::IDEAL, frequency);
        let (all, allowed) = worst_of_timed(real, real, frequency);
        let (_, slow) = worst_of_timed(slowest, real, frequency);
        println!("{frequency} Hz: {all:.4}; where the duty may be given {allowed:.4}");
        println!(
            "  slowest edges, configured as typical: {slow:.4}; edges not compensated: {uncompensated:.4}"
        );
        // The largest error is half of the shortest low time, 3 us of 50 us, times V + Vd. This is 6.3 % of V.
        assert!((most / 2.0..most).contains(&all), "{all}");
        assert!(allowed < 0.0025, "{allowed}");
        assert!(slow < 0.012, "{slow}");
        assert!(uncompensated > 4.0 * allowed, "{uncompensated}: the compensation of edges has no effect");
    }
}

#[test]
fn no_bridge_is_given_a_duty_that_it_must_be_spared() {
    let motor = &am60();
    let winding = Winding::NEVEREST_60;
    for (hz, off, on) in
        [(20_000, 0.12, 0.048), (10_000, 0.06, 0.024), (1_000, 0.006, 0.0024), (200_000, 1.0, 1.0)]
    {
        let bridge = bridge(f64::from(hz)).with_timing(Timing::VNH5019);
        let current = LinearCurrent::new(&common::winding(motor), &bridge);
        for rule in DutyRule::ALL {
            let modulator = Modulator::new(&winding, &bridge, Scheme::A, rule);
            for emf in [-11.0, -3.0, 0.0, 0.4, 6.0, 11.5, 13.0] {
                let at = Point::new(emf, 12.0).at;
                let mut seen = 0;
                for control in (-32_767..=32_767).step_by(3).map(Control::new) {
                    let drives = [
                        linear_current(&current, Scheme::A, at, control),
                        modulator.for_control(at, control).drive,
                        modulator.open_loop(at, control).drive,
                    ];
                    for duty in drives.map(|placement| placement.duty.to_f64()) {
                        // A duty has 15 bits.
                        let fits = |least: f64, time: f64| time == 0.0 || time > least - 1e-4;
                        assert!(
                            fits(on, duty) && fits(off, 1.0 - duty),
                            "{hz} Hz, {emf} V, {control:?}: {duty}"
                        );
                        seen += i32::from(duty == 1.0) + i32::from(duty == 0.0);
                    }
                }
                assert!(seen > 0, "both ends stay within reach");
            }
        }
    }
}

#[test]
fn the_current_that_a_duty_is_said_to_make_is_that_of_the_bridge() {
    // The regulator gets the applied voltage where the bridge cannot have the requested duty.
    let motor = &am60();
    for hz in [20_000.0, 10_000.0] {
        let bridge = bridge(hz).with_timing(Timing::VNH5019);
        let modulator = Modulator::new(&Winding::NEVEREST_60, &bridge, Scheme::A, DutyRule::LinearCurrent);
        for emf in [-9.0, -3.0, 0.5, 3.0, 6.0, 11.0] {
            let point = Point::new(emf, 12.0);
            let by_control = controls().map(|control| modulator.for_control(point.at, Control::new(control)));
            let by_voltage = (-140..=140)
                .map(|tenths| modulator.for_voltage(point.at, Voltage::from_volts(0.1 * tenths as f32)));
            for placement in by_control.chain(by_voltage) {
                let flows = point.current_on(Bridge::new(bridge), motor, hz, placement.drive);
                let said = f64::from(placement.voltage.to_volts()) - emf;
                let error = (flows - said / (motor.r.0 + 0.1)) / (12.0 / motor.r.0);
                assert!(error.abs() < 0.004, "{hz} Hz, {emf} V, {placement:?}: {error}");
            }
        }
    }
}

#[test]
fn returned_and_dissipated_power_are_those_of_the_bridge() {
    let (motor, ohms) = (&am60(), 3.4);
    let modulator =
        Modulator::new(&Winding::NEVEREST_60, &BridgeConstants::IDEAL, Scheme::A, DutyRule::LinearDuty);
    // At 800, 1505 and 2500 counts/s.
    for emf in [3.19, 6.0, 9.97] {
        let point = Point::new(emf, 12.0);
        for percent in [10, 30, 50, 70, 90, 100] {
            let drive = Drive { mode: Mode::Brake50, duty: Duty::ratio(percent, 100) };
            let computed = modulator.braking_power(point.at, modulator.modulation(point.at, drive), ohms);
            let Steady { sums, period, .. } = point.steady(BRIDGE, motor, 20_000.0, drive);
            let [returned, dissipated] = [12.0 * sums.to_battery, sums.heat].map(|joules| joules / period.0);
            for (what, computed, truly) in [
                ("returned", computed.returned_watts, returned),
                ("dissipated", computed.dissipated_watts, dissipated),
            ] {
                let miss = (f64::from(computed) - truly).abs();
                let most = 0.1 * (returned + dissipated) + 0.02;
                assert!(miss < most, "{emf} V, {percent} %: {what} {computed} W, {truly} W");
            }
        }
    }
}
