//! A motor on a bench that does to it whatever a test wants is asked to learn what it is: it says so within
//! 10 %, or says why it cannot.

#![cfg(feature = "model")]
#![expect(clippy::expect_used, reason = "a failed expectation is a failed test")]

use motor_hub::braking::{Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive};
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::{Motor as Constants, characterised, motors};
use motor_hub::model::friction::Friction;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::rig::Rig;
use motor_hub::model::si::{Hertz, KgM2, NewtonMetres, Ohms, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motion::Tracker;
use motor_hub::motor::{Motor, Setpoint, Settings};
use motor_hub::regulator::identify::{Identification, Identified, Refusal, travel};
use motor_hub::units::{
    Control, CountsPerSecond, EmfConstant, Inductance, Micros, Millivolts, Period, Resistance,
};
use std::f64::consts::TAU;

/// What friction and loads are shares of: the torque of the motor held at 12 V.
const NOMINAL: Volts = Volts(12.0);

/// A motor on the bench, and what the hub is told of it.
#[derive(Clone, Copy, Debug)]
struct Bench {
    motor: Constants,
    /// Of the load, in those of the rotor.
    inertia: f64,
    /// Coulomb friction, as a share of the stall torque.
    friction: f64,
    /// Resistance and back EMF told, as factors.
    told: (f64, f64),
    battery: Battery,
    period_ms: u32,
    scheme: Scheme,
    limit: u32,
}

/// What came of it.
struct Outcome {
    identification: Identification,
    /// Counts, least and most.
    travel: (i64, i64),
}

impl Bench {
    fn new(name: &str) -> Self {
        Self::of(characterised(name).expect("in the catalogue"))
    }

    fn of(motor: Constants) -> Self {
        Self {
            motor: motor.with_measured_rotor_inertia(),
            inertia: 1.0,
            friction: 0.03,
            told: (1.0, 1.0),
            battery: Battery { emf: Volts(12.6), resistance: Ohms(0.0) },
            period_ms: 50,
            scheme: Scheme::A,
            limit: u32::MAX,
        }
    }

    fn load(&self) -> Load {
        let Constants { j, eta, gear_ratio, .. } = self.motor;
        Load::inertia(KgM2(self.inertia * j.0 * eta * gear_ratio * gear_ratio))
    }

    fn stall(&self) -> f64 {
        self.motor.stall_torque(NOMINAL).0
    }

    fn settings(&self) -> Settings {
        let (r, ke) = self.told;
        let winding = Winding {
            emf: EmfConstant::from_ke(self.motor.ke.0 * ke, self.motor.counts_per_rev_motor)
                .expect("in range"),
            resistance: Resistance::from_ohms(self.motor.r.0 * r).expect("in range"),
            inductance: Inductance::from_millihenries(1e3 * self.motor.l.0).ok(),
        };
        Settings::for_scheme(winding, self.scheme)
    }

    /// The true b in counts/s² per volt, and c in volts.
    fn truth(&self) -> (f64, f64) {
        let ohms = self.motor.r.0 + 0.1;
        let per_volt = self.motor.kt.0 * self.motor.counts_per_rev_motor / (TAU * ohms);
        let friction = self.friction * self.stall() * ohms / self.motor.kt.0;
        (per_volt / Shaft::new(&self.motor, &self.load()).inertia.0, friction)
    }

    fn run(&self) -> Outcome {
        self.disturbed(|_, _| 0.0, |counts, _| counts)
    }

    /// `pull` is a torque on the motor's shaft, as a share of the stall torque, by counts and milliseconds;
    /// `wire` is what the encoder makes of the counts.
    fn disturbed(&self, pull: impl Fn(f64, u64) -> f64, wire: impl Fn(i64, u64) -> i64) -> Outcome {
        let friction = Friction::with_coulomb(NewtonMetres(self.friction * self.stall()));
        let motor = Constants { friction, ..self.motor };
        let bridge = Bridge::new(BridgeConstants::IDEAL);
        let plant = Plant::new(motor, self.load(), bridge, Hertz(20_000.0));
        let mut rig = Rig::new(self.battery, vec![plant]);
        let mut hub = Motor::new(self.settings(), Period::from_millis(self.period_ms).expect("in range"));
        hub.set(Setpoint::Identify { travel_limit: self.limit });
        let mut tracker = Tracker::default();
        let mut outcome = Outcome { identification: Identification::None, travel: (0, 0) };
        let mut drive = Drive::COAST;
        for ms in 0..40_000 {
            let now = Micros::new(1000 * ms);
            let plant = rig.plants.first().expect("there is one");
            let (counts, place) = (plant.counts(), plant.angle() / TAU * motor.counts_per_rev_motor);
            outcome.travel = (outcome.travel.0.min(counts), outcome.travel.1.max(counts));
            let reading = tracker.step(wire(counts, ms) as u16, now);
            hub.sample(reading);
            if ms % u64::from(self.period_ms) == 0 {
                let battery = Millivolts::from_volts(rig.voltage().0).ok();
                let report = hub.step(now, Some(reading), battery);
                outcome.identification = report.identification;
                drive = report.drive;
                if !matches!(report.identification, Identification::Running(_)) {
                    assert_eq!(drive, Drive::COAST, "it coasts afterwards");
                    return outcome;
                }
            }
            let torque = pull(place, ms) * self.stall() * motor.eta * motor.gear_ratio;
            let command = PlantInput {
                torque_after: NewtonMetres(torque),
                ..PlantInput::pwm(drive.mode, drive.duty.to_f64())
            };
            rig.run(Seconds(1e-3), &[command]);
        }
        panic!("no end: {self:?}");
    }

    /// How far what was found is off: b in shares of itself, c in volts.
    fn errors(&self, found: &Identified) -> (f64, f64) {
        let (b, c) = self.truth();
        let gain = f64::from(found.dynamics.gain.to_f32());
        (gain / b - 1.0, f64::from(found.dynamics.friction.get()) / 1e3 - c)
    }
}

fn found(outcome: &Outcome) -> Identified {
    match outcome.identification {
        Identification::Found(found) => found,
        other => panic!("{other:?}"),
    }
}

/// Every motor with these loads, frictions and told constants.
fn benches(loads: &[f64], frictions: &[f64], told: &[(f64, f64)]) -> Vec<Bench> {
    let each = |motor| {
        loads.iter().flat_map(move |&inertia| {
            frictions.iter().flat_map(move |&friction| {
                told.iter().map(move |&told| Bench { inertia, friction, told, ..Bench::of(motor) })
            })
        })
    };
    motors().flat_map(each).collect()
}

const TOLD: [(f64, f64); 5] = [(1.0, 1.0), (0.7, 1.1), (1.3, 0.9), (0.7, 0.9), (1.3, 1.1)];

/// Runs all of them; the errors of b in order, and how many were refused.
fn sweep(benches: &[Bench]) -> (Vec<f64>, usize) {
    let mut errors = Vec::new();
    for bench in benches {
        if let Identification::Found(found) = bench.run().identification {
            errors.push(bench.errors(&found).0.abs());
        }
    }
    errors.sort_by(f64::total_cmp);
    let refused = benches.len() - errors.len();
    (errors, refused)
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[(share * (sorted.len() - 1) as f64) as usize]
}

#[test]
fn every_motor_of_the_catalogue_is_known_within_10_percent() {
    for (period_ms, told) in [(10, (0.7, 1.1)), (50, (1.3, 0.9))] {
        let mut benches = benches(&[0.0, 4.0], &[0.0, 0.1], &[told]);
        benches.iter_mut().for_each(|bench| bench.period_ms = period_ms);
        let (errors, refused) = sweep(&benches);
        assert!(quantile(&errors, 0.9) < 0.06, "{period_ms} ms: {errors:?}");
        // A Core Hex with four rotors of its own is too heavy for its four counts a turn.
        assert!(refused * 10 <= benches.len(), "{period_ms} ms: {refused} of {}", benches.len());
    }
}

/// For the record: `cargo test --test identify report -- --ignored --nocapture`.
#[test]
#[ignore = "a report, not a test"]
fn report_of_what_all_of_the_catalogue_comes_to() {
    for (period_ms, emf, ohms, limit) in [
        (1, 12.6, 0.0, u32::MAX),
        (10, 12.6, 0.0, u32::MAX),
        (20, 12.6, 0.0, u32::MAX),
        (50, 12.6, 0.0, u32::MAX),
        (100, 12.6, 0.0, u32::MAX),
        (50, 8.0, 0.0, u32::MAX),
        (50, 12.6, 0.15, u32::MAX),
        (50, 12.6, 0.0, 1_000),
        (10, 12.6, 0.0, 500),
    ] {
        let mut benches = benches(&[0.0, 1.0, 4.0], &[0.0, 0.05, 0.1], &TOLD);
        for bench in &mut benches {
            bench.period_ms = period_ms;
            bench.battery = Battery { emf: Volts(emf), resistance: Ohms(ohms) };
            bench.limit = limit;
        }
        let (errors, refused) = sweep(&benches);
        let [median, p90, most] = [0.5, 0.9, 1.0].map(|share| 100.0 * quantile(&errors, share));
        println!(
            "T {period_ms} ms, {emf} V, {ohms} ohm, limit {limit}: {} cases, {refused} refused, b off by \
             {median:.1} / {p90:.1} / {most:.1} %",
            benches.len()
        );
    }
}

#[test]
fn friction_and_back_emf_are_found_with_honest_errors() {
    let bench = Bench { friction: 0.05, ..Bench::new("AM 60 A") };
    let found = found(&bench.run());
    let (b, c) = bench.errors(&found);
    assert!(b.abs() < 3.0 * f64::from(found.gain_error) / 1e3, "{b} {found:?}");
    assert!(c.abs() < 3.0 * f64::from(found.friction_error.get()) / 1e3, "{c} {found:?}");
    // Back EMF and drag: q / b = Ke / kc + B R / (Kt kc).
    let Constants { ke, kt, b: drag, r, .. } = bench.motor;
    let true_emf = EmfConstant::from_ke(ke.0 + drag.0 * (r.0 + 0.1) / kt.0, 28.0).expect("in range");
    let off = f64::from(found.emf.to_bits()) / f64::from(true_emf.to_bits()) - 1.0;
    assert!(!found.emf_is_told && off.abs() < 3.0 * f64::from(found.emf_error) / 1e3, "{off} {found:?}");
    let product = found.dynamics.gain.to_f32() * found.emf.to_bits() as f32 / (1e3 * (1 << 20) as f32);
    assert!((found.dynamics.decay.to_f32() / product - 1.0).abs() < 1e-3);
    assert!((20..150).contains(&found.residual), "{found:?}");
}

#[test]
fn what_a_short_motion_cannot_tell_is_taken_as_told() {
    // A time constant of 13 s.
    let bench = Bench { inertia: 4.0, told: (1.0, 0.9), ..Bench::new("Matrix C") };
    let found = found(&bench.run());
    assert!(found.emf_is_told && found.emf_error > 100, "{found:?}");
    assert!((found.emf.to_bits() - bench.settings().winding.emf.to_bits()).abs() <= 1);
}

#[test]
fn a_scheme_changes_nothing_of_what_is_found() {
    // With too large a back EMF told, the bridge is open at the end of a stretch.
    for told in [(1.0, 1.0), (1.0, 1.1)] {
        for scheme in [Scheme::ForwardReverse, Scheme::A, Scheme::B, Scheme::C] {
            let bench = Bench { scheme, told, friction: 0.0, ..Bench::new("AM 60 A") };
            let (b, _) = bench.errors(&found(&bench.run()));
            assert!(b.abs() < 0.05, "{scheme:?} {told:?}: {b}");
        }
    }
}

#[test]
fn the_motor_turns_no_further_than_announced() {
    for limit in [u32::MAX, 2_000, 1_000, 900] {
        for bench in benches(&[0.0, 4.0], &[0.0], &[(1.0, 1.1), (1.0, 0.9)]) {
            let bench = Bench { limit, period_ms: 10, ..bench };
            let most = travel(bench.settings().winding.emf, Millivolts::new(12_600), limit);
            let (least, reached) = bench.run().travel;
            let most = i64::from(most);
            assert!(reached <= most && -least <= most, "{reached} {least} {most} {bench:?}");
        }
    }
}

#[test]
fn a_limit_shortens_the_motion_and_may_leave_too_little_of_it() {
    let bench = Bench { limit: 1_000, period_ms: 10, ..Bench::new("AM 60 A") };
    let outcome = bench.run();
    assert!(found(&outcome).gain_error < 50);
    assert!(outcome.travel.1 > 500, "{:?}", outcome.travel);
    let outcome = Bench { limit: 300, ..bench }.run();
    assert_eq!(outcome.identification, Identification::Refused(Refusal::TravelLimit));
    assert_eq!(outcome.travel, (0, 0));
}

fn refused(outcome: Outcome, reasons: &[Refusal], what: &str) {
    match outcome.identification {
        Identification::Refused(why) if reasons.contains(&why) => (),
        other => panic!("{what}: {other:?}, {:?}", outcome.travel),
    }
}

/// What a load does to a motor or hides from it, or b that is right all the same.
fn refused_or_right(bench: &Bench, outcome: &Outcome, what: &str) {
    if let Identification::Found(found) = outcome.identification {
        let (b, _) = bench.errors(&found);
        assert!(b.abs() < 0.12, "{what}: b off by {b}, {:?}, {bench:?}", outcome.travel);
    }
}

#[test]
fn a_motor_under_gravity_is_refused() {
    for name in ["AM 60 A", "AM 20 C", "AM 40 C", "AM 3.7 C"] {
        for (friction, share) in [(0.0, 0.1), (0.0, -0.1), (0.1, 0.05), (0.1, -0.05), (0.05, 0.4)] {
            let bench = Bench { friction, ..Bench::new(name) };
            let outcome = bench.disturbed(|_, _| share, |counts, _| counts);
            refused(outcome, &[Refusal::NotAtRest, Refusal::Load], &format!("{name} {share}"));
        }
    }
}

#[test]
fn a_spring_is_refused() {
    for friction in [0.0, 0.05] {
        for per_1000 in [0.1, 0.2, 0.4, 0.8, 2.0] {
            let bench = Bench { friction, ..Bench::new("AM 60 A") };
            let outcome = bench.disturbed(|counts, _| -per_1000 * counts / 1000.0, |counts, _| counts);
            let reasons = [Refusal::Spring, Refusal::Load, Refusal::NoCounts, Refusal::Implausible];
            refused(outcome, &reasons, &format!("{per_1000} of stall per 1000 counts"));
        }
    }
}

#[test]
fn a_stop_on_the_way_is_refused() {
    for at in [20.0, 100.0, 300.0, 1_000.0] {
        let stop = |counts: f64, _| if counts > at { -0.3 * (counts - at) } else { 0.0 };
        let outcome = Bench::new("AM 60 A").disturbed(stop, |counts, _| counts);
        refused(
            outcome,
            &[Refusal::NoCounts, Refusal::Uneven, Refusal::Load, Refusal::Spring],
            &format!("{at}"),
        );
    }
}

#[test]
fn no_load_makes_it_say_something_wrong() {
    for name in ["AM 60 A", "AM 40 B", "AM 20 B", "AM 3.7 B", "Matrix C"] {
        for (inertia, friction, period_ms) in [(0.0, 0.0, 50), (1.0, 0.05, 10), (4.0, 0.05, 50)] {
            let bench = Bench { inertia, friction, period_ms, ..Bench::new(name) };
            let turn = bench.motor.counts_per_rev_motor * bench.motor.gear_ratio / TAU;
            let check = |what: String, pull: &dyn Fn(f64, u64) -> f64| {
                refused_or_right(&bench, &bench.disturbed(pull, |counts, _| counts), &what);
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
    let bench = Bench::new("AM 60 A");
    refused(bench.disturbed(|_, _| 0.0, |_, _| 0), &[Refusal::NoCounts], "unplugged");
    refused(bench.disturbed(|_, _| 0.0, |counts, _| -counts), &[Refusal::Backwards], "reversed");
    for unplugged in [600, 1_000, 1_290, 2_000, 2_600] {
        let last = std::cell::Cell::new(0);
        let wire = |counts, ms| {
            if ms < unplugged {
                last.set(counts);
            }
            last.get()
        };
        refused(
            bench.disturbed(|_, _| 0.0, wire),
            &[Refusal::NoCounts],
            &format!("unplugged at {unplugged}"),
        );
    }
}

#[test]
fn a_weak_battery_is_refused() {
    for (emf, ohms) in [(5.5, 0.0), (12.6, 3.0)] {
        let battery = Battery { emf: Volts(emf), resistance: Ohms(ohms) };
        refused(
            Bench { battery, ..Bench::new("AM 60 A") }.run(),
            &[Refusal::Battery],
            &format!("{battery:?}"),
        );
    }
}

/// A motor that is being identified, half a second after it was asked to; its encoder counts.
fn half_a_second() -> (Motor, impl FnMut(&mut Motor, bool) -> motor_hub::motor::Report) {
    let mut motor = Motor::new(Settings::new(Winding::NEVEREST_60), Period::DEFAULT);
    motor.set(Setpoint::Identify { travel_limit: u32::MAX });
    let (mut tracker, mut ms) = (Tracker::default(), 0);
    let mut step = move |motor: &mut Motor, battery: bool| {
        ms += 50;
        let now = Micros::new(1000 * ms);
        let count = if ms > 250 { (ms - 250) as u16 } else { 0 };
        motor.step(now, Some(tracker.step(count, now)), battery.then_some(Millivolts::new(12_000)))
    };
    for _ in 0..10 {
        let report = step(&mut motor, true);
        assert!(matches!(report.identification, Identification::Running(_)), "{report:?}");
    }
    (motor, step)
}

#[test]
fn anything_else_that_is_asked_of_the_motor_ends_it() {
    for other in [
        Setpoint::Disabled,
        Setpoint::ConstantPower(Control::ZERO),
        Setpoint::Velocity(CountsPerSecond::new(100)),
    ] {
        let (mut motor, mut step) = half_a_second();
        motor.set(other);
        assert_eq!(step(&mut motor, true).identification, Identification::Refused(Refusal::Stopped));
    }
}

#[test]
fn a_lost_battery_or_encoder_ends_it_for_good() {
    let (mut motor, mut step) = half_a_second();
    for battery in [false, true, true] {
        let report = step(&mut motor, battery);
        assert_eq!(report.identification, Identification::Refused(Refusal::Interrupted));
        assert_eq!(report.drive, Drive::COAST);
    }
    let (mut motor, _) = half_a_second();
    let report = motor.step(Micros::new(600_000), None, Some(Millivolts::new(12_000)));
    assert_eq!(report.identification, Identification::Refused(Refusal::Interrupted));
}

#[test]
fn a_motor_that_turns_is_not_driven() {
    let mut motor = Motor::new(Settings::new(Winding::NEVEREST_60), Period::DEFAULT);
    motor.set(Setpoint::Identify { travel_limit: u32::MAX });
    let mut tracker = Tracker::default();
    for ms in (0..400).step_by(50) {
        let now = Micros::new(1000 * ms);
        let report = motor.step(now, Some(tracker.step(ms as u16 / 20, now)), Some(Millivolts::new(12_000)));
        assert_eq!(report.drive, Drive::COAST);
    }
    let now = Micros::new(400_000);
    let report = motor.step(now, Some(tracker.step(0, now)), None);
    assert_eq!(report.identification, Identification::Refused(Refusal::NotAtRest));
}
