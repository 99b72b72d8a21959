//! What becomes of a motor when something else is asked of it, or configured: every state that it may be in, every event,
//! at rest, at speed and driven by its load, in every scheme, at periods of 1 to 100 ms. The motor is configured, unknown,
//! or has coefficients of a host.
//!
//! At each such transition the physics runs on, and the winding's current, the speed and the control value are
//! held against what the new demand justifies. Cells that fail are printed as a table.

use crate::bench::{BATTERY, Bench, Constants, Knowledge, Tick};
use crate::table::{Demand, Event, Motion, Placed, State, enter, happen, scheme_name, under_way};
use motor_hub::braking::Scheme;
use motor_hub::units::Period;
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The regulator does not know the acceleration per volt, or is PID, which does not use it.
fn guesses(bench: &Bench) -> bool {
    bench.settings.dynamics.is_none() || bench.settings.coefficients.is_some()
}

/// The currents that a demand justifies at a speed: between what balances the load and what reaches the speed
/// that is asked for within a tick.
fn justified(bench: &Bench, demand: Demand, speed: f64) -> (f64, f64) {
    let Constants { kappa, ohms, per_ampere, .. } = bench.constants;
    let need = bench.need(speed);
    let emf = kappa * speed;
    let [mut least, mut most] = [-BATTERY, BATTERY].map(|volts| (volts - emf) / ohms);
    (least, most) = (least.min(0.0), most.max(0.0));
    // The catch diodes hold a motor that is much too fast.
    let caught = ((emf.abs() - BATTERY) / ohms).max(0.0) * -emf.signum();
    let seconds = f64::from(bench.period.as_millis()) / 1e3;
    let pressing = bench.stop.is_some_and(|stop| i64::from(bench.position()) >= stop);
    let towards = |wanted: f64| {
        if pressing && wanted > 0.0 {
            most
        } else {
            (need + (wanted - speed) / (per_ampere * seconds)).clamp(least, most)
        }
    };
    let span = |currents: &[f64]| {
        currents.iter().fold((f64::MAX, f64::MIN), |(low, high), &i| (low.min(i), high.max(i)))
    };
    let (low, high) = match demand {
        Demand::Coast => span(&[0.0, caught]),
        Demand::Brake => span(&[-emf / ohms]),
        Demand::Power(share) => {
            let current = (share * BATTERY - emf) / ohms;
            span(&[
                if current * share < 0.0 { 0.0 } else { current },
                current.min(caught).min(0.0).max(least),
            ])
        }
        Demand::Speed(wanted) => span(&[need, towards(wanted)]),
        Demand::Position { target, limit } => {
            let distance = f64::from(target.wrapping_sub(bench.position()));
            let braking = speed * speed / (per_ampere * bench.constants.stall_current) + 300.0;
            let wanted = if distance.abs() < 4.0 { 0.0 } else { limit * distance.signum() };
            if distance.abs() > braking {
                span(&[need, towards(wanted)])
            } else {
                span(&[need, towards(0.0), towards(wanted), towards(30.0), towards(-30.0)])
            }
        }
    };
    if bench.settings.scheme == Scheme::ForwardReverse && (low * speed < 0.0 || guesses(bench)) {
        // There is no braking regime: below 0 it is all or nothing.
        return if speed > 0.0 { (least, high.max(0.0)) } else { (least, most) };
    }
    (low, high)
}

/// What a cell may break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rule {
    /// A step of current that nothing asks for: beyond 10 % of the stall current, 20 % for an unknown motor, 21 % for
    /// PID.
    Step,
    /// The speed that it should keep is lost.
    Dip,
    /// It presses on though it should stand.
    PressesOn,
    /// It does not leave the stop.
    Stays,
    /// A control value or an estimate outside of its range.
    Range,
}

/// By how much rules are broken, of the allowed.
type Verdict = Vec<(Rule, f64)>;

fn out_of_range(tick: &Tick) -> bool {
    let control = tick.report.control.get();
    let speed = tick.report.velocity.to_f64();
    control == i16::MIN || tick.report.drive.duty.to_f64() > 1.0 || speed.abs() > 1e5
}

/// The transition from a state that was entered before.
fn cell(event: Event, state: State, entered: &Placed, before: f64) -> Verdict {
    let mut placed = entered.clone();
    let asked = placed.1;
    let demand = happen(event, state, &mut placed);
    let mut bench = placed.0;
    let Constants { stall_current, free_speed, .. } = bench.constants;
    let ms = bench.period.as_millis();
    let (from, start) = (bench.speed(), bench.position());
    let balanced = (before - bench.need(from)).abs() < 0.05 * stall_current;
    let interrupted = matches!(event, Event::BatteryGap | Event::EncoderGap);
    let keeps = match demand {
        Demand::Speed(speed) => (speed - from).abs() < 0.1 * free_speed,
        Demand::Position { target, limit } => {
            (limit - from.abs()).abs() < 0.1 * free_speed && target.abs_diff(start) > 5_000
        }
        _ => false,
    } && bench.stop.is_none();
    let wanted = match demand {
        Demand::Speed(speed) => speed,
        Demand::Position { target, limit } if keeps => limit * f64::from(target.wrapping_sub(start)).signum(),
        _ => from,
    };
    let sent_back = bench.stop.is_some()
        && demand != asked
        && matches!((event, demand), (Event::Back | Event::Behind, _));
    let lets_go = bench.stop.is_some() && matches!(event, Event::Zero | Event::Here);

    // Its estimate of the speed is half a window old: what follows the first tick is the loop's own answer.
    let guesses = guesses(&bench) || event == Event::ConfigureDynamics;

    let block = 10u32.div_ceil(ms);
    let horizon = if bench.stop.is_some() { 600 } else { 300.max(4 * ms) };
    let (mut step, mut dip, mut pressing) = (0.0f64, 0.0f64, vec![]);
    let mut range = false;
    let mut left = false;
    for index in 0..horizon / (block * ms) {
        let at = index * block * ms;
        let (mut low, mut high) = justified(&bench, demand, bench.speed());
        let (mut current, mut estimate) = (0.0, 0.0);
        for _ in 0..block {
            let tick = bench.tick();
            current += tick.current / f64::from(block);
            estimate = tick.report.velocity.to_f64();
            range |= out_of_range(&tick);
            dip = dip.max((tick.speeds.1 - wanted).abs());
            let (l, h) = justified(&bench, demand, bench.speed());
            (low, high) = (low.min(l), high.max(h));
        }
        let first = if interrupted { 0.0 } else { before };
        (low, high) = (low.min(first), high.max(first));
        if guesses && !balanced {
            // What the load takes is not known; no current is as good a start as any.
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        if guesses {
            // The set-point's own step counts, though the speed was not reached before.
            let stepped = match (asked, demand) {
                (Demand::Speed(old), Demand::Speed(new)) => bench.speed() + (old - new),
                (Demand::Speed(old), Demand::Position { limit, .. }) => bench.speed() + (old - limit),
                _ => bench.speed(),
            };
            // Of a gap no more is known than the mean speed in it, and of a motor that was not known before,
            // that in the window.
            let blind =
                matches!(event, Event::EncoderGap | Event::ConfigureDynamics) || state == State::EncoderLost;
            let believed = if blind { estimate } else { bench.speed() };
            for seen in [stepped, believed] {
                let (l, h) = justified(&bench, demand, seen);
                (low, high) = (low.min(l), high.max(h));
            }
        }
        if at < if guesses { 20.max(ms) } else { 40.max(2 * ms) } {
            step = step.max(low - current).max(current - high);
        }
        if at >= 200 + ms {
            pressing.push(current - bench.need(bench.speed()));
        }
        left |= at <= 200 + ms && bench.position() < start - 5;
    }
    let mut verdict = vec![];
    let mut judge = |rule, value: f64, allowed: f64| {
        if value > allowed {
            verdict.push((rule, value));
        }
    };
    let allowed = match event {
        // The rule itself says that a control value means another mean current.
        Event::LinearDuty => 0.3,
        // The largest step is 20.3 %: Scheme C at 100 ms, after a gap of the encoder under a lowered load.
        _ if bench.motor.settings().coefficients.is_some() => 0.21,
        _ if guesses => 0.2,
        _ => 0.1,
    };
    judge(Rule::Step, step / stall_current, allowed);
    let off = (wanted - from).abs() / free_speed;
    let keeps_worse = guesses && event != Event::ConfigureDynamics;
    let allowed = match (balanced && !interrupted, keeps_worse) {
        _ if event == Event::LinearDuty => 0.25,
        (true, false) => 0.055,
        (true, true) => 0.1,
        // The load must be estimated first.
        (false, _) => 0.25,
    };
    judge(Rule::Dip, if keeps { dip / free_speed } else { 0.0 }, allowed + off);
    let presses = pressing.iter().sum::<f64>().abs() / pressing.len().max(1) as f64;
    judge(Rule::PressesOn, if lets_go { presses / stall_current } else { 0.0 }, 0.05);
    judge(Rule::Stays, if sent_back && !left { 1.0 } else { 0.0 }, 0.0);
    judge(Rule::Range, if range { 1.0 } else { 0.0 }, 0.0);
    verdict
}

/// Cells of one rule, state, event and knowledge.
type Group = (Rule, String, &'static str);

/// How far off, in which scheme, at which period.
type Failure = (f64, &'static str, u32);

/// How many cells there were, and which failed.
#[derive(Default)]
struct Outcome {
    cells: usize,
    failed: usize,
    groups: BTreeMap<Group, Vec<Failure>>,
    sizes: BTreeMap<(String, &'static str), usize>,
}

const fn knowledge_name(knowledge: Knowledge) -> &'static str {
    match knowledge {
        Knowledge::Configured => "configured",
        Knowledge::Unknown => "unknown",
        Knowledge::Coefficients => "coefficients",
    }
}

fn column(motion: Motion, knowledge: Knowledge, scheme: Scheme, ms: u32, outcome: &Mutex<Outcome>) {
    let period = Period::from_millis(ms).expect("in range");
    if scheme == Scheme::ForwardReverse && matches!(motion, Motion::Lowering | Motion::Overrun) {
        // Nothing there can brake it gently.
        return;
    }
    let moved = under_way(motion, knowledge, scheme, period);
    for state in State::ALL {
        let Some(entered) = enter(state, motion, &moved) else { continue };
        let before = entered.0.current();
        for event in Event::all() {
            let same = event == Event::Scheme(scheme);
            let rough = event == Event::Scheme(Scheme::ForwardReverse)
                && matches!(motion, Motion::Lowering | Motion::Overrun);
            if same || rough || !event.concerns(knowledge) {
                continue;
            }
            let verdict = cell(event, state, &entered, before);
            let name = format!("{state:?}/{motion:?} -> {}", event.name());
            let mut outcome = outcome.lock().expect("no panic");
            outcome.cells += 1;
            outcome.failed += usize::from(!verdict.is_empty());
            *outcome.sizes.entry((name.clone(), knowledge_name(knowledge))).or_default() += 1;
            for (rule, value) in verdict {
                let group =
                    outcome.groups.entry((rule, name.clone(), knowledge_name(knowledge))).or_default();
                group.push((value, scheme_name(scheme), ms));
            }
        }
    }
}

fn print(outcome: &Outcome) {
    println!("{} of {} cells fail", outcome.failed, outcome.cells);
    let mut rows: Vec<_> = outcome.groups.iter().collect();
    rows.sort_by_key(|(_, cells)| std::cmp::Reverse(cells.len()));
    for ((rule, name, knowledge), cells) in rows {
        let worst = cells.iter().map(|cell| cell.0).fold(0.0, f64::max);
        let of = outcome.sizes.get(&(name.clone(), *knowledge)).copied().unwrap_or_default();
        let mut schemes: Vec<_> = cells.iter().map(|cell| cell.1).collect();
        schemes.sort_unstable();
        schemes.dedup();
        let mut periods: Vec<_> = cells.iter().map(|cell| cell.2).collect();
        periods.sort_unstable();
        periods.dedup();
        println!(
            "{rule:?} {knowledge:12} {name:44} {:2} of {of:2}, worst {worst:6.3}  {schemes:?} {periods:?}",
            cells.len()
        );
    }
}

#[test]
fn a_transition_makes_no_step_that_its_demand_does_not_justify() {
    // A prime number, so that every motion, knowledge, scheme and period is among them.
    every_column(7);
}

#[test]
#[ignore = "long: cargo xtask long"]
fn no_transition_at_all_makes_a_step_that_its_demand_does_not_justify() {
    every_column(1);
}

/// Every `nth` column of the table.
fn every_column(nth: usize) {
    let mut columns = vec![];
    for motion in Motion::ALL {
        for knowledge in [Knowledge::Configured, Knowledge::Unknown, Knowledge::Coefficients] {
            for scheme in Scheme::EACH {
                for ms in [1, 10, 50, 100] {
                    columns.push((motion, knowledge, scheme, ms));
                }
            }
        }
    }
    let columns: Vec<_> = columns.into_iter().step_by(nth).collect();
    let outcome = Mutex::new(Outcome::default());
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(&(motion, knowledge, scheme, ms)) =
                    columns.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    column(motion, knowledge, scheme, ms, &outcome);
                }
            });
        }
    });
    let outcome = outcome.into_inner().expect("no panic");
    print(&outcome);
    assert_eq!(outcome.failed, 0, "transitions fail");
}
