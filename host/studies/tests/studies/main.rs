//! Tests of runs on the simulated board, of their texts, and of their figures.

#[path = "../scenario_files/mod.rs"]
mod scenario_files;
#[path = "../../../chart/tests/snapshot/mod.rs"]
mod snapshot;

mod figures;
mod headlines;
mod scenarios;
mod survey;

use simulated::scenario::Scenario;
use simulated::sim;
use simulated::trace::Trace;
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};
use studies::compare::Comparison;
use studies::report::RunReport;
use studies::survey::reference;

/// Returns when no other test uses the clock of the mock driver. All tests of the process share this clock.
fn clock() -> MutexGuard<'static, ()> {
    static CLOCK: Mutex<()> = Mutex::new(());
    CLOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

fn run(scenario: &Scenario) -> Trace {
    let _clock = clock();
    sim::run(scenario, &mut |_| ()).expect("the simulation runs")
}

fn report(scenario: Scenario) -> RunReport {
    let (as_set, without) = (run(&scenario), run(&scenario.without_braking()));
    RunReport::new(scenario, as_set, without)
}

/// The quick comparison, for all tests of it.
static COMPARISON: LazyLock<Comparison> = LazyLock::new(|| {
    let _clock = clock();
    Comparison::new(true, &mut |_, _| ()).expect("it runs")
});

/// The tasks of the reference, for all tests of them.
static REFERENCE: LazyLock<Vec<reference::Row>> =
    LazyLock::new(|| reference::run(&mut |_, _| ()).expect("it runs"));
