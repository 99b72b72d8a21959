//! Does independent work on all cores of the processor.

use crate::StudyError;
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread;

/// The results of `work` for every item, in the order of the items. The calling thread gives `progress` the number of
/// items that are done and the number of all items.
pub(super) fn map<T: Sync, R: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, StudyError> + Sync,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Vec<R>, StudyError> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let left = Mutex::new(items.iter().enumerate());
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let (sender, results) = mpsc::channel();
    let mut all = Vec::with_capacity(items.len());
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
            progress(all.len(), items.len());
        }
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, result)| result).collect()
}
