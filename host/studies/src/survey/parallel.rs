//! Does independent work on all cores of the processor.

use super::Knowledge;
use crate::StudyError;
use motor_hub::units::Period;
use simulated::scenario::Scenario;
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;

/// The results of `work` for every item, in the order of the items. The calling thread gives `done` the number of items
/// that are done.
pub(super) fn map<T: Sync, R: Send>(
    items: &[T],
    work: impl Fn(&T) -> R + Sync,
    mut done: impl FnMut(usize),
) -> Vec<R> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let left = Mutex::new(items.iter().enumerate());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let (sender, results) = mpsc::channel();
    let mut all: Vec<(usize, R)> = Vec::with_capacity(items.len());
    thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, work) = (sender.clone(), &next, &work);
            scope.spawn(move || {
                while let Some((index, item)) = next() {
                    // The receiver outlives the threads.
                    let _ = sender.send((index, work(item)));
                }
            });
        }
        drop(sender);
        for result in results {
            all.push(result);
            done(all.len());
        }
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, result)| result).collect()
}

/// The results of `work` for every item at every period in ms: first configured exactly, then not configured.
/// `progress` gets the number of finished runs and the number of all runs.
pub(super) fn at_all_periods<T: Sync, R: Send>(
    items: &[T],
    periods: &[u32],
    work: impl Fn(&T, Knowledge, u32) -> Result<R, StudyError> + Sync,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Vec<[Vec<R>; 2]>, StudyError> {
    let mut cases = Vec::new();
    for item in items {
        for knowledge in [Knowledge::EXACT, Knowledge::UNKNOWN] {
            cases.extend(periods.iter().map(|&ms| (item, knowledge, ms)));
        }
    }
    let total = cases.len();
    let run = |&(item, knowledge, ms): &(&T, Knowledge, u32)| work(item, knowledge, ms);
    let results = map(&cases, run, |done| progress(done, total));
    let mut results = results.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter();
    let mut of_item = || [(); 2].map(|()| results.by_ref().take(periods.len()).collect());
    Ok(items.iter().map(|_| of_item()).collect())
}

/// The scenario at this control period, with its motors configured like this.
pub(super) fn variant(
    scenario: &Scenario,
    knowledge: Knowledge,
    period_ms: u32,
) -> Result<Scenario, StudyError> {
    let mut scenario = scenario.clone();
    scenario.period = Period::from_millis(period_ms)?;
    knowledge.configure(&mut scenario);
    Ok(scenario)
}
