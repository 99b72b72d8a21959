//! The identification of a motor finds its dynamics within 10 %, or says why it cannot.

mod common;

use common::{BATTERY, Bench, Cable, motor, velocity};
use motor_hub::braking::Scheme;
use motor_hub::bridge::Drive;
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::{Motor, motors};
use motor_hub::model::load::Load;
use motor_hub::model::si::{Ohms, Volts};
use motor_hub::motor::{EncoderFault, OnFault, Setpoint, Settings};
use motor_hub::regulator::Dynamics;
use motor_hub::regulator::identify::{Identification, Identified, Refusal, least_travel, travel};
use motor_hub::units::{Control, EmfConstant, Millivolts, Period};
use std::f64::consts::TAU;

/// Friction and loads are shares of the stall torque at this voltage.
const NOMINAL: Volts = Volts(12.0);

/// A motor with its load, and its configuration.
#[derive(Clone, Copy, Debug)]
struct Setup {
    motor: Motor,
    /// Inertia of the load, as a multiple of the rotor's inertia.
    inertia: f64,
    /// Coulomb friction, as a share of the stall torque.
    friction: f64,
    /// Configured resistance and back EMF, as factors of the true ones.
    configured: (f64, f64),
    battery: Battery,
    period_ms: u32,
    scheme: Scheme,
    limit: u32,
}

/// Result of an identification.
struct Outcome {
    identification: Identification,
    /// Lowest and highest position in counts.
    travel: (i64, i64),
}

impl Setup {
    fn new(name: &str) -> Self {
        Self::of(motor(name))
    }

    fn of(motor: Motor) -> Self {
        Self {
            motor,
            inertia: 1.0,
            friction: 0.03,
            configured: (1.0, 1.0),
            battery: Battery { emf: Volts(12.6), resistance: Ohms(0.0) },
            period_ms: 50,
            scheme: Scheme::A,
            limit: u32::MAX,
        }
    }

    fn load(&self) -> Load {
        common::rotors(&self.motor, 1.0 + self.inertia)
    }

    fn stall(&self) -> f64 {
        self.motor.stall_torque(NOMINAL).0
    }

    fn settings(&self) -> Settings {
        let (mut motor, (r, ke)) = (self.motor, self.configured);
        motor.r.0 *= r;
        motor.ke.0 *= ke;
        Settings::for_scheme(common::winding(&motor), self.scheme)
    }

    /// The true dynamics, without friction.
    fn truth(&self) -> Dynamics {
        common::dynamics(&self.motor, &self.load())
    }

    /// The true c in volts.
    fn friction_volts(&self) -> f64 {
        self.friction * self.stall() * (self.motor.r.0 + 0.1) / self.motor.kt.0
    }

    fn bench(&self) -> Bench<1> {
        let plant = common::plant(common::rough(self.motor, self.friction_volts()), self.load());
        let mut bench = Bench::one(self.settings(), plant, self.period_ms);
        bench.rig.battery = self.battery;
        bench.set(0, Setpoint::Identify { travel_limit: self.limit });
        bench
    }

    fn run(&self) -> Outcome {
        self.disturbed(|_| ())
    }

    /// Runs the identification under an external torque. `share` returns the torque as a share of the stall torque, for
    /// a position in counts and a time in ms.
    fn loaded(&self, share: impl Fn(f64, u64) -> f64) -> Outcome {
        let stall_after = self.stall() * self.motor.eta * self.motor.gear_ratio;
        self.disturbed(|bench| bench.axes[0].torque = share(bench.counts(0), bench.ms) * stall_after)
    }

    /// Runs the identification. `act` is called every millisecond, and may change the bench.
    fn disturbed(&self, act: impl Fn(&mut Bench<1>)) -> Outcome {
        let mut bench = self.bench();
        let mut travel = (0, 0);
        while bench.ms < 40_000 {
            act(&mut bench);
            let counts = bench.rig.plants[0].counts();
            travel = (travel.0.min(counts), travel.1.max(counts));
            bench.run_ms(1);
            let report = bench.report();
            if !matches!(report.identification, Identification::Running(_)) {
                assert_eq!(report.drive, Drive::COAST, "it coasts afterwards");
                return Outcome { identification: report.identification, travel };
            }
        }
        panic!("no end: {self:?}");
    }

    /// Errors of the found dynamics: b as a share of its true value, c in volts.
    fn errors(&self, found: &Identified) -> (f64, f64) {
        let [gain, truth] = [found.dynamics, self.truth()].map(|dynamics| f64::from(dynamics.gain.to_f32()));
        (gain / truth - 1.0, f64::from(found.dynamics.friction.get()) / 1e3 - self.friction_volts())
    }
}

fn found(outcome: &Outcome) -> Identified {
    match outcome.identification {
        Identification::Found(found) => found,
        other => panic!("{other:?}"),
    }
}

/// Every motor without a load, and with four times the inertia of its rotor as a load.
fn setups() -> impl Iterator<Item = Setup> {
    let each = |motor| [0.0, 4.0].map(|inertia| Setup { inertia, ..Setup::of(motor) });
    motors().map(Motor::with_measured_rotor_inertia).flat_map(each)
}

#[test]
fn every_motor_of_the_catalogue_is_known_within_10_percent() {
    for (period_ms, configured) in [(10, (0.7, 1.1)), (50, (1.3, 0.9))] {
        let (mut errors, mut refused) = (Vec::new(), 0);
        for (setup, friction) in setups().flat_map(|setup| [0.0, 0.1].map(|friction| (setup, friction))) {
            let setup = Setup { friction, period_ms, configured, ..setup };
            match setup.run().identification {
                Identification::Found(found) => errors.push(setup.errors(&found).0.abs()),
                _ => refused += 1,
            }
        }
        errors.sort_by(f64::total_cmp);
        assert!(errors[9 * (errors.len() - 1) / 10] < 0.06, "{period_ms} ms: {errors:?}");
        // A Core Hex motor with a load of four times its rotor's inertia may be refused. It is too slow for an encoder
        // with four counts per turn.
        assert!(
            refused * 10 <= refused + errors.len(),
            "{period_ms} ms: {refused} of {}",
            refused + errors.len()
        );
    }
}

/// Times in s that a motor with these configured dynamics needs from rest to 0.5 of its free speed, and on to 0.15 of
/// it, each to within 2 %. The first set-point comes `at_ms` after the start.
fn settling(setup: &Setup, configured: Dynamics, at_ms: u64) -> [f64; 2] {
    let truth = setup.truth();
    let mut bench = setup.bench();
    bench.configure(0, |settings| settings.dynamics = Some(configured));
    bench.set(0, velocity(0));
    bench.run_ms(at_ms);
    let (gain, decay) = (f64::from(truth.gain.to_f32()), f64::from(truth.decay.to_f32()));
    let free_cps = gain / decay * (BATTERY - setup.friction_volts());
    let mut before = 0.0;
    [0.5, 0.15].map(|share| {
        let cps: f64 = share * free_cps;
        let band = (0.02 * cps).max(0.02 * (cps - before).abs()).max(2.0);
        before = cps;
        bench.set(0, velocity(cps as i32));
        let begin = bench.ms;
        let mut outside = begin;
        // Up to half of the free speed a motor needs some 0.7 of its time constant.
        while bench.ms < begin + 2_000 + (1_500.0 / decay) as u64 {
            bench.run_ms(1);
            if (bench.speed(0) - cps).abs() > band {
                outside = bench.ms;
            }
        }
        assert!(outside + 1_000 < bench.ms, "{} does not settle at {cps} counts/s", setup.motor.name);
        1e-3 * (outside - begin) as f64
    })
}

#[test]
fn an_identified_motor_settles_within_10_percent_of_the_time_of_an_exactly_configured_one() {
    for motor in motors().map(Motor::with_measured_rotor_inertia) {
        for inertia in [0.0, 3.0] {
            let setup = Setup { inertia, ..Setup::of(motor) };
            let friction = Millivolts::new((1e3 * setup.friction_volts()) as u16);
            let exact = Dynamics { friction, ..setup.truth() };
            // With a load, the Core Hex motors take minutes. A time to settle depends on the phase of the tick.
            let phases: &[u64] = match exact.decay.to_f32() {
                1.0.. => &[5, 15, 25, 35, 45],
                0.02.. => &[25],
                _ => continue,
            };
            let found = found(&setup.run()).dynamics;
            let mean = |dynamics| {
                let times = phases.iter().map(|phase_ms| settling(&setup, dynamics, 1_000 + phase_ms));
                times
                    .fold([0.0; 2], |sum, [up, down]| [sum[0] + up, sum[1] + down])
                    .map(|sum| sum / phases.len() as f64)
            };
            let (of_exact, of_found) = (mean(exact), mean(found));
            assert!(
                // A time of two ticks may differ by less than half of a tick.
                (0..2).all(|step| of_found[step] <= (1.1 * of_exact[step]).max(of_exact[step] + 0.02)),
                "{}, {inertia} more rotors: {of_found:.3?} s, {of_exact:.3?} s exactly",
                motor.name
            );
        }
    }
}

#[test]
fn friction_and_back_emf_are_found_with_honest_errors() {
    let bench = Setup { friction: 0.05, ..Setup::new("AM 60 A") };
    let found = found(&bench.run());
    let (b, c) = bench.errors(&found);
    assert!(b.abs() < 3.0 * f64::from(found.gain_error) / 1e3, "{b} {found:?}");
    assert!(c.abs() < 3.0 * f64::from(found.friction_error.get()) / 1e3, "{c} {found:?}");
    // Back EMF and drag: q / b = Ke / kc + B R / (Kt kc).
    let Motor { ke, kt, b: drag, r, .. } = bench.motor;
    let true_emf = EmfConstant::from_ke(ke.0 + drag.0 * (r.0 + 0.1) / kt.0, 28.0).expect("in range");
    let off = f64::from(found.emf.to_bits()) / f64::from(true_emf.to_bits()) - 1.0;
    assert!(
        !found.emf_is_configured && off.abs() < 3.0 * f64::from(found.emf_error) / 1e3,
        "{off} {found:?}"
    );
    let product = found.dynamics.gain.to_f32() * found.emf.to_bits() as f32 / (1e3 * (1 << 20) as f32);
    assert!((found.dynamics.decay.to_f32() / product - 1.0).abs() < 1e-3);
    assert!((20..150).contains(&found.residual), "{found:?}");
}

#[test]
fn a_friction_that_may_be_noise_counts_as_none() {
    let battery = Battery { emf: Volts(12.6), resistance: Ohms(0.05) };
    for (name, inertia) in [("AM 20 B", 0.0), ("Core Hex-C", 3.0)] {
        let setup = Setup { inertia, friction: 0.0, battery, ..Setup::new(name) };
        assert_eq!(found(&setup.run()).dynamics.friction, Millivolts::new(0), "{name}");
    }
}

#[test]
fn what_a_short_motion_cannot_show_is_taken_as_configured() {
    // The motor has a time constant of 13 s, which is too long for the identification to measure the decay.
    let bench = Setup { inertia: 4.0, configured: (1.0, 0.9), ..Setup::new("Matrix C") };
    let found = found(&bench.run());
    assert!(found.emf_is_configured && found.emf_error > 100, "{found:?}");
    assert!((found.emf.to_bits() - bench.settings().winding.emf.to_bits()).abs() <= 1);
}

#[test]
fn a_scheme_changes_nothing_of_what_is_found() {
    // If the configured back EMF is too large, the bridge is open at the end of a section of the motion.
    for configured in [(1.0, 1.0), (1.0, 1.1)] {
        for scheme in [Scheme::ForwardReverse, Scheme::A, Scheme::B, Scheme::C] {
            let bench = Setup { scheme, configured, friction: 0.0, ..Setup::new("AM 60 A") };
            let (b, _) = bench.errors(&found(&bench.run()));
            assert!(b.abs() < 0.05, "{scheme:?} {configured:?}: {b}");
        }
    }
}

#[test]
fn the_motor_turns_no_further_than_announced() {
    for (limit, emf) in
        [u32::MAX, 2_000, 1_000, 900].into_iter().flat_map(|limit| [(limit, 1.1), (limit, 0.9)])
    {
        for setup in setups() {
            let bench = Setup { friction: 0.0, configured: (1.0, emf), limit, period_ms: 10, ..setup };
            let most = travel(bench.settings().winding.emf, Millivolts::new(12_600), limit);
            let (least, reached) = bench.run().travel;
            let most = i64::from(most);
            assert!(reached <= most && -least <= most, "{reached} {least} {most} {bench:?}");
        }
    }
}

#[test]
fn a_limit_shortens_the_motion_and_may_leave_too_little_of_it() {
    let bench = Setup { limit: 1_000, period_ms: 10, ..Setup::new("AM 60 A") };
    let outcome = bench.run();
    assert!(found(&outcome).gain_error < 50);
    assert!(outcome.travel.1 > 500, "{:?}", outcome.travel);
    let least = least_travel(bench.settings().winding.emf, Millivolts::new(12_600), Period::DEFAULT);
    let at = |limit| Setup { limit, period_ms: 50, ..bench }.run();
    assert!(matches!(at(least).identification, Identification::Found(_)));
    let outcome = at(least - 10);
    assert_eq!(outcome.identification, Identification::Refused(Refusal::TravelLimit));
    assert_eq!(outcome.travel, (0, 0));
}

fn refused(outcome: Outcome, reasons: &[Refusal], what: &str) {
    match outcome.identification {
        Identification::Refused(why) if reasons.contains(&why) => (),
        other => panic!("{what}: {other:?}, {:?}", outcome.travel),
    }
}

#[test]
fn a_motor_under_gravity_is_refused() {
    for name in ["AM 60 A", "AM 20 C", "AM 40 C", "AM 3.7 C"] {
        for (friction, share) in [(0.0, 0.1), (0.0, -0.1), (0.1, 0.05), (0.1, -0.05), (0.05, 0.4)] {
            let bench = Setup { friction, ..Setup::new(name) };
            let outcome = bench.loaded(|_, _| share);
            refused(outcome, &[Refusal::NotAtRest, Refusal::Load], &format!("{name} {share}"));
        }
    }
}

#[test]
fn a_spring_is_refused() {
    for friction in [0.0, 0.05] {
        for per_1000 in [0.1, 0.2, 0.4, 0.8, 2.0] {
            let bench = Setup { friction, ..Setup::new("AM 60 A") };
            let outcome = bench.loaded(|counts, _| -per_1000 * counts / 1000.0);
            let reasons = [Refusal::Spring, Refusal::Load, Refusal::NoCounts, Refusal::Implausible];
            refused(outcome, &reasons, &format!("{per_1000} of stall per 1000 counts"));
        }
    }
}

#[test]
fn a_stop_on_the_way_is_refused() {
    for at in [20.0, 100.0, 300.0, 1_000.0] {
        let stop = |counts: f64, _| if counts > at { -0.3 * (counts - at) } else { 0.0 };
        let outcome = Setup::new("AM 60 A").loaded(stop);
        let reasons = [Refusal::NoCounts, Refusal::PoorFit, Refusal::Load, Refusal::Spring];
        refused(outcome, &reasons, &format!("{at}"));
    }
}

#[test]
fn no_load_leads_to_a_wrong_identification() {
    for name in ["AM 60 A", "AM 40 B", "AM 20 B", "AM 3.7 B", "Matrix C"] {
        for (inertia, friction, period_ms) in [(0.0, 0.0, 50), (1.0, 0.05, 10), (4.0, 0.05, 50)] {
            let bench = Setup { inertia, friction, period_ms, ..Setup::new(name) };
            let turn = bench.motor.counts_per_rev_motor * bench.motor.gear_ratio / TAU;
            let check = |what: String, pull: &dyn Fn(f64, u64) -> f64| {
                let outcome = bench.loaded(pull);
                // Any reason of a refusal is accepted.
                if let Identification::Found(found) = outcome.identification {
                    let (b, _) = bench.errors(&found);
                    assert!(b.abs() < 0.12, "{what}: b off by {b}, {:?}, {bench:?}", outcome.travel);
                }
            };
            for share in [0.05, 0.1, 0.2, 0.4] {
                check(format!("gravity {share}"), &|_, _| -share);
                check(format!("an arm that starts hanging, {share}"), &|at, _| -share * (at / turn).sin());
                check(format!("an arm, {share}"), &|at, _| -share * (at / turn + 2.0).sin());
                check(format!("a spring, {share}"), &|at, _| -share * at / 1000.0);
                check(format!("a load from 1.5 s on, {share}"), &|_, ms| {
                    if ms > 1500 { -share } else { 0.0 }
                });
            }
        }
    }
}

#[test]
fn an_encoder_that_does_not_count_or_counts_backwards_is_refused() {
    let setup = Setup::new("AM 60 A");
    let faulty = |cable, from_ms| {
        setup.disturbed(|bench| {
            if bench.ms >= from_ms {
                bench.axes[0].cable = cable;
            }
        })
    };
    refused(faulty(Cable::Reversed, 0), &[Refusal::Backwards], "reversed");
    for from_ms in [0, 600, 1_000, 1_290, 2_000] {
        refused(faulty(Cable::Unplugged, from_ms), &[Refusal::NoCounts], &format!("unplugged at {from_ms}"));
    }
    refused(faulty(Cable::Unplugged, 2_600), &[Refusal::HeldAtLowVoltage], "unplugged at the low voltage");
}

#[test]
fn a_motor_that_friction_holds_at_the_low_voltage_is_refused_for_this_reason() {
    for name in ["AM 60 A", "AM 20 C", "AM 40 C"] {
        for (friction, volts) in [(0.25, 12.6), (0.15, 8.0)] {
            let battery = Battery { emf: Volts(volts), resistance: Ohms(0.05) };
            let outcome = Setup { friction, battery, ..Setup::new(name) }.run();
            refused(outcome, &[Refusal::HeldAtLowVoltage], &format!("{name}, {friction} at {volts} V"));
        }
    }
}

#[test]
fn with_one_broken_wire_a_motor_turns_no_further_than_announced() {
    for (limit, breaks_at) in [(u32::MAX, &[0, 600, 1_000, 1_290, 2_000][..]), (900, &[0, 300, 450])] {
        for name in ["AM 60 A", "AM 20 C"] {
            let setup = Setup { limit, period_ms: 10, ..Setup::new(name) };
            let most = i64::from(travel(setup.settings().winding.emf, Millivolts::new(12_600), limit));
            for &from_ms in breaks_at {
                let outcome = setup.disturbed(|bench| {
                    if bench.ms >= from_ms {
                        bench.axes[0].cable = Cable::OneWire;
                    }
                });
                let what = format!("{name}, limit {limit}, broken at {from_ms} ms");
                let (least, reached) = outcome.travel;
                assert!(reached <= most && -least <= most, "{what}: {least} to {reached} of {most}");
                refused(outcome, &[Refusal::NoCounts], &what);
            }
        }
    }
}

#[test]
fn a_weak_battery_is_refused() {
    for (emf, ohms) in [(5.5, 0.0), (12.6, 3.0)] {
        let battery = Battery { emf: Volts(emf), resistance: Ohms(ohms) };
        let outcome = Setup { battery, ..Setup::new("AM 60 A") }.run();
        refused(outcome, &[Refusal::Battery], &format!("{battery:?}"));
    }
}

/// A motor that is being identified for half a second.
fn half_a_second() -> Bench<1> {
    let mut bench = Setup::new("AM 60 A").bench();
    bench.run_ms(500);
    let report = bench.report();
    assert!(matches!(report.identification, Identification::Running(_)), "{report:?}");
    bench
}

#[test]
fn another_command_ends_an_identification() {
    for other in [Setpoint::Disabled, Setpoint::ConstantPower(Control::ZERO), velocity(100)] {
        let mut bench = half_a_second();
        bench.set(0, other);
        let [report] = bench.tick().motors;
        assert_eq!(report.identification, Identification::Refused(Refusal::Stopped));
    }
}

#[test]
fn a_lost_battery_or_encoder_ends_it_for_good() {
    let losses: [fn(&mut Bench<1>); 2] =
        [|bench| bench.battery_read = false, |bench| bench.axes[0].unread_ms = 100];
    for (lost, on_fault) in
        losses.into_iter().flat_map(|lost| [OnFault::Coast, OnFault::Brake].map(|of| (lost, of)))
    {
        let mut bench = half_a_second();
        bench.configure(0, |settings| settings.on_fault = on_fault);
        lost(&mut bench);
        bench.run_ms(150);
        bench.battery_read = true;
        for _ in 0..3 {
            let [report] = bench.tick().motors;
            assert_eq!(report.identification, Identification::Refused(Refusal::Interrupted));
            assert_eq!(report.drive, Drive::COAST);
        }
    }
}

#[test]
fn with_a_fault_of_the_encoder_an_identification_is_refused_until_the_motor_is_disabled() {
    let mut bench = half_a_second();
    bench.axes[0].cable = Cable::Unplugged;
    bench.set(0, velocity(2_000));
    bench.run_ms(1_000);
    assert_eq!(bench.report().faults.encoder, Some(EncoderFault::Stuck));
    bench.set(0, Setpoint::Identify { travel_limit: u32::MAX });
    let [report] = bench.tick().motors;
    assert_eq!(report.identification, Identification::Refused(Refusal::Interrupted));
    bench.axes[0].cable = Cable::Plugged;
    bench.set(0, Setpoint::Disabled);
    bench.run_ms(2_000);
    bench.set(0, Setpoint::Identify { travel_limit: u32::MAX });
    let [report] = bench.tick().motors;
    assert!(matches!(report.identification, Identification::Running(_)), "{report:?}");
}

#[test]
fn a_motor_that_turns_is_not_driven() {
    let mut bench = Setup::new("AM 60 A").bench();
    bench.axes[0].turned = Some(50.0);
    for _ in 0..8 {
        assert_eq!(bench.tick().motors[0].drive, Drive::COAST);
    }
    bench.battery_read = false;
    let [report] = bench.tick().motors;
    assert_eq!(report.identification, Identification::Refused(Refusal::NotAtRest));
}
